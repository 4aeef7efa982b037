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
Writes results into a ReqIF file: further attributes of its requirements.

The file is read as a stream and never is a tree. What is new is put between the bytes that are
there, so that all else stays as it is.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
import re
from typing import NamedTuple
from xml.parsers import expat
from xml.sax.saxutils import escape, quoteattr

from fret_monitor.importing.reqif_file import TOOLS
from fret_monitor.importing.xml_text import refuse_hostile
from fret_monitor.model.diagnostics import refuse
from fret_monitor.model.names import shown

_BLOCK_BYTES = 2 ** 16
_START_TAG = re.compile(rb'<(?:[^>"\']|"[^"]*"|\'[^\']*\')*>')
_VALUE = re.compile(rb'\sTHE-VALUE\s*=\s*(?:"[^"]*"|\'[^\']*\')')
_LINES = {'\n': '&#10;', '\r': '&#13;', '\t': '&#9;'}
_TYPES = frozenset({
    'REQ-IF', 'CREATION-TIME', 'REQ-IF-CONTENT', 'DATATYPES', 'DATATYPE-DEFINITION-STRING',
    'SPEC-OBJECT-TYPE', 'SPEC-ATTRIBUTES', 'ATTRIBUTE-DEFINITION-STRING'})
_OBJECTS = frozenset({
    'SPEC-OBJECT', 'SPEC-OBJECT-TYPE-REF', 'VALUES', 'ATTRIBUTE-VALUE-STRING',
    'ATTRIBUTE-DEFINITION-STRING-REF'})


class _Change(NamedTuple):
    """Bytes that replace those between two places."""

    begin: int
    end: int
    new: str


@dataclass
class _Element:
    """An element with the places of its tags, and those of chosen names below it."""

    name: str
    attributes: Mapping[str, str]
    begin: int
    end: int = 0
    below: 'list[_Element]' = field(default_factory=list)
    text: str = ''

    def all(self, name: str) -> 'Iterator[_Element]':
        """Yield the elements of a name below, in whichever namespace."""
        for item in self.below:
            if _local(item.name) == name:
                yield item
            yield from item.all(name)

    def first(self, name: str) -> '_Element | None':
        """Return the first element of a name below."""
        return next(self.all(name), None)


def filled_reqif(text: str, path: Path, heads: Sequence[str],
                 rows: Mapping[str, Sequence[str]]) -> str:
    """
    Return the text of a ReqIF file with further attributes; `rows` are by the labels of objects.

    Raises
    ------
    CompileError
        if it is hostile (`refuse_hostile`), or an object to fill has no type.
    """
    refuse_hostile(text, path)
    data = text.encode()
    types = _Types(data, heads)
    changes = [*types.changes]
    for item in _elements(data, _OBJECTS, 'SPEC-OBJECT'):
        identifier = item.attributes.get('IDENTIFIER', '')
        added = rows.get(f'{path.name}, {identifier}')
        kind = item.first('SPEC-OBJECT-TYPE-REF')
        if added is None:
            continue
        if kind is None or kind.text.strip() not in types.identifiers:
            refuse(f'{shown(str(path))}: the requirement {shown(identifier)} has no type, to '
                   'which attributes could be added')
        cells = (*added, *[''] * len(heads))
        changes += _values(data, item, types.prefix, dict(
            zip(types.identifiers[kind.text.strip()], cells, strict=False)))
    return _changed(data, changes)


class _Types:
    """
    The types of requirements in a file.

    `identifiers` has for each type those of the attributes, in the order of the columns.
    `changes` add what is not there.
    """

    def __init__(self, data: bytes, heads: Sequence[str]) -> None:
        """Read the types, and decide what to add."""
        root = next(_elements(data, _TYPES, 'REQ-IF'))
        self.prefix = root.name.rpartition('REQ-IF')[0]
        self.identifiers: dict[str, list[str]] = {}
        self.changes: list[_Change] = []
        time = root.first('CREATION-TIME')
        self._time = (time.text.strip() if time else '') or '2000-01-01T00:00:00Z'
        string = root.first('DATATYPE-DEFINITION-STRING')
        self._string = 'fret-monitor-string' if string is None else string.attributes['IDENTIFIER']
        for kind in root.all('SPEC-OBJECT-TYPE'):
            self._add(data, kind, heads)
        content = root.first('REQ-IF-CONTENT')
        if string is None and self.changes and content is not None:
            self._add_string(data, content)

    def _add(self, data: bytes, kind: _Element, heads: Sequence[str]) -> None:
        """Add the attributes of a type that it does not have."""
        identifier = kind.attributes.get('IDENTIFIER', '')
        known = {item.attributes.get('LONG-NAME', ''): item.attributes.get('IDENTIFIER', '')
                 for item in reversed([*kind.all('ATTRIBUTE-DEFINITION-STRING')])}
        names = {head: known.get(head, f'fret-monitor-{identifier}-{"-".join(head.split())}')
                 for head in heads}
        self.identifiers[identifier] = [*names.values()]
        new = ''.join(self._definition(names[head], head) for head in heads if head not in known)
        if new:
            self.changes.append(_part(data, kind, 'SPEC-ATTRIBUTES', new, self.prefix))

    def _definition(self, identifier: str, head: str) -> str:
        p = self.prefix
        return (f'<{p}ATTRIBUTE-DEFINITION-STRING IDENTIFIER={_quoted(identifier)} '
                f'LONG-NAME={_quoted(head)} LAST-CHANGE={_quoted(self._time)}><{p}TYPE>'
                f'<{p}DATATYPE-DEFINITION-STRING-REF>{escape(self._string)}'
                f'</{p}DATATYPE-DEFINITION-STRING-REF></{p}TYPE>'
                f'</{p}ATTRIBUTE-DEFINITION-STRING>')

    def _add_string(self, data: bytes, content: _Element) -> None:
        self.changes.append(_part(
            data, content, 'DATATYPES', f'<{self.prefix}DATATYPE-DEFINITION-STRING '
            f'IDENTIFIER={_quoted(self._string)} LONG-NAME="String" MAX-LENGTH="32000" '
            f'LAST-CHANGE={_quoted(self._time)}/>', self.prefix))


