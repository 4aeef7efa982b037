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

"""Message types found by name, and the reasons why a field of a message is unusable."""

import re
from typing import Any

from fret_monitor.model.diagnostics import pip_install
from fret_monitor.model.manifest import ManifestInput
from fret_monitor.model.paths import LookUp, Sector, Slice, Step
from fret_monitor.model.values import ValueType
from fret_monitor.ros.intake.fields import message_class, MessageTypeError, why_unusable
import pytest
from rclpy.serialization import serialize_message

sensor_msgs = pytest.importorskip('sensor_msgs.msg')
std_msgs = pytest.importorskip('std_msgs.msg')


def an_input(
    kind: ValueType, *path: Step, values: tuple[tuple[str, int | str], ...] = (),
    reduction: str = '',
) -> ManifestInput:
    return ManifestInput('x', kind, 't', 'any', path, values, None, reduction)


def why(item: ManifestInput, message: Any) -> str:
    return why_unusable(item, serialize_message(message), type(message))


def test_an_array_that_is_too_short_is_reported_with_its_size() -> None:
    item = an_input(ValueType.FLOAT64, 'effort', 1)
    for size, shown in ((1, '1 element'), (0, '0 elements')):
        message = sensor_msgs.JointState(effort=[1.0] * size)
        assert why(item, message) == f'effort[1] cannot be read (the array has {shown})'


def test_among_nested_arrays_the_one_that_is_too_short_is_named() -> None:
    status = message_class('diagnostic_msgs/msg/DiagnosticStatus')
    message = message_class('diagnostic_msgs/msg/DiagnosticArray')(status=[status()])
    inner = an_input(ValueType.INT32, 'status', 0, 'values', 2, 'value', values=(('A', 'a'),))
    assert why(inner, message) == (
        'status[0].values[2].value cannot be read (status[0].values has 0 elements)')
    outer = an_input(ValueType.UINT8, 'status', 1, 'level')
    assert why(outer, message) == 'status[1].level cannot be read (status has 1 element)'


def test_a_string_outside_the_values_is_reported_and_a_long_one_cut() -> None:
    item = an_input(ValueType.INT32, 'data', values=(('IDLE', 'idle'),))
    assert why(item, std_msgs.String(data='broken\n')) == (
        r"data is 'broken\n', which is not among its values in the bundle")
    assert len(why(item, std_msgs.String(data='x' * 100_000))) < 130


def test_an_empty_array_that_is_to_be_reduced_is_reported() -> None:
    item = an_input(ValueType.FLOAT32, 'ranges', reduction='min')
    assert why(item, sensor_msgs.LaserScan()) == 'min(ranges) has no value (the array is empty)'


def test_parts_of_arrays_that_are_not_there_are_reported() -> None:
    scan = sensor_msgs.LaserScan(angle_min=0.5, ranges=[1.0] * 9)
    part = an_input(ValueType.FLOAT32, 'ranges', Slice(-10, None), reduction='min')
    assert why(part, scan) == 'min(ranges[-10:]) cannot be read (the array has 9 elements)'
    part = an_input(ValueType.FLOAT32, 'ranges', Slice(9, None), reduction='min')
    assert why(part, scan) == 'min(ranges[9:]) has no value (the slice is empty)'
    sector = Sector(0.0, 1.0, '0 rad : 1 rad')
    part = an_input(ValueType.FLOAT32, 'ranges', sector, reduction='min')
    assert why(part, scan) == ('min(ranges[0 rad : 1 rad]) has no value (no element is in the '
                               'sector: angle_min is 0.5, angle_increment is 0)')


def test_a_name_that_is_not_there_is_reported() -> None:
    arm = sensor_msgs.JointState(name=['hip', 'left knee'], position=[1.0])
    part = an_input(ValueType.FLOAT64, 'position', LookUp(('name',), 'elbow', is_parallel=True))
    assert why(part, arm) == (
        'position[name = elbow] cannot be read (position has no element of this name)')
    part = an_input(ValueType.FLOAT64, 'position', LookUp(('name',), 'left knee', True))
    assert why(part, arm) == (
        'position[name = "left knee"] cannot be read (the array has 1 element)')
    status = message_class('diagnostic_msgs/msg/DiagnosticStatus')
    message = message_class('diagnostic_msgs/msg/DiagnosticArray')(status=[status(name='imu')])
    part = an_input(ValueType.UINT8, 'status', LookUp(('name',), 'gps'), 'level')
    assert why(part, message) == (
        'status[name = gps].level cannot be read (status has no element of this name)')
    part = an_input(ValueType.UINT8, 'status', LookUp(('name',), 'imu'), 'values', 0, 'key')
    assert 'status[name = imu].values has 0 elements' in why(part, message)


def test_bytes_that_are_no_message_are_unreadable() -> None:
    item = an_input(ValueType.FLOAT32, 'data')
    assert why_unusable(item, b'', std_msgs.Float32) == 'data cannot be read'


def test_events_of_services_have_a_class() -> None:
    assert message_class('std_srvs/srv/Trigger_Event').__name__ == 'Trigger_Event'


def test_feedback_of_actions_has_a_class() -> None:
    pytest.importorskip('test_msgs.action')
    assert message_class('test_msgs/action/Fibonacci_FeedbackMessage').__name__ == \
        'Fibonacci_FeedbackMessage'


@pytest.mark.parametrize(('name', 'command'), [
    ('no_such_msgs/msg/Bool', ''),
    ('std_msgs/msg/NoSuch', f'install it ({pip_install("ros-jazzy-std-msgs")}), or ')])
def test_a_type_that_is_not_installed_is_reported_with_the_command_that_installs_it(
        name: str, command: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv('AMENT_PREFIX_PATH', raising=False)
    monkeypatch.setenv('ROS_DISTRO', '')
    package, _, _ = name.partition('/')
    with pytest.raises(MessageTypeError, match=re.escape(
            f"message type {name} of the package '{package}' is not installed here: {command}"
            'source the workspace that has it')):
        message_class(name)
