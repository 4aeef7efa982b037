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

"""`bag --margins`: how much time was left until the deadlines of FRETish sentences."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
import json
from math import ceil
from pathlib import Path
from random import Random
import subprocess
import sys
from typing import Any
from xml.etree import ElementTree

from bundles import write_bundle
from cli.command import run as run_apart, run_here as run
from differential.compiled import unoptimised
from fret_monitor.bag.check import (
    check_recording, compiled, read_bundle, RecordingResult, run as judge, Selection,
)
from fret_monitor.bag.findings import Findings, Slack
from fret_monitor.bag.fleet import asked
from fret_monitor.bag.trace import KeyedRowBatch, RowBatch, Trace
from fret_monitor.bag.trace_slack import slack_of_trace
from fret_monitor.messages.installed import find_message
import pytest
from strategies import some

BOUND = 4
LAST = 8  # the last row, a row a second
SECOND = 10**9
SENTENCES = {
    'GLOBAL': 'the c shall within {} satisfy r',
    'UPON': 'upon p the c shall within {} satisfy r',
    'WHENEVER': 'whenever p the c shall within {} satisfy r',
    'IN': 'in m mode the c shall within {} satisfy r',
    'IN_UPON': 'in m mode upon p the c shall within {} satisfy r & p',
    'AFTER': 'after m mode upon p the c shall within {} satisfy r',
    'BEFORE': 'before m mode whenever p the c shall within {} satisfy r',
    'ONLY': 'only in m mode upon p the c shall for {} satisfy r',
}
HEAD = {
    'ticks': 'format: 1\ninputs: {m: {type: bool}, p: {type: bool}, r: {type: bool}}\n',
    'seconds': 'format: 1\nevaluation: {policy: timed, unit: 1}\ninputs:\n' + ''.join(
        f'  {name}: {{type: bool, max_rate: 3}}\n' for name in 'mpr'),
}


def bundle_of(folder: Path, head: str, requirements: Iterator[tuple[str, str]],
              name: str) -> Path:
    """Write a bundle."""
    return write_bundle(folder, head + 'requirements:\n' + ''.join(
        f'  - {{id: {key}, fretish: "{text}"}}\n' for key, text in requirements), name)


def shortened(unit: str) -> Iterator[tuple[str, str]]:
    """Yield the sentences with each deadline, 0 to all rows, and those that deny a trigger."""
    for key, text in SENTENCES.items():
        for bound in range(LAST + 2):
            timing = 'within {}' if 'within' in text else 'for {}'
            yield f'{key}_{bound}', text.replace(
                timing, timing.format(f'{bound} {unit}') if bound else 'immediately')
        start = text[:text.index(' shall')]
        yield f'{key}_NEVER', f'{start} shall immediately satisfy ' + (
            'TRUE' if 'only' in text else 'FALSE')


def rows(rng: Random, unit: str) -> Iterator[str]:
    """Yield the rows of a random trace, in which values change now and then."""
    values = [rng.randrange(2) for _ in 'mpr']
    for second in range(LAST + 1):
        for place, odds in enumerate((0.25, 0.4, 0.3)):
            values[place] ^= rng.random() < odds
        yield ','.join(map(str, (second, *values)))
    if unit == 'seconds':  # the end is at no deadline
        yield ','.join(map(str, (f'{LAST}.5', *values)))


def with_slack(bundle: Path, path: Path, selection: Selection | None = None) -> RecordingResult:
    """Check a recording as `bag --margins` does."""
    chosen = selection or Selection(margins=True)
    return check_recording(bundle, path, chosen, asides=asked)


@pytest.mark.parametrize('unit', HEAD)
def test_the_slack_is_by_how_much_the_deadline_could_have_been_shorter(
    unit: str, tmp_path: Path,
) -> None:
    bundle = bundle_of(tmp_path, HEAD[unit], ((key, text.format(f'{BOUND} {unit}'))
                                              for key, text in SENTENCES.items()), 'bundle.yaml')
    oracle = bundle_of(tmp_path, HEAD[unit], shortened(unit), 'oracle.yaml')
    rng, path, kinds = Random(unit), tmp_path / 'trace.csv', set()
    with unoptimised():
        monitor = compiled(read_bundle(oracle, Selection(), find_message)).monitor
    for _ in range(8):
        path.write_text('\n'.join(['time,m,p,r', *rows(rng, unit)]) + '\n')
        expected = {item.id: item for item in judge(monitor, Trace(path), Selection()).findings}
        with unoptimised():
            found = with_slack(bundle, path).findings
        kinds |= {check(item, expected) for item in found}
    assert kinds == {'none', 'open', 'at once', 'early', 'late', 'never'}


def check(item: Findings, expected: dict[str, Findings]) -> str:
    """Compare a slack with the verdicts of shorter and longer deadlines; return its kind."""
    least = next(bound for bound in range(LAST + 2)
                 if expected[f'{item.id}_{bound}'].verdict is not False)
    slack, trigger = item.slack, expected[f'{item.id}_NEVER'].first
    missed = 0 if slack is None else ceil(BOUND - slack.left)
    waited = 0 if item.waiting is None else LAST + 1 - item.waiting // SECOND
    assert least == max(missed, waited), item
    assert waited <= BOUND
    assert (item.verdict is False) == (slack is not None and slack.left < 0)
    if slack is None:
        assert (trigger is None) == (item.waiting is None)
        return 'none' if trigger is None else 'open'
    if missed == 0:
        assert trigger == slack.trigger == slack.until
        return 'at once'
    first = expected[f'{item.id}_{missed - 1}'].first
    assert first is not None
    assert 0 <= first - slack.trigger - (missed - 1) * SECOND <= 2
    if slack.until is None:
        return 'never'
    assert slack.until == slack.trigger + missed * SECOND
    return 'early' if slack.left >= 0 else 'late'


LANDING = """
format: 1
inputs: {alarm: {type: bool}, height: {type: float64}}
requirements:
  - {id: LAND, fretish: upon alarm the drone shall within 3 ticks satisfy height < 1.0}
  - {id: LOW, fretish: the drone shall always satisfy height < 50.0}
  - {id: FAST, fretish: upon height > 9.0 the drone shall within 2 ticks satisfy alarm}
