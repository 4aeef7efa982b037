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

"""The reference of the test of a probability, against its formula with logarithms."""

from fractions import Fraction
from math import log
from random import Random

from fret_monitor.logic.formula import NotRefuted, Variable
from fret_monitor.logic.trials import Product, SequentialTest
from fret_monitor.model.probability import Probability
from fret_monitor.model.values import ValueType
import pytest
from strategies import IS_THOROUGH

OUTCOME = Variable('outcome', ValueType.INT64)
UNIT_LOG = 64 * log(2)


def node(bound: str, relation: str = '>', confidence: str = '0.999') -> NotRefuted:
    asked = Probability(relation, Fraction(bound), Fraction(confidence))
    return NotRefuted(OUTCOME, asked.allowed, asked.rest, asked.limit)


def logarithm(product: Product) -> float:
    return log(product.part) + product.units * UNIT_LOG


class Formula:
    """The test as it is written in docs/probability.md, with logarithms."""

    def __init__(self, p: float) -> None:
        self.p, self.n, self.s = p, 0, 0
        self.against = self.in_favour = 0.0

    def take(self, has_failed: bool) -> None:
        p, n, s, kappa = self.p, self.n, self.s, 1 / self.p
        m = min(2 * p, (1 + p) / 2)
        above = max(p, (s + m * kappa) / (n + kappa))
        below = min(p, (s + kappa * p / 2) / (n + kappa))
        self.against += log(above / p) if has_failed else log((1 - above) / (1 - p))
        self.in_favour += log(below / p) if has_failed else log((1 - below) / (1 - p))
        self.n, self.s = n + 1, s + has_failed


@pytest.mark.parametrize('bound', ['0.98', '0.5', '0.999', '0.1', '0.9999'])
@pytest.mark.parametrize('times', [0.0, 0.5, 1.0, 3.0])
def test_the_evidence_is_that_of_the_formula_at_each_step(bound: str, times: float) -> None:
    rng = Random(f'{bound} {times}')
    test, formula = SequentialTest(node(bound)), Formula(1 - float(bound))
    for _ in range(3000):
        has_failed = rng.random() < min(0.99, times * formula.p)
        test.take(-1 if has_failed else 1)
        formula.take(has_failed)
        for product, wanted in ((test.against, formula.against),
                                (test.in_favour, formula.in_favour)):
            assert logarithm(product) == pytest.approx(wanted, abs=1e-8, rel=1e-9)
    assert (test.trials, test.events) == (formula.n, formula.s)


@pytest.mark.parametrize('bound', ['0.000001', '0.5', '0.999999'])
def test_many_trials_neither_overflow_nor_underflow(bound: str) -> None:
    rng = Random(bound)
    for share in (0.0, 1.0 - float(bound), 1.0):
        test = SequentialTest(node(bound))
        for _ in range(200_000 if IS_THOROUGH else 20_000):
            test.take(-1 if rng.random() < share else 1)
        for product in (test.against, test.in_favour, test.likelihood):
            assert 1.0 <= product.part < 2.0 ** 64
            assert abs(product.units) < 10 ** 6


def test_a_verdict_is_final() -> None:
    test = SequentialTest(node('0.98'))
    assert [test.take(-1) for _ in range(6)] == [True] * 5 + [False]
    assert not any(test.take(1) for _ in range(5000))
    assert test.verdict == -1 and test.trials == 5006
    test = SequentialTest(node('0.98'))
    count = next(n for n in range(1, 5000) if test.take(1) and test.verdict)
    assert test.verdict == 1
    assert all(test.take(-1) for _ in range(500))
    assert 340 < count < 800  # log(1000) / 0.02 = 345 with the best prediction


def test_a_step_without_a_trial_changes_nothing() -> None:
    test = SequentialTest(node('0.98'))
    test.take(-1)
    before = test.against.part
    assert test.take(0)
    assert (test.trials, test.events, test.against.part) == (1, 1, before)


def test_an_upper_bound_counts_successes() -> None:
    asked = Probability('<', Fraction('0.02'), Fraction('0.999'))
    assert asked.counts_successes
    assert (asked.allowed, asked.rest) == (0.02, 0.98)
    assert Probability('>', Fraction('0.98'), Fraction('0.999')).allowed == 0.02
