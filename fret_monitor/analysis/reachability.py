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
State diagrams in requirements, and the runs that would reach their states.

Of a requirement that an input follows a diagram (`import --mode check`) all states are asked
about, from the first one on; of one that compares a calculated state (`--mode calculate`), that
one.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

from fret_monitor.explain.diagram import first_state, rules_of, StateRule, states_of, ways_of
from fret_monitor.logic.formula import (
    ALWAYS, Binary, BinaryOperator, Choice, Constant, Feedback, Formula, FTP, Once, TRUE, Unary,
    UnaryOperator, Yesterday,
)
from fret_monitor.logic.specification import Property


@dataclass(frozen=True)
class Way:
    """An edge between two states, by their numbers; the condition TRUE: always taken."""

    origin: int
    condition: Formula
    target: int


@dataclass(frozen=True)
class Overlap:
    """Two edges out of a state to different ones, by numbers; `condition`: both of theirs."""

    origin: int
    condition: Formula
    targets: tuple[int, int]


@dataclass(frozen=True)
class AskedDiagram:
    """
    A diagram in formulas.

    `states` compare the state with each value, `now` hold when a run is in it, `before` at the
    step after that. `asked` are the numbers of the states that the requirement is about.
    `is_required`: runs satisfy the requirements; otherwise these only answer.
    """

    states: tuple[Formula, ...]
    now: tuple[Formula, ...]
    before: tuple[Formula, ...]
    ways: tuple[Way, ...]
    overlaps: tuple[Overlap, ...]
    asked: tuple[int, ...]
    is_required: bool

    def into(self, states: Iterable[int]) -> list[Way]:
        """Return the edges into some states from others."""
        return [way for way in self.ways if way.target in states and way.origin not in states]

    def attempt(self, way: Way | Overlap) -> Formula:
        """Return a formula that holds where the condition of edges does, taken or not."""
        return _both(self.before[way.origin], way.condition)


def asked_diagram(item: Property) -> AskedDiagram | None:
    """Return the diagram that a requirement is about, if it is about one."""
    rules = rules_of(item.formula)
    return _followed(item.formula, rules) if rules else _calculated(item.formula)


def never(item: Property, goals: Iterable[Formula]) -> Iterator[Property]:
    """Yield properties that are violated where goals hold."""
    for number, goal in enumerate(goals):
        yield replace(item, id=f'{item.id} {number}', sentence=None,
                      formula=Unary(UnaryOperator.NOT, goal))


def _followed(formula: Formula, rules: Sequence[StateRule]) -> AskedDiagram:
    """Return a diagram in which a run begins in the first state."""
    states = states_of(rules)
    begun = Once(ALWAYS, _both(FTP, first_state(formula, rules)))
    now = tuple(_both(begun, state) for state in states)
    return AskedDiagram(states, now, tuple(map(Yesterday, now)), tuple(_ways(rules, states)),
                        tuple(_overlaps(rules, states)), tuple(range(len(states))),
                        is_required=True)


def _calculated(formula: Formula) -> AskedDiagram | None:
    """Return the diagram of a definition that a formula compares with a value."""
    match formula:
        case Binary(BinaryOperator.EQ, Choice() as state, Constant() as value):
            before = states_of(rules := _rules(state))
        case _:
            return None
    values = [item.right for item in before if isinstance(item, Binary)]
    if value not in values or not all(isinstance(item, Constant) for item in values):
        return None
    now = tuple(Binary(BinaryOperator.EQ, state, item) for item in values)
    return AskedDiagram(now, now, before, tuple(_ways(rules, before)), (),
                        (values.index(value),), is_required=False)


def _rules(equation: Formula) -> list[StateRule]:
    """Return the rules of `if before = s then (if c then t else s) else ... before`."""
    found = []
    compared: set[Formula] = set()
    while isinstance(equation, Choice):
        match equation.condition:
            case Binary(BinaryOperator.EQ, Choice(_, _, Feedback()) as before, Constant()) as now:
                compared.add(before)
                found.append(StateRule(now, tuple(
                    (condition, Binary(BinaryOperator.EQ, before, target))
                    for condition, target in ways_of(equation.yes))))
            case _:
                break
        equation = equation.no
    return found if compared == {equation} else []


def _ways(rules: Iterable[StateRule], states: Sequence[Formula]) -> Iterator[Way]:
    numbers = {state: number for number, state in enumerate(states)}
    for rule in rules:
        for condition, target in rule.ways:
            if target is not rule.state:
                yield Way(numbers[rule.state], condition or TRUE, numbers[target])


def _overlaps(rules: Iterable[StateRule], states: Sequence[Formula]) -> Iterator[Overlap]:
    numbers = {state: number for number, state in enumerate(states)}
    for rule in rules:
        edges = [(condition, target) for condition, target in rule.ways if condition is not None]
        for (one, first), (other, second) in combinations(edges, 2):
            if first is not second:
                yield Overlap(numbers[rule.state], _both(one, other),
                              (numbers[first], numbers[second]))


def _both(left: Formula, right: Formula) -> Formula:
    return Binary(BinaryOperator.AND, left, right)
