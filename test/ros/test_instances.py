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

"""Bundles with `for_each` on both nodes: they publish and log what `bag` says of the messages."""

from array import array
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, ExitStack
from functools import partial
from pathlib import Path
from random import Random
from typing import Any

from bag.recordings import START, statuses_of, TYPES
from bundles import write_bundle
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from differential.compiled import unoptimised
from fret_monitor.bag.check import check_recording, Selection
from fret_monitor.bag.violations import open_violations
import numpy
import pytest
from rclpy.qos import DurabilityPolicy
from ros.exported import exported_bundle, running
from ros.harness import (
    BEST_EFFORT, LATCHED, NodeProcess, Partner, RELIABLE, started, wait_until,
)
from rosbags.rosbag2 import StoragePlugin, Writer
from std_msgs.msg import Bool, Float32

sensor_msgs = pytest.importorskip('sensor_msgs.msg')

Detail = tuple[str, int, str, tuple[tuple[str, str], ...]]
"""Name, level, message, and the values but for the stamp."""

Statuses = dict[str, DiagnosticStatus]

JOINTS = """
format: 1
for_each: {joint: KEYS}
inputs:
  effort: {topic: /joints, type: sensor_msgs/msg/JointState, field: "effort[name = {joint}]"}
  limit: {topic: /joints, type: sensor_msgs/msg/JointState, field: "position[0]"}
actions: {stop: {lock: {topic: e_stop, rate: 5}}}
requirements:
  - {id: EFFORT, title: weak, ptltl: "effort <= limit", report: onset, on_violation: [stop]}
  - {id: RESTS, ptltl: "H (O[0, 3] (effort < 0.6))", report: occurrence, severity: warn}
  - {id: FLEET, ptltl: "count(joint: effort > 1.0) <= 1", report: onset}
"""
JOINT_STATE = 'sensor_msgs/msg/JointState'
Elements = tuple[float, tuple[tuple[str, float], ...]]
"""The shared value of a message, and its elements: a key and a value each."""


def detail_of(status: Any) -> Detail:
    level = status.level if isinstance(status.level, int) else status.level[0]
    return status.name, level, status.message, tuple(
        (item.key, item.value) for item in status.values if item.key != 'stamp')


class Face:
    """One of the nodes: what it publishes and logs."""

    def __init__(self, name: str, process: NodeProcess, partner: Partner) -> None:
        self.name, self.process = name, process
        self.details: list[Detail] = []
        self.locks: list[bool] = []
        self.reports: list[DiagnosticArray] = []
        make = partner.node.create_subscription
        self._made = [
            make(DiagnosticArray, f'/{name}/copilot/violations', self._take, RELIABLE),
            make(Bool, f'/{name}/e_stop', self._lock, RELIABLE)]
        make(DiagnosticArray, '/diagnostics', self._report, 10)

    def wait_for_publishers(self) -> None:
        for item in self._made[:1]:
            wait_until(partial(is_published, item), item.topic_name)

    def _lock(self, message: Bool) -> None:
        self.locks.append(message.data)

    def has_details(self, n: int) -> bool:
        """Whether so many have come."""
        return len(self.details) >= n

    def _take(self, array: DiagnosticArray) -> None:
        self.details += map(detail_of, array.status)

    def _report(self, array: DiagnosticArray) -> None:
        if array.status[0].name.startswith(f'{self.name}/'):
            self.reports.append(array)

    def next_report(self, more: int = 2) -> Statuses:
        """Return the statuses of a report that is made from now on; their names are short."""
        before = len(self.reports)
        wait_until(lambda: len(self.reports) >= before + more, f'a report of {self.name}')
        return {item.name.partition(': ')[2]: item for item in self.reports[-1].status}


@contextmanager
def both(bundle: Path, partner: Partner, *arguments: str) -> Iterator[tuple[Face, Face]]:
    """Run both nodes, each in a namespace of its own."""
    program = exported_bundle(bundle)
    with ExitStack() as held:
        ours = held.enter_context(started(
            'monitor', '-p', f'spec:={bundle}', '-r', '__ns:=/python', *arguments))
        theirs = held.enter_context(running(program, '-r', '__ns:=/native', *arguments))
        faces = (Face('python', ours, partner), Face('native', theirs, partner))
        for face in faces:
            face.wait_for_publishers()
        yield faces


def values_of(status: DiagnosticStatus) -> dict[str, str]:
    return {item.key: item.value for item in status.values}


def random_elements(rng: Random, keys: Sequence[str], n: int) -> list[Elements]:
    """Return random messages; the last one violates EFFORT for the first key."""
    found = [(round(rng.uniform(0.4, 1.4), 2), tuple(
        (rng.choice(keys), round(rng.uniform(0, 1.8), 2)) for _ in range(rng.randrange(4))))
        for _ in range(n)]
    return [*found, (0.5, ((keys[0], 1.75),))]


