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

"""`bag --margins`: how close each requirement came in recordings, and which came closest."""

from array import array
from itertools import pairwise
import json
from pathlib import Path
from random import Random
import re
from typing import Any
from xml.etree import ElementTree

from bundles import write_bundle
from cli.command import run_here as run
from fret_monitor.bag.check import check_recording, Selection
from fret_monitor.bag.moments import Anchor, Moment
from fret_monitor.native.monitor import load
from fret_monitor.runtime.evaluator import Evaluator
from fret_monitor.start import start
from fret_monitor.traces.simulate import for_trace

BUNDLE = """
format: 1
inputs:
  x: {topic: x, type: std_msgs/msg/Float64, max_rate: 10, scale: 2}
  on: {topic: on, type: std_msgs/msg/Bool, max_rate: 10}
evaluation: {policy: timed, unit: 1}
requirements:
  - {id: LOW, ptltl: "H[0,2] (on -> x <= 10)"}
  - {id: ON, ptltl: "O on"}
"""
ROWS = ['0,3,1', '1,9,1', '2,20,0', '4,5,1', '5,8,1']
SECOND = 10**9


def trace(folder: Path, rows: list[str], name: str = 'trace.csv') -> Path:
    """Write a trace."""
    path = folder / name
    path.write_text('\n'.join(['time,x,on', *rows]) + '\n')
    return path


def test_the_closest_is_the_least_margin_of_all_instants(tmp_path: Path) -> None:
    bundle = write_bundle(tmp_path, BUNDLE)
    low, on = check_recording(bundle, trace(tmp_path, ROWS), Selection(margins=True)).findings
    assert on.closest is None  # no number decides
    assert low.closest is not None
    assert (low.closest.margin, low.closest.distance) == (0.5, 1.0)
    assert (low.closest.comparison, low.closest.inputs) == ('x <= 10.0', ('x',))
    assert (low.closest.at, low.closest.step) == (SECOND, SECOND)
    compiled = start(bundle, margins=True)
    evaluator = Evaluator(for_trace(load(compiled.library, compiled.manifest)))
    columns: list[array[Any] | None] = [
        array('d', [3, 9, 20, 5, 8]), array('B', [1, 1, 0, 1, 1])]
    times = array('q', [second * SECOND for second in (0, 1, 2, 4, 5)])
    found = [item.value for _, _, margins in evaluator.margin_rows(columns, times)
             for item in margins[::2]]
    assert min(found) == low.closest.margin


def test_the_closest_is_that_of_the_part_that_is_judged(tmp_path: Path) -> None:
    bundle, path = write_bundle(tmp_path, BUNDLE), trace(tmp_path, ROWS)
    begin = Moment(Anchor.START, 2 * SECOND)
    for selection, expected in (
            (Selection(margins=True, begin=begin), 1.0),
            (Selection(margins=True, end=Moment(Anchor.START, SECOND - 1)), 3.5)):
        low = check_recording(bundle, path, selection).findings[0]
        assert low.closest is not None and low.closest.margin == expected


def test_without_margins_nothing_is_said_of_them(tmp_path: Path) -> None:
    bundle, path = write_bundle(tmp_path, BUNDLE), trace(tmp_path, ROWS)
    assert all(item.closest is None for item in check_recording(
        bundle, path, Selection()).findings)


