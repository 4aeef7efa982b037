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

"""
The subscriptions of a bundle: made, replaced where they do not match a publisher, and closed.

One thread checks the publishers periodically. It takes messages only for nodes without an engine
(`raw_topic`): for the others C does.

The subscriptions are used by no executor.
"""

from collections import deque
from collections.abc import Mapping, Sequence, Set
from contextlib import ExitStack
from dataclasses import dataclass
from threading import Event, Thread
from time import monotonic
from typing import Any, Protocol

from fret_monitor.ros.intake import native_lifetimes
from fret_monitor.ros.intake.rcl_subscription import RclSubscription
from fret_monitor.ros.intake.throttle import Throttle
from fret_monitor.ros.settings import qos
from fret_monitor.ros.settings.endpoint_types import one_type
from fret_monitor.ros.watch import ErrorKeeper

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.topic_endpoint_info import TopicEndpointInfo


class Receiver(Protocol):
    """Takes the messages of one subscription."""

    def drain(self) -> None:
        """Deliver the messages in the queue."""

    def poll(self) -> None:
        """Do what had to wait; called periodically."""

    def retire(self) -> None:
        """Mark the subscription as one that is being replaced."""

    def stop(self) -> None:
        """Stop taking; nothing is delivered afterwards."""


class Topic(Protocol):
    """What becomes of the messages of a topic."""

    def open(self, subscription: RclSubscription) -> Receiver:
        """Start taking the messages of a subscription."""

    def note_publishers(self, gids: Set[bytes]) -> None:
        """Note which publishers there are; called periodically."""

    def follow(self, offers: Sequence[QoSProfile]) -> None:
        """Note the quality of service that the publishers offer; called periodically."""

    def begin_handover(self, *, has_history: bool) -> None:
        """Drop duplicates from now on; with `has_history` also history that was sent earlier."""

    def end_handover(self) -> None:
        """Expect no duplicates any more: the old subscription is closed."""

    @property
    def lost(self) -> int:
        """Messages lost: sent, and not received by any subscription of the topic."""


class Taker(Protocol):
    """Takes messages in the feed's thread."""

    def take(self) -> None:
        """Wait for messages, less than a period of the reviews, and deliver them."""

    def end(self) -> None:
        """Deliver no more, and end a wait."""

    def close(self) -> None:
        """Release what `take` has used; its thread has ended."""


_REVIEW_PERIOD = 0.25  # s between two checks of the publishers
_REVIEWED_AT_ONCE = 50  # topics per check, 50 us each: at most 1 % of a processor
# In a handover the old subscription is kept until all publishers have discovered the new one.
_OVERLAP = 2.0  # s until the old subscription is closed, at most
_ASSURED = 0.5  # s until it is closed if the new one has matched all publishers
_GRACE = 1.0  # s after it was closed, during which duplicates are still recognised
_NAMED = 2.0  # s until a publisher is logged without the name of its node
UNNAMED = '_NODE_NAME_UNKNOWN_'
_LOSSES_S = 10.0  # between two log lines about lost messages of a topic
_RETRY_S = 1.0  # after a subscription that failed, until the next attempt; it doubles
_RETRY_MOST_S = 60.0


@dataclass(frozen=True)
class PublisherStatus:
    """
    The discovered publishers of a topic.

    `publishers` counts those of the topic's type; `unmatched` names the nodes of those whose
    quality of service does not match; `other_types` are the types of the other publishers; `lost`
    counts lost messages.
    """

    publishers: int = 0
    unmatched: tuple[str, ...] = ()
    other_types: tuple[str, ...] = ()
    lost: int = 0


