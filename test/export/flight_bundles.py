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

"""Bundles for the targets `cfs` and `fprime`: messages, and the violations they must cause."""

import csv
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from random import Random

from fret_monitor.build import build, generate_monitor, GeneratedMonitor, read
from fret_monitor.export.examples import example
from fret_monitor.export.flight import topics_of
from fret_monitor.model.manifest import ManifestInput
from fret_monitor.model.policies import InputSource, Policy
from fret_monitor.model.values import ValueType
from fret_monitor.runtime.evaluator import Evaluator, RequirementCounts

S_NS = 10**9
END_NS = 1000 * S_NS

BUNDLES = {
    'steps': """\
format: 1
inputs:
  p: {type: bool}
  "\\"x, y\\"": {type: float32}
  x.y: {type: uint64}
  int: {type: float64}
  mode: {type: int8, values: {IDLE: 0, LANDING: -7}}
requirements:
  - {id: 'R"1{}%s', title: "*/ #error ??/", ptltl: 'p -> O[0,2] "x, y" > 0.1'}
  - {id: "R,2", ptltl: "H[3,5] (int >= 2.5) -> sqrt(int) < 1.6 & x.y > 9223372036854775808"}
  - {id: "*/ int main(void) //\\\\", severity: warn, ptltl: "mode >= IDLE | p"}
""",
    'timed': """\
format: 1
inputs:
  p: {type: bool}
  x: {type: float32}
evaluation: {policy: timed}
requirements:
  - {id: R-1, report: onset, ptltl: "p -> O[0, 2.5 s] (x > 0.5)"}
  - {id: R-2, report: onset, ptltl: "H[1 s, 3 s] p -> x > 0.25"}
  - {id: r_2, report: onset, ptltl: "p -> x > 0.75"}
""",
    'cycles': """\
format: 1
inputs:
  m_runner: {type: bool, topic: pump}
  portNum: {type: int16, topic: level}
evaluation: {policy: periodic, period: 0.5}
requirements:
  - {id: R-1, ptltl: "m_runner -> O[0,3] portNum > 100"}
""",
    'topics': """\
format: 1
topics:
  /pump/point: {type: geometry_msgs/msg/Point, fields: {x: x, y: {field: y, initial: 0.5}}}
  Pump_Point: {type: std_msgs/msg/Bool, timeout: 3, stale: violate, fields: {p: data}}
  scan:
    type: sensor_msgs/msg/Imu
    fields: {came: {field: received(), initial: false}, old: age(header.stamp)}
evaluation: {policy: relevant_message}
requirements:
  - {id: R-1, ptltl: "x > 0.5 -> y < 0.5"}
  - {id: R-2, report: onset, ptltl: "p -> O[0,2] x > 0.5"}
  - {id: R-3, ptltl: "came & p -> old < 0.25"}
""",
}


@dataclass(frozen=True)
class Message:
    """A message of a topic (index), a reset (RESET), or the end of a period (WAKEUP)."""

    time: int
    topic: int
    values: dict[int, bool | int | float]
    age: int = 0


RESET, WAKEUP = -1, -2


@dataclass(frozen=True)
class Case:
    """Messages, and the times (ns) with the requirements whose violations are announced."""

    generated: GeneratedMonitor
    messages: list[Message]
    expected: list[tuple[int, int]]
    counts: tuple[RequirementCounts, ...] = ()


def cases(folder: Path, *, is_fprime: bool = False) -> dict[str, Case]:
    """
    Write the bundles, and return a case for each.

    Times are whole ticks of the clock: of 100 ns in cFS, of a microsecond in F Prime. `is_fprime`
    leaves the ages of messages out.
    """
    found = {}
    for name, text in BUNDLES.items():
        path = folder / f'{name}.yaml'
        path.write_text(text.replace(', old: age(header.stamp)}', '}').replace(
            'old < 0.25', 'x < 0.5') if is_fprime else text)
        generated = generate_monitor(read(path))
        found[name] = _by_evaluator(path, generated, 1000 if is_fprime else 100) \
            if name in ('topics', 'timed') else _by_reference(generated)
    return found


