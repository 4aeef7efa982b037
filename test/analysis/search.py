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

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from itertools import product
from typing import Any

from fret_monitor.elaboration.fretish import is_not_yet
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
Node = Any  # of a parity game


def reference(specification: Specification) -> Callable[[Sequence[Row], int], list[list[bool]]]:
    """Return what runs a bundle by the reference semantics."""
    def run(rows: Sequence[Row], spacing: int) -> list[list[bool]]:
        columns = {signal.name: [row[place] for row in rows]
                   for place, signal in enumerate(specification.signals)}
        verdicts = [[bool(value) for value in evaluate_all(
            [item.formula], columns, item.feedback)[0]] for item in specification.properties]
        return [list(line) for line in zip(*verdicts, strict=True)]
    return run


class TooManyStates(Exception):
    """A search would take long."""


class Search:
    """All states of a bundle that can be reached, and the steps between them."""

    def __init__(self, specification: Specification, most: int = 1000) -> None:
        """Explore the states; raise TooManyStates if there are more than `most`."""
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
        self.pending = [number for number, item in enumerate(specification.properties)
                        if item.sentence is not None and is_not_yet(item.sentence)]
        linked = {item.name for item in specification.signals if item.role is InputRole.OUTPUT}
        self.of_environment = list(self.assumed)
        for _ in self.assumed:
            for place in self.of_environment:
                names = specification.properties[place].inputs
                if linked.intersection(names):
                    linked.update(names)
            self.of_environment = [place for place in self.of_environment if not
                                   linked.intersection(specification.properties[place].inputs)]
        self.start: State = self._reduced([t.plain(item.start) for item in system.state])
        self.steps: dict[State, dict[tuple[Choice, Choice], tuple[State, Choice]]] = {}
        todo = [self.start]
        while todo:
            state = todo.pop()
            if state in self.steps:
                continue
            found = self.steps[state] = {}
            if len(self.steps) > most:
                raise TooManyStates
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
        return all(verdicts[number] for number in (*required, *self.assumed)
                   if number not in self.pending)

    # -- runs -------------------------------------------------------------------------------

    def _fair(self, allowed: Callable[[Choice], bool], wanted: Sequence[int]) -> set[State]:
        """Return the states from which allowed steps go on forever, each of `wanted` always."""
        graph = {state: [step for step in found.values() if allowed(step[1])]
                 for state, found in self.steps.items()}
        later = {state: _closure(graph, state) for state in graph}
        cores = set()
        for state in graph:
            component = {item for item in later[state] if state in later[item]}
            seen = [verdicts for item in component for after, verdicts in graph[item]
                    if after in component]
            if seen and all(any(verdicts[place] for verdicts in seen) for place in wanted):
                cores.add(state)
        return {state for state in graph if state in cores or later[state] & cores}

    def _open(self, required: Iterable[int]) -> list[int]:
        return [item for item in required if item in self.pending]

    def consistent(self, required: Sequence[int]) -> set[State]:
        """Return the states from which all can be satisfied forever."""
        return self._fair(lambda verdicts: self._safe(verdicts, required),
                          self._open({*required, *self.assumed}))

    def reached(self, required: Sequence[int]) -> set[State]:
        """Return the states that safe steps reach."""
        graph = {state: [step for step in found.values() if self._safe(step[1], required)]
                 for state, found in self.steps.items()}
        return {self.start, *_closure(graph, self.start)}

    def can_fail_alone(self, item: int, others: Sequence[int]) -> bool:
        """Whether a requirement can be violated while the others are not."""
        if item in self.pending:
            never = self._fair(lambda verdicts: self._safe(verdicts, others)
                               and not verdicts[item], self._open({*others, *self.assumed}))
            return not never.isdisjoint(self.reached(others))
        return any(self._safe(verdicts, others) and not verdicts[item]
                   for state in self.reached([*others, item])
                   for _, verdicts in self.steps[state].values())

    # -- games ------------------------------------------------------------------------------

    def realizable(self, required: Sequence[int], trusted: Collection[int]) -> set[State]:
        """
        Return the states from which the system can satisfy all forever.

        The environment fulfils those of `trusted` that say `eventually`.

        This is a parity game: the environment chooses, then the system, then the verdicts count.
        The priority is 2 when each requirement that says `eventually` has been fulfilled anew,
        1 when so has each such assumption, otherwise 0. The system wins if the greatest one that
        comes again and again is even.
        """
        alive = self.consistent(())
        wanted, fair = self._open(required), self._open(trusted)
        nodes: dict[Node, tuple[bool, int, list[Node]]] = {
            'won': (True, 0, ['won']), 'lost': (True, 1, ['lost'])}
        for state, place, turn in product(
                self.steps, range(len(wanted) + 1), range(len(fair) + 1)):
            choices = nodes[state, place, turn] = False, 0, []
            for foreign in self.foreign:
                steps: set[Node] = set()
                for after, verdicts in self._answers(state, foreign, required, alive):
                    if after is None:
                        steps.add(verdicts)
                        continue
                    done, ready = place, turn
                    while done < len(wanted) and verdicts[wanted[done]]:
                        done += 1
                    while ready < len(fair) and verdicts[fair[ready]]:
                        ready += 1
                    priority = 2 if done == len(wanted) else 1 if ready == len(fair) else 0
                    target = after, 0 if priority == 2 else done, 0 if priority else ready
                    steps.add((priority, target))
                    nodes[priority, target] = True, priority, [target]
                nodes[frozenset(steps)] = True, 0, list(steps)
                choices[2].append(frozenset(steps))
        return {state for state in self.steps if (state, 0, 0) in _won(nodes)}

    def _answers(self, state: State, foreign: Choice, required: Sequence[int],
                 alive: set[State]) -> Iterator[tuple[Any, Any]]:
        """Yield the states and verdicts that the system can choose; or None, and who has won."""
        steps = [self.steps[state][foreign, own] for own in self.own]
        kept = [step for step in steps if self._safe(step[1], ())]
        if not kept:
            yield None, 'won'  # the environment broke an assumption
            return
        lasting = [step for step in kept if step[0] in alive]
        moves = [step for step in lasting or kept if self._safe(step[1], required)]
        yield from moves
        if not moves:
            yield None, 'lost'


