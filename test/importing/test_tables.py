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


"""Tables of requirements, CSV and XLSX, become bundles; what is no formula is told."""

from pathlib import Path
import shlex
import tracemalloc
import zipfile

from fret_monitor.build import read
from fret_monitor.cli.main import main
from fret_monitor.elaboration import languages
from fret_monitor.importing import files, import_bundles, tables, workbook as workbooks
from fret_monitor.importing.files import ImportOptions
from fret_monitor.importing.tables import MAX_ROWS
from fret_monitor.language.fretish import parse_fretish
from fret_monitor.language.sentence import Sentence
from fret_monitor.model.diagnostics import CompileError, Problems, Text
import openpyxl
import pytest

ROWS = (
    ('ID', 'Title', 'Requirement', 'Rationale'),
    ('R-1', 'Speed', 'the rover shall always satisfy speed <= 2.0', 'the wheels'),
    ('R-2', '', 'H (armed -> speed < 1.0)', ''),
    ('R-3', '', 'if armed then F[0,3] (speed > 0.1)', ''),
    ('R-4', '', 'armed -> F[0,3] (speed > 0.1)', ''),
    ('R-5', '', 'The rover is red.', ''),
    ('', 'Safety', '', ''),
    ('R-1', '', 'the rover shall always satisfy armed', ''),
    ('R_1', '', 'the rover shall always satisfy !armed', ''),
)


def csv_of(rows: tuple[tuple[str, ...], ...], delimiter: str = ',') -> str:
    return '\n'.join(delimiter.join(f'"{cell}"' if delimiter in cell else cell for cell in row)
                     for row in rows) + '\n'


def imported(folder: Path, data: bytes, name: str = 'rover.csv', **options: object) -> Path:
    (folder / name).write_bytes(data)
    target = folder / 'rover.yaml'
    more = [f'--columns={options["columns"]}'] if options else []
    assert main(['import', str(folder / name), '-o', str(target), '--force', *more]) == 0
    return target


@pytest.mark.parametrize('data', [
    csv_of(ROWS).encode(), csv_of(ROWS, ';').encode('utf-16'),
    csv_of(ROWS, '\t').encode('utf-8-sig'), csv_of(ROWS).replace('\n', '\r\n').encode()],
    ids=['commas', 'utf-16', 'tabs', 'windows'])
def test_each_row_is_a_requirement_or_a_comment(data: bytes, tmp_path: Path) -> None:
    target = imported(tmp_path, data)
    found = {item.id: item.text for item in read(target).specification.properties}
    assert found == {
        'R-1': 'the rover shall always satisfy speed <= 2.0', 'R-2': 'H (armed -> speed < 1.0)',
        'R-4': 'armed -> F[0,3] (speed > 0.1)',
        'R-1_2': 'the rover shall always satisfy armed',
        'R_1_3': 'the rover shall always satisfy !armed'}
    text = target.read_text(encoding='utf-8')
    assert 'title: Speed' in text and 'rationale: "the wheels"' in text
    for left_out in ('R-3', 'R-5', 'The rover is red.', 'row 7'):
        assert left_out in text
    assert text.count('left out: ') == 3


def test_columns_can_be_named(tmp_path: Path) -> None:
    text = 'Nr.;Formel;Satz\n1;x > 0;the sw shall satisfy x > 0\n'
    target = imported(tmp_path, text.encode(), columns='id=nr.,ptltl=Formel,fretish=Satz')
    (item,) = read(target).specification.properties
    assert (item.id, item.text) == ('1', 'the sw shall satisfy x > 0')


def test_line_breaks_and_other_delimiters_inside_a_cell_are_no_rows_and_no_columns(
        tmp_path: Path) -> None:
    text = '\n"ID (of a;b;c;d;\ne)",text\n\n1,"x >\n0"\n,x > 1\n'
    target = imported(tmp_path, text.encode(), columns='id=ID (of a;b;c;d; e)')
    assert {item.id: item.text for item in read(target).specification.properties} == {
        '1': 'x > 0', 'row 5': 'x > 1'}


def test_topics_of_a_list_are_taken(tmp_path: Path) -> None:
    (tmp_path / 'topics.csv').write_text('speed,/speed,std_msgs/msg/Float32\n')
    (tmp_path / 'rover.csv').write_text('id,text\nR,speed < 1.0\n')
    found, = import_bundles([tmp_path / 'rover.csv', tmp_path / 'topics.csv'], tmp_path / 'a.yaml')
    assert [(item.name, item.topic) for item in found.draft.inputs] == [('speed', '/speed')]


