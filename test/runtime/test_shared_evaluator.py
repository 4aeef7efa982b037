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

"""The shared evaluator: queues of violations and details, messages that come twice, evidence."""

from collections.abc import Callable
from pathlib import Path
import struct
from threading import Thread
from time import monotonic

from fret_monitor import build
from fret_monitor.runtime import Evaluator, Receipt, SharedEvaluator
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
def watch(tmp_path: Path) -> SharedEvaluator:
    bundle = tmp_path / 'bundle.yaml'
    bundle.write_text(BUNDLE, encoding='utf-8')
    return SharedEvaluator(Evaluator(build.build(bundle).monitor))


def in_background(function: Callable[[], object]) -> Thread:
    thread = Thread(target=function, daemon=True)
    thread.start()
    return thread


def test_messages_are_steps_and_violations_are_queued_in_order(watch: SharedEvaluator) -> None:
    for number, value in enumerate((2.0, 0.5, 3.0)):
        assert watch.message(0, a_float(value), received=number) is Receipt.RECEIVED
    assert [(item.requirement, item.step, item.stamp) for item in watch.take(0)] == [
        (0, 0, 0), (0, 2, 2)]
    assert watch.take(0) == []
    assert watch.value(0) == 3.0
    assert watch.topic_counts(0).messages == 3


def test_who_waits_is_woken_by_a_violation_and_by_the_end(watch: SharedEvaluator) -> None:
    taken: list[int] = []

    begin = monotonic()
    thread = in_background(lambda: taken.extend(item.step for item in watch.take(60_000)))
    watch.message(0, a_float(2.0), received=0)
    thread.join(30)
    assert taken == [0]
    thread = in_background(lambda: taken.extend(item.step for item in watch.take(60_000)))
    watch.close()
    thread.join(30)
    assert not thread.is_alive()
    assert monotonic() - begin < 30
    assert watch.message(0, a_float(2.0), received=0) is Receipt.RECEIVED
    assert watch.topic_counts(0).messages == 1  # what comes after the end is ignored


def test_a_violation_waits_for_its_detail_however_long_nothing_happened(
    watch: SharedEvaluator,
) -> None:
    watch.want_details(True)
    # One that waits for violations has been waiting for longer than a violation is held.
    taken: list[float] = []
    thread = in_background(lambda: taken.append(len(watch.take(60_000)) and monotonic()))
    assert watch.take_detail(150) is None
    sent = monotonic()
    watch.message(0, a_float(2.0), received=7)
    detail = watch.take_detail(1000)
    assert detail is not None
    assert (detail.violation.step, detail.values, detail.stale) == (0, (2.0, None), frozenset())
    thread.join(0.03)
    # Nobody has said yet that the detail is out; it is held for 0.1 s at most.
    assert thread.is_alive() or monotonic() - sent > 0.1
    assert watch.take_detail(0) is None
    thread.join(30)
    assert taken


def test_a_violation_does_not_wait_for_long(watch: SharedEvaluator) -> None:
    watch.want_details(True)
    watch.message(0, a_float(2.0), received=7)
    assert len(watch.take(10_000)) == 1


def test_details_are_limited_and_the_others_counted(watch: SharedEvaluator) -> None:
    watch.want_details(True)
    for number in range(300):
        watch.message(0, a_float(2.0), received=number)
    details = []
    while (detail := watch.take_detail(0)) is not None:
        details.append(detail)
    assert 100 <= len(details) <= 200  # a second may have ended meanwhile
    watch.message(0, a_float(2.0), received=300)
    found = 0
    while violations := watch.take(0):
        found += len(violations)
    assert found == 301


def test_silence_is_told_with_its_detail(watch: SharedEvaluator) -> None:
    watch.want_details(True)
    watch.message(0, a_float(0.5), received=0)
    watch.stale(0, watch.input_counts(0).received, 5)
    assert watch.is_stale(0)
    detail = watch.take_detail(1000)
    assert detail is not None
    assert (detail.values[0], detail.stale) == (0.5, frozenset({0}))
    watch.message(0, a_float(0.5), received=6)
    assert not watch.is_stale(0)


def test_a_message_by_two_subscriptions_is_one_step(watch: SharedEvaluator) -> None:
    def deliver(number: int, *, is_retired: bool = False) -> Receipt:
        return watch.message(0, a_float(2.0), received=0, sent=number, sequence=number,
                             is_retired=is_retired)

    assert deliver(1) is Receipt.RECEIVED
    assert deliver(1) is Receipt.RECEIVED  # two publishers may count alike
    watch.begin_handover(0, has_history=False)
    assert deliver(1) is Receipt.REPEATED
    assert deliver(3) is Receipt.RECEIVED
    assert deliver(2, is_retired=True) is Receipt.RECEIVED
    assert deliver(3, is_retired=True) is Receipt.REPEATED
    watch.begin_handover(0, has_history=True)
    assert deliver(0) is Receipt.REPEATED  # history, which only the new one brings
    assert deliver(0, is_retired=True) is Receipt.RECEIVED
    watch.end_handover(0)
    assert deliver(3) is Receipt.RECEIVED
    assert watch.topic_counts(0).messages == 6


def test_a_sender_whose_clock_is_set_back_sends_no_history(watch: SharedEvaluator) -> None:
    watch.begin_handover(0, has_history=True)
    assert watch.message(0, a_float(2.0), received=0, sent=10, sequence=1) is Receipt.RECEIVED
    for number in range(2, 12):
        assert watch.message(0, a_float(2.0), received=0, sent=number - 5,
                             sequence=number) is Receipt.RECEIVED
    assert watch.message(0, a_float(2.0), received=0, sent=11, sequence=3) is Receipt.REPEATED


def test_what_cannot_be_used_is_kept_to_be_shown_once(watch: SharedEvaluator) -> None:
    odd = b'\0\1\0\0' + struct.pack('<I', 5) + b'odd!\0'
    assert watch.message(1, odd, received=0) is Receipt.RECEIVED
    assert watch.message(1, odd, received=0) is Receipt.RECEIVED
    assert watch.evidence(1) == odd
    assert watch.evidence(1) is None
    assert watch.message(1, b'\0', received=0) is Receipt.UNDECODABLE
    assert (watch.input_counts(1).unusable, watch.topic_counts(1).undecodable) == (2, 1)


def test_many_violations_are_kept(watch: SharedEvaluator) -> None:
    for number in range(5000):
        watch.message(0, a_float(2.0), received=number)
    stamps: list[int] = []
    while violations := watch.take(0):
        stamps += [item.stamp for item in violations]
    assert stamps == list(range(5000))
    assert watch.unpublished == 0


def test_violations_beyond_what_a_queue_may_hold_are_counted(tmp_path: Path) -> None:
    bundle = tmp_path / 'bundle.yaml'
    bundle.write_text(BUNDLE.partition('requirements:')[0] + 'requirements:\n' + ''.join(
        f'  - {{id: R{k}, ptltl: "x < {k}.0"}}\n' for k in range(1024)), encoding='utf-8')
    watch = SharedEvaluator(Evaluator(build.build(bundle).monitor))
    for number in range(1026):
        watch.message(0, a_float(1e6), received=number)
    watch.count_unpublished(5)
    assert watch.unpublished == 2 * 1024 + 5
    assert sum(map(len, iter(lambda: watch.take(0), []))) == 1 << 20
