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
Traces with keys: a column for each instance variable, beside those of the inputs.

A row with a key is a message of that instance and of the shared inputs in it. A row without is one
of the shared inputs. An empty cell leaves an input as it is.
"""

from array import array
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, BinaryIO

from fret_monitor.model.diagnostics import CompileError, did_you_mean
from fret_monitor.model.manifest import Manifest, ManifestVariable
from fret_monitor.model.names import LONGEST_KEY
from fret_monitor.model.policies import InputSource
from fret_monitor.model.values import ValueType
from fret_monitor.native.monitor import CData
from fret_monitor.runtime.csv_rows import CsvColumn
from fret_monitor.runtime.keyed_rows import joined_keys, KeyedBlock, KeyedColumn, keys_of
from fret_monitor.runtime.scopes import BUNDLE
from fret_monitor.traces.csv_trace import csv_column, Row, TimeColumn, TraceReader


@dataclass(frozen=True)
class KeyedRow:
    """A row: its time in ns or its number, its key of each variable, its values by input."""

    time: int
    keys: tuple[str | None, ...]
    values: dict[str, int | float]


class KeyedTraceReader(TraceReader):
    """Reads the columns of variables and inputs from a CSV file, in blocks of rows."""

    def __init__(self, name: str, file: BinaryIO, columns: Sequence[KeyedColumn],
                 variables_of: dict[str, tuple[int, ...]], variables: Sequence[ManifestVariable],
                 time: TimeColumn, library: CData | None = None) -> None:
        """
        Read the heading.

        `variables_of` has the variables (indices) of each input that has a value for each key;
        `library` is as of `TraceReader`.

        Raises
        ------
        CompileError
            as `TraceReader`, and if there is no column with a variable's name.
        """
        super().__init__(name, file, [item.item for item in columns], time, library)
        self._keyed = variables_of
        self._variables = variables
        for item in variables:
            if self._titles.count(item.name) != 1:
                many = 'two columns' if item.name in self._titles else 'no column'
                self._source.refuse(
                    1, self._source.line,
                    f"the trace has {many} for the instance variable '{item.name}'",
                    'a row is of the instance whose key stands there; empty: of none')
        self._key_columns = [self._titles.index(item.name) for item in variables]
        # Without a column of its own, a reception is where the row is a message of its instance.
        self.columns = [item for item in columns if item.item.name in self._heading or (
            item.kind != BUNDLE and item.item.source is InputSource.RECEIVED)]
        """The columns that blocks have."""

    def keyed_blocks(self) -> Iterator[KeyedBlock]:
        """
        Yield the rows in blocks.

        Raises
        ------
        CompileError
            with the place, as `TraceReader.blocks`; also for a key that is not listed or too long,
            and for a value of an input of which the row has no key.
        """
        plain = self._plain(self._csv_columns())
        while True:
            limits = self._limits()
            if limits is not None and (found := self._plain_rows(plain, limits)) is not None:
                yield self._of_columns(*self._of_plain(*found))
                continue
            rows, problem = self._other_rows()
            if not rows and problem is None:
                return
            yield from self._of_others(rows)
            if problem is not None:
                raise problem

    def _csv_columns(self) -> Iterator[CsvColumn]:
        """Yield the columns as C reads them: those of the keys, then those of inputs."""
        for place, variable in zip(self._key_columns, self._variables, strict=True):
            yield CsvColumn(place, ValueType.UINT8, dict.fromkeys(variable.keys, 0), is_key=True)
        for item, place in self._columns:
            yield replace(csv_column(item, place), is_optional=True, keys=tuple(
                self._key_columns[variable] for variable in self._keyed.get(item.name, ())))

    def _of_columns(self, times: 'array[int]', columns: list[Any]) -> KeyedBlock:
        count = len(self._variables)
        found = dict(zip((item.name for item, _ in self._columns), columns[count:], strict=True))
        return KeyedBlock(times, joined_keys(columns[:count], len(times)),
                          (columns[:count], self._source.text),
                          [found.get(item.item.name) for item in self.columns])

    def _of_others(self, rows: Iterable[Row]) -> Iterator[KeyedBlock]:
        """Yield rows, up to the first that is wrong."""
        found: list[KeyedRow] = []
        problem = None
        try:
            found.extend(map(self._keyed_row, rows))  # keeps those before an error
        except CompileError as error:
            problem = error
        if found:
            yield self._of_rows_with_keys(found)
        if problem is not None:
            raise problem

    def _keyed_row(self, row: Row) -> KeyedRow:
        if len(row.cells) != self._width:
            self._refuse_width(row)
        time = self._numbers(1)[0] if self._time is None else next(
            self._times([row], self._time))
        keys = tuple(self._key(row, place, item) for place, item in zip(
            self._key_columns, self._variables, strict=True))
        return KeyedRow(time, keys, dict(self._values(row, keys)))

    def _of_rows_with_keys(self, rows: list[KeyedRow]) -> KeyedBlock:
        keys, texts = keys_of([[(row.keys[place] or '').encode() for row in rows]
                               for place, _ in enumerate(self._variables)])
        columns: list[tuple[array[Any], bytearray] | None] = [
            (array(item.item.value_type.typecode,
                   [row.values.get(item.item.name, 0) for row in rows]),
             bytearray(item.item.name in row.values for row in rows))
            if item.item.name in self._heading else None for item in self.columns]
        return KeyedBlock(array('q', [row.time for row in rows]), keys, texts, columns)

    def _key(self, row: Row, place: int, variable: ManifestVariable) -> str | None:
        key = row.cells[place].strip()
        if len(key.encode()) > LONGEST_KEY:
            self._refuse_at(row, place, f'a key has at most {LONGEST_KEY} bytes', '')
        if key and variable.keys and key not in variable.keys:
            self._refuse_at(
                row, place, f"'{key[:40]}' is not a key of '{variable.name}'",
                did_you_mean(key, variable.keys) or 'its keys are ' + ', '.join(variable.keys))
        return key or None

    def _values(self, row: Row, keys: tuple[str | None, ...]) -> Iterator[tuple[str, int | float]]:
        for item, place in self._columns:
            cell = row.cells[place].strip()
            lacking = [variable for variable in self._keyed.get(item.name, ())
                       if keys[variable] is None]
            if cell and lacking:
                name = self._variables[lacking[0]].name
                self._refuse_at(
                    row, place, f"a value of '{item.name}' in a row without a key",
                    f"write the key in the column '{name}'")
            if cell:
                yield item.name, self._column([row], item, place)[0]


def read_keyed_trace(name: str, file: BinaryIO, manifest: Manifest, time: TimeColumn,
                     library: CData) -> KeyedTraceReader:
    """Read the heading of a trace of a bundle; arguments and errors as of `KeyedTraceReader`."""
    return KeyedTraceReader(name, file, columns_of(manifest), _variables_of(manifest),
                            manifest.variables, time, library)


def columns_of(manifest: Manifest) -> list[KeyedColumn]:
    """Return the inputs that have columns: those of the bundle, then those with keys."""
    shared = [KeyedColumn(item, BUNDLE, index) for index, item in enumerate(manifest.inputs)
              if item.source is not InputSource.INSTANCES]
    return [*shared, *(KeyedColumn(item, place, index)
                       for place, kind in manifest.bases
                       for index, item in enumerate(kind.manifest.inputs)
                       if index in manifest.own_inputs(place))]


def _variables_of(manifest: Manifest) -> dict[str, tuple[int, ...]]:
    return {kind.manifest.inputs[index].name: kind.variables for place, kind in manifest.bases
            for index in manifest.own_inputs(place)}
