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

"""Bundles with instance variables on the command line: what knows them, and what refuses them."""

import json
from pathlib import Path
import re

from cli.command import Here
from fret_monitor.build import generate_monitor, read
from fret_monitor.model.manifest import Manifest
from fret_monitor.program.layout import instance_bytes
import pytest

FLEET = """\
format: 1
for_each:
  robot: {most: 2, forget: 2}
  joint: [a, b]
inputs:
  speed: {topic: "/{robot}/speed", type: std_msgs/msg/Float32}
  load: {topic: "/{robot}/load", type: std_msgs/msg/Int8, initial: 1}
  effort: {topic: "/{joint}/effort", type: std_msgs/msg/Float64}
  enabled: {topic: enable, type: std_msgs/msg/Bool}
requirements:
  - {id: FLEET, ptltl: "count(robot: speed > 0.5) <= 1 & max(joint: effort) < 9.0"}
  - {id: SPEED, fretish: when enabled the robot shall always satisfy speed <= 1.0}
  - {id: LOAD, cocospec: "load < 100"}
  - {id: EFFORT, ptltl: "H (effort < 3.0)"}
"""
HEADING = 'time,robot,speed,load,joint,effort,enabled\n'


def test_what_does_not_know_instances_refuses_them_with_the_place(here: Here) -> None:
    done = here.run('analyze', here.file('fleet.yaml', FLEET), '--output', 'out')
    assert done.status == 1
    assert "fleet.yaml:3:3: error: 'for_each' and 'where' are not supported here yet" in done.err


def test_a_value_over_pairs_is_shown_as_it_is_written(here: Here) -> None:
    text = FLEET.replace('{most: 2, forget: 2}', '[a, b]').replace(
        'max(joint: effort) < 9.0', 'count(robot, joint: speed > effort) <= 3')
    assert 'count(robot, joint: speed > effort) <= 3' in here.run(
        'check', here.file('pairs.yaml', text)).out


def test_explain_analyze_and_bench_judge_one_instance(here: Here) -> None:
    path = here.file('fleet.yaml', FLEET)
    assert 'required     at the trigger and all later steps, speed <= 1.0 holds' in here.run(
        'explain', path, 'SPEED').out
    assert 'max(joint: effort): 10, 8 from step 1' in here.run('explain', path, 'FLEET').out
    assert '"requirements": 4' in here.run('bench', path, '--json').out
    pytest.importorskip('z3')
    wrong = FLEET.replace('load < 100', 'load < 100 & load > 120')
    done = here.run('analyze', here.file('wrong.yaml', wrong))
    assert done.status == 1
    assert 'no       LOAD' in done.out
    assert 'yes      SPEED' in done.out
    assert here.run('check', '--analyze', path).status == 0


def test_tests_and_prove_judge_one_instance(here: Here) -> None:
    path = here.file('fleet.yaml', FLEET)
    done = here.run('tests', path, '--output', here.folder / 'out', '--json')
    assert done.status == 0, done.err
    found = json.loads(done.out)
    assert {item['requirement'] for item in found['obligations']} == {
        'FLEET', 'SPEED', 'LOAD', 'EFFORT'}
    shown = here.run('tests', path, '--output', here.folder / 'out').out
    assert 'the traces are of one instance' in shown
    # A value over all instances is an input like any other.
    heading = next((here.folder / 'out').rglob('*.csv')).read_text().splitlines()[0]
    assert 'count(robot: speed > 0.5)' in heading
    pytest.importorskip('z3')
    pytest.importorskip('pycparser')
    assert here.run('prove', path).out.startswith('fleet.yaml: proved, 4 requirements\n')


def test_a_compiled_bundle_and_an_exported_node_have_all_instances(here: Here) -> None:
    path = here.file('fleet.yaml', FLEET)
    done = here.run('compile', path, '--output', here.folder / 'out')
    assert done.status == 0, done.err
    assert ': 4 requirements, ' in done.out
    found = Manifest.from_json((here.folder / 'out' / 'manifest.json').read_text())
    assert [item.id for item in found.numbered] == ['FLEET', 'SPEED', 'LOAD', 'EFFORT']
    done = here.run('export', path, '--to', 'ros2', '--output', here.folder / 'package')
    assert done.status == 0, done.err
    assert 'not proved: a bundle with instances' in done.out
    table = (here.folder / 'package' / 'src' / 'node_table.c').read_text()
    assert 'kind_1_concerns' in table


def test_a_key_needs_a_string_without_a_limit(here: Here) -> None:
    done = here.run('check', here.file('one.yaml', """\
format: 1
for_each: {robot: {most: 3}}
inputs:
  speed: {topic: "/{robot}/speed", type: std_msgs/msg/Float32}
actions:
  short:
    publish:
      {topic: a, type: test_msgs/msg/Strings, message: {bounded_string_value: "{robot}"}}
  wide: {publish: {topic: b, type: test_msgs/msg/WStrings, message: {wstring_value: "{robot}"}}}
  ask:
    call:
      service: ask
      type: rcl_interfaces/srv/GetParameters
      request: {names: [a, "of {robot}"]}
requirements:
  - {id: SPEED, ptltl: "speed <= 1.0", on_violation: [short, wide, ask]}
"""))
    found = [line for line in done.err.splitlines() if 'error' in line or '^' in line]
    assert [line.partition(': ')[2] or line.partition('^ ')[2] for line in found] == [
        "error: the field 'bounded_string_value' has room for 22 characters",
        'a key has up to 255', "error: the field 'wstring_value' cannot be a key",
        'it is of type wstring']


