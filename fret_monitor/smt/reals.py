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
Translation of terms to z3 in which floats are real numbers, and words are integers.

Comparisons of finite floats with one another and with constants mean the same there. Sums and
products are either not rounded, or any number as near as rounding leaves it: then the real
numbers that make terms true include the floats that do. `is_rounded` says whether a term has any.
NaN and the infinities have no value here.
"""

from fractions import Fraction
import math
from typing import Any

from fret_monitor.model.floats import to_float32
from fret_monitor.smt import terms as t
from fret_monitor.smt.linear import LinearTranslation, NotLinear
from fret_monitor.smt.terms import Term
import z3

_ROUNDED = frozenset({'fadd', 'fsub', 'fmul', 'fdiv'})
_PRECISION = {32: Fraction(1, 2 ** 23), 64: Fraction(1, 2 ** 52)}  # twice what rounding needs
_SMALLEST = {32: Fraction(1, 2 ** 149), 64: Fraction(1, 2 ** 1074)}
_LARGEST = {32: Fraction(2 ** 128 - 2 ** 104), 64: Fraction(2 ** 1024 - 2 ** 971)}


class RealTranslation(LinearTranslation):
    """
    Translates terms to z3; raises NotLinear for operations without a linear form.

    A product of two numbers is translated, too: the solver decides small polynomials of real
    numbers, but seldom those of floats.
    """

    def __init__(self, is_wide: bool = False) -> None:
        """Set whether a result that is rounded can be any number near it."""
        super().__init__()
        self._is_wide = is_wide

    def _near(self, exact: Any, item: Term) -> Any:
        """Return a number that the float next to another one may be."""
        if not self._is_wide:
            return exact
        bits = item.sort[1]
        found = z3.FreshReal('rounded')
        size = z3.If(exact < 0, -exact, exact)
        slack = size * _real(_PRECISION[bits]) + _real(_SMALLEST[bits])
        largest = _real(_LARGEST[bits])
        self.ranges.append(z3.Or(
            z3.And(exact > largest, found >= largest),  # may be infinite
            z3.And(exact < -largest, found <= -largest),
            z3.And(found - exact <= slack, exact - found <= slack)))
        return found

    def _translated(self, item: Term) -> Any:
        args = [self._known[each] for each in item.args]
        match item.op:
            case 'constant' if item.sort[0] == 'real':
                value = t.plain(item)
                if not math.isfinite(value):
                    raise NotLinear('a number that is not finite')
                return _real(Fraction(value))
            case 'fneg':
                return -args[0]
            case 'fadd':
                return self._near(args[0] + args[1], item)
            case 'fsub':
                return self._near(args[0] - args[1], item)
            case 'fmul':
                return self._near(args[0] * args[1], item)
            case 'fdiv' if t.is_constant(item.args[1]) and t.plain(item.args[1]) != 0:
                return self._near(args[0] / args[1], item)
            case 'float':
                return self._near(args[0], item) if item.sort[1] == 32 else args[0]
            case 'float_s':
                return self._near(z3.ToReal(args[0]), item)
            case 'float_u' | 'zext':
                bits = item.args[0].sort[1]
                natural = z3.If(args[0] < 0, args[0] + (1 << bits), args[0])
                return self._near(z3.ToReal(natural), item) if item.op == 'float_u' else natural
            case 'mul' if any(map(t.is_constant, item.args)):
                half = 1 << (item.sort[1] - 1)
                return (args[0] * args[1] + half) % (2 * half) - half
            case 'flt':
                return args[0] < args[1]
            case 'fle':
                return args[0] <= args[1]
            case 'feq' | 'same':
                return args[0] == args[1]
            case 'choice':
                return z3.If(*args)
        return super()._translated(item)

    def _variable(self, item: Term) -> Any:
        if item.sort[0] != 'real':
            return super()._variable(item)
        found = self.variables[item] = z3.Real(item.value)
        largest = _real(_LARGEST[item.sort[1]])
        self.ranges.append(z3.And(-largest <= found, found <= largest))
        return found


def _real(value: Fraction) -> Any:
    return z3.RealVal(str(value))


def is_rounded(item: Term) -> bool:
    """Whether the value of a term may depend on rounding."""
    return any(each.op in _ROUNDED or each.op == 'float' and each.sort[1] == 32
               or each.op in ('float_s', 'float_u') and each.args[0].sort[1] > each.sort[1] * 0.8
               for each in t.postorder([item]))


def has_product(item: Term) -> bool:
    """Whether a term multiplies two numbers neither of which is constant."""
    return any(each.op == 'fmul' and not any(map(t.is_constant, each.args))
               for each in t.postorder([item]))


def value_of(found: Any, sort: t.Sort) -> bool | int | float:
    """Return the value of a z3 constant as that of a variable: bool, int (unsigned) or float."""
    kind, bits = sort
    if kind == 'bool':
        return bool(z3.is_true(found))
    if kind == 'word':
        return int(found.as_long()) & ((1 << bits) - 1)
    if z3.is_algebraic_value(found):
        found = found.approx(20)
    exact = Fraction(found.numerator_as_long(), found.denominator_as_long())
    return to_float32(exact) if bits == 32 else float(exact)
