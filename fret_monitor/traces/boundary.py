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

"""Values that make a program's comparisons come out both ways; for benchmarks."""

from typing import TypeAlias

from fret_monitor.logic.specification import Signal
from fret_monitor.model.values import ValueType
from fret_monitor.program.monitor_program import Literal, MonitorProgram, StepGroup

Value: TypeAlias = bool | int | float


def boundary_values(program: MonitorProgram) -> list[list[Value]]:
    """Return for each input some values around the numbers its requirements mention."""
    met: list[set[float]] = [set() for _ in program.signals]
    for group in program.groups:
        numbers = _numbers(group)
        for signal in group.signals:
            met[signal] |= numbers
    return [_around(signal, sorted(numbers)) for signal, numbers in zip(program.signals, met)]


def _numbers(group: StepGroup) -> set[float]:
    return {float(equation.operation.value) for equation in group.equations
            if isinstance(equation.operation, Literal)}


def _around(signal: Signal, numbers: list[float]) -> list[Value]:
    if signal.type is ValueType.BOOL:
        return [False, True]
    if any(isinstance(value, str) for _, value in signal.values):
        return list(range(len(signal.values)))
    near = [number + step for number in numbers[:8] for step in (-1.0, 1.0)] or [0.0, 1.0]
    if signal.type.is_float:
        return list(near)
    bits = int(signal.type.value.lstrip('uint'))
    low, high = (0, 2 ** bits - 1) if signal.type.value.startswith('u') \
        else (-2 ** (bits - 1), 2 ** (bits - 1) - 1)
    return [int(min(max(number, low), high)) if abs(number) < 2.0 ** 53 else low
            for number in near]
