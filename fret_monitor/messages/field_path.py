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
Field paths: the part of a message that an input reads.

A path such as `pose.position.z`, `ranges[3]` or `status[name = imu].level` leads to a scalar; a
time, such as `header.stamp`, is read in seconds. A reduction such as `max(ranges[:90])` or
`norm(velocity)` computes one value from an array, a part of one, or a message. `received()` is
true at the step of a message, and `age(header.stamp)` is the seconds between a stamp in the
message and its reception. `resolve_field` returns the steps of the path and the type of the value.
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
import re
from typing import NoReturn

from fret_monitor.messages.constants import constants_of, FieldConstants, NO_CONSTANTS
from fret_monitor.messages.installed import check_complete, listed, nested_layout
from fret_monitor.messages.layout import ArrayKind, FieldType, MessageField, MessageLayout
from fret_monitor.messages.path_parts import doubt_sector, read_part
from fret_monitor.model.diagnostics import (
    CompileError, Diagnostic, did_you_mean, Level, refuse, Span, suggestion, Text,
)
from fret_monitor.model.manifest import ANGLES, REDUCTIONS, SECONDS
from fret_monitor.model.names import index_fault, shown
from fret_monitor.model.paths import (
    ArrayPart, FieldPath, LookUp, name_as_written, Sector, Slice, Step,
)
from fret_monitor.model.policies import InputSource
from fret_monitor.model.times import NANOSECONDS
from fret_monitor.model.values import ValueType

_STRINGS = ('string', 'wstring')
_INTEGERS = ('byte', 'char', *(kind.value for kind in ValueType if kind.is_integer))
_TIME = 'builtin_interfaces/msg/Time'
_TIMES = (_TIME, 'builtin_interfaces/msg/Duration')
_RECEIVED = InputSource.RECEIVED.value
_AGE = InputSource.AGE.value
_RATE = InputSource.RATE.value
_PERIOD = InputSource.PERIOD.value
_FUNCTIONS = (*REDUCTIONS, _RECEIVED, _AGE, _RATE, _PERIOD)
_TIME_SPAN = re.compile(r'(?P<number>-?[0-9]+(?:\.[0-9]+)?)\s*(?P<unit>[a-z]*)')
_OTHER_WORDS = {
    'avg': 'mean', 'average': 'mean', 'length': 'len', 'size': 'len', 'count': 'len',
    'minimum': 'min', 'maximum': 'max', 'magnitude': 'norm', 'hypot': 'norm',
}
_MAX_LISTED = 12
_LONGEST_WINDOW_NS = 24 * NANOSECONDS['h']
_MAX_DEPTH = 8
_MAX_INDEX = 2 ** 31 - 1

_STEP = re.compile(r'(?P<name>[A-Za-z][A-Za-z0-9_]*)'
                   r'(?P<part>\[(?P<inside>(?:"(?:[^"\\]|\\.)*"|[^]["])*)\])?')
_OPEN_INDEX = re.compile(r'(.*\[[0-9]+)[^].[]*')
_KEY_BEFORE = re.compile(r"""([A-Za-z_]\w*)[ \t]*:[ \t]+["']?\s*(?:\w+\s*\(\s*)?$""")
_NAME_INSIDE = re.compile(r"""\s*(["']?)(?P<name>[A-Za-z_][\w./ -]*)\1\s*""")
_NUMBERS_INSIDE = re.compile(r'\s*(-?[0-9]+)\s*(?:,|\.\.+|;|-)\s*(-?[0-9]+)\s*')
_ANGLES_INSIDE = re.compile(
    r'\s*(-?[0-9.]+?)\s*(deg|rad)?\s*(?:,|\.\.+|;|:|-|to)\s*(-?[0-9.]+)\s*(deg|rad)\s*')
_CALL = re.compile(r'\s*(?P<function>[A-Za-z_][A-Za-z0-9_]*)\s*\(\s*(?P<path>.*?)\s*\)\s*')

_USUAL_KEYS = ('name', 'child_frame_id', 'frame_id')

_OF_NUMBERS = ('len', 'min', 'max', 'sum', 'mean', 'norm')
_OF_TRUTHS = ('len', 'any', 'all')
_OF_OTHERS = ('len',)
_XYZW = {(name, True) for name in 'xyzw'}
_OF_QUATERNIONS = ('norm', *ANGLES)

