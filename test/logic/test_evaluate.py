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

"""Tests of the reference semantics: the table of operators, worked by hand and by brute force."""

from collections.abc import Callable, Sequence
from fractions import Fraction
from itertools import product
import math
import struct
from typing import Any

from fret_monitor.logic.evaluate import Equations, evaluate, evaluate_all, Trace, verdicts
from fret_monitor.logic.formula import (
    ALWAYS, Binary, BinaryOperator, Choice, Constant, Conversion, FALSE, Feedback, Formula, FTP,
    Historically, Once, Previous, Since, Triggered, TRUE, Unary, UnaryOperator, Variable,
    WeakYesterday, Window, Yesterday,
)
from fret_monitor.logic.pointwise import TraceError
from fret_monitor.model.values import ValueType
from hypothesis import given, settings
from hypothesis import strategies as st
import pytest
from strategies import all_values, finite_values, formulas, INPUTS, traces

BOOL, INT64, UINT64 = ValueType.BOOL, ValueType.INT64, ValueType.UINT64
FLOAT32, FLOAT64 = ValueType.FLOAT32, ValueType.FLOAT64
P, Q = Variable('p', BOOL), Variable('q', BOOL)
INT64_MIN, INT64_MAX = -2 ** 63, 2 ** 63 - 1
WINDOWS = [Window(low, high) for low in range(4) for high in (None, *range(-1, 6))]


def bits(text: str) -> list[bool]:
    """Read `0110` as four steps."""
    return [letter == '1' for letter in text]


def shown(formula: Formula, **columns: str) -> str:
    """Evaluate over columns such as p='0110' and write the verdicts the same way."""
    trace = {name: bits(text) for name, text in columns.items()}
    return ''.join('01'[value] for value in verdicts(formula, trace))


@pytest.mark.parametrize(('formula', 'expected'), [
    (Yesterday(P), '0011001'),
    (WeakYesterday(P), '1011001'),
    (Once(ALWAYS, P), '0111111'),
    (Historically(ALWAYS, P), '0000000'),
    (Once(Window(0, 1), P), '0111011'),
    (Once(Window(1, 2), P), '0011101'),
    (Once(Window(2, None), P), '0001111'),
    (Historically(Window(0, 1), P), '0010000'),
    (Historically(Window(1, 2), P), '1001000'),
    (Historically(Window(3, None), P), '1110000'),
    (Once(Window(0, -1), P), '0000000'),
    (Historically(Window(0, -1), P), '1111111'),
    (FTP, '1000000'),
    (TRUE, '1111111'),
    (FALSE, '0000000'),
])
def test_a_unary_operator_is_as_computed_by_hand(formula: Formula, expected: str) -> None:
    assert shown(formula, p='0110010') == expected


@pytest.mark.parametrize(('formula', 'expected'), [
    (Since(ALWAYS, P, Q), '0110110'),
    (Since(Window(1, None), P, Q), '0010010'),
    (Since(Window(1, 1), P, Q), '0010010'),
    (Since(Window(0, 0), P, Q), '0100100'),
    (Since(Window(0, -1), P, Q), '0000000'),
    (Triggered(ALWAYS, P, Q), '0100000'),
    (Triggered(Window(0, -1), P, Q), '1111111'),
    (Triggered(Window(1, 1), P, Q), '1110010'),
])
def test_a_binary_operator_is_as_computed_by_hand(formula: Formula,
                                                  expected: str) -> None:
    assert shown(formula, p='0110010', q='0100100') == expected


def once(window: Window, p: Sequence[bool], t: int) -> bool:
    return any(p[k] for k in range(t + 1) if inside(window, t - k))


def since(window: Window, p: Sequence[bool], q: Sequence[bool], t: int) -> bool:
    return any(q[k] and all(p[j] for j in range(k + 1, t + 1))
               for k in range(t + 1) if inside(window, t - k))


def inside(window: Window, distance: int) -> bool:
    return window.low <= distance and (window.high is None or distance <= window.high)


@pytest.mark.parametrize('window', WINDOWS, ids=str)
def test_a_window_looks_exactly_as_far_as_it_says(window: Window) -> None:
    for p in product((False, True), repeat=6):
        expected = [once(window, p, t) for t in range(6)]
        assert verdicts(Once(window, P), {'p': p}) == expected
        dual = verdicts(Historically(window, P), {'p': [not value for value in p]})
        assert dual == [not value for value in expected]


