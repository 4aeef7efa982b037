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
The relay of a gate: a subscription, a thread of C that judges and publishes, and a publisher.

The feed makes the subscription, as for any topic, and gives it to the relay (`Relay.topic`). The
publisher follows the publishers of the topic: it is reliable, and transient local if one of them
is. Its queue is as long as that of the subscription.
"""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from threading import Lock
from time import monotonic
from typing import Any

from fret_monitor.model.manifest import ManifestGate
from fret_monitor.model.policies import Otherwise
from fret_monitor.native.binding import ffi
from fret_monitor.ros.intake import native_lifetimes
from fret_monitor.ros.intake.hot_path import EngineTopic, Middleware
from fret_monitor.ros.intake.rcl_endpoint import RclPublisher, RclSubscription, UNNAMED
from fret_monitor.ros.intake.symbols import Unavailable
from fret_monitor.runtime.engine import Engine
from fret_monitor.runtime.subscription import DEFAULT_DEPTH

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo

_DURABLE_DEPTH = 10  # messages that a late subscriber receives
_MATCHED_S = 0.5  # until a new publisher is used, at most; until then the old one is
_UNNAMED_LOOKS = 8  # at a publisher without the name of its node, until it is reported


@dataclass(frozen=True)
class _Next:
    """A publisher that replaces the present one: when it is matched, or at a monotonic time."""

    publisher: RclPublisher
    until: float


class Relay:
    """
    Relays the messages of a gate, from its creation until `close`.

    `others` are the nodes that publish on the gate's target, beside it.
    """

    def __init__(self, node: Node, engine: Engine, gate: ManifestGate, middleware: Middleware,
                 message_class: Any) -> None:
        """
        Advertise the target and start the thread; `engine` has the gate.

        Raises
        ------
        Unavailable
            if the middleware cannot publish serialized messages, or no thread can be started.
        """
        self._node = node
        self._library = engine.library
        self._engine = engine
        self._middleware = middleware
        self._gate = gate
        self._message_class = message_class
        self._lock = Lock()  # guards the pointer in `_place`
        self._place: Any = ffi.new('struct fm_relay **')
        topics = engine.monitor.manifest.topics
        self._fixed = {} if gate.topic is None else dict(topics[gate.topic].qos)
        self._substitute = ffi.from_buffer('uint8_t[]', gate.substitute)
        self._gids: set[bytes] = set()  # of all publishers that it has had
        self._publisher = self._advertise(is_durable=False)
        self._next: _Next | None = None
        self._held = ExitStack()
        self._unnamed_looks = 0
        self.others: tuple[str, ...] = ()
        with ExitStack() as undo:
            undo.callback(self.close)  # also if a signal interrupts what follows
            self._held.enter_context(self._publisher.handle)
            native_lifetimes.keep(self)
            self._start()
            undo.pop_all()

    def _start(self) -> None:
        gate, has_substitute = self._gate, self._gate.otherwise is Otherwise.SUBSTITUTE
        options = ffi.new('struct fm_relay_options *', {
            'engine': self._engine.pointer,
            'middleware': self._middleware.functions,
            'publish': self._middleware.publish_serialized(),
            'publisher': self._middleware.publisher(self._publisher),
            'substitute': self._substitute if has_substitute else ffi.NULL,
            'substitute_size': len(gate.substitute),
            'holds': gate.otherwise is Otherwise.HOLD,
            'stamp_at': -1 if gate.stamp_at is None else gate.stamp_at,
        })
        if not self._library.fm_relay_start(self._place, options):
            raise Unavailable('no thread can be started')

    def _advertise(self, *, is_durable: bool) -> RclPublisher:
        usual = _DURABLE_DEPTH if is_durable else DEFAULT_DEPTH
        publisher = RclPublisher(self._node, self._message_class, self._gate.target, QoSProfile(
            depth=int(self._fixed.get('depth', usual)),
            reliability=ReliabilityPolicy.RELIABLE,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if is_durable
            else DurabilityPolicy.VOLATILE))
        with publisher.handle:
            self._gids.add(self._middleware.gid(publisher))
        return publisher

    @property
    def target(self) -> str:
        """The full name of the topic that is published."""
        return self._publisher.topic_name

    @property
    def topic(self) -> 'RelayedTopic':
        """What the feed does with the messages of the gate's source."""
        return RelayedTopic(self, self._engine, self._middleware, self._gate)

    @property
    def turns(self) -> int:
        """How often the thread has looked for work: at least twice a second unless it hangs."""
        with self._lock:
            return 0 if self._place[0] == ffi.NULL else int(
                self._library.fm_relay_turns(self._place[0]))

    @property
    def unpublished(self) -> int:
        """Messages that were to be sent, and that the middleware did not take."""
        with self._lock:
            return 0 if self._place[0] == ffi.NULL else int(
                self._library.fm_relay_unpublished(self._place[0]))

    def follow(self, *, is_durable: bool) -> None:
        """
        Publish with this durability, once `review` finds the new publisher matched.

        Called by the feed's thread only. It does not wait for the match: messages of other topics
        may be taken in this thread, and without them the gate closes.
        """
        wanted = self._publisher if self._next is None else self._next.publisher
        if _is_durable(wanted.qos_profile) is is_durable:
            return
        self._drop_next()
        if wanted is self._publisher:
            self._next = _Next(
                self._advertise(is_durable=is_durable), monotonic() + _MATCHED_S)

    @property
    def is_changing(self) -> bool:
        """Whether a new publisher is not used yet."""
        return self._next is not None

    def review(self) -> None:
        """Use the new publisher, if due; called periodically, by the feed's thread only."""
        if self._next is None or (
                self._next.publisher.subscriptions < self._publisher.subscriptions
                and monotonic() < self._next.until):
            return
        old, new, held = self._publisher, self._next.publisher, ExitStack()
        with self._lock:
            if self._place[0] == ffi.NULL:
                return
            held.enter_context(new.handle)
            self._library.fm_relay_publish_with(
                self._place[0], self._middleware.publisher(new))
            self._publisher, self._next = new, None
            self._held, before = held, self._held
        before.close()
        old.close()

    def _drop_next(self) -> None:
        if self._next is not None:
            self._next.publisher.close()
            self._next = None

    def look_for_others(self) -> None:
        """Look for other publishers on the target; called by the feed's thread only."""
        found = self._others(self._node.get_publishers_info_by_topic(self._gate.target))
        own = self._node.get_fully_qualified_name()
        names = {_full_name(item) for item in found if item.node_name != UNNAMED}
        has_unnamed = any(item.node_name == UNNAMED for item in found)
        self._unnamed_looks = self._unnamed_looks + 1 if has_unnamed else 0
        if self._unnamed_looks > _UNNAMED_LOOKS:
            names.add('a publisher of no known node')
        self.others = tuple(sorted(
            f'another {name}' if name == own else name for name in names))

    @property
    def knows_others(self) -> bool:
        """Whether each other publisher has been reported, or has the name of its node."""
        return self._unnamed_looks == 0 or self._unnamed_looks > _UNNAMED_LOOKS

    def _others(self, found: Sequence[TopicEndpointInfo]) -> list[TopicEndpointInfo]:
        """Return the publishers that are not the gate's; they may have the name of its node."""
        others = [item for item in found if bytes(item.endpoint_gid) not in self._gids]
        if len(others) < len(found):
            return others
        own = self._node.get_fully_qualified_name()  # the middleware lists other ids
        mine = next((item for item in found if _full_name(item) == own), None)
        return [item for item in found if item is not mine]

    def add(self, subscription: RclSubscription) -> None:
        """Take the messages of a subscription."""
        with self._lock:
            if self._place[0] == ffi.NULL or not self._library.fm_relay_add(
                    self._place[0], self._middleware.subscription(subscription)):
                raise Unavailable('the middleware has no callback for new messages, or there are '
                                  'eight subscriptions already')

    def retire(self, subscription: RclSubscription) -> None:
        """Mark a subscription as one that is being replaced."""
        with self._lock:
            if self._place[0] != ffi.NULL:
                self._library.fm_relay_retire(
                    self._place[0], self._middleware.subscription(subscription))

    def remove(self, subscription: RclSubscription) -> bool:
        """Take what is waiting, then no more; return whether it may be destroyed."""
        with self._lock:
            return self._place[0] == ffi.NULL or bool(self._library.fm_relay_remove(
                self._place[0], self._middleware.subscription(subscription)))

    def end(self) -> None:
        """End the thread; a second call does nothing."""
        with self._lock:
            if self._place[0] != ffi.NULL:
                self._library.fm_relay_end(self._place[0])
        native_lifetimes.release(self)

    def close(self) -> None:
        """End the thread, and withdraw the target; the subscriptions were removed before."""
        self.end()
        with self._lock:
            self._library.fm_relay_stop(self._place)
        self._held.close()
        self._drop_next()
        self._publisher.close()


