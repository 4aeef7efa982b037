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
A compiled bundle over a trace in a CSV file: what comes in are cells, what goes out verdicts.

The trace is read and the verdicts are written a block of rows at a time, so that neither is ever
held whole. A cell that cannot be used ends the run with its place; a file of verdicts appears
only when all of it is there.
"""

from array import array
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
import csv
from dataclasses import dataclass
from difflib import get_close_matches
from itertools import islice
import os
from pathlib import Path
import re
import sys
import tempfile
from typing import Any, TextIO

from fret_monitor.model.diagnostics import counted, refuse, Source, Span
from fret_monitor.model.manifest import Manifest, ManifestInput
from fret_monitor.model.values import ValueType
from fret_monitor.native.binding import ffi
from fret_monitor.native.monitor import Monitor
from fret_monitor.runtime.evaluator import Evaluator

_BLOCK = 4096
_LONGEST = 16 * 1024 * 1024  # characters of a row
_SHOWN = 200  # characters of a row that is too long
_TRUTHS = {'0': 0, '1': 1, 'false': 0, 'true': 1}
_INTEGER = re.compile(r'[+-]?[0-9]+')
_REAL = re.compile(r'[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?|[+-]?(?:nan|inf)',
                   re.IGNORECASE)
_SEPARATORS = {';': "';'", '\t': 'tabs', '|': "'|'"}
_LIBC: Any = ffi.dlopen(None)
_to_float32 = ffi.cast('float (*)(const char *, char **)',
                       ffi.cast('void *', _LIBC.dlsym(ffi.NULL, b'strtof')))


@dataclass(frozen=True)
class Summary:
    """What a run found: the number of steps, and for each requirement's id the violating ones."""

    steps: int
    violations: dict[str, int]


@dataclass(frozen=True)
class _Row:
    line: int
    cells: list[str]


def simulate(monitor: Monitor, trace: Path, verdicts: Path | None) -> Summary:
    """
    Step a monitor once for each row of a trace.

    Parameters
    ----------
    monitor
        a compiled bundle.
    trace
        CSV with a heading; one column an input (others are ignored), one row a step.
    verdicts
        where to write a row a step: the step from 0, then 1 (satisfied) or 0 for each
        requirement, in the bundle's order. Standard output when None.

    Raises
    ------
    CompileError
        if the trace cannot be used, with the place, or the verdicts cannot be written.
    """
    if verdicts is not None and _is_same(verdicts, trace):
        refuse(f"'{verdicts}' is the trace itself", help='name another file for the verdicts')
    with _reading(trace) as file, _wide_cells(), _writing(verdicts) as out:
        return _run(Evaluator(monitor), _Trace(trace, file, monitor.manifest), out)


def _is_same(one: Path, other: Path) -> bool:
    try:
        return one.samefile(other)
    except OSError:
        return False  # one of them does not exist; opening it tells more


def _run(evaluator: Evaluator, trace: '_Trace', out: TextIO) -> Summary:
    ids = [item.id for item in evaluator.monitor.manifest.requirements]
    csv.writer(out, lineterminator='\n').writerow(['step', *ids])
    lines: dict[bytes, str] = {}
    violations = [0] * len(ids)
    step = 0
    for rows in trace.blocks():
        found = bytes(evaluator.rows(trace.columns(rows), len(rows)))
        out.write(_shown(found, len(ids), step, lines))
        step += len(rows)
        for index in range(len(ids)):
            violations[index] += found[index::len(ids)].count(0)
    return Summary(step, dict(zip(ids, violations, strict=True)))


def _shown(found: bytes, width: int, step: int, lines: dict[bytes, str]) -> str:
    shown = []
    for start in range(0, len(found), width):
        flags = found[start:start + width]
        line = lines.get(flags)
        if line is None:
            if len(lines) >= _BLOCK:  # no two rows need be alike
                lines.clear()
            line = lines[flags] = ',' + ','.join(map(str, flags)) + '\n'
        shown.append(f'{step}{line}')
        step += 1
    return ''.join(shown)


