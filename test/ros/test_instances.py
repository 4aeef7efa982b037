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
import subprocess
from time import time_ns
from typing import Any

from bag.recordings import START, statuses_of, TYPES
from bundles import write_bundle
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from differential.compiled import unoptimised
from fret_monitor.bag.check import check_recording, Selection
from fret_monitor.bag.violations import open_violations
from fret_monitor.native import ros_files
import numpy
import pytest
from rcl_interfaces.srv import GetParameters
from rclpy.qos import DurabilityPolicy
from ros.exported import exported_bundle, running
from ros.harness import (
    BEST_EFFORT, LATCHED, NodeProcess, Partner, PATIENCE, RELIABLE, started, wait_until,
)
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from std_msgs.msg import Bool, Float32, String
from strategies import thorough

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


def reports_after(faces: Sequence[Face], n: int) -> list[Statuses]:
    """Return the statuses of all nodes once so many details have come from each."""
    for face in faces:
        wait_until(partial(face.has_details, n), f'{n} details of {face.name}')
    return [face.next_report() for face in faces]


def values_of(status: DiagnosticStatus) -> dict[str, str]:
    return {item.key: item.value for item in status.values}


def random_elements(rng: Random, keys: Sequence[str], n: int) -> list[Elements]:
    """Return random messages; the last one violates EFFORT for the first key."""
    found = [(round(rng.uniform(0.4, 1.4), 2), tuple(
        (rng.choice(keys), round(rng.uniform(0, 1.8), 2)) for _ in range(rng.randrange(4))))
        for _ in range(n)]
    return [*found, (0.5, ((keys[0], 1.75),))]


def recorded(folder: Path, sent: Sequence[Elements], times: Sequence[int],
             topic: str = '/joints', frames: Sequence[str] = ()) -> Path:
    """Record messages that are received at their stamps."""
    types, nothing = TYPES.types, numpy.array([])
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection(topic, JOINT_STATE, typestore=TYPES)
        for place, (time, (limit, elements)) in enumerate(zip(times, sent, strict=True)):
            stamp = types['builtin_interfaces/msg/Time'](*divmod(time, 10**9))
            content = types[JOINT_STATE](
                types['std_msgs/msg/Header'](stamp, frames[place] if frames else ''),
                [key for key, _ in elements], numpy.array([limit]), nothing,
                numpy.array([value for _, value in elements]))
            writer.write(connection, time, TYPES.serialize_cdr(content, JOINT_STATE))
    return folder


def judged_by_bag(out: Path, bundle: Path, recording: Path) -> list[Detail]:
    """Return the details that `bag --mcap` writes of a recording."""
    with unoptimised(), open_violations(out, '/') as mcap:
        check_recording(bundle, recording, Selection(may_miss=True), changes=[mcap])
    return [detail_of(status) for _, status in statuses_of(out)]


def joint_state(limit: float, elements: Sequence[tuple[str, float]]) -> Any:
    return sensor_msgs.JointState(
        name=[key for key, _ in elements], position=array('d', [limit]),
        effort=array('d', [value for _, value in elements]))


@pytest.mark.parametrize('keys', ['{most: 3}', '[elbow, "k%s\\n", wrist]'])
def test_both_nodes_publish_of_instances_what_bag_says(
        keys: str, partner: Partner, tmp_path: Path) -> None:
    rng = Random(keys)
    names = ('elbow', 'k%s\n', 'wrist', 'beyond', '')
    bundle = write_bundle(tmp_path, JOINTS.replace('KEYS', keys))
    sent = random_elements(rng, names, 50)
    expected = judged_by_bag(tmp_path / 'out.mcap', bundle, recorded(
        tmp_path / 'bag', sent, [START + place * 10**8 for place in range(len(sent))]))
    publisher = partner.publisher(sensor_msgs.JointState, '/joints', LATCHED)
    with both(bundle, partner) as faces:
        wait_until(partial(are_subscribed, partner, '/joints'), '/joints of both nodes')
        for item in sent:
            publisher.publish(joint_state(*item))
        reports = reports_after(faces, len(expected))
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
        assert output.count('messages with a key of joint are not evaluated: a key has 1 to 255 '
                            'bytes') == ('most' in keys)
        for name in {name for name, level, *_ in expected if level > 0}:
            assert f'{name} violated at ' in output


