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
The time of a node, as an engine follows it (docs/time.md, Periods on a node).

It is `/clock` where `use_sim_time` is set, and a steady clock otherwise: a correction of the
system time neither delays a period or timeout nor adds one. Where the stamps of headers count, it
is the system time instead, since that is what they were taken from. The engine waits and counts in
C; Python only passes on that the clock has moved, or was changed for the other one.
"""

from collections.abc import Callable
from contextlib import ExitStack
from threading import RLock
from typing import Any

from fret_monitor.native import words
from fret_monitor.native.binding import ffi
from fret_monitor.ros.log_lines import Throttle
from fret_monitor.ros.watch import steady_timer
from fret_monitor.runtime import Engine

from rclpy.clock import JumpThreshold
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.time_source import CLOCK_TOPIC
from rclpy.timer import Timer
from rosgraph_msgs.msg import Clock

PATIENCE_S = 0.0005
"""A timeout found later than this may be put off once: the process did not run (`evaluator.h`)."""

_SERVED_S = 0.1
"""How often the engine learns that the executor, which moves `/clock`, does not hang."""

_NEGATIVE_S = 60.0  # between two log lines about negative times on `/clock`


class ClockNode(Node):
    """A node that ignores negative times on `/clock`; rclpy would end the process."""

    def create_subscription(self, msg_type: Any, topic: str, callback: Callable[..., Any],
                            *options: Any, **more: Any) -> Any:
        """Create a subscription; rclpy makes that of `/clock` here too."""
        if topic == CLOCK_TOPIC:
            callback = self._skipping_negative(callback)
        return super().create_subscription(msg_type, topic, callback, *options, **more)

    def _skipping_negative(self, callback: Callable[[Clock], None]) -> Callable[[Clock], None]:
        throttle = Throttle(_NEGATIVE_S)

        def take(message: Clock) -> None:
            if message.clock.sec >= 0:
                callback(message)
            elif throttle.passes():
                self.get_logger().warning(words.NEGATIVE_TIME % (
                    message.clock.sec + message.clock.nanosec / 1e9))

        return take


class NodeTime:
    """Lets an engine follow a node's time, from its creation until `close`."""

    def __init__(self, node: Node, engine: Engine, clock_now: Any) -> None:
        """Follow the clock; `clock_now` is the address of `rcl_clock_get_now`."""
        self._node = node
        self._engine = engine
        self._serving: Timer | None = None  # while `/clock` is followed
        self._clock_now = clock_now
        self._clock: Any = node.get_clock()  # a ROSClock; Jazzy annotates it as a Clock
        self._lock = RLock()
        self._held = ExitStack()
        handle: Any = self._clock.handle
        self._held.enter_context(handle)
        self._pointer = ffi.cast('void *', handle.pointer)
        self._listen(JumpThreshold(min_forward=None, min_backward=None), self._leave, self._change)
        self._listen(JumpThreshold(
            min_forward=Duration(nanoseconds=1), min_backward=Duration(nanoseconds=-1),
            on_clock_change=False), None, engine.wake)
        # What was received before `/clock` goes back counts by its time of before.
        self._listen(JumpThreshold(
            min_forward=None, min_backward=Duration(nanoseconds=-1), on_clock_change=False),
            engine.drain, None)
        with self._lock:
            self._engine.follow_steady()
            self._follow(is_outdated=False)

    def _listen(self, threshold: JumpThreshold, before: Callable[[], None] | None,
                after: Callable[[], None] | None) -> None:
        jumps = self._clock.create_jump_callback(
            threshold, pre_callback=before,
            post_callback=None if after is None else lambda _: after())
        self._held.callback(jumps.unregister)

    def _leave(self) -> None:
        """Leave `/clock` before it is turned off: the clock then gives the system time."""
        with self._lock:
            if self._clock.ros_time_is_active:
                self._engine.follow_steady()
                self._stop_serving()

    def _change(self) -> None:
        with self._lock:
            self._follow(is_outdated=True)

    def _follow(self, *, is_outdated: bool) -> None:
        if self._clock.ros_time_is_active:
            self._engine.follow_clock(self._clock_now, self._pointer, is_outdated=is_outdated)
            if self._serving is None:
                self._serving = steady_timer(self._node, _SERVED_S, self._engine.serve_clock)

    def close(self) -> None:
        """Stop following; the engine must not be used with this clock any more."""
        self._stop_serving()
        self._held.close()

    def _stop_serving(self) -> None:
        if self._serving is not None:
            self._node.destroy_timer(self._serving)
            self._serving = None
