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

from collections import deque
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from threading import Condition
from time import monotonic
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from fret_monitor.model.diagnostics import counted
from fret_monitor.model.manifest import Manifest, ManifestRequirement
from fret_monitor.model.names import DETAILS_TOPIC, handler_name
from fret_monitor.model.policies import Severity
from fret_monitor.ros.intake import native_lifetimes
from fret_monitor.ros.intake.feed import Feed
from fret_monitor.ros.intake.fields import UNDECODABLE
from fret_monitor.ros.intake.node_time import ClockNode
from fret_monitor.ros.intake.raw_topic import Deliver, RawIntake, RawTopic
from fret_monitor.ros.log_lines import log_lines
from fret_monitor.ros.reports.discovery import Announced, News
from fret_monitor.ros.reports.pairing import Pairing, ReceivedViolation, ViolationEnd
from fret_monitor.ros.settings.declared import Parameters
from fret_monitor.ros.settings.opened import load_reporting, open_manifests
from fret_monitor.ros.settings.overrides import DeclaredOverrides, overrides_of
from fret_monitor.ros.settings.parameters import LOGGER_PARAMETERS, read_settings, Refusal
from fret_monitor.ros.signals import uninterrupted
from fret_monitor.ros.watch import steady_timer, Watch, WatchedThread
from fret_monitor.runtime.reporting import (
    read_detail, ReceivedDetail, StatusRecord, ViolationLines,
)

from rclpy.serialization import deserialize_message
from std_msgs.msg import Empty

_CHECK = 0.5  # s between two checks for errors in threads, and for monitors
_MOST_WAITING = 1000  # violations; above that, messages wait in the middleware
_WAIT_S = 0.1
_NEW_S = 5.0  # within which a monitor that announces something new is followed, and longer


@dataclass(frozen=True)
class _Unknown:
    """A detail of a handler that the logger does not listen to; when it came (monotonic, s)."""

    status: DiagnosticStatus
    detail: ReceivedDetail
    sent: int
    came: float


