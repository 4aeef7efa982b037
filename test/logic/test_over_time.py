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

"""The reference semantics of numbers over time: worked by hand, and against brute force."""

from fractions import Fraction
import math
from random import Random
from typing import Any

from fret_monitor.logic.evaluate import evaluate
from fret_monitor.logic.formula import (
    Aggregate, Ago, Binary, BinaryOperator, Formula, Held, Historically, Once, Over, Slope,
    TimeOver, TRUE, Variable, Window,
)
from fret_monitor.logic.pointwise import TraceError
from fret_monitor.logic.timed import evaluate_timed, TimedTrace
from fret_monitor.model.values import ValueType
import pytest
from strategies import all_values, random_trace

P, AT = Variable('p', ValueType.BOOL), Variable('at', ValueType.BOOL)
X = Variable('x', ValueType.FLOAT64)
N, U = Variable('n', ValueType.INT64), Variable('u', ValueType.UINT64)
NAN, INF = math.nan, math.inf


def over(aggregate: Aggregate, past: int, column: list[Any], x: Variable = X) -> list[Any]:
    return evaluate(Over(aggregate, past, x, TRUE), {x.name: column})


@pytest.mark.parametrize(('aggregate', 'column', 'expected'), [
    (Aggregate.GREATEST, [1.0, 3.0, 2.0, 0.0], [1.0, 3.0, 3.0, 2.0]),
    (Aggregate.LEAST, [1.0, 3.0, 2.0, 5.0], [1.0, 1.0, 2.0, 2.0]),
    (Aggregate.SUM, [1.0, 3.0, 2.0, 5.0], [1.0, 4.0, 5.0, 7.0]),
    (Aggregate.MEAN, [1.0, 3.0, 2.0, 5.0], [1.0, 2.0, 2.5, 3.5]),
    (Aggregate.SUM, [1e308, 1e308, -1e308, 0.0], [1e308, INF, 0.0, -1e308]),
    (Aggregate.MEAN, [1e308, 1e308, 0.1, 0.1], [1e308, 1e308, 5e307, 0.1]),
    (Aggregate.SUM, [INF, 1.0, -INF, 1.0], [INF, INF, -INF, -INF]),
    (Aggregate.SUM, [INF, -INF, 1.0, 1.0], [INF, NAN, -INF, 2.0]),
    (Aggregate.MEAN, [NAN, 1.0, 2.0, 4.0], [NAN, NAN, 1.5, 3.0]),
    (Aggregate.GREATEST, [INF, NAN, 1.0, 2.0], [INF, NAN, NAN, 2.0]),
    (Aggregate.LEAST, [0.0, -0.0, 0.0, 0.0], [0.0, -0.0, -0.0, 0.0]),
    (Aggregate.GREATEST, [-0.0, 0.0, -0.0, -0.0], [-0.0, 0.0, 0.0, -0.0]),
    (Aggregate.SUM, [-0.0, -0.0, -5e-324, 5e-324], [0.0, 0.0, -5e-324, 0.0]),
    (Aggregate.MEAN, [5e-324, 0.0, -5e-324, 0.0], [5e-324, 0.0, -0.0, -0.0]),
])
def test_a_window_of_two_steps_is_as_computed_by_hand(
        aggregate: Aggregate, column: list[float], expected: list[float]) -> None:
    assert list(map(repr, over(aggregate, 1, column))) == list(map(repr, expected))


def test_sums_of_integers_wrap_and_counts_count() -> None:
    assert over(Aggregate.SUM, 1, [2 ** 63 - 1, 1, 5], N) == [2 ** 63 - 1, -2 ** 63, 6]
    assert over(Aggregate.SUM, 1, [2 ** 64 - 1, 2, 5], U) == [2 ** 64 - 1, 1, 7]
    assert over(Aggregate.COUNT, 2, [True, False, True, True], P) == [1, 1, 2, 2]


