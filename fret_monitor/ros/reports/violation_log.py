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
The monitor's own log: at most one line of violations a second for each requirement.

The end of a violation is logged after the line of the violation. Details that C queues are what is
logged; C may have suppressed some of them, or the queue may have been full. The counters of the
engine show that, so that no violation is left uncounted, and no requirement out.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from time import monotonic

from fret_monitor.ros.reports.details import Detail
from fret_monitor.ros.reports.violation_lines import ViolationLines
from fret_monitor.runtime import RequirementCounts, ViolationDetail

LOGGED_PER_S = 10
"""Details of a requirement in a second while only the log reads them."""

_INTERVAL_S = 1.0


@dataclass
class _Logged:
    """What the log says of a requirement: its violations so far, and whether it is violated."""

    violations: int = 0
    is_violated: bool = False
    violation: ViolationDetail | None = None  # the latest that was left out since the last line
    recovery: ViolationDetail | None = None  # left out, if it is later than `violation`
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
        if not detail.is_recovery:
            logged.violation, logged.recovery = detail, None
        else:
            logged.recovery = detail
        if logged.until is None:
            logged.violations += not detail.is_recovery
            self._log(requirement, violations=int(not detail.is_recovery),
                      is_over=detail.is_recovery, now=now)

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
        """Log the violations that were left out, with their number, and then their end."""
        logged, counts = self._logged[requirement], self._counts(requirement)
        more, logged.violations = counts.announced - logged.violations, counts.announced
        was_violated = logged.is_violated or more > 0
        if logged.violation is None and logged.recovery is None:  # they may have no details
            is_violated = was_violated and counts.is_violated
        else:
            is_violated = logged.recovery is None
        if more <= 0 and is_violated and not logged.is_violated:
            more = 1  # the counters were ahead of its detail
        is_over = was_violated and not is_violated
        if more > 0 or is_over:
            self._log(requirement, violations=more, is_over=is_over, now=now)
        else:
            logged.violation = logged.recovery = logged.until = None
            self._waiting.discard(requirement)

    def _log(self, requirement: int, *, violations: int, is_over: bool, now: float) -> None:
        """Log a number of violations in one line, then their end, as far as there are any."""
        lines, logged = self._lines[requirement], self._logged[requirement]
        if violations > 0 and logged.violation is not None:
            shown = self._describe(logged.violation)
            lines.violated(shown.stamp, shown, _since(violations - 1))
        elif violations > 0:
            lines.violated_unseen(violations)
        if is_over:
            end = logged.recovery
            lines.satisfied(None if end is None else self._describe(end))
        logged.is_violated, logged.until = not is_over, now + _INTERVAL_S
        logged.violation = logged.recovery = None
        self._waiting.add(requirement)


def _since(number: int) -> str:
    if number <= 0:
        return ''
    return f' ({number} more violation{"" if number == 1 else "s"} since the last line)'
