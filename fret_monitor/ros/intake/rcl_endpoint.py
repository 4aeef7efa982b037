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

"""What publishers and subscriptions have in common that are made below the node's functions."""

from typing import Any

from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.type_support import check_is_valid_msg_type


UNNAMED = '_NODE_NAME_UNKNOWN_'
"""The node of an endpoint, until the middleware has discovered it."""


class RclEndpoint:
    """
    A publisher or subscription of a node; its owner closes it.

    `handle` is rclpy's object for that of rcl: hold it (`with`) while C uses it.
    """

    def __init__(self, kind: Any, node: Node, msg_type: Any, topic: str,
                 qos_profile: QoSProfile) -> None:
        """
        Advertise the topic, or subscribe to it; `kind` is rclpy's class of the handle.

        Raises
        ------
        InvalidTopicNameException
            if the name of the topic is not valid.
        RuntimeError
            if the middleware refuses.
        """
        self.msg_type = msg_type
        self.qos_profile = qos_profile
        check_is_valid_msg_type(msg_type)  # imports its type support
        try:
            with node.handle:
                self.handle: Any = kind(
                    node.handle, msg_type, topic, qos_profile.get_c_qos_profile())
        except ValueError:
            node._validate_topic_or_service_name(topic)
            raise

    @property
    def topic_name(self) -> str:
        """The full name of the topic."""
        with self.handle:
            return str(self.handle.get_topic_name())

    def close(self) -> None:
        """Destroy it as soon as its handle is no longer held."""
        self.handle.destroy_when_not_in_use()
