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

"""`bag` judges a trace with keys as `simulate` does: the same violations of the same instances."""

from collections import defaultdict
import csv
from dataclasses import replace
from pathlib import Path
from random import Random

from bag.recordings import FLOAT, Message, START, write
from bundles import write_bundle
from differential.compiled import unoptimised
from fret_monitor.bag.check import (
    check_recording, RecordingResult, run as run_bag, Selection,
)
from fret_monitor.bag.moments import Anchor, Moment
from fret_monitor.bag.trace import Trace
from fret_monitor.build import build_specification
from fret_monitor.cli.main import main
from fret_monitor.logic.specification import Specification
from fret_monitor.model.policies import Policy, Report
from fret_monitor.traces.csv_trace import parse_seconds
from fret_monitor.traces.simulate import simulate
from fret_monitor.traces.summary import Summary
from keyed import random_bundle, random_rows, Row
import pytest
from traces.test_keyed_simulate import FOUND, LISTED, OTHER, run, write_rows
from traces.timed_traces import timed


def reported(specification: Specification) -> Specification:
    """Return a specification whose requirements report when they begin to be violated."""
    return replace(specification, properties=tuple(
        replace(item, report=Report.ONSET) for item in specification.properties))


def both(folder: Path, specification: Specification, rows: list[Row],
         has_times: bool = True) -> tuple[Summary, RecordingResult]:
    """Run a trace with both."""
    monitor = build_specification(specification).monitor
    write_rows(specification, rows, folder / 'trace.csv', has_times)
    summary = simulate(monitor, folder / 'trace.csv', folder / 'out.csv')
    return summary, run_bag(monitor, Trace(folder / 'trace.csv'), Selection())


@pytest.mark.parametrize(('policy', 'forget', 'has_times'), [
    (Policy.EVERY_MESSAGE, 20, True), (Policy.RELEVANT_MESSAGE, 20, False),
    (Policy.ALL_INPUTS, 0, True), (Policy.PERIODIC, 9, False)])
def test_as_many_steps_violate_each_requirement(
        policy: Policy, forget: int, has_times: bool, tmp_path: Path) -> None:
    rng = Random(f'{policy} {forget}')
    specification = replace(reported(random_bundle(
        rng, [replace(FOUND, forget=forget * 10**9), OTHER], levels=2)), policy=policy)
    times = [0]
    for _ in range(119):
        times.append(times[-1] + rng.choice([1, 2, 5, 20, 21]) * 10**9)
    rows = random_rows(rng, specification, 120, times)
    summary, result = both(tmp_path, specification, rows, has_times)
    assert {item.id: item.violations for item in result.findings} == summary.violations
    assert sum(summary.violations.values()) > 20
    assert result.read == result.recorded == {'rows': 120}
    assert (result.kinds['robot'].ended > 0) == (has_times and forget > 0)
    first = {item.id: item.first for item in result.findings if item.first is not None}
    assert {name: times[step] if has_times else step * 10**9
            for name, step in summary.first.items()} == first


@pytest.mark.parametrize('seed', range(3))
def test_under_timed_the_violations_of_each_instance_begin_when_its_verdict_changes(
        seed: int, tmp_path: Path) -> None:
    rng = Random(f'{seed} timed')
    specification = reported(timed(random_bundle(
        rng, [LISTED] if seed else [FOUND, OTHER], loops=0, levels=2)))
    times = [5 * 10**9]
    for _ in range(59):
        times.append(times[-1] + rng.choice([1, 2, 5, 9, 30]))
    rows = random_rows(rng, specification, 60, times)
    _, result = both(tmp_path, specification, rows)
    _, (heading, *table) = run(tmp_path, specification, rows, has_times=True)
    keys = len(specification.instance_variables)
    expected: dict[tuple[str, str], list[int]] = defaultdict(list)
    before: dict[tuple[str, str], str] = {}
    variables_of = {item.id: item.variables for item in result.findings}
    names = [item.name for item in specification.instance_variables]
    for time, *cells in table:
        for name, cell in zip(heading[1 + keys:], cells[keys:], strict=True):
            key = ''.join(cells[names.index(variable)] for variable in variables_of[name])
            if cell == '0' and before.get((name, key)) != '0':
                expected[name, key].append(parse_seconds(time))
            before[name, key] = cell or before.get((name, key), '')
    found = {(item.id, key.decode()): [begin for begin, _ in one.spans]
             for item in result.findings
             for key, one in (item.instances.items() if item.variables else [(b'', item)])
             if one.spans}
    assert found == expected
    assert len(found) > 2