def _is_durable(profile: QoSProfile) -> bool:
    return profile.durability is DurabilityPolicy.TRANSIENT_LOCAL


def _full_name(item: TopicEndpointInfo) -> str:
    return f'{item.node_namespace.rstrip("/")}/{item.node_name}'


class RelayedTopic(EngineTopic):
    """The topic of a gate: the relay takes its messages."""

    def __init__(self, relay: Relay, engine: Engine, middleware: Middleware,
                 gate: ManifestGate) -> None:
        """Give the subscriptions of this topic to a relay."""
        # The engine has one more than there are, for a topic that feeds no input.
        topics = len(engine.monitor.manifest.topics)
        super().__init__(engine, middleware, topics if gate.topic is None else gate.topic)
        self._relay = relay
        self._receiver: RelayReceiver | None = None  # of the present subscription

    def open(self, subscription: RclSubscription) -> 'RelayReceiver':
        """Start taking the messages of a subscription; raises `Unavailable`."""
        if _is_durable(subscription.qos_profile):
            self._relay.follow(is_durable=True)
        self._receiver = RelayReceiver(self._relay, subscription)
        return self._receiver

    def review(self, publishers: Sequence[TopicEndpointInfo]) -> None:
        """Offer what the publishers of the source offer; look for others on the target."""
        self._relay.review()
        if self._receiver is not None:
            self._receiver.start()
        self._relay.look_for_others()
        if publishers:
            self._relay.follow(is_durable=any(
                _is_durable(item.qos_profile) for item in publishers))

    @property
    def is_settled(self) -> bool:
        """Whether no publisher is being replaced, and the node of each other one is known."""
        return not self._relay.is_changing and self._relay.knows_others


class RelayReceiver:
    """A subscription from which a relay takes."""

    def __init__(self, relay: Relay, subscription: RclSubscription) -> None:
        """Start taking; history waits until the relay's publisher is durable, too."""
        self._relay = relay
        self._subscription = subscription
        self._held = ExitStack()
        self._held.enter_context(subscription.handle)
        self._is_leaked = False
        self._is_added = False
        with ExitStack() as undo:
            undo.callback(self._held.close)
            self.start()
            undo.pop_all()

    def start(self) -> None:
        """Start taking, unless that has to wait."""
        if not self._relay.is_changing:
            self._add()

    def _add(self) -> None:
        if not self._is_added:
            self._relay.add(self._subscription)
            self._is_added = True

    def retire(self) -> None:
        """Mark the subscription as one that is being replaced."""
        self._add()
        self._relay.retire(self._subscription)

    def end(self) -> None:
        """Do nothing: the relay ends with its thread."""

    def stop(self) -> None:
        """Take what waits, and stop; afterwards the subscription may be destroyed."""
        if self._is_added and not self._is_leaked and \
                not self._relay.remove(self._subscription):
            self._is_leaked = True  # the middleware may still call back
            native_lifetimes.keep_forever(self)
        if not self._is_leaked:
            self._held.close()
