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

"""ReqIF, as requirement tools exchange it: attributes are columns, chapters are titles."""

from pathlib import Path
import re
import tracemalloc
from xml.etree import ElementTree

from fret_monitor.build import read
from fret_monitor.cli.main import main
from fret_monitor.importing import import_bundles, xml_text
from fret_monitor.importing.reqif_file import reqif_rows
from fret_monitor.importing.reqif_results import filled_reqif
from fret_monitor.model.diagnostics import CompileError
import pytest

DOCUMENT = """<?xml version="1.0" encoding="UTF-8"?>
<REQ-IF xmlns="http://www.omg.org/spec/ReqIF/20110401/reqif.xsd" xmlns:h="http://www.w3.org/1999/xhtml">
  <THE-HEADER><REQ-IF-HEADER IDENTIFIER="header"><TITLE>Rover</TITLE></REQ-IF-HEADER></THE-HEADER>
  <CORE-CONTENT><REQ-IF-CONTENT>
    <DATATYPES>
      <DATATYPE-DEFINITION-STRING IDENTIFIER="string" LONG-NAME="String"/>
      <DATATYPE-DEFINITION-XHTML IDENTIFIER="xhtml" LONG-NAME="XHTML"/>
    </DATATYPES>
    <SPEC-TYPES>
      <SPEC-OBJECT-TYPE IDENTIFIER="kind" LONG-NAME="Requirement"><SPEC-ATTRIBUTES>
        <ATTRIBUTE-DEFINITION-STRING IDENTIFIER="a-id" LONG-NAME="ReqIF.ForeignID"><TYPE>
          <DATATYPE-DEFINITION-STRING-REF>string</DATATYPE-DEFINITION-STRING-REF></TYPE>
        </ATTRIBUTE-DEFINITION-STRING>
        <ATTRIBUTE-DEFINITION-STRING IDENTIFIER="a-name" LONG-NAME="ReqIF.ChapterName"><TYPE>
          <DATATYPE-DEFINITION-STRING-REF>string</DATATYPE-DEFINITION-STRING-REF></TYPE>
        </ATTRIBUTE-DEFINITION-STRING>
        <ATTRIBUTE-DEFINITION-XHTML IDENTIFIER="a-text" LONG-NAME="ReqIF.Text"><TYPE>
          <DATATYPE-DEFINITION-XHTML-REF>xhtml</DATATYPE-DEFINITION-XHTML-REF></TYPE>
        </ATTRIBUTE-DEFINITION-XHTML>
      </SPEC-ATTRIBUTES></SPEC-OBJECT-TYPE>
      <SPECIFICATION-TYPE IDENTIFIER="document" LONG-NAME="Document"/>
    </SPEC-TYPES>
    <SPEC-OBJECTS>%s</SPEC-OBJECTS>
    <SPECIFICATIONS><SPECIFICATION IDENTIFIER="s" LONG-NAME="Rover">
      <TYPE><SPECIFICATION-TYPE-REF>document</SPECIFICATION-TYPE-REF></TYPE>
      <CHILDREN>%s</CHILDREN>
    </SPECIFICATION></SPECIFICATIONS>
  </REQ-IF-CONTENT></CORE-CONTENT>
</REQ-IF>
"""


def requirement(identifier: str, **values: str) -> str:
    written = ''.join(
        f'<ATTRIBUTE-VALUE-XHTML><DEFINITION><ATTRIBUTE-DEFINITION-XHTML-REF>a-{name}'
        '</ATTRIBUTE-DEFINITION-XHTML-REF></DEFINITION><THE-VALUE>' + value +
        '</THE-VALUE></ATTRIBUTE-VALUE-XHTML>' if name == 'text' else
        f'<ATTRIBUTE-VALUE-STRING THE-VALUE="{value}"><DEFINITION>'
        f'<ATTRIBUTE-DEFINITION-STRING-REF>a-{name}</ATTRIBUTE-DEFINITION-STRING-REF></DEFINITION></ATTRIBUTE-VALUE-STRING>'
        for name, value in values.items())
    return (f'<SPEC-OBJECT IDENTIFIER="{identifier}"><TYPE><SPEC-OBJECT-TYPE-REF>kind'
            f'</SPEC-OBJECT-TYPE-REF></TYPE><VALUES>{written}</VALUES></SPEC-OBJECT>')


