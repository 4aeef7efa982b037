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

"""A trace in a CSV file as a recording: a row is a step, as for `simulate`."""

from array import array
from bisect import bisect_left, bisect_right
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import compress
from pathlib import Path
from typing import Any, BinaryIO
from weakref import WeakKeyDictionary

from fret_monitor.bag.recording import DamagedRecording
from fret_monitor.model.diagnostics import CompileError, refuse
from fret_monitor.model.manifest import Manifest, ManifestInput
from fret_monitor.model.policies import InputSource, Policy
from fret_monitor.model.times import short_seconds
from fret_monitor.native import evaluator_library, load_evaluator
from fret_monitor.native.monitor import Monitor
from fret_monitor.runtime.engine import Engine
from fret_monitor.runtime.evaluator import Violation
from fret_monitor.runtime.keyed_rows import InstanceRows, KeyedBlock, KeyedColumn, KeyedRows
from fret_monitor.runtime.scopes import BUNDLE
from fret_monitor.runtime.thinning import Thinning
from fret_monitor.traces.csv_trace import open_trace, TIME, TimeColumn, TraceReader
from fret_monitor.traces.keyed_trace import columns_of, KeyedTraceReader, read_keyed_trace
from fret_monitor.traces.simulate import for_trace

ROWS = 'rows'
"""The name under which rows are counted, in place of a topic."""

TRACE_SUFFIX = '.csv'
_SECOND_NS = 1_000_000_000


@dataclass(frozen=True)
class RowBatch:
    """
    Rows in the order of their times (ns); `columns` has an array for each input.

    An input that is measured has none. `come` has a flag for each row of each input: whether it
    has a value; None: all rows have one of all inputs.
    """

    times: 'array[int]'
    columns: tuple['array[Any] | None', ...]
    come: tuple[bytes, ...] | None = None

    def before(self, time: int) -> 'RowBatch':
        """Return the rows before a time."""
        return self._part(0, bisect_left(self.times, time))

    def until(self, time: int) -> 'RowBatch':
        """Return the rows up to a time."""
        return self._part(0, bisect_right(self.times, time))

    def after(self, count: int) -> 'RowBatch':
        """Return the rows after the first `count`."""
        return self._part(count, len(self.times))

    def at(self, times: 'array[int]') -> 'RowBatch':
        """Return the rows at other times."""
        return replace(self, times=times)

    def _part(self, begin: int, end: int) -> 'RowBatch':
        return RowBatch(self.times[begin:end], tuple(
            None if item is None else item[begin:end] for item in self.columns),
            self.come and tuple(item[begin:end] for item in self.come))

    def deliver(self, engine: Engine, counts: 'array[int]', *,
                most: int) -> Iterator[list[Violation]]:
        """Deliver the rows to an engine, as `Engine.rows`; `counts` has their number so far."""
        counts[0] += len(self.times)
        return engine.rows(self.columns, self.times, self.come, most=most)

    def add_to(self, thinning: Thinning, engine: Engine) -> None:
        """Put the values into windows."""
        thinning.add_rows(engine, self.columns, self.times, self.come)


@dataclass(frozen=True)
class KeyedRowBatch:
    """
    Rows with keys, from `begin` to `end` of a block.

    `rows` of an engine take them, for columns of inputs.
    """

    block: KeyedBlock
    begin: int
    end: int
    rows: Callable[[Engine], KeyedRows]

    @property
    def times(self) -> 'array[int]':
        """The times of the rows (ns), in their order."""
        return self.block.times[self.begin:self.end]

    def before(self, time: int) -> 'KeyedRowBatch':
        """Return the rows before a time."""
        return replace(self, end=self.begin + bisect_left(self.times, time))

    def until(self, time: int) -> 'KeyedRowBatch':
        """Return the rows up to a time."""
        return replace(self, end=self.begin + bisect_right(self.times, time))

    def after(self, count: int) -> 'KeyedRowBatch':
        """Return the rows after the first `count`."""
        return replace(self, begin=self.begin + count)

    def deliver(self, engine: Engine, counts: 'array[int]', *,
                most: int) -> Iterator[list[Violation]]:
        """Deliver the rows to an engine, as `RowBatch.deliver`."""
        counts[0] += self.end - self.begin
        return engine.keyed_rows(self.rows(engine), self.block, self.begin, self.end, most=most)

    def add_to(self, thinning: Thinning, engine: Engine) -> None:
        """Put the values of the bundle's inputs into windows."""
        count, part = len(engine.evaluator.monitor.manifest.inputs), slice(self.begin, self.end)
        columns: list[array[Any] | None] = [None] * count
        come = [b''] * count
        for column, found in zip(self.rows(engine).columns, self.block.columns, strict=True):
            if column and column.kind == BUNDLE and found is not None:
                columns[column.input], come[column.input] = found[0][part], bytes(found[1][part])
        thinning.add_rows(engine, columns, self.times, come)


