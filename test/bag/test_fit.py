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

"""The tightest value of a constant, against `bag` with each value and its neighbours."""

from collections.abc import Iterator, Sequence
import csv
from fractions import Fraction
from itertools import pairwise
import json
from math import inf, nextafter
from pathlib import Path
from random import Random
from threading import current_thread, main_thread
from typing import Any

from bag.recordings import write
from bundles import write_bundle
from differential.compiled import unoptimised
from fret_monitor.bag.check import check_recording, RecordingResult, run as judge, Selection
from fret_monitor.bag.constant_range import BOUNDS, ConstantRange, DOUBLES, SINGLES, WHOLE
from fret_monitor.bag.fit import fit
from fret_monitor.cli.main import main
from fret_monitor.model.diagnostics import CompileError, Source, Text
import numpy as np
import pytest
from strategies import some, thorough

BUNDLE = """format: 1
constants: {limit: 5.0, n: 4, level: 5, dead: 0.25, free: 1.0, other: 2.0, armed: true}
inputs:
  x: {topic: x, type: std_msgs/msg/Float64}
  f: {topic: f, type: std_msgs/msg/Float32}
  k: {topic: k, type: std_msgs/msg/Int32}
  p: {topic: p, type: std_msgs/msg/Bool}
requirements:
  - {id: LOW, ptltl: "H (x <= limit)"}
  - {id: SOON, ptltl: "H (O[0,n] p)"}
  - {id: LEVEL, ptltl: "H (k > level)"}
  - {id: DEAD, ptltl: "H (x < dead | x > dead + 1.0)"}
  - {id: FREE, ptltl: "H (x < free | x >= free)"}
  - {id: NEVER, ptltl: "other < 0.0 & other > 0.0 | O (x > other) & H (x < other)"}
  - {id: ARMED, ptltl: "armed | p"}
"""
SINGLE = """format: 1
constants: {top: 9.0}
inputs: {f: {topic: f, type: std_msgs/msg/Float32}}
requirements: [{id: TOP, ptltl: "H (f < top)"}]
"""


def trace(folder: Path, name: str, seed: int) -> Path:
    rng, path = Random(seed), folder / name
    with path.open('w', encoding='utf-8', newline='') as file:
        writer = csv.writer(file)
        writer.writerow(['time', 'x', 'f', 'k', 'p'])
        for step in range(60):
            writer.writerow([step, repr(rng.gauss(0, 1)), repr(float(np.float32(rng.random()))),
                             rng.randint(-20, 40), int(step % (3 + seed) == 0)])
    return path


@pytest.fixture(autouse=True, scope='module')
def quickly_compiled() -> Iterator[None]:
    with unoptimised():
        yield


@pytest.fixture
def paths(tmp_path: Path) -> list[Path]:
    return [trace(tmp_path, f'run_{seed}.csv', seed) for seed in range(3)]


def is_satisfied(bundle: Path, paths: list[Path], name: str, value: str, id: str) -> bool:
    selection = Selection(constants={name: Text.whole(Source(name, value))})
    found = [check_recording(bundle, path, selection) for path in paths]
    return all(item.verdict is not False for result in found for item in result.findings
               if item.id == id)


def column(paths: list[Path], name: str) -> list[float]:
    return [float(row[name]) for path in paths
            for row in csv.DictReader(path.read_text(encoding='utf-8').splitlines())]


