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
The values of a trace as a page has them.

A value over the steps of a trace is a list of `[first step, value]`, one for each change.
"""

from array import array
from bisect import bisect_left
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise, repeat
from typing import Any, TypeAlias

from fret_monitor.logic.specification import Signal
from fret_monitor.model.policies import InputSource
from fret_monitor.model.values import ValueType

Changes: TypeAlias = Sequence[tuple[int, bool | int | float | str]]


class Refused(Exception):
    """A question cannot be answered; the text says why."""


def shown(value: bool | int | float, signal: Signal) -> bool | int | float | str:
    """Return a value as the page has it: a name where the input has names."""
    for index, (name, number) in enumerate(signal.values):
        if value == (index if isinstance(number, str) else number):
            return name
    return str(value) if isinstance(value, float) and value - value != 0 else value


def column(signal: Signal, changes: Changes, steps: int) -> Iterator[bool | int | float]:
    """Yield the value of an input at each step."""
    for value, count in _stretches(signal, changes, steps):
        yield from repeat(value, count)


def packed(signal: Signal, changes: Changes, steps: int, rows: Sequence[int]) -> 'array[Any]':
    """Return the values of an input at some of the steps, as `Evaluator.rows` takes them."""
    found: array[Any] = array(signal.type.typecode)
    place = step = 0
    for value, count in _stretches(signal, changes, steps):
        step += count
        before, place = place, bisect_left(rows, step)
        try:
            found.extend(array(signal.type.typecode, [value]) * (place - before))
        except OverflowError:
            raise Refused(f'{signal.name} is of type {signal.type.value}: {value} is no value '
                          'of it') from None
    return found


def _stretches(signal: Signal, changes: Changes,
               steps: int) -> Iterator[tuple[bool | int | float, int]]:
    """Yield the values of an input, each with the number of steps for which it holds."""
    if signal.source is InputSource.TIME:  # of a message, which is not drawn: one a second
        yield from ((step * 10**9, 1) for step in range(steps))
        return
    found = [(int(first), _value(signal, value)) for first, value in changes if first < steps]
    if not found or found[0][0] != 0:
        found.insert(0, (0, start(signal)))
    for (first, value), (after, _) in pairwise([*found, (steps, 0)]):
        yield value, after - first


def start(signal: Signal) -> bool | int | float:
    """Return the value that an input has until another one is drawn."""
    if signal.source is InputSource.RECEIVED:
        return True  # a step is a message
    if signal.initial is not None:
        return signal.initial
    return False if signal.type is ValueType.BOOL else \
        0.0 if signal.type.is_float else 0


def _value(signal: Signal, value: bool | int | float | str) -> bool | int | float:
    """Return a value of the page as one of the input's type."""
    for index, (name, number) in enumerate(signal.values):
        if value == name:
            return index if isinstance(number, str) else number
    try:
        if signal.type is ValueType.BOOL:
            return bool(value)
        if signal.type.is_float:
            return float(value)
        return int(value)
    except ValueError:
        raise Refused(f"{signal.name} is of type {signal.type.value}: '{value}' is no value "
                      'of it') from None


def nanoseconds(period: object) -> int:
    """Return the time between two rows, which the page has in seconds."""
    found = round(float(str(period or 0)) * 1e9)
    if not 1 <= found <= 10 ** 15:
        raise Refused('the time between two rows is between a nanosecond and eleven days')
    return found


def seconds(time: int) -> str:
    """Return a time (ns) as a trace has it."""
    return f'{time // 10**9}.{time % 10**9:09}'


def runs(values: Iterable[Any]) -> list[tuple[int, Any]]:
    """Return the changes of a value: at which step it becomes what."""
    found: list[tuple[int, Any]] = []
    for step, value in enumerate(values):
        if not found or found[-1][1] != value or type(found[-1][1]) is not type(value):
            found.append((step, value))
    return found
