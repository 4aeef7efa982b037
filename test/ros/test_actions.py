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

"""Locks and actions of both nodes over DDS: when they come, what they count, how they fail."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
import signal
from statistics import median
from threading import Event
from time import monotonic, sleep
from typing import Any

from builtin_interfaces.msg import Time
from bundles import write_bundle
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PointStamped
import pytest
from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
from ros.exported import monitoring, NODES, start
from ros.harness import NodeProcess, Partner, RELIABLE, settle, wait_until
from std_msgs.msg import Bool, Float32, Int32
from std_srvs.srv import SetBool, Trigger

LOCKS = """
format: 1
inputs:
  x: {topic: x, type: std_msgs/msg/Float32, timeout: 3.0}
  y: {topic: y, type: std_msgs/msg/Float32, initial: 0}
actions:
  stop: {lock: {topic: e_stop, rate: 2}}
on_violation: [stop]
report: occurrence
requirements:
  - {id: X, ptltl: "H (x < 1.0)"}
  - {id: Y, ptltl: "x < 9.0 & y < 1.0"}
"""
BUNDLE = """
format: 1
inputs:
  n: {topic: n, type: std_msgs/msg/Int32}
actions:
  once: {publish: {topic: once, type: geometry_msgs/msg/PointStamped,
                  message: {header: {frame_id: here}, point: {y: -1.5}}}}
  brake: {publish: {topic: brake, type: std_msgs/msg/Bool, message: {data: true}, rate: 20,
                    for: 0.5}}
  lamp: {publish: {topic: lamp, type: std_msgs/msg/Bool, rate: 20}}
  late: {publish: {topic: late, type: std_msgs/msg/Bool}, after: 0.4}
  rare: {publish: {topic: rare, type: std_msgs/msg/Bool}, cooldown: 60}
  over: {publish: {topic: over, type: std_msgs/msg/Bool}}
  call: {call: {service: call, type: std_srvs/srv/SetBool, request: {data: true}, timeout: 1}}
  slow: {call: {service: slow, type: std_srvs/srv/Trigger, timeout: 0.3, retries: 0}}
  absent: {call: {service: absent, type: std_srvs/srv/Trigger, timeout: 0.2, retries: 1}}
  park: {transition: {node: /arm, to: inactive, retries: 0}}
  shut: {transition: {node: /arm, to: unconfigured, retries: 0}}
  end_arm: {transition: {node: /arm, to: finalized}}
  end_leg: {transition: {node: /leg, to: finalized}}
  end_hand: {transition: {node: /hand, to: finalized}}
evaluation: {policy: relevant_message}
requirements:
  - {id: SENT, ptltl: n != 1, on_violation: [once, brake, lamp, late, rare], on_end: [over]}
  - {id: CALLED, ptltl: n != 2, on_violation: [absent, slow, call, park]}
  - {id: SHUT, ptltl: n != 3, on_violation: [shut]}
  - {id: ENDED, ptltl: n != 4, on_violation: [end_arm, end_leg, end_hand]}
