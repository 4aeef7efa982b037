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
The details of violations: `copilot/violations` (docs/ros_interface.md, Topics).

C words them (`csrc/reporting/details.h`). They are built only while the topic has a subscriber or
violations are logged. The handler's message does not wait for them.
"""

from threading import Event

from diagnostic_msgs.msg import DiagnosticArray
from fret_monitor.model.names import DETAILS_TOPIC
from fret_monitor.ros.intake.node_time import as_time
from fret_monitor.ros.reports.messages import status_message
from fret_monitor.ros.settings.parameters import DEFAULT_HANDLER_DEPTH
from fret_monitor.ros.settings.qos import violation_profile
from fret_monitor.runtime.reporting import StatusRecord

from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node


class Details:
    """Publishes details of violations."""

    def __init__(self, node: Node, depth: int = DEFAULT_HANDLER_DEPTH) -> None:
        """Advertise the topic, with a queue of `depth` messages."""
        self._node = node
        self.listening = Event()
        self._publisher = node.create_publisher(
            DiagnosticArray, DETAILS_TOPIC, violation_profile(depth),
            event_callbacks=PublisherEventCallbacks(matched=lambda _: self.listening.set()))

    def listeners(self) -> int:
        """Return the number of subscribers; `listening` is set whenever it changes."""
        return int(self._publisher.get_subscription_count())

    def publish(self, detail: StatusRecord, stamp: int) -> None:
        """Publish the details of a violation, by its time (ns)."""
        array = DiagnosticArray(status=[status_message(detail)])
        array.header.stamp = as_time(stamp)
        self._publisher.publish(array)

    def close(self) -> None:
        """Withdraw the topic."""
        self._node.destroy_publisher(self._publisher)
