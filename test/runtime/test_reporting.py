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


"""
What is reported of violations, in words: details, and at most a line a second of each requirement.

Both nodes and the logger say what csrc/reporting decides here.
"""

from itertools import pairwise
from pathlib import Path
import re
import struct
from typing import Any

from fret_monitor import build
from fret_monitor.model.policies import Severity
from fret_monitor.native import evaluator_library, load_evaluator, Monitor
from fret_monitor.native.binding import ffi
from fret_monitor.runtime import Engine, Evaluator
from fret_monitor.runtime.reporting import (
    Lines, LogLine, read_detail, Reporter, ReportTable, StatusRecord, ViolationLines,
)
from fret_monitor.runtime.scopes import Scopes
from hypothesis import given
from hypothesis import strategies as st
import pytest

TWO = """
format: 1
inputs:
  x: {topic: x, type: std_msgs/msg/Float32}
  y: {topic: y, type: std_msgs/msg/Float32}
evaluation: {policy: relevant_message}
requirements:
  - {id: R, ptltl: "x < 1"}
  - {id: Q, ptltl: "y < 1", severity: warn}
"""
TRACKS = """
format: 1
for_each: {track: {most: 5}}
inputs:
  x: {topic: x, type: std_msgs/msg/Header, field: stamp.sec, where: "frame_id = {track}"}
requirements:
  - {id: R, ptltl: "x < 1"}
"""


def monitor_of(folder: Path, text: str) -> Monitor:
    bundle = folder / 'bundle.yaml'
    bundle.write_text(text, encoding='utf-8')
    return build.build(bundle).monitor


def engine_of(folder: Path, text: str) -> Engine:
    return Engine(Evaluator(monitor_of(folder, text), reports_recoveries=True))


def a_float(value: float) -> bytes:
    return b'\0\1\0\0' + struct.pack('<f', value)


def an_int(value: int) -> bytes:
    return b'\0\1\0\0' + struct.pack('<i', value)


class ViolationLog:
    """Lines of violations of an engine, at times (ns) that the test decides."""

    def __init__(self, reporter: Reporter) -> None:
        self._kept = reporter
        self._lines = Lines(reporter.library)
        self._pointer = ffi.gc(reporter.library.fm_violation_log_create(reporter.pointer),
                               reporter.library.fm_violation_log_destroy)

    def _call(self, name: str, *arguments: Any) -> list[LogLine]:
        getattr(self._lines.library, f'fm_violation_log_{name}')(
            self._pointer, *arguments, self._lines.pointer)
        return self._lines.take()

    def add(self, detail: Any, now: int = 0) -> list[LogLine]:
        return self._call('add', detail, now)

    def review(self, now: int) -> list[LogLine]:
        return self._call('review', now)

    def end(self) -> list[LogLine]:
        return self.review(2**63 - 1 - 10**9)  # FM_AT_END


class Log:
    """The log of an engine with two requirements; each message is a violation, or its end."""

    def __init__(self, monitor: Monitor, most_details_per_s: int = 1000) -> None:
        scopes = Scopes(monitor, is_of_engine=True) if monitor.kinds else None
        evaluator = scopes.evaluator() if scopes else Evaluator(monitor, reports_recoveries=True)
        self.engine = Engine(evaluator, scopes=scopes)
        self._log = ViolationLog(Reporter(self.engine, ReportTable(self.engine.monitor.manifest)))
        self.engine.want_details(True, most_details_per_s)
        self.lines: list[str] = []

    def happens(self, now: float, index: int = 0, *, is_over: bool = False,
                has_detail: bool = True) -> None:
        self.engine.message(index, a_float(0.0 if is_over else 2.0), int(now * 1e9))
        if has_detail:
            self.detail_comes(now)
        elif now:
            self.engine.want_details(False)  # drops it
            self.engine.want_details(True, 1000)

    def detail_comes(self, now: float) -> None:
        detail = self.engine.take_detail(0)
        assert detail is not None
        self._keep(self._log.add(detail, int(now * 1e9)))

    def details_come(self, now: float) -> None:
        while (detail := self.engine.take_detail(0)) is not None:
            self._keep(self._log.add(detail, int(now * 1e9)))

    def review(self, now: float) -> None:
        self._keep(self._log.review(int(now * 1e9)))

    def end(self) -> None:
        self._keep(self._log.end())

    def taken(self, now: float) -> list[str]:
        self.review(now)
        taken, self.lines = self.lines, []
        return taken

    def _keep(self, lines: list[LogLine]) -> None:
        self.lines += [f'{line.level.name}: {line.text}' for line in lines]


