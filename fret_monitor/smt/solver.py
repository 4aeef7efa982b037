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
Validity queries to z3.

Expensive operations (multiplication, division, float arithmetic, conversions) are first abstracted
to uninterpreted functions, which is sound. Only if that proof fails, the query is repeated with
the operations themselves. Functions of the C library, and cells that are replaced by contracts,
are always uninterpreted.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum
import math
from random import Random
import struct
import sys
import time
from typing import Any

from fret_monitor.model.floats import to_float32
from fret_monitor.smt import terms as t
from fret_monitor.smt.concrete import function_of
from fret_monitor.smt.linear import LinearTranslation, NotLinear, SharedTranslation
from fret_monitor.smt.terms import Sort, Term
import z3

_EXPENSIVE = frozenset({'mul', 'udiv', 'urem', 'sdiv', 'srem', 'fadd', 'fsub', 'fmul', 'fdiv',
                        'float', 'float_u', 'float_s'})
_TRIALS = 500
_UNINTERPRETED = frozenset({*t.LIBRARY, 'cell', 'cell_next'})


class ProofAnswer(Enum):
    """The solver's answer to a proof obligation."""

    PROVED = 'proved'
    REFUTED = 'refuted'
    UNKNOWN = 'not proved'


@dataclass(frozen=True)
class Result:
    """An answer; if it is REFUTED, values of the variables for which the goal is false."""

    answer: ProofAnswer
    values: Mapping[Term, Any]
    seconds: float


PROVED = Result(ProofAnswer.PROVED, {}, 0.0)


def new_solver(seconds: float, *, is_simple: bool = False) -> Any:
    """
    Return a solver with a time limit that does not handle SIGINT.

    A simple one does without the tactics of z3: faster for queries that take it milliseconds.
    """
    solver = z3.SimpleSolver() if is_simple else z3.Solver()
    solver.set('timeout', max(1, int(seconds * 1000)))
    solver.set('ctrl_c', False)
    return solver


def solver_version() -> str:
    """Return the name and version of the solver."""
    return f'z3 {z3.get_version_string()}'


def shown_values(values: Mapping[Term, Any]) -> str:
    """Return values of variables as text."""
    pairs = sorted((str(item.value), value) for item, value in values.items())
    return ', '.join(f'{name} = {value}' for name, value in pairs)


def prove(goals: Sequence[Term], given: Sequence[Term] = (), *, seconds: float = 10.0) -> Result:
    """Check whether the conjunction of `given` implies every goal."""
    before = time.perf_counter()
    goal = t.all_of(goals)
    if goal is t.TRUE:
        return PROVED
    result = _ask(goal, given, Translation(True), seconds)
    if result.answer is not ProofAnswer.PROVED and any(
            item.op in _EXPENSIVE for item in t.postorder([goal, *given])):
        tried = _tried(goal, given)
        result = _ask(goal, given, Translation(False), seconds) if tried is None \
            else Result(ProofAnswer.REFUTED, tried, 0.0)
    return Result(result.answer, result.values, time.perf_counter() - before)


def prove_linear(goal: Term, given: Sequence[Term] = (), *, seconds: float = 10.0) -> Result:
    """As `prove`, faster for terms that only have sums and comparisons of words."""
    if goal is t.TRUE:
        return PROVED
    try:
        return _ask(goal, given, SharedTranslation(), seconds)
    except NotLinear:
        return prove([goal], given, seconds=seconds)


def _tried(goal: Term, given: Sequence[Term]) -> dict[Term, Any] | None:
    """Search for a counterexample by evaluation, which is faster than z3 for products."""
    order = t.postorder([goal, *given])
    inputs = [item for item in order if item.op == 'variable']
    if any(item.op in _UNINTERPRETED or item.sort[0] == 'ring' for item in order):
        return None
    compute = function_of([goal, *given], inputs)
    rng = Random(0)
    for _ in range(_TRIALS):
        values = [_drawn(rng, item.sort) for item in inputs]
        found, *holds = compute(*values)
        if not found and all(holds):
            return dict(zip(inputs, values))
    return None


