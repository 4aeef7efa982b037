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
from time import monotonic_ns
from typing import Any

from fret_monitor.model.manifest import Manifest, ManifestInput
from fret_monitor.model.paths import path_text
from fret_monitor.model.policies import Policy, Report, Severity, Stale, Stamp
from fret_monitor.model.values import ValueType
from fret_monitor.native.binding import ffi
from fret_monitor.runtime.engine import Engine


OF_ALL_DETAILS: int = ffi.integer_const('FM_OF_ALL_DETAILS')
"""Values that all details begin with; the last of them names the silent inputs."""

LOGGED_PER_S: int = ffi.integer_const('FM_LOGGED_PER_S')
"""Details of a requirement in a second while only the log reads them."""


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
                (self._text(name), self._text(value)) for name, value in manifest.constants]),
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
        self._kept.append(_characters(text))
        return self._kept[-1]

    def _array(self, kind: str, items: Sequence[Any]) -> Any:
        self._kept.append(ffi.new(kind, list(items)))
        return self._kept[-1]

    def _input(self, item: ManifestInput) -> dict[str, Any]:
        return {
            'name': self._text(item.name),
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
        self._texts = [_characters(name) for name in (
            node.removeprefix('/'),
            *([item.name for item in engine.monitor.manifest.topics]
              if topics is None else topics))]
        self._topics = ffi.new('char *[]', self._texts[1:])
        self.pointer: Any = ffi.new('struct fm_reporter *', {
            'table': table.pointer, 'monitor': engine.monitor.pointer, 'engine': engine.pointer,
            'node': self._texts[0], 'topics': self._topics})

    def detail(self, detail: Any) -> StatusRecord:
        """Return the text of a detail (`Engine.take_detail`), as `copilot/violations` has it."""
        found = Statuses(self.library)
        self.library.fm_add_detail(found.pointer, self.pointer, detail)
        status, = found.take()
        return status


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


class ViolationLog:
    """
    The log of violations: at most a line a second of each requirement. Not thread-safe.

    Each method returns the lines that are due. `now` is on the monotonic clock (ns).
    """

    def __init__(self, reporter: Reporter) -> None:
        """Log the violations of an engine."""
        self._reporter = reporter
        self._library = reporter.library
        self._lines = Lines(reporter.library)
        self._pointer: Any = ffi.gc(self._library.fm_violation_log_create(reporter.pointer),
                                    self._library.fm_violation_log_destroy)
        if self._pointer == ffi.NULL:
            raise MemoryError

    def add(self, detail: Any, now: int | None = None) -> list[LogLine]:
        """Log a violation or its end, or leave it to `review` if there was a line just now."""
        self._library.fm_violation_log_add(
            self._pointer, detail, monotonic_ns() if now is None else now, self._lines.pointer)
        return self._lines.take()

    def review(self, now: int | None = None) -> list[LogLine]:
        """Log what was left out, where a second has passed since the last line; call it often."""
        self._library.fm_violation_log_review(
            self._pointer, monotonic_ns() if now is None else now, self._lines.pointer)
        return self._lines.take()

    def end(self) -> list[LogLine]:
        """Log all that was left out."""
        self._library.fm_violation_log_end(self._pointer, self._lines.pointer)
        return self._lines.take()


@dataclass(frozen=True)
class ReceivedDetail:
    """
    A detail that was received: the time of the violation (ns), and its text, as C keeps it.

    `suppressed` counts the details of the requirement that were not published so far. With
    `is_recovery` a violation is over.
    """

    stamp: int
    suppressed: int = 0
    is_recovery: bool = False
    text: 'StatusText | None' = None


class StatusText:
    """A status that was received, as C reads it; `pointer` is a `const struct fm_status *`."""

    def __init__(self, record: StatusRecord) -> None:
        """Copy its texts."""
        values = [(_characters(key), _characters(value)) for key, value in record.values]
        texts = [_characters(text) for text in (record.name, record.message, record.hardware_id)]
        pairs = ffi.new('struct fm_key_value[]', values)
        self._kept = (values, texts, pairs)
        self.pointer: Any = ffi.new(
            'struct fm_status *', (record.level, *texts, pairs, len(values), len(values)))


class ViolationLines:
    """Words the violations of one requirement from details that were received."""

    def __init__(self, library: Any, name: str, sentence: str, severity: Severity) -> None:
        """`library` has the functions of csrc; `name` is the requirement's id."""
        self._library = library
        self._texts = (_characters(name), _characters(sentence))
        self._about = ffi.new('struct fm_report_requirement *', {
            'id': self._texts[0], 'sentence': self._texts[1],
            'is_warning': severity is Severity.WARN})

    def violated(self, stamp: int, detail: ReceivedDetail | None) -> list[LogLine]:
        """Return the line of a violation at a time (ns)."""
        lines = Lines(self._library)
        self._library.fm_add_violated(lines.pointer, self._about, stamp, _text_of(detail), 0)
        return lines.take()

    def satisfied(self, detail: ReceivedDetail) -> list[LogLine]:
        """Return the line of the end of a violation."""
        lines = Lines(self._library)
        self._library.fm_add_satisfied(
            lines.pointer, self._about, detail.stamp, _text_of(detail))
        return lines.take()


def read_detail(library: Any, record: StatusRecord) -> ReceivedDetail | None:
    """Read a status that a monitor has published as a detail; None if it has another form."""
    text = StatusText(record)
    found: Any = ffi.new('struct fm_received_detail *')
    if not library.fm_read_detail(text.pointer, found):
        return None
    return ReceivedDetail(found.stamp, found.suppressed, found.is_recovery, text)


def _text_of(detail: ReceivedDetail | None) -> Any:
    return ffi.NULL if detail is None or detail.text is None else detail.text.pointer


def _characters(text: str) -> Any:
    return ffi.new('char[]', text.encode(errors='replace'))


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
