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

"""What a node logs of the time: late and missed periods, a restart, a clock that is missing."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from fret_monitor.model.policies import Policy
import pytest
from runtime.reviewed import OK, Reviewed, SECOND, WARN

BUNDLE = """
format: 1
inputs:
  x: {topic: t, type: std_msgs/msg/Float32}
requirements:
  - {id: R, ptltl: "x < 1.0"}
"""
WITH_TIMEOUT = BUNDLE.replace('Float32}', 'Float32, timeout: 1000}')
TIMED = BUNDLE.replace('inputs:', 'evaluation: {policy: timed}\ninputs:')


def counted(periods: int, late: int = 0, missed: int = 0, restarts: int = 0,
            restarted_at: float = 0.0, overflows: int = 0) -> Callable[[Any], None]:
    def change(seen: Any) -> None:
        seen.time = (periods, late, missed, restarts, round(restarted_at * SECOND), overflows)
    return change


def periodic(folder: Path, period: float, text: str = BUNDLE) -> Reviewed:
    return Reviewed(folder, text, policy=Policy.PERIODIC, period=period)


@pytest.mark.parametrize(('now', 'is_worth_reading'), [
    ((1100, 100, 0), False),
    ((1100, 101, 0), False),
    ((1100, 101, 1), True),
    ((1010, 102, 0), False),  # two late ones
    ((1010, 103, 0), True),
    ((2000, 110, 0), False),  # one in a hundred
    ((2000, 111, 0), True),
])
def test_a_few_late_periods_are_no_warning(
    tmp_path: Path, now: tuple[int, int, int], is_worth_reading: bool,
) -> None:
    reviewed = periodic(tmp_path, 0.1)
    reviewed.look(counted(1000, 100))
    status = reviewed.statuses(counted(*now))['periods of bundle']
    assert (status.level, status.message) == ((
        WARN, f'{now[2]} missed, {now[1] - 100} late since the last report')
        if is_worth_reading else (OK, 'in time'))
    assert status.values == (('period', '0.1'), ('taken', str(now[0])), ('late', str(now[1])),
                             ('missed', str(now[2])), ('restarts', '0'))


def test_late_periods_are_logged_at_intervals_with_their_total(tmp_path: Path) -> None:
    reviewed = periodic(tmp_path, 0.1)
    lines = []
    for second in range(120):
        lines += [line for line in reviewed.lines(counted(10 * second, 5 * second, 2 * second))
                  if 'periods' in line]
        reviewed.now += 1.0
    assert lines == [
        'WARN periods of 0.1 s since the last such message: 2 missed (no step), 5 late by more '
        'than half a period',
        'WARN periods of 0.1 s since the last such message: 120 missed (no step), 300 late by '
        'more than half a period']


@pytest.mark.parametrize(('per_s', 'late'), [(10.0, 20), (1000.0, 700), (0.01, 3)])
def test_a_burst_of_late_periods_is_logged_after_a_long_good_run(
    tmp_path: Path, per_s: float, late: int,
) -> None:
    reviewed = periodic(tmp_path, 1 / per_s)
    lines, periods = [], 0
    for second in range(0, 36000, 7):
        periods = int(second * per_s)
        lines += [line for line in reviewed.lines(counted(periods, 2)) if 'periods' in line]
        reviewed.now += 7.0
    assert lines == []
    assert reviewed.lines(counted(periods + late, 2 + late)) == [
        f'WARN periods of {1 / per_s:g} s since the last such message: 0 missed (no step), '
        f'{2 + late} late by more than half a period']


def test_slow_periods_that_are_often_late_are_logged(tmp_path: Path) -> None:
    reviewed = periodic(tmp_path, 30.0)
    lines = []
    for second in range(1500):  # one in ten
        lines += [line for line in reviewed.lines(counted(second // 30, second // 300))
                  if 'periods' in line]
        reviewed.now += 1.0
    assert lines == ['WARN periods of 30 s since the last such message: 0 missed (no step), 3 '
                     'late by more than half a period']


def test_without_periods_only_time_that_goes_back_is_logged(tmp_path: Path) -> None:
    reviewed = Reviewed(tmp_path, WITH_TIMEOUT)
    assert reviewed.lines(counted(0, 50, 50)) == []
    back = counted(0, 50, 50, 2, 5.3)
    assert reviewed.lines(back) == [
        'WARN time went back, to 5.300 s: timeouts continue from there; values and past of the '
        'requirements are kept']
    assert reviewed.lines(back) == []


def test_when_the_time_goes_back_timeouts_are_named_only_if_there_are_some(
    tmp_path: Path,
) -> None:
    stamped = TIMED.replace('timed}', 'timed, stamp: header, reorder: 0.1}').replace(
        'std_msgs/msg/Float32', 'geometry_msgs/msg/PointStamped, field: point.x')
    back = counted(0, restarts=1, restarted_at=99.9)
    assert Reviewed(tmp_path, stamped).lines(back) == [
        'WARN time went back, to 100.000 s: values are kept, and the requirements start afresh']
    assert periodic(tmp_path, 0.1, WITH_TIMEOUT).lines(back) == [
        'WARN time went back, to 99.900 s: periods and timeouts continue from there; values and '
        'past of the requirements are kept']


def test_the_time_of_the_policy_timed_has_a_status(tmp_path: Path) -> None:
    reviewed = Reviewed(tmp_path, TIMED)
    assert reviewed.summaries()['time of bundle'] == (OK, 'passes')
    assert reviewed.summaries(counted(0, restarts=1))['time of bundle'] == (
        WARN, 'went back since the last report')
    status = reviewed.statuses(counted(0, restarts=1, overflows=7))['time of bundle']
    assert (status.level, status.message) == (WARN, 'more changes than max_rate allows')
    assert status.values == (('restarts', '1'), ('overflows', '7'))


def test_changes_beyond_a_max_rate_are_logged_at_most_once_a_minute(tmp_path: Path) -> None:
    reviewed = Reviewed(tmp_path, TIMED)
    lines = []
    for second in range(70):
        lines += [line for line in reviewed.lines(counted(0, overflows=second))
                  if 'evaluated' not in line]
        reviewed.now += 1.0
    assert lines == [
        f'WARN {count} changes found no room in a window: inputs change, or messages come, more '
        'often than their max_rate; what reads the window is violated until the lost changes '
        'have left it' for count in (1, 61)]


@pytest.mark.parametrize(('text', 'period', 'end'), [
    (TIMED.replace('Float32}', 'Float32, timeout: 1}'), None,
     ': no deadline and no timeout passes'),
    (TIMED, None, ': no deadline passes'),
    (BUNDLE, 0.1, ': no period passes'),
    (WITH_TIMEOUT, 0.1, ': no period and no timeout passes'),
    (BUNDLE, None, '/clock')])
def test_a_missing_clock_is_logged_once_after_five_seconds_with_what_it_stops(
    tmp_path: Path, text: str, period: float | None, end: str,
) -> None:
    reviewed = Reviewed(tmp_path, text) if period is None else periodic(tmp_path, period, text)

    def at(seconds: float) -> list[str]:
        reviewed.now = 100.0 + seconds
        return [line for line in reviewed.lines(waits_for_clock=True)
                if 'evaluated' not in line]

    assert at(1.0) == at(4.9) == []
    line, = at(5.1)
    assert line.startswith('WARN use_sim_time is set and nothing was received on /clock')
    assert line.endswith(end)
    assert at(6.0) == at(200.0) == []


def test_a_clock_that_has_time_is_not_missing(tmp_path: Path) -> None:
    reviewed = Reviewed(tmp_path, BUNDLE)
    reviewed.send(0, {'data': 0.5}, 1.1)
    for _ in range(3):
        reviewed.now += 4.0
        assert reviewed.lines(waits_for_clock=True) == []
        assert reviewed.lines(waits_for_clock=False) == []
