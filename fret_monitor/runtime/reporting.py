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

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from time import monotonic_ns
from typing import Any

from fret_monitor.model.frozen import frozen
from fret_monitor.model.manifest import Manifest
from fret_monitor.model.policies import Policy, Severity
from fret_monitor.model.report_table import (
    Elements, Enumerator, Members, report_table, Stored, Value,
)
from fret_monitor.model.values import ValueType
from fret_monitor.native.binding import ffi
from fret_monitor.runtime.engine import Engine

OF_ALL_DETAILS: int = ffi.integer_const('FM_OF_ALL_DETAILS')
"""Values that all details begin with; the last of them names the silent inputs."""


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


@frozen
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

    def __init__(self, manifest: Manifest, bundle: str = '', *, policy: Policy | None = None,
                 period: float | None = None) -> None:
        """
        Fill the table; `bundle` is the name to show, empty if the node has only one bundle.

        `policy` and `period`, in seconds, are those with which it runs, if not the manifest's.
        """
        self._kept: list[Any] = []  # memory of C that the table points to
        table = report_table(manifest, bundle, policy=policy, period=period)
        self.pointer: Any = ffi.new('struct fm_report_table *', self._made(table))

    def _made(self, value: Value) -> Any:
        """Return what cffi initializes a member with."""
        match value:
            case None:
                return ffi.NULL
            case Enumerator(name):
                return ffi.integer_const(name)
            case Stored(kind, number):
                return _union(kind, number)
            case Members(members):
                return {name: self._made(member) for name, member in members.items()}
            case Elements(element, items):
                self._kept.append(ffi.new(f'{element}[]', [*map(self._made, items)]))
            case str():
                self._kept.append(_characters(value))
            case _:
                return value
        return self._kept[-1]


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

    def transform_lines(self) -> list[LogLine]:
        """Return what to say at the end of a recording of transforms, and links left out."""
        return lines_of(self.library, self.library.fm_add_transforms_at_end, self.pointer)

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
        self.library = library
        self.pointer: Any = ffi.gc(ffi.new('struct fm_lines *'), library.fm_lines_free)

    def take(self) -> list[LogLine]:
        """Return the lines, and remove them."""
        lines = self.pointer.lines
        found = [LogLine(LogLevel(lines[k].level), _string(lines[k].text))
                 for k in range(self.pointer.n)]
        self.library.fm_lines_clear(self.pointer)
        return found


def lines_of(library: Any, function: Any, *arguments: Any) -> list[LogLine]:
    """Return the lines that a function of csrc adds to its first argument."""
    lines = Lines(library)
    function(lines.pointer, *arguments)
    return lines.take()


@dataclass(frozen=True)
class TopicFacts:
    """
    The publishers of a topic that were discovered.

    `publishers` counts those of the topic's type; `other_types` are the types of the others,
    `unmatched` the nodes whose quality of service does not match, as texts.
    """

    publishers: int = 0
    other_types: str = ''
    unmatched: str = ''


def together(facts: Sequence[TopicFacts]) -> TopicFacts:
    """Return what is known of a topic that is several in ROS: of the first with a problem."""
    return TopicFacts(
        sum(item.publishers for item in facts),
        next((item.other_types for item in facts if item.other_types), ''),
        next((item.unmatched for item in facts if item.unmatched), ''))


@frozen
class GateFacts:
    """
    What is around a gate.

    `others` are those who are where only the gate should be (of a service they are not shown), on
    `place`: the full name of a topic or service. `unsent` are messages that were not published, or
    requests that were not answered.
    """

    others: str
    place: str
    unsent: int


