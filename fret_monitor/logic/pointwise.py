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
The value of a node from the values of its operands at the same instant, or in its window.

Numbers are those of C99, bit for bit: integers wrap, and floats are rounded to their type after
each operation. `evaluate` and `timed` give every node without past its meaning from here.
"""

from collections.abc import Callable, Sequence
import ctypes
from fractions import Fraction
from functools import reduce
import math
import operator
from typing import assert_never, cast, TypeAlias

from fret_monitor.logic.formula import (
    Aggregate, Binary, BinaryOperator, Choice, Constant, Conversion, Over, Unary, UnaryOperator,
)
from fret_monitor.model.floats import to_float32, to_float64
from fret_monitor.model.values import ValueType

Value: TypeAlias = bool | int | float
Compute: TypeAlias = Callable[..., Value]
Pointwise: TypeAlias = Constant | Conversion | Unary | Binary | Choice


class TraceError(ValueError):
    """A trace does not fit: a column is missing, has another length or a value of another type."""


def operation(node: Pointwise) -> Compute:
    """
    Return the function from the values of a node's operands to its own value.

    Raises
    ------
    TraceError
        if a constant is not a value of its type.
    """
    match node:
        case Constant():
            value = checked(node.value, node.type, 'a constant')
            return lambda: value
        case Conversion():
            # A conversion keeps a number that the type can represent. Otherwise integers wrap
            # modulo 2^64, and float64 takes the nearest value (Python's float() rounds ties to
            # even).
            return _FIT[node.type]
        case Unary():
            return _unary(node.operator, node.type)
        case Binary():
            return _binary(node)
        case Choice():
            return lambda condition, yes, no: yes if condition else no
        case _:
            assert_never(node)


def checked(value: Value, kind: ValueType, name: str) -> Value:
    """
    Return a value as one of a type; floats are rounded to it.

    Raises
    ------
    TraceError
        if it is not a value of that type; the message calls it `name`.
    """
    if kind is ValueType.BOOL:
        if value in (0, 1):
            return bool(value)
    elif kind.is_float:
        return _FIT[kind](value)
    elif isinstance(value, int) and kind.limits[0] <= value <= kind.limits[1]:
        return int(value)
    raise TraceError(f'{name}: {value!r} is not a value of {kind.value}')


def at_start(kind: ValueType) -> Value:
    """Return the value of a `Feedback` node at the first instant: false, 0 or 0.0."""
    return False if kind is ValueType.BOOL else _FIT[kind](0)


def _unary(operation: UnaryOperator, kind: ValueType) -> Compute:
    match operation:
        case UnaryOperator.NOT:
            return operator.not_
        case UnaryOperator.NEG:
            fit = _FIT[kind]
            return lambda a: fit(-a)
        case UnaryOperator.ABS:
            fit = _FIT[kind]
            return lambda a: a if a >= 0 else fit(-a)
        case _:
            return library_function(operation.value, 1)


def _binary(node: Binary) -> Compute:
    if node.operator.is_boolean:
        return _CONNECTIVES[node.operator]
    if node.operator.is_relation:
        # Python compares floats of one type as C does (with NaN only != is true), and integers
        # by value, as INT64 with UINT64 requires.
        return _RELATIONS[node.operator]
    if node.operator is BinaryOperator.POW:
        return _power(node)
    if node.operator is BinaryOperator.ATAN2:
        return library_function('atan2', 2)
    compute = (_FLOAT if node.type.is_float else _INTEGER)[node.operator]
    fit = _FIT[node.type]
    return lambda a, b: fit(compute(a, b))


_CONNECTIVES: dict[BinaryOperator, Compute] = {
    BinaryOperator.AND: lambda a, b: a and b,
    BinaryOperator.OR: lambda a, b: a or b,
    BinaryOperator.XOR: lambda a, b: a is not b,
    BinaryOperator.IMPLIES: lambda a, b: not a or b,
    BinaryOperator.IFF: lambda a, b: a is b,
}

_RELATIONS: dict[BinaryOperator, Compute] = {
    BinaryOperator.LT: operator.lt,
    BinaryOperator.LE: operator.le,
    BinaryOperator.GT: operator.gt,
    BinaryOperator.GE: operator.ge,
    BinaryOperator.EQ: operator.eq,
    BinaryOperator.NE: operator.ne,
}


# Numbers over time. The order of the values in the window makes no difference.

def aggregate(node: Over) -> Callable[[Sequence[Value]], Value]:
    """Return the function from the values in the window of a node to its own value."""
    match node.aggregate:
        case Aggregate.GREATEST:
            return lambda values: reduce(_greater, values)
        case Aggregate.LEAST:
            return lambda values: reduce(_lesser, values)
        case Aggregate.COUNT:
            return lambda values: sum(value is True for value in values)
        case Aggregate.SUM if node.type.is_integer:
            fit = _FIT[node.type]
            return lambda values: fit(sum(values))
        case Aggregate.SUM:
            return lambda values: _quotient_of_sum(values, 1)
        case Aggregate.MEAN:
            return lambda values: _quotient_of_sum(values, len(values))
        case _:
            assert_never(node.aggregate)


def slope(before: tuple[Value, Value], now: tuple[Value, Value]) -> Value:
    """Return the change from one time (ns) and its value to another, per second."""
    seconds = (now[0] - before[0]) / 1e9
    return _float_quotient(now[1] - before[1], seconds)


def _greater(a: Value, b: Value) -> Value:
    """Return the greater number; NaN if one is NaN, and 0.0 of 0.0 and -0.0."""
    if a != a or b != b:
        return math.nan
    return max(a, b, key=lambda item: (item, math.copysign(1, item)))


def _lesser(a: Value, b: Value) -> Value:
    """Return the lesser number; NaN if one is NaN, and -0.0 of 0.0 and -0.0."""
    if a != a or b != b:
        return math.nan
    return min(a, b, key=lambda item: (item, math.copysign(1, item)))


def _quotient_of_sum(values: Sequence[Value], divisor: int) -> float:
    """
    Return the exact sum of floats over a divisor, rounded once; NaN if there is none.

    With NaN, or infinities of both signs, it is NaN; with infinities of one sign, that infinity.
    """
    odd = {value for value in values if not math.isfinite(value)}
    if divisor == 0 or len(odd) > 1 or any(math.isnan(value) for value in odd):
        return math.nan
    if odd:
        return float(odd.pop())
    return to_float64(sum(map(Fraction, values), Fraction(0)) / divisor)


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


_INTEGER: dict[BinaryOperator, Compute] = {
    BinaryOperator.ADD: operator.add,
    BinaryOperator.SUB: operator.sub,
    BinaryOperator.MUL: operator.mul,
    BinaryOperator.DIV: _integer_quotient,
    BinaryOperator.MOD: _integer_remainder,
    BinaryOperator.MIN: _least,
    BinaryOperator.MAX: _greatest,
}

_FLOAT: dict[BinaryOperator, Compute] = {
    **_INTEGER,
    BinaryOperator.DIV: _float_quotient,
    BinaryOperator.MOD: _float_remainder,
}


def _power(node: Binary) -> Compute:
    if node.right.type is ValueType.FLOAT64:
        return library_function('pow', 2)
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


def library_function(name: str, arguments: int) -> Compute:
    """
    Return a function of the C library on `arguments` numbers of float64.

    Not that of `math`, nor `**`: these raise an exception where C returns an infinity or a NaN.
    """
    function = ctypes.CDLL(None)[name]
    function.argtypes = (ctypes.c_double,) * arguments
    function.restype = ctypes.c_double
    return lambda *values: cast(float, function(*values))
