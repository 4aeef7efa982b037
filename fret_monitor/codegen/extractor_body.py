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

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from fret_monitor.codegen.c import string_literal
from fret_monitor.codegen.comments import comment
from fret_monitor.codegen.message_sizes import STRINGS
from fret_monitor.codegen.skippers import array_bound, Skippers, unsigned
from fret_monitor.logic.specification import Signal
from fret_monitor.messages.field_path import key_type, SCAN_ANGLES
from fret_monitor.messages.installed import nested_layout
from fret_monitor.messages.layout import ArrayKind, FieldType, MessageField, MessageLayout
from fret_monitor.model.manifest import ANGLES, SECONDS
from fret_monitor.model.paths import FieldPath, LookUp, name_as_written, Sector, Slice
from fret_monitor.model.policies import InputSource
from fret_monitor.model.values import ValueType


@dataclass
class Need:
    """
    The inputs that read a field or element, or something inside it.

    `whole` are the inputs that read the field itself or a part of its array, with their indices
    among the inputs of the topic. `items` are the needs of its elements by index, `found` those of
    elements that are looked up, `fields` those of its fields by name.

    `is_kept` means that code further on uses the value, `wanted` are the strings whose indices in
    this array it uses. Generated code leaves the value in the variable `local`, the indices in the
    variables of `wanted`, and the place of the first element of an array in `begin`.
    An element of `found` whose name is a variable stands for all elements, each with its key.
    """

    whole: list[tuple[int, Signal]] = field(default_factory=list)
    items: dict[int, 'Need'] = field(default_factory=dict)
    found: dict[LookUp, 'Need'] = field(default_factory=dict)
    fields: dict[str, 'Need'] = field(default_factory=dict)
    is_kept: bool = False
    wanted: dict[str, str] = field(default_factory=dict)
    local: str = ''
    begin: str = ''

    def at(self, path: FieldPath) -> 'Need':
        """Return the need of the field at the end of a path, and note what it needs beside it."""
        need = parent = self
        for step in path:
            match step:
                case str():
                    need, parent = need.fields.setdefault(step, Need()), need
                case int():
                    need = need.items.setdefault(step, Need())
                case LookUp():
                    if step.is_parallel and step.variable:
                        parent.at(step.key).is_kept = True
                    elif step.is_parallel:
                        parent.at(step.key).wanted.setdefault(step.name, '')
                    need = need.found.setdefault(step, Need())
                case Sector():
                    for name in SCAN_ANGLES:
                        parent.at((name,)).is_kept = True
                case Slice():
                    pass
        return need

    def places(self) -> list[int]:
        """Return the indices of all inputs that read it, or anything inside it."""
        found = [place for place, _ in self.whole]
        for inner in (*self.items.values(), *self.found.values(), *self.fields.values()):
            found += inner.places()
        return sorted(found)


class Key(NamedTuple):
    """A key of an instance variable in C: its bytes and their number."""

    bytes: str
    size: str


