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
Many small formulas on few inputs, which compilers like to simplify.

FRET's formulas nest first time points, previous steps, constants and short windows; all nestings
of two operators are tried, and thousands of deeper ones.
"""

from collections.abc import Iterator
from itertools import pairwise, product
from random import Random

from differential.compiled import Compiled
from fret_monitor.logic.evaluate import evaluate_all, verdicts
from fret_monitor.logic.formula import (
    ALWAYS, Binary, BinaryOperator, Choice, Constant, FALSE, Feedback, Formula, FTP, Historically,
    Once, Previous, Since, Triggered, TRUE, Unary, UnaryOperator, Variable, WeakYesterday, Window,
    Yesterday,
)
from fret_monitor.logic.specification import Property
from fret_monitor.model.values import ValueType
import pytest
from strategies import (
    EXAMPLES, property_of, random_property, random_trace, specification_of, Trace,
)

BOOL = ValueType.BOOL
P, Q = Variable('p', BOOL), Variable('q', BOOL)
LEAVES: tuple[Formula, ...] = (P, Q, FTP, TRUE, FALSE)
WINDOWS = (ALWAYS, Window(0, 1), Window(0, 3), Window(1, 1), Window(1, 2), Window(2, 4),
           Window(1, None), Window(3, None), Window(0, -1), Window(0, 0))
COUNT = 8 * EXAMPLES  # of random formulas of one size
CONNECTIVES = (BinaryOperator.AND, BinaryOperator.OR, BinaryOperator.XOR, BinaryOperator.IMPLIES,
               BinaryOperator.IFF)


def prefixed(p: Formula) -> Iterator[Formula]:
    """Yield every operator on one formula."""
    yield Unary(UnaryOperator.NOT, p)
    yield Yesterday(p)
    yield WeakYesterday(p)
    for window in WINDOWS:
        yield Once(window, p)
        yield Historically(window, p)


def joined(p: Formula, q: Formula) -> Iterator[Formula]:
    """Yield every operator on two formulas."""
    for operator in CONNECTIVES:
        yield Binary(operator, p, q)
    for window in WINDOWS:
        yield Since(window, p, q)
        yield Triggered(window, p, q)
    yield Choice(P, p, q)
    yield Previous(p, q)


def larger(rng: Random, pool: list[Formula], count: int) -> list[Formula]:
    """Return some of the formulas that are one operator larger than those of the pool."""
    found = []
    for _ in range(count):
        p, q = rng.choice(pool), rng.choice(pool)
        alternatives = [*prefixed(p), *joined(p, q), *joined(p, q)]
        found.append(rng.choice(alternatives))
    return found


def two_deep() -> list[Formula]:
    """Return all formulas of one operator, and of one above another on the left or right."""
    once = [*LEAVES]
    for p in LEAVES:
        once += prefixed(p)
    for p, q in product(LEAVES, repeat=2):
        once += joined(p, q)
    return once


def assert_equal(formulas: list[Formula], trace: Trace, resets: tuple[int, ...] = ()) -> None:
    """Compare the verdicts of all formulas, compiled into one library."""
    properties = [property_of(f'R-{number}', item) for number, item in enumerate(formulas)]
    found = Compiled(specification_of(properties, (P, Q)), flags=('-std=c99', '-O0', '-fPIC'))
    ends = (0, *resets, len(trace['p']))
    pieces = [evaluate_all(formulas, {name: column[start:stop] for name, column in trace.items()})
              for start, stop in pairwise(ends)]
    for number, verdict in enumerate(found.run(trace, resets)):
        assert verdict == [value for piece in pieces for value in piece[number]], number


def trace_of(seed: int) -> Trace:
    """Return random values, and then long runs."""
    rng = Random(seed)
    noise = {name: [rng.random() < 0.5 for _ in range(60)] for name in 'pq'}
    calm = random_trace(rng, (P, Q), 60)
    return {name: noise[name] + calm[name] for name in 'pq'}


def test_every_operator_on_inputs_and_constants_is_that_of_the_reference() -> None:
    assert_equal(two_deep(), trace_of(1), resets=(3, 60))


@pytest.mark.parametrize('seed', range(4))
def test_small_nested_formulas_are_those_of_the_reference(seed: int) -> None:
    rng = Random(seed)
    pool = two_deep()
    middle = larger(rng, pool, COUNT)
    assert_equal([*middle, *larger(rng, [*pool, *middle], COUNT)], trace_of(seed), resets=(60,))


def as_fret_writes(p: Formula, q: Formula, left: Formula, n: int) -> Iterator[Formula]:
    """Yield the shapes of FRET's conditions, timings and predefined functions."""
    def no(f: Formula) -> Formula:
        return Unary(UnaryOperator.NOT, f)

    def both(f: Formula, g: Formula) -> Formula:
        return Binary(BinaryOperator.AND, f, g)

    def either(f: Formula, g: Formula) -> Formula:
        return Binary(BinaryOperator.OR, f, g)

    within = Window(0, n)
    before = Window(0, n - 1)
    trigger = either(both(p, Yesterday(no(p))), both(p, left))
    yield trigger
    yield both(Historically(within, p), Historically(before, no(left)))
    yield both(Historically(Window(n, n + 2), p), Historically(before, no(left)))
    yield both(Since(ALWAYS, no(left), p), Once(within, p))
    yield Since(Window(n, n + 2), no(left), p)
    yield either(left, Yesterday(Since(ALWAYS, both(no(left), no(p)), p)))
    yield Historically(ALWAYS, Binary(
        BinaryOperator.IMPLIES, Once(Window(n, n), both(trigger, no(q))),
        Once(before, either(left, q))))
    yield Historically(ALWAYS, Binary(BinaryOperator.IMPLIES, Historically(ALWAYS, no(q)),
                                      Once(before, left)))
    yield Historically(ALWAYS, Binary(BinaryOperator.IMPLIES, Once(within, left), q))
    yield Historically(ALWAYS, Binary(BinaryOperator.IMPLIES, both(p, no(left)), Yesterday(q)))
    yield either(both(left, p), Yesterday(q))
    yield both(Binary(BinaryOperator.IMPLIES, p, q), WeakYesterday(both(p, no(left))))


