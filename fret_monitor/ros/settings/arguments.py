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
The parameters in the arguments of a process, as rclpy finds them for a node. Without rclpy.

rcl reads values and files: its library for them is loaded in 1 ms, the rest of rcl in 25. The node
reads them again: what is found here only decides which program that is.
"""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from ctypes import (
    c_bool, c_double, c_int64, c_size_t, c_void_p, CDLL, sizeof, string_at, Structure,
)
from itertools import pairwise
from os import fsdecode, fsencode
import re
from typing import Any

_PARAMETER, _RULE, _FILE = ('-p', '--param'), ('-r', '--remap'), '--params-file'
_WITH_VALUE = (*_PARAMETER, *_RULE, _FILE, '--log-level', '--log-config-file', '--log-file-name',
               '-e', '--enclave')
_WORD = sizeof(c_void_p)
_OF_NODE, _OF_VALUE = 4, 9  # words of rcl_node_params_t and rcl_variant_t


class NotUnderstood(Exception):
    """Arguments that are for the node to refuse."""


class SeveralTypes(Exception):
    """A parameter has values of several types; rcl then takes one that need not be the last."""


class _Allocator(Structure):
    _fields_ = (('functions', c_void_p * 5),)


def given_parameters(arguments: Sequence[str], node_name: str) -> dict[str, Any]:
    """
    Return the parameters that the arguments give a node, by name.

    Raises `NotUnderstood` if there are other arguments than those of ROS, a value or file cannot
    be read, or the library of rcl is not found; `SeveralTypes` with the name of a parameter.
    """
    flags = list(_flags(arguments))
    rules = [value for flag, value in flags if flag in _RULE]
    name = _remapped(rules, node_name, '__(?:node|name)', node_name)
    full_name = f'{_remapped(rules, name, "__ns", "/").rstrip("/")}/{name}'
    patterns, nodes, n = _words(_given_to_all(flags), 3)
    found: dict[str, Any] = {}
    for k, pattern in enumerate(_texts(patterns, n)):
        # As in rclpy: `*` is one part of a name, `**` any number of them.
        expression = f'/{pattern.removeprefix("/")}'.replace('/*', r'(/\w+)')
        if re.fullmatch(expression, full_name):
            names, values, n_given, _ = _words(nodes + k * _OF_NODE * _WORD, _OF_NODE)
            for at, given in enumerate(_texts(names, n_given)):
                value = values + at * _OF_VALUE * _WORD
                if sum(map(bool, _words(value, _OF_VALUE))) > 1:
                    raise SeveralTypes(given)
                found[given] = _value(value)
    return found


def refuse_several_types(arguments: Sequence[str], node_name: str) -> None:
    """Raise `SeveralTypes` if a parameter is given values of several types."""
    names = [value.partition(':=')[0]
             for flag, value in pairwise(arguments) if flag in _PARAMETER]
    if len(names) > len(set(names)) or _FILE in arguments:
        with suppress(NotUnderstood):
            given_parameters(arguments, node_name)


def _flags(arguments: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Yield the arguments of ROS that are followed by a value."""
    is_ros, left = False, iter(arguments)
    for argument in left:
        if argument == '--ros-args':
            is_ros = True
        elif is_ros and argument == '--':
            is_ros = False
        elif is_ros and argument in _WITH_VALUE:
            yield argument, next(left, '')
        elif not is_ros or not re.match('--(?:en|dis)able-', argument):
            raise NotUnderstood


def _remapped(rules: Sequence[str], node: str, source: str, otherwise: str) -> str:
    """Return the target of the first rule for a node's name or namespace."""
    matches = (re.fullmatch(f'(?:{node}:)?{source}:=(.*)', rule) for rule in rules)
    return next((match[1] for match in matches if match), otherwise)


def _given_to_all(flags: Sequence[tuple[str, str]]) -> int:
    """Return the address of an rcl_params_t: what all nodes are given, in its order."""
    try:
        rcl = CDLL('librcl_yaml_param_parser.so')
    except OSError as error:
        raise NotUnderstood from error
    rcl.rcutils_get_default_allocator.restype = _Allocator
    rcl.rcl_yaml_node_struct_init.restype = c_void_p
    rcl.rcl_parse_yaml_file.restype = rcl.rcl_parse_yaml_value.restype = c_bool
    address: int = rcl.rcl_yaml_node_struct_init(rcl.rcutils_get_default_allocator())
    given = c_void_p(address)
    for flag, value in flags:
        is_read = flag not in _RULE or ':=' in value
        if flag == _FILE:
            is_read = rcl.rcl_parse_yaml_file(fsencode(value), given)
        elif flag in _PARAMETER:
            rule = re.fullmatch(r'(?:(\w+):(?!=))?([^:]+):=(.*)', value, re.DOTALL)
            is_read = rule is not None and rcl.rcl_parse_yaml_value(
                *map(fsencode, (rule[1] or '/**', rule[2], rule[3])), given)
        if not is_read:
            rcl.rcutils_reset_error()
            raise NotUnderstood
    return address


def _words(address: int, n: int) -> Sequence[int]:
    """Return words of memory, which are pointers or sizes."""
    return (c_size_t * n).from_address(address)[:]


def _texts(address: int, n: int) -> list[str]:
    return [fsdecode(string_at(text)) for text in _words(address, n)]


def _value(address: int) -> Any:
    """Return the value of an rcl_variant_t; of a list of anything but texts, one of None."""
    kinds: Sequence[Any] = (c_bool, c_int64, c_double)
    pointers = _words(address, _OF_VALUE)
    for kind, pointer in zip(kinds, pointers):
        if pointer:
            return kind.from_address(pointer).value
    text, texts = pointers[3], pointers[8]
    if text:
        return fsdecode(string_at(text))
    if texts:
        n, items = _words(texts, 2)
        return _texts(items, n)
    return [None] if any(pointers) else None