SCAN_ANGLES = ('angle_min', 'angle_increment')
"""The fields of a message that give the directions of the elements of its arrays."""


@dataclass(frozen=True)
class ResolvedField:
    """
    Where a field path leads, and what is taken there.

    `path` is as in `model.paths`; `type_name` is the type of the value, with `byte` and `char` as
    `uint8`; `types` are the types of the fields on the way, one for each name in the path.
    `reduction` and `source` are as in `ManifestInput`; `constants` are those that may name the
    value.
    """

    path: FieldPath
    type_name: str
    types: tuple[FieldType, ...]
    reduction: str = ''
    source: InputSource = InputSource.FIELD
    constants: FieldConstants = NO_CONSTANTS
    window: int = 0


@dataclass(frozen=True)
class _End:
    """Where a path ends: in which message, and whether at one element of its array."""

    path: FieldPath
    types: tuple[FieldType, ...]
    inside: MessageLayout

    @property
    def type(self) -> FieldType:
        kind = self.types[-1]
        is_element = isinstance(self.path[-1], int | LookUp)
        return FieldType(kind.base, text_limit=kind.text_limit) if is_element else kind

    @property
    def is_array(self) -> bool:
        return self.type.array is not ArrayKind.NONE

    @property
    def is_time(self) -> bool:
        return self.type.base in _TIMES and not self.is_array


def resolve_field(layout: MessageLayout, path_text: Text | None,
                  type_text: Text) -> ResolvedField:
    """
    Follow a field path into a message, to the value at its end.

    `path_text` may be None where the message has one field; `type_text` is where the type is
    named, for the error.

    Raises
    ------
    CompileError
        if there is no such field, or it is not a value; the error lists the fields.
    """
    if path_text is None:
        return _only_field(layout, type_text)
    fault = index_fault(path_text.value)
    if fault is not None:
        refuse(fault.reason, path_text.span, 'not supported', fault.help)
    call = _CALL.fullmatch(path_text.value) if '(' in path_text.value else None
    if call is not None:
        return _reduced(layout, path_text, call)
    end = _follow(layout, path_text)
    if end.is_array:
        _refuse_array(end, path_text)
    if end.type.is_message and not end.is_time:
        _refuse_message(end, path_text)
    return _resolved(end)


def doubt_part(layout: MessageLayout, field: ResolvedField,
               path_text: Text | None) -> Diagnostic | None:
    """Return a warning if the part of an array that a field takes may not be what was meant."""
    part = field.path[-1] if field.path else None
    if path_text is None or not isinstance(part, Slice | Sector):
        return None
    start, stop = path_text.value.rindex('[') + 1, path_text.value.rindex(']')
    inside = Text(path_text.value[start:stop], path_text.source, path_text.offsets[start:stop + 1])
    if isinstance(part, Sector):
        return doubt_sector(inside)
    if field.types[-1].array is ArrayKind.FIXED or (part.start or 0) >= 0 or (part.stop or 0) <= 0:
        return None
    assert part.start is not None and part.stop is not None
    has_angles = all(layout.find_field(name) for name in SCAN_ANGLES)
    sector = f'{path_text.value[:start]}{part.start} deg : {part.stop} deg{path_text.value[stop:]}'
    return Diagnostic(
        f'{part.start} counts from the end: this slice is empty in every message of '
        f'{part.stop - part.start} elements or more', inside.span,
        'a number without a unit is an index',
        field_line([sector] if has_angles else [], path_text), Level.WARNING)


def _follow(layout: MessageLayout, path_text: Text, function: str = '') -> _End:
    """Follow a path; `function` is of what it leads to, for the lines to paste."""
    path: FieldPath = ()
    types: list[FieldType] = []
    inside = layout
    steps = list(_steps(path_text, layout, function))
    for number, (match, part) in enumerate(steps, start=1):
        if types:
            inside = _inside(inside, types[-1], path_text, match)
        kind, taken = _step(inside, match, part, path_text, is_last=number == len(steps))
        types.append(kind)
        path += taken
    return _End(path, tuple(types), inside)


