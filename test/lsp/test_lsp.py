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

"""The language server, driven over its pipes as an editor does."""

from collections.abc import Iterator
import json
from pathlib import Path
import re
import signal
from typing import Any

from fret_monitor.elaboration.functions import FUNCTIONS
from fret_monitor.language.fretish_words import WORDS
from lsp.client import at, Client, editor, place_of, Refused, started, WAIT_S
import pytest
from strategies import some, thorough

pytest.importorskip('pygls')

URI = 'file:///somewhere/a%20bundle.yaml'
DOCUMENT = {'uri': URI}
BUNDLE = """\
format: 1
inputs:
  speed: {topic: odom, type: nav_msgs/msg/Odometry, field: twist.twist.linear.x}
definitions:
  fast: speed > 1.5
requirements:
  - id: SLOW
    fretish: "the base shall always satisfy !fast"   # slow
  - id: STILL
    ptltl: "H[0,3] (speed <= 0.0)"
"""


@pytest.fixture(scope='module')
def server() -> Iterator[Client]:
    with editor() as client:
        yield client


@pytest.fixture
def client(server: Client) -> Iterator[Client]:
    """Return a client without open files."""
    server.others.clear()
    yield server
    server.notify('textDocument/didClose', textDocument=DOCUMENT)
    assert server.diagnostics(URI, None) == []
    assert server.others == []  # no messages about errors of the server


def start_and_end(place: dict[str, Any]) -> tuple[int, int, int, int]:
    return (place['start']['line'], place['start']['character'],
            place['end']['line'], place['end']['character'])


def with_edits(text: str, edits: list[dict[str, Any]]) -> str:
    """Return a text of ASCII alone with the edits of an answer."""
    starts = [0, *(place + 1 for place, char in enumerate(text) if char == '\n')]
    for edit in sorted(edits, key=lambda item: start_and_end(item['range']), reverse=True):
        line, column, last, end = start_and_end(edit['range'])
        text = text[:starts[line] + column] + edit['newText'] + text[starts[last] + end:]
    return text


# -- diagnostics ---------------------------------------------------------------------------------

def test_a_bundle_without_mistakes_has_no_diagnostics(client: Client) -> None:
    client.open(URI, BUNDLE)
    assert client.diagnostics(URI, 1) == []


def test_a_diagnostic_has_its_range_severity_code_and_related_place(client: Client) -> None:
    client.open(URI, BUNDLE.replace('STILL', 'SLOW'))
    found, = client.diagnostics(URI, 1)
    assert start_and_end(found['range']) == (8, 8, 8, 12)
    assert (found['severity'], found['code'], found['source']) == (
        1, 'the-id-is-given-twice', 'fret-monitor')
    related, = found['relatedInformation']
    assert start_and_end(related['location']['range']) == (6, 8, 6, 12)
    assert related['location']['uri'] == URI


def test_a_warning_is_one(client: Client) -> None:
    client.open(URI, BUNDLE.replace('always', 'eventually'))
    assert [item['severity'] for item in client.diagnostics(URI, 1)] == [2]


@pytest.mark.parametrize(('encodings', 'encoding', 'size'), [
    (None, 'utf-16-le', 2), (['utf-8', 'utf-16'], 'utf-8', 1),
    pytest.param(['utf-32'], 'utf-32-le', 4, marks=thorough)])
def test_places_count_in_the_units_that_the_editor_has_chosen(
        encodings: list[str] | None, encoding: str, size: int) -> None:
    text = f'{BUNDLE}  - {{id: A, title: "\U0001d11e \u00e4", ptltl: sped > 1}}\n'
    before = text.splitlines()[10].partition('sped')[0]
    column = len(before.encode(encoding)) // size
    general = {'positionEncodings': encodings} if encodings else {}
    with editor(general=general) as client:
        client.open(URI, text)
        found, = client.diagnostics(URI, 1)
        assert start_and_end(found['range']) == (10, column, 10, column + 4)
        client.replace(URI, 2, (found['range'], 'speed'))
        assert client.diagnostics(URI, 2) == []


