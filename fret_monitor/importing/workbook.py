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

"""Reads the sheets of a workbook (XLSX), with openpyxl (the extra `xlsx`)."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import date
from io import BytesIO
from itertools import islice
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import ParseError
import zipfile

from fret_monitor.model.diagnostics import Problems, refuse, require_packages
from fret_monitor.model.names import shown

NEEDED: Mapping[str, str] = {'openpyxl': 'openpyxl'}
"""The module that is needed, and its package."""

_MOST_PARTS = 10_000
_BROKEN = (ParseError, zipfile.BadZipFile, KeyError, ValueError, TypeError, IndexError,
           AttributeError, EOFError, OSError, SyntaxError)


def sheets(path: Path, max_bytes: int, max_rows: int,
           problems: Problems) -> list[tuple[str, list[tuple[str, ...]]]]:
    """
    Return the name of each sheet that can be seen, and its rows as texts.

    Of a cell with a formula of the spreadsheet, the value that was saved with it counts; where
    there is none, it is reported. Of merged cells the first one has the text.

    Raises
    ------
    CompileError
        if openpyxl is missing, the file is no workbook, unpacks to more than `max_bytes`, declares
        a document type (entities), or a sheet has more than `max_rows` rows below its head.
    """
    require_packages('`import` of an XLSX file', NEEDED)
    from openpyxl import load_workbook
    with _errors_of(path):
        _check_parts(path, max_bytes)
        values = load_workbook(path, read_only=True, data_only=True)
        formulas = load_workbook(path, read_only=True)
        try:
            return [(sheet.title, list(_rows(sheet, formulas[sheet.title], path.name, max_rows,
                                             problems)))
                    for sheet in values.worksheets if sheet.sheet_state == 'visible']
        finally:
            values.close()
            formulas.close()


def write_cells(path: Path, max_bytes: int, heads: Sequence[str],
                rows: Mapping[str, Sequence[str]]) -> bytes:
    """
    Return a workbook with the columns `heads` added behind those of each sheet with such rows.

    `rows` has the cells of each row by its label: the names of file and row, and of the sheet
    between them where several are read. Columns of these heads are written anew. Raises as
    `sheets` does.
    """
    require_packages('a result in an XLSX file', NEEDED)
    from openpyxl import load_workbook
    with _errors_of(path):
        _check_parts(path, max_bytes)
        book = load_workbook(path)
        for sheet in book.worksheets:
            _add_columns(sheet, heads, {
                number: cells for number in range(1, sheet.max_row + 1)
                for label in (f'{path.name}, row {number}',
                              f'{path.name}, {sheet.title}, row {number}')
                if (cells := rows.get(label)) is not None and sheet.sheet_state == 'visible'})
        file = BytesIO()
        book.save(file)
        return file.getvalue()


def _add_columns(sheet: Any, heads: Sequence[str], rows: Mapping[int, Sequence[str]]) -> None:
    """Add columns to a sheet; without rows it stays as it is."""
    if not rows:
        return
    first = next(number for number in range(1, sheet.max_row + 1)
                 if any(cell.value is not None for cell in sheet[number]))
    names = [cell.value for cell in sheet[first]]
    for place, head in enumerate(heads):
        column = 1 + (names.index(head) if head in names else len(names))
        names += [] if head in names else [head]
        sheet.cell(first, column, head)
        for number, cells in rows.items():
            cell = sheet.cell(number, column, cells[place] if place < len(cells) else '')
            cell.data_type = 's'  # no formula


@contextmanager
def _errors_of(path: Path) -> Iterator[None]:
    try:
        yield
    except _BROKEN as error:
        reason = (getattr(error, 'strerror', None) or ' '.join(str(error).split())
                  or type(error).__name__)
        refuse(f'{shown(str(path))} cannot be read as a workbook: {reason}',
               help="save it as 'Excel workbook (.xlsx)', or as 'CSV UTF-8'")


def _check_parts(path: Path, max_bytes: int) -> None:
    """Refuse what would unpack to too much, or has entities, before any of it is parsed."""
    with zipfile.ZipFile(path) as file:
        parts = file.infolist()
        if len(parts) > _MOST_PARTS or sum(part.file_size for part in parts) > max_bytes:
            refuse(f'{shown(str(path))} unpacks to more than {max_bytes // 2 ** 20} MiB')
        for part in parts:
            if part.filename.endswith(('.xml', '.rels')) and b'<!DOCTYPE' in file.read(part):
                refuse(f'{shown(str(path))} declares a document type, in {shown(part.filename)}',
                       help='no spreadsheet writes one: entities are not read')


def _rows(sheet: Any, formulas: Any, file: str, max_rows: int, problems: Problems
          ) -> Iterator[tuple[str, ...]]:
    sheet.reset_dimensions()  # some programs write too few
    formulas.reset_dimensions()
    pairs = zip(sheet.iter_rows(values_only=True), formulas.iter_rows(values_only=True))
    for number, (cells, written) in enumerate(islice(pairs, max_rows + 2), 1):
        for cell, text in zip(cells, written):
            if cell is None and text is not None:
                problems.warning(
                    f'{file}, {sheet.title}, row {number} has a formula of the spreadsheet '
                    f'without its value: {shown(str(text))}', None, '',
                    'open and save it with a spreadsheet program')
        yield tuple(map(_text, cells))


def _text(cell: Any) -> str:
    """Return the text of a cell; a whole number, as an id often is, has no decimal point."""
    match cell:
        case None:
            return ''
        case bool():
            return str(cell).lower()
        case float() if cell.is_integer():
            return str(int(cell))
        case date():
            return cell.isoformat()
        case _:
            return str(cell)