def test_a_sum_is_the_exact_one_rounded_once() -> None:
    rng = Random(1)
    values = [value for value in all_values(ValueType.FLOAT64) if math.isfinite(value)]
    column = [rng.choice(values) for _ in range(300)]
    for past in (0, 1, 7, 400):
        for t, found in enumerate(over(Aggregate.MEAN, past, column)):
            window = [Fraction(item) for item in column[max(0, t - past):t + 1]]
            assert found == float(sum(window) / len(window))


def test_the_past_of_a_number_begins_with_the_first_step() -> None:
    assert evaluate(Ago(2, X), {'x': [1.0, 2.0, 3.0, 4.0, 5.0]}) == [1.0, 1.0, 1.0, 2.0, 3.0]
    held = evaluate(Held(P, X), {'p': [False, False, True, False, True],
                                 'x': [1.0, 2.0, 3.0, 4.0, 5.0]})
    assert held == [1.0, 1.0, 3.0, 3.0, 5.0]
    columns = {'p': [True, True, False, True, False, False]}
    assert evaluate(TimeOver(3, 2, P), columns) == [False, True, True, True, False, False]


@pytest.mark.parametrize('past', [0, 1, 3, 9])
def test_a_bound_of_the_greatest_number_is_a_bound_of_all(past: int) -> None:
    other = Variable('y_float64', ValueType.FLOAT64)
    x = Variable('x_float64', ValueType.FLOAT64)
    constant = random_trace(Random(past), [other], 1)['y_float64'] * 300
    trace = {**random_trace(Random(past), [x], 300), 'y_float64': constant}

    def same(one: Formula, two: Formula) -> bool:
        return evaluate(one, trace) == evaluate(two, trace)

    at_most = Binary(BinaryOperator.LE, x, other)
    assert same(Binary(BinaryOperator.LE, Over(Aggregate.GREATEST, past, x, TRUE), other),
                Historically(Window(0, past), at_most))
    at_least = Binary(BinaryOperator.GE, x, other)
    assert same(Binary(BinaryOperator.GE, Over(Aggregate.LEAST, past, x, TRUE), other),
                Historically(Window(0, past), at_least))
    count = Binary(BinaryOperator.GT, Over(Aggregate.COUNT, past, at_most, TRUE),
                   Over(Aggregate.COUNT, past, Binary(BinaryOperator.LT, x, x), TRUE))
    assert same(count, Once(Window(0, past), at_most))


def test_nanoseconds_are_steps() -> None:
    rng = Random(3)
    rows = 60
    columns: dict[str, list[Any]] = {
        'p': [rng.random() < 0.5 for _ in range(rows)],
        'at': [rng.random() < 0.3 for _ in range(rows)],
        'x': [rng.choice([0.1, 1e16, -3.0, NAN, INF]) if rng.random() < 0.3 else 2.0
              for _ in range(rows)]}
    trace = TimedTrace(range(rows), columns, rows - 1)
    formulas: list[Formula] = [
        *(Over(aggregate, past, X, TRUE if aggregate.is_extreme else AT)
          for aggregate in Aggregate if aggregate is not Aggregate.COUNT for past in (0, 1, 5)),
        *(Over(Aggregate.COUNT, past, P, AT) for past in (0, 1, 5)),
        *(Ago(past, X) for past in (0, 1, 5)), Held(P, X), Slope(X, AT, 1),
        *(TimeOver(past, least, P) for past in (1, 2, 7) for least in (0, 1, 2, 5, 8))]
    for formula in formulas:
        history = dict(evaluate_timed([formula], trace)[0])
        value: Any = None
        for t, expected in enumerate(evaluate(formula, columns)):
            value = history.get(t, value)
            assert repr(value) == repr(expected)


@pytest.mark.parametrize('formula', [Over(Aggregate.MEAN, 5, X, AT), Slope(X, AT, 1)])
def test_a_message_that_lasts_a_second_is_refused(formula: Formula) -> None:
    trace = TimedTrace([0, 10 ** 9], {'x': [1.0, 2.0], 'at': [True, False]}, 2 * 10 ** 9)
    with pytest.raises(TraceError, match='messages come at more than'):
        evaluate_timed([formula], trace)