@pytest.mark.parametrize('window', WINDOWS, ids=str)
def test_since_and_its_dual_are_their_quantifiers_on_every_short_trace(window: Window) -> None:
    for p, q in product(product((False, True), repeat=4), repeat=2):
        expected = [since(window, p, q, t) for t in range(4)]
        assert verdicts(Since(window, P, Q), {'p': p, 'q': q}) == expected
        trace = {'p': [not value for value in p], 'q': [not value for value in q]}
        assert verdicts(Triggered(window, P, Q), trace) == [not value for value in expected]


@pytest.mark.parametrize(('operator', 'expected'), [
    (BinaryOperator.AND, '0001'),
    (BinaryOperator.OR, '0111'),
    (BinaryOperator.XOR, '0110'),
    (BinaryOperator.IMPLIES, '1101'),
    (BinaryOperator.IFF, '1001'),
    (BinaryOperator.EQ, '1001'),
    (BinaryOperator.NE, '0110'),
])
def test_a_connective_has_its_truth_table(operator: BinaryOperator, expected: str) -> None:
    assert shown(Binary(operator, P, Q), p='0011', q='0101') == expected


def apply(operator: BinaryOperator, kind: ValueType, a: Any, b: Any) -> Any:
    """Compute one operation on two inputs."""
    right = kind if operator is not BinaryOperator.POW or kind is FLOAT64 else INT64
    formula = Binary(operator, Variable('a', kind), Variable('b', right))
    return evaluate(formula, {'a': [a], 'b': [b]})[0]


@pytest.mark.parametrize(('operator', 'a', 'b', 'expected'), [
    (BinaryOperator.ADD, INT64_MAX, 1, INT64_MIN),
    (BinaryOperator.SUB, INT64_MIN, 1, INT64_MAX),
    (BinaryOperator.MUL, INT64_MIN, -1, INT64_MIN),
    (BinaryOperator.MUL, 2 ** 62, 6, INT64_MIN),
    (BinaryOperator.DIV, 7, 2, 3),
    (BinaryOperator.DIV, -7, 2, -3),
    (BinaryOperator.DIV, 7, -2, -3),
    (BinaryOperator.DIV, 5, 0, 0),
    (BinaryOperator.DIV, INT64_MIN, -1, INT64_MIN),
    (BinaryOperator.DIV, INT64_MIN, 3, -3074457345618258602),
    (BinaryOperator.MOD, 7, 3, 1),
    (BinaryOperator.MOD, -7, 3, -1),
    (BinaryOperator.MOD, 7, -3, 1),
    (BinaryOperator.MOD, -7, 0, 0),
    (BinaryOperator.MOD, INT64_MIN, -1, 0),
    (BinaryOperator.POW, 3, 4, 81),
    (BinaryOperator.POW, 0, 0, 1),
    (BinaryOperator.POW, -2, 63, INT64_MIN),
    (BinaryOperator.POW, 3, 41, -420491770248316829),
    (BinaryOperator.MIN, 3, -4, -4),
    (BinaryOperator.MAX, 3, -4, 3),
])
def test_int64_wraps_and_truncates(operator: BinaryOperator, a: int, b: int,
                                   expected: int) -> None:
    assert apply(operator, INT64, a, b) == expected


@pytest.mark.parametrize(('operator', 'a', 'b', 'expected'), [
    (BinaryOperator.ADD, 2 ** 64 - 1, 1, 0),
    (BinaryOperator.SUB, 0, 1, 2 ** 64 - 1),
    (BinaryOperator.MUL, 2 ** 63, 2, 0),
    (BinaryOperator.DIV, 2 ** 64 - 1, 2, 2 ** 63 - 1),
    (BinaryOperator.DIV, 1, 0, 0),
    (BinaryOperator.MOD, 2 ** 64 - 1, 10, 5),
    (BinaryOperator.MOD, 1, 0, 0),
    (BinaryOperator.POW, 2 ** 64 - 1, 2, 1),
])
def test_uint64_wraps(operator: BinaryOperator, a: int, b: int, expected: int) -> None:
    assert apply(operator, UINT64, a, b) == expected


