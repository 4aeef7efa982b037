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
A thin typed wrapper of the evaluator in C, which decides everything.

The caller stores values, and calls a method when a message or a row is complete, or time has
passed; that method returns the violations to announce. `evaluator.h` describes each call.
Times are in nanoseconds, of any clock that the caller chooses.
"""

from array import array
from collections.abc import Iterator, Sequence
import math
from pathlib import Path
from typing import Any, NamedTuple

from fret_monitor.model.frozen import frozen
from fret_monitor.model.policies import InputSource, Policy, Report, Stale
from fret_monitor.native import evaluator_library, LibraryError, load_evaluator, Monitor
from fret_monitor.native.binding import ffi
from fret_monitor.native.monitor import CData

NEVER = 2**63 - 1
"""The deadline where nothing will be due."""

ALIGNMENT = 16  # bytes, of blocks that C lays out
_TABLE_ROWS = 4096  # rows of verdicts that are taken at once

_MOST_TRIALS = 1 << 16  # that are decided before a log is read

_REPORTS = {Report.EVERY_STEP: 'FM_EVERY_STEP', Report.ONSET: 'FM_ONSET',
            Report.OCCURRENCE: 'FM_OCCURRENCE'}
_SOURCES = {InputSource.FIELD: 'FM_FIELD', InputSource.RECEIVED: 'FM_RECEPTION',
            InputSource.AGE: 'FM_AGE', InputSource.INSTANCES: 'FM_AGGREGATE',
            InputSource.RATE: 'FM_RATE', InputSource.PERIOD: 'FM_PERIOD',
            InputSource.TIME: 'FM_TIME'}


class Violation(NamedTuple):
    """
    An announced violation: a requirement (index), the step of its group, its time (ns).

    Under the policy timed, `step` is the time since the group began, in nanoseconds. With
    `is_recovery` it is the end of one: what the requirement's report compares is true again. With
    `is_withheld` a message violates that a gate withheld. `key` is that of an instance; None: it
    is of the bundle's scope. With `is_end` it is a recovery since the instance ended.
    """

    requirement: int
    step: int
    stamp: int
    is_recovery: bool = False
    is_withheld: bool = False
    key: bytes | None = None
    is_end: bool = False


def violation(item: Any, key: bytes | None = None) -> Violation:
    """Return a `struct fm_violation`."""
    return Violation(item.requirement, item.step, item.stamp, bool(item.is_recovery),
                     bool(item.is_withheld), key, bool(item.is_end))


@frozen
class RequirementCounts:
    """
    Counters of a requirement, through all resets; `verdict` is of the last step or timeout.

    `holds` is what reports look at: the verdict; of `H p` with `report: occurrence`, p.
    `is_violated` says that the last violation is not over: of a gate, also one by a message that
    was withheld, after which no message has passed.
    """

    steps: int
    violations: int
    announced: int
    verdict: bool
    holds: bool
    is_violated: bool


@frozen
class InputCounts:
    """Counters of an input; `overwritten` counts values on which some group took no step."""

    received: int
    unusable: int
    overwritten: int


@frozen
class TopicCounts:
    """Counters of a topic."""

    messages: int
    undecodable: int


@frozen
class TimeCounts:
    """
    Periods taken, those taken late or not at all, and how often time went back.

    `overflows` are the changes that found no room in a queue, since start or reset.
    `restarted_at` is the time to which it went back last, in nanoseconds.
    """

    periods: int
    late: int
    missed: int
    restarts: int
    overflows: int = 0
    restarted_at: int = 0


@frozen
class Margin:
    """
    How far a requirement is from the other verdict: positive or 0 if it is satisfied.

    `value` is the `distance` that the deciding comparison had, divided by its scale: infinite
    where none decides, NaN where it is not known. `instant` is when it had it, `comparison` its
    index in the manifest.
    """

    value: float
    distance: float
    instant: int
    comparison: int


def margin_of(found: CData) -> Margin:
    """Return a `struct fm_margin`."""
    return Margin(found.value, found.distance, found.instant, found.comparison)


def closest_of(found: CData) -> tuple[Margin, int] | None:
    """Return a `struct fm_closest`: the margin and the time of its step; None: none is known."""
    return (margin_of(found.margin), found.at) if found.is_known else None


class Evaluator:
    """
    Runs a monitor: takes values and the time, steps the groups that are due, returns violations.

    Inputs with an initial value have it from the start. Not thread-safe: a call releases Python's
    interpreter lock, so that threads that share an evaluator need a lock around each call.
    """

    def __init__(
        self, monitor: Monitor, *, policy: Policy | None = None, period: float | None = None,
        patience: float = 0.0, reports_recoveries: bool = False, library: Path | None = None,
    ) -> None:
        """
        Make an evaluator, with all groups at their start.

        Parameters
        ----------
        monitor
            the monitor to run; a reference to it is kept.
        policy
            when a step happens; the manifest's when None.
        period
            of the policy periodic, in seconds; the manifest's when None.
        patience
            in seconds: see `fm_evaluator_advance`; 0 puts no timeout off.
        reports_recoveries
            for an engine: its details say, too, when what was announced is over.
        library
            the evaluator's library; when None it is built, or taken from the cache.

        Raises
        ------
        LibraryError
            if the monitor, its manifest and the evaluator do not match.
        """
        self.monitor = monitor
        self.policy = policy or monitor.manifest.policy
        self._library: Any = load_evaluator(library or evaluator_library())
        try:
            self._options = EvaluatorOptions(
                monitor, self.policy, period or monitor.manifest.period, patience,
                reports_recoveries)
            self._make()
            self._make_values()
        except (OverflowError, TypeError) as error:
            raise LibraryError(f'the manifest holds what does not fit C ({error})') from None
        self._violations = ffi.new(
            'struct fm_violation[]', max(1, len(monitor.manifest.requirements)))

    def _make(self) -> None:
        size = self._library.fm_evaluator_bytes(self._options.pointer)
        if size == 0:
            raise LibraryError('the monitor was compiled for another evaluator')
        self._block = ffi.new('char[]', size + ALIGNMENT)
        address = int(ffi.cast('uintptr_t', self._block))
        memory = self._block + -address % ALIGNMENT
        self.pointer: CData = self._library.fm_evaluator_init(memory, self._options.pointer)
        if self.pointer == ffi.NULL:
            raise LibraryError('the evaluator refuses what the manifest says of inputs and topics')

    def _make_values(self) -> None:
        """Allocate a buffer for the next value of each input, and map the current values."""
        values = ffi.cast('const char *', self._library.fm_evaluator_inputs(self.pointer))
        inputs = self.monitor.manifest.inputs
        types = [item.value_type.c_name for item in self.monitor.manifest.inputs]
        self._next = [ffi.new(f'{name} *') for name in types]
        self._current = [
            ffi.cast(f'const {name} *', values + self.monitor.pointer.inputs[index].offset)
            for index, name in enumerate(types)]
        for index, item in enumerate(inputs):
            if item.initial is not None:
                self._next[index][0] = item.initial
                self._library.fm_evaluator_initial_from(self.pointer, index, self._next[index])

    @property
    def library(self) -> Any:
        """The loaded library with the functions of csrc."""
        return self._library

    @property
    def options(self) -> CData:
        """The `struct fm_evaluator_options` of this evaluator."""
        return self._options.pointer

    def store(self, index: int, value: bool | int | float, now: int | None = None) -> None:
        """
        Store a value of an input; a step happens only with `message` or `step`.

        It was received `now`; None: at the time of the last `advance`.

        Raises
        ------
        IndexError
            if there is no such input.
        OverflowError
            if an integer is outside the range of the input's type.
        TypeError
            if a float or text is given for an integer or bool, or text for a float.
        """
        place = self._next[index]
        place[0] = value
        if now is None:
            now = self._library.fm_evaluator_now(self.pointer)
        self._library.fm_evaluator_store_from(self.pointer, index, place, now)

    def arrival(self, now: int) -> int:
        """
        Return when a message that comes `now` takes effect; to be used in its place.

        Under the policy timed that is a nanosecond after the last evaluation if that was `now`.
        """
        return int(self._library.fm_evaluator_arrival(self.pointer, now))

    def unusable(self, index: int) -> None:
        """Count a field of an input that cannot be used; the input keeps its value."""
        self._library.fm_evaluator_unusable(self.pointer, index)

    def undecodable(self, topic: int) -> None:
        """Count a message of a topic that cannot be decoded; no group steps."""
        self._library.fm_evaluator_undecodable(self.pointer, topic)

    def message(self, topic: int, now: int) -> list[Violation]:
        """
        Take the steps due after a message of a topic, whose fields were stored before.

        Parameters
        ----------
        topic
            index in the manifest's topics.
        now
            the time of the message: the stamp of its violations.

        Returns
        -------
        list[Violation]
            those to announce, by group, then requirement.
        """
        count = self._library.fm_evaluator_message(self.pointer, topic, now, self._violations)
        return self._found(count) if count else []

    def step(self, now: int = 0) -> list[Violation]:
        """Step all ready groups: a row of a trace is stored. As `message`."""
        count = self._library.fm_evaluator_step(self.pointer, now, self._violations)
        return self._found(count) if count else []

    def advance(self, now: int) -> list[Violation]:
        """
        Move the time, and take what is due by then: timeouts and periods.

        The first call begins the time. Each violation is stamped with its own instant.
        """
        found: list[Violation] = []
        while True:
            count = self._library.fm_evaluator_advance(self.pointer, now, self._violations)
            found += self._found(count)
            wake = self._library.fm_evaluator_wake(self.pointer)
            if wake > now or wake == NEVER:
                return found

    @property
    def deadline(self) -> int:
        """The next instant at which something is due without a message; `NEVER` if none is."""
        return int(self._library.fm_evaluator_deadline(self.pointer))

    def _found(self, count: int) -> list[Violation]:
        return [violation(item) for item in self._violations[0:count]]

    def rows(
        self, columns: Sequence['array[Any] | None'], times: 'array[int]',
        until: int | None = None,
    ) -> Iterator[tuple['array[int]', bytes]]:
        """
        Take many rows of a trace, each a step of all ready groups.

        Parameters
        ----------
        columns, times
            as for `native_rows`.
        until
            what is due by then is taken after the last row; None: nothing is.

        Yields
        ------
        tuple[array[int], bytes]
            times, and as many rows of verdicts, one byte a requirement: 1 satisfied, 0 violated.
            There is one for each row, and one for each instant between and after the rows at which
            a verdict differs from those before it.

        Raises
        ------
        ValueError
            if a column has another type or length.
        """
        for instants, verdicts, _ in self._rows(self.native_rows(columns, times), until, ffi.NULL):
            yield instants, verdicts

    def margin_rows(
        self, columns: Sequence['array[Any] | None'], times: 'array[int]',
        until: int | None = None,
    ) -> Iterator[tuple['array[int]', bytes, list[Margin]]]:
        """
        Do as `rows`, with margins: one a requirement for each row of verdicts.

        There is a row for each instant at which a margin differs, too. The monitor has margins.
        """
        width = len(self.monitor.manifest.requirements)
        room = ffi.new('struct fm_margin[]', _TABLE_ROWS * width)
        for instants, verdicts, count in self._rows(
                self.native_rows(columns, times), until, room):
            yield instants, verdicts, [margin_of(room[place]) for place in range(count * width)]

    def _rows(self, rows: 'NativeRows', until: int | None,
              margins: CData) -> Iterator[tuple['array[int]', bytes, int]]:
        rows.pointer.margins = margins
        width = len(self.monitor.manifest.requirements)
        instants, verdicts = array('q', bytes(8 * _TABLE_ROWS)), bytearray(_TABLE_ROWS * width)
        count = _TABLE_ROWS
        while count == _TABLE_ROWS:
            count = self._library.fm_evaluator_rows(
                self.pointer, rows.pointer, -2**63 if until is None else until, _TABLE_ROWS,
                ffi.from_buffer('int64_t[]', instants), ffi.from_buffer('bool[]', verdicts))
            if count:
                yield instants[:count], bytes(verdicts[:count * width]), count

    def closest(self, requirement: int) -> tuple[Margin, int] | None:
        """Return the least margin of a requirement and the time of its step; None: none known."""
        return closest_of(self._library.fm_evaluator_closest(self.pointer, requirement))

    def forget_closest(self) -> None:
        """Forget the least margins."""
        self._library.fm_evaluator_forget_closest(self.pointer)

    def native_rows(
            self, columns: Sequence['array[Any] | None'], times: 'array[int]',
            come: 'Sequence[bytes] | None' = None) -> 'NativeRows':
        """
        Return rows as C takes them.

        Parameters
        ----------
        columns
            one for each input: an array of the input's `typecode`, as long as `times`, or None if
            the input is to keep its value, or is measured.
        times
            when each row takes effect, in nanoseconds; strictly increasing, typecode `q`.
        come
            of each input a flag for each row: whether it has a value in it, of a measured one a
            message; None: in all, and of a measured one where its reception says so.

        Raises
        ------
        ValueError
            if a column has another type or length.
        """
        if len(columns) != len(self._next):
            raise ValueError(f'{len(columns)} columns for {len(self._next)} inputs')
        return NativeRows([self._column(index, column, len(times))
                           for index, column in enumerate(columns)], times,
                          [self._come(index, columns) for index in range(len(columns))]
                          if come is None else list(map(ffi.from_buffer, come)))

    def _come(self, index: int, columns: Sequence['array[Any] | None']) -> CData:
        """Return in which rows a message of a measured input came; NULL: in all."""
        inputs = self.monitor.manifest.inputs
        item = inputs[index]
        if not item.source.is_measured or columns[index] is not None:
            return ffi.NULL
        for other, column in zip(inputs, columns, strict=True):
            if other.source is InputSource.RECEIVED and item.topic and column is not None \
                    and other.topic == item.topic:
                return ffi.from_buffer(column)
        return ffi.NULL

    def _column(self, index: int, column: 'array[Any] | None', count: int) -> CData:
        if column is None:
            return ffi.NULL
        item = self.monitor.manifest.inputs[index]
        if column.typecode != item.value_type.typecode or len(column) != count:
            raise ValueError(
                f"the column of '{item.name}' is not {count} of type {item.value_type.value}")
        return ffi.from_buffer(column)

    def reset(self) -> None:
        """Put all groups at their start; the inputs keep their values, and the counters go on."""
        self._library.fm_evaluator_reset(self.pointer)

    def save(self) -> bytes:
        """Return a copy of the instance: values, state, readiness, verdicts and times."""
        block = ffi.new('char[]', self._library.fm_evaluator_instance_bytes(self.pointer))
        self._library.fm_evaluator_save(self.pointer, block)
        return bytes(ffi.buffer(block))

    def restore(self, instance: bytes) -> None:
        """Put back an instance that an evaluator of the same monitor and options has saved."""
        self._library.fm_evaluator_restore(self.pointer, ffi.from_buffer(instance))

    def log_trials(self) -> 'TrialLog':
        """Return a log of the trials that are decided from now on; it replaces an earlier one."""
        self._trials = TrialLog()
        self._library.fm_evaluator_log_trials(self.pointer, self._trials.pointer)
        return self._trials

    def draw_margins(self, begin: int, end: int, parts: int) -> 'MarginLanes':
        """Return the margins of all steps from now on between two times; the monitor has some."""
        self._lanes = MarginLanes(
            len(self.monitor.manifest.requirements), begin, end, parts)
        self._library.fm_evaluator_draw_margins(self.pointer, self._lanes.pointer)
        return self._lanes

    def ready(self, group: int) -> bool:
        """Return whether every input that a group reads has a value."""
        return bool(self._library.fm_evaluator_ready(self.pointer, group))

    def steps(self, group: int) -> int:
        """Return how many steps a group has taken since start or reset."""
        return int(self._library.fm_evaluator_steps(self.pointer, group))

    def start(self, group: int) -> int:
        """Return the time of the first of these steps; any number if there was none."""
        return int(self._library.fm_evaluator_start(self.pointer, group))

    @property
    def verdicts(self) -> list[bool]:
        """Verdicts of the last steps, by requirement; True before the first step."""
        count = len(self.monitor.manifest.requirements)
        return list(self._library.fm_evaluator_verdicts(self.pointer)[0:count])

    def value(self, index: int) -> bool | int | float | None:
        """Return the current value of an input, None before its first."""
        current: bool | int | float = self._current[index][0]
        return current if self._library.fm_evaluator_has_value(self.pointer, index) else None

    def time_counts(self) -> TimeCounts:
        """Return the counters of the time."""
        found = self._library.fm_evaluator_time_counts(self.pointer)
        return TimeCounts(found.periods, found.late, found.missed, found.restarts,
                          found.overflows, found.restarted_at)

    def requirement_counts(self, index: int) -> RequirementCounts:
        """Return the counters of a requirement."""
        return requirement_counts(self._library, self.pointer, index)

    def input_counts(self, index: int) -> InputCounts:
        """Return the counters of an input."""
        return input_counts(self._library, self.pointer, index)

    def topic_counts(self, index: int) -> TopicCounts:
        """Return the counters of a topic."""
        found = self._library.fm_evaluator_topic_counts(self.pointer, index)
        return TopicCounts(found.messages, found.undecodable)


def requirement_counts(library: Any, pointer: CData, index: int) -> RequirementCounts:
    """Return the counters of a requirement of a `struct fm_evaluator`."""
    found = library.fm_evaluator_requirement_counts(pointer, index)
    return RequirementCounts(
        found.steps, found.violations, found.announced, bool(found.verdict),
        bool(found.holds), bool(found.is_violated))


def input_counts(library: Any, pointer: CData, index: int) -> InputCounts:
    """Return the counters of an input of a `struct fm_evaluator`."""
    found = library.fm_evaluator_input_counts(pointer, index)
    return InputCounts(found.received, found.unusable, found.overwritten)


class NativeRows:
    """A `struct fm_rows`; keeps alive what it points to."""

    def __init__(self, columns: list[CData], times: 'array[int]', come: list[CData]) -> None:
        self._columns, self._come = columns, come
        self._flags = ffi.new('const uint8_t *[]', [
            ffi.cast('const uint8_t *', item) for item in (*come, ffi.NULL)])
        self._pointers = ffi.new('const void *[]', [*columns, ffi.NULL])
        self._times = ffi.from_buffer('int64_t[]', times)
        self.pointer: CData = ffi.new('struct fm_rows *', {
            'columns': self._pointers, 'times': self._times, 'n': len(times),
            'come': self._flags})


class MarginLanes:
    """A `struct fm_margin_lanes`, which an evaluator writes to."""

    def __init__(self, count: int, begin: int, end: int, parts: int) -> None:
        """Make lanes of so many requirements, without margins."""
        self._n = min(parts, end - begin + 1)
        unknown = (math.nan, math.nan, 0, -1)
        self._least = ffi.new('struct fm_margin[]', [unknown] * (count * self._n))
        self._last = ffi.new('struct fm_margin[]', [unknown] * (count * self._n))
        self.pointer: CData = ffi.new('struct fm_margin_lanes *', {
            'begin': begin, 'width': (end - begin) // self._n + 1, 'n': self._n,
            'least': self._least, 'last': self._last})

    def lane(self, requirement: int) -> list[Margin | None]:
        """
        Return the least margin in each part; None: it is not known.

        A margin holds until the next step.
        """
        found: list[Margin | None] = []
        before: Margin | None = None
        for place in range(requirement * self._n, (requirement + 1) * self._n):
            least, last = margin_of(self._least[place]), margin_of(self._last[place])
            known = [item for item in (before, least) if item and not math.isnan(item.value)]
            found.append(min(known, key=lambda item: item.value, default=None))
            before = before if math.isnan(last.value) else last
        return found


class TrialLog:
    """A `struct fm_trial_log`, which an evaluator writes to."""

    def __init__(self) -> None:
        """Allocate room."""
        self._records = ffi.new('struct fm_trial_record[]', _MOST_TRIALS)
        self.pointer: CData = ffi.new('struct fm_trial_log *', {
            'records': self._records, 'room': _MOST_TRIALS})

    @property
    def missed(self) -> int:
        """How many trials found no room since the log was made."""
        return int(self.pointer.missed)

    def take(self) -> list[tuple[int, int, bool]]:
        """Return the trials since the last call: requirement, time (ns), whether it failed."""
        found = [(item.requirement, item.stamp, bool(item.has_failed))
                 for item in self._records[0:self.pointer.n]] if self.pointer.n else []
        self.pointer.n = 0
        return found


class EvaluatorOptions:
    """The `struct fm_evaluator_options` of a monitor; keeps alive what the struct points to."""

    def __init__(self, monitor: Monitor, policy: Policy, period: float | None,
                 patience: float, reports_recoveries: bool,
                 n_reported: int | None = None) -> None:
        """Fill the struct; of the requirements only the first `n_reported` are reported."""
        manifest = monitor.manifest
        self._fed = [ffi.new('uint32_t[]', [*topic.inputs, 0]) for topic in manifest.topics]
        self._topics = ffi.new('struct fm_topic[]', max(1, len(manifest.topics)))
        for index, topic in enumerate(manifest.topics):
            self._topics[index] = {'inputs': self._fed[index], 'n_inputs': len(topic.inputs)}
        self._reports = ffi.new('uint8_t[]', [
            *(ffi.integer_const(
                _REPORTS[item.report] if n_reported is None or place < n_reported
                else 'FM_UNREPORTED') for place, item in enumerate(manifest.requirements)), 0])
        self._sources = ffi.new('uint8_t[]', [
            *(ffi.integer_const(_SOURCES[item.source]) for item in manifest.inputs), 0])
        self._timeouts = ffi.new('int64_t[]', [
            *(nanoseconds(item.timeout) if item.topic is not None else 0
              for item in manifest.inputs), 0])
        self._violates = ffi.new('bool[]', [
            *(item.stale is Stale.VIOLATE for item in manifest.inputs), False])
        self._startups = ffi.new('int64_t[]', [
            *(nanoseconds(item.startup) for item in manifest.inputs), 0])
        self._windows = ffi.new('int64_t[]', [*(item.window for item in manifest.inputs), 0])
        self._rooms = ffi.new('uint32_t[]', [*(item.room for item in manifest.inputs), 0])
        self.pointer = ffi.new('struct fm_evaluator_options *', {
            'monitor': monitor.pointer,
            'topics': self._topics,
            'n_topics': len(manifest.topics),
            'policy': ffi.integer_const(f'FM_{policy.name}'),
            'reports': self._reports,
            'timeouts': self._timeouts,
            'violates': self._violates,
            'period': nanoseconds(period) if policy is Policy.PERIODIC else 0,
            'patience': nanoseconds(patience),
            'sources': self._sources,
            'reports_recoveries': reports_recoveries,
            'startups': self._startups,
            'windows': self._windows,
            'rooms': self._rooms,
            'tests': monitor.tests,
            'margins': monitor.margins,
        })


def nanoseconds(seconds: float | None) -> int:
    """Return a duration in nanoseconds, at least one; 0 for none."""
    return max(1, round(seconds * 1e9)) if seconds else 0
