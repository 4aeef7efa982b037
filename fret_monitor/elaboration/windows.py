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

from fret_monitor.language.bounds import work_out
from fret_monitor.language.expression import Bound, Expression, Name
from fret_monitor.logic.formula import ALWAYS, Window
from fret_monitor.logic.numbers import ExactNumber, NumberError, parse_number
from fret_monitor.model.diagnostics import refuse

MAX_BOUND = 2 ** 31 - 1

# FRET writes this empty window for 'within 0'.
_FRETS_EMPTY = Window(0, -1)


def window(bound: Bound | None, constant: Callable[[Name], int]) -> Window:
    """
    Return the window of a bound; without a bound, the whole past.

    `constant` returns the number of a name in the bound; its exceptions are passed on.

    Raises
    ------
    CompileError
        if an end is not a whole number, is negative (except in FRET's `[0,-1]`), is above
        2^31 - 1, or if the upper end is below the lower end.
    """
    if bound is None:
        return ALWAYS
    low = _steps(bound, bound.low, constant)
    if bound.relation == '[]':
        return _closed(bound, low, _steps(bound, bound.high or '', constant))
    result = {
        '<=': Window(0, low),
        '<': Window(0, low - 1),
        '=': Window(low, low),
        '>=': Window(low, None),
        '>': Window(low + 1, None),
    }[bound.relation]
    _check_range(bound, low)
    _check_range(bound, result.low)
    return result


def _closed(bound: Bound, low: int, high: int) -> Window:
    result = Window(low, high)
    if result == _FRETS_EMPTY:
        return result
    _check_range(bound, low)
    _check_range(bound, high)
    if result.is_empty:
        refuse('this bound ends before it begins', bound.span, f'{high} is less than {low}',
               f'write [{high},{low}]')
    return result


def _check_range(bound: Bound, steps: int) -> None:
    if steps < 0:
        refuse('a bound cannot be negative', bound.span, 'counts steps into the past')
    if steps > MAX_BOUND:
        refuse(f'a bound is at most {MAX_BOUND} steps', bound.span, f'this is {_short(steps)}')


def _short(steps: int) -> str:
    return str(steps) if steps < 10 ** 20 else 'more than 10^20'


def _steps(bound: Bound, end: str | Expression, constant: Callable[[Name], int]) -> int:
    if not isinstance(end, str):
        return work_out(end, constant)
    literal = _literal(bound, end)
    if literal.is_real or literal.value.denominator != 1:
        whole = literal.value.denominator == 1
        refuse('a bound must be a whole number of steps', bound.span,
               f'{end} has a fraction' if not whole else f'{end} is written as a real number',
               f'write {literal.value}' if whole and literal.value <= MAX_BOUND else '')
    return literal.value.numerator


def _literal(bound: Bound, text: str) -> ExactNumber:
    try:
        return parse_number(text)
    except NumberError as error:
        refuse('this bound cannot be read', bound.span, str(error))
