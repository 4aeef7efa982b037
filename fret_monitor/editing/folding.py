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

"""Which lines of a bundle can be folded: what is indented below a line, by indentation alone."""

from typing import NamedTuple

from fret_monitor.editing.positions import PositionMap


class FoldedLines(NamedTuple):
    """The first line, which stays visible, and the last one; both from 0."""

    first: int
    last: int


def folds(text: str) -> list[FoldedLines]:
    """Return the ranges of lines that can be folded, in the order of their first lines."""
    lines = PositionMap(text)
    found: list[FoldedLines] = []
    above: list[tuple[int, int]] = []  # depth and number of each line that others may be below
    last = 0
    for number in range(len(lines.starts)):
        line = lines.line(number)
        content = line.lstrip(' ')
        if not content.strip() or content.startswith('#'):
            continue
        # The items of a list may stand as deep as its key.
        depth = 2 * (len(line) - len(content)) + content.startswith('- ')
        while above and above[-1][0] >= depth:
            found.append(FoldedLines(above.pop()[1], last))
        above.append((depth, number))
        last = number
    found += [FoldedLines(first, last) for _, first in above]
    return sorted(item for item in found if item.last > item.first)
