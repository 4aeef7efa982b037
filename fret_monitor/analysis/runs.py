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
Runs of a system, step by step, as rows of input values.

Layers only grow or only shrink, so that the layer of a state is found by bisection.
"""

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from typing import Any

from fret_monitor.analysis.diagrams import Choices, Diagrams, Node
from fret_monitor.analysis.games import Descent, Games
from fret_monitor.analysis.letters import matching
from fret_monitor.smt.terms import Term

_MOST_STEPS = 20_000


class NoRun(Exception):
    """A run is too long, or has no values; the argument says which."""


class Runner:
    """Takes steps from the initial state, and stores the choices."""

    def __init__(self, games: Games) -> None:
        """Start at the initial state."""
        self._games = games
        self._d: Diagrams = games.diagrams
        self.state = {item.now.value: item.start for item in self._d.system.bits}
        self._choice: dict[str, bool] = {}
        self._after = self._d.after_from(self.state)
        self.steps: list[tuple[dict[str, bool], dict[str, bool]]] = []

    def is_in(self, states: Node) -> bool:
        """Whether the state is one of some states."""
        return bool(self._d.at(states, self.state) == self._d.bdd.true)

    def can(self, steps: Node) -> bool:
        """Whether some step is possible here."""
        return bool(self._d.at(steps, self.state) != self._d.bdd.false)

    def before(self, states: Node) -> Node:
        """Return the steps from here that lead to some states."""
        return self._d.at(states, self._after)

    def take(self, steps: Node) -> None:
        """Take one of some steps, with choices near those of the step before."""
        if len(self.steps) == _MOST_STEPS:
            raise NoRun(f'it takes more than {_MOST_STEPS} steps')
        self._d.deadline.check()
        node = self._d.at(steps, self.state)
        names = [*self._d.environment, *self._d.own]
        self._choice = self._d.picked(node, names, self._choice)
        self.steps.append((self.state, self._choice))
        self.state = {name: self._d.at(after, self._choice) == self._d.bdd.true
                      for name, after in self._after.items()}
        self._after = self._d.after_from(self.state)

    def environment_choice(self, steps: Node) -> Node:
        """Return what the environment chooses in one of some steps."""
        node = self._d.at(steps, self.state)
        return self._d.bdd.cube(self._d.picked(node, self._d.environment, self._choice))

    def rows(self) -> list[dict[Term, Any]]:
        """Return the values of the inputs at each step."""
        return [self._row(state, choice) for state, choice in self.steps]

    def _row(self, state: Mapping[str, bool], choice: Mapping[str, bool]) -> dict[Term, Any]:
        values: dict[Term, Any] = {}
        for item in self._d.choices:
            values.update(self._values(item, state, choice))
        return values

    def _values(self, item: Choices, state: Mapping[str, bool],
                choice: Mapping[str, bool]) -> Mapping[Term, Any]:
        block = item.block
        names = (*item.environment, *item.others)
        truths = tuple(choice[name] for name in names)
        if block.is_free:
            return dict(zip(block.terms, truths))
        letter = next((each for each in block.letters if each.truths[:len(names)] == truths), None)
        if letter is None:
            raise NoRun('its comparisons are not decided')
        if block.classes is None:
            return letter.witness
        number = sum(choice[name] << place for place, name in enumerate(item.classes))
        found = matching(block, letter, block.classes[number].witness)
        if found is None:
            raise NoRun('its numbers are not exact')
        return found


def run_to(games: Games, layers: Sequence[Node], steps: Node, goal: Node) -> Runner:
    """Return a run to a goal that `Games.reach` found."""
    runner = Runner(games)
    while (place := bisect_left(layers, True, key=runner.is_in)) > 0:
        runner.take(steps & runner.before(layers[place - 1]))
    runner.take(goal)
    return runner


def continue_to_violation(runner: Runner, games: Games, requirements: Sequence[int],
                          descent: Descent) -> None:
    """
    Continue a run for as long as requirements can hold, and one step further.

    If they can hold forever, but some cannot be fulfilled any more, it ends there.
    """
    d, safe = games.diagrams, games.safe(requirements)
    while (rank := _rank(runner, descent)) is not None:
        if runner.can(safe & runner.before(descent.layers[rank - 1])):
            _stop(runner, safe)
            return
        choice = _longest(runner, safe, descent.layers[:rank - 1])
        if choice is None:
            _take_violation(runner, games, d.possible & ~safe, requirements)
            return
        runner.take(choice)


def play_to_violation(games: Games, requirements: Sequence[int], descent: Descent) -> Runner:
    """
    Return a run in which the environment wins, and the system holds out long.

    If the system can hold out forever, but not fulfil all, it ends where that is so.
    """
    d, safe, moves = games.diagrams, games.safe(requirements), games.moves(requirements)
    runner = Runner(games)
    while (rank := _rank(runner, descent)) is not None:
        good = games.good(requirements, runner.before(descent.layers[rank - 1]))
        bad = d.enabled & d.possible & ~d.bdd.exist(d.own, good)
        if not runner.can(bad):
            _stop(runner, safe)
            return runner
        chosen = runner.environment_choice(bad)
        choice = _longest(runner, chosen & moves, descent.layers[:rank - 1])
        if choice is None:
            _take_violation(runner, games, chosen & d.possible & ~safe, requirements)
            return runner
        runner.take(choice)
    return runner


def _stop(runner: Runner, safe: Node) -> None:
    """End a run, which has at least one step."""
    if not runner.steps and runner.can(safe):
        runner.take(safe)


def _longest(runner: Runner, steps: Node, layers: Sequence[Node]) -> Node | None:
    """Return those of some steps after which a run can go on longest."""
    def found(layer: Node) -> Node:
        return steps & runner.before(layer)

    count = bisect_left(layers, True, key=lambda layer: not runner.can(found(layer)))
    return found(layers[count - 1]) if count else None


def _take_violation(runner: Runner, games: Games, steps: Node,
                    requirements: Sequence[int]) -> None:
    """Take one of some steps at which few requirements are violated."""
    for item in (*games.assumptions, *requirements):
        if item not in games.pending and runner.can(less := steps & games.diagrams.outputs[item]):
            steps = less
    runner.take(steps)


def _rank(runner: Runner, descent: Descent) -> int | None:
    """Return the number of the first layer without the state; None if it is in all."""
    number = bisect_left(descent.layers, True, key=lambda layer: not runner.is_in(layer))
    return number if number < len(descent.layers) else None
