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

"""A wrapper of `thinning.c`: values of a recording, thinned for drawing."""

from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import compress
import math
from typing import Any, NamedTuple

from fret_monitor.native.binding import ffi
from fret_monitor.native.monitor import Monitor
from fret_monitor.runtime.engine import Engine


@dataclass(frozen=True)
class TimeWindow:
    """A stretch of time (ns, inclusive) of an input (index), in `parts` of equal length."""

    input: int
    begin: int
    end: int
    parts: int


class WindowPart(NamedTuple):
    """
    The values that came in a part of a window, `place` of them from 0 on.

    `least` and `most` are of those that are numbers, NaN if none is; `last` came last.
    """

    place: int
    least: float
    most: float
    last: float
    has_nan: bool


class Thinning:
    """The values of inputs in windows; the memory does not depend on the number of messages."""

    def __init__(self, monitor: Monitor, windows: Sequence[TimeWindow]) -> None:
        """Make empty windows."""
        self._windows = windows
        self._inputs = monitor.manifest.inputs
        order = sorted(range(len(windows)), key=lambda k: windows[k].input)
        self._places = {k: place for place, k in enumerate(order)}
        self._native: Any = ffi.new('struct fm_window[]', max(1, len(windows)))
        self._buckets: list[Any] = []
        for place, k in enumerate(order):
            window, native = windows[k], self._native[place]
            self._buckets.append(ffi.new('struct fm_bucket[]', window.parts))
            native.begin, native.end, native.n_buckets = window.begin, window.end, window.parts
            native.buckets = self._buckets[-1]
        counts = [sum(item.input < k for item in windows) for k in range(len(self._inputs) + 1)]
        self._begins = ffi.new('uint32_t[]', counts)
        self._thinning = ffi.new('struct fm_thinning *', {
            'windows': self._native, 'begins': self._begins})

    def add(self, engine: Engine, topics: 'array[int]', times: 'array[int]',
            sizes: 'array[int]', messages: bytes) -> None:
        """Put the values of messages into the windows; the arguments are as of `records`."""
        records = ffi.new('struct fm_records *', {
            'topics': ffi.from_buffer('uint32_t[]', topics),
            'times': ffi.from_buffer('int64_t[]', times),
            'sizes': ffi.from_buffer('uint64_t[]', sizes),
            'bytes': ffi.from_buffer('uint8_t[]', messages),
            'n': len(topics)})
        engine.library.fm_engine_thin(engine.pointer, records, self._thinning)

    def add_rows(self, engine: Engine, columns: Sequence['array[Any] | None'],
                 times: 'array[int]', come: 'Sequence[bytes] | None' = None) -> None:
        """
        Put the values of rows into the windows; a column for each input, or None.

        `come` has a flag for each row: whether it has a value of the input; None: all have.
        """
        for index, column in enumerate(columns):
            if column is None:
                continue
            there = come[index] if come else None
            values = array('d', column if there is None else compress(column, there))
            instants = times if there is None else array('q', compress(times, there))
            engine.library.fm_thin_column(
                self._thinning, index, ffi.from_buffer('int64_t[]', instants),
                ffi.from_buffer('double[]', values), len(instants))

    def before(self, index: int) -> float | None:
        """Return the value at the begin of a window, None if there was none yet."""
        native = self._native[self._places[index]]
        if native.has_before:
            return float(native.before)
        initial = self._inputs[self._windows[index].input].initial
        return None if initial is None else float(initial)

    def first(self, index: int) -> int | None:
        """Return when a window has a first value (ns): its begin if there was one before."""
        native = self._native[self._places[index]]
        if self.before(index) is not None:
            return self._windows[index].begin
        return int(native.first) if native.has_value else None

    def parts(self, index: int) -> Iterator[WindowPart]:
        """Yield the parts of a window in which values came."""
        buckets = self._buckets[self._places[index]]
        for place in range(self._windows[index].parts):
            item = buckets[place]
            if item.n:
                has_number = item.n > item.n_nan
                yield WindowPart(place, item.least if has_number else math.nan,
                                 item.most if has_number else math.nan, item.last, item.n_nan > 0)
