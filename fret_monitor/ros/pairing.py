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
Violations and their details, which come on topics of their own, put together.

A violation is published at once and its detail when it is made, so either may come first. A
violation waits for its detail for a moment, and is reported without one after that.
"""

from collections import deque
from dataclasses import dataclass

from fret_monitor.ros.details import Detail

WAIT_S = 0.3
_TOGETHER_NS = int(WAIT_S * 1e9)
_ROUNDING_NS = 1000  # a stamp is a float of seconds
_MOST_DETAILS = 1000  # of a requirement, waiting for their violations


@dataclass
class ReceivedViolation:
    """A violation of a requirement (its id), as received; times in nanoseconds."""

    requirement: str
    received: int
    sent: int
    due: float  # s, on the monotonic clock: it is reported then at the latest
    detail: Detail | None = None


class Pairing:
    """
    Holds violations until their details are there, and gives them back in order.

    Not thread-safe.
    """

    def __init__(self) -> None:
        """Hold nothing."""
        self._violations: deque[ReceivedViolation] = deque()
        self._details: dict[str, deque[tuple[Detail, int]]] = {}

    def add_violation(self, requirement: str, received: int, sent: int, now: float) -> None:
        """Add a violation; `now` is on the monotonic clock."""
        violation = ReceivedViolation(requirement, received, sent, now + WAIT_S)
        details = self._details.get(requirement, deque())
        for place, (detail, detail_sent) in enumerate(details):
            if _belong_together(violation, detail, detail_sent):
                violation.detail = detail
                for _ in range(place + 1):  # what is older belongs to violations that were lost
                    details.popleft()
                break
        self._violations.append(violation)

    def add_detail(self, requirement: str, detail: Detail, sent: int) -> None:
        """Add a detail, by the time at which it was sent (ns)."""
        for violation in self._violations:
            if violation.requirement == requirement and violation.detail is None \
                    and _belong_together(violation, detail, sent):
                violation.detail = detail
                return
        self._details.setdefault(requirement, deque(maxlen=_MOST_DETAILS)).append((detail, sent))

    def take(self, now: float) -> ReceivedViolation | None:
        """Return the next violation, if it has its detail or has waited long enough."""
        if self._violations and (self._violations[0].detail is not None
                                 or self._violations[0].due <= now):
            return self._violations.popleft()
        return None

    @property
    def next_due(self) -> float | None:
        """When the next violation is due, on the monotonic clock; None if there is none."""
        return self._violations[0].due if self._violations else None


def _belong_together(violation: ReceivedViolation, detail: Detail, detail_sent: int) -> bool:
    """Return whether both were sent at about the same time, the violation after what it is of."""
    return abs(violation.sent - detail_sent) <= _TOGETHER_NS \
        and violation.sent >= detail.stamp * 1e9 - _ROUNDING_NS
