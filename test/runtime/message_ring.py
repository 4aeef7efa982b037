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

"""A wrapper of the ring of `blackbox.c`: the last messages of an engine. Without ROS."""

from collections.abc import Iterator
from functools import partial
from typing import Any, NamedTuple

from fret_monitor.native.binding import ffi
from fret_monitor.runtime import Engine

_PIECE_BYTES = 1 << 16  # copied at once, while messages wait
_HEADER_BYTES: int = ffi.sizeof('struct fm_kept')


class KeptMessage(NamedTuple):
    """
    A serialized message of a topic (its index in the manifest).

    `steady` is when it was kept, by `time.monotonic_ns`; `time` its stamp in the node's time, 0 if
    there was none; `sent` the publisher's time (ns; 0: not known).
    """

    topic: int
    steady: int
    time: int
    sent: int
    data: bytes


class Occurrences(NamedTuple):
    """Violations that began: their number, the first and the last (`monotonic_ns`)."""

    number: int
    first: int
    last: int
    requirement: int  # of the first


class KeptCounts(NamedTuple):
    """Messages kept; too large for the ring; overwritten before they were old enough."""

    kept: int = 0
    left_out: int = 0
    early: int = 0


class MessageRing:
    """The last messages of an engine; one thread at a time may read them."""

    def __init__(self, library: Any, size: int, seconds: float) -> None:
        """
        Take `size` bytes of memory, in which messages should last for so many seconds.

        Raises
        ------
        MemoryError
            if there is not so much.
        """
        pointer = library.fm_blackbox_create(size, int(seconds * 1e9))
        if pointer == ffi.NULL:
            raise MemoryError(f'no {size} bytes of memory')
        self._library = library
        # Holds the library too: a reference to its function would not keep it open.
        self.pointer: Any = ffi.gc(pointer, partial(_destroy, library), size)
        self._begin: Any = ffi.new('uint64_t *')
        self._piece: Any = ffi.new('uint8_t[]', _PIECE_BYTES)

    def keep_messages_of(self, engine: Engine) -> None:
        """Keep each message, and note when violations begin; call it before any is delivered."""
        self._engine = engine  # both live as long as each other
        engine.library.fm_engine_keep_messages(engine.pointer, self.pointer)

    def take_occurrences(self) -> Occurrences | None:
        """Return the violations that began since the last call; None if there are none."""
        found = self._library.fm_blackbox_take_occurrences(self.pointer)
        if found.n == 0:
            return None
        return Occurrences(found.n, found.first, found.last, found.requirement)

    def read(self, place: int) -> Iterator[tuple[int, KeptMessage]]:
        """
        Yield each message from a place on, and the place behind it; 0 is where the oldest begins.

        Messages are copied in small pieces while others come; those overwritten are left out.
        """
        begin, data = place, bytearray()
        while True:
            found = self._library.fm_blackbox_copy(
                self.pointer, begin + len(data), self._piece, _PIECE_BYTES, self._begin)
            if begin + len(data) < self._begin[0]:
                begin, data = self._begin[0], bytearray()
                continue
            if found == 0:
                return
            data += ffi.buffer(self._piece, found)
            used = 0
            for end, message in _messages(data):
                used = end
                yield begin + end, message
            begin += used
            del data[:used]

    def counts(self) -> KeptCounts:
        """Return how many messages were kept, and were not."""
        found = self._library.fm_blackbox_count(self.pointer)
        return KeptCounts(found.kept, found.left_out, found.early)


def _messages(data: bytearray) -> Iterator[tuple[int, KeptMessage]]:
    """Yield the whole messages in some bytes of the ring, and where each ends."""
    place = 0
    while place + _HEADER_BYTES <= len(data):
        header: Any = ffi.from_buffer('struct fm_kept *', bytes(data[place:place + _HEADER_BYTES]))
        begin = place + _HEADER_BYTES
        place = begin + header.size
        if place > len(data):
            return
        yield place, KeptMessage(
            header.topic, header.steady, header.time, header.sent, bytes(data[begin:place]))


def _destroy(library: Any, pointer: Any) -> None:
    library.fm_blackbox_destroy(pointer)
