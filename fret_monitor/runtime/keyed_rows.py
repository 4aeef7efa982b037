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

"""A wrapper of `keyed_rows.c`: rows of a trace with keys, and what they make of all scopes."""

from array import array
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
import csv
from dataclasses import dataclass
from io import StringIO
from itertools import chain
import math
from typing import Any

from fret_monitor.model.manifest import Manifest, ManifestInput
from fret_monitor.model.policies import InputSource
from fret_monitor.native.binding import ffi
from fret_monitor.native.errors import NativeError
from fret_monitor.native.monitor import CData
from fret_monitor.runtime.evaluator import Margin, margin_of
from fret_monitor.runtime.scopes import Scopes


_NO_VERDICT = ffi.integer_const('FM_NO_VERDICT')
_NO_MARGIN = ffi.integer_const('FM_NO_MARGIN')


@dataclass(frozen=True)
class KeyedColumn:
    """A column of values of an input (index) of a kind (index, or `BUNDLE`)."""

    item: ManifestInput
    kind: int
    input: int


@dataclass(frozen=True)
class KeyedBlock:
    """
    Rows: their times (ns, or numbers), keys and values.

    `keys` are a `struct fm_key` for each row, of one variable after the other, which point into
    `texts`. A column of values is None if each row with a key has the value 1; beside it are the
    rows that have a value.
    """

    times: 'array[int]'
    keys: CData
    texts: Any
    columns: 'Sequence[tuple[array[Any], bytearray] | None]'


class KeyedRows:
    """Steps scopes with rows; the text of the verdicts is taken by `take_text`."""

    def __init__(self, scopes: Scopes, cells: Sequence[Sequence[int]],
                 columns: Sequence[KeyedColumn | None], *, are_times: bool,
                 has_margins: bool = False, bundle: Manifest | None = None) -> None:
        """
        Prepare to run scopes.

        `cells` has, for each kind and last for the bundle, the place of each requirement in a row.
        The monitor has margins if they are wanted. A column of None is left out. `bundle` is what
        the rows were written for, if that is not what runs.
        """
        manifest = scopes.monitor.manifest
        variables, kinds = manifest.variables, manifest.kinds
        receptions = [index for index, item in enumerate(manifest.inputs)
                      if item.source is InputSource.RECEIVED]
        slots = [*(manifest.most(place) for place, _ in enumerate(kinds)), 1]
        native = ffi.new('struct fm_keyed_scope[]', len(cells))
        pairs = _pairs(bundle or manifest)
        self._library: Any = scopes.library
        self.columns = columns
        self.n_cells = sum(map(len, cells))
        self._kept: list[Any] = [scopes, native]
        for place, (own, most) in enumerate(zip(cells, slots, strict=True)):
            before = bytes([_NO_VERDICT]) * (most * len(own) + 1)
            margins = ffi.new('double[]', [math.nan] * (most * len(own) + 1)) \
                if has_margins else ffi.NULL
            parts = ffi.new('uint32_t[]', [*own, 0]), ffi.new('uint8_t[]', before), margins
            native[place] = {
                **_scope(manifest, place), 'n_slots': most, 'n': len(own), 'places': parts[0],
                'before': parts[1], 'margins': margins}
            self._kept.append(parts)
        self._rows: Any = ffi.new('struct fm_keyed_rows *', {
            'scopes': scopes.pointer, 'kinds': native, 'n_kinds': len(kinds),
            'pairs': self._new('uint32_t[]', [*pairs, 0]), 'n_pairs': len(pairs) // 2,
            'n_variables': len(variables), 'n_cells': self.n_cells, 'is_timed': are_times,
            'n_receptions': len(receptions),
            'events': self._new('struct fm_stepped[]', 2 * sum(slots) + 4),
            'own': self._new('uint32_t[]', len(kinds) + 1),
            'cells': self._new('char[]', self.n_cells + 1),
            'margins': self._new('struct fm_margin[]', self.n_cells + 1)
            if has_margins else ffi.NULL,
            'shown': self._new('struct fm_key[]', len(variables)),
            'receptions': self._new('uint32_t[]', [*receptions, 0]),
            'violations': self._new('uint64_t[]', self.n_cells + 1),
            'first': self._new('int64_t[]', self.n_cells + 1),
        })

    def _new(self, kind: str, content: Any) -> CData:
        self._kept.append(made := ffi.new(kind, content))
        return made

    def take(self, block: KeyedBlock, label: int) -> None:
        """Take rows, of which the first has a number, which is its label unless it has a time."""
        with _filled(self._rows, self.columns, block):
            self._rows.label = label
            self._library.fm_keyed_rows_take(self._rows)

    def feed(self, engine: CData, block: KeyedBlock, begin: int, end: int,
             most: int) -> Iterator[None]:
        """Let an engine with these scopes take some rows; take what it finds each time."""
        with _filled(self._rows, self.columns, block):
            self._rows.next, self._rows.end = begin, end
            while not self._library.fm_engine_keyed_rows(engine, self._rows, most):
                yield
        yield

    def advance(self, until: int) -> None:
        """Take what is due by a time."""
        self._library.fm_keyed_rows_advance(self._rows, until)

    def take_text(self) -> tuple[str, list[list[str]], list[Margin | None]]:
        """
        Return the rows of verdicts since the last call.

        Return also what begins the rows of margins, and a margin for each cell of these rows, None
        of those that are empty.

        Raises
        ------
        NativeError
            if memory was short.
        """
        rows = self._rows
        text, heads = _text(rows.text), _text(rows.heads)
        found = ffi.cast('struct fm_margin *', rows.found.text)
        count = rows.found.length // ffi.sizeof('struct fm_margin')
        margins = [None if item.comparison == _NO_MARGIN else margin_of(item)
                   for item in (found[0:count] if count else ())]
        self._library.fm_keyed_rows_free(rows)
        if rows.is_short:
            raise NativeError('there is no memory for the rows of verdicts')
        return text, list(csv.reader(StringIO(heads, newline=''))), margins

    @property
    def count(self) -> int:
        """How many rows were written."""
        return int(self._rows.n_rows)

    def violations(self, cell: int) -> tuple[int, int | None]:
        """Return how often a requirement was violated, and the label of the first time."""
        count = int(self._rows.violations[cell])
        return count, int(self._rows.first[cell]) if count else None


