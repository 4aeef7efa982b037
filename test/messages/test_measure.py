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

"""The bytes that a layout accounts for are those that a message of it has."""

from random import Random

from fret_monitor.messages.installed import find_message
from fret_monitor.messages.measure import measure
from fret_monitor.messages.serialize import serialize
from messages.test_serialize import TYPES, values
import pytest


@pytest.mark.parametrize('name', TYPES)
def test_a_message_is_as_long_as_its_fields(name: str) -> None:
    rng = Random(name)
    layout = find_message(name)
    for _ in range(20):
        data = serialize(layout, values(rng, layout))
        assert measure(layout, data) == len(data)
        assert measure(layout, data + b'more') == len(data)
        assert measure(layout, data[:-1]) is None


def test_only_plain_cdr_is_measured_in_both_byte_orders() -> None:
    layout = find_message('std_msgs/msg/String')
    assert measure(layout, b'\0\1\0\0' b'\3\0\0\0' b'ab\0') == 11
    assert measure(layout, b'\0\0\0\0' b'\0\0\0\3' b'ab\0') == 11
    assert measure(layout, b'\0\2\0\0' b'\3\0\0\0' b'ab\0') is None
    assert measure(layout, b'\1\1\0\0' b'\3\0\0\0' b'ab\0') is None
    assert measure(layout, b'\0\1\0') is None
