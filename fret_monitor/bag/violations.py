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
Writes what was found in a recording as another one, for Foxglove, Lichtblick or PlotJuggler.

It has `copilot/violations`, as the node publishes it, and `copilot/verdict/ID` for plotting.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fret_monitor.bag.check import absolute
from fret_monitor.model.diagnostics import refuse
from fret_monitor.model.manifest import Manifest
from fret_monitor.model.names import verdict_topic
from fret_monitor.model.output import open_output
from fret_monitor.model.times import seconds
from fret_monitor.runtime.evaluator import Violation
from fret_monitor.runtime.mcap import McapWriter
from fret_monitor.runtime.reporting import StatusRecord
from rosbags.typesys import get_typestore, Stores

_ARRAY = 'diagnostic_msgs/msg/DiagnosticArray'
_BOOL = 'std_msgs/msg/Bool'
_END_OF_STAMPS = 2**31 * 10**9  # the seconds of builtin_interfaces/msg/Time have 32 bits


@contextmanager
def open_violations(path: Path, namespace: str) -> Iterator['ViolationsMcap']:
    """
    Yield a recording that is renamed to `path` when the block ends without an exception.

    Raises
    ------
    CompileError
        if it cannot be written.
    """
    with open_output(path) as file:
        writer = McapWriter(file.buffer)
        yield ViolationsMcap(writer, namespace)
        writer.end()


class ViolationsMcap:
    """Writes the changes of verdicts, with their details."""

    wants_details = True

    def __init__(self, writer: McapWriter, namespace: str) -> None:
        """Write with a writer, which the caller ends; topics are in the namespace."""
        self._writer = writer
        self._namespace = namespace
        self._types = get_typestore(Stores.ROS2_JAZZY)
        self._state: list[bool | None] = []  # None: not judged yet
        self._violated: list[set[bytes | None]] = []  # a requirement: by the instances of which
        self.without_details = 0
        """Changes that are only in the verdicts, as the engine had no room for the details."""

    def begin(self, begin: int, end: int, manifest: Manifest) -> None:
        """Begin at a time (ns); there is no verdict yet."""
        self._state = [None] * len(manifest.numbered)
        self._violated = [set() for _ in manifest.numbered]
        self._violations = self._topic('copilot/violations', _ARRAY)
        self._verdicts = [self._topic(verdict_topic(item.handler), _BOOL)
                          for item in manifest.numbered]

    def judged(self, requirement: int, time: int) -> None:
        """Write that a requirement is fulfilled."""
        self._state[requirement] = True
        self._write_verdict(time, requirement, True)

    def change(self, violation: Violation, detail: StatusRecord | None) -> None:
        """Write a verdict, and the details of its change."""
        violated = self._violated[violation.requirement]
        (violated.discard if violation.is_recovery else violated.add)(violation.key)
        if self._state[violation.requirement] is not (verdict := not violated):
            self._state[violation.requirement] = verdict
            self._write_verdict(violation.stamp, violation.requirement, verdict)
        if detail is None:
            self.without_details += 1
        else:
            self._write_detail(violation.stamp, detail)

    def end(self, time: int) -> None:
        """Write all verdicts once more, so that plots reach the end."""
        for index, state in enumerate(self._state):
            if state is not None:
                self._write_verdict(time, index, state)

    def _topic(self, name: str, kind: str) -> int:
        definition, _ = self._types.generate_msgdef(kind, ros_version=2)
        return self._writer.add_channel(absolute(name, self._namespace), kind, definition)

    def _write_verdict(self, time: int, index: int, verdict: bool) -> None:
        message = self._types.types[_BOOL](verdict)
        self._write(self._verdicts[index], time, message, _BOOL)

    def _write_detail(self, time: int, detail: StatusRecord) -> None:
        types = self._types.types
        if time >= _END_OF_STAMPS:
            refuse(f'the time {seconds(time)} is too late for the stamp of a message, which ends '
                   'in 2038', help='leave --mcap out, or end with --to before it')
        stamp = types['builtin_interfaces/msg/Time'](time // 10**9, time % 10**9)
        values = [types['diagnostic_msgs/msg/KeyValue'](*pair) for pair in detail.values]
        status = types['diagnostic_msgs/msg/DiagnosticStatus'](
            detail.level, detail.name, detail.message, detail.hardware_id, values)
        message = types[_ARRAY](types['std_msgs/msg/Header'](stamp, ''), [status])
        self._write(self._violations, time, message, _ARRAY)

    def _write(self, channel: int, time: int, message: object, kind: str) -> None:
        self._writer.add_message(
            channel, max(0, time), bytes(self._types.serialize_cdr(message, kind)))
