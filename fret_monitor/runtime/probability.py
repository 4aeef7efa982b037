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
A test of a probability over the trials of several recordings, in their order.

The test and its figures are those of csrc (`fret_trials.h`, `figures.c`).
"""

from collections.abc import Iterable, Sequence
from itertools import chain, repeat
from typing import Any, NamedTuple

from fret_monitor.model.probability import Probability
from fret_monitor.native import evaluator_library, load_evaluator
from fret_monitor.native.binding import ffi

_MOST_MORE = 5_000_000
_VERDICTS = {1: 'assured', -1: 'refuted', 0: 'open'}


class Figures(NamedTuple):
    """
    What a test has found.

    `verdict` is assured, refuted or open. `estimate` and the interval from `low` to `high` are of
    the probability of success. `more` is how many further trials would assure the requirement if
    all of them were as it wants them; None: it is decided, or more than five million.
    """

    trials: int
    failures: int
    verdict: str
    estimate: float
    low: float
    high: float
    more: int | None


class PooledTest:
    """One test of a requirement, over trials that are added in order."""

    def __init__(self, asked: Probability) -> None:
        """Begin a test without trials; raises `LibraryError` as `load_evaluator`."""
        self._library: Any = load_evaluator(evaluator_library())
        self._asked = asked
        self._test = ffi.new('struct fm_test *', {
            'counts_successes': asked.counts_successes, 'allowed': asked.allowed,
            'rest': asked.rest, 'limit': asked.limit})
        self._words = ffi.new('int64_t[]', ffi.integer_const('FM_TEST_WORDS'))
        count = ffi.integer_const('FM_TEST_PARTS')
        self._parts = ffi.new('double[]', [1.0] * count)

    def add(self, has_failed: bool, times: int = 1) -> None:
        """Add so many trials with one outcome."""
        self._library.fm_figures_add(self._test, self._words, self._parts, has_failed, times)

    def add_runs(self, runs: Sequence[int]) -> None:
        """Add trials as `runs_of` returns them."""
        for place, successes in enumerate(runs):
            self.add(False, successes)
            if place < len(runs) - 1:
                self.add(True)

    @property
    def words(self) -> list[int]:
        """Its words, as `fret_monitor.h` numbers them."""
        return list(self._words)

    @property
    def parts(self) -> list[float]:
        """Its parts, as `fret_monitor.h` numbers them."""
        return list(self._parts)

    def figures(self, *, has_more: bool = True) -> Figures:
        """Return what was found so far; without `has_more`, which may take long, not `more`."""
        counts = self._library.fm_counts_of_test(self._test, self._words, self._parts)
        found = self._library.fm_figures_of(ffi.new('struct fm_test_counts *', counts))
        more = self._library.fm_figures_more(
            self._test, self._words, self._parts, self._asked.counts_successes,
            _MOST_MORE) if has_more else -1
        is_open = counts.verdict == 0
        return Figures(found.trials, found.failures, _VERDICTS[counts.verdict], found.estimate,
                       found.low, found.high, more if is_open and more >= 0 else None)


def runs_of(outcomes: Iterable[bool]) -> list[int]:
    """
    Return trials as the numbers of successes before each failure, and after the last.

    `outcomes` says of each trial whether it failed.
    """
    runs = [0]
    for has_failed in outcomes:
        if has_failed:
            runs.append(0)
        else:
            runs[-1] += 1
    return runs


def outcomes_of(runs: Sequence[int]) -> Iterable[bool]:
    """Return whether each trial failed, of what `runs_of` returned."""
    return chain.from_iterable(
        chain(repeat(False, successes), [True] if place < len(runs) - 1 else [])
        for place, successes in enumerate(runs))
