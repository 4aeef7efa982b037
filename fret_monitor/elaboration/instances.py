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

"""Of which instance variables each requirement is one for each key; what cannot be."""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from typing import TypeAlias

from fret_monitor.bundle.bundle import Bundle, InstanceVariable, Requirement
from fret_monitor.bundle.instances import mentioned, MOST_VARIABLES
from fret_monitor.bundle.yaml_tree import Node, YamlList, YamlMapping, YamlScalar
from fret_monitor.elaboration.gates_with_keys import check_gates
from fret_monitor.elaboration.message_values import INTEGERS, KeyRange
from fret_monitor.logic.scopes import variables_of
from fret_monitor.logic.specification import InstanceAggregate, Property, Signal
from fret_monitor.messages.field_path import key_type
from fret_monitor.messages.installed import nested_layout
from fret_monitor.messages.layout import FieldType
from fret_monitor.model.diagnostics import Problems, Span, Text
from fret_monitor.model.manifest import ManifestVariable
from fret_monitor.model.names import LONGEST_KEY, pair_key, shown
from fret_monitor.model.paths import LookUp, path_text
from fret_monitor.model.values import ValueType


def described_variable(item: InstanceVariable) -> ManifestVariable:
    """Return an instance variable as the manifest has it."""
    return ManifestVariable(item.name.value, tuple(key.value for key in item.keys), item.most,
                            int((item.forget or 0) * 10 ** 9))


def check_instances(bundle: Bundle, properties: Iterable[Property], signals: Iterable[Signal],
                    aggregates: Iterable[InstanceAggregate], problems: Problems) -> None:
    """Report requirements that are not one for each key of some variables."""
    inputs = {item.name: item for item in signals}
    properties = [*properties]
    for item in properties:
        _check(item, inputs, problems)
    pairs = _pairs(bundle, [*_of_pairs(bundle, properties, inputs), *(
        (item.variables, item.signal.name, item.place) for item in aggregates
        if len(item.variables) == MOST_VARIABLES)], inputs, problems)
    _check_numbers(bundle, inputs.values(), problems)
    _check_keys([item for item in inputs.values() if len(item.variables) == 1
                 or item.variables in pairs], problems)
    _check_actions(bundle, properties, inputs, problems)
    for signal in inputs.values() if bundle.instance_variables else ():
        if signal.source.is_measured:
            problems.error(
                "a bundle with 'for_each' has no rates, periods and derivatives by messages yet",
                signal.place, 'not supported', 'watch the topic in a bundle of its own')
    check_gates(bundle, properties, inputs, problems)


def _check_actions(bundle: Bundle, properties: Iterable[Property], inputs: Mapping[str, Signal],
                   problems: Problems) -> None:
    """Report actions with keys that follow what has none, or other ones."""
    names = [item.name.value for item in bundle.instance_variables]
    keyed: dict[str, list[str]] = {}
    for action in bundle.actions:
        found = [name for text in _texts(action.content) for name, _ in mentioned(text)]
        keyed[action.name.value] = [name for name in names if name in found]
    variables = {item.id: variables_of(
        {name: inputs[name].variables for name in item.inputs}, inputs) for item in properties}
    kept = {name.value for gate in bundle.gates for name in gate.keep}
    first: dict[str, Requirement] = {}  # that an action follows
    for requirement in bundle.requirements:
        of = variables.get(requirement.id.value)
        for used in (*requirement.on_violation, *requirement.on_end):
            keys = keyed.get(used.value)
            if not keys or of is None:
                continue
            if not of.issuperset(keys):
                _refuse_action(used, keys, requirement, problems)
                continue
            other = first.setdefault(used.value, requirement)
            if variables.get(other.id.value) != of:
                problems.error(
                    f'the action {shown(used.value)} has keys of instances, and follows '
                    f'requirements of others: {other.id.value} and {requirement.id.value}',
                    used.span, 'it is one of each instance', 'write two actions')
            elif requirement.id.value in kept:
                problems.error(
                    f'the action {shown(used.value)} has the key of {shown(keys[0])}, and a gate '
                    f'keeps {requirement.id.value}', used.span, 'the gate does not know the key',
                    'let an action without a key follow it')