def _by_reference(generated: GeneratedMonitor) -> Case:
    """Return the example of an export: its verdicts are those of the reference evaluator."""
    manifest = generated.manifest
    trace, verdicts = (list(csv.reader(text.splitlines())) for text in example(generated))
    is_timed = manifest.policy is Policy.TIMED
    heading, *rows = trace
    messages = []
    for number, row in enumerate(rows):
        time = _ns(row[0]) if is_timed else number * S_NS
        cells = dict(zip(heading, row, strict=True))
        values = {index: _value(item, cells[item.name])
                  for index, item in enumerate(manifest.inputs)}
        for topic, item in enumerate(topics_of(manifest)):
            messages.append(Message(time, topic, {index: values[index] for index in item.inputs}))
        if manifest.policy is Policy.PERIODIC:
            messages.append(Message(time, WAKEUP, {}))
    expected, before = [], ['1'] * len(manifest.requirements)
    for first, *row in verdicts[1:]:
        time = _ns(first) if is_timed else int(first) * S_NS
        expected += [(time, index) for index, verdict in enumerate(row)
                     if verdict == '0' and (before[index] == '1' or not is_timed)]
        before = row
    return Case(generated, messages, expected)


def _ns(text: str) -> int:
    return int(Decimal(text) * S_NS)


def _value(item: ManifestInput, text: str) -> bool | int | float:
    named = dict(item.values)
    if text in named:
        return int(named[text])
    if item.value_type is ValueType.BOOL:
        return text in ('1', 'true')
    return float(text) if item.value_type.is_float else int(text)


def _by_evaluator(path: Path, generated: GeneratedMonitor, unit_ns: int) -> Case:
    """Return random messages with resets, and what the evaluator of the node announces."""
    rng, evaluator = Random(1), Evaluator(build(path).monitor)
    manifest = generated.manifest
    topics = topics_of(manifest)
    messages, expected = [], [(item.stamp, item.requirement) for item in evaluator.advance(0)]
    time = 0
    for _ in range(300):
        time += rng.choice((unit_ns, S_NS // 4, S_NS, 4 * S_NS))
        topic = rng.choice((*range(len(topics)), *range(len(topics)), len(topics) - 1, RESET))
        if topic == RESET:
            messages.append(Message(time, RESET, {}))
            found = evaluator.advance(time)
            evaluator.reset()
            found += evaluator.advance(time)
        else:
            found = evaluator.advance(time - 1)
            message = _random_message(time, topic, topics[topic].inputs, manifest.inputs, rng)
            messages.append(message)
            for index, value in message.values.items():
                evaluator.store(index, value, time)
            found += evaluator.message(topic, time) if manifest.topics else evaluator.step(time)
        expected += [(item.stamp, item.requirement) for item in found]
    expected += [(item.stamp, item.requirement) for item in evaluator.advance(END_NS)]
    counts = tuple(evaluator.requirement_counts(index)
                   for index in range(len(manifest.requirements)))
    return Case(generated, messages, expected, counts)


def _random_message(time: int, topic: int, inputs: tuple[int, ...],
                    items: tuple[ManifestInput, ...], rng: Random) -> Message:
    age = rng.choice((0, S_NS // 8, S_NS // 2))
    values: dict[int, bool | int | float] = {}
    for index in inputs:
        match items[index].source, items[index].value_type:
            case InputSource.RECEIVED, _:
                values[index] = True
            case InputSource.AGE, _:
                values[index] = age * 1e-9
            case _, ValueType.BOOL:
                values[index] = rng.random() < 0.5
            case _:
                values[index] = rng.choice((0.0, 0.25, 0.75, 1.0))
    return Message(time, topic, values, age)
