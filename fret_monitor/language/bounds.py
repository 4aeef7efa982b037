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
The ends of bounds: a number, a time, or an expression of numbers and constants such as `10-1`.

A parser calls `bound_end`. The values of constants are not known then: `work_out` computes such an
end later.
"""

from collections.abc import Callable
import operator

from fret_monitor.language.expression import (
    Duration, Expression, Infix, Name, Number, postorder, Prefix,
)
from fret_monitor.model.diagnostics import refuse

_MAX_DIGITS = 30
_OPERATIONS: dict[str, Callable[[int, int], int]] = {
    '+': operator.add, '-': operator.sub, '*': operator.mul}


_ENDLESS = frozenset({'inf', 'infinity', 'oo'})


def bound_end(node: Expression) -> str | Expression:
    """
    Return an end of a bound: its number as text with an optional sign, or else `node`.

    That is so if the end is a time, or has names.

    Raises `CompileError` for any other expression.
    """
    match node:
        case Number():
            return node.text
        case Prefix(operator='-', argument=Number(text=text)):
            return f'-{text}'
        case Duration():
            return node
    names = [name for name in postorder(node) if isinstance(name, Name)]
    for name in names:
        if name.text.lower() in _ENDLESS:
            refuse('a bound must be a whole number', name.span, 'a name',
                   'for no upper bound write [>=n]')
    number = work_out(node, lambda name: 0)
    return node if names else str(number)


def work_out(root: Expression, constant: Callable[[Name], int]) -> int:
    """Compute an end of a bound; `constant` returns the value of a name."""
    values: list[int] = []
    for node in postorder(root):
        match node:
            case Number(text=text) if text.isdecimal() and len(text) <= _MAX_DIGITS:
                values.append(int(text))
            case Name():
                values.append(constant(node))
            case Prefix(operator='-'):
                values.append(-values.pop())
            case Infix(operator='+' | '-' | '*'):
                right, left = values.pop(), values.pop()
                values.append(_OPERATIONS[node.operator](left, right))
            case _:
                refuse('a bound must be a whole number', node.span, 'not a number')
        if abs(values[-1]) >= 10 ** _MAX_DIGITS:
            refuse('the bound is too large', root.span, 'a bound is at most 2147483647')
    return values[0]
