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
Find a trace for each obligation of a requirement, or a proof that there is none.

First all goals about one trace are explored together. Then the traces found are varied at one
step, which shows most conditions and comparisons. What is left is explored by itself. A search of
all states that finds nothing is a proof if the rows represent all values of the inputs.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from random import Random

from fret_monitor.logic.evaluate import evaluate_all
from fret_monitor.logic.formula import Formula
from fret_monitor.logic.propositions import bounds, horizon, is_pointwise, propositions
from fret_monitor.logic.specification import Property, Signal
from fret_monitor.testgen.obligations import both, Obligation, PRIME
from fret_monitor.testgen.recorded import first_met, is_met, moved, Recorded, recorded
from fret_monitor.traces.alphabet import Alphabet, alphabet
from fret_monitor.traces.deadline import Deadline
from fret_monitor.traces.explore import reach
from fret_monitor.traces.random_traces import random_traces
from fret_monitor.traces.search import Budget
from fret_monitor.traces.shrink import Shrinker
from fret_monitor.traces.subject import Observation, Subject
from fret_monitor.traces.trace import first_steps, joined, length, Row, rows_of, Run, Trace
from fret_monitor.traces.trials import Trials

_MOST_BITS = 31  # of the verdicts of a step, beside that of the requirement
_BATCH = 48
_SHRINKING_STEPS = 60_000
_MOST_BASES = 16  # traces that are varied
_MOST_PLACES = 24  # steps of a trace that are varied
_MOST_VARIED = 3000  # traces with one step varied
_LONGEST_BASE = 4000  # steps
_FEWER_TRIED = 10


