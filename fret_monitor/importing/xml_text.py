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

"""XML of other tools, without what may attack a parser: document types, and so entities."""

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from fret_monitor.model.diagnostics import refuse
from fret_monitor.model.names import shown

MAX_XML = 128 * 2 ** 20
"""Characters of XML; real tools write about 10 kB for a requirement."""

_BLOCK_CHARS = 2 ** 16
_MOST_TAGS = 3_000_000  # some hundred for each of 10,000 requirements
_DELETED = ('del', 's', 'strike')
_RAISED = {'sup': '^', 'sub': '_'}
_BLOCKS = ('p', 'div', 'br', 'li', 'tr', 'td', 'th', 'table')


def parsed_xml(text: str, path: Path) -> Element:
    """
    Return the root element of a file's text.

    Raises
    ------
    CompileError
        if it is no XML, or declares a document type (entities).
    """
    refuse_hostile(text, path)
    try:
        return ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, RecursionError) as error:
        refuse(f'{shown(str(path))} cannot be read as XML: {_reason(error)}')


def ended_elements(text: str, path: Path, without: str) -> Iterator[Element]:
    """
    Yield each element of a file's text where it ends, the root last; none in those of a name.

    An element that is cleared then takes no memory. Raises as `parsed_xml`.
    """
    refuse_hostile(text, path)
    inside = 0
    try:
        for event, element in _events(text):
            if event == 'start':
                inside += name_of(element) == without
            elif not inside:
                yield element
            else:
                inside -= name_of(element) == without
                element.clear()
    except (ElementTree.ParseError, ValueError, RecursionError) as error:
        refuse(f'{shown(str(path))} cannot be read as XML: {_reason(error)}')


def _events(text: str) -> Iterator[tuple[str, Element]]:
    parser: ElementTree.XMLPullParser[Element] = ElementTree.XMLPullParser(['start', 'end'])
    for start in range(0, len(text), _BLOCK_CHARS):
        parser.feed(text[start:start + _BLOCK_CHARS])
        yield from parser.read_events()  # type: ignore[misc]
    parser.close()


def _reason(error: Exception) -> str:
    return 'too deep' if isinstance(error, RecursionError) else str(error)


def refuse_hostile(text: str, path: Path) -> None:
    """Refuse a file that declares a document type (it might have entities), or is too large."""
    if len(text) > MAX_XML or text.count('<') > _MOST_TAGS:
        refuse(f'{shown(str(path))} has more than {MAX_XML // 2 ** 20} MiB, or more than '
               f'{_MOST_TAGS:,} tags', help='export fewer requirements or attributes at once')
    if '<!DOCTYPE' in text:
        refuse(f'{shown(str(path))} declares a document type',
               help='remove it: entities are not read')


def name_of(element: Element) -> str:
    """Return the name of a tag without its namespace."""
    return element.tag.rpartition('}')[2]


def spoken_text(element: Element) -> str:
    """
    Return the text of an element; paragraphs, lines and cells of XHTML are apart.

    What is marked as deleted is left out; `^` and `_` stand before what is raised or lowered.
    """
    return ''.join(_spoken(element))


def _spoken(element: Element) -> Iterator[str]:
    name = name_of(element)
    if name in _DELETED:
        return
    gap = ' ' if name in _BLOCKS else ''
    yield gap + _RAISED.get(name, '') + (element.text or '')
    for child in element:
        yield from _spoken(child)
        yield child.tail or ''
    yield gap
