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
Find example traces of a requirement by running its monitor, and simplify them.

An exploration of all states yields shortest examples and proofs. If there are too many states,
random traces are tried as well. Examples are then shrunk. The search is deterministic.
"""

from array import array
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from random import Random
from typing import TypeAlias

from fret_monitor.logic.finality import is_final
from fret_monitor.logic.propositions import bounds, horizon
from fret_monitor.traces.alphabet import alphabet
from fret_monitor.traces.explore import Exploration, explore, WantedTrace
from fret_monitor.traces.random_traces import random_traces
from fret_monitor.traces.shrink import Shrinker
from fret_monitor.traces.subject import Subject
from fret_monitor.traces.trace import first_steps, joined, length, Row, Run, Trace

_Bits: TypeAlias = 'array[int]'
_Accept: TypeAlias = Callable[[_Bits, _Bits], bool]

_BATCH = 48
_SHRINKING = 600_000  # steps
_PADDING = 2


class Recovery(Enum):
    """Whether a false verdict can become true again."""

    FINAL_BY_FORM = 'final by form'
    FINAL_BY_STATES = 'final, all states explored'
    POSSIBLE = 'can recover'
    NONE_FOUND = 'no recovery found'
    NEVER_FALSE = 'never false, all states explored'


@dataclass(frozen=True)
class Examples:
    """
    Examples for a requirement, and whether a false verdict can become true again.

    A trace is None if none was found; with `is_proved`, none exists. `states` and `traces` are the
    numbers of states and traces examined.
    """

    satisfying: Trace | None
    violating: Trace | None
    recovering: Trace | None
    recovery: Recovery
    is_proved: bool
    states: int
    traces: int


class Budget:
    """
    The number of steps available for all requirements of a bundle.

    A requirement may use the remaining budget up to a maximum, and always at least a small number
    of steps. So the time for a large bundle is bounded, and a hard requirement among easy ones can
    use a large part of it.
    """

    def __init__(self) -> None:
        """Start with the whole budget."""
        self._left = {'explored': _EXPLORED, 'tried': _TRIED}

    def grant(self, name: str) -> int:
        """Return how many steps a requirement may take; `name` is 'explored' or 'tried'."""
        return max(_LEAST, min(self._left[name], _LARGE))

    def take(self, name: str, steps: int) -> None:
        """Subtract steps from the budget."""
        self._left[name] -= steps


_EXPLORED = 3_000_000
_TRIED = 2_000_000
_LARGE = 300_000
_LEAST = 8_000


def find_examples(subject: Subject, budget: Budget, seed: int = 0) -> Examples:
    """Find examples for a requirement, and subtract the steps taken from the budget."""
    return _Finder(subject, budget, Random(seed)).run()


class _Finder:

    def __init__(self, subject: Subject, budget: Budget, rng: Random) -> None:
        self._subject = subject
        self._rng = rng
        self._alphabet = alphabet(subject, rng)
        self._budget = budget
        self._traces = 0

    def run(self) -> Examples:
        is_final_form = is_final(self._subject.item.formula)
        wanted = WantedTrace(1 + len(self._subject.triggers), not is_final_form)
        found = self._explore(wanted)
        if not found.is_complete or not self._alphabet.is_exact:
            found = self._with_random(found, wanted)
        is_proved = found.is_complete and self._alphabet.is_exact
        violating = self._simplest(found.violating, _violates)
        satisfying = self._near_miss(violating) or self._simplest(found.satisfying, _satisfies)
        return Examples(
            satisfying, violating, self._simplest(found.recovering, _recovers),
            _recovery(found, is_final_form, is_proved), is_proved, found.states, self._traces)

    def _simplest(self, trace: Trace | None, accept: _Accept) -> Trace | None:
        """Return the simplest trace found that is still accepted."""
        if trace is None:
            return None
        trials = self._subject.trials
        first, = trials.run([joined(trace)])

        def judge(batch: Sequence[Trace]) -> list[bool]:
            return [accept(bits, first) for bits in trials.run(batch)]

        shortest = Shrinker(self._alphabet.pools, _SHRINKING).shrink(trace, judge)
        # Show how the trace continues, if the longer trace is still accepted.
        last = shortest[-1]
        longer = (*shortest[:-1], Run(last.row, last.steps + _PADDING))
        return longer if judge([longer])[0] else shortest

    def _near_miss(self, violating: Trace | None) -> Trace | None:
        """Return a violating trace made satisfying at its end, if there is no trigger."""
        if violating is None or self._subject.triggers:
            return None
        bits, = self._subject.trials.run([violating])
        kept = first_steps(violating, [word & 1 for word in bits].index(0))
        candidates = [joined((*kept, Run(row, 1 + _PADDING))) for row in self._alphabet.plain]
        for candidate, bits in zip(candidates, self._subject.trials.run(candidates), strict=True):
            if kept and not _false_steps(bits):
                return candidate
        return None

    def _explore(self, wanted: WantedTrace) -> Exploration:
        """Explore rows without NaN first, then all rows for the examples still missing."""
        plain, rows = self._alphabet.plain, self._alphabet.rows
        found = self._explored(plain, wanted)
        if not found.is_complete or len(plain) == len(rows):
            return found
        more = self._explored(rows, wanted)
        return Exploration(
            found.satisfying or more.satisfying, found.violating or more.violating,
            found.recovering or more.recovering, more.is_complete, more.states, more.steps)

    def _explored(self, rows: Sequence[Row], wanted: WantedTrace) -> Exploration:
        found = explore(self._subject.trials, rows, self._budget.grant('explored'), wanted)
        self._budget.take('explored', found.steps)
        return found

    def _met(self, trace: Trace) -> int:
        bits, = self._subject.trials.run([trace])
        return bits[-1].bit_count()

    def _with_random(self, found: Exploration, wanted: WantedTrace) -> Exploration:
        met = self._met(found.satisfying) if found.satisfying else 0
        best = _Best(found, met)
        item = self._subject.item
        pools = [[value for value in values if value == value] for values in self._alphabet.pools]
        traces = random_traces(pools, bounds(item), horizon(item), self._rng)
        left = granted = self._budget.grant('tried')
        while left > 0 and not best.has(wanted):
            batch = _batch(traces, left)
            for trace, bits in zip(batch, self._subject.trials.run(batch), strict=True):
                best.note(trace, bits)
                left -= len(bits)
            self._traces += len(batch)
        self._budget.take('tried', granted - left)
        return Exploration(best.satisfying, best.violating, best.recovering, False, found.states,
                           found.steps)


def _recovery(found: Exploration, is_final_form: bool, is_proved: bool) -> Recovery:
    if found.recovering is not None:
        return Recovery.POSSIBLE
    if is_proved and found.violating is None:
        return Recovery.NEVER_FALSE
    if is_final_form:
        return Recovery.FINAL_BY_FORM
    return Recovery.FINAL_BY_STATES if is_proved else Recovery.NONE_FOUND


def _satisfies(bits: _Bits, first: _Bits) -> bool:
    """Whether a trace ends true, with no fewer triggers and no more false steps than `first`."""
    return bool(bits[-1] & 1 and bits[-1].bit_count() >= first[-1].bit_count()
                and _false_steps(bits) <= _false_steps(first))


def _false_steps(bits: _Bits) -> int:
    return sum(not word & 1 for word in bits)


def _violates(bits: _Bits, first: _Bits) -> bool:
    return not bits[-1] & 1


def _recovers(bits: _Bits, first: _Bits) -> bool:
    return len(bits) > 1 and bool(bits[-1] & 1) and not bits[-2] & 1


class _Best:
    """The best examples among random traces, each cut after the relevant step."""

    def __init__(self, found: Exploration, met: int) -> None:
        self.satisfying, self.violating = found.satisfying, found.violating
        self.recovering = found.recovering
        self._met = met

    def has(self, wanted: WantedTrace) -> bool:
        return (self._met == wanted.met and self.violating is not None
                and not (wanted.is_recovery and self.recovering is None))

    def note(self, trace: Trace, bits: _Bits) -> None:
        truth = bytes(word & 1 for word in bits)
        met = bits[-1].bit_count()
        if truth[-1] and (met > self._met or met == self._met and self.satisfying
                          and length(trace) < length(self.satisfying)):
            self.satisfying, self._met = trace, met
        self.violating = _shorter(self.violating, trace, truth.find(b'\x00') + 1)
        fall = truth.find(b'\x00\x01')
        self.recovering = _shorter(self.recovering, trace, fall + 2 if fall >= 0 else 0)


def _shorter(best: Trace | None, trace: Trace, steps: int) -> Trace | None:
    """Return the first steps of a trace, or `best` if it is no longer, or if `steps` is 0."""
    if steps == 0 or best is not None and length(best) <= steps:
        return best
    return first_steps(trace, steps)


def _batch(traces: Iterator[Trace], steps: int) -> list[Trace]:
    batch: list[Trace] = []
    while len(batch) < _BATCH and steps > 0:
        batch.append(next(traces))
        steps -= length(batch[-1])
    return batch
