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
Reads state diagrams: Mermaid `graph` and `stateDiagram-v2`, and DOT.

A diagram becomes states and edges with the texts of their conditions, which are not read here.
What would change the meaning of the edges, such as nested states and edges without a direction, is
refused with its place.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
import html
from itertools import pairwise
import re
from typing import NoReturn

from fret_monitor.model.diagnostics import Problems, refuse, Source, Span

_KIND = re.compile(r'(graph|flowchart|stateDiagram(?:-v2)?|(?:strict\s+)?digraph)\b')
_UNDIRECTED = re.compile(r'(?:strict\s+)?graph\b[^\n{;]*\{')
_SKIPPED = re.compile(r'\s+|%%[^\n]*|//[^\n]*|/\*.*?\*/|\#[^\n]*|---\n.*?\n---(?=\n)', re.DOTALL)


@dataclass(frozen=True)
class Edge:
    """An edge; `condition` is a text, '' if it is always taken; `place` is that of its text."""

    origin: str
    target: str
    condition: str
    place: Span


@dataclass(frozen=True)
class Diagram:
    """The edges in their order; `initial` is the state that a diagram marks as the first one."""

    edges: tuple[Edge, ...]
    initial: str = ''

    @property
    def states(self) -> tuple[str, ...]:
        """The states: by number if they are numbers, else in the order of the file."""
        found = dict.fromkeys(name for edge in self.edges for name in (edge.origin, edge.target))
        if self.initial and self.initial not in found:
            found = {self.initial: None, **found}
        return tuple(sorted(found, key=int) if all(map(str.isdigit, found)) else found)


def is_diagram(text: str) -> bool:
    """Whether a text begins as a diagram does."""
    return _kind(text) is not None


def _kind(text: str) -> re.Match[str] | None:
    place = 0
    while skipped := _SKIPPED.match(text, place):
        place = skipped.end()
    return _KIND.match(text, place)


def read_diagram(source: Source, problems: Problems) -> Diagram:
    """
    Return the diagram of a file that `is_diagram`.

    Raises
    ------
    CompileError
        if it cannot be read, or has no edge.
    """
    kind = _kind(source.text)
    assert kind is not None
    if _UNDIRECTED.match(source.text, kind.start()):
        _stop(source, kind, 'an edge of a state diagram has a direction', "write 'digraph', '->'")
    if kind[1].endswith('digraph'):
        found = Diagram(tuple(_Dot(source, kind.end()).edges()))
    elif kind[1].startswith('stateDiagram'):
        found = _states(source, kind.end(), problems)
    else:
        found = Diagram(tuple(_graph(source, kind.end())))
    if not found.edges:
        _stop(source, kind, 'the diagram has no edge', '')
    if len({name.isdigit() for name in found.states}) > 1:
        _stop(source, kind, 'some states are numbers and some are names',
              'the states are ' + ', '.join(found.states))
    return found


def _stop(source: Source, match: re.Match[str], title: str, help: str) -> NoReturn:
    refuse(title, Span(source, match.start(), max(match.end(), match.start() + 1)), '', help)


# Mermaid

_STATEMENT = re.compile(r'(?:"[^"\n]*"|\|[ \t]*"[^"\n]*"[ \t]*\||\|[^|\n]*\||%%[^\n]*'
                        r'|&?\#?\w+;(?=[^\n]*\|)|[^;\n])+')
_NODE = re.compile(r'\s*(\w+)\s*(?:\[[^]\n]*\]+|\(+[^)\n]*\)+|\{+[^}\n]*\}+|>[^]\n]*\])?'
                   r'(?::::\w+)?\s*')
_LINK = re.compile(r'(?:--+>|==+>|-\.+->)\s*(?:\|([ \t]*"[^"\n]*"[ \t]*|[^|\n]*)\|)?'
                   r'|(?:--|==|-\.)\s*([^-=.\n|>][^\n]*?)\s*(?:--+>|==+>|\.+->)')
