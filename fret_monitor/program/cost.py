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
An upper bound on the instructions of a step of all groups, derived from the program.

An equation costs at most the number in `COSTS` for its kind, for all values and bounds: generated
C has no loops except powers, whose number of rounds is known. The numbers are for x86-64 and gcc
with the flags of `native/compiler.py`. docs/worst_case.md describes how they were found; tests
compare them with counted instructions. `fmod` and `pow` are counted separately, because their cost
depends on the C library.
"""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass

from fret_monitor.logic.formula import BinaryOperator, UnaryOperator
from fret_monitor.model.values import ValueType
from fret_monitor.program.layout import FieldKind, GroupLayout, SHIFT_REGISTER_BITS
from fret_monitor.program.monitor_program import (
    AlwaysWithin, ApplyBinary, ApplyUnary, Choose, Convert, Delay, Equation, FeedbackRead,
    Greatest, Hold, lasts_a_tick, Literal, OnceBefore, OnceWithin, OutcomesTest, Overflowed,
    Power, PreviousNumber, Read, Rounded, SinceBefore, SinceBetween, SinceWithin, SlopeBetween,
    Tally, TimeAtLeast, Total, TrialOutcome, ValueAgo,
)

COSTS = {
    # Overhead of functions: saving registers, passing arguments, calls, returns.
    'step': 27, 'group': 4, 'part': 27, 'verdict': 3,
    'input, Boolean': 3, 'input, integer': 3, 'input, float': 3,
    'literal, integer': 2, 'literal, float': 2,
    'use': 2,  # each further use of a value: it may have to be saved and loaded
    'conversion, to integer': 3, 'conversion, to float': 4, 'conversion, uint64 to float': 13,
    'connective': 3,
    'relation, integer': 4, 'relation, float': 5, 'relation, int64 with uint64': 7,
    '+ - *, integer': 3, '+ - *, float': 3,
    'div mod, integer': 11, 'div mod, float': 3,
    'minus, integer': 3, 'minus, float': 3,
    'abs, integer': 5, 'abs, float': 5,
    'min max, integer': 4, 'min max, float': 5,
    'power, integer': 4, 'power, float': 4,
    'power round, integer': 6, 'power round, float': 6,
    'choice, Boolean': 5, 'choice, integer': 5, 'choice, float': 6,
    'call of fmod': 7, 'call of pow': 7, 'call of mathematics': 7,
    'bit': 5, 'packed bit': 6, 'word of packed bits': 4,
    'counter, O H [0,b]': 12, 'counter, S T [0,b]': 16,
    'counter, O H [a,inf)': 15, 'counter, S T [a,inf)': 18,
    # Under `timed`, a cell also says when its value can change.
    'tick': 20, 'settling': 5, 'counter, at ticks': 36, 'queue': 110, 'overflow of a queue': 9,
    'delay, word': 11, 'delay, ring': 19, 'position of rings': 16,
    'pre, Boolean': 5, 'pre, integer': 4, 'pre, float': 4,
    'feedback': 3, 'wire': 3,
    'number ago': 60, 'greatest': 160, 'sum': 70, 'exact sum': 1300, 'rounded sum': 100,
    'mean': 200, 'time over': 120, 'slope': 20, 'count': 8, 'trial': 40, 'test': 160,
}
# Inside the functions of the C library, for glibc 2.36, whose fmod divides bit by bit.
LIBRARY_COSTS = {'fmod, float32': 3_000, 'fmod, float64': 20_000, 'pow': 500,
                 'mathematics': 2_000}

_BLOCK = 300  # equations assumed per function; codegen makes larger functions


@dataclass(frozen=True)
class Cost:
    """Upper bounds on the instructions of a step: in generated code, and in the C library."""

    own: int
    library: int


def step_cost(layouts: tuple[GroupLayout, ...]) -> Cost:
    """Return an upper bound on the instructions of a step of all groups."""
    found = kinds(layouts)
    library = sum(LIBRARY_COSTS[kind] * found.pop(kind, 0) for kind in LIBRARY_COSTS)
    return Cost(sum(COSTS[kind] * count for kind, count in found.items()), library)


def kinds(layouts: tuple[GroupLayout, ...]) -> Counter[str]:
    """Count the operations of a step of all groups, by kind."""
    equations = sum(len(layout.group.equations) for layout in layouts)
    found: Counter[str] = Counter({'step': 1 + equations // _BLOCK})
    for layout in layouts:
        found['group'] += 1
        if len(layout.parts) > 1:
            found['part'] += len(layout.parts)
        found['wire'] += len(layout.wires)
        found['verdict'] += len(layout.group.verdicts) + len(layout.group.occurrences)
        if layout.group.is_timed:
            found['tick'] += len(layout.parts)
            found['settling'] += len(layout.group.feedback)
        found['feedback'] += len(layout.group.feedback)
        fields = Counter(item.kind for item in layout.fields)
        found['word of packed bits'] += fields[FieldKind.BITS]
        found['position of rings'] += fields[FieldKind.POSITION]
        for index, equation in enumerate(layout.group.equations):
            for name, count in _kinds(equation, index in layout.bits):
                found[_at_ticks(name) if layout.group.is_timed else name] += count
            if layout.group.is_timed and lasts_a_tick(equation.operation):
                found['settling'] += 1
            found['use'] += max(0, layout.uses[index] - 1)
    return found


def _at_ticks(kind: str) -> str:
    return 'counter, at ticks' if kind.startswith('counter, ') else kind


def _kinds(equation: Equation, is_packed: bool) -> Iterator[tuple[str, int]]:
    operation, kind = equation.operation, equation.type
    family = 'float' if kind.is_float else 'Boolean' if kind is ValueType.BOOL else 'integer'
    match operation:
        case Read():
            yield f'input, {family}', 1
        case Literal():
            yield f'literal, {family}', 1
        case Convert():
            source = operation.source
            if source is ValueType.UINT64 and kind.is_float:
                yield 'conversion, uint64 to float', 1
            elif kind.is_float:
                yield 'conversion, to float', 1
            else:
                yield 'conversion, to integer', 1
        case ApplyUnary() if operation.operator.is_library:
            yield from (('call of mathematics', 1), ('mathematics', 1))
        case ApplyUnary():
            yield f'{"abs" if operation.operator is UnaryOperator.ABS else "minus"}, {family}', 1
        case ApplyBinary():
            yield from ((item, 1) for item in _binary(operation))
        case Power():
            yield f'power, {family}', 1
            yield f'power round, {family}', operation.exponent.bit_length()
        case Choose():
            yield f'choice, {family}', 1
        case Delay() if operation.steps == 1:
            yield ('packed bit' if is_packed else 'bit'), 1
        case Delay():
            yield ('delay, ring' if operation.steps > SHIFT_REGISTER_BITS else 'delay, word'), 1
        case OnceWithin() | AlwaysWithin():
            yield 'counter, O H [0,b]', 1
        case SinceWithin():
            yield 'counter, S T [0,b]', 1
        case OnceBefore():
            yield 'counter, O H [a,inf)', 1
        case SinceBefore():
            yield 'counter, S T [a,inf)', 1
        case SinceBetween():
            yield 'queue', 1
        case Overflowed():
            yield 'overflow of a queue', 1
        case ValueAgo():
            yield 'number ago', 1
        case Greatest():
            yield 'greatest', 1
        case Total():
            yield 'exact sum' if kind.is_float else 'sum', 1
        case Rounded():
            yield 'mean' if operation.is_mean else 'rounded sum', 1
        case SlopeBetween():
            yield 'slope', 1
        case TimeAtLeast():
            yield 'time over', 1
        case Tally() | Hold():
            yield 'count', 1
        case TrialOutcome():
            yield 'trial', 1
        case OutcomesTest():
            yield 'test', 1
        case PreviousNumber() | FeedbackRead():
            yield f'pre, {family}', 1
        case _:
            yield ('packed bit' if is_packed else 'bit'), 1


def _binary(operation: ApplyBinary) -> Iterator[str]:
    operator, types = operation.operator, operation.types
    family = 'float' if types[0].is_float else 'integer'
    if operator.is_boolean or (operator.is_relation and types[0] is ValueType.BOOL):
        yield 'connective'
    elif operator.is_relation:
        yield f'relation, {family}' if types[0] is types[1] else 'relation, int64 with uint64'
    elif operator is BinaryOperator.POW:
        yield from ('call of pow', 'pow')
    elif operator is BinaryOperator.ATAN2:
        yield from ('call of mathematics', 'mathematics')
    elif operator is BinaryOperator.MOD and types[0].is_float:
        yield from ('call of fmod', f'fmod, {types[0].value}')
    elif operator in (BinaryOperator.DIV, BinaryOperator.MOD):
        yield f'div mod, {family}'
    elif operator in (BinaryOperator.MIN, BinaryOperator.MAX):
        yield f'min max, {family}'
    else:
        yield f'+ - *, {family}'
