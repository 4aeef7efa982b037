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

"""Probabilities over recordings: what one says, and what all say together."""

import csv
import json
from pathlib import Path
from random import Random
from typing import Any
from xml.etree import ElementTree

from bag.recordings import START, write
from bundles import write_bundle
from fret_monitor.build import read
from fret_monitor.cli.main import main
from fret_monitor.logic.evaluate import evaluate
from fret_monitor.logic.formula import NotRefuted
from fret_monitor.runtime.probability import PooledTest
import pytest

BUNDLE = """format: 1
confidence: 0.99
inputs:
  c: {topic: c, type: std_msgs/msg/Bool}
  r: {topic: r, type: std_msgs/msg/Bool}
requirements:
  - {id: SOON, fretish: upon c the robot shall with probability > 0.9 within 2 ticks satisfy r}
  - {id: RARE, fretish: upon c the robot shall with probability < 0.5 within 2 ticks satisfy r}
  - {id: ALWAYS, fretish: the robot shall always satisfy c | r | !r}
"""
Capture = pytest.CaptureFixture[str]


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    return write_bundle(tmp_path, BUNDLE)


def rows(rng: Random, rate: float, steps: int = 200) -> dict[str, list[bool]]:
    return {'c': [step % 4 == 0 for step in range(steps)],
            'r': [step % 4 == 1 and rng.random() >= rate for step in range(steps)]}


def trace(folder: Path, name: str, columns: dict[str, list[bool]]) -> Path:
    path = folder / name
    with path.open('w', encoding='utf-8', newline='') as file:
        writer = csv.writer(file)
        writer.writerow(['time', *columns])
        writer.writerows([step, *map(int, row)] for step, row in enumerate(
            zip(*columns.values(), strict=True)))
    return path


def outcomes(bundle: Path, number: int, columns: dict[str, list[bool]]) -> list[bool]:
    """Return whether each trial failed, by the reference."""
    formula = read(bundle).specification.properties[number].formula
    assert isinstance(formula, NotRefuted)
    sign = 1 if number == 0 else -1
    return [value == -sign for value in evaluate(formula.argument, columns) if value]


def lines(capture: Capture, *arguments: object) -> tuple[int, list[dict[str, Any]]]:
    status = main(['bag', '--json', *map(str, arguments)])
    return status, [json.loads(line) for line in capture.readouterr().out.splitlines()]


def test_a_recording_alone_has_the_trials_of_the_reference(
        bundle: Path, tmp_path: Path, capsys: Capture) -> None:
    columns = rows(Random(1), 0.3)
    path = trace(tmp_path, 'run.csv', columns)
    status, (found, pooled) = lines(capsys, bundle, path)
    assert status == 0
    properties = read(bundle).specification.properties
    for number, name in enumerate(('SOON', 'RARE')):
        item = found['requirements'][name]
        failed = outcomes(bundle, number, columns)
        told = item['probability']
        assert (told['trials'], told['failures']) == (len(failed), sum(failed)) != (0, 0)
        asked = properties[number].probability
        assert asked is not None
        test = PooledTest(asked)
        for each in failed:
            test.add(each)
        figures = test.figures()
        assert (told['verdict'], told['interval']) == (
            figures.verdict, [figures.low, figures.high])
        assert {'refuted': False, 'open': None, 'assured': True}[told['verdict']] \
            is item['verdict']
        assert pooled['pooled'][name]['interval'] == told['interval']
    assert found['requirements']['SOON']['verdict'] is False
    assert 'probability' not in found['requirements']['ALWAYS']


def test_a_rosbag_has_the_times_of_a_trial(bundle: Path, tmp_path: Path, capsys: Capture) -> None:
    messages: list[tuple[str, int, Any]] = [('/c', 0, False), ('/r', 1, False)]
    for place in range(40):
        messages += [('/c', 4 * place + 2, True), ('/r', 4 * place + 3, place % 3 == 0),
                     ('/c', 4 * place + 4, False)]
    path = write(tmp_path / 'run', messages, kind='std_msgs/msg/Bool')
    status, (found, _) = lines(capsys, bundle, path, '--fail-on-violation')
    assert status == 1
    item = found['requirements']['SOON']
    assert (item['probability']['trials'], item['probability']['failures']) == (40, 13)
    assert item['occurrences'] == 1
    assert START <= int(float(item['first']) * 10 ** 9)


def test_recordings_are_pooled_in_their_order_however_they_are_checked(
        bundle: Path, tmp_path: Path, capsys: Capture) -> None:
    rng = Random(2)
    paths = [trace(tmp_path, f'run_{place}.csv', rows(rng, rate))
             for place, rate in enumerate((0.02, 0.3, 0.1, 0.0, 0.2))]
    status, (*each, pooled) = lines(capsys, bundle, *paths)
    assert status == 0 and pooled['bags'] == 5
    runs = [line['requirements']['SOON']['probability']['runs'] for line in each]
    asked = read(bundle).specification.properties[0].probability
    assert asked is not None
    test = PooledTest(asked)
    for item in runs:
        test.add_runs(item)
    assert pooled['pooled']['SOON']['trials'] == 250 == test.figures().trials
    assert pooled['pooled']['SOON']['verdict'] == test.figures().verdict
    assert pooled['pooled']['SOON']['interval'] == [test.figures().low, test.figures().high]
    _, (*_, other) = lines(capsys, bundle, *reversed(paths))
    assert other['pooled']['SOON']['trials'] == 250
    _, (*_, together) = lines(capsys, bundle, *paths, '--jobs', '2')
    assert together == pooled


