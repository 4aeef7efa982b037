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

"""Answers about bundles, by hand and against an explicit search over all states."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
import gc
from itertools import product
from pathlib import Path
from random import Random

from analysis.search import reference, Search, TooManyStates
from fret_monitor.analysis import checks, diagrams, division, letters
from fret_monitor.analysis.answers import Analysis, Answer, Question
from fret_monitor.analysis.checks import analyze
from fret_monitor.analysis.component import build_component, by_outputs, Part
from fret_monitor.analysis.extremes import simplified
from fret_monitor.analysis.games import Descent, Games
from fret_monitor.analysis.replay import CompiledReplay
from fret_monitor.analysis.runs import Runner
from fret_monitor.analysis.second import SecondCheck
from fret_monitor.build import read
from fret_monitor.bundle.reader import parse_bundle
from fret_monitor.elaboration.elaborate import specify
from fret_monitor.logic.evaluate import evaluate
from fret_monitor.logic.formula import (
    Aggregate, Binary, BinaryOperator, Constant, Over, postorder, TRUE,
)
from fret_monitor.logic.specification import Specification
from fret_monitor.model.diagnostics import Source
from fret_monitor.model.values import ValueType
from fret_monitor.smt import solver
from fret_monitor.traces.deadline import Deadline
from fret_monitor.traces.sampled import sampled
from fret_monitor.traces.trace import Row
from hypothesis import given, settings
from hypothesis import strategies as st
import pytest
import strategies

ROLES = 'a: {type: bool}\n  b: {type: bool}\n  x: {type: bool, role: output}\n' \
    '  y: {type: bool, role: output}\n  v: {type: float64}\n  w: {type: float64, role: output}'


def bundle(*formulas: str, inputs: str = ROLES) -> Specification:
    """Return a bundle of formulas R0, R1 ...; one that begins with `assume` is an assumption."""
    lines = []
    for number, text in enumerate(formulas):
        formula = text.removeprefix('assume ')
        language = 'fretish' if ' shall ' in formula else 'ptltl'
        lines.append(f'  - {{id: R{number}, {language}: "{formula}", '
                     f'assume: {str(formula != text).lower()}}}')
    text = '\n'.join(['format: 1', 'inputs:', f'  {inputs}', 'requirements:', *lines])
    return specify(parse_bundle(Source('b.yaml', text + '\n'), Path('.')))[0]


def analyzed(specification: Specification, *asked: Question, seconds: float = 60.0) -> Analysis:
    """Return the answers about a bundle, whose runs the reference semantics confirms."""
    return analyze(specification, reference(specification), asked or list(Question),
                   deadline=Deadline(seconds))


def only(found: Analysis, question: Question) -> Answer:
    """Return the one answer to a question."""
    [item] = found.of(question)
    return item


# -- by hand ---------------------------------------------------------------------------------

def test_requirements_that_exclude_one_another_are_inconsistent() -> None:
    specification = bundle('H (a -> x)', 'H x', 'H (O[0,3] !x)', 'H y')
    found = analyzed(specification, Question.CONSISTENCY)
    assert found.together(Question.CONSISTENCY) is False
    no = next(item for item in found.answers if item.holds is False)
    assert no.conflicts == (('R1', 'R2'),) and no.are_all
    assert no.example is not None and no.example.violated in (('R1',), ('R2',))
    assert len(no.example.rows) == 1


def test_a_bound_is_counted_until_it_runs_out() -> None:
    specification = bundle('H (O[0,5] x | !O[5,5] TRUE)', 'H (FTP -> x)', 'H (Y O x -> !x)')
    no = only(analyzed(specification, Question.CONSISTENCY), Question.CONSISTENCY)
    assert no.holds is False and no.example is not None
    assert len(no.example.rows) == 7


def test_a_run_into_a_dead_end_is_not_real_time_consistent() -> None:
    specification = bundle('H (a -> (Y x | FTP))', 'H (O[3,3] a -> x)', 'H (O[3,3] b -> !x)')
    found = analyzed(specification, Question.CONSISTENCY, Question.RT_CONSISTENCY)
    assert found.together(Question.CONSISTENCY) is True
    no = only(found, Question.RT_CONSISTENCY)
    assert no.holds is False and no.example is not None
    assert set(no.example.violated) <= {'R1', 'R2'} and len(no.example.rows) == 4


def test_requirements_without_a_dead_end_are_real_time_consistent() -> None:
    found = analyzed(bundle('H (a -> x)', 'H (O[3,3] b -> !y)'), Question.RT_CONSISTENCY)
    assert found.together(Question.RT_CONSISTENCY) is True


def test_a_trigger_that_never_comes_and_a_verdict_that_never_falls_are_vacuous() -> None:
    specification = bundle('H (a -> x)', 'H !a', 'H (b -> (a | !a))', 'H (b -> y)')
    found = analyzed(specification, Question.VACUITY)
    assert found.listed(Question.VACUITY) == ['R0', 'R2']
    reasons = {item.requirements[0]: item.method for item in found.answers}
    assert 'trigger never comes' in reasons['R0'] and 'never violated' in reasons['R2']


def test_a_norm_is_never_negative() -> None:
    norm = '{topic: odom, type: nav_msgs/msg/Odometry, field: norm(twist.twist.linear)'
    found = analyzed(bundle(
        'H (a < 0.0 -> x)', 'H (a < 1.0 | x)', 'Y (a >= b - 1.0) | FTP',
        inputs=f'a: {norm}}}\n  b: {norm}, role: output}}\n  x: {{type: bool}}'),
        Question.CONSISTENCY, Question.VACUITY)
    assert found.together(Question.CONSISTENCY) is True
    assert found.listed(Question.VACUITY) == ['R0']


@pytest.mark.parametrize('formula', ['meanOver(3, v) < 2.0', 'changeOver(2, v + w) > 1.0'])
def test_a_window_of_numbers_loses_no_other_answer(formula: str) -> None:
    specification = bundle(formula, 'H (a -> x)', 'H (a & v > 1.0 -> x)', 'H (b -> !x | x)')
    found = {(item.question, item.requirements): item
             for item in analyzed(specification).answers}
    consistent, = (item for item in found.values() if item.question is Question.CONSISTENCY
                   and 'R0' in item.requirements)
    assert (consistent.holds, consistent.reason) == (
        None, 'windows of numbers; without R0, yes')
    assert found[Question.REDUNDANCY, ('R2',)].holds is True
    assert found[Question.REDUNDANCY, ('R1',)].reason.endswith('; without R0, no')
    assert found[Question.REDUNDANCY, ('R0',)].holds is None


def test_an_extreme_that_is_compared_with_a_constant_is_decided() -> None:
    found = analyzed(bundle('maxOver(3, v) <= 5.0', 'H[0,3] (v <= 5.0)'), Question.REDUNDANCY)
    assert found.listed(Question.REDUNDANCY) == ['R0', 'R1']
    excluding = bundle('maxOver(3, v) <= 5.0', '6.0 < minOver(1, v)')
    no = only(analyzed(excluding, Question.CONSISTENCY), Question.CONSISTENCY)
    assert no.holds is False and no.conflicts == (('R0', 'R1'),)


@settings(max_examples=30)
@given(st.data())
def test_extremes_are_the_same_without_windows(data: st.DataObject) -> None:
    number = data.draw(st.sampled_from([item for item in strategies.INPUTS if item.type in (
        ValueType.FLOAT32, ValueType.FLOAT64, ValueType.INT64, ValueType.UINT64)]))
    extreme = Over(data.draw(st.sampled_from([Aggregate.GREATEST, Aggregate.LEAST])),
                   data.draw(st.integers(1, 4)), number, TRUE)
    values = [item for item in data.draw(strategies.traces([number]))[number.name] if item == item]
    limit = Constant(data.draw(st.sampled_from(values or [0])), number.type)
    operator = data.draw(st.sampled_from([
        BinaryOperator.LT, BinaryOperator.LE, BinaryOperator.GT, BinaryOperator.GE]))
    is_turned = data.draw(st.booleans())
    formula = Binary(operator, limit, extreme) if is_turned else Binary(operator, extreme, limit)
    changed = simplified((formula,))[formula]
    assert not any(isinstance(item, Over) for item in postorder([changed]))
    trace = data.draw(strategies.traces([number]))
    assert evaluate(changed, trace) == evaluate(formula, trace)


@pytest.mark.parametrize('formula', [
    pytest.param('H (w = cos(v) * cos(v))', marks=strategies.thorough),
    'H (sin(v) > 2.0)', 'H (sin(v) + w > 2.0)', 'H (v ^ w > 1.0)',
])
def test_a_function_that_no_solver_knows_loses_no_other_answer(formula: str) -> None:
    specification = bundle(formula, 'H (a -> x)', 'H (a & v > 1.0 -> x)')
    found = {(item.question, item.requirements): item
             for item in analyzed(specification).answers}
    consistent, = (item for item in found.values() if item.question is Question.CONSISTENCY)
    assert consistent.holds is None and consistent.reason.endswith('; without R0, yes')
    assert 'the solver does not know the values of' in consistent.reason
    redundant = found[Question.REDUNDANCY, ('R2',)]
    assert redundant.holds is True and redundant.method.startswith('implied by the others')
    assert found[Question.REDUNDANCY, ('R1',)].reason.endswith('; without R0, no')
    assert found[Question.VACUITY, ('R1',)].reason.endswith('; without R0, no')
    assert found[Question.REDUNDANCY, ('R0',)].holds is None


@pytest.mark.parametrize('formula', ['H (w = cos(v) | x)', 'H (sin(v) + v < 9.0 | x)'])
def test_a_conflict_beside_a_function_that_no_solver_knows_is_found(formula: str) -> None:
    specification = bundle(formula, 'H x', 'H (O[0,3] !x)')
    for question in (Question.CONSISTENCY, Question.REALIZABILITY):
        no = only(analyzed(specification, question), question)
        assert (no.holds, no.conflicts) == (False, (('R1', 'R2'),))


def test_what_others_imply_is_redundant() -> None:
    specification = bundle('H (a -> x)', 'H x', 'H (b -> y)', 'H (!y -> !b)', 'H (a | y)')
    found = analyzed(specification, Question.REDUNDANCY)
    assert found.listed(Question.REDUNDANCY) == ['R0', 'R2', 'R3']
    methods = {item.requirements[0]: item.method for item in found.answers}
    assert 'equal to R3' in methods['R2'] and 'equal' not in methods['R0']


def test_outputs_that_depend_on_later_inputs_are_not_realizable() -> None:
    found = analyzed(bundle('H (Y x <-> a | FTP & a)', 'H (b -> y)', 'H (a & b -> !y)'),
                     Question.REALIZABILITY)
    first, second = found.of(Question.REALIZABILITY)
    assert (first.outputs, first.requirements, first.holds) == (('x',), ('R0',), False)
    assert (second.outputs, second.holds) == (('y',), False)
    assert second.conflicts == (('R1', 'R2'),)
    assert second.example is not None and len(second.example.rows) == 1


def test_an_assumption_can_make_requirements_realizable() -> None:
    needs = ('H (b -> y)', 'H (a & b -> !y)')
    assert analyzed(bundle(*needs), Question.REALIZABILITY).together(
        Question.REALIZABILITY) is False
    found = analyzed(bundle(*needs, 'assume H !(a & b)'), Question.REALIZABILITY)
    assert found.together(Question.REALIZABILITY) is True
    assert only(found, Question.REALIZABILITY).requirements == ('R0', 'R1', 'R2')


def test_contradictory_assumptions_are_reported_instead_of_realizability() -> None:
    found = analyzed(bundle('H x', 'H (a -> !x)', 'assume H a', 'assume H (O[0,2] !a)'),
                     Question.REALIZABILITY)
    answer = only(found, Question.REALIZABILITY)
    assert answer.holds is None and answer.reason == \
        'the assumptions contradict each other: R2, R3'


def test_a_requirement_of_inputs_alone_is_not_realizable() -> None:
    found = analyzed(bundle('H a', 'H x'), Question.REALIZABILITY)
    assert [(item.outputs, item.holds) for item in found.answers] == [
        ((), False), (('x',), True)]


def test_assumptions_that_contradict_each_other_are_reported_by_every_question() -> None:
    found = analyzed(bundle('H (a -> x)', 'assume H b', 'assume a', 'assume H (Y TRUE -> !a)'))
    for answer in found.answers:
        if 'R0' in answer.requirements:
            assert 'the assumptions contradict each other' in answer.reason + answer.method
            assert answer.holds is not True
            assert answer.conflicts == (('R2', 'R3'),)
    assert {item.holds for item in found.of(Question.CONSISTENCY)} == {True, False}
    unrelated = analyzed(bundle('H (a -> x)', 'assume H b', 'assume O !b & H b'),
                         Question.REALIZABILITY)
    assert [(item.requirements, item.holds) for item in unrelated.answers] == [
        (('R0',), True), (('R1', 'R2'), None)]
    fine = analyzed(bundle('H (a -> x)', 'assume H b'), Question.REALIZABILITY)
    assert [item.requirements for item in fine.answers] == [('R0',)]


@pytest.mark.parametrize('formulas', [
    ('H (a -> x)', 'H (a -> !x)', 'assume H !x'),  # !x is for the system to keep
    ('H (FTP | (a <-> b))', 'assume H (Y !x -> a)', 'assume H (Y !x -> !a)'),
    ('H (a -> x) & H (O a -> x)', 'assume H (b -> (Y !x | FTP))', 'H (b -> !x)')])
def test_the_system_does_not_win_by_breaking_an_assumption(formulas: tuple[str, ...]) -> None:
    answer = only(analyzed(bundle(*formulas), Question.REALIZABILITY), Question.REALIZABILITY)
    assert answer.holds is False and answer.conflicts


def test_an_assumption_about_earlier_outputs_is_relied_on() -> None:
    needs = 'H x', 'H (Y TRUE -> a)'
    assert analyzed(bundle(*needs), Question.REALIZABILITY).together(
        Question.REALIZABILITY) is False
    found = analyzed(bundle(*needs, 'assume H (Y x -> a)'), Question.REALIZABILITY)
    assert only(found, Question.REALIZABILITY).holds is True


def test_components_whose_outputs_one_assumption_reads_are_one() -> None:
    found = analyzed(bundle('H !x', 'H (Y TRUE -> a) & H (y | !y)', 'assume H (Y x -> a)'),
                     Question.REALIZABILITY)
    answer = only(found, Question.REALIZABILITY)
    assert answer.holds is False and answer.outputs == ('x', 'y')
    assert answer.conflicts == (('R0', 'R1'),)


# -- eventually ------------------------------------------------------------------------------

SOON = 'the c shall eventually satisfy x'


def test_eventually_must_stay_possible() -> None:
    found = analyzed(bundle(SOON, 'H (a -> !x)'), Question.CONSISTENCY)
    assert found.together(Question.CONSISTENCY) is True
    found = analyzed(bundle(SOON, 'H (!x | O a)', 'H !a'), Question.CONSISTENCY)
    answer = next(item for item in found.answers if item.holds is not True)
    assert answer.holds is False and answer.conflicts == (('R0', 'R1', 'R2'),)


def test_the_system_fulfils_eventually_whatever_the_environment_does() -> None:
    def answer(*formulas: str) -> Answer:
        return only(analyzed(bundle(*formulas), Question.REALIZABILITY), Question.REALIZABILITY)

    no = answer(SOON, 'H (a -> !x)')
    assert no.holds is False and no.conflicts == (('R0', 'R1'),)
    assert no.example is not None and no.example.violated == ()
    assert answer(SOON, 'H (Y x -> !x)').holds is True
    # What the environment eventually does is not for the system to do.
    assert answer(SOON, 'H (a -> !x)', 'assume the c shall eventually satisfy !a').holds is True
    assert answer(SOON, 'H (a -> !x)', 'assume the c shall eventually satisfy b').holds is False
    # Nor may it win by preventing that.
    unknown = answer('the c shall eventually satisfy b', 'H (a | x | y | TRUE)',
                     'assume the c shall eventually satisfy b | x')
    assert unknown.holds is None
    assert unknown.reason.startswith('R2 is needed, which says `eventually` about outputs')


LINKED = ('H (x | y | !y)', 'assume H (Y x -> !a)',
          'assume whenever !a the c shall eventually satisfy a')


def test_the_system_does_not_win_by_preventing_what_the_environment_eventually_does() -> None:
    def answer(*formulas: str) -> Answer:
        return only(analyzed(bundle(*LINKED, *formulas), Question.REALIZABILITY),
                    Question.REALIZABILITY)

    # It could set x forever, so that a never comes, and need not set y.
    unknown = answer('whenever !y the c shall eventually satisfy y', 'H (y -> a & Y a)')
    assert unknown.holds is None
    assert unknown.reason.startswith('R2 is needed, which says `eventually` about outputs '
                                     'through R1')
    no = answer('whenever !y the c shall eventually satisfy y', 'H !y')
    assert no.holds is False and no.conflicts == (('R3', 'R4'),)
    assert answer('whenever !y the c shall eventually satisfy y').holds is True
    # An assumption about other inputs is relied on.
    needs = 'whenever !y the c shall eventually satisfy y', 'H (y -> b)'
    assert answer(*needs).holds is None
    assert answer(*needs, 'assume whenever !b the c shall eventually satisfy b').holds is True


def test_what_a_run_without_continuation_violates_is_not_redundant() -> None:
    needs = 'H (Y a -> b & !b)', 'H !a'
    for more in ((), ('the c shall eventually satisfy b',)):
        found = analyzed(bundle(*needs, *more), Question.REDUNDANCY)
        assert 'R1' not in found.listed(Question.REDUNDANCY)


def test_an_equal_assumption_that_says_eventually_makes_redundant() -> None:
    found = analyzed(bundle(f'assume {SOON}', SOON, 'H (x -> a)'), Question.REDUNDANCY)
    assert found.listed(Question.REDUNDANCY) == ['R1']


def test_equal_requirements_that_say_eventually_are_redundant() -> None:
    found = analyzed(bundle(SOON, SOON, 'H (x -> a)'), Question.REDUNDANCY, Question.VACUITY)
    assert found.listed(Question.REDUNDANCY) == ['R0', 'R1']
    assert found.listed(Question.VACUITY) == []
    assert 'equal to R1' in found.of(Question.REDUNDANCY)[0].method
    found = analyzed(bundle(SOON, 'H (O[0,3] x | !O[3,3] TRUE)',
                            'the c shall eventually satisfy x | !x'))
    assert found.listed(Question.REDUNDANCY) == ['R0', 'R2']
    assert found.listed(Question.VACUITY) == ['R2']


# -- what a yes or no rests on ---------------------------------------------------------------

@pytest.mark.parametrize('most', [1, 2, 3])
def test_too_many_combinations_of_comparisons_give_no_no(
        most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(letters, '_MOST_LETTERS', most)
    specification = bundle('H (w > 1.0)', 'H (w > 2.0)', 'H (w > 3.0)', inputs=(
        'w: {type: float64, role: output}'))
    for answer in analyzed(specification).answers:
        if answer.holds is not True:
            is_possible = answer.question is Question.REDUNDANCY and answer.holds is False
            assert is_possible or f'more than {most} comb' in answer.reason, answer
        assert not (answer.requirements == ('R2',) and answer.holds)


def test_a_yes_that_the_second_check_refutes_is_an_internal_error(
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(SecondCheck, 'wins', lambda *_, **__: solver.ProofAnswer.REFUTED)
    found = analyzed(bundle('H (a -> x)'), Question.CONSISTENCY, Question.REALIZABILITY)
    assert {item.holds for item in found.answers} == {None}
    assert all('internal error' in item.reason and 'please report' in item.reason
               for item in found.answers)


# -- numbers ---------------------------------------------------------------------------------

def test_comparisons_are_true_together_only_where_numbers_allow_it() -> None:
    found = analyzed(bundle('H (w > 5.0)', 'H (w < 3.0 | x)', 'H !x'), Question.CONSISTENCY)
    no = next(item for item in found.answers if item.holds is False)
    assert no.conflicts == (('R0', 'R1', 'R2'),)
    assert no.example is not None and len(no.example.violated) == 1


def test_no_number_lies_between_neighbours() -> None:
    found = analyzed(bundle('H (w > 1.0)', 'H (w < 1.0000000000000002)'), Question.CONSISTENCY)
    assert found.together(Question.CONSISTENCY) is False


def test_a_comparison_of_inputs_with_outputs_leaves_classes_of_choices() -> None:
    needs = ('H (w >= v)', 'H (w <= 10.0)')
    found = only(analyzed(bundle(*needs), Question.REALIZABILITY), Question.REALIZABILITY)
    assert found.holds is False and found.example is not None
    assert found.conflicts == (('R0', 'R1'),)
    [row] = found.example.rows
    assert row[4] > 10.0
    found = only(analyzed(bundle(*needs, 'assume H (v <= 10.0)'), Question.REALIZABILITY),
                 Question.REALIZABILITY)
    assert found.holds is True


def test_a_comparison_with_the_value_before_is_unknown_rather_than_wrong() -> None:
    inputs = 'w: {type: float64, role: output}\n  v: {type: float64}'
    text = [f'  - {{id: R{number}, cocospec: "{item}"}}' for number, item in enumerate((
        'H(FTP or ((0.0 -> pre w) - w <= 1.0))', 'H(w <= v)'))]
    specification = specify(parse_bundle(Source('b.yaml', '\n'.join([
        'format: 1', 'inputs:', f'  {inputs}', 'requirements:', *text]) + '\n'), Path('.')))[0]
    answer = only(analyzed(specification, Question.REALIZABILITY), Question.REALIZABILITY)
    assert answer.holds is None
    assert 'earlier steps' in answer.reason


COUNTING = 'n: {type: int64, role: output}\n  x: {type: bool, role: output}'
COUNTED = '(FTP -> n = 0) & (Y TRUE -> n >= preInt(0, n) + 1)'


def test_no_reason_names_outputs_where_there_are_none() -> None:
    specification = bundle('v >= preReal(0.0, v)', inputs='v: {type: float64}')
    answer = only(analyzed(specification, Question.RT_CONSISTENCY), Question.RT_CONSISTENCY)
    assert answer.reason == 'a comparison relates inputs to their values at earlier steps'


@pytest.mark.parametrize('formulas, conflict', [
    # The third makes runs end sooner, but is not needed.
    ((COUNTED, 'n <= 6', 'Y TRUE -> n >= preInt(0, n) + 3'), ('R0', 'R1')),
    # As comparisons alone, all three conflict; as numbers, the first has no long run.
    ((f'{COUNTED} & n <= 6', 'n <= 6 -> x', 'n <= 6 -> !x'), ('R0',))])
def test_no_part_of_a_conflict_between_steps_conflicts(
        formulas: tuple[str, ...], conflict: tuple[str, ...]) -> None:
    answer = only(analyzed(bundle(*formulas, inputs=COUNTING), Question.CONSISTENCY),
                  Question.CONSISTENCY)
    assert answer.holds is False and answer.conflicts == (conflict,)


def test_a_conflict_whose_parts_are_unknown_is_not_called_smallest(
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checks._PartAnalysis, '_asked', lambda self, question, part: Answer(
        question, part.ids, None))
    answer = only(analyzed(bundle(COUNTED, 'n <= 6', inputs=COUNTING), Question.CONSISTENCY),
                  Question.CONSISTENCY)
    assert answer.holds is False and answer.conflicts == () and not answer.are_all
    assert 'R0, R1 conflict, but perhaps not all of them are needed' in answer.method


@pytest.mark.parametrize(('assumed', 'conflicts', 'text'), [
    ((), (('R0',),), ''),
    (('assume H (b | !b)',), (),
     'R0 cannot be satisfied, or the assumptions contradict each other')])
def test_one_requirement_is_not_called_perhaps_not_needed(
        monkeypatch: pytest.MonkeyPatch, assumed: tuple[str, ...],
        conflicts: tuple[tuple[str, ...], ...], text: str) -> None:
    monkeypatch.setattr(checks._PartAnalysis, '_asked', lambda self, question, part: Answer(
        question, part.ids, None))
    answer = only(analyzed(bundle(
        f'{COUNTED} & n <= 6 & (b | !b)', *assumed, inputs=f'{COUNTING}\n  b: {{type: bool}}'),
        Question.CONSISTENCY), Question.CONSISTENCY)
    assert answer.holds is False and answer.conflicts == conflicts
    assert 'perhaps not all' not in answer.method and text in answer.method


def test_a_comparison_with_earlier_inputs_is_not_said_to_relate_outputs() -> None:
    specification = bundle('H (v - preReal(0.0, v) <= 1.0 | x)', 'H (x -> a)')
    reasons = {item.reason for item in analyzed(specification, Question.RT_CONSISTENCY).answers}
    assert reasons == {'a comparison relates inputs to their values at earlier steps'}


def test_the_value_before_alone_becomes_a_bit() -> None:
    inputs = 'w: {type: float64, role: output}'
    text = [f'  - {{id: R{number}, cocospec: "{item}"}}' for number, item in enumerate((
        'H((0.0 -> pre w) < 5.0 => w > 7.0)', 'H((9.0 -> pre w) > 7.0 => w < 4.0)'))]
    specification = specify(parse_bundle(Source('b.yaml', '\n'.join([
        'format: 1', 'inputs:', f'  {inputs}', 'requirements:', *text]) + '\n'), Path('.')))[0]
    answer = only(analyzed(specification, Question.CONSISTENCY), Question.CONSISTENCY)
    assert answer.holds is False and answer.example is not None
    assert len(answer.example.rows) == 1  # w > 7 and w < 4 are asked for at once


def test_a_product_of_inputs_leaves_what_does_not_depend_on_its_rounding() -> None:
    found = analyzed(bundle('w > v * v', 'w > v', 'H (v * v < -1.0 -> x)'), seconds=30.0)
    assert found.together(Question.CONSISTENCY) is True
    assert found.listed(Question.VACUITY) == found.listed(Question.REDUNDANCY) == ['R2']
    assert {item.holds for item in found.of(Question.REDUNDANCY)} == {True, False}
    assert [item.holds for item in found.of(Question.REALIZABILITY)] == [None, True]


def test_what_nan_violates_is_needed() -> None:
    found = analyzed(bundle(
        'v = v', 'H (Y (v > 1.0 | v <= 1.0) | FTP)', 'w != v | w = v', 'w > 1.0', '!(w <= 1.0)',
        'v > 1.0 -> !(v < 0.5)'))
    assert found.listed(Question.VACUITY) == ['R2', 'R5']
    # R0 at each step is R1 at the next one, and w > 1 is false for NaN, !(w <= 1) true.
    assert found.listed(Question.REDUNDANCY) == ['R1', 'R2', 'R4', 'R5']
    methods = {item.requirements[0]: item.method for item in found.of(Question.REDUNDANCY)}
    assert methods['R3'] == 'NaN violates it alone'
    assert found.of(Question.VACUITY)[5].method.startswith('never violated by finite numbers (')


@pytest.mark.parametrize(('formulas', 'kept'), [
    (['!(v > 1.0)', 'H (!(v <= 1.0) -> x)'], ['R0', 'R1']),
    (['O[1, 1] (v = v) | FTP', 'x'], ['R0', 'R1']),
    (['Y (v = v) | FTP', 'min(v, w) <= w', 'max(w, v) >= w'], ['R2']),
    (['min(w - w, 1.0) <= 1.0', 'max(v, 1.0) >= 1.0'], []),
    (['v > 1.0 -> x', 'v <= 1.0 -> x', 'x'], ['R2'])])
def test_what_nan_violates_beside_the_others_is_needed(
    formulas: list[str], kept: list[str],
) -> None:
    found = analyzed(bundle(*formulas, inputs='{v: {type: float64}, w: {type: float64}, '
                            'x: {type: bool}}'), Question.VACUITY, Question.REDUNDANCY)
    ids = [f'R{number}' for number in range(len(formulas))]
    assert [name for name in ids if name not in found.listed(Question.REDUNDANCY)] == kept


def test_a_product_of_inputs_can_be_violated() -> None:
    found = analyzed(bundle('H (v * u >= 0.0)', inputs='v: {type: float64}\n'
                            '  u: {type: float64}'), Question.REALIZABILITY)
    answer = only(found, Question.REALIZABILITY)
    assert answer.holds is False and answer.example is not None
    assert len(answer.example.rows) == 1


def test_strings_have_the_values_that_the_bundle_names() -> None:
    inputs = 'x: {type: std_msgs/msg/String, topic: t, values: {ON: "on", OFF: "off"}}'
    found = analyzed(bundle('H (x != ON)', 'H (x != OFF)', inputs=inputs), Question.CONSISTENCY)
    assert only(found, Question.CONSISTENCY).conflicts == (('R0', 'R1'),)


# -- bounds ----------------------------------------------------------------------------------

def test_long_bounds_stay_symbolic() -> None:
    found = analyzed(bundle('H (a -> O[0,1000000] x)', 'H (b -> !x)',
                            'H (!(y S[>=100000] b))'), seconds=5.0)
    assert found.together(Question.CONSISTENCY) is True
    assert [item.holds for item in found.of(Question.REALIZABILITY)] == [False, True]


def test_a_thousand_steps_that_have_to_be_counted_are_counted() -> None:
    found = analyzed(bundle('upon a c shall within 1000 ticks satisfy x',
                            'upon b c shall for 1000 ticks satisfy !x'),
                     Question.RT_CONSISTENCY, seconds=20.0)
    answer = only(found, Question.RT_CONSISTENCY)
    assert answer.holds is False
    assert answer.example is not None and len(answer.example.rows) > 1000


TIMED = """format: 1
evaluation: {policy: timed}
inputs: {a: {type: bool}, x: {type: bool, role: output}, y: {type: bool, role: output}}
requirements:
  - {id: T1, fretish: when a the c shall within 10 seconds satisfy x}
  - {id: T2, fretish: when a the c shall for 3 seconds satisfy y}
