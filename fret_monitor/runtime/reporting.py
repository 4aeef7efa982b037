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
A wrapper of `csrc/reporting`: what a node reports of an engine, in words. Without ROS.

C decides and words each line of the log and each status; this module fills the table of texts from
the manifest, and copies what C returns.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

from fret_monitor.model.manifest import Manifest, ManifestInput
from fret_monitor.model.names import detail_key
from fret_monitor.model.paths import path_text
from fret_monitor.model.policies import Policy, Report, Severity, Stale, Stamp
from fret_monitor.model.values import ValueType
from fret_monitor.native.binding import ffi
from fret_monitor.runtime.engine import Engine


class LogLevel(IntEnum):
    """The severity of a line (`enum fm_level`)."""

    INFO = 0
    WARN = 1
    ERROR = 2


@dataclass(frozen=True)
class LogLine:
    """A line of the log."""

    level: LogLevel
    text: str


@dataclass(frozen=True)
class StatusRecord:
    """
    The fields of a diagnostic_msgs/msg/DiagnosticStatus.

    `level` is 0 (OK), 1 (WARN) or 2 (ERROR); `values` are keys and values.
    """

    level: int
    name: str
    message: str
    hardware_id: str
    values: tuple[tuple[str, str], ...]


class ReportTable:
    """The texts of a bundle, as C reads them; `pointer` is a `const struct fm_report_table *`."""

    def __init__(self, manifest: Manifest, bundle: str = '') -> None:
        """Fill the table; `bundle` is the name to show in place of the manifest's."""
        self._kept: list[Any] = []  # memory of C that the table points to
        inputs, topics = manifest.inputs, manifest.topics
        self.pointer: Any = ffi.new('struct fm_report_table *', {
            'bundle': self._text(bundle or manifest.name),
            'component': self._text(manifest.component),
            'gate': self._text(manifest.gate.name if manifest.gate is not None else ''),
            'inputs': self._array('struct fm_report_input[]', [
                self._input(item) for item in inputs]),
            'topics': self._array('struct fm_report_topic[]', [
                (self._text(item.name), self._text(item.message_type)) for item in topics]),
            'topic_inputs': self._array('struct fm_topic[]', [
                (self._array('uint32_t[]', item.inputs), len(item.inputs)) for item in topics]),
            'requirements': self._array('struct fm_report_requirement[]', [{
                'id': self._text(item.id), 'text': self._text(item.shown),
                'sentence': self._text(item.sentence),
                'inputs': self._array('uint32_t[]', item.inputs), 'n_inputs': len(item.inputs),
                'constants': self._array('uint32_t[]', item.constants),
                'n_constants': len(item.constants),
                'is_warning': item.severity is Severity.WARN,
                'shows_verdict': item.report is Report.OCCURRENCE,
            } for item in manifest.requirements]),
            'constants': self._array('struct fm_constant[]', [
                (self._text(name), self._text(detail_key(name, 'constant')),
                 self._text(value)) for name, value in manifest.constants]),
            'n_inputs': len(inputs), 'n_topics': len(topics),
            'n_requirements': len(manifest.requirements),
            'n_constants': len(manifest.constants),
            'policy': ffi.integer_const(f'FM_{manifest.policy.name}'),
            'period': _nanoseconds(
                manifest.period if manifest.policy is Policy.PERIODIC else None),
            'uses_header_stamps':
                manifest.policy is Policy.TIMED and manifest.stamp is Stamp.HEADER,
            'reorder': manifest.reorder,
        })

    def _text(self, text: str) -> Any:
        self._kept.append(ffi.new('char[]', text.encode(errors='replace')))
        return self._kept[-1]

    def _array(self, kind: str, items: Sequence[Any]) -> Any:
        self._kept.append(ffi.new(kind, list(items)))
        return self._kept[-1]

    def _input(self, item: ManifestInput) -> dict[str, Any]:
        return {
            'name': self._text(item.name),
            'key': self._text(detail_key(item.name, 'input')),
            'path': self._text(path_text(item.path)),
            'values': self._array('struct fm_value_name[]', [
                (self._text(name),
                 _union(item.value_type, place if item.is_string else int(number)))
                for place, (name, number) in enumerate(item.values)]),
            'n_values': len(item.values),
            'is_timed_out': item.timeout is not None and item.topic is not None,
            'violates': item.stale is Stale.VIOLATE,
            'has_initial': item.initial is not None,
            'initial': _union(item.value_type, item.initial or 0),
            'timeout': item.timeout or 0.0,
            'startup': item.startup or item.timeout or 0.0,
        }


class Reporter:
    """
    What reports are made from: the texts of a bundle, an engine, and names of the node.

    `pointer` is a `const struct fm_reporter *`; it may be read while this object lives.
    """

    def __init__(self, engine: Engine, table: ReportTable, node: str = '',
                 topics: Sequence[str] | None = None) -> None:
        """`node` is the full name of the node, `topics` are the full names of the topics."""
        self.engine = engine
        self.library: Any = engine.library
        self._table = table
        self._texts = [ffi.new('char[]', name.encode()) for name in (
            node.removeprefix('/'),
            *([item.name for item in engine.monitor.manifest.topics]
              if topics is None else topics))]
        self._topics = ffi.new('char *[]', self._texts[1:])
        self.pointer: Any = ffi.new('struct fm_reporter *', {
            'table': table.pointer, 'monitor': engine.monitor.pointer, 'engine': engine.pointer,
            'node': self._texts[0], 'topics': self._topics})


class Lines:
    """A list of lines that C fills; `pointer` is a `struct fm_lines *`."""

    def __init__(self, library: Any) -> None:
        """Begin with no line; `library` has the functions of csrc."""
        self._library = library
        self.pointer: Any = ffi.gc(ffi.new('struct fm_lines *'), library.fm_lines_free)

    def take(self) -> list[LogLine]:
        """Return the lines, and remove them."""
        lines = self.pointer.lines
        found = [LogLine(LogLevel(lines[k].level), _string(lines[k].text))
                 for k in range(self.pointer.n)]
        self._library.fm_lines_clear(self.pointer)
        return found


class Statuses:
    """A list of statuses that C fills; `pointer` is a `struct fm_statuses *`."""

    def __init__(self, library: Any) -> None:
        """Begin with no status; `library` has the functions of csrc."""
        self._library = library
        self.pointer: Any = ffi.gc(ffi.new('struct fm_statuses *'), library.fm_statuses_free)

    def take(self) -> list[StatusRecord]:
        """Return the statuses, and remove them."""
        found = [_status(self.pointer.statuses[k]) for k in range(self.pointer.n)]
        self._library.fm_statuses_clear(self.pointer)
        return found


def _status(found: Any) -> StatusRecord:
    return StatusRecord(
        int(found.level), _string(found.name), _string(found.message), _string(found.hardware_id),
        tuple((_string(found.values[k].key), _string(found.values[k].value))
              for k in range(found.n_values)))


def _string(text: Any) -> str:
    found: Any = ffi.string(text)
    return str(found.decode(errors='replace'))


def _union(kind: ValueType, value: float) -> dict[str, Any]:
    if kind.is_float:
        return {'f': float(value)}
    return {'i' if kind.is_signed or kind is ValueType.BOOL else 'u': int(value)}


def _nanoseconds(seconds: float | None) -> int:
    return 0 if seconds is None else round(seconds * 1e9)
