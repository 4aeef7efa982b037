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
The C that reads the mapped fields out of a serialized message, a function a topic.

A reader goes through the message in the order of its definition: what is not needed is skipped,
as much at once as has a size of its own; it stops behind the last field that is needed. It stands
on `csrc/fret_cdr.h`, which tells how messages are serialized. Same bundle, same definitions, same
bytes.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field

from fret_monitor.codegen.c import string_literal
from fret_monitor.codegen.comments import comment, safe
from fret_monitor.codegen.names import Names
from fret_monitor.logic.specification import Signal
from fret_monitor.messages.definitions import ArrayKind, FieldType, MessageField, MessageLayout
from fret_monitor.model.manifest import SECONDS
from fret_monitor.model.values import ValueType

_STRINGS = ('string', 'wstring')
_LARGEST = 2 ** 62  # of a run: there is no such message
_NO_BOUND = 'UINT32_MAX'


def generate_readers(names: Names, title: str, signals: Sequence[Signal]) -> Iterator[str]:
    """
    Yield the lines of the C file.

    There are none if no input comes from a topic, or the layouts of messages are not known, as
    where signals are not those of a bundle.
    """
    topics = topics_of(signals)
    if topics and all(signals[i].layout for fed in topics.values() for i in fed):
        yield from _FileWriter(names, title, signals).lines(topics)


def topics_of(signals: Sequence[Signal]) -> dict[str, list[int]]:
    """Return the topics that feed signals, with the indices of those they feed, in order."""
    topics: dict[str, list[int]] = {}
    for index, signal in enumerate(signals):
        if signal.topic is not None and signal.message_type is not None:
            topics.setdefault(signal.topic, []).append(index)
    return topics


# -- what is to be read ---------------------------------------------------------------------------


@dataclass
class _Need:
    """
    What is needed of a field, or of one element of it.

    `whole` are the inputs (by their place among the topic's) that are made of all of it;
    `items` what is needed of its elements, `fields` of its own fields.
    """

    whole: list[tuple[int, Signal]] = field(default_factory=list)
    items: dict[int, '_Need'] = field(default_factory=dict)
    fields: dict[str, '_Need'] = field(default_factory=dict)

    def at(self, path: Iterable[str | int]) -> '_Need':
        """Return what is needed of what a path leads to."""
        need = self
        for step in path:
            need = need.items.setdefault(step, _Need()) if isinstance(step, int) \
                else need.fields.setdefault(step, _Need())
        return need

    def places(self) -> list[int]:
        """Return the places of all inputs that are made of it, or of anything in it."""
        found = [place for place, _ in self.whole]
        for inner in (*self.items.values(), *self.fields.values()):
            found += inner.places()
        return sorted(found)


# -- sizes ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Run:
    """Bytes that are skipped at once: so many, from the next multiple of an alignment on."""

    alignment: int
    size: int


def _round_up(number: int, alignment: int) -> int:
    return (number + alignment - 1) // alignment * alignment


def _joined(runs: Iterable[_Run]) -> tuple[_Run, ...]:
    """Make of runs one after the other as few as possible."""
    found: list[_Run] = []
    for run in runs:
        if found and run.alignment <= found[-1].alignment:
            last = found.pop()
            run = _Run(last.alignment, _round_up(last.size, run.alignment) + run.size)
        found.append(run)
    return tuple(found)


def _stride(runs: Sequence[_Run]) -> int:
    """
    Return what one more element takes behind another: all elements but the first take the same.

    The alignments of joined runs grow, so an element ends where the last one puts it, however the
    element began.
    """
    begin = runs[-1].size % runs[-1].alignment
    end = begin
    for run in runs:
        end = _round_up(end, run.alignment) + run.size
    return end - begin


def _repeated(runs: Sequence[_Run], count: int) -> tuple[_Run, ...]:
    if not count:
        return ()
    return _joined([*runs, _Run(1, (count - 1) * _stride(runs))])


