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
Runs a bundle over a recording: what the node would have said of it.

The same engine as the node's is given the serialized messages and their times of reception.
Timeouts, periods and deadlines are taken between the messages, by the recording's time. Of a
trace it is given the rows, each of which is a step.
"""

from array import array
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
import math
from pathlib import Path
from typing import Protocol, TYPE_CHECKING

from fret_monitor.bag.findings import Closest, Findings
from fret_monitor.bag.message_fit import MessageFit
from fret_monitor.bag.moments import LAST_TIME, Moment
from fret_monitor.bag.recording import Batch, DamagedRecording, full_name, Recording
from fret_monitor.bag.routes import matches, Routes, Target
from fret_monitor.bag.trace import KeyedRowBatch, RowBatch, ROWS, Trace, TRACE_SUFFIX
from fret_monitor.messages.installed import find_message, fingerprint
from fret_monitor.model.diagnostics import CompileError, counted, did_you_mean, refuse, Text
from fret_monitor.model.made import MadeKind
from fret_monitor.model.manifest import (
    Manifest, ManifestInput, ManifestRequirement, ManifestTopic,
)
from fret_monitor.model.policies import Policy, Report, Stale, Stamp
from fret_monitor.model.progress import no_progress, Progress
from fret_monitor.model.times import overflow_text, short_seconds
from fret_monitor.model.transforms import TOPICS
from fret_monitor.native import words
from fret_monitor.native.compiled import CompiledMonitor
from fret_monitor.native.monitor import Monitor
from fret_monitor.runtime.engine import Engine, MOST_QUEUED
from fret_monitor.runtime.evaluator import (
    Evaluator, Margin, NEVER, RequirementCounts, Violation, violation as violation_of,
)
from fret_monitor.runtime.reporting import LogLevel, Reporter, ReportTable, StatusRecord
from fret_monitor.runtime.scopes import KindCounts, Scopes
from fret_monitor.start import start, Variant

if TYPE_CHECKING:  # a bundle in the cache needs no parser
    from fret_monitor.build import Reading
    from fret_monitor.bundle.source_file import ReadFile
    from fret_monitor.elaboration.signals import FindMessage

_ALL = 2**32 - 1  # details a second
_MOST_WITH_DETAILS = 64  # violations that wait; the queue of details is short
_MOST_AHEAD_S = 10  # that a stamp may be ahead of the last message
_MOST_DEADLINES = 100_000  # that are looked at after the end, for verdicts that are open


@dataclass(frozen=True)
class Selection:
    """
    How a recording is read.

    `namespace` is that of the node, `remaps` are names of topics, as in the bundle and as
    recorded. `begin` and `end` limit what is judged, `until` is how far the time goes on after
    the last message. `is_partial`: judge what can be read of a damaged recording. `may_miss`: a
    topic that was not recorded is no error. `stamp` and `constants` override the bundle's.
    `margins`: find out how close each requirement came to the other verdict. `triggers`: find out
    whether its trigger came.
    """

    namespace: str = '/'
    remaps: Mapping[str, str] = field(default_factory=dict)
    begin: Moment | None = None
    end: Moment | None = None
    until: Moment | None = None
    is_partial: bool = False
    may_miss: bool = False
    stamp: Stamp | None = None
    constants: Mapping[str, Text] = field(default_factory=dict)
    margins: bool = False
    triggers: bool = False


@dataclass(frozen=True)
class RecordingResult:
    """
    What was found in one recording.

    `recorded` and `read` count the messages of each mapped topic, or the `ROWS` of a trace.
    `begin` and `end` are the judged time, `start` is that of the first message (ns). `errors` say
    what is missing or damaged: without any, all was seen. `warnings` say what was seen and could
    not be used, or was out of order. With `has_checksums`, damaged messages would be an error.
    `kinds` counts the instances of each variable that requirements mention. Of what is asked
    beside, `steps` are those that the instances of a requirement have taken, by key.
    """

    path: Path
    manifest: Manifest
    recorded: Mapping[str, int]
    read: Mapping[str, int]
    findings: tuple[Findings, ...]
    errors: tuple[str, ...]
    begin: int
    end: int
    start: int
    warnings: tuple[str, ...] = ()
    is_trace: bool = False
    has_checksums: bool = False
    kinds: Mapping[str, KindCounts] = field(default_factory=dict)
    steps: Mapping[str, Mapping[bytes, int]] = field(default_factory=dict)

    @property
    def amount(self) -> str:
        """How much was read, in words."""
        count = sum(self.read.values())
        return counted(count, 'row') if self.is_trace else \
            f'{counted(count, "message")} on {counted(len(self.read), "topic")}'


class Changes(Protocol):
    """Takes the changes of verdicts, in the order in which they were found."""

    @property
    def wants_details(self) -> bool:
        """Whether it wants the values of the inputs at each change."""

    def begin(self, begin: int, end: int, manifest: Manifest) -> None:
        """Begin a run from a time to another (ns), in which no requirement is judged yet."""

    def judged(self, requirement: int, time: int) -> None:
        """Take that a requirement is judged from a time on, and is fulfilled."""

    def change(self, violation: Violation, detail: StatusRecord | None) -> None:
        """Take that a requirement is violated, or fulfilled again; with details if wanted."""

    def end(self, time: int) -> None:
        """End at a time (ns)."""


AnyRecording = Recording | Trace
AnyBatch = Batch | RowBatch | KeyedRowBatch
Watch = Callable[[Engine, AnyBatch], None]
"""Takes all messages or rows that are read, before the engine does."""


@dataclass(frozen=True)
class Aside:
    """
    Another monitor of the same inputs, for what is asked beside the verdicts.

    It takes the same messages. `note` puts what it found into the findings of the bundle.
    """

    monitor: Monitor
    note: Callable[[RecordingResult, Sequence[Findings]], None]
    changes: Sequence[Changes] = ()


MakeAsides = Callable[[Path, Selection, 'FindMessage'], Iterator[Aside]]
"""Yields the asides of a bundle; errors as of `check_recording`."""


def no_asides(bundle: Path, selection: Selection, find: 'FindMessage') -> Iterator[Aside]:
    """Yield nothing."""
    yield from ()


def check_recording(
    bundle: Path, path: Path, selection: Selection, *, changes: Sequence[Changes] = (),
    progress: Progress = no_progress, asides: MakeAsides = no_asides,
) -> RecordingResult:
    """
    Run a bundle over a recording.

    Raises
    ------
    CompileError
        if the bundle is wrong, or the recording cannot be opened, or does not fit the bundle.
    NativeError
        if the bundle cannot be compiled.
    """
    with opened(path) as (recording, find):
        monitor = variant_of(bundle, selection, find, OCCURRENCES).monitor
        return run(monitor, recording, selection, changes=changes, progress=progress,
                   asides=[*asides(bundle, selection, find)])


def is_trace(path: Path) -> bool:
    """Return whether a recording is a table of rows."""
    return path.suffix == TRACE_SUFFIX and not path.is_dir()


@contextmanager
def opened(path: Path) -> Iterator[tuple[AnyRecording, 'FindMessage']]:
    """Yield a recording, and a function that finds message types in it, or what is installed."""
    if is_trace(path):
        yield Trace(path), find_message
        return
    with Recording(path) as recording:
        yield recording, recording.find_message


def run(monitor: Monitor, recording: AnyRecording, selection: Selection, *,
        changes: Sequence[Changes] = (), watch: Watch | None = None,
        progress: Progress = no_progress, checks_remaps: bool = True,
        asides: Sequence[Aside] = (), needs_all: bool = True) -> RecordingResult:
    """
    Run a monitor over a recording, and with it what is asked beside: the recording is read once.

    Without `checks_remaps`, topics may be renamed that the monitor does not have; without
    `needs_all`, topics that no requirement reads need not be recorded. Raises `CompileError` if it
    does not fit the recording.
    """
    result, *found = _results(recording, [
        _Run(monitor, recording, selection, changes, watch, progress, checks_remaps,
             needs_all=needs_all),
        *(_Run(item.monitor, recording, replace(selection, margins=False), item.changes, None,
               no_progress, checks_remaps=False, is_aside=True) for item in asides)])
    for item, of_aside in zip(asides, found, strict=True):
        item.note(of_aside, result.findings)
    return result


def _results(recording: AnyRecording, runs: Sequence['_Run']) -> list[RecordingResult]:
    """Give each batch of a recording to all runs."""
    for each in runs:
        each.begin()
    sources = {source: None for each in runs for source in each.wanted}
    for each in runs:
        each.route([*sources])
    try:
        for batch in recording.batches(
                {source: place for place, source in enumerate(sources)}, runs[0].read_until):
            for each in runs:
                each.take(batch)
    except DamagedRecording as error:
        for each in runs:
            each.cut_off(error)
    return [each.end() for each in runs]


def variant_of(bundle: Path, selection: Selection, find: 'FindMessage',
               variant: Variant) -> CompiledMonitor:
    """Compile a variant of a bundle for the message definitions of a recording."""
    if selection.stamp is None:
        try:
            found = start(bundle, constants=selection.constants, takes_instances=True,
                          margins=selection.margins, variant=variant)
        except CompileError:
            pass  # perhaps its messages are only in the recording
        else:
            types = {item.message_type for item in found.manifest.topics}
            if all(fingerprint(find(name)) == fingerprint(find_message(name)) for name in types):
                return found
    return compiled(variant.make(_read(bundle, selection, find), find))


def read_bundle(bundle: Path, selection: Selection, find: 'FindMessage',
                read_file: 'ReadFile | None' = None) -> 'Reading':
    """Read a bundle for a recording; all requirements report occurrences."""
    return OCCURRENCES.make(_read(bundle, selection, find, read_file), find)


def _read(bundle: Path, selection: Selection, find: 'FindMessage',
          read_file: 'ReadFile | None' = None) -> 'Reading':
    from fret_monitor.build import read, with_margins
    from fret_monitor.bundle.source_file import read_source
    reading = read(bundle, stamp=selection.stamp, constants=selection.constants,
                   find_message=find, takes_instances=True, read_file=read_file or read_source)
    return with_margins(reading) if selection.margins else reading


def _with_occurrences(reading: 'Reading', _: 'FindMessage') -> 'Reading':
    return replace(reading, specification=replace(reading.specification, properties=tuple(
        replace(item, report=Report.OCCURRENCE) for item in reading.specification.properties)))


OCCURRENCES = Variant('occurrences', _with_occurrences)
"""The requirements of a bundle, which all report occurrences."""


def requirement_texts(bundle: Path, path: Path, selection: Selection) -> dict[str, str]:
    """Return the requirements' texts of a bundle, by id; errors as of `check_recording`."""
    from fret_monitor.build import generate_monitor
    with opened(path) as (_, find):
        reading = read_bundle(bundle, selection, find)
    return {item.id: item.text for item in generate_monitor(reading).manifest.numbered}


