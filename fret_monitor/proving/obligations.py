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

"""Obligations of the functions in `fret_cells.h`: arbitrary arguments, a call, and the answer."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from fret_monitor.proving.c_source import ArithmeticType, Unreadable
from fret_monitor.proving.execution import Machine, Reference, Value
from fret_monitor.smt import terms as t
from fret_monitor.smt.solver import ProofAnswer, prove, prove_linear, shown_values
from fret_monitor.smt.terms import Term


@dataclass(frozen=True)
class Proof:
    """A proof obligation and its answer; `detail` explains a failure."""

    name: str
    answer: ProofAnswer
    seconds: float
    detail: str = ''

    @property
    def is_proved(self) -> bool:
        """Whether it is proved."""
        return self.answer is ProofAnswer.PROVED

    def after(self, other: 'Proof') -> 'Proof':
        """Return this proof with the time of another one added."""
        return replace(self, seconds=self.seconds + other.seconds)


def settled(name: str, goals: Sequence[Term], given: Sequence[Term], machine: Machine,
            seconds: float, *, is_linear: bool = False) -> Proof:
    """
    Prove some goals, and that the behaviour of a machine was defined.

    With `is_linear`, the solver is given words as integers.
    """
    spent = 0.0
    for goal in [*(item.holds for item in machine.conditions), *goals]:
        result = prove_linear(goal, given, seconds=seconds) if is_linear else \
            prove([goal], given, seconds=seconds)
        spent += result.seconds
        if result.answer is not ProofAnswer.PROVED:
            return Proof(name, result.answer, spent, shown_values(result.values))
    return Proof(name, ProofAnswer.PROVED, spent)


def anything(name: str, kind: ArithmeticType) -> Value:
    """Return an arbitrary value of a type."""
    sort = t.BOOL if kind.kind == 'bool' else t.word(kind.bits)
    return Value(kind, t.variable(name, sort))


def called(machine: Machine, name: str, arguments: Sequence[Value | Reference]) -> Term:
    """Call a function, and return its result."""
    found = machine.call(name, arguments)
    if not isinstance(found, Value):
        raise Unreadable(f'{name} returns nothing')
    return found.term
