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
Reads the requirements of a ReqIF file (OMG ReqIF 1.2) as a table.

Requirement tools (DOORS, Polarion, StrictDoc, ...) exchange requirements so; each names the
attributes of a requirement as it likes. They are the columns, a requirement is a row, and the
titles of the chapters around it are a column more. The package reqif is not used: it refuses files
without what the standard leaves optional.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
import re
from xml.etree.ElementTree import Element

from fret_monitor.importing.xml_text import ended_elements, name_of, spoken_text
from fret_monitor.model.diagnostics import refuse
from fret_monitor.model.names import shown

SECTION = 'section'
"""The head of the column with the titles of the chapters."""

IDENTIFIER = 'spec-object identifier'
"""The head of the column with the identifier that every requirement has."""

TOOLS = 'TOOL-EXTENSIONS'
"""The element in which tools keep what they like, which is not read."""

_TITLES = ('reqif.chaptername', 'reqif.name', 'title', 'name', 'object heading')
_HEAD_CHARS = 10_000
_ROOT = re.compile(r'<(?:[\w.-]+:)?REQ-IF[\s>]')


def is_reqif(text: str) -> bool:
    """Whether a text is a ReqIF file."""
    begin = text[:_HEAD_CHARS].removeprefix('\ufeff').lstrip()
    return begin[:1] == '<' and _ROOT.search(begin) is not None


def reqif_rows(text: str, path: Path, most: int) -> Iterator[Sequence[str]]:
    """
    Yield the heads, then a row for each requirement, in the order of the documents.

    Raises
    ------
    CompileError
        if it is no XML, declares a document type (entities), has two objects of one identifier,
        or more than `most`.
    """
    try:
        root, objects = _read(text, path, most)
        yield from _rows(root, objects)
    except RecursionError:
        refuse(f'{shown(str(path))} cannot be read as XML: too deep')


def _read(text: str, path: Path, most: int) -> tuple[Element, dict[str, dict[str, str]]]:
    """Return a file without its objects, and their values by the attributes' identifiers."""
    objects: dict[str, dict[str, str]] = {}
    counts: Counter[str] = Counter()
    for item in ended_elements(text, path, without=TOOLS):
        if name_of(item) == 'SPEC-OBJECT':
            identifier = item.get('IDENTIFIER', '')
            counts[identifier] += 1
            objects[identifier] = _values(item)
            item.clear()
    if counts.total() > most:
        refuse(f'{shown(str(path))} has more than {most:,} objects',
               help='export fewer requirements at once')
    for identifier, count in counts.items():
        if count > 1:
            refuse(f'{shown(str(path))} has {count} objects with the identifier '
                   f'{shown(identifier)}', help='in ReqIF each one has an identifier of its own')
    return item, objects


def _rows(root: Element, values: Mapping[str, Mapping[str, str]]) -> Iterator[Sequence[str]]:
    names = {identifier: item.get('LONG-NAME') or identifier for item in root.iter()
             if name_of(item).startswith('ATTRIBUTE-DEFINITION-')
             and (identifier := item.get('IDENTIFIER'))}
    heads = tuple(dict.fromkeys(names.values()))
    yield (*heads, SECTION, IDENTIFIER)
    objects = {identifier: {names.get(of, of): text for of, text in found.items()}
               for identifier, found in values.items()}
    for identifier, section in (*_places(root, objects, ''), *((name, '') for name in objects)):
        cells = objects.pop(identifier, None)
        if cells is not None:  # of several places, or none, the first one counts
            yield (*(cells.get(head, '') for head in heads), section, identifier)


def _places(element: Element, objects: Mapping[str, Mapping[str, str]],
            section: str) -> Iterator[tuple[str, str]]:
    """Yield the objects of all documents in order, with the titles of the chapters around."""
    for child in element:
        if name_of(child) != 'SPEC-HIERARCHY':
            yield from _places(child, objects, section)
            continue
        identifier = next((item.text or '' for item in child.iter()
                           if name_of(item) == 'SPEC-OBJECT-REF'), '').strip()
        yield identifier, section
        title = _title(objects.get(identifier, {}))
        yield from _places(child, objects, ' / '.join(filter(None, (section, title))))


def _title(cells: Mapping[str, str]) -> str:
    return ' '.join(next((text for wanted in _TITLES for head, text in cells.items()
                          if head.casefold() == wanted and text), '').split())


def _values(item: Element) -> dict[str, str]:
    """Return the values of a requirement by the identifiers of their attributes."""
    found = {}
    for value in item.iter():
        if name_of(value).startswith('ATTRIBUTE-VALUE-'):
            of = next((part.text or '' for part in value.iter()
                       if name_of(part).startswith('ATTRIBUTE-DEFINITION-')), '').strip()
            written = next((part for part in value if name_of(part) == 'THE-VALUE'), None)
            found[of] = value.get('THE-VALUE', '') if written is None else spoken_text(written)
    return found
