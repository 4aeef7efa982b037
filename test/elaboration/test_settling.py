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

"""Equations that are said to settle do, whatever their inputs are."""

from fret_monitor.elaboration.settling import settles
from fret_monitor.logic.evaluate import evaluate_all
from fret_monitor.logic.formula import (
    Binary, BinaryOperator, Choice, Constant, Feedback, Formula, FTP, Unary, UnaryOperator,
    Variable, Yesterday,
)
from fret_monitor.model.values import ValueType
from hypothesis import assume, given
from hypothesis import strategies as st

BOOL, INT, REAL = ValueType.BOOL, ValueType.INT64, ValueType.FLOAT64
LATCH, COUNT, LEVEL = Feedback('a', BOOL), Feedback('n', INT), Feedback('x', REAL)
TRUTHS = (Variable('p', BOOL), Variable('q', BOOL), FTP)
WHOLE = (Variable('i', INT), Variable('j', INT), Constant(2, INT))
REALS = (Variable('d', REAL), Variable('e', REAL), Constant(0.0, REAL))
VALUES = {BOOL: st.booleans(), INT: st.integers(-3, 3),
          REAL: st.sampled_from((-1.0, -0.0, 0.0, 1.0, float('nan'), float('inf')))}


def truths(cell: Feedback, numbers: tuple[Formula, ...]) -> st.SearchStrategy[Formula]:
    """Return Boolean terms of the inputs and a cell."""
    own = (cell,) if cell.type is BOOL else ()
    compared = (*numbers, cell) if cell.type is not BOOL else numbers
    leaves = st.sampled_from((*TRUTHS, *own)) | st.builds(
        Binary, st.sampled_from((BinaryOperator.LT, BinaryOperator.EQ)),
        st.sampled_from(compared), st.sampled_from(compared))
    return st.recursive(leaves, lambda inner: st.builds(
        Unary, st.just(UnaryOperator.NOT), inner) | st.builds(
        Binary, st.sampled_from((BinaryOperator.AND, BinaryOperator.OR, BinaryOperator.IMPLIES,
                                 BinaryOperator.XOR)), inner, inner) | st.builds(
        Choice, inner, inner, inner), max_leaves=6)


def terms(cell: Feedback, numbers: tuple[Formula, ...]) -> st.SearchStrategy[Formula]:
    """Return terms of the type of a cell."""
    if cell.type is BOOL:
        return truths(cell, WHOLE)
    return st.recursive(st.sampled_from((*numbers, cell)), lambda inner: st.builds(
        Binary, st.sampled_from((BinaryOperator.MIN, BinaryOperator.MAX, BinaryOperator.ADD)),
        inner, inner) | st.builds(Choice, truths(cell, numbers), inner, inner), max_leaves=6)


@given(st.data())
def test_what_is_said_to_settle_stays_as_it_is_while_its_inputs_do(data: st.DataObject) -> None:
    cell, numbers = data.draw(st.sampled_from(((LATCH, WHOLE), (COUNT, WHOLE), (LEVEL, REALS))))
    equation = data.draw(terms(cell, numbers))
    assume(settles(cell, equation, [cell]))
    inputs = [node for node in (*TRUTHS, *WHOLE, *REALS) if isinstance(node, Variable)]
    columns = {node.name: data.draw(st.lists(VALUES[node.type], min_size=4, max_size=4))
               for node in inputs}
    held = {name: [*column, *column[-1:] * 3] for name, column in columns.items()}
    (values,) = evaluate_all([equation], held, ((cell, equation),))
    assert len({repr(value) for value in values[3:]}) == 1


def test_an_equation_that_turns_between_two_terms_is_not_said_to_settle() -> None:
    d, e, zero = REALS
    is_below = Binary(BinaryOperator.LT, LEVEL, zero)
    assert not settles(LEVEL, Choice(is_below, d, e), [LEVEL])
    assert settles(LEVEL, Choice(is_below, d, LEVEL), [LEVEL])


def test_equations_that_depend_on_one_another_are_not_said_to_settle() -> None:
    other = Feedback('b', BOOL)
    both = Binary(BinaryOperator.OR, LATCH, other)
    assert not settles(LATCH, both, [LATCH, other])
    assert settles(LATCH, both, [LATCH])
    assert settles(LATCH, Binary(BinaryOperator.OR, LATCH, TRUTHS[0]), [LATCH])
    assert not settles(LATCH, Yesterday(LATCH), [LATCH])
    assert settles(LATCH, Binary(BinaryOperator.OR, LATCH, Yesterday(TRUTHS[0])), [LATCH])
