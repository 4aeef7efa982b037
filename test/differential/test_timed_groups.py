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
Timed traffic in any order: the evaluator under `timed`, against the reference of each requirement.

The reference of a requirement sees the messages of its inputs' topics from the one that makes it
ready, at the instants at which they take effect. This file makes its trace again, in the simplest
way.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import pairwise
from random import Random
from typing import Any

from differential.test_timed_formulas import Scale, SCALES, TimedFormulaMaker
from fret_monitor.build import build_specification
from fret_monitor.logic.formula import ALWAYS, Historically, Variable
from fret_monitor.logic.specification import Property, Signal, Specification
from fret_monitor.logic.timed import evaluate_timed, TimedTrace
from fret_monitor.model.policies import InputSource, Policy, Report
from fret_monitor.model.values import ValueType
from fret_monitor.runtime.evaluator import Evaluator, Violation
import pytest
from strategies import INPUTS, property_of, random_inputs, random_trace, some, specification_of

BEGIN = 5_000_000_000  # of the time; the first message comes 1 ns later
FIELDS = tuple(item for item in INPUTS
               if item.type in (ValueType.BOOL, ValueType.INT32, ValueType.FLOAT64))
RECEPTIONS = tuple(Variable(f'{name}_received', ValueType.BOOL) for name in 'pq')


@dataclass(frozen=True)
class Message:
    """A message of a topic at a time; the values of its inputs, by name."""

    topic: int
    time: int
    values: dict[str, Any]


@dataclass
class Alone:
    """One requirement on its own: its rows since the start, and when they took effect."""

    item: Property
    values: dict[str, Any] = field(default_factory=dict)
    instants: list[int] = field(default_factory=list)
    rows: list[dict[str, Any]] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Begin with the time if nothing is read."""
        if not self.item.inputs:
            self._add(BEGIN)

    def take(self, message: Message, instant: int) -> None:
        """Store the values of a message, and begin or go on if they are all there."""
        reads = self.item.inputs
        read = {name: value for name, value in message.values.items() if name in reads}
        self.end_receptions(instant)
        if not read:
            return
        self.values |= read
        if self.values.keys() == set(reads):
            self._add(instant)

    def end_receptions(self, until: int) -> None:
        """Let a reception be over one nanosecond after its message."""
        over = {name: False for name in self.values if name.endswith('_received')
                and self.values[name]}
        self.values |= over
        if over and self.instants and self.instants[-1] < until:
            self._add(self.instants[-1] + 1)

    def _add(self, instant: int) -> None:
        if self.instants and self.instants[-1] == instant:
            self.rows.pop()
            self.instants.pop()
        self.instants.append(instant)
        self.rows.append(dict(self.values))

    def trace(self, until: int) -> TimedTrace:
        """Return what the requirement has seen."""
        columns = {name: [row[name] for row in self.rows] for name in self.item.inputs}
        ticks = [instant - self.instants[0] for instant in self.instants]
        return TimedTrace(ticks, columns, until - self.instants[0])

    def falls(self, until: int) -> list[tuple[int, int]]:
        """Return the ticks and times at which what is reported becomes false."""
        self.end_receptions(until)
        if not self.instants:
            return []
        formula = self.item.formula
        if self.item.report is Report.OCCURRENCE and isinstance(formula, Historically) \
                and formula.window == ALWAYS:
            formula = formula.argument
        history = evaluate_timed([formula], self.trace(until))[0]
        pairs = pairwise([(0, True), *history])
        return [(tick, self.instants[0] + tick) for (_, before), (tick, value) in pairs
                if before and not value]


def specification(rng: Random, scale: Scale) -> Specification:
    """Return requirements on few inputs each, some of them receptions; some share a topic."""
    inputs = (*FIELDS, *RECEPTIONS)
    properties = [requirement(rng, scale, f'R-{number}', inputs) for number in range(60)]
    made = specification_of(properties, inputs, Policy.TIMED)
    signals = tuple(replace(on_topic(item), max_rate=scale.max_rate) for item in made.signals)
    return replace(made, signals=signals, unit=Fraction(1))


def requirement(rng: Random, scale: Scale, name: str, inputs: Sequence[Variable]) -> Property:
    reads = random_inputs(rng, inputs, 3)
    formula = TimedFormulaMaker(rng.randrange, scale, reads).formula(5 + rng.randrange(15))
    report = rng.choice((Report.ONSET, Report.OCCURRENCE, Report.OCCURRENCE))
    if report is Report.OCCURRENCE and rng.random() < 0.5:
        formula = Historically(ALWAYS, formula)
    return replace(property_of(name, formula), report=report)


def on_topic(signal: Signal) -> Signal:
    """Let inputs of float64 share one topic; a reception is of a topic that feeds an input."""
    if signal.type is ValueType.FLOAT64:
        return replace(signal, topic='point', message_type='geometry_msgs/msg/Vector3',
                       path=(signal.name[0],))
    if signal.name.endswith('_received'):
        return replace(signal, topic=f'topic/{signal.name[0]}', path=(),
                       source=InputSource.RECEIVED)
    return signal


def random_traffic(rng: Random, scale: Scale, topics: list[list[str]],
                   count: int) -> list[Message]:
    """Return messages at any time: together, at deadlines of one another, or far apart."""
    trace = random_trace(rng, FIELDS, count)
    gaps = sorted({max(0, bound + more) for bound in scale.bounds for more in (-1, 0, 1)})
    times = [BEGIN + 1]
    messages = []
    for row in range(count):
        topic = row if row < len(topics) else rng.randrange(len(topics))
        values = {name: True if name.endswith('_received') else trace[name][row]
                  for name in topics[topic]}
        messages.append(Message(topic, times[-1], values))
        time = times[-1 - rng.randrange(min(4, len(times)))] + rng.choice(gaps)
        times.append(max(time, times[-1]))
    return messages


@pytest.mark.parametrize('scale', ['ticks', 'seconds', 'both'])
@pytest.mark.parametrize('seed', some(range(2)))
def test_each_requirement_is_evaluated_as_if_it_were_alone(scale: str, seed: int) -> None:
    rng = Random(seed)
    spec = specification(rng, SCALES[scale])
    compiled = build_specification(spec)
    names = [item.name for item in spec.signals]
    topics = [[names[index] for index in topic.inputs] for topic in compiled.manifest.topics]
    for _ in range(3):
        evaluator = Evaluator(compiled.monitor)
        alone = [Alone(item) for item in spec.properties]
        found = evaluator.advance(BEGIN)
        now = BEGIN
        for message in random_traffic(rng, SCALES[scale], topics, 400):
            if rng.random() < 0.3 and now < message.time - 1:
                # Time may pass by itself before the message.
                found += evaluator.advance(rng.randrange(now, message.time))
            now = evaluator.arrival(message.time)
            found += take(evaluator, names, message, now)
            for one in alone:
                one.take(message, now)
        end = now + 3 * max(SCALES[scale].bounds)
        found += evaluator.advance(end)
        expected = [Violation(index, *fall) for index, one in enumerate(alone)
                    for fall in one.falls(end)]
        assert sorted(found) == sorted(expected)
        assert len(found) > 200


def take(evaluator: Evaluator, names: list[str], message: Message,
         now: int) -> list[Violation]:
    """Pass what is due before a message, and the message."""
    found = evaluator.advance(now - 1)
    for name, value in message.values.items():
        evaluator.store(names.index(name), value, now)
    return found + evaluator.message(message.topic, now)