def judged_by_bag(folder: Path, bundle: Path, sent: Sequence[Elements]) -> list[Detail]:
    """Return the details that `bag --mcap` writes of the same messages."""
    types, nothing = TYPES.types, numpy.array([])
    header = types['std_msgs/msg/Header'](types['builtin_interfaces/msg/Time'](0, 0), '')
    with Writer(folder / 'bag', version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection('/joints', JOINT_STATE, typestore=TYPES)
        for place, (limit, elements) in enumerate(sent):
            content = types[JOINT_STATE](
                header, [key for key, _ in elements], numpy.array([limit]), nothing,
                numpy.array([value for _, value in elements]))
            writer.write(connection, START + place * 10**8,
                         TYPES.serialize_cdr(content, JOINT_STATE))
    out = folder / 'out.mcap'
    with unoptimised(), open_violations(out, '/') as mcap:
        check_recording(bundle, folder / 'bag', Selection(may_miss=True), changes=[mcap])
    return [detail_of(status) for _, status in statuses_of(out)]


def joint_state(limit: float, elements: Sequence[tuple[str, float]]) -> Any:
    return sensor_msgs.JointState(
        name=[key for key, _ in elements], position=array('d', [limit]),
        effort=array('d', [value for _, value in elements]))


@pytest.mark.parametrize('keys', ['{most: 3}', '[elbow, "k%s\\n", wrist]'])
def test_both_nodes_publish_of_instances_what_bag_says(
        keys: str, partner: Partner, tmp_path: Path) -> None:
    rng = Random(keys)
    names = ('elbow', 'k%s\n', 'wrist', 'beyond')
    bundle = write_bundle(tmp_path, JOINTS.replace('KEYS', keys))
    sent = random_elements(rng, names, 50)
    expected = judged_by_bag(tmp_path, bundle, sent)
    publisher = partner.publisher(sensor_msgs.JointState, '/joints', LATCHED)
    with both(bundle, partner) as faces:
        wait_until(partial(are_subscribed, partner, '/joints'), '/joints of both nodes')
        for item in sent:
            publisher.publish(joint_state(*item))
        for face in faces:
            wait_until(partial(face.has_details, len(expected)),
                       f'{len(expected)} details of {face.name}')
        reports = [face.next_report() for face in faces]
        outputs = [face.process.output for face in faces]
    for face in faces:
        assert face.details == expected
        assert True in face.locks
    shown = [{name: (item.level, item.message, {
        key: value for key, value in values_of(item).items() if key not in ('rate', 'behind')})
        for name, item in report.items()} for report in reports]
    assert shown[0] == shown[1]
    effort = reports[0]['EFFORT']
    assert effort.message.startswith('violated: ')
    assert 'elbow' in effort.message
    values = values_of(effort)
    assert (values['instances'], values['began'], values['ended']) == ('3', '3', '0')
    assert (values['beyond most'] != '0') == ('most' in keys)
    assert reports[0]['lock stop'].message == 'locked: violated: EFFORT'
    for output in outputs:
        assert output.count('there is no room for another joint (`most` is 3)') == (
            'most' in keys)
        for name in {name for name, level, *_ in expected if level > 0}:
            assert f'{name} violated at ' in output


def is_published(subscription: Any) -> bool:
    return int(subscription.get_publisher_count()) > 0


def are_subscribed(partner: Partner, topic: str) -> bool:
    """
    Whether both nodes have one subscription each, by which nothing is lost.

    They receive what is published from now on, also where they discover the publisher later.
    """
    found = partner.node.get_subscriptions_info_by_topic(topic)
    return sorted(item.node_namespace for item in found) == ['/native', '/python'] and all(
        item.qos_profile.durability is DurabilityPolicy.TRANSIENT_LOCAL for item in found)


FLEET = """
format: 1
for_each: {robot: {most: 20, forget: 60}}
inputs:
  speed: {topic: "/{robot}/speed", type: std_msgs/msg/Float32}
  enabled: {topic: /enable, type: std_msgs/msg/Bool}
definitions: {fast: speed > 0.5}
requirements:
  - {id: SPEED, fretish: when enabled the robot shall always satisfy speed <= 1.0}
  - {id: FLEET, ptltl: "count(robot: fast) <= 1", report: onset}
"""


def drives(publisher: Any, face: Face, robots: int) -> bool:
    """Publish, and return whether a report then knows so many robots; for lossy publishers."""
    publisher.publish(Float32(data=0.4))
    return values_of(face.next_report(1)['SPEED'])['instances'] == str(robots)


def test_a_robot_that_joins_is_monitored_by_name_without_a_restart(
        partner: Partner, tmp_path: Path) -> None:
    bundle = write_bundle(tmp_path, FLEET)
    enable = partner.publisher(Bool, '/enable', LATCHED)
    enable.publish(Bool(data=True))
    partner.publisher(Bool, '/crane/speed')
    alpha = partner.publisher(Float32, '/alpha/speed', LATCHED)
    with both(bundle, partner) as faces:
        alpha.publish(Float32(data=0.4))
        beta = partner.publisher(Float32, '/beta/speed', BEST_EFFORT)
        for face in faces:
            wait_until(partial(drives, beta, face, 2), f'two robots at {face.name}')
            assert face.details == []
        partner.publisher(Float32, '/gamma/speed', LATCHED).publish(Float32(data=1.5))
        for face in faces:
            wait_until(partial(face.has_details, 1), f'a detail of {face.name}')
            report = face.next_report()
            assert report['SPEED'].message == 'violated: gamma'
            assert values_of(report['SPEED'])['instances'] == '3'
            assert report['FLEET'].message == 'satisfied'
            assert values_of(report['topic /{robot}/speed'])['publishers'] == '3'
            face.process.wait_for('SPEED[robot=gamma] violated at ')
            face.process.wait_for('/crane/speed is of type std_msgs/msg/Bool, where the bundle '
                                  'says std_msgs/msg/Float32 of /{robot}/speed')
            assert face.process.output.count('/crane/speed is of type') == 1
    assert faces[0].details == faces[1].details
    (name, level, _, values), = faces[0].details
    assert (name, level) == ('SPEED[robot=gamma]', 2)
    assert ('speed', '1.5') in values
    assert ('enabled', 'true') in values