def _resolved(end: _End) -> ResolvedField:
    if end.is_time:
        return ResolvedField(end.path, 'float64', end.types, SECONDS)
    base = end.type.base
    type_name = base if base in _STRINGS else ValueType.of_field(base).value
    name = next(step for step in reversed(end.path) if isinstance(step, str))
    item = end.inside.find_field(name)
    assert item is not None, name
    return ResolvedField(end.path, type_name, end.types, constants=constants_of(end.inside, item))


def _reduced(layout: MessageLayout, text: Text, call: re.Match[str]) -> ResolvedField:
    """Resolve a reduction: a function of what its path leads to."""
    start, stop = call.span('path')
    path_text = Text(text.value[start:stop], text.source, text.offsets[start:stop + 1])
    function, place = call['function'], text.at(*call.span('function'))
    if function not in _FUNCTIONS:
        _refuse_unknown_function(function, place)
    if function in (_RECEIVED, _PERIOD):
        return _without_field(path_text, function)
    if function == _RATE:
        return _rate(path_text, text)
    if not path_text.value:
        refuse(f"'{function}' needs a field", text.span, 'no field is given',
               field_line([f'{function}({path})' for path in _paths_for(layout, function)], text))
    end = _follow(layout, path_text, function)
    if function == _AGE and _has_age(end):
        return ResolvedField(end.path, 'float64', end.types, SECONDS, InputSource.AGE)
    if function not in _functions(end):
        _refuse_function(layout, end, path_text, function, place)
    return ResolvedField(end.path, _type_of(function, end.type.base), end.types, function)


def _refuse_unknown_function(function: str, place: Span) -> NoReturn:
    meant = _OTHER_WORDS.get(function.lower())
    refuse(f'{shown(function)} is not a function of a field', place, 'unknown function',
           suggestion([meant]) if meant else
           did_you_mean(function, _FUNCTIONS) or 'one of ' + ', '.join(_FUNCTIONS))


def _without_field(path_text: Text, function: str) -> ResolvedField:
    if path_text.value:
        refuse(f"'{function}' takes no field", path_text.span, 'remove this',
               field_line([f'{function}()']))
    return ResolvedField((), 'bool' if function == _RECEIVED else 'float64', (),
                         source=InputSource(function))


def _rate(span_text: Text, text: Text) -> ResolvedField:
    """Resolve a rate, of which the argument is the length of the window."""
    found = _TIME_SPAN.fullmatch(span_text.value)
    line = field_line(['rate(5 s)'], text)
    if found is None or found['unit'] not in NANOSECONDS:
        refuse("'rate' takes a time: that in which messages are counted",
               span_text.span if span_text.value else text.span,
               'this is no time' if span_text.value else 'no time is given', line)
    window = Fraction(found['number']) * NANOSECONDS[found['unit']]
    if window <= 0:
        refuse("'rate' takes a time that is longer than 0", span_text.span,
               f'this is {found[0]}', line)
    if window.denominator != 1 or window > _LONGEST_WINDOW_NS:
        refuse("'rate' takes a whole number of nanoseconds, up to a day", span_text.span,
               f'this is {found[0]}', line)
    return ResolvedField((), 'float64', (), source=InputSource.RATE, window=int(window))


def _has_age(end: _End) -> bool:
    """Whether a path leads to a stamp."""
    return end.type.base == _TIME and not end.is_array


def _type_of(function: str, base: str) -> str:
    """Return the type of a reduction of elements of a type."""
    match function:
        case 'len':
            return 'uint32'
        case 'min' | 'max':
            return ValueType.of_field(base).value
        case 'any' | 'all':
            return 'bool'
        case 'sum' if base.startswith('int'):
            return 'int64'
        case 'sum' if not base.startswith('float'):
            return 'uint64'
        case _:
            return 'float64'


def _functions(end: _End) -> tuple[str, ...]:
    """Return the reductions of what stands at the end of a path."""
    kind = end.type
    if kind.base in _STRINGS or end.is_array and kind.is_message:
        return _OF_OTHERS
    if end.is_array:
        return _OF_TRUTHS if kind.base == 'bool' else _OF_NUMBERS
    if kind.is_message and not end.is_time:
        inner = nested_layout(end.inside, kind)
        if {(item.name, item.type.base.startswith('float')) for item in inner.fields} == _XYZW:
            return _OF_QUATERNIONS
        return ('norm',) if inner.fields and all(map(_is_number, inner.fields)) else ()
    return ()


