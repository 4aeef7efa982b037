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
Run a compiled bundle with instance variables on a trace in a CSV file.

The table of verdicts has a column for each variable: a row is of the instance whose key stands
there, and of the bundle. A cell is empty where the row does not concern a requirement, or nothing
is known of it yet.
"""

from collections.abc import Callable, Iterator
import csv
from typing import BinaryIO, TextIO

from fret_monitor.model.diagnostics import refuse
from fret_monitor.model.manifest import Manifest
from fret_monitor.model.policies import Policy
from fret_monitor.native.monitor import Monitor
from fret_monitor.runtime.keyed_rows import KeyedRows
from fret_monitor.runtime.scopes import Scopes
from fret_monitor.traces.csv_trace import LAST_TICK, seconds_text, TIME, time_column
from fret_monitor.traces.keyed_trace import read_keyed_trace
from fret_monitor.traces.margin_table import MarginTable
from fret_monitor.traces.summary import Beyond, Summary


class ScopedRun:
    """Feeds the rows of a trace to scopes, and writes the verdicts of those that step."""

    def __init__(self, monitor: Monitor, name: str, file: BinaryIO, out: TextIO,
                 report: Callable[[int], None], scopes: Scopes,
                 margins_out: TextIO | None = None) -> None:
        """Read the heading of the trace; errors as `KeyedTraceReader`."""
        self._manifest: Manifest = monitor.manifest
        self._scopes = scopes
        self._out = out
        self._report = report
        is_timed = self._manifest.policy is Policy.TIMED
        self._first_column = TIME if is_timed else 'step'
        self._trace = read_keyed_trace(
            name, file, self._manifest, time_column(self._manifest), scopes.library)
        self._table = None if margins_out is None else MarginTable(
            self._manifest, margins_out, has_times=self._trace.has_times)
        self._rows = KeyedRows(scopes, _cells(self._manifest), self._trace.columns,
                               are_times=is_timed, has_margins=margins_out is not None)

    def run(self, until: int | None) -> Summary:
        """Take all rows, and under `timed` what comes until a time after them."""
        csv.writer(self._out, lineterminator='\n').writerow([
            self._first_column, *(item.name for item in self._manifest.variables),
            *self._manifest.ids])
        last: int | None = None
        count = 0
        for block in self._trace.keyed_blocks():
            self._rows.take(block, count)
            self._write()
            count += len(block.times)
            last = block.times[-1]
            self._report(count)
        if until is not None and last is not None:
            self._check_until(until, last)
            self._rows.advance(until)
            self._write()
        return self._summary()

    def _write(self) -> None:
        text, heads, margins = self._rows.take_text()
        self._out.write(text)
        if self._table is not None:
            self._table.write_rows(heads, margins)

    def _check_until(self, until: int, last: int) -> None:
        if until - self._trace.first > LAST_TICK:
            refuse(f'--until {seconds_text(until)} is more than 146 years after the first row')
        if until < last:
            refuse(f'--until {seconds_text(until)} is before the last row of the trace',
                   help=f'which is at {seconds_text(last)}')

    def _summary(self) -> Summary:
        found = {name: self._rows.violations(cell)
                 for cell, name in enumerate(self._manifest.ids)}
        return Summary(self._rows.count, {name: count for name, (count, _) in found.items()},
                       {name: first for name, (_, first) in found.items() if first is not None},
                       tuple(self._beyond()), self._scopes.overflows())

    def _beyond(self) -> Iterator[Beyond]:
        """Return the variables whose keys were more than `most`."""
        for place, _ in self._manifest.bases:
            counts, variables = self._scopes.counts(place), self._manifest.mentioned(place)
            found = [Beyond(' and '.join(item.name for item in variables), None, counts.unsized),
                     *(Beyond(item.name, item.most, rows)
                       for rows, item in zip(counts.by_variable, variables))]
            yield from (item for item in found if item.rows)


def _cells(manifest: Manifest) -> list[list[int]]:
    """Return the cells of the requirements of each kind, and of the bundle."""
    column = {name: place for place, name in enumerate(manifest.ids)}
    return [*([column[item.id] for item in kind.manifest.requirements[:kind.n_reported]]
              for kind in manifest.kinds), [column[item.id] for item in manifest.requirements]]