def test_a_limit_is_exact_to_the_last_bit(tmp_path: Path, paths: list[Path]) -> None:
    bundle = write_bundle(tmp_path, BUNDLE)
    found = fit(bundle, paths, 'limit', Selection())
    most = max(column(paths, 'x'))
    assert (float(found.value), float(found.tighter)) == (most, nextafter(most, -inf))
    assert found.is_least and found.is_monotone and found.kind == 'float64'
    assert is_satisfied(bundle, paths, 'limit', found.value, 'LOW')
    assert not is_satisfied(bundle, paths, 'limit', found.tighter, 'LOW')
    path, requirement, time = found.deciding
    assert requirement == 'LOW' and time is not None
    assert column([path], 'x')[time // 10 ** 9] == most
    assert found.requirements == ('LOW',)


def test_a_float32_is_exact_in_its_own_type(tmp_path: Path, paths: list[Path]) -> None:
    bundle = write_bundle(tmp_path, SINGLE)
    found = fit(bundle, paths, 'top', Selection())
    most = np.float32(max(column(paths, 'f')))
    assert found.kind == 'float32'
    assert np.float32(found.value) == np.nextafter(most, np.float32(inf))
    assert np.float32(found.tighter) == most
    assert is_satisfied(bundle, paths, 'top', found.value, 'TOP')
    assert not is_satisfied(bundle, paths, 'top', found.tighter, 'TOP')


@pytest.mark.parametrize(('name', 'id', 'values', 'is_least'), [
    ('n', 'SOON', some([0, 4, 11, 5, 6, 7], 2), True),
    ('level', 'LEVEL', some([-30, -21, 3, -20], 2), False)])
def test_whole_numbers_and_durations_are_those_of_brute_force(
        tmp_path: Path, paths: list[Path], name: str, id: str, values: Sequence[int],
        is_least: bool) -> None:
    bundle = write_bundle(tmp_path, BUNDLE)
    found = fit(bundle, paths, name, Selection())
    for value in (*values, int(found.value), int(found.tighter)):
        expected = value >= int(found.value) if is_least else value <= int(found.value)
        assert is_satisfied(bundle, paths, name, str(value), id) is expected
    assert found.is_least is is_least and found.is_monotone
    assert abs(int(found.value) - int(found.tighter)) == 1


@thorough
def test_verdicts_that_are_not_monotone_give_an_interval(
        tmp_path: Path, paths: list[Path]) -> None:
    text = BUNDLE.replace('"H (x < dead | x > dead + 1.0)"', '"H (k != 7) | dead > 1 & dead < 3"')
    found = fit(write_bundle(tmp_path, text.replace('dead: 0.25', 'dead: 2.0')), paths, 'dead',
                Selection())
    assert not found.is_monotone
    assert (float(found.value), found.other_end) == (nextafter(1, inf), repr(nextafter(3, -inf)))


@pytest.mark.parametrize(('name', 'expected'), [
    ('free', 'that was tried is satisfied: '), ('other', 'no value of'),
    ('lim', "has no constant 'lim'"), ('armed', 'only numbers are fitted')])
def test_what_has_no_tightest_value_is_refused(
        tmp_path: Path, paths: list[Path], name: str, expected: str) -> None:
    with pytest.raises(CompileError, match=expected):
        fit(write_bundle(tmp_path, BUNDLE), paths, name, Selection())


def test_a_constant_that_nothing_names_is_refused(tmp_path: Path, paths: list[Path]) -> None:
    text = SINGLE.replace('top: 9.0', 'top: 9.0, idle: 1')
    with pytest.raises(CompileError, match='no requirement names'):
        fit(write_bundle(tmp_path, text), paths, 'idle', Selection())


def test_recordings_without_a_message_are_refused(tmp_path: Path) -> None:
    empty = tmp_path / 'empty.csv'
    empty.write_text('time,f\n', encoding='utf-8')
    with pytest.raises(CompileError):
        fit(write_bundle(tmp_path, SINGLE), [empty], 'top', Selection())


def test_the_command_has_a_line_to_paste_and_takes_processes(
        tmp_path: Path, paths: list[Path], capsys: pytest.CaptureFixture[str]) -> None:
    bundle = write_bundle(tmp_path, BUNDLE)
    arguments = ['fit', str(bundle), *map(str, paths), '--constant', 'n', '--constant', 'level']
    assert main(arguments) == 0
    out = capsys.readouterr().out
    assert main([*arguments, '--json', '--jobs', '2']) == 0
    found: dict[str, Any] = json.loads(capsys.readouterr().out)['constants']
    assert f"constants:\n  n: {found['n']['value']}\n" in out
    assert f"  level: {found['level']['value']}\n" in out
    assert found['n']['requirement'] == 'SOON'
    assert main(['fit', str(bundle), str(paths[0]), '--constant', 'n=3']) == 1
    assert '--constant NAME, without a value' in capsys.readouterr().err
    # The next one has no value.
    assert main([*arguments[:-1], 'other']) == 1
    assert capsys.readouterr().out.startswith(f"n: 4 -> {found['n']['value']}, ")


def test_a_cluster_finds_the_same(
        tmp_path: Path, paths: list[Path], capsys: pytest.CaptureFixture[str],
        monkeypatch: pytest.MonkeyPatch) -> None:
    distributed = pytest.importorskip('distributed', reason='needs the extra dask')
    bundle = write_bundle(tmp_path, SINGLE)
    arguments = ['fit', str(bundle), *map(str, paths), '--constant', 'top']
    assert main(arguments) == 0
    expected = capsys.readouterr().out
    threads = set()

    def noted(*of: Any, **named: Any) -> RecordingResult:
        threads.add(current_thread())
        return judge(*of, **named)

    monkeypatch.setattr('fret_monitor.bag.fit.run', noted)
    with distributed.LocalCluster(
            n_workers=1, processes=False, dashboard_address='127.0.0.1:0',
            scheduler_kwargs={'dashboard': False}) as cluster:
        assert main([*arguments, '--dask', cluster.scheduler_address]) == 0
    assert threads - {main_thread()}
    assert capsys.readouterr().out == expected


def test_durations_under_timed_are_exact_to_a_unit(tmp_path: Path, paths: list[Path]) -> None:
    text = BUNDLE.replace('format: 1', 'format: 1\nevaluation: {policy: timed, unit: 0.001}')
    found = fit(write_bundle(tmp_path, text), paths, 'n', Selection())
    gaps = [int(later - earlier) for path in paths for earlier, later in pairwise(
        int(row['time']) for row in csv.DictReader(path.read_text().splitlines())
        if row['p'] == '1')]
    # A value holds until the next row, a second later.
    least = 1000 * (max(gaps) - 1)
    assert (int(found.value), int(found.tighter)) == (least, least - 1)
    assert found.kind == 'a number of steps or units' and found.deciding.requirement == 'SOON'


def test_other_constants_have_the_value_that_is_given(
        tmp_path: Path, paths: list[Path], capsys: pytest.CaptureFixture[str]) -> None:
    text = SINGLE.replace('top: 9.0', 'top: 9.0, by: 1.0').replace('f < top', 'f + by < top')
    bundle = write_bundle(tmp_path, text)
    assert main(['fit', str(bundle), *map(str, paths), '--json', '--constant', 'top',
                 '--constant', 'by=3']) == 0
    value = json.loads(capsys.readouterr().out)['constants']['top']['value']
    assert float(value) == pytest.approx(3 + max(column(paths, 'f')), rel=1e-6)


@pytest.mark.parametrize('values', [DOUBLES, SINGLES])
def test_keys_of_floats_are_in_their_order_without_a_gap(values: ConstantRange) -> None:
    make = float if values is DOUBLES else np.float32
    rng = Random(1)
    for _ in range(300):
        key = rng.randint(values.least, values.most - 1)
        one, other = make(values.text(key)), make(values.text(key + 1))
        assert np.nextafter(one, make(inf)) == other or one == other == 0
    assert np.isfinite(make(values.text(values.most)))
    assert values.text(values.key(Fraction(1, 4))) == '0.25'


def test_whole_numbers_are_their_own_keys() -> None:
    assert WHOLE.text(-3) == '-3'
    assert BOUNDS.least == 0
    assert BOUNDS.between(0, 10, 31) == list(range(1, 10))
    assert len(WHOLE.between(0, 2 ** 62, 31)) == 31


TWO = """format: 1
constants: {limit: 5.0}
inputs:
  x: {topic: /x, type: std_msgs/msg/Float64}
  u: {topic: /u, type: std_msgs/msg/Float64}
requirements:
  - {id: LATELY, ptltl: "H O[0,1] (x <= limit)"}
  - {id: OTHER, ptltl: "u < 3"}
"""


QUARTERS = ConstantRange('quarters', 0, 63, lambda key: str(key / 4),
                         lambda value: round(value * 4))


@pytest.mark.parametrize(('policy', 'by'), [
    ('every_message', 'whole'), ('relevant_message', 'without'), ('every_message', 'table.csv')])
def test_what_no_requirement_reads_that_names_the_constant_need_not_be_recorded(
        policy: str, by: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('fret_monitor.bag.fit.range_of', lambda *_, **__: QUARTERS)  # quicker
    bundle = write_bundle(tmp_path, TWO.replace(
        'format: 1', f'format: 1\nevaluation: {{policy: {policy}}}'))
    table = tmp_path / 'table.csv'
    table.write_text('time,x\n0,1.0\n1,6.0\n2,7.0\n')
    # A message of /u is a step under every_message, at which x is 8.5 still.
    whole = write(tmp_path / 'whole', [('/x', 0, 1.0), ('/u', 1, 2.0), ('/x', 2, 8.5),
                                       ('/u', 3, 2.0), ('/x', 4, 2.0)])
    without = write(tmp_path / 'without', [('/x', 0, 1.0), ('/x', 1, 6.5), ('/x', 2, 7.5)])
    paths = [table] if by == table.name else [table, whole, without]
    found = fit(bundle, paths, 'limit', Selection())
    assert found.deciding.path.name == by and found.is_monotone
    if by == table.name:
        assert (found.value, found.tighter) == ('6.0', '5.75')
        return
    for value, is_right in ((found.value, True), (found.tighter, False)):
        selection = Selection(may_miss=True, constants={
            'limit': Text.whole(Source('limit', value))})
        verdicts = [item.verdict for path in (whole, without)
                    for item in check_recording(bundle, path, selection).findings
                    if item.id == 'LATELY']
        assert (False not in verdicts) is is_right


def test_what_a_requirement_reads_that_names_the_constant_has_to_be_recorded(
        tmp_path: Path) -> None:
    bundle = write_bundle(tmp_path, TWO)
    path = write(tmp_path / 'other', [('/u', 1, 2.0)])
    with pytest.raises(CompileError, match='/x was not recorded'):
        fit(bundle, [path], 'limit', Selection())
