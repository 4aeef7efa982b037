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

from bundles import write_bundle
from fret_monitor import build
from fret_monitor.messages.installed import find_message
from fret_monitor.messages.serialize import serialize
from fret_monitor.model.parts import NodePart
from fret_monitor.runtime import Engine, Evaluator, Judgement, MessageGate, RequirementState, State
from fret_monitor.start import start
import pytest
from runtime.seen import see

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
    path = write_bundle(tmp_path, BUNDLE.replace('REPORT', request.param))
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
    path = write_bundle(tmp_path, BUNDLE.replace('REPORT', 'onset'))
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


def test_each_change_of_the_conditions_is_kept_once_until_there_are_too_many(
        followed: Followed) -> None:
    followed.message(0, 0.0, 1.0)
    followed.message(1, 0.0, 1.0)
    see(followed.engine)
    for number in range(3):
        followed.message(1, 2.0, 1.1)
        followed.message(1, 3.0, 1.1)  # still violated: no change
        followed.message(1, 0.0, 1.1)
        found = [({*item.violated}, item.states[1]) for item in see(followed.engine).changes]
        assert found == [({1}, VIOLATED), (set(), HOLDS)], number
    for number in range(100):
        followed.message(1, 2.0 * (number % 2 == 0), 1.2)
    followed.message(0, 2.0, 1.2)
    seen = see(followed.engine)
    assert [({*item.violated}, item.states[1]) for item in seen.changes] == 32 * [
        ({1}, VIOLATED), (set(), HOLDS)]
    assert seen.missed == 101 - 64
    followed.message(1, 2.0, 1.3)
    seen = see(followed.engine)
    assert (len(seen.changes), seen.missed) == (1, 0)
    assert seen.conditions.violated == {0, 1}


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


class Gated:
    """An engine with the gate of a bundle, whose time is told."""

    def __init__(self, folder: Path, text: str) -> None:
        path = write_bundle(folder, text)
        monitor = start(path, part=NodePart('drive')).monitor
        evaluator = Evaluator(monitor, reports_recoveries=True)
        self.engine = Engine(evaluator)
        gate = monitor.manifest.gate
        assert gate is not None and gate.topic is not None
        self.other = 1 - gate.topic
        self.engine.guard(MessageGate(evaluator, gate))
        self.engine.follow_states()
        self.engine.advance(SECOND)
        self._now = SECOND

    def _next(self) -> int:
        self._now += SECOND
        return self._now

    def send(self, value: float) -> Judgement:
        return self.engine.judge(serialize(FLOAT, {'data': value}), self._next())

    def replace(self, value: float) -> bool:
        return self.engine.replace(serialize(FLOAT, {'data': value})) is not None

    def sense(self, value: float) -> None:
        self.engine.message(self.other, serialize(FLOAT, {'data': value}), self._next())

    def state(self, requirement: int = 0) -> tuple[State, int]:
        """Return the state of a requirement, and how often a violation of it has begun."""
        _, found = self.engine.states(0, 0.0)
        is_violated = see(self.engine).are_violated[requirement]
        assert is_violated == (found[requirement].state is VIOLATED)
        return found[requirement].state, found[requirement].occurrences


def test_a_message_that_a_gate_withholds_is_a_violation_until_one_passes(tmp_path: Path) -> None:
    gated = Gated(tmp_path, GATED)
    found = []
    for value in (2.0, 0.0, 2.0, 3.0, 0.5):
        gated.send(value)
        found.append(gated.state())
    assert found == [(VIOLATED, 1), (HOLDS, 1), (VIOLATED, 2), (VIOLATED, 2), (HOLDS, 2)]


def test_a_requirement_is_unknown_while_all_that_was_judged_is_withheld(tmp_path: Path) -> None:
    both = GATED.replace('gates:', '  - {id: Z, ptltl: "x < 3.0"}\ngates:')
    gated = Gated(tmp_path, both.replace('[X]', '[X, Z]'))
    assert gated.send(2.0) is Judgement.VIOLATES
    assert (gated.state(0), gated.state(1)) == ((VIOLATED, 1), (UNKNOWN, 0))
    assert gated.send(0.0) is Judgement.PASSED
    assert (gated.state(0), gated.state(1)) == ((HOLDS, 1), (HOLDS, 0))


def test_a_change_of_the_gate_is_a_change_of_the_conditions(tmp_path: Path) -> None:
    gated = Gated(tmp_path, NEAR.replace('REPORT', 'onset').replace(
        ', otherwise: {substitute: {data: 0.1}, rate: 10}', ', latch: true'))

    def changes() -> list[tuple[bool, bool, set[int]]]:
        return [(item.is_known, item.is_latched, {*item.unknown})
                for item in see(gated.engine).changes]

    changes()
    assert gated.send(1.0) is Judgement.CLOSED
    assert not see(gated.engine).conditions.is_known
    changes()
    gated.sense(9.0)
    assert gated.send(1.0) is Judgement.PASSED
    found = changes()
    assert found[-1] == (True, False, set())
    assert gated.send(10.0) is Judgement.VIOLATES
    assert [item[:2] for item in changes()] == [(True, True)]
    gated.engine.reset()
    assert changes()[-1][1] is False


NEAR = GATED.replace('H (x < 1.0)', 'H (x < y)').replace(
    'requirements:', """report: REPORT
requirements:""").replace(
    'evaluation:', '  y: {topic: y, type: std_msgs/msg/Float32}\nevaluation:').replace(
    'keep: [X]', 'keep: [X], otherwise: {substitute: {data: 0.1}, rate: 10}')


@pytest.mark.parametrize('policy', ['relevant_message', 'timed'])
def test_a_violation_is_one_from_its_step_through_substitutes_until_a_message_passes(
        tmp_path: Path, policy: str) -> None:
    gated = Gated(tmp_path, NEAR.replace('REPORT', 'occurrence').replace(
        'relevant_message', policy))
    gated.sense(9.0)
    assert gated.send(1.0) is Judgement.PASSED
    assert gated.state() == (HOLDS, 0)
    gated.sense(0.2)  # an obstacle
    for _ in range(3):
        assert gated.state() == (VIOLATED, 1)
        assert gated.replace(0.1)  # after which the requirement holds
        assert gated.state() == (VIOLATED, 1)
        assert gated.send(1.0) is Judgement.VIOLATES
        assert gated.state() == (VIOLATED, 1)
    gated.sense(0.05)  # so near that the substitute violates, too
    gated.sense(9.0)  # the obstacle is away
    assert gated.state() == (VIOLATED, 1)
    assert gated.send(1.0) is Judgement.PASSED
    assert gated.state() == (HOLDS, 1)
    gated.sense(0.2)
    assert gated.state() == (VIOLATED, 2)
    gated.sense(9.0)  # nothing was replaced or withheld meanwhile
    assert gated.state() == (HOLDS, 2)
    recoveries = [item for item in gated.engine.take(0) if item.is_recovery]
    assert recoveries == []  # the handler has violations only
