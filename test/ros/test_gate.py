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

"""Gates as real processes over DDS: what arrives behind them, whatever dies in front of it."""

from array import array
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
import re
import signal
from statistics import median
import subprocess
import sys
from threading import Event
from time import monotonic, sleep, time
from typing import Any

from bundles import ARMED, write_bundle
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
import fret_monitor
from fret_monitor.ros.native_start import GATE
from fret_monitor.ros.nodes.gate_node import GateNode
from fret_monitor.ros.nodes.monitor_node import MonitorNode
from geometry_msgs.msg import TwistStamped
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
import pytest
import rclpy.node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from ros.exported import ExportedNode
from ros.forked import environment
from ros.harness import (
    answer_of, BEST_EFFORT, change_state, LATCHED, NodeProcess, Partner, refusal, RELIABLE,
    started, wait_until,
)
from ros.test_native_start import program_of
from sensor_msgs.msg import Image
from std_msgs.msg import Bool, Float32, String
from std_srvs.srv import SetBool

BUNDLE = """\
format: 1
evaluation: {policy: relevant_message}
actions:
  stop: {lock: {topic: e_stop, rate: 20}}
inputs:
  speed: {topic: cmd_raw, type: geometry_msgs/msg/TwistStamped, field: twist.linear.x}
  distance: {topic: front, type: std_msgs/msg/Float32, timeout: 1.5}
  high: {topic: level_raw, type: std_msgs/msg/Float32, qos: {depth: 3000}}
  low: {topic: level_mid, type: std_msgs/msg/Float32, qos: {depth: 3000}}
  height: {topic: image_raw, type: sensor_msgs/msg/Image, field: height}
  free: {topic: free, type: std_msgs/msg/Bool}
requirements:
  - id: FRONT
    ptltl: "H (distance < 1.0 -> speed <= 0.0)"
    report: occurrence
    on_violation: [stop]
  - {id: HIGH, ptltl: "high <= 2.0"}
  - {id: LOW, ptltl: "low >= 1.0"}
  - {id: SMALL, ptltl: "height <= 1000"}
  - {id: FREE, ptltl: "free", report: onset}
gates:
  drive:
    from: cmd_raw
    to: cmd
    type: geometry_msgs/msg/TwistStamped
    keep: [FRONT]
    otherwise: {substitute: {header: {frame_id: base}, twist: {linear: {x: 0.0}}}, rate: 20}
  high: {from: level_raw, to: level_mid, type: std_msgs/msg/Float32, keep: [HIGH], otherwise: drop}
  low: {from: level_mid, to: level, type: std_msgs/msg/Float32, keep: [LOW], otherwise: drop}
  image: {from: image_raw, to: image, type: sensor_msgs/msg/Image, keep: [SMALL], otherwise: drop}
  note:
    from: note_raw
    to: note
    type: std_msgs/msg/String
    keep: [FREE]
    otherwise: drop
    latch: true
"""


class Listener:
    """Messages of one topic, with the times at which they came."""

    def __init__(self, partner: Partner, kind: Any, topic: str,
                 profile: QoSProfile = RELIABLE) -> None:
        """Subscribe."""
        self.found: list[tuple[float, Any]] = []
        self.subscription = partner.node.create_subscription(
            kind, topic, lambda message: self.found.append((monotonic(), message)), profile)

    @property
    def messages(self) -> list[Any]:
        return [message for _, message in self.found]

    def wait_for(self, count: int) -> None:
        wait_until(lambda: len(self.found) >= count, f'{count} messages')


class Mux:
    """
    The lock of twist_mux, by its documentation.

    It is locked by true, when nothing has come for the timeout, and when nothing has come at all.
    """

    TIMEOUT_S = 0.5

    def __init__(self, partner: Partner) -> None:
        """Subscribe."""
        self._lock = Listener(partner, Bool, 'e_stop')

    @property
    def is_locked(self) -> bool:
        if not self._lock.found:
            return True
        received, message = self._lock.found[-1]
        return bool(message.data) or monotonic() - received > self.TIMEOUT_S


def write(folder: Path, text: str = BUNDLE) -> Path:
    return write_bundle(folder, text, 'gates.yaml')


@contextmanager
def running(path: Path, *more: str) -> Iterator[NodeProcess]:
    with started('gate', '-p', f'spec:={path}', *more) as node:
        yield node


def twist(speed: float) -> TwistStamped:
    found = TwistStamped()
    found.twist.linear.x = speed
    return found


def speeds(listener: Listener) -> list[float]:
    return [message.twist.linear.x for message in listener.messages]


