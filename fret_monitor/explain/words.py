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

"""Formulas in English words, as a reading aid; only the formula itself is precise."""

from collections.abc import Mapping
from typing import assert_never, NamedTuple, TypeAlias

from fret_monitor.logic.formula import (
    Aggregate, Ago, Binary, BinaryOperator, Choice, Constant, Conversion, Feedback, Formula,
    FTP, Held, Historically, MessageSlope, NotRefuted, NUMBERS_OVER_TIME, Once, Over,
    postorder, Previous, Since, Slope, TimeOver, Trial, Triggered, Unary, UnaryOperator,
    Variable, WeakYesterday, Window, Yesterday,
)
from fret_monitor.logic.printing import to_smv, Values
from fret_monitor.logic.propositions import is_proposition
from fret_monitor.model.times import time_text

_TERM_WIDTH = 200
_CUT = ' ...'


class _Within(NamedTuple):
    """An operand, which is printed in parentheses unless it is short."""

    node: Formula


_Temporal: TypeAlias = (Yesterday | WeakYesterday | Once | Historically | Since | Triggered)
_Piece: TypeAlias = str | Formula | _Within

_CONNECTIVES = {
    BinaryOperator.AND: ('', ' and ', ''),
    BinaryOperator.OR: ('', ' or ', ''),
    BinaryOperator.XOR: ('either ', ' or ', ', not both'),
    BinaryOperator.IMPLIES: ('if ', ' then ', ''),
    BinaryOperator.IFF: ('', ' exactly when ', ''),
    BinaryOperator.EQ: ('', ' exactly when ', ''),
    BinaryOperator.NE: ('either ', ' or ', ', not both'),
}


_AGGREGATES = {
    Aggregate.GREATEST: 'greatest', Aggregate.LEAST: 'least', Aggregate.SUM: 'sum of',
    Aggregate.MEAN: 'mean of',
}


def in_words(formula: Formula, limit: int, values: Values | None = None,
             names: Mapping[Formula, str] | None = None, is_timed: bool = False) -> str:
    """
    Return a formula in English, on one line; a text longer than `limit` is cut and ends in ` ...`.

    `values`, `names` and `is_timed` are as for `to_smv`.
    """
    done: list[str] = []
    size = 0
    stack: list[_Piece] = [formula]
    while stack and size <= limit:
        piece = stack.pop()
        if isinstance(piece, str):
            done.append(piece)
            size += len(piece)
        elif isinstance(piece, _Within):
            stack += [piece.node] if _is_short(piece.node, names) else [')', piece.node, '(']
        else:
            stack.extend(reversed(_pieces(piece, values, names, is_timed)))
    text = ''.join(done)
    return text if size <= limit and not stack else text[:limit - len(_CUT)].rstrip() + _CUT


def _is_short(node: Formula, names: Mapping[Formula, str] | None) -> bool:
    match node:
        case Constant() | Variable() | Feedback():
            return True
        case Unary(UnaryOperator.NOT, argument):
            return is_proposition(argument) or bool(names and argument in names)
        case _:
            return node is FTP or is_proposition(node) or bool(names and node in names)


def _pieces(node: Formula, values: Values | None, names: Mapping[Formula, str] | None,
            is_timed: bool) -> list[_Piece]:
    if names and node in names:
        return [names[node]]
    match node:
        case Constant(value) if isinstance(value, bool):
            return [str(value).lower()]
        case Unary(UnaryOperator.NOT, argument):
            return ['not ', _Within(argument)]
        case Binary(operator, left, right) if left.type.value != 'bool' and _has_windows(node):
            return [*_number(left), f' {operator.value} ', *_number(right)]
        case Binary(operator, left, right) if (
                operator in _CONNECTIVES and not is_proposition(node)):
            before, between, behind = _CONNECTIVES[operator]
            return [before, _Within(left), between, _Within(right), behind]
        case Choice() if node.yes.type is node.type and node.type.value == 'bool':
            return ['if ', _Within(node.condition), ' then ', _Within(node.yes), ' else ',
                    _Within(node.no)]
        case Yesterday() | WeakYesterday() | Once() | Historically() | Since() | Triggered():
            return _timed(node) if is_timed else _temporal(node)
        case Over() | Ago() | Held() | Slope() | MessageSlope() | TimeOver():
            return _over_time(node, is_timed)
        case NotRefuted():
            return ['not refuted is that ', _Within(node.argument)]
        case Constant() | Variable() | Conversion() | Unary() | Binary() | Choice() | Previous() \
                | Feedback() | Trial():
            return [to_smv(node, _TERM_WIDTH, values, names, is_timed)]
        case _:
            assert_never(node)