def test_changes_of_ranges_are_those_of_the_editor(client: Client) -> None:
    text = 'title: "\u2028 \x85 \U0001f600"\r\n' + BUNDLE.replace('\n', '\r\n')
    client.open(URI, text)
    assert client.diagnostics(URI, 1) == []
    client.replace(URI, 2, ({'start': at(5, 8), 'end': at(5, 13)}, 'spe'),
                   ({'start': at(5, 11), 'end': at(5, 11)}, 'edy'),
                   ({'start': at(9, 0), 'end': at(99, 0)}, ''))
    found = client.diagnostics(URI, 2)
    assert [start_and_end(item['range'])[:2] for item in found] == [(5, 8)]
    assert found[0]['message'].startswith("'speedy' is not declared")


def test_another_file_of_yaml_is_left_alone(client: Client) -> None:
    client.open(URI, 'services:\n  web: {image: "x"\n')
    assert client.diagnostics(URI, 1) == []
    for method in ('hover', 'completion', 'definition'):
        assert client.ask(f'textDocument/{method}', textDocument=DOCUMENT,
                          position=at(0, 3)) is None


def test_a_signals_file_that_is_open_counts_as_it_is_there(client: Client,
                                                           tmp_path: Path) -> None:
    bundle, signals = (tmp_path / name for name in ('b.yaml', 'signals.yaml'))
    signals.write_text('inputs: {}\n', encoding='utf-8')
    client.open(bundle.as_uri(), 'format: 1\nsignals: signals.yaml\nrequirements:\n'
                                 '  - {id: A, ptltl: x}\n')
    found, = client.diagnostics(bundle.as_uri(), 1)
    assert found['message'].startswith("'x' is not declared")
    client.open(signals.as_uri(), 'inputs: {x: {type: bool}}\n')
    assert client.diagnostics(signals.as_uri(), 1) == []
    assert client.diagnostics(bundle.as_uri(), 1) == []
    for uri in (signals.as_uri(), bundle.as_uri()):
        client.notify('textDocument/didClose', textDocument={'uri': uri})


def test_no_compiler_is_started(tmp_path: Path) -> None:
    for name in ('cc', 'gcc', 'clang', 'tcc'):
        program = tmp_path / name
        program.write_text(f'#!/bin/sh\n/bin/touch {tmp_path}/started\n', encoding='utf-8')
        program.chmod(0o755)
    gates = ('gates:\n  drive: {from: raw, to: odom2, type: nav_msgs/msg/Odometry, '
             'keep: [SLOW]}\n')
    text = BUNDLE.replace('topic: odom', 'topic: raw').replace('requirements:', gates +
                                                               'requirements:')
    with editor(path=str(tmp_path)) as client:
        client.open(URI, text)
        assert [item for item in client.diagnostics(URI, 1) if item['severity'] == 1] == []
        client.ask('textDocument/hover', textDocument=DOCUMENT, position=place_of(text, 'SLOW\n'))
    assert not (tmp_path / 'started').exists()


# -- answers -------------------------------------------------------------------------------------

def test_hovering_tells_what_an_input_is(client: Client) -> None:
    client.open(URI, BUNDLE)
    found = client.ask('textDocument/hover', textDocument=DOCUMENT,
                       position=place_of(BUNDLE, 'speed <='))
    assert found['contents']['value'].startswith('`speed`: input, float64\n\ntopic `odom`')
    assert client.ask('textDocument/hover', textDocument=DOCUMENT,
                      position=place_of(BUNDLE, '# slow')) is None


