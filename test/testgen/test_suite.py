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

"""The tests of a bundle: what the traces show, what is proved, and which mutants they notice."""

from collections.abc import Iterator
from pathlib import Path
from random import Random

from fret_monitor.build import read, Reading
from fret_monitor.logic.evaluate import evaluate, verdicts
from fret_monitor.logic.formula import Formula
from fret_monitor.logic.propositions import propositions
from fret_monitor.logic.specification import Property, Specification
from fret_monitor.testgen import suite as suite_module
from fret_monitor.testgen.obligations import Kind
from fret_monitor.testgen.recorded import history, moved, Recorded
from fret_monitor.testgen.suite import Case, CoverageAnswer, Covered, make_suite, Suite
from fret_monitor.traces import search
from fret_monitor.traces.trace import Value
import pytest
from strategies import some
from testgen.mutants import mutants

PUMP = """\
format: 1
component: pump
inputs:
  start: {type: bool}
  manual: {type: bool}
  level: {type: float64}
  flow: {type: float32}
  mode: {type: string, topic: state, values: {moving: go, stopped: halt}}
definitions:
  low: level < 2.0 & !manual
requirements:
  - {id: WITHIN, fretish: upon start & low pump shall within 3 ticks satisfy flow > 0.5}
  - {id: FOR, fretish: "in manual mode pump shall for 2 ticks satisfy flow <= 1.5"}
  - {id: UNTIL, fretish: "whenever start pump shall until manual satisfy level >= 1.0"}
  - {id: PAST, ptltl: "H (mode = stopped & O[1,3] start -> flow = 0.0)"}
  - {id: RATE, cocospec: "(true -> flow - pre flow <= 2.0) and level < 9.0"}
"""
STUCK = """\
format: 1
inputs: {x: {type: float64}, y: {type: float64}}
requirements:
  - {id: NEVER, ptltl: "!(x > 5.0 & x < 3.0)"}
  - {id: COUPLED, ptltl: "x > 5.0 & x > 3.0"}
  - {id: ORDER, ptltl: "!(x > y & x < y)"}
"""
TIMED = """\
format: 1
component: robot
evaluation: {policy: timed}
inputs: {stop: {type: bool}, speed: {type: float64}}
requirements:
  - {id: STOP, fretish: "upon stop robot shall within 500 milliseconds satisfy speed < 0.1"}
  - {id: HOLD, ptltl: "H (O[0, 2 s] stop -> speed <= 1.0)"}
"""
FIELDS = """\
format: 1
inputs:
  speed: {topic: odom, type: nav_msgs/msg/Odometry, field: norm(twist.twist.linear)}
  count: {topic: scan, type: sensor_msgs/msg/LaserScan, field: len(ranges)}
  first: {topic: scan, type: sensor_msgs/msg/LaserScan, field: "ranges[0]"}
  elbow: {topic: joints, type: sensor_msgs/msg/JointState, field: "position[name = elbow]"}
requirements:
  - {id: SPEED, ptltl: "speed > -5.0"}
  - {id: ROOT, ptltl: "!(speed + 1.0 < 0.5)"}
  - {id: COUNT, ptltl: "count >= 1"}
  - {id: NEVER, ptltl: "!(count < 0)"}
  - {id: FIRST, ptltl: "first > 0.5 | elbow < -1.5"}
"""
SECONDS = 300.0
DONE: dict[str, tuple[Reading, Suite]] = {}


def made(tmp_path_factory: pytest.TempPathFactory, text: str) -> tuple[Reading, Suite]:
    """Return the tests of a bundle, which are made once."""
    if text not in DONE:
        path = tmp_path_factory.mktemp('bundle') / 'bundle.yaml'
        path.write_text(text)
        reading = read(path)
        DONE[text] = reading, make_suite(reading, SECONDS)
    return DONE[text]


@pytest.fixture
def pump(tmp_path_factory: pytest.TempPathFactory) -> Suite:
    return made(tmp_path_factory, PUMP)[1]


@pytest.fixture
def stuck(tmp_path_factory: pytest.TempPathFactory) -> Suite:
    return made(tmp_path_factory, STUCK)[1]


