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
Pairs violations with their details, which arrive on a topic of their own.

A violation is published at once and its detail when it is made, so either may arrive first.
Details come in the order of their violations. Each has the number of details suppressed before it,
and so the number of violations without a detail between two of them.

That a violation is over comes as a detail only. It is held until the violations of its requirement
that came before it were returned.
"""

from collections import deque
from dataclasses import dataclass, field
from itertools import islice

from fret_monitor.runtime.reporting import ReceivedDetail

WAIT_S = 0.3
_TOGETHER_NS = int(WAIT_S * 1e9)
_MOST_DETAILS = 1000  # of a requirement, waiting for their violations


@dataclass(eq=False)
class ReceivedViolation:
    """A violation of a requirement (its id), as received; times in nanoseconds."""

    requirement: str
    received: int
    sent: int
    due: float  # s, on the monotonic clock: it is reported then at the latest
    detail: ReceivedDetail | None = None


@dataclass(frozen=True)
class ViolationEnd:
    """The end of a violation of a requirement (its id)."""

    requirement: str
    due: float  # s, as for a violation
    detail: ReceivedDetail


@dataclass(frozen=True)
class _WaitingDetail:
    detail: ReceivedDetail
    sent: int
    without: int | None  # violations without a detail before its own; None: not known


@dataclass
class _Stream:
    """Violations and details of one requirement that have no partner yet, oldest first."""

    violations: deque[ReceivedViolation] = field(default_factory=deque)
    details: deque[_WaitingDetail] = field(default_factory=lambda: deque(maxlen=_MOST_DETAILS))
    suppressed: int | None = None  # as in the last detail
    passed: int = 0  # violations without a detail since the last pair
    held: int = 0  # violations not yet returned
    recoveries: deque[ViolationEnd] = field(default_factory=lambda: deque(maxlen=_MOST_DETAILS))


class Pairing:
    """
    Holds violations until their details have arrived, and returns them in order.

    Not thread-safe.
    """

    def __init__(self) -> None:
        self._violations: deque[ReceivedViolation] = deque()
        self._streams: dict[str, _Stream] = {}

    def __len__(self) -> int:
        """Return the number of violations held."""
        return len(self._violations)

    def add_violation(self, requirement: str, received: int, sent: int, now: float) -> None:
        """Add a violation; `now` is on the monotonic clock."""
        violation = ReceivedViolation(requirement, received, sent, now + WAIT_S)
        self._violations.append(violation)
        stream = self._streams.setdefault(requirement, _Stream())
        stream.violations.append(violation)
        stream.held += 1
        self._pair(stream)

    def add_detail(self, requirement: str, detail: ReceivedDetail, sent: int) -> None:
        """Add a detail, by the time at which it was sent (ns)."""
        stream = self._streams.setdefault(requirement, _Stream())
        before, stream.suppressed = stream.suppressed, detail.suppressed
        # A smaller count is that of a monitor that was started again.
        is_known = before is not None and detail.suppressed >= before
        without = detail.suppressed - before if before is not None and is_known else None
        stream.details.append(_WaitingDetail(detail, sent, without))
        self._pair(stream)

    def add_recovery(self, requirement: str, detail: ReceivedDetail, now: float) -> None:
        """Add the end of a violation; `now` is on the monotonic clock."""
        stream = self._streams.setdefault(requirement, _Stream())
        stream.recoveries.append(ViolationEnd(requirement, now + WAIT_S, detail))

    def take(self, now: float) -> ReceivedViolation | ViolationEnd | None:
        """Return the next violation or recovery that need not wait any longer."""
        for stream in self._streams.values():
            if stream.recoveries and self._is_next(stream, now):
                return stream.recoveries.popleft()
        if not self._violations:
            return None
        first = self._violations[0]
        if first.detail is None and first.due > now:
            return None
        stream = self._streams[first.requirement]
        if stream.violations and stream.violations[0] is first:
            stream.violations.popleft()
            stream.passed += 1
        stream.held -= 1
        return self._violations.popleft()

    def _is_next(self, stream: _Stream, now: float) -> bool:
        """Whether the first recovery of a stream comes before the violations that are held."""
        recovery = stream.recoveries[0]
        if not stream.held:
            # A detail is there whose violation may still come.
            return not stream.details or recovery.due <= now
        first = self._violations[0]
        return first.requirement == recovery.requirement and first.detail is not None \
            and first.detail.stamp > recovery.detail.stamp

    @property
    def next_due(self) -> float | None:
        """When `take` may return something next, on the monotonic clock; None if nothing waits."""
        due = [stream.recoveries[0].due for stream in self._streams.values()
               if stream.recoveries and not stream.held]
        return min([*due, *(item.due for item in islice(self._violations, 1))], default=None)

    def _pair(self, stream: _Stream) -> None:
        while stream.details and stream.violations:
            waiting = stream.details[0]
            if waiting.without is not None and stream.passed > waiting.without:
                stream.details.popleft()  # its violation was reported without it
                stream.passed -= waiting.without + 1
            elif waiting.sent < stream.violations[0].sent - _TOGETHER_NS:
                stream.details.popleft()  # its violation was lost
                stream.passed = 0
            elif stream.violations[0].sent < waiting.detail.stamp:  # it is of an earlier step
                stream.violations.popleft()  # its detail was lost, or suppressed
                if waiting.without is not None and stream.passed < waiting.without:
                    stream.passed += 1
            elif waiting.without is None and len(stream.violations) > 1:
                # Any of them may be its own: claim none, and start over with the next detail.
                stream.details.clear()
                stream.suppressed = None
            elif waiting.without is not None and stream.passed < waiting.without:
                stream.violations.popleft()  # its detail was suppressed
                stream.passed += 1
            else:
                stream.details.popleft()
                self._settle(stream, waiting)

    def _settle(self, stream: _Stream, waiting: _WaitingDetail) -> None:
        violation = stream.violations.popleft()
        stream.passed = 0
        # A violation is sent about when its detail is.
        if abs(violation.sent - waiting.sent) <= _TOGETHER_NS:
            violation.detail = waiting.detail
