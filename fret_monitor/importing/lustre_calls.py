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
Replaces calls of nodes in formulas of Lustre by what the nodes say.

A call becomes the equation of the node's result, in which arguments and other equations stand for
their names. What is used several times, or uses its own past, becomes a definition, such as
`RUN_LENGTH_1_count`. Each call has a state of its own, except that equal calls share theirs.
"""

from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import count
import re

from fret_monitor.bundle.bundle import Language
from fret_monitor.importing.component import (
    ComponentVariable, ImportedComponent, VariableRole, Wording,
)
from fret_monitor.language.cocospec import RESERVED
from fret_monitor.model.diagnostics import refuse
from fret_monitor.model.graph import components, is_cyclic

# The nodes of FRET's library mean what these operators and functions do.
_KEPT = {*RESERVED, 'abs', 'max', 'min'}
_DEEPEST = 100  # nodes that call each other
_MAX_CHARS = 2 ** 24  # of what all calls of a file become
_PART = re.compile(
    r'(?P<HEAD>(?P<NAME>[A-Za-z_$][\w$]*)?\s*\()|(?P<PATH>[A-Za-z_$][\w$]*(?:\.[A-Za-z_$][\w$]*)*)'
    r'|[0-9.]+(?:[eE][+-]?[0-9]+)?|.', re.ASCII | re.DOTALL)
_PLAIN = re.compile(r'[\w$.]+', re.ASCII)


@dataclass(frozen=True)
class CalledNode:
    """A node of one result: its parameters, the types of its names, and its equations."""

    parameters: tuple[str, ...]
    result: str
    types: Mapping[str, str]
    equations: Mapping[str, str]


def without_calls(component: ImportedComponent, find: Callable[[str], CalledNode | None],
                  taken: set[str]) -> ImportedComponent:
    """
    Return a component whose formulas call no node that `find` returns.

    `taken` has the words of the file, which no new definition gets as its name; those of the new
    ones are added. Recursive nodes are still called.

    Raises
    ------
    CompileError
        if the formulas become longer than 16 MiB.
    """
    calls = _Calls(find, taken)
    requirements = tuple(
        replace(item, wordings=tuple(map(calls.replaced, item.wordings)))
        for item in component.requirements)
    variables = tuple(
        replace(item, assignments=tuple(map(calls.replaced, item.assignments)))
        for item in component.variables)
    return replace(component, requirements=requirements,
                   variables=(*variables, *calls.definitions))


class _Calls:
    """Replaces calls, and collects the definitions that they need."""

    def __init__(self, find: Callable[[str], CalledNode | None], taken: set[str]) -> None:
        self.definitions: list[ComponentVariable] = []
        self._find = find
        self._taken = taken
        self._label = ''
        self._nodes: dict[str, CalledNode | None] = {}
        self._known: dict[tuple[str, tuple[str, ...]], str] = {}
        self._open: list[str] = []
        self._numbers: defaultdict[str, Iterator[int]] = defaultdict(lambda: count(1))
        self._chars = 0

    def replaced(self, wording: Wording) -> Wording:
        """Return a wording without calls."""
        if wording.languages != (Language.COCOSPEC,):
            return wording
        self._label = wording.label
        text = self._replaced(wording.text)
        return wording if text == wording.text else replace(wording, text=text)

    def _replaced(self, text: str) -> str:
        levels: list[tuple[str, list[str]]] = [('', [''])]  # what is open, and its arguments
        for part in _PART.finditer(text):
            if part['HEAD']:
                levels.append((part[0], ['']))
            elif part[0] == ')' and len(levels) > 1:
                closed = self._closed(*levels.pop())
                levels[-1][1][-1] += closed
            elif part[0] == ',':
                levels[-1][1].append('')
            else:
                levels[-1][1][-1] += part[0]
        while len(levels) > 1:  # never closed, which the parser reports
            head, arguments = levels.pop()
            levels[-1][1][-1] += head + ','.join(arguments)
        return ','.join(levels[0][1])

    def _closed(self, head: str, arguments: Sequence[str]) -> str:
        """Return what stands for parentheses, or for the call whose arguments they hold."""
        name = head[:-1].strip()
        node = self._node(name)
        given = () if [*arguments] == [''] else tuple(map(str.strip, arguments))
        if node is None or len(given) != len(node.parameters):
            return f'{head}{",".join(arguments)})'
        if (name, given) not in self._known:
            self._open.append(name)
            self._known[name, given] = self._result(name, node, given)
            self._open.pop()
        return self._counted(self._known[name, given])

    def _node(self, name: str) -> CalledNode | None:
        if not name or name in _KEPT or name in self._open or len(self._open) >= _DEEPEST:
            return None
        if name not in self._nodes:
            self._nodes[name] = self._find(name)
        return self._nodes[name]

    def _result(self, name: str, node: CalledNode, arguments: Sequence[str]) -> str:
        """Return the formula of a node's result; define what it uses several times."""
        uses = Counter(item for text in node.equations.values() for item in _names(text))
        uses[node.result] += 1
        prefix = self._free(name, node.types)
        names: dict[str, str] = {}
        for item, argument in zip(node.parameters, arguments, strict=True):
            names[item] = self._named(f'{prefix}_{item}', node.types[item], argument, uses[item])
        graph = {item: [one for one in _names(text) if one in node.equations]
                 for item, text in node.equations.items()}
        for group in components(graph):
            is_own = is_cyclic(group, graph)
            names |= {item: f'{prefix}_{item}' for item in group if is_own}
            for item in group:
                text = self._replaced(_substituted(node.equations[item], names))
                new, kind = f'{prefix}_{item}', node.types[item]
                if is_own:
                    self._define(new, kind, text)
                else:
                    names[item] = self._named(new, kind, text, uses[item])
        return names[node.result]

    def _free(self, name: str, items: Mapping[str, str]) -> str:
        """Return what the names of a call's definitions begin with."""
        number = next(number for number in self._numbers[name]
                      if not {f'{name}_{number}_{item}' for item in items} & self._taken)
        self._taken |= {f'{name}_{number}_{item}' for item in items}
        return f'{name}_{number}'

    def _named(self, name: str, kind: str, text: str, uses: int) -> str:
        """Return what stands for a name: the text itself, or a definition."""
        if _PLAIN.fullmatch(text):
            return text
        if uses <= 1:
            return f'({text})'
        self._define(name, kind, text)
        return name

    def _define(self, name: str, kind: str, text: str) -> None:
        wording = Wording((Language.COCOSPEC,), self._counted(text), f'{self._label}, {name}')
        self.definitions.append(
            ComponentVariable(name, VariableRole.INTERNAL, kind, (wording,)))

    def _counted(self, text: str) -> str:
        self._chars += len(text)
        if self._chars > _MAX_CHARS:
            refuse(f'{self._label}: without calls of nodes, the formulas of the file are longer '
                   f'than {_MAX_CHARS // 2 ** 20} MiB', help='leave out nodes that call many')
        return text


def _names(text: str) -> Iterator[str]:
    """Yield the names in a formula, without fields, and words of the language among them."""
    for part in _PART.finditer(text):
        if part['PATH']:
            yield part[0].partition('.')[0]


def _substituted(text: str, names: Mapping[str, str]) -> str:
    """Return a formula with other texts in place of names."""
    found = []
    for part in _PART.finditer(text):
        first, point, rest = part[0].partition('.') if part['PATH'] else (part[0], '', '')
        found.append(names.get(first, first) + point + rest if part['PATH'] else part[0])
    return ''.join(found)
