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
an input is NaN is one more Boolean input. That finite numbers give NaN (`0.0 / 0.0`) is left out.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
import math
from typing import TypeAlias

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


class NanUndecided(Exception):
    """What NaN changes is not known."""


class NanRuns:
    """Runs of a part on which inputs may be NaN."""

    def __init__(self, specification: Specification, part: Part, deadline: Deadline,
                 is_on_grid: bool) -> None:
        """Build the system; raises as `build_component`, and NanUndecided."""
        self._signals, self._part = specification.signals, part
        self._component = build_component(*_with_nan(specification, part), None, deadline,
                                          is_on_grid)

    def violate(self, place: int, others: Sequence[int] | None, runs: PartRuns) -> bool:
        """
        Whether one violates a requirement while others hold; None: whatever they do.

        `runs`, of the part itself, confirm it. Raises NoRun if it is too long, and NanUndecided if
        they do not confirm it.
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
        if self._part.ids[place] in violated[-1] and held.isdisjoint(set().union(*violated)):
            return True
        raise NanUndecided

    def differ(self, one: int, other: int) -> bool:
        """Whether two requirements have different verdicts at a step of some run."""
        return self._component.games.differ(one, other)


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
    formulas = [item.formula, *(right for _, right in item.feedback)]
    changed, flags = _Changed(), _Changed()
    for node in f.postorder(formulas):
        changed[node], flags[node] = _with_flag(node, changed, flags)
    return replace(item, formula=changed[item.formula], feedback=tuple(
        (left, changed[right]) for left, right in item.feedback))


_Changed: TypeAlias = dict[Formula, Formula]


def _with_flag(node: Formula, changed: _Changed, flags: _Changed) -> tuple[Formula, Formula]:
    """Return a node as NaN changes it, and whether it is NaN, from those of its operands."""
    if node.type.is_float:
        return _number(node, changed, flags)
    rebuilt = f.rebuilt(node, changed)
    if not isinstance(node, f.Binary) or not node.operator.is_relation:
        return rebuilt, f.FALSE
    return _compared(node.operator, rebuilt, [flags[item] for item in f.operands(node)]), f.FALSE


def _number(node: Formula, changed: _Changed, flags: _Changed) -> tuple[Formula, Formula]:
    rebuilt = f.rebuilt(node, changed)
    match node:
        case f.Variable(name):
            return node, f.Variable(_flag(name), ValueType.BOOL)
        case f.Choice(condition, yes, no):
            return rebuilt, f.Choice(changed[condition], flags[yes], flags[no])
        case f.Previous(initial, argument):
            return rebuilt, f.Previous(flags[initial], flags[argument])
        case f.Binary(operator, left, right) if operator in _SELECTING:
            condition = _compared(_SELECTING[operator], f.Binary(
                _SELECTING[operator], changed[left], changed[right]), [flags[left], flags[right]])
            return (f.Choice(condition, changed[left], changed[right]),
                    f.Choice(condition, flags[left], flags[right]))
        case f.Feedback() | f.Binary(f.BinaryOperator.POW):
            raise NanUndecided
    return rebuilt, _any(flags[item] for item in f.operands(node))


# The second operand where this is false, as for NaN.
_SELECTING = {f.BinaryOperator.MIN: f.BinaryOperator.LE, f.BinaryOperator.MAX: f.BinaryOperator.GE}


def _compared(operator: f.BinaryOperator, compared: Formula, flags: Iterable[Formula]) -> Formula:
    """Return a comparison as NaN changes it."""
    flag = _any(flags)
    if flag is f.FALSE:
        return compared
    if operator is f.BinaryOperator.NE:
        return f.Binary(f.BinaryOperator.OR, compared, flag)
    return f.Binary(f.BinaryOperator.AND, compared, f.Unary(f.UnaryOperator.NOT, flag))


def _any(flags: Iterable[Formula]) -> Formula:
    found: Formula = f.FALSE
    for flag in dict.fromkeys(flags):
        if flag is not f.FALSE:
            found = flag if found is f.FALSE else f.Binary(f.BinaryOperator.OR, found, flag)
    return found
