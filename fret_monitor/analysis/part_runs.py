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

"""Runs of a part: those that the solver finds, and what the compiled monitor says of them."""

from collections.abc import Sequence

from fret_monitor.analysis.answers import Example
from fret_monitor.analysis.component import Component
from fret_monitor.analysis.letters import Values
from fret_monitor.analysis.replay import Replay, rows_of
from fret_monitor.analysis.unrolling import find_run, Found, Steps, Wanted
from fret_monitor.logic.specification import Specification
from fret_monitor.smt import terms as t
from fret_monitor.smt.terms import Term
from fret_monitor.traces.deadline import Deadline
from fret_monitor.traces.trace import Row


class PartRuns:
    """The runs of a part. Requirements that say `eventually` are violated at no step."""

    def __init__(self, component: Component, specification: Specification, replay: Replay,
                 deadline: Deadline) -> None:
        """`replay` runs the bundle."""
        self._component, self._specification = component, specification
        self._replay, self._deadline = replay, deadline
        self.steps = Steps(component.whole.state, component.inputs, component.domains)

    def everything(self, once: tuple[Term, ...] = ()) -> Wanted:
        """Return that all holds forever, and each of some terms once."""
        pending, verdicts = self._component.games.pending, self._component.whole.verdicts
        places = range(len(self._component.part.properties))
        return Wanted(t.all_of(verdicts[place] for place in places if place not in pending),
                      once=(*(verdicts[place] for place in places if place in pending), *once),
                      repeats=True)

    def find(self, wanted: Wanted, seconds: float) -> Found | None:
        """Return a short run; None if none was found."""
        return find_run(self.steps, wanted, self._deadline, seconds)

    def longest(self, seconds: float) -> tuple[Values, ...]:
        """Return the longest run found that violates at its last step only; empty if none was."""
        whole = self.everything().always
        found = find_run(self.steps, Wanted(whole, t.negation(whole)), self._deadline, seconds,
                         is_longest=True)
        return () if found is None else found.rows

    def rows(self, found: Sequence[Values]) -> tuple[Row, ...]:
        """Return a run as rows of the bundle."""
        return rows_of(found, self._specification.signals)

    def violated(self, rows: Sequence[Row]) -> list[set[str]]:
        """Return the requirements of the part that the compiled monitor violates at each step."""
        component = self._component
        names = [item.id for item in self._specification.properties]
        judged = {name for place, name in enumerate(component.part.ids)
                  if place not in component.games.pending}
        return [{name for name, holds in zip(names, line) if not holds} & judged
                for line in self._replay(rows, component.grid or 1)]

    def example(self, found: Sequence[Values]) -> Example | None:
        """
        Return a run that shows a no.

        None unless all requirements hold before its last step, and one does not at it.
        """
        if not found:
            return None
        rows = self.rows(found)
        *before, last = self.violated(rows)
        if any(before) or not last and not self._component.games.pending:
            return None
        return Example(rows, tuple(name for name in self._component.part.ids if name in last),
                       self._component.grid)