"""
ROWS = ['time,alarm,height', '0,0,5.0', '1,1,5.0', '2,1,0.5', '3,0,9.5', '4,0,8.0', '5,0,8.0',
        '6,1,8.0', '7,1,9.5']


def test_the_outputs_have_the_slack_and_say_what_is_open(tmp_path: Path) -> None:
    bundle, path = write_bundle(tmp_path, LANDING), tmp_path / 'run.csv'
    path.write_text('\n'.join(ROWS) + '\n')
    junit = tmp_path / 'junit.xml'
    done = run('bag', bundle, path, '--margins', '--junit', junit)
    assert done.status == 0, done.err
    cells = {line.split()[0]: line.split('  ') for line in done.out.splitlines()[1:]}
    ends = {name: [cell.strip() for cell in found if cell][-3:] for name, found in cells.items()}
    assert ends == {
        'requirement': ['slack', 'trigger', 'until'], 'LAND': ['2 steps, open', '1 s', '2 s'],
        'LOW': ['-', '-', '-'], 'FAST': ['-1 steps', '3 s', '6 s']}
    found = json.loads(run('bag', bundle, path, '--margins', '--json').out)['requirements']
    assert found['FAST']['slack'] == {
        'left': -1, 'unit': 'steps', 'trigger': '3.000000000', 'until': '6.000000000'}
    assert found['LAND']['waiting'] == '6.000000000'
    assert not {'slack', 'waiting'} & {*found['LOW']} and 'waiting' not in found['FAST']
    case = ElementTree.parse(junit).getroot().find("testsuite/testcase[@name='LAND']")
    assert case is not None
    assert [(each.get('name'), each.get('value')) for each in case.iter('property')][4:9] == [
        ('slack.left', '2'), ('slack.unit', 'steps'), ('slack.trigger', '1.000000000'),
        ('slack.until', '2.000000000'), ('waiting', '6.000000000')]
    assert 'slack' not in run('bag', bundle, path).out


def test_the_slack_of_a_bundle_with_a_period_is_in_seconds(tmp_path: Path) -> None:
    bundle = write_bundle(tmp_path, LANDING.replace(
        'format: 1', 'format: 1\nevaluation: {policy: periodic, period: 0.25}').replace(
        '3 ticks', '1 second').replace('2 ticks', '0.5 seconds'))
    path = tmp_path / 'run.csv'
    path.write_text('\n'.join(ROWS) + '\n')
    land, _, fast = with_slack(bundle, path).findings
    assert land.slack == Slack(0.75, 's', 1 * SECOND, 2 * SECOND)
    assert fast.slack == Slack(-0.25, 's', 3 * SECOND, 6 * SECOND)


def test_margins_and_triggers_take_one_reading(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    bundle, path = write_bundle(tmp_path, LANDING), tmp_path / 'run.csv'
    path.write_text('\n'.join(ROWS) + '\n')
    readings: list[Trace] = []

    def batches(trace: Trace, *of: Any) -> Iterator[RowBatch | KeyedRowBatch]:
        readings.append(trace)
        return original(trace, *of)

    original = Trace.batches
    monkeypatch.setattr(Trace, 'batches', batches)
    found = with_slack(bundle, path, Selection(margins=True, triggers=True)).findings
    assert len(readings) == 1
    assert [(item.slack is None, item.triggered) for item in found] == [
        (False, True), (True, True), (False, True)]


def test_what_was_compiled_before_needs_no_parser(tmp_path: Path) -> None:
    bundle, path = write_bundle(tmp_path, LANDING), tmp_path / 'run.csv'
    path.write_text('\n'.join(ROWS) + '\n')
    run('bag', bundle, path, '--margins', '--triggers')
    script = ('import sys\nfrom fret_monitor.cli.main import main\nmain(sys.argv[1:])\n'
              'print(*sys.modules)')
    done = subprocess.run(
        [sys.executable, '-c', script, 'bag', bundle, path, '--margins', '--triggers'],
        capture_output=True, text=True, check=True)
    assert '2 steps, open' in done.stdout
    modules = done.stdout.splitlines()[-1].split()
    assert 'fret_monitor.bag.slack' in modules
    assert {'fret_monitor.build', 'fret_monitor.bag.deadlines', 'lark'}.isdisjoint(modules)


def test_recordings_are_ranked_by_their_slack(tmp_path: Path) -> None:
    bundle = write_bundle(tmp_path, LANDING)
    late, early = tmp_path / 'late.csv', tmp_path / 'early.csv'
    late.write_text('\n'.join(ROWS) + '\n')
    early.write_text('\n'.join([*ROWS[:5], '4,1,8.0']) + '\n')
    lines = run('bag', bundle, early, late, '--margins').out.splitlines()
    found = [line.split() for line in lines[lines.index('slack, over 2 recordings:') + 1:]]
    assert [(name, Path(path).name, *rest) for name, path, *rest in found[1:]] == [
        ('LAND', 'early.csv', '2', 'steps', '1.000000000', '2.000000000'),
        ('LAND', 'late.csv', '2', 'steps', '1.000000000', '2.000000000'),
        ('FAST', 'late.csv', '-1', 'steps', '3.000000000', '6.000000000'),
        ('FAST', 'early.csv', '1', 'steps', '3.000000000', '4.000000000')]


@pytest.mark.parametrize('unit', some([*HEAD], 2))
def test_simulate_finds_the_slack_that_bag_finds(unit: str, tmp_path: Path) -> None:
    bundle = bundle_of(tmp_path, HEAD[unit], ((key, text.format(f'{BOUND} {unit}'))
                                              for key, text in SENTENCES.items()), 'bundle.yaml')
    rng, path, n = Random(f'{unit} simulate'), tmp_path / 'trace.csv', 0
    reading = read_bundle(bundle, Selection(), find_message)
    scale = 1 if unit == 'seconds' else SECOND  # a step of simulate is a row, a second apart

    def scaled(item: Slack) -> Slack:
        until = None if item.until is None else item.until * scale
        return replace(item, trigger=item.trigger * scale, until=until)

    for _ in range(3):
        path.write_text('\n'.join(['time,m,p,r', *rows(rng, unit)]) + '\n')
        with unoptimised():
            found = slack_of_trace(reading, find_message, path) or {}
            expected = with_slack(bundle, path).findings
        for item in expected:
            own = found[item.id]
            assert own.slack is None if item.slack is None else (
                own.slack is not None and scaled(own.slack) == item.slack)
            assert item.waiting == (None if own.waiting is None else own.waiting * scale)
            assert [*map(scaled, own.slacks)] == [*item.slacks]
            n += len(item.slacks)
    assert n > 5


KEYED_HEAD = {
    'ticks': 'format: 1\nfor_each: {{robot: {{most: 3{forget}}}}}\ninputs: {inputs}\n',
    'seconds': 'format: 1\nevaluation: {{policy: timed, unit: 1}}\n'
               'for_each: {{robot: {{most: 3{forget}}}}}\ninputs: {inputs}\n'}


def keyed_rows(rng: Random, times: list[str]) -> Iterator[str]:
    """Yield rows of instances that begin and end, in which values change now and then."""
    for time in times:
        key, m, *own = rng.choice(['a', 'b', '']), rng.randrange(2), \
            rng.random() < 0.3, rng.random() < 0.2
        shared = m if not key or rng.random() < 0.3 else ''
        yield f'{time},{key},{shared},' + (','.join(f'{each:d}' for each in own) if key else ',')


def shown(slack: Slack | None, instants: dict[int, int]) -> Slack | None:
    """Return a slack with its instants as `simulate` shows them."""
    return slack and replace(slack, trigger=instants[slack.trigger],
                             until=None if slack.until is None else instants[slack.until])


@pytest.mark.parametrize(('unit', 'forget'), some([
    ('ticks', ''), ('ticks', ', forget: 4'), ('seconds', ', forget: 4')], 2))
def test_simulate_finds_the_slack_of_each_instance_that_bag_finds(
        unit: str, forget: str, tmp_path: Path) -> None:
    inputs = '{m: {topic: /m, type: std_msgs/msg/Bool, max_rate: 5}, ' + ', '.join(
        f'{name}: {{topic: "/{{robot}}/{name}", type: std_msgs/msg/Bool, max_rate: 5}}'
        for name in 'pr') + '}'
    bundle = bundle_of(tmp_path, KEYED_HEAD[unit].format(forget=forget, inputs=inputs), iter([
        *((key, SENTENCES[key].format(f'{BOUND} {unit}')) for key in ('UPON', 'IN', 'ONLY')),
        ('SHARED', 'upon m the c shall within 2 ' + unit + ' satisfy !m')]), 'bundle.yaml')
    rng, path = Random(f'{unit} {forget}'), tmp_path / 'trace.csv'
    reading = read_bundle(bundle, Selection(), find_message)
    found_of: Counter[bytes | None] = Counter()
    for _ in range(3):
        times, at = [], 0
        for _ in range(40):
            at += rng.choice([1, 1, 2, 9])
            times.append(at)
        path.write_text('\n'.join(['time,robot,m,p,r', *keyed_rows(rng, [*map(str, times)])]))
        instants = {time * SECOND: row for row, time in enumerate(times)} \
            if unit == 'ticks' else {time * SECOND: time * SECOND for time in times}
        with unoptimised():
            found = slack_of_trace(reading, find_message, path) or {}
            expected = with_slack(bundle, path).findings
        for item in expected:
            own = found[item.id]
            assert own.slack == shown(item.slack, instants)
            assert own.waiting == (item.waiting and instants[item.waiting])
            assert own.slack_of == {
                key: shown(one, instants) for key, one in item.slack_of.items()}
            assert [*own.slacks] == [shown(one, instants) for one in item.slacks]
            found_of.update([*item.slack_of] if item.variables else [None])
    assert {*found_of} == {None, b'a', b'b'} and min(found_of.values()) > 2


def test_each_trigger_that_is_not_answered_at_once_has_its_slack(tmp_path: Path) -> None:
    bundle = bundle_of(tmp_path, HEAD['ticks'], iter([
        ('UPON', SENTENCES['UPON'].format(f'{BOUND} ticks'))]), 'bundle.yaml')
    rng, path = Random(7), tmp_path / 'trace.csv'
    found = [(rng.random() < 0.4, rng.random() < 0.15) for _ in range(80)]
    found += [(False, True), (True, False), *[(False, False)] * BOUND]  # the last one: no answer
    path.write_text('\n'.join(['time,m,p,r', *(
        f'{k},0,{p:d},{r:d}' for k, (p, r) in enumerate(found))]) + '\n')
    waits: list[tuple[int, int | None]] = []
    for k, (p, r) in enumerate(found):
        is_waiting = bool(waits) and waits[-1][1] is None
        if is_waiting and r:
            waits[-1] = waits[-1][0], k
        elif not is_waiting and not r and p and not (k and found[k - 1][0]):
            waits.append((k, None))
    item, = with_slack(bundle, path).findings
    expected = [(BOUND - ((len(found) if until is None else until) - trigger), trigger * SECOND,
                 None if until is None else until * SECOND) for trigger, until in waits]
    assert [(each.left, each.trigger, each.until) for each in item.slacks] == expected
    assert len(expected) > 5 and expected[-1] == (-1, 81 * SECOND, None)


def test_simulate_says_the_slack_of_a_trace(tmp_path: Path) -> None:
    bundle, path = write_bundle(tmp_path, LANDING), tmp_path / 'run.csv'
    path.write_text('\n'.join(ROWS) + '\n')
    table = tmp_path / 'margins.csv'
    lines = ['LAND: least slack 2 steps, trigger at step 1, response at step 2',
             'FAST: least slack -1 steps, trigger at step 3, response at step 6']
    arguments = ('simulate', bundle, '--trace', path, '--margins', table)
    with unoptimised():
        assert run(*arguments).err.splitlines() == lines
        done = run(*arguments, '--verdicts', tmp_path / 'verdicts.csv')
        assert [line for line in done.out.splitlines() if 'slack' in line] == lines
        found = json.loads(run(*arguments, '--json').out)
    land, low, fast = found['requirements']
    assert land['slack'] == {'left': 2, 'unit': 'steps', 'trigger': 1, 'until': 2}
    assert land['waiting'] == 6 and not {'slack', 'waiting'} & {*low}
    assert fast['slack']['left'] == -1 and 'waiting' not in fast


def test_the_margins_of_a_pipe_come_without_slack(tmp_path: Path) -> None:
    bundle, table = write_bundle(tmp_path, LANDING), tmp_path / 'margins.csv'
    with unoptimised():
        done = run_apart('simulate', bundle, '--trace', '/dev/stdin', '--margins', table,
                         stdin='\n'.join(ROWS) + '\n')
    assert done.status == 0 and done.out.count('\n') == table.read_text().count('LAND') + 1 == 9
    assert done.err == ('slack is not looked for: that takes a second reading of the trace, and a '
                        'pipe is read once\n')


def test_simulate_says_the_slack_of_instances_the_least_first(tmp_path: Path) -> None:
    bundle = write_bundle(tmp_path, LANDING.replace('inputs: {', 'for_each: {drone: {most: 20}}\n'
                          'inputs: {').replace('type: bool', 'topic: "/{drone}/a", type: '
                          'std_msgs/msg/Bool').replace('type: float64', 'topic: "/{drone}/h", '
                                                       'type: std_msgs/msg/Float64'))
    path = tmp_path / 'run.csv'
    path.write_text('drone,alarm,height\n' + ''.join(
        f'd{k:02},{step == 0:d},{5.0 if step < min(k, 3) else 0.5}\n'
        for step in range(4) for k in range(12)))
    arguments = ('simulate', bundle, '--trace', path, '--margins', tmp_path / 'margins.csv')
    with unoptimised():
        lines = run(*arguments).err.splitlines()
        found = json.loads(run(*arguments, '--json').out)['requirements'][0]
    assert lines == [
        'LAND: least slack 0 steps, trigger at step 3, response at step 39',
        *(f'LAND[drone=d{k:02}]: least slack {3 - min(k, 3)} steps, trigger at step {k}, '
          f'response at step {k + 12 * min(k, 3)}' for k in (*range(3, 12), 2))]
    assert [found['slack_of'][f'd{k:02}']['left'] for k in range(12)] == [3, 2, 1] + 9 * [0]
    assert found['slack'] == found['slack_of']['d03'] == {
        'left': 0, 'unit': 'steps', 'trigger': 3, 'until': 39, 'key': 'drone=d03'}


def test_a_report_has_the_least_slacks_and_that_of_each_occurrence(tmp_path: Path) -> None:
    bundle, path, report = (write_bundle(tmp_path, LANDING), tmp_path / 'run.csv',
                            tmp_path / 'report.html')
    path.write_text('\n'.join(ROWS) + '\n')
    with unoptimised():
        assert run('bag', bundle, path, '--margins', '--report', report).status == 0
    land, low, fast = report.read_text().split('<article')[1:]
    assert '<p>Least slack: 2 steps.</p>' in land
    assert 'slack' not in low.split('</article>')[0].lower()
    assert '<p>Least slack: -1 steps.</p>' in fast
    assert '<td>3 s</td><td>6 s</td><td>-1 steps</td>' in fast
    assert '<br>Slack: -1 steps.' in fast


def test_a_trace_needs_no_reader_of_recordings(tmp_path: Path) -> None:
    bundle, path = write_bundle(tmp_path, LANDING), tmp_path / 'run.csv'
    path.write_text('\n'.join(ROWS) + '\n')
    script = ('import sys\nsys.modules["rosbags"] = None\n'
              'from fret_monitor.cli.main import main\nmain(sys.argv[1:])')
    done = subprocess.run(
        [sys.executable, '-c', script, 'simulate', bundle, '--trace', path,
         '--margins', tmp_path / 'margins.csv'], capture_output=True, text=True, check=False)
    assert 'LAND: least slack 2 steps' in done.stderr