def keeps_open(front: Publisher, mux: Mux) -> bool:
    front.publish(Float32(data=5.0))
    return not mux.is_locked


def test_a_gate_of_commands(partner: Partner, stranger: Partner, tmp_path: Path) -> None:
    commands = partner.publisher(TwistStamped, 'cmd_raw')
    front = partner.publisher(Float32, 'front')
    arrived = Listener(partner, TwistStamped, 'cmd')
    health = Listener(partner, DiagnosticArray, '/diagnostics')
    mux = Mux(partner)

    def status() -> DiagnosticStatus:
        health.found.clear()
        health.wait_for(1)
        return next(item for item in health.messages[-1].status
                    if item.name == 'fret_gate: gate drive')

    def values() -> dict[str, int]:
        return {item.key: int(item.value) for item in status().values}

    with running(write(tmp_path), '-p', 'gates:=drive') as node:
        partner.listen('FRONT')
        node.wait_for("gate 'drive': /cmd_raw -> /cmd, keeps FRONT; otherwise the substitute is "
                      'sent, at 20 Hz')
        assert 'OPEN WHILE AN INPUT IS STALE' not in node.output
        # Closed from the start: substitutes at their rate, with stamp and frame.
        arrived.wait_for(4)
        assert set(speeds(arrived)) == {0.0}
        first = arrived.messages[0].header
        assert first.frame_id == 'base' and abs(first.stamp.sec - time()) < 10.0
        stamps = [item.header.stamp for item in arrived.messages]
        gaps = [later.sec - earlier.sec + (later.nanosec - earlier.nanosec) / 1e9
                for earlier, later in pairwise(stamps)]
        assert 0.02 < median(gaps) < 0.2
        found = status()
        assert found.level == DiagnosticStatus.WARN
        assert found.message == 'closed: no value yet of distance'
        assert mux.is_locked
        assert values()['replaced'] > 0  # a second later
        assert 'violated after the substitute' not in node.output
        # Open: what passes ends the substitutes, and passes once.
        front.publish(Float32(data=5.0))
        sleep(0.2)
        commands.publish(twist(1.5))
        wait_until(lambda: 1.5 in speeds(arrived), 'a command')
        n = len(arrived.found)
        commands.publish(twist(1.25))
        wait_until(lambda: 1.25 in speeds(arrived), 'a command')
        assert speeds(arrived)[n:] == [1.25]
        wait_until(lambda: not mux.is_locked, 'the end of the lock')
        assert partner.heard['FRONT'] == 0
        # A step of another topic violates: a substitute at once, though no command comes.
        front.publish(Float32(data=0.5))
        wait_until(lambda: speeds(arrived)[-1] == 0.0, 'a substitute')
        wait_until(lambda: partner.heard['FRONT'] == 1, 'a violation')
        front.publish(Float32(data=0.5))
        commands.publish(twist(1.75))
        commands.publish(twist(-1.0))
        wait_until(lambda: -1.0 in speeds(arrived), 'a command')
        assert 1.75 not in speeds(arrived)
        node.wait_for("withheld by gate 'drive'")
        line = next(line for line in node.output.splitlines() if 'withheld by' in line)
        assert 'FRONT violated' in line and 'speed = 1.75' in line
        counts = values()
        assert (counts['passed'], counts['withheld, violating']) == (3, 1)
        # The distance is silent: closed, and substitutes without a message of any topic.
        wait_until(lambda: speeds(arrived)[-1] == 0.0, 'a substitute')
        commands.publish(twist(-2.0))
        sleep(0.3)
        assert -2.0 not in speeds(arrived)
        assert 'no message for distance' in status().message
        # Somebody else publishes on the target.
        other = stranger.publisher(TwistStamped, 'cmd')
        node.wait_for('/partner publishes on /cmd too')
        assert status().level == DiagnosticStatus.ERROR
        stranger.node.destroy_publisher(other)
        # kill -9: nothing arrives any more, and the base is locked within the lock's timeout.
        wait_until(lambda: keeps_open(front, mux), 'the end of the lock')
        node.process.send_signal(signal.SIGKILL)
        killed = monotonic()
        node.process.wait(10.0)
        wait_until(lambda: mux.is_locked, 'the lock', 5.0)
        assert monotonic() - killed < Mux.TIMEOUT_S + 2.0  # on a busy machine
        n = len(arrived.found)
        front.publish(Float32(data=5.0))
        commands.publish(twist(3.0))
        sleep(0.5)
        assert len(arrived.found) == n
    # Started again in the middle of the commands: closed until the distance is known.
    with running(write(tmp_path), '-p', 'gates:=drive'):
        arrived.wait_for(n + 2)
        assert set(speeds(arrived)[n:]) == {0.0}
        end = monotonic() + 20.0
        while 3.5 not in speeds(arrived) and monotonic() < end:
            front.publish(Float32(data=5.0))
            commands.publish(twist(3.5))
            sleep(0.05)
        assert 3.5 in speeds(arrived)
        # While the node is not active nothing passes; afterwards it is closed until all has come.
        change = partner.node.create_client(ChangeState, 'fret_gate/change_state')
        assert change_state(change, Transition.TRANSITION_DEACTIVATE)
        sleep(0.2)
        n = len(arrived.found)
        front.publish(Float32(data=5.0))
        commands.publish(twist(4.5))
        sleep(0.3)
        assert len(arrived.found) == n
        assert change_state(change, Transition.TRANSITION_ACTIVATE)
        arrived.wait_for(n + 2)
        assert set(speeds(arrived)[n:]) == {0.0}