def _refuse_action(name: Text, keys: Iterable[str], requirement: Requirement,
                   problems: Problems) -> None:
    problems.error(
        f'the action {shown(name.value)} has the key of {" and ".join(map(shown, keys))}, and '
        f'{requirement.id.value} is not one for each {" and ".join(keys)}', name.span,
        'its violation has no such key',
        f'on_violation: []   # in {requirement.id.value}, or an action without a key')


def key_ranges(variables: Iterable[InstanceVariable],
               signals: Iterable[Signal]) -> dict[str, KeyRange]:
    """Return the least and the greatest key of each variable; None: they are no whole numbers."""
    signals = [*signals]
    found: dict[str, KeyRange] = {}
    for item in variables:
        name = item.name.value
        kinds = [kind for signal in signals for of, kind in _types_of_keys(signal) if of == name]
        mentions = sum(name in signal.variables for signal in signals)
        listed = [int(key.value) for key in item.keys if _is_number(key.value)]
        if item.keys:
            found[name] = (min(listed), max(listed)) if len(listed) == len(item.keys) else None
        elif kinds and len(kinds) == mentions and all(kind.base in INTEGERS for kind in kinds):
            limits = [ValueType.of_field(kind.base).limits for kind in kinds]
            found[name] = int(min(low for low, _ in limits)), int(max(high for _, high in limits))
        else:
            found[name] = None
    return found


def _is_number(text: str) -> bool:
    """Whether a key is written as a whole number of at most 64 bits is."""
    number = _number(text)
    return number is not None and str(number) == text and -2**63 <= number < 2**64


def _texts(node: Node | None) -> Iterator[Text]:
    match node:
        case YamlScalar():
            yield node.text
        case YamlList():
            for item in node.items:
                yield from _texts(item)
        case YamlMapping():
            for _, item in node.entries:
                yield from _texts(item)


def _check_keys(signals: Iterable[Signal], problems: Problems) -> None:
    """Report inputs of which a message could have more than one part for a key."""
    first: dict[tuple[object, ...], Signal] = {}
    for signal in signals:
        keys = _keys(signal)
        if len(keys) > len(signal.variables):
            problems.error(
                f"'{signal.name}' mentions '{signal.variables[0]}' in two places", signal.place,
                ' and '.join(keys),
                'one of them is enough to select it; two are not supported yet')
        elif len(keys) < len(signal.variables):
            problems.error(
                f"'{signal.name}' mentions two variables in one place", signal.place, keys[0],
                'the name of the topic, `where` and an element have one key each: '
                + _one_key(signal))
        feed = (signal.topic, signal.where, signal.variables)
        other = first.setdefault(feed, signal)
        if keys != _keys(other):
            problems.error(
                f"'{other.name}' and '{signal.name}' look up their keys in two ways",
                signal.place, f'{_keys(other)[-1]} and {keys[-1]}', 'in one message each key is '
                'looked up in one way: declare another instance variable for one of them')


def _one_key(signal: Signal) -> str:
    """Return what to write for two variables in one place."""
    _, second = signal.variables
    topic = (signal.topic or '').replace(f'{{{second}}}', 'NAME')
    return f'write an input for each {second}, such as\n{signal.name}_NAME: {{topic: "{topic}"}}'


def _keys(signal: Signal) -> list[str]:
    """Return where an input mentions its variable: in its topic, in `where`, in its field."""
    found = [f'in the topic {signal.topic}'] if '{' in (signal.topic or '') else []
    if signal.where is not None and signal.where.variable:
        found.append(f'where {signal.where}')
    for place, step in enumerate(signal.path):
        if isinstance(step, LookUp) and step.variable:
            end = place - 1 if step.is_parallel else place
            found.append(f'{path_text(signal.path[:end])}[{step}]')
    return found


