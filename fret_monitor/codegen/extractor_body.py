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
Generate the body of an extractor, which reads the inputs of one topic from a message.

It reads the fields in the order of the definition, skips those that are not needed, and stops
after the last one that is needed.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from fret_monitor.codegen.c import string_literal
from fret_monitor.codegen.comments import comment
from fret_monitor.codegen.message_sizes import STRINGS
from fret_monitor.codegen.skippers import array_bound, Skippers, unsigned
from fret_monitor.logic.specification import Signal
from fret_monitor.messages.installed import nested_layout
from fret_monitor.messages.layout import ArrayKind, FieldType, MessageField, MessageLayout
from fret_monitor.model.manifest import SECONDS
from fret_monitor.model.policies import InputSource
from fret_monitor.model.values import ValueType


@dataclass
class Need:
    """
    The inputs that read a field or element, or something inside it.

    `whole` are the inputs that read the field itself, with their indices among the inputs of the
    topic. `items` are the needs of its elements by index, `fields` those of its fields by name.
    """

    whole: list[tuple[int, Signal]] = field(default_factory=list)
    items: dict[int, 'Need'] = field(default_factory=dict)
    fields: dict[str, 'Need'] = field(default_factory=dict)

    def at(self, path: Iterable[str | int]) -> 'Need':
        """Return the need of the field at the end of a path."""
        need = self
        for step in path:
            need = need.items.setdefault(step, Need()) if isinstance(step, int) \
                else need.fields.setdefault(step, Need())
        return need

    def places(self) -> list[int]:
        """Return the indices of all inputs that read it, or anything inside it."""
        found = [place for place, _ in self.whole]
        for inner in (*self.items.values(), *self.fields.values()):
            found += inner.places()
        return sorted(found)


