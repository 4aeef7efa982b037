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

from fret_monitor.model.manifest import Manifest, ManifestInput
from fret_monitor.model.policies import Stale
from fret_monitor.ros.periods import NodeTimer

from rclpy.node import Node

_LOOKS = 10  # in the shortest timeout: a silence is found before it has lasted 1.25 of them
_SHORTEST = 0.005  # s between two looks
_NAMED = 5  # names in one line of the log


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


class SilenceWatch:
    """Looks for silent inputs in a node's time, tells of them, and has them taken for stale."""

    def __init__(self, node: Node, manifest: Manifest, received: Callable[[int], int],
                 violate: Callable[[int, int], None]) -> None:
        """
        Start.

        Parameters
        ----------
        node
            whose time, executor and log it is.
        manifest
            says which inputs may be silent for how long.
        received
            gives how many values came of an input (index).
        violate
            takes an input that is stale by what its bundle says, and how many values had come;
            called at each look, so that what a reset forgot is said again.
        """
        self.silences = Silences(manifest.inputs, received)
        self._node = node
        self._manifest = manifest
        self._violate = violate
        self._timer: NodeTimer | None = None
        period = self.silences.period
        if period is not None:
            self._timer = NodeTimer(node, period, self._look, 'the timeout of inputs')
            self.silences.look(self._timer.now())

    def _look(self, now: int, _: int) -> None:
        begun, ended = self.silences.look(now)
        for item in self.silences.silent():
            if self._manifest.inputs[item.index].stale is Stale.VIOLATE:
                self._violate(item.index, item.received)
        for topic in self._manifest.topics:
            self._tell_begun(topic.name, [item for item in begun if item.index in topic.inputs])
            self._tell_ended(topic.name, [item for item in ended if item.index in topic.inputs])

    def _tell_begun(self, topic: str, silences: Sequence[Silence]) -> None:
        if not silences:
            return
        indices = {item.index for item in silences}
        read = [item.id for item in self._manifest.requirements
                if not indices.isdisjoint(item.inputs)]
        timeout = self._manifest.inputs[silences[0].index].timeout
        told = (f'nothing usable came on {self._node.resolve_topic_name(topic)} within the '
                f'timeout of {timeout:g} s for {self._named(silences)}')
        if read and self._manifest.inputs[silences[0].index].stale is Stale.VIOLATE:
            self._node.get_logger().error(f'{told}: {some(read)} violated until it does')
        else:
            self._node.get_logger().warning(told)

    def _tell_ended(self, topic: str, silences: Sequence[Silence]) -> None:
        if silences:
            lasted = max(item.lasted for item in silences) / 1e9
            self._node.get_logger().info(
                f'{self._node.resolve_topic_name(topic)} speaks again after {lasted:.1f} s, for '
                f'{self._named(silences)}')

    def _named(self, silences: Sequence[Silence]) -> str:
        return some([f"'{self._manifest.inputs[item.index].name}'" for item in silences])

    def close(self) -> None:
        """Look no more."""
        if self._timer is not None:
            self._timer.close()


def some(names: Sequence[str], separator: str = ', ') -> str:
    """Return the first of some names in one line, and how many more there are."""
    more = len(names) - _NAMED
    return separator.join(names[:_NAMED]) + (f' and {more} more' if more > 0 else '')