def test_completion_replaces_the_word(client: Client) -> None:
    text = BUNDLE.replace('satisfy !fast', 'satisfy !fa')
    client.open(URI, text)
    found = client.ask('textDocument/completion', textDocument=DOCUMENT,
                       position={**place_of(text, '!fa'), 'character': text.splitlines()[7].index(
                           '!fa') + 3})
    item = next(each for each in found['items'] if each['label'] == 'fast')
    assert item['detail'] == 'speed > 1.5'
    assert with_edits(text, [item['textEdit']]) == BUNDLE


def test_a_name_leads_to_its_declaration_and_uses(client: Client) -> None:
    client.open(URI, BUNDLE)
    place = {'textDocument': DOCUMENT, 'position': place_of(BUNDLE, 'speed <=')}
    declared = client.ask('textDocument/definition', **place)
    assert [(item['uri'], start_and_end(item['range'])) for item in declared] == [
        (URI, (2, 2, 2, 7))]
    for is_whole, lines in ((True, [2, 4, 9]), (False, [4, 9])):
        found = client.ask('textDocument/references', **place,
                           context={'includeDeclaration': is_whole})
        assert [item['range']['start']['line'] for item in found] == lines


def test_an_input_is_renamed_everywhere_or_the_reason_is_given(client: Client) -> None:
    client.open(URI, BUNDLE)
    place = {'textDocument': DOCUMENT, 'position': place_of(BUNDLE, 'speed <=')}
    assert start_and_end(client.ask('textDocument/prepareRename', **place)) == (9, 20, 9, 25)
    found = client.ask('textDocument/rename', **place, newName='v')
    assert with_edits(BUNDLE, found['changes'][URI]) == BUNDLE.replace('speed', 'v')
    with pytest.raises(Refused, match="'speed' cannot be named 'fast'"):
        client.ask('textDocument/rename', **place, newName='fast')


def test_a_refused_rename_is_no_error_of_the_server(
    capfd: pytest.CaptureFixture[str],
) -> None:
    with editor() as client:
        client.open(URI, BUNDLE)
        with pytest.raises(Refused):
            client.ask('textDocument/rename', textDocument=DOCUMENT, newName='fast',
                       position=place_of(BUNDLE, 'speed <='))
    assert capfd.readouterr().err == ''


def test_a_line_to_write_is_a_quick_fix(client: Client) -> None:
    text = BUNDLE.replace('!fast', '!fasst')
    client.open(URI, text)
    found, = client.diagnostics(URI, 1)
    action, = client.ask('textDocument/codeAction', textDocument=DOCUMENT, range=found['range'],
                         context={'diagnostics': [found]})
    assert (action['title'], action['kind']) == ('write fast', 'quickfix')
    assert with_edits(text, action['edit']['changes'][URI]) == BUNDLE


def test_lines_fold_and_are_indented(client: Client) -> None:
    text = BUNDLE.replace('\n  ', '\n    ')
    client.open(URI, text)
    folds = client.ask('textDocument/foldingRange', textDocument=DOCUMENT)
    assert {(item['startLine'], item['endLine']) for item in folds} >= {(1, 2), (5, 9), (6, 7)}
    edits = client.ask('textDocument/formatting', textDocument=DOCUMENT,
                       options={'tabSize': 2, 'insertSpaces': True})
    assert with_edits(text, edits) == BUNDLE


# -- while somebody types ------------------------------------------------------------------------

def test_a_bundle_typed_letter_by_letter_has_an_answer_to_each(client: Client) -> None:
    client.open(URI, '')
    line = column = 0
    for number, char in enumerate(BUNDLE):
        client.replace(URI, number + 2, ({'start': at(line, column), 'end': at(line, column)},
                                         char))
        line, column = (line + 1, 0) if char == '\n' else (line, column + 1)
        found = client.ask('textDocument/completion', textDocument=DOCUMENT,
                           position=at(line, column))
        assert found is None or not found['isIncomplete']
        if number % 20 == 0:
            for method in ('hover', 'definition'):
                client.ask(f'textDocument/{method}', textDocument=DOCUMENT,
                           position=at(line, max(0, column - 1)))
    assert client.diagnostics(URI, len(BUNDLE) + 1) == []


