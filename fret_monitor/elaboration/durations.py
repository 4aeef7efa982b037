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
What counts and times mean: numbers of steps, or of nanoseconds under the policy timed.

All arithmetic is exact.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from fractions import Fraction
from math import ceil
from typing import Final

from fret_monitor.language.expression import Duration, Unit
from fret_monitor.logic.numbers import ExactNumber, NumberError, parse_number
from fret_monitor.model.diagnostics import refuse, Span
from fret_monitor.model.policies import Policy
from fret_monitor.model.times import LONGEST_NS, time_text

MAX_BOUND = 2 ** 31 - 1

SECONDS = {
    Unit.NANOSECOND: Fraction(1, 1_000_000_000), Unit.MICROSECOND: Fraction(1, 1_000_000),
    Unit.MILLISECOND: Fraction(1, 1000), Unit.SECOND: Fraction(1), Unit.MINUTE: Fraction(60),
    Unit.HOUR: Fraction(3600),
}
"""How long the units of time are; a tick is a step, however long that is."""

UNIT_LINE = 'evaluation: {policy: timed, unit: 1}   # seconds'
"""What gives plain counts a length under the policy timed."""

_TRIED = 1000
_MAX_DIGITS = 9
_ONE: Final = 1_000_000_000  # 10 ** _MAX_DIGITS


@dataclass(frozen=True)
class TimeScale:
    """
    What the counts and times of a bundle mean; without a bundle, all of them count steps.

    `period` is the length of a step and `unit` that of a plain count, in seconds. A bundle with
    the policy periodic has no period only if that was reported.
    """

    policy: Policy = Policy.EVERY_MESSAGE
    period: Fraction | None = None
    unit: Fraction | None = None

    @property
    def is_timed(self) -> bool:
        """Whether numbers are nanoseconds."""
        return self.policy is Policy.TIMED

    @property
    def longest(self) -> int:
        """The largest number in a bound."""
        return LONGEST_NS if self.is_timed else MAX_BOUND

    def shown(self, number: int) -> str:
        """Return a number of steps or nanoseconds for a message."""
        if self.is_timed:
            return time_text(number)
        return str(number) if number < 10 ** 20 else 'more than 10^20'

    def check_longest(self, number: int, place: Span, margin: int = 0) -> None:
        """Refuse a number above the largest one in a bound, less a margin."""
        what = 'a duration' if margin else 'a bound'
        if number > self.longest - margin:
            longest = '2^62 ns (146 years)' if self.is_timed else f'{self.longest - margin} steps'
            label = 'this is longer' if margin else f'this is {self.shown(number)}'
            refuse(f'{what} is at most {longest}', place, label)

    def count(self, number: int, place: Span) -> int:
        """
        Return what a plain count means; negative numbers are returned as they are.

        Raises
        ------
        CompileError
            under the policy timed, if a count has no unit, or is no whole number of nanoseconds.
        """
        if not self.is_timed or number <= 0:
            return number
        if self.unit is None:
            refuse('a count needs a unit of time', place, 'the policy is timed',
                   f'write a time, such as {_shortened(number)} s; or give counts a unit:\n'
                   f'{UNIT_LINE}')
        return self._nanoseconds(number * self.unit, place)

    def time(self, duration: Duration) -> int:
        """
        Return what a time in a bound means, or as an argument of a function.

        Raises
        ------
        CompileError
            if it is no whole number of steps or nanoseconds, or a step has no length.
        """
        if duration.unit is Unit.TICK:
            if self.is_timed:
                self._refuse_ticks(duration)
            refuse('a bound must be a number of steps', duration.span, 'this has a unit',
                   f'write {duration.number}')
        seconds = _number(duration).value * SECONDS[duration.unit]
        if self.is_timed:
            return self._nanoseconds(seconds, duration.span)
        if self.policy is not Policy.PERIODIC:
            refuse('a bound must be a number of steps', duration.span, 'this has a unit',
                   f'write the number of steps: with policy: {self.policy.value} '
                   'a step has no fixed length; or write policy: timed')
        if self.period is None:
            return 1  # reported already; any number of steps will do
        if (seconds / self.period).denominator != 1:
            _refuse_period(duration, seconds, self.period)
        return int(seconds / self.period)

    def timing(self, duration: Duration) -> int:
        """
        Return what the duration of a sentence means; 1 less than the largest bound at most.

        Except under periodic and timed, the unit is ignored, as in FRET.

        Raises
        ------
        CompileError
            if it is no whole number of steps or nanoseconds, or too long.
        """
        number = _number(duration).value
        has_unit = duration.unit in SECONDS
        if self.is_timed:
            if not has_unit:
                self._refuse_ticks(duration)
            steps = Fraction(self._nanoseconds(number * SECONDS[duration.unit], duration.span, 1))
        elif has_unit and self.policy is Policy.PERIODIC:
            if self.period is None:
                return 1  # reported already; any number of steps will do
            steps = number * SECONDS[duration.unit] / self.period
        else:
            steps = number
        self.check_longest(int(steps), duration.span, 1)
        if steps.denominator == 1:
            return int(steps)
        if has_unit and self.period is not None:
            _refuse_period(duration, number * SECONDS[duration.unit], self.period)
        refuse('a duration must be a whole number of steps', duration.span,
               f'{duration.number} is not a whole number of steps',
               'write a whole number; under policy: periodic a time becomes steps of the period'
               if has_unit else 'write a whole number')

    def _nanoseconds(self, seconds: Fraction, place: Span, margin: int = 0) -> int:
        nanoseconds = seconds * 10 ** 9
        self.check_longest(int(nanoseconds), place, margin)
        if nanoseconds.denominator != 1:
            refuse('a time must be a whole number of nanoseconds', place,
                   f'this is {approximate(nanoseconds)} ns', f'write {ceil(nanoseconds)} ns')
        return int(nanoseconds)

    def _refuse_ticks(self, duration: Duration) -> None:
        seconds = _number(duration).value * (self.unit or 1)
        written = f'{approximate(seconds)} second{"" if seconds == 1 else "s"}'
        refuse("a time is needed instead of 'ticks'", duration.span,
               'the policy is timed: a tick is a nanosecond',
               f'write a time, such as {written}' if self.unit is None else f'write {written}')


STEPS = TimeScale()
"""The scale without a bundle: all counts and times are steps."""


def _shortened(number: int) -> str:
    return str(number) if number < 10 ** 9 else '10'


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
