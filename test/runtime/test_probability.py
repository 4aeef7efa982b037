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

"""The test of a probability in C against the reference, bit for bit, and its interval."""

from fractions import Fraction
from itertools import islice
from math import isclose, lgamma, log
from random import Random
from statistics import mean

from fret_monitor.logic.formula import NotRefuted, Variable
from fret_monitor.logic.trials import Product, SequentialTest
from fret_monitor.model.probability import Probability
from fret_monitor.model.values import ValueType
from fret_monitor.runtime.probability import outcomes_of, PooledTest, runs_of
import pytest
from strategies import thorough


def asked(required: str, confidence: str = '0.999') -> Probability:
    relation, bound = required.split()
    return Probability(relation, Fraction(bound), Fraction(confidence))


def reference(of: Probability) -> SequentialTest:
    return SequentialTest(NotRefuted(Variable('x', ValueType.INT64), of.allowed, of.rest,
                                     of.limit))


def product(pooled: PooledTest, place: int) -> Product:
    return Product(pooled.parts[place], pooled.words[4 + place])


@pytest.mark.parametrize('required', [
    '> 0.98', '>= 0.5', '< 0.02', '> 0.999999', '> 0.000001', '<= 0.999999', '> 0.1'])
def test_its_evidence_is_that_of_the_reference_bit_for_bit(required: str) -> None:
    of, rng = asked(required), Random(required)
    pooled, wanted = PooledTest(of), reference(of)
    for _ in range(20_000):
        has_failed = rng.random() < (0.03 if '0.98' in required else 0.4)
        pooled.add(has_failed)
        wanted.take(-1 if has_failed != of.counts_successes else 1)
    assert product(pooled, 0) == wanted.against
    assert product(pooled, 1) == wanted.in_favour
    assert product(pooled, 2) == wanted.likelihood
    assert pooled.words[:3] == [wanted.trials, wanted.events, wanted.verdict]


def beta_interval(events: int, trials: int, limit: float) -> tuple[float, float]:
    """Return where the mixture of coins with a Beta(1/2, 1/2) prior has not reached a limit."""
    def log_beta(a: float, b: float) -> float:
        return lgamma(a) + lgamma(b) - lgamma(a + b)

    others = trials - events
    mixture = log_beta(events + 0.5, others + 0.5) - log_beta(0.5, 0.5)

    def is_inside(q: float) -> bool:
        return mixture - events * log(q) - others * log(1 - q) < log(limit)

    ends = []
    for outside, inside in ((1e-15, events / trials), (1 - 1e-15, events / trials)):
        for _ in range(100):
            middle = (outside + inside) / 2
            outside, inside = (outside, middle) if is_inside(middle) else (middle, inside)
        ends.append(outside)
    return ends[0], ends[1]


@pytest.mark.parametrize(('events', 'trials'), [(1, 3), (20, 1000), (5000, 10_000), (3, 90_000)])
def test_the_interval_is_that_of_robbins_mixture(events: int, trials: int) -> None:
    of = asked('> 0.98', '0.95')
    pooled = PooledTest(of)
    outcomes = [True] * events + [False] * (trials - events)
    Random(events).shuffle(outcomes)
    pooled.add_runs(runs_of(outcomes))
    found = pooled.figures()
    low, high = beta_interval(events, trials, of.limit)
    assert isclose(1 - found.high, low, rel_tol=1e-7)
    assert isclose(1 - found.low, high, rel_tol=1e-7)
    assert found.failures == events
    assert found.estimate == (trials - events) / trials


def test_without_trials_nothing_is_known() -> None:
    found = PooledTest(asked('> 0.98')).figures()
    assert (found.trials, found.failures, found.verdict) == (0, 0, 'open')
    assert (found.low, found.high) == (0.0, 1.0)
    assert found.more is not None and 340 < found.more < 800


def test_what_more_says_comes_true() -> None:
    pooled = PooledTest(asked('> 0.9'))
    pooled.add_runs([12, 40, 3])
    more = pooled.figures().more
    assert more is not None
    pooled.add(False, more - 1)
    assert pooled.figures().verdict == 'open'
    pooled.add(False)
    assert pooled.figures().verdict == 'assured'
    assert pooled.figures().more is None


