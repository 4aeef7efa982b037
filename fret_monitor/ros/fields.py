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
From a message to stored inputs: the one place that knows how fields are reached.

Callbacks store, the evaluator steps. A reader is made once for a topic; code in C that reads the
same fields out of the serialized bytes can take its place (DESIGN 8).
"""

from collections.abc import Callable
from importlib import import_module
from operator import attrgetter, itemgetter
from typing import Any, Protocol

from fret_monitor.manifest import Manifest, ManifestInput, ManifestTopic, ValueType

from rclpy.serialization import deserialize_message


class MessageTypeError(Exception):
    """A message type that is not installed here."""


# RMWError is a RuntimeError; the others come from making Python objects of what was decoded
UNDECODABLE = (AssertionError, RuntimeError, SystemError, ValueError)


_SHOWN = 60  # characters of a string that is none of the values


class InputStore(Protocol):
    """What a reader writes to: the part of the evaluator that keeps values."""

    def store(self, index: int, value: bool | int | float) -> None:
        """Keep the value of an input."""

    def unusable(self, index: int) -> None:
        """Count a field that cannot be used."""

    def undecodable(self, index: int) -> None:
        """Count a message of a topic that cannot be decoded."""


class UnusableField(Exception):
    """A field whose value cannot be used: outside the array, or outside `values`."""


TellUnusable = Callable[[int, str], None]
"""Takes an input (index) whose field cannot be used for the first time, and why."""


class MessageReader:
    """Stores the inputs that one topic feeds, from its serialized messages."""

    def __init__(self, manifest: Manifest, topic: int,
                 tell: TellUnusable = lambda index, reason: None) -> None:
        """
        Prepare for a topic, given by its index in the manifest.

        `tell` is called once an input at most.

        Raises
        ------
        MessageTypeError
            if the topic's message type cannot be imported.
        """
        mapped: ManifestTopic = manifest.topics[topic]
        self.topic = topic
        self.message_class = message_class(mapped.message_type)
        self._fields = tuple(
            (index, field_reader(manifest.inputs[index])) for index in mapped.inputs)
        self._inputs = manifest.inputs
        self._tell = tell
        self._told: set[int] = set()

    def read(self, data: bytes, inputs: InputStore) -> bool:
        """
        Store all inputs that the message feeds.

        Returns whether it was a message: one that cannot be decoded is counted and is no step.
        """
        try:
            message = deserialize_message(data, self.message_class)
        except UNDECODABLE:
            inputs.undecodable(self.topic)
            return False
        for index, read in self._fields:
            try:
                value = read(message)
            except UnusableField:
                inputs.unusable(index)
                self._tell_once(index, message)
            else:
                inputs.store(index, value)
        return True

    def _tell_once(self, index: int, message: Any) -> None:
        if index not in self._told:
            self._told.add(index)
            self._tell(index, why_unusable(self._inputs[index], message))


def message_class(message_type: str) -> Any:
    """
    Import the class of a message type such as `std_msgs/msg/Float32`.

    Raises
    ------
    MessageTypeError
        if there is none.
    """
    package, folder, name = message_type.split('/')
    try:
        return getattr(import_module(f'{package}.{folder}'), name)
    except (ImportError, AttributeError):
        raise MessageTypeError(
            f'message type {message_type} is not installed here: '
            f'install the package {package} (sudo apt install '
            f'ros-$ROS_DISTRO-{package.replace("_", "-")}) or source its workspace') from None


def field_reader(item: ManifestInput) -> Callable[[Any], bool | int | float]:
    """
    Return the function from a message to the value of an input, as the evaluator stores it.

    The function raises `UnusableField`.
    """
    reach = _path_reader(item.path)
    convert = _converter(item)

    def read(message: Any) -> bool | int | float:
        try:
            return convert(reach(message))
        except (LookupError, ValueError):
            raise UnusableField from None

    return read


def why_unusable(item: ManifestInput, message: Any) -> str:
    """Return why the field of an input cannot be used in this message, for a person."""
    field = _path_text(item.path)
    value = message
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
    shown = repr(value)
    if len(shown) > _SHOWN:
        shown = shown[:_SHOWN] + '...'
    return f'{field} is {shown}, which is not among its values in the bundle'


def _path_text(path: tuple[str | int, ...]) -> str:
    return ''.join(f'[{step}]' if isinstance(step, int) else f'.{step}' for step in path)[1:]


def _path_reader(path: tuple[str | int, ...]) -> Callable[[Any], Any]:
    if all(isinstance(step, str) for step in path):
        return attrgetter('.'.join(str(step) for step in path))
    steps: list[Callable[[Any], Any]] = [
        itemgetter(step) if isinstance(step, int) else attrgetter(step) for step in path]

    def reach(message: Any) -> Any:
        for step in steps:
            message = step(message)
        return message

    return reach


def _converter(item: ManifestInput) -> Callable[[Any], bool | int | float]:
    if item.is_string:
        places = {value: place for place, (_, value) in enumerate(item.values)}
        return places.__getitem__
    if item.value_type is ValueType.BOOL:
        return bool
    return float if item.value_type.is_float else _integer


def _integer(value: Any) -> int:
    # A `byte` field comes as bytes of length one, an element of a fixed array as a numpy scalar.
    return value[0] if isinstance(value, bytes) else int(value)
