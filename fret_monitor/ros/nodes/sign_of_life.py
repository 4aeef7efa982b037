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
The sign of life of a monitor: `~/alive`, once a second while all of its threads go round.

The node's timer calls `beat`; C decides whether it is published (`csrc/reporting/sign_of_life.h`).
The liveliness of the publisher is asserted by nothing else, so that a subscriber learns of a
monitor that hangs as of one that has ended.
"""

from collections.abc import Callable, Sequence
from itertools import chain
from time import monotonic_ns
from typing import Any

from fret_monitor.native.binding import ffi
from fret_monitor.ros.intake.rcl_endpoint import RclPublisher
from fret_monitor.ros.log_lines import log_lines
from fret_monitor.ros.watch import Watch
from fret_monitor.runtime.reporting import Lines

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import LivelinessPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Header

_LEASE_S: int = ffi.integer_const('FM_SIGN_LEASE_S')

Turns = Callable[[], tuple[int, ...]]


class SignOfLife:
    """Publishes the sign of life from its creation until `close`."""

    def __init__(self, node: Node, library: Any, turns: Sequence[Turns], watch: Watch) -> None:
        """
        Begin; `turns` return counters, each of which grows within a second.

        `library` has the functions of csrc.
        """
        self._node = node
        self._watch = watch
        self._turns = turns
        self._before = self._now()
        self._state: Any = ffi.new('struct fm_sign *', {'published': monotonic_ns()})
        self._lines = Lines(library)
        self._publisher = RclPublisher(node, Header, '~/alive', QoSProfile(
            depth=1, reliability=ReliabilityPolicy.RELIABLE,
            liveliness=LivelinessPolicy.MANUAL_BY_TOPIC,
            liveliness_lease_duration=Duration(seconds=_LEASE_S)))
        self._publish()

    def _now(self) -> Any:
        return ffi.new('uint64_t[]', [*chain.from_iterable(turns() for turns in self._turns)])

    def beat(self, now: int | None = None) -> None:
        """Publish the sign if it is due, and nothing has failed; to be called once a second."""
        if self._watch.failures:
            return
        turns = self._now()
        if self._lines.library.fm_sign_is_due(
                self._state, self._before, turns, min(len(self._before), len(turns)),
                monotonic_ns() if now is None else now, self._lines.pointer):
            self._publish()
        log_lines(self._node.get_logger(), self._lines.take())

    def _publish(self) -> None:
        with self._publisher.handle:
            self._publisher.handle.publish(Header(
                stamp=self._node.get_clock().now().to_msg(), frame_id=self._node.get_name()))

    def close(self) -> None:
        self._publisher.close()
