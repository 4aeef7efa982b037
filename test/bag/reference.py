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
What a bundle finds in a recording, by the reference evaluators.

It is computed for one requirement at a time, in the simplest way, from messages that `rosbags` has
deserialized. Nothing of the engine, of `bag` or of the extractors is used.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any

from fret_monitor.logic.evaluate import verdicts
from fret_monitor.logic.formula import ALWAYS, Formula, Historically
from fret_monitor.logic.specification import Property, Signal, Specification
from fret_monitor.logic.timed import evaluate_timed, History, TimedTrace
from fret_monitor.model.policies import InputSource, Policy, Stale
from rosbags.rosbag2 import Reader
from rosbags.typesys import get_typestore, Stores

TYPES = get_typestore(Stores.ROS2_JAZZY)
LATER_NS = 10 ** 13  # after the end: the bounds of formulas are shorter


@dataclass(frozen=True)
class Message:
    """A message: its topic, its time of reception, and its content (times in nanoseconds)."""

    topic: str
    received: int
    content: Any

    @property
    def stamp(self) -> int:
        """The time in its header."""
        stamp = self.content.header.stamp
        return int(stamp.sec * 10**9 + stamp.nanosec)

    def value(self, signal: Signal) -> Any:
        """Return the value of an input."""
        match signal.source:
            case InputSource.RECEIVED:
                return True
            case InputSource.AGE:
                return (self.received - self.stamp) / 1e9
            case InputSource.FIELD:
                return getattr(self.content, str(signal.path[0]))
            case InputSource.RATE | InputSource.PERIOD | InputSource.TIME:
                raise ValueError(signal.source)  # no value of one message


@dataclass(frozen=True)
class Found:
    """What was found about a requirement; as in `Findings`."""

    verdict: bool | None
    is_open: bool
    violations: int | None
    spans: tuple[tuple[int, int | None], ...]


def read_messages(path: Path) -> list[Message]:
    """Return the messages of a recording, in the order of their reception."""
    with Reader(path) as reader:
        return [Message(item.topic, time, TYPES.deserialize_cdr(data, item.msgtype))
                for item, time, data in reader.messages()]


def measured(signal: Signal, came: Sequence[int], time: int) -> float | int | None:
    """Return a measure of messages that came at some times; None: it has none yet."""
    if signal.source is InputSource.PERIOD and len(came) > 1:
        return (came[-1] - came[-2]) / 1e9
    if signal.source is InputSource.TIME and came:
        return came[-1]
    if signal.source is InputSource.RATE and came and time >= came[0] + signal.window:
        inside = sum(1 for one in came if one > time - signal.window)
        return float(Fraction(inside * 10 ** 9, signal.window))
    return None


def last_values(specification: Specification, messages: Sequence[Message]) -> dict[str, Any]:
    """Return the values of inputs after some messages, as far as these give them values."""
    found: dict[str, Any] = {}
    for signal in specification.signals:
        own = [message for message in messages if message.topic == signal.topic]
        if signal.source.is_measured:
            value = measured(signal, [message.received for message in own], messages[-1].received)
            found |= {} if value is None else {signal.name: value}
        elif own:
            found[signal.name] = own[-1].value(signal)
    return found


def findings(specification: Specification, messages: Sequence[Message], *,
             reorder: int | None = None, more: int = 0,
             carried: Mapping[str, Any] | None = None) -> list[Found]:
    """
    Return what is found about each requirement, which reports occurrences.

    With `reorder` (ns) the stamps in the headers count. `more` is the time after the last message.
    `carried` are the values from before the time went back.
    """
    begin = messages[0].received - (reorder or 0)
    last = messages[-1].received
    times = [message.received for message in messages]
    if reorder is not None:
        times = [message.stamp for message in messages]
        messages = [message for _, message in sorted(
            zip(times, messages), key=lambda item: item[0])]
        times.sort()
    end = max(last + more, times[-1])
    if specification.policy is Policy.TIMED:
        times = _apart(times, begin)
        end = max(end, times[-1])
    return [_Alone(item, specification, begin, dict(carried or {})).found(times, messages, end)
            for item in specification.properties]


def _apart(times: Sequence[int], earliest: int) -> list[int]:
    """Return when messages take effect that no two of them do at one instant."""
    found = []
    for time in times:
        found.append(max(time, earliest))
        earliest = found[-1] + 1
    return found


