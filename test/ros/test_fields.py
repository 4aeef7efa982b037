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

from collections.abc import Callable
from typing import Any

from fret_monitor.manifest import Manifest
from fret_monitor.manifest import ManifestInput
from fret_monitor.manifest import ManifestTopic
from fret_monitor.manifest import Policy
from fret_monitor.manifest import ValueType
from fret_monitor.ros.fields import field_reader
from fret_monitor.ros.fields import message_class
from fret_monitor.ros.fields import MessageReader
from fret_monitor.ros.fields import MessageTypeError
from fret_monitor.ros.fields import UnusableField
from fret_monitor.ros.fields import why_unusable
import pytest
from rclpy.serialization import serialize_message

sensor_msgs = pytest.importorskip('sensor_msgs.msg')
nav_msgs = pytest.importorskip('nav_msgs.msg')
std_msgs = pytest.importorskip('std_msgs.msg')


class Stored:
    """An `InputStore` that remembers."""

    def __init__(self) -> None:
        self.values: dict[int, bool | int | float] = {}
        self.unusable_inputs: list[int] = []
        self.undecodable_topics: list[int] = []

    def store(self, index: int, value: bool | int | float) -> None:
        self.values[index] = value

    def unusable(self, index: int) -> None:
        self.unusable_inputs.append(index)

    def undecodable(self, topic: int) -> None:
        self.undecodable_topics.append(topic)


def an_input(
    kind: ValueType, *path: str | int, values: tuple[tuple[str, int | str], ...] = (),
) -> ManifestInput:
    return ManifestInput('x', kind, 't', 'any', path, values, None)


def test_a_nested_field_is_reached_by_its_path() -> None:
    message = nav_msgs.Odometry()
    message.pose.pose.position.z = 1.5
    read = field_reader(an_input(ValueType.FLOAT64, 'pose', 'pose', 'position', 'z'))
    assert read(message) == 1.5


@pytest.mark.parametrize(('field', 'size'), [('position', 3), ('velocity', 2)])
def test_an_index_reaches_into_an_array_and_not_beyond(field: str, size: int) -> None:
    message = sensor_msgs.JointState(position=[1.0, 2.0, 3.0], velocity=[4.0, 5.0])
    for index in range(size):
        read = field_reader(an_input(ValueType.FLOAT64, field, index))
        assert read(message) == getattr(message, field)[index]
    with pytest.raises(UnusableField):
        field_reader(an_input(ValueType.FLOAT64, field, size))(message)


def test_an_element_of_a_fixed_array_is_a_plain_number() -> None:
    message = sensor_msgs.Imu()
    message.orientation_covariance[4] = 0.25
    value = field_reader(an_input(ValueType.FLOAT64, 'orientation_covariance', 4))(message)
    assert (type(value), value) == (float, 0.25)


def test_a_field_behind_an_index_is_reached() -> None:
    status = message_class('diagnostic_msgs/msg/DiagnosticStatus')
    message = message_class('diagnostic_msgs/msg/DiagnosticArray')(
        status=[status(level=b'\0'), status(level=b'\2')])
    assert field_reader(an_input(ValueType.UINT8, 'status', 1, 'level'))(message) == 2


@pytest.mark.parametrize(('name', 'kind', 'given', 'stored'), [
    ('Bool', ValueType.BOOL, True, True),
    ('Byte', ValueType.UINT8, b'\xff', 255),
    ('Int64', ValueType.INT64, -2**63, -2**63),
    ('UInt64', ValueType.UINT64, 2**64 - 1, 2**64 - 1),
    ('Float32', ValueType.FLOAT32, 0.5, 0.5),
])
def test_a_standard_message_gives_its_value(
    name: str, kind: ValueType, given: Any, stored: Any,
) -> None:
    value = field_reader(an_input(kind, 'data'))(getattr(std_msgs, name)(data=given))
    assert (type(value), value) == (type(stored), stored)


def test_a_string_is_its_place_among_the_values_and_no_other_can_be_used() -> None:
    read = field_reader(an_input(
        ValueType.INT32, 'data', values=(('IDLE', 'idle'), ('LANDING', 'landing now'))))
    assert read(std_msgs.String(data='landing now')) == 1
    for unknown in ('LANDING', ''):
        with pytest.raises(UnusableField):
            read(std_msgs.String(data=unknown))


def joint_reader(
    tell: Callable[[int, str], None] = lambda index, reason: None,
) -> MessageReader:
    inputs = (an_input(ValueType.FLOAT64, 'position', 0), an_input(ValueType.FLOAT64, 'effort', 1))
    topics = (ManifestTopic('other', 'std_msgs/msg/Bool', (), ()),
              ManifestTopic('joints', 'sensor_msgs/msg/JointState', (0, 1), ()))
    manifest = Manifest('m', 'm', '', Policy.EVERY_MESSAGE, None, inputs, topics, (), (), 0, '',
                        '', ())
    return MessageReader(manifest, 1, tell)


def test_a_message_whose_field_cannot_be_used_still_stores_the_others() -> None:
    stored = Stored()
    message = sensor_msgs.JointState(position=[7.0], effort=[1.0])
    assert joint_reader().read(serialize_message(message), stored)
    assert (stored.values, stored.unusable_inputs) == ({0: 7.0}, [1])


def test_what_cannot_be_used_is_told_once_an_input() -> None:
    told: list[tuple[int, str]] = []
    reader = joint_reader(lambda index, reason: told.append((index, reason)))
    for size in (2, 1, 0):
        message = sensor_msgs.JointState(position=[7.0] * size, effort=[1.0] * size)
        assert reader.read(serialize_message(message), Stored())
    assert told == [(1, 'effort[1] cannot be read (the array has 1 element)'),
                    (0, 'position[0] cannot be read (the array has 0 elements)')]


def test_of_arrays_in_arrays_the_one_too_short_is_named() -> None:
    status = message_class('diagnostic_msgs/msg/DiagnosticStatus')
    message = message_class('diagnostic_msgs/msg/DiagnosticArray')(status=[status()])
    inner = an_input(ValueType.INT32, 'status', 0, 'values', 2, 'value', values=(('A', 'a'),))
    assert why_unusable(inner, message) == (
        'status[0].values[2].value cannot be read (status[0].values has 0 elements)')
    outer = an_input(ValueType.UINT8, 'status', 1, 'level')
    assert why_unusable(outer, message) == (
        'status[1].level cannot be read (status has 1 element)')


def test_a_string_outside_the_values_is_told_and_a_long_one_cut() -> None:
    item = an_input(ValueType.INT32, 'data', values=(('IDLE', 'idle'),))
    assert why_unusable(item, std_msgs.String(data='broken\n')) == (
        r"data is 'broken\n', which is not among its values in the bundle")
    assert len(why_unusable(item, std_msgs.String(data='x' * 100_000))) < 130


@pytest.mark.parametrize('data', [b'', b'\0\1\0\0', b'\0\1\0\0' + b'\xff' * 20])
def test_bytes_that_are_no_message_are_counted_and_store_nothing(data: bytes) -> None:
    stored = Stored()
    assert not joint_reader().read(data, stored)
    assert (stored.values, stored.undecodable_topics) == ({}, [1])


@pytest.mark.parametrize('name', ['no_such_msgs/msg/Bool', 'std_msgs/msg/NoSuch'])
def test_a_type_that_is_not_installed_is_told_with_its_package(name: str) -> None:
    with pytest.raises(MessageTypeError, match=rf'{name} is not installed.*{name.split("/")[0]}'):
        message_class(name)