def _is_number(item: MessageField) -> bool:
    kind = item.type
    return kind.array is ArrayKind.NONE and not kind.is_message \
        and kind.base not in ('bool', *_STRINGS)


def _refuse_function(layout: MessageLayout, end: _End, path_text: Text, function: str,
                     place: Span) -> NoReturn:
    there = _functions(end)
    written = path_text.value
    use = [f'{function}({path})' for path in _siblings(end, written, function)] \
        or [f'{name}({written})' for name in there]
    if not end.is_array and (end.is_time or not end.type.is_message):
        use.insert(0, written)
    refuse(f"'{function}' does not apply to {_named(end, written)}", place,
           'not a function of this type',
           field_line(
               use or [f'{function}({path})' for path in _paths_for(layout, function)]
               or [f'{written}.{path}' for path in
                   _leaf_paths(nested_layout(end.inside, end.type))], path_text))


def _siblings(end: _End, written: str, function: str) -> list[str]:
    """Return the quaternions beside a message that has no angles."""
    before, dot, _ = written.rpartition('.')
    if function not in ANGLES or not end.type.is_message or end.is_array:
        return []
    try:
        return [f'{before}{dot}{item.name}' for item in end.inside.fields
                if function in _functions(_End((item.name,), (item.type,), end.inside))]
    except CompileError:
        return []  # not installed: this is only a hint


def _paths_for(layout: MessageLayout, function: str) -> list[str]:
    """Return the first paths of which there is a reduction."""
    found = []
    for prefix, inside in _levels(layout):
        for item in inside.fields:
            end = _End((item.name,), (item.type,), inside)
            try:
                if function in _functions(end) or function == _AGE and _has_age(end):
                    found.append(prefix + item.name)
            except CompileError:
                continue  # not installed: this is only a hint
    return found


def _only_field(layout: MessageLayout, type_text: Text) -> ResolvedField:
    paths = _leaf_paths(layout)
    if len(layout.fields) != 1:
        refuse(f'{layout.name} has {len(layout.fields) or "no"} fields', type_text.span,
               'name one of them' if layout.fields else 'there is nothing to read',
               field_line(paths))
    only = layout.fields[0]
    end = _End((only.name,), (only.type,), layout)
    if end.is_array or only.type.is_message and not end.is_time:
        functions = [f'{name}({only.name})' for name in _functions(end)]
        refuse(f"the one field of {layout.name}, '{only.name}', is {_kind(only.type)}",
               type_text.span, 'which part of it?', field_line([*paths, *functions]))
    return _resolved(end)


def _steps(path_text: Text, layout: MessageLayout,
           function: str) -> Iterator[tuple[re.Match[str], ArrayPart | None]]:
    """Yield name and part of each step of a path."""
    place = 0
    while True:
        match = _STEP.match(path_text.value, place)
        end = match.end() if match else place
        part = _part(match, path_text, function) if match and match['part'] else None
        if match is not None and match['part'] and part is None:
            _refuse_part(layout, match, path_text, function)
        if match is None or path_text.value[end:end + 1] not in ('', '.'):
            rest = path_text.at(min(end, max(len(path_text.value) - 1, 0)), len(path_text.value))
            paths = _leaf_paths(layout)
            mended = _mended(path_text.value, paths)
            refuse(f'{shown(path_text.value)} is not a field path', rest,
                   'expected names with dots between them, and indices from 0',
                   field_line([mended] if mended else paths, path_text))
        yield match, part
        if end == len(path_text.value):
            return
        place = end + 1


def _mended(path: str, paths: Collection[str]) -> str:
    """
    Return a path without the quotes around it, with points, or with its index closed.

    Return '' for others. `paths` are those of the message.
    """
    if (dotted := path.strip('/').replace('/', '.')) in paths:
        return dotted
    if len(path) > 2 and path[0] == path[-1] and path[0] in '"\'':
        return path[1:-1]
    is_open = _OPEN_INDEX.fullmatch(path)
    return f'{is_open[1]}]' if is_open else ''


