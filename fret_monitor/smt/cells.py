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
Models of the state cells: the step function of each, and the invariant of its C state.

The model of a counter is a natural number ("the steps since the last p"), in words of 64 bits
that saturate far above every bound instead of wrapping. `related` is the invariant that relates
this number to the C counter. `fits` is the condition that the counter is wide enough, which
`program/layout.py` must establish. `operators.py` proves that the models compute the operators,
and `proving/contracts.py` that the C functions of `fret_cells.h` maintain the invariants.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from fret_monitor.smt import terms as t
from fret_monitor.smt.terms import Term

WIDTH = 64
_FAR = t.number(1 << (WIDTH - 1), WIDTH)
_ONE = t.number(1, WIDTH)
_NONE = t.number(0, WIDTH)
HISTORY = 64


@dataclass(frozen=True)
class CounterModel:
    """
    A cell with one counter.

    `step` takes the number, the bound and the operands, and returns the result of the cell and
    the next number. `start` takes the bound and the head (the number of first steps at which the
    result is fixed), `fits` the bound and the width of the counter.
    """

    name: str
    operands: int
    has_head: bool
    start: Callable[[Term, Term], Term]
    step: Callable[[Term, Term, Sequence[Term]], tuple[Term, Term]]
    related: Callable[[Term, Term, Term], Term]
    fits: Callable[[Term, int], Term]


def at_most(left: Term, right: Term) -> Term:
    """Return `left <= right` of natural numbers."""
    return t.relation('ule', left, right)


def _more(number: Term) -> Term:
    """Return the number plus 1, saturating at 2^63."""
    return t.choice(at_most(_FAR, number), _FAR, t.operation('add', number, _ONE))


def _once_within(age: Term, bound: Term, p: Sequence[Term]) -> tuple[Term, Term]:
    now = t.choice(p[0], _NONE, age)
    return at_most(now, bound), _more(now)


def _always_within(age: Term, bound: Term, p: Sequence[Term]) -> tuple[Term, Term]:
    now = t.choice(p[0], age, _NONE)
    return t.negation(at_most(now, bound)), _more(now)


def _since_within(age: Term, bound: Term, pq: Sequence[Term]) -> tuple[Term, Term]:
    now = t.choice(pq[1], _NONE, t.choice(pq[0], age, _FAR))
    return at_most(now, bound), _more(now)


def _once_before(count: Term, bound: Term, p: Sequence[Term]) -> tuple[Term, Term]:
    has_been = t.disjunction(p[0], t.negation(t.relation('equal', count, _NONE)))
    after = t.choice(has_been, _more(count), _NONE)
    return t.negation(at_most(after, bound)), after


def _since_before(count: Term, bound: Term, pq: Sequence[Term]) -> tuple[Term, Term]:
    return _once_before(t.choice(pq[0], count, _NONE), bound, pq[1:])


def _same_age(counter: Term, age: Term, bound: Term) -> Term:
    """Return whether the counter equals the age, or both are above the bound."""
    wide = t.resized(counter, WIDTH, False)
    return t.choice(at_most(age, bound), t.relation('equal', wide, age),
                    t.negation(at_most(wide, bound)))


def _same_count(counter: Term, count: Term, bound: Term) -> Term:
    """Return whether the counter equals the count, saturated at bound + 1."""
    wide = t.resized(counter, WIDTH, False)
    limit = t.operation('add', bound, _ONE)
    return t.relation('equal', wide, t.choice(at_most(count, limit), count, limit))


def _below_half(bound: Term, bits: int) -> Term:
    """Return whether 2 * bound + 1 fits a counter of `bits` bits, and the bound is at least 1."""
    twice = t.operation('add', t.operation('add', bound, bound), _ONE)
    return t.conjunction(at_most(twice, t.number((1 << bits) - 1, WIDTH)), at_most(_ONE, bound))


def _below_end(bound: Term, bits: int) -> Term:
    """Return whether bound + 1 fits a counter of `bits` bits, and the bound is at least 1."""
    more = t.operation('add', bound, _ONE)
    return t.conjunction(at_most(more, t.number((1 << bits) - 1, WIDTH)), at_most(_ONE, bound))


def _after_bound(bound: Term, head: Term) -> Term:
    return t.operation('sub', t.operation('add', bound, _ONE), head)


def _never(bound: Term, head: Term) -> Term:
    return _NONE


COUNTERS = {cell.name: cell for cell in (
    CounterModel('once_within', 1, True, _after_bound, _once_within, _same_age, _below_half),
    CounterModel('always_within', 1, True, _after_bound, _always_within, _same_age, _below_half),
    CounterModel('since_within', 2, False, _after_bound, _since_within, _same_age, _below_half),
    CounterModel('once_before', 1, False, _never, _once_before, _same_count, _below_end),
    CounterModel('since_before', 2, False, _never, _since_before, _same_count, _below_end),
)}


# -- shift registers and rings ---------------------------------------------------------------

def line_step(history: Term, steps: int | Term, p: Term) -> tuple[Term, Term]:
    """Return p of `steps` steps ago, and the next history; bit k is p of k + 1 steps ago."""
    count = t.number(steps, HISTORY) if isinstance(steps, int) else steps
    place = t.operation('sub', count, t.number(1, HISTORY))
    out = t.bit(t.operation('lshr', history, place), 0)
    shifted = t.operation('shl', history, t.number(1, HISTORY))
    return out, t.operation('bitor', shifted, t.from_truth(p, HISTORY))


def line_related(line: Term, history: Term, steps: int | Term) -> Term:
    """Return whether register and history agree in their lowest `steps` bits."""
    count = t.number(steps, HISTORY) if isinstance(steps, int) else steps
    one = t.number(1, HISTORY)
    mask = t.operation('sub', t.operation('shl', one, count), one)
    both = t.operation('bitxor', t.resized(line, HISTORY, False), history)
    return t.relation('equal', t.operation('bitand', both, mask), t.number(0, HISTORY))


def line_start(initial: bool) -> Term:
    """Return the history before step 0."""
    return t.number(-1 if initial else 0, HISTORY)


def line_fits(steps: Term, bits: int) -> Term:
    """Return whether 2 <= steps <= bits, so that a register can store the steps."""
    return t.conjunction(
        t.relation('ule', t.number(2, steps.sort[1]), steps),
        t.relation('ule', steps, t.number(bits, steps.sort[1])))


def ring_step(ring: Term, position: Term, p: Term) -> tuple[Term, Term]:
    """Return the bit at a position (a word of 32 bits), and the ring with p stored there."""
    place = t.operation('lshr', position, t.number(3, 32))
    byte = t.select(ring, place)
    within = t.resized(t.operation('bitand', position, t.number(7, 32)), 8, False)
    out = t.bit(t.operation('lshr', byte, within), 0)
    mask = t.operation('shl', t.number(1, 8), within)
    put = t.choice(p, t.operation('bitor', byte, mask),
                   t.operation('bitand', byte, t.unary('complement', mask)))
    return out, t.store(ring, place, put)


def next_position(position: Term, length: int | Term) -> Term:
    """Return the position after a given one (words of 32 bits), modulo `length`."""
    limit = t.number(length, 32) if isinstance(length, int) else length
    after = t.operation('add', position, t.number(1, 32))
    return t.choice(t.relation('equal', after, limit), t.number(0, 32), after)
