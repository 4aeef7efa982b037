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
The subscriptions of a node: made, replaced and closed as C decides (`runtime.subscription`).

One thread looks for the publishers when the graph has changed. It takes messages only for nodes
without an engine (`raw_topic`): for the others C does.

The subscriptions are used by no executor.
"""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from threading import Event
from time import monotonic, monotonic_ns
from typing import Any, Protocol

from fret_monitor.ros.intake import native_lifetimes
from fret_monitor.ros.intake.graph_wait import GraphWait
from fret_monitor.ros.intake.rcl_endpoint import RclSubscription
from fret_monitor.ros.log_lines import log_lines
from fret_monitor.ros.settings.names import one_type
from fret_monitor.ros.settings.qos import profile_of
from fret_monitor.ros.watch import WatchedThread
from fret_monitor.runtime.reporting import TopicFacts
from fret_monitor.runtime.subscription import (
    LOOK_AGAIN_S, LOOK_DELAY_S, LOOK_PERIOD_S, LOOKS_AT_ONCE, Offer, Request, SubscriptionState,
)

from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo


class Receiver(Protocol):
    """Takes the messages of one subscription."""

    def retire(self) -> None:
        """Mark the subscription as one that is being replaced."""

    def stop(self) -> None:
        """Deliver what waits, and stop; afterwards the subscription may be destroyed."""


class Topic(Protocol):
    """What becomes of the messages of a topic."""

    def open(self, subscription: RclSubscription) -> Receiver:
        """Start taking the messages of a subscription; raises `Unavailable`."""

    def review(self, publishers: Sequence[Offer]) -> None:
        """Follow its publishers, which are of its type; does nothing unless it is overridden."""
        return

    @property
    def is_settled(self) -> bool:
        """Whether the next review can wait until the graph changes."""
        return True

    def begin_handover(self, *, has_history: bool) -> None:
        """Drop duplicates from now on; with `has_history` also history that was sent earlier."""

    def end_handover(self) -> None:
        """Expect no duplicates any more: the old subscription is closed."""

    @property
    def lost(self) -> int:
        """Messages lost: sent, and not received by any subscription of the topic."""


class Taker(Protocol):
    """Takes messages in the feed's thread."""

    @property
    def handles(self) -> Sequence[Any]:
        """The handles of the subscriptions that are waited for."""

    def take(self) -> None:
        """Deliver the messages that wait."""

    def end(self) -> None:
        """Deliver no more."""


class GraphWatch(Protocol):
    """Looks at the graph of ROS; `knows_change`: it will look whether or not more changes come."""

    knows_change: bool

    def review(self, has_changed: bool, subscriptions: Callable[[str], int]) -> float:
        """Look if it is time; return after how many seconds to call this again."""