@pytest.fixture
def timed(tmp_path_factory: pytest.TempPathFactory) -> Suite:
    return made(tmp_path_factory, TIMED)[1]


def answers(suite: Suite, name: str) -> dict[str, Covered]:
    return {each.what: each for each in suite.covered if each.requirement == name}


def cases(suite: Suite, name: str) -> list[Case]:
    return [case for case in suite.cases if case.requirement.id == name]


def stepped(case: Case, specification: Specification) -> dict[str, list[Value]]:
    """Return the columns of a trace, with a value at each step."""
    rows = case.trace.at_each_tick()
    return {signal.name: [row[place] for row in rows]
            for place, signal in enumerate(specification.signals)}


def truth(case: Case, suite: Suite, formula: Formula) -> list[Value]:
    return evaluate(formula, stepped(case, suite.specification), case.requirement.feedback)


def shown(suite: Suite, each: Covered) -> list[Case]:
    own = cases(suite, each.requirement)
    return [own[number - 1] for number in each.cases]


def test_each_obligation_of_the_timing_has_its_moment(pump: Suite) -> None:
    found = answers(pump, 'WITHIN')
    assert [what for what, each in found.items() if each.kind is Kind.TIMING] == [
        'satisfied at the first moment', 'satisfied later', 'satisfied at the last moment',
        'violated: one too late', 'violated without any response',
        'the condition counts only when it becomes true']
    assert {each.answer for each in found.values()} == {CoverageAnswer.COVERED}
    last, = shown(pump, found['satisfied at the last moment'])
    flows = stepped(last, pump.specification)['flow']
    starts = stepped(last, pump.specification)['start']
    tick, = found['satisfied at the last moment'].ticks
    begin = max(step for step in range(tick + 1) if starts[step] and (
        step == 0 or not starts[step - 1]))
    assert tick - begin == 3 and [flow > 0.5 for flow in flows[begin:tick + 1]] == [
        False, False, False, True]
    assert verdicts(last.requirement.formula, stepped(last, pump.specification))[tick]


def test_fields_that_are_computed_have_values_that_a_message_can_give(
        tmp_path_factory: pytest.TempPathFactory) -> None:
    suite = made(tmp_path_factory, FIELDS)[1]
    values = [dict(zip(('speed', 'count', 'first', 'elbow'), row))
              for case in suite.cases for row in case.trace.rows]
    assert not any(row['speed'] < 0 or row['count'] < 0 for row in values)
    assert any(row['speed'] != row['speed'] for row in values)  # a norm can be NaN
    assert min(row['elbow'] for row in values) < -1.5
    violated = {item.id: answers(suite, item.id)['violated'].answer
                for item in suite.specification.properties}
    assert [name for name, answer in violated.items() if answer is CoverageAnswer.COVERED] \
        == ['SPEED', 'COUNT', 'FIRST']
    assert [name for name, answer in violated.items() if answer is CoverageAnswer.UNREACHABLE] \
        == ['ROOT', 'NEVER']


def test_two_traces_that_show_a_condition_differ_in_it_alone(pump: Suite) -> None:
    pairs = [each for each in pump.covered if each.kind is Kind.CONDITION
             and each.answer is CoverageAnswer.COVERED]
    assert len(pairs) > 10
    for each in pairs:
        one, two = shown(pump, each)
        nodes = propositions(one.requirement)
        ends = [tick + 1 for tick in each.ticks]
        assert ends[0] == ends[1]
        changed = [number for number, node in enumerate(nodes)
                   if truth(one, pump, node)[:ends[0]] != truth(two, pump, node)[:ends[0]]]
        results = [truth(case, pump, one.requirement.formula)[ends[0] - 1]
                   for case in (one, two)]
        assert len(changed) == 1 and results[0] != results[1], each.what


def test_what_no_trace_shows_is_proved(stuck: Suite) -> None:
    never = answers(stuck, 'NEVER')
    assert never['violated'].answer is CoverageAnswer.UNREACHABLE
    assert 'all states explored' in never['violated'].detail
    coupled = answers(stuck, 'COUPLED')['x > 3.0 alone changes the verdict']
    assert coupled.answer is CoverageAnswer.UNREACHABLE


