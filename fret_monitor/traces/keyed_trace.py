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

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import BinaryIO

from fret_monitor.model.diagnostics import did_you_mean
from fret_monitor.model.manifest import ManifestInput, ManifestVariable
from fret_monitor.model.names import LONGEST_KEY
from fret_monitor.model.policies import InputSource
from fret_monitor.traces.csv_trace import Row, TimeColumn, TraceReader


@dataclass(frozen=True)
class KeyedRow:
    """A row: its time in ns or its number, its key of each variable, its values by input."""

    time: int
    keys: tuple[str | None, ...]
    values: dict[str, int | float]


class KeyedTraceReader(TraceReader):
    """Reads the columns of variables and inputs from a CSV file, row by row."""

    def __init__(self, name: str, file: BinaryIO, inputs: Sequence[ManifestInput],
                 keyed: dict[str, int], variables: Sequence[ManifestVariable],
                 time: TimeColumn) -> None:
        """
        Read the heading.

        `keyed` has the variable (index) of each input that has a value for each key.

        Raises
        ------
        CompileError
            as `TraceReader`, and if there is no column with a variable's name.
        """
        super().__init__(name, file, inputs, time)
        self._keyed = keyed
        self._variables = variables
        for item in variables:
            if self._titles.count(item.name) != 1:
                many = 'two columns' if item.name in self._titles else 'no column'
                self._source.refuse(
                    1, self._source.line,
                    f"the trace has {many} for the instance variable '{item.name}'",
                    'a row is of the instance whose key stands there; empty: of none')
        self._key_columns = [self._titles.index(item.name) for item in variables]

    def rows(self) -> Iterator[KeyedRow]:
        """
        Yield the rows.

        Raises
        ------
        CompileError
            with the place, as `TraceReader.blocks`; also for a key that is not listed or too long,
            and for a value of an input of which the row has no key.
        """
        for row in self._rows:
            if len(row.cells) != self._width:
                self._refuse_width(row)
            time = self._numbers(1)[0] if self._time is None else next(
                self._times([row], self._time))
            keys = tuple(self._key(row, place, item) for place, item in zip(
                self._key_columns, self._variables, strict=True))
            yield KeyedRow(time, keys, dict(self._values(row, keys)))

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
            variable = self._keyed.get(item.name)
            if cell and variable is not None and keys[variable] is None:
                name = self._variables[variable].name
                self._refuse_at(
                    row, place, f"a value of '{item.name}' in a row without a key",
                    f"write the key in the column '{name}'")
            if cell:
                yield item.name, self._column([row], item, place)[0]
        for item in self._inputs:
            # Without a column of its own it is true where the row is a message of its instance.
            variable = self._keyed.get(item.name)
            is_there = variable is not None and keys[variable] is not None
            if is_there and item.source is InputSource.RECEIVED \
                    and item.name not in self._heading:
                yield item.name, 1
