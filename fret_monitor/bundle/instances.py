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
Reads the instance variables of a bundle (`for_each`), and where inputs mention them.

An input mentions a variable as `{robot}`: as a whole part of its topic, as the key of an element
(`effort[name = {joint}]`), or in `where`.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
import re
from typing import TypeAlias

from fret_monitor.bundle.bundle import InputEntry, InstanceVariable
from fret_monitor.bundle.declared_name import DeclaredName
from fret_monitor.bundle.yaml_shape import line_of, mapping_of, SECONDS, Shape, text_of
from fret_monitor.bundle.yaml_tree import Node, YamlList
from fret_monitor.model.diagnostics import did_you_mean, Problems, Span, Text
from fret_monitor.model.names import is_integer, LONGEST_KEY, PLACEHOLDER, shown, topic_fault

VARIABLE_KEYS = ('most', 'forget')
VARIABLE_EXAMPLE = 'robot: {most: 100}'
MOST_VARIABLES = 2  # that one input or requirement may mention
_MOST_KEYS = 10 ** 12  # memory allows less: program/layout.py names the bytes
_SHORTEST_FORGET_S, _LONGEST_FORGET_S = SECONDS.sizes['ns'], SECONDS.sizes['h'] * 24 * 365
_NAME = re.compile('[A-Za-z_][A-Za-z0-9_]*')
Variables: TypeAlias = Mapping[str, InstanceVariable | None]
_OF_ROS = ('node', 'ns', 'namespace')  # rcl substitutes these in a topic
_OF_TABLES = ('time', 'step')  # columns of traces and verdicts, beside one of each variable


def read_variable(name: DeclaredName, node: Node, problems: Problems) -> InstanceVariable | None:
    """Return an entry under `for_each`: a list of its keys, or how many there are at most."""
    if not _NAME.fullmatch(name.value) or name.value in (*_OF_ROS, *_OF_TABLES):
        label = "'{node}' and '{ns}' are names of ROS" if name.value in _OF_ROS else \
            'tables have a column of that name' if name.value in _OF_TABLES else \
            "letters, digits and '_'"
        problems.error(f'{shown(name.value)} cannot be the name of an instance variable',
                       name.span, label, VARIABLE_EXAMPLE)
        return None
    if isinstance(node, YamlList):
        keys = tuple(_keys(name, node, problems))
        return InstanceVariable(name.text, keys, len(keys)) if keys else None
    mapping = mapping_of(node, f'the instance variable {shown(name.value)}', problems,
                         f'{name.value}: {{most: 100}}, or a list of its keys: '
                         f'{name.value}: [alpha, beta]')
    if mapping is None:
        return None
    return _found(name, Shape(mapping, 'an instance variable', VARIABLE_KEYS, problems, elsewhere={
        'keys': f'keys that are listed stand alone, without most and forget: {name.value}: '
                '[alpha, beta]'}), problems)


def _keys(name: DeclaredName, node: YamlList, problems: Problems) -> Iterator[Text]:
    first: dict[str, Text] = {}
    if not node.items:
        problems.error(f'{shown(name.value)} has no keys', node.span, 'an empty list',
                       f'{name.value}: [alpha, beta]')
    for item in node.items:
        text = text_of(item, f'a key of {shown(name.value)}', problems)
        if text is None:
            continue
        if len(text.value.encode()) > LONGEST_KEY:
            problems.error(f'a key has at most {LONGEST_KEY} bytes', text.span,
                           f'this has {len(text.value.encode())}')
        elif (same := first.setdefault(text.value, text)) is not text:
            problems.error(f'the key {shown(text.value)} is listed twice', text.span,
                           f'first in {line_of(same, text.span)}',
                           related=same.span)
        else:
            yield text


