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

"""Recordings that tests write, with the writer of rosbags."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from fret_monitor.runtime.evaluator import Violation
from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin, Writer
from rosbags.typesys import get_types_from_msg, get_typestore, Stores

TYPES = get_typestore(Stores.ROS2_JAZZY)
START = 1_700_000_000_000_000_000
FLOAT = 'std_msgs/msg/Float64'
Message = tuple[str, int, float]  # topic, nanoseconds since START, value


def write(path: Path, messages: Iterable[Message], *, storage: StoragePlugin = StoragePlugin.MCAP,
          compression: CompressionMode = CompressionMode.NONE, kind: str = FLOAT) -> Path:
    """Write a recording of Float64 messages to a new folder; return it."""
    make = TYPES.types[kind]
    writer = Writer(path, version=9, storage_plugin=storage)
    if compression is not CompressionMode.NONE:
        writer.set_compression(compression, CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for topic, time, value in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=TYPES)
            writer.write(connections[topic], START + time,
                         TYPES.serialize_cdr(make(value), kind))
    return path


def contents_of(path: Path) -> Iterator[tuple[str, int, Any]]:
    """Yield the messages of a recording: topic, time and message, by the types in it alone."""
    with Reader(path) as reader:
        types = get_typestore(Stores.EMPTY)
        for item in reader.connections:
            types.register(get_types_from_msg(item.msgdef.data, item.msgtype))
        for item, time, data in reader.messages():
            yield item.topic, time, types.deserialize_cdr(data, item.msgtype)


def statuses_of(path: Path) -> list[tuple[int, Any]]:
    """Return the details of violations in what `--mcap` has written, with their times."""
    return [(time, message.status[0]) for topic, time, message in contents_of(path)
            if topic.endswith('/copilot/violations')]


def verdicts_of(path: Path) -> dict[str, list[tuple[int, bool]]]:
    """Return the verdicts in what `--mcap` has written, by topic, with their times."""
    found: dict[str, list[tuple[int, bool]]] = {}
    for topic, time, message in contents_of(path):
        if '/copilot/verdict/' in topic:
            found.setdefault(topic, []).append((time, message.data))
    return found


class Kept:
    """Keeps the changes of verdicts: time, requirement, and whether it is fulfilled again."""

    wants_details = False

    def __init__(self) -> None:
        """Begin without any."""
        self.found: list[tuple[int, int, bool]] = []

    def begin(self, begin: int, end: int, manifest: object) -> None:
        """Take that nothing is violated yet."""

    def judged(self, requirement: int, time: int) -> None:
        """Take that a requirement is judged from a time on."""

    def change(self, violation: Violation, detail: object) -> None:
        """Take a change."""
        self.found.append((violation.stamp, violation.requirement, violation.is_recovery))

    def end(self, time: int) -> None:
        """Take that the recording is over."""
