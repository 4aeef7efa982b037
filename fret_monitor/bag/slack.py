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

The recording is read once more, by a monitor of its own, whose requirements are violated while a
response is waited for.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
import csv
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from fret_monitor.bag.check import (
    AnyRecording, compiled, opened, read_bundle, RecordingResult, run, Selection,
)
from fret_monitor.bag.evidence import beside
from fret_monitor.bag.findings import MOST_KEPT, Slack
from fret_monitor.build import Reading
from fret_monitor.elaboration.durations import TimeScale
from fret_monitor.elaboration.fretish import has_deadline, required_so_far
from fret_monitor.elaboration.signals import FindMessage
from fret_monitor.explain.goals import begin_of, sentences_of, with_texts, written
from fret_monitor.language.sentence import Sentence
from fret_monitor.logic.formula import Formula
from fret_monitor.logic.specification import Property, Specification
from fret_monitor.model.manifest import Manifest
from fret_monitor.model.policies import Report, Stale
from fret_monitor.native.monitor import Monitor
from fret_monitor.runtime.evaluator import Violation
from fret_monitor.runtime.reporting import StatusRecord
from fret_monitor.traces.csv_trace import parse_seconds, TIME
from fret_monitor.traces.simulate import simulate


@dataclass(frozen=True)
class _Deadline:
    """
    A requirement with a deadline, `bound` steps or nanoseconds after its trigger.

    `lanes` are two requirements. One is violated from a trigger until its response, or until the
    end of the scope; the other from the first trigger on that came together with its response.
    """

    item: Property
    bound: int
    lanes: tuple[Property, Property]


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


def with_slack(check: Callable[[], RecordingResult], bundle: Path, path: Path,
               selection: Selection) -> RecordingResult:
    """
    Return what `check` finds in a recording, with the slack of sentences with a deadline.

    Raises
    ------
    CompileError
        as `check_recording`.
    """
    result = check()
    with opened(path) as (recording, find):
        add_slack(result, read_bundle(bundle, selection, find), recording, find, selection)
    return result


def add_slack(result: RecordingResult, reading: Reading, recording: AnyRecording,
              find: FindMessage, selection: Selection) -> None:
    """Add the slack of the sentences with a deadline to what was found in a recording."""
    deadlines = list(_deadlines(reading, find))
    if not deadlines:
        return
    waits = _Waits(_scale(reading.specification))
    lanes = run(_lanes_monitor(reading, deadlines), recording, replace(selection, margins=False),
                changes=[waits], checks_remaps=False)
    steps = {item.id: item.violations for item in lanes.findings}
    found = {each.item.id: waits.found(each, lanes.end, steps) for each in deadlines}
    for item in result.findings:
        if item.id in found:
            own = found[item.id]
            item.slack, item.waiting, item.slacks = own.slack, own.waiting, own.slacks


def slack_of_trace(reading: Reading, find: FindMessage, trace: Path,
                   until: int | None = None) -> dict[str, Found]:
    """
    Return by id the slack of the sentences with a deadline in a trace, as `simulate` takes it.

    Triggers and responses are numbers of rows, under `timed` times (ns).
    """
    deadlines = list(_deadlines(reading, find))
    if not deadlines:
        return {}
    waits = _Waits(_scale(reading.specification))
    with TemporaryDirectory() as folder:
        table = Path(folder, 'verdicts.csv')
        summary = simulate(_lanes_monitor(reading, deadlines), trace, table, until=until)
        with table.open(newline='', encoding='utf-8') as file:
            last = waits.take_table(csv.DictReader(file), [*summary.violations])
    end = last if until is None else until
    return {each.item.id: waits.found(each, end, summary.violations) for each in deadlines}


def _lanes_monitor(reading: Reading, deadlines: Sequence[_Deadline]) -> Monitor:
    """Compile the lanes; a response counts as it came, also while an input is silent."""
    specification = reading.specification
    return compiled(replace(reading, specification=replace(
        specification, properties=tuple(lane for each in deadlines for lane in each.lanes),
        signals=tuple(replace(item, stale=Stale.WARN) for item in specification.signals),
        has_margins=False, actions=(), gates=()))).monitor


def _scale(specification: Specification) -> TimeScale:
    return TimeScale(specification.policy, specification.period, specification.unit)