class _Sizes:
    """Which messages have a size of their own, and what it is."""

    def __init__(self) -> None:
        self._known: dict[str, tuple[_Run, ...] | None] = {}

    def of_message(self, layout: MessageLayout) -> tuple[_Run, ...] | None:
        """Return the runs that a message is, None if that depends on what is in it."""
        if layout.name not in self._known:
            self._known[layout.name] = self._measure(layout)
        return self._known[layout.name]

    def of_field(self, layout: MessageLayout, kind: FieldType) -> tuple[_Run, ...] | None:
        """Return the same for a field of a message."""
        element = self.of_element(layout, kind)
        match kind.array:
            case ArrayKind.NONE:
                return element
            case ArrayKind.FIXED:
                return None if element is None else _repeated(element, kind.size or 0)
            case ArrayKind.BOUNDED | ArrayKind.UNBOUNDED:
                return None

    def of_element(self, layout: MessageLayout, kind: FieldType) -> tuple[_Run, ...] | None:
        """Return the same for one element of a field."""
        if kind.base in _STRINGS:
            return None
        if kind.is_message:
            return self.of_message(layout.nested(kind))
        size = ValueType.of_field(kind.base).size
        return (_Run(size, size),)

    def _measure(self, layout: MessageLayout) -> tuple[_Run, ...] | None:
        if not layout.fields:
            return (_Run(1, 1),)  # a message without fields is sent as one byte
        found: list[_Run] = []
        for item in layout.fields:
            runs = self.of_field(layout, item.type)
            if runs is None:
                return None
            found.extend(runs)
        return _joined(found)


def _unsigned(number: int) -> str:
    small = min(number, _LARGEST)
    return f'{small}u' if small < 2 ** 32 else f'UINT64_C({small})'


# -- the file -------------------------------------------------------------------------------------


class _FileWriter:
    """Writes the file: what goes past messages, a reader a topic, and the table of them."""

    def __init__(self, names: Names, title: str, signals: Sequence[Signal]) -> None:
        self._names = names
        self._title = title
        self._signals = signals
        self._sizes = _Sizes()
        self._skippers = _Skippers(self._sizes)

    def lines(self, topics: dict[str, list[int]]) -> Iterator[str]:
        readers = [line for number, (topic, fed) in enumerate(topics.items())
                   for line in self._reader(number, topic, [self._signals[i] for i in fed])]
        yield f'// {self._names.fields_source}: the messages that feed {safe(self._title)}.'
        yield '// Generated by fret_monitor; changes will be lost.'
        yield from ('', '#include "fret_cdr.h"', '')
        yield '#if FM_ABI != 1'
        yield '#error "this file was generated for another version of fret_monitor.h"'
        yield from ('#endif', '')
        yield from self._skippers.lines()
        yield from readers
        yield from self._table(topics)

    def _reader(self, number: int, topic: str, signals: Sequence[Signal]) -> Iterator[str]:
        layout = signals[0].layout
        assert layout is not None, topic
        need = _Need()
        for place, signal in enumerate(signals):
            need.at(signal.path).whole.append((place, signal))
        yield from comment(f'{topic}: {layout.name}')
        yield f'static bool read_{number}(const uint8_t * message, size_t size, ' \
              'struct fm_field * fields)'
        yield '{'
        yield '  struct fm_cdr c;'
        yield '  if (!fm_cdr_open(&c, message, size)) {'
        yield '    return false;'
        yield '  }'
        yield from _ReaderWriter(self._sizes, self._skippers).lines(layout, need)
        yield '  return c.ok;'
        yield from ('}', '')

    def _table(self, topics: dict[str, list[int]]) -> Iterator[str]:
        symbol = self._names.readers
        yield '/// The readers of the topics, for those who take messages. Constant.'
        yield f'FM_EXPORT const struct fm_readers * {symbol}(void);'
        yield ''
        yield f'const struct fm_readers * {symbol}(void)'
        yield '{'
        yield '  static const struct fm_reader topics[] = {'
        for number, fed in enumerate(topics.values()):
            yield f'    {{read_{number}, {len(fed)}u}},'
        yield '  };'
        yield f'  static const struct fm_readers readers = {{FM_ABI, {len(topics)}u, topics}};'
        yield '  return &readers;'
        yield '}'


