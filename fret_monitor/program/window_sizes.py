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

"""The windows of numbers of a program: their bytes, what fills them, and who reads them."""

from collections.abc import Iterator
from dataclasses import dataclass

from fret_monitor.logic.formula import Ago, Binary, BinaryOperator, Formula
from fret_monitor.program.layout import FieldKind, GroupLayout
from fret_monitor.program.monitor_program import (
    Delay, Equation, FeedbackRead, Greatest, operands, Operation, room_of, Rounded, StepGroup,
    Tally, TimeAtLeast, Total, ValueAgo,
)

_FIELDS = (FieldKind.QUEUE, FieldKind.WINDOW, FieldKind.SUM, FieldKind.NUMBER, FieldKind.LINE,
           FieldKind.RING)


@dataclass(frozen=True)
class WindowSize:
    """
    A window of numbers; `formulas` are its values, `past` its length in steps or ticks.

    It has room for so many `entries`: messages, changes, intervals, steps or bits. `signals` are
    the inputs by whose `max_rate` there are that many, none if there cannot be more.
    `properties` are the requirements that read it.
    """

    formulas: tuple[Formula, ...]
    past: int
    bytes: int
    entries: int
    entry: str
    signals: tuple[int, ...]
    properties: tuple[int, ...]


def window_sizes(layout: GroupLayout) -> Iterator[WindowSize]:
    """Yield the windows of a group, each once, whoever reads it."""
    readers = _readers(layout.group)
    for index, equation in enumerate(layout.group.equations):
        cell = equation.operation
        if not isinstance(cell, ValueAgo | Greatest | Total | Tally | TimeAtLeast):
            continue
        fields = [index, cell.leaving.value] if isinstance(cell, Tally) else [index]
        room = room_of(cell)
        past, entry = _past(layout.group, cell), _entry(cell)
        entries = past + isinstance(cell, Greatest | Total) if room is None else room.capacity or 0
        yield WindowSize(
            tuple(_formulas(layout.group, index, equation)), past,
            sum(layout.field_of[kind, number].size for kind in _FIELDS for number in fields
                if (kind, number) in layout.field_of),
            entries, entry, room.signals if room and room.may_overflow else (),
            tuple(readers.get(index, ())))


def _past(group: StepGroup, cell: Operation) -> int:
    match cell:
        case Tally():
            delay = group.equations[cell.leaving.value].operation
            return delay.steps if isinstance(delay, Delay) else 0
        case ValueAgo() | Greatest() | Total() | TimeAtLeast():
            return cell.past
        case _:
            return 0


def _entry(cell: Operation) -> str:
    """Return the noun of what fills a window."""
    match cell:
        case Tally():
            return 'bit'
        case TimeAtLeast():
            return 'interval'
        case _ if room_of(cell) is None:
            return 'step'
        case Total():
            return 'message'
        case _:
            return 'change'


def _formulas(group: StepGroup, index: int, equation: Equation) -> Iterator[Formula]:
    """Yield the values of a window; those of an exact sum are its sum and its mean."""
    for other in group.equations:
        if isinstance(other.operation, Rounded) and other.operation.total.value == index \
                and other.formula is not None:
            yield other.formula
    match equation.formula:
        case Ago() as ago:
            yield Binary(BinaryOperator.SUB, ago.argument, ago)
        case None:
            pass
        case formula:
            yield formula


def _readers(group: StepGroup) -> dict[int, list[int]]:
    """Return the requirements that read each value."""
    found: dict[int, list[int]] = {}
    for number, verdict in zip(group.properties, group.verdicts, strict=True):
        seen: set[int] = set()
        stack = [verdict.value]
        while stack:
            value = stack.pop()
            if value < 0 or value in seen:
                continue
            seen.add(value)
            found.setdefault(value, []).append(number)
            operation = group.equations[value].operation
            stack.extend(item.value for item in operands(operation))
            if isinstance(operation, FeedbackRead):
                stack.append(group.feedback[operation.index].next.value)
    return found
