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
Writes results back into the file that was imported: CSV, XLSX or ReqIF.

The file stays as it is, with further columns (attributes, in ReqIF) at the end; columns of these
names that it has already are written anew. Rows are found by the ids that `import` gives them.
"""

from collections.abc import Mapping, Sequence
import csv
import io
from pathlib import Path

from fret_monitor.importing.component import Wording
from fret_monitor.importing.draft import free_name, written_name
from fret_monitor.importing.files import ImportOptions, MAX_BYTES, read_files
from fret_monitor.importing.parsed_wording import names_in, parse_wording, rename
from fret_monitor.importing.reqif_file import is_reqif
from fret_monitor.importing.reqif_results import filled_reqif
from fret_monitor.importing.reqifz import SUFFIX as ARCHIVE
from fret_monitor.importing.tables import (
    csv_rows, decoded, encoded, more_cells_help, read_table, split_separator, SUFFIXES,
    WORKBOOK,
)
from fret_monitor.importing.workbook import write_cells
from fret_monitor.model.bundle_files import refuse_irregular
from fret_monitor.model.csv_writer import CsvWriter
from fret_monitor.model.diagnostics import Problems, refuse, Source, Span
from fret_monitor.model.names import fret_name, shown

_MISSING, _OTHER = 'not monitored', 'text differs'
_TEXT_COLUMNS = 2  # the verdict and the recording; the others have numbers
_MOST_NAMED = 20


def check_fillable(path: Path) -> None:
    """
    Refuse a file that results cannot be written into, before recordings are read for it.

    Raises
    ------
    CompileError
        if the file is no table and no ReqIF, or a cell of a CSV would be lost.
    """
    refuse_irregular(path)
    kind = path.suffix.lower()
    if kind == ARCHIVE:
        refuse(f'{shown(str(path))} is an archive, in which no results are written',
               help='unpack it, and fill its file that ends in .reqif')
    if kind in SUFFIXES:
        _fillable_rows(decoded(path, MAX_BYTES), path)
        return
    if kind == WORKBOOK or is_reqif(text := decoded(path, MAX_BYTES)):
        return
    refuse(f'{shown(str(path))} is no table (.csv, .tsv, .xlsx) and no ReqIF, in which results '
           'are written', Span(Source(str(path), text), 0, 1) if text else None,
           'begins here' if text else '',
           '`fret-monitor export BUNDLE --to requirements -o FILE.csv` writes a table to fill')


def filled(path: Path, heads: Sequence[str], results: Mapping[str, Sequence[str]],
           texts: Mapping[str, str], columns: Mapping[str, str], problems: Problems) -> bytes:
    """
    Return the content of a table with further columns; `columns` are as of `read_table`.

    `results` and `texts` have the cells and the text of each requirement by its id in the bundle.
    A requirement of the table that has none is 'not monitored' in the first of the columns; one
    that has another text there gets no result, and is reported, as is one without a row.

    Raises
    ------
    CompileError
        if the file is no table or ReqIF, or cannot be read.
    """
    rows: dict[str, tuple[str, ...]] = {}
    other: list[str] = []
    found = _rows_of(path, columns)
    for label, (id_, wordings) in found.items():
        if id_ in results and not _has_text(wordings, texts.get(id_, '')):
            rows[label] = (_OTHER,)
            other.append(f'{label.removeprefix(f"{path.name}, ")} ({shown(id_)})')
        else:
            rows[label] = tuple(results.get(id_, (_MISSING,)))
    if other:
        problems.warning(
            f'{shown(path.name)}: the text is not the one that was judged: {_listed(other)}', None,
            '', f"the verdict there is '{_OTHER}'; import the table again, or write there what "
            'the bundle has')
    if without := results.keys() - {id_ for id_, _ in found.values()}:
        problems.warning(
            f'{shown(path.name)} has no row for {_listed([*map(shown, sorted(without))])}', None,
            '', 'what was found about it is printed, and not in the new file')
    if path.suffix.lower() == WORKBOOK:
        return write_cells(path, MAX_BYTES, heads, rows, heads[_TEXT_COLUMNS:])
    text = decoded(path, MAX_BYTES)
    if is_reqif(text):
        return encoded(filled_reqif(text, path, heads, rows), path)
    return _filled_csv(text, path, heads, rows)


def _listed(names: Sequence[str]) -> str:
    more = f' and {len(names) - _MOST_NAMED:,} more' if len(names) > _MOST_NAMED else ''
    return ', '.join(names[:_MOST_NAMED]) + more


def _rows_of(path: Path, columns: Mapping[str, str]) -> dict[str, tuple[str, list[Wording]]]:
    """Return the id of each row's requirement and its wordings, by the label of the row."""
    options = ImportOptions(columns)
    read = [(item, wording) for component in read_files([path], Problems(), options).components
            for item in component.requirements for wording in item.wordings]
    written = {wording.label: item.id for item, wording in read}
    same = {(item.source or item.id, wording.text): item.id for item, wording in read}
    text = decoded(path, MAX_BYTES) if path.suffix.lower() != WORKBOOK else ''
    found: dict[str, tuple[str, list[Wording]]] = {}
    for component in read_table(path, MAX_BYTES, columns, Problems(),
                                text if is_reqif(text) else None):
        for item in component.requirements:
            for wording in item.wordings:
                label = wording.label
                id_ = written.get(label) or same.get((item.id, wording.text), item.id)
                found.setdefault(label, (id_, []))[1].append(wording)
    return found


