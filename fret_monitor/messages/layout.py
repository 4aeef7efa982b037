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

"""The fields of a ROS message, in the order in which they are serialized: frozen values."""


from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path

from fret_monitor.model.frozen import frozen


class ArrayKind(Enum):
    """Whether a field is an array, and what is known of its length."""

    NONE = 'none'
    FIXED = 'fixed'
    BOUNDED = 'bounded'
    UNBOUNDED = 'unbounded'


@dataclass(frozen=True)
class FieldType:
    """
    The type of a field.

    `base` is a scalar (`float32`, `byte`, `string`, `wstring` ...) or a message (`pkg/msg/Name`).
    `size` is the length of a fixed array or the greatest of a bounded one; `text_limit` the
    greatest length of a bounded string.
    """

    base: str
    array: ArrayKind = ArrayKind.NONE
    size: int | None = None
    text_limit: int | None = None

    @property
    def is_message(self) -> bool:
        """Whether the elements are messages themselves."""
        return '/' in self.base

    def __str__(self) -> str:
        """Return the type as a `.msg` file has it."""
        base = self.base if self.text_limit is None else f'{self.base}<={self.text_limit}'
        match self.array:
            case ArrayKind.NONE:
                return base
            case ArrayKind.FIXED:
                return f'{base}[{self.size}]'
            case ArrayKind.BOUNDED:
                return f'{base}[<={self.size}]'
            case ArrayKind.UNBOUNDED:
                return f'{base}[]'


@dataclass(frozen=True)
class MessageField:
    """A field; `default` is its value as written, None where there is none."""

    name: str
    type: FieldType
    default: str | None = None


@frozen
class MessageConstant:
    """A constant, with its value as written."""

    name: str
    type: FieldType
    value: str


@dataclass(frozen=True)
class MessageLayout:
    """
    A message: `name` is `pkg/msg/Name`; `fields` are in the order of their serialization.

    `text` is the definition; messages within it are looked up on `search_path`.
    """

    name: str
    fields: tuple[MessageField, ...]
    constants: tuple[MessageConstant, ...]
    text: str = field(repr=False)
    search_path: tuple[Path, ...] = field(default=(), repr=False, compare=False)

    def find_field(self, name: str) -> MessageField | None:
        """Return a field by its name."""
        return next((item for item in self.fields if item.name == name), None)