def test_several_recordings_are_ranked_and_results_have_the_margins(tmp_path: Path) -> None:
    bundle = write_bundle(tmp_path, BUNDLE)
    paths = [trace(tmp_path, ROWS, 'a.csv'), trace(tmp_path, ['0,13,1'], 'b.csv'),
             trace(tmp_path, ['0,1,1', '1,2,0'], 'c.csv')]
    junit, results = tmp_path / 'junit.xml', tmp_path / 'results.jsonl'
    for _ in range(2):  # the second time, all were checked before
        done = run('bag', bundle, *paths, '--margins', '--junit', junit, '--results', results)
        assert (done.status, done.err) == (0, '')
        ranking = done.out[done.out.index('closest, over 3 recordings:'):].splitlines()
        assert [(Path(line.split()[1]).name, line.split()[2]) for line in ranking[2:]] == [
            ('b.csv', '-1.5'), ('a.csv', '0.5'), ('c.csv', '4.5')]
    assert ranking[2].endswith('x <= 10.0 (-3)')
    reports = tmp_path / 'reports'
    done = run('bag', bundle, *paths, '--margins', '--json', '--report', reports)
    last = json.loads(done.out.splitlines()[-1])
    assert [(Path(item['bag']).name, item['margin'], item['comparison'])
            for item in last['closest']['LOW']] == [
        ('b.csv', -1.5, 'x <= 10.0'), ('a.csv', 0.5, 'x <= 10.0'), ('c.csv', 4.5, 'x <= 10.0')]
    assert (last['bags'], list(last)) == (3, ['bags', 'closest'])
    page = (reports / 'index.html').read_text().split('<h2>Closest to a violation</h2>')[1]
    assert [page.index(f'<td>{line.split()[2]}</td>') for line in ranking[2:]] == sorted(
        page.index(f'<td>{line.split()[2]}</td>') for line in ranking[2:])
    (tmp_path / 'lines.jsonl').write_text(done.out)
    done = run('check', bundle, '--trace', tmp_path / 'lines.jsonl')
    assert 'no results of a recording' not in done.err
    found = [json.loads(line)['requirements'] for line in results.read_text().splitlines()]
    assert [item['LOW']['closest']['margin'] for item in found] == [0.5, -1.5, 4.5]
    assert all('closest' not in item['ON'] for item in found)
    case = ElementTree.parse(junit).getroot().find("testsuite[2]/testcase[@name='LOW']")
    assert case is not None
    assert [(item.get('name'), item.get('value')) for item in case.iter('property')][:3] == [
        ('closest.margin', '-1.5'), ('closest.distance', '-3.0'),
        ('closest.comparison', 'x <= 10.0')]


LANE = """
format: 1
inputs:
  x: {topic: x, type: std_msgs/msg/Float64, scale: 2}
  y: {topic: y, type: std_msgs/msg/Float64}
requirements:
  - {id: BOTH, ptltl: "H[0,2] (x <= 10 & y >= 2)"}
  - {id: ON, ptltl: "x <= 10 | TRUE"}
"""


def test_a_report_has_a_lane_of_the_margin_with_the_comparison_that_decides(
    tmp_path: Path,
) -> None:
    rng = Random(8)
    rows = [(rng.randrange(14), rng.randrange(9)) for _ in range(30)]
    bundle = write_bundle(tmp_path, LANE)
    path, page, found = (tmp_path / name for name in ('run.csv', 'page.html', 'margins.csv'))
    path.write_text('\n'.join(['time,x,y', *(
        f'{second},{x},{y}' for second, (x, y) in enumerate(rows))]) + '\n')
    (tmp_path / 'steps.csv').write_text(
        '\n'.join(['x,y', *(f'{x},{y}' for x, y in rows)]) + '\n')
    assert run('bag', bundle, path, '--margins', '--report', page).status == 0
    assert run('simulate', bundle, '--trace', tmp_path / 'steps.csv',
               '--margins', found).status == 0
    steps = [line.split(',') for line in found.read_text().splitlines()[1:] if ',BOTH,' in line]
    text = page.read_text(encoding='utf-8')
    assert text.count('aria-label="margin over time"') == 1  # that of ON is always infinite
    line = re.search(r'<polyline class="margin" points="([^"]*)"', text)
    assert line is not None
    points = [tuple(map(float, point.split(','))) for point in line[1].split()]
    bars = [(int(number), float(begin), float(width)) for number, begin, width in re.findall(
        r'data-comparison="(\d+)" x="([\d.]+)" y="[\d.]+" width="([\d.]+)"', text)]
    values = [float(step[2]) for step in steps]
    assert min(values) < 0 < max(values)
    high, low = max(0.0, *values), min(0.0, *values)
    deciders = set()
    for second, step in enumerate(steps[:-1]):
        place = 720 * (second + 0.5) / (len(rows) - 1)
        y = next(end for (x, _), (after, end) in pairwise(points) if x <= place < after)
        assert abs(y - (high - float(step[2])) * 40 / (high - low)) <= 0.06
        number = next(n for n, begin, width in bars if begin - 0.1 <= place < begin + width + 0.1)
        assert ('x <= 10.0', 'y >= 2.0')[number] == step[4]
        deciders.add(number)
    assert deciders == {0, 1}
    closest = min(values)
    assert f'Closest: margin {closest:.6g} at ' in text
    without = tmp_path / 'without.html'
    assert run('bag', bundle, path, '--report', without).status == 0
    assert 'margin over time' not in without.read_text(encoding='utf-8')
