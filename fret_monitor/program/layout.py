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
The static layout of a group's state: fields, sizes and parts.

A group's equations are divided into parts, one C function each, because C compilers are slow on
long functions. If a part has at most eight bits of state, each takes a byte; otherwise they are
packed into words. Counters have the smallest type that their bounds allow. Fields are ordered by
size, so that there is no padding between them. In a group that steps at ticks a counter is a tick,
in 64 bits.
"""

from bisect import bisect_right
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import Enum
from functools import cached_property
import math

from fret_monitor.logic.formula import Ago, Over, postorder, TimeOver
from fret_monitor.logic.specification import Property, written_input
from fret_monitor.model.diagnostics import Diagnostic, Problems, Span
from fret_monitor.model.manifest import ManifestVariable
from fret_monitor.model.policies import Policy
from fret_monitor.model.times import time_text
from fret_monitor.model.values import ValueType
from fret_monitor.program.monitor_program import (
    AlwaysSoFar, AlwaysWithin, Delay, Distance, FirstStep, Greatest, Hold, is_exact_sum, Literal,
    MarginAgo, MarginOperation, Margins, MarginSince, MarginWithin, MonitorProgram, OnceBefore,
    OnceEver, OnceWithin, Operand, operands, Operation, OutcomesTest, PreviousNumber, Read,
    Room, room_of, SinceBefore, SinceBetween, SinceEver, SinceWithin, SlopeBetween, StepGroup,
    Tally, TimeAtLeast, Total, TrialOutcome, TriggeredEver, ValueAgo,
)

MAX_STATE_BYTES = 16 * 1024 * 1024
MOST_INSTANCE_BYTES = 4 * 1024 ** 3
PART_EQUATIONS = 256
SHIFT_REGISTER_BITS = 64
# A byte is faster to read and write than a bit of a word, since it does not depend on other bits.
FEW_BITS = 8

QUEUE_HEAD = 4  # numbers before the entries of a queue, as in csrc/generated/fret_cells.h
_RING_HEAD = 3  # as in csrc/generated/fret_windows.h
_WINDOW_HEAD = 8
_SUM_LENGTH = 40
TEST_WORDS, TEST_PARTS = 7, 3  # of a test, as in csrc/generated/fret_trials.h
MARGIN_WORDS, KEPT_MARGIN_WORDS = 4, 3  # of a struct fm_margin, fm_margin_kept
_MARGIN_QUEUE_HEAD = 11  # of a window at ticks, as in csrc/generated/fret_margins.h
_BLOCK_ALIGNMENT = 16  # as in csrc/evaluator/instance.h, like the sizes of its structs
_TIME_BYTES = 72
_INPUT_BYTES = 32
_GROUP_BYTES = 48
FM_NEVER = 2 ** 63 - 1  # as in csrc/generated/fret_monitor.h

_UNSIGNED = (ValueType.UINT8, ValueType.UINT16, ValueType.UINT32, ValueType.UINT64)


class FieldKind(Enum):
    """What a field of the state holds; the value is the stem of its name in C."""

    BITS = 'bits'
    FLAG = 'flag'
    COUNTER = 'counter'
    LINE = 'line'
    RING = 'ring'
    QUEUE = 'queue'
    WINDOW = 'window'
    SUM = 'sum'
    POSITION = 'position'
    NUMBER = 'number'
    FEEDBACK = 'feedback'
    WIRE = 'wire'
    OUTPUT = 'output'
    LEAF = 'leaf'
    INSTANT = 'instant'
    MARGIN = 'margin'
    MARGIN_NOW = 'margin_now'
    MARGINS = 'margins'
    MARGIN_QUEUE = 'margin_queue'
    MARGIN_FEEDBACK = 'margin_feedback'


_KEPT_MARGINS = (FieldKind.MARGINS, FieldKind.MARGIN_FEEDBACK)
_OF_MARGINS = (FieldKind.MARGIN, FieldKind.MARGIN_NOW, *_KEPT_MARGINS)


def _margin_words(kind: FieldKind) -> int:
    """Return the length of a margin in a field of a kind."""
    return KEPT_MARGIN_WORDS if kind in _KEPT_MARGINS else MARGIN_WORDS


@dataclass(frozen=True)
class StateField:
    """
    A field of a group's state struct.

    `number` is the number of the word (BITS), the length of the rings (POSITION), the index of the
    feedback equation (FEEDBACK, MARGIN_FEEDBACK), of the property (OUTPUT, MARGIN, MARGIN_NOW: of
    its occurrences), of the equation of a margin (MARGINS, MARGIN_QUEUE), 0 (INSTANT), else of the
    equation. `length` is 0
    for a scalar, else the length of the array. `initial` is the initial value, of each element. A
    margin is an array of MARGIN_WORDS words, or of KEPT_MARGIN_WORDS in a cell.
    """

    kind: FieldKind
    number: int
    type: ValueType
    length: int = 0
    initial: int | float | bool = 0

    @property
    def size(self) -> int:
        """Size in bytes."""
        return self.type.size * max(1, self.length)

    @property
    def n_margins(self) -> int:
        """How many margins it holds; 0 of another kind."""
        return self.length // _margin_words(self.kind) if self.kind in _OF_MARGINS else 0

    @property
    def n_kept_margins(self) -> int:
        """How many margins of cells it holds."""
        return self.n_margins if self.kind in _KEPT_MARGINS else 0


@dataclass(frozen=True)
class BitSlot:
    """A bit of a word; `part` is the part of the group that reads and writes that word."""

    word: int
    bit: int
    part: int


@dataclass(frozen=True)
class GroupLayout:
    """A group's fields in the order of the struct, and the places of its packed bits."""

    group: StepGroup
    fields: tuple[StateField, ...]
    bits: dict[int, BitSlot]
    parts: tuple[range, ...]

    @property
    def size(self) -> int:
        """Size of the struct in bytes."""
        used = sum(field.size for field in self.fields)
        return max(1, -(-used // self.alignment) * self.alignment)

    @property
    def alignment(self) -> int:
        """Alignment of the struct in bytes: that of its widest field."""
        return max((field.type.size for field in self.fields), default=1)

    @property
    def operations(self) -> int:
        """The number of equations that a step computes, without inputs and literals."""
        return sum(not isinstance(equation.operation, Read | Literal)
                   for equation in self.group.equations)

    @cached_property
    def wires(self) -> frozenset[int]:
        """The values that are kept in the state because a later part reads them."""
        return frozenset(_wires(self.group, self.parts))

    @cached_property
    def field_of(self) -> dict[tuple[FieldKind, int], StateField]:
        """The fields by kind and number."""
        return {(item.kind, item.number): item for item in self.fields}

    @cached_property
    def uses(self) -> Counter[int]:
        """How often each value is read, by equations, verdicts and feedback."""
        group = self.group
        uses = Counter(item.value for equation in group.equations
                       for item in operands(equation.operation))
        uses.update(item.value for item in group.verdicts)
        uses.update(item.value for _, item in (*group.occurrences, *group.outputs))
        uses.update(item.next.value for item in group.feedback)
        uses.update(self.leaves)
        return uses

    @cached_property
    def leaves(self) -> frozenset[int]:
        """The values that are kept in the state for the margins."""
        return frozenset() if self.group.margins is None else frozenset(
            item.value for item in self.group.margins.leaves
            if not isinstance(self.group.equations[item.value].operation, Read | Literal))

    @cached_property
    def occurrences_of(self) -> dict[int, list[tuple[int, Operand]]]:
        """The occurrences computed from each value, as `verdicts_of`."""
        return _by_value(self.group.occurrences)

    @cached_property
    def outputs_of(self) -> dict[int, list[tuple[int, Operand]]]:
        """The outputs computed from each value, as `verdicts_of`."""
        return _by_value(self.group.outputs)

    @cached_property
    def verdicts_of(self) -> dict[int, list[tuple[int, Operand]]]:
        """The verdicts computed from each value (-1: from constants): property and operand."""
        return _by_value(zip(self.group.properties, self.group.verdicts, strict=True))


def _by_value(pairs: Iterable[tuple[int, Operand]]) -> dict[int, list[tuple[int, Operand]]]:
    found: dict[int, list[tuple[int, Operand]]] = {}
    for number, operand in pairs:
        found.setdefault(operand.value, []).append((number, operand))
    return found


def lay_out(group: StepGroup) -> GroupLayout:
    """Lay out the state of a group."""
    parts = tuple(_parts(group))
    bits = _place_bits(group, parts)
    fields = [*_words(group, bits), *_flags(group, bits), *_cells(group), *_shared(group, parts)]
    if group.margins is not None:
        fields += _margins(group, group.margins)
    fields.sort(key=lambda field: (-field.type.size, field.kind.value, field.number))
    return GroupLayout(group, tuple(fields), bits, parts)


def state_bytes(layouts: tuple[GroupLayout, ...]) -> int:
    """Return the size of the struct that contains the structs of all groups, in order."""
    used = 0
    for layout in layouts:
        used = -(-used // layout.alignment) * layout.alignment + layout.size
    widest = max((layout.alignment for layout in layouts), default=1)
    return max(1, -(-used // widest) * widest)


def instance_bytes(program: MonitorProgram, layouts: tuple[GroupLayout, ...]) -> int:
    """Return the size of the block of one instance, as csrc/evaluator/instance.c lays it out."""
    requirements = len(program.properties)
    verdicts = requirements + sum(len(layout.group.occurrences) for layout in layouts)
    sizes = (_TIME_BYTES, _INPUT_BYTES * len(program.signals), _GROUP_BYTES * len(layouts),
             verdicts, requirements, _inputs_bytes(program), state_bytes(layouts))
    return sum(-(-size // _BLOCK_ALIGNMENT) * _BLOCK_ALIGNMENT for size in sizes)


def _inputs_bytes(program: MonitorProgram) -> int:
    """Return the size of the struct of inputs."""
    used = 0
    for signal in program.signals:
        used = -(-used // signal.type.size) * signal.type.size + signal.type.size
    widest = max((signal.type.size for signal in program.signals), default=1)
    return max(1, -(-used // widest) * widest)


def check_instances(program: MonitorProgram, layouts: tuple[GroupLayout, ...],
                    variables: Sequence[ManifestVariable], place: Span | None = None) -> None:
    """
    Refuse more instances of one or two variables than memory allows.

    Raises
    ------
    CompileError
        with a place, that of the first requirement if there is none, and the bytes.
    """
    each, most = instance_bytes(program, layouts), math.prod(item.most for item in variables)
    if program.properties and each * most > MOST_INSTANCE_BYTES:
        problems = Problems()
        problems.error(
            f"{most:,} instances of '{', '.join(item.name for item in variables)}' need "
            f'{each * most:,} bytes; at most {MOST_INSTANCE_BYTES:,} are allowed',
            place or program.properties[0].place, f'{each:,} bytes each',
            _allowed(variables, MOST_INSTANCE_BYTES // each))
        problems.raise_errors()


def _allowed(variables: Sequence[ManifestVariable], most: int) -> str:
    """Return how many instances of each variable may be found, of `most` of all together."""
    found = [item.name for item in variables if not item.keys]
    most //= math.prod(len(item.keys) for item in variables if item.keys)
    if len(found) == 2:
        return f'most: {math.isqrt(most)}, of {found[0]} and of {found[1]}'
    return f'most: {most}' if found and most else ''


def check_bounds(program: MonitorProgram, layouts: tuple[GroupLayout, ...],
                 limit: int = MAX_STATE_BYTES) -> None:
    """
    Refuse a program that needs more state than `limit` bytes, and name its longest delay.

    Raises
    ------
    CompileError
        with the place of the requirement that has the longest delay.
    """
    _check_rates(program, layouts)
    needed = state_bytes(layouts)
    if needed <= limit:
        return
    size, past, index = max(_delays(layouts), default=(0, '', 0))
    item = program.properties[index]
    problems = Problems()
    problems.extend([Diagnostic(
        f'the bundle needs {needed:,} bytes of state; at most {limit:,} are allowed',
        item.place,
        f'{item.id} looks back {past}: {size:,} bytes' if size else item.id,
        _help_on_size(item, program.policy, max(0, limit - needed + size), max(1, size)))])
    problems.raise_errors()


def _help_on_size(item: Property, policy: Policy, room: int, size: int) -> str:
    """Return how to need less; the longest delay of the requirement may have some `room`."""
    pasts = [node.past for node in postorder(item.roots)
             if isinstance(node, Over | Ago | TimeOver)]
    if pasts:
        kept = "as many as its inputs' max_rate allows in its time" if policy is Policy.TIMED \
            else 'each of them'
        return f'a window of numbers keeps {kept}' + _shorter(max(pasts) * room // size, policy)
    if policy is Policy.TIMED:
        return 'a window [a,b] keeps b/(b-a) intervals; use [0,b], which needs one number, or a ' \
            'smaller a'
    return 'a window [a,b] keeps its last a values; use [0,b], which needs one counter, or a ' \
        'smaller a'


def _shorter(past: int, policy: Policy) -> str:
    """Return about how long a window may be; '' if it may not."""
    rounded = past // (unit := 10 ** max(0, len(str(past)) - 2)) * unit
    text = time_text(rounded) if policy is Policy.TIMED else f'{rounded:,} steps'
    return f': there is room for {text}' if rounded else ''


def _check_rates(program: MonitorProgram, layouts: tuple[GroupLayout, ...]) -> None:
    problems = Problems()
    for layout in layouts:
        group = layout.group
        for index, equation in enumerate(group.equations):
            _check_rate(equation.operation, program, _owner(group, index), problems)
        longest: dict[int, MarginOperation] = {}
        for item in group.margins.equations if group.margins else ():
            if (room := room_of(item.operation)) is not None and room.capacity is None:
                longest[item.owner] = max(
                    item.operation, longest.get(item.owner, item.operation), key=_past)
        for owner, cell in longest.items():
            _check_rate(cell, program, owner, problems)
    problems.raise_errors()


def _check_rate(cell: Operation | MarginOperation, program: MonitorProgram, owner: int,
                problems: Problems) -> None:
    """Report a cell whose room depends on rates that are not known."""
    room = room_of(cell)
    if room is None or room.capacity is not None:
        return
    item = program.properties[owner]
    slow = dict.fromkeys(
        written_input(program.signals, program.signals[one]).name
        for one in room.signals if program.signals[one].max_rate is None)
    exactly = 'exactly ' if isinstance(cell, SinceBetween) else ''
    what = f'the margin of {item.id}' if isinstance(cell, MarginAgo | MarginWithin) else item.id
    problems.extend([Diagnostic(
        f'{what} looks back {exactly}{time_text(_past(cell))}, for which each '
        'change in between must be stored', item.place,
        f'how many there can be is not known without a rate of {", ".join(slow)}',
        f'write `max_rate: 100` (Hz) at {", ".join(slow)}' + (
            ', or a window [a,b] with a < b, which needs no rate' if exactly else ''))])


def _past(cell: Operation | MarginOperation) -> int:
    """Return how far a cell with a queue looks back."""
    match cell:
        case MarginAgo():
            return cell.steps
        case MarginWithin():
            return cell.bound
        case SinceBetween():
            return cell.high
        case ValueAgo() | Greatest() | Total() | TimeAtLeast():
            return cell.past
        case _:
            return 0


def _owner(group: StepGroup, index: int) -> int:
    """Return the property for which an equation was added."""
    return group.properties[bisect_right(group.first_equations, index) - 1]


def _delays(layouts: tuple[GroupLayout, ...]) -> Iterator[tuple[int, str, int]]:
    """Yield bytes, length of time and property of each cell that stores past values."""
    for layout in layouts:
        group = layout.group
        for index, equation in enumerate(group.equations):
            cell = equation.operation
            if isinstance(cell, Delay):
                yield -(-cell.steps // 8), f'{cell.steps:,} steps', _owner(group, index)
            elif _past(cell):
                size = sum(item.size for kind in (FieldKind.QUEUE, FieldKind.WINDOW)
                           if (item := layout.field_of.get((kind, index))))
                shown = time_text(_past(cell)) if group.is_timed else f'{_past(cell):,} steps'
                yield size, shown, _owner(group, index)


def _parts(group: StepGroup) -> Iterator[range]:
    """Divide the equations between requirements, or within one that is larger than a part."""
    total = len(group.equations)
    start = 0
    stops = sorted({*group.first_equations, total})
    for stop, following in zip(stops, [*stops[1:], total], strict=True):
        if following - start > PART_EQUATIONS and stop > start:
            yield range(start, stop)
            start = stop
        while following - start > PART_EQUATIONS:
            yield range(start, start + PART_EQUATIONS)
            start += PART_EQUATIONS
    yield range(start, total)


def _wires(group: StepGroup, parts: tuple[range, ...]) -> Iterator[int]:
    for part in parts:
        for index in part:
            for operand in operands(group.equations[index].operation):
                if 0 <= operand.value < part.start and not _is_at_hand(group, operand.value):
                    yield operand.value
    # The last part writes feedback, after all parts have read it.
    yield from (item.next.value for item in group.feedback
                if 0 <= item.next.value < parts[-1].start
                and not _is_at_hand(group, item.next.value))


def _is_at_hand(group: StepGroup, value: int) -> bool:
    """Whether every part can read a value itself: an input, a literal, or an exact sum."""
    equation = group.equations[value]
    return isinstance(equation.operation, Read | Literal) or is_exact_sum(equation)


def _is_bit(operation: Operation) -> bool:
    return isinstance(operation, FirstStep | OnceEver | AlwaysSoFar | SinceEver | TriggeredEver) \
        or (isinstance(operation, Delay) and operation.steps == 1)


def _place_bits(group: StepGroup, parts: tuple[range, ...]) -> dict[int, BitSlot]:
    slots: dict[int, BitSlot] = {}
    word = 0
    for number, part in enumerate(parts):
        cells = [i for i in part if _is_bit(group.equations[i].operation)]
        if len(cells) <= FEW_BITS:
            continue
        for position, index in enumerate(cells):
            slots[index] = BitSlot(word + position // 64, position % 64, number)
        word += -(-len(cells) // 64)
    return slots


def _words(group: StepGroup, bits: dict[int, BitSlot]) -> Iterator[StateField]:
    words: dict[int, list[tuple[int, bool]]] = {}
    for index, slot in bits.items():
        is_set = _initial_bit(group.equations[index].operation)
        words.setdefault(slot.word, []).append((slot.bit, is_set))
    for word, content in words.items():
        initial = sum(1 << bit for bit, is_set in content if is_set)
        yield StateField(FieldKind.BITS, word, _holding((1 << len(content)) - 1), 0, initial)


def _flags(group: StepGroup, bits: dict[int, BitSlot]) -> Iterator[StateField]:
    for index, equation in enumerate(group.equations):
        if _is_bit(equation.operation) and index not in bits:
            initial = _initial_bit(equation.operation)
            yield StateField(FieldKind.FLAG, index, ValueType.BOOL, 0, initial)


def _initial_bit(operation: Operation) -> bool:
    match operation:
        case FirstStep() | AlwaysSoFar() | TriggeredEver():
            return True
        case Delay():
            return operation.initial
        case _:
            return False


def _holding(largest: int) -> ValueType:
    """Return the smallest unsigned type that can hold a number."""
    return next(kind for kind in _UNSIGNED if largest <= kind.limits[1])


def _cells(group: StepGroup) -> Iterator[StateField]:
    for index, equation in enumerate(group.equations):
        operation = equation.operation
        match operation:
            case OnceWithin() | AlwaysWithin() | SinceWithin() if group.is_timed:
                head = 0 if isinstance(operation, SinceWithin) else operation.head
                yield StateField(FieldKind.COUNTER, index, ValueType.INT64, 0, head - 1)
            case OnceBefore() | SinceBefore() if group.is_timed:
                yield StateField(FieldKind.COUNTER, index, ValueType.INT64, 0, FM_NEVER)
            case SinceBetween():
                length = QUEUE_HEAD + 2 * (operation.room.capacity or 0)
                yield StateField(FieldKind.QUEUE, index, ValueType.INT64, length)
            case ValueAgo() | Greatest() | Total() | TimeAtLeast():
                yield from _window(index, operation, equation.type)
            case SlopeBetween():
                yield StateField(FieldKind.NUMBER, index, equation.type)
                yield StateField(FieldKind.QUEUE, index, ValueType.INT64, 2)
            case Tally() | Hold():
                yield StateField(FieldKind.NUMBER, index, equation.type)
            case OnceWithin() | AlwaysWithin() | SinceWithin():
                kind = _holding(2 * operation.bound + 1)  # an age saturates at the highest bit
                yield StateField(FieldKind.COUNTER, index, kind, 0, _start(operation))
            case OnceBefore() | SinceBefore():
                yield StateField(FieldKind.COUNTER, index, _holding(operation.bound + 1))
            case PreviousNumber():
                yield StateField(FieldKind.NUMBER, index, equation.type, 0, operation.initial)
            case TrialOutcome():
                yield StateField(FieldKind.COUNTER, index, ValueType.INT64)
            case OutcomesTest():
                yield StateField(FieldKind.QUEUE, index, ValueType.INT64, TEST_WORDS)
                yield StateField(FieldKind.WINDOW, index, ValueType.FLOAT64, TEST_PARTS, 1.0)
            case Delay() if operation.steps > 1:
                yield _line(index, operation)
            case _:
                pass


def _margins(group: StepGroup, margins: Margins) -> Iterator[StateField]:
    """Yield the fields of the margins (see csrc/generated/fret_margins.h)."""
    def some(kind: FieldKind, number: int, count: int = 1) -> StateField:
        return StateField(kind, number, ValueType.FLOAT64, _margin_words(kind) * count)

    def queue(number: int, length: int) -> StateField:
        return StateField(FieldKind.MARGIN_QUEUE, number, ValueType.INT64, length)

    yield StateField(FieldKind.INSTANT, 0, ValueType.INT64)
    yield from (some(FieldKind.MARGIN, number) for number in group.properties)
    yield from (some(FieldKind.MARGIN_NOW, number) for number, _ in margins.occurrences)
    yield from (some(FieldKind.MARGIN_FEEDBACK, number)
                for number, _ in enumerate(margins.feedback))
    for value in sorted({item.value for item in margins.leaves}):
        equation = group.equations[value]
        if not isinstance(equation.operation, Read | Literal):
            yield StateField(FieldKind.LEAF, value, ValueType.BOOL if equation.type is
                             ValueType.BOOL else ValueType.FLOAT64)
    for number, item in enumerate(margins.equations):
        cell = item.operation
        match cell:
            case MarginSince() | Distance():
                yield some(FieldKind.MARGINS, number)
            case MarginAgo(room=None):
                yield from (some(FieldKind.MARGINS, number, cell.steps + 1), queue(number, 1))
            case MarginWithin(room=None):
                yield from (some(FieldKind.MARGINS, number, cell.bound + 1),
                            queue(number, cell.bound + 4))
            case MarginAgo(room=Room(capacity=length)):
                capacity = length or 1
                yield from (some(FieldKind.MARGINS, number, capacity),
                            queue(number, QUEUE_HEAD + capacity))
            case MarginWithin(room=Room(capacity=length)):
                capacity = length or 1
                yield from (some(FieldKind.MARGINS, number, capacity),
                            queue(number, _MARGIN_QUEUE_HEAD + 2 * capacity))
            case _:
                pass


def _window(index: int, cell: ValueAgo | Greatest | Total | TimeAtLeast,
            type: ValueType) -> Iterator[StateField]:
    """Yield the fields of a window of numbers (see csrc/generated/fret_windows.h)."""
    def words(kind: FieldKind, length: int) -> StateField:
        return StateField(kind, index, ValueType.INT64, length)

    if isinstance(cell, Total) and type.is_float:
        yield StateField(FieldKind.SUM, index, ValueType.UINT64, _SUM_LENGTH)
    if isinstance(cell, Greatest):
        yield words(FieldKind.WINDOW, _WINDOW_HEAD + places(cell))
    match cell:
        case Greatest(room=None):
            pass
        case Greatest():
            yield words(FieldKind.QUEUE, QUEUE_HEAD + places(cell))
        case ValueAgo(room=None):
            yield words(FieldKind.QUEUE, _RING_HEAD + cell.past)
        case Total(room=None):
            yield words(FieldKind.QUEUE, _RING_HEAD + cell.past + 1)
        case ValueAgo() | Total() | TimeAtLeast():
            assert cell.room is not None
            yield words(FieldKind.QUEUE, QUEUE_HEAD + 2 * (cell.room.capacity or 0) + 1)


def places(cell: Greatest) -> int:
    """Return the length of the array of a greatest or least number, one more than its numbers."""
    return cell.past + 2 if cell.room is None else (cell.room.capacity or 0) + 1


def _start(cell: OnceWithin | AlwaysWithin | SinceWithin) -> int:
    """Return the initial age of a counter (see csrc/generated/fret_cells.h)."""
    return cell.bound + 1 - (0 if isinstance(cell, SinceWithin) else cell.head)


def _line(index: int, delay: Delay) -> StateField:
    if delay.steps <= SHIFT_REGISTER_BITS:
        ones = (1 << delay.steps) - 1
        return StateField(FieldKind.LINE, index, _holding(ones), 0, ones if delay.initial else 0)
    return StateField(FieldKind.RING, index, ValueType.UINT8, -(-delay.steps // 8),
                      255 if delay.initial else 0)


def _shared(group: StepGroup, parts: tuple[range, ...]) -> Iterator[StateField]:
    for length in ring_lengths(group):
        yield StateField(FieldKind.POSITION, length, _holding(length - 1))
    for number, item in enumerate(group.feedback):
        yield StateField(FieldKind.FEEDBACK, number, item.type)
    for number, operand in group.outputs:
        yield StateField(FieldKind.OUTPUT, number, group.equations[operand.value].type)
    for index in sorted(set(_wires(group, parts))):
        yield StateField(FieldKind.WIRE, index, group.equations[index].type)


def ring_lengths(group: StepGroup) -> list[int]:
    """Return the lengths of a group's delays that are kept in rings, ascending."""
    return sorted({equation.operation.steps for equation in group.equations
                   if isinstance(equation.operation, Delay)
                   and equation.operation.steps > SHIFT_REGISTER_BITS})
