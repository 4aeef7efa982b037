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
Literals and constants as exact rationals, and their rounding to a type.

A number in a bundle is an `ExactNumber`: a fraction, and whether it was written as a real number
(`15.0`, `1e3`) or as a whole number (`15`). Arithmetic between literals is exact. A literal
becomes a `Constant` when it is used with a typed operand, and is rounded then, once, to nearest,
ties to even. A literal outside the range of its type, or whose exact value needs more than
`LIMIT_BITS` bits, is a `NumberError`. The limit bounds the time and memory of all functions here.
"""

from dataclasses import dataclass
from fractions import Fraction
from math import isinf
import re

from fret_monitor.logic.formula import BinaryOperator, Constant
from fret_monitor.model.floats import to_float32, to_float64
from fret_monitor.model.values import ValueType

LIMIT_BITS = 4096
_LIMIT_DIGITS = 1233  # decimal digits of LIMIT_BITS bits

_NUMBER = re.compile(r'([+-]?)(?:([0-9]+)(\.[0-9]*)?|(\.[0-9]+))(?:[eE]([+-]?[0-9]+))?')


class NumberError(ValueError):
    """A number cannot be represented; the message is a phrase such as 'too large for float32'."""


@dataclass(frozen=True)
class ExactNumber:
    """
    An exact number that has no type yet.

    `is_real`: it was written with a point or an exponent, or computed from such a number.
    `is_negative_zero` is set for `-0.0`, because a fraction 0 has no sign.
    """

    value: Fraction
    is_real: bool
    is_negative_zero: bool = False

    def __str__(self) -> str:
        """Return the number in decimal notation, shortened if it is long."""
        if self.value.denominator == 1 and abs(self.value) < 10 ** 20:
            return str(self.value.numerator)
        return f'{float(self.value):g}' if abs(self.value) < 10 ** 308 else 'a huge number'


def parse_number(text: str) -> ExactNumber:
    """
    Parse `15`, `1.5`, `.5`, `1e-3`, with or without a sign.

    Raises
    ------
    NumberError
        if the text is not such a number, or its exact value needs more than `LIMIT_BITS` bits.
    """
    match = _NUMBER.fullmatch(text.strip())
    if match is None:
        raise NumberError('not a number')
    sign, whole, fraction, bare, exponent = match.groups()
    point = (fraction or bare or '')[1:].rstrip('0')
    digits = ((whole or '') + point).lstrip('0')
    is_real = fraction is not None or bare is not None or exponent is not None
    magnitude = _scaled(digits, exponent or '0', len(point))
    literal = ExactNumber(magnitude, is_real)
    return negated(literal) if sign == '-' else literal


def _scaled(digits: str, exponent: str, places: int) -> Fraction:
    if not digits:
        return Fraction(0)
    # Check the lengths before computing the value: `1e999999999` would take all memory.
    if len(digits) > _LIMIT_DIGITS or len(exponent.lstrip('+-0')) > len(str(_LIMIT_DIGITS)):
        raise NumberError(f'needs more than {LIMIT_BITS:,} bits')
    power = int(exponent) - places
    if abs(power) > 2 * _LIMIT_DIGITS:
        raise NumberError(f'needs more than {LIMIT_BITS:,} bits')
    return _limited(int(digits) * Fraction(10) ** power)


def _limited(value: Fraction) -> Fraction:
    if max(value.numerator.bit_length(), value.denominator.bit_length()) > LIMIT_BITS:
        raise NumberError(f'needs more than {LIMIT_BITS:,} bits')
    return value


def constant(literal: ExactNumber, kind: ValueType) -> Constant:
    """
    Return a literal as a constant of type INT64, UINT64, FLOAT32 or FLOAT64; rounds once.

    Raises
    ------
    NumberError
        if it is out of the type's range, or not whole although the type is an integer type.
    """
    return Constant(stored(literal, kind), kind)


def stored(literal: ExactNumber, kind: ValueType) -> int | float:
    """
    Return a literal as a value of any number type.

    Raises
    ------
    NumberError
        as `constant` does.
    """
    if kind.is_float:
        if literal.is_negative_zero:
            return -0.0
        to_float = to_float32 if kind is ValueType.FLOAT32 else to_float64
        rounded = to_float(literal.value)
        if isinf(rounded):
            raise NumberError(f'too large for {kind.value}')
        return rounded
    if literal.value.denominator != 1:
        raise NumberError(f'not a whole number, and {kind.value} holds none other')
    low, high = kind.limits
    if not low <= literal.value <= high:
        raise NumberError(f'not between {low} and {high}, the range of {kind.value}')
    return literal.value.numerator


def negated(literal: ExactNumber) -> ExactNumber:
    """Return the literal with the other sign; `0.0` and `-0.0` are distinct."""
    is_zero = literal.is_real and literal.value == 0
    return ExactNumber(-literal.value, literal.is_real, is_zero and not literal.is_negative_zero)


def absolute(literal: ExactNumber) -> ExactNumber:
    """Return the absolute value of a literal."""
    return ExactNumber(abs(literal.value), literal.is_real)


def fold(operator: BinaryOperator, left: ExactNumber, right: ExactNumber) -> ExactNumber:
    """
    Compute `+ - * / mod min max ^` of two literals exactly.

    With two whole numbers the rules of integers apply (`7 / 2` is 3, `7 / 0` is 0), without
    wrapping; otherwise the result is a real number. The exponent of `^` must be whole.

    Raises
    ------
    NumberError
        if a real number is divided by zero, or the result needs more than `LIMIT_BITS` bits.
    """
    is_real = left.is_real or right.is_real
    a, b = left.value, right.value
    match operator:
        case BinaryOperator.ADD:
            value = a + b
        case BinaryOperator.SUB:
            value = a - b
        case BinaryOperator.MUL:
            value = a * b
        case BinaryOperator.DIV:
            value = _quotient(a, b, is_real)
        case BinaryOperator.MOD:
            value = a - b * int(_quotient(a, b, True)) if b or is_real else Fraction(0)
        case BinaryOperator.MIN:
            value = a if a <= b else b
        case BinaryOperator.MAX:
            value = a if a >= b else b
        case BinaryOperator.POW:
            return ExactNumber(_power(a, b), left.is_real or b < 0)
        case _:
            raise AssertionError(f'{operator} is not arithmetic')
    return ExactNumber(_limited(value), is_real)


def _quotient(a: Fraction, b: Fraction, is_real: bool) -> Fraction:
    if b == 0:
        if is_real:
            raise NumberError('a division by zero')
        return Fraction(0)
    return a / b if is_real else Fraction(int(a / b))


def _power(base: Fraction, exponent: Fraction) -> Fraction:
    if base == 0 and exponent < 0:
        raise NumberError('a division by zero')
    size = max(base.numerator.bit_length(), base.denominator.bit_length()) - 1
    if base not in (-1, 0, 1) and abs(exponent) * max(size, 1) > 2 * LIMIT_BITS:
        raise NumberError(f'needs more than {LIMIT_BITS:,} bits')
    if base in (-1, 0, 1):
        # Their powers stay small, so any exponent is allowed; reduce it to 0 or 1.
        exponent = exponent % 2 if base == -1 else Fraction(exponent != 0)
    return _limited(base ** int(exponent))