def _drawn(rng: Random, sort: Sort) -> Any:
    kind, bits = sort
    if kind == 'bool':
        return rng.random() < 0.5
    if kind == 'word':
        plain = rng.choice((0, 1, 2, 3, 7, -1, -2, 1 << (bits - 1), (1 << (bits - 1)) - 1))
        return (plain if rng.random() < 0.5 else rng.getrandbits(bits)) & ((1 << bits) - 1)
    value = rng.choice((0.0, -0.0, 1.0, -1.0, 0.5, 3.0, math.inf, math.nan, rng.uniform(-1e3, 1e3),
                        rng.uniform(-2, 2), 1e300))
    return to_float32(value) if bits == 32 else value


@contextmanager
def _interrupts_kept() -> Iterator[None]:
    """Raise a KeyboardInterrupt at exit that Python discarded in a finalizer of a z3 object."""
    lost: list[BaseException] = []
    before = sys.unraisablehook

    def keep(item: 'sys.UnraisableHookArgs') -> None:
        if isinstance(item.exc_value, KeyboardInterrupt):
            lost.append(item.exc_value)
        else:
            before(item)

    sys.unraisablehook = keep
    try:
        yield
    finally:
        sys.unraisablehook = before
    if lost:
        raise lost[0]


def _ask(goal: Term, given: Sequence[Term], translation: 'Translation | LinearTranslation',
         seconds: float) -> Result:
    solver = new_solver(seconds, is_simple=isinstance(translation, LinearTranslation))
    with _interrupts_kept():
        for item in given:
            solver.add(translation(item))
        solver.add(z3.Not(translation(goal)))
        if isinstance(translation, LinearTranslation):
            solver.add(*translation.ranges)
    before = time.perf_counter()
    found = solver.check()
    spent = time.perf_counter() - before
    if found == z3.unsat:
        return Result(ProofAnswer.PROVED, {}, spent)
    if found == z3.unknown:
        return Result(ProofAnswer.UNKNOWN, {}, spent)
    model = solver.model()
    values = {item: value_in(model, shown, item.sort)
              for item, shown in translation.variables.items()}
    return Result(ProofAnswer.REFUTED, values, spent)


def value_in(model: Any, shown: Any, sort: Sort) -> Any:
    """Return the value of a variable in a model: bool, int, float or bytes."""
    kind, size = sort
    if kind == 'ring':
        places = (z3.Select(shown, z3.BitVecVal(i, 32)) for i in range(min(size, 4096)))
        return bytes(model.eval(each, model_completion=True).as_long() for each in places)
    found = model.eval(shown, model_completion=True)
    if kind == 'bool':
        return bool(z3.is_true(found))
    if kind == 'word':
        return found.as_long() & ((1 << size) - 1)
    return _float(model, found, size)


def _float(model: Any, found: Any, bits: int) -> float:
    pattern = model.eval(z3.fpToIEEEBV(found), model_completion=True)
    if found.isNaN():
        return t.plain(t.floating(float('nan'), bits))  # type: ignore[no-any-return]
    return float(_from_pattern(pattern.as_long(), bits))


def _from_pattern(pattern: int, bits: int) -> float:
    codes = ('<I', '<f') if bits == 32 else ('<Q', '<d')
    return float(struct.unpack(codes[1], struct.pack(codes[0], pattern))[0])