@pytest.fixture(scope='module')
def two(tmp_path_factory: pytest.TempPathFactory) -> Monitor:
    return monitor_of(tmp_path_factory.mktemp('two'), TWO)


@pytest.fixture
def log(two: Monitor) -> Log:
    return Log(two)


def test_a_violation_and_its_end_are_logged_at_once_if_nothing_was_logged_just_before(
        log: Log) -> None:
    log.happens(10.0)
    assert log.lines == ['ERROR: R violated at 10.000: x < 1 [step 0: x = 2.0]']
    log.happens(10.0, 1)
    assert log.taken(10.5)[1:] == ['WARN: Q violated at 10.000: y < 1 [step 0: y = 2.0]']
    assert log.taken(11.1) == []
    log.happens(11.2, is_over=True)
    assert log.taken(11.2) == ['INFO: R satisfied again at 11.200: x < 1 [step 1: x = 0.0]']
    assert log.taken(20.0) == []


def test_what_comes_within_a_second_is_counted_and_the_latest_is_logged(log: Log) -> None:
    log.happens(10.0)
    for tenth in range(1, 9):
        log.happens(10 + tenth / 10)
    log.happens(10.0, 1)  # the other requirement has its own line
    assert len(log.taken(10.9)) == 2
    assert log.taken(11.0) == ['ERROR: R violated at 10.800: x < 1 [step 8: x = 2.0] '
                               '(7 more violations since the last line)']
    log.happens(11.5, is_over=True)
    log.happens(11.6)
    log.happens(11.7, is_over=True)
    assert log.taken(11.9) == []
    assert log.taken(12.0) == ['ERROR: R violated at 11.600: x < 1 [step 10: x = 2.0]',
                               'INFO: R satisfied again at 11.700: x < 1 [step 11: x = 0.0]']
    assert log.taken(20.0) == []


def test_each_instance_has_a_line_at_once_but_once_a_second(tmp_path: Path) -> None:
    bundle = tmp_path / 'bundle.yaml'
    bundle.write_text(TRACKS, encoding='utf-8')
    reading = build.read(bundle, takes_instances=True)
    log = Log(build.compile_monitor(build.generate_monitor(reading)).monitor)
    for now, track in ((10.0, b'a'), (10.1, b'b'), (10.2, b'a'), (10.3, b'b')):
        message = b'\0\1\0\0' + struct.pack('<iIi', 2, 0, 2) + track + b'\0'
        log.engine.message(0, message, int(now * 1e9))
        log.detail_comes(now)
    assert [line.split(' violated at ')[0] for line in log.lines] == [
        'ERROR: R[track=a]', 'ERROR: R[track=b]']
    (line,) = log.taken(11.5)[2:]
    assert line.startswith('ERROR: R[track=b] violated at 10.300')
    assert line.endswith('(1 more violation of R since the last line)')


def test_one_more_violation_is_in_the_singular(log: Log) -> None:
    for tenth in range(3):
        log.happens(10 + tenth / 10)
    assert log.taken(11.0)[1:] == ['ERROR: R violated at 10.200: x < 1 [step 2: x = 2.0] '
                                   '(1 more violation since the last line)']


