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
import json
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from bundles import write_bundle
from cli.command import run
from fret_monitor.bag.check import check_recording, Selection
from fret_monitor.bag.moments import Anchor, Moment
from fret_monitor.model.diagnostics import CompileError
from fret_monitor.native.monitor import load
from fret_monitor.runtime.evaluator import Evaluator
from fret_monitor.start import start
from fret_monitor.traces.simulate import for_trace
import pytest

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
    found = [json.loads(line)['requirements'] for line in results.read_text().splitlines()]
    assert [item['LOW']['closest']['margin'] for item in found] == [0.5, -1.5, 4.5]
    assert all('closest' not in item['ON'] for item in found)
    case = ElementTree.parse(junit).getroot().find("testsuite[2]/testcase[@name='LOW']")
    assert case is not None
    assert [(item.get('name'), item.get('value')) for item in case.iter('property')][:3] == [
        ('closest.margin', '-1.5'), ('closest.distance', '-3.0'),
        ('closest.comparison', 'x <= 10.0')]


def test_bundles_with_instances_are_refused(tmp_path: Path) -> None:
    bundle = write_bundle(tmp_path, """
format: 1
for_each: {robot: [a, b]}
inputs: {x: {topic: "/{robot}/x", type: std_msgs/msg/Float64}}
requirements: [{id: R, ptltl: "x <= 5.0"}]
""")
    with pytest.raises(CompileError, match='for_each'):
        check_recording(bundle, trace(tmp_path, ROWS), Selection(margins=True))
