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
Whether the files of a recording are as they were written, as far as they can show it.

MCAP has checksums (CRC-32): of chunks, which `rosbags` compares as it reads them, of the summary,
and of all records. SQLite and ROS 1 have none; but the times of messages are with them and in an
index, and ROS 1 says of each chunk what its index has.
"""

from collections.abc import Iterator
from typing import Any, BinaryIO
from zlib import crc32

from fret_monitor.model.diagnostics import counted
from rosbags.rosbag1 import Reader as Reader1
from rosbags.rosbag2.storage_mcap import ChunkInfo, McapReader
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

_BLOCK = 1 << 20
_FOOTER_BYTES = 37  # with the magic bytes behind it
_MAGIC_BYTES = 8
_CRC_BYTES = 4
_CHUNK_CRC = 9 + 24  # where it is in the record of a chunk
_DATA_END = b'\x0f\x04' + bytes(7)  # operation and length of the record; its checksum follows
_INDEX = 'timestamp_idx'


def damage(storage: Any) -> Iterator[str]:
    """Yield what shows that a file has changed since it was written; O(bytes) at most."""
    try:
        if isinstance(storage, McapReader):
            yield from _damage_of_mcap(storage)
        elif isinstance(storage, Sqlite3Reader):
            yield from _damage_of_index(storage)
        else:
            yield from _damage_of_ros1(storage)
    except Exception as error:  # noqa: B902  # of whichever library reads the format
        yield f'{_name(storage)} is damaged: {error}'
    if isinstance(storage, Reader1):
        return
    by_topic = sum(item.msgcount for item in storage.connections)
    if by_topic != (count := storage.metadata.message_count):
        yield f'{_name(storage)} counts {counted(count, "message")}, and {by_topic:,} by topic'


def _name(storage: Any) -> str:
    return str(storage.path.name)


def has_checksums(storage: Any) -> bool:
    """Return whether each message of a file is under a checksum."""
    if not isinstance(storage, McapReader):
        return False
    assert storage.bio is not None
    return _are_chunks_covered(storage.bio, storage.chunks) \
        or _data_checksum(storage.bio, storage.data_end) != 0


def _are_chunks_covered(file: BinaryIO, chunks: list[ChunkInfo]) -> bool:
    return bool(chunks) and all(
        _number(file, item.chunk_start_offset + _CHUNK_CRC) for item in chunks)


def _damage_of_mcap(storage: McapReader) -> Iterator[str]:
    file, name = storage.bio, _name(storage)
    assert file is not None
    end = file.seek(0, 2) - _MAGIC_BYTES - _CRC_BYTES
    begin = storage.data_end
    expected = _number(file, end)
    if begin < end - _FOOTER_BYTES and expected and _checksum(file, begin, end) != expected:
        yield f'{name} is damaged: the checksum of its summary does not match'
    if not _are_chunks_covered(file, storage.chunks) \
            and (expected := _data_checksum(file, begin)) \
            and _checksum(file, 0, begin - len(_DATA_END) - _CRC_BYTES) != expected:
        yield f'{name} is damaged: the checksum of its records does not match'
    if (statistics := storage.statistics) is not None and storage.chunks:
        # Some writers give chunks no begin but 0.
        filled = [item for item in storage.chunks if any(item.channel_count.values())]
        times = (min(item.message_start_time for item in filled) or statistics.start_time,
                 max(item.message_end_time for item in filled)) if filled else (0, 0)
        if filled and times != (statistics.start_time, statistics.end_time):
            yield (f'{name} is damaged: its messages are from {statistics.start_time} to '
                   f'{statistics.end_time} ns, or from {times[0]} to {times[1]} ns')


def _data_checksum(file: BinaryIO, end: int) -> int:
    """Return the checksum of all records up to a summary or footer; 0 if there is none."""
    begin = end - len(_DATA_END) - _CRC_BYTES
    if begin < 0:
        return 0
    file.seek(begin)
    return _number(file, begin + len(_DATA_END)) if file.read(len(_DATA_END)) == _DATA_END else 0


def _number(file: BinaryIO, place: int) -> int:
    file.seek(place)
    return int.from_bytes(file.read(_CRC_BYTES), 'little')


def _checksum(file: BinaryIO, begin: int, end: int) -> int:
    found = 0
    file.seek(begin)
    while begin < end and (block := file.read(min(_BLOCK, end - begin))):
        found = crc32(block, found)
        begin += len(block)
    return found


def _damage_of_index(storage: Sqlite3Reader) -> Iterator[str]:
    """Compare the times in the table of messages with those in its index."""
    database = storage.dbconn
    assert database is not None
    if not database.execute(
            'SELECT 1 FROM sqlite_master WHERE type = ? AND name = ? AND tbl_name = ?',
            ('index', _INDEX, 'messages')).fetchall():
        return
    (entries, same), = database.execute(
        f'SELECT count(*), sum(message.timestamp IS entry.timestamp) '
        f'FROM messages AS entry INDEXED BY {_INDEX} '
        'CROSS JOIN messages AS message NOT INDEXED ON message.id = entry.id')
    (messages,), = database.execute('SELECT count(*) FROM messages NOT INDEXED')
    if not entries == (same or 0) == messages:
        yield (f'{_name(storage)} is damaged: of {counted(messages, "message")}, {same or 0:,} '
               'have the times that its index has')


def _damage_of_ros1(storage: Reader1) -> Iterator[str]:
    """Compare what is said of the chunks with their indexes; `rosbags` compares the times."""
    name, chunks = _name(storage), storage.chunk_infos
    for item in storage.connections:
        total = sum(chunk.connection_counts.get(item.id, 0) for chunk in chunks)
        if total != item.msgcount:
            yield (f'{name} is damaged: it counts {counted(total, "message")} of {item.topic}, '
                   f'and its index has {item.msgcount:,}')
    found = [index for index in storage.indexes.values() if index]
    first = min((index[0].time for index in found), default=storage.start_time)
    last = max((index[-1].time for index in found), default=storage.end_time - 1)
    if (first, last) != (storage.start_time, storage.end_time - 1):
        yield (f'{name} is damaged: its messages are from {storage.start_time} to '
               f'{storage.end_time - 1} ns, or from {first} to {last} ns')
