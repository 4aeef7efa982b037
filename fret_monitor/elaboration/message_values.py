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
The values of a message that a bundle writes, checked against the definition of the message.

Every mistake is reported at its place; `messages/serialize.py` makes bytes of the rest.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
import math
import re
from typing import TypeAlias

from fret_monitor.bundle.yaml_shape import kind_of
from fret_monitor.bundle.yaml_tree import Node, Unread, YamlList, YamlMapping, YamlScalar
from fret_monitor.messages.installed import listed, nested_layout
from fret_monitor.messages.layout import ArrayKind, FieldType, MessageField, MessageLayout
from fret_monitor.messages.serialize import KeyedNumber, KeyedText, serialize_keyed, Value
from fret_monitor.model.diagnostics import counted, did_you_mean, Problems, Span
from fret_monitor.model.floats import to_float32
from fret_monitor.model.names import is_integer, LONGEST_KEY, number_fault, PLACEHOLDER, shown
from fret_monitor.model.payload import PayloadPart
from fret_monitor.model.values import ValueType

_SPECIAL = {'nan': 'nan', '.nan': 'nan', 'inf': 'inf', '.inf': 'inf', '-inf': '-inf',
            '-.inf': '-inf'}
_TEXTS = ('string', 'wstring')
INTEGERS = ('byte', 'char', *(
    f'{sign}int{bits}' for sign in ('', 'u') for bits in (8, 16, 32, 64)))
_TRUTHS = {'true': True, 'false': False}
_MOST_DIGITS = 30


KeyRange: TypeAlias = tuple[int, int] | None
"""The least and the greatest key of a variable; None: keys that are no whole numbers."""


def message_bytes(layout: MessageLayout, content: YamlMapping | None, problems: Problems,
                  variables: Mapping[str, KeyRange] | None = None,
                  ) -> tuple[bytes, tuple[PayloadPart, ...]]:
    """
    Return a message serialized, and report all that does not fit its definition.

    With one of the instance `variables`, in braces, it has parts (`serialize_keyed`).
    """
    found = Problems()
    values = _MessageReader(found, variables or {}).message(layout, content) if content else {}
    problems.extend((*found.errors, *found.warnings))
    return (b'', ()) if found.errors else serialize_keyed(layout, values)


def is_given(content: YamlMapping | None, *path: str) -> bool:
    """Whether a message has a value at a path of fields."""
    node: Node | None = content
    for name in path:
        node = _entry(node, name) if isinstance(node, YamlMapping) else None
    return node is not None


def _entry(mapping: YamlMapping, name: str) -> Node | None:
    return next((node for key, node in mapping.entries if key.value == name), None)