def test_runs_hold_all_outcomes_in_order() -> None:
    rng = Random(3)
    outcomes = [rng.random() < 0.2 for _ in range(200)]
    assert list(outcomes_of(runs_of(outcomes))) == outcomes
    assert runs_of([]) == [0]
    assert runs_of([True, False, False, True]) == [0, 2, 0]


def test_a_million_trials_are_tested() -> None:
    for required in ('> 0.000001', '> 0.5', '> 0.999999'):
        pooled = PooledTest(asked(required))
        pooled.add(False, 500_000)
        pooled.add(True, 500_000)
        found = pooled.figures()
        assert (found.trials, found.failures, found.estimate) == (10 ** 6, 500_000, 0.5)
        assert 0.49 < found.low < 0.5 < found.high < 0.51
    assert found.verdict == 'refuted'


def first_refusal(of: Probability, rate: float, most: int, rng: Random) -> int | None:
    """Return at which trial a requirement is refuted; None if at none."""
    pooled = PooledTest(of)
    for number in range(most):
        pooled.add(rng.random() < rate)
        if pooled.words[2]:
            return number if pooled.words[2] < 0 else None
    return None


@thorough
@pytest.mark.parametrize(('confidence', 'required'), [('0.9', '> 0.9'), ('0.95', '> 0.5')])
def test_of_2000_runs_at_the_bound_few_are_ever_refuted(confidence: str, required: str) -> None:
    of, rng = asked(required, confidence), Random(1)
    refuted = sum(first_refusal(of, of.allowed, 1500, rng) is not None for _ in range(2000))
    error = 1 - float(of.confidence)
    assert refuted / 2000 <= error + 4 * (error * (1 - error) / 2000) ** 0.5


@pytest.mark.parametrize('ratio', [2, 3, 5])
def test_runs_beyond_the_bound_are_refuted_soon_after_the_theory_says(ratio: int) -> None:
    of, p = asked('> 0.9', '0.99'), 0.1
    q = ratio * p
    wald = log(100) / (q * log(q / p) + (1 - q) * log((1 - q) / (1 - p)))
    found = [first_refusal(of, q, 100_000, Random(run)) for run in range(40)]
    delays = [number + 1 for number in found if number is not None]
    assert len(delays) == 40  # none is assured before
    assert 0.9 * wald < mean(delays) < 1.7 * wald


@thorough
def test_of_2000_runs_at_the_bound_few_are_ever_assured() -> None:
    of, rng = asked('> 0.9', '0.9'), Random(2)
    assured = 0
    for _ in range(2000):
        pooled = PooledTest(of)
        for has_failed in islice(iter(lambda: rng.random() < 0.1, None), 1500):
            pooled.add(has_failed)
        assured += pooled.words[2] > 0
    assert assured / 2000 <= 0.1 + 4 * (0.1 * 0.9 / 2000) ** 0.5


@thorough
def test_of_2000_runs_few_intervals_ever_miss_the_probability() -> None:
    of, rng, misses = asked('> 0.9', '0.9'), Random(3), 0
    for _ in range(2000):
        pooled = PooledTest(of)
        for number in range(600):
            pooled.add(rng.random() < 0.1)
            if number % 10 == 9:
                found = pooled.figures()
                if not found.low <= 0.9 <= found.high:
                    misses += 1
                    break
    assert misses / 2000 <= 0.1 + 4 * (0.1 * 0.9 / 2000) ** 0.5


@thorough
def test_the_interval_beside_that_of_confseq() -> None:
    boundaries = pytest.importorskip(
        'confseq.boundaries', reason='confseq is not installed: pip install confseq')
    for events, trials in ((20, 1000), (300, 1000), (50, 100_000)):
        pooled = PooledTest(asked('> 0.98', '0.95'))
        pooled.add(True, events)
        pooled.add(False, trials - events)
        found = pooled.figures()
        low, high = boundaries.bernoulli_confidence_interval(
            events, trials, alpha=0.05, t_opt=trials)
        # Its mixture is tuned to this number of trials; ours to none.
        assert 0.7 < (found.high - found.low) / (high - low) < 1.7
        assert found.low <= 1 - events / trials <= found.high
