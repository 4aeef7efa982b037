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
Read the inputs from a serialized message, with the compiled readers of a bundle.

The node reads messages in C; this module calls the same functions from Python.
"""

from dataclasses import dataclass
from enum import Enum

from fret_monitor.model.manifest import ManifestInput
from fret_monitor.model.policies import InputSource
from fret_monitor.model.values import ValueType
from fret_monitor.native.binding import ffi
from fret_monitor.native.monitor import CData, Monitor


class ReadOutcome(Enum):
    """The result of reading a field; the values are those of `enum fm_outcome`."""

    READ = 0
    OUTSIDE = 1
    UNNAMED = 2
    EMPTY = 3
    ABSENT = 4


@dataclass(frozen=True)
class FieldReading:
    """
    The result of reading a field: its value, as the evaluator stores it, or None.

    For an input that is an age, it is the stamp in nanoseconds.

    `length` is the length of the array if the index or name is not in it, or that of the string
    if it is not one of the input's `values`.
    """

    outcome: ReadOutcome
    value: bool | int | float | None
    length: int = 0


def read_fields(monitor: Monitor, topic: int, message: bytes) -> tuple[FieldReading, ...] | None:
    """
    Read the inputs of a topic from a message, in the manifest's order.

    `topic` is an index of the manifest's topics. Returns None if the message cannot be decoded.
    """
    readers = monitor.readers
    assert readers is not None, 'this bundle has no topics'
    inputs = monitor.manifest.topics[topic].inputs
    fields = ffi.new('struct fm_field[]', len(inputs))
    if not readers.topics[topic].read(ffi.from_buffer('uint8_t[]', message), len(message), fields):
        return None
    return tuple(part_reading(fields[place], monitor.manifest.inputs[index])
                 for place, index in enumerate(inputs))


def part_reading(field: CData, item: ManifestInput) -> FieldReading:
    """Return a `struct fm_field` of an input."""
    outcome, kind = ReadOutcome(field.outcome), item.value_type
    if outcome is not ReadOutcome.READ:
        return FieldReading(outcome, None, int(field.length))
    if kind is ValueType.BOOL:
        return FieldReading(outcome, bool(field.value.i))
    if item.source is InputSource.AGE:
        return FieldReading(outcome, int(field.value.i))
    if kind.is_float:
        return FieldReading(outcome, float(field.value.f))
    return FieldReading(outcome, int(field.value.i if kind.is_signed else field.value.u))
