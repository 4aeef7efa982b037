# Copyright 2026 The fret_monitor authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""
Publishers of serialized messages, made below `Node.create_publisher`.

C publishes with them. They have no events, so that threads other than the executor's may make and
destroy them.
"""

from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.type_support import check_is_valid_msg_type


class RclPublisher:
    """
    A publisher of a node; its owner closes it.

    `handle` is rclpy's object for the `rcl_publisher_t`: hold it (`with`) while C uses it.
    """

    def __init__(self, node: Node, msg_type: Any, topic: str, qos_profile: QoSProfile) -> None:
        """
        Advertise the topic.

        Raises
        ------
        InvalidTopicNameException
            if the name of the topic is not valid.
        RCLError
            if the middleware refuses.
        """
        self.qos_profile = qos_profile
        check_is_valid_msg_type(msg_type)  # imports its type support
        try:
            with node.handle:
                self.handle: Any = _rclpy.Publisher(
                    node.handle, msg_type, topic, qos_profile.get_c_qos_profile())
        except ValueError:
            node._validate_topic_or_service_name(topic)
            raise

    @property
    def topic_name(self) -> str:
        """The full name of the topic."""
        with self.handle:
            return str(self.handle.get_topic_name())

    @property
    def subscriptions(self) -> int:
        """How many subscriptions have matched."""
        with self.handle:
            return int(self.handle.get_subscription_count())

    def close(self) -> None:
        """Destroy the publisher as soon as its handle is no longer held."""
        self.handle.destroy_when_not_in_use()
