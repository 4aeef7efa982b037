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

"""The decisions of a subscription, on a clock that the test sets: when and how it is replaced."""

from collections.abc import Sequence
from functools import cache
from itertools import product
import random
from typing import Any

from fret_monitor.native import evaluator_library, load_evaluator
from fret_monitor.runtime.reporting import LogLevel, TopicFacts
from fret_monitor.runtime.subscription import (
    Decision, DEFAULT_DEPTH, Offer, Request, SubscriptionState,
)
import pytest

TYPE, OTHER = 'std_msgs/msg/Int32', 'std_msgs/msg/Float32'
KINDS = list(product((True, False), (True, False)))  # reliable; transient local
NAMES = {(True, True): 'reliable, transient local', (True, False): 'reliable, volatile',
         (False, True): 'best effort, transient local', (False, False): 'best effort, volatile'}
UNNAMED = '_NODE_NAME_UNKNOWN_'


@cache
def library() -> Any:
    return load_evaluator(evaluator_library())


def offer(place: int, is_reliable: bool = True, is_durable: bool = False, *, node: str = 'cam',
          namespace: str = '/', message_type: str = TYPE) -> Offer:
    return Offer(
        place.to_bytes(16), node, namespace, message_type, is_reliable, is_durable)


def kind(request: Request | None) -> tuple[bool, bool]:
    assert request is not None
    return request.is_reliable, request.is_durable


class Topic:
    """The topic /x of a node that does what is decided, and what it has logged."""

    def __init__(self, **fixed: str | int) -> None:
        self.state = SubscriptionState(library(), '/x', TYPE, fixed)
        self.offers: list[Offer] = []
        self.now = 1000.0
        self.seen: list[Offer] = []  # at the last review
        self.matched = 0
        self.lost = 0
        self.problem: str | None = None
        self.attempts = 0
        self.replaced: list[float] = []
        self.repeats = 0  # handovers that began since the last one ended
        self.log: list[str] = []

    def review(self, *offers: Offer, seconds: float = 0.0) -> Decision:
        """Review after a time; with `offers`, these are the publishers from now on."""
        self.now += seconds
        self.offers = list(offers) or self.offers
        is_settled = self.state.is_settled(self.lost) and self.seen == self.offers
        self.seen = [*self.offers]
        n_lines, now = len(self.log), round(self.now * 1e9)
        found = self.state.decide(self.offers, self.matched, now)
        del self.replaced[:found.n_ended]
        self.repeats = 0 if found.ends_handover else self.repeats
        if found.request is not None:
            self.attempts += 1
            self.repeats += 1
            if self.problem is None:
                self.replaced.append(self.now)
        problem = None if found.request is None else self.problem
        self.log += [f'{line.level.name} {line.text}'
                     for line in self.state.conclude(problem, self.lost, now)]
        if is_settled:
            assert (found.n_ended, found.ends_handover, found.request) == (0, False, None)
            assert len(self.log) == n_lines
        return found

    def review_for(self, seconds: float) -> int:
        """Review four times a second, as nodes do; return the attempts to subscribe."""
        before = self.attempts
        for _ in range(int(4 * seconds)):
            self.review(seconds=0.25)
        return self.attempts - before

    def unmatched(self) -> str:
        return self.state.publishers.unmatched

    def lines(self) -> list[str]:
        found, self.log = self.log, []
        return found


def test_without_a_publisher_the_subscription_requests_the_least() -> None:
    assert Topic().state.request == Request(False, False, False, DEFAULT_DEPTH)


@pytest.mark.parametrize('kinds', list(product(KINDS, KINDS)))
def test_every_publisher_is_received_with_the_best_qos_that_all_offer(
    kinds: Sequence[tuple[bool, bool]],
) -> None:
    topic = Topic()
    topic.review(*(offer(place, *each) for place, each in enumerate(kinds)))
    assert kind(topic.state.request) == (
        all(reliable for reliable, _ in kinds), all(durable for _, durable in kinds))
    assert topic.state.publishers == TopicFacts(2)


def test_publishers_do_not_change_what_is_fixed() -> None:
    topic = Topic(reliability='best_effort', durability='volatile', depth=3, history='keep_all')
    assert topic.review(offer(1, True, True)) == Decision(0, False, None)
    assert topic.state.request == Request(False, False, True, 3)
    assert Topic(reliability='reliable').state.request.is_reliable
    assert Topic(durability='transient_local').state.request.is_durable


def test_publishers_of_another_type_do_not_decide() -> None:
    topic = Topic()
    assert topic.review(offer(1, message_type=OTHER)).request is None
    assert kind(topic.review(
        offer(1, False, message_type=OTHER), offer(2, True)).request) == (True, False)


