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
Which inputs have gone silent: nothing usable came of them for as long as their `timeout`.

A message costs nothing here. Several times in each timeout somebody looks how many values have
come so far; it is that time which counts, so that a simulation that stands still is no silence.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from fret_monitor.manifest import ManifestInput

_LOOKS = 10  # in the shortest timeout: a silence is found before it has lasted 1.25 of them
_SHORTEST = 0.005  # s between two looks


@dataclass(frozen=True)
class Silence:
    """An input (index) that is silent, how many values of it had come, and for how long (ns)."""

    index: int
    received: int
    lasted: int


class _Watched:
    """One input: what had come of it when somebody looked last."""

    def __init__(self, index: int, timeout: float) -> None:
        self.index = index
        self.timeout = round(timeout * 1e9)
        self.received = -1
        self.lasted = 0  # how long nothing came, ns
        self.is_silent = False
        self.is_excused = False
        self.silences = 0

    def look(self, received: int, stride: int) -> bool:
        """Take note of the number of values, `stride` later; return whether it fell silent."""
        if received != self.received:
            self.received = received
            self.lasted = 0
            self.is_silent = self.is_excused = False
            return False
        # Time that went by without a look, or in one leap, may have been nobody's: a process that
        # was stopped finds its messages afterwards. But a clock may go in such strides always.
        if 2 * stride > self.timeout and not self.is_silent and not self.is_excused:
            self.is_excused = True
            return False
        self.lasted += max(0, stride)
        if self.is_silent or self.lasted < self.timeout:
            return False
        self.is_silent = True
        self.silences += 1
        return True


class Silences:
    """Finds inputs that fall silent, and those that speak again; knows no clock."""

    def __init__(self, inputs: Sequence[ManifestInput], received: Callable[[int], int]) -> None:
        """Watch the inputs with a timeout; `received` gives how many values came of one."""
        self._received = received
        self._watched = {
            index: _Watched(index, item.timeout) for index, item in enumerate(inputs)
            if item.timeout is not None and item.topic is not None}
        self._last: int | None = None

    @property
    def period(self) -> float | None:
        """Seconds between two looks; None if nothing is to be looked for."""
        if not self._watched:
            return None
        shortest = min(item.timeout for item in self._watched.values())
        return max(_SHORTEST, shortest / 1e9 / _LOOKS)

    def look(self, now: int) -> tuple[list[Silence], list[Silence]]:
        """Look at a time (ns); return the silences that began, and those that ended."""
        stride = 0 if self._last is None else now - self._last
        self._last = now
        before = {silence.index: silence for silence in self.silent()}
        begun = {index for index, item in self._watched.items()
                 if item.look(self._received(index), stride)}
        ended = [silence for index, silence in before.items()
                 if not self._watched[index].is_silent]
        return [silence for silence in self.silent() if silence.index in begun], ended

    def silent(self) -> list[Silence]:
        """Return the inputs that are silent."""
        return [Silence(index, item.received, item.lasted)
                for index, item in self._watched.items() if item.is_silent]

    def count(self, index: int) -> int | None:
        """Return how often an input fell silent; None if it is not watched."""
        item = self._watched.get(index)
        return None if item is None else item.silences
