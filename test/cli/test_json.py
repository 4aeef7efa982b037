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

"""`--json`: one document on standard output, with errors and warnings; the status is unchanged."""

import json
from typing import Any

from cli.command import Done, HEADING, Here, PUMP
import pytest

STEPS = HEADING + '1,0,1,0,stopped\n0,0,9,7,stopped\n0,0,9,0,moving\n'
TIMED = """\
format: 1
evaluation: {policy: timed}
inputs: {p: {type: bool}}
requirements:
  - {id: R, title: Seldom, ptltl: "H (p -> O[0, 2 s] !p)"}
  - {id: Q, ptltl: "p | !p"}
"""
GATED = """\
format: 1
inputs:
  speed: {topic: raw, type: std_msgs/msg/Float32}
  front: {topic: front, type: std_msgs/msg/Float32, timeout: 1}
actions:
  stop: {lock: {topic: e_stop}}
  ask: {call: {service: base/stop, type: std_srvs/srv/Trigger}}
requirements:
  - {id: SLOW, ptltl: speed < 1.0, on_violation: [stop]}
  - {id: FAR, ptltl: front > 1.0, on_end: [ask]}
gates:
  drive: {from: raw, to: cmd, type: std_msgs/msg/Float32, keep: [SLOW], otherwise: drop}
"""
PLACE = {'level', 'file', 'line', 'column', 'message', 'label', 'help'}


def document(done: Done, status: int = 0) -> dict[str, Any]:
    """Return the only document of a verb."""
    assert (done.status, done.err) == (status, '')
    found = json.loads(done.out)
    assert all(set(item) == PLACE for item in found['diagnostics'])
    assert isinstance(found, dict)
    return found


def test_check_describes_the_valid_bundles_and_the_problems_of_the_others(here: Here) -> None:
    good, bad = here.file('good.yaml', TIMED), here.file('bad.yaml', TIMED.replace('!p"', '!q"'))
    found = document(here.run('check', '--json', good, bad, here.folder / 'none.yaml'), 1)
    valid, *others = found['bundles']
    assert others == [{'bundle': str(bad), 'is_valid': False},
                      {'bundle': str(here.folder / 'none.yaml'), 'is_valid': False}]
    assert valid.pop('requirements')[0] == {
        'id': 'R', 'title': 'Seldom', 'text': 'H (p -> O[0, 2 s] !p)', 'for_each': [],
        'inputs': ['p'], 'state_bytes': 16,
        'bounds': [2_000_000_000], 'horizon': 0, 'formula': 'H (p -> (O[0, 2 s] !p))'}
    assert valid.pop('state_bytes') > 0 and valid.pop('operations') > 0
    assert valid == {
        'bundle': str(good), 'is_valid': True, 'policy': 'timed', 'period': None, 'unit': None,
        'topics': [],
        'inputs': [{'name': 'p', 'type': 'bool', 'topic': None, 'for_each': []}],
        'instances': [], 'windows': [], 'gates': [], 'actions': []}
    warning, error, missing = found['diagnostics']
    assert (warning['level'], warning['message']) == ('warning', 'Q is true at every step')
    assert error == {
        'level': 'error', 'file': str(bad), 'line': 6, 'column': 26,
        'message': "'q' is not declared", 'label': 'unknown name',
        'help': 'declare it under inputs, constants or definitions'}
    assert (missing['line'], missing['file']) == (None, None)
    assert 'none.yaml' in missing['message']


def test_check_describes_gates_and_actions(here: Here) -> None:
    [found] = document(here.run('check', '--json', here.file('gated.yaml', GATED)))['bundles']
    assert found['gates'] == [{
        'name': 'drive', 'is_service': False, 'from': 'raw', 'to': 'cmd',
        'type': 'std_msgs/msg/Float32', 'keep': ['SLOW'], 'otherwise': 'drop'}]
    assert found['actions'] == [
        {'name': 'stop', 'kind': 'lock', 'target': 'e_stop', 'requirements': ['SLOW']},
        {'name': 'ask', 'kind': 'call', 'target': 'base/stop', 'requirements': ['FAR']}]


