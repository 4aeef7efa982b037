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
Typed formulas of arithmetic and comparisons (`x + 1`, `x > 300`).

The rules are those of docs/numbers.md. Integers are compared by value, so a comparison accepts a
literal outside the range of the operand's type, with a warning: it is always true or always
false. In arithmetic such a literal is an error.
"""

from math import ceil, floor

from fret_monitor.elaboration.terms import (
    alike, cast, common_type, convert, describe, expect_number, Lasting, Number, promoted,
    TypedTerm, unify,
)
from fret_monitor.logic.formula import (
    Binary, BinaryOperator, Constant, Conversion, FALSE, Formula, TimeOver, TRUE, Unary,
    UnaryOperator,
)
from fret_monitor.logic.numbers import absolute, ExactNumber, fold, negated, NumberError
from fret_monitor.model.diagnostics import Problems, refuse, Span
from fret_monitor.model.times import NANOSECONDS
from fret_monitor.model.values import ValueType

MAX_EXPONENT = 2 ** 31 - 1

_MIRRORED = {
    BinaryOperator.LT: BinaryOperator.GT,
    BinaryOperator.LE: BinaryOperator.GE,
    BinaryOperator.GT: BinaryOperator.LT,
    BinaryOperator.GE: BinaryOperator.LE,
    BinaryOperator.EQ: BinaryOperator.EQ,
    BinaryOperator.NE: BinaryOperator.NE,
}
_TRUE_BELOW = (BinaryOperator.LT, BinaryOperator.LE, BinaryOperator.NE)
_TRUE_ABOVE = (BinaryOperator.GT, BinaryOperator.GE, BinaryOperator.NE)
_DIVISIONS = {BinaryOperator.DIV: 'x / 0', BinaryOperator.MOD: 'x mod 0'}


def minus(term: TypedTerm) -> Number:
    """Return `-x`."""
    value = expect_number(term, "'-'")
    if isinstance(value, ExactNumber):
        return negated(value)
    return Unary(UnaryOperator.NEG, promoted(value))


def magnitude(term: TypedTerm, operator: str) -> Number:
    """Return `abs(x)`; `operator` is the function's name as written."""
    value = expect_number(term, operator)
    if isinstance(value, ExactNumber):
        return absolute(value)
    return Unary(UnaryOperator.ABS, promoted(value))


def arithmetic(operator: BinaryOperator, left: TypedTerm, right: TypedTerm, name: str, place: Span,
               problems: Problems) -> Number:
    """Return `left operator right`; `name` is the operator as written, at `place`."""
    a, b = expect_number(left, name), expect_number(right, name)
    if isinstance(a, ExactNumber) and isinstance(b, ExactNumber):
        return _folded(operator, a, b, right, place, problems)
    kind = common_type([a, b])
    if isinstance(b, ExactNumber) and b.value == 0 and operator in _DIVISIONS:
        _warn_of_zero(operator, kind, right, problems)
    return Binary(operator, cast(left, a, kind), cast(right, b, kind))


def _warn_of_zero(operator: BinaryOperator, kind: ValueType, divisor: TypedTerm,
                  problems: Problems) -> None:
    if kind.is_integer:
        label = f'on whole numbers {_DIVISIONS[operator]} is 0'
    else:
        label = 'this is infinite, or NaN' if operator is BinaryOperator.DIV else 'this is NaN'
    problems.warning('a division by zero', divisor.span, label)


def _folded(operator: BinaryOperator, a: ExactNumber, b: ExactNumber, right: TypedTerm,
            place: Span, problems: Problems) -> ExactNumber:
    try:
        result = fold(operator, a, b)
    except NumberError as error:
        refuse('this number cannot be computed', place, str(error))
    if operator in _DIVISIONS and b.value == 0:
        _warn_of_zero(operator, ValueType.INT64, right, problems)
    elif operator is BinaryOperator.DIV and a.value / b.value != result.value:
        problems.warning(f'{a} / {b} in whole numbers is {result}', place, 'rounded toward zero',
                         f'write {a}.0 / {b} for the exact quotient')
    return result


