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
One opened bundle at work on a node: subscriptions in, its evaluator, violations out.

Callbacks store, the evaluator steps. Messages come in the feed's thread, resets and periods in
the executor's; one lock keeps them apart. What a watch makes on the node, it takes away again.
"""

from collections.abc import Sequence
from contextlib import ExitStack
from threading import Lock

from fret_monitor.manifest import Manifest, ManifestInput, Policy
from fret_monitor.ros.compiled import Opened
from fret_monitor.ros.details import Details
from fret_monitor.ros.feed import Deliver, Feed, Hearing
from fret_monitor.ros.fields import (
    message_class,
    MessageReader,
    MessageTypeError,
    TellUnusable,
)
from fret_monitor.ros.handlers import Handlers
from fret_monitor.ros.health import describe_missing, Health, PERIOD
from fret_monitor.ros.parameters import Refusal
from fret_monitor.runtime import Evaluator, Violation

from rclpy.clock import Clock
from rclpy.clock import ClockType
from rclpy.clock import ROSClock
from rclpy.exceptions import InvalidTopicNameException
from rclpy.node import Node
from rclpy.timer import Timer

_PATIENCE = 5.0  # s until it is told what has not come at all


class BundleWatch:
    """
    Watches one bundle from each `start` to the next `stop`, on a node of somebody else.

    Between them and before it has its evaluator and its publishers, and nothing is stepped or
    announced; `close` releases all. Its timers are served by the node's executor; messages need
    none.
    """

    def __init__(self, node: Node, opened: Opened, *, hot_path: str = 'auto') -> None:
        """
        Prepare to watch; `hot_path` says whether C takes the messages (auto, on, off).

        Raises
        ------
        Refusal
            if the bundle cannot be watched on this node. Nothing is left on the node.
        """
        self.opened = opened
        self._node = node
        self._hot_path = hot_path
        self._lock = Lock()
        self._advertised = ExitStack()
        self._running = ExitStack()
        self._feed: Feed | None = None
        refuse_inputs_off_ros(self.manifest)
        self._readers = _readers(self.manifest, self._tell_unusable)
        self._evaluator = self._new_evaluator()
        with ExitStack() as undo:
            undo.callback(self.close)
            try:
                self._refuse_merged_topics()
                self._advertise()
            except InvalidTopicNameException as error:  # the namespace or a remapping is wrong
                raise Refusal(f'cannot subscribe or advertise: {error}') from None
            undo.pop_all()

    @property
    def manifest(self) -> Manifest:
        """What is known of the bundle."""
        return self.opened.monitor.manifest

    def _new_evaluator(self) -> Evaluator:
        return Evaluator(
            self.opened.monitor, policy=self.opened.policy, library=self.opened.evaluator)

    def _advertise(self) -> None:
        self._handlers = Handlers(self._node, self.manifest)
        self._advertised.callback(self._handlers.close)
        self._details = Details(self._node, self.manifest)
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
        if self.opened.policy is Policy.PERIODIC:
            assert self.opened.period is not None
            self._keep(self._node.create_timer(float(self.opened.period), self._tick))
        self._health = Health(self._node, self._evaluator)
        self._running.callback(self._health.close)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._keep(self._node.create_timer(PERIOD, self._tell_health, clock=steady))
        self._patience = self._node.create_timer(_PATIENCE, self._tell_missing, clock=steady)
        self._keep(self._patience)

    def _keep(self, timer: Timer) -> None:
        self._running.callback(self._node.destroy_timer, timer)

    def stop(self) -> None:
        """
        Stop watching; the next start begins with nothing: no past, and no values.

        What was sent meanwhile is not known then, and what was sent before is old.
        """
        self._running.close()
        self._evaluator = self._new_evaluator()

    def close(self) -> None:
        """Stop watching, and take away from the node all that it was given; twice is once."""
        self._running.close()
        self._advertised.close()

    def reset(self) -> int:
        """Start all step groups afresh between two steps; return how many there are."""
        with self._lock:
            self._evaluator.reset()
        return len(self.manifest.groups)

    # Where subscriptions and evaluator are connected, and nowhere else: `_connect` begins to step
    # it with what comes and lets `stop` end that; `_check` raises what went wrong meanwhile;
    # `_hearings` tells who is heard.

    def _connect(self) -> None:
        feed = Feed(self._node)
        self._running.callback(feed.close)
        for reader, topic in zip(self._readers, self.manifest.topics):
            feed.subscribe(
                topic.name, topic.message_type, reader.message_class,
                self._deliver(reader), dict(topic.qos))
        feed.start()
        self._feed = feed

    def _deliver(self, reader: MessageReader) -> Deliver:
        """Return the callback for a topic: store what the message holds, then step."""
        evaluator, topic, lock = self._evaluator, reader.topic, self._lock
        clock = self._node.get_clock()
        assert isinstance(clock, ROSClock)

        def deliver(data: bytes, received: int, _: int) -> None:
            with lock:
                if not reader.read(data, evaluator):
                    self._tell_undecodable(topic)
                    return
                stamp = self._now() if clock.ros_time_is_active else received
                violations = evaluator.message(topic, stamp)
                if violations:
                    self._announce(violations)

        return deliver

    def _check(self) -> None:
        if self._feed is not None and self._feed.failure is not None:
            raise self._feed.failure

    def _hearings(self) -> Sequence[Hearing]:
        return self._feed.hearings() if self._feed is not None else ()

    # What is done with what comes out, and what is told.

    def _announce(self, violations: list[Violation]) -> None:
        self._details.report(violations, self._evaluator.value)
        self._handlers.announce(violations)

    def _tick(self) -> None:
        with self._lock:
            violations = self._evaluator.tick(self._now())
            if violations:
                self._announce(violations)

    def _now(self) -> int:
        return int(self._node.get_clock().now().nanoseconds)

    def _tell_health(self) -> None:
        self._check()  # in the executor, so that whoever spins the node is told
        with self._lock:
            self._health.publish(self._hearings())

    def _tell_missing(self) -> None:
        self._patience.cancel()
        with self._lock:
            told = describe_missing(
                self._evaluator, self._hearings(), self._node.resolve_topic_name)
        if told is not None:
            self._node.get_logger().warning(told)

    def _tell_undecodable(self, topic: int) -> None:
        if self._evaluator.topic_counts(topic).undecodable == 1:
            mapped = self.manifest.topics[topic]
            self._node.get_logger().error(
                f'a message on {self._node.resolve_topic_name(mapped.name)} cannot be decoded as '
                f'{mapped.message_type}; such messages are counted and are no step')

    def _tell_unusable(self, index: int, reason: str) -> None:
        item = self.manifest.inputs[index]
        assert item.topic is not None
        outcome = 'has no value yet' if self._evaluator.value(index) is None else 'keeps its value'
        self._node.get_logger().warning(
            f"{self._node.resolve_topic_name(item.topic)}: {reason}; input '{item.name}' "
            f'{outcome}')

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


def _readers(manifest: Manifest, tell: TellUnusable) -> list[MessageReader]:
    problems: list[str] = []
    for message_type in sorted({topic.message_type for topic in manifest.topics}):
        try:
            message_class(message_type)
        except MessageTypeError as error:
            problems.append(str(error))
    if problems:
        raise Refusal(*problems)
    return [MessageReader(manifest, topic, tell) for topic in range(len(manifest.topics))]