def _part(match: re.Match[str], path_text: Text, function: str) -> ArrayPart | None:
    """Read the part of an array in the brackets of a step."""
    return read_part(_part_text(match, path_text), lambda inside: field_line(
        [_called(function, _with_inside(match, path_text, inside))], path_text))


def _with_inside(match: re.Match[str], path_text: Text, inside: str) -> str:
    """Return a path with another text between the brackets of a step."""
    path = path_text.value
    return f'{path[:match.start("inside")]}{inside}{path[match.end("inside"):]}'


def _called(function: str, path: str) -> str:
    return f'{function}({path})' if function else path


def _refuse_part(layout: MessageLayout, match: re.Match[str], path_text: Text,
                 function: str) -> NoReturn:
    """Refuse brackets that cannot be read; help with the part that was meant."""
    before, inside = path_text.value[:match.start('part')], match['inside']
    name, numbers = _NAME_INSIDE.fullmatch(inside), _NUMBERS_INSIDE.fullmatch(inside)
    angles, keys = _ANGLES_INSIDE.fullmatch(inside), _keys_at(layout, before)
    meant = '0'
    if name is not None and keys:
        meant = f'{[*_usual_keys(keys), *keys][0]} = {name_as_written(name["name"].strip())}'
    elif numbers is not None:
        meant = f'{numbers[1]}:{numbers[2]}'
    elif angles is not None:
        meant = f'{angles[1]} {angles[2] or angles[4]} : {angles[3]} {angles[4]}'
    path = _with_inside(match, path_text, meant)
    functions = [function] if function or numbers is None else _OF_NUMBERS[1:]
    refuse(f'{shown(path_text.value)} is not a field path',
           path_text.at(*match.span('part')),
           'expected an index, a slice, angles, or a name to look up',
           '' if name is not None and not keys else
           field_line([_called(item, path) for item in functions], path_text))


def _inside(layout: MessageLayout, kind: FieldType, path_text: Text,
            match: re.Match[str]) -> MessageLayout:
    if not kind.is_message:
        refuse(f'{shown(path_text.value[:match.start() - 1])} is {_kind(kind)}, '
               'which has no fields',
               path_text.at(match.start() - 1, len(path_text.value)), 'remove this')
    return nested_layout(layout, kind, path_text.at(0, match.start() - 1))


def _step(layout: MessageLayout, match: re.Match[str], part: ArrayPart | None, path_text: Text,
          *, is_last: bool) -> tuple[FieldType, FieldPath]:
    """Look up one step of a path, and check what is taken of an array."""
    found = layout.find_field(match['name'])
    place = path_text.at(match.start('name'), match.end('name'))
    if found is None:
        _refuse_field(layout, match, path_text, place)
    kind = found.type
    if part is None:
        if kind.array is not ArrayKind.NONE and not is_last:
            refuse(f"'{found.name}' is {_kind(kind)}", place, 'which element?',
                   field_line(_elements(layout, found, path_text, match), path_text))
        return kind, (found.name,)
    place = path_text.at(*match.span('part'))
    if kind.array is ArrayKind.NONE:
        refuse(f"'{match['name']}' is {_kind(kind)}, not an array", place, 'remove this')
    if isinstance(part, Slice | Sector) and not is_last:
        before, after = path_text.value[:match.start('part')], path_text.value[match.end():]
        refuse('a part of an array has no fields', place, 'which element?',
               field_line([f'{before}[0]{after}'], path_text))
    match part:
        case int():
            _check_index(kind, part, match, place)
        case Slice():
            _check_slice(kind, part, match, place)
        case Sector():
            _check_sector(layout, kind, match, place)
        case LookUp():
            part = _look_up(layout, found, part, _part_text(match, path_text))
    return kind, (found.name, part)


def _elements(layout: MessageLayout, found: MessageField, path_text: Text,
              match: re.Match[str]) -> list[str]:
    """Return paths with an element of an array that is written without brackets."""
    before, after = path_text.value[:match.end()], path_text.value[match.end():]
    keys = _keys(layout, found)
    names = _usual_keys(keys)[:1]
    word, dot, rest = after[1:].partition('.')
    if names and found.type.is_message \
            and not nested_layout(layout, found.type).find_field(word):  # `status.motor.level`
        return [f'{before}[{names[0]} = {name_as_written(word)}]{dot}{rest}']
    if keys and not found.type.is_message:  # `position.elbow_joint`
        return [f'{before}[{[*names, *keys][0]} = {name_as_written(after[1:])}]']
    return [*(f'{before}[{name} = NAME]{after}' for name in names), f'{before}[0]{after}']


