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

"""The feed over real DDS: which publishers it receives, in which order, and how often."""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
import random
from tempfile import TemporaryDirectory
from threading import Thread
from time import monotonic, sleep
from typing import Any

from fret_monitor import build
from fret_monitor.native import evaluator_library, load_evaluator, Monitor
from fret_monitor.ros.intake import feed
from fret_monitor.ros.intake.feed import Feed
from fret_monitor.ros.intake.graph_wait import GraphWait
from fret_monitor.ros.intake.hot_path import EngineTopic, Middleware
from fret_monitor.ros.intake.raw_topic import RawIntake, RawTopic
from fret_monitor.ros.intake.rcl_endpoint import RclSubscription
from fret_monitor.ros.intake.symbols import Unavailable
from fret_monitor.runtime import Engine, Evaluator
import pytest
from rclpy.context import Context
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from ros.harness import BEST_EFFORT, LATCHED, Partner, RELIABLE, wait_until
from runtime.message_ring import MessageRing
from std_msgs.msg import Float32, Int32

LATCHED_BEST_EFFORT = QoSProfile(
    depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT,
    durability=DurabilityPolicy.TRANSIENT_LOCAL)


@cache
def monitor() -> Monitor:
    bundle = '\n'.join([
        'format: 1', 'inputs:',
        *(f'  {name}: {{topic: {name}, type: std_msgs/msg/Int32}}' for name in 'xyz'),
        'requirements: [{id: R, ptltl: x < 0}]'])
    with TemporaryDirectory() as folder:
        path = Path(folder) / 'bundle.yaml'
        path.write_text(bundle, encoding='utf-8')
        return build.build(path).monitor