def compiled(reading: 'Reading') -> CompiledMonitor:
    """Compile what was read; raises `NativeError` if the compiler fails."""
    from fret_monitor.build import compile_monitor, generate_monitor
    return compile_monitor(generate_monitor(reading))


class _Run:
    """One run of an engine over a recording."""

    def __init__(self, monitor: Monitor, recording: AnyRecording, selection: Selection,
                 changes: Sequence[Changes], watch: Watch | None,
                 progress: Progress, checks_remaps: bool, is_aside: bool = False,
                 needs_all: bool = True) -> None:
        self._recording = recording
        self._checks_remaps = checks_remaps
        self._needs_all = needs_all
        self._is_aside = is_aside  # nobody asks what is still open
        self._selection = selection
        self._changes = changes
        self._watch = watch
        self._progress = progress
        self._monitor = recording.prepare(monitor)
        self._manifest = self._monitor.manifest
        self._scopes = Scopes(self._monitor, is_of_engine=True) \
            if self._manifest.variables else None
        self._evaluator = self._scopes.evaluator() if self._scopes else \
            Evaluator(self._monitor, reports_recoveries=True)
        self._engine = Engine(
            self._evaluator, takes_recoveries=True, scopes=self._scopes,
            full_name=lambda name: absolute(name, selection.namespace))
        self._reporter = Reporter(self._engine, ReportTable(self._manifest))
        self._wants_details = False
        self._most = MOST_QUEUED
        self._want_details()
        self._errors: list[str] = [*recording.errors]
        self._warnings: list[str] = [*recording.warnings]
        self._missing: set[int] = set()  # topics that were not recorded
        self._before: list[RequirementCounts] = []  # of what is judged
        self._is_judging = False
        self._is_cut_off = False  # it cannot be read to its end
        self._unjudged: list[int] = []  # requirements that took no step yet
        self._unread: set[int] = set()  # requirements that read one of these topics
        self._latest = -NEVER  # the time of the last message that was read
        self._names = [ROWS] if recording.is_trace else [
            full_name(topic.name) if topic.made else resolved(topic.name, selection)
            for topic in self._manifest.topics]
        self._left_out = self._topics_left_out()
        self._fitting = {index: matches(self._names[index], topic, variable, recording.types,
                                        lambda name: resolved(name, selection))
                         for index, topic in enumerate(self._manifest.topics)
                         if (variable := self._manifest.key_of(topic)) is not None
                         and not recording.is_trace}
        self._recorded = {name: sum(recording.recorded[item] for item in self._fitting.get(
            index, [name])) for index, name in enumerate(self._names)
            if recording.is_trace or index not in self._left_out}
        self._read = array('Q', bytes(8 * len(self._names)))
        self._findings = [
            Findings(item.id, variables=variables, probability=item.probability)
            for item, variables in zip(
                self._manifest.numbered, self._manifest.variables_of, strict=True)]
        self.wanted: dict[tuple[str, str], list[Target]] = {}
        self._trials = self._evaluator.log_trials() if self._manifest.tests else None
        self._ended = self._scopes.log_closest() if self._scopes and selection.margins else None
        self._fit = None if isinstance(recording, Trace) else MessageFit(
            self._manifest.topics, recording.find_message)

    def begin(self) -> None:
        """Get ready for the first batch."""
        manifest, recording, selection = self._manifest, self._recording, self._selection
        if recording.end > LAST_TIME:
            refuse(f"'{recording.path}' ends at {recording.end} ns: nanoseconds since 1970 must "
                   f'not exceed {LAST_TIME}, which is in the year 2261')
        for source, target in self._wanted():
            self.wanted.setdefault(source, []).append(target)
        begin = _at(selection.begin, recording, recording.start)
        self._is_part = selection.begin is not None
        if recording.is_trace:  # its time begins with the first row
            self._is_part = begin > recording.start
            begin = max(begin, recording.start)
        last = min(_at(selection.end, recording, recording.end), recording.end)
        self._check_part(begin, last)
        self._is_limited = last < recording.end
        self._begin, self._last_time = begin, last
        self._leave_out(self._missing)
        for each in self._changes:
            each.begin(begin, self._end(last), manifest)
        if not self._is_part:  # stamps may be before the first reception
            self._judge_from(begin)
        if not recording.is_trace:
            self._engine.advance(min(begin, recording.start))

    @property
    def read_until(self) -> int | None:
        """The time (ns) up to which the recording is read; None: to its end."""
        return self._last_time + self._manifest.reorder if self._is_limited else None

    def end(self) -> RecordingResult:
        """Return what was found, once the last batch was taken."""
        manifest, recording, begin = self._manifest, self._recording, self._begin
        if not self._is_judging:
            self._judge_from(begin)
        last = self._last_time if self._is_limited else self._last(self._last_time)
        end = self._end(last)
        self._take(self._engine.advance_all(end + manifest.reorder, most=self._most))
        for each in self._changes:
            each.end(end)
        self._note_closest()
        kinds = dict(self._kind_counts())
        self._complain()
        self._finish(end)  # last: it goes on behind the end
        read = dict(zip(self._names, self._read))
        if not self._is_limited:
            self._compare(read)
        return RecordingResult(
            recording.path, manifest, self._recorded, read, self._in_order(),
            tuple(self._errors), begin, end, recording.start, tuple(self._warnings),
            recording.is_trace, recording.has_checksums, kinds,
            dict(self._steps()) if self._is_aside else {})

    def _note_closest(self) -> None:
        """Note the least margins of what was judged."""
        for index, _ in enumerate(self._findings if self._selection.margins else ()):
            kind, place = scope_of(self._manifest, index)
            if kind is not None and self._scopes is not None:
                for key, margin, step in self._scopes.closest(kind, place):
                    self._note_margin(index, margin, step, key)
            elif found := self._evaluator.closest(index):
                self._note_margin(index, *found)

    def _take_closest(self) -> None:
        """Note the least margins of instances that have ended."""
        for kind, place, key, margin, step in self._ended.take() if self._ended else ():
            item = self._manifest.kinds[kind]
            if self._is_judging and place < item.n_reported:
                index = len(self._manifest.requirements) + place + sum(
                    before.n_reported for before in self._manifest.kinds[:kind])
                self._note_margin(index, margin, step, key)

    def _note_margin(self, index: int, margin: Margin, step: int,
                     key: bytes | None = None) -> None:
        """Note a least margin of a requirement; of the instance of a key."""
        kind, _ = scope_of(self._manifest, index)
        scope = self._manifest if kind is None else self._manifest.kinds[kind].manifest
        if index not in self._unread and math.isfinite(margin.value):
            comparison = scope.comparisons[margin.comparison]
            self._findings[index].note_closest(Closest(
                margin.value, margin.distance, comparison.text,
                tuple(scope.inputs[place].name for place in comparison.inputs),
                margin.instant, step), key)

    def _in_order(self) -> tuple[Findings, ...]:
        """Return the findings in the bundle's order."""
        by_id = {item.id: item for item in self._findings}
        return tuple(by_id[name] for name in self._manifest.ids or by_id)

    def _kind_counts(self) -> Iterator[tuple[str, KindCounts]]:
        for place, _ in self._manifest.bases if self._scopes else ():
            assert self._scopes is not None
            yield self._variables(place), self._scopes.counts(place)

    def _variables(self, kind: int) -> str:
        return ' and '.join(item.name for item in self._manifest.mentioned(kind))

    def _steps(self) -> Iterator[tuple[str, Mapping[bytes, int]]]:
        for index, item in enumerate(self._manifest.numbered):
            kind, place = scope_of(self._manifest, index)
            if kind is not None and self._scopes is not None:
                yield item.id, dict(self._scopes.steps(kind, place))

    def _check_part(self, begin: int, last: int) -> None:
        selection, recording = self._selection, self._recording
        if last < begin and (selection.end is None or last == recording.end):
            refuse(f"--from is after the end of '{recording.path.name}'",
                   help=f'it ends {short_seconds(recording.end - recording.start)} s after its '
                   'begin')
        if last < begin:
            refuse('the end is before the begin', help='--from and --to, in this order')
        if selection.until is not None and selection.until.in_recording(
                recording.start, last) < last:
            refuse('--until is before the end of what is judged',
                   help='it says how far the time goes on after that: --until end+10')

    def _last(self, last: int) -> int:
        """Return the end of the time in which something was seen."""
        if self._is_cut_off or not self._recording.is_end_known \
                or sum(self._read) < sum(self._recorded.values()):
            return max(self._latest, self._recording.start)  # silence after it is not its own
        waiting = self._engine.latest_waiting
        last = max(last, self._latest)
        most = last + _MOST_AHEAD_S * 10**9
        if waiting is not None and waiting > most:
            self._errors.append('messages are stamped more than '
                                f'{_MOST_AHEAD_S} s after the end of the recording: left out')
        return last if waiting is None else max(last, min(waiting, most))

    def _end(self, last: int) -> int:
        """Return how far the time goes on."""
        until = self._selection.until
        end = last if until is None else max(
            last, until.in_recording(self._recording.start, last))
        if end > LAST_TIME:
            refuse('--until is too late: time ends in the year 2261')
        return end

    def _check_remaps(self) -> None:
        """Refuse a new name for a topic that the bundle does not have."""
        selection = self._selection
        named = [topic.name for topic in self._manifest.received] + [
            made.names[0] for made in self._manifest.in_graph.values()
            if made.kind is not MadeKind.NODE]
        named += [topic.name.replace(f'{{{variable.name}}}', key)
                  for topic in self._manifest.topics
                  if (variable := self._manifest.key_of(topic)) for key in variable.keys]
        topics = {absolute(name, selection.namespace): name for name in named}
        for old, new in selection.remaps.items():
            if absolute(old, selection.namespace) not in topics:
                refuse(f"--remap {old}:={new}: the bundle has no topic '{old}'",
                       help=did_you_mean(old, topics.values())
                       or f'it has {", ".join(topics.values())}')

    def _wanted(self) -> Iterator[tuple[tuple[str, str], Target]]:
        types = self._recording.types
        seen: dict[tuple[str, str], int] = {}
        if not self._recording.is_trace and self._checks_remaps:
            self._check_remaps()
        if not self._names:
            refuse('no input of the bundle has a topic',
                   help='write the topic of each: x: {topic: level, type: std_msgs/msg/Float64}')
        for index, (name, topic) in enumerate(zip(self._names, self._manifest.topics)):
            if index in self._left_out:
                if index in self._manifest.in_graph:
                    self._miss(index, f'{topic.name} is not in a recording, which has no graph of '
                               'ROS: read a topic instead, such as '
                               f'{self._manifest.inputs[topic.inputs[0]].name}: {{topic: NAME, '
                               'type: TYPE, field: received(), timeout: 1, stale: violate}')
                continue
            for each in self._fitting.get(index, [name]):
                if (each, topic.where) in seen:
                    other = self._manifest.topics[seen[each, topic.where]].name
                    refuse(f"'{other}' and '{topic.name}' are one topic here, {each}",
                           help='give it one name in the bundle')
                seen[each, topic.where] = index
            if index in self._fitting:
                yield from self._wanted_by_key(index, topic)
                continue
            found = types.get(name, set())
            if topic.message_type in found:
                yield (name, topic.message_type), (index, b'')
            others = sorted(found - {topic.message_type})
            if name in self._recording.formats:
                self._errors.append(f'{name} was recorded in the format '
                                    f"'{self._recording.formats[name]}', not as CDR")
            elif others:
                self._errors.append(f'{name} was recorded as {" and ".join(others)}, the bundle '
                                    f'says {topic.message_type}')
            elif not found and self._is_other_recorded(topic):
                pass
            elif not found:
                near = _remedy(name, types) or did_you_mean(name, types)
                self._miss(index, f'{name} was not recorded' + (f': {near}' if near else ''))
            elif not self._recording.recorded[name] and self._needs_message(index):
                self._miss(index, f'no message of {name} was recorded')

        if not any(self._recorded.values()) and not self._errors:
            self._errors.append('no row was recorded' if self._recording.is_trace else
                                'no message was recorded on the topics of the bundle')

    def _wanted_by_key(self, index: int,
                       topic: ManifestTopic) -> Iterator[tuple[tuple[str, str], Target]]:
        """Yield the recorded topics that fit one with a variable in its name."""
        fitting = self._fitting[index]
        variable = self._manifest.key_of(topic)
        if variable is not None and variable.keys and len(fitting) < len(variable.keys):
            refuse(f"two topics of '{topic.name}' are one with these names",
                   help='--remap gives each key a topic of its own')
        for name, key in fitting.items():
            if topic.message_type in self._recording.types.get(name, set()):
                yield (name, topic.message_type), (index, key)
            else:
                (self._warnings if self._selection.may_miss else self._errors).append(
                    f'{name} was not recorded as {topic.message_type}')
        if any(map(self._recording.recorded.__getitem__, fitting)):
            return
        if not any(topic.message_type in self._recording.types.get(name, ()) for name in fitting):
            self._miss(index, f'no topic {self._names[index]} of {topic.message_type} was '
                       'recorded')
        elif self._needs_message(index) or variable is None or not variable.keys:
            self._miss(index, f'no message of {self._names[index]} was recorded')

    def _needs_message(self, index: int) -> bool:
        """Whether an input of a topic, or one of listed keys, has no value before a message."""
        manifest = self._manifest
        found = [manifest.inputs[item] for item in manifest.topics[index].inputs]
        for kind in manifest.kinds:
            if all(manifest.variables[item].keys for item in kind.variables):
                found += [kind.manifest.inputs[item] for item in kind.manifest.topics[index].inputs
                          if kind.shared[item] is None]
        return any(item.initial is None for item in found)

    def _topics_left_out(self) -> set[int]:
        """
        Return the topics that are not read from the recording.

        Messages that the monitor makes are in a black box only. Otherwise they are made anew, of
        what was recorded.
        """
        if isinstance(self._recording, Trace):
            return set()
        topics, made = self._manifest.topics, self._manifest.made
        is_made = all(topics[index].message_type in self._recording.types.get(
            self._names[index], set()) for index in made)
        return {index for index, topic in enumerate(topics) if made and not topic.inputs} \
            if is_made else {*made}

    def _is_other_recorded(self, topic: ManifestTopic) -> bool:
        """Whether it is one of the topics of transforms, and another of them was recorded."""
        return not topic.inputs and topic.name in TOPICS and any(
            self._recorded.get(resolved(name, self._selection)) for name in TOPICS)

    def _miss(self, index: int, text: str) -> None:
        """Note that a topic is missing: what reads it is not judged."""
        self._missing.add(index)
        is_needed = self._needs_all or any(index in read for read in topics_read(self._manifest))
        (self._errors if is_needed and not self._selection.may_miss
         else self._warnings).append(text)

    def route(self, sources: Sequence[tuple[str, str]]) -> None:
        """Say which recorded topics are read, in the order of their numbers."""
        if not self._recording.is_trace:
            self._routes = Routes([self.wanted.get(source, ()) for source in sources])

    def take(self, batch: AnyBatch) -> None:
        """Take messages or rows, as `Recording.batches` yields them."""
        if isinstance(batch, Batch):
            batch = self._routes.deliver(batch)
            if not batch.times:
                return
        if self._fit is not None and isinstance(batch, Batch) and (
                misfits := self._fit.look_at(batch)):
            self._leave_out(misfits)
        if self._watch is not None:
            self._watch(self._engine, batch)
        if not self._is_judging:
            before = batch.before(self._begin + self._manifest.reorder)
            self._deliver(before)
            if len(before.times) < len(batch.times):
                self._judge_from(self._begin)
                self._deliver(batch.after(len(before.times)))
        else:
            self._deliver(batch)
        self._latest = max(self._latest, batch.times[-1])
        self._progress(sum(self._read) / max(1, sum(self._recorded.values())),
                       self._recording.path.name)

    def cut_off(self, error: DamagedRecording) -> None:
        """Note that the recording cannot be read to its end."""
        self._is_cut_off = True
        self._errors.append(f'the recording cannot be read to its end: {error}')

    def _leave_out(self, topics: Iterable[int]) -> None:
        """Judge no requirement that reads one of these topics."""
        fed = self._manifest.topics
        without = {*topics}
        names = {fed[index].name for index in without if not fed[index].inputs}
        without |= {index for index, topic in enumerate(fed) if topic.made and names.intersection(
            source.name for source in topic.made.sources)}
        self._unread |= {index for index, read in enumerate(topics_read(self._manifest))
                         if without & read}
        self._unjudged = [index for index in self._unjudged if index not in self._unread]

    def _deliver(self, batch: AnyBatch) -> None:
        self._take(batch.deliver(self._engine, self._read, most=self._most))

    def _judge_from(self, begin: int) -> None:
        """Start the requirements afresh; what came before set the inputs and their timeouts."""
        if self._is_part:
            self._take(self._engine.advance_all(
                begin + self._manifest.reorder, most=self._most))
            self._engine.reset()
        self._evaluator.forget_closest()
        if self._scopes is not None:
            self._scopes.forget_closest()
        self._before = list(map(self._counts, range(len(self._findings))))
        self._is_judging = True
        self._unjudged = [index for index in range(len(self._findings))
                          if index not in self._unread]

    def _first_steps(self) -> list[tuple[int, int]]:
        """Return the times and requirements of first steps since the last call, in order."""
        found = []
        for index in self._unjudged if self._changes else ():
            if index >= len(self._manifest.requirements):  # no instance violates it
                found.append((self._begin, index))
            elif self._evaluator.requirement_counts(index).steps > self._before[index].steps:
                group = self._manifest.requirements[index].group
                found.append((max(self._begin, self._evaluator.start(group)), index))
        self._unjudged = sorted({*self._unjudged} - {index for _, index in found})
        return sorted(found)

    def _report_judged(self, first_steps: 'deque[tuple[int, int]]', until: int) -> None:
        """Report the first steps up to a time, unless a violation has been reported before."""
        while first_steps and first_steps[0][0] <= until:
            time, index = first_steps.popleft()
            for each in self._changes if not self._findings[index].occurrences else ():
                each.judged(index, time)

    def _take(self, found: Iterable[list[Violation]]) -> None:
        for batch in found:
            if self._is_aside:
                self._pass_on(batch)
                continue
            details = list(self._details()) if self._wants_details else []
            details.reverse()
            first_steps = deque(self._first_steps())
            if first_steps:
                changed = {(violation.stamp, violation.requirement) for violation in batch}
                first_steps = deque(item for item in first_steps if item not in changed)
            for violation in batch:
                # Both are queued together; a detail is missing if its queue was full.
                has_detail = bool(details) and details[-1][0] == violation
                detail = details.pop()[1] if has_detail else None
                if first_steps:
                    self._report_judged(first_steps, violation.stamp)
                if not self._is_judging or violation.requirement in self._unread:
                    continue
                findings = self._findings[violation.requirement].of(violation.key)
                if violation.is_recovery and findings.since is None:
                    continue
                if violation.is_recovery:
                    findings.end(violation.stamp)
                else:
                    findings.begin(violation.stamp)
                for each in self._changes:
                    each.change(violation, detail)
            self._report_judged(first_steps, NEVER)
            self._want_details()
            self._take_logs()
        self._take_logs()

    def _take_logs(self) -> None:
        self._take_trials()
        self._take_closest()

    def _pass_on(self, found: Iterable[Violation]) -> None:
        """Pass on what an aside finds; its occurrences are not kept."""
        for violation in found if self._is_judging else ():
            if violation.requirement not in self._unread:
                for each in self._changes:
                    each.change(violation, None)

    def _take_trials(self) -> None:
        """Note the trials that were decided."""
        for index, time, has_failed in self._trials.take() if self._trials else ():
            if self._is_judging and index not in self._unread:
                self._findings[index].trials.append((time, has_failed))

    def _want_details(self) -> None:
        """Have the engine queue details as long as anybody wants them."""
        are_wanted = any(item.wants_details for item in self._changes)
        if are_wanted != self._wants_details:
            self._wants_details = are_wanted
            self._most = _MOST_WITH_DETAILS if are_wanted else MOST_QUEUED
            self._engine.want_details(are_wanted, _ALL)

    def _details(self) -> Iterator[tuple[Violation, StatusRecord]]:
        while (detail := self._engine.take_detail(0)) is not None:
            yield violation_of(detail.violation, self._engine.detail_key(detail)), \
                self._reporter.detail(detail)

    def _finish(self, end: int) -> None:
        """Set the verdicts."""
        is_timed = self._manifest.policy is Policy.TIMED
        all_counts = list(map(self._counts, range(len(self._findings))))
        due = {} if not is_timed or self._is_aside else \
            self._open_instances() if self._scopes else self._open()
        for index, (findings, before) in enumerate(zip(self._findings, self._before)):
            counts = all_counts[index]
            if index in self._unread:
                findings.instances.clear()
            findings.close(end)
            violations = counts.violations - before.violations
            findings.violations = None if is_timed else violations
            if index in self._unread:
                findings.violations = None if is_timed else 0
                continue
            if violations or findings.occurrences:
                findings.verdict = False
            elif counts.steps > before.steps and index not in due:
                findings.verdict = True
            findings.is_open = findings.verdict is None and counts.steps > before.steps
            findings.due = due.get(index) if findings.is_open else None
            findings.test()

    def _complain(self) -> None:
        """Say what could not be decoded or used, and what was out of order."""
        if not self._recording.is_end_known:
            self._errors.append('the recording says that it ends after the year 2261')
        if self._recording.left_out:
            self._errors.append(f'{counted(self._recording.left_out, "message")} left out: they '
                                'have no bytes, or no time from 1970 to 2261 in whole nanoseconds')
        if self._fit is not None:
            self._errors.extend(self._fit.errors(self._names))
            self._warnings.extend(self._fit.warnings())
        for index, topic in enumerate(self._manifest.topics):
            counts = self._evaluator.topic_counts(index)
            if counts.undecodable:
                self._errors.append(f'{counted(counts.undecodable, "message")} of {topic.name} '
                                    f'cannot be decoded as {topic.message_type}')
            for number in topic.inputs:
                self._complain_of_input(number, topic.name)
            order = self._engine.order_counts(index)
            for count, what in ((order.late, 'came after their stamps by more than `reorder`'),
                                (order.overflows, 'could not wait for earlier stamps'),
                                (order.ahead, 'have stamps ahead of their reception')):
                if count:
                    self._warnings.append(f'{counted(count, "message")} of {topic.name} {what}')
        self._complain_of_instances()
        self._complain_of_logs()
        if not self._recording.is_trace:
            self._complain_of_transforms()
        times = self._evaluator.time_counts()
        if times.missed:
            self._errors.append(f'{counted(times.missed, "period")} in gaps of the recording '
                                'were left out')
        if overflows := self._scopes.overflows() if self._scopes else times.overflows:
            self._errors.append(overflow_text(overflows))

    def _complain_of_logs(self) -> None:
        if self._trials is not None and self._trials.missed:
            self._errors.append(f'{counted(self._trials.missed, "trial")} found no room and are '
                                'not counted')
        if self._ended is not None and self._ended.missed:
            self._errors.append(f'{counted(self._ended.missed, "least margin")} of instances that '
                                'ended found no room and do not count')

    def _complain_of_instances(self) -> None:
        for place, kind in self._manifest.bases if self._scopes else ():
            assert self._scopes is not None
            found = self._scopes.counts(place)
            if found.unsized:
                self._errors.append(
                    f'{counted(found.unsized, "message")} with a key of '
                    f'{self._variables(place)} not evaluated: {words.KEY_SIZE}')
            for beyond, item in zip(found.by_variable, self._manifest.mentioned(place)):
                if beyond:
                    of = item.name if len(kind.variables) == 1 else \
                        f'{item.name}, in pairs of {self._variables(place)},'
                    self._errors.append(
                        f'{counted(beyond, "message")} with a key of {of} for which '
                        f'`most: {item.most}` leaves no room: not evaluated')
            for number, signal in enumerate(kind.manifest.inputs):
                counts = self._scopes.input_counts(place, number)
                if kind.shared[number] is None and counts.unusable:
                    (self._warnings if counts.received else self._errors).append(
                        f'{counted(counts.unusable, "message")} without a value of {signal.name}')

    def _complain_of_transforms(self) -> None:
        if self._left_out == self._manifest.made:
            for line in self._reporter.transform_lines():
                (self._warnings if line.level is LogLevel.WARN else self._errors).append(line.text)

    def _complain_of_input(self, number: int, topic: str) -> None:
        name = self._manifest.inputs[number].name
        counts = self._evaluator.input_counts(number)
        if counts.unusable and not counts.received:
            self._errors.append(f'no message of {topic} has a value of {name}')
        elif counts.unusable:
            self._warnings.append(
                f'{counted(counts.unusable, "message")} of {topic} without a value of {name}')

    def _open(self) -> dict[int, int]:
        """Return when requirements would be violated if no further message came."""
        forgiving = replace(self._monitor, manifest=replace(self._monitor.manifest, inputs=tuple(
            replace(item, stale=Stale.WARN) for item in self._monitor.manifest.inputs)))
        later = Evaluator(forgiving)
        later.restore(self._evaluator.save())
        found: dict[int, int] = {}
        for _ in range(_MOST_DEADLINES):
            deadline = later.deadline
            if deadline == NEVER:
                break
            for item in later.advance(deadline):
                found.setdefault(item.requirement, item.stamp)
        return found

    def _open_instances(self) -> dict[int, int]:
        """Do as `_open`, with the run itself, which has ended."""
        silent = {index for index, item in enumerate(self._manifest.numbered)
                  if any(self._input_of(index, number).stale is Stale.VIOLATE
                         for number in item.inputs)}
        found: dict[int, int] = {}
        for _ in range(_MOST_DEADLINES):
            deadline = self._engine.deadline
            if deadline == NEVER:
                break
            for batch in self._engine.advance_all(deadline + self._manifest.reorder):
                for item in batch:
                    if not item.is_recovery and item.requirement not in silent:
                        found.setdefault(item.requirement, item.stamp)
        return found

    def _input_of(self, index: int, number: int) -> ManifestInput:
        kind, _ = scope_of(self._manifest, index)
        manifest = self._manifest if kind is None else self._manifest.kinds[kind].manifest
        return manifest.inputs[number]

    def _counts(self, index: int) -> RequirementCounts:
        """Return the counters of a requirement, those of all instances together."""
        kind, place = scope_of(self._manifest, index)
        if kind is None or self._scopes is None:
            return self._evaluator.requirement_counts(place)
        return self._scopes.requirement_counts(kind, place)

    def _compare(self, read: Mapping[str, int]) -> None:
        for name, count in self._recorded.items():
            if count != read[name]:
                what = counted(count, 'row') if self._recording.is_trace else \
                    f'{name}: {counted(count, "message")}'
                self._errors.append(f'{what} recorded, {read[name]:,} read')