def test_each_violation_is_in_a_line_of_its_severity_although_all_are_short(log: Log) -> None:
    found = []
    for quarter in range(24):
        log.happens(10 + quarter / 4)
        log.happens(10 + quarter / 4 + 0.05, is_over=True)
        found += log.taken(10 + quarter / 4 + 0.2)
    log.end()
    found += log.lines
    errors = [line for line in found if line.startswith('ERROR: R violated at ')]
    more = [int(line.rpartition('(')[2].split()[0]) for line in errors if 'more viol' in line]
    assert len(errors) + sum(more) == 24
    assert 6 <= len(errors) <= 7
    assert all('INFO: R satisfied again at' in line for line in found if line not in errors)


def test_violations_without_details_are_counted_and_their_end_is_logged(log: Log) -> None:
    log.happens(10.0)
    for tenth in range(1, 4):
        log.happens(10 + tenth / 10, has_detail=False)
    assert log.taken(11.0)[1:] == ['ERROR: R violated 3 times more, without details: x < 1']
    log.happens(11.5, is_over=True, has_detail=False)
    assert log.taken(12.0) == ['INFO: R satisfied again: x < 1']
    log.happens(12.5, has_detail=False)
    log.happens(12.6, is_over=True)
    assert log.taken(13.0) == ['ERROR: R violated once more, without details: x < 1',
                               'INFO: R satisfied again at 12.600: x < 1 [step 6: x = 0.0]']
    assert log.taken(20.0) == []


def test_a_violation_whose_detail_is_on_its_way_is_logged_once(log: Log) -> None:
    log.happens(10.0)
    log.happens(10.1, is_over=True)
    log.engine.message(0, a_float(2.0), 10_200_000_000)  # its detail is on its way
    assert log.taken(11.0)[1:] == ['INFO: R satisfied again at 10.100: x < 1 [step 1: x = 0.0]']
    log.detail_comes(11.1)
    assert log.taken(12.0) == ['ERROR: R violated at 10.200: x < 1 [step 2: x = 2.0]']
    log.happens(13.5, is_over=True)
    assert log.taken(13.5) == ['INFO: R satisfied again at 13.500: x < 1 [step 3: x = 0.0]']


def test_an_end_without_a_detail_does_not_have_the_time_of_an_earlier_one(log: Log) -> None:
    log.happens(10.0)
    log.happens(10.1, is_over=True)
    log.happens(10.2, has_detail=False)
    log.happens(10.3, is_over=True, has_detail=False)
    assert log.taken(11.0)[1:] == ['ERROR: R violated once more, without details: x < 1',
                                   'INFO: R satisfied again: x < 1']


def test_the_end_of_a_violation_by_a_reset_is_logged_however_late(log: Log) -> None:
    log.happens(10.0)
    assert log.taken(15.0)[1:] == []
    log.engine.reset()
    assert log.taken(15.1) == ['INFO: R satisfied again: x < 1']
    assert log.taken(20.0) == []


Event = tuple[str, int]


@given(st.lists(st.tuples(st.sampled_from(['false', 'false', 'true', 'take', 'review', 'drop',
                                           'reset']), st.integers(0, 700)), max_size=60),
       st.sampled_from([1, 3, 1000]))
def test_each_violation_is_in_one_line_whatever_becomes_of_its_detail(
        two: Monitor, events: list[Event], most: int) -> None:
    log = Log(two, most)
    now, violations, is_violated = 10_000, 0, False
    for what, later in [*events, ('take', 0)]:
        now += later
        if what in ('false', 'true'):
            log.engine.message(0, a_float(2.0 if what == 'false' else 0.0), now * 10**6)
            violations += what == 'false'
            is_violated = what == 'false'
        elif what == 'take':
            log.details_come(now / 1000)
        elif what == 'review':
            log.review(now / 1000)
        elif what == 'drop':
            log.engine.want_details(False)
            log.engine.want_details(True, most)
        else:
            log.engine.reset()
            is_violated = False
    log.end()
    assert sum(map(number_of, log.lines)) == violations
    ends = ['satisfied' in line for line in log.lines]
    assert not any(ends[:1]) and (True, True) not in pairwise(ends)
    assert (not ends or ends[-1]) is not is_violated
    times = [float(line.split(' at ')[1].split(':')[0]) for line in log.lines if ' at ' in line]
    assert times == sorted(times)