def test_gates_of_any_quality_of_service(partner: Partner, tmp_path: Path) -> None:
    # No queue overflows before the gate has a processor again.
    level = partner.publisher(Float32, 'level_raw', QoSProfile(depth=3000))
    images = partner.publisher(Image, 'image_raw')
    notes = partner.publisher(String, 'note_raw', LATCHED)
    free = partner.publisher(Bool, 'free')
    levels = Listener(partner, Float32, 'level')
    pictures = Listener(partner, Image, 'image')
    notes.publish(String(data='early'))
    override = 'qos_overrides./note_raw.subscription.depth'
    with running(write(tmp_path), '-p', 'gates:=[high, low, image, note]',
                 '-p', f'{override}:=20') as node:
        partner.wait_for_subscriptions(1, level, images, notes, free)
        wait_until(lambda: [
            item.qos_profile.reliability
            for item in partner.node.get_subscriptions_info_by_topic('level_mid')] == [
                RELIABLE.reliability], 'the gate behind the other')
        # Two gates in a row, and a flood of 10 kHz: all that both let through, in order.
        began = monotonic()
        for number in range(3000):
            level.publish(Float32(data=number % 4 + number / 4096))
            while monotonic() < began + number / 10000:
                pass
        expected = [1 + number / 4096 for number in range(3000) if number % 4 == 1]
        wait_until(lambda: len(levels.found) >= len(expected), f'{len(expected)} levels')
        sleep(0.2)
        assert [item.data for item in levels.messages] == expected
        # Large messages pass with every byte.
        data = array('B', bytes(range(256)) * 4096)
        for height in (1000, 1001, 999):
            images.publish(Image(height=height, data=data))
            sleep(0.1)
        pictures.wait_for(2)
        assert [item.height for item in pictures.messages] == [1000, 999]
        assert pictures.messages[1].data == data
        # A publisher of best effort comes: the subscription is replaced.
        rough = partner.publisher(Image, 'image_raw', BEST_EFFORT)
        wait_until(lambda: rough.get_subscription_count() > 0, 'a subscription of best effort')
        sleep(0.5)
        for height in range(20):
            rough.publish(Image(height=height))
            sleep(0.02)
        pictures.wait_for(3)
        heights = [item.height for item in pictures.messages[2:]]
        assert heights == sorted(set(heights))
        # Transient local, and a gate that reads nothing of its messages: an interlock.
        free.publish(Bool(data=True))
        sleep(0.3)
        notes.publish(String(data='first'))
        late = Listener(partner, String, 'note', LATCHED)
        late.wait_for(1)
        free.publish(Bool(data=False))
        sleep(0.3)
        notes.publish(String(data='withheld'))
        free.publish(Bool(data=True))
        sleep(0.3)
        notes.publish(String(data='latched'))
        sleep(0.3)
        health = Listener(partner, DiagnosticArray, '/diagnostics')
        wait_until(lambda: 'closed: latched by a violation, until ~/reset' in [
            item.message for array in health.messages for item in array.status], 'the latch')
        assert 'restarted' in partner.reset('fret_gate/reset')
        free.publish(Bool(data=True))
        sleep(0.3)
        notes.publish(String(data='last'))
        late.wait_for(2)
        assert [item.data for item in late.messages] == ['first', 'last']
        assert 'ignored parameter' not in node.output


