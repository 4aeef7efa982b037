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

"""Reads the gates of a bundle; names, topics and types are resolved in `elaboration`."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from enum import Enum
from fractions import Fraction
from itertools import product

from fret_monitor.bundle.actions import (
    message_type_fault, MESSAGES, name_of_resource, RATES_HZ, read_names, required,
)
from fret_monitor.bundle.bundle import Bundle, GateEntry
from fret_monitor.bundle.instances import mentioned
from fret_monitor.bundle.yaml_shape import mapping_of, report_fault, SECONDS, Shape
from fret_monitor.bundle.yaml_tree import Node, YamlMapping, YamlScalar
from fret_monitor.model.diagnostics import did_you_mean, Problems, Span, Text
from fret_monitor.model.manifest import EVENT_SUFFIX, events_of
from fret_monitor.model.names import (
    acting_name_fault, name_with_keys, service_type_fault, shown,
)
from fret_monitor.model.policies import Otherwise

GATE_KEYS = ('from', 'service', 'to', 'type', 'keep', 'otherwise', 'stale', 'latch', 'open_after',
             'timeout')
OTHERWISE_KEYS = ('substitute', 'hold', 'respond', 'rate')
_ALTERNATIVES = (Otherwise.SUBSTITUTE, Otherwise.HOLD, Otherwise.RESPOND)
GATE_EXAMPLE = ('drive: {from: cmd_vel_raw, to: cmd_vel, type: geometry_msgs/msg/Twist, '
                'keep: [SLOW], otherwise: drop}')
_SUBSTITUTE_EXAMPLE = 'otherwise: {substitute: {}, rate: 20}'
_RESPOND_EXAMPLE = "otherwise: {respond: {success: false, message: 'withheld'}}"
_SLIPS = {'source': 'from', 'input': 'from', 'output': 'to', 'target': 'to',
          'requirements': 'keep', 'keeps': 'keep', 'else': 'otherwise', 'latched': 'latch'}
_SHORTEST_S = Fraction(1, 1000)
_LONGEST_S = Fraction(10 ** 6)
_ANSWERED_S = Fraction(60)


class WhenStale(Enum):
    """Whether a gate is closed while an input of its requirements is silent."""

    CLOSED = 'closed'
    OPEN = 'open'


def read_gates(shape: Shape, types: Mapping[str, str],
               problems: Problems) -> Iterator[tuple[Text, GateEntry | None]]:
    """
    Yield the name of each gate with its entry; None: it was refused.

    `types` are those of the inputs, by topic, for examples.
    """
    mapping = mapping_of(shape.node('gates'), "'gates'", problems, GATE_EXAMPLE)
    if mapping and _lacks_name(mapping):
        key, _ = mapping.entries[0]
        problems.error('the gate has no name', key.span,
                       f'{shown(key.value)} is a key of a gate, not the name of one',
                       GATE_EXAMPLE)
        return
    for key, node in mapping.entries if mapping else ():
        report_fault(acting_name_fault(key.value), key.text, problems)
        inner = mapping_of(node, f'the gate {shown(key.value)}', problems, GATE_EXAMPLE)
        yield key.text, _gate(key, inner, types, problems) if inner else None


def _lacks_name(mapping: YamlMapping) -> bool:
    """Return whether the keys of a gate stand where its name is missing."""
    return len(mapping.entries) > 1 and all(
        key.value in GATE_KEYS for key, _ in mapping.entries) and any(
        key.value in ('from', 'service', 'to') and isinstance(node, YamlScalar)
        and not node.is_missing for key, node in mapping.entries)


def _gate(name: YamlScalar, mapping: YamlMapping, types: Mapping[str, str],
          problems: Problems) -> GateEntry:
    shape = Shape(mapping, 'a gate', GATE_KEYS, problems, _SLIPS)
    is_service = _is_service(name, shape, problems)
    kind, source = ('service', 'service') if is_service else ('topic', 'from')
    stale = shape.key('stale')
    latches, open_after = _latch(shape, problems)
    entry = GateEntry(
        name=name.text, is_service=is_service,
        source=required(shape, source, name_of_resource(kind, source, has_keys=True), problems,
                        '/arm/enable' if is_service else 'cmd_vel_raw')
        if shape.key(source) else None,
        target=required(shape, 'to', name_of_resource(kind, 'to', has_keys=True), problems,
                        '/arm/enable_raw' if is_service else 'cmd_vel'),
        type=required(shape, 'type', service_type_fault if is_service else message_type_fault,
                      problems, _likely_type(shape.node(source), is_service, types)),
        keep=_keep(name, shape, problems),
        otherwise=None, otherwise_place=name.span,
        is_open_when_stale=shape.choice('stale', WhenStale) is WhenStale.OPEN,
        stale_place=stale.span if stale else None,
        latches=latches, open_after=open_after,
        timeout=_timeout(shape, is_service, problems))
    return _with_otherwise(entry, shape, problems)


def _latch(shape: Shape, problems: Problems) -> tuple[bool, Fraction | None]:
    """Return whether a violation latches the gate, and for how long at least."""
    latches = shape.truth('latch')
    open_after = shape.number('open_after', SECONDS, _SHORTEST_S, _LONGEST_S)
    if (key := shape.key('open_after')) and not latches:
        problems.error("'open_after' needs 'latch: true'", key.span,
                       'without a latch the gate opens with the next good message',
                       'latch: true')
    return latches, open_after


def _timeout(shape: Shape, is_service: bool, problems: Problems) -> Fraction | None:
    timeout = shape.number('timeout', SECONDS, _SHORTEST_S, _LONGEST_S)
    if (key := shape.key('timeout')) and not is_service:
        problems.error("'timeout' belongs to a gate on a service", key.span,
                       'how long a request waits for its answer',
                       "an input of 'from' has a 'timeout' of its own; remove this one")
    return (timeout or _ANSWERED_S) if is_service else None


def _likely_type(source: Node | None, is_service: bool, types: Mapping[str, str]) -> str:
    """Return the type of the inputs on what a gate reads, or else an example."""
    example = 'std_srvs/srv/SetBool' if is_service else 'geometry_msgs/msg/Twist'
    if not isinstance(source, YamlScalar):
        return example
    judged = events_of(source.value) if is_service else source.value
    return types.get(judged, example).removesuffix(EVENT_SUFFIX)


def _is_service(name: YamlScalar, shape: Shape, problems: Problems) -> bool:
    service, source = shape.key('service'), shape.key('from')
    if service and source:
        second = max(service, source, key=lambda key: key.span.start)
        problems.error("'from' and 'service' are both given", second.span,
                       'a gate is on a topic or on a service', 'remove one of them')
    elif shape.lacks('service', 'from'):
        problems.error(f"the gate {shown(name.value)} has no 'from'", name.span,
                       'the topic that it lets through', 'from: cmd_vel_raw')
    return service is not None and source is None


def _keep(name: YamlScalar, shape: Shape, problems: Problems) -> tuple[Text, ...]:
    found = Problems()
    keep = read_names(shape, 'keep', found)
    problems.extend(found.errors)
    if keep is None and shape.lacks('keep') or keep == () and not found.errors:
        key = shape.key('keep')
        problems.error(f'the gate {shown(name.value)} keeps nothing', key.span if key else
                       name.span, 'a gate without requirements lets everything through',
                       'keep: [SLOW]   # ids of requirements')
    return keep or ()


def _with_otherwise(entry: GateEntry, shape: Shape, problems: Problems) -> GateEntry:
    """Return a gate with what it sends instead."""
    node, key = shape.node('otherwise'), shape.key('otherwise')
    place = key.span if key else entry.name.span
    entry = replace(entry, otherwise_place=place)
    if key is None:
        if not shape.lacks('otherwise'):
            return entry
        if entry.is_service:
            _need_response(place, problems)
            return entry
        return replace(entry, otherwise=Otherwise.DROP)
    if isinstance(node, YamlScalar) and not node.is_missing:
        return _with_word(entry, node, problems)
    mapping = mapping_of(node, "'otherwise'", problems, 'otherwise: drop')
    if mapping is None:
        return entry
    part = Shape(mapping, "'otherwise'", OTHERWISE_KEYS, problems,
                 {'message': 'respond' if entry.is_service else 'substitute',
                  'response': 'respond'})
    return _with_alternative(entry, part, place, problems)


def _need_response(place: Span, problems: Problems) -> None:
    problems.error('a gate on a service needs a response for what it refuses', place,
                   "no 'respond' is given", _RESPOND_EXAMPLE)


def _with_word(entry: GateEntry, node: YamlScalar, problems: Problems) -> GateEntry:
    if node.value == Otherwise.DROP.value and not entry.is_service:
        return replace(entry, otherwise=Otherwise.DROP)
    if entry.is_service:
        _need_response(node.span, problems)
    else:
        problems.error(
            f"{shown(node.value)} is not valid for 'otherwise'", node.span,
            'drop, substitute or hold', did_you_mean(node.value, ['drop'])
            or f'otherwise: drop\notherwise: {{hold: 0.5}}\n{_SUBSTITUTE_EXAMPLE}')
    return entry


def _with_alternative(entry: GateEntry, part: Shape, place: Span,
                      problems: Problems) -> GateEntry:
    given = [kind for kind in _ALTERNATIVES if part.key(kind.value)]
    rate = part.number('rate', MESSAGES, *RATES_HZ)
    if (key := part.key('rate')) and given and given[0] is not Otherwise.SUBSTITUTE:
        problems.error("'rate' belongs to a substitute", key.span,
                       'each request that is withheld gets one response' if entry.is_service else
                       f"a gate with '{given[0].value}' sends one for each message it withholds",
                       'remove it')
    if not given:
        if part.lacks(*(kind.value for kind in _ALTERNATIVES)):
            problems.error("'otherwise' says nothing to send", place, '',
                           _RESPOND_EXAMPLE if entry.is_service else
                           f'otherwise: drop\notherwise: {{hold: 0.5}}\n{_SUBSTITUTE_EXAMPLE}')
        return entry
    if len(given) > 1:
        second = part.key(given[1].value)
        problems.error(f"'{given[0].value}' and '{given[1].value}' are both given",
                       second.span if second else place, '', 'remove one of them')
    kind = given[0]
    if entry.is_service is not (kind is Otherwise.RESPOND):
        found = part.key(kind.value)
        problems.error(
            f"a gate on a {'service' if entry.is_service else 'topic'} has no '{kind.value}'",
            found.span if found else place, '',
            _RESPOND_EXAMPLE if entry.is_service else _SUBSTITUTE_EXAMPLE)
        return entry
    if kind is Otherwise.HOLD:
        hold = part.number('hold', SECONDS, _SHORTEST_S, _LONGEST_S)
        return replace(entry, otherwise=kind if hold else None, hold=hold)
    content = mapping_of(part.node(kind.value), f"'{kind.value}'", problems,
                         _RESPOND_EXAMPLE if entry.is_service else _SUBSTITUTE_EXAMPLE)
    return replace(entry, otherwise=kind if content else None, content=content, rate=rate)


def names_with_keys(entry: GateEntry, bundle: Bundle) -> list[str]:
    """Return the names of a gate, one for each key of the variables that it mentions."""
    found = {name for name, _ in mentioned(entry.source)}
    keys = [[key.value for key in item.keys] for item in bundle.instance_variables
            if item.keys and item.name.value in found]
    return [name_with_keys(entry.name.value, each) for each in product(*keys)]
