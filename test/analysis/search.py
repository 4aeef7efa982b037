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
An explicit search over all states of a bundle, to compare an analysis with.

States and steps come from `smt/transition.py`, whose models of the cells are proved, not from
decision diagrams. All inputs are Boolean.
"""

from collections.abc import Callable, Sequence
from itertools import product
from typing import Any

from fret_monitor.logic.evaluate import evaluate_all
from fret_monitor.logic.specification import Specification
from fret_monitor.model.policies import InputRole
from fret_monitor.program.lower import lower_together
from fret_monitor.smt import terms as t
from fret_monitor.smt.concrete import function_of
from fret_monitor.smt.transition import StateVariable, transition_system
from fret_monitor.traces.trace import Row

State = tuple[Any, ...]
Choice = tuple[bool, ...]


def reference(specification: Specification) -> Callable[[Sequence[Row], int], list[list[bool]]]:
    """Return what runs a bundle by the reference semantics."""
    def run(rows: Sequence[Row], spacing: int) -> list[list[bool]]:
        columns = {signal.name: [row[place] for row in rows]
                   for place, signal in enumerate(specification.signals)}
        verdicts = [[bool(value) for value in evaluate_all(
            [item.formula], columns, item.feedback)[0]] for item in specification.properties]
        return [list(line) for line in zip(*verdicts, strict=True)]
    return run


class Search:
    """All states of a bundle that can be reached, and the steps between them."""

    def __init__(self, specification: Specification) -> None:
        """Explore the states."""
        inputs = [t.variable(item.name, t.BOOL) for item in specification.signals]
        system = transition_system(lower_together(specification), dict(enumerate(inputs)), 's')
        self._kept = system.state
        compute = function_of(
            [*(item.after for item in system.state),
             *(system.verdicts[number] for number in range(len(specification.properties)))],
            [*(item.now for item in system.state), *inputs])
        is_output = [item.role is InputRole.OUTPUT for item in specification.signals]
        self.own = list(product((False, True), repeat=sum(is_output)))
        self.foreign = list(product((False, True), repeat=len(is_output) - sum(is_output)))
        self.assumed = [number for number, item in enumerate(specification.properties)
                        if item.is_assumption]
        self.start: State = self._reduced([t.plain(item.start) for item in system.state])
        self.steps: dict[State, dict[tuple[Choice, Choice], tuple[State, Choice]]] = {}
        todo = [self.start]
        while todo:
            state = todo.pop()
            if state in self.steps:
                continue
            found = self.steps[state] = {}
            for foreign, own in product(self.foreign, self.own):
                left, right = iter(foreign), iter(own)
                row = [next(right) if output else next(left) for output in is_output]
                values = compute(*state, *row)
                after = self._reduced(values[:len(state)])
                found[foreign, own] = after, tuple(map(bool, values[len(state):]))
                todo.append(after)

    def _reduced(self, values: Sequence[Any]) -> State:
        return tuple(map(_reduced, values, self._kept))

    def _safe(self, verdicts: Choice, required: Sequence[int]) -> bool:
        return all(verdicts[number] for number in (*required, *self.assumed))

    def consistent(self, required: Sequence[int]) -> set[State]:
        """Return the states from which all can be satisfied forever."""
        return self._greatest(lambda state, good: any(
            after in good and self._safe(verdicts, required)
            for after, verdicts in self.steps[state].values()))

    def realizable(self, required: Sequence[int]) -> set[State]:
        """Return the states from which the system can satisfy all forever."""
        def holds(state: State, good: set[State]) -> bool:
            steps = self.steps[state]
            return all(any(
                not self._safe(steps[foreign, own][1], ())
                or self._safe(steps[foreign, own][1], required) and steps[foreign, own][0] in good
                for own in self.own) for foreign in self.foreign)
        return self._greatest(holds)

    def _greatest(self, holds: Callable[[State, set[State]], bool]) -> set[State]:
        good = set(self.steps)
        while True:
            less = {state for state in good if holds(state, good)}
            if less == good:
                return good
            good = less

    def reached(self, required: Sequence[int]) -> set[State]:
        """Return the states that safe steps reach."""
        found, todo = {self.start}, [self.start]
        while todo:
            for after, verdicts in self.steps[todo.pop()].values():
                if after not in found and self._safe(verdicts, required):
                    found.add(after)
                    todo.append(after)
        return found

    def can_fail_alone(self, item: int, others: Sequence[int]) -> bool:
        """Whether a requirement can be violated while the others have always held."""
        return any(self._safe(verdicts, others) and not verdicts[item]
                   for state in self.reached([*others, item])
                   for _, verdicts in self.steps[state].values())


def _reduced(value: Any, kept: StateVariable) -> Any:
    if kept.limit is not None:
        return min(value, kept.limit + 1)
    return value & kept.mask if kept.mask is not None else value
