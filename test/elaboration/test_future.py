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


"""Bounded future (`mltl`) becomes a formula of the past with the verdicts of its definition."""

from pathlib import Path
from random import Random

from fret_monitor.bundle.reader import parse_bundle
from fret_monitor.elaboration.elaborate import specify
from fret_monitor.logic.evaluate import evaluate
from fret_monitor.logic.formula import Formula, Once, postorder
from fret_monitor.logic.specification import Property
from fret_monitor.logic.timed import evaluate_timed, TimedTrace, value_at
from fret_monitor.model.diagnostics import CompileError, Source
import golden
import mltl
import pytest
from stages import read_bundle

NAMES = ('p', 'q', 'r')
INPUTS = 'inputs:\n' + ''.join(
    f'  {name}: {{topic: {name}, type: std_msgs/msg/Bool, max_rate: 1000000000}}\n'
    for name in NAMES)
TIMED = 'evaluation: {policy: timed}\n'


def specified(text: str, before: str = '') -> Property:
    whole = f'format: 1\n{before}{INPUTS}requirements: [{{id: A, mltl: "{text}"}}]\n'
    return specify(parse_bundle(Source('bundle.yaml', whole), Path()))[0].properties[0]


@pytest.mark.parametrize('seed', range(8))
def test_random_formulas_have_the_verdicts_of_the_definition_at_steps(seed: int) -> None:
    rng = Random(seed)
    for _ in range(25):
        tree = mltl.random_tree(rng, rng.randrange(1, 5), NAMES, 5)
        columns = mltl.random_columns(rng, NAMES, 40)
        found = specified(mltl.text(tree))
        assert found.horizon == mltl.horizon(tree)
        assert evaluate(found.formula, columns) == mltl.verdicts(tree, columns), mltl.text(tree)


@pytest.mark.parametrize('seed', range(4))
def test_random_formulas_have_the_verdicts_of_the_definition_at_nanoseconds(seed: int) -> None:
    rng = Random(seed)
    for _ in range(12):
        tree = mltl.random_tree(rng, rng.randrange(1, 4), NAMES, 6)
        columns = mltl.random_columns(rng, NAMES, 50)
        found = specified(mltl.text(tree, 'ns'), TIMED)
        trace = TimedTrace([*range(50)], columns, 49)
        history, = evaluate_timed([found.formula], trace, found.feedback)
        assert [value_at(history, t) for t in range(50)] == mltl.verdicts(tree, columns), \
            mltl.text(tree)


@pytest.mark.parametrize(('text', 'horizon', 'same'), [
    ('G[2,5] p', 5, 'O[>=5] TRUE -> H[0,3] p'),
    ('F[2,5] p', 5, 'O[>=5] TRUE -> O[0,3] p'),
    ('X p', 1, 'O[>=1] TRUE -> p'),
    ('p -> F[0,4] q', 4, 'O[=4] p -> O[0,4] q'),
    ('!(p & F[0,4] q)', 4, '!(O[=4] p & O[0,4] q)'),
    ('!p | F[0,4] q', 4, 'O[>=4] TRUE -> (O[=4] !p | O[0,4] q)'),
    ('p | F[0,4] q', 4, 'O[>=4] TRUE -> (O[=4] p | O[0,4] q)'),
    ('(p -> F[0,4] q) & X p', 4, 'O[>=4] TRUE -> ((O[=4] p -> O[0,4] q) & O[=3] p)'),
    ('(p -> F[0,4] q) & (q -> F[2,4] p)', 4,
     '(O[=4] p -> O[0,4] q) & (O[=4] q -> O[0,2] p)'),
    ('G[0,2] F[0,3] p', 5, 'O[>=5] TRUE -> H[0,2] O[0,3] p'),
    ('p & O q', 0, 'p & O q'),
    ('H F[0,4] q', 4, 'H (O[>=4] TRUE -> O[0,4] q)'),
])
def test_simple_formulas_are_those_that_one_would_write(text: str, horizon: int,
                                                        same: str) -> None:
    found = specified(text)
    expected = specified(same)
    assert (found.horizon, found.formula) == (horizon, expected.formula)


def test_both_spellings_are_read() -> None:
    frets = specified('(FTP -> ((p R[<=3] (! q)) & (F[=4] r)))')
    c2po = specified('FTP -> ((p R[0,3] !q) && F[4,4] r)')
    assert frets.formula is c2po.formula
    assert specified('p V[0,3] q').formula is specified('p R[0,3] q').formula


def bits(root: Formula) -> int:
    """Return the steps that windows of one step are ago, which are a bit each."""
    return sum(node.window.low for node in postorder([root]) if isinstance(node, Once)
               and node.window.low == node.window.high)


@pytest.mark.parametrize('steps', [1, 2, 5, 100, 1000, 2 ** 20 - 1, 2 ** 20, 10 ** 9])
def test_until_is_a_formula_of_logarithmic_size_with_two_bits_a_step(steps: int) -> None:
    root = specified(f'p U[0,{steps}] q').formula
    assert len(postorder([root])) < 12 * steps.bit_length()
    assert bits(root) <= 2 * steps


@pytest.mark.parametrize('case', golden.cases('mltl'), ids=lambda path: path.stem)
def test_mistakes_are_reported_with_what_to_write(case: Path,
                                                  monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(case.parent)
    with pytest.raises(CompileError) as caught:
        specify(read_bundle(Path(case.name)))
    golden.check(case, f'{caught.value}\n')