def test_a_gate_stays_open_while_it_changes_its_durability(
    partner: Partner, tmp_path: Path,
) -> None:
    free = partner.publisher(Bool, 'free')
    notes = partner.publisher(String, 'note_raw')
    latched = partner.publisher(String, 'note_raw', LATCHED)
    arrived = Listener(partner, String, 'note')
    Listener(partner, String, 'note', LATCHED)  # matches no volatile publisher: the gate waits

    def offers() -> list[DurabilityPolicy]:
        return [item.qos_profile.durability
                for item in partner.node.get_publishers_info_by_topic('note')]

    def is_open() -> bool:
        free.publish(Bool(data=True))
        notes.publish(String(data='first'))
        return len(arrived.found) > 0 and offers() == [DurabilityPolicy.TRANSIENT_LOCAL]

    with running(write(tmp_path), '-p', 'gates:=[note]', '-p', 'hot_path:=off') as node:
        wait_until(is_open, 'an open gate')
        begin = len(node.output)
        partner.node.destroy_publisher(latched)
        sent = 0
        while offers() != [DurabilityPolicy.VOLATILE] or sent < 200:
            notes.publish(String(data=str(sent)))
            sent += 1
            sleep(0.005)
        notes.publish(String(data='last'))
        wait_until(lambda: arrived.messages[-1].data == 'last', 'the last note')
        assert [item.data for item in arrived.messages if item.data.isdigit()] == \
            [str(k) for k in range(sent)]
        assert 'is closed' not in node.output[begin:]


TWO = """\
format: 1
evaluation: {policy: relevant_message}
inputs:
  a: {topic: a, type: std_msgs/msg/Float32}
  c: {topic: c, type: std_msgs/msg/Float32}
requirements:
  - {id: A, ptltl: "a < 5.0"}
  - {id: C, ptltl: "c < 5.0", on_violation: [brake, stop, tell, park]}
actions:
  brake: {publish: {topic: braked, type: std_msgs/msg/Float32, message: {}}}
  stop: {lock: {topic: e_stop}}
  tell: {call: {service: halt, type: std_srvs/srv/Trigger}}
  park: {transition: {node: arm, to: inactive}}
gates:
  g: {from: a, to: b, type: std_msgs/msg/Float32, keep: [A], otherwise: drop}
  h: {from: c, to: d, type: std_msgs/msg/Float32, keep: [C], otherwise: drop}
"""


@pytest.fixture(scope='module')
def two_gates(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp('two'), TWO)


@pytest.mark.parametrize(('remappings', 'words'), [
    (('c:=b', 'd:=a'), 'these gates are a circle: /'),
    (('b:=a',), 'these gates are a circle: /a -> /a'),
    (('d:=b',), "the gate 'g' and the gate 'h' both publish on /b"),
    (('braked:=b',), "the gate 'g' and the action 'brake' both publish on /b"),
    (('braked:=e_stop',), "the lock 'stop' and the action 'brake' both publish on /e_stop"),
    (('e_stop:=d',), "the gate 'h' and the lock 'stop' both publish on /d"),
    (('c:=fret_gate/alive',), 'has the types std_msgs/msg/Header and std_msgs/msg/Float32'),
    (('d:=/diagnostics',), "the gate 'h' and the node itself both publish on /diagnostics"),
    (('braked:=copilot/handlerpropC',), "the node itself and the action 'brake' both publish on"),
    (('halt:=fret_gate/reset',), "the action 'tell' calls /fret_gate/reset, a service of this "),
    (('halt:=fret_gate/change_state',), "the action 'tell' calls /fret_gate/change_state, a"),
    (('arm/change_state:=fret_gate/change_state',), "the action 'park' calls /fret_gate/change_")])
def test_remappings_that_lead_gates_together_are_refused(
    partner: Partner, tmp_path: Path, two_gates: Path, remappings: tuple[str, ...], words: str,
) -> None:
    arguments = [word for rule in remappings for word in ('-r', rule)]
    assert words in refusal(
        partner.context, *arguments, kind=GateNode, spec=write(tmp_path, TWO))
    assert words in ExportedNode(
        Path(program_of(two_gates, node=GATE)), *arguments).error()


@pytest.mark.parametrize(('node_type', 'rules', 'words'), [
    (MonitorNode, [('e_stop', 'e_stop')], "the lock 'stop' of 'one' and the lock 'stop' of 'two'"),
    (MonitorNode, [('e_stop', 'halt')], 'both publish on /e_stop; write different'),
    (GateNode, [('e_stop', 'free'), ('to: b', 'to: e'), ('to: d', 'to: f')],
     "the gate 'h' of 'one_h' and the gate 'h' of 'two_h' both publish on /d")])
