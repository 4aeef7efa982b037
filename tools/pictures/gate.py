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
"""The flow through the gate of docs/gate.md with a lock, in the engine, in virtual time."""

from collections.abc import Iterator
from itertools import groupby
from operator import itemgetter
from pathlib import Path
import re
import tempfile

from fret_monitor.messages.installed import find_message
from fret_monitor.messages.serialize import serialize, Value
from fret_monitor.model.parts import NodePart
from fret_monitor.runtime import Engine, Evaluator, Judgement, MessageGate, NEVER
from fret_monitor.runtime.reporting import Reporter, ReportTable, Review, TopicFacts
from fret_monitor.start import start

from tools.pictures.pages import block
from tools.pictures.sheet import arrow, bar, box, document, dot, seconds, text

ACTION = 'actions: {stop: {lock: {topic: e_stop}}}\non_violation: [stop]\nrequirements:'
NS = 10**9
COMMANDS_S = tuple(0.25 + 0.5 * number for number in range(20))  # each 1 m/s
FRONT = ((0.9, 3.0), (1.3, 2.5), (1.7, 2.1), (2.1, 1.7), (2.5, 1.4), (2.9, 1.1), (3.3, 0.8),
         (3.7, 0.7), (4.1, 0.7), (4.5, 0.9), (4.9, 1.3), (5.3, 1.8), (5.7, 2.1), (6.1, 2.4),
         (8.1, 2.4), (8.5, 2.4), (8.9, 2.4), (9.3, 2.4), (9.7, 2.4))  # m; silent after 6.1 s
LEFT, SECOND, ROW, TOP, END_S = 110, 84, 46, 150, 10

Change = tuple[float, bool, str]  # when, whether it is open or free, and why not


class Run:
    """A run of the gate: what passed, what was sent instead, and the changes that were logged."""

    def __init__(self, folder: Path) -> None:
        bundle = folder / 'drive.yaml'
        bundle.write_text(block('docs/gate.md', 'drive.yaml').replace('requirements:', ACTION),
                          encoding='utf-8')
        monitor = start(bundle, part=NodePart('drive')).monitor
        self._manifest = monitor.manifest
        assert self._manifest.gate is not None
        self._rules = self._manifest.gate
        evaluator = Evaluator(monitor, reports_recoveries=True)
        self._engine = Engine(evaluator)
        self._engine.guard(MessageGate(evaluator, self._rules))
        self._engine.follow_states()
        self._engine.advance(NS)
        self._due = NS
        self._review = Review(Reporter(self._engine, ReportTable(self._manifest), '/fret_gate',
                                       [item.name for item in self._manifest.topics]), now=NS)
        self.commands: list[tuple[float, bool]] = []
        self.sent: list[float] = []
        self.gate: list[Change] = [(0.0, False, '')]
        self.lock: list[Change] = [(0.0, False, '')]
        plan = [*((due, 'cmd_vel_raw', 1.0) for due in COMMANDS_S),
                *((due, 'front', metres) for due, metres in FRONT)]
        for due, topic, value in sorted(plan):
            self._replace_until(due)
            self._give(topic, value, due)
        self._replace_until(END_S)

    def _give(self, topic: str, value: float, due: float) -> None:
        index = next(k for k, item in enumerate(self._manifest.topics) if item.name == topic)
        fields: dict[str, Value] = {'data': value} if topic == 'front' else {
            'twist': {'linear': {'x': value}}}
        data = serialize(find_message(self._manifest.topics[index].message_type), fields)
        if topic == 'front':
            self._engine.message(index, data, _time(due))
        else:
            self.commands.append((due, self._engine.judge(data, _time(due)) is Judgement.PASSED))
        self._look(due)

    def _replace_until(self, end: float) -> None:
        """Let time pass until then, and send what is due instead of messages."""
        while (at := min(self._engine.deadline, self._due)) < _time(end):
            self._engine.advance(at)
            if self._due == at and self._engine.replace(
                    self._rules.substitute, self._rules.stamp_at) is not None:
                self.sent.append((at - NS) / NS)
                self._due = at + self._rules.period
            self._look((at - NS) / NS)
        self._engine.advance(_time(end))

    def _look(self, now: float) -> None:
        if self._engine.library.fm_engine_replacement_due(self._engine.pointer) == NEVER:
            self._due = NEVER
        elif self._due == NEVER:  # at once, later at the rate: the engine's own is in real time
            self._due = _time(now)
        self._review.look([TopicFacts(1)] * len(self._manifest.topics), now=_time(now))
        for line in self._review.lines():
            found = re.match(r"(gate|lock) '\w+' is (\w+)(?:: (.*))?", line.text)
            if found is not None:
                changes = self.gate if found[1] == 'gate' else self.lock
                changes.append((now, found[2] in ('open', 'free'), found[3] or ''))


