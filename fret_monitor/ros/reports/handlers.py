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
The topics that announce violations, one for each requirement (docs/ros_interface.md).

rclpy would add two event handlers to each publisher, which its executor visits whenever it wakes.
"""

from fret_monitor.model.manifest import Manifest
from fret_monitor.ros.intake.rcl_endpoint import RclPublisher
from fret_monitor.ros.settings.parameters import DEFAULT_HANDLER_DEPTH
from fret_monitor.ros.settings.qos import violation_profile

from rclpy.node import Node
from std_msgs.msg import Empty


class Handlers:
    """Advertises the topics; `publishers` has one publisher for each requirement, in order."""

    def __init__(self, node: Node, manifest: Manifest, depth: int = DEFAULT_HANDLER_DEPTH) -> None:
        """Advertise the topics of all requirements, each with a queue of `depth` messages."""
        profile = violation_profile(depth)
        self.publishers = [
            RclPublisher(node, Empty, requirement.topic, profile)
            for requirement in manifest.requirements]

    def close(self) -> None:
        """Withdraw the topics."""
        for publisher in self.publishers:
            publisher.close()
