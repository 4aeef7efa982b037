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

C reads the fields (`csrc/fret_fields.h`). Only the text for a log line is made here.
"""

from importlib import import_module
from types import ModuleType
from typing import Any

from fret_monitor.model.manifest import ManifestInput

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
            f'message type {message_type} is not installed here: '
            f'install the package {package} (sudo apt install '
            f'ros-$ROS_DISTRO-{package.replace("_", "-")}) or source its workspace') from None


def _class_of(module: ModuleType, name: str) -> Any:
    """Return a class of a module; `X_FeedbackMessage` lies inside the class of the action X."""
    action, _, part = name.rpartition('_')
    if part == 'FeedbackMessage' and hasattr(module, action):
        return getattr(module, action).Impl.FeedbackMessage
    return getattr(module, name)


def why_unusable(item: ManifestInput, message: bytes, kind: Any) -> str:
    """Return why the field of an input cannot be used in a serialized message, for the log."""
    field = _path_text(item.path)
    try:
        value = deserialize_message(message, kind)
    except UNDECODABLE:
        return f'{field} cannot be read'
    for place, step in enumerate(item.path):
        if isinstance(step, str):
            value = getattr(value, step)
        elif step < len(value):
            value = value[step]
        else:
            array = _path_text(item.path[:place])
            which = 'the array' if place == len(item.path) - 1 else array
            size = f'{len(value)} element{"" if len(value) == 1 else "s"}'
            return f'{field} cannot be read ({which} has {size})'
    if item.reduction:
        return f'{item.reduction}({field}) has no value (the array is empty)'
    shown = repr(value)
    if len(shown) > _SHOWN:
        shown = shown[:_SHOWN] + '...'
    return f'{field} is {shown}, which is not among its values in the bundle'


def _path_text(path: tuple[str | int, ...]) -> str:
    return ''.join(f'[{step}]' if isinstance(step, int) else f'.{step}' for step in path)[1:]