def power(base: TypedTerm, exponent: TypedTerm, place: Span) -> Number:
    """
    Return `base ^ exponent`.

    With a whole literal exponent >= 0 the result has the base's type (repeated multiplication).
    Otherwise one of the two must be a real number, and both are converted to FLOAT64.
    """
    a, b = expect_number(base, "'^'"), expect_number(exponent, "'^'")
    if isinstance(b, ExactNumber) and not b.is_real:
        if b.value >= 0 and not isinstance(a, ExactNumber):
            return _repeated(promoted(a), b, exponent)
        if isinstance(a, ExactNumber) and (b.value >= 0 or a.is_real):
            return _folded_power(a, b, place)
    if unify([a, b]) not in (ValueType.FLOAT32, ValueType.FLOAT64, None):
        refuse("'^' on whole numbers takes a whole exponent >= 0, written as a number",
               exponent.span, f'this is {describe(exponent)}',
               'make the base or the exponent a real number, as in 2.0 ^ n')
    if unify([a, b]) is None and not (_is_real(a) or _is_real(b)):
        refuse("'^' on whole numbers takes an exponent >= 0", exponent.span,
               f'this is {describe(exponent)}', 'write the base as a real number, as in 2.0 ^ -1')
    return Binary(BinaryOperator.POW, cast(base, a, ValueType.FLOAT64),
                  cast(exponent, b, ValueType.FLOAT64))


def _is_real(value: Number) -> bool:
    return isinstance(value, ExactNumber) and value.is_real


def _repeated(base: Formula, exponent: ExactNumber, term: TypedTerm) -> Formula:
    if exponent.value > MAX_EXPONENT:
        refuse(f'an exponent is at most {MAX_EXPONENT}', term.span, f'this is {exponent}')
    return Binary(BinaryOperator.POW, base,
                  Constant(exponent.value.numerator, ValueType.INT64))


def _folded_power(base: ExactNumber, exponent: ExactNumber, place: Span) -> ExactNumber:
    try:
        return fold(BinaryOperator.POW, base, exponent)
    except NumberError as error:
        refuse('this number cannot be computed', place, str(error))


def relation(operator: BinaryOperator, left: TypedTerm, right: TypedTerm, name: str, place: Span,
             problems: Problems) -> Formula:
    """Return the comparison `left operator right`; `name` is the operator as written."""
    if isinstance(left.value, Lasting) and isinstance(right.value, ExactNumber):
        return _lasting(operator, left.value, right.value)
    if isinstance(right.value, Lasting) and isinstance(left.value, ExactNumber):
        return _lasting(_MIRRORED[operator], right.value, left.value)
    if left.is_text or right.is_text or left.is_boolean or right.is_boolean:
        return _equality(operator, left, right, name)
    a, b = expect_number(left, name), expect_number(right, name)
    if isinstance(a, ExactNumber):
        if isinstance(b, ExactNumber):
            return TRUE if _holds(operator, a, b) else FALSE
        mirrored = _against(_MIRRORED[operator], b, a, left, place, problems)
        return Binary(_MIRRORED[mirrored.operator], mirrored.right, mirrored.left)
    if isinstance(b, ExactNumber):
        return _against(operator, a, b, right, place, problems)
    return _typed(operator, a, b)


def _lasting(operator: BinaryOperator, time: Lasting, limit: ExactNumber) -> Formula:
    """Return the comparison of a `timeOver` with a number of seconds, exact to the nanosecond."""
    exact = limit.value * NANOSECONDS['s']
    reaches, exceeds = (_at_least(time, count) for count in (ceil(exact), floor(exact) + 1))
    match operator:
        case BinaryOperator.GE:
            return reaches
        case BinaryOperator.GT:
            return exceeds
        case BinaryOperator.LT:
            return Unary(UnaryOperator.NOT, reaches)
        case BinaryOperator.LE:
            return Unary(UnaryOperator.NOT, exceeds)
        case _:
            equal = Binary(BinaryOperator.AND, reaches, Unary(UnaryOperator.NOT, exceeds))
            return equal if operator is BinaryOperator.EQ else Unary(UnaryOperator.NOT, equal)


def _at_least(time: Lasting, count: int) -> Formula:
    if count <= 0:
        return TRUE
    return TimeOver(time.past, count, time.argument) if count <= time.past else FALSE