def place(identifier: str, *children: str) -> str:
    inner = f'<CHILDREN>{"".join(children)}</CHILDREN>' if children else ''
    return (f'<SPEC-HIERARCHY IDENTIFIER="at-{identifier}"><OBJECT><SPEC-OBJECT-REF>{identifier}'
            f'</SPEC-OBJECT-REF></OBJECT>{inner}</SPEC-HIERARCHY>')


ROVER = DOCUMENT % (
    requirement('o-1', name='Safety') + requirement('o-2', name='Speed')
    + requirement('o-3', id='R-1', text='<h:div><h:p>the rover shall <h:b>always</h:b></h:p>'
                                        '<h:p>satisfy speed &lt;= 2.0</h:p></h:div>')
    + requirement('o-4', text='<h:div>H (armed -&gt; speed &lt; 1.0)<!-- ! --></h:div>')
    + requirement('o-5', id='R-3', text='<h:div>The rover is red.</h:div>')
    + requirement('o-6', id='R-4', text='<h:div>speed &gt; 0<h:br/>&amp; armed</h:div>'),
    place('o-1', place('o-2', place('o-3')), place('o-4')) + place('o-5') + place('o-4'))


def test_each_object_is_a_requirement_with_its_chapters_as_title(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / 'rover.reqif').write_text(ROVER, encoding='utf-8')
    assert main(['import', str(tmp_path / 'rover.reqif'), '-o', str(tmp_path / 'r.yaml')]) == 0
    found = {item.id: (item.text, item.title)
             for item in read(tmp_path / 'r.yaml').specification.properties}
    assert found == {'R-1': ('the rover shall always satisfy speed <= 2.0', 'Safety / Speed'),
                     'o-4': ('H (armed -> speed < 1.0)', 'Safety'),
                     'R-4': ('speed > 0 & armed', '')}
    text = (tmp_path / 'r.yaml').read_text(encoding='utf-8')
    assert 'The rover is red.' in text and 'o-1' not in text
    assert 'R-3' in capsys.readouterr().err


def test_what_is_deleted_raised_or_lowered_is_read_as_such(tmp_path: Path) -> None:
    text = ROVER.replace(
        'speed &lt;= 2.0', 'speed &lt;= <h:del>9</h:del><h:ins>2</h:ins>.0').replace(
        'speed &gt; 0', 'v<h:sub>x</h:sub> &gt; 10<h:sup>1</h:sup>')
    (tmp_path / 'rover.reqif').write_text(text, encoding='utf-8')
    assert main(['import', str(tmp_path / 'rover.reqif'), '-o', str(tmp_path / 'r.yaml')]) == 0
    found = {item.id: item.text for item in read(tmp_path / 'r.yaml').specification.properties}
    assert found['R-1'] == 'the rover shall always satisfy speed <= 2.0'
    assert found['R-4'] == 'v_x > 10^1 & armed'


def test_what_tools_keep_for_themselves_is_not_read_nor_filled(tmp_path: Path) -> None:
    path = tmp_path / 'a.reqif'
    kept = ROVER[ROVER.index('<DATATYPES>'):ROVER.index('</REQ-IF-CONTENT>')]
    tools = f'<TOOL-EXTENSIONS><A><TOOL-EXTENSIONS/>{kept}</A></TOOL-EXTENSIONS>'
    rows = {'a.reqif, o-3': ('held',)}
    for head in ('<CORE-CONTENT>', '</REQ-IF>'):
        text = ROVER.replace(head, tools + head)
        assert [*reqif_rows(text, path, 100)] == [*reqif_rows(ROVER, path, 100)]
        filled = filled_reqif(text, path, ('Verdict',), rows)
        assert filled.replace(tools, '') == filled_reqif(ROVER, path, ('Verdict',), rows) != ROVER


@pytest.mark.parametrize(('text', 'message'), [
    (ROVER.replace('<REQ-IF ', '<!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/passwd">]><REQ-IF '),
     'declares a document type'),
    (ROVER[:-20], 'cannot be read as XML: unclosed token: line'),
    (ROVER.replace('<SPEC-OBJECTS>', '<SPEC-OBJECTS>' + 5000 * '<a>' + 5000 * '</a>'), 'too deep'),
    (ROVER.replace('SPEC-OBJECT ', 'O ').replace('SPEC-OBJECT>', 'O>'), 'no row below the heads'),
    (ROVER.replace('"o-6"', '"o-3"'), "2 objects with the identifier 'o-3'"),
    (DOCUMENT % ('<SPEC-OBJECT/>' * 100_001, ''), 'has more than 100,000 objects'),
    (ROVER.replace('ReqIF.Text', 'Remark'), 'no column of requirements')],
    ids=['entity', 'cut', 'deep', 'other tags', 'twice', 'many', 'no text'])
