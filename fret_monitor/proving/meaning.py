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
What a step of a group is to compute, from the equations of the program.

Written from the docstrings of `program/monitor_program.py`, not from how C is made of it. Where
each equation's state lies is taken from the layout: a place that is not right makes a proof fail,
and no wrong proof come out.

There are three views of a cell's state. By CONTRACT it is the C state, and what the cell does to
it the unknown function that the C function's contract gives. OPEN relates the C state to the
numbers of `cells.py` by the invariants, and the C functions' bodies are looked into. ALONE has no
C: the numbers alone, to be run.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import auto, Enum
from typing import assert_never

from fret_monitor.model.values import ValueType
from fret_monitor.program.layout import FieldKind, GroupLayout, ring_lengths, SHIFT_REGISTER_BITS
from fret_monitor.program.monitor_program import (
    AlwaysSoFar, AlwaysWithin, ApplyBinary, ApplyUnary, Choose, Convert, CounterCell, Delay,
    FeedbackRead, FirstStep, Literal, OnceBefore, OnceEver, OnceWithin, Operand, operands,
    Operation, Power, PreviousNumber, Read, SinceBefore, SinceEver, SinceWithin, TriggeredEver,
)
from fret_monitor.proving.contracts import cell_terms
from fret_monitor.proving.execution import Memory, Path
from fret_monitor.smt import numbers
from fret_monitor.smt import terms as t
from fret_monitor.smt.cells import (
    COUNTERS, HISTORY, line_fits, line_related, line_start, line_step, next_position, ring_step,
    WIDTH,
)
from fret_monitor.smt.terms import Term

_COUNTERS: dict[type[Operation], str] = {
    OnceWithin: 'once_within', AlwaysWithin: 'always_within', SinceWithin: 'since_within',
    OnceBefore: 'once_before', SinceBefore: 'since_before',
}


class View(Enum):
    """How a cell's state is seen."""

    CONTRACT = auto()
    OPEN = auto()
    ALONE = auto()


@dataclass(frozen=True)
class Check:
    """Something that has to hold of memory; `what` is it about."""

    what: str
    holds: Callable[[Memory], Term]


@dataclass(frozen=True)
class Kept:
    """
    A value that the view ALONE keeps: what it is at the start and after a step.

    All values above `limit` mean the same, and so do all with the same bits under `mask`.
    """

    now: Term
    start: Term
    after: Term
    limit: int | None = None
    mask: int | None = None


@dataclass
class GroupMeaning:
    """
    What a step and a reset of a group are to do.

    `verdicts` are by the index of the requirement. After a step, wherever `given` holds before
    it, `steps` have to; after a reset, `starts`. `fits` says of what layout chose whether it is
    wide enough.
    """

    verdicts: dict[int, Term] = field(default_factory=dict)
    given: list[Term] = field(default_factory=list)
    steps: list[Check] = field(default_factory=list)
    starts: list[Check] = field(default_factory=list)
    kept: list[Kept] = field(default_factory=list)
    fits: list[tuple[str, bool]] = field(default_factory=list)


def state_path(group: int, kind: FieldKind, number: int) -> Path:
    """Return where a field of a group's state lies."""
    return ('state', f'group_{group}', f'{kind.value}_{number}')


def group_meaning(layout: GroupLayout, group: int, memory: Mapping[Path, Term],
                  inputs: Mapping[int, Term], view: View) -> GroupMeaning:
    """
    Say what a step of a group is to do.

    `memory` holds the state before it (with ALONE, nothing), `inputs` the inputs by their index.

    Raises
    ------
    KeyError
        if the C state lacks a field.
    """
    return _Group(layout, group, memory, inputs, view).run()