def _has_windows(node: Formula) -> bool:
    return any(isinstance(item, NUMBERS_OVER_TIME) for item in postorder([node]))


def _number(node: Formula) -> list[_Piece]:
    """Return a number, in parentheses if it takes several words."""
    return ['(', node, ')'] if _has_windows(node) else [node]


def _over_time(node: Over | Ago | Held | Slope | MessageSlope | TimeOver,
               is_timed: bool) -> list[_Piece]:
    match node:
        case Over(aggregate, past, argument):
            when = (_at if is_timed else _when)(Window(0, past))
            if aggregate is Aggregate.COUNT:
                return [f'at how many {"messages" if is_timed else "steps"} {when} ',
                        _Within(argument)]
            each = ' over the messages ' \
                if is_timed and aggregate in (Aggregate.SUM, Aggregate.MEAN) else ' '
            return [f'the {_AGGREGATES[aggregate]} ', argument, each, when]
        case Ago(past, argument):
            return [argument, f' {time_text(past) if is_timed else _steps(past)} ago']
        case Held(condition, argument):
            return [argument, ' when last ', _Within(condition)]
        case Slope() | MessageSlope():
            return ['the change of ', node.argument, ' a second between the last two messages']
        case TimeOver(past, least, argument):
            count = time_text if is_timed else _steps
            shown = min(f'{count(least)} or more', f'more than {count(least - 1)}', key=len)
            return [_Within(argument), f' for {shown} of the last {count(past)}']


def _temporal(node: _Temporal) -> list[_Piece]:
    match node:
        case Yesterday(argument):
            return ['a step ago ', _Within(argument)]
        case WeakYesterday(argument):
            if node is FTP:
                return ['this is the first step']
            return ['this is the first step or a step ago ', _Within(argument)]
        case Once(window, argument):
            return [f'at some step {_when(window)} ', _Within(argument)]
        case Historically(window, argument):
            return [f'at every step {_when(window)} ', _Within(argument)]
        case Since(window, left, right):
            return [_Within(left), ' at every step since ', _Within(right), ' held',
                    '' if window.is_unbounded else f' at a step {_when(window)}']
        case Triggered(window, left, right):
            return ['at every step ', _when(window), ' ', _Within(right),
                    ', but for steps with a later one at which ', _Within(left)]
        case _:
            assert_never(node)


def _timed(node: _Temporal) -> list[_Piece]:
    match node:
        case Yesterday(argument):
            return ['just before ', _Within(argument)]
        case WeakYesterday(argument):
            if node is FTP:
                return ['this is the first instant']
            return ['this is the first instant or just before ', _Within(argument)]
        case Once(window, argument):
            return [f'at some time {_at(window)} ', _Within(argument)]
        case Historically(window, argument):
            return [f'at all times {_at(window)} ', _Within(argument)]
        case Since(window, left, right):
            return [_Within(left), ' all the time since ', _Within(right), ' held',
                    '' if window.is_unbounded else f' at a time {_at(window)}']
        case Triggered(window, left, right):
            return ['at all times ', _at(window), ' ', _Within(right),
                    ', but for times with a later one at which ', _Within(left)]
        case _:
            assert_never(node)


def _at(window: Window) -> str:
    """Return a window of nanoseconds in words."""
    if window.is_unbounded:
        return 'so far'
    if window.is_empty:
        return 'of none'
    low, high = window.low, window.high
    if high is None:
        after = len(time_text(low - 1)) < len(time_text(low))
        return f'more than {time_text(low - 1)} ago' if after \
            else f'{time_text(low)} ago or earlier'
    if low == high:
        return f'exactly {time_text(low)} ago' if low else 'now'
    before = len(time_text(high + 1)) < len(time_text(high))
    if low == 0:
        return f'less than {time_text(high + 1)} ago' if before \
            else f'in the last {time_text(high)}'
    return f'{time_text(low)} to {time_text(high)} ago'


def _when(window: Window) -> str:
    if window.is_unbounded:
        return 'so far'
    if window.is_empty:
        return 'of none'
    if window.high is None:
        return f'{_steps(window.low)} ago or earlier'
    if window.low == window.high:
        return f'{_steps(window.low)} ago' if window.low else 'now'
    if window.low == 0:
        return f'of the last {_steps(window.high)} and now'
    return f'{window.low:,} to {_steps(window.high)} ago'


def _steps(count: int) -> str:
    return f'{count:,} step{"" if count == 1 else "s"}'
