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

"""Pairs in a recording: each is judged as a plain bundle is on the messages of its keys."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
import json
from pathlib import Path
from random import Random
from typing import Any

from bag.recordings import START, TYPES
from bag.test_instances import (
    BOOL, changes_in, FLOAT, JOINTS, judged, Message, outline, POINT, record, told, TRANSFORMS,
    written,
)
from bag.test_keyed_traces import both, reported
from bag.test_report_by_key import lanes, page_of
from differential.compiled import unoptimised
from fret_monitor.bag.check import check_recording, Selection
from fret_monitor.bag.findings import Findings
from fret_monitor.bag.results import json_line, table
from fret_monitor.cli.main import main
from fret_monitor.model.names import pair_key
from fret_monitor.model.policies import Policy
import numpy
import pytest
from strategies import some
from traces.test_pairs import JOINT, pair_bundle, pair_rows, ROBOT

ROBOTS, TRACKS = ('a', 'long_robot', 'c'), ('1', '-20', '3')
OF_ROBOT, OF_TRACK, OF_BOTH = ('speed', 'many'), ('human',), ('near', 'load', 'seen')
INPUTS = {
    'on': f'{{topic: enable, type: {BOOL}}}',
    'speed': f'{{topic: "/{{robot}}/speed", type: {FLOAT}}}',
    'many': f'{{topic: "/{{robot}}/tracks", type: {TRANSFORMS}, field: len(transforms)}}',
    'human': f'{{topic: human, type: {POINT}, field: point.x, '
             'where: "header.frame_id = {track}"}',
    'near': f'{{topic: "/{{robot}}/tracks", type: {TRANSFORMS}, '
            'field: "transforms[child_frame_id = {track}].transform.translation.x"}',
    'load': f'{{topic: load, type: {JOINTS}, field: "effort[name = {{track}}]", '
            'where: "header.frame_id = {robot}"}',
    'seen': f'{{topic: "/{{robot}}/seen", type: {POINT}, field: point.x, '
            'where: "header.frame_id = {track}"}',
}
FORMULAS = (
    'on -> near <= 1.5', 'Y (near <= 1.0) | speed > 1.2', 'near <= 0.7 | human > 0.9 | many > 2',
    '(seen > 0.5) S (load <= 1.4)', 'H (O (seen > 0.2 & human < 1.7))', 'load < 1.2 | speed > 0.9')
BY_STEPS = ('H[0, 3] (near <= 1.2 | speed < 0.4)', 'O[0, 2] (load > 0.3)')
BY_TIME = ('H[0, 0.3 s] (near <= 1.2 | speed < 0.4)', 'O[0, 0.2 s] (human > 0.3 | seen < 1.2)')
Pair = tuple[str, str]


def bundle(policy: Policy, robots: str, tracks: str, pair: Pair | None = None,
           initial: Mapping[str, str] | None = None, swaps: bool = False) -> str:
    """Return a bundle with pairs; with one the plain one in which its keys are written."""
    is_timed = policy in (Policy.TIMED, Policy.PERIODIC)
    variables = [f'  robot: {robots}', f'  track: {tracks}']
    inputs = [f'  {name}: {text[:-1]}{(initial or {}).get(name, "")}}}'
              for name, text in INPUTS.items()]
    formulas = [*FORMULAS, *(BY_TIME if is_timed else BY_STEPS)]
    text = '\n'.join([
        'format: 1', f'evaluation: {{policy: {policy.value}'
        + (', period: 0.1' if policy is Policy.PERIODIC else '') + '}',
        *([] if pair else ['for_each:', *reversed(variables)] if swaps else
          ['for_each:', *variables]), 'inputs:', *inputs, 'requirements:',
        *(f'  - {{id: P_{place}, ptltl: "{item}"}}' for place, item in enumerate(formulas)), ''])
    return text if pair is None else text.replace('{robot}', pair[0]).replace('{track}', pair[1])


def messages(rng: Random) -> Iterator[Message]:
    """Yield random messages, each with the keys in it, the robot first; of all types."""
    types = TYPES.types

    def header(name: str) -> Any:
        return types['std_msgs/msg/Header'](types['builtin_interfaces/msg/Time'](0, 0), name)

    def value() -> float:
        return round(rng.uniform(0, 1.8), 2)

    def point(name: str) -> Any:
        return types[POINT](header(name), types['geometry_msgs/msg/Point'](value(), 0.0, 0.0))

    time, none = 0, numpy.array([])
    yield 0, '/enable', BOOL, types[BOOL](True), frozenset()
    for _ in range(320):
        time += rng.choice((1, 10**7, 5 * 10**7, 10**8))
        robot, track = rng.choice(ROBOTS), rng.choice(TRACKS)
        names = rng.choices([*TRACKS, 'other', ''], k=rng.randrange(5))
        match rng.randrange(8):
            case 0:
                yield time, '/enable', BOOL, types[BOOL](rng.random() < 0.7), frozenset()
            case 1 | 2:
                yield time, f'/{robot}/speed', FLOAT, types[FLOAT](value()), frozenset([robot])
            case 3:
                yield time, '/human', POINT, point(track), frozenset([track])
            case 4 | 5:
                yield time, f'/{robot}/tracks', TRANSFORMS, types[TRANSFORMS]([
                    types['geometry_msgs/msg/TransformStamped'](
                        header('map'), name, types['geometry_msgs/msg/Transform'](
                            types['geometry_msgs/msg/Vector3'](value(), 0.0, 0.0),
                            types['geometry_msgs/msg/Quaternion'](0.0, 0.0, 0.0, 1.0)))
                    for name in names]), frozenset([robot, *names])
            case 6:
                yield time, '/load', JOINTS, types[JOINTS](
                    header(robot), names, none, none,
                    numpy.array([value() for _ in names])), frozenset([robot, *names])
            case _:
                yield time, f'/{robot}/seen', POINT, point(track), frozenset([robot, track])
    yield time + 10**8, '/enable', BOOL, types[BOOL](True), frozenset()


def slice_of(found: Sequence[Message], pair: Pair) -> list[Message]:
    """Return the messages of a pair: shared, of one of its keys, of both."""
    alone = ('/enable', f'/{pair[0]}/speed', f'/{pair[0]}/tracks', '/human')
    return [item for item in found if item[1] in alone
            or item[1] in ('/load', f'/{pair[0]}/seen') and item[4].issuperset(pair)]


def last_to_begin(found: Sequence[Message]) -> Pair:
    """Return the pair whose first message is the last one."""
    begin: dict[Pair, int] = {}
    for number, item in enumerate(found):
        for pair in product(ROBOTS, TRACKS):
            if item[4].issuperset(pair):
                begin.setdefault(pair, number)
    return max(begin, key=lambda pair: begin[pair])


CASES = [(Policy.EVERY_MESSAGE, True), (Policy.TIMED, True), (Policy.PERIODIC, False),
         (Policy.RELEVANT_MESSAGE, False), (Policy.ALL_INPUTS, True)]


@pytest.mark.parametrize(('policy', 'swaps'), some(CASES))
def test_a_pair_of_listed_keys_is_judged_as_a_plain_bundle_on_its_slice(
        policy: Policy, swaps: bool, tmp_path: Path) -> None:
    found = list(messages(Random(f'{policy}')))

    def with_rates(text: str) -> str:  # of margins
        return text.replace('{topic:', '{max_rate: 1000, topic:')

    whole = judged(tmp_path, 'all', with_rates(bundle(
        policy, f'[{", ".join(ROBOTS[:2])}]', f'["{TRACKS[0]}", "{TRACKS[1]}"]', swaps=swaps)),
        found, margins=True)
    by_id = {item.id: item for item in whole.findings}
    occurrences = 0
    for pair in ((ROBOTS[0], TRACKS[1]), (ROBOTS[1], TRACKS[0])):
        plain = judged(tmp_path, '_'.join(pair), with_rates(bundle(policy, '', '', pair)),
                       slice_of(found, pair), margins=True)
        key = pair_key(*(item.encode() for item in (pair[::-1] if swaps else pair)))
        for item in plain.findings:
            instance = by_id[item.id].instances.get(key, Findings(item.id))
            assert outline(instance) == outline(item), (pair, item.id)
            occurrences += item.occurrences
            assert item.closest is not None
            assert by_id[item.id].closest_of[key] == replace(
                item.closest, key=by_id[item.id].shown_key(key)), (pair, item.id)
    assert occurrences > 10


@pytest.mark.parametrize(('policy', 'robots'), some([
    (Policy.TIMED, '{most: 3}'), (Policy.EVERY_MESSAGE, '[a, long_robot, c]'),
    (Policy.RELEVANT_MESSAGE, '{most: 3}')]))
def test_a_pair_of_found_keys_begins_with_its_first_message(
        policy: Policy, robots: str, tmp_path: Path) -> None:
    found = list(messages(Random(f'{policy} found')))
    pair = last_to_begin(found)
    whole = judged(tmp_path, 'all', bundle(policy, robots, '{most: 5}'), found)
    own = slice_of(found, pair)
    begin = next(place for place, item in enumerate(own) if item[4].issuperset(pair))
    initial: dict[str, str] = {}
    for _, topic, _, content, keys in own[:begin]:
        if topic == '/enable':
            initial['on'] = str(bool(content.data)).lower()
        elif topic == '/human':
            initial |= {'human': str(content.point.x)} if pair[1] in keys else {}
        elif topic == f'/{pair[0]}/speed':
            initial['speed'] = str(content.data)
        else:
            initial['many'] = str(len(content.transforms))
    plain = judged(tmp_path, 'plain', bundle(
        policy, '', '', pair, {name: f', initial: {value}' for name, value in initial.items()}),
        own[begin:])
    assert len(initial) > 2
    by_id = {item.id: item for item in whole.findings}
    for item in plain.findings:
        instance = by_id[item.id].instances.get(
            pair_key(*(one.encode() for one in pair)), Findings(item.id))
        assert outline(instance) == outline(item), item.id
    assert sum(item.occurrences for item in plain.findings) > 5
    counts = whole.kinds
    assert counts['robot and track'].begun == len(ROBOTS) * len(TRACKS) + len(ROBOTS)  # 'other'
    empty = counts['robot and track'].beyond
    assert 1 < empty == counts['robot and track'].unsized
    assert f'{empty} messages with a key of robot and track not evaluated: a key has 1 to 255 ' \
        'bytes' in whole.errors


def test_what_is_written_of_a_pair_names_both_keys(tmp_path: Path) -> None:
    policy, pair = Policy.TIMED, (ROBOTS[0], TRACKS[1])
    found = list(messages(Random('written')))
    text = bundle(policy, f'[{", ".join(ROBOTS[:2])}]', f'["{TRACKS[0]}", "{TRACKS[1]}"]')
    rows, statuses, _ = written(tmp_path, 'all', text, found)
    plain, details, _ = written(tmp_path, 'plain', bundle(policy, '', '', pair),
                                slice_of(found, pair))
    names = [name for name in plain[0] if name != 'time']
    changes = [(row['time'], name, row[name]) for row in rows
               if (row['robot'], row['track']) == pair for name in names if row[name]]
    assert changes == changes_in(plain)
    assert len(changes) > 10
    for name in names:
        assert told(f'{name}[robot={pair[0]},track={pair[1]}]', statuses) == told(name, details)
    result = judged(tmp_path, 'table', text, found)
    shown = table(result)
    assert 'robot and track: 4 instances, 0 ended' in shown
    assert ['P_0[robot=a,track=-20]', 'VIOLATED'] in [row.split()[:2] for row in
                                                      shown.splitlines()]
    line = json.loads(json_line(result))
    assert set(line['requirements']['P_0']['instances']) == {
        f'{robot}/{track}' for robot in ROBOTS[:2] for track in TRACKS[:2]}


def test_what_is_drawn_of_a_pair_is_what_is_of_a_plain_bundle_on_its_slice(
        tmp_path: Path) -> None:
    policy, pair = Policy.TIMED, (ROBOTS[0], TRACKS[1])
    found = list(messages(Random('drawn')))
    whole = page_of(tmp_path, 'all', bundle(
        policy, f'[{", ".join(ROBOTS[:2])}]', f'["{TRACKS[0]}", "{TRACKS[1]}"]'),
        record(tmp_path / 'all_bag', found))
    plain = page_of(tmp_path, 'plain', bundle(policy, '', '', pair),
                    record(tmp_path / 'plain_bag', slice_of(found, pair)))
    drawn = lanes(whole, f'{pair[0]},track={pair[1]}')
    assert drawn == lanes(plain, '')
    assert len(drawn) > 3


@pytest.mark.parametrize('policy', some([Policy.EVERY_MESSAGE, Policy.ALL_INPUTS]))
def test_a_table_with_pairs_has_the_violations_that_simulate_counts(
        policy: Policy, tmp_path: Path) -> None:
    rng = Random(f'{policy} table')
    specification = reported(replace(pair_bundle(rng, [ROBOT, JOINT]), policy=policy))
    rows = pair_rows(rng, specification, 120, [number * 10**9 for number in range(120)])
    summary, result = both(tmp_path, specification, rows)
    assert {item.id: item.violations for item in result.findings} == summary.violations
    assert sum(count for name, count in summary.violations.items() if name[0] == 'P') > 20


def test_a_row_of_a_pair_is_as_its_message(tmp_path: Path) -> None:
    # It is one of the robot or of the track only with a value of their own.
    text = f"""format: 1
