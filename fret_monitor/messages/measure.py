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

"""Measures serialized messages: how many of their bytes a layout accounts for."""

import struct

from fret_monitor.messages.installed import nested_layout
from fret_monitor.messages.layout import ArrayKind, FieldType, MessageLayout
from fret_monitor.model.values import ValueType

_HEADER_BYTES = 4


def measure(layout: MessageLayout, data: bytes) -> int | None:
    """
    Return the bytes of a message in CDR that its fields take, with the header.

    None if they do not fit into `data`, or if its header is not one of CDR. O(bytes).
    """
    if len(data) < _HEADER_BYTES or data[0] != 0 or data[1] > 1:
        return None
    walk = _Walk(data[_HEADER_BYTES:], '<I' if data[1] else '>I')
    try:
        walk.message(layout)
    except ValueError:
        return None
    return _HEADER_BYTES + walk.place


class _Walk:
    """Passes over the fields of a message; raises `ValueError` where it ends too early."""

    def __init__(self, data: bytes, length_format: str) -> None:
        self.place = 0
        self._data = data
        self._length_format = length_format

    def message(self, layout: MessageLayout) -> None:
        if not layout.fields:
            self._skip(1, 1)  # rosidl gives an empty struct a member
        for field in layout.fields:
            self._field(layout, field.type)

    def _field(self, layout: MessageLayout, kind: FieldType) -> None:
        match kind.array:
            case ArrayKind.NONE:
                count = 1
            case ArrayKind.FIXED:
                count = kind.size or 0
            case ArrayKind.BOUNDED | ArrayKind.UNBOUNDED:
                count = self._count()
        if kind.is_message:
            nested = nested_layout(layout, kind)
            for _ in range(count):
                self.message(nested)
        elif kind.base == 'string':
            for _ in range(count):
                self._skip(1, self._count())
        elif kind.base == 'wstring':
            for _ in range(count):
                self._elements(4, self._count())
        else:
            self._elements(ValueType.of_field(kind.base).size, count)

    def _elements(self, size: int, count: int) -> None:
        if count:  # of none, not even padding is there
            self._skip(size, size * count)

    def _count(self) -> int:
        self._skip(4, 4)
        return int(struct.unpack_from(self._length_format, self._data, self.place - 4)[0])

    def _skip(self, alignment: int, size: int) -> None:
        self.place += -self.place % alignment + size
        if self.place > len(self._data):
            raise ValueError('too short')
