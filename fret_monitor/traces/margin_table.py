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

"""Margins over a trace as CSV (docs/margins.md)."""

from array import array
from collections.abc import Iterable, Iterator, Sequence
import math
from typing import Any, TextIO

from fret_monitor.model.csv_writer import CsvWriter
from fret_monitor.model.manifest import Manifest
from fret_monitor.model.policies import Policy
from fret_monitor.runtime.evaluator import Evaluator, Margin
from fret_monitor.traces.csv_trace import seconds_text, TIME

_HEADING = ('requirement', 'margin', 'distance', 'comparison', 'inputs', 'at')


class MarginTable:
    """
    Writes a row for each step and requirement.

    `margin` is infinite where no comparison decides, and empty where it is not known; what follows
    it is then empty. `distance` is that of the comparison, in its own unit, and `at` the step or
    time at which it had it. Under `timed` there are further steps, where a margin changes.
    """

    def __init__(self, manifest: Manifest, out: TextIO, *, has_times: bool) -> None:
        """Write the heading; `has_times`: instants are times, else the numbers of steps."""
        self._manifest = manifest
        self._is_timed = manifest.policy is Policy.TIMED
        self._has_times = has_times
        self._writer = CsvWriter(out)
        self._steps = 0
        self._writer.writerow([TIME if self._is_timed else 'step',
                               *(item.name for item in manifest.variables), *_HEADING])
        # The requirements in the order of their columns, each with the manifest of its scope.
        scopes = {item.id: scope for scope in (
            manifest, *(kind.manifest for kind in manifest.kinds)) for item in scope.requirements}
        self._columns = [(name, scopes[name]) for name in (
            manifest.ids or [item.id for item in manifest.requirements])]
        self.before = b''  # the last verdicts

    def write(self, times: Sequence[int], margins: Sequence[Margin]) -> None:
        """Write the margins of steps, those of all requirements for each of the times."""
        labels = map(seconds_text, times) if self._is_timed else \
            map(str, range(self._steps, self._steps + len(times)))
        self.write_rows(([label] for label in labels), margins)
        self._steps += len(times)

    def write_rows(self, heads: Iterable[list[str]], margins: Sequence[Margin | None]) -> None:
        """Write the margins of rows that begin with labels and keys; None: of no requirement."""
        width = len(self._columns)
        for row, head in enumerate(heads):
            found = zip(self._columns, margins[row * width:(row + 1) * width], strict=True)
            self._writer.writerows([*head, name, *self._cells(scope, margin)]
                                   for (name, scope), margin in found if margin is not None)

    def _cells(self, manifest: Manifest, margin: Margin) -> list[str]:
        if not math.isfinite(margin.value):
            return ['' if math.isnan(margin.value) else repr(margin.value), '', '', '', '']
        comparison = manifest.comparisons[margin.comparison]
        names = ' '.join(manifest.inputs[index].name for index in comparison.inputs)
        at = seconds_text(margin.instant) if self._has_times else str(margin.instant)
        return [repr(margin.value), repr(margin.distance), comparison.text, names, at]


def with_margins(
    table: MarginTable, evaluator: Evaluator, columns: Sequence['array[Any] | None'],
    times: 'array[int]', until: int | None = None,
) -> Iterator[tuple['array[int]', bytes]]:
    """Write the margins of rows to a table, and yield the verdicts as `Evaluator.rows`."""
    width = len(evaluator.monitor.manifest.requirements)
    rows = set(times)
    for instants, verdicts, margins in evaluator.margin_rows(columns, times, until):
        table.write(instants, margins)
        kept = array('q')
        found = bytearray()
        for place, instant in enumerate(instants):
            row = verdicts[place * width:(place + 1) * width]
            if instant in rows or row != table.before:  # not where only a margin changes
                kept.append(instant)
                found += row
            table.before = row
        yield kept, bytes(found)
