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

"""Late and missed periods, and time that goes back, are logged when that is worth reading."""

from pathlib import Path
from time import monotonic
from types import SimpleNamespace
from typing import Any

from builtin_interfaces.msg import Time
from fret_monitor import build
from fret_monitor.ros.intake import node_time
from fret_monitor.ros.intake.hot_path import EngineTopic, Middleware
from fret_monitor.ros.intake.node_time import are_worth_reading, as_time, NodeTime, TimeLog
from fret_monitor.ros.intake.rcl_subscription import RclSubscription
from fret_monitor.ros.intake.throttle import Throttle
from fret_monitor.runtime import Engine, Evaluator, MessageRing, TimeCounts
import pytest
import rclpy
from rclpy.clock import ClockType
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from ros.harness import Partner, RELIABLE, wait_until
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float32

SECOND = 10**9
BUNDLE = """
format: 1
inputs:
  x: {topic: x, type: std_msgs/msg/Float32}
requirements:
  - {id: R, ptltl: "x < 2.0"}
"""


def test_a_throttle_lets_one_message_pass_per_interval() -> None:
    throttle = Throttle(3600)
    assert [throttle.passes() for _ in range(3)] == [True, False, False]
    throttle = Throttle(0)
    assert [throttle.passes() for _ in range(3)] == [True, True, True]


@pytest.mark.parametrize(('now', 'is_worth_reading'), [
    (TimeCounts(periods=1100, late=100, missed=0, restarts=0), False),
    (TimeCounts(periods=1100, late=101, missed=0, restarts=0), False),
    (TimeCounts(periods=1100, late=101, missed=1, restarts=0), True),
    (TimeCounts(periods=1010, late=102, missed=0, restarts=0), False),  # two late ones
    (TimeCounts(periods=1010, late=103, missed=0, restarts=0), True),
    (TimeCounts(periods=2000, late=110, missed=0, restarts=0), False),  # one in a hundred
    (TimeCounts(periods=2000, late=111, missed=0, restarts=0), True),
])
def test_a_few_late_periods_are_not_worth_reading(
    now: TimeCounts, is_worth_reading: bool,
) -> None:
    before = TimeCounts(periods=1000, late=100, missed=0, restarts=0)
    assert are_worth_reading(before, now) is is_worth_reading


def test_a_stamp_has_seconds_and_the_nanoseconds_of_the_next_one() -> None:
    assert as_time(3_999_999_999) == Time(sec=3, nanosec=999_999_999)


class Recorder:
    """A node with a clock, and an engine."""

    def __init__(self) -> None:
        self.counts = TimeCounts(0, 0, 0, 0)
        self.ros_time_is_active = False
        self.time = 0
        self.lines: list[str] = []

    def time_counts(self) -> TimeCounts:
        return self.counts

    def get_clock(self) -> 'Recorder':
        return self

    def now(self) -> SimpleNamespace:
        return SimpleNamespace(nanoseconds=self.time)

    def get_logger(self) -> 'Recorder':
        return self

    def warning(self, line: str) -> None:
        self.lines.append(line)


def a_log(recorder: Any, period: float | None, *, is_timed: bool = False,
          has_timeouts: bool = True, reorder: int = 0) -> TimeLog:
    return TimeLog(recorder, recorder, period, is_timed=is_timed, has_timeouts=has_timeouts,
                   reorder=reorder)


