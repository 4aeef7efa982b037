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
Messages in any order: the evaluator against the reference run once for each requirement.

The reference of a requirement sees only the steps of its group. This file computes them again,
for one requirement at a time, in the simplest way.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from random import Random
from typing import Any

from fret_monitor.build import build_specification
from fret_monitor.logic.evaluate import verdicts
from fret_monitor.logic.formula import ALWAYS, Historically
from fret_monitor.logic.specification import Property, Signal, Specification
from fret_monitor.model.policies import Policy, Report
from fret_monitor.runtime.evaluator import Evaluator, Violation
import pytest
from strategies import INPUTS, random_inputs, random_property, random_trace, some, specification_of


@dataclass(frozen=True)
class Message:
    """A message of a topic: values of its inputs, by name. None in its place is a reset."""

    topic: int
    values: dict[str, Any]


@dataclass
class Alone:
    """One requirement on its own: its steps since the start, and the time of the first."""

    item: Property
    reads: frozenset[str]
    policy: Policy
    values: dict[str, Any] = field(default_factory=dict)
    fresh: set[str] = field(default_factory=set)
    steps: list[tuple[int, dict[str, Any]]] = field(default_factory=list)

    def take(self, message: Message, stamp: int) -> None:
        """Store the values, and step if the policy says so."""
        self.values |= {name: value for name, value in message.values.items()
                        if name in self.reads}
        self.fresh |= self.reads & message.values.keys()
        if self.reads <= self.values.keys() and self._is_due(message):
            self.steps.append((stamp, dict(self.values)))
            self.fresh.clear()

    def _is_due(self, message: Message) -> bool:
        match self.policy:
            case Policy.EVERY_MESSAGE:
                return True
            case Policy.RELEVANT_MESSAGE:
                return not self.reads or bool(self.reads & message.values.keys())
            case Policy.ALL_INPUTS:
                return self.reads <= self.fresh
            case _:
                return False

    def start_afresh(self) -> Iterator[tuple[int, int]]:
        """End the run, and yield its violations: step and stamp."""
        columns = {name: [values[name] for _, values in self.steps] for name in self.reads}
        trace = columns or {'nothing': [False] * len(self.steps)}
        before = True
        formula = self.item.formula
        if self.item.report is Report.OCCURRENCE and isinstance(formula, Historically) \
                and formula.window == ALWAYS:
            formula = formula.argument
        for step, verdict in enumerate(verdicts(formula, trace, self.item.feedback)):
            if not verdict and (before or self.item.report is Report.EVERY_STEP):
                yield step, self.steps[step][0]
            before = verdict
        self.steps.clear()
        self.fresh.clear()


def specification(rng: Random, policy: Policy) -> Specification:
    """Return requirements on few inputs each; some share a topic, some have initial values."""
    properties = [
        replace(random_property(rng, f'R-{number}', random_inputs(rng, INPUTS, 3), reach=20,
                                loops=int(number % 5 == 0)),
                report=rng.choice([*Report, Report.EVERY_STEP]))
        for number in range(50)]
    plain = specification_of(properties, INPUTS, policy)
    return replace(plain, signals=tuple(on_topic(rng, item) for item in plain.signals))


def on_topic(rng: Random, signal: Signal) -> Signal:
    """Let inputs of float64 share one topic, and give every fourth input an initial value."""
    if signal.type.value == 'float64':
        signal = replace(signal, topic='point', message_type='geometry_msgs/msg/Vector3',
                         path=(signal.name[0],))
    if rng.randrange(4):
        return signal
    return replace(signal, initial=signal.type.is_number and 1)


def random_messages(rng: Random, topics: list[list[str]], count: int) -> list[Message | None]:
    """Return messages in random order, the first of some topics late, and two resets."""
    trace = random_trace(rng, INPUTS, count)
    late = {topic: rng.choice((0, 0, 5, 40, 90)) for topic in range(len(topics))}
    messages: list[Message | None] = []
    for stamp in range(count):
        topic = rng.choice([topic for topic, start in late.items() if start <= stamp])
        messages.append(Message(topic, {name: trace[name][stamp] for name in topics[topic]}))
    messages[count // 3] = messages[count // 3 + 1] = messages[2 * count // 3] = None
    return messages


def alone(spec: Specification, messages: list[Message | None]) -> list[Violation]:
    """Return all expected violations, computed for each requirement separately."""
    initial = {item.name: item.initial for item in spec.signals if item.initial is not None}
    found = []
    for index, item in enumerate(spec.properties):
        reads = frozenset(item.inputs)
        one = Alone(item, reads, spec.policy,
                    {name: value for name, value in initial.items() if name in reads})
        for stamp, message in enumerate([*messages, None]):
            if message is not None:
                one.take(message, stamp)
            else:
                found += [Violation(index, *place) for place in one.start_afresh()]
    return sorted(found, key=lambda item: (item.stamp, item.requirement))


@pytest.mark.parametrize('policy', [
    Policy.EVERY_MESSAGE, Policy.RELEVANT_MESSAGE, Policy.ALL_INPUTS])
@pytest.mark.parametrize('seed', some([1, 2]))
def test_each_requirement_steps_as_if_it_were_alone(policy: Policy, seed: int) -> None:
    rng = Random(seed)
    spec = specification(rng, policy)
    compiled = build_specification(spec)
    names = [item.name for item in spec.signals]
    topics = [[names[index] for index in topic.inputs] for topic in compiled.manifest.topics]
    for _ in range(3):
        messages = random_messages(rng, topics, 600)
        evaluator = Evaluator(compiled.monitor)
        found: list[Violation] = []
        for stamp, message in enumerate(messages):
            found += feed(evaluator, names, message, stamp)
        found.sort(key=lambda item: (item.stamp, item.requirement))
        assert found == alone(spec, messages)
        assert len(found) > 1000


def feed(evaluator: Evaluator, names: list[str], message: Message | None,
         stamp: int) -> list[Violation]:
    """Pass one message, or a reset, to the evaluator."""
    if message is None:
        evaluator.reset()
        return []
    for name, value in message.values.items():
        evaluator.store(names.index(name), value)
    return evaluator.message(message.topic, stamp)
