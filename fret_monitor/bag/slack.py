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
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

from fret_monitor.bag.check import (
    compiled, opened, read_bundle, RecordingResult, run, Selection,
)
from fret_monitor.bag.evidence import beside
from fret_monitor.bag.findings import Slack
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
from fret_monitor.runtime.evaluator import Violation
from fret_monitor.runtime.reporting import StatusRecord


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


_Found = tuple[Slack | None, int | None]  # as in `Findings`: slack, waiting


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
    found = _slack_of_all(bundle, path, replace(selection, margins=False))
    for item in result.findings:
        item.slack, item.waiting = found.get(item.id, (None, None))
    return result


def _slack_of_all(bundle: Path, path: Path, selection: Selection) -> dict[str, _Found]:
    """Return by id the slack of the sentences with a deadline."""
    with opened(path) as (recording, find):
        reading = read_bundle(bundle, selection, find)
        specification = reading.specification
        deadlines = list(_deadlines(reading, find))
        if not deadlines:
            return {}
        # A response counts as it came, also while an input is silent.
        monitor = compiled(replace(reading, specification=replace(
            specification, properties=tuple(lane for each in deadlines for lane in each.lanes),
            signals=tuple(replace(item, stale=Stale.WARN) for item in specification.signals),
            actions=(), gates=()))).monitor
        waits = _Waits(_scale(specification))
        result = run(monitor, recording, selection, changes=[waits], checks_remaps=False)
    return {each.item.id: waits.found(each, result) for each in deadlines}


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
    """Finds the longest wait for a response of each sentence."""

    wants_details = False

    def __init__(self, scale: TimeScale) -> None:
        self._scale = scale
        self._open: dict[str, Violation] = {}
        self._over: Counter[str] = Counter()  # how long all waits together were that are over
        self._longest: dict[str, _Wait] = {}

    def begin(self, begin: int, end: int, manifest: Manifest) -> None:
        """Begin a run."""
        self._names = [item.id for item in manifest.numbered]

    def judged(self, requirement: int, time: int) -> None:
        """Take that nothing is waited for at the first step."""

    def change(self, violation: Violation, detail: StatusRecord | None) -> None:
        """Take that a wait begins, or that it is over."""
        name = self._names[violation.requirement]
        if not violation.is_recovery:
            self._open[name] = violation
            return
        begin = self._open.pop(name)
        length = violation.stamp - begin.stamp if self._scale.is_timed else \
            violation.step - begin.step
        self._over[name] += length
        if name not in self._longest or length > self._longest[name].length:
            self._longest[name] = _Wait(length, begin.stamp, violation.stamp)

    def end(self, time: int) -> None:
        """End the run."""

    def found(self, deadline: _Deadline, result: RecordingResult) -> _Found:
        """Return the slack of a sentence, and since when one is waited for with time left."""
        waits, at_once = (item.id for item in deadline.lanes)
        wait, last = self._longest.get(waits), self._last(waits, result)
        waiting = None
        if last is not None and last.length <= deadline.bound:
            waiting = last.trigger
        elif last is not None and (wait is None or last.length > wait.length):
            wait = last
        if wait is None and at_once in self._open:
            stamp = self._open[at_once].stamp
            wait = _Wait(0, stamp, stamp)
        return None if wait is None else self._slack(deadline.bound, wait), waiting

    def _last(self, name: str, result: RecordingResult) -> _Wait | None:
        """Return the wait that is not over when a run ends: how long it is at least."""
        begin = self._open.get(name)
        if begin is None:
            return None
        steps = next(item.violations for item in result.findings if item.id == name)
        length = result.end + 1 - begin.stamp if steps is None else steps - self._over[name]
        return _Wait(length, begin.stamp, None)

    def _slack(self, bound: int, wait: _Wait) -> Slack:
        left = bound - wait.length
        period = self._scale.period
        if self._scale.is_timed:
            return Slack(left / 10**9, 's', wait.trigger, wait.until)
        if period is not None:
            return Slack(float(left * period), 's', wait.trigger, wait.until)
        return Slack(left, 'steps', wait.trigger, wait.until)
