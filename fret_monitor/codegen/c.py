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
C expressions as a tree, and their text.

Every operand that is not a single token is in parentheses, except in chains of one associative
operator. A reader need not know C's precedence, and compilers do not warn about it.
"""

from dataclasses import dataclass
import math
from typing import assert_never, TypeAlias

from fret_monitor.model.floats import shortest_float32
from fret_monitor.model.values import ValueType

_CHAINS = frozenset({'&', '|'})


@dataclass(frozen=True)
class Atom:
    """A name, a literal or a field."""

    text: str


@dataclass(frozen=True)
class Negation:
    """`!x` or `-x`."""

    operator: str
    operand: 'CExpression'


@dataclass(frozen=True)
class Operation:
    """An infix operator."""

    operator: str
    left: 'CExpression'
    right: 'CExpression'


@dataclass(frozen=True)
class Apply:
    """`function(arguments)`."""

    function: str
    arguments: tuple['CExpression', ...]


@dataclass(frozen=True)
class Cast:
    """`(type)x`."""

    type: str
    operand: 'CExpression'


@dataclass(frozen=True)
class Ternary:
    """`condition ? yes : no`."""

    condition: 'CExpression'
    yes: 'CExpression'
    no: 'CExpression'


CExpression: TypeAlias = Atom | Negation | Operation | Apply | Cast | Ternary


def _operands(expression: CExpression) -> tuple[CExpression, ...]:
    match expression:
        case Atom():
            return ()
        case Negation() | Cast():
            return (expression.operand,)
        case Operation():
            return (expression.left, expression.right)
        case Apply():
            return expression.arguments
        case Ternary():
            return (expression.condition, expression.yes, expression.no)
        case _:
            assert_never(expression)


def depth(expression: CExpression) -> int:
    """Return the nesting depth; recursive, since expressions are kept shallow."""
    return max((depth(item) + 1 for item in _operands(expression)), default=0)


def calls(expression: CExpression) -> bool:
    """Whether a function is called in an expression; recurses like `depth`."""
    return isinstance(expression, Apply) or any(map(calls, _operands(expression)))


def text(expression: CExpression) -> str:
    """Return the C text."""
    match expression:
        case Atom():
            return expression.text
        case Negation():
            return f'{expression.operator}{_inner(expression.operand)}'
        case Operation():
            return _operation(expression)
        case Apply():
            arguments = ', '.join(text(item) for item in expression.arguments)
            return f'{expression.function}({arguments})'
        case Cast():
            return f'({expression.type}){_inner(expression.operand)}'
        case Ternary():
            return (f'{_inner(expression.condition)} ? {_inner(expression.yes)} : '
                    f'{_inner(expression.no)}')
        case _:
            assert_never(expression)


def _operation(expression: Operation) -> str:
    left, right = (
        text(side) if _continues(side, expression.operator) else _inner(side)
        for side in (expression.left, expression.right))
    if isinstance(expression.left, Negation):
        left = f'({text(expression.left)})'  # gcc warns about `!p & q`
    return f'{left} {expression.operator} {right}'


def _continues(side: CExpression, operator: str) -> bool:
    return operator in _CHAINS and isinstance(side, Operation) and side.operator == operator


def _inner(expression: CExpression) -> str:
    shown = text(expression)
    if isinstance(expression, Atom):
        return f'({shown})' if shown.startswith('-') else shown
    if isinstance(expression, Apply):
        return shown
    if isinstance(expression, Negation) and expression.operator == '!':
        return shown
    return f'({shown})'


def negate(expression: CExpression) -> CExpression:
    """Return `!expression`, without a double negation."""
    if isinstance(expression, Negation) and expression.operator == '!':
        return expression.operand
    return Negation('!', expression)


def literal(value: bool | int | float, type: ValueType) -> Atom:
    """Return a number as a C literal that has exactly this value and type."""
    if isinstance(value, bool):
        return Atom('true' if value else 'false')
    if type.is_float:
        return Atom(_float_literal(float(value), type))
    number = int(value)
    if type is ValueType.UINT64:
        return Atom(f'{number}u' if number < 2 ** 32 else f'UINT64_C({number})')
    if number == -2 ** 63:
        return Atom('INT64_MIN')
    return Atom(str(number) if abs(number) < 2 ** 31 else f'INT64_C({number})')


def string_literal(data: bytes) -> str:
    """Return a C string literal of any bytes; octal escapes end after three digits."""
    shown = ''.join(chr(byte) if 32 <= byte < 127 and chr(byte) not in '"\\?' else f'\\{byte:03o}'
                    for byte in data)
    return f'"{shown}"'


def _float_literal(value: float, type: ValueType) -> str:
    suffix = 'f' if type is ValueType.FLOAT32 else ''
    cast = '' if suffix else '(double)'
    if math.isnan(value):
        return f'{cast}NAN'
    if math.isinf(value):
        return f'{"-" if value < 0 else ""}{cast}INFINITY'
    digits = shortest_float32(value) if suffix else repr(value)
    return (digits if any(c in digits for c in '.e') else digits + '.0') + suffix
