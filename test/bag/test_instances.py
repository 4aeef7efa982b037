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

"""Instances in a recording: each is judged as a plain bundle is on the messages of its key."""

from collections.abc import Iterator, Sequence
from csv import DictReader
from dataclasses import replace
from io import StringIO
import json
from math import inf, isfinite
from pathlib import Path
from random import Random
from typing import Any

from bag.recordings import START, statuses_of, TYPES, verdicts_of
from cli.command import run_here as run
from differential.compiled import unoptimised
from fret_monitor.bag.check import (
    check_recording, compiled, opened, read_bundle, RecordingResult, run as run_over, Selection,
)
from fret_monitor.bag.findings import Closest, Findings, Slack
from fret_monitor.bag.fleet import asked
from fret_monitor.bag.moments import Anchor, Moment
from fret_monitor.bag.overview import Overview
from fret_monitor.bag.report import check_and_report
from fret_monitor.bag.results import ChangesCsv
from fret_monitor.bag.violations import open_violations
from fret_monitor.cli.main import main
from fret_monitor.model.policies import Policy
from fret_monitor.model.times import seconds
import numpy
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from strategies import some

FLOAT, BOOL = 'std_msgs/msg/Float64', 'std_msgs/msg/Bool'
JOINTS, POINT = 'sensor_msgs/msg/JointState', 'geometry_msgs/msg/PointStamped'
TRANSFORMS = 'tf2_msgs/msg/TFMessage'
KEYS = ('a', 'b', 'long_key')
# An input of each variable: how a message has it, and how it is read.
INPUTS = {
    'robot': '{topic: "/{robot}/speed", type: std_msgs/msg/Float64}',
    'joint': '{topic: joint_states, type: sensor_msgs/msg/JointState, '
             'field: "effort[name = {joint}]"}',
    'track': '{topic: tracks, type: geometry_msgs/msg/PointStamped, field: point.x, '
             'where: "header.frame_id = {track}"}',
    'frame': '{topic: frames, type: tf2_msgs/msg/TFMessage, '
             'field: "transforms[child_frame_id = {frame}].transform.translation.x"}',
}
COMMON = ('on -> x <= 1.0', 'Y (x <= 1.0)', 'H (O (x > 0.2))', '(x > 0.5) S (x <= 1.4)')
BY_STEPS = ('H[0, 3] (x <= 1.2)', 'O[0, 2] (x > 0.3)', 'H (x < 1.5 | O[1, 3] (x < 0.6))')
BY_TIME = ('H[0, 0.3 s] (x <= 1.2)', 'O[0, 0.2 s] (x > 0.3)', 'H[0.1 s, 0.2 s] (x <= 1.0)')
FRETISH = 'if x > 1.4 the robot shall within 0.3 seconds satisfy x < 0.5'
Message = tuple[int, str, str, Any, frozenset[str]]  # time, topic, type, content, keys in it


def bundle(policy: Policy, variables: Sequence[str], keys: str, key: str = '',
           initial: str = '') -> str:
    """Return a bundle with instances; with a key the plain one in which it is written."""
    timed = policy in (Policy.TIMED, Policy.PERIODIC)
    lines = ['format: 1', f'evaluation: {{policy: {policy.value}'
             + (', period: 0.1' if policy is Policy.PERIODIC else '') + '}']
    if not key:
        lines += ['for_each:', *(f'  {name}: {keys}' for name in variables)]
    lines += ['inputs:', f'  on: {{topic: enable, type: {BOOL}{initial}}}']
    requirements = []
    for name in variables:
        text = INPUTS[name]
        lines.append(f'  x_{name}: ' + (text.replace(f'{{{name}}}', key) if key else text))
        formulas = [*COMMON, *(BY_TIME if timed else BY_STEPS)]
        requirements += [f'  - {{id: {name}_{place}, ptltl: "{formula}"}}'.replace(
            'x ', f'x_{name} ') for place, formula in enumerate(formulas)]
        if timed:
            requirements.append(f'  - {{id: {name}_F, fretish: {FRETISH}}}'.replace(
                'x ', f'x_{name} '))
    return '\n'.join([*lines, 'requirements:', *requirements, ''])