def test_without_a_proof_nothing_is_called_unreachable(
        tmp_path_factory: pytest.TempPathFactory,
        monkeypatch: pytest.MonkeyPatch) -> None:
    # Compared with each other, inputs have no values that stand for all: the solver has to prove.
    monkeypatch.setattr(suite_module, 'find_spec', lambda name: None)
    monkeypatch.setattr(search, '_TRIED', 20_000)
    lines = STUCK.splitlines(keepends=True)
    _, found = made(tmp_path_factory, ''.join([*lines[:3], lines[-1]]))
    assert answers(found, 'ORDER')['violated'].answer is CoverageAnswer.UNKNOWN
    assert 'none found in' in answers(found, 'ORDER')['violated'].detail


def test_the_solver_proves_what_exploring_cannot(stuck: Suite) -> None:
    pytest.importorskip('z3')
    violated = answers(stuck, 'ORDER')['violated']
    assert (violated.answer, violated.detail) == (
        CoverageAnswer.UNREACHABLE, 'proved by induction over 1 steps')


def test_a_timed_response_comes_at_the_last_nanosecond(timed: Suite) -> None:
    found = answers(timed, 'STOP')
    assert {each.answer for each in found.values()} == {CoverageAnswer.COVERED}
    last, = shown(timed, found['satisfied at the last moment'])
    late, = shown(timed, found['violated: one too late'])
    assert (last.trace.ticks[-1], late.trace.ticks[-1]) == (500_000_000, 500_000_001)


def noticed(suite: Suite, item: Property, other: Property) -> bool:
    names = [signal.name for signal in suite.specification.signals]
    return any(seen(other, names, case.trace) != seen(item, names, case.trace)
               for case in cases(suite, item.id))


def seen(item: Property, names: list[str], trace: Recorded) -> object:
    return history(item.formula, item.feedback, names, trace)


CHANGES = [
    ('level < 2.0', 'level <= 2.0'), ('level < 2.0', 'level > 2.0'), ('flow > 0.5', 'flow >= 0.5'),
    ('start & low', 'start'), ('start & low', 'low'), (' & !manual', ''), ('3 ticks', '2 ticks'),
    ('3 ticks', '4 ticks'), ('upon start', 'whenever start'), ('2 ticks', '3 ticks'),
    ('2 ticks', '1 ticks'), ('flow <= 1.5', 'flow < 1.5'), ('whenever start', 'upon start'),
    ('until manual', 'until flow > 1.0'), ('level >= 1.0', 'level > 1.0'),
    ('O[1,3]', 'O[0,3]'), ('O[1,3]', 'O[2,3]'), ('O[1,3]', 'O[1,4]'), ('O[1,3]', 'O[1,2]'),
    ('mode = stopped & ', ''), ('mode = stopped', 'mode = moving'), ('flow = 0.0', 'flow >= 0.0'),
    ('flow = 0.0', 'flow <= 0.0'), ('H (mode', '(mode'), ('for 2 ticks', 'always'),
    ('within 3 ticks', 'eventually'), ('within 3 ticks', 'immediately'), (' & O[1,3] start', ''),
    ('level < 9.0', 'level <= 9.0'), (' and level < 9.0', ''), ('flow <= 2.0', 'flow < 2.0'),
]


@pytest.mark.parametrize('change', some(CHANGES, 2), ids=' -> '.join)
def test_mistakes_in_a_bundle_are_noticed(pump: Suite, tmp_path: Path,
                                          change: tuple[str, str]) -> None:
    assert change[0] in PUMP
    (tmp_path / 'mutant.yaml').write_text(PUMP.replace(*change))
    other = read(tmp_path / 'mutant.yaml').specification
    pairs = zip(pump.specification.properties, other.properties, strict=True)
    assert any(noticed(pump, item, mutant) for item, mutant in pairs)


def test_mistakes_in_formulas_are_noticed(pump: Suite) -> None:
    item = next(each for each in pump.specification.properties if each.id == 'PAST')
    missed = [mutant.what for mutant in mutants(item) if not noticed(pump, item, mutant.item)]
    assert missed == []


