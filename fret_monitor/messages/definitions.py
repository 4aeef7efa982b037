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
Parses `.msg`, `.srv` and `.action` files into message layouts, by the grammar of `rosidl`.

A service or an action has several messages, some of which are written in no file: `rosidl`
derives them. `Name_Event` reports a call of a service, `Name_FeedbackMessage` the progress of a
goal.
"""


from collections.abc import Mapping, Sequence
from itertools import takewhile
from pathlib import Path
import re

from fret_monitor.messages.layout import (
    ArrayKind, FieldType, MessageConstant, MessageField, MessageLayout,
)
from fret_monitor.model.diagnostics import refuse, Source, Span
from fret_monitor.model.values import ValueType

_SCALARS = {'byte', 'char', 'string', 'wstring', *(kind.value for kind in ValueType)}
_LEGACY = {'time': 'builtin_interfaces/msg/Time', 'duration': 'builtin_interfaces/msg/Duration'}
_SEPARATOR = '---'

_TYPE_NAME = re.compile(r'([A-Za-z][A-Za-z0-9_]*)/(?:msg/)?([A-Z][A-Za-z0-9]*)')
_TYPE = re.compile(
    r'(?P<base>[A-Za-z][A-Za-z0-9_/]*?)(?:<=(?P<limit>[0-9]+))?'
    r'(?P<array>\[(?P<bound><=)?(?P<size>[0-9]+)?\])?')
_BELOW = re.compile(r'[ \t]+#')
_FIELD_NAME = re.compile(r'[A-Za-z][A-Za-z0-9_]*')


def parse_definition(source: Source, name: str,
                     prefixes: tuple[Path, ...]) -> Mapping[str, MessageLayout]:
    """
    Parse the definition of `pkg/msg/Name`, `pkg/srv/Name` or `pkg/action/Name`.

    Returns its messages by what follows `Name` in their names: '' alone for a `.msg` file,
    '_Request', '_Response' and '_Event' for a service, and so on. `prefixes` are where the
    messages within them are installed.

    Raises
    ------
    CompileError
        if a line is neither a field nor a constant.
    """
    match name.split('/')[1]:
        case 'srv':
            return _service(name, _sections(source, name, ('_Request', '_Response'), prefixes))
        case 'action':
            return _action(name, _sections(source, name, ('_Goal', '_Result', '_Feedback'),
                                           prefixes))
        case _:
            return {'': _parse(source, name, prefixes)}


def _parse(source: Source, name: str, prefixes: tuple[Path, ...],
           section: tuple[int, int] | None = None) -> MessageLayout:
    """Read a definition, or the section of one from a place in its text to another."""
    start, end = section or (0, len(source.text))
    text = source.text[start:end]
    fields: list[MessageField] = []
    constants: list[MessageConstant] = []
    for line in text.splitlines(keepends=True):
        item = _line(line, Span(source, start, start + len(line.rstrip())), name.split('/')[0])
        if isinstance(item, MessageField):
            fields.append(item)
        elif item is not None:
            constants.append(item)
        start += len(line)
    layout = MessageLayout(name, tuple(fields), tuple(constants), text, prefixes)
    _refuse_twice(layout, source)
    return layout


def _sections(source: Source, name: str, parts: Sequence[str],
              prefixes: tuple[Path, ...]) -> dict[str, MessageLayout]:
    """Read the messages of a service or an action, which stand in one file."""
    places = [0]
    start = 0
    for line in source.text.splitlines(keepends=True):
        start += len(line)
        if line.rstrip() == _SEPARATOR:
            places += [start - len(line), start]
    places.append(len(source.text))
    if len(places) != 2 * len(parts):
        refuse(f'{name} must have {len(parts)} parts', Span(source, 0, 0),
               f"with '{_SEPARATOR}' between them")
    return {part: _parse(source, name + part, prefixes, section)
            for part, section in zip(parts, zip(places[::2], places[1::2]))}


def _service(name: str, parts: Mapping[str, MessageLayout]) -> dict[str, MessageLayout]:
    """Add the event that tells of a call, as `rosidl` defines it."""
    fields = [('info', FieldType('service_msgs/msg/ServiceEventInfo'))]
    fields += [(field, FieldType(f'{name}_{field.capitalize()}', ArrayKind.BOUNDED, 1))
               for field in ('request', 'response')]
    return {**parts, '_Event': _derived(f'{name}_Event', parts['_Request'], fields)}


def _action(name: str, parts: Mapping[str, MessageLayout]) -> dict[str, MessageLayout]:
    """Add the messages that an action sends, as `rosidl` defines them."""
    like = parts['_Goal']
    goal_id = ('goal_id', FieldType('unique_identifier_msgs/msg/UUID'))
    made: dict[str, Sequence[tuple[str, FieldType]]] = {
        '_FeedbackMessage': (goal_id, ('feedback', FieldType(f'{name}_Feedback'))),
        '_SendGoal_Request': (goal_id, ('goal', FieldType(f'{name}_Goal'))),
        '_SendGoal_Response': (('accepted', FieldType('bool')),
                               ('stamp', FieldType('builtin_interfaces/msg/Time'))),
        '_GetResult_Request': (goal_id,),
        '_GetResult_Response': (('status', FieldType('int8')),
                                ('result', FieldType(f'{name}_Result'))),
    }
    found = {part: _derived(name + part, like, fields) for part, fields in made.items()}
    for call in ('_SendGoal', '_GetResult'):
        both = {part: found[call + part] for part in ('_Request', '_Response')}
        found[f'{call}_Event'] = _service(name + call, both)['_Event']
    return {**parts, **found}


def _derived(name: str, like: MessageLayout,
             fields: Sequence[tuple[str, FieldType]]) -> MessageLayout:
    """Return a message that is written in no file."""
    return MessageLayout(name, tuple(MessageField(*item) for item in fields), (), '',
                         like.search_path)


def _line(line: str, place: Span, package: str) -> MessageField | MessageConstant | None:
    """Read one line; as in `rosidl`, a '#' starts a comment wherever it stands."""
    content = line.partition('#')[0].replace('\t', ' ').strip()
    if not content:
        return None
    type_text, _, rest = content.partition(' ')
    kind = _field_type(type_text, package)
    if '=' in rest:
        name, _, value = rest.partition('=')
        value = value.strip()
    else:
        name, _, value = rest.strip().partition(' ')
    name = name.strip()
    if kind is None or _FIELD_NAME.fullmatch(name) is None:
        refuse('this line is not a field of a message', place, 'cannot be read')
    if '=' in rest:
        return MessageConstant(name, kind, value)
    return MessageField(name, kind, value.strip() or None)


def field_comment(layout: MessageLayout, field: str) -> str:
    """
    Return what the definition of a message says of a field; '' if that is nothing.

    It is the comment behind the field, which may go on in the lines below, or else that above it.
    """
    above: list[str] = []
    lines = iter(layout.text.splitlines())
    for line in lines:
        content, _, comment = line.partition('#')
        if content.split()[1:2] == [field]:
            below = takewhile(lambda other: _BELOW.match(other), lines)
            behind = [comment.strip(), *(other.partition('#')[2].strip() for other in below)]
            return ' '.join(behind if comment else above).strip()
        above = [*above, comment.strip()] if comment and not content.strip() else []
    return ''


def _field_type(text: str, package: str) -> FieldType | None:
    match = _TYPE.fullmatch(text)
    if match is None:
        return None
    base = _base(match['base'], package)
    size = int(match['size']) if match['size'] else None
    limit = int(match['limit']) if match['limit'] else None
    if base is None or limit is not None and base not in ('string', 'wstring') or size == 0:
        return None
    if not match['array']:
        return FieldType(base, text_limit=limit)
    if size is None:
        return None if match['bound'] else FieldType(base, ArrayKind.UNBOUNDED, None, limit)
    return FieldType(base, ArrayKind.BOUNDED if match['bound'] else ArrayKind.FIXED, size, limit)


def _base(text: str, package: str) -> str | None:
    """Return a scalar type or the whole name of a message type."""
    if text in _SCALARS:
        return text
    if text in _LEGACY:
        return _LEGACY[text]
    if text == 'Header':  # ROS 1 means the one of std_msgs, and old definitions still say so
        return 'std_msgs/msg/Header'
    match = _TYPE_NAME.fullmatch(text if '/' in text else f'{package}/{text}')
    return f'{match[1]}/msg/{match[2]}' if match else None


def _refuse_twice(layout: MessageLayout, source: Source) -> None:
    names = [item.name for item in layout.fields] + [item.name for item in layout.constants]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        refuse(f"the message {layout.name} has two fields '{twice}'", Span(source, 0, 0))