def _values(data: bytes, item: _Element, prefix: str,
            cells: Mapping[str, str]) -> Iterator[_Change]:
    """Yield the changes that set attributes of a requirement, by their identifiers."""
    known = {reference.text.strip(): value for value in item.all('ATTRIBUTE-VALUE-STRING')
             for reference in value.below}
    new = ''
    for identifier, cell in cells.items():
        if identifier in known:
            yield from _with_value(data, known[identifier], cell)
        else:
            new += (f'<{prefix}ATTRIBUTE-VALUE-STRING THE-VALUE={_quoted(cell)}>'
                    f'<{prefix}DEFINITION><{prefix}ATTRIBUTE-DEFINITION-STRING-REF>'
                    f'{escape(identifier)}</{prefix}ATTRIBUTE-DEFINITION-STRING-REF>'
                    f'</{prefix}DEFINITION></{prefix}ATTRIBUTE-VALUE-STRING>')
    if new:
        yield _part(data, item, 'VALUES', new, prefix)


def _with_value(data: bytes, value: _Element, cell: str) -> Iterator[_Change]:
    if value.attributes.get('THE-VALUE') == cell:
        return
    begin = value.begin + 1 + len(value.name.encode())
    old = _VALUE.search(data, begin, _start_tag_end(data, value))
    place = old.span() if old else (begin, begin)
    yield _Change(*place, f' THE-VALUE={_quoted(cell)}')


def _part(data: bytes, element: _Element, name: str, new: str, prefix: str) -> _Change:
    """Return the change that adds to a part of an element; a new part is the first one."""
    part = element.first(name)
    if part is None:
        return _added(data, element, f'<{prefix}{name}>{new}</{prefix}{name}>', is_first=True)
    return _added(data, part, new)


def _added(data: bytes, element: _Element, new: str, *, is_first: bool = False) -> _Change:
    """Return the change that adds to the content of an element, which may be an empty tag."""
    end = _start_tag_end(data, element)
    if data[end - 2:end] == b'/>':
        return _Change(end - 2, end, f'>{new}</{element.name}>')
    place = end if is_first else element.end
    return _Change(place, place, new)


def _start_tag_end(data: bytes, element: _Element) -> int:
    tag = _START_TAG.match(data, element.begin)
    assert tag is not None
    return tag.end()


def _changed(data: bytes, changes: Sequence[_Change]) -> str:
    found, place = [], 0
    for change in sorted(changes):
        found += [data[place:change.begin], change.new.encode()]
        place = change.end
    return b''.join([*found, data[place:]]).decode()


def _elements(data: bytes, names: frozenset[str], wanted: str) -> Iterator[_Element]:
    """Yield the elements of a name, each with those of other names below it."""
    parser = expat.ParserCreate('utf-8')
    parser.buffer_text = True
    open_: list[_Element | None] = []
    within: list[_Element] = []
    found: list[_Element] = []
    tools = 0

    def begin(name: str, attributes: dict[str, str]) -> None:
        nonlocal tools
        tools += _local(name) == TOOLS
        item = None
        if not tools and _local(name) in names:
            item = _Element(name, attributes, parser.CurrentByteIndex)
            within.append(item)
        open_.append(item)

    def end(name: str) -> None:
        nonlocal tools
        tools -= _local(name) == TOOLS
        item = open_.pop()
        if item is None:
            return
        item.end = parser.CurrentByteIndex
        within.pop()
        if _local(name) == wanted:
            found.append(item)
        elif within:
            within[-1].below.append(item)

    def text(characters: str) -> None:
        if open_ and (item := open_[-1]) is not None:
            item.text += characters

    parser.StartElementHandler, parser.EndElementHandler = begin, end
    parser.CharacterDataHandler = text
    for start in range(0, len(data) + 1, _BLOCK_BYTES):
        parser.Parse(data[start:start + _BLOCK_BYTES], start + _BLOCK_BYTES > len(data))
        yield from found
        found.clear()


def _local(name: str) -> str:
    return name.rpartition(':')[2]


def _quoted(text: str) -> str:
    return quoteattr(text, _LINES)
