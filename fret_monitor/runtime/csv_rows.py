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

"""A wrapper of `csv.c`: plain rows of a trace in CSV, and rows of verdicts."""

from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fret_monitor.model.values import ValueType
from fret_monitor.native.binding import ffi
from fret_monitor.native.monitor import CData, type_number


@dataclass(frozen=True)
class CsvColumn:
    """
    A column that is read: its place in a row from 0, and the type of its values.

    `names` are values by their names; without `has_numbers` there are no others. With `is_time`
    cells are seconds, which are read as nanoseconds (int64). Cells may be empty if it
    `is_optional`, or has keys (`is_key`). `keys` are the places of the columns whose keys its
    values need, at most two.
    """

    place: int
    type: ValueType
    names: Mapping[str, int]
    has_numbers: bool = True
    is_time: bool = False
    is_optional: bool = False
    is_key: bool = False
    keys: tuple[int, ...] = ()


class CsvRows:
    """Reads rows of a fixed number of cells; rows that are not plain are left to the caller."""

    def __init__(self, library: CData, columns: Sequence[CsvColumn], width: int) -> None:
        """
        Prepare to read rows of `width` cells.

        `library` has the functions of csrc, as `load_evaluator` returns it.
        """
        self._library: Any = library
        self._columns = columns
        self._kept: list[object] = []
        self._native: Any = ffi.new('struct fm_csv_column[]', width)
        for column in columns:
            self._native[column.place] = {
                'type': type_number(column.type), 'is_time': column.is_time,
                'has_numbers': column.has_numbers, 'is_key': column.is_key,
                'needs_key': column.keys != (),
                'keys': [column.keys[0], column.keys[-1]] if column.keys else [0, 0],
                **self._named(column)}
        self._csv: Any = ffi.new('struct fm_csv *', {
            'columns': self._native, 'n_columns': width})

    def _named(self, column: CsvColumn) -> dict[str, object]:
        # No cell equals a name that begins or ends with white space.
        names = {name.encode(): value for name, value in column.names.items()
                 if name == name.strip()}
        texts = [ffi.new('char[]', name) for name in names]
        native = ffi.new('struct fm_csv_name[]', [
            {'text': text, 'n': len(name)} for text, name in zip(texts, names)])
        named = ffi.from_buffer(array(column.type.typecode, names.values()))
        self._kept += [texts, native, named]
        return {'n_names': len(names), 'names': native, 'named': named}

    def read(self, text: bytes, place: int, most: int, after: int,
             latest: int) -> tuple[int, int, list[Any]]:
        """
        Read rows from a place in a text on, until one that is not plain or complete.

        Parameters
        ----------
        text, place
            CSV in UTF-8, and where a row begins.
        most
            the number of rows to read at most.
        after, latest
            times are later than `after`, and up to `latest` (ns).

        Returns
        -------
        tuple[int, int, list]
            the number of rows, the place of the next one, and the values of each column: an array;
            if it is optional, a pair of that and a bytearray of the rows that have a value; of one
            with keys, a `struct fm_key[]`, whose keys are parts of `text`.
        """
        values: list[Any] = [
            ffi.new('struct fm_key[]', most) if item.is_key else
            array(item.type.typecode, bytes(item.type.size * most)) for item in self._columns]
        there = [bytearray(most) if item.is_optional else None for item in self._columns]
        buffers = []
        for column, found, known in zip(self._columns, values, there, strict=True):
            native = self._native[column.place]
            buffers += [found if column.is_key else ffi.from_buffer('char[]', found),
                        ffi.NULL if known is None else ffi.from_buffer('bool[]', known)]
            native.values, native.is_there = buffers[-2:]
        content = ffi.from_buffer('char[]', text)
        csv = self._csv
        csv.text, csv.n, csv.place = content, len(text), place
        csv.after, csv.latest = after, latest
        count = int(self._library.fm_csv_rows(csv, most))
        buffers.clear()
        return count, int(csv.place), [
            found if column.is_key else found[:count] if known is None else
            (found[:count], known[:count])
            for column, found, known in zip(self._columns, values, there, strict=True)]


def verdict_rows(library: CData, labels: 'array[int]', verdicts: bytes, width: int, *,
                 are_times: bool) -> str:
    """
    Return rows of a label and `width` verdicts as CSV, with a line feed after each.

    Labels (typecode `q`) are numbers, or times (ns) that are written in seconds.
    """
    room = ffi.new('char[]', len(labels) * (
        ffi.integer_const('FM_CSV_LABEL_BYTES') + 2 * width + 1))
    functions: Any = library
    size = functions.fm_csv_verdicts(
        ffi.from_buffer('int64_t[]', labels), are_times, ffi.from_buffer('bool[]', verdicts),
        width, len(labels), room)
    return str(ffi.buffer(room, size)[:], 'ascii')
