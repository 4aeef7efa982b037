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
Proofs by a solver that no trace meets a goal, or such a trace; needs z3.

By k-induction over the transition system: no trace of up to k steps meets the goal, and no k steps
in a row that do not meet it are followed by one that does, from any state. Then no trace of any
length meets it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from time import monotonic
from typing import Any

from fret_monitor.logic.specification import Property, Signal, Specification
from fret_monitor.model.policies import Policy
from fret_monitor.program.lower import lower
from fret_monitor.program.monitor_program import Delay, StepGroup
from fret_monitor.smt import numbers
from fret_monitor.smt import terms as t
from fret_monitor.smt.solver import ProofAnswer, prove
from fret_monitor.smt.terms import Term
from fret_monitor.smt.transition import NotModelled, transition_system
from fret_monitor.traces.deadline import Deadline
from fret_monitor.traces.trace import Row

_MOST_STEPS = 12
_QUERY_S = 2.0
_GOAL_S = 6.0
_MOST_EQUATIONS = 200
_MOST_DELAY = 256  # steps


@dataclass(frozen=True)
class ProofOutcome:
    """`rows` are a trace that meets the goal; if None, no trace of up to `steps` steps does."""

    is_proved: bool
    steps: int
    rows: tuple[Row, ...] | None = None


def prove_never(specification: Specification, goal: Property, signals: Sequence[Signal],
                deadline: Deadline) -> ProofOutcome:
    """
    Prove that the formula of `goal`, over inputs of some signals, is false at each step.

    Under `timed`, a step is a nanosecond.
    """
    program = lower(replace(specification, signals=tuple(signals), properties=(goal,),
                            definitions=(), policy=Policy.EVERY_MESSAGE, period=None))
    group = program.groups[0]
    if len(group.equations) > _MOST_EQUATIONS or any(
            isinstance(each.operation, Delay) and each.operation.steps > _MOST_DELAY
            for each in group.equations):
        return ProofOutcome(False, 0)
    try:
        unrolled = _Unrolled(group, signals)
    except NotModelled:
        return ProofOutcome(False, 0)
    until = monotonic() + _GOAL_S
    for steps in range(1, _MOST_STEPS + 1):
        deadline.check()
        if monotonic() > until:
            return ProofOutcome(False, steps - 1)
        found = unrolled.base(steps)
        if found is None:
            return ProofOutcome(False, steps - 1)
        if found:
            return ProofOutcome(False, steps - 1, found)
        if unrolled.is_inductive(steps):
            return ProofOutcome(True, steps)
    return ProofOutcome(False, _MOST_STEPS)


class _Unrolled:

    def __init__(self, group: StepGroup, signals: Sequence[Signal]) -> None:
        self._signals = signals
        self._inputs = {number: t.variable(f'input.{number}', numbers.sort_of(signal.type))
                        for number, signal in enumerate(signals)}
        self._system = transition_system(group, self._inputs, 'state')
        self._goal = next(iter(self._system.verdicts.values()))
        self._steps: list[Term] = []  # the goal at each step, from any state
        self._state = [item.start for item in self._system.state]
        self._any = [item.now for item in self._system.state]

    def _given(self, steps: int) -> list[Term]:
        """Return that string inputs have a value of theirs, and that norms are not negative."""
        return [t.relation('ult', self._input(number, step), t.number(
            len(signal.values), signal.type.bits)) for number, signal in enumerate(self._signals)
            if signal.is_string for step in range(steps)] + [
            t.negation(t.relation('flt', self._input(number, step), t.floating(
                0.0, signal.type.bits))) for number, signal in enumerate(self._signals)
            if signal.is_never_negative for step in range(steps)]

    def _input(self, number: int, step: int) -> Term:
        return t.variable(f'input.{number}.{step}', self._inputs[number].sort)

    def _after(self, state: Sequence[Term], step: int) -> tuple[Term, list[Term]]:
        """Return the goal at a step, and the state after it."""
        parts = dict(zip((item.now for item in self._system.state), state, strict=True))
        parts.update((item, self._input(number, step)) for number, item in self._inputs.items())
        goal, *after = t.substituted(
            [self._goal, *(item.after for item in self._system.state)], parts)
        return goal, after

    def base(self, steps: int) -> tuple[Row, ...] | None:
        """Return a trace of `steps` steps that meets the goal; empty: there is none."""
        goal, self._state = self._after(self._state, steps - 1)
        found = prove([t.negation(goal)], self._given(steps), seconds=_QUERY_S)
        match found.answer:
            case ProofAnswer.PROVED:
                return ()
            case ProofAnswer.UNKNOWN:
                return None
        return tuple(self._row(found.values, step) for step in range(steps))

    def _row(self, values: Mapping[Term, Any], step: int) -> Row:
        return tuple(numbers.input_value(values.get(self._input(number, step), 0), signal.type)
                     for number, signal in enumerate(self._signals))

    def is_inductive(self, steps: int) -> bool:
        """Whether the goal is not met after `steps` steps from any state that do not meet it."""
        goal, self._any = self._after(self._any, steps - 1)
        before, self._steps = list(self._steps), [*self._steps, goal]
        given = [*self._given(steps), *self._system.invariants, *map(t.negation, before)]
        return prove([t.negation(goal)], given, seconds=_QUERY_S).answer is ProofAnswer.PROVED