@contextmanager
def _reading(path: Path) -> Iterator[TextIO]:
    try:
        file = path.open(encoding='utf-8-sig', newline='')
    except FileNotFoundError:
        refuse(f"there is no file '{path}'")
    except OSError as error:
        refuse(f"cannot read '{path}': {error.strerror or error}")
    with file:
        yield file


@contextmanager
def _wide_cells() -> Iterator[None]:
    """Let a cell be as long as a row; the limit is one for the whole process."""
    former = csv.field_size_limit(_LONGEST)
    try:
        yield
    finally:
        csv.field_size_limit(former)


@contextmanager
def _writing(path: Path | None) -> Iterator[TextIO]:
    if path is None:
        yield sys.stdout
        return
    try:
        if path.exists() and not path.is_file():  # a pipe or device is written as it stands
            with path.open('w', encoding='utf-8') as file:
                yield file
        else:
            yield from _replacing(Path(os.path.realpath(path)))
    except BrokenPipeError:
        raise
    except OSError as error:
        refuse(f"cannot write '{path}': {error.strerror or error}")


def _replacing(path: Path) -> Iterator[TextIO]:
    """Give a file beside `path` that takes its name when all has gone well."""
    handle, name = tempfile.mkstemp(prefix=f'.{path.name}-', dir=path.parent)
    try:
        with open(handle, 'w', encoding='utf-8') as file:
            yield file
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(name, 0o666 & ~umask)
        os.replace(name, path)
    finally:
        with suppress(FileNotFoundError):  # it has its name, if all went well
            os.unlink(name)


