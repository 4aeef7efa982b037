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
The requirements of a bundle as a table or as ReqIF, which `import` reads again.

Each has its id, title, text (in the column of its language), rationale and component. Inputs and
definitions stay in the bundle.
"""

from collections.abc import Callable, Sequence
import csv
from datetime import datetime, UTC
import io
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from fret_monitor.bundle.bundle import Bundle, Language, Requirement
from fret_monitor.model.diagnostics import refuse, require_packages
from fret_monitor.model.names import shown

Rows = Sequence[Sequence[str]]

_NAMESPACE = 'http://www.omg.org/spec/ReqIF/20110401/reqif.xsd'
_DECLARATION = '<?xml version="1.0" encoding="UTF-8"?>'  # as ReqIF's guide wants it
_CONTROLS = dict.fromkeys(range(32), ' ')


def requirements_file(bundle: Bundle, path: Path) -> bytes:
    """
    Return the content of a file with the requirements of a bundle, as its name says.

    Raises
    ------
    CompileError
        if the name has no ending of `.csv`, `.xlsx` or `.reqif`, or openpyxl is missing.
    """
    write = _WRITERS.get(path.suffix.lower())
    if write is None:
        refuse(f'{shown(str(path))} ends in none of {", ".join(_WRITERS)}',
               help='the ending says what is written')
    return write(_rows(bundle))


def _rows(bundle: Bundle) -> Rows:
    """Return the heads and a row for each requirement, without empty columns."""
    languages = [item for item in Language if any(
        one.language is item for one in bundle.requirements)]
    component = bundle.component.value if bundle.component else ''
    rows = [('ID', 'Title', *(item.value for item in languages), 'Rationale', 'Component',
             'Assumption'),
            *(_row(item, languages, component) for item in bundle.requirements)]
    used = [place for place in range(len(rows[0])) if any(row[place] for row in rows[1:])]
    return [tuple(row[place] for place in used) for row in rows]


def _row(item: Requirement, languages: Sequence[Language], component: str) -> tuple[str, ...]:
    texts = (item.text.value if item.language is one else '' for one in languages)
    found = (item.source or item.id.value, item.title, *texts, item.rationale, component,
             'true' if item.is_assumption else '')
    return tuple(' '.join(cell.translate(_CONTROLS).split()) for cell in found)


def _csv(rows: Rows) -> bytes:
    file = io.StringIO(newline='')
    csv.writer(file, lineterminator='\r\n').writerows(rows)
    return file.getvalue().encode()


def _xlsx(rows: Rows) -> bytes:
    require_packages('an XLSX file', {'openpyxl': 'openpyxl'})
    from openpyxl import Workbook
    book = Workbook()
    sheet = book.worksheets[0]
    sheet.title = 'Requirements'
    for number, row in enumerate(rows, 1):
        for column, text in enumerate(row, 1):
            sheet.cell(number, column, text).data_type = 's'  # no formula of the spreadsheet
    file = io.BytesIO()
    book.save(file)
    return file.getvalue()


# ReqIF 1.2

_ATTRIBUTES = {'ID': 'ReqIF.ForeignID', 'Title': 'ReqIF.Name', 'fretish': 'ReqIF.Text'}


def _reqif(rows: Rows) -> bytes:
    now = datetime.now(UTC).strftime('%Y-%m-%dT%H:%M:%SZ')
    root = Element('REQ-IF', xmlns=_NAMESPACE)
    header = SubElement(SubElement(root, 'THE-HEADER'), 'REQ-IF-HEADER', IDENTIFIER='header')
    for name, text in (('CREATION-TIME', now), ('REQ-IF-TOOL-ID', 'fret-monitor'),
                       ('REQ-IF-VERSION', '1.0'), ('SOURCE-TOOL-ID', 'fret-monitor'),
                       ('TITLE', 'Requirements')):
        SubElement(header, name).text = text
    content = SubElement(SubElement(root, 'CORE-CONTENT'), 'REQ-IF-CONTENT')
    _identified(SubElement(content, 'DATATYPES'), 'DATATYPE-DEFINITION-STRING', 'string', now,
                'String').set('MAX-LENGTH', '32000')
    types = SubElement(content, 'SPEC-TYPES')
    kind = _identified(types, 'SPEC-OBJECT-TYPE', 'requirement', now, 'Requirement')
    _identified(types, 'SPECIFICATION-TYPE', 'document', now, 'Document')
    attributes = SubElement(kind, 'SPEC-ATTRIBUTES')
    for number, head in enumerate(rows[0]):
        new = _identified(attributes, 'ATTRIBUTE-DEFINITION-STRING', f'attribute-{number}', now,
                          _ATTRIBUTES.get(head, head))
        _reference(new, 'TYPE', 'DATATYPE-DEFINITION-STRING-REF', 'string')
    objects = SubElement(content, 'SPEC-OBJECTS')
    document = _identified(SubElement(content, 'SPECIFICATIONS'), 'SPECIFICATION', 'requirements',
                           now, 'Requirements')
    _reference(document, 'TYPE', 'SPECIFICATION-TYPE-REF', 'document')
    children = SubElement(document, 'CHILDREN')
    for number, row in enumerate(rows[1:], 1):
        _object(objects, row, f'object-{number}', now)
        place = _identified(children, 'SPEC-HIERARCHY', f'place-{number}', now)
        _reference(place, 'OBJECT', 'SPEC-OBJECT-REF', f'object-{number}')
    ElementTree.indent(root)
    return f'{_DECLARATION}\n{ElementTree.tostring(root, encoding="unicode")}'.encode()


def _object(objects: Element, row: Sequence[str], identifier: str, now: str) -> None:
    new = _identified(objects, 'SPEC-OBJECT', identifier, now)
    _reference(new, 'TYPE', 'SPEC-OBJECT-TYPE-REF', 'requirement')
    values = SubElement(new, 'VALUES')
    for column, text in enumerate(row):
        if text:
            value = SubElement(values, 'ATTRIBUTE-VALUE-STRING', {'THE-VALUE': text})
            _reference(value, 'DEFINITION', 'ATTRIBUTE-DEFINITION-STRING-REF',
                       f'attribute-{column}')


def _identified(parent: Element, tag: str, identifier: str, now: str, name: str = '') -> Element:
    new = SubElement(parent, tag, {'IDENTIFIER': identifier, 'LAST-CHANGE': now})
    if name:
        new.set('LONG-NAME', name)
    return new


def _reference(parent: Element, part: str, tag: str, identifier: str) -> None:
    SubElement(SubElement(parent, part), tag).text = identifier


_WRITERS: dict[str, Callable[[Rows], bytes]] = {'.csv': _csv, '.xlsx': _xlsx, '.reqif': _reqif}
