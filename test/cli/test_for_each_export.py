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

"""Exports of bundles with listed keys: each instance is judged as with `for_each`."""

from collections.abc import Sequence
from pathlib import Path
from random import Random
import subprocess

from bag.test_instances import bundle, FLOAT, KEYS, messages, outline, record
from cli.command import Here
from differential.compiled import compile_c, gcc, unoptimised, WARNINGS
from fret_monitor.bag.check import (
    check_recording, compiled, opened, read_bundle, RecordingResult, run, Selection,
)
from fret_monitor.bag.findings import Findings
from fret_monitor.export.targets import TARGETS
from fret_monitor.export.written_keys import with_written_keys
from fret_monitor.model.policies import Policy
import pytest
from strategies import some

FLEET = """\
format: 1
for_each: {robot: [alpha, beta]}
inputs:
  speed: {topic: "/{robot}/speed", type: std_msgs/msg/Float32}
  level: {topic: "/{robot}/level", type: std_msgs/msg/Int8, initial: 9}
  on: {topic: enable, type: std_msgs/msg/Bool}
definitions: {fast: speed > 0.5}
requirements:
  - {id: SPEED, ptltl: "on -> O[0,2] !fast"}
  - {id: FLEET, ptltl: "count(robot: fast) <= 1"}
  - {id: LEAST, ptltl: "min(robot: level) > 3"}
"""
PROGRAM = """\
#include <stdio.h>
#include "fleet.h"

float speed_alpha, speed_beta;
int8_t level_alpha, level_beta;
bool on;

void handlerpropSPEED_alpha(void) {printf("SPEED alpha ");}
void handlerpropSPEED_beta(void) {printf("SPEED beta ");}
void handlerpropFLEET(void) {printf("FLEET ");}
void handlerpropLEAST(void) {printf("LEAST ");}

int main(void)
{
  int levels[2], is_on;
  while (
    scanf("%f %f %d %d %d", &speed_alpha, &speed_beta, &levels[0], &levels[1], &is_on) == 5)
  {
    level_alpha = (int8_t)levels[0];
    level_beta = (int8_t)levels[1];
    on = is_on;
    step();
    printf("\\n");
  }
  return 0;
}
"""
Row = tuple[float, float, int, int, int]


def test_copilot_has_a_variable_and_a_handler_for_each_key(here: Here) -> None:
    compiler = gcc()
    if compiler is None:
        pytest.skip('needs gcc')
    done = here.run('export', here.file('fleet.yaml', FLEET), '--to', 'copilot', '--output',
                    here.folder / 'out', '--no-proof')
    assert done.status == 0, done.err
    program = here.folder / 'program'
    compile_c([*compiler, '-std=c99', *WARNINGS, '-I', here.folder / 'out', here.folder / 'out' /
               'fleet.c', here.file('main.c', PROGRAM), '-o', program])
    rng = Random(3)
    rows = [(rng.choice((0.2, 0.9)), rng.choice((0.2, 0.9)), rng.randrange(3, 9),
             rng.randrange(3, 9), rng.randrange(2)) for _ in range(200)]
    text = '\n'.join(' '.join(map(str, row)) for row in rows)
    found = subprocess.run([program], input=text, capture_output=True, text=True, check=True)
    assert [line.rstrip() for line in found.stdout.split('\n')[:-1]] == list(map(
        ' '.join, expected(rows)))


def expected(rows: Sequence[Row]) -> list[list[str]]:
    """Return the handlers of each row, by what the requirements say."""
    found = []
    for place, row in enumerate(rows):
        last = rows[max(0, place - 2):place + 1]
        called = [f'SPEED {key}' for number, key in enumerate(('alpha', 'beta'))
                  if row[4] and all(one[number] > 0.5 for one in last)]
        called += ['FLEET'] * (row[0] > 0.5 and row[1] > 0.5)
        called += ['LEAST'] * (min(row[2:4]) <= 3)
        found.append(called)
    return found


