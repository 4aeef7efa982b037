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

"""The JSON schema of a bundle against the reader's tables, and against bundles."""

from pathlib import Path
import re
from typing import Any

from fret_monitor.bundle import schema
from fret_monitor.bundle.actions import ACTION_KEYS, KIND_KEYS
from fret_monitor.bundle.gates import GATE_KEYS, OTHERWISE_KEYS
from fret_monitor.bundle.inputs import BLOCK_KEYS, FIELD_KEYS, INPUT_KEYS, PARAMETER_KEYS, QOS_KEYS
from fret_monitor.bundle.instances import VARIABLE_KEYS
from fret_monitor.bundle.reader import BUNDLE_KEYS, EVALUATION_KEYS, SIGNALS_KEYS
from fret_monitor.bundle.requirements import REQUIREMENT_KEYS
import golden
import pytest
import yaml

jsonschema = pytest.importorskip('jsonschema')

ROOT = Path(__file__).resolve().parents[2]
SCHEMA = schema.bundle_schema()
GOOD = """
format: 1
constants: {v_max: 0.5, is_outdoors: true}
inputs:
  x: {topic: x, type: std_msgs/msg/Float32, timeout: 0.5, stale: violate, startup: 5, initial: 0,
      scale: 0.5}
  t: {transform: {from: map, to: base}, field: translation.x}
  s: {topic: s, type: std_msgs/msg/String, values: {IDLE: idle}, qos: {depth: 5}}
topics:
  odom: {type: nav_msgs/msg/Odometry, max_rate: 50,
         fields: {z: pose.pose.position.z, w: {field: a}}}
definitions:
  fast: x > v_max
  slow: {fretish: x < 0.1}
evaluation: {policy: timed, unit: 1, stamp: header, reorder: 0.05}
actions:
  stop: {lock: {topic: e_stop, rate: 10}}
  tell: {call: {service: /s, type: std_srvs/srv/Trigger, request: {}, timeout: 1, retries: 3},
         after: 0, cooldown: 5}
  brake: {publish: {topic: b, type: std_msgs/msg/Bool, message: {data: true}, rate: 9, for: 2}}
  park: {transition: {node: /arm, to: inactive}}
on_violation: [stop, tell]
on_end: park
gates:
  drive: {from: a, to: b, type: std_msgs/msg/Bool, keep: [010], latch: true, open_after: 2,
          otherwise: {substitute: {data: false}, rate: 20}}
  enable: {service: /e, to: /f, type: std_srvs/srv/SetBool, keep: [020], stale: open,
           otherwise: {respond: {success: false}}, timeout: 5}
  plain: {from: c, to: d, type: std_msgs/msg/Bool, keep: [030], otherwise: drop}
requirements:
  - {id: 010, ptltl: "H fast", on_violation: [brake], on_end: ,
     report: onset, severity: warn, title: , rationale: why}
"""


def is_valid(text: str) -> bool:
    return bool(jsonschema.Draft202012Validator(SCHEMA).is_valid(yaml.safe_load(text)))


def bundles() -> list[Path]:
    found = [path for folder in ('config', 'examples', 'test/golden/check', 'test/golden/explain')
             for path in sorted((ROOT / folder).glob('*.yaml'))]
    return [path for path in found if re.search('^format:', path.read_text(), re.MULTILINE)]


def test_the_schema_is_one() -> None:
    jsonschema.Draft202012Validator.check_schema(SCHEMA)


@pytest.mark.parametrize('path', bundles(), ids=lambda path: path.stem)
def test_bundles_that_the_reader_takes_are_valid(path: Path) -> None:
    assert is_valid(path.read_text(encoding='utf-8'))


def test_bundles_of_all_kinds_are_found() -> None:
    assert len(bundles()) >= 8


def test_all_keys_are_valid_where_they_belong() -> None:
    assert is_valid(GOOD)
    assert is_valid(GOOD.replace('0.5', '"0.5"').replace('format: 1', 'format: "1"'))
    assert is_valid('inputs: {x: {type: bool}}\nconstants:\n')  # a signals file