for_each: {{robot: {{most: 5, forget: 2}}, track: {{most: 5}}}}
inputs:
  seen: {INPUTS['seen']}
  speed: {{topic: "/{{robot}}/speed", type: {FLOAT}}}
  human: {INPUTS['human'].replace('{topic:', '{initial: 0.2, topic:')}
requirements:
  - {{id: D, ptltl: "seen > 2 | speed < 0.5"}}
  - {{id: N, ptltl: "count(robot: speed > 0.5) = 1"}}
  - {{id: H, ptltl: "human > 0.5"}}
"""
    (tmp_path / 'table.csv').write_text('time,robot,track,seen,speed,human\n0,a,,,9,\n' + ''.join(
        f'{time},a,1,3,,\n' for time in range(1, 5)) + '5,a,3,1,,\n')
    types = TYPES.types

    def seen(track: str, value: float) -> Any:
        header = types['std_msgs/msg/Header'](types['builtin_interfaces/msg/Time'](0, 0), track)
        return types[POINT](header, types['geometry_msgs/msg/Point'](value, 0.0, 0.0))

    whole = judged(tmp_path, 'bag', text, [
        (0, '/a/speed', FLOAT, types[FLOAT](9.0), frozenset[str]()), *(
            (time * 10**9, '/a/seen', POINT, seen(track, value), frozenset[str]())
            for time, track, value in [
                *((time, '1', 3.0) for time in range(1, 5)), (5, '3', 1.0)])])
    rows = check_recording(tmp_path / 'bag.yaml', tmp_path / 'table.csv', Selection())
    assert rows.kinds == whole.kinds
    assert [(item.id, item.verdict, item.occurrences, item.longest) for item in rows.findings] == [
        (item.id, item.verdict, item.occurrences, item.longest) for item in whole.findings]
    assert (rows.kinds['robot'].ended, 'track' in rows.kinds) == (1, True)
    assert [item.occurrences for item in rows.findings] == [0, 1, 0]


AT_THE_END = f"""format: 1
evaluation: {{policy: timed}}
for_each: {{robot: {{most: 2}}, track: {{most: 3, forget: 1}}}}
inputs:
  seen: {INPUTS['seen']}
  speed: {{topic: "/{{robot}}/speed", type: {FLOAT}}}
  limit: {{topic: /limit, type: {FLOAT}}}