@pytest.mark.parametrize(('data', 'message'), [
    (b'id,text\n', 'no row below the heads'),
    (b'id,text\nR,"x > 0\n', 'line 2'),
    (b'id,text\nR,x > \x81\n', 'is not UTF-8: line 2'),
    (b'\xef\xbb\xbfid,text\nR,x > \xe4\n', 'is not UTF-8: line 2'),
    ('id,text\nÜ,x > 0\nR,x > \xe4\n'.encode() + b'\xff', 'is not UTF-8: line 4'),
    (b'a,b\n1,2\n', 'has no column of ids'),
    (b'id,text,id,text\nR,x > 0,S,x > 1\n', "has several columns 'id'"),
    (b'id,text\n' + b'R,x > 0\n' * (MAX_ROWS + 1), f'more than {MAX_ROWS:,} rows')],
    ids=['empty', 'quote', 'undefined', 'marked', 'one byte', 'other heads', 'twice', 'long'])
def test_what_is_no_table_is_refused(data: bytes, message: str, tmp_path: Path) -> None:
    (tmp_path / 'a.csv').write_bytes(data)
    with pytest.raises(CompileError, match=message):
        import_bundles([tmp_path / 'a.csv'], tmp_path / 'a.yaml')


@pytest.mark.parametrize(('columns', 'message'), [
    ({'id': 'IDD'}, 'has no column'), ({'id': 'text'}, 'no column of requirements')])
def test_columns_that_are_not_there_are_refused(columns: dict[str, str], message: str,
                                                tmp_path: Path) -> None:
    (tmp_path / 'a.csv').write_text('id,text\nR,x > 0\n')
    with pytest.raises(CompileError, match=message):
        import_bundles([tmp_path / 'a.csv'], tmp_path / 'a.yaml', options=ImportOptions(columns))


def workbook(path: Path, **sheets: tuple[tuple[object, ...], ...]) -> Path:
    book = openpyxl.Workbook()
    book.remove(book.active)
    for name, rows in sheets.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(row)
    book.save(path)
    return path


def test_a_workbook_becomes_what_its_table_does(tmp_path: Path) -> None:
    from_csv = imported(tmp_path, csv_of(ROWS).encode()).read_text(encoding='utf-8')
    target = tmp_path / 'rover.yaml'
    path = workbook(tmp_path / 'rover.xlsx', Rover=ROWS)
    assert main(['import', str(path), '-o', str(target), '--force']) == 0
    assert target.read_text(encoding='utf-8') == from_csv.replace('rover.csv', 'rover.xlsx')


def test_a_number_of_a_workbook_has_the_digits_that_are_shown(tmp_path: Path) -> None:
    shown = {'1.10': (1.1, '0.00'), '1.1': (1.1, 'General'), '0003': (3, '0000'), '3': (3, '0'),
             '1.5': (1.5, '0'), '2.25': (2.25, '#,##0.00'), '04.50': (4.5, '00.00')}
    path = workbook(tmp_path / 'ids.xlsx', A=(
        ('id', 'text'), *((value, f'x > {number}')
                          for number, (value, _) in enumerate(shown.values()))))
    book = openpyxl.load_workbook(path)
    for number, (_, form) in enumerate(shown.values(), 2):
        book['A'][f'A{number}'].number_format = form
    book.save(path)
    found, = tables.read_table(path, 2 ** 20, {}, Problems())
    assert [item.id for item in found.requirements] == [*shown]


def test_one_column_alone_is_told_what_separates_cells(tmp_path: Path) -> None:
    text = 'ID|Requirement\nR-1|x > 0\n'
    (tmp_path / 'a.csv').write_text(text)
    with pytest.raises(CompileError) as caught:
        import_bundles([tmp_path / 'a.csv'], tmp_path / 'a.yaml')
    assert 'such as sep=| says' in str(caught.value.diagnostics[0].help)
    (tmp_path / 'a.csv').write_text('sep=|\n' + text)
    found, = import_bundles([tmp_path / 'a.csv'], tmp_path / 'a.yaml')
    assert [item.id for item in found.draft.requirements] == ['R-1']


