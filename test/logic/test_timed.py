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

"""Tests of the reference semantics under `timed`, against the one that takes every tick."""

from collections.abc import Sequence
from itertools import pairwise, product
import math
from random import Random
import struct
from typing import Any

from fret_monitor.logic import timed
from fret_monitor.logic.evaluate import Equations, evaluate_all
from fret_monitor.logic.formula import (
    ALWAYS, Binary, BinaryOperator, Choice, Constant, Feedback, Formula, FTP, Historically, Once,
    Previous, Since, Triggered, Unary, UnaryOperator, Variable, WeakYesterday, Window, Yesterday,
)
from fret_monitor.logic.pointwise import TraceError, Value
from fret_monitor.logic.timed import evaluate_timed, History, TimedTrace, value_at, verdict_rows
from fret_monitor.model.values import ValueType
from hypothesis import given, settings
from hypothesis import strategies as st
import pytest
from strategies import (
    EXAMPLES, FormulaMaker, formulas, INPUTS, make_timed_trace, on_both_scales, random_property,
    TERM_TYPES, timed_traces, Trace,
)

BOOL, INT64, FLOAT64 = ValueType.BOOL, ValueType.INT64, ValueType.FLOAT64
P, Q = Variable('p', BOOL), Variable('q', BOOL)
WINDOWS = [Window(low, high) for low in range(4) for high in (None, *range(-1, 6))]
SECOND = 10 ** 9


def no(p: Formula) -> Formula:
    return Unary(UnaryOperator.NOT, p)


def both(p: Formula, q: Formula) -> Formula:
    return Binary(BinaryOperator.AND, p, q)


def implies(p: Formula, q: Formula) -> Formula:
    return Binary(BinaryOperator.IMPLIES, p, q)


def every_tick(trace: TimedTrace) -> Trace:
    """Return the trace with a row for each tick."""
    lengths = [until - tick for tick, until in pairwise([*trace.ticks, trace.end + 1])]
    return {name: [value for value, length in zip(column, lengths, strict=True)
                   for _ in range(length)]
            for name, column in trace.columns.items()}


def intervals(column: Sequence[Value]) -> list[tuple[int, object]]:
    """Return the ticks at which a value of every tick changes."""
    pieces = [(tick, bits(value)) for tick, value in enumerate(column)]
    return pieces[:1] + [piece for before, piece in pairwise(pieces) if piece[1] != before[1]]


def bits(value: Value) -> object:
    """Return what is the same for equal bits, and for all NaN."""
    if isinstance(value, float):
        return 'nan' if math.isnan(value) else struct.pack('<d', value)
    return type(value), value


def check(formulas: Sequence[Formula], trace: TimedTrace, feedback: Equations = ()) -> None:
    """Compare all histories with the values at every tick."""
    found = evaluate_timed(formulas, trace, feedback)
    expected = evaluate_all(formulas, every_tick(trace), feedback)
    for number, (history, column) in enumerate(zip(found, expected, strict=True)):
        shown = [(start, bits(value)) for start, value in history]
        assert shown == intervals(column), f'formula {number}'


def test_every_prefix_operator_is_that_of_every_tick_on_all_short_traces() -> None:
    formulas: list[Formula] = [P, no(P), Yesterday(P), WeakYesterday(P), FTP]
    formulas += [operator(window, P) for window in WINDOWS for operator in (Once, Historically)]
    for length in (1, 2, 7):
        for p in product((False, True), repeat=length):
            check(formulas, TimedTrace(range(length), {'p': p}, length - 1))


def test_every_infix_operator_is_that_of_every_tick_on_all_short_traces() -> None:
    formulas: list[Formula] = [
        Binary(item, P, Q) for item in BinaryOperator
        if item.is_boolean or item in (BinaryOperator.EQ, BinaryOperator.NE)]
    formulas += [operator(window, P, Q) for window in WINDOWS for operator in (Since, Triggered)]
    formulas += [Previous(P, Q), Choice(P, Q, no(Q)), Previous(no(Q), P)]
    for p, q in product(product((False, True), repeat=4), repeat=2):
        check(formulas, TimedTrace(range(4), {'p': p, 'q': q}, 3))


