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
Warnings about requirements of gates and locks that NaN makes weaker.

A comparison with NaN is false, so that `distance < 1.0 -> speed <= 0.0` holds when a range sensor
gives NaN for an invalid reading (REP 117). `!(distance >= 1.0) -> speed <= 0.0` demands a stop.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple, TypeAlias

from fret_monitor.logic.formula import (
    Ago, Binary, BinaryOperator as Op, Choice, Constant, Conversion, Formula, Held, Historically,
    MessageSlope, Once, operands, Over, postorder, Previous, Since, Slope, Triggered, Unary,
    UnaryOperator, Variable, variables, WeakYesterday, Yesterday,
)
from fret_monitor.logic.pointwise import operation
from fret_monitor.logic.printing import to_smv
from fret_monitor.logic.specification import Specification
from fret_monitor.model.diagnostics import Diagnostic, Level
from fret_monitor.model.manifest import SECONDS
from fret_monitor.model.values import ValueType


def weaker_with_nan(specification: Specification) -> Iterator[Diagnostic]:
    """Yield a warning for each comparison that lets a kept or locking requirement hold for NaN."""
    floats = {signal.name for signal in specification.signals if signal.type.is_float
              and signal.topic is not None and signal.reduction != SECONDS}
    for item in specification.properties:
        if item.id not in specification.gated and specification.locks.isdisjoint(
                item.on_violation):
            continue
        found: dict[Binary, list[str]] = {}
        for variable in variables(item.formula):
            if variable.name in floats:
                for comparison in weakening(item.formula, variable):
                    found.setdefault(comparison, []).append(variable.name)
        for node, names in found.items():
            value = node.right if node.operator in _SELECTING else Constant(
                node.operator is Op.NE, ValueType.BOOL)
            yield Diagnostic(
                f'{item.id} requires less while {" or ".join(names)} is NaN', item.place,
                f'{to_smv(node)} is {to_smv(value).lower()} then',
                f'write {_strict(node)} instead of {to_smv(node)}', Level.WARNING)


def _strict(comparison: Binary) -> str:
    """Return what equals a weakening node for numbers, and is true, false or NaN as NaN needs."""
    def relation(operator: Op) -> str:
        return to_smv(Binary(operator, comparison.left, comparison.right))

    if comparison.operator in _SELECTING:
        return to_smv(Binary(comparison.operator, comparison.right, comparison.left))
    match comparison.operator:
        case Op.EQ:
            return f'!({relation(Op.LT)} | {relation(Op.GT)})'
        case Op.NE:
            return f'({relation(Op.LT)} | {relation(Op.GT)})'
        case operator:
            return f'!({relation(_OPPOSITE[operator])})'


_OPPOSITE = {Op.LT: Op.GE, Op.LE: Op.GT, Op.GT: Op.LE, Op.GE: Op.LT}


# Of NaN on the left, the result is the right operand.
_SELECTING = frozenset({Op.MIN, Op.MAX})


class _Weak(NamedTuple):
    """
    A comparison that weakens a formula, which reads it `age` steps ago at the latest.

    Or a `min` or `max` that gives a number for NaN, on which a comparison rests.
    """

    comparison: Binary
    age: int


_Found: TypeAlias = bool | frozenset[_Weak]
"""What NaN makes of a formula: a constant, or something that these comparisons weaken."""


class _Both(NamedTuple):
    """What NaN makes of a formula where it is required, and where its negation is."""

    required: _Found
    denied: _Found


_OPAQUE: frozenset[_Weak] = frozenset()


def weakening(formula: Formula, variable: Variable) -> list[Binary]:
    """
    Return the comparisons that weaken a formula while an input is NaN.

    These are the comparisons of the input whose value then makes the formula hold more easily,
    such as `x < 1` left of an implication, unless other comparisons of the input make up for them,
    as in `x >= 0 & (x < 1 -> p)`. Of a comparison that is read at several steps, the latest
    counts: the edge `!(x >= 1) & Y (x >= 1)` is true when NaN begins. A `min` or `max` is returned
    where it makes a number of NaN, and a comparison of that number may make the formula hold.
    """
    undefined: set[Formula] = {variable}
    replaced: dict[Formula, frozenset[Binary]] = {}
    table: dict[Formula, _Both] = {}
    order = postorder([formula])
    for node in order:
        if node.type is not ValueType.BOOL:
            if _is_nan(node, undefined, table):
                undefined.add(node)
            elif found_in := _replaced(node, undefined, replaced):
                replaced[node] = found_in
        else:
            table[node] = _both(node, table, undefined, replaced)
    found = table[formula].required
    if isinstance(found, bool):
        return []
    ages = _ages(order)
    latest = {weak.comparison for weak in found if weak.age == ages[weak.comparison]}
    return [node for node in order if node in latest and isinstance(node, Binary)]


def _ages(order: Sequence[Formula]) -> dict[Formula, int]:
    """Return how many steps ago each node of a formula is read at the latest."""
    ages = {order[-1]: 0}
    for node in reversed(order):
        for part in operands(node):
            age = ages[node] + _distance(node, part)
            ages[part] = min(age, ages.get(part, age))
    return ages


def _distance(node: Formula, part: Formula) -> int:
    match node:
        case Yesterday() | WeakYesterday():
            return 1
        case Once() | Historically():
            return node.window.low
        case Since() | Triggered() if part is node.right:
            return node.window.low
        case _:
            return 0


