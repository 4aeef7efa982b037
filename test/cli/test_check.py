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

"""`check`: all problems of each bundle, or a table of it; the tables are golden files."""

import json
from pathlib import Path
import shutil

from cli.command import Here, PUMP
import golden
import pytest

HERE = Path(__file__).resolve().parent


@pytest.mark.parametrize('case', golden.cases('check'), ids=lambda path: path.stem)
def test_a_bundle_is_shown_as_a_table(here: Here, monkeypatch: pytest.MonkeyPatch,
                                      case: Path) -> None:
    shutil.copy(case, here.folder)
    monkeypatch.chdir(here.folder)
    done = here.run('check', case.name)
    assert done.status == 0
    golden.check(case, done.out + done.err)


@pytest.mark.parametrize('case', golden.cases('windows'), ids=lambda path: path.stem)
def test_a_window_that_has_no_room_is_refused(here: Here, monkeypatch: pytest.MonkeyPatch,
                                              case: Path) -> None:
    shutil.copy(case, here.folder)
    monkeypatch.chdir(here.folder)
    done = here.run('check', case.name)
    assert (done.status, done.out) == (1, '')
    golden.check(case, done.err)


def test_windows_are_listed_as_json_too(here: Here) -> None:
    case = golden.FOLDER / 'check' / 'windows.yaml'
    found = json.loads(here.run('check', case, '--json').out)['bundles'][0]['windows']
    assert found[0] == {
        'window': 'meanOver(10 s, current), sumOver(10 s, current)', 'state_bytes': 3912,
        'room': 222, 'filled_by': '222 messages: max_rate of current x 10 s',
        'requirements': ['CURRENT', 'CHARGE']}


def test_there_is_a_table_for_every_policy() -> None:
    texts = [case.read_text() for case in golden.cases('check')]
    for policy in ('every_message', 'relevant_message', 'all_inputs', 'periodic', 'timed'):
        assert any(f'policy {policy}' in item.with_suffix('.txt').read_text()
                   for item in golden.cases('check')), policy
    assert len(texts) >= 4


def test_each_bundle_is_checked_and_a_bad_one_gives_status_1(here: Here) -> None:
    good, other = here.file('good.yaml', PUMP), here.file('other.yaml', PUMP)
    bad = here.file('bad.yaml', PUMP.replace('n < 5', 'n < q'))
    done = here.run('check', good, bad, here.folder / 'gone.yaml', other)
    assert done.status == 1
    assert [line for line in done.out.splitlines() if line.startswith(str(here.folder))] == [
        f'{path}: 3 requirements, 5 inputs on 0 topics, 3 bytes of state, 10 operations a step'
        for path in (good, other)]
    assert f'{bad}:11:29: error: ' in done.err
    assert 'gone.yaml' in done.err
    assert str(good) not in done.err
    assert here.run('check', good, other).status == 0


def test_all_problems_are_reported_in_one_run(here: Here) -> None:
    bundle = PUMP.replace('n < 5', 'n << 5')\
        .replace('LANDING ->', 'FLYING ->').replace('float32', 'flt')
    done = here.run('check', here.file('pump.yaml', bundle))
    assert done.status == 1
    assert done.err.count('error: ') >= 3


def test_a_warning_is_reported_and_is_no_error(here: Here) -> None:
    bundle = PUMP + '  - {id: R-4, cocospec: "ST(5, 2, p, x > 1.0)"}\n'
    done = here.run('check', here.file('pump.yaml', bundle))
    assert done.status == 0
    assert ': warning: ' in done.err
    assert 'R-4' in done.out


@pytest.mark.parametrize('policy', ['every_message', 'relevant_message', 'all_inputs'])
def test_an_unread_topic_is_reported_where_it_causes_steps(here: Here, policy: str) -> None:
    bundle = (HERE.parent / 'golden' / 'check' / 'unread_topics.yaml').read_text()
    done = here.run('check', here.file(
        'unread.yaml', f'{bundle}evaluation: {{policy: {policy}}}\n'))
    assert done.status == 0
    assert ("messages on 'weather' are steps" in done.err) == (policy == 'every_message')


def test_too_much_state_is_refused(here: Here) -> None:
    bundle = PUMP + '  - {id: R-4, ptltl: "O[300000000,300000009] p"}\n'
    done = here.run('check', here.file('pump.yaml', bundle))
    assert (done.status, done.out) == (1, '')
    assert 'R-4 looks back 300,000,000 steps' in done.err
    assert 'pump.yaml:12:' in done.err


def test_a_thousand_requirements_are_shown(here: Here) -> None:
    lines = [f'  - {{id: A-{number}, ptltl: "O[1,{number + 1}] p"}}\n' for number in range(1000)]
    done = here.run('check', here.file('pump.yaml', PUMP + ''.join(lines)))
    assert done.status == 0
    assert len(done.out.splitlines()) == 4 + 1003


def test_a_bundle_is_found_by_its_name_and_in_a_package(
    here: Here, monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(here.folder)
    done = here.run('check', 'tank.yaml', 'arm.yaml', 'package://fret_monitor/config/arm.yaml')
    assert done.status == 1
    assert done.out.count('arm.yaml: ') == 2
    assert "error: there is no file 'tank.yaml' in " in done.err
    done = here.run('check', 'quadroter.yaml')
    assert done.err.endswith("= help: did you mean 'quadrotor.yaml'?\n")
    done = here.run('check', 'package://fret_moniter/config/arm.yaml')
    assert done.err.endswith("= help: did you mean 'fret_monitor'?\n")
    done = here.run('check', 'package://fret_monitor')
    assert done.err.endswith('= help: write package://fret_monitor/PATH\n')
    done = here.run('check', 'package://fret_monitor/config/amr.yaml')
    assert done.err.endswith("= help: did you mean 'arm.yaml'?\n")


@pytest.mark.parametrize('arguments', [
    ('bench',), ('compile', '--output', 'out'), ('explain',), ('prove',),
    ('simulate', '--trace', 'trace.csv')], ids=lambda arguments: arguments[0])
def test_every_verb_takes_the_name_of_a_bundle(
    here: Here, monkeypatch: pytest.MonkeyPatch, arguments: tuple[str, ...],
) -> None:
    monkeypatch.chdir(here.folder)
    verb, *options = arguments
    done = here.run(verb, 'none.yaml', *options)
    assert done.status == 1
    assert f"error: there is no file 'none.yaml' in {here.folder} nor in " in done.err


def test_a_constant_as_ros_writes_parameters_is_refused_with_the_line_to_write(
        here: Here) -> None:
    done = here.run('check', 'tank.yaml', '--constant', 'v_max:=0.3')
    assert done.status == 2
    assert "'v_max:=0.3': here it is v_max=0.3, without the colon" in done.err