# -- going past -----------------------------------------------------------------------------------


class _Skippers:
    """The functions that go past messages whose size depends on what is in them."""

    def __init__(self, sizes: _Sizes) -> None:
        self._sizes = sizes
        self._made: dict[str, list[str]] = {}

    def lines(self) -> Iterator[str]:
        """Yield the functions, each behind those it calls."""
        for lines in self._made.values():
            yield from lines

    def elements(self, layout: MessageLayout, kind: FieldType, count: str | int,
                 cursor: str) -> Iterator[str]:
        """Yield what goes past so many elements of a field: a number, or an expression in C."""
        runs = self._sizes.of_element(layout, kind)
        if runs is None:
            shown = _unsigned(count) if isinstance(count, int) else count
            yield f'{self._function(layout, kind)}({cursor}, {shown});'
        elif isinstance(count, int):
            yield from self.runs(_repeated(runs, count), cursor)
        elif len(runs) == 1 and runs[0].size % runs[0].alignment == 0:
            yield f'fm_cdr_skip_many({cursor}, {runs[0].alignment}u, ' \
                  f'{_unsigned(runs[0].size)}, {count});'
        else:
            yield f'if ({count} > 0u) {{'
            yield from (f'  {line}' for line in self.runs(runs, cursor))
            yield f'  fm_cdr_skip_many({cursor}, 1u, {_unsigned(_stride(runs))}, {count} - 1u);'
            yield '}'

    def runs(self, runs: Iterable[_Run], cursor: str) -> Iterator[str]:
        """Yield what goes past runs."""
        for run in runs:
            yield f'fm_cdr_skip({cursor}, {run.alignment}u, {_unsigned(run.size)});'

    def field(self, layout: MessageLayout, kind: FieldType, cursor: str) -> Iterator[str]:
        """Yield what goes past a field whose size depends on what is in it."""
        match kind.array:
            case ArrayKind.NONE:
                yield from self.elements(layout, kind, 1, cursor)
            case ArrayKind.FIXED:
                yield from self.elements(layout, kind, kind.size or 0, cursor)
            case ArrayKind.BOUNDED | ArrayKind.UNBOUNDED:
                lines = list(self.elements(layout, kind, 'length', cursor))
                length = f'fm_cdr_count({cursor}, {_bound(kind)})'
                if len(lines) == 1:
                    yield lines[0].replace(', length)', f', {length})')
                else:
                    yield '{'
                    yield f'  const uint32_t length = {length};'
                    yield from (f'  {line}' for line in lines)
                    yield '}'

    def _function(self, layout: MessageLayout, kind: FieldType) -> str:
        if kind.base in _STRINGS:
            return f'fm_cdr_skip_{kind.base}s'
        name = 'skip_' + kind.base.replace('/', '_')
        if name not in self._made:
            self._made[name] = list(self._definition(name, layout.nested(kind)))
        return name

    def _definition(self, name: str, layout: MessageLayout) -> Iterator[str]:
        # What it calls is made, and so printed, before it.
        body = list(self.fields(layout, layout.fields, 'c'))
        yield f'static void {name}(struct fm_cdr * c, uint32_t count)'
        yield '{'
        yield '  for (uint32_t i = 0u; i < count && c->ok; ++i) {'
        yield from (f'    {line}' for line in body)
        yield from ('  }', '}', '')

    def fields(self, layout: MessageLayout, fields: Iterable[MessageField],
               cursor: str) -> Iterator[str]:
        """Yield what goes past some fields of a message, one after the other."""
        waiting: list[_Run] = []
        for item in fields:
            runs = self._sizes.of_field(layout, item.type)
            if runs is not None:
                waiting.extend(runs)
                continue
            yield from self.runs(_joined(waiting), cursor)
            waiting = []
            yield from self.field(layout, item.type, cursor)
        yield from self.runs(_joined(waiting), cursor)


