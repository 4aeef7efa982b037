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
The black box: writes the last messages to a file at each violation (docs/recordings.md).

C keeps the messages in a ring (`runtime.message_ring`). A thread looks ten times a second whether
a violation has begun, and then copies the messages from the ring to a file, in small pieces.
"""

from contextlib import suppress
from datetime import datetime, UTC
from itertools import count
import os
from pathlib import Path
from tempfile import TemporaryFile
from threading import Event
from time import monotonic_ns, time

from fret_monitor.model.manifest import Manifest
from fret_monitor.model.mcap import McapWriter
from fret_monitor.ros.intake import native_lifetimes
from fret_monitor.ros.intake.node_time import as_time
from fret_monitor.ros.settings.parameters import BlackBoxSettings, Refusal
from fret_monitor.ros.watch import WatchedThread
from fret_monitor.runtime import Engine, KeptCounts, KeptMessage, MessageRing, Occurrences
from fret_monitor.runtime.reporting import BlackBoxCounts

from rclpy.node import Node
from rclpy.serialization import serialize_message
from std_msgs.msg import Header

_POLL_S = 0.1
_AFTER_NS = 2_000_000_000  # a file ends so long after the last violation in it
_LONGEST_NS = 60_000_000_000  # after the first violation in it, at most
_PART_AGE_S = 120.0  # after which a file that is not whole is not being written any more
_JUMP_NS = 500_000_000  # messages that are so much older than those before are of another run
_SHARE_BEFORE = 0.75  # of a file's bytes, at most, that are for what was before the violation
_RECORD_BYTES = 47  # of a message in a file, beside its data
_LAST_BYTES = 1024  # for what is added when a file is complete
_LONGEST_NAME = 100  # characters of a requirement, and of a node, in the name of a file
_END_TOPIC, _END_TYPE = '~/blackbox_end', 'std_msgs/msg/Header'
_PREFIX = 'blackbox_'
_PART_PREFIX = f'.{_PREFIX}'
_NO_MESSAGES = KeptCounts()


class BlackBox:
    """Writes a file at each violation, while it runs; from each `start` to the next `end`."""

    def __init__(self, node: Node, manifest: Manifest, settings: BlackBoxSettings) -> None:
        """
        Prepare to write messages of the topics in a manifest.

        Raises
        ------
        Refusal
            if the folder cannot be written to.
        """
        self._node = node
        self._manifest = manifest
        self._ring: MessageRing | None = None
        self._settings = settings
        self._definitions = {topic.message_type: _definition(topic.message_type)
                             for topic in manifest.topics}
        self._definitions[_END_TYPE] = _definition(_END_TYPE)
        self._pending: _Pending | None = None
        self._written = self._failed = 0
        self._is_over = Event()
        self._thread: WatchedThread | None = None
        prepare_folder(settings.folder)

    def keep_messages(self, engine: Engine) -> None:
        """
        Keep the messages of an engine from now on; all engines share one memory.

        Raises
        ------
        Refusal
            if there is not so much memory.
        """
        if self._ring is None:
            try:
                self._ring = MessageRing(
                    engine.library, self._settings.memory_bytes, self._settings.seconds)
            except MemoryError as error:
                raise Refusal(f"parameter 'blackbox_bytes': {error}") from None
        engine.keep_messages(self._ring)

    def start(self) -> None:
        """Start the thread."""
        self._is_over.clear()
        self._thread = WatchedThread('blackbox', self._run)
        native_lifetimes.keep(self)
        self._thread.start()

    def end(self) -> None:
        """Write what is pending, and end the thread; a second call does nothing."""
        self._is_over.set()
        if self._thread is not None:
            self._thread.join()
        native_lifetimes.release(self)

    @property
    def failure(self) -> Exception | None:
        """The error that ended the thread, if any; no file is written after it."""
        return None if self._thread is None else self._thread.failure

    def counts(self) -> BlackBoxCounts:
        """Return what was written so far."""
        messages = _NO_MESSAGES if self._ring is None else self._ring.counts()
        return BlackBoxCounts(self._written, self._failed, messages)

    def _run(self) -> None:
        try:
            self._loop()
        finally:
            if self._pending is not None:
                self._pending.discard()
                self._pending = None

    def _loop(self) -> None:
        is_over = False
        while not is_over:
            is_over = self._is_over.wait(_POLL_S)
            try:
                if self._ring is not None:
                    self._look(self._ring, is_over)
            except OSError as error:
                self._give_up(error)

    def _look(self, ring: MessageRing, is_over: bool) -> None:
        """Begin a file at a violation; continue the one that is pending, and end it in time."""
        found = ring.take_occurrences()
        if found is not None and self._pending is not None:
            if self._pending.joins(found, ring):
                found = None
            else:
                self._finish(self._pending)
        if found is not None:
            self._begin(found)
        if self._pending is None:
            return
        now = monotonic_ns()
        # Before copying: the file then has all messages until this time.
        self._pending.note_time(now, self._node.get_clock().now().nanoseconds)
        self._pending.copy(ring)
        self._make_room(self._pending.size)
        if is_over or self._pending.is_complete(now):
            self._finish(self._pending)

    def _begin(self, found: Occurrences) -> None:
        self._make_room(0)
        item = self._manifest.requirements[found.requirement]
        began = time() - (monotonic_ns() - found.first) / 1e9
        stamp = datetime.fromtimestamp(began, UTC).strftime('%Y%m%dT%H%M%S.%f')[:-3]
        node = self._node.get_fully_qualified_name().strip('/').replace('/', '_')
        name = (f'{stamp}Z_{node[-_LONGEST_NAME:]}_'
                f'{item.handler.removeprefix("handlerprop")[:_LONGEST_NAME]}')
        self._pending = _Pending(self._settings, name, found, {
            'bundle': self._manifest.name, 'requirement': item.id})
        self._pending.open([
            *((self._node.resolve_topic_name(topic.name), topic.message_type,
               self._definitions[topic.message_type]) for topic in self._manifest.topics),
            (self._node.resolve_topic_name(_END_TOPIC), _END_TYPE, self._definitions[_END_TYPE])])

    def _finish(self, pending: '_Pending') -> None:
        pending.finish()
        self._written += 1
        self._node.get_logger().info(f'the last messages are in {pending.path}')
        self._pending = None

    def _give_up(self, error: OSError) -> None:
        if self._pending is not None:
            self._pending.discard()
            self._pending = None
        self._failed += 1
        if self._failed == 1:
            self._node.get_logger().error(
                f'the black box cannot write to {self._settings.folder}: '
                f'{error.strerror or error}; /diagnostics counts the files that are missing')

    def _make_room(self, size: int) -> None:
        """Remove the oldest files, so that one of a size and those that stay are not too many."""
        files = sorted(_files_in(self._settings.folder), key=lambda item: item[0])
        used = size + sum(length for _, length, _ in files)
        for number, (_, length, path) in enumerate(files):
            if len(files) - number < self._settings.files and used <= self._settings.disk_bytes:
                return
            path.unlink(missing_ok=True)
            used -= length


class _Pending:
    """A file that is being written, under a name that says so."""

    def __init__(self, settings: BlackBoxSettings, name: str, found: Occurrences,
                 metadata: dict[str, str]) -> None:
        self.path = settings.folder
        self._part: Path | None = None
        self._settings = settings
        self._name = name
        self._first = found.first
        self._last = found.first + _LONGEST_NS
        self._until = min(found.last + _AFTER_NS, self._last)
        self._since = found.first - int(settings.seconds * 1e9)
        self._metadata = metadata
        self._count = found.number
        self._place = 0
        self._time = 0  # of the last message that had one
        self._end = 0  # the node's time until which all messages are in the file
        self._excess: int | None = None  # bytes of the oldest messages, which are left out
        self._jump: int | None = None  # when a message of another run was kept
        self._is_full = False

    @property
    def size(self) -> int:
        """The bytes of the file, if it were complete."""
        return self._writer.size + _LAST_BYTES

    def is_complete(self, now: int) -> bool:
        """Return whether nothing is added any more."""
        return now > self._until or self._is_full or self._jump is not None

    def joins(self, found: Occurrences, ring: MessageRing) -> bool:
        """Go on until some time after later violations; return False if that is too long."""
        is_in_time = found.last <= self._last
        if is_in_time:
            self._until = min(found.last + _AFTER_NS, self._last)
        self.copy(ring)
        if not is_in_time or self._is_full or self._jump is not None and found.last >= self._jump:
            return False
        self._count += found.number
        return True

    def open(self, topics: list[tuple[str, str, str]]) -> None:
        """
        Create the file, with name, type and definition of each topic.

        The last one is for the message that marks the end. Other nodes may use the folder, so no
        file is opened that exists, or that is going to have a name that exists.
        """
        folder, self._topics = self._settings.folder, topics
        for number in count(1):
            name = self._name if number == 1 else f'{self._name}_{number}'
            part = folder / f'{_PART_PREFIX}{name}.part'
            try:
                self._file = part.open('xb')
            except FileExistsError:
                continue
            self._part, self.path = part, folder / f'{_PREFIX}{name}.mcap'
            if not self.path.exists():
                break
            self.discard()
        self._write_head()

    def _write_head(self) -> None:
        self._file.seek(0)
        self._file.truncate()
        self._writer = McapWriter(self._file)
        for topic in self._topics:
            self._writer.add_channel(*topic)

    def note_time(self, steady: int, now: int) -> None:
        """Note the node's time before all messages are copied that came until then."""
        if steady <= self._until:
            self._end = now

    def copy(self, ring: MessageRing) -> None:
        """Copy the messages that came since the last call, as far as they belong to the file."""
        if self._excess is None:
            self._excess = self._measure(ring)
        for place, message in ring.read(self._place):
            if message.steady > self._until or self._is_full:
                return
            is_before = message.steady <= self._first
            if 0 < message.time < self._time - _JUMP_NS:  # /clock began anew
                if not is_before:
                    self._jump = message.steady
                    return
                self._write_head()
            self._time = message.time or self._time
            # Without a time: they came before /clock, or before time 0.
            if message.steady >= self._since and self._time > 0:
                self._add(message, is_before=is_before)
            self._place = place

    def _measure(self, ring: MessageRing) -> int:
        """Return by how many bytes the messages before the violation are too many."""
        room = int(_SHARE_BEFORE * (self._settings.disk_bytes - self.size))
        if 2 * self._settings.memory_bytes <= room:
            return 0
        return max(0, sum(_RECORD_BYTES + len(message.data) for _, message in ring.read(0)
                          if self._since <= message.steady <= self._first) - room)

    def _add(self, message: KeptMessage, *, is_before: bool) -> None:
        size = _RECORD_BYTES + len(message.data)
        if is_before and self._excess is not None and size <= self._excess:
            self._excess -= size
        elif not is_before and self.size + size > self._settings.disk_bytes:
            self._is_full = True
        else:
            self._excess = 0
            self._writer.add_message(
                message.topic, self._time, message.data, max(0, message.sent))

    def finish(self) -> None:
        """Complete the file, and give it its name."""
        # A recording ends with its last message, and what is due later would not be judged.
        if not self._is_full and self._jump is None and self._end > self._time:
            self._writer.add_message(len(self._topics) - 1, self._end, serialize_message(
                Header(stamp=as_time(self._end), frame_id=self._metadata['requirement'])))
        self._writer.add_metadata(
            'fret_monitor', {**self._metadata, 'occurrences': str(self._count)})
        self._writer.end()
        self._file.flush()
        os.fsync(self._file.fileno())
        self._file.close()
        assert self._part is not None
        self._part.rename(self.path)

    def discard(self) -> None:
        """Remove the file."""
        with suppress(OSError, AttributeError):
            self._file.close()
        if self._part is not None:
            with suppress(OSError):
                self._part.unlink(missing_ok=True)