def messages(rng: Random, keys: Sequence[str]) -> Iterator[Message]:
    """Yield random messages of all topics; the first and the last are of the shared input."""
    types = TYPES.types
    stamp = types['builtin_interfaces/msg/Time'](0, 0)

    def header(name: str) -> Any:
        return types['std_msgs/msg/Header'](stamp, name)

    yield 0, '/enable', BOOL, types[BOOL](True), frozenset()
    time = 0
    for _ in range(220):
        time += rng.choice((1, 10**7, 5 * 10**7, 10**8, 25 * 10**7))
        value = round(rng.uniform(0, 1.8), 2)
        key = rng.choice(keys)
        match rng.randrange(5):
            case 0:
                yield time, '/enable', BOOL, types[BOOL](rng.random() < 0.7), frozenset()
            case 1:
                yield time, f'/{key}/speed', FLOAT, types[FLOAT](value), frozenset([key])
            case 2:
                names = rng.choices([*keys, 'other'], k=rng.randrange(5))
                efforts = numpy.array([round(rng.uniform(0, 1.8), 2) for _ in names])
                empty = numpy.array([])
                yield time, '/joint_states', JOINTS, types[JOINTS](
                    header(''), names, empty, empty, efforts[:rng.choice((9, 9, 2))]), \
                    frozenset(names)
            case 3:
                yield time, '/tracks', POINT, types[POINT](
                    header(key), types['geometry_msgs/msg/Point'](value, 0.0, 0.0)), \
                    frozenset([key])
            case _:
                names = rng.choices([*keys, ''], k=rng.randrange(4))
                yield time, '/frames', TRANSFORMS, types[TRANSFORMS]([
                    types['geometry_msgs/msg/TransformStamped'](
                        header('map'), name, types['geometry_msgs/msg/Transform'](
                            types['geometry_msgs/msg/Vector3'](
                                round(rng.uniform(0, 1.8), 2), 0.0, 0.0),
                            types['geometry_msgs/msg/Quaternion'](0.0, 0.0, 0.0, 1.0)))
                    for name in names]), frozenset(names)
    yield time + 10**8, '/enable', BOOL, types[BOOL](True), frozenset()


def record(path: Path, found: Sequence[Message]) -> Path:
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections: dict[str, Any] = {}
        for time, topic, kind, content, _ in found:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=TYPES)
            writer.write(connections[topic], START + time, TYPES.serialize_cdr(content, kind))
    return path


def judged(folder: Path, name: str, text: str, found: Sequence[Message],
           more: int = 0, margins: bool = False) -> RecordingResult:
    file = folder / f'{name}.yaml'
    file.write_text(text, encoding='utf-8')
    selection = Selection(may_miss=True, until=Moment(Anchor.END, more) if more else None,
                          margins=margins)
    path = record(folder / f'{name}_bag', found)
    with unoptimised():
        return check_recording(file, path, selection, asides=asked)


Change = tuple[str, str, str]  # time, requirement, cell
Told = tuple[int, int, str, list[tuple[str, str]]]  # time, level, message, values


def written(folder: Path, name: str, text: str, found: Sequence[Message]) -> tuple[
        list[dict[str, str]], list[tuple[int, Any]], dict[str, list[tuple[int, bool]]]]:
    """Return the rows of `--csv`, and the details and verdicts of `--mcap`."""
    file, rows, out = folder / f'{name}.yaml', StringIO(), folder / f'{name}.mcap'
    file.write_text(text, encoding='utf-8')
    with unoptimised(), open_violations(out, '/') as mcap:
        check_recording(file, record(folder / f'{name}_bag', found), Selection(may_miss=True),
                        changes=[ChangesCsv(rows), mcap])
    assert mcap.without_details == 0
    return [*DictReader(StringIO(rows.getvalue()))], statuses_of(out), verdicts_of(out)


def changes_in(rows: Sequence[dict[str, str]]) -> list[Change]:
    """Return the changes in a plain table, without the first verdicts."""
    found, last = [], dict[str, str]()
    for row in rows:
        found += [(row['time'], name, cell) for name, cell in row.items()
                  if name != 'time' and cell not in ('', last.get(name) or '1')]
        last |= row
    return found


def told(name: str, statuses: Sequence[tuple[int, Any]]) -> list[Told]:
    """Return the details of a requirement or instance."""
    return [(time, item.level, item.message, sorted(
        (each.key, each.value) for each in item.values))
        for time, item in statuses if item.name == name]


@pytest.mark.parametrize(('policy', 'variable'), some([
    (Policy.EVERY_MESSAGE, 'robot'), (Policy.TIMED, 'joint')], 2))
def test_what_is_written_of_an_instance_is_what_is_of_a_plain_bundle_on_its_slice(
        policy: Policy, variable: str, tmp_path: Path) -> None:
    found = list(messages(Random(f'{policy} {variable} written'), KEYS))
    keys = KEYS[:2]
    rows, statuses, verdicts = written(
        tmp_path, 'all', bundle(policy, [*INPUTS], f'[{", ".join(keys)}]'), found)
    violated: dict[str, dict[int, int]] = {}  # a requirement: how many violate it after a time
    for key in keys:
        plain, details, states = written(
            tmp_path, f'plain_{key}', bundle(policy, [variable], '', key),
            slice_of(found, variable, key))
        names = [name for name in plain[0] if name != 'time']
        changes = [(row['time'], name, row[name]) for row in rows if row[variable] == key
                   for name in names if row[name]]
        assert changes == changes_in(plain)
        assert len(changes) > 10
        for name in names:
            assert told(f'{name}[{variable}={key}]', statuses) == told(name, details)
        for topic, series in states.items():
            by_time = dict(series)
            for time in dict(verdicts[topic]):
                last = max((at for at in by_time if at <= time), default=0)
                violated.setdefault(topic, {}).setdefault(time, 0)
                violated[topic][time] += not by_time.get(last, True)
    for topic, counts in violated.items():
        assert {time: count == 0 for time, count in counts.items()} == dict(verdicts[topic])
    assert sum(max(counts.values()) > 0 for counts in violated.values()) > 3


