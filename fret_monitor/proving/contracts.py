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
Contracts of the functions in `fret_cells.h`, and the proofs that their C satisfies them.

Each function is proved once, for all arguments. In the proofs of monitors, its contract replaces
it: the contract of an arithmetic function is the term it computes, that of a cell is an
uninterpreted function of its counter, bound and operands. A cell that is called once per step, on
a counter that nothing else writes, returns the operator's value: this follows from the invariants
proved here and from `smt/operators.py`.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
import time

from fret_monitor.logic.formula import BinaryOperator, UnaryOperator
from fret_monitor.model.values import ValueType
from fret_monitor.proving.c_source import ArithmeticType, BOOL, CProgram, Unreadable, UNSIGNED
from fret_monitor.proving.execution import Contract, Machine, Memory, Reference, Result, Value
from fret_monitor.proving.obligations import anything, called, Proof, settled
from fret_monitor.proving.timed_cells import timed_attempts
from fret_monitor.smt import numbers
from fret_monitor.smt import terms as t
from fret_monitor.smt.cells import (
    CounterModel, COUNTERS, HISTORY, line_fits, line_related, line_start, line_step, next_position,
    ring_step, WIDTH,
)
from fret_monitor.smt.operators import check, claims
from fret_monitor.smt.solver import ProofAnswer
from fret_monitor.smt.terms import Term

_Attempt = Callable[[CProgram, float], 'Proof']

COUNTER_BITS = (8, 16, 32)
LINE_BITS = (8, 16, 32, 64)

_I64, _U64 = ArithmeticType('int', 64, True), ArithmeticType('int', 64)
_INT64, _UINT64 = ValueType.INT64, ValueType.UINT64
_BINARY = {'add': BinaryOperator.ADD, 'sub': BinaryOperator.SUB, 'mul': BinaryOperator.MUL,
           'div': BinaryOperator.DIV, 'mod': BinaryOperator.MOD}
_Compute = Callable[..., Term]


@dataclass(frozen=True)
class _Pure:
    """A function without side effects: its parameter types, result type and value."""

    parameters: tuple[ArithmeticType, ...]
    result: ArithmeticType
    compute: _Compute


def _arithmetic(operator: BinaryOperator, kind: ValueType) -> _Compute:
    return lambda a, b: numbers.arithmetic(operator, a, b, kind)


def _unary(operator: UnaryOperator, kind: ValueType) -> _Compute:
    return lambda a: numbers.unary(operator, a, kind)


def _relation(operator: BinaryOperator, left: ValueType, right: ValueType) -> _Compute:
    return lambda a, b: numbers.relation(operator, a, b, (left, right))


def _pure() -> dict[str, _Pure]:
    found = {'fm_signed': _Pure((_U64,), _I64, lambda a: a),
             'fm_choice': _Pure((BOOL, _I64, _I64), _I64, t.choice)}
    for suffix, kind, scalar in (('i64', _INT64, _I64), ('u64', _UINT64, _U64)):
        for name, operator in _BINARY.items():
            found[f'fm_{name}_{suffix}'] = _Pure((scalar, scalar), scalar,
                                                 _arithmetic(operator, kind))
        for name, single in (('neg', UnaryOperator.NEG), ('abs', UnaryOperator.ABS)):
            found[f'fm_{name}_{suffix}'] = _Pure((scalar,), scalar, _unary(single, kind))
    less, equal = BinaryOperator.LT, BinaryOperator.EQ
    found['fm_less_iu'] = _Pure((_I64, _U64), BOOL, _relation(less, _INT64, _UINT64))
    found['fm_less_ui'] = _Pure((_U64, _I64), BOOL, _relation(less, _UINT64, _INT64))
    found['fm_equal_iu'] = _Pure((_I64, _U64), BOOL, _relation(equal, _INT64, _UINT64))
    return found


_PURE = _pure()


def _by_contract(item: _Pure) -> Contract:
    def contract(machine: Machine, arguments: Sequence[Value | Reference]) -> Result:
        values = [value.term for value in arguments if isinstance(value, Value)]
        return Value(item.result, item.compute(*values))
    return contract


ARITHMETIC: dict[str, Contract] = {name: _by_contract(item) for name, item in _PURE.items()}


