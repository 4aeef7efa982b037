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
Reads requirements from XML: a format says where they are, with XPath expressions.

A format is a small YAML, or a file of Ogma (`XMLFormat {...}`). The requirements become the rows
of a table, whose columns are what the format names; variables become declarations.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
import re
from typing import NoReturn, TypeAlias
from xml.etree.ElementTree import Element

from fret_monitor.bundle.bundle import Language
from fret_monitor.bundle.source_file import read_source
from fret_monitor.bundle.yaml_shape import mapping_of, Shape
from fret_monitor.bundle.yaml_tree import read_tree
from fret_monitor.importing.component import ComponentVariable, VariableRole, Wording
from fret_monitor.importing.xml_text import parsed_xml
from fret_monitor.importing.xpath import parse_path, Tree, XPath
from fret_monitor.model.diagnostics import Problems, refuse, Source, Span, Text
from fret_monitor.model.names import shown

COLUMNS = ('id', 'text', *(item.value for item in Language), 'title', 'rationale', 'component')
"""What a format may name of a requirement."""

_INPUTS = ('inputs', 'input_name', 'input_type')
_DEFINITIONS = ('definitions', 'definition_name', 'definition_text', 'definition_type')
FORMAT_KEYS = ('requirements', *COLUMNS, *_INPUTS, *_DEFINITIONS)
"""The keys of a format."""

_EXAMPLE = 'requirements: //requirement\nid: "@id"\ntext: statement'
_OGMA = {
    'specRequirements': 'requirements', 'specRequirementId': 'id', 'specRequirementDesc': 'title',
    'specRequirementExpr': 'text', 'specExternalVars': 'inputs', 'specExternalVarId': 'input_name',
    'specExternalVarType': 'input_type', 'specInternalVars': 'definitions',
    'specInternalVarId': 'definition_name', 'specInternalVarExpr': 'definition_text',
    'specInternalVarType': 'definition_type'}
_LEFT_OUT = ('specRequirementResultType', 'specRequirementResultExpr')
_TOKEN = re.compile(r'\s*(?:([{},=()])|([A-Za-z]\w*)|"((?:[^"\\]|\\.)*)")')
_ESCAPE = re.compile(r'\\(.)')


@dataclass(frozen=True)
class _Query:
    """A path as written; `key` in it stands for the texts that `found_by` finds in the file."""

    path: Text
    key: str = ''
    found_by: Text | None = None


@dataclass(frozen=True)
class XmlFormat:
    """Where requirements, inputs and definitions are in a file: paths by the keys of a format."""

    queries: Mapping[str, _Query]


@dataclass(frozen=True)
class XmlContent:
    """What was found: a table of requirements, with its heads, and variables."""

    rows: list[tuple[str, ...]]
    variables: tuple[ComponentVariable, ...] = field(default=())


def read_format(path: Path) -> XmlFormat:
    """
    Read a format.

    Raises
    ------
    CompileError
        if it is none, or a path in it cannot be read.
    """
    source = read_source(path)
    begin = source.text.lstrip()
    if begin.startswith('JSONFormat'):
        refuse(f'{shown(str(path))} is a format for JSON', Span(source, 0, 1), '',
               'the JSON of FRET and Ogma is read without a format; save other JSON as a table')
    found = _of_ogma(source) if begin.startswith('XMLFormat') else _of_yaml(source)
    for needed in ('requirements', 'id'):
        if needed not in found:
            refuse(f"{shown(str(path))} has no path to '{needed}'", help=_EXAMPLE)
    if not found.keys() & {'text', *(item.value for item in Language)}:
        refuse(f'{shown(str(path))} has no path to the texts of requirements', help=_EXAMPLE)
    return XmlFormat(found)


def _of_yaml(source: Source) -> dict[str, _Query]:
    problems = Problems()
    node = read_tree(source, problems)
    problems.raise_errors()
    mapping = mapping_of(node, 'a format', problems, _EXAMPLE) if node else None
    if mapping is None:
        problems.raise_errors()
        refuse('the format is empty', Span(source, 0, 0), help=_EXAMPLE)
    shape = Shape(mapping, 'a format', FORMAT_KEYS, problems)
    texts = {key: text for key in FORMAT_KEYS if (text := shape.text(key))}
    problems.raise_errors()
    for text in texts.values():
        parse_path(text)
    return {key: _Query(text) for key, text in texts.items()}


# Ogma's formats are records of Haskell.

_Value: TypeAlias = Text | tuple['_Value', '_Value'] | None