def _keys(layout: MessageLayout, found: MessageField) -> list[str]:
    """Return the strings by which elements of an array can be looked up."""
    keys = [item.name for item in layout.fields if item.type.base == 'string'
            and item.type.array is not ArrayKind.NONE and item is not found]
    if found.type.is_message:
        inner = nested_layout(layout, found.type)
        keys += [path for path in _leaf_paths(inner) if '[' not in path
                 and (of := key_type(inner, tuple(path.split('.')))) and of.base == 'string']
    return keys


def _usual_keys(keys: Sequence[str]) -> list[str]:
    return [key for key in _USUAL_KEYS if key in keys]


def _keys_at(layout: MessageLayout, path: str) -> list[str]:
    """Return the strings by which elements of the array at a path can be looked up."""
    *steps, last = (match['name'] for match in _STEP.finditer(path))
    try:
        for name in steps:
            item = layout.find_field(name)
            if item is None or not item.type.is_message:
                return []
            layout = nested_layout(layout, item.type)
        found = layout.find_field(last)
        return _keys(layout, found) if found and found.type.array is not ArrayKind.NONE else []
    except CompileError:
        return []  # not installed: this is only a hint


def _part_text(match: re.Match[str], path_text: Text) -> Text:
    start, stop = match.span('inside')
    return Text(path_text.value[start:stop], path_text.source, path_text.offsets[start:stop + 1])


def _check_index(kind: FieldType, index: int, match: re.Match[str], place: Span) -> None:
    limit = _limit(kind) - 1
    if index > limit:
        refuse(f"'{match['name']}' is {_kind(kind)}: it has no element "
               f"{shown(match['inside'].strip().lstrip('0'))[1:-1]}", place,
               f'the last element is {limit}')


def _limit(kind: FieldType) -> int:
    """Return the largest length of an array."""
    return _MAX_INDEX + 1 if kind.size is None else kind.size


def _check_slice(kind: FieldType, part: Slice, match: re.Match[str], place: Span) -> None:
    """Refuse a slice that is empty or beyond the array in every message."""
    limit = _limit(kind)
    start, stop = part.start or 0, limit if part.stop is None else part.stop
    if max(start, -start, stop, -stop) > limit:
        refuse(f"'{match['name']}' is {_kind(kind)}: it has no part [{part}]", place,
               f'it has at most {limit} elements' if kind.array is not ArrayKind.FIXED
               else f'it has {limit} elements')
    is_length_known = kind.array is ArrayKind.FIXED or part.stop is None or stop < 0
    first = max(start, 0) if start >= 0 or not is_length_known else start + limit
    end = stop + limit if stop < 0 else stop
    if first >= end:
        is_turned = end < first and (start < 0) == (stop < 0)
        refuse(f'the slice is {"reversed" if is_turned else "empty"}', place,
               'the start is included, the stop is not',
               f'write [{part.stop}:{part.start}]' if is_turned else '')


def _check_sector(layout: MessageLayout, kind: FieldType, match: re.Match[str],
                  place: Span) -> None:
    """Check that the directions of an array's elements are known: as those of a LaserScan."""
    for name in SCAN_ANGLES:
        found = layout.find_field(name)
        if found is None or found.type.base not in ('float32', 'float64') \
                or found.type.array is not ArrayKind.NONE:
            refuse(f"the directions of '{match['name']}' are not known", place,
                   f"{layout.name} has no float field '{name}'",
                   f'without {" and ".join(SCAN_ANGLES)}, take elements by index, '
                   f"as in {match['name']}[0:10]")
    if kind.is_message or kind.base in _STRINGS:
        refuse(f"'{match['name']}' is {_kind(kind)}", place, 'sectors are of arrays of numbers')


