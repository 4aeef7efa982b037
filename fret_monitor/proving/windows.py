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
Contracts of the cells of `fret_windows.h`, as those in `contracts.py` and `timed_cells.py`.

A cell is a set of uninterpreted functions of its whole state, its numbers and operands, and the
tick: the result, each part of the next state, and the tick that it asks for. A conversion of a
number (to a word, to a key in the order of the numbers, and back) is one too, and so is the sum
or mean of an exact sum.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

from fret_monitor.model.values import ValueType
from fret_monitor.program.layout import QUEUE_HEAD
from fret_monitor.proving.c_source import ArithmeticType, BOOL, DOUBLE, LONG, Unreadable
from fret_monitor.proving.execution import (
    Contract, Machine, Reference, Result, sort_of, Value, whole_array,
)
from fret_monitor.smt import numbers
from fret_monitor.smt import terms as t
from fret_monitor.smt.terms import Sort, Term
from fret_monitor.smt.transition import is_tick

SUM_LENGTH = 40
_MAX_PAST = 1 << 62
_RING_HEAD, _WINDOW_HEAD = 3, 8
_SUFFIXES = {ValueType.INT64: 'i64', ValueType.UINT64: 'u64', ValueType.FLOAT32: 'f32',
             ValueType.FLOAT64: 'f64'}


@dataclass(frozen=True)
class WindowCell:
    """A function of `fret_windows.h`: how many arrays it keeps, its constants, and its result."""

    name: str
    arrays: int
    constants: int
    result: ArithmeticType | None
    is_timed: bool


CELLS = {item.name: item for item in (
    WindowCell('ago', 1, 1, LONG, False), WindowCell('sum', 1, 1, LONG, False),
    WindowCell('greatest', 1, 1, LONG, False), WindowCell('exact_sum', 2, 1, None, False),
    WindowCell('ago_at', 1, 2, LONG, True), WindowCell('sum_at', 1, 2, LONG, True),
    WindowCell('greatest_at', 2, 2, LONG, True), WindowCell('exact_sum_at', 2, 2, None, True),
    WindowCell('time_over_at', 1, 3, BOOL, True), WindowCell('slope_at', 2, 0, DOUBLE, True),
)}


def lengths_fit(name: str, lengths: Sequence[int], constants: Sequence[int]) -> bool:
    """Whether the arrays of a cell have the lengths that its constants need."""
    if not all(0 <= item <= _MAX_PAST for item in constants) or 0 in constants[:1]:
        return False
    match name, constants:
        case 'ago' | 'sum', (length,):
            return lengths == [_RING_HEAD + length]
        case 'exact_sum', (length,):
            return lengths == [SUM_LENGTH, _RING_HEAD + length]
        case 'greatest', (length,):
            return length > 1 and lengths == [_WINDOW_HEAD + length]
        case 'sum_at', (capacity, _):
            return lengths == [QUEUE_HEAD + 2 * capacity + 1]
        case 'ago_at', (capacity, past):
            return past > 0 and lengths == [QUEUE_HEAD + 2 * capacity + 1]
        case 'exact_sum_at', (capacity, _):
            return lengths == [SUM_LENGTH, QUEUE_HEAD + 2 * capacity + 1]
        case 'time_over_at', (capacity, past, least):
            return 0 < least <= past and lengths == [QUEUE_HEAD + 2 * capacity + 1]
        case 'greatest_at', (length, past):
            return length > 1 and past > 0 \
                and lengths == [_WINDOW_HEAD + length, QUEUE_HEAD + length]
        case _:
            return name == 'slope_at' and lengths == [1, 2]


@dataclass(frozen=True)
class WindowTerms:
    """The result of a cell, its next state, and the tick that it asks for, if it is timed."""

    out: Term | None
    after: tuple[Term, ...]
    due: Term | None


def window_terms(cell: WindowCell, states: Sequence[Term], *arguments: Term) -> WindowTerms:
    """Return what a call of a cell computes."""
    everything = (*states, *arguments)
    out = None if cell.result is None else t.term('cell', sort_of(cell.result), everything,
                                                  cell.name)
    after = tuple(t.term('cell_next', item.sort, everything, f'{cell.name}.{number}')
                  for number, item in enumerate(states))
    due = t.term('cell_next', t.word(64), everything, f'{cell.name}.due') \
        if cell.is_timed else None
    return WindowTerms(out, after, due)


def converted(name: str, sort: Sort, *arguments: Term) -> Term:
    """Return what a conversion computes, such as `word_f64`."""
    return t.term('cell', sort, arguments, name)


