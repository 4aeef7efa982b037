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
Equations that settle: soon after their inputs changed, they stay as they are.

Under the policy timed, an equation that depends on its own previous value is evaluated only when
an input changes or a deadline comes. So it must settle in one step: with f(x) its value if x is
its previous one, f(f(x)) = f(x) as long as all else stays. That holds if

* it is Boolean and monotone in itself: f is then constant or the identity; or
* it chooses among itself and terms independent of it, by conditions, `min` and `max`. With
  conditions that are independent of it too, f is constant, the identity, or limits x to a range;
  with NaN or zeros of two signs it may take more steps, which the generated C finds by comparing.
  If a condition depends on it, there may be one independent term only, t: f(x) is x or t, and
  f(t) is t.

Choices by conditions that are independent of it may stand around these forms, in particular
Lustre's `initial -> ...`.
"""

from collections.abc import Collection, Iterator

from fret_monitor.logic.formula import (
    Binary, BinaryOperator, Choice, Feedback, Formula, operands, postorder, Unary, UnaryOperator,
)
from fret_monitor.model.values import ValueType

_EXTREMES = (BinaryOperator.MIN, BinaryOperator.MAX)


def settles(feedback: Feedback, equation: Formula, loop: Collection[Feedback]) -> bool:
    """
    Whether the form of an equation shows that it settles, once the other equations have.

    It may use equations that do not depend on it, but no other one of its `loop`.
    """
    nodes = list(postorder([equation]))
    if any(node in loop and node is not feedback for node in nodes
           if isinstance(node, Feedback)):
        return False
    dependent: set[Formula] = {feedback}
    for node in nodes:
        if not dependent.isdisjoint(operands(node)):
            dependent.add(node)
    is_boolean = feedback.type is ValueType.BOOL
    return all(is_boolean and _is_monotone(branch, feedback, dependent)
               or _chooses(branch, feedback, dependent)
               for branch in _branches(equation, dependent))


def _branches(equation: Formula, dependent: set[Formula]) -> Iterator[Formula]:
    """Yield what stands below the choices by independent conditions at the top."""
    todo = [equation]
    seen: set[Formula] = set()
    while todo:
        node = todo.pop()
        if isinstance(node, Choice) and node.condition not in dependent and node not in seen:
            todo += [node.yes, node.no]
        elif node not in seen:
            yield node
        seen.add(node)


def _is_monotone(equation: Formula, feedback: Feedback, dependent: set[Formula]) -> bool:
    """Whether a Boolean equation can only rise where its previous value does."""
    todo = [(equation, True)]
    seen: set[tuple[Formula, bool]] = set()
    while todo:
        item = todo.pop()
        node, rises = item
        if node not in dependent or item in seen:
            continue
        seen.add(item)
        match node:
            case Feedback() if node is feedback and rises:
                pass
            case Unary(UnaryOperator.NOT, argument):
                todo.append((argument, not rises))
            case Binary(BinaryOperator.AND | BinaryOperator.OR, left, right):
                todo += [(left, rises), (right, rises)]
            case Binary(BinaryOperator.IMPLIES, left, right):
                todo += [(left, not rises), (right, rises)]
            case Choice(condition, yes, no) if condition not in dependent:
                todo += [(yes, rises), (no, rises)]
            case _:
                return False
    return True


def _chooses(equation: Formula, feedback: Feedback, dependent: set[Formula]) -> bool:
    """Whether an equation chooses among itself and other terms, as in the module's docstring."""
    others: set[Formula] = set()
    is_free = True  # no condition depends on the equation
    todo, seen = [equation], set()
    while todo:
        node = todo.pop()
        if node in seen or node is feedback:
            continue
        seen.add(node)
        match node:
            case _ if node not in dependent:
                others.add(node)
            case Choice(condition, yes, no):
                is_free = is_free and condition not in dependent
                todo += [yes, no]
            case Binary(operator, left, right) if operator in _EXTREMES:
                todo += [left, right]
            case _:
                return False
    return is_free or len(others) <= 1
