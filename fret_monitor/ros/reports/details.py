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
violations are logged. A thread publishes and logs them; the handler's message does not wait.
"""

from collections.abc import Iterable
from contextlib import suppress
from threading import Event
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from fret_monitor.model.names import DETAILS_TOPIC
from fret_monitor.ros.intake import native_lifetimes
from fret_monitor.ros.intake.node_time import as_time
from fret_monitor.ros.log_lines import log_lines
from fret_monitor.ros.reports.messages import status_message
from fret_monitor.ros.settings.parameters import DEFAULT_HANDLER_DEPTH
from fret_monitor.ros.settings.qos import violation_profile
from fret_monitor.ros.watch import WatchedThread
from fret_monitor.runtime import MOST_DETAILS_PER_S
from fret_monitor.runtime.reporting import (
    LOGGED_PER_S, LogLine, Reporter, StatusRecord, ViolationLog,
)

from rclpy.event_handler import PublisherEventCallbacks
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.node import Node

_WAIT_MS = 200  # longest wait for a detail; closing the engine ends it at once
_POLL_S = 0.1  # between two checks for a subscriber, where the middleware has no matched event


class Details:
    """Publishes details of violations."""

    def __init__(self, node: Node, depth: int = DEFAULT_HANDLER_DEPTH) -> None:
        """Advertise the topic, with a queue of `depth` messages."""
        self._node = node
        self.listening = Event()
        self._publisher = node.create_publisher(
            DiagnosticArray, DETAILS_TOPIC, violation_profile(depth),
            event_callbacks=PublisherEventCallbacks(matched=lambda _: self.listening.set()))

    def has_listeners(self) -> bool:
        """Return whether somebody subscribes; `listening` is set whenever that may change."""
        with suppress(RuntimeError):  # the context was shut down
            return self._publisher.get_subscription_count() > 0
        return False

    def publish(self, detail: StatusRecord, stamp: int) -> None:
        """Publish the details of a violation, by its time (ns)."""
        array = DiagnosticArray(status=[status_message(detail)])
        array.header.stamp = as_time(stamp)
        with suppress(RuntimeError):  # the context was shut down
            self._publisher.publish(array)

    def close(self) -> None:
        self._node.destroy_publisher(self._publisher)


class DetailPublisher:
    """Publishes the details of violations while their topic has a subscriber, and logs them."""

    def __init__(self, reporter: Reporter, details: Details,
                 logger: RcutilsLogger | None) -> None:
        """Start the thread; `logger` is None if violations are not logged."""
        self._reporter = reporter
        self._engine = reporter.engine
        self._details = details
        self._logger = logger
        self._log = None if logger is None else ViolationLog(reporter)
        self._is_over = Event()
        self.turns = 0
        """How often the thread has looked for work: several times a second unless it hangs."""
        self._thread = WatchedThread('details', self._loop)
        native_lifetimes.keep(self)
        self._thread.start()

    def end(self) -> None:
        """Close the engine, and wait until the thread has emptied its queue; idempotent."""
        self._engine.close()
        self._is_over.set()
        self._details.listening.set()
        self._thread.join()
        native_lifetimes.release(self)

    @property
    def failure(self) -> Exception | None:
        """The error that ended the thread, if any; no detail is published or logged after it."""
        return self._thread.failure

    def _loop(self) -> None:
        while not self._is_over.is_set():
            self.turns += 1
            has_listeners = self._details.has_listeners()
            self._engine.want_details(
                has_listeners or self._log is not None,
                MOST_DETAILS_PER_S if has_listeners else LOGGED_PER_S)
            if not has_listeners and self._log is None:
                self._details.listening.wait(_POLL_S)
                self._details.listening.clear()
            elif (detail := self._engine.take_detail(_WAIT_MS)) is not None:
                self._take(detail)
            if self._log is not None:
                self._write(self._log.review())
        while (detail := self._engine.take_detail(0)) is not None:
            self._take(detail)
        if self._log is not None:
            self._write(self._log.end())

    def _take(self, detail: Any) -> None:
        if self._details.has_listeners():
            self._details.publish(self._reporter.detail(detail), detail.violation.stamp)
        if self._log is not None:
            self._write(self._log.add(detail))

    def _write(self, lines: Iterable[LogLine]) -> None:
        if self._logger is not None:
            log_lines(self._logger, lines)