def is_published(subscription: Any) -> bool:
    return int(subscription.get_publisher_count()) > 0


def are_subscribed(partner: Partner, topic: str, n: int = 1) -> bool:
    """
    Whether both nodes have so many subscriptions each, by which nothing is lost.

    They receive what is published from now on, also where they discover the publisher later.
    """
    found = partner.node.get_subscriptions_info_by_topic(topic)
    return sorted(item.node_namespace for item in found) == (
        ['/native'] * n + ['/python'] * n) and all(
        item.qos_profile.durability is DurabilityPolicy.TRANSIENT_LOCAL for item in found)


FLEET = """
format: 1
for_each: {robot: {most: 20, forget: 60}}
inputs:
  speed: {topic: "/{robot}/speed", type: std_msgs/msg/Float32}
  enabled: {topic: /enable, type: std_msgs/msg/Bool}
definitions: {fast: speed > 0.5}
actions: {say: {publish: {topic: said, type: std_msgs/msg/Bool, message: {data: true}}}}
requirements:
  - id: SPEED
    fretish: when enabled the robot shall always satisfy speed <= 1.0
    on_violation: [say]
  - {id: FLEET, ptltl: "count(robot: fast) <= 1", report: onset}
"""
LAST = """\
  - {id: LAST, ptltl: "speed <= 1.2 | count(robot: speed < 1.0) <= 1", report: onset}
"""


def drives(publisher: Any, face: Face, robots: int) -> bool:
    """Publish, and return whether a report then knows so many robots; for lossy publishers."""
    publisher.publish(Float32(data=0.4))
    return has_instances(face, robots)


def test_a_robot_that_joins_is_monitored_by_name_without_a_restart(
        partner: Partner, tmp_path: Path) -> None:
    bundle = write_bundle(tmp_path, FLEET + LAST)
    enable = partner.publisher(Bool, '/enable', LATCHED)
    enable.publish(Bool(data=True))
    partner.publisher(Bool, '/crane/speed')
    alpha = partner.publisher(Float32, '/alpha/speed', LATCHED)
    with both(bundle, partner, '-p', f'blackbox:={tmp_path / "box"}') as faces:
        alpha.publish(Float32(data=0.4))
        beta = partner.publisher(Float32, '/beta/speed', BEST_EFFORT)
        for face in faces:
            wait_until(partial(drives, beta, face, 2), f'two robots at {face.name}')
            assert face.details == []
        partner.publisher(Float32, '/gamma/speed', LATCHED).publish(Float32(data=1.5))
        for face in faces:
            wait_until(partial(face.has_details, 2), f'details of {face.name}')
            report = face.next_report()
            for name in ('SPEED', 'LAST'):
                assert report[name].message == 'violated: gamma'
                assert values_of(report[name])['instances'] == '3'
            assert report['FLEET'].message == 'satisfied'
            assert values_of(report['action say'])['started'] == '1'
            assert values_of(report['topic /{robot}/speed'])['publishers'] == '3'
            face.process.wait_for('SPEED[robot=gamma] violated at ')
            face.process.wait_for('/crane/speed is of type std_msgs/msg/Bool, where the bundle '
                                  'says std_msgs/msg/Float32 of /{robot}/speed')
            assert face.process.output.count('/crane/speed is of type') == 1
    assert faces[0].details == faces[1].details
    (name, level, _, values), (last, _, _, read) = faces[0].details
    assert (name, level, last) == ('SPEED[robot=gamma]', 2, 'LAST[robot=gamma]')
    assert ('speed', '1.5') in values
    assert ('enabled', 'true') in values
    assert ('count(robot: speed < 1.0)', '2') in read
    for number, face in enumerate(faces):
        box, = (tmp_path / 'box').glob(f'blackbox_*_{face.name}_fret_monitor_SPEED.mcap')
        assert judged_by_bag(tmp_path / f'out_{number}.mcap', bundle, box) == face.details
        with Reader(box) as reader:  # a player advertises them
            assert [item.topic for item in reader.connections if '{' in item.topic] == []


