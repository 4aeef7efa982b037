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

"""Parts of messages for instances: each has its key and the values that a look-up of it reads."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from random import Random
import struct
from typing import Any

from codegen.messages import random_tree, same, serialize, signal_of, taken, Topic, Tree
from codegen.test_extractors import corpus, run_attack, sanitized, specification_for
from differential.compiled import clang, gcc, unoptimised, write_module
from fret_monitor.build import build_specification
from fret_monitor.codegen.module import generate
from fret_monitor.logic.formula import Binary, BinaryOperator, Variable
from fret_monitor.logic.scopes import bundle_scope, instance_scopes
from fret_monitor.logic.specification import Signal, Specification
from fret_monitor.messages.installed import find_message
from fret_monitor.messages.layout import MessageLayout
from fret_monitor.model.manifest import ManifestVariable
from fret_monitor.model.paths import LookUp, Step
from fret_monitor.native.binding import ffi
from fret_monitor.native.monitor import Monitor
from fret_monitor.program.layout import lay_out
from fret_monitor.program.lower import lower
from fret_monitor.runtime.fields import FieldReading, part_reading
import pytest
from strategies import property_of

DEFINITIONS = {
    'Odd': ['uint8 a', 'float64 b', 'uint8 c'],
    'Item': ['uint8 kind', 'int64 id', 'Odd odd', 'string name', 'float64[] list', 'uint8 after'],
    'Items': ['float32[] loads', 'Item[] items', 'Odd[<=6] odds', 'int8[] ids', 'string[] tags',
              'bool between', 'uint64 last', 'string word'],
}
# Of each stream of parts: the fields; in C the same key selects them.
STREAMS = (
    ('items[id = {k}].odd.b', 'items[id = {k}].list[1]', 'items[id = {k}].name',
     'len(items[id = {k}].list)', 'items[id = {k}].after'),
    ('items[name = {k}].id', 'items[name = {k}].odd.a'),
    ('items[odd.c = {k}].kind', 'mean(items[odd.c = {k}].list)'),
    ('loads[ids = {k}]', 'tags[ids = {k}]', 'odds[ids = {k}].b', 'items[ids = {k}].after'),
    ('loads[tags = {k}]', 'ids[tags = {k}]', 'items[tags = {k}].name', 'odds[tags = {k}].a'),
)
WHERES = ('last', 'word')
CONSTANTS = (('last', '3'), ('word', 'idle'), ('word', ''), ('last', str(2 ** 64 - 1)))
WHOLE = ('loads[0]', 'len(items)', 'last')  # what an input reads of a message that is selected


@pytest.fixture(scope='module')
def layout(tmp_path_factory: pytest.TempPathFactory) -> MessageLayout:
    """Install messages."""
    folder = tmp_path_factory.mktemp('installed')
    for name, fields in DEFINITIONS.items():
        path = folder / f'share/keyed_msgs/msg/{name}.msg'
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text('\n'.join(fields) + '\n')
    return find_message('keyed_msgs/msg/Items', [folder])


def keyed_topics(layout: MessageLayout) -> list[Topic]:
    """Return a topic for each stream of elements, each key in the message, and one in the name."""
    groups = [[signal_of(layout, f'e{number}_{place}', f't{number}', field)
               for place, field in enumerate(fields)] for number, fields in enumerate(STREAMS)]
    for number, key in enumerate(WHERES):
        groups.append([replace(signal_of(layout, f'w{number}_{place}', f'w{number}', field),
                               where=LookUp((key,), '', variable='k'))
                       for place, field in enumerate(WHOLE)])
    groups.append([signal_of(layout, f'n{place}', '/{k}/x', field)
                   for place, field in enumerate(WHOLE)])
    return [Topic(layout, tuple(replace(item, variables=('k',)) for item in group))
            for group in groups]


def constant_topics(layout: MessageLayout) -> list[Topic]:
    """Return topics of which a constant selects the messages."""
    return [Topic(layout, (replace(signal_of(layout, f'c{number}', 'c', 'last'),
                                   where=LookUp((key,), value)),))
            for number, (key, value) in enumerate(CONSTANTS)]


def specification(layout: MessageLayout) -> Specification:
    topics = [*constant_topics(layout), *keyed_topics(layout)]
    plain = specification_for(topics)
    first = topics[len(CONSTANTS)].signals[0]
    read = Variable(first.name, first.type)
    reads = Binary(BinaryOperator.LE, read, read)
    return replace(plain, properties=(*plain.properties, property_of('K', reads)),
                   instance_variables=(ManifestVariable('k', (), 10),))


@pytest.fixture(scope='module')
def monitor(layout: MessageLayout) -> Monitor:
    with unoptimised():
        return build_specification(specification(layout)).monitor


def parts_of(monitor: Monitor, topic: int, message: bytes,
             key: bytes = b'') -> list[tuple[bytes, list[FieldReading]]] | None:
    """Return the parts of a message, each with its key; None if it cannot be decoded."""
    assert monitor.readers is not None
    kind = monitor.kinds[0].monitor.manifest
    inputs = [kind.inputs[place] for place in kind.topics[topic].inputs]
    found: list[tuple[bytes, list[FieldReading]]] = []

    @ffi.callback('void(void *, uint32_t, const uint8_t *, size_t, const struct fm_field *)')
    def sink(_: Any, number: int, key: Any, size: int, fields: Any) -> None:
        assert number == 0
        found.append((bytes(ffi.buffer(key, size)) if size else b'',
                      [part_reading(fields[place], item) for place, item in enumerate(inputs)]))

    parts = monitor.readers.topics[topic].parts
    data = ffi.from_buffer('uint8_t[]', message)
    is_readable = parts(data, len(message), key or ffi.NULL, len(key), ffi.NULL, ffi.NULL)
    assert not found
    assert parts(data, len(message), key or ffi.NULL, len(key), sink, ffi.NULL) == is_readable
    return found if is_readable else None


def keys_in(tree: Any, signal: Signal) -> list[str | int]:
    """Return the keys of a message, in the order of the elements."""
    array, look_up = signal.path[:2]
    assert isinstance(array, str)
    assert isinstance(look_up, LookUp)
    if look_up.is_parallel:
        return list(getattr(tree, look_up.key[0]))
    found = []
    for element in getattr(tree, array):
        for name in look_up.key:
            element = getattr(element, name)
        found.append(element)
    return found


def with_key(signal: Signal, key: Any) -> Signal:
    """Return a signal that looks up the element of a key."""
    def written(step: Step) -> Step:
        return LookUp(step.key, str(key), step.is_parallel, step.variable) \
            if isinstance(step, LookUp) else step
    return replace(signal, path=tuple(map(written, signal.path)))


def trees(layout: MessageLayout, count: int) -> Iterator[Tree]:
    """Yield random messages in which keys occur repeatedly."""
    rng = Random(1)
    for _ in range(count):
        tree = random_tree(layout, rng)
        tree.tags = [rng.choice(('a', 'b', 'idle', '')) for _ in tree.tags]
        tree.ids = [rng.choice((-128, -1, 0, 127)) for _ in tree.ids]
        tree.last = rng.choice((3, 2 ** 64 - 1, 0, 2 ** 63))
        yield tree


def test_a_part_has_the_values_of_the_first_element_with_its_key(
        layout: MessageLayout, monitor: Monitor) -> None:
    duplicates = parts = 0
    for tree in trees(layout, 150):
        for number, topic in enumerate(keyed_topics(layout)[:len(STREAMS)], len(CONSTANTS)):
            keys = keys_in(tree, topic.signals[0])
            for big in (False, True):
                found = parts_of(monitor, number, serialize(layout, tree, big=big))
                assert found is not None
                assert [key for key, _ in found] == [str(key).encode() for key in keys]
            assert found is not None
            for place, key in enumerate(keys):
                if key in keys[:place]:
                    duplicates += 1
                    continue
                for signal, reading in zip(topic.signals, found[place][1], strict=True):
                    right = taken(tree, with_key(signal, key))
                    assert same(reading, right), (signal.path, key, reading, right)
                parts += 1
    assert parts > 500
    assert duplicates > 50


def test_the_key_of_a_message_is_in_it_or_in_the_name_of_its_topic(
        layout: MessageLayout, monitor: Monitor) -> None:
    topics = keyed_topics(layout)[len(STREAMS):]
    for tree in trees(layout, 40):
        message = serialize(layout, tree)
        for number, topic in enumerate(topics, len(CONSTANTS) + len(STREAMS)):
            right = [taken(tree, signal) for signal in topic.signals]
            found = parts_of(monitor, number, message, b'alpha')
            assert found is not None
            (key, readings), = found
            where = topic.signals[0].where
            assert key == (str(getattr(tree, where.key[0])).encode() if where else b'alpha')
            assert all(map(same, readings, right))


def test_a_constant_selects_messages(layout: MessageLayout, monitor: Monitor) -> None:
    assert monitor.readers is not None
    seen = set()
    for tree in trees(layout, 60):
        tree.word = Random(tree.last).choice(('idle', '', 'idl', 'idle '))
        message = serialize(layout, tree)
        for number, (name, value) in enumerate(CONSTANTS):
            is_selected = ffi.new('bool *')
            data = ffi.from_buffer('uint8_t[]', message)
            assert monitor.readers.topics[number].selects(data, len(message), is_selected)
            assert is_selected[0] == (str(getattr(tree, name)) == value)
            seen.add((number, is_selected[0]))
            assert not monitor.readers.topics[number].selects(data, 5, is_selected)
    assert len(seen) == 2 * len(CONSTANTS)


def test_no_bytes_cause_undefined_behaviour_where_parts_are_handed_over(
        layout: MessageLayout, tmp_path: Path) -> None:
    commands = sanitized()
    if not commands:
        pytest.skip('needs a compiler with sanitizers')
    whole = specification(layout)
    program = lower(bundle_scope(whole))
    module = generate(program, tuple(map(lay_out, program.groups)),
                      [item.specification.signals for item in instance_scopes(whole)])
    write_module(module, tmp_path)
    topics = [*constant_topics(layout), *keyed_topics(layout)]
    file = tmp_path / 'corpus'
    file.write_bytes(b''.join(struct.pack('<II', number, len(message)) + message
                              for number, message in corpus(topics, Random(7))))
    plain = gcc() or clang()
    assert plain is not None
    expected = run_attack((tmp_path, file), *plain, '-O2')
    decoded, total = map(int, expected.split()[:2])
    assert 0.1 < decoded / total < 0.95
    assert run_attack((tmp_path, file), *commands[0]) == expected
