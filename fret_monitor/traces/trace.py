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

"""Traces as sequences of runs: values of the inputs that stay constant for some steps."""

from collections.abc import Iterable
from typing import NamedTuple, TypeAlias

Value: TypeAlias = bool | int | float
Row: TypeAlias = tuple[Value, ...]
"""A value for each input, in the order of the bundle."""


class Run(NamedTuple):
    """A row, and the number of steps for which it stays (at least one)."""

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
    """Return the prefix of a trace with a number of steps."""
    runs = []
    for run in trace:
        if steps <= 0:
            break
        runs.append(Run(run.row, min(run.steps, steps)))
        steps -= run.steps
    return tuple(runs)


def joined(runs: Iterable[Run]) -> Trace:
    """Return a trace in which consecutive runs with equal rows are merged."""
    trace: list[Run] = []
    for run in runs:
        if trace and run.row == trace[-1].row:
            trace[-1] = Run(run.row, trace[-1].steps + run.steps)
        else:
            trace.append(run)
    return tuple(trace)
