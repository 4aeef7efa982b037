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

"""Gates of a bundle with instance variables: those of the bundle with the key in its place."""

from pathlib import Path

from bundles import write_bundle
from fret_monitor.build import gate_names, read
from fret_monitor.elaboration.restrict import restrict
from fret_monitor.logic.formula import postorder, Variable
from fret_monitor.logic.specification import Specification
from fret_monitor.model.diagnostics import CompileError
from fret_monitor.model.parts import NodePart
import pytest

FLEET = """
format: 1
for_each: {robot: KEYS, zone: [near, far]}
evaluation: {policy: POLICY}
inputs:
  speed: {topic: "/{robot}/raw", type: std_msgs/msg/Float32}
  close: {topic: "/{robot}/close", type: std_msgs/msg/Bool, timeout: 1}
  room: {topic: "/{zone}/room", type: std_msgs/msg/Float64, timeout: 1}
  own: {topic: shared, type: std_msgs/msg/String, where: "data = {robot}", values: {A: a}}
  limit: {topic: limit, type: std_msgs/msg/Float32, timeout: 1}
actions:
  stop: {lock: {topic: stop}}
definitions:
  fast: speed > limit
requirements:
  - {id: SLOW, ptltl: "H (close -> !fast)", report: occurrence}
  - {id: OWN, ptltl: "own = A -> Y (speed <= 1.0)"}
  - {id: ROOM, ptltl: "room >= 0.5 | limit < 0.5"}
  - {id: FEW, ptltl: "count(robot: fast) <= 1"}
gates:
  drive:
    {from: "/{robot}/raw", to: "{robot}/cmd", type: std_msgs/msg/Float32, keep: [SLOW, OWN],
    otherwise: {hold: 1}}
  cap: {from: limit, to: limited, type: std_msgs/msg/Float32, keep: [ROOM], otherwise: drop}
"""
PLAIN = """
format: 1
evaluation: {policy: POLICY}
inputs:
  speed: {topic: /KEY/raw, type: std_msgs/msg/Float32}
  close: {topic: /KEY/close, type: std_msgs/msg/Bool, timeout: 1}
  room_near: {topic: /near/room, type: std_msgs/msg/Float64, timeout: 1}
  room_far: {topic: /far/room, type: std_msgs/msg/Float64, timeout: 1}
  own: {topic: shared, type: std_msgs/msg/String, where: "data = KEY", values: {A: a}}
  limit: {topic: limit, type: std_msgs/msg/Float32, timeout: 1}
requirements:
  - {id: SLOW, ptltl: "H (close -> !(speed > limit))", report: occurrence}
  - {id: OWN, ptltl: "own = A -> Y (speed <= 1.0)"}
  - {id: NEAR, ptltl: "room_near >= 0.5 | limit < 0.5"}
  - {id: FAR, ptltl: "room_far >= 0.5 | limit < 0.5"}
gates:
  drive:
    {from: /KEY/raw, to: KEY/cmd, type: std_msgs/msg/Float32, keep: [SLOW, OWN],
    otherwise: {hold: 1}}
  cap: {from: limit, to: limited, type: std_msgs/msg/Float32, keep: [NEAR, FAR], otherwise: drop}
"""
POLICIES = ('relevant_message', 'timed')


def fleet(folder: Path, text: str = FLEET, policy: str = POLICIES[0]) -> Path:
    return write_bundle(folder, text.replace('KEYS', '[alpha, beta]').replace('POLICY', policy))


def part(path: Path, name: str) -> Specification:
    return restrict(read(path, takes_instances=True).specification, NodePart(name))


def meaning(specification: Specification) -> tuple[object, ...]:
    """Return all that the monitor of a gate is made of, but for names of requirements."""
    gate = specification.gate
    assert gate is not None
    return (specification.signals, specification.policy, gate.settings.source,
            gate.settings.target, gate.settings.otherwise, gate.settings.hold,
            [(item.formula, item.feedback, item.report) for item in specification.properties])