def as_word(item: Term, kind: ValueType) -> Term:
    """Return a number as a word, in which windows store it."""
    return converted(f'word_{_SUFFIXES[kind]}', t.word(64), item)


def of_word(item: Term, kind: ValueType) -> Term:
    """Return the number of a word."""
    return converted(f'number_{_SUFFIXES[kind]}', numbers.sort_of(kind), item)


def as_key(item: Term, kind: ValueType, is_least: bool) -> Term:
    """Return a number as a word in the order of the numbers."""
    return converted(f'key_{_SUFFIXES[kind]}', t.word(64), item, t.truth(is_least))


def of_key(item: Term, kind: ValueType, is_least: bool) -> Term:
    """Return the number of a key."""
    return converted(f'of_key_{_SUFFIXES[kind]}', numbers.sort_of(kind), item,
                     t.truth(is_least))


def rounded(total: Term, is_mean: bool) -> Term:
    """Return the sum or mean of an exact sum."""
    if is_mean:
        return converted('exact_mean', t.real(64), total)
    return converted('exact_quotient', t.real(64), total, t.number(1, 64))


# -- contracts -------------------------------------------------------------------------------

def taken_states(machine: Machine, cell: WindowCell,
                 arguments: Sequence[Value | Reference]) -> list[Term]:
    """Return the state of a cell, after checking that its arrays have the right lengths."""
    places = arguments[:cell.arrays]
    constants = [item.term for item in arguments[cell.arrays:cell.arrays + cell.constants]
                 if isinstance(item, Value)]
    if not all(isinstance(item, Reference) for item in places) \
            or not all(map(t.is_constant, constants)):
        raise Unreadable(f'fm_{cell.name} without its state and constants')
    lengths = [max(1, item.length) for item in places if isinstance(item, Reference)]
    machine.require(f'{cell.name}: the lengths of its arrays', t.truth(
        lengths_fit(cell.name, lengths, [int(item.value) for item in constants])))
    return [_state(machine, item) for item in places if isinstance(item, Reference)]


def _state(machine: Machine, place: Reference) -> Term:
    return machine.load(place).term if place.index is None else whole_array(machine, place)


def called_window(machine: Machine, cell: WindowCell, arguments: Sequence[Value | Reference],
                  values: Sequence[Term]) -> WindowTerms:
    """Apply the contract of a cell to memory; `values` are its constants, operands and tick."""
    found = window_terms(cell, taken_states(machine, cell, arguments), *values)
    if cell.is_timed:
        machine.require(f'{cell.name}: the tick', is_tick(values[-1]))
    for place, after in zip(arguments[:cell.arrays], found.after, strict=True):
        assert isinstance(place, Reference)
        if place.index is None and isinstance(place.type, ArithmeticType):
            machine.store(place, Value(place.type, after))
        else:
            machine.memory[place.path] = after
    return found


def _by_steps(cell: WindowCell, machine: Machine,
              arguments: Sequence[Value | Reference]) -> Result:
    values = [item.term for item in arguments[cell.arrays:] if isinstance(item, Value)]
    if len(values) != len(arguments) - cell.arrays:
        raise Unreadable(f'fm_{cell.name} with a pointer in place of a value')
    found = called_window(machine, cell, arguments, values)
    return None if cell.result is None or found.out is None else Value(cell.result, found.out)


def _conversion(name: str, result: ArithmeticType, machine: Machine,
                arguments: Sequence[Value | Reference]) -> Result:
    values = [whole_array(machine, item) if isinstance(item, Reference) else item.term
              for item in arguments]
    return Value(result, converted(name, sort_of(result), *values))


def _conversions() -> dict[str, Contract]:
    found: dict[str, Contract] = {}
    for kind, suffix in _SUFFIXES.items():
        number = ArithmeticType('float' if kind.is_float else 'int', kind.bits,
                                kind is ValueType.INT64)
        for verb, result in (('word', LONG), ('key', LONG), ('number', number),
                             ('of_key', number)):
            found[f'fm_{verb}_{suffix}'] = partial(_conversion, f'{verb}_{suffix}', result)
    for name in ('exact_mean', 'exact_quotient'):
        found[f'fm_{name}'] = partial(_conversion, name, DOUBLE)
    return found


WINDOWS: dict[str, Contract] = {
    **_conversions(),
    **{f'fm_{cell.name}': partial(_by_steps, cell) for cell in CELLS.values()
       if not cell.is_timed},
}
"""Contracts of the functions that ask for no tick, by their names."""