def outline(item: Findings) -> tuple[int, int | None, int]:
    return item.occurrences, item.first, item.longest


def topic_of(variable: str, key: str) -> str:
    return {'robot': f'/{key}/speed', 'joint': '/joint_states', 'track': '/tracks',
            'frame': '/frames'}[variable]


def slice_of(found: Sequence[Message], variable: str, key: str) -> list[Message]:
    """Return the shared messages, and those of a key."""
    topic = topic_of(variable, key)
    return [item for item in found if item[1] == '/enable' or item[1] == topic and key in item[4]]


def test_silences_and_stamps_count_for_each_instance(tmp_path: Path) -> None:
    rng = Random(5)
    found = [item for item in messages(rng, KEYS) if item[1] in ('/joint_states', '/tracks')]
    for time, _, _, content, _ in found:  # the stamps are out of order by up to 50 ms
        stamp = START + time - rng.randrange(50_000_000)
        content.header.stamp = TYPES.types['builtin_interfaces/msg/Time'](
            stamp // 10**9, stamp % 10**9)

    def with_stamps(text: str) -> str:
        text = text.replace('policy: timed', 'policy: timed, stamp: header, reorder: 0.05')
        text = text.replace(f'  on: {{topic: enable, type: {BOOL}}}\n', '').replace('on -> ', '')
        return text.replace('field:', 'timeout: 0.9, startup: 1.5, stale: violate, field:')

    names = ['joint', 'track']
    whole = judged(tmp_path, 'all', with_stamps(bundle(
        Policy.TIMED, names, f'[{", ".join(KEYS[:2])}]')), found)
    by_id = {item.id: item for item in whole.findings}
    occurrences = 0
    for variable, key in (('joint', 'a'), ('track', 'b')):
        own = [item for item in found if item[1] == topic_of(variable, key) and key in item[4]]
        more = found[-1][0] - own[-1][0]
        plain = judged(tmp_path, f'plain_{key}', with_stamps(bundle(
            Policy.TIMED, [variable], '', key)), own, more)
        for item in plain.findings:
            instance = by_id[item.id].instances.get(key.encode(), Findings(item.id))
            assert outline(instance) == outline(item), (key, item.id)
            occurrences += item.occurrences
    assert occurrences > 20


CASES = [(Policy.EVERY_MESSAGE, 'joint'), (Policy.EVERY_MESSAGE, 'track'),
         (Policy.RELEVANT_MESSAGE, 'frame'), (Policy.ALL_INPUTS, 'robot'),
         (Policy.PERIODIC, 'joint'), (Policy.TIMED, 'frame'), (Policy.TIMED, 'robot')]


@pytest.mark.parametrize(('policy', 'variable'), some(CASES, 2))
def test_an_instance_of_a_listed_key_is_judged_as_a_plain_bundle_on_its_slice(
        policy: Policy, variable: str, tmp_path: Path) -> None:
    found = list(messages(Random(f'{policy} {variable}'), KEYS))
    keys = ', '.join(KEYS[:2])
    whole = judged(tmp_path, 'all', bundle(policy, [*INPUTS], f'[{keys}]'), found)
    by_id = {item.id: item for item in whole.findings}
    occurrences = 0
    for key in KEYS[:2]:
        plain = judged(tmp_path, f'plain_{key}', bundle(policy, [variable], '', key),
                       slice_of(found, variable, key))
        for item in plain.findings:
            instance = by_id[item.id].instances.get(key.encode(), Findings(item.id))
            assert outline(instance) == outline(item), (key, item.id)
            occurrences += item.occurrences
    assert occurrences > 20


@pytest.mark.parametrize(('policy', 'variable'), [
    (Policy.EVERY_MESSAGE, 'robot'), (Policy.TIMED, 'joint'), (Policy.RELEVANT_MESSAGE, 'track')])
def test_an_instance_of_a_found_key_begins_with_its_first_message(
        policy: Policy, variable: str, tmp_path: Path) -> None:
    key = KEYS[2]
    found = list(messages(Random(f'{policy} {variable} found'), KEYS))
    whole = judged(tmp_path, 'all', bundle(policy, [*INPUTS], '{most: 9}'), found)
    own = slice_of(found, variable, key)
    begin = next(place for place, item in enumerate(own) if item[1] != '/enable')
    value = [item[3].data for item in own[:begin]][-1]
    plain = judged(tmp_path, 'plain', bundle(
        policy, [variable], '', key, f', initial: {str(bool(value)).lower()}'), own[begin:])
    by_id = {item.id: item for item in whole.findings}
    for item in plain.findings:
        instance = by_id[item.id].instances.get(key.encode(), Findings(item.id))
        assert outline(instance) == outline(item), item.id
    assert sum(item.occurrences for item in plain.findings) > 5


@pytest.mark.parametrize(('policy', 'variable'), some([
    (Policy.TIMED, 'joint'), (Policy.EVERY_MESSAGE, 'robot'), (Policy.PERIODIC, 'track')], 2))
def test_margins_and_slack_of_an_instance_are_those_of_a_plain_bundle_on_its_slice(
        policy: Policy, variable: str, tmp_path: Path) -> None:
    found = list(messages(Random(f'{policy} {variable} margins'), KEYS))

    def with_rates(text: str) -> str:
        return text.replace('{topic:', '{max_rate: 1000, topic:')

    whole = judged(tmp_path, 'all', with_rates(bundle(
        policy, [variable, 'frame'], f'[{", ".join(KEYS[:2])}]')), found, margins=True)
    by_id = {item.id: item for item in whole.findings}
    assert whole.errors == ()
    known: list[Closest] = []
    waiting: list[int] = []
    for key in KEYS[:2]:
        plain = judged(tmp_path, f'plain_{key}', with_rates(bundle(policy, [variable], '', key)),
                       slice_of(found, variable, key), margins=True)
        for item in plain.findings:
            instance = by_id[item.id].closest_of.get(key.encode())
            expected = item.closest and replace(item.closest, key=f'{variable}={key}')
            assert instance == expected, (key, item.id)
            known += [expected] if expected else []
            assert by_id[item.id].slack_of.get(key.encode()) == (
                item.slack and replace(item.slack, key=f'{variable}={key}')), (key, item.id)
            waiting += [] if item.waiting is None else [item.waiting]
    assert len(known) > 8
    timed = [item for item in whole.findings if item.id == f'{variable}_F']
    assert all(len(item.slack_of) == 2 and len(item.slacks) > 3 for item in timed)
    assert len(timed) == (policy in (Policy.TIMED, Policy.PERIODIC))
    assert [item.waiting for item in timed] == [min(waiting, default=None) for _ in timed]
    for item in whole.findings:
        assert item.closest == min(item.closest_of.values(), key=lambda found: found.margin,
                                   default=None)


def lanes_of(folder: Path, name: str, text: str, found: Sequence[Message]) -> dict[
        str, list[float | None]]:
    """Return the margins in the lanes of a report, by requirement."""
    file, path = folder / f'{name}.yaml', record(folder / f'{name}_bag', found)
    file.write_text(text, encoding='utf-8')
    selection = Selection(may_miss=True, margins=True)
    with unoptimised(), opened(path) as (recording, find):
        monitor = compiled(read_bundle(file, selection, find)).monitor
        overview = Overview(monitor)
        result = run_over(monitor, recording, selection, changes=[overview],
                          watch=overview.watch)
    return {item.id: [None if margin is None else margin.value
                      for margin in overview.margins(index)]
            for index, item in enumerate(result.findings)}


@pytest.mark.parametrize(('policy', 'variable'), some([
    (Policy.TIMED, 'robot'), (Policy.EVERY_MESSAGE, 'joint')], 2))
def test_the_lane_of_a_margin_is_the_least_of_all_keys(
        policy: Policy, variable: str, tmp_path: Path) -> None:
    found = list(messages(Random(f'{policy} {variable} lanes'), KEYS))

    def lanes(key: str) -> dict[str, list[float | None]]:
        text = bundle(policy, [variable], f'[{", ".join(KEYS[:2])}]', key)
        return lanes_of(tmp_path, f'of_{key}', text.replace('{topic:', '{max_rate: 1000, topic:'),
                        slice_of(found, variable, key) if key else found)

    whole, one, other = lanes(''), lanes(KEYS[0]), lanes(KEYS[1])
    values = 0
    for name, lane in whole.items():
        expected = [min((value for value in values if value is not None), default=None)
                    for values in zip(one[name], other[name], strict=True)]
        assert lane == expected, name
        values += len({value for value in lane if value is not None and isfinite(value)})
    assert values > 30


def test_an_instance_that_has_ended_is_not_in_the_lane(tmp_path: Path) -> None:
    text = f"""format: 1
for_each: {{robot: {{most: 2, forget: 2}}}}
inputs: {{x: {{topic: "/{{robot}}/speed", type: {FLOAT}}}}}
requirements: [{{id: LOW, ptltl: "x < 10"}}]
"""
    lane = lanes_of(tmp_path, 'ending', text, [
        (round(second * 1e9), f'/{key}/speed', FLOAT, TYPES.types[FLOAT](value), frozenset())
        for second, key, value in [
            (0, 'a', 9.5), (0.5, 'b', 1.0), (1.9, 'b', 2.0), (3.8, 'b', 3.0), (6.9, 'b', 1.0)]])
    parts = lane['LOW']
    assert [parts[int(second / 6.9 * len(parts))] for second in (1, 1.95, 3, 5, 6.3)] == [
        0.5, 0.5, 8.0, 7.0, inf]


def test_an_instance_that_is_not_forgotten_by_the_end_has_not_ended(tmp_path: Path) -> None:
    # All three wait for something that is due behind the end.
    result = judged(tmp_path, 'ending', f"""format: 1
evaluation: {{policy: timed}}
for_each: {{robot: {{most: 3, forget: 2}}}}
inputs: {{x: {{topic: "/{{robot}}/speed", type: {FLOAT}}}}}
requirements:
  - {{id: LOW, fretish: "whenever x > 1 the robot shall within 5 seconds satisfy x < 1"}}
""", [(round(second * 1e9), f'/{key}/speed', FLOAT, TYPES.types[FLOAT](2.0), frozenset[str]())
      for second, key in [(0, 'a'), (2.5, 'b'), (3, 'c')]])
    counts = result.kinds['robot']
    assert (counts.begun, counts.ended, counts.open, counts.alive) == (3, 1, 1, 2)


def test_the_least_margin_of_a_key_is_that_of_all_its_instances(tmp_path: Path) -> None:
    file = tmp_path / 'bundle.yaml'
    file.write_text(f"""format: 1
for_each: {{robot: {{most: 2, forget: 2}}}}
inputs: {{x: {{topic: "/{{robot}}/speed", type: {FLOAT}, scale: 2}}}}
requirements:
  - {{id: LOW, ptltl: "x < 10"}}
""")
    path = record(tmp_path / 'bag', [
        (round(second * 1e9), f'/{key}/speed', FLOAT, TYPES.types[FLOAT](value), frozenset([key]))
        for second, key, value in [
            (0, 'a', 7.0), (1, 'b', 3.0), (1.5, 'a', 6.0), (3.25, 'b', 12.0), (3.5, 'b', 2.0),
            (5, 'a', 9.0), (5.6, 'c', 0.0), (10, 'b', 1.0), (10.5, 'c', 8.5)]])
    junit, results = tmp_path / 'junit.xml', tmp_path / 'results.jsonl'
    with unoptimised():
        done = run('bag', file, path, '--margins', '--junit', junit, '--results', results)
    assert done.err == ''
    lines = [line.split() for line in done.out.splitlines() if 'LOW' in line]
    assert lines[0][-7:] == ['-1', '3.25', 's', 'x', '<', '10.0', '(-2)', 'of', 'robot=b'][-7:]
    assert [line[:1] + line[-5:] for line in lines[1:]] == [
        ['LOW[robot=b]', 's', 'x', '<', '10.0', '(-2)'],
        ['LOW[robot=a]', 's', 'x', '<', '10.0', '(1)'],
        ['LOW[robot=c]', 's', 'x', '<', '10.0', '(1.5)']]
    found = json.loads(results.read_text())['requirements']['LOW']
    assert {key: (item['margin'], item['at']) for key, item in found['closest_of'].items()} == {
        'a': (0.5, seconds(START + 5 * 10**9)), 'b': (-1.0, seconds(START + 325 * 10**7)),
        'c': (0.75, seconds(START + 105 * 10**8))}
    assert (found['closest']['margin'], found['closest']['key']) == (-1.0, 'robot=b')
    assert '<property name="closest.key" value="robot=b"' in junit.read_text()
    with unoptimised():
        part = check_recording(file, path, Selection(
            margins=True, begin=Moment(Anchor.START, 4 * 10**9)))
    assert {key: item.margin for key, item in part.findings[0].closest_of.items()} == {
        b'a': 0.5, b'b': 4.5, b'c': 0.75}


def test_an_instance_that_ends_has_no_response_from_then_on(tmp_path: Path) -> None:
    file = tmp_path / 'bundle.yaml'
    sentence = 'upon x > 5 the robot shall within {} seconds satisfy x < 1'
    file.write_text(f"""format: 1
evaluation: {{policy: timed}}
for_each: {{robot: {{most: 3, forget: 2}}}}
inputs: {{x: {{topic: "/{{robot}}/speed", type: {FLOAT}, max_rate: 10}}}}
requirements:
  - {{id: SHORT, fretish: "{sentence.format(1)}"}}
  - {{id: LONG, fretish: "{sentence.format(5)}"}}
""")
    path = record(tmp_path / 'bag', [
        (round(second * 1e9), f'/{key}/speed', FLOAT, TYPES.types[FLOAT](value), frozenset([key]))
        for second, key, value in [
            (0, 'a', 0.0), (0.5, 'b', 0.0), (1, 'a', 6.0), (2, 'b', 9.0), (2.5, 'b', 0.5),
            (6, 'c', 0.0)]])
    with unoptimised():
        done = run('bag', file, path, '--margins', '--json', '--report', tmp_path / 'report.html')
    short, long = json.loads(done.out)['requirements'].values()

    def at(second: float) -> str:
        return seconds(START + round(second * 1e9))

    answered = {'unit': 's', 'trigger': at(2), 'until': at(2.5), 'key': 'robot=b'}
    late = {'left': -1.0, 'unit': 's', 'trigger': at(1), 'until': None, 'key': 'robot=a'}
    assert short['slack_of'] == {'a': late, 'b': {'left': 0.5, **answered}}
    assert short['slack'] == late
    assert long['slack_of'] == {'b': {'left': 4.5, **answered}}
    assert 'waiting' not in short and 'waiting' not in long
    page = (tmp_path / 'report.html').read_text()
    assert page.count('<br>Slack: -1 s at most of robot=a.') == 1
    assert '<p>Least slack: 4.5 s of robot=b.</p>' in page
    with unoptimised():
        rows = run('bag', file, path, '--margins').out.splitlines()
    assert [row.split()[0] for row in rows if '-1 s' in row] == ['SHORT', 'SHORT[robot=a]']
    assert [row.split()[0] for row in rows if '-1 s of robot=a' in row] == ['SHORT']


def test_a_response_that_is_missing_at_the_end_counts_the_steps_of_its_key(
        tmp_path: Path) -> None:
    text = f"""format: 1
for_each: {{robot: {{most: 3}}}}
inputs: {{x: {{topic: "/{{robot}}/speed", type: {FLOAT}}}}}
requirements:
  - {{id: SHORT, fretish: upon x > 5 the robot shall within 2 ticks satisfy x < 1}}
  - {{id: LONG, fretish: upon x > 5 the robot shall within 4 ticks satisfy x < 1}}
"""
    values = [('a', 0.0), ('b', 9.0), ('a', 6.0), ('a', 5.0), ('b', 0.0), ('a', 5.0), ('a', 5.0)]
    short, long = judged(tmp_path, 'bundle', text, [
        (number, f'/{key}/speed', FLOAT, TYPES.types[FLOAT](value), frozenset())
        for number, (key, value) in enumerate(values)], margins=True).findings
    assert short.slack_of == {
        b'a': Slack(-2, 'steps', START + 2, None, 'robot=a'),
        b'b': Slack(1, 'steps', START + 1, START + 4, 'robot=b')}
    assert long.slack_of == {b'b': Slack(3, 'steps', START + 1, START + 4, 'robot=b')}
    assert (short.waiting, long.waiting) == (None, START + 2)


def test_the_table_has_ten_keys_of_many(tmp_path: Path) -> None:
    file = tmp_path / 'bundle.yaml'
    file.write_text(f"""format: 1
for_each: {{robot: {{most: 20}}}}
inputs: {{x: {{topic: "/{{robot}}/speed", type: {FLOAT}}}}}
requirements: [{{id: LOW, ptltl: "x < 10"}}]
""")
    for name, value, left in (('violated', 11.0, '3 instances more'), ('satisfied', 9.0, '')):
        path = record(tmp_path / name, [
            (n, f'/k{n:02}/speed', FLOAT, TYPES.types[FLOAT](value), frozenset())
            for n in range(13)])
        with unoptimised():
            rows = run('bag', file, path, '--margins').out.splitlines()
        named = [row for row in rows if row.startswith('LOW[robot=k')]
        assert len(named) == 10
        assert [row.split(maxsplit=1)[1] for row in rows if 'robot=...' in row] == [left] * bool(
            left)


READERS = (  # NEAR: how many are near; MANY: in how many of them
    'on -> x <= 1.2 | NEAR <= 1', 'O[0, SPAN] (NEAR < 2 & x < 1.5)',
    'H[0, SPAN] (NEAR < 2 | x > 1.0)', 'x <= 1.4 | MANY > 0', 'Y (MANY < 1) | x < 0.8')


def reading_aggregates(policy: Policy, key: str = '') -> str:
    """Return a bundle of instances that read aggregates; with a key, what it is of it."""
    def near(one: str) -> str:
        return f'{one} > 0.9'

    if key:
        count = ' + '.join(f'(if {near(f"x_{one}")} then 1 else 0)' for one in KEYS[:2])
        many = ' + '.join(f'(if x_{one} < 1.7 and {count} > 1 then 1 else 0)' for one in KEYS[:2])
    else:
        count = f'count(robot: {near("x")})'
        many = 'count(robot: x < 1.7 and near > 1)'
    inputs = [f'  x_{one}: {{topic: "/{one}/speed", type: {FLOAT}, initial: 0.0}}'
              for one in KEYS[:2]] if key else [
        f'  x: {{topic: "/{{robot}}/speed", type: {FLOAT}, initial: 0.0}}']
    span = '0.3 s' if policy in (Policy.TIMED, Policy.PERIODIC) else '4'
    formulas = [item.replace('SPAN', span).replace('NEAR', 'near').replace('MANY', 'many')
                for item in READERS]
    if key:
        formulas = [item.replace('x ', f'x_{key} ') for item in formulas]
    return '\n'.join([
        'format: 1', f'evaluation: {{policy: {policy.value}'
        + (', period: 0.1' if policy is Policy.PERIODIC else '') + '}',
        *([] if key else [f'for_each: {{robot: [{", ".join(KEYS[:2])}]}}']), 'inputs:', *inputs,
        f'  on: {{topic: enable, type: {BOOL}}}', 'definitions:',
        f'  near: {{cocospec: "{count}"}}', f'  many: {{cocospec: "{many}"}}', 'requirements:',
        *(f'  - {{id: R_{place}, ptltl: "{item}"}}' for place, item in enumerate(formulas)), ''])


@pytest.mark.parametrize('policy', [
    Policy.RELEVANT_MESSAGE, Policy.TIMED, Policy.PERIODIC])
def test_an_instance_reads_what_all_have_at_this_message(policy: Policy, tmp_path: Path) -> None:
    # Both are there from the start: the values over them are formulas over two plain inputs.
    rng, types = Random(f'{policy} aggregates'), TYPES.types
    found = [(0, '/enable', BOOL, types[BOOL](True), frozenset[str]())]
    for number in range(160):
        topic = rng.choice(['/enable', '/a/speed', '/a/speed', '/b/speed', '/b/speed'])
        content = types[BOOL](rng.random() < 0.7) if topic == '/enable' else types[FLOAT](
            round(rng.uniform(0.2, 1.8), 2) if number > 6 else 0.5)
        found.append((found[-1][0] + rng.choice((1, 10**7, 10**8, 25 * 10**7)), topic,
                      BOOL if topic == '/enable' else FLOAT, content, frozenset[str]()))
    whole = judged(tmp_path, 'all', reading_aggregates(policy), found)
    assert not whole.errors
    counts = []
    for key in KEYS[:2]:
        plain = judged(tmp_path, f'plain_{key}', reading_aggregates(policy, key), found)
        for item, other in zip(whole.findings, plain.findings, strict=True):
            instance = item.instances.get(key.encode(), Findings(item.id))
            assert outline(instance) == outline(other), (key, item.id)
            counts.append(other.occurrences)
    assert sum(count > 2 for count in counts) > 5
    assert whole.kinds['robot'].begun == 2


def test_a_message_that_where_does_not_select_is_none(tmp_path: Path) -> None:
    text = bundle(Policy.RELEVANT_MESSAGE, ['track'], '', 'a')
    two = text.replace('requirements:\n', (
        '  y: {topic: tracks, type: geometry_msgs/msg/PointStamped, field: point.x, '
        'where: "header.frame_id = b"}\nrequirements:\n  - {id: OTHER, ptltl: "y <= 1.0"}\n'))
    found = list(messages(Random(3), KEYS))
    result = judged(tmp_path, 'two', two, found)
    other, *both = result.findings
    assert not result.errors
    alone = judged(tmp_path, 'one', text, slice_of(found, 'track', 'a')).findings
    assert [*map(outline, both)] == [*map(outline, alone)]
    assert [item.violations for item in both] == [item.violations for item in alone]
    of_b = [item[3].point.x > 1.0 for item in found if item[1] == '/tracks' and 'b' in item[4]]
    assert other.violations == sum(of_b) > 0
    assert sum(item.occurrences for item in alone) > 10


def test_an_answer_moved_by_a_nanosecond_to_its_deadline_is_in_time(tmp_path: Path) -> None:
    plain = ('format: 1\nevaluation: {policy: timed}\ninputs:\n'
             f'  p: {{topic: p, type: {BOOL}}}\n  q: {{topic: q, type: {BOOL}}}\n'
             f'  n: {{topic: /a/x, type: {FLOAT}}}\n'
             'requirements:\n  - {id: NEAR, ptltl: "O[11 ns, 11 ns] p -> O[0, 11 ns] q"}\n')
    keyed = plain.replace('inputs:', 'for_each: {robot: {most: 3, forget: 9}}\ninputs:').replace(
        '/a/x', '"/{robot}/x"') + '  - {id: OWN, ptltl: "n <= 1.0"}\n'
    make, number = TYPES.types[BOOL], TYPES.types[FLOAT]
    for time, n in ((10, 0), (11, 1)):
        # After another message at its stamp, `q` takes effect a nanosecond later.
        found: list[Message] = [
            (0, '/q', BOOL, make(False), frozenset()), (1, '/p', BOOL, make(True), frozenset()),
            (5, '/p', BOOL, make(False), frozenset()),
            (time + 1, '/a/x', FLOAT, number(2.0), frozenset()),
            (time + 1, '/q', BOOL, make(True), frozenset()),
            (50, '/q', BOOL, make(False), frozenset())]
        for name, text in (('plain', plain), ('keyed', keyed)):
            findings = judged(tmp_path, f'{name}{n}', text, found, 100).findings
            assert findings[0].occurrences == n, name


RATED = """
format: 1
evaluation: {policy: timed}
for_each: {robot: {most: 5, forget: 0.7}}
inputs:
  x: {topic: "/{robot}/speed", type: std_msgs/msg/Float64, max_rate: 3}
requirements:
  - {id: SOME, ptltl: "countOver(2 s, x > 0.9) <= 2"}
"""


def lives_of(found: Sequence[Message], key: str) -> list[list[Message]]:
    """Return the messages of each instance of a key: a pause of 0.7 s ends it."""
    lives: list[list[Message]] = []
    for item in found:
        if item[1] == f'/{key}/speed':
            if not lives or item[0] - lives[-1][-1][0] > 7 * 10**8:
                lives.append([])
            lives[-1].append(item)
    return lives


def test_changes_that_find_no_room_are_counted_in_all_instances(tmp_path: Path) -> None:
    rng = Random(8)
    found = [(place * 10**7 + (10**9 if place > 150 else 0), f'/{key}/speed', FLOAT,
              TYPES.types[FLOAT](round(rng.uniform(0, 1.8), 2)), frozenset([key]))
             for place, key in enumerate(rng.choices(KEYS, k=300))]
    lives = [life for key in KEYS for life in lives_of(found, key)]
    assert len(lives) > len(KEYS)
    expected = 0
    for place, life in enumerate(lives):
        key, = life[0][4]
        text = RATED.replace('{robot}', key).replace('for_each: {robot: {most: 5, forget: 0.7}}\n',
                                                     '')
        expected += overflows_in(judged(tmp_path, f'life_{place}', text, life))
    assert expected > 20
    assert overflows_in(judged(tmp_path, 'fleet', RATED, found)) == expected


@pytest.mark.parametrize(('mapped', 'initial'), [
    ('"/{robot}/speed"', ', initial: 3'), ('speed, where: "header.frame_id = {robot}"', '')])
def test_topics_of_listed_keys_without_a_message_are_as_those_of_a_plain_bundle(
        mapped: str, initial: str, tmp_path: Path) -> None:
    whole = f"""format: 1
for_each: {{robot: [a]}}
inputs:
  on: {{topic: enable, type: {BOOL}}}
  x: {{topic: {mapped}, type: {POINT}, field: point.x{initial}}}
requirements: [{{id: R, ptltl: "on & x < 2"}}]
"""
    path = tmp_path / 'bag'
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for topic in ('/a/speed', '/speed'):
            writer.add_connection(topic, POINT, typestore=TYPES)
        writer.write(writer.add_connection('/enable', BOOL, typestore=TYPES), START,
                     TYPES.serialize_cdr(TYPES.types[BOOL](True), BOOL))
    results = []
    for text in (whole, whole.replace('{robot}', 'a').replace('for_each: {robot: [a]}\n', '')):
        (tmp_path / 'bundle.yaml').write_text(text, encoding='utf-8')
        with unoptimised():
            results.append(check_recording(tmp_path / 'bundle.yaml', path, Selection()))
    assert [(item.verdict, item.occurrences) for item in results[0].findings] == [
        (item.verdict, item.occurrences) for item in results[1].findings]
    assert [item.replace('{robot}', 'a') for item in results[0].errors] == [*results[1].errors]
    assert bool(results[0].errors) == (not initial)


def overflows_in(result: RecordingResult) -> int:
    counts = [int(error.split(' ')[0].replace(',', '')) for error in result.errors
              if 'came faster than max_rate says' in error]
    return sum(counts)


def test_the_topic_of_a_listed_key_may_have_another_name_in_the_recording(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = bundle(Policy.RELEVANT_MESSAGE, ['robot'], '[a, b, silent]')
    found = [item for item in messages(Random(5), KEYS[:2]) if item[1] != '/joint_states']
    whole = judged(tmp_path, 'own', text, found)
    path = record(tmp_path / 'renamed', [
        (time, {'/b/speed': '/unit/x'}.get(topic, topic), *more)
        for time, topic, *more in found])
    file = tmp_path / 'own.yaml'
    with unoptimised():
        renamed = check_and_report(file, path, Selection(may_miss=True, remaps={
            '/b/speed': '/unit/x', '/silent/speed': '/unit/y'}), tmp_path / 'out.html')
        assert not whole.errors
        assert not renamed.errors
        for one, other in zip(whole.findings, renamed.findings, strict=True):
            assert outline(one) == outline(other)
            assert {*one.instances} == {*other.instances}
        assert any(b'b' in item.instances for item in whole.findings)
        missing = check_recording(file, path, Selection())
        assert '/b/speed was not recorded as std_msgs/msg/Float64' in missing.errors
    for remaps, message in ((('/c/speed:=/unit/x',), "the bundle has no topic '/c/speed'"),
                            (('/b/speed:=/x', '/a/speed:=/x'),
                             "two topics of '/{robot}/speed' are one with these names")):
        arguments = [part for item in remaps for part in ('--remap', item)]
        assert main(['bag', str(file), str(path), *arguments]) == 1
        assert message in capsys.readouterr().err
