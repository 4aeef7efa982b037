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
from itertools import chain
from typing import BinaryIO, TextIO

from fret_monitor.model.diagnostics import refuse
from fret_monitor.model.manifest import Manifest, ManifestInput
from fret_monitor.model.policies import InputSource, Policy
from fret_monitor.native.monitor import Monitor
from fret_monitor.runtime.scopes import BUNDLE, Event, Scopes
from fret_monitor.traces.csv_trace import LAST_TICK, seconds_text, TIME, TimeColumn
from fret_monitor.traces.keyed_trace import KeyedRow, KeyedTraceReader
from fret_monitor.traces.summary import Beyond

_REPORTED_ROWS = 1000
Keys = tuple[str | None, ...]
Verdicts = list[bool | None]


class ScopedRun:
    """Feeds the rows of a trace to scopes, and writes the verdicts of those that step."""

    def __init__(self, monitor: Monitor, name: str, file: BinaryIO, out: TextIO,
                 report: Callable[[int], None], scopes: Scopes) -> None:
        """Read the heading of the trace; errors as `KeyedTraceReader`."""
        self._manifest: Manifest = monitor.manifest
        self._scopes = scopes
        self._report = report
        self._is_timed = self._manifest.policy is Policy.TIMED
        self._writer = csv.writer(out, lineterminator='\n')
        self._inputs = _Inputs(self._manifest)
        has_forget = any(item.forget for item in self._manifest.variables)
        self._trace = KeyedTraceReader(
            name, file, self._inputs.all, self._inputs.variable_of, self._manifest.variables,
            TimeColumn.REQUIRED if self._is_timed else
            TimeColumn.OPTIONAL if has_forget else TimeColumn.IGNORED)
        self._places = self._columns()
        self._before: dict[tuple[int, int], Verdicts] = {}
        self.rows = 0
        self.violations = dict.fromkeys(self._manifest.ids, 0)
        self.first: dict[str, int] = {}

    def _columns(self) -> dict[int, list[int]]:
        """Return the columns of the requirements of each scope, by kind."""
        column = {name: place for place, name in enumerate(self._manifest.ids)}
        scopes = [(BUNDLE, self._manifest.requirements), *(
            (place, kind.manifest.requirements[:kind.n_reported])
            for place, kind in enumerate(self._manifest.kinds))]
        return {kind: [column[item.id] for item in items] for kind, items in scopes}

    def run(self, until: int | None) -> None:
        """Take all rows, and under `timed` what comes until a time after them."""
        self._writer.writerow([TIME if self._is_timed else 'step',
                               *(item.name for item in self._manifest.variables),
                               *self._manifest.ids])
        last: int | None = None
        for number, row in enumerate(self._trace.rows()):
            self._take(row, row.time if self._is_timed else number)
            last = row.time
            if number % _REPORTED_ROWS == 0:
                self._report(number)
        if until is not None and last is not None:
            self._check_until(until, last)
            self._advance(self._scopes.advance(until))

    def _check_until(self, until: int, last: int) -> None:
        if until - self._trace.first > LAST_TICK:
            refuse(f'--until {seconds_text(until)} is more than 146 years after the first row')
        if until < last:
            refuse(f'--until {seconds_text(until)} is before the last row of the trace',
                   help=f'which is at {seconds_text(last)}')

    def _take(self, row: KeyedRow, label: int) -> None:
        """Take a row; `label` is what the first column says of it."""
        self._advance(self._scopes.advance_to(row.time))
        own = self._feed(row)
        mine: dict[int, Verdicts] = {}
        others = []
        for (kind, slot), verdicts in self._changed(label):
            if kind == BUNDLE or own.get(kind) == slot:
                mine[kind] = self._before[kind, slot] = verdicts
            else:
                others.append(((kind, slot), verdicts))
        self._write(label, row.keys, mine)
        self._write_others(row.time, others)
        self._advance(self._scopes.advance(row.time))

    def _feed(self, row: KeyedRow) -> dict[int, int]:
        """Store a row and take its steps; return the slots of its instances, by kind."""
        shared = {index: row.values[name] for name, index in self._inputs.shared.items()
                  if name in row.values}
        is_for_all = bool(shared) or not any(row.keys)
        self._scopes.begin_row(is_for_all, row.time)
        for index, value in shared.items():
            self._scopes.store(index, value)
        for index in self._inputs.receptions if is_for_all else ():
            self._scopes.store(index, True)
        own: dict[int, int] = {}
        for place, kind in enumerate(self._manifest.kinds):
            key = row.keys[kind.variables[0]]
            slot = None if key is None else self._scopes.enter(place, key.encode())
            if slot is not None:
                own[place] = slot
                for name, index in self._inputs.keyed[place].items():
                    if name in row.values:
                        self._scopes.store_keyed(place, index, row.values[name])
        self._scopes.end()
        return own

    def _advance(self, instants: Iterator[int]) -> None:
        for instant in instants:
            self._write_others(instant, self._changed(instant))

    def _changed(self, label: int) -> list[tuple[tuple[int, int], Verdicts]]:
        """
        Return the verdicts of the scopes that stepped; under `timed` those that are not as before.

        Counts violations that are not counted as rows.
        """
        found: dict[tuple[int, int], Verdicts] = {}
        for event in self._scopes.take_events():
            place = event.kind, event.slot
            if event.event in (Event.BEGAN, Event.ENDED):
                self._before.pop(place, None)
                found.pop(place, None)
            elif event.event is Event.STEPPED and (
                    verdicts := self._scopes.verdicts(*place)) is not None:
                found[place] = verdicts
        if not self._is_timed:
            for (kind, _), verdicts in found.items():
                self._count(kind, verdicts, label)
        return list(found.items())

    def _write_others(self, time: int, found: list[tuple[tuple[int, int], Verdicts]]) -> None:
        """Write a row for each scope whose verdicts have changed, the bundle last."""
        if not self._is_timed:
            return
        for (kind, slot), verdicts in sorted(found, key=lambda item: item[0]):
            if self._before.get((kind, slot), [None] * len(verdicts)) != verdicts:
                self._write(time, self._keys(kind, slot), {kind: verdicts})
            self._before[kind, slot] = verdicts

    def _keys(self, kind: int, slot: int) -> Keys:
        keys: list[str | None] = [None] * len(self._manifest.variables)
        if kind != BUNDLE:
            keys[self._manifest.kinds[kind].variables[0]] = self._scopes.key(
                kind, slot).decode(errors='replace')
        return tuple(keys)

    def _write(self, label: int, keys: Keys, found: dict[int, Verdicts]) -> None:
        cells = [''] * len(self._manifest.ids)
        for kind, verdicts in found.items():
            for place, verdict in zip(self._places[kind], verdicts, strict=True):
                cells[place] = '' if verdict is None else str(int(verdict))
            if self._is_timed:
                self._count(kind, verdicts, label)
        self._writer.writerow([seconds_text(label) if self._is_timed else label,
                               *('' if key is None else key for key in keys), *cells])
        self.rows += 1

    def _count(self, kind: int, verdicts: Verdicts, label: int) -> None:
        for place, verdict in zip(self._places[kind], verdicts, strict=True):
            if verdict is False:
                name = self._manifest.ids[place]
                self.violations[name] += 1
                self.first.setdefault(name, label)

    @property
    def beyond(self) -> list[Beyond]:
        """The variables whose keys were more than `most`."""
        found = [(kind.variables[0], self._scopes.counts(place).beyond)
                 for place, kind in enumerate(self._manifest.kinds)]
        return [Beyond(self._manifest.variables[variable].name,
                       self._manifest.variables[variable].most, rows)
                for variable, rows in found if rows]


class _Inputs:
    """The inputs of all scopes: which have columns, and where their values go."""

    def __init__(self, manifest: Manifest) -> None:
        bundle = [(index, item) for index, item in enumerate(manifest.inputs)
                  if item.source is not InputSource.INSTANCES]
        self.shared = {item.name: index for index, item in bundle}
        self.receptions = [index for index, item in bundle
                           if item.source is InputSource.RECEIVED]
        self.keyed = [{item.name: index for index, item in enumerate(kind.manifest.inputs)
                       if kind.shared[index] is None} for kind in manifest.kinds]
        own: dict[str, ManifestInput] = {
            kind.manifest.inputs[index].name: kind.manifest.inputs[index]
            for kind, names in zip(manifest.kinds, self.keyed, strict=True)
            for index in names.values()}
        self.all = tuple(chain((item for _, item in bundle), own.values()))
        self.variable_of = {name: kind.variables[0] for kind, names in zip(
            manifest.kinds, self.keyed, strict=True) for name in names}
