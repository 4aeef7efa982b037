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
A YAML text as a tree of nodes with places: no types, no anchors, no tags, no merges.

`read_tree` reads one document and reports the errors of YAML. If a value is invalid because it is
not in quotes, the error gives the line to paste, the tree has an `Unread` node, and reading
continues, so that the rest of the file is checked in the same run.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
import re
from typing import Protocol, TypeAlias

from fret_monitor.bundle.yaml_repair import report_comma, report_misread, YamlRepair
from fret_monitor.bundle.yaml_text import scalar_text
from fret_monitor.model.diagnostics import Problems, Source, Span, Text
from fret_monitor.model.names import shown
import yaml

MAX_DEPTH = 20
MAX_NODES = 500_000

# The C scanner reads 1,000 requirements in 20 ms; the one in Python needs a second.
_Loader: type = getattr(yaml, 'CSafeLoader', yaml.SafeLoader)

_UNPRINTABLE = re.compile(
    '[^\t\n\r\x20-\x7e\x85\xa0-\ud7ff\ue000-\ufefe\uff00-\ufffd\U00010000-\U0010ffff]')
_MARK = re.compile(r'(\S+)[ \t]*(\S?)')


@dataclass(frozen=True, eq=False)
class YamlScalar:
    """A text; `style` is '' (plain), "'", '"', '|' or '>', `span` includes the quotes."""

    text: Text
    style: str
    span: Span

    @property
    def value(self) -> str:
        """The text as a string."""
        return self.text.value

    @property
    def is_missing(self) -> bool:
        """Whether the value is missing."""
        return not self.style and not self.text.value


@dataclass(frozen=True, eq=False)
class YamlList:
    """A list of nodes; `span` is where it begins."""

    items: tuple['Node', ...]
    span: Span


@dataclass(frozen=True, eq=False)
class YamlMapping:
    """Keys, each once, with their nodes; `is_flow` if it is written with braces."""

    entries: tuple[tuple[YamlScalar, 'Node'], ...]
    is_flow: bool
    span: Span


@dataclass(frozen=True, eq=False)
class Unread:
    """A value that cannot be read, which was reported."""

    span: Span


Node: TypeAlias = YamlScalar | YamlList | YamlMapping | Unread


def read_tree(source: Source, problems: Problems) -> Node | None:
    """
    Read the one document of a source.

    Returns None if the document is empty; for invalid YAML, several documents or too deep nesting,
    also reports the problem.
    """
    if _refuse_unprintable(source, problems):
        return None
    repair = YamlRepair(source, problems)
    while True:
        builder = _TreeBuilder(source, repair.unread)
        try:
            builder.build(_events(repair.text))
        except yaml.YAMLError as error:
            if repair.mend(error):
                continue
            builder.root = None
        problems.extend(builder.problems.errors)
        return builder.root


def _refuse_unprintable(source: Source, problems: Problems) -> bool:
    match = _UNPRINTABLE.search(source.text, 1 if source.text.startswith('\ufeff') else 0)
    if match is None:
        return False
    problems.error(f'the character U+{ord(match[0]):04X} is not text',
                   Span(source, match.start(), match.end()), 'remove it')
    return True


def _events(text: str) -> Iterator[yaml.Event]:
    """Yield the events of a text; their marks do not count a byte order mark."""
    yield from yaml.parse(text, Loader=_Loader)


@dataclass
class _Open:
    """A collection that is being read."""

    event: yaml.CollectionStartEvent
    items: list[Node] = field(default_factory=list)


class _TooMuch(Exception):
    """The tree is too deep or too large, which was reported."""


