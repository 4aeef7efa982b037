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
Runs of a system step by step, where comparisons relate numbers of different steps.

The solver finds values of the inputs among the real numbers. They are rounded, and the run is
computed again with them, so that a run that is returned is one of floats.
"""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
import time
from typing import Any

from fret_monitor.analysis.letters import Values
from fret_monitor.smt import terms as t
from fret_monitor.smt.concrete import function_of, NoValue
from fret_monitor.smt.linear import NotLinear
from fret_monitor.smt.reals import RealTranslation, value_of
from fret_monitor.smt.solver import new_solver
from fret_monitor.smt.terms import Term
from fret_monitor.smt.transition import StateVariable
from fret_monitor.traces.deadline import Deadline
import z3

_MOST_STEPS = 40


@dataclass(frozen=True)
class Steps:
    """
    The steps of a system as terms: its state, its inputs, and what they allow.

    `domains` are as those of a `Component`.
    """

    state: tuple[StateVariable, ...]
    inputs: tuple[Term, ...]
    domains: Mapping[Term, int | None]


@dataclass(frozen=True)
class Wanted:
    """
    What a run must be like.

    `always` holds at each step but the last, or with `repeats` at all steps; `last` holds at the
    last step, or with `repeats` each of `once` at a step of the part that repeats.
    """

    always: Term
    last: Term = t.TRUE
    once: tuple[Term, ...] = ()
    repeats: bool = False


@dataclass(frozen=True)
class Found:
    """The values of the inputs at each step; what follows step `start` repeats forever, if set."""

    rows: tuple[Values, ...]
    start: int | None


def find_run(steps: Steps, wanted: Wanted, deadline: Deadline, seconds: float,
             is_longest: bool = False) -> Found | None:
    """
    Return a short run, or the longest one before the solver finds none; None if none was found.

    It ends after about as many seconds.
    """
    end = time.monotonic() + seconds
    last = None
    with suppress(NotLinear, NoValue):
        search = Unrolling(steps, wanted, seconds)
        for count in range(1, _MOST_STEPS + 1):
            deadline.check()
            last = search.extended(count) or last
            if search.is_over or last is not None and not is_longest or time.monotonic() > end:
                break
    return last


def end_of_runs(steps: Steps, always: Term, deadline: Deadline, seconds: float,
                most: int | None = None) -> int | None:
    """
    Return a number of steps that no run has, if a term holds at each; None if none was found.

    Rounding is included, so that this holds for floats.
    """
    end = time.monotonic() + seconds
    with suppress(NotLinear, NoValue):
        search = Unrolling(steps, Wanted(always, t.FALSE), seconds, is_wide=True)
        for count in range(1, (most or _MOST_STEPS) + 1):
            deadline.check()
            search.extended(count)
            if search.is_over:
                return count
            if time.monotonic() > end:
                break
    return None


class Unrolling:
    """The terms of the first steps, in a solver."""

    def __init__(self, steps: Steps, wanted: Wanted, seconds: float,
                 is_wide: bool = False) -> None:
        """Begin without a step; each query may take some seconds."""
        self._steps, self._wanted = steps, wanted
        self._translation = RealTranslation(is_wide)
        self.solver = new_solver(seconds)
        self._ranges = 0
        self._states = [[item.start for item in steps.state]]
        self._inputs: list[list[Term]] = []
        self._once: list[list[Term]] = []
        self._compute = function_of(
            [*(item.after for item in steps.state), wanted.always, wanted.last, *wanted.once],
            [*(item.now for item in steps.state), *steps.inputs])
        self.is_over = False

    def extended(self, count: int) -> Found | None:
        """Add a step, and return a run of that many steps, if there is one."""
        steps, wanted = self._steps, self._wanted
        inputs = [t.variable(f'{item.value}@{count}', item.sort) for item in steps.inputs]
        parts = {**dict(zip((item.now for item in steps.state), self._states[-1])),
                 **dict(zip(steps.inputs, inputs))}
        always, last, *rest = t.substituted(
            [wanted.always, wanted.last, *wanted.once, *(item.after for item in steps.state)],
            parts)
        once, after = rest[:len(wanted.once)], rest[len(wanted.once):]
        # The state after a step gets variables, so that terms do not grow with the steps.
        named = [t.variable(f'{item.now.value}@{count}', item.now.sort) for item in steps.state]
        self._inputs.append(inputs)
        self._once.append(once)
        for name, value in zip(named, after):
            self._add(t.same(name, value))
        for item, name in zip(steps.inputs, inputs):
            if item in steps.domains:
                size = steps.domains[item]
                self._add(t.negation(t.relation('flt', name, t.floating(0.0, item.sort[1])))
                          if size is None else
                          t.relation('ult', name, t.number(size, item.sort[1])))
        self._states.append(named)
        if wanted.repeats:
            self._add(always)
            goal = z3.Or(*(self._returns(start, count) for start in range(count)))
        else:
            goal = self._translation(last)
        self.solver.add(*self._translation.ranges[self._ranges:])
        self._ranges = len(self._translation.ranges)
        self.solver.push()
        self.solver.add(goal)
        answer = self.solver.check()
        model = self.solver.model() if answer == z3.sat else None
        self.solver.pop()
        confirmed = None
        if model is not None:
            confirmed = self._confirmed(model)
        if not wanted.repeats:
            self._add(always)
        self.is_over = self.solver.check() == z3.unsat
        return confirmed

    def once(self, step: int) -> list[Any]:
        """Return what is wanted once, at a step, as the solver has it."""
        return [self._translation(item) for item in self._once[step]]

    def stays(self) -> Any:
        """Return whether the last step leads to the state before it."""
        return z3.And(*(self._translation(t.same(left, right))
                        for left, right in zip(self._states[-2], self._states[-1])))

    def _add(self, item: Term) -> None:
        self.solver.add(self._translation(item))

    def _returns(self, start: int, count: int) -> Any:
        """Return whether the state after `count` steps is the one after `start`."""
        same = [self._translation(t.same(left, right)) for left, right
                in zip(self._states[start], self._states[count])]
        fulfilled = [z3.Or(*(self._translation(self._once[step][place])
                             for step in range(start, count)))
                     for place in range(len(self._wanted.once))]
        return z3.And(*same, *fulfilled)

    def _confirmed(self, model: Any) -> Found | None:
        """Compute a run again, with floats."""
        rows, states, flags = self.computed(model)
        if not self._wanted.repeats:
            is_so = all(flag[0] for flag in flags[:-1]) and flags[-1][1]
            return Found(tuple(rows), None) if is_so else None
        if not all(flag[0] for flag in flags):
            return None
        for start in range(len(rows)):
            if repr(states[start]) == repr(states[-1]) and all(
                    any(flag[2 + place] for flag in flags[start:])
                    for place in range(len(self._wanted.once))):
                return Found(tuple(rows), start)
        return None

    def computed(self, model: Any) -> tuple[list[Values], list[list[Any]], list[list[Any]]]:
        """
        Return the run of a model as floats have it.

        They are the values of the inputs at each step, the states from the first one on, and at
        each step the values of what is wanted: always, last, and each of once.
        """
        steps, size = self._steps, len(self._steps.state)
        state = [t.plain(item.start) for item in steps.state]
        rows: list[Values] = []
        states, flags = [state], []
        for inputs in self._inputs:
            values = [self._value(model, item) for item in inputs]
            found = self._compute(*state, *values)
            state = found[:size]
            states.append(state)
            flags.append(found[size:])
            rows.append(dict(zip(steps.inputs, values)))
        return rows, states, flags

    def _value(self, model: Any, item: Term) -> Any:
        shown = self._translation.variables.get(item)
        if shown is None:
            return {'bool': False, 'word': 0, 'real': 0.0}[item.sort[0]]
        return value_of(model.eval(shown, model_completion=True), item.sort)