class LoggerNode(ClockNode):
    """
    Logs violations from its construction until `destroy_node`; this needs no executor.

    With an executor it also follows monitors that are configured again: it then reads its bundle
    again, and listens for all that those monitors announce.
    """

    def __init__(self, node_name: str = 'fret_logger', **options: Any) -> None:
        """
        Create the node and subscribe; `options` are those of `rclpy.node.Node`.

        Raises `Refusal` if the parameters, the bundle or the library are not usable. Nothing is
        left.
        """
        super().__init__(node_name, **options)
        self._intake = RawIntake()
        self._feed = Feed(self, self._intake)
        self._pairing = Pairing()
        self._changed = Condition()  # guards the pairing, the lines, and what is unknown
        self._unknown: deque[_Unknown] = deque(maxlen=_MOST_WAITING)
        self._is_over = False
        self._lines: dict[str, ViolationLines] = {}  # by handler
        self._outside: dict[str, str] = {}  # handlers that are not in the bundle, with topics
        self._followed: dict[str, str] = {}  # topics of handlers, with the names in `_feed`
        self._requirements: Sequence[ManifestRequirement] = ()
        self._announced = Announced(self)
        self._monitors: set[str] = set()  # that announce requirements of the bundle, or did
        self._thread = WatchedThread('reports', self._report_all)
        self._watch = Watch(self, 'what has not failed goes on')
        with ExitStack() as undo:
            undo.callback(self.destroy_node)
            self._begin()
            undo.pop_all()

    def _check(self) -> None:
        """Follow monitors that were configured; raise the error that ended a thread, if any."""
        for failure in (self._feed.failure, self._thread.failure):
            if failure is not None:
                raise failure
        self._watch.run('monitors', self._follow_news)

    def _follow_news(self) -> None:
        if (news := self._announced.news()) is not None:
            self._follow(news)

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
        with parameters.warning_of_ignored():
            self._settings = read_settings(parameters.values())
            manifests = open_manifests(self._settings)
            self._library = load_reporting(self._settings)
            self._intake.prepare(self._library)
            parameters.show_constants(manifests)  # they are read-only, so they stay as they are
        self._overrides = overrides_of(self, self._library)
        self._fixed: dict[str, str | int] = {
            'reliability': 'reliable', 'durability': 'volatile',
            'depth': self._settings.handler_depth}
        self._feed.subscribe(
            self._library, DETAILS_TOPIC, 'diagnostic_msgs/msg/DiagnosticArray', DiagnosticArray,
            RawTopic(self._intake, self._keep_details), self._request(DETAILS_TOPIC))
        self._requirements = _requirements(manifests)
        self._listen(())
        with uninterrupted():
            self._feed.start()
            native_lifetimes.keep(self)
            self._thread.start()
        topics = [self.resolve_topic_name(DETAILS_TOPIC), *self._followed]
        DeclaredOverrides(self, self._watch, self._overrides, dict.fromkeys(topics, self._fixed))
        steady_timer(self, _CHECK, self._check)
        self.get_logger().info(self._contents())

    def _request(self, name: str) -> dict[str, str | int]:
        return self._overrides.apply(self.resolve_topic_name(name), self._fixed)

    def _contents(self) -> str:
        names = [*(item.id for item in self._requirements), *self._outside]
        return (f'listening for violations of {counted(len(names), "requirement")}: '
                + ', '.join(names[:10]) + (', ...' if len(names) > 10 else ''))

    def _listen(self, outside: Iterable[str]) -> None:
        """Subscribe to the handlers of the bundle and to topics `outside` it, and to no others."""
        self._outside = {topic.rpartition('/')[2]: topic for topic in sorted(outside)}
        heard = [(item.topic, item.handler, ViolationLines(
            self._library, item.id, item.sentence, item.severity)) for item in self._requirements]
        heard += [(topic, handler, ViolationLines(self._library, handler, topic, Severity.ERROR))
                  for handler, topic in self._outside.items()]
        wanted = {self.resolve_topic_name(topic): (topic, handler) for topic, handler, _ in heard}
        with self._changed:
            # Lines of former requirements stay, for violations that wait to be logged.
            self._lines |= {handler: lines for _, handler, lines in heard}
            self._add_missed()
        for topic in self._followed.keys() - wanted.keys():
            self._feed.unsubscribe(self._followed.pop(topic))
        for topic in sorted(wanted.keys() - self._followed.keys()):
            name, handler = wanted[topic]
            self._feed.subscribe(
                self._library, name, 'std_msgs/msg/Empty', Empty,
                RawTopic(self._intake, self._receive(handler)), self._request(name))
            self._followed[topic] = name

    def _follow(self, news: News) -> None:
        """
        Read the bundle again, since a monitor was configured, and listen for what it announces.

        A monitor counts if it announces a requirement of the bundle, or did before: the others
        of the namespace may have loggers of their own.
        """
        before, topics = self._requirements, set(self._followed)
        outside_before = set(self._outside)
        try:
            self._requirements = _requirements(open_manifests(self._settings))
        except Refusal as refusal:
            self.get_logger().error(f'{refusal}\nthe bundle cannot be read again; what was read '
                                    'before is used')
        inside = {self.resolve_topic_name(item.topic) for item in self._requirements}
        ours = {name for name, handlers in news.handlers.items()
                if name in self._monitors or handlers & (inside | topics)}
        again = news.configured & self._monitors
        self._monitors |= ours
        self._listen(set().union(*(news.handlers[name] for name in ours)) - inside)
        if self._requirements == before and set(self._outside) == outside_before and not again:
            return
        names = sorted(again or news.configured & ours or news.configured)
        self.get_logger().info(f'{", ".join(names)} was configured: now {self._contents()}')
        if self._outside:
            self.get_logger().warning(
                f'{", ".join(self._outside)}: announced, and not in the bundle of this logger; '
                'they are logged as their details describe them')

    def _receive(self, handler: str) -> Deliver:
        """Return the callback for a handler."""
        uses_received = not self.get_parameter('use_sim_time').value

        def receive(_: bytes, received: int, sent: int) -> None:
            if not uses_received:
                received = self.get_clock().now().nanoseconds
            with self._changed:
                while len(self._pairing) >= _MOST_WAITING and self._thread.is_alive():
                    self._changed.wait(_WAIT_S)
                self._pairing.add_violation(handler, received, sent, monotonic())
                self._changed.notify_all()

        return receive

    def _keep_details(self, data: bytes, _: int, sent: int) -> None:
        """Keep step, time and values of violations."""
        try:
            array = deserialize_message(data, DiagnosticArray)
        except UNDECODABLE:
            return  # any node may publish here; the violation is logged without details
        for status in array.status:
            detail = read_detail(self._library, StatusRecord(
                status.level[0], status.name, status.message, status.hardware_id,
                tuple((item.key, item.value) for item in status.values)))
            if detail is None:
                continue
            with self._changed:
                handler = self._handler_of(status.name)
                if handler in self._lines:
                    self._add_detail(handler, status, detail, sent)
                else:
                    self._unknown.append(_Unknown(status, detail, sent, monotonic()))

    def _handler_of(self, name: str) -> str:
        """Return the handler of a requirement, also for the name of an instance of it."""
        found = (name, *(name[:place] for place, sign in enumerate(name) if sign == '['))
        return next((handler for handler in map(handler_name, found) if handler in self._lines),
                    handler_name(name))

    def _add_detail(self, handler: str, status: DiagnosticStatus, detail: ReceivedDetail,
                    sent: int) -> None:
        if handler in self._outside:
            self._lines[handler] = self._described(status)
        if detail.is_recovery:
            self._pairing.add_recovery(handler, detail, monotonic())
        else:
            self._pairing.add_detail(handler, detail, sent)
        self._changed.notify_all()

    def _add_missed(self) -> None:
        """Add violations of new handlers that were published before anybody listened to them."""
        unknown, now = list(self._unknown), monotonic()
        self._unknown.clear()
        for item in unknown:
            handler = self._handler_of(item.status.name)
            if handler not in self._lines:
                self._unknown.append(item)
            elif now - item.came < _NEW_S:
                if not item.detail.is_recovery:
                    self._pairing.add_violation(handler, item.sent, item.sent, now)
                self._add_detail(handler, item.status, item.detail, item.sent)

    def _report_all(self) -> None:
        """Log violations once `Pairing` releases them, until the node is destroyed."""
        while True:
            with self._changed:
                now = float('inf') if self._is_over else monotonic()
                item, due = self._pairing.take(now), self._pairing.next_due
                if item is None:
                    if self._is_over:
                        return
                    self._changed.wait(None if due is None else max(0.0, due - now))
            if item is not None:
                self._log(item)

    def _log(self, item: ReceivedViolation | ViolationEnd) -> None:
        lines, detail = self._lines[item.requirement], item.detail
        log_lines(self.get_logger(), (
            lines.satisfied(item.detail) if isinstance(item, ViolationEnd) else
            lines.violated(item.received if detail is None else detail.stamp, detail)))

    def _described(self, status: DiagnosticStatus) -> ViolationLines:
        """Return the lines of a requirement that is not in the bundle."""
        severity = Severity.WARN if status.level == DiagnosticStatus.WARN else Severity.ERROR
        return ViolationLines(self._library, status.name, status.message, severity)


def _requirements(manifests: Iterable[Manifest]) -> list[ManifestRequirement]:
    return [item for manifest in manifests for item in manifest.numbered]
