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

"""The states of requirements that locks and actions follow."""

from collections.abc import Iterator
from pathlib import Path
from threading import Thread
from time import monotonic

from fret_monitor import build
from fret_monitor.messages.installed import find_message
from fret_monitor.messages.serialize import serialize
from fret_monitor.model.parts import NodePart
from fret_monitor.runtime import Engine, Evaluator, MessageGate, RequirementState, State
from fret_monitor.start import start
import pytest

BUNDLE = """
format: 1
inputs:
  x: {topic: x, type: std_msgs/msg/Float32, timeout: 2, startup: 3}
  y: {topic: y, type: std_msgs/msg/Float32}
report: REPORT
evaluation: {policy: relevant_message}
requirements:
  - {id: X, ptltl: "H (x < 1.0)"}
  - {id: Y, ptltl: "y < 1.0"}
"""
UNKNOWN, HOLDS, VIOLATED = State.UNKNOWN, State.HOLDS, State.VIOLATED
SECOND = 10 ** 9
FLOAT = find_message('std_msgs/msg/Float32')


class Followed:
    """An engine whose states are followed, and whose time is told."""

    def __init__(self, path: Path, patience: float = 0.0) -> None:
        self.engine = Engine(Evaluator(
            build.build(path).monitor, patience=patience, reports_recoveries=True))
        self.engine.follow_states()
        self.engine.advance(SECOND)
        self._seen = 0
        self._occurrences = [0, 0]

    def message(self, topic: int, value: float, seconds: float) -> tuple[list[State], list[int]]:
        """Deliver a message; return the states after it, and the new occurrences."""
        self.engine.message(topic, serialize(FLOAT, {'data': value}), int(seconds * 1e9))
        return self.states()

    def states(self) -> tuple[list[State], list[int]]:
        _, found = self.engine.states(0, 0.0)
        new = [item.occurrences - before for item, before in zip(found, self._occurrences)]
        self._occurrences = [item.occurrences for item in found]
        return [item.state for item in found], new


@pytest.fixture(params=['every_step', 'onset', 'occurrence'])
def followed(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Followed]:
    path = tmp_path / 'bundle.yaml'
    path.write_text(BUNDLE.replace('REPORT', request.param), encoding='utf-8')
    yield Followed(path)


def test_a_requirement_is_unknown_until_it_is_evaluated_and_while_an_input_is_silent(
        followed: Followed) -> None:
    assert followed.states() == ([UNKNOWN, UNKNOWN], [0, 0])
    assert followed.message(0, 0.0, 1.5) == ([HOLDS, UNKNOWN], [0, 0])
    assert followed.message(1, 0.0, 2.0) == ([HOLDS, HOLDS], [0, 0])
    followed.engine.advance(4 * SECOND)  # x is silent
    assert followed.states() == ([UNKNOWN, HOLDS], [0, 0])
    assert followed.message(0, 0.0, 4.5) == ([HOLDS, HOLDS], [0, 0])
    followed.engine.reset()
    assert followed.states() == ([UNKNOWN, UNKNOWN], [0, 0])


def test_a_requirement_is_unknown_while_a_timeout_is_put_off(tmp_path: Path) -> None:
    path = tmp_path / 'bundle.yaml'
    path.write_text(BUNDLE.replace('REPORT', 'onset'), encoding='utf-8')
    followed = Followed(path, patience=0.001)
    assert followed.message(0, 0.0, 1.5) == ([HOLDS, UNKNOWN], [0, 0])
    followed.engine.advance(20 * SECOND)  # the process stood still
    assert followed.states() == ([UNKNOWN, UNKNOWN], [0, 0])
    assert followed.message(0, 0.0, 20.1) == ([HOLDS, UNKNOWN], [0, 0])


def test_each_violation_is_one_occurrence_until_it_ends(followed: Followed) -> None:
    followed.message(0, 0.0, 1.0)
    assert followed.message(1, 2.0, 1.1) == ([HOLDS, VIOLATED], [0, 1])
    assert followed.message(1, 3.0, 1.2) == ([HOLDS, VIOLATED], [0, 0])
    assert followed.message(1, 0.0, 1.3) == ([HOLDS, HOLDS], [0, 0])
    assert followed.message(1, 2.0, 1.4) == ([HOLDS, VIOLATED], [0, 1])
    followed.engine.reset()
    assert followed.states() == ([UNKNOWN, UNKNOWN], [0, 0])
    assert followed.message(1, 2.0, 1.5) == ([UNKNOWN, VIOLATED], [0, 1])


def test_no_violation_goes_on_when_the_time_goes_back(tmp_path: Path) -> None:
    path = tmp_path / 'bundle.yaml'
    path.write_text(BUNDLE.replace('REPORT', 'occurrence').replace('relevant_message', 'timed')
                    .replace(', timeout: 2, startup: 3', ''), encoding='utf-8')
    followed = Followed(path)
    assert followed.message(0, 9.0, 100.0) == ([VIOLATED, UNKNOWN], [1, 0])
    followed.engine.advance(2 * SECOND)  # a simulation starts again, with the value from before
    assert followed.states() == ([VIOLATED, UNKNOWN], [1, 0])
    assert followed.message(0, 0.0, 3.0) == ([HOLDS, UNKNOWN], [0, 0])


def test_a_wait_ends_at_once_when_a_state_changes_or_the_engine_is_closed(
        followed: Followed) -> None:
    for act in (lambda: followed.message(0, 5.0, 1.5), followed.engine.close):
        seen, _ = followed.engine.states(0, 0.0)
        begin = monotonic()
        found: list[tuple[int, list[RequirementState]]] = []
        thread = Thread(target=lambda seen=seen, found=found: found.append(
            followed.engine.states(seen, 20.0)))
        thread.start()
        act()
        thread.join()
        assert monotonic() - begin < 10
        assert found[0][1][0].state is VIOLATED


GATED = """
format: 1
inputs:
  x: {topic: raw, type: std_msgs/msg/Float32}
evaluation: {policy: relevant_message}
requirements:
  - {id: X, ptltl: "H (x < 1.0)"}
gates:
  drive: {from: raw, to: out, type: std_msgs/msg/Float32, keep: [X]}
"""


def test_a_message_that_a_gate_withholds_is_a_violation_until_one_passes(tmp_path: Path) -> None:
    path = tmp_path / 'bundle.yaml'
    path.write_text(GATED, encoding='utf-8')
    monitor = start(path, part=NodePart('drive')).monitor
    evaluator = Evaluator(monitor, reports_recoveries=True)
    engine = Engine(evaluator)
    assert monitor.manifest.gate is not None
    engine.guard(MessageGate(evaluator, monitor.manifest.gate))
    engine.follow_states()
    engine.advance(SECOND)
    found = []
    for number, value in enumerate((2.0, 0.0, 2.0, 3.0, 0.5)):
        engine.judge(serialize(FLOAT, {'data': value}), 2 * SECOND + number)
        _, (item,) = engine.states(0, 0.0)
        found.append((item.state, item.occurrences))
    assert found == [(VIOLATED, 1), (HOLDS, 1), (VIOLATED, 2), (VIOLATED, 2), (HOLDS, 2)]
