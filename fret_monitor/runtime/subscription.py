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
A wrapper of `csrc/reporting/subscription.h`: the decisions of a subscription. Without ROS.

C decides which quality of service a subscription requests, when it is replaced, and what the log
says of its publishers.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from fret_monitor.model.policies import fixed_qos
from fret_monitor.native import LibraryError
from fret_monitor.native.binding import ffi
from fret_monitor.runtime.reporting import Lines, LogLine, TopicFacts

DEFAULT_DEPTH: int = ffi.integer_const('FM_USUAL_DEPTH')

LOOKS_AT_ONCE: int = ffi.integer_const('FM_LOOKS_AT_ONCE')
"""For the publishers of how many topics a node looks, every `LOOK_PERIOD_S`, while any is due."""

LOOK_DELAY_S: float = ffi.integer_const('FM_LOOK_DELAY_NS') / 1e9
"""From a change of the graph until the first look."""

LOOK_PERIOD_S: float = ffi.integer_const('FM_LOOK_PERIOD_NS') / 1e9

LOOK_AGAIN_S: float = ffi.integer_const('FM_LOOK_AGAIN_NS') / 1e9
"""After which a node looks for all publishers although the graph has not changed."""


class Offer(NamedTuple):
    """A publisher, as discovered: its gid, its node, its type, and what it offers."""

    gid: bytes
    node: str
    namespace: str
    message_type: str
    is_reliable: bool
    is_durable: bool


@dataclass(frozen=True)
class Request:
    """The quality of service of a subscription; `is_durable`: transient local."""

    is_reliable: bool
    is_durable: bool
    keeps_all: bool
    depth: int


@dataclass(frozen=True)
class Decision:
    """
    What is to be done, in this order.

    `n_ended`: close so many of the replaced subscriptions, the oldest; `ends_handover`: expect no
    message twice; `request`: replace the present subscription by one with this quality of service.
    """

    n_ended: int
    ends_handover: bool
    request: Request | None


class SubscriptionState:
    """The state of the subscription to a topic. Not thread-safe; times are in nanoseconds."""

    def __init__(self, library: Any, topic: str, message_type: str,
                 fixed: Mapping[str, str | int]) -> None:
        """
        Begin without a publisher; `library` has the functions of csrc, `topic` is the full name.

        `fixed` has the policies that do not follow the publishers: `reliability` (reliable,
        best_effort), `durability` (volatile, transient_local), `history` (keep_last, keep_all),
        `depth`.
        """
        self._library = library
        *choices, depth = fixed_qos(fixed)
        self._pointer = ffi.gc(library.fm_subscription_create(
            topic.encode(), message_type.encode(), ffi.new('struct fm_fixed_qos *', [
                *map(ffi.integer_const, choices), depth])), library.fm_subscription_destroy)
        if self._pointer == ffi.NULL:
            raise LibraryError('memory is short')
        self._lines = Lines(library)

    def begin(self, offers: Sequence[Offer], now: int) -> None:
        """Before subscribing: request what the publishers of a topic offer that was found."""
        array, _kept = c_offers(offers)
        self._library.fm_subscription_begin(self._pointer, array, len(offers), now)

    def is_abandoned(self, now: int) -> bool:
        """Whether there has been no publisher for long."""
        return bool(self._library.fm_subscription_is_abandoned(self._pointer, now))

    @property
    def request(self) -> Request:
        """The quality of service of the present subscription."""
        return _request(self._library.fm_subscription_request(self._pointer))

    def decide(self, offers: Sequence[Offer], matched: int, now: int) -> Decision:
        """Decide what to do; `matched` is the number of publishers that are matched."""
        array, _kept = c_offers(offers)
        found = self._library.fm_subscription_decide(
            self._pointer, array, len(offers), matched, now)
        return Decision(found.n_ended, found.ends_handover,
                        _request(found.request) if found.subscribes else None)

    def conclude(self, problem: str | None, lost: int, now: int) -> list[LogLine]:
        """
        Note that it is done, or why subscribing failed; return what is to be logged.

        `lost` is the number of messages that the topic has lost.
        """
        self._library.fm_subscription_conclude(
            self._pointer, ffi.NULL if problem is None else ffi.new('char[]', problem.encode()),
            lost, now, self._lines.pointer)
        return self._lines.take()

    def is_settled(self, lost: int) -> bool:
        """Whether the next look can wait until the graph changes; `lost` as in `conclude`."""
        return bool(self._library.fm_subscription_is_settled(self._pointer, lost))

    @property
    def publishers(self) -> TopicFacts:
        """The publishers at the last review."""
        found = self._library.fm_subscription_publishers(self._pointer)
        texts: list[Any] = [ffi.string(text) for text in (found.other_types, found.unmatched)]
        return TopicFacts(found.n, *(text.decode() for text in texts))


def c_offers(offers: Sequence[Offer]) -> tuple[Any, Any]:
    """Return an array of `struct fm_offer`, and what has to live as long."""
    texts = [[ffi.new('char[]', text.encode()) for text in offer[1:4]] for offer in offers]
    return ffi.new('struct fm_offer[]', [
        (offer.gid, *kept, offer.is_reliable, offer.is_durable)
        for offer, kept in zip(offers, texts)]), texts


def _request(found: Any) -> Request:
    return Request(found.is_reliable, found.is_durable, found.keeps_all, found.depth)