def judged_with_written_keys(file: Path, path: Path, selection: Selection) -> RecordingResult:
    limits = TARGETS['c99'].limits
    assert limits is not None
    with opened(path) as (recording, find):
        reading = with_written_keys(read_bundle(file, selection, find), 'c99', limits)
        return run(compiled(reading).monitor, recording, selection)


@pytest.mark.parametrize('policy', [
    Policy.RELEVANT_MESSAGE, Policy.ALL_INPUTS, Policy.PERIODIC, Policy.TIMED])
def test_what_is_exported_judges_messages_as_with_for_each(policy: Policy, tmp_path: Path) -> None:
    file, selection = tmp_path / 'fleet.yaml', Selection(may_miss=True)
    file.write_text(bundle(policy, ['robot'], f'[{", ".join(KEYS)}]'))
    path = record(tmp_path / 'bag', list(messages(Random(f'{policy} written'), KEYS)))
    with unoptimised():
        whole = check_recording(file, path, selection)
        written = judged_with_written_keys(file, path, selection)
    by_id = {item.id: item for item in written.findings}
    compared = 0
    for item in whole.findings:
        for key in KEYS:
            name = f'{item.id}[robot={key}]'
            assert outline(by_id[name]) == outline(
                item.instances.get(key.encode(), Findings(name))), name
            compared += by_id[name].occurrences
    assert compared > 20


@pytest.mark.parametrize(('target', 'change', 'place', 'message'), [
    ('c99', ('[alpha, beta]', '{most: 9}'), '4:3', "c99 needs the keys of 'robot' in a list"),
    ('copilot', ('[alpha, beta]', '{most: 9}'), '4:3',
     "copilot needs the keys of 'robot' in a list"),
    ('fprime', ('', ''), '4:3', 'fprime takes instances under another policy than every_message'),
    ('cfs', ('', ''), '10:25', 'cfs would have another value over all instances'),
    ('c99', ('{topic: "/{robot}/speed", type: std_msgs/msg/Float32}',
             '{topic: joints, type: sensor_msgs/msg/JointState, field: "effort[name = {robot}]"}'),
     '4:3', 'c99 takes no elements that are looked up by a key'),
    ('cfs', ('/{robot}/speed", type: std_msgs/msg/Float32}',
             'x", type: geometry_msgs/msg/PointStamped, field: point.x, '
             'where: "header.frame_id = {robot}"}'), '4:3',
     'cfs does not select messages by `where`'),
    ('copilot', ('min(robot: level) > 3', 'sum(robot: speed) > 3.0'), '11:25',
     'copilot has no sums of floats over instances'),
])
def test_what_an_export_cannot_have_is_refused_with_its_place(
        here: Here, target: str, change: tuple[str, str], place: str, message: str) -> None:
    done = here.run('export', here.file('fleet.yaml', FLEET.replace(*change)), '--to', target,
                    '--output', here.folder / 'out', '--no-proof')
    assert done.status == 1
    assert f'fleet.yaml:{place}: error: {message}' in done.err
    assert not (here.folder / 'out').exists()


def test_keys_that_give_one_name_in_c_are_refused(here: Here) -> None:
    text = FLEET.replace('[alpha, beta]', '[b-2, b_2]').replace('/{robot}/speed"', (
        'speed", where: "header.frame_id = {robot}", field: point.x')).replace(
        'std_msgs/msg/Float32', 'geometry_msgs/msg/PointStamped').replace(
        '/{robot}/level', 'level')
    done = here.run('export', here.file('fleet.yaml', text.replace(
        'type: std_msgs/msg/Int8', 'type: sensor_msgs/msg/JointState, '
        'field: "effort[name = {robot}]"')), '--to', 'copilot', '--output', here.folder / 'out')
    assert done.status == 1
    assert 'with keys in their names, two inputs are speed_b_2' in done.err
    assert 'fleet.yaml:4:3: error' in done.err
    assert 'two requirements are handlerpropSPEED_b_2' in done.err


