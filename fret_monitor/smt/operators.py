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
Proofs that the models of the cells compute the operators, for every trace, bound and step.

A trace is a function from steps to truth values. The operators are those of docs/language.md,
defined with quantifiers over steps. The state of a cell is a natural number, with an invariant
that relates it to the trace before step t. The solver checks over unbounded integers that the
invariant holds before step 0, that a step preserves it, and that it implies that the cell returns
the operator's value. The words of `cells.py` saturate at 2^63, which is equivalent by the claims
`stops_far_away`.
"""

from collections.abc import Iterator
from dataclasses import dataclass
import time
from typing import Any

from fret_monitor.smt.solver import new_solver, ProofAnswer, Result
import z3

_LIMIT = 1 << 63


@dataclass(frozen=True)
class Claim:
    """A theorem about all traces: `given` implies `goal`."""

    name: str
    given: tuple[Any, ...]
    goal: Any


def check(claim: Claim, seconds: float) -> Result:
    """Check a claim with the solver."""
    solver = new_solver(seconds)
    solver.add(*claim.given, z3.Not(claim.goal))
    before = time.perf_counter()
    found = solver.check()
    spent = time.perf_counter() - before
    if found == z3.unsat:
        return Result(ProofAnswer.PROVED, {}, spent)
    return Result(ProofAnswer.REFUTED if found == z3.sat else ProofAnswer.UNKNOWN, {}, spent)


_p = z3.Function('p', z3.IntSort(), z3.BoolSort())
_q = z3.Function('q', z3.IntSort(), z3.BoolSort())
_t, _b, _h, _n, _m, _k, _j = z3.Ints('t b h n m k j')
_TIME = (_t >= 0, _b >= 1, _h >= 0, _h <= _b + 1)


def _before(condition: Any, start: Any, end: Any) -> Any:
    """Whether a condition of k holds for all start <= k < end."""
    return z3.ForAll([_k], z3.Implies(z3.And(start <= _k, _k < end), condition))


def _held(start: Any, end: Any) -> Any:
    """Whether p holds at all steps after `start` and before `end`."""
    return z3.ForAll([_j], z3.Implies(z3.And(start < _j, _j < end), _p(_j)))


def _since(end: Any, low: Any, high: Any) -> Any:
    """Whether q holds at some k in low..high, and p at every step after k and before `end`."""
    return z3.Exists([_k], z3.And(low <= _k, _k <= high, _q(_k), _held(_k, end)))


def _some(condition: Any, low: Any, high: Any) -> Any:
    return z3.Exists([_k], z3.And(low <= _k, _k <= high, condition))


def _oldest(low: Any) -> Any:
    return z3.If(low >= 0, low, 0)


def _within(name: str, holds: Any, is_dual: bool) -> Iterator[Claim]:
    """
    Yield the claims of `O[0,b]`, true at the first h steps, or of its dual.

    The number counts the steps since the condition `holds` was last true; before the first time,
    it counts up from b + 1 - h.
    """
    def about(time: Any, count: Any) -> Any:
        last = time - count
        met = z3.And(0 <= last, last < time, holds(last),
                     _before(z3.Not(holds(_k)), last + 1, time))
        none = z3.And(count == _b + 1 - _h + time, _before(z3.Not(holds(_k)), 0, time))
        return z3.And(count >= 0, z3.Or(met, none))

    now = z3.If(holds(_t), 0, _n)
    meaning = z3.Or(_some(holds(_k), _oldest(_t - _b), _t), _t < _h)
    out = now > _b if is_dual else now <= _b
    if is_dual:
        meaning = z3.And(_before(z3.Not(holds(_k)), _oldest(_t - _b), _t + 1), _t >= _h)
    yield Claim(f'{name}: start', _TIME, about(z3.IntVal(0), _b + 1 - _h))
    yield Claim(f'{name}: step', (*_TIME, about(_t, _n)), about(_t + 1, now + 1))
    yield Claim(f'{name}: operator', (*_TIME, about(_t, _n)), out == meaning)


def _since_within() -> Iterator[Claim]:
    """
    Yield the claims of `p S[0,b] q`.

    The number counts the steps since the last q after which p held throughout. If there is none,
    it is above b, and m is the last step without p (-1 for none): no q has occurred since m.
    """
    def met(time: Any, count: Any) -> Any:
        last = time - count
        return z3.And(0 <= last, last < time, _q(last), _held(last, time),
                      _before(z3.Not(_q(_k)), last + 1, time))

    def none(time: Any, count: Any, stop: Any) -> Any:
        return z3.And(count > _b, -1 <= stop, stop < time,
                      z3.Or(stop == -1, z3.Not(_p(stop))),
                      _before(z3.Not(_q(_k)), _oldest(stop), time))

    def about(time: Any, count: Any, stop: Any) -> Any:
        return z3.And(count >= 0, z3.Or(met(time, count), none(time, count, stop)))

    never = z3.Int('never')
    given = (*_TIME, never > _b, about(_t, _n, _m))
    now = z3.If(_q(_t), 0, z3.If(_p(_t), _n, never))
    stop = z3.If(_p(_t), _m, _t)
    yield Claim('since_within: start', _TIME, about(z3.IntVal(0), _b + 1, z3.IntVal(-1)))
    yield Claim('since_within: step', given, about(_t + 1, now + 1, stop))
    yield Claim('since_within: operator', given,
                (now <= _b) == _since(_t + 1, _oldest(_t - _b), _t))


def _once_before() -> Iterator[Claim]:
    """Yield the claims of `O[b,inf) p`; the number is 1 + the steps since the first p, or 0."""
    def about(time: Any, count: Any) -> Any:
        first = time - count
        met = z3.And(count > 0, 0 <= first, first < time, _p(first),
                     _before(z3.Not(_p(_k)), 0, first))
        return z3.Or(met, z3.And(count == 0, _before(z3.Not(_p(_k)), 0, time)))

    given = (*_TIME, about(_t, _n))
    now = z3.If(z3.Or(_p(_t), _n > 0), _n + 1, 0)
    yield Claim('once_before: start', _TIME, about(z3.IntVal(0), z3.IntVal(0)))
    yield Claim('once_before: step', given, about(_t + 1, now))
    yield Claim('once_before: operator', given, (now > _b) == _some(_p(_k), 0, _t - _b))


def _since_before() -> Iterator[Claim]:
    """
    Yield the claims of `p S[b,inf) q`.

    The number is 1 + the steps since the oldest q after which p held throughout, or 0 if there is
    none; m is the last step without p, -1 for none.
    """
    def about(time: Any, count: Any, stop: Any) -> Any:
        oldest = z3.If(count > 0, time - count, time)
        begun = z3.And(0 <= oldest, oldest < time, _q(oldest), _held(oldest, time))
        return z3.And(count >= 0, -1 <= stop, stop < time, stop <= oldest,
                      z3.Or(stop == -1, z3.Not(_p(stop))),
                      _before(z3.Not(_q(_k)), _oldest(stop), oldest),
                      z3.Implies(count > 0, begun))

    given = (*_TIME, about(_t, _n, _m))
    kept = z3.If(_p(_t), _n, 0)
    now = z3.If(z3.Or(_q(_t), kept > 0), kept + 1, 0)
    stop = z3.If(_p(_t), _m, _t)
    yield Claim('since_before: start', _TIME, about(z3.IntVal(0), z3.IntVal(0), z3.IntVal(-1)))
    yield Claim('since_before: step', given, about(_t + 1, now, stop))
    yield Claim('since_before: operator', given,
                (now > _b) == _since(_t + 1, z3.IntVal(0), _t - _b))


def _bits() -> Iterator[Claim]:
    """Yield the claims of the one-bit cells."""
    once = _some(_p(_k), 0, _t)
    yield Claim('once_ever: start', (_t == -1,), z3.Not(once))
    yield Claim('once_ever: step', _TIME, once == z3.Or(_p(_t), _some(_p(_k), 0, _t - 1)))
    always = _before(_p(_k), 0, _t + 1)
    yield Claim('always_so_far: start', (_t == -1,), always)
    yield Claim('always_so_far: step', _TIME, always == z3.And(_p(_t), _before(_p(_k), 0, _t)))
    zero = z3.IntVal(0)
    since, former = _since(_t + 1, zero, _t), _since(_t, zero, _t - 1)
    yield Claim('since_ever: start', (_t == -1,), z3.Not(since))
    yield Claim('since_ever: step', _TIME, since == z3.Or(_q(_t), z3.And(_p(_t), former)))
    # p T q is defined as !(!p S !q), so its step is that of S with all values negated.
    released = z3.Bool('released')
    yield Claim('triggered_ever: step', (released == z3.Not(former),),
                z3.Not(z3.Or(z3.Not(_q(_t)), z3.And(z3.Not(_p(_t)), z3.Not(released))))
                == z3.And(_q(_t), z3.Or(_p(_t), released)))


def _delays() -> Iterator[Claim]:
    """Yield the claims of delays: bit j is p of step t - 1 - j, or `initial` before step 0."""
    seen = z3.Function('seen', z3.IntSort(), z3.BoolSort())
    bits = z3.Function('bits', z3.IntSort(), z3.BoolSort())
    after = z3.Function('bits_after', z3.IntSort(), z3.BoolSort())
    initial = z3.Bool('initial')
    trace = z3.ForAll([_k], seen(_k) == z3.If(_k < 0, initial, _p(_k)))
    history = z3.ForAll([_j], z3.Implies(_j >= 0, bits(_j) == seen(_t - 1 - _j)))
    shifted = z3.And(after(0) == _p(_t),
                     z3.ForAll([_j], z3.Implies(_j >= 0, after(_j + 1) == bits(_j))))
    # An instance of `shifted` at an arbitrary index, so that z3 need not find it.
    one = z3.Int('one')
    shown = z3.And(after(0) == _p(_t), z3.Implies(one > 0, after(one) == bits(one - 1)))
    yield Claim('delay: start', (trace, _t == 0, z3.ForAll([_j], bits(_j) == initial), one >= 0),
                bits(one) == seen(_t - 1 - one))
    yield Claim('delay: step', (trace, *_TIME, history, shifted, shown, one >= 0),
                after(one) == seen(_t - one))
    yield Claim('delay: operator', (trace, *_TIME, history, _n >= 1),
                bits(_n - 1) == z3.If(_t >= _n, _p(_t - _n), initial))


def _far() -> Iterator[Claim]:
    """Yield the claims that saturation does not affect comparisons with bounds below the limit."""
    def stopped(number: Any) -> Any:
        return z3.If(number <= _LIMIT, number, _LIMIT)

    given = (_n >= 0, _b < _LIMIT)
    yield Claim('stops_far_away: step', given, stopped(_n + 1) == stopped(stopped(_n) + 1))
    yield Claim('stops_far_away: compared', given, (_n <= _b) == (stopped(_n) <= _b))


def claims() -> list[Claim]:
    """Return all claims."""
    return [
        *_within('once_within', _p, False),
        *_within('always_within', lambda step: z3.Not(_p(step)), True),
        *_since_within(), *_once_before(), *_since_before(), *_bits(), *_delays(), *_far(),
    ]