"""


def timed(more: str = '') -> Specification:
    """Return a bundle with bounds of seconds."""
    return specify(parse_bundle(Source('b.yaml', TIMED + more), Path('.')))[0]


def test_bounds_of_seconds_do_not_matter_where_nothing_waits_for_them() -> None:
    found = analyzed(timed(), Question.CONSISTENCY, Question.REALIZABILITY, seconds=20.0)
    assert found.together(Question.CONSISTENCY) is True
    assert [item.holds for item in found.of(Question.REALIZABILITY)] == [True, True]


def test_where_time_has_to_run_out_the_answer_is_that_on_a_grid(
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checks, '_TIMED_S', 0.5)
    specification = timed('  - {id: T3, fretish: when a the c shall for 12 seconds satisfy !x}\n')
    on_grid = reference(replace(specification, properties=tuple(
        sampled(item, 200_000_000) for item in specification.properties)))
    found = analyze(specification, on_grid, [Question.REALIZABILITY])
    answer = found.answers[0]
    assert answer.requirements == ('T1', 'T3') and answer.holds is None
    assert answer.reason == 'not decided in 0.5 s; if all happens on a grid of 0.2 s, no: T1, T3'
    assert answer.example is not None and answer.example.grid == 200_000_000


def test_runs_on_a_grid_that_real_time_confirms_show_that_timed_requirements_are_needed(
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checks, '_TIMED_S', 20.0)
    reading = read(Path(__file__).parents[2] / 'config' / 'quadrotor.yaml')
    replay = CompiledReplay(reading)
    found = analyze(reading.specification, replay, [Question.VACUITY, Question.REDUNDANCY])
    assert [item.holds for item in found.answers] == [False] * 8
    monkeypatch.setattr(checks, '_TIMED_S', 0.5)
    unconfirmed = analyze(
        reading.specification, lambda rows, spacing: [[True] * 4 for _ in rows],
        [Question.REDUNDANCY])
    assert {item.holds for item in unconfirmed.answers[:2]} == {None}


def test_time_that_runs_out_leaves_partial_answers() -> None:
    found = analyzed(bundle('H (a -> x)', 'H y'), seconds=-1.0)
    assert found.is_partial
    assert {item.reason for item in found.answers} == {'out of time'}
    assert {item.holds for item in found.answers} == {None}


# -- against an explicit search --------------------------------------------------------------

HARD = [f'H (H[0,{9 + n}] a & Y (O[0,{12 + n}] b | x) -> (y | O[0,{9 + n}] x))'
        for n in range(8)]


def test_short_runs_answer_what_is_too_large_for_decision_diagrams(
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checks, '_MANY', 0)
    monkeypatch.setattr(Games, 'consistent', full)
    specification = bundle('H (a -> x)', 'H (b -> !x)', 'H (x -> Y a | a)', 'H x | b')
    found = analyzed(specification, Question.CONSISTENCY, Question.RT_CONSISTENCY,
                     Question.VACUITY, Question.REDUNDANCY)
    assert found.together(Question.CONSISTENCY) is True
    assert [item.holds for item in found.of(Question.VACUITY)] == [False] * 4
    assert [item.holds for item in found.of(Question.REDUNDANCY)] == [False] * 4
    unknown = only(found, Question.RT_CONSISTENCY)
    assert unknown.holds is None and 'too much memory' in unknown.reason


def full(self: Games, requirements: list[int]) -> Descent:
    """Behave as CUDD where its memory is full."""
    raise ValueError('`DdNode *node` is `NULL` pointer.')


def test_the_memory_of_decision_diagrams_is_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(diagrams, '_LEAST_BYTES', 2 ** 20)
    monkeypatch.setattr(diagrams, '_MEMORY_BYTES', 2 ** 20)
    gc.collect()
    found = only(analyzed(bundle(*HARD), Question.RT_CONSISTENCY), Question.RT_CONSISTENCY)
    assert found.holds is None and 'too much memory' in found.reason
    # They are freed at once: the garbage collector frees them in an order that dd reports.
    assert not any(type(item).__name__ == 'BDD' for item in gc.get_objects())


def test_an_interrupt_leaves_the_answers_that_are_known(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checks, '_MANY', 0)
    specification, deadline = bundle('H (a -> x)', 'H (a -> y)'), Deadline(None)

    def interrupted(rows: Sequence[Row], spacing: int) -> list[list[bool]]:
        deadline.is_interrupted = True
        return reference(specification)(rows, spacing)

    found = analyze(specification, interrupted, list(Question), deadline=deadline)
    assert found.together(Question.CONSISTENCY) is True and found.is_partial
    assert {item.reason for item in found.answers if item.holds is None} == {'interrupted'}


@pytest.mark.parametrize('seed', strategies.some(range(400, 408), 3))
def test_short_runs_give_the_same_answers(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    specification = random_bundle(seed)
    expected = analyzed(specification)
    monkeypatch.setattr(checks, '_MANY', 0)
    found = analyzed(specification)
    assert [(item.question, item.requirements, item.holds) for item in found.answers] \
        == [(item.question, item.requirements, item.holds) for item in expected.answers]


def formula(rng: Random, depth: int) -> str:
    """Return a random formula over a, b, x, y."""
    if depth == 0:
        return rng.choice('abxy')
    left = formula(rng, depth - 1)
    right = formula(rng, rng.randrange(depth))
    low = rng.randrange(3)
    window = f'[{low},{low + rng.randrange(3)}]'
    return rng.choice([
        f'(!{left})', f'({left} & {right})', f'({left} -> {right})', f'({left} <-> {right})',
        f'(Y {left})', f'(Z {left})', f'(O {left})', f'(H {left})', f'(O{window} {left})',
        f'(H{window} {left})', f'({left} S {right})', f'({left} S{window} {right})', '(FTP)',
        f'({left} S[>=2] {right})', f'({left} T {right})'])


INPUTS = 'a: {type: bool}\n  b: {type: bool}\n  x: {type: bool, role: output}\n' \
    '  y: {type: bool, role: output}'


def random_bundle(seed: int, most: int = 40) -> Specification:
    """
    Return some random requirements, sometimes with assumptions, over all four inputs.

    They have up to `most` states.
    """
    rng = Random(seed)
    while True:
        found = bundle(*random_formulas(rng), inputs=INPUTS)
        with suppress(TooManyStates):
            Search(found, most)
            return found


def random_formulas(rng: Random) -> Iterator[str]:
    """Yield some random requirements, and perhaps assumptions."""
    for _ in range(rng.randint(1, 2)):
        text = f'(a | b | x | y | TRUE) & {formula(rng, 2)}'
        yield f'H ({text})' if rng.random() < 0.7 else text
    yield eventually(rng) if rng.random() < 0.4 else f'H ({formula(rng, 1)})'
    if rng.random() < 0.3:  # the environment fulfils it, but the system could prevent it
        name = rng.choice('ab')
        yield f'assume H (Y {rng.choice("xy")} -> !{name})'
        yield f'assume whenever !{name} the c shall eventually satisfy {name}'
    if rng.random() < 0.2:
        sentence = eventually(rng)
        yield from (sentence, f'assume {sentence}')
    if rng.random() < 0.2:  # a dead end, and what avoids it
        name = rng.choice('abxy')
        yield f'H (Y {name} -> {formula(rng, 1)} & FALSE)'
        yield f'H (!{name} | {formula(rng, 1)})'
    for _ in range(rng.choice((0, 0, 1, 2))):
        yield 'assume ' + (eventually(rng) if rng.random() < 0.3 else
                           f'H ({formula(rng, 1)} | {rng.choice("abxy")})')


def eventually(rng: Random) -> str:
    """Return a random sentence that says `eventually`."""
    trigger, response = rng.choices(('a', 'b', 'x', 'y', 'a & !x', '!b & y', 'x | b', '!x'), k=2)
    when = rng.choice(('', f'when {trigger} ', f'whenever {trigger} '))
    return f'{when}the c shall eventually satisfy {response}'


# The last seeds have assumptions that the system could prevent, and violations in dead ends.
@pytest.mark.parametrize('seed', [*strategies.some(range(30), 3), 1004, 1034])
def test_answers_are_those_of_an_explicit_search(seed: int) -> None:
    specification = random_bundle(seed)
    search = Search(specification)
    number = len(specification.properties)
    required = [place for place in range(number) if place not in search.assumed]
    part = Part(specification.properties)
    component = build_component(specification, part, None, Deadline(30.0))
    games = component.games
    good = search.consistent(required)
    second = SecondCheck(component.group, component.inputs, games)
    everything = games.diagrams.bdd.true
    if second.wins(everything, required, is_game=True) is solver.ProofAnswer.PROVED:
        assert games.realizable(set(required) - games.pending).last == everything
    assert games.consistent(required).holds is (search.start in good)
    assert games.realizable(required, trusts_linked=True).holds is (
        search.start in search.realizable(required, search.assumed))
    assert games.realizable(required).holds is (
        search.start in search.realizable(required, search.of_environment))
    if search.start in good:
        found = [item.holds for item in analyzed(specification, Question.RT_CONSISTENCY).answers]
        assert (False not in found) is (search.reached(required) <= good)
    elif search.start in search.consistent(()):
        assert analyzed(specification, Question.REALIZABILITY).together(
            Question.REALIZABILITY) is not True
    for item, answer in enumerate(analyzed(specification, Question.REDUNDANCY).answers):
        assert 'internal error' not in answer.reason
        if item in required and answer.holds is not None:
            others = [each for each in required if each != item]
            assert answer.holds is not search.can_fail_alone(item, others)


@pytest.mark.parametrize('seed', strategies.some(range(60, 72), 3))
def test_all_runs_are_confirmed_and_conflicts_are_smallest(seed: int) -> None:
    specification = random_bundle(seed)
    ids = [item.id for item in specification.properties]
    search = Search(specification)
    for answer in analyzed(specification).answers:
        assert 'once' not in answer.method or search.pending
        assert answer.holds is not None or 'no run satisfies' in answer.reason \
            or 'exclude' in answer.reason or 'contradict' in answer.reason \
            or 'eventually' in answer.reason
        if 'contradict' in answer.reason + answer.method:
            assert search.start not in search.consistent(())
            continue
        is_game = answer.question is Question.REALIZABILITY
        for conflict in answer.conflicts:
            chosen = [ids.index(item) for item in conflict]
            assert conflicts(search, chosen, is_game)
            assert not any(conflicts(search, [each for each in chosen if each != item], is_game)
                           for item in chosen)


def conflicts(search: Search, chosen: Sequence[int], is_game: bool) -> bool:
    """Whether some requirements exclude one another, or with `is_game` cannot be realized."""
    return search.start not in search.consistent(chosen) or \
        is_game and search.start not in search.realizable(chosen, search.assumed)


@pytest.mark.parametrize('seed', strategies.some(range(300, 312), 3))
def test_a_divided_bundle_has_the_same_answers(
        seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = Random(seed)
    specification = bundle(*(f'H ((a | {out} | TRUE) & {formula(rng, 2)})'.translate(
        str.maketrans('xy', out * 2)) for out in 'xxyy'), 'H (b -> O[0,2] !b)', inputs=INPUTS)
    whole = analyzed(specification)
    monkeypatch.setattr(division, '_SMALL', 0)
    divided = analyzed(specification)
    for question in (Question.CONSISTENCY, Question.RT_CONSISTENCY, Question.REALIZABILITY):
        assert divided.together(question) is whole.together(question)
    if whole.together(Question.CONSISTENCY):
        for question in (Question.VACUITY, Question.REDUNDANCY):
            assert sorted(divided.listed(question)) == sorted(whole.listed(question))


def test_a_realizable_bundle_wins_against_random_inputs() -> None:
    rng, wins, broken = Random(5), 0, 0
    relying = [bundle(*texts, inputs=INPUTS) for texts in (
        ('H (a -> x)', 'assume H (a | b)'), ('H x & H (Y TRUE -> a)', 'assume H (Y x -> a)'),
        ('H (FTP | (a <-> b))', 'H !y', 'assume H (Y !y -> (a <-> b))'))]
    for specification in [*map(random_bundle, range(100, 170)), *relying]:
        for part in by_outputs(specification):
            component = build_component(specification, part, None, Deadline(30.0))
            games, d = component.games, component.games.diagrams
            found = games.realizable(component.required)
            if not found.holds:
                continue
            wins += 1
            runner = Runner(games)
            good, is_broken = games.good(component.required, d.before(found.last)), False
            while len(runner.steps) < 15 and not is_broken:
                inputs = d.bdd.cube({name: rng.random() < 0.5 for name in d.environment})
                is_broken = not runner.can(inputs & ~games.excused)
                runner.take(good & inputs)
            names = [signal.name for signal in component.signals]
            rows = [tuple(bool(row.get(item, False)) for item in component.inputs)
                    for row in runner.rows()]
            columns = [[bool(row[names.index(item.name)]) if item.name in names else False
                        for item in specification.signals] for row in rows]
            judged = [specification.properties.index(item) for place, item
                      in enumerate(part.properties) if place not in games.pending]
            *lines, last = reference(specification)([tuple(row) for row in columns], 1)
            assert all(line[place] for line in lines for place in judged)
            if not is_broken:
                assert all(last[place] for place in judged)
                continue
            broken += 1  # an assumption, and no choice of the outputs would have kept it
            assumed = [place for place in judged if specification.properties[place].is_assumption]
            for own in product((False, True), repeat=2):
                columns[-1][2:] = own
                line = reference(specification)([tuple(row) for row in columns], 1)[-1]
                assert not all(line[place] for place in assumed)
    assert wins >= 8 and broken >= 3


def test_what_is_redundant_holds_on_random_traces_where_the_others_do() -> None:
    rng, tried = Random(6), 0
    for seed in range(200, 225):
        specification = random_bundle(seed)
        found = analyzed(specification, Question.REDUNDANCY)
        ids = [item.id for item in specification.properties]
        for name in found.listed(Question.REDUNDANCY):
            tried += 1
            place = ids.index(name)
            for _ in range(20):
                rows = [tuple(rng.random() < 0.5 for _ in range(4)) for _ in range(8)]
                for line in reference(specification)(rows, 1):
                    if not all(value for number, value in enumerate(line) if number != place):
                        break
                    assert line[place]
    assert tried >= 3
