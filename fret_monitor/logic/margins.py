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
The reference semantics of margins: how far a formula is from the other verdict, at every step.

Like `evaluate` it follows the definitions (docs/margins.md) literally and is slow. Compiled
margins are tested against it, so it shares no code with `program` and `codegen`. The values of
terms are those of `evaluate`.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
import math
from typing import TypeAlias

from fret_monitor.logic.evaluate import Equations, evaluate_all, Trace
from fret_monitor.logic.formula import (
    Binary, BinaryOperator, Choice, Constant, Feedback, Formula, Historically, Once, Previous,
    Since, TimeOver, Triggered, Unary, Variable, variables, WeakYesterday, Window, Yesterday,
)
from fret_monitor.logic.pointwise import Value
from fret_monitor.model.values import ValueType

Scales: TypeAlias = Mapping[str, float | None]
"""The scale of each input; None if its values are names, which have no distance."""


@dataclass(frozen=True)
class ReferenceMargin:
    """
    A margin, positive or 0 where the formula holds, and which comparisons decide it.

    `deciding` has pairs of a comparison and the step at which its distance is the margin: all of
    them, where several give the same. Empty where the margin is infinite.
    """

    value: float
    deciding: frozenset[tuple[Formula, int]] = frozenset()

    def __neg__(self) -> 'ReferenceMargin':
        """Return the margin of the negation."""
        return ReferenceMargin(-self.value, self.deciding)


_TRUE, _FALSE = ReferenceMargin(math.inf), ReferenceMargin(-math.inf)
_Columns: TypeAlias = dict[Formula, list[ReferenceMargin]]
_Rule: TypeAlias = Callable[[int], ReferenceMargin]


def margins(formula: Formula, trace: Trace, scales: Scales,
            feedback: Equations = ()) -> list[ReferenceMargin]:
    """Return the margin of a BOOL formula at every step of a trace; errors as `evaluate`."""
    equations = {node: equation for node, equation in feedback
                 if node.type is ValueType.BOOL}
    nodes = _nodes([formula, *equations.values()])
    terms = [term for node in nodes for term in _terms(node)]
    values = dict(zip(terms, evaluate_all(terms, trace, feedback), strict=True))
    columns: _Columns = {node: [] for node in nodes}
    rules = [(columns[node], _rule(node, columns, values, scales, equations)) for node in nodes]
    for t in range(len(next(iter(trace.values()), ()))):
        for column, rule in rules:
            column.append(rule(t))
    return columns[formula]


def parts_with_margins(node: Formula) -> tuple[Formula, ...]:
    """Return the operands of a BOOL node whose margins its own is made of."""
    match node:
        case Binary() if node.left.type is ValueType.BOOL:
            return node.left, node.right
        case Unary() | Once() | Historically() | Yesterday() | WeakYesterday():
            return (node.argument,)
        case Choice():
            return node.condition, node.yes, node.no
        case Previous():
            return node.initial, node.argument
        case Since() | Triggered():
            return node.left, node.right
        case _:
            return ()


def _nodes(roots: Iterable[Formula]) -> list[Formula]:
    """Return the nodes that have margins, each after its parts."""
    found: dict[Formula, None] = {}
    stack = [(root, False) for root in roots]
    while stack:
        node, is_ready = stack.pop()
        if is_ready:
            found.setdefault(node)
        elif node not in found:
            stack.append((node, True))
            stack.extend((part, False) for part in parts_with_margins(node))
    return list(found)


def _terms(node: Formula) -> tuple[Formula, ...]:
    """Return the terms whose values a node without parts is made of."""
    match node:
        case Binary() if node.left.type is not ValueType.BOOL:
            return node.left, node.right, node
        case Variable() | TimeOver():
            return (node,)
        case _:
            return ()