def cell_terms(name: str, state: Term, *arguments: Term) -> tuple[Term, Term]:
    """Return the result of a cell and its next state, as uninterpreted functions."""
    everything = (state, *arguments)
    return (t.term('cell', t.BOOL, everything, name),
            t.term('cell_next', state.sort, everything, name))


def _word_contract(name: str, bits: int, what: str, fits: Callable[[Term], Term]) -> Contract:
    """Return the contract of a cell whose state is one word; `fits` is of its bound or delay."""
    def contract(machine: Machine, arguments: Sequence[Value | Reference]) -> Result:
        place, bound, operands = _taken(arguments)
        machine.require(f'{name}: the {what} is wide enough', fits(bound))
        state = machine.load(place)
        out, after = cell_terms(f'{name}.{bits}', state.term, bound, *operands)
        machine.store(place, Value(state.type, after))
        return Value(BOOL, out)
    return contract


def _counter_contract(cell: CounterModel, bits: int) -> Contract:
    return _word_contract(cell.name, bits, 'counter',
                          lambda bound: cell.fits(t.resized(bound, WIDTH, False), bits))


def _line_contract(bits: int) -> Contract:
    return _word_contract('delay', bits, 'register', lambda steps: line_fits(steps, bits))


def _ring_contract(machine: Machine, arguments: Sequence[Value | Reference]) -> Result:
    place, position, operands = _taken(arguments)
    ring = machine.memory.get(place.path)
    if ring is None or ring.sort[0] != 'ring' or place.index is not t.number(0, 64):
        raise Unreadable('fm_delay_ring on an object that is not a ring')
    inside = t.relation('ult', t.operation('lshr', position, t.number(3, 32)),
                        t.number(place.length, 32))
    machine.require('delay_ring: the position is inside', inside)
    machine.load(place)
    out, after = cell_terms('delay_ring', ring, position, *operands)
    machine.store(place, Value(ArithmeticType('int', 8), t.number(0, 8)))  # records the write
    machine.memory[place.path] = after
    return Value(BOOL, out)


def _taken(arguments: Sequence[Value | Reference]) -> tuple[Reference, Term, list[Term]]:
    place, *others = arguments
    values = [value.term for value in others if isinstance(value, Value)]
    if not isinstance(place, Reference) or len(values) != len(others):
        raise Unreadable('the first argument of a cell is not its state')
    return place, values[0], values[1:]


CELLS: dict[str, Contract] = {
    **{f'fm_{cell.name}_u{bits}': _counter_contract(cell, bits)
       for cell in COUNTERS.values() for bits in COUNTER_BITS},
    **{f'fm_delay_u{bits}': _line_contract(bits) for bits in LINE_BITS},
    'fm_delay_ring': _ring_contract,
}


# -- proofs ----------------------------------------------------------------------------------

def prove_cells(program: CProgram, seconds: float) -> list[Proof]:
    """Prove the claims of the operators, and each function of `fret_cells.h` with a contract."""
    return [*_operators(seconds),
            *(attempt(program, seconds) for attempt in cell_attempts().values())]


def cell_attempts() -> dict[str, _Attempt]:
    """Return what proves each function of `fret_cells.h` with a contract, by its name."""
    found: dict[str, _Attempt] = {}
    for name, item in _PURE.items():
        found[name] = partial(_guarded, name, partial(_prove_pure, name, item))
    for cell in COUNTERS.values():
        for bits in COUNTER_BITS:
            name = f'fm_{cell.name}_u{bits}'
            found[name] = partial(_guarded, name, partial(_prove_counter, cell, bits))
    for bits in LINE_BITS:
        name = f'fm_delay_u{bits}'
        found[name] = partial(_guarded, name, partial(_prove_line, bits))
    found['fm_delay_ring'] = partial(_guarded, 'fm_delay_ring', _prove_ring)
    found['fm_next_position'] = partial(_guarded, 'fm_next_position', _prove_position)
    for name, one in timed_attempts(ARITHMETIC).items():
        found[name] = partial(_guarded, name, one)
    return found


def _operators(seconds: float) -> Iterator[Proof]:
    for claim in claims():
        result = check(claim, seconds)
        yield Proof(claim.name, result.answer, result.seconds)


