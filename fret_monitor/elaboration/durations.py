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


"""Convert durations of FRETish sentences to numbers of steps, in exact arithmetic."""

from collections.abc import Callable, Iterator
from fractions import Fraction
from typing import Final

from fret_monitor.elaboration.windows import MAX_BOUND
from fret_monitor.language.sentence import Duration, Unit
from fret_monitor.logic.numbers import ExactNumber, NumberError, parse_number
from fret_monitor.model.diagnostics import refuse
from fret_monitor.model.policies import Policy

SECONDS = {
    Unit.MICROSECOND: Fraction(1, 1_000_000), Unit.MILLISECOND: Fraction(1, 1000),
    Unit.SECOND: Fraction(1), Unit.MINUTE: Fraction(60), Unit.HOUR: Fraction(3600),
}
"""How long the units of time are; a tick is a step, however long that is."""

_TRIED = 1000
_MAX_DIGITS = 9
_ONE: Final = 1_000_000_000  # 10 ** _MAX_DIGITS


def steps_of(duration: Duration, period: Fraction | None) -> int:
    """
    Return the number of steps of a duration, at most 2^31 - 2.

    `period` is the length of a step in seconds. Without one (None), the unit is ignored, as in
    FRET.

    Raises
    ------
    CompileError
        if the duration is not a whole number of steps, or is longer than the maximum.
    """
    number = _number(duration).value
    is_timed = period is not None and duration.unit in SECONDS
    steps = number * SECONDS[duration.unit] / period if is_timed and period else number
    if steps > MAX_BOUND - 1:
        refuse(f'a duration is at most {MAX_BOUND - 1} steps', duration.span, 'this is longer')
    if steps.denominator == 1:
        return int(steps)
    if is_timed and period is not None:
        _refuse_period(duration, number * SECONDS[duration.unit], period)
    refuse('a duration must be a whole number of steps', duration.span,
           f'{duration.number} is not a whole number of steps',
           'write a whole number; under policy: periodic a time becomes steps of the period'
           if duration.unit in SECONDS else 'write a whole number')


def _number(duration: Duration) -> ExactNumber:
    try:
        return parse_number(duration.number)
    except NumberError as error:
        refuse('this duration cannot be used', duration.span, str(error))


def _refuse_period(duration: Duration, seconds: Fraction, period: Fraction) -> None:
    periods, rates = _fitting_key(seconds, period)
    refuse('this duration is not a whole number of steps', duration.span,
           f'{approximate(seconds)} s are {approximate(seconds / period)} periods of '
           f'{approximate(period)} s',
           'it would be with ' + periods + (f' ({rates})' if periods and rates else rates)
           if periods or rates else 'take a period that divides it')


def _fitting_key(seconds: Fraction, period: Fraction) -> tuple[str, str]:
    """
    Return the keys `period` and `rate` of a bundle with values near `period` that divide a time.

    A key that has no decimal value is empty. A non-decimal `period` can only come from `rate`, so
    then only `rate` is returned.
    """
    if not _is_decimal(period):
        rates = [decimal(item) for item in _fitting(seconds, period, lambda item: 1 / item)]
        return '', f"rate: {' or '.join(rates)}" if rates else ''
    near = list(_fitting(seconds, period, lambda item: item))
    rates = [decimal(1 / item) for item in near] if all(_is_decimal(1 / p) for p in near) else []
    return (f"period: {' or '.join(map(decimal, near))}" if near else '',
            f"rate: {' or '.join(rates)}" if rates else '')


def steps_help(number: str, unit: Unit, policy: Policy, period: Fraction | None) -> str:
    """Return the help text for a bound that has a unit of time where only steps are allowed."""
    if period is None:
        return ('write the number of steps' if policy is Policy.PERIODIC else
                f'write the number of steps: with policy: {policy.value} '
                'a step has no fixed length')
    steps = Fraction(number) * SECONDS[unit] / period
    written = f"{number} {unit.value.removesuffix('s') if number == '1' else unit.value}"
    shown = f'{written} = {approximate(steps)} periods of {approximate(period)} s'
    if steps.denominator == 1:
        return f'write {steps}: {shown}'
    return f'{shown}: write {int(steps)} or {int(steps) + 1}'


def _fitting(seconds: Fraction, period: Fraction,
             written: Callable[[Fraction], Fraction]) -> Iterator[Fraction]:
    """Yield the nearest shorter and longer period, as `written`, that divide a time."""
    steps = int(seconds / period)
    for tried in (range(steps + 1, steps + _TRIED), range(steps, max(0, steps - _TRIED), -1)):
        found = next((item for n in tried if _is_decimal(item := written(seconds / n))), None)
        if found is not None:
            yield found


def _is_decimal(number: Fraction) -> bool:
    return (number * _ONE).denominator == 1


def decimal(number: Fraction) -> str:
    """Return all digits of a number that has at most nine decimal places."""
    text = f'{number.numerator * _ONE // number.denominator:0{_MAX_DIGITS + 1}d}'
    return f'{text[:-_MAX_DIGITS]}.{text[-_MAX_DIGITS:]}'.rstrip('0').rstrip('.')


def approximate(number: Fraction) -> str:
    """Return a number exactly if it has at most nine decimal places, else with six digits."""
    return decimal(number) if _is_decimal(number) else f'about {float(number):.6g}'
