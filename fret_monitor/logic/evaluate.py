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
The reference semantics: the value of a formula at every step of a trace (docs/language.md).

It follows the table of operators there literally, with quantifiers over steps: each operator
examines the whole past at each step, which is easy to check and slow. Compiled monitors are
tested against it, so it shares no code with `program` and `codegen`. Numbers are those of C99,
bit for bit: integers wrap, and floats are rounded to their type after each operation.
"""

from collections.abc import Callable, Mapping, Sequence
import ctypes
import math
import operator
from typing import assert_never, cast, TypeAlias

from fret_monitor.logic.formula import (
    Binary, BinaryOperator, Choice, Constant, Conversion, Feedback, Formula, Historically, Once,
    postorder, Previous, Since, Triggered, Unary, UnaryOperator, Variable, WeakYesterday, Window,
    Yesterday,
)
from fret_monitor.model.floats import to_float32
from fret_monitor.model.values import ValueType

Value: TypeAlias = bool | int | float
Trace: TypeAlias = Mapping[str, Sequence[Value]]
Equations: TypeAlias = Sequence[tuple[Feedback, Formula]]

_Columns: TypeAlias = dict[Formula, list[Value]]
_Rule: TypeAlias = Callable[[int], Value]
_Compute: TypeAlias = Callable[..., Value]


class TraceError(ValueError):
    """A column of the trace is missing, has another length, or has a value of a wrong type."""


def evaluate(formula: Formula, trace: Trace, feedback: Equations = ()) -> list[Value]:
    """
    Return the value of a formula at every step of a trace.

    `trace` maps each input to its values, one for each step. `feedback` has the equation of each
    `Feedback` node in the formula.

    Raises
    ------
    TraceError
        if an input has no column, columns differ in length, or a value is not of the input's type.
    """
    return evaluate_all([formula], trace, feedback)[0]


def verdicts(formula: Formula, trace: Trace, feedback: Equations = ()) -> list[bool]:
    """Return the verdicts of a BOOL formula at every step; otherwise as `evaluate`."""
    return [value is True for value in evaluate(formula, trace, feedback)]


def evaluate_all(formulas: Sequence[Formula], trace: Trace,
                 feedback: Equations = ()) -> list[list[Value]]:
    """Evaluate several formulas over one trace, common subterms once; otherwise as `evaluate`."""
    steps = _steps(trace)
    nodes = postorder([*formulas, *(equation for _, equation in feedback)])
    columns: _Columns = {node: [] for node in nodes}
    equations = dict(feedback)
    rules = [(columns[node].append, _rule(node, columns, trace, equations)) for node in nodes]
    for t in range(steps):
        for append, value_at in rules:
            append(value_at(t))
    return [columns[formula] for formula in formulas]


def _steps(trace: Trace) -> int:
    lengths = {len(column) for column in trace.values()}
    if len(lengths) > 1:
        raise TraceError(f'columns of different lengths: {sorted(lengths)}')
    return lengths.pop() if lengths else 0


def _rule(node: Formula, columns: _Columns, trace: Trace,
          equations: Mapping[Feedback, Formula]) -> _Rule:
    """Return the function that computes a node at step t from its operands at steps 0..t."""
    match node:
        case Constant():
            return _constant(node)
        case Variable():
            return _stored(node, trace)
        case Conversion():
            return _conversion(node.type, columns[node.argument])
        case Unary():
            return _unary(node.operator, node.type, columns[node.argument])
        case Binary():
            return _binary(node, columns)
        case Choice():
            return _choice(columns[node.condition], columns[node.yes], columns[node.no])
        case Previous():
            return _previous(columns[node.initial], columns[node.argument])
        case Feedback():
            return _feedback(node.type, columns[equations[node]])
        case Yesterday():
            return _yesterday(columns[node.argument], False)
        case WeakYesterday():
            return _yesterday(columns[node.argument], True)
        case Once():
            return _once(node.window, columns[node.argument])
        case Historically():
            return _historically(node.window, columns[node.argument])
        case Since():
            return _since(node.window, columns[node.left], columns[node.right])
        case Triggered():
            return _triggered(node.window, columns[node.left], columns[node.right])
        case _:
            assert_never(node)


# Past-time operators, in the order of the table in docs/language.md.

def _yesterday(p: list[Value], at_start: bool) -> _Rule:
    return lambda t: p[t - 1] if t > 0 else at_start


def _past(window: Window, t: int) -> range:
    """Return the steps k with 0 <= k <= t and low <= t - k <= high."""
    first = 0 if window.high is None else max(0, t - window.high)
    return range(first, t - window.low + 1)


def _once(window: Window, p: list[Value]) -> _Rule:
    return lambda t: any(p[k] for k in _past(window, t))


def _historically(window: Window, p: list[Value]) -> _Rule:
    return lambda t: all(p[k] for k in _past(window, t))


def _since(window: Window, p: list[Value], q: list[Value]) -> _Rule:
    return lambda t: _holds_since(_past(window, t), t, lambda k: p[k] is True,
                                  lambda k: q[k] is True)


def _triggered(window: Window, p: list[Value], q: list[Value]) -> _Rule:
    return lambda t: not _holds_since(_past(window, t), t, lambda k: p[k] is False,
                                      lambda k: q[k] is False)


def _holds_since(past: range, t: int, p: Callable[[int], bool], q: Callable[[int], bool]) -> bool:
    """Return whether q holds at some k of `past`, and p at every step k+1..t."""
    for k in range(t, past.start - 1, -1):
        if k in past and q(k):
            return True
        if not p(k):
            return False
    return False


# Values of the previous step.

def _previous(initial: list[Value], argument: list[Value]) -> _Rule:
    return lambda t: argument[t - 1] if t > 0 else initial[0]


def _feedback(kind: ValueType, equation: list[Value]) -> _Rule:
    at_start = False if kind is ValueType.BOOL else _FIT[kind](0)
    return lambda t: equation[t - 1] if t > 0 else at_start


# Values of the current step.

def _constant(node: Constant) -> _Rule:
    value = _checked(node.value, node.type, 'a constant')
    return lambda t: value


def _stored(node: Variable, trace: Trace) -> _Rule:
    if node.name not in trace:
        raise TraceError(f"no column for the input '{node.name}'")
    column = [_checked(value, node.type, node.name) for value in trace[node.name]]
    return lambda t: column[t]


def _checked(value: Value, kind: ValueType, name: str) -> Value:
    if kind is ValueType.BOOL:
        if value in (0, 1):
            return bool(value)
    elif kind.is_float:
        return _FIT[kind](value)
    elif isinstance(value, int) and kind.limits[0] <= value <= kind.limits[1]:
        return int(value)
    raise TraceError(f'{name}: {value!r} is not a value of {kind.value}')


def _conversion(kind: ValueType, argument: list[Value]) -> _Rule:
    # A conversion keeps a number that the type can represent. Otherwise integers wrap modulo 2^64,
    # and float64 takes the nearest value (Python's float() rounds ties to even).
    fit = _FIT[kind]
    return lambda t: fit(argument[t])


def _choice(condition: list[Value], yes: list[Value], no: list[Value]) -> _Rule:
    return lambda t: yes[t] if condition[t] else no[t]


def _unary(operation: UnaryOperator, kind: ValueType, argument: list[Value]) -> _Rule:
    match operation:
        case UnaryOperator.NOT:
            return lambda t: not argument[t]
        case UnaryOperator.NEG:
            fit = _FIT[kind]
            return lambda t: fit(-argument[t])
        case UnaryOperator.ABS:
            fit = _FIT[kind]
            return lambda t: argument[t] if argument[t] >= 0 else fit(-argument[t])
        case _:
            assert_never(operation)


def _binary(node: Binary, columns: _Columns) -> _Rule:
    left, right = columns[node.left], columns[node.right]
    compute = _operation(node)
    return lambda t: compute(left[t], right[t])


def _operation(node: Binary) -> _Compute:
    if node.operator.is_boolean:
        return _CONNECTIVES[node.operator]
    if node.operator.is_relation:
        # Python compares floats of one type as C does (with NaN only != is true), and integers
        # by value, as INT64 with UINT64 requires.
        return _RELATIONS[node.operator]
    if node.operator is BinaryOperator.POW:
        return _power(node)
    compute = (_FLOAT if node.type.is_float else _INTEGER)[node.operator]
    fit = _FIT[node.type]
    return lambda a, b: fit(compute(a, b))


_CONNECTIVES: dict[BinaryOperator, _Compute] = {
    BinaryOperator.AND: lambda a, b: a and b,
    BinaryOperator.OR: lambda a, b: a or b,
    BinaryOperator.XOR: lambda a, b: a is not b,
    BinaryOperator.IMPLIES: lambda a, b: not a or b,
    BinaryOperator.IFF: lambda a, b: a is b,
}

_RELATIONS: dict[BinaryOperator, _Compute] = {
    BinaryOperator.LT: operator.lt,
    BinaryOperator.LE: operator.le,
    BinaryOperator.GT: operator.gt,
    BinaryOperator.GE: operator.ge,
    BinaryOperator.EQ: operator.eq,
    BinaryOperator.NE: operator.ne,
}


# Numbers. An operation is computed with Python's exact integers or in float64, and the result is
# wrapped, or rounded to float32. For + - * / of float32 this double rounding gives the correctly
# rounded result, because float64 has 53 >= 2 * 24 + 2 bits (Figueroa, 'When is double rounding
# innocuous?', SIGNUM Newsletter 30(3), 1995). fmod, min, max, abs and negation are exact.

def _int64(value: Value) -> Value:
    return (int(value) + 2 ** 63) % 2 ** 64 - 2 ** 63


def _uint64(value: Value) -> Value:
    return int(value) % 2 ** 64


_FIT: dict[ValueType, Callable[[Value], Value]] = {
    ValueType.INT64: _int64,
    ValueType.UINT64: _uint64,
    ValueType.FLOAT32: to_float32,
    ValueType.FLOAT64: float,
}


def _integer_quotient(a: int, b: int) -> int:
    """Divide, truncating toward zero; x / 0 is 0."""
    if b == 0:
        return 0
    magnitude = abs(a) // abs(b)
    return magnitude if (a < 0) == (b < 0) else -magnitude


def _integer_remainder(a: int, b: int) -> int:
    """Return the remainder of that division, with the sign of a; x mod 0 is 0."""
    return a - b * _integer_quotient(a, b) if b != 0 else 0


def _float_quotient(a: float, b: float) -> float:
    """Divide as IEEE 754 does; Python raises an exception for a zero divisor."""
    if b != 0:
        return a / b
    if a == 0 or math.isnan(a):
        return math.nan
    return math.copysign(math.inf, a) * math.copysign(1, b)


def _float_remainder(a: float, b: float) -> float:
    """Return C's fmod: NaN for an infinite a or a zero b, where Python raises an exception."""
    if b == 0 or math.isinf(a):
        return math.nan
    return math.fmod(a, b)


