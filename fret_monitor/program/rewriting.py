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
Rewrite FRET's timings so that they need no queue of past values.

FRET writes a deadline with the value of n steps ago, which would have to be stored for each step:

    H (s -> (O[n,n] p -> O[0,n-1] a))

It fails at k + n if p held at k, s holds at k + n, and a held at none of the n steps after k.
One counter is enough for

    H (s -> !(!a S[n,inf) p))

Its body is false at k + n too, and may stay false until a holds. Under H this makes no difference
if s held at k + n whenever it holds later, with no a since k. That is so if s cannot become true
without a: FRET's `a` includes the start of the scope s. `_starts_with` looks for that.

The first step is never after k, so that FTP is left out of `a`. The body of a rewritten H is false
as long as the response is overdue, not only at the step at which its time ran out; docs/bundle.md
says so of the report `occurrence`.

Where a window of n steps without x has passed, "n steps ago" is the same as "in the last n":

    (O[0,n] x -> O[0,n-1] y | b)   for   O[n,n] x -> O[0,n-1] y | b,   if x implies y

`slope_by_times` says what a derivative is by numbers that are held.
"""

from collections.abc import Iterator, Sequence

from fret_monitor.logic.formula import (
    ALWAYS, Binary, BinaryOperator, Choice, Constant, Conversion, Formula, FTP, Held, Historically,
    MessageSlope, Once, postorder, Previous, rebuilt, Since, Unary, UnaryOperator, WeakYesterday,
    Window, Yesterday,
)
from fret_monitor.model.values import ValueType

_DEPTH = 16  # conjunctions and implications between H and a deadline; FRET writes three


def slope_by_times(node: MessageSlope) -> Formula:
    """Return an equal formula of numbers that are held."""
    zero = Constant(0.0, ValueType.FLOAT64)
    argument_before = Previous(zero, Held(node.at, node.argument))
    time_before = Previous(Constant(0, ValueType.INT64), Held(node.at, node.time))
    change = Binary(BinaryOperator.SUB, node.argument, argument_before)
    nanoseconds = Conversion(
        Binary(BinaryOperator.SUB, node.time, time_before), ValueType.FLOAT64)
    seconds = Binary(BinaryOperator.DIV, nanoseconds, Constant(1e9, ValueType.FLOAT64))
    has_two = Yesterday(Once(ALWAYS, node.at))
    return Held(node.at, Choice(has_two, Binary(BinaryOperator.DIV, change, seconds), zero))


def without_queues(roots: Sequence[Formula]) -> dict[Formula, Formula]:
    """Return for each node of some formulas an equivalent one that needs fewer queues."""
    found: dict[Formula, Formula] = {}
    for node in postorder(roots):
        changed = rebuilt(node, found)
        match changed:
            case Historically(window, body) if window == ALWAYS:
                changed = Historically(ALWAYS, _overdue(body, (), _DEPTH))
            case Binary(BinaryOperator.IMPLIES, Once() as left, right):
                changed = _within(changed, left, right)
            case _:
                pass
        found[node] = changed
    return found


def _overdue(body: Formula, scopes: tuple[Formula, ...], depth: int) -> Formula:
    """Return what may take the place of `body` under H, where all of `scopes` hold."""
    match body:
        case _ if depth == 0:
            return body
        case Binary(BinaryOperator.AND, left, right):
            return Binary(BinaryOperator.AND, _overdue(left, scopes, depth - 1),
                          _overdue(right, scopes, depth - 1))
        case Binary(BinaryOperator.IMPLIES, Once(Window(int(low), high), trigger),
                    Once(Window(0, int(last)), answer)) if low == high == last + 1 \
                and all(_starts_with(scope, answer) for scope in scopes):
            late = Since(Window(low, None), Unary(UnaryOperator.NOT, _later(answer)),
                         trigger)
            return Unary(UnaryOperator.NOT, late)
        case Binary(BinaryOperator.IMPLIES, scope, right):
            return Binary(BinaryOperator.IMPLIES, scope,
                          _overdue(right, (*scopes, scope), depth - 1))
        case _:
            return body


def _later(answer: Formula) -> Formula:
    """Return a formula that equals `answer` at every step but the first."""
    match answer:
        case Binary(BinaryOperator.OR, left, right) if left is FTP:
            return right
        case _:
            return answer


def _within(node: Binary, left: Once, right: Formula) -> Binary:
    match left.window:
        case Window(int(low), high) if low == high and any(
                isinstance(item, Once) and item.window == Window(0, low - 1)
                and _implies(left.argument, item.argument)
                for item in _parts(BinaryOperator.OR, right)):
            return Binary(node.operator, Once(Window(0, low), left.argument), right)
        case _:
            return node


def _implies(one: Formula, other: Formula) -> bool:
    """Whether the form of two formulas shows that one implies the other at each step."""
    return other in _parts(BinaryOperator.AND, one) or one in _parts(BinaryOperator.OR, other)


def _parts(operator: BinaryOperator, node: Formula) -> Iterator[Formula]:
    """Yield the operands of nested conjunctions or disjunctions, left to right."""
    stack = [node]
    while stack:
        item = stack.pop()
        if isinstance(item, Binary) and item.operator is operator:
            stack.extend((item.right, item.left))
        else:
            yield item


def _starts_with(scope: Formula, answer: Formula) -> bool:
    """Whether the answer holds at every step, but the first, at which the scope becomes true."""
    if isinstance(scope, Historically) and scope.window == ALWAYS:
        return True  # it holds from the first step on, or never
    return any(all(_holds_at_start(item, scope) for item in _parts(BinaryOperator.AND, choice))
               for choice in _parts(BinaryOperator.OR, answer))


def _holds_at_start(item: Formula, scope: Formula) -> bool:
    """Whether `scope & Y !scope` implies a formula."""
    if item == scope:
        return True
    if isinstance(item, Yesterday | WeakYesterday) and _is_negation(item.argument, scope):
        return True
    # `O p` becomes true where p does.
    return isinstance(scope, Once) and scope.window == ALWAYS \
        and item in _parts(BinaryOperator.AND, scope.argument)


def _is_negation(one: Formula, other: Formula) -> bool:
    match one, other:
        case Unary(UnaryOperator.NOT, argument), _ if argument is other:
            return True
        case _, Unary(UnaryOperator.NOT, argument) if argument is one:
            return True
        case Historically(window, Unary(UnaryOperator.NOT, never)), Once(past, argument):
            return window == past == ALWAYS and never is argument
        case _:
            return False