def _guarded(name: str, attempt: _Attempt, program: CProgram, seconds: float) -> Proof:
    before = time.perf_counter()
    try:
        return attempt(program, seconds)
    except Unreadable as error:
        return Proof(name, ProofAnswer.UNKNOWN, time.perf_counter() - before, str(error))


def _prove_pure(name: str, item: _Pure, program: CProgram, seconds: float) -> Proof:
    """Prove a function for all arguments; signed divisions by 0 and -1 are separate cases."""
    arguments = [anything(letter, kind) for letter, kind in zip('abc', item.parameters)]
    if name not in ('fm_div_i64', 'fm_mod_i64'):
        return _prove_call(program, name, item, arguments, (), seconds)
    divisor = arguments[1].term
    special = [t.number(0, 64), t.number(-1, 64)]
    proofs = [_prove_call(program, name, item, [arguments[0], Value(_I64, value)], (), seconds)
              for value in special]
    given = [t.negation(t.relation('equal', divisor, value)) for value in special]
    proofs.append(_prove_call(program, name, item, arguments, given, seconds))
    worst = next((each for each in proofs if each.answer is not ProofAnswer.PROVED), proofs[-1])
    return replace(worst, seconds=sum(each.seconds for each in proofs))


def _prove_call(program: CProgram, name: str, item: _Pure, arguments: Sequence[Value],
                given: Sequence[Term], seconds: float) -> Proof:
    others = {other: item for other, item in ARITHMETIC.items() if other != name}
    machine = Machine(program, {}, others)
    found = called(machine, name, arguments)
    wanted = item.compute(*(value.term for value in arguments))
    return settled(name, [t.same(found, wanted)], given, machine, seconds)


def _prove_counter(cell: CounterModel, bits: int, program: CProgram, seconds: float) -> Proof:
    """Prove the invariant of a counter at the start and over a step, for all bounds that fit."""
    name, kind = f'fm_{cell.name}_u{bits}', ArithmeticType('int', bits)
    counter, bound = anything('counter', kind), anything('bound', kind)
    operands = [anything(letter, BOOL) for letter in 'pq'[:cell.operands]]
    number, head = (t.variable(word, t.word(WIDTH)) for word in ('number', 'head'))
    wide = t.resized(bound.term, WIDTH, False)
    machine = Machine(program, {('cell',): counter.term}, ARITHMETIC)
    out = called(machine, name, [Reference(('cell',), kind), bound, *operands])
    wanted, after = cell.step(number, wide, [item.term for item in operands])
    start = cell.start(wide, head if cell.has_head else t.number(0, WIDTH))
    begins = cell.related(t.resized(start, bits, False), start, wide)
    limit = t.operation('add', wide, t.number(1, WIDTH))
    fits = cell.fits(wide, bits)
    given = [fits, cell.related(counter.term, number, wide),
             t.relation('ule', head, limit)]
    goals = [t.same(out, wanted), cell.related(machine.memory['cell',], after, wide), begins]
    return settled(name, goals, given, machine, seconds)


def _prove_line(bits: int, program: CProgram, seconds: float) -> Proof:
    name, kind = f'fm_delay_u{bits}', ArithmeticType('int', bits)
    line, steps, p = anything('line', kind), anything('steps', UNSIGNED), anything('p', BOOL)
    history = t.variable('history', t.word(HISTORY))
    wide = t.resized(steps.term, HISTORY, False)
    machine = Machine(program, {('cell',): line.term}, ARITHMETIC)
    out = called(machine, name, [Reference(('cell',), kind), steps, p])
    wanted, after = line_step(history, wide, p.term)
    given = [line_fits(steps.term, bits), line_related(line.term, history, wide)]
    # At the start, the lowest bits of register and history are all 0 or all 1.
    ones = t.operation('sub', t.operation('shl', t.number(1, HISTORY), wide),
                       t.number(1, HISTORY))
    begins = [line_related(t.resized(ones, bits, False), line_start(True), wide),
              line_related(t.number(0, bits), line_start(False), wide)]
    goals = [t.same(out, wanted), line_related(machine.memory['cell',], after, wide), *begins]
    return settled(name, goals, given, machine, seconds)


