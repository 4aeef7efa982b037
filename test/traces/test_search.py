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
"""The examples that `explain` finds, checked by the reference semantics."""

from pathlib import Path
from random import Random

from explain.examples import bundle, examined, reference
import facts
from fret_monitor.bundle.reader import parse_bundle
from fret_monitor.elaboration.elaborate import specify
from fret_monitor.explain.in_time import confirmed
from fret_monitor.logic.evaluate import verdicts
from fret_monitor.logic.finality import is_final
from fret_monitor.model.diagnostics import Source
from fret_monitor.traces import explore, search
from fret_monitor.traces.sampled import grid_of, sampled
from fret_monitor.traces.search import Budget, Examples, find_examples, Recovery
from fret_monitor.traces.subject import Subject, subjects
from fret_monitor.traces.trace import length
import pytest
import strategies
from strategies import some

FORMULAS = (
    'H (p -> O[0,3] q)', 'p S[2,9] q', 'O p', 'H (x > 3.5 & y < 2.0 -> q)', 'x + y > 3.5',
    'H (mode = LANDING -> Y (mode = IDLE))', 'H[0,5] (n > 3)', '(Y p) | q', 'H (H[0,300] p -> q)',
    'abs(x - preReal(x, x)) < 0.5', 'p T q', 'FTP | (p xor q)', 'H (O[12,12] p -> O[0,11] q)',
)


@pytest.fixture(autouse=True)
def small_budget(monkeypatch: pytest.MonkeyPatch) -> None:
    """
    Let a requirement take a tenth of the steps.

    What can be found here is found in these; where there is nothing to find, they are all taken.
    """
    monkeypatch.setattr(search, '_LARGE', 30_000)


def check(subject: Subject, found: Examples) -> None:
    """Check each claim by the reference semantics."""
    if found.satisfying is not None:
        assert reference(subject, found.satisfying)[-1]
    if found.violating is not None:
        assert not reference(subject, found.violating)[-1]
    if found.recovering is not None:
        assert reference(subject, found.recovering)[-2:] == [False, True]
    assert (found.recovering is not None) == (found.recovery is Recovery.POSSIBLE)


def test_examples_satisfy_and_violate_as_claimed(tmp_path: Path) -> None:
    for subject, found in examined(bundle(tmp_path, *FORMULAS)):
        check(subject, found)
        assert found.satisfying is not None, subject.item.text
        assert found.violating is not None, subject.item.text


def test_examples_of_random_formulas_satisfy_and_violate_as_claimed() -> None:
    rng = Random(4)
    properties = [strategies.random_property(rng, f'R{number}', size=14, reach=9, loops=number % 3)
                  for number in range(40)]
    specification = strategies.specification_of(properties)
    budget = Budget()
    violated = 0
    for subject in subjects(specification, properties):
        found = find_examples(subject, budget)
        check(subject, found)
        violated += found.violating is not None
        columns = strategies.random_trace(rng, strategies.INPUTS, 40)
        truth = verdicts(subject.item.formula, columns, subject.item.feedback)
        if found.recovery in (Recovery.FINAL_BY_FORM, Recovery.FINAL_BY_STATES):
            assert sorted(truth, reverse=True) == truth, subject.item.id
        if found.recovery is Recovery.NEVER_FALSE:
            assert all(truth), subject.item.id
        if found.is_proved and found.satisfying is None:
            assert not any(truth), subject.item.id
    assert violated > 10


def test_formulas_that_are_final_by_their_form_never_recover() -> None:
    rng = Random(2)
    tried = 0
    for _ in range(1500):
        formula = strategies.random_formula(rng, strategies.INPUTS[:4], size=9)
        if not is_final(formula):
            continue
        for _ in range(4):
            columns = strategies.random_trace(rng, strategies.INPUTS[:4], 25)
            truth = verdicts(formula, columns)
            assert sorted(truth, reverse=True) == truth
            tried += True in truth and False in truth
    assert tried > 50


