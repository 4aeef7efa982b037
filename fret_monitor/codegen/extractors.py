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
Generate the C file with the extractors: a function for each topic that reads the mapped fields.

It uses `fret_cdr.h`, which describes how messages are serialized, and `fret_reductions.h`.
The same bundle and message definitions give the same bytes. In C and in the manifest, extractors
are called readers; these names are part of a file format and cannot be changed.
"""

from collections.abc import Iterator, Sequence
from typing import TypeAlias

from fret_monitor.codegen.c import literal, string_literal
from fret_monitor.codegen.comments import comment, safe
from fret_monitor.codegen.extractor_body import ExtractorWriter, Key, Need
from fret_monitor.codegen.message_sizes import Sizes, STRINGS
from fret_monitor.codegen.names import Names
from fret_monitor.codegen.skippers import Skippers
from fret_monitor.logic.specification import Signal
from fret_monitor.messages.field_path import key_type
from fret_monitor.messages.layout import FieldType, MessageLayout
from fret_monitor.model.made import SourceTopic
from fret_monitor.model.manifest import SECONDS
from fret_monitor.model.paths import LookUp
from fret_monitor.model.policies import InputSource, Stamp
from fret_monitor.model.values import ValueType

Feed: TypeAlias = tuple[str, LookUp | None]
"""A topic: its name, and what selects its messages."""


def generate_extractors(names: Names, title: str, signals: Sequence[Signal],
                        stamp: Stamp = Stamp.RECEIVED,
                        kinds: Sequence[Sequence[Signal]] = ()) -> Iterator[str]:
    """
    Yield the lines of the C file; with HEADER each topic has a function for its messages' stamps.

    `kinds` are the signals of the kinds of instances. There are no lines if no input comes from a
    topic, or if a message layout is not known because the signals were not read from a bundle.
    """
    topics = topics_of(signals, kinds)
    read = [item for group in (signals, *kinds) for item in group if item.topic is not None]
    if topics and all(item.layout for item in read if item.message_type is not None):
        yield from _FileWriter(names, title, signals, stamp, kinds).lines(topics)


def topics_of(signals: Sequence[Signal],
              kinds: Sequence[Sequence[Signal]] = ()) -> dict[Feed, list[int]]:
    """
    Return the topics of signals, in order, each with the indices of its signals.

    The topics that messages of others are made of are among them; and those that only instances of
    some `kinds` read.
    """
    topics = _fed(signals)
    for name in sources_of(signals):
        topics.setdefault((name, None), [])
    for group in kinds:
        for feed in _fed(group):
            topics.setdefault(feed, [])
    return topics


def keyed_inputs(signals: Sequence[Signal], feed: Feed) -> list[int]:
    """
    Return the indices of the inputs of a kind that have a value for each key, on a topic.

    Of a kind of pairs they are those that mention both variables.
    """
    count = len({name for item in signals for name in item.variables})
    return [index for index in _fed(signals).get(feed, [])
            if signals[index].variables and len(signals[index].variables) == count]


def _fed(signals: Sequence[Signal]) -> dict[Feed, list[int]]:
    topics: dict[Feed, list[int]] = {}
    for index, signal in enumerate(signals):
        if signal.topic is not None and signal.message_type is not None:
            topics.setdefault((signal.topic, signal.where), []).append(index)
    return topics


def sources_of(signals: Sequence[Signal]) -> dict[str, SourceTopic]:
    """Return the topics that messages of others are made of, by name."""
    return {source.name: source for item in signals if item.made for source in item.made.sources}


_STAMP = Signal('stamp', ValueType.FLOAT64, None, None, ('header', 'stamp'), (), None, (),
                source=InputSource.AGE)
_KEY = 'const uint8_t * key, size_t key_size,'
_SINK = 'fm_part_sink sink, void * context)'


class _FileWriter:
    """Writes the file: functions that skip, an extractor for each topic, and their table."""

    def __init__(self, names: Names, title: str, signals: Sequence[Signal],
                 stamp: Stamp, kinds: Sequence[Sequence[Signal]]) -> None:
        self._names = names
        self._title = title
        self._signals = signals
        self._kinds = kinds
        self._has_stamps = stamp is Stamp.HEADER
        self._skippers = Skippers(Sizes())

    def lines(self, topics: dict[Feed, list[int]]) -> Iterator[str]:
        extractors = [
            line for number, (feed, fed) in enumerate(topics.items())
            for line in self._functions(number, feed, [self._signals[i] for i in fed])]
        yield f'// {self._names.fields_source}: reads the messages of {safe(self._title)}.'
        yield '// Generated by fret_monitor; changes will be lost.'
        yield from ('', f'#include "{self._header()}"', '')
        yield '#if FM_ABI != 2'
        yield '#error "this file was generated for another version of fret_monitor.h"'
        yield from ('#endif', '')
        yield from self._skippers.lines()
        yield from extractors
        yield from self._table(topics)

    def _header(self) -> str:
        read = (item for group in (self._signals, *self._kinds) for item in group
                if item.topic is not None and item.message_type is not None)
        return 'fret_reductions.h' if any(
            item.reduction not in ('', SECONDS) for item in read) else 'fret_cdr.h'

    def _keyed(self, feed: Feed) -> list[tuple[int, list[Signal]]]:
        """Return the kinds that a topic feeds by key, each with its inputs."""
        return [(kind, [group[index] for index in found])
                for kind, group in enumerate(self._kinds) if (found := keyed_inputs(group, feed))]

    def _functions(self, number: int, feed: Feed, signals: Sequence[Signal]) -> Iterator[str]:
        keyed = self._keyed(feed)
        every = [*signals, *(item for _, group in keyed for item in group)]
        layout = every[0].layout if every else None
        topic, where = feed
        title = f'{topic} where {where}' if where else topic
        yield from self._extractor(number, title, signals, layout)
        if layout is None:
            return
        if where is not None and not where.variable:
            yield from self._selects(number, title, layout, where)
        for kind, group in keyed:
            yield from self._parts(f'parts_{number}_{kind}', title, layout, kind, group)
        if len(keyed) > 1:
            yield from self._all_parts(number, [kind for kind, _ in keyed])
        if self._has_stamps:
            yield from self._stamp(number, title, layout)

    def _extractor(self, number: int, title: str, signals: Sequence[Signal],
                   layout: MessageLayout | None) -> Iterator[str]:
        yield from comment(f'{title}: {layout.name}' if layout else
                           f'{title}: the engine reads it')
        yield f'static bool read_{number}(const uint8_t * message, size_t size, ' \
              'struct fm_field * fields)'
        yield from self._opened()
        if layout is None or not signals:
            yield from ('  (void)fields;', '  return true;', '}', '')
            return
        yield from self._read(signals, layout, ExtractorWriter(self._skippers), Need())
        yield '  return c.ok;'
        yield from ('}', '')

    @staticmethod
    def _opened() -> Iterator[str]:
        yield '{'
        yield '  struct fm_cdr c;'
        yield '  if (!fm_cdr_open(&c, message, size)) {'
        yield '    return false;'
        yield '  }'

    @staticmethod
    def _read(signals: Sequence[Signal], layout: MessageLayout, writer: ExtractorWriter,
              need: Need) -> Iterator[str]:
        """Yield C that sets `fields`, one for each signal, and reads what else is needed."""
        for place, signal in enumerate(signals):
            if signal.source is InputSource.RECEIVED or signal.source.is_measured:
                yield from comment(f'{signal.name}: {signal.source.value}()', '  ')
                yield f'  fields[{place}] = fm_field_i(1);'
            else:
                need.at(signal.path).whole.append((place, signal))
        yield from writer.lines(layout, need)

    def _selects(self, number: int, title: str, layout: MessageLayout,
                 where: LookUp) -> Iterator[str]:
        need = Need()
        key = need.at(where.key)
        key.is_kept = True
        kind = key_type(layout, where.key)
        assert kind is not None, where
        yield from comment(f'{title}: whether a message is one')
        yield f'static bool selects_{number}(const uint8_t * message, size_t size, ' \
              'bool * is_selected)'
        yield from self._opened()
        yield from ExtractorWriter(self._skippers).lines(layout, need)
        yield f'  *is_selected = c.ok && {_is_equal(kind, key.local, where.name)};'
        yield '  return c.ok;'
        yield from ('}', '')

    def _parts(self, name: str, title: str, layout: MessageLayout, kind: int,
               signals: Sequence[Signal]) -> Iterator[str]:
        need = Need()
        where = signals[0].where if signals[0].where and signals[0].where.variable else None
        yield from comment(f'{title}: for instances')
        yield f'static bool {name}('
        yield f'  const uint8_t * message, size_t size, {_KEY}'
        yield f'  {_SINK}'
        yield from self._opened()
        yield f'  struct fm_field fields[{len(signals)}];'
        named = mentioned_in_topic(signals[0])
        if not named:
            yield from ('  (void)key;', '  (void)key_size;')
        writer = ExtractorWriter(self._skippers, kind)
        is_in_field = any(isinstance(step, LookUp) and step.variable for step in signals[0].path)
        if named and (where or is_in_field):
            writer.make_pairs(Key('key', 'key_size'), is_first=named == signals[0].variables[0])
        elif where and is_in_field:
            yield from self._key_before(layout, where, writer, signals[0])
        if where and not is_in_field:
            need.at(where.key).is_kept = True
        yield from self._read(signals, layout, writer, need)
        if where and not is_in_field:
            yield from (f'  {line}' for line in writer.hand_over(
                _key_base(layout, where), need.at(where.key).local))
        elif not is_in_field:
            yield from ('  if (c.ok && sink != NULL) {',
                        f'    sink(context, {kind}u, key, key_size, fields);', '  }')
        yield '  return c.ok;'
        yield from ('}', '')

    @staticmethod
    def _key_before(layout: MessageLayout, where: LookUp, writer: ExtractorWriter,
                    signal: Signal) -> Iterator[str]:
        """Yield C that reads the key of `where` first, which may lie behind the elements."""
        need = Need()
        key = need.at(where.key)
        key.is_kept = True
        yield from writer.lines(layout, need)
        yield '  if (!c.ok || !fm_cdr_open(&c, message, size)) {'
        yield from ('    return false;', '  }')
        lines, other = writer.key_of(_key_base(layout, where), key.local)
        yield from (f'  {line}' for line in lines)
        writer.make_pairs(other, is_first=where.variable == signal.variables[0])

    @staticmethod
    def _all_parts(number: int, kinds: Sequence[int]) -> Iterator[str]:
        yield f'static bool parts_{number}('
        yield f'  const uint8_t * message, size_t size, {_KEY}'
        yield f'  {_SINK}'
        yield '{'
        calls = [f'parts_{number}_{kind}(message, size, key, key_size, sink, context)'
                 for kind in kinds]
        yield from (f'  {"return" if place == 0 else "  "} {call}{end}' for place, (call, end) in
                    enumerate(zip(calls, [' &&'] * (len(calls) - 1) + [';'], strict=True)))
        yield from ('}', '')

    def _stamp(self, number: int, topic: str, layout: MessageLayout) -> Iterator[str]:
        need = Need()
        need.at(_STAMP.path).whole.append((0, _STAMP))
        yield from comment(f'{topic}: the stamp in the header')
        yield f'static bool stamp_{number}(const uint8_t * message, size_t size, ' \
              'int64_t * stamp)'
        yield from self._opened()
        yield '  struct fm_field fields[1];'
        yield from ExtractorWriter(self._skippers).lines(layout, need)
        yield '  *stamp = fields[0].value.i;'
        yield '  return c.ok;'
        yield from ('}', '')

    def _table(self, topics: dict[Feed, list[int]]) -> Iterator[str]:
        symbol = self._names.readers
        yield '/// The functions that read the messages of the topics. Constant.'
        yield f'FM_EXPORT const struct fm_readers * {symbol}(void);'
        yield ''
        yield f'const struct fm_readers * {symbol}(void)'
        yield '{'
        yield '  static const struct fm_reader topics[] = {'
        for number, (feed, fed) in enumerate(topics.items()):
            yield f'    {{read_{number}, {len(fed)}u, {self._others(number, feed)}}},'
        yield '  };'
        yield f'  static const struct fm_readers readers = {{FM_ABI, {len(topics)}u, topics}};'
        yield '  return &readers;'
        yield '}'

    def _others(self, number: int, feed: Feed) -> str:
        """Return the further functions of a topic, in the order of `struct fm_reader`."""
        keyed = [kind for kind, _ in self._keyed(feed)]
        has_selection = feed[1] is not None and not feed[1].variable
        return ', '.join((
            f'stamp_{number}' if self._has_stamps else 'NULL',
            f'selects_{number}' if has_selection else 'NULL',
            'NULL' if not keyed else f'parts_{number}' if len(keyed) > 1
            else f'parts_{number}_{keyed[0]}'))


def mentioned_in_topic(signal: Signal) -> str:
    """Return the instance variable in a topic's name; '' if there is none."""
    return next((item for item in signal.variables if f'{{{item}}}' in (signal.topic or '')), '')


def _key_base(layout: MessageLayout, where: LookUp) -> str:
    found = key_type(layout, where.key)
    assert found is not None, where
    return found.base


def _is_equal(kind: FieldType, local: str, wanted: str) -> str:
    """Return the C that compares a text or a number with what was written in a bundle."""
    if kind.base in STRINGS:
        data = wanted.encode('utf-8', 'surrogatepass')
        return f'fm_cdr_is(&{local}, {string_literal(data)}, {len(data)}u)'
    number, stored = int(wanted), ValueType.of_field(kind.base)
    least, greatest = stored.limits
    return f'{local} == {literal(number, stored).text}' if least <= number <= greatest else 'false'
