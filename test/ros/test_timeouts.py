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

"""Silent inputs are found in time, not too early, whatever the clock does."""

import random

from fret_monitor.model.manifest import ManifestInput
from fret_monitor.model.values import ValueType
from fret_monitor.ros.timeouts import Silence, TimeoutTracker
import pytest

SECOND = 10**9
START = 100 * SECOND  # 0 means that there is no time yet


class Counters:
    """Counts the messages of each input."""

    def __init__(self, *timeouts: float | None) -> None:
        self.received = [0] * len(timeouts)
        self.tracker = TimeoutTracker(
            [ManifestInput(f'x{index}', ValueType.BOOL, 't', 'any', (), (), None, timeout=timeout)
             for index, timeout in enumerate(timeouts)], self.received.__getitem__)

    def look(self, seconds: float) -> tuple[list[int], list[int]]:
        """Check at a time; return the inputs that fell silent, and those that resumed."""
        begun, ended = self.tracker.check(START + round(seconds * SECOND))
        return [item.index for item in begun], [item.index for item in ended]


def test_without_a_timeout_nothing_is_checked() -> None:
    counters = Counters(None, None)
    assert counters.tracker.period is None
    assert counters.look(0) == counters.look(100) == ([], [])
    assert counters.tracker.count(0) is None


def test_an_input_without_a_topic_is_not_checked() -> None:
    item = ManifestInput('x', ValueType.BOOL, None, None, (), (), None, timeout=1.0)
    assert TimeoutTracker([item], lambda index: 0).period is None


def test_the_shortest_timeout_sets_the_interval_of_the_checks() -> None:
    assert Counters(8.0, None, 2.0).tracker.period == 0.2
    assert Counters(0.001).tracker.period == 0.005


@pytest.mark.parametrize('seed', range(20))
def test_a_silence_is_found_after_its_timeout_and_before_a_quarter_more(seed: int) -> None:
    chance = random.Random(seed)
    timeout = chance.choice([0.1, 1.0, 60.0])
    counters = Counters(timeout, timeout * 1.5)
    period = counters.tracker.period
    assert period is not None
    last, time, told = 0.0, 0.0, 0
    counters.look(time)
    for number in range(1, 2000):
        planned = number * period
        if chance.random() < 0.2:  # a value at some time between two checks
            last = planned - chance.random() * period
            counters.received[0] += 1
        time = planned + chance.random() * period / 10  # a timer is late, never early
        begun, ended = counters.look(time)
        if 0 in begun:
            told += 1
            assert timeout <= time - last <= 1.25 * timeout
        assert (0 in ended) <= (last > planned - period)
        is_silent = 0 in [item.index for item in counters.tracker.silent()]
        assert is_silent or time - last < 1.25 * timeout
        assert not is_silent or time - last >= timeout
    assert told == counters.tracker.count(0)
    assert told > 5


def test_an_input_without_any_message_is_silent_since_the_first_check() -> None:
    counters = Counters(1.0)
    for eighth in range(8):
        assert counters.look(1000 + eighth / 8) == ([], [])
    assert counters.look(1001) == ([0], [])
    assert counters.look(1001.125) == ([], [])
    assert counters.tracker.silent() == [Silence(0, 0, 1125 * 10**6)]


def test_a_silence_is_reported_once_and_its_end_once_with_its_length() -> None:
    counters = Counters(1.0)
    found = [counters.look(eighth / 8) for eighth in range(17)]
    assert found.count(([0], [])) == 1 and found[8] == ([0], [])
    counters.received[0] += 1
    begun, ended = counters.tracker.check(START + 2 * SECOND + SECOND // 8)
    assert begun == [] and ended == [Silence(0, 0, 2 * SECOND)]
    assert counters.tracker.silent() == []
    found = [counters.look(2 + eighth / 8) for eighth in range(2, 10)]
    assert found[-1] == ([0], []) and found.count(([], [])) == 7
    assert counters.tracker.count(0) == 2


@pytest.mark.parametrize('leap', [0.6, 1.0, 3600.0])
def test_a_jump_forward_in_time_is_no_silence(leap: float) -> None:
    counters = Counters(1.0)
    counters.look(0)
    counters.look(0.125)
    assert counters.look(0.25 + leap) == ([], [])
    later = 0.25 + leap
    for eighth in range(1, 7):
        assert counters.look(later + eighth / 8) == ([], [])
    assert counters.look(later + 7 / 8) == ([0], []), 'from there on it is'


def test_a_clock_that_always_jumps_does_not_hide_a_silence() -> None:
    counters = Counters(1.0)
    counters.look(0)
    assert counters.look(10) == ([], [])
    assert counters.look(20) == ([0], [])


@pytest.mark.parametrize('back', [0.01, 0.5, 100.0])
def test_time_that_goes_back_neither_makes_nor_ends_a_silence(back: float) -> None:
    counters = Counters(1.0)
    times = [1000 + eighth / 8 for eighth in range(8)]
    assert [counters.look(time) for time in times] == [([], [])] * 8
    assert counters.look(times[-1] - back) == ([], [])
    assert counters.look(times[-1] - back + 0.125) == ([0], [])
    assert counters.look(500) == ([], [])
    assert counters.tracker.silent()[0].lasted == SECOND


def test_a_time_of_another_clock_neither_makes_nor_prolongs_a_silence() -> None:
    counters = Counters(1.0)
    for eighth in range(9):
        counters.look(eighth / 8)
    lasted = counters.tracker.silent()[0].lasted
    assert lasted == SECOND
    counters.tracker.change_clock()
    counters.tracker.check(0)  # no `/clock` yet
    counters.tracker.check(0)
    assert counters.tracker.check(2103 * SECOND) == ([], [])
    counters.tracker.change_clock()
    assert counters.look(0.125) == ([], [])
    assert counters.tracker.silent()[0].lasted == lasted
