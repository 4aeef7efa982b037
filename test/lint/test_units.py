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

"""Numbers in another unit than the field of the message."""

from pathlib import Path

from fret_monitor.build import read_one_instance
from lint.warned import warned
import pytest

ROOT = Path(__file__).resolve().parents[2]
BUNDLE = """\
format: 1
constants: {{low: 15}}
inputs:
  charge: {{topic: battery, type: sensor_msgs/msg/BatteryState, field: percentage{timeout}}}
  yaw: {{topic: pose, type: geometry_msgs/msg/PoseStamped, field: yaw(pose.orientation)}}
  first: {{topic: scan, type: sensor_msgs/msg/LaserScan, field: angle_min}}
  last: {{topic: echoes, type: sensor_msgs/msg/MultiEchoLaserScan, field: angle_max}}
  shake: {{topic: joy, type: sensor_msgs/msg/JoyFeedback, field: intensity}}
  volts: {{topic: battery, type: sensor_msgs/msg/BatteryState, field: voltage{timeout}}}
requirements:
  - {{id: R, ptltl: "{formula}"}}
"""


@pytest.mark.parametrize(('formula', 'title', 'advice'), [
    ('charge >= low', "'charge' is from 0 to 1, and is compared with 15", '15 % are 0.15'),
    ('abs(yaw) < 90.0', "'yaw' is an angle in radians, and is compared with 90",
     '90 degrees are 1.5708 rad'),
    ('-180.0 < first', "'first' is an angle in radians, and is compared with -180",
     '-180 degrees are -3.14159 rad'),
    ('last > 270.0', "'last' is an angle in radians, and is compared with 270",
     '270 degrees are 4.71239 rad'),
    ('shake < 50.0', "'shake' is from 0 to 1, and is compared with 50", '50 % are 0.5'),
    ('charge > 0.15 & charge <= 1.0 & volts > 10.0 & abs(yaw) < 3.15', '', ''),
    ('charge > volts & yaw * 57.3 < 90.0 & volts > 24.0', '', ''),
])
def test_a_number_that_the_field_never_has_is_warned_of(
    formula: str, title: str, advice: str, tmp_path: Path,
) -> None:
    found = warned(tmp_path, BUNDLE.format(formula=formula, timeout=''))
    assert [item for item in found if item[0].startswith("'")] == (
        [(title, advice)] if title else [])


@pytest.mark.parametrize(('timeout', 'expected'), [
    (500, [("the timeout of 'charge' is 8.33 minutes",
            'a timeout is in seconds: 500 ms are 0.5')]),
    (60, []), (0.5, [])])
def test_a_timeout_of_minutes_is_warned_of_once_for_a_topic(
    timeout: float, expected: list[tuple[str, str]], tmp_path: Path,
) -> None:
    found = warned(tmp_path, BUNDLE.format(formula='volts > 24.0 & charge > 0.2',
                                           timeout=f', timeout: {timeout}'))
    assert [item for item in found if 'timeout' in item[0]] == expected


@pytest.mark.parametrize(
    'path', sorted([*ROOT.glob('config/*.yaml'), *ROOT.glob('examples/*.yaml')]),
    ids=lambda path: path.stem)
def test_no_bundle_that_comes_with_the_package_is_warned_of(path: Path) -> None:
    found = [item.title for item in read_one_instance(path).warnings]
    assert not [title for title in found if 'is compared with' in title or 'minutes' in title]
