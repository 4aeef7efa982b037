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

"""A review of a bundle's engine: its lines and statuses, at times that the test decides."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from fret_monitor.messages.installed import find_message
from fret_monitor.messages.serialize import serialize, Value
from fret_monitor.model.parts import NodePart, UNGATED
from fret_monitor.model.policies import Policy
from fret_monitor.native.binding import ffi
from fret_monitor.runtime import Engine, Evaluator, MessageGate
from fret_monitor.runtime.reporting import (
    LogLevel, Reporter, ReportTable, Review, StatusRecord, TopicFacts,
)
from fret_monitor.runtime.scopes import Scopes
from fret_monitor.start import start

SECOND = 10 ** 9
OK, WARN, ERROR = range(3)


class Reviewed:
    """
    The review of a bundle, on a node `/robot/fret_monitor`.

    The engine's time is told, and begins at 1 s. The review's `now` is apart from it, in seconds.
    """

    def __init__(self, folder: Path, text: str, *, gate: str = '', name: str = '',
                 policy: Policy | None = None, period: float | None = None,
                 takes_instances: bool = False) -> None:
        path = folder / 'bundle.yaml'
        path.write_text(text, encoding='utf-8')
        monitor = start(path, part=NodePart(gate) if gate else UNGATED,
                        takes_instances=takes_instances).monitor
        self.manifest = monitor.manifest
        scopes = Scopes(monitor, is_of_engine=True) if takes_instances else None
        evaluator = scopes.evaluator() if scopes is not None else Evaluator(
            monitor, policy=policy, period=period, reports_recoveries=True)
        self.engine = Engine(evaluator, scopes=scopes)
        if self.manifest.gate is not None:
            self.engine.guard(MessageGate(evaluator, self.manifest.gate))
        if self.manifest.actions:
            self.engine.follow_states()
        self.engine.advance(SECOND)
        self._table = ReportTable(self.manifest, name, policy=policy, period=period)
        self.now = 100.0
        self.topics = [TopicFacts(1)] * len(self.manifest.topics)
        self.activate_again()

    def activate_again(self, **before: Any) -> None:
        """Begin another review, with the counts of `before`."""
        self.reporter = Reporter(
            self.engine, self._table, '/robot/fret_monitor',
            [f'/robot/{item.name}' for item in self.manifest.topics])
        self.review = Review(self.reporter, now=int(self.now * 1e9), **before)

    def look(self, change: Callable[[Any], None] = lambda seen: None, **facts: Any) -> None:
        """Look; `change` may write what was seen, a `struct fm_snapshot *`."""
        seen = self.review.look(self.topics, now=int(self.now * 1e9), **facts)
        change(ffi.cast('struct fm_snapshot *', seen))

    def lines(self, change: Callable[[Any], None] = lambda seen: None,
              **facts: Any) -> list[str]:
        """Look, and return the lines that are logged, each after its level."""
        self.look(change, **facts)
        return [f'{LogLevel(line.level).name} {line.text}' for line in self.review.lines()]

    def statuses(self, change: Callable[[Any], None] = lambda seen: None,
                 **facts: Any) -> dict[str, StatusRecord]:
        """Look, and return the statuses by the names of what they describe."""
        self.lines(change, **facts)
        found = self.review.statuses()
        assert all(item.name.startswith('robot/fret_monitor: ') for item in found)
        return {item.name.partition(': ')[2]: item for item in found}

    def summaries(self, change: Callable[[Any], None] = lambda seen: None,
                  **facts: Any) -> dict[str, tuple[int, str]]:
        """Look, and return level and message of each status."""
        return {name: (item.level, item.message)
                for name, item in self.statuses(change, **facts).items()}

    def send(self, topic: int, values: dict[str, Value], seconds: float) -> None:
        """Deliver a message of a topic."""
        layout = find_message(self.manifest.topics[topic].message_type)
        self.engine.message(topic, serialize(layout, values), int(seconds * 1e9))
