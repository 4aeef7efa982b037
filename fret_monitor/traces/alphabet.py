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
Which values of its inputs a requirement can tell apart, and a row for each way they can be.

Of an input that is compared with constants only, values on both sides of each, and equal to it,
are all there is to tell. Such rows, one for each way the propositions can come out, stand for all
values (`is_exact`); where numbers are added up or compared with one another they are a sample.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import islice, pairwise, product
import math
from random import Random

from fret_monitor.logic.evaluate import evaluate_all
from fret_monitor.logic.formula import (
    Binary, Constant, Conversion, Formula, postorder, Variable, variables,
)
from fret_monitor.logic.propositions import is_pointwise
from fret_monitor.logic.specification import Signal
from fret_monitor.model.floats import to_float32
from fret_monitor.model.values import ValueType
from fret_monitor.traces.subject import Subject
from fret_monitor.traces.trials import Row, Value

_MAX_CONSTANTS = 8
_MAX_ROWS = 2048
_MAX_LETTERS = 64
_EXACT_INTEGERS = 2 ** 53
_SAMPLES = 256


@dataclass(frozen=True)
class Alphabet:
    """
    What is tried: for each input some values, the simplest first, and rows of them.

    `rows` differ in what their propositions are; where `is_exact`, there is one for each way they
    can be. None of `plain` holds a NaN.
    """

    levels: tuple[tuple[Value, ...], ...]
    rows: tuple[Row, ...]
    is_exact: bool

    @property
    def plain(self) -> tuple[Row, ...]:
        """The rows without a NaN."""
        return tuple(row for row in self.rows if not _nans(row))


def alphabet(subject: Subject, rng: Random) -> Alphabet:
    """Return the values and rows that tell apart what a requirement tells apart."""
    levels, is_exact = [], True
    for signal in subject.signals:
        found, is_all = _levels(signal, subject.propositions)
        levels.append(tuple(found))
        is_exact = is_exact and is_all
    rows, is_whole = _rows(levels, rng)
    if not all(is_pointwise(node) for node in subject.propositions):
        return Alphabet(tuple(levels), tuple(rows[:_MAX_LETTERS]), False)
    different = _different(subject, rows)
    is_exact = is_exact and is_whole or len(different) == 2 ** len(subject.propositions)
    letters = different[:_MAX_LETTERS]
    return Alphabet(tuple(levels), tuple(letters), is_exact and len(letters) == len(different))


def _rows(levels: Sequence[Sequence[Value]], rng: Random) -> tuple[list[Row], bool]:
    """Return the rows of some levels, the plainest first, and whether these are all."""
    count = math.prod(len(values) for values in levels)
    if count <= _MAX_ROWS:
        ranked = sorted(product(*(enumerate(values) for values in levels)),
                        key=lambda row: (_nans(value for _, value in row),
                                         sum(rank for rank, _ in row)))
        return [tuple(value for _, value in row) for row in ranked], True
    sample = {tuple(rng.choice(values) for values in levels): None for _ in range(_SAMPLES)}
    first = tuple(values[0] for values in levels)
    return sorted({first: None, **sample}, key=_nans), False


def _nans(row: Iterable[Value]) -> int:
    return sum(value != value for value in row)


def _different(subject: Subject, rows: Sequence[Row]) -> list[Row]:
    """Return the first row of each way the propositions can be."""
    trace = {signal.name: column
             for signal, column in zip(subject.signals, zip(*rows, strict=True), strict=True)}
    if not trace:
        return [()]
    columns = evaluate_all(subject.propositions, trace)
    found: dict[tuple[Value, ...], Row] = {}
    for valuation, row in zip(zip(*columns, strict=True), rows, strict=True):
        found.setdefault(valuation, row)
    return list(found.values())


def _levels(signal: Signal, propositions: Sequence[Formula]) -> tuple[list[Value], bool]:
    """Return the values of an input that matter, and whether they stand for all."""
    if signal.type is ValueType.BOOL:
        return [False, True], True
    if any(isinstance(value, str) for _, value in signal.values):
        return list(range(len(signal.values))), True
    constants: set[int | float] = set()
    is_exact = True
    for node in propositions:
        if any(variable.name == signal.name for variable in variables(node)):
            constants |= _constants(node)
            is_exact = is_exact and _is_threshold(node)
    near = sorted(constants) if is_exact else sorted({*constants, 0, 1})
    named = [value for _, value in signal.values if isinstance(value, int)]
    levels, is_all = _around(signal.type, near[:_MAX_CONSTANTS])
    levels = list(dict.fromkeys([*named[:_MAX_CONSTANTS], *levels]))
    return levels, is_exact and is_all and len(near) <= _MAX_CONSTANTS


def _constants(node: Formula) -> set[int | float]:
    return {part.value for part in islice(postorder([node]), 1000)
            if isinstance(part, Constant) and not isinstance(part.value, bool)
            and math.isfinite(part.value)}


def _is_threshold(node: Formula) -> bool:
    """Whether a comparison is between an input and a constant, with no rounding on the way."""
    if not isinstance(node, Binary):
        return False
    sides = (_unconverted(node.left), _unconverted(node.right))
    values = [side.value for side in sides if isinstance(side, Constant)]
    return (sum(isinstance(side, Variable) for side in sides) == 1 and len(values) == 1
            and math.isfinite(values[0]) and abs(values[0]) < _EXACT_INTEGERS)


def _unconverted(node: Formula) -> Formula:
    """Return what is converted, if the conversion keeps the order of all values."""
    while isinstance(node, Conversion) and {node.type, node.argument.type} != {
            ValueType.INT64, ValueType.UINT64}:
        node = node.argument
    return node


def _around(kind: ValueType, numbers: Sequence[int | float]) -> tuple[list[Value], bool]:
    """Return values apart from, between and equal to some numbers, in that order; and if all."""
    if kind.is_integer:
        return _integers(kind, numbers), True
    if not numbers:
        return [0.0, math.nan], True
    apart = [_beside(kind, numbers[0], -1.0), _beside(kind, numbers[-1], 1.0)]
    between = [(low + high) / 2 for low, high in pairwise(numbers)]
    values = [_fitted(kind, float(value)) for value in (*apart, *between, *numbers)]
    is_all = len({*values}) == len(values) and all(
        value == number for value, number in zip(values[len(apart) + len(between):], numbers,
                                                 strict=True))
    return [*dict.fromkeys(values), math.nan], is_all


def _beside(kind: ValueType, number: int | float, step: float) -> float:
    """Return a value one off, or twice as far where one makes no difference."""
    beside = _fitted(kind, number + step)
    return beside if beside != _fitted(kind, float(number)) else number + step * abs(number)


def _fitted(kind: ValueType, value: float) -> float:
    if kind is not ValueType.FLOAT32:
        return value
    rounded = to_float32(value)
    return rounded if math.isfinite(rounded) else math.copysign(3e38, value)


def _integers(kind: ValueType, numbers: Sequence[int | float]) -> list[Value]:
    bits = int(kind.value.lstrip('uint'))
    is_signed = kind.value.startswith('i')
    low = -2 ** (bits - 1) if is_signed else 0
    high = 2 ** (bits - is_signed) - 1
    apart = [step + number for number in numbers for step in (-1, 1)]
    values = [place for number in (*apart, *numbers)
              for place in (math.floor(number), math.ceil(number))]
    return list(dict.fromkeys(min(max(value, low), high) for value in values)) or [max(0, low)]
