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
Proof of `fm_since_between_at` for queues of a few intervals, for all windows and ticks.

The model takes a step at every tick. Its state is a set of ticks: those from tick T on at which
`p S[low,high] q` is true if p lasts and q does not occur again. A step at T keeps this set if p
holds, and adds T + low .. T + high if q does. The proof follows an arbitrary tick `t`: it is in
the set if and only if it is in an interval of the queue. The obligations are those of
`timed_cells.py`, for each place of the oldest interval, each number of intervals and all operands;
the times in the intervals, the window and the tick are arbitrary. That a queue of the capacity of
`lower.py` loses nothing is an obligation too: `queue[2]` stays 0.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
import time

from fret_monitor.model.diagnostics import counted
from fret_monitor.program.layout import QUEUE_HEAD
from fret_monitor.proving.c_source import BOOL, CProgram, LONG, Unreadable
from fret_monitor.proving.contracts import ARITHMETIC
from fret_monitor.proving.execution import Contract, Machine, Memory, Reference, Value
from fret_monitor.proving.obligations import called, Proof, settled
from fret_monitor.smt import terms as t
from fret_monitor.smt.solver import ProofAnswer
from fret_monitor.smt.terms import Term
from fret_monitor.smt.transition import is_tick, NEVER

PROVED_CAPACITY = 2
_MAX = t.number(1 << 62, 64)
_ZERO, _ONE, _TWO = (t.number(item, 64) for item in range(3))
_EVERY = t.number((1 << 63) - 2, 64)
_TRUTHS = (False, True)
_WIDE = 72  # bits for multiples of a window
_LOW, _HIGH, _TICK, _ANY = (t.variable(word, t.word(64)) for word in ('low', 'high', 'tick', 't'))


def _add(*items: Term) -> Term:
    found = items[0]
    for item in items[1:]:
        found = t.operation('add', found, item)
    return found


def _less(left: Term, right: Term) -> Term:
    return t.relation('slt', left, right)


def _most(left: Term, right: Term) -> Term:
    return t.relation('sle', left, right)


def _equal(left: Term, right: Term) -> Term:
    return t.relation('equal', left, right)


@dataclass(frozen=True)
class _Queue:
    """The intervals of a queue, the oldest first, and the operands of the tick before `tick`."""

    intervals: tuple[tuple[Term, Term], ...]
    p: bool
    q: bool
    tick: Term

    @property
    def before(self) -> Term:
        """The tick before."""
        return t.operation('sub', self.tick, _ONE)

    def has(self, tick: Term) -> Term:
        """Whether the model's set has a tick."""
        return t.negation(t.all_of(t.negation(t.conjunction(_most(begin, tick), _most(tick, end)))
                                   for begin, end in self._effective()))

    def _effective(self) -> Iterator[tuple[Term, Term]]:
        """Yield the intervals if q does not occur again."""
        for place, (begin, end) in enumerate(self.intervals):
            is_newest = place == len(self.intervals) - 1
            if is_newest and self.q:
                yield (begin if self.p else _add(self.before, _LOW)), _add(self.before, _HIGH)
            else:
                yield begin, end

    def is_valid(self) -> Term:
        """Whether the intervals are as the C keeps them."""
        count = len(self.intervals)
        if (self.q and not count) or (not self.p and count != self.q):
            return t.FALSE
        found = []
        width = t.operation('sub', _HIGH, _LOW)
        for place, (begin, end) in enumerate(self.intervals):
            is_newest = place == count - 1
            if place:
                found.append(_most(_add(self.intervals[place - 1][1], _TWO), begin))
            else:
                found.append(_most(self.before, end))
            if is_newest and self.q:
                found.append(_equal(end, NEVER))
            else:
                found += [_most(_add(begin, width), end), _most(end, _add(self.before, _HIGH))]
            if is_newest and self.q and not self.p:
                found.append(_equal(begin, _EVERY))
            else:
                found += [_most(_ZERO, begin), _most(begin, _add(self.before, _LOW))]
        return t.all_of(found)

    def asks(self, due: Term, out: Term) -> Term:
        """Whether the result was `out` at the tick before, and `due` was asked for then."""
        if not self.intervals:
            return t.conjunction(t.negation(out), _equal(due, NEVER))
        begin, end = self.intervals[0]
        is_in = _most(begin, self.before)
        wanted = t.choice(is_in, t.choice(_equal(end, NEVER), NEVER, _add(end, _ONE)),
                          t.choice(_equal(begin, _EVERY), NEVER, begin))
        return t.conjunction(t.same_truth(out, is_in), _equal(due, wanted))

    def stepped(self, p: bool, q: bool, tick: Term) -> Term:
        """Whether the model's set has a tick after a step with operands at `self.tick`."""
        added = t.conjunction(_most(_add(self.tick, _LOW), tick),
                              _most(tick, _add(self.tick, _HIGH)))
        kept = self.has(tick) if p else t.FALSE
        return t.disjunction(kept, added) if q else kept


def prove_queue(program: CProgram, seconds: float,
                most: int = PROVED_CAPACITY) -> Proof:
    """Prove `fm_since_between_at` for all windows whose queue has at most so many intervals."""
    before = time.perf_counter()
    try:
        proof = _first_failure(program, seconds, most)
    except Unreadable as error:
        proof = Proof('', ProofAnswer.UNKNOWN, 0.0, str(error))
    return replace(proof, name=f'fm_since_between_at, at most {counted(most, "interval")}',
                   seconds=time.perf_counter() - before)