class InstanceRows:
    """Which rows of a trace with keys are messages of an instance."""

    def __init__(self, manifest: Manifest, columns: Sequence[KeyedColumn], library: CData) -> None:
        """Look at the columns of a bundle; `library` is that of the evaluator."""
        self._library: Any = library
        self._columns = columns
        kinds, pairs = len(manifest.kinds), _pairs(manifest)
        self._pairs = ffi.new('uint32_t[]', [*pairs, 0])
        self._scopes = ffi.new('struct fm_keyed_scope[]', [
            _scope(manifest, place) for place in range(kinds + 1)])
        self._rows: Any = ffi.new('struct fm_keyed_rows *', {
            'kinds': self._scopes, 'n_kinds': kinds, 'n_variables': len(manifest.variables),
            'pairs': self._pairs, 'n_pairs': len(pairs) // 2})

    def of(self, block: KeyedBlock, keys: Sequence[bytes]) -> tuple[bytes, list[bytes]]:
        """
        Say of each row whether it is a message of an instance: 0, 1, or 2 if it is one of all.

        `keys` are those of the instance, of each variable, b'' of others. Return also, of each
        column, a flag for each row: whether it has a value for the instance.
        """
        count = len(block.times)
        own, texts = keys_of([[key] for key in keys])
        are_of, come = bytearray(count), bytearray(count * len(self._columns))
        with _filled(self._rows, self._columns, block):
            self._library.fm_keyed_rows_of(
                self._rows, own, ffi.from_buffer(are_of), ffi.from_buffer(come))
        del texts  # `own` points into them
        return bytes(are_of), [bytes(come[place * count:(place + 1) * count])
                               for place, _ in enumerate(self._columns)]


def _pairs(manifest: Manifest) -> list[int]:
    """Return which variables have requirements of their pairs, two for each."""
    return [*chain(*sorted({
        item.variables for item in manifest.kinds if len(item.variables) > 1}))]


def _scope(manifest: Manifest, place: int) -> dict[str, Any]:
    """Return which variables a kind has, or behind the kinds the bundle."""
    is_kind = place < len(manifest.kinds)
    variables = manifest.kinds[place].variables if is_kind else (0,)
    return {'variables': [variables[0], variables[-1]], 'is_of_pairs': len(variables) > 1,
            'base': manifest.base_of(place) if is_kind else place}


@contextmanager
def _filled(rows: Any, own: Sequence[KeyedColumn | None], block: KeyedBlock) -> Iterator[None]:
    """Have `struct fm_keyed_rows` refer to the rows of a block."""
    count = len(block.times)
    ones = array('B', [1]) * count
    parts = [(ffi.from_buffer(item[0]), ffi.from_buffer('bool[]', item[1])) if item else
             (ffi.from_buffer(ones), ffi.NULL) for item in block.columns]
    columns = ffi.new('struct fm_keyed_column[]', [
        {'values': values, 'is_there': there, 'kind': column.kind, 'input': column.input,
         'bytes': column.item.value_type.size}
        for column, (values, there) in zip(own, parts, strict=True) if column] or 1)
    rows.n_columns = len(own) - own.count(None)
    times = ffi.from_buffer('int64_t[]', block.times)
    rows.n, rows.times, rows.keys, rows.columns = count, times, block.keys, columns
    yield


def keys_of(keys: Sequence[Sequence[bytes]]) -> tuple[CData, list[CData]]:
    """Return the keys of rows, by variable, as a block has them; b'' is none."""
    texts = [ffi.new('uint8_t[]', key or b'\0') for column in keys for key in column]
    sizes = [len(key) for column in keys for key in column]
    found = ffi.new('struct fm_key[]', [
        {'bytes': text, 'size': size} for text, size in zip(texts, sizes, strict=True)] or 1)
    return found, texts


def joined_keys(columns: Sequence[CData], count: int) -> CData:
    """Return the keys of rows, by variable, from a column of each."""
    found = ffi.new('struct fm_key[]', len(columns) * count)
    for place, keys in enumerate(columns):
        ffi.memmove(found + place * count, keys, count * ffi.sizeof('struct fm_key'))
    return found


def _text(found: CData) -> str:
    return ffi.buffer(found.text, found.length)[:].decode(errors='replace') if found.length else ''
