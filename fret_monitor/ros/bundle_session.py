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
One bundle on a node: from its subscriptions through the evaluator to published violations.

C decodes the messages and steps the evaluator. C also takes the messages where the middleware
allows it (`hot_path`); otherwise the feed's thread does. Violations are queued, and published from
the queue (`publisher_threads`). Closing a session removes from the node all that it created there.
"""

from collections.abc import Sequence
from contextlib import ExitStack
from typing import Any

from fret_monitor.model.manifest import Manifest, ManifestInput
from fret_monitor.model.policies import Policy
from fret_monitor.native.binding import ffi
from fret_monitor.ros.compiled import Opened
from fret_monitor.ros.details import Details, DETAILS_TOPIC
from fret_monitor.ros.feed import Deliver, Feed, PublisherStatus, TopicReceiver
from fret_monitor.ros.fields import message_class, MessageTypeError, why_unusable
from fret_monitor.ros.handlers import handler_topic, Handlers
from fret_monitor.ros.health import describe_missing, Health, PERIOD
from fret_monitor.ros.hot_path import Announcer, find_middleware, HotTopic, Middleware
from fret_monitor.ros.loaded import Unavailable
from fret_monitor.ros.overrides import Overrides
from fret_monitor.ros.parameters import Refusal
from fret_monitor.ros.periods import Periods
from fret_monitor.ros.publisher_threads import DetailPublisher, HandlerPublisher
from fret_monitor.ros.qos import DEFAULT_HANDLER_DEPTH
from fret_monitor.ros.timeouts import TimeoutTimer
from fret_monitor.runtime import Evaluator, SharedEvaluator
from fret_monitor.runtime.fields import Outcome, read_fields

from rclpy.clock import Clock, ClockType
from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.timer import Timer
from rclpy.utilities import get_rmw_implementation_identifier

_PATIENCE = 5.0  # s after the start until missing inputs are logged


class BundleSession:
    """
    Monitors one bundle on a given node, from each `start` to the next `stop`.

    While it is stopped it keeps an evaluator and the publishers, but steps and publishes nothing.
    `close` releases everything. The node's executor runs the timers; messages need no executor.
    """

    def __init__(self, node: Node, opened: Opened, *, hot_path: str = 'auto',
                 name: str = '', handler_depth: int = DEFAULT_HANDLER_DEPTH) -> None:
        """
        Prepare to monitor.

        `hot_path` decides whether C takes the messages (auto, on, off); `name` is the bundle's
        name in diagnostics, empty if the node has only one bundle.

        Raises
        ------
        Refusal
            if the bundle cannot be monitored on this node. Nothing is left on the node.
        """
        self.opened = opened
        self._node = node
        self._hot_path = hot_path
        self._name = name
        self._clock: Any = node.get_clock()  # a ROSClock; Jazzy annotates it as a Clock
        self._advertised = ExitStack()
        self._running = ExitStack()
        self._feed: Feed | None = None
        self._handler_publisher: HandlerPublisher | None = None
        self._health: Health | None = None
        self._missing_timer: Timer | None = None
        self._told: set[int | str] = set()  # keys of log lines that appear only once
        refuse_inputs_off_ros(self.manifest)
        self._classes = _message_classes(self.manifest)
        self._watch = self._new_watch()
        with ExitStack() as undo:
            undo.callback(self.close)
            try:
                self._refuse_merged_topics()
                self._read_overrides()
                self._advertise(handler_depth)
            except InvalidTopicNameException as error:  # from the namespace or a remapping
                raise Refusal(f'cannot subscribe or advertise: {error}') from None
            undo.pop_all()

    @property
    def manifest(self) -> Manifest:
        """The manifest of the bundle."""
        return self.opened.monitor.manifest

    def _new_watch(self) -> SharedEvaluator:
        return SharedEvaluator(Evaluator(
            self.opened.monitor, policy=self.opened.policy, library=self.opened.evaluator))

    def _advertise(self, depth: int) -> None:
        self._handlers = Handlers(self._node, self.manifest, depth)
        self._advertised.callback(self._handlers.close)
        self._details = Details(self._node, self.manifest, depth)
        self._advertised.callback(self._details.close)

    def start(self) -> None:
        """
        Start monitoring: from now on messages and periods step the evaluator.

        Raises
        ------
        Refusal
            if the node cannot subscribe. Nothing is left running then.
        """
        with ExitStack() as undo:
            undo.callback(self.stop)
            try:
                self._connect()
            except InvalidTopicNameException as error:
                raise Refusal(f'cannot subscribe: {error}') from None
            self._start_timers()
            undo.pop_all()

    def _start_timers(self) -> None:
        self._running.callback(self._forget_timers)
        timeouts = TimeoutTimer(
            self._node, self.manifest, lambda index: self._watch.input_counts(index).received,
            self._stale)
        self._running.callback(timeouts.close)
        periods = None
        if self.opened.policy is Policy.PERIODIC:
            assert self.opened.period is not None
            periods = Periods(self._node, float(self.opened.period), self._tick)
            self._running.callback(periods.close)
        self._health = Health(self._node, self._watch, timeouts.tracker,
                              None if periods is None else periods.schedule, self._name)
        self._running.callback(self._health.close)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._keep(self._node.create_timer(PERIOD, self._report_health, clock=steady))
        self._missing_timer = self._node.create_timer(
            _PATIENCE, self._log_missing, clock=steady)
        self._keep(self._missing_timer)

    def _forget_timers(self) -> None:
        """Break reference cycles through callbacks, so that a release frees the bundle."""
        self._health = self._missing_timer = None

    def _stale(self, index: int, received: int) -> None:
        self._watch.stale(index, received, self._now())
        self._publish_due()

    def _tick(self) -> None:
        self._watch.tick(self._now())
        self._publish_due()

    def _publish_due(self) -> None:
        """Publish queued violations; where C takes the messages, the announcer publishes them."""
        if self._handler_publisher is not None:
            self._handler_publisher.publish_due()

    def _keep(self, timer: Timer) -> None:
        self._running.callback(self._node.destroy_timer, timer)

    def stop(self) -> None:
        """
        Stop monitoring; the next start has a new evaluator, without past and without values.

        The old values may be outdated by then, and the messages sent in between are missing.
        """
        self._running.close()
        self._watch = self._new_watch()

    def close(self) -> None:
        """Stop monitoring, and remove everything from the node; a second call does nothing."""
        self._running.close()
        self._advertised.close()

    def reset(self) -> int:
        """Reset all step groups between two steps; return how many there are."""
        self._watch.reset()
        return len(self.manifest.groups)

    # Publishers and subscriptions are closed in reverse order of creation, so the threads that
    # publish outlive the subscriptions. Ending such a thread closes the evaluator before it waits
    # for the thread, so that an interrupted `stop` leaves no thread waiting.

    def _connect(self) -> None:
        middleware = self._middleware()
        if middleware is not None:
            try:
                self._connect_through(middleware)
                return
            except Unavailable as reason:
                self._running.close()
                self._watch = self._new_watch()
                self._fall_back(reason)
        self._connect_through(None)

    def _connect_through(self, middleware: Middleware | None) -> None:
        watch = self._watch
        self._follow_clock(middleware)
        self._handler_publisher = None
        if middleware is None:
            self._handler_publisher = HandlerPublisher(watch, self._handlers)
            self._running.callback(self._handler_publisher.close)
        else:
            announcer = Announcer(watch, middleware, self._handlers.publishers)
            self._running.callback(announcer.join)
        self._running.callback(DetailPublisher(watch, self._details).end)
        feed = Feed(self._node)
        self._running.callback(feed.close)
        for index, topic in enumerate(self.manifest.topics):
            taker: Deliver | TopicReceiver = self._delivery(index) if middleware is None \
                else HotTopic(watch, middleware, index)
            kind = self._classes[topic.message_type]
            if middleware is not None and middleware.reads_in_place:
                kind = self._class_in_place(middleware, topic.name, kind)
            feed.subscribe(topic.name, topic.message_type, kind,
                           taker, self._overrides.apply(
                               self._node.resolve_topic_name(topic.name), dict(topic.qos)))
        feed.start()
        self._feed = feed
        # Logged after the start, since rclpy needs 0.1 s for its first log line.
        self._node.get_logger().info(f'messages are taken {self._way}', once=True)

    def _class_in_place(self, middleware: Middleware, topic: str, message_class: Any) -> Any:
        """Return the class for reading in place, or `message_class` if messages must be copied."""
        try:
            return middleware.class_in_place(message_class)
        except Unavailable as reason:
            self._node.get_logger().info(
                f'messages on {self._node.resolve_topic_name(topic)} are copied before they are '
                f'read: {reason}')
            return message_class

    def _middleware(self) -> Middleware | None:
        """Return the functions for the hot path; None if the feed has to take the messages."""
        self._way = f'in C, inside {get_rmw_implementation_identifier()}'
        if self._hot_path == 'off':
            self._fall_back('hot_path is off')
            return None
        try:
            found = find_middleware(even_unproven=self._hot_path == 'on')
        except Unavailable as reason:
            self._fall_back(reason)
            return None
        try:
            found.read_in_place(self._watch.library)
        except Unavailable as reason:
            self._way += f', and copied before they are read: {reason}'
        return found

    def _fall_back(self, reason: object) -> None:
        if self._hot_path == 'on':
            raise Refusal(f'hot_path is on, and C cannot take the messages: {reason}')
        self._way = f'in Python: {reason}'

    def _follow_clock(self, middleware: Middleware | None) -> None:
        """Stamp violations with the node's clock while its time is simulated."""
        if middleware is None:
            return
        handle = self._clock.handle
        self._running.enter_context(handle)
        pointer = ffi.cast('void *', handle.pointer)

        def follow() -> None:
            if self._clock.ros_time_is_active:
                self._watch.use_clock(middleware.clock_now, pointer)
            else:
                self._watch.use_clock(ffi.NULL, ffi.NULL)

        follow()
        self._keep(self._node.create_timer(
            PERIOD, follow, clock=Clock(clock_type=ClockType.STEADY_TIME)))

    def _delivery(self, topic: int) -> Deliver:
        """Return the callback for a topic where Python takes the messages."""
        watch = self._watch

        def deliver(data: bytes, received: int, _: int) -> None:
            stamp = self._now() if self._clock.ros_time_is_active else received
            watch.message(topic, data, stamp)
            self._publish_due()

        return deliver

    # Reports.

    def _now(self) -> int:
        return int(self._clock.now().nanoseconds)

    def _statuses(self) -> Sequence[PublisherStatus]:
        return self._feed.statuses() if self._feed is not None else ()

    def _report_health(self) -> None:
        # Raised in the executor, so that the error reaches the program that spins the node.
        if self._feed is not None and self._feed.failure is not None:
            raise self._feed.failure
        if self._health is not None:  # None: stopped meanwhile
            self._health.publish(self._statuses())
        self._log_unpublished()
        for topic in range(len(self.manifest.topics)):
            if self._watch.topic_counts(topic).undecodable:
                self._log_undecodable(topic)
            message = self._watch.evidence(topic)
            if message is not None:
                self._log_unusable_fields(topic, message)

    def _log_unpublished(self) -> None:
        if self._watch.unpublished and self._is_news('violations'):
            self._node.get_logger().error(
                f'violations could not be published: {self._watch.unpublished} so far; '
                '/diagnostics counts them')

    def _log_unusable_fields(self, topic: int, message: bytes) -> None:
        """Log the fields of a message that cannot be used, once for each input."""
        readings = read_fields(self.opened.monitor, topic, message)
        for index, reading in zip(self.manifest.topics[topic].inputs, readings or ()):
            if reading.outcome is not Outcome.READ:
                self._log_unusable(index, topic, message)

    def _log_missing(self) -> None:
        if self._missing_timer is not None:  # None: stopped meanwhile
            self._missing_timer.cancel()
        told = describe_missing(self._watch, self._statuses(), self._node.resolve_topic_name)
        if told is not None:
            self._node.get_logger().warning(told)

    def _log_undecodable(self, topic: int) -> None:
        mapped = self.manifest.topics[topic]
        if self._is_news(mapped.name):
            self._node.get_logger().error(
                f'a message on {self._node.resolve_topic_name(mapped.name)} cannot be decoded as '
                f'{mapped.message_type}; such messages are counted and are no step')

    def _log_unusable(self, index: int, topic: int, message: bytes) -> None:
        if not self._is_news(index):
            return
        item, mapped = self.manifest.inputs[index], self.manifest.topics[topic]
        reason = why_unusable(item, message, self._classes[mapped.message_type])
        outcome = 'has no value yet' if self._watch.value(index) is None else 'keeps its value'
        self._node.get_logger().warning(
            f"{self._node.resolve_topic_name(mapped.name)}: {reason}; input '{item.name}' "
            f'{outcome}')

    def _is_news(self, what: int | str) -> bool:
        is_news = what not in self._told
        self._told.add(what)
        return is_news

    def _read_overrides(self) -> None:
        self._overrides = Overrides.of(self._node)
        self._overrides.refuse_publishers([
            self._node.resolve_topic_name(name) for name in (
                DETAILS_TOPIC, *map(handler_topic, self.manifest.requirements))])

    def _refuse_merged_topics(self) -> None:
        """Refuse remappings of two topics to one: each message would cause two steps."""
        names: dict[str, str] = {}
        for topic in self.manifest.topics:
            full = self._node.resolve_topic_name(topic.name)
            other = names.setdefault(full, topic.name)
            if other != topic.name:
                raise Refusal(
                    f"'{other}' and '{topic.name}' are both remapped to {full}; if they are one "
                    f'topic, give the inputs that they feed one `topic:` in the bundle')


