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

"""`new --live`: a first bundle says what was published while it listened."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
import os
from pathlib import Path
import re
import signal
from threading import Thread
from time import sleep
from typing import Any

from fret_monitor.bag import live
from fret_monitor.build import read
from fret_monitor.cli.main import main
from fret_monitor.runtime.mcap import McapWriter
import pytest
from rclpy.publisher import Publisher
from ros.harness import BEST_EFFORT, LATCHED, Partner, wait_until
import std_msgs.msg

pytest.importorskip('rosbags')

NODE = 'fret_monitor_new'


@contextmanager
def beside(work: Callable[[], None]) -> Iterator[None]:
    """Run something in a thread; raise what it raised."""
    failed: list[AssertionError] = []

    def guarded() -> None:
        try:
            work()
        except AssertionError as error:
            failed.append(error)

    thread = Thread(target=guarded)
    thread.start()
    try:
        yield
    finally:
        thread.join()
        if failed:
            raise failed[0]


@pytest.fixture
def recorded(monkeypatch: pytest.MonkeyPatch) -> set[bytes]:
    """Return the messages that `new` has recorded so far, each once."""
    recorder, found = live._recorder, set[bytes]()

    def noting(writer: McapWriter, channel: int) -> Callable[[bytes], None]:
        record = recorder(writer, channel)

        def note(data: bytes) -> None:
            record(data)
            found.add(bytes(data))
        return note

    monkeypatch.setattr(live, '_recorder', noting)
    return found


def publish_until(publisher: Publisher, values: Sequence[Any], recorded: set[bytes],
                  count: int) -> None:
    """Publish values again and again until so many messages are recorded; then interrupt."""
    def step() -> bool:
        for value in values:
            publisher.publish(value)
            sleep(0.01)
        return len(recorded) >= count

    try:
        wait_until(step, f'{count} messages')
    finally:
        os.kill(os.getpid(), signal.SIGINT)  # what has come is enough


def test_each_field_has_what_was_published(
        partner: Partner, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
        recorded: set[bytes]) -> None:
    monkeypatch.setattr(live, '_UNCHANGED_S', 3.0)  # discovery on a busy machine
    speed = partner.publisher(std_msgs.msg.Float64, 'speed', BEST_EFFORT)
    mode = partner.publisher(std_msgs.msg.Int32, 'mode', LATCHED)
    partner.publisher(std_msgs.msg.String, 'note').publish(std_msgs.msg.String(data='hello'))
    mode.publish(std_msgs.msg.Int32(data=7))
    target = tmp_path / 'new.yaml'

    def drive() -> None:
        partner.wait_for_subscriptions(1, speed, mode)
        publish_until(speed, [std_msgs.msg.Float64(data=value) for value in (0.5, 1.0, 2.0)],
                      recorded, 4)

    with beside(drive):
        assert main(['new', '--live', '--all', '--seconds', '60', '-o', str(target)]) == 0
    text = target.read_text(encoding='utf-8')
    seen = re.search(r'  # /speed: (\d+) messages, \S+ a second, longest gap (\S+) s\n'
                     r'  speed: \{topic: /speed, type: std_msgs/msg/Float64, field: data, '
                     r'timeout: (\S+)\}   # 0\.5 to 2\n', text)
    assert seen and int(seen[1]) >= 3
    assert float(seen[3]) == pytest.approx(2 * float(seen[2]), rel=0.06, abs=0.001)
    assert '  # /mode: 1 message\n' in text and 'field: data}   # always 7\n' in text
    assert '/note' not in text and '/rosout' not in text
    before, _, after = text.partition('# requirements:')
    target.write_text(before + ('# requirements:' + after).replace('\n# ', '\n').removeprefix(
        '# '), encoding='utf-8')
    assert len(read(target).specification.properties) == 2


def test_topics_that_are_named_are_waited_for(partner: Partner, tmp_path: Path,
                                              recorded: set[bytes],
                                              capsys: pytest.CaptureFixture[str]) -> None:
    partner.publisher(std_msgs.msg.Float64, 'other')
    partner.publisher(std_msgs.msg.String, 'note')

    def advertise() -> None:
        wait_until(lambda: NODE in partner.node.get_node_names(), 'the node of `new`')
        level = partner.publisher(std_msgs.msg.Float32, 'level')
        partner.wait_for_subscriptions(1, level)
        publish_until(level, [std_msgs.msg.Float32(data=3.0)], recorded, 1)

    target = tmp_path / 'new.yaml'
    with beside(advertise):
        assert main(['new', '--live', '--topics', 'level', 'note', '--seconds', '60',
                     '-o', str(target)]) == 0
    text = target.read_text(encoding='utf-8')
    assert 'level: {topic: /level, type: std_msgs/msg/Float32, field: data' in text
    assert 'always 3' in text and '/other' not in text
    assert 'warning: left out, as they have no numbers: /note\n' in capsys.readouterr().err


def test_what_is_not_there_is_refused(partner: Partner, stranger: Partner,
                                      monkeypatch: pytest.MonkeyPatch,
                                      capsys: pytest.CaptureFixture[str]) -> None:
    partner.publisher(std_msgs.msg.Float64, 'twice')
    stranger.publisher(std_msgs.msg.Int32, 'twice')
    partner.publisher(std_msgs.msg.Bool, 'enable')
    monkeypatch.setattr(live, '_LONGEST_WAIT_S', 3.0)
    assert main(['new', '--live', '--topics', '/enabel']) == 1
    error = capsys.readouterr().err
    assert "no topic '/enabel' with numbers is published" in error
    assert "did you mean '/enable'" in error
    assert '/twice is left out: the topic /twice has several types' in error
    assert main(['new', '--live']) == 1
    assert '--topics TOPIC... takes some, --all takes all' in capsys.readouterr().err


def test_a_graph_without_numbers_is_refused(domain: int, monkeypatch: pytest.MonkeyPatch,
                                            capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(live, '_LONGEST_WAIT_S', 0.5)
    assert main(['new', '--live', '--all']) == 1
    error = capsys.readouterr().err
    assert 'no topic with numbers is published' in error and f'ROS_DOMAIN_ID is {domain}' in error


@pytest.mark.parametrize('seconds', ['0', 'nan', 'inf', 'long'])
def test_a_time_that_is_none_is_refused(seconds: str) -> None:
    with pytest.raises(SystemExit) as ended:
        main(['new', '--live', '--all', '--seconds', seconds])
    assert ended.value.code == 2