def test_a_gate_stands_beside_where_and_check_names_the_gates_of_keys(here: Here) -> None:
    path = here.file('one.yaml', """\
format: 1
for_each: {robot: [a, b]}
inputs:
  x: {topic: x, type: std_msgs/msg/String, where: "data = imu", values: {A: a}, timeout: 1}
  v: {topic: "/{robot}/v", type: std_msgs/msg/Float32}
gates:
  g: {from: "/{robot}/v", to: "/{robot}/w", type: std_msgs/msg/Float32, keep: [R]}
requirements:
  - {id: R, ptltl: "v < 1.0 | x = A"}
""")
    done = here.run('check', path)
    assert done.status == 0
    assert 'gate g: /{robot}/v -> /{robot}/w, as g_a, g_b, keeps R' in done.out
    assert here.run('simulate', path, '--trace', here.file(
        't.csv', 'robot,v,x\na,2.0,A\nb,2.0,\n')).out == 'step,robot,R\n0,a,1\n1,b,1\n'


def test_check_says_of_what_each_requirement_is_one(here: Here) -> None:
    done = here.run('check', '--json', here.file('fleet.yaml', FLEET))
    found = json.loads(done.out)['bundles'][0]
    assert [(item['id'], item['for_each']) for item in found['requirements']] == [
        ('FLEET', []), ('SPEED', ['robot']), ('LOAD', ['robot']), ('EFFORT', ['joint'])]
    assert [(item['name'], item['for_each']) for item in found['inputs']] == [
        ('enabled', []), ('speed', ['robot']), ('load', ['robot']), ('effort', ['joint'])]
    assert found['topics'] == ['enable', '/{robot}/speed', '/{robot}/load', '/{joint}/effort']
    generated = generate_monitor(read(Path(here.file('fleet.yaml', FLEET)), takes_instances=True))
    assert [(item['for_each'], item['most'], item['bytes']) for item in found['instances']] == [
        (['robot'], 2, instance_bytes(generated.kinds[0].program, generated.kinds[0].layouts)),
        (['joint'], 2, instance_bytes(generated.kinds[1].program, generated.kinds[1].layouts))]
    assert Manifest.from_json(generated.manifest.to_json()) == generated.manifest


def test_check_says_which_requirements_of_instances_an_action_follows(here: Here) -> None:
    path = here.file('fleet.yaml', """\
format: 1
for_each: {robot: {most: 2}, joint: [a, b]}
inputs:
  speed: {topic: "/{robot}/speed", type: std_msgs/msg/Float32}
  near:
    {topic: "/{robot}/arm", type: sensor_msgs/msg/JointState, field: "effort[name = {joint}]"}
  enabled: {topic: enable, type: std_msgs/msg/Bool}
actions:
  stop: {lock: {topic: e_stop}}
  tell: {publish: {topic: told, type: std_msgs/msg/Empty}}
requirements:
  - {id: PAIR, ptltl: "near < 1.0 | speed < 1.0", on_violation: [stop]}
  - {id: WHOLE, ptltl: "enabled", on_violation: [stop]}
  - {id: SPEED, ptltl: "speed < 2.0", on_violation: [stop], on_end: [tell]}
""")
    shown = here.run('check', path).out
    assert 'lock stop: e_stop, of PAIR, WHOLE, SPEED\npublish tell: told, of SPEED\n' in shown
    found = json.loads(here.run('check', '--json', path).out)['bundles'][0]['actions']
    assert [item['requirements'] for item in found] == [['PAIR', 'WHOLE', 'SPEED'], ['SPEED']]


def test_more_instances_than_memory_allows_are_refused_with_their_bytes(here: Here) -> None:
    text = FLEET.replace('most: 2', 'most: 16777216').replace(
        'speed > 0.5', 'O[=9999] speed > 0.5')
    done = here.run('check', here.file('fleet.yaml', text))
    assert done.status == 1
    assert "16,777,216 instances of 'robot' need" in done.err
    assert 'at most 4,294,967,296 are allowed' in done.err
    line = 1 + text.splitlines().index('  robot: {most: 16777216, forget: 2}')
    assert f'fleet.yaml:{line}:3: error: ' in done.err
    help_ = re.search(r'= help: most: (\d+)\n', done.err)
    assert help_ is not None
    for most, status in ((int(help_[1]), 0), (int(help_[1]) + 1, 1)):
        bundle = here.file('fleet.yaml', text.replace('16777216', str(most)))
        assert here.run('check', bundle).status == status