def number_of(line: str) -> int:
    """Return for how many violations a line stands."""
    more = re.search(r'\((\d+) more violations? since the last line\)', line)
    unseen = re.search(r'violated (\d+ times|once) more', line)
    if unseen is not None:
        return 1 if unseen[1] == 'once' else int(unseen[1].split()[0])
    return ('violated at' in line) + (0 if more is None else int(more[1]))


def test_a_requirement_of_which_no_detail_came_is_logged_too(log: Log) -> None:
    log.happens(10.0)
    log.happens(10.1, 1, has_detail=False)  # the queue was full
    assert log.taken(11.0)[1:] == ['WARN: Q violated once more, without details: y < 1']
    assert log.taken(20.0) == []


def test_what_was_left_out_is_logged_at_the_end(log: Log) -> None:
    log.happens(10.0)
    log.happens(10.1, is_over=True)
    log.end()
    assert log.lines[1:] == ['INFO: R satisfied again at 10.100: x < 1 [step 1: x = 0.0]']


OF_ALL_KINDS = """
format: 1
component: arm
inputs:
  step: {topic: gait, type: std_msgs/msg/Int32, values: {STAND: 0, WALK: 42}}
  stamp: {topic: imu, type: std_msgs/msg/Int32, initial: 7, timeout: 1.0, startup: 1.0,
          stale: violate}
  on: {topic: on, type: std_msgs/msg/Bool}
constants: {time: 48.50, silent: 0, other: 1}
definitions: {few: step + stamp < time}
evaluation: POLICY
requirements:
  - {id: R, title: Few  steps, ptltl: "few & (on | step < silent)"}
"""


@pytest.mark.parametrize(('policy', 'place', 'shown'), [
    ('{policy: relevant_message}', ('step', '1'), 'step 1'),
    ('{policy: timed}', ('time', '0.249999998'), '0.249999998 s after its start')])
def test_the_logger_words_a_detail_that_it_receives_as_the_monitor_does(
        policy: str, place: tuple[str, str], shown: str, tmp_path: Path) -> None:
    engine = engine_of(tmp_path, OF_ALL_KINDS.replace('POLICY', policy))
    engine.want_details(True)
    manifest = engine.monitor.manifest
    reporter = Reporter(engine, ReportTable(manifest))
    begin, later = 1_000_000_000, 1_250_000_000
    engine.advance(begin)
    engine.message(2, b'\0\1\0\0\1', begin)
    engine.message(1, an_int(7), begin)
    engine.message(0, an_int(0), begin)
    engine.message(0, an_int(42), later)
    engine.advance(later + 1)
    detail = engine.take_detail(0)
    assert detail is not None
    found = reporter.detail(detail)
    assert found == StatusRecord(2, 'R', 'Few steps', 'arm', (
        place, ('stamp', '1.250000000'), ('suppressed', '0'), ('silent', ''),
        ('input step', 'WALK'), ('input stamp', '7'), ('on', 'true'),
        ('constant time', '48.50'), ('constant silent', '0')))
    received = read_detail(engine.library, found)
    assert received is not None
    requirement, = manifest.requirements
    line, = ViolationLines(engine.library, 'R', requirement.sentence, requirement.severity) \
        .violated(received.stamp, received)
    assert [line] == ViolationLog(reporter).add(detail)
    assert line.text.endswith(
        f') [{shown}: step = WALK, stamp = 7, on = true, time = 48.50, silent = 0]')


