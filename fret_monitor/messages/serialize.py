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
Serializes a message: from the values of its fields to CDR (XCDR version 1, little endian).

It needs no ROS, only the layout of the message. `fret_cdr.h` describes the encoding.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
import re
import struct

from fret_monitor.messages.installed import nested_layout
from fret_monitor.messages.layout import ArrayKind, FieldType, MessageField, MessageLayout
from fret_monitor.model.payload import PartKind, PayloadPart
from fret_monitor.model.values import ValueType


@dataclass(frozen=True)
class KeyedText:
    """A text with the key of an instance variable (index) between each two of its pieces."""

    pieces: tuple[str, ...]
    keys: tuple[int, ...]


@dataclass(frozen=True)
class KeyedNumber:
    """The key of an instance variable (index), which is a whole number."""

    key: int


type Value = (bool | int | float | str | KeyedText | KeyedNumber | Sequence[Value]
              | Mapping[str, Value])

HEADER_TYPE = 'std_msgs/msg/Header'
STAMP_AT = 4
"""The offset of the stamp in a message that begins with a header: sec and nanosec."""

_MOST_ALIGNED = 8
_ENCAPSULATION = b'\x00\x01\x00\x00'
_ELEMENT = re.compile(
    r'\s*("(?:\\.|[^"\\])*"' r"|'(?:\\.|[^'\\])*'|[^,]*?)\s*(?:,|$)")


def serialize(layout: MessageLayout, values: Mapping[str, Value]) -> bytes:
    """
    Return a serialized message; a field without a value has the default of its definition.

    The values fit the fields: whole numbers are within the range of their type, fixed arrays have
    their length. The messages within it are installed.
    """
    return serialize_keyed(layout, values)[0]


def serialize_keyed(layout: MessageLayout, values: Mapping[str, Value]
                    ) -> tuple[bytes, tuple[PayloadPart, ...]]:
    """Do the same; with keys, the bytes are those of the parts, which come second."""
    writer = _CdrWriter()
    writer.message(layout, values)
    return bytes(writer.data), writer.finished_parts()


def has_stamp(layout: MessageLayout) -> bool:
    """Whether a message begins with a header, so that its stamp is at `STAMP_AT`."""
    return bool(layout.fields) and str(layout.fields[0].type) == HEADER_TYPE


class _CdrWriter:
    """
    Appends values, each aligned to its size.

    After a key, where a value lies is known only modulo the greatest alignment since then: a
    greater one begins a part.
    """

    def __init__(self) -> None:
        self.data = bytearray(_ENCAPSULATION)
        self._parts: list[PayloadPart] = []
        self._begin = len(self.data)
        self._align = 1  # of the part that begins there
        self._known, self._at = _MOST_ALIGNED, 0  # the place, modulo what is known

    def finished_parts(self) -> tuple[PayloadPart, ...]:
        """Return the parts, if there are keys."""
        if self._parts:
            self._end_part()
        return tuple(self._parts)

    def _end_part(self) -> None:
        size = len(self.data) - self._begin
        if size > 0:
            self._parts.append(PayloadPart(PartKind.BYTES, self._align, self._begin, size))
        self._begin, self._align = len(self.data), 1

    def _append(self, data: bytes) -> None:
        self.data += data
        self._at = (self._at + len(data)) % self._known

    def _align_to(self, size: int) -> None:
        if size > self._known:
            self._end_part()
            self._align = self._known = size
            self._at = 0
        else:
            self._append(bytes(-self._at % size))

    def message(self, layout: MessageLayout, values: Mapping[str, Value]) -> None:
        if not layout.fields:
            self._number('uint8', 0)  # rosidl gives an empty struct this member
        for field in layout.fields:
            self._field(layout, field, values.get(field.name, default_of(field)))

    def _field(self, layout: MessageLayout, field: MessageField, value: Value | None) -> None:
        kind = field.type
        if kind.array is ArrayKind.NONE:
            self._element(layout, kind, value)
            return
        elements: Sequence[Value | None] = value if isinstance(value, Sequence) else ()
        if kind.array is ArrayKind.FIXED:
            elements = elements or [None] * (kind.size or 0)
        else:
            self._number('uint32', len(elements))
        for item in elements:
            self._element(layout, kind, item)

    def _element(self, layout: MessageLayout, kind: FieldType, value: Value | None) -> None:
        if kind.is_message:
            self.message(nested_layout(layout, kind), value if isinstance(value, Mapping) else {})
        elif isinstance(value, KeyedText):
            self._keyed(value)
        elif isinstance(value, KeyedNumber):
            self._keyed_number(ValueType.of_field(kind.base).size, value)
        elif kind.base == 'string':
            text = str(value or '').encode() + b'\0'
            self._number('uint32', len(text))
            self._append(text)
        elif kind.base == 'wstring':
            units = str(value or '').encode('utf-16-le')
            self._number('uint32', len(units) // 2)
            for unit, in struct.iter_unpack('<H', units):
                self._number('uint32', unit)
        else:
            self._number(kind.base, value if isinstance(value, int | float) else 0)

    def _keyed(self, text: KeyedText) -> None:
        first, *others = (piece.encode() for piece in text.pieces)
        size = len(first) + sum(map(len, others)) + 1
        self._end_part()
        self._parts.append(PayloadPart(PartKind.LENGTH, size=size, keys=text.keys))
        self._append(first)
        for key, piece in zip(text.keys, others, strict=True):
            self._end_part()
            self._parts.append(PayloadPart(PartKind.KEY, keys=(key,)))
            self._append(piece)
        self._append(b'\0')
        self._known, self._at = 1, 0

    def _keyed_number(self, size: int, number: KeyedNumber) -> None:
        self._end_part()
        self._parts.append(PayloadPart(
            PartKind.NUMBER, align=size, size=size, keys=(number.key,)))
        self._at = 0 if size > self._known else self._at + -self._at % size
        self._known = max(self._known, size)
        self._at = (self._at + size) % self._known

    def _number(self, base: str, value: int | float) -> None:
        kind = ValueType.of_field(base)
        self._align_to(kind.size)
        self._append(struct.pack(f'<{kind.typecode}', value))


def default_of(field: MessageField) -> Value | None:
    """Return the default value in a definition; None if it has none."""
    text = field.default
    if text is None or field.type.is_message:
        return None
    if field.type.array is ArrayKind.NONE:
        return _literal(field.type.base, text)
    return [_literal(field.type.base, item) for item in _elements(text.strip('[]'))]


def _elements(text: str) -> Iterator[str]:
    end = 0
    while end < len(text) and (match := _ELEMENT.match(text, end)):
        yield match[1]
        end = match.end()


def _literal(base: str, text: str) -> Value:
    if base in ('string', 'wstring'):
        quote = text[0] if len(text) > 1 and text[0] == text[-1] and text[0] in '"\'' else ''
        return text[1:-1].replace(f'\\{quote}', quote) if quote else text
    if base == 'bool':
        return text.lower() in ('true', '1')
    return float(text) if base.startswith('float') else int(text, 0)
