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
XPath over a tree of `ElementTree`: the part of XPath 1.0 that formats of requirements use.

A path has steps `name`, `*`, `.`, `..`, `@name`, `text()` behind `/` or `//`, with predicates in
brackets: numbers, paths, texts, `=`, `!=`, `and`, `or`, `contains`, `starts-with`, `not`,
`normalize-space`, `position`, `last`. Names are compared without their namespaces. Unlike in
XPath, `@name/text()` is the text of the attribute, as in Ogma's formats.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
import re
from typing import assert_never, NoReturn, TypeAlias
from xml.etree.ElementTree import Element

from fret_monitor.importing.xml_text import name_of, spoken_text
from fret_monitor.model.diagnostics import refuse, Text

_LEXEME = re.compile(r"""\s*(?://|\.\.|!=|[/.@*()\[\],=]|"[^"]*"|'[^']*'|\d+|"""
                     r'[A-Za-z_][\w.-]*(?::[A-Za-z_][\w.-]*)?)')


@dataclass(frozen=True, eq=False)
class XmlValue:
    """The text of an attribute or of an element, which has no nodes below it."""

    text: str


@dataclass(frozen=True, eq=False)
class _Document:
    """What is above the root element."""

    root: Element


Node: TypeAlias = Element | XmlValue | _Document


@dataclass(frozen=True)
class _Step:
    """A step: `test` is a name, `*`, `.`, `..`, `@name` or `text()`; `is_deep` behind `//`."""

    test: str
    is_deep: bool
    predicates: tuple['_Term', ...]


@dataclass(frozen=True)
class XPath:
    """A path; `is_absolute`: it begins above the root element."""

    steps: tuple[_Step, ...]
    is_absolute: bool


@dataclass(frozen=True)
class _Call:
    """An operator or a function with its operands."""

    name: str
    operands: tuple['_Term', ...]


_Term: TypeAlias = XPath | _Call | str | int
_ARGUMENTS = {'contains': 2, 'starts-with': 2, 'not': 1, 'normalize-space': 1, 'position': 0,
              'last': 0}
_MOST_LEXEMES = 200  # so that nesting is limited too
_VISITS = 2_000_000  # of a small file
_VISITS_OF_ELEMENT = 50  # ten paths with a // each, and their conditions
_CHARS_OF_VISIT = 64


class Work:
    """Counts what paths do in a file, and refuses too much of it."""

    def __init__(self, n_elements: int) -> None:
        """Allow what a file of so many elements needs."""
        self._left = _VISITS + _VISITS_OF_ELEMENT * n_elements

    def add(self, visits: int) -> None:
        """Count visits of nodes; raises `CompileError` if there were too many."""
        self._left -= visits
        if self._left < 0:
            refuse('the paths of this format visit too many elements',
                   help='write them with fewer // and conditions')


def parse_path(text: Text) -> XPath:
    """
    Parse a path.

    Raises
    ------
    CompileError
        if it is none, or uses another part of XPath.
    """
    return _Parser(text).path()


class _Parser:
    """Reads a path from its lexemes."""

    def __init__(self, text: Text) -> None:
        self._text = text
        self._lexemes: list[tuple[str, int]] = []
        place = 0
        end = len(text.value.rstrip())
        while place < end:
            found = _LEXEME.match(text.value, place)
            if found is None:
                self._refuse(place + len(text.value[place:]) - len(text.value[place:].lstrip()))
            lexeme = found[0].lstrip()
            self._lexemes.append((lexeme, found.end() - len(lexeme)))
            place = found.end()
        self._place = 0
        if len(self._lexemes) > _MOST_LEXEMES:
            refuse('this path is too long', self._text.span)

    def path(self) -> XPath:
        found = self._path()
        if self._next:
            self._refuse(self._at)
        return found

    @property
    def _next(self) -> str:
        return self._lexemes[self._place][0] if self._place < len(self._lexemes) else ''

    @property
    def _at(self) -> int:
        return self._lexemes[self._place][1] if self._next else len(self._text.value)

    def _take(self, *lexemes: str) -> str:
        """Return the next lexeme if it is one of these, else ''."""
        if self._next not in lexemes:
            return ''
        self._place += 1
        return self._lexemes[self._place - 1][0]

    def _expect(self, lexeme: str) -> None:
        if not self._take(lexeme):
            self._refuse(self._at)

    def _refuse(self, at: int) -> NoReturn:
        size = len(self._text.value)
        at = min(at, max(size - 1, 0))
        refuse('this path cannot be read', self._text.at(at, min(at + 1, size)), 'from here on',
               'paths have names, *, ., .., @name, text() behind / or //, and [conditions]')

    def _path(self) -> XPath:
        first = self._take('/', '//')
        steps = [self._step(first == '//')]
        while sign := self._take('/', '//'):
            steps.append(self._step(sign == '//'))
        return XPath(tuple(steps), bool(first))

    def _step(self, is_deep: bool) -> _Step:
        test = self._take('.', '..', '*')
        if not test and self._take('@'):
            test = '@' + self._name()
        elif not test:
            test = self._name()
            if test == 'text' and self._take('('):
                self._expect(')')
                test = 'text()'
        predicates = []
        while self._take('['):
            predicates.append(self._or())
            self._expect(']')
        return _Step(test, is_deep, tuple(predicates))

    def _name(self) -> str:
        name = self._next
        if not (name[:1].isalpha() or name[:1] in ('_', '*')) or not name:
            self._refuse(self._at)
        self._place += 1
        return name.rpartition(':')[2]

    def _or(self) -> _Term:
        found = self._and()
        while self._take('or'):
            found = _Call('or', (found, self._and()))
        return found

    def _and(self) -> _Term:
        found = self._comparison()
        while self._take('and'):
            found = _Call('and', (found, self._comparison()))
        return found

    def _comparison(self) -> _Term:
        found = self._term()
        if sign := self._take('=', '!='):
            return _Call(sign, (found, self._term()))
        return found

    def _term(self) -> _Term:
        lexeme = self._next
        if lexeme[:1] in ('"', "'"):
            self._place += 1
            return lexeme[1:-1]
        if lexeme.isdecimal():
            self._place += 1
            return int(lexeme)
        is_call = lexeme in _ARGUMENTS and self._lexemes[self._place + 1:][:1] and (
            self._lexemes[self._place + 1][0] == '(')
        return self._call() if is_call else self._path()

    def _call(self) -> _Term:
        name = self._next
        self._place += 1
        self._expect('(')
        operands: list[_Term] = []
        while len(operands) < _ARGUMENTS[name]:
            if operands:
                self._expect(',')
            operands.append(self._or())
        self._expect(')')
        return _Call(name, tuple(operands))