def _least(a: Value, b: Value) -> Value:
    # With a NaN the result is b; Python's min and max would return a.
    return b if not a <= b else a


def _greatest(a: Value, b: Value) -> Value:
    return b if not a >= b else a


_INTEGER: dict[BinaryOperator, _Compute] = {
    BinaryOperator.ADD: operator.add,
    BinaryOperator.SUB: operator.sub,
    BinaryOperator.MUL: operator.mul,
    BinaryOperator.DIV: _integer_quotient,
    BinaryOperator.MOD: _integer_remainder,
    BinaryOperator.MIN: _least,
    BinaryOperator.MAX: _greatest,
}

_FLOAT: dict[BinaryOperator, _Compute] = {
    **_INTEGER,
    BinaryOperator.DIV: _float_quotient,
    BinaryOperator.MOD: _float_remainder,
}


def _power(node: Binary) -> _Compute:
    if node.right.type is ValueType.FLOAT64:
        return _libm_pow
    fit = _FIT[node.type]
    return lambda base, exponent: _repeated(base, int(exponent), fit)


def _repeated(base: Value, exponent: int, fit: Callable[[Value], Value]) -> Value:
    """
    Compute a power by repeated squaring, in the base's type; x^0 is 1, also for NaN.

    The order of the products is part of the definition, because it affects rounding.
    """
    result = fit(1)
    while exponent:
        if exponent & 1:
            result = fit(result * base)
        exponent >>= 1
        if exponent:
            base = fit(base * base)
    return result


def _libm_pow(base: float, exponent: float) -> float:
    # Not Python's **, which raises an exception where C's pow returns an infinity or a NaN.
    return cast(float, _pow(base, exponent))


_pow = ctypes.CDLL(None).pow
_pow.argtypes = (ctypes.c_double, ctypes.c_double)
_pow.restype = ctypes.c_double