@dataclass
class SearchTask:
    """
    A requirement, its obligations, and what was found so far, by index of the obligation.

    `stepped` and `searched` are the requirement and its obligations in steps of `grid`
    nanoseconds; without a grid, as they are. `found` has one trace, or a pair for a condition.
    `proofs` say why there is none, `doubts` why none is known.
    """

    item: Property
    obligations: Sequence[Obligation]
    stepped: Property
    searched: Sequence[Obligation]
    signals: tuple[Signal, ...]
    grid: int | None
    rng: Random
    found: dict[int, tuple[Recorded, ...]] = field(default_factory=dict)
    proofs: dict[int, str] = field(default_factory=dict)
    doubts: dict[int, str] = field(default_factory=dict)
    bases: list[Trace] = field(default_factory=list)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the inputs in a row."""
        return tuple(signal.name for signal in self.signals)

    @property
    def left(self) -> list[int]:
        """The obligations without a trace and without a proof."""
        return [number for number in range(len(self.obligations))
                if number not in self.found and number not in self.proofs]

    def offer(self, number: int, trace: Trace) -> bool:
        """Keep a trace (of a pair: with the columns of both) if the reference confirms it."""
        obligation = self.obligations[number]
        signals = self.signals * 2 if obligation.is_pair else self.signals
        names = [*self.names, *(name + PRIME for name in self.names)]

        def accepts(candidate: Recorded) -> bool:
            return is_met(obligation.goal, obligation.feedback, names[:len(signals)], candidate)

        made = recorded(trace, signals, self.grid)
        candidates = [made] if self.grid is None else [made, *moved(made, self.grid)]
        found = first_met(candidates, accepts)
        if found is not None:
            count = len(self.signals)
            self.found[number] = (found,) if not obligation.is_pair else (
                found.columns(0, count), found.columns(count, 2 * count))
            self.doubts.pop(number, None)
        return found is not None


def together(task: SearchTask) -> list[Observation]:
    """Return observations of all goals about one trace but those of comparisons."""
    numbers = _together_numbers(task)
    return [_observation(task, chunk) for chunk in numbers]


def _together_numbers(task: SearchTask) -> list[list[int]]:
    numbers = [number for number, each in enumerate(task.searched) if each.proposition is None]
    return [numbers[start:start + _MOST_BITS] for start in range(0, len(numbers), _MOST_BITS)]


def _observation(task: SearchTask, numbers: Sequence[int]) -> Observation:
    feedback = dict(pair for number in numbers for pair in task.searched[number].feedback)
    own = dict(task.stepped.feedback)
    return Observation(task.stepped, task.signals,
                       tuple(task.searched[number].goal for number in numbers),
                       tuple(pair for pair in feedback.items() if pair[0] not in own))


def explore_together(task: SearchTask, compiled: Sequence[Trials], budget: Budget,
                     deadline: Deadline) -> None:
    """Search for all goals of `together`, and vary the traces found."""
    for numbers, trials in zip(_together_numbers(task), compiled, strict=True):
        wanted = _combined(task, numbers)
        hunt = _Hunt(task, wanted, task.signals, trials, deadline)
        hunt.run({place + 1: number for place, number in enumerate(numbers)}, budget)
    deadline.check()
    if compiled:
        _Variation(task, compiled[0], deadline).run()


def alone(task: SearchTask) -> list[tuple[int, Observation]]:
    """Return an observation of each goal that is left, with its number."""
    return [(number, _alone(task, task.stepped, task.searched[number])) for number in task.left]


def exactly(task: SearchTask) -> list[tuple[int, Observation]]:
    """Return what `alone` does, with ticks as steps under `timed`."""
    return [(number, _alone(task, task.item, task.obligations[number])) for number in task.left]


def _alone(task: SearchTask, item: Property, each: Obligation) -> Observation:
    signals = task.signals
    if each.is_pair:
        signals += tuple(replace(signal, name=signal.name + PRIME) for signal in task.signals)
    return Observation(replace(item, formula=each.goal, feedback=each.feedback), signals, ())


def explore_alone(task: SearchTask, number: int, compiled: Trials, budget: Budget,
                  deadline: Deadline) -> None:
    """Search for one goal."""
    each = task.searched[number]
    observation = _alone(task, task.stepped, each)
    hunt = _Hunt(task, observation.item, observation.signals, compiled, deadline)
    if each.is_pair:
        hunt.pairs(_letters(task), number, budget)
    else:
        hunt.run({0: number}, budget)


def _letters(task: SearchTask) -> Alphabet:
    return alphabet(_subject(task.stepped, task.signals), task.rng)


def _subject(item: Property, signals: tuple[Signal, ...]) -> Subject:
    """Return what `alphabet` reads of a subject."""
    nothing: Trials = None  # type: ignore[assignment]  # runs no traces
    return Subject(item, signals, tuple(propositions(item)), (), nothing)


def _combined(task: SearchTask, numbers: Iterable[int]) -> Property:
    """Return a requirement with the propositions and bounds of some goals."""
    formula, feedback = task.stepped.formula, dict(task.stepped.feedback)
    for number in numbers:
        formula = both(formula, task.searched[number].goal)
        feedback.update(task.searched[number].feedback)
    return replace(task.stepped, formula=formula, feedback=tuple(feedback.items()))


class _Hunt:
    """A search for goals: explores states, then tries random traces."""

    def __init__(self, task: SearchTask, item: Property, signals: tuple[Signal, ...],
                 trials: Trials, deadline: Deadline) -> None:
        self._task = task
        self._item = item
        self._signals = signals
        self._trials = trials
        self._deadline = deadline

    def run(self, wanted: dict[int, int], budget: Budget) -> None:
        """Search for the goals of some bits, each with the number of its obligation."""
        letters = alphabet(_subject(self._item, self._signals), self._task.rng)
        left = self._explored(dict(wanted), letters.plain, budget)
        is_whole = len(letters.plain) == len(letters.rows)
        if left and not is_whole:
            left = self._explored(left, letters.rows, budget)
        if self._is_complete and letters.is_exact:
            self._note_proofs(left)
        elif left:
            self._random(left, letters, budget)

    def pairs(self, letters: Alphabet, number: int, budget: Budget) -> None:
        """Search for two traces that differ in the truth of one proposition."""
        node = self._task.searched[number].proposition
        assert node is not None
        known = propositions(self._task.stepped)
        is_exact = letters.is_exact and all(map(is_pointwise, known))
        rows = [(*row, *row) for row in letters.rows]
        if is_exact:
            values = _valuations(known, self._task.names, letters.rows)
            place = known.index(node)
            rows += [(*one, *two) for one, first in zip(letters.rows, values, strict=True)
                     for two, second in zip(letters.rows, values, strict=True)
                     if _differing(first, second) == [place]]
            if len(rows) == len(letters.rows):
                self._task.proofs[number] = 'no values of the inputs change it alone'
                return
        else:
            rows += [(*one, *two) for one in letters.rows[:16] for two in letters.rows[:16]
                     if one is not two]
        left = self._explored({0: number}, rows, budget)
        if left and self._is_complete and is_exact:
            self._note_proofs(left)
        elif left:
            self._doubt(left)

    def _explored(self, wanted: dict[int, int], rows: Sequence[Row],
                  budget: Budget) -> dict[int, int]:
        """Explore, and return what was not found."""
        self._deadline.check()
        bits = sum(1 << bit for bit in wanted)
        found = reach(self._trials, rows, bits, budget.grant('explored'))
        budget.take('explored', found.steps)
        self._is_complete = found.is_complete
        self._states = found.states
        for bit, trace in found.traces.items():
            self._keep(wanted.pop(bit), trace)
        return wanted

    def _keep(self, number: int, trace: Trace) -> None:
        task = self._task
        if not task.obligations[number].is_pair:
            task.bases.append(trace)
        if task.offer(number, trace):
            return
        if task.grid is None:
            raise AssertionError(
                f'{task.item.id}: the compiled monitor and the reference differ on '
                f'"{task.obligations[number].what}"')
        task.doubts[number] = 'an example on a grid of time does not hold in real time'

    def _note_proofs(self, left: dict[int, int]) -> None:
        for number in left.values():
            if self._task.grid is None:
                self._task.proofs[number] = f'all states explored: {self._states:,}'
            else:
                self._task.doubts[number] = f'none on a grid of time: {self._states:,} states'

    def _doubt(self, left: dict[int, int]) -> None:
        for number in left.values():
            self._task.doubts[number] = f'none found in {self._states:,} states'

    def _random(self, left: dict[int, int], letters: Alphabet, budget: Budget) -> None:
        """Try random traces for the goals that are left."""
        pools = [[value for value in values if value == value] for values in letters.pools]
        traces = random_traces(pools, bounds(self._item), horizon(self._item), self._task.rng)
        granted = budget.grant('tried')
        if self._is_complete:  # other values of the inputs are what is left to try
            granted //= _FEWER_TRIED
        steps = granted
        while left and steps > 0:
            self._deadline.check()
            batch = list(islice(traces, _BATCH))
            steps -= sum(map(length, batch))
            mask = sum(1 << bit for bit in left)
            for trace, words in zip(batch, self._trials.run(batch), strict=True):
                for bit in _bits_in(words, mask, left):
                    place = next(i for i, word in enumerate(words) if word >> bit & 1)
                    self._keep(left.pop(bit), self._shrunk(
                        first_steps(trace, place + 1), bit, letters))
                    mask &= ~(1 << bit)
        budget.take('tried', granted - steps)
        self._doubt(left)

    def _shrunk(self, trace: Trace, bit: int, letters: Alphabet) -> Trace:
        def judge(batch: Sequence[Trace]) -> list[bool]:
            return [bool(words[-1] >> bit & 1) for words in self._trials.run(batch)]

        return Shrinker(letters.pools, _SHRINKING_STEPS).shrink(trace, judge)


def _bits_in(words: Sequence[int], mask: int, left: Iterable[int]) -> list[int]:
    seen = 0
    for word in words:
        seen |= word
    return [bit for bit in left if seen & mask & 1 << bit]


def _valuations(nodes: Sequence[Formula], names: Sequence[str],
                rows: Sequence[Row]) -> list[tuple[bool, ...]]:
    """Return the truth values of pointwise propositions on each row."""
    columns = {name: [row[place] for row in rows] for place, name in enumerate(names)}
    found = evaluate_all(nodes, columns)
    return [tuple(bool(column[place]) for column in found) for place in range(len(rows))]


def _differing(one: Sequence[bool], two: Sequence[bool]) -> list[int]:
    return [place for place, (a, b) in enumerate(zip(one, two, strict=True)) if a != b]


class _Variation:
    """
    Varies traces at one step, for conditions and comparisons.

    Two variants that differ in one proposition and in the verdict show that condition. A variant
    on which a comparison and its mutant differ, and whose verdict is not that of the variant with
    the other truth, shows that comparison.
    """

    def __init__(self, task: SearchTask, trials: Trials, deadline: Deadline) -> None:
        self._task = task
        self._trials = trials
        self._deadline = deadline
        self._nodes = [node for node in propositions(task.stepped) if is_pointwise(node)]
        self._letters = _letters(task)
        self._wanted: dict[Formula, list[int]] = {}
        for number in task.left:
            node = task.searched[number].proposition
            if node is not None:
                self._wanted.setdefault(node, []).append(number)

    def run(self) -> None:
        if not self._nodes or not self._wanted:
            return
        spent = 0
        for base in self._bases():
            for place in _places(base):
                self._deadline.check()
                if spent > _MOST_VARIED or not any(self._wanted.values()):
                    return
                spent += self._vary(base, place)

    def _bases(self) -> Iterator[Trace]:
        unique = {repr(joined(trace)): trace for trace in self._task.bases
                  if length(trace) <= _LONGEST_BASE}
        yield from sorted(unique.values(), key=length)[:_MOST_BASES]

    def _vary(self, base: Trace, place: int) -> int:
        """Vary one step of a trace; return how many variants were tried."""
        rows = self._rows(_row_at(base, place))
        variants = [_replaced(base, place, row) for row in rows]
        verdicts = [bytes(word & 1 for word in words) for words in self._trials.run(variants)]
        values = _valuations(self._nodes, self._task.names, rows)
        first: dict[tuple[bool, ...], int] = {}
        for number, value in enumerate(values):
            first.setdefault(value, number)
        mutants = self._mutants(rows)
        for number, value in enumerate(values):
            for position, node in enumerate(self._nodes):
                other = first.get((*value[:position], not value[position], *value[position + 1:]))
                if other is None or not self._wanted.get(node) or (
                        verdicts[number] == verdicts[other]):
                    continue
                end = 1 + next(step for step, (a, b) in enumerate(zip(
                    verdicts[number], verdicts[other], strict=True)) if a != b)
                self._offer(node, [variants[number], variants[other]], end,
                            mutants.get(node, ()), number)
        return len(variants)

    def _rows(self, row: Row) -> list[Row]:
        """Return the row, those with one input changed, and one for each valuation."""
        found = [row]
        for place, values in enumerate(self._letters.pools):
            found += [(*row[:place], value, *row[place + 1:]) for value in values]
        unique = {repr(each): each for each in (*found, *self._letters.rows)}
        return list(unique.values())

    def _mutants(self, rows: Sequence[Row]) -> dict[Formula, list[tuple[int, list[bool]]]]:
        """Return, for each proposition, its mutants, and on which rows they differ from it."""
        found: dict[Formula, list[tuple[int, list[bool]]]] = {}
        for node, numbers in self._wanted.items():
            for number in numbers:
                mutant = self._task.searched[number].mutant
                if mutant is not None and is_pointwise(node):
                    values = _valuations([node, mutant], self._task.names, rows)
                    found.setdefault(node, []).append((number, [a != b for a, b in values]))
        return found

    def _offer(self, node: Formula, pair: Sequence[Trace], end: int,
               mutants: Iterable[tuple[int, list[bool]]], row: int) -> None:
        differing = {number for number, differs in mutants if differs[row]}
        for number in list(self._wanted[node]):
            if self._task.searched[number].is_pair:
                rows = zip(*(rows_of(first_steps(trace, end)) for trace in pair), strict=True)
                trace = joined(Run((*one, *two), 1) for one, two in rows)
            elif number in differing:
                trace = first_steps(pair[0], end)
            else:
                continue
            if self._task.offer(number, trace):
                self._wanted[node].remove(number)


def _places(trace: Trace) -> list[int]:
    """Return the first and last step of each run, from the end."""
    found: list[int] = []
    step = 0
    for run in joined(trace):
        found += [step, step + run.steps - 1]
        step += run.steps
    return list(dict.fromkeys(reversed(found)))[:_MOST_PLACES]


def _row_at(trace: Trace, place: int) -> Row:
    for run in trace:
        if place < run.steps:
            return run.row
        place -= run.steps
    raise IndexError(place)


def _replaced(trace: Trace, place: int, row: Row) -> Trace:
    """Return a trace with the row of one step replaced."""
    found: list[Run] = []
    step = 0
    for run in trace:
        before = place - step
        if 0 <= before < run.steps:
            found += [Run(run.row, before), Run(row, 1), Run(run.row, run.steps - before - 1)]
        else:
            found.append(run)
        step += run.steps
    return tuple(run for run in found if run.steps)