def _look_up(layout: MessageLayout, found: MessageField, part: LookUp, text: Text) -> LookUp:
    """Find the strings that a look-up compares: in the elements, or in an array beside them."""
    start = len(text.value) - len(text.value.lstrip())
    place = text.at(start, start + len('.'.join(part.key)))
    inner = nested_layout(layout, found.type, place) if found.type.is_message else None
    if inner is not None and inner.find_field(part.key[0]):
        _check_key(layout, found, key_type(inner, part.key), False, part, place)
        return part
    beside = key_type(layout, part.key[:1]) if len(part.key) == 1 else None
    _check_key(layout, found, beside, True, part, place)
    return replace(part, is_parallel=True)


def is_key(base: str) -> bool:
    """Return whether the values of a type can be the keys of an instance variable."""
    return base in _STRINGS[:1] or base in _INTEGERS


def key_type(layout: MessageLayout, key: tuple[str, ...]) -> FieldType | None:
    """Return the type of a field, None if there is none, or it is within an array."""
    found = layout.find_field(key[0])
    if found is None or len(key) == 1:
        return found.type if found else None
    if not found.type.is_message or found.type.array is not ArrayKind.NONE:
        return None
    return key_type(nested_layout(layout, found.type), key[1:])


def _check_key(layout: MessageLayout, found: MessageField, kind: FieldType | None,
               is_array: bool, part: LookUp, place: Span) -> None:
    wanted = 'string' + ' or whole number' * bool(part.variable) if not is_array else \
        'string[]' + ' or array of whole numbers' * bool(part.variable)
    if kind is not None and is_array is (kind.array is not ArrayKind.NONE) and (
            kind.base == 'string' or part.variable and is_key(kind.base)):
        return
    keys = _keys(layout, found)
    key = '.'.join(part.key)
    others = [f'{found.name}[{replace(part, key=(other,))}]' for other in keys]
    label = 'no such field' if kind is None else f'this is {_kind(kind)}, not a {wanted}'
    refuse(f"the elements of '{found.name}' have no names {shown(key)}", place, label,
           did_you_mean(key, keys) or (f'write {" or ".join(others)}' if others else
                                       f'take an element by its index, as in {found.name}[0]'))


def _refuse_field(layout: MessageLayout, match: re.Match[str], path_text: Text,
                  place: Span) -> NoReturn:
    name = match['name']
    names = [item.name for item in layout.fields]
    before, wanted = path_text.value[:match.start()], path_text.value[match.start():]
    deeper = [path for path in _leaf_paths(layout) if path.endswith(f'.{wanted}')]
    if deeper:
        refuse(f"{layout.name} has no field '{name}'", place, 'it is inside another field',
               field_line([before + deeper[0]], path_text))
    constant = any(item.name == name for item in layout.constants)
    refuse(f"{layout.name} has no field '{name}'", place,
           'a constant is not part of the message' if constant else 'no such field',
           did_you_mean(name, names) or (listed(names) if names else 'it has no fields'))


def _refuse_array(end: _End, path_text: Text) -> NoReturn:
    path = path_text.value
    if isinstance(end.path[-1], Slice | Sector):
        refuse(f'{shown(path)} is a part of an array ({end.type})', path_text.span,
               'which function of it?',
               field_line([f'{name}({path})' for name in _functions(end)], path_text))
    name = str(end.path[-1])
    others = [f'{function}({path})' for function in _functions(end)]
    names = [f'{path}[{key} = NAME]' for key in _usual_keys(_keys_at(end.inside, name))[:1]
             if not end.type.is_message and end.type.base not in _STRINGS]
    refuse(f"'{name}' is {_kind(end.type)}",
           path_text.at(len(path) - len(name), len(path)), 'which element?',
           field_line([*names, f'{path}[0]', *others], path_text))


def _refuse_message(end: _End, path_text: Text) -> NoReturn:
    inner = _leaf_paths(nested_layout(end.inside, end.type, path_text.span))
    functions = [f'{name}({path_text.value})' for name in _functions(end)]
    refuse(f'{shown(path_text.value)} is {_kind(end.type)}', path_text.span,
           'which part of it?',
           field_line([*(f'{path_text.value}.{path}' for path in inner), *functions], path_text))


