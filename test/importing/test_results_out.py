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

"""Requirements leave as tables and ReqIF, and come back with verdicts under the same ids."""

from collections.abc import Sequence
import csv
import os
from pathlib import Path
import zipfile

from fret_monitor.build import read
from fret_monitor.cli.main import main
from fret_monitor.importing import import_bundles
from fret_monitor.importing.files import ImportOptions
from fret_monitor.importing.tables import encoded
from fret_monitor.model.diagnostics import CompileError
import openpyxl
import pytest

BUNDLE = """
format: 1
component: rover
inputs:
  speed: {type: float64}
  armed: {type: bool}
requirements:
  - {id: "010", title: "=A1 & <b>", fretish: the rover shall always satisfy speed <= 2.0}
  - {id: R-2, ptltl: "H (armed -> speed < 3.0)", rationale: "wheels; \\"hot\\""}
  - {id: "R, 3", cocospec: "H(armed => speed < 1.0)", assume: true}
  - {id: R-4, mltl: "armed -> F[0,1] (speed < 9.0)"}
"""
TRACE = 'time,speed,armed\n0,1,0\n1,2.5,0\n2,1.5,1\n3,0,0\n'
VERDICTS = {'010': ('violated', '1'), 'R-2': ('satisfied', '0'), 'R, 3': ('violated', '1'),
            'R-4': ('satisfied', '0')}
ENDINGS = ('csv', 'xlsx', 'reqif')


def rows_of(path: Path) -> list[list[str]]:
    if path.suffix == '.csv':
        with path.open(newline='', encoding='utf-8') as file:
            return list(csv.reader(file))
    sheet = openpyxl.load_workbook(path).worksheets[0]
    return [['' if cell is None else str(cell) for cell in row]
            for row in sheet.iter_rows(values_only=True)]


def checked(folder: Path, bundle: Path, *more: str) -> int:
    trace = folder / 'drive.csv'
    trace.write_text(TRACE, encoding='utf-8')
    return main(['bag', str(bundle), str(trace), *more])


def told(path: Path, bundle: Path) -> dict[str, tuple[str, str]]:
    """Return verdict and occurrences by id, read from a table or, through `import`, from ReqIF."""
    if path.suffix != '.reqif':
        head, *rows = rows_of(path)
        assert len(set(head)) == len(head)
        places = [head.index(name) for name in ('ID', 'Verdict', 'Occurrences')]
        return {row[places[0]]: (row[places[1]], row[places[2]]) for row in rows}
    found: dict[str, list[str]] = {}
    for column in ('Verdict', 'Occurrences'):
        again, = import_bundles([path], bundle, options=ImportOptions({'title': column}))
        for item in again.draft.requirements:
            found.setdefault(item.id, []).append(item.title)
    return {id_: (cells[0], cells[1]) for id_, cells in found.items()}


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    path = tmp_path / 'rover.yaml'
    path.write_text(BUNDLE, encoding='utf-8')
    return path


@pytest.mark.parametrize('ending', ENDINGS)
def test_an_export_of_requirements_is_imported_as_it_was(ending: str, bundle: Path,
                                                         tmp_path: Path) -> None:
    out, back = tmp_path / f'out.{ending}', tmp_path / 'back.yaml'
    assert main(['export', str(bundle), '--to', 'requirements', '-o', str(out)]) == 0
    assert main(['import', str(out), '-o', str(back)]) == 0
    if ending == 'reqif':
        assert out.read_bytes().startswith(b'<?xml version="1.0" encoding="UTF-8"?>\n<REQ-IF ')
    first, again = read(bundle).bundle, read(back).bundle
    assert first and again and again.component and again.component.value == 'rover'
    assert [(item.id.value, item.language, item.text.value, item.title, item.rationale,
             item.is_assumption) for item in first.requirements] == [
        (item.id.value, item.language, item.text.value, item.title, item.rationale,
         item.is_assumption) for item in again.requirements]


