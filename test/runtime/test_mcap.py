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

"""MCAP files that are written without a library of MCAP: `rosbags` reads them."""

from collections.abc import Iterator
from pathlib import Path
import struct

from bag.recordings import FLOAT, START, TYPES
from fret_monitor.runtime.mcap import McapWriter
import pytest
from rosbags.rosbag2 import Reader

DEFINITION, _ = TYPES.generate_msgdef(FLOAT, ros_version=2)


def payload(value: float, size: int = 0) -> bytes:
    return bytes(TYPES.serialize_cdr(TYPES.types[FLOAT](value), FLOAT)) + bytes(size)


@pytest.mark.parametrize('size', [0, 300_000])  # in one chunk, and in several
def test_what_is_written_is_read_in_the_order_of_the_times(tmp_path: Path, size: int) -> None:
    path = tmp_path / 'file.mcap'
    with path.open('wb') as file:
        writer = McapWriter(file)
        channels = [writer.add_channel(f'/{name}', FLOAT, DEFINITION) for name in 'abc']
        for number in (1, 0, 3, 2, 5, 4, 9, 8, 7, 6):
            writer.add_message(channels[number % 2], START + number, payload(number, size), START)
        writer.add_metadata('fret_monitor', {'bundle': 'tank'})
        before = writer.size
        writer.end()
        assert writer.size == file.tell()
        assert file.tell() <= before < file.tell() + 1000
    with Reader(path) as reader:
        counts = {item.topic: item.msgcount for item in reader.connections}
        assert counts == {'/a': 5, '/b': 5, '/c': 0}
        assert [item.msgdef.data for item in reader.connections] == [DEFINITION] * 3
        assert (reader.start_time, reader.end_time - 1) == (START, START + 9)
        found = [(item.topic, time - START, data) for item, time, data in reader.messages()]
    assert [time for _, time, _ in found] == list(range(10))
    assert found == [(f'/{"ab"[number % 2]}', number, payload(number, size))
                     for number in range(10)]


def records(data: bytes, place: int) -> Iterator[tuple[int, bytes]]:
    while not data.startswith(b'\x89MCAP', place):
        kind, size = struct.unpack_from('<BQ', data, place)
        yield kind, data[place + 9:place + 9 + size]
        place += 9 + size


def test_the_index_of_a_chunk_says_where_the_indices_of_its_channels_are(tmp_path: Path) -> None:
    path = tmp_path / 'file.mcap'
    with path.open('wb') as file:
        writer = McapWriter(file)
        channels = [writer.add_channel(f'/{name}', FLOAT, DEFINITION) for name in 'abc']
        for number in range(10):
            writer.add_message(channels[number % 3], START + number, payload(0, 300_000), START)
        writer.end()
    data = path.read_bytes()
    (summary,) = struct.unpack_from('<Q', data, len(data) - 8 - 20)
    chunks = [body for kind, body in records(data, summary) if kind == 8]
    assert len(chunks) > 1
    for body in chunks:
        (size,) = struct.unpack_from('<I', body, 32)
        entries = list(struct.iter_unpack('<HQ', body[36:36 + size]))
        assert entries
        for channel, place in entries:
            assert struct.unpack_from('<BQH', data, place)[::2] == (7, channel)


def test_a_file_without_messages_is_one(tmp_path: Path) -> None:
    path = tmp_path / 'file.mcap'
    with path.open('wb') as file:
        writer = McapWriter(file)
        writer.add_channel('/a', FLOAT, '')
        writer.end()
    with Reader(path) as reader:
        assert reader.message_count == 0
        assert [item.topic for item in reader.connections] == ['/a']


@pytest.mark.parametrize('definition', ['', '\n', DEFINITION])
def test_a_definition_has_a_format_unless_there_is_none(tmp_path: Path, definition: str) -> None:
    path = tmp_path / 'file.mcap'
    with path.open('wb') as file:
        writer = McapWriter(file)
        writer.add_channel('/a', FLOAT, definition)
        writer.end()
    assert (b'ros2msg' in path.read_bytes()) is (definition != '')


def test_a_full_disk_is_an_error() -> None:
    with Path('/dev/full').open('wb') as file, \
            pytest.raises(OSError, match='No space left on device'):
        McapWriter(file)