requirements:
  - {{id: PAIR, ptltl: "seen + speed > max(robot, track: seen + limit)"}}
  - {{id: NONE, ptltl: "count(robot, track: seen + speed > max(robot, track: seen + limit)) = 0"}}
"""


def test_a_message_at_the_very_end_of_a_pair_comes_before_it(tmp_path: Path) -> None:
    # 1 ends with a message of its robot, 3 with a shared one.
    def at(time: int) -> int:
        return START + time * 10**8

    sent = [(0, '', '', 5.0), (1, 'a', '', 1.0), (5, 'a', '1', 1.0), (10, 'a', '3', 1.0),
            (15, 'a', '', 6.0), (17, 'a', '', 1.0), (20, '', '', 0.0), (30, 'a', '', 7.0)]
    file, trace, out = (tmp_path / name for name in ('bundle.yaml', 'trace.csv', 'out.csv'))
    file.write_text(AT_THE_END, encoding='utf-8')
    trace.write_text('time,robot,track,seen,speed,limit\n' + ''.join(
        f'{START // 10**9 + time // 10}.{time % 10},{robot},{track},'
        + (f'{value},,' if track else f',{value},' if robot else f',,{value}') + '\n'
        for time, robot, track, value in sent), encoding='utf-8')
    types = TYPES.types
    recording = record(tmp_path / 'bag', [
        (time * 10**8, f'/{robot}/seen', POINT, types[POINT](
            types['std_msgs/msg/Header'](types['builtin_interfaces/msg/Time'](0, 0), track),
            types['geometry_msgs/msg/Point'](value, 0.0, 0.0)), frozenset[str]()) if track else
        (time * 10**8, f'/{robot}/speed' if robot else '/limit', FLOAT, types[FLOAT](value),
         frozenset[str]()) for time, robot, track, value in sent])
    for source in (trace, recording):
        with unoptimised():
            pair, none = check_recording(file, source, Selection()).findings
        assert {key[-1:]: item.spans for key, item in pair.instances.items()} == {
            b'1': [(at(5), at(15))], b'3': [(at(10), at(15)), (at(17), at(20))]}
        assert none.spans == [(at(15), at(17))]
    with unoptimised():
        assert main(['simulate', str(file), '--trace', str(trace), '--verdicts', str(out)]) == 0
    rows = [line.split(',') for line in out.read_text(encoding='utf-8').splitlines()[1:]]
    assert [row[4] for row in rows if row[4]] == list('11110111')
    assert [row[2] + row[3] for row in rows if row[2]] == ['10', '30', '11', '31', '30', '31']
