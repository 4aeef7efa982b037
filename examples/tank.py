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
A monitor in one's own program: a tank that closes its valve when its requirement is violated.

    python3 tank.py                         in a workspace, once it is sourced
    .venv/bin/python examples/tank.py       after `make setup`, without ROS

`MonitorNode` is a node like any other. It shares a process and an executor with the tank here,
and takes its messages without either: what violates is announced while the executor is busy, too.
"""

from pathlib import Path

from fret_monitor.ros import MonitorNode

import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import Empty, Float32

BUNDLE = Path(__file__).resolve().parent / 'tank.yaml'
STEP = 0.05  # s


class Tank(Node):
    """Fills by a twentieth a step while its valve is open, and publishes its level."""

    def __init__(self) -> None:
        """Begin empty, with the valve open."""
        super().__init__('tank')
        self.level = 0.0
        self.is_open = True
        self._levels = self.create_publisher(Float32, 'level', 10)
        self.create_subscription(Empty, 'copilot/handlerpropTANK_001', self._close, 10)
        self.create_timer(STEP, self._fill)

    def _fill(self) -> None:
        if not self._levels.get_subscription_count():
            return  # no subscription
        self.level += 0.05 if self.is_open else 0.0
        self._levels.publish(Float32(data=self.level))

    def _close(self, _: Empty) -> None:
        self.is_open = False
        self.get_logger().info(f'the valve is closed at a level of {self.level:.2f}')


def main() -> None:
    """Fill the tank until it is closed."""
    rclpy.init()
    tank = Tank()
    monitor = MonitorNode(parameter_overrides=[Parameter('spec', value=str(BUNDLE))])
    executor = SingleThreadedExecutor()
    for node in (monitor, tank):
        executor.add_node(node)
    while tank.is_open:
        executor.spin_once()
    for node in (monitor, tank):
        node.destroy_node()
    rclpy.shutdown()


if __name__ == '__main__':
    main()
