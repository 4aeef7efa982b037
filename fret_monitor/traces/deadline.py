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

"""The end of a search: by its time limit, or by the user."""

import math
import time

_SHARES = 3


class OutOfTime(Exception):
    """The time for an answer is over."""


class Deadline:
    """An instant at which a search ends."""

    def __init__(self, seconds: float | None) -> None:
        """Set the time limit; None: no limit."""
        self._end = None if seconds is None else time.monotonic() + seconds
        self._part_end = self._end
        self._attempt_end = math.inf
        self.is_interrupted = False

    def begin_part(self, left: int) -> None:
        """
        Begin one of `left` parts, which may take a few times its share of the time.

        So a hard part leaves time for those after it.
        """
        if self._end is not None:
            now = time.monotonic()
            part = _SHARES / (left + _SHARES - 1)
            self._part_end = now + (self._end - now) * part

    def begin_attempt(self, seconds: float) -> None:
        """Begin an attempt within the part, with a time limit of its own."""
        self._attempt_end = time.monotonic() + seconds

    def at_most(self, seconds: float) -> float:
        """Return a time limit that does not exceed what is left, in seconds."""
        ends = [end for end in (self._part_end, self._attempt_end) if end is not None]
        return max(0.0, min([seconds, *(end - time.monotonic() for end in ends)]))

    @property
    def is_over(self) -> bool:
        """Whether the part or all has ended."""
        return self.is_interrupted or \
            self._part_end is not None and time.monotonic() > self._part_end

    def check(self) -> None:
        """Raise OutOfTime after the end, that of the part, or that of the attempt."""
        if self.is_over or time.monotonic() > self._attempt_end:
            raise OutOfTime
