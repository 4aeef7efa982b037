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
`eventually` need not hold; it must only be possible that it holds later.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

from fret_monitor.analysis.diagrams import Diagrams, Node


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
                 pending: Collection[int]) -> None:
        """`pending` are those that need not hold now."""
        self.diagrams = diagrams
        self.assumptions = sorted(assumptions)
        self.pending = set(pending)
        self._assumed = diagrams.all_of(
            diagrams.outputs[item] for item in self.assumptions if item not in self.pending)

    def safe(self, requirements: Collection[int]) -> Node:
        """Return the possible steps at which the assumptions and some requirements hold."""
        d = self.diagrams
        return d.possible & self._assumed & d.all_of(
            d.outputs[item] for item in sorted(requirements) if item not in self.pending)

    def _open(self, requirements: Collection[int]) -> list[Node]:
        """Return the verdicts that have to stay possible."""
        return [self.diagrams.outputs[item]
                for item in sorted({*requirements, *self.assumptions}) if item in self.pending]

    def _fulfillable(self, safe: Node, within: Node, verdict: Node) -> Node:
        """Return the states from which safe steps within a set lead to a verdict."""
        d = self.diagrams
        inside = safe & d.before(within)
        found = d.some(inside & verdict)
        while True:
            more = found | d.some(inside & d.before(found))
            if more == found:
                return found
            found = more

    def consistent(self, requirements: Collection[int]) -> Descent:
        """Return the states from which some run satisfies some requirements forever."""
        d, safe = self.diagrams, self.safe(requirements)
        return self._descend(lambda kept: d.some(safe & kept), safe, requirements)

    def realizable(self, requirements: Collection[int]) -> Descent:
        """Return the states from which the system can satisfy some requirements forever."""
        d, safe = self.diagrams, self.safe(requirements)
        excused = ~self._assumed
        return self._descend(
            lambda kept: d.forced(excused | (safe & kept)), safe, requirements)

    def _descend(self, chosen: Callable[[Node], Node], safe: Node,
                 requirements: Collection[int]) -> Descent:
        """Return the descent in which `chosen` are the states that have one of some good steps."""
        d = self.diagrams
        verdicts = self._open(requirements)
        layers, kept = [d.bdd.true], d.bdd.true
        while True:
            found = layers[-1] & chosen(kept)
            for verdict in verdicts:
                found &= self._fulfillable(safe, found, verdict)
            if not d.contains_start(found):
                return Descent((*layers, found), False)
            if found == layers[-1]:
                return Descent(tuple(layers), True)
            # Few states are lost in a round: the steps to them are computed faster than all.
            kept &= ~d.before(layers[-1] & ~found)
            layers.append(found)

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

    def is_reached(self, layers: Sequence[Node]) -> bool:
        """Whether the start is in the last of some sets."""
        return self.diagrams.contains_start(layers[-1])
