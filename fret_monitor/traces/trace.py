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

"""A trace as a sequence of runs: values of the inputs, and for how many steps they stay."""

from collections.abc import Iterable
from typing import NamedTuple, TypeAlias

Value: TypeAlias = bool | int | float
Row: TypeAlias = tuple[Value, ...]
"""A value for each input, in the order of the bundle."""


class Run(NamedTuple):
    """A row, and for how many steps it stays (at least one)."""

    row: Row
    steps: int


Trace: TypeAlias = tuple[Run, ...]


def rows_of(trace: Trace) -> list[Row]:
    """Return the row of each step."""
    return [run.row for run in trace for _ in range(run.steps)]


def length(trace: Trace) -> int:
    """Return the number of steps."""
    return sum(run.steps for run in trace)


def first_steps(trace: Trace, steps: int) -> Trace:
    """Return the part of a trace up to a number of steps."""
    runs = []
    for run in trace:
        if steps <= 0:
            break
        runs.append(Run(run.row, min(run.steps, steps)))
        steps -= run.steps
    return tuple(runs)


def joined(runs: Iterable[Run]) -> Trace:
    """Return a trace in which no two runs in a row have the same values."""
    trace: list[Run] = []
    for run in runs:
        if trace and run.row == trace[-1].row:
            trace[-1] = Run(run.row, trace[-1].steps + run.steps)
        else:
            trace.append(run)
    return tuple(trace)
