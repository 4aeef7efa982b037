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
Example traces of a requirement, found by running its monitor, and made as simple as can be.

First all states are explored, which gives shortest examples, and proofs. Where there are too many,
random traces are tried whose values stay for as long as the formula's bounds ask. What is found is
made shorter and calmer for as long as it stays an example. The same bundle gives the same traces.
"""

from array import array
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from itertools import islice, pairwise
from random import Random
from typing import TypeAlias

from fret_monitor.logic.finality import is_final
from fret_monitor.logic.propositions import bounds, horizon
from fret_monitor.traces.alphabet import Alphabet, alphabet
from fret_monitor.traces.explore import Exploration, explore, Wanted
from fret_monitor.traces.subject import Subject
from fret_monitor.traces.trials import length, Row, Run, Trace, Trials, Value

_Bits: TypeAlias = 'array[int]'
_Accept: TypeAlias = Callable[[_Bits, _Bits], bool]

_BATCH = 48
_LONGEST = 200_000
_SIMPLIFIED = 600_000  # steps, and for each run as many as take Python as long:
_EACH_RUN = 40
_PADDING = 2
_FAVOUR = 0.9


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
    What was found about a requirement.

    The traces are None where none was found; where `is_proved`, none exists. `states` and `traces`
    say how many were looked at.
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
    How much is tried, in steps, for some requirements that are explained together.

    Each may take a large part of what is left, and has a small part in any case: the time stays
    bounded for large bundles, and a hard one among easy ones is looked at closely.
    """

    def __init__(self) -> None:
        """Start with all of it."""
        self._left = {'explored': _EXPLORED, 'tried': _TRIED}

    def grant(self, name: str) -> int:
        """Return how many steps a requirement may take; `name` is 'explored' or 'tried'."""
        return max(_LEAST, min(self._left[name], _LARGE))

    def take(self, name: str, steps: int) -> None:
        """Count steps that were taken."""
        self._left[name] -= steps


_EXPLORED = 3_000_000
_TRIED = 2_000_000
_LARGE = 300_000
_LEAST = 8_000


def find_examples(subject: Subject, budget: Budget, seed: int = 0) -> Examples:
    """Find examples for a requirement within a budget, from which what was used is taken."""
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
        wanted = Wanted(1 + len(self._subject.triggers), not is_final_form)
        found = self._explore(wanted)
        if not found.is_complete or not self._alphabet.is_exact:
            found = self._with_random(found, wanted)
        is_proved = found.is_complete and self._alphabet.is_exact
        simpler = Simplifier(self._subject.trials, self._alphabet)
        violating = simpler.run(found.violating, _violates)
        satisfying = self._near_miss(violating) or simpler.run(found.satisfying, _satisfies)
        return Examples(
            satisfying, violating, simpler.run(found.recovering, _recovers),
            _recovery(found, is_final_form, is_proved), is_proved, found.states, self._traces)

    def _near_miss(self, violating: Trace | None) -> Trace | None:
        """Return a violating trace with another end, if there is no trigger to be shown."""
        if violating is None or self._subject.triggers:
            return None
        bits, = self._subject.trials.run([violating])
        kept = _first(violating, [word & 1 for word in bits].index(0))
        candidates = [_joined((*kept, Run(row, 1 + _PADDING))) for row in self._alphabet.plain]
        for candidate, bits in zip(candidates, self._subject.trials.run(candidates), strict=True):
            if kept and not _false_steps(bits):
                return candidate
        return None

    def _explore(self, wanted: Wanted) -> Exploration:
        """Explore with rows that people would try first, and those with a NaN for what is left."""
        plain, rows = self._alphabet.plain, self._alphabet.rows
        found = self._explored(plain, wanted)
        if not found.is_complete or len(plain) == len(rows):
            return found
        more = self._explored(rows, wanted)
        return Exploration(
            found.satisfying or more.satisfying, found.violating or more.violating,
            found.recovering or more.recovering, more.is_complete, more.states, more.steps)

    def _explored(self, rows: Sequence[Row], wanted: Wanted) -> Exploration:
        found = explore(self._subject.trials, rows, self._budget.grant('explored'), wanted)
        self._budget.take('explored', found.steps)
        return found

    def _met(self, trace: Trace) -> int:
        bits, = self._subject.trials.run([trace])
        return bits[-1].bit_count()

    def _with_random(self, found: Exploration, wanted: Wanted) -> Exploration:
        met = self._met(found.satisfying) if found.satisfying else 0
        best = _Best(found, met)
        traces = random_traces(self._subject, self._alphabet, self._rng)
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
    """Whether a trace ends satisfied, with no fewer triggers met and no more steps false."""
    return bool(bits[-1] & 1 and bits[-1].bit_count() >= first[-1].bit_count()
                and _false_steps(bits) <= _false_steps(first))


