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

"""The details of violations as C publishes them, and the lines of the log, turn by turn."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from fret_monitor.native.binding import ffi
from fret_monitor.runtime import Engine
from fret_monitor.runtime.reporting import Lines, Reporter, ReportTable
import pytest
from runtime.test_reporting import a_float, engine_of

BUNDLE = """
format: 1
component: tank
inputs:
  x: {topic: x, type: std_msgs/msg/Float32}
requirements:
  - {id: R, title: Low, ptltl: "x < 1"}
"""


class Turns:
    """Turns of a publisher of details; `subscriptions` have matched."""

    def __init__(self, engine: Engine, *, logs_violations: bool = False) -> None:
        self.engine = engine
        self.subscriptions = 0
        self.published: list[tuple[tuple[int, int], str, dict[str, str]]] = []
        self._lines = Lines(engine.library)
        self._reporter = Reporter(engine, ReportTable(engine.monitor.manifest))
        middleware: Any = ffi.new('struct fm_middleware *')
        self._kept = [middleware, ffi.callback(ffi.typeof(middleware.publish), self._publish),
                      ffi.callback(ffi.typeof(middleware.count_matched), self._count)]
        middleware.publish, middleware.count_matched = self._kept[1:]
        self._pointer = ffi.gc(
            engine.library.fm_detail_publisher_create(
                self._reporter.pointer, middleware, ffi.NULL, logs_violations),
            engine.library.fm_detail_publisher_destroy)

    def _count(self, _publisher: Any, count: Any) -> int:
        count[0] = self.subscriptions
        return 0

    def _publish(self, _publisher: Any, message: Any, _allocation: Any) -> int:
        array: Any = ffi.cast('struct fm_ros_statuses *', message)
        assert (array.n, text_of(array.frame_id)) == (1, '')
        status = array.statuses[0]
        assert (status.level, text_of(status.message), text_of(status.hardware_id)) == (
            2, 'Low', 'tank')
        self.published.append(((array.sec, array.nanosec), text_of(status.name), {
            text_of(item.key): text_of(item.value)
            for item in status.values[0:status.n_values]}))
        return 0

    def turn(self) -> tuple[bool, list[str]]:
        """Return whether it goes on, and the lines of the log."""
        goes_on = self.engine.library.fm_detail_publisher_turn(self._pointer, self._lines.pointer)
        return bool(goes_on), [line.text for line in self._lines.take()]

    def violate(self, value: float, seconds: float) -> None:
        self.engine.message(0, a_float(value), int(seconds * 1e9))


def text_of(text: Any) -> str:
    found = bytes(ffi.buffer(text.data, text.size))
    assert text.capacity == text.size + 1 and text.data[text.size] == b'\0'
    return found.decode()


Make = Callable[..., Turns]


@pytest.fixture
def make(tmp_path: Path) -> Make:
    return lambda **options: Turns(engine_of(tmp_path, BUNDLE), **options)


def test_a_subscriber_that_has_just_matched_gets_the_details_of_the_next_violations(
        make: Make) -> None:
    turns = make()
    assert turns.turn() == (True, [])
    turns.violate(2.0, 1.0)
    assert turns.turn() == (True, []) and turns.published == []
    turns.subscriptions = 1
    for number in range(5):
        turns.violate(3.0 + number, 2.000000007 + number)
    for _ in range(5):
        turns.turn()
    assert [values['x'] for _, _, values in turns.published] == ['3.0', '4.0', '5.0', '6.0', '7.0']
    stamp, name, values = turns.published[0]
    assert (stamp, name) == ((2, 7), 'R')
    assert list(values.items())[:3] == [
        ('step', '1'), ('stamp', '2.000000007'), ('suppressed', '0')]


def test_more_details_a_second_are_queued_for_a_subscriber(make: Make) -> None:
    turns = make()
    turns.subscriptions = 1
    turns.turn()
    for number in range(30):
        turns.violate(2.0, 1.0 + number)
    for _ in range(30):
        assert turns.turn() == (True, [])
    assert len(turns.published) == 30
    assert turns.published[-1][2]['suppressed'] == '0'


def test_the_stamp_of_a_violation_before_1970_has_nanoseconds_that_are_not_negative(
        make: Make) -> None:
    turns = make()
    turns.subscriptions = 1
    turns.turn()
    turns.violate(2.0, -1.25)
    turns.turn()
    (stamp, _, values), = turns.published
    assert (stamp, values['stamp']) == ((-2, 750_000_000), '-1.250000000')


def test_a_violation_before_the_first_turn_is_published_and_logged(make: Make) -> None:
    turns = make(logs_violations=True)
    turns.subscriptions = 1
    turns.violate(2.0, 1.0)
    line = 'R violated at 1.000: Low (x < 1) [step 0: x = 2.0]'
    assert turns.turn() == (True, [line])
    assert len(turns.published) == 1


def test_the_queue_is_emptied_and_all_is_logged_once_the_engine_is_closed(make: Make) -> None:
    turns = make(logs_violations=True)
    turns.subscriptions = 1
    for number in range(3):
        turns.violate(2.0 + number, 1.0 + number)
    turns.engine.close()
    found = [turns.turn() for _ in range(4)]
    assert [goes_on for goes_on, _ in found] == [True, True, True, False]
    assert len(turns.published) == 3
    line, = found[-1][1]
    assert line.startswith('R violated at 3.000: ')
    assert line.endswith(' [step 2: x = 4.0] (1 more violation since the last line)')