def test_two_bundles_cannot_share_the_topic_of_a_lock_or_of_a_gate(
    partner: Partner, tmp_path: Path, node_type: type[MonitorNode],
    rules: list[tuple[str, str]], words: str,
) -> None:
    first = TWO if node_type is GateNode else TWO.partition('gates:')[0]
    second = re.sub(r'\b([AC])\b', r'\1_2', first)
    for old, new in rules:
        second = second.replace(old, new)
    paths = [str(write_bundle(tmp_path, text, f'{name}.yaml'))
             for name, text in (('one', first), ('two', second))]
    assert words in refusal(partner.context, '-r', 'halt:=e_stop', '-r', 'f:=d',
                            kind=node_type, spec=paths)


def test_another_publisher_of_a_node_of_the_same_name_is_reported(
    partner: Partner, stranger: Partner, tmp_path: Path,
) -> None:
    spec = Parameter('spec', value=str(write(tmp_path, TWO)))
    node = GateNode(context=partner.context, parameter_overrides=[spec])
    other: GateNode | None = None
    try:
        gates = [session._gate for session in node._sessions]

        def others() -> list[str]:
            return [gate.look().others for gate in gates if gate is not None]

        sleep(1.5)
        assert others() == ['', '']
        own = node.create_publisher(Float32, 'b', 1)
        wait_until(lambda: others() == ['another /fret_gate', ''], 'a publisher of the node')
        node.destroy_publisher(own)
        wait_until(lambda: others() == ['', ''], 'the end of the publisher')
        other = GateNode(context=stranger.context, parameter_overrides=[spec])
        wait_until(lambda: others() == ['another /fret_gate'] * 2, 'the second node')
    finally:
        for item in filter(None, (node, other)):
            item.destroy_node()


SERVICES = ARMED + """\
gates:
  enable:
    service: enable
    to: enable_raw
    type: std_srvs/srv/SetBool
    keep: [ARMED]
    otherwise: {respond: {success: false, message: withheld}}
"""


def test_a_gate_on_a_service(partner: Partner, stranger: Partner, tmp_path: Path) -> None:
    release = Event()
    calls: list[bool] = []

    def serve(request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        calls.append(request.data)
        assert release.wait(20.0)
        response.success, response.message = True, 'done'
        return response

    safe = partner.publisher(Bool, 'safe')
    client = partner.node.create_client(SetBool, 'enable')

    def ask(data: bool) -> Any:
        return client.call_async(SetBool.Request(data=data))

    def answered(future: Any) -> str:
        wait_until(future.done, 'an answer')
        return str(future.result().message)

    with running(write(tmp_path, SERVICES)) as node:
        # Nothing is known of `safe`.
        assert answer_of(client, SetBool.Request(data=True)).message == 'withheld'
        safe.publish(Bool(data=False))
        sleep(0.3)
        assert answered(ask(True)) == 'withheld'
        assert answered(ask(False)) == 'withheld'  # passes, and there is no server
        node.wait_for('no server of /enable_raw answers')
        service = stranger.node.create_service(SetBool, 'enable_raw', serve)
        wait_until(lambda: stranger.node.count_clients('enable_raw') == 1, 'the client')
        waiting = ask(False)  # the server is slow; others are answered meanwhile

        def is_called() -> bool:  # until then the gate has not found the server
            nonlocal waiting
            waiting = ask(False) if waiting.done() else waiting
            return bool(calls)

        wait_until(is_called, 'a call')
        assert answered(ask(True)) == 'withheld'
        assert not waiting.done()
        release.set()
        assert answered(waiting) == 'done'
        safe.publish(Bool(data=True))
        wait_until(lambda: answered(ask(True)) == 'done', 'a request that passes')
        # A server that never answers, and goes while a request waits for it.
        stranger.node.destroy_service(service)
        idle = rclpy.node.Node('idle', context=stranger.context)
        idle.create_service(SetBool, 'enable_raw', serve)
        wait_until(lambda: idle.count_clients('enable_raw') == 1, 'the client')
        lost = ask(True)

        def waits() -> bool:  # until then the gate has not found the server
            nonlocal lost
            lost = ask(True) if lost.done() else lost
            sleep(0.5)
            return not lost.done()

        wait_until(waits, 'a request without an answer')
        idle.destroy_node()
        assert answered(lost) == 'withheld'
        assert calls == [False, True]


def test_the_vehicle_of_the_demo_stops_in_front_of_the_wall(domain: int) -> None:
    program = Path(fret_monitor.__file__).parent.parent / 'examples' / 'wall.py'
    if not program.exists():
        pytest.skip('the examples are elsewhere')
    done = subprocess.run(
        [sys.executable, str(program)], capture_output=True, text=True, check=False, timeout=100,
        env={**environment(), 'ROS_DOMAIN_ID': str(domain)})
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.startswith('without a gate: the vehicle is at the wall, at 1.5 m/s\n')
    assert 'with the gate: the vehicle stands' in done.stdout