class Review:
    """
    What a node logs once a second, and its statuses on `/diagnostics` (`review.h`).

    Call `look`, then `lines`, then `statuses` if somebody subscribes; one thread at a time.
    """

    def __init__(self, reporter: Reporter, now: int | None = None, *, actions: Any = ffi.NULL,
                 blackbox: Any = ffi.NULL) -> None:
        """
        Begin, at a time of the steady clock in nanoseconds; now, if it is None.

        `actions`, a `struct fm_action_facts[]`, and `blackbox`, a `struct fm_blackbox_facts *`,
        are the counts of before, which are not new at the first look.
        """
        self._reporter = reporter
        self._library = reporter.library
        self._lines = Lines(self._library)
        self._statuses = Statuses(self._library)
        self._kept: list[Any] = []  # what the facts of the last look point to
        self._has_looked = False
        self._topics: tuple[tuple[TopicFacts, ...], Any, list[Any]] = ((), ffi.NULL, [])
        pointer = self._library.fm_review_create(
            reporter.pointer, ffi.new('struct fm_facts *', {
                'now': monotonic_ns() if now is None else now, 'actions': actions,
                'blackbox': blackbox}))
        if pointer == ffi.NULL:
            raise MemoryError('too little memory for a review')
        self._pointer: Any = ffi.gc(pointer, self._library.fm_review_destroy)

    def look(self, topics: Sequence[TopicFacts], *, now: int | None = None,
             waits_for_clock: bool = False, actions: Any = ffi.NULL,
             gate: GateFacts | None = None, blackbox: Any = ffi.NULL,
             failures: Mapping[str, str] | None = None) -> Any:
        """
        Look at the engine and the facts; return what was seen, a `const struct fm_snapshot *`.

        `waits_for_clock`: `/clock` is followed, and nothing was received on it. `failures` are the
        errors of threads and timers, by their names. The order of topics and actions is that of
        the manifest, without locks. Raises `ValueError` if there are more or fewer.
        """
        table = self._reporter.pointer.table
        if len(topics) != table.n_topics or \
                actions != ffi.NULL and len(actions) != table.n_actions:
            raise ValueError('facts of each topic and action are needed')
        kept: list[Any] = []

        def keep(value: Any) -> Any:
            kept.append(value)
            return value

        def text(value: str) -> Any:
            return keep(_characters(value))

        if self._topics[0] != tuple(topics):
            texts = [[_characters(name) for name in (item.unmatched, item.other_types)]
                     for item in topics]
            self._topics = (tuple(topics), ffi.new('struct fm_publishers[]', [
                (item.publishers, *names) for item, names in zip(topics, texts)]), texts)
        facts = ffi.new('struct fm_facts *', {
            'now': monotonic_ns() if now is None else now,
            'waits_for_clock': waits_for_clock,
            'topics': self._topics[1],
            'actions': keep(actions),
            'gate': ffi.NULL if gate is None else keep(ffi.new('struct fm_gate_facts *', (
                text(gate.others), text(gate.place), gate.unsent))),
            'blackbox': keep(blackbox),
            'failures': keep(ffi.new('struct fm_failure[]', [
                (text(name), text(error)) for name, error in (failures or {}).items()])),
            'n_failures': len(failures or {})})
        seen = self._library.fm_review_look(self._pointer, facts)
        self._kept, self._has_looked = kept, True
        return seen

    def lines(self) -> list[LogLine]:
        """Return the lines about what is new."""
        self._library.fm_review_log(self._pointer, self._lines.pointer)
        return self._lines.take()

    def statuses(self) -> list[StatusRecord]:
        """Return the statuses at the last look; none before the first, which may have failed."""
        if not self._has_looked:
            return []
        self._library.fm_review_report(self._pointer, self._statuses.pointer)
        return self._statuses.take()

    def publish(self, middleware: Any, publisher: Any, stamp: int) -> None:
        """Publish the statuses at the last look, with a time (ns); the first two are of C."""
        if self._has_looked:
            self._library.fm_review_report(self._pointer, self._statuses.pointer)
            self._library.fm_publish_statuses(
                middleware, publisher, self._statuses.pointer, stamp)
            self._library.fm_statuses_clear(self._statuses.pointer)


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
        return lines_of(self._library, self._library.fm_add_violated,
                        self._about, stamp, _text_of(detail), 0)

    def satisfied(self, detail: ReceivedDetail) -> list[LogLine]:
        """Return the line of the end of a violation."""
        return lines_of(self._library, self._library.fm_add_satisfied,
                        self._about, detail.stamp, _text_of(detail))


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