# Of such formulas, traces that showed verdicts, bounds, comparisons and conditions alone missed a
# fifth of all swapped operators.
OPERATORS = """\
format: 1
inputs: {p: {type: bool}, q: {type: bool}, x: {type: float64}}
requirements:
  - {id: R0, ptltl: "((Y x <= 2.0) S (O[0,1] p)) -> ((x > 1.0 -> q) <-> p)"}
  - {id: R1, ptltl: "H (Y p) & (O[0,1] x <= 2.0 <-> (x <= 2.0 | q))"}
  - {id: R2, ptltl: "Y ((q T x > 1.0) T (H q))"}
  - {id: R3, ptltl: "Y (O (q S[0,1] p))"}
  - {id: R4, ptltl: "O[2,2] (x > 1.0 S[0,2] (x > 1.0 -> q))"}
  - {id: R5, ptltl: "H[0,2] ((q | x <= 2.0) -> !(!q S x > 1.0))"}
  - {id: R6, fretish: "upon p & !q the system shall within 2 ticks satisfy q -> x > 1.0"}
"""


def test_swapped_operators_are_noticed(tmp_path_factory: pytest.TempPathFactory) -> None:
    suite = made(tmp_path_factory, OPERATORS)[1]
    for item in suite.specification.properties:
        own = [each for each in suite.covered if each.requirement == item.id
               and each.kind is Kind.OPERATOR]
        assert own and all(each.answer in (CoverageAnswer.COVERED, CoverageAnswer.UNREACHABLE)
                           for each in own), item.id
        for mutant in mutants(item):
            if item.sentence is None and not noticed(suite, item, mutant.item):
                assert all(verdicts(item.formula, each) == verdicts(mutant.item.formula, each)
                           for each in random_columns()), (item.id, mutant.what)


def random_columns() -> Iterator[dict[str, list[Value]]]:
    rng = Random(1)
    for _ in range(300):
        steps = range(rng.choice((1, 2, 3, 4, 6, 9)))
        yield {'p': [rng.random() < 0.5 for _ in steps], 'q': [rng.random() < 0.5 for _ in steps],
               'x': [rng.choice((0.5, 1.5, 2.5)) for _ in steps]}


def test_windows_of_numbers_have_traces_under_timed(tmp_path: Path) -> None:
    (tmp_path / 'bundle.yaml').write_text(
        'format: 1\nevaluation: {policy: timed}\n'
        'inputs: {x: {type: float32, max_rate: 1}, p: {type: bool, max_rate: 1}}\n'
        'requirements: [{id: MAX, ptltl: "maxOver(3 s, x) <= 5.0"}, '
        '{id: MEAN, ptltl: "meanOver(3 s, x) <= 5.0 | p & minOver(2 s, x) > 1.0"}]\n')
    found = make_suite(read(tmp_path / 'bundle.yaml'), 10.0)
    assert {'MAX', 'MEAN'} <= {each.requirement for each in found.covered}
    assert any(each.answer is CoverageAnswer.COVERED for each in found.covered
               if each.requirement == 'MAX')


def test_a_message_of_a_trace_that_is_moved_takes_one_nanosecond() -> None:
    trace = Recorded((0, 50, 51, 100, 101), ((False,), (True,), (False,), (True,), (False,)), 101)
    candidates = list(moved(trace, 50))
    assert len({candidate.ticks for candidate in candidates}) > 5
    for candidate in candidates:
        starts = [tick for tick, row in zip(candidate.ticks, candidate.rows, strict=True)
                  if row == (True,)]
        assert [tick + 1 for tick in starts] == [candidate.ticks[2], candidate.ticks[4]]


def test_when_the_time_is_over_the_answers_are_marked(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / 'bundle.yaml').write_text(PUMP)
    found = make_suite(read(tmp_path / 'bundle.yaml'), 1e-9)
    assert found.is_partial and found.cases == ()
    assert {(each.answer, each.detail) for each in found.covered} == {
        (CoverageAnswer.UNKNOWN, 'out of time')}