_HEAD = re.compile(r'[^;\n]*')
_DRAWING = re.compile(r'\s*(?:direction|classDef|class|style|linkStyle|click|accTitle|accDescr|'
                      r'hide|title)\b')
_NOTE = re.compile(r'^[ \t]*note\b[^:\n]*\n.*?^[ \t]*end note\b', re.DOTALL | re.MULTILINE)
_NESTING = re.compile(r'\s*(?:subgraph|end)\b|[^"\n]*\{\s*$|\s*--\s*$|[^"\n]*<<')
_NESTED = 'nested and concurrent states cannot be read'
_FLAT = 'write one diagram without them for each input'


def _statements(source: Source, start: int) -> Iterator[re.Match[str]]:
    """Yield the statements that are no comments and do not only concern the drawing."""
    head = _HEAD.match(source.text, start)
    notes = [match.span() for match in _NOTE.finditer(source.text)]
    for match in _STATEMENT.finditer(source.text, head.end() if head else start):
        text = match[0]
        is_skipped = not text.strip() or text.lstrip().startswith('%%') or _DRAWING.match(text)
        if not is_skipped and not any(at <= match.start() < end for at, end in notes):
            if _NESTING.match(text):
                _stop(source, _trimmed(match, source), _NESTED, _FLAT)
            yield _trimmed(match, source)


def _trimmed(match: re.Match[str], source: Source) -> re.Match[str]:
    """Return a match without the blanks around it."""
    found = re.compile(r'\S(?:[^\n]*\S)?').search(source.text, match.start(), match.end())
    return found or match


def _graph(source: Source, start: int) -> Iterator[Edge]:
    for statement in _statements(source, start):
        yield from _chain(source, statement)


def _chain(source: Source, statement: re.Match[str]) -> Iterator[Edge]:
    """Yield the edges of `A --> B`, or of `A --> B --> C`."""
    end = statement.end()
    node = _NODE.match(source.text, statement.start(), end)
    while node and node.end() < end:
        link = _LINK.match(source.text, node.end(), end)
        target = link and _NODE.match(source.text, link.end(), end)
        if not link or not target:
            break
        group = 1 if link[1] is not None else 2
        place = Span(source, *link.span(group)) if link[group] else Span(
            source, node.start(1), target.end(1))
        yield Edge(node[1], target[1], _label(link[group] or ''), place)
        node = target
    if not node or node.end() < end:
        _stop(source, statement, 'this is no edge of a diagram', 'write A -->|condition| B'
              + (', with quotes around a condition with |' if '|' in statement[0] else ''))


def _label(text: str) -> str:
    """Return a label without quotes; `#lt;` and `&lt;` are signs."""
    plain = html.unescape(re.sub(r'#(\w+);', r'&\1;', text.strip()))
    return ' '.join(plain.removeprefix('"').removesuffix('"').split())


_MOVE = re.compile(r'(\[\*\]|\w+)\s*-->\s*(\[\*\]|\w+)\s*(?::\s*(.*))?')
_LONE = re.compile(r'(?:state\s+(?:"[^"]*"\s+as\s+)?\w+|\w+)\s*(?::.*)?|note\b.*')


def _states(source: Source, start: int, problems: Problems) -> Diagram:
    """Return a `stateDiagram`."""
    edges: list[Edge] = []
    initial = ''
    for statement in _statements(source, start):
        move = _MOVE.fullmatch(source.text, statement.start(), statement.end())
        if move is None and not _LONE.fullmatch(statement[0]):
            _stop(source, statement, 'this is no edge of a diagram', 'write A --> B : condition')
        elif move is None:
            continue
        elif move[1] == '[*]' and initial not in ('', move[2]):
            _stop(source, statement, f'the first state is {initial} already', '')
        elif move[1] == '[*]':
            initial = move[2]
        elif move[2] == '[*]':
            problems.warning('an end of the diagram is left out', Span(source, *move.span()), '',
                             f'the state stays {move[1]} then')
        else:
            edges.append(Edge(move[1], move[2], _label(move[3] or ''),
                              Span(source, *(move.span(3) if move[3] else move.span()))))
    return Diagram(tuple(edges), initial)


