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
A small simulated quadrotor that flies through three gusts, for `config/quadrotor.yaml`.

    python3 quadrotor.py [--ros-args -p fault:=true] [-p speed:=8.0] [-p log:=FILE]

It publishes `windspeed` and `motor/current` (std_msgs/Float32), each five times a second, and ends
by itself. All flights are the same: nothing is random, and the simulation steps by the step, not
by the clock. The battery guard cuts the current when it has been high for a while; with `fault`
it fails in the second gust, and the motors run hot; in the third gust both sensors fall silent.

With a `speed` other than 1 it flies that much faster than real time, and publishes its own time on
`/clock`: start the monitor with `use_sim_time:=true`.

`log` names a file that gets a line for each message: seconds of flight, topic, value.
"""

from collections.abc import Iterator
from dataclasses import dataclass
import sys
from time import monotonic, sleep

from builtin_interfaces.msg import Time
import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float32

STEP = 0.2  # s
CURRENT_LIMIT = 15.0  # A; the guard lets more than this pass for GUARD_PATIENCE only
GUARD_PATIENCE = 12.0  # s
TAKES_OFF_AT = 1000  # s, the time on /clock
BREEZE = 4.0  # m/s
DEPTH = 100  # messages that a busy subscriber may be behind
MATCH_S = 1.0  # a monitor may replace its subscriptions to match the publishers' QoS

# (begins at, wind that blows, what happens)
FLIGHT = (
    (0.0, 3.0, 'on the ground, propellers turning'),
    (4.0, BREEZE, 'take-off'),
    (8.0, BREEZE, 'cruise'),
    (12.0, 12.0, 'a gust'),
    (28.0, BREEZE, 'cruise, the gust is over'),
    (36.0, 12.0, 'a second gust'),
    (64.0, BREEZE, 'cruise, the gust is over'),
    (70.0, 12.0, 'a third gust'),
    (83.0, 12.0, 'the sensors fall silent'),
    (92.0, BREEZE, 'the gust is over'),
    (93.0, BREEZE, 'on the way home, the sensors are back'),
    (98.0, 3.0, 'landed'),
    (100.0, 3.0, ''),
)
SILENCE = (83.0, 93.0)


@dataclass(frozen=True)
class Sample:
    """The sensor values at a time of the flight, in seconds, m/s and A."""

    time: float
    wind: float
    current: float
    event: str
    is_silent: bool


def fly(fault: bool) -> Iterator[Sample]:
    """Simulate the flight, a sample each `STEP`; with `fault` the guard fails in the end."""
    wind, current, hot_for, is_cut = 3.0, 3.0, 0.0, False
    for number in range(round(FLIGHT[-1][0] / STEP)):
        time = number * STEP
        began, blowing, event = [leg for leg in FLIGHT if leg[0] <= time + STEP / 2][-1]
        wind += 0.4 * (blowing - wind)
        hot_for = hot_for + STEP if current > CURRENT_LIMIT else 0.0
        guard_works = not (fault and time > 30.0)
        is_cut = guard_works and (is_cut or hot_for >= GUARD_PATIENCE) and wind > 2 * BREEZE
        overheats = not guard_works and hot_for >= 3.0 and wind > 2 * BREEZE
        demand = _demand(event, wind)
        current += 0.5 * ((12.0 if is_cut else 27.0 if overheats else demand) - current)
        is_silent = fault and SILENCE[0] <= time + STEP / 2 < SILENCE[1]
        yield Sample(time, wind, current, event if time - began < STEP / 2 else '', is_silent)


def _demand(event: str, wind: float) -> float:
    """Return the current that the flight asks for: thrust, and more against the wind."""
    if event in ('on the ground, propellers turning', 'landed'):
        return 3.0
    return (14.0 if event == 'take-off' else 11.0) + 0.9 * max(0.0, wind - BREEZE)


class Quadrotor(Node):
    """Flies once, from its making to the end of `fly`."""

    def __init__(self) -> None:
        """Read the parameters and advertise."""
        super().__init__('quadrotor')
        self._fault: bool = self.declare_parameter('fault', False).value
        self._log: str = self.declare_parameter('log', '').value
        self._speed: float = self.declare_parameter('speed', 1.0).value
        is_simulated = self._speed != 1.0
        self._time = self.create_publisher(Clock, '/clock', 10) if is_simulated else None
        self._wind = self.create_publisher(Float32, 'windspeed', DEPTH)
        self._current = self.create_publisher(Float32, 'motor/current', DEPTH)

    def fly(self) -> None:
        """Publish the flight, once there are subscriptions."""
        self._wait_for_listeners()
        start = monotonic()
        for sample in fly(self._fault):
            self._say(sample)
            self._wait_until(start, sample.time)
            self._send(sample, sample.time, self._wind, sample.wind)
            # Between the two, so that all messages are equally far apart
            self._wait_until(start, sample.time + STEP / 2)
            self._send(sample, sample.time + STEP / 2, self._current, sample.current)

    def _wait_until(self, start: float, time: float) -> None:
        sleep(max(0.0, start + time / self._speed - monotonic()))
        self._set_clock(time)

    def _set_clock(self, time: float) -> None:
        if self._time is not None:
            tenths = round(10 * (TAKES_OFF_AT + time))
            self._time.publish(Clock(clock=Time(
                sec=tenths // 10, nanosec=tenths % 10 * 100_000_000)))

    def _wait_for_listeners(self, patience: float = 15.0) -> None:
        start = monotonic()
        while monotonic() - start < patience:
            topics = (self._wind, self._current, self._time)
            if all(item is None or item.get_subscription_count() for item in topics):
                self._stand()
                return
            sleep(0.1)
        self.get_logger().warning('no subscription; flying anyway')

    def _stand(self) -> None:
        """Let the subscribers know the time before the first message."""
        end = monotonic() + MATCH_S
        while monotonic() < end:
            self._set_clock(0.0)
            sleep(0.1)

    def _say(self, sample: Sample) -> None:
        event = f'   {sample.event}' if sample.event else ''
        print(f'{sample.time:5.1f} s   wind {sample.wind:5.2f} m/s   '
              f'current {sample.current:5.2f} A{event}', flush=True)

    def _send(self, sample: Sample, time: float, publisher: Publisher, value: float) -> None:
        if sample.is_silent:
            return
        message = Float32(data=value)
        publisher.publish(message)
        if self._log:
            with open(self._log, 'a', encoding='utf-8') as file:
                file.write(f'{time:.1f},{publisher.topic_name},{message.data!r}\n')


def main() -> int:
    """Fly once, or until a signal comes."""
    rclpy.init(args=sys.argv)
    try:
        node = Quadrotor()
        node.fly()
        # Let the last messages out
        node._current.wait_for_all_acked()
        node.destroy_node()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()
    return 0


if __name__ == '__main__':
    sys.exit(main())
