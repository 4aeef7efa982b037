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
The transition system of a group over the state in C, with cells replaced by contracts.

The result and the next state of a cell with several bits are uninterpreted functions of its state
in C, the same as in the contract of its C function. Everything else is the transition system that
`smt` builds. The layout gives the places of the state in C; if one is wrong, a proof fails.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from fret_monitor.model.values import ValueType
from fret_monitor.program.layout import FieldKind, GroupLayout
from fret_monitor.program.monitor_program import (
    AlwaysWithin, CounterCell, Delay, Greatest, OnceWithin, Operation, Overflowed, room_of,
    SinceBetween, SlopeBetween, TimeAtLeast, Total, ValueAgo, WindowState,
)
from fret_monitor.proving.contracts import cell_terms
from fret_monitor.proving.execution import Memory, Path
from fret_monitor.proving.timed_cells import (
    all_fits, is_bound, queue_fits, timed_start, timed_terms,
)
from fret_monitor.proving.windows import (
    as_key, as_word, CELLS, lengths_fit, of_key, of_word, rounded, window_terms,
)
from fret_monitor.smt import numbers
from fret_monitor.smt import terms as t
from fret_monitor.smt.cells import line_fits, WIDTH
from fret_monitor.smt.terms import Sort, Term
from fret_monitor.smt.transition import (
    counter_model, counter_start, FIRST_TICK, ring_start, StateVariable, SystemBuilder,
    TransitionSystem,
)


@dataclass(frozen=True)
class Check:
    """A condition on memory after a reset or a step."""

    what: str
    holds: Callable[[Memory], Term]


@dataclass(frozen=True)
class GroupContract:
    """
    The postconditions of a step and a reset of a group.

    `steps` must hold after a step from a state in which the system's invariants hold, `starts`
    after a reset. `fits` has, for each cell, whether its field is wide enough. `lasts` holds for a
    group that steps at ticks: no value changes before the tick that a step returns.
    """

    system: TransitionSystem
    steps: tuple[Check, ...]
    starts: tuple[Check, ...]
    fits: tuple[tuple[str, bool], ...]
    lasts: tuple[Term, ...] = ()


def state_path(group: int, name: str) -> Path:
    """Return the path of a field of a group's state."""
    return ('state', f'group_{group}', name)


def group_contract(layout: GroupLayout, group: int, memory: Mapping[Path, Term],
                   inputs: Mapping[int, Term], tick: Term = FIRST_TICK) -> GroupContract:
    """
    Return the contract of a group; `memory` holds the state before the step at `tick`.

    Raises
    ------
    KeyError
        if the C state lacks a field.
    """
    builder = _ContractBuilder(layout, group, memory, inputs, tick)
    system = builder.build()
    lasts = _NextTick(builder, system, layout, inputs).goals() if layout.group.is_timed else ()
    places = [(item, *place_of(layout, group, item)) for item in system.state]
    steps = [_check(what, read, item.after) for item, what, read in places]
    starts = [_check(what, read, item.start) for item, what, read in places]
    return GroupContract(system, tuple(steps), tuple(starts), tuple(builder.fits), lasts)


def _check(what: str, read: Callable[[Memory], Term], wanted: Term) -> Check:
    return Check(what, lambda memory: same_or_false(read(memory), wanted))


def place_of(layout: GroupLayout, group: int,
             item: StateVariable) -> tuple[str, Callable[[Mapping[Path, Term]], Term]]:
    """Return the name of a state variable in C, and a function that reads it from memory."""
    slot = layout.bits.get(item.number) if item.kind is FieldKind.FLAG else None
    if slot is None:
        path = state_path(group, item.name)
        return item.name, lambda memory: memory[path]
    name = f'{FieldKind.BITS.value}_{slot.word}'
    packed, bit = state_path(group, name), slot.bit
    return f'{name}, bit {bit}', lambda memory: t.bit(memory[packed], bit)


def same_or_false(found: Term, wanted: Term) -> Term:
    """Return whether two values are identical; FALSE if their sorts differ."""
    return t.same(found, wanted) if found.sort == wanted.sort else t.FALSE


