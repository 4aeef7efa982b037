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
publisher follows the publishers of the topic as C decides (`csrc/reporting/gate_target.h`).
"""

from collections.abc import Sequence
from contextlib import ExitStack
from typing import Any

from fret_monitor.model.manifest import ManifestGate
from fret_monitor.model.policies import Otherwise
from fret_monitor.native.binding import ffi
from fret_monitor.ros.intake import native_lifetimes
from fret_monitor.ros.intake.feed import offers_on
from fret_monitor.ros.intake.hot_path import EngineTopic, Middleware
from fret_monitor.ros.intake.rcl_endpoint import RclPublisher, RclSubscription
from fret_monitor.ros.intake.symbols import Unavailable
from fret_monitor.runtime.engine import Engine
from fret_monitor.runtime.gate_target import GateTarget
from fret_monitor.runtime.reporting import GateFacts
from fret_monitor.runtime.subscription import Offer

from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy


class Relay(native_lifetimes.NativeThread):
    """
    Relays the messages of a gate, from its creation until `close`.

    The feed's thread calls `follow`, `review` and `look_for_others`.
    """

    def __init__(self, node: Node, engine: Engine, gate: ManifestGate, middleware: Middleware,
                 message_class: Any) -> None:
        """
        Advertise the target and start the thread; `engine` has the gate.

        Raises `Unavailable` if the middleware cannot publish serialized messages, or no thread can
        be started.
        """
        super().__init__('relay', engine)
        self._node = node
        self._middleware = middleware
        self._gate = gate
        self._message_class = message_class
        topics = engine.monitor.manifest.topics
        fixed = {} if gate.topic is None else dict(topics[gate.topic].qos)
        self._target = GateTarget(
            engine.library, node.get_fully_qualified_name(), int(fixed.get('depth', 0)))
        self._substitute = ffi.from_buffer('uint8_t[]', gate.substitute)
        self._publisher = self._advertise(self._target.first)
        self._next: RclPublisher | None = None  # that replaces it
        self._others = ''  # written by `look_for_others`
        with self._starting([self._publisher]):
            self._start(self._options())

    def _options(self) -> Any:
        gate, has_substitute = self._gate, self._gate.otherwise is Otherwise.SUBSTITUTE
        return ffi.new('struct fm_relay_options *', {
            'engine': self._engine.pointer,
            'middleware': self._middleware.functions,
            'publish': self._middleware.publish_serialized(),
            'publisher': self._middleware.handle(self._publisher),
            'substitute': self._substitute if has_substitute else ffi.NULL,
            'substitute_size': len(gate.substitute),
            'holds': gate.otherwise is Otherwise.HOLD,
            'stamp_at': -1 if gate.stamp_at is None else gate.stamp_at,
        })

    def _advertise(self, wanted: Any) -> RclPublisher:
        publisher = RclPublisher(self._node, self._message_class, self._gate.target, QoSProfile(
            depth=wanted.depth, reliability=ReliabilityPolicy.RELIABLE,
            durability=DurabilityPolicy.TRANSIENT_LOCAL if wanted.is_durable
            else DurabilityPolicy.VOLATILE))
        with publisher.handle:
            self._target.note(self._middleware.gid(publisher))
        return publisher

    @property
    def target(self) -> str:
        """The full name of the topic that is published."""
        return self._publisher.topic_name

    @property
    def topic(self) -> 'RelayedTopic':
        """What the feed does with the messages of the gate's source."""
        return RelayedTopic(self, self._engine, self._middleware, self._gate)

    def look(self) -> GateFacts:
        """Return what is around the gate, for the log and diagnostics."""
        return GateFacts(self._others, self.target, int(self._call('unpublished') or 0))

    def follow(self, *, is_durable: bool) -> None:
        """
        Publish with this durability, once `review` finds the new publisher matched.

        It does not wait for the match: messages of other topics may be taken in this thread, and
        without them the gate closes.
        """
        decision = self._target.follow(is_durable=is_durable)
        if decision.drops_next:
            self._drop_next()
        if decision.advertises:
            try:
                self._next = self._advertise(decision)
            except _rclpy.RCLError as error:  # another attempt follows
                self._target.fail()
                self._node.get_logger().error(f'cannot advertise {self.target}: {error}')

    @property
    def is_changing(self) -> bool:
        """Whether a new publisher is not used yet."""
        return self._next is not None

    @property
    def is_settled(self) -> bool:
        """Whether no publisher is being replaced, and the node of each other one is known."""
        return self._target.is_settled

    def review(self) -> None:
        """Use the new publisher, if due."""
        if self._next is None or not self._target.review(
                self._publisher.subscriptions, self._next.subscriptions):
            return
        old, new, held = self._publisher, self._next, ExitStack()
        with self._lock:
            if self._place[0] == ffi.NULL:
                return
            held.enter_context(new.handle)
            self._library.fm_relay_publish_with(
                self._place[0], self._middleware.handle(new))
            self._publisher, self._next = new, None
            self._held, before = held, self._held
        before.close()
        old.close()

    def _drop_next(self) -> None:
        if self._next is not None:
            self._next.close()
            self._next = None

    def look_for_others(self) -> None:
        found = offers_on(self._node, self._gate.target)
        if found is not None:
            self._target.look(found)
            self._others = self._target.others

    def add(self, subscription: RclSubscription) -> None:
        if not self._call('add', self._middleware.handle(subscription)):
            raise Unavailable('the middleware has no callback for new messages, or there are '
                              'eight subscriptions already')

    def retire(self, subscription: RclSubscription) -> None:
        self._call('retire', self._middleware.handle(subscription))

    def remove(self, subscription: RclSubscription) -> bool:
        """Take what is waiting, then no more; return whether it may be destroyed."""
        return self._call('remove', self._middleware.handle(subscription)) in (None, True)

    def end(self) -> None:
        """End the thread; a second call does nothing."""
        self._call('end')
        native_lifetimes.release(self)

    def close(self) -> None:
        """End the thread, and withdraw the target; the subscriptions were removed before."""
        super().close()
        self._drop_next()
        self._publisher.close()


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
        if subscription.qos_profile.durability is DurabilityPolicy.TRANSIENT_LOCAL:
            self._relay.follow(is_durable=True)
        self._receiver = RelayReceiver(self._relay, subscription)
        return self._receiver

    def review(self, publishers: Sequence[Offer]) -> None:
        """Offer what the publishers of the source offer; look for others on the target."""
        self._relay.review()
        if self._receiver is not None:
            self._receiver.start()
        self._relay.look_for_others()
        if publishers:
            self._relay.follow(is_durable=any(item.is_durable for item in publishers))

    @property
    def is_settled(self) -> bool:
        return self._relay.is_settled


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

    def start(self, *, may_wait: bool = True) -> None:
        """Start taking, unless that has to wait."""
        if not self._is_added and not (may_wait and self._relay.is_changing):
            self._relay.add(self._subscription)
            self._is_added = True

    def retire(self) -> None:
        self.start(may_wait=False)
        self._relay.retire(self._subscription)

    def stop(self) -> None:
        if self._is_added and not self._is_leaked and \
                not self._relay.remove(self._subscription):
            self._is_leaked = True  # the middleware may still call back
            native_lifetimes.keep_forever(self)
        if not self._is_leaked:
            self._held.close()
