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
Message definitions: what fields a ROS message has, read from the definitions that are installed.

`find_message` looks for `share/PKG/msg/Name.msg` where ROS packages install it, and returns a
`MessageLayout`: the fields in the order in which they are serialized, with their types. Messages
within messages are looked for when they are asked for. Services and actions have messages too,
which `rosidl` derives from their `.srv` and `.action` files: `pkg/srv/Name_Event` tells of a call,
`pkg/action/Name_FeedbackMessage` of a goal's progress. The grammar is that of `rosidl`.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from functools import lru_cache
from hashlib import sha256
import os
from pathlib import Path
import re
import sys
from typing import NoReturn

from fret_monitor.model.diagnostics import (
    CompileError, did_you_mean, pip_install, refuse, Source, Span,
)
from fret_monitor.model.names import LONGEST_PATH, shown
from fret_monitor.model.values import ValueType

_SCALARS = {'byte', 'char', 'string', 'wstring', *(kind.value for kind in ValueType)}
_LEGACY = {'time': 'builtin_interfaces/msg/Time', 'duration': 'builtin_interfaces/msg/Duration'}
_MAX_LISTED = 12
_MAX_BYTES = 2 ** 20
_SEPARATOR = '---'
_KINDS = {'msg': 'message', 'srv': 'service', 'action': 'action'}

# Where one of these is missing, it is not installed: no slip for the name of what is.
_COMMON = (
    'control_msgs', 'diagnostic_msgs', 'geometry_msgs', 'nav_msgs', 'sensor_msgs', 'std_msgs',
    'tf2_msgs', 'trajectory_msgs', 'visualization_msgs')

_INTERFACE = re.compile(
    r'(?P<package>[A-Za-z][A-Za-z0-9_]*)/(?:(?P<folder>msg|srv|action)/)?'
    r'(?P<name>[A-Z][A-Za-z0-9]*)(?P<part>(?:_[A-Za-z]+)*)')
_TYPE_NAME = re.compile(r'([A-Za-z][A-Za-z0-9_]*)/(?:msg/)?([A-Z][A-Za-z0-9]*)')
_TYPE = re.compile(
    r'(?P<base>[A-Za-z][A-Za-z0-9_/]*?)(?:<=(?P<limit>[0-9]+))?'
    r'(?P<array>\[(?P<bound><=)?(?P<size>[0-9]+)?\])?')
_FIELD_NAME = re.compile(r'[A-Za-z][A-Za-z0-9_]*')


class ArrayKind(Enum):
    """Whether a field is an array, and what is known of its length."""

    NONE = 'none'
    FIXED = 'fixed'
    BOUNDED = 'bounded'
    UNBOUNDED = 'unbounded'


@dataclass(frozen=True)
class FieldType:
    """
    The type of a field.

    `base` is a scalar (`float32`, `byte`, `string`, `wstring` ...) or a message (`pkg/msg/Name`).
    `size` is the length of a fixed array or the greatest of a bounded one; `text_limit` the
    greatest length of a bounded string.
    """

    base: str
    array: ArrayKind = ArrayKind.NONE
    size: int | None = None
    text_limit: int | None = None

    @property
    def is_message(self) -> bool:
        """Whether the elements are messages themselves."""
        return '/' in self.base

    def __str__(self) -> str:
        """Return the type as a `.msg` file has it."""
        base = self.base if self.text_limit is None else f'{self.base}<={self.text_limit}'
        match self.array:
            case ArrayKind.NONE:
                return base
            case ArrayKind.FIXED:
                return f'{base}[{self.size}]'
            case ArrayKind.BOUNDED:
                return f'{base}[<={self.size}]'
            case ArrayKind.UNBOUNDED:
                return f'{base}[]'


@dataclass(frozen=True)
class MessageField:
    """A field; `default` is its value as written, None where there is none."""

    name: str
    type: FieldType
    default: str | None = None


@dataclass(frozen=True)
class MessageConstant:
    """A constant, with its value as written."""

    name: str
    type: FieldType
    value: str


