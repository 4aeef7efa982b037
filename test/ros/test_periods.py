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

"""Periods: what came late or not at all is counted and told, whatever time does."""

from fret_monitor.ros.periods import Schedule, Throttle
import pytest

TENTH = 10**8


def ticked(*ticks: tuple[float, float]) -> Schedule:
    """Return a schedule of 0.1 s after ticks at some times, each with the next planned one (s)."""
    schedule = Schedule(0.1)
    for now, following in ticks:
        schedule.tick(round(now * 1e9), round(following * 1e9))
    return schedule


def counts(schedule: Schedule) -> tuple[int, int, int, int]:
    return schedule.ticks, schedule.late, schedule.missed, schedule.restarts


def test_ticks_in_time_are_neither_late_nor_missed() -> None:
    schedule = ticked(*((10 + n / 10 + 0.01, 10 + n / 10 + 0.1) for n in range(100)))
    assert counts(schedule) == (100, 0, 0, 0) and schedule.news() == []


def test_a_tick_is_late_after_half_a_period() -> None:
    schedule = ticked((10.1, 10.2), (10.2499, 10.3), (10.351, 10.4))
    assert counts(schedule) == (3, 1, 0, 0)
    assert schedule.news() == [
        'of the periods of 0.1 s since the last such message, 0 were missed, which are no steps, '
        'and 1 came late by more than half a period']


@pytest.mark.parametrize('periods', [1, 7, 36000])
def test_periods_without_a_tick_are_counted(periods: int) -> None:
    later = 10.1 + periods / 10
    schedule = ticked((10.1, 10.2), (later + 0.1, later + 0.2), (later + 0.2, later + 0.3))
    assert counts(schedule) == (3, 0, periods, 0)
    assert f'{periods} were missed' in schedule.news()[0]


def test_a_tick_later_than_its_own_period_is_late() -> None:
    # The executor was busy between the timer and its callback
    assert counts(ticked((10.1, 10.2), (10.37, 10.3))) == (2, 1, 0, 0)


def test_time_that_goes_back_starts_the_periods_anew_and_misses_none() -> None:
    schedule = ticked((1000.1, 1000.2), (5.3, 5.4), (5.4, 5.5))
    assert counts(schedule) == (3, 0, 0, 1)
    told, = schedule.news()
    assert told.startswith('time went back from 1000.100 s to 5.300 s, and the periods go on')
    assert schedule.news() == []


def test_before_there_is_time_no_period_is_missed() -> None:
    assert counts(ticked((0.0, 0.1), (1e9, 1e9 + 0.1), (1e9 + 0.1, 1e9 + 0.2))) == (3, 0, 0, 0)


def test_what_goes_on_is_told_now_and_then_with_all_of_it() -> None:
    schedule = ticked((10.1, 10.2), (10.3, 10.4))
    assert len(schedule.news()) == 1
    schedule.tick(11 * 10 * TENTH, 11 * 10 * TENTH + TENTH)
    assert schedule.missed > 1 and schedule.news() == [], 'not so soon'


def test_a_throttle_lets_one_pass_at_a_time() -> None:
    throttle = Throttle(3600)
    assert [throttle.passes() for _ in range(3)] == [True, False, False]
    throttle = Throttle(0)
    assert [throttle.passes() for _ in range(3)] == [True, True, True]
