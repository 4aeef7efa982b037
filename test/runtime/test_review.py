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

"""What a node logs once a second: inputs and topics, and what cannot be used."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from fret_monitor.messages.serialize import Value
from fret_monitor.runtime.reporting import TopicFacts
import pytest
from runtime.reviewed import ERROR, OK, Reviewed, SECOND, WARN

BUNDLE = """
format: 1
inputs:
  x: {topic: t, type: geometry_msgs/msg/Point, field: x, timeout: 1.5, startup: 3,
      stale: violate}
  y: {topic: t, type: geometry_msgs/msg/Point, field: y, timeout: 1.5, startup: 3,
      stale: violate}
  z: {topic: z, type: std_msgs/msg/Float32, timeout: 0.5}
  n: {topic: n, type: std_msgs/msg/Float32}
requirements:
  - {id: R, ptltl: "x < 1.0 & n < 1.0"}
  - {id: S, ptltl: "y < 1.0 & z < 1.0"}
"""
NONE = (0, 0.0, False)


@pytest.fixture
def reviewed(tmp_path: Path) -> Reviewed:
    return Reviewed(tmp_path, BUNDLE)


def silent(*, is_first: bool = False,
           x: tuple[int, float, bool] = NONE, y: tuple[int, float, bool] = NONE,
           z: tuple[int, float, bool] = NONE) -> Callable[[Any], None]:
    """Return what lets inputs have silences: how many, seconds, whether they last."""
    def change(seen: Any) -> None:
        for place, (count, seconds, is_silent) in enumerate((x, y, z)):
            seen.inputs[place].silence = (
                count, int(seconds * SECOND), count if is_first else 0, is_silent)
    return change


def test_a_silence_is_logged_once_with_the_requirements_that_it_violates(
    reviewed: Reviewed,
) -> None:
    now, over = (1, 2.0, True), (1, 3.0, False)
    assert reviewed.lines(silent()) == []
    assert reviewed.lines(silent(x=now, y=now)) == [
        "ERROR no usable value on /robot/t within the timeout of 1.5 s for 'x', 'y': R, S "
        'violated until one comes']
    assert reviewed.lines(silent(x=now, y=now)) == []
    assert reviewed.lines(silent(x=now, y=now, z=now)) == [
        "WARN no usable value on /robot/z within the timeout of 0.5 s for 'z'"]
    assert reviewed.lines(silent(x=over, y=now, z=now)) == [
        "INFO values on /robot/t again after 3.0 s, for 'x'"]
    assert reviewed.lines(silent(x=over, y=now, z=now)) == []


def test_a_silence_between_two_reviews_is_logged_with_its_end(reviewed: Reviewed) -> None:
    begun = "WARN no usable value on /robot/z within the timeout of 0.5 s for 'z'"
    again = "WARN again no usable value on /robot/z within the timeout of 0.5 s for 'z'"
    assert [reviewed.lines(silent(z=(count, seconds, is_silent)))
            for count, seconds, is_silent in (
        (1, 2.0, False), (2, 1.0, True), (3, 1.0, True), (3, 1.0, False), (5, 1.0, True),
    )] == [
        [begun, "INFO values on /robot/z again after 2.0 s, for 'z'"], [begun], [again],
        ["INFO values on /robot/z again after 1.0 s, for 'z'"], [again]]


def test_a_silence_before_the_first_value_is_logged_with_the_startup(reviewed: Reviewed) -> None:
    now = (1, 12.0, True)
    assert reviewed.lines(silent(is_first=True, x=now, z=now)) == [
        "ERROR no usable value on /robot/t within the startup of 3 s for 'x': R violated until "
        'one comes', "WARN no usable value on /robot/z within the startup of 10 s for 'z'"]


@pytest.mark.parametrize('is_over', [True, False])
def test_a_value_after_the_startup_makes_no_timeout_of_it(
    reviewed: Reviewed, *, is_over: bool,
) -> None:
    reviewed.engine.advance(12 * SECOND)
    if is_over:
        reviewed.send(1, {'data': 0.5}, 12.0)
    assert reviewed.lines()[1:] == [
        "WARN no usable value on /robot/z within the startup of 10 s for 'z'",
        *(["INFO values on /robot/z again after 11.0 s, for 'z'"] if is_over else [])]
    if not is_over:
        reviewed.send(1, {'data': 0.5}, 12.0)
    reviewed.engine.advance(13 * SECOND)
    assert reviewed.lines()[-1].endswith("the timeout of 0.5 s for 'z'")


def test_the_silences_of_instances_are_of_the_startup_or_of_the_timeout(tmp_path: Path) -> None:
    keyed = Reviewed(tmp_path, """
