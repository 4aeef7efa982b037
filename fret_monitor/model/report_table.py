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
What reports must know of a bundle: the values of a `struct fm_report_table` (`csrc/reporting`).

`runtime.reporting` makes memory for C of them, `export.ros2_table` the text of C.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain, repeat
from typing import Any

from fret_monitor.model.manifest import (
    followed, Manifest, ManifestAction, ManifestInput, ManifestTopic,
)
from fret_monitor.model.names import DETAILS_TOPIC, OWN_TOPICS, verdict_topic
from fret_monitor.model.payload import PartKind, PayloadPart
from fret_monitor.model.policies import (
    ActionKind, InputSource, Otherwise, OverInstances, Policy, Report, Severity, Stale, Stamp,
)
from fret_monitor.model.values import ValueType

type Value = bool | int | float | str | Enumerator | Stored | Elements | Members | None
"""An initializer; `None` is a null pointer."""


OPERATIONS = {
    OverInstances.COUNT: 'FM_COUNT_OF', OverInstances.ANY: 'FM_ANY_OF',
    OverInstances.ALL: 'FM_ALL_OF', OverInstances.LEAST: 'FM_MIN_OF',
    OverInstances.GREATEST: 'FM_MAX_OF', OverInstances.SUM: 'FM_SUM_OF'}
"""Of values over instances (`enum fm_operation`)."""

NONE = 2**32 - 1
"""In place of an index: of a kind, that of the bundle's scope; of an input, one with a key."""

OTHERWISE = {Otherwise.DROP: 'FM_DROP', Otherwise.HOLD: 'FM_HOLD',
             Otherwise.SUBSTITUTE: 'FM_SUBSTITUTE', Otherwise.RESPOND: 'FM_DROP'}
"""Of a gate (`enum fm_otherwise`); the response of a service is sent by the node."""


@dataclass(frozen=True)
class Enumerator:
    """A constant of C."""

    name: str


@dataclass(frozen=True)
class Stored:
    """A `union fm_value`."""

    kind: ValueType
    value: bool | int | float


@dataclass(frozen=True)
class Elements:
    """A pointer to the first of some elements."""

    element: str
    items: tuple[Value, ...]


@dataclass(frozen=True)
class Members:
    """A struct, by the names of its members; those that are left out are zero."""

    members: Mapping[str, Value]


def report_table(manifest: Manifest, bundle: str = '', *, policy: Policy | None = None,
                 period: float | None = None) -> Members:
    """
    Return the table of a bundle.

    `bundle` is the name to show, empty if the node has only one bundle; `policy` and `period`, in
    seconds, are those with which it runs, if not the manifest's.
    """
    policy = policy or manifest.policy
    locks = [(place, item) for place, item in enumerate(manifest.actions)
             if item.kind is ActionKind.LOCK]
    arrays = {
        'locks': _structs('fm_report_lock', (_lock(manifest, *item) for item in locks)),
        'actions': _structs('fm_action', (
            _action(manifest, place, item) for place, item in enumerate(manifest.actions)
            if item.kind is not ActionKind.LOCK)),
        'inputs': _structs('fm_report_input', map(_input, manifest.inputs)),
        'requirements': _structs('fm_report_requirement', ({
            'id': item.id, 'text': item.shown, 'sentence': item.sentence,
            'verdict_topic': verdict_topic(item.handler), 'margin_topic': margins,
            'kind': NONE if kind is None else kind,
            **_listed('inputs', item.inputs), **_listed('constants', item.constants),
            'horizon': item.horizon, 'is_warning': item.severity is Severity.WARN,
            'shows_verdict': item.report is Report.OCCURRENCE}
            for item, kind, margins in zip(
                manifest.numbered, manifest.kind_of,
                manifest.margin_topics or repeat(''), strict=False))),
        'kinds': _structs('fm_report_kind', (
            _kind(manifest, place) for place, _ in enumerate(manifest.kinds))),
        'constants': _structs('fm_constant', (
            {'name': name, 'value': value} for name, value in manifest.constants)),
    }
    return Members({
        'bundle': bundle or manifest.name, 'component': manifest.component,
        'gate': _gate(manifest), **arrays,
        **{f'n_{name}': len(array.items) for name, array in arrays.items()},
        'topics': _structs('fm_report_topic', (
            {'name': name, 'type': message_type, 'variable': variable, 'where': where,
             'kind': Enumerator(kind)}
            for (name, message_type, kind), (variable, where) in zip(used_topics(manifest), chain(
                ((_variable(manifest, item), item.where) for item in manifest.topics),
                repeat(('', '')))))),
        'n_topics': len(manifest.topics), 'n_used': len([*used_topics(manifest)]),
        'topic_inputs': fed_inputs(manifest), 'comparisons': _comparisons(manifest),
        'follows': _structs('fm_follows', (
            _listed('on_violation', violation) | _listed('on_end', end)
            for violation, end in followed(manifest))),
        'is_one_of_several': bundle != '',
        'policy': Enumerator(f'FM_{policy.name}'),
        'period': _nanoseconds(
            period or manifest.period if policy is Policy.PERIODIC else None),
        'uses_header_stamps': policy is Policy.TIMED and manifest.stamp is Stamp.HEADER,
        'reorder': manifest.reorder,
    })


def _kind(manifest: Manifest, place: int) -> dict[str, Value]:
    kind = manifest.kinds[place]
    own = manifest.mentioned(place)
    return {
        'variable': own[0].name, 'second': ''.join(item.name for item in own[1:]),
        'most': manifest.most(place), 'first_most': own[0].most, 'second_most': own[-1].most,
        'inputs': _structs('fm_report_input', map(_input, kind.manifest.inputs)),
        'n_inputs': len(kind.manifest.inputs),
        'keyed': _structs('fm_topic', (
            _listed('inputs', manifest.keyed(place, topic))
            for topic in range(len(manifest.topics)))),
        'has_base': manifest.base_of(place) != place,
        'comparisons': _comparisons(kind.manifest),
        'shared': Elements('uint32_t', tuple(
            NONE if item is None else item for item in kind.shared))}


