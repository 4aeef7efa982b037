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
Steps that come with time: when one is due, which are late, which were missed (DESIGN 6).

The node's time is `/clock` where `use_sim_time` is set. Otherwise it is that of a clock that
nobody sets: a correction of the system's time neither delays a step nor makes several of one.
"""

from collections.abc import Callable
from time import monotonic
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

_TELLING = 10.0  # s between two warnings about the same thing
_PATIENCE = 5.0  # s until it is told that there is no time


class Throttle:
    """Lets pass what is the first, or comes long enough after the one before."""

    def __init__(self, seconds: float = _TELLING) -> None:
        """Start with nothing passed yet."""
        self._seconds = seconds
        self._next = float('-inf')

    def passes(self) -> bool:
        """Return whether this one may pass; if so, the others have to wait again."""
        now = monotonic()
        if now < self._next:
            return False
        self._next = now + self._seconds
        return True


class NodeTimer:
    """
    Calls back once a period of the node's time, in its executor.

    What was missed is not made up for: whatever time did, one call follows. `use_sim_time` may
    change meanwhile.
    """

    def __init__(self, node: Node, period: float, callback: Callable[[int, int], None],
                 purpose: str) -> None:
        """
        Start; `callback` takes the time and the next planned one (ns), by the same clock.

        `purpose` says what waits if there is no time.
        """
        self._node = node
        self._purpose = purpose
        self._node_clock: Any = node.get_clock()  # a ROSClock, annotated as less in Jazzy
        self._period = period
        self._callback = callback
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._make()
        self._patience = node.create_timer(_PATIENCE, self._tell_no_time, clock=self._steady)

    def _tell_no_time(self) -> None:
        self._patience.cancel()
        if self.now() == 0:
            self._node.get_logger().warning(
                f'use_sim_time is set, and no time has come on /clock yet: {self._purpose} waits')

    def _make(self) -> None:
        self._is_simulated = self._node_clock.ros_time_is_active
        self._clock = self._node_clock if self._is_simulated else self._steady
        self._timer = self._node.create_timer(self._period, self._fire, clock=self._clock)

    def now(self) -> int:
        """Return the time (ns); 0 as long as nobody has published a `/clock` that is needed."""
        return int(self._clock.now().nanoseconds)

    def _fire(self) -> None:
        if self._node_clock.ros_time_is_active != self._is_simulated:
            self._node.destroy_timer(self._timer)
            self._make()
        now = self.now()
        self._callback(now, now + self._timer.time_until_next_call())

    def close(self) -> None:
        """Call no more."""
        self._node.destroy_timer(self._timer)
        self._node.destroy_timer(self._patience)


class Schedule:
    """
    Counts what became of the periods; knows no clock.

    `ticks` happened; `late` of them by more than half a period; `missed` periods had none;
    `restarts` are jumps of time back, after each of which the periods begin anew.
    """

    def __init__(self, period: float) -> None:
        """Take the period in seconds."""
        self.period = period
        self.ticks = self.late = self.missed = self.restarts = 0
        self._nanoseconds = round(period * 1e9)
        self._planned: int | None = None  # the tick that comes next
        self._last = 0  # the time of the last tick
        self._untold: list[str] = []
        self._told = (0, 0)
        self._throttle = Throttle()

    def tick(self, now: int, following: int) -> None:
        """Count a tick; `following` is when the next one is planned (ns)."""
        self.ticks += 1
        slot = following - self._nanoseconds
        if self._planned is not None:
            periods = round((slot - self._planned) / self._nanoseconds)
            self.missed += max(0, periods)
            if periods < 0:
                self._restart(now)
        self.late += 2 * (now - slot) > self._nanoseconds
        # Before the first `/clock` there is no time, and none goes by.
        self._planned, self._last = (following if now > 0 else None), now

    def _restart(self, now: int) -> None:
        self.restarts += 1
        self._untold.append(
            f'time went back from {self._last / 1e9:.3f} s to {now / 1e9:.3f} s, and the periods '
            'go on from there; values and past of the requirements are kept')

    def news(self) -> list[str]:
        """Return what is to be told by now; what came late or not is told now and then."""
        told, self._untold = self._untold[-1:], []
        late, missed = self.late - self._told[0], self.missed - self._told[1]
        if (late or missed) and self._throttle.passes():
            self._told = (self.late, self.missed)
            told.append(f'of the periods of {self.period:g} s since the last such message, '
                        f'{missed} were missed, which are no steps, and {late} came late by '
                        'more than half a period')
        return told


class Periods:
    """Takes a step each period of a node's time, and tells what came late or not at all."""

    def __init__(self, node: Node, period: float, step: Callable[[], None]) -> None:
        """Start; `period` is in seconds."""
        self.schedule = Schedule(period)
        self._node = node
        self._step = step
        self._timer = NodeTimer(node, period, self._tick, 'the policy periodic')

    def _tick(self, now: int, following: int) -> None:
        self._step()
        self.schedule.tick(now, following)
        for line in self.schedule.news():
            self._node.get_logger().warning(line)

    def close(self) -> None:
        """Take no more steps."""
        self._timer.close()
