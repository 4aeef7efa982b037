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

"""`bag --triggers` and `check --trace`: which requirements were exercised, and by what."""

import json
import os
from pathlib import Path
import re
from xml.etree import ElementTree

from bag.recordings import write
from bundles import write_bundle
from cli.command import Here
from fret_monitor.bag.check import check_recording, Selection
from fret_monitor.bag.fleet import asked
from fret_monitor.model.diagnostics import CompileError
import pytest

BUNDLE = """
format: 1
component: rover
inputs:
  speed: {topic: odom, type: std_msgs/msg/Float64, max_rate: 10}
  armed: {topic: arm, type: std_msgs/msg/Bool, max_rate: 10}
requirements:
  - {id: WHEN, fretish: when armed the rover shall within 2 ticks satisfy speed < 1.0}
  - {id: IN, fretish: in armed mode the rover shall always satisfy speed < 9.0, source: "SRS 4.1"}
  - {id: LEFT, ptltl: "H (speed > 7.0 -> O armed)"}
  - {id: ALWAYS, fretish: the rover shall always satisfy speed <= 20.0}
  - {id: MLTL, mltl: "armed -> F[0,1] (speed < 1.0)"}
"""
TIMED = BUNDLE.replace('component', 'evaluation: {policy: timed, unit: 1}\ncomponent').replace(
    '2 ticks', '2 seconds')
QUIET = ['0,0,0', '1,8,0', '2,0,0', '9,0,0']
ARMED = ['0,0,0', '1,0,1', '2,0,0', '9,0,0']
BROKEN = ['0,0,0', '1,9.5,1', '2,8,1', '9,8,1']
CAME = {'quiet': {'LEFT', 'ALWAYS'}, 'armed': {'WHEN', 'IN', 'ALWAYS', 'MLTL'},
        'broken': {'WHEN', 'IN', 'LEFT', 'ALWAYS', 'MLTL'}}
HEADS = 'time,speed,armed'


def traces(folder: Path) -> list[Path]:
    """Write the traces."""
    found = []
    for name, rows in (('quiet', QUIET), ('armed', ARMED), ('broken', BROKEN)):
        found.append(folder / f'{name}.csv')
        found[-1].write_text('\n'.join([HEADS, *rows]) + '\n')
    return found


@pytest.mark.parametrize('text', [BUNDLE, TIMED])
def test_a_trigger_came_where_a_condition_held(text: str, tmp_path: Path) -> None:
    bundle, selection = write_bundle(tmp_path, text), Selection(triggers=True)
    for path in traces(tmp_path):
        result = check_recording(bundle, path, selection, asides=asked)
        assert {item.id for item in result.findings if item.triggered} == CAME[path.stem]
        assert all(item.triggered or item.verdict for item in result.findings)


def test_without_the_option_nothing_is_said_of_triggers(tmp_path: Path) -> None:
    bundle, (quiet, *_) = write_bundle(tmp_path, BUNDLE), traces(tmp_path)
    result = check_recording(bundle, quiet, Selection(), asides=asked)
    assert {item.triggered for item in result.findings} == {None}


def test_a_requirement_that_is_not_judged_is_not_triggered(tmp_path: Path) -> None:
    bundle = write_bundle(tmp_path, BUNDLE)
    bag = write(tmp_path / 'run', [('odom', 0, 1.0), ('odom', 1, 1.0)])
    selection = Selection(may_miss=True, triggers=True)
    result = check_recording(bundle, bag, selection, asides=asked)
    assert {item.id: item.triggered for item in result.findings} == {
        'WHEN': False, 'IN': False, 'LEFT': False, 'ALWAYS': True, 'MLTL': False}


def test_instances_are_refused(tmp_path: Path) -> None:
    bundle = write_bundle(tmp_path, """
format: 1
for_each: {robot: [a, b]}
inputs: {x: {topic: "/{robot}/x", type: std_msgs/msg/Float64}}
requirements: [{id: R, ptltl: "x <= 5.0"}]
""")
    bag = write(tmp_path / 'run', [('/a/x', 0, 1.0), ('/b/x', 1, 1.0)])
    selection = Selection(triggers=True)
    with pytest.raises(CompileError, match='for_each'):
        check_recording(bundle, bag, selection, asides=asked)


def test_a_silent_input_is_no_trigger(tmp_path: Path) -> None:
    bundle = write_bundle(tmp_path, """
format: 1
evaluation: {policy: timed}
inputs: {x: {topic: x, type: std_msgs/msg/Float64, timeout: 1, stale: violate}}
requirements: [{id: R, ptltl: "H (x > 7.0 -> x < 9.0)"}]
""")
    bag = write(tmp_path / 'run', [('x', 0, 1.0), ('x', 8 * 10**9, 1.0)])
    found, = check_recording(bundle, bag, Selection(triggers=True), asides=asked).findings
    assert found.verdict is False and found.triggered is False


