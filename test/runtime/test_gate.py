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

"""A gate: which messages pass, what replaces the others, and that those never happened."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from random import Random
import struct
from time import sleep, time_ns
from typing import Any

from bundles import write_bundle
from fret_monitor.build import build_specification
from fret_monitor.logic.evaluate import evaluate_all
from fret_monitor.logic.formula import Variable
from fret_monitor.logic.specification import Signal, Specification
from fret_monitor.model.manifest import Manifest, ManifestGate
from fret_monitor.model.parts import NodePart
from fret_monitor.model.policies import Otherwise, Policy, Stale
from fret_monitor.model.values import ValueType
from fret_monitor.native import evaluator_library, LibraryError, load
from fret_monitor.native.binding import ffi
from fret_monitor.runtime import (
    Engine, Evaluator, GateCounts, Judgement, MessageGate, NEVER, Violation,
)
from fret_monitor.start import start
from native import toys
import pytest
from runtime.message_ring import MessageRing
from runtime.seen import see, silence_of
from runtime.test_evaluator import toy_library
from strategies import INPUTS, random_property, random_trace, specification_of

LAMP, COOL = 0, 1  # requirements: of the other topic; of `from`
PASSED, VIOLATES, CLOSED = Judgement.PASSED, Judgement.VIOLATES, Judgement.CLOSED
LATCHED, UNREADABLE = Judgement.LATCHED, Judgement.UNREADABLE
SECOND = 10**9


def replacement_due(engine: Engine) -> int:
    """Return when a replacement is due by the steady clock; `NEVER` if none is."""
    return int(engine.library.fm_engine_replacement_due(engine.pointer))


def rules(otherwise: Otherwise = Otherwise.DROP, topic: int | None = 1,
          **more: Any) -> ManifestGate:
    return ManifestGate('gate', '/level_raw', '/level', 'std_msgs/msg/Int16', False, topic,
                        otherwise, **more)


def withheld(counts: GateCounts) -> int:
    """Return how many messages did not pass, for any reason."""
    return counts.violates + counts.closed + counts.latched + counts.unreadable


class Relay:
    """A gate of the toy, whose topic is that of `level`; `flag` is the other one."""

    def __init__(self, otherwise: Otherwise = Otherwise.DROP, *, manifest: Manifest | None = None,
                 flag: bool | None = True, patience: float = 0.0, **more: Any) -> None:
        """Begin at 0, with a flag unless that is None."""
        monitor = load(toy_library(), manifest or toys.manifest())
        self.evaluator = Evaluator(monitor, library=evaluator_library(), patience=patience,
                                   reports_recoveries=True)
        self.gate = MessageGate(self.evaluator, rules(otherwise, **more))
        self.found: list[Violation] = []
        self.advance(0)
        if flag is not None:
            self.flag(flag, 0)

    def flag(self, value: bool, now: int) -> bool:
        """Give a message of the other topic; return whether a replacement is due earlier."""
        self.evaluator.store(0, value, now)
        return self.note(self.evaluator.message(0, now), now)

    def advance(self, now: int) -> bool:
        return self.note(self.evaluator.advance(now), now)

    def note(self, found: list[Violation], now: int) -> bool:
        is_due, left = self.gate.note(found, now)
        self.found += left
        return is_due

    def level(self, value: int | None, now: int) -> Judgement:
        judgement, found = self.gate.judge([value], now)
        self.found += found
        return judgement

    def replace(self, value: int, now: int) -> bool:
        is_sent, found = self.gate.replace([value], now)
        self.found += found
        return is_sent

    def ended(self) -> list[tuple[int, bool]]:
        """Take what was announced: requirements, and whether it is the end of a violation."""
        found, self.found = self.found, []
        return [(item.requirement, item.is_recovery) for item in found]


def silent_flag(stale: Stale) -> Manifest:
    """Let `flag` be silent a second after its last message."""
    made = toys.manifest()
    flag = replace(made.inputs[0], timeout=1.0, stale=stale)
    return replace(made, inputs=(flag, *made.inputs[1:]))


def test_a_message_passes_if_every_requirement_holds_after_it() -> None:
    relay = Relay()
    assert relay.level(3, 1) is PASSED
    before = relay.evaluator.save()
    assert relay.level(10, 2) is VIOLATES
    assert relay.evaluator.save() == before
    assert relay.evaluator.value(1) == 3
    assert relay.level(9, 3) is PASSED
    counts = relay.gate.counts(3)
    assert (counts.passed, counts.violates, withheld(counts)) == (2, 1, 1)
    assert counts.is_known and counts.holds and not counts.is_latched
    assert relay.gate.due == NEVER


def test_each_withheld_message_is_announced_and_the_next_that_passes_ends_it() -> None:
    relay = Relay()
    assert [relay.level(value, now) for now, value in enumerate([3, 10, 11, 4, 5], 1)] == [
        PASSED, VIOLATES, VIOLATES, PASSED, PASSED]
    assert [item.step for item in relay.found] == [1, 1, 1]  # the step of the message that passed
    assert relay.ended() == [(COOL, False), (COOL, False), (COOL, True)]
    assert relay.evaluator.requirement_counts(COOL).announced == 2


def test_a_message_that_is_withheld_ends_no_violation() -> None:
    relay = Relay(Otherwise.SUBSTITUTE)
    relay.level(3, 1)
    assert relay.replace(20, 2)  # a substitute that violates stays
    relay.flag(False, 3)
    assert relay.level(3, 4) is VIOLATES  # LAMP
    assert relay.ended() == [(COOL, False), (LAMP, False), (LAMP, False)]
    relay.flag(True, 5)
    assert relay.level(3, 6) is PASSED
    assert relay.ended() == [(LAMP, True), (COOL, True)]
    assert relay.gate.counts(6).violating == 1


def test_a_replacement_ends_no_violation() -> None:
    relay = Relay(Otherwise.SUBSTITUTE, period=10)
    assert relay.level(3, 1) is PASSED
    assert relay.replace(20, 2)  # a substitute that violates
    assert relay.replace(0, 3)  # and one that does not
    relay.flag(False, 4)
    relay.flag(True, 5)  # LAMP reads nothing that a replacement changes
    assert relay.ended() == [(COOL, False), (LAMP, False), (LAMP, True)]
    assert relay.level(30, 6) is VIOLATES
    assert relay.replace(0, 7)
    assert relay.level(3, 8) is PASSED
    assert relay.level(4, 9) is PASSED
    assert relay.ended() == [(COOL, False), (COOL, True)]


def test_it_is_closed_until_each_other_input_has_a_value() -> None:
    relay = Relay(flag=None)
    assert relay.level(3, 1) is CLOSED
    assert relay.evaluator.value(1) is None
    assert not relay.gate.counts(1).is_known
    relay.flag(True, 2)
    assert relay.level(3, 3) is PASSED


@pytest.mark.parametrize('is_open', [False, True])
def test_a_silent_input_closes_it_unless_the_rules_say_otherwise(is_open: bool) -> None:
    relay = Relay(manifest=silent_flag(Stale.WARN), is_open_when_stale=is_open)
    assert relay.level(3, 1) is PASSED
    relay.advance(2 * SECOND)
    assert relay.level(3, 2 * SECOND) is (PASSED if is_open else CLOSED)
    relay.flag(True, 3 * SECOND)
    assert relay.level(3, 3 * SECOND) is PASSED


def test_a_timeout_that_was_put_off_closes_it() -> None:
    relay = Relay(manifest=silent_flag(Stale.WARN), patience=0.001)
    assert relay.level(3, 1) is PASSED
    for now in (10 * SECOND, 10 * SECOND + 1, 12 * SECOND):  # the process stood still for 10 s
        relay.advance(now)
        assert relay.level(3, now) is CLOSED
        assert not relay.gate.counts(now).is_known
    relay.flag(True, 12 * SECOND)
    assert relay.level(3, 12 * SECOND) is PASSED


def test_an_input_with_only_an_initial_value_was_not_judged_yet() -> None:
    # Under relevant_message a message of `from` does not step what reads only the flag.
    manifest = replace(toys.with_initial(True, None), policy=Policy.RELEVANT_MESSAGE)
    relay = Relay(manifest=manifest, flag=None)
    assert relay.level(3, 1) is CLOSED
    relay.flag(True, 2)
    assert relay.level(3, 3) is PASSED


def test_what_cannot_be_read_is_withheld_without_a_step() -> None:
    relay = Relay()
    relay.level(3, 1)
    steps = relay.evaluator.steps(1)
    assert relay.level(None, 2) is UNREADABLE
    assert relay.gate.judge(None, 3)[0] is UNREADABLE
    assert relay.evaluator.steps(1) == steps
    assert relay.evaluator.input_counts(1).unusable == 1
    assert relay.evaluator.topic_counts(1).undecodable == 1
    assert relay.gate.counts(3).unreadable == 2


def test_substitutes_come_at_once_and_at_their_period_until_a_message_passes() -> None:
    relay = Relay(Otherwise.SUBSTITUTE, period=10)
    assert relay.gate.due == -2**63  # closed from the start
    relay.replace(0, 1)
    assert relay.gate.due == 11
    assert relay.level(3, 5) is PASSED
    assert relay.gate.due == NEVER
    assert relay.level(30, 20) is VIOLATES
    assert relay.level(30, 23) is VIOLATES
    assert relay.gate.due == 20
    assert relay.replace(0, 24)
    assert relay.gate.due == 30
    assert relay.replace(0, 55)  # late: what was missed is not made up for
    assert relay.gate.due == 65
    assert relay.evaluator.value(1) == 0
    assert relay.level(4, 60) is PASSED
    assert relay.gate.due == NEVER
    assert relay.gate.counts(60).replaced == 3


def test_without_a_period_there_is_a_substitute_for_each_withheld_message() -> None:
    relay = Relay(Otherwise.SUBSTITUTE)
    assert relay.gate.due == NEVER
    for now in (10, 20):
        assert relay.level(30, now) is VIOLATES
        assert relay.gate.due == now
        assert relay.replace(0, now)
        assert relay.gate.due == NEVER


@pytest.mark.parametrize('period', [0, 7])
def test_a_step_of_another_topic_that_violates_makes_a_substitute_due(period: int) -> None:
    relay = Relay(Otherwise.SUBSTITUTE, period=period)
    relay.level(3, 1)
    assert relay.flag(False, 5)
    assert relay.gate.due == 5
    assert relay.replace(0, 5)
    assert not relay.flag(False, 6)  # no news
    assert relay.gate.due == (12 if period else NEVER)


def test_a_violation_after_a_message_that_passed_is_news_though_a_substitute_violated() -> None:
    relay = Relay(Otherwise.SUBSTITUTE)
    assert relay.replace(20, 1)
    assert relay.level(3, 2) is PASSED
    assert relay.flag(False, 3)


@pytest.mark.parametrize('period', [0, 7])
@pytest.mark.parametrize('stale', [Stale.WARN, Stale.VIOLATE])
def test_a_silence_makes_a_substitute_due(stale: Stale, period: int) -> None:
    relay = Relay(Otherwise.SUBSTITUTE, period=period, manifest=silent_flag(stale))
    relay.level(3, 1)
    assert relay.gate.due == NEVER
    assert relay.advance(SECOND)
    assert relay.gate.due == SECOND
    assert relay.replace(0, SECOND)
    assert relay.advance(SECOND + 1) is False
    assert relay.gate.due == (SECOND + 7 if period else NEVER)


def silent_level() -> Manifest:
    """Let `level`, of the gate's topic, be silent a second after its last message."""
    made = replace(toys.manifest(), policy=Policy.RELEVANT_MESSAGE)
    level = replace(made.inputs[1], timeout=1.0, stale=Stale.VIOLATE)
    return replace(made, inputs=(made.inputs[0], level, *made.inputs[2:]))


