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
The node that writes every announced violation to the ROS log, with its sentence and time.

It subscribes to the handler topics of the same bundle, so it can run on another machine than the
monitor. The monitor does not need it.
"""

from collections.abc import Callable
from contextlib import ExitStack
from threading import Condition, Thread
from time import monotonic
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from fret_monitor.model.diagnostics import counted
from fret_monitor.model.manifest import ManifestRequirement
from fret_monitor.ros import native_lifetimes
from fret_monitor.ros.compiled import open_manifests
from fret_monitor.ros.details import DETAILS_TOPIC, read_detail
from fret_monitor.ros.feed import ErrorKeeper, Feed
from fret_monitor.ros.fields import UNDECODABLE
from fret_monitor.ros.handlers import handler_topic
from fret_monitor.ros.overrides import DeclaredOverrides, Overrides
from fret_monitor.ros.pairing import Pairing, ReceivedViolation, Recovery
from fret_monitor.ros.parameters import LOGGER_PARAMETERS, Parameters, read_settings
from fret_monitor.ros.qos import violation_request
from fret_monitor.ros.raw_topic import Deliver, RawTopic
from fret_monitor.ros.violation_lines import ViolationLines

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from std_msgs.msg import Empty

_CHECK = 1.0  # s between two checks for an error in a thread
_MOST_WAITING = 1000  # violations; above that, messages wait in the middleware
_WAIT_S = 0.1

_Report = Callable[[ReceivedViolation | Recovery], None]


class LoggerNode(Node):
    """Logs violations from its construction until `destroy_node`; this needs no executor."""

    def __init__(self, node_name: str = 'fret_logger', **options: Any) -> None:
        """
        Create the node and subscribe; `options` are those of `rclpy.node.Node`.

        Raises
        ------
        Refusal
            if the parameters, the bundle or the library are not usable. Nothing is left.
        """
        super().__init__(node_name, **options)
        self._feed = Feed(self)
        self._pairing = Pairing()
        self._changed = Condition()  # guards the pairing
        self._is_over = False
        self._reports: dict[str, _Report] = {}
        self._thread = Thread(target=self._report_all, name='reports', daemon=True)
        self._kept = ErrorKeeper()
        with ExitStack() as undo:
            undo.callback(self.destroy_node)
            self._begin()
            undo.pop_all()

    def _check(self) -> None:
        """Raise the error that ended a thread, if any, in the executor."""
        for failure in (self._feed.failure, self._kept.error):
            if failure is not None:
                raise failure

    def end(self) -> None:
        """End the threads, after what was received is logged; a second call does nothing."""
        self._feed.end()
        with self._changed:
            self._is_over = True
            self._changed.notify_all()
        if self._thread.is_alive():
            self._thread.join()

    def destroy_node(self) -> None:
        """Close the feed, log the violations received so far, then destroy the node."""
        self._feed.close()
        self.end()
        native_lifetimes.release(self)
        super().destroy_node()

    def _begin(self) -> None:
        parameters = Parameters(self, LOGGER_PARAMETERS)
        settings = read_settings(parameters.values())
        manifests = open_manifests(settings)
        parameters.show_constants(manifests)
        requirements = [requirement for manifest in manifests
                        for requirement in manifest.requirements]
        self._reports = {item.id: self._report(item) for item in requirements}
        overrides = Overrides.of(self)
        fixed = violation_request(settings.handler_depth)

        def request(name: str) -> dict[str, str | int]:
            return overrides.apply(self.resolve_topic_name(name), fixed)

        self._feed.subscribe(DETAILS_TOPIC, 'diagnostic_msgs/msg/DiagnosticArray', DiagnosticArray,
                             RawTopic(self._keep_details), request(DETAILS_TOPIC))
        for requirement in requirements:
            name = handler_topic(requirement)
            self._feed.subscribe(name, 'std_msgs/msg/Empty', Empty,
                                 RawTopic(self._receive(requirement)), request(name))
        self._feed.start()
        native_lifetimes.keep(self)
        self._thread.start()
        names = [DETAILS_TOPIC, *map(handler_topic, requirements)]
        DeclaredOverrides(self, {self.resolve_topic_name(name): fixed for name in names})
        self.create_timer(_CHECK, self._check, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.get_logger().info(
            f'listening for violations of {counted(len(requirements), "requirement")}: '
            + ', '.join(requirement.id for requirement in requirements[:10])
            + (', ...' if len(requirements) > 10 else ''))

    def _receive(self, requirement: ManifestRequirement) -> Deliver:
        """Return the callback for a handler."""
        uses_received = not self.get_parameter('use_sim_time').value

        def receive(_: bytes, received: int, sent: int) -> None:
            if not uses_received:
                received = self.get_clock().now().nanoseconds
            with self._changed:
                while len(self._pairing) >= _MOST_WAITING and self._thread.is_alive():
                    self._changed.wait(_WAIT_S)
                self._pairing.add_violation(requirement.id, received, sent, monotonic())
                self._changed.notify_all()

        return receive

    def _keep_details(self, data: bytes, _: int, sent: int) -> None:
        """Keep step, time and values of violations."""
        try:
            array = deserialize_message(data, DiagnosticArray)
        except UNDECODABLE:
            return  # any node may publish here; the violation is logged without details
        for status in array.status:
            detail = read_detail(status)
            if status.name not in self._reports or detail is None:
                continue
            with self._changed:
                if detail.is_recovery:
                    self._pairing.add_recovery(status.name, detail, monotonic())
                else:
                    self._pairing.add_detail(status.name, detail, sent)
                self._changed.notify_all()

    def _report_all(self) -> None:
        """Log violations once `Pairing` releases them, until the node is destroyed."""
        with self._kept:
            self._report_until_over()

    def _report_until_over(self) -> None:
        while True:
            with self._changed:
                now = float('inf') if self._is_over else monotonic()
                item, due = self._pairing.take(now), self._pairing.next_due
                if item is None:
                    if self._is_over:
                        return
                    self._changed.wait(None if due is None else max(0.0, due - now))
            if item is not None:
                self._reports[item.requirement](item)

    def _report(self, requirement: ManifestRequirement) -> _Report:
        """Return the function that logs the violations of a requirement, and their ends."""
        lines = ViolationLines.of(self.get_logger(), requirement)

        def report(violation: ReceivedViolation | Recovery) -> None:
            detail = violation.detail
            if isinstance(violation, Recovery):
                lines.satisfied(detail)
            else:
                lines.violated(
                    violation.received / 1e9 if detail is None else detail.stamp, detail)

        return report