def _named(end: _End, path: str) -> str:
    """Name what a path leads to, with its type."""
    kind = 'array' if end.is_array else 'message' if end.type.is_message else 'value'
    return f'the {kind} {shown(path)} ({end.type})'


def _kind(kind: FieldType) -> str:
    """Describe a type, with its article."""
    if kind.array is not ArrayKind.NONE:
        return f'an array ({kind})'
    if kind.is_message:
        return f'a message ({kind})'
    return f'an {kind}' if kind.base.startswith('int') else f'a {kind}'


def field_line(paths: Sequence[str], path_text: Text | None = None) -> str:
    """Return a line to paste, with the key at `path_text`, and what else could be in it."""
    if not paths:
        return ''
    others = '   # or ' + ', '.join(paths[1:_MAX_LISTED]) if len(paths) > 1 else ''
    key = 'field' if path_text is None else _key_before(path_text)
    return f'{key}: {_quoted(paths[0])}{others}{" ..." if len(paths) > _MAX_LISTED else ""}'


def _quoted(path: str) -> str:
    """Return a path as a value of YAML: within braces, `[` would begin a list."""
    if '"' in path:
        return f"'{path.replace(chr(39), chr(39) * 2)}'"
    return f'"{path}"' if '[' in path else path


def _key_before(text: Text) -> str:
    """Return the key of a value: under `topics`, it is the name of the input."""
    start = text.span.start
    line = text.source.text[text.source.text.rfind('\n', 0, start) + 1:start]
    match = _KEY_BEFORE.search(line)
    return match[1] if match else 'field'


def _leaf_paths(layout: MessageLayout) -> list[str]:
    """Return the paths to the first values of a message: near ones first, strings last."""
    found: list[str] = []
    strings: list[str] = []
    for prefix, inside in _levels(layout):
        for item in inside.fields:
            path = prefix + _first(item)
            if item.type.base in _STRINGS:
                strings.append(path)
            elif not item.type.is_message or item.type.base in _TIMES:
                found.append(path)
    return found + strings


def _levels(layout: MessageLayout) -> Iterator[tuple[str, MessageLayout]]:
    """Yield messages within a message, near ones first, and what stands before their fields."""
    level = [('', layout)]
    count = 0
    for _ in range(_MAX_DEPTH):
        deeper: list[tuple[str, MessageLayout]] = []
        for prefix, inside in level:
            yield prefix, inside
            count += len(inside.fields)
            for item in inside.fields:
                if item.type.is_message and item.type.base not in _TIMES \
                        and count < 10 * _MAX_LISTED:
                    deeper.extend(_reachable(inside, item, f'{prefix}{_first(item)}.'))
        level = deeper


def _first(item: MessageField) -> str:
    """Return the path to a field, or to the first element of its array."""
    return item.name if item.type.array is ArrayKind.NONE else f'{item.name}[0]'


def _reachable(layout: MessageLayout, item: MessageField,
               prefix: str) -> list[tuple[str, MessageLayout]]:
    """Return a field's message, if it is installed: this is only a hint."""
    try:
        return [(prefix, nested_layout(layout, item.type))]
    except CompileError:
        return []


def check_reachable(layout: MessageLayout, field: ResolvedField, place: Span | None) -> None:
    """
    Check that everything serialized before the end of a field has a known layout.

    Raises
    ------
    CompileError
        if a message there is not installed, or contains itself.
    """
    around: list[str] = []
    types = iter(field.types)
    for step, part in zip(field.path, (*field.path[1:], None)):
        if not isinstance(step, str):
            continue
        around.append(layout.name)
        names = [item.name for item in layout.fields]
        last = max(names.index(name) for name in (step, *_beside(part)))
        for item in layout.fields[:last]:
            if item.type.is_message:
                inside = nested_layout(layout, item.type, place)
                check_complete(inside, place, tuple(around))
        kind = next(types)
        if not kind.is_message:
            return
        layout = nested_layout(layout, kind, place)
        if kind.array is not ArrayKind.NONE:
            check_complete(layout, place, tuple(around))


def _beside(part: Step | None) -> tuple[str, ...]:
    """Return the fields beside an array that a part of it needs."""
    if isinstance(part, Sector):
        return SCAN_ANGLES
    return part.key if isinstance(part, LookUp) and part.is_parallel else ()
