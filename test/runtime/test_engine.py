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

"""The shared evaluator: queues of violations and details, repeated messages, evidence."""

from collections.abc import Callable
from pathlib import Path
import struct
from threading import Thread
from time import monotonic

from fret_monitor import build
from fret_monitor.runtime import Evaluator, Receipt, Engine
import pytest

BUNDLE = """
format: 1
inputs:
  x: {topic: x, type: std_msgs/msg/Float32, timeout: 1.0, stale: violate}
  y: {topic: y, type: std_msgs/msg/String, values: {GO: go, STOP: stop}}
evaluation: {policy: relevant_message}
requirements:
  - {id: R, ptltl: "x < 1.0"}
  - {id: S, ptltl: "x < 1.0 | y = GO"}
"""


def a_float(value: float) -> bytes:
    return b'\0\1\0\0' + struct.pack('<f', value)


@pytest.fixture
def evaluator(tmp_path: Path) -> Engine:
    bundle = tmp_path / 'bundle.yaml'
    bundle.write_text(BUNDLE, encoding='utf-8')
    return Engine(Evaluator(build.build(bundle).monitor))


def in_background(function: Callable[[], object]) -> Thread:
    thread = Thread(target=function, daemon=True)
    thread.start()
    return thread


def test_messages_are_steps_and_violations_are_queued_in_order(evaluator: Engine) -> None:
    for number, value in enumerate((2.0, 0.5, 3.0)):
        assert evaluator.message(0, a_float(value), received=number) is Receipt.RECEIVED
    assert [(item.requirement, item.step, item.stamp) for item in evaluator.take(0)] == [
        (0, 0, 0), (0, 2, 2)]
    assert evaluator.take(0) == []
    assert evaluator.value(0) == 3.0
    assert evaluator.topic_counts(0).messages == 3


def test_waiting_threads_wake_on_a_violation_and_at_the_end(evaluator: Engine) -> None:
    taken: list[int] = []

    begin = monotonic()
    thread = in_background(lambda: taken.extend(item.step for item in evaluator.take(60_000)))
    evaluator.message(0, a_float(2.0), received=0)
    thread.join(30)
    assert taken == [0]
    thread = in_background(lambda: taken.extend(item.step for item in evaluator.take(60_000)))
    evaluator.close()
    thread.join(30)
    assert not thread.is_alive()
    assert monotonic() - begin < 30
    assert evaluator.message(0, a_float(2.0), received=0) is Receipt.RECEIVED
    assert evaluator.topic_counts(0).messages == 1  # messages after the end are ignored


def test_a_violation_does_not_wait_for_its_detail(evaluator: Engine) -> None:
    evaluator.want_details(True)
    evaluator.message(0, a_float(2.0), received=7)
    begin = monotonic()
    assert [item.stamp for item in evaluator.take(0)] == [7]
    assert evaluator.take(0) == []
    assert monotonic() - begin < 0.05
    detail = evaluator.take_detail(0)
    assert detail is not None
    assert (detail.violation.step, detail.values, detail.stale) == (0, (2.0, None), frozenset())


def test_old_details_do_not_reach_a_later_listener(evaluator: Engine) -> None:
    evaluator.want_details(True)
    evaluator.message(0, a_float(2.0), received=7)
    evaluator.want_details(False)
    evaluator.message(0, a_float(2.0), received=8)
    evaluator.want_details(True)
    assert evaluator.take_detail(0) is None
    evaluator.message(0, a_float(2.0), received=9)
    detail = evaluator.take_detail(0)
    assert detail is not None
    assert detail.violation.stamp == 9


def test_details_are_limited_and_the_omitted_ones_counted(evaluator: Engine) -> None:
    evaluator.want_details(True)
    for number in range(300):
        evaluator.message(0, a_float(2.0), received=number)
    details = []
    while (detail := evaluator.take_detail(0)) is not None:
        details.append(detail)
    assert 100 <= len(details) <= 200  # the limit is per second, and a second may end meanwhile
    evaluator.message(0, a_float(2.0), received=300)
    found = 0
    while violations := evaluator.take(0):
        found += len(violations)
    assert found == 301


