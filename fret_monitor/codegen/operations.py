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

"""Operations without state as C expressions: connectives, relations, arithmetic, conversions."""

from fret_monitor.codegen import c
from fret_monitor.codegen.names import SUFFIXES
from fret_monitor.logic.formula import BinaryOperator, UnaryOperator
from fret_monitor.model.values import ValueType
from fret_monitor.program.monitor_program import ApplyBinary, Convert

_RELATIONS = {BinaryOperator.LT: '<', BinaryOperator.LE: '<=', BinaryOperator.GT: '>',
              BinaryOperator.GE: '>=', BinaryOperator.EQ: '==', BinaryOperator.NE: '!='}
# int64 compared with uint64: the function, whether operands are swapped, whether it is negated.
_MIXED = {BinaryOperator.LT: ('less', False, False), BinaryOperator.GE: ('less', False, True),
          BinaryOperator.GT: ('less', True, False), BinaryOperator.LE: ('less', True, True)}
_ARITHMETIC = {BinaryOperator.ADD: '+', BinaryOperator.SUB: '-', BinaryOperator.MUL: '*',
               BinaryOperator.DIV: '/'}
_OF_LIBRARY = {BinaryOperator.POW: 'pow', BinaryOperator.ATAN2: 'atan2'}
OF_MATH_H = frozenset({'NAN', 'INFINITY', *_OF_LIBRARY.values(), *(
    operator.value for operator in UnaryOperator if operator.is_library)})
"""What expressions may use of `math.h`."""
_FUNCTIONS = {BinaryOperator.ADD: 'add', BinaryOperator.SUB: 'sub', BinaryOperator.MUL: 'mul',
              BinaryOperator.DIV: 'div', BinaryOperator.MOD: 'mod', BinaryOperator.MIN: 'min',
              BinaryOperator.MAX: 'max'}


def convert(operation: Convert, argument: c.CExpression, type: ValueType) -> c.CExpression:
    """Return a number in another type."""
    if operation.source is ValueType.UINT64 and type is ValueType.INT64:
        return c.Apply('fm_signed', (argument,))
    return c.Cast(type.c_name, argument)


def unary(operator: UnaryOperator, argument: c.CExpression, type: ValueType) -> c.CExpression:
    """Return the negative, the absolute value, or a function of the C library."""
    if operator.is_library:
        return c.Apply(operator.value, (argument,))
    if operator is UnaryOperator.ABS:
        return c.Apply(f'fm_abs_{SUFFIXES[type]}', (argument,))
    if type.is_float:
        return c.Negation('-', argument)
    return c.Apply(f'fm_neg_{SUFFIXES[type]}', (argument,))


def binary(operation: ApplyBinary, left: c.CExpression, right: c.CExpression) -> c.CExpression:
    """Return a connective, a relation or arithmetic of two values."""
    operator = operation.operator
    if operator.is_boolean:
        return _connective(operator, left, right)
    if operator.is_relation:
        return _relation(operator, left, right, operation.types)
    return _arithmetic(operator, left, right, operation.types[0])


def _connective(operator: BinaryOperator, left: c.CExpression,
                right: c.CExpression) -> c.CExpression:
    match operator:
        case BinaryOperator.AND:
            return c.Operation('&', left, right)
        case BinaryOperator.OR:
            return c.Operation('|', left, right)
        case BinaryOperator.IMPLIES:
            return c.Operation('|', c.negate(left), right)
        case BinaryOperator.XOR:
            return c.Operation('!=', left, right)
        case _:
            return c.Operation('==', left, right)


def _relation(operator: BinaryOperator, left: c.CExpression, right: c.CExpression,
              types: tuple[ValueType, ValueType]) -> c.CExpression:
    if types[0] is types[1]:
        return c.Operation(_RELATIONS[operator], left, right)
    signs = 'iu' if types[0] is ValueType.INT64 else 'ui'
    if operator in (BinaryOperator.EQ, BinaryOperator.NE):
        both = (left, right) if signs == 'iu' else (right, left)
        call: c.CExpression = c.Apply('fm_equal_iu', both)
        return c.negate(call) if operator is BinaryOperator.NE else call
    name, turned, negated = _MIXED[operator]
    if turned:
        left, right, signs = right, left, signs[::-1]
    call = c.Apply(f'fm_{name}_{signs}', (left, right))
    return c.negate(call) if negated else call


def _arithmetic(operator: BinaryOperator, left: c.CExpression, right: c.CExpression,
                type: ValueType) -> c.CExpression:
    if type.is_float and operator in _ARITHMETIC:
        return c.Operation(_ARITHMETIC[operator], left, right)
    if operator in _OF_LIBRARY:
        return c.Apply(_OF_LIBRARY[operator], (left, right))
    return c.Apply(f'fm_{_FUNCTIONS[operator]}_{SUFFIXES[type]}', (left, right))
