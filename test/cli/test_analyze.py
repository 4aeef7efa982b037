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

"""`fret-monitor analyze`: answers as text and JSON, and runs for `simulate`."""

import json
import os
from pathlib import Path
import signal
import threading

from cli.command import Here
import pytest

pytest.importorskip('z3')
pytest.importorskip('dd')

VALVES = """\
format: 1
inputs:
  start: {type: bool}
  stop: {type: bool}
  level: {type: float32}
  valve: {type: bool, role: output}
  pump: {type: float64, role: output}
requirements:
  - {id: V-1, fretish: when start the mixer shall immediately satisfy valve}
  - {id: V-2, fretish: when stop the mixer shall immediately satisfy !valve}
  - {id: P-1, ptltl: "H (level > 2.0 -> pump >= 1.0)"}
  - {id: P-2, ptltl: "H (level > 3.0 -> pump > 0.5)"}
  - {id: P-3, ptltl: "H (level > 3.0 & level < 2.0 -> pump = 0.0)"}
"""


def test_text_json_and_runs_say_the_same(here: Here) -> None:
    bundle = here.file('valves.yaml', VALVES)
    done = here.run('analyze', bundle)
    assert (done.status, done.err) == (1, '')
    assert done.out.startswith('consistent            yes\n')
    assert '    conflict: V-1, V-2\n    a run at whose end V-2 is violated\n' in done.out
    for line in ('      verdict  x', 'redundant             P-2, P-3', 'vacuous               P-3',
                 '  P-3: never violated by finite numbers (confirmed by z3)'):
        assert line in done.out.splitlines(), done.out
    runs = here.folder / 'runs'
    runs.mkdir()
    (runs / 'consistency_2.csv').touch()  # of an earlier analysis
    (runs / 'mine.csv').touch()
    done = here.run('analyze', bundle, '--json', '-o', runs)
    found = json.loads(done.out)
    assert {key: found[key] for key in ('consistent', 'rt_consistent', 'vacuous', 'redundant')} \
        == {'consistent': True, 'rt_consistent': True, 'vacuous': ['P-3'],
            'redundant': ['P-2', 'P-3']}
    assert found['components'] == [
        {'outputs': ['valve'], 'requirements': ['V-1', 'V-2'], 'realizable': False,
         'conflicts': [['V-1', 'V-2']]},
        {'outputs': ['pump'], 'requirements': ['P-1', 'P-2', 'P-3'], 'realizable': True,
         'conflicts': []}]
    run, mine = sorted(runs.iterdir(), reverse=True)
    assert mine.name == 'mine.csv'
    done = here.run('simulate', bundle, '--trace', run)
    assert done.out.splitlines()[-1] == '0,1,0,1,1,1'