def _found(name: DeclaredName, shape: Shape, problems: Problems) -> InstanceVariable | None:
    most, forget = shape.text('most'), shape.number(
        'forget', SECONDS, _SHORTEST_FORGET_S, _LONGEST_FORGET_S)
    if shape.lacks('most'):
        problems.error(f"{shown(name.value)} has no 'most'", name.span,
                       'how many instances there are at once at most: it fixes the memory',
                       f'{name.value}: {{most: 100}}')
    if most is None:
        return None
    if not is_integer(most.value) or len(most.value) > 13 or not 0 < int(most.value) <= _MOST_KEYS:
        problems.error(f"'most' must be a whole number from 1 to {_MOST_KEYS}", most.span)
        return None
    if forget is not None and (forget * 10 ** 9).denominator != 1:
        text = shape.text('forget')
        problems.error("'forget' must be a whole number of nanoseconds", text.span if text else
                       shape.span, 'at most nine digits behind the point')
    return InstanceVariable(name.text, (), int(most.value), forget)


def mentioned(text: Text | None) -> list[tuple[str, Span]]:
    """Return the names in braces in a text, each with its place, braces included."""
    return [(match[1].strip(), text.at(*match.span()))
            for match in PLACEHOLDER.finditer(text.value)] if text else []


def with_mentions(entry: InputEntry, texts: Iterable[Text | None], variables: Variables,
                  problems: Problems) -> InputEntry:
    """
    Return an input with the variables that it mentions in some texts, besides those it has.

    A variable that is None was refused: its uses are not reported.
    """
    found = dict.fromkeys(entry.variables)
    for name, place in (item for text in texts for item in mentioned(text)):
        if is_unknown(name, variables):
            report_unknown(name, place, variables, problems)
        elif name in variables and name not in found:
            found[name] = None
            if len(found) == MOST_VARIABLES + 1:
                problems.error(f'an input mentions at most {MOST_VARIABLES} instance variables',
                               place, 'here are ' + ', '.join(found))
    used = tuple(name for name in variables if name in found)
    is_damaged = any(variables[name] is None for name in used)
    return replace(entry, variables=used,
                   damaged=entry.damaged | ({'variables'} if is_damaged else set()))


def is_unknown(name: str, variables: Iterable[str]) -> bool:
    """Return whether a name in braces is neither an instance variable nor one of ROS."""
    return name not in variables and name not in _OF_ROS


def report_unknown(name: str, place: Span, variables: Iterable[str],
                   problems: Problems) -> None:
    """Report a name in braces that is no instance variable."""
    names = list(variables)
    problems.error(f'there is no instance variable {shown(name)}', place, 'not declared',
                   did_you_mean(name, names) or 'declare it, as in\nfor_each: '
                   f'{{{name if _NAME.fullmatch(name) else "robot"}: {{most: 100}}}}')


def check_topic_mentions(topic: Text | None, variables: Variables, problems: Problems) -> None:
    """Check that variables are whole parts of a topic, and that their keys make topics."""
    names = [name for name, _ in mentioned(topic) if name in variables]
    if topic is None or not names:
        return
    for name, place in mentioned(topic):
        parts = [part for part in topic.value.split('/') if f'{{{name}}}' in part]
        if name in names and parts != [f'{{{name}}}']:
            wrong = next((part for part in parts if part != f'{{{name}}}'), '')
            problems.error(f"'{{{name}}}' must be a whole part of the topic's name" if wrong else
                           f"the topic mentions '{{{name}}}' twice", place,
                           f'here it is inside {shown(wrong)}' if wrong else 'once is enough',
                           f'topic: "{topic.value.replace(wrong, f"{{{name}}}")}"'
                           if wrong else '')
            return
    for key in (key for name in names if (item := variables[name]) for key in item.keys):
        made = PLACEHOLDER.sub(key.value, topic.value)
        if '/' in key.value or topic_fault(made):
            problems.error(f'the key {shown(key.value)} makes no valid topic', key.span,
                           f'of {shown(topic.value)} in {line_of(topic, key.span)}',
                           "letters, digits and '_', not beginning with a digit")


def check_variables(variables: Iterable[InstanceVariable], inputs: Iterable[InputEntry],
                    problems: Problems) -> None:
    """Report variables that no input mentions."""
    used = {name for item in inputs for name in item.variables}
    for item in variables:
        if item.name.value not in used:
            problems.error(f'no input mentions {shown(item.name.value)}', item.name.span,
                           'its instances would have no inputs',
                           f'topic: "/{{{item.name.value}}}/odom"')