class _TreeBuilder:
    """Builds the tree from the events of one document, without recursion."""

    def __init__(self, source: Source, unread: frozenset[int]) -> None:
        self.source = source
        self.problems = Problems()
        self.root: Node | None = None
        self._unread = unread
        self._shift = 1 if source.text.startswith('\ufeff') else 0
        self._open: list[_Open] = []
        self._documents = 0
        self._nodes = 0
        self._anchors: set[str] = set()

    def build(self, events: Iterator[yaml.Event]) -> None:
        """
        Take all events.

        Raises
        ------
        yaml.YAMLError
            if the text is not YAML; the tree is then not usable.
        """
        try:
            for event in events:
                self._take(event)
        except _TooMuch:
            self.root = None

    def _take(self, event: yaml.Event) -> None:
        match event:
            case yaml.ScalarEvent():
                self._add(self._scalar(event))
            case yaml.SequenceStartEvent() | yaml.MappingStartEvent():
                self._start(event)
            case yaml.SequenceEndEvent() | yaml.MappingEndEvent():
                self._add(self._collection(self._open.pop()))
            case yaml.AliasEvent():
                self._add(self._alias(event))
            case yaml.DocumentStartEvent():
                self._document(event)
            case _:
                pass

    def _document(self, event: yaml.Event) -> None:
        self._documents += 1
        if self._documents > 1:
            self.problems.error(
                'a bundle must be one YAML document', self._span(event),
                'a second one begins here', 'remove this line, or make it a file of its own')
            raise _TooMuch

    def _span(self, event: yaml.Event) -> Span:
        start, end = _index(event.start_mark), _index(event.end_mark)
        return Span(self.source, start + self._shift, max(start, end) + self._shift)

    def _add(self, node: Node) -> None:
        self._nodes += 1
        if self._nodes > MAX_NODES:
            self.problems.error(f'the file has more than {MAX_NODES:,} values', node.span)
            raise _TooMuch
        if self._open:
            self._open[-1].items.append(node)
        elif self._documents == 1:
            self.root = node

    def _start(self, event: yaml.CollectionStartEvent) -> None:
        self._open.append(_Open(event))
        if len(self._open) > MAX_DEPTH:
            self.problems.error(f'nested more than {MAX_DEPTH} levels deep', self._span(event))
            raise _TooMuch

    def _scalar(self, event: yaml.ScalarEvent) -> Node:
        span = self._span(event)
        if span.start in self._unread:
            return Unread(span)
        if event.anchor or event.tag:
            return self._marked(event)
        style = event.style if event.style and event.style in '\'"|>' else ''
        text = scalar_text(self.source, span.start, event.value, style)
        if style in ('', '|', '>'):
            span = Span(self.source, span.start, text.offsets[-1])
        return YamlScalar(text, style, span)

    def _collection(self, item: _Open) -> Node:
        start = self._span(item.event).start
        span = Span(self.source, start, start + 1)
        if item.event.anchor or item.event.tag:
            return self._marked(item.event)
        if isinstance(item.event, yaml.SequenceStartEvent):
            return YamlList(tuple(item.items), span)
        return YamlMapping(self._entries(item.items), bool(item.event.flow_style), span)

    def _entries(self, items: list[Node]) -> tuple[tuple[YamlScalar, Node], ...]:
        found: dict[str, tuple[YamlScalar, Node]] = {}
        for key, value in zip(items[::2], items[1::2], strict=True):
            if isinstance(key, YamlScalar) and self._is_new(key, found):
                found[key.value] = (key, value)
            elif isinstance(key, YamlList | YamlMapping):
                self.problems.error('a key must be a word', key.span, 'this is a list or mapping')
        return tuple(found.values())

    def _is_new(self, key: YamlScalar, found: dict[str, tuple[YamlScalar, Node]]) -> bool:
        if key.value == '<<' and not key.style:
            self.problems.error('YAML merge keys are not supported', key.span,
                                "'<<' would merge another mapping", 'write the keys out')
            return False
        first = found.get(key.value)
        if first is not None:
            self.problems.error(f'{shown(key.value)} is given twice', key.span,
                                f'first in line {first[0].span.line}', related=first[0].span)
        return first is None

    def _alias(self, event: yaml.AliasEvent) -> Node:
        span = self._span(event)
        if event.anchor in self._anchors:
            self.problems.error('YAML aliases are not supported', span,
                                f"refers to '&{event.anchor}'", 'write the value out')
        else:
            report_misread(self.source, span.start, self.problems)
        return Unread(span)

    def _marked(self, event: yaml.ScalarEvent | yaml.CollectionStartEvent) -> Node:
        """Refuse a node with a tag or an anchor."""
        span = self._span(event)
        if self._is_cut(span):
            return Unread(span)
        if event.anchor:
            self._anchors.add(event.anchor)
        match = _MARK.match(self.source.text, span.start)
        mark, rest = match.groups() if match else ('', '')
        is_text = isinstance(event, yaml.ScalarEvent)
        if mark.startswith('!!') or not is_text and (event.anchor or not rest):
            kind = 'tags' if mark.startswith('!') else 'anchors'
            self.problems.error(f'YAML {kind} are not supported',
                                Span(self.source, span.start, span.start + len(mark)),
                                'remove it')
        else:
            report_misread(self.source, span.start, self.problems)
        return Unread(span)

    def _is_cut(self, mark: Span) -> bool:
        """Report `f(1, !p)` in braces, of which YAML makes a value and a key with a tag."""
        if not self._open or not isinstance(self._open[-1].event, yaml.MappingStartEvent):
            return False
        items = self._open[-1].items
        if not self._open[-1].event.flow_style or not items or len(items) % 2:
            return False
        first = len(items) - 1
        while first > 1 and isinstance(rest := items[first], YamlScalar) and rest.is_missing:
            first -= 2
        key, value = items[first - 1:first + 1]
        if isinstance(key, YamlScalar) and isinstance(value, YamlScalar) and not value.style:
            report_comma(key.text, Span(self.source, value.span.start, mark.end), self.problems)
            items[first:] = [Unread(value.span)]
        return isinstance(items[first], Unread)  # which was reported


class _Mark(Protocol):
    index: int


def _index(mark: _Mark | None) -> int:
    return mark.index if mark else 0
