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
What a monitor announces when a trace is played to it over ROS topics.

A row becomes a message on each topic, in the bundle's order. So it may be several steps, and under
`timed` the messages after the first take effect a nanosecond later each. A message at the instant
of a deadline may take effect before or after it: what depends on that is not known.

The time of the monitor stands still between rows, and under `timed` and `periodic` goes on as the
trace says. Inputs with a `timeout` are published again meanwhile, so that none becomes silent;
under these policies an equal value changes nothing.
"""

from collections.abc import Iterator, Sequence
import math

from fret_monitor.logic.specification import Property, Signal, Specification
from fret_monitor.messages.installed import nested_layout
from fret_monitor.messages.layout import FieldType
from fret_monitor.model.manifest import SECONDS
from fret_monitor.model.playing import repeat_interval, stamp_of
from fret_monitor.model.policies import InputSource, Policy
from fret_monitor.model.times import NANOSECONDS
from fret_monitor.testgen.recorded import history, merged, Recorded
from fret_monitor.traces.trace import Row

_SETTABLE = frozenset({'', SECONDS, 'min', 'max', 'norm'})
_MOST_REPEATS = 100  # of a message with a timeout during a trace: each takes a tenth of a second


def obstacle(specification: Specification) -> str:
    """Return why the inputs of a bundle cannot be published one by one; '' if they can."""
    known: list[Signal] = []
    for signal in specification.signals:
        if signal.made:
            return f"'{signal.name}' is {signal.made.kind.words}"
        if signal.topic is None:
            return f"'{signal.name}' has no topic"
        if signal.layout is None:
            return 'the traces are of one instance'
        if signal.source is InputSource.RECEIVED:
            return (f"'{signal.name}' says at which rows a message comes, and the rows of a "
                    'played trace are all messages')
        if signal.source is not InputSource.FIELD or signal.reduction not in _SETTABLE or not all(
                isinstance(step, str) for step in signal.path) or (
                signal.reduction == 'norm' and not _is_of_doubles(signal)):
            return f"'{signal.name}' is no field of its message"
        for other in known:
            if _is_shared(signal, other):
                return f"'{other.name}' and '{signal.name}' are read from one field"
        known.append(signal)
    return '' if known else 'it has no inputs'


def _is_shared(one: Signal, other: Signal) -> bool:
    """Whether one of two inputs is read from the field of the other, or a part of it."""
    length = min(len(one.path), len(other.path))
    return one.topic == other.topic and one.path[:length] == other.path[:length]


def _is_of_doubles(signal: Signal) -> bool:
    """Whether a norm is that of float64 numbers, so that it can have any value."""
    kind = _type_at(signal)
    if kind is None or not kind.is_message:
        return kind is not None and kind.base == 'float64'
    assert signal.layout is not None
    return all(item.type.base == 'float64' for item in nested_layout(signal.layout, kind).fields)


def _type_at(signal: Signal) -> FieldType | None:
    """Return the type of the field that a path leads to."""
    layout, kind = signal.layout, None
    for name in signal.path:
        if layout is None or not isinstance(name, str):
            return None
        found = layout.find_field(name)
        if found is None:
            return None
        kind = found.type
        layout = nested_layout(layout, kind) if kind.is_message else None
    return kind


def announced(specification: Specification, trace: Recorded) -> list[str] | None:
    """
    Return the ids of the requirements that are violated when a trace is played.

    None if it depends on nanoseconds, which a message needs to arrive, or if the trace cannot be
    played: no message gives an input one of the values, or messages with a timeout would have to
    be published again too often.
    """
    if not _is_playable(specification, trace):
        return None
    found = [[item.id for item in specification.properties
              if _is_violated(item, specification, late)] for late in _late(specification, trace)]
    return found[0] if all(each == found[0] for each in found) else None


def _is_playable(specification: Specification, trace: Recorded) -> bool:
    return all(_has_message(signal, value) for row in trace.rows
               for signal, value in zip(specification.signals, row, strict=True)) \
        and _repeats(specification, trace) <= _MOST_REPEATS


def _has_message(signal: Signal, value: object) -> bool:
    """Whether there is a message from which an input gets a value."""
    if signal.reduction == SECONDS:
        return stamp_of(float(value)) is not None  # type: ignore[arg-type]
    if signal.reduction == 'norm' and isinstance(value, float):
        return math.isnan(value) or math.sqrt(value * value) == value
    return True


def _repeats(specification: Specification, trace: Recorded) -> int:
    """Return how often messages with a timeout are published again during a trace."""
    interval = repeat_interval(signal.timeout for signal in specification.signals)
    if interval is None or specification.policy not in (Policy.TIMED, Policy.PERIODIC):
        return 0
    tick = int((specification.period or 0) * NANOSECONDS['s']) \
        if specification.policy is Policy.PERIODIC else 1
    return (trace.end - trace.ticks[0]) * tick // interval


def _late(specification: Specification, trace: Recorded) -> Iterator[Recorded]:
    """Yield a trace, and under `timed` the same with later rows."""
    yield trace
    if specification.policy is Policy.TIMED:
        for delay in (1, 1 + len(specification.signals)):
            ticks = (trace.ticks[0], *(tick + delay for tick in trace.ticks[1:]))
            yield Recorded(ticks, trace.rows, max(trace.end, ticks[-1]))


def _is_violated(item: Property, specification: Specification, trace: Recorded) -> bool:
    signals = specification.signals
    places = [place for place, signal in enumerate(signals) if signal.name in item.inputs]
    own = {signals[place].topic for place in places}
    events = list(_events(specification, trace))
    waiting = {signals[place].topic for place in places if signals[place].initial is None}
    ticks: list[int] = []
    rows: list[Row] = []
    for tick, topic, row in events:
        waiting.discard(topic)
        is_step = topic is None or topic in own or (
            specification.policy is Policy.EVERY_MESSAGE)
        if (not waiting or topic is None) and is_step:
            ticks.append(tick)
            rows.append(tuple(row[place] for place in places))
    if not ticks:
        return False
    if specification.policy is not Policy.TIMED:
        ticks = list(range(len(rows)))
    end = max(trace.end, ticks[-1]) if specification.policy is Policy.TIMED else ticks[-1]
    steps = Recorded(tuple(tick - ticks[0] for tick in ticks), tuple(rows), end - ticks[0])
    found = history(item.formula, item.feedback, [signals[place].name for place in places],
                    merged(steps))
    return any(value is False for _, value in found)


def _events(specification: Specification,
            trace: Recorded) -> Iterator[tuple[int, str | None, Row]]:
    """Yield the time and the topic of each message, and the inputs after it; None: all topics."""
    signals = specification.signals
    if specification.policy in (Policy.ALL_INPUTS, Policy.PERIODIC):
        for number, row in enumerate(trace.at_each_tick()):
            yield number, None, row
        return
    is_timed = specification.policy is Policy.TIMED
    rows = list(zip(trace.ticks, trace.rows, strict=True)) if is_timed \
        else list(enumerate(trace.at_each_tick()))
    now: list[object] = [signal.initial for signal in signals]
    for number, (tick, row) in enumerate(rows):
        before = rows[number - 1][1] if is_timed and number else None
        for offset, topic in enumerate(published(signals, row, before)):
            now = [value if signal.topic == topic else old
                   for signal, value, old in zip(signals, row, now, strict=True)]
            yield tick + offset, topic, tuple(now)  # type: ignore[arg-type]


def published(signals: Sequence[Signal], row: Row, before: Row | None) -> list[str]:
    """Return the topics on which a row is published: those that changed, or all."""
    topics = dict.fromkeys(
        signal.topic for place, signal in enumerate(signals) if signal.topic is not None
        and (before is None or repr(row[place]) != repr(before[place])))
    return list(topics)
