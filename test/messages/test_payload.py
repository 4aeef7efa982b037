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

"""A message with the key of an instance: C writes the bytes of that with the key in its place."""

from collections.abc import Mapping, Sequence
from random import Random
from typing import Any

from fret_monitor.elaboration.message_values import INTEGERS
from fret_monitor.messages.installed import find_message, nested_layout
from fret_monitor.messages.layout import ArrayKind, FieldType, MessageLayout
from fret_monitor.messages.serialize import (
    KeyedNumber, KeyedText, serialize, serialize_keyed, Value,
)
from fret_monitor.model.names import pair_key
from fret_monitor.native import evaluator_library, load_evaluator
from fret_monitor.native.binding import ffi
from messages.test_serialize import TYPES, values
import pytest

KEYS = ('', 'a', 'alpha', 'robot_7', 'wörld', 'x' * 127)
NUMBERS = ('0', '7', '127')  # of all types of whole numbers


def with_keys(rng: Random, layout: MessageLayout, content: Mapping[str, Value]
              ) -> dict[str, Value]:
    """Return values with a key in most texts."""
    found: dict[str, Value] = {}
    for field in layout.fields:
        if field.name in content:
            found[field.name] = keyed_field(rng, field.type, layout, content[field.name])
    return found


def keyed_field(rng: Random, kind: FieldType, layout: MessageLayout, value: Value) -> Value:
    if kind.array is not ArrayKind.NONE:
        assert isinstance(value, list)
        inner = FieldType(kind.base, text_limit=kind.text_limit)
        return [keyed_field(rng, inner, layout, item) for item in value]
    if kind.is_message:
        assert isinstance(value, dict)
        return with_keys(rng, nested_layout(layout, kind), value)
    if kind.base == 'string' and kind.text_limit is None and rng.random() < 0.8:
        count = rng.randrange(1, 4)
        return KeyedText((str(value), *rng.choices(['', '/', ' and '], k=count)),
                         tuple(rng.choices((0, 1), k=count)))
    if kind.base in INTEGERS and rng.random() < 0.3:
        return KeyedNumber(rng.randrange(2))
    return value


def filled(value: Value, keys: Sequence[str]) -> Value:
    match value:
        case KeyedText(pieces, of):
            return ''.join(text for pair in zip(
                pieces, (*(keys[place] for place in of), ''), strict=True) for text in pair)
        case KeyedNumber(place):
            return int(keys[place])
        case dict():
            return {name: filled(item, keys) for name, item in value.items()}
        case list():
            return [filled(item, keys) for item in value]
        case _:
            return value


def written(layout: MessageLayout, content: dict[str, Value], keys: Sequence[str]) -> bytes:
    """Return what C writes for the key of one variable, or for a pair."""
    library: Any = load_evaluator(evaluator_library())
    payload, parts = serialize_keyed(layout, content)
    held = (ffi.new('uint8_t[]', payload), ffi.new('struct fm_payload_part[]', [{
        'kind': getattr(library, f'FM_PART_{part.kind.name}'), 'align': part.align,
        'at': part.at, 'size': part.size, 'which': sum(part.keys),
        'n_keys': part.keys.count(0), 'n_second': part.keys.count(1)} for part in parts]))
    action = ffi.new('struct fm_action *', {
        'payload': held[0], 'payload_size': len(payload), 'parts': held[1],
        'n_parts': len(parts), 'is_of_pairs': len(keys) > 1})
    most = library.fm_payload_most(action)
    out = ffi.new('uint8_t[]', b'\xaa' * most)
    data = pair_key(*map(str.encode, keys)) if len(keys) > 1 else keys[0].encode()
    n = library.fm_payload_write(action, ffi.new('uint8_t[]', bytes([len(data)]) + data), out)
    assert n <= most
    return bytes(ffi.buffer(out, n))


@pytest.mark.parametrize('name', [*TYPES, 'rcl_interfaces/msg/ParameterEvent'])
def test_c_writes_a_key_where_it_belongs(name: str) -> None:
    layout, rng = find_message(name), Random(name)
    for _ in range(20):
        content = with_keys(rng, layout, values(rng, layout))
        has_numbers = 'KeyedNumber' in repr(content)
        for keys in ([rng.choice(NUMBERS if has_numbers else KEYS) for _ in range(2)]
                     for _ in range(2)):
            expected = filled(content, keys)
            assert isinstance(expected, dict)
            assert written(layout, content, keys) == serialize(layout, expected), content


def test_what_follows_a_key_is_aligned_anew() -> None:
    layout = find_message('sensor_msgs/msg/JointState')
    content: dict[str, Value] = {
        'header': {'frame_id': KeyedText(('base of ', ''), (0,))},
        'name': [KeyedText(('', '_arm'), (0,))], 'position': [1.5]}
    lengths = set()
    for size in range(9):
        found = written(layout, content, ['k' * size])
        assert found == serialize(layout, {
            'header': {'frame_id': 'base of ' + 'k' * size}, 'name': ['k' * size + '_arm'],
            'position': [1.5]})
        lengths.add(len(found))
    assert len(lengths) > 2


@pytest.mark.parametrize(('name', 'numbers'), [
    ('std_msgs/msg/Int8', [-128, 127]), ('std_msgs/msg/UInt16', [0, 65535]),
    ('std_msgs/msg/Int64', [-2**63, -1, 2**63 - 1]), ('std_msgs/msg/UInt64', [2**64 - 1])])
def test_a_key_is_written_as_the_whole_number_that_it_is(name: str, numbers: list[int]) -> None:
    layout = find_message(name)
    for number in numbers:
        assert written(layout, {'data': KeyedNumber(0)}, [str(number)]) == serialize(
            layout, {'data': number})
        assert written(layout, {'data': KeyedNumber(1)}, ['x' * 250, '5']) == serialize(
            layout, {'data': 5})


def test_a_key_has_255_bytes_at_most() -> None:
    layout = find_message('std_msgs/msg/String')
    assert written(layout, {'data': KeyedText(('<', '>'), (0,))}, ['x' * 255]) == serialize(
        layout, {'data': f'<{"x" * 255}>'})
