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
Topics whose messages Python takes, for nodes without an engine (the logger).

The feed's thread takes them: rclpy's executor needs 70 us for a message. Those that wait together
are delivered in the order of the middleware's reception times. Which are repeated, and which were
lost, is decided as an engine does (`csrc/engine/handover.h`).
"""

from collections.abc import Callable
from contextlib import ExitStack
from heapq import merge
from itertools import islice
from threading import Event
from time import time_ns
from typing import Any, NamedTuple

from fret_monitor.native.binding import ffi
from fret_monitor.ros.intake.feed import Topic
from fret_monitor.ros.intake.hot_path import Middleware
from fret_monitor.ros.intake.rcl_endpoint import RclSubscription
from fret_monitor.ros.intake.symbols import Unavailable
from fret_monitor.ros.settings.parameters import Refusal


_MOST_AT_ONCE = 1000  # messages taken of a subscription before others have their turn

# Takes a serialized message, its reception time and its sender's time (ns), in the feed's thread.
Deliver = Callable[[bytes, int, int], None]


class Record(NamedTuple):
    """
    A serialized message that was taken, and is to be delivered.

    `received` is the middleware's time of reception, `sent` the time of its publisher (ns);
    `sequence` its number, counted by the publisher `gid`; `is_retired`: by a subscription that is
    being replaced.
    """

    data: bytes
    received: int
    sent: int
    sequence: int
    gid: bytes
    is_retired: bool


class RawIntake:
    """Takes the messages of raw topics, in the feed's thread."""

    def __init__(self) -> None:
        """Take nothing yet."""
        self.library: Any = None
        self._receivers: list[_RawReceiver] = []
        self._ended = Event()

    def prepare(self, library: Any) -> None:
        """
        Look up what takes messages; `library` has the functions of csrc.

        Raises
        ------
        Refusal
            if the middleware lacks a function.
        """
        self.library = library
        try:
            self.middleware = Middleware(may_take=False)
        except Unavailable as found:
            raise Refusal(f'cannot use the middleware: {found}') from None

    def add(self, receiver: '_RawReceiver') -> None:
        """Take from a receiver, too."""
        self._receivers.append(receiver)

    def remove(self, receiver: '_RawReceiver') -> None:
        """Take no more from a receiver."""
        self._receivers.remove(receiver)

    @property
    def handles(self) -> list[Any]:
        """The handles of the subscriptions that messages are taken from."""
        return [receiver.handle for receiver in self._receivers]

    def take(self) -> None:
        """Deliver the messages that wait, oldest first."""
        batches = [[(record, item) for record in item.waiting()] for item in self._receivers]
        for record, receiver in merge(*batches, key=lambda taken: taken[0].received):
            self.deliver(receiver.topic, record)

    def deliver(self, topic: 'RawTopic', record: Record) -> None:
        """Deliver a message, unless this has ended."""
        if not self._ended.is_set():
            topic.deliver(record)

    def end(self) -> None:
        """Deliver no more."""
        self._ended.set()


class RawTopic(Topic):
    """Delivers the serialized messages of a topic to a callback."""

    def __init__(self, intake: RawIntake, deliver: Deliver) -> None:
        """Take the callback, which is called in the thread of the intake, once it is prepared."""
        self._intake = intake
        self._library = intake.library
        self._deliver = deliver
        self._arrivals: Any = ffi.gc(
            ffi.new('struct fm_arrivals *'), intake.library.fm_arrivals_end_handover)

    def open(self, subscription: RclSubscription) -> '_RawReceiver':
        """Start taking the messages of a subscription."""
        return _RawReceiver(self._intake, self, subscription)

    def deliver(self, record: Record) -> None:
        """Call the callback, unless the message was received before during this handover."""
        gid = ffi.from_buffer('uint8_t[]', record.gid)
        origin = ffi.new('struct fm_origin *', (
            record.received, record.sent, record.sequence, gid, record.is_retired))
        if not self._library.fm_arrivals_is_repeated(self._arrivals, origin):
            self._library.fm_arrivals_note(self._arrivals, origin)
            self._deliver(record.data, record.received, record.sent)

    def begin_handover(self, *, has_history: bool) -> None:
        """Drop duplicates from now on; with `has_history` also history that was sent earlier."""
        self._library.fm_arrivals_begin_handover(self._arrivals, has_history)

    def end_handover(self) -> None:
        """Expect no duplicates any more: the old subscription is closed."""
        self._library.fm_arrivals_end_handover(self._arrivals)

    @property
    def lost(self) -> int:
        """Messages lost: sent, and not received by any subscription of the topic."""
        return int(self._library.fm_arrivals_lost(self._arrivals))


class _RawReceiver:

    def __init__(self, intake: RawIntake, topic: RawTopic, subscription: RclSubscription) -> None:
        self.topic = topic
        self._intake = intake
        self._is_retired = False
        self._message: Any = ffi.gc(
            ffi.new('struct fm_serialized *'), intake.library.fm_free_serialized)
        self._info: Any = ffi.new('struct fm_padded_info *')
        self._held = ExitStack()
        self._held.enter_context(subscription.handle)
        self.handle = subscription.handle
        self._pointer = intake.middleware.subscription(subscription)
        intake.add(self)

    def waiting(self) -> list[Record]:
        return list(islice(iter(self._take, None), _MOST_AT_ONCE))

    def _take(self) -> Record | None:
        result, info = ffi.integer_const('FM_DROPPED'), self._info.info
        while result == ffi.integer_const('FM_DROPPED'):
            result = self._intake.library.fm_take_serialized(
                self._intake.middleware.functions, self._pointer, self._message, self._info)
        if result != ffi.integer_const('FM_TAKEN'):
            return None
        return Record(
            bytes(ffi.buffer(self._message.buffer, self._message.length)),
            info.received_timestamp or time_ns(), info.source_timestamp,
            info.publication_sequence_number, bytes(ffi.buffer(info.gid)), self._is_retired)

    def stop(self) -> None:
        with ExitStack() as last:
            last.callback(self._held.close)
            last.callback(self._intake.remove, self)
            for record in self.waiting():
                self._intake.deliver(self.topic, record)

    def retire(self) -> None:
        self._is_retired = True
