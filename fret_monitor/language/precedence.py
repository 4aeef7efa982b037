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
The precedence of operators, and the tree of a sequence of operands and operators.

A parser adds operands and operators to a `Chain` from left to right, which builds the tree by a
`Precedence`, with two stacks, in linear time. The printers use the same tables.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

from fret_monitor.language.expression import Bound, Expression, Infix, Prefix
from fret_monitor.model.diagnostics import refuse, Span


@dataclass(frozen=True, eq=False)
class Precedence:
    """
    The level of each operator; higher binds tighter; no prefix has the level of an infix.

    Operators are left-associative, those in `right` right-associative; those in `single`
    (comparisons) cannot be chained, and the error suggests `conjunction` instead.
    """

    infix: Mapping[str, int]
    prefix: Mapping[str, int]
    right: frozenset[str]
    single: frozenset[str]
    conjunction: str


class Operator(NamedTuple):
    """An operator with its bound; `span` is where both stand."""

    text: str
    bound: Bound | None
    span: Span


class Pending(NamedTuple):
    """A prefix operator whose operand may still be extended."""

    operator: Operator
    operand: 'Expression | Pending'


class _Waiting(NamedTuple):
    level: int
    is_prefix: bool
    operator: Operator


class Chain:
    """Builds the tree of a sequence of operands and operators."""

    def __init__(self, precedence: Precedence) -> None:
        """Start empty; an operand comes first."""
        self._precedence = precedence
        self._operands: list[Expression] = []
        self._waiting: list[_Waiting] = []

    def add_operand(self, operand: Expression | Pending) -> None:
        """Add an operand with its prefix operators."""
        while isinstance(operand, Pending):
            level = self._precedence.prefix[operand.operator.text]
            self._waiting.append(_Waiting(level, True, operand.operator))
            operand = operand.operand
        self._operands.append(operand)

    def add_infix(self, operator: Operator) -> None:
        """Add an infix operator; raises `CompileError` for a second comparison."""
        level = self._precedence.infix[operator.text]
        while self._waiting and self._waiting[-1].level > level:
            self._join_last()
        if self._waiting and self._waiting[-1].level == level:
            if operator.text in self._precedence.single:
                self._refuse_second(operator)
            if operator.text not in self._precedence.right:
                self._join_last()
        self._waiting.append(_Waiting(level, False, operator))

    def close(self) -> Expression:
        """Return the tree."""
        while self._waiting:
            self._join_last()
        return self._operands.pop()

    def _join_last(self) -> None:
        _, is_prefix, (text, bound, span) = self._waiting.pop()
        right = self._operands.pop()
        if is_prefix:
            whole = Span(span.source, span.start, right.span.end)
            self._operands.append(Prefix(text, bound, right, span, whole))
            return
        left = self._operands.pop()
        whole = Span(span.source, left.span.start, right.span.end)
        self._operands.append(Infix(text, bound, left, right, span, whole))

    def _refuse_second(self, operator: Operator) -> None:
        first = self._waiting[-1].operator.text
        left, middle = (node.span.written for node in self._operands[-2:])
        instead = (f'write {left} {first} {middle} {self._precedence.conjunction} '
                   f'{middle} {operator.text} ...')
        refuse('comparisons cannot be chained', operator.span, 'a second comparison',
               instead if len(instead) <= 100 else 'put parentheses around one comparison')
