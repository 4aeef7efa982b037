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
The definition of MLTL (docs/language.md), step by step, and random formulas of it.

It shares nothing with the package: a formula is a tuple of an operator, its bounds and its
operands, and `value` says what it means at a step of a trace that is long enough.
"""

from collections.abc import Callable, Mapping, Sequence
from random import Random
from typing import Any, TypeAlias

Tree: TypeAlias = tuple[Any, ...]
Columns: TypeAlias = Mapping[str, Sequence[bool]]

_BOUNDED = 'GFURHOST'
_POINTWISE: dict[str, Callable[[bool, bool], bool]] = {
    '&&': lambda p, q: p and q, '||': lambda p, q: p or q, '->': lambda p, q: not p or q,
    '<->': lambda p, q: p is q,
}


def horizon(tree: Tree) -> int:
    """Return how many steps ahead a formula looks at most."""
    operator, *rest = tree
    deepest = max((horizon(item) for item in rest if isinstance(item, tuple)), default=0)
    own = rest[1] if operator in ('G', 'F', 'U', 'R') else 1 if operator == 'X' else 0
    return int(own) + deepest


def value(tree: Tree, columns: Columns, t: int) -> bool:
    """Return what a formula means at step t."""
    operator, *rest = tree
    if operator in columns:
        return columns[operator][t]
    if operator in _POINTWISE:
        return _POINTWISE[operator](value(rest[0], columns, t), value(rest[1], columns, t))
    if operator in _BOUNDED:
        return _over_time(operator, rest, columns, t)
    if operator == '!':
        return not value(rest[0], columns, t)
    if operator == 'X':
        return value(rest[0], columns, t + 1)
    return value(rest[0], columns, t - 1) if t else operator == 'Z'


def _over_time(operator: str, rest: list[Any], columns: Columns, t: int) -> bool:
    low, high, *operands = rest

    def at(number: int, step: int) -> bool:
        return value(operands[number], columns, step)

    ahead = range(t + low, t + high + 1)
    past = range(max(0, t - high), t - low + 1)
    match operator:
        case 'G':
            return all(at(0, k) for k in ahead)
        case 'F':
            return any(at(0, k) for k in ahead)
        case 'U':
            return any(at(1, k) and all(at(0, i) for i in range(t + low, k)) for k in ahead)
        case 'R':
            return all(at(1, k) or any(at(0, i) for i in range(t + low, k)) for k in ahead)
        case 'H':
            return all(at(0, k) for k in past)
        case 'O':
            return any(at(0, k) for k in past)
        case 'S':
            return any(at(1, k) and all(at(0, i) for i in range(k + 1, t + 1)) for k in past)
        case _:
            return all(at(1, k) or any(at(0, i) for i in range(k + 1, t + 1)) for k in past)


def verdicts(tree: Tree, columns: Columns) -> list[bool]:
    """Return the verdict at each step r: that of step r - horizon, TRUE before."""
    steps, late = len(next(iter(columns.values()))), horizon(tree)
    return [r < late or value(tree, columns, r - late) for r in range(steps)]


def text(tree: Tree, unit: str = '') -> str:
    """Return a formula as R2U2 and FRET write it."""
    operator, *rest = tree
    if operator in _BOUNDED:
        bound = f'{operator}[{rest[0]}{unit},{rest[1]}{unit}]'
        rest = rest[2:]
    else:
        bound = operator
    match [text(item, unit) for item in rest]:
        case []:
            return str(operator)
        case [p]:
            return f'({bound} {p})'
        case [p, q]:
            return f'({p} {bound} {q})'
        case _:
            raise AssertionError(tree)


def random_tree(rng: Random, depth: int, names: Sequence[str], reach: int) -> Tree:
    """Return a random formula with bounds up to `reach`."""
    if depth == 0 or rng.random() < 0.1:
        return (rng.choice(names),)

    def operand() -> Tree:
        return random_tree(rng, depth - 1, names, reach)

    operator = rng.choice(('G', 'F', 'U', 'R', 'U', 'R', 'X', '!', '&&', '||', '->', '<->',
                           'H', 'O', 'S', 'T', 'Y', 'Z'))
    ends = sorted((rng.randrange(reach + 1), rng.randrange(reach + 1)))
    match operator:
        case 'G' | 'F' | 'H' | 'O':
            return operator, *ends, operand()
        case 'U' | 'R' | 'S' | 'T':
            return operator, *ends, operand(), operand()
        case 'X' | '!' | 'Y' | 'Z':
            return operator, operand()
        case _:
            return operator, operand(), operand()


def random_columns(rng: Random, names: Sequence[str], steps: int) -> dict[str, list[bool]]:
    """Return values that change at about a third of the steps."""
    found: dict[str, list[bool]] = {}
    for name in names:
        now = rng.random() < 0.5
        found[name] = []
        for _ in range(steps):
            now = now is not (rng.random() < 0.3)
            found[name].append(now)
    return found
