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
Finds the definitions of installed messages: `share/PKG/msg/Name.msg` and the like.

Messages within a message are looked up only when they are asked for.
"""


from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from hashlib import sha256
import os
from pathlib import Path
import re
import stat
from typing import NoReturn

from fret_monitor.messages.definitions import parse_definition
from fret_monitor.messages.layout import FieldType, MessageLayout
from fret_monitor.model.diagnostics import (
    CompileError, did_you_mean, refuse, Source, Span, TYPO,
)
from fret_monitor.model.names import LONGEST_PATH, shown
from fret_monitor.model.packages import how_to_install, search_path
from fret_monitor.model.transforms import DEFINITIONS

_MAX_LISTED = 12
_SEPARATOR = '=' * 80 + '\n'
_MAX_BYTES = 2 ** 20
_KINDS = {'msg': 'message', 'srv': 'service', 'action': 'action'}

# If one of these is missing, it is not installed: its name is not a misspelling of another.
_COMMON = frozenset({
    'control_msgs', 'diagnostic_msgs', 'geometry_msgs', 'nav2_msgs', 'nav_msgs', 'sensor_msgs',
    'std_msgs', 'tf2_msgs', 'trajectory_msgs', 'vision_msgs', 'visualization_msgs'})

_INTERFACE = re.compile(
    r'(?P<package>[A-Za-z][A-Za-z0-9_]*)/(?:(?P<folder>msg|srv|action)/)?'
    r'(?P<name>[A-Z][A-Za-z0-9]*)(?P<part>(?:_[A-Za-z]+)*)')


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
        file = os.path.join(prefix, 'share', package, folder, f'{name}.{folder}')
        state = _state(file)
        if state is not None:
            found = _read(file, f'{package}/{folder}/{name}', prefixes, state)
            return _part(found, name, match['part'], place)
    if type_name in DEFINITIONS:
        text = Source(type_name, DEFINITIONS[type_name])
        return parse_definition(text, type_name, prefixes)['']
    _refuse_missing(package, folder, name, prefixes, place)


def installed_types(folder: str = 'msg') -> list[str]:
    """Return the names of all installed messages, or with the folder `srv` of services."""
    return sorted({f'{path.parent.parent.name}/{folder}/{path.stem}' for prefix in search_path()
                   for path in _list(prefix / 'share', f'*/{folder}/*.{folder}')})


def _part(found: Mapping[str, MessageLayout], name: str, part: str,
          place: Span | None) -> MessageLayout:
    if part not in found:
        refuse(f"'{name}{part}' is not a message of '{name}'", place, '',
               did_you_mean(name + part, [name + other for other in found])
               or listed([name + other for other in found]))
    return found[part]


def _folder(prefix: Path, package: str, folder: str) -> Path:
    return prefix / 'share' / package / folder


def _state(file: str) -> tuple[int, int] | None:
    """Return the time and size of a file, or None if there is none."""
    try:
        status = os.stat(file)
    except (OSError, ValueError):
        return None
    return (status.st_mtime_ns, status.st_size) if stat.S_ISREG(status.st_mode) else None


@lru_cache(maxsize=1024)
def _read(file: str, name: str, prefixes: tuple[Path, ...],
          state: tuple[int, int]) -> Mapping[str, MessageLayout]:
    """
    Read a definition file, see `parse_definition`.

    `state` is its time and size: a changed file is read again.
    """
    try:
        with open(file, 'rb') as content:
            text = content.read(_MAX_BYTES).decode('utf-8', 'replace')
    except OSError as error:
        refuse(f'{shown(file, LONGEST_PATH)} cannot be read: {error.strerror}')
    return parse_definition(Source(file, text), name, prefixes)


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
    known = packages | _COMMON
    is_here = any((prefix / 'share' / package).is_dir() for prefix in prefixes)
    near = '' if is_here or package in known else did_you_mean(package, known, TYPO)
    refuse(f"no {_KINDS[folder]}s of a package '{package}' were found", place,
           'not installed here', near or _no_package(package, packages))


def _list(folder: Path, pattern: str) -> list[Path]:
    try:
        return list(folder.glob(pattern))
    except OSError:
        return []


def _no_package(package: str, packages: set[str]) -> str:
    if not packages:
        return 'no messages are installed: source ROS, such as /opt/ros/jazzy/setup.bash'
    return how_to_install(package)


def listed(names: Sequence[str]) -> str:
    """Return the first of the names that there are, for the help of an error."""
    more = f' and {len(names) - _MAX_LISTED} more' if len(names) > _MAX_LISTED else ''
    return 'one of ' + ', '.join(names[:_MAX_LISTED]) + more


def nested_layout(layout: MessageLayout, kind: FieldType,
                  place: Span | None = None) -> MessageLayout:
    """Return the layout of a field's message; raises `CompileError` if it is not installed."""
    return find_message(kind.base, layout.search_path or None, place)


def fingerprint(layout: MessageLayout) -> str:
    """
    Return the SHA-256 of what decides how a message is serialized, with the messages within it.

    A message within it that is not installed counts as missing.
    """
    return sha256(repr(sorted(_shapes(layout).items())).encode()).hexdigest()


def complete_definition(layout: MessageLayout) -> str:
    """Return the text of a message, followed by those within it, as recordings have them."""
    first, *others = (item for item in _within(layout).values() if item is not None)
    return _SEPARATOR.join([_definition(first), *(
        f'MSG: {item.name.replace("/msg/", "/")}\n{_definition(item)}' for item in others)])


def definition_or_none(message_type: str) -> str:
    """Return the definition of an installed message; empty if only its Python is installed."""
    try:
        return complete_definition(find_message(message_type))
    except CompileError:
        return ''


def _definition(layout: MessageLayout) -> str:
    """Return the text of a message; of one that is in no file, its fields."""
    text = layout.text or '\n'.join(f'{item.type} {item.name}' for item in layout.fields)
    return text if text.endswith('\n') else f'{text}\n'


def _shapes(layout: MessageLayout) -> dict[str, str]:
    """Return the fields of a message and of all within it, by name."""
    return {name: 'missing' if item is None else
            ', '.join(f'{field.type} {field.name}' for field in item.fields)
            for name, item in _within(layout).items()}


def _within(layout: MessageLayout) -> dict[str, MessageLayout | None]:
    """Return a message and all within it, by name; None: it is not installed."""
    found: dict[str, MessageLayout | None] = {}
    waiting = [layout]
    while waiting:
        inside = waiting.pop()
        found[inside.name] = inside
        for item in inside.fields:
            if item.type.is_message and item.type.base not in found:
                found[item.type.base] = None
                waiting.extend(_installed(inside, item.type))
    return found


def _installed(layout: MessageLayout, kind: FieldType) -> Iterator[MessageLayout]:
    """Yield the layout of a field's message, if it is installed."""
    try:
        yield nested_layout(layout, kind)
    except CompileError:
        pass


def check_complete(layout: MessageLayout, place: Span | None,
                   around: tuple[str, ...] = ()) -> None:
    """
    Check that all messages within a message are known; `around` are those that contain it.

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