def _comparisons(manifest: Manifest) -> Elements:
    return Elements('char * const', tuple(item.text for item in manifest.comparisons))


def _variable(manifest: Manifest, topic: ManifestTopic) -> str:
    variable = manifest.key_of(topic)
    return '' if variable is None else f'{{{variable.name}}}'


def fed_inputs(manifest: Manifest) -> Elements:
    """Return the inputs that each topic feeds."""
    return _structs('fm_topic', (_listed('inputs', item.inputs) for item in manifest.topics))


def concerns(manifest: Manifest, kind: int) -> list[int]:
    """Return, of each topic, for which instances its messages are (`enum fm_concern`)."""
    own = manifest.kinds[kind].manifest
    return [bool(topic.inputs) + 2 * bool(manifest.keyed(kind, place)) + 4 * any(
        own.inputs[index].source is InputSource.INSTANCES for index in own.topics[place].inputs)
            for place, topic in enumerate(manifest.topics)]


def used_topics(manifest: Manifest) -> Iterator[tuple[str, str, str]]:
    """Yield the topics that a node uses, as written, with their types and `enum fm_topic_kind`."""
    for topic in manifest.topics:
        kind = topic.made.kind.c_name if topic.made else 'FM_TOPIC'
        yield topic.name, topic.message_type, kind
    for item in manifest.numbered:
        yield item.topic, 'std_msgs/msg/Empty', 'FM_ANNOUNCED'
    yield DETAILS_TOPIC, 'diagnostic_msgs/msg/DiagnosticArray', 'FM_ANNOUNCED'
    for name, message_type in OWN_TOPICS.items():
        yield name, message_type, 'FM_OWN'
    for name in manifest.margin_topics:
        yield name, 'std_msgs/msg/Float64', 'FM_ANNOUNCED'


def _structs(name: str, items: Iterable[Mapping[str, Value]]) -> Elements:
    return Elements(f'struct {name}', tuple(map(Members, items)))


def _listed(name: str, places: tuple[int, ...]) -> dict[str, Value]:
    return {name: Elements('uint32_t', places), f'n_{name}': len(places)}


def _lock(manifest: Manifest, place: int, action: ManifestAction) -> dict[str, Value]:
    users = tuple(number for number, item in enumerate(manifest.numbered)
                  if place in item.on_violation)
    return {'name': action.name, 'topic': action.target, 'period': action.period,
            **_listed('requirements', users)}


def _action(manifest: Manifest, place: int, item: ManifestAction) -> dict[str, Value]:
    times: dict[str, Any] = {name: getattr(item, name) for name in (
        'period', 'duration', 'timeout', 'after', 'cooldown', 'retries')}
    pair = _instances_followed(manifest, place) if item.parts else ()
    return {
        'kind': Enumerator(f'FM_ACTION_{item.kind.name}'), 'name': item.name,
        'target': item.target, 'state': item.state,
        'payload': Elements('uint8_t', tuple(item.payload)), 'payload_size': len(item.payload),
        'parts': _structs('fm_payload_part', (
            {'kind': Enumerator(f'FM_PART_{part.kind.name}'), 'align': part.align, 'at': part.at,
             'size': part.size, **_keys(part, pair)} for part in item.parts)),
        'n_parts': len(item.parts), 'is_of_pairs': len(pair) > 1,
        'stamp_at': -1 if item.stamp_at is None else item.stamp_at, **times}


def _instances_followed(manifest: Manifest, place: int) -> tuple[int, ...]:
    """Return the variables of the requirements that an action with keys follows."""
    return next((manifest.kinds[kind].variables for item, kind in zip(
        manifest.numbered, manifest.kind_of, strict=True)
        if kind is not None and place in (*item.on_violation, *item.on_end)), ())


def _keys(part: PayloadPart, variables: tuple[int, ...]) -> dict[str, Value]:
    """Return which keys of an instance of some variables a part has."""
    second = sum(key in variables[1:] for key in part.keys)
    return {'n_keys': len(part.keys) - second, 'n_second': second} \
        if part.kind is PartKind.LENGTH else {'which': second}


def _gate(manifest: Manifest) -> Elements | None:
    gate = manifest.gate
    return None if gate is None else _structs('fm_report_gate', [{
        'name': gate.name, 'topic': len(manifest.topics) if gate.topic is None else gate.topic,
        'open_after': gate.open_after, 'passes_silent': gate.is_open_when_stale,
        'is_service': gate.is_service, 'latches': gate.latches, 'hold': gate.hold,
        'period': gate.period, 'otherwise': Enumerator(OTHERWISE[gate.otherwise])}])


def _input(item: ManifestInput) -> dict[str, Value]:
    return {
        'name': item.name, 'path': item.field,
        'values': _structs('fm_value_name', (
            {'name': name, 'value': Stored(item.value_type, number)}
            for name, number in item.stored_values)),
        'n_values': len(item.values),
        'is_timed_out': item.is_timed_out, 'violates': item.stale is Stale.VIOLATE,
        'has_initial': item.initial is not None,
        'initial': Stored(item.value_type, item.initial or 0),
        'timeout': item.timeout or 0.0, 'startup': item.first_timeout}


def _nanoseconds(seconds: float | None) -> int:
    return max(1, round(seconds * 1e9)) if seconds else 0
