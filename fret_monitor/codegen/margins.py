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
Generate the C function that computes the margins of a group.

It follows the step of the group, which has left what is compared in the state. Margins are
constants of the function, one for each equation; the cells are those of fret_margins.h.
"""

from collections.abc import Iterator
from typing import assert_never

from fret_monitor.codegen import c
from fret_monitor.codegen.comments import comment
from fret_monitor.codegen.names import Names
from fret_monitor.logic.formula import BinaryOperator
from fret_monitor.logic.printing import to_smv
from fret_monitor.model.policies import Policy
from fret_monitor.model.values import ValueType
from fret_monitor.program.layout import GroupLayout
from fret_monitor.program.monitor_program import (
    Certain, Distance, Greater, Lesser, Literal, MarginAgo, MarginEquation, MarginFeedback,
    Margins, MarginSince, MarginWithin, MonitorProgram, Operand, Read, room_of, TRUE,
)

LONGEST_COMPARISON = 200
_FUNCTIONS = {BinaryOperator.LE: 'fm_distance_at_most', BinaryOperator.EQ: 'fm_distance_equal',
              BinaryOperator.NE: 'fm_distance_unequal'}


def comparisons(program: MonitorProgram) -> list[MarginEquation]:
    """Return the comparisons of all groups, in the order of their numbers in C."""
    return [item for group in program.groups if group.margins
            for item in group.margins.equations if isinstance(item.operation, Distance)]


class MarginWriter:
    """Writes the statements that compute the margins of a group."""

    def __init__(self, program: MonitorProgram, layout: GroupLayout, margins: Margins,
                 names: Names) -> None:
        """Prepare for the group of a layout, with its margins."""
        self._program = program
        self._group = layout.group
        self._margins = margins
        self._names = names
        self._is_timed = layout.group.is_timed
        self._values = {signal.name: signal.values for signal in program.signals if signal.values}
        before = program.groups[:program.groups.index(layout.group)]
        self._scales = [item.operation.scale for item in margins.equations
                        if isinstance(item.operation, Distance)]
        self._first = sum(isinstance(item.operation, Distance) for group in before
                          if group.margins for item in group.margins.equations)

    def lines(self) -> Iterator[str]:
        """Yield the statements, indented."""
        if self._is_timed:
            yield '  int64_t next = FM_NEVER;'
        number = self._first
        for index, item in enumerate(self._margins.equations):
            if item.formula is not None:
                yield from comment(self._shown(item), '  ')
            yield f'  const struct fm_margin_now margin_{index} = ' \
                  f'{self._expression(index, number)};'
            number += isinstance(item.operation, Distance)
        yield from self._roots()
        yield from self._feedback()
        if self._is_timed:
            yield '  return next;'

    def _shown(self, item: MarginEquation) -> str:
        assert item.formula is not None
        return to_smv(item.formula, LONGEST_COMPARISON, self._values,
                      is_timed=self._program.policy is Policy.TIMED)

    def _expression(self, index: int, number: int) -> str:
        operation = self._margins.equations[index].operation
        match operation:
            case Certain():
                return f'fm_margin_certain({self._leaf(operation.leaf)})'
            case Distance():
                scale = c.literal(operation.scale, ValueType.FLOAT64).text
                at_ticks = '_at' if self._is_timed else ''
                return (f'fm_margin_compared{at_ticks}(\n    s->margins_{index}, '
                        f'{_FUNCTIONS[operation.operator]}('
                        f'{self._leaf(operation.left)}, {self._leaf(operation.right)}),\n'
                        f'    {scale}, s->instant_0, {number})')
            case Lesser():
                return self._call('lesser', operation.left, operation.right)
            case Greater():
                return self._call('greater', operation.left, operation.right)
            case MarginSince(left) if left == TRUE:
                return self._call('ever', operation.right, state=f's->margins_{index}')
            case MarginSince():
                return self._call('since', operation.left, operation.right,
                                  state=f's->margins_{index}')
            case MarginWithin():
                return self._queue('within', index, operation.bound, operation)
            case MarginAgo(steps=1) if self._is_timed:
                return self._call('before', operation.argument, at_ticks=True,
                                  state=f's->margins_{index}, s->margin_queue_{index}')
            case MarginAgo():
                return self._queue('ago', index, operation.steps, operation)
            case MarginFeedback():
                return f'fm_margin_of(s->margin_feedback_{operation.index})'
            case _:
                assert_never(operation)

    def _call(self, name: str, *arguments: Operand, state: str = '',
              at_ticks: bool = False) -> str:
        shown = [*([state] if state else []), *map(self._operand, arguments),
                 *(['tick', '&next'] if at_ticks else [])]
        return f'fm_margin_{name}{"_at" if at_ticks else ""}(\n    {", ".join(shown)})'

    def _queue(self, name: str, index: int, past: int,
               cell: MarginWithin | MarginAgo) -> str:
        state = f's->margins_{index}, s->margin_queue_{index}'
        if (room := room_of(cell)) is not None:
            state += f', INT64_C({room.capacity or 1})'
        return self._call(name, cell.argument, state=f'{state}, INT64_C({past})',
                          at_ticks=self._is_timed)

    def _operand(self, operand: Operand) -> str:
        if operand.is_constant:
            return f'fm_margin_certain({"false" if operand.negated else "true"})'
        found = f'margin_{operand.value}'
        return f'fm_margin_not({found})' if operand.negated else found

    def _leaf(self, number: int) -> str:
        value = self._margins.leaves[number].value
        equation = self._group.equations[value]
        operation = equation.operation
        if isinstance(operation, Literal):
            return c.literal(float(operation.value), ValueType.FLOAT64).text
        if isinstance(operation, Read):
            signal = self._program.signals[operation.signal]
            shown = f'in->{self._names.signals[signal.name]}'
            is_cast = signal.type not in (ValueType.BOOL, ValueType.FLOAT64)
            return f'(double)({shown})' if is_cast else shown
        return f's->leaf_{value}'

    def _feedback(self) -> Iterator[str]:
        for number, operand in enumerate(self._margins.feedback):
            yield f'  const struct fm_margin_kept next_{number} = ' \
                  f'fm_margin_copy({self._operand(operand)});'
        for number, _ in enumerate(self._margins.feedback):
            state = f's->margin_feedback_{number}'
            if self._is_timed:
                yield f'  fm_lower(&next, fm_margin_differs({state}[0], next_{number}), tick + 1);'
            yield f'  {state}[0] = next_{number};'

    def _roots(self) -> Iterator[str]:
        queues = [f's->margin_queue_{index}[3]'
                  for index, item in enumerate(self._margins.equations)
                  if (room := room_of(item.operation)) is not None and room.may_overflow]
        if queues:
            yield f'  const bool is_lost = ({" | ".join(queues)}) != 0;'
        lost, is_scaled = 'is_lost' if queues else 'false', any(
            scale != 1.0 for scale in self._scales)
        if is_scaled:
            shown = ', '.join(c.literal(scale, ValueType.FLOAT64).text for scale in self._scales)
            yield f'  static const double scales[] = {{{shown}}};'
        roots = zip(self._group.properties, self._margins.roots, strict=True)
        for name, operand in (*((f'margin_{number}', item) for number, item in roots),
                              *((f'margin_now_{number}', item)
                                for number, item in self._margins.occurrences)):
            found = self._operand(operand)
            scale = f'fm_margin_scale({found}, scales, {self._first})' if is_scaled else '1.0'
            yield f'  fm_margin_show(s->{name}, {found}, {scale}, {lost});'
