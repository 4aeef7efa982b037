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

"""XML with XPaths, in a format of our own or of Ogma, and archives of ReqIF."""

from pathlib import Path
import tracemalloc
import zipfile

from fret_monitor.build import read
from fret_monitor.cli.main import main
from fret_monitor.importing import archive as zip_archive, files, import_bundles, Imported, xpath
from fret_monitor.importing.files import ImportOptions
from fret_monitor.importing.xml_format import read_format
from fret_monitor.importing.xml_text import parsed_xml
from fret_monitor.importing.xpath import parse_path, text_of, Tree
from fret_monitor.model.diagnostics import CompileError, Source, Text
from importing.test_reqif import DOCUMENT, requirement
import pytest

FILE = """<?xml version="1.0"?>
<project xmlns="http://example.org/p" xmlns:h="http://www.w3.org/1999/xhtml">
  <part name="a"><req key="R-1" kind="formal"><title>Slow</title>
    <body><h:p>the rover shall always</h:p><h:p>satisfy speed &lt;= 2.0</h:p></body></req></part>
  <part name="b">
    <req key="R-2" kind="formal"><body>H (armed -&gt; speed &lt; limit)</body></req>
    <req key="R-3" kind="note"><body>The rover is red.</body></req>
  </part>
  <variable name="speed" type="float32"/>
  <variable name="armed" type="bool"/>
  <value name="limit">3.0</value>
</project>
"""
FORM = """
requirements: //req[@kind = 'formal']
id: "@key"
text: body
title: title
component: "@owner"
inputs: //variable
input_name: "@name"
input_type: "@type"
definitions: //value
definition_name: "@name"
definition_text: .
"""


def imported(folder: Path, form: str, text: str = FILE, name: str = 'form.yaml') -> Imported:
    (folder / 'file.xml').write_text(text, encoding='utf-8')
    (folder / name).write_text(form, encoding='utf-8')
    return import_bundles([folder / 'file.xml'], folder / 'a.yaml', options=ImportOptions(
        xml=read_format(folder / name)))[0]


def test_xpaths_find_requirements_inputs_and_definitions(tmp_path: Path) -> None:
    (tmp_path / 'file.xml').write_text(FILE, encoding='utf-8')
    (tmp_path / 'form.yaml').write_text(FORM, encoding='utf-8')
    target = tmp_path / 'rover.yaml'
    assert main(['import', str(tmp_path / 'file.xml'), '--format', str(tmp_path / 'form.yaml'),
                 '-o', str(target)]) == 0
    specification = read(target).specification
    assert {item.id: (item.text, item.title) for item in specification.properties} == {
        'R-1': ('the rover shall always satisfy speed <= 2.0', 'Slow'),
        'R-2': ('H (armed -> speed < limit)', '')}
    assert [(item.name, item.type.value) for item in specification.signals] == [
        ('speed', 'float32'), ('armed', 'bool')]
    assert 'limit: 3.0' in target.read_text(encoding='utf-8')


TREE = parsed_xml('<a i="0"><b i="1">x<c/>y</b><b i="2"><c i="3">z</c><b i="4"/></b></a>',
                  Path('t'))


@pytest.mark.parametrize(('path', 'texts'), [
    ('/a', ['xyz']), ('/b', []), ('b', ['xy', 'z']), ('//b', ['xy', 'z', '']),
    ('b/@i', ['1', '2']), ('//@i', ['0', '1', '2', '3', '4']), ('b[2]', ['z']),
    ('b[last()]/c/text()', ['z']), ('//c[text() = "z"]/../@i', ['2']), ('*/*', ['', 'z', '']),
    ('b[c]/@i', ['1', '2']), ('b[c/@i]/@i/text()', ['2']), ('.//c[contains(., "z")]', ['z']),
    ('b[not(@i = 1)]/@i', ['2']), ("b[starts-with(@i, '1') or b]/@i", ['1', '2']),
    ('b[@i != "1" and c]/@i', ['2']), ('b[position() = 1]/text()', ['x', 'y']),
    ('//h:c', ['', 'z']), ('b[normalize-space(c) = "z"]/@*', ['2']), ('/..', []),
    ('b/.', ['xy', 'z']), ('//b//b/../@i', ['2'])])
def test_a_path_finds_what_xpath_says(path: str, texts: list[str]) -> None:
    found = Tree(TREE).find(parse_path(Text.whole(Source('p', path))))
    assert [text_of(node) for node in found] == texts


@pytest.mark.parametrize(('path', 'column'), [
    ('//req[', 7), ('a//', 4), ('a/child::b', 8), ('a | b', 3), ('id("x")', 3), ('a[b', 4),
    ('a]', 2), ('contains(a)', 9), ('$x', 1), ('a[contains(b)]', 13), ('(' * 5, 1)])
