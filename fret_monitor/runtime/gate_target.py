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
A wrapper of `csrc/reporting/gate_target.h`: the decisions about what a gate publishes on.

C decides with which durability, when the publisher is replaced, and who else publishes there.
"""

from collections.abc import Sequence
from time import monotonic_ns
from typing import Any

from fret_monitor.native import LibraryError
from fret_monitor.native.binding import ffi
from fret_monitor.runtime.subscription import c_offers, Offer


class GateTarget:
    """
    The state of a gate's publisher. Not thread-safe; times are in nanoseconds.

    Decisions are those of C: a `struct fm_target_decision`.
    """

    def __init__(self, library: Any, node: str, depth: int) -> None:
        """
        Begin with a volatile publisher; `library` has the functions of csrc.

        `node` is the full name of the node; `depth` is what the bundle fixes, 0: the default.
        """
        self._library = library
        self._pointer: Any = ffi.gc(
            library.fm_gate_target_create(node.encode(), depth), library.fm_gate_target_destroy)
        if self._pointer == ffi.NULL:
            raise LibraryError('memory is short')

    @property
    def first(self) -> Any:
        """What the first publisher offers."""
        return self._library.fm_gate_target_first(self._pointer)

    def note(self, gid: bytes) -> None:
        """Note the identity of a publisher that the node has made."""
        self._library.fm_gate_target_note(self._pointer, gid)

    def follow(self, *, is_durable: bool, now: int | None = None) -> Any:
        """Decide how to publish with a durability from now on."""
        return self._library.fm_gate_target_follow(
            self._pointer, is_durable, monotonic_ns() if now is None else now)

    def fail(self) -> None:
        """Note that the next publisher could not be made."""
        self._library.fm_gate_target_fail(self._pointer)

    def review(self, matched: int, next_matched: int, now: int | None = None) -> bool:
        """Return whether to use the next publisher; both have matched so many subscriptions."""
        return bool(self._library.fm_gate_target_review(
            self._pointer, matched, next_matched, monotonic_ns() if now is None else now))

    def look(self, offers: Sequence[Offer]) -> None:
        """Note the publishers on the target, the node's own among them."""
        found, _kept = c_offers(offers)
        self._library.fm_gate_target_look(self._pointer, found, len(offers))

    @property
    def others(self) -> str:
        """Who else publishes on the target: names with commas; empty: nobody."""
        text: Any = ffi.string(self._library.fm_gate_target_others(self._pointer))
        return str(text.decode())

    @property
    def is_settled(self) -> bool:
        """Whether the next look can wait until the graph changes."""
        return bool(self._library.fm_gate_target_is_settled(self._pointer))
