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
Reads tables of requirements: CSV, with commas, semicolons or tabs, or XLSX.

A CSV is in UTF-8, UTF-16, or in Windows-1252, which Excel writes.

The first row has the heads of the columns. A row is a requirement: its id, its text, and, if there
are such columns, title, rationale and component. Sentences of FRETish and formulas are recognised
row by row; everything else is prose, which is kept as a comment and reported.
"""

from codecs import BOM_UTF16_BE, BOM_UTF8
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
import csv
from dataclasses import dataclass, replace
import io
from pathlib import Path
import re
import shlex

from fret_monitor.bundle.bundle import Language
from fret_monitor.importing.component import ComponentRequirement, ImportedComponent, Wording
from fret_monitor.importing.parsed_wording import parse_wording
from fret_monitor.importing.reqif_file import IDENTIFIER, reqif_rows, SECTION
from fret_monitor.importing.workbook import sheets
from fret_monitor.language.sentence import Sentence
from fret_monitor.model.diagnostics import (
    CompileError, Diagnostic, did_you_mean, Level, Problems, refuse, Source, Span,
)
from fret_monitor.model.names import shown

MAX_ROWS = 100_000
"""Rows of a table; a tool that traces requirements exports fewer."""

SUFFIXES = ('.csv', '.tsv')
WORKBOOK = '.xlsx'

_HEADS = {
    'id': ('id', 'reqid', 'req id', 'requirement id', 'identifier', 'uid', 'key', 'number',
           'reqif.foreignid', 'object identifier', 'object id'),
    # Those of requirement tools first: beside them, `Requirement` says yes or no.
    'text': ('object text', 'reqif.text', 'requirement', 'requirement text', 'text', 'statement',
             'sentence', 'formula', 'description', 'specification', 'reqif.description'),
    'title': ('title', 'name', 'summary', 'heading', 'reqif.name', 'object short text'),
    'rationale': ('rationale', 'comment', 'comments', 'justification', 'note', 'notes'),
    'component': ('component', 'system', 'subsystem'),
}
_LANGUAGES = {language.value: (language,) for language in Language}
ROLES = (*_HEADS, *_LANGUAGES)
"""What a column may be."""

_FOUND_HEADS = {**_HEADS, **{name: (name,) for name in _LANGUAGES},
                'section': (SECTION,), 'identifier': (IDENTIFIER,), 'assumption': ('assumption',)}

_OPERATOR = re.compile(r'[<>=!&|()\[\]]|->|\bshall\b')
_QUOTED = re.compile('"[^"]*"')
_BEGIN_BYTES = 1000
_UTF_8, _WINDOWS = 'utf-8-sig', 'cp1252'
_SURE_UTF_8 = re.compile(  # a byte order mark, or another character of several bytes
    rb'[\xc2-\xdf][\x80-\xbf]|[\xe1-\xef][\x80-\xbf]{2}|[\xf1-\xf3][\x80-\xbf]{3}')
_PACKED = (b'PK\3\4', b'\xd0\xcf\x11\xe0')  # ZIP, of .ods and .xlsx; OLE, of .xls
# Of the encodings that XML may declare, those of one byte a character; expat knows no others.
_DECLARED = re.compile(
    rb'<\?xml[^>]*encoding\s*=\s*["\'](iso-8859-\d{1,2}|windows-125\d|us-ascii)["\']', re.I)
_SEPARATOR = re.compile('\ufeff?"?sep=([^\r\n])"?\r?\n')  # Excel's own hint
_FIRST_ROW = re.compile(r'(?:"[^"]*"|[^"\n])*')
_MANY = 12
_MOST_JOINED = 1_000_000
_LONGEST_TEXT = 100_000  # characters; FRET's formulas have some thousand


@dataclass(frozen=True)
class _Row:
    """A row: what messages call it, such as `row 2`, as a spreadsheet counts them; its cells."""

    name: str
    cells: tuple[str, ...]


@dataclass(frozen=True)
class _Table:
    """
    A table: its name in errors and in labels, its heads, and the rows that are not empty.

    `sign` is what separates the cells, in CSV.
    """

    name: str
    label: str
    head: tuple[str, ...]
    rows: list[_Row]
    sign: str = ''


def has_heads(path: Path, max_bytes: int) -> bool:
    """Whether the first row of a file names columns of ids and texts."""
    _, text, sign = split_separator(decoded(path, max_bytes))
    first = _FIRST_ROW.match(text.lstrip())
    reader = csv.reader(io.StringIO(first[0] if first else '', newline=''), delimiter=sign)
    try:
        return _is_head(next(reader, []))
    except csv.Error:
        return False


def _is_head(cells: Iterable[str]) -> bool:
    heads = {_head(cell) for cell in cells}
    return bool(heads & {*_HEADS['id']}) and bool(heads & {*_HEADS['text'], *_LANGUAGES})


def read_table(path: Path, max_bytes: int, columns: Mapping[str, str], problems: Problems,
               reqif: str | None = None, part: str = '') -> list[ImportedComponent]:
    """
    Return the components of the requirements of a table.

    `columns` names the heads of columns by what they are (`ROLES`); others are found by their
    heads. `reqif` is the text of the file, or of a `part` of it, if it is ReqIF, whose attributes
    are the columns.

    Raises
    ------
    CompileError
        if it cannot be read, is too large, or has no columns of ids and texts.
    """
    if reqif is not None:
        name, label = (f'{one}, {part}' if part else one for one in (str(path), path.name))
        rows = reqif_rows(reqif, path, MAX_ROWS)
        tables = [_table(rows, name, label, lambda _, cells: cells[-1])]
    else:
        tables = _tables(path, max_bytes, columns, problems)
    return _components(tables, path, columns, problems)


def read_rows(rows: Iterable[Sequence[str]], path: Path,
              problems: Problems) -> list[ImportedComponent]:
    """Return the components of the requirements of a file; the first row has the heads."""
    table = _table(rows, str(path), path.name, lambda number, _: f'requirement {number - 1}')
    return _components([table], path, {}, problems)


def _components(tables: Iterable[_Table], path: Path, columns: Mapping[str, str],
                problems: Problems) -> list[ImportedComponent]:
    found: dict[str, list[ComponentRequirement]] = {}
    for table in tables:
        places = _places(table, columns)
        for row in table.rows:
            cells = {role: _in_one_line(row.cells[place]) if place < len(row.cells) else ''
                     for role, place in places.items()}
            has_text = any(cells.get(role) for role in ('text', *_LANGUAGES))
            if has_text or 'identifier' not in places and any(cells.values()):  # no chapter
                item = _requirement(cells, row.name, table.label, problems)
                component = cells.get('component', '') or _component(item)
                found.setdefault(component, []).append(_checked(item, row, table))
    return [ImportedComponent(name, path.stem, (), tuple(items), (path.name,))
            for name, items in found.items()]


def _checked(item: ComponentRequirement, row: _Row, table: _Table) -> ComponentRequirement:
    """Return a requirement, not to be parsed if a cell of its row of a CSV has no head."""
    heads = max(place for place, head in enumerate(table.head, 1) if head.strip())
    if not table.sign or not any(cell.strip() for cell in row.cells[heads:]):
        return item
    fault = Diagnostic(
        'its row has more cells than there are heads', level=Level.WARNING,
        help=f'{table.label}, {row.name}: {more_cells_help(table.sign)}')
    return replace(item, wordings=tuple(replace(one, fault=fault) for one in item.wordings))


def more_cells_help(sign: str) -> str:
    """Return what to do with a row of a CSV that has more cells than heads."""
    return f'put a text with {shown(sign)} in quotes, or give each column a head'


def _in_one_line(text: str) -> str:
    """Return a text with one blank between words; the beginning of one that is not parsed."""
    if len(text) > _MOST_JOINED:
        return text[:_LONGEST_TEXT + 1]
    return ' '.join(text.split())


def _tables(path: Path, max_bytes: int, columns: Mapping[str, str],
            problems: Problems) -> list[_Table]:
    """Return the table of a file, or the sheets of a workbook that have the columns."""
    if path.suffix.lower() != WORKBOOK:
        text = decoded(path, max_bytes)
        warn_of_windows(path, text, problems)
        table = _table(csv_rows(text, path), str(path), path.name)
        return [replace(table, sign=split_separator(text)[2])]
    read = [(name, rows) for name, rows in sheets(path, max_bytes, MAX_ROWS, problems)
            if any(map(any, rows))]
    if len(read) == 1:
        return [_table(read[0][1], str(path), path.name)]
    found: list[_Table] = []
    faults: list[str] = []
    for name, rows in read:
        try:
            table = _table(rows, f'{path}, {name}', f'{path.name}, {name}')
            _places(table, columns)
            found.append(table)
        except CompileError as error:
            faults.append(error.diagnostics[0].title)
            problems.warning(f'{path.name}: the sheet {shown(name)} is left out', None, '',
                             faults[-1])
    if not found:
        refuse(f'{shown(str(path))} has no sheet with columns of ids and requirements',
               help='\n'.join(faults))
    return found


def decoded(path: Path, max_bytes: int) -> str:
    """Return the text of a file, as `decoded_bytes`."""
    name = shown(str(path))
    try:
        with path.open('rb') as file:
            data = file.read(max_bytes + 1)
    except (OSError, ValueError) as error:
        refuse(f'{name} cannot be read: {getattr(error, "strerror", None) or error}')
    if len(data) > max_bytes:
        refuse(f'{name} is larger than {max_bytes // 2 ** 20} MiB')
    refuse_packed(data, name)
    return decoded_bytes(data, name, path)


def refuse_packed(begin: bytes, name: str) -> None:
    """Refuse the file of another spreadsheet program, or an archive under another name."""
    if begin.startswith(_PACKED):
        refuse(f'{name} is no text: it is packed, as workbooks and archives are',
               help="save a workbook as 'Excel workbook (.xlsx)' or as 'CSV UTF-8'; an archive of "
               'ReqIF ends in .reqifz')


def decoded_bytes(data: bytes, name: str, path: Path | None = None) -> str:
    """
    Return the text of a file; `name` is that of the file, in quotes.

    It is in UTF-16 with a byte order mark, in what the declaration of XML says, or in UTF-8; a
    table that `path` names may be in Windows-1252, if no character is one of UTF-8.
    """
    encoding = encoding_of(data[:_BEGIN_BYTES])
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        if encoding == _UTF_8 and not _SURE_UTF_8.search(data) and path is not None \
                and path.suffix.lower() in SUFFIXES:
            with suppress(UnicodeDecodeError):
                return data.decode(_WINDOWS)
        line = data.count(b'\n', 0, error.start) + 1
        refuse(f'{name} is not {encoding.upper().removesuffix("-SIG")}: line {line}',
               help='save it in UTF-8' if data.lstrip()[:1] == b'<' else "save it as 'CSV UTF-8'")


def warn_of_windows(path: Path, text: str, problems: Problems) -> None:
    """Warn of a table that is read as Windows-1252, at the first character that says so."""
    data = path.read_bytes()
    try:
        data.decode(encoding_of(data[:_BEGIN_BYTES]))
    except UnicodeDecodeError as error:
        problems.warning(
            f'{shown(path.name)} is not in UTF-8: it is read as Windows-1252, as Excel writes it',
            Span(Source(str(path), text), error.start, error.start + 1), 'the first difference',
            "if this is another character, save the table as 'CSV UTF-8'")


def encoding_of(begin: bytes) -> str:
    """Return the encoding of a file that begins so; UTF-8 with or without a mark by default."""
    if begin[:2] in (b'\xff\xfe', b'\xfe\xff'):
        return 'utf-16'
    declared = _DECLARED.match(begin)
    return declared[1].decode().lower() if declared else _UTF_8


def encoded(text: str, path: Path) -> bytes:
    """
    Return a text in the encoding of a file, with its byte order mark if it has one.

    Raises
    ------
    CompileError
        if the encoding of a table lacks a character.
    """
    data = path.read_bytes()
    if data.startswith(BOM_UTF16_BE):
        return BOM_UTF16_BE + text.encode('utf-16-be')
    encoding = encoding_of(data[:_BEGIN_BYTES])
    if encoding == _UTF_8 and not data.startswith(BOM_UTF8):
        encoding = 'utf-8' if _is_utf_8(data) else _WINDOWS
    try:
        return text.encode(encoding, 'xmlcharrefreplace' if text[:1] == '<' else 'strict')
    except UnicodeEncodeError as error:
        refuse(f'{shown(str(path))} is in an encoding without {shown(text[error.start])}',
               help="save it as 'CSV UTF-8'")


def _is_utf_8(data: bytes) -> bool:
    try:
        data.decode()
    except UnicodeDecodeError:
        return False
    return True


def split_separator(text: str) -> tuple[str, str, str]:
    """
    Return the first line of a CSV if it only says `sep=;`, what follows, and what separates cells.

    Without such a line, it is the most frequent sign of the first row, beside quotes.
    """
    if said := _SEPARATOR.match(text):
        return said[0], text[said.end():], said[1]
    return '', text, delimiter(text.lstrip())


def delimiter(text: str) -> str:
    """Return what separates the cells of the first row: the most frequent sign beside quotes."""
    first = _FIRST_ROW.match(text)
    return max(',;\t', key=_QUOTED.sub('', first[0] if first else '').count)


def _head(cell: str) -> str:
    return ' '.join(cell.replace('_', ' ').split()).casefold()


def csv_rows(text: str, path: Path) -> Iterator[list[str]]:
    """Yield the rows of a CSV without a line that only says what separates cells."""
    _, text, sign = split_separator(text)
    reader = csv.reader(io.StringIO(text, newline=''), delimiter=sign, strict=True)
    csv.field_size_limit(max(csv.field_size_limit(), len(text)))
    try:
        yield from reader
    except csv.Error as error:
        refuse(f'{shown(str(path))}, line {reader.line_num}: {error}',
               help='a quote inside a cell is written twice, and a cell with quotes is in quotes')


def _table(rows: Iterable[Sequence[str]], name: str, label: str,
           name_of: Callable[[int, Sequence[str]], str] | None = None) -> _Table:
    """Return the rows that are not empty; the first one has the heads."""
    found: list[_Row] = []
    for number, cells in enumerate(rows, 1):
        if any(cell.strip() for cell in cells):
            row = name_of(number, cells) if name_of else f'row {number}'
            found.append(_Row(row, tuple(cells)))
        if len(found) > MAX_ROWS + 1:
            refuse(f'{shown(name)} has more than {MAX_ROWS:,} rows',
                   help='split it, or leave out what is no requirement')
    if len(found) < 2:
        refuse(f'{shown(name)} has no row below the heads of its columns')
    return _Table(name, label, found[0].cells, found[1:])


def _places(table: _Table, columns: Mapping[str, str]) -> dict[str, int]:
    """Return which column is what."""
    heads = [_head(cell) for cell in table.head]
    repeated = next((name for names in _FOUND_HEADS.values() for name in names
                     if heads.count(name) > 1), '')
    if repeated:
        refuse(f'{shown(table.name)} has several columns {shown(repeated)}',
               help='give each head once: only one column can be read as that')
    found: dict[str, int] = {}
    for role, name in columns.items():
        if _head(name) not in heads:
            refuse(f'{shown(table.name)} has no column {shown(name)}',
                   help=did_you_mean(name, table.head) or _listed(table.head))
        found[role] = heads.index(_head(name))
    for role, names in _FOUND_HEADS.items():
        place = next((heads.index(name) for name in names if name in heads
                      and heads.index(name) not in found.values()), None)
        if role not in found and place is not None:
            found[role] = place
    if not found.keys() & {'id', 'identifier'} or not found.keys() & {'text', *_LANGUAGES}:
        missing = 'ids' if not found.keys() & {'id', 'identifier'} else 'requirements'
        write = ('cells are separated by , ; or tabs, or by what a first line such as sep=| says'
                 if len(table.head) == 1 else f'write --columns {_columns_of(table)}')
        refuse(f'{shown(table.name)} has no column of {missing}',
               help=f'{_listed(table.head)}; {write}')
    return found


def _columns_of(table: _Table) -> str:
    """Return what to give to `--columns`: a known or the first head, and that of long texts."""
    heads = {' '.join(head.split()): place for place, head in enumerate(table.head)}
    usable = [head for head in heads if head and not set(head) & set(',=')
              and head not in (SECTION, IDENTIFIER)]
    if len(usable) < 2:
        return 'id=NAME,text=NAME'
    id_ = next((head for head in usable if _head(head) in _HEADS['id']), usable[0])
    cells = {head: [row.cells[heads[head]] for row in table.rows[:_MANY]
                    if heads[head] < len(row.cells)] for head in usable if head != id_}
    text = max(cells, key=lambda head: sum(map(len, cells[head])))
    role = 'fretish' if any('shall' in cell.split() for cell in cells[text]) else 'text'
    return shlex.quote(f'id={id_},{role}={text}')


def _listed(cells: Iterable[str]) -> str:
    names = [shown(cell) for cell in cells if cell.strip()]
    return 'its columns are ' + ', '.join(names[:_MANY]) + (', ...' if len(names) > _MANY else '')


def _requirement(cells: Mapping[str, str], row: str, file: str,
                 problems: Problems) -> ComponentRequirement:
    id_ = cells.get('id', '') or cells.get('identifier', '')
    if not id_:
        id_ = row
        problems.warning(f'{file}, {row} has no id', None, '', f'its id is {shown(id_)}')
    return ComponentRequirement(
        id_, tuple(_wordings(cells, f'{file}, {row}')),
        cells.get('title', '') or cells.get('section', ''), cells.get('rationale', ''),
        is_assumption=cells.get('assumption', '').lower() == 'true')


def _wordings(cells: Mapping[str, str], label: str) -> Iterator[Wording]:
    for role, languages in _LANGUAGES.items():
        if cells.get(role):
            yield Wording(languages, cells[role], label, fault=_too_long(cells[role], label))
    if text := cells.get('text'):
        # A lone word would be a formula of one input; it is a heading, or prose.
        is_formal = _OPERATOR.search(text) is not None
        yield Wording(tuple(Language) if is_formal else (Language.FRETISH,), text, label,
                      fault=_too_long(text, label) or (None if is_formal else _word(text, label)))


def _too_long(text: str, label: str) -> Diagnostic | None:
    """Return why a text is not parsed, which might take very long."""
    if len(text) <= _LONGEST_TEXT:
        return None
    return Diagnostic(f'a text of more than {_LONGEST_TEXT:,} characters is no requirement',
                      help=label, level=Level.WARNING)


def _word(text: str, label: str) -> Diagnostic | None:
    """Return why a text of one word is not parsed."""
    return None if ' ' in text else Diagnostic(
        'one word is no requirement', level=Level.WARNING,
        help=f'{label}: {shown(text)}; a formula of one input is ({text}), or in a column of its '
        'language')


def _component(item: ComponentRequirement) -> str:
    """Return the component that the sentence of a requirement names; '' if it has none."""
    for wording in item.wordings:
        if Language.FRETISH in wording.languages:
            tree = parse_wording(wording).tree
            if isinstance(tree, Sentence):
                return tree.component.name
    return ''
