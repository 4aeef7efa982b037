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
Fixed points over the steps of a system.

A step is *safe* if all assumptions and requirements hold at it. A requirement whose sentence says
`eventually` need not hold at each step, but at infinitely many.

The system may not win by breaking an assumption that reads its outputs (docs/analysis.md): its
strategies are *non-conflicting* (Majumdar, Piterman, Schmuck: Environmentally-Friendly GR(1)
Synthesis, TACAS 2019).
"""

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

from fret_monitor.analysis.diagrams import Diagrams, Node

_Predecessors = Callable[[Node], Node]
"""Returns the states from which a step in a set can be taken, or be forced."""


@dataclass(frozen=True)
class Descent:
    """
    A decreasing sequence of sets of states, to a greatest fixed point or to a set without start.

    `layers` are the sets, the first of which has all states.
    """

    layers: tuple[Node, ...]
    holds: bool

    @property
    def last(self) -> Node:
        """Return the fixed point, if `holds`."""
        return self.layers[-1]


class Games:
    """The questions about one system; requirements are indices of its outputs."""

    def __init__(self, diagrams: Diagrams, assumptions: Collection[int],
                 pending: Collection[int], shared: Collection[int], linked: Collection[int]
                 ) -> None:
        """
        Store what is assumed.

        `pending` are those that need not hold now, `shared` assumptions that read outputs, and
        `linked` these and those that share inputs with them, directly or through others.
        """
        self.diagrams = diagrams
        self.assumptions = sorted(assumptions)
        self.pending = set(pending)
        self.shared = sorted(shared)
        self.linked = sorted(linked)
        self._assumed = diagrams.all_of(
            diagrams.outputs[item] for item in self.assumptions if item not in self.pending)

    def safe(self, requirements: Collection[int]) -> Node:
        """Return the possible steps at which the assumptions and some requirements hold."""
        d = self.diagrams
        return d.possible & self._assumed & d.all_of(
            d.outputs[item] for item in sorted(requirements) if item not in self.pending)

    def _open(self, requirements: Collection[int]) -> list[Node]:
        """Return the verdicts that have to hold at infinitely many steps."""
        return [self.diagrams.outputs[item]
                for item in sorted(requirements) if item in self.pending]

    # -- runs -------------------------------------------------------------------------------

    def consistent(self, requirements: Collection[int]) -> Descent:
        """Return the states from which some run satisfies some requirements forever."""
        safe = self.safe(requirements)
        return self._descend(lambda steps: self.diagrams.some(safe & steps),
                             self._open({*requirements, *self.assumptions}), [])

    def violation(self, place: int, steps: Node, others: Collection[int]) -> list[Node]:
        """
        Return sets of states from which some steps lead to a violation, as `reach` does.

        It is what a monitor reports at a step, whether or not the run can go on. A requirement
        that says `eventually` is violated by a run on which it is false from some step on, and
        which fulfils the others that say so.
        """
        d, verdict = self.diagrams, self.diagrams.outputs[place]
        idle = steps & ~verdict
        if place not in self.pending:
            return self.reach(steps & verdict, idle)
        *_, forever = self._decreasing(lambda goal: d.some(idle & goal), self._open(others), [])
        return self.reach(steps, idle & d.before(forever))

    # -- games ------------------------------------------------------------------------------

    @cached_property
    def excused(self) -> Node:
        """The choices of the environment after which an assumption is broken, whatever follows."""
        d = self.diagrams
        return ~d.bdd.exist(d.own, d.possible & self._assumed)

    @cached_property
    def lasting(self) -> Node:
        """The states from which some run satisfies the assumptions; all if they cannot matter."""
        found = self.consistent(()) if self.shared else None
        return found.last if found is not None and found.holds else self.diagrams.bdd.true

    @cached_property
    def doomed(self) -> Node:
        """The choices of the environment after which no run satisfies the assumptions."""
        d = self.diagrams
        return ~d.bdd.exist(d.own, d.possible & self._assumed & d.before(self.lasting))

    def moves(self, requirements: Collection[int]) -> Node:
        """Return the safe steps by which the system does not make an assumption impossible."""
        if not self.shared:
            return self.safe(requirements)
        return self.safe(requirements) & (self.doomed | self.diagrams.before(self.lasting))

    def good(self, requirements: Collection[int], kept: Node) -> Node:
        """Return the moves within some steps, and those after an assumption was broken."""
        return self.diagrams.possible & (self.excused | self.moves(requirements) & kept)

    def realizable(self, requirements: Collection[int], trusts_linked: bool = False) -> Descent:
        """
        Return the states from which the system can satisfy some requirements forever.

        Assumptions that say `eventually` and are linked to outputs are left out, but with
        `trusts_linked`: then the system may win by keeping them from being fulfilled.
        """
        d, moves = self.diagrams, self.moves(requirements)
        fair = [item for item in self.assumptions if trusts_linked or item not in self.linked]
        return self._descend(lambda steps: d.forced(self.excused | moves & steps),
                             self._open(requirements), self._open(fair))

    # -- fixed points -----------------------------------------------------------------------

    def _descend(self, predecessors: _Predecessors, wanted: Sequence[Node],
                 fair: Sequence[Node]) -> Descent:
        """
        Find the states from which steps can be taken forever, each of `wanted` again and again.

        That need not be so if one of `fair` holds at finitely many steps only. The algorithm is
        that of GR(1) (Bloem, Jobstmann, Piterman, Pnueli, Sa'ar: Synthesis of Reactive(1)
        Designs, JCSS 2012).
        """
        layers = []
        for states in self._decreasing(predecessors, wanted, fair):
            layers.append(states)
            if not self.diagrams.contains_start(states):
                return Descent(tuple(layers), False)
        return Descent(tuple(layers), True)

    def _decreasing(self, predecessors: _Predecessors, wanted: Sequence[Node],
                    fair: Sequence[Node]) -> Iterator[Node]:
        d = self.diagrams
        states, kept = d.bdd.true, d.bdd.true
        while True:
            yield states
            found = states & predecessors(kept)
            for verdict in wanted:
                found = self._fulfillable(found, predecessors, verdict, fair)
            if found == states:
                return
            # Few states are lost in a round: the steps to them are computed faster than all.
            kept &= ~d.before(states & ~found)
            states = found

    def _fulfillable(self, within: Node, predecessors: _Predecessors, verdict: Node,
                     fair: Sequence[Node]) -> Node:
        """Return the states of a set from which steps within it lead to a verdict."""
        d = self.diagrams
        nearer, found = verdict & d.before(within), d.bdd.false
        while True:
            more = within & predecessors(nearer)
            for item in fair:
                more |= self._waiting(within, predecessors, nearer, item)
            if more == found:
                return found
            nearer |= d.before(more & ~found)
            found = more

    def _waiting(self, within: Node, predecessors: _Predecessors, nearer: Node,
                 fair: Node) -> Node:
        """Return the states of a set where steps come nearer, or `fair` never holds."""
        d, states = self.diagrams, within
        while True:
            less = states & predecessors(nearer | ~fair & d.before(states))
            if less == states:
                return states
            states = less

    def reach(self, steps: Node, goal: Node) -> list[Node]:
        """
        Return sets of states from which steps lead to a goal, a set of last steps.

        The n-th set needs at most n steps before the last one. The list ends with a set that
        contains the start, or with the same set twice if none does.
        """
        d = self.diagrams
        layers = [d.some(goal)]
        new = layers[0]
        while not d.contains_start(layers[-1]):
            more = layers[-1] | d.some(steps & d.before(new))
            new = more & ~layers[-1]
            layers.append(more)
            if new == d.bdd.false:
                break
        return layers

    def differ(self, one: int, other: int) -> bool:
        """Whether two requirements have different verdicts at a step of some run."""
        d = self.diagrams
        differs = d.possible & d.bdd.apply('xor', d.outputs[one], d.outputs[other])
        return differs != d.bdd.false and self.is_reached(self.reach(d.possible, differs))

    def is_reached(self, layers: Sequence[Node]) -> bool:
        """Whether the start is in the last of some sets."""
        return self.diagrams.contains_start(layers[-1])
