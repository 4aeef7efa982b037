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

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event
from time import monotonic, sleep
from typing import Any

from geometry_msgs.msg import TwistStamped
import rclpy.node
from rclpy.qos import QoSProfile
from ros.harness import NodeProcess, Partner, RELIABLE, started, wait_until
from std_msgs.msg import Bool, Float32
from std_srvs.srv import SetBool

BUNDLE = """\
format: 1
evaluation: {policy: relevant_message}
inputs:
  speed: {topic: cmd_raw, type: geometry_msgs/msg/TwistStamped, field: twist.linear.x}
  distance: {topic: front, type: std_msgs/msg/Float32, timeout: 0.6}
  limit: {topic: speed_raw, type: std_msgs/msg/Float32}
  free: {topic: free, type: std_msgs/msg/Bool}
requirements:
  - {id: FRONT, ptltl: "H (distance < 1.0 -> speed <= 0.0)", report: occurrence}
  - {id: LIMIT, ptltl: "H (limit <= 2.0)", report: occurrence}
  - {id: FREE, ptltl: "free"}
gates:
  drive:
    from: cmd_raw
    to: cmd
    type: geometry_msgs/msg/TwistStamped
    keep: [FRONT]
    otherwise: {substitute: {header: {frame_id: base}, twist: {linear: {x: 0.0}}}, rate: 20}
  speed: {from: speed_raw, to: speed, type: std_msgs/msg/Float32, keep: [LIMIT], otherwise: drop}
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


def write(folder: Path, text: str = BUNDLE) -> Path:
    path = folder / 'gates.yaml'
    path.write_text(text, encoding='utf-8')
    return path


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


def test_a_gate_withholds_and_substitutes(partner: Partner, tmp_path: Path) -> None:
    commands = partner.publisher(TwistStamped, 'cmd_raw')
    front = partner.publisher(Float32, 'front')
    arrived = Listener(partner, TwistStamped, 'cmd')
    with running(write(tmp_path)) as node:
        partner.listen('FRONT')
        node.wait_for('keeps FRONT')
        # Closed from the start: substitutes at their rate, with stamp and frame.
        arrived.wait_for(3)
        assert set(speeds(arrived)) == {0.0}
        first = arrived.messages[0].header
        assert first.frame_id == 'base' and first.stamp.sec > 1e9
        front.publish(Float32(data=5.0))
        sleep(0.2)
        commands.publish(twist(1.5))
        wait_until(lambda: 1.5 in speeds(arrived), 'a command')
        n = len(arrived.found)
        commands.publish(twist(1.25))
        wait_until(lambda: 1.25 in speeds(arrived), 'a command')
        assert speeds(arrived)[n:] == [1.25]
        front.publish(Float32(data=0.5))
        wait_until(lambda: speeds(arrived)[-1] == 0.0, 'a substitute')
        commands.publish(twist(1.75))
        sleep(0.3)
        assert 1.75 not in speeds(arrived)


SERVICES = """\
format: 1
evaluation: {policy: every_message}
inputs:
  data: {topic: enable/_service_event, type: std_srvs/srv/SetBool_Event, field: "request[0].data"}
  safe: {topic: safe, type: std_msgs/msg/Bool}
requirements:
  - {id: ARMED, ptltl: "data -> safe"}
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
        assert client.wait_for_service(20.0)
        assert answered(ask(True)) == 'withheld'  # nothing is known of `safe`
        safe.publish(Bool(data=False))
        sleep(0.3)
        assert answered(ask(True)) == 'withheld'
        assert answered(ask(False)) == 'withheld'  # passes, and there is no server
        node.wait_for('no server of /enable_raw answers')
        service = stranger.node.create_service(SetBool, 'enable_raw', serve)
        wait_until(lambda: stranger.node.count_clients('enable_raw') == 1, 'the client')
        sleep(0.5)
        waiting = ask(False)  # the server is slow; others are answered meanwhile
        wait_until(lambda: bool(calls), 'a call')
        assert answered(ask(True)) == 'withheld'
        assert not waiting.done()
        release.set()
        assert answered(waiting) == 'done'
        safe.publish(Bool(data=True))
        sleep(0.3)
        assert answered(ask(True)) == 'done'
        # A server that never answers, and goes while a request waits for it.
        stranger.node.destroy_service(service)
        idle = rclpy.node.Node('idle', context=stranger.context)
        idle.create_service(SetBool, 'enable_raw', serve)
        wait_until(lambda: idle.count_clients('enable_raw') == 1, 'the client')
        sleep(0.5)
        lost = ask(True)
        sleep(0.5)
        assert not lost.done()
        idle.destroy_node()
        assert answered(lost) == 'withheld'
        assert calls == [False, True]
