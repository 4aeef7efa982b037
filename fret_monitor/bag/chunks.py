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
Reads the chunks of MCAP files, in which messages lie one after another.

`rosbags` opens the file and reads its index. It also yields messages, but takes 2 us for each,
most of them for streams of bytes and a heap of all chunks; here it is a quarter of that.
"""

from collections.abc import Collection, Iterable, Iterator
from heapq import merge
from itertools import chain
from operator import itemgetter
import struct

from rosbags.interfaces import Connection
from rosbags.rosbag2.storage_mcap import ChunkInfo, decompress, McapReader

_CHUNK_CRC = 9 + 24  # where it is in the record of a chunk
_CHUNK_CONTENT = 9 + 40  # and the content, without the name of its compression
_MESSAGE = 5
_HEADER = struct.Struct('<BQ')  # of a record: kind, and length of what follows
_MESSAGE_HEADER = struct.Struct('<BQHIQQ')  # and then channel, number, time, time of publication
_WRONG_LENGTH = 'a record in a chunk has a wrong length'
_Message = tuple[Connection, int, bytes]


def content(storage: McapReader, chunk: ChunkInfo) -> bytes:
    """Return the records of a chunk; any exception if it is damaged, also by its checksum."""
    assert storage.bio is not None
    storage.bio.seek(chunk.chunk_start_offset + _CHUNK_CRC)
    checksum = int.from_bytes(storage.bio.read(4), 'little')
    storage.bio.seek(chunk.chunk_start_offset + _CHUNK_CONTENT + len(chunk.compression))
    return decompress(storage.bio.read(chunk.compressed_size), chunk.compression,
                      chunk.uncompressed_size, checksum)


def messages_of(records: bytes) -> Iterator[tuple[int, int, int, int]]:
    """
    Yield the messages among the records of a chunk: channel, time, and begin and end of the data.

    Raises
    ------
    ValueError
        if the records do not end with the chunk, or one is too short for a message.
    """
    place, size, unpack = 0, len(records), _MESSAGE_HEADER.unpack_from
    last = size - _MESSAGE_HEADER.size
    while place <= last:
        kind, length, channel, _, time, _ = unpack(records, place)
        begin = place + _MESSAGE_HEADER.size
        place += _HEADER.size + length
        if kind == _MESSAGE:
            if not begin <= place <= size:
                raise ValueError(_WRONG_LENGTH)
            yield channel, time, begin, place
    while place + _HEADER.size <= size:  # too short for a message
        kind, length = _HEADER.unpack_from(records, place)
        place += size + 1 if kind == _MESSAGE else _HEADER.size + length
    if place != size:
        raise ValueError(_WRONG_LENGTH)


def messages(storage: McapReader, connections: Collection[Connection],
             stop: int | None) -> Iterator[_Message]:
    """
    Yield the messages of connections before a time, in the order of times and then of chunks.

    That is what `storage.messages(connections, None, stop)` yields of a file with chunks. Not
    more chunks are in memory than overlap in time.

    Raises
    ------
    Exception
        of any type where the file is damaged, after the messages before that place.
    """
    wanted = {item.id: item for item in connections}
    chunks = [item for item in storage.chunks
              if (stop is None or item.message_start_time < stop)
              and any(item.channel_count.get(number, 0) for number in wanted)]
    chunks.sort(key=lambda item: (item.message_start_time, item.chunk_start_offset))

    def read(chunk: ChunkInfo) -> Iterator[_Message]:
        return _messages(storage, chunk, wanted, stop)

    def read_late(chunk: ChunkInfo) -> Iterator[tuple[int, int, _Message | None]]:
        """Yield the messages with what orders them; the first item is before all of them."""
        yield chunk.message_start_time, chunk.chunk_start_offset, None
        for item in read(chunk):
            yield item[1], chunk.chunk_start_offset, item

    def read_all(group: list[ChunkInfo]) -> Iterable[_Message]:
        if len(group) == 1:
            return read(group[0])
        merged = merge(*map(read_late, group), key=itemgetter(0, 1))
        return (item for _, _, item in merged if item is not None)

    return chain.from_iterable(map(read_all, _overlapping(chunks)))


def _overlapping(chunks: Iterable[ChunkInfo]) -> Iterator[list[ChunkInfo]]:
    """Yield chunks that overlap in time together; they are given by their begins."""
    group: list[ChunkInfo] = []
    end = 0
    for chunk in chunks:
        if group and chunk.message_start_time > end:
            yield group
            group = []
        group.append(chunk)
        end = max(end, chunk.message_end_time)
    if group:
        yield group


def _messages(storage: McapReader, chunk: ChunkInfo, wanted: dict[int, Connection],
              stop: int | None) -> Iterator[_Message]:
    """Yield the messages of a chunk in the order of their times, and then raise its damage."""
    records = content(storage, chunk)
    found: list[_Message] = []
    damage: ValueError | None = None
    try:
        found.extend((wanted[channel], time, records[begin:end])  # keeps those before an exception
                     for channel, time, begin, end in messages_of(records) if channel in wanted)
    except ValueError as error:
        damage = error
    del records
    found.sort(key=itemgetter(1))
    first, last = chunk.message_start_time, chunk.message_end_time
    if found and not first <= found[0][1] <= found[-1][1] <= last:
        found = [item for item in found if first <= item[1] <= last]
        damage = ValueError('a chunk has messages outside its times')
    yield from found if stop is None else (item for item in found if item[1] < stop)
    if damage is not None:
        raise damage