def refuse_inputs_off_ros(manifest: Manifest) -> None:
    """
    Refuse inputs that requirements read and no topic feeds.

    Raises
    ------
    Refusal
        if there are any; the message has the lines to add to the bundle.
    """
    read = {index for group in manifest.groups for index in group.inputs}
    lines = [line for index in sorted(read) for line in _lines_wanted(manifest.inputs[index])]
    if lines:
        raise Refusal('these inputs have no ROS 2 topic to read; '
                      'say in the bundle where they come from:\n\n  inputs:\n' + '\n'.join(lines))


def _lines_wanted(item: ManifestInput) -> list[str]:
    if item.topic is not None and item.message_type is not None:
        return []
    plain = 'string' if item.is_string else item.value_type.value
    standard = plain.capitalize() if not plain.startswith('uint') else f'UInt{plain[4:]}'
    return [f'    {item.name}:',
            f'      topic: {item.topic or item.name}',
            f'      type: {item.message_type or f"std_msgs/msg/{standard}"}']


def _message_classes(manifest: Manifest) -> dict[str, Any]:
    classes: dict[str, Any] = {}
    problems: list[str] = []
    for message_type in sorted({topic.message_type for topic in manifest.topics}):
        try:
            classes[message_type] = message_class(message_type)
        except MessageTypeError as error:
            problems.append(str(error))
    if problems:
        raise Refusal(*problems)
    return classes