def _false_steps(bits: _Bits) -> int:
    return sum(not word & 1 for word in bits)


def _violates(bits: _Bits, first: _Bits) -> bool:
    return not bits[-1] & 1


def _recovers(bits: _Bits, first: _Bits) -> bool:
    return len(bits) > 1 and bool(bits[-1] & 1) and not bits[-2] & 1


class _Best:
    """The best examples among random traces, cut off behind what they show."""

    def __init__(self, found: Exploration, met: int) -> None:
        self.satisfying, self.violating = found.satisfying, found.violating
        self.recovering = found.recovering
        self._met = met

    def has(self, wanted: Wanted) -> bool:
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
    """Return the first steps of a trace (0: none) if there is no better one."""
    if steps == 0 or best is not None and length(best) <= steps:
        return best
    return _first(trace, steps)


def _first(trace: Trace, steps: int) -> Trace:
    runs = []
    for run in trace:
        if steps <= 0:
            break
        runs.append(Run(run.row, min(run.steps, steps)))
        steps -= run.steps
    return tuple(runs)


def _batch(traces: Iterator[Trace], steps: int) -> list[Trace]:
    batch: list[Trace] = []
    while len(batch) < _BATCH and steps > 0:
        batch.append(next(traces))
        steps -= length(batch[-1])
    return batch


def random_traces(subject: Subject, letters: Alphabet, rng: Random) -> Iterator[Trace]:
    """Yield traces without end whose values stay for about as long as the bounds ask."""
    ends = bounds(subject.item)
    stays = sorted({1, 2, 3, *(end + off for end in ends for off in (-1, 0, 1))} - {0})
    stays = [steps for steps in stays if steps <= _LONGEST]
    reach = min(horizon(subject.item), _LONGEST)
    levels = [[value for value in values if value == value] for values in letters.levels]
    while True:
        target = rng.choice((4, 8, reach + 4, 2 * reach + 8))
        yield _random_trace(levels, stays, min(target, _LONGEST), rng)


def _random_trace(levels: Sequence[Sequence[Value]], stays: Sequence[int], target: int,
                  rng: Random) -> Trace:
    choose = _chooser(rng)
    row = [choose(values) for values in levels]
    runs: list[Run] = []
    steps = 0
    while steps < target:
        runs.append(Run(tuple(row), rng.choice(stays) if rng.random() < 0.6 else 1))
        steps += runs[-1].steps
        for number in range(len(levels)) if rng.random() < 0.3 else _some(levels, rng):
            row[number] = choose(levels[number])
    return tuple(runs)


def _chooser(rng: Random) -> Callable[[Sequence[Value]], Value]:
    """
    Return a way to choose values: any, or mostly the first ones, or mostly the last ones.

    Many inputs that have to agree (`a & b & c & ...`) would hardly ever do so by chance.
    """
    favoured = rng.choice((None, 0, -1))
    if favoured is None:
        return rng.choice
    return lambda values: values[favoured] if rng.random() < _FAVOUR else rng.choice(values)


def _some(levels: Sequence[Sequence[Value]], rng: Random) -> list[int]:
    return [rng.randrange(len(levels))] if levels else []