@pytest.mark.parametrize(('operator', 'kind', 'value', 'expected'), [
    (UnaryOperator.NEG, INT64, INT64_MIN, INT64_MIN),
    (UnaryOperator.ABS, INT64, INT64_MIN, INT64_MIN),
    (UnaryOperator.ABS, INT64, -5, 5),
    (UnaryOperator.NEG, UINT64, 1, 2 ** 64 - 1),
    (UnaryOperator.ABS, UINT64, 2 ** 64 - 1, 2 ** 64 - 1),
    (UnaryOperator.NEG, FLOAT64, 0.0, -0.0),
    (UnaryOperator.ABS, FLOAT64, -0.0, -0.0),
    (UnaryOperator.ABS, FLOAT32, -1.5, 1.5),
    (UnaryOperator.ABS, FLOAT64, -math.inf, math.inf),
])
def test_the_sign_of_a_number_is_changed_in_its_type(operator: UnaryOperator, kind: ValueType,
                                                     value: Any, expected: Any) -> None:
    formula = Unary(operator, Variable('a', kind))
    assert same(evaluate(formula, {'a': [value]})[0], expected)


def same(value: Any, expected: Any) -> bool:
    """Compare bit for bit, one NaN like another."""
    if isinstance(expected, float) and not math.isnan(expected):
        return isinstance(value, float) and struct.pack('<d', value) == struct.pack('<d', expected)
    return value == expected or (math.isnan(value) and math.isnan(expected))


@pytest.mark.parametrize(('operator', 'a', 'b', 'expected'), [
    (BinaryOperator.DIV, 1.0, 0.0, math.inf),
    (BinaryOperator.DIV, 1.0, -0.0, -math.inf),
    (BinaryOperator.DIV, 0.0, 0.0, math.nan),
    (BinaryOperator.DIV, math.nan, 0.0, math.nan),
    (BinaryOperator.DIV, -math.inf, -0.0, math.inf),
    (BinaryOperator.MOD, -7.5, 2.0, -1.5),
    (BinaryOperator.MOD, -4.0, 2.0, -0.0),
    (BinaryOperator.MOD, 5.0, 0.0, math.nan),
    (BinaryOperator.MOD, math.inf, 2.0, math.nan),
    (BinaryOperator.MOD, 5.0, math.inf, 5.0),
    (BinaryOperator.MUL, 1e200, 1e200, math.inf),
    (BinaryOperator.MIN, math.nan, 1.0, 1.0),
    (BinaryOperator.MIN, 1.0, math.nan, math.nan),
    (BinaryOperator.MIN, 0.0, -0.0, 0.0),
    (BinaryOperator.MAX, math.nan, 1.0, 1.0),
    (BinaryOperator.MAX, -0.0, 0.0, -0.0),
    (BinaryOperator.POW, 2.0, 0.5, math.sqrt(2.0)),
    (BinaryOperator.POW, -8.0, 1 / 3, math.nan),
    (BinaryOperator.POW, 0.0, -1.0, math.inf),
    (BinaryOperator.POW, 1e200, 2.0, math.inf),
    (BinaryOperator.POW, math.nan, 0.0, 1.0),
])
def test_float64_is_ieee_754_and_min_and_max_choose_as_written(
        operator: BinaryOperator, a: float, b: float, expected: float) -> None:
    assert same(apply(operator, FLOAT64, a, b), expected)


def nearest_float32(value: Fraction) -> float:
    """Round an exact number once, by searching the neighbour whose distance is least."""
    magnitude = abs(value)
    low, high = 0, 0x7f800000
    while high - low > 1:
        middle = (low + high) // 2
        low, high = (middle, high) if pattern(middle) <= magnitude else (low, middle)
    # The step behind the largest finite number counts as 2^128 for rounding: an overflow.
    below, above = magnitude - pattern(low), pattern(high) - magnitude
    chosen = low if below < above or (below == above and low % 2 == 0) else high
    result: float = struct.unpack('<f', struct.pack('<I', chosen))[0]
    return -result if value < 0 else result


def pattern(number: int) -> Fraction:
    """Return the value of a float32 with these bits, of the infinity as if it were finite."""
    exponent, fraction = number >> 23, number & 0x7fffff
    if exponent == 0:
        return Fraction(fraction) * Fraction(2) ** -149
    return Fraction(fraction + 0x800000) * Fraction(2) ** (exponent - 150)


EXACT: dict[BinaryOperator, Callable[[Fraction, Fraction], Fraction]] = {
    BinaryOperator.ADD: lambda a, b: a + b,
    BinaryOperator.SUB: lambda a, b: a - b,
    BinaryOperator.MUL: lambda a, b: a * b,
    BinaryOperator.DIV: lambda a, b: a / b,
}
any_float32 = st.one_of(st.sampled_from(finite_values(FLOAT32)),
                        st.floats(width=32, allow_nan=False, allow_infinity=False))