FAILING = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <string.h>

// Each function fails at its first call for this topic, as one of a middleware may.
#define FAILS_ONCE(NAME, PARAMETERS, ARGUMENTS, TOPIC, FAILURE) \
  __attribute__((visibility("default"))) long NAME PARAMETERS { \
    static int n; \
    if (strcmp(TOPIC, "/beta/speed") == 0 && __atomic_fetch_add(&n, 1, __ATOMIC_SEQ_CST) == 0) { \
      return FAILURE; \
    } \
    void * library = dlopen(RMW, RTLD_LAZY | RTLD_NOLOAD); \
    long (* real) PARAMETERS = (long (*) PARAMETERS)dlsym(library, #NAME); \
    return real ARGUMENTS; \
  }

FAILS_ONCE(rmw_create_subscription,
  (void * a, void * b, const char * topic, void * c, void * d), (a, b, topic, c, d), topic, 0)
FAILS_ONCE(rmw_count_publishers, (void * a, const char * topic, void * b), (a, topic, b), topic, 1)
FAILS_ONCE(rmw_get_publishers_info_by_topic,
  (void * a, void * b, const char * topic, _Bool c, void * d), (a, b, topic, c, d), topic, 1)
FAILS_ONCE(rmw_send_response, (void * a, void * b, void * c), (a, b, c), "/beta/speed", 1)
FAILS_ONCE(rmw_get_node_names,
  (void * a, void * b, void * c), (a, b, c), "/beta/speed", 1)
"""


def test_a_robot_joins_although_the_middleware_fails_once(
        partner: Partner, tmp_path: Path) -> None:
    bundle, library = write_bundle(tmp_path, FLEET), tmp_path / 'failing.so'
    (tmp_path / 'failing.c').write_text(FAILING, encoding='utf-8')
    subprocess.run(
        ['gcc', f'-DRMW="lib{ros_files.rmw_library()}.so"', '-shared', '-fPIC', '-w',
         tmp_path / 'failing.c', '-o', library, '-ldl'], check=True)
    environment = {'LD_PRELOAD': str(library), 'ASAN_OPTIONS': 'verify_asan_link_order=0'}
    program = exported_bundle(bundle)
    partner.publisher(Bool, '/enable', LATCHED).publish(Bool(data=True))
    with ExitStack() as held:
        faces = [Face(name, held.enter_context(process), partner) for name, process in (
            ('python', started('monitor', '-p', f'spec:={bundle}', '-r', '__ns:=/python',
                               environment=environment, is_anew=True)),
            ('native', running(program, '-r', '__ns:=/native', environment=environment)))]
        for face in faces:
            face.wait_for_publishers()
        partner.publisher(Float32, '/beta/speed', LATCHED).publish(Float32(data=1.5))
        for face in faces:
            face.process.wait_for('cannot subscribe to /beta/speed as std_msgs/msg/Float32: ')
            face.process.wait_for('SPEED[robot=beta] violated at ')
            report = face.next_report()
            assert report['SPEED'].message == 'violated: beta'
            assert 'failed' not in ''.join(item.message for item in report.values())
            assert face.process.output.count('cannot subscribe') == 1
            assert partner.reset(f'/{face.name}/fret_monitor/reset').startswith('restarted')
            face.process.wait_for(' is not sent: ')


def test_listed_keys_are_known_from_the_start_and_a_reset_starts_all_afresh(
        partner: Partner, tmp_path: Path) -> None:
    bundle = write_bundle(
        tmp_path, FLEET.replace('{most: 20, forget: 60}', '[alpha, beta]'))
    partner.publisher(Bool, '/enable', LATCHED).publish(Bool(data=True))
    alpha = partner.publisher(Float32, '/alpha/speed', LATCHED)
    with both(bundle, partner) as faces:
        alpha.publish(Float32(data=1.5))
        for face in faces:
            wait_until(partial(has_message, face, 'violated: alpha'), f'alpha at {face.name}')
            face.process.wait_for('SPEED[robot=alpha] violated at ')
            answer = partner.reset(f'/{face.name}/fret_monitor/reset')
            assert answer == 'restarted 3 step groups; input values kept'
            wait_until(partial(has_message, face, 'not evaluated yet: alpha, beta'),
                       f'a reset of {face.name}')
            face.process.wait_for('SPEED satisfied again')
        alpha.publish(Float32(data=0.3))
        for face in faces:
            wait_until(partial(has_message, face, 'not evaluated yet: beta'),
                       f'alpha anew at {face.name}')


def has_message(face: Face, message: str) -> bool:
    return str(face.next_report(1)['SPEED'].message) == message


TRACKS = """
format: 1
evaluation: {policy: relevant_message}
for_each: {track: {most: 5}}
inputs:
  near: {topic: /tracks, type: JOINTS, where: "header.frame_id = {track}", field: "position[0]"}
  imu: {topic: /tracks, type: JOINTS, where: "header.frame_id = imu", field: "position[0]"}
requirements:
  - {id: NEAR, ptltl: "near >= 0.6", report: onset}
  - {id: CALM, ptltl: "imu < 1.0", report: onset}
""".replace('JOINTS', JOINT_STATE)


def test_messages_that_where_selects_are_those_of_the_input_or_of_a_key(
        partner: Partner, tmp_path: Path) -> None:
    rng = Random(5)
    bundle = write_bundle(tmp_path, TRACKS)
    sent: list[Elements] = [(round(rng.uniform(0.4, 1.4), 2), ()) for _ in range(40)]
    frames = rng.choices(['imu', 'a', 'b'], k=len(sent))
    expected = judged_by_bag(tmp_path / 'out.mcap', bundle, recorded(
        tmp_path / 'bag', sent, [START + place * 10**8 for place in range(len(sent))],
        '/tracks', frames))
    assert {name for name, *_ in expected} == {
        'CALM', *(f'NEAR[track={key}]' for key in ('imu', 'a', 'b'))}
    publisher = partner.publisher(sensor_msgs.JointState, '/tracks', LATCHED)
    with both(bundle, partner) as faces:
        wait_until(partial(are_subscribed, partner, '/tracks', 2), '/tracks of both nodes')
        for item, frame in zip(sent, frames, strict=True):
            message = joint_state(*item)
            message.header.frame_id = frame
            publisher.publish(message)
        reports = reports_after(faces, len(expected))
    for face, report in zip(faces, reports, strict=True):
        assert sorted(face.details, key=name_of) == sorted(expected, key=name_of)
        received = values_of(report['topic /tracks where header.frame_id = imu'])['received']
        assert int(received) == frames.count('imu')


def name_of(detail: Detail) -> str:
    return detail[0]


STAMPED = """
format: 1
evaluation: {policy: timed, stamp: header, reorder: 5}
for_each: {joint: {most: 3, forget: 0.4}}
inputs:
  effort: {topic: /joints, type: sensor_msgs/msg/JointState, field: "effort[name = {joint}]"}
  limit: {topic: /joints, type: sensor_msgs/msg/JointState, field: "position[0]"}
requirements:
  - {id: EFFORT, ptltl: "effort <= limit", report: onset}
  - {id: SOON, fretish: if effort > 1.2 the joint shall within 0.2 seconds satisfy effort < 0.6}
  - {id: FLEET, ptltl: "count(joint: effort > 1.0) <= 1", report: onset}
"""


@thorough
@pytest.mark.parametrize('seed', range(3))
def test_instances_that_come_end_and_return_have_the_verdicts_of_bag(
        seed: int, partner: Partner, tmp_path: Path) -> None:
    rng = Random(seed)
    bundle = write_bundle(tmp_path, STAMPED)
    names = ('elbow', 'wrist', 'hip', 'beyond')
    publisher = partner.publisher(sensor_msgs.JointState, '/joints', LATCHED)
    with both(bundle, partner) as faces:
        wait_until(partial(are_subscribed, partner, '/joints'), '/joints of both nodes')
        # Of stamps that are not late: nothing takes effect for 5 s.
        stamps = [time_ns()]
        while len(stamps) <= 60:
            stamps.append(stamps[-1] + rng.choice((10**7, 5 * 10**7, 3 * 10**8)))
        sent = random_elements(rng, names, len(stamps) - 1)
        for stamp, item in zip(stamps, sent, strict=True):
            message = joint_state(*item)
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
            publisher.publish(message)
        expected = judged_by_bag(
            tmp_path / 'out.mcap', bundle, recorded(tmp_path / 'bag', sent, stamps))
        assert any(('the instance', 'ended') in values for *_, values in expected)
        reports = reports_after(faces, len(expected))
    for face, report in zip(faces, reports, strict=True):
        # The node goes on after the last message: deadlines come, and the last instances end.
        assert [*map(without_start, face.details[:len(expected)])] == [
            *map(without_start, expected)]
        values = values_of(report['EFFORT'])
        assert int(values['began']) > 3
        assert values['ended'] != '0'


def without_start(detail: Detail) -> Detail:
    """Return a detail of FLEET, which has begun with the node, without its time since then."""
    name, level, message, values = detail
    return name, level, message, values[name == 'FLEET':]


@thorough
def test_five_hundred_robots_join_within_a_second(partner: Partner, tmp_path: Path) -> None:
    bundle = write_bundle(tmp_path, FLEET.replace('most: 20', 'most: 500'))
    partner.publisher(Bool, '/enable', LATCHED).publish(Bool(data=True))
    with both(bundle, partner) as faces:
        publishers = [partner.publisher(Float32, f'/robot_{number}/speed', LATCHED)
                      for number in range(500)]
        for place, publisher in enumerate(publishers):
            publisher.publish(Float32(data=1.5 if place == 321 else 0.2))
        for face in faces:
            wait_until(partial(has_instances, face, 500), f'500 robots at {face.name}',
                       4 * PATIENCE)
            assert has_message(face, 'violated: robot_321')
    for face in faces:
        assert [name for name, *_ in face.details] == ['SPEED[robot=robot_321]']


@thorough
def test_a_subscription_ends_after_its_last_publisher_and_begins_anew(
        partner: Partner, tmp_path: Path) -> None:
    bundle = write_bundle(tmp_path, FLEET)
    partner.publisher(Bool, '/enable', LATCHED).publish(Bool(data=True))
    with both(bundle, partner) as faces:
        for n in range(2):
            publisher = partner.publisher(Float32, '/gamma/speed', LATCHED)
            publisher.publish(Float32(data=1.5))
            for face in faces:
                wait_until(partial(face.has_details, n + 1), f'violation {n} at {face.name}')
            partner.node.destroy_publisher(publisher)
            wait_until(partial(has_no_subscription, partner, '/gamma/speed'), 'an end')


def has_no_subscription(partner: Partner, topic: str) -> bool:
    return not partner.node.get_subscriptions_info_by_topic(topic)


def has_instances(face: Face, n: int) -> bool:
    return values_of(face.next_report(1)['SPEED'])['instances'] == str(n)


SILENT = """
format: 1
for_each: {robot: {most: 4}}
inputs:
  speed: {topic: "/{robot}/speed", type: std_msgs/msg/Float32, timeout: 1, stale: violate}
requirements:
  - {id: SPEED, ptltl: "speed <= 1.0", report: onset}
"""


def test_the_silence_of_a_robot_violates_its_instance_until_its_next_message(
        partner: Partner, tmp_path: Path) -> None:
    publishers = [partner.publisher(Float32, f'/{robot}/speed', LATCHED)
                  for robot in ('alpha', 'beta')]
    for publisher in publishers:
        publisher.publish(Float32(data=0.5))
    with both(write_bundle(tmp_path, SILENT), partner) as faces:
        for face in faces:
            for robot in ('alpha', 'beta'):
                wait_until(partial(has_detail, face, robot, is_over=False),
                           f'the silence of {robot} at {face.name}')
        publishers[0].publish(Float32(data=0.5))
        for face in faces:
            wait_until(partial(has_detail, face, 'alpha', is_over=True),
                       f'the end of the silence at {face.name}')
            assert not has_detail(face, 'beta', is_over=True)
            assert all(('silent', 'speed') in values for _, level, _, values in face.details
                       if level == 2)


def has_detail(face: Face, robot: str, is_over: bool) -> bool:
    return any(name == f'SPEED[robot={robot}]' and (level == 0) is is_over
               for name, level, _, _ in face.details)


ACTING = """
format: 1
for_each: {robot: {most: 20, forget: 60}}
inputs:
  speed: {topic: "/{robot}/speed", type: std_msgs/msg/Float32}
actions:
  tell:
    publish: {topic: told, type: std_msgs/msg/String, message: {data: "stop {robot}!"}, rate: 5}
  free:
    publish:
      topic: freed
      type: sensor_msgs/msg/JointState
      message: {header: {frame_id: "{robot}/base"}, name: ["{robot}"], position: [1.5]}
      rate: 5
      for: 60
  ask:
    call:
      service: ask
      type: rcl_interfaces/srv/GetParameters
      request: {names: ["{robot}", x]}
requirements:
  - {id: SPEED, ptltl: "speed <= 1.0", report: onset, on_violation: [tell, ask], on_end: [free]}
"""


class Told:
    """What the actions of a face send."""

    def __init__(self, face: Face, partner: Partner) -> None:
        self.told: list[str] = []
        self.freed: list[Any] = []
        self.asked: set[tuple[str, ...]] = set()
        node, space = partner.node, f'/{face.name}/'
        node.create_subscription(String, space + 'told', self._take_told, RELIABLE)
        node.create_subscription(
            sensor_msgs.JointState, space + 'freed', self.freed.append, RELIABLE)
        node.create_service(GetParameters, space + 'ask', self._answer)

    def _take_told(self, message: String) -> None:
        self.told.append(message.data)

    def _answer(self, request: Any, response: Any) -> Any:
        self.asked.add(tuple(request.names))
        return response

    def is_told_of(self, *robots: str) -> bool:
        return {*self.told} == {f'stop {robot}!' for robot in robots} and self.asked == {
            (robot, 'x') for robot in robots}


def test_an_action_with_a_key_is_one_of_each_instance(partner: Partner, tmp_path: Path) -> None:
    bundle = write_bundle(tmp_path, ACTING)
    publishers = [partner.publisher(Float32, f'/{robot}/speed', LATCHED)
                  for robot in ('alpha', 'b')]
    with both(bundle, partner) as faces:
        found = [Told(face, partner) for face in faces]
        for publisher in publishers:
            publisher.publish(Float32(data=1.5))
        for face, told in zip(faces, found, strict=True):
            wait_until(partial(told.is_told_of, 'alpha', 'b'), f'actions of {face.name}')
            report = face.next_report()
            assert values_of(report['action tell'])['started'] == '2'
            assert values_of(report['action ask'])['started'] == '2'
            assert values_of(report['action free'])['started'] == '0'
        publishers[1].publish(Float32(data=0.5))
        for face, told in zip(faces, found, strict=True):
            wait_until(partial(len_is, told.freed, 1), f'the end of b at {face.name}')
            assert (told.freed[0].header.frame_id, [*told.freed[0].name]) == ('b/base', ['b'])
            assert [*told.freed[0].position] == [1.5]
            assert told.freed[0].header.stamp.sec > 0
            told.told.clear()
            wait_until(partial(len_is, told.told, 6), f'messages of {face.name}')
            assert {*told.told[3:]} == {'stop alpha!'}


def len_is(found: Sequence[Any], least: int) -> bool:
    return len(found) >= least
