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
Message definitions: what fields a ROS message has, read from the `.msg` files that are installed.

`find_message` looks for `share/PKG/msg/Name.msg` where ROS packages install it, and returns a
`MessageLayout`: the fields in the order in which they are serialized, with their types. Messages
within messages are looked for when they are asked for. `resolve_field` says what a field path such
as `pose.position.z` or `ranges[3]` leads to. The grammar is that of `rosidl`.
"""

from collections.abc import Iterator
from collections.abc import Sequence
from dataclasses import dataclass
from dataclasses import field
from enum import Enum
from functools import lru_cache
import os
from pathlib import Path
import re
import sys
from typing import NoReturn

from fret_monitor.diagnostics import CompileError
from fret_monitor.diagnostics import did_you_mean
from fret_monitor.diagnostics import refuse
from fret_monitor.diagnostics import Source
from fret_monitor.diagnostics import Span
from fret_monitor.diagnostics import Text
from fret_monitor.syntax.words import LONGEST_PATH
from fret_monitor.syntax.words import shown

_SCALARS = (
    'bool', 'byte', 'char', 'int8', 'uint8', 'int16', 'uint16', 'int32', 'uint32', 'int64',
    'uint64', 'float32', 'float64', 'string', 'wstring')
_READ_AS = {'byte': 'uint8', 'char': 'uint8'}
_LEGACY = {'time': 'builtin_interfaces/msg/Time', 'duration': 'builtin_interfaces/msg/Duration'}
_MAX_LISTED = 12
_MAX_DEPTH = 8
_MAX_INDEX = 2 ** 31 - 1
_MAX_BYTES = 2 ** 20

_TYPE_NAME = re.compile(r'([A-Za-z][A-Za-z0-9_]*)/(?:msg/)?([A-Z][A-Za-z0-9]*)')
_TYPE = re.compile(
    r'(?P<base>[A-Za-z][A-Za-z0-9_/]*?)(?:<=(?P<limit>[0-9]+))?'
    r'(?P<array>\[(?P<bound><=)?(?P<size>[0-9]+)?\])?')
_FIELD_NAME = re.compile(r'[A-Za-z][A-Za-z0-9_]*')
_STEP = re.compile(r'(?P<name>[A-Za-z][A-Za-z0-9_]*)(?:\[(?P<index>[0-9]+)\])?')


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


@dataclass(frozen=True)
class ResolvedField:
    """
    Where a field path leads.

    `path` holds names and indices; `type_name` is the scalar at its end, with `byte` and `char` as
    `uint8`; `types` are the types of the fields on the way, one for each name in the path.
    """

    path: tuple[str | int, ...]
    type_name: str
    types: tuple[FieldType, ...]


def search_path() -> tuple[Path, ...]:
    """Return where packages are looked for: `AMENT_PREFIX_PATH`, then the Python environment."""
    prefixes = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    found = [Path(prefix) for prefix in [*prefixes, sys.prefix] if prefix]
    return tuple(dict.fromkeys(found))


def find_message(type_name: str, search: Sequence[Path] | None = None,
                 place: Span | None = None) -> MessageLayout:
    """
    Return the layout of an installed message type, `pkg/msg/Name` or `pkg/Name`.

    `search` are the prefixes to look in, in this order; `search_path()` unless given. `place` is
    where the type is named, for the error.

    Raises
    ------
    CompileError
        if there is no such message, or its definition cannot be read.
    """
    prefixes = search_path() if search is None else tuple(search)
    match = _TYPE_NAME.fullmatch(type_name)
    if match is None:
        refuse(f'{shown(type_name)} is not the name of a message type', place,
               help='a message type is written pkg/msg/Name, such as std_msgs/msg/Float32')
    package, name = match.groups()
    for prefix in prefixes:
        path = _folder(prefix, package) / f'{name}.msg'
        if path.is_file():
            state = path.stat()
            return _read(path, package, prefixes, (state.st_mtime_ns, state.st_size))
    _refuse_missing(package, name, prefixes, place)


def _folder(prefix: Path, package: str) -> Path:
    return prefix / 'share' / package / 'msg'


@lru_cache(maxsize=1024)
def _read(path: Path, package: str, prefixes: tuple[Path, ...],
          state: tuple[int, int]) -> MessageLayout:
    """Read a definition; `state` makes a file that was written anew another one."""
    try:
        with path.open('rb') as file:
            text = file.read(_MAX_BYTES).decode('utf-8', 'replace')
    except OSError as error:
        refuse(f'{shown(str(path), LONGEST_PATH)} cannot be read: {error.strerror}')
    return _parse(Source(str(path), text), package, path.stem, prefixes)


def _refuse_missing(package: str, name: str, prefixes: tuple[Path, ...],
                    place: Span | None) -> NoReturn:
    here = {path.stem for prefix in prefixes for path in _list(_folder(prefix, package), '*.msg')}
    if here:
        near = did_you_mean(name, here) or _listed(sorted(here))
        refuse(f"the package '{package}' has no message '{name}'", place, 'not installed here',
               near)
    if any((_folder(prefix, package) / f'{name}.idl').is_file() for prefix in prefixes):
        refuse(f"'{package}/msg/{name}' is defined in IDL", place,
               'only definitions in .msg files are read')
    packages = {path.parent.parent.name for prefix in prefixes
                for path in _list(prefix / 'share', '*/msg/*.msg')}
    refuse(f"there are no messages of a package '{package}'", place, 'not installed here',
           '\n'.join(filter(None, (did_you_mean(package, packages),
                                   _no_package(package, packages)))))


def _list(folder: Path, pattern: str) -> list[Path]:
    try:
        return list(folder.glob(pattern))
    except OSError:
        return []


def _no_package(package: str, packages: set[str]) -> str:
    if not packages:
        return 'no messages at all are installed: source ROS, such as /opt/ros/jazzy/setup.bash'
    name = package.replace('_', '-')
    return f'install it (sudo apt install ros-jazzy-{name}), or source the workspace that has it'


def _listed(names: Sequence[str]) -> str:
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
    return _parse(Source(f'{package}/msg/{name}', text), package, name, ())


def _parse(source: Source, package: str, name: str, prefixes: tuple[Path, ...]) -> MessageLayout:
    fields: list[MessageField] = []
    constants: list[MessageConstant] = []
    start = 0
    for line in source.text.splitlines(keepends=True):
        item = _line(line, Span(source, start, start + len(line.rstrip())), package)
        if isinstance(item, MessageField):
            fields.append(item)
        elif item is not None:
            constants.append(item)
        start += len(line)
    layout = MessageLayout(f'{package}/msg/{name}', tuple(fields), tuple(constants), source.text,
                           prefixes)
    _refuse_twice(layout, source)
    return layout


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
    if base is None or limit is not None and base not in ('string', 'wstring'):
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


def resolve_field(layout: MessageLayout, path_text: Text | None,
                  type_text: Text) -> ResolvedField:
    """
    Follow a field path into a message, to the scalar at its end.

    `path_text` may be None where the message has one field; `type_text` is where the type is
    named, for the error.

    Raises
    ------
    CompileError
        if there is no such field, or it is no scalar; it says what there is.
    """
    if path_text is None:
        return _only_field(layout, type_text)
    path: list[str | int] = []
    types: list[FieldType] = []
    inside = layout
    for match in list(_steps(path_text, layout)):
        if types:
            inside = _inside(inside, types[-1], path_text, match)
        types.append(_step(inside, match, path_text))
        path.extend([match['name'], *([int(match['index'])] if match['index'] else [])])
    if types[-1].is_message:
        _refuse_message(inside, types[-1], path_text)
    return _resolved(path, types)


def _resolved(path: Sequence[str | int], types: Sequence[FieldType]) -> ResolvedField:
    base = types[-1].base
    return ResolvedField(tuple(path), _READ_AS.get(base, base), tuple(types))


def _only_field(layout: MessageLayout, type_text: Text) -> ResolvedField:
    paths = _leaf_paths(layout)
    if len(layout.fields) != 1:
        refuse(f'{layout.name} has {len(layout.fields) or "no"} fields', type_text.span,
               'which one?' if layout.fields else 'there is nothing to read', _help(paths))
    only = layout.fields[0]
    if only.type.is_message or only.type.array is not ArrayKind.NONE:
        refuse(f"the one field of {layout.name}, '{only.name}', is {_kind(only.type)}",
               type_text.span, 'which part of it?', _help(paths))
    return _resolved([only.name], [only.type])


def _steps(path_text: Text, layout: MessageLayout) -> Iterator[re.Match[str]]:
    """Yield name and index of each step of a path."""
    place = 0
    while True:
        match = _STEP.match(path_text.value, place)
        end = match.end() if match else place
        if match is None or path_text.value[end:end + 1] not in ('', '.'):
            rest = path_text.at(min(end, max(len(path_text.value) - 1, 0)), len(path_text.value))
            refuse(f'{shown(path_text.value)} is not a field path', rest,
                   'names with dots between them, and indices from 0',
                   _help(_leaf_paths(layout)))
        yield match
        if end == len(path_text.value):
            return
        place = end + 1


def _inside(layout: MessageLayout, kind: FieldType, path_text: Text,
            match: re.Match[str]) -> MessageLayout:
    if not kind.is_message:
        refuse(f'{shown(path_text.value[:match.start() - 1])} is {_kind(kind)}, and has no fields',
               path_text.at(match.start() - 1, len(path_text.value)), 'remove this')
    return _nested(layout, kind, path_text.at(0, match.start() - 1))


def _nested(layout: MessageLayout, kind: FieldType, place: Span) -> MessageLayout:
    return find_message(kind.base, layout.search_path or None, place)


def _step(layout: MessageLayout, match: re.Match[str], path_text: Text) -> FieldType:
    """Look up one step of a path, and hold its index against the array."""
    found = layout.find_field(match['name'])
    place = path_text.at(match.start('name'), match.end('name'))
    if found is None:
        _refuse_field(layout, match, path_text, place)
    kind = found.type
    if match['index'] is None and kind.array is not ArrayKind.NONE:
        refuse(f"'{found.name}' is {_kind(kind)}", place, 'which element?',
               f'field: {path_text.value[:match.end()]}[0]{path_text.value[match.end():]}')
    if match['index'] is not None:
        _check_index(kind, match, path_text)
    return kind


def _check_index(kind: FieldType, match: re.Match[str], path_text: Text) -> None:
    place = path_text.at(match.start('index') - 1, match.end('index') + 1)
    if kind.array is ArrayKind.NONE:
        refuse(f"'{match['name']}' is {_kind(kind)}, not an array", place, 'remove this')
    limit = _MAX_INDEX if kind.size is None else kind.size - 1
    digits = match['index'].lstrip('0') or '0'
    if len(digits) > 10 or int(digits) > limit:
        refuse(f"'{match['name']}' is {_kind(kind)}: it has no element {shown(digits)[1:-1]}",
               place, f'the last is {limit}' if limit >= 0 else 'it is empty')


def _refuse_field(layout: MessageLayout, match: re.Match[str], path_text: Text,
                  place: Span) -> NoReturn:
    name = match['name']
    names = [item.name for item in layout.fields]
    deeper = [path for path in _leaf_paths(layout) if path.split('.')[-1] == name]
    before, after = path_text.value[:match.start()], path_text.value[match.end():]
    if deeper and not after:
        refuse(f"{layout.name} has no field '{name}'", place, 'it stands deeper',
               f'field: {before}{deeper[0]}')
    constant = any(item.name == name for item in layout.constants)
    refuse(f"{layout.name} has no field '{name}'", place,
           'a constant is not sent' if constant else 'no such field',
           did_you_mean(name, names) or (_listed(names) if names else 'it has no fields'))


def _refuse_message(layout: MessageLayout, kind: FieldType, path_text: Text) -> NoReturn:
    inner = _leaf_paths(_nested(layout, kind, path_text.span))
    refuse(f'{shown(path_text.value)} is {_kind(kind)}', path_text.span, 'which part of it?',
           _help([f'{path_text.value}.{path}' for path in inner]))


def _kind(kind: FieldType) -> str:
    """Say what a type is, in the user's words."""
    match kind.array:
        case ArrayKind.NONE:
            return f'a message ({kind})' if kind.is_message else _with_article(str(kind))
        case ArrayKind.FIXED | ArrayKind.BOUNDED | ArrayKind.UNBOUNDED:
            return f'an array ({kind})'