class Trace:
    """
    A file with a trace; what it has in common with `Recording` is as there.

    `start`, `end` and `recorded` are known after `prepare`. Without a column `time`, a row is a
    second, or a period of the bundle, after the one before; `warnings` say so.
    """

    is_trace = True
    is_end_known = True
    has_checksums = False
    left_out = 0

    def __init__(self, path: Path) -> None:
        """Name a file, which is opened later."""
        self.path = path
        self.types: dict[str, set[str]] = {}
        self.formats: dict[str, str] = {}
        self.recorded: Counter[str] = Counter()
        self.start = self.end = 0
        self.errors: tuple[str, ...] = ()
        self.warnings: tuple[str, ...] = ()
        self._spacing = 1  # ns; of the numbers of rows that have no times
        self._manifest: Manifest | None = None

    def prepare(self, monitor: Monitor) -> Monitor:
        """
        Return a monitor as it is to be run over the trace, and find out how long the trace is.

        Raises
        ------
        CompileError
            if the file cannot be opened, or has not the columns that the monitor needs.
        """
        if self.path.is_fifo():  # it is read more than once
            refuse(f"'{self.path}' is a named pipe, not a file of a recording")
        manifest = monitor.manifest
        if self._manifest is None or not manifest.variables:
            self._manifest = manifest  # of monitors with keys, that of the bundle comes first
        self._time = TimeColumn.REQUIRED if manifest.policy is Policy.TIMED \
            else TimeColumn.OPTIONAL
        with open_trace(self.path) as file:
            reader = self._reader(file)
            if not reader.has_times:
                self._spacing = round((manifest.period or 1) * _SECOND_NS)
                self.warnings = (f"no column '{TIME}': a row counts as "
                                 f'{short_seconds(self._spacing)} s',)
            if not self.recorded:
                self._measure(reader)
            if not reader.has_times:  # as for `simulate`, instances do not end then
                monitor = replace(monitor, manifest=replace(manifest, variables=tuple(
                    replace(item, forget=0) for item in manifest.variables)))
        return for_trace(monitor)

    def _reader(self, file: BinaryIO) -> TraceReader:
        library = load_evaluator(evaluator_library())
        assert self._manifest is not None, '`prepare` comes first'
        if self._manifest.variables:
            return read_keyed_trace(str(self.path), file, self._manifest, self._time, library)
        return TraceReader(
            str(self.path), file, self._manifest.inputs, self._time, library)

    def _measure(self, reader: TraceReader) -> None:
        """Count the rows, and find the first and the last time, as far as they can be read."""
        first: int | None = None
        last = 0
        with suppress(CompileError):  # `batches` raises it again
            for count, begin, end in reader.spans():
                self.recorded[ROWS] += count
                if begin is not None and end is not None:
                    first = begin if first is None else first
                    last = end
        self.start, self.end = (first or 0) * self._spacing, last * self._spacing

    def batches(self, wanted: Mapping[tuple[str, str], int],
                until: int | None = None) -> Iterator[RowBatch | KeyedRowBatch]:
        """Yield the rows up to a time (ns), many at a time; errors as of `Recording.batches`."""
        try:
            with open_trace(self.path) as file:
                for batch in self._batches(self._reader(file)):
                    if until is not None and batch.times[-1] > until:
                        batch = batch.until(until)
                        if batch.times:
                            yield batch
                        return
                    yield batch
        except CompileError as error:
            raise DamagedRecording(' '.join(
                item.in_one_line for item in error.diagnostics)) from None

    def _batches(self, reader: TraceReader) -> Iterator[RowBatch | KeyedRowBatch]:
        if isinstance(reader, KeyedTraceReader):
            assert self._manifest is not None
            rows_of = _KeyedRowsOf(reader.columns, self._manifest)
            for block in reader.keyed_blocks():
                block = replace(block, times=self._spaced(block.times))
                yield KeyedRowBatch(block, 0, len(block.times), rows_of)
            return
        for times, columns in reader.blocks():
            yield RowBatch(self._spaced(times), tuple(columns))

    def _spaced(self, times: 'array[int]') -> 'array[int]':
        """Return the times of rows; of some that have none, these are their numbers."""
        return times if self._spacing == 1 else array('q', range(
            times[0] * self._spacing, times[-1] * self._spacing + 1, self._spacing))


