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
Recordings in a page, and why a verdict is false: the report of `bag`, of a stretch of it.

Times of answers are in seconds since the begin of what is judged, or numbers of steps.
"""

from array import array
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any, TypeAlias

from fret_monitor.bag.check import (
    AnyBatch, AnyRecording, compiled, opened, read_bundle, run, Selection, Watch,
)
from fret_monitor.bag.evidence import Occurrence
from fret_monitor.bag.moments import Anchor, Moment
from fret_monitor.bag.overview import Stretch
from fret_monitor.bag.report import examine, RecordingReport
from fret_monitor.bag.trace import KeyedRowBatch, Trace
from fret_monitor.build import Reading
from fret_monitor.bundle.source_file import ReadFile
from fret_monitor.logic.specification import Signal
from fret_monitor.messages.installed import find_message
from fret_monitor.model.policies import Policy, Report
from fret_monitor.model.values import ValueType
from fret_monitor.native.monitor import Monitor
from fret_monitor.runtime.engine import Engine
from fret_monitor.runtime.thinning import Thinning, TimeWindow
from fret_monitor.studio.values import Refused, runs, shown

Answer: TypeAlias = dict[str, Any]

MOST_ROWS = 5_000
"""Messages of a stretch that is taken over, each of which becomes a step."""

_EVEN_ROWS = 500  # under `timed`
_MOST_LISTED = 2_000  # occurrences that a page can step through
_SECOND_NS = 10 ** 9


def stretch_of(first: float, last: float) -> Stretch:
    """Return the stretch of a recording from a time to another, in seconds since its begin."""
    found = Stretch(round(float(first) * _SECOND_NS), round(float(last) * _SECOND_NS))
    if not 0 <= found.first < found.last <= 10 ** 18:
        raise Refused('a stretch of a recording begins before it ends')
    return found


def report(bundle: Path, path: Path, read_file: ReadFile, stretch: Stretch | None) -> Answer:
    """Return the report of a recording as HTML, with what is drawn in it, and its occurrences."""
    with opened(path) as (recording, find):
        reading = read_bundle(bundle, Selection(), find, read_file)
        found = examine(bundle, reading, recording, find, Selection(), stretch=stretch)
    occurrences = sorted(((begin - found.result.begin) / _SECOND_NS, item.id)
                         for item in found.result.findings for begin, _ in item.spans)
    drawn = [((item.start.time - found.result.begin) / _SECOND_NS, findings.id)
             for findings, items in zip(found.result.findings, found.occurrences)
             for item in items]
    return {'html': ''.join(found.body()), 'data': found.data(), 'drawn': drawn,
            'length': (found.result.end - found.result.begin) / _SECOND_NS,
            'occurrences': occurrences[:_MOST_LISTED]}


def why(reading: Reading, trace: Path, requirement: str, time: int, step: int) -> Answer | None:
    """
    Return what has led to the violation of a requirement at a time of a trace.

    None if it is not violated then. `step` is the time between two rows; without a column `time`,
    that is a second or the period.
    """
    specification = reading.specification
    part = replace(reading, specification=replace(
        specification, actions=(), gates=(), properties=tuple(
            replace(item, report=Report.ONSET, on_violation=(), on_end=())
            for item in specification.properties if item.id == requirement)))
    found = examine(trace, part, Trace(trace), find_message, Selection(),
                    stretch=Stretch(time, time))
    for item in found.occurrences[0]:
        if not item.is_open and item.start.time <= time and (item.end is None or time < item.end):
            return _marks(found, item, step)
    return None


def _marks(found: RecordingReport, item: Occurrence, step: int) -> Answer:
    """Return an occurrence with its times in steps, as numbers of rows."""
    trigger = item.trigger
    return {
        'data': found.data(), 'place': found.occurrences[0].index(item),
        'begin': item.start.time / step, 'end': None if item.end is None else item.end / step,
        'trigger': None if trigger is None else trigger / step, 'isDeadline': item.is_deadline,
        'values': [list(pair) for pair in item.start.values], 'silent': item.start.silent}


def taken(bundle: Path, path: Path, read_file: ReadFile, stretch: Stretch) -> Answer:
    """
    Return the inputs over a stretch of a recording, as a trace of the page.

    Under `timed` and `periodic` the steps are evenly spaced; else there is one for each message.
    """
    with opened(path) as (recording, find):
        reading = read_bundle(bundle, Selection(), find, read_file)
        if reading.specification.instance_variables:
            raise Refused('a stretch of a bundle with for_each cannot be taken over: '
                          'its inputs have many values at one step')
        monitor = compiled(reading).monitor
        first, last = stretch.within(recording.start, recording.end)
        period = _period(reading, last - first)
        rows = _TakenRows(monitor, recording, first, last)
        times = rows.even(period) if period else rows.of_messages()
    columns = {signal.name: rows.column(index, signal)
               for index, signal in enumerate(reading.specification.signals)}
    return {
        'steps': times, 'period': period / _SECOND_NS if period else None,
        'values': {name: changes for name, (changes, _) in columns.items()},
        'late': [name for name, (_, is_late) in columns.items() if is_late]}


def _period(reading: Reading, length: int) -> int:
    """Return the time between two steps of a stretch (ns); 0: there is one for each message."""
    specification = reading.specification
    match specification.policy:
        case Policy.TIMED:
            wanted = max(1, length // _EVEN_ROWS)
            power = int('1' + '0' * (len(str(wanted)) - 1))
            return next(k * power for k in (1, 2, 5, 10) if k * power >= wanted)
        case Policy.PERIODIC:
            return round((specification.period or Fraction(1)) * _SECOND_NS)
        case _:
            return 0


class _TakenRows:
    """The values of all inputs at some instants of a recording."""

    def __init__(self, monitor: Monitor, recording: AnyRecording, first: int, last: int) -> None:
        self._monitor = monitor
        self._recording = recording
        self._first, self._last = first, last
        self._count = 0
        self._thinning: Thinning | None = None

    def even(self, period: int) -> int:
        """Take the values at evenly spaced instants, and return their number."""
        self._count = (self._last - self._first) // period + 1
        _refuse_many(self._count, 'step')
        # The last value of a part is that at its end.
        begin = self._first - period + 1
        thinning = self._windows(begin, begin + self._count * period - 1)
        self._read(lambda engine, batch: batch.add_to(thinning, engine))
        return self._count

    def of_messages(self) -> int:
        """Take the values after each message, and return the number of messages."""
        found: set[int] = set()
        self._read(lambda engine, batch: found.update(
            time for time in batch.times if self._first <= time <= self._last))
        _refuse_many(len(found), 'message')
        times = sorted(found)
        self._count = len(times)
        if not times:
            raise Refused('there is no message of an input in this stretch')
        thinning = self._windows(0, self._count - 1)

        def watch(engine: Engine, batch: AnyBatch) -> None:
            places = array('q', (
                bisect_right(times, time) - 1 if time <= self._last else self._count
                for time in batch.times))
            assert not isinstance(batch, KeyedRowBatch), '`taken` refuses instances'
            batch.at(places).add_to(thinning, engine)

        self._read(watch)
        return self._count

    def _windows(self, begin: int, end: int) -> Thinning:
        self._thinning = Thinning(self._monitor, [
            TimeWindow(index, begin, end, self._count)
            for index, _ in enumerate(self._monitor.manifest.inputs)])
        return self._thinning

    def _read(self, watch: Watch) -> None:
        run(self._monitor, self._recording, Selection(end=Moment(Anchor.EPOCH, self._last)),
            watch=watch, checks_remaps=False)

    def column(self, index: int, signal: Signal) -> tuple[Sequence[tuple[int, Any]], bool]:
        """Return the changes of an input, and whether its first value came later."""
        assert self._thinning is not None, 'the recording was read'
        values = {part.place: part.last for part in self._thinning.parts(index)}
        before = self._thinning.before(index)
        is_late = before is None and 0 not in values
        value = before if before is not None else next(iter(values.values()), 0.0)
        found = []
        for step in range(self._count):
            value = values.get(step, value)
            found.append(shown(_typed(value, signal), signal))
        return runs(found), is_late


def _typed(value: float, signal: Signal) -> bool | int | float:
    if signal.type is ValueType.BOOL:
        return value != 0
    return value if signal.type.is_float else int(value)


def _refuse_many(count: int, what: str) -> None:
    if count > MOST_ROWS:
        raise Refused(f'this stretch has {count:,} {what}s: choose one with at most '
                      f'{MOST_ROWS:,}')
