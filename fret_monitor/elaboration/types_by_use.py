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
The types of undeclared names, inferred from how expressions use them.

An operand of `!` is Boolean, an operand of `<` a number, an operand of `preInt` an integer, and
both sides of `=` have the same type. Expressions that must have the same type form a class in a
union-find forest; the class has the type that one of its members requires. A use that contradicts
an earlier one is ignored, because the type check reports it later.
"""

from collections.abc import Iterable
from typing import assert_never

from fret_monitor.elaboration.elaborator import gives_truth
from fret_monitor.elaboration.over_time import OVER_TIME
from fret_monitor.language.expression import (
    Boolean, Call, children, Conditional, Duration, Expression, Infix, Name, Number, postorder,
    Prefix,
)
from fret_monitor.model.graph import DisjointSets
from fret_monitor.model.names import fret_name
from fret_monitor.model.values import ValueType

_BOOL, _INTEGER, _REAL = ValueType.BOOL, ValueType.INT64, ValueType.FLOAT64
_LOGICAL = frozenset({'&', '|', 'xor', '->', '<->', 'S', 'T', 'SI'})
_EQUALITY = frozenset({'=', '!='})
_ORDER = frozenset({'<', '<=', '>', '>='})
_ALL_NUMBERS = frozenset({'abs', 'min', 'max'})


class TypesByUse:
    """Collects uses of names, and infers BOOL, INT64 (if a use requires an integer) or FLOAT64."""

    def __init__(self) -> None:
        self._classes: DisjointSets[Expression | str] = DisjointSets()
        self._types: dict[Expression | str, ValueType | None] = {}  # by the root of a class

    def type_of(self, name: str) -> ValueType | None:
        """Return the type of a name, or None if its uses do not determine it."""
        return self._types.get(self._classes.root(fret_name(name)))

    def declare(self, name: str, known: ValueType) -> None:
        """Add a declared type; a number type only adds that the name is a number."""
        self._expect(_BOOL if known is _BOOL else _REAL, [fret_name(name)])

    def add_property(self, expression: Expression) -> None:
        """Add the uses in a Boolean expression."""
        self._add(expression)
        self._expect(_BOOL, [expression])

    def add_definition(self, name: str, expression: Expression) -> None:
        """Add the uses in a definition."""
        self._add(expression)
        self._unify([fret_name(name), expression])

    def _add(self, expression: Expression) -> None:
        for node in postorder(expression):
            self._add_operator(node)
            if gives_truth(node):
                self._expect(_BOOL, [node])

    def _add_operator(self, node: Expression) -> None:
        """Add the types that an operator requires of its operands and its result."""
        match node:
            case Name('FTP'):
                self._expect(_BOOL, [node])
            case Name():
                self._unify([node, fret_name(node.text)])
            case Number():
                self._expect(_REAL, [node])
            case Boolean() | Duration():
                pass
            case Prefix('-'):
                self._expect(_REAL, [node.argument, node])
            case Prefix('pre'):
                self._unify([node.argument, node])
            case Prefix():
                self._expect(_BOOL, [node.argument])
            case Infix(operator) if operator in _LOGICAL:
                self._expect(_BOOL, [node.left, node.right])
            case Infix(operator) if operator in _EQUALITY:
                self._unify([node.left, node.right])
            case Infix('arrow'):
                self._unify([node.left, node.right, node])
            case Infix(operator):
                sides = [node.left, node.right]
                self._expect(_REAL, sides if operator in _ORDER else [*sides, node])
            case Conditional() | Call('ite', (_, _, _)):
                self._add_choice(node)
            case Call():
                self._add_call(node)
            case _:
                assert_never(node)

    def _add_choice(self, node: Conditional | Call) -> None:
        condition, yes, no = children(node)
        self._expect(_BOOL, [condition])
        self._unify([yes, no, node])

    def _add_call(self, node: Call) -> None:
        name, arguments = node.function, node.arguments
        if node.variables:
            self._expect(_BOOL if name in ('count', 'any', 'all') else _REAL, arguments)
        elif name in ('persisted', 'occurred', 'countOver', 'timeOver'):
            self._expect(_BOOL, arguments[-1:])
        elif name == 'heldAt' and len(arguments) == 2:
            self._expect(_BOOL, arguments[:1])
            self._unify([arguments[1], node])
        elif name in OVER_TIME:
            self._expect(_REAL, [*arguments[-1:], node])
        elif name in ('preBool', 'prevOcc'):
            self._expect(_BOOL, arguments)
        elif name.endswith('Int'):
            self._expect(_INTEGER, arguments)
            self._expect(_REAL, [node])
        elif name.endswith('Real') or name in _ALL_NUMBERS:
            self._expect(_REAL, [*arguments, node])

    def _expect(self, needed: ValueType, members: Iterable[Expression | str]) -> None:
        for member in members:
            root = self._classes.root(member)
            self._types[root] = _common(self._types.get(root), needed) or self._types.get(root)

    def _unify(self, members: Iterable[Expression | str]) -> None:
        first, *others = members
        for other in others:
            self._join(self._classes.root(first), self._classes.root(other))

    def _join(self, root: Expression | str, other: Expression | str) -> None:
        common = _common(self._types.get(root), self._types.get(other))
        is_contradiction = common is None and self._types.get(root) is not None
        if root != other and not is_contradiction:
            self._types[self._classes.join(root, other)] = common


def _common(one: ValueType | None, other: ValueType | None) -> ValueType | None:
    """Return the type that satisfies two requirements; None for a contradiction, or for none."""
    if one is None or one is other:
        return other
    if other is None:
        return one
    return None if _BOOL in (one, other) else _INTEGER