def test_what_is_no_reqif_or_has_no_texts_is_refused(
        text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / 'a.reqif').write_text(text, encoding='utf-8')
    with pytest.raises(CompileError, match=message):
        import_bundles([tmp_path / 'a.reqif'], tmp_path / 'a.yaml')


@pytest.mark.parametrize('encoding', ['utf-8', 'utf-16', 'iso-8859-1', 'windows-1252'])
def test_a_prefix_and_an_encoding_are_those_of_the_file(encoding: str, tmp_path: Path) -> None:
    text = re.sub('<(/?)(?=[A-Z])', r'<\1rq:', ROVER).replace('xmlns=', 'xmlns:rq=').replace(
        'encoding="UTF-8"', f'encoding="{encoding}"').replace('is red', 'is größer')
    path, target, new = tmp_path / 'a.reqif', tmp_path / 'a.yaml', tmp_path / 'new.reqif'
    trace = tmp_path / 't.csv'
    path.write_bytes(text.encode(encoding))
    trace.write_text('time,speed,armed\n0,3,1\n')
    assert main(['import', str(path), '-o', str(target)]) == 0
    assert len(read(target).specification.properties) == 3
    assert 'The rover is größer' in target.read_text(encoding='utf-8')
    assert main(['bag', str(target), str(trace), '--fill', str(path), str(new)]) == 0
    filled = new.read_text(encoding=encoding)
    assert filled.count('THE-VALUE="violated"') == 2 and 'größer' in filled
    assert '<ATTR' not in filled and '<rq:ATTRIBUTE-VALUE-STRING THE-VALUE="violated">' in filled
    again, = import_bundles([new], target)
    assert len(again.draft.requirements) == 3


def test_a_filled_file_is_what_it_was_but_for_what_is_added(tmp_path: Path) -> None:
    text = ROVER
    for old, other in (('<SPEC-ATTRIBUTES>', '<!-- a > b --><SPEC-ATTRIBUTES  >'), ('\n', '\r\n'),
                       ('<TITLE>', '<TITLE kind=\'"x">\'>'), ('"o-3"', " 'o-3' "),
                       ('is red', 'is &#x72;ed <![CDATA[<b>]]>')):
        text = text.replace(old, other)
    path, rows = tmp_path / 'a.reqif', {}
    for identifier in re.findall('IDENTIFIER= ?["\'](o-\\d)', text):
        rows[f'a.reqif, {identifier}'] = ('a & "b"\n\'c\'', 'drive')
    filled = filled_reqif(text, path, ('Verdict', 'By hand'), rows)
    added = (r'<ATTRIBUTE-(DEFINITION|VALUE)-STRING (?:(?!</ATTRIBUTE-\1-STRING>).)*fret-monitor-'
             r'.*?</ATTRIBUTE-\1-STRING>')
    assert re.sub(added, '', filled) == text and filled != text
    assert len(re.findall(added, filled)) == 2 + 2 * len(rows) > 6
    other = filled.replace('THE-VALUE="drive"', "THE-VALUE = 'drive'")
    assert filled_reqif(other, path, ('Verdict', 'By hand'), rows) == other != filled
    root = ElementTree.fromstring(filled)
    values = [item.get('THE-VALUE') for item in root.iter() if item.tag.endswith('VALUE-STRING')]
    assert values.count('a & "b"\n\'c\'') == values.count('drive') == len(rows)
    again = filled_reqif(filled, path, ('Verdict', 'By hand'), dict.fromkeys(rows, ('x', 'drive')))
    assert re.sub(' THE-VALUE="x"', '', again) == re.sub(
        ' THE-VALUE="a &amp; [^"]*"| THE-VALUE=\'a &amp; [^\']*\'', '', filled)


@pytest.mark.parametrize(('old', 'new'), [
    ('<VALUES>', '<OTHER>'), ('<SPEC-ATTRIBUTES>', '<OTHER>'),
    ('<DATATYPE-DEFINITION-STRING IDENTIFIER="string" LONG-NAME="String"/>', ''),
    ('DATATYPES>', 'OTHER>')], ids=['values', 'attributes', 'string', 'types'])
