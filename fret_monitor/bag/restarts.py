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
Whether the time of a recording goes back: several runs in one file, such as of a simulation.

Messages are read in the order of their times, which would mix the runs. They are therefore looked
at in the order in which they were written. Only the times of one topic count, since a recorder may
write a message before an earlier one of another topic, and some programs write topic by topic.
"""

from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
import struct
from typing import Any

from fret_monitor.bag.chunks import content, messages_of
from fret_monitor.bag.moments import LAST_TIME
from rosbags.rosbag2.storage_mcap import ChunkInfo, McapReader
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

_TOLERANCE_NS = 100_000_000  # threads of the middleware may hand over messages out of order
_INDEX_HEADER = struct.Struct('<BQHI')  # kind and length of the record, channel, bytes that follow
_Times = Iterator[tuple[int, 'array[int]']]
"""For each topic (its number in the file) times in the order in which they were written."""


@dataclass(frozen=True)
class Restart:
    """A place where time goes back: a topic, its file, and its times before and after (ns)."""

    topic: str
    file: str
    before: int
    after: int


def restarts(storages: Sequence[Any]) -> list[Restart]:
    """Return where the time of the files of a recording goes back; O(messages)."""
    if _are_consecutive(storages) and all(
            isinstance(item, Sqlite3Reader) and _is_in_order(item) for item in storages):
        return []
    ended: dict[tuple[str, str], int] = {}  # of the files before, by topic and type
    found: dict[str, list[Restart]] = {}
    for storage in storages:
        topics = {item.id: (item.topic, item.msgtype) for item in storage.connections}
        last: dict[int, int] = {}  # a file may have several connections of a topic side by side
        for number, times in _times(storage):
            topic = topics.get(number, ('', ''))
            known = [time for time in times if time <= LAST_TIME]  # the others are left out
            before_them = last.get(number, ended.get(topic))
            for before, after in _steps_back(before_them, known) if known else ():
                found.setdefault(topic[0], []).append(
                    Restart(topic[0], storage.path.name, before, after))
            last.update({number: known[-1]} if known else {})
        for number, time in last.items():
            topic = topics.get(number, ('', ''))
            ended[topic] = max(time, ended.get(topic, time))
    return max(found.values(), key=len, default=[])  # each restart shows in many topics


def _are_consecutive(storages: Sequence[Any]) -> bool:
    spans = [(item.metadata.start_time, item.metadata.end_time) for item in storages
             if getattr(item, 'metadata', None) and item.metadata.message_count]
    return all(start > end - _TOLERANCE_NS for (_, end), (start, _) in pairwise(spans))


def _steps_back(last: int | None, listed: Sequence[int]) -> Iterator[tuple[int, int]]:
    if last is not None and last - listed[0] > _TOLERANCE_NS:
        yield last, listed[0]
    if listed != sorted(listed):  # rare, and O(n) where it is sorted
        for before, after in pairwise(listed):
            if before - after > _TOLERANCE_NS:
                yield before, after


def _times(storage: Any) -> _Times:
    if isinstance(storage, McapReader):
        for chunk in sorted(storage.chunks, key=lambda item: item.chunk_start_offset):
            yield from times_of_chunk(storage, chunk)
    elif isinstance(storage, Sqlite3Reader):
        yield from _times_of_rows(storage)
    else:
        for number, entries in storage.indexes.items():
            entries = sorted(entries, key=lambda item: (item.chunk_pos, item.offset))
            if entries:
                yield number, array('Q', (item.time for item in entries))


# ---- SQLite ------------------------------------------------------------------------------------

def _is_in_order(storage: Sqlite3Reader) -> bool:
    """Return whether no row is much earlier than the row before, of any topic."""
    assert storage.dbconn is not None
    (pairs, back), = storage.dbconn.execute(
        'SELECT count(*), sum(row.timestamp - later.timestamp > ?) '
        'FROM messages AS row NOT INDEXED '
        'CROSS JOIN messages AS later NOT INDEXED ON later.id = row.id + 1', (_TOLERANCE_NS,))
    return not back and bool(pairs >= storage.metadata.message_count - 1)  # no id is left out


def _times_of_rows(storage: Sqlite3Reader) -> _Times:
    assert storage.dbconn is not None
    found: dict[int, array[int]] = {}
    for topic, time in storage.dbconn.execute(
            'SELECT topic_id, timestamp FROM messages NOT INDEXED '
            "WHERE typeof(timestamp) = 'integer' ORDER BY id"):
        found.setdefault(topic, array('q')).append(time)
    yield from found.items()


# ---- MCAP --------------------------------------------------------------------------------------

def times_of_chunk(storage: McapReader, chunk: ChunkInfo) -> _Times:
    """Yield the times of messages by the index behind a chunk; without one, by the messages."""
    assert storage.bio is not None
    if not chunk.message_index_offsets:
        yield from _times_of_messages(storage, chunk)
    for place in chunk.message_index_offsets.values():
        storage.bio.seek(place)
        _, _, channel, size = _INDEX_HEADER.unpack(storage.bio.read(_INDEX_HEADER.size))
        numbers = array('Q', storage.bio.read(size))
        times, offsets = numbers[::2], numbers[1::2]
        if offsets != array('Q', sorted(offsets)):
            times = array('Q', (time for _, time in sorted(zip(offsets, times))))
        if times:
            yield channel, times


def _times_of_messages(storage: McapReader, chunk: ChunkInfo) -> _Times:
    found: dict[int, array[int]] = {}
    for channel, time, _, _ in messages_of(content(storage, chunk)):
        found.setdefault(channel, array('Q')).append(time)
    yield from found.items()