OVER_ALL = [
    'count(robot: x_robot > 0.5) <= 1', 'on -> any(robot: x_robot > 1.2)',
    'all(robot: on | x_robot < 1.5)', 'max(robot: x_robot) < 1.6', 'min(robot: x_robot) > 0.3',
    'O[0, 0.5 s] (count(robot: x_robot > min(robot: x_robot) + 1.0) = 0)',
    'x_robot <= 1.0 | x_robot < max(robot: x_robot)',
    'H (x_robot > 1.2 -> Y (count(robot: x_robot > 0.9) < 2))',
    'count(robot: H[0, 0.5 s] x_robot > 0.4) >= 1',
    'all(robot: O[0, 0.5 s] (on & x_robot <= min(robot: x_robot)))']


@pytest.mark.parametrize('policy', [Policy.PERIODIC, Policy.TIMED])
def test_values_over_all_instances_are_exported_where_each_has_a_value(
        policy: Policy, tmp_path: Path) -> None:
    lines = [f'  - {{id: A{place}, ptltl: "{formula}"}}' for place, formula in enumerate(OVER_ALL)]
    file, selection = tmp_path / 'fleet.yaml', Selection(may_miss=True)
    text = bundle(policy, ['robot'], f'[{", ".join(KEYS)}]', initial=', initial: true')
    file.write_text('\n'.join([text.replace(f'{FLOAT}}}', f'{FLOAT}, initial: 0.7}}'), *lines]))
    path = record(tmp_path / 'bag', list(messages(Random(f'{policy} over all'), KEYS)))
    with unoptimised():
        whole = check_recording(file, path, selection)
        written = judged_with_written_keys(file, path, selection)
    by_id, compared = {item.id: item for item in written.findings}, 0
    for item in whole.findings:
        found = {f'{item.id}[robot={key}]': item.instances.get(key.encode()) for key in KEYS} \
            if item.variables else {item.id: item}
        for name, one in found.items():
            assert outline(by_id[name]) == outline(one or Findings(name)), name
            compared += by_id[name].occurrences * item.id.startswith('A')
    assert compared > 40


@pytest.mark.parametrize(('policy', 'old', 'new', 'label'), [
    ('timed', '', '', "'speed' has none before its first message"),
    ('relevant_message', 'Float32}', 'Float32, initial: 0}', 'at messages of their keys'),
    ('timed', 'Float32}', 'Float32, initial: 0, timeout: 1, stale: violate}',
     "while 'speed' is silent in one instance")])
def test_values_that_one_monitor_would_not_have_are_refused(
        here: Here, policy: str, old: str, new: str, label: str) -> None:
    text = FLEET.replace(old, new) if old else FLEET
    done = here.run('export', here.file('fleet.yaml', text.replace(
        'inputs:', f'evaluation: {{policy: {policy}}}\ninputs:').replace(
            'O[0,2] !', 'O[0,2 s] !' if policy == 'timed' else 'O[0,2] !')),
        '--to', 'c99', '--output', here.folder / 'out')
    assert done.status == 1
    assert 'fleet.yaml:11:25: error: c99 would have another value over all instances' in done.err
    assert label in done.err


