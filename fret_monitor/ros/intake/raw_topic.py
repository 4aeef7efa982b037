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


class Taken(NamedTuple):
    """A serialized message that is to be delivered; `origin` is a `struct fm_origin *`."""

    data: bytes
    origin: Any
    gid: Any  # to which `origin` points


class RawIntake:
    """Takes the messages of raw topics, in the feed's thread."""

    def __init__(self) -> None:
        self.library: Any = None
        self.receivers: list[_RawReceiver] = []
        self.ended = Event()

    def prepare(self, library: Any) -> None:
        """
        Look up what takes messages; `library` has the functions of csrc.

        Raises `Refusal` if the middleware lacks a function.
        """
        self.library = library
        try:
            self.middleware = Middleware(may_take=False)
        except Unavailable as found:
            raise Refusal(f'cannot use the middleware: {found}') from None

    @property
    def handles(self) -> list[Any]:
        return [receiver.handle for receiver in self.receivers]

    def take(self) -> None:
        """Deliver the messages that wait, oldest first."""
        batches = [[(taken, item.topic) for taken in item.waiting()] for item in self.receivers]
        for taken, topic in merge(*batches, key=lambda pair: pair[0].origin.received):
            topic.deliver(taken)

    def end(self) -> None:
        self.ended.set()


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
        return _RawReceiver(self._intake, self, subscription)

    def deliver(self, taken: Taken) -> None:
        """Call the callback, unless the message was received before during this handover."""
        origin = taken.origin
        if not self._intake.ended.is_set() and \
                not self._library.fm_arrivals_is_repeated(self._arrivals, origin):
            self._library.fm_arrivals_note(self._arrivals, origin)
            self._deliver(taken.data, origin.received, origin.sent)

    def begin_handover(self, *, has_history: bool) -> None:
        self._library.fm_arrivals_begin_handover(self._arrivals, has_history)

    def end_handover(self) -> None:
        self._library.fm_arrivals_end_handover(self._arrivals)

    @property
    def lost(self) -> int:
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
        self._pointer = intake.middleware.handle(subscription)
        intake.receivers.append(self)

    def waiting(self) -> list[Taken]:
        return list(islice(iter(self._take, None), _MOST_AT_ONCE))

    def _take(self) -> Taken | None:
        result, info = ffi.integer_const('FM_DROPPED'), self._info.info
        while result == ffi.integer_const('FM_DROPPED'):
            result = self._intake.library.fm_take_serialized(
                self._intake.middleware.functions, self._pointer, self._message, self._info)
        if result != ffi.integer_const('FM_TAKEN'):
            return None
        gid = ffi.from_buffer('uint8_t[]', bytes(ffi.buffer(info.gid)))
        return Taken(
            bytes(ffi.buffer(self._message.buffer, self._message.length)),
            ffi.new('struct fm_origin *', (
                info.received_timestamp or time_ns(), info.source_timestamp,
                info.publication_sequence_number, gid, self._is_retired)), gid)

    def stop(self) -> None:
        with ExitStack() as last:
            last.callback(self._held.close)
            last.callback(self._intake.receivers.remove, self)
            for taken in self.waiting():
                self.topic.deliver(taken)

    def retire(self) -> None:
        self._is_retired = True
