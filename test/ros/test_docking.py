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

"""config/docking.yaml on one drive: both nodes live, and `bag` on a recording of the same."""

from contextlib import ExitStack
from pathlib import Path
from time import monotonic, sleep, time_ns
from typing import Any

from bag.recordings import TYPES
import fret_monitor
from fret_monitor.bag.check import check_recording, Selection
import pytest
from rclpy.lifecycle import LifecycleNode
from ros import tf2_msgs
from ros.harness import LATCHED, Partner, RELIABLE
from ros.test_asked import living, Watcher
from ros.test_transforms import HERE, message, node
from rosbags.rosbag2 import StoragePlugin, Writer
from strategies import thorough
from transforms import LinkOf

pytest.importorskip('diagnostic_msgs.msg')
lifecycle_msgs = pytest.importorskip('lifecycle_msgs.msg')
nav_msgs = pytest.importorskip('nav_msgs.msg')
sensor_msgs = pytest.importorskip('sensor_msgs.msg')

BUNDLE = Path(fret_monitor.__file__).resolve().parents[1] / 'config' / 'docking.yaml'
if not BUNDLE.is_file():
    pytest.skip('needs the source tree', allow_module_level=True)

STEP_S = 1 / 30
KINDS = {'rcl': '/two', 'rclpy': '/one'}  # the one that is built first
VIOLATIONS = {'DOCK-001': 1, 'DOCK-002': 3, 'DOCK-003': 1, 'DOCK-004': 1, 'DOCK-005': 1}


class Recorder:
    """Keeps the messages of all topics as they are received."""

    def __init__(self, partner: Partner) -> None:
        self._kept: list[tuple[int, str, bytes]] = []
        self._kinds: dict[str, str] = {}
        self._partner = partner

    def record(self, topic: str, kind: Any, name: str, profile: Any = RELIABLE) -> None:
        def keep(data: bytes) -> None:
            self._kept.append((time_ns(), topic, bytes(data)))
        self._kinds[topic] = name
        self._partner.node.create_subscription(kind, topic, keep, profile, raw=True)

    def write(self, path: Path) -> Path:
        with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            connections = {topic: writer.add_connection(topic, name, typestore=TYPES)
                           for topic, name in self._kinds.items()}
            for time, topic, data in self._kept:
                writer.write(connections[topic], time, data)
        return path


class Base:
    """A base that publishes its scans, odometry, battery and pose; all is recorded."""

    def __init__(self, partner: Partner) -> None:
        self.speed, self.distance, self.current = 0.25, 5.0, -4.0
        self.is_scanning = True
        self.recorder = Recorder(partner)
        self._partner = partner
        self._steps = 0
        links = tf2_msgs.message_class()
        self.scan = self._topic(partner, '/scan', sensor_msgs.LaserScan)
        self.odometry = self._topic(partner, '/odom', nav_msgs.Odometry)
        self.battery = self._topic(partner, '/battery_state', sensor_msgs.BatteryState)
        self.pose = self._topic(partner, '/tf', links)
        self.static = self._topic(partner, '/tf_static', links, LATCHED)
        self.recorder.record('/controller_server/transition_event',
                             lifecycle_msgs.TransitionEvent, 'lifecycle_msgs/msg/TransitionEvent')

    def _topic(self, partner: Partner, topic: str, kind: Any, profile: Any = RELIABLE) -> Any:
        package = kind.__module__.partition('.')[0]
        self.recorder.record(topic, kind, f'{package}/msg/{kind.__name__}', profile)
        return partner.publisher(kind, topic, profile)

    def wait_for_listeners(self, number: int) -> None:
        self._partner.wait_for_subscriptions(
            number, self.scan, self.odometry, self.battery, self.pose, self.static)

    def go_on(self, seconds: float) -> None:
        """Publish the current values for some seconds; what is late is made up for."""
        begin = monotonic()
        for step in range(round(seconds / STEP_S)):
            sleep(max(0.0, begin + step * STEP_S - monotonic()))
            self._publish()

    def _publish(self) -> None:
        self._steps += 1
        if self.is_scanning:
            self.scan.publish(sensor_msgs.LaserScan())
        if self._steps % 2:
            self.pose.publish(message([LinkOf(
                time_ns(), 'map', 'base_link', [self.distance, 0.0, 0.0], HERE)]))
            odometry = nav_msgs.Odometry()
            odometry.twist.twist.linear.x = self.speed
            self.odometry.publish(odometry)
        if self._steps % 3 == 0:
            self.battery.publish(sensor_msgs.BatteryState(current=self.current))


def drive(base: Base, controller: Any) -> None:
    """Drive well for five seconds; then violate each requirement, and none of these again."""
    base.go_on(5.3)
    base.speed = 9.0
    base.go_on(0.4)
    base.speed = 0.25
    base.go_on(0.4)
    base.distance, base.current = 1.0, -200.0
    base.go_on(0.4)
    base.speed = 9.0
    base.go_on(0.4)
    controller.trigger_deactivate()
    base.is_scanning = False
    base.go_on(1.5)


def occurrences(path: Path) -> dict[str, int]:
    found = check_recording(BUNDLE, path, Selection())
    assert found.errors == ()
    return {item.id: item.occurrences for item in found.findings}


@thorough  # in real time: a busy machine is no scanner of 30 Hz
def test_a_drive_to_the_dock_is_judged_alike_live_and_over_a_recording(
        partner: Partner, tmp_path: Path) -> None:
    ids = {name: name.replace('-', '_') for name in VIOLATIONS}
    watcher = Watcher(partner, ids.values())
    topics = [f'{name}:=/{name}' for name in ('scan', 'odom', 'battery_state')]
    remaps = [item for topic in topics for item in ('-r', topic)]
    with ExitStack() as stack:
        controller = stack.enter_context(living(
            partner, LifecycleNode, 'controller_server', '/'))
        for kind, space in KINDS.items():
            stack.enter_context(node(
                kind, BUNDLE, '-r', f'__ns:={space}', *remaps,
                '-p', f'blackbox:={tmp_path / kind}'))
        base = Base(partner)  # from here on all is recorded
        base.static.publish(message([LinkOf(5, 'map', 'dock', HERE[:3], HERE)]))
        base.wait_for_listeners(3)
        controller.trigger_configure()
        controller.trigger_activate()
        watcher.expect('graph lifecycle /controller_server', 'active')
        drive(base, controller)
        recording = base.recorder.write(tmp_path / 'recording')
        assert occurrences(recording) == VIOLATIONS
        watcher.violations(**{ids[name]: number for name, number in VIOLATIONS.items()})
    for kind in KINDS:
        written, = (tmp_path / kind).glob('*.mcap')
        assert occurrences(written) == VIOLATIONS, kind
