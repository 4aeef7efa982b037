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
A small vehicle whose planner does not know of the wall, without a gate and with one.

    python3 wall.py                         in a workspace, once it is sourced
    make demo-gate                          without ROS

The planner asks for 1.5 m/s. The first drive ends at the wall. In the second one the gate of
`wall.yaml` withholds the commands that would bring the vehicle closer than it allows, and sends
zeros. The exit status is 0 if that is what happened.
"""

from pathlib import Path
import sys
from time import monotonic

from fret_monitor.ros import GateNode

from geometry_msgs.msg import TwistStamped
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import Float32

BUNDLE = Path(__file__).resolve().parent / 'wall.yaml'
WALL = 4.0  # m
SPEED = 1.5  # m/s, which the planner asks for
ACCELERATION = 2.0  # m/s^2
STEP = 0.05  # s
SILENCE = 0.3  # s without a command, after which the vehicle brakes
LONGEST = 6.0  # s of a drive, from the first command


class Planner(Node):
    """Asks for the same speed all the time."""

    def __init__(self) -> None:
        """Begin at once."""
        super().__init__('planner')
        self._commands = self.create_publisher(TwistStamped, 'cmd_raw', 10)
        self.create_timer(STEP, self._plan)

    def _plan(self) -> None:
        command = TwistStamped()
        command.header.stamp = self.get_clock().now().to_msg()
        command.twist.linear.x = SPEED
        self._commands.publish(command)


class Vehicle(Node):
    """Follows the commands of a topic, and publishes the distance to the wall."""

    def __init__(self, commands: str) -> None:
        """Stand still, `WALL` in front of the wall."""
        super().__init__('vehicle')
        self.place = self.speed = self.wanted = 0.0
        self.commanded: float | None = None  # the time of the last command
        self.began: float | None = None
        self._front = self.create_publisher(Float32, 'front', 10)
        self.create_subscription(TwistStamped, commands, self._obey, 10)
        self.create_timer(STEP, self._move)

    @property
    def has_crashed(self) -> bool:
        """Whether it has reached the wall."""
        return self.place >= WALL

    def _obey(self, command: TwistStamped) -> None:
        self.wanted, self.commanded = command.twist.linear.x, monotonic()
        self.began = self.began or (monotonic() if self.wanted > 0.0 else None)

    def _move(self) -> None:
        is_commanded = self.commanded is not None and monotonic() < self.commanded + SILENCE
        wanted = self.wanted if is_commanded else 0.0
        change = max(-ACCELERATION * STEP, min(ACCELERATION * STEP, wanted - self.speed))
        self.speed += change
        self.place = min(WALL, self.place + self.speed * STEP)
        self._front.publish(Float32(data=WALL - self.place))


def drive(with_gate: bool) -> Vehicle:
    """Drive until the vehicle is at the wall, or `LONGEST`; return it."""
    nodes: list[Node] = [Planner(), vehicle := Vehicle('cmd' if with_gate else 'cmd_raw')]
    if with_gate:
        nodes.append(GateNode(parameter_overrides=[Parameter('spec', value=str(BUNDLE))]))
    executor = SingleThreadedExecutor()
    for node in nodes:
        executor.add_node(node)
    while not vehicle.has_crashed and (
            vehicle.began is None or monotonic() < vehicle.began + LONGEST):
        executor.spin_once(timeout_sec=0.2)
    executor.shutdown()
    for node in nodes:
        node.destroy_node()
    return vehicle


def main() -> int:
    """Drive twice, and print where the vehicle has come to a stop."""
    rclpy.init()
    vehicles = {name: drive(name == 'with the gate') for name in (
        'without a gate', 'with the gate')}
    rclpy.try_shutdown()
    for name, vehicle in vehicles.items():
        print(f'{name}: the vehicle is at the wall, at {vehicle.speed:.1f} m/s'
              if vehicle.has_crashed else
              f'{name}: the vehicle stands {WALL - vehicle.place:.2f} m in front of the wall')
    crashed = [vehicle.has_crashed for vehicle in vehicles.values()]
    return 0 if crashed == [True, False] else 1


if __name__ == '__main__':
    sys.exit(main())
