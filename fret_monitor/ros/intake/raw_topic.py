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
Topics whose messages Python takes through rclpy, for nodes without an engine (the logger).

The feed's thread takes them: rclpy's executor needs 70 us for a message. Those that wait together
are delivered in the order of the middleware's reception times.

rclpy does not give the publisher of a message. Losses, which show as gaps in the sequence numbers,
are therefore counted only while there is one publisher.
"""

from collections import OrderedDict
from collections.abc import Callable, Sequence, Set
from heapq import merge
from itertools import islice
from threading import Event
from time import time_ns
from typing import Any, NamedTuple

from fret_monitor.ros.intake.rcl_subscription import RclSubscription

from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo

_WAIT_NS = 200_000_000  # a wait without a timeout could outlast a shutdown
_MOST_AT_ONCE = 1000  # messages taken of a subscription before others have their turn
_MOST_KEYS = 4096  # of the last messages in a handover
_NONE = 2**64 - 1  # RMW_MESSAGE_INFO_SEQUENCE_NUMBER_UNSUPPORTED

# Takes a serialized message, its reception time and its sender's time (ns), in the feed's thread.
Deliver = Callable[[bytes, int, int], None]


class Record(NamedTuple):
    """
    A serialized message that was taken, and is to be delivered.

    `received` is the middleware's time of reception, `sent` the time of its publisher (ns);
    `sequence` its number.
    """

    data: bytes
    received: int
    sent: int
    sequence: int


class RawIntake:
    """Takes the messages of raw topics, in the feed's thread."""

    def __init__(self, node: Node) -> None:
        """Take nothing yet."""
        self._node = node
        self._receivers: list[_RawReceiver] = []
        self._guard = _rclpy.GuardCondition(node.context.handle)
        self._wait_set: Any = None  # None: to be made for the present receivers
        self._ended = Event()

    def add(self, receiver: '_RawReceiver') -> None:
        """Take from a receiver, too."""
        self._receivers.append(receiver)
        self._wait_set = None

    def remove(self, receiver: '_RawReceiver') -> None:
        """Take no more from a receiver."""
        self._receivers.remove(receiver)
        self._wait_set = None

    def take(self) -> None:
        """Wait for messages, at most 0.2 s, and deliver those that wait, oldest first."""
        self._wait()
        batches = [[(record, item) for record in item.waiting()] for item in self._receivers]
        for record, receiver in merge(*batches, key=lambda taken: taken[0].received):
            self.deliver(receiver.topic, record)

    def deliver(self, topic: 'RawTopic', record: Record) -> None:
        """Deliver a message, unless this has ended."""
        if not self._ended.is_set():
            topic.deliver(record)

    def _wait(self) -> None:
        if self._wait_set is None:
            self._wait_set = _rclpy.WaitSet(
                len(self._receivers), 1, 0, 0, 0, 0, self._node.context.handle)
        # rcl removes from the set what is not ready, so everything is added again.
        self._wait_set.clear_entities()
        for receiver in self._receivers:
            self._wait_set.add_subscription(receiver.handle)
        self._wait_set.add_guard_condition(self._guard)
        self._wait_set.wait(_WAIT_NS)

    def end(self) -> None:
        """Deliver no more, and end a wait."""
        if not self._ended.is_set():
            self._ended.set()
            self._guard.trigger_guard_condition()

    def close(self) -> None:
        """Release what waits need."""
        self._guard.destroy_when_not_in_use()


class RawTopic:
    """Delivers the serialized messages of a topic to a callback."""

    def __init__(self, intake: RawIntake, deliver: Deliver) -> None:
        """Take the callback, which is called in the thread of the intake."""
        self._intake = intake
        self._deliver = deliver
        self._gaps = Gaps()
        self._received: Keys | None = None  # during a handover

    def open(self, subscription: RclSubscription) -> '_RawReceiver':
        """Start taking the messages of a subscription."""
        return _RawReceiver(self._intake, self, subscription)

    def deliver(self, record: Record) -> None:
        """Call the callback, unless the message was received before during this handover."""
        if self._received is not None and self._received.has_or_adds(record):
            return
        self._gaps.note(record.sequence)
        self._deliver(record.data, record.received, record.sent)

    def review(self, publishers: Sequence[TopicEndpointInfo]) -> None:
        """Count the losses since the last call, if there is one publisher."""
        self._gaps.confirm({bytes(item.endpoint_gid) for item in publishers})

    def begin_handover(self, *, has_history: bool) -> None:
        """Drop duplicates from now on, but no history; treat the next message as the first."""
        self._received = self._received or Keys()
        self._gaps.restart()

    def end_handover(self) -> None:
        """Expect no duplicates any more: the old subscription is closed."""
        self._received = None

    @property
    def lost(self) -> int:
        """Messages lost: gaps in the numbers of a single publisher."""
        return self._gaps.lost


class _RawReceiver:

    def __init__(self, intake: RawIntake, topic: RawTopic, subscription: RclSubscription) -> None:
        self.topic = topic
        self._intake = intake
        self._subscription = subscription
        intake.add(self)

    @property
    def handle(self) -> Any:
        return self._subscription.handle

    def waiting(self) -> list[Record]:
        return list(islice(iter(self._take, None), _MOST_AT_ONCE))

    def _take(self) -> Record | None:
        item = self._subscription
        taken: Any = item.handle.take_message(item.msg_type, True)
        if taken is None:
            return None
        data, info = taken
        return Record(data, info['received_timestamp'] or time_ns(), info['source_timestamp'],
                      info['publication_sequence_number'])

    def drain(self) -> None:
        for record in self.waiting():
            self._intake.deliver(self.topic, record)

    def stop(self) -> None:
        self._intake.remove(self)

    def retire(self) -> None:
        """Do nothing."""


class Keys:
    """
    What identifies the last messages of a topic: the time and number that its publisher gave it.

    Without the publisher's gid the number alone is not enough.
    """

    def __init__(self) -> None:
        """Start without a message."""
        self._keys: OrderedDict[tuple[int, int], None] = OrderedDict()

    def has_or_adds(self, record: Record) -> bool:
        """Return whether the message is among them, and add it; False if it has no time."""
        key = record.sent, record.sequence
        if key in self._keys:
            return True
        if record.sent:
            self._keys[key] = None
        if len(self._keys) > _MOST_KEYS:
            self._keys.popitem(last=False)
        return False


class Gaps:
    """Counts the gaps in the sequence numbers of a single publisher."""

    def __init__(self) -> None:
        """Start without a publisher and without a message."""
        self.lost = 0
        self._unconfirmed = 0
        self._last: int | None = None
        self._publishers: Set[bytes] = frozenset()

    def note(self, number: int) -> None:
        """Note the sequence number of a received message."""
        if not 0 < number < _NONE:
            return
        if self._last is not None:
            self._unconfirmed += max(0, number - self._last - 1)
        self._last = max(number, self._last or 0)

    def confirm(self, publishers: Set[bytes]) -> None:
        """
        Count the gaps since the last call as losses, or drop them.

        They count if there is one publisher, the same as at the last call. `publishers` holds the
        gids of the present ones.
        """
        if publishers == self._publishers and len(publishers) == 1:
            self.lost += self._unconfirmed
            self._unconfirmed = 0
        else:
            self.restart()
        self._publishers = publishers

    def restart(self) -> None:
        """Treat the next message as the first; drop the gaps that were not confirmed."""
        self._last = None
        self._unconfirmed = 0
