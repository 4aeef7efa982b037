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
A process that publishes `/clock` as a simulator does, driven by lines on standard input.

`STRIDE COUNT PAUSE` publishes COUNT times, each STRIDE seconds later than before (STRIDE may be
negative), with PAUSE seconds of real time between; it then prints the simulated time.
"""

from collections.abc import Iterator
from contextlib import contextmanager
import sys
from time import sleep

import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.time import Time
from ros.forked import ForkedScript
from rosgraph_msgs.msg import Clock


class Simulator:
    """Starts the process and drives it."""

    def __init__(self) -> None:
        """Start the process; the caller sets ROS_DOMAIN_ID."""
        self.process = ForkedScript('ros.simulator')

    def go(self, seconds: float, stride: float = 0.02, speed: float = 2.0) -> float:
        """Let simulated time run for so many seconds at a speed; return the time."""
        return self._tell(stride, round(seconds / stride), stride / speed)

    def jump(self, seconds: float) -> float:
        """Step the time forward or back at once; return the time."""
        return self._tell(seconds, 1, 0.0)

    def _tell(self, stride: float, count: int, pause: float) -> float:
        self.process.stdin.write(f'{stride} {count} {pause}\n')
        self.process.stdin.flush()
        return float(self.process.stdout.readline())

    def end(self) -> None:
        """End the process."""
        self.process.stdin.close()
        assert self.process.wait(30) == 0


@contextmanager
def simulating() -> Iterator[Simulator]:
    """Start a simulator and end it afterwards."""
    simulator = Simulator()
    try:
        yield simulator
        simulator.end()
    finally:
        simulator.process.kill()


def main() -> None:
    """Read lines and publish; time begins at 0, which is not published."""
    rclpy.init()
    node = Node('simulator')
    publisher = node.create_publisher(Clock, '/clock', QoSProfile(depth=1))
    now = 0
    for line in sys.stdin:
        stride, count, pause = map(float, line.split())
        for _ in range(int(count)):
            now += round(stride * 1e9)
            publisher.publish(Clock(clock=Time(nanoseconds=now).to_msg()))
            sleep(pause)
        print(now / 1e9, flush=True)
    node.destroy_node()
    rclpy.shutdown()