@pytest.mark.parametrize(('policy', 'unit', 'place', 'about', 'shown'), [
    ('every_message', '', ('step', '3'), ('about step', '1'), 'step 3, about step 1'),
    ('timed', ' s', ('time', '2'), ('about time', '0'),
     '2 s after its start, about 0 s after its start')])
def test_the_step_that_a_verdict_on_the_future_is_about_is_in_details_and_log(
        policy: str, unit: str, place: tuple[str, str], about: tuple[str, str], shown: str,
        tmp_path: Path) -> None:
    engine = engine_of(tmp_path, f"""
format: 1
evaluation: {{policy: {policy}}}
inputs: {{x: {{topic: x, type: std_msgs/msg/Float32}}}}
requirements: [{{id: R, mltl: "F[0,2{unit}] (x > 1)"}}]
""")
    engine.want_details(True)
    reporter = Reporter(engine, ReportTable(engine.monitor.manifest))
    engine.advance(10**9)
    values = (2.0, 0.0, 0.0, 0.0) if not unit else (0.0,)
    for second, value in enumerate(values, 1):
        engine.message(0, a_float(value), second * 10**9)
    engine.advance(4 * 10**9)
    detail = engine.take_detail(0)
    assert detail is not None
    found = reporter.detail(detail)
    assert (found.values[0], found.values[-1]) == (place, about)
    line, = ViolationLog(reporter).add(detail)
    assert line.text.endswith(f' [{shown}: x = 0.0]')


RIGHT = (('step', '3'), ('stamp', '12.345678901'), ('suppressed', '2'), ('silent', 'y'))


def test_a_silent_input_and_a_gate_that_withheld_are_in_the_line() -> None:
    library = load_evaluator(evaluator_library())
    lines = ViolationLines(library, 'R', 'x < 1', Severity.WARN)
    withheld = ('x', '(none yet)'), ('withheld by', 'door')
    detail = read_detail(library, StatusRecord(1, 'R', '', '', RIGHT + withheld))
    assert detail is not None
    assert (detail.stamp, detail.suppressed, detail.is_recovery) == (12_345_678_901, 2, False)
    line, = lines.violated(detail.stamp, detail)
    assert (line.level.name, line.text) == (
        'WARN', 'R violated at 12.346: x < 1 [step 3, no message for y: x = (none yet)], '
        "withheld by gate 'door'")
    line, = lines.violated(7 * 10**9, None)
    assert line.text == 'R violated at 7.000: x < 1'
    over = read_detail(library, StatusRecord(0, 'R', '', '', (('time', '2.5'), *RIGHT[1:])))
    assert over is not None and over.is_recovery
    line, = lines.satisfied(over)
    assert (line.level.name, line.text) == (
        'INFO', 'R satisfied again at 12.346: x < 1 [2.5 s after its start, no message for y: ]')


@pytest.mark.parametrize(('place', 'pair'), [
    (0, ('step', 'one')), (0, ('step', '1.5')), (0, ('step', '')), (0, ('step', '1' * 21)),
    (0, ('time', '1.')), (0, ('time', '-1')), (0, ('place', '1')), (1, ('stamp', 'nan')),
    (1, ('stamp', '1.5')), (1, ('stamp', '1.0000000000')), (1, ('stamp', '9999999999.000000000')),
    (1, ('time', '12.345678901')), (2, ('suppressed', '-1')), (3, ('silence', 'y'))])
def test_a_status_of_another_form_is_no_detail(place: int, pair: tuple[str, str]) -> None:
    library = load_evaluator(evaluator_library())
    values = [*RIGHT]
    assert read_detail(library, StatusRecord(1, 'R', '', '', tuple(values))) is not None
    for number in range(4):
        assert read_detail(library, StatusRecord(1, 'R', '', '', tuple(values[:number]))) is None
    values[place] = pair
    assert read_detail(library, StatusRecord(1, 'R', '', '', tuple(values))) is None