@pytest.mark.parametrize('operator', [Since, Triggered])
def test_since_over_long_intervals_is_that_of_every_tick(operator: Any) -> None:
    windows = [Window(low, high) for low in (0, 1, 2, 6, 11) for high in (None, low, low + 1, 13)]
    ticks = (0, 1, 3, 8, 20, 21, 30)
    for seed in range(40):
        trace = make_timed_trace(Random(seed).randrange, (P, Q), 7, (1, 2, 5, 12))
        check([operator(window, P, Q) for window in windows], trace)
        check([operator(window, P, Q) for window in windows],
              TimedTrace(ticks, trace.columns, 33))


@settings(max_examples=3 * EXAMPLES, deadline=None)
@given(formulas(size=20, reach=17), timed_traces())
def test_any_formula_is_that_of_every_tick(formula: Formula, trace: TimedTrace) -> None:
    check([formula], trace)


@pytest.mark.parametrize('seed', range(30))
def test_terms_and_equations_are_those_of_every_tick(seed: int) -> None:
    rng = Random(seed)
    maker = FormulaMaker(rng.randrange, INPUTS, reach=17)
    terms = [maker.term(kind, 15) for kind in TERM_TYPES]
    trace = make_timed_trace(rng.randrange, INPUTS, 12, (1, 2, 3, 9))
    check([*INPUTS, *terms], trace)
    for number in range(5):
        item = random_property(rng, f'R-{number}', size=15, reach=9, loops=3)
        check([item.formula], trace, item.feedback)


def test_an_equation_that_settles_needs_no_step_a_tick() -> None:
    latched, late = Feedback('latched', BOOL), Feedback('late', BOOL)
    equations: Equations = [(latched, Binary(BinaryOperator.OR, latched, P)), (late, latched)]
    trace = TimedTrace([0, 5 * SECOND, 6 * SECOND], {'p': [False, True, False]}, 2 ** 62)
    assert evaluate_timed([latched, late], trace, equations) == [
        [(0, False), (5 * SECOND + 1, True)], [(0, False), (5 * SECOND + 2, True)]]


def test_an_equation_that_counts_its_ticks_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(timed, '_MAX_FEEDBACK_CHANGES', 50)
    count = Feedback('count', INT64)
    equation = Binary(BinaryOperator.ADD, count, Constant(1, INT64))
    with pytest.raises(TraceError, match='an equation changes its value at more than'):
        evaluate_timed([count], TimedTrace([0], {}, 10 * SECOND), [(count, equation)])


def answered(at: int | None, end: int = 40 * SECOND) -> History:
    """Evaluate FRET's `within 10 seconds`: p triggers at 0, q answers at `at` for a second."""
    rows = [(0, True, at == 0), (2 * SECOND, False, False)]
    if at is not None:
        rows += [(at, False, True), (at + SECOND, False, False)]
    ticks, p, q = zip(*rows, strict=True)
    edge = both(P, Binary(BinaryOperator.OR, FTP, Yesterday(no(P))))
    deadline = Window(10 * SECOND, 10 * SECOND)
    formula = Historically(ALWAYS, implies(
        Once(deadline, both(edge, no(Q))), Once(Window(0, 10 * SECOND - 1), Q)))
    return evaluate_timed([formula], TimedTrace(ticks, {'p': p, 'q': q}, end))[0]


@pytest.mark.parametrize(('answer', 'expected'), [
    (10 * SECOND, [(0, True)]),
    (10 * SECOND + 1, [(0, True), (10 * SECOND, False)]),
    (15 * SECOND, [(0, True), (10 * SECOND, False)]),
    (None, [(0, True), (10 * SECOND, False)]),
])
def test_an_answer_counts_up_to_the_nanosecond_of_its_deadline(
        answer: int | None, expected: History) -> None:
    assert answered(answer) == expected


