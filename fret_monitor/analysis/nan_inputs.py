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
Runs on which inputs may be NaN.

The numbers of an analysis are finite. A comparison with NaN is false, `!=` is true. Here, whether
an input is NaN is one more Boolean input.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
import math

from fret_monitor.analysis.component import build_component, Part
from fret_monitor.analysis.letters import Values
from fret_monitor.analysis.part_runs import PartRuns
from fret_monitor.analysis.runs import run_to
from fret_monitor.logic import formula as f
from fret_monitor.logic.formula import Formula
from fret_monitor.logic.specification import Property, Signal, Specification
from fret_monitor.model.policies import InputRole
from fret_monitor.model.values import ValueType
from fret_monitor.smt import numbers
from fret_monitor.smt import terms as t
from fret_monitor.traces.deadline import Deadline


class NanRuns:
    """Runs of a part on which inputs may be NaN."""

    def __init__(self, specification: Specification, part: Part, deadline: Deadline,
                 is_on_grid: bool) -> None:
        """Build the system; raises as `build_component`."""
        self._signals, self._part = specification.signals, part
        self._component = build_component(*_with_nan(specification, part), None, deadline,
                                          is_on_grid)

    def violate(self, place: int, others: Sequence[int] | None, runs: PartRuns) -> bool:
        """
        Whether one violates a requirement while others hold; None: whatever they do.

        `runs`, of the part itself, confirm it. Raises NoRun if it is too long.
        """
        games, d = self._component.games, self._component.games.diagrams
        steps = d.possible if others is None else games.safe(others)
        layers = games.violation(place, steps, ())
        if not games.is_reached(layers):
            return False
        verdict = d.outputs[place]
        found = run_to(games, layers, steps & verdict, steps & ~verdict).rows()
        violated = runs.violated(runs.rows([_values(row, self._signals) for row in found]))
        held = set() if others is None else {
            self._part.ids[item] for item in (*others, *games.assumptions)}
        return self._part.ids[place] in violated[-1] and held.isdisjoint(set().union(*violated))


def _with_nan(specification: Specification, part: Part) -> tuple[Specification, Part]:
    """
    Return a bundle and a part of it with an input for each float input: whether it is NaN.

    No input is an output of the system: that matters to no run.
    """
    flags = tuple(replace(item, name=_flag(item.name), type=ValueType.BOOL)
                  for item in specification.signals if item.type.is_float)
    signals = tuple(replace(item, role=InputRole.INPUT)
                    for item in (*specification.signals, *flags))
    return (replace(specification, signals=signals),
            Part(tuple(map(_changed, part.properties))))


def _values(values: Values, signals: Iterable[Signal]) -> Values:
    """Return the values of a step of such a bundle as those of the bundle itself."""
    found = dict(values)
    for item in signals:
        if item.type.is_float and values.get(t.variable(_flag(item.name), t.BOOL)):
            found[t.variable(item.name, numbers.sort_of(item.type))] = math.nan
    return found


def _flag(name: str) -> str:
    return f'{name} is NaN'


def _changed(item: Property) -> Property:
    found: dict[Formula, Formula] = {}
    for node in f.postorder([item.formula, *(right for _, right in item.feedback)]):
        found[node] = _compared(node, found)
    return replace(item, formula=found[item.formula], feedback=tuple(
        (left, found[right]) for left, right in item.feedback))


def _compared(node: Formula, found: Mapping[Formula, Formula]) -> Formula:
    """Return a node with its operands replaced, and a comparison as NaN changes it."""
    changed = f.rebuilt(node, found)
    if not isinstance(node, f.Binary) or not node.operator.is_relation:
        return changed
    is_unequal = node.operator is f.BinaryOperator.NE
    for item in f.variables(node):
        if item.type.is_float:
            flag = f.Variable(_flag(item.name), ValueType.BOOL)
            changed = f.Binary(f.BinaryOperator.OR, changed, flag) if is_unequal else f.Binary(
                f.BinaryOperator.AND, changed, f.Unary(f.UnaryOperator.NOT, flag))
    return changed
