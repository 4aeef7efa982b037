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

"""Rounding to float32 and float64, and the shortest text of a float32."""

import ctypes
from decimal import Context, Decimal, ROUND_CEILING, ROUND_FLOOR
from fractions import Fraction
import math
import struct

from fret_monitor.model.floats import shortest_float32, to_float32, to_float64
from hypothesis import example, given
from hypothesis import strategies as st
import pytest

MAX32 = Fraction(2 ** 24 - 1) * 2 ** 104
MAX64 = Fraction(2 ** 53 - 1) * 2 ** 971
LARGEST = 0x7f7fffff  # the bits of the largest finite float32


def bits32(value: float) -> int:
    """Return the float32 of exactly this value, as its bits."""
    single = struct.pack('<f', value)
    assert struct.unpack('<f', single)[0] == value or math.isnan(value)
    return int(struct.unpack('<I', single)[0])


def float32_of(bits: int) -> float:
    """Return the float32 with these bits."""
    return float(struct.unpack('<f', struct.pack('<I', bits))[0])


@given(st.fractions())
@example(Fraction(1, 10))
@example(Fraction(2 ** 53 + 1))
@example(Fraction(1, 2 ** 1075))
@example(Fraction(1, 2 ** 1074))
@example(Fraction(3, 2 ** 1075))
@example(-Fraction(1, 2 ** 1080))
@example(Fraction(2 ** 53 - 1, 2 ** 1075))
@example(MAX64)
def test_rounding_to_float64_is_that_of_python(value: Fraction) -> None:
    assert struct.pack('<d', to_float64(value)) == struct.pack('<d', float(value))


@given(st.integers(0, 0x7f7fffff))
@example(0)
@example(1)
@example(0x007fffff)
@example(0x00800000)
@example(0x3f800000)
@example(0x7f7ffffe)
def test_rounding_to_float32_goes_to_the_nearest_and_from_a_tie_to_even(bits: int) -> None:
    low = Fraction(float32_of(bits))
    high = Fraction(float32_of(bits + 1)) if bits + 1 < 0x7f800000 else Fraction(2) ** 128
    middle = (low + high) / 2
    speck = Fraction(1, 2 ** 400)
    assert bits32(to_float32(low)) == bits
    assert bits32(to_float32(middle - speck)) == bits
    if bits + 1 < 0x7f800000:
        assert bits32(to_float32(middle)) == bits + bits % 2
        assert bits32(to_float32(middle + speck)) == bits + 1
        assert bits32(to_float32(-middle - speck)) == bits + 1 + 2 ** 31


def test_float32_is_not_reached_by_way_of_float64() -> None:
    # Just above a tie of float32, and nearer to the tie than float64 can tell.
    value = Fraction(1) + Fraction(1, 2 ** 24) + Fraction(1, 2 ** 60)
    twice = ctypes.c_float(float(value)).value
    assert to_float32(value) == 1 + 2 ** -23
    assert twice == 1.0


@pytest.mark.parametrize(('greatest', 'half_step'), [
    (MAX32, Fraction(2) ** 103), (MAX64, Fraction(2) ** 970),
])
def test_what_is_too_large_rounds_to_an_infinity_of_its_sign(
        greatest: Fraction, half_step: Fraction) -> None:
    round_it = to_float32 if greatest == MAX32 else to_float64
    for sign in (1, -1):
        assert round_it(sign * (greatest + half_step - Fraction(1, 10 ** 50))) == sign * greatest
        assert round_it(sign * (greatest + half_step)) == sign * math.inf
        assert round_it(sign * Fraction(2) ** 4000) == sign * math.inf
    assert to_float32(sign * 1e300) == sign * math.inf


def test_what_is_too_small_rounds_to_a_zero_of_its_sign() -> None:
    for round_it in (to_float32, to_float64):
        for sign in (1, -1):
            tiny = round_it(sign * Fraction(1, 2 ** 2000))
            assert tiny == 0
            assert math.copysign(1, tiny) == sign


@given(st.floats())
def test_rounding_a_float_to_float32_is_that_of_c(value: float) -> None:
    assert struct.pack('<d', to_float32(value)) == struct.pack('<d', ctypes.c_float(value).value)


@given(st.integers(0, LARGEST), st.sampled_from([1, -1]))
@example(1, 1)
@example(0x007fffff, -1)
@example(0x00800000, 1)
@example(LARGEST, 1)
def test_the_shortest_text_reads_back_and_no_shorter_text_does(bits: int, sign: int) -> None:
    value = sign * float32_of(bits)
    text = shortest_float32(value)
    assert to_float32(Fraction(text)) == value
    assert text == repr(float(text))
    for digits in range(1, sum(map(str.isdigit, text.partition('e')[0].strip('-0.')))):
        for rounding in (ROUND_FLOOR, ROUND_CEILING):
            shorter = Context(digits, rounding).plus(Decimal(value))
            assert to_float32(Fraction(shorter)) != value


@pytest.mark.parametrize(('value', 'text'), [
    (20.0, '20.0'), (-0.1, '-0.1'), (2.0 ** -149, '1e-45'), (float(MAX32), '3.4028235e+38'),
    (2.0 ** 87, '1.5474251e+26'), (16777216.0, '16777216.0'), (1e16, '1e+16'),
    (0.0, '0.0'), (-0.0, '-0.0'), (math.inf, 'inf'), (-math.inf, '-inf'), (math.nan, 'nan'),
])
def test_the_text_of_a_float32_looks_like_a_float_of_python(value: float, text: str) -> None:
    assert shortest_float32(to_float32(value)) == text
