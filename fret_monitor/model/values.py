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

"""The types of values, and one table of facts about them."""

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

    @classmethod
    def of_field(cls, name: str) -> 'ValueType':
        """Return the type of a ROS message field; `byte` and `char` are stored as uint8."""
        return cls('uint8' if name in ('byte', 'char') else name)

    @property
    def is_integer(self) -> bool:
        """Whether it is one of the eight integer types."""
        return 'int' in self.value

    @property
    def is_signed(self) -> bool:
        """Whether it is one of the four signed integer types."""
        return self.value.startswith('int')

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
        """Size in bytes, in C and in a serialized message."""
        return _FACTS[self].size

    @property
    def bits(self) -> int:
        """Size in bits."""
        return 8 * _FACTS[self].size

    @property
    def c_name(self) -> str:
        """Name of the type in C."""
        return _FACTS[self].c_name

    @property
    def typecode(self) -> str:
        """Type code of Python's `array` and `struct` for it."""
        return _FACTS[self].typecode

    @property
    def limits(self) -> tuple[int, int]:
        """Least and greatest value of an integer type; (0, 1) for bool."""
        if self is ValueType.BOOL:
            return 0, 1
        if self.is_signed:
            return -2 ** (self.bits - 1), 2 ** (self.bits - 1) - 1
        if self.is_integer:
            return 0, 2 ** self.bits - 1
        raise ValueError(f'{self.value} has no integer limits')


@dataclass(frozen=True)
class _Facts:
    size: int
    c_name: str
    typecode: str


_FACTS = {
    ValueType.BOOL: _Facts(1, 'bool', 'B'),
    ValueType.INT8: _Facts(1, 'int8_t', 'b'),
    ValueType.INT16: _Facts(2, 'int16_t', 'h'),
    ValueType.INT32: _Facts(4, 'int32_t', 'i'),
    ValueType.INT64: _Facts(8, 'int64_t', 'q'),
    ValueType.UINT8: _Facts(1, 'uint8_t', 'B'),
    ValueType.UINT16: _Facts(2, 'uint16_t', 'H'),
    ValueType.UINT32: _Facts(4, 'uint32_t', 'I'),
    ValueType.UINT64: _Facts(8, 'uint64_t', 'Q'),
    ValueType.FLOAT32: _Facts(4, 'float', 'f'),
    ValueType.FLOAT64: _Facts(8, 'double', 'd'),
}
