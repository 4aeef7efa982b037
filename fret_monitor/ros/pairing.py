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
Match violations with their details, which are received on another topic.

Two threads publish them, so either may be received first. A violation waits up to `WAIT_S` for its
detail, and is then reported without one.
"""

from collections import deque
from dataclasses import dataclass

from fret_monitor.ros.details import Detail

WAIT_S = 0.3
_TOGETHER_NS = int(WAIT_S * 1e9)
_ROUNDING_NS = 1000  # error of a stamp, which is a float in seconds
_MOST_DETAILS = 1000  # per requirement, kept until their violations are received


@dataclass
class ReceivedViolation:
    """A violation of a requirement (its id), as received; times in nanoseconds."""

    requirement: str
    received: int
    sent: int
    due: float  # s, on the monotonic clock: reported then at the latest
    detail: Detail | None = None


class Pairing:
    """
    Holds violations until their details are received, and returns them in order.

    Not thread-safe.
    """

    def __init__(self) -> None:
        """Start empty."""
        self._violations: deque[ReceivedViolation] = deque()
        self._details: dict[str, deque[tuple[Detail, int]]] = {}

    def add_violation(self, requirement: str, received: int, sent: int, now: float) -> None:
        """Add a violation; `now` is on the monotonic clock."""
        violation = ReceivedViolation(requirement, received, sent, now + WAIT_S)
        details = self._details.get(requirement, deque())
        for place, (detail, detail_sent) in enumerate(details):
            if _belong_together(violation, detail, detail_sent):
                violation.detail = detail
                for _ in range(place + 1):  # older details are of violations that were lost
                    details.popleft()
                break
        self._violations.append(violation)

    def add_detail(self, requirement: str, detail: Detail, sent: int) -> None:
        """Add a detail; `sent` is the time at which it was sent (ns)."""
        for violation in self._violations:
            if violation.requirement == requirement and violation.detail is None \
                    and _belong_together(violation, detail, sent):
                violation.detail = detail
                return
        self._details.setdefault(requirement, deque(maxlen=_MOST_DETAILS)).append((detail, sent))

    def take(self, now: float) -> ReceivedViolation | None:
        """Return the next violation if it has its detail or is due; None otherwise."""
        if self._violations and (self._violations[0].detail is not None
                                 or self._violations[0].due <= now):
            return self._violations.popleft()
        return None

    @property
    def next_due(self) -> float | None:
        """When the next violation is due, on the monotonic clock; None if there is none."""
        return self._violations[0].due if self._violations else None


def _belong_together(violation: ReceivedViolation, detail: Detail, detail_sent: int) -> bool:
    """Return whether both were sent within `WAIT_S`, the violation after the detail's stamp."""
    return abs(violation.sent - detail_sent) <= _TOGETHER_NS \
        and violation.sent >= detail.stamp * 1e9 - _ROUNDING_NS