def _is_nan(node: Formula, undefined: set[Formula], table: Mapping[Formula, _Both]) -> bool:
    """Return whether a number may be NaN."""
    match node:
        case Conversion() | Unary() | Previous() | Over() | Ago() | Held() | Slope() \
                | MessageSlope():
            return node.argument in undefined
        case Binary(Op.MIN | Op.MAX, _, right):
            return right in undefined
        case Binary(Op.POW, left, right):
            return left in undefined or right in undefined
        case Binary():
            return node.left in undefined or node.right in undefined
        case Choice():
            condition = table[node.condition]
            return node.yes in undefined and condition.required is not False or \
                node.no in undefined and condition.denied is not True
        case _:
            return node in undefined


def _replaced(node: Formula, undefined: set[Formula], replaced: Mapping[Formula, frozenset[Binary]]
              ) -> frozenset[Binary]:
    """Return the nodes that made a number of NaN, on which another number rests."""
    if isinstance(node, Binary) and node.operator in _SELECTING and node.left in undefined:
        return frozenset({node})
    return frozenset().union(*(replaced.get(item, frozenset()) for item in operands(node)))


def _of_numbers(node: Binary, weak: frozenset[_Weak]) -> _Both:
    """Return what a comparison is of which an operand is a number in place of NaN."""
    values = [item.right if isinstance(item, Binary) and item.operator in _SELECTING else item
              for item in (node.left, node.right)]
    if not all(isinstance(item, Constant) for item in values):
        return _Both(weak, weak)  # true or false
    is_true = operation(node)(*(item.value for item in values if isinstance(item, Constant)))
    return _Both(weak, True) if is_true else _Both(False, weak)


def _both(node: Formula, table: Mapping[Formula, _Both], undefined: set[Formula],
          replaced: Mapping[Formula, frozenset[Binary]]) -> _Both:
    match node:
        case Constant():
            return _Both(bool(node.value), bool(node.value))
        case Binary(operator, left, right) if operator.is_relation and (
                left in undefined or right in undefined):
            weak = frozenset({_Weak(node, 0)})
            return _Both(weak, True) if operator is Op.NE else _Both(False, weak)
        case Binary(operator, left, right) if operator.is_relation and (
                left in replaced or right in replaced):
            return _of_numbers(node, frozenset(_Weak(item, 0) for side in (left, right)
                                               for item in replaced.get(side, ())))
        case Unary(UnaryOperator.NOT, argument):
            found = table[argument]
            return _Both(_not(found.denied), _not(found.required))
        case Binary(Op.AND, left, right):
            return _Both(*map(_and, table[left], table[right]))
        case Binary(Op.OR, left, right):
            return _Both(*map(_or, table[left], table[right]))
        case Binary(Op.IMPLIES, left, right):
            return _Both(_or(_not(table[left].denied), table[right].required),
                         _or(_not(table[left].required), table[right].denied))
        case Yesterday():
            return _Both(*(_earlier(found, 1, keeps=False) for found in table[node.argument]))
        case WeakYesterday():
            return _Both(*(_earlier(found, 1, keeps=True) for found in table[node.argument]))
        case Once() | Historically():
            return _Both(*(_windowed(node, found) for found in table[node.argument]))
        case Since() | Triggered():
            return _Both(*(_since(node, *found) for found in zip(
                table[node.left], table[node.right])))
        case Choice(condition, yes, no):
            if table[condition].required is False:
                return table[no]
            if table[condition].denied is True:
                return table[yes]
            return _Both(*map(_either, table[yes], table[no]))
        case _:
            # In `<->` and `xor` a comparison strengthens one side and weakens the other.
            return _Both(_OPAQUE, _OPAQUE)


def _not(found: _Found) -> _Found:
    return not found if isinstance(found, bool) else found


def _and(one: _Found, other: _Found) -> _Found:
    if isinstance(one, bool):
        return other if one else False
    return _and(other, one) if isinstance(other, bool) else one | other


def _or(one: _Found, other: _Found) -> _Found:
    return _not(_and(_not(one), _not(other)))


def _either(one: _Found, other: _Found) -> _Found:
    """Return what NaN makes of a choice whose condition it leaves alone."""
    if one == other:
        return one
    return frozenset().union(*(item for item in (one, other) if not isinstance(item, bool)))


def _earlier(found: _Found, age: int, keeps: bool) -> _Found:
    """Return what NaN makes of a formula some steps ago; only the constant `keeps` stays."""
    if age == 0:
        return found
    if isinstance(found, bool):
        return found if found is keeps else _OPAQUE
    return frozenset(weak._replace(age=weak.age + age) for weak in found)


def _windowed(node: Once | Historically, found: _Found) -> _Found:
    is_all = isinstance(node, Historically)
    if node.window.is_empty:
        return is_all
    return _earlier(found, node.window.low, keeps=is_all)


def _since(node: Since | Triggered, left: _Found, right: _Found) -> _Found:
    is_triggered = isinstance(node, Triggered)
    if node.window.is_empty:
        return is_triggered
    right = _earlier(right, node.window.low, keeps=is_triggered)
    if isinstance(right, bool):
        return right
    return right if isinstance(left, bool) else left | right
