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
The monitor's own log of violations and their ends, at most a line a second for each requirement.

Details that C queues are what is logged; C may have suppressed some of them, or the queue may have
been full. The counters of the engine show that, so that no violation is left uncounted, and no
requirement out.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import monotonic

from fret_monitor.ros.details import Detail
from fret_monitor.ros.violation_lines import ViolationLines
from fret_monitor.runtime import RequirementCounts, ViolationDetail

LOGGED_PER_S = 10
"""Details of a requirement in a second while only the log reads them."""

_INTERVAL_S = 1.0


@dataclass
class _Logged:
    """What the log says of a requirement: its violations so far, and whether it is violated."""

    violations: int = 0
    is_violated: bool = False
    latest: ViolationDetail | None = None  # left out since the last line
    until: float | None = None  # s, monotonic: nothing is logged before; None: all is logged


class ViolationLog:
    """Logs the violations of a bundle. Not thread-safe."""

    def __init__(self, lines: Sequence[ViolationLines],
                 counts: Callable[[int], RequirementCounts],
                 describe: Callable[[ViolationDetail], Detail]) -> None:
        """
        Log with `lines`, one for each requirement.

        `counts` are those of the engine; `describe` makes of a detail what is logged.
        """
        self._lines = lines
        self._counts = counts
        self._describe = describe
        self._logged = [_Logged() for _ in lines]
        self._waiting: set[int] = set()  # requirements of which `until` is not None
        self._next_check: float | None = None  # s, monotonic; None: nothing new since the last

    def add(self, detail: ViolationDetail, now: float | None = None) -> None:
        """Log a violation or its end, or leave it to `review` if there was a line just now."""
        now = monotonic() if now is None else now
        if self._next_check is None:
            self._next_check = now + _INTERVAL_S
        requirement = detail.violation.requirement
        logged = self._logged[requirement]
        if logged.until is not None:
            logged.latest = detail
            return
        logged.violations += not detail.is_recovery
        self._log(requirement, detail, is_violated=not detail.is_recovery, left_out=0, now=now)

    def review(self, now: float | None = None) -> None:
        """Log what was left out, where a second has passed since the last line; call it often."""
        now = monotonic() if now is None else now
        for requirement in sorted(self._waiting):
            until = self._logged[requirement].until
            if until is not None and now >= until:
                self._settle(requirement, now)
        if self._next_check is not None and now >= self._next_check:
            self._next_check = None
            for requirement, logged in enumerate(self._logged):
                if logged.until is None:  # the queue was full, or its details were suppressed
                    self._settle(requirement, now)

    def end(self) -> None:
        """Log all that was left out."""
        self.review(float('inf'))

    def _settle(self, requirement: int, now: float) -> None:
        """Log the latest of what was left out, with its number, if there is any."""
        logged, counts = self._logged[requirement], self._counts(requirement)
        more, logged.violations = counts.announced - logged.violations, counts.announced
        latest = logged.latest
        if latest is None:  # there may be violations without details
            is_violated = not counts.holds and (more > 0 or logged.is_violated)
        else:
            is_violated = not latest.is_recovery
        if more > 0 or is_violated != logged.is_violated:
            is_shown = is_violated and latest is not None
            self._log(requirement, latest, is_violated=is_violated, left_out=more - is_shown,
                      now=now)
        else:
            logged.latest = logged.until = None
            self._waiting.discard(requirement)

    def _log(self, requirement: int, detail: ViolationDetail | None, *, is_violated: bool,
             left_out: int, now: float) -> None:
        lines = self._lines[requirement]
        shown = None if detail is None else self._describe(detail)
        if not is_violated:
            lines.satisfied(shown, _since(left_out, 'violation'))
        elif shown is None:
            lines.violated_unseen(left_out)
        else:
            lines.violated(shown.stamp, shown, _since(left_out, 'more violation'))
        logged = self._logged[requirement]
        logged.is_violated, logged.latest, logged.until = is_violated, None, now + _INTERVAL_S
        self._waiting.add(requirement)


def _since(number: int, noun: str) -> str:
    if number <= 0:
        return ''
    return f' ({number} {noun}{"" if number == 1 else "s"} since the last line)'
