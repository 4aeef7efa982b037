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
"""The output of `explain`, as text and as a picture."""

from fractions import Fraction
from pathlib import Path
from xml.etree import ElementTree

from explain.examples import bundle
from fret_monitor.build import read
from fret_monitor.bundle.reader import parse_bundle
from fret_monitor.cli.main import main
from fret_monitor.elaboration.elaborate import specify
from fret_monitor.explain.report import explain, meanings, shown
from fret_monitor.explain.svg import to_svg
from fret_monitor.explain.timeline import drawn, timeline
from fret_monitor.explain.words import in_words
from fret_monitor.logic.formula import Constant, postorder
from fret_monitor.logic.printing import to_smv
from fret_monitor.model.diagnostics import CompileError, Source, Text
from fret_monitor.model.policies import Policy
from fret_monitor.traces import search
import golden
import pytest

SVG = '{http://www.w3.org/2000/svg}'


@pytest.mark.parametrize('path', golden.cases('explain'), ids=lambda path: path.stem)
def test_explanations_are_their_golden_files(path: Path) -> None:
    found, _ = explain(read(path))
    golden.check(path, '\n\n'.join('\n'.join(shown(item)) for item in found) + '\n')


@pytest.mark.parametrize(('expression', 'by_steps', 'in_time'), [
    ('meanOver(9, x) <= 2.5', '(the mean of x of the last 9 steps and now) <= 2.5',
     '(the mean of x over the messages in the last 9 s) <= 2.5'),
    ('minOver(1, x) < maxOver(2, x)',
     '(the least x of the last 1 step and now) < (the greatest x of the last 2 steps and now)',
     '(the least x in the last 1 s) < (the greatest x in the last 2 s)'),
    ('countOver(5, x > 1.0) <= 2', '(at how many steps of the last 5 steps and now x > 1.0) <= 2',
     '(at how many messages in the last 5 s x > 1.0) <= 2'),
    ('changeOver(3, x) < 1.0', '(x - (x 3 steps ago)) < 1.0', '(x - (x 3 s ago)) < 1.0'),
    ('heldAt(x > 0.0, x) < 1.0', '(x when last x > 0.0) < 1.0', '(x when last x > 0.0) < 1.0'),
    ('timeOver(9, x > 0.0) >= 2', '', 'x > 0.0 for 2 s or more of the last 9 s'),
    ('timeOver(9, x > 0.0) > 2', '', 'x > 0.0 for more than 2 s of the last 9 s'),
    ('derivative(x) < 1.0', '', '(the change of x a second between the last two messages) < 1.0'),
])
def test_numbers_over_time_are_put_into_words(expression: str, by_steps: str,
                                              in_time: str) -> None:
    for policy, expected in (('every_message', by_steps), ('timed, unit: 1', in_time)):
        if expected:
            specification, _ = specify(parse_bundle(Source('b.yaml', (
                f'format: 1\nevaluation: {{policy: {policy}}}\n'
                'inputs: {x: {type: float64, max_rate: 9}}\n'
                f'requirements: [{{id: A, ptltl: "{expression}"}}]\n')), Path()))
            item, = specification.properties
            assert in_words(item.formula, 500, is_timed=specification.policy is Policy.TIMED) \
                == expected