def _bound(kind: FieldType) -> str:
    return _NO_BOUND if kind.size is None else _unsigned(kind.size)


# -- one reader -----------------------------------------------------------------------------------


class _ReaderWriter:
    """Writes the body of one reader; `c` is its cursor."""

    def __init__(self, sizes: _Sizes, skippers: _Skippers) -> None:
        self._sizes = sizes
        self._skippers = skippers
        self._locals = 0

    def lines(self, layout: MessageLayout, need: _Need) -> Iterator[str]:
        """Yield the body, indented."""
        yield from _indented(self._message(layout, need, '', is_last=True))

    def _message(self, layout: MessageLayout, need: _Need, path: str,
                 is_last: bool) -> Iterator[str]:
        """Go through a message; past its end only if something behind it is needed."""
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
            yield from comment(f'past {shown}')
            yield from self._skippers.fields(layout, fields, '&c')

    def _local(self, word: str) -> str:
        self._locals += 1
        return f'{word}_{self._locals}'

    def _field(self, layout: MessageLayout, kind: FieldType, need: _Need, path: str,
               is_last: bool) -> Iterator[str]:
        if kind.array is ArrayKind.NONE:
            yield from self._element(layout, kind, need, path, is_last)
        elif kind.is_message or kind.base in _STRINGS:
            yield from self._long_array(layout, kind, need, path, is_last)
        else:
            yield from self._numbers(kind, need, path)

    # -- single values --

    def _element(self, layout: MessageLayout, kind: FieldType, need: _Need, path: str,
                 is_last: bool) -> Iterator[str]:
        if kind.base in _STRINGS:
            yield from self._text(kind.base, need, path)
        elif not kind.is_message:
            yield from self._number(kind.base, need.whole, path)
        elif need.whole:
            yield from self._scalars(layout.nested(kind), need, path)
        else:
            yield from self._message(layout.nested(kind), need, path + '.', is_last)

    def _number(self, base: str, whole: Sequence[tuple[int, Signal]],
                path: str) -> Iterator[str]:
        kind = ValueType.of_field(base)
        read = f'fm_cdr_{kind.value}(&c)'
        yield from _told(whole, path)
        if len(whole) > 1:
            local = self._local('value')
            yield f'const {kind.c_name} {local} = {read};'
            read = local
        yield from (f'fields[{place}] = {_made_of(kind, read)};' for place, _ in whole)

    def _scalars(self, layout: MessageLayout, need: _Need, path: str) -> Iterator[str]:
        """Read all fields of a message that holds numbers alone, and what is made of them."""
        local = {item.name: self._local(item.name.lower()) for item in layout.fields}
        yield from comment(path)
        for item in layout.fields:
            kind = ValueType.of_field(item.type.base)
            yield f'const {kind.c_name} {local[item.name]} = fm_cdr_{kind.value}(&c);'
        for place, signal in need.whole:
            yield from _told([(place, signal)], path)
            if signal.reduction == SECONDS:
                yield f'fields[{place}] = fm_field_f(' \
                      f'fm_cdr_seconds({local["sec"]}, {local["nanosec"]}));'
            else:
                yield from self._norm(place, [local[item.name] for item in layout.fields])
        for name, inner in need.fields.items():
            found = layout.find_field(name)
            assert found is not None, name
            kind = ValueType.of_field(found.type.base)
            yield from _told(inner.whole, f'{path}.{name}')
            yield from (f'fields[{place}] = {_made_of(kind, local[name])};'
                        for place, _ in inner.whole)

    def _norm(self, place: int, numbers: Sequence[str]) -> Iterator[str]:
        total = self._local('squares')
        first, *others = (f'(double){name} * (double){name}' for name in numbers)
        yield f'double {total} = {first};'
        yield from (f'{total} += {square};' for square in others)
        yield f'fields[{place}] = fm_field_f(sqrt({total}));'

    def _text(self, base: str, need: _Need, path: str) -> Iterator[str]:
        text = self._local('text')
        yield from _told(need.whole, path)
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

    def _numbers(self, kind: FieldType, need: _Need, path: str) -> Iterator[str]:
        """Take an array of numbers at once."""
        array = self._local('array')
        item = ValueType.of_field(kind.base)
        count = _unsigned(kind.size or 0) if kind.array is ArrayKind.FIXED \
            else f'fm_cdr_count(&c, {_bound(kind)})'
        yield from comment(f'{path}: {kind}')
        yield f'const struct fm_cdr_array {array} =' + \
              f' fm_cdr_array(&c, {item.size}u, {count});'
        for place, signal in need.whole:
            yield from _told([(place, signal)], path)
            yield f'fields[{place}] = fm_field_u({array}.count);' if signal.reduction == 'len' \
                else f'fields[{place}] = fm_field_{signal.reduction}_{item.value}(&{array});'
        for index, inner in sorted(need.items.items()):
            read = _made_of(item, f'fm_cdr_{item.value}_at(&{array}, {index}u)')
            yield from _told(inner.whole, f'{path}[{index}]')
            for place, _ in inner.whole:
                yield f'fields[{place}] = {array}.count > {index}u ?'
                yield f'  {read} : fm_field_outside({array}.count);'

    def _long_array(self, layout: MessageLayout, kind: FieldType, need: _Need, path: str,
                    is_last: bool) -> Iterator[str]:
        """Go through an array of strings or of messages, one needed element after the other."""
        yield from comment(f'{path}: {kind}')
        count = _unsigned(kind.size or 0)
        if kind.array is not ArrayKind.FIXED:
            count = self._local('count')
            yield f'const uint32_t {count} = fm_cdr_count(&c, {_bound(kind)});'
        for place, signal in need.whole:
            yield from _told([(place, signal)], path)
            yield f'fields[{place}] = fm_field_u({count});'
        is_whole = not is_last or bool(need.whole)  # a length counts if all elements are there
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

    def _item(self, layout: MessageLayout, kind: FieldType, need: _Need, path: str, index: int,
              before: int, is_last: bool) -> Iterator[str]:
        """Go to an element, from that behind the last one that was needed, and read it."""
        if index > before:
            yield from self._skippers.elements(layout, kind, index - before, '&c')
        element = FieldType(kind.base)
        yield from self._element(layout, element, need, f'{path}[{index}]', is_last)


def _indented(lines: Iterable[str]) -> Iterator[str]:
    return (f'  {line}' if line else '' for line in lines)


def _units(name: str, data: bytes) -> Iterator[str]:
    """Declare a string in UTF-16; an empty one has no array in C."""
    units = [f'{low | high << 8}u,' for low, high in zip(data[::2], data[1::2])]
    if units:
        yield f'static const uint16_t {name}[] = {{'
        for start in range(0, len(units), 12):
            yield '  ' + ' '.join(units[start:start + 12])
        yield '};'


def _told(whole: Iterable[tuple[int, Signal]], path: str) -> Iterator[str]:
    """Say which inputs come next, and what they are made of."""
    for _, signal in whole:
        what = f'{signal.reduction}({path})' if signal.reduction else path
        yield from comment(f'{signal.name}: {what}')


def _made_of(kind: ValueType, value: str) -> str:
    """Return the field that is made of a value in C."""
    member = 'f' if kind.is_float else 'i' if kind.is_signed or kind is ValueType.BOOL else 'u'
    return f'fm_field_{member}({value})'