def _time(seconds: float) -> int:
    return NS + round(seconds * NS)


def drawn() -> str:
    """Return the picture."""
    with tempfile.TemporaryDirectory() as name:
        run = Run(Path(name))
    bottom = TOP + 5 * ROW
    return document(
        int(_x(END_S)) + 30, bottom + 50, 'The flow through a gate, with its lock',
        (*_parts(), *seconds(_x, END_S, TOP - 4, bottom), *_front(TOP),
         *_commands(run, TOP + ROW),
         *_lane('gate', ('open', 'closed'), run.gate, TOP + 2 * ROW), *_sent(run, TOP + 3 * ROW),
         *_lane('lock e_stop', ('free', 'locked'), run.lock, TOP + 4 * ROW),
         *_legend(bottom + 40)))


def _x(time: float) -> float:
    return LEFT + SECOND * time


def _parts() -> Iterator[str]:
    """Yield what sends and receives what."""
    for x, name in ((20, 'planner'), (380, 'gate'), (760, 'base')):
        yield from box(x, 20, 130, 40, name)
    yield from box(20, 90, 130, 40, 'range sensor')
    for x, to, name in ((150, 380, 'cmd_vel_raw'), (510, 760, 'cmd_vel')):
        yield from arrow(x, 40, to, 40)
        yield text((x + to) / 2, 32, name, 'middle')
    yield from arrow(150, 110, 420, 60, at=110)
    yield text(265, 102, 'front', 'middle')
    yield '<path class="arrow" d="M470 60V110"/>'
    yield from arrow(470, 110, 825, 60, at=110)
    yield text(640, 102, 'e_stop: the lock, ten times a second', 'middle')


def _front(y: float) -> Iterator[str]:
    yield text(8, y + 20, 'front (m)')
    for due, metres in FRONT:
        yield dot('message' if metres >= 1.0 else 'bad', _x(due), y + 12)
        yield text(_x(due), y + 32, f'{metres}', 'small middle faint')


def _commands(run: Run, y: float) -> Iterator[str]:
    yield text(8, y + 20, 'cmd_vel_raw')
    for due, has_passed in run.commands:
        yield dot('good' if has_passed else 'bad', _x(due), y + 15)


def _sent(run: Run, y: float) -> Iterator[str]:
    yield text(8, y + 20, 'cmd_vel')
    for due in run.sent:
        yield bar('instead', _x(due) - 1, y + 8, 2, 14)
    for due, has_passed in run.commands:
        if has_passed:
            yield dot('good', _x(due), y + 15)


def _lane(name: str, words: tuple[str, str], changes: list[Change], y: float) -> Iterator[str]:
    yield text(8, y + 20, name)
    ends = [*(time for time, _, _ in changes[1:]), END_S]
    lasting = [item for item, end in zip(changes, ends, strict=True) if end > item[0]]
    for _, group in groupby(lasting, key=itemgetter(1, 2)):
        time, is_good, why = next(group)
        end = min(item[0] for item in [*lasting, (END_S, False, '')]
                  if item[0] > time and item[1:] != (is_good, why))
        if end > time:
            yield bar('good' if is_good else 'bad', _x(time), y + 5, _x(end) - _x(time), 20)
            yield text(_x(time) + 4, y + 20, words[not is_good], 'small')
            for row, part in enumerate(why.split('; ')):
                yield text(_x(time) + 4, y + 37 + 13 * row, part, 'small faint')


def _legend(y: float) -> Iterator[str]:
    for x, kind, words in ((LEFT, 'good', 'passes'),
                           (LEFT + 90, 'bad', 'withheld, or below 1.0 m'),
                           (LEFT + 290, 'instead', 'substitute: speed 0, 20 times a second')):
        yield dot(kind, x, y - 4)
        yield text(x + 10, y, words, 'small')