@pytest.mark.parametrize(('formula', 'recovery'), [
    ('H (p -> q)', Recovery.FINAL_BY_FORM),
    ('H p & (O q -> Z (H r))', Recovery.FINAL_BY_FORM),
    ('(H p) S (H q)', Recovery.FINAL_BY_FORM),
    ('p S (p & FTP)', Recovery.FINAL_BY_STATES),
    ('p & Y (H (p | n < 3 | n >= 3)) | FTP & p', Recovery.POSSIBLE),
    ('p | !p', Recovery.NEVER_FALSE),
    ('O[0,5] p', Recovery.POSSIBLE),
    ('x > 1.0 | x <= 1.0', Recovery.POSSIBLE),  # nan is neither
    ('n > 1 | n <= 1', Recovery.NEVER_FALSE),
    ('n + n > 1 | n + n <= 1', Recovery.NONE_FOUND),  # sums are not proved
])
def test_recovery_is_reported_as_the_formula_behaves(
    formula: str, recovery: Recovery, tmp_path: Path,
) -> None:
    (_, found), = examined(bundle(tmp_path, formula))
    assert found.recovery is recovery


def test_a_satisfying_example_has_its_trigger(tmp_path: Path) -> None:
    (subject, found), = examined(bundle(tmp_path, 'H (H[0,6] p & H[0,5] !FTP -> O[0,2] q)'))
    assert found.satisfying is not None
    assert sum(run.steps for run in found.satisfying if run.row[0] is True) >= 7
    assert reference(subject, found.satisfying)[-1]


def test_a_violating_example_is_as_short_as_possible(tmp_path: Path) -> None:
    (_, found), = examined(bundle(tmp_path, 'H (H[0,6] p & H[0,5] !FTP -> q)'))
    assert found.violating is not None
    # Seven steps to the first false verdict, and two more to show what follows.
    assert (len(found.violating), length(found.violating)) == (1, 9)


def test_a_bound_that_no_trace_reaches_proves_nothing(tmp_path: Path) -> None:
    (_, found), = examined(bundle(tmp_path, 'H !(H[0,2000000000] p & H[0,1999999999] !FTP)'))
    assert found.violating is None
    assert not found.is_proved


def test_the_same_bundle_gives_the_same_examples(tmp_path: Path) -> None:
    path = bundle(tmp_path, *FORMULAS)
    assert [found for _, found in examined(path)] == [found for _, found in examined(path)]


def test_the_72_template_keys_whose_false_means_not_yet_recover(tmp_path: Path) -> None:
    templates = facts.templates()
    path = tmp_path / 'templates.yaml'
    keys = ['-'.join((item['scope'], item['condition'], item['timing'])) for item in templates]
    path.write_text(
        'format: 1\ninputs: {m: {type: bool}, c: {type: bool}, s: {type: bool}, r: {type: bool}}\n'
        'requirements:\n' + ''.join(
            f'  - {{id: "{key}", ptltl: "{item["ptltl"]}"}}\n'
            for key, item in some([*zip(keys, templates, strict=True)][::4])), encoding='utf-8')
    for subject, found in examined(path):
        scope, _, timing = subject.item.id.split('-')
        late = ('always', 'never', 'finally') if scope.startswith('only') else (
            'eventually', 'null', 'finally')
        assert (found.recovery is Recovery.POSSIBLE) == (timing in late), subject.item.id
        assert found.satisfying is not None
        assert found.violating is not None


@pytest.mark.parametrize('alone', [
    'abs(derivative(x)) <= 2', 'meanOver(4 s, x) <= 9', 'sumOver(4 s, x) <= 9',
    'maxOver(4 s, x) <= 9', 'minOver(4 s, x) <= 9', 'abs(changeOver(4 s, x)) <= 2',
    'countOver(4 s, x > 9) <= 3', 'timeOver(4 s, x > 9) <= 2', 'heldAt(x > 9, x) <= 12',
])
def test_examples_of_a_function_over_time_hold_in_real_time(alone: str) -> None:
    specification, _ = specify(parse_bundle(Source('b.yaml', (
        'format: 1\nevaluation: {policy: timed}\ninputs: {x: {type: float64, max_rate: 20}}\n'
        f'requirements: [{{id: A, ptltl: "{alone}"}}]\n')), Path()))
    item, = specification.properties
    subject, = subjects(specification, [sampled(item, grid_of(item))])
    found = confirmed(item, subject, find_examples(subject, Budget()), grid_of(item))
    assert found.satisfying and found.violating
    assert found.recovering or alone.startswith('timeOver')  # that lasts a nanosecond longer


def test_a_search_keeps_no_more_states_than_memory_allows(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    formula = '!(O[299,300] p)'  # each of the last 300 steps may have been true or false
    (_, whole), = examined(bundle(tmp_path, formula))
    monkeypatch.setattr(explore, '_MOST_BYTES', 10_000)
    (subject, found), = examined(bundle(tmp_path, formula))
    size = len(subject.trials.start())
    assert whole.states * size > 20_000 > found.states * size
    check(subject, found)
