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
How the monitor fares, where operators look: `/diagnostics`, once a second (DESIGN 8).

A status for each requirement and each topic, named `NODE: ITEM`, as aggregators expect. What
keeps requirements from being evaluated at all is told in a sentence for the log, too.
"""

from collections.abc import Callable, Iterator, Sequence
from time import monotonic

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from fret_monitor.manifest import ManifestRequirement, ManifestTopic
from fret_monitor.ros.details import LEVELS
from fret_monitor.ros.feed import Hearing
from fret_monitor.runtime import Evaluator

from rclpy.node import Node

PERIOD = 1.0  # s
_NAMED = 5  # requirements, topics, and inputs of a topic in one line of the log


class Health:
    """Publishes diagnostics while somebody listens."""

    def __init__(self, node: Node, evaluator: Evaluator) -> None:
        """Advertise the topic; whoever made this calls `publish` each `PERIOD`."""
        self._node = node
        self._evaluator = evaluator
        self._manifest = evaluator.monitor.manifest
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self._prefix = node.get_fully_qualified_name().lstrip('/')
        self._received = [0] * len(self._manifest.topics)
        self._unusable = [0] * len(self._manifest.inputs)
        self._time = monotonic()

    def publish(self, hearings: Sequence[Hearing]) -> None:
        """Publish what is so now; `hearings` are who is heard on the topics, in their order."""
        rates, unusable = list(self._rates()), self._newly_unusable()
        if not self._publisher.get_subscription_count():
            return
        array = DiagnosticArray()
        array.header.stamp = self._node.get_clock().now().to_msg()
        array.status = [
            *(self._of_requirement(index, item)
              for index, item in enumerate(self._manifest.requirements)),
            *(self._of_topic(index, item, hearings[index], rates[index], unusable)
              for index, item in enumerate(self._manifest.topics))]
        self._publisher.publish(array)

    def close(self) -> None:
        """Withdraw the topic."""
        self._node.destroy_publisher(self._publisher)

    def _rates(self) -> Iterator[float]:
        """Yield messages a second since the last time, of real time, for each topic."""
        since, self._time = self._time, monotonic()
        for index in range(len(self._manifest.topics)):
            received = self._evaluator.topic_counts(index).messages
            yield (received - self._received[index]) / max(self._time - since, 1e-3)
            self._received[index] = received

    def _newly_unusable(self) -> set[int]:
        """Return the inputs whose fields could not be used since the last time."""
        before = self._unusable
        self._unusable = [self._evaluator.input_counts(index).unusable
                          for index in range(len(before))]
        return {index for index, count in enumerate(self._unusable) if count > before[index]}

    def _of_requirement(self, index: int, item: ManifestRequirement) -> DiagnosticStatus:
        counts = self._evaluator.requirement_counts(index)
        missing = [self._manifest.inputs[place].name for place in item.inputs
                   if self._evaluator.value(place) is None]
        if missing:
            level, message = DiagnosticStatus.WARN, f'no value yet of {", ".join(missing)}'
        elif counts.verdict:
            level, message = DiagnosticStatus.OK, 'satisfied'
        else:
            level, message = LEVELS[item.severity], 'violated'
        return self._status(item.id, level, message, {
            'steps': counts.steps, 'violations': counts.violations,
            'announced': counts.announced, 'text': ' '.join((item.title or item.text).split())})

    def _of_topic(self, index: int, item: ManifestTopic, hearing: Hearing,
                  rate: float, newly_unusable: set[int]) -> DiagnosticStatus:
        counts = self._evaluator.topic_counts(index)
        unusable = {
            self._manifest.inputs[place].name: self._unusable[place] for place in item.inputs}
        level, message = _judgement(item, hearing, [
            self._manifest.inputs[place].name for place in item.inputs if place in newly_unusable])
        return self._status(
            f'topic {self._node.resolve_topic_name(item.name)}', level, message, {
                'received': counts.messages, 'rate': f'{rate:.1f}',
                'undecodable': counts.undecodable, 'publishers': hearing.publishers,
                **{f'unusable {name}': count for name, count in unusable.items() if count}})

    def _status(self, name: str, level: bytes, message: str,
                values: dict[str, object]) -> DiagnosticStatus:
        return DiagnosticStatus(
            name=f'{self._prefix}: {name}', level=level, message=message,
            hardware_id=self._manifest.component,
            values=[KeyValue(key=key, value=str(value)) for key, value in values.items()])


def _judgement(topic: ManifestTopic, hearing: Hearing,
               unusable: Sequence[str]) -> tuple[bytes, str]:
    if hearing.other_types:
        return DiagnosticStatus.ERROR, (
            f'a publisher of {", ".join(hearing.other_types)}, and not {topic.message_type}')
    if hearing.unheard:
        return DiagnosticStatus.ERROR, f'not heard: {", ".join(hearing.unheard)}'
    if unusable:
        return DiagnosticStatus.WARN, f'fields cannot be used: {", ".join(unusable)}'
    if not hearing.publishers:
        return DiagnosticStatus.WARN, 'no publisher'
    return DiagnosticStatus.OK, 'received'


def describe_missing(evaluator: Evaluator, hearings: Sequence[Hearing],
                     full_name: Callable[[str], str]) -> str | None:
    """
    Return which requirements wait for which topics; None if none does.

    `full_name` makes that of a topic of the one in the bundle.
    """
    manifest = evaluator.monitor.manifest
    missing = {index for index in range(len(manifest.inputs)) if evaluator.value(index) is None}
    waiting = [item for item in manifest.requirements if not missing.isdisjoint(item.inputs)]
    if not waiting:
        return None
    read = {index for item in waiting for index in item.inputs}
    reasons = []
    for index, topic in enumerate(manifest.topics):
        names = [f"'{manifest.inputs[place].name}'" for place in topic.inputs
                 if place in missing & read]
        if names:
            usable = 'usable ' if evaluator.topic_counts(index).messages else ''
            reasons.append(f'nothing {usable}received on {full_name(topic.name)} '
                           f'({_publishers(topic, hearings[index])}) for {_some(names)}')
    return (f'{_some([item.id for item in waiting])} {"is" if len(waiting) == 1 else "are"} '
            f'not evaluated yet: {_some(reasons, "; ")}')


def _publishers(topic: ManifestTopic, hearing: Hearing) -> str:
    count = f'{hearing.publishers} publisher{"" if hearing.publishers == 1 else "s"}'
    return f'{count} of {topic.message_type}' if hearing.other_types else count


def _some(names: Sequence[str], separator: str = ', ') -> str:
    more = len(names) - _NAMED
    return separator.join(names[:_NAMED]) + (f' and {more} more' if more > 0 else '')