ROBOTS = """\
format: 1
for_each: {robot: [alpha, beta]}
evaluation: {policy: POLICY}
inputs:
  speed: {topic: "/{robot}/speed", type: std_msgs/msg/Float32}
  on: {topic: enable, type: std_msgs/msg/Bool}
requirements:
  - {id: SPEED, ptltl: "on -> O[0, WINDOW] (speed <= 0.5)"}
  - {id: CALM, ptltl: "H (on & speed > 1.2 -> Y (speed <= 1.2))"}
"""
OF_ALL = """\
  - {id: FLEET, ptltl: "count(robot: O[0, 1 s] (speed > 1.2)) <= 1"}
"""
MESSAGES = """\
#include <inttypes.h>
#include <stdio.h>
#include "robots_monitor.h"
#include "evaluator.h"
#include "robots_options.h"
#include "robots_size.h"

static unsigned char block[ROBOTS_EVALUATOR_BYTES + FM_ALIGNMENT];
static struct fm_violation found[robots_requirements];

static void advance(struct fm_evaluator * evaluator, int64_t now)
{
  do {
    (void)fm_evaluator_advance(evaluator, now, found);
  } while (fm_evaluator_wake(evaluator) <= now);
}

int main(void)
{
  const struct fm_evaluator_options options = robots_options();
  const size_t misaligned = (uintptr_t)block % FM_ALIGNMENT;
  struct fm_evaluator * evaluator = fm_evaluator_init(
    block + (FM_ALIGNMENT - misaligned) % FM_ALIGNMENT, &options);
  int64_t now;
  unsigned topic;
  double number;
  robots_set_initial_values(evaluator);
  advance(evaluator, 0);
  while (scanf("%" SCNd64 " %u %lf", &now, &topic, &number) == 3) {
    union fm_value value = {.f = number};
    if (topic == 2) {
      value = (union fm_value) {.i = number > 0.0};
    }
    advance(evaluator, now - 1);
    fm_evaluator_store(evaluator, topic, value, now);
    (void)fm_evaluator_message(evaluator, topic, now, found);
    for (uint32_t r = 0; r < robots_requirements; ++r) {
      const bool * verdicts = fm_evaluator_verdicts(evaluator);
      printf("%d ", verdicts[r]);
    }
    printf("\\n");
  }
  return 0;
}
"""


@pytest.mark.parametrize('policy', some([Policy.TIMED, Policy.RELEVANT_MESSAGE]))
def test_the_exported_c99_gives_each_instance_the_verdicts_of_for_each(
        here: Here, policy: Policy) -> None:
    compiler = gcc()
    if compiler is None:
        pytest.skip('needs gcc')
    is_timed = policy is Policy.TIMED
    text = ROBOTS.replace('POLICY', policy.value).replace('WINDOW', '2 s' if is_timed else '2')
    if is_timed:
        text = text.replace('Float32}', 'Float32, initial: 0.25}') + OF_ALL
    path = here.file('robots.yaml', text)
    out, program = here.folder / 'out', here.folder / 'program'
    done = here.run('export', path, '--to', 'c99', '--output', out)
    assert done.status == 0, done.err
    compile_c([*compiler, '-std=c99', *WARNINGS, '-I', out / 'src', *sorted(out.glob('src/*.c')),
               here.file('main.c', MESSAGES), '-lm', '-o', program])
    rng = Random(f'{policy} c99')
    keys, rows, time = ('alpha', 'beta'), [(10**9, 2, 1.0)], 10**9
    for _ in range(150):
        time += rng.choice((1, 3 * 10**8, 10**9))
        topic = rng.choice((0, 0, 1, 1, 2))
        rows.append((time, topic, rng.choice((0.25, 1.0, 1.5)) if topic < 2 else
                     float(rng.random() < 0.7)))
    text = '\n'.join(' '.join(map(str, row)) for row in rows)
    lines = subprocess.run([program], input=text, capture_output=True, text=True,
                           check=True).stdout.splitlines()
    trace = ['time,robot,speed,on', *(
        f'{seconds(now)},{keys[topic]},{value},' if topic < 2 else f'{seconds(now)},,,{value:.0f}'
        for now, topic, value in rows)]
    judged = here.run('simulate', path, '--trace', here.file('t.csv', '\n'.join([*trace, '']))).out
    compared = violated = 0
    expected = {tuple(line.split(',')[:2]): line.split(',')[2:] for line in judged.splitlines()}
    for place, ((now, topic, _), line) in enumerate(zip(rows, lines, strict=True)):
        if topic < 2:
            own = seconds(now) if is_timed else str(place)
            verdicts = line.split()
            assert [verdicts[topic], verdicts[2 + topic], *verdicts[4:]] == \
                expected[own, keys[topic]]
            compared += 1
            violated += '0' in expected[own, keys[topic]]
    assert compared > 80
    assert 10 < violated < compared


def seconds(time: int) -> str:
    return f'{time // 10**9}.{time % 10**9:09}'.rstrip('0').rstrip('.')
