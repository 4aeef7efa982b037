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

"""Lost messages are counted and reported, and no others: of a raw topic, of an engine."""

from pathlib import Path
import signal
from threading import Event
from time import monotonic, sleep

from bundles import NEGATIVE, write_bundle
from fret_monitor.native import evaluator_library, load_evaluator
from fret_monitor.ros.intake.feed import Feed
from fret_monitor.ros.intake.raw_topic import Deliver, RawIntake, RawTopic
import pytest
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from ros.harness import BEST_EFFORT, Partner, RELIABLE, started, wait_until
from ros.operators import Operator
from std_msgs.msg import Int32

SHALLOW = QoSProfile(depth=5, reliability=ReliabilityPolicy.RELIABLE)


def raw_feed(node: Node, topics: dict[str, Deliver], depth: int) -> Feed:
    """Return a feed of raw topics."""
    library, intake = load_evaluator(evaluator_library()), RawIntake()
    intake.prepare(library)
    feed = Feed(node, intake)
    for name, deliver in topics.items():
        feed.subscribe(library, name, 'std_msgs/msg/Int32', Int32, RawTopic(intake, deliver),
                       {'depth': depth})
    return feed


def test_messages_that_wait_on_several_topics_come_in_the_order_of_their_reception(
    partner: Partner,
) -> None:
    got: list[tuple[str, int]] = []

    def keep(name: str) -> Deliver:
        return lambda data, received, sent: got.append(
            (name, deserialize_message(data, Int32).data))

    node = Node('fret_monitor', context=partner.context)
    feed = raw_feed(node, {name: keep(name) for name in 'xyz'}, 1000)
    try:
        publishers = {name: partner.publisher(Int32, name, BEST_EFFORT) for name in 'xyz'}
        partner.wait_for_listener(*publishers.values())
        sent = [('zyxxz'[number % 5], number) for number in range(200)]
        for name, number in sent:
            publishers[name].publish(Int32(data=number))
        sleep(0.2)  # until all wait
        feed.start()
        wait_until(lambda: len(got) == len(sent), 'all messages')
        assert got == sent
    finally:
        feed.close()
        node.destroy_node()


def test_a_subscription_is_replaced_without_repetition(
    partner: Partner, capfd: pytest.CaptureFixture[str],
) -> None:
    got: list[bytes] = []
    node = Node('fret_monitor', context=partner.context)
    feed = raw_feed(node, {'x': lambda data, received, sent: got.append(data)}, 1000)
    feed.start()
    try:
        publisher = partner.publisher(Int32, 'x', RELIABLE)
        end = monotonic() + 4  # longer than the handover
        number = 0
        while monotonic() < end:
            publisher.publish(Int32(data=number))
            number += 1
            sleep(0.005)
    finally:
        feed.close()
        node.destroy_node()
    assert 'subscribed anew to /x' in capfd.readouterr().err
    assert len(got) > number / 2
    assert len(got) == len(set(got))


def test_a_queue_that_overflows_is_reported(
    partner: Partner, capfd: pytest.CaptureFixture[str],
) -> None:
    go, got = Event(), []

    def take(data: bytes, stamp: int, sent: int) -> None:
        got.append(data)
        go.wait()

    node = Node('fret_monitor', context=partner.context)
    feed = raw_feed(node, {'x': take}, 5)
    publishers = [partner.publisher(Int32, 'x', BEST_EFFORT) for _ in range(2)]
    feed.start()
    partner.wait_for_listener(*publishers)
    for number in range(101):
        for publisher in publishers:
            publisher.publish(Int32(data=number))
        wait_until(lambda: bool(got), 'the first one')
    go.set()
    topic, = feed._topics
    wait_until(lambda: len(got) + topic.topic.lost == 202, 'losses of both publishers')
    log: list[str] = []

    def is_logged() -> bool:
        log.append(capfd.readouterr().err)
        return 'messages were lost on /x since the last such message' in ''.join(log)

    wait_until(is_logged, 'a line of the log')
    feed.close()
    node.destroy_node()


@pytest.mark.parametrize('hot_path', ['on', 'off'])
def test_the_messages_that_a_stopped_monitor_missed_are_reported(
    partner: Partner, tmp_path: Path, hot_path: str,
) -> None:
    bundle = write_bundle(tmp_path, NEGATIVE)
    operator = Operator(partner)
    with started('monitor', '-p', f'spec:={bundle}', '-p', f'hot_path:={hot_path}',
                 '-p', 'handler_depth:=3000') as node:
        partner.listen('R')  # more than the usual depth may be violated at once
        n = partner.publisher(Int32, 'n', SHALLOW)
        partner.wait_for_listener(n)
        wait_until(lambda: n.get_subscription_count() == 1, 'the end of the first subscription')
        n.publish(Int32(data=0))
        partner.expect({'R': 1})
        node.process.send_signal(signal.SIGSTOP)
        for number in range(2000):
            n.publish(Int32(data=number))
        node.process.send_signal(signal.SIGCONT)
        operator.wait_for('topic /n', b'\1', 'lost since the last report')
        n.publish(Int32(data=0))
        # On a busy machine it may need more than a report to receive what it did not lose.
        wait_until(lambda: sum(int(operator.status('topic /n')[2][key])
                               for key in ('received', 'lost')) == 2002, 'all messages')
        values = operator.wait_for('topic /n', b'\0', 'received')
        assert int(values['received']) + int(values['lost']) == 2002
        assert int(values['lost']) > 100
        node.wait_for('messages were lost on /n since the last such message')
        partner.expect({'R': int(values['received'])})
