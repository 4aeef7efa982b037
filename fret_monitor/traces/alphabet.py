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
The rows of input values to try for a requirement.

If every input is only compared with constants, the boundary values of these constants represent
all values of the input, and one row for each combination of truth values of the propositions
represents all rows (`is_exact`). Otherwise, for example if inputs are added or compared with one
another, the rows are a sample.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import islice, product
import math
from random import Random

from fret_monitor.logic.evaluate import evaluate_all
from fret_monitor.logic.formula import (
    Binary, Constant, Conversion, Formula, postorder, Variable, variables,
)
from fret_monitor.logic.propositions import is_pointwise
from fret_monitor.logic.specification import Signal
from fret_monitor.model.values import ValueType
from fret_monitor.traces.boundary import boundary_values, constants, discrete_values
from fret_monitor.traces.subject import Subject
from fret_monitor.traces.trace import Row, Value

_MAX_CONSTANTS = 8
_MAX_NODES = 1000  # nodes of a proposition that are searched for constants
_MAX_ROWS = 2048
_MAX_LETTERS = 64
_EXACT_INTEGERS = 2 ** 53
_SAMPLES = 256


@dataclass(frozen=True)
class Alphabet:
    """
    Values of each input (`pools`), the simplest first, and rows of such values.

    Each row gives the propositions a different combination of truth values. With `is_exact` the
    rows cover all combinations that are possible.
    """

    pools: tuple[tuple[Value, ...], ...]
    rows: tuple[Row, ...]
    is_exact: bool

    @property
    def plain(self) -> tuple[Row, ...]:
        """The rows without a NaN."""
        return tuple(row for row in self.rows if not _nans(row))


def alphabet(subject: Subject, rng: Random) -> Alphabet:
    """Return the alphabet of a requirement."""
    pools, is_exact = [], True
    for signal in subject.signals:
        found, is_all = values_of(signal, subject.propositions)
        pools.append(tuple(found))
        is_exact = is_exact and is_all
    rows, is_whole = _rows(pools, rng)
    if not all(is_pointwise(node) for node in subject.propositions):
        return Alphabet(tuple(pools), tuple(rows[:_MAX_LETTERS]), False)
    different = _different(subject, rows)
    is_exact = is_exact and is_whole or len(different) == 2 ** len(subject.propositions)
    letters = different[:_MAX_LETTERS]
    return Alphabet(tuple(pools), tuple(letters), is_exact and len(letters) == len(different))


def _rows(pools: Sequence[Sequence[Value]], rng: Random) -> tuple[list[Row], bool]:
    """Return rows of the values, the simplest first, and whether they are all such rows."""
    count = math.prod(len(values) for values in pools)
    if count <= _MAX_ROWS:
        ranked = sorted(product(*(enumerate(values) for values in pools)),
                        key=lambda row: (_nans(value for _, value in row),
                                         sum(rank for rank, _ in row)))
        return [tuple(value for _, value in row) for row in ranked], True
    sample = {tuple(rng.choice(values) for values in pools): None for _ in range(_SAMPLES)}
    first = tuple(values[0] for values in pools)
    return sorted({first: None, **sample}, key=_nans), False


def _nans(row: Iterable[Value]) -> int:
    return sum(value != value for value in row)


def _different(subject: Subject, rows: Sequence[Row]) -> list[Row]:
    """Return the first row for each combination of truth values of the propositions."""
    trace = {signal.name: column
             for signal, column in zip(subject.signals, zip(*rows, strict=True), strict=True)}
    if not trace:
        return [()]
    columns = evaluate_all(subject.propositions, trace)
    found: dict[tuple[Value, ...], Row] = {}
    for valuation, row in zip(zip(*columns, strict=True), rows, strict=True):
        found.setdefault(valuation, row)
    return list(found.values())


def values_of(signal: Signal, propositions: Sequence[Formula]) -> tuple[list[Value], bool]:
    """Return values of an input to try, and whether they represent all its values."""
    if discrete := discrete_values(signal):
        return discrete, True
    numbers: set[int | float] = set()
    is_exact = True
    for node in propositions:
        if any(variable.name == signal.name for variable in variables(node)):
            numbers |= constants(islice(postorder([node]), _MAX_NODES))
            is_exact = is_exact and _is_threshold(node)
    if signal.is_never_negative:
        numbers = {0, *(number for number in numbers if number > 0)}
    near = sorted(numbers) if is_exact else sorted({*numbers, 0, 1})
    named = [value for _, value in signal.values if isinstance(value, int)]
    values, is_all = boundary_values(signal.type, near[:_MAX_CONSTANTS])
    values = [value for value in dict.fromkeys([*named[:_MAX_CONSTANTS], *values])
              if not (signal.is_never_negative and value < 0)]
    return values, is_exact and is_all and len(near) <= _MAX_CONSTANTS


def _is_threshold(node: Formula) -> bool:
    """Whether a comparison is between an input and a constant, without rounding."""
    if not isinstance(node, Binary):
        return False
    sides = (_unconverted(node.left), _unconverted(node.right))
    values = [side.value for side in sides if isinstance(side, Constant)]
    return (sum(isinstance(side, Variable) for side in sides) == 1 and len(values) == 1
            and math.isfinite(values[0]) and abs(values[0]) < _EXACT_INTEGERS)


def _unconverted(node: Formula) -> Formula:
    """Return the operand of a conversion that preserves the order of all values."""
    while isinstance(node, Conversion) and {node.type, node.argument.type} != {
            ValueType.INT64, ValueType.UINT64}:
        node = node.argument
    return node