class _ContractBuilder(SystemBuilder):

    def __init__(self, layout: GroupLayout, group: int, memory: Mapping[Path, Term],
                 inputs: Mapping[int, Term], tick: Term) -> None:
        super().__init__(layout.group, inputs, '', tick)
        self.parts = layout.parts
        self._layout = layout
        self._number = group
        self._memory = memory
        self.fits: list[tuple[str, bool]] = []
        self._queues: dict[int, Term] = {}

    def current(self, kind: FieldKind, number: int, sort: Sort) -> Term:
        found = self._field(kind, number)
        if kind is FieldKind.POSITION:
            self.fits.append((f'position_{number}', number <= 1 << found.sort[1]))
        return found

    def current_bit(self, index: int) -> Term:
        slot = self._layout.bits.get(index)
        if slot is None:
            return self._field(FieldKind.FLAG, index)
        return t.bit(self._field(FieldKind.BITS, slot.word), slot.bit)

    def _field(self, kind: FieldKind, number: int) -> Term:
        return self._memory[state_path(self._number, f'{kind.value}_{number}')]

    def counter(self, index: int, operation: CounterCell, arguments: list[Term]) -> Term:
        if self._layout.group.is_timed:
            return self._counter_at(index, operation, arguments)
        cell, counter = counter_model(operation), self._field(FieldKind.COUNTER, index)
        bits, bound = counter.sort[1], operation.bound
        out, after = cell_terms(f'{cell.name}.{bits}', counter, t.number(bound, bits), *arguments)
        self.add(FieldKind.COUNTER, index, counter,
                 t.resized(counter_start(operation), bits, False), after)
        head = operation.head if isinstance(operation, OnceWithin | AlwaysWithin) else 0
        self.fits.append((f'counter_{index}', cell.fits(t.number(bound, WIDTH), bits) is t.TRUE
                          and 0 <= head <= bound + 1 and bound < 1 << 32))
        return out

    def _counter_at(self, index: int, operation: CounterCell, arguments: list[Term]) -> Term:
        name, counter = counter_model(operation).name, self._field(FieldKind.COUNTER, index)
        bound = t.number(operation.bound, 64)
        out, after, due = timed_terms(name, counter, bound, *arguments, self.tick)
        self.add(FieldKind.COUNTER, index, counter, t.number(timed_start(operation), 64), after)
        self.dues.append((index, due))
        head = operation.head if isinstance(operation, OnceWithin | AlwaysWithin) else 0
        self.fits.append((f'counter_{index}', counter.sort == bound.sort
                          and is_bound(bound) is t.TRUE and 0 <= head <= operation.bound + 1))
        return out

    def queue(self, index: int, operation: SinceBetween, arguments: list[Term]) -> Term:
        queue = self._field(FieldKind.QUEUE, index)
        numbers = (operation.room.capacity or 0, operation.low, operation.high)
        out, after, due = timed_terms('since_between', queue,
                                      *(t.number(item, 64) for item in numbers), *arguments,
                                      self.tick)
        self.add(FieldKind.QUEUE, index, queue, t.constant(0, queue.sort), after)
        self.dues.append((index, due))
        self._queues[index] = after
        self.fits.append((f'queue_{index}', queue_fits(*numbers, queue.sort[1] // 64)
                          and (operation.room.may_overflow or all_fits(*numbers))))
        return out

    def window(self, index: int, operation: WindowState, type: ValueType,
               arguments: list[Term]) -> Term:
        name, kinds = _cell_of(operation, type)
        cell, constants = CELLS[name], _constants(operation)
        states = [self._field(kind, index) for kind in kinds]
        found = window_terms(cell, states, *(t.number(item, 64) for item in constants),
                             *self._words(operation, type, arguments),
                             *([self.tick] if cell.is_timed else []))
        for kind, now, after in zip(kinds, states, found.after, strict=True):
            self.add(kind, index, now, numbers.constant(0.0, type) if kind is FieldKind.NUMBER
                     else t.constant(0, now.sort), after)
        if found.due is not None:
            self.dues.append((index, found.due))
            self._queues[index] = found.after[-1]
        self.fits.append((f'window_{index}', _window_fits(operation, name, states, constants)))
        if found.out is None:
            return found.after[0]
        match operation:
            case Greatest():
                return of_key(found.out, type, operation.is_least)
            case ValueAgo() | Total():
                return of_word(found.out, type)
            case _:
                return found.out

    def _words(self, operation: WindowState, type: ValueType,
               arguments: list[Term]) -> list[Term]:
        """Return the operands as the C function takes them."""
        match operation:
            case Greatest():
                return [as_key(arguments[0], type, operation.is_least)]
            case ValueAgo():
                return [as_word(arguments[0], type)]
            case Total():
                word = as_word(arguments[0], self.type_of(operation.argument))
                return [word] if operation.room is None else [arguments[1], word]
            case _:
                return arguments

    def rounded(self, total: Term, is_mean: bool) -> Term:
        return rounded(total, is_mean)

    def overflowed(self, index: int, queue: int) -> Term:
        out, _, due = timed_terms('overflowed', self._queues[queue], self.tick)
        self.dues.append((index, due))
        return out

    def line(self, index: int, operation: Delay, argument: Term) -> Term:
        line = self._field(FieldKind.LINE, index)
        bits, steps = line.sort[1], t.number(operation.steps, 32)
        out, after = cell_terms(f'delay.{bits}', line, steps, argument)
        start = t.number((1 << operation.steps) - 1 if operation.initial else 0, bits)
        self.add(FieldKind.LINE, index, line, start, after)
        self.fits.append((f'line_{index}', line_fits(steps, bits) is t.TRUE))
        return out

    def ring(self, index: int, operation: Delay, argument: Term) -> Term:
        ring, start = self._field(FieldKind.RING, index), ring_start(operation)
        out, after = cell_terms('delay_ring', ring, self.positions[operation.steps], argument)
        self.add(FieldKind.RING, index, ring, start, after)
        self.fits.append((f'ring_{index}', ring.sort == start.sort))
        return out


def _cell_of(operation: WindowState, type: ValueType) -> tuple[str, tuple[FieldKind, ...]]:
    """Return the name of the C function of a cell, and the fields of its state."""
    suffix = '' if room_of(operation) is None else '_at'
    queue = (FieldKind.QUEUE,)
    match operation:
        case ValueAgo():
            return f'ago{suffix}', queue
        case Greatest():
            return f'greatest{suffix}', (FieldKind.WINDOW, *(queue if suffix else ()))
        case Total() if type.is_float:
            return f'exact_sum{suffix}', (FieldKind.SUM, *queue)
        case Total():
            return f'sum{suffix}', queue
        case TimeAtLeast():
            return 'time_over_at', queue
        case SlopeBetween():
            return 'slope_at', (FieldKind.NUMBER, *queue)


def _constants(operation: WindowState) -> list[int]:
    """Return the constants that the C function is called with."""
    room = room_of(operation)
    capacity = 0 if room is None else room.capacity or 0
    match operation:
        case ValueAgo() | Total() | Greatest() if room is None:
            return [operation.past + {ValueAgo: 0, Total: 1, Greatest: 2}[type(operation)]]
        case Greatest():
            return [capacity + 1, operation.past]
        case ValueAgo() | Total():
            return [capacity, operation.past]
        case TimeAtLeast():
            return [capacity, operation.past, operation.least]
        case SlopeBetween():
            return []


def _window_fits(operation: WindowState, name: str, states: Sequence[Term],
                 constants: Sequence[int]) -> bool:
    """Whether the fields are long enough, and nothing is lost that `Overflowed` does not see."""
    lengths = [max(1, item.sort[1] // 64) for item in states]
    room = room_of(operation)
    if not lengths_fit(name, lengths, constants) or room is None or room.may_overflow \
            or isinstance(operation, SlopeBetween):
        return lengths_fit(name, lengths, constants)
    # Intervals are apart; a change or a message can come at every tick.
    most = operation.past // 2 if isinstance(operation, TimeAtLeast) else operation.past
    return (room.capacity or 0) > most


class _NextTick(SystemBuilder):
    """
    A step at the tick after a step, with the same inputs, if that step returned a later tick.

    Each value is shown to be what it was, and then taken to be that in the equations that follow.
    A cell with several bits returns what it did, because its operands are what they were, and it
    has asked for a later tick (`timed_cells.py`).
    """

    def __init__(self, before: SystemBuilder, system: TransitionSystem, layout: GroupLayout,
                 inputs: Mapping[int, Term]) -> None:
        super().__init__(layout.group, inputs, '')
        self._system = system
        self._stored = {(item.kind, item.number): item.after for item in system.state}
        self._is_settled = t.all_of(t.negation(item) for _, item in before.unsettled)
        self._lasting: list[Term] = []

    def goals(self) -> tuple[Term, ...]:
        """Return the conditions that no value and no stored value changes."""
        after = self.build().state
        self._lasting += [t.same(item.after, self._stored[item.kind, item.number])
                          for item in after]
        return tuple(t.implies(self._is_settled, goal) for goal in self._lasting)

    def _value(self, index: int, operation: Operation, type: ValueType) -> Term:
        was = self._system.values[index]
        if not isinstance(operation, CounterCell | SinceBetween | Overflowed | WindowState):
            self._lasting.append(t.same(super()._value(index, operation, type), was))
        return was

    def current(self, kind: FieldKind, number: int, sort: Sort) -> Term:
        return self._stored[kind, number]

    def current_bit(self, index: int) -> Term:
        return self._stored[FieldKind.FLAG, index]

    def rounded(self, total: Term, is_mean: bool) -> Term:
        return rounded(total, is_mean)
