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
Runs on a grid of time that show, confirmed in real time, that a timed requirement is needed.

In nanoseconds, a run in which a bound runs out has as many steps; on the grid it has a few.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from fret_monitor.analysis.answers import Answer, Question
from fret_monitor.analysis.component import Component, trigger_properties
from fret_monitor.analysis.diagrams import Node
from fret_monitor.analysis.part_runs import PartRuns
from fret_monitor.analysis.runs import run_to, Runner
from fret_monitor.logic import formula as f
from fret_monitor.logic.formula import Formula
from fret_monitor.logic.specification import Property, Specification
from fret_monitor.logic.timed import evaluate_timed, TimedTrace
from fret_monitor.model.times import time_text
from fret_monitor.traces.trace import Row

_MOST_ROWS = 2000


class GridRuns:
    """Runs of the system of a part on a grid of time."""

    def __init__(self, component: Component, runs: PartRuns,
                 specification: Specification) -> None:
        """Store the system, and what runs the bundle in real time."""
        self._component, self._games = component, component.games
        self._runs, self._specification = runs, specification

    def answer(self, blank: Answer, place: int, denials: Mapping[str, Formula]) -> Answer | None:
        """Return that a requirement is not redundant, or not vacuous, if runs show it."""
        grid = self._component.grid
        assert grid is not None
        shown = self._is_violated_alone(place) if blank.question is Question.REDUNDANCY \
            else self._is_not_vacuous(place, dict(trigger_properties(
                self._component.part, denials)).get(place))
        if not shown:
            return None
        return replace(blank, holds=False, method=(
            f'{shown} in a run on a grid of {time_text(grid)}, confirmed in real time'))

    def _is_violated_alone(self, place: int) -> str:
        games, verdict = self._games, self._games.diagrams.outputs[place]
        others = [item for item in self._component.required if item != place]
        safe = games.safe(others)
        runner = self._run(games.violation(place, safe, others), safe & verdict, safe & ~verdict)
        if runner is None:
            return ''
        violated = next(filter(None, self._runs.violated(self._rows(runner))), set())
        return 'it is violated alone' if violated == {self._component.part.ids[place]} else ''

    def _is_not_vacuous(self, place: int, trigger: Property | None) -> str:
        games, d, verdict = self._games, self._games.diagrams, self._games.diagrams.outputs[place]
        runner = self._run(games.violation(place, d.possible, ()), d.possible & verdict,
                           d.possible & ~verdict)
        if runner is None or not any(self._component.part.ids[place] in names
                                     for names in self._runs.violated(self._rows(runner))):
            return ''
        if trigger is None:
            return 'it is violated'
        return 'its trigger comes' if self._comes(place, trigger) else ''

    def _comes(self, place: int, trigger: Property) -> bool:
        """Whether a trigger comes in a run on which all requirements hold forever."""
        games, d, component = self._games, self._games.diagrams, self._component
        found = games.consistent(component.required)
        if not found.holds:
            return False
        steps = games.safe(component.required) & d.before(found.last)
        goal = steps & ~d.outputs[component.triggers[place]]
        runner = self._run(games.reach(steps, goal), steps, goal)
        last = self._longest_memory()
        if runner is None or last > _MOST_ROWS:
            return False
        for _ in range(last):
            *before, row = self._rows(runner)
            if before[-1:] != [row]:
                # All bounds have run out when nothing has changed for so long: verdicts stay.
                rows = (*before, *[row] * last)
                if not any(self._runs.violated(rows)):
                    return self._is_false_once(trigger, rows)
            runner.take(steps)
        return False

    def _longest_memory(self) -> int:
        """Return a number of rows after which bounds have run out, one after the other."""
        grid = self._component.grid
        assert grid is not None
        ends = (end for item in self._component.part.properties for node in f.postorder(item.roots)
                if isinstance(node, f.Once | f.Historically | f.Since | f.Triggered)
                for end in (node.window.low, node.window.high) if end)
        return sum(ends) // grid + 2

    def _run(self, layers: Sequence[Node], steps: Node, goal: Node) -> Runner | None:
        return run_to(self._games, layers, steps, goal) if self._games.is_reached(layers) else None

    def _rows(self, runner: Runner) -> tuple[Row, ...]:
        return self._runs.rows(runner.rows())

    def _is_false_once(self, item: Property, rows: Sequence[Row]) -> bool:
        """Whether a formula is false at some instant, by the reference semantics."""
        grid = self._component.grid or 1
        ticks = [step * grid for step in range(len(rows))]
        columns = {signal.name: [row[number] for row in rows]
                   for number, signal in enumerate(self._specification.signals)}
        history, = evaluate_timed([item.formula], TimedTrace(ticks, columns, ticks[-1]),
                                  item.feedback)
        return not all(value for _, value in history)