def test_some_requirements_are_explained_in_the_order_of_the_bundle(
    tmp_path: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    path = bundle(tmp_path, 'H p', 'H q', 'p')
    for ids in (['R1'], ['R2', 'R1']):
        assert main(['explain', str(path), *ids]) == 0
        said = capsys.readouterr()
        found = [line for line in said.out.splitlines() if line in ('R0', 'R1', 'R2')]
        assert found == sorted(ids)
        assert said.err == ''


def test_an_unknown_id_is_reported_with_a_similar_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(['explain', str(bundle(tmp_path, 'H p')), 'R00', 'R0', 'other']) == 1
    said = capsys.readouterr()
    assert said.out == ''
    assert "no requirement 'R00'" in said.err
    assert "did you mean 'R0'?" in said.err
    assert "no requirement 'other'" in said.err


def test_a_picture_does_not_overwrite_the_bundle(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = bundle(tmp_path, 'H p')
    text = path.read_text()
    (tmp_path / 'link.svg').symlink_to(path)
    for drawing in (path, tmp_path / 'link.svg'):
        assert main(['explain', str(path), '--svg', str(drawing)]) == 1
        said = capsys.readouterr()
        assert (said.out, said.err.startswith(f"error: cannot write '{drawing}'")) == ('', True)
        assert path.read_text() == text


def test_a_bad_bundle_is_reported_and_nothing_explained(
    tmp_path: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    drawing = tmp_path / 'out.svg'
    path = bundle(tmp_path, 'H (p & zz)')
    assert main(['explain', str(path), '--svg', str(drawing)]) == 1
    assert main(['explain', str(tmp_path / 'none.yaml')]) == 1
    said = capsys.readouterr()
    assert said.out == ''
    assert "'zz'" in said.err
    assert not drawing.exists()


def test_a_picture_that_cannot_be_written_is_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    path = bundle(tmp_path, 'H p')
    assert main(['explain', str(path), '--svg', str(tmp_path / 'none' / 'a.svg')]) == 1
    assert 'cannot write' in capsys.readouterr().err


def test_the_picture_shows_every_step_of_every_row(tmp_path: Path) -> None:
    found, _ = explain(read(bundle(tmp_path, 'H (x > 1.0 -> O[0,4] p)')))
    lines = [line for item in found for line in item.timelines]
    root = ElementTree.fromstring(to_svg('examples', lines))
    assert root.tag == f'{SVG}svg'
    assert root.attrib['version'] == '1.1'
    assert {each.tag for each in root.iter()} == {
        f'{SVG}{name}' for name in ('svg', 'title', 'rect', 'text')}
    cells = [each for each in root.iter(f'{SVG}rect') if each.get('height') == '14']
    assert len(cells) == sum((len(line.bands) + 1) * len(line.steps) for line in lines)
    texts = [each.text or '' for each in root.iter(f'{SVG}text')]
    assert 'x > 1.0' in texts


def test_text_in_a_picture_is_escaped() -> None:
    line = timeline('<a> & "b"\x00\ud800', ['p < q & </text>'], [[True]], [False], None)
    root = ElementTree.fromstring(to_svg('<t>', [line]).encode())
    texts = [each.text for each in root.iter(f'{SVG}text')]
    assert '<a> & "b"\ufffd\ufffd' in texts
    assert 'p < q & </text>' in texts


def test_a_timeline_has_a_sign_for_each_step_and_a_scale() -> None:
    line = timeline('t', ['p'], [[True] * 6 + [False]], [True] * 6 + [False], Fraction(1, 4))
    assert list(drawn(line)) == [
        'p        ######.',
        'verdict  ######x',
        'step     0    5',
        'seconds  0    1.25',
    ]


def test_long_constant_parts_of_a_timeline_are_left_out() -> None:
    truth = [True] * 500 + [False] * 2
    line = timeline('t', ['p'], [truth], truth, None, ['x: 3'])
    assert list(drawn(line)) == [
        'p        ###~###..',
        'verdict  ###~###xx',
        'step     0   497 501',
        'x: 3',
    ]


def test_traces_of_any_length_that_change_often_fit_a_page() -> None:
    truth = [step % 2 == 0 for step in range(100_000)]
    assert max(len(text) for text in drawn(timeline('t', ['p'], [truth], truth, None))) < 250


def test_deep_and_wide_requirements_are_explained(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(search, '_LARGE', 30_000)  # steps: no recovery is found in any number
    deep = 'Y ' * 1500 + 'p'
    wide = ' & '.join(f'(O[0,{bound}] p -> q)' for bound in range(1, 200))
    nested = '(' * 1200 + 'p' + ' S q)' * 1200
    found, _ = explain(read(bundle(tmp_path, deep, f'H ({wide})', nested)))
    assert all(len('\n'.join(shown(item))) < 20_000 for item in found)
    assert [len(item.timelines) for item in found] == [3, 2, 3]


def test_an_unreadable_bundle_is_a_diagnostic(tmp_path: Path) -> None:
    with pytest.raises(CompileError, match='there is no formula'):
        explain(read(bundle(tmp_path, '')))


@pytest.mark.parametrize(('sentence', 'held'), [
    ('in p mode upon q the sys shall never satisfy r', {'p', 'q'}),
    ('before p upon q the sys shall within 2 ticks satisfy r', {'q', 'r'}),
    ('only in p mode upon q shall the sys eventually satisfy r', {'q', 'r'}),
    ('whenever q the sys shall until p satisfy r', {'p', 'q', 'r'}),
])
def test_a_satisfying_example_of_a_sentence_is_not_trivial(
    sentence: str, held: set[str], tmp_path: Path,
) -> None:
    path = bundle(tmp_path, 'H p')
    path.write_text(path.read_text().replace('ptltl: "H p"', f'fretish: "{sentence}"'))
    (found,), _ = explain(read(path))
    satisfying = found.timelines[0]
    assert 'satisfies' in satisfying.title
    assert {band.label for band in satisfying.bands if True in band.truth} >= held
    assert dict(found.fields)['component'] == 'sys'


def test_triggers_have_the_constants_that_were_given(tmp_path: Path) -> None:
    file = tmp_path / 'pump.yaml'
    file.write_text("""format: 1
constants: {high: 1.0}
inputs: {flow: {type: float64}, level: {type: float64}}
requirements:
  - {id: R, fretish: "when flow > high the pump shall immediately satisfy level > 0"}
""", encoding='utf-8')
    given = {'high': Text.whole(Source('--constant high', '7.5'))}
    denial = meanings(read(file, constants=given))['R'].denial
    assert denial is not None
    assert {node.value for node in postorder([denial]) if isinstance(node, Constant)} >= {7.5}
    assert '1.0' not in to_smv(denial)
