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

"""The steps of a path into a message: fields, elements, and parts of arrays."""

import re
from typing import TypeAlias

from fret_monitor.model.frozen import frozen

_BARE = re.compile(r'[A-Za-z0-9_./~:+-]+')


@frozen
class Slice:
    """
    The elements from `start` to before `stop`; None for the first, and for the end.

    A negative number counts from the end. Both must lie in the array; they are not clipped.
    """

    start: int | None
    stop: int | None

    def __str__(self) -> str:
        start, stop = ('' if end is None else end for end in (self.start, self.stop))
        return f'{start}:{stop}'


@frozen
class Sector:
    """
    The elements of a scan from the angle `first` through `width`, counter-clockwise, in radians.

    `written` is the sector as the user wrote it.
    """

    first: float
    width: float
    written: str

    def __str__(self) -> str:
        return self.written


@frozen
class LookUp:
    """
    The first element of an array of which the field `key` is the string `name`.

    With `is_parallel`, `key` is an array of strings beside the array, else a field of the element.
    With `variable`, the name is the key of that instance variable.
    """

    key: tuple[str, ...]
    name: str
    is_parallel: bool = False
    variable: str = ''

    def __str__(self) -> str:
        if self.variable:
            return f'{".".join(self.key)} = {{{self.variable}}}'
        return f'{".".join(self.key)} = {name_as_written(self.name)}'


ArrayPart: TypeAlias = int | Slice | Sector | LookUp
Step: TypeAlias = str | ArrayPart
FieldPath: TypeAlias = tuple[Step, ...]


def name_as_written(name: str) -> str:
    """Return a name as it is written in a look-up: in quotes if it needs them."""
    if _BARE.fullmatch(name):
        return name
    escaped = name.replace('\\', '\\\\').replace('"', '\\"')
    return f'"{escaped}"'


def path_text(path: FieldPath) -> str:
    """Return a path as it is written in a bundle."""
    return ''.join(f'.{step}' if isinstance(step, str) else f'[{step}]' for step in path)[1:]