class _Group:

    def __init__(self, layout: GroupLayout, group: int, memory: Mapping[Path, Term],
                 inputs: Mapping[int, Term], view: View) -> None:
        self._layout = layout
        self._group = group
        self._memory = memory
        self._inputs = inputs
        self._view = view
        self._values: list[Term] = []
        self._positions: dict[int, Term] = {}
        self._feedback: list[Term] = []
        self._found = GroupMeaning()

    def run(self) -> GroupMeaning:
        equations = self._layout.group
        self._feedback = [self._scalar(FieldKind.FEEDBACK, number, item.type)
                          for number, item in enumerate(equations.feedback)]
        for length in ring_lengths(equations):
            self._ring_position(length)
        for index, equation in enumerate(equations.equations):
            self._values.append(self._value(index, equation.operation, equation.type))
        for number, item in enumerate(equations.feedback):
            self._keep(FieldKind.FEEDBACK, number, self._feedback[number],
                       numbers.constant(0, item.type), self._operand(item.next))
        for number, operand in zip(equations.properties, equations.verdicts, strict=True):
            self._found.verdicts[number] = self._operand(operand)
        return self._found

    def _operand(self, operand: Operand) -> Term:
        value = t.TRUE if operand.is_constant else self._values[operand.value]
        return t.negation(value) if operand.negated else value

    # -- state --------------------------------------------------------------------------------

    def _field(self, kind: FieldKind, number: int) -> Path:
        return state_path(self._group, kind, number)

    def _scalar(self, kind: FieldKind, number: int, type: ValueType) -> Term:
        """Return what a field holds before the step."""
        if self._view is View.ALONE:
            return t.variable(f'meant.{self._group}.{kind.value}_{number}',
                              numbers.sort_of(type))
        return self._memory[self._field(kind, number)]

    def _keep(self, kind: FieldKind, number: int, now: Term, start: Term, after: Term) -> None:
        """Have a field hold exactly this after a reset, and after a step."""
        path = self._field(kind, number)
        if self._view is View.ALONE:
            self._found.kept.append(Kept(now, start, after))
            return
        self._found.starts.append(Check(str(path[-1]), lambda memory: _same(memory[path], start)))
        self._found.steps.append(Check(str(path[-1]), lambda memory: _same(memory[path], after)))

    def _keep_related(self, name: str, path: Path, now: Term, start: Term, after: Term,
                      related: Callable[[Term, Term], Term], limit: int | None = None,
                      mask: int | None = None) -> None:
        """Have the C state at a path be related to a number that is kept beside it."""
        if self._view is View.ALONE:
            self._found.kept.append(Kept(now, start, after, limit, mask))
            return
        self._found.given.append(related(self._memory[path], now))
        self._found.starts.append(Check(name, lambda memory: related(memory[path], start)))
        self._found.steps.append(Check(name, lambda memory: related(memory[path], after)))

    def _old_bit(self, index: int) -> Term:
        if self._view is View.ALONE:
            return t.variable(f'meant.{self._group}.bit_{index}', t.BOOL)
        slot = self._layout.bits.get(index)
        if slot is None:
            return self._memory[self._field(FieldKind.FLAG, index)]
        return t.bit(self._memory[self._field(FieldKind.BITS, slot.word)], slot.bit)

    def _keep_bit(self, index: int, now: Term, start: bool, after: Term) -> None:
        slot = self._layout.bits.get(index)
        if slot is None or self._view is View.ALONE:
            self._keep(FieldKind.FLAG, index, now, t.truth(start), after)
            return
        path, place = self._field(FieldKind.BITS, slot.word), slot.bit
        name = f'{path[-1]}, bit {place}'
        self._found.starts.append(Check(
            name, lambda memory: _same(t.bit(memory[path], place), t.truth(start))))
        self._found.steps.append(Check(
            name, lambda memory: _same(t.bit(memory[path], place), after)))

    def _ring_position(self, length: int) -> None:
        path = self._field(FieldKind.POSITION, length)
        now = t.variable(f'meant.{self._group}.position_{length}', t.word(32)) \
            if self._view is View.ALONE else self._memory[path]
        wide = t.resized(now, 32, False)
        after = next_position(wide, length)
        self._positions[length] = wide
        start = t.number(0, now.sort[1])
        self._keep(FieldKind.POSITION, length, now, start, t.resized(after, now.sort[1], False))
        self._found.given.append(t.relation('ult', wide, t.number(length, 32)))
        self._found.fits.append((f'position_{length}', length <= 1 << now.sort[1]))

    # -- equations ----------------------------------------------------------------------------

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
                return self._counter(index, operation)
            case PreviousNumber():
                before = self._scalar(FieldKind.NUMBER, index, type)
                self._keep(FieldKind.NUMBER, index, before,
                           numbers.constant(operation.initial, type),
                           self._operand(operation.argument))
                return before
            case FeedbackRead():
                return self._feedback[operation.index]
            case _:
                assert_never(operation)

    def _bit(self, index: int, operation: Operation) -> Term:
        """
        Return what a cell of one bit gives; the bit is what it gave the step before.

        Of FTP it is whether the step is the first.
        """
        before = self._old_bit(index)
        match operation:
            case FirstStep():
                self._keep_bit(index, before, True, t.FALSE)
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
                raise ValueError(f'{operation} is no bit')
        self._keep_bit(index, before, start, now)
        return now

    def _delay(self, index: int, operation: Delay) -> Term:
        argument = self._operand(operation.argument)
        if operation.steps == 1:
            before = self._old_bit(index)
            self._keep_bit(index, before, operation.initial, argument)
            return before
        if operation.steps > SHIFT_REGISTER_BITS:
            return self._ring(index, operation, argument)
        return self._line(index, operation, argument)

    def _line(self, index: int, operation: Delay, argument: Term) -> Term:
        path, steps = self._field(FieldKind.LINE, index), operation.steps
        if self._view is View.CONTRACT:
            line = self._memory[path]
            count = t.number(steps, 32)
            out, after = cell_terms(f'delay.{line.sort[1]}', line, count, argument)
            start = t.number((1 << steps) - 1 if operation.initial else 0, line.sort[1])
            self._keep(FieldKind.LINE, index, line, start, after)
            fits = line_fits(count, line.sort[1]) is t.TRUE
            self._found.fits.append((f'line_{index}', fits))
            return out
        history = t.variable(f'meant.{self._group}.line_{index}', t.word(HISTORY))
        out, after = line_step(history, steps, argument)
        self._keep_related(f'line_{index}', path, history, line_start(operation.initial), after,
                           lambda line, meant: line_related(line, meant, steps),
                           mask=(1 << steps) - 1)
        return out

    def _ring(self, index: int, operation: Delay, argument: Term) -> Term:
        size = -(-operation.steps // 8)
        if self._view is View.ALONE:
            ring = t.variable(f'meant.{self._group}.ring_{index}', t.ring(size))
        else:
            ring = self._memory[self._field(FieldKind.RING, index)]
        position = self._positions[operation.steps]
        if self._view is View.CONTRACT:
            out, after = cell_terms('delay_ring', ring, position, argument)
        else:
            out, after = ring_step(ring, position, argument)
        start = t.filled(size, 255 if operation.initial else 0)
        self._keep(FieldKind.RING, index, ring, start, after)
        self._found.fits.append((f'ring_{index}', ring.sort == t.ring(size)))
        return out

    def _counter(self, index: int, operation: CounterCell) -> Term:
        cell = COUNTERS[_COUNTERS[type(operation)]]
        arguments = [self._operand(item) for item in operands(operation)]
        path, bound = self._field(FieldKind.COUNTER, index), t.number(operation.bound, WIDTH)
        head = operation.head if isinstance(operation, OnceWithin | AlwaysWithin) else 0
        start = cell.start(bound, t.number(head, WIDTH))
        if self._view is View.CONTRACT:
            counter = self._memory[path]
            bits = counter.sort[1]
            out, after = cell_terms(f'{cell.name}.{bits}', counter,
                                    t.number(operation.bound, bits), *arguments)
            self._keep(FieldKind.COUNTER, index, counter, t.resized(start, bits, False), after)
            fits = cell.fits(bound, bits) is t.TRUE and 0 <= head <= operation.bound + 1 \
                and operation.bound < 1 << 32
            self._found.fits.append((f'counter_{index}', fits))
            return out
        number = t.variable(f'meant.{self._group}.counter_{index}', t.word(WIDTH))
        out, after = cell.step(number, bound, arguments)
        self._keep_related(f'counter_{index}', path, number, start, after,
                           lambda counter, meant: cell.related(counter, meant, bound),
                           limit=operation.bound)
        return out


def _same(found: Term, wanted: Term) -> Term:
    return t.same(found, wanted) if found.sort == wanted.sort else t.FALSE