def test_each_sheet_with_the_columns_is_read_and_others_are_told(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    head = ('Key', 'Formula')
    path = workbook(tmp_path / 'two.xlsx', A=(head, (1, 'x > 0'), (2.5, '=B2')),
                    B=((), (None,), head, ('b', 'y > 0')), Notes=(('nothing', 'here'), (1, 2)))
    book = openpyxl.load_workbook(path)
    book['A'].merge_cells('A2:A3')
    for name in ('Old', 'Empty'):
        book.create_sheet(name).sheet_state = 'hidden'
    book['Old'].append(('id', 'text'))
    book.save(path)
    assert main(['import', str(path), '-o', str(tmp_path / 'b.yaml')]) == 0
    found = {item.id: item.text for item in read(tmp_path / 'b.yaml').specification.properties}
    assert found == {'1': 'x > 0', 'b': 'y > 0'}
    told = capsys.readouterr().err
    assert "the sheet 'Old' is left out\n   = help: it is hidden" in told and 'Empty' not in told
    assert "the sheet 'Notes' is left out" in told and 'has no column of ids' in told
    assert "two.xlsx, A, row 3 has a formula of the spreadsheet without its value: '=B2'" in told


def test_what_is_no_workbook_is_refused(tmp_path: Path,
                                        monkeypatch: pytest.MonkeyPatch) -> None:
    def message(path: Path) -> str:
        with pytest.raises(CompileError) as caught:
            import_bundles([path], tmp_path / 'a.yaml')
        return str(caught.value)

    (tmp_path / 'text.xlsx').write_text('id,text\nR,x > 0\n')
    assert 'cannot be read as a workbook: File is not a zip file' in message(
        tmp_path / 'text.xlsx')
    good = workbook(tmp_path / 'good.xlsx', A=(('id', 'text'), ('R', 'x > 0')))
    bomb = tmp_path / 'bomb.xlsx'
    with zipfile.ZipFile(good) as source, zipfile.ZipFile(bomb, 'w') as target:
        for part in source.namelist():
            data = source.read(part).decode()
            if part == 'xl/workbook.xml':
                data = '<!DOCTYPE a [<!ENTITY b "' + 'c' * 99 + '">]>' + data
            target.writestr(part, data)
    assert "declares a document type, in 'xl/workbook.xml'" in message(bomb)
    with zipfile.ZipFile(tmp_path / 'empty.xlsx', 'w') as target:
        target.writestr('a.txt', '')
    assert 'cannot be read as a workbook' in message(tmp_path / 'empty.xlsx')
    for name in ('a.ods', 'a.csv', 'a.reqif'):
        (tmp_path / name).write_bytes(good.read_bytes())
        assert "save a workbook as 'Excel workbook (.xlsx)'" in message(tmp_path / name)
    assert 'no sheet with columns' in message(workbook(tmp_path / 'none.xlsx', A=((),)))
    lie, packed = tmp_path / 'lie.xlsx', good.read_bytes()
    with zipfile.ZipFile(good) as source:
        size = source.getinfo('xl/workbook.xml').file_size
    place = packed.index(b'xl/workbook.xml', packed.index(b'PK\1\2')) - 22
    assert packed[place:place + 4] == size.to_bytes(4, 'little')
    lie.write_bytes(packed[:place] + (9).to_bytes(4, 'little') + packed[place + 4:])
    assert 'Bad CRC-32' in message(lie)
    with zipfile.ZipFile(tmp_path / 'bz.xlsx', 'w', zipfile.ZIP_BZIP2) as target:
        target.writestr('xl/workbook.xml', '<a/>')
    assert 'is packed in an unusual way' in message(tmp_path / 'bz.xlsx')
    far = workbook(tmp_path / 'far.xlsx', A=(('id', 'text', *[None] * 50, 'x'),), B=(
        ('id', 'text', *[None] * 50, 'x'),))
    monkeypatch.setattr(workbooks, 'MAX_CELLS', 99)
    assert 'has more than 99 cells' in message(far)
    monkeypatch.setattr(workbooks, 'MAX_CELLS', 3)
    assert 'has more than 3 cells' in message(good)
    cut = tmp_path / 'cut.xlsx'
    cut.write_bytes(good.read_bytes()[:-40])
    assert 'cannot be read as a workbook' in message(cut)


def test_rows_that_repeat_a_requirement_are_one_and_are_reported(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / 'a.csv').write_text('id,text\nR-1,x > 0\nR-2,x > 1\nR-1,x  > 0\nR-1,x > 2\n'
                                    'R.1,x > 3\n')
    target = tmp_path / 'a.yaml'
    assert main(['import', str(tmp_path / 'a.csv'), '-o', str(target)]) == 0
    found = read(target).bundle
    assert found is not None
    assert [(item.id.value, item.text.value, item.source) for item in found.requirements] == [
        ('R-1', 'x > 0', ''), ('R-2', 'x > 1', ''), ('R-1_2', 'x > 2', 'R-1'),
        ('R.1_3', 'x > 3', 'R.1')]
    said = capsys.readouterr().err
    assert "a.csv, row 4: the requirement 'R-1' is that of a.csv, row 2" in said
    reasons = said.split("has the id 'R")[1:]
    assert 'another requirement has this id' in reasons[0]
    assert 'handler names must be unique' in reasons[1]
    out = tmp_path / 'out.csv'
    assert main(['export', str(target), '--to', 'requirements', '-o', str(out)]) == 0
    assert [line.split(',')[0] for line in out.read_text().splitlines()] == [
        'ID', 'R-1', 'R-2', 'R-1', 'R.1']


def test_a_sheet_without_the_named_columns_is_left_out(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = workbook(tmp_path / 'two.xlsx', A=(('Nr', 'Satz'), ('R', 'x > 0')),
                    B=(('No', 'Satz'), ('Q', 'x > 1')), C=(('Nr', 'Satz'),))
    target = tmp_path / 'a.yaml'
    assert main(['import', str(path), '--columns', 'id=Nr,text=Satz', '-o', str(target)]) == 0
    assert [item.id for item in read(target).specification.properties] == ['R']
    told = capsys.readouterr().err
    assert "the sheet 'B' is left out" in told and "has no column 'Nr'" in told
    assert "the sheet 'C' is left out" in told and 'no row below the heads' in told
    with pytest.raises(CompileError, match='has no sheet with columns'):
        import_bundles([path], target, options=ImportOptions({'id': 'Key'}))


def test_each_sentence_is_parsed_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen: list[str] = []

    def counting(text: Text, *, is_timed: bool = False) -> Sentence:
        seen.append(text.value)
        return parse_fretish(text, is_timed=is_timed)

    monkeypatch.setattr(languages, 'parse_fretish', counting)
    sentences = [f'when speed > {k}.0 the rover shall within 2 seconds satisfy armed'
                 for k in range(3)]
    (tmp_path / 'once.csv').write_text('id,text\n' + ''.join(
        f'R-{k},{sentence}\n' for k, sentence in enumerate(sentences)))
    import_bundles([tmp_path / 'once.csv'], tmp_path / 'a.yaml')
    assert seen == sentences


@pytest.mark.parametrize(('text', 'option'), [
    ('Nr,Satz\nR-1,the rover shall always satisfy speed <= 2.0\n', 'id=Nr,fretish=Satz'),
    ('Nr,Satz\nR1,x > 0\n', 'id=Nr,text=Satz'),  # each row could be a topic and its type
    ('Owner;Req ID;Was gilt\nAnn;1;speed <= 2.0\n', "'id=Req ID,text=Was gilt'"),
    ('"a, b",Satz\n1,x > 0\n', 'id=NAME,text=NAME')])
def test_a_table_with_other_heads_is_refused_with_the_option_that_reads_it(
        text: str, option: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / 'a.csv').write_text(text)
    assert main(['import', str(tmp_path / 'a.csv'), '-o', str(tmp_path / 'a.yaml')]) == 1
    told = capsys.readouterr().err
    assert ' has no column of ' in told and told.endswith(f'; write --columns {option}\n')
    if 'NAME' not in option:
        assert main(['import', str(tmp_path / 'a.csv'), '--columns', *shlex.split(option),
                     '-o', str(tmp_path / 'a.yaml')]) == 0
    path = workbook(tmp_path / 'a.xlsx', A=(('Nr', 'Satz'), (1, 'x > 0')))
    with pytest.raises(CompileError) as caught:
        import_bundles([path], tmp_path / 'b.yaml')
    assert str(caught.value.diagnostics[0].help).endswith('write --columns id=Nr,text=Satz')


def test_a_list_of_topics_alone_is_no_table(tmp_path: Path) -> None:
    (tmp_path / 'topics.csv').write_text('speed,/speed\narmed,/armed\n')
    with pytest.raises(CompileError, match='there is no requirement in'):
        import_bundles([tmp_path / 'topics.csv'], tmp_path / 'a.yaml')


def test_rows_behind_many_empty_ones_are_read_and_too_many_are_refused(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = workbook(tmp_path / 'far.xlsx', A=(('id', 'text'), ('R', 'x > 0')))
    book = openpyxl.load_workbook(path)
    book['A']['A500'], book['A']['B500'] = 'FAR', 'x > 1'
    book.save(path)
    monkeypatch.setattr(tables, 'MAX_ROWS', 100)
    found, = import_bundles([path], tmp_path / 'a.yaml')
    assert [item.id for item in found.draft.requirements] == ['R', 'FAR']
    monkeypatch.setattr(tables, 'MAX_ROWS', 1)
    with pytest.raises(CompileError, match='has more than 1 rows'):
        import_bundles([path], tmp_path / 'a.yaml')


def test_a_first_line_may_say_what_separates_cells(tmp_path: Path) -> None:
    data = b'sep=;\r\nID;Requirement;a, b, c\r\nR-1;x > 0;1,5\r\n'
    target, new, trace = imported(tmp_path, data), tmp_path / 'new.csv', tmp_path / 't.csv'
    assert [item.text for item in read(target).specification.properties] == ['x > 0']
    trace.write_text('time,x\n0,1\n')
    assert main(['bag', str(target), str(trace), '--fill', str(tmp_path / 'rover.csv'),
                 str(new)]) == 0
    assert new.read_bytes().startswith(
        b'sep=;\r\nID;Requirement;a, b, c;Verdict;Recording;Occurrences;First violation\r\n'
        b'R-1;x > 0;1,5;satisfied;')


def test_a_very_long_cell_is_a_comment_and_the_others_are_read(tmp_path: Path) -> None:
    long = 'armed & ' * 30_000 + 'armed'
    (tmp_path / 'a.csv').write_text(f'id,text\nR-1,x > 0\nR-2,"{long}"\n')
    found, = import_bundles([tmp_path / 'a.csv'], tmp_path / 'a.yaml')
    assert [item.id for item in found.draft.requirements] == ['R-1']
    assert [(item.id, reason) for item, reason in found.draft.left_out] == [
        ('R-2', 'a text of more than 100,000 characters is no requirement')]
    assert 'ptltl: armed & armed' in found.text.replace('fretish', 'ptltl')
    assert len(found.text) < 20_000


def test_an_enormous_cell_is_not_cut_into_words(tmp_path: Path,
                                                monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(files, 'MAX_BYTES', 2 ** 23)  # so many are reserved to read a file
    (tmp_path / 'a.csv').write_text('id,text\nR-1,x > 0\nR-2,"' + 'ab ' * 2_000_000 + '"\n')
    tracemalloc.start()
    try:
        found, = import_bundles([tmp_path / 'a.csv'], tmp_path / 'a.yaml')
        assert len(found.draft.left_out) == 1 and tracemalloc.get_traced_memory()[1] < 1e8
    finally:
        tracemalloc.stop()


def test_the_wordings_of_a_row_are_told_by_their_columns(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    imported(tmp_path, b'id,fretish,ptltl\nR,the rover shall always satisfy x > 0,H (x > 1)\n')
    told = capsys.readouterr().err
    assert 'rover.csv, row 2, fretish: true' in told and 'rover.csv, row 2, ptltl: false' in told


def test_other_heads_in_utf_16_are_told_too(tmp_path: Path) -> None:
    (tmp_path / 'a.csv').write_text('Nr;Anforderung\nR-1;x > 0\n', encoding='utf-16')
    with pytest.raises(CompileError, match="its columns are 'Nr', 'Anforderung'; write --columns"):
        import_bundles([tmp_path / 'a.csv'], tmp_path / 'a.yaml')


def test_an_id_that_is_changed_for_its_characters_is_told_why(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    imported(tmp_path, b'id,text\nR\a1,x > 0\nR-2,x > 1\nR_2,x > 2\n')
    told = capsys.readouterr().err
    assert "'R\\x071' has the id 'R 1' in the bundle\n   = help: an id is one line" in told
    assert "'R_2' has the id 'R_2_2' in the bundle\n   = help: handler names must be" in told


def test_the_column_of_a_requirement_tool_counts_before_one_that_says_yes(tmp_path: Path) -> None:
    target = imported(tmp_path, b'Object ID,Requirement,Object Text\n'
                      b'S-1,yes,the gripper shall always satisfy force < 20\n')
    assert 'fretish: "the gripper shall always satisfy force < 20"' in target.read_text()


def test_one_word_is_told_as_prose(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target = imported(tmp_path, b'ID,Text\nR-1,TBD\nR-2,(armed)\n')
    said, text = capsys.readouterr().err, target.read_text()
    assert 'warning: one word is no requirement\n   = help: rover.csv, row 2: ' in said
    assert 'a formula of one input is (TBD), or in a column of its language\n' in said
    assert 'left out: R-1 (one word is no requirement)' in text and 'ptltl: "(armed)"' in text
