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


"""Specifications of R2U2's compiler C2PO become requirements under `mltl`."""

from pathlib import Path

from fret_monitor.build import read
from fret_monitor.bundle.bundle import Language
from fret_monitor.cli.main import main
from fret_monitor.importing import import_bundles
from fret_monitor.importing.component import Wording
from fret_monitor.importing.parsed_wording import parse_wording, rename
from fret_monitor.logic.evaluate import evaluate
from fret_monitor.model.diagnostics import Source, Text
import pytest

SPECIFICATION = """
-- an arbiter
INPUT
    request, grant: bool;
    rate: float; -- of requests
DEFINE
    fast = rate > 5.5 && request;
FTSPEC
    answered: request -> F[0,5] grant;
    (request U[0,2] grant)
      || !request;
    contract: request => grant;
    endless: G grant;
PTSPEC
    H[0,5] grant -> O fast;
"""


def written(folder: Path, text: str = SPECIFICATION) -> Path:
    path = folder / 'arbiter.c2po'
    path.write_text(text, encoding='utf-8')
    return path


def test_a_specification_becomes_a_bundle(tmp_path: Path) -> None:
    target = tmp_path / 'arbiter.yaml'
    assert main(['import', str(written(tmp_path)), '-o', str(target)]) == 0
    specification = read(target).specification
    assert {item.id: (item.text, item.horizon) for item in specification.properties} == {
        'answered': ('request -> F[0,5] grant', 5),
        'FT2': ('(request U[0,2] grant) || !request', 2),
        'contract': ('request => grant', 0),
        'PT5': ('H[0,5] grant -> O fast', 0)}
    assert [(item.name, item.type.value) for item in specification.signals] == [
        ('request', 'bool'), ('grant', 'bool'), ('rate', 'float32')]
    text = target.read_text(encoding='utf-8')
    assert '# left out' in text or '#  left out' in text