class ExtractorWriter:
    """Writes the body of one extractor, whose cursor is the variable `c`."""

    def __init__(self, skippers: Skippers, kind: int | None = None) -> None:
        """
        Start an empty body; `skippers` collects the functions that it calls.

        `kind` is that of the instances to which it hands over.
        """
        self._skippers = skippers
        self._kind = kind
        self._other: Key | None = None
        self._is_other_first = False
        self._locals = 0

    def lines(self, layout: MessageLayout, need: Need) -> Iterator[str]:
        """Yield the body, indented."""
        yield from _indented(self._received(need.whole))
        if need.fields:
            yield from _indented(self._message(layout, need, '', is_last=True))

    def make_pairs(self, other: Key, *, is_first: bool) -> None:
        """Hand over pairs from now on: of another key, which may be the first, and each."""
        self._other = other
        self._is_other_first = is_first

    def hand_over(self, base: str, local: str) -> Iterator[str]:
        """Yield C that hands over the fields, with a key of a type that was read before."""
        yield 'if (c.ok && sink != NULL) {'
        lines, key = self.key_of(base, local)
        yield from (f'  {line}' for line in lines)
        if self._other is not None:
            first, second = (self._other, key) if self._is_other_first else (key, self._other)
            yield '  uint8_t pair[FM_PAIR_ROOM];'
            yield '  const size_t pair_size = fm_pair_key('
            yield f'    pair, {first.bytes}, {first.size}, {second.bytes}, {second.size});'
            key = Key('pair', 'pair_size')
        yield f'  sink(context, {self._kind}u, {key.bytes}, {key.size}, fields);'
        yield '}'

    def key_of(self, base: str, local: str) -> tuple[list[str], Key]:
        """Return the lines that make a key of a type that was read before, and the key in C."""
        if base in STRINGS:
            return [], Key(f'{local}.bytes', f'{local}.length')
        digits = self._local('digits')
        member = 'i' if ValueType.of_field(base).is_signed else 'u'
        return ([f'const struct fm_cdr_digits {digits} = fm_cdr_digits_{member}({local});'],
                Key(f'{digits}.bytes + {digits}.first', f'20u - {digits}.first'))

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
            if not remaining:
                yield from self._deferred(layout, need, path)
            if is_last and not remaining:
                return
        assert not remaining, remaining
        yield from self._past(layout, waiting, path)

    def _deferred(self, layout: MessageLayout, need: Need, path: str) -> Iterator[str]:
        """Compute what needs several fields of a message, after all of them were read."""
        keyed: list[tuple[MessageField, Need, LookUp]] = []
        for item in layout.fields:
            inner = need.fields.get(item.name, Need())
            for place, signal in inner.whole:
                if signal.path and isinstance(sector := signal.path[-1], Sector):
                    angles = [need.fields[name].local for name in SCAN_ANGLES]
                    yield from self._sector(item.type.base, inner.local, angles, place, signal,
                                            sector, path + item.name)
            for part, found in inner.found.items():
                if part.is_parallel and part.variable:
                    keyed.append((item, inner, part))
                elif part.is_parallel:
                    index = need.fields[part.key[0]].wanted[part.name]
                    yield from self._parallel(layout, item, inner, found, index,
                                              f'{path}{item.name}[{part}]')

        if keyed:
            yield from self._each_index(layout, need, keyed, path)

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
            yield from self._number(kind.base, need, path)
        elif need.whole:
            yield from self._scalars(nested_layout(layout, kind), need, path)
        else:
            yield from self._message(nested_layout(layout, kind), need, path + '.', is_last)

    def _number(self, base: str, need: Need, path: str) -> Iterator[str]:
        kind = ValueType.of_field(base)
        read = f'fm_cdr_{kind.value}(&c)'
        yield from _explain(need.whole, path) if need.whole else comment(path)
        if len(need.whole) > 1 or need.is_kept:
            need.local = self._local('value')
            yield f'const {kind.c_name} {need.local} = {read};'
            read = need.local
        yield from (f'fields[{place}] = {_field_of(kind, read)};' for place, _ in need.whole)

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
            elif signal.reduction in ANGLES:
                numbers = ', '.join(f'(double){local[name]}' for name in 'xyzw')
                yield f'fields[{place}] = fm_field_{signal.reduction}({numbers});'
            else:
                yield from self._norm(place, [local[item.name] for item in layout.fields])
        for name, inner in need.fields.items():
            found = layout.find_field(name)
            assert found is not None, name
            kind = ValueType.of_field(found.type.base)
            inner.local = local[name]
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
        text = need.local = self._local('text')
        yield from _explain(need.whole, path) if need.whole else comment(path)
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
        need.local = array
        for place, signal in need.whole:
            part = signal.path[-1]
            if isinstance(part, Sector):
                continue  # see _deferred
            yield from _explain([(place, signal)], path)
            if isinstance(part, Slice):
                yield from self._slice(array, item.size, part, place, _reduced(item, signal))
            else:
                yield f'fields[{place}] = {_reduced(item, signal)(array)};'
        for index, inner in sorted(need.items.items()):
            read = _field_of(item, f'fm_cdr_{item.value}_at(&{array}, {index}u)')
            yield from _explain(inner.whole, f'{path}[{index}]')
            for place, _ in inner.whole:
                yield f'fields[{place}] = {array}.count > {index}u ?'
                yield f'  {read} : fm_field_outside({array}.count);'

    def _slice(self, array: str, size: int, part: Slice, place: int,
               reduced: Callable[[str], str]) -> Iterator[str]:
        """Reduce the slice of an array, which must lie in it."""
        local = self._local('part')
        stop = f'{array}.count' if part.stop is None else part.stop
        yield f'struct fm_cdr_array {local} = {{NULL, 0u, false}};'
        yield f'fields[{place}] = fm_cdr_slice(&{local}, &{array}, {size}u, {part.start or 0}, ' \
              f'{stop}) ?'
        yield f'  {reduced(local)} : fm_field_outside({array}.count);'

    def _sector(self, base: str, array: str, angles: Sequence[str], place: int, signal: Signal,
                sector: Sector, path: str) -> Iterator[str]:
        """Reduce the elements of a scan in a sector."""
        kind = ValueType.of_field(base)
        parts, count = self._local('parts'), self._local('count')
        function = 'fm_field_len' if signal.reduction == 'len' \
            else f'fm_field_{signal.reduction}_{kind.value}'
        yield from _explain([(place, signal)], path)
        yield f'struct fm_cdr_array {parts}[FM_CDR_PARTS];'
        yield f'const uint32_t {count} = fm_cdr_sector('
        yield f'  {parts}, &{array}, {kind.size}u, (double){angles[0]}, (double){angles[1]},'
        yield f'  {sector.first!r}, {sector.width!r});'
        yield f'fields[{place}] = {count} > 0u ?'
        yield f'  {function}({parts}, {count}) : fm_field_empty();'

    def _parallel(self, layout: MessageLayout, item: MessageField, need: Need, found: Need,
                  index: str, path: str) -> Iterator[str]:
        """Read the element of an array at the index of a name in the array beside it."""
        kind = item.type
        if kind.is_message or kind.base in STRINGS:
            end = self._local('end')
            yield f'const size_t {end} = c.at;'
            yield f'if ({index} < {need.local}) {{'
            yield f'  c.at = {need.begin};'
            yield from _indented(self._skippers.elements(layout, kind, index, '&c'))
            yield from _indented(self._element(layout, FieldType(kind.base), found, path, True))
            yield '} else {'
            yield from (f'  fields[{place}] = fm_field_absent({index}, {need.local});'
                        for place in found.places())
            yield '}'
            yield f'c.at = {end};'
            return
        number = ValueType.of_field(kind.base)
        read = _field_of(number, f'fm_cdr_{number.value}_at(&{need.local}, {index})')
        yield from _explain(found.whole, path)
        for place, _ in found.whole:
            yield f'fields[{place}] = {index} < {need.local}.count ?'
            yield f'  {read} : fm_field_absent({index}, {need.local}.count);'

    def _long_array(self, layout: MessageLayout, kind: FieldType, need: Need, path: str,
                    is_last: bool) -> Iterator[str]:
        """Read the needed elements of an array of strings or messages, and skip the others."""
        yield from comment(f'{path}: {kind}')
        count = unsigned(kind.size or 0)
        if kind.array is not ArrayKind.FIXED:
            count = self._local('count')
            yield f'const uint32_t {count} = fm_cdr_count(&c, {array_bound(kind)});'
        need.local = count
        for place, signal in need.whole:
            yield from _explain([(place, signal)], path)
            if isinstance(part := signal.path[-1], Slice):
                array = self._local('array')
                yield f'const struct fm_cdr_array {array} = {{NULL, {count}, false}};'
                yield from self._slice(array, 0, part, place, _length)
            else:
                yield f'fields[{place}] = fm_field_u({count});'
        searched = {part: inner for part, inner in need.found.items() if not part.is_parallel}
        keyed = next((part for part in searched if part.variable), None)
        if keyed is not None:
            yield from self._each(layout, kind, keyed, searched[keyed], path, count)
            return
        # The length is valid only if the message contains all elements.
        is_whole = not is_last or bool(need.whole) or len(searched) < len(need.found) \
            or need.is_kept
        has_search = bool(searched or need.wanted)
        if len(searched) < len(need.found) or has_search and need.items or need.is_kept:
            need.begin = self._local('begin')
            yield f'const size_t {need.begin} = c.at;'
        done = self._local('done')
        skips_rest = is_whole and not has_search
        if skips_rest and need.items:
            yield f'uint32_t {done} = 0u;'
        before = 0
        for index, inner in sorted(need.items.items()):
            stays = not skips_rest and index == max(need.items)
            body = list(self._item(layout, kind, inner, path, index, before, stays))
            if skips_rest:
                body.append(f'{done} = {index + 1}u;')
            yield f'if ({count} > {index}u) {{'
            yield from _indented(body)
            yield '} else {'
            yield from (f'  fields[{place}] = fm_field_outside({count});'
                        for place in inner.places())
            yield '}'
            before = index + 1
        if skips_rest:
            left = f'{count} - {done}' if need.items else count
            yield from self._skippers.elements(layout, kind, left, '&c')
        if has_search and need.items:
            yield f'c.at = {need.begin};'
        if need.wanted:
            yield from self._find_strings(kind, need, path, count, is_whole)
        elif searched:
            yield from self._search(layout, kind, searched, path, count, is_whole)

    def _find_strings(self, kind: FieldType, need: Need, path: str, count: str,
                      is_whole: bool) -> Iterator[str]:
        """Find the indices of names in an array of strings."""
        for name in need.wanted:
            need.wanted[name] = self._local('index')
            yield from comment(f'{path}: the index of {name_as_written(name)}')
            yield f'uint32_t {need.wanted[name]} = UINT32_MAX;'
        text = self._local('text')
        yield from self._loop(count, [*need.wanted.values()], 'UINT32_MAX', is_whole, [
            f'const struct fm_cdr_text {text} = fm_cdr_{kind.base}(&c);',
            *(line for name, index in need.wanted.items()
              for line in _compare(text, name, index, 'UINT32_MAX', 'i'))])

    def _search(self, layout: MessageLayout, kind: FieldType, searched: dict[LookUp, Need],
                path: str, count: str, is_whole: bool) -> Iterator[str]:
        """Find elements by the names in them, and read what is needed of them."""
        inner = nested_layout(layout, kind)
        keys, places = Need(), {}
        for part in searched:
            places[part] = self._local('found')
            yield from comment(f'{path}: where {part}')
            yield f'size_t {places[part]} = SIZE_MAX;'
        here = self._local('here')
        texts = {part: keys.at(part.key) for part in searched}
        body = [f'const size_t {here} = c.at;',
                *self._message(inner, keys, f'{path}[i].', is_last=False)]
        for part, place in places.items():
            body += _compare(texts[part].local, part.name, place, 'SIZE_MAX', here)
        yield from self._loop(count, [*places.values()], 'SIZE_MAX', is_whole, body)
        end = self._local('end')
        if is_whole:
            yield f'const size_t {end} = c.at;'
        for part, found in searched.items():
            yield f'if ({places[part]} != SIZE_MAX) {{'
            yield f'  c.at = {places[part]};'
            yield from _indented(self._element(layout, FieldType(kind.base), found,
                                               f'{path}[{part}]', True))
            yield '} else {'
            yield from (f'  fields[{place}] = fm_field_absent(UINT32_MAX, {count});'
                        for place in found.places())
            yield '}'
        if is_whole:
            yield f'c.at = {end};'

    def _each(self, layout: MessageLayout, kind: FieldType, part: LookUp, need: Need, path: str,
              count: str) -> Iterator[str]:
        """Read all elements, each with its key and what is needed of it, and hand them over."""
        key = need.at(part.key)
        key.is_kept = True
        key_kind = key_type(nested_layout(layout, kind), part.key)
        assert key_kind is not None, part
        yield from comment(f'{path}: each, with {part}')
        yield f'for (uint32_t k = 0u; k < {count} && c.ok; ++k) {{'
        yield from _indented(self._element(layout, FieldType(kind.base), need, f'{path}[k]',
                                           False))
        yield from _indented(self.hand_over(key_kind.base, key.local))
        yield '}'

    def _each_index(self, layout: MessageLayout, need: Need,
                    keyed: Sequence[tuple[MessageField, Need, LookUp]],
                    path: str) -> Iterator[str]:
        """Hand over elements of arrays, each with its key, which is in an array beside them."""
        part = keyed[0][2]
        found = layout.find_field(part.key[0])
        assert found is not None, part
        keys, base, end = need.fields[part.key[0]], found.type.base, self._local('end')
        yield from comment(f'{path}{part.key[0]}: each, with its elements of other arrays')
        yield f'const size_t {end} = c.at;'
        count = keys.local if base in STRINGS else f'{keys.local}.count'
        places = {id(inner): self._local('next') for item, inner, _ in keyed
                  if _is_long(item.type)}
        if base in STRINGS:
            key_place = self._local('next')
            yield f'size_t {key_place} = {keys.begin};'
        for _, inner, _ in keyed:
            if id(inner) in places:
                yield f'size_t {places[id(inner)]} = {inner.begin};'
        yield f'for (uint32_t k = 0u; k < {count} && c.ok; ++k) {{'
        for item, inner, look_up in keyed:
            yield from _indented(self._at_index(
                layout, item, inner, look_up, places.get(id(inner), ''), path))
        key = self._local('key')
        if base in STRINGS:
            yield f'  c.at = {key_place};'
            yield f'  const struct fm_cdr_text {key} = fm_cdr_{base}(&c);'
            yield f'  {key_place} = c.at;'
        else:
            kind = ValueType.of_field(base)
            yield f'  const {kind.c_name} {key} = fm_cdr_{kind.value}_at(&{keys.local}, k);'
        yield from _indented(self.hand_over(base, key))
        yield '}'
        yield f'c.at = {end};'

    def _at_index(self, layout: MessageLayout, item: MessageField, need: Need, part: LookUp,
                  place_of: str, path: str) -> Iterator[str]:
        """Read the element of an array at the index of the key; `place_of` is that of the next."""
        found, shown = need.found[part], f'{path}{item.name}[{part}]'
        if not place_of:
            kind = ValueType.of_field(item.type.base)
            read = _field_of(kind, f'fm_cdr_{kind.value}_at(&{need.local}, k)')
            yield from _explain(found.whole, shown)
            for place, _ in found.whole:
                yield f'fields[{place}] = k < {need.local}.count ?'
                yield f'  {read} : fm_field_absent(k, {need.local}.count);'
            return
        yield f'if (k < {need.local}) {{'
        yield f'  c.at = {place_of};'
        yield from _indented(self._element(layout, FieldType(item.type.base), found, shown, False))
        yield f'  {place_of} = c.at;'
        yield '} else {'
        yield from (f'  fields[{place}] = fm_field_absent(k, {need.local});'
                    for place in found.places())
        yield '}'

    def _loop(self, count: str, wanted: Sequence[str], nothing: str, is_whole: bool,
              body: Iterable[str]) -> Iterator[str]:
        """Yield a loop over elements; unless all must be in the message, until all are found."""
        is_open = ' || '.join(f'{name} == {nothing}' for name in wanted)
        goes_on = '' if is_whole else f' && ({is_open})' if len(wanted) > 1 else f' && {is_open}'
        yield f'for (uint32_t i = 0u; i < {count} && c.ok{goes_on}; ++i) {{'
        yield from _indented(body)
        yield '}'

    def _item(self, layout: MessageLayout, kind: FieldType, need: Need, path: str, index: int,
              before: int, is_last: bool) -> Iterator[str]:
        """Skip the elements from index `before` on, and read the one at `index`."""
        if index > before:
            yield from self._skippers.elements(layout, kind, index - before, '&c')
        element = FieldType(kind.base)
        yield from self._element(layout, element, need, f'{path}[{index}]', is_last)