class _Record:
    """Reads `XMLFormat { field = value, ... }`."""

    def __init__(self, source: Source) -> None:
        self._source = source
        self._tokens: list[tuple[str, int, bool]] = []  # (text, place, whether it is a string)
        place, end = 0, len(source.text.rstrip())
        while place < end:
            found = _TOKEN.match(source.text, place)
            if found is None:
                self._refuse(place)
            group = found.lastindex or 1
            self._tokens.append((found[group], found.start(group), group == 3))
            place = found.end()
        self._place = 0

    def fields(self) -> Iterator[tuple[str, _Value, int]]:
        """Yield names, values and places."""
        self._expect('XMLFormat')
        self._expect('{')
        while True:
            name, place, _ = self._take()
            self._expect('=')
            yield name, self._value(), place
            sign, place, is_text = self._take()
            if sign == '}' and not is_text:
                return
            if sign != ',' or is_text:
                self._refuse(place)

    def _take(self) -> tuple[str, int, bool]:
        if self._place == len(self._tokens):
            self._refuse(len(self._source.text) - 1)
        self._place += 1
        return self._tokens[self._place - 1]

    def _expect(self, wanted: str) -> None:
        found, place, is_text = self._take()
        if found != wanted or is_text:
            self._refuse(place)

    def _value(self) -> _Value:
        found, place, is_text = self._take()
        if is_text:
            return self._text(found, place)
        if found == 'Nothing':
            return None
        if found == 'Just':
            return self._value()
        if found != '(':
            self._refuse(place)
        first = self._value()
        if self._tokens[self._place:][:1] and self._tokens[self._place][0] == ')':
            self._place += 1
            return first
        self._expect(',')
        second = self._value()
        self._expect(')')
        return first, second

    def _text(self, written: str, place: int) -> Text:
        """Return a text with the place of each character."""
        value, offsets, at = '', [], 0
        while at < len(written):
            offsets.append(place + at)
            at += 1 if written[at] == '\\' else 0
            value += written[at]
            at += 1
        return Text(value, self._source, [*offsets, place + len(written)])

    def _refuse(self, place: int) -> NoReturn:
        refuse('this cannot be read as a format of Ogma', Span(self._source, place, place + 1),
               'here', 'XMLFormat { specRequirements = ("//...", Nothing), ... }')


def _of_ogma(source: Source) -> dict[str, _Query]:
    found: dict[str, _Query] = {}
    for name, value, place in _Record(source).fields():
        if value is None:
            continue
        key = _OGMA.get(name)
        if key is None:
            refuse(f'a format of Ogma has no field {shown(name)}' if name not in _LEFT_OUT else
                   f'{name} is not read: a handler is an empty message',
                   Span(source, place, place + len(name)), '', f'write {name} = Nothing')
        query = _query(value)
        if query is None:
            refuse(f'the value of {name} cannot be read', Span(source, place, place + len(name)),
                   help='("PATH", Nothing) or ("PATH", Just ("KEY", "PATH"))')
        for text in (query.path, query.found_by):
            if text is not None:
                parse_path(text)
        found[key] = query
    for group in (_INPUTS, _DEFINITIONS):
        if group[0] not in found:  # Ogma requires paths also where there are none
            for key in group:
                found.pop(key, None)
    return found


def _query(value: _Value) -> _Query | None:
    match value:
        case Text() | (Text(), None):
            return _Query(value if isinstance(value, Text) else value[0])
        case (Text() as path, (Text() as key, Text() as found_by)):
            return _Query(path, key.value, found_by)
        case _:
            return None


# Reading

def read_xml(text: str, path: Path, form: XmlFormat) -> XmlContent:
    """
    Return what a file has.

    Raises
    ------
    CompileError
        if it is no XML, declares a document type, or lacks what a format needs to find.
    """
    try:
        return _Reader(parsed_xml(text, path), path, form).content()
    except RecursionError:
        refuse(f'{shown(str(path))} cannot be read as XML: too deep')


class _Reader:
    """Reads one file."""

    def __init__(self, root: Element, path: Path, form: XmlFormat) -> None:
        self._tree = Tree(root)
        self._path = path
        self._queries = form.queries
        self._paths = {key: self._resolved(query) for key, query in form.queries.items()}

    def _resolved(self, query: _Query) -> list[XPath]:
        """Return the paths of a query: one for each text that its key stands for."""
        if query.found_by is None:
            return [parse_path(query.path)]
        texts = [self._tree.text(node) for node in self._tree.find(parse_path(query.found_by))]
        if not texts:
            refuse(f'{shown(str(self._path))} has nothing at this path', query.found_by.span,
                   f'{query.key} stands for what is found there')
        return [parse_path(Text.whole(Source(query.path.source.name, query.path.value.replace(
            query.key, text)))) for text in dict.fromkeys(texts)]

    def content(self) -> XmlContent:
        columns = [key for key in COLUMNS if key in self._paths]
        rows = [tuple(columns)]
        for element in self._elements('requirements'):
            cells = self._cells(element, columns)
            rows.append(tuple(cells[key] for key in columns))
        if len(rows) == 1:
            refuse(f'{shown(str(self._path))} has no requirement at this path',
                   self._queries['requirements'].path.span)
        return XmlContent(rows, (*self._inputs(), *self._definitions()))

    def _elements(self, key: str) -> Iterator[Element]:
        """Yield the elements that are requirements, inputs or definitions."""
        for path in self._paths.get(key, ()):
            yield from (node for node in self._tree.find(path) if isinstance(node, Element))

    def _cells(self, element: Element, keys: Sequence[str]) -> dict[str, str]:
        """Return what the paths of some keys find in an element first; '' where nothing."""
        tree = self._tree.part(element)
        return {key: next((text for path in self._paths.get(key, ())
                           for node in tree.find(path)
                           if (text := ' '.join(tree.text(node).split()))), '') for key in keys}

    def _inputs(self) -> Iterator[ComponentVariable]:
        for element in self._elements('inputs'):
            cells = self._cells(element, _INPUTS)
            if cells['input_name']:
                yield ComponentVariable(cells['input_name'], VariableRole.INPUT,
                                        cells['input_type'])

    def _definitions(self) -> Iterator[ComponentVariable]:
        for element in self._elements('definitions'):
            cells = self._cells(element, _DEFINITIONS)
            name, text = cells['definition_name'], cells['definition_text']
            if name:
                yield ComponentVariable(
                    name, VariableRole.INTERNAL, cells['definition_type'],
                    (Wording((Language.PTLTL, Language.COCOSPEC), text,
                             f'{self._path.name}, {name}'),) if text else ())