"""


class Log:
    """The messages of a topic, each with the time at which it came."""

    def __init__(self, partner: Partner, kind: Any, topic: str) -> None:
        self.messages: list[tuple[float, Any]] = []
        partner.node.create_subscription(
            kind, topic, lambda message: self.messages.append((monotonic(), message)), RELIABLE)

    def wait_for(self, value: bool, since: float) -> float:
        """Wait for a message with a value that came after a time; return when it came."""
        def found() -> list[float]:
            return [when for when, message in self.messages
                    if when > since and message.data is value]
        wait_until(lambda: bool(found()), f'{value} since {since}')
        return found()[0]


@contextmanager
def to_be_killed(face: str, folder: Path, text: str) -> Iterator[NodeProcess]:
    node = start(face, write_bundle(folder, text))
    try:
        node.wait_for('watching')
        yield node
    finally:
        node.kill()


@pytest.mark.parametrize('face', NODES)
def test_a_lock_follows_its_requirements_and_is_silent_with_its_process(
    tmp_path: Path, partner: Partner, face: str,
) -> None:
    x, y = (partner.publisher(Float32, name) for name in 'xy')
    lock = Log(partner, Bool, 'e_stop')
    diagnostics = Diagnostics(partner, 'lock')
    begin = monotonic()
    with to_be_killed(face, tmp_path, LOCKS) as monitor:
        lock.wait_for(True, begin)  # no message has come
        monitor.wait_for("lock 'stop' on /e_stop, 2 Hz")
        monitor.wait_for("lock 'stop' is locked: no value yet of x")
        diagnostics.wait_for_message('stop', 'locked: no value yet of x')
        partner.wait_for_listener(x, y)
        sleep(1.2)
        assert [message.data for _, message in lock.messages] == [True] * len(lock.messages)
        lasted = monotonic() - lock.messages[0][0]
        assert 2 <= len(lock.messages) <= 2 * lasted + 2  # 2 Hz

        delays = []
        for topic, value, is_locked in (
                (x, 0.0, False), (x, 2.0, True), (x, 0.5, False), (y, 2.0, True), (y, 0.0, False)):
            sleep(0.1)
            now = monotonic()
            topic.publish(Float32(data=value))
            delays.append(lock.wait_for(is_locked, now) - now)
        # At once, and not with the next heartbeat, which comes in 0.4 s; but on a busy machine.
        assert median(delays) < 0.35
        monitor.wait_for("lock 'stop' is free")
        lock.wait_for(True, monotonic())  # x is silent
        diagnostics.wait_for_message('stop', 'locked: no message for x')
        y.publish(Float32(data=2.0))
        diagnostics.wait_for_message('stop', 'locked: violated: Y; no message for x')
        y.publish(Float32(data=0.0))
        now = monotonic()
        x.publish(Float32(data=0.0))
        lock.wait_for(False, now)

        monitor.process.send_signal(signal.SIGSTOP)
        sleep(0.2)
        count = len(lock.messages)
        sleep(1.2)
        assert len(lock.messages) == count
        monitor.process.send_signal(signal.SIGCONT)
        wait_until(lambda: len(lock.messages) > count, 'the lock of the process that goes on')
        monitor.process.kill()
        sleep(0.2)
        count = len(lock.messages)
        sleep(1.2)
        assert len(lock.messages) == count


class Arm(LifecycleNode):
    """A lifecycle node that can be configured, but refuses to clean up."""

    def on_cleanup(self, state: Any) -> TransitionCallbackReturn:
        return TransitionCallbackReturn.FAILURE


class Diagnostics:
    """The last status of each action, or of each lock."""

    def __init__(self, partner: Partner, kind: str = 'action') -> None:
        self.of: dict[str, tuple[int, dict[str, str]]] = {}
        self.messages: dict[str, str] = {}
        self._kind = kind
        partner.node.create_subscription(DiagnosticArray, '/diagnostics', self._take, RELIABLE)

    def _take(self, message: DiagnosticArray) -> None:
        for status in message.status:
            name = status.name.partition(f': {self._kind} ')[2]
            if name:
                self.messages[name] = status.message
                values = {item.key: item.value for item in status.values}
                self.of[name] = ord(status.level), values

    def wait_for_message(self, name: str, message: str) -> None:
        wait_until(lambda: self.messages.get(name) == message,
                   f'{message}, and not {self.messages.get(name)}')

    def wait_for(self, name: str, **values: int) -> None:
        wanted = {key: str(value) for key, value in values.items()}
        wait_until(lambda: wanted.items() <= self.of.get(name, (0, {}))[1].items(),
                   f'{name}: {wanted}, and not {self.of.get(name)}')


@pytest.mark.parametrize('face', NODES)
def test_actions_follow_violations_and_are_counted(
    tmp_path: Path, partner: Partner, face: str,
) -> None:
    n = partner.publisher(Int32, 'n')
    kinds: dict[str, Any] = dict.fromkeys(('brake', 'lamp', 'late', 'rare', 'over'), Bool)
    kinds['once'] = PointStamped
    logs = {name: Log(partner, kind, name) for name, kind in kinds.items()}
    requests: list[bool] = []
    is_over = Event()

    def answer(request: Any, response: Any) -> Any:
        requests.append(request.data)
        response.success = len(requests) > 2
        return response

    def answer_late(request: Any, response: Any) -> Any:
        is_over.wait(30)
        return response

    partner.node.create_service(SetBool, 'call', answer)
    limbs = [Arm(name, context=partner.context) for name in ('arm', 'leg', 'hand')]
    arm, _, hand = limbs
    hand.trigger_configure()
    hand.trigger_activate()
    other = Partner(partner.context.get_domain_id())
    other.node.create_service(Trigger, 'slow', answer_late)
    for limb in limbs:
        partner._executor.add_node(limb)
    diagnostics = Diagnostics(partner)
    try:
        with monitoring(face, write_bundle(tmp_path, BUNDLE)) as monitor:
            monitor.wait_for("action 'call' calls /call; action 'slow' calls /slow")
            monitor.wait_for("action 'park' brings /arm to inactive")
            partner.wait_for_listener(n)
            wait_until(lambda: all(partner.node.count_publishers(name) for name in kinds),
                       'publishers of the actions')

            def publish(*values: int) -> None:
                for value in values:
                    n.publish(Int32(data=value))

            publish(0, 1, 0)  # too short for `late`, and `lamp` is over again
            wait_until(lambda: bool(logs['over'].messages), 'the end of the violation')
            wait_until(lambda: len(logs['brake'].messages) == 10, 'the brake, for 0.5 s')
            settle(0.4)
            counts = {name: len(log.messages) for name, log in logs.items()}
            assert counts == {'once': 1, 'brake': 10, 'lamp': counts['lamp'], 'late': 0,
                              'rare': 1, 'over': 1}
            begin, message = logs['once'].messages[0]
            # At 20 Hz, as long as it is violated
            assert (counts['lamp'] - 1) / 20 <= logs['over'].messages[0][0] - begin + 0.05
            assert (message.header.frame_id, message.point.y) == ('here', -1.5)
            assert message.header.stamp != Time()

            publish(1)
            # At its rate, as long as it is violated
            wait_until(lambda: len(logs['lamp'].messages) >= 16, 'lamps')
            wait_until(lambda: len(logs['late'].messages) == 1, 'what comes 0.4 s later')
            assert len(logs['rare'].messages) == 1  # within the cooldown
            publish(0)
            wait_until(lambda: len(logs['over'].messages) == 2, 'the end of the violation')
            settle(0.2)
            count = len(logs['lamp'].messages)
            sleep(0.3)
            assert len(logs['lamp'].messages) == count
            diagnostics.wait_for('rare', started=1, sent=1, skipped=1, failed=0)

            begin = monotonic()
            publish(2)
            wait_until(lambda: len(requests) == 3, 'three calls')
            assert monotonic() - begin < 20  # the other, which hangs for 30 s, delays nothing
            assert requests == [True] * 3
            diagnostics.wait_for('call', started=1, sent=1, failed=0)
            diagnostics.wait_for('slow', started=1, sent=0, failed=1)
            diagnostics.wait_for('absent', started=1, sent=0, failed=1)
            diagnostics.wait_for('park', started=1, sent=1, failed=0)
            assert arm._state_machine.current_state[1] == 'inactive'
            publish(3)
            diagnostics.wait_for('shut', started=1, sent=0, failed=1)
            for line in ("the action 'slow' failed: /slow has not answered in 0.3 s",
                         "the action 'absent' failed 2 times: no server of /absent in 0.2 s",
                         "the action 'shut' failed: /arm refused to leave the state inactive"):
                monitor.wait_for(line)
            assert [limb._state_machine.current_state[1] for limb in limbs] == [
                'inactive', 'unconfigured', 'active']
            publish(4)
            for limb in limbs:
                diagnostics.wait_for(f'end_{limb.get_name()}', started=1, sent=1, failed=0)
                assert limb._state_machine.current_state[1] == 'finalized'
    finally:
        is_over.set()
        for limb in limbs:
            partner._executor.remove_node(limb)
            limb.destroy_node()
        other.close()


SHARED = """
format: 1
inputs:
  x: {topic: x, type: std_msgs/msg/Float32, timeout: 1}
actions:
  stop: {lock: {topic: e_stop}}
  brake: {publish: {topic: braked, type: std_msgs/msg/Bool}}
  call: {call: {service: call, type: std_srvs/srv/Trigger}}
report: occurrence
requirements:
  - {id: X, ptltl: "H (x < 1.0)", on_violation: [stop, brake, call]}
"""


@pytest.mark.parametrize(('remapping', 'reason'), [
    ('braked:=e_stop', "the lock 'stop' and the action 'brake' both publish on /e_stop"),
    ('e_stop:=fret_monitor/alive', "the node itself and the lock 'stop' both publish on"),
    ('call:=fret_monitor/reset', "the action 'call' calls /fret_monitor/reset, a service of")])
@pytest.mark.parametrize('face', NODES)
def test_names_that_only_one_part_may_use_are_refused(
    tmp_path: Path, partner: Partner, face: str, remapping: str, reason: str,
) -> None:
    assert reason in start(face, write_bundle(tmp_path, SHARED), '-r', remapping).error()