def _prove_ring(program: CProgram, seconds: float) -> Proof:
    """
    Prove `fm_delay_ring` for a ring of any length.

    Let `ago(n)` be p of n steps ago. The invariant: the bit at index i is ago(position - i), or
    ago(position - i + length) if i >= position. It is proved for an arbitrary i, at the start and
    over a step.
    """
    size = 1 << 28  # bytes; enough for every length of 31 bits
    length, position, place = (t.variable(word, t.word(32))
                               for word in ('length', 'position', 'place'))
    memory: Memory = {('ring',): t.variable('ring', t.ring(size))}
    machine = Machine(program, memory, ARITHMETIC)
    p = anything('p', BOOL)
    out = called(machine, 'fm_delay_ring',
                 [Reference(('ring',), ArithmeticType('int', 8), t.number(0, 64), size),
                  Value(UNSIGNED, position), p])
    after = machine.memory['ring',]
    following = next_position(position, length)
    one, zero = t.number(1, 32), t.number(0, 32)
    age, later = _age(place, position, length), _age(place, following, length)
    given = [t.relation('ult', position, length), t.relation('ult', place, length),
             t.relation('ult', length, t.number(1 << 31, 32)), t.relation('ult', one, length),
             t.same_truth(_ring_bit(memory['ring',], place), _ago(age)),
             t.same_truth(_ring_bit(memory['ring',], position), _ago(length))]
    filled = [t.same_truth(_ring_bit(t.filled(size, byte), place), t.truth(byte > 0))
              for byte in (0, 255)]
    # First, that only the bit at the position changes. Then the ages: at the next step the new p
    # has age 1, and every other bit is one step older, so that its `ago` is unchanged.
    here = t.relation('equal', place, position)
    kept = t.choice(here, p.term, _ring_bit(memory['ring',], place))
    goals = [t.same_truth(out, _ago(length)), t.same_truth(_ring_bit(after, place), kept),
             t.implies(here, t.relation('equal', later, one)),
             *_by_cases(t.implies(t.negation(here),
                                  t.relation('equal', later, t.operation('add', age, one))),
                        [t.relation('equal', t.operation('add', position, one), length),
                         t.relation('ult', place, position),
                         t.relation('ult', place, following)]),
             t.relation('ult', following, length), t.relation('ult', zero, later), *filled,
             t.negation(t.relation('ult', length, later)),
             *_as_meant(memory['ring',], position, p.term, out, after, place)]
    return settled('fm_delay_ring', goals, given, machine, seconds)


def _by_cases(goal: Term, conditions: Sequence[Term]) -> list[Term]:
    """Split a goal into one goal for each combination of conditions, simplified by them."""
    goals = []
    for values in product((False, True), repeat=len(conditions)):
        parts = {item.args[0] if item.op == 'not' else item:
                 t.truth(value != (item.op == 'not')) for item, value in zip(conditions, values)}
        case = t.all_of(item if value else t.negation(item)
                        for item, value in zip(conditions, values))
        goals.append(t.implies(case, t.substituted([goal], parts)[0]))
    return goals


def _as_meant(ring: Term, position: Term, p: Term, out: Term, after: Term,
              place: Term) -> list[Term]:
    """Return the goals that the C equals `cells.ring_step`, its model in transition systems."""
    wanted, wanted_after = ring_step(ring, position, p)
    return [t.same_truth(out, wanted),
            t.same_truth(_ring_bit(after, place), _ring_bit(wanted_after, place))]


def _age(place: Term, position: Term, length: Term) -> Term:
    since = t.operation('sub', position, place)
    return t.choice(t.relation('ult', place, position), since,
                    t.operation('add', since, length))


def _ago(age: Term) -> Term:
    return t.term('cell', t.BOOL, (age,), 'ago')


def _ring_bit(ring: Term, place: Term) -> Term:
    byte = t.select(ring, t.operation('lshr', place, t.number(3, 32)))
    within = t.resized(t.operation('bitand', place, t.number(7, 32)), 8, False)
    return t.bit(t.operation('lshr', byte, within), 0)


def _prove_position(program: CProgram, seconds: float) -> Proof:
    machine = Machine(program, {}, ARITHMETIC)
    position, length = anything('position', UNSIGNED), anything('length', UNSIGNED)
    found = called(machine, 'fm_next_position', [position, length])
    return settled('fm_next_position',
                   [t.same(found, next_position(position.term, length.term))], (), machine,
                   seconds)
