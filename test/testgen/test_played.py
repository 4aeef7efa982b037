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

"""Which bundles and traces can be played as messages."""

import math
from pathlib import Path

from fret_monitor.build import read
from fret_monitor.model.playing import stamp_of
from fret_monitor.testgen.played import announced, obstacle
from fret_monitor.testgen.recorded import Recorded
import pytest

CONFIG = Path(__file__).resolve().parents[2] / 'config'
BUNDLE = """\
format: 1
evaluation: {{policy: timed}}
inputs:
  {inputs}
requirements:
  - {{id: R, ptltl: "x <= 1.0"}}
"""
TWIST = 'topic: cmd_vel, type: geometry_msgs/msg/Twist'
SECOND = 10**9


def bundle(tmp_path: Path, *inputs: str) -> Path:
    file = tmp_path / 'bundle.yaml'
    file.write_text(BUNDLE.format(inputs='\n  '.join(inputs)), encoding='utf-8')
    return file


def test_a_mobile_base_with_timeouts_and_norms_can_be_played() -> None:
    assert obstacle(read(CONFIG / 'mobile_base.yaml').specification) == ''


@pytest.mark.parametrize(('inputs', 'expected'), [
    ((f'x: {{{TWIST}, field: norm(linear)}}', f'y: {{{TWIST}, field: linear.z}}'),
     "'x' and 'y' are read from one field"),
    ((f'x: {{{TWIST}, field: norm(linear)}}', f'y: {{{TWIST}, field: norm(angular)}}'), ''),
    (('x: {topic: p, type: geometry_msgs/msg/PolygonStamped, field: "polygon.points[0].x"}',),
     "'x' is no field of its message"),
    (('x: {topic: c, type: geometry_msgs/msg/PoseStamped, field: header.stamp}',), ''),
    (('x: {topic: c, type: std_msgs/msg/Float64}',
      'came: {topic: c, type: std_msgs/msg/Float64, field: received()}'),
     "'came' says at which rows a message comes, and the rows of a played trace are all messages"),
    (('x: {topic: c, type: sensor_msgs/msg/Joy, field: norm(axes)}',),
     "'x' is no field of its message"),
    (('x: {topic: c, type: sensor_msgs/msg/JointState, field: norm(velocity), timeout: 0.1}',),
     ''),
])
def test_inputs_that_no_message_can_set_apart_are_an_obstacle(
    tmp_path: Path, inputs: tuple[str, ...], expected: str,
) -> None:
    assert obstacle(read(bundle(tmp_path, *inputs)).specification) == expected


@pytest.mark.parametrize(('field', 'value', 'is_played'), [
    ('linear.x', math.nan, True), ('norm(linear)', 2.5, True), ('norm(linear)', math.nan, True),
    ('norm(linear)', 5e-324, False), ('norm(linear)', 1e200, False)])
def test_a_trace_with_a_value_that_no_message_gives_is_not_played(
    tmp_path: Path, field: str, value: float, is_played: bool,
) -> None:
    specification = read(bundle(tmp_path, f'x: {{{TWIST}, field: {field}}}')).specification
    found = announced(specification, Recorded((0,), ((value,),), 0))
    assert (found is not None) == is_played


def test_a_stamp_is_played_if_it_is_read_as_that_time() -> None:
    for seconds in (0.0, -1.0, 2.5, -0.25, 1e9):
        found = stamp_of(seconds)
        assert found is not None
        assert found[0] + found[1] * 1e-9 == seconds
        assert 0 <= found[1] < SECOND
    for seconds in (math.nan, math.inf, 5e-324, -5e-324, 2.0**31):
        assert stamp_of(seconds) is None


@pytest.mark.parametrize(('seconds', 'is_played'), [(3, True), (4, False)])
def test_a_trace_in_which_messages_would_be_repeated_too_often_is_not_played(
    tmp_path: Path, seconds: int, is_played: bool,
) -> None:
    file = bundle(tmp_path, f'x: {{{TWIST}, field: linear.x, timeout: 0.1}}')
    found = announced(read(file).specification, Recorded((0,), ((0.0,),), seconds * SECOND))
    assert (found is not None) == is_played
