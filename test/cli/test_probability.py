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

"""What the verbs do with requirements with probabilities: taken, or left out and said so."""

from fractions import Fraction
import json
from pathlib import Path

from bundles import write_bundle
from fret_monitor.cli.main import main
from fret_monitor.model.probability import Probability
from fret_monitor.native.folder import open_folder
from fret_monitor.native.monitor import load
from fret_monitor.runtime.probability import outcomes_of, PooledTest
import pytest

PROBABLE = '  - {id: P, fretish: "upon c the robot shall with probability > 0.98 within 2 ticks ' \
    'satisfy r"}\n'
HEAD = """format: 1
inputs:
  c: {topic: c, type: std_msgs/msg/Bool}
  r: {topic: r, type: std_msgs/msg/Bool}
requirements:
"""
BUNDLE = f'{HEAD}{PROBABLE}  - {{id: Q, ptltl: "H (c -> r)"}}\n'
Capture = pytest.CaptureFixture[str]


@pytest.mark.parametrize('verb', ['prove', 'analyze'])
def test_a_verb_says_what_it_leaves_out(tmp_path: Path, capsys: Capture, verb: str) -> None:
    bundle = write_bundle(tmp_path, BUNDLE)
    assert main([verb, str(bundle)]) == 0
    shown = capsys.readouterr()
    assert f'bundle.yaml:6:23: warning: `{verb}` leaves out P: it is about a probability' \
        in shown.err
    assert ('consistent            yes' if verb == 'analyze' else ': proved') in shown.out
    assert main([verb, str(write_bundle(tmp_path, f'{HEAD}{PROBABLE}', 'alone.yaml'))]) == 1
    assert f'error: `{verb}` leaves out P' in capsys.readouterr().err


def test_tests_are_written_for_the_others(tmp_path: Path, capsys: Capture) -> None:
    assert main(['tests', str(write_bundle(tmp_path, BUNDLE)), '-o', str(tmp_path / 'out')]) == 0
    shown = capsys.readouterr()
    assert '`tests` leaves out P' in shown.err
    assert 'Q' in shown.out and 'P ' not in shown.out


def test_an_export_has_the_test_and_is_not_proved(tmp_path: Path, capsys: Capture) -> None:
    folder = tmp_path / 'out'
    assert main(['export', str(write_bundle(tmp_path, BUNDLE)), '--to', 'c99', '--output',
                 str(folder)]) == 0
    assert 'not proved: requirements with probabilities' in capsys.readouterr().out
    assert (folder / 'src' / 'fret_trials.h').is_file()
    assert not (folder / 'certificate.json').exists()


def test_formalize_has_no_formula_and_explain_says_what_is_tested(
        tmp_path: Path, capsys: Capture) -> None:
    assert main(['formalize', 'upon c the robot shall with probability > 0.98 within 2 ticks '
                 'satisfy r']) == 1
    assert 'has no formula of past-time MTL' in capsys.readouterr().err
    assert main(['explain', str(write_bundle(tmp_path, BUNDLE)), 'P', '--json']) == 0
    (item,) = json.loads(capsys.readouterr().out)['requirements']
    assert item['fields']['with'] == 'probability > 0.98'
    assert item['meaning']['tested'].startswith(
        'of the triggers, at most 1 of 50 may be without its response; tested at 0.999')


def test_a_compiled_folder_knows_its_tests(tmp_path: Path, capsys: Capture) -> None:
    folder = tmp_path / 'out'
    assert main(['compile', str(write_bundle(tmp_path, BUNDLE)), '--output', str(folder)]) == 0
    compiled = open_folder(folder)
    monitor = load(compiled.library, compiled.manifest)
    assert monitor.tests.n_tests == 1
    test = monitor.tests.tests[0]
    assert (test.requirement, test.allowed, test.limit) == (0, 0.02, 1000.0)
    asked = compiled.manifest.requirements[0].probability
    assert asked is not None and asked.required == '> 0.98'


def test_a_report_has_the_curve(tmp_path: Path, capsys: Capture) -> None:
    rows = [f'{step},{int(step % 3 == 0)},{int(step % 12 < 9)}' for step in range(120)]
    trace = tmp_path / 'run.csv'
    trace.write_text('\n'.join(['time,c,r', *rows, '']), encoding='utf-8')
    page = tmp_path / 'page.html'
    assert main(['bag', str(write_bundle(tmp_path, BUNDLE)), str(trace), '--report',
                 str(page)]) == 0
    text = page.read_text(encoding='utf-8')
    assert text.count('aria-label="probability of success after each trial"') == 1
    start = text.index('class="curve" points="')
    points = text[start:].split('"')[3].split()
    (found, _) = (json.loads(line) for line in _json(capsys, tmp_path, trace))
    told = found['requirements']['P']['probability']
    assert len(points) == told['trials'] > 20
    ends = [item.split(',') for item in text.split('<polygon points="')[1].split('"')[0].split()]
    upper, lower = ends[:len(points)], ends[:len(points) - 1:-1]
    test = PooledTest(Probability('>', Fraction('0.98'), Fraction(told['confidence'])))
    failures = 0
    for number, has_failed in enumerate(outcomes_of(told['runs']), 1):
        test.add(has_failed)
        failures += has_failed
        figures = test.figures(has_more=False)
        shown = [points[number - 1].split(','), upper[number - 1], lower[number - 1]]
        for (x, y), value in zip(shown, (1 - failures / number, figures.high, figures.low)):
            assert abs(float(x) - (44 + 676 * number / told['trials'])) <= 0.06
            assert abs(float(y) - (8 + 120 * (1 - value))) <= 0.06
    assert failures == told['failures'] > 0
    assert f'{told["failures"]:,} of {told["trials"]:,} trials failed' in text


def _json(capsys: Capture, folder: Path, trace: Path) -> list[str]:
    capsys.readouterr()
    main(['bag', str(folder / 'bundle.yaml'), str(trace), '--json'])
    return capsys.readouterr().out.splitlines()


def test_import_takes_frets_probabilistic_requirements(tmp_path: Path, capsys: Capture) -> None:
    sentence = 'upon c the robot shall with probability > 0.98 within 2 ticks satisfy r'
    project = [{'reqid': 'P', 'project': 'Demo', 'fulltext': sentence, 'semantics': {
        'component_name': 'robot', 'pctl': 'P>=1[(G (c => (P > 0.98[(F<=2 r)])))]',
        'ptExpanded': '(H (c -> r))', 'CoCoSpecCode': 'H((c => r))'}}]
    file = tmp_path / 'project.json'
    file.write_text(json.dumps(project), encoding='utf-8')
    bundle = tmp_path / 'made.yaml'
    assert main(['import', str(file), '-o', str(bundle)]) == 0
    text = ' '.join(bundle.read_text(encoding='utf-8').split())
    assert 'with probability > 0.98' in text
    assert 'differ' not in capsys.readouterr().err
    assert main(['check', str(bundle)]) == 0
