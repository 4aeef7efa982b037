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
Message classes of rclpy, and the reason why a field of a message cannot be used.

C reads the fields (`fret_fields.h`). Only the text for a log line is made here.
"""

from importlib import import_module
from operator import attrgetter
from types import ModuleType
from typing import Any

from fret_monitor.model.manifest import ManifestInput
from fret_monitor.model.packages import how_to_install
from fret_monitor.model.paths import LookUp, path_text, Sector, Slice

from rclpy.serialization import deserialize_message

# What rclpy raises for bytes that are not a message.
UNDECODABLE = (AssertionError, RuntimeError, SystemError, ValueError)

_SHOWN = 60  # characters of a value in a log line


class MessageTypeError(Exception):
    """A message type that is not installed here."""


def message_class(message_type: str) -> Any:
    """
    Import the class of a message type such as `std_msgs/msg/Float32`.

    Raises
    ------
    MessageTypeError
        if it is not installed.
    """
    package, folder, name = message_type.split('/')
    try:
        return _class_of(import_module(f'{package}.{folder}'), name)
    except (ImportError, AttributeError):
        raise MessageTypeError(
            f"message type {message_type} of the package '{package}' is not installed here: "
            f'{how_to_install(package)}') from None


def _class_of(module: ModuleType, name: str) -> Any:
    """Return a class of a module; `X_FeedbackMessage` lies inside the class of the action X."""
    action, _, part = name.rpartition('_')
    if part == 'FeedbackMessage' and hasattr(module, action):
        return getattr(module, action).Impl.FeedbackMessage
    return getattr(module, name)


def why_unusable(item: ManifestInput, message: bytes, kind: Any) -> str:
    """Return why the field of an input cannot be used in a serialized message, for the log."""
    field = path_text(item.path)
    try:
        value = deserialize_message(message, kind)
    except UNDECODABLE:
        return f'{field} cannot be read'
    beside = value
    for place, step in enumerate(item.path):
        if isinstance(step, str):
            beside, value = value, getattr(value, step)
            continue
        array = path_text(item.path[:place])
        which = 'the array' if place == len(item.path) - 1 else array
        size = f'{which} has {len(value)} element{"" if len(value) == 1 else "s"}'
        if isinstance(step, Sector):
            return f'{item.reduction}({field}) has no value ({_of_sector(beside)})'
        if isinstance(step, Slice):
            if not _lies_within(step, len(value)):
                return f'{item.reduction}({field}) cannot be read ({size})'
            value = value[step.start:step.stop]
        else:
            index = _index_of(step, beside, value) if isinstance(step, LookUp) else step
            if index is None:
                return f'{field} cannot be read ({array} has no element of this name)'
            if index >= len(value):
                return f'{field} cannot be read ({size})'
            value = value[index]
    if item.reduction:
        part = 'slice' if isinstance(item.path[-1], Slice) else 'array'
        return f'{item.reduction}({field}) has no value (the {part} is empty)'
    shown = repr(value)
    if len(shown) > _SHOWN:
        shown = shown[:_SHOWN] + '...'
    return f'{field} is {shown}, which is not among its values in the bundle'


def _lies_within(part: Slice, size: int) -> bool:
    """Whether a slice is one of an array of `size` elements."""
    start, stop = part.start or 0, size if part.stop is None else part.stop
    return 0 <= start + size * (start < 0) <= stop + size * (stop < 0) <= size


def _index_of(part: LookUp, beside: Any, array: Any) -> int | None:
    """Return the index of a name in the array beside another, or among an array's elements."""
    names = getattr(beside, part.key[0]) if part.is_parallel \
        else (attrgetter('.'.join(part.key))(element) for element in array)
    return next((index for index, name in enumerate(names) if name == part.name), None)


def _of_sector(scan: Any) -> str:
    return 'no element is in the sector: angle_min is ' \
        f'{scan.angle_min:g}, angle_increment is {scan.angle_increment:g}'
