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
The parameters in the arguments of a process, as rcl reads them. Without ROS.

rcl reads them again: what is found here only decides which program reads them.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
import re
from typing import Any

_ROS_ARGUMENTS = '--ros-args'
_END = '--'
_WITH_VALUE = {'-p': '-p', '--param': '-p', '-r': '-r', '--remap': '-r',
               '--params-file': '--params-file'}
_SKIPPED = ('--log-level', '--log-config-file', '--log-file-name', '-e', '--enclave')
_PARAMETERS = 'ros__parameters'
_PLAIN = re.compile(r'(?:\.{0,2}/|~/|package://)?[A-Za-z_][\w./-]*')  # words and paths
_SPECIAL = {'true', 'false', 'yes', 'no', 'on', 'off', 'null'}


class NotUnderstood(Exception):
    """Arguments that are for the node to refuse."""


def given_parameters(arguments: Sequence[str], node_name: str) -> dict[str, Any]:
    """
    Return the parameters that the arguments give a node, by name.

    Raises `NotUnderstood` if there are other arguments than those of ROS, or a value or file
    cannot be read.
    """
    flags = list(_flags(arguments))
    full_name = _full_name(flags, node_name)
    found: dict[str, Any] = {}
    for flag, value in flags:
        if flag == '--params-file':
            found.update(_of_file(Path(value), full_name))
        elif flag == '-p':
            name, separator, text = value.partition(':=')
            node, _, name = name.rpartition(':')
            if not separator:
                raise NotUnderstood
            if node in ('', full_name.rpartition('/')[2]):
                found[name] = _value(text)
    return found


def _flags(arguments: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield the arguments of ROS that are followed by a value."""
    is_ros, left = False, iter(arguments)
    for argument in left:
        if not is_ros and argument != _ROS_ARGUMENTS:
            raise NotUnderstood
        if argument in (_ROS_ARGUMENTS, _END):
            is_ros = argument == _ROS_ARGUMENTS
        elif argument in _WITH_VALUE:
            yield _WITH_VALUE[argument], next(left, '')
        elif argument in _SKIPPED:
            next(left, None)


def _full_name(flags: Sequence[tuple[str, str]], node_name: str) -> str:
    """Return the name of the node after remapping."""
    names = {'__node': node_name, '__name': node_name, '__ns': '/'}
    for flag, value in flags:
        source, _, target = value.partition(':=')
        key = source.rpartition(':')[2]
        if flag == '-r' and key in names:
            names['__node' if key == '__name' else key] = target
    return f'{names["__ns"].rstrip("/")}/{names["__node"]}'


def _value(text: str) -> Any:
    """Return what a text means in YAML; of a plain word without the module, which loads slowly."""
    if text in ('true', 'false'):
        return text == 'true'
    if _PLAIN.fullmatch(text) and text.lower() not in _SPECIAL:
        return text
    import yaml
    try:
        return yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise NotUnderstood from error


def _of_file(path: Path, full_name: str) -> dict[str, Any]:
    """Return the parameters of a file that are for a node."""
    try:
        content = _value(path.read_text(encoding='utf-8'))
    except (OSError, ValueError) as error:
        raise NotUnderstood from error
    found: dict[str, Any] = {}
    for pattern, parameters in _nodes(content, ''):
        if re.fullmatch(_expression(pattern), full_name):
            found.update(_flat(parameters, ''))
    return found


def _nodes(content: Any, name: str) -> Iterator[tuple[str, Any]]:
    """Yield the names of nodes in a file, which may have wildcards, with their parameters."""
    for key, value in content.items() if isinstance(content, Mapping) else ():
        if key == _PARAMETERS:
            yield name, value
        else:
            yield from _nodes(value, f'{name}/{str(key).strip("/")}')


def _expression(pattern: str) -> str:
    """Return a regular expression for names: `**` is any part of one, `*` any word."""
    parts = re.split(r'(/\*\*|\*)', pattern)
    return ''.join({'/**': '(/.*)?', '*': '[^/]+'}.get(part, re.escape(part)) for part in parts)


def _flat(parameters: Any, prefix: str) -> Iterator[tuple[str, Any]]:
    for key, value in parameters.items() if isinstance(parameters, Mapping) else ():
        if isinstance(value, Mapping):
            yield from _flat(value, f'{prefix}{key}.')
        else:
            yield f'{prefix}{key}', value