def _has_text(wordings: Sequence[Wording], text: str) -> bool:
    """Whether one of the wordings of a row is the text of a requirement in the bundle."""
    wanted = ' '.join(text.split())
    return any(wanted == ' '.join(item.text.split()) for item in wordings) or any(
        wanted == _renamed(item) for item in wordings)


def _renamed(wording: Wording) -> str:
    """Return a text with the names that `import` gives to what has the name of an operator."""
    reading = parse_wording(wording)
    taken = {fret_name(name) for name in names_in(reading)}
    new = {fret_name(name): free_name(name, taken) for name in names_in(reading)
           if written_name(name) is None}
    return ' '.join(rename(reading, new).wording.text.split()) if new else wording.text


def places_of(head: Sequence[str], wanted: Sequence[str]) -> list[int]:
    """Return where columns are, or are added, in a table with the heads `head`."""
    found = list(head)
    for name in wanted:
        if name not in found:
            found.append(name)
    return [found.index(name) for name in wanted]


def _fillable_rows(text: str, path: Path) -> list[list[str]]:
    """Return the rows of a CSV; refuse a cell without a head, which results might replace."""
    rows = [*csv_rows(text, path)]
    head = next((cells for cells in rows if any(map(str.strip, cells))), [])
    for number, cells in enumerate(rows, 1):
        if any(map(str.strip, cells[len(head):])):
            refuse(f'{shown(str(path))}, row {number} has more cells than there are heads',
                   help=more_cells_help(split_separator(text)[2]))
    return rows


def _filled_csv(text: str, path: Path, heads: Sequence[str],
                rows: Mapping[str, Sequence[str]]) -> bytes:
    read = _fillable_rows(text, path)
    before, text, sign = split_separator(text)
    first = next(number for number, cells in enumerate(read) if any(map(str.strip, cells)))
    places = places_of(read[first], heads)
    for number, cells in enumerate(read, 1):
        added = heads if number == first + 1 else rows.get(f'{path.name}, row {number}')
        if added is not None:
            cells += [''] * (max(places) + 1 - len(cells))
            for place, cell in zip(places, (*added, *[''] * len(places)), strict=False):
                cells[place] = cell
    file = io.StringIO(newline='')
    file.write(before)
    writer = csv.writer(file, delimiter=sign, lineterminator='\r\n') if '\r\n' in text else \
        CsvWriter(file, sign)
    writer.writerows(read)
    return encoded(file.getvalue(), path)
