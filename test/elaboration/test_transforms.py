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

"""Inputs that are transforms: their types and fields, and what is refused or warned of."""

from pathlib import Path

from fret_monitor.build import generate_monitor, read
from fret_monitor.model.diagnostics import CompileError
from fret_monitor.model.made import MadeKind
from fret_monitor.model.manifest import Manifest
from fret_monitor.model.policies import InputSource
from fret_monitor.model.values import ValueType
import pytest

BUNDLE = """format: 1
inputs:
  x: {transform: {from: map, to: base}, FIELD}
EVALUATION
requirements:
  - {id: R, ptltl: "x = x"}
"""


def bundle(folder: Path, field: str, evaluation: str = 'evaluation: {policy: timed}') -> Path:
    file = folder / 'bundle.yaml'
    file.write_text(BUNDLE.replace('FIELD', field).replace('EVALUATION', evaluation))
    return file


@pytest.mark.parametrize(('field', 'path', 'reduction', 'source'), [
    ('translation.x', ('transform', 'translation', 'x'), '', InputSource.FIELD),
    ('norm(translation)', ('transform', 'translation'), 'norm', InputSource.FIELD),
    ('yaw(rotation)', ('transform', 'rotation'), 'yaw', InputSource.FIELD),
    ('age()', ('header', 'stamp'), 'seconds', InputSource.AGE),
])
def test_a_field_is_one_of_the_transform_or_of_its_stamp(
        tmp_path: Path, field: str, path: tuple[str, ...], reduction: str,
        source: InputSource) -> None:
    manifest = generate_monitor(read(bundle(tmp_path, f'field: {field}'))).manifest
    item = manifest.inputs[0]
    assert (item.path, item.reduction, item.source) == (path, reduction, source)
    assert item.value_type is ValueType.FLOAT64
    assert [(topic.name, topic.message_type, topic.inputs) for topic in manifest.topics] == [
        ('map -> base', 'geometry_msgs/msg/TransformStamped', (0,)),
        ('/tf', 'tf2_msgs/msg/TFMessage', ()), ('/tf_static', 'tf2_msgs/msg/TFMessage', ())]
    assert manifest.made_of(MadeKind.TRANSFORM) == {0: ('map', 'base')}
    assert Manifest.from_json(manifest.to_json()) == manifest


@pytest.mark.parametrize(('field', 'expected'), [
    ('initial: 0', ':3:7: error: geometry_msgs/msg/Transform has 2 fields\n'),
    ('field: translation.q', "error: geometry_msgs/msg/Vector3 has no field 'q'\n"),
    ('field: rotation', "error: 'rotation' is a message (geometry_msgs/msg/Quaternion)\n"),
    ('field: yaw(translation)', "error: 'yaw' does not apply to the message 'translation'"),
    ('field: header.stamp', "error: geometry_msgs/msg/Transform has no field 'header'\n"),
    ('field: age(), values: {A: 1}', 'error: an age has no names for its values\n'),
])
def test_a_field_that_a_transform_lacks_is_refused_with_its_place(
        tmp_path: Path, field: str, expected: str) -> None:
    with pytest.raises(CompileError) as refused:
        read(bundle(tmp_path, field))
    assert expected in str(refused.value)


def test_stamps_of_headers_are_refused(tmp_path: Path) -> None:
    with pytest.raises(CompileError) as refused:
        read(bundle(tmp_path, 'field: translation.x',
                    'evaluation: {policy: timed, stamp: header}'))
    assert ":3:3: error: 'x' is a transform, which does not go with stamp: header" in str(
        refused.value)