def prepare_folder(folder: Path) -> None:
    """
    Create the folder, and write to it once.

    Raises
    ------
    Refusal
        if that is not possible.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=folder) as file:
            file.write(b'\0')
    except OSError as error:
        raise Refusal(f"parameter 'blackbox': cannot write to the folder '{folder}': "
                      f'{error.strerror or error}') from None


def _files_in(folder: Path) -> list[tuple[float, int, Path]]:
    """Return time, size and path of the files of black boxes, except one that is being written."""
    found = []
    for path in folder.iterdir():
        is_part = path.name.startswith(_PART_PREFIX) and path.suffix == '.part'
        if is_part or (path.name.startswith(_PREFIX) and path.suffix == '.mcap'):
            with suppress(FileNotFoundError):  # another node has removed it
                status = path.stat()
                if not is_part or time() - status.st_mtime > _PART_AGE_S:
                    found.append((status.st_mtime, status.st_size, path))
    return found


def _definition(message_type: str) -> str:
    """Return the definition of an installed message; empty if only its Python is installed."""
    # Imported here: a node loads the parsers only when it needs them.
    from fret_monitor.messages.installed import complete_definition, find_message
    from fret_monitor.model.diagnostics import CompileError
    try:
        return complete_definition(find_message(message_type))
    except CompileError:
        return ''
