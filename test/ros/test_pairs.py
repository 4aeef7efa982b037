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

"""Requirements of pairs on both nodes: they publish and log what `bag` says of the messages."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from random import Random

from bag.recordings import START, TYPES
from bundles import write_bundle
import numpy
import pytest
from ros.harness import LATCHED, Partner, RELIABLE, wait_until
from ros.test_instances import (
    are_subscribed, both, Detail, Elements, Face, JOINT_STATE, joint_state, judged_by_bag,
    random_elements, reports_after, sensor_msgs, values_of,
)
from rosbags.rosbag2 import StoragePlugin, Writer
from std_msgs.msg import String
from strategies import thorough

ARMS = """
format: 1
evaluation: {policy: relevant_message}
for_each:
  robot: ROBOTS
  joint: {most: 3}
inputs:
  effort: {topic: "/{robot}/joints", type: TYPE, field: "effort[name = {joint}]"}
  limit: {topic: "/{robot}/joints", type: TYPE, field: "position[0]"}
actions:
  stop: {lock: {topic: e_stop, rate: 5}}
  tell:
    publish:
      {topic: told, type: std_msgs/msg/String, message: {data: "{joint} of {robot}!"}, rate: 5}
requirements:
  - {id: EFFORT, title: weak, ptltl: "effort <= limit", report: onset, on_violation: [stop, tell]}
  - {id: RESTS, ptltl: "H (O[0, 3] (effort < 0.6))", report: occurrence, severity: warn}
  - {id: LIMIT, ptltl: "limit <= 1.3", report: onset}
  - {id: MOST, ptltl: "max(robot, joint: effort) < 2.0", report: onset}
""".replace('TYPE', JOINT_STATE)
ROBOTS = ('alpha', 'beta')


def recorded(folder: Path, sent: Sequence[tuple[str, Elements]]) -> Path:
    """Record messages of robots."""
    types, nothing = TYPES.types, numpy.array([])
    with Writer(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = {robot: writer.add_connection(
            f'/{robot}/joints', JOINT_STATE, typestore=TYPES) for robot in ROBOTS}
        for place, (robot, (limit, elements)) in enumerate(sent):
            time = START + place * 10**8
            content = types[JOINT_STATE](
                types['std_msgs/msg/Header'](
                    types['builtin_interfaces/msg/Time'](*divmod(time, 10**9)), ''),
                [key for key, _ in elements], numpy.array([limit]), nothing,
                numpy.array([value for _, value in elements]))
            writer.write(connections[robot], time, TYPES.serialize_cdr(content, JOINT_STATE))
    return folder


def of_robot(details: Sequence[Detail], robot: str) -> list[Detail]:
    return [item for item in details if f'robot={robot}' in item[0]]


@pytest.mark.parametrize('robots', [
    '[alpha, beta]', pytest.param('{most: 3}', marks=thorough)])
def test_both_nodes_publish_of_pairs_what_bag_says(
        robots: str, partner: Partner, tmp_path: Path) -> None:
    rng = Random(robots)
    names = ('elbow', 'k%s\n', 'wrist', 'beyond')
    bundle = write_bundle(tmp_path, ARMS.replace('ROBOTS', robots))
    sent = [(rng.choice(ROBOTS), item) for item in random_elements(rng, names, 60)]
    sent.append((ROBOTS[0], (0.5, (('elbow', 2.5),))))
    expected = judged_by_bag(tmp_path / 'out.mcap', bundle, recorded(tmp_path / 'bag', sent))
    assert {name for name, *_ in expected} > {
        'EFFORT[robot=alpha,joint=elbow]', 'RESTS[robot=beta,joint=wrist]', 'LIMIT[robot=alpha]',
        'MOST'}
    publishers = {robot: partner.publisher(sensor_msgs.JointState, f'/{robot}/joints', LATCHED)
                  for robot in ROBOTS}
    with both(bundle, partner) as faces:
        told = [told_by(face, partner) for face in faces]
        for robot in ROBOTS:
            wait_until(partial(are_subscribed, partner, f'/{robot}/joints'),
                       f'/{robot}/joints of both nodes')
        for robot, item in sent:
            publishers[robot].publish(joint_state(*item))
        reports = reports_after(faces, len(expected))
        for face, found in zip(faces, told, strict=True):
            wait_until(partial(found.__contains__, 'elbow of alpha!'), f'told of {face.name}')
        outputs = [face.process.output for face in faces]
    for face in faces:
        check_details(face, expected)
    assert {*told[0], *told[1]} <= {f'{name} of {robot}!' for name in names for robot in ROBOTS}
    for report, output in zip(reports, outputs, strict=True):
        effort, values = report['EFFORT'], values_of(report['EFFORT'])
        assert effort.message.startswith('violated: ')
        assert 'alpha/elbow' in effort.message
        assert values['instances'] == '6'
        assert values['beyond most'] != '0'
        assert report['lock stop'].message == 'locked: violated: EFFORT'
        assert ', for each robot and joint, at most ' in output
        assert 'there is no room for another joint in pairs of robot and joint (`most` is 3): ' \
            in output
        assert 'EFFORT[robot=alpha,joint=elbow] violated at ' in output
        assert 'MOST violated at ' in output


def told_by(face: Face, partner: Partner) -> list[str]:
    """Return what an action tells from now on."""
    found: list[str] = []

    def take(message: String) -> None:
        found.append(message.data)

    partner.node.create_subscription(String, f'/{face.name}/told', take, RELIABLE)
    return found


def check_details(face: Face, expected: Sequence[Detail]) -> None:
    """Messages of two robots may overtake each other."""
    for robot in ROBOTS:
        assert of_robot(face.details, robot) == of_robot(expected, robot)
