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

"""Gates that would stay closed are found by example."""

from pathlib import Path

from fret_monitor.build import read
from fret_monitor.traces.gated import doubtful_gates, Repair
import pytest

BUNDLE = """
format: 1
inputs:
  speed: {topic: raw, type: geometry_msgs/msg/Twist, field: linear.x}
  turn: {topic: raw, type: geometry_msgs/msg/Twist, field: angular.z}
  front: {topic: scan, type: std_msgs/msg/Float32, timeout: 0.5}
  brake: {topic: brake, type: std_msgs/msg/Bool}
evaluation: {policy: POLICY}
requirements:
  - {id: SLOW, ptltl: "H (front < 0.5 -> speed <= 0)"}
  - {id: CHANGE, cocospec: "true -> abs(speed - pre speed) < 10.0"}
  - {id: INTERLOCK, ptltl: "front > 0.1"}
  - {id: BRAKE, ptltl: "(speed < 5 & !brake) | front > 3"}
  - {id: MOVE, ptltl: "speed >= 0.5"}
  - {id: STOP, ptltl: "front < 0.5 -> speed < 0"}
  - {id: LATE, ptltl: "Y (speed < 1)"}
  - {id: FALSE, ptltl: "speed > 1 & speed < 0.5"}
gates:
  drive: {from: raw, to: out, type: geometry_msgs/msg/Twist, keep: [KEPT],
          otherwise: {substitute: {linear: {x: 0.0}}, rate: 20}}
"""


def found(path: Path, kept: str, policy: str = 'relevant_message') -> tuple[list[str], list[str]]:
    """Return the warnings of the elaboration, and those of the search."""
    path.write_text(BUNDLE.replace('KEPT', kept).replace('POLICY', policy), encoding='utf-8')
    reading = read(path)
    return ([item.title for item in reading.warnings if 'MOVE' in item.title
             or 'INTERLOCK' in item.title],
            [item.title for item in doubtful_gates(reading.specification)])


@pytest.mark.parametrize('policy', ['relevant_message', 'every_message', 'timed'])
def test_requirements_that_nothing_can_satisfy_are_found(tmp_path: Path, policy: str) -> None:
    kept = 'SLOW, INTERLOCK, BRAKE, MOVE'
    assert found(tmp_path / 'bundle.yaml', kept, policy) == (
        ["INTERLOCK reads nothing of 'raw'"],
        ["BRAKE can be violated whatever passes the gate 'drive'",
         "the substitute of the gate 'drive' violates MOVE"])


def test_a_gate_that_some_message_opens_is_not_warned_of(tmp_path: Path) -> None:
    assert found(tmp_path / 'bundle.yaml', 'SLOW') == ([], [])
    path = tmp_path / 'bundle.yaml'
    assert found(path, 'INTERLOCK') == (["INTERLOCK reads nothing of 'raw'"], [])


def test_substitutes_that_violate_in_some_states_are_found_with_an_example(
        tmp_path: Path) -> None:
    assert found(tmp_path / 'bundle.yaml', 'STOP, CHANGE')[1] == [
        "the substitute of the gate 'drive' can violate CHANGE",
        "the substitute of the gate 'drive' can violate STOP"]
    warning = next(doubtful_gates(read(tmp_path / 'bundle.yaml').specification))
    assert warning.label.startswith('for example after speed = ')


def test_requirements_that_are_false_at_their_first_step_are_found(tmp_path: Path) -> None:
    assert found(tmp_path / 'bundle.yaml', 'LATE, FALSE')[1] == [
        'LATE is false at its first step, whatever passes', 'no message satisfies FALSE']


def test_what_is_decided_elsewhere_is_not_searched(tmp_path: Path) -> None:
    found(tmp_path / 'bundle.yaml', 'BRAKE, MOVE')
    specification = read(tmp_path / 'bundle.yaml').specification
    decided = {'BRAKE': Repair(), 'MOVE': Repair((('front', 0.25),))}
    warnings = list(doubtful_gates(specification, lambda _, gate: decided))
    assert [item.title for item in warnings] == [
        "MOVE can be violated whatever passes the gate 'drive'"]
    assert warnings[0].label == 'for example after front = 0.25'


@pytest.mark.parametrize('policy', ['relevant_message', 'timed'])
def test_a_message_after_which_nothing_passes_any_more_is_found(
        tmp_path: Path, policy: str) -> None:
    path = tmp_path / 'bundle.yaml'
    text = BUNDLE.replace('POLICY', policy).replace('Y (speed < 1)', 'FTP | Y (speed < 1)')
    withheld = text.replace('{substitute: {linear: {x: 0.0}}, rate: 20}', 'drop')
    # Of RISE too few numbers are tried.
    withheld = withheld.replace('true -> abs(speed - pre speed) < 10.0',
                                'true -> speed > pre speed + 0.1').replace('CHANGE', 'RISE')
    path.write_text(withheld.replace('KEPT', 'LATE, RISE'), encoding='utf-8')
    [warning] = doubtful_gates(read(path).specification)
    assert warning.title == "LATE can be violated whatever passes the gate 'drive'"
    assert warning.label.startswith('for example after speed = ')
    assert warning.help.startswith('what is withheld never happens, so that nothing passes')
    path.write_text(text.replace('KEPT', 'LATE'), encoding='utf-8')
    [warning] = doubtful_gates(read(path).specification)
    assert warning.help == 'until that changes, nothing passes, and no substitute satisfies it'
