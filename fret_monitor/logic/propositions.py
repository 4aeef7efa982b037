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
The propositions and triggers of a formula.

A proposition is a Boolean input or a comparison. A trigger is the left side of an implication: on
a trace on which it is never true, the implication is vacuously satisfied.
"""

from fret_monitor.logic.formula import (
    Ago, ALWAYS, Binary, BinaryOperator, Choice, Feedback, Formula, Historically,
    NUMBERS_OVER_TIME, Once, operands, Over, postorder, Previous, Since, TimeOver, Trial,
    Triggered, Unary, UnaryOperator, Variable, variables, WeakYesterday, Yesterday,
)
from fret_monitor.logic.specification import Property
from fret_monitor.model.values import ValueType

_BOOL = ValueType.BOOL
_TEMPORAL = (Yesterday, WeakYesterday, Once, Historically, Since, Triggered, Previous, Feedback,
             *NUMBERS_OVER_TIME)


def is_proposition(node: Formula) -> bool:
    """Whether a node is a Boolean input, or a comparison of numbers."""
    match node:
        case Variable(_, kind):
            return kind is _BOOL
        case Binary(operator, left, _):
            return operator.is_relation and left.type is not _BOOL
        case _:
            return False


def propositions(item: Property) -> list[Formula]:
    """Return the outermost propositions of a requirement, in the order of first occurrence."""
    found: dict[Formula, None] = {}
    seen: set[Formula] = set()
    stack = list(reversed(item.roots))
    while stack:
        node = stack.pop()
        if node in seen:
            continue
        seen.add(node)
        if is_proposition(node):
            found[node] = None
        else:
            stack.extend(reversed(operands(node)))
    return [node for node in found if variables(node)]


def is_pointwise(node: Formula) -> bool:
    """Whether a node's value depends on the current step alone."""
    return not any(isinstance(each, _TEMPORAL) for each in postorder([node]))


def triggers(formula: Formula, limit: int) -> list[Formula]:
    """Return the left sides of the implications that a formula requires, outermost first."""
    found: dict[Formula, None] = {}
    seen: set[Formula] = set()
    stack = [formula]
    while stack and len(found) < limit:
        node = stack.pop()
        if node in seen:
            continue
        seen.add(node)
        trigger, rest = _taken_apart(node)
        if trigger is not None and variables(trigger):
            found[trigger] = None
        stack.extend(reversed(rest))
    return list(found)


def _taken_apart(node: Formula) -> tuple[Formula | None, tuple[Formula, ...]]:
    """Return the trigger of a node (None if not an implication), and the operands it requires."""
    match node:
        case Binary(BinaryOperator.IMPLIES, left, right):
            return left, (right,)
        case Binary(BinaryOperator.OR, Unary(UnaryOperator.NOT, left), right):
            return left, (right,)
        case Binary(BinaryOperator.AND | BinaryOperator.OR) | Since() | Triggered():
            return None, (node.left, node.right)
        case Once() | Historically() | Yesterday() | WeakYesterday():
            return None, (node.argument,)
        case Choice():
            return None, (node.yes, node.no)
        case _:
            return None, ()


def horizon(item: Property) -> int:
    """Return how many steps into the past a formula's bounds reach; nested bounds add up."""
    depth: dict[Formula, int] = {}
    for node in postorder(item.roots):
        below = max((depth[part] for part in operands(node)), default=0)
        depth[node] = below + _reach(node)
    return max(depth.values())


def _reach(node: Formula) -> int:
    match node:
        case Once() | Historically() | Since() | Triggered():
            return max(node.window.low, node.window.high or 0)
        case Over() | Ago() | TimeOver():
            return node.past
        case Trial():
            return node.due or 0
        case Yesterday() | WeakYesterday() | Previous() | Feedback():
            return 1
        case _:
            return 0


def bounds(item: Property) -> list[int]:
    """Return all positive ends of windows, in ascending order."""
    found = set()
    for node in postorder(item.roots):
        if isinstance(node, Once | Historically | Since | Triggered):
            found |= {end for end in (node.window.low, node.window.high) if end}
        elif isinstance(node, Over | Ago | TimeOver):
            found.add(node.past)
        elif isinstance(node, Trial):
            found.add(node.due or 0)
    return sorted(end for end in found if end > 0)


def untriggered(item: Property) -> Formula | None:
    """
    Return a formula that is violated where the implication of a requirement is triggered.

    None for a sentence with a scope or condition, of which `explain.report.meanings` knows it.
    """
    if item.sentence is not None and (item.sentence.scope or item.sentence.condition):
        return None
    match item.formula:
        case Historically(window, Binary(BinaryOperator.IMPLIES, left, _)) if window == ALWAYS:
            return Unary(UnaryOperator.NOT, left)
    found = triggers(item.formula, 1) if item.sentence is None else []
    return Unary(UnaryOperator.NOT, found[0]) if found else None