format: 1
for_each: {robot: [a, b, c]}
inputs:
  v: {topic: t, type: sensor_msgs/msg/Temperature, where: "header.frame_id = {robot}",
      field: temperature, timeout: 0.5, startup: 3}
requirements:
  - {id: R, ptltl: "v < 1.0"}
""", takes_instances=True)
    line = ("WARN no usable value on /robot/t where header.frame_id = {robot} within the %s s for "
            "'v', of %d instance%s")
    keyed.send(0, {'header': {'frame_id': 'a'}}, 2.0)
    keyed.engine.advance(5 * SECOND)
    assert keyed.lines() == [line % ('startup of 3', 2, 's'), line % ('timeout of 0.5', 1, '')]
    keyed.send(0, {'header': {'frame_id': 'b'}}, 5.0)
    keyed.engine.advance(6 * SECOND)
    assert keyed.lines() == [line % ('timeout of 0.5', 1, '')]


def test_a_silence_of_the_engine_is_logged_and_is_the_status_of_its_topic(
    reviewed: Reviewed,
) -> None:
    reviewed.send(1, {'data': 0.5}, 1.1)
    reviewed.send(0, {}, 1.1)
    reviewed.engine.advance(2 * SECOND)
    assert reviewed.lines() == [
        "WARN no usable value on /robot/z within the timeout of 0.5 s for 'z'"]
    found = reviewed.summaries()
    assert found['topic /robot/z'] == (WARN, 'nothing for 0.9 s of z')
    assert found['topic /robot/t'] == (OK, 'received')
    assert found['S'] == (WARN, 'satisfied, on old values of z')
    reviewed.engine.advance(3 * SECOND)
    found = reviewed.summaries()
    assert found['topic /robot/t'] == (ERROR, 'nothing for 1.9 s of x, y')
    assert found['S'] == (ERROR, 'violated: no message for y')
    assert found['R'] == (ERROR, 'violated: no message for x')
    assert found['topic /robot/n'] == (OK, 'received')
    values = dict(reviewed.statuses()['topic /robot/t'].values)
    assert (values['silences x'], values['silences y'], values['received']) == ('1', '1', '1')
    assert 'silences n' not in dict(reviewed.statuses()['topic /robot/n'].values)


def test_diagnostics_have_the_time_of_each_silent_input(reviewed: Reviewed) -> None:
    def message(y: tuple[int, float, bool]) -> str:
        return reviewed.summaries(silent(x=(1, 1.0, True), y=y))['topic /robot/t'][1]

    assert message(NONE) == 'nothing for 1.0 s of x'
    assert message((1, 1.0, True)) == 'nothing for 1.0 s of x, y'
    assert message((1, 16.0, True)) == 'nothing for 1.0 s of x, for 16.0 s of y'


# Messages that cannot be used.

FIELDS = """
format: 1
inputs:
  effort: {topic: joints, type: sensor_msgs/msg/JointState, field: "effort[1]"}
  elbow: {topic: joints, type: sensor_msgs/msg/JointState, field: "position[name = elbow]"}
  state: {topic: state, type: std_msgs/msg/String, values: {IDLE: "idle", GO: "go"}}
  near: {topic: scan, type: sensor_msgs/msg/LaserScan, field: "min(ranges)"}
  part: {topic: scan, type: sensor_msgs/msg/LaserScan, field: "min(ranges[-10:])"}
  ahead: {topic: scan, type: sensor_msgs/msg/LaserScan, field: "min(ranges[0 rad : 1 rad])"}
