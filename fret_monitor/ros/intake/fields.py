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

"""Message classes of rclpy, by their names."""

from importlib import import_module
from types import ModuleType
from typing import Any

from fret_monitor.model.packages import how_to_install
from fret_monitor.ros.settings.parameters import Refusal

# What rclpy raises for bytes that are not a message.
UNDECODABLE = (AssertionError, RuntimeError, SystemError, ValueError)


class MessageTypeError(Refusal):
    """A message type that is not installed here."""


def message_class(message_type: str) -> Any:
    """
    Import the class of a message type such as `std_msgs/msg/Float32`.

    Raises `MessageTypeError` if it is not installed.
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
