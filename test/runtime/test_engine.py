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

"""The engine: the time, queues of violations and details, repeated messages, evidence."""

from collections.abc import Callable, Iterator
from pathlib import Path
import struct
from threading import Thread
from time import monotonic, sleep
from typing import Any

from bundles import engine_of, write_bundle
from fret_monitor import build
from fret_monitor.native.binding import ffi
from fret_monitor.runtime import Engine, Evaluator, NEVER, Receipt, TimeCounts
from fret_monitor.runtime.reporting import Reporter, ReportTable
import pytest
from runtime.seen import see, Silence

SECOND = 10**9
BUNDLE = """
format: 1
inputs:
  x: {topic: x, type: std_msgs/msg/Float32, timeout: 1.0, startup: 1.0,
      stale: violate}
  y: {topic: y, type: std_msgs/msg/String, values: {GO: go, STOP: stop}}
evaluation: {policy: relevant_message}
requirements:
  - {id: R, ptltl: "x < 1.0"}
  - {id: S, ptltl: "x < 1.0 | y = GO"}
"""


def a_float(value: float) -> bytes:
    return b'\0\1\0\0' + struct.pack('<f', value)


def shown(engine: Engine, detail: Any) -> list[str]:
    """Return the silent inputs and the values in a detail."""
    record = Reporter(engine, ReportTable(engine.monitor.manifest)).detail(detail)
    return [text for _, text in record.values[3:]]


@pytest.fixture
def engine(tmp_path: Path) -> Engine:
    return engine_of(tmp_path, BUNDLE)


def in_background(function: Callable[[], object]) -> Thread:
    thread = Thread(target=function, daemon=True)
    thread.start()
    return thread


def test_messages_are_steps_and_violations_are_queued_in_order(engine: Engine) -> None:
    for number, value in enumerate((2.0, 0.5, 3.0)):
        assert engine.message(0, a_float(value), received=number) is Receipt.RECEIVED
    assert [(item.requirement, item.step, item.stamp) for item in engine.take(0)] == [
        (0, 0, 0), (0, 2, 2)]
    assert engine.take(0) == []
    assert engine.evaluator.value(0) == 3.0
    assert engine.evaluator.topic_counts(0).messages == 3


def test_waiting_threads_wake_on_a_violation_and_at_the_end(engine: Engine) -> None:
    taken: list[int] = []

    begin = monotonic()
    thread = in_background(lambda: taken.extend(item.step for item in engine.take(60_000)))
    engine.message(0, a_float(2.0), received=0)
    thread.join(30)
    assert taken == [0]
    thread = in_background(lambda: taken.extend(item.step for item in engine.take(60_000)))
    engine.close()
    thread.join(30)
    assert not thread.is_alive()
    assert monotonic() - begin < 30
    assert engine.message(0, a_float(2.0), received=0) is Receipt.RECEIVED
    assert engine.evaluator.topic_counts(0).messages == 1  # messages after the end are ignored


def test_a_violation_does_not_wait_for_its_detail(engine: Engine) -> None:
    engine.want_details(True)
    engine.message(0, a_float(2.0), received=7)
    begin = monotonic()
    assert [item.stamp for item in engine.take(0)] == [7]
    assert engine.take(0) == []
    assert monotonic() - begin < 5.0
    detail = engine.take_detail(0)
    assert detail is not None
    assert (detail.violation.step, shown(engine, detail)) == (0, ['', '2.0'])


def test_a_detail_is_waited_for_until_the_engine_is_closed(engine: Engine) -> None:
    begin = monotonic()
    assert engine.take_detail(50) is None
    assert monotonic() - begin >= 0.05
    engine.close()
    begin = monotonic()
    assert engine.take_detail(60_000) is None
    assert monotonic() - begin < 50


def test_old_details_do_not_reach_a_later_listener(engine: Engine) -> None:
    engine.want_details(True)
    engine.message(0, a_float(2.0), received=7)
    engine.want_details(False)
    engine.message(0, a_float(2.0), received=8)
    engine.want_details(True)
    assert engine.take_detail(0) is None
    engine.message(0, a_float(2.0), received=9)
    detail = engine.take_detail(0)
    assert detail is not None
    assert detail.violation.stamp == 9


def test_details_are_limited_and_the_omitted_ones_counted(engine: Engine) -> None:
    engine.want_details(True)
    for number in range(300):
        engine.message(0, a_float(2.0), received=number)
    details = []
    while (detail := engine.take_detail(0)) is not None:
        details.append(detail.violation.step)
    assert 100 <= len(details) <= 200  # the limit is per second, and a second may end meanwhile
    engine.message(0, a_float(2.0), received=300)
    found = 0
    while violations := engine.take(0):
        found += len(violations)
    assert found == 301


