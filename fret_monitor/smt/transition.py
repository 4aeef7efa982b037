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
The transition system of a step group as terms: state, initial state and step.

It implements the semantics in the docstrings of `program/monitor_program.py` and shares no code
with the code generator, so that a proof compares two implementations. A counter is a natural
number that saturates far above every bound; a delay is a shift register or a ring (`cells.py`).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import assert_never

from fret_monitor.model.values import ValueType
from fret_monitor.program.layout import FieldKind, ring_lengths, SHIFT_REGISTER_BITS
from fret_monitor.program.monitor_program import (
    AlwaysSoFar, AlwaysWithin, ApplyBinary, ApplyUnary, BitCell, Choose, Convert, CounterCell,
    Delay, FeedbackRead, FirstStep, Literal, OnceBefore, OnceEver, OnceWithin, Operand, operands,
    Operation, Overflowed, Power, PreviousNumber, Read, SinceBefore, SinceBetween, SinceEver,
    SinceWithin, StepGroup, TriggeredEver,
)
from fret_monitor.smt import numbers
from fret_monitor.smt import terms as t
from fret_monitor.smt.cells import (
    CounterModel, COUNTERS, HISTORY, line_start, line_step, next_position, ring_step, WIDTH,
)
from fret_monitor.smt.terms import Sort, Term

_COUNTERS: dict[type[Operation], str] = {
    OnceWithin: 'once_within', AlwaysWithin: 'always_within', SinceWithin: 'since_within',
    OnceBefore: 'once_before', SinceBefore: 'since_before',
}


@dataclass(frozen=True)
class StateVariable:
    """
    A state variable: its value before a step, in the initial state, and after the step.

    `kind` and `number` are those of the field in the layout. A bit is a FLAG with the index of its
    equation, whether the layout packs it or not. Values above `limit` are equivalent, and so are
    values that agree in the bits of `mask`.
    """

    kind: FieldKind
    number: int
    now: Term
    start: Term
    after: Term
    limit: int | None = None
    mask: int | None = None

    @property
    def name(self) -> str:
        """Return the name of the field in C, unless it is packed."""
        return f'{self.kind.value}_{self.number}'


@dataclass(frozen=True)
class TransitionSystem:
    """
    A step group as terms over its inputs and its state.

    `verdicts` are by the index of the requirement; `invariants` hold in every reachable state.
    """

    verdicts: Mapping[int, Term]
    state: tuple[StateVariable, ...]
    invariants: tuple[Term, ...]


def transition_system(group: StepGroup, inputs: Mapping[int, Term],
                      prefix: str) -> TransitionSystem:
    """
    Return the transition system of a group.

    `inputs` are by index of the signal; names of state variables begin with `prefix`.
    """
    return SystemBuilder(group, inputs, prefix).build()


def counter_model(operation: CounterCell) -> CounterModel:
    """Return the model of a counter cell."""
    return COUNTERS[_COUNTERS[type(operation)]]


def counter_start(operation: CounterCell) -> Term:
    """Return the initial number of a counter."""
    head = operation.head if isinstance(operation, OnceWithin | AlwaysWithin) else 0
    bound = t.number(operation.bound, WIDTH)
    return counter_model(operation).start(bound, t.number(head, WIDTH))


