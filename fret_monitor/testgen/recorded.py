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
Traces with the time of each row, and the values of formulas on them by the reference semantics.

The policy `timed` means a step at every nanosecond. So the reference on intervals gives the
verdicts of all policies: a tick is a step, or a nanosecond.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from fret_monitor.logic.evaluate import evaluate
from fret_monitor.logic.formula import Formula
from fret_monitor.logic.pointwise import TraceError
from fret_monitor.logic.specification import Signal
from fret_monitor.logic.timed import evaluate_timed, History, TimedTrace, value_at
from fret_monitor.testgen.obligations import Equations
from fret_monitor.traces.receptions import with_instants
from fret_monitor.traces.trace import joined, Row, rows_of, Trace

_LONGEST_STEPS = 2000  # for the reference that takes each step


@dataclass(frozen=True)
class Recorded:
    """Rows of inputs: `rows[i]` holds from `ticks[i]` until the next, the last until `end`."""

    ticks: tuple[int, ...]
    rows: tuple[Row, ...]
    end: int

    def at_each_tick(self) -> list[Row]:
        """Return a row for each tick, which is a step."""
        ends = (*self.ticks[1:], self.end + 1)
        return [row for row, begin, end in zip(self.rows, self.ticks, ends, strict=True)
                for _ in range(end - begin)]

    def columns(self, begin: int, end: int) -> 'Recorded':
        """Return it with some of its columns; rows that are equal then become one."""
        return merged(replace(self, rows=tuple(row[begin:end] for row in self.rows)))


def merged(trace: Recorded) -> Recorded:
    """Return a trace without rows that repeat the row before."""
    kept = [place for place, row in enumerate(trace.rows)
            if place == 0 or repr(row) != repr(trace.rows[place - 1])]
    return Recorded(tuple(trace.ticks[place] for place in kept),
                    tuple(trace.rows[place] for place in kept), trace.end)


def recorded(trace: Trace, signals: Sequence[Signal], grid: int | None) -> Recorded:
    """
    Return a trace with the time of each row; `grid` is the spacing of its steps.

    With None, a step is a tick. Otherwise inputs that are receptions are true for one tick.
    """
    if grid is None:
        runs = joined(trace)
        starts, step = [], 0
        for run in runs:
            starts.append(step)
            step += run.steps
        return Recorded(tuple(starts), tuple(run.row for run in runs), step - 1)
    ticks, rows = with_instants(
        ((number * grid, row) for number, row in enumerate(rows_of(trace))), signals)
    return merged(Recorded(tuple(ticks), tuple(rows), ticks[-1]))


def history(formula: Formula, feedback: Equations, names: Sequence[str],
            trace: Recorded) -> History:
    """Return the value of a formula at every tick, by the reference semantics."""
    columns = {name: [row[place] for row in trace.rows] for place, name in enumerate(names)}
    try:
        found, = evaluate_timed([formula], TimedTrace(trace.ticks, columns, trace.end), feedback)
        return found
    except TraceError:
        if trace.end > _LONGEST_STEPS:
            raise
    # An equation that counts steps changes at each.
    rows = trace.at_each_tick()
    stepped = {name: [row[place] for row in rows] for place, name in enumerate(names)}
    return list(enumerate(evaluate(formula, stepped, feedback)))


def is_met(goal: Formula, feedback: Equations, names: Sequence[str], trace: Recorded) -> bool:
    """Whether a formula is true at the last tick of a trace."""
    return value_at(history(goal, feedback, names, trace), trace.end) is True


def moved(trace: Recorded, grid: int) -> Iterator[Recorded]:
    """
    Yield traces that end, or whose last rows come, up to a step of the grid from there.

    What lasts a nanosecond stays that short: it may be a reception.
    """
    offsets = (1, -1, 1 - grid, grid - 1, grid)
    for shifted in (trace, *_shifted(trace, offsets)):
        for offset in (0, *offsets):
            if (shifted is not trace or offset) and shifted.end + offset >= shifted.ticks[-1]:
                yield replace(shifted, end=shifted.end + offset)


def _shifted(trace: Recorded, offsets: Sequence[int]) -> Iterator[Recorded]:
    for place in range(len(trace.ticks) - 1, 0, -1):
        if trace.ticks[place] == trace.ticks[place - 1] + 1:
            continue
        for offset in offsets:
            ticks = (*trace.ticks[:place], *(tick + offset for tick in trace.ticks[place:]))
            if ticks[place] > ticks[place - 1]:
                yield replace(trace, ticks=ticks, end=max(trace.end, ticks[-1]))


def first_met(traces: Iterable[Recorded], accepts: Callable[[Recorded], bool]) -> Recorded | None:
    """Return the first trace that is accepted."""
    return next((trace for trace in traces if accepts(trace)), None)