def test_a_subscription_is_replaced_for_the_publisher_that_it_does_not_receive() -> None:
    topic = Topic()
    topic.review(offer(1))
    assert topic.lines() == [
        'INFO subscribed anew to /x (reliable, volatile) as its publishers offer it']
    topic.review(offer(1), offer(2, False, node='lidar', namespace='/robot'))
    assert topic.lines() == [
        'INFO subscribed anew to /x (best effort, volatile) to receive from /robot/lidar']
    topic.review(offer(1))
    assert topic.review_for(10) == 0, 'a publisher that ends replaces nothing'
    assert topic.lines() == []


def test_the_old_subscription_stays_until_all_publishers_have_found_the_new_one() -> None:
    topic = Topic()
    topic.review(offer(1), offer(2), offer(3, message_type=OTHER))
    topic.matched = 2
    assert topic.review(seconds=0.45).n_ended == 0, 'too early, even if all have found it'
    topic.matched = 1
    assert topic.review(seconds=0.1).n_ended == 0, 'one has not'
    topic.matched = 2
    assert topic.review() == Decision(1, False, None)
    assert not topic.review(seconds=0.9).ends_handover
    assert topic.review(seconds=0.2).ends_handover
    assert not topic.review(seconds=0.2).ends_handover
    topic.matched = 0
    topic.review(*topic.offers, offer(4, False))
    assert topic.review(seconds=1.9).n_ended == 0
    assert topic.review(seconds=0.2).n_ended == 1, 'it has waited long enough'


def test_a_publisher_that_cannot_match_keeps_no_old_subscription() -> None:
    topic = Topic(reliability='reliable')
    topic.matched = 1
    topic.review(offer(1, True, True), offer(2, False, True))
    assert topic.review(seconds=0.5).n_ended == 1


def test_any_number_of_subscriptions_is_replaced_and_ends_in_order() -> None:
    topic = Topic()
    for place in range(10):
        topic.review(offer(place, place % 2 == 0), seconds=0.1)
    assert len(topic.replaced) == 10
    assert topic.review(seconds=1.4).n_ended == 4
    assert not topic.review(seconds=0.1).ends_handover
    topic.review_for(2)
    assert (topic.replaced, topic.repeats) == ([], 0)


def test_an_attempt_that_fails_is_repeated_ever_more_rarely() -> None:
    topic = Topic()
    topic.problem = 'no room'
    topic.review(offer(1))
    assert topic.lines() == [
        'ERROR cannot subscribe anew to /x (reliable, volatile): no room; the subscription before '
        'is kept, and there are further attempts']
    assert topic.review_for(63) == 6, 'after 1, 2, 4, 8, 16 and 32 s'
    assert [topic.review_for(59), topic.review_for(1), topic.review_for(60)] == [0, 1, 1]
    assert kind(topic.state.request) == (False, False) and topic.lines() == []
    topic.problem = None
    assert (topic.review_for(60), kind(topic.state.request)) == (1, (True, False))
    assert 'subscribed anew to /x (reliable, volatile)' in topic.lines()[0]
    topic.problem = 'no room'
    topic.review(offer(1), offer(2, False))
    assert topic.review_for(2) == 1, 'the times begin anew'
    topic.review(offer(1))
    assert topic.review_for(10) == 0
    assert topic.lines()[1:] == ['INFO no other subscription to /x is needed any more']


def test_a_handover_that_failed_ends() -> None:
    topic = Topic()
    topic.problem = 'the middleware has no callback for new messages'
    topic.review(offer(1))
    assert topic.repeats == 1, 'messages may come twice from here on'
    topic.review(offer(1, False), seconds=0.9)
    assert topic.repeats == 1
    topic.review(seconds=0.2)
    assert topic.repeats == 0


def test_a_publisher_is_missed_only_while_the_attempts_fail() -> None:
    topic = Topic()
    topic.review(offer(1, True))
    topic.problem = 'no room'
    topic.review(offer(1, True), offer(2, False, node='lidar'))
    assert topic.unmatched() == '/lidar'
    assert not any('does not match' in line for line in topic.log), 'nothing is fixed'
    topic.problem = None
    topic.review(seconds=1.0)
    assert topic.unmatched() == ''


@pytest.mark.parametrize(('fixed', 'left_out'), [
    ({'reliability': 'reliable'}, '`reliability`'),
    ({'durability': 'transient_local'}, '`durability`'),
    ({'reliability': 'reliable', 'durability': 'transient_local'},
     '`reliability` and `durability`')])