@settings(deadline=None)
@given(st.sampled_from(sorted(EXACT, key=str)), any_float32, any_float32)
def test_float32_arithmetic_rounds_the_exact_result_once(operator: BinaryOperator, a: float,
                                                         b: float) -> None:
    if operator is BinaryOperator.DIV and b == 0:
        b = 3.0
    expected = nearest_float32(EXACT[operator](Fraction(a), Fraction(b)))
    value = apply(operator, FLOAT32, a, b)
    assert value == expected
    assert value == struct.unpack('<f', struct.pack('<f', value))[0]


def test_a_power_multiplies_by_squaring_in_the_type_of_its_base() -> None:
    def single(value: float) -> float:
        return float(struct.unpack('<f', struct.pack('<f', value))[0])
    x = single(1.1)
    square = single(x * x)
    fourth = single(square * square)
    assert apply(BinaryOperator.POW, FLOAT32, x, 7) == single(single(x * square) * fourth)
    assert same(apply(BinaryOperator.POW, FLOAT32, math.nan, 0), 1.0)
    assert same(apply(BinaryOperator.POW, FLOAT32, 1e20, 2), math.inf)


def repeated(x: float, exponent: int) -> Any:
    formula = Binary(BinaryOperator.POW, Variable('a', FLOAT64), Constant(exponent, INT64))
    return evaluate(formula, {'a': [x]})[0]


def test_a_power_of_a_float64_with_a_whole_exponent_is_not_pow_of_libm() -> None:
    assert repeated(1.1, 3) == 1.1 * (1.1 * 1.1)
    assert repeated(0.999, 2 ** 62) == 0.0
    assert same(repeated(-1.0, 2 ** 63 - 1), -1.0)


@pytest.mark.parametrize(('operator', 'value', 'expected'), [
    (UnaryOperator.SQRT, 2.25, 1.5),
    (UnaryOperator.SQRT, -1.0, math.nan),
    (UnaryOperator.LOG, 0.0, -math.inf),
    (UnaryOperator.LOG, -1.0, math.nan),
    (UnaryOperator.EXP, 1000.0, math.inf),
    (UnaryOperator.ACOS, 2.0, math.nan),
    (UnaryOperator.SIN, math.inf, math.nan),
    (UnaryOperator.COS, 0.0, 1.0),
    (UnaryOperator.FLOOR, -0.5, -1.0),
    (UnaryOperator.CEIL, 1e300, 1e300),
    (UnaryOperator.ROUND, 2.5, 3.0),
    (UnaryOperator.ROUND, -0.5, -1.0),
    (UnaryOperator.ROUND, 0.49999999999999994, 0.0),
    (UnaryOperator.ROUND, math.nan, math.nan),
])
def test_a_function_of_the_library_gives_what_it_gives_in_c(
        operator: UnaryOperator, value: float, expected: float) -> None:
    found, = evaluate(Unary(operator, Variable('a', FLOAT64)), {'a': [value]})
    assert same(found, expected)


@pytest.mark.parametrize('operator', [item for item in BinaryOperator if item.is_relation])
def test_a_comparison_with_nan_is_false_but_for_not_equal(operator: BinaryOperator) -> None:
    for a, b in [(math.nan, 1.0), (1.0, math.nan), (math.nan, math.nan)]:
        assert apply(operator, FLOAT64, a, b) is (operator is BinaryOperator.NE)


def test_signed_and_unsigned_integers_compare_by_value() -> None:
    a, b = Variable('a', INT64), Variable('b', UINT64)
    trace: Trace = {'a': [-1, 5, INT64_MAX], 'b': [2 ** 64 - 1, 5, 2 ** 63]}
    assert evaluate(Binary(BinaryOperator.LT, a, b), trace) == [True, False, True]
    assert evaluate(Binary(BinaryOperator.EQ, a, b), trace) == [False, True, False]
    assert evaluate(Binary(BinaryOperator.GE, b, a), trace) == [True, True, True]


@pytest.mark.parametrize(('source', 'kind', 'value', 'expected'), [
    (ValueType.INT8, INT64, -128, -128),
    (ValueType.UINT32, INT64, 2 ** 32 - 1, 2 ** 32 - 1),
    (INT64, UINT64, -1, 2 ** 64 - 1),
    (UINT64, INT64, 2 ** 63, INT64_MIN),
    (INT64, FLOAT64, 2 ** 53 + 1, 2.0 ** 53),
    (INT64, FLOAT64, 2 ** 53 + 3, 2.0 ** 53 + 4),
    (UINT64, FLOAT64, 2 ** 64 - 1, 2.0 ** 64),
    (FLOAT32, FLOAT64, 0.1, 0.10000000149011612),
])
def test_a_conversion_keeps_wraps_or_rounds(source: ValueType, kind: ValueType, value: Any,
                                            expected: Any) -> None:
    formula = Conversion(Variable('a', source), kind)
    assert same(evaluate(formula, {'a': [value]})[0], expected)


