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

"""Random formulas of every kind: compiled C gives the verdicts of the reference evaluator."""

from collections.abc import Sequence
from random import Random

from differential.compiled import Compiled, FLAGS, reference
from fret_monitor.logic.formula import (
    Binary, BinaryOperator, Formula, Historically, Once, postorder, Since, Triggered, Unary,
    UnaryOperator, Variable, Window, Yesterday,
)
from fret_monitor.logic.specification import Property
from fret_monitor.model.values import ValueType
from hypothesis import given, settings
from hypothesis import strategies as st
import pytest
from strategies import (
    EXAMPLES, FormulaMaker, formulas, INPUTS, property_of, random_inputs, random_property,
    random_trace, specification_of, thorough, Trace, traces,
)

HUGE = 2 ** 31 - 1
P, Q = Variable('p', ValueType.BOOL), Variable('q', ValueType.BOOL)
COUNT = 3 * EXAMPLES // 5  # of requirements in one library
UNOPTIMISED = (*FLAGS, '-O0')  # optimising takes longer than all the rest


def cut(trace: Trace, start: int, stop: int) -> Trace:
    """Return the steps from `start` to `stop` (exclusive)."""
    return {name: column[start:stop] for name, column in trace.items()}


def assert_equal(properties: list[Property], trace: Trace, resets: tuple[int, ...] = (),
                 flags: Sequence[str] = UNOPTIMISED) -> None:
    """Compare all verdicts over a trace, with the groups reset before each step of `resets`."""
    compiled = Compiled(specification_of(properties), flags=flags).run(trace, resets)
    steps = len(next(iter(trace.values())))
    pieces = [reference(properties, cut(trace, start, stop))
              for start, stop in zip((0, *resets), (*resets, steps), strict=True)]
    for number, (item, found) in enumerate(zip(properties, compiled, strict=True)):
        expected = [verdict for piece in pieces for verdict in piece[number]]
        assert found == expected, f'{item.id} differs at step {difference(found, expected)}'


def difference(found: list[bool], expected: list[bool]) -> int:
    """Return the first step at which two lists differ."""
    return [a is b for a, b in zip(found, expected, strict=True)].index(False)


@pytest.mark.parametrize(('seed', 'size', 'reach'), [
    (1, 4, 9), (2, 8, 300), (3, 12, 300), (4, 12, HUGE), (5, 25, 9), (6, 25, 300),
    (7, 40, 300), (8, 40, HUGE), pytest.param(9, 80, 300, marks=thorough), (10, 150, 300),
])
def test_random_formulas_give_the_verdicts_of_the_reference(seed: int, size: int,
                                                            reach: int) -> None:
    rng = Random(seed)
    properties = [
        random_property(rng, f'R-{number}', random_inputs(rng), size=size, reach=reach,
                        loops=2 if number % 4 == 0 else 0)
        for number in range(COUNT)]
    assert_equal(properties, random_trace(rng, INPUTS, 700), resets=(5, 6, 350),
                 flags=FLAGS if size < 25 else UNOPTIMISED)


@pytest.mark.parametrize('seed', [1, 2, 3])
def test_requirements_that_share_subterms_do_not_affect_one_another(
        seed: int) -> None:
    rng = Random(seed)
    inputs = (P, Q, Variable('x_int32', ValueType.INT32), Variable('x_float32', ValueType.FLOAT32))
    maker = FormulaMaker(rng.randrange, inputs, reach=70)
    shared = [maker.formula(30) for _ in range(20)]
    properties = [property_of(f'R-{number}', variant(rng, shared)) for number in range(2 * COUNT)]
    assert_equal(properties, random_trace(rng, INPUTS, 500), resets=(99,))


def variant(rng: Random, shared: list[Formula]) -> Formula:
    """Combine shared formulas in either order, negated or not."""
    a, b = (rng.choice([item, Unary(UnaryOperator.NOT, item)]) for item in rng.sample(shared, 2))
    operator = rng.choice([item for item in BinaryOperator if item.is_boolean])
    variants: list[Formula] = [
        Binary(operator, a, b), Binary(operator, b, a), Yesterday(a),
        Since(Window(0, 3), a, b), Triggered(Window(2, 8), b, a)]
    return rng.choice(variants)


@settings(max_examples=EXAMPLES // 2, deadline=None)
@given(formulas(size=20, reach=70), st.data())
def test_any_formula_gives_the_verdicts_of_the_reference(formula: Formula,
                                                         data: st.DataObject) -> None:
    inputs = [node for node in postorder([formula]) if isinstance(node, Variable)] or [P]
    assert_equal([property_of('R-1', formula)], data.draw(traces(inputs)))


def test_each_operator_has_each_window() -> None:
    ends = (0, 1, 2, 7, 8, 9, 31, 32, 33, 63, 64, 65, 127, 128, 129, 255, 256, 257)
    windows = [Window(low, low + size) for low in ends for size in (-1, 0, 1, 3, 64, 255)]
    windows += [Window(low, None) for low in ends]
    formulas = [formula for window in windows for formula in (
        Once(window, P), Historically(window, P), Since(window, P, Q), Triggered(window, P, Q))]
    properties = [property_of(f'R-{number}', item) for number, item in enumerate(formulas)]
    assert_equal(properties, runs(Random(1), 900))


def runs(rng: Random, steps: int) -> Trace:
    """Return p and q with runs of one to hundreds of steps, for windows of all sizes."""
    columns: Trace = {'p': [], 'q': []}
    for column in columns.values():
        while len(column) < steps:
            column += [rng.random() < 0.5] * rng.choice((1, 1, 2, 3, 60, 130, 260))
        del column[steps:]
    return columns


def test_a_deep_formula_gives_the_verdicts_of_the_reference() -> None:
    formula: Formula = P
    for number in range(750):
        formula = Since(Window(number % 3, 40), formula, Unary(UnaryOperator.NOT, formula))
        formula = Once(Window(0, number % 70), Binary(BinaryOperator.XOR, Q, formula))
        formula = Historically(Window(number % 5, None), Yesterday(formula))
    assert len(postorder([formula])) > 4500
    assert_equal([property_of('R-1', formula)], runs(Random(1), 60))


def test_a_wide_formula_gives_the_verdicts_of_the_reference() -> None:
    maker = FormulaMaker(Random(1).randrange, (P, Q, Variable('x_int8', ValueType.INT8)))
    formula = maker.formula(3)
    for _ in range(1500):
        formula = Binary(BinaryOperator.XOR, formula, maker.formula(20))
    assert len(postorder([formula])) > 10_000
    assert_equal([property_of('R-1', formula)], random_trace(Random(2), INPUTS, 40),
                 flags=UNOPTIMISED)
