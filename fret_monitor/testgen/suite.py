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
The tests of a bundle: obligations, the traces that meet them, and what is not covered.

The traces of a requirement vary its own inputs; the other inputs of the bundle keep one value.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from importlib.util import find_spec
from itertools import batched
from random import Random

from fret_monitor.build import Reading
from fret_monitor.logic.specification import Property, Signal, Specification
from fret_monitor.model.policies import Policy
from fret_monitor.model.progress import no_progress, Progress
from fret_monitor.testgen.obligations import Kind, mapped, Obligation, obligations
from fret_monitor.testgen.recorded import history, Recorded
from fret_monitor.testgen.search import (
    alone, exactly, explore_alone, explore_together, SearchTask, together,
)
from fret_monitor.testgen.variants import Variants, variants
from fret_monitor.traces.deadline import Deadline, OutOfTime
from fret_monitor.traces.sampled import grid_of, sampled, sampled_formulas
from fret_monitor.traces.search import Budget
from fret_monitor.traces.subject import Observation, observed, read_by
from fret_monitor.traces.trace import Row, Run, Value
from fret_monitor.traces.trials import Trials

_TOGETHER = 50  # requirements, or goals, that are compiled to one library


class CoverageAnswer(Enum):
    """What is known of an obligation."""

    COVERED = 'covered'
    UNREACHABLE = 'unreachable'
    UNKNOWN = 'unknown'


@dataclass(frozen=True)
class Case:
    """
    A trace of a requirement, over all inputs of the bundle.

    `number` counts the traces of the requirement from 1; `own` is the trace over its inputs.
    """

    requirement: Property
    number: int
    trace: Recorded
    own: Recorded
    shows: tuple[str, ...]


@dataclass(frozen=True)
class Covered:
    """
    An obligation and its answer; `detail` is the proof, or why it is unknown.

    `cases` are the numbers of one trace or of a pair, `ticks` the step (under `timed`, nanosecond)
    of each at which it shows.
    """

    requirement: str
    kind: Kind
    what: str
    answer: CoverageAnswer
    detail: str = ''
    cases: tuple[int, ...] = ()
    ticks: tuple[int, ...] = ()


@dataclass(frozen=True)
class Suite:
    """The tests of a bundle; `is_partial` if the time was over before the search had ended."""

    specification: Specification
    cases: tuple[Case, ...]
    covered: tuple[Covered, ...]
    is_partial: bool


@dataclass
class _SuiteSearch:
    """The tasks of a bundle, and what they share."""

    specification: Specification
    tasks: Sequence[SearchTask]
    deadline: Deadline
    report: Callable[[float, str], None]
    budget: Budget = field(default_factory=Budget)

    def run(self) -> None:
        count = len(self.tasks)
        for batch in batched(self.tasks, _TOGETHER):
            wanted = [(task, together(task)) for task in batch]
            compiled = iter(self._compiled([each for _, group in wanted for each in group]))
            for task, group in wanted:
                self.report(0.6 * self.tasks.index(task) / count, task.item.id)
                trials = [next(compiled) for _ in group]
                explore_together(task, trials, self.budget, self.deadline)
        left = [(task, number, each) for task in self.tasks for number, each in alone(task)]
        for place, some in enumerate(batched(left, _TOGETHER)):
            compiled = iter(self._compiled([each for _, _, each in some]))
            for task, number, _ in some:
                self.report(0.6 + 0.3 * place * _TOGETHER / len(left), task.item.id)
                explore_alone(task, number, next(compiled), self.budget, self.deadline)
        self._prove()

    def _compiled(self, wanted: Sequence[Observation]) -> list[Trials]:
        self.deadline.check()
        return observed(self.specification, wanted) if wanted else []

    def _prove(self) -> None:
        """Ask the solver about what is left."""
        if find_spec('z3') is None:
            return
        from fret_monitor.testgen.proofs import prove_never
        for task in self.tasks:
            for number, each in exactly(task):
                self.report(0.9, task.item.id)
                found = prove_never(self.specification, each.item, each.signals, self.deadline)
                if found.is_proved:
                    task.proofs[number] = f'proved by induction over {found.steps} steps'
                elif task.grid is None and (found.rows is None or not task.offer(
                        number, tuple(Run(row, 1) for row in found.rows))):
                    before = task.doubts.get(number, '')
                    task.doubts[number] = ', '.join(filter(None, (
                        before, f'none of up to {found.steps} steps' if found.steps else '')))


def make_suite(reading: Reading, seconds: float, progress: Progress = no_progress) -> Suite:
    """
    Return the tests of a bundle that is read, searched for at most some seconds.

    Raises
    ------
    NativeError
        if there is no C compiler, or it fails.
    """
    deadline = Deadline(seconds)
    tasks = _tasks(reading)
    search = _SuiteSearch(reading.specification, tasks, deadline, progress)
    is_partial = False
    try:
        search.run()
    except OutOfTime:
        is_partial = True
    progress(0.95, 'writing')
    cases: list[Case] = []
    covered: list[Covered] = []
    for task in tasks:
        own, answers = _reduced(task, reading.specification.signals, is_partial)
        cases += own
        covered += answers
    return Suite(reading.specification, tuple(cases), tuple(covered), is_partial)


