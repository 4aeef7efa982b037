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
The node that watches: subscriptions in, compiled monitors in the middle, violations out.

Callbacks store, the evaluator steps. Messages come in the feed's thread, resets and periods in
the executor's; one lock keeps them apart.
"""

from contextlib import ExitStack
from threading import Lock
from typing import Any

from fret_monitor.manifest import Manifest, ManifestInput, Policy
from fret_monitor.ros.compiled import open_monitor, Opened
from fret_monitor.ros.details import Details
from fret_monitor.ros.fed_node import FedNode
from fret_monitor.ros.feed import Deliver
from fret_monitor.ros.fields import (
    message_class,
    MessageReader,
    MessageTypeError,
    TellUnusable,
)
from fret_monitor.ros.handlers import Handlers
from fret_monitor.ros.health import describe_missing, Health, PERIOD
from fret_monitor.ros.parameters import MONITOR_PARAMETERS, read_settings, Refusal
from fret_monitor.runtime import Evaluator, Violation

from rclpy.clock import Clock
from rclpy.clock import ClockType
from rclpy.exceptions import InvalidTopicNameException
from std_srvs.srv import Trigger

_PATIENCE = 5.0  # s until it is told what has not come at all


class MonitorNode(FedNode):
    """
    Monitors a bundle from its making until `destroy_node`.

    It can be spun by any executor: that serves `~/reset`, parameters and periods. Messages do
    not need one.
    """

    def __init__(self, node_name: str = 'fret_monitor', **options: Any) -> None:
        """
        Make the node and start watching; `options` are those of `rclpy.node.Node`.

        Raises
        ------
        Refusal
            if parameters, bundle or library are not such that it can start. Nothing is left.
        """
        super().__init__(node_name, **options)
        self._lock = Lock()
        with ExitStack() as undo:
            undo.callback(self.destroy_node)
            self._begin(open_monitor(read_settings(self, MONITOR_PARAMETERS)))
            undo.pop_all()

    def _begin(self, opened: Opened) -> None:
        manifest = opened.monitor.manifest
        refuse_inputs_off_ros(manifest)
        self._refuse_merged_topics(manifest)
        readers = _readers(manifest, self._tell_unusable)
        self._evaluator = Evaluator(
            opened.monitor, policy=opened.policy, library=opened.evaluator)
        try:
            self._handlers = Handlers(self, manifest)
            self._details = Details(self, manifest)
            self.create_service(Trigger, '~/reset', self._reset)
            for reader, topic in zip(readers, manifest.topics):
                self.feed.subscribe(
                    topic.name, topic.message_type, reader.message_class,
                    self._deliver(reader), dict(topic.qos))
        except InvalidTopicNameException as error:  # the namespace or a remapping may be wrong
            raise Refusal(f'cannot subscribe or advertise: {error}') from None
        if opened.policy is Policy.PERIODIC:
            assert opened.period is not None
            self.create_timer(float(opened.period), self._tick)
        self._health = Health(self, self._evaluator)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(PERIOD, self._tell_health, clock=steady)
        self._patience = self.create_timer(_PATIENCE, self._tell_missing, clock=steady)
        for warning in opened.warnings:
            self.get_logger().warning(warning)
        self.feed.start()
        self.get_logger().info(_announcement(opened))

    def _refuse_merged_topics(self, manifest: Manifest) -> None:
        """Refuse remappings that lead two topics together: a message would be two steps."""
        names: dict[str, str] = {}
        for topic in manifest.topics:
            full = self.resolve_topic_name(topic.name)
            other = names.setdefault(full, topic.name)
            if other != topic.name:
                raise Refusal(
                    f"'{other}' and '{topic.name}' are both remapped to {full}; if they are one "
                    f'topic, give the inputs that they feed one `topic:` in the bundle')

    def _deliver(self, reader: MessageReader) -> Deliver:
        """Return the callback for a topic: store what the message holds, then step."""
        evaluator, topic, lock = self._evaluator, reader.topic, self._lock
        uses_received = not self.get_parameter('use_sim_time').value

        def deliver(data: bytes, received: int, _: int) -> None:
            with lock:
                if not reader.read(data, evaluator):
                    self._tell_undecodable(topic)
                    return
                stamp = received if uses_received else self._now()
                violations = evaluator.message(topic, stamp)
                if violations:
                    self._announce(violations)

        return deliver

    def _tell_undecodable(self, topic: int) -> None:
        if self._evaluator.topic_counts(topic).undecodable == 1:
            mapped = self._evaluator.monitor.manifest.topics[topic]
            self.get_logger().error(
                f'a message on {self.resolve_topic_name(mapped.name)} cannot be decoded as '
                f'{mapped.message_type}; such messages are counted and are no step')

    def _tell_unusable(self, index: int, reason: str) -> None:
        item = self._evaluator.monitor.manifest.inputs[index]
        assert item.topic is not None
        outcome = 'has no value yet' if self._evaluator.value(index) is None else 'keeps its value'
        self.get_logger().warning(
            f"{self.resolve_topic_name(item.topic)}: {reason}; input '{item.name}' {outcome}")

    def _tick(self) -> None:
        with self._lock:
            violations = self._evaluator.tick(self._now())
            if violations:
                self._announce(violations)

    def _announce(self, violations: list[Violation]) -> None:
        self._details.report(violations, self._evaluator.value)
        self._handlers.announce(violations)

    def _now(self) -> int:
        return int(self.get_clock().now().nanoseconds)

    def _tell_health(self) -> None:
        with self._lock:
            self._health.publish(self.feed.hearings())

    def _tell_missing(self) -> None:
        self._patience.cancel()
        with self._lock:
            told = describe_missing(
                self._evaluator, self.feed.hearings(), self.resolve_topic_name)
        if told is not None:
            self.get_logger().warning(told)

    def _reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        with self._lock:
            self._evaluator.reset()
        groups = len(self._evaluator.monitor.manifest.groups)
        response.success = True
        response.message = f'restarted {_count(groups, "step group")}; input values kept'
        self.get_logger().info(response.message)
        return response


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


def _announcement(opened: Opened) -> str:
    manifest = opened.monitor.manifest
    return (f'watching {_count(len(manifest.requirements), "requirement")} '
            f'on {_count(len(manifest.inputs), "input")} '
            f'of {_count(len(manifest.topics), "topic")}, policy {opened.policy.value}, '
            f'{"" if opened.period is None else f"{opened.period:g} s, "}'
            f'{_count(manifest.state_bytes, "byte")} of state ({opened.origin})')


def _count(number: int, noun: str) -> str:
    return f'{number} {noun}' if number == 1 else f'{number} {noun}s'