def _is_long(kind: FieldType) -> bool:
    """Whether the elements of an array have no place that follows from their index."""
    return kind.is_message or kind.base in STRINGS


def _indented(lines: Iterable[str]) -> Iterator[str]:
    return (f'  {line}' if line else '' for line in lines)


def _compare(text: str, name: str, found: str, nothing: str, here: str) -> list[str]:
    """Return C that notes the first place at which a text is a name."""
    data = name.encode('utf-8', 'surrogatepass')
    return [f'if ({found} == {nothing} && fm_cdr_is(&{text}, {string_literal(data)}, '
            f'{len(data)}u)) {{', f'  {found} = {here};', '}']


def _length(array: str) -> str:
    return f'fm_field_u({array}.count)'


def _reduced(kind: ValueType, signal: Signal) -> Callable[[str], str]:
    """Return what makes C that reduces an array of numbers from the array's name."""
    if signal.reduction == 'len':
        return _length
    return lambda array: f'fm_field_{signal.reduction}_{kind.value}(&{array}, 1u)'


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
        part = signal.path[-1] if signal.path else ''
        shown = f'{path}[{part}]' if isinstance(part, Slice | Sector) else path
        what = f'{function}({shown})' if function else path
        yield from comment(f'{signal.name}: {what}')


def _field_of(kind: ValueType, value: str) -> str:
    """Return the C that makes a `struct fm_field` of a value."""
    member = 'f' if kind.is_float else 'i' if kind.is_signed or kind is ValueType.BOOL else 'u'
    return f'fm_field_{member}({value})'
