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

The cells of a group that steps at ticks are left to a subclass: one that knows its C functions by
their contracts is in `proving/group_contract.py`.
"""

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from typing import assert_never

from fret_monitor.model.values import ValueType
from fret_monitor.program.layout import FieldKind, ring_lengths, SHIFT_REGISTER_BITS
from fret_monitor.program.monitor_program import (
    AlwaysSoFar, AlwaysWithin, ApplyBinary, ApplyUnary, BitCell, Choose, Convert, CounterCell,
    Delay, FeedbackRead, FirstStep, Greatest, Hold, Literal, OnceBefore, OnceEver, OnceWithin,
    Operand, operands, Operation, OutcomesTest, Overflowed, Power, PreviousNumber, Read,
    Rounded, SinceBefore, SinceBetween, SinceEver, SinceWithin, SlopeBetween, StepGroup, Tally,
    TimeAtLeast, Total, TrialOutcome, TriggeredEver, ValueAgo, WindowState,
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


NEVER = t.number((1 << 63) - 1, 64)
LAST_TICK = t.number((1 << 62) - 3, 64)
FIRST_TICK = t.number(0, 64)


class NotModelled(Exception):
    """A transition system does not have a cell: one for ticks, or a window of numbers."""


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

    `verdicts` are by the index of the requirement, and so are `occurrences`, of the requirements
    that report them with a verdict of their own. `invariants` hold in every reachable state.
    `values` are those of the equations. In a group that steps at ticks, `due` is the next tick at
    which a value can change although no input does. It has a variable (`asked_variable`) for each
    of `asked`: the next tick of a cell, or whether something changes at the tick after this one.
    """

    verdicts: Mapping[int, Term]
    state: tuple[StateVariable, ...]
    invariants: tuple[Term, ...]
    occurrences: Mapping[int, Term]
    values: tuple[Term, ...]
    due: Term | None = None
    asked: tuple[Term, ...] = ()


def transition_system(group: StepGroup, inputs: Mapping[int, Term],
                      prefix: str) -> TransitionSystem:
    """
    Return the transition system of a group.

    `inputs` are by index of the signal; names of state variables begin with `prefix`.
    """
    return SystemBuilder(group, inputs, prefix).build()


def is_tick(tick: Term) -> Term:
    """Return whether a word is a tick at which a group can step."""
    return t.conjunction(t.relation('sle', FIRST_TICK, tick), t.relation('sle', tick, LAST_TICK))


def asked_variable(number: int, item: Term) -> Term:
    """Return the variable that stands for an item of `TransitionSystem.asked`."""
    return t.variable(f'asked.{number}', item.sort)


def earlier_if(condition: Term, tick: Term, other: Term) -> Term:
    """Return the earlier one of two ticks; the other one if the condition does not hold."""
    return t.choice(t.conjunction(condition, t.relation('slt', tick, other)), tick, other)


def earlier(tick: Term, other: Term) -> Term:
    """Return the earlier one of two ticks."""
    return earlier_if(t.TRUE, other, tick)


def _divided(found: Sequence[tuple[int, Term]], ends: Sequence[int]) -> list[list[Term]]:
    """Divide terms by the part of their equation; `ends` are those of all but the last."""
    parts: list[list[Term]] = [[] for _ in range(len(ends) + 1)]
    for index, item in found:
        parts[bisect_right(ends, index)].append(item)
    return parts


def counter_model(operation: CounterCell) -> CounterModel:
    """Return the model of a counter cell."""
    return COUNTERS[_COUNTERS[type(operation)]]


def counter_start(operation: CounterCell) -> Term:
    """Return the initial number of a counter."""
    head = operation.head if isinstance(operation, OnceWithin | AlwaysWithin) else 0
    bound = t.number(operation.bound, WIDTH)
    return counter_model(operation).start(bound, t.number(head, WIDTH))


