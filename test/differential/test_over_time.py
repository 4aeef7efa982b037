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

"""Numbers over time: compiled C against the reference, with every function and window."""

from collections.abc import Iterator, Mapping, Sequence
from fractions import Fraction
import math
from random import Random

from differential.compiled import Compiled
from differential.test_random_formulas import assert_equal
from differential.test_timed_formulas import assert_equal as assert_equal_at_ticks
from differential.test_timed_formulas import no, SCALES, SECOND, traces_at, under_timed
from differential.timed_monitor import TimedMonitor
from fret_monitor.logic.formula import (
    Aggregate, Ago, Binary, BinaryOperator, Constant, Conversion, Formula, Held, MessageSlope,
    Once, Over, postorder, Previous, Slope, TimeOver, TRUE, Variable, Window, Yesterday,
)
from fret_monitor.logic.timed import evaluate_timed, TimedTrace, value_at
from fret_monitor.model.values import ValueType
from fret_monitor.program.lower import lower
from fret_monitor.program.monitor_program import Total
import pytest
from strategies import (
    as_term, EXAMPLES, INPUTS, property_of, random_trace, specification_of, TERM_TYPES, thorough,
)

FLOAT64 = ValueType.FLOAT64
P, Q = Variable('p', ValueType.BOOL), Variable('q', ValueType.BOOL)
X, Y = Variable('x_float64', FLOAT64), Variable('y_float64', FLOAT64)
PASTS = (0, 1, 2, 3, 7, 8, 20, 63, 64, 65, 200)
MESSAGE = Binary(BinaryOperator.AND, Q, no(Yesterday(Q)))


def less(left: Formula, right: Formula) -> Formula:
    return Binary(BinaryOperator.LT, left, right)


def equal(left: Formula, right: Formula) -> Formula:
    return Binary(BinaryOperator.EQ, left, right)


def number(value: float, kind: ValueType = FLOAT64) -> Formula:
    return Constant(value if kind.is_float else int(value), kind)


def of_input(letter: str, kind: ValueType) -> Formula:
    return as_term(next(item for item in INPUTS if item.name == f'{letter}_{kind.value}'), kind)


def exact(past: int, at: Formula) -> Iterator[Formula]:
    """Yield comparisons of sums and means, which show each bit and the sign of 0."""
    narrow = Conversion(Variable('x_float32', ValueType.FLOAT32), FLOAT64)
    for aggregate in (Aggregate.SUM, Aggregate.MEAN):
        for x in (X, narrow):
            found = Over(aggregate, past, x, at)
            yield less(found, Y)
            yield equal(found, Previous(number(0.0), found))
            yield less(Binary(BinaryOperator.DIV, number(1.0), found), number(0.0))


