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
Generate the C statements of one part of a group's step.

Each equation becomes a named constant or, if it is small and used once, is inlined in the
expression that uses it. State is in the group's struct `s`; words of packed bits are read at the
start of the part and written at its end. In a group that steps at ticks, `next` is the next tick
at which a value can change although no input does; `unsettled` says that it is the one after this.
"""

from collections.abc import Iterator
from typing import assert_never

from fret_monitor.codegen import c, operations
from fret_monitor.codegen.comments import comment
from fret_monitor.codegen.names import field, Names, SUFFIXES
from fret_monitor.logic.formula import Formula
from fret_monitor.logic.formula import operands as operands_of
from fret_monitor.logic.printing import to_smv
from fret_monitor.model.policies import Policy
from fret_monitor.model.values import ValueType
from fret_monitor.program.layout import (
    FieldKind, GroupLayout, places, ring_lengths, SHIFT_REGISTER_BITS, StateField,
)
from fret_monitor.program.monitor_program import (
    AlwaysSoFar, AlwaysWithin, ApplyBinary, ApplyUnary, Choose, Convert, CounterCell, Delay,
    FeedbackRead, FirstStep, Greatest, Hold, is_exact_sum, lasts_a_tick, Literal,
    MonitorProgram, OnceBefore, OnceEver, OnceWithin, Operand, operands, Operation,
    OutcomesTest, Overflowed, Power, PreviousNumber, Read, Room, Rounded, SinceBefore,
    SinceBetween, SinceEver, SinceWithin, SlopeBetween, Tally, TimeAtLeast, Total,
    TrialOutcome, TriggeredEver, ValueAgo,
)

_INLINE_DEPTH = 4
_INLINE_WIDTH = 60
_SHOWN_FORMULA = 70
_SHOWN_HEIGHT = 16
_TEXT_WIDTH = 600


class PartWriter:
    """Writes the statements of one part of a group's step."""

    def __init__(self, program: MonitorProgram, layout: GroupLayout, part: int,
                 names: Names) -> None:
        """Prepare for part number `part`."""
        self._program = program
        self._layout = layout
        self._group = layout.group
        self._part = part
        self._range = layout.parts[part]
        self._names = names
        self._fields = layout.field_of
        self._definitions = {formula: names.definitions[name]
                             for name, formula in program.definitions}
        self._named = {formula: name for name, formula in reversed(program.definitions)}
        self._values = {signal.name: signal.values for signal in program.signals if signal.values}
        self._inlined: dict[int, c.CExpression] = {}
        self._taken: set[str] = set()
        self._used_here = self._used()

    def _used(self) -> set[int]:
        """Return the values that this part needs."""
        used = {item.value for index in self._range
                for item in operands(self._group.equations[index].operation)}
        if self._is_last:
            used.update(item.next.value for item in self._group.feedback)
        return used.union(self._layout.verdicts_of, self._layout.occurrences_of,
                          self._layout.outputs_of, self._layout.leaves)

    def lines(self) -> Iterator[str]:
        """Yield the statements, indented."""
        words = self._words()
        if self._group.is_timed:
            yield '  int64_t next = FM_NEVER;'
            if self._can_be_unsettled:
                yield '  bool unsettled = false;'
        for word in words:
            name = field(word)
            yield f'  const {word.type.c_name} {name} = s->{name};'
            yield f'  {_wide(word)} next_{word.number} = 0u;'
        yield from self._equations()
        ending = [f'  s->{field(word)} = {_narrow(word, f"next_{word.number}")};'
                  for word in words]
        if self._is_last:
            ending.extend(self._last())
        if self._group.is_timed:
            ending = [*self._unsettled_bits(words), *ending]
            if self._can_be_unsettled:
                ending.append('  fm_lower(&next, unsettled, tick + 1);')
            ending.append('  return next;')
        if ending:
            yield from ('', *ending)

    @property
    def _can_be_unsettled(self) -> bool:
        """Whether a value of this part can differ at the next tick from what it is at this."""
        return (self._is_last and bool(self._group.feedback)) or any(
            lasts_a_tick(self._group.equations[index].operation) for index in self._range)

    def _unsettled_bits(self, words: list[StateField]) -> Iterator[str]:
        for word in words:
            mask = sum(1 << slot.bit for index, slot in self._layout.bits.items()
                       if slot.word == word.number
                       and lasts_a_tick(self._group.equations[index].operation))
            if mask:
                suffix = 'u' if mask < 2 ** 32 else ''
                shown = f'{mask}{suffix}' if suffix else f'UINT64_C({mask})'
                yield f'  unsettled |= (({field(word)} ^ next_{word.number}) & {shown}) != 0u;'

    def _words(self) -> list[StateField]:
        numbers = {slot.word for slot in self._layout.bits.values() if slot.part == self._part}
        return [self._fields[FieldKind.BITS, number] for number in sorted(numbers)]

    def _equations(self) -> Iterator[str]:
        starts = dict(zip(self._group.properties, self._group.first_equations, strict=True))
        pending = [number for number, start in starts.items()
                   if start in self._range or (self._is_last and start == self._range.stop)]
        for index in self._range:
            while pending and starts[pending[0]] <= index:
                yield from self._heading(pending.pop(0))
            yield from self._equation(index)
        for number in pending:
            yield from self._heading(number)
        if self._is_last:
            yield from self._verdicts(-1)

    @property
    def _is_last(self) -> bool:
        return self._part == len(self._layout.parts) - 1

    def _heading(self, number: int) -> Iterator[str]:
        item = self._program.properties[number]
        yield ''
        yield from comment(f'{item.id}: {item.title or item.text}'[:_TEXT_WIDTH], '  ', '', '  ')
        yield from comment(self._shown(item.formula, _TEXT_WIDTH), '  ', '  ', '    ')

    def _shown(self, formula: Formula, limit: int) -> str:
        """Return a formula with the names of values and definitions."""
        names = {term: name for term, name in self._named.items() if term is not formula}
        return to_smv(formula, limit, self._values, names,
                      is_timed=self._program.policy is Policy.TIMED)

    # -- equations ----------------------------------------------------------------------------

    def _equation(self, index: int) -> Iterator[str]:
        if isinstance(self._group.equations[index].operation, Read) \
                and index not in self._used_here:
            return  # each part reads its own inputs
        expression = self._expression(index)
        if is_exact_sum(self._group.equations[index]):
            yield f'  {c.text(expression)};'
        elif self._can_inline(index, expression):
            self._inlined[index] = expression
        else:
            yield from self._constant(index, expression)
        yield from self._after(index)
        yield from self._verdicts(index)

    def _constant(self, index: int, expression: c.CExpression) -> Iterator[str]:
        name = self._local(index)
        equation = self._group.equations[index]
        yield from self._note(index)
        yield f'  const {equation.type.c_name} {name} = {c.text(expression)};'
        self._inlined[index] = c.Atom(name)
        if index in self._layout.wires:
            yield f'  s->wire_{index} = {name};'

    def _note(self, index: int) -> Iterator[str]:
        equation = self._group.equations[index]
        is_plain = isinstance(equation.operation, Read | Literal | Convert)
        if equation.formula is not None and not is_plain and _is_shallow(equation.formula):
            yield from comment(self._shown(equation.formula, _SHOWN_FORMULA), '  ')

    def _can_inline(self, index: int, expression: c.CExpression) -> bool:
        equation = self._group.equations[index]
        if isinstance(equation.operation, Literal):
            return True
        is_pure = isinstance(equation.operation, Read | ApplyUnary | ApplyBinary | Power | Choose)
        is_used_here = self._layout.uses[index] == 1 and index not in self._layout.wires
        # clang warns about `f(x) & g(x)`.
        is_called = equation.type is ValueType.BOOL and c.calls(expression)
        return is_pure and is_used_here and not is_called \
            and equation.formula not in self._definitions \
            and c.depth(expression) <= _INLINE_DEPTH \
            and len(c.text(expression)) <= _INLINE_WIDTH

    def _local(self, index: int) -> str:
        equation = self._group.equations[index]
        wanted = self._wanted(equation.operation, index)
        if equation.formula in self._definitions and not isinstance(equation.operation, Read):
            wanted = self._definitions[equation.formula]
        if wanted in self._taken:
            wanted = f'{wanted}_{index}_'
        self._taken.add(wanted)
        return wanted

    def _wanted(self, operation: Operation, index: int) -> str:
        match operation:
            case Read():
                return self._signal(operation)
            case Convert():
                source = operation.argument.value
                before = self._group.equations[source].operation
                stem = self._signal(before) if isinstance(before, Read) else f'number_{source}'
                return f'{stem}_{SUFFIXES[self._group.equations[index].type]}'
            case _:
                return f'{_stem(operation)}_{index}'

    def _signal(self, operation: Read) -> str:
        return self._names.signals[self._program.signals[operation.signal].name]

    # -- expressions --------------------------------------------------------------------------

    def _operand(self, operand: Operand) -> c.CExpression:
        if operand.is_constant:
            return c.Atom('false' if operand.negated else 'true')
        found = self._inlined.get(operand.value)
        if found is None:
            found = self._from_before(operand.value)
        return c.negate(found) if operand.negated else found

    def _from_before(self, index: int) -> c.CExpression:
        operation = self._group.equations[index].operation
        if isinstance(operation, Literal):
            return c.literal(operation.value, self._group.equations[index].type)
        if isinstance(operation, Read):
            return c.Atom(f'in->{self._signal(operation)}')
        return c.Atom(f's->wire_{index}')

    def _expression(self, index: int) -> c.CExpression:
        equation = self._group.equations[index]
        operation = equation.operation
        match operation:
            case Read():
                return c.Atom(f'in->{self._signal(operation)}')
            case Literal():
                return c.literal(operation.value, equation.type)
            case Convert():
                argument = self._operand(operation.argument)
                return operations.convert(operation, argument, equation.type)
            case ApplyUnary():
                argument = self._operand(operation.argument)
                return operations.unary(operation.operator, argument, equation.type)
            case ApplyBinary():
                left, right = self._operand(operation.left), self._operand(operation.right)
                return operations.binary(operation, left, right)
            case Power():
                return c.Apply(f'fm_power_{SUFFIXES[equation.type]}',
                               (self._operand(operation.base),
                                c.literal(operation.exponent, ValueType.UINT64)))
            case Choose():
                return c.Ternary(self._operand(operation.condition),
                                 self._operand(operation.yes), self._operand(operation.no))
            case FirstStep() | OnceEver() | AlwaysSoFar() | SinceEver() | TriggeredEver():
                return self._bit_cell(operation, index)
            case Delay():
                return self._delay(operation, index)
            case OnceWithin() | AlwaysWithin() | OnceBefore() | SinceWithin() | SinceBefore():
                return self._counter(operation, index)
            case SinceBetween():
                return self._queue(operation, index)
            case Overflowed():
                queue = c.Atom(f's->queue_{operation.argument.value}')
                return c.Apply('fm_overflowed_at', (queue, *_AT))
            case ValueAgo() | Greatest() | Total() | TimeAtLeast():
                return self._window(operation, index)
            case Rounded():
                exact = c.Atom(f's->sum_{operation.total.value}')
                return c.Apply('fm_exact_mean', (exact,)) if operation.is_mean \
                    else c.Apply('fm_exact_quotient', (exact, c.Atom('1u')))
            case SlopeBetween():
                return self._slope(operation, index)
            case Tally():
                return c.Apply('fm_tally', (c.Atom(f'&s->number_{index}'),
                                            *map(self._operand, operands(operation))))
            case Hold():
                return c.Ternary(self._operand(operation.condition),
                                 self._operand(operation.argument),
                                 c.Atom(f's->number_{index}'))
            case TrialOutcome():
                return self._trial(operation, index)
            case OutcomesTest():
                numbers = (c.literal(item, ValueType.FLOAT64)
                           for item in (operation.allowed, operation.rest, operation.limit))
                return c.Apply('fm_tested', (
                    c.Atom(f's->queue_{index}'), c.Atom(f's->window_{index}'), *numbers,
                    self._operand(operation.outcome)))
            case PreviousNumber():
                return c.Atom(f's->number_{index}')
            case FeedbackRead():
                return c.Atom(f's->feedback_{operation.index}')
            case _:
                assert_never(operation)

    def _old_bit(self, index: int) -> c.CExpression:
        if index not in self._layout.bits:
            return c.Atom(f's->flag_{index}')
        slot = self._layout.bits[index]
        return c.Apply('fm_bit', (c.Atom(f'bits_{slot.word}'), c.Atom(f'{slot.bit}u')))

    def _bit_cell(self, operation: Operation, index: int) -> c.CExpression:
        old = self._old_bit(index)
        match operation:
            case OnceEver():
                return c.Operation('|', old, self._operand(operation.argument))
            case AlwaysSoFar():
                return c.Operation('&', old, self._operand(operation.argument))
            case SinceEver():
                kept = c.Operation('&', self._operand(operation.left), old)
                return c.Operation('|', self._operand(operation.right), kept)
            case TriggeredEver():
                freed = c.Operation('|', self._operand(operation.left), old)
                return c.Operation('&', self._operand(operation.right), freed)
            case _:
                return old

    def _delay(self, delay: Delay, index: int) -> c.CExpression:
        argument = self._operand(delay.argument)
        if delay.steps == 1:
            return self._old_bit(index)
        if delay.steps > SHIFT_REGISTER_BITS:
            position = c.Atom(f's->position_{delay.steps}')
            return c.Apply('fm_delay_ring', (c.Atom(f's->ring_{index}'), position, argument))
        suffix = SUFFIXES[self._fields[FieldKind.LINE, index].type]
        return c.Apply(f'fm_delay_{suffix}',
                       (c.Atom(f'&s->line_{index}'), c.Atom(f'{delay.steps}u'), argument))

    def _counter(self, operation: CounterCell, index: int) -> c.CExpression:
        arguments = tuple(self._operand(item) for item in operands(operation))
        if self._group.is_timed:
            state = (c.Atom(f'&s->counter_{index}'), c.Atom(f'INT64_C({operation.bound})'))
            return c.Apply(f'fm_{_COUNTERS[type(operation)]}_at', (*state, *arguments, *_AT))
        suffix = SUFFIXES[self._fields[FieldKind.COUNTER, index].type]
        return c.Apply(f'fm_{_COUNTERS[type(operation)]}_{suffix}',
                       (c.Atom(f'&s->counter_{index}'), c.Atom(f'{operation.bound}u'),
                        *arguments))

    def _queue(self, cell: SinceBetween, index: int) -> c.CExpression:
        numbers = map(_int64, (cell.room.capacity or 0, cell.low, cell.high))
        return c.Apply('fm_since_between_at', (
            c.Atom(f's->queue_{index}'), *numbers, self._operand(cell.left),
            self._operand(cell.right), *_AT))

    def _window(self, cell: ValueAgo | Greatest | Total | TimeAtLeast,
                index: int) -> c.CExpression:
        queue = c.Atom(f's->queue_{index}')
        match cell:
            case Greatest():
                return self._greatest(cell, index)
            case TimeAtLeast():
                return c.Apply('fm_time_over_at', (
                    queue, *map(_int64, (cell.room.capacity or 0, cell.past, cell.least)),
                    self._operand(cell.argument), *_AT))
            case ValueAgo():
                return self._number(index, self._with_room(
                    'fm_ago', (queue,), cell.past, cell.room, (self._word(cell.argument),)))
            case Total():
                is_float = self._group.equations[index].type.is_float
                sums = self._with_room(
                    'fm_exact_sum' if is_float else 'fm_sum',
                    (c.Atom(f's->sum_{index}'), queue) if is_float else (queue,),
                    cell.past + (cell.room is None), cell.room,
                    ((self._operand(cell.at),) if cell.room else ())
                    + (self._word(cell.argument),))
                return sums if is_float else self._number(index, sums)

    def _trial(self, cell: TrialOutcome, index: int) -> c.CExpression:
        due = c.Atom('FM_NEVER') if cell.due is None else _int64(cell.due)
        arguments = (c.Atom(f'&s->counter_{index}'), due, *map(self._operand, operands(cell)))
        return c.Apply('fm_trial_at', (*arguments, *_AT)) if self._group.is_timed \
            else c.Apply('fm_trial', arguments)

    def _slope(self, cell: SlopeBetween, index: int) -> c.CExpression:
        arguments = (c.Atom(f'&s->number_{index}'), c.Atom(f's->queue_{index}'),
                     *map(self._operand, operands(cell)))
        return c.Apply('fm_slope_at', (*arguments, *_AT)) if self._group.is_timed \
            else c.Apply('fm_slope', (*arguments, _int64(cell.step)))

    def _with_room(self, function: str, state: tuple[c.CExpression, ...], past: int,
                   room: Room | None, arguments: tuple[c.CExpression, ...]) -> c.Apply:
        """Return the call of a cell, or of the same one for ticks."""
        if room is None:
            return c.Apply(function, (*state, _int64(past), *arguments))
        return c.Apply(f'{function}_at', (*state, _int64(room.capacity or 0), _int64(past),
                                          *arguments, *_AT))

    def _greatest(self, cell: Greatest, index: int) -> c.CExpression:
        suffix = SUFFIXES[self._group.equations[index].type]
        is_least = c.Atom('true' if cell.is_least else 'false')
        key = c.Apply(f'fm_key_{suffix}', (self._operand(cell.argument), is_least))
        window, length = c.Atom(f's->window_{index}'), _int64(places(cell))
        found = c.Apply('fm_greatest', (window, length, key)) if cell.room is None else c.Apply(
            'fm_greatest_at', (window, c.Atom(f's->queue_{index}'), length, _int64(cell.past), key,
                               *_AT))
        return c.Apply(f'fm_of_key_{suffix}', (found, is_least))

    def _word(self, operand: Operand) -> c.CExpression:
        """Return a number as a word of 64 bits."""
        suffix = SUFFIXES[self._group.equations[operand.value].type]
        return c.Apply(f'fm_word_{suffix}', (self._operand(operand),))

    def _number(self, index: int, word: c.CExpression) -> c.CExpression:
        return c.Apply(f'fm_number_{SUFFIXES[self._group.equations[index].type]}', (word,))

    # -- what follows an equation ---------------------------------------------------------------

    def _after(self, index: int) -> Iterator[str]:
        operation = self._group.equations[index].operation
        if self._group.is_timed and lasts_a_tick(operation) and index not in self._layout.bits:
            yield self._unsettled(index, operation)
        if (FieldKind.FLAG, index) in self._fields:
            yield f'  s->flag_{index} = {c.text(self._next_value(index, operation))};'
        elif index in self._layout.bits and not isinstance(operation, FirstStep):
            yield self._next_bit(index, operation)
        elif isinstance(operation, Hold):
            yield f'  s->number_{index} = {c.text(self._inlined[index])};'
        elif isinstance(operation, PreviousNumber):
            yield f'  s->number_{index} = {c.text(self._operand(operation.argument))};'

    def _unsettled(self, index: int, operation: Operation) -> str:
        if isinstance(operation, PreviousNumber):
            kind, old = self._group.equations[index].type, c.Atom(f's->number_{index}')
            return _unless_same(kind, old, self._operand(operation.argument))
        old = c.Atom(f's->flag_{index}')
        return _unless_same(ValueType.BOOL, old, self._next_value(index, operation))

    def _next_bit(self, index: int, operation: Operation) -> str:
        slot = self._layout.bits[index]
        word = self._fields[FieldKind.BITS, slot.word]
        shown = c.text(c.Cast(_wide(word), self._next_value(index, operation)))
        return f'  next_{slot.word} |= {shown} << {slot.bit};'

    def _next_value(self, index: int, operation: Operation) -> c.CExpression:
        match operation:
            case FirstStep():
                return c.Atom('false')
            case Delay():
                return self._operand(operation.argument)
            case _:
                return self._inlined[index]

    def _verdicts(self, index: int) -> Iterator[str]:
        for number, operand in self._layout.verdicts_of.get(index, ()):
            yield self._verdict(self._names.requirements[number], operand)
        for number, operand in self._layout.occurrences_of.get(index, ()):
            yield self._verdict(self._names.occurrences[number], operand)
        for number, operand in self._layout.outputs_of.get(index, ()):
            yield f'  s->output_{number} = {c.text(self._operand(operand))};'
        if index in self._layout.leaves:
            value = self._inlined[index]
            is_cast = self._group.equations[index].type not in (
                ValueType.BOOL, ValueType.FLOAT64)
            yield f'  s->leaf_{index} = {c.text(c.Cast("double", value) if is_cast else value)};'

    def _verdict(self, place: str, operand: Operand) -> str:
        return f'  verdicts[{place}] = {c.text(self._operand(operand))};'

    def _last(self) -> Iterator[str]:
        for number, item in enumerate(self._group.feedback):
            if self._group.is_timed:
                yield _unless_same(item.type, c.Atom(f's->feedback_{number}'),
                                   self._operand(item.next))
            yield f'  s->feedback_{number} = {c.text(self._operand(item.next))};'
        for length in ring_lengths(self._group):
            place = self._fields[FieldKind.POSITION, length]
            advanced = c.Apply('fm_next_position', (c.Atom(f's->{field(place)}'),
                                                    c.Atom(f'{length}u')))
            shown = c.text(advanced if place.type is ValueType.UINT32
                           else c.Cast(place.type.c_name, advanced))
            yield f'  s->{field(place)} = {shown};'