@pytest.mark.parametrize('policy', POLICIES)
@pytest.mark.parametrize('key', ['alpha', 'beta'])
def test_a_gate_for_each_key_is_the_gate_of_the_bundle_with_the_key_in_its_place(
        key: str, policy: str, tmp_path: Path) -> None:
    plain = write_bundle(tmp_path, PLAIN.replace('KEY', key).replace('POLICY', policy), 'p.yaml')
    found = part(fleet(tmp_path, policy=policy), f'drive_{key}')
    assert meaning(found) == meaning(part(plain, 'drive'))
    assert [item.id for item in found.properties] == [f'SLOW[robot={key}]', f'OWN[robot={key}]']
    assert found.gate is not None
    assert found.gate.name == f'drive_{key}'


@pytest.mark.parametrize('policy', POLICIES)
def test_a_gate_without_a_key_keeps_the_instances_of_all_keys(
        policy: str, tmp_path: Path) -> None:
    plain = write_bundle(tmp_path, PLAIN.replace('KEY', 'alpha').replace('POLICY', policy),
                         'p.yaml')
    found = part(fleet(tmp_path, policy=policy), 'cap')
    assert meaning(found) == meaning(part(plain, 'cap'))
    assert [item.id for item in found.properties] == ['ROOM[zone=near]', 'ROOM[zone=far]']


def test_the_monitor_judges_what_no_gate_keeps(tmp_path: Path) -> None:
    path = fleet(tmp_path)
    assert gate_names(path) == ('drive_alpha', 'drive_beta', 'cap')
    left = restrict(read(path, takes_instances=True).specification, NodePart(None))
    assert [item.id for item in left.properties] == ['FEW']
    with pytest.raises(CompileError, match="did you mean 'drive_"):
        part(path, 'drive')


def test_under_every_message_a_gate_for_each_key_has_the_messages_of_its_key(
        tmp_path: Path) -> None:
    text = FLEET[:FLEET.index('  cap:')]
    found = part(fleet(tmp_path, text, 'every_message'), 'drive_alpha')
    read_inputs = {node.name for item in found.properties for node in postorder([item.formula])
                   if isinstance(node, Variable)}
    assert {item.name for item in found.signals} == read_inputs
    assert not any('beta' in f'{item.topic}{item.where}' for item in found.signals)


@pytest.mark.parametrize(('old', 'new', 'line', 'message'), [
    ('KEYS', '{most: 3}', 22, "the gate 'drive' needs the keys of 'robot' in a list"),
    ('[near, far]', '{most: 3}', 24, "the gate 'cap' needs the keys of 'zone' in a list"),
    ('keep: [ROOM]', 'keep: [FEW]', 24, 'keeps no requirement of values over instances'),
    ('to: "{robot}/cmd"', 'to: cmd', 22, "is not one for each 'robot' on both sides"),
    ('to: limited', 'to: "{zone}/limited"', 24, "is not one for each 'zone' on both sides"),
    ('to: "{robot}/cmd"', 'to: "{robt}/cmd"', 22, "there is no instance variable 'robt'"),
    ('to: "{robot}/cmd"', 'to: "x{robot}/cmd"', 22, "must be a whole part of the topic's name"),
    ('report: occurrence', 'on_violation: [stop]', 12,
     "the lock 'stop' has a publisher for each 'robot'"),
    ('limit: {topic: limit, type: std_msgs/msg/Float32',
     'limit: {topic: limit, type: sensor_msgs/msg/JointState, field: "effort[name = {zone}]"', 10,
     "the gate 'cap' takes no elements that are looked up by a key"),
    ('limit: {topic: limit, type: std_msgs/msg/Float32',
     'limit: {topic: limit, type: sensor_msgs/msg/JointState, where: "header.frame_id = a", '
     'field: "position[0]"', 10, "the gate 'cap' judges every message of 'limit'"),
    ('  cap:', '  drive_beta:', 24, "with keys in their names, two gates are 'drive_beta'"),
    ('POLICY', 'every_message', 24,
     'keeps instances of several keys under another policy than every_message'),
])
def test_what_a_gate_cannot_be_one_of_is_refused_with_its_place(
        old: str, new: str, line: int, message: str, tmp_path: Path) -> None:
    assert old in FLEET
    with pytest.raises(CompileError) as raised:
        read(fleet(tmp_path, FLEET.replace(old, new)), takes_instances=True)
    assert message in str(raised.value)
    assert f'bundle.yaml:{line}:' in str(raised.value)