class Feed:
    """The subscriptions to any number of topics, checked in a thread of its own."""

    def __init__(self, node: Node, taker: Taker | None = None) -> None:
        """
        Prepare a feed for a node; nothing is delivered before `start`.

        `taker` takes the messages of topics for which C does not.
        """
        self._node = node
        self._taker = taker
        self._topics: list[_Subscribed] = []
        self._added: deque[_Subscribed] = deque()  # since the start, until the next review
        self._removed: deque[str] = deque()
        self._next_reviewed = 0
        self._closing = Event()
        self._thread = Thread(target=self._run, name='feed', daemon=True)
        self._kept = ErrorKeeper()
        self.turns = 0
        """How often the thread has looked for work: several times a second unless it hangs."""

    def subscribe(self, name: str, message_type: str, message_class: Any, topic: Topic,
                  fixed: Mapping[str, str | int]) -> None:
        """
        Subscribe to a topic; after `start` this takes effect at the next review.

        `fixed` is the part of the quality of service that does not follow the publishers
        (`qos.wanted_profile`).

        Raises
        ------
        Refusal
            if the middleware refuses: for example a second type of a topic in one process.
        """
        with one_type(self._node, 'subscribe to', name, message_type):
            (self._added if self._thread.is_alive() else self._topics).append(
                _Subscribed(self._node, name, message_type, message_class, topic, fixed))

    def unsubscribe(self, name: str) -> None:
        """End the subscription to a topic, at the next review; for nodes without an engine."""
        self._removed.append(name)

    def start(self) -> None:
        """Start delivering."""
        for topic in self._topics:
            topic.open()
        native_lifetimes.keep(self)
        self._thread.start()

    def end(self) -> None:
        """
        End the thread; a second call does nothing.

        At the exit of a process Python ends daemon threads in the middle of a call to rcl, which
        terminates the process.
        """
        self._closing.set()
        if self._taker is not None:
            self._taker.end()
        if self._thread.is_alive():
            self._thread.join()

    def close(self) -> None:
        """Stop delivering, and destroy the subscriptions; nothing is delivered afterwards."""
        self._closing.set()
        with ExitStack() as last:  # all of them run, even if one is interrupted
            if self._taker is not None:
                last.callback(self._taker.close)
            last.callback(self._topics.clear)
            last.callback(self._added.clear)
            for topic in {*self._topics, *self._added}:
                last.callback(topic.close)
            self.end()
            native_lifetimes.release(self)

    def statuses(self) -> list[PublisherStatus]:
        """Return the publishers of each topic, in order of subscription."""
        return [topic.status for topic in self._topics]

    @property
    def failure(self) -> Exception | None:
        """The error that ended the thread, if any; nothing is delivered after it."""
        return self._kept.error

    def _run(self) -> None:
        with self._kept:
            self._loop()

    def _loop(self) -> None:
        next_review = monotonic()
        while not self._closing.is_set():
            self.turns += 1
            if monotonic() >= next_review:
                self._review()
                next_review = monotonic() + _REVIEW_PERIOD
            if self._taker is None:
                self._closing.wait(_REVIEW_PERIOD)
            else:
                self._taker.take()

    def _add_and_remove(self) -> None:
        while self._added:
            topic = self._added[0]
            self._topics.append(topic)
            self._added.popleft()
            topic.open()
        while self._removed:
            name = self._removed.popleft()
            for topic in [item for item in self._topics if item.name == name]:
                self._topics.remove(topic)
                topic.close()

    def _review(self) -> None:
        self._add_and_remove()
        begin = self._next_reviewed
        for topic in self._topics[begin:begin + _REVIEWED_AT_ONCE]:
            topic.review()
        self._next_reviewed = begin + _REVIEWED_AT_ONCE
        if self._next_reviewed >= len(self._topics):
            self._next_reviewed = 0


