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

"""The black box: a file at each violation, which `bag` reads; limits; folders that fail."""

from collections.abc import Iterator
from dataclasses import replace
import json
from pathlib import Path
import shutil
import struct
from time import sleep, time_ns
from typing import Any

from bag.recordings import TYPES
from bundles import write_bundle
from diagnostic_msgs.msg import DiagnosticArray
from fret_monitor import build
from fret_monitor.bag.check import check_recording, Selection
from fret_monitor.cli.main import main
from fret_monitor.ros import Refusal
from fret_monitor.ros.acting import blackbox
from fret_monitor.ros.acting.blackbox import BlackBox
from fret_monitor.ros.settings.parameters import BlackBoxSettings, read_settings
from fret_monitor.runtime import Engine, Evaluator
import pytest
from ros.exported import monitoring, NODES, start
from ros.harness import LATCHED, Partner, wait_until
from rosbags.rosbag2 import Reader
from sensor_msgs.msg import Temperature
from std_msgs.msg import Float32, Header
from strategies import HOT_PATHS, thorough

BUNDLE = """
format: 1
inputs:
  x: {topic: x, type: std_msgs/msg/Float32, initial: 0}
  heat: {topic: deep/heat, type: sensor_msgs/msg/Temperature, field: temperature, initial: 0}
evaluation: {policy: every_message}
requirements:
  - {id: R-1, ptltl: "x < 0.5"}
"""
MESSAGE = b'\0\1\0\0'


class FakeNode:
    """What a black box wants of a node."""

    def resolve_topic_name(self, name: str) -> str:
        return f'/robot/{name}'

    def get_fully_qualified_name(self) -> str:
        return '/robot/fret_monitor'


class Workbench:
    """An engine with a black box, without a node."""

    def __init__(self, folder: Path, **settings: Any) -> None:
        bundle = write_bundle(folder, BUNDLE)
        self.spec = bundle
        self.folder = folder / 'box'
        self.engine = Engine(Evaluator(build.build(bundle).monitor, reports_recoveries=True))
        node: Any = FakeNode()
        wanted = replace(BlackBoxSettings(self.folder), **settings)
        self.box = BlackBox(
            node, self.engine.monitor.manifest, wanted, self.engine.library)
        self.engine.follow_steady()
        self.box.start(self.engine)

    def lines(self) -> list[str]:
        return [line.text for line in self.box.lines()]

    def violate(self) -> None:
        self.send(0.1)
        self.send(0.9)

    def send(self, value: float, at: float | None = None, more: int = 0) -> None:
        """Send a message, at a time in seconds, with so many bytes that are not read."""
        self.engine.message(0, MESSAGE + struct.pack('<f', value) + bytes(more),
                            received=time_ns() if at is None else int(at * 1e9))

    def files(self) -> list[Path]:
        return sorted(self.folder.glob('*.mcap'))

    def wait(self, *, written: int = 0, failed: int = 0) -> None:
        def is_there() -> bool:
            counts = self.box.counts()
            return bool(counts.written >= written and counts.failed >= failed)

        wait_until(is_there, f'{written} files and {failed} failures', 10.0)

    def times(self, path: Path) -> list[int]:
        with Reader(path) as reader:
            return [time for item, time, _ in reader.messages() if item.topic == '/robot/x']


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """End files soon."""
    monkeypatch.setattr(blackbox, '_AFTER_NS', 300_000_000)
    monkeypatch.setattr(blackbox, '_POLL_NS', 20_000_000)


@pytest.fixture
def bench(quick: None, tmp_path: Path) -> Iterator[Workbench]:
    made = Workbench(tmp_path, seconds=0.5)
    yield made
    made.box.end()


