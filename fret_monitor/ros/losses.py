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
Count message loss (docs/ros.md, Topics).

C counts the gaps in the sequence numbers of each publisher (`csrc/handover.h`). Where Python takes
the messages, rclpy does not give their publisher, so gaps are counted only while there is
one publisher. The middleware may count losses too: Fast DDS counts messages that the network
dropped, but none from a queue overflow.
"""

from collections.abc import Set
from typing import Any

from fret_monitor.ros.rcl_subscription import RclSubscription

from rclpy.event_handler import QoSSubscriptionEventType, UnsupportedEventTypeError
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy

_NONE = 2**64 - 1  # RMW_MESSAGE_INFO_SEQUENCE_NUMBER_UNSUPPORTED


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


class ReportedLosses:
    """The middleware's count of messages lost by a subscription; 0 if it does not count."""

    def __init__(self, subscription: RclSubscription) -> None:
        """Start counting; close this before the subscription is destroyed."""
        self._event: Any = None
        with subscription.handle:
            try:
                self._event = _rclpy.EventHandle(
                    subscription.handle, QoSSubscriptionEventType.RCL_SUBSCRIPTION_MESSAGE_LOST)
            except UnsupportedEventTypeError:
                pass

    def total(self) -> int:
        """Return how many messages were lost so far."""
        if self._event is None:
            return 0
        with self._event:
            status = self._event.take_event()
        return 0 if status is None else int(status.total_count)

    def close(self) -> None:
        """Stop counting."""
        if self._event is not None:
            self._event.destroy_when_not_in_use()
            self._event = None
