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
Compare the wordings of a requirement: their verdicts on random traces, by the reference evaluator.

FRET writes formulas beside each sentence, and users edit one of them. Most traces are short, some
are longer than the longest bound. Values come from the numbers in the formulas and their
neighbours, so that comparisons are true and false, and stay for several steps, so that conditions
hold long enough. Equal verdicts prove nothing; a difference comes with the trace that shows it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
import math
from random import Random

from fret_monitor.importing.draft import Comparison
from fret_monitor.logic.evaluate import evaluate_all, Value
from fret_monitor.logic.formula import (
    Constant, Feedback, Formula, Historically, Once, postorder, Since, Triggered, Variable,
)
from fret_monitor.logic.specification import Property
from fret_monitor.model.values import ValueType

_SHORT_TRACES = 40
_SHORT = 24
_LONG_TRACES = 40
_FEW = 4  # bounds up to this many steps need no long traces
_LONGEST = 400
_MOST_WORK = 4_000_000  # nodes times steps times steps looked back at


@dataclass(frozen=True)
class Difference:
    """
    Two wordings that differ, at the last step of a trace and at none before.

    `trace` has a column for each variable; `first` and `other` are labels of wordings, `verdict`
    is that of the first.
    """

    id: str
    first: str
    other: str
    verdict: bool
    trace: dict[str, list[Value]]

    @property
    def step(self) -> int:
        """The step at which they differ, from 0."""
        return max((len(column) for column in self.trace.values()), default=1) - 1


def differences(comparison: Comparison) -> list[Difference]:
    """Return a difference for each further wording that differs from the first."""
    (label, first), *others = comparison.properties
    found = (_difference(comparison.id, label, first, other, item) for other, item in others
             if item.formula is not first.formula or item.feedback or first.feedback)
    return [item for item in found if item]


def _difference(id: str, label: str, first: Property, name: str,
                other: Property) -> Difference | None:
    roots = [first.formula, other.formula]
    feedback = tuple(dict([*first.feedback, *other.feedback]).items())
    nodes = postorder([*roots, *(equation for _, equation in feedback)])
    found = [{column: values[:step + 1] for column, values in trace.items()}
             for trace in _traces(nodes, Random(id))
             if (step := _first_difference(roots, trace, feedback)) is not None]
    if not found:
        return None
    shortest = min(found, key=lambda trace: len(next(iter(trace.values()))))
    verdict = evaluate_all(roots, shortest, feedback)[0][-1] is True
    return Difference(id, label, name, verdict, shortest)


def _first_difference(roots: Sequence[Formula], trace: dict[str, list[Value]],
                      feedback: Sequence[tuple[Feedback, Formula]]) -> int | None:
    first, other = evaluate_all(roots, trace, feedback)
    return next((step for step, (one, two) in enumerate(zip(first, other, strict=True))
                 if one is not two), None)


def _traces(nodes: Sequence[Formula], random: Random) -> Iterator[dict[str, list[Value]]]:
    """Yield traces of the variables among the nodes; fewer if evaluation is expensive."""
    variables = [node for node in nodes if isinstance(node, Variable)]
    if not variables:
        yield {'': [False] * _SHORT}
        return
    limit = min(max(_bounds(nodes), default=0), _LONGEST // 3)
    work = 0
    for number in range(_SHORT_TRACES + (_LONG_TRACES if limit > _FEW else 0)):
        steps = _SHORT if number < _SHORT_TRACES else 3 * limit + _SHORT
        work += len(nodes) * steps * min(steps, 8)
        if number and work > _MOST_WORK:
            return
        numbers = _numbers(nodes)
        yield {item.name: _column(item, numbers, steps, random) for item in variables}


def _bounds(nodes: Sequence[Formula]) -> Iterator[int]:
    for node in nodes:
        if isinstance(node, Once | Historically | Since | Triggered):
            yield max(node.window.low, node.window.high or 0)


def _numbers(nodes: Sequence[Formula]) -> list[float]:
    """Return the numbers in the formulas, and their neighbours."""
    found = {float(node.value) for node in nodes if isinstance(node, Constant)
             and node.type is not ValueType.BOOL and math.isfinite(float(node.value))}
    return sorted({near for value in (*found, 0.0) for near in (value - 1, value, value + 1)})


def _column(variable: Variable, numbers: Sequence[float], steps: int,
            random: Random) -> list[Value]:
    """Return values that stay for several steps, in some columns longer than in others."""
    lasts = random.choice((0.2, 0.7, 0.95))
    column = [_value(variable.type, numbers, random)]
    while len(column) < steps:
        column.append(column[-1] if random.random() < lasts
                      else _value(variable.type, numbers, random))
    return column


def _value(kind: ValueType, numbers: Sequence[float], random: Random) -> Value:
    if kind is ValueType.BOOL:
        return random.random() < 0.5
    value: float = random.choice(numbers)
    return value if kind.is_float else _fitted(round(value), kind)


def _fitted(value: int, kind: ValueType) -> int:
    """Return the number of an integer type that is nearest."""
    bits = int(kind.value.lstrip('uint'))
    is_signed = kind.value.startswith('int')
    low, high = (-(1 << bits - 1), (1 << bits - 1) - 1) if is_signed else (0, (1 << bits) - 1)
    return max(low, min(high, value))
