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
Windows of thousands of steps, on traces so long that all counters saturate and delay lines wrap.

The reference evaluator would take too long; instead each operator is checked by running sums over
the trace, one pass for each, which share no code with the reference.
"""

from collections.abc import Callable
from itertools import accumulate
from random import Random
from typing import assert_never, TypeAlias

from differential.compiled import Compiled
from fret_monitor.logic.evaluate import verdicts
from fret_monitor.logic.formula import Historically, Once, Since, Triggered, Variable, Window
from fret_monitor.model.values import ValueType
import pytest
from strategies import property_of, some, specification_of, Trace

P, Q = Variable('p', ValueType.BOOL), Variable('q', ValueType.BOOL)
Bounded: TypeAlias = Once | Historically | Since | Triggered
OPERATORS: list[Callable[[Window], Bounded]] = [
    lambda window: Once(window, P), lambda window: Historically(window, P),
    lambda window: Since(window, P, Q), lambda window: Triggered(window, P, Q),
]


def by_sums(formula: Bounded, trace: Trace) -> list[bool]:
    """Compute one operator on inputs from running sums, in time linear in the trace."""
    match formula:
        case Once():
            return seen(formula.window, trace['p'])
        case Historically():
            return negated(seen(formula.window, negated(trace['p'])))
        case Since():
            return held(formula.window, trace['p'], trace['q'])
        case Triggered():
            return negated(held(formula.window, negated(trace['p']), negated(trace['q'])))
        case _:
            assert_never(formula)


def negated(column: list[bool]) -> list[bool]:
    return [not value for value in column]


def seen(window: Window, q: list[bool]) -> list[bool]:
    """Return whether the number of q up to the near end exceeds that before the far end."""
    return held(window, [True] * len(q), q)


def held(window: Window, p: list[bool], q: list[bool]) -> list[bool]:
    """Return the same, with the far end no further back than the last step without p."""
    sums = [0, *accumulate(q)]
    result = []
    last_break = 0
    for t, value in enumerate(p):
        last_break = last_break if value else t
        first = max(last_break, 0 if window.high is None else t - window.high)
        near = t - window.low + 1
        result.append(near > first and sums[near] > sums[first])
    return result


def runs(rng: Random, steps: int, longest: int) -> list[bool]:
    """Return runs of one value, some of a single step, some of up to `longest` steps."""
    column: list[bool] = []
    while len(column) < steps:
        length = rng.choice((1, 2, rng.randint(1, longest)))
        column += [rng.random() < 0.5] * length
    return column[:steps]


def formulas(windows: list[Window]) -> list[Bounded]:
    return [operator(window) for window in windows for operator in OPERATORS]


def test_the_sums_are_the_reference_semantics() -> None:
    rng = Random(1)
    trace = {'p': runs(rng, 60, 12), 'q': runs(rng, 60, 12)}
    windows = [Window(low, high) for low in (0, 1, 2, 7)
               for high in (None, -1, 0, 1, 5, 7, 9, 20, 100)]
    for formula in formulas(windows):
        assert by_sums(formula, trace) == verdicts(formula, trace)


@pytest.mark.parametrize(('steps', 'longest', 'ends'), [
    (12_000, 6000, [(0, 999), (0, 1000), (1000, 1000), (1000, None), (999, 1001), (1000, 3000),
                    (1023, 1024), (1024, 1025), (1, 1000), (2500, 5000), (4095, 4096), (5, 11_999),
                    (5000, None), (11_998, 11_999), (11_999, None), (12_000, None),
                    (12_000, 12_001)]),
    (2000, 400, [(0, high) for high in (126, 127, 128, 129, 253, 254, 255, 256)]),
    (70_000, 40_000, [(0, high) for high in (32_766, 32_767, 32_768, 32_769)]),
    (100_000, 70_000, [(0, 65_534), (0, 65_535), (0, 65_536), (65_535, None), (65_536, None),
                       (65_535, 65_537), (1, 65_536), (32_767, 90_000)]),
    (5000, 900, [(0, 2 ** 31 - 1), (2 ** 31 - 1, None), (3, 2 ** 31 - 1), (0, 2 ** 31 - 2)]),
])
def test_long_windows_are_exact_to_the_step(steps: int, longest: int,
                                            ends: list[tuple[int, int | None]]) -> None:
    items = formulas([Window(low, high) for low, high in ends])
    properties = [property_of(f'R-{number}', item) for number, item in enumerate(items)]
    compiled = Compiled(specification_of(properties, (P, Q)))
    for seed in some((1, 2)):
        rng = Random(seed)
        trace = {'p': runs(rng, steps, longest), 'q': runs(rng, steps, longest // 9)}
        for item, found in zip(items, compiled.run(trace), strict=True):
            assert found == by_sums(item, trace), f'{type(item).__name__} over {item.window}'


@pytest.mark.parametrize('start', some([0, 1, 999, 1000, 1001, 2999], 2))
def test_a_single_event_is_in_a_long_window_from_its_first_to_its_last_step(start: int) -> None:
    items = formulas([Window(1000, 1500), Window(0, 1000), Window(1000, None), Window(1000, 1000)])
    properties = [property_of(f'R-{number}', item) for number, item in enumerate(items)]
    event = [t == start for t in range(6000)]
    compiled = Compiled(specification_of(properties, (P, Q)))
    for p, q in ((event, event), (negated(event), event), (event, negated(event)),
                 (negated(event), negated(event)), ([True] * 6000, event)):
        trace = {'p': p, 'q': q}
        for item, found in zip(items, compiled.run(trace), strict=True):
            assert found == by_sums(item, trace)