def _deadlines(reading: Reading, find: FindMessage) -> Iterator[_Deadline]:
    """Yield the requirements with a deadline."""
    bundle, specification = reading.bundle, reading.specification
    if bundle is None:
        return
    of_instances = {item.name for item in specification.signals if item.variables}
    items = {item.id: item for item in specification.properties
             if of_instances.isdisjoint(item.inputs)}
    sentences = {name: sentence for name, sentence in sentences_of(bundle, items).items()
                 if has_deadline(sentence)}
    found = with_texts(bundle, [
        (item, text) for item in bundle.requirements if item.id.value in sentences
        for text in _lane_texts(sentences[item.id.value])], find)
    for number, (waits, at_once) in enumerate(zip(found[::2], found[1::2], strict=True)):
        item, timing = items[waits.id], sentences[waits.id].timing
        assert timing is not None and timing.duration is not None
        yield _Deadline(item, _scale(specification).timing(timing.duration), (
            _lane(f'waits_{number}', waits, required_so_far(waits.formula), item, specification),
            _lane(f'at_once_{number}', at_once, at_once.formula, item, specification)))


def _lane_texts(sentence: Sentence) -> Iterator[str]:
    """Yield sentences that are violated while a response is missing, and where it is there."""
    start, name = begin_of(sentence), sentence.component.name
    response = written(sentence.response.span)
    # An `only` scope requires the negation of the sentence.
    some_time = 'always' if sentence.scope_kind.is_only else 'eventually'
    yield f'{start} {name} shall {some_time} satisfy ({response})'
    yield f'{start} {name} shall immediately satisfy !({response})'


def _lane(name: str, meant: Property, formula: Formula, item: Property,
          specification: Specification) -> Property:
    """Return a requirement with a formula that steps together with another one."""
    lane = beside(formula, replace(item, feedback=meant.feedback), specification)
    return replace(lane, id=name, handler=name, report=Report.ONSET, on_violation=(), on_end=())


class _Waits:
    """Finds how long each response of each sentence was waited for."""

    wants_details = False

    def __init__(self, scale: TimeScale) -> None:
        self._scale = scale
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
            at = parse_seconds(row[TIME]) if self._scale.is_timed else int(row['step'])
            for name in names:
                is_violated = row[name] == '0'
                if row[name] and is_violated != (name in self._open):
                    self._note(name, is_violated, at, at)
        return at

    def _note(self, name: str, is_begin: bool, step: int, time: int) -> None:
        if is_begin:
            self._open[name] = step, time
            return
        begin_step, begin = self._open.pop(name)
        length = time - begin if self._scale.is_timed else step - begin_step
        wait = _Wait(length, begin, time)
        self._over[name] += length
        if name not in self._longest or length > self._longest[name].length:
            self._longest[name] = wait
        kept = self._all.setdefault(name, [])
        if len(kept) < MOST_KEPT:
            kept.append(wait)

    def end(self, time: int) -> None:
        """End the run."""

    def found(self, deadline: _Deadline, end: int, steps: Mapping[str, int | None]) -> Found:
        """
        Return the slack of a sentence, and since when one is waited for with time left.

        `end` is that of the run (ns), and `steps` are those at which each lane was violated.
        """
        waits, at_once = (item.id for item in deadline.lanes)
        wait, last = self._longest.get(waits), self._last(waits, end, steps)
        kept = self._all.get(waits, [])
        waiting = None
        if last is not None and last.length <= deadline.bound:
            waiting = last.trigger
        elif last is not None:
            kept = [*kept, last]
            wait = last if wait is None or last.length > wait.length else wait
        if wait is None and at_once in self._open:
            _, time = self._open[at_once]
            wait = _Wait(0, time, time)
        slacks = tuple(self._slack(deadline.bound, item) for item in kept)
        return Found(None if wait is None else self._slack(deadline.bound, wait), waiting, slacks)

    def _last(self, name: str, end: int, steps: Mapping[str, int | None]) -> _Wait | None:
        """Return the wait that is not over when a run ends: how long it is at least."""
        if name not in self._open:
            return None
        _, begin = self._open[name]
        length = end + 1 - begin if self._scale.is_timed else \
            (steps[name] or 0) - self._over[name]
        return _Wait(length, begin, None)

    def _slack(self, bound: int, wait: _Wait) -> Slack:
        left = bound - wait.length
        period = self._scale.period
        if self._scale.is_timed:
            return Slack(left / 10**9, 's', wait.trigger, wait.until)
        if period is not None:
            return Slack(float(left * period), 's', wait.trigger, wait.until)
        return Slack(left, 'steps', wait.trigger, wait.until)
