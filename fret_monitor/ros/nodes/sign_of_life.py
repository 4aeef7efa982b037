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

The node's timer calls `beat`, which publishes it, and only if the threads of every bundle have
looked for work since the last sign, and nothing has failed (`watch`). The liveliness of the
publisher is asserted by nothing else, so that a subscriber learns of a monitor that hangs as of
one that has ended.
"""

from collections.abc import Callable, Sequence
from time import monotonic

from fret_monitor.native import words
from fret_monitor.ros.log_lines import Throttle
from fret_monitor.ros.settings.qos import NO_EVENTS
from fret_monitor.ros.watch import Watch

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import LivelinessPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Header

_PERIOD_S = 1.0
_LEASE_S = 3  # without a sign, until the middleware reports the publisher as not alive
_LOGGED_S = 60.0

Turns = Callable[[], tuple[int, ...]]


class SignOfLife:
    """Publishes the sign of life from its creation until `close`."""

    def __init__(self, node: Node, turns: Sequence[Turns], watch: Watch) -> None:
        """Begin; `turns` return counters, each of which grows within a second."""
        self._node = node
        self._watch = watch
        self._turns = turns
        self._before = [turns() for turns in turns]
        self._published = monotonic()
        self._suspected: float | None = None  # when a thread was first found not to have turned
        self._throttle = Throttle(_LOGGED_S)
        self._publisher = node.create_publisher(Header, '~/alive', QoSProfile(
            depth=1, reliability=ReliabilityPolicy.RELIABLE,
            liveliness=LivelinessPolicy.MANUAL_BY_TOPIC,
            liveliness_lease_duration=Duration(seconds=_LEASE_S)), event_callbacks=NO_EVENTS)
        self._publish()

    def beat(self, now: float | None = None) -> None:
        """
        Publish the sign if all threads have looked for work since the last sign.

        To be called once a second.
        """
        if self._watch.failures:
            return
        now = monotonic() if now is None else now
        found = [turns() for turns in self._turns]
        if any(old == new for pair in zip(self._before, found) for old, new in zip(*pair)):
            self._suspect(now)
            return
        self._before, self._published, self._suspected = found, now, None
        self._publish()

    def _suspect(self, now: float) -> None:
        """
        Log that a thread hangs, unless it may have had no time to turn.

        A timer fires early after it was late. And if the whole process was stopped, it may fire
        before the threads turn, so they get a second from then on.
        """
        if now - self._published < _PERIOD_S:
            return
        if self._suspected is None:
            self._suspected = now
        elif now - self._suspected >= _PERIOD_S and self._throttle.passes():
            self._node.get_logger().error(words.HANGS)

    def _publish(self) -> None:
        self._publisher.publish(Header(
            stamp=self._node.get_clock().now().to_msg(), frame_id=self._node.get_name()))

    def close(self) -> None:
        self._node.destroy_publisher(self._publisher)
