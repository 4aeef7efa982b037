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

"""Who uses a topic or a service: gates and actions that would disturb one another are refused."""

from collections.abc import Collection, Iterator
from dataclasses import dataclass

from fret_monitor.bundle.bundle import ActionEntry, Bundle, GateEntry, Requirement
from fret_monitor.model.diagnostics import Problems, Text
from fret_monitor.model.graph import cycles
from fret_monitor.model.manifest import EVENT_SUFFIX, events_of
from fret_monitor.model.names import absolute, DIAGNOSTICS_TOPIC, is_own_topic, OWN_SERVICES, shown
from fret_monitor.model.policies import ActionKind

LOCK_TYPE = 'std_msgs/msg/Bool'
_DIAGNOSTICS_TYPE = 'diagnostic_msgs/msg/DiagnosticArray'


def check_topics(bundle: Bundle, unusable: Collection[str], problems: Problems) -> None:
    """Check the topics and services of all gates and actions; types in `unusable` are unknown."""
    checks = _Checks(bundle, problems)
    checks.gates()
    checks.circles()
    checks.types(unusable)
    checks.locks()
    checks.judges()
    checks.own_topics()
    checks.own_services()


@dataclass(frozen=True)
class _Checks:
    bundle: Bundle
    problems: Problems

    def _aimed(self, *kinds: ActionKind) -> Iterator[tuple[ActionEntry, Text]]:
        """Yield the actions of some kinds, each with its topic or service."""
        for entry in self.bundle.actions:
            if entry.kind in kinds and entry.target is not None:
                yield entry, entry.target

    def gates(self) -> None:
        """Refuse a second server of what a gate offers, and a second publisher where it leads."""
        first: dict[tuple[bool, str], GateEntry] = {}
        for entry in self.bundle.gates:
            name = entry.source if entry.is_service else entry.target
            if name is None:
                continue
            other = first.setdefault((entry.is_service, absolute(name.value)), entry)
            if other is not entry:
                does, what = ('offer', 'service') if entry.is_service else ('lead to', 'topic')
                self.problems.error(
                    f'two gates {does} {shown(name.value)}', name.span,
                    f'{shown(other.name.value)} does already',
                    f'one gate keeps all requirements of a {what}')
        for _, topic in self._aimed(ActionKind.LOCK, ActionKind.PUBLISH):
            if gate := first.get((False, absolute(topic.value))):
                self.problems.error(
                    f'{shown(topic.value)} belongs to the gate {shown(gate.name.value)}',
                    topic.span, 'what is published here would not pass the gate',
                    "publish on the gate's 'from', or write it as the gate's substitute")

    def circles(self) -> None:
        sides = [(absolute(entry.source.value), absolute(entry.target.value), entry)
                 for entry in self.bundle.gates
                 if entry.source and entry.target and not entry.is_service]
        for way in cycles((source, target) for source, target, _ in sides if source != target):
            entry = next(item for source, target, item in sides
                         if (source, target) == (way[-2], way[-1]))
            assert entry.target
            self.problems.error('these gates are a circle', entry.target.span,
                                ' -> '.join(way), 'messages would go round for ever')

    def types(self, unusable: Collection[str]) -> None:
        """Refuse two types of one topic."""
        types: dict[str, tuple[str, str]] = {}
        for owner, topic, kind, place in self._typed_topics():
            if kind in unusable:
                continue
            known, first = types.setdefault(absolute(topic), (kind, owner))
            if known != kind:
                suffix = EVENT_SUFFIX if kind.endswith(EVENT_SUFFIX) else ''
                self.problems.error(
                    f'{shown(topic)} has two types', place.span,
                    f'{first} has {known}, {owner} has {kind}',
                    'choose another topic' if place.value == topic
                    else f'type: {known.removesuffix(suffix)}')

    def _typed_topics(self) -> Iterator[tuple[str, str, str, Text]]:
        """Yield what uses a topic, the topic, its type, and the place for the error."""
        for item in self.bundle.inputs:
            if item.topic and item.type:
                yield f"the input '{item.name}'", item.topic.value, item.type.value, item.topic
        for gate in self.bundle.gates:
            owner = f"the gate '{gate.name}'"
            if gate.type and gate.is_service and gate.source:
                yield (owner, events_of(gate.source.value), gate.type.value + EVENT_SUFFIX,
                       gate.type)
            for topic in (gate.source, gate.target):
                if gate.type and not gate.is_service and topic:
                    yield owner, topic.value, gate.type.value, gate.type
        for action, target in self._aimed(ActionKind.LOCK, ActionKind.PUBLISH):
            owner = f"the action '{action.name}'"
            if action.kind is ActionKind.LOCK:
                yield owner, target.value, LOCK_TYPE, target
            elif action.type:
                yield owner, target.value, action.type.value, action.type

    def locks(self) -> None:
        """Refuse two publishers of one lock, which would contradict each other."""
        first: dict[str, ActionEntry] = {}
        for lock, topic in self._aimed(ActionKind.LOCK):
            other = first.setdefault(absolute(topic.value), lock)
            if other is not lock:
                self.problems.error(
                    f'two locks on {shown(topic.value)}', topic.span,
                    'one would publish false while the other publishes true',
                    f'use the lock {shown(other.name.value)} for the requirements of both')
        for _, topic in self._aimed(ActionKind.PUBLISH):
            if other_lock := first.get(absolute(topic.value)):
                self.problems.error(
                    f'{shown(topic.value)} is the topic of the lock '
                    f'{shown(other_lock.name.value)}', topic.span,
                    'a message here would lock or free it whatever is violated',
                    'publish on another topic, or let the lock alone lock')

    def judges(self) -> None:
        """Refuse a lock of requirements that different nodes judge."""
        gate_of = {name.value: entry for entry in self.bundle.gates for name in entry.keep}
        for lock, _ in self._aimed(ActionKind.LOCK):
            users = [item for item in self.bundle.requirements
                     if any(name.value == lock.name.value for name in item.on_violation)]
            for item in users:
                if gate_of.get(item.id.value) is not gate_of.get(users[0].id.value):
                    self.problems.error(
                        f'the lock {shown(lock.name.value)} has two publishers', lock.name.span,
                        f'{_judge(users[0], gate_of)}, {_judge(item, gate_of)}',
                        'give the requirements of each gate a lock on a topic of its own')
                    break

    def own_topics(self) -> None:
        """Refuse to publish on the topics that the node itself publishes on."""
        published = [(entry.target, entry.type) for entry in self.bundle.gates
                     if entry.target and not entry.is_service]
        published += [(topic, entry.type) for entry, topic in
                      self._aimed(ActionKind.LOCK, ActionKind.PUBLISH)]
        for target, type_ in published:
            is_diagnosis = absolute(target.value) == DIAGNOSTICS_TOPIC and \
                type_ is not None and type_.value == _DIAGNOSTICS_TYPE
            if is_own_topic(target.value) and not is_diagnosis:
                self.problems.error(
                    f'the node publishes on {shown(target.value)} itself', target.span,
                    'its subscribers take each message for one of the node',
                    'choose another topic')

    def own_services(self) -> None:
        """Refuse to call the services with which the node itself is reset or deactivated."""
        for _, service in self._aimed(ActionKind.CALL):
            if service.value in OWN_SERVICES:
                self.problems.error(
                    f'the node offers {shown(service.value)} itself', service.span,
                    'the violation would end its own monitoring or begin it anew',
                    'call a service of another node')


def _judge(item: Requirement, gate_of: dict[str, GateEntry]) -> str:
    gate = gate_of.get(item.id.value)
    return f'{item.id} is judged by ' + (
        f'the gate {shown(gate.name.value)}' if gate else 'the monitor')