@pytest.mark.parametrize('open_after', [0, 5 * SECOND])
def test_a_message_that_is_withheld_ends_the_silence_of_its_topic(open_after: int) -> None:
    relay = Relay(manifest=silent_level(), latches=True, open_after=open_after)
    relay.level(3, 1)
    assert relay.level(30, 2) is VIOLATES
    half = SECOND // 2
    for number in range(1, 8):  # no silence begins, nothing of these messages stays
        relay.flag(True, number * half)
        assert relay.level(4, number * half) is LATCHED
        assert not silence_of(relay.evaluator, 1).is_silent
        assert relay.evaluator.value(1) == 3 and relay.evaluator.verdicts[COOL]
    assert silence_of(relay.evaluator, 1).count == 0
    relay.advance(10 * SECOND)  # nothing arrives any more
    assert silence_of(relay.evaluator, 1).is_silent and not relay.evaluator.verdicts[COOL]
    for number in range(20, 30):  # steps of other groups do not violate again
        relay.flag(True, number * half)
        assert relay.level(4, number * half) is LATCHED
        assert not silence_of(relay.evaluator, 1).is_silent
    if open_after:
        assert relay.level(4, 15 * SECOND) is PASSED
    else:
        relay.evaluator.reset()
        relay.gate.reset()
        relay.advance(15 * SECOND)
        relay.flag(True, 15 * SECOND)
        assert relay.level(4, 15 * SECOND) is PASSED


