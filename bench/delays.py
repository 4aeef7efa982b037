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

"""
How many trials it takes until a requirement with a probability is refuted, beside the theory.

Failures have 2, 3 and 5 times the allowed probability p. The theory is Wald's: the evidence that
is needed, ln(1/(1 - confidence)), divided by what a trial adds to it on average if the true
probability q is known, q ln(q/p) + (1-q) ln((1-q)/(1-p)). The test has to learn q, and costs more.
Runs that are assured before, wrongly, are left out and counted.

    python -m bench.delays
"""

from fractions import Fraction
from itertools import count
from math import log
from random import Random
from statistics import mean, quantiles

from fret_monitor.model.probability import Probability
from fret_monitor.native.binding import ffi
from fret_monitor.runtime.probability import PooledTest

ALLOWED = ('0.1', '0.02')
CONFIDENCES = ('0.99', '0.999')
RATIOS = (2, 3, 5)
RUNS = 400
VERDICT: int = ffi.integer_const('FM_TEST_VERDICT')


def main() -> int:
    """Print the tables."""
    print('| p | confidence | failures | theory | mean | median | 90 % | assured |')
    print('|---:|---:|---|---:|---:|---:|---:|---:|')
    for allowed in ALLOWED:
        for confidence in CONFIDENCES:
            for ratio in RATIOS:
                print(row(allowed, confidence, ratio), flush=True)
    return 0


def row(allowed: str, confidence: str, ratio: int) -> str:
    """Return the delays of runs whose failures are so many times as probable as allowed."""
    p, q = float(allowed), ratio * float(allowed)
    needed = -log(float(1 - Fraction(confidence)))
    theory = needed / (q * log(q / p) + (1 - q) * log((1 - q) / (1 - p)))
    delays = [delay(allowed, confidence, q, Random(run)) for run in range(RUNS)]
    found = [number for number in delays if number is not None]
    parts = quantiles(found, n=10)
    return (f'| {allowed} | {confidence} | {ratio} p | {theory:,.0f} | {mean(found):,.0f} | '
            f'{parts[4]:,.0f} | {parts[8]:,.0f} | {RUNS - len(found)} |')


def delay(allowed: str, confidence: str, rate: float, rng: Random) -> int | None:
    """Return after how many trials a requirement is refuted; None: it is assured."""
    test = PooledTest(Probability('>', 1 - Fraction(allowed), Fraction(confidence)))
    for number in count(1):
        test.add(rng.random() < rate)
        if verdict := test.words[VERDICT]:
            return number if verdict < 0 else None
    raise AssertionError('it is decided some time')


if __name__ == '__main__':
    main()
