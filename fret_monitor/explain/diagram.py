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
The state diagram that a formula describes, as `import` writes it, and its picture.

For each state s the formula requires `Y (state = s) -> following`, where `following` is
`state = t`, or `ite(condition, state = t, following)`.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from math import cos, hypot, pi, sin
from xml.sax.saxutils import escape

from fret_monitor.logic.formula import (
    Binary, BinaryOperator, Choice, Constant, Conversion, Formula, FTP, Variable, Yesterday,
)
from fret_monitor.traces.trace import Value

_BOX = (96, 26)
_STEP = 52  # of the circle's radius, for each state
_MOST_LETTERS = 14
_BEND = 26
_MARGIN = 48
_COLOURS = {'now': '#3465a4', 'other': '#e4e7ea', 'line': '#666666'}


@dataclass(frozen=True)
class DrawnEdge:
    """An edge between two states, by their numbers; '' as condition: always taken."""

    origin: int
    target: int
    condition: str


@dataclass(frozen=True)
class StateDiagram:
    """The input that is the state, the names and values of its states, and the edges."""

    variable: str
    states: tuple[tuple[str, Value], ...]
    edges: tuple[DrawnEdge, ...]

    def at(self, value: Value) -> 'DrawnDiagram':
        """Return the diagram in the state of a value, which may be none of them."""
        return DrawnDiagram(self, next((number for number, (_, one) in enumerate(self.states)
                                        if one == value), None))


@dataclass(frozen=True)
class DrawnDiagram:
    """A diagram, and the number of the state it is in; None if it is in none of them."""

    diagram: StateDiagram
    state: int | None


@dataclass(frozen=True)
class StateRule:
    """What follows a state: the next states and their conditions in order; None: otherwise."""

    state: Formula
    ways: tuple[tuple[Formula | None, Formula], ...]


def rules_of(formula: Formula) -> tuple[StateRule, ...]:
    """Return the rules of the diagram that a formula describes; without any, it is none."""
    found = tuple(rule for part in _parts(formula) if (rule := _rule(part)))
    names = {compared[0] if (compared := _compared(node)) else ''
             for rule in found for node in (rule.state, *(target for _, target in rule.ways))}
    return found if len(names) == 1 and '' not in names and len(states_of(found)) > 1 else ()


def states_of(rules: Iterable[StateRule]) -> tuple[Formula, ...]:
    """Return the states of a diagram, each as `state = value`, in the order of the rules."""
    return tuple(dict.fromkeys(node for rule in rules for node in (
        rule.state, *(target for _, target in rule.ways))))


def first_state(formula: Formula, rules: Sequence[StateRule]) -> Formula:
    """Return the state that a formula requires at the first step, else that of the first rule."""
    for part in _parts(formula):
        match part:
            case Binary(BinaryOperator.IMPLIES, left, right) if left is FTP and _compared(right):
                return right
    return rules[0].state


def diagram_of(formula: Formula, text: Callable[[Formula], str]) -> StateDiagram | None:
    """Return the diagram that a formula describes; `text` writes a condition. None if none."""
    rules = rules_of(formula)
    if not rules:
        return None
    nodes = [(node, _compared(node) or ('', 0)) for node in states_of(rules)]
    numbers = {node: number for number, (node, _) in enumerate(nodes)}
    return StateDiagram(nodes[0][1][0], tuple(
        (value_text(node, text), value) for node, (_, value) in nodes), tuple(
        DrawnEdge(numbers[rule.state], numbers[target], text(condition) if condition else '')
        for rule in rules for condition, target in rule.ways
        if condition or target is not rule.state))


def value_text(state: Formula, text: Callable[[Formula], str]) -> str:
    """Return the name of a state, or its number."""
    return text(state).partition(' = ')[2]


def _parts(formula: Formula) -> Iterator[Formula]:
    stack = [formula]
    while stack:
        node = stack.pop()
        if isinstance(node, Binary) and node.operator is BinaryOperator.AND:
            stack += [node.right, node.left]
        else:
            yield node


def _rule(part: Formula) -> StateRule | None:
    """Return what follows a state; None for another formula."""
    match part:
        case Binary(BinaryOperator.IMPLIES, Yesterday(now), following) if _compared(now):
            return StateRule(now, tuple(ways_of(following)))
        case _:
            return None


def _compared(node: Formula) -> tuple[str, Value] | None:
    """Return the input that a node compares with a value, and the value."""
    match node:
        case Binary(BinaryOperator.EQ, Variable(name) | Conversion(Variable(name)),
                    Constant(value)):
            return name, value
        case _:
            return None


def ways_of(following: Formula) -> Iterator[tuple[Formula | None, Formula]]:
    """Yield conditions and the states or values to which they lead; None: otherwise."""
    while isinstance(following, Choice):
        yield following.condition, following.yes
        following = following.no
    yield None, following