def test_parts_that_a_file_does_not_have_are_added(old: str, new: str, tmp_path: Path) -> None:
    text = ROVER.replace(old, new).replace(old.replace('<', '</'), new.replace('<', '</'))
    if new:
        text = text.replace('<DATATYPE-DEFINITION-STRING IDENTIFIER="string" LONG-NAME="String"/>',
                            '')
    filled = filled_reqif(text, tmp_path / 'a.reqif', ('Verdict',), {'a.reqif, o-3': ('held',)})
    root = ElementTree.fromstring(filled)
    names = [item.tag.rpartition('}')[2] for item in root.iter()]
    assert names.count('DATATYPE-DEFINITION-STRING') == 1
    assert [item.get('IDENTIFIER') for item in root.findall('.//{*}SPEC-OBJECT')
            if item.find("{*}VALUES/{*}ATTRIBUTE-VALUE-STRING[@THE-VALUE='held']") is not None
            ] == ['o-3']
    assert root.find('.//{*}SPEC-OBJECT-TYPE/{*}SPEC-ATTRIBUTES/{*}ATTRIBUTE-DEFINITION-STRING'
                     "[@LONG-NAME='Verdict']") is not None
    assert names.index('DATATYPES') < names.index('SPEC-TYPES')


@pytest.mark.parametrize(('id_', 'text'), [
    ('Object ID', 'ReqIF.Description'), ('requirement_ID', 'Object Text')])
def test_attributes_that_tools_write_are_found(id_: str, text: str, tmp_path: Path) -> None:
    (tmp_path / 'a.reqif').write_text(ROVER.replace('"ReqIF.ForeignID"', f'"{id_}"').replace(
        '"ReqIF.Text"', f'"{text}"'))
    found, = import_bundles([tmp_path / 'a.reqif'], tmp_path / 'a.yaml')
    assert [item.id for item in found.draft.requirements] == ['R-1', 'o-4', 'R-4']


def test_attributes_that_are_not_found_are_named_without_those_of_every_file(
        tmp_path: Path) -> None:
    (tmp_path / 'a.reqif').write_text(ROVER.replace('"ReqIF.Text"', '"Remark"').replace(
        '"ReqIF.ForeignID"', '"Nr"'))
    with pytest.raises(CompileError, match='write --columns id=Nr,fretish=Remark'):
        import_bundles([tmp_path / 'a.reqif'], tmp_path / 'a.yaml')


def test_empty_tags_are_opened(tmp_path: Path) -> None:
    text = re.sub('<VALUES>.*?</VALUES>', '<VALUES />', ROVER)
    text = re.sub('(?s)<DATATYPES>.*</DATATYPES>', '<DATATYPES/>', text)
    filled = filled_reqif(text, tmp_path / 'a.reqif', ('Verdict',), {'a.reqif, o-3': ('held',)})
    root = ElementTree.fromstring(filled)
    assert root.find('.//{*}SPEC-OBJECT[@IDENTIFIER="o-3"]/{*}VALUES/{*}ATTRIBUTE-VALUE-STRING'
                     ) is not None
    assert root.find('.//{*}DATATYPES/{*}DATATYPE-DEFINITION-STRING') is not None
    assert filled.count('<VALUES />') == text.count('<VALUES />') - 1 > 1


def test_a_large_file_is_never_a_tree(tmp_path: Path) -> None:
    text = DOCUMENT % (''.join(requirement(f'o-{number}', id=f'R-{number}', text='x &lt; 1')
                               for number in range(2000)), '')
    path = tmp_path / 'a.reqif'
    rows = {f'a.reqif, o-{number}': ('held',) for number in range(2000)}
    read, filled = (lambda: [0 for _ in reqif_rows(text, path, 5000)],
                    lambda: filled_reqif(text, path, ('Verdict',), rows))
    for work, most in ((read, 3), (filled, 8)):  # of a tree it is 6 and 12
        tracemalloc.start()
        work()
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert peak < most * len(text)


def test_more_tags_than_tools_write_are_refused(tmp_path: Path,
                                                monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / 'a.reqif'
    path.write_text(ROVER)
    for name, limit in (('_MOST_TAGS', 100), ('MAX_XML', 1000)):
        with monkeypatch.context() as patch, pytest.raises(CompileError, match='more than'):
            patch.setattr(xml_text, name, limit)
            import_bundles([path], tmp_path / 'a.yaml')
