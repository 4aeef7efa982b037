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

"""Boundary values: numbers equal to, below and above those that an input is compared with."""

from collections.abc import Iterable, Sequence
from itertools import pairwise
import math

from fret_monitor.logic.formula import Constant, Formula
from fret_monitor.logic.specification import Signal
from fret_monitor.model.floats import to_float32
from fret_monitor.model.values import ValueType
from fret_monitor.program.monitor_program import Literal, MonitorProgram
from fret_monitor.traces.trace import Value

_MAX_NUMBERS = 8


def constants(nodes: Iterable[Formula]) -> set[int | float]:
    """Return the values of the finite number constants among some nodes."""
    return {node.value for node in nodes if isinstance(node, Constant)
            and not isinstance(node.value, bool) and math.isfinite(node.value)}


def both_sides(program: MonitorProgram) -> list[list[Value]]:
    """Return, for each input, values that differ from all constants in its requirements."""
    met: list[set[float]] = [set() for _ in program.signals]
    for group in program.groups:
        numbers = {float(equation.operation.value) for equation in group.equations
                   if isinstance(equation.operation, Literal)}
        for signal in group.signals:
            met[signal] |= numbers
    return [discrete_values(signal) or _beside_each(signal.type, sorted(numbers)[:_MAX_NUMBERS])
            for signal, numbers in zip(program.signals, met, strict=True)]


def discrete_values(signal: Signal) -> list[Value]:
    """Return all values of a Boolean or string input; an empty list for a number."""
    if signal.type is ValueType.BOOL:
        return [False, True]
    return list(range(len(signal.values))) if signal.is_string else []


def _beside_each(kind: ValueType, numbers: Sequence[float]) -> list[Value]:
    beside = [number + step for number in numbers for step in (-1.0, 1.0)] or [0.0, 1.0]
    return [_rounded(kind, value) if kind.is_float else _clamped(kind, math.floor(value))
            for value in beside]


def boundary_values(kind: ValueType,
                    numbers: Sequence[int | float]) -> tuple[list[Value], bool]:
    """
    Return values outside of, between and equal to some numbers, in that order, then NaN (floats).

    `numbers` are in ascending order. The second result is whether the values cover all possible
    outcomes of comparisons with them.
    """
    if kind is ValueType.BOOL:
        return [False, True], True
    if kind.is_integer:
        return _integers(kind, numbers), True
    if not numbers:
        return [0.0, math.nan], True
    apart = [_beside(kind, numbers[0], -1.0), _beside(kind, numbers[-1], 1.0)]
    between = [(low + high) / 2 for low, high in pairwise(numbers)]
    values = [_rounded(kind, float(value)) for value in (*apart, *between, *numbers)]
    equal = values[len(apart) + len(between):]
    is_all = len({*values}) == len(values) and equal == list(numbers)
    return [*dict.fromkeys(values), math.nan], is_all


def _integers(kind: ValueType, numbers: Sequence[int | float]) -> list[Value]:
    apart = [step + number for number in numbers for step in (-1, 1)]
    values = [_clamped(kind, place) for number in (*apart, *numbers)
              for place in (math.floor(number), math.ceil(number))]
    return list(dict.fromkeys(values)) or [0]


def _beside(kind: ValueType, number: int | float, step: float) -> float:
    """Return number + step, or number + step * |number| if the former rounds to `number`."""
    beside = _rounded(kind, number + step)
    return beside if beside != _rounded(kind, float(number)) else number + step * abs(number)


def _clamped(kind: ValueType, value: int) -> int:
    low, high = kind.limits
    return min(max(value, low), high)


def _rounded(kind: ValueType, value: float) -> float:
    """Return the nearest finite value of a float type."""
    if kind is not ValueType.FLOAT32:
        return value
    rounded = to_float32(value)
    return rounded if math.isfinite(rounded) else math.copysign(3e38, value)