def test_the_index_and_junit_have_the_figures_of_all_recordings(
        bundle: Path, tmp_path: Path, capsys: Capture) -> None:
    rng = Random(2)
    paths = [trace(tmp_path, f'run_{place}.csv', rows(rng, rate))
             for place, rate in enumerate((0.02, 0.3, 0.1))]
    reports, junit = tmp_path / 'reports', tmp_path / 'junit.xml'
    _, (*each, pooled) = lines(
        capsys, bundle, *paths, '--report', reports, '--junit', junit)
    found = pooled['pooled']
    *alone, together = ElementTree.parse(junit).getroot()
    assert together.get('name') == 'all recordings'
    assert [case.get('name') for case in together] == ['SOON', 'RARE']
    for suite, item in zip((*alone, together), (*(
            {name: value['probability'] for name, value in line['requirements'].items()
             if 'probability' in value} for line in each), found)):
        for case in suite:
            properties = {each.get('name'): each.get('value') for each in case.iter('property')
                          if each.get('name') != 'meaning'}
            expected = item.get(case.get('name'), {})
            assert properties == {f'probability.{key}': str(expected[key]) for key in (
                'verdict', 'trials', 'failures', 'estimate', 'interval') if expected}
    verdicts = {'refuted': 'failure', 'open': 'skipped'}
    assert [[verdicts[found[name]['verdict']]] if found[name]['verdict'] in verdicts else []
            for name in found] == [[item.tag for item in case if item.tag != 'properties']
                                   for case in together]
    assert (found['SOON']['verdict'], found['RARE']['verdict']) == ('assured', 'refuted')
    assert (together.get('tests'), together.get('failures'), together.get('skipped')) == (
        '2', '1', '0')
    index = (reports / 'index.html').read_text(encoding='utf-8')
    after = index[index.index('Probabilities over all recordings'):]
    for name, item in found.items():
        low, high = item['interval']
        verdict = item['verdict'].upper() if item['verdict'] == 'refuted' else item['verdict']
        cells = (name, verdict, f'{item["trials"]:,}', f'{item["failures"]:,}',
                 f'{item["estimate"]:.6g}', f'{low:.6g} .. {high:.6g}')
        row = after[after.index(f'<td>{name}</td>'):]
        assert all(f'<td>{cell}</td>' in row[:row.index('</tr>')] for cell in cells)


def test_a_run_that_was_interrupted_ends_with_the_same_numbers(
        bundle: Path, tmp_path: Path, capsys: Capture) -> None:
    rng = Random(3)
    paths = [trace(tmp_path, f'run_{place}.csv', rows(rng, 0.1)) for place in range(4)]
    _, (*_, whole) = lines(capsys, bundle, *paths)
    results = tmp_path / 'results.jsonl'
    lines(capsys, bundle, paths[2], paths[0], '--results', results)
    _, (*_, resumed) = lines(capsys, bundle, *paths, '--results', results)
    assert resumed == whole
    assert len(results.read_text(encoding='utf-8').splitlines()) == 4


def test_the_table_says_how_many_more_it_takes(
        bundle: Path, tmp_path: Path, capsys: Capture) -> None:
    paths = [trace(tmp_path, f'run_{place}.csv', rows(Random(4), 0.0)) for place in range(1)]
    assert main(['bag', str(bundle), *map(str, paths)]) == 0
    out = capsys.readouterr().out
    head, *table = out[out.index('probabilities, '):].splitlines()
    assert head == 'probabilities, over 1 recording:'
    assert table[0].split() == ['requirement', 'probability', 'verdict', 'trials', 'failures',
                                'estimate', 'interval', 'more']
    name, *_, more = table[1].split()
    assert name == 'SOON' and 'open' in table[1] and int(more) > 0
    assert 'REFUTED' in table[2]  # every trial of RARE succeeds
    longer = rows(Random(4), 0.0, 200 + 4 * int(more))
    paths.append(trace(tmp_path, 'longer.csv', longer))
    assert main(['bag', str(bundle), str(paths[1])]) == 0
    assert 'assured' in capsys.readouterr().out


def test_a_refuted_requirement_fails_the_run(
        bundle: Path, tmp_path: Path, capsys: Capture) -> None:
    rng = Random(5)
    paths = [trace(tmp_path, f'run_{place}.csv', rows(rng, 0.3, 48)) for place in range(6)]
    status, (*each, pooled) = lines(capsys, bundle, *paths, '--fail-on-violation')
    assert pooled['pooled']['SOON']['verdict'] == 'refuted'
    assert status == 1
    assert all(line['requirements']['RARE']['probability']['trials'] == 12 for line in each)