requirements:
  - {id: R, ptltl: "effort < 1.0 & elbow < 1.0 & state = GO & near + part + ahead > 1.0"}
"""
JOINTS, STATE, SCAN = range(3)


@pytest.fixture
def fields(tmp_path: Path) -> Reviewed:
    return Reviewed(tmp_path, FIELDS)


@pytest.mark.parametrize(('size', 'shown'), [(1, '1 element'), (0, '0 elements')])
def test_an_array_that_is_too_short_is_logged_once_with_its_size(
    fields: Reviewed, size: int, shown: str,
) -> None:
    message: dict[str, Value] = {'effort': [1.0] * size, 'name': ['elbow'], 'position': [1.0]}
    fields.send(JOINTS, message, 1.1)
    assert fields.lines() == [
        f"WARN /robot/joints: effort[1] cannot be read (the array has {shown}); input 'effort' "
        'has no value yet']
    assert fields.summaries()['topic /robot/joints'] == (OK, 'received')
    fields.send(JOINTS, message, 1.2)
    status = fields.statuses()['topic /robot/joints']
    assert (status.level, status.message) == (WARN, 'fields cannot be used: effort')
    assert dict(status.values)['unusable effort'] == '2'
    assert fields.lines() == []


def test_a_string_outside_the_values_is_logged_and_a_long_one_cut(tmp_path: Path) -> None:
    fields = Reviewed(tmp_path, FIELDS)
    fields.send(STATE, {'data': 'go'}, 1.1)
    fields.send(STATE, {'data': "brö'ken\n"}, 1.2)
    assert fields.lines() == [
        r"WARN /robot/state: data is 'br\xc3\xb6\x27ken\x0a', which is not among its values in "
        "the bundle; input 'state' keeps its value"]
    fields = Reviewed(tmp_path, FIELDS)
    fields.send(STATE, {'data': 'x' * 100_000}, 1.1)
    line, = fields.lines()
    assert f"data is '{'x' * 60}'..., which" in line


def test_a_field_of_an_instance_that_cannot_be_used_is_logged_once_with_its_key(
    tmp_path: Path,
) -> None:
    keyed = Reviewed(tmp_path, """
format: 1
for_each: {robot: {most: 4}}
inputs:
  x: {topic: joints, type: sensor_msgs/msg/JointState, where: "header.frame_id = {robot}",
      field: "position[1]"}
requirements:
  - {id: R, ptltl: x < 5.0}
