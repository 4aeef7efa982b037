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
Timers in the node's time, and counts of late and missed periods (docs/ros.md, Periods).

The node's time is `/clock` where `use_sim_time` is set, and a steady clock otherwise: a correction
of the system time neither delays a step nor adds one.
"""

from collections.abc import Callable
from time import monotonic
from typing import Any

from rclpy.clock import Clock, ClockType
from rclpy.node import Node

_REPEAT_S = 10.0  # between two log lines of the same kind
_NO_TIME_S = 5.0  # until a missing `/clock` is logged
_READINGS = 10  # attempts to read a clock and a timer without being preempted in between


class Throttle:
    """Lets the first event pass, and later ones at most once per interval."""

    def __init__(self, seconds: float = _REPEAT_S) -> None:
        """Take the interval in seconds."""
        self._seconds = seconds
        self._next = float('-inf')

    def passes(self) -> bool:
        """Return whether this event may pass."""
        now = monotonic()
        if now < self._next:
            return False
        self._next = now + self._seconds
        return True


class NodeTimer:
    """
    Calls back once per period of the node's time, in the node's executor.

    Missed periods are skipped: however far time has advanced, there is one call.
    `use_sim_time` may change at any time.
    """

    def __init__(self, node: Node, period: float, callback: Callable[[int, int], None],
                 on_clock_change: Callable[[], None], purpose: str) -> None:
        """
        Start.

        Parameters
        ----------
        node
            has the clock and the executor.
        period
            in seconds.
        callback
            takes the time of the call and the time at which the next one is due (ns).
        on_clock_change
            called before the first callback after the clock was changed.
        purpose
            for the log: what has to wait for `/clock`.
        """
        self._node = node
        self._purpose = purpose
        self._node_clock: Any = node.get_clock()  # a ROSClock; Jazzy annotates it as a Clock
        self._period = period
        self._callback = callback
        self._on_clock_change = on_clock_change
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._make()
        self._no_time = node.create_timer(_NO_TIME_S, self._report_no_time, clock=self._steady)

    def _report_no_time(self) -> None:
        self._no_time.cancel()
        if self.now() == 0:
            self._node.get_logger().warning(
                'use_sim_time is set, and no time was received on /clock yet: '
                f'{self._purpose} waits')

    def _make(self) -> None:
        self._is_simulated = self._node_clock.ros_time_is_active
        self._clock = self._node_clock if self._is_simulated else self._steady
        self._timer: Any = self._node.create_timer(self._period, self._fire, clock=self._clock)

    def now(self) -> int:
        """Return the time (ns); 0 while `use_sim_time` is set and no `/clock` was received."""
        return int(self._clock.now().nanoseconds)

    def _fire(self) -> None:
        if self._node_clock.ros_time_is_active != self._is_simulated:
            self._node.destroy_timer(self._timer)
            self._make()
            self._on_clock_change()
        self._callback(*self._read())

    def _read(self) -> tuple[int, int]:
        """
        Return the time, and the time of the next call.

        The two readings are repeated if the thread was preempted between them, or `/clock`
        advanced: they would not be consistent.
        """
        for _ in range(_READINGS):
            now = self.now()
            remaining = self._timer.time_until_next_call()
            if 4e-9 * (self.now() - now) < self._period:
                break
        return now, now + remaining

    def close(self) -> None:
        """Stop calling."""
        self._node.destroy_timer(self._timer)
        self._node.destroy_timer(self._no_time)


class Schedule:
    """
    Counts ticks and periods; reads no clock.

    `late` ticks were more than half a period after the time at which they were due; `missed`
    periods had no tick; `restarts` counts how often time went back.
    """

    def __init__(self, period: float) -> None:
        """Take the period in seconds."""
        self.period = period
        self.ticks = self.late = self.missed = self.restarts = 0
        self._nanoseconds = round(period * 1e9)
        self._planned: int | None = None  # when the next tick is due
        self._last = 0  # the time of the last tick
        self._restart_reports: list[str] = []
        self._reported = (0, 0)  # late, missed
        self._throttle = Throttle()

    def tick(self, now: int, following: int) -> None:
        """Count a tick; `following` is when the next one is due (ns)."""
        self.ticks += 1
        due = following - self._nanoseconds
        if self._planned is not None:
            periods = round((due - self._planned) / self._nanoseconds)
            self.missed += max(0, periods)
            if periods < 0:
                self._restart(now)
        self.late += 2 * (now - due) > self._nanoseconds
        # No period passes before the first `/clock`.
        self._planned, self._last = (following if now > 0 else None), now

    def change_clock(self) -> None:
        """Restart the periods after the clock was changed; no period counts as missed."""
        self._planned = None

    def _restart(self, now: int) -> None:
        self.restarts += 1
        self._restart_reports.append(
            f'time went back from {self._last / 1e9:.3f} s to {now / 1e9:.3f} s: the periods '
            'continue from there; values and past of the requirements are kept')

    def reports(self) -> list[str]:
        """Return the lines to log: the last restart, and at intervals late and missed periods."""
        lines, self._restart_reports = self._restart_reports[-1:], []
        late, missed = self.late - self._reported[0], self.missed - self._reported[1]
        if (late or missed) and self._throttle.passes():
            self._reported = (self.late, self.missed)
            lines.append(f'periods of {self.period:g} s since the last such message: '
                         f'{missed} missed (no step), {late} late by more than half a period')
        return lines


class Periods:
    """Calls `step` once per period of a node's time, and logs late and missed periods."""

    def __init__(self, node: Node, period: float, step: Callable[[], None]) -> None:
        """Start; `period` is in seconds."""
        self.schedule = Schedule(period)
        self._node = node
        self._step = step
        self._timer = NodeTimer(
            node, period, self._tick, self.schedule.change_clock, 'the policy periodic')

    def _tick(self, now: int, following: int) -> None:
        self._step()
        self.schedule.tick(now, following)
        for line in self.schedule.reports():
            self._node.get_logger().warning(line)

    def close(self) -> None:
        """Stop stepping."""
        self._timer.close()