def test_a_path_that_is_none_is_refused_with_its_place(path: str, column: int) -> None:
    with pytest.raises(CompileError) as caught:
        parse_path(Text.whole(Source('p', path)))
    span = caught.value.diagnostics[0].span
    assert span is not None and span.column == min(column, len(path))


def test_nested_and_costly_paths_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(xpath, '_VISITS', 10 ** 5)
    with pytest.raises(CompileError, match='too long'):
        parse_path(Text.whole(Source('p', 'a[' * 5000 + 'b' + ']' * 5000)))
    deep = parsed_xml('<a>' * 2000 + '</a>' * 2000, Path('t'))
    with pytest.raises(CompileError, match='visit too many elements'):
        Tree(deep).find(parse_path(Text.whole(Source('p', '//*//*'))))


@pytest.mark.parametrize('path', ['//*[//*[//*[//*[//*[//*]]]]]', '//*' * 40,
                                  '//*[//*[contains(., "x")]]'])
def test_paths_in_paths_and_texts_are_costly_too(path: str,
                                                 monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(xpath, '_VISITS', 10 ** 5)
    deep = parsed_xml('<a>' * 200 + 'y' * 30_000 + '</a>' * 200, Path('t'))
    with pytest.raises(CompileError, match='visit too many elements'):
        Tree(deep).find(parse_path(Text.whole(Source('p', path))))


def test_the_paths_of_all_requirements_count_together(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(xpath, '_VISITS', 2000)
    path, form = tmp_path / 'a.xml', tmp_path / 'form.yaml'
    path.write_text('<a>' + ''.join(f'<r id="{k}"><t>x</t></r>' for k in range(50)) + '</a>')
    form.write_text('requirements: //r\nid: "@id"\ntext: ' + '"' + '*/../' * 45 + 't"')
    with pytest.raises(CompileError, match='visit too many elements'):
        import_bundles([path], tmp_path / 'a.yaml', options=ImportOptions(xml=read_format(form)))


OGMA = r"""
XMLFormat
    { specInternalVars          = Nothing
    , specInternalVarId         = ("//*", Nothing)
    , specInternalVarExpr       = ("//*", Nothing)
    , specInternalVarType       = Nothing
    , specExternalVars          = Nothing
    , specExternalVarId         = ("//*", Nothing)
    , specExternalVarType       = Nothing
    , specRequirements          = ("//SPEC-OBJECT/TYPE/@1[contains(text(),\"KEY\")]/../..",
        Just ("KEY", "//SPEC-OBJECT-TYPE[contains(@LONG-NAME, \"Requirement\")]/@2"))
    , specRequirementId         = ("//SPEC-OBJECT/@2", Nothing)
    , specRequirementDesc       = Nothing
    , specRequirementExpr       = (
        "//ATTRIBUTE-VALUE-XHTML/DEFINITION/@3-REF[contains(text(),'KEY')]/../../THE-VALUE/div/*",
        Just ("KEY", "//@3[contains(@LONG-NAME, \"ReqIF.Text\")]/@2"))
    , specRequirementResultType = Nothing
    , specRequirementResultExpr = Nothing
    }
""".replace('@1', 'SPEC-OBJECT-TYPE-REF').replace('@2', '@IDENTIFIER/text()').replace(
    '@3', 'ATTRIBUTE-DEFINITION-XHTML')
REQIF = DOCUMENT % (requirement('o-1', id='R-1', text='<h:div><h:p>H (a -&gt; b)</h:p></h:div>')
                    + requirement('o-2', id='R-2', text='<h:div><h:p>x &lt; 2</h:p></h:div>'), '')


def test_a_format_of_ogma_finds_what_ogma_does(tmp_path: Path) -> None:
    found = imported(tmp_path, OGMA, REQIF, 'xml-reqif_smv')
    assert {item.id: item.text for item in found.draft.requirements} == {
        'o-1': 'H (a -> b)', 'o-2': 'x < 2'}


@pytest.mark.parametrize(('form', 'message'), [
    ('', 'empty'), ('- a', 'must be a mapping'), ('requirements: a\nidd: b', "no key 'idd'"),
    ('id: a\ntext: b', "no path to 'requirements'"), ('requirements: a\ntext: b', "to 'id'"),
    ('requirements: a\nid: b', 'the texts'), ('requirements: a[\nid: b\ntext: c', 'cannot be'),
    ('JSONFormat { }', 'a format for JSON'), ('XMLFormat', 'format of Ogma'),
    ('XMLFormat { specRequirements = 3 }', 'format of Ogma'),
    (OGMA.replace('ResultType = Nothing', 'ResultType = Just ("//a", Nothing)'), 'is not read'),
    (OGMA.replace('@LONG-NAME, \\"Requirement', '@LONG-NAME, \\"None'), 'has nothing at this'),
    ('requirements: //none\nid: a\ntext: b', 'no requirement at this path')])
def test_a_format_that_is_wrong_is_refused(form: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(CompileError, match=message):
        imported(tmp_path, form, REQIF)


@pytest.mark.parametrize('text', [
    '<!DOCTYPE a [<!ENTITY b "cc"><!ENTITY d "&b;&b;">]><a><req key="&d;"/></a>',
    '<?xml version="1.0"?>\n<!DOCTYPE a SYSTEM "file:///etc/passwd"><a/>',
    '<!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/passwd">]><a><req key="R">&b;</req></a>'])
def test_entities_are_refused_before_anything_is_parsed(text: str, tmp_path: Path) -> None:
    with pytest.raises(CompileError, match='declares a document type'):
        imported(tmp_path, FORM, text)


@pytest.mark.parametrize(('text', 'message'), [
    ('<a>', 'cannot be read as XML: no element found'),
    ('<a>&b;</a>', 'undefined entity'), ('<a' + '<b>' * 9, 'not well-formed'),
    ('<a>' * 20_000 + '</a>' * 20_000, 'no requirement at this path')])
def test_broken_xml_is_refused(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(CompileError, match=message):
        imported(tmp_path, FORM, text)


def test_xml_without_a_format_is_refused_with_the_option(tmp_path: Path) -> None:
    (tmp_path / 'file.xml').write_text(FILE, encoding='utf-8')
    with pytest.raises(CompileError, match='--format FORMAT names'):
        import_bundles([tmp_path / 'file.xml'], tmp_path / 'a.yaml')


def test_a_format_without_xml_is_refused(tmp_path: Path) -> None:
    (tmp_path / 'form.yaml').write_text(FORM, encoding='utf-8')
    (tmp_path / 'a.csv').write_text('id,text\nR,x > 0\n')
    with pytest.raises(CompileError, match='no file is XML'):
        import_bundles([tmp_path / 'a.csv'], tmp_path / 'a.yaml', options=ImportOptions(
            xml=read_format(tmp_path / 'form.yaml')))


def archive(path: Path, **files: str) -> Path:
    with zipfile.ZipFile(path, 'w', zipfile.ZIP_DEFLATED) as file:
        for name, text in files.items():
            file.writestr(name.replace('_', '.'), text)
    return path


def test_the_files_of_an_archive_are_read(tmp_path: Path) -> None:
    other = DOCUMENT % (requirement('o-3', id='R-3', text='y &lt; 2'), '')
    path = archive(tmp_path / 'all.reqifz', a_reqif=REQIF, b_reqif=other, picture_png='no text')
    found, = import_bundles([path], tmp_path / 'a.yaml')
    assert [item.id for item in found.draft.requirements] == ['R-1', 'R-2', 'R-3']


def test_an_archive_that_is_none_or_too_large_is_refused(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / 'text.reqifz').write_text('PK')
    bomb = archive(tmp_path / 'bomb.reqifz', a_reqif=' ' * 2 ** 22)
    assert bomb.stat().st_size < 2 ** 14
    monkeypatch.setattr(files, 'MAX_XML', 2 ** 21)
    cases = [(tmp_path / 'text.reqifz', 'ZIP archive'), (bomb, 'unpacks to more than 2 MiB'),
             (archive(tmp_path / 'empty.reqifz', a_txt=''), 'no file that ends in .reqif'),
             (archive(tmp_path / 'bin.reqifz', a_reqif='no ReqIF'), 'cannot be read as XML')]
    for path, message in cases:
        with pytest.raises(CompileError, match=message):
            import_bundles([path], tmp_path / 'a.yaml')
    monkeypatch.setattr(zip_archive, '_MOST_PARTS', 1)
    with pytest.raises(CompileError, match='more than 1 files'):
        import_bundles([archive(tmp_path / 'two.reqifz', a_reqif=REQIF, b_reqif=REQIF)],
                       tmp_path / 'a.yaml')


def test_a_file_whose_requirements_are_empty_is_named(tmp_path: Path) -> None:
    path, form = tmp_path / 'a.xml', tmp_path / 'form.yaml'
    path.write_text('<a><r id="1"><t/></r></a>')
    form.write_text('requirements: //r\nid: "@id"\ntext: t\n')
    with pytest.raises(CompileError, match=r"no requirement of 'a\.xml' has a formula"):
        import_bundles([path], tmp_path / 'a.yaml', options=ImportOptions(xml=read_format(form)))


def test_a_small_archive_takes_little_memory_whatever_it_says(tmp_path: Path) -> None:
    path = archive(tmp_path / 'lie.reqifz', a_reqif=' ' * 2 ** 25)
    data = path.read_bytes()
    size = (2 ** 25).to_bytes(4, 'little')
    path.write_bytes(data.replace(size, (1000).to_bytes(4, 'little')))
    tracemalloc.start()
    try:
        with pytest.raises(CompileError, match='Bad CRC-32'):
            import_bundles([path], tmp_path / 'a.yaml')
        assert tracemalloc.get_traced_memory()[1] < 2 ** 23
    finally:
        tracemalloc.stop()
