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
Breadth-first search of the states of a requirement, for shortest examples and proofs.

Future verdicts depend only on the state of the monitor and on future rows. So a search that
reaches no new state has covered all traces of the given rows.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from fret_monitor.traces.trace import Row, Run, Trace
from fret_monitor.traces.trials import Trials


_MOST_BYTES = 2 ** 27  # of all states that one search keeps


@dataclass(frozen=True)
class Exploration:
    """
    Shortest examples; None if the search found none.

    `satisfying` ends with a true verdict, after the largest number of triggers; `violating` ends
    with a false verdict. The verdict of `recovering` changes from false to true at its last step.
    With `is_complete`, the search has covered all traces of the rows.
    """

    satisfying: Trace | None
    violating: Trace | None
    recovering: Trace | None
    is_complete: bool
    states: int
    steps: int


class WantedTrace(NamedTuple):
    """When to stop: number of true bits of a satisfying trace; whether a recovery is wanted."""

    met: int
    is_recovery: bool


def explore(trials: Trials, rows: Sequence[Row], limit: int, wanted: WantedTrace) -> Exploration:
    """
    Explore the states that can be reached with some rows, in at most `limit` steps.

    Stops early when everything wanted is found, or when the states take `_MOST_BYTES`. O(limit)
    time and memory.
    """
    return _StateSearch(trials, rows).run(limit, wanted)


class Path:
    """How each node of a search was reached: from which node, with which row; the start is 0."""

    def __init__(self) -> None:
        """Store the start."""
        self._reached: list[tuple[int, int]] = [(-1, -1)]

    def add(self, number: int, row: int) -> None:
        """Add the next node."""
        self._reached.append((number, row))

    def trace(self, rows: Sequence[Row], number: int, row: int) -> Trace:
        """Return the trace to a node, and one step more."""
        found = [rows[row]]
        while number > 0:
            number, row = self._reached[number]
            found.append(rows[row])
        return tuple(Run(each, 1) for each in reversed(found))


class _StateSearch:
    """A node is a state and its verdict."""

    def __init__(self, trials: Trials, rows: Sequence[Row]) -> None:
        self._rows = rows
        self._follow = trials.follower(rows)
        self._nodes: list[tuple[bytes, bool]] = [(trials.start(), True)]
        self._known: dict[tuple[bytes, bool], int] = {self._nodes[0]: 0}
        self._reached = Path()
        self._satisfying: tuple[int, int, int] | None = None  # triggers met, node, row
        self._violating: tuple[int, int] | None = None
        self._recovering: tuple[int, int] | None = None

    def run(self, limit: int, wanted: WantedTrace) -> Exploration:
        number = 0
        size = len(self._nodes[0][0])
        while (number < len(self._nodes) and number * len(self._rows) < limit
               and not self._has(wanted) and len(self._nodes) * size <= _MOST_BYTES):
            self._visit(number)
            number += 1
        return Exploration(
            self._path(self._satisfying[1:]) if self._satisfying else None,
            self._path(self._violating), self._path(self._recovering),
            number == len(self._nodes), len(self._nodes), number * len(self._rows))

    def _has(self, wanted: WantedTrace) -> bool:
        return (self._violating is not None and self._satisfying is not None
                and self._satisfying[0] == wanted.met
                and not (wanted.is_recovery and self._recovering is None))

    def _visit(self, number: int) -> None:
        state, verdict = self._nodes[number]
        for row, (after, bits) in enumerate(self._follow(state)):
            is_true = bool(bits & 1)
            self._note(number, row, verdict, bits)
            node = (after, is_true)
            if node not in self._known:
                self._known[node] = len(self._nodes)
                self._nodes.append(node)
                self._reached.add(number, row)

    def _note(self, number: int, row: int, before: bool, bits: int) -> None:
        if not bits & 1:
            self._violating = self._violating or (number, row)
            return
        met = bits.bit_count()
        if self._satisfying is None or met > self._satisfying[0]:
            self._satisfying = (met, number, row)
        if not before and self._recovering is None:
            self._recovering = (number, row)

    def _path(self, end: tuple[int, ...] | None) -> Trace | None:
        return None if end is None else self._reached.trace(self._rows, *end)


@dataclass(frozen=True)
class Reached:
    """
    For each bit of the verdicts that was true at some step, a shortest trace that ends there.

    With `is_complete`, the search has covered all traces of the rows: no other bit is ever true.
    """

    traces: dict[int, Trace]
    is_complete: bool
    states: int
    steps: int


def reach(trials: Trials, rows: Sequence[Row], bits: int, limit: int) -> Reached:
    """
    Explore the states that can be reached with some rows until each of `bits` was true once.

    Takes at most `limit` steps and `_MOST_BYTES`. O(limit) time and memory.
    """
    follow = trials.follower(rows)
    nodes = [trials.start()]
    known = {nodes[0]}
    path = Path()
    found: dict[int, Trace] = {}
    number = 0
    while (number < len(nodes) and number * len(rows) < limit and bits
           and len(nodes) * len(nodes[0]) <= _MOST_BYTES):
        for row, (after, word) in enumerate(follow(nodes[number])):
            if fresh := word & bits:
                bits &= ~fresh
                trace = path.trace(rows, number, row)
                found.update((bit, trace) for bit in range(fresh.bit_length())
                             if fresh >> bit & 1)
            if after not in known:
                known.add(after)
                nodes.append(after)
                path.add(number, row)
        number += 1
    return Reached(found, number == len(nodes), len(nodes), number * len(rows))
