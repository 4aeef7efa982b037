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
Arithmetic and relations of formulas as terms, as docs/numbers.md defines them.

It shares no code with the code generator, so that a proof compares two implementations.
"""

from typing import Any

from fret_monitor.logic.formula import BinaryOperator, UnaryOperator
from fret_monitor.model.values import ValueType
from fret_monitor.smt import terms as t
from fret_monitor.smt.terms import Sort, Term

_BY_VALUE = 66  # bits that hold every int64 and every uint64
_PLAIN = {BinaryOperator.ADD: 'add', BinaryOperator.SUB: 'sub', BinaryOperator.MUL: 'mul'}


def sort_of(kind: ValueType) -> Sort:
    """Return the sort of the values of a type."""
    if kind is ValueType.BOOL:
        return t.BOOL
    return t.real(kind.bits) if kind.is_float else t.word(kind.bits)


def input_value(value: Any, kind: ValueType) -> bool | int | float:
    """Return the value of an input from that of its term, in which words are unsigned."""
    if kind.is_float:
        return float(value)
    if kind.is_integer:
        return t.signed(value, kind.bits) if kind.is_signed else int(value)
    return bool(value)


def constant(value: bool | int | float, kind: ValueType) -> Term:
    """Return a constant of a type."""
    return t.constant(value, sort_of(kind))


def convert(item: Term, source: ValueType, target: ValueType) -> Term:
    """Convert a number: integers modulo 2^64, floats to nearest."""
    if target.is_float:
        return t.to_real(item, target.bits, source.is_signed)
    return t.resized(item, target.bits, source.is_signed)


def unary(operator: UnaryOperator, item: Term, kind: ValueType) -> Term:
    """Return the negation, the absolute value (`x` if `x >= 0`, else `-x`), or a call."""
    if operator.is_library:
        return t.library(operator.value, item)
    if kind.is_float:
        negative = t.unary('fneg', item)
        natural = t.relation('fle', t.floating(0.0, kind.bits), item)
    else:
        negative = t.operation('sub', t.number(0, 64), item)
        natural = t.negation(t.relation('slt', item, t.number(0, 64))) if kind.is_signed \
            else t.TRUE
    return negative if operator is UnaryOperator.NEG else t.choice(natural, item, negative)


def binary(operator: BinaryOperator, left: Term, right: Term,
           types: tuple[ValueType, ValueType]) -> Term:
    """Return the result of a connective, a relation or an arithmetic operator."""
    if operator.is_boolean or types[0] is ValueType.BOOL:
        return connective(operator, left, right)
    if operator.is_relation:
        return relation(operator, left, right, types)
    return arithmetic(operator, left, right, types[0])


def connective(operator: BinaryOperator, left: Term, right: Term) -> Term:
    """Return the result of a connective."""
    match operator:
        case BinaryOperator.AND:
            return t.conjunction(left, right)
        case BinaryOperator.OR:
            return t.disjunction(left, right)
        case BinaryOperator.IMPLIES:
            return t.implies(left, right)
        case BinaryOperator.IFF | BinaryOperator.EQ:
            return t.same_truth(left, right)
        case BinaryOperator.XOR | BinaryOperator.NE:
            return t.negation(t.same_truth(left, right))
        case _:
            raise ValueError(f'{operator} is no connective')


def relation(operator: BinaryOperator, left: Term, right: Term,
             types: tuple[ValueType, ValueType]) -> Term:
    """Return a comparison: integers by value; floats false with NaN, except `!=`."""
    if types[0].is_float:
        return _compared(operator, left, right, 'flt', 'fle', 'feq')
    if types[0] is not types[1]:
        left, right = (t.resized(item, _BY_VALUE, kind.is_signed)
                       for item, kind in zip((left, right), types))
    elif not types[0].is_signed:
        return _compared(operator, left, right, 'ult', 'ule', 'equal')
    return _compared(operator, left, right, 'slt', 'sle', 'equal')


def _compared(operator: BinaryOperator, left: Term, right: Term, less: str, at_most: str,
              equal: str) -> Term:
    match operator:
        case BinaryOperator.LT:
            return t.relation(less, left, right)
        case BinaryOperator.LE:
            return t.relation(at_most, left, right)
        case BinaryOperator.GT:
            return t.relation(less, right, left)
        case BinaryOperator.GE:
            return t.relation(at_most, right, left)
        case BinaryOperator.EQ:
            return t.relation(equal, left, right)
        case BinaryOperator.NE:
            return t.negation(t.relation(equal, left, right))
        case _:
            raise ValueError(f'{operator} is no relation')


def arithmetic(operator: BinaryOperator, left: Term, right: Term, kind: ValueType) -> Term:
    """Return the result of arithmetic in one type: integers wrap, floats round to nearest."""
    if operator in (BinaryOperator.MIN, BinaryOperator.MAX):
        test = BinaryOperator.LE if operator is BinaryOperator.MIN else BinaryOperator.GE
        return t.choice(relation(test, left, right, (kind, kind)), left, right)
    if kind.is_float:
        return _of_floats(operator, left, right)
    if operator in _PLAIN:
        return t.operation(_PLAIN[operator], left, right)
    zero = t.number(0, 64)
    by_zero = t.relation('equal', right, zero)
    prefix = 's' if kind.is_signed else 'u'
    name = {BinaryOperator.DIV: 'div', BinaryOperator.MOD: 'rem'}[operator]
    # As docs/numbers.md requires, SMT-LIB's division of words truncates and wraps for
    # INT64_MIN / -1, and the result of `rem` has the sign of the dividend.
    return t.choice(by_zero, zero, t.operation(prefix + name, left, right))


def _of_floats(operator: BinaryOperator, left: Term, right: Term) -> Term:
    match operator:
        case BinaryOperator.ADD | BinaryOperator.SUB | BinaryOperator.MUL:
            return t.operation('f' + _PLAIN[operator], left, right)
        case BinaryOperator.DIV:
            return t.operation('fdiv', left, right)
        case BinaryOperator.MOD:
            return t.library('fmod', left, right)
        case BinaryOperator.POW:
            return t.library('pow', left, right)
        case BinaryOperator.ATAN2:
            return t.library('atan2', left, right)
        case _:
            raise ValueError(f'{operator} is no arithmetic')


def power(base: Term, exponent: int, kind: ValueType) -> Term:
    """
    Return a power with a constant exponent, by repeated squaring from the lowest bit.

    For floats, the order of the products is part of the definition, because it affects rounding.
    """
    name = 'fmul' if kind.is_float else 'mul'
    result = constant(1, kind)
    for place in range(exponent.bit_length()):
        if place:
            base = t.operation(name, base, base)
        if exponent >> place & 1:
            result = t.operation(name, result, base)
    return result
