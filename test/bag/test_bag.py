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

"""Recordings: every storage gives the verdicts of `simulate`; what is missing is an error."""

from collections.abc import Callable, Iterable
from errno import ENOSPC
import json
from operator import itemgetter
import os
from pathlib import Path
from random import Random
import shutil
from typing import Any
from xml.etree import ElementTree

from bag.outline import Outline
from bag.recordings import contents_of, FLOAT, Message, START, TYPES, write
from bundles import write_bundle
from fret_monitor.bag.check import check_recording, Selection
from fret_monitor.bag.moments import Moment
from fret_monitor.bag.recording import Recording
from fret_monitor.bag.results import json_line
from fret_monitor.cli.main import main
from fret_monitor.model.diagnostics import CompileError
from fret_monitor.start import start
from fret_monitor.traces.simulate import simulate
import numpy
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionFormat, CompressionMode, Reader, StoragePlugin, Writer
from rosbags.typesys import get_typestore, Stores
from strategies import thorough
import yaml

SECOND = 10**9
PUMP = """format: 1
evaluation: {policy: POLICY}
inputs:
  level: {topic: level, type: std_msgs/msg/Float64, initial: 0}
  flow: {topic: flow, type: std_msgs/msg/Float64, initial: 0}
requirements:
  - {id: LOW, ptltl: "level < 0.5"}
  - {id: ANSWER, ptltl: "H (O[=N2] (flow > 0.5 & !O[<N2] level > 0.5) -> O[<=N2] level > 0.5)"}
  - {id: NEVER, ptltl: "H (level < 0.9)"}
"""


def bundle(folder: Path, policy: str) -> Path:
    timed = policy == 'timed'
    text = PUMP.replace('POLICY', policy).replace('N2', '20 ms' if timed else '2')
    text = text.replace('O[=20 ms] (flow > 0.5 & !O[<20 ms] level > 0.5)', 'O[<=20 ms] flow > 0.5')
    file = folder / f'{policy}.yaml'
    file.write_text(text, encoding='utf-8')
    return file


def random_messages(seed: int, count: int = 400) -> list[Message]:
    rng = Random(seed)
    time = 0
    found = []
    for _ in range(count):
        time += rng.choice([1_000_000, 7_000_000, 10_000_000, 20_000_000, 40_000_000])
        found.append((rng.choice(['/level', '/flow']), time, round(rng.random(), 3)))
    return found


def changes_of_simulate(file: Path, messages: list[Message], folder: Path) -> list[list[str]]:
    """Return the rows of `simulate` at which a verdict changes; times since START."""
    values = {'/level': 0.0, '/flow': 0.0}
    is_timed = 'timed' in file.name
    lines = ['time,level,flow']
    if is_timed:
        lines.append(f'{messages[0][1] / 1e9:.9f},0,0')
    for topic, time, value in messages:
        values[topic] = value
        stamp = time + (is_timed and time == messages[0][1])
        lines.append(f'{stamp / 1e9:.9f},{values["/level"]},{values["/flow"]}')
    trace, out = folder / 'trace.csv', folder / 'out.csv'
    trace.write_text('\n'.join(lines) + '\n', encoding='utf-8')
    simulate(start(file).monitor, trace, out)
    times = [line.split(',')[0] for line in lines[1:]]
    found: list[list[str]] = []
    last = ['1', '1', '1']
    for row in out.read_text(encoding='utf-8').splitlines()[1:]:
        step, *verdicts = row.split(',')
        if verdicts != last:
            found.append([step if is_timed else times[int(step)], *verdicts])
            last = verdicts
    return found


def changes_of_bag(file: Path, path: Path, folder: Path) -> list[list[str]]:
    """Return the changes that `bag` writes; times since START; one row for each time."""
    out = folder / 'changes.csv'
    assert main(['bag', str(file), str(path), '--csv', str(out)]) == 0
    found: dict[str, list[str]] = {}
    for row in out.read_text(encoding='utf-8').splitlines()[2:]:
        time, *verdicts = row.split(',')
        seconds, nanoseconds = time.split('.')
        since = int(seconds) * SECOND + int(nanoseconds) - START
        found[f'{since // SECOND}.{since % SECOND:09d}'] = verdicts
    rows = [[time, *verdicts] for time, verdicts in found.items()]
    first = ['', '1', '1', '1']
    return [row for before, row in zip([first, *rows], rows) if before[1:] != row[1:]]


@pytest.mark.parametrize(('storage', 'compression'), [
    (StoragePlugin.SQLITE3, CompressionMode.NONE), (StoragePlugin.SQLITE3, CompressionMode.FILE),
    (StoragePlugin.SQLITE3, CompressionMode.MESSAGE), (StoragePlugin.MCAP, CompressionMode.NONE),
    (StoragePlugin.MCAP, CompressionMode.STORAGE)])
def test_every_storage_is_read(
        tmp_path: Path, storage: StoragePlugin, compression: CompressionMode) -> None:
    messages = random_messages(1)
    path = write(tmp_path / 'bag', messages, storage=storage, compression=compression)
    result = check_recording(bundle(tmp_path, 'every_message'), path, Selection())
    assert result.errors == ()
    assert sum(result.read.values()) == sum(result.recorded.values()) == len(messages)
    assert [item.verdict for item in result.findings] == [False, False, False]
    low = sum(value >= 0.5 for value in levels(messages))
    assert result.findings[0].violations == low


def levels(messages: list[Message]) -> list[float]:
    level = 0.0
    found = []
    for topic, _, value in messages:
        level = value if topic == '/level' else level
        found.append(level)
    return found


@pytest.mark.parametrize('seed', range(3))
def test_verdicts_change_as_those_of_simulate(tmp_path: Path, seed: int) -> None:
    messages = random_messages(seed)
    path = write(tmp_path / 'bag', messages)
    # Under `occurrence` a requirement H p is reported by p, so that only LOW is compared here.
    file = bundle(tmp_path, 'every_message')
    expected = [row[:2] for row in changes_of_simulate(file, messages, tmp_path)]
    found = [row[:2] for row in changes_of_bag(file, path, tmp_path)]
    assert thinned(found) == thinned(expected)
    assert len(thinned(found)) > 20


def thinned(rows: list[list[str]]) -> list[list[str]]:
    """Leave out rows that repeat the verdict before them."""
    return [row for before, row in zip([['', '1'], *rows], rows) if before[1] != row[1]]


