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
A timed requirement as one that takes a step at every point of a grid of time.

For traces whose inputs change on the grid only, the verdicts on the grid are the same, except for
what lasts one tick: `Y`, `Z`, `pre` and FTP then last one point of the grid. Examples that are
found on it have to be confirmed in real time (`explain/in_time.py`).
"""

from collections.abc import Iterable
from dataclasses import replace
from math import gcd
from typing import assert_never

from fret_monitor.logic.formula import (
    Aggregate, Ago, Binary, BinaryOperator, Choice, Constant, Conversion, Formula, Historically,
    Once, operands, Over, postorder, rebuilt, Since, Slope, TimeOver, Trial, Triggered, TRUE,
    Window,
)
from fret_monitor.logic.specification import Property
from fret_monitor.model.times import NANOSECONDS

_MOST_POINTS = 400  # in the longest bound
_FEWEST_POINTS = 10


def grid_of(item: Property) -> int:
    """
    Return the spacing of a grid, in nanoseconds, on which all bounds lie if that is not too fine.

    `[<10 s]` ends one tick before 10 s, and counts as 10 s.
    """
    bounds = {_round(end) for node in postorder(item.roots) for end in _ends(node)}
    bounds.discard(0)
    if not bounds:
        return NANOSECONDS['s']
    exact: int = gcd(*bounds)
    coarse = max(bounds) // _MOST_POINTS
    if exact < coarse:
        return int(10 ** len(str(coarse)))
    parts = (part for part in (1, 2, 5, 10) if exact % part == 0)
    return next((exact // part for part in parts if max(bounds) * part >= exact * _FEWEST_POINTS),
                exact)


def sampled(item: Property, grid: int) -> Property:
    """Return a requirement whose steps are `grid` nanoseconds apart."""
    found = sampled_formulas(item.roots, grid)
    return replace(
        item, formula=found[item.formula],
        bounds=tuple(_round(end) // grid for end in item.bounds),
        feedback=tuple((node, found[equation]) for node, equation in item.feedback))


def sampled_formulas(roots: Iterable[Formula], grid: int) -> dict[Formula, Formula]:
    """Return each node of some formulas with its windows in points of the grid."""
    found: dict[Formula, Formula] = {}
    for node in postorder(roots):
        changed = rebuilt(node, found)
        if isinstance(changed, Once | Historically):
            changed = type(changed)(_window(changed.window, grid), changed.argument)
        elif isinstance(changed, Since | Triggered):
            changed = type(changed)(_window(changed.window, grid), changed.left, changed.right)
        elif isinstance(changed, Over | Ago | TimeOver):
            changed = _narrowed(changed, grid)
        elif isinstance(changed, Slope):
            changed = Slope(changed.argument, changed.at, grid)
        elif isinstance(changed, Trial) and changed.due is not None:
            changed = Trial(changed.due // grid, *operands(changed))
        found[node] = changed
    return found


def _ends(node: Formula) -> tuple[int, ...]:
    match node:
        case Once() | Historically() | Since() | Triggered():
            return tuple(end for end in (node.window.low, node.window.high) if end)
        case Over() | Ago():
            return (node.past,)
        case TimeOver():
            return node.past, node.least
        case Trial():
            return (node.due,) if node.due else ()
        case _:
            return ()


def _narrowed(node: Over | Ago | TimeOver, grid: int) -> Formula:
    past = max(1, node.past // grid)
    match node:
        case Over():
            return _over_messages(Over(node.aggregate, past, node.argument, node.at))
        case Ago():
            return Ago(past, node.argument)
        case TimeOver():
            return TimeOver(past, min(past, -(-node.least // grid)), node.argument)
        case _:
            assert_never(node)


def _over_messages(node: Over) -> Formula:
    """Return an aggregate over the points at which a message comes as one over all points."""
    match node.aggregate:
        case Aggregate.GREATEST | Aggregate.LEAST:
            return node
        case Aggregate.COUNT:
            both = Binary(BinaryOperator.AND, node.at, node.argument)
            return Over(node.aggregate, node.past, both, TRUE)
        case Aggregate.SUM:
            zero = Constant(0 if node.type.is_integer else 0.0, node.type)
            return Over(node.aggregate, node.past, Choice(node.at, node.argument, zero), TRUE)
        case Aggregate.MEAN:
            total = _over_messages(Over(Aggregate.SUM, node.past, node.argument, node.at))
            count = Over(Aggregate.COUNT, node.past, node.at, TRUE)
            return Binary(BinaryOperator.DIV, total, Conversion(count, node.type))
        case _:
            assert_never(node.aggregate)


def _window(window: Window, grid: int) -> Window:
    high = None if window.high is None else window.high // grid
    return Window(-(-window.low // grid), high)


def _round(ticks: int) -> int:
    """Return a bound without the tick by which `<` and `>` differ from `<=` and `>=`."""
    return max((ticks - 1, ticks, ticks + 1), key=lambda item: gcd(item, 10 ** 18))