def test_a_substitute_is_not_received_and_ends_no_silence() -> None:
    relay = Relay(Otherwise.SUBSTITUTE, period=SECOND // 10, manifest=silent_level())
    assert relay.replace(0, 1)
    assert relay.evaluator.input_counts(1).received == 0
    assert relay.level(3, 2) is PASSED
    relay.advance(2 * SECOND)  # the planner is dead
    assert relay.gate.due == 2 * SECOND
    for number in range(20, 50):
        assert relay.replace(0, number * SECOND // 10)
        assert silence_of(relay.evaluator, 1).is_silent
    assert silence_of(relay.evaluator, 1).count == 1
    assert relay.evaluator.input_counts(1).received == 1
    assert relay.evaluator.topic_counts(1).messages == 1
    counts = relay.gate.counts(5 * SECOND)
    assert (counts.replaced, counts.violating, counts.holds) == (31, 0, False)
    assert relay.ended() == [(COOL, False)]
    assert relay.level(3, 5 * SECOND) is PASSED
    assert relay.ended() == [(COOL, True)]


def test_the_last_message_that_passed_is_held_for_its_time() -> None:
    relay = Relay(Otherwise.HOLD, hold=10)
    assert relay.level(30, 1) is VIOLATES
    assert relay.gate.due == NEVER  # none has passed yet
    assert relay.level(3, 2) is PASSED
    for now in (11, 12):
        assert relay.level(30, now) is VIOLATES
        assert relay.gate.due == now
        assert relay.replace(3, now)
    assert relay.level(30, 13) is VIOLATES
    assert relay.gate.due == NEVER
    assert relay.gate.counts(13).replaced == 2


def test_a_held_message_that_would_violate_is_not_sent_and_not_counted() -> None:
    relay = Relay(Otherwise.HOLD, hold=10)
    relay.level(3, 1)
    relay.flag(False, 2)
    assert relay.level(3, 3) is VIOLATES
    before = relay.evaluator.save()
    counts = [relay.evaluator.requirement_counts(index) for index in (LAMP, COOL)]
    relay.ended()
    assert not relay.replace(3, 3)
    assert relay.evaluator.save() == before
    assert counts == [relay.evaluator.requirement_counts(index) for index in (LAMP, COOL)]
    assert relay.ended() == []
    assert relay.gate.due == NEVER


def test_a_latch_opens_with_a_reset() -> None:
    relay = Relay(latches=True)
    relay.level(3, 1)
    relay.level(30, 2)
    assert relay.level(3, 3) is LATCHED
    assert relay.gate.counts(3).is_latched
    relay.gate.reset()
    relay.found.clear()
    assert relay.level(3, 4) is PASSED
    assert relay.ended() == []  # the reset has ended the violation
    counts = relay.gate.counts(4)
    assert (counts.passed, counts.violates, counts.latched, withheld(counts)) == (2, 1, 1, 2)


def test_a_latch_opens_after_its_time_without_a_violation() -> None:
    relay = Relay(latches=True, open_after=10)
    relay.level(30, 2)
    assert relay.level(30, 8) is VIOLATES
    assert relay.level(3, 17) is LATCHED
    relay.flag(False, 18)  # a violation by another topic
    relay.flag(True, 19)
    assert relay.level(3, 27) is LATCHED
    assert relay.level(3, 28) is PASSED
    assert not relay.gate.counts(28).is_latched


def test_a_look_at_the_clock_does_not_latch() -> None:
    relay = Relay(Otherwise.SUBSTITUTE, latches=True)
    relay.level(3, 1)
    relay.replace(20, 2)  # a substitute that violates
    relay.advance(3)
    assert not relay.gate.counts(3).is_latched
    relay.flag(False, 4)
    assert relay.gate.counts(4).is_latched


def test_a_message_that_violates_while_the_gate_is_closed_renews_the_latch() -> None:
    relay = Relay(latches=True, open_after=2 * SECOND, manifest=silent_flag(Stale.WARN))
    relay.level(30, 1)
    relay.advance(SECOND)  # the flag is silent
    assert relay.level(30, SECOND) is CLOSED
    relay.flag(True, 2 * SECOND + 5)
    assert relay.level(3, 2 * SECOND + 6) is LATCHED
    relay.flag(True, 3 * SECOND)
    assert relay.level(3, 3 * SECOND) is PASSED


def test_a_message_that_violates_latches_also_while_the_gate_is_closed() -> None:
    relay = Relay(latches=True, manifest=silent_flag(Stale.WARN))
    relay.advance(SECOND)  # the flag is silent
    assert relay.level(3, SECOND) is CLOSED
    assert not relay.gate.counts(SECOND).is_latched
    assert relay.level(30, SECOND + 1) is CLOSED
    assert relay.ended() == [(COOL, False)]
    relay.flag(True, SECOND + 2)
    assert relay.level(3, SECOND + 3) is LATCHED


JAMMED = """
format: 1
inputs:
  x: {topic: raw, type: std_msgs/msg/Float32}
  y: {topic: y, type: std_msgs/msg/Float32}
report: REPORT
evaluation: {policy: relevant_message}
requirements:
  - {id: X, ptltl: "H (x < y)"}
gates:
  drive: {from: raw, to: out, type: std_msgs/msg/Float32, keep: [X]}
"""


@pytest.mark.parametrize('report', ['every_step', 'onset'])
def test_a_sensor_that_violated_always_once_does_not_close_it_for_ever(
        report: str, tmp_path: Path) -> None:
    path = write_bundle(tmp_path, JAMMED.replace('REPORT', report))
    monitor = start(path, part=NodePart('drive')).monitor
    evaluator = Evaluator(monitor, reports_recoveries=True)
    assert monitor.manifest.gate is not None
    gate = MessageGate(evaluator, monitor.manifest.gate)
    other, found = 1 - (gate.rules.topic or 0), []
    y = monitor.manifest.topics[other].inputs[0]
    for now, value in enumerate((9.0, 0.0, 9.0)):
        evaluator.store(y, value, now)
        gate.note(evaluator.message(other, now), now)
        found.append(gate.judge([1.0], now)[0])
    assert found == [PASSED, VIOLATES, PASSED]


def test_a_gate_of_a_topic_that_feeds_no_input_is_an_interlock() -> None:
    manifest = replace(toys.with_initial(True, 3), topics=toys.manifest().topics[:1])
    relay = Relay(manifest=manifest, topic=None)
    assert relay.gate.judge([], 1)[0] is PASSED
    relay.flag(False, 2)
    assert relay.gate.judge([], 3)[0] is VIOLATES
    relay.flag(True, 4)
    assert relay.gate.judge([], 5)[0] is PASSED


def test_rules_that_do_not_fit_are_refused() -> None:
    for policy in (Policy.ALL_INPUTS, Policy.PERIODIC):
        evaluator = Evaluator(load(toy_library(), toys.manifest()), policy=policy, period=1.0)
        with pytest.raises(LibraryError, match='refuses the rules'):
            MessageGate(evaluator, rules())
    with pytest.raises(LibraryError):
        MessageGate(Evaluator(load(toy_library(), toys.manifest())), rules(topic=3))


# ---- random formulas -----------------------------------------------------------------------


@dataclass
class Outcome:
    """The rows that happened, which of them passed the gate, and how many messages did not."""

    rows: list[dict[str, Any]]
    has_passed: list[bool]
    withheld: int


def on_two_topics(signal: Signal) -> Signal:
    """Let p and q be fields of the gate's topic, and the others of another one."""
    return replace(signal, topic='from' if signal.name in 'pq' else 'other', path=('data',))


def random_specification(rng: Random) -> Specification:
    inputs = [item for item in INPUTS if item.type is ValueType.BOOL]
    properties = [random_property(rng, f'R-{number}', inputs, size=14, reach=9)
                  for number in range(rng.choice((1, 1, 2)))]
    made = specification_of(properties, inputs)
    return replace(made, signals=tuple(map(on_two_topics, made.signals)))


def run(evaluator: Evaluator, gate: MessageGate | None, topics: Sequence[int],
        trace: dict[str, list[Any]]) -> Outcome:
    """Give a row to each topic in turn; without a gate, all of them happen."""
    manifest = evaluator.monitor.manifest
    done = Outcome([], [], 0)
    row: dict[str, Any] = {}
    for step, topic in enumerate(topics):
        names = [manifest.inputs[index].name for index in manifest.topics[topic].inputs]
        values = [trace[name][step] for name in names]
        if gate is not None and topic == gate.rules.topic:
            judgement, _ = gate.judge(values, step)
            if judgement is not PASSED:
                done.withheld += 1
                continue
            done.has_passed.append(True)
        else:
            for index, value in zip(manifest.topics[topic].inputs, values):
                evaluator.store(index, value, step)
            found = evaluator.message(topic, step)
            if gate is not None:
                gate.note(found, step)
            done.has_passed.append(False)
        row = row | dict(zip(names, values))
        done.rows.append(row)
    return done


def test_what_passes_satisfies_the_requirements_and_what_does_not_never_happened() -> None:
    rng = Random(3)
    n_passed = n_withheld = n_kept_whole = 0
    for _ in range(12):
        spec = random_specification(rng)
        monitor = build_specification(spec).monitor
        manifest = monitor.manifest
        sources = [topic.name for topic in manifest.topics]
        gated = sources.index('from')
        for _ in range(6):
            topics = [rng.randrange(2) for _ in range(60)]
            trace = random_trace(rng, [Variable(item.name, item.type) for item in spec.signals],
                                 len(topics))
            evaluator, alone = Evaluator(monitor), Evaluator(monitor)
            done = run(evaluator, MessageGate(evaluator, rules(topic=gated)), topics, trace)
            whole = run(alone, None, topics, trace)
            assert_good(spec, done)
            n_passed += sum(done.has_passed)
            n_withheld += done.withheld
            if is_good_throughout(spec, whole):
                # Where the input satisfies them already, all of it passes once values are known.
                first = next((place for place, row in enumerate(whole.rows)
                              if len(row) == len(spec.signals)), len(whole.rows))
                assert done.withheld <= first
                n_kept_whole += 1
            assert_never_happened(evaluator, done, gated)
    assert n_passed > 300 and n_withheld > 300 and n_kept_whole > 5


def ready_from(spec: Specification, index: int, rows: Sequence[dict[str, Any]]) -> int:
    """Return the first row with a value of each input of a requirement."""
    read = spec.properties[index].inputs
    return next((place for place, row in enumerate(rows)
                 if all(name in row for name in read)), len(rows))


def verdicts_of(spec: Specification, index: int, rows: Sequence[dict[str, Any]]) -> list[bool]:
    """Return the verdicts of the reference evaluator, true before the first one."""
    item = spec.properties[index]
    start = ready_from(spec, index, rows)
    ready = rows[start:]
    columns = {name: [row[name] for row in ready] for name in item.inputs} or {
        'none': [False] * len(ready)}
    return [True] * start + [value is True for value in
                             evaluate_all([item.formula], columns, item.feedback)[0]]


def assert_good(spec: Specification, done: Outcome) -> None:
    for index in range(len(spec.properties)):
        verdicts = verdicts_of(spec, index, done.rows)
        assert all(verdict for verdict, passed in zip(verdicts, done.has_passed, strict=True)
                   if passed)


def is_good_throughout(spec: Specification, done: Outcome) -> bool:
    return all(all(verdicts_of(spec, index, done.rows)) for index in range(len(spec.properties)))


def assert_never_happened(evaluator: Evaluator, done: Outcome, gated: int) -> None:
    """Compare with an evaluator that got only what passed."""
    manifest = evaluator.monitor.manifest
    other = Evaluator(evaluator.monitor)
    for row, passed in zip(done.rows, done.has_passed):
        topic = gated if passed else 1 - gated
        for index in manifest.topics[topic].inputs:
            other.store(index, row[manifest.inputs[index].name], 0)
        other.message(topic, 0)
    assert evaluator.verdicts == other.verdicts
    for index in range(len(manifest.inputs)):
        assert repr(evaluator.value(index)) == repr(other.value(index))
    for group in range(len(manifest.groups)):
        assert evaluator.steps(group) == other.steps(group)


# ---- an engine, and the policy timed -------------------------------------------------------

TIMED = """\
format: 1
evaluation: {policy: timed}
inputs:
  speed: {topic: raw, type: std_msgs/msg/Float32}
  beat: {topic: beat, type: std_msgs/msg/Bool}
requirements:
  - {id: R, ptltl: "H (speed > 0.0 -> O[0, 1 s] beat)"}
gates:
  g: {from: raw, to: out, type: std_msgs/msg/Float32, keep: [R],
      otherwise: {substitute: {data: 0.0}, rate: 10}}
"""


def cdr(kind: str, value: float | bool) -> bytes:
    return b'\x00\x01\x00\x00' + struct.pack(kind, value)


class Guarded:
    """An engine with the gate of a bundle, whose inputs are x, of `raw`, and y."""

    def __init__(self, folder: Path, text: str) -> None:
        """Follow the steady clock."""
        path = write_bundle(folder, text)
        monitor = start(path, part=NodePart('drive')).monitor
        settings = monitor.manifest.gate
        assert settings is not None and settings.topic is not None
        self.raw, self.y = settings.topic, 1 - settings.topic
        self.evaluator = Evaluator(monitor, reports_recoveries=True)
        self.engine = Engine(self.evaluator)
        self.engine.guard(MessageGate(self.evaluator, settings))
        self.engine.follow_steady()
        self.engine.begin()

    def send(self, value: float) -> Judgement:
        return self.engine.judge(cdr('<f', value), time_ns())

    def sense(self, value: float) -> None:
        self.engine.message(self.y, cdr('<f', value), time_ns())


def test_a_gate_is_closed_while_the_thread_hangs_that_moves_the_clock(tmp_path: Path) -> None:
    otherwise = ', otherwise: {substitute: {}, rate: 10}}'
    gated = Guarded(tmp_path, JAMMED.replace('REPORT', 'onset').rstrip('\n}') + otherwise)

    @ffi.callback('int(void *, int64_t *)')
    def read(_: object, now: Any) -> int:
        now[0] = 100 * SECOND
        return 0

    gated.engine.follow_clock(read, ffi.NULL)
    gated.sense(9.0)
    assert gated.send(1.0) is PASSED
    gated.engine.take(0)
    assert replacement_due(gated.engine) == NEVER
    sleep(0.6)
    gated.engine.take(0)
    assert replacement_due(gated.engine) != NEVER
    assert gated.send(1.0) is CLOSED
    assert not see(gated.engine).gate.is_known
    gated.engine.serve_clock()
    assert gated.send(1.0) is PASSED


def test_a_message_withheld_at_a_reading_of_the_clock_moves_no_time_back(tmp_path: Path) -> None:
    text = JAMMED.replace('REPORT', 'onset').replace('relevant_message', 'timed')
    gated = Guarded(tmp_path, text.replace('H (x < y)', 'H ((O[0,5 s] y < 1.0) -> x <= 0.0)'))
    clock = [100 * SECOND]

    @ffi.callback('int(void *, int64_t *)')
    def read(_: object, now: Any) -> int:
        now[0] = clock[0]
        return 0

    gated.engine.follow_clock(read, ffi.NULL)

    gated.sense(9.0)
    assert gated.send(0.0) is PASSED
    gated.sense(0.5)
    clock[0] += SECOND
    gated.sense(9.0)
    gated.sense(9.0)
    assert gated.send(1.0) is VIOLATES  # a nanosecond after what was taken at this reading
    for value in (0.0, 1.0, 0.0, 1.0):
        gated.engine.serve_clock()
        gated.sense(9.0)
        assert gated.send(value) is (VIOLATES if value else PASSED)
    assert gated.engine.evaluator.time_counts().restarts == 0


def test_a_substitute_has_no_stamp_before_the_clock_has_a_time(tmp_path: Path) -> None:
    gated = Guarded(tmp_path, JAMMED.replace('REPORT', 'onset').rstrip('\n}')
                    + ', otherwise: {substitute: {}, rate: 10}}')
    for n_more in (8, 4):  # also of a message that has nothing but a stamp
        message = cdr('<f', 7.0) + bytes(n_more)
        stamped = gated.engine.replace(message, stamp_at=4)
        assert stamped is not None and struct.unpack_from('<I', stamped, 4)[0] > 1e9
    gated.engine.follow_clock(ffi.NULL, ffi.NULL, is_outdated=True)
    stamped = gated.engine.replace(message, stamp_at=4)
    assert stamped is not None and stamped[4:12] == bytes(8)


def test_no_substitute_is_due_after_the_end(tmp_path: Path) -> None:
    gated = Guarded(tmp_path, JAMMED.replace('REPORT', 'onset').rstrip('\n}')
                    + ', otherwise: {substitute: {}, rate: 10}}')
    gated.send(1.0)
    assert replacement_due(gated.engine) != NEVER
    gated.engine.close()
    assert replacement_due(gated.engine) == NEVER


@pytest.mark.parametrize('policy', ['relevant_message', 'timed'])
def test_the_black_box_has_the_messages_of_the_gate_with_their_times(
        policy: str, tmp_path: Path) -> None:
    gated = Guarded(tmp_path, JAMMED.replace('REPORT', 'onset').replace(
        'relevant_message', policy))
    ring = MessageRing(gated.engine.library, 1 << 16, 60)
    ring.keep_messages_of(gated.engine)
    gated.sense(9.0)
    received = time_ns() - SECOND // 10
    assert [gated.engine.judge(cdr('<f', value), received) for value in (1.0, 10.0)] == [
        PASSED, VIOLATES]
    kept = [item.time - received for _, item in ring.read(0) if item.topic == gated.raw]
    assert len(kept) == 2  # under timed a message takes effect when it is judged
    assert all((delay > SECOND // 20) == (policy == 'timed') and delay >= 0 for delay in kept)
    assert see(gated.engine).behind[gated.raw] >= SECOND // 10
    gated.engine.close()


def test_without_a_time_a_message_is_judged_at_the_last_one(tmp_path: Path) -> None:
    text = JAMMED.replace('REPORT', 'onset').replace('relevant_message', 'timed')
    gated = Guarded(tmp_path, text.replace('H (x < y)', '(O[0,1 ns] y < 1.0) -> x <= 0.0'))
    gated.sense(0.5)
    assert gated.send(0.0) is PASSED
    gated.sense(9.0)
    assert gated.send(0.0) is PASSED
    assert gated.send(1.0) is PASSED  # y < 1 is over since
    gated.engine.follow_clock(ffi.NULL, ffi.NULL, is_outdated=True)
    assert gated.send(2.0) is PASSED


@pytest.mark.parametrize('is_replaced', [False, True])
def test_a_violation_by_another_topic_is_over_when_all_holds_again_if_nothing_was_sent(
        tmp_path: Path, is_replaced: bool) -> None:
    gated = Guarded(tmp_path, JAMMED.replace('REPORT', 'occurrence').replace(
        '[X]', '[X], otherwise: {substitute: {}}'))

    gated.engine.want_details(True)

    def found() -> list[bool]:
        details = iter(lambda: gated.engine.take_detail(0), None)
        return [bool(detail.violation.is_recovery) for detail in details]

    gated.sense(9.0)
    assert gated.send(3.0) is PASSED
    gated.sense(0.0)
    assert found() == [False]
    if is_replaced:
        assert gated.engine.replace(cdr('<f', 0.0)) is not None
    gated.sense(9.0)
    assert found() == ([] if is_replaced else [True])
    assert gated.send(3.0) is PASSED
    assert found() == ([True] if is_replaced else [])


def test_under_timed_what_is_due_a_nanosecond_after_a_message_is_taken_with_it(
        tmp_path: Path) -> None:
    text = JAMMED.replace('REPORT', 'onset').replace('relevant_message', 'timed').replace(
        'gates:', '  - {id: Y, ptltl: "H !(Y (x > 3.0))"}\ngates:').replace('[X]', '[X, Y]')
    gated = Guarded(tmp_path, text)
    gated.sense(9.0)
    assert gated.send(3.0) is PASSED
    assert gated.evaluator.requirement_counts(1).announced == 0
    assert gated.send(4.0) is PASSED
    assert gated.evaluator.requirement_counts(1).announced == 1


def test_under_timed_a_message_that_waited_is_judged_when_it_is_sent(tmp_path: Path) -> None:
    text = JAMMED.replace('REPORT', 'onset').replace('relevant_message', 'timed')
    gated = Guarded(tmp_path, text.replace('topic: y, ', 'topic: y, timeout: 0.6, '))
    gated.sense(9.0)
    assert gated.send(1.0) is PASSED
    received = time_ns()
    assert gated.engine.judge(cdr('<f', 2.0), received) is PASSED
    sleep(0.7)  # nobody looks at the time, and the other input becomes silent
    assert gated.engine.judge(cdr('<f', 3.0), received + 1) is CLOSED
    gated.sense(9.0)
    assert gated.engine.judge(cdr('<f', 4.0), received + 2) is PASSED


def test_under_timed_a_clock_that_goes_back_forgets_before_the_next_message(
        tmp_path: Path) -> None:
    compiled = start(write_bundle(tmp_path, TIMED, 'g.yaml'), part=NodePart('g'))
    settings = compiled.manifest.gate
    assert settings is not None and settings.topic is not None
    evaluator = Evaluator(compiled.monitor, reports_recoveries=True)
    engine = Engine(evaluator)
    engine.guard(MessageGate(evaluator, settings))
    clock = 99 * SECOND

    @ffi.callback('int(void *, int64_t *)')
    def read(_: object, now: Any) -> int:
        now[0] = clock
        return 0

    engine.follow_clock(read, ffi.NULL)
    engine.begin()
    engine.message(1 - settings.topic, cdr('<?', True), time_ns())
    assert engine.judge(cdr('<f', 1.0), time_ns()) is PASSED
    engine.message(1 - settings.topic, cdr('<?', False), time_ns())
    clock += SECOND // 2
    assert engine.judge(cdr('<f', 1.0), time_ns()) is PASSED
    clock -= SECOND // 4  # nobody looks at the time
    assert engine.judge(cdr('<f', 1.0), time_ns()) is VIOLATES
    assert evaluator.time_counts().restarts == 1


def test_under_timed_a_deadline_violates_and_a_message_is_judged_at_its_instant(
        tmp_path: Path) -> None:
    path = write_bundle(tmp_path, TIMED, 'g.yaml')
    compiled = start(path, part=NodePart('g'))
    settings = compiled.manifest.gate
    assert settings is not None and settings.substitute == cdr('<f', 0.0)
    evaluator = Evaluator(compiled.monitor, reports_recoveries=True)
    engine = Engine(evaluator)
    engine.guard(MessageGate(evaluator, settings))
    raw, beat = (next(place for place, topic in enumerate(compiled.manifest.topics)
                      if topic.name == name) for name in ('raw', 'beat'))
    assert raw == settings.topic
    second, begin = 10**9, 5 * 10**9
    engine.advance(begin)
    assert engine.judge(cdr('<f', 1.0), begin + 1) is CLOSED
    engine.message(beat, cdr('<?', False), begin + 1)
    assert engine.replace(settings.substitute) == settings.substitute  # its step begins the group
    engine.message(beat, cdr('<?', True), begin + 20)
    engine.message(beat, cdr('<?', False), begin + 21)  # true for a nanosecond
    last = begin + 20 + second
    assert engine.judge(cdr('<f', 1.0), begin + 30) is PASSED
    assert replacement_due(engine) == NEVER
    assert engine.take(0) == []
    # The deadline: the beat is older than a second, and the speed is above 0.
    engine.advance(last)
    assert engine.take(0) == []
    engine.advance(last + 1)
    assert [item.stamp for item in engine.take(0)] == [last + 1]
    assert replacement_due(engine) != NEVER
    assert engine.judge(cdr('<f', 2.0), last + 2) is VIOLATES
    assert engine.replace(settings.substitute) == settings.substitute
    assert engine.evaluator.value(0) == 0.0
    counts = see(engine).gate
    assert (counts.closed, counts.passed, counts.violates, counts.replaced) == (1, 1, 1, 2)
    assert counts.holds and counts.violating == 0
    assert engine.judge(cdr('<f', -1.0), last + 10) is PASSED
    # At the last instant at which the beat counts, and one later.
    engine.message(beat, cdr('<?', True), last + second)
    engine.message(beat, cdr('<?', False), last + second + 1)
    engine.reset()
    assert engine.judge(b'', last + second + 2) is UNREADABLE


def test_under_timed_a_message_at_the_instant_of_a_deadline_does_not_pass_before_it(
        tmp_path: Path) -> None:
    path = tmp_path / 'g.yaml'
    more = '  - {id: B, ptltl: "O[0, 1 s] beat"}\ngates:'
    path.write_text(TIMED.replace('gates:', more).replace('[R]', '[R, B]').replace(
        '{substitute: {data: 0.0}, rate: 10}', '{hold: 5}'), encoding='utf-8')
    compiled = start(path, part=NodePart('g'))
    settings = compiled.manifest.gate
    assert settings is not None and settings.topic is not None
    evaluator, other = Evaluator(compiled.monitor, reports_recoveries=True), 1 - settings.topic
    gate = MessageGate(evaluator, settings)
    saved = evaluator.save()
    engine = Engine(evaluator)
    engine.guard(gate)
    engine.advance(0)

    def beat(now: int) -> None:
        engine.message(other, cdr('<?', True), now)
        engine.message(other, cdr('<?', False), now + 1)

    def judged(now: int) -> Judgement:
        return engine.judge(cdr('<f', 0.0), now)

    beat(10)
    first = 10 + SECOND + 1  # B, which does not read `speed`, does not hold any more
    assert [judged(10 + 5), judged(first - 1)] == [PASSED, PASSED]
    before = evaluator.save()
    assert judged(first) is VIOLATES
    assert [(item.requirement, item.is_withheld) for item in engine.take(0)] == [(1, True)]
    beat(first)  # it was withheld, so that B can still be satisfied then
    assert judged(first + 2) is PASSED
    assert [(item.requirement, item.is_recovery) for item in engine.take(0)] == []
    second = first + SECOND + 1
    assert judged(second) is VIOLATES
    engine.advance(second)
    found = [(item.requirement, item.stamp, item.is_withheld) for item in engine.take(0)]
    assert found == [(1, second, True), (1, second, False)]
    assert judged(second + 1) is VIOLATES
    beat(second + 2)
    assert judged(second + 3) is PASSED
    assert see(engine).gate.violates == 3
    evaluator.restore(before)
    assert not gate.replace([0.0], first)[0]
    evaluator.restore(saved)  # without a time there are no deadlines
    assert gate.judge([0.0], 7)[0] is CLOSED
