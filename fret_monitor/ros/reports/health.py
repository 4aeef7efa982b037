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
from fret_monitor.model.names import DIAGNOSTICS_TOPIC
from fret_monitor.native.binding import ffi
from fret_monitor.ros.acting.actions import Actions
from fret_monitor.ros.intake.hot_path import Middleware
from fret_monitor.ros.intake.rcl_endpoint import RclPublisher
from fret_monitor.ros.log_lines import log_lines
from fret_monitor.ros.watch import Watch
from fret_monitor.runtime.reporting import Reporter, Review, StatusRecord, TopicFacts

from rclpy.node import Node
from rclpy.qos import QoSProfile

if TYPE_CHECKING:
    from fret_monitor.ros.acting.blackbox import BlackBox
    from fret_monitor.ros.acting.gate import Gate

PERIOD = 1.0  # s between two reports


class Health:
    """Logs what is new, and publishes diagnostics while `/diagnostics` has a subscriber."""

    def __init__(self, node: Node, middleware: Middleware, reporter: Reporter, actions: Actions,
                 gate: 'Gate | None', blackbox: 'BlackBox | None', watch: Watch | None) -> None:
        """Advertise the topic; the caller then calls `review` and `publish` every `PERIOD`."""
        self._node = node
        self._clock: Any = node.get_clock()  # a ROSClock; Jazzy annotates it as a Clock
        self._middleware = middleware
        self._publisher = RclPublisher(
            node, DiagnosticArray, DIAGNOSTICS_TOPIC, QoSProfile(depth=10))
        self._blackbox = blackbox
        self._gate = gate
        self._actions = actions
        self._watch = watch
        self._review = Review(reporter, **self._counts())

    def _counts(self) -> dict[str, Any]:
        return {'actions': self._actions.counts,
                'blackbox': ffi.NULL if self._blackbox is None else self._blackbox.counts()}

    def review(self, topics: Sequence[TopicFacts]) -> None:
        """Log what is new; `topics` are the publishers of each topic, in order."""
        lines = [*self._actions.lines(),
                 *([] if self._blackbox is None else self._blackbox.lines())]
        self._review.look(
            topics,
            waits_for_clock=self._clock.ros_time_is_active
            and self._clock.now().nanoseconds <= 0,
            gate=None if self._gate is None else self._gate.look(),
            failures=None if self._watch is None else self._watch.failures, **self._counts())
        log_lines(self._node.get_logger(), [*lines, *self._review.lines()])

    def statuses(self) -> list[StatusRecord]:
        """Return the state at the last review."""
        return self._review.statuses()

    def publish(self) -> None:
        if self._publisher.subscriptions:
            with self._publisher.handle:
                self._review.publish(self._middleware.functions, self._middleware.handle(
                    self._publisher), self._clock.now().nanoseconds)

    def close(self) -> None:
        self._publisher.close()