def test_details_are_queued_again_in_the_next_second(engine: Engine) -> None:
    engine.want_details(True, 1)
    found = set()
    begin = int(monotonic())
    while int(monotonic()) < begin + 3:
        engine.message(0, a_float(2.0), received=0)
        if engine.take_detail(0) is not None:
            found.add(int(monotonic()))
        engine.take(0)
    assert len(found) >= 2


def test_ends_of_violations_without_details_are_not_counted_as_violations(tmp_path: Path) -> None:
    path = write_bundle(tmp_path, BUNDLE + 'report: occurrence\n')
    engine = Engine(Evaluator(build.build(path).monitor, reports_recoveries=True))
    engine.want_details(True, 1)  # a second
    for _ in range(50):
        engine.message(0, a_float(2.0), received=0)
        engine.message(0, a_float(0.5), received=0)
    second = int(monotonic())
    while int(monotonic()) == second:
        sleep(0.01)
    engine.message(0, a_float(2.0), received=0)
    details = []
    while (detail := engine.take_detail(0)) is not None:
        details.append((detail.suppressed, detail.violation.is_recovery))
    without = 51 - sum(not is_recovery for _, is_recovery in details)
    assert details[-1][0] == without > 0


def test_silence_is_reported_with_its_detail(engine: Engine) -> None:
    engine.want_details(True)
    engine.advance(0)
    engine.message(0, a_float(0.5), received=1)
    assert engine.deadline == SECOND + 1
    engine.advance(2 * SECOND)
    assert see(engine).silences[0] == Silence(1, 2 * SECOND - 1, True)
    assert [item.stamp for item in engine.take(0)] == [SECOND + 1] * 2
    detail = engine.take_detail(1000)
    assert detail is not None
    assert shown(engine, detail) == ['x', '0.5']
    engine.message(0, a_float(0.5), received=3 * SECOND)
    assert see(engine).silences[0] == Silence(1, 3 * SECOND - 1, False)


def test_nothing_is_due_before_the_time_has_begun(engine: Engine) -> None:
    assert engine.deadline == NEVER
    engine.message(0, a_float(0.5), received=10 * SECOND)
    engine.message(0, a_float(0.5), received=20 * SECOND)
    assert engine.deadline == NEVER
    assert engine.take(0) == [] and engine.evaluator.time_counts() == TimeCounts(0, 0, 0, 0)


def test_waiting_for_a_violation_takes_a_timeout_at_its_instant(engine: Engine) -> None:
    engine.follow_steady()
    engine.begin()
    begin = monotonic()
    assert len(engine.take(30_000)) == 2
    assert 1.0 <= monotonic() - begin + 0.01 < 10.0
    engine.advance(0)  # ignored: the time is that of a clock
    assert see(engine).silences[0].is_silent and engine.evaluator.time_counts().restarts == 0


@pytest.mark.parametrize('is_reset', [False, True])
def test_a_wait_ends_earlier_for_a_deadline_that_came_meanwhile(
    engine: Engine, is_reset: bool,
) -> None:
    engine.follow_steady()
    engine.begin()
    assert len(engine.take(30_000)) == 2 and engine.deadline == NEVER
    taken: list[int] = []
    thread = in_background(
        lambda: taken.extend(item.requirement for item in engine.take(60_000)))
    sleep(0.2)  # until it waits
    if is_reset:
        engine.reset()
    else:
        engine.message(0, a_float(0.5), received=0)
    thread.join(30)
    assert taken == [0, 1]


class SetClock:
    """A clock that the test sets; C calls `now`."""

    def __init__(self) -> None:
        self.time = 5 * SECOND
        self.now = ffi.callback('int(void *, int64_t *)', self._read)

    def _read(self, _: Any, nanoseconds: Any) -> int:
        nanoseconds[0] = self.time
        return 0


@pytest.fixture
def clock(engine: Engine) -> Iterator[SetClock]:
    """Let the engine follow a clock, without having begun."""
    clock = SetClock()
    engine.follow_clock(clock.now, ffi.NULL)
    yield clock
    engine.close()
    engine.follow_steady()  # before the callback is gone


def test_a_wait_ends_when_a_clock_has_moved(engine: Engine, clock: SetClock) -> None:
    engine.begin()
    assert engine.deadline == 6 * SECOND
    taken: list[int] = []
    thread = in_background(lambda: taken.extend(item.stamp for item in engine.take(60_000)))
    clock.time = 6 * SECOND + 1
    engine.wake()
    thread.join(30)
    assert taken == [6 * SECOND] * 2


