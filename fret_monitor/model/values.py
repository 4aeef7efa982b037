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

"""The types of values, and one table of facts about them: size, limits, name in C."""

from dataclasses import dataclass
from enum import Enum


class ValueType(Enum):
    """The type of an input or of a term; the value is its name in ROS message definitions."""

    BOOL = 'bool'
    INT8 = 'int8'
    INT16 = 'int16'
    INT32 = 'int32'
    INT64 = 'int64'
    UINT8 = 'uint8'
    UINT16 = 'uint16'
    UINT32 = 'uint32'
    UINT64 = 'uint64'
    FLOAT32 = 'float32'
    FLOAT64 = 'float64'

    @property
    def is_integer(self) -> bool:
        """Whether it is one of the eight integer types."""
        return self in _INTEGERS

    @property
    def is_signed(self) -> bool:
        """Whether it is one of the four signed integer types."""
        return self in _INTEGERS and _INTEGERS[self][0] < 0

    @property
    def is_float(self) -> bool:
        """Whether it is float32 or float64."""
        return self in (ValueType.FLOAT32, ValueType.FLOAT64)

    @property
    def is_number(self) -> bool:
        """Whether it is any type but bool."""
        return self is not ValueType.BOOL

    @property
    def size(self) -> int:
        """Size in bytes, in C as in CDR."""
        return _FACTS[self].size

    @property
    def c_name(self) -> str:
        """Name of the C type that stores it."""
        return _FACTS[self].c_name

    @property
    def limits(self) -> tuple[int, int]:
        """Least and greatest value of an integer type; (0, 1) for bool, an error for floats."""
        if self is ValueType.BOOL:
            return 0, 1
        return _INTEGERS[self]


@dataclass(frozen=True)
class _Facts:
    size: int
    c_name: str


_FACTS = {
    ValueType.BOOL: _Facts(1, 'bool'),
    ValueType.INT8: _Facts(1, 'int8_t'),
    ValueType.INT16: _Facts(2, 'int16_t'),
    ValueType.INT32: _Facts(4, 'int32_t'),
    ValueType.INT64: _Facts(8, 'int64_t'),
    ValueType.UINT8: _Facts(1, 'uint8_t'),
    ValueType.UINT16: _Facts(2, 'uint16_t'),
    ValueType.UINT32: _Facts(4, 'uint32_t'),
    ValueType.UINT64: _Facts(8, 'uint64_t'),
    ValueType.FLOAT32: _Facts(4, 'float'),
    ValueType.FLOAT64: _Facts(8, 'double'),
}

_INTEGERS = {
    kind: (-2 ** (8 * size - 1), 2 ** (8 * size - 1) - 1) if facts.c_name.startswith('int')
    else (0, 2 ** (8 * size) - 1)
    for kind, facts in _FACTS.items() if (size := facts.size) and 'int' in facts.c_name
}