_SETTLED_S = 1.0  # between two questions whether topics are settled
_LONGEST_WAIT_S = 0.5  # so that `turns` grows


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
        self._removed: deque[str | Topic] = deque()
        self._due: dict[_Subscribed, None] = {}  # to be reviewed, in this order
        self._next_look = self._next_question = self._next_round = 0.0
        self._graph = GraphWait(node)
        self._watched: dict[GraphWatch, float] = {}  # each with the s until its next look
        self._has_changed = True
        self._closing = Event()
        self._thread = WatchedThread('feed', self._loop)
        self.turns = 0
        """How often the thread has looked for work: several times a second unless it hangs."""

    def subscribe(self, library: Any, name: str, message_type: str, message_class: Any,
                  topic: Topic, fixed: Mapping[str, str | int], *, is_found: bool = False) -> None:
        """
        Subscribe to a topic; after `start` this takes effect at the next review.

        `library` has the functions of csrc. `fixed` is the part of the quality of service that
        does not follow the publishers (`SubscriptionState`). `is_found`: it was found in the
        graph, with its publishers. Raises `Refusal` if the middleware refuses: for example a
        second type of a topic in one process.
        """
        with one_type(self._node, 'subscribe to', name, message_type):
            (self._added if self._thread.is_alive() else self._topics).append(
                _Subscribed(self._node, library, name, message_type, message_class, topic, fixed,
                            is_found=is_found))
        self._graph.wake()

    def unsubscribe(self, topic: str | Topic) -> None:
        """End the subscriptions to a topic, given by its name or itself, at the next review."""
        self._removed.append(topic)
        self._graph.wake()

    def abandoned(self) -> list[Topic]:
        """Return the topics that have had no publisher for long; for the feed's thread."""
        now = monotonic_ns()
        return [item.topic for item in self._topics if item.state.is_abandoned(now)]

    def watch(self, graph: GraphWatch) -> None:
        """Look at the graph, too; to be called before `start`."""
        self._watched[graph] = 0.0

    def start(self) -> None:
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
        self._graph.wake()
        if self._taker is not None:
            self._taker.end()
        if self._thread.is_alive():
            self._thread.join()

    def close(self) -> None:
        """Stop delivering, and destroy the subscriptions; nothing is delivered afterwards."""
        self._closing.set()
        with ExitStack() as last:  # all of them run, even if one is interrupted
            last.callback(self._graph.close)
            last.callback(self._topics.clear)
            last.callback(self._added.clear)
            for topic in {*self._topics, *self._added}:
                last.callback(topic.close)
            self.end()
            native_lifetimes.release(self)

    def publishers(self) -> list[tuple[Topic, TopicFacts]]:
        """Return the publishers of each topic, in order of subscription."""
        return [(item.topic, item.publishers) for item in self._topics]

    @property
    def failure(self) -> Exception | None:
        """The error that ended the thread, if any; nothing is delivered after it."""
        return self._thread.failure

    def _loop(self) -> None:
        self._due = dict.fromkeys(self._topics)
        while not self._closing.is_set():
            self.turns += 1
            self._review()
            self._look()
            self._wait()
            if self._taker is not None:
                self._taker.take()

    def _wait(self) -> None:
        until = self._next_look - monotonic() if self._due else _LONGEST_WAIT_S
        handles = () if self._taker is None else self._taker.handles
        until = min([until, *self._watched.values()])
        if self._graph.wait(max(0.0, until), handles, for_change=not self._knows_change):
            self._has_changed = True
            if not self._due:
                self._next_look = max(self._next_look, monotonic() + LOOK_DELAY_S)
            self._due |= dict.fromkeys(self._topics)

    @property
    def _knows_change(self) -> bool:
        """Whether all looks are due, so that another change makes no difference."""
        return len(self._due) == len(self._topics) and (
            all(item.knows_change for item in self._watched) if self._watched else bool(self._due))

    def _look(self) -> None:
        has_changed, self._has_changed = self._has_changed, False
        for item in self._watched:
            self._watched[item] = item.review(has_changed, self._subscriptions)

    def _subscriptions(self, name: str) -> int:
        return sum(topic.subscriptions for topic in self._topics if topic.full_name == name)

    def _add_and_remove(self) -> None:
        while self._added:
            topic = self._added[0]
            self._topics.append(topic)
            self._due[topic] = None
            self._added.popleft()
            topic.open()
        while self._removed:
            found = self._removed.popleft()
            for topic in [item for item in self._topics if found in (item.name, item.topic)]:
                self._topics.remove(topic)
                self._due.pop(topic, None)
                topic.close()

    def _review(self) -> None:
        self._add_and_remove()
        now = monotonic()
        if now >= self._next_question:
            self._next_question = now + _SETTLED_S
            is_round = now >= self._next_round
            self._due |= dict.fromkeys(
                topic for topic in self._topics if is_round or not topic.is_settled)
            self._next_round = now + LOOK_AGAIN_S if is_round else self._next_round
        if self._due and now >= self._next_look:
            self._next_look = now + LOOK_PERIOD_S
            self._review_due()

    def _review_due(self) -> None:
        for topic in [*self._due][:LOOKS_AT_ONCE]:
            del self._due[topic]
            topic.review()
            if not topic.is_settled:
                self._due[topic] = None


