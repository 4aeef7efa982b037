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
Bundles of random texts: sentences and formulas, with definitions and numbers over time.

Bounds, windows and timeouts are a few ticks, a tenth of a second each, or as many steps.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
import math
from pathlib import Path
from random import Random
from typing import Any

from bag.recordings import TYPES
from bag.reference import findings, Message
from fret_monitor.bag import check
from fret_monitor.logic.specification import Specification
from fret_monitor.model.policies import Policy
from fret_monitor.program.rewriting import without_queues
from rosbags.rosbag2 import StoragePlugin, Writer

TICK_NS = 100_000_000
TOPICS = {'probe': 'Bool', 'x': 'Float32', 'n': 'Int16', 'p': 'Bool', 'q': 'Bool'}
INPUTS = 'xnpq'
EVALUATION = {Policy.TIMED: ', unit: 0.1', Policy.PERIODIC: ', rate: 10'}
MEASURES = {'rate_n': ('n', 'rate(0.5 s)'), 'gap_x': ('x', 'period()')}
_NUMBERS = (0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, -0.0, 5.5, math.nan, math.inf, -math.inf)
Change = tuple[str, int, bool]
"""A requirement, a time, and whether its violation is over."""


def random_value(rng: Random, topic: str) -> float:
    """Return a value for a topic."""
    if topic == 'x':
        return rng.choice(_NUMBERS)
    return rng.randrange(-2, 8) if topic == 'n' else rng.randrange(2)


@dataclass
class Words:
    """Random texts of the languages, and the definitions that they use."""

    rng: Random
    policy: Policy
    defined: dict[str, str] = field(default_factory=dict)

    def past(self, least: int = 0) -> str:
        """Return a time or a number of steps."""
        count = self.rng.randrange(least, 7)
        return f'{count / 10} s' if self.policy is Policy.TIMED else str(count)

    def window(self) -> str:
        """Return the bound of an operator."""
        low, high = sorted((self.past(), self.past()))
        far = self.past(1)
        return self.rng.choice([f'[0, {high}]', f'[{low}, {high}]', f'[<= {high}]', f'[< {far}]',
                                f'[>= {low}]'])

    def number(self) -> str:
        """Return a number, of the present or over time."""
        past, x = self.past(1), self.rng.choice(['x', 'x', 'n', *self._names('N')])
        return self.rng.choice([
            'x', 'n', f'maxOver({past}, {x})', f'minOver({past}, {x})', f'meanOver({past}, {x})',
            f'sumOver({past}, {x})', f'countOver({past}, {self.condition()})',
            f'changeOver({past}, {x})', f'heldAt({self.condition()}, {x})', f'abs({x})',
            f'derivative({x})', 'rate_n', 'gap_x', *self._names('N')])

    def condition(self) -> str:
        """Return a condition, of the present or over time."""
        if self.rng.randrange(3):
            return self.rng.choice(['p', 'q', '!p', 'x > 3.0', 'x <= 5.0', '(p | x > 6.0)',
                                    'came_q', 'n < 2', *self._names('C')])
        if self.policy is Policy.TIMED and not self.rng.randrange(5):
            seconds = self.rng.randrange(7) / 10
            return f'timeOver({self.past(1)}, {self.condition()}) <= {seconds}'
        relation = self.rng.choice(['<', '<=', '>', '>=', '=', '!='])
        return f'{self.number()} {relation} {self.rng.choice([-3, 0, 1, 2, 4, 10, 100])}'

    def property(self) -> str:
        """Return a formula whose bounds are a few ticks, or a sentence."""
        one, other, window = self.condition(), self.condition(), self.window()
        return self.rng.choice([
            f'{one} -> O{window} ({other})', f'H (H{window} ({one}) -> {other})',
            f'({one}) S{window} ({other})', f'H (({one}) & Y !({one}) -> {other})',
            f'({one}) T{window} ({other})', f'H (({one}) SI{window} ({other}))'])

    def requirement(self) -> str:
        """Return a requirement in one of the languages."""
        low, high = max(1, self.rng.randrange(7)), self.rng.randrange(7)
        seconds = self.policy is Policy.TIMED
        held = f'{low / 10} seconds' if seconds else str(low)
        within = f'{high / 10} seconds' if seconds else f'{high} ticks'
        one, other = self.condition(), self.condition()
        return self.rng.choice([
            *[f'ptltl: "{self.property()}"'] * 4,
            f'fretish: "when {one} the robot shall within {within} satisfy {other}"',
            f'fretish: "if persisted({held}, {one}) the robot shall within {within} '
            f'satisfy {other}"',
            f'fretish: "upon {one} the robot shall for {within} satisfy {other}"'])

    def define(self, count: int) -> None:
        """Define conditions and numbers, each of which may use those before it."""
        for index in range(count):
            self.defined[f'N{index}'] = self.number()
            self.defined[f'C{index}'] = self.rng.choice([self.property, self.condition])()

    def _names(self, letter: str) -> list[str]:
        return [name for name in self.defined if name[0] == letter]