def simulate(here: Here, trace: str, text: str = FLEET) -> tuple[list[str], str]:
    """Return the rows of verdicts, and what was said on standard error."""
    done = here.run('simulate', here.file('fleet.yaml', text), '--trace',
                    here.file('trace.csv', HEADING + trace))
    return done.out.splitlines(), done.err


def test_a_key_ends_at_its_time_and_another_takes_its_place(here: Here) -> None:
    rows, error = simulate(here, """\
0,alpha,0.7,,,,1
0.5,beta,0.7,,,,
1,gamma,0.7,,,,
2,,,,,,0
2.000000001,gamma,1.7,,,,1
2.500000001,alpha,0.2,,,,
""")
    assert rows == [
        'step,robot,joint,FLEET,SPEED,LOAD,EFFORT',
        '0,alpha,,,1,1,',  # max(joint: effort) has no value yet
        '1,beta,,,1,1,',
        '2,gamma,,,,,',  # beyond most
        '3,,,,,,',
        '4,gamma,,,0,1,',
        '5,alpha,,,1,1,']
    assert error == "1 row of keys of 'robot' beyond most: 2 not evaluated\n"


def test_an_aggregate_waits_for_a_value_and_follows_it(here: Here) -> None:
    rows, _ = simulate(here, """\
0,alpha,0.7,,,,1
1,,,,a,2.0,
2,beta,0.7,,b,9.5,
3,beta,0.1,,b,8.5,
""")
    assert [row.split(',')[3] for row in rows[1:]] == ['', '1', '0', '1']


def test_the_document_counts_violations_of_all_instances(here: Here) -> None:
    done = here.run('simulate', '--json', here.file('fleet.yaml', FLEET), '--trace', here.file(
        'trace.csv', HEADING + '0,alpha,1.5,,,,1\n1,beta,0.5,,,,\n1.5,,,,,,1\n'))
    found = {item['id']: item for item in json.loads(done.out)['requirements']}
    assert (found['SPEED']['violations'], found['SPEED']['first_step']) == (2, 0)


@pytest.mark.parametrize(('trace', 'error'), [
    ('0,alpha,x,,,,\n', "trace.csv:2:9: error: 'x' is no value of 'speed'"),
    ('0,,1.0,,,,\n', "trace.csv:2:4: error: a value of 'speed' in a row without a key"),
    ('0,alpha,,,,1.0,\n', "trace.csv:2:12: error: a value of 'effort' in a row without a key"),
    ('0,,,,c,1.0,\n', "trace.csv:2:6: error: 'c' is not a key of 'joint'"),
    (f'0,{"k" * 256},1.0,,,,\n', 'trace.csv:2:3: error: a key has at most 255 bytes'),
    ('0,alpha,1.0,,,\n', 'error: 6 cells in a row of a trace with 7 columns'),
    ('1,alpha,1.0,,,,\n1,alpha,1.0,,,,\n', 'the same time as that of the row before')])
def test_a_trace_that_is_wrong_is_refused_with_the_place(
        here: Here, trace: str, error: str) -> None:
    assert error in simulate(here, trace)[1]


def test_a_trace_has_a_column_for_each_variable(here: Here) -> None:
    done = here.run('simulate', here.file('fleet.yaml', FLEET), '--trace', here.file(
        'trace.csv', 'robot,speed,load,effort,enabled\n'))
    assert "the trace has no column for the instance variable 'joint'" in done.err


@pytest.mark.parametrize(('policy', 'rows'), [
    ('every_message', ['step,robot,R', '0,a,1', '1,b,0', '2,a,1']),
    ('timed', ['time,robot,R', '0,a,1', '1,b,0', '2,a,1'])])
def test_a_bundle_may_have_no_requirement_but_of_instances(
        here: Here, policy: str, rows: list[str]) -> None:
    bundle = here.file('each.yaml', f"""\
format: 1
for_each: {{robot: {{most: 3}}}}
evaluation: {{policy: {policy}}}
inputs:
  speed: {{topic: "/{{robot}}/speed", type: std_msgs/msg/Float32}}
  came: {{topic: "/{{robot}}/speed", type: std_msgs/msg/Float32, field: received()}}
requirements:
  - {{id: R, ptltl: "H (came -> speed < 1.0)"}}
""")
    trace = here.file('trace.csv', 'robot,speed,time\na,0.5,0\nb,2.0,1\na,0.6,2\n')
    assert here.run('check', bundle).status == 0
    assert here.run('simulate', bundle, '--trace', trace).out.splitlines() == rows


def test_under_timed_the_end_of_an_instance_is_an_instant(here: Here) -> None:
    timed = FLEET.replace('requirements:', 'evaluation: {policy: timed}\nrequirements:').replace(
        ' & max(joint: effort) < 9.0', '')
    done = here.run('simulate', here.file('fleet.yaml', timed), '--until', '9', '--trace',
                    here.file('trace.csv', HEADING + '0,alpha,0.7,,,,1\n1,beta,0.7,,,,\n'))
    assert done.out.splitlines() == [
        'time,robot,joint,FLEET,SPEED,LOAD,EFFORT', '0,alpha,,1,1,1,', '1,beta,,0,1,1,',
        '2,,,1,,,']