def test_runs_that_could_not_be_written_are_refused_before_the_analysis(
        here: Here, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('fret_monitor.analysis.checks.analyze', None)
    bundle = here.file('consistency.csv', VALVES)
    for out, error in ((bundle, f"'{bundle}' is a file"),
                       (here.folder, f"'{bundle}': this command reads it")):
        done = here.run('analyze', bundle, '-o', out)
        assert (done.status, done.out) == (1, '')
        assert done.err.startswith('error: cannot write ') and error in done.err
    assert bundle.read_text() == VALVES


def test_a_run_into_a_dead_end_shows_what_leads_there(here: Here) -> None:
    bundle = here.file('b.yaml', VALVES.partition('requirements')[0] + (
        'requirements:\n'
        '  - {id: A, fretish: when start the mixer shall within 3 ticks satisfy valve}\n'
        '  - {id: B, ptltl: "H !valve"}\n'))
    done = here.run('analyze', bundle, '--only', 'rt-consistency')
    assert done.status == 1
    for line in ('      start    ####', '      valve    ...#', '      verdict  ###x'):
        assert line in done.out.splitlines(), done.out


def test_check_warns_of_what_is_found_soon(here: Here) -> None:
    done = here.run('check', '--analyze', here.file('valves.yaml', VALVES))
    assert done.status == 0
    assert 'warning: V-1, V-2 are not realizable' in done.err
    assert 'warning: P-2 is redundant' in done.err


def test_reachability_needs_a_diagram(here: Here) -> None:
    done = here.run('analyze', here.file('valves.yaml', VALVES), '--only', 'reachability')
    assert (done.status, done.out) == (1, '')
    assert 'no requirement is that a state follows a diagram' in done.err
    done = here.run('analyze', here.file('d.yaml', (
        'format: 1\ninputs: {s: {type: int8}}\nrequirements:\n'
        '  - {id: D, ptltl: "(Y (s = 1) -> s = 1) & (Y (s = 2) -> s = 2)"}\n')), '--json')
    assert done.status == 1
    assert (json.loads(done.out)['unreached'], json.loads(done.out)['unreached_unknown']) == (
        ['D'], [])


def test_one_question_leaves_the_others_open(here: Here) -> None:
    bundle = here.file('valves.yaml', VALVES)
    done = here.run('analyze', bundle, '--only', 'consistency', '--json')
    assert done.status == 0
    found = json.loads(done.out)
    assert (found['consistent'], found['rt_consistent'], found['vacuous'],
            found['components']) == (True, None, None, None)


def test_without_outputs_realizability_is_refused_or_left_out(here: Here) -> None:
    bundle = here.file('b.yaml', VALVES.replace(', role: output', ''))
    done = here.run('analyze', bundle, '--only', 'realizability')
    assert done.status == 1
    assert 'error: no input is an output of the system' in done.err
    assert 'role: output' in done.err
    done = here.run('analyze', bundle, '--json')
    found = json.loads(done.out)
    assert found['components'] is None and found['consistent'] is True
    assert found['diagnostics'][0]['level'] == 'warning'


def test_an_assumption_about_outputs_of_the_same_step_gets_a_warning(here: Here) -> None:
    bundle = here.file('valves.yaml', VALVES + (
        '  - {id: A-1, ptltl: "H (valve -> !stop)", assume: true}\n'
        '  - {id: A-2, ptltl: "H (Y valve -> !start)", assume: true}\n'))
    done = here.run('analyze', bundle, '--only', 'realizability')
    assert done.status == 1
    assert 'warning: the assumption A-1 reads valve of the same step' in done.err
    assert 'A-2' not in done.err
    assert '  no       valve: V-1, V-2, A-1, A-2' in done.out


def test_missing_packages_are_named_with_the_command(
        here: Here, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('fret_monitor.model.diagnostics.find_spec', lambda name: None)
    done = here.run('analyze', here.file('valves.yaml', VALVES))
    assert done.status == 1
    assert '`analyze` needs dd and z3-solver, which are not installed' in done.err
    assert 'pip install' in done.err and ' dd z3-solver' in done.err


def test_an_interrupt_leaves_partial_answers(here: Here) -> None:
    # 2^50 rounds would be needed.
    needs = ['FTP -> p', 'Y p -> p', '!(p S[>=100000000] FTP)']
    lines = '\n'.join(f'  - {{id: R{number}, ptltl: "H ({item})"}}'
                      for number, item in enumerate(needs))
    bundle = here.file('b.yaml', 'format: 1\ninputs: {p: {type: bool}, q: {type: bool}}\n'
                       f'requirements:\n{lines}\n  - {{id: Q, ptltl: H q}}\n')
    threading.Timer(1.0, os.kill, (os.getpid(), signal.SIGINT)).start()
    done = here.run('analyze', bundle, '--only', 'consistency')
    assert done.status == 1
    assert 'unknown' in done.out and '(interrupted)' in done.out
    assert 'The analysis was stopped early' in done.out


def test_json_tells_what_is_unknown_from_what_is_not_so(here: Here) -> None:
    bundle = here.file('valves.yaml', VALVES)
    full = json.loads(here.run('analyze', bundle, '--only', 'vacuity', '--json').out)
    assert [full[key] for key in ('vacuous', 'vacuous_unknown', 'redundant_unknown', 'partial')] \
        == [['P-3'], [], None, False]
    done = here.run('analyze', bundle, '--json', '--timeout', '0.001')
    assert done.status == 1
    none = json.loads(done.out)
    ids = ['V-1', 'V-2', 'P-1', 'P-2', 'P-3']
    assert [none[key] for key in ('vacuous', 'vacuous_unknown', 'redundant', 'redundant_unknown',
                                  'partial')] == [[], ids, [], ids, True]


def test_wrong_limits_are_wrong_usage(here: Here) -> None:
    assert here.run('analyze', Path('b.yaml'), '--timeout', '0').status == 2
    assert here.run('analyze', Path('b.yaml'), '--only', 'beauty').status == 2
