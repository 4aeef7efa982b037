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

"""Damaged recordings: what a checksum or a second copy shows is an error, and the rest is said."""

from collections.abc import Callable
import json
from pathlib import Path
from random import Random
import struct
from zlib import crc32

import apsw
from bag.recordings import FLOAT, START, TYPES, write
from fret_monitor.bag.check import check_recording, RecordingResult, Selection
from fret_monitor.bag.results import json_line, table
from fret_monitor.cli.main import main
from fret_monitor.runtime.mcap import McapWriter
from fuzz.damage import attempt, subjects
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.typesys import get_typestore, Stores

MAGIC = b'\x89MCAP0\r\n'
LOW = """format: 1
inputs: {level: {topic: level, type: std_msgs/msg/Float64}}
requirements: [{id: LOW, ptltl: "level < 0.5"}]
"""
LEVELS = 0.125, 0.25, 0.625
DEFINITION, _ = TYPES.generate_msgdef(FLOAT, ros_version=2)


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    file = tmp_path / 'low.yaml'
    file.write_text(LOW, encoding='utf-8')
    return file


def serialized(level: float) -> bytes:
    return b'\0\1\0\0' + struct.pack('<d', level)


def chunked(folder: Path) -> Path:
    """Write a file with checksums of its chunk and of its summary."""
    path = folder / 'chunked.mcap'
    with path.open('wb') as file:
        writer = McapWriter(file)
        channel = writer.add_channel('/level', FLOAT, DEFINITION)
        for number, level in enumerate(LEVELS):
            writer.add_message(channel, START + number, serialized(level))
        writer.end()
    return path


def record(kind: int, content: bytes) -> bytes:
    return struct.pack('<BQ', kind, len(content)) + content


def text(value: str) -> bytes:
    return struct.pack('<I', len(value)) + value.encode()


def unchunked(folder: Path) -> Path:
    """Write a file with a checksum of all its records, and without a summary."""
    data = MAGIC + record(1, text('ros2') + text('by hand')) \
        + record(3, struct.pack('<H', 1) + text(FLOAT) + text('ros2msg') + text(DEFINITION)) \
        + record(4, struct.pack('<HH', 1, 1) + text('/level') + text('cdr') + text(''))
    for number, level in enumerate(LEVELS):
        data += record(5, struct.pack('<HIQQ', 1, number, START + number, START + number)
                       + serialized(level))
    path = folder / 'unchunked.mcap'
    path.write_bytes(data + record(15, struct.pack('<I', crc32(data)))
                     + record(2, struct.pack('<QQI', 0, 0, 0)) + MAGIC)
    return path


def replace(path: Path, old: bytes, new: bytes) -> None:
    content = path.read_bytes()
    assert old in content
    path.write_bytes(content.replace(old, new))


def checked(bundle: Path, path: Path) -> RecordingResult:
    return check_recording(bundle, path, Selection())


@pytest.mark.parametrize('make', [chunked, unchunked])
def test_a_value_that_was_zeroed_under_a_checksum_is_an_error(
        tmp_path: Path, bundle: Path, make: Callable[[Path], Path]) -> None:
    path = make(tmp_path)
    whole = checked(bundle, path)
    assert (whole.errors, whole.has_checksums, whole.findings[0].violations) == ((), True, 1)
    assert table(whole).splitlines()[0] == f'{path}: 3 messages on 1 topic, 0.000000002 s'
    assert json.loads(json_line(whole))['checksums'] is True
    replace(path, serialized(0.625), serialized(0.0))
    assert 'checksum' in ' '.join(checked(bundle, path).errors)


@pytest.mark.parametrize('storage', [StoragePlugin.SQLITE3, StoragePlugin.MCAP])
def test_an_answer_says_that_messages_are_under_no_checksum(
        tmp_path: Path, bundle: Path, storage: StoragePlugin) -> None:
    result = checked(bundle, write(
        tmp_path / 'bag', [('/level', k, level) for k, level in enumerate(LEVELS)],
        storage=storage))
    assert table(result).splitlines()[0].endswith(' s, no checksums')
    assert json.loads(json_line(result))['checksums'] is False


def test_a_table_has_no_word_about_checksums(tmp_path: Path, bundle: Path) -> None:
    path = tmp_path / 'table.csv'
    path.write_text('level\n0.25\n', encoding='utf-8')
    result = checked(bundle, path)
    assert 'checksum' not in table(result) + json_line(result)


def test_a_damaged_summary_is_an_error(tmp_path: Path, bundle: Path) -> None:
    path = chunked(tmp_path)
    content = path.read_bytes()
    place = content.rindex(struct.pack('<Q', START + 2))  # where the index says that it ends
    path.write_bytes(content[:place] + struct.pack('<Q', START + 9) + content[place + 8:])
    assert 'chunked.mcap is damaged: the checksum of its summary does not match' \
        in checked(bundle, path).errors


def test_two_ends_of_a_file_without_checksums_are_an_error(tmp_path: Path, bundle: Path) -> None:
    path = write(tmp_path / 'bag', [('/level', 0, 0.25), ('/level', 9, 0.25)]) / 'bag.mcap'
    content = path.read_bytes()
    place = content.rindex(struct.pack('<Q', START + 9))  # the statistics come last
    path.write_bytes(content[:place] + struct.pack('<Q', START + 5) + content[place + 8:])
    assert f'to {START + 5} ns, or from {START} to {START + 9} ns' in checked(
        bundle, path).errors[0]


