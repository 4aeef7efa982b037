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

"""Damages recordings: the answer may only be the right one, or an error."""

from dataclasses import dataclass
from pathlib import Path
from random import Random
import shutil
import struct
import tempfile
import time

from bag.recordings import FLOAT, Message, START, TYPES, write
from fret_monitor.bag.check import check_recording, RecordingResult, Selection
from fret_monitor.model.diagnostics import CompileError
from fret_monitor.runtime.mcap import McapWriter
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.typesys import get_typestore, Stores

BUNDLE = """format: 1
evaluation: {policy: timed}
inputs:
  level: {topic: level, type: std_msgs/msg/Float64, timeout: 0.2, stale: violate}
  flow: {topic: flow, type: std_msgs/msg/Float64, initial: 0}
requirements:
  - {id: LOW, ptltl: "H (level < 0.9)"}
  - {id: SOON, ptltl: "H (level > 0.5 -> O[0, 30 ms] flow > 0.5)"}
  - {id: FLOW, ptltl: "flow < 0.95"}
"""
MESSAGES = 60
KINDS = ('zeroed', 'flipped', 'cut', 'inserted', 'repeated')
_BEFORE_BYTES = {'.mcap': 31, '.db3': 0, '.bag': 0}  # a message, that no checksum covers either
Answer = tuple[tuple[object, ...], ...]


@dataclass(frozen=True)
class Subject:
    """A recording: its files, its answer, and where its messages are if nothing checks them."""

    path: Path
    answer: Answer
    unchecked: tuple[tuple[Path, range], ...]

    def may_change(self, file: Path, damaged: range) -> bool:
        """Return whether bytes belong to a message that no checksum covers."""
        return any(file == other and max(part.start, damaged.start) < min(part.stop, damaged.stop)
                   for other, part in self.unchecked)


def subjects(folder: Path, rng: Random) -> list[Subject]:
    """Write recordings in all storages, with checksums and without."""
    bundle = folder / 'bundle.yaml'
    bundle.write_text(BUNDLE, encoding='utf-8')
    stamp = 0
    messages: list[Message] = []
    for _ in range(MESSAGES):
        stamp += rng.choice([1_000_000, 10_000_000, 30_000_000, 150_000_000])
        messages.append((rng.choice(['/level', '/flow']), stamp, rng.random()))
    checked = folder / 'checked.mcap'
    with checked.open('wb') as file:
        _write_checked(McapWriter(file), messages)
    database = write(folder / 'database', messages, storage=StoragePlugin.SQLITE3)
    plain = write(folder / 'plain', messages)
    single = folder / 'single.db3'
    shutil.copy(database / 'database.db3', single)
    old = folder / 'old.bag'
    _write_ros1(old, messages)
    return [_subject(bundle, path, messages)
            for path in (checked, database, plain, single, old)]


def _write_checked(writer: McapWriter, messages: list[Message]) -> None:
    definition, _ = TYPES.generate_msgdef(FLOAT, ros_version=2)
    channels = {topic: writer.add_channel(topic, FLOAT, definition)
                for topic in ('/level', '/flow')}
    for number, (topic, stamp, value) in enumerate(messages):
        writer.add_message(channels[topic], START + stamp, _serialized(value))
        if number == MESSAGES // 2:  # the next ones are in another chunk
            writer.add_metadata('half', {})
    writer.end()


def _write_ros1(path: Path, messages: list[Message]) -> None:
    types = get_typestore(Stores.ROS1_NOETIC)
    with Writer1(path) as writer:
        connections = {topic: writer.add_connection(topic, FLOAT, typestore=types)
                       for topic in ('/level', '/flow')}
        for topic, stamp, value in messages:
            writer.write(connections[topic], START + stamp, struct.pack('<d', value))


def _serialized(value: float) -> bytes:
    return b'\0\1\0\0' + struct.pack('<d', value)


def _subject(bundle: Path, path: Path, messages: list[Message]) -> Subject:
    result = check_recording(bundle, path, Selection())
    assert result.errors == () and any(item.occurrences for item in result.findings)
    unchecked = []
    if not result.has_checksums:
        for file in files(path):
            content = file.read_bytes()
            for _, _, value in messages:
                place = content.find(struct.pack('<d', value)) - 4
                if place > 0:
                    unchecked.append((file, range(place - _BEFORE_BYTES[file.suffix], place + 12)))
        assert len(unchecked) == len(messages)
    return Subject(path, answer(result), tuple(unchecked))


def files(path: Path) -> list[Path]:
    """Return the files of a recording."""
    return sorted(path.iterdir()) if path.is_dir() else [path]


def answer(result: RecordingResult) -> Answer:
    """Return what is found about the requirements."""
    return tuple((item.verdict, item.is_open, item.occurrences, *item.spans)
                 for item in result.findings)


def attempt(folder: Path, subject: Subject, rng: Random) -> str:
    """
    Damage a copy of a recording; return what came of it: `error` or `right`.

    Raises
    ------
    AssertionError
        if the answer is another one.
    """
    bundle = folder / 'bundle.yaml'
    with tempfile.TemporaryDirectory(dir=folder) as name:
        path = Path(name) / subject.path.name
        (shutil.copytree if subject.path.is_dir() else shutil.copy)(subject.path, path)
        file = rng.choice(files(path))
        kind = rng.choice(KINDS)
        content = bytearray(file.read_bytes())
        original = subject.path / file.name if subject.path.is_dir() else subject.path
        damaged = _damage(content, kind, rng)
        if content == original.read_bytes() or subject.may_change(original, damaged):
            return 'right'
        file.write_bytes(content)
        try:
            result = check_recording(bundle, path, Selection())
        except CompileError:
            return 'error'
        if result.errors:
            return 'error'
        assert answer(result) == subject.answer, (
            f'{file.name}: {kind} bytes {damaged.start} to {damaged.stop}: {answer(result)}, not '
            f'{subject.answer}; {result.warnings}')
        return 'right'


def _damage(content: bytearray, kind: str, rng: Random) -> range:
    begin = rng.randrange(len(content))
    length = min(rng.choice((1, 2, 4, 8, 64, 4096)), len(content) - begin)
    damaged = range(begin, begin + length)
    match kind:
        case 'zeroed':
            content[begin:damaged.stop] = bytes(length)
        case 'flipped':
            content[begin] ^= 1 << rng.randrange(8)
            return range(begin, begin + 1)
        case 'cut':
            del content[begin:damaged.stop if rng.randrange(2) else len(content)]
            return range(begin, begin)
        case 'inserted':
            content[begin:begin] = rng.randbytes(length)
            return range(begin, begin)
        case _:
            content[begin:begin] = content[begin:damaged.stop]
            return range(begin, begin)
    return damaged


def fuzz(seconds: float, seed: int) -> int:
    """
    Damage recordings for some time; return how many.

    Raises
    ------
    AssertionError
        that names the random seed, if an answer is wrong.
    """
    end = time.monotonic() + seconds
    count = 0
    while time.monotonic() < end:
        with tempfile.TemporaryDirectory(prefix='fret_monitor-fuzz-') as name:
            for subject in subjects(Path(name), Random(seed)):
                for _ in range(50):
                    try:
                        attempt(Path(name), subject, Random(seed + count))
                    except AssertionError as error:
                        raise AssertionError(
                            f'{subject.path.name} of seed {seed}, damage {seed + count}: {error}'
                        ) from None
                    count += 1
        seed += count
    return count