class _Subscribed:
    """A topic, its publishers, and its subscription (two of them during a handover)."""

    def __init__(self, node: Node, library: Any, name: str, message_type: str, message_class: Any,
                 topic: Topic, fixed: Mapping[str, str | int], *, is_found: bool) -> None:
        self.topic = topic
        self._message_class = message_class
        self._node = node
        self.name = name
        self.full_name: str = node.resolve_topic_name(name)
        self._message_type = message_type
        self.publishers = TopicFacts()
        self._is_unread = False  # the middleware did not tell the publishers
        self.state = SubscriptionState(library, self.full_name, message_type, fixed)
        self._retired: deque[tuple[RclSubscription, Receiver | None]] = deque()
        if is_found:
            self.state.begin(offers_on(node, name) or (), monotonic_ns())
        self._current = self._subscribe(self.state.request)
        self._receiver: Receiver | None = None

    @property
    def subscriptions(self) -> int:
        return 1 + len(self._retired)

    def open(self) -> None:
        self._receiver = self.topic.open(self._current)

    def close(self) -> None:
        with ExitStack() as last:
            if self._retired:
                last.callback(self.topic.end_handover)
            for item, receiver in [*self._retired, (self._current, self._receiver)]:
                last.callback(self._destroy, item, receiver)

    def _destroy(self, subscription: RclSubscription, receiver: Receiver | None) -> None:
        with ExitStack() as last:
            last.callback(subscription.close)
            if receiver is not None:
                receiver.stop()

    def review(self) -> None:
        found = offers_on(self._node, self.name)
        self._is_unread = found is None
        if found is None:
            return
        decision = self.state.decide(
            found, self._current.handle.get_publisher_count(), monotonic_ns())
        for _ in range(decision.n_ended):
            self._destroy(*self._retired.popleft())
        if decision.ends_handover:
            self.topic.end_handover()
        problem = None if decision.request is None else self._try_to_replace(decision.request)
        self.topic.review([item for item in found if item.message_type == self._message_type])
        log_lines(self._node.get_logger(),
                  self.state.conclude(problem, self.topic.lost, monotonic_ns()))
        self.publishers = self.state.publishers

    @property
    def is_settled(self) -> bool:
        """Whether the next review can wait until the graph changes."""
        return not self._is_unread and self.topic.is_settled \
            and self.state.is_settled(self.topic.lost)

    def _try_to_replace(self, request: Request) -> str | None:
        """Replace the subscription; return the problem if that fails: the one before stays."""
        try:
            self._replace(request)
        except Exception as error:  # noqa: B902  whatever it is, monitoring goes on
            return str(error)
        return None

    def _replace(self, request: Request) -> None:
        with ExitStack() as undo:
            new = self._subscribe(request)
            undo.callback(new.close)
            self.topic.begin_handover(has_history=request.is_durable)
            if self._receiver is not None:
                self._receiver.retire()
            receiver = self.topic.open(new)
            undo.pop_all()
        self._retired.append((self._current, self._receiver))
        self._current, self._receiver = new, receiver

    def _subscribe(self, request: Request) -> RclSubscription:
        return RclSubscription(self._node, self._message_class, self.name, profile_of(request))


def offers_on(node: Node, name: str) -> list[Offer] | None:
    """Return the publishers on a topic; None if the middleware does not tell them this time."""
    try:
        return [*map(offer_of, node.get_publishers_info_by_topic(name))]
    except _rclpy.RCLError:
        return None


def offer_of(publisher: TopicEndpointInfo) -> Offer:
    """Return what the decisions must know of a publisher."""
    offered = publisher.qos_profile
    return Offer(bytes(publisher.endpoint_gid), publisher.node_name, publisher.node_namespace,
                 publisher.topic_type, offered.reliability is ReliabilityPolicy.RELIABLE,
                 offered.durability is DurabilityPolicy.TRANSIENT_LOCAL)