""", takes_instances=True)
    for name in ('alpha', 'beta'):
        keyed.send(0, {'header': {'frame_id': name}, 'position': [1.0]}, 1.1)
    assert keyed.lines() == [
        'WARN /robot/joints where header.frame_id = {robot}: position[1] cannot be read (the '
        "array has 1 element); input 'x' of robot alpha keeps its value, if it has one"]
    keyed.send(0, {'header': {'frame_id': 'beta'}, 'position': [1.0]}, 1.2)
    assert keyed.lines() == []


def test_what_a_reduction_cannot_be_made_of_is_logged(fields: Reviewed) -> None:
    fields.send(SCAN, {'ranges': [], 'angle_min': 0.5}, 1.1)
    assert fields.lines() == [
        "WARN /robot/scan: min(ranges) has no value (no element is there); input 'near' has no "
        'value yet',
        'WARN /robot/scan: min(ranges[-10:]) cannot be read (the array has 0 elements); input '
        "'part' has no value yet",
        'WARN /robot/scan: min(ranges[0 rad : 1 rad]) has no value (no element is there); input '
        "'ahead' has no value yet"]


def test_a_name_is_logged_after_ten_seconds_and_again_when_it_was_lost(fields: Reviewed) -> None:
    lines: list[str] = []

    def pass_seconds(seconds: int, *, is_found: bool) -> None:
        for _ in range(seconds):
            fields.now += 1.0
            fields.send(JOINTS, {'name': ['elbow' if is_found else 'wrist'], 'position': [1.0],
                                 'effort': [1.0, 1.0]}, fields.now)
            lines.extend(line for line in fields.lines() if 'evaluated' not in line)

    def status() -> str:
        return fields.summaries()['topic /robot/joints'][1]

    line = 'WARN /robot/joints: no message has had position[name = elbow] for 10 s; input '
    pass_seconds(10, is_found=False)
    assert lines == [] and 'no message has had' not in status()
    pass_seconds(1, is_found=False)
    assert lines == [f"{line}'elbow' has no value yet"]
    pass_seconds(30, is_found=False)
    assert len(lines) == 1
    assert 'no message has had the names for 10 s: elbow' in status()
    pass_seconds(1, is_found=True)
    assert status() == 'received'
    pass_seconds(9, is_found=False)
    pass_seconds(1, is_found=True)  # another node's message has it
    pass_seconds(9, is_found=False)
    assert len(lines) == 1
    pass_seconds(9, is_found=False)
    assert lines[1:] == [f"{line}'elbow' keeps its value"]


def test_a_message_that_cannot_be_decoded_is_logged_once(reviewed: Reviewed) -> None:
    reviewed.engine.message(0, b'', SECOND)
    assert reviewed.lines() == [
        'ERROR a message on /robot/t cannot be decoded as geometry_msgs/msg/Point; such messages '
        'are counted and are no step']
    reviewed.engine.message(0, b'', SECOND)
    assert reviewed.lines() == []
    assert dict(reviewed.statuses()['topic /robot/t'].values)['undecodable'] == '2'


STAMPED = """
format: 1
evaluation: {policy: timed, stamp: header, reorder: 0.5}
inputs:
  x: {topic: t, type: geometry_msgs/msg/PointStamped, field: point.x}
  y: {topic: u, type: geometry_msgs/msg/PointStamped, field: point.x}
requirements:
  - {id: R, ptltl: "H (x < 1.0 & y < 1.0)"}
