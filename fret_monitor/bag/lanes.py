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

"""Lanes: what was true over a stretch of time, thinned for drawing."""

from itertools import groupby

TRUE, FALSE, OPEN = 1, 2, 4
"""What was so in a part of a lane; 0: nothing is known of it."""

_LETTERS = {0: 'u', TRUE: 't', FALSE: 'f', TRUE | FALSE: 'm'}


class Lane:
    """What was true from `begin` to `end` (ns), in `parts` of equal length."""

    def __init__(self, begin: int, end: int, parts: int) -> None:
        """Make a lane of which nothing is known; it has fewer parts if it is that short."""
        self.begin, self.end = begin, end
        self._parts = bytearray(min(parts, end - begin + 1))

    def _place(self, time: int) -> int:
        place = (time - self.begin) * len(self._parts) // (self.end - self.begin + 1)
        return max(0, min(len(self._parts) - 1, place))

    def paint(self, since: int, until: int, state: int) -> None:
        """Add that something was so from a time to another, inclusive; what is outside is cut."""
        if until < self.begin or since > self.end:
            return
        for place in range(self._place(since), self._place(until) + 1):
            self._parts[place] |= state

    def leave_open(self) -> None:
        """Mark the end as open: a verdict depends on what comes after it."""
        count = max(1, len(self._parts) // 50)
        self._parts[-count:] = bytes([OPEN] * count)

    def text(self) -> str:
        """Return the lane as letters with numbers: `t40m1f3` : 40 parts true, 1 both, 3 false."""
        return ''.join(f'{_letter(state)}{len(list(parts))}'
                       for state, parts in groupby(self._parts))


def _letter(state: int) -> str:
    return 'o' if state & OPEN else _LETTERS[state]
