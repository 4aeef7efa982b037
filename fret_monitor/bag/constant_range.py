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
The values that a constant can have, in their order: as keys, whole numbers without a gap.

A key and the next one are neighbours: of reals all floats of a type in their order, of whole
numbers themselves. A search in keys is exact to the last bit.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from fractions import Fraction
import struct

from fret_monitor.elaboration.durations import MAX_BOUND
from fret_monitor.logic.formula import Constant, Formula, postorder
from fret_monitor.model.floats import shortest_float32
from fret_monitor.model.values import ValueType

_SPREAD = 12  # powers of ten that are tried first


@dataclass(frozen=True)
class ConstantRange:
    """
    The values of a constant: keys from `least` to `most`.

    `text` writes the value of a key, as in a bundle; `key` is that of the nearest value.
    """

    what: str
    least: int
    most: int
    text: Callable[[int], str]
    key: Callable[[Fraction], int]

    def first(self, current: Fraction) -> list[int]:
        """Return keys to begin with: around the present value, and powers of ten."""
        powers = [Fraction(10) ** power for power in range(-_SPREAD, _SPREAD + 1, 3)]
        values = [Fraction(0), current, *powers, *(-power for power in powers)]
        keys = {self.least, self.most, self.key(current) - 1, self.key(current) + 1,
                *map(self.key, values)}
        return sorted(key for key in keys if self.least <= key <= self.most)

    def between(self, low: int, high: int, count: int) -> list[int]:
        """Return at most `count` keys between two keys, evenly spaced."""
        inside = range(low + 1, high)
        if len(inside) <= count:
            return list(inside)
        return sorted({low + (high - low) * place // (count + 1) for place in range(1, count + 1)})


def _float_range(what: str, size: str, unsigned: str,
                 text: Callable[[float], str]) -> ConstantRange:
    sign = 1 << (8 * struct.calcsize(size) - 1)

    def key_of(value: float) -> int:
        bits: int = struct.unpack(unsigned, struct.pack(size, value))[0]
        return sign - bits if bits & sign else bits

    def value_of(key: int) -> float:
        bits = key if key >= 0 else sign - key
        found: float = struct.unpack(size, struct.pack(unsigned, bits))[0]
        return found

    most = key_of(struct.unpack(size, struct.pack(unsigned, _GREATEST[size]))[0])

    def key(value: Fraction) -> int:
        try:
            return min(most, max(-most, key_of(float(value))))
        except OverflowError:
            return most if value > 0 else -most

    return ConstantRange(what, -most, most, lambda found: text(value_of(found)), key)


_GREATEST = {'<d': 0x7fef_ffff_ffff_ffff, '<f': 0x7f7f_ffff}


def _real(text: str) -> str:
    """Return the text of a real number, which a whole one would not be."""
    return text if any(sign in text for sign in '.e') else f'{text}.0'


DOUBLES = _float_range('float64', '<d', '<Q', lambda value: _real(repr(value)))
SINGLES = _float_range('float32', '<f', '<I', lambda value: _real(shortest_float32(value)))
WHOLE = ConstantRange('int64', -2 ** 63, 2 ** 63 - 1, str, round)
BOUNDS = ConstantRange('a number of steps or units', 0, MAX_BOUND, str, round)


def range_of(one: Iterable[Formula], other: Iterable[Formula], *, is_whole: bool) -> ConstantRange:
    """
    Return the range of a constant, from formulas with two values of it.

    `is_whole`: it is written as a whole number. Its type is that of the numbers that differ; where
    none does, it is in the bounds of windows.
    """
    sets = [{node for node in postorder(tuple(roots)) if isinstance(node, Constant)}
            for roots in (one, other)]
    types = {node.type for node in sets[0] ^ sets[1]}
    if not types and is_whole:
        return BOUNDS
    if types == {ValueType.FLOAT32}:
        return SINGLES
    return WHOLE if is_whole and not any(item.is_float for item in types) else DOUBLES