class Listener:
    """A node with a feed, and an engine whose messages a thread takes and a ring keeps."""

    def __init__(self, context: Context, topics: str, fixed: dict[str, str | int]) -> None:
        self.node = Node('fret_monitor', context=context)
        self.feed = Feed(self.node)
        self._engine = Engine(Evaluator(monitor(), reports_recoveries=True))
        self._ring = MessageRing(self._engine.library, 1 << 20, 60)
        self._ring.keep_messages_of(self._engine)
        self._engine.follow_steady()
        self._engine.begin()
        self._thread = Thread(target=self._take)
        middleware = Middleware(may_take=False)
        for name in topics:
            self.feed.subscribe(
                self._engine.library, name, 'std_msgs/msg/Int32', Int32, EngineTopic(
                    self._engine, middleware, 'xyz'.index(name)), fixed)
        self._thread.start()

    def _take(self) -> None:
        engine = self._engine
        while not engine.library.fm_engine_is_closed(engine.pointer):
            self._engine.take(100)

    def close(self) -> None:
        self.feed.close()
        self._engine.close()
        self._thread.join()
        self.node.destroy_node()

    @property
    def got(self) -> list[tuple[str, int]]:
        """Return the topics and numbers of all messages that were delivered, in order."""
        return [('xyz'[message.topic], deserialize_message(message.data, Int32).data)
                for _, message in self._ring.read(0)]

    def numbers(self, publisher: int) -> list[int]:
        """Return the numbers of one publisher; each counts in a thousand of its own."""
        return [number for _, number in self.got if number // 1000 == publisher]


@contextmanager
def listening(partner: Partner, topics: str = 'x', fixed: dict[str, str | int] | None = None,
              is_started: bool = True) -> Iterator[Listener]:
    listener = Listener(partner.context, topics, fixed or {})
    try:
        if is_started:
            listener.feed.start()
        yield listener
        assert listener.feed.failure is None
    finally:
        listener.close()


def send(publishers: list[Publisher], begin: int = 0, end: int = 30, pause: float = 0.01) -> None:
    for number in range(begin, end):
        for place, publisher in enumerate(publishers):
            publisher.publish(Int32(data=1000 * place + number))
        sleep(pause)


def logged(capfd: pytest.CaptureFixture[str], words: str) -> str:
    """Wait until these words are logged; return all that was logged until then."""
    told = ''

    def is_told() -> bool:
        nonlocal told
        told += capfd.readouterr().err
        return words in told

    wait_until(is_told, words)
    return told


@pytest.mark.parametrize('offer', [RELIABLE, BEST_EFFORT, LATCHED, LATCHED_BEST_EFFORT],
                         ids=['reliable', 'best effort', 'latched', 'latched best effort'])
@pytest.mark.parametrize('is_late', [False, True], ids=['early', 'late'])
def test_each_message_is_received_once_whatever_qos_its_publisher_offers(
    partner: Partner, offer: QoSProfile, is_late: bool,
) -> None:
    if is_late:
        with listening(partner) as listener:
            sleep(0.5)
            publisher = partner.publisher(Int32, 'x', offer)
            partner.wait_for_listener(publisher)
            send([publisher])
            wait_until(lambda: len(listener.got) >= 30, 'thirty messages')
            sleep(0.3)
            assert listener.numbers(0) == list(range(30))
    else:
        publisher = partner.publisher(Int32, 'x', offer)
        with listening(partner) as listener:
            partner.wait_for_listener(publisher)
            send([publisher])
            wait_until(lambda: len(listener.got) >= 30, 'thirty messages')
            sleep(0.3)
            assert listener.numbers(0) == list(range(30))


def test_no_message_is_lost_or_stepped_twice_when_the_subscription_is_replaced(
    partner: Partner,
) -> None:
    first = partner.publisher(Int32, 'x', RELIABLE)
    with listening(partner) as listener:
        partner.wait_for_listener(first)
        send([first], 0, 10)
        second = partner.publisher(Int32, 'x', BEST_EFFORT)
        end = 10
        while not listener.numbers(1) or end < 300:
            send([first, second], end, end + 1)
            end += 1
            assert end < 900, 'the second publisher is not found'
        send([first, second], end, end + 50)
        wait_until(lambda: len(listener.numbers(0)) >= end + 50, 'all of the first publisher')
        sleep(0.3)
        heard = listener.numbers(1)
        assert listener.numbers(0) == list(range(end + 50))
        # The second publisher is received from its discovery on, without a gap.
        assert heard == list(range(heard[0], 1000 + end + 50))


def test_the_history_of_a_latched_publisher_is_received_once(partner: Partner) -> None:
    publisher = partner.publisher(Int32, 'x', LATCHED)
    send([publisher], 0, 5)
    with listening(partner) as listener:
        wait_until(lambda: len(listener.got) >= 5, 'what was said before')
        send([publisher], 5, 10)
        wait_until(lambda: len(listener.got) >= 10, 'what is said now')
        sleep(2.5)  # until the old subscription is gone
        assert listener.numbers(0) == list(range(10))


def test_the_history_of_a_latched_publisher_does_not_come_after_its_new_messages(
    partner: Partner,
) -> None:
    publisher = partner.publisher(Int32, 'x', LATCHED)
    send([publisher], 0, 5)
    with listening(partner, is_started=False) as listener:
        wait_until(lambda: publisher.get_subscription_count() > 0, 'a match')
        sleep(0.3)
        send([publisher], 5, 6)
        sleep(0.2)
        # 5 is received; then the subscription is replaced, and the new one gets the history too.
        listener.feed.start()
        wait_until(lambda: bool(listener.got), 'the first one')
        sleep(0.5)
        send([publisher], 6, 10)
        wait_until(lambda: bool(listener.got) and listener.got[-1][1] == 9, 'the last one')
        assert listener.numbers(0) == [5, 6, 7, 8, 9]


def test_a_latched_and_a_best_effort_publisher_are_both_received(partner: Partner) -> None:
    publishers = [partner.publisher(Int32, 'x', offer) for offer in (LATCHED, BEST_EFFORT)]
    with listening(partner) as listener:
        wait_until(lambda: publishers[0].get_subscription_count() > 0
                   and publishers[1].get_subscription_count() > 0, 'both matched')
        sleep(0.5)
        send(publishers)
        wait_until(lambda: len(listener.got) >= 60, 'sixty messages')
        assert [listener.numbers(place) for place in (0, 1)] == [
            list(range(30)), list(range(1000, 1030))]


def test_messages_of_several_topics_come_in_the_order_in_which_they_were_sent(
    partner: Partner,
) -> None:
    publishers = {topic: partner.publisher(Int32, topic) for topic in 'xyz'}
    chance = random.Random(1)
    with listening(partner, 'xyz') as listener:
        partner.wait_for_listener(*publishers.values())
        sent = [(chance.choice('xyz'), number) for number in range(3000)]
        for topic, number in sent:
            publishers[topic].publish(Int32(data=number))
            if number % 10 == 0:
                sleep(0.002)
        wait_until(lambda: len(listener.got) >= len(sent), 'all messages')
        assert listener.got == sent


def test_a_qos_profile_of_the_bundle_stays_and_incompatible_publishers_are_reported(
    partner: Partner, capfd: pytest.CaptureFixture[str],
) -> None:
    best_effort, reliable = (partner.publisher(Int32, 'x', offer)
                             for offer in (BEST_EFFORT, RELIABLE))
    with listening(partner, fixed={'reliability': 'reliable'}) as listener:
        partner.wait_for_listener(reliable)
        told = logged(capfd, 'does not match the subscription to /x')
        send([best_effort, reliable])
        wait_until(lambda: len(listener.got) >= 30, 'the reliable ones')
        sleep(0.3)
        assert (listener.numbers(0), listener.numbers(1)) == ([], list(range(1000, 1030)))
    told += capfd.readouterr().err
    assert told.count('/partner does not match the subscription to /x: it offers best effort, '
                      'volatile') == 1
    assert 'requests reliable, volatile, by `qos` or `qos_overrides`: leave `reliability` out ' \
        'there\n' in told


def test_a_publisher_of_another_type_is_reported_once_with_both_types(
    partner: Partner, stranger: Partner, capfd: pytest.CaptureFixture[str],
) -> None:
    publisher = partner.publisher(Int32, 'x')
    with listening(partner) as listener:
        partner.wait_for_listener(publisher)
        # A process cannot use two types on one topic, not even in two contexts of rclpy.
        other = stranger.publisher(Float32, 'x')
        told = logged(capfd, 'publishes std_msgs/msg/Float32 on /x')
        other.publish(Float32(data=1.0))
        send([publisher], 0, 3)
        wait_until(lambda: len(listener.got) == 3, 'three messages')
    told += capfd.readouterr().err
    assert told.count('publishes std_msgs/msg/Float32 on /x, where the bundle says '
                      'std_msgs/msg/Int32') == 1


@pytest.mark.parametrize('what', ['the subscription', 'its receiver'])
def test_a_subscription_that_cannot_be_replaced_goes_on_until_it_is(
    what: str, partner: Partner, monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    now, fails = 1000 * 10**9, True

    def failing(real: Any) -> Any:
        def attempt(*arguments: Any) -> Any:
            if fails:
                raise Unavailable('no room')
            return real(*arguments)
        return attempt

    with listening(partner, is_started=False) as listener:
        topic, = listener.feed._topics
        topic.open()
        monkeypatch.setattr(feed, 'monotonic_ns', lambda: now)
        if what == 'the subscription':
            monkeypatch.setattr(feed, 'RclSubscription', failing(RclSubscription))
        else:
            monkeypatch.setattr(EngineTopic, 'open', failing(EngineTopic.open))
        reliable = partner.publisher(Int32, 'x')
        wait_until(lambda: listener.node.count_publishers('x') == 1, 'the publisher')
        for _ in range(8):
            topic.review()
            now += 10**9
        send([reliable], 0, 1)
        wait_until(lambda: listener.numbers(0) == [0], 'a message')
        assert capfd.readouterr().err.count(
            'cannot subscribe anew to /x (reliable, volatile): no room; the subscription before '
            'is kept, and there are further attempts') == 1
        fails = False
        for _ in range(16):
            topic.review()
            now += 10**9
        assert 'subscribed anew to /x (reliable, volatile)' in capfd.readouterr().err
        assert not topic._retired
        send([reliable], 1, 2)
        wait_until(lambda: listener.numbers(0) == [0, 1], 'a message of the new one')


def test_publishers_are_looked_for_only_when_the_graph_changes(
    partner: Partner, monkeypatch: pytest.MonkeyPatch,
) -> None:
    looks: list[float] = []
    with listening(partner) as listener:
        find = listener.node.get_publishers_info_by_topic

        def look(topic: str) -> Any:
            looks.append(monotonic())
            return find(topic)

        monkeypatch.setattr(listener.node, 'get_publishers_info_by_topic', look)
        partner.publisher(Int32, 'x')
        wait_until(lambda: looks != [] and monotonic() - looks[-1] > 2.0, 'a graph at rest')
        partner.publisher(Int32, 'other')
        before = len(looks)
        wait_until(lambda: len(looks) > before, 'a look')


def test_a_change_of_the_graph_ends_each_wait_of_a_context(partner: Partner) -> None:
    one, two = (GraphWait(Node(name, context=partner.context)) for name in ('one', 'two'))
    while one.wait(1.0) or two.wait(0.1):
        pass
    partner.publisher(Int32, 'x')
    wait_until(lambda: one.wait(0.1), 'a change')
    assert two.wait(0.0)
    assert not two.wait(0.0)
    for each in (one, two):
        each.close()
        each._node.destroy_node()


def test_a_change_of_the_graph_may_be_left_to_the_next_wait(partner: Partner) -> None:
    wait = GraphWait(Node('waiting', context=partner.context))
    while wait.wait(1.0):
        pass
    partner.publisher(Int32, 'x')
    wait_until(lambda: wait._node.count_publishers('x') == 1, 'the publisher')
    assert not wait.wait(0.1, for_change=False)
    assert wait.wait(5.0)
    wait.close()
    wait._node.destroy_node()


def test_a_graph_that_keeps_changing_wakes_the_feed_a_few_times_a_second(
        partner: Partner) -> None:
    with listening(partner) as listener:
        wait_until(lambda: listener.feed.turns > 1, 'the feed')
        before, began = listener.feed.turns, monotonic()
        for number in range(150):
            partner.node.destroy_publisher(partner.publisher(Int32, f'other_{number}'))
            sleep(0.01)
        assert listener.feed.turns - before < 20 + 12 * (monotonic() - began)


def test_an_error_in_a_callback_stops_the_feed_and_is_kept(partner: Partner) -> None:
    def fail(data: bytes, stamp: int, sent: int) -> None:
        raise RuntimeError('oh')

    node: Any = Node('fret_monitor', context=partner.context)
    library, intake = load_evaluator(evaluator_library()), RawIntake()
    intake.prepare(library)
    failing = Feed(node, intake)
    failing.subscribe(
        library, 'x', 'std_msgs/msg/Int32', Int32, RawTopic(intake, fail), {})
    publisher = partner.publisher(Int32, 'x')
    failing.start()
    partner.wait_for_listener(publisher)
    publisher.publish(Int32(data=1))
    wait_until(lambda: failing.failure is not None, 'the failure')
    failing.close()
    node.destroy_node()
    assert str(failing.failure) == 'oh'


def test_a_latched_message_older_than_those_of_another_publisher_is_received(
    partner: Partner,
) -> None:
    depth_of_one = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE,
                              durability=DurabilityPolicy.TRANSIENT_LOCAL)
    lively = partner.publisher(Int32, 'x', depth_of_one)
    numbers = iter(range(1000))
    timer = partner.node.create_timer(0.01, lambda: lively.publish(Int32(data=next(numbers))))
    with listening(partner, fixed={'durability': 'volatile'}) as before:
        wait_until(lambda: len(before.numbers(0)) > 10, 'the lively one')
        quiet = partner.publisher(Int32, 'x', depth_of_one)
        quiet.publish(Int32(data=1000))
        with listening(partner) as listener:
            wait_until(lambda: listener.numbers(1) == [1000] and len(listener.numbers(0)) > 50,
                       'both')
            assert len({*listener.got}) == len(listener.got)
    timer.cancel()
