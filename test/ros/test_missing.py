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

"""What the monitor reports about inputs without messages, or with unusable ones."""

from pathlib import Path
from time import sleep
from typing import Any

from bundles import write_bundle
import pytest
from ros.harness import Partner, started, wait_until
from std_msgs.msg import Bool, String

diagnostic_msgs = pytest.importorskip('diagnostic_msgs.msg')
sensor_msgs = pytest.importorskip('sensor_msgs.msg')

SCAN = """
format: 1
inputs:
  front: {topic: scan, type: sensor_msgs/msg/LaserScan, field: "ranges[180]"}
  state: {topic: state, type: std_msgs/msg/String, values: {IDLE: "idle", GO: "go"}}
  wind: {topic: windspeed, type: std_msgs/msg/Float32}
requirements:
  - {id: ROS-001, ptltl: "wind < 8.0"}
  - {id: ROS-002, ptltl: "front > 1.0 | state = GO"}
"""


def test_unusable_and_missing_values_are_reported_once(
    partner: Partner, tmp_path: Path,
) -> None:
    bundle = write_bundle(tmp_path, SCAN)
    heard: list[Any] = []
    partner.node.create_subscription(
        diagnostic_msgs.DiagnosticArray, '/diagnostics', heard.append, 10)

    def told() -> list[tuple[str, bytes, str]]:
        return [(item.name.partition(': ')[2], item.level, item.message)
                for item in heard[0].status]

    def is_told(name: str, level: bytes, message: str) -> None:
        """Wait for a report with this, which may say something else a second later."""
        def is_next() -> bool:
            while len(heard) > 1 and (name, level, message) not in told():
                del heard[0]
            return bool(heard) and (name, level, message) in told()

        wait_until(is_next, f'{name}: {message}')

    with started('monitor', '-p', f'spec:={bundle}') as node:
        scan = partner.publisher(sensor_msgs.LaserScan, 'scan')
        state = partner.publisher(String, 'state')
        partner.wait_for_listener(scan, state)
        state.publish(String(data='go'))
        sleep(0.2)
        for _ in range(3):
            scan.publish(sensor_msgs.LaserScan(ranges=[2.0] * 100))
            state.publish(String(data='broken'))
        is_told('topic /scan', b'\1', 'fields cannot be used: front')
        is_told('topic /state', b'\1', 'fields cannot be used: state')
        is_told('topic /scan', b'\0', 'received')
        node.wait_for('/scan: ranges[180] cannot be read (the array has 100 elements); '
                      "input 'front' has no value yet")
        node.wait_for("/state: data is 'broken', which is not among its values in the bundle; "
                      "input 'state' keeps its value")
        node.wait_for(
            'ROS-001, ROS-002 are not evaluated yet: nothing usable received on /scan '
            "(1 publisher) for 'front'; nothing received on /windspeed (0 publishers) for 'wind'")
        scan.publish(sensor_msgs.LaserScan(ranges=[2.0] * 100))
        is_told('topic /scan', b'\1', 'fields cannot be used: front')
        sleep(6.0)
        assert node.output.count('cannot be read') == 1
        assert node.output.count('which is not among') == 1
        assert node.output.count('not evaluated yet') == 1


STOP = """
format: 1
inputs:
  estop: {topic: e_stpo, type: std_msgs/msg/Bool, initial: false}
  held: {topic: held, type: std_msgs/msg/Bool, initial: true}
requirements:
  - {id: CMD, ptltl: "!estop"}
  - {id: HELD, ptltl: held}
"""


def test_a_requirement_that_rests_on_initial_values_is_reported(
    partner: Partner, tmp_path: Path,
) -> None:
    bundle = write_bundle(tmp_path, STOP)
    heard: list[Any] = []
    partner.node.create_subscription(
        diagnostic_msgs.DiagnosticArray, '/diagnostics', heard.append, 10)

    def is_told(name: str, level: bytes, message: str) -> bool:
        return any(item.name == f'fret_monitor: {name}' and (item.level, item.message)
                   == (level, message) for item in (heard[-1].status if heard else ()))

    with started('monitor', '-p', f'spec:={bundle}', '-p', 'policy:=relevant_message') as node:
        held = partner.publisher(Bool, 'held')
        partner.wait_for_listener(held)
        held.publish(Bool(data=True))
        wait_until(lambda: is_told('CMD', b'\1', 'not evaluated yet')
                   and is_told('HELD', b'\0', 'satisfied'), 'who is evaluated')
        node.wait_for('CMD is not evaluated yet: nothing received on /e_stpo (0 publishers) '
                      "for 'estop' (it has its initial value)")


def test_the_first_line_of_the_log_has_the_period(partner: Partner, tmp_path: Path) -> None:
    bundle = write_bundle(tmp_path, SCAN)
    with started('monitor', '-p', f'spec:={bundle}', '-p', 'policy:=periodic',
                 '-p', 'rate:=20.0') as node:
        node.wait_for('policy periodic, 0.05 s, ')
