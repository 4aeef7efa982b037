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

from decimal import Context, Decimal, ROUND_HALF_EVEN, ROUND_UP
from fractions import Fraction
from math import frexp, inf, isfinite, nextafter
import struct

_DIGITS = 9  # enough to distinguish any two float32


def to_float32(value: float | Fraction) -> float:
    """Round once to the nearest float32, ties to even; to infinity beyond the largest."""
    try:
        exact = _rounded_to_odd(value) if isinstance(value, Fraction) else value
        return float(struct.unpack('<f', struct.pack('<f', exact))[0])
    except OverflowError:
        return inf if value > 0 else -inf


def to_float64(value: float | Fraction) -> float:
    """Round once to the nearest float64, ties to even; to infinity beyond the largest."""
    try:
        return float(value)
    except OverflowError:
        return inf if value > 0 else -inf


def _rounded_to_odd(value: Fraction) -> float:
    """
    Round a fraction to odd: of the two adjacent float64, return the one whose last bit is 1.

    The result lies on the same side of each tie between two float32 as the fraction. The nearest
    float64 may not. Rounding the result to float32 therefore rounds the fraction correctly (Boldo
    and Melquiond, 'Emulation of a FMA and correctly rounded sums', IEEE Transactions on Computers
    57(4), 2008). A fraction that is a float64 is returned as it is.

    Raises
    ------
    OverflowError
        if the fraction is beyond the range of float64.
    """
    nearest = float(value)
    exact = Fraction(nearest)
    is_odd = struct.unpack('<Q', struct.pack('<d', nearest))[0] & 1
    if exact == value or is_odd:
        return nearest
    return nextafter(nearest, inf if value > exact else -inf)


def shortest_float32(value: float) -> str:
    """
    Return the shortest decimal that rounds to the same float32, spelled as Python spells floats.

    Of several decimals of that length it is the one nearest to the float32.
    """
    value = to_float32(value)
    if value == 0 or not isfinite(value):
        return repr(value)
    # Below a power of two, float32 are closer together than above it. The nearest decimal to the
    # power may therefore round to the float32 below it, while the next decimal away from zero
    # rounds to the power.
    is_power = abs(frexp(value)[0]) == 0.5
    roundings = (ROUND_HALF_EVEN, ROUND_UP) if is_power else (ROUND_HALF_EVEN,)
    candidates = (Context(digits, rounding).plus(Decimal(value))
                  for digits in range(1, _DIGITS + 1) for rounding in roundings)
    return next(repr(float(decimal)) for decimal in candidates
                if to_float32(Fraction(decimal)) == value)
