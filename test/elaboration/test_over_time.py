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

"""Numbers over time in bundles: the three languages, implied inputs, types, refusals."""

from pathlib import Path

from fret_monitor.build import generate_monitor, read
from fret_monitor.bundle.reader import parse_bundle
from fret_monitor.elaboration.elaborate import specify
from fret_monitor.logic.evaluate import evaluate
from fret_monitor.logic.formula import (
    Aggregate, ALWAYS, Binary, BinaryOperator, Formula, Historically, Over, postorder, Since,
    TimeOver, TRUE, Unary, UnaryOperator, Variable, variables,
)
from fret_monitor.logic.printing import to_cocospec, to_smv
from fret_monitor.logic.specification import Specification
from fret_monitor.model.diagnostics import CompileError, Source
from fret_monitor.model.policies import InputSource
from fret_monitor.model.values import ValueType
import pytest

INPUTS = """
inputs:
  x: {topic: x, type: std_msgs/msg/Float32, max_rate: 100}
  n: {topic: n, type: std_msgs/msg/Int8, max_rate: 100}
  p: {topic: p, type: std_msgs/msg/Bool, max_rate: 100}
"""
TIMED = 'evaluation: {policy: timed, unit: 1}\n'
X, P = Variable('x', ValueType.FLOAT32), Variable('p', ValueType.BOOL)


def specified(requirement: str, *, before: str = '', inputs: str = INPUTS) -> Specification:
    text = f'format: 1\n{before}{inputs}requirements: [{{id: A, {requirement}}}]\n'
    return specify(parse_bundle(Source('bundle.yaml', text), Path()))[0]


def formula(expression: str, *, before: str = '', inputs: str = INPUTS) -> Formula:
    return specified(f'ptltl: "{expression}"', before=before, inputs=inputs).properties[0].formula


@pytest.mark.parametrize('expression', [
    'maxOver(3, x) <= 2.5', 'minOver(3, n) < n', 'meanOver(10, x + n) > 0.1',
    'sumOver(4, n) = 3', 'countOver(5, p) <= 3', 'changeOver(2, x) < 1.5',
    'heldAt(p, x) < minOver(2, meanOver(3, x))', 'heldAt(p, p)',
])
@pytest.mark.parametrize('before', ['', TIMED])
def test_all_languages_give_one_formula(expression: str, before: str) -> None:
    expected = Historically(ALWAYS, formula(expression, before=before))
    sentence = f'fretish: "the sw shall always satisfy {expression}"'
    assert specified(sentence, before=before).properties[0].formula is expected
    lustre = f'cocospec: "H({expression})"'
    assert specified(lustre, before=before).properties[0].formula is expected
    is_timed = bool(before)
    for text in (f'ptltl: "{to_smv(expected, is_timed=is_timed)}"',
                 f'cocospec: "{to_cocospec(expected, is_timed=is_timed)}"'):
        assert specified(text, before=before).properties[0].formula is expected


@pytest.mark.parametrize(('function', 'kind'), [
    ('maxOver(2, n)', ValueType.INT64), ('maxOver(2, x)', ValueType.FLOAT32),
    ('sumOver(2, n)', ValueType.INT64), ('sumOver(2, x)', ValueType.FLOAT64),
    ('meanOver(2, n)', ValueType.FLOAT64), ('countOver(2, p)', ValueType.INT64),
    ('changeOver(2, n)', ValueType.INT64), ('heldAt(p, n)', ValueType.INT64),
])
def test_each_function_has_its_type(function: str, kind: ValueType) -> None:
    found = formula(f'{function} < {function}')
    assert isinstance(found, Binary) and found.left.type is kind


def test_under_timed_a_sum_adds_an_input_that_says_that_a_message_came() -> None:
    found = specified('ptltl: "meanOver(2 s, x) < countOver(3 s, p & x > 1)"', before=TIMED)
    assert [item.name for item in found.signals] == [
        'x', 'n', 'p', 'x_received', 'p_received']
    added = found.signals[3]
    assert (added.topic, added.source, added.type, added.initial) == (
        'x', InputSource.RECEIVED, ValueType.BOOL, False)
    windows = [item for item in postorder([found.properties[0].formula])
               if isinstance(item, Over)]
    at = [Variable(f'{name}_received', ValueType.BOOL) for name in 'xp']
    assert windows[0].at is at[0]
    assert set(variables(windows[1].at)) == set(at)


def test_an_input_that_says_so_already_is_used() -> None:
    own = INPUTS + '  came: {topic: x, type: std_msgs/msg/Float32, field: received(), ' \
        'max_rate: 100}\n  x_received: {topic: q, type: std_msgs/msg/Bool, max_rate: 100}\n'
    found = specified('ptltl: "sumOver(2 s, x) < 3"', before=TIMED, inputs=own)
    assert 'came' in found.properties[0].inputs and len(found.signals) == 5
    other = INPUTS.replace('  p:', '  x_received:')
    found = specified('ptltl: "sumOver(2 s, x) < 3"', before=TIMED, inputs=other)
    assert found.signals[-1].name == 'x_received_'


def test_steps_need_no_such_input() -> None:
    found = specified('ptltl: "meanOver(2, x) < 3"')
    assert len(found.signals) == 3
    assert Over(Aggregate.COUNT, 2, P, TRUE) in postorder([formula('countOver(2, p) < 3')])


@pytest.mark.parametrize(('comparison', 'least', 'is_negated'), [
    ('timeOver(10 s, p) >= 2', 2_000_000_000, False),
    ('timeOver(10 s, p) > 2', 2_000_000_001, False),
    ('timeOver(10 s, p) >= 10', 10_000_000_000, False),
    ('timeOver(10 s, p) < 0.0000000015', 2, True),
    ('2.5 >= timeOver(10 s, p)', 2_500_000_001, True),
])
def test_a_time_is_compared_to_the_nanosecond(comparison: str, least: int,
                                              is_negated: bool) -> None:
    expected: Formula = TimeOver(10 ** 10, least, P)
    if is_negated:
        expected = Unary(UnaryOperator.NOT, expected)
    assert formula(comparison, before=TIMED) is expected
    equal = formula('timeOver(10 s, p) = 2', before=TIMED)
    assert isinstance(equal, Binary) and equal.operator is BinaryOperator.AND
    assert formula('timeOver(10 s, p) != 0.0000000005', before=TIMED) is not equal


def test_a_derivative_of_periods_is_the_change_over_the_period() -> None:
    found = formula('derivative(n) > 5', before='evaluation: {policy: periodic, period: 0.5}\n')
    assert evaluate(found, {'n': [9, 11, 14, 14]}) == [False, False, True, False]


def test_a_truth_value_is_held_by_operators_that_there_are() -> None:
    assert isinstance(formula('heldAt(p, x > 3)'), Since)


def test_a_window_of_time_needs_a_rate(tmp_path: Path) -> None:
    path = tmp_path / 'bundle.yaml'
    path.write_text('format: 1\n' + TIMED + INPUTS.replace(', max_rate: 100', '')
                    + 'requirements: [{id: A, ptltl: "meanOver(2 s, x) < 3"}]\n')
    with pytest.raises(CompileError, match='write `max_rate: 100`'):
        generate_monitor(read(path))
    path.write_text('format: 1\n' + TIMED + INPUTS
                    + 'requirements: [{id: A, ptltl: "meanOver(24 h, x) < 3"}]\n')
    with pytest.raises(CompileError, match='A looks back 24 h'):
        generate_monitor(read(path))