def _rule(node: Formula, columns: _Columns, values: Mapping[Formula, Sequence[Value]],
          scales: Scales, equations: Mapping[Feedback, Formula]) -> _Rule:
    """Return the function that computes the margin of a node at step t."""
    parts = [columns[part] for part in parts_with_margins(node)]
    match node:
        case Constant():
            return lambda t: _certain(node.value is True)
        case Variable() | TimeOver():
            return lambda t: _certain(values[node][t] is True)
        case Feedback():
            equation = columns[equations[node]]
            return lambda t: equation[t - 1] if t else _FALSE
        case Binary() if not parts:
            return _comparison(node, values, scales)
        case Binary():
            return lambda t: _connective(node.operator, parts[0][t], parts[1][t])
        case Unary():
            return lambda t: -parts[0][t]
        case Choice():
            return lambda t: _greatest([_least([parts[0][t], parts[1][t]]),
                                        _least([-parts[0][t], parts[2][t]])])
        case Previous():
            return lambda t: parts[1][t - 1] if t else parts[0][0]
        case Yesterday():
            return lambda t: parts[0][t - 1] if t else _FALSE
        case WeakYesterday():
            return lambda t: parts[0][t - 1] if t else _TRUE
        case Once():
            return lambda t: _greatest(parts[0][k] for k in _past(node.window, t))
        case Historically():
            return lambda t: _least(parts[0][k] for k in _past(node.window, t))
        case Since():
            return lambda t: _since(node.window, t, *parts)
        case Triggered():
            return lambda t: -_since(node.window, t, *([-item for item in part] for part in parts))
        case _:
            raise TypeError(f'{type(node).__name__} has no margin')


def _certain(value: bool) -> ReferenceMargin:
    return _TRUE if value else _FALSE


def _comparison(node: Binary, values: Mapping[Formula, Sequence[Value]],
                scales: Scales) -> _Rule:
    of_inputs = [scales.get(item.name, 1.0) for item in variables(node)]
    if None in of_inputs:
        return lambda t: _certain(values[node][t] is True)
    scale = max((item for item in of_inputs if item is not None), default=1.0)

    def margin_at(t: int) -> ReferenceMargin:
        left, right = float(values[node.left][t]), float(values[node.right][t])
        if math.isnan(left) or math.isnan(right):
            return _certain(values[node][t] is True)
        value = distance(node.operator, left, right) / scale
        return ReferenceMargin(value, frozenset({(node, t)} if math.isfinite(value) else ()))

    return margin_at


def distance(operator: BinaryOperator, left: float, right: float) -> float:
    """Return how far a comparison of two numbers is from being otherwise."""
    change = 0.0 if left == right else right - left
    match operator:
        case BinaryOperator.LT | BinaryOperator.LE:
            return change
        case BinaryOperator.GT | BinaryOperator.GE:
            return -change
        case BinaryOperator.EQ:
            return -abs(change)
        case _:
            return abs(change)


def _connective(operator: BinaryOperator, p: ReferenceMargin,
                q: ReferenceMargin) -> ReferenceMargin:
    match operator:
        case BinaryOperator.AND:
            return _least([p, q])
        case BinaryOperator.OR:
            return _greatest([p, q])
        case BinaryOperator.IMPLIES:
            return _greatest([-p, q])
        case BinaryOperator.XOR | BinaryOperator.NE:
            return _greatest([_least([p, -q]), _least([-p, q])])
        case _:
            return -_greatest([_least([p, -q]), _least([-p, q])])


def _least(items: Iterable[ReferenceMargin]) -> ReferenceMargin:
    """Return the least of some margins; of none, that of TRUE."""
    found = [_TRUE, *items]
    value = min(item.value for item in found)
    return ReferenceMargin(value, frozenset().union(
        *(item.deciding for item in found if item.value == value)))


def _greatest(items: Iterable[ReferenceMargin]) -> ReferenceMargin:
    return -_least(-item for item in items)


def _past(window: Window, t: int) -> range:
    """Return the steps k with 0 <= k <= t and low <= t - k <= high."""
    first = 0 if window.high is None else max(0, t - window.high)
    return range(first, max(first, t - window.low + 1))


def _since(window: Window, t: int, p: Sequence[ReferenceMargin],
           q: Sequence[ReferenceMargin]) -> ReferenceMargin:
    """Return the greatest, over k in the window, of q at k and the least p at k+1..t."""
    return _greatest(_least([q[k], *p[k + 1:t + 1]]) for k in _past(window, t))