def _tasks(reading: Reading) -> list[SearchTask]:
    specification = reading.specification
    is_timed = specification.policy is Policy.TIMED
    grids = {item.id: grid_of(item) if is_timed else 1 for item in specification.properties}
    bundle = reading.bundle
    exact = variants(bundle, dict.fromkeys(grids, 1)) if bundle else {}
    coarse = variants(bundle, grids) if bundle and is_timed else exact
    return [_task(item, specification, grids[item.id] if is_timed else None,
                  exact.get(item.id), coarse.get(item.id)) for item in specification.properties]


def _task(item: Property, specification: Specification, grid: int | None,
          exact: Variants | None, coarse: Variants | None) -> SearchTask:
    values = {signal.name: signal.values for signal in specification.signals if signal.values}
    signals = read_by(specification, item)
    wanted = obligations(item, exact, 1, grid or 1, values, is_timed=grid is not None)
    if grid is None:
        return SearchTask(item, wanted, item, wanted, signals, None, Random(0))
    searched = [mapped(each, lambda roots: sampled_formulas(roots, grid)) for each
                in obligations(item, coarse, grid, grid, values, is_timed=True)]
    searched = [_on_grid(each, item, grid) for each in searched]
    by_name = {(each.kind, each.what): each for each in searched}
    pairs = [(each, by_name[each.kind, each.what]) for each in wanted
             if (each.kind, each.what) in by_name]
    return SearchTask(item, [each for each, _ in pairs], sampled(item, grid),
                      [each for _, each in pairs], signals, grid, Random(0))


def _on_grid(each: Obligation, item: Property, grid: int) -> Obligation:
    """Return an obligation with its proposition and mutant on the grid."""
    nodes = [node for node in (each.proposition, each.mutant) if node is not None]
    found = sampled_formulas(nodes, grid)
    return replace(
        each, proposition=None if each.proposition is None else found[each.proposition],
        mutant=None if each.mutant is None else found[each.mutant])


# -- which traces to keep ----------------------------------------------------------------------

def _reduced(task: SearchTask, signals: Sequence[Signal],
             is_partial: bool) -> tuple[list[Case], list[Covered]]:
    """Return the traces of a requirement without those that others contain, and the answers."""
    kept = _kept(task)
    shown: dict[int, list[str]] = {}
    answers = []
    for number, each in enumerate(task.obligations):
        if number in task.found:
            places = [_place(trace, task, each, kept) for trace in task.found[number]]
            for place, _ in places:
                shown.setdefault(place, []).append(each.what)
            answers.append(Covered(
                task.item.id, each.kind, each.what, CoverageAnswer.COVERED,
                cases=tuple(place + 1 for place, _ in places),
                ticks=tuple(tick for _, tick in places)))
        elif number in task.proofs:
            answers.append(Covered(task.item.id, each.kind, each.what, CoverageAnswer.UNREACHABLE,
                                   task.proofs[number]))
        else:
            reason = task.doubts.get(number, '') or (
                'out of time' if is_partial else 'none found')
            answers.append(
                Covered(task.item.id, each.kind, each.what, CoverageAnswer.UNKNOWN, reason))
    cases = [Case(task.item, place + 1, _widened(trace, task, signals), trace,
                  tuple(shown.get(place, ()))) for place, trace in enumerate(kept)]
    return cases, answers


def _kept(task: SearchTask) -> list[Recorded]:
    """Return the traces that are needed, short ones first."""
    wanted = sorted(((trace, number) for number, traces in task.found.items()
                     for trace in traces), key=lambda each: -each[0].end)
    kept: list[Recorded] = []
    for trace, number in wanted:
        each = task.obligations[number]
        if _tick_in(trace, task, each, kept) is None:
            kept.append(trace)
    return list(reversed(kept))


def _place(trace: Recorded, task: SearchTask, each: Obligation,
           kept: Sequence[Recorded]) -> tuple[int, int]:
    found = _tick_in(trace, task, each, kept)
    assert found is not None
    return found


def _tick_in(trace: Recorded, task: SearchTask, each: Obligation,
             kept: Sequence[Recorded]) -> tuple[int, int] | None:
    """Return the place of a trace that shows what `trace` does, and the tick."""
    for place, other in enumerate(kept):
        if _begins_with(other, trace):
            return place, trace.end
    if each.is_pair:
        return None
    for place, other in enumerate(kept):
        met = history(each.goal, each.feedback, task.names, other)
        tick = next((start for start, value in met if value), None)
        if tick is not None:
            return place, tick
    return None


def _begins_with(trace: Recorded, start: Recorded) -> bool:
    count = len(start.ticks)
    following = trace.ticks[count] if count < len(trace.ticks) else trace.end + 1
    return (trace.ticks[:count] == start.ticks and start.end < following
            and repr(trace.rows[:count]) == repr(start.rows))


def _widened(trace: Recorded, task: SearchTask, signals: Sequence[Signal]) -> Recorded:
    """Return a trace of all inputs of a bundle."""
    places = {name: place for place, name in enumerate(task.names)}
    rows = tuple(_row(row, places, signals) for row in trace.rows)
    return replace(trace, rows=rows)


def _row(row: Row, places: dict[str, int], signals: Sequence[Signal]) -> Row:
    return tuple(row[places[signal.name]] if signal.name in places else _usual(signal)
                 for signal in signals)


def _usual(signal: Signal) -> Value:
    """Return the value of an input that a trace does not vary."""
    if signal.initial is not None:
        return signal.initial
    return False if not signal.type.is_number else 0.0 if signal.type.is_float else 0