@dataclass(frozen=True)
class MessageLayout:
    """
    A message: `name` is `pkg/msg/Name`, the fields stand in the order of their serialization.

    `text` is the definition itself; `search_path` is where messages within it are looked for.
    """

    name: str
    fields: tuple[MessageField, ...]
    constants: tuple[MessageConstant, ...]
    text: str = field(repr=False)
    search_path: tuple[Path, ...] = field(default=(), repr=False, compare=False)

    def find_field(self, name: str) -> MessageField | None:
        """Return a field by its name."""
        return next((item for item in self.fields if item.name == name), None)

    def nested(self, kind: FieldType) -> 'MessageLayout':
        """
        Return the layout of a field's message.

        Raises
        ------
        CompileError
            if it is not installed.
        """
        return find_message(kind.base, self.search_path or None)

    @property
    def fingerprint(self) -> str:
        """
        The SHA-256 of what decides how the message is serialized, with the messages within it.

        One that is not installed counts as such.
        """
        return sha256(repr(sorted(_shapes(self).items())).encode()).hexdigest()


def search_path() -> tuple[Path, ...]:
    """Return where packages are looked for: `AMENT_PREFIX_PATH`, then the Python environment."""
    prefixes = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    found = [Path(prefix) for prefix in [*prefixes, sys.prefix] if prefix]
    return tuple(dict.fromkeys(found))


def find_message(type_name: str, search: Sequence[Path] | None = None,
                 place: Span | None = None) -> MessageLayout:
    """
    Return the layout of an installed message type.

    `type_name` is `pkg/msg/Name`, `pkg/Name`, or of a service or action, as `pkg/srv/Name_Event`.
    `search` are the prefixes to look in, in this order; `search_path()` unless given. `place` is
    where the type is named, for the error.

    Raises
    ------
    CompileError
        if there is no such message, or its definition cannot be read.
    """
    prefixes = search_path() if search is None else tuple(search)
    match = _INTERFACE.fullmatch(type_name)
    folder = (match['folder'] or 'msg') if match else ''
    if match is None or (folder == 'msg') != (match['part'] == ''):
        refuse(f'{shown(type_name)} is not the name of a message type', place,
               help='a message type is written pkg/msg/Name, such as std_msgs/msg/Float32')
    package, name = match['package'], match['name']
    for prefix in prefixes:
        path = _folder(prefix, package, folder) / f'{name}.{folder}'
        if path.is_file():
            state = path.stat()
            found = _read(path, package, folder, prefixes, (state.st_mtime_ns, state.st_size))
            return _part(found, name, match['part'], place)
    _refuse_missing(package, folder, name, prefixes, place)


def _part(found: Mapping[str, MessageLayout], name: str, part: str,
          place: Span | None) -> MessageLayout:
    if part not in found:
        refuse(f"'{name}{part}' is no message of '{name}'", place, '',
               did_you_mean(name + part, [name + other for other in found])
               or listed([name + other for other in found]))
    return found[part]


def _folder(prefix: Path, package: str, folder: str) -> Path:
    return prefix / 'share' / package / folder


@lru_cache(maxsize=1024)
def _read(path: Path, package: str, folder: str, prefixes: tuple[Path, ...],
          state: tuple[int, int]) -> Mapping[str, MessageLayout]:
    """
    Read a definition; return what follows its name in the name of each of its messages.

    `state` makes a file that was written anew another one.
    """
    try:
        with path.open('rb') as file:
            text = file.read(_MAX_BYTES).decode('utf-8', 'replace')
    except OSError as error:
        refuse(f'{shown(str(path), LONGEST_PATH)} cannot be read: {error.strerror}')
    source, name = Source(str(path), text), f'{package}/{folder}/{path.stem}'
    match folder:
        case 'srv':
            return _service(name, _sections(source, name, ('_Request', '_Response'), prefixes))
        case 'action':
            return _action(name, _sections(source, name, ('_Goal', '_Result', '_Feedback'),
                                           prefixes))
        case _:
            return {'': _parse(source, name, prefixes)}


