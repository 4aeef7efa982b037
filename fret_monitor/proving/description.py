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
Compare the description that a monitor returns (`struct fm_monitor`) with the program.

The description consists of constant tables in the C text: the offsets of the inputs, the
requirements of each group, and its functions.
"""

from collections.abc import Iterator
from typing import Any

from fret_monitor.model.policies import Policy
from fret_monitor.model.values import ValueType
from fret_monitor.program.layout import FieldKind, GroupLayout, StateField
from fret_monitor.program.monitor_program import MonitorProgram, room_of
from fret_monitor.proving.c_source import (
    ArithmeticType, Array, CProgram, integer, LONG, shown, SIZE, Struct, Type, Unreadable,
)
from fret_monitor.proving.execution import sort_of
from fret_monitor.smt import numbers
from pycparser import c_ast

_EXACT = (FieldKind.FLAG, FieldKind.NUMBER, FieldKind.FEEDBACK, FieldKind.WIRE)
_ESCAPES = {'n': 10, 't': 9, '\\': 92, '"': 34, '?': 63}


def wrong_in_description(code: CProgram, program: MonitorProgram,
                         layouts: tuple[GroupLayout, ...], prefix: str,
                         source_hash: str) -> list[str]:
    """
    Return the errors of the description.

    Raises
    ------
    Unreadable
        if it does not have the form that `compile` writes.
    """
    function = code.functions.get(f'{prefix}_monitor')
    if function is None:
        return ['there is no description']
    tables = {}
    for item in function.body.block_items or ():
        if isinstance(item, c_ast.Decl) and item.storage == ['static']:
            tables[item.name] = _value(item.init, code)
        elif not (isinstance(item, c_ast.Return) and shown(item.expr) == '&monitor'):
            raise Unreadable(f'description: {shown(item)[:80]}')
    wanted = dict(_wanted(code, program, layouts, prefix, source_hash))
    return [f'{name} is {tables.get(name)}, not {value}'[:300]
            for name, value in wanted.items() if tables.get(name) != value]


def occurrence_places(program: MonitorProgram,
                      layouts: tuple[GroupLayout, ...]) -> dict[int, int]:
    """Return the verdicts that only count occurrences, by requirement: after all others."""
    found = sorted(number for layout in layouts for number, _ in layout.group.occurrences)
    return {number: len(program.properties) + place for place, number in enumerate(found)}


def wrong_types_of_inputs(code: CProgram, program: MonitorProgram, prefix: str) -> list[str]:
    """Return the fields of the inputs struct whose type differs from that of the input."""
    fields = code.structs.get(f'{prefix}_inputs', ())
    wrong = [f'{name} is {kind}, not {signal.type.value}'
             for (name, kind), signal in zip(fields, program.signals)
             if not _is(kind, signal.type)]
    if program.signals and len(fields) != len(program.signals):
        wrong.append(f'there are {len(fields)} fields of inputs, not {len(program.signals)}')
    return wrong


def wrong_types_of_state(code: CProgram, layout: GroupLayout, tag: str) -> list[str]:
    """Return the fields of a group's state whose type differs from that of the layout."""
    wanted = {f'{item.kind.value}_{item.number}': item for item in layout.fields}
    return [f'{name}: {shown_type(kind)}, where the program needs {wanted[name].type.value}'
            for name, kind in code.structs.get(tag, ())
            if name in wanted and not _holds(kind, wanted[name])]


def _holds(kind: Type, wanted: StateField) -> bool:
    if wanted.kind is FieldKind.RING:
        return isinstance(kind, Array) and kind.item == ArithmeticType('int', 8)
    if wanted.kind in (FieldKind.QUEUE, FieldKind.WINDOW, FieldKind.SUM):
        item = SIZE if wanted.kind is FieldKind.SUM else LONG
        return kind == Array(item, wanted.length)
    if wanted.kind in _EXACT or wanted.type is ValueType.INT64:
        return _is(kind, wanted.type)
    return isinstance(kind, ArithmeticType) and kind.kind == 'int' and not kind.is_signed


def shown_type(kind: Type) -> str:
    """Return a type as text for a message."""
    return str(kind) if isinstance(kind, ArithmeticType) else type(kind).__name__.lower()