def scope_of(manifest: Manifest, index: int) -> tuple[int | None, int]:
    """Return the kind of a requirement of `Manifest.numbered`, and its index there."""
    place = index - len(manifest.requirements)
    if place < 0:
        return None, index
    for kind, item in enumerate(manifest.kinds):
        if place < item.n_reported:
            return kind, place
        place -= item.n_reported
    raise IndexError(index)


def topics_read(manifest: Manifest) -> list[set[int]]:
    """Return the topics that each requirement of `Manifest.numbered` reads."""
    def read(of: Manifest, requirement: ManifestRequirement) -> set[int]:
        return {index for index, topic in enumerate(of.topics)
                if not {*topic.inputs}.isdisjoint(requirement.inputs)}

    found = []
    for item in manifest.requirements:
        operands = [(manifest.kinds[each.kind].manifest, each.operand)
                    for each in manifest.aggregates if each.input in item.inputs]
        found.append(read(manifest, item).union(*(
            read(kind, kind.requirements[operand]) for kind, operand in operands)))
    for kind in manifest.kinds:
        found += [read(kind.manifest, item)
                  for item in kind.manifest.requirements[:kind.n_reported]]
    return found


def resolved(topic: str, selection: Selection) -> str:
    """Return the name under which a topic of the bundle was recorded."""
    name = absolute(topic, selection.namespace)
    renamed = {absolute(old, selection.namespace): absolute(new, selection.namespace)
               for old, new in selection.remaps.items()}
    return renamed.get(name, name)


def _remedy(name: str, recorded: Iterable[str]) -> str:
    """Return the option that finds a topic in a namespace, if there is one."""
    found = sorted(item for item in recorded if item.endswith(name))
    return f'--namespace {found[0].removesuffix(name)} reads {found[0]}' if found else ''


def absolute(name: str, namespace: str) -> str:
    """Return the full name of a topic in a namespace."""
    if name.startswith('/'):
        return name
    parts = [part for part in (*namespace.split('/'), *name.split('/')) if part]
    return '/' + '/'.join(parts)


def _at(moment: Moment | None, recording: AnyRecording, otherwise: int) -> int:
    return otherwise if moment is None else moment.in_recording(recording.start, recording.end)