def bundle(words: Words, number: int) -> str:
    """Return a bundle of random requirements; ACK_* acknowledges each message."""
    rng, policy = words.rng, words.policy
    words.define(4)
    evaluation = f'{{policy: {policy.value}{EVALUATION.get(policy, "")}}}'
    lines = ['format: 1', 'report: occurrence', f'evaluation: {evaluation}', 'inputs:']
    for topic, kind in TOPICS.items():
        options = f'topic: /{topic}, type: std_msgs/msg/{kind}'
        if topic in 'xp' and rng.randrange(2):
            options += f', timeout: {rng.choice([0.3, 0.4])}, stale: violate'
        names = (f'got_{topic}', *(['came_q'] if topic == 'q' else []))
        lines += [f'  {topic}: {{{options}, max_rate: 1000}}', *(
            f'  {name}: {{{options}, field: received(), max_rate: 1000}}' for name in names)]
        lines += [f'  {name}: {{{options}, field: {measure}, max_rate: 1000}}'
                  for name, (fed, measure) in MEASURES.items() if fed == topic]
    lines += ['definitions:', *(f'  {name}: "{text}"' for name, text in words.defined.items()),
              'requirements:',
              *(f'  - {{id: R{k}, {words.requirement()}}}' for k in range(number)),
              *(f'  - {{id: ACK_{topic}, ptltl: "!got_{topic}", report: every_step}}'
                for topic in TOPICS)]
    return '\n'.join([*lines, ''])


def lowered(specification: Specification) -> Specification:
    """Return the formulas whose falls are occurrences: a response is overdue until it comes."""
    formulas = without_queues([item.formula for item in specification.properties])
    return replace(specification, properties=tuple(
        replace(item, formula=formulas[item.formula]) for item in specification.properties))


def expected(specification: Specification, run: Sequence[Message],
             carried: dict[str, Any]) -> list[Change]:
    """Return the changes that the reference evaluators find in a run before its last message."""
    return changes_of({item.id: one.spans for item, one in zip(
        specification.properties, findings(specification, run, carried=carried), strict=True)},
        run[-1].received)


def recorded(bundle: Path, run: Sequence[Message], path: Path) -> list[Change]:
    """Return the changes that `bag` finds in a recording of a run before its last message."""
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topics = {f'/{topic}': (writer.add_connection(
            f'/{topic}', f'std_msgs/msg/{kind}', typestore=TYPES),
            TYPES.types[f'std_msgs/msg/{kind}']) for topic, kind in TOPICS.items()}
        for message in run:
            connection, kind = topics[message.topic]
            writer.write(connection, message.received, TYPES.serialize_cdr(
                kind(data=message.content.data), connection.msgtype))
    with check.opened(path) as (recording, find):
        reading = check.read_bundle(bundle, check.Selection(), find)
        result = check.run(check.compiled(reading).monitor, recording, check.Selection())
    assert result.errors == ()
    return changes_of({found.id: found.spans for found in result.findings}, run[-1].received)


def changes_of(spans: Mapping[str, Iterable[tuple[int, int | None]]], end: int) -> list[Change]:
    """Return the begins and ends of violations before a time."""
    return sorted((name, time, is_over) for name, found in spans.items() if name[0] == 'R'
                  for span in found for time, is_over in zip(span, (False, True))
                  if time is not None and time < end)