def test_an_input_of_float32_is_rounded_on_its_way_in() -> None:
    assert evaluate(Variable('a', FLOAT32), {'a': [0.1, 1e39]}) == [0.10000000149011612, math.inf]


def test_a_choice_takes_one_branch_and_previous_starts_with_its_initial_value() -> None:
    x, y = Variable('x', INT64), Variable('y', INT64)
    trace: Trace = {'p': bits('0101'), 'x': [1, 2, 3, 4], 'y': [10, 20, 30, 40]}
    assert evaluate(Choice(P, x, y), trace) == [10, 2, 30, 4]
    assert evaluate(Previous(y, x), trace) == [10, 1, 2, 3]
    assert evaluate(Previous(Constant(7, INT64), Previous(y, x)), trace) == [7, 10, 1, 2]


def test_an_equation_that_refers_to_itself_counts() -> None:
    count = Feedback('count', INT64)
    step = Choice(P, Binary(BinaryOperator.ADD, count, Constant(1, INT64)), count)
    trace = {'p': bits('110100')}
    assert evaluate(step, trace, [(count, step)]) == [1, 2, 2, 3, 3, 3]
    assert evaluate(count, trace, [(count, step)]) == [0, 1, 2, 2, 3, 3]


def test_two_equations_that_refer_to_one_another_step_together() -> None:
    a, b = Feedback('a', BOOL), Feedback('b', BOOL)
    equations: Equations = [(a, Unary(UnaryOperator.NOT, b)), (b, Binary(BinaryOperator.OR, a, P))]
    formula = Binary(BinaryOperator.XOR, a, b)
    # a is 0 1 1 0 0 0, and b is 0 0 1 1 1 0.
    assert verdicts(formula, {'p': bits('000100')}, equations) == bits('010110')


def test_a_formula_40000_nodes_deep_is_evaluated() -> None:
    formula: Formula = P
    for _ in range(20_000):
        formula = Unary(UnaryOperator.NOT, Yesterday(formula))
    assert evaluate(formula, {'p': bits('111')}) == bits('101')


def test_several_formulas_are_evaluated_over_one_trace() -> None:
    assert evaluate_all([P, Yesterday(P)], {'p': bits('011')}) == [bits('011'), bits('001')]


@pytest.mark.parametrize('trace', [
    {'q': [True]}, {'p': [True], 'q': []}, {'p': [2]}, {'p': ['true']},
])
def test_a_trace_that_does_not_fit_is_refused(trace: dict[str, list[Any]]) -> None:
    with pytest.raises(TraceError):
        evaluate(P, trace)


@pytest.mark.parametrize(('kind', 'value'), [
    (ValueType.INT8, 128), (ValueType.UINT8, -1), (INT64, 2 ** 63), (ValueType.INT32, 1.0),
])
def test_a_value_outside_its_type_is_refused(kind: ValueType, value: Any) -> None:
    with pytest.raises(TraceError):
        evaluate(Variable('a', kind), {'a': [value]})


@settings(deadline=None)
@given(formulas(), traces(longest=20))
def test_a_verdict_depends_only_on_the_past(formula: Formula,
                                            trace: dict[str, list[Any]]) -> None:
    steps = len(trace['p'])
    half = {name: column[:steps // 2] for name, column in trace.items()}
    assert verdicts(formula, half) == verdicts(formula, trace)[:steps // 2]


@settings(deadline=None)
@given(formulas(), traces(longest=20))
def test_yesterday_of_any_formula_is_the_formula_one_step_late(
        formula: Formula, trace: dict[str, list[Any]]) -> None:
    expected = [False, *verdicts(formula, trace)][:-1]
    assert verdicts(Yesterday(formula), trace) == expected


def test_the_inputs_of_random_formulas_have_every_type_and_nasty_values() -> None:
    assert {item.type for item in INPUTS} == set(ValueType)
    assert all(any(map(math.isnan, all_values(kind))) for kind in (FLOAT32, FLOAT64))
    assert INT64_MIN in all_values(INT64)