def _with_article(name: str) -> str:
    return f'an {name}' if name.startswith('int') else f'a {name}'


def _help(paths: Sequence[str]) -> str:
    """Return a line to paste, and what else could be in it."""
    if not paths:
        return ''
    others = '   # or ' + ', '.join(paths[1:_MAX_LISTED]) if len(paths) > 1 else ''
    return f'field: {paths[0]}{others}{" ..." if len(paths) > _MAX_LISTED else ""}'


def _leaf_paths(layout: MessageLayout) -> list[str]:
    """Return the paths to the first scalars of a message: near ones first, strings last."""
    found: list[str] = []
    strings: list[str] = []
    level = [('', layout)]
    for _ in range(_MAX_DEPTH):
        deeper: list[tuple[str, MessageLayout]] = []
        for prefix, inside in level:
            for item in inside.fields:
                step = item.name if item.type.array is ArrayKind.NONE else f'{item.name}[0]'
                if item.type.base in ('string', 'wstring'):
                    strings.append(prefix + step)
                elif not item.type.is_message:
                    found.append(prefix + step)
                elif len(found) + len(deeper) < 10 * _MAX_LISTED:
                    deeper.extend(_reachable(inside, item, f'{prefix}{step}.'))
        level = deeper
    return found + strings


def _reachable(layout: MessageLayout, item: MessageField,
               prefix: str) -> list[tuple[str, MessageLayout]]:
    """Return a field's message, if it is installed: this is only a hint."""
    try:
        return [(prefix, layout.nested(item.type))]
    except CompileError:
        return []
