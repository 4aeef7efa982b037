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

"""Late and missed periods are counted and logged, whatever the clock does."""

from types import SimpleNamespace
from typing import Any

from fret_monitor.ros.periods import NodeTimer, Schedule, Throttle
import pytest

TENTH = 10**8


def ticked(*ticks: tuple[float, float]) -> Schedule:
    """Return a schedule of 0.1 s after these ticks: (time, next planned time), in seconds."""
    schedule = Schedule(0.1)
    for now, following in ticks:
        schedule.tick(round(now * 1e9), round(following * 1e9))
    return schedule


def counts(schedule: Schedule) -> tuple[int, int, int, int]:
    return schedule.ticks, schedule.late, schedule.missed, schedule.restarts


def test_ticks_in_time_are_neither_late_nor_missed() -> None:
    schedule = ticked(*((10 + n / 10 + 0.01, 10 + n / 10 + 0.1) for n in range(100)))
    assert counts(schedule) == (100, 0, 0, 0) and schedule.reports() == []


def test_a_tick_is_late_after_half_a_period() -> None:
    schedule = ticked((10.1, 10.2), (10.2499, 10.3), (10.351, 10.4))
    assert counts(schedule) == (3, 1, 0, 0)
    assert schedule.reports() == [
        'periods of 0.1 s since the last such message: 0 missed (no step), '
        '1 late by more than half a period']


@pytest.mark.parametrize('periods', [1, 7, 36000])
def test_periods_without_a_tick_are_counted(periods: int) -> None:
    later = 10.1 + periods / 10
    schedule = ticked((10.1, 10.2), (later + 0.1, later + 0.2), (later + 0.2, later + 0.3))
    assert counts(schedule) == (3, 0, periods, 0)
    assert f'{periods} missed' in schedule.reports()[0]


def test_a_tick_later_than_its_own_period_is_late() -> None:
    # The executor was busy between the timer and its callback.
    assert counts(ticked((10.1, 10.2), (10.37, 10.3))) == (2, 1, 0, 0)


def test_time_that_goes_back_restarts_the_periods_and_misses_none() -> None:
    schedule = ticked((1000.1, 1000.2), (5.3, 5.4), (5.4, 5.5))
    assert counts(schedule) == (3, 0, 0, 1)
    line, = schedule.reports()
    assert line.startswith('time went back from 1000.100 s to 5.300 s: the periods continue')
    assert schedule.reports() == []


def test_before_there_is_time_no_period_is_missed() -> None:
    assert counts(ticked((0.0, 0.1), (1e9, 1e9 + 0.1), (1e9 + 0.1, 1e9 + 0.2))) == (3, 0, 0, 0)


def test_a_lasting_problem_is_logged_at_intervals_with_its_total() -> None:
    schedule = ticked((10.1, 10.2), (10.3, 10.4))
    assert len(schedule.reports()) == 1
    schedule.tick(11 * 10 * TENTH, 11 * 10 * TENTH + TENTH)
    assert schedule.missed > 1 and schedule.reports() == [], 'not so soon'


def test_a_throttle_lets_one_message_pass_per_interval() -> None:
    throttle = Throttle(3600)
    assert [throttle.passes() for _ in range(3)] == [True, False, False]
    throttle = Throttle(0)
    assert [throttle.passes() for _ in range(3)] == [True, True, True]


class FakeNode:
    """A node whose clock and timer stand still, unless the thread is preempted."""

    def __init__(self) -> None:
        self.time = 1000 * TENTH
        self.preemptions: list[int] = []  # ns for which the next readings are interrupted
        self.is_simulated = True
        self.fire: Any = None

    @property
    def ros_time_is_active(self) -> bool:
        return self.is_simulated

    def now(self) -> Any:
        return SimpleNamespace(nanoseconds=self.time)

    def get_clock(self) -> 'FakeNode':
        return self

    def create_timer(self, period: float, callback: Any, **_: Any) -> 'FakeNode':
        self.fire = self.fire or callback
        return self

    def destroy_timer(self, _: Any) -> None:
        pass

    def time_until_next_call(self) -> int:
        self.time += self.preemptions.pop() if self.preemptions else 0
        return 1001 * TENTH - self.time


@pytest.mark.parametrize('preemptions', [[], [TENTH * 6 // 10], [TENTH, TENTH // 2, TENTH // 3]])
def test_a_thread_preempted_between_two_readings_of_the_time_sees_no_jump(
    preemptions: list[int],
) -> None:
    calls: list[tuple[int, int]] = []
    node: Any = FakeNode()
    NodeTimer(node, 0.1, lambda *call: calls.append(call), lambda: None, 'a test')
    node.preemptions = preemptions
    node.fire()
    (now, following), = calls
    assert now == node.time and following == 1001 * TENTH


def test_a_change_of_the_clock_is_reported_before_the_next_call() -> None:
    events: list[object] = []
    node: Any = FakeNode()
    NodeTimer(node, 0.1, lambda now, following: events.append('call'),
              lambda: events.append('change'), 'a test')
    node.fire()
    node.is_simulated = False
    node.create_timer = lambda *_, **__: SimpleNamespace(time_until_next_call=lambda: TENTH)
    node.fire()
    node.fire()
    assert events == ['call', 'change', 'call', 'call']


def test_the_time_of_another_clock_misses_no_period() -> None:
    schedule = ticked((10.1, 10.2), (10.2, 10.3))
    schedule.change_clock()
    schedule.tick(5 * TENTH, 6 * TENTH)
    schedule.tick(6 * TENTH, 7 * TENTH)
    assert counts(schedule) == (4, 0, 0, 0)