@pytest.mark.parametrize('ending', ENDINGS)
def test_verdicts_go_into_the_file_and_a_second_run_writes_them_anew(
        ending: str, bundle: Path, tmp_path: Path) -> None:
    out, once, twice = (tmp_path / f'{name}.{ending}' for name in ('out', 'once', 'twice'))
    assert main(['export', str(bundle), '--to', 'requirements', '-o', str(out)]) == 0
    assert checked(tmp_path, bundle, '--fill', str(out), str(once)) == 0
    assert told(once, bundle) == VERDICTS
    assert checked(tmp_path, bundle, '--fill', str(once), str(twice)) == 0
    assert told(twice, bundle) == VERDICTS
    if ending != 'xlsx':  # a workbook has the time at which it was written
        assert once.read_bytes() == twice.read_bytes()


ROWS: Sequence[Sequence[str]] = (
    ('Nr', 'Satz', 'Owner'),
    ('R-1', 'the rover shall always satisfy speed <= 2.0', 'Ann; "A"'),
    ('', '', ''),
    ('R-1', 'the rover shall always satisfy speed <= 3.0', 'Bob'),
    ('R-1', 'the rover shall always satisfy speed <= 2.0', 'a copy of the first'),
    ('', 'H (armed -> speed < 1.0)', ''),
    ('R-5', 'The rover is red.', 'Cy'))
FILLED = [['Verdict', 'Occurrences'], ['violated', '1'], ['', ''], ['satisfied', '0'],
          ['violated', '1'], ['violated', '1'], ['not monitored', '']]


def spreadsheet(path: Path, sign: str = ',', encoding: str = 'utf-8') -> Path:
    """Write the table; a workbook has usual heads, and a sheet that is no table."""
    if path.suffix == '.xlsx':
        book = openpyxl.Workbook()
        for row in (('ID', 'Requirement', 'Owner'), *ROWS[1:]):
            book.worksheets[0].append(tuple(row))
        book.create_sheet('Notes').append(('not a table',))
        book.save(path)
    else:
        with path.open('w', newline='', encoding=encoding) as file:
            csv.writer(file, delimiter=sign).writerows(ROWS)
    return path


@pytest.mark.parametrize('ending', ['csv', 'xlsx'])
def test_a_spreadsheet_comes_back_with_a_verdict_in_each_row(ending: str, tmp_path: Path) -> None:
    table = spreadsheet(tmp_path / f'table.{ending}')
    target, new = tmp_path / 'rover.yaml', tmp_path / f'new.{ending}'
    heads = ['--columns=id=Nr,text=Satz'] if ending == 'csv' else []
    assert main(['import', str(table), *heads, '-o', str(target)]) == 0
    assert checked(tmp_path, target, '--fill', str(table), str(new), *heads) == 0
    rows = rows_of(new)
    places = [rows[0].index(name) for name in ('Verdict', 'Occurrences')]
    assert [[''.join(row[place:place + 1]) for place in places] for row in rows] == FILLED
    assert [row[:3] for row in rows[1:]] == [list(row) for row in ROWS[1:]]
    if ending == 'xlsx':
        book = openpyxl.load_workbook(new)
        assert book['Notes'].max_column == 1
        cells = [book.worksheets[0].cell(2, 1 + rows[0].index(name)).value
                 for name in ('Occurrences', 'First violation')]
        assert cells == [1, 1]  # numbers, which a spreadsheet can sum


@pytest.mark.parametrize(('sign', 'encoding'), [(';', 'utf-16'), ('\t', 'utf-8-sig')])
def test_a_csv_keeps_its_delimiter_and_encoding(sign: str, encoding: str, tmp_path: Path) -> None:
    table = spreadsheet(tmp_path / 'table.csv', sign, encoding)
    target, new = tmp_path / 'rover.yaml', tmp_path / 'new.csv'
    heads = '--columns=id=Nr,text=Satz'
    assert main(['import', str(table), heads, '-o', str(target)]) == 0
    assert checked(tmp_path, target, '--fill', str(table), str(new), heads) == 0
    begin = table.read_bytes()[:3]
    assert new.read_bytes()[:3] == begin
    assert new.read_text(encoding).splitlines()[0] == sign.join(
        ['Nr', 'Satz', 'Owner', 'Verdict', 'Recording', 'Occurrences', 'First violation'])


