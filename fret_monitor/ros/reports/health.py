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
Once a second, the log of what is new, and the state of the monitor on `/diagnostics`.

C decides and words both (`csrc/reporting/review.h`; docs/operations.md). This collects the facts
that only the node knows, and publishes.
"""

from collections.abc import Sequence
from typing import Any, TYPE_CHECKING

from diagnostic_msgs.msg import DiagnosticArray
from fret_monitor.ros.acting.actions import Actions
from fret_monitor.ros.log_lines import log_lines
from fret_monitor.ros.reports.messages import status_message
from fret_monitor.ros.settings.qos import NO_EVENTS
from fret_monitor.ros.watch import Watch
from fret_monitor.runtime.reporting import (
    ActionCounts, BlackBoxCounts, Reporter, Review, StatusRecord, TopicFacts,
)

from rclpy.node import Node

if TYPE_CHECKING:
    from fret_monitor.ros.acting.blackbox import BlackBox
    from fret_monitor.ros.acting.gate import Gate

PERIOD = 1.0  # s between two reports
Counts = tuple[Sequence[ActionCounts], BlackBoxCounts | None]


class Health:
    """Logs what is new, and publishes diagnostics while `/diagnostics` has a subscriber."""

    def __init__(self, node: Node, reporter: Reporter, actions: Actions, gate: 'Gate | None',
                 blackbox: 'BlackBox | None', watch: Watch | None, before: Counts) -> None:
        """
        Advertise the topic; the caller then calls `review` and `publish` every `PERIOD`.

        `before` are the counts when monitoring began.
        """
        self._node = node
        self._clock: Any = node.get_clock()  # a ROSClock; Jazzy annotates it as a Clock
        self._publisher = node.create_publisher(
            DiagnosticArray, '/diagnostics', 10, event_callbacks=NO_EVENTS)
        self._review = Review(reporter, actions=before[0], blackbox=before[1])
        self._blackbox = blackbox
        self._gate = gate
        self._actions = actions
        self._watch = watch

    def review(self, topics: Sequence[TopicFacts]) -> None:
        """Log what is new; `topics` are the publishers of each topic, in order."""
        lines = [*self._actions.lines(),
                 *([] if self._blackbox is None else self._blackbox.lines())]
        self._review.look(
            topics,
            waits_for_clock=self._clock.ros_time_is_active
            and self._clock.now().nanoseconds <= 0,
            actions=self._actions.counts(),
            gate=None if self._gate is None else self._gate.look(),
            blackbox=None if self._blackbox is None else self._blackbox.counts(),
            failures=None if self._watch is None else self._watch.failures)
        log_lines(self._node.get_logger(), [*lines, *self._review.lines()])

    def statuses(self) -> list[StatusRecord]:
        """Return the state at the last review."""
        return self._review.statuses()

    def publish(self) -> None:
        if self._publisher.get_subscription_count():
            array = DiagnosticArray()
            array.header.stamp = self._clock.now().to_msg()
            array.status = [status_message(item) for item in self.statuses()]
            self._publisher.publish(array)

    def close(self) -> None:
        self._node.destroy_publisher(self._publisher)
