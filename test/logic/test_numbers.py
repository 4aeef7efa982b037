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
"""Literals are exact, and are rounded once."""

from fractions import Fraction
import math
import time

from fret_monitor.logic.formula import BinaryOperator, Constant
from fret_monitor.logic.numbers import (
    absolute, constant, ExactNumber, fold, LIMIT_BITS, negated, NumberError, parse_number, stored,
)
from fret_monitor.model.values import ValueType
from hypothesis import given
from hypothesis import strategies as st
import pytest

MAX32 = Fraction(2 ** 24 - 1) * 2 ** 104
MAX64 = Fraction(2 ** 53 - 1) * 2 ** 971


def whole(value: int) -> ExactNumber:
    """Return the literal of a whole number."""
    return ExactNumber(Fraction(value), False)


@pytest.mark.parametrize(('text', 'value', 'is_real'), [
    ('15', Fraction(15), False),
    ('007', Fraction(7), False),
    ('15.0', Fraction(15), True),
    ('15.', Fraction(15), True),
    ('.5', Fraction(1, 2), True),
    ('1e3', Fraction(1000), True),
    ('1E+3', Fraction(1000), True),
    ('3.5e-2', Fraction(35, 1000), True),
    ('0.1', Fraction(1, 10), True),
    ('-3', Fraction(-3), False),
    ('+3', Fraction(3), False),
    ('0e999999999999', Fraction(0), True),
    ('1.' + '0' * 5000, Fraction(1), True),
    ('0' * 5000 + '1', Fraction(1), False),
])
def test_a_number_is_read_exactly(text: str, value: Fraction, is_real: bool) -> None:
    assert parse_number(text) == ExactNumber(value, is_real)


@pytest.mark.parametrize('text', [
    '', '.', 'e3', '1e', '1.5.2', '0x10', '1_000', 'nan', 'inf', '1 2', '--1', '\u0661', '1e3.5'])
def test_what_is_no_number_is_refused(text: str) -> None:
    with pytest.raises(NumberError, match='not a number'):
        parse_number(text)


@pytest.mark.parametrize('text', [
    '1e999999999', '1e-999999999', '9' * 100_000, '0.' + '0' * 100_000 + '1', '1e1300', '1e-1300',
    '1' + '0' * 200 + 'e' + '9' * 5000])
def test_a_huge_number_is_refused_and_costs_nothing(text: str) -> None:
    begin = time.monotonic()
    with pytest.raises(NumberError, match='needs more than 4,096 bits'):
        parse_number(text)
    assert time.monotonic() - begin < 0.2


def test_only_the_real_zero_has_a_sign() -> None:
    assert math.copysign(1, float(stored(parse_number('-0.0'), ValueType.FLOAT64))) == -1
    assert math.copysign(1, float(stored(parse_number('-0'), ValueType.FLOAT64))) == 1
    assert math.copysign(1, float(stored(parse_number('-0e5'), ValueType.FLOAT32))) == -1
    assert negated(negated(parse_number('0.0'))) == parse_number('0.0')
    assert absolute(parse_number('-0.0')) == parse_number('0.0')


@pytest.mark.parametrize(('kind', 'greatest', 'half_step'), [
    (ValueType.FLOAT32, MAX32, Fraction(2) ** 103),
    (ValueType.FLOAT64, MAX64, Fraction(2) ** 970),
])
def test_what_rounds_to_infinity_is_refused(
        kind: ValueType, greatest: Fraction, half_step: Fraction) -> None:
    assert stored(ExactNumber(greatest, True), kind) == greatest
    assert stored(ExactNumber(greatest + half_step - 1, True), kind) == greatest
    for sign in (1, -1):
        for value in (greatest + half_step, Fraction(2) ** 4000):
            with pytest.raises(NumberError, match=f'too large for {kind.value}'):
                stored(ExactNumber(sign * value, True), kind)


@pytest.mark.parametrize('kind', [kind for kind in ValueType if kind.is_integer])
def test_a_whole_number_is_kept_within_its_type(kind: ValueType) -> None:
    low, high = kind.limits
    assert (high - low + 1).bit_length() - 1 == int(kind.value.lstrip('uint'))
    assert (low == 0) == kind.value.startswith('u')
    for value in (low, high):
        assert stored(whole(value), kind) == value
    for value in (low - 1, high + 1):
        with pytest.raises(NumberError, match=f'not between {low} and {high}'):
            stored(whole(value), kind)


