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

"""Timed specifications, and traces as files."""

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

from fret_monitor.logic.evaluate import Trace
from fret_monitor.logic.specification import Specification
from fret_monitor.model.policies import Policy
from fret_monitor.traces.csv_trace import seconds_text

RATE = Fraction(10 ** 9)


def timed(specification: Specification) -> Specification:
    """Return a specification under the policy timed, its bounds in nanoseconds."""
    return replace(specification, policy=Policy.TIMED, signals=tuple(
        replace(item, max_rate=RATE) for item in specification.signals))


def write_trace(ticks: Sequence[int], columns: Trace, path: Path, begin: int = 0) -> None:
    lines = [','.join(['time', *columns])]
    for row, tick in enumerate(ticks):
        cells = (column[row] for column in columns.values())
        lines.append(','.join([seconds_text(begin + tick), *(
            str(int(value)) if isinstance(value, bool) else repr(value) for value in cells)]))
    path.write_text('\n'.join(lines) + '\n')