def test_deadlines_are_taken_at_their_instants(tmp_path: Path) -> None:
    file = write_bundle(tmp_path, """format: 1
evaluation: {policy: timed}
inputs:
  level: {topic: level, type: std_msgs/msg/Float64}
  flow: {topic: flow, type: std_msgs/msg/Float64}
requirements:
  - {id: ANSWER, fretish: "when flow > 1 the pump shall within 2 seconds satisfy level > 1"}
""", 'answer.yaml')
    path = write(tmp_path / 'bag', [
        ('/level', 0, 0.0), ('/flow', SECOND, 0.0), ('/flow', 2 * SECOND, 2.0),
        ('/flow', 7 * SECOND, 0.0), ('/level', 8 * SECOND, 2.0),
        ('/level', 9 * SECOND, 0.0), ('/flow', 10 * SECOND, 2.0)])
    result = check_recording(file, path, Selection())
    answer, = result.findings
    assert (answer.verdict, answer.violations, answer.occurrences) == (False, None, 1)
    assert answer.first in {START + 4 * SECOND, START + 4 * SECOND + 1}
    later = check_recording(file, path, Selection(until=Moment.parse('end+10'))).findings[0]
    assert later.occurrences == 2
    assert later.spans[1][0] - START in {12 * SECOND, 12 * SECOND + 1}


def test_a_deadline_after_the_last_message_is_open(tmp_path: Path) -> None:
    file = write_bundle(tmp_path, """format: 1
evaluation: {policy: timed}
inputs:
  level: {topic: level, type: std_msgs/msg/Float64, timeout: 1, stale: violate}
requirements:
  - {id: SOON, fretish: "when level > 1 the pump shall within 2 seconds satisfy level < 0"}
  - {id: HIGH, ptltl: "level > -1"}
""", 'answer.yaml')
    path = write(tmp_path / 'bag', [('/level', 0, 0.0), ('/level', SECOND, 2.0)])
    result = check_recording(file, path, Selection())
    assert [(item.verdict, item.is_open) for item in result.findings] == [
        (None, True), (True, False)]
    assert json.loads(json_line(result))['requirements']['SOON']['verdict'] is None
    ended = check_recording(file, path, Selection(until=Moment.parse('end+3')))
    assert [item.verdict for item in ended.findings] == [False, False]  # and level is silent


def test_values_before_the_begin_count_and_steps_do_not(tmp_path: Path) -> None:
    file = write_bundle(tmp_path, """format: 1
inputs:
  level: {topic: level, type: std_msgs/msg/Float64}
  flow: {topic: flow, type: std_msgs/msg/Float64}
requirements:
  - {id: LOW, ptltl: "level < 1 | flow < 1"}
""", 'low.yaml')
    path = write(tmp_path / 'bag', [
        ('/level', 0, 5.0), ('/flow', SECOND, 5.0), ('/flow', 2 * SECOND, 0.0),
        ('/flow', 3 * SECOND, 5.0), ('/flow', 4 * SECOND, 5.0)])

    def found(begin: str = 'start', end: str = 'end') -> tuple[int | None, int | None]:
        selection = Selection(begin=Moment.parse(begin), end=Moment.parse(end))
        low = check_recording(file, path, selection).findings[0]
        return low.violations, low.first

    assert found() == (3, START + SECOND)
    assert found(begin='1.5') == (2, START + 3 * SECOND)
    assert found(begin='1.5', end='3') == (1, START + 3 * SECOND)
    assert found(begin='end-0.5') == (1, START + 4 * SECOND)
    assert found(end=f'{START // SECOND + 2}') == (1, START + SECOND)


def remove_half(path: Path) -> str:
    import apsw
    connection = apsw.Connection(str(path / 'bag.db3'))
    connection.execute('DELETE FROM messages WHERE id % 2 = 0')
    connection.close()
    return 'recorded, '


def other_spelling(path: Path) -> str:
    """Spell the QoS of the metadata in another way than the storage does: no message is lost."""
    file = path / 'metadata.yaml'
    text = file.read_text(encoding='utf-8')
    changed = text.replace('offered_qos_profiles: []', """offered_qos_profiles:
        - {history: keep_last, depth: 10, reliability: reliable, durability: volatile,
           deadline: {sec: 0, nsec: 0}, lifespan: {sec: 0, nsec: 0}, liveliness: automatic,
           liveliness_lease_duration: {sec: 0, nsec: 0}, avoid_ros_namespace_conventions: false}
""".rstrip())
    assert changed != text
    file.write_text(changed, encoding='utf-8')
    return ''


def cut_off(path: Path) -> str:
    file = path / 'bag.db3'
    file.write_bytes(file.read_bytes()[:20_000])
    return 'recorded, |cannot read|cannot be read'


@pytest.mark.parametrize('damage', [remove_half, other_spelling, cut_off])
def test_messages_that_are_missing_are_an_error(
        tmp_path: Path, capsys: pytest.CaptureFixture[str],
        damage: Callable[[Path], str]) -> None:
    path = write(tmp_path / 'bag', random_messages(2), storage=StoragePlugin.SQLITE3)
    expected = damage(path)
    file = bundle(tmp_path, 'every_message')
    status = main(['bag', str(file), str(path), '--json'])
    out, err = capsys.readouterr()
    line = json.loads(out)
    if not expected:
        assert (status, err, line['errors'], line['read']) == (0, '', [], 400)
        return
    assert status == 1
    assert any(part in err for part in expected.split('|'))
    assert line['errors']
    if line['requirements']:
        assert main(['bag', str(file), str(path), '--partial']) == 0
        assert 'warning: ' in capsys.readouterr().err