def _is(kind: Any, wanted: Any) -> bool:
    return isinstance(kind, ArithmeticType) and sort_of(kind) == numbers.sort_of(wanted) \
        and (kind.kind != 'int' or kind.is_signed == wanted.is_signed)


def _wanted(code: CProgram, program: MonitorProgram, layouts: tuple[GroupLayout, ...],
            prefix: str, source_hash: str) -> Iterator[tuple[str, Any]]:
    fields = [name for name, _ in code.structs[f'{prefix}_inputs']]
    if program.signals:
        yield 'inputs', [
            [signal.name.encode(), ('offset', f'{prefix}_inputs', fields[place]),
             code.constants[f'FM_{signal.type.name}']]
            for place, signal in enumerate(program.signals)]
    groups = []
    is_timed = program.policy is Policy.TIMED
    for number, layout in enumerate(layouts):
        group = layout.group
        step = f'{prefix}_group_{number}_step'
        reads = ('name', f'inputs_{number}') if group.signals else 0
        if group.signals:
            yield f'inputs_{number}', list(group.signals)
        yield f'requirements_{number}', list(group.properties)
        groups.append([reads, len(group.signals), ('name', f'requirements_{number}'),
                       len(group.properties), ('name', f'{prefix}_group_{number}_reset'),
                       *([0, ('name', f'{step}_at')] if is_timed else [('name', step), 0])])
    yield 'groups', groups
    owner = {index: number for number, layout in enumerate(layouts)
             for index in layout.group.properties}
    yield 'requirements', [[item.id.encode(), owner[place]]
                           for place, item in enumerate(program.properties)]
    more = occurrence_places(program, layouts)
    if more:
        yield 'occurrences', [more.get(place, place)
                              for place, _ in enumerate(program.properties)]
    rooms = (room_of(equation.operation) for layout in layouts
             for equation in layout.group.equations)
    can_overflow = any(room is not None and room.may_overflow for room in rooms)
    step = f'{prefix}_step_any' if len(layouts) > 1 else f'{prefix}_group_0_step'
    yield 'monitor', [
        2, len(program.signals), len(layouts), len(program.properties),
        code.size(Struct(f'{prefix}_state')), code.size(Struct(f'{prefix}_inputs')),
        ('name', 'inputs') if program.signals else 0, ('name', 'groups'),
        ('name', 'requirements'), prefix.encode(), source_hash.encode(),
        0 if is_timed else ('name', step), ('name', 'occurrences') if more else 0, len(more),
        ('name', f'{prefix}_overflows') if can_overflow else 0]


def _value(node: Any, code: CProgram) -> Any:
    """Return the value of a constant initializer: lists, numbers, bytes and names."""
    match node:
        case c_ast.InitList():
            return [_value(item, code) for item in node.exprs]
        case c_ast.Constant(type='string'):
            return _string(node.value)
        case c_ast.Constant():
            return integer(node.value)
        case c_ast.ID(name=name) if name in code.constants:
            return code.constants[name]
        case c_ast.ID(name=name):
            return ('name', name)
        case c_ast.Cast():
            return _value(node.expr, code)
        case c_ast.UnaryOp(op='sizeof'):
            return code.size(Struct(_tag(node.expr)))
        case c_ast.FuncCall(name=c_ast.ID(name='fm_offset')):
            kind, member = node.args.exprs
            return ('offset', _tag(kind.expr), _string(member.value).decode())
        case _:
            raise Unreadable(f'description: {shown(node)[:80]}')


def _tag(node: Any) -> str:
    while not isinstance(node, c_ast.Struct):
        node = getattr(node, 'type', None)
        if node is None:
            raise Unreadable('description: sizeof an expression that is not a struct')
    return str(node.name)


def _string(text: str) -> bytes:
    """Return the bytes of a string literal."""
    found, rest = bytearray(), text[1:-1]
    while rest:
        if rest[0] != '\\':
            found += rest[0].encode()
            rest = rest[1:]
        elif rest[1] in _ESCAPES:
            found.append(_ESCAPES[rest[1]])
            rest = rest[2:]
        else:
            found.append(int(rest[1:4], 8) & 255)
            rest = rest[4:]
    return bytes(found)
