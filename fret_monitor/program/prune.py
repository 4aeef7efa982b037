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
Remove the equations that no verdict depends on.

Simplification (`p & FALSE`) leaves equations that are never read. They would cost memory and time,
and C compilers would warn about unused variables.
"""

from bisect import bisect_left
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from fret_monitor.program.monitor_program import Operand, operands, Operation, StepGroup


def prune(group: StepGroup) -> StepGroup:
    """Return the group with only its live equations, in the same order and renumbered."""
    live = _live(group)
    number = {old: new for new, old in enumerate(live)}
    return replace(
        group,
        equations=tuple(replace(each, operation=_operation(each.operation, number))
                        for each in (group.equations[old] for old in live)),
        first_equations=tuple(bisect_left(live, first)
                              for first in group.first_equations),
        verdicts=tuple(_operand(item, number) for item in group.verdicts),
        feedback=tuple(replace(item, next=_operand(item.next, number))
                       for item in group.feedback),
        occurrences=tuple((index, _operand(item, number)) for index, item in group.occurrences),
        outputs=tuple((index, _operand(item, number)) for index, item in group.outputs),
        margins=group.margins and replace(group.margins, leaves=tuple(
            _operand(item, number) for item in group.margins.leaves)),
        tests=tuple((index, _operand(item, number)) for index, item in group.tests),
    )


def _live(group: StepGroup) -> list[int]:
    roots = [*group.verdicts, *(item for _, item in group.occurrences),
             *(item for _, item in group.outputs), *(item.next for item in group.feedback),
             *(group.margins.leaves if group.margins else ())]
    seen: set[int] = set()
    stack = [root.value for root in roots if not root.is_constant]
    while stack:
        value = stack.pop()
        if value not in seen:
            seen.add(value)
            arguments = operands(group.equations[value].operation)
            stack.extend(item.value for item in arguments if not item.is_constant)
    return sorted(seen)


def _operation(operation: Operation, number: Mapping[int, int]) -> Operation:
    changed: dict[str, Any] = {name: _operand(value, number)
                               for name, value in vars(operation).items()
                               if isinstance(value, Operand)}
    return replace(operation, **changed) if changed else operation


def _operand(operand: Operand, number: Mapping[int, int]) -> Operand:
    return operand if operand.is_constant else replace(operand, value=number[operand.value])