def test_a_fraction_is_no_integer() -> None:
    with pytest.raises(NumberError, match='not a whole number'):
        constant(parse_number('1.5'), ValueType.INT64)
    assert constant(parse_number('2.0'), ValueType.INT64) == Constant(2, ValueType.INT64)


SMALL = st.builds(
    ExactNumber, st.fractions(min_value=-50, max_value=50, max_denominator=20), st.just(True)
) | st.builds(whole, st.integers(-50, 50))


@given(SMALL, SMALL)
def test_arithmetic_of_literals_is_exact(left: ExactNumber, right: ExactNumber) -> None:
    a, b = left.value, right.value
    is_real = left.is_real or right.is_real
    assert fold(BinaryOperator.ADD, left, right) == ExactNumber(a + b, is_real)
    assert fold(BinaryOperator.SUB, left, right) == ExactNumber(a - b, is_real)
    assert fold(BinaryOperator.MUL, left, right) == ExactNumber(a * b, is_real)
    assert fold(BinaryOperator.MIN, left, right) == ExactNumber(min(a, b), is_real)
    assert fold(BinaryOperator.MAX, left, right) == ExactNumber(max(a, b), is_real)
    if b and is_real:
        assert fold(BinaryOperator.DIV, left, right) == ExactNumber(a / b, True)
        assert float(fold(BinaryOperator.MOD, left, right).value) == pytest.approx(
            float(a - b * math.trunc(a / b)))


@pytest.mark.parametrize(('a', 'b', 'quotient', 'rest'), [
    (7, 2, 3, 1), (-7, 2, -3, -1), (7, -2, -3, 1), (-7, -2, 3, -1), (7, 0, 0, 0), (0, 0, 0, 0)])
def test_whole_literals_divide_as_integers_do(a: int, b: int, quotient: int, rest: int) -> None:
    assert fold(BinaryOperator.DIV, whole(a), whole(b)) == whole(quotient)
    assert fold(BinaryOperator.MOD, whole(a), whole(b)) == whole(rest)


def test_a_real_literal_is_not_divided_by_zero() -> None:
    for operator in (BinaryOperator.DIV, BinaryOperator.MOD):
        with pytest.raises(NumberError, match='division by zero'):
            fold(operator, parse_number('1.0'), whole(0))
    with pytest.raises(NumberError, match='division by zero'):
        fold(BinaryOperator.POW, parse_number('0.0'), whole(-1))


def test_powers_of_literals_are_exact() -> None:
    assert fold(BinaryOperator.POW, whole(3), whole(4)) == whole(81)
    assert fold(BinaryOperator.POW, whole(0), whole(0)) == whole(1)
    assert fold(BinaryOperator.POW, parse_number('2.0'), whole(-2)).value == Fraction(1, 4)
    huge = 10 ** 300
    assert fold(BinaryOperator.POW, whole(-1), whole(huge + 1)) == whole(-1)
    assert fold(BinaryOperator.POW, whole(-1), whole(huge)) == whole(1)
    assert fold(BinaryOperator.POW, whole(1), whole(huge)) == whole(1)
    assert fold(BinaryOperator.POW, whole(0), whole(huge)) == whole(0)


@pytest.mark.parametrize(('base', 'exponent'), [
    ('2', '4096'), ('2', '9999999999'), ('1.0000001', '99999'), ('0.5', '99999999999'),
    ('10', '1234'), ('3.0', '-99999999')])
def test_a_huge_power_is_refused_and_costs_nothing(base: str, exponent: str) -> None:
    begin = time.monotonic()
    with pytest.raises(NumberError, match='bits'):
        fold(BinaryOperator.POW, parse_number(base), parse_number(exponent))
    assert time.monotonic() - begin < 0.2


def test_sums_and_products_of_literals_stay_within_the_limit() -> None:
    big = whole(2 ** (LIMIT_BITS - 1))
    assert fold(BinaryOperator.SUB, big, whole(1)).value == 2 ** (LIMIT_BITS - 1) - 1
    with pytest.raises(NumberError, match='bits'):
        fold(BinaryOperator.ADD, big, big)
    with pytest.raises(NumberError, match='bits'):
        fold(BinaryOperator.MUL, big, whole(4))


def test_a_literal_is_shown_as_a_person_writes_it() -> None:
    assert str(parse_number('15')) == '15'
    assert str(parse_number('0.25')) == '0.25'
    assert str(parse_number('1e1200')) == 'a huge number'