def test_a_csv_of_excel_on_windows_is_read_and_written_in_its_encoding(
        tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    table, target, new = (tmp_path / name for name in ('t.csv', 'rover.yaml', 'new.csv'))
    table.write_bytes('id;text;Prüfer\r\nR-1;speed <= 2.0;Jörg \u2013 5 €\r\n'.encode('cp1252'))
    assert main(['import', str(table), '-o', str(target)]) == 0
    assert ("t.csv:1:11: warning: 't.csv' is not in UTF-8: it is read as Windows-1252"
            in capfd.readouterr().err)
    assert checked(tmp_path, target, '--fill', str(table), str(new)) == 0
    first, second = new.read_bytes().decode('cp1252').split('\r\n')[:2]
    assert first.startswith('id;text;Prüfer;Verdict;')
    assert second.startswith('R-1;speed <= 2.0;Jörg \u2013 5 €;violated;')
    with pytest.raises(CompileError, match="in an encoding without 'ж'"):
        encoded('ж', table)


def test_of_several_recordings_the_first_with_a_violation_is_named(bundle: Path,
                                                                   tmp_path: Path) -> None:
    out, new = tmp_path / 'out.csv', tmp_path / 'new.csv'
    other = tmp_path / 'other.csv'
    other.write_text('time,speed,armed\n0,5,0\n', encoding='utf-8')
    assert main(['export', str(bundle), '--to', 'requirements', '-o', str(out)]) == 0
    assert checked(tmp_path, bundle, str(other), '--fill', str(out), str(new)) == 0
    head, *rows = rows_of(new)
    found = {row[0]: row[head.index('Recording')] for row in rows}
    assert found == {'010': str(tmp_path / 'drive.csv'), 'R, 3': str(tmp_path / 'drive.csv'),
                     'R-2': '2 recordings', 'R-4': '2 recordings'}


def test_a_requirement_without_a_row_is_named(
        bundle: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, new = tmp_path / 'out.csv', tmp_path / 'new.csv'
    assert main(['export', str(bundle), '--to', 'requirements', '-o', str(out)]) == 0
    out.write_text(out.read_text(encoding='utf-8').replace('R-2,', 'R-9,', 1), encoding='utf-8')
    assert checked(tmp_path, bundle, '--fill', str(out), str(new)) == 0
    assert "warning: 'out.csv' has no row for 'R-2'" in capsys.readouterr().err


@pytest.mark.parametrize(('table', 'new', 'message'), [
    ('out.csv', 'out.csv', 'this command reads it'),
    ('out.csv', 'rover.yaml', 'this command reads it'),
    ('out.csv', 'new.xlsx', 'give it the same ending'),
    ('none.csv', 'new.csv', 'cannot be read'),
    ('drive.csv', 'new.csv', 'has no column of ids'),
    ('all.reqifz', 'new.reqifz', 'unpack it, and fill its file that ends in .reqif'),
    ('project.xml', 'new.xml', 'no table (.csv, .tsv, .xlsx) and no ReqIF'),
    ('none.reqif', 'new.reqif', 'cannot be read')])
def test_what_cannot_be_filled_is_refused(table: str, new: str, message: str, bundle: Path,
                                          tmp_path: Path,
                                          capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / 'out.csv'
    assert main(['export', str(bundle), '--to', 'requirements', '-o', str(out)]) == 0
    with zipfile.ZipFile(tmp_path / 'all.reqifz', 'w') as archive:
        archive.writestr('a.reqif', '<REQ-IF/>')
    (tmp_path / 'project.xml').write_text('<reqs><req key="1">x</req></reqs>')
    assert checked(tmp_path, bundle, '--fill', str(tmp_path / table), str(tmp_path / new)) == 1
    assert message in capsys.readouterr().err
    assert bundle.read_text(encoding='utf-8') == BUNDLE


@pytest.mark.parametrize('ending', ENDINGS)
def test_a_row_whose_text_was_changed_gets_no_verdict(
        ending: str, bundle: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, new = tmp_path / f'out.{ending}', tmp_path / f'new.{ending}'
    assert main(['export', str(bundle), '--to', 'requirements', '-o', str(out)]) == 0
    bundle.write_text(BUNDLE.replace('speed <= 2.0', 'speed <= 99.0'), encoding='utf-8')
    assert checked(tmp_path, bundle, '--fill', str(out), str(new)) == 0
    said = capsys.readouterr().err
    assert told(new, bundle) == {**VERDICTS, '010': ('text differs', '')}
    row = 'object-1' if ending == 'reqif' else 'row 2'
    assert f"'{out.name}': the text is not the one that was judged: {row} ('010')\n" in said


def test_a_text_with_the_name_of_an_operator_is_the_one_that_was_judged(tmp_path: Path) -> None:
    table, new = tmp_path / 'table.csv', tmp_path / 'new.csv'
    table.write_text('ID,Requirement\nR,the rover shall always  satisfy H <= 2.0\n')
    target, trace = tmp_path / 'rover.yaml', tmp_path / 'trace.csv'
    trace.write_text('time,H_value\n0,1\n')
    assert main(['import', str(table), '-o', str(target)]) == 0
    assert main(['bag', str(target), str(trace), '--fill', str(table), str(new)]) == 0
    assert rows_of(new)[1][2] == 'satisfied'


def test_without_a_judged_recording_nothing_is_written(
        bundle: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, new = tmp_path / 'out.csv', tmp_path / 'new.csv'
    assert main(['export', str(bundle), '--to', 'requirements', '-o', str(out)]) == 0
    fill = ('--fill', str(out), str(new))
    assert main(['bag', str(bundle), str(tmp_path / 'gone.csv'), *fill]) == 1
    bundle.write_text(BUNDLE.replace('{type: bool}', '{}'), encoding='utf-8')
    assert checked(tmp_path, bundle, *fill) == 1
    assert "new.csv' is not written: no recording was judged" in capsys.readouterr().err
    assert not new.exists()


def test_what_exists_is_filled_only_with_force_and_a_pipe_never(
        bundle: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, new, pipe = (tmp_path / f'{name}.csv' for name in ('out', 'new', 'pipe'))
    os.mkfifo(pipe)
    assert main(['export', str(bundle), '--to', 'requirements', '-o', str(out)]) == 0
    new.write_text('mine')
    for path, message in ((new, "new.csv' exists"), (pipe, "pipe.csv': it is no file")):
        assert checked(tmp_path, bundle, '--fill', str(out), str(path)) == 1
        assert message in capsys.readouterr().err
    assert new.read_text() == 'mine'
    assert checked(tmp_path, bundle, '--fill', str(out), str(new), '--force') == 0
    assert told(new, bundle) == VERDICTS
    for places in ((out, pipe), (pipe, tmp_path / 'other.csv')):
        assert checked(tmp_path, bundle, '--force', '--fill', *map(str, places)) == 1
    assert "pipe.csv' is a named pipe, not a file" in capsys.readouterr().err


def test_the_ending_says_what_is_exported(bundle: Path, tmp_path: Path,
                                          capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / 'out.docx'
    assert main(['export', str(bundle), '--to', 'requirements', '-o', str(out)]) == 1
    assert 'ends in none of .csv, .xlsx, .reqif' in capsys.readouterr().err
    assert not out.exists()


def test_a_cell_without_a_head_is_no_part_of_a_requirement_and_is_not_lost(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = tmp_path / 'cut.csv'
    table.write_text('ID,Requirement\nA,the rover shall always satisfy speed <= 20,5\n'
                     'B,the rover shall always satisfy speed <= 20,\n')
    bundle, new = tmp_path / 'cut.yaml', tmp_path / 'new.csv'
    assert main(['import', str(table), '-o', str(bundle)]) == 0
    said = capsys.readouterr()
    assert 'its row has more cells than there are heads' in said.err
    assert "cut.csv, row 2: put a text with ',' in quotes, or give each column a head" in said.err
    assert [item.id for item in read(bundle).specification.properties] == ['B']
    assert checked(tmp_path, bundle, '--fill', str(table), str(new)) == 1
    assert ', row 2 has more cells than there are heads' in capsys.readouterr().err
    assert not new.exists()
    table.write_text(table.read_text().replace(',5', ''))
    assert checked(tmp_path, bundle, '--fill', str(table), str(new)) == 0
    assert rows_of(new)[2][1:3] == ['the rover shall always satisfy speed <= 20', 'satisfied']
