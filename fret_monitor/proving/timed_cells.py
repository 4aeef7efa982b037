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
Contracts of the cells of groups that step at ticks, and the proofs that their C satisfies them.

A contract has three uninterpreted functions of the cell's state, its numbers and operands, and the
tick: the result, the next state, and the tick that the cell asks for. The proofs compare the C
with the model that takes a step at every tick (`smt/cells.py`), for all bounds and ticks. `T` is a
tick, `known` relates the state in C to the model after tick T, and `asked` relates it to the last
result and to the tick that the cell has asked for:

start     `known` holds before the first step
step      if `known` holds, a call at tick T + 1 returns the model's result, and both hold after it
idle      if both hold and the cell has asked for a tick after T + 1, then a step of the model with
          the same operands gives the same result, and both hold after it, without a call
change    at the tick that the cell has asked for, the model's result changes

By induction, passing over k ticks equals k steps, and no result changes before the tick that the
cell has asked for.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial

from fret_monitor.program.layout import QUEUE_HEAD
from fret_monitor.program.monitor_program import (
    AlwaysWithin, CounterCell, OnceBefore, OnceWithin, SinceBefore,
)
from fret_monitor.proving.c_source import BOOL, CProgram, LONG, Unreadable
from fret_monitor.proving.execution import (
    Contract, Machine, Reference, Result, Value, whole_array,
)
from fret_monitor.proving.obligations import anything, called, Proof, settled
from fret_monitor.proving.windows import called_window, CELLS, WindowCell
from fret_monitor.smt import terms as t
from fret_monitor.smt.cells import at_most, CounterModel, COUNTERS, WIDTH
from fret_monitor.smt.terms import Term
from fret_monitor.smt.transition import asked_variable, earlier, earlier_if, is_tick, NEVER

_Attempt = Callable[[CProgram, float], Proof]

MAX_BOUND = 1 << 62
_ZERO, _ONE = t.number(0, 64), t.number(1, 64)
_EVERY = t.number((1 << 63) - 2, 64)  # of since_before: every tick is the oldest q
_NEXT = Reference(('next',), LONG)


def timed_terms(name: str, state: Term, *arguments: Term) -> tuple[Term, Term, Term]:
    """Return the result of a cell, its next state and the tick that it asks for."""
    everything = (state, *arguments)
    return (t.term('cell', t.BOOL, everything, f'{name}.at'),
            t.term('cell_next', state.sort, everything, f'{name}.at'),
            t.term('cell_next', t.word(64), everything, f'{name}.due'))


def is_bound(bound: Term) -> Term:
    """Return whether a word is a bound in ticks."""
    return t.conjunction(t.relation('slt', _ZERO, bound),
                         t.relation('sle', bound, t.number(MAX_BOUND, 64)))


def timed_start(operation: CounterCell) -> int:
    """Return the initial state of a cell with one number."""
    match operation:
        case OnceBefore() | SinceBefore():
            return int(NEVER.value)
        case OnceWithin() | AlwaysWithin():
            return operation.head - 1
        case _:
            return -1


def queue_fits(capacity: int, low: int, high: int, length: int) -> bool:
    """Whether a queue with an array of this length has a window and a capacity."""
    return length == QUEUE_HEAD + 2 * capacity and capacity > 0 and 0 < low <= high <= MAX_BOUND


def all_fits(capacity: int, low: int, high: int) -> bool:
    """Whether no interval can be lost."""
    return capacity > high // (high - low + 2)


# -- contracts -------------------------------------------------------------------------------

