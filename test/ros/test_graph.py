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

"""Nodes, publishers and subscribers of the graph as inputs, in both nodes."""

from pathlib import Path
from typing import Any

from bundles import write_bundle
from fret_monitor.bag.check import check_recording, Selection
import pytest
from ros.exported import monitoring, NODES
from ros.harness import Partner, RELIABLE, wait_until
from std_msgs.msg import Float32
from strategies import thorough

diagnostic_msgs = pytest.importorskip('diagnostic_msgs.msg')

BUNDLE = """
format: 1
inputs:
  alive: {node: /robot/controller, startup: 5}
  never: {node: never, startup: 5}
  scans: {publishers: scan, startup: 5}
  heard: {subscribers: /speed, startup: 5}
  speed: {topic: /speed, type: std_msgs/msg/Float32}
evaluation: {policy: relevant_message}
requirements:
  - {id: ALIVE, ptltl: alive}
  - {id: NEVER, ptltl: never}
  - {id: ONE, ptltl: scans = 1}
  - {id: HEARD, ptltl: heard != 1}
  - {id: SPEED, ptltl: speed < 1}
"""
IDS = ('ALIVE', 'NEVER', 'ONE', 'HEARD')


@pytest.mark.parametrize('kind', NODES)
def test_what_comes_and_goes_in_the_graph_is_seen(
        partner: Partner, domain: int, tmp_path: Path, kind: str) -> None:
    statuses: dict[str, Any] = {}

    def take(array: Any) -> None:
        statuses.update({item.name.partition(': ')[2]: (item.level, item.message, {
            pair.key: pair.value for pair in item.values}) for item in array.status})

    def expect(name: str, text: str, seen: int, level: bytes = b'\0') -> None:
        wait_until(lambda: name in statuses and (
            *statuses[name][:2], statuses[name][2]['seen']) == (level, text, str(seen)),
            f'{name}: {text}, {seen}')

    partner.node.create_subscription(diagnostic_msgs.DiagnosticArray, '/diagnostics', take, 10)
    partner.listen(*IDS, prefix='/robot/copilot/handlerprop', publishers=0)
    speed = partner.publisher(Float32, '/speed', RELIABLE)
    with monitoring(kind, write_bundle(tmp_path, BUNDLE), '-r', '__ns:=/robot',
                    '-r', 'scan:=lidar', '-p', f'blackbox:={tmp_path / "box"}') as process:
        partner.wait_for_listener(speed)  # this node's own subscription is not counted
        process.wait_for('node never: nothing is there since the start')
        expect('graph node never', 'never seen', 0, b'\1')
        expect('graph subscribers of /speed', 'never seen', 0, b'\1')
        partner.expect({'ALIVE': 1, 'NEVER': 1, 'ONE': 1})
        for life in (1, 2):  # it is started again
            controller = Partner(domain, '/robot')
            other = controller.node.context
            named = _named(controller)
            scan = controller.publisher(Float32, 'lidar', RELIABLE)
            expect('graph node /robot/controller', 'there', 1)
            expect('graph publishers of scan', 'there', 1)
            second = controller.publisher(Float32, '/robot/lidar', RELIABLE)
            expect('graph publishers of scan', 'there', 2)
            controller.node.destroy_publisher(second)
            expect('graph publishers of scan', 'there', 1)
            listener = controller.node.create_subscription(
                Float32, '/speed', lambda _: None, RELIABLE)
            expect('graph subscribers of /speed', 'there', 1)
            controller.node.destroy_subscription(listener)
            expect('graph subscribers of /speed', 'not there any more', 0)
            named.destroy_node()
            controller.close()
            assert scan is not None and other is not None
            expect('graph node /robot/controller', 'not there any more', 0)
            expect('graph publishers of scan', 'not there any more', 0)
            partner.expect({'ALIVE': 1 + life, 'NEVER': 1, 'ONE': 1 + 2 * life, 'HEARD': life})
    written, *_ = sorted((tmp_path / 'box').glob('*.mcap'))
    found = check_recording(write_bundle(tmp_path, BUNDLE), written, Selection(
        may_miss=True, namespace='/robot'))
    assert found.errors == ()
    assert all(item.violations for item in found.findings if item.id in ('ALIVE', 'NEVER', 'ONE'))


WAITED = """
format: 1
inputs:
  late: {node: late, startup: 8, initial: true}
  heard: {subscribers: cmd, startup: 8, initial: 7}
  here: {node: /partner, timeout: 2, stale: violate}
  scans: {publishers: scan, startup: 2, timeout: 2, stale: violate}
  speed: {topic: /speed, type: std_msgs/msg/Float32}
evaluation: {policy: relevant_message}
requirements:
  - {id: LATE, ptltl: late}
  - {id: HEARD, ptltl: heard = 7}
  - {id: EARLY, ptltl: late & heard = 7 -> speed < 1}
  - {id: HERE, ptltl: here}
  - {id: SCANS, ptltl: scans < 9}
"""


@thorough
@pytest.mark.parametrize('kind', NODES)
def test_startup_initial_values_and_timeouts_mean_what_they_mean_for_topics(
        partner: Partner, tmp_path: Path, kind: str) -> None:
    def wait_for(**expected: int) -> None:
        wait_until(lambda: all(partner.heard[name] == number
                               for name, number in expected.items()), f'{expected}')

    speed = partner.publisher(Float32, '/speed', RELIABLE)
    partner.listen('LATE', 'HEARD', 'EARLY', 'HERE', 'SCANS', publishers=0,
                   prefix='/robot/copilot/handlerprop')
    with monitoring(kind, write_bundle(tmp_path, WAITED), '-r', '__ns:=/robot') as process:
        partner.wait_for_listener(speed)
        speed.publish(Float32(data=2.0))
        wait_for(EARLY=1, HERE=1, SCANS=1)
        scan = partner.publisher(Float32, '/robot/scan', RELIABLE)
        wait_for(SCANS=2)
        partner.node.destroy_publisher(scan)
        process.wait_for('node late: nothing is there since the start')
        speed.publish(Float32(data=2.0))
        partner.expect({'LATE': 1, 'HEARD': 1, 'EARLY': 1, 'HERE': 1, 'SCANS': 3})


def _named(partner: Partner) -> Any:
    """Make a second node with the name that the bundle has."""
    from rclpy.node import Node
    return Node('controller', namespace='/robot', context=partner.context)