def test_silence_is_reported_with_its_detail(evaluator: Engine) -> None:
    evaluator.want_details(True)
    evaluator.message(0, a_float(0.5), received=0)
    evaluator.stale(0, evaluator.input_counts(0).received, 5)
    assert evaluator.is_stale(0)
    detail = evaluator.take_detail(1000)
    assert detail is not None
    assert (detail.values[0], detail.stale) == (0.5, frozenset({0}))
    evaluator.message(0, a_float(0.5), received=6)
    assert not evaluator.is_stale(0)


def test_a_message_received_by_two_subscriptions_is_one_step(evaluator: Engine) -> None:
    def deliver(number: int, *, is_retired: bool = False) -> Receipt:
        return evaluator.message(0, a_float(2.0), received=0, sent=number, sequence=number,
                                 is_retired=is_retired)

    assert deliver(1) is Receipt.RECEIVED
    assert deliver(1) is Receipt.RECEIVED  # two publishers may use the same sequence number
    evaluator.begin_handover(0, has_history=False)
    assert deliver(1) is Receipt.REPEATED
    assert deliver(3) is Receipt.RECEIVED
    assert deliver(2, is_retired=True) is Receipt.RECEIVED
    assert deliver(3, is_retired=True) is Receipt.REPEATED
    evaluator.begin_handover(0, has_history=True)
    assert deliver(0) is Receipt.REPEATED  # history, which only the new subscription receives
    assert deliver(0, is_retired=True) is Receipt.RECEIVED
    evaluator.end_handover(0)
    assert deliver(3) is Receipt.RECEIVED
    assert evaluator.topic_counts(0).messages == 6


def test_a_sender_whose_clock_is_set_back_sends_no_history(evaluator: Engine) -> None:
    evaluator.begin_handover(0, has_history=True)
    assert evaluator.message(0, a_float(2.0), received=0, sent=10, sequence=1) is Receipt.RECEIVED
    for number in range(2, 12):
        assert evaluator.message(0, a_float(2.0), received=0, sent=number - 5,
                                 sequence=number) is Receipt.RECEIVED
    assert evaluator.message(0, a_float(2.0), received=0, sent=11, sequence=3) is Receipt.REPEATED


def test_the_last_unusable_message_is_kept_and_returned_once(evaluator: Engine) -> None:
    odd = b'\0\1\0\0' + struct.pack('<I', 5) + b'odd!\0'
    assert evaluator.message(1, odd, received=0) is Receipt.RECEIVED
    assert evaluator.message(1, odd, received=0) is Receipt.RECEIVED
    assert evaluator.evidence(1) == odd
    assert evaluator.evidence(1) is None
    assert evaluator.message(1, b'\0', received=0) is Receipt.UNDECODABLE
    assert (evaluator.input_counts(1).unusable, evaluator.topic_counts(1).undecodable) == (2, 1)


def test_many_violations_are_kept(evaluator: Engine) -> None:
    for number in range(5000):
        evaluator.message(0, a_float(2.0), received=number)
    stamps: list[int] = []
    while violations := evaluator.take(0):
        stamps += [item.stamp for item in violations]
    assert stamps == list(range(5000))
    assert evaluator.unpublished == 0


def test_violations_beyond_the_capacity_of_a_queue_are_counted(tmp_path: Path) -> None:
    bundle = tmp_path / 'bundle.yaml'
    bundle.write_text(BUNDLE.partition('requirements:')[0] + 'requirements:\n' + ''.join(
        f'  - {{id: R{k}, ptltl: "x < {k}.0"}}\n' for k in range(1024)), encoding='utf-8')
    evaluator = Engine(Evaluator(build.build(bundle).monitor))
    for number in range(1026):
        evaluator.message(0, a_float(1e6), received=number)
    evaluator.count_unpublished(5)
    assert evaluator.unpublished == 2 * 1024 + 5
    assert sum(map(len, iter(lambda: evaluator.take(0), []))) == 1 << 20