# DOT

# What is opened and not closed goes to the end, so that each character is read once.
_TOKEN = re.compile(r'\s+|//[^\n]*|/\*.*?(?:\*/|\Z)|^\#[^\n]*|(?P<token>"(?:\\.|[^"\\])*"?|->|--|'
                    r'-?(?:\d+(?:\.\d*)?|\.\d+)|\w+|[{}\[\]=;,:]|.)', re.DOTALL | re.MULTILINE)


class _Dot:
    """Reads the statements of a `digraph`."""

    def __init__(self, source: Source, start: int) -> None:
        self._source = source
        self._tokens = [match for match in _TOKEN.finditer(source.text, start) if match['token']]
        self._place = 0

    def edges(self) -> Iterator[Edge]:
        """Yield the edges of the graph."""
        if self._next() != '{':
            self._take()
        self._expect('{')
        while self._next() not in ('}', ''):
            yield from self._statement()
        self._expect('}')
        if self._next():
            self._refuse('a file has one diagram', '')

    def _statement(self) -> Iterator[Edge]:
        first = self._take()
        name = _unquoted(first['token'])
        if name in ('subgraph', '{'):
            self._place -= 1
            self._refuse(_NESTED, _FLAT)
        names = [(name, first)]
        if self._next() == '=':
            self._place += 2
        while self._next() == '->':
            self._place += 1
            token = self._take()
            names.append((_unquoted(token['token']), token))
        label = self._attributes()
        if label and name == 'edge':
            self._refuse('a label for all edges cannot be read', 'write it at each edge')
        if self._next() in (';', ','):
            self._place += 1
        elif self._next() in ('--', ':', '[', '='):
            self._refuse('this is no edge of a diagram', 'write A -> B [label="condition"];')
        for (origin, begin), (target, end) in pairwise(names):
            place = label or (begin.start(), end.end())
            text = _unquoted(self._source.text[slice(*label)]) if label else ''
            yield Edge(origin, target, _label(text), Span(self._source, *place))

    def _attributes(self) -> tuple[int, int] | None:
        """Read `[name=value, ...]`, if there is one; return the place of the label."""
        found = None
        while self._next() == '[':
            self._place += 1
            while self._next() not in (']', ''):
                name = self._take()['token']
                if self._next() == '=':
                    self._place += 1
                    value = self._take()
                    if value['token'] == '<':
                        self._place -= 1
                        self._refuse('a label in HTML cannot be read', 'write label="condition"')
                    found = value.span() if _unquoted(name) == 'label' else found
                if self._next() in (',', ';'):
                    self._place += 1
            self._expect(']')
        return found

    def _next(self) -> str:
        return self._tokens[self._place]['token'] if self._place < len(self._tokens) else ''

    def _take(self) -> re.Match[str]:
        if not self._next():
            self._refuse('the diagram ends too early', "a '}' is missing")
        self._place += 1
        return self._tokens[self._place - 1]

    def _expect(self, token: str) -> None:
        if self._next() != token:
            self._refuse(f"'{token}' is missing here", '')
        self._place += 1

    def _refuse(self, title: str, help: str) -> NoReturn:
        place: Sequence[re.Match[str]] = self._tokens[self._place:] or self._tokens[-1:]
        start, end = place[0].span() if place else (0, 1)
        refuse(title, Span(self._source, start, end), '', help)


def _unquoted(token: str) -> str:
    """Return a token of DOT without quotes; a line break in it is a blank."""
    if token[:1] != '"':
        return token
    return re.sub(r'\\([nlr])', ' ', token[1:-1]).replace('\\"', '"').strip()
