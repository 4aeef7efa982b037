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
Traces as CSV: a column for each input, a row for each step, and perhaps a column `time`.

A trace is read in blocks of rows, so that memory does not grow with its length. Plain rows are
read in C (`csv.h`); a row at which C stops is read here, where an invalid cell is an error
with its line and column.
"""

from array import array
from codecs import BOM_UTF8, getincrementaldecoder
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from difflib import get_close_matches
from enum import Enum
from fractions import Fraction
from io import StringIO
from itertools import islice
import math
from pathlib import Path
import re
from typing import Any, BinaryIO, NoReturn, TYPE_CHECKING, TypeAlias

from fret_monitor.model.csv_writer import CsvWriter
from fret_monitor.model.diagnostics import CompileError, counted, refuse, Source, Span
from fret_monitor.model.floats import to_float32
from fret_monitor.model.manifest import Manifest, ManifestInput
from fret_monitor.model.policies import InputSource, Policy
from fret_monitor.model.values import ValueType
from fret_monitor.native.monitor import CData
from fret_monitor.runtime.csv_rows import CsvColumn, CsvRows

if TYPE_CHECKING:  # a trace is read without the mathematics
    from fret_monitor.logic.specification import Signal

_BLOCK_ROWS = 4096
_READ_BYTES = 1 << 20  # at once
_MANY_ROWS = 64  # of which reading them in C is worth a call
_MAX_ROW_CHARACTERS = 16 * 1024 * 1024
_SHOWN_CHARACTERS = 200  # shown of a row that is too long
_UNQUOTED = re.compile(r'[^,\r\n]*')
_LINE_END = re.compile(rb'\r\n?|\n')
_TRUTHS = {'0': 0, '1': 1, 'false': 0, 'true': 1}
_INTEGER = re.compile(r'[+-]?[0-9]+')
_REAL = re.compile(r'[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?|[+-]?(?:nan|inf)',
                   re.IGNORECASE)
TIME = 'time'  # the column with the time of each row, in seconds
_NAMES_OF_TIME = frozenset({TIME, 't', 'times', 'timestamp', 'stamp', 'seconds', 'sec', 's'})
_SECONDS = re.compile(r'[+-]?([0-9]+)(?:\.([0-9]*))?')
_DIGITS = 9  # behind the point of a number of seconds
_LATEST_NS = 2 ** 62
LAST_TICK = 2 ** 62 - 3  # FM_LAST_TICK in csrc/generated/fret_monitor.h
_ANY_TIME = (-2 ** 63, 2 ** 63 - 1)
_SEPARATORS = {';': "';'", '\t': 'tabs', '|': "'|'"}


class TimeColumn(Enum):
    """What the column `time` of a trace is: none of its business, used if it is there, needed."""

    IGNORED = 'ignored'
    OPTIONAL = 'optional'
    REQUIRED = 'required'


def time_column(manifest: Manifest) -> TimeColumn:
    """Return what the column `time` is for a bundle: measured inputs and `forget` need times."""
    if manifest.policy is Policy.TIMED:
        return TimeColumn.REQUIRED
    uses_times = any(item.source.is_measured for item in manifest.inputs) or any(
        item.forget for item in manifest.variables)
    return TimeColumn.OPTIONAL if uses_times else TimeColumn.IGNORED


@contextmanager
def open_trace(path: Path) -> Iterator[BinaryIO]:
    """Open a file with a trace; raises `CompileError` if it cannot be read."""
    try:
        file = path.open('rb', buffering=0)
    except FileNotFoundError:
        refuse(f"there is no file '{path}'")
    except OSError as error:
        refuse(f"cannot read '{path}': {error.strerror or error}")
    with file:
        yield file


def trace_text(signals: 'Sequence[Signal]', rows: Iterable[Sequence[bool | int | float]],
               times: Sequence[str] | None = None) -> str:
    """
    Return rows as CSV; the value of a string input is its index in `signal.values`.

    `times` are the times of the rows, for a column of them.
    """
    text = StringIO()
    writer = CsvWriter(text)
    writer.writerow([*(() if times is None else (TIME,)), *(signal.name for signal in signals)])
    for number, row in enumerate(rows):
        cells = [_cell(value, signal) for value, signal in zip(row, signals, strict=True)]
        writer.writerow(cells if times is None else [times[number], *cells])
    return text.getvalue()


def _cell(value: bool | int | float, signal: 'Signal') -> str:
    if signal.type is ValueType.BOOL:
        return str(int(value))
    if signal.is_string:
        return signal.values[int(value)][0]
    return repr(value)


@dataclass(frozen=True)
class Row:
    """A row; `line` is the number of its last line."""

    line: int
    cells: list[str]


class _Rows:
    """
    Splits a file into rows of cells, as RFC 4180 describes.

    Not Python's `csv`, whose limit on the length of a cell applies to the whole process.
    """

    def __init__(self, name: str, file: BinaryIO) -> None:
        self.name = name
        self.line = ''  # the last line read
        self.size = 0  # characters in the lines read
        self.number = 0  # of the last line read
        self.text, self.place = b'', 0  # a part of the file, and where the next line begins in it
        self.is_cut = False  # after `text` there is something that is no text
        self._file = file
        self._decoder = getincrementaldecoder('utf-8')()
        self._is_begin = True
        self._first_line, self._first_number, self._start = '', 1, 0  # start of the current row

    def fill(self) -> bool:
        """Read a further part of the file, up to what is no text; return whether there was one."""
        if self.is_cut:
            shown = self.text[self.place:].decode('utf-8', 'ignore')[:_SHOWN_CHARACTERS]
            self.refuse(self.number + 1, shown, 'not text in UTF-8',
                        'export the trace as UTF-8', len(shown), 1)
        begun = len(self._decoder.getstate()[0])  # bytes of a character that is not complete
        try:
            more = self._file.read(_READ_BYTES)
            self._decoder.decode(more, not more)
        except UnicodeDecodeError as error:
            self.is_cut = True
            end = len(self.text) - begun + error.start
            self.text, more = (self.text + more)[:end], b''
        except OSError as error:
            refuse(f"cannot read '{self.name}': {error.strerror or error}")
        self.text, self.place = self.text[self.place:] + more, 0
        if self._is_begin and (len(self.text) >= len(BOM_UTF8) or not more):
            self._is_begin = False
            self.text = self.text.removeprefix(BOM_UTF8)
        return bool(more) or self.is_cut

    def __iter__(self) -> Iterator[Row]:
        blank = 0
        while line := self._begin_row():
            if line in ('\n', '\r\n', '\r'):
                blank = blank or self.number
                continue
            if blank:
                self.refuse(blank, '', 'empty row', 'a row is a step; leave no line empty')
            cells = self._split(line) if '"' in line else line.rstrip('\r\n').split(',')
            yield Row(self.number, cells)

    def _begin_row(self) -> str:
        self._start = self.size
        self._first_number = self.number + 1
        self._first_line = self._read_line()
        return self._first_line

    def _read_line(self) -> str:
        end = self._line_end()
        text = self.text[self.place:end].decode('utf-8', 'ignore')
        self.line = text[:_MAX_ROW_CHARACTERS + 1]
        self.place = end
        self.number += 1
        self.size += len(self.line)
        if self.size - self._start > _MAX_ROW_CHARACTERS:
            shown = (self._first_line if self._first_number < self.number else self.line)
            self.refuse(self._first_number, shown[:_SHOWN_CHARACTERS],
                        f'a row of more than {_MAX_ROW_CHARACTERS:,} characters',
                        'a row ends with a line feed, except inside quotes')
        return self.line

    def _line_end(self) -> int:
        """Return where the next line ends, behind its line break, or after too many bytes."""
        most = 4 * (_MAX_ROW_CHARACTERS + 1)
        looked = 0  # bytes of the line without a line break
        while True:
            found = _LINE_END.search(self.text, self.place + looked)
            if found and (self.is_cut or found[0] != b'\r' or found.end() < len(self.text)):
                return found.end()
            looked = max(0, len(self.text) - self.place - 1)
            if looked >= most or not self.fill():
                return len(self.text)

    def _split(self, line: str) -> list[str]:
        """Return the cells of a row with quoted cells; reads further lines if necessary."""
        cells: list[str] = []
        place = 0
        while True:
            if line.startswith('"', place):
                cell, line, place = self._quoted(line, place + 1)
            else:
                cell = line[place:_UNQUOTED.match(line, place).end()]  # type: ignore[union-attr]
                place += len(cell)
            cells.append(cell)
            if not line.startswith(',', place):
                return cells
            place += 1

    def _quoted(self, line: str, place: int) -> tuple[str, str, int]:
        """Return a quoted cell, the line on which it ends, and the place after it there."""
        parts: list[str] = []
        while True:
            end = line.find('"', place)
            if end < 0:
                parts.append(line[place:])
                line, place = self._read_line(), 0
                if not line:
                    self.refuse(self._first_number, self._first_line,
                                'not CSV: unexpected end of data',
                                'a quote (") in this row is not closed')
            elif line.startswith('""', end):
                parts.append(line[place:end + 1])
                place = end + 2
            elif line[end + 1:end + 2] in (',', '\r', '\n', ''):
                return ''.join((*parts, line[place:end])), line, end + 1
            else:
                self.refuse(self.number, line, "not CSV: ',' expected after '\"'",
                            _other_separator(line))

    def refuse(self, number: int, shown: str, title: str, help: str, start: int = 0,
               width: int | None = None) -> NoReturn:
        """Raise an error at a line number; `start` and `width` select the underlined part."""
        source = Source(self.name, '\n' * (number - 1) + shown)
        begin = number - 1 + start
        end = begin + (len(shown.rstrip('\r\n')) if width is None else width)
        refuse(title, Span(source, begin, max(begin + 1, end)), '', help)


def parse_seconds(text: str) -> int:
    """
    Return the nanoseconds of a decimal number of seconds.

    Raises
    ------
    ValueError
        with an explanation, if it is not a number of seconds with at most nine decimal places, or
        is beyond 2^62 nanoseconds.
    """
    found = _SECONDS.fullmatch(text)
    if found is None:
        raise ValueError('write seconds in decimal, such as 12.5')
    places = found[2] or ''
    if len(places) > _DIGITS:
        raise ValueError('at most nine digits behind the point: time is counted in nanoseconds')
    size = int(found[1] + places.ljust(_DIGITS, '0'))
    if size > _LATEST_NS:
        raise ValueError('at most 2^62 nanoseconds, which are 146 years')
    return -size if text.startswith('-') else size


def seconds_text(nanoseconds: int) -> str:
    """Return a time as an exact decimal number of seconds, without trailing zeros."""
    digits = f'{abs(nanoseconds):0{_DIGITS + 1}d}'
    text = f'{digits[:-_DIGITS]}.{digits[-_DIGITS:]}'.rstrip('0').rstrip('.')
    return f'-{text}' if nanoseconds < 0 else text


Block: TypeAlias = tuple['array[int]', list['array[Any] | None']]
"""The times of rows, and an array for each input; None for one that is measured."""

_Columns: TypeAlias = tuple['array[int]', list['array[Any]']]


class TraceReader:
    """Reads the columns of the given inputs from a CSV file."""

    def __init__(self, name: str, file: BinaryIO, inputs: Sequence[ManifestInput],
                 time: TimeColumn = TimeColumn.IGNORED, library: CData | None = None) -> None:
        """
        Read the heading.

        `library` has the functions of csrc, which read plain rows; without it they are read here.

        Raises
        ------
        CompileError
            if an input has no column, or two, or there is not one column `time` and one is needed.
            An input that says that a message came needs none. Nor does one that is measured, if
            the rows have times: each is a message.
        """
        self._inputs = inputs
        self._library = library
        self._source = _Rows(name, file)
        self._rows = iter(self._source)
        heading = [cell.strip() for cell in next(self._rows, Row(1, [])).cells]
        self._width = len(heading)
        self._titles = heading
        self._heading = frozenset(heading)
        self._columns = self._find(heading)
        self._measured = [item.name for item in inputs
                          if item.source.is_measured and item.name not in self._heading]
        is_optional = TIME not in heading or any(item.name == TIME for item in inputs)
        if self._measured and time is TimeColumn.OPTIONAL and is_optional:
            time = TimeColumn.REQUIRED
        self._time = None if time is TimeColumn.IGNORED or (
            time is TimeColumn.OPTIONAL and is_optional) else self._find_time(heading)
        self._count = 0  # rows read
        self._others = 1  # rows that need not be plain, to be read at once
        self._last: int | None = None  # the time of the row before
        self.first = 0  # the time of the first row

    @property
    def has_times(self) -> bool:
        """Whether the rows have times, in the column `time`; if not, they are numbered."""
        return self._time is not None

    def blocks(self) -> Iterator[Block]:
        """
        Yield the times of the rows of each block, and an array for each input.

        The times are in nanoseconds; if the trace has none, they are the numbers of the rows from
        0. Before an error, all rows that come before it are yielded.

        Raises
        ------
        CompileError
            with the place, if the file is not CSV, a cell is not a value of its input, or times do
            not increase.
        """
        plain = self._plain(csv_column(item, place) for item, place in self._columns)
        while True:
            limits = self._limits()
            if limits is not None and (found := self._plain_rows(plain, limits)) is not None:
                yield self._with_receptions(self._of_plain(*found))
                continue
            rows, problem = self._other_rows()
            if not rows and problem is None:
                return
            if rows:
                yield from map(self._with_receptions, self._of_rows(rows))
            if problem is not None:
                raise problem

    def _limits(self) -> tuple[int, int] | None:
        """Return after which time and up to which plain rows may come; None: none may."""
        # The first time is the origin of the others, and is not read in C.
        return _ANY_TIME if self._time is None else None if self._last is None else (
            self._last, self.first + LAST_TICK)

    def _with_receptions(self, block: _Columns) -> Block:
        """Insert the inputs that have no column: each row is a message."""
        times, columns = block
        found = iter(columns)
        return times, [next(found) if item.name in self._heading else None
                       if item.source.is_measured else array('B', [1] * len(times))
                       for item in self._inputs]

    def spans(self) -> Iterator[tuple[int, int | None, int | None]]:
        """
        Yield the number of rows of each block, and the first and the last time in it.

        Nothing else is read of a row. The times are None if the rows have none that can be read.

        Raises
        ------
        CompileError
            with the place, if the file is not CSV.
        """
        plain = self._plain(())
        while True:
            if (block := self._plain_rows(plain, _ANY_TIME)) is not None:
                times, _ = self._of_plain(*block)
                yield len(times), times[0], times[-1]
                continue
            rows, problem = self._other_rows()
            if not rows and problem is None:
                return
            found = [*self._found_times(rows)]
            yield len(rows), *((found[0], found[-1]) if found else (None, None))
            if problem is not None:
                raise problem

    def _found_times(self, rows: list[Row]) -> Iterator[int]:
        """Yield the times that can be read."""
        if self._time is None:
            yield from self._numbers(len(rows))
            return
        for row in rows:
            if self._time < len(row.cells):
                with suppress(ValueError):
                    yield parse_seconds(row.cells[self._time].strip())

    def _plain(self, columns: Iterable[CsvColumn]) -> CsvRows | None:
        if self._library is None:
            return None
        times = () if self._time is None else (
            CsvColumn(self._time, ValueType.INT64, {}, is_time=True),)
        return CsvRows(self._library, [*times, *columns], self._width)

    def _plain_rows(self, plain: CsvRows | None,
                    limits: tuple[int, int]) -> tuple[int, list['array[Any]']] | None:
        """Return how many plain rows come next, and their columns; None if there is none."""
        source = self._source
        if plain is None:
            return None
        while True:
            count, source.place, columns = plain.read(
                source.text, source.place, _BLOCK_ROWS, *limits)
            if count:
                source.number += count
                self._others = 1 if count >= _MANY_ROWS else self._others
                return count, columns
            is_long = len(source.text) - source.place >= _READ_BYTES
            if is_long or source.is_cut or source.text.find(b'\n', source.place) >= 0 \
                    or not source.fill():
                return None

    def _other_rows(self) -> tuple[list[Row], CompileError | None]:
        """Return rows that need not be plain, more each time; and the error after them."""
        rows: list[Row] = []
        problem = None
        most = _BLOCK_ROWS if self._library is None else self._others
        self._others = min(2 * most, _BLOCK_ROWS)
        try:
            rows.extend(islice(self._limited(), most))  # keeps those before an error
        except CompileError as error:
            problem = error
        return rows, problem

    def _limited(self) -> Iterator[Row]:
        """Yield rows up to the maximum size of a block."""
        end = self._source.size + _MAX_ROW_CHARACTERS
        for row in self._rows:
            yield row
            if self._source.size > end:
                return

    def _of_plain(self, count: int, columns: list['array[Any]']) -> _Columns:
        if self._time is None:
            return self._numbers(count), columns
        times, *others = columns
        self._last = times[-1]
        return times, others

    def _numbers(self, count: int) -> 'array[int]':
        begin, self._count = self._count, self._count + count
        return array('q', range(begin, self._count))

    def _of_rows(self, rows: list[Row]) -> Iterator[_Columns]:
        """Yield a block of rows, or each row before the first that is wrong."""
        before = self._count, self._last, self.first
        try:
            block = self._checked(rows)
        except CompileError:
            if len(rows) == 1:
                raise
            self._count, self._last, self.first = before
            for row in rows:
                yield from self._of_rows([row])
        else:
            yield block

    def _checked(self, rows: list[Row]) -> _Columns:
        for row in rows:
            if len(row.cells) != self._width:
                self._refuse_width(row)
        times = self._numbers(len(rows)) if self._time is None \
            else array('q', self._times(rows, self._time))
        return times, [self._column(rows, item, place) for item, place in self._columns]

    def _find(self, heading: list[str]) -> list[tuple[ManifestInput, int]]:
        line = self._source.line
        missing = [item.name for item in self._inputs if item.name not in heading
                   and item.source is not InputSource.RECEIVED and not item.source.is_measured]
        if missing:
            hints = (_near_column(name, heading) for name in missing)
            self._source.refuse(
                1, line, f'the trace has no column for {_listed(missing)}',
                _other_separator(line) or next(filter(None, hints), '')
                or 'the heading of a column is the name of its input')
        for item in self._inputs:
            if heading.count(item.name) > 1:
                self._source.refuse(1, line, f"the trace has two columns for '{item.name}'", '')
        return [(item, heading.index(item.name)) for item in self._inputs
                if item.name in self._heading]

    def _find_time(self, heading: list[str]) -> int:
        if any(item.name == TIME for item in self._inputs):
            self._source.refuse(1, self._source.line, f"the column '{TIME}' is that of the times",
                                "give the input 'time' another name in the bundle")
        if heading.count(TIME) == 1:
            return heading.index(TIME)
        self._source.refuse(
            1, self._source.line,
            f"the trace has two columns '{TIME}'" if TIME in heading else
            f"the trace has no column '{TIME}'",
            self._near_time(heading) or (
                f"the times of its rows are needed for '{self._measured[0]}'; or write a column "
                'for it' if self._measured else
                'under policy: timed each row has a time, in seconds'))

    def _near_time(self, heading: list[str]) -> str:
        """Return the advice to rename the column that probably has the times."""
        inputs = {item.name for item in self._inputs}
        found = next((name for name in heading if name not in inputs
                      and name.lower() in _NAMES_OF_TIME), '')
        return f"rename the column '{found}' to '{TIME}', in seconds" if found else ''

    def _times(self, rows: list[Row], place: int) -> Iterator[int]:
        for row in rows:
            cell = row.cells[place].strip()
            try:
                now = parse_seconds(cell)
            except ValueError as error:
                self._refuse_at(row, place, f"'{cell[:40]}' is no time" if cell
                                else 'empty cell for the time', str(error))
            if self._last is None:
                self.first = now
            elif now <= self._last:
                same = 'the same time as' if now == self._last else 'a time before'
                self._refuse_at(row, place, f'{same} that of the row before',
                                f'it was {seconds_text(self._last)} there; time increases from '
                                'row to row')
            if now - self.first > LAST_TICK:
                self._refuse_at(row, place, 'more than 146 years after the first row', '')
            self._last = now
            yield now

    def _column(self, rows: list[Row], item: ManifestInput, place: int) -> 'array[Any]':
        values: array[Any] = array(item.value_type.typecode)
        names = _names(item)
        for row in rows:
            cell = row.cells[place].strip()
            try:
                values.append(names[cell] if cell in names else _value(cell, item))
            except (ValueError, OverflowError):
                self._refuse_cell(row, place, cell, item)
        return values

    def _refuse_cell(self, row: Row, place: int, cell: str, item: ManifestInput) -> NoReturn:
        title = f"'{cell[:40]}' is no value of '{item.name}'" if cell \
            else f"empty cell for '{item.name}'"
        advice = _expected(item) if cell else 'every input has a value at every step'
        self._refuse_at(row, place, title, advice)

    def _refuse_at(self, row: Row, place: int, title: str, advice: str) -> NoReturn:
        start = sum(len(cell) + 1 for cell in row.cells[:place])
        self._source.refuse(row.line, ','.join(row.cells), title, advice, start,
                            len(row.cells[place]))

    def _refuse_width(self, row: Row) -> NoReturn:
        self._source.refuse(
            row.line, ','.join(row.cells),
            f"{counted(len(row.cells), 'cell')} in a row of a trace with "
            f"{counted(self._width, 'column')}",
            _other_separator(row.cells[0]) if len(row.cells) == 1 else '')


def _other_separator(line: str) -> str:
    """Return a help text if a line seems to be separated by something other than commas."""
    found = next((name for char, name in _SEPARATORS.items() if char in line), None)
    if found is None or ',' in line and ';' not in line:
        return ''
    return f'cells are separated by commas here, not by {found}: export the trace with commas'


def _near_column(name: str, heading: list[str]) -> str:
    near = get_close_matches(name, heading, 1)
    return f"the column '{near[0]}' is close to '{name}'" if near else ''


def _names(item: ManifestInput) -> dict[str, Any]:
    """Return the values of an input that have names, as stored."""
    names: dict[str, Any] = dict(item.values)
    return {name: number for number, name in enumerate(names)} if item.is_string else names


def csv_column(item: ManifestInput, place: int) -> CsvColumn:
    """Return the column of an input as C reads it."""
    return CsvColumn(place, item.value_type, _names(item), has_numbers=not item.is_string)


def _value(cell: str, item: ManifestInput) -> int | float:
    """Return the value of a cell; raises `ValueError` if it is not a value of the input."""
    if item.is_string:
        raise ValueError
    if item.value_type is ValueType.BOOL:
        if cell.lower() not in _TRUTHS:
            raise ValueError
        return _TRUTHS[cell.lower()]
    pattern = _REAL if item.value_type.is_float else _INTEGER
    if not pattern.fullmatch(cell):
        raise ValueError
    if item.value_type is ValueType.FLOAT32:
        return _float32(cell)
    return float(cell) if item.value_type.is_float else int(cell)


def _float32(cell: str) -> float:
    """Round a decimal number to float32 once; slow only if its float64 is a rounding tie."""
    value = float(cell)
    rounded = to_float32(value)
    mirrored = 2 * value - rounded
    if mirrored != rounded and math.isfinite(value) and to_float32(mirrored) == mirrored:
        return to_float32(Fraction(cell))
    return rounded


def _expected(item: ManifestInput) -> str:
    names = _listed([name for name, _ in item.values])
    if item.is_string:
        return f'write {names}'
    kind = item.value_type
    plain = '0, 1, true or false' if kind is ValueType.BOOL \
        else f'a number ({kind.value})' if kind.is_float else f'a whole number ({kind.value})'
    return f'write {plain}' + (f', or {names}' if names else '')


def _listed(names: Iterable[str]) -> str:
    return ', '.join(f"'{name}'" for name in names)
