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
Short runs of many requirements, for answers that need no more than a run.

Fixed points over many requirements can be too large where runs of a few steps are found at once:
one on which all hold forever, one on which a trigger comes, too, and one on which a requirement
is violated alone. The solver finds them, one step more at a time.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
import time
from typing import Any

from fret_monitor.analysis.answers import Answer, Question
from fret_monitor.analysis.component import Component
from fret_monitor.analysis.letters import Values
from fret_monitor.analysis.part_runs import PartRuns
from fret_monitor.analysis.unrolling import Steps, Unrolling, Wanted
from fret_monitor.model.diagnostics import counted
from fret_monitor.smt import terms as t
from fret_monitor.smt.concrete import NoValue
from fret_monitor.smt.linear import NotLinear
from fret_monitor.smt.terms import Term
from fret_monitor.traces.deadline import Deadline
import z3

_MOST_STEPS = 8
_QUERY_S = 3.0


@dataclass(frozen=True)
class _ShortRun:
    """
    A run that is computed with floats.

    With `alone`, that requirement is violated at its last step, and all others hold. Without, all
    hold, its last step can be repeated forever, and `triggered` are those whose trigger comes.
    """

    rows: tuple[Values, ...]
    triggered: frozenset[int] = frozenset()
    alone: int | None = None


def shown_by_short_runs(component: Component, runs: PartRuns, deadline: Deadline,
                        seconds: float) -> Iterator[Answer]:
    """
    Yield what short runs show, confirmed by the compiled monitor.

    It ends when each requirement is triggered in a run and violated alone in one, after about as
    many seconds, or after runs of a few steps.
    """
    ids = component.part.ids
    violable: set[int] = set()
    triggered: set[int] = set()
    is_consistent = False
    for found in _short_runs(component, runs.steps, deadline, seconds):
        violated = runs.violated(runs.rows(found.rows))
        if found.alone is None and not any(violated):
            is_consistent = True
            triggered |= found.triggered
            yield Answer(Question.CONSISTENCY, ids, True, (
                f'a run that repeats from step {len(found.rows) - 1} on after '
                f'{counted(len(found.rows), "step")}, replayed in the compiled monitor'))
        elif found.alone is not None and violated[-1] == {ids[found.alone]} \
                and not any(violated[:-1]):
            violable.add(found.alone)
        if is_consistent:  # else a violation would not show that a requirement is needed
            yield from _needed(component, triggered, violable)


def _needed(component: Component, triggered: Collection[int],
            violable: Collection[int]) -> Iterator[Answer]:
    """Yield that requirements are not redundant, and not vacuous."""
    for place in violable:
        ids = (component.part.ids[place],)
        yield Answer(Question.REDUNDANCY, ids, False, 'an assumption'
                     if place in component.games.assumptions else 'it can be violated alone')
        if place not in component.triggers:
            yield Answer(Question.VACUITY, ids, False, 'it can be violated')
        elif place in triggered:
            yield Answer(Question.VACUITY, ids, False, 'its trigger can come')


def _short_runs(component: Component, steps: Steps, deadline: Deadline,
                seconds: float) -> Iterator[_ShortRun]:
    verdicts = component.whole.verdicts
    with suppress(NotLinear, NoValue):
        yield from _Search(
            steps, [verdicts[place] for place in range(len(component.part.ids))],
            {place: verdicts[item] for place, item in component.triggers.items()}, deadline,
            seconds).runs()


class _Search:
    """
    The steps so far, and what has been found.

    `triggers` are false where a trigger comes.
    """

    def __init__(self, steps: Steps, verdicts: Sequence[Term], triggers: Mapping[int, Term],
                 deadline: Deadline, seconds: float) -> None:
        self._deadline, self._end = deadline, time.monotonic() + seconds
        self._count, self._places = len(verdicts), list(triggers)
        self._unrolling = Unrolling(
            steps, Wanted(t.TRUE, t.FALSE, (*verdicts, *triggers.values())), _QUERY_S)
        self._held: list[list[Any]] = []
        self._triggers: list[list[Any]] = []
        self._open = set(triggers)
        self._not_alone = set(range(len(verdicts)))
        self._repeats = False

    def runs(self) -> Iterator[_ShortRun]:
        searched = 0
        for count in range(1, _MOST_STEPS + 1):
            self._deadline.check()
            self._extend(count)
            yield from self._repeating()
            if self._repeats:  # else this would not show that a requirement is needed
                for step in range(searched, count):
                    yield from self._violating(step)
                searched = count
            if self._is_over or self._repeats and not self._open and not self._not_alone:
                return

    @property
    def _is_over(self) -> bool:
        return time.monotonic() > self._end or self._deadline.is_over

    def _extend(self, count: int) -> None:
        self._unrolling.extended(count)
        names = [z3.Bool(f'once.{count}.{place}')
                 for place in range(self._count + len(self._places))]
        self._unrolling.solver.add(*(
            name == item for name, item in zip(names, self._unrolling.once(count - 1))))
        self._held.append(names[:self._count])
        self._triggers.append(names[self._count:])

    def _repeating(self) -> Iterator[_ShortRun]:
        """Yield runs on which all hold forever, with as many triggers as are found."""
        stays = z3.Bool(f'stays.{len(self._held)}')
        self._unrolling.solver.add(stays == self._unrolling.stays())
        always = [stays, *(item for step in self._held for item in step)]
        if not self._repeats:
            yield from self._triggering(always, [])
        if self._repeats:
            yield from self._triggering(always, sorted(self._open))

    def _triggering(self, always: Sequence[Any], places: Sequence[int]) -> Iterator[_ShortRun]:
        """Yield a run with some triggers, or else runs with parts of them."""
        if self._is_over:
            return
        numbers = [self._places.index(place) for place in places]
        found = self._computed([*always, *(
            z3.Or(*(z3.Not(step[number]) for step in self._triggers)) for number in numbers)])
        if found is not None:
            rows, states, flags = found
            if repr(states[-1]) == repr(states[-2]) and self._all_hold(flags):
                come = {place for number, place in enumerate(self._places)
                        if not all(flag[2 + self._count + number] for flag in flags)}
                self._open -= come
                self._repeats = True
                yield _ShortRun(tuple(rows), frozenset(come))
        elif len(places) > 1:
            half = len(places) // 2
            for some in (places[:half], places[half:]):
                yield from self._triggering(
                    always, [place for place in some if place in self._open])

    def _all_hold(self, flags: Sequence[Sequence[Any]]) -> bool:
        return all(all(flag[2:2 + self._count]) for flag in flags)

    def _violating(self, step: int) -> Iterator[_ShortRun]:
        """Yield, for each requirement, a run to a step at which it alone is violated."""
        held, last = [item for line in self._held[:step] for item in line], self._held[step]
        for place in sorted(self._not_alone):
            if self._is_over:
                return
            found = self._computed([*held, z3.Not(last[place]),
                                    *(item for other, item in enumerate(last) if other != place)])
            if found is None:
                continue
            rows, _, flags = found
            verdicts = flags[step][2:2 + self._count]
            if self._all_hold(flags[:step]) and [
                    other for other, value in enumerate(verdicts) if not value] == [place]:
                self._not_alone.discard(place)
                yield _ShortRun(tuple(rows[:step + 1]), alone=place)

    def _computed(self, given: Sequence[Any]) -> Any:
        """Return a run on which some literals are true, as floats have it; None if none."""
        solver = self._unrolling.solver
        return self._unrolling.computed(solver.model()) if solver.check(*given) == z3.sat else None