@dataclass(frozen=True)
class _MessageReader:
    problems: Problems
    variables: Mapping[str, KeyRange]  # in the bundle's order

    def message(self, layout: MessageLayout, node: YamlMapping) -> dict[str, Value]:
        found: dict[str, Value] = {}
        for key, inner in node.entries:
            field = layout.find_field(key.value)
            if field is None:
                names = [item.name for item in layout.fields]
                self.problems.error(
                    f'{layout.name} has no field {shown(key.value)}', key.span, 'unknown field',
                    did_you_mean(key.value, names) or (listed(names) if names else
                                                       'it has no fields: write {}'))
                continue
            value = self._field(layout, field, inner)
            if value is not None:
                found[field.name] = value
        return found

    def _field(self, layout: MessageLayout, field: MessageField, node: Node) -> Value | None:
        kind = field.type
        if isinstance(node, Unread):
            return None
        if kind.array is ArrayKind.NONE:
            return self._element(layout, field, node)
        if not isinstance(node, YamlList):
            self._refuse(layout, field, node, 'a list')
            return None
        count, size = len(node.items), kind.size or 0
        if kind.array is ArrayKind.FIXED and count != size or \
                kind.array is ArrayKind.BOUNDED and count > size:
            exactly = '' if kind.array is ArrayKind.FIXED else 'at most '
            self.problems.error(
                f"the field '{field.name}' has {exactly}{counted(size, 'element')}", node.span,
                f'these are {count}', f'{field.name} is {kind} in {layout.name}')
        items = [self._element(layout, field, item) for item in node.items]
        return [item for item in items if item is not None]

    def _element(self, layout: MessageLayout, field: MessageField, node: Node) -> Value | None:
        kind = field.type
        if kind.is_message:
            nested = nested_layout(layout, kind)
            if isinstance(node, YamlScalar) and node.is_missing:
                return {}
            if isinstance(node, YamlMapping):
                return self.message(nested, node)
            self._refuse(layout, field, node, 'a message', _example(field, nested))
            return None
        if not isinstance(node, YamlScalar) or node.is_missing:
            self._refuse(layout, field, node, f'a value of type {kind.base}')
            return None
        return self._scalar(field, node)

    def _refuse(self, layout: MessageLayout, field: MessageField, node: Node, wanted: str,
                help_: str = '') -> None:
        if not isinstance(node, Unread):
            self.problems.error(
                f"the field '{field.name}' is {wanted}", node.span, f'this is {kind_of(node)}',
                help_ or f'{field.name} is {field.type} in {layout.name}')

    def _scalar(self, field: MessageField, node: YamlScalar) -> Value | None:
        base = field.type.base
        if any(name in self.variables for name in PLACEHOLDER.findall(node.value)):
            return self._keyed(field, node)
        if base in _TEXTS:
            return self._text(field, node)
        if base == 'bool':
            value = _TRUTHS.get(node.value.lower())
            if value is None:
                self._wrong(field, node.value, node.span, 'write true or false')
            return value
        if base.startswith('float'):
            return self._real(field, node)
        return self._whole(field, node)

    def _keyed(self, field: MessageField, node: YamlScalar) -> KeyedText | KeyedNumber | None:
        """Return a text with keys of an instance in it, or a key that is a number."""
        if field.type.base in INTEGERS:
            return self._keyed_number(field, node)
        if field.type.base != 'string':
            self.problems.error(
                f"the field '{field.name}' cannot be a key", node.span,
                f'it is of type {field.type.base}',
                'only a string can contain it, and a whole number keys that are whole numbers')
        elif field.type.text_limit is not None:
            self.problems.error(
                f"the field '{field.name}' has room for {field.type.text_limit} characters",
                node.span, f'a key has up to {LONGEST_KEY}', 'only a string without a limit can '
                'contain it')
        elif (text := self._text(field, node)) is not None:
            names = '|'.join(map(re.escape, self.variables))
            pieces, order = re.split(rf'\{{({names})\}}', text), [*self.variables]
            return KeyedText(tuple(pieces[::2]), tuple(map(order.index, pieces[1::2])))
        return None

    def _keyed_number(self, field: MessageField, node: YamlScalar) -> KeyedNumber | None:
        base, name = field.type.base, node.value[1:-1]
        low, high = ValueType.of_field(base).limits
        if name not in self.variables:
            self._wrong(field, node.value, node.span, 'a key alone: "{NAME}"')
        elif (found := self.variables[name]) is None:
            self.problems.error(
                f"the field '{field.name}' cannot be a key of '{name}'", node.span,
                f'it is of type {base}, and these keys need not be whole numbers',
                'a whole number takes those that are listed whole numbers, or come from fields of '
                'whole numbers alone')
        elif not low <= found[0] <= found[1] <= high:
            self.problems.error(
                f"the field '{field.name}' cannot be a key of '{name}'", node.span,
                f'it is of type {base}, from {low} to {high}; the keys are from {found[0]} to '
                f'{found[1]}', 'a field of a greater type, or a string')
        else:
            return KeyedNumber([*self.variables].index(name))
        return None

    def _text(self, field: MessageField, node: YamlScalar) -> str | None:
        limit, length = field.type.text_limit, len(node.value.encode())
        if limit is not None and length > limit:
            self.problems.error(f"the field '{field.name}' has at most {limit} characters",
                                node.span, f'these are {length}')
        elif '\0' in node.value:
            self.problems.error(f"the field '{field.name}' cannot contain a zero character",
                                node.span)
        else:
            return node.value
        return None

    def _real(self, field: MessageField, node: YamlScalar) -> float | None:
        special = _SPECIAL.get(node.value.lower())
        if special is not None:
            self.problems.warning(f'{shown(node.value)} is no finite number', node.span,
                                  'what receives it may fail', f'{field.name}: 0.0')
            return float(special)
        if (fault := number_fault(node.value)) is not None:
            self._wrong(field, node.value, node.span, fault.help or f'{field.name}: 0.0')
            return None
        value, most = float(node.value), '1.79e308'
        if field.type.base == 'float32':
            value, most = to_float32(value), '3.4e38'
        if math.isinf(value):
            self._wrong(field, node.value, node.span, f'a number between -{most} and {most}')
            return None
        return value

    def _whole(self, field: MessageField, node: YamlScalar) -> int | None:
        low, high = ValueType.of_field(field.type.base).limits
        fault = number_fault(node.value)
        if not is_integer(node.value) or len(node.value) > _MOST_DIGITS or \
                not low <= int(node.value) <= high:
            self._wrong(field, node.value, node.span,
                        fault.help if fault and fault.help else
                        f'a whole number from {low} to {high}')
        else:
            return int(node.value)
        return None

    def _wrong(self, field: MessageField, text: str, place: Span, help_: str) -> None:
        self.problems.error(
            f'{shown(text)} cannot be of type {field.type.base}', place,
            f"the type of the field '{field.name}'", help_)


def _example(field: MessageField, layout: MessageLayout) -> str:
    names: Iterable[MessageField] = layout.fields[:3]
    inside = ', '.join(f'{item.name}: {_zero(item.type)}' for item in names)
    return f'{field.name}: {{{inside}}}'


def _zero(kind: FieldType) -> str:
    if kind.array is not ArrayKind.NONE:
        return '[]'
    if kind.is_message:
        return '{}'
    if kind.base in _TEXTS:
        return "''"
    return 'false' if kind.base == 'bool' else '0.0' if kind.base.startswith('float') else '0'
