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

"""The log of locks and gates, on an engine whose time is told."""

from functools import partial
from pathlib import Path

from fret_monitor.messages.installed import find_message
from fret_monitor.messages.serialize import serialize
from fret_monitor.model.parts import NodePart
from fret_monitor.ros.acting.actions import _lock_text
from fret_monitor.ros.acting.gate import gate_text
from fret_monitor.ros.reports.condition_log import ConditionLog
from fret_monitor.runtime import Engine, Evaluator, MessageGate
from fret_monitor.start import start
import pytest

SECOND = 10 ** 9
FLOAT = find_message('std_msgs/msg/Float32')
BUNDLE = """
format: 1
evaluation: {policy: relevant_message}
report: occurrence
inputs:
  x: {topic: raw, type: std_msgs/msg/Float32}
  y: {topic: y, type: std_msgs/msg/Float32, timeout: 1}
requirements:
  - {id: X, ptltl: "H (x < y)"}
gates:
  drive: {from: raw, to: out, type: std_msgs/msg/Float32, keep: [X]}
"""


class Logged:
    """The log of a gate and a lock of its requirement."""

    def __init__(self, folder: Path) -> None:
        """Let the time begin at 1 s."""
        path = folder / 'bundle.yaml'
        path.write_text(BUNDLE, encoding='utf-8')
        monitor = start(path, part=NodePart('drive')).monitor
        evaluator = Evaluator(monitor, reports_recoveries=True)
        self.engine = Engine(evaluator)
        assert monitor.manifest.gate is not None
        self.raw = monitor.manifest.gate.topic
        self.engine.guard(MessageGate(evaluator, monitor.manifest.gate))
        self.engine.follow_states()
        self.engine.advance(SECOND)
        self.lines: list[str] = []
        self.log = ConditionLog(self, self.engine, {  # type: ignore[arg-type]
            "lock 'stop'": partial(_lock_text, monitor.manifest, (0,)),
            "gate 'drive'": partial(gate_text, monitor.manifest)})

    def info(self, line: str) -> None:
        self.lines.append(line)

    def taken(self) -> list[str]:
        self.log.review()
        taken, self.lines = self.lines, []
        return taken

    def send(self, value: float, seconds: float) -> None:
        self.engine.judge(serialize(FLOAT, {'data': value}), int(seconds * 1e9))

    def sense(self, value: float, seconds: float) -> None:
        assert self.raw is not None
        self.engine.message(1 - self.raw, serialize(FLOAT, {'data': value}), int(seconds * 1e9))


@pytest.fixture
def logged(tmp_path: Path) -> Logged:
    return Logged(tmp_path)


def test_each_change_of_locks_and_gates_is_logged_with_its_reason_however_short(
        logged: Logged) -> None:
    assert logged.taken() == [
        "lock 'stop' is locked: no value yet of x, y", "gate 'drive' is closed: no value yet of y"]
    assert logged.taken() == []
    logged.sense(5.0, 1.1)
    assert logged.taken() == [
        "gate 'drive' is open", "lock 'stop' is locked: no value yet of x"]
    # All between two looks: it opens, a violation, a silence of 10 ms, and open again.
    logged.send(1.0, 1.2)
    logged.sense(0.5, 1.3)
    logged.sense(5.0, 1.4)
    logged.engine.advance(int(2.41 * SECOND))
    logged.sense(5.0, 2.42)
    assert logged.taken() == [
        "lock 'stop' is free",
        "lock 'stop' is locked: violated: X", "gate 'drive' is closed: violated: X",
        "lock 'stop' is free", "gate 'drive' is open",
        "lock 'stop' is locked: no message for y", "gate 'drive' is closed: no message for y",
        "lock 'stop' is free", "gate 'drive' is open"]
    assert logged.taken() == []


def test_changes_that_come_too_fast_are_counted_and_the_state_is_logged(logged: Logged) -> None:
    logged.sense(5.0, 1.1)
    logged.send(1.0, 1.2)
    assert logged.taken() == ["lock 'stop' is locked: no value yet of x", "gate 'drive' is open",
                              "lock 'stop' is free"]
    for number in range(20):
        logged.sense(0.5 if number % 2 == 0 else 5.0, 1.3 + number / 1000)
    found = logged.taken()
    assert found.count("lock 'stop' is locked: violated: X") == 5
    assert found[-4:] == ["lock 'stop' has changed 10 times more since",
                          "gate 'drive' has changed 10 times more since",
                          "lock 'stop' is free", "gate 'drive' is open"]
    for number in range(101):
        logged.sense(0.5 if number % 2 == 0 else 5.0, 1.4 + number / 1000)
    found = logged.taken()
    assert found[-3:] == ['37 more changes of what locks and gates depend on came too fast to be '
                          'logged', "lock 'stop' is locked: violated: X",
                          "gate 'drive' is closed: violated: X"]
    assert logged.taken() == []


def test_a_gate_that_has_withheld_all_since_the_start_says_so(logged: Logged) -> None:
    logged.sense(0.5, 1.1)
    logged.send(1.0, 1.2)
    assert logged.taken() == [
        "lock 'stop' is locked: no value yet of x", "gate 'drive' is open",
        "gate 'drive' is closed: violated since the first message: X",
        "lock 'stop' is locked: violated: X; no value yet of x"]
