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

"""`bag` with instance variables: its table, JSON, JUnit, CSV, MCAP, and what it refuses."""

from csv import DictReader
from decimal import Decimal
from io import StringIO
import json
from pathlib import Path
from random import Random
from typing import Any

from bag.recordings import START, statuses_of, TYPES, verdicts_of, write
from cli.command import Here
import fret_monitor
import numpy
import pytest
from rosbags.interfaces import Nodetype
from rosbags.rosbag2 import StoragePlugin, Writer

ROOT = Path(fret_monitor.__file__).resolve().parents[1]
FLEET_TYPES = {'speed': 'nav_msgs/msg/Odometry', 'charge': 'sensor_msgs/msg/BatteryState',
               'people_near': 'std_msgs/msg/Bool'}

FLEET = """\
format: 1
for_each:
  robot: {most: 3, forget: 0.25}
inputs:
  speed: {topic: "{robot}/speed", type: std_msgs/msg/Float64}
requirements:
  - {id: SPEED, ptltl: speed <= 1.0}
  - {id: FLEET, ptltl: "count(robot: speed > 0.5) <= 1"}
"""
RUN = [('/ns/alpha/speed', 0, 0.6), ('/ns/beta/speed', 10**8, 1.5),
       ('/ns/beta/speed', 2 * 10**8, 0.2), ('/ns/beta/speed', 3 * 10**8, 1.6),
       ('/ns/gamma/speed', 5 * 10**8, 1.2), ('/ns/delta/speed', 6 * 10**8, 0.1),
       ('/ns/eps/speed', 6 * 10**8, 0.1), ('/ns/zeta/speed', 6 * 10**8, 9.0),
       ('/elsewhere/speed', 6 * 10**8, 9.0), ('/ns/alpha/speed', 8 * 10**8, 1.1)]


@pytest.fixture
def fleet(tmp_path: Path) -> tuple[str, str]:
    file = tmp_path / 'fleet.yaml'
    file.write_text(FLEET)
    path = write(tmp_path / 'run', RUN)
    return str(file), str(path)


def test_the_table_and_the_line_of_json_name_the_violated_instances(
        here: Here, fleet: tuple[str, str]) -> None:
    done = here.run('bag', *fleet, '--namespace', '/ns')
    assert done.status == 1  # a key found no room
    assert '1 message with a key of robot for which `most: 3` leaves no room' in done.err
    lines = done.out.splitlines()
    assert lines[1] == 'robot: 6 instances, 3 ended, 0 of them open'
    assert [line.split()[:3] for line in lines[3:]] == [
        ['SPEED', 'VIOLATED', '4'], ['SPEED[robot=alpha]', 'VIOLATED', '1'],
        ['SPEED[robot=beta]', 'VIOLATED', '2'], ['SPEED[robot=gamma]', 'VIOLATED', '1'],
        ['FLEET', 'VIOLATED', '2']]
    found = json.loads(here.run('bag', *fleet, '--namespace', '/ns', '--json').out)
    assert [*found['requirements']['SPEED']['instances']] == ['alpha', 'beta', 'gamma']
    assert found['instances'] == {
        'robot': {'began': 6, 'ended': 3, 'ended_open': 0, 'beyond': 1}}


def test_junit_names_the_violated_instances(here: Here, fleet: tuple[str, str]) -> None:
    here.run('bag', *fleet, '--namespace', '/ns', '--junit',
             here.folder / 'out.xml')
    assert 'violated 4 times, first at 1700000000.100000000, by alpha, beta, gamma' in (
        here.folder / 'out.xml').read_text()


def test_a_row_of_csv_has_the_key_of_what_changed(here: Here, fleet: tuple[str, str]) -> None:
    here.run('bag', *fleet, '--namespace', '/ns', '--csv', here.folder / 'out.csv')
    heading, *rows = (here.folder / 'out.csv').read_text().splitlines()
    assert heading == 'time,robot,SPEED,FLEET'
    assert [row.removeprefix('1700000000.').replace('0' * 7, '') for row in rows] == [
        '00,,,1', '10,beta,0,1', '10,,,0', '20,beta,1,0', '20,,,1', '30,beta,0,1', '50,gamma,0,1',
        '50,,,0', '55,beta,,0', '60,,,1', '75,gamma,,1', '80,alpha,0,1']