# Drawing

def size(drawn: DrawnDiagram) -> tuple[int, int]:
    """Return the width and height of a picture."""
    radius = _radius(drawn)
    return round(2 * (radius + _MARGIN) + _BOX[0]), round(2 * (radius + _MARGIN))


def _radius(drawn: DrawnDiagram) -> float:
    return _STEP * max(1.6, len(drawn.diagram.states) / 2)


def svg_lines(drawn: DrawnDiagram, x: int, y: int) -> Iterator[str]:
    """Yield the elements of a picture whose upper left corner is there."""
    diagram, radius = drawn.diagram, _radius(drawn)
    width, height = size(drawn)
    count = len(diagram.states)
    places = [(x + width / 2 + radius * sin(2 * pi * k / count),
               y + height / 2 - radius * cos(2 * pi * k / count)) for k in range(count)]
    for edge in diagram.edges:
        yield from _edge(places[edge.origin], places[edge.target], edge.condition)
    for number, (name, _) in enumerate(diagram.states):
        yield from _state(*places[number], name, is_now=number == drawn.state)


def _state(x: float, y: float, name: str, *, is_now: bool) -> Iterator[str]:
    colour = _COLOURS['now' if is_now else 'other']
    yield (f'<rect x="{x - _BOX[0] / 2:.1f}" y="{y - _BOX[1] / 2:.1f}" width="{_BOX[0]}" '
           f'height="{_BOX[1]}" rx="8" fill="{colour}" stroke="{_COLOURS["line"]}"/>')
    yield _label(x, y + 4, name, '#ffffff' if is_now else '#222222')


def _edge(begin: tuple[float, float], end: tuple[float, float], condition: str) -> Iterator[str]:
    """Yield a curve that bends to its left, so that one back is beside it; and its condition."""
    across, down = end[0] - begin[0], end[1] - begin[1]
    length = hypot(across, down)
    if not length:
        yield from _loop(begin, condition)
        return
    bend = ((begin[0] + end[0]) / 2 + 2 * _BEND * down / length,
            (begin[1] + end[1]) / 2 - 2 * _BEND * across / length)
    first, last = _leaving(begin, bend), _leaving(end, bend)
    yield (f'<path d="M{first[0]:.1f},{first[1]:.1f} Q{bend[0]:.1f},{bend[1]:.1f} '
           f'{last[0]:.1f},{last[1]:.1f}" fill="none" stroke="{_COLOURS["line"]}"/>')
    yield _head(bend, last)
    yield _label((begin[0] + end[0]) / 2 + _BEND * down / length,
                 (begin[1] + end[1]) / 2 - _BEND * across / length + 4, condition, '#222222')


def _loop(place: tuple[float, float], condition: str) -> Iterator[str]:
    x, y = place[0], place[1] - _BOX[1] / 2
    yield (f'<path d="M{x - 14:.1f},{y:.1f} C{x - 22:.1f},{y - 30:.1f} {x + 22:.1f},{y - 30:.1f} '
           f'{x + 14:.1f},{y:.1f}" fill="none" stroke="{_COLOURS["line"]}"/>')
    yield _head((x + 22, y - 30), (x + 14, y))
    yield _label(x, y - 26, condition, '#222222')


def _leaving(box: tuple[float, float], towards: tuple[float, float]) -> tuple[float, float]:
    """Return where a line from the middle of a box leaves it."""
    across, down = towards[0] - box[0], towards[1] - box[1]
    part = min(_BOX[0] / 2 / abs(across) if across else 1, _BOX[1] / 2 / abs(down) if down else 1)
    return box[0] + part * across, box[1] + part * down


def _head(origin: tuple[float, float], tip: tuple[float, float]) -> str:
    across, down = tip[0] - origin[0], tip[1] - origin[1]
    length = hypot(across, down) or 1
    along, aside = (across / length, down / length), (-down / length, across / length)
    corners = [tip, *((tip[0] - 8 * along[0] + side * aside[0],
                       tip[1] - 8 * along[1] + side * aside[1]) for side in (4, -4))]
    points = ' '.join(f'{one:.1f},{two:.1f}' for one, two in corners)
    return f'<polygon points="{points}" fill="{_COLOURS["line"]}"/>'


def _label(x: float, y: float, text: str, colour: str) -> str:
    shown = text if len(text) <= 2 * _MOST_LETTERS else f'{text[:2 * _MOST_LETTERS - 3]}...'
    halo = '' if colour == '#ffffff' else \
        ' stroke="#ffffff" stroke-width="3" paint-order="stroke"'
    return (f'<text x="{x:.1f}" y="{y:.1f}" fill="{colour}" text-anchor="middle" '
            f'font-size="11"{halo}>{escape(shown)}</text>')
