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

"""The report of a bundle with instances: a row for each key, and what was around occurrences."""

import csv
from pathlib import Path
from random import Random
import re
from typing import Any

from bag.outline import Outline
from bag.recordings import FLOAT, START, TYPES, write
from bag.test_instances import BOOL, bundle, KEYS, messages, POINT, record, slice_of
from differential.compiled import unoptimised
from fret_monitor.bag import evidence
from fret_monitor.bag.check import Selection
from fret_monitor.bag.report import check_and_report
from fret_monitor.model.policies import Policy
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from strategies import some

FLEET = """\
format: 1
evaluation: {policy: timed}
for_each: {robot: {most: 3, forget: 0.25}}
constants: {most: 1.0}
inputs:
  speed: {topic: "{robot}/speed", type: std_msgs/msg/Float64}
definitions: {fast: speed > 0.5}
requirements:
  - {id: SPEED, ptltl: speed <= most}
  - {id: FLEET, ptltl: "count(robot: fast) <= 1"}
"""
RUN = [('/alpha/speed', 0, 0.6), ('/beta/speed', 10**8, 1.5), ('/beta/speed', 2 * 10**8, 0.2),
       ('/beta/speed', 3 * 10**8, 1.6), ('/gamma<i>/speed', 5 * 10**8, 1.2),
       ('/alpha/speed', 8 * 10**8, 1.1)]


def page_of(folder: Path, name: str, text: str, path: Path) -> Outline:
    file, page = folder / f'{name}.yaml', folder / f'{name}.html'
    file.write_text(text)
    with unoptimised():
        check_and_report(file, path, Selection(may_miss=True), page)
    return Outline(page.read_text())


def test_a_requirement_has_a_row_for_each_instance_that_violated_it(tmp_path: Path) -> None:
    found = page_of(tmp_path, 'fleet', FLEET, write(tmp_path / 'run', RUN))
    assert found.of('summary') == ['3 instances violated it']
    assert [text for tag, text in found.texts if tag == 'span' and '[' in text] == [
        'SPEED[robot=alpha]', 'SPEED[robot=beta]', 'SPEED[robot=gamma<i>]']
    assert '2 occurrences, first at 0.1 s, the longest 0.25 s' in found.of('span')
    assert found.of('h3') == ['SPEED', 'FLEET']
    assert found.of('strong') == [
        '4 occurrences', 'Occurrence 1 of SPEED[robot=beta]', 'Occurrence 2 of SPEED[robot=beta]',
        'Occurrence 3 of SPEED[robot=gamma<i>]', 'Occurrence 4 of SPEED[robot=alpha]',
        '2 occurrences', 'Occurrence 1', 'Occurrence 2']
    lanes = [''.join(filter(str.isalpha, lane)) for lane in found.data['lanes']]
    # SPEED is violated while one instance violates it; a row is empty where nothing is known.
    assert found.data['lanes'][0] == 't89m1f89m1t89m1f404m1t44m1'
    assert lanes == ['tmfmtmfmtm', 'tmfmtmfmt', 'uf', 'ufmtmfu', 'ufu']
    assert [item['name'] for item in found.data['inputs']][-3:] == [
        'speed[robot=beta]', 'speed[robot=gamma<i>]', 'speed[robot=alpha]']
    first = found.data['occurrences'][0]
    assert [plot['h'] for plot in first['p']] == [[[1, 'most = 1']]]
    assert [value[1:] for value in first['p'][0]['v']] == [[1.5], [0.2], [1.6]]
    assert [(label, kind) for label, kind, _ in first['l']] == [
        ('"speed[robot=beta]" <= 1.0', 'proposition'), ('SPEED[robot=beta]', 'verdict')]


ALONE = '  - {id: ALONE, ptltl: "fast -> count(robot: fast) <= 1"}\n'


def test_what_reads_values_over_instances_is_drawn_without_them(tmp_path: Path) -> None:
    found = page_of(tmp_path, 'alone', FLEET + ALONE, write(tmp_path / 'run', RUN))
    names = [text for text in found.of('strong') if text.startswith('Occurrence')]
    assert [name for name in names if 'ALONE' in name] == [
        'Occurrence 1 of ALONE[robot=beta]', 'Occurrence 2 of ALONE[robot=alpha]',
        'Occurrence 3 of ALONE[robot=beta]', 'Occurrence 4 of ALONE[robot=gamma<i>]']
    first = found.data['occurrences'][names.index('Occurrence 1 of ALONE[robot=beta]')]
    assert [value[1:] for value in first['p'][0]['v']] == [[1.5], [0.2], [1.6]]
    assert [(label, kind) for label, kind, _ in first['l']] == [
        ('fast[robot=beta]', 'trigger'), ('ALONE[robot=beta]', 'verdict')]
    assert ''.join(filter(str.isalpha, first['l'][0][2])) == 'utmfmt'


Shown = tuple[int | None, int | None, int, list[Any]]  # end, trigger, is it a deadline, limits


def occurrences(page: Outline, key: str) -> dict[str, list[Shown]]:
    """Return what is drawn of the occurrences of an instance, or of a plain bundle, by id."""
    found, place, name = dict[str, list[Shown]](), 0, ''
    for tag, text in page.texts:
        if tag == 'h3':
            name = text
        if tag == 'strong' and text.startswith(('Occurrence', 'Open')):
            item = page.data['occurrences'][place]
            place += 1
            if not key or f'={key}]' in text:
                found.setdefault(name, []).append((
                    item['e'], item['g'], item['d'], [plot['h'] for plot in item['p']]))
    return found


