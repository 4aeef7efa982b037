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

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, ExitStack
from datetime import date
from io import BytesIO
from pathlib import Path
import re
from typing import Any
from xml.etree.ElementTree import ParseError
import zipfile

from fret_monitor.importing.archive import blocks_of, parts_of
from fret_monitor.model.diagnostics import Problems, refuse, require_packages
from fret_monitor.model.names import shown

NEEDED: Mapping[str, str] = {'openpyxl': 'openpyxl'}
"""The module that is needed, and its package."""

MAX_CELLS = 2_000_000
"""Cells of a workbook, also of empty ones that are written or stand before others in a row."""

_CELL, _FORMULA = (re.compile(rb'<(?:\w+:)?%s[\s>/]' % name) for name in (b'c', b'f'))
_DIGITS = re.compile(r'(0+)(?:\.(0+))?')
_TYPE = b'<!DOCTYPE'
_BROKEN = (ParseError, zipfile.BadZipFile, KeyError, ValueError, TypeError, IndexError,
           AttributeError, EOFError, OSError, SyntaxError)


def sheets(path: Path, max_bytes: int, max_rows: int,
           problems: Problems) -> list[tuple[str, list[tuple[str, ...]]]]:
    """
    Return the name of each sheet that can be seen, and its rows as texts; others are reported.

    Of a cell with a formula of the spreadsheet, the value that was saved with it counts; where
    there is none, it is reported. Of merged cells the first one has the text.

    Raises
    ------
    CompileError
        if openpyxl is missing, the file is no workbook, unpacks to more than `max_bytes`, declares
        a document type (entities), has more than `MAX_CELLS`, or a sheet has more than `max_rows`
        rows below its head.
    """
    require_packages('`import` of an XLSX file', NEEDED)
    from openpyxl import load_workbook
    with _errors_of(path), ExitStack() as stack:
        has_formulas = _check_parts(path, max_bytes)
        values = load_workbook(path, read_only=True, data_only=True)
        stack.callback(values.close)
        formulas = load_workbook(path, read_only=True) if has_formulas else None
        stack.callback(formulas.close if formulas else bool)
        found, left = [], MAX_CELLS
        for sheet in values.worksheets:
            rows: list[tuple[str, ...]] = []
            for row in _rows(sheet, formulas and formulas[sheet.title], path.name, max_rows,
                             problems):
                rows.append(row)
                left -= len(row)
                _require_cells(left, path)
            found.append((sheet, rows))
    for sheet, rows in found:
        if sheet.sheet_state != 'visible' and any(map(any, rows)):
            problems.warning(f'{path.name}: the sheet {shown(sheet.title)} is left out', None, '',
                             'it is hidden; show it in a spreadsheet program to import it')
    return [(sheet.title, rows) for sheet, rows in found if sheet.sheet_state == 'visible']


def write_cells(path: Path, max_bytes: int, heads: Sequence[str],
                rows: Mapping[str, Sequence[str]], numbers: Collection[str]) -> bytes:
    """
    Return a workbook with the columns `heads` added behind those of each sheet with such rows.

    `rows` has the cells of each row by its label: the names of file and row, and of the sheet
    between them where several are read. Columns of these heads are written anew; `numbers` are
    those whose cells are numbers. Raises as `sheets` does.
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
                if (cells := rows.get(label)) is not None and sheet.sheet_state == 'visible'},
                numbers)
        file = BytesIO()
        book.save(file)
        return file.getvalue()


def _add_columns(sheet: Any, heads: Sequence[str], rows: Mapping[int, Sequence[str]],
                 numbers: Collection[str]) -> None:
    """Add columns to a sheet, some of `numbers`; without rows it stays as it is."""
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
            text = cells[place] if place < len(cells) else ''
            cell = sheet.cell(number, column, text)
            cell.data_type = 's'  # no formula
            if head in numbers and text:
                cell.value = float(text)


@contextmanager
def _errors_of(path: Path) -> Iterator[None]:
    try:
        yield
    except _BROKEN as error:
        reason = (getattr(error, 'strerror', None) or ' '.join(str(error).split())
                  or type(error).__name__)
        refuse(f'{shown(str(path))} cannot be read as a workbook: {reason}',
               help="save it as 'Excel workbook (.xlsx)', or as 'CSV UTF-8'")


def _check_parts(path: Path, max_bytes: int) -> bool:
    """
    Refuse what is too large, or has entities, before any of it is parsed.

    Return whether there are formulas of the spreadsheet.
    """
    name, cells, has_formulas = shown(str(path)), 0, False
    with zipfile.ZipFile(path) as file:
        for part in parts_of(file, name, max_bytes):
            rest = b''  # of the block before: what is looked for may be in two blocks
            for block in blocks_of(file, part):
                text = rest + block
                if part.filename.endswith(('.xml', '.rels')) and _TYPE in text:
                    refuse(f'{name} declares a document type, in {shown(part.filename)}',
                           help='no spreadsheet writes one: entities are not read')
                rest = text[-len(_TYPE):]
                if part.filename.startswith('xl/worksheets/'):
                    cells += len(_CELL.findall(text)) - len(_CELL.findall(rest))
                    has_formulas |= _FORMULA.search(text) is not None
            _require_cells(MAX_CELLS - cells, path)
    return has_formulas


def _require_cells(left: int, path: Path) -> None:
    if left < 0:
        refuse(f'{shown(str(path))} has more than {MAX_CELLS:,} cells',
               help="delete the empty ones that have a format, or save it as 'CSV UTF-8'")


def _rows(sheet: Any, formulas: Any, file: str, max_rows: int, problems: Problems
          ) -> Iterator[tuple[str, ...]]:
    """Yield the rows of a sheet, with the empty ones between, until there are too many."""
    sheet.reset_dimensions()  # some programs write too few
    rows = sheet.iter_rows()
    pairs: Iterable[tuple[Sequence[Any], Sequence[Any]]] = ((row, ()) for row in rows)
    if formulas is not None:
        formulas.reset_dimensions()
        pairs = zip(rows, formulas.iter_rows(values_only=True))
    left = max_rows + 1  # and the heads
    for number, (cells, written) in enumerate(pairs, 1):
        for cell, text in zip(cells, written):
            if cell.value is None and text is not None:
                problems.warning(
                    f'{file}, {sheet.title}, row {number} has a formula of the spreadsheet '
                    f'without its value: {shown(str(text))}', None, '',
                    'open and save it with a spreadsheet program')
        left -= any(cell.value is not None for cell in cells)
        yield tuple(map(_shown_text, cells))
        if left < 0:
            return


def _shown_text(cell: Any) -> str:
    """Return the text of a cell, of a number with the digits of its format `0000` or `0.00`."""
    text = _text(cell.value)
    if isinstance(cell.value, int | float) and not isinstance(cell.value, bool) and (
            digits := _DIGITS.fullmatch(cell.number_format)):
        after = len(digits[2] or '')
        written = f'{cell.value:0{len(digits[1]) + after + bool(after)}.{after}f}'
        return written if float(written) == cell.value else text
    return text


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
