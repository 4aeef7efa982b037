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
Subscriptions that no executor serves, made below `Node.create_subscription`.

An executor takes the messages of every subscription that the node lists, and rclpy's
`EventsExecutor` replaces the callback that C has set on it. These are created with the node's
handle, but the node does not list them.
"""

from typing import Any

from fret_monitor.ros.intake.rcl_endpoint import RclEndpoint

from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile


class RclSubscription(RclEndpoint):
    """A subscription of a node; its owner takes the messages and closes it."""

    def __init__(self, node: Node, msg_type: Any, topic: str, qos_profile: QoSProfile) -> None:
        """Subscribe; raises as `RclEndpoint`."""
        super().__init__(_rclpy.Subscription, node, msg_type, topic, qos_profile)