def test_what_is_left_out_is_a_comment_and_nothing_reads_it(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = ('INPUT a, b, c: bool;\nDEFINE\n  chain = a -> b -> c;\n  more = chain && a;\nFTSPEC\n'
            '  eq: G[0,1] a == b;\n  lab: eq && c;\n  def: more || b;\n  kept: a;\n'
            '  a -> F[0,2] c;\n')
    target = tmp_path / 'a.yaml'
    assert main(['import', str(written(tmp_path, text)), '-o', str(target)]) == 0
    said = capsys.readouterr()
    assert '2 requirements (3 left out), 2 inputs' in said.out
    assert [item.id for item in read(target).specification.properties] == ['kept', 'FT5']
    bundle = target.read_text(encoding='utf-8')
    for line in ('left out: eq (C2PO reads it otherwise)', 'mltl: G[0,1] a == b',
                 "left out: lab (it reads 'eq': it is the name of a formula",
                 "left out: def (it reads 'more': its definition is left out)"):
        assert f'  #  {line}' in bundle or f'  #      {line}' in bundle
    assert 'only a comment: eq' in bundle and ' eq:' not in bundle and ' chain:' not in bundle


def test_what_is_left_out_has_its_reason(tmp_path: Path) -> None:
    found, = import_bundles([written(tmp_path)], tmp_path / 'a.yaml')
    (requirement, reason), = found.draft.left_out
    assert (requirement.id, reason) == ('endless', "'G' needs a bound that ends")


def test_a_section_that_cannot_be_read_is_told_with_its_place(tmp_path: Path) -> None:
    text = SPECIFICATION.replace('DEFINE', 'STRUCT\n    Pair: { a: int; b: int; };\nDEFINE')
    found, = import_bundles([written(tmp_path, text)], tmp_path / 'a.yaml')
    places = [item.span.line for item in found.warnings if 'STRUCT' in item.title and item.span]
    assert places and places[0] == 7


@pytest.mark.parametrize('text', ['', 'INPUT a: bool;', 'x topic', 'FTSPEC\n'])
def test_a_file_without_formulas_is_no_specification(text: str, tmp_path: Path,
                                                     capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['import', str(written(tmp_path, text))]) == 1
    assert 'error: ' in capsys.readouterr().err


@pytest.mark.parametrize(('formula', 'reason'), [
    ('a -> b -> c', 'from the left'),
    ('a <-> b -> c', 'from the left'),
    ('a -> b xor c', 'from the left'),
    ('a -> b => c', 'from the left'),
    ('F[0,2] a == b', "'F' before the comparison in older versions"),
    ('!F[1,1] x != 0', "'F' before the comparison in older versions"),
    ('!x > 3', "'!' before the comparison"),
    ('G[0,2] !(x) > 3', "'!' before the comparison"),
    ('a S[1,3] c', 'up to step t-a only'),
    ('b -> (a T[2,2] c)', 'up to step t-a only'),
    ('(x ^ 2) > 3', 'of bits'),
    ('a | b', 'of bits'),
])
def test_a_formula_that_c2po_reads_otherwise_is_left_out(formula: str, reason: str,
                                                         tmp_path: Path) -> None:
    text = f'INPUT a, b, c: bool; x: int;\nFTSPEC\n  {formula};\n  kept: a;\n'
    found, = import_bundles([written(tmp_path, text)], tmp_path / 'a.yaml')
    assert [item.id for item in found.draft.requirements] == ['kept']
    (place, label), = [(item.span, item.label) for item in found.warnings
                       if 'otherwise' in item.title]
    assert place is not None and place.line == 3 and reason in label


@pytest.mark.parametrize('formula', [
    'a -> (b -> c)', '(a -> b) -> c', '(a -> b) => c', 'F[0,2] (a == b)', 'F[0,2] a && x > 3',
    'a -> F[0,2] !b', '!(x > 3) || H[0,2] a', 'a U[0,2] (b || c)', 'G[0,2] F[0,1] a',
    'a S[0,2] b', 'a U[1,2] b', 'O[1,1] (a S[0,2] b)',
])
def test_what_both_read_alike_is_kept(formula: str, tmp_path: Path) -> None:
    text = f'INPUT a, b, c: bool; x: int;\nFTSPEC\n  {formula};\n'
    found, = import_bundles([written(tmp_path, text)], tmp_path / 'a.yaml')
    assert len(found.draft.requirements) == 1


def test_a_definition_that_c2po_reads_otherwise_is_left_out(tmp_path: Path) -> None:
    text = 'INPUT a, b, c: bool;\nDEFINE\n  chain = a -> b -> c;\nFTSPEC\n  a;\n'
    found, = import_bundles([written(tmp_path, text)], tmp_path / 'a.yaml')
    assert [item.span.line for item in found.warnings if 'otherwise' in item.title and item.span] \
        == [3]


def test_a_bound_of_one_number_is_the_upper_one(tmp_path: Path) -> None:
    text = 'INPUT a, b: bool;\nFTSPEC\n  x: a U[ 3] G[2] b && X[0] ;\n  y: F[4] a && G b;\n' \
        '  z: G[5] (a S[2] b);\n'
    found, = import_bundles([written(tmp_path, text)], tmp_path / 'a.yaml')
    assert [item.text for item in found.draft.requirements] == ['G[0,5] (a S[0,2] b)']
    place = next(item.span for item in found.warnings if 'needs a bound' in item.title)
    assert place is not None and (place.line, place.column) == (4, 16)


def test_members_of_an_enumeration_are_constants(tmp_path: Path) -> None:
    text = ('ENUM\n  Light: {RED, GREEN: 7, OFF};\n  Other: {RED, OFF: 5};\nINPUT now: Light;\n'
            'FTSPEC\n  one: now == RED || now == GREEN;\n  two: now == OFF;\n')
    target = tmp_path / 'a.yaml'
    assert main(['import', str(written(tmp_path, text)), '-o', str(target)]) == 0
    assert "left out: two (it reads 'OFF': it is 1 and 5 in ENUM)" in target.read_text()
    specification = read(target).specification
    assert [item.name for item in specification.signals] == ['now']
    assert evaluate(specification.properties[0].formula, {'now': [0, 1, 7]}) == [True, False, True]


def test_what_reads_a_structure_or_the_time_stamp_is_left_out(tmp_path: Path) -> None:
    text = ('STRUCT Pair: { x: int; y: int; };\nINPUT a: int;\nDEFINE p := Pair(a, a);\n'
            'FTSPEC\n  one: p.x == 3;\n  two: TAU == a;\n  kept: a > 3;\n')
    found, = import_bundles([written(tmp_path, text)], tmp_path / 'a.yaml')
    assert [item.id for item in found.draft.requirements] == ['kept']
    assert [item.name for item in found.draft.inputs] == ['a']
    assert sum('STRUCT' in item.title for item in found.warnings) == 1


def test_a_warning_has_the_place_in_the_file(tmp_path: Path) -> None:
    text = ('INPUT a, b: bool;\nDEFINE\n  both = a &&\n    (b;\nFTSPEC\n  first: a;\n'
            '  -- a comment\n  endless: a -> -- why not\n    G b;\n  H: a;\n')
    path = written(tmp_path, text)
    found, = import_bundles([path], tmp_path / 'a.yaml')
    places = {(item.span.source.name, item.span.line, item.span.column): item.title
              for item in found.warnings if item.span}
    assert places[str(path), 9, 5] == "'G' needs a bound that ends"
    assert any(place[1] in (3, 4) for place in places)


def test_names_are_replaced_in_a_formula_of_several_lines() -> None:
    source = Source('a.c2po', 'one: b &&\n  F[0,1] b;')
    text = Text('b && F[0,1] b', source, [*range(5, 9), *range(11, 21)])
    reading = parse_wording(Wording((Language.MLTL,), text.value, 'one', text))
    assert rename(reading, {'b': 'beta'}).wording.text == 'beta && F[0,1] beta'
    assert rename(reading, {'c': 'gamma'}) is reading