def test_only_the_last_of_many_changes_decides(client: Client) -> None:
    client.open(URI, BUNDLE)
    for version in range(2, 60):
        client.replace(URI, version, (None, BUNDLE.replace('fast:', f'fast{version}:')))
    assert [item['message'].partition('\n')[0] for item in client.diagnostics(URI, 59)] == [
        "'fast' is not declared"]


def test_a_request_can_be_cancelled(client: Client) -> None:
    client.open(URI, BUNDLE)
    number = client.begin('textDocument/hover', textDocument=DOCUMENT, position=at(2, 3))
    client.notify('$/cancelRequest', id=number)
    try:
        assert client.answer(number)['contents']['kind'] == 'markdown'
    except Refused as refused:
        assert refused.args[0] == -32800
    assert client.ask('textDocument/foldingRange', textDocument=DOCUMENT)


def test_a_text_that_has_changed_is_not_checked() -> None:
    from fret_monitor.lsp.open_files import OpenFile, OpenFiles
    from fret_monitor.lsp.server import BundleServer
    files, file = OpenFiles(), OpenFile(URI, Path('b.yaml'), 1, BUNDLE)
    files.put(file)
    served = BundleServer(files)
    assert served.read(file, files.generation, files.reader()) is not None
    assert served.read(file, files.generation - 1, files.reader()) is None


# -- the process ---------------------------------------------------------------------------------

@pytest.mark.parametrize('number', some([signal.SIGTERM, signal.SIGINT]))
def test_a_signal_ends_it(number: signal.Signals) -> None:
    with started() as client:
        client.process.send_signal(number)
        assert client.process.wait(timeout=WAIT_S) == -number


def test_it_ends_with_its_editor() -> None:
    with started() as client:
        assert client.process.stdin is not None
        client.process.stdin.close()
        assert client.process.wait(timeout=WAIT_S) == 1  # without a word


def test_without_its_package_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch,
                                                     capsys: pytest.CaptureFixture[str]) -> None:
    from fret_monitor.cli.main import main
    monkeypatch.setattr('fret_monitor.model.diagnostics.find_spec', lambda name: None)
    assert main(['lsp']) == 1
    said = capsys.readouterr().err
    assert '`lsp` needs pygls, which is not installed' in said
    assert 'pip install' in said


def test_the_extension_of_vs_code_names_files_that_exist() -> None:
    folder = Path(__file__).resolve().parents[2] / 'editors' / 'vscode'
    if not folder.is_dir():
        pytest.skip('needs the source tree')
    package = json.loads((folder / 'package.json').read_text(encoding='utf-8'))
    contributed = package['contributes']
    named = [package['main'], *(item['path'] for item in contributed['grammars']),
             *(item['configuration'] for item in contributed.get('languages', [])
               if 'configuration' in item)]
    assert [name for name in named if not (folder / name).is_file()] == []


def test_the_colours_of_vs_code_know_all_words_and_functions() -> None:
    folder = Path(__file__).resolve().parents[2] / 'editors' / 'vscode'
    grammar = folder / 'syntaxes' / 'fretish.tmLanguage.json'
    if not grammar.is_file():
        pytest.skip('needs the source tree')
    found = {item['name']: item['match'] for part in json.loads(grammar.read_text(
        encoding='utf-8'))['repository'].values() for item in part['patterns'] if 'name' in item}
    words = re.search(r'\(\?i:(.*)\)', found['keyword.control.fretish'])
    functions = re.search(r'\(\?:(.*)\)\\b', found['support.function.fretish'])
    assert words is not None and functions is not None
    assert {*words[1].split('|'), 'true', 'false'} == set(WORDS)
    assert set(functions[1].split('|')) == set(FUNCTIONS)