def test_a_table_names_what_exercised_each_requirement(here: Here) -> None:
    bundle = here.file('rover.yaml', BUNDLE)
    folder, results, junit = (here.folder / name for name in ('tests', 'r.jsonl', 'j.xml'))
    quiet, armed, broken = traces(here.folder)
    done = here.run('bag', bundle, quiet, armed, '--triggers', '--results', results,
                    '--missing-topics', 'ok')
    assert done.status == 0 and 'WHEN         satisfied, never triggered' in done.out
    assert here.run('bag', bundle, broken, '--triggers', '--junit', junit).status == 0
    case = ElementTree.parse(junit).getroot().find(".//testcase[@name='IN']/properties/property")
    assert case is not None and case.attrib == {'name': 'triggered', 'value': 'true'}
    assert here.run('tests', bundle, '--output', folder).status == 0
    found = json.loads(here.run('check', bundle, '--trace', folder, results, junit,
                                '--json').out)['bundles'][0]['trace']
    assert [item['source'] for item in found] == ['WHEN', 'SRS 4.1', 'LEFT', 'ALWAYS', 'MLTL']
    assert (found[0]['inputs'], found[0]['topics']) == (['speed', 'armed'], ['odom', 'arm'])
    for item in found:
        assert [seen['triggered'] for seen in item['recordings']] == [
            item['id'] in CAME[name] for name in ('quiet', 'armed', 'broken')]
        assert all((folder / name).is_file() for name in item['tests']) and item['tests']
    verdicts = {item['id']: [seen['verdict'] for seen in item['recordings']] for item in found}
    assert verdicts['IN'] == [True, True, False] and verdicts['LEFT'] == [False, True, True]


def test_the_table_says_what_was_never_triggered_and_what_is_not_known(here: Here) -> None:
    bundle = here.file('rover.yaml', BUNDLE)
    quiet, armed, _ = traces(here.folder)
    with_them, without = here.folder / 'with.jsonl', here.folder / 'without.jsonl'
    here.run('bag', bundle, quiet, '--triggers', '--results', with_them)
    here.run('bag', bundle, armed, '--results', without)
    lines = here.run('check', bundle, '--trace', with_them).out.splitlines()
    assert [line.split() for line in lines if line.startswith('IN ')] == [
        ['IN', 'SRS', '4.1', 'speed,', 'armed', 'odom,', 'arm', '-', 'never', 'triggered']]
    assert lines[-1] == 'never triggered in 1 recording: WHEN, IN, MLTL'
    lines = here.run('check', bundle, '--trace', with_them, without).out.splitlines()
    assert lines[-1] == 'triggered or not? `bag --triggers` finds out: WHEN, IN, MLTL'
    assert f'{armed}?' in '\n'.join(lines)
    lines = here.run('check', bundle, '--trace').out.splitlines()
    assert lines[2].split() == ['id', 'source', 'inputs', 'topics']
    assert 'never' not in '\n'.join(lines)


def test_only_the_last_results_of_the_same_text_count(here: Here) -> None:
    bundle, results = here.file('rover.yaml', BUNDLE), here.folder / 'r.jsonl'
    junit = here.folder / 'j.xml'
    *_, broken = traces(here.folder)
    for _ in range(2):
        here.run('bag', bundle, broken, '--results', results, '--junit', junit, '--triggers')
    lines = results.read_text()
    results.write_text(lines + lines)  # as of a recording that was judged twice
    trace = ('check', bundle, '--trace', results, junit)
    assert here.run(*trace).out.count(str(broken)) == 5
    here.file('rover.yaml', BUNDLE.replace('speed < 9.0', 'speed < 99.0').replace('LEFT', 'NEW'))
    said = here.run(*trace)
    rows = {line.split()[0]: line for line in said.out.splitlines() if line}
    assert rows['IN'].split()[-3:] == ['-', 'not', 'judged']
    assert f'IN: results of another text or formula are left out: {broken}' in said.out
    assert 'not judged in 1 recording: IN, NEW\n' in said.out and 'never' not in said.out
    assert 'in no bundle here: LEFT' in said.err
    found = {item['id']: item for item in json.loads(
        here.run(*trace, '--json').out)['bundles'][0]['trace']}
    assert found['IN']['recordings'] == [] and found['IN']['outdated'] == [str(broken)]
    assert len(found['WHEN']['recordings']) == 1 and found['WHEN']['outdated'] == []


