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
Find silent inputs: no usable value within their `timeout` (docs/ros.md, Silent inputs).

Nothing is done per message: a timer reads the counts of received values several times per timeout.
Timeouts are measured in the node's time, so that a paused simulation does not make inputs silent.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from fret_monitor.model.manifest import Manifest, ManifestInput
from fret_monitor.model.policies import Stale
from fret_monitor.ros.periods import NodeTimer

from rclpy.node import Node

_CHECKS = 10  # per shortest timeout: a silence is found within 1.25 timeouts
_SHORTEST_S = 0.005  # between two checks
_NAMED = 5  # names in one log line


@dataclass(frozen=True)
class Silence:
    """A silent input (index), how many values were received, and the time since the last (ns)."""

    index: int
    received: int
    lasted: int


class _TrackedInput:
    """An input with a timeout, as of the last check."""

    def __init__(self, index: int, timeout: float) -> None:
        self.index = index
        self.timeout = round(timeout * 1e9)
        self.received = -1
        self.lasted = 0  # ns without a value
        self.is_silent = False
        self.is_excused = False
        self.silences = 0

    def check(self, received: int, elapsed: int) -> bool:
        """Compare the count with the one `elapsed` ns ago; return whether a silence begins."""
        if received != self.received:
            self.received = received
            self.lasted = 0
            self.is_silent = self.is_excused = False
            return False
        # Ignore one gap between checks longer than timeout/2: the process may have been suspended,
        # with messages queued. Count the second one: a clock may always advance in such steps.
        if 2 * elapsed > self.timeout and not self.is_silent and not self.is_excused:
            self.is_excused = True
            return False
        self.lasted += max(0, elapsed)
        if self.is_silent or self.lasted < self.timeout:
            return False
        self.is_silent = True
        self.silences += 1
        return True


class TimeoutTracker:
    """Finds the beginning and end of silences; reads no clock."""

    def __init__(self, inputs: Sequence[ManifestInput], received: Callable[[int], int]) -> None:
        """Track the inputs with a timeout; `received` returns the count of values of an input."""
        self._received = received
        self._tracked = {
            index: _TrackedInput(index, item.timeout) for index, item in enumerate(inputs)
            if item.timeout is not None and item.topic is not None}
        self._last = 0

    @property
    def period(self) -> float | None:
        """Seconds between two checks; None where no input has a timeout."""
        if not self._tracked:
            return None
        shortest = min(item.timeout for item in self._tracked.values())
        return max(_SHORTEST_S, shortest / 1e9 / _CHECKS)

    def check(self, now: int) -> tuple[list[Silence], list[Silence]]:
        """Check at a time (ns; 0: no time yet); return the silences that began and that ended."""
        elapsed = now - self._last if self._last else 0
        self._last = now
        before = {silence.index: silence for silence in self.silent()}
        begun = {index for index, item in self._tracked.items()
                 if item.check(self._received(index), elapsed)}
        ended = [silence for index, silence in before.items()
                 if not self._tracked[index].is_silent]
        return [silence for silence in self.silent() if silence.index in begun], ended

    def change_clock(self) -> None:
        """Count no time until the next check, since the clock was changed."""
        self._last = 0

    def silent(self) -> list[Silence]:
        """Return the inputs that are silent."""
        return [Silence(index, item.received, item.lasted)
                for index, item in self._tracked.items() if item.is_silent]

    def count(self, index: int) -> int | None:
        """Return the number of silences of an input; None if it has no timeout."""
        item = self._tracked.get(index)
        return None if item is None else item.silences


class TimeoutTimer:
    """Checks timeouts in a node's time, logs silences, and reports stale inputs."""

    def __init__(self, node: Node, manifest: Manifest, received: Callable[[int], int],
                 set_stale: Callable[[int, int], None]) -> None:
        """
        Start.

        Parameters
        ----------
        node
            has the clock, the executor and the log.
        manifest
            has the inputs and their timeouts.
        received
            returns how many values of an input (index) were received.
        set_stale
            takes a silent input with `stale: violate`, and how many values were received; called
            at each check, since a reset clears the mark.
        """
        self.tracker = TimeoutTracker(manifest.inputs, received)
        self._node = node
        self._manifest = manifest
        self._set_stale = set_stale
        self._timer: NodeTimer | None = None
        period = self.tracker.period
        if period is not None:
            self._timer = NodeTimer(
                node, period, self._check, self.tracker.change_clock, 'the timeout of inputs')
            self.tracker.check(self._timer.now())

    def _check(self, now: int, _: int) -> None:
        begun, ended = self.tracker.check(now)
        for item in self.tracker.silent():
            if self._manifest.inputs[item.index].stale is Stale.VIOLATE:
                self._set_stale(item.index, item.received)
        for topic in self._manifest.topics:
            self._log_begun(topic.name, [item for item in begun if item.index in topic.inputs])
            self._log_ended(topic.name, [item for item in ended if item.index in topic.inputs])

    def _log_begun(self, topic: str, silences: Sequence[Silence]) -> None:
        if not silences:
            return
        indices = {item.index for item in silences}
        readers = [item.id for item in self._manifest.requirements
                   if not indices.isdisjoint(item.inputs)]
        timeout = self._manifest.inputs[silences[0].index].timeout
        line = (f'no usable value on {self._node.resolve_topic_name(topic)} within the '
                f'timeout of {timeout:g} s for {self._named(silences)}')
        if readers and self._manifest.inputs[silences[0].index].stale is Stale.VIOLATE:
            self._node.get_logger().error(f'{line}: {some(readers)} violated until one comes')
        else:
            self._node.get_logger().warning(line)

    def _log_ended(self, topic: str, silences: Sequence[Silence]) -> None:
        if silences:
            lasted = max(item.lasted for item in silences) / 1e9
            self._node.get_logger().info(
                f'values on {self._node.resolve_topic_name(topic)} again after {lasted:.1f} s, '
                f'for {self._named(silences)}')

    def _named(self, silences: Sequence[Silence]) -> str:
        return some([f"'{self._manifest.inputs[item.index].name}'" for item in silences])

    def close(self) -> None:
        """Stop checking."""
        if self._timer is not None:
            self._timer.close()


def some(names: Sequence[str], separator: str = ', ') -> str:
    """Return the first five names in one line, and how many more there are."""
    more = len(names) - _NAMED
    return separator.join(names[:_NAMED]) + (f' and {more} more' if more > 0 else '')
