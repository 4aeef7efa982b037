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
How much time was left until the deadlines of FRETish sentences when their responses came.

A monitor beside the bundle's has requirements that are violated while a response is waited for
(`deadlines.py`).
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
import csv
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from fret_monitor.bag.check import Aside, compiled, RecordingResult, Selection, variant_of
from fret_monitor.bag.findings import Findings, MOST_KEPT, Slack
from fret_monitor.bag.waits import Lanes, lanes_of
from fret_monitor.model.manifest import Manifest
from fret_monitor.model.policies import Policy
from fret_monitor.native.monitor import Monitor
from fret_monitor.runtime.evaluator import Violation
from fret_monitor.runtime.reporting import StatusRecord
from fret_monitor.start import Variant
from fret_monitor.traces.csv_trace import parse_seconds, TIME
from fret_monitor.traces.simulate import simulate

if TYPE_CHECKING:  # what is in the cache needs no parser
    from fret_monitor.build import Reading
    from fret_monitor.elaboration.signals import FindMessage


@dataclass(frozen=True)
class _Wait:
    """How long a response was waited for, in steps or nanoseconds, and when (ns)."""

    length: int
    trigger: int
    until: int | None


@dataclass(frozen=True)
class Found:
    """As in `Findings`: the least slack, a trigger that waits, and the slack of each trigger."""

    slack: Slack | None
    waiting: int | None
    slacks: tuple[Slack, ...] = ()


def slack_asides(bundle: Path, selection: Selection, find: 'FindMessage') -> Iterator[Aside]:
    """Yield the monitor that finds the slack of sentences with a deadline, if there are any."""
    yield from _asides(variant_of(
        bundle, replace(selection, margins=False), find, _DEADLINES).monitor)


def slack_asides_of(reading: 'Reading', find: 'FindMessage') -> Iterator[Aside]:
    """Do as `slack_asides`, for a bundle that was read."""
    yield from _asides(compiled(_make(reading, find)).monitor)


def _asides(monitor: Monitor) -> Iterator[Aside]:
    lanes = [*lanes_of(item.id for item in monitor.manifest.numbered)]
    waits = _Waits(monitor.manifest)

    def note(result: RecordingResult, findings: Sequence[Findings]) -> None:
        steps = {item.id: item.violations for item in result.findings}
        by_id = {item.id: item for item in findings}
        for each in lanes:
            found, item = waits.found(each, result.end, steps), by_id[each.id]
            item.slack, item.waiting, item.slacks = found.slack, found.waiting, found.slacks

    if lanes:
        yield Aside(monitor, note, [waits])


def slack_of_trace(reading: 'Reading', find: 'FindMessage', trace: Path,
                   until: int | None = None) -> dict[str, Found]:
    """
    Return by id the slack of the sentences with a deadline in a trace, as `simulate` takes it.

    Triggers and responses are numbers of rows, under `timed` times (ns).
    """
    with_lanes = _make(reading, find)
    lanes = [*lanes_of(item.id for item in with_lanes.specification.properties)]
    if not lanes:
        return {}
    monitor = compiled(with_lanes).monitor
    waits = _Waits(monitor.manifest)
    with TemporaryDirectory() as folder:
        table = Path(folder, 'verdicts.csv')
        summary = simulate(monitor, trace, table, until=until)
        with table.open(newline='', encoding='utf-8') as file:
            last = waits.take_table(csv.DictReader(file), [*summary.violations])
    end = last if until is None else until
    return {each.id: waits.found(each, end, summary.violations) for each in lanes}


def _make(reading: 'Reading', find: 'FindMessage') -> 'Reading':
    from fret_monitor.bag.deadlines import with_lanes
    return with_lanes(reading, find)


_DEADLINES = Variant('deadlines', _make)


class _Waits:
    """Finds how long each response of each sentence was waited for."""

    wants_details = False

    def __init__(self, manifest: Manifest) -> None:
        self._is_timed, self._period = manifest.policy is Policy.TIMED, manifest.period
        self._open: dict[str, tuple[int, int]] = {}  # lanes: the step and the time since which
        self._over: Counter[str] = Counter()  # how long all waits together were that are over
        self._longest: dict[str, _Wait] = {}
        self._all: dict[str, list[_Wait]] = {}  # the first `MOST_KEPT` that are over

    def begin(self, begin: int, end: int, manifest: Manifest) -> None:
        """Begin a run."""
        self._names = [item.id for item in manifest.numbered]

    def judged(self, requirement: int, time: int) -> None:
        """Take that nothing is waited for at the first step."""

    def change(self, violation: Violation, detail: StatusRecord | None) -> None:
        """Take that a wait begins, or that it is over."""
        self._note(self._names[violation.requirement], not violation.is_recovery,
                   violation.step, violation.stamp)

    def take_table(self, rows: Iterable[Mapping[str, str]], names: Sequence[str]) -> int:
        """Take the verdicts of the lanes in a table; return the step or time of its last row."""
        at = 0
        for row in rows:
            at = parse_seconds(row[TIME]) if self._is_timed else int(row['step'])
            for name in names:
                is_violated = row[name] == '0'
                if row[name] and is_violated != (name in self._open):
                    self._note(name, is_violated, at, at)
        return at

    def _note(self, name: str, is_begin: bool, step: int, time: int) -> None:
        if is_begin:
            self._open[name] = step, time
            return
        if name not in self._open:  # it began before what is judged
            return
        begin_step, begin = self._open.pop(name)
        length = time - begin if self._is_timed else step - begin_step
        wait = _Wait(length, begin, time)
        self._over[name] += length
        if name not in self._longest or length > self._longest[name].length:
            self._longest[name] = wait
        kept = self._all.setdefault(name, [])
        if len(kept) < MOST_KEPT:
            kept.append(wait)

    def end(self, time: int) -> None:
        """End the run."""

    def found(self, lanes: Lanes, end: int, steps: Mapping[str, int | None]) -> Found:
        """
        Return the slack of a sentence, and since when one is waited for with time left.

        `end` is that of the run (ns), and `steps` are those at which each lane was violated.
        """
        waits, at_once = lanes.waits, lanes.at_once
        wait, last = self._longest.get(waits), self._last(waits, end, steps)
        kept = self._all.get(waits, [])
        waiting = None
        if last is not None and last.length <= lanes.bound:
            waiting = last.trigger
        elif last is not None:
            kept = [*kept, last]
            wait = last if wait is None or last.length > wait.length else wait
        if wait is None and at_once in self._open:
            _, time = self._open[at_once]
            wait = _Wait(0, time, time)
        slacks = tuple(self._slack(lanes.bound, item) for item in kept)
        return Found(None if wait is None else self._slack(lanes.bound, wait), waiting, slacks)

    def _last(self, name: str, end: int, steps: Mapping[str, int | None]) -> _Wait | None:
        """Return the wait that is not over when a run ends: how long it is at least."""
        if name not in self._open:
            return None
        _, begin = self._open[name]
        length = end + 1 - begin if self._is_timed else \
            (steps[name] or 0) - self._over[name]
        return _Wait(length, begin, None)

    def _slack(self, bound: int, wait: _Wait) -> Slack:
        left = bound - wait.length
        if self._is_timed:
            return Slack(left / 10**9, 's', wait.trigger, wait.until)
        if self._period is not None:
            period = Fraction(repr(self._period))
            return Slack(float(left * period), 's', wait.trigger, wait.until)
        return Slack(left, 'steps', wait.trigger, wait.until)
