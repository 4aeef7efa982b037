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
Bundles of config/ and programs of examples/ with a simulated robot.

A requirement of a bundle holds while the robot works, and is violated by a fault.
"""

from collections.abc import Callable
from math import inf, nan
import os
from pathlib import Path
import re
import subprocess
import sys
from time import sleep
from typing import Any

import fret_monitor
import pytest
from ros.harness import Partner, PATIENCE, started, wait_until
from std_msgs.msg import Bool

geometry_msgs = pytest.importorskip('geometry_msgs.msg')
nav_msgs = pytest.importorskip('nav_msgs.msg')
sensor_msgs = pytest.importorskip('sensor_msgs.msg')

SOURCE = Path(fret_monitor.__file__).resolve().parent.parent
CONFIG = SOURCE / 'config'
if not CONFIG.is_dir():
    pytest.skip('needs the source tree', allow_module_level=True)


class Robot:
    """Publishes the messages of its sensors and controllers at a fixed rate."""

    def __init__(self, partner: Partner) -> None:
        self.partner = partner
        self.time = 0.0
        self.says: list[Callable[[], None]] = []

    def go_on(self, seconds: float) -> None:
        """Publish the current values for some seconds."""
        for _ in range(round(seconds / 0.05)):
            self._say()

    def keeps(self, seconds: float) -> None:
        """Publish the current values for some seconds, without a violation."""
        self.partner.heard.clear()
        self.go_on(seconds)
        assert not self.partner.heard

    def until(self, handler: str) -> None:
        """Publish until this requirement, and no other, is violated."""
        self.partner.heard.clear()

        def is_heard() -> bool:
            self._say()
            return bool(self.partner.heard)

        wait_until(is_heard, handler, PATIENCE)
        self.go_on(0.5)
        assert list(self.partner.heard) == [handler]

    def _say(self) -> None:
        self.time += 0.05
        for say in self.says:
            say()
        sleep(0.05)


class Base(Robot):
    """A mobile base."""

    def __init__(self, partner: Partner) -> None:
        super().__init__(partner)
        self.speed, self.turning, self.nearest, self.commanded = 0.3, 0.0, 2.0, 0.3
        self.ranges: list[float] | None = None
        scan = partner.publisher(sensor_msgs.LaserScan, 'scan')
        odometry = partner.publisher(nav_msgs.Odometry, 'odom')
        commands = partner.publisher(geometry_msgs.Twist, 'cmd_vel')
        self.publishers = (scan, odometry, commands)
        self.says = [
            lambda: scan.publish(sensor_msgs.LaserScan(
                ranges=self.ranges or [5.0, self.nearest, inf])),
            lambda: odometry.publish(self._odometry()),
            lambda: commands.publish(geometry_msgs.Twist(
                linear=geometry_msgs.Vector3(x=0.0, y=self.commanded, z=0.0)))]

    def _odometry(self) -> Any:
        message = nav_msgs.Odometry()
        message.header.stamp.sec, message.header.stamp.nanosec = divmod(
            round(self.time * 1e9), 10**9)
        message.twist.twist.linear.x = -self.speed
        message.twist.twist.angular.z = self.turning
        return message


def test_a_mobile_base_violates_each_requirement_by_its_fault(partner: Partner) -> None:
    handlers = ('BASE_001', 'BASE_002', 'BASE_003', 'BASE_004')

    def afresh() -> Base:
        base.speed, base.turning, base.nearest, base.commanded = 0.3, 0.0, 2.0, 0.3
        base.go_on(0.5)
        partner.reset()
        base.go_on(0.5)
        return base

    with started('monitor', '-p', f'spec:={CONFIG / "mobile_base.yaml"}'):
        partner.listen(*handlers)
        base = Base(partner)
        partner.wait_for_listener(*base.publishers)
        afresh().keeps(3.0)
        base.speed = 0.7
        base.until('BASE_001')
        afresh().turning = -1.6
        base.until('BASE_001')
        afresh().nearest = 0.3
        base.until('BASE_002')
        afresh().commanded = 0.0
        base.until('BASE_003')
        afresh().time -= 2.0
        base.until('BASE_004')
        # It stopped on command, and was commanded to drive on before two seconds were over
        afresh().commanded = 0.0
        base.go_on(0.5)
        base.commanded = 0.3
        base.speed = base.nearest = 0.0
        base.keeps(2.5)


def test_a_mobile_base_whose_scan_stops_violates_the_requirements_on_it(
    partner: Partner,
) -> None:
    with started('monitor', '-p', f'spec:={CONFIG / "mobile_base.yaml"}'):
        partner.listen('BASE_001', 'BASE_002', 'BASE_003', 'BASE_004')
        base = Base(partner)
        partner.wait_for_listener(*base.publishers)
        base.go_on(1.0)
        base.says = base.says[1:]
        base.until('BASE_002')


def test_a_mobile_base_whose_scans_hold_only_nan_counts_as_blocked(partner: Partner) -> None:
    with started('monitor', '-p', f'spec:={CONFIG / "mobile_base.yaml"}'):
        partner.listen('BASE_001', 'BASE_002', 'BASE_003', 'BASE_004')
        base = Base(partner)
        partner.wait_for_listener(*base.publishers)
        base.go_on(1.0)
        base.ranges = [5.0, nan, nan]
        base.keeps(2.0)
        base.ranges = [nan] * 3
        base.until('BASE_002')


class Arm(Robot):
    """An arm of six joints."""

    def __init__(self, partner: Partner) -> None:
        super().__init__(partner)
        self.position, self.velocity, self.effort = [0.0] * 6, [0.0] * 6, [1.0] * 6
        self.stop = False
        states = partner.publisher(sensor_msgs.JointState, 'joint_states')
        stops = partner.publisher(Bool, 'emergency_stop')
        self.publishers = (states, stops)
        self.says = [
            lambda: states.publish(sensor_msgs.JointState(
                name=[f'joint_{place}' for place in range(len(self.position))],
                position=self.position, velocity=self.velocity, effort=self.effort)),
            lambda: stops.publish(Bool(data=self.stop))]


def test_an_arm_violates_each_requirement_by_its_fault(partner: Partner) -> None:
    def afresh() -> Arm:
        arm.position, arm.velocity, arm.effort = [0.0] * 6, [0.0] * 6, [1.0] * 6
        arm.stop = False
        arm.go_on(0.5)
        partner.reset()
        arm.go_on(0.2)
        return arm

    with started('monitor', '-p', f'spec:={CONFIG / "arm.yaml"}'):
        partner.listen(*(f'ARM_00{place}' for place in range(1, 7)))
        arm = Arm(partner)
        partner.wait_for_listener(*arm.publishers)
        arm.go_on(1.0)
        arm.velocity[4] = -1.0
        arm.keeps(1.0)
        arm.position[2] = -2.8
        arm.until('ARM_001')
        afresh().velocity[5] = -3.5
        arm.until('ARM_002')
        afresh().velocity[1] = nan
        arm.until('ARM_002')
        # It comes to rest in time, and moves while the button is still pressed
        afresh().velocity[0] = 0.5
        arm.go_on(0.5)
        arm.stop = True
        arm.go_on(0.05)
        arm.velocity[0] = 0.0
        arm.keeps(1.0)
        arm.velocity[3] = 0.5
        arm.until('ARM_004')
        afresh().effort = [80.0] * 6
        arm.until('ARM_005')
        afresh().position = [0.0] * 5
        arm.until('ARM_006')


def test_an_arm_that_does_not_stop_is_a_violation(partner: Partner) -> None:
    with started('monitor', '-p', f'spec:={CONFIG / "arm.yaml"}'):
        partner.listen('ARM_003')
        arm = Arm(partner)
        partner.wait_for_listener(*arm.publishers)
        arm.velocity[1] = 1.0
        arm.go_on(0.5)
        arm.stop = True
        arm.until('ARM_003')


def test_a_monitor_in_a_program_of_its_own_closes_the_valve(domain: int) -> None:
    done = subprocess.run(
        [sys.executable, str(SOURCE / 'examples' / 'tank.py')], timeout=60, text=True,
        capture_output=True, check=False,
        env={**os.environ, 'PYTHONPATH': os.pathsep.join([str(SOURCE), *sys.path])})
    told = f'{done.stdout}{done.stderr}'
    assert (done.returncode, 'Traceback' in told) == (0, False), told
    level = re.search('the valve is closed at a level of ([0-9.]+)', told)
    assert level is not None, told
    assert float(level[1]) > 0.9