def test_a_file_has_what_was_before_and_after_and_later_violations_join_it(
        quick: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(blackbox, '_AFTER_NS', 1_500_000_000)
    bench = Workbench(tmp_path, seconds=1.0)
    bench.send(0.1)  # too old for the file
    sleep(1.1)
    bench.send(0.2)
    bench.send(0.9)
    sleep(0.75)
    bench.violate()  # goes on until 1.5 s after this one
    sleep(0.9)
    bench.send(0.3)
    bench.wait(written=1)
    bench.send(0.4)  # too late
    [path] = bench.files()
    assert path.name.endswith('Z_robot_fret_monitor_R_1.mcap')
    assert bench.lines() == [f'the last messages are in {path}']
    assert bench.lines() == []
    with Reader(path) as reader:
        assert {item.topic: item.msgcount for item in reader.connections} == {
            '/robot/x': 5, '/robot/deep/heat': 0, '/robot/~/blackbox_end': 1}
    result = check_recording(bench.spec, path, Selection(namespace='/robot'))
    assert result.errors == ()
    assert sum(result.read.values()) == 5
    bench.send(0.9)
    bench.box.end()
    assert bench.box.counts().written == 2


def test_a_file_that_is_pending_is_written_at_the_end(tmp_path: Path) -> None:
    bench = Workbench(tmp_path)
    bench.send(0.9)
    bench.box.end()
    bench.box.end()
    [path] = bench.files()
    assert len(bench.times(path)) == 1
    assert [item.name for item in bench.folder.iterdir()] == [path.name]


def test_the_oldest_files_are_removed_and_others_are_not(quick: None, tmp_path: Path) -> None:
    bench = Workbench(tmp_path, files=2)
    (bench.folder / 'mine.mcap').touch()
    seen = []
    for number in range(4):
        bench.violate()
        bench.wait(written=number + 1)
        seen.append(max(set(bench.files()) - {bench.folder / 'mine.mcap'}))
    assert bench.files() == sorted([*seen[2:], bench.folder / 'mine.mcap'])
    bench.box.end()


def test_files_need_no_more_disk_than_allowed(quick: None, tmp_path: Path) -> None:
    bench = Workbench(tmp_path, disk_bytes=20_000)
    large = MESSAGE + struct.pack('<f', 0.9) + bytes(4_000)
    for number in range(4):
        bench.send(0.1)
        for _ in range(3):
            bench.engine.message(0, large, received=time_ns())
        bench.wait(written=number + 1)
        sizes = [path.stat().st_size for path in bench.files()]
        assert sum(sizes) <= 20_000
        sleep(0.4)
    assert bench.files()
    bench.box.end()


def test_a_violation_is_in_its_file_however_little_that_may_have(
        quick: None, tmp_path: Path) -> None:
    bench = Workbench(tmp_path, disk_bytes=20_000)
    for number in range(50):
        bench.send(0.1, at=100 + number, more=900)
    bench.send(0.9, at=200, more=900)
    bench.send(0.1, at=201, more=900)
    bench.wait(written=1)
    [path] = bench.files()
    assert 10_000 < path.stat().st_size <= 20_000
    times = bench.times(path)
    assert times[-2:] == [200 * 10**9, 201 * 10**9]
    assert len(times) > 10
    bench.send(0.1, more=900)
    bench.send(0.9, more=30_000)  # more than it may have
    bench.wait(written=2)
    [path] = bench.files()
    assert len(bench.times(path)) == 1
    bench.box.end()


def test_a_file_has_messages_of_one_run_of_the_clock(quick: None, tmp_path: Path) -> None:
    bench = Workbench(tmp_path)
    for at, value in ((100, 0.1), (101, 0.1), (5, 0.1), (6, 0.9), (7, 0.2)):
        bench.send(value, at=at)
    sleep(0.1)  # it is pending
    bench.send(0.1, at=3)
    bench.send(0.9, at=4)
    bench.wait(written=2)
    assert [[time // 10**9 for time in bench.times(path)] for path in bench.files()] == [
        [5, 6, 7], [3, 4]]
    bench.box.end()


DUE = BUNDLE.replace('every_message', 'timed').replace(
    'ptltl: "x < 0.5"', 'fretish: "when x > 0.5 the tank shall within 0.2 seconds satisfy x < 0"')


def test_a_deadline_after_the_last_message_is_not_open_in_a_file(bench: Workbench) -> None:
    bench.violate()
    bench.wait(written=1)
    [path] = bench.files()
    bench.spec.write_text(DUE, encoding='utf-8')
    result = check_recording(bench.spec, path, Selection(namespace='/robot'))
    assert result.errors == ()
    assert [item.occurrences for item in result.findings] == [1]


def test_what_cannot_be_written_is_logged_once_and_counted(bench: Workbench) -> None:
    shutil.rmtree(bench.folder)
    for number in (1, 2):
        bench.violate()
        bench.wait(failed=number)
    assert bench.lines() == [
        f'the black box cannot write to {bench.folder}: No such file or directory; '
        '/diagnostics counts the files that are missing']
    bench.folder.mkdir()
    bench.violate()
    bench.wait(written=1)


@pytest.mark.parametrize(('given', 'words'), [
    ({'blackbox': 3}, "'blackbox' is 3, and has to be the path of a folder"),
    ({'blackbox_seconds': -1.0}, "'blackbox_seconds' is -1.0"),
    ({'blackbox_bytes': 0}, "'blackbox_bytes' is 0, and has to be a number of bytes"),
    ({'blackbox_files': 0}, "'blackbox_files' is 0, and has to be a number of files, at least 1"),
    ({'blackbox_files': 1 << 62}, "'blackbox_files' is 4611686018427387904, and has to be"),
    ({'blackbox_disk_bytes': 100_000}, 'at least 1048576: -p blackbox_disk_bytes:=1048576'),
])
def test_values_that_cannot_be_used_are_refused(given: dict[str, object], words: str) -> None:
    with pytest.raises(Refusal, match=words):
        read_settings({'spec': 'quadrotor.yaml', **given})


@pytest.mark.parametrize('how', [*HOT_PATHS, 'rcl'])
def test_a_monitor_writes_a_file_that_bag_judges_alike(
        partner: Partner, tmp_path: Path, how: str, capsys: pytest.CaptureFixture[str],
) -> None:
    spec, folder = tmp_path / 'bundle.yaml', tmp_path / 'flight' / 'box'
    spec.write_text(BUNDLE, encoding='utf-8')
    seen: dict[str, str] = {}

    def keep(array: DiagnosticArray) -> None:
        for status in array.status:
            if 'black box' in status.name:
                seen[status.message] = json.dumps({item.key: item.value for item in status.values})

    partner.node.create_subscription(DiagnosticArray, '/diagnostics', keep, 10)
    arguments = ('-p', f'blackbox:={folder}', '-p', 'blackbox_bytes:=4096', '-r', 'x:=y')
    with monitoring(how, spec, *arguments) as node:
        publisher = partner.publisher(Float32, 'y')
        other = partner.publisher(Temperature, 'deep/heat')
        partner.wait_for_listener(publisher, other)
        for number in range(20):
            publisher.publish(Float32(data=number * 0.01))
            other.publish(Temperature(temperature=float(number)))
            sleep(0.01)
        publisher.publish(Float32(data=0.75))
        node.wait_for('the last messages are in')
        [path] = folder.iterdir()
        wait_until(lambda: any('"written": "1"' in text for text in seen.values()), 'a status')
        assert list(seen) == ['keeps the last messages']
        other.publish(Temperature(header=Header(frame_id=5_000 * 'x')))
        wait_until(lambda: any('larger than `blackbox_bytes`' in text for text in seen), 'it')
        shutil.rmtree(folder)
        publisher.publish(Float32(data=0.1))
        publisher.publish(Float32(data=0.75))
        node.wait_for('the black box cannot write to')
        wait_until(lambda: 'cannot write' in seen, 'the failure')
        folder.mkdir()
        publisher.publish(Float32(data=0.1))
        publisher.publish(Float32(data=0.75))
        wait_until(lambda: any(folder.iterdir()), 'the next file')
    [path] = folder.iterdir()  # written at the end of the node
    assert main(['bag', str(spec), str(path), '--remap', 'x:=y', '--json']) == 0
    found = json.loads(capsys.readouterr().out)
    assert found['errors'] == []
    assert found['recorded'] == found['read'] == 45
    assert found['requirements']['R-1']['occurrences'] == 3


SELECTED = """
format: 1
inputs:
  a: {topic: t, type: KIND, where: "header.frame_id = a", field: temperature, initial: 0}
  b: {topic: t, type: KIND, where: "header.frame_id = b", field: temperature, initial: 0}
evaluation: {policy: relevant_message}
requirements:
  - {id: A, ptltl: "a < 0.5 | Y (a < 0.5)"}
  - {id: B, ptltl: "b < 0.5", report: onset}
""".replace('KIND', 'sensor_msgs/msg/Temperature')


@pytest.mark.parametrize('how', ['on', pytest.param('rcl', marks=thorough)])
def test_messages_of_a_topic_with_several_where_are_in_the_file_once(
        partner: Partner, tmp_path: Path, how: str, capsys: pytest.CaptureFixture[str]) -> None:
    spec, folder = tmp_path / 'bundle.yaml', tmp_path / 'box'
    spec.write_text(SELECTED, encoding='utf-8')
    sent = [('a', 0.1), ('c', 9.0), ('b', 0.2), ('a', 0.9), ('c', 0.3), ('b', 0.4), ('a', 0.7)]
    with monitoring(how, spec, '-p', f'blackbox:={folder}') as node:
        publisher = partner.publisher(Temperature, 't', LATCHED)
        wait_until(lambda: publisher.get_subscription_count() == 2, 'both subscriptions')
        for name, value in sent:
            publisher.publish(Temperature(header=Header(frame_id=name), temperature=value))
        node.wait_for('A violated at')
    [path] = folder.iterdir()  # written at the end of the node
    with Reader(path) as reader:
        assert [item.topic for item in reader.connections].count('/t') == 1
        found: list[Any] = [TYPES.deserialize_cdr(data, item.msgtype)
                            for item, _, data in reader.messages() if item.topic == '/t']
    assert [(item.header.frame_id, item.temperature) for item in found] == sent
    assert main(['bag', str(spec), str(path), '--json']) == 0
    judged = json.loads(capsys.readouterr().out)
    assert judged['errors'] == []
    assert {name: item['occurrences'] for name, item in judged['requirements'].items()} == {
        'A': 1, 'B': 0}


@pytest.mark.parametrize('node', NODES)
def test_a_folder_that_cannot_be_written_is_an_error_of_configure(
        tmp_path: Path, domain: int, node: str, monkeypatch: pytest.MonkeyPatch) -> None:
    spec = write_bundle(tmp_path, BUNDLE)
    monkeypatch.setenv('HOME', '/')
    monkeypatch.setenv('ROS_LOG_DIR', str(tmp_path))
    assert f"parameter 'blackbox': cannot write to the folder '{spec}/box': Not a directory" \
        in start(node, spec, '-p', f'blackbox:=~{tmp_path}//./{spec.name}/box/').error()