def test_the_shapes_that_fret_makes_are_those_of_the_reference() -> None:
    first_in_mode = Binary(BinaryOperator.AND, Q, Binary(
        BinaryOperator.OR, FTP, Yesterday(Unary(UnaryOperator.NOT, Q))))
    operands: list[Formula] = [P, Q, Yesterday(P), TRUE, Unary(UnaryOperator.NOT, P)]
    lefts: list[Formula] = [FTP, first_in_mode, P, FALSE, TRUE]
    formulas = list(dict.fromkeys(
        formula for left, p, q in product(lefts, operands, operands) for n in (0, 1, 2, 5)
        for formula in as_fret_writes(p, q, left, n)))
    assert len(formulas) > 1500
    assert_equal(formulas, trace_of(7), resets=(1, 60))


def check_loop(item: Property, trace: Trace, inputs: tuple[Variable, ...]) -> None:
    """Compare one requirement with equations that refer to themselves."""
    found = Compiled(specification_of([item], inputs)).run(trace)[0]
    assert found == verdicts(item.formula, trace, item.feedback)


@pytest.mark.parametrize('kind', [BOOL, ValueType.INT64, ValueType.FLOAT32])
def test_equations_that_pass_values_in_a_ring_step_together(kind: ValueType) -> None:
    x = Variable('x', kind)
    a, b, d = (Feedback(name, kind) for name in 'abd')
    first = Choice(FTP, x, b)
    for equations in (((a, b), (b, first), (d, a)), ((d, a), (b, first), (a, b)),
                      ((a, b), (b, d), (d, x)), ((d, x), (b, d), (a, b))):
        formula = Binary(BinaryOperator.XOR, is_one(a), Binary(
            BinaryOperator.AND, is_one(d), is_one(b)))
        trace = {'x': [1, 0, 0, 1, 1, 0, 1, 0, 0, 0]}
        check_loop(property_of('R-1', formula, equations), trace, (x,))


def is_one(term: Formula) -> Formula:
    if term.type is BOOL:
        return term
    return Binary(BinaryOperator.EQ, term, Constant(1 if term.type.is_integer else 1.0, term.type))


@pytest.mark.parametrize('kind', [BOOL, ValueType.INT64, ValueType.FLOAT64])
def test_a_value_of_several_steps_ago_is_passed_on_at_each_step(kind: ValueType) -> None:
    x, y = Variable('x', kind), Variable('y', kind)
    term: Formula = x
    for number in range(6):
        term = Previous(Constant(bool(number % 2) if kind is BOOL else number, kind), term)
    formula = Binary(BinaryOperator.EQ, term, Previous(y, x))
    rng = Random(1)
    trace = {name: [rng.randrange(2) if kind is not BOOL else rng.random() < 0.5
                    for _ in range(60)] for name in 'xy'}
    check_loop(property_of('R-1', formula), trace, (x, y))


def test_a_group_so_large_that_its_step_is_cut_into_parts_is_that_of_the_reference() -> None:
    rng = Random(3)
    inputs = (P, Q, Variable('x_int32', ValueType.INT32), Variable('x_float64', ValueType.FLOAT64))
    trace = random_trace(rng, inputs, 60)
    all_read = Binary(BinaryOperator.AND, Binary(BinaryOperator.OR, P, Q), Binary(
        BinaryOperator.LT, Previous(Constant(1.5, ValueType.FLOAT64), inputs[3]), inputs[3]))
    properties = []
    for number in range(150):
        item = random_property(rng, f'R-{number}', inputs, size=60, reach=20, loops=2)
        formula = Binary(BinaryOperator.XOR, item.formula, all_read)
        properties.append(property_of(item.id, formula, item.feedback))
    compiled = Compiled(specification_of(properties, inputs)).run(trace, (30,))
    for item, found in zip(properties, compiled, strict=True):
        pieces = [verdicts(item.formula, {name: column[part] for name, column in trace.items()},
                           item.feedback) for part in (slice(30), slice(30, 60))]
        assert found == pieces[0] + pieces[1], item.id