def test_simulate_counts_violations(here: Here) -> None:
    bundle, trace = here.file('pump.yaml', PUMP), here.file('trace.csv', STEPS)
    done = here.run('simulate', bundle, '--trace', trace, '--json', '--fail-on-violation')
    assert document(done, 1) == {'steps': 3, 'diagnostics': [], 'requirements': [
        {'id': 'R-1', 'violations': 2, 'first_step': 1},
        {'id': 'R,2', 'violations': 1, 'first_step': 1},
        {'id': 'R"3', 'violations': 2, 'first_step': 1}]}
    verdicts = here.folder / 'verdicts.csv'
    again = here.run('simulate', bundle, '--trace', trace, '--json', '--verdicts', verdicts)
    assert json.loads(again.out) == json.loads(done.out)
    assert verdicts.read_text().splitlines()[1:] == ['0,1,1,1', '1,0,0,0', '2,0,1,0']


def test_simulate_gives_times_under_the_policy_timed(here: Here) -> None:
    trace = here.file('trace.csv', 'time,p\n0.5,0\n1,1\n9,1\n')
    found = document(here.run(
        'simulate', here.file('timed.yaml', TIMED), '--trace', trace, '--json'))
    assert found['rows'] == 4
    assert found['requirements'] == [{'id': 'R', 'violations': 2, 'first_time': '3'},
                                     {'id': 'Q', 'violations': 0, 'first_time': None}]


def test_explain_has_the_words_and_the_examples(here: Here) -> None:
    found = document(here.run('explain', here.file('timed.yaml', TIMED), 'R', '--json'))
    [item] = found['requirements']
    assert (item['id'], item['title'], item['formula']) == (
        'R', 'Seldom', 'H (p -> (O[0, 2 s] !p))')
    assert item['meaning'].keys() == {'in words'}
    violating = next(line for line in item['examples'] if 'violates' in line['title'])
    assert {'label': 'p', 'truth': violating['rows'][0]['truth']} == violating['rows'][0]
    assert len(violating['steps']) == len(violating['verdict'])
    assert violating['verdict'][-1] is False
    assert violating['seconds_per_step'] > 0


def test_prove_adds_warnings_to_the_certificate(here: Here) -> None:
    pytest.importorskip('z3')
    pytest.importorskip('pycparser')
    bundle = 'format: 1\ninputs: {p: {type: bool}}\nrequirements: [{id: R, ptltl: "p | !p"}]\n'
    found = document(here.run('prove', here.file('b.yaml', bundle), '--json'))
    assert found['proved'] is True
    assert [item['message'] for item in found['diagnostics']] == ['R is true at every step']


@pytest.mark.parametrize(('verb', 'more'), [
    ('check', ()), ('bench', ()), ('explain', ()), ('prove', ()),
    ('simulate', ('--trace', 'trace.csv'))])
def test_errors_are_in_the_document(here: Here, verb: str, more: tuple[str, ...]) -> None:
    if verb == 'prove':
        pytest.importorskip('z3')
        pytest.importorskip('pycparser')
    bundle = here.file('pump.yaml', PUMP.replace('n < 5', 'N < 5'))
    found = document(here.run(verb, bundle, *more, '--json'), 1)
    [error] = found['diagnostics']
    assert (error['file'], error['line'], error['level']) == (str(bundle), 11, 'error')


def test_bag_prints_lines_and_so_no_document(here: Here) -> None:
    done = here.run('bag', here.folder / 'none.yaml', here.folder, '--json')
    line = json.loads(done.out)
    assert (done.status, line['read'], 'requirements' in line) == (1, 0, True)
    assert line['errors'] and 'none.yaml' in line['errors'][0]
    assert done.err.startswith('error: ')


def test_a_trace_and_a_compiler_that_cannot_be_used_are_in_the_document(
    here: Here, monkeypatch: pytest.MonkeyPatch,
) -> None:
    bundle = here.file('pump.yaml', PUMP)
    trace = here.file('trace.csv', HEADING + '1,2,x,0,moving\n')
    [error] = document(here.run('simulate', bundle, '--trace', trace, '--json'), 1)['diagnostics']
    assert (error['file'], error['line'], error['column']) == (str(trace), 2, 5)
    monkeypatch.setenv('CC', 'no-such-compiler')
    [error] = document(here.run('simulate', bundle, '--trace', trace, '--json'), 1)['diagnostics']
    assert 'no-such-compiler' in error['message']
