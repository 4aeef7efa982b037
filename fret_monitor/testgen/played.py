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
"""

from collections.abc import Iterator, Sequence

from fret_monitor.logic.specification import Property, Signal, Specification
from fret_monitor.model.manifest import SECONDS
from fret_monitor.model.policies import InputSource, Policy
from fret_monitor.testgen.recorded import history, merged, Recorded
from fret_monitor.traces.trace import Row

_SETTABLE = frozenset({'', SECONDS, 'min', 'max'})


def obstacle(specification: Specification) -> str:
    """Return why the inputs of a bundle cannot be published one by one; '' if they can."""
    arrays: dict[tuple[str | None, object], str] = {}
    for signal in specification.signals:
        if signal.topic is None:
            return f"'{signal.name}' has no topic"
        if signal.source is not InputSource.FIELD or signal.reduction not in _SETTABLE or not all(
                isinstance(step, str) for step in signal.path):
            return f"'{signal.name}' is no field of its message"
        other = arrays.setdefault((signal.topic, signal.path), signal.name)
        if other != signal.name:
            return f"'{signal.name}' and '{other}' are read from one field"
        if signal.timeout is not None and specification.policy in (
                Policy.TIMED, Policy.PERIODIC):
            return f"'{signal.name}' has a timeout"
    return '' if specification.signals else 'it has no inputs'


def announced(specification: Specification, trace: Recorded) -> list[str] | None:
    """
    Return the ids of the requirements that are violated when a trace is played.

    None if it depends on nanoseconds, which a message needs to arrive.
    """
    found = [[item.id for item in specification.properties
              if _is_violated(item, specification, late)] for late in _late(specification, trace)]
    return found[0] if all(each == found[0] for each in found) else None


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