def test_a_chunk_whose_writer_gave_it_no_begin_is_not_damaged(
        tmp_path: Path, bundle: Path) -> None:
    path = write(tmp_path / 'bag', [('/level', 0, 0.25), ('/level', 9, 0.25)]) / 'bag.mcap'
    content = path.read_bytes()
    span = struct.pack('<QQ', START, START + 9)
    place = content.index(span, content.index(span) + 1)  # after that of the chunk, its index
    path.write_bytes(content[:place] + bytes(8) + content[place + 8:])
    result = checked(bundle, path)
    assert (result.errors, result.findings[0].verdict) == ((), True)


@pytest.mark.parametrize('copy', [0, 1])
def test_a_time_that_was_changed_in_sqlite_is_an_error(
        tmp_path: Path, bundle: Path, copy: int) -> None:
    path = write(tmp_path / 'bag', [('/level', 0, 0.25), ('/level', 10, 0.75)],
                 storage=StoragePlugin.SQLITE3) / 'bag.db3'
    content = path.read_bytes()
    first, second, *others = [place for place in range(len(content)) if content.startswith(
        struct.pack('>q', START + 10), place)]  # in the table and in its index
    assert not others
    place = (first, second)[copy]
    path.write_bytes(content[:place] + struct.pack('>q', START + 5) + content[place + 8:])
    assert checked(bundle, path).errors[0] == (
        'bag.db3 is damaged: of 2 messages, 1 have the times that its index has')


def test_a_file_of_sqlite_that_was_cut_off_is_an_error(tmp_path: Path, bundle: Path) -> None:
    path = write(tmp_path / 'bag', [('/level', k, 0.25) for k in range(60)],
                 storage=StoragePlugin.SQLITE3) / 'bag.db3'
    path.write_bytes(path.read_bytes()[:-50])  # of the index of times
    result = checked(bundle, path.parent)
    assert result.errors[-1] == '/level: 60 messages recorded, 0 read'
    assert 'the recording cannot be read to its end: database disk image is malformed' \
        in result.errors


@pytest.mark.parametrize(('old', 'new', 'error'), [
    (b'start_time=' + struct.pack('<L', START // 10**9), b'start_time=' + bytes(4),
     f'its messages are from 0 to {START + 2} ns, or from {START} to {START + 2} ns'),
    (b'end_time=' + struct.pack('<LL', START // 10**9, 2),
     b'end_time=' + struct.pack('<LL', START // 10**9, 999),
     f'its messages are from {START} to {START + 999} ns, or from {START} to {START + 2} ns'),
    (struct.pack('<LL', 0, 3), struct.pack('<LL', 0, 4),
     'it counts 4 messages of /level, and its index has 3'),
    (b'float64 data', b'fl!at64 data',
     "Could not parse: 'MSG: std_msgs/msg/Float64\\nfl!at64 data\\n' 26 fl!at64 data")],
    ids=['begin', 'end', 'number', 'definition'])
def test_what_a_bag_of_ros_1_has_in_two_ways_is_an_error(
        tmp_path: Path, bundle: Path, old: bytes, new: bytes, error: str) -> None:
    path, types = tmp_path / 'old.bag', get_typestore(Stores.ROS1_NOETIC)
    with Writer1(path) as writer:
        topic = writer.add_connection('/level', FLOAT, typestore=types)
        for number, level in enumerate(LEVELS):
            writer.write(topic, START + number, struct.pack('<d', level))
    assert checked(bundle, path).errors == ()
    replace(path, old, new)
    assert error in checked(bundle, path).errors[0]


@pytest.mark.parametrize('number', range(5))
def test_the_answer_about_a_damaged_recording_is_the_right_one_or_an_error(
        tmp_path: Path, number: int) -> None:
    subject = subjects(tmp_path, Random(0))[number]
    found = [attempt(tmp_path, subject, Random(f'{number} {k}')) for k in range(25)]
    assert 'error' in found


# ---- times that are none -----------------------------------------------------------------------

@pytest.mark.parametrize('time', [2**63 - 1, 2**63, 2**64 - 1])
def test_what_comes_before_a_message_after_the_year_2261_is_judged(
        tmp_path: Path, bundle: Path, time: int) -> None:
    messages = [('/level', k, level) for k, level in enumerate(LEVELS)]
    path = write(tmp_path / 'far', [*messages, ('/level', time - START, 0.75)])
    result = checked(bundle, path)
    assert (result.findings[0].violations, result.end) == (1, START + 2)
    assert result.errors == (
        'the recording says that it ends after the year 2261',
        '1 message left out: they have no bytes, or no time from 1970 to 2261 in whole '
        'nanoseconds', '/level: 4 messages recorded, 3 read')
    assert main(['bag', str(bundle), str(path), '--partial']) == 0
    assert main(['bag', str(bundle), str(path), '--to', 'start+0.000000001']) == 1


@pytest.mark.parametrize(('column', 'value'), [
    ('timestamp', 1.5), ('timestamp', 1e300), ('timestamp', 'noon'),
    ('timestamp', 2**63 - 1), ('data', None), ('data', 5)])
def test_a_row_of_another_type_is_left_out(
        tmp_path: Path, bundle: Path, column: str, value: float | str | None) -> None:
    path = write(tmp_path / 'bag', [('/level', k, level) for k, level in enumerate(LEVELS)],
                 storage=StoragePlugin.SQLITE3)
    with apsw.Connection(str(path / 'bag.db3')) as database:
        database.execute('CREATE TABLE other AS SELECT * FROM messages')
        database.execute('DROP TABLE messages')
        database.execute('ALTER TABLE other RENAME TO messages')
        database.execute(f'UPDATE messages SET {column} = ? WHERE id = 1', (value,))
    result = checked(bundle, path)
    assert (result.findings[0].violations, result.end) == (1, START + 2)
    assert any('1 message left out' in error for error in result.errors)
    assert main(['bag', str(bundle), str(path), '--partial']) == 0