class Tree:
    """A tree of elements in which paths find nodes."""

    def __init__(self, root: Element, work: Work | None = None) -> None:
        """Take the element that paths with `/` begin above; `work` is that of the whole file."""
        self._document = _Document(root)
        self._parents: dict[Element, Node] = {root: self._document}
        for element in root.iter():
            self._parents.update(dict.fromkeys(element, element))
        self._work = work or Work(len(self._parents))
        self._work.add(len(self._parents))

    def part(self, root: Element) -> 'Tree':
        """Return the tree of an element below, whose work counts here."""
        return Tree(root, self._work)

    def text(self, node: Node) -> str:
        """Return the text of a node."""
        found = text_of(node)
        self._work.add(1 + len(found) // _CHARS_OF_VISIT)
        return found

    def find(self, path: XPath) -> list[Node]:
        """Return the nodes of a path, each once; one without `/` begins at the root element."""
        return self._find(path, self._document.root)

    def _find(self, path: XPath, context: Node) -> list[Node]:
        found: list[Node] = [self._document if path.is_absolute else context]
        for step in path.steps:
            found = [*dict.fromkeys(node for each in found for node in self._step(step, each))]
        return found

    def _step(self, step: _Step, node: Node) -> Iterator[Node]:
        for context in self._within(node) if step.is_deep else (node,):
            found = [*self._tested(step.test, context)]
            self._work.add(1 + len(found))
            for predicate in step.predicates:
                found = [item for place, item in enumerate(found, 1)
                         if self._holds(predicate, item, place, len(found))]
            yield from found

    def _within(self, node: Node) -> Iterable[Node]:
        match node:
            case _Document():
                return (node, *node.root.iter())
            case XmlValue():
                return ()
            case _:
                return node.iter()

    def _tested(self, test: str, node: Node) -> Iterator[Node]:
        if test == '.' or isinstance(node, XmlValue) and test == 'text()':
            yield node
        elif isinstance(node, _Document):
            if test in ('*', name_of(node.root)):
                yield node.root
        elif isinstance(node, Element):
            yield from self._of_element(test, node)

    def _of_element(self, test: str, node: Element) -> Iterator[Node]:
        if test == '..':
            yield self._parents[node]
        elif test == 'text()':
            yield from (XmlValue(text) for text in (node.text, *(child.tail for child in node))
                        if text and text.strip())
        elif test.startswith('@'):
            yield from (XmlValue(text) for name, text in node.items()
                        if test[1:] in ('*', name.rpartition('}')[2]))
        else:
            yield from (child for child in node if test in ('*', name_of(child)))

    def _holds(self, term: _Term, node: Node, place: int, count: int) -> bool:
        value = self._value(term, node, place, count)
        return value == place if isinstance(value, int) and not isinstance(value, bool) \
            else bool(value)

    def _value(self, term: _Term, node: Node, place: int,
               count: int) -> list[str] | str | int:
        """Return the value of a term at a node; of a path, the texts of what it finds."""
        match term:
            case XPath():
                return [self.text(item) for item in self._find(term, node)]
            case str() | int():
                return term
            case _Call():
                return self._called(term, node, place, count)
        assert_never(term)

    def _called(self, term: _Call, node: Node, place: int, count: int) -> str | int:
        match term.name:
            case 'and':
                return all(self._holds(item, node, place, count) for item in term.operands)
            case 'or':
                return any(self._holds(item, node, place, count) for item in term.operands)
            case 'not':
                return not self._holds(term.operands[0], node, place, count)
            case 'position':
                return place
            case 'last':
                return count
        return _of_texts(term.name, [self._value(item, node, place, count)
                                     for item in term.operands])


def _of_texts(name: str, values: Sequence[list[str] | str | int]) -> str | int:
    """Return the value of a function of texts; of several nodes, `contains` takes the first."""
    if name in ('=', '!='):
        left, right = (value if isinstance(value, list) else [str(value)] for value in values)
        return any((one == two) is (name == '=') for one in left for two in right)
    texts = [(value[0] if value else '') if isinstance(value, list) else str(value)
             for value in values]
    match name:
        case 'contains':
            return texts[1] in texts[0]
        case 'starts-with':
            return texts[0].startswith(texts[1])
        case _:
            return ' '.join(texts[0].split())


def text_of(node: Node) -> str:
    """Return the text of a node."""
    match node:
        case XmlValue():
            return node.text
        case _Document():
            return spoken_text(node.root)
        case _:
            return spoken_text(node)
