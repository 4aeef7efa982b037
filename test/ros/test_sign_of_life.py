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

"""The sign of life ends when the monitor ends, is stopped, or one of its threads hangs."""

from pathlib import Path
import signal
from typing import Any

from fret_monitor.ros.sign_of_life import SignOfLife
from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import LivelinessPolicy, QoSProfile
from ros.harness import Partner, RELIABLE, started, wait_until
from std_msgs.msg import Header

BUNDLE = """
format: 1
inputs:
  x: {topic: x, type: std_msgs/msg/Float32}
requirements:
  - {id: R, ptltl: "x < 0.5"}
"""
WATCHING = QoSProfile(depth=10, liveliness=LivelinessPolicy.MANUAL_BY_TOPIC,
                      liveliness_lease_duration=Duration(seconds=3))


def test_a_monitor_that_is_stopped_is_not_alive(partner: Partner, tmp_path: Path) -> None:
    bundle = tmp_path / 'bundle.yaml'
    bundle.write_text(BUNDLE, encoding='utf-8')
    heard: list[Header] = []
    alive: list[int] = []

    def note(event: Any) -> None:
        alive.append(event.alive_count)

    partner.node.create_subscription(
        Header, '/robot/guard/alive', heard.append, WATCHING,
        event_callbacks=SubscriptionEventCallbacks(liveliness=note))
    with started('monitor', '-p', f'spec:={bundle}', '-r', '__ns:=/robot',
                 '-r', '__node:=guard') as node:
        before = partner.node.get_clock().now().nanoseconds / 1e9
        wait_until(lambda: len(heard) > 2, 'signs of life')
        assert heard[-1].frame_id == 'guard'
        assert -1.0 < heard[-1].stamp.sec - before < 20.0
        assert alive[-1] == 1
        node.process.send_signal(signal.SIGSTOP)
        wait_until(lambda: alive[-1] == 0, 'the end of the lease')
        node.process.send_signal(signal.SIGCONT)
        wait_until(lambda: alive[-1] == 1, 'a sign of life')
        assert 'hangs' not in node.output


def test_there_is_no_sign_of_life_while_a_thread_hangs(partner: Partner) -> None:
    node: Any = Node('guard', context=partner.context)
    turns = {'announcer': 0, 'feed': 0}
    heard: list[Header] = []
    partner.node.create_subscription(Header, '/guard/alive', heard.append, RELIABLE)
    life = SignOfLife(node, [lambda: (turns['announcer'], turns['feed'])])

    def is_heard_after(number: int) -> bool:
        turns.update({name: turn + 1 for name, turn in turns.items()})
        life.beat()
        partner.expect({})
        return len(heard) > number

    wait_until(lambda: is_heard_after(0), 'a sign of life')
    known = len(heard)
    for name in ('feed', 'announcer'):
        turns[name] += 1
        life.beat()  # the other thread has not turned
    partner.expect({})
    assert len(heard) == known
    assert is_heard_after(known)
    life.close()
    node.destroy_node()