class SystemBuilder:
    """Builds a transition system; subclasses can override `current`, `current_bit` and cells."""

    def __init__(self, group: StepGroup, inputs: Mapping[int, Term], prefix: str) -> None:
        """Store the group, its inputs, and the prefix of state variables."""
        self._group = group
        self._inputs = inputs
        self._prefix = prefix
        self._values: list[Term] = []
        self._feedback: list[Term] = []
        self._state: list[StateVariable] = []
        self._invariants: list[Term] = []
        self.positions: dict[int, Term] = {}
        """The positions in rings, by length, as words of 32 bits."""

    def build(self) -> TransitionSystem:
        """Evaluate the equations in their order."""
        group = self._group
        self._feedback = [
            self.current(FieldKind.FEEDBACK, number, numbers.sort_of(item.type))
            for number, item in enumerate(group.feedback)]
        for length in ring_lengths(group):
            self._add_position(length)
        for index, equation in enumerate(group.equations):
            self._values.append(self._value(index, equation.operation, equation.type))
        for number, item in enumerate(group.feedback):
            self.add(FieldKind.FEEDBACK, number, self._feedback[number],
                     numbers.constant(0, item.type), self._operand(item.next))
        verdicts = {number: self._operand(operand) for number, operand
                    in zip(group.properties, group.verdicts, strict=True)}
        return TransitionSystem(verdicts, tuple(self._state), tuple(self._invariants))

    # -- state --------------------------------------------------------------------------------

    def current(self, kind: FieldKind, number: int, sort: Sort) -> Term:
        """Return the value of a state variable before the step."""
        return t.variable(f'{self._prefix}.{kind.value}_{number}', sort)

    def current_bit(self, index: int) -> Term:
        """Return the value of a bit before the step."""
        return self.current(FieldKind.FLAG, index, t.BOOL)

    def add(self, kind: FieldKind, number: int, now: Term, start: Term, after: Term,
            limit: int | None = None, mask: int | None = None) -> None:
        """Add a state variable."""
        self._state.append(StateVariable(kind, number, now, start, after, limit, mask))

    def _add_position(self, length: int) -> None:
        now = self.current(FieldKind.POSITION, length, t.word(32))
        bits = now.sort[1]
        wide = self.positions[length] = t.resized(now, 32, False)
        self.add(FieldKind.POSITION, length, now, t.number(0, bits),
                 t.resized(next_position(wide, length), bits, False))
        self._invariants.append(t.relation('ult', wide, t.number(length, 32)))

    # -- equations ----------------------------------------------------------------------------

    def _operand(self, operand: Operand) -> Term:
        value = t.TRUE if operand.is_constant else self._values[operand.value]
        return t.negation(value) if operand.negated else value

    def _value(self, index: int, operation: Operation, type: ValueType) -> Term:
        match operation:
            case Read():
                return self._inputs[operation.signal]
            case Literal():
                return numbers.constant(operation.value, type)
            case Convert():
                return numbers.convert(self._operand(operation.argument), operation.source, type)
            case ApplyUnary():
                return numbers.unary(operation.operator, self._operand(operation.argument), type)
            case ApplyBinary():
                return numbers.binary(operation.operator, self._operand(operation.left),
                                      self._operand(operation.right), operation.types)
            case Power():
                return numbers.power(self._operand(operation.base), operation.exponent, type)
            case Choose():
                return t.choice(*(self._operand(item) for item in operands(operation)))
            case FirstStep() | OnceEver() | AlwaysSoFar() | SinceEver() | TriggeredEver():
                return self._bit(index, operation)
            case Delay():
                return self._delay(index, operation)
            case OnceWithin() | AlwaysWithin() | OnceBefore() | SinceWithin() | SinceBefore():
                return self.counter(index, operation,
                                    [self._operand(item) for item in operands(operation)])
            case PreviousNumber():
                before = self.current(FieldKind.NUMBER, index, numbers.sort_of(type))
                self.add(FieldKind.NUMBER, index, before,
                         numbers.constant(operation.initial, type),
                         self._operand(operation.argument))
                return before
            case FeedbackRead():
                return self._feedback[operation.index]
            case SinceBetween() | Overflowed():
                raise ValueError('a group that steps at ticks has no transition system')
            case _:
                assert_never(operation)

    def _add_bit(self, index: int, now: Term, start: bool, after: Term) -> None:
        self.add(FieldKind.FLAG, index, now, t.truth(start), after)

    def _bit(self, index: int, operation: BitCell) -> Term:
        """
        Return the value of a one-bit cell, whose state is its value at the previous step.

        The state of FTP is whether the step is the first.
        """
        before = self.current_bit(index)
        match operation:
            case FirstStep():
                self._add_bit(index, before, True, t.FALSE)
                return before
            case OnceEver():
                now, start = t.disjunction(before, self._operand(operation.argument)), False
            case AlwaysSoFar():
                now, start = t.conjunction(before, self._operand(operation.argument)), True
            case SinceEver():
                kept = t.conjunction(self._operand(operation.left), before)
                now, start = t.disjunction(self._operand(operation.right), kept), False
            case TriggeredEver():
                freed = t.disjunction(self._operand(operation.left), before)
                now, start = t.conjunction(self._operand(operation.right), freed), True
            case _:
                assert_never(operation)
        self._add_bit(index, before, start, now)
        return now

    def _delay(self, index: int, operation: Delay) -> Term:
        argument = self._operand(operation.argument)
        if operation.steps == 1:
            before = self.current_bit(index)
            self._add_bit(index, before, operation.initial, argument)
            return before
        if operation.steps > SHIFT_REGISTER_BITS:
            return self.ring(index, operation, argument)
        return self.line(index, operation, argument)

    # -- cells of more than one bit -----------------------------------------------------------

    def counter(self, index: int, operation: CounterCell, arguments: list[Term]) -> Term:
        """Add a counter, and return what the cell returns."""
        number = self.current(FieldKind.COUNTER, index, t.word(WIDTH))
        bound = t.number(operation.bound, WIDTH)
        out, after = counter_model(operation).step(number, bound, arguments)
        self.add(FieldKind.COUNTER, index, number, counter_start(operation), after,
                 limit=operation.bound)
        return out

    def line(self, index: int, operation: Delay, argument: Term) -> Term:
        """Add a shift register, and return what the cell returns."""
        history = self.current(FieldKind.LINE, index, t.word(HISTORY))
        out, after = line_step(history, operation.steps, argument)
        self.add(FieldKind.LINE, index, history, line_start(operation.initial), after,
                 mask=(1 << operation.steps) - 1)
        return out

    def ring(self, index: int, operation: Delay, argument: Term) -> Term:
        """Add a ring, and return what the cell returns."""
        size = -(-operation.steps // 8)
        ring = self.current(FieldKind.RING, index, t.ring(size))
        out, after = ring_step(ring, self.positions[operation.steps], argument)
        self.add(FieldKind.RING, index, ring, ring_start(operation), after)
        return out


def ring_start(operation: Delay) -> Term:
    """Return the bytes with which a ring starts."""
    return t.filled(-(-operation.steps // 8), 255 if operation.initial else 0)