def test_a_mapped_topic_that_was_not_recorded_is_an_error(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(tmp_path / 'bag', [('/robot/level', 0, 0.0), ('/robot/stream', 1, 0.0)])
    file = bundle(tmp_path, 'every_message')
    arguments = ['bag', str(file), str(path)]
    assert main(arguments) == 1
    assert '/level was not recorded: --namespace /robot reads ' in capsys.readouterr().err
    assert main([*arguments, '--namespace', '/robot']) == 1
    assert '/robot/flow was not recorded' in capsys.readouterr().err
    assert main([*arguments, '--namespace', 'robot', '--missing-topics', 'ok']) == 0
    assert 'warning: ' in capsys.readouterr().err
    assert main([*arguments, '--namespace', 'robot', '--remap', 'flow:=stream']) == 0
    assert capsys.readouterr().err == ''
    assert main([*arguments, '--remap', 'level:=/robot/level', '--remap',
                 'flow:=/robot/stream']) == 0
    assert main([*arguments, '--remap', 'level:=/x', '--remap', 'flow:=/x']) == 1
    assert "'level' and 'flow' are one topic here, /x" in capsys.readouterr().err


def test_a_topic_of_another_type_is_an_error_that_names_both(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(tmp_path / 'bag', [('/level', 0, 0.0), ('/flow', 1, 0.0)],
                 kind='std_msgs/msg/Float32')
    assert main(['bag', str(bundle(tmp_path, 'every_message')), str(path)]) == 1
    assert ('/level was recorded as std_msgs/msg/Float32, the bundle says std_msgs/msg/Float64'
            in capsys.readouterr().err)


def test_several_recordings_in_processes_and_a_run_that_goes_on(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    paths = [write(tmp_path / f'bag{number}', random_messages(number, 50)) for number in range(3)]
    bad = tmp_path / 'bad.mcap'
    bad.write_bytes(b'no recording at all')
    results = tmp_path / 'results.jsonl'
    file = bundle(tmp_path, 'every_message')
    arguments = ['bag', str(file), *map(str, [*paths, bad]), '--results', str(results)]
    assert main([*arguments, '--jobs', '2']) == 1
    lines = [json.loads(line) for line in results.read_text(encoding='utf-8').splitlines()]
    assert {line['bag'] for line in lines} == {str(path) for path in [*paths, bad]}
    assert all(len(line['sha256']) == 64 for line in lines)
    assert [bool(line['errors']) for line in sorted(lines, key=lambda line: str(line['bag']))] == [
        True, False, False, False]
    kept = [line for line in results.read_text(encoding='utf-8').splitlines()
            if 'bag1' not in line]
    results.write_text('\n'.join(kept) + '\n{"bag": "half', encoding='utf-8')
    capsys.readouterr()
    assert main(arguments) == 1  # the bad one is tried again
    out = capsys.readouterr().out
    assert f'{paths[1]}: 50 messages' in out
    assert_in_order(out, paths)  # though two of them were checked before
    assert sum('bag1' in line for line in results.read_text(encoding='utf-8').splitlines()) == 1


def assert_in_order(out: str, paths: Iterable[Path]) -> None:
    heads = [line.partition(': ')[0] for line in out.splitlines()]
    assert [head for head in heads if head.startswith('/')] == [str(path) for path in paths]


def test_answers_of_several_processes_come_in_the_order_of_the_command_line(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    counts = 20_000, 1, 1, 1  # the first takes longest
    paths = [write(tmp_path / f'bag{number}', random_messages(number, count))
             for number, count in enumerate(counts)]
    main(['bag', str(bundle(tmp_path, 'every_message')), *map(str, paths), '--jobs', '2',
          '--missing-topics', 'ok'])
    assert_in_order(capsys.readouterr().out, paths)


@thorough  # its workers take as long as a hundred tests; that of fit is always run
def test_recordings_on_a_cluster(
        tmp_path: Path, capsys: pytest.CaptureFixture[str],
        caplog: pytest.LogCaptureFixture) -> None:
    pytest.importorskip('distributed', reason='needs the extra dask')
    file, reports, junit = (tmp_path / name for name in ('soon.yaml', 'reports', 'junit.xml'))
    file.write_text("""format: 1
evaluation: {policy: timed}
inputs:
  level: {topic: level, type: std_msgs/msg/Float64}
  flow: {topic: flow, type: std_msgs/msg/Float64}
requirements:
  - {id: SOON, fretish: "when flow > 1 the pump shall within 2 seconds satisfy level > 1"}
""", encoding='utf-8')
    paths = [write(tmp_path / name, messages) for name, messages in (
        ('open', [('/level', 0, 0.0), ('/flow', SECOND, 2.0)]),
        ('unknown', [('/flow', 0, 2.0), ('/flow', 9 * SECOND, 0.0)]),
        ('violated', [('/level', 0, 0.0), ('/flow', 1, 2.0), ('/flow', 9 * SECOND, 0.0)]))]
    bad = tmp_path / 'bad.mcap'
    bad.write_bytes(b'no recording at all')
    arguments = ['bag', str(file), *map(str, [*paths, bad]), '--json', '--missing-topics', 'ok']
    assert main([*arguments, '--dask', 'local', '--jobs', '2', '--report', str(reports),
                 '--junit', str(junit)]) == 1
    out, err = capsys.readouterr()
    assert f"cannot read the recording '{bad}'" in err
    assert not [item for item in caplog.records if item.name.startswith('distributed')]
    found = {item['bag']: item for item in map(json.loads, out.splitlines())}
    assert {path: item['read'] for path, item in found.items()} == {
        **{str(path): count for path, count in zip(paths, (2, 2, 3))}, str(bad): 0}
    first, second, _ = (found[str(path)]['requirements']['SOON'] for path in paths)
    assert (first['verdict'], first['open']) == (None, True)
    assert (second['verdict'], 'open' in second) == (None, False)
    index = Outline((reports / 'index.html').read_text(encoding='utf-8'))
    assert index.of('span') == ['open', 'not judged', 'violated']
    links = [values['href'] for tag, values in index.tags if tag == 'a']
    assert sorted(map(str, links)) == sorted(
        item.name for item in reports.iterdir() if item.name != 'index.html')
    assert len(links) == 3
    suites = ElementTree.parse(junit).getroot()
    assert [item.get('message') for item in suites.iter('skipped')] == ['open', 'not judged']
    assert main([*arguments, '--dask', 'tcp://127.0.0.1:1']) == 1
    assert "no scheduler of Dask at 'tcp://127.0.0.1:1'" in capsys.readouterr().err


def test_what_a_program_reads(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(tmp_path / 'bag', [('/level', 0, 0.0), ('/flow', 1, 0.0), ('/level', 5, 0.95)])
    file, junit = bundle(tmp_path, 'every_message'), tmp_path / 'junit.xml'
    assert main(['bag', str(file), str(path), '--json', '--junit', str(junit),
                 '--fail-on-violation']) == 1
    found = json.loads(capsys.readouterr().out)
    meanings = [item.pop('meaning') for item in found['requirements'].values()]
    assert len(set(meanings)) == 3 and all(len(item) == 16 for item in meanings)
    assert found == {
        'bag': str(path), 'recorded': 3, 'read': 3, 'checksums': False, 'errors': [],
        'requirements': {
            'LOW': {'verdict': False, 'violations': 1, 'occurrences': 1,
                    'first': '1700000000.000000005'},
            'ANSWER': {'verdict': True, 'violations': 0, 'occurrences': 0, 'first': None},
            'NEVER': {'verdict': False, 'violations': 1, 'occurrences': 1,
                      'first': '1700000000.000000005'}}}
    suite, = ElementTree.parse(junit).getroot()
    assert (suite.get('tests'), suite.get('failures'), suite.get('errors')) == ('3', '2', '0')
    assert [case.get('name') for case in suite if case.find('failure') is not None] == [
        'LOW', 'NEVER']


def test_violations_are_written_as_a_recording(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write(tmp_path / 'bag', [
        ('/r/level', 0, 0.0), ('/r/flow', SECOND, 0.25), ('/r/level', 2 * SECOND, 0.95),
        ('/r/level', 3 * SECOND, 0.25), ('/r/flow', 4 * SECOND, 0.0)])
    file, out = bundle(tmp_path, 'every_message'), tmp_path / 'out.mcap'
    assert main(['bag', str(file), str(path), '--namespace', 'r', '--mcap', str(out)]) == 0
    found = [(topic, time - START, message) for topic, time, message in contents_of(out)]
    statuses = [(time, message.header.stamp.sec, message.status[0])
                for topic, time, message in found if topic == '/r/copilot/violations']
    assert [(time, status.level, status.name, status.message) for time, _, status in statuses] == [
        (2 * SECOND, 2, 'LOW', 'level < 0.5'), (2 * SECOND, 2, 'NEVER', 'H (level < 0.9)'),
        (3 * SECOND, 0, 'LOW', 'level < 0.5'), (3 * SECOND, 0, 'NEVER', 'H (level < 0.9)')]
    assert statuses[0][1] == START // SECOND + 2
    assert [(item.key, item.value) for item in statuses[0][2].values] == [
        ('step', '2'), ('stamp', '1700000002.000000000'), ('suppressed', '0'), ('silent', ''),
        ('level', '0.95')]
    assert [(time, message.data) for topic, time, message in found
            if topic == '/r/copilot/verdict/LOW'] == [
        (0, True), (2 * SECOND, False), (3 * SECOND, True), (4 * SECOND, True)]
    assert not list(tmp_path.glob('.fret_monitor-*'))
    capsys.readouterr()
    recorded = path / 'bag.mcap'
    before = recorded.read_bytes()
    assert main(['bag', str(file), str(path), '--mcap', str(recorded)]) == 1
    assert 'this command reads it' in capsys.readouterr().err
    assert main(['bag', str(file), str(path), str(path), '--mcap', str(out)]) == 1
    assert '--mcap is of one recording, here are 2' in capsys.readouterr().err
    assert main(['bag', str(file), str(path), '--mcap', str(tmp_path / 'no' / 'x.mcap')]) == 1
    assert 'No such file or directory' in capsys.readouterr().err
    assert recorded.read_bytes() == before


@pytest.mark.parametrize('policy', ['every_message', 'timed'])
def test_a_requirement_for_all_time_has_an_occurrence_each_time(
        tmp_path: Path, policy: str) -> None:
    levels = [0.0, 0.95, 0.0, 0.95, 0.95, 0.0]
    path = write(tmp_path / 'bag', [('/flow', 0, 0.0), *(
        ('/level', k * SECOND, level) for k, level in enumerate(levels, 1))])
    never = check_recording(bundle(tmp_path, policy), path, Selection()).findings[2]
    assert (never.id, never.verdict) == ('NEVER', False)
    assert [(begin - START, end and end - START) for begin, end in never.spans] == [
        (2 * SECOND, 3 * SECOND), (4 * SECOND, 6 * SECOND)]


def test_a_full_disk_leaves_the_recording_of_violations_as_it_was(
        tmp_path: Path, capsys: pytest.CaptureFixture[str],
        monkeypatch: pytest.MonkeyPatch) -> None:
    def no_room(*_: object) -> None:
        raise OSError(ENOSPC, 'No space left on device')

    path, out = write(tmp_path / 'bag', random_messages(1, 20)), tmp_path / 'out.mcap'
    out.write_text('earlier', encoding='utf-8')
    file = bundle(tmp_path, 'every_message')
    before = sorted(tmp_path.rglob('*'))
    monkeypatch.setattr('fret_monitor.runtime.mcap.McapWriter.end', no_room)
    assert main(['bag', str(file), str(path), '--mcap', str(out)]) == 1
    assert f"cannot write '{out}': No space left on device" in capsys.readouterr().err
    assert (out.read_text(encoding='utf-8'), sorted(tmp_path.rglob('*'))) == ('earlier', before)


def test_no_detail_is_missing_in_a_recording_of_many_violations(tmp_path: Path) -> None:
    count = 5_000
    path = write(tmp_path / 'bag', [('/level', k, float(k % 2)) for k in range(count)])
    file, out = bundle(tmp_path, 'every_message'), tmp_path / 'out.mcap'
    assert main(['bag', str(file), str(path), '--missing-topics', 'ok', '--mcap', str(out)]) == 0
    with Reader(out) as reader:
        counts = {item.topic: item.msgcount for item in reader.connections}
    assert counts['/copilot/violations'] == 2 * (count - 1)  # LOW and NEVER, begins and ends


def test_a_bag_of_ros_1_is_read(tmp_path: Path) -> None:
    path = tmp_path / 'old.bag'
    with Writer1(path) as writer:
        level, flow = (writer.add_connection(topic, 'std_msgs/msg/Float64', typestore=TYPES)
                       for topic in ('/level', '/flow'))
        for number in range(10):
            data = TYPES.serialize_ros1(
                TYPES.types['std_msgs/msg/Float64'](0.2 * number), 'std_msgs/msg/Float64')
            writer.write(level if number % 2 else flow, START + number, data)
    result = check_recording(bundle(tmp_path, 'every_message'), path, Selection())
    assert (result.errors, sum(result.read.values())) == ((), 10)
    assert result.findings[0].violations == 7


@pytest.mark.parametrize('name', ['run.bag', 'run.csv', 'run.mcap'])
def test_a_folder_of_rosbag2_is_that_whatever_its_name(tmp_path: Path, name: str) -> None:
    path = write(tmp_path / name, [('/level', k, float(k)) for k in range(8)] + [
        ('/flow', 8 + k, 0.0) for k in range(2)])
    result = check_recording(bundle(tmp_path, 'every_message'), path, Selection())
    assert (result.errors, sum(result.read.values())) == ((), 10)
    assert result.findings[0].violations


def test_what_is_no_recording_is_refused(tmp_path: Path) -> None:
    file = bundle(tmp_path, 'every_message')
    write(tmp_path / 'bags' / 'one', [('/level', 0, 0.0)])
    (tmp_path / 'text.txt').write_text('hello', encoding='utf-8')
    broken = write(tmp_path / 'broken', [('/level', 0, 0.0)])
    (broken / 'broken.mcap').unlink()
    shutil.copy(tmp_path / 'bags' / 'one' / 'one.mcap', tmp_path / 'cut.mcap')
    whole = (tmp_path / 'cut.mcap').read_bytes()
    (tmp_path / 'cut.mcap').write_bytes(whole[:len(whole) // 2])
    os.mkfifo(tmp_path / 'pipe.db3')
    os.mkfifo(tmp_path / 'pipe.csv')
    piped = write(tmp_path / 'piped', [('/level', 0, 0.0)])
    (piped / 'piped.mcap').unlink()
    os.mkfifo(piped / 'piped.mcap')
    for name, message in (('bags', 'is not a recording: it has no metadata.yaml'),
                          ('text.txt', 'is not a recording'), ('gone', 'there is no recording'),
                          ('broken', 'cannot read the recording'),
                          ('cut.mcap', 'cannot read the recording'),
                          ('pipe.csv', "pipe.csv' is a named pipe, not a file"),
                          ('pipe.db3', "pipe.db3' is a named pipe or a device, not a file"),
                          ('piped', "piped.mcap' is a named pipe or a device, not a file")):
        with pytest.raises(CompileError, match=message):
            check_recording(file, tmp_path / name, Selection())
    write(tmp_path / 'bags' / 'two', [('/level', 0, 0.0)])
    with pytest.raises(CompileError) as caught:
        check_recording(file, tmp_path / 'bags', Selection())
    assert caught.value.diagnostics[0].help == f'name the recordings in it: {tmp_path}/bags/*'


def split(folder: Path, parts: list[list[Message]]) -> Path:
    """Write a recording of several files."""
    path = folder / 'split'
    path.mkdir()
    texts = []
    for number, messages in enumerate(parts):
        part = write(folder / f'part{number}', messages)
        shutil.move(part / f'part{number}.mcap', path)
        texts.append((part / 'metadata.yaml').read_text(encoding='utf-8'))
    metadata = yaml.safe_load(texts[0])
    information = metadata['rosbag2_bagfile_information']
    others = [yaml.safe_load(text)['rosbag2_bagfile_information'] for text in texts[1:]]
    information['relative_file_paths'] = [f'part{number}.mcap' for number in range(len(parts))]
    for other in others:
        information['message_count'] += other['message_count']
        more = {item['topic_metadata']['name']: item['message_count']
                for item in other['topics_with_message_count']}
        for topic in information['topics_with_message_count']:
            topic['message_count'] += more[topic['topic_metadata']['name']]
    (path / 'metadata.yaml').write_text(yaml.safe_dump(metadata), encoding='utf-8')
    return path


@pytest.mark.parametrize('overlap', [False, True])
def test_files_of_a_split_recording_are_read_in_the_order_of_time(
        tmp_path: Path, overlap: bool) -> None:
    messages = [('/level', 0, 0.0), ('/flow', 1, 0.0), *random_messages(5)]
    file = bundle(tmp_path, 'every_message')
    if overlap:  # by less than what counts as a restart
        parts = [[*messages[:198], messages[199]], [messages[198], *messages[200:]]]
    else:
        parts = [messages[:200], messages[200:]]
    whole = write(tmp_path / 'whole', sorted(
        (message for part in parts for message in part), key=itemgetter(1)))
    expected = json.loads(json_line(check_recording(file, whole, Selection())))
    found = json.loads(json_line(check_recording(file, split(tmp_path, parts), Selection())))
    assert {**found, 'bag': ''} == {**expected, 'bag': ''}
    assert found['requirements']['LOW']['occurrences'] > 20


def test_a_missing_file_of_a_split_recording_is_an_error(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    messages = random_messages(5)
    path = split(tmp_path, [messages[:150], messages[150:250], messages[250:]])
    (path / 'part1.mcap').unlink()
    arguments = ['bag', str(bundle(tmp_path, 'every_message')), str(path), '--json']
    assert main(arguments) == 1
    out, err = capsys.readouterr()
    line = json.loads(out)
    assert (line['recorded'], line['read']) == (400, 300)
    assert line['errors'][0] == 'part1.mcap is missing'
    assert f'error: {path}: part1.mcap is missing\n' in err
    low = sum(value >= 0.5 for value in levels([*messages[:150], *messages[250:]]))
    assert line['requirements']['LOW']['violations'] == low
    assert main([*arguments, '--partial']) == 0
    assert f'warning: {path}: part1.mcap is missing\n' in capsys.readouterr().err
    (path / 'part0.mcap').write_bytes((path / 'part0.mcap').read_bytes()[:1000])
    assert main([*arguments, '--partial', '--report', str(tmp_path / 'page.html')]) == 0
    line = json.loads(capsys.readouterr().out)
    assert (line['recorded'], line['read']) == (400, 150)
    assert line['errors'][0].startswith('part0.mcap cannot be opened: ')
    (path / 'part2.mcap').unlink()
    assert main([*arguments, '--partial']) == 1
    assert 'cannot read the recording' in capsys.readouterr().err


def test_a_recording_without_messages_judges_nothing(tmp_path: Path) -> None:
    with Writer(tmp_path / 'bag', version=9) as writer:
        for topic in ('/level', '/flow'):
            writer.add_connection(topic, FLOAT, typestore=TYPES)
    result = check_recording(bundle(tmp_path, 'every_message'), tmp_path / 'bag', Selection())
    assert result.errors == ('no message was recorded on the topics of the bundle',)
    assert [item.verdict for item in result.findings] == [None] * 3


STRICT = PUMP.replace('POLICY', 'every_message').replace('N2', '2').replace(', initial: 0', '')


def test_a_topic_without_messages_is_missing_unless_its_inputs_have_initial_values(
        tmp_path: Path) -> None:
    with Writer(tmp_path / 'bag', version=9) as writer:
        level, _ = (writer.add_connection(topic, FLOAT, typestore=TYPES)
                    for topic in ('/level', '/flow'))
        writer.write(level, START, TYPES.serialize_cdr(TYPES.types[FLOAT](0.7), FLOAT))
    strict = write_bundle(tmp_path, STRICT, 'strict.yaml')
    result = check_recording(strict, tmp_path / 'bag', Selection())
    assert result.errors == ('no message of /flow was recorded',)
    assert [item.verdict for item in result.findings] == [False, None, True]
    eased = check_recording(strict, tmp_path / 'bag', Selection(may_miss=True))
    assert (eased.errors, eased.warnings) == ((), result.errors)
    mild = check_recording(bundle(tmp_path, 'every_message'), tmp_path / 'bag', Selection())
    assert (mild.errors, [item.verdict for item in mild.findings]) == ((), [False, True, True])


def test_messages_that_are_not_in_the_file_of_sqlite_yet_are_an_error(tmp_path: Path) -> None:
    path = write(tmp_path / 'bag', random_messages(5), storage=StoragePlugin.SQLITE3)
    file, = path.glob('*.db3')
    beside = file.with_name(f'{file.name}-wal')
    beside.touch()
    assert not check_recording(bundle(tmp_path, 'every_message'), file, Selection()).errors
    beside.write_bytes(b'pages')
    for recording in (file, path):
        error, = check_recording(bundle(tmp_path, 'every_message'), recording, Selection()).errors
        assert error.startswith(f'{beside.name} has messages that are not in {file.name} yet: ')


def test_a_file_that_metadata_does_not_list_is_an_error(tmp_path: Path) -> None:
    messages = random_messages(5)
    path = split(tmp_path, [messages[:200], messages[200:]])
    shutil.copy(path / 'part1.mcap', path / 'part2.mcap')
    result = check_recording(bundle(tmp_path, 'every_message'), path, Selection())
    assert result.errors == (
        'part2.mcap is not listed in metadata.yaml: its messages are left out',)
    (path / 'part2.mcap').unlink()
    metadata = path / 'metadata.yaml'
    content = yaml.safe_load(metadata.read_text())
    content['rosbag2_bagfile_information']['message_count'] += 7
    metadata.write_text(yaml.safe_dump(content))
    result = check_recording(bundle(tmp_path, 'every_message'), path, Selection())
    assert result.errors == ('metadata.yaml counts 407 messages, and 400 by topic',)


SILENT = """format: 1
evaluation: {policy: timed}
inputs: {level: {topic: level, type: std_msgs/msg/Float64, timeout: 1, stale: violate}}
requirements: [{id: R, ptltl: "level < 1"}]
"""


def test_a_part_ends_with_the_recording(tmp_path: Path) -> None:
    file = write_bundle(tmp_path, SILENT, 'silent.yaml')
    path = write(tmp_path / 'bag', [('/level', SECOND * k // 2, 0.0) for k in range(9)])

    def found(**moments: str) -> tuple[bool | None, int]:
        parsed: dict[str, Any] = {key: Moment.parse(text) for key, text in moments.items()}
        result = check_recording(file, path, Selection(**parsed))
        return result.findings[0].verdict, result.end - result.start

    assert found(end='60') == (True, 4 * SECOND)
    assert found(end='2', until='end+0.5') == (True, 2 * SECOND + SECOND // 2)
    assert found(until='end+2') == (False, 6 * SECOND)
    for moments, words in (({'begin': '5'}, '--from is after the end'),
                           ({'begin': '3', 'end': '2'}, 'the end is before the begin'),
                           ({'until': '3'}, '--until is before the end of what is judged')):
        with pytest.raises(CompileError, match=words):
            found(**moments)


def test_time_ends_where_a_damaged_recording_does(tmp_path: Path) -> None:
    file = write_bundle(tmp_path, SILENT, 'silent.yaml')
    path = write(tmp_path / 'bag', [('/level', SECOND * k // 10, 0.0) for k in range(4000)])
    recording, = path.glob('*.mcap')
    data = bytearray(recording.read_bytes())
    data[len(data) // 4:len(data) // 4 + 2000] = bytes(2000)
    recording.write_bytes(data)
    result = check_recording(file, path, Selection(is_partial=True))
    assert result.errors == (
        'the recording cannot be read to its end: a record in a chunk has a wrong length',
        '/level: 4,000 messages recorded, 1,376 read')
    assert (result.findings[0].verdict, result.findings[0].occurrences) == (True, 0)
    assert START < result.end < START + 140 * SECOND


def test_a_bundle_without_topics_and_a_compressed_file_are_refused(tmp_path: Path) -> None:
    path = write(tmp_path / 'bag', [('/level', 0, 0.0)])
    file = tmp_path / 'alone.yaml'
    file.write_text('format: 1\ninputs: {x: {type: float64}}\n'
                    'requirements: [{id: R, ptltl: "x < 1"}]\n', encoding='utf-8')
    with pytest.raises(CompileError, match='no input of the bundle has a topic'):
        check_recording(file, path, Selection())
    (tmp_path / 'one.mcap.zstd').touch()
    with pytest.raises(CompileError, match='decompress it: zstd -d'):
        check_recording(file, tmp_path / 'one.mcap.zstd', Selection())


def test_what_is_true_from_its_initial_value_on_is_judged(tmp_path: Path) -> None:
    file = write_bundle(tmp_path, """format: 1
evaluation: {policy: timed}
inputs:
  level: {topic: level, type: std_msgs/msg/Float64}
  door: {topic: door, type: std_msgs/msg/Bool, initial: false}
requirements: [{id: SHUT, ptltl: "!door"}]
""", 'initial.yaml')
    path = write(tmp_path / 'bag', [('/level', 0, 0.0), ('/level', SECOND, 0.0)])
    result = check_recording(file, path, Selection(may_miss=True))
    assert [item.verdict for item in result.findings] == [None]  # /door is not in the recording
    with Writer(tmp_path / 'whole', version=9) as writer:
        level = writer.add_connection('/level', FLOAT, typestore=TYPES)
        writer.add_connection('/door', 'std_msgs/msg/Bool', typestore=TYPES)
        for time in (0, SECOND):
            writer.write(level, START + time, TYPES.serialize_cdr(TYPES.types[FLOAT](0), FLOAT))
    result = check_recording(file, tmp_path / 'whole', Selection())
    assert (result.errors, [item.verdict for item in result.findings]) == ((), [True])


def test_messages_of_another_type_on_a_topic_are_an_error(tmp_path: Path) -> None:
    kinds = (FLOAT, 'std_msgs/msg/Float32')
    with Writer(tmp_path / 'bag', version=9) as writer:
        for number, kind in enumerate(kinds):
            topic = writer.add_connection('/level', kind, typestore=TYPES)
            writer.write(topic, START + number, TYPES.serialize_cdr(TYPES.types[kind](0.7), kind))
    selection = Selection(may_miss=True)
    result = check_recording(bundle(tmp_path, 'every_message'), tmp_path / 'bag', selection)
    assert any('Float32' in error and FLOAT in error for error in result.errors)
    assert result.findings[0].violations == 1  # those of the right type are judged


def test_periods_in_a_gap_are_taken_one_after_another(tmp_path: Path) -> None:
    file = write_bundle(tmp_path, """format: 1
evaluation: {policy: periodic, rate: 100}
inputs: {level: {topic: level, type: std_msgs/msg/Float64}}
requirements: [{id: LOW, ptltl: "level < 0.5"}]
""", 'period.yaml')
    path = write(tmp_path / 'bag', [('/level', 0, 0.0), ('/level', SECOND, 0.9),
                                    ('/level', 61 * SECOND, 0.0), ('/level', 62 * SECOND, 0.0)])
    result = check_recording(file, path, Selection())
    low, = result.findings
    assert (result.errors, low.violations, low.occurrences) == ((), 6000, 1)


def test_a_service_event_is_read(tmp_path: Path) -> None:
    pytest.importorskip('rclpy')
    from rclpy.serialization import serialize_message
    from std_srvs.srv import SetBool
    kind = 'std_srvs/srv/SetBool_Event'
    file = write_bundle(tmp_path, f"""format: 1
inputs: {{on: {{topic: enable/_service_event, type: {kind}, field: "request[0].data"}}}}
requirements: [{{id: OFF, ptltl: "!on"}}]
""", 'events.yaml')
    with Writer(tmp_path / 'bag', version=9) as writer:
        topic = writer.add_connection('/enable/_service_event', kind, msgdef='', rihs01='0')
        for number in range(4):
            event = SetBool.Event(request=[SetBool.Request(data=number % 2 == 1)])
            writer.write(topic, START + number, serialize_message(event))
    result = check_recording(file, tmp_path / 'bag', Selection())
    assert (result.errors, result.findings[0].violations) == ((), 2)


@pytest.mark.parametrize(('storage', 'compression'), [
    (StoragePlugin.MCAP, CompressionMode.STORAGE),
    pytest.param(StoragePlugin.SQLITE3, CompressionMode.MESSAGE, marks=thorough)])
def test_two_gigabytes_are_read_in_little_memory(
        tmp_path: Path, storage: StoragePlugin, compression: CompressionMode) -> None:
    count, kind = 2048, 'std_msgs/msg/Float64MultiArray'
    layout = TYPES.types['std_msgs/msg/MultiArrayLayout'](dim=[], data_offset=0)
    low, high = (TYPES.serialize_cdr(TYPES.types[kind](
        layout, numpy.full(1 << 17, value)), kind) for value in (0.0, 1.0))
    writer = Writer(tmp_path / 'bag', version=9, storage_plugin=storage)
    writer.set_compression(compression, CompressionFormat.ZSTD)  # to less than a megabyte
    with writer:
        topic = writer.add_connection('/level', kind, typestore=TYPES)
        for number in range(count):
            writer.write(topic, START + number, high if number % 8 == 7 else low)
    file = write_bundle(tmp_path, f"""format: 1
inputs: {{level: {{topic: level, type: {kind}, field: "data[9]"}}}}
requirements: [{{id: LOW, ptltl: "level < 0.5"}}]
""", 'large.yaml')
    megabytes: list[int] = []

    def measure(*_: object) -> None:
        pages = int(Path('/proc/self/statm').read_text(encoding='ascii').split()[1])
        megabytes.append(pages * os.sysconf('SC_PAGE_SIZE') >> 20)

    measure()
    result = check_recording(file, tmp_path / 'bag', Selection(), progress=measure)
    assert (result.errors, result.findings[0].violations) == ((), count // 8)
    assert len(megabytes) > 1000
    assert max(megabytes) < megabytes[0] + 100
    assert max(megabytes[len(megabytes) // 2:]) < max(megabytes[:len(megabytes) // 2]) + 20


def test_the_recordings_of_rosbag2_are_read_whole() -> None:
    """Set FRET_MONITOR_BAGS to a copy of the repository ros2/rosbag2."""
    if 'FRET_MONITOR_BAGS' not in os.environ:
        pytest.skip('needs FRET_MONITOR_BAGS')
    root = Path(os.environ['FRET_MONITOR_BAGS'])
    found = 0
    for path in sorted({*root.rglob('*.db3'), *root.rglob('*.mcap'),
                        *(file.parent for file in root.rglob('metadata.yaml'))}):
        if 'wrong_rmw' in str(path):
            continue
        with Recording(path) as recording:
            topics = [(name, kind) for name, kinds in recording.types.items() for kind in kinds]
            wanted = {topic: number for number, topic in enumerate(topics)}
            read = sum(len(batch.topics) for batch in recording.batches(wanted))
            assert read == sum(recording.recorded.values()), path
        found += 1
    assert found > 20


def stamped(folder: Path, ahead: float) -> Path:
    """Write 100 messages whose stamps are ahead of their reception; the last three are high."""
    kind = 'sensor_msgs/msg/Temperature'
    with Writer(folder / 'stamped', version=9) as writer:
        topic = writer.add_connection('/level', kind, typestore=TYPES)
        for number in range(100):
            time = START + number * 10_000_000
            stamp = TYPES.types['builtin_interfaces/msg/Time'](
                *divmod(time + int(ahead * SECOND), SECOND))
            header = TYPES.types['std_msgs/msg/Header'](stamp=stamp, frame_id='')
            message = TYPES.types[kind](header, float(number >= 97), 0.0)
            writer.write(topic, time, TYPES.serialize_cdr(message, kind))
    return folder / 'stamped'


@pytest.mark.parametrize('ahead', [0.0, 0.5, 5.0])
def test_messages_stamped_ahead_of_their_reception_take_effect(
        tmp_path: Path, ahead: float) -> None:
    file = write_bundle(tmp_path, """format: 1
evaluation: {policy: timed, stamp: header, reorder: 0.05}
inputs: {level: {topic: level, type: sensor_msgs/msg/Temperature, field: temperature}}
requirements: [{id: LOW, ptltl: "level < 0.5"}]
""", 'stamped.yaml')
    result = check_recording(file, stamped(tmp_path, ahead), Selection())
    low, = result.findings
    assert (low.verdict, low.first) == (False, START + 970_000_000 + int(ahead * SECOND))
    assert any('ahead' in warning for warning in result.warnings) == (ahead > 0)


def test_a_part_knows_which_inputs_are_silent(tmp_path: Path) -> None:
    file = write_bundle(tmp_path, """format: 1
inputs:
  a: {topic: level, type: std_msgs/msg/Float64, timeout: 0.5, stale: violate}
  b: {topic: flow, type: std_msgs/msg/Float64}
requirements: [{id: R, ptltl: "a < 1 | b > 9"}]
""", 'silent.yaml')
    path = write(tmp_path / 'bag', [
        ('/level', 0, 0.0), *(('/flow', number * SECOND // 10, 0.0) for number in range(200))])

    def first(begin: str) -> int | None:
        return check_recording(
            file, path, Selection(begin=Moment.parse(begin))).findings[0].first

    assert first('start') == START + SECOND // 2
    assert first('10') == START + 10 * SECOND
    assert first('0.3') == START + SECOND // 2


def test_what_earlier_runs_found_counts_until_something_changes(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = bundle(tmp_path, 'every_message')
    good = write(tmp_path / 'good', [('/level', 0, 0.0), ('/flow', 1, 0.0)])
    bad = write(tmp_path / 'bad', [('/level', 0, 0.7), ('/flow', 1, 0.0)])
    broken = tmp_path / 'broken.mcap'
    broken.write_bytes(b'')
    results, junit = tmp_path / 'r.jsonl', tmp_path / 'j.xml'
    arguments = ['bag', str(file), str(good), str(bad), str(broken), '--results', str(results),
                 '--fail-on-violation', '--junit', str(junit)]
    for _ in range(2):
        assert main(arguments) == 1
        suites = ElementTree.parse(junit).getroot()
        assert [suite.get('failures') for suite in suites] == ['0', '1', '0']
        assert [suite.get('errors') for suite in suites] == ['0', '0', '1']
    out = capsys.readouterr().out
    assert out.count(f'{bad}: checked before, violated: LOW') == 1
    assert len(results.read_text(encoding='utf-8').splitlines()) == 4  # the broken one again
    shutil.rmtree(good)
    write(tmp_path / 'good', [('/level', 0, 0.8), ('/flow', 1, 0.0)])
    main(arguments)
    assert f'{good}: checked before' not in capsys.readouterr().out
    file.write_text(file.read_text(encoding='utf-8').replace('0.5"}', '0.9"}'), encoding='utf-8')
    main(arguments)
    assert 'checked before' not in capsys.readouterr().out


def test_what_could_not_be_used_is_said(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    kind = 'sensor_msgs/msg/JointState'
    with Writer(tmp_path / 'bag', version=9) as writer:
        topic = writer.add_connection('/joints', kind, typestore=TYPES)
        stamp = TYPES.types['builtin_interfaces/msg/Time'](0, 0)
        for number in range(10):
            message = TYPES.types[kind](
                TYPES.types['std_msgs/msg/Header'](stamp=stamp, frame_id=''),
                ['elbow' if number == 0 else 'other'], numpy.array([0.0]), numpy.array([]),
                numpy.array([]))
            writer.write(topic, START + number, TYPES.serialize_cdr(message, kind))
    file = tmp_path / 'joints.yaml'
    text = f"""format: 1
inputs:
  elbow: {{topic: joints, type: {kind}, field: "position[name = elbow]"}}
requirements: [{{id: R, ptltl: "elbow < 1"}}]
"""
    file.write_text(text, encoding='utf-8')
    assert main(['bag', str(file), str(tmp_path / 'bag')]) == 0
    assert '9 messages of joints without a value of elbow' in capsys.readouterr().err
    file.write_text(text.replace('= elbow', '= wrist'), encoding='utf-8')
    assert main(['bag', str(file), str(tmp_path / 'bag')]) == 1
    assert 'no message of joints has a value of elbow' in capsys.readouterr().err


def test_what_reads_a_missing_topic_is_not_judged(tmp_path: Path) -> None:
    file = write_bundle(tmp_path, """format: 1
inputs:
  a: {topic: gone, type: std_msgs/msg/Float64, initial: 3, timeout: 1, stale: violate}
  b: {topic: level, type: std_msgs/msg/Float64}
requirements: [{id: A, ptltl: "a < 1"}, {id: B, ptltl: "b < 1"}]
""", 'missing.yaml')
    path = write(tmp_path / 'bag', [('/level', number * SECOND, 0.0) for number in range(20)])
    result = check_recording(file, path, Selection(may_miss=True))
    assert [(item.verdict, item.occurrences, item.violations) for item in result.findings] == [
        (None, 0, 0), (True, 0, 0)]
    assert result.warnings


def test_a_bag_of_ros_1_with_headers_is_read(tmp_path: Path) -> None:
    types = get_typestore(Stores.ROS1_NOETIC)
    kind = 'sensor_msgs/msg/Temperature'
    with Writer1(tmp_path / 'old.bag') as writer:
        topic = writer.add_connection('/level', kind, typestore=types)
        for number in range(10):
            header = types.types['std_msgs/msg/Header'](
                seq=number, stamp=types.types['builtin_interfaces/msg/Time'](number, 0),
                frame_id='tank')
            message = types.types[kind](header, float(number), 0.0)
            writer.write(topic, START + number, types.serialize_ros1(message, kind))
    file = write_bundle(tmp_path, f"""format: 1
inputs: {{level: {{topic: level, type: {kind}, field: temperature}}}}
requirements: [{{id: LOW, ptltl: "level < 4"}}]
""", 'warm.yaml')
    result = check_recording(file, tmp_path / 'old.bag', Selection())
    assert (result.errors, result.findings[0].violations) == ((), 6)


def test_a_broken_recording_is_a_result_with_files_too(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    broken = tmp_path / 'broken.mcap'
    broken.write_bytes(b'')
    results, junit = tmp_path / 'r.jsonl', tmp_path / 'j.xml'
    assert main(['bag', str(bundle(tmp_path, 'every_message')), str(broken), '--json', '--csv',
                 str(tmp_path / 'c.csv'), '--results', str(results), '--junit', str(junit)]) == 1
    out, err = capsys.readouterr()
    assert json.loads(out)['errors'] and 'cannot read the recording' in err
    assert json.loads(results.read_text(encoding='utf-8'))['errors']
    assert ElementTree.parse(junit).getroot()[0].get('errors') == '1'
    assert not (tmp_path / 'c.csv').exists()