def lanes(page: Outline, key: str) -> dict[str, str]:
    """Return a letter for each part of the lanes, from the first violation on, by id."""
    rows = [text for tag, text in page.texts if tag == 'span' and f'={key}]' in text]
    ids = page.of('h3')
    shown = [text for tag, text in page.texts if tag == 'span' and '[' in text]
    first = len(ids)
    names = {name.split('[')[0]: first + shown.index(name) for name in rows} if key else {
        name: number for number, name in enumerate(ids)}
    found = dict[str, str]()
    for name, number in names.items():
        parts = ''.join(letter * int(count) for letter, count in re.findall(
            r'([a-z])(\d+)', page.data['lanes'][number]))
        start = min((parts.find(each) for each in 'fm' if each in parts), default=-1)
        if start >= 0:
            found[name] = parts[start + 1:]
    return found


@pytest.mark.parametrize(('policy', 'variable'), some([
    (Policy.TIMED, 'robot'), (Policy.RELEVANT_MESSAGE, 'track')], 2))
def test_what_is_shown_of_an_instance_is_what_is_of_a_plain_bundle_on_its_slice(
        policy: Policy, variable: str, tmp_path: Path) -> None:
    found = list(messages(Random(f'{policy} {variable} report'), KEYS))
    keys = KEYS[:2]
    whole = page_of(tmp_path, 'all', bundle(policy, [variable], f'[{", ".join(keys)}]'),
                    record(tmp_path / 'all_bag', found))
    compared = 0
    for key in keys:
        plain = page_of(tmp_path, key, bundle(policy, [variable], '', key),
                        record(tmp_path / f'{key}_bag', slice_of(found, variable, key)))
        assert lanes(whole, key) == lanes(plain, '')
        drawn = occurrences(plain, '')
        for name, items in occurrences(whole, key).items():
            common = min(len(items), len(drawn[name]))
            assert items[:common] == drawn[name][:common], name
            compared += common
    assert compared > 6


PAIRS = """\
format: 1
evaluation: {policy: POLICY}
for_each:
  robot: {most: 3, forget: 1}
  person: {most: 3, forget: 2}
inputs:
  on: {topic: enable, type: std_msgs/msg/Bool}
  near: {topic: enable, type: std_msgs/msg/Bool, field: received()}
  speed: {topic: "/{robot}/speed", type: std_msgs/msg/Float64}
  comes: {topic: "/{robot}/speed", type: std_msgs/msg/Float64, field: received()}
  distance: {topic: "/{robot}/people", type: geometry_msgs/msg/PointStamped,
             where: "header.frame_id = {person}", field: point.x}
requirements:
  - {id: SPEED, ptltl: "on & near -> speed <= 1.2"}
  - {id: SOON, ptltl: "O[0, 3] (comes & speed <= 1.4)"}
  - {id: SLOW, ptltl: "H[0, 1] (distance < 0.9) -> speed <= 0.8"}
  - {id: ALL, ptltl: "on -> count(robot: speed > 0.7) <= 1"}
"""
PEOPLE = ['p', 'q],"é']


def write_both(rng: Random, path: Path, table: Path) -> None:
    """Write the same random messages as a recording and as a table with keys."""
    types, time = TYPES.types, START
    stamp = types['builtin_interfaces/msg/Time'](0, 0)
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer, \
            table.open('w', encoding='utf-8', newline='') as file:
        rows = csv.writer(file)
        rows.writerow(['time', 'on', 'near', 'robot', 'person', 'speed', 'distance'])
        connections: dict[str, Any] = {}
        for number in range(150):
            time += rng.choice((10**7, 10**8, 3 * 10**8))
            robot, value = rng.randrange(3), round(rng.uniform(0, 1.8), 2)
            person, on = rng.choice(PEOPLE), rng.random() < 0.8
            topic, kind, content, row = [
                ('/enable', BOOL, types[BOOL](on), [int(on), 1, '', '', '', '']),
                (f'/r{robot}/speed', FLOAT, types[FLOAT](value),
                 ['', '', f'r{robot}', '', value, '']),
                (f'/r{robot}/people', POINT, types[POINT](
                    types['std_msgs/msg/Header'](stamp, person),
                    types['geometry_msgs/msg/Point'](value, 0.0, 0.0)),
                 ['', '', f'r{robot}', person, '', value])][rng.randrange(3) if number else 0]
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=TYPES)
            writer.write(connections[topic], time, TYPES.serialize_cdr(content, kind))
            rows.writerow([f'{time // 10**9}.{time % 10**9:09d}', *row])


@pytest.mark.parametrize('policy', ['timed, unit: 0.2', 'every_message'])
def test_the_report_of_a_table_is_that_of_a_recording_of_its_rows(
        policy: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # How much is drawn depends on the number of messages of its topics, or of all rows.
    monkeypatch.setattr(evidence, '_lead', lambda *_: 3 * 10**9)
    write_both(Random(f'{policy} both'), tmp_path / 'run', tmp_path / 'run.csv')
    text = PAIRS.replace('POLICY', policy)
    recorded = page_of(tmp_path, 'recorded', text, tmp_path / 'run')
    written = page_of(tmp_path, 'written', text, tmp_path / 'run.csv')
    assert written.of('strong', 'span', 'summary') == recorded.of('strong', 'span', 'summary')
    assert written.data['lanes'] == recorded.data['lanes']
    assert written.data['inputs'] == recorded.data['inputs']
    # Of a recording what reads a topic is drawn at its messages alone, also under every_message.
    if policy != 'every_message':
        assert written.data['occurrences'] == recorded.data['occurrences']
    shown = [name for name in written.of('strong') if '[' in name]
    assert len([name for name in shown if 'person=' in name]) == len([
        name for name in shown if 'SPEED' in name]) == 5
