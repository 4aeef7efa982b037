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

"""Mutants of requirements: what a person may get wrong in a bundle."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from fret_monitor.logic.formula import (
    Binary, BinaryOperator, Formula, Historically, Once, postorder, rebuilt, Since, Triggered,
    Unary, Window,
)
from fret_monitor.logic.propositions import propositions
from fret_monitor.logic.specification import Property

OP = BinaryOperator
SWAPPED = {OP.LT: OP.LE, OP.LE: OP.LT, OP.GT: OP.GE, OP.GE: OP.GT, OP.EQ: OP.NE, OP.NE: OP.EQ}
REVERSED = {OP.LT: OP.GT, OP.LE: OP.GE, OP.GT: OP.LT, OP.GE: OP.LE}


@dataclass(frozen=True)
class Mutant:
    """A requirement with one mistake."""

    what: str
    item: Property


def mutants(item: Property, delta: int = 1) -> Iterator[Mutant]:
    """Yield mutants with a swapped operator, a dropped condition, or another bound."""
    known = set(propositions(item))
    for node in postorder(item.roots):
        match node:
            case Binary(operator, left, right) if node in known:
                for other in (SWAPPED.get(operator), REVERSED.get(operator)):
                    if other is not None:
                        yield made(item, node, Binary(other, left, right), f'{other.value}')
            case Binary(OP.AND | OP.OR, left, right):
                yield made(item, node, left, 'right side dropped')
                yield made(item, node, right, 'left side dropped')
                swapped = OP.OR if node.operator is OP.AND else OP.AND
                yield made(item, node, Binary(swapped, left, right), 'connective swapped')
            case Unary(operator, argument) if node.type is argument.type and (
                    operator.value == '!'):
                yield made(item, node, argument, 'negation dropped')
            case Binary(OP.IMPLIES | OP.IFF, left, right):
                swapped = OP.IFF if node.operator is OP.IMPLIES else OP.IMPLIES
                yield made(item, node, Binary(swapped, left, right), swapped.value)
            case Once() | Historically() | Since() | Triggered():
                yield made(item, node, dual(node), f'{type(dual(node)).__name__}')
                for window in moved(node.window, delta):
                    yield made(item, node, with_window(node, window), f'{window}')
            case _:
                pass


def made(item: Property, node: Formula, other: Formula, what: str) -> Mutant:
    found: dict[Formula, Formula] = {}
    for each in postorder(item.roots):
        found[each] = other if each is node else rebuilt(each, found)
    return Mutant(what, replace(item, formula=found[item.formula]))


def dual(node: Once | Historically | Since | Triggered) -> Formula:
    match node:
        case Once(window, argument):
            return Historically(window, argument)
        case Historically(window, argument):
            return Once(window, argument)
        case Since(window, left, right):
            return Triggered(window, left, right)
        case Triggered(window, left, right):
            return Since(window, left, right)


def moved(window: Window, delta: int) -> Iterator[Window]:
    if window.high is not None and not window.is_empty:
        yield Window(window.low, window.high + delta)
        if window.high - delta >= window.low:
            yield Window(window.low, window.high - delta)


def with_window(node: Formula, window: Window) -> Formula:
    match node:
        case Once() | Historically():
            return type(node)(window, node.argument)
        case Since() | Triggered():
            return type(node)(window, node.left, node.right)
        case _:
            raise TypeError(node)