class _Subscribed:
    """A topic, its publishers, and its subscription (two of them during a handover)."""

    def __init__(self, node: Node, name: str, message_type: str, message_class: Any,
                 topic: Topic, fixed: Mapping[str, str | int]) -> None:
        self.topic = topic
        self._message_class = message_class
        self._node = node
        self.name = name
        self._message_type = message_type
        self._fixed = fixed
        self.status = PublisherStatus()
        self._logged: set[object] = set()
        self._known: set[bytes] = set()
        self._has_new = False  # publishers for which the subscription was not checked yet
        self._retry_s = 0.0  # between two attempts to subscribe anew; 0: none failed
        self._retry_at = 0.0
        self._unnamed: dict[bytes, float] = {}  # publishers without a known node, and since when
        self._retired: list[tuple[RclSubscription, Receiver | None, float]] = []
        self._overlaps_until: float | None = None
        self._current = self._subscribe(qos.wanted_profile((), fixed))
        self._receiver: Receiver | None = None
        self._logged_losses = 0
        self._throttle = Throttle(_LOSSES_S)

    def open(self) -> None:
        """Start taking messages."""
        self._receiver = self.topic.open(self._current)

    def close(self) -> None:
        """Destroy all subscriptions."""
        with ExitStack() as last:
            for item, receiver, _ in [*self._retired, (self._current, self._receiver, 0.0)]:
                last.callback(self._destroy, item, receiver)

    def _destroy(self, subscription: RclSubscription, receiver: Receiver | None) -> None:
        with ExitStack() as last:
            last.callback(subscription.close)
            if receiver is not None:
                last.callback(receiver.stop)
                receiver.drain()

    def review(self) -> None:
        """Check the publishers, log mismatches, and replace the subscription if due."""
        self._let_go()
        if self._receiver is not None:
            self._receiver.poll()
        publishers = self._node.get_publishers_info_by_topic(self.name)
        same_type = [item for item in publishers if item.topic_type == self._message_type]
        others = [item for item in publishers if item.topic_type != self._message_type]
        wanted = qos.wanted_profile((item.qos_profile for item in same_type), self._fixed)
        gids = {bytes(item.endpoint_gid) for item in same_type}
        self._has_new = self._has_new or not gids <= self._known
        self._known = gids
        self._renew_if_due(wanted, same_type)
        unmatched = [item for item in same_type
                     if not qos.matches(self._current.qos_profile, item.qos_profile)]
        self.topic.note_publishers(gids)
        self.topic.follow([item.qos_profile for item in same_type])
        self.status = PublisherStatus(
            len(same_type), tuple(sorted({_who(item) for item in unmatched})),
            tuple(sorted({item.topic_type for item in others})), self.topic.lost)
        self._log_lost()
        named = self._named(publishers)
        for item in others:
            if bytes(item.endpoint_gid) in named:
                self._log_type(item)
        for item in unmatched:
            if bytes(item.endpoint_gid) in named:
                self._log_unmatched(item)

    def _named(self, publishers: list[TopicEndpointInfo]) -> set[bytes]:
        """
        Return the publishers that can be logged: those with a known node, or none for `_NAMED` s.

        The middleware discovers a publisher first, and its node a moment later.
        """
        now = monotonic()
        self._unnamed = {
            gid: self._unnamed.get(gid, now) for gid in (
                bytes(item.endpoint_gid) for item in publishers if item.node_name == UNNAMED)}
        gids = {bytes(item.endpoint_gid) for item in publishers}
        return gids - {gid for gid, since in self._unnamed.items() if now < since + _NAMED}

    def _renew_if_due(self, wanted: QoSProfile, publishers: list[TopicEndpointInfo]) -> None:
        """Replace the subscription if publishers have come that ask for another one."""
        is_current = qos.same_request(wanted, self._current.qos_profile)
        if is_current and self._retry_s:
            self._retry_s = 0.0
            self._node.get_logger().info(
                f'no other subscription to {self._current.topic_name} is needed any more')
        self._has_new = self._has_new and not is_current
        if self._has_new and (not self._retry_s or monotonic() >= self._retry_at):
            self._renew(wanted, publishers)

    def _renew(self, wanted: QoSProfile, publishers: list[TopicEndpointInfo]) -> None:
        before = self._current.qos_profile
        try:
            self._replace(wanted)
        except Exception as error:  # noqa: B902  whatever it is, monitoring goes on
            self._note_failure(wanted, error)
            return
        self._retry_s, self._has_new = 0.0, False
        unmatched = [item for item in publishers if not qos.matches(before, item.qos_profile)]
        reason = f'to receive from {_who(unmatched[0])}' if unmatched \
            else 'as its publishers offer it'
        self._node.get_logger().info(
            f'subscribed anew to {self._current.topic_name} ({qos.describe(wanted)}) {reason}')

    def _replace(self, wanted: QoSProfile) -> None:
        """
        Replace the subscription; if that raises an error, the one before stays.

        The new subscription may receive duplicates of what the old one received, and history,
        which must not be delivered after newer messages.
        """
        with ExitStack() as undo:
            new = self._subscribe(wanted)
            undo.callback(new.close)
            self.topic.begin_handover(
                has_history=wanted.durability is DurabilityPolicy.TRANSIENT_LOCAL)
            undo.callback(self._expect_end)
            if self._receiver is not None:
                self._receiver.retire()
            receiver = self.topic.open(new)
            undo.pop_all()
        self._retired.append((self._current, self._receiver, monotonic() + _OVERLAP))
        self._current, self._receiver = new, receiver

    def _expect_end(self) -> None:
        self._overlaps_until = monotonic() + _GRACE

    def _note_failure(self, wanted: QoSProfile, error: Exception) -> None:
        """Plan the next attempt: they get rarer. Only the first failure is logged."""
        if not self._retry_s:
            self._node.get_logger().error(
                f'cannot subscribe anew to {self._current.topic_name} ({qos.describe(wanted)}): '
                f'{error}; the subscription before is kept, and there are further attempts')
        self._retry_s = min(2 * self._retry_s or _RETRY_S, _RETRY_MOST_S)
        self._retry_at = monotonic() + self._retry_s

    def _let_go(self) -> None:
        now = monotonic()
        for retired in list(self._retired):
            item, receiver, until = retired
            is_assured = now >= until - _OVERLAP + _ASSURED and \
                self._current.handle.get_publisher_count() >= self.status.publishers
            if now >= until or is_assured:
                self._retired.remove(retired)
                self._destroy(item, receiver)
                self._expect_end()
        if self._retired or self._overlaps_until is None:
            return
        # Wait a moment longer: the queue of the new subscription may still hold duplicates.
        if now >= self._overlaps_until:
            self._overlaps_until = None
            self.topic.end_handover()

    def _subscribe(self, profile: QoSProfile) -> RclSubscription:
        return RclSubscription(self._node, self._message_class, self.name, profile)

    def _log_lost(self) -> None:
        lost = self.status.lost - self._logged_losses
        if lost > 0 and self._throttle.passes():
            self._logged_losses = self.status.lost
            messages = 'message was' if lost == 1 else 'messages were'
            self._node.get_logger().warning(
                f'{lost} {messages} lost on {self._current.topic_name} since the last such '
                'message: a queue overflowed (`qos: {depth: ...}`), or the network dropped them')

    def _log_type(self, publisher: TopicEndpointInfo) -> None:
        if self._is_news(publisher.topic_type):
            self._node.get_logger().error(
                f'{_who(publisher)} publishes {publisher.topic_type} on '
                f'{self._current.topic_name}, where the bundle says {self._message_type}: '
                'its messages are not received')

    def _log_unmatched(self, publisher: TopicEndpointInfo) -> None:
        if self._is_news(bytes(publisher.endpoint_gid)):
            self._node.get_logger().error(
                f'{_who(publisher)} does not match the subscription to '
                f'{self._current.topic_name}: it offers '
                f'{qos.describe(publisher.qos_profile)}; the subscription requests '
                f'{qos.describe(self._current.qos_profile)}, by `qos` or `qos_overrides`'
                f'{self._remedy(publisher)}')

    def _remedy(self, publisher: TopicEndpointInfo) -> str:
        """Return the advice for fixed policies that keep a publisher from matching."""
        names = [f'`{name}`' for name in qos.misfits(
            self._current.qos_profile, publisher.qos_profile) if name in self._fixed]
        return f': leave {" and ".join(names)} out there' if names else ''

    def _is_news(self, key: object) -> bool:
        is_news = key not in self._logged
        self._logged.add(key)
        return is_news


def _who(publisher: TopicEndpointInfo) -> str:
    if publisher.node_name == UNNAMED:
        return 'a publisher of no known node'
    return f'{publisher.node_namespace.rstrip("/")}/{publisher.node_name}'
