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

"""The slack of FRETish sentences in a trace of `simulate`, which needs no reader of recordings."""

from array import array
from bisect import bisect_left
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from fret_monitor.bag.deadlines import with_lanes
from fret_monitor.bag.findings import Findings
from fret_monitor.bag.waits import lanes_of, sum_up, Waits
from fret_monitor.build import compile_monitor, generate_monitor, Reading
from fret_monitor.elaboration.signals import FindMessage
from fret_monitor.model.policies import Policy
from fret_monitor.native.monitor import Monitor
from fret_monitor.runtime.engine import Engine
from fret_monitor.runtime.evaluator import Evaluator, Violation
from fret_monitor.runtime.keyed_rows import KeyedRows
from fret_monitor.runtime.scopes import Scopes
from fret_monitor.traces.csv_trace import open_trace, time_column, TraceReader
from fret_monitor.traces.keyed_trace import read_keyed_trace
from fret_monitor.traces.simulate import for_trace


def slack_of_trace(reading: Reading, find: FindMessage, trace: Path,
                   until: int | None = None) -> dict[str, Findings] | None:
    """
    Return by id the slack of the sentences with a deadline in a trace, as `simulate` takes it.

    Triggers and responses are numbers of rows, under `timed` times (ns). Return None for a pipe,
    which cannot be read again.
    """
    lanes_reading = with_lanes(reading, find)
    if not lanes_reading.specification.properties:
        return {}
    if not trace.is_file():
        return None
    run = _TakenTrace(for_trace(compile_monitor(generate_monitor(lanes_reading)).monitor))
    with open_trace(trace) as file:
        run.take(str(trace), file, until)
    return run.findings()


class _TakenTrace:
    """An engine that takes a trace, and what its requirements say of slack."""

    def __init__(self, monitor: Monitor) -> None:
        self._manifest = monitor.manifest
        self._scopes = Scopes(monitor, is_of_engine=True) if self._manifest.variables else None
        evaluator = self._scopes.evaluator() if self._scopes else \
            Evaluator(monitor, reports_recoveries=True)
        self._engine = Engine(evaluator, takes_recoveries=True, scopes=self._scopes)
        self._waits = Waits(self._manifest)
        self._times = array('q')  # of the rows, unless stamps are shown as they are
        self._end = 0

    def take(self, name: str, file: BinaryIO, until: int | None) -> None:
        """Take all rows, and what comes until a time after them."""
        self._waits.begin(0, 0, self._manifest)
        for violation in self._keyed_rows(name, file) if self._scopes else self._rows(name, file):
            row = bisect_left(self._times, violation.stamp) if self._times else violation.stamp
            self._waits.change(violation._replace(stamp=row), None)
        self._end = self._end if until is None else until
        for batch in self._engine.advance_all(self._end):
            for violation in batch:
                self._waits.change(violation, None)

    def _rows(self, name: str, file: BinaryIO) -> Iterator[Violation]:
        reader = TraceReader(name, file, self._manifest.inputs, time_column(self._manifest),
                             self._engine.library)
        for times, columns in reader.blocks():
            self._note(times, reader)
            for batch in self._engine.rows(columns, times):
                yield from batch

    def _keyed_rows(self, name: str, file: BinaryIO) -> Iterator[Violation]:
        assert self._scopes is not None
        reader = read_keyed_trace(name, file, self._manifest, time_column(self._manifest),
                                  self._engine.library)
        rows = KeyedRows(self._scopes, [[]] * (len(self._manifest.kinds) + 1), reader.columns,
                         are_times=True)
        for block in reader.keyed_blocks():
            self._note(block.times, reader)
            for batch in self._engine.keyed_rows(rows, block, 0, len(block.times)):
                yield from batch

    def _note(self, times: 'array[int]', reader: TraceReader) -> None:
        """Note the times of rows, where a row is shown by its number."""
        self._end = times[-1]
        if reader.has_times and self._manifest.policy is not Policy.TIMED:
            self._times += times

    def findings(self) -> dict[str, Findings]:
        """Return what was found, by id."""
        manifest, steps = self._manifest, dict(self._steps())
        variables_of = {item.id: variables for item, variables in zip(
            manifest.numbered, manifest.variables_of, strict=True)}
        found = {}
        for lanes in lanes_of(variables_of):
            item = found[lanes.id] = Findings(lanes.id, variables=variables_of[lanes.waits])
            sum_up(item, self._waits.found(lanes, self._end,
                                           lambda name, key: steps.get((name, key))))
        return found

    def _steps(self) -> Iterator[tuple[tuple[str, bytes | None], int]]:
        """Yield steps as `Waits.found` takes them, by requirement and key."""
        for place, item in enumerate(self._manifest.requirements):
            yield (item.id, None), self._engine.evaluator.requirement_counts(place).violations
        for number, kind in enumerate(self._manifest.kinds if self._scopes else ()):
            assert self._scopes is not None
            for place, item in enumerate(kind.manifest.requirements):
                for key, steps in self._scopes.steps(number, place):
                    yield (item.id, key), steps