def test_a_constant_that_changes_a_requirement_makes_its_results_old(here: Here) -> None:
    text = BUNDLE.replace('inputs:', 'constants: {TOP: 20.0}\ninputs:')
    bundle = here.file('rover.yaml', text.replace('speed <= 20.0', 'speed <= TOP'))
    results = here.folder / 'r.jsonl'
    *_, broken = traces(here.folder)
    here.run('bag', bundle, broken, '--results', results, '--constant', 'TOP=5.0')
    said = here.run('check', bundle, '--trace', results)
    assert 'ALWAYS: results of another text or formula are left out' in said.out
    said = here.run('check', bundle, '--trace', results, '--constant', 'TOP=5.0')
    assert 'are left out' not in said.out and said.out.count('violated') == 4


def test_texts_of_results_do_not_control_the_terminal(here: Here) -> None:
    bundle, results = here.file('rover.yaml', BUNDLE), here.folder / 'r.jsonl'
    quiet, *_ = traces(here.folder)
    here.run('bag', bundle, quiet, '--results', results)
    line = json.loads(results.read_text())
    line['bag'] = 'x\x1b[31m\nred'
    line['requirements']['gone\x1b[31m'] = line['requirements']['IN']
    results.write_text(json.dumps(line))
    said = here.run('check', bundle, '--trace', results)
    assert 'x\ufffd[31m\ufffdred' in said.out and 'gone\ufffd' in said.err
    assert '\x1b' not in said.out + said.err


def test_files_that_are_no_results_are_refused(here: Here) -> None:
    bundle = here.file('rover.yaml', BUNDLE)
    bomb = here.file('bomb.xml', '<!DOCTYPE a [<!ENTITY b "cc">]><testsuites>&b;</testsuites>')
    wrong = here.file('wrong.jsonl', '[1]\n{"bag": 1}\n')
    foreign = here.file('foreign.xml', '<testsuites><testsuite name="pytest"><testcase name="IN"/>'
                        '</testsuite></testsuites>')
    pipe = here.folder / 'pipe.jsonl'
    os.mkfifo(pipe)
    for path, message in ((bomb, 'declares a document type'), (wrong, 'has no results'),
                          (foreign, 'has no results'), (pipe, 'is a named pipe'),
                          (here.folder, 'tests.json'), (here.folder / 'none', 'none')):
        done = here.run('check', bundle, '--trace', path)
        assert (done.status, message in done.err) == (1, True), done.err
    cut = here.file('cut.jsonl', json.dumps({'bag': 'run', 'requirements': {
        'OLD': {'verdict': True}}}) + '\n{"bag": "ru')
    done = here.run('check', bundle, '--trace', cut)
    assert done.status == 0 and f'{cut}:2:1: warning: {cut}: this line has no results' in done.err
    assert 'that are in no bundle here: OLD' in done.err


def test_other_verdicts_of_a_recording_with_one_name_are_told(here: Here) -> None:
    bundle = here.file('rover.yaml', BUNDLE)
    results = [here.file(f'{name}.jsonl', json.dumps({'bag': bag, 'requirements': {
        'IN': {'verdict': verdict, 'meaning': 'm'}}})) for name, bag, verdict in (
            ('mon', 'run.csv', True), ('tue', 'run.csv', False), ('far', 'tue/run.csv', False))]
    assert "tue.jsonl: 'run.csv' has other verdicts than before: IN" in here.run(
        'check', bundle, '--trace', *results[:2]).err
    for known in (results[0], results[2]):
        assert 'than before' not in here.run('check', bundle, '--trace', results[0], known).err


def test_recordings_of_one_name_are_told_apart_by_their_content(
        here: Here, monkeypatch: pytest.MonkeyPatch) -> None:
    bundle = here.file('rover.yaml', BUNDLE)
    results = []
    for day, speed in (('mon', '1.0'), ('tue', '1.5')):
        (here.folder / day).mkdir()
        monkeypatch.chdir(here.folder / day)
        Path('run.csv').write_text(f'time,speed,armed\n0,{speed},0\n')
        results.append(here.folder / f'{day}.jsonl')
        here.run('bag', bundle, 'run.csv', '--results', results[-1])
    both = here.run('check', bundle, '--trace', *results)
    one = r'run\.csv \([0-9a-f]{8}\)\?'
    assert re.search(f'ALWAYS .* {one}, {one} ', both.out)
    assert 'than before' not in both.err
    twice = here.run('check', bundle, '--trace', results[0], results[0]).out
    assert ' run.csv? ' in twice
    # A file has two lines of a recording that has changed: the last one counts.
    changed = here.file('changed.jsonl', ''.join(path.read_text() for path in results))
    assert ' run.csv? ' in here.run('check', bundle, '--trace', changed).out
