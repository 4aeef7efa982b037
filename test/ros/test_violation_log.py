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

"""The monitor's own log: a line a second for each requirement, and nothing uncounted."""

from typing import Any

from fret_monitor.model.policies import Severity
from fret_monitor.ros.reports.details import Detail
from fret_monitor.ros.reports.violation_lines import ViolationLines
from fret_monitor.ros.reports.violation_log import ViolationLog
from fret_monitor.runtime import RequirementCounts, Violation, ViolationDetail


class Log:
    """A log of two requirements, with the counters that an engine would have."""

    def __init__(self) -> None:
        self.announced = [0, 0]
        self.is_violated = [False, False]
        self.lines: list[str] = []
        lines = [ViolationLines(self, name, 'x < 1', severity)  # type: ignore[arg-type]
                 for name, severity in (('R', Severity.ERROR), ('Q', Severity.WARN))]
        self.log = ViolationLog(lines, self.counts, lambda detail: Detail(
            detail.violation.step, detail.violation.stamp / 1e9, (('x', '2'),)))

    def counts(self, index: int) -> RequirementCounts:
        is_violated = self.is_violated[index]
        return RequirementCounts(
            0, 0, self.announced[index], False, not is_violated, is_violated)

    def happens(self, now: float, index: int = 0, *, is_over: bool = False,
                has_detail: bool = True) -> None:
        self.announced[index] += not is_over
        self.is_violated[index] = not is_over
        if has_detail:
            self.log.add(ViolationDetail(
                Violation(index, int(now * 10), int(now * 1e9), is_over), 0, ()), now)

    def taken(self, now: float) -> list[str]:
        self.log.review(now)
        taken, self.lines = self.lines, []
        return taken

    def __getattr__(self, severity: str) -> Any:
        return lambda text: self.lines.append(f'{severity}: {text}')


def test_a_violation_and_its_end_are_logged_at_once_if_nothing_was_logged_just_before() -> None:
    log = Log()
    log.happens(10.0)
    assert log.lines == ['error: R violated at 10.000: x < 1 [step 100: x = 2]']
    log.happens(10.0, 1)
    assert log.taken(10.5)[1:] == ['warning: Q violated at 10.000: x < 1 [step 100: x = 2]']
    assert log.taken(11.1) == []
    log.happens(11.2, is_over=True)
    assert log.taken(11.2) == ['info: R satisfied again at 11.200: x < 1 [step 112: x = 2]']
    assert log.taken(20.0) == []


def test_what_comes_within_a_second_is_counted_and_the_latest_is_logged() -> None:
    log = Log()
    log.happens(10.0)
    for tenth in range(1, 9):
        log.happens(10 + tenth / 10)
    log.happens(10.0, 1)  # the other requirement has its own line
    assert len(log.taken(10.9)) == 2
    assert log.taken(11.0) == ['error: R violated at 10.800: x < 1 [step 108: x = 2] '
                               '(7 more violations since the last line)']
    log.happens(11.5, is_over=True)
    log.happens(11.6)
    log.happens(11.7, is_over=True)
    assert log.taken(11.9) == []
    assert log.taken(12.0) == ['error: R violated at 11.600: x < 1 [step 116: x = 2]',
                               'info: R satisfied again at 11.700: x < 1 [step 117: x = 2]']
    assert log.taken(20.0) == []


def test_each_violation_is_in_a_line_of_its_severity_although_all_are_short() -> None:
    log = Log()
    for quarter in range(24):
        log.happens(10 + quarter / 4)
        log.happens(10 + quarter / 4 + 0.05, is_over=True)
        log.log.review(10 + quarter / 4 + 0.2)
    log.log.end()
    errors = [line for line in log.lines if line.startswith('error: R violated at ')]
    more = [int(line.rpartition('(')[2].split()[0]) for line in errors if 'more viol' in line]
    assert len(errors) + sum(more) == 24
    assert 6 <= len(errors) <= 7
    assert all('info: R satisfied again at' in line for line in log.lines if line not in errors)


def test_violations_without_details_are_counted_and_their_end_is_logged() -> None:
    log = Log()
    log.happens(10.0)
    for tenth in range(1, 4):
        log.happens(10 + tenth / 10, has_detail=False)
    assert log.taken(11.0)[1:] == ['error: R violated 3 times more, without details: x < 1']
    log.happens(11.5, is_over=True, has_detail=False)
    assert log.taken(12.0) == ['info: R satisfied again: x < 1']
    log.happens(12.5, has_detail=False)
    log.happens(12.6, is_over=True)
    assert log.taken(13.0) == ['error: R violated once more, without details: x < 1',
                               'info: R satisfied again at 12.600: x < 1 [step 126: x = 2]']
    assert log.taken(20.0) == []


def test_a_violation_that_was_counted_before_its_detail_came_is_logged_after_an_end() -> None:
    log = Log()
    log.happens(10.0)
    log.happens(10.1, is_over=True)
    log.happens(10.2, has_detail=False)  # it is on its way
    assert log.taken(11.0)[1:] == ['error: R violated once more, without details: x < 1',
                                   'info: R satisfied again at 10.100: x < 1 [step 101: x = 2]']
    log.log.add(ViolationDetail(Violation(0, 102, 10_200_000_000, False), 0, ()), 11.1)
    assert log.taken(12.0) == ['error: R violated at 10.200: x < 1 [step 102: x = 2]']
    log.happens(13.5, is_over=True)
    assert log.taken(13.5) == ['info: R satisfied again at 13.500: x < 1 [step 135: x = 2]']


def test_a_requirement_of_which_no_detail_came_is_logged_too() -> None:
    log = Log()
    log.happens(10.0)
    log.happens(10.1, 1, has_detail=False)  # the queue was full
    assert log.taken(11.0)[1:] == ['warning: Q violated once more, without details: x < 1']
    assert log.taken(20.0) == []


def test_what_was_left_out_is_logged_at_the_end() -> None:
    log = Log()
    log.happens(10.0)
    log.happens(10.1, is_over=True)
    log.log.end()
    assert log.lines[1:] == ['info: R satisfied again at 10.100: x < 1 [step 101: x = 2]']
