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
The meaning of FRETish without formulas: intervals, trigger points, behaviour.

For a finite trace: the scope gives closed intervals of steps; the condition gives the steps of an
interval at which the timing starts; the timing says of each what the response must do from there
up to the end of the interval. What a timing asks beyond the end of an interval is not asked. The
`only` scopes take the steps outside, and ask there that the timing is not met. Nothing here is
read off a formula, so that formulas can be tested against it.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import product

SCOPES = ('null', 'in', 'notin', 'onlyIn', 'before', 'after', 'onlyBefore', 'onlyAfter')
CONDITIONS = ('null', 'regular', 'holding')
TIMINGS = ('null', 'immediately', 'next', 'finally', 'eventually', 'always', 'never', 'until',
           'before', 'within', 'for', 'after')
KEYS = tuple(product(SCOPES, CONDITIONS, TIMINGS))

Column = Sequence[bool]
Interval = tuple[int, int]


@dataclass(frozen=True)
class Setting:
    """A trace of mode, condition, response and stop, and a duration in steps."""

    mode: Column
    condition: Column
    response: Column
    stop: Column
    duration: int

    def until(self, steps: int) -> 'Setting':
        """Return the first steps of it."""
        return Setting(self.mode[:steps], self.condition[:steps], self.response[:steps],
                       self.stop[:steps], self.duration)


def verdicts(setting: Setting,
             keys: Iterable[tuple[str, str, str]]) -> dict[tuple[str, str, str], bool]:
    """Return for each key whether the whole trace satisfies its sentence."""
    starts = {}
    for scope in SCOPES:
        intervals = scope_intervals(scope, setting.mode)
        for condition in CONDITIONS:
            starts[scope, condition] = [
                (start, last) for first, last in intervals
                for start in triggers(condition, setting.condition, first, last)]
    found = {}
    for scope, condition, timing in keys:
        meets = (DENIED if scope.startswith('only') else ASKED)[timing]
        found[scope, condition, timing] = all(
            meets(setting, start, last) for start, last in starts[scope, condition])
    return found


# Scopes

def runs(column: Column, value: bool) -> list[Interval]:
    """Return the longest stretches of steps that have a value."""
    found: list[Interval] = []
    for step, current in enumerate(column):
        if current != value:
            continue
        if found and found[-1][1] == step - 1:
            found[-1] = (found[-1][0], step)
        else:
            found.append((step, step))
    return found


def scope_intervals(scope: str, mode: Column) -> list[Interval]:
    """Return the intervals in which a response is asked for, or, by an only scope, denied."""
    last = len(mode) - 1
    inside = runs(mode, True)
    begin = inside[0][0] if inside else last + 1
    end = inside[0][1] if inside else last
    match scope:
        case 'null':
            found = [(0, last)]
        case 'in':
            found = inside
        case 'notin' | 'onlyIn':
            found = runs(mode, False)
        case 'before':
            found = [(0, begin - 1)]
        case 'onlyBefore':
            found = [(begin, last)]
        case 'after':
            found = [(end + 1, last)]
        case 'onlyAfter':
            found = [(0, end)]
        case _:
            raise AssertionError(scope)
    return [(first, final) for first, final in found if first <= final]


# Conditions

def triggers(kind: str, condition: Column, first: int, last: int) -> Iterator[int]:
    """Yield the steps of an interval at which the timing starts."""
    if kind == 'null':
        yield first
        return
    for step in range(first, last + 1):
        is_new = step == first or not condition[step - 1]
        if condition[step] and (kind == 'holding' or is_new):
            yield step


# Timings: what the response must do from a trigger to the last step of its interval.

def some(column: Column, first: int, last: int) -> bool:
    return any(column[first:last + 1])


def every(column: Column, first: int, last: int) -> bool:
    return all(column[first:last + 1])


def none(column: Column, first: int, last: int) -> bool:
    return not some(column, first, last)


def stop_step(setting: Setting, start: int, last: int) -> int | None:
    return next((step for step in range(start, last + 1) if setting.stop[step]), None)


def immediately(it: Setting, start: int, last: int) -> bool:
    return it.response[start]


def at_next(it: Setting, start: int, last: int) -> bool:
    return start == last or it.response[start + 1]


def finally_(it: Setting, start: int, last: int) -> bool:
    return it.response[last]


def eventually(it: Setting, start: int, last: int) -> bool:
    return some(it.response, start, last)


def always(it: Setting, start: int, last: int) -> bool:
    return every(it.response, start, last)


def never(it: Setting, start: int, last: int) -> bool:
    return none(it.response, start, last)


def until(it: Setting, start: int, last: int) -> bool:
    stop = stop_step(it, start, last)
    return every(it.response, start, last if stop is None else stop - 1)


def before(it: Setting, start: int, last: int) -> bool:
    stop = stop_step(it, start, last)
    return stop is None or some(it.response, start, stop - 1)


def within(it: Setting, start: int, last: int) -> bool:
    due = start + it.duration
    return due > last or some(it.response, start, due)


def for_(it: Setting, start: int, last: int) -> bool:
    return every(it.response, start, min(start + it.duration, last))


def after(it: Setting, start: int, last: int) -> bool:
    end = start + it.duration
    return none(it.response, start, min(end, last)) and (end >= last or it.response[end + 1])


Behaviour = Callable[[Setting, int, int], bool]
ASKED: dict[str, Behaviour] = {
    'null': eventually, 'immediately': immediately, 'next': at_next, 'finally': finally_,
    'eventually': eventually, 'always': always, 'never': never, 'until': until, 'before': before,
    'within': within, 'for': for_, 'after': after,
}


# Outside of an only scope the timing must not be met, where the interval lets one tell.

def not_at_next(it: Setting, start: int, last: int) -> bool:
    return start == last or not it.response[start + 1]


def not_until(it: Setting, start: int, last: int) -> bool:
    stop = stop_step(it, start, last)
    return stop is None or not every(it.response, start, stop - 1)


def not_before(it: Setting, start: int, last: int) -> bool:
    stop = stop_step(it, start, last)
    return none(it.response, start, last if stop is None else stop - 1)


def not_within(it: Setting, start: int, last: int) -> bool:
    return none(it.response, start, min(start + it.duration, last))


def not_for(it: Setting, start: int, last: int) -> bool:
    end = start + it.duration
    return end > last or not every(it.response, start, end)


def not_after(it: Setting, start: int, last: int) -> bool:
    end = start + it.duration
    return end >= last or not (none(it.response, start, end) and it.response[end + 1])


DENIED: dict[str, Behaviour] = {
    'null': never,
    'immediately': lambda it, start, last: not it.response[start],
    'next': not_at_next,
    'finally': lambda it, start, last: not it.response[last],
    'eventually': never,
    'always': lambda it, start, last: not always(it, start, last),
    'never': lambda it, start, last: not never(it, start, last),
    'until': not_until, 'before': not_before, 'within': not_within, 'for': not_for,
    'after': not_after,
}
