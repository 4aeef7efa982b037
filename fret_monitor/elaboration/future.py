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
Bounded future: what a formula says of a step is computed a fixed number of steps later.

The `horizon` of a term is that number: its value at step r is that of the text at step
r - horizon. `aligned` gives the operands of a node one horizon, and `future_formula` is the
meaning of an operator. With operands p and q of horizon h, at step r = t + b + h:

    G[a,b] p at t   = H[0,b-a] p at r            F[a,b] p at t = O[0,b-a] p at r
    p U[a,b] q at t = q at one of the last b-a+1 steps, and p at those of them that are before

The past has no single operator for `U`. In a bundle that steps, the window is cut into halves down
to single steps, with a bit for each step. In a bundle of ticks (nanoseconds), a number counts the
changes of `p | q`. It never falls, so that its least value over the window is that at the window's
begin. `p U q` is true if the number has this value at a q in the window: `p | q` has been true
from the begin on.
"""

from dataclasses import replace
from typing import NoReturn

from fret_monitor.elaboration.terms import expect_bool, TypedTerm
from fret_monitor.language.expression import Expression, Infix, Prefix
from fret_monitor.logic.formula import (
    Aggregate, Binary, BinaryOperator, Choice, Constant, FALSE, Feedback, Formula, Historically,
    Once, Over, TRUE, Unary, UnaryOperator, Window, Yesterday,
)
from fret_monitor.model.diagnostics import refuse, Span
from fret_monitor.model.values import ValueType

UNBOUNDED = {
    'G': ('write G[0,n] p, with the number of steps; the verdict comes n steps later. Write p '
          'alone for what shall hold at every step: each step has a verdict'),
    'F': 'write F[0,n] p, with the number of steps; the verdict comes n steps later',
    'U': 'write p U[0,n] q, with the number of steps; the verdict comes n steps later',
    'R': 'write p R[0,n] q, with the number of steps; the verdict comes n steps later',
}
"""The operators that need a bound, each with what to write."""

FUTURE = frozenset({*UNBOUNDED, 'X'})
_POINTWISE = frozenset({'!', '&', '|', 'xor', '->', '<->', '=', '!='})
_FOUND = frozenset({'O', 'Y', 'S', 'SI'})  # true if their last operand holds at some step
_NOT_FOUND = frozenset({'H', 'Z', 'T'})
_DECIDING = {  # a value of the left or of the right operand, and what the operator then is
    BinaryOperator.AND: (False, False, False),
    BinaryOperator.OR: (True, True, True),
    BinaryOperator.IMPLIES: (False, True, True),
}


def aligned(node: Expression, operands: list[TypedTerm]) -> tuple[list[TypedTerm], int]:
    """
    Return the operands of a node with one horizon, and that horizon.

    Raises
    ------
    CompileError
        if an operand needs the future and the node is not of truth values.
    """
    horizon = max((term.horizon for term in operands), default=0)
    if horizon == 0:
        return operands, 0
    operator = node.operator if isinstance(node, Prefix | Infix) else ''
    if operator not in _POINTWISE | _FOUND | _NOT_FOUND | FUTURE:
        _refuse_inside(next(term for term in operands if term.horizon))
    looks_back = operator in _FOUND | _NOT_FOUND
    return [_moved(term, horizon, operator if looks_back and place == len(operands) - 1 else '')
            if term.is_boolean else term for place, term in enumerate(operands)], horizon


def _moved(term: TypedTerm, horizon: int, operator: str) -> TypedTerm:
    """Return a term with another horizon, as the last operand of an operator of the past."""
    value = delayed(expect_bool(term, ''), horizon - term.horizon)
    if operator:
        # Nothing is looked for before the start.
        kind = BinaryOperator.AND if operator in _FOUND else BinaryOperator.IMPLIES
        value = Binary(kind, from_step(horizon), value)
    return replace(term, value=value, horizon=horizon)


def _refuse_inside(term: TypedTerm) -> NoReturn:
    refuse('the future cannot be an operand here', term.span, 'this is known later',
           'operators of the future stand below other operators only: ! & | xor -> <-> and those '
           'over time')


def delayed(value: Formula, steps: int) -> Formula:
    """Return the value of so many steps ago; it has no meaning at the first steps."""
    match value:
        case _ if steps == 0:
            return value
        case Constant():
            return value
        case Once(Window(int(low), high), argument) if low == high:
            return Once(Window(low + steps, low + steps), argument)
        case _:
            return Once(Window(steps, steps), value)


def from_step(steps: int) -> Formula:
    """Return a formula that is true from a step on, counted from 0."""
    return Once(Window(steps, None), TRUE)


def from_horizon(formula: Formula, horizon: int) -> Formula:
    """
    Return the formula of a requirement: true before there is a step that it is about.

    `H p` is so already, and stays what it is: each time that p becomes false is an occurrence.
    So is what looks so far back that it is true before; it needs no count of steps.
    """
    if not horizon or _before(formula, horizon) or (
            isinstance(formula, Historically) and formula.window.is_unbounded):
        return formula
    return Binary(BinaryOperator.IMPLIES, from_step(horizon), formula)


def _before(formula: Formula, steps: int) -> bool | None:
    """Return the value of a formula at each of the first steps; None if it is not known."""
    match formula:
        case Once(Window(low)) if low >= steps:
            return False
        case Historically(Window(low)) if low >= steps:
            return True
        case Unary(UnaryOperator.NOT, argument):
            found = _before(argument, steps)
            return None if found is None else not found
        case Binary(operator, left, right) if operator in _DECIDING:
            is_left, is_right = _before(left, steps), _before(right, steps)
            on_left, on_right, value = _DECIDING[operator]
            if is_left is on_left or is_right is on_right:
                return value
            return None if is_left is None or is_right is None else not value
        case _:
            return None


def bounded(operator: str, window: Window, place: Span) -> int:
    """Return how many steps an operator looks ahead; refuse one that is not bounded."""
    if operator == 'X':
        return 1
    if window.high is None:
        refuse(f"'{operator}' needs a bound that ends", place,
               'an unbounded future has no verdict', UNBOUNDED[operator])
    return max(0, window.high)


def future_formula(operator: str, window: Window, operands: list[Formula],
                   counters: dict[Feedback, Formula] | None) -> Formula:
    """
    Return the meaning of an operator, `bounded` steps later than its operands.

    `counters` collects the equations of numbers that count, in a bundle that steps at ticks; None
    elsewhere.
    """
    if operator == 'X':
        return operands[0]
    if window.high is None or window.is_empty:
        return TRUE if operator in ('G', 'R') else FALSE
    width = window.high - window.low
    match operator:
        case 'G' | 'F':
            kind = Historically if operator == 'G' else Once
            return kind(Window(0, width), operands[0]) if width else operands[0]
        case 'U':
            return _until(operands[0], operands[1], width, counters)
        case _:
            return _not(_until(_not(operands[0]), _not(operands[1]), width, counters))


def _not(value: Formula) -> Formula:
    return Unary(UnaryOperator.NOT, value)


def _until(p: Formula, q: Formula, width: int,
           counters: dict[Feedback, Formula] | None) -> Formula:
    if width == 0 or p is FALSE:
        return delayed(q, width)
    if p is TRUE:
        return Once(Window(0, width), q)
    return _by_halves(p, q, width + 1)[0] if counters is None \
        else _by_counting(p, q, width, counters)


def _by_halves(p: Formula, q: Formula, steps: int) -> tuple[Formula, Formula]:
    """Return `p` until `q`, and `p` throughout, in a window of so many steps that ends now."""
    if steps == 1:
        return q, p
    half = (steps + 1) // 2
    until, throughout = _by_halves(p, q, half)
    before = steps - half
    earlier = delayed(throughout, before)
    return (Binary(BinaryOperator.OR, delayed(until, before),
                   Binary(BinaryOperator.AND, earlier, until)),
            Binary(BinaryOperator.AND, earlier, throughout))


def _by_counting(p: Formula, q: Formula, width: int,
                 counters: dict[Feedback, Formula]) -> Formula:
    kind = ValueType.INT64
    either = Binary(BinaryOperator.OR, p, q)
    changes = Binary(BinaryOperator.XOR, either, Yesterday(either))
    before = Feedback(f'changes {len(counters) + 1}', kind)
    count = Binary(BinaryOperator.ADD, before,
                   Choice(changes, Constant(1, kind), Constant(0, kind)))
    counters[before] = count
    # The count is odd where p | q holds, hence wherever q holds.
    at_q = Choice(q, count, Constant(kind.limits[1], kind))
    return Binary(BinaryOperator.EQ, Over(Aggregate.LEAST, width, at_q, TRUE),
                  Over(Aggregate.LEAST, width, count, TRUE))
