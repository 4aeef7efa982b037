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
What types names have: as other tools write them, and as formulas show that nobody has declared.

`plain_type` reads the names of types of FRET, Ogma, Copilot, C and Lustre. `Kinds` looks at how
names are used: what is negated is true or false, what is compared with a number is a number.
"""

from collections.abc import Iterable
from typing import assert_never

from fret_monitor.importing.component import key_of
from fret_monitor.language.expression import (
    Boolean, Call, children, Conditional, Expression, Infix, Name, Number, postorder, Prefix,
)
from fret_monitor.model.values import ValueType

_ALSO_CALLED = {
    ValueType.BOOL: ('boolean', '_bool', 'logical'),
    ValueType.INT8: ('i8', 'sint8'),
    ValueType.INT16: ('i16', 'sint16', 'short'),
    ValueType.INT32: ('i32', 'sint32'),
    # What FRET and Lustre call an integer has no end.
    ValueType.INT64: ('i64', 'sint64', 'int', 'integer', 'long', 'subrange'),
    ValueType.UINT8: ('u8', 'word8', 'byte', 'char'),
    ValueType.UINT16: ('u16', 'word16'),
    ValueType.UINT32: ('u32', 'word32', 'unsigned', 'unsigned integer', 'uint'),
    ValueType.UINT64: ('u64', 'word64'),
    ValueType.FLOAT32: ('f32', 'float', 'single'),
    ValueType.FLOAT64: ('f64', 'double', 'real'),
}
_TYPES = {name: kind for kind, names in _ALSO_CALLED.items() for name in (kind.value, *names)}
_TRUTH = ('&', '|', 'xor', '->', '<->', 'S', 'T', 'SI')
_ORDER = ('<', '<=', '>', '>=')
_ALIKE = ('=', '!=', 'arrow')
_TRUTH_CALLS = ('preBool', 'persisted', 'occurred', 'prevOcc')
_MESSAGES = {ValueType.BOOL: 'Bool', ValueType.FLOAT32: 'Float32', ValueType.FLOAT64: 'Float64'}


def plain_type(written: str) -> ValueType | None:
    """Return the type that a tool's name of a type means, None for others (structures, '')."""
    name = written.strip().lower().removeprefix('std::').removesuffix('_t')
    return _TYPES.get(name)


def message_for(kind: ValueType) -> str:
    """Return the message of std_msgs that carries one value of a type."""
    name = _MESSAGES.get(kind) or kind.value.replace('uint', 'UInt').replace('int', 'Int')
    return f'std_msgs/msg/{name}'


class Kinds:
    """What formulas show of the types of names: true or false, or numbers."""

    def __init__(self) -> None:
        """Know nothing yet."""
        self._parent: dict[object, object] = {}

    def is_truth(self, name: str) -> bool | None:
        """Whether a name is true or false; False for a number, None where nothing shows it."""
        root = self._root(key_of(name))
        return True if root is True else False if root is False else None

    def declare(self, name: str, is_truth: bool) -> None:
        """Add what is known of a name from elsewhere."""
        self._join(key_of(name), is_truth)

    def property(self, tree: Expression) -> None:
        """Look at an expression that is true or false."""
        self._look(tree)
        self._join(self._key(tree), True)

    def definition(self, name: str, tree: Expression) -> None:
        """Look at an expression that has a name."""
        self._look(tree)
        self._join(self._key(tree), key_of(name))

    def _look(self, tree: Expression) -> None:
        for node in postorder(tree):
            self._node(node)

    def _node(self, node: Expression) -> None:
        match node:
            case Name():
                pass
            case Boolean():
                self._join(self._key(node), True)
            case Number():
                self._join(self._key(node), False)
            case Prefix(operator='-'):
                self._all((node, node.argument), False)
            case Prefix(operator='pre'):
                self._join(self._key(node), self._key(node.argument))
            case Prefix():
                self._all((node, node.argument), True)
            case Infix():
                self._infix(node)
            case Call():
                self._call(node)
            case Conditional():
                self._join(self._key(node.condition), True)
                self._alike((node, node.yes, node.no))
            case _:
                assert_never(node)

    def _infix(self, node: Infix) -> None:
        if node.operator in _TRUTH:
            self._all((node, node.left, node.right), True)
        elif node.operator in _ORDER:
            self._all((node.left, node.right), False)
        elif node.operator in _ALIKE:
            self._alike((node.left, node.right))
        else:
            self._all((node, node.left, node.right), False)
        if node.operator in (*_ORDER, '=', '!='):
            self._join(self._key(node), True)
        elif node.operator == 'arrow':
            self._join(self._key(node), self._key(node.left))

    def _call(self, node: Call) -> None:
        if node.function == 'ite' and len(node.arguments) == 3:
            self._join(self._key(node.arguments[0]), True)
            self._alike((node, *node.arguments[1:]))
        elif node.function in _TRUTH_CALLS and node.arguments:
            truths = node.arguments if node.function in ('preBool', 'prevOcc') else (
                node.arguments[-1:])
            self._all((node, *truths), True)
        else:
            self._all((node, *children(node)), False)

    def _all(self, nodes: Iterable[Expression], is_truth: bool) -> None:
        for node in nodes:
            self._join(self._key(node), is_truth)

    def _alike(self, nodes: Iterable[Expression]) -> None:
        first, *others = nodes
        for node in others:
            self._join(self._key(first), self._key(node))

    def _key(self, node: Expression) -> object:
        return key_of(node.text) if isinstance(node, Name) else node

    # Sets of what has one type; True and False stand for the two types themselves.

    def _root(self, key: object) -> object:
        way = []
        while key in self._parent:
            way.append(key)
            key = self._parent[key]
        for step in way:
            self._parent[step] = key
        return key

    def _join(self, first: object, second: object) -> None:
        one, other = self._root(first), self._root(second)
        if one is other or isinstance(one, bool) and isinstance(other, bool):
            return  # a contradiction is for the type check to tell
        if isinstance(one, bool):
            one, other = other, one
        self._parent[one] = other