def _int64(number: int) -> c.CExpression:
    return c.Atom(f'INT64_C({number})')


_AT = (c.Atom('tick'), c.Atom('&next'))
_COUNTERS: dict[type[Operation], str] = {
    OnceWithin: 'once_within', AlwaysWithin: 'always_within', OnceBefore: 'once_before',
    SinceWithin: 'since_within', SinceBefore: 'since_before',
}
_STEMS: dict[type[Operation], str] = {
    **_COUNTERS, FirstStep: 'first', OnceEver: 'once', AlwaysSoFar: 'always', SinceEver: 'since',
    TriggeredEver: 'triggered', PreviousNumber: 'previous', FeedbackRead: 'feedback',
    SinceBetween: 'since_between', Overflowed: 'overflowed', Tally: 'count', Rounded: 'sum',
    ValueAgo: 'ago', Greatest: 'extreme', Total: 'total', TimeAtLeast: 'time_over', Hold: 'held',
    SlopeBetween: 'slope', TrialOutcome: 'trial', OutcomesTest: 'tested',
}


def _stem(operation: Operation) -> str:
    if isinstance(operation, Delay):
        return 'yesterday' if operation.steps == 1 else 'delayed'
    return _STEMS.get(type(operation), 'value')


def _unless_same(kind: ValueType, old: c.CExpression, new: c.CExpression) -> str:
    if kind.is_float:
        differ: c.CExpression = c.negate(c.Apply(f'fm_same_{SUFFIXES[kind]}', (old, new)))
    else:
        differ = c.Operation('!=', old, new)
    return f'  unsettled |= {c.text(differ)};'


def _is_shallow(formula: Formula) -> bool:
    """Whether a formula may fit in a line; reads only the beginning of a large one."""
    level = [formula]
    for _ in range(_SHOWN_HEIGHT):
        level = [item for node in level for item in operands_of(node)][:_SHOWN_FORMULA]
    return not level


def _wide(word: StateField) -> str:
    return 'uint64_t' if word.type is ValueType.UINT64 else 'uint32_t'


def _narrow(word: StateField, value: str) -> str:
    is_wide = word.type in (ValueType.UINT32, ValueType.UINT64)
    return value if is_wide else f'({word.type.c_name}){value}'
