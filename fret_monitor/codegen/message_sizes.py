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
How many bytes of a serialized message can be skipped at once.

Numbers are aligned to their size, counted from the beginning of the message, so that the padding
before a field depends on the fields before it. Except for this padding, a message without strings
and sequences has a fixed size.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from fret_monitor.messages.installed import nested_layout
from fret_monitor.messages.layout import ArrayKind, FieldType, MessageLayout
from fret_monitor.model.values import ValueType

STRINGS = ('string', 'wstring')


@dataclass(frozen=True)
class ByteRun:
    """Bytes that are skipped at once: `size`, after padding to a multiple of `alignment`."""

    alignment: int
    size: int


def _round_up(number: int, alignment: int) -> int:
    return (number + alignment - 1) // alignment * alignment


def joined(runs: Iterable[ByteRun]) -> tuple[ByteRun, ...]:
    """Merge consecutive runs into as few as possible."""
    found: list[ByteRun] = []
    for run in runs:
        if found and run.alignment <= found[-1].alignment:
            last = found.pop()
            run = ByteRun(last.alignment, _round_up(last.size, run.alignment) + run.size)
        found.append(run)
    return tuple(found)


def stride(runs: Sequence[ByteRun]) -> int:
    """
    Return the bytes from the end of one element to the end of the next, padding included.

    It is the same for all elements after the first: the alignments of joined runs ascend, so that
    the padding within an element depends only on the largest alignment.
    """
    begin = runs[-1].size % runs[-1].alignment
    end = begin
    for run in runs:
        end = _round_up(end, run.alignment) + run.size
    return end - begin


def repeated(runs: Sequence[ByteRun], count: int) -> tuple[ByteRun, ...]:
    """Return the runs of `count` elements."""
    if not count:
        return ()
    return joined([*runs, ByteRun(1, (count - 1) * stride(runs))])


class Sizes:
    """The sizes of messages, fields and elements that do not depend on their content."""

    def __init__(self) -> None:
        """Start with an empty cache of message sizes."""
        self._known: dict[str, tuple[ByteRun, ...] | None] = {}

    def of_message(self, layout: MessageLayout) -> tuple[ByteRun, ...] | None:
        """Return the runs of a message; None if its size depends on its content."""
        if layout.name not in self._known:
            self._known[layout.name] = self._measure(layout)
        return self._known[layout.name]

    def of_field(self, layout: MessageLayout, kind: FieldType) -> tuple[ByteRun, ...] | None:
        """Return the runs of a field; None if its size depends on its content."""
        element = self.of_element(layout, kind)
        match kind.array:
            case ArrayKind.NONE:
                return element
            case ArrayKind.FIXED:
                return None if element is None else repeated(element, kind.size or 0)
            case ArrayKind.BOUNDED | ArrayKind.UNBOUNDED:
                return None

    def of_element(self, layout: MessageLayout, kind: FieldType) -> tuple[ByteRun, ...] | None:
        """Return the runs of one element of a field; None if its size depends on its content."""
        if kind.base in STRINGS:
            return None
        if kind.is_message:
            return self.of_message(nested_layout(layout, kind))
        size = ValueType.of_field(kind.base).size
        return (ByteRun(size, size),)

    def _measure(self, layout: MessageLayout) -> tuple[ByteRun, ...] | None:
        if not layout.fields:
            return (ByteRun(1, 1),)  # a message without fields is serialized as one byte
        found: list[ByteRun] = []
        for item in layout.fields:
            runs = self.of_field(layout, item.type)
            if runs is None:
                return None
            found.extend(runs)
        return joined(found)