class Simplifier:
    """Makes a trace shorter, then calmer, then plainer, for as long as it shows what it shows."""

    def __init__(self, trials: Trials, letters: Alphabet) -> None:
        """Take what runs the traces, and the values there are."""
        self._trials = trials
        self._ranks = [{_key(value): (rank, value) for rank, value in enumerate(values)}
                       for values in letters.levels]
        self._work = 0

    def run(self, trace: Trace | None, accept: _Accept) -> Trace | None:
        """Return the simplest trace found that is still accepted; None for None."""
        if trace is None:
            return None
        trace = _joined(trace)
        first, = self._trials.run([trace])
        self._work = _SIMPLIFIED
        while (better := self._better(trace, first, accept)) is not None:
            trace = better
        return self._longer(trace, first, accept)

    def _better(self, trace: Trace, first: _Bits, accept: _Accept) -> Trace | None:
        """Return a simpler trace that is accepted, the first one met while there is time."""
        cost = self._cost(trace)
        candidates = (joined for each in self._simpler(trace)
                      if (joined := _joined(each)) and self._cost(joined) < cost)
        size = max(1, min(_BATCH, _SIMPLIFIED // 50 // length(trace)))
        while self._work > 0 and (batch := list(islice(candidates, size))):
            self._work -= sum(_EACH_RUN * len(each) + length(each) for each in batch)
            for candidate, bits in zip(batch, self._trials.run(batch), strict=True):
                if accept(bits, first):
                    return candidate
        return None

    def _simpler(self, trace: Trace) -> Iterator[Trace]:
        """Yield traces near one: shorter first, then with fewer changes."""
        size = len(trace) // 2
        while size > 0:
            for start in range(0, len(trace), size):
                yield (*trace[:start], *trace[start + size:])
            size //= 2
        for place, ranks in enumerate(self._ranks):
            for value in ranks.values():
                yield tuple(_with(run, place, value[1]) for run in trace)
        for number, run in enumerate(trace):
            for steps in dict.fromkeys((1, run.steps // 2, run.steps - 1)):
                if 0 < steps < run.steps:
                    yield (*trace[:number], Run(run.row, steps), *trace[number + 1:])
        for number in range(len(trace)):
            yield from _calmer(trace, number)

    def _cost(self, trace: Trace) -> tuple[int, int, int]:
        """Return steps, changes of inputs, and how far from the plainest its values are."""
        changes = sum(_key(a) != _key(b) for one, two in pairwise(trace)
                      for a, b in zip(one.row, two.row, strict=True))
        ranks = sum(rank[_key(value)][0] for run in trace
                    for rank, value in zip(self._ranks, run.row, strict=True))
        return length(trace), changes, ranks

    def _longer(self, trace: Trace, first: _Bits, accept: _Accept) -> Trace:
        """Return a trace with some more steps behind it, so that one sees how it goes on."""
        longer = (*trace[:-1], Run(trace[-1].row, trace[-1].steps + _PADDING))
        bits, = self._trials.run([longer])
        return longer if accept(bits, first) else trace


def _key(value: Value) -> Value | str:
    return 'nan' if value != value else value


def _joined(trace: Trace) -> Trace:
    """Return a trace in which neighbours differ."""
    runs: list[Run] = []
    for run in trace:
        if runs and run.row == runs[-1].row:
            runs[-1] = Run(run.row, runs[-1].steps + run.steps)
        else:
            runs.append(run)
    return tuple(runs)


def _with(run: Run, place: int, value: Value) -> Run:
    """Return a run in which an input has another value."""
    return Run((*run.row[:place], value, *run.row[place + 1:]), run.steps)


def _calmer(trace: Trace, number: int) -> Iterator[Trace]:
    """Yield traces in which a run takes the values of a neighbour, all or one of them."""
    run = trace[number]
    for neighbour in trace[max(number - 1, 0):number] + trace[number + 1:number + 2]:
        yield (*trace[:number], Run(neighbour.row, run.steps), *trace[number + 1:])
        for place, value in enumerate(neighbour.row):
            yield (*trace[:number], _with(run, place, value), *trace[number + 1:])
