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

"""The ring of the last messages of an engine: what is in it, and what was overwritten."""

from collections import deque
from pathlib import Path
from random import Random
import struct
from time import monotonic_ns
from typing import Any

from fret_monitor import build
from fret_monitor.native.binding import ffi
from fret_monitor.runtime import Engine, Evaluator, Receipt
import pytest
from runtime.message_ring import KeptCounts, KeptMessage, MessageRing

BUNDLE = """
format: 1
inputs:
  x: {topic: x, type: std_msgs/msg/Float32}
  y: {topic: y, type: std_msgs/msg/String, values: {GO: go, STOP: stop}}
requirements:
  - {id: R, ptltl: "x < 1.0"}
  - {id: S, ptltl: "x < 2.0 | y = GO"}
"""
HEADER_BYTES = 40


def a_float(value: float) -> bytes:
    return b'\0\1\0\0' + struct.pack('<f', value)


def a_text(length: int) -> bytes:
    return b'\0\1\0\0' + struct.pack('<I', length + 1) + b'x' * length + b'\0'


@pytest.fixture
def engine(tmp_path: Path) -> Engine:
    bundle = tmp_path / 'bundle.yaml'
    bundle.write_text(BUNDLE, encoding='utf-8')
    return Engine(Evaluator(build.build(bundle).monitor, reports_recoveries=True))


def ring_for(engine: Engine, size: int, seconds: float = 10.0) -> MessageRing:
    ring = MessageRing(engine.library, size, seconds)
    ring.keep_messages_of(engine)
    return ring


def read(ring: MessageRing) -> list[KeptMessage]:
    return [message for _, message in ring.read(0)]


def test_messages_are_kept_as_they_came(engine: Engine) -> None:
    ring = ring_for(engine, 1 << 16)
    before = monotonic_ns()
    engine.message(0, a_float(0.5), received=7, sent=3)
    assert engine.message(1, b'\0\1\0\0', received=8) is Receipt.UNDECODABLE
    engine.message(1, a_text(4), received=9)
    engine.close()
    engine.message(0, a_float(0.5), received=10)
    found = read(ring)
    assert [(item.topic, item.time, item.sent, item.data) for item in found] == [
        (0, 7, 3, a_float(0.5)), (1, 8, 0, b'\0\1\0\0'), (1, 9, 0, a_text(4))]
    assert before <= found[0].steady <= found[2].steady <= monotonic_ns()
    assert ring.counts() == KeptCounts(kept=3)
    (place, _), *_ = ring.read(0)
    assert [item.time for _, item in ring.read(place)] == [8, 9]


def test_a_message_that_comes_before_the_clock_is_kept_without_a_time(engine: Engine) -> None:
    @ffi.callback('int(void *, int64_t *)')
    def stopped(_: Any, nanoseconds: Any) -> int:
        nanoseconds[0] = 5
        return 0

    ring = ring_for(engine, 1 << 16)
    engine.follow_clock(stopped, ffi.NULL, is_outdated=True)
    engine.message(0, a_float(0.5), received=7)
    engine.message(1, b'\0\1\0\0', received=8)
    engine.wake()
    engine.message(0, a_float(0.5), received=9)
    assert [item.time for item in read(ring)] == [0, 0, 5]
    engine.close()
    engine.follow_steady()  # before the callback is gone


@pytest.mark.parametrize('size', [97, 1000, 200_000])
def test_the_oldest_messages_are_overwritten(engine: Engine, size: int) -> None:
    ring, rng = ring_for(engine, size, seconds=0), Random(size)
    kept: deque[bytes] = deque()
    place, seen, used, sent = 0, 0, 0, 0
    for number in range(300):
        data = a_text(rng.choice([0, 1, 30, rng.randrange(max(1, size // 3))]))
        engine.message(1, data, received=number)
        if len(data) + HEADER_BYTES > size:
            continue
        kept.append(data)
        sent += 1
        used += len(data) + HEADER_BYTES
        while used > size:
            used -= len(kept.popleft()) + HEADER_BYTES
        assert [item.data for item in read(ring)] == list(kept)
        if rng.random() < 0.3:  # a reader that reads on now and then
            taken = list(ring.read(place))
            place = taken[-1][0] if taken else place
            unread = max(0, len(kept) - (sent - seen))
            assert [item.data for _, item in taken] == list(kept)[unread:]
            seen = sent
    assert ring.counts().kept == sent
    assert ring.counts().early == 0


def test_what_does_not_fit_or_last_is_counted(engine: Engine) -> None:
    ring = ring_for(engine, 100)
    engine.message(1, a_text(60), received=1)  # 40 of a header, 4, 4, 60, 1
    assert ring.counts() == KeptCounts(left_out=1)
    engine.message(1, a_text(51), received=2)
    assert ring.counts() == KeptCounts(kept=1, left_out=1)
    engine.message(0, a_float(0.5), received=3)
    assert ring.counts() == KeptCounts(kept=2, left_out=1, early=1)
    assert [item.time for item in read(ring)] == [3]


@pytest.mark.parametrize(('age', 'early'), [(0, 1), (999, 1), (1000, 0), (1001, 0)])
def test_a_message_that_lasted_as_long_as_it_should_is_not_early(
        engine: Engine, age: int, early: int) -> None:
    ring = MessageRing(engine.library, 2 * HEADER_BYTES + 1, 1e-6)  # 1000 ns, one message
    for steady in (5, 5 + age):
        kept = ffi.new('struct fm_kept *', {'size': 8, 'steady': steady})
        engine.library.fm_blackbox_keep(ring.pointer, kept, ffi.new('uint8_t[8]'))
    assert ring.counts() == KeptCounts(kept=2, early=early)


def test_violations_are_noted_when_they_begin(engine: Engine) -> None:
    ring = ring_for(engine, 1 << 16)
    assert ring.take_occurrences() is None
    before = monotonic_ns()
    for value in (0.5, 1.5, 1.5, 0.5, 3.0):
        engine.message(0, a_float(value), received=1)
    found = ring.take_occurrences()
    assert found is not None
    assert (found.number, found.requirement) == (2, 0)
    assert before <= found.first < found.last <= monotonic_ns()
    assert ring.take_occurrences() is None
    engine.message(0, a_float(4.0), received=2)
    assert ring.take_occurrences() is None
    engine.reset()
    engine.message(0, a_float(4.0), received=3)
    assert ring.take_occurrences() is not None


def test_memory_that_is_not_there_is_an_error(engine: Engine) -> None:
    with pytest.raises(MemoryError):
        MessageRing(engine.library, 1 << 60, 1.0)
