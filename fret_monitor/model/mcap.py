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
Writes MCAP files, which rosbag2, `rosbags` and Foxglove read (https://mcap.dev/spec).

Messages lie in uncompressed chunks with an index. Nothing beside Python's library is needed, so
that a robot can write them.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
import struct
from typing import BinaryIO
from zlib import crc32

_MAGIC = b'\x89MCAP0\r\n'
_CHUNK_BYTES = 1 << 20
_INDEX_BYTES = 16  # of a message
_END_BYTES = 300  # of the last chunk and its index, the statistics, and what ends the file
_CHANNEL_BYTES = 35  # of a topic, in both
_HEADER, _FOOTER, _SCHEMA, _CHANNEL, _MESSAGE = 1, 2, 3, 4, 5
_CHUNK, _MESSAGE_INDEX, _CHUNK_INDEX, _STATISTICS, _METADATA = 6, 7, 8, 11, 12
_METADATA_INDEX, _DATA_END = 13, 15
_FOOTER_BYTES = 20


@dataclass
class _Chunk:
    """Messages that were not written yet: time, channel, and record of each."""

    messages: list[tuple[int, int, bytes]] = field(default_factory=list)
    size: int = 0


class McapWriter:
    """Writes to a file that is open; the caller closes it, after `end`."""

    def __init__(self, file: BinaryIO) -> None:
        """Begin a file; raises `OSError`, as do all methods."""
        self._file = file
        self._written = 0
        self._chunk = _Chunk()
        self._definitions: list[bytes] = []  # records of schemas and channels, for the summary
        self._schemas: dict[str, int] = {}
        self._counts: list[int] = []  # messages of each channel
        self._sequence = 0
        self._chunk_indices: list[bytes] = []
        self._metadata_indices: list[bytes] = []
        self._has_ended = False
        self._summary_bytes = 0  # of definitions and indices
        self._start = self._end = 0
        self._write(_MAGIC)
        self._write(_record(_HEADER, _text('ros2') + _text('fret_monitor')))

    @property
    def size(self) -> int:
        """The bytes of the file; before its end, about those it has if it ends now, or more."""
        if self._has_ended:
            return self._written
        return (self._written + self._chunk.size + _INDEX_BYTES * len(self._chunk.messages)
                + _CHANNEL_BYTES * len(self._counts) + self._summary_bytes + _END_BYTES)

    def add_channel(self, topic: str, message_type: str, definition: str) -> int:
        """
        Add a topic, and return its number.

        `definition` is that of the message and of all within it (`ros2msg`); empty: not known.
        """
        if message_type not in self._schemas:
            self._schemas[message_type] = len(self._schemas) + 1
            self._define(_record(_SCHEMA, struct.pack('<H', self._schemas[message_type])
                                 + _text(message_type) + _text('ros2msg' if definition else '')
                                 + _text(definition)))
        number = len(self._counts)
        self._counts.append(0)
        self._define(_record(_CHANNEL, struct.pack('<HH', number, self._schemas[message_type])
                             + _text(topic) + _text('cdr') + _map({})))
        return number

    def add_message(self, channel: int, time: int, data: bytes, sent: int = 0) -> None:
        """Add a serialized message of a channel; times in nanoseconds, 0 or more."""
        self._sequence = (self._sequence + 1) & 0xffffffff
        record = _record(_MESSAGE, struct.pack(
            '<HIQQ', channel, self._sequence, time, sent or time) + data)
        self._chunk.messages.append((time, channel, record))
        self._chunk.size += len(record)
        if self._chunk.size >= _CHUNK_BYTES:
            self._write_chunk()

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add texts about the whole file."""
        self._write_chunk()
        place = self._written
        self._write(_record(_METADATA, _text(name) + _map(values)))
        self._metadata_indices.append(_record(_METADATA_INDEX, struct.pack(
            '<QQ', place, self._written - place) + _text(name)))
        self._summary_bytes += len(self._metadata_indices[-1])

    def end(self) -> None:
        """Write what waits, and the index; nothing can be added any more."""
        self._write_chunk()
        self._write(_record(_DATA_END, struct.pack('<I', 0)))
        begin = self._written
        statistics = _record(_STATISTICS, struct.pack(
            '<QHIIIIQQ', sum(self._counts), len(self._schemas), len(self._counts), 0,
            len(self._metadata_indices), len(self._chunk_indices), self._start, self._end)
            + _array('<HQ', enumerate(self._counts)))
        summary = b''.join([
            *self._definitions, statistics, *self._chunk_indices, *self._metadata_indices,
            struct.pack('<BQQQ', _FOOTER, _FOOTER_BYTES, begin, 0)])
        self._write(summary + struct.pack('<I', crc32(summary)) + _MAGIC)
        self._has_ended = True

    def _define(self, record: bytes) -> None:
        self._definitions.append(record)
        self._summary_bytes += len(record)
        self._write_chunk()
        self._write(record)

    def _write(self, data: bytes) -> None:
        self._file.write(data)
        self._written += len(data)

    def _write_chunk(self) -> None:
        """Write the messages that wait, in the order of their times, and their index."""
        messages = sorted(self._chunk.messages, key=lambda item: item[0])
        if not messages:
            return
        indices: dict[int, list[tuple[int, int]]] = {}
        offset = 0
        for time, channel, record in messages:
            indices.setdefault(channel, []).append((time, offset))
            self._counts[channel] += 1
            offset += len(record)
        start, end = messages[0][0], messages[-1][0]
        place = self._written
        content = b''.join(record for _, _, record in messages)
        self._write(_record(_CHUNK, b''.join([
            struct.pack('<QQQI', start, end, offset, crc32(content)), _text(''),
            struct.pack('<Q', offset), content])))
        length = self._written - place
        places = {}
        for channel, entries in indices.items():
            places[channel] = self._written
            self._write(_record(
                _MESSAGE_INDEX, struct.pack('<H', channel) + _array('<QQ', entries)))
        self._chunk_indices.append(_record(_CHUNK_INDEX, b''.join([
            struct.pack('<QQQQ', start, end, place, length), _array('<HQ', places.items()),
            struct.pack('<Q', self._written - place - length), _text(''),
            struct.pack('<QQ', offset, offset)])))
        self._summary_bytes += len(self._chunk_indices[-1])
        is_first = len(self._chunk_indices) == 1
        self._start = start if is_first else min(self._start, start)
        self._end = max(self._end, end)
        self._chunk = _Chunk()


def _record(kind: int, content: bytes) -> bytes:
    return struct.pack('<BQ', kind, len(content)) + content


def _text(text: str) -> bytes:
    data = text.encode()
    return struct.pack('<I', len(data)) + data


def _map(values: Mapping[str, str]) -> bytes:
    data = b''.join(_text(name) + _text(value) for name, value in values.items())
    return struct.pack('<I', len(data)) + data


def _array(shape: str, items: Iterable[tuple[int, int]]) -> bytes:
    data = b''.join(struct.pack(shape, *item) for item in items)
    return struct.pack('<I', len(data)) + data
