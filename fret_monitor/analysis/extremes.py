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
Comparisons of greatest and least values with constants, as operators over time.

`maxOver(d, x) <= c` is `H[0,d] (x <= c)`, which decision diagrams and solvers know. With NaN in
the window, maxOver is NaN: `maxOver(d, x) > c` is `(O[0,d] (x > c)) & H[0,d] (x = x)`.
"""

from collections.abc import Mapping
from dataclasses import replace

from fret_monitor.logic.formula import (
    Aggregate, Binary, BinaryOperator, Constant, Formula, Historically, Once, Over, postorder,
    rebuilt, Window,
)
from fret_monitor.logic.specification import Property, Specification

_TURNED = {BinaryOperator.LT: BinaryOperator.GT, BinaryOperator.LE: BinaryOperator.GE,
           BinaryOperator.GT: BinaryOperator.LT, BinaryOperator.GE: BinaryOperator.LE}
_ABOVE = (BinaryOperator.GT, BinaryOperator.GE)


def without_extremes(specification: Specification) -> Specification:
    """Return a bundle of the same verdicts, without extremes compared with constants."""
    return replace(specification, properties=tuple(map(_without, specification.properties)))


def _without(item: Property) -> Property:
    found = simplified(item.roots)
    return replace(item, formula=found[item.formula], feedback=tuple(
        (node, found[equation]) for node, equation in item.feedback))


def simplified(roots: tuple[Formula, ...]) -> Mapping[Formula, Formula]:
    """Return for each node of some formulas one that is equal to it."""
    found: dict[Formula, Formula] = {}
    for node in postorder(roots):
        found[node] = _compared(rebuilt(node, found))
    return found


def _compared(node: Formula) -> Formula:
    match node:
        case Binary(operator, Constant() as left, Over() as right) if operator in _TURNED:
            return _compared(Binary(_TURNED[operator], right, left))
        case Binary(operator, Over(Aggregate.GREATEST | Aggregate.LEAST) as left,
                    Constant() as right) if operator in _TURNED:
            return _over_time(operator, left, right)
        case _:
            return node


def _over_time(operator: BinaryOperator, extreme: Over, limit: Constant) -> Formula:
    window, number = Window(0, extreme.past), extreme.argument
    compared = Binary(operator, number, limit)
    if (operator in _ABOVE) is (extreme.aggregate is Aggregate.LEAST):
        return Historically(window, compared)
    some = Once(window, compared)
    if not number.type.is_float:
        return some
    no_nan = Historically(window, Binary(BinaryOperator.EQ, number, number))
    return Binary(BinaryOperator.AND, some, no_nan)