def test_a_publisher_that_is_kept_out_is_logged_once(
    fixed: dict[str, str], left_out: str,
) -> None:
    topic = Topic(**fixed)
    publishers = [offer(1, True, True), offer(2, False, False, node='lidar', namespace='/robot')]
    for _ in range(2):
        topic.review(*publishers, seconds=1)
    requests = NAMES['reliability' in fixed, 'durability' in fixed]
    assert topic.lines() == [
        'ERROR /robot/lidar does not match the subscription to /x: it offers best effort, '
        f'volatile; the subscription requests {requests}, by `qos` or `qos_overrides`: leave '
        f'{left_out} out there']
    topic.review(offer(1, True, True))
    topic.review(*publishers[:1], offer(3, False, False))
    assert [line[:30] for line in topic.lines()] == ['ERROR /cam does not match the ']


def test_a_type_is_logged_once_with_what_the_bundle_says() -> None:
    topic = Topic()
    for place in range(3):
        topic.review(
            offer(place, message_type=OTHER), offer(9, False, message_type='a_msgs/msg/A'))
    assert topic.lines() == [
        f'ERROR /cam publishes {each} on /x, where the bundle says {TYPE}: its messages are not '
        'received' for each in (OTHER, 'a_msgs/msg/A')]
    assert topic.state.publishers == TopicFacts(0, f'a_msgs/msg/A, {OTHER}')


def test_publishers_are_named_once_and_in_order() -> None:
    topic = Topic(reliability='reliable')
    topic.review(*(offer(place, False, node='cam', namespace=namespace)
                   for place, namespace in enumerate(('/b', '/a', '/', '/a', '/a/b'))))
    assert topic.state.publishers == TopicFacts(
        5, '', '/a/b/cam, /a/cam, /b/cam, /cam')


def test_a_publisher_is_logged_when_its_node_is_known_or_after_two_seconds() -> None:
    topic = Topic(reliability='reliable')
    late = offer(1, False, node=UNNAMED)
    topic.review(late)
    topic.review(late, offer(2, False, node=UNNAMED), seconds=1.9)
    assert topic.lines() == []
    assert topic.unmatched() == 'a publisher of no known node'
    topic.review(seconds=0.2)
    assert [line[:44] for line in topic.lines()] == [
        'ERROR a publisher of no known node does not ']
    topic.review(late, offer(2, False, node='lidar'))
    assert [line[:26] for line in topic.lines()] == ['ERROR /lidar does not matc']


def test_losses_are_logged_at_most_every_ten_seconds() -> None:
    topic = Topic()
    topic.lost = 1
    topic.review()
    assert topic.lines() == [
        'WARN 1 message was lost on /x since the last such message: a queue overflowed '
        '(`qos: {depth: ...}`), or the network dropped them']
    topic.lost = 4
    topic.review(seconds=9.9)
    assert topic.lines() == []
    topic.lost = 5
    topic.review(seconds=0.2)
    assert topic.lines()[0].startswith('WARN 4 messages were lost on /x since')
    topic.review(seconds=20)
    assert topic.lines() == []


def test_a_topic_is_settled_when_time_alone_changes_nothing() -> None:
    topic = Topic()
    topic.review()
    assert topic.state.is_settled(0)
    assert not topic.state.is_settled(1), 'a loss is logged'
    topic.review(offer(1))
    assert not topic.state.is_settled(0), 'the old subscription is still to be closed'
    topic.review_for(4.0)
    assert topic.state.is_settled(0)
    topic.review(offer(1), offer(2, message_type=OTHER, node=UNNAMED))
    assert not topic.state.is_settled(0), 'the publisher will be logged'
    topic.review(seconds=2.1)
    assert topic.state.is_settled(0)


def test_levels_are_those_of_the_log() -> None:
    topic = Topic()
    topic.state.decide([offer(1)], 0, 1)
    line, = topic.state.conclude('no room', 0, 1)
    assert line.level is LogLevel.ERROR


@pytest.mark.parametrize('seed', range(20))
def test_whatever_comes_and_goes_each_publisher_is_received_and_each_handover_ends(
    seed: int,
) -> None:
    chance = random.Random(seed)
    topic, place = Topic(), 0
    topic.offers = []
    for _ in range(300):
        if chance.random() < 0.3:
            place += 1
            topic.offers.append(offer(place, *chance.choice(KINDS)))
        if topic.offers and chance.random() < 0.3:
            topic.offers.pop(chance.randrange(len(topic.offers)))
        topic.problem = 'no room' if chance.random() < 0.1 else None
        topic.matched = chance.randrange(len(topic.offers) + 1)
        topic.review(seconds=0.25)
        assert len(topic.replaced) <= 9 and all(
            topic.now - begun < 2.25 for begun in topic.replaced)
    topic.problem = None
    topic.review_for(70)
    requested = kind(topic.state.request)
    assert all(each.is_reliable >= requested[0] and each.is_durable >= requested[1]
               for each in topic.offers)
    assert (topic.replaced, topic.repeats) == ([], 0)
