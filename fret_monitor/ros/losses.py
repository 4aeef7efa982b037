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
Messages of a topic that were sent and never received (docs/ros.md, Topics).

C counts what each publisher left out of its numbers (`csrc/losses.h`). Where Python takes the
messages it is not told whose they are, and counts for a single publisher only. The middleware may
tell of losses too: Fast DDS does of what the network dropped, not of a queue that overflowed.
"""

from collections.abc import Set
from typing import Any

from fret_monitor.ros.rcl_subscription import RclSubscription

from rclpy.event_handler import QoSSubscriptionEventType, UnsupportedEventTypeError
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy

_NONE = 2**64 - 1  # RMW_MESSAGE_INFO_SEQUENCE_NUMBER_UNSUPPORTED


class Gaps:
    """Counts the numbers that a single publisher left out."""

    def __init__(self) -> None:
        """Start with nothing known."""
        self.lost = 0
        self._unconfirmed = 0
        self._last: int | None = None
        self._publishers: Set[bytes] = frozenset()

    def note(self, number: int) -> None:
        """Take the number of a message that has come."""
        if not 0 < number < _NONE:
            return
        if self._last is not None:
            self._unconfirmed += max(0, number - self._last - 1)
        self._last = max(number, self._last or 0)

    def confirm(self, publishers: Set[bytes]) -> None:
        """
        Take who publishes now.

        What was left out since the last time counts if that was one publisher, and is it still.
        """
        if publishers == self._publishers and len(publishers) == 1:
            self.lost += self._unconfirmed
            self._unconfirmed = 0
        else:
            self.restart()
        self._publishers = publishers

    def restart(self) -> None:
        """Take the next message for the first one; what was not confirmed is forgotten."""
        self._last = None
        self._unconfirmed = 0


class ReportedLosses:
    """What the middleware says was lost of a subscription; nothing where it does not say."""

    def __init__(self, subscription: RclSubscription) -> None:
        """Ask for it; to be closed before the subscription is destroyed."""
        self._event: Any = None
        with subscription.handle:
            try:
                self._event = _rclpy.EventHandle(
                    subscription.handle, QoSSubscriptionEventType.RCL_SUBSCRIPTION_MESSAGE_LOST)
            except UnsupportedEventTypeError:
                pass

    def total(self) -> int:
        """Return how many were lost so far."""
        if self._event is None:
            return 0
        with self._event:
            status = self._event.take_event()
        return 0 if status is None else int(status.total_count)

    def close(self) -> None:
        """Ask no more."""
        if self._event is not None:
            self._event.destroy_when_not_in_use()
            self._event = None