def test_an_edge_is_true_for_one_nanosecond() -> None:
    trace = TimedTrace([0, 3 * SECOND, 7 * SECOND], {'p': [False, True, False]}, 2 ** 63)
    assert evaluate_timed([both(P, Yesterday(no(P)))], trace) == [
        [(0, False), (3 * SECOND, True), (3 * SECOND + 1, False)]]


def test_windows_reach_2_to_the_62() -> None:
    far = 2 ** 62
    trace = TimedTrace([0, 5, 6], {'p': [False, True, False]}, 2 ** 63)
    assert evaluate_timed([
        Once(Window(far, far), P), Once(Window(0, far), P), Historically(Window(0, far), no(P)),
        Since(Window(far, None), no(P), P), Once(Window(far, None), P),
    ], trace) == [
        [(0, False), (far + 5, True), (far + 6, False)],
        [(0, False), (5, True), (far + 6, False)],
        [(0, True), (5, False), (far + 6, True)],
        [(0, False), (far + 5, True)],
        [(0, False), (far + 5, True)],
    ]


@pytest.mark.parametrize('seed', range(40))
def test_on_a_grid_of_seconds_it_is_one_step_a_second(seed: int) -> None:
    rng = Random(seed)
    formula, scaled = on_both_scales(rng.randrange, 5, SECOND)
    trace = make_timed_trace(rng.randrange, (P, Q), 12, (1, 2, 3, 9))
    seconds = TimedTrace([tick * SECOND for tick in trace.ticks], trace.columns,
                         trace.end * SECOND)
    assert evaluate_timed([scaled], seconds)[0] == [
        (tick * SECOND, value) for tick, value in evaluate_timed([formula], trace)[0]]


def test_rows_are_those_of_the_trace_and_of_each_change() -> None:
    trace = TimedTrace([0, 10, 20], {'p': [True, True, False]}, 30)
    histories = evaluate_timed([Historically(Window(0, 5), P), Once(Window(3, 4), P)], trace)
    assert verdict_rows(histories, trace) == [
        (0, [True, False]), (3, [True, True]), (10, [True, True]), (20, [False, True]),
        (24, [False, False])]


def test_a_history_has_a_value_at_every_tick() -> None:
    history: History = [(0, 1), (5, 2), (9, 3)]
    assert [value_at(history, tick) for tick in (0, 4, 5, 8, 9, 100)] == [1, 1, 2, 2, 3, 3]


@pytest.mark.parametrize(('ticks', 'end'), [
    ([], 0), ([1], 1), ([0, 0], 1), ([0, 2, 1], 3), ([0, 5], 4),
])
def test_ticks_that_do_not_increase_from_0_are_refused(ticks: list[int], end: int) -> None:
    with pytest.raises(TraceError):
        TimedTrace(ticks, {}, end)


@pytest.mark.parametrize('columns', [
    {'q': [True, True]}, {'p': [True]}, {'p': [True, True, True]}, {'p': [True, 2]},
])
def test_a_timed_trace_that_does_not_fit_is_refused(columns: dict[str, list[Any]]) -> None:
    with pytest.raises(TraceError):
        evaluate_timed([P], TimedTrace([0, 1], columns, 1))


def test_feedback_without_an_equation_is_refused() -> None:
    with pytest.raises(TraceError, match="no equation for 'a'"):
        evaluate_timed([Feedback('a', BOOL)], TimedTrace([0], {}, 1))


@settings(deadline=None)
@given(st.data())
def test_a_later_end_changes_nothing_before(data: st.DataObject) -> None:
    formula, trace = data.draw(formulas(size=20)), data.draw(timed_traces())
    later = TimedTrace(trace.ticks, trace.columns, trace.end + 1000)
    longer = evaluate_timed([formula], later)[0]
    assert evaluate_timed([formula], trace)[0] == [
        piece for piece in longer if piece[0] <= trace.end]
