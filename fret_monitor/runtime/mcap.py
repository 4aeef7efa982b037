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

"""A wrapper of `csrc/engine/mcap.h`: writes MCAP files, which `rosbags` and Foxglove read."""

from collections.abc import Mapping
import os
from typing import Any, BinaryIO

from fret_monitor.native import evaluator_library, load_evaluator
from fret_monitor.native.binding import ffi


class McapWriter:
    """Writes to a file that is open; the caller closes it, after `end`."""

    def __init__(self, file: BinaryIO) -> None:
        """Begin a file; raises `OSError`, as do all methods that write."""
        self._library: Any = load_evaluator(evaluator_library())
        file.flush()
        pointer = self._library.fm_mcap_create(file.fileno())
        if pointer == ffi.NULL:
            raise MemoryError('too little memory for a recording')
        self._pointer: Any = ffi.gc(pointer, self._library.fm_mcap_destroy)
        self._refuse_errors()

    def _refuse_errors(self) -> None:
        error = self._library.fm_mcap_error(self._pointer)
        if error != 0:
            raise OSError(error, os.strerror(error))

    @property
    def size(self) -> int:
        """The bytes of the file; before its end, about those it has if it ends now, or more."""
        return int(self._library.fm_mcap_size(self._pointer))

    def add_channel(self, topic: str, message_type: str, definition: str) -> int:
        """
        Add a topic, and return its number.

        `definition` is that of the message and of all within it (`ros2msg`); empty: not known.
        """
        pieces = [_text(definition)] if definition else []
        number = self._library.fm_mcap_add_channel(
            self._pointer, _text(topic), _text(message_type),
            ffi.new('char *[]', [*pieces, ffi.NULL]))
        self._refuse_errors()
        return int(number)

    def add_message(self, channel: int, time: int, data: bytes, sent: int = 0) -> None:
        """Add a serialized message of a channel; times in nanoseconds, 0 or more."""
        self._library.fm_mcap_add_message(
            self._pointer, channel, time, sent, ffi.from_buffer('uint8_t[]', data), len(data))
        self._refuse_errors()

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add texts about the whole file."""
        texts = [(_text(key), _text(value)) for key, value in values.items()]
        self._library.fm_mcap_add_metadata(
            self._pointer, _text(name), ffi.new('struct fm_mcap_text[]', texts), len(texts))
        self._refuse_errors()

    def end(self) -> None:
        """Write what waits, and the index; nothing can be added any more."""
        self._library.fm_mcap_end(self._pointer)
        self._refuse_errors()


def _text(text: str) -> Any:
    return ffi.new('char[]', text.encode())