class _Trace:
    """A CSV file of cells, and where in it the inputs stand."""

    def __init__(self, path: Path, file: TextIO, manifest: Manifest) -> None:
        self._name = str(path)
        self._inputs = manifest.inputs
        self._first = self._last = ''  # lines of the row that is being read
        self._line = 0  # number of the first one
        self._read = self._before = 0  # characters of the trace, and of those before the row
        self._is_over = False
        self._reader = csv.reader(self._remembered(file), strict=True)
        heading = [cell.strip() for cell in next(self._rows(), _Row(1, [])).cells]
        self._width = len(heading)
        self._places = self._find(heading)

    def _remembered(self, file: TextIO) -> Iterator[str]:
        try:
            while line := file.readline(_LONGEST + 1):
                if self._read == self._before:
                    self._first, self._line = line, self._reader.line_num + 1
                self._last = line
                self._read += len(line)
                if self._read - self._before > _LONGEST:
                    self._refuse(self._line, None, f'a row of more than {_LONGEST:,} characters',
                                 'a row ends with its line, and that with a line feed; in quotes '
                                 'it goes on', shown=self._first[:_SHOWN])
                yield line
            self._is_over = True
        except UnicodeDecodeError:
            refuse(f"'{self._name}' is not text in UTF-8")
        except OSError as error:
            refuse(f"cannot read '{self._name}': {error.strerror or error}")

    def _find(self, heading: list[str]) -> list[int]:
        missing = [item.name for item in self._inputs if item.name not in heading]
        if missing:
            hints = (_did_you_mean(name, heading) for name in missing)
            self._refuse(1, None, f'the trace has no column for {_listed(missing)}',
                         _other_separator(self._last) or next(filter(None, hints), '')
                         or 'a column is headed by the name of its input')
        for item in self._inputs:
            if heading.count(item.name) > 1:
                self._refuse(1, None, f"the trace has two columns for '{item.name}'", '')
        return [heading.index(item.name) for item in self._inputs]

    def _rows(self) -> Iterator[_Row]:
        blank = 0
        try:
            for cells in self._reader:
                self._before = self._read
                if not cells:
                    blank = blank or self._reader.line_num
                    continue
                if blank:
                    self._refuse(blank, None, 'empty row', 'a row is a step; leave no line empty')
                yield _Row(self._reader.line_num, cells)
        except csv.Error as error:
            if self._is_over:
                self._refuse(self._line, None, f'not CSV: {error}',
                             'a quote (") in this row is not closed', shown=self._first)
            self._refuse(self._reader.line_num, None, f'not CSV: {error}',
                         _other_separator(self._last), shown=self._last)

    def blocks(self) -> Iterator[list[_Row]]:
        """Yield the rows, some thousand at a time."""
        rows = self._rows()
        while block := list(islice(self._some(rows), _BLOCK)):
            for row in block:
                if len(row.cells) != self._width:
                    self._refuse(row.line, row, f"{counted(len(row.cells), 'cell')} in a row "
                                 f"of a trace with {counted(self._width, 'column')}",
                                 _other_separator(row.cells[0]) if len(row.cells) == 1 else '')
            yield block

    def _some(self, rows: Iterator[_Row]) -> Iterator[_Row]:
        """Yield rows that can be held together."""
        end = self._read + _LONGEST
        for row in rows:
            yield row
            if self._read > end:
                return

    def columns(self, rows: list[_Row]) -> list['array[Any]']:
        """Return the values of each input in some rows."""
        return [self._column(rows, item, place)
                for item, place in zip(self._inputs, self._places, strict=True)]

    def _column(self, rows: list[_Row], item: ManifestInput, place: int) -> 'array[Any]':
        values: array[Any] = array(item.value_type.typecode)
        names: dict[str, Any] = dict(item.values)
        if item.is_string:
            names = {name: number for number, name in enumerate(names)}
        for row in rows:
            cell = row.cells[place].strip()
            try:
                values.append(names[cell] if cell in names else _value(cell, item))
            except (ValueError, OverflowError):
                self._refuse_cell(row, place, cell, item)
        return values

    def _refuse_cell(self, row: _Row, place: int, cell: str, item: ManifestInput) -> None:
        if not cell:
            self._refuse(row.line, row, f"empty cell for '{item.name}'",
                         'every input has a value at every step', place)
        self._refuse(row.line, row, f"'{cell[:40]}' is no value of '{item.name}'",
                     _wanted(item), place)

    def _refuse(self, line: int, row: _Row | None, title: str, help: str,
                place: int | None = None, shown: str | None = None) -> None:
        """Refuse with a place: a source that has this line, and empty ones before it."""
        if shown is None:
            shown = ','.join(row.cells) if row else self._last if line == 1 else ''
        start = 0
        width = len(shown.rstrip('\r\n'))
        if row and place is not None:
            start = sum(len(cell) + 1 for cell in row.cells[:place])
            width = len(row.cells[place])
        source = Source(self._name, '\n' * (line - 1) + shown)
        offset = line - 1 + start
        refuse(title, Span(source, offset, offset + max(1, width)), '', help)


def _other_separator(line: str) -> str:
    """Say that a line without commas is parted by something else, if it seems so."""
    found = next((name for char, name in _SEPARATORS.items() if char in line), None)
    if found is None or ',' in line and ';' not in line:
        return ''
    return f'cells are parted by commas here, and not by {found}: export the trace with commas'


def _did_you_mean(name: str, heading: list[str]) -> str:
    near = get_close_matches(name, heading, 1)
    return f"the column '{near[0]}' is close to '{name}'" if near else ''


def _value(cell: str, item: ManifestInput) -> int | float:
    """Return what a cell says; raises `ValueError` if that is no value of the input's type."""
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
        return float(_to_float32(cell.encode(), ffi.NULL))  # rounded once
    return float(cell) if item.value_type.is_float else int(cell)


def _wanted(item: ManifestInput) -> str:
    names = _listed([name for name, _ in item.values])
    if item.is_string:
        return f'write {names}'
    kind = item.value_type
    plain = '0, 1, true or false' if kind is ValueType.BOOL \
        else f'a number ({kind.value})' if kind.is_float else f'a whole number ({kind.value})'
    return f'write {plain}' + (f', or {names}' if names else '')


def _listed(names: Iterable[str]) -> str:
    return ', '.join(f"'{name}'" for name in names)