def _refuse_missing(package: str, folder: str, name: str, prefixes: tuple[Path, ...],
                    place: Span | None) -> NoReturn:
    here = {path.stem for prefix in prefixes
            for path in _list(_folder(prefix, package, folder), f'*.{folder}')}
    if here:
        near = did_you_mean(name, here) or listed(sorted(here))
        refuse(f"the package '{package}' has no {_KINDS[folder]} '{name}'", place,
               'not installed here', near)
    if any((_folder(prefix, package, folder) / f'{name}.idl').is_file() for prefix in prefixes):
        refuse(f"'{package}/{folder}/{name}' is defined in IDL", place,
               f'only definitions in .{folder} files are read')
    packages = {path.parent.parent.name for prefix in prefixes
                for path in _list(prefix / 'share', f'*/{folder}/*.{folder}')}
    near = '' if package in _COMMON else did_you_mean(package, packages)
    refuse(f"there are no {_KINDS[folder]}s of a package '{package}'", place, 'not installed here',
           '\n'.join(filter(None, (near, _no_package(package, packages)))))


def _list(folder: Path, pattern: str) -> list[Path]:
    try:
        return list(folder.glob(pattern))
    except OSError:
        return []


def _no_package(package: str, packages: set[str]) -> str:
    if not packages:
        return 'no messages at all are installed: source ROS, such as /opt/ros/jazzy/setup.bash'
    return f'install it ({_command(package)}), or source the workspace that has it'


def _command(package: str) -> str:
    """Return what installs a package of ROS: pip if ROS itself came as wheels, else apt."""
    distribution = os.environ.get('ROS_DISTRO') or 'jazzy'
    name = f'ros-{distribution}-{package.replace("_", "-")}'
    has_wheels = (Path(sys.prefix) / 'share' / 'rclpy').is_dir()
    is_sourced = bool(os.environ.get('AMENT_PREFIX_PATH'))
    return f'sudo apt install {name}' if is_sourced and not has_wheels else pip_install(name)


def listed(names: Sequence[str]) -> str:
    """Return the first of the names that there are, for the help of an error."""
    more = f' and {len(names) - _MAX_LISTED} more' if len(names) > _MAX_LISTED else ''
    return 'there are ' + ', '.join(names[:_MAX_LISTED]) + more


def parse_message(text: str, package: str, name: str = 'Message') -> MessageLayout:
    """
    Read the text of a `.msg` file of a package.

    Raises
    ------
    CompileError
        if a line is neither a field nor a constant.
    """
    whole = f'{package}/msg/{name}'
    return _parse(Source(whole, text), whole, ())


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
        refuse(f'{name} is to have {len(parts)} parts', Span(source, 0, 0),
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
        refuse('this line is no field of a message', place, 'cannot be read')
    if '=' in rest:
        return MessageConstant(name, kind, value)
    return MessageField(name, kind, value.strip() or None)


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


def _shapes(layout: MessageLayout) -> dict[str, str]:
    """Return the fields of a message and of all within it, by name."""
    found: dict[str, str] = {}
    waiting = [layout]
    while waiting:
        inside = waiting.pop()
        found[inside.name] = ', '.join(f'{item.type} {item.name}' for item in inside.fields)
        for item in inside.fields:
            if item.type.is_message and item.type.base not in found:
                found[item.type.base] = 'missing'
                waiting.extend(_installed(inside, item.type))
    return found


def _installed(layout: MessageLayout, kind: FieldType) -> Iterator[MessageLayout]:
    """Yield the layout of a field's message, if it is installed."""
    try:
        yield layout.nested(kind)
    except CompileError:
        pass


def check_complete(layout: MessageLayout, place: Span | None,
                   around: tuple[str, ...] = ()) -> None:
    """
    See to it that a message can be walked over; `around` are the messages it stands in.

    Raises
    ------
    CompileError
        if a message within it is not installed, or contains itself.
    """
    if layout.name in around:
        refuse(f'{layout.name} contains itself', place, 'such a message cannot be sent')
    for kind in dict.fromkeys(item.type.base for item in layout.fields if item.type.is_message):
        inside = find_message(kind, layout.search_path or None, place)
        check_complete(inside, place, (*around, layout.name))
