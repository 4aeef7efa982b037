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
Positions of an editor: a line, and a number of units in it, both from 0.

Units are those of UTF-16, unless the editor has chosen another encoding.

A line ends with CR LF, LF or CR, as the Language Server Protocol says; other characters that
Unicode counts as line ends are part of a line.
"""

from bisect import bisect_right
from dataclasses import dataclass
from functools import cached_property
import re
from typing import NamedTuple

_LINE_END = re.compile(r'\r\n|\n|\r')


class EditorPosition(NamedTuple):
    """A line, and the units before the place in it; both from 0."""

    line: int
    character: int


@dataclass(frozen=True, eq=False)
class PositionMap:
    """Converts between character offsets of a text and positions of an editor."""

    text: str
    encoding: str = 'utf-16'

    @cached_property
    def starts(self) -> list[int]:
        """The offset at which each line begins."""
        return [0, *(match.end() for match in _LINE_END.finditer(self.text))]

    def line(self, number: int) -> str:
        """Return a line without its end; '' behind the last one."""
        if number >= len(self.starts):
            return ''
        end = self.starts[number + 1] if number + 1 < len(self.starts) else len(self.text)
        return self.text[self.starts[number]:end].rstrip('\r\n')

    def position(self, offset: int) -> EditorPosition:
        """Return the position of an offset; one outside of the text is moved to its end."""
        offset = max(0, min(offset, len(self.text)))
        line = bisect_right(self.starts, offset) - 1
        return EditorPosition(line, self._units(self.text[self.starts[line]:offset]))

    def offset(self, position: EditorPosition) -> int:
        """Return the offset of a position; one outside of a line is moved to the line's end."""
        if position.line >= len(self.starts):
            return len(self.text)
        start, line = self.starts[max(0, position.line)], self.line(max(0, position.line))
        left = position.character
        for number, char in enumerate(line):
            if left <= 0:
                return start + number
            left -= self._units(char)
        return start + len(line)

    def _units(self, text: str) -> int:
        match self.encoding:
            case 'utf-8':
                return len(text.encode('utf-8', 'surrogatepass'))
            case 'utf-32':
                return len(text)
            case _:
                return len(text) + sum(1 for char in text if ord(char) > 0xffff)