def _closure(graph: Mapping[State, Sequence[tuple[State, Choice]]], state: State) -> set[State]:
    """Return the states that one or more steps reach."""
    found, todo = set(), [state]
    while todo:
        for after, _ in graph[todo.pop()]:
            if after not in found:
                found.add(after)
                todo.append(after)
    return found


def _won(nodes: Mapping[Node, tuple[bool, int, list[Node]]]) -> set[Node]:
    """Return the nodes from which the system wins (the algorithm of Zielonka)."""
    if not nodes:
        return set()
    highest = max(priority for _, priority, _ in nodes.values())
    is_system = highest % 2 == 0
    best = {node for node, (_, priority, _) in nodes.items() if priority == highest}
    rest = _without(nodes, _attracted(nodes, best, is_system))
    won = _won(rest)
    other = set(rest) - won if is_system else won
    if not other:
        return set(nodes) if is_system else set()
    other = _attracted(nodes, other, not is_system)
    won = _won(_without(nodes, other))
    return won if is_system else won | other


def _without(nodes: Mapping[Node, tuple[bool, int, list[Node]]], less: set[Node]
             ) -> dict[Node, tuple[bool, int, list[Node]]]:
    return {node: (own, priority, [item for item in after if item not in less])
            for node, (own, priority, after) in nodes.items() if node not in less}


def _attracted(nodes: Mapping[Node, tuple[bool, int, list[Node]]], goal: set[Node],
               is_system: bool) -> set[Node]:
    """Return the nodes from which a player can reach a goal."""
    before: dict[Node, list[Node]] = {}
    left = {}
    for node, (own, _, after) in nodes.items():
        left[node] = 1 if own is is_system else len(set(after))
        for item in set(after):
            before.setdefault(item, []).append(node)
    found, todo = set(goal), list(goal)
    while todo:
        for node in before.get(todo.pop(), ()):
            left[node] -= 1
            if left[node] <= 0 and node not in found:
                found.add(node)
                todo.append(node)
    return found


def _reduced(value: Any, kept: StateVariable) -> Any:
    if kept.limit is not None:
        return min(value, kept.limit + 1)
    return value & kept.mask if kept.mask is not None else value
