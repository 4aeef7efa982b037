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

"""Compiled trials and tests of probabilities against the reference, on steps and on ticks."""

from fractions import Fraction
from itertools import product
from random import Random

from differential.compiled import clang, Compiled, gcc, reference
from differential.timed_monitor import TimedMonitor
from fret.sentences import INPUTS, parse, sentence_for
from fret_monitor.elaboration.durations import STEPS, TimeScale
from fret_monitor.elaboration.fretish import sentence_term
from fret_monitor.elaboration.terms import formula_of
from fret_monitor.logic.formula import Binary, BinaryOperator, Constant, Formula, NotRefuted, Trial
from fret_monitor.logic.specification import Property
from fret_monitor.logic.timed import evaluate_timed, TimedTrace
from fret_monitor.model.diagnostics import Problems
from fret_monitor.model.policies import Policy
from fret_monitor.model.values import ValueType
import pytest
from stages import scope_of
from strategies import property_of, specification_of, thorough

_SCOPES = ('null', 'in', 'notin', 'before', 'after', 'onlyIn', 'onlyBefore', 'onlyAfter')
_TIMINGS = ('immediately', 'next', 'always', 'eventually', 'finally', 'until', 'before', 'within',
            'for', 'after')
SECOND = 10 ** 9


def not_refuted(key: tuple[str, str, str], scale: TimeScale, rng: Random) -> NotRefuted | None:
    """Return the formula of a sentence with a template key; None if it is refused."""
    relation = rng.choice(('> 0.8', '>= 0.5', '< 0.3', '<= 0.9', '> 0.999'))
    text = sentence_for(key, 3).replace('shall', f'shall with probability {relation}')
    if scale.is_timed:
        text = text.replace('ticks', 'seconds')
    problems = Problems()
    confidence = Fraction(rng.choice(('0.5', '0.8', '0.99')))
    term = sentence_term(parse(text), scope_of(INPUTS), problems, scale, confidence)
    if problems.errors:
        return None
    formula = formula_of(term)
    assert isinstance(formula, NotRefuted)
    return formula


def trial_of(formula: NotRefuted) -> Formula:
    found = formula.argument
    while not isinstance(found, Trial):
        found = found.argument  # type: ignore[union-attr]
    return found


def properties(conditions: tuple[str, ...], scale: TimeScale = STEPS) -> list[Property]:
    """Return requirements: of each template the test, and what is decided at each step."""
    rng = Random(7)
    found: list[Formula] = []
    for key in product(_SCOPES, conditions, _TIMINGS):
        formula = not_refuted(key, scale, rng)
        if formula is not None:
            found += [formula, *(
                Binary(BinaryOperator.NE, trial_of(formula), Constant(value, ValueType.INT64))
                for value in (1, -1))]
    return [property_of(f'R-{number}', item) for number, item in enumerate(found)]


def stretches(rng: Random, steps: int, most: int = 5) -> list[bool]:
    found: list[bool] = []
    while len(found) < steps:
        found += [rng.random() < 0.5] * rng.randint(1, most)
    return found[:steps]


@pytest.mark.parametrize('chosen', [gcc, pytest.param(clang, marks=thorough)])
def test_tests_of_every_template_agree_with_the_reference(chosen: object) -> None:
    compiler = chosen()  # type: ignore[operator]
    if compiler is None:
        pytest.skip('no such compiler')
    items = properties(('null', 'regular', 'holding'))
    assert len(items) > 600
    compiled = Compiled(specification_of(items, INPUTS), compiler=compiler)
    rng = Random(8)
    turned = 0
    for _ in range(3):
        trace = {name: stretches(rng, 500) for name in 'mcrs'}
        found = compiled.run(trace)
        assert found == reference(items, trace)
        turned += sum(any(column) and not column[-1] for column in found[::3])
    assert turned > 60  # tests that were refuted