class AskedTicks:
    """
    The contracts of the cells and of `fm_lower`, in a step at some tick.

    `asked` are the ticks that the cells ask for, and the conditions on which the tick after this
    one is asked for, in order. The next tick is a term over variables that stand for them
    (`asked_variable`), so that the solver compares them one by one.
    """

    def __init__(self, tick: Term) -> None:
        """Start with nothing asked for."""
        self.asked: list[Term] = []
        self._following = t.operation('add', tick, _ONE)

    @property
    def contracts(self) -> dict[str, Contract]:
        """Return the contracts, by the name of the function."""
        return {
            'fm_lower': self._lower,
            **{f'fm_{name}_at': partial(self._counter, name) for name in COUNTERS},
            'fm_since_between_at': self._queue,
            'fm_overflowed_at': self._overflowed,
            **{f'fm_{cell.name}': partial(self._window, cell) for cell in CELLS.values()
               if cell.is_timed},
            **dict.fromkeys(('fm_same_f32', 'fm_same_f64'), _same),
        }

    def _lower(self, machine: Machine, arguments: Sequence[Value | Reference]) -> Result:
        following, is_due, tick = arguments
        if not isinstance(following, Reference) or not isinstance(is_due, Value) \
                or not isinstance(tick, Value):
            raise Unreadable('fm_lower without a place, a condition and a tick')
        condition = is_due.term
        if tick.term is self._following:
            condition = self._asks(condition)
        known = machine.load(following)
        machine.store(following, Value(known.type, earlier_if(condition, tick.term, known.term)))
        return None

    def _counter(self, name: str, machine: Machine,
                 arguments: Sequence[Value | Reference]) -> Result:
        place, values, following = _taken(arguments)
        bound, *operands, tick = values
        machine.require(f'{name}: the bound', is_bound(bound))
        machine.require(f'{name}: the tick', is_tick(tick))
        state = machine.load(place)
        out, after, due = timed_terms(name, state.term, bound, *operands, tick)
        machine.store(place, Value(state.type, after))
        return self._returned(machine, out, due, following)

    def _queue(self, machine: Machine, arguments: Sequence[Value | Reference]) -> Result:
        place, values, following = _taken(arguments)
        queue = whole_array(machine, place)
        capacity, low, high, tick = (*values[:3], values[-1])
        if not all(t.is_constant(item) for item in (capacity, low, high)):
            raise Unreadable('fm_since_between_at with a window that is not constant')
        machine.require('since_between: the window and the capacity', t.truth(
            queue_fits(capacity.value, low.value, high.value, place.length)))
        machine.require('since_between: the tick', is_tick(tick))
        out, after, due = timed_terms('since_between', queue, *values)
        machine.memory[place.path] = after
        return self._returned(machine, out, due, following)

    def _overflowed(self, machine: Machine, arguments: Sequence[Value | Reference]) -> Result:
        place, [tick], following = _taken(arguments)
        machine.require('overflowed: the tick', is_tick(tick))
        out, _, due = timed_terms('overflowed', whole_array(machine, place), tick)
        return self._returned(machine, out, due, following)

    def _window(self, cell: WindowCell, machine: Machine,
                arguments: Sequence[Value | Reference]) -> Result:
        _, values, following = _taken([arguments[0], *arguments[cell.arrays:]])
        found = called_window(machine, cell, arguments, values)
        assert found.due is not None
        self._lowers(machine, found.due, following)
        return None if cell.result is None or found.out is None \
            else Value(cell.result, found.out)

    def _returned(self, machine: Machine, out: Term, due: Term, following: Reference) -> Result:
        """Lower the next tick, and return the result of a cell."""
        self._lowers(machine, due, following)
        return Value(BOOL, out)

    def _lowers(self, machine: Machine, due: Term, following: Reference) -> None:
        known = machine.load(following)
        machine.store(following, Value(known.type, earlier(known.term, self._asks(due))))

    def _asks(self, item: Term) -> Term:
        self.asked.append(item)
        return asked_variable(len(self.asked) - 1, item)


def _taken(arguments: Sequence[Value | Reference]) -> tuple[Reference, list[Term], Reference]:
    """Return the state, the numbers and operands, and the place of the next tick."""
    place, *others, following = arguments
    values = [value.term for value in others if isinstance(value, Value)]
    if not isinstance(place, Reference) or not isinstance(following, Reference) \
            or len(values) != len(others):
        raise Unreadable('a cell whose arguments are not its state, values and the next tick')
    return place, values, following


