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

"""Generate C that skips the fields of a serialized message that no input reads."""

from collections.abc import Iterable, Iterator

from fret_monitor.codegen.message_sizes import (
    ByteRun, joined, repeated, Sizes, stride, STRINGS,
)
from fret_monitor.messages.installed import nested_layout
from fret_monitor.messages.layout import ArrayKind, FieldType, MessageField, MessageLayout

_LARGEST = 2 ** 62  # bytes of a run; longer than any message
_NO_BOUND = 'UINT32_MAX'


class Skippers:
    """Generates C that skips fields, and functions that skip messages of varying size."""

    def __init__(self, sizes: Sizes) -> None:
        """Start without functions; each is generated when it is first needed."""
        self._sizes = sizes
        self._made: dict[str, list[str]] = {}

    def lines(self) -> Iterator[str]:
        """Yield the functions; each comes after the functions it calls."""
        for lines in self._made.values():
            yield from lines

    def elements(self, layout: MessageLayout, kind: FieldType, count: str | int,
                 cursor: str) -> Iterator[str]:
        """Yield C that skips `count` elements of a field: a number, or an expression in C."""
        runs = self._sizes.of_element(layout, kind)
        if runs is None:
            shown = unsigned(count) if isinstance(count, int) else count
            yield f'{self._function(layout, kind)}({cursor}, {shown});'
        elif isinstance(count, int):
            yield from self.runs(repeated(runs, count), cursor)
        elif len(runs) == 1 and runs[0].size % runs[0].alignment == 0:
            yield f'fm_cdr_skip_many({cursor}, {runs[0].alignment}u, ' \
                  f'{unsigned(runs[0].size)}, {count});'
        else:
            yield f'if ({count} > 0u) {{'
            yield from (f'  {line}' for line in self.runs(runs, cursor))
            yield f'  fm_cdr_skip_many({cursor}, 1u, {unsigned(stride(runs))}, {count} - 1u);'
            yield '}'

    def runs(self, runs: Iterable[ByteRun], cursor: str) -> Iterator[str]:
        """Yield C that skips runs."""
        for run in runs:
            yield f'fm_cdr_skip({cursor}, {run.alignment}u, {unsigned(run.size)});'

    def field(self, layout: MessageLayout, kind: FieldType, cursor: str) -> Iterator[str]:
        """Yield C that skips a field whose size depends on its content."""
        match kind.array:
            case ArrayKind.NONE:
                yield from self.elements(layout, kind, 1, cursor)
            case ArrayKind.FIXED:
                yield from self.elements(layout, kind, kind.size or 0, cursor)
            case ArrayKind.BOUNDED | ArrayKind.UNBOUNDED:
                lines = list(self.elements(layout, kind, 'length', cursor))
                length = f'fm_cdr_count({cursor}, {array_bound(kind)})'
                if len(lines) == 1:
                    yield lines[0].replace(', length)', f', {length})')
                else:
                    yield '{'
                    yield f'  const uint32_t length = {length};'
                    yield from (f'  {line}' for line in lines)
                    yield '}'

    def _function(self, layout: MessageLayout, kind: FieldType) -> str:
        if kind.base in STRINGS:
            return f'fm_cdr_skip_{kind.base}s'
        name = 'skip_' + kind.base.replace('/', '_')
        if name not in self._made:
            self._made[name] = list(self._definition(name, nested_layout(layout, kind)))
        return name

    def _definition(self, name: str, layout: MessageLayout) -> Iterator[str]:
        # This generates the functions that it calls, so that they are printed before it.
        body = list(self.fields(layout, layout.fields, 'c'))
        yield f'static void {name}(struct fm_cdr * c, uint32_t count)'
        yield '{'
        yield '  for (uint32_t i = 0u; i < count && c->ok; ++i) {'
        yield from (f'    {line}' for line in body)
        yield from ('  }', '}', '')

    def fields(self, layout: MessageLayout, fields: Iterable[MessageField],
               cursor: str) -> Iterator[str]:
        """Yield C that skips consecutive fields of a message."""
        waiting: list[ByteRun] = []
        for item in fields:
            runs = self._sizes.of_field(layout, item.type)
            if runs is not None:
                waiting.extend(runs)
                continue
            yield from self.runs(joined(waiting), cursor)
            waiting = []
            yield from self.field(layout, item.type, cursor)
        yield from self.runs(joined(waiting), cursor)


def array_bound(kind: FieldType) -> str:
    """Return the largest length of a sequence, in C."""
    return _NO_BOUND if kind.size is None else unsigned(kind.size)


def unsigned(number: int) -> str:
    """Return a number of bytes or elements as a C literal."""
    small = min(number, _LARGEST)
    return f'{small}u' if small < 2 ** 32 else f'UINT64_C({small})'
