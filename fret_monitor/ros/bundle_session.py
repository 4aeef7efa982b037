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
A bundle that is run on a node: subscriptions in, evaluator, violations out.

Messages are read and stepped by C, taken by C too where the middleware lets it (`hot_path`), and
by a thread of the feed otherwise. What violates is queued, and published by threads of their own.
What a watch makes on the node, it takes away again.
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

_PATIENCE = 5.0  # s until it is told what has not come at all


class BundleSession:
    """
    Watches one bundle from each `start` to the next `stop`, on a node of somebody else.

    Between them and before it has its evaluator and its publishers, and nothing is stepped or
    announced; `close` releases all. Its timers are served by the node's executor; messages need
    none.
    """

    def __init__(self, node: Node, opened: Opened, *, hot_path: str = 'auto',
                 name: str = '', handler_depth: int = DEFAULT_HANDLER_DEPTH) -> None:
        """
        Prepare to watch.

        `hot_path` says whether C takes the messages (auto, on, off); `name` tells the bundle in
        diagnostics from others on the same node.

        Raises
        ------
        Refusal
            if the bundle cannot be watched on this node. Nothing is left on the node.
        """
        self.opened = opened
        self._node = node
        self._hot_path = hot_path
        self._name = name
        self._clock: Any = node.get_clock()  # a ROSClock, annotated as less in Jazzy
        self._advertised = ExitStack()
        self._running = ExitStack()
        self._feed: Feed | None = None
        self._handler_publisher: HandlerPublisher | None = None
        self._health: Health | None = None
        self._missing_timer: Timer | None = None
        self._told: set[int | str] = set()  # inputs and topics of which something odd was told
        refuse_inputs_off_ros(self.manifest)
        self._classes = _message_classes(self.manifest)
        self._watch = self._new_watch()
        with ExitStack() as undo:
            undo.callback(self.close)
            try:
                self._refuse_merged_topics()
                self._read_overrides()
                self._advertise(handler_depth)
            except InvalidTopicNameException as error:  # the namespace or a remapping is wrong
                raise Refusal(f'cannot subscribe or advertise: {error}') from None
            undo.pop_all()

    @property
    def manifest(self) -> Manifest:
        """What is known of the bundle."""
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
        Start watching: from here on messages and periods step the evaluator.

        Raises
        ------
        Refusal
            if the node cannot subscribe. Nothing is begun then.
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
        """Break the cycles of references through callbacks, so that a release frees the bundle."""
        self._health = self._missing_timer = None

    def _stale(self, index: int, received: int) -> None:
        self._watch.stale(index, received, self._now())
        self._publish_due()

    def _tick(self) -> None:
        self._watch.tick(self._now())
        self._publish_due()

    def _publish_due(self) -> None:
        """Publish what is violated; the announcer does, where C takes the messages."""
        if self._handler_publisher is not None:
            self._handler_publisher.publish_due()

    def _keep(self, timer: Timer) -> None:
        self._running.callback(self._node.destroy_timer, timer)

    def stop(self) -> None:
        """
        Stop watching; the next start begins with nothing: no past, and no values.

        What was sent meanwhile is not known then, and what was sent before is old.
        """
        self._running.close()
        self._watch = self._new_watch()

    def close(self) -> None:
        """Stop watching, and take away from the node all that it was given; twice is once."""
        self._running.close()
        self._advertised.close()

    def reset(self) -> int:
        """Start all step groups afresh between two steps; return how many there are."""
        self._watch.reset()
        return len(self.manifest.groups)

    # Where subscriptions, evaluator and publishers are connected. What begins first ends last: the
    # threads that publish outlive the subscriptions. Each of them closes the evaluator before it
    # waits, so that an interrupted `stop` leaves no thread waiting.

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
        # Not before: the first line takes rclpy a tenth of a second.
        self._node.get_logger().info(f'messages are taken {self._way}', once=True)

    def _class_in_place(self, middleware: Middleware, topic: str, message_class: Any) -> Any:
        """Return the class for reading in place; where there is none, the messages are copied."""
        try:
            return middleware.class_in_place(message_class)
        except Unavailable as reason:
            self._node.get_logger().info(
                f'messages on {self._node.resolve_topic_name(topic)} are copied before they are '
                f'read: {reason}')
            return message_class

    def _middleware(self) -> Middleware | None:
        """Return what the hot path calls, None where the feed is to take the messages."""
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
        """Stamp violations by the node's clock where that is simulated."""
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
        # In the executor, so that whoever spins the node is told.
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
        """Tell which fields of a message cannot be used, of an input once."""
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
        """Refuse remappings that lead two topics together: a message would be two steps."""
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
        if there are such, with the lines to write for them.
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