def _same(machine: Machine, arguments: Sequence[Value | Reference]) -> Result:
    left, right = (item.term for item in arguments if isinstance(item, Value))
    return Value(BOOL, t.same(left, right))


# -- proofs ----------------------------------------------------------------------------------

def timed_attempts(functions: Mapping[str, Contract]) -> dict[str, _Attempt]:
    """Return the proof of each function, by its name; `functions` are those they may call."""
    return {'fm_lower': partial(_prove_lower, functions),
            **{f'fm_{cell.name}_at': partial(_prove_counter, functions, cell)
               for cell in COUNTERS.values()}}


def _prove_lower(functions: Mapping[str, Contract], program: CProgram, seconds: float) -> Proof:
    tick, known = t.variable('tick', t.word(64)), t.variable('next', t.word(64))
    is_due = anything('is_due', BOOL)
    machine = Machine(program, {_NEXT.path: known}, functions)
    machine.call('fm_lower', [_NEXT, is_due, Value(LONG, tick)])
    wanted = earlier_if(is_due.term, tick, known)
    return settled('fm_lower', [t.same(machine.memory[_NEXT.path], wanted)], (), machine, seconds,
                   is_linear=True)


def _prove_counter(functions: Mapping[str, Contract], cell: CounterModel, program: CProgram,
                   seconds: float) -> Proof:
    """Prove a cell for all bounds and ticks: start, step, idle and change."""
    name = f'fm_{cell.name}_at'
    known, asked = (_within_known, _within_asked) if cell.name.endswith('within') else \
        (_before_known, _before_asked)
    state, bound, tick, due, number, head = (
        t.variable(word, t.word(64))
        for word in ('state', 'bound', 'tick', 'due', 'number', 'head'))
    operands = [anything(letter, BOOL) for letter in 'pq'[:cell.operands]]
    now = [item.term for item in operands]
    before = [t.variable(f'{letter}_before', t.BOOL) for letter in 'pq'[:cell.operands]]
    following = t.operation('add', tick, _ONE)
    limits = [is_bound(bound), is_tick(tick)]

    def run(asked_for: Term) -> tuple[Machine, Term]:
        machine = Machine(program, {('cell',): state, _NEXT.path: asked_for}, functions)
        out = called(machine, name, [Reference(('cell',), LONG), Value(LONG, bound), *operands,
                                     Value(LONG, tick), _NEXT])
        return machine, out

    machine, out = run(NEVER)
    after, found = machine.memory['cell',], machine.memory[_NEXT.path]
    wanted, count = cell.step(number, bound, now)
    step = [t.same_truth(out, wanted), known(cell, after, bound, now, count, following),
            asked(cell, after, now, tick, found, out), t.relation('slt', tick, found),
            t.truth(len(machine.memory) == 2)]
    again, same_out = run(due)
    step += [t.same_truth(out, same_out), t.same(after, again.memory['cell',]),
             t.same(again.memory[_NEXT.path], earlier(due, found))]
    quiet = [t.truth(cell.name == 'always_within'), t.FALSE]
    start = known(cell, _start(cell, head), bound, quiet,
                  cell.start(bound, head if cell.has_head else _ZERO), _ZERO)
    first = t.implies(at_most(head, t.operation('add', bound, _ONE)), start)
    proof = settled(name, [first, *step], [*limits, known(cell, state, bound, before, number,
                                                          tick)], machine, seconds, is_linear=True)
    if not proof.is_proved:
        return proof
    last = t.variable('out', t.BOOL)
    lasting = [*limits, known(cell, state, bound, now, number, following),
               asked(cell, state, now, tick, due, last)]
    is_idle = t.relation('slt', following, due)
    later = t.operation('add', following, _ONE)
    idle = [t.same_truth(wanted, last), known(cell, state, bound, now, count, later),
            asked(cell, state, now, following, due, wanted)]
    change = t.implies(t.relation('equal', following, due), t.negation(
        t.same_truth(wanted, last)))
    return settled(name, [*(t.implies(is_idle, goal) for goal in idle), change], lasting,
                   Machine(program, {}), seconds, is_linear=True).after(proof)