def _equality(operator: BinaryOperator, left: TypedTerm, right: TypedTerm, name: str) -> Formula:
    if operator not in (BinaryOperator.EQ, BinaryOperator.NE):
        term = left if left.is_boolean or left.is_text else right
        expect_number(term, name)
    first, second = alike([left, right], name)
    return Binary(operator, first, second)


def _typed(operator: BinaryOperator, a: Formula, b: Formula) -> Formula:
    kind = common_type([a, b])
    if kind.is_float:
        return Binary(operator, convert(a, kind), convert(b, kind))
    # No conversion between INT64 and UINT64: relations compare them by value.
    return Binary(operator, promoted(a), promoted(b))


def _holds(operator: BinaryOperator, a: ExactNumber, b: ExactNumber) -> bool:
    less, equal = a.value < b.value, a.value == b.value
    return {
        BinaryOperator.LT: less,
        BinaryOperator.LE: less or equal,
        BinaryOperator.GT: not less and not equal,
        BinaryOperator.GE: not less,
        BinaryOperator.EQ: equal,
        BinaryOperator.NE: not equal,
    }[operator]


def _against(operator: BinaryOperator, formula: Formula, literal: ExactNumber, term: TypedTerm,
             place: Span, problems: Problems) -> Binary:
    """Return `formula operator literal`; `term` is the literal with its place."""
    if formula.type.is_integer:
        _warn_of_constant(operator, formula.type, literal, place, problems)
    if isinstance(formula, Unary) and formula.operator is UnaryOperator.ABS:
        _warn_of_magnitude(operator, formula.argument, literal, place, problems)
    kind = common_type([formula, literal])
    if kind.is_float:
        return Binary(operator, convert(formula, kind), cast(term, literal, kind))
    node = promoted(formula)
    operator, other = _whole(operator, node.type, literal)
    return Binary(operator, node, other)


def _whole(operator: BinaryOperator, kind: ValueType,
           literal: ExactNumber) -> tuple[BinaryOperator, Formula]:
    """
    Return an operator and a constant whose comparison is equivalent to that with the literal.

    A literal outside the operand's type becomes a constant of the other 64-bit type, compared by
    value. A literal outside both types is replaced by an end of the range, with an operator that
    is always true or always false there.
    """
    other = ValueType.INT64 if kind is ValueType.UINT64 else ValueType.UINT64
    (low, high), (least, greatest) = kind.limits, other.limits
    value = literal.value.numerator
    if low <= value <= high:
        return operator, Constant(value, kind)
    if value > high if kind is ValueType.INT64 else value < low:
        return operator, Constant(max(least, min(value, greatest)), other)
    if value > high:
        always = operator in _TRUE_BELOW
        return BinaryOperator.LE if always else BinaryOperator.GT, Constant(high, kind)
    always = operator in _TRUE_ABOVE
    return BinaryOperator.GE if always else BinaryOperator.LT, Constant(low, kind)


def _warn_of_magnitude(operator: BinaryOperator, argument: Formula, literal: ExactNumber,
                       place: Span, problems: Problems) -> None:
    """Warn of `abs(x) < 0`: an absolute value is at least 0, except that of INT64_MIN."""
    if argument.type.is_integer and not isinstance(argument, Conversion):
        return
    is_decided = literal.value < 0 or (
        literal.value == 0 and operator in (BinaryOperator.LT, BinaryOperator.GE))
    if is_decided and operator in _TRUE_ABOVE:
        problems.warning('this comparison is true for every number', place,
                         'an absolute value is at least 0')
    elif is_decided:
        problems.warning('this comparison is always false', place,
                         'an absolute value is at least 0',
                         'write a limit above 0, as in abs(x) < 0.1')


def _warn_of_constant(operator: BinaryOperator, kind: ValueType, literal: ExactNumber,
                      place: Span, problems: Problems) -> None:
    low, high = kind.limits
    if low <= literal.value <= high:
        return
    holds = operator in (_TRUE_BELOW if literal.value > high else _TRUE_ABOVE)
    problems.warning(f'this comparison is always {str(holds).lower()}', place,
                     f'a number of type {kind.value} is between {low} and {high}')