def _first_failure(program: CProgram, seconds: float, most: int) -> Proof:
    proof = Proof('', ProofAnswer.PROVED, 0.0)
    for capacity in range(1, most + 1):
        for head, count in product(range(capacity), range(capacity + 1)):
            for operands in product(_TRUTHS, _TRUTHS):
                proof = _prove_case(ARITHMETIC, program, seconds, capacity, head, count, operands)
                if not proof.is_proved:
                    return proof
    return proof


def _prove_case(functions: Mapping[str, Contract], program: CProgram, seconds: float,
                capacity: int, head: int, count: int, operands: tuple[bool, bool]) -> Proof:
    name = 'fm_since_between_at'
    length = QUEUE_HEAD + 2 * capacity
    memory: Memory = {('queue', place): t.variable(f'queue.{place}', t.word(64))
                      for place in range(length)}
    memory |= {('queue', 0): t.number(head, 64), ('queue', 1): t.number(count, 64),
               ('queue', 2): _ZERO}
    given = [_less(_ZERO, _LOW), _most(_LOW, _HIGH), _most(_HIGH, _MAX), is_tick(_TICK),
             _all_fits(capacity)]
    proof = Proof(name, ProofAnswer.PROVED, 0.0)
    for p0, q0 in product(_TRUTHS, _TRUTHS):
        queue = _Queue(_intervals(memory, capacity, head, count), p0, q0, _TICK)
        is_valid = queue.is_valid()
        if is_valid is t.FALSE:
            continue
        proof = _prove_step(functions, program, seconds, memory, capacity, queue, operands,
                            [*given, is_valid]).after(proof)
        if not proof.is_proved:
            return proof
    p, q = operands
    queue = _Queue(_intervals(memory, capacity, head, count), p, q, _TICK)
    return _prove_idle(program, seconds, queue, [*given, queue.is_valid()]).after(proof)


def _prove_step(functions: Mapping[str, Contract], program: CProgram, seconds: float,
                memory: Memory, capacity: int, queue: _Queue, operands: tuple[bool, bool],
                given: Sequence[Term]) -> Proof:
    p, q = operands
    machine = Machine(program, {**memory, ('next',): NEVER}, functions)
    values = [t.number(capacity, 64), _LOW, _HIGH]
    out = called(machine, 'fm_since_between_at', [
        Reference(('queue',), LONG, _ZERO, len(memory)), *(Value(LONG, item) for item in values),
        *(Value(BOOL, t.truth(item)) for item in operands), Value(LONG, _TICK),
        Reference(('next',), LONG)])
    after, due = machine.memory, machine.memory['next',]
    following = _add(_TICK, _ONE)
    goals = [t.same_truth(out, queue.has(_TICK) if p else t.FALSE), _less(_TICK, due),
             _equal(after['queue', 2], _ZERO),
             t.truth(after.keys() == {*memory, ('next',)})]
    known = []
    for head, count in product(range(capacity), range(capacity + 1)):
        case = t.conjunction(_equal(after['queue', 0], t.number(head, 64)),
                             _equal(after['queue', 1], t.number(count, 64)))
        known.append(t.negation(case))
        later = _Queue(_intervals(after, capacity, head, count), p, q, following)
        valid = t.conjunction(later.is_valid(), later.asks(due, out))
        same = t.implies(_most(following, _ANY),
                         t.same_truth(later.has(_ANY), queue.stepped(p, q, _ANY)))
        goals += [t.implies(case, valid), t.implies(case, same)]
    goals.append(t.negation(t.all_of(known)))
    return settled('fm_since_between_at', goals, given, machine, seconds, is_linear=True)


def _prove_idle(program: CProgram, seconds: float, queue: _Queue,
                given: Sequence[Term]) -> Proof:
    due, out = t.variable('due', t.word(64)), t.variable('out', t.BOOL)
    later = _Queue(queue.intervals, queue.p, queue.q, _add(_TICK, _ONE))
    now = queue.has(_TICK) if queue.p else t.FALSE
    same = t.implies(_less(_TICK, _ANY), t.same_truth(
        later.has(_ANY), queue.stepped(queue.p, queue.q, _ANY)))
    idle = [t.same_truth(now, out), later.is_valid(), later.asks(due, now), same]
    goals = [t.implies(_less(_TICK, due), goal) for goal in idle]
    goals.append(t.implies(_equal(_TICK, due), t.negation(t.same_truth(now, out))))
    return settled('fm_since_between_at', goals, [*given, queue.asks(due, out)],
                   Machine(program, {}), seconds, is_linear=True)


def _intervals(memory: Mapping[tuple[str | int, ...], Term], capacity: int, head: int,
               count: int) -> tuple[tuple[Term, Term], ...]:
    places = [QUEUE_HEAD + 2 * ((head + number) % capacity) for number in range(count)]
    return tuple((memory['queue', place], memory['queue', place + 1]) for place in places)


def _all_fits(capacity: int) -> Term:
    """Whether capacity > high / (high - low + 2)."""
    low, high = (t.resized(item, _WIDE, True) for item in (_LOW, _HIGH))
    apart = _add(t.operation('sub', high, low), t.number(2, _WIDE))
    return _less(high, _add(*[apart] * capacity))