def test_late_periods_are_logged_at_intervals_with_their_total(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    time = [0.0]
    monkeypatch.setattr('fret_monitor.ros.intake.throttle.monotonic', lambda: time[0])
    recorder: Any = Recorder()
    log = a_log(recorder, 0.1)
    for second in range(120):
        time[0] = float(second)
        recorder.counts = TimeCounts(10 * second, 5 * second, 2 * second, 0)
        log.review()
    assert recorder.lines == [
        'periods of 0.1 s since the last such message: 2 missed (no step), 5 late by more than '
        'half a period',
        'periods of 0.1 s since the last such message: 120 missed (no step), 300 late by more '
        'than half a period']


@pytest.mark.parametrize(('per_s', 'late'), [(10.0, 20), (1000.0, 700), (0.01, 3)])
def test_a_burst_of_late_periods_is_logged_after_a_long_good_run(
    monkeypatch: pytest.MonkeyPatch, per_s: float, late: int,
) -> None:
    time = [0.0]
    monkeypatch.setattr('fret_monitor.ros.intake.throttle.monotonic', lambda: time[0])
    recorder: Any = Recorder()
    log = a_log(recorder, 1 / per_s)
    for second in range(0, 36000, 7):
        time[0] = float(second)
        recorder.counts = TimeCounts(int(second * per_s), 2, 0, 0)
        log.review()
    assert recorder.lines == []
    recorder.counts = TimeCounts(recorder.counts.periods + late, 2 + late, 0, 0)
    log.review()
    assert recorder.lines == [
        f'periods of {1 / per_s:g} s since the last such message: 0 missed (no step), '
        f'{2 + late} late by more than half a period']


def test_slow_periods_that_are_often_late_are_logged(monkeypatch: pytest.MonkeyPatch) -> None:
    time = [0.0]
    monkeypatch.setattr('fret_monitor.ros.intake.throttle.monotonic', lambda: time[0])
    recorder: Any = Recorder()
    log = a_log(recorder, 30.0)
    for second in range(1500):
        time[0] = float(second)
        recorder.counts = TimeCounts(second // 30, second // 300, 0, 0)  # one in ten
        log.review()
    assert recorder.lines == [
        'periods of 30 s since the last such message: 0 missed (no step), 3 late by more than '
        'half a period']


def test_without_periods_only_time_that_goes_back_is_logged() -> None:
    recorder: Any = Recorder()
    log = a_log(recorder, None)
    recorder.counts = TimeCounts(0, 50, 50, 0)
    log.review()
    assert recorder.lines == []
    recorder.time = 6_000_000_000  # it has gone on since
    recorder.counts = TimeCounts(0, 50, 50, 2, 0, 5_300_000_000)
    log.review()
    log.review()
    line, = recorder.lines
    assert line == ('time went back, to 5.300 s: timeouts continue from there; values and past '
                    'of the requirements are kept')


def test_when_the_time_goes_back_timeouts_are_named_only_if_there_are_some() -> None:
    recorder: Any = Recorder()
    recorder.time = 101_480_000_000
    recorder.counts = TimeCounts(0, 0, 0, 1, 0, 99_900_000_000)
    a_log(recorder, None, is_timed=True, has_timeouts=False, reorder=100_000_000).review()
    a_log(recorder, 0.1).review()
    assert recorder.lines == [
        'time went back, to 100.000 s: values are kept, and the requirements start afresh',
        'time went back, to 99.900 s: periods and timeouts continue from there; values and past '
        'of the requirements are kept']


@pytest.mark.parametrize(('period', 'is_timed', 'has_timeouts', 'end'), [
    (None, True, True, ': no deadline and no timeout passes'),
    (None, True, False, ': no deadline passes'),
    (0.1, False, False, ': no period passes'),
    (None, False, False, '/clock')])
def test_what_a_missing_clock_stops_is_named(
    monkeypatch: pytest.MonkeyPatch, period: float | None, is_timed: bool, has_timeouts: bool,
    end: str,
) -> None:
    recorder: Any = Recorder()
    recorder.ros_time_is_active = True
    log = a_log(recorder, period, is_timed=is_timed, has_timeouts=has_timeouts)
    later = monotonic() + 6.0
    monkeypatch.setattr(node_time, 'monotonic', lambda: later)
    log.review()
    assert recorder.lines[0].endswith(end)


def test_a_missing_clock_is_logged_once_after_five_seconds(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    time = [100.0]
    monkeypatch.setattr(node_time, 'monotonic', lambda: time[0])
    recorder: Any = Recorder()
    recorder.ros_time_is_active = True
    log = a_log(recorder, 0.1)
    for second in (101.0, 104.9):
        time[0] = second
        log.review()
    assert recorder.lines == []
    for second in (105.1, 106.0, 200.0):
        time[0] = second
        log.review()
    assert recorder.lines == ['use_sim_time is set and nothing was received on /clock: no period '
                              'and no timeout passes']


class Served:
    """An engine that counts the signs of life of its clock."""

    signs = 0
    wakes = 0
    drains = 0
    is_outdated: bool

    def serve_clock(self) -> None:
        self.signs += 1

    def follow_steady(self) -> None:
        pass

    def follow_clock(self, now: Any, clock: Any, *, is_outdated: bool) -> None:
        self.is_outdated = is_outdated

    def drain(self) -> None:
        self.drains += 1

    def wake(self) -> None:
        self.is_outdated = False
        self.wakes += 1


def spun(executor: SingleThreadedExecutor) -> bool:
    executor.spin_once(timeout_sec=0.05)
    return True


def test_the_engine_learns_that_the_executor_is_alive_while_it_moves_the_clock(
    domain: int,
) -> None:
    context = Context()
    context.init(domain_id=domain)
    node = Node('clocked', context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    engine: Any = Served()
    time = NodeTime(node, engine, None)
    simulator = node.create_publisher(Clock, '/clock', 1)

    def signs(seconds: float) -> int:
        before, end = engine.signs, monotonic() + seconds
        while monotonic() < end:
            executor.spin_once(timeout_sec=0.05)
        return int(engine.signs - before)

    try:
        assert signs(0.3) == 0
        for time_s, is_simulated in enumerate((True, False, True)):
            node.set_parameters([Parameter('use_sim_time', value=is_simulated)])
            assert (signs(0.6) > 1) is is_simulated
            if is_simulated:  # also without deadlines: else messages have the time of before
                assert engine.is_outdated
                wait_until(lambda: simulator.get_subscription_count() > 0, 'a subscription')
                for second in (7, 14, 21):
                    engine.wakes = 0
                    simulator.publish(Clock(clock=Time(sec=second + time_s)))
                    wait_until(lambda: spun(executor) and engine.wakes > 0, 'a new time')
                assert not engine.is_outdated
        time.close()
        assert signs(0.3) == 0
    finally:
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()


def test_a_message_that_waits_while_the_clock_goes_back_counts_by_its_time_of_before(
    partner: Partner, tmp_path: Path,
) -> None:
    bundle = tmp_path / 'bundle.yaml'
    bundle.write_text(BUNDLE, encoding='utf-8')
    engine = Engine(Evaluator(build.build(bundle).monitor, reports_recoveries=True))
    ring = MessageRing(engine.library, 1 << 16, 10)
    engine.keep_messages(ring)
    node = Node('clocked', context=partner.context, parameter_overrides=[
        Parameter('use_sim_time', value=True)])
    middleware = Middleware(may_take=False)
    time = NodeTime(node, engine, middleware.clock_now)
    engine.begin()
    subscription = RclSubscription(node, Float32, 'x', RELIABLE)
    receiver = EngineTopic(engine, middleware, 0).open(subscription)
    try:
        x = partner.publisher(Float32, 'x')
        wait_until(lambda: x.get_subscription_count() > 0, 'a match')
        clock: Any = node.get_clock()
        for seconds in (100, 101, 2):
            clock.set_ros_time_override(rclpy.time.Time(
                seconds=seconds, clock_type=ClockType.ROS_TIME))
            if seconds == 101:
                x.publish(Float32(data=1.0))  # no thread takes it
                wait_until(lambda: x.wait_for_all_acked(Duration(seconds=0.1)), 'its reception')
        assert [item.time for _, item in ring.read(0)] == [101 * SECOND]
    finally:
        receiver.stop()
        subscription.close()
        time.close()
        engine.close()
        engine.follow_steady()  # before the clock is gone
        node.destroy_node()
