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
The syntax tree of all formula languages: operators with their places.

A parser takes a `Text` and returns an `Expression`; it checks neither types nor names nor bounds.
Trees can be thousands of nodes deep: walk them with an explicit stack, or with `postorder`.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from typing import TypeAlias

from fret_monitor.model.diagnostics import Span


@dataclass(frozen=True, eq=False)
class Name:
    """An identifier: an input, constant, definition, name of a value, or `FTP`."""

    text: str
    span: Span


@dataclass(frozen=True, eq=False)
class Number:
    """A literal as written (`15`, `1.5e-3`), without a sign."""

    text: str
    span: Span


@dataclass(frozen=True, eq=False)
class Boolean:
    """`TRUE` or `FALSE`."""

    value: bool
    span: Span


class Unit(Enum):
    """A unit of time; the value is its name in the plural."""

    TICK = 'ticks'
    NANOSECOND = 'nanoseconds'
    MICROSECOND = 'microseconds'
    MILLISECOND = 'milliseconds'
    SECOND = 'seconds'
    MINUTE = 'minutes'
    HOUR = 'hours'


@dataclass(frozen=True, eq=False)
class Duration:
    """
    `10 seconds`: the number as written, without a sign, and the unit.

    It is the timing of a sentence, an end of a bound, or an argument of a function.
    """

    number: str
    unit: Unit
    span: Span


@dataclass(frozen=True, eq=False)
class Bound:
    """
    A bound as written: `[low,high]`, or a relation and a number.

    `relation` is '[]' for the closed form, else one of '<', '<=', '=', '>', '>='. For those,
    `low` holds the number and `high` is None. Numbers are kept as text with an optional sign, an
    end that names constants as its tree, one with a unit as a `Duration`.
    """

    relation: str
    low: 'str | Expression'
    high: 'str | Expression | None'
    span: Span


@dataclass(frozen=True, eq=False)
class Prefix:
    """
    A prefix operator: '!', '-', or temporal 'Y', 'Z', 'O', 'H', or Lustre's 'pre'.

    `operator_span` is the place of the operator with its bound, `span` that of the whole.
    """

    operator: str
    bound: Bound | None
    argument: 'Expression'
    operator_span: Span
    span: Span


@dataclass(frozen=True, eq=False)
class Infix:
    """
    An infix operator.

    One of '&', '|', 'xor', '->', '<->', '<', '<=', '>', '>=', '=', '!=', '+', '-', '*', '/',
    'mod', '^', 'S', 'T', 'SI', and from Lustre 'arrow' (`init -> expression`). Only 'S', 'T' and
    'SI' can have a bound. CoCoSpec's `S(p,q)` is here already `q S p`.
    """

    operator: str
    bound: Bound | None
    left: 'Expression'
    right: 'Expression'
    operator_span: Span
    span: Span


@dataclass(frozen=True, eq=False)
class Call:
    """
    A function call such as `abs(x)` or `persisted(3, p)`.

    `variables` are those of a function over instances, as in `count(robot: p)`.
    """

    function: str
    arguments: tuple['Expression', ...]
    function_span: Span
    span: Span
    variables: tuple[Name, ...] = ()


@dataclass(frozen=True, eq=False)
class Conditional:
    """Lustre's `if condition then yes else no`."""

    condition: 'Expression'
    yes: 'Expression'
    no: 'Expression'
    span: Span


Expression: TypeAlias = (
    Name | Number | Boolean | Duration | Prefix | Infix | Call | Conditional)


@dataclass(frozen=True, eq=False)
class LustreVariable:
    """`name: type` of a Lustre node; the type as written, mostly `bool`, `int` or `real`."""

    name: str
    type: str
    span: Span


@dataclass(frozen=True, eq=False)
class LustreEquation:
    """`name = expression;`. `name_span` is the place of the name, `span` that of the whole."""

    name: str
    expression: Expression
    name_span: Span
    span: Span


@dataclass(frozen=True, eq=False)
class Equations:
    """
    A Lustre node, or several equations without one; no name is defined twice.

    Of a node, `result` is the equation of its one output, `inputs` are its declared inputs, and
    `declarations` its local variables and the output, each with its equation. Without a node,
    `result` is the last equation, and nothing is declared. Equations may use one another in any
    order; cycles are not checked here.
    """

    equations: tuple[LustreEquation, ...]
    result: LustreEquation
    inputs: tuple[LustreVariable, ...]
    declarations: tuple[LustreVariable, ...]
    span: Span


def children(node: Expression) -> tuple[Expression, ...]:
    """Return the direct operands of a node, left to right."""
    match node:
        case Prefix():
            return (node.argument,)
        case Infix():
            return (node.left, node.right)
        case Call():
            return node.arguments
        case Conditional():
            return (node.condition, node.yes, node.no)
        case _:
            return ()


def postorder(root: Expression) -> Iterator[Expression]:
    """Yield every node after its operands, without recursion."""
    stack: list[tuple[Expression, bool]] = [(root, False)]
    while stack:
        node, ready = stack.pop()
        if ready:
            yield node
            continue
        stack.append((node, True))
        stack.extend((child, False) for child in reversed(children(node)))
