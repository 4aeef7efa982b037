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


"""A formula of bounded future (`mltl`) in English words, as a reading aid."""

from fret_monitor.elaboration.durations import TimeScale
from fret_monitor.elaboration.future import FUTURE
from fret_monitor.language.expression import (
    Bound, Duration, Expression, Infix, postorder, Prefix,
)
from fret_monitor.model.times import time_text

_CONNECTIVES = {'&': ' and ', '|': ' or ', '->': ' then ', '<->': ' exactly when '}


def in_words(root: Expression, scale: TimeScale) -> str:
    """Return a formula in English; its parts without future are as written."""
    done: dict[Expression, str] = {}
    looks_ahead: set[Expression] = set()
    for node in postorder(root):
        parts = _operands(node)
        own = isinstance(node, Prefix | Infix) and node.operator in FUTURE
        if own or any(part in looks_ahead for part in parts):
            looks_ahead.add(node)
        done[node] = _worded(node, done, looks_ahead, scale) if node in looks_ahead \
            else node.span.written
    return done[root]


def _operands(node: Expression) -> tuple[Expression, ...]:
    match node:
        case Prefix():
            return (node.argument,)
        case Infix():
            return node.left, node.right
        case _:
            return ()


def _worded(node: Expression, done: dict[Expression, str], looks_ahead: set[Expression],
            scale: TimeScale) -> str:
    first, *rest = (f'({done[part]})' if part in looks_ahead else done[part]
                    for part in _operands(node))
    step = 'instant' if scale.is_timed else 'step'
    match node:
        case Prefix('X'):
            return f'at the next {step} {first}'
        case Prefix('G', Bound() as bound):
            return f'at every {step} {_ahead(bound, scale)} {first}'
        case Prefix('F', Bound() as bound):
            return f'at some {step} {_ahead(bound, scale)} {first}'
        case Infix('U', Bound() as bound):
            return (f'{rest[0]} at some {step} {_ahead(bound, scale)}, and {first} at those '
                    'before it')
        case Infix('R', Bound() as bound):
            return (f'{rest[0]} at every {step} {_ahead(bound, scale)}, up to one at which '
                    f'{first}')
        case Infix('->'):
            return f'if {first} then {rest[0]}'
        case Infix(operator) if operator in _CONNECTIVES:
            return f'{first}{_CONNECTIVES[operator]}{rest[0]}'
        case Prefix('!'):
            return f'not {first}'
        case Prefix():
            return f'{_operator(node)} {first}'
        case Infix():
            return f'{first} {_operator(node)} {rest[0]}'
        case _:
            raise AssertionError(node)


def _operator(node: Prefix | Infix) -> str:
    place = node.operator_span
    return place.source.text[place.start:place.end]


def _ahead(bound: Bound, scale: TimeScale) -> str:
    low, high = _length(bound.low, scale), _length(bound.high or bound.low, scale)
    nothing = low == _length('0', scale)
    match bound.relation:
        case '=':
            return f'{low} ahead'
        case '<':
            return f'less than {low} ahead'
        case '<=':
            return f'of now and the next {low}'
    if low == high:
        return 'now' if nothing else f'{low} ahead'
    return f'of now and the next {high}' if nothing else f'{low} to {high} ahead'


def _length(end: str | Expression, scale: TimeScale) -> str:
    if isinstance(end, Duration):
        return time_text(scale.time(end)) if scale.is_timed else end.span.written
    if not isinstance(end, str):
        return end.span.written
    if scale.is_timed:
        return time_text(int(int(end) * (scale.unit or 1) * 10 ** 9))
    return f'{int(end):,} step{"" if end == "1" else "s"}'
