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

"""
Serialized messages are read by rclpy as the messages that it makes of the same values.

The bytes themselves cannot be compared: in the padding, rclpy leaves what was in memory before.
"""

import array
from importlib import import_module
from random import Random
from typing import Any

from fret_monitor.messages.installed import find_message, nested_layout
from fret_monitor.messages.layout import ArrayKind, FieldType, MessageLayout
from fret_monitor.messages.serialize import has_stamp, serialize
import pytest

rclpy_serialization = pytest.importorskip('rclpy.serialization')

TYPES = [
    *(f'test_msgs/msg/{name}' for name in (
        'Arrays', 'BasicTypes', 'BoundedPlainSequences', 'BoundedSequences', 'Builtins',
        'Constants', 'Defaults', 'Empty', 'MultiNested', 'Nested', 'Strings',
        'UnboundedSequences', 'WStrings')),
    'std_srvs/srv/SetBool_Response', 'std_srvs/srv/Trigger_Request', 'std_msgs/msg/Bool',
    'geometry_msgs/msg/TwistStamped', 'nav_msgs/msg/Odometry', 'sensor_msgs/msg/LaserScan',
    'sensor_msgs/msg/JointState', 'std_msgs/msg/Float32MultiArray',
    'diagnostic_msgs/msg/DiagnosticArray', 'lifecycle_msgs/srv/ChangeState_Request',
]
LIMITS = {'byte': (0, 255), 'char': (0, 255), **{
    f'{sign}int{bits}': (0, 2 ** bits - 1) if sign else (-2 ** (bits - 1), 2 ** (bits - 1) - 1)
    for sign in ('', 'u') for bits in (8, 16, 32, 64)}}


def message_class(name: str) -> Any:
    """Return the Python class of a message, also of a request or a response."""
    package, folder, word = name.split('/')
    own, _, part = word.partition('_')
    found = getattr(import_module(f'{package}.{folder}'), own)
    return getattr(found, part) if part else found


def scalar(rng: Random, kind: FieldType, layout: MessageLayout) -> Any:
    if kind.is_message:
        return values(rng, nested_layout(layout, kind))
    if kind.base in ('string', 'wstring'):
        letters = rng.choice(['', 'a', 'abc', 'wörld', 'ハロー'])
        return letters[:kind.text_limit]
    if kind.base == 'bool':
        return rng.random() < 0.5
    if kind.base.startswith('float'):
        return rng.choice([0.0, -1.5, 2.25, float('inf')])
    return rng.choice([0, *LIMITS[kind.base]])


def values(rng: Random, layout: MessageLayout) -> dict[str, Any]:
    """Return values for about half of the fields of a message."""
    found = {}
    for field in layout.fields:
        if rng.random() < 0.5:
            continue
        kind = field.type
        if kind.array is ArrayKind.NONE:
            found[field.name] = scalar(rng, kind, layout)
        else:
            count = kind.size if kind.array is ArrayKind.FIXED else rng.randrange(0, 4)
            found[field.name] = [scalar(rng, kind, layout) for _ in range(count or 0)]
    return found


def fill(message: Any, layout: MessageLayout, content: dict[str, Any]) -> Any:
    """Set the fields of a message of rclpy."""
    for name, value in content.items():
        field = layout.find_field(name)
        assert field is not None
        setattr(message, name, in_python(value, field.type, layout, getattr(message, name)))
    return message


def in_python(value: Any, kind: FieldType, layout: MessageLayout, now: Any) -> Any:
    if kind.array is not ArrayKind.NONE:
        inner = FieldType(kind.base, text_limit=kind.text_limit)
        items = [in_python(item, inner, layout, None) for item in value]
        if hasattr(now, 'dtype'):
            return items
        return array.array(now.typecode, items) if isinstance(now, array.array) else items
    if kind.is_message:
        nested = nested_layout(layout, kind)
        return fill(message_class(nested.name)(), nested, value)
    return bytes([value]) if kind.base == 'byte' else value


@pytest.mark.parametrize('name', TYPES)
def test_rclpy_reads_a_serialized_message(name: str) -> None:
    layout, rng = find_message(name), Random(name)
    for content in ({}, *(values(rng, layout) for _ in range(20))):
        expected = fill(message_class(name)(), layout, content)
        found = serialize(layout, content)
        assert rclpy_serialization.deserialize_message(found, type(expected)) == expected, content


def test_only_a_message_that_begins_with_a_header_has_its_stamp_in_front() -> None:
    assert has_stamp(find_message('geometry_msgs/msg/TwistStamped'))
    assert not has_stamp(find_message('geometry_msgs/msg/Twist'))
    assert not has_stamp(find_message('std_msgs/msg/Empty'))
