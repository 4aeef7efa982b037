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

"""Transforms in both nodes: the verdicts are those of `bag` on the same links."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from random import Random
from typing import Any

from bag.recordings import START, TYPES
from bundles import write_bundle
from fret_monitor.bag.check import check_recording, Selection
from geometry_msgs.msg import TransformStamped
import pytest
from rclpy.publisher import Publisher
from ros import tf2_msgs
from ros.exported import exported_bundle, running
from ros.harness import LATCHED, NodeProcess, Partner, RELIABLE, started, wait_until
from rosbags.rosbag2 import StoragePlugin, Writer
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Header
from strategies import thorough
from transforms import LinkOf, links

diagnostic_msgs = pytest.importorskip('diagnostic_msgs.msg')

MS = 10**6
HERE = [0.0, 0.0, 0.0, 1.0]
BUNDLE = """
format: 1
inputs:
  x: {transform: {from: map, to: lidar}, field: translation.x, timeout: 1, startup: 2}
  far: {transform: {from: map, to: lidar}, field: norm(translation), timeout: 1, startup: 2}
  heading: {transform: {from: map, to: base}, field: yaw(rotation)}
  new: {transform: {from: map, to: base}, field: received()}
requirements:
  - {id: EAST, ptltl: x < 1}
  - {id: NEAR, ptltl: far < 3}
  - {id: HEADING, ptltl: heading < 0.5 | Y heading < 0.6}
  - {id: SEEN, ptltl: "!new"}
"""
IDS = ('EAST', 'NEAR', 'HEADING', 'SEEN')
STATIC = LinkOf(5, 'base', 'lidar', [0.5, 0.0, 0.25], HERE)
Message = tuple[bool, list[LinkOf]]  # whether on /tf_static, and the links


def random_messages(seed: int, count: int) -> list[Message]:
    """Return odom -> base, and at every third time map -> odom; out of order, some repeated."""
    rng = Random(seed)
    found: list[Message] = []
    for number in range(count):
        stamp = START + number * 20 * MS - rng.randrange(30) * MS
        items = [LinkOf(stamp, 'odom', 'base', [rng.uniform(-3, 3), rng.uniform(-3, 3), 0.0],
                        HERE)]
        if number % 3 == 0:
            turned = rng.uniform(-0.5, 0.5)
            items.append(LinkOf(stamp, 'map', 'odom', [rng.uniform(-1, 1), 0.0, 0.0],
                                [0.0, 0.0, turned, (1 - turned * turned) ** 0.5]))
        found.append((False, rng.sample(items, len(items))))
    return found


def judged(bundle: Path, path: Path, messages: list[Message]) -> dict[str, int]:
    """Return the violations that `bag` finds."""
    kind = 'tf2_msgs/msg/TFMessage'
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = [writer.add_connection(name, kind, typestore=TYPES)
                       for name in ('/tf', '/tf_static')]
        for number, (is_static, items) in enumerate(messages):
            writer.write(connections[is_static], START + number * MS, links(*items))
    result = check_recording(bundle, path, Selection())
    assert result.errors == ()
    return {item.id: item.violations or 0 for item in result.findings}


def message(items: list[LinkOf]) -> Any:
    found = []
    for item in items:
        one = TransformStamped(child_frame_id=item.child)
        one.header.frame_id = item.parent
        one.header.stamp.sec, one.header.stamp.nanosec = divmod(item.stamp, 10**9)
        for name, value in zip('xyz', item.translation):
            setattr(one.transform.translation, name, value)
        for name, value in zip('xyzw', item.rotation):
            setattr(one.transform.rotation, name, value)
        found.append(one)
    return tf2_msgs.message_class()(transforms=found)


@contextmanager
def node(kind: str, bundle: Path, *arguments: str) -> Iterator[NodeProcess]:
    environment = tf2_msgs.environment()
    if kind == 'rclpy':
        with started('monitor', '-p', f'spec:={bundle}', *arguments, environment=environment,
                     is_anew=True) as process:
            yield process
        return
    with pytest.MonkeyPatch.context() as patch:
        for name, value in environment.items():
            patch.setenv(name, value)
        program = exported_bundle(bundle)
    with running(program, *arguments, environment=environment) as process:
        yield process


class Links:
    """Publishes on /tf and /tf_static, as remapped."""

    def __init__(self, partner: Partner, prefix: str = '') -> None:
        kind = tf2_msgs.message_class()
        self._partner = partner
        self.moving = partner.publisher(kind, f'{prefix}/tf', RELIABLE)
        self.static: Publisher = partner.publisher(kind, f'{prefix}/tf_static', LATCHED)
        self.statuses: dict[str, Any] = {}
        partner.node.create_subscription(
            diagnostic_msgs.DiagnosticArray, '/diagnostics', self._take, 10)

    def _take(self, array: Any) -> None:
        self.statuses = {item.name.partition(': ')[2]: (item.level, item.message, {
            pair.key: pair.value for pair in item.values}) for item in array.status}

    def send(self, messages: list[Message]) -> None:
        for is_static, items in messages:
            (self.static if is_static else self.moving).publish(message(items))

    def wait_for(self, name: str, level: bytes, text: str) -> None:
        wait_until(lambda: self.statuses.get(name, ())[:2] == (level, text),
                   f'{name}: {text}')


@pytest.mark.parametrize('kind', ['rclpy', 'rcl'])
def test_the_verdicts_are_those_of_bag_and_a_missing_link_is_named(
        partner: Partner, tmp_path: Path, kind: str) -> None:
    bundle = write_bundle(tmp_path, BUNDLE)
    messages = random_messages(7, 60)
    here = Links(partner, '/robot')
    here.send([(True, [STATIC])])
    with node(kind, bundle, '-r', '__ns:=/robot', '-r', '/tf:=tf', '-r',
              '/tf_static:=tf_static', '-p', f'blackbox:={tmp_path / "box"}') as process:
        partner.listen(*IDS, prefix='/robot/copilot/handlerprop')
        partner.wait_for_listener(here.moving, here.static)
        process.wait_for(
            "no usable value on map -> lidar within the startup of 2 s for 'x', 'far' "
            '(no link between map and ')  # a busy machine has not received the static link yet
        process.wait_for(
            'EAST, NEAR, HEADING, SEEN are not evaluated yet: nothing received on map -> '
            "lidar (no link between map and base) for 'x', 'far'; nothing received on map -> base "
            "(no link between map and base) for 'heading', 'new'")
        here.wait_for('transform map -> base', b'\1', 'no link between map and base')
        here.wait_for('topic /robot/tf_static', b'\0', 'received')
        here.send(messages)
        expected = judged(bundle, tmp_path / 'bag', [(True, [STATIC]), *messages])
        assert all(expected.values()) and expected['NEAR'] < expected['EAST'] < len(messages)
        partner.expect(expected)
        here.wait_for('transform map -> base', b'\0', 'received')
        here.wait_for('links of bundle', b'\0', 'taken')
        assert here.statuses['topic /robot/tf'][2]['received'] == str(len(messages))
        here.send([(False, [LinkOf(START, 'lidar', 'map', HERE[:3], HERE)])])
        process.wait_for('links of /tf left out: 1 would close a loop')
        here.wait_for('links of bundle', b'\1', '1 would close a loop since the last report')
    written, = (tmp_path / 'box').glob('*.mcap')
    found = check_recording(bundle, written, Selection())
    assert (found.errors, found.warnings) == ((), ())
    assert {item.id: item.violations or 0 for item in found.findings} == expected


SINCE = """
format: 1
inputs:
  x: {transform: {from: map, to: lidar}, field: translation.x}