def _check_numbers(bundle: Bundle, signals: Iterable[Signal], problems: Problems) -> None:
    """Report listed keys that the whole numbers of messages cannot be."""
    found: dict[str, tuple[Signal, FieldType]] = {}
    for signal in signals:
        for variable, kind in _types_of_keys(signal):
            if kind.base != 'string':
                found.setdefault(variable, (signal, kind))
    for variable, key in ((item.name.value, key) for item in bundle.instance_variables
                          if item.name.value in found for key in item.keys):
        signal, kind = found[variable]
        least, most = ValueType.of_field(kind.base).limits
        number = _number(key.value)
        is_within = number is not None and least <= number <= most
        if not is_within or str(number) != key.value:
            problems.error(
                f'the key {shown(key.value)} is in no message', key.span,
                f"those of '{signal.name}' are whole numbers ({kind.base})",
                str(number) if is_within else f'a whole number from {least} to {most}')


def _number(text: str) -> int | None:
    for base in (0, 10):  # 0x10; 007
        with suppress(ValueError):
            return int(text, base)
    return None


def _types_of_keys(signal: Signal) -> Iterator[tuple[str, FieldType]]:
    """Yield the variables that fields are compared with, and the types of these fields."""
    inner = outer = signal.layout
    if inner is None or outer is None:
        return
    if signal.where and signal.where.variable and (kind := key_type(inner, signal.where.key)):
        yield signal.where.variable, kind
    for step in signal.path:
        if isinstance(step, str) and (found := inner.find_field(step)):
            outer = inner
            inner = nested_layout(outer, found.type) if found.type.is_message else outer
        elif isinstance(step, LookUp) and step.variable and (
                kind := key_type(outer if step.is_parallel else inner, step.key)):
            yield step.variable, kind


def _check(item: Property, inputs: dict[str, Signal], problems: Problems) -> None:
    keyed = {name: inputs[name].variables for name in item.inputs if inputs[name].variables}
    mentioned = variables_of(keyed, inputs)
    shown = ', '.join(f"'{name}' is of {' and '.join(names)}" for name, names in keyed.items())
    if mentioned and item.probability:
        problems.error(f'{item.id} is about a probability, and one for each '
                       f"'{min(mentioned)}'", item.place, shown, 'tests of instances are not '
                       'supported yet: write a requirement of the bundle, or a bundle for each')
    elif len(mentioned) > MOST_VARIABLES:
        problems.error(f'{item.id} reads inputs of {len(mentioned)} instance variables',
                       item.place, shown, 'a requirement is of one variable, or of two')


_OfPairs: TypeAlias = tuple[tuple[str, ...], str, Span | None]
"""Two variables, and what is of their pairs: its name and its place."""


def _of_pairs(bundle: Bundle, properties: Iterable[Property],
              inputs: dict[str, Signal]) -> Iterator[_OfPairs]:
    """Yield the requirements of pairs."""
    for item in properties:
        mentioned = variables_of(item.inputs, inputs)
        if len(mentioned) == MOST_VARIABLES:
            yield tuple(one.name.value for one in bundle.instance_variables
                        if one.name.value in mentioned), item.id, item.place


def _pairs(bundle: Bundle, of_pairs: Iterable[_OfPairs], inputs: dict[str, Signal],
           problems: Problems) -> set[tuple[str, ...]]:
    """Return the variables of which there are pairs; report pairs that would never occur."""
    variables = {item.name.value: item for item in bundle.instance_variables}
    found: dict[tuple[str, ...], tuple[str, Span | None]] = {}
    for names, name, place in of_pairs:
        found.setdefault(names, (name, place))
    for names, (name, place) in found.items():
        first, second = (variables[one] for one in names)
        if not (first.keys and second.keys) and not any(
                signal.variables == names for signal in inputs.values()):
            problems.error(
                f'{name} is of pairs that never occur', place,
                f"no input mentions both '{names[0]}' and '{names[1]}'",
                'a pair occurs in a message of such an input, or if both have listed keys')
        _check_sizes(first, second, name, place, problems)
    return {*found}


def _check_sizes(first: InstanceVariable, second: InstanceVariable, name: str,
                 place: Span | None, problems: Problems) -> None:
    """Report listed keys that are too long together."""
    longest = [max((key.value.encode() for key in one.keys), key=len, default=b'')
               for one in (first, second)]
    if len(pair_key(*longest)) > LONGEST_KEY:
        problems.error(
            f'{name} is of pairs of keys that are too long', place,
            f'together {len(longest[0]) + len(longest[1])} bytes', f'two keys have at most '
            f'{LONGEST_KEY - 1} bytes together')