def _start(cell: CounterModel, head: Term) -> Term:
    if not cell.name.endswith('within'):
        return NEVER
    return t.operation('sub', head if cell.has_head else _ZERO, _ONE)


def _event(cell: CounterModel, operands: Sequence[Term]) -> Term:
    """Return whether the event of a window `[0,bound]` occurs with these operands."""
    return t.negation(operands[0]) if cell.name == 'always_within' else operands[-1]


def _within_known(cell: CounterModel, state: Term, bound: Term, operands: Sequence[Term],
                  age: Term, tick: Term) -> Term:
    """
    Relate the state of a window `[0,bound]` to the age that its event has at a tick.

    `operands` are those of the tick before. The state is NEVER while the event lasts, else the
    last tick at which the event is in the window, if it is in it at this one.
    """
    last = t.operation('sub', t.operation('add', tick, bound), age)
    outside = t.conjunction(t.relation('sle', t.number(-1, 64), state),
                            t.relation('slt', state, tick))
    lasts = t.conjunction(t.relation('equal', state, NEVER), t.relation('equal', age, _ONE))
    is_kept = operands[0] if cell.operands == 2 else t.TRUE
    ended = t.choice(at_most(age, bound),
                     t.conjunction(is_kept, t.relation('equal', state, last)), outside)
    is_old = t.disjunction(at_most(_ONE, age), t.relation('equal', tick, _ZERO))
    return t.conjunction(is_old, t.choice(_event(cell, operands), lasts, ended))


def _within_asked(cell: CounterModel, state: Term, operands: Sequence[Term], tick: Term,
                  due: Term, out: Term) -> Term:
    is_in = t.negation(out) if cell.name == 'always_within' else out
    following = t.operation('add', state, _ONE)
    ends = t.conjunction(t.same_truth(is_in, t.relation('sle', tick, state)),
                         t.relation('equal', due, t.choice(is_in, following, NEVER)))
    return t.choice(_event(cell, operands),
                    t.conjunction(is_in, t.relation('equal', due, NEVER)), ends)


def _both(cell: CounterModel, operands: Sequence[Term]) -> tuple[Term, Term]:
    """Return p and q of `p S[bound,inf) q`; `O` is that with TRUE for p."""
    return (t.TRUE, operands[0]) if cell.operands == 1 else (operands[0], operands[1])


def _before_known(cell: CounterModel, state: Term, bound: Term, operands: Sequence[Term],
                  count: Term, tick: Term) -> Term:
    """
    Relate the state of a window `[bound,inf)` to 1 + the age of the oldest q.

    `operands` are those of the tick before. The state is NEVER without a q, _EVERY while q holds
    and p does not, else the first tick at which the result is true.
    """
    p, q = _both(cell, operands)
    first = t.operation('sub', t.operation('add', tick, bound), count)
    begun = t.choice(t.relation('equal', count, _ZERO), t.relation('equal', state, NEVER),
                     t.relation('equal', state, first))
    every = t.conjunction(t.relation('equal', state, _EVERY), t.relation('equal', count, _ONE))
    has_begun = t.choice(q, at_most(_ONE, count),
                         t.disjunction(p, t.relation('equal', count, _ZERO)))
    is_every = t.conjunction(q, t.negation(p))
    return t.all_of([at_most(count, tick), has_begun, t.choice(is_every, every, begun)])


def _before_asked(cell: CounterModel, state: Term, operands: Sequence[Term], tick: Term,
                  due: Term, out: Term) -> Term:
    p, _ = _both(cell, operands)
    has_begun = t.conjunction(p, t.relation('sle', state, tick))
    waits = t.conjunction(p, t.negation(has_begun))
    return t.conjunction(t.same_truth(out, has_begun),
                         t.relation('equal', due, t.choice(waits, state, NEVER)))


assert WIDTH == 64  # the numbers of the models are as wide as ticks