class SystemBuilder:
    """
    Builds a transition system; subclasses can override `current`, `current_bit` and cells.

    `tick` is that of the step, in a group that steps at ticks. There each cell adds to `dues` the
    next tick at which its value can change, or to `unsettled` whether that is the one after this,
    with the index of its equation. `parts` only decides the order in which these are compared.
    """

    def __init__(self, group: StepGroup, inputs: Mapping[int, Term], prefix: str,
                 tick: Term = FIRST_TICK) -> None:
        """Store the group, its inputs, the prefix of state variables, and the tick."""
        self.tick = tick
        self.dues: list[tuple[int, Term]] = []
        self.unsettled: list[tuple[int, Term]] = []
        self._asked: list[Term] = []
        self.parts: Sequence[range] = (range(len(group.equations)),)
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
            self._add_previous(FieldKind.FEEDBACK, number, self._feedback[number],
                               numbers.constant(0, item.type), self._operand(item.next))
        verdicts = {number: self._operand(operand) for number, operand
                    in zip(group.properties, group.verdicts, strict=True)}
        occurrences = {number: self._operand(operand) for number, operand in group.occurrences}
        if group.is_timed:
            self._invariants.append(is_tick(self.tick))
        return TransitionSystem(verdicts, tuple(self._state), tuple(self._invariants),
                                occurrences, tuple(self._values), self._due(), tuple(self._asked))

    def _due(self) -> Term | None:
        """Return the next tick at which a value can change although no input does."""
        if not self._group.is_timed:
            return None
        ends = [part.stop for part in self.parts[:-1]]
        dues, unsettled = _divided(self.dues, ends), _divided(self.unsettled, ends)
        founds = [self._due_of_part(*pair) for pair in zip(dues, unsettled, strict=True)]
        return founds[0] if len(founds) == 1 else reduce(earlier, founds, NEVER)

    def _due_of_part(self, dues: Sequence[Term], unsettled: Sequence[Term]) -> Term:
        found = NEVER
        for due in dues:
            found = earlier(found, self._asks(due))
        if not unsettled:
            return found
        is_next = self._asks(t.negation(t.all_of(t.negation(item) for item in unsettled)))
        return earlier_if(is_next, t.operation('add', self.tick, t.number(1, 64)), found)

    def _asks(self, item: Term) -> Term:
        self._asked.append(item)
        return asked_variable(len(self._asked) - 1, item)

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

    def _add_previous(self, kind: FieldKind, number: int, now: Term, start: Term,
                      after: Term) -> None:
        """Add a state variable that is the value of something at the step before."""
        self.add(kind, number, now, start, after)
        place = len(self._group.equations) if kind is FieldKind.FEEDBACK else number
        self.unsettled.append((place, t.negation(t.same(now, after))))

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

    def type_of(self, operand: Operand) -> ValueType:
        """Return the type of an operand."""
        return self._group.equations[operand.value].type

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
                self._add_previous(FieldKind.NUMBER, index, before,
                                   numbers.constant(operation.initial, type),
                                   self._operand(operation.argument))
                return before
            case Tally() | Hold():
                return self._kept(index, operation, type)
            case ValueAgo() | Greatest() | Total() | TimeAtLeast() | SlopeBetween():
                return self.window(index, operation, type,
                                   [self._operand(item) for item in operands(operation)])
            case Rounded():
                return self.rounded(self._operand(operation.total), operation.is_mean)
            case TrialOutcome() | OutcomesTest():
                raise ValueError('a test of a probability is no part of a transition system')
            case FeedbackRead():
                return self._feedback[operation.index]
            case SinceBetween():
                return self.queue(index, operation,
                                  [self._operand(item) for item in operands(operation)])
            case Overflowed():
                return self.overflowed(index, operation.argument.value)
            case _:
                assert_never(operation)

    def _kept(self, index: int, operation: Tally | Hold, type: ValueType) -> Term:
        """Return the value of a cell that is its value at the previous step, changed."""
        before = self.current(FieldKind.NUMBER, index, numbers.sort_of(type))
        first, second = map(self._operand, operands(operation))
        if isinstance(operation, Hold):
            now = t.choice(first, second, before)
        else:
            more = t.operation('add', before, t.from_truth(first, type.bits))
            now = t.operation('sub', more, t.from_truth(second, type.bits))
        self.add(FieldKind.NUMBER, index, before, numbers.constant(0, type), now)
        return now

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
                self._add_previous(FieldKind.FLAG, index, before, t.TRUE, t.FALSE)
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
            self._add_previous(FieldKind.FLAG, index, before, t.truth(operation.initial),
                               argument)
            return before
        if operation.steps > SHIFT_REGISTER_BITS:
            return self.ring(index, operation, argument)
        return self.line(index, operation, argument)

    # -- cells of more than one bit -----------------------------------------------------------

    def counter(self, index: int, operation: CounterCell, arguments: list[Term]) -> Term:
        """Add a counter, and return what the cell returns."""
        if self._group.is_timed:
            raise NotModelled('counters')
        number = self.current(FieldKind.COUNTER, index, t.word(WIDTH))
        bound = t.number(operation.bound, WIDTH)
        out, after = counter_model(operation).step(number, bound, arguments)
        self.add(FieldKind.COUNTER, index, number, counter_start(operation), after,
                 limit=operation.bound)
        return out

    def queue(self, index: int, operation: SinceBetween, arguments: list[Term]) -> Term:
        """Add a queue, and return what the cell returns."""
        raise NotModelled('queues')

    def window(self, index: int, operation: WindowState, type: ValueType,
               arguments: list[Term]) -> Term:
        """Add a window of numbers, and return what the cell returns; an exact sum: its state."""
        raise NotModelled('windows of numbers')

    def rounded(self, total: Term, is_mean: bool) -> Term:
        """Return the sum or mean of an exact sum."""
        raise NotModelled('windows of numbers')

    def overflowed(self, index: int, queue: int) -> Term:
        """Return whether the queue of equation `queue` lacks an interval at this tick."""
        raise NotModelled('queues')

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