class InstanceTrace(Trace):
    """
    A trace with keys as one instance has it: the rows that are messages of it.

    It is for a bundle in which the keys are written in place of the variables.
    """

    def __init__(self, whole: Trace, manifest: Manifest, keys: Mapping[str, bytes],
                 names: Mapping[str, str]) -> None:
        """
        Take a trace that was prepared for a bundle with instances, and the manifest of that.

        `keys` are those of the instance by variable, `names` are columns by the bundle's input.
        """
        super().__init__(whole.path)
        self.recorded, self.start, self.end = whole.recorded, whole.start, whole.end
        self._spacing = whole._spacing
        self._whole = manifest
        self._keys = [keys.get(item.name, b'') for item in manifest.variables]
        self._names = names

    def prepare(self, monitor: Monitor) -> Monitor:
        """Return a monitor as it is to be run over the rows."""
        self._time = TimeColumn.OPTIONAL if monitor.manifest.policy is not Policy.TIMED \
            else TimeColumn.REQUIRED
        self._inputs = monitor.manifest.inputs
        self._manifest = self._whole
        return for_trace(monitor)

    def _batches(self, reader: TraceReader) -> Iterator[RowBatch]:
        assert isinstance(reader, KeyedTraceReader)
        rows = InstanceRows(self._whole, reader.columns, load_evaluator(evaluator_library()))
        places = {item.item.name: place for place, item in enumerate(reader.columns)}
        for block in reader.keyed_blocks():
            are_of, come = rows.of(block, self._keys)
            times = array('q', compress(self._spaced(block.times), are_of))
            found = [self._column(item, places, block, are_of, come)
                     for item in self._inputs] if times else []
            if times:
                yield RowBatch(times, tuple(column for column, _ in found),
                               tuple(there for _, there in found))

    def _column(
        self, item: ManifestInput, places: Mapping[str, int], block: KeyedBlock, are_of: bytes,
        come: Sequence[bytes],
    ) -> tuple['array[Any] | None', bytes]:
        """Return the values of an input of the bundle, and in which rows it has one."""
        count = len(are_of) - are_of.count(0)
        ones = array('B', [1]) * count
        place = places.get(self._names.get(item.name, ''))
        if place is None:  # a reception of all instances needs no column
            is_of_all = bytes(item.source is InputSource.RECEIVED and each == 2
                              for each in are_of if each)
            return ones if any(is_of_all) else None, is_of_all
        values = block.columns[place]
        return (ones if values is None else array(values[0].typecode, compress(values[0], are_of)),
                bytes(compress(come[place], are_of)))


class _KeyedRowsOf:
    """What takes rows with keys, of each engine."""

    def __init__(self, columns: Sequence[KeyedColumn], bundle: Manifest) -> None:
        self._names = [item.item.name for item in columns]
        self._bundle = bundle
        self._made: WeakKeyDictionary[Engine, KeyedRows] = WeakKeyDictionary()

    def __call__(self, engine: Engine) -> KeyedRows:
        if engine not in self._made:
            assert engine.scopes is not None
            monitor = engine.scopes.monitor
            own = {item.item.name: item for item in columns_of(monitor.manifest)}
            self._made[engine] = KeyedRows(
                engine.scopes, [[]] * (len(monitor.kinds) + 1), [*map(own.get, self._names)],
                are_times=True, bundle=self._bundle)
        return self._made[engine]