"""


def test_stamps_that_are_ahead_or_out_of_order_are_logged_once(tmp_path: Path) -> None:
    reviewed = Reviewed(tmp_path, STAMPED)

    def change(seen: Any) -> None:
        seen.topics[0].order = (1, 2, 3, int(7.25 * SECOND))
        seen.topics[1].order = (0, 2, 0, 0)

    assert reviewed.lines(change) == [
        "WARN stamps of messages on /robot/t are 7.2 s ahead of this node's clock: the messages "
        'take effect that much later; synchronize the clocks; /diagnostics counts such messages',
        'WARN messages on /robot/t come later than 0.5 s (`reorder`) after their stamps: they '
        'take effect when they come; raise `reorder`',
        'WARN messages on /robot/u take effect too early: too many wait for earlier stamps']
    assert reviewed.lines(change) == []
    reviewed.look()
    status = reviewed.statuses(change)['topic /robot/t']
    assert (status.level, status.message) == (WARN, (
        '1 late since the last report; 2 too early since the last report; 3 ahead of the clock '
        'since the last report'))
    values = dict(status.values)
    assert (values['late'], values['too early'], values['ahead']) == ('1', '2', '3')


# What is missing.

def with_requirements(count: int) -> str:
    """Return a bundle of so many requirements, each with an input and topic of its own."""
    lines = ['format: 1', 'evaluation: {policy: relevant_message}', 'inputs:']
    lines += [f'  x{k}: {{topic: t{k}, type: std_msgs/msg/Float32}}' for k in range(count)]
    lines += ['  unread: {topic: unread, type: std_msgs/msg/Float32}', 'requirements:']
    return '\n'.join(lines + [f'  - {{id: R-{k}, ptltl: "x{k} < 1.0"}}' for k in range(count)])


def test_what_is_missing_is_logged_once_after_five_seconds(tmp_path: Path) -> None:
    reviewed = Reviewed(tmp_path, with_requirements(2))
    reviewed.send(0, {'data': 0.5}, 1.1)
    reviewed.topics[1] = TopicFacts(2)
    reviewed.now += 4.9
    assert reviewed.lines() == []
    reviewed.now += 0.1
    assert reviewed.lines() == ["WARN R-1 is not evaluated yet: nothing received on /robot/t1 (2 "
                                "publishers) for 'x1'"]
    reviewed.now += 1.0
    assert reviewed.lines() == []


def test_nothing_is_missing_when_every_input_that_is_read_has_a_value(tmp_path: Path) -> None:
    reviewed = Reviewed(tmp_path, with_requirements(2))
    for topic in range(2):
        reviewed.send(topic, {'data': 0.5}, 1.1)
    reviewed.now += 6.0
    assert reviewed.lines() == []


def test_only_the_first_five_that_are_missing_are_named(tmp_path: Path) -> None:
    reviewed = Reviewed(tmp_path, with_requirements(7))
    reviewed.topics = [TopicFacts()] * len(reviewed.topics)
    reviewed.now += 6.0
    line, = reviewed.lines()
    assert line.startswith('WARN R-0, R-1, R-2, R-3, R-4 and 2 more are not evaluated yet: ')
    assert line.endswith("on /robot/t4 (0 publishers) for 'x4' and 2 more")
    assert 'x5' not in line and 'unread' not in line


def test_publishers_of_another_type_do_not_count_as_publishers(tmp_path: Path) -> None:
    reviewed = Reviewed(tmp_path, with_requirements(1))
    reviewed.topics[0] = TopicFacts(0, 'std_msgs/msg/Int32', '/other')
    reviewed.now += 6.0
    line, = reviewed.lines()
    assert '(0 publishers of std_msgs/msg/Float32)' in line
    assert reviewed.summaries()['topic /robot/t0'] == (ERROR, (
        'a publisher of std_msgs/msg/Int32, and not std_msgs/msg/Float32; not received: /other'))


def test_a_requirement_that_rests_on_initial_values_is_missing_its_messages(
    tmp_path: Path,
) -> None:
    reviewed = Reviewed(tmp_path, with_requirements(1).replace('Float32}', 'Float32, initial: 0}'))
    reviewed.send(1, {'data': 0.5}, 1.1)
    reviewed.now += 6.0
    assert reviewed.lines() == [
        "WARN R-0 is not evaluated yet: nothing received on /robot/t0 (1 publisher) for 'x0' (it "
        'has its initial value)']
    assert reviewed.summaries()['R-0'] == (WARN, 'not evaluated yet')
    reviewed.engine.message(0, b'', 2 * SECOND)
    again = Reviewed(tmp_path, with_requirements(1))
    again.engine.message(0, b'', 2 * SECOND)
    assert again.summaries()['R-0'] == (WARN, 'no value yet of x0')


def test_violations_that_were_not_published_are_logged_once_and_counted(
    reviewed: Reviewed,
) -> None:
    engine = reviewed.engine
    assert 'violations of bundle' not in reviewed.summaries()
    engine.library.fm_engine_count_unpublished(engine.pointer, 3)
    assert reviewed.lines() == ['ERROR violations could not be published: 3 so far; /diagnostics '
                                'counts them']
    engine.library.fm_engine_count_unpublished(engine.pointer, 2)
    status = reviewed.statuses()['violations of bundle']
    assert (status.level, status.message, status.values) == (
        ERROR, '2 not published since the last report', (('not published', '5'),))
    status = reviewed.statuses()['violations of bundle']
    assert (status.level, status.message) == (WARN, 'some were not published')
    assert reviewed.lines() == []


def test_before_the_first_look_there_is_no_status(reviewed: Reviewed) -> None:
    assert reviewed.review.statuses() == []


def test_publishers_of_too_few_topics_are_refused(reviewed: Reviewed) -> None:
    reviewed.topics = []
    with pytest.raises(ValueError, match='each topic'):
        reviewed.look()