def test_it_has_no_undefined_behaviour() -> None:
    items = properties(('regular',))[:60]
    compiled = Compiled(specification_of(items, INPUTS), compiler=gcc(),
                        flags=('-std=c99', '-fPIC', '-fsanitize=undefined',
                               '-fno-sanitize-recover=all', '-O0'))
    rng = Random(9)
    trace = {name: stretches(rng, 300) for name in 'mcrs'}
    assert compiled.run(trace) == reference(items, trace)


def test_a_reset_begins_trials_and_tests_afresh() -> None:
    items = properties(('null', 'regular'))[:120]
    compiled = Compiled(specification_of(items, INPUTS))
    rng = Random(10)
    first, second = ({name: stretches(rng, 90) for name in 'mcrs'} for _ in range(2))
    both = {name: first[name] + second[name] for name in 'mcrs'}
    found = compiled.run(both, resets=(90,))
    expected = [[*one, *other] for one, other in zip(
        reference(items, first), reference(items, second), strict=True)]
    assert found == expected


def test_timed_tests_of_every_template_agree_with_the_reference() -> None:
    items = properties(('null', 'regular'), TimeScale(Policy.TIMED))
    assert len(items) > 350
    monitor = TimedMonitor(specification_of(items, INPUTS, Policy.TIMED))
    rng = Random(11)
    turned = 0
    for _ in range(3):
        gaps = [rng.choice((1, 2, SECOND // 3, SECOND, 3 * SECOND)) for _ in range(150)]
        ticks = [sum(gaps[:place]) for place in range(len(gaps))]
        trace = TimedTrace(ticks, {name: stretches(rng, len(gaps), 3) for name in 'mcrs'},
                           ticks[-1] + 9 * SECOND)
        found = monitor.run(trace).verdicts
        expected = evaluate_timed([item.formula for item in items], trace)
        assert found == expected
        turned += sum(len(history) > 1 for history in found[::3])
    assert turned > 30


@thorough
@pytest.mark.parametrize(('sentence', 'rate'), [
    ('upon c the x shall {} within 3 ticks satisfy r', 1 - 0.1 ** 0.25),
    ('whenever c the x shall {} for 2 ticks satisfy r', 0.9 ** (1 / 3)),
    ('upon c the x shall {} immediately satisfy r', 0.9),
    ('in m mode whenever c the x shall {} within 3 ticks satisfy r', 1 - 0.1 ** 0.25)])
def test_of_2000_runs_with_overlapping_triggers_few_are_ever_refuted(
        sentence: str, rate: float) -> None:
    problems, error, runs, steps = Problems(), 0.1, 2000, 300
    formula = formula_of(sentence_term(
        parse(sentence.format('with probability > 0.9')), scope_of(INPUTS), problems, STEPS,
        Fraction('0.9')))
    assert not problems.errors and isinstance(formula, NotRefuted)
    formulas: list[Formula] = [formula, *(
        Binary(operator, trial_of(formula), Constant(value, ValueType.INT64))
        for operator, value in ((BinaryOperator.NE, -1), (BinaryOperator.EQ, 0)))]
    compiled = Compiled(specification_of([
        property_of(f'R-{number}', item) for number, item in enumerate(formulas)], INPUTS))
    rng = Random(sentence)
    count = runs * steps
    trace = {'m': stretches(rng, count, 40), 's': [False] * count,
             'c': [rng.random() < 0.5 for _ in range(count)],
             'r': [rng.random() < rate for _ in range(count)]}
    verdicts, not_failed, undecided = compiled.run(trace, [*range(0, count, steps)])
    refuted = sum(not verdict for verdict in verdicts[steps - 1::steps])
    trials, failures = undecided.count(False), not_failed.count(False)
    assert trials > 40 * runs and trials < trace['c'].count(True)
    if 'mode' not in sentence:  # where the mode ends, the trial succeeds
        assert abs(failures / trials - 0.1) < 4 * (0.1 * 0.9 / trials) ** 0.5
    assert refuted / runs <= error + 4 * (error * (1 - error) / runs) ** 0.5
