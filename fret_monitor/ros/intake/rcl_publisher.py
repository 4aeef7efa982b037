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

from fret_monitor.ros.intake.rcl_endpoint import RclEndpoint

from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile


class RclPublisher(RclEndpoint):
    """A publisher of a node; its owner closes it."""

    def __init__(self, node: Node, msg_type: Any, topic: str, qos_profile: QoSProfile) -> None:
        """Advertise the topic; raises as `RclEndpoint`."""
        super().__init__(_rclpy.Publisher, node, msg_type, topic, qos_profile)

    @property
    def subscriptions(self) -> int:
        """How many subscriptions have matched."""
        with self.handle:
            return int(self.handle.get_subscription_count())