def test_the_recording_of_violations_names_the_instances(
        here: Here, fleet: tuple[str, str]) -> None:
    out = here.folder / 'out.mcap'
    here.run('bag', *fleet, '--namespace', '/ns', '--mcap', out)
    found = statuses_of(out)
    assert [((time - START) // 10**7, item.name, item.level) for time, item in found] == [
        (10, 'SPEED[robot=beta]', 2), (10, 'FLEET', 2), (20, 'SPEED[robot=beta]', 0),
        (20, 'FLEET', 0), (30, 'SPEED[robot=beta]', 2), (50, 'SPEED[robot=gamma]', 2),
        (50, 'FLEET', 2), (55, 'SPEED[robot=beta]', 0), (60, 'FLEET', 0),
        (75, 'SPEED[robot=gamma]', 0), (80, 'SPEED[robot=alpha]', 2)]
    (_, first), (_, of_all) = found[:2]
    assert (first.message, of_all.message) == (
        'speed <= 1.0', 'count(robot: speed > 0.5) <= 1')
    assert [(item.key, item.value) for item in first.values] == [
        ('step', '0'), ('stamp', '1700000000.100000000'), ('suppressed', '0'), ('silent', ''),
        ('speed', '1.5')]
    assert [item.value for item in of_all.values][4:] == ['2']
    assert [(item.key, item.value) for item in found[7][1].values][4:] == [
        ('speed', '1.6'), ('the instance', 'ended')]
    # True while no instance violates it.
    assert [((time - START) // 10**7, verdict)
            for time, verdict in verdicts_of(out)['/ns/copilot/verdict/SPEED']] == [
        (0, True), (10, False), (20, True), (30, False), (75, True), (80, False), (80, False)]


def test_a_key_is_shown_without_what_cannot_be_shown(here: Here) -> None:
    file = here.file('tracks.yaml', """\
format: 1
for_each: {track: {most: 9}}
inputs:
  x: {topic: /x, type: geometry_msgs/msg/PointStamped, where: "header.frame_id = {track}",
      field: point.x}
requirements: [{id: NEAR, ptltl: x > 1.0}]
""")
    kind, types = 'geometry_msgs/msg/PointStamped', TYPES.types
    message = TYPES.serialize_cdr(types[kind](
        types['std_msgs/msg/Header'](types['builtin_interfaces/msg/Time'](0, 0), 'K' * 9),
        types['geometry_msgs/msg/Point'](0.0, 0.0, 0.0)), kind)
    path, out = here.folder / 'run', here.folder / 'out.mcap'
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection('/x', kind, typestore=TYPES)
        for key in (b'%s%n\n"\xc3\xa9\xff', b'\xe2\x82\xac\xc2\x85\x7f\xed\xa0\xc3'):
            assert len(key) == 9
            writer.write(connection, START, bytes(message).replace(b'K' * 9, key))
    assert here.run('bag', file, path, '--mcap', out).status == 0
    assert [item.name for _, item in statuses_of(out)] == [
        'NEAR[track=%s%n?"\u00e9?]', 'NEAR[track=\u20ac??????]']


def blank(kind: str) -> Any:
    """Return a message whose numbers are 0, and whose arrays are empty."""
    made = dict[str, Any]()
    fields: Any = TYPES.fielddefs[kind][1]
    for name, (node, what) in fields:
        match node:
            case Nodetype.BASE:
                made[name] = '' if what[0] == 'string' else False if what[0] == 'bool' else 0
            case Nodetype.NAME:
                made[name] = blank(what)
            case Nodetype.ARRAY:
                made[name] = numpy.zeros(what[1], what[0][1][0])
            case _:
                made[name] = numpy.array([]) if what[0][0] is Nodetype.BASE and \
                    what[0][1][0] != 'string' else []
    return TYPES.types[kind](**made)


def fleet_message(name: str, value: float) -> Any:
    """Return a message that has a value of an input of the fleet."""
    if name == 'people_near':
        return TYPES.types['std_msgs/msg/Bool'](bool(value))
    message = blank(FLEET_TYPES[name])
    if name == 'speed':
        message.twist.twist.linear.x = value
    else:
        message.percentage = value
    return message


def test_the_bundle_of_a_fleet_judges_a_recording_as_the_same_values_in_a_table(
        here: Here) -> None:
    file = ROOT / 'config' / 'fleet.yaml'
    if not file.is_file():
        pytest.skip('needs the source tree')
    assert here.run('check', file).status == 0
    rng, rows = Random(31), list[tuple[int, str, str, float]]()  # time, robot, input, value
    for step in range(200):
        rows += [(step * 10**8, '', 'people_near', step == 90)] * (step % 30 == 0)
        rows += [(step * 10**8 + number, robot, 'speed',
                  0.9 if robot == 'beta' and 85 < step < 150 else
                  rng.choice((0.0, 0.25, 0.5, 0.9, 0.9, 1.01 if step > 150 else 0.2)))
                 for number, robot in enumerate(('alpha', 'beta', 'gamma'), 1)
                 if robot != 'gamma' or 50 < step < 90 or rng.random() < 0.2]
        rows += [(step * 10**8 + 9, 'beta', 'charge', 0.1)] * (step == 20)
    trace = here.file('fleet.csv', 'time,robot,speed,charge,people_near\n' + ''.join(
        f'{time / 1e9:.9f},{robot},' + ','.join(
            f'{value:g}' if name == input_ else '' for name in FLEET_TYPES) + '\n'
        for time, robot, input_, value in rows))
    topics = {'speed': 'odom', 'charge': 'battery_state', 'people_near': 'people_near'}
    with Writer(here.folder / 'bag', version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = dict[str, Any]()
        for time, robot, name, value in rows:
            topic = f'/{robot}/{topics[name]}'.replace('//', '/')
            if topic not in connections:
                connections[topic] = writer.add_connection(
                    topic, FLEET_TYPES[name], typestore=TYPES)
            writer.write(connections[topic], START + time, TYPES.serialize_cdr(
                fleet_message(name, value), FLEET_TYPES[name]))
    done = here.run('bag', file, here.folder / 'bag', '--csv', here.folder / 'out.csv')
    assert done.status == 0, done.err
    of_bag = first_violations((here.folder / 'out.csv').read_text(), START)
    assert of_bag == first_violations(here.run('simulate', file, '--trace', trace).out, 0)
    assert {name for _, name in of_bag} == {'ROBOT-001', 'ROBOT-002', 'FLEET-002'}
    assert {robot for robot, _ in of_bag} == {'', 'alpha', 'beta'}


def first_violations(table: str, start: int) -> dict[tuple[str, str], int]:
    """Return when each requirement is first violated, by robot, in ns since the start."""
    found = dict[tuple[str, str], int]()
    for row in DictReader(StringIO(table)):
        time = int(Decimal(row['time']) * 10**9) - start
        for name, cell in row.items():
            robot = row['robot'] if name.startswith('ROBOT') else ''
            if cell == '0' and name not in ('time', 'robot'):
                found.setdefault((robot, name), time)
    return found


PAIRS = """
format: 1
for_each: {robot: {most: 2}, person: {most: 3}}
inputs:
  distance: {topic: "/{robot}/people", type: geometry_msgs/msg/PointStamped,
             where: "header.frame_id = {person}", field: point.x}
requirements: [{id: SLOW, ptltl: distance < 2.0}]
"""


def test_of_pairs_the_variable_is_named_whose_most_leaves_no_room(
        here: Here, tmp_path: Path) -> None:
    bundle, trace = tmp_path / 'pairs.yaml', tmp_path / 'trace.csv'
    bundle.write_text(PAIRS)
    keys = [('a', 'p'), ('a', 'q'), ('b', 'r'), ('c', 'p'), ('a', 's'), ('c', 't'), ('c', 'q'),
            ('b', 'p'), ('a', 253 * 'x'), ('aa', 254 * 'x')]
    trace.write_text('robot,person,distance\n' + ''.join(
        f'{robot},{person},1\n' for robot, person in keys), encoding='utf-8')
    done = here.run('simulate', bundle, '--trace', trace)
    assert done.err.splitlines() == [
        "1 row of keys of 'robot and person' not evaluated: a key has 1 to 255 bytes",
        "3 rows of keys of 'robot' beyond most: 2 not evaluated",
        "2 rows of keys of 'person' beyond most: 3 not evaluated"]
    found = [line.split(': ', 2)[2] for line in here.run('bag', bundle, trace).err.splitlines()
             if line.startswith('error: ')]
    assert found == [
        '1 message with a key of robot and person not evaluated: a key has 1 to 255 bytes',
        '3 messages with a key of robot, in pairs of robot and person, for which `most: 2` leaves '
        'no room: not evaluated',
        '2 messages with a key of person, in pairs of robot and person, for which `most: 3` '
        'leaves no room: not evaluated']