requirements:
  - {id: EAST, ptltl: H x < 1}
  - {id: SEEN, ptltl: x > 100}
"""


def moved(stamp: int, x: float, *children: str) -> Message:
    """Return links at a time in seconds; the last one is x long."""
    parents = {'odom': 'map', 'base': 'odom'}
    return False, [LinkOf(stamp * 10**9, parents[child], child,
                          [x if child == 'base' else 0.0, 0.0, 0.0], HERE) for child in children]


class TimeOf:
    """Publishes /clock until the node has its time."""

    def __init__(self, partner: Partner) -> None:
        self._clock = partner.publisher(Clock, '/clock')
        self._alive = -1
        partner.node.create_subscription(Header, 'fret_monitor/alive', self._take, RELIABLE)

    def _take(self, header: Header) -> None:
        self._alive = header.stamp.sec

    def tell(self, seconds: int) -> None:
        def is_told() -> bool:
            clock = Clock()
            clock.clock.sec = seconds
            self._clock.publish(clock)
            return self._alive == seconds
        wait_until(is_told, f'/clock at {seconds}')


@thorough
@pytest.mark.parametrize('kind', ['rclpy', 'rcl'])
def test_a_reset_keeps_all_links_and_a_clock_that_goes_back_only_static_ones(
        partner: Partner, tmp_path: Path, kind: str) -> None:
    here, time = Links(partner), TimeOf(partner)
    with node(kind, write_bundle(tmp_path, SINCE), '-p', 'use_sim_time:=true') as process:
        partner.listen('EAST', 'SEEN')
        partner.wait_for_listener(here.moving, here.static)
        time.tell(100)
        here.send([(True, [STATIC])])
        here.wait_for('topic /tf_static', b'\0', 'received')
        here.send([moved(105, 0.0, 'odom'), moved(100, 2.0, 'odom', 'base'),
                   moved(101, 0.0, 'base')])
        partner.expect({'EAST': 2, 'SEEN': 2})
        partner.reset()
        here.send([moved(102, 0.0, 'base')])
        partner.expect({'EAST': 2, 'SEEN': 3})
        time.tell(10)
        process.wait_for('time went back, to 10.000 s')
        here.wait_for('transform map -> lidar', b'\1', 'no link between map and base')
        here.send([moved(10, 0.0, 'base')])
        here.wait_for('transform map -> lidar', b'\1', 'no link between map and odom')
        here.send([moved(11, 0.0, 'odom', 'base'),
                   moved(12, 0.0, 'odom'), moved(12, 3.0, 'base')])
        partner.expect({'EAST': 3, 'SEEN': 5})
        here.wait_for('links of bundle', b'\0', 'taken')