@dataclass
class _Input:
    """When an input with a timeout becomes silent."""

    signal: Signal
    stored_at: int
    has_come: bool = False
    is_silent: bool = False

    @property
    def due(self) -> int | None:
        signal = self.signal
        if signal.timeout is None or self.is_silent:
            return None
        limit = signal.startup if signal.startup and not self.has_come else signal.timeout
        return self.stored_at + max(1, round(limit * 1e9))


@dataclass
class _Alone:
    """
    One requirement on its own: its steps, and what else decides about its verdict.

    `events` are, in order: `step` (when it steps, or is evaluated at a message), `silent` (an
    input became stale), `heard` (the last stale one has a value again, and another has none yet).
    """

    item: Property
    specification: Specification
    begin: int
    values: dict[str, Any] = field(default_factory=dict)
    fresh: set[str] = field(default_factory=set)
    rows: list[tuple[int, dict[str, Any]]] = field(default_factory=list)
    came: dict[str, list[int]] = field(default_factory=dict)  # messages of a measured input
    now: int = 0
    events: list[tuple[int, str]] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Begin with the initial values."""
        self.policy = self.specification.policy
        self.reads = frozenset(self.item.inputs)
        self.signals = [item for item in self.specification.signals if item.name in self.reads]
        self.inputs = [_Input(item, self.begin) for item in self.signals]
        self.values = {name: value for name, value in self.values.items() if name in self.reads}
        self.values |= {item.name: item.initial for item in self.signals
                        if item.initial is not None}
        period = self.specification.period
        self.period = None if period is None else int(period * 10**9)
        self.next_period = None if self.period is None else self.begin + self.period
        if self.policy is Policy.TIMED and self.is_ready:
            self._step(self.begin)

    @property
    def is_ready(self) -> bool:
        return self.reads <= self.values.keys()

    def found(self, times: Sequence[int], messages: Sequence[Message], end: int) -> Found:
        """Take all messages at their times, and what is due until the end."""
        for time, message in zip(times, messages, strict=True):
            self._pass(time - 1)
            self._take(time, message)
        self._pass(end)
        if self.policy is Policy.TIMED:
            self._end_receptions(end + 1)  # of a message at the end: no further one comes
        return self._timed(end) if self.policy is Policy.TIMED else self._stepped()

    # What happens

    def _pass(self, until: int) -> None:
        """Let the time pass: inputs become silent, and periods end."""
        while True:
            dues = [(item.due, 0, number) for number, item in enumerate(self.inputs)
                    if item.due is not None]
            if self.next_period is not None:
                dues.append((self.next_period, 1, 0))
            dues += [(change, 2, 0) for change in self._rate_changes()]
            if not dues or min(dues)[0] > until:
                break
            time, kind, number = min(dues)
            if kind == 2:
                self._end_receptions(time)
                self._renew(time)
                continue
            if kind == 1:
                self._renew(time)
                assert self.period is not None
                self.next_period = time + self.period
                if self.is_ready:
                    self._step(time)
                self._end_receptions()
                continue
            self.inputs[number].is_silent = True
            if self.signals[number].stale is Stale.VIOLATE:
                self.events.append((time, 'silent'))
        if self.policy is Policy.TIMED:
            self._end_receptions(until)

    def _take(self, time: int, message: Message) -> None:
        if self.policy is not Policy.PERIODIC:
            self._end_receptions(time if self.policy is Policy.TIMED else None)
        was_stale = self._is_stale
        read = [number for number, item in enumerate(self.signals)
                if item.topic is not None and '/' + item.topic.lstrip('/') == message.topic]
        for number in read:
            signal, state = self.signals[number], self.inputs[number]
            if signal.source.is_measured:
                self.came.setdefault(signal.name, []).append(time)
            else:
                self.values[signal.name] = message.value(signal)
            state.stored_at, state.has_come, state.is_silent = time, True, False
        self._renew(time)
        self.fresh |= {self.signals[number].name for number in read} & self.values.keys()
        if was_stale and not self._is_stale:
            self.events.append((time, 'ready' if self.is_ready else 'heard'))
        if self.is_ready and self._is_due(bool(read)):
            self._step(time)
            self.fresh.clear()

    def _rate_changes(self) -> Iterator[int]:
        """Yield when rates change without a message, under `timed`."""
        for signal in self.signals:
            came = self.came.get(signal.name, [])
            if signal.source is InputSource.RATE and self.policy is Policy.TIMED:
                yield from (time + signal.window for time in came
                            if time + signal.window > self.now)

    def _renew(self, time: int) -> None:
        """Let measured inputs have the values of a time."""
        self.now = time
        before = dict(self.values)
        for signal in self.signals:
            value = measured(signal, self.came.get(signal.name, []), time)
            if value is not None:
                self.values[signal.name] = value
        if self.values != before and self.policy is Policy.TIMED and self.is_ready:
            self._step(time, is_event=False)

    @property
    def _is_stale(self) -> bool:
        return any(state.is_silent and state.signal.stale is Stale.VIOLATE
                   for state in self.inputs)

    def _is_due(self, is_read: bool) -> bool:
        match self.policy:
            case Policy.EVERY_MESSAGE:
                return True
            case Policy.RELEVANT_MESSAGE:
                return is_read or not self.reads
            case Policy.ALL_INPUTS:
                return self.reads <= self.fresh
            case Policy.TIMED:
                return is_read
            case Policy.PERIODIC:
                return False

    def _end_receptions(self, until: int | None = None) -> None:
        """Let receptions be over; under `timed` one nanosecond after their message."""
        over = {item.name: False for item in self.signals
                if item.source is InputSource.RECEIVED and self.values.get(item.name)}
        if until is not None and over and self.rows:
            time = self.rows[-1][0] + 1
            if time > until:
                return
            self.values |= over
            self._step(time, is_event=False)
        self.values |= over

    def _step(self, time: int, *, is_event: bool = True) -> None:
        if self.policy is Policy.TIMED and self.rows and self.rows[-1][0] == time:
            self.rows.pop()
            is_event = is_event and self.events[-1:] != [(time, 'step')]  # at the begin
        self.rows.append((time, dict(self.values)))
        if is_event:
            self.events.append((time, 'step'))

    # What is found

    @property
    def _compared(self) -> Formula:
        """The formula whose falls are occurrences."""
        formula = self.item.formula
        if isinstance(formula, Historically) and formula.window == ALWAYS:
            return formula.argument
        return formula

    def _columns(self) -> dict[str, list[Any]]:
        return {name: [values[name] for _, values in self.rows] for name in self.reads}

    def _stepped(self) -> Found:
        trace = self._columns() or {'nothing': [False] * len(self.rows)}
        compared, whole = (iter(verdicts(formula, trace, self.item.feedback))
                           for formula in (self._compared, self.item.formula))
        violations = 0
        is_stale = False
        values = []
        for time, kind in self.events:
            if kind == 'step':
                one, other = next(compared), next(whole)
                values.append((time, one and not is_stale))
                violations += is_stale or not other
            elif kind == 'silent':
                violations += not is_stale
                values.append((time, False))
                is_stale = True
            else:
                is_stale = False
                if kind == 'heard':
                    values.append((time, True))
        spans = tuple(_spans(values))
        verdict = False if violations else True if self.rows else None
        return Found(verdict, False, violations, spans)

    def _timed(self, end: int) -> Found:
        history: History = []
        start = 0
        if self.rows:
            start = self.rows[0][0]
            trace = TimedTrace([time - start for time, _ in self.rows], self._columns(),
                               end - start + LATER_NS)
            history = evaluate_timed([self._compared], trace, self.item.feedback)[0]
        changes = [(start + tick, bool(value)) for tick, value in history]
        inner = [(time, 2, 'change') for time, _ in changes if time <= end]
        events = [(time, 0 if kind != 'silent' else 1, kind) for time, kind in self.events]
        is_stale = False
        values = []
        for time, _, kind in sorted([*events, *inner], key=lambda item: item[:2]):
            if kind in ('step', 'change'):
                value = next(value for since, value in reversed(changes) if since <= time)
                values.append((time, value and not is_stale))
            else:
                is_stale = kind == 'silent'
                if kind != 'ready':
                    values.append((time, kind == 'heard'))
        spans = tuple(_spans(values))
        falls = any(before and not value and time > end
                    for (_, before), (time, value) in pairwise(changes))
        is_open = not spans and falls
        return Found(False if spans else True if self.rows and not is_open else None, is_open,
                     None, spans)


def _spans(values: Sequence[tuple[int, bool]]) -> Iterator[tuple[int, int | None]]:
    """Yield begin and end of each time in which a value is false; None: it is so at the end."""
    since: int | None = None
    for time, value in values:
        if value and since is not None:
            yield since, time
            since = None
        elif not value and since is None:
            since = time
    if since is not None:
        yield since, None