def test_messages_have_the_time_of_a_clock_before_the_time_begins(
    engine: Engine, clock: SetClock,
) -> None:
    engine.message(0, a_float(2.0), received=1)
    assert [item.stamp for item in engine.take(0)] == [5 * SECOND]
    clock.time = 50 * SECOND
    assert engine.deadline == NEVER and engine.take(0) == []
    engine.begin()
    assert engine.deadline == 51 * SECOND


def test_an_outdated_clock_gives_no_time_before_it_moves(
    engine: Engine, clock: SetClock,
) -> None:
    engine.begin()
    engine.follow_clock(clock.now, ffi.NULL, is_outdated=True)
    clock.time = 100 * SECOND
    assert engine.take(0) == [] and engine.deadline == 6 * SECOND
    engine.wake()
    assert engine.take(0) == [] and engine.deadline == 101 * SECOND


def test_a_reset_is_in_time(engine: Engine, clock: SetClock) -> None:
    engine.begin()
    clock.time = 7 * SECOND
    engine.reset()
    # What was due before, at its instant; then what the reset makes due, when the clock moves.
    assert [item.stamp for item in engine.take(0)] == [6 * SECOND] * 2
    clock.time = 8 * SECOND
    assert [item.stamp for item in engine.take(0)] == [7 * SECOND] * 2


def test_a_message_received_by_two_subscriptions_is_one_step(engine: Engine) -> None:
    def deliver(number: int, *, is_retired: bool = False) -> Receipt:
        return engine.message(0, a_float(2.0), received=0, sent=number, sequence=number,
                              is_retired=is_retired)

    assert deliver(1) is Receipt.RECEIVED
    assert deliver(1) is Receipt.RECEIVED  # two publishers may use the same sequence number
    engine.begin_handover(0, has_history=False)
    assert deliver(1) is Receipt.REPEATED
    assert deliver(3) is Receipt.RECEIVED
    assert deliver(2, is_retired=True) is Receipt.RECEIVED
    assert deliver(3, is_retired=True) is Receipt.REPEATED
    engine.begin_handover(0, has_history=True)
    assert deliver(0) is Receipt.REPEATED  # history, which only the new subscription receives
    assert deliver(0, is_retired=True) is Receipt.RECEIVED
    engine.end_handover(0)
    assert deliver(3) is Receipt.RECEIVED
    assert engine.evaluator.topic_counts(0).messages == 6


def test_a_sender_whose_clock_is_set_back_sends_no_history(engine: Engine) -> None:
    engine.begin_handover(0, has_history=True)
    assert engine.message(0, a_float(2.0), received=0, sent=10, sequence=1) is Receipt.RECEIVED
    for number in range(2, 12):
        assert engine.message(0, a_float(2.0), received=0, sent=number - 5,
                              sequence=number) is Receipt.RECEIVED
    assert engine.message(0, a_float(2.0), received=0, sent=11, sequence=3) is Receipt.REPEATED


def test_the_last_unusable_message_is_kept_and_returned_once(engine: Engine) -> None:
    odd = b'\0\1\0\0' + struct.pack('<I', 5) + b'odd!\0'
    assert engine.message(1, odd, received=0) is Receipt.RECEIVED
    assert engine.message(1, odd, received=0) is Receipt.RECEIVED
    assert engine.evidence(1) == odd
    assert engine.evidence(1) is None
    assert engine.message(1, b'\0', received=0) is Receipt.UNDECODABLE
    counted = engine.evaluator
    assert (counted.input_counts(1).unusable, counted.topic_counts(1).undecodable) == (2, 1)


def test_many_violations_are_kept(engine: Engine) -> None:
    for number in range(5000):
        engine.message(0, a_float(2.0), received=number)
    stamps: list[int] = []
    while violations := engine.take(0):
        stamps += [item.stamp for item in violations]
    assert stamps == list(range(5000))
    assert see(engine).unpublished == 0


def test_violations_beyond_the_capacity_of_a_queue_are_counted(tmp_path: Path) -> None:
    bundle = tmp_path / 'bundle.yaml'
    bundle.write_text(BUNDLE.partition('requirements:')[0] + 'requirements:\n' + ''.join(
        f'  - {{id: R{k}, ptltl: "x < {k}.0"}}\n' for k in range(1024)), encoding='utf-8')
    engine = Engine(Evaluator(build.build(bundle).monitor))
    for number in range(1026):
        engine.message(0, a_float(1e6), received=number)
    engine.library.fm_engine_count_unpublished(engine.pointer, 5)
    assert see(engine).unpublished == 2 * 1024 + 5
    assert sum(map(len, iter(lambda: engine.take(0), []))) == 1 << 20