FLEET = """
format: 1
for_each: {robot: [alpha, beta]}
inputs: {speed: {topic: "/{robot}/speed", type: std_msgs/msg/Float32}}
requirements:
  - {id: SPEED, ptltl: "speed <= 1.0"}
"""


def test_a_part_of_a_trace_is_judged_and_a_wrong_key_has_its_place(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bundle, trace = write_bundle(tmp_path, FLEET), tmp_path / 'trace.csv'
    trace.write_text('time,robot,speed\n0,alpha,2\n1,beta,0.5\n2,alpha,0.5\n3,beta,3\n4,beta,0\n',
                     encoding='utf-8')
    assert main(['bag', str(bundle), str(trace), '--from', '1', '--to', '3', '--csv',
                 str(tmp_path / 'out.csv')]) == 0
    assert capsys.readouterr().out.splitlines()[2:] == [
        'requirement        verdict   occurrences  first at  longest',
        'SPEED              VIOLATED            1       3 s      0 s',
        'SPEED[robot=beta]  VIOLATED            1       3 s      0 s']
    trace.write_text('time,robot,speed\n0,alpha,2\n1,gamma,0.5\n', encoding='utf-8')
    assert main(['bag', str(bundle), str(trace)]) == 1
    assert "trace.csv:3:3: 'gamma' is not a key of 'robot'" in capsys.readouterr().err


MARGINS = """
format: 1
evaluation: {policy: timed}
for_each: {person: {most: 3}, robot: {most: 4}}
inputs:
  near: {topic: "/{person}/near", type: std_msgs/msg/Float64}
  speed: {topic: "/{robot}/speed", type: std_msgs/msg/Float64, max_rate: 5}
requirements:
  - {id: NEAR, ptltl: near <= 1}
  - {id: SLOWER, fretish: if speed > 1.0 the robot shall within 3 seconds satisfy speed < 0.5}
"""


def test_monitors_beside_that_have_other_kinds_of_instances_take_the_same_rows(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bundle, trace = write_bundle(tmp_path, MARGINS), tmp_path / 'trace.csv'
    trace.write_text('time,person,robot,near,speed\n0,p,,0.5,\n1,,a,,2.0\n2,q,,3,\n'
                     '3,,a,,0.4\n4,,b,,1.5\n9,p,,0.2,\n', encoding='utf-8')
    assert main(['bag', str(bundle), str(trace), '--margins']) == 0
    found = [line.split()[:5] for line in capsys.readouterr().out.splitlines()[4:]]
    assert [line for line in found if 'VIOLATED' in line] == [
        ['NEAR', 'VIOLATED', '1', '2', 's'], ['NEAR[person=q]', 'VIOLATED', '1', '2', 's'],
        ['SLOWER', 'VIOLATED', '1', '7', 's'], ['SLOWER[robot=b]', 'VIOLATED', '1', '7', 's']]


COUNTED = f"""
format: 1
evaluation: {{policy: timed}}
for_each: {{robot: {{most: 5}}}}
inputs:
  speed: {{topic: "/{{robot}}/speed", type: {FLOAT}}}
  limit: {{topic: /limit, type: {FLOAT}, initial: 1}}
requirements:
  - {{id: FLEET, ptltl: "count(robot: speed > 0.5) = 1"}}
  - {{id: EVER, ptltl: "H (count(robot: speed > 0.5) >= 1)"}}
  - {{id: BEFORE, ptltl: "!O[0, 1 s] (count(robot: speed > 0.5) = 0)"}}
  - {{id: MOST, ptltl: "max(robot: speed) < 9.5"}}
  - {{id: LIMIT, ptltl: "limit > 5"}}
  - {{id: OTHERS, ptltl: "speed < limit | count(robot: speed > 0.5) > 1"}}
"""
FIRST_MESSAGES: dict[str, list[Message]] = {
    'of a key': [('/a/speed', 0, 9.0), ('/b/speed', 10**9, 9.0), ('/b/speed', 25 * 10**8, 0.25),
                 ('/limit', 3 * 10**9, 9.5), ('/a/speed', 4 * 10**9, 0.0)],
    'shared': [('/limit', 0, 9.0), ('/a/speed', 10**9, 9.75), ('/a/speed', 3 * 10**9, 8.0)],
    'of two keys': [('/a/speed', 0, 9.75), ('/b/speed', 1, 9.0), ('/limit', 10**9, 0.25)],
}


@pytest.mark.parametrize('messages', FIRST_MESSAGES.values(), ids=FIRST_MESSAGES)
def test_the_first_message_of_a_recording_is_of_its_first_instant_as_in_a_table(
        messages: list[Message], tmp_path: Path) -> None:
    bundle, trace = write_bundle(tmp_path, COUNTED), tmp_path / 'trace.csv'
    lines = [f'{(START + time) // 10**9}.{time % 10**9:09},'
             + (f',,{value}' if topic == '/limit' else f'{topic[1]},{value},')
             for topic, time, value in messages]
    trace.write_text('\n'.join(['time,robot,speed,limit', *lines, '']), encoding='utf-8')
    changes = []
    for source in (trace, write(tmp_path / 'bag', messages)):
        assert main(['bag', str(bundle), str(source), '--csv', str(tmp_path / 'out.csv')]) == 0
        changes.append((tmp_path / 'out.csv').read_text(encoding='utf-8'))
    assert changes[0] == changes[1]


def formula(rng: Random, atoms: list[str], depth: int = 3) -> str:
    kind = rng.randrange(7) if depth else 0
    if kind == 0:
        return f'({rng.choice(atoms)})'
    left, bound = formula(rng, atoms, depth - 1), rng.choice(['0.5', '1', '2'])
    right = formula(rng, atoms, depth - 1) if kind < 4 else ''
    return [f'({left} & {right})', f'({left} | O {right})', f'({left} S[0,1 s] {right})',
            f'(!{left})', f'(O[0,{bound} s] {left})', f'(H[0,{bound} s] {left})'][kind - 1]


def coincident(rng: Random) -> str:
    """Return a bundle whose deadlines, and ends of instances, are at instants of messages."""
    of_all = ['count(robot: speed > 0.5) >= 2', 'any(robot: speed > limit)', 'limit < 1.2',
              'max(robot: speed) < 1.5', 'sum(robot: speed) < 2.0',
              'count(robot: H[0,0.5 s] (speed > 0.2)) > 0',
              'count(robot: O[0,1 s] (speed > limit)) = 0']
    of_one = [*of_all, 'speed < 1.0', 'speed < limit', 'speed >= max(robot: speed)',
              'count(robot: H[0,1 s] (speed < max(robot: speed))) = 0']
    lines = [f'  - {{id: B{n}, ptltl: "{formula(rng, of_all)}"}}' for n in range(8)] + [
        f'  - {{id: R{n}, ptltl: "{formula(rng, of_one)} | speed > 9.0"}}' for n in range(6)]
    forget = rng.choice(['', ', forget: 1', ', forget: 0.5', ', forget: 0.5'])
    initial = rng.choice(['', ', initial: 1.0'])
    return '\n'.join([
        'format: 1', 'evaluation: {policy: timed}',
        f'for_each: {{robot: {{most: 4{forget}}}}}', 'inputs:',
        f'  speed: {{topic: "/{{robot}}/speed", type: {FLOAT}}}',
        f'  limit: {{topic: /limit, type: {FLOAT}{initial}}}', 'requirements:', *lines, ''])


def random_messages(rng: Random) -> list[Message]:
    times, values = [0], [0.0, 0.25, 0.75, 1.0, 1.25, 2.0]
    for _ in range(58):
        times.append(times[-1] + rng.choice([1, 10**8, 25 * 10**7, 25 * 10**7, 5 * 10**8, 10**9]))
    topics = ['/limit', '/a/speed', '/b/speed', '/c/speed']
    return [(topic, time, rng.choice(values))
            for topic, time in zip([*topics, *rng.choices(topics, k=55)], times, strict=True)]


@pytest.mark.parametrize('seed', range(8))
def test_a_recording_is_judged_as_its_table_where_deadlines_and_messages_coincide(
        seed: int, tmp_path: Path) -> None:
    rng = Random(seed)
    bundle = write_bundle(tmp_path, coincident(rng))
    messages = random_messages(rng)
    trace = tmp_path / 'trace.csv'
    trace.write_text('\n'.join(['time,robot,speed,limit', *(
        f'{(START + time) // 10**9}.{time % 10**9:09},'
        + (f',,{value}' if topic == '/limit' else f'{topic[1]},{value},')
        for topic, time, value in messages), '']), encoding='utf-8')
    found = []
    for source in (trace, write(tmp_path / 'bag', messages)):
        with unoptimised():
            result = check_recording(bundle, source, Selection())
        found.append(([(item.id, item.spans, {key: one.spans
                                              for key, one in item.instances.items()})
                       for item in result.findings], result.kinds))
    assert found[0] == found[1]
    assert sum(bool(spans) for _, spans, _ in found[0][0]) > 3


def test_a_key_with_a_carriage_return_is_in_quotes_in_each_file_of_rows(tmp_path: Path) -> None:
    bundle = write_bundle(tmp_path, FLEET.replace('[alpha, beta]', '{most: 2}'))
    trace, out, margins = (str(tmp_path / name) for name in ('t.csv', 'out.csv', 'm.csv'))
    Path(trace).write_bytes(b'robot,speed\n"a\rb",2\n"a\rb",0.5\n')
    assert main(['simulate', str(bundle), '--trace', trace, '--verdicts', out,
                 '--margins', margins]) == 0
    assert main(['bag', str(bundle), trace, '--csv', str(tmp_path / 'bag.csv')]) == 0
    for path in (out, margins, str(tmp_path / 'bag.csv')):
        with open(path, newline='', encoding='utf-8') as file:
            heading, *rows = csv.reader(file)
        assert {row[1] for row in rows} - {''} == {'a\rb'}, path
        assert {len(row) for row in rows} == {len(heading)}


FROM = """
format: 1
evaluation: {policy: POLICY}
INSTANCES
inputs:
  x: {topic: /x, type: std_msgs/msg/Float64}
  y: {topic: "/a/y", type: std_msgs/msg/Float64}
requirements: [{id: X, ptltl: "x < 5"}, {id: Y, ptltl: "y < 5"}]
"""
S = 10**9


@pytest.mark.parametrize('policy', ['timed', 'every_message'])
@pytest.mark.parametrize('is_keyed', [False, True])
def test_a_message_at_the_very_begin_or_end_of_what_is_judged_counts(
        policy: str, is_keyed: bool, tmp_path: Path) -> None:
    text = FROM.replace('POLICY', policy).replace(
        'INSTANCES', 'for_each: {a: {most: 2}}' if is_keyed else '')
    bundle = write_bundle(tmp_path, text.replace('/a/y', '/{a}/y') if is_keyed else text)
    sent = [('/x', 0, 1.0), ('/a/y', S // 2, 9.0), ('/x', S, 9.0), ('/a/y', 2 * S, 1.0),
            ('/x', 3 * S, 1.0), ('/a/y', 4 * S, 9.0), ('/x', 5 * S, 1.0)]
    judged = Selection(begin=Moment(Anchor.START, 2 * S), end=Moment(Anchor.START, 4 * S))
    lines, values = ['time,x,y,a'], dict[str, float]()
    for topic, time, value in sent:
        values = {topic: value} if is_keyed else {**values, topic: value}
        lines.append(f'{(START + time) // S}.{(START + time) % S:09d},{values.get("/x", "")},'
                     f'{values.get("/a/y", "" if is_keyed else 1.0)},{"a" * (topic != "/x")}')
    (tmp_path / 'trace.csv').write_text('\n'.join([*lines, '']), encoding='utf-8')
    for path in (write(tmp_path / 'run', sent), tmp_path / 'trace.csv'):
        with unoptimised():
            found = check_recording(bundle, path, judged).findings
        # With the message at its begin, y is 1 there; with that at its end, it is 9.
        assert [(item.occurrences, item.first) for item in found] == [
            (1, START + 2 * S), (1, START + 4 * S)], path