class Translation:
    """Translates terms to z3; `variables` has those of the terms translated so far."""

    def __init__(self, is_abstract: bool) -> None:
        """Set whether expensive operations become uninterpreted functions."""
        self.variables: dict[Term, Any] = {}
        self._is_abstract = is_abstract
        self._known: dict[Term, Any] = {}

    def __call__(self, root: Term) -> Any:
        """Return the z3 expression of a term."""
        for item in t.postorder([root], self._known):
            self._known[item] = self._translated(item)
        return self._known[root]

    def _translated(self, item: Term) -> Any:
        args = [self._known[each] for each in item.args]
        if item.op in _UNINTERPRETED or (self._is_abstract and item.op in _EXPENSIVE):
            return self._uninterpreted(item, args)
        match item.op:
            case 'variable':
                self.variables[item] = shown = z3.Const(item.value, _sort(item.sort))
                return shown
            case 'constant':
                return _constant(item)
            case 'filled':
                return z3.K(z3.BitVecSort(32), z3.BitVecVal(item.value, 8))
            case 'bit':
                return z3.Extract(item.value, item.value, args[0]) == 1
            case 'word':
                bits = item.sort[1]
                return z3.If(args[0], z3.BitVecVal(1, bits), z3.BitVecVal(0, bits))
            case 'zext' | 'sext':
                more = item.sort[1] - item.args[0].sort[1]
                return (z3.ZeroExt if item.op == 'zext' else z3.SignExt)(more, args[0])
            case 'trunc':
                return z3.Extract(item.sort[1] - 1, 0, args[0])
            case 'float':
                return z3.fpFPToFP(z3.RNE(), args[0], _sort(item.sort))
            case 'float_s':
                return z3.fpSignedToFP(z3.RNE(), args[0], _sort(item.sort))
            case 'float_u':
                return z3.fpUnsignedToFP(z3.RNE(), args[0], _sort(item.sort))
            case _:
                return _DIRECT[item.op](*args)

    def _uninterpreted(self, item: Term, args: list[Any]) -> Any:
        sorts = [_sort(each.sort) for each in item.args]
        name = '.'.join([item.op, str(item.value or ''), *map(str, sorts), str(item.sort)])
        return z3.Function(name, *sorts, _sort(item.sort))(*args)


def _sort(sort: Sort) -> Any:
    kind, bits = sort
    match kind:
        case 'bool':
            return z3.BoolSort()
        case 'word':
            return z3.BitVecSort(bits)
        case 'real':
            return z3.Float32() if bits == 32 else z3.Float64()
        case _:
            return z3.ArraySort(z3.BitVecSort(32), z3.BitVecSort(8))


def _constant(item: Term) -> Any:
    kind, bits = item.sort
    if kind == 'bool':
        return z3.BoolVal(item.value)
    if kind == 'word':
        return z3.BitVecVal(item.value, bits)
    value = t.plain(item)
    if value != value:
        return z3.fpNaN(_sort(item.sort))
    return z3.FPVal(value, _sort(item.sort))


_DIRECT: dict[str, Callable[..., Any]] = {
    'not': z3.Not,
    'and': z3.And,
    'iff': lambda a, b: a == b,
    'choice': z3.If,
    'add': lambda a, b: a + b,
    'sub': lambda a, b: a - b,
    'mul': lambda a, b: a * b,
    'bitand': lambda a, b: a & b,
    'bitor': lambda a, b: a | b,
    'bitxor': lambda a, b: a ^ b,
    'complement': lambda a: ~a,
    'shl': lambda a, b: a << b,
    'lshr': z3.LShR,
    'ashr': lambda a, b: a >> b,
    'udiv': z3.UDiv,
    'urem': z3.URem,
    'sdiv': lambda a, b: a / b,
    'srem': z3.SRem,
    'ult': z3.ULT,
    'slt': lambda a, b: a < b,
    'equal': lambda a, b: a == b,
    'same': lambda a, b: a == b,
    'fneg': z3.fpNeg,
    'fadd': lambda a, b: z3.fpAdd(z3.RNE(), a, b),
    'fsub': lambda a, b: z3.fpSub(z3.RNE(), a, b),
    'fmul': lambda a, b: z3.fpMul(z3.RNE(), a, b),
    'fdiv': lambda a, b: z3.fpDiv(z3.RNE(), a, b),
    'flt': z3.fpLT,
    'fle': z3.fpLEQ,
    'feq': z3.fpEQ,
    'select': z3.Select,
    'store': z3.Store,
}