class ExtractorWriter:
    """Writes the body of one extractor, whose cursor is the variable `c`."""

    def __init__(self, skippers: Skippers) -> None:
        """Start an empty body; `skippers` collects the functions that it calls."""
        self._skippers = skippers
        self._locals = 0

    def lines(self, layout: MessageLayout, need: Need) -> Iterator[str]:
        """Yield the body, indented."""
        yield from _indented(self._received(need.whole))
        if need.fields:
            yield from _indented(self._message(layout, need, '', is_last=True))

    def _received(self, whole: Sequence[tuple[int, Signal]]) -> Iterator[str]:
        """Set the inputs that are fed by the fact that a message came."""
        for place, signal in whole:
            yield from comment(f'{signal.name}: received()')
            yield f'fields[{place}] = fm_field_i(1);'

    def _message(self, layout: MessageLayout, need: Need, path: str,
                 is_last: bool) -> Iterator[str]:
        """Yield C that reads a message; with `is_last`, only up to the last field needed."""
        waiting: list[MessageField] = []
        remaining = set(need.fields)
        for item in layout.fields:
            if item.name not in need.fields:
                waiting.append(item)
                continue
            yield from self._past(layout, waiting, path)
            waiting = []
            remaining.discard(item.name)
            yield from self._field(layout, item.type, need.fields[item.name], path + item.name,
                                   is_last and not remaining)
            if is_last and not remaining:
                return
        assert not remaining, remaining
        yield from self._past(layout, waiting, path)

    def _past(self, layout: MessageLayout, fields: Sequence[MessageField],
              path: str) -> Iterator[str]:
        if fields:
            names = [path + item.name for item in fields]
            shown = ', '.join(names) if len(names) < 4 else f'{names[0]} to {names[-1]}'
            yield from comment(f'skip {shown}')
            yield from self._skippers.fields(layout, fields, '&c')

    def _local(self, word: str) -> str:
        self._locals += 1
        return f'{word}_{self._locals}'

    def _field(self, layout: MessageLayout, kind: FieldType, need: Need, path: str,
               is_last: bool) -> Iterator[str]:
        if kind.array is ArrayKind.NONE:
            yield from self._element(layout, kind, need, path, is_last)
        elif kind.is_message or kind.base in STRINGS:
            yield from self._long_array(layout, kind, need, path, is_last)
        else:
            yield from self._numbers(kind, need, path)

    # -- single values --

    def _element(self, layout: MessageLayout, kind: FieldType, need: Need, path: str,
                 is_last: bool) -> Iterator[str]:
        if kind.base in STRINGS:
            yield from self._text(kind.base, need, path)
        elif not kind.is_message:
            yield from self._number(kind.base, need.whole, path)
        elif need.whole:
            yield from self._scalars(nested_layout(layout, kind), need, path)
        else:
            yield from self._message(nested_layout(layout, kind), need, path + '.', is_last)

    def _number(self, base: str, whole: Sequence[tuple[int, Signal]],
                path: str) -> Iterator[str]:
        kind = ValueType.of_field(base)
        read = f'fm_cdr_{kind.value}(&c)'
        yield from _explain(whole, path)
        if len(whole) > 1:
            local = self._local('value')
            yield f'const {kind.c_name} {local} = {read};'
            read = local
        yield from (f'fields[{place}] = {_field_of(kind, read)};' for place, _ in whole)

    def _scalars(self, layout: MessageLayout, need: Need, path: str) -> Iterator[str]:
        """Read all fields of a message of numbers, and compute the inputs from them."""
        local = {item.name: self._local(item.name.lower()) for item in layout.fields}
        yield from comment(path)
        for item in layout.fields:
            kind = ValueType.of_field(item.type.base)
            yield f'const {kind.c_name} {local[item.name]} = fm_cdr_{kind.value}(&c);'
        for place, signal in need.whole:
            yield from _explain([(place, signal)], path)
            if signal.source is InputSource.AGE:
                yield f'fields[{place}] = fm_field_i(' \
                      f'fm_cdr_nanoseconds({local["sec"]}, {local["nanosec"]}));'
            elif signal.reduction == SECONDS:
                yield f'fields[{place}] = fm_field_f(' \
                      f'fm_cdr_seconds({local["sec"]}, {local["nanosec"]}));'
            else:
                yield from self._norm(place, [local[item.name] for item in layout.fields])
        for name, inner in need.fields.items():
            found = layout.find_field(name)
            assert found is not None, name
            kind = ValueType.of_field(found.type.base)
            yield from _explain(inner.whole, f'{path}.{name}')
            yield from (f'fields[{place}] = {_field_of(kind, local[name])};'
                        for place, _ in inner.whole)

    def _norm(self, place: int, numbers: Sequence[str]) -> Iterator[str]:
        total = self._local('squares')
        first, *others = (f'(double){name} * (double){name}' for name in numbers)
        yield f'double {total} = {first};'
        yield from (f'{total} += {square};' for square in others)
        yield f'fields[{place}] = fm_field_f(sqrt({total}));'

    def _text(self, base: str, need: Need, path: str) -> Iterator[str]:
        text = self._local('text')
        yield from _explain(need.whole, path)
        yield f'const struct fm_cdr_text {text} = fm_cdr_{base}(&c);'
        for place, signal in need.whole:
            if signal.reduction:
                yield f'fields[{place}] = fm_field_u({text}.length);'
            else:
                yield from self._named(base, place, signal, text)

    def _named(self, base: str, place: int, signal: Signal, text: str) -> Iterator[str]:
        names = self._local('names')
        written = [str(value) for _, value in signal.values]
        kind, function = ('wide_name', 'fm_field_wide_name') if base == 'wstring' else \
            ('name', 'fm_field_name')
        entries = []
        for value in written:
            data = value.encode('utf-16-le' if base == 'wstring' else 'utf-8', 'surrogatepass')
            shown, length = string_literal(data), len(data)
            if base == 'wstring':
                shown, length = self._local('units') if data else 'NULL', length // 2
                yield from _units(shown, data)
            entries.append(f'{{{shown}, {length}u}}')
        yield f'static const struct fm_cdr_{kind} {names}[] = {{'
        yield from (f'  {entry},' for entry in entries)
        yield '};'
        yield f'fields[{place}] = {function}(&{text}, {names}, {len(written)}u);'

    # -- arrays --

    def _numbers(self, kind: FieldType, need: Need, path: str) -> Iterator[str]:
        """Read an array of numbers."""
        array = self._local('array')
        item = ValueType.of_field(kind.base)
        count = unsigned(kind.size or 0) if kind.array is ArrayKind.FIXED \
            else f'fm_cdr_count(&c, {array_bound(kind)})'
        yield from comment(f'{path}: {kind}')
        yield f'const struct fm_cdr_array {array} =' + \
              f' fm_cdr_array(&c, {item.size}u, {count});'
        for place, signal in need.whole:
            yield from _explain([(place, signal)], path)
            yield f'fields[{place}] = fm_field_u({array}.count);' if signal.reduction == 'len' \
                else f'fields[{place}] = fm_field_{signal.reduction}_{item.value}(&{array});'
        for index, inner in sorted(need.items.items()):
            read = _field_of(item, f'fm_cdr_{item.value}_at(&{array}, {index}u)')
            yield from _explain(inner.whole, f'{path}[{index}]')
            for place, _ in inner.whole:
                yield f'fields[{place}] = {array}.count > {index}u ?'
                yield f'  {read} : fm_field_outside({array}.count);'

    def _long_array(self, layout: MessageLayout, kind: FieldType, need: Need, path: str,
                    is_last: bool) -> Iterator[str]:
        """Read the needed elements of an array of strings or messages, and skip the others."""
        yield from comment(f'{path}: {kind}')
        count = unsigned(kind.size or 0)
        if kind.array is not ArrayKind.FIXED:
            count = self._local('count')
            yield f'const uint32_t {count} = fm_cdr_count(&c, {array_bound(kind)});'
        for place, signal in need.whole:
            yield from _explain([(place, signal)], path)
            yield f'fields[{place}] = fm_field_u({count});'
        # The length is valid only if the message contains all elements.
        is_whole = not is_last or bool(need.whole)
        done = self._local('done')
        if is_whole and need.items:
            yield f'uint32_t {done} = 0u;'
        before = 0
        for index, inner in sorted(need.items.items()):
            stays = not is_whole and index == max(need.items)
            body = list(self._item(layout, kind, inner, path, index, before, stays))
            if is_whole:
                body.append(f'{done} = {index + 1}u;')
            yield f'if ({count} > {index}u) {{'
            yield from _indented(body)
            yield '} else {'
            yield from (f'  fields[{place}] = fm_field_outside({count});'
                        for place in inner.places())
            yield '}'
            before = index + 1
        if is_whole:
            left = f'{count} - {done}' if need.items else count
            yield from self._skippers.elements(layout, kind, left, '&c')

    def _item(self, layout: MessageLayout, kind: FieldType, need: Need, path: str, index: int,
              before: int, is_last: bool) -> Iterator[str]:
        """Skip the elements from index `before` on, and read the one at `index`."""
        if index > before:
            yield from self._skippers.elements(layout, kind, index - before, '&c')
        element = FieldType(kind.base)
        yield from self._element(layout, element, need, f'{path}[{index}]', is_last)


def _indented(lines: Iterable[str]) -> Iterator[str]:
    return (f'  {line}' if line else '' for line in lines)


def _units(name: str, data: bytes) -> Iterator[str]:
    """Declare an array with a string in UTF-16; none if it is empty, as C has no empty array."""
    units = [f'{low | high << 8}u,' for low, high in zip(data[::2], data[1::2])]
    if units:
        yield f'static const uint16_t {name}[] = {{'
        for start in range(0, len(units), 12):
            yield '  ' + ' '.join(units[start:start + 12])
        yield '};'


def _explain(whole: Iterable[tuple[int, Signal]], path: str) -> Iterator[str]:
    """Yield a comment with the inputs that are read next, and their fields."""
    for _, signal in whole:
        function = InputSource.AGE.value if signal.source is InputSource.AGE else signal.reduction
        what = f'{function}({path})' if function else path
        yield from comment(f'{signal.name}: {what}')


def _field_of(kind: ValueType, value: str) -> str:
    """Return the C that makes a `struct fm_field` of a value."""
    member = 'f' if kind.is_float else 'i' if kind.is_signed or kind is ValueType.BOOL else 'u'
    return f'fm_field_{member}({value})'