def comparisons(past: int, at: Formula) -> Iterator[Formula]:
    """Yield what shows the value of each function with a window."""
    yield from exact(past, at)
    for kind in TERM_TYPES:
        x, y = of_input('x', kind), of_input('y', kind)
        for aggregate in (Aggregate.GREATEST, Aggregate.LEAST):
            yield less(Over(aggregate, past, x, TRUE), y)
            yield equal(Over(aggregate, past, x, TRUE), y)
        yield less(Binary(BinaryOperator.SUB, x, Ago(past, x)), number(1, kind))
        yield less(Held(P, x), y)
        if kind.is_integer:
            yield less(Over(Aggregate.SUM, past, x, at), number(1000, kind))
    if at is TRUE:
        time = as_term(Variable('x_int32', ValueType.INT32), ValueType.INT64)
        yield less(MessageSlope(X, P, time), Y)
        yield equal(MessageSlope(X, TRUE, time), Previous(number(0.0), Y))
        yield less(Slope(X, P, 10_000_000), Y)
        yield less(Slope(X, TRUE, 1), Y)
    else:
        yield less(Slope(X, at, 1), Y)
        yield equal(Slope(Slope(X, at, 1), at, 1), Previous(number(0.0), Slope(X, at, 1)))
    for count in (0, 1, 3, past // 2):
        yield less(number(count, ValueType.INT64), Over(Aggregate.COUNT, past, P, at))
    for least in {0, 1, 2, past // 2, past - 1, past, past + 1}:
        yield TimeOver(past, least, P)
        yield TimeOver(past, least, Once(Window(0, 1), P))


@pytest.mark.parametrize('seed', range(max(1, EXAMPLES // 25)))
def test_each_function_has_each_window_of_steps(seed: int) -> None:
    formulas = dict.fromkeys(item for past in PASTS for item in comparisons(past, TRUE))
    properties = [property_of(f'R-{index}', item) for index, item in enumerate(formulas)]
    assert_equal(properties, random_trace(Random(seed), INPUTS, 500), resets=(5, 6, 250))


@pytest.mark.parametrize('scale', SCALES)
def test_each_function_has_each_window_of_ticks(scale: str) -> None:
    bounds = [bound for bound in SCALES[scale].bounds if bound <= SCALES[scale].longest_exact]
    formulas = dict.fromkeys(item for past in bounds for item in comparisons(past, MESSAGE))
    properties = [property_of(f'R-{index}', item) for index, item in enumerate(formulas)]
    traces = traces_at(Random(1).randrange, SCALES[scale])
    assert_equal_at_ticks(properties, traces, max_rate=SCALES[scale].max_rate)


def mean_of_many(steps: int, past: int) -> None:
    """Compare a mean of values of 0.1 and few of 1e16 with fractions, at some steps."""
    rng = Random(steps)
    column = [rng.choice([1e16, -1e16]) if rng.random() < 1e-3 else 0.1 for _ in range(steps)]
    mean = Over(Aggregate.MEAN, past, X, TRUE)
    bounds = [0.1, 0.0, 0.3]
    properties = [property_of(f'R-{index}', equal(mean, number(bound)))
                  for index, bound in enumerate(bounds)]
    found = Compiled(specification_of(properties, (X,))).run({'x_float64': column})
    large = [step for step, value in enumerate(column) if abs(value) > 1]
    for step in [*range(past, steps, steps // 100), *(step + past + 1 for step in large[:200])]:
        if step < steps:
            window = column[max(0, step - past):step + 1]
            expected = float(sum(map(Fraction, window)) / len(window))
            assert [row[step] for row in found] == [expected == bound for bound in bounds]
    assert sum(found[0]) > steps // 10  # it comes back to exactly 0.1


def test_a_large_value_that_has_left_leaves_nothing_behind() -> None:
    mean_of_many(200_000, 500)


@thorough
def test_a_mean_over_ten_million_steps_does_not_drift() -> None:
    mean_of_many(10_000_000, 500)


def run_at(formula: Formula, ticks: Sequence[int], columns: Mapping[str, Sequence[float]],
           end: int, rate: int = 10) -> tuple[list[tuple[int, object]], list[tuple[int, object]]]:
    """Return what the compiled monitor and the reference say."""
    inputs = tuple(item for item in postorder([formula]) if isinstance(item, Variable))
    trace = TimedTrace(ticks, columns, end)
    monitor = TimedMonitor(under_timed([property_of('R-1', formula)], inputs, Fraction(rate)))
    return list(monitor.run(trace).verdicts[0]), list(evaluate_timed([formula], trace)[0])


def test_a_window_that_nothing_enters_for_an_hour_is_empty() -> None:
    hour = 3600 * SECOND
    for formula in (less(Over(Aggregate.SUM, SECOND, X, MESSAGE), number(1.0)),
                    less(Over(Aggregate.MEAN, SECOND, X, MESSAGE), number(1.0)),
                    less(Over(Aggregate.COUNT, SECOND, Q, MESSAGE),
                         number(1, ValueType.INT64))):
        columns: dict[str, Sequence[float]] = {
            'x_float64': [5.0, 5.0, 5.0, 5.0], 'q': [False, True, False, True]}
        found, expected = run_at(formula, [0, 1, 2, hour], columns, 2 * hour)
        assert found == expected
        assert [tick for tick, _ in found] == [0, 1, SECOND + 2, hour, hour + SECOND + 1][
            :len(found)] or len(found) == 1  # the mean of nothing is NaN


def test_the_verdict_of_a_time_turns_at_the_exact_nanosecond() -> None:
    formula = TimeOver(10 * SECOND, 2 * SECOND + 1, P)
    ticks = [0, SECOND, 3 * SECOND, 5 * SECOND, 7 * SECOND]
    columns = {'p': [False, True, False, True, False]}
    found, expected = run_at(formula, ticks, columns, 30 * SECOND)
    assert found == expected
    assert found == [(0, False), (5 * SECOND, True), (13 * SECOND - 1, False)]


@pytest.mark.parametrize('formula', [
    less(Over(Aggregate.GREATEST, SECOND, X, TRUE), number(INF := math.inf)),
    less(Binary(BinaryOperator.SUB, X, Ago(SECOND, X)), number(INF)),
    less(Over(Aggregate.SUM, SECOND, X, MESSAGE), number(INF)),
    less(Over(Aggregate.COUNT, SECOND, P, MESSAGE), number(10 ** 6, ValueType.INT64)),
    no(TimeOver(SECOND, SECOND, P)),
])
def test_more_changes_than_the_rate_allows_violate_until_they_have_left(formula: Formula) -> None:
    # 50 messages in 500 ns, where 10 in a second are expected.
    ticks = list(range(0, 1010, 10))
    values = [index % 2 == 1 for index, _ in enumerate(ticks)]
    columns: dict[str, Sequence[float]] = {
        'p': [*values], 'q': [*values], 'x_float64': [float(tick) for tick in ticks]}
    found, expected = run_at(formula, ticks, columns, 5 * SECOND)
    assert expected == [(0, True)]
    lost = [tick for tick, value in found if not value]
    assert len(lost) == 1 and lost[0] < 600
    assert SECOND < found[-1][0] < SECOND + 1010 and found[-1][1] is True
    assert value_at(found, lost[0] - 1) is True  # type: ignore[arg-type]


def test_equal_windows_share_their_cells() -> None:
    windows = [Over(aggregate, 20, X, TRUE) for aggregate in (Aggregate.SUM, Aggregate.MEAN)]
    properties = [property_of(f'R-{index}', less(item, number(index)))
                  for index, item in enumerate([*windows, *windows])]
    group, = lower(specification_of(properties)).groups
    assert sum(isinstance(item.operation, Total) for item in group.equations) == 1
