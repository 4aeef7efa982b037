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
"""Convert bounds (`[0,10]`, `[<n]`) to windows of distances into the past."""

from collections.abc import Callable

from fret_monitor.elaboration.durations import TimeScale
from fret_monitor.language.bounds import work_out
from fret_monitor.language.expression import Bound, Duration, Expression, Name
from fret_monitor.logic.formula import ALWAYS, Window
from fret_monitor.logic.numbers import ExactNumber, NumberError, parse_number
from fret_monitor.model.diagnostics import refuse

# FRET writes this empty window for 'within 0'.
_FRETS_EMPTY = Window(0, -1)


def window(bound: Bound | None, constant: Callable[[Name], int], scale: TimeScale, *,
           is_ahead: bool = False) -> Window:
    """
    Return the window of a bound; without a bound, the whole past.

    `constant` returns the number of a name in the bound; its exceptions are passed on. `scale`
    says what counts and times mean. It `is_ahead` for operators of the future.

    Raises
    ------
    CompileError
        if an end is not a whole number, is negative (except in FRET's `[0,-1]`), is too large, or
        if the upper end is below the lower end.
    """
    if bound is None:
        return ALWAYS
    low = _end(bound, bound.low, constant, scale)
    if bound.relation == '[]':
        return _closed(bound, low, _end(bound, bound.high or '', constant, scale), scale,
                       is_ahead)
    result = {
        '<=': Window(0, low),
        '<': Window(0, low - 1),
        '=': Window(low, low),
        '>=': Window(low, None),
        '>': Window(low + 1, None),
    }[bound.relation]
    _check_range(bound, low, scale, is_ahead)
    _check_range(bound, result.low, scale, is_ahead)
    return result


def _closed(bound: Bound, low: int, high: int, scale: TimeScale, is_ahead: bool) -> Window:
    result = Window(low, high)
    if result == _FRETS_EMPTY:
        return result
    _check_range(bound, low, scale, is_ahead)
    _check_range(bound, high, scale, is_ahead)
    if result.is_empty:
        low_text, high_text = scale.shown(low), scale.shown(high)
        comma = ', ' if scale.is_timed else ','
        refuse('this bound ends before it begins', bound.span,
               f'{high_text} is less than {low_text}', f'write [{high_text}{comma}{low_text}]')
    return result


def _check_range(bound: Bound, number: int, scale: TimeScale, is_ahead: bool) -> None:
    if number < 0:
        refuse('a bound cannot be negative', bound.span,
               f'counts {"" if scale.is_timed else "steps "}into the '
               f'{"future" if is_ahead else "past"}')
    scale.check_longest(number, bound.span)


def _end(bound: Bound, end: str | Expression, constant: Callable[[Name], int],
         scale: TimeScale) -> int:
    if isinstance(end, Duration):
        return scale.time(end)
    if not isinstance(end, str):
        return scale.count(work_out(end, constant), bound.span)
    literal = _literal(bound, end)
    if literal.is_real or literal.value.denominator != 1:
        whole = literal.value.denominator == 1
        is_short = whole and literal.value <= scale.longest
        refuse('a bound must be a whole number of ' + ('units' if scale.is_timed else 'steps'),
               bound.span,
               f'{end} has a fraction' if not whole else f'{end} is written as a real number',
               f'write {literal.value}' if is_short else
               'a time may have one: write its unit, as in 2.5 s' if scale.is_timed else '')
    return scale.count(literal.value.numerator, bound.span)


def _literal(bound: Bound, text: str) -> ExactNumber:
    try:
        return parse_number(text)
    except NumberError as error:
        refuse('this bound cannot be read', bound.span, str(error))