@pytest.mark.parametrize(('old', 'new'), [
    ('format: 1', 'format: 2'),
    ('format: 1', ''),
    ('std_msgs/msg/Float32, ', 'std_msgs/msg/Float32, timout: 1, '),
    ('topic: x, type: std_msgs/msg/Float32', 'topic: x'),
    ('{from: map, to: base}', 'map'),
    ('{from: map, to: base}', '{from: map}'),
    ('{from: map, to: base}', '{from: map, to: base, at: 0}'),
    ('transform: {from: map, to: base}, ', ''),
    ('timeout: 0.5', 'timeout: 0'),
    ('timeout: 0.5', 'timeout: soon'),
    ('stale: violate', 'stale: never'),
    ('depth: 5', 'depth: 0'),
    ('depth: 5', 'depht: 5'),
    ('policy: timed', 'policy: sometimes'),
    ('evaluation: {', 'period: 1\nevaluation: {'),
    ('field: a}', 'field: a, timeout: 1}'),
    ('fields: {z: pose.pose.position.z, w: {field: a}}', ''),
    ('ptltl: "H fast", ', ''),
    ('ptltl: "H fast"', 'ptltl: "H fast", fretish: x'),
    ('id: 010, ', ''),
    ('id: 010', 'id: ""'),
    ('report: onset', 'report: always'),
    ('slow: {fretish: x < 0.1}', 'slow: {frettish: x < 0.1}'),
    ('v_max: 0.5', 'v_max: [0.5]'),
    ('{lock: {topic: e_stop, rate: 10}}', '{lok: {topic: e_stop, rate: 10}}'),
    ('{topic: e_stop, rate: 10}', '{rate: 10}'),
    ('after: 0,', 'after: soon,'),
    ('to: inactive', 'to: idle'),
    ('stale: open,', 'stale: opened,'),
    ('otherwise: drop', 'otherwise: dropp'),
    ('keep: [020], ', ''),
    ('latch: true', 'latch: maybe'),
])
def test_wrong_bundles_are_not_valid(old: str, new: str) -> None:
    assert GOOD.count(old) == 1
    assert not is_valid(GOOD.replace(old, new))


@pytest.mark.parametrize('name', [
    'a_list', 'a_text', 'acting', 'unknown_keys', 'no_format', 'no_requirements',
    'requirements_by_name', 'scale', 'startup', 'topics', 'misplaced_policy', 'inner_shapes'])
def test_what_the_reader_refuses_for_its_shape_is_not_valid(name: str) -> None:
    text = (golden.FOLDER / 'bundle' / f'{name}.yaml').read_text(encoding='utf-8')
    assert not is_valid(text)


def keys_of(node: Any) -> set[str]:
    """Return all names of properties in a schema."""
    if isinstance(node, dict):
        return set(node.get('properties', ())) | {
            key for item in node.values() for key in keys_of(item)}
    return {key for item in node for key in keys_of(item)} if isinstance(node, list) else set()


def test_each_key_of_the_reader_is_there_with_a_description() -> None:
    tables = (BUNDLE_KEYS, SIGNALS_KEYS, INPUT_KEYS, BLOCK_KEYS, FIELD_KEYS, REQUIREMENT_KEYS,
              EVALUATION_KEYS)
    expected = {key for table in tables for key in table}
    acting = {key for table in (ACTION_KEYS, GATE_KEYS, OTHERWISE_KEYS, *KIND_KEYS.values())
              for key in table}
    assert keys_of(SCHEMA) == expected | acting | set(QOS_KEYS) | set(VARIABLE_KEYS) | set(
        PARAMETER_KEYS)
    assert expected == set(schema._VALUES)
    described = (schema._VALUES, schema._ACTION_VALUES, schema._KIND_VALUES, schema._GATE_VALUES,
                 schema._OTHERWISE_VALUES, schema._VARIABLE_VALUES)
    assert all(len(description) > 5
               for values in described for _, description in values.values())
