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

"""What a node logs and shows of locks, its gate, actions, the black box and its threads."""

from pathlib import Path
import struct
from time import time_ns
from typing import Any

from bundles import ARMED
from fret_monitor.native.binding import ffi
from fret_monitor.runtime.reporting import GateFacts, TopicFacts
import pytest
from runtime.reviewed import ERROR, OK, Reviewed, SECOND, WARN

BUNDLE = """
format: 1
evaluation: {policy: relevant_message}
report: occurrence
inputs:
  x: {topic: raw, type: std_msgs/msg/Float32}
  y: {topic: y, type: std_msgs/msg/Float32, timeout: 1}
requirements:
  - {id: X, ptltl: "H (x < y)", on_violation: [stop, call]}
actions:
  stop: {lock: {topic: e_stop, rate: 10}}
  call: {call: {service: halt, type: std_srvs/srv/Trigger}}
gates:
  drive: {from: raw, to: out, type: std_msgs/msg/Float32, keep: [X]}
"""


class Acting(Reviewed):
    """The review of a gate and a lock of its requirement."""

    def __init__(self, folder: Path, text: str = BUNDLE) -> None:
        super().__init__(folder, text, gate='drive')
        self.raw = self.manifest.topics[0].name != 'raw'

    def judge(self, value: float, seconds: float) -> None:
        self.engine.judge(b'\0\1\0\0' + struct.pack('<f', value), int(seconds * 1e9))

    def sense(self, value: float, seconds: float) -> None:
        self.send(1 - self.raw, {'data': value}, seconds)

    def logged(self) -> list[str]:
        return [line.removeprefix('INFO ') for line in self.lines()]


@pytest.fixture
def acting(tmp_path: Path) -> Acting:
    return Acting(tmp_path)


def test_each_change_of_locks_and_gates_is_logged_with_its_reason_however_short(
        acting: Acting) -> None:
    assert acting.logged() == [
        "lock 'stop' is locked: no value yet of x, y", "gate 'drive' is closed: no value yet of y"]
    assert acting.logged() == []
    acting.sense(5.0, 1.1)
    assert acting.logged() == [
        "gate 'drive' is open", "lock 'stop' is locked: no value yet of x"]
    # All between two looks: it opens, a violation, a silence of 10 ms, and open again.
    acting.judge(1.0, 1.2)
    acting.sense(0.5, 1.3)
    acting.sense(5.0, 1.4)
    acting.engine.advance(int(2.41 * SECOND))
    acting.sense(5.0, 2.42)
    assert [line for line in acting.logged() if 'lock' in line or 'gate' in line] == [
        "lock 'stop' is free",
        "lock 'stop' is locked: violated: X", "gate 'drive' is closed: violated: X",
        "lock 'stop' is free", "gate 'drive' is open",
        "lock 'stop' is locked: no message for y", "gate 'drive' is closed: no message for y",
        "lock 'stop' is free", "gate 'drive' is open"]
    assert acting.logged() == []


def test_changes_that_come_too_fast_are_counted_and_the_state_is_logged(acting: Acting) -> None:
    acting.sense(5.0, 1.1)
    acting.judge(1.0, 1.2)
    assert acting.logged() == ["lock 'stop' is locked: no value yet of x", "gate 'drive' is open",
                               "lock 'stop' is free"]
    for number in range(20):
        acting.sense(0.5 if number % 2 == 0 else 5.0, 1.3 + number / 1000)
    found = acting.logged()
    assert found.count("lock 'stop' is locked: violated: X") == 5
    assert found[-4:] == ["lock 'stop' has changed 10 times more since",
                          "gate 'drive' has changed 10 times more since",
                          "lock 'stop' is free", "gate 'drive' is open"]
    for number in range(11):
        acting.sense(0.5 if number % 2 == 0 else 5.0, 1.35 + number / 1000)
    assert "lock 'stop' has changed 1 time more since" in acting.logged()
    acting.sense(5.0, 1.39)
    acting.logged()
    for number in range(101):
        acting.sense(0.5 if number % 2 == 0 else 5.0, 1.4 + number / 1000)
    found = acting.logged()
    assert found[-3:] == ['37 more changes of what locks and gates depend on came too fast to be '
                          'logged', "lock 'stop' is locked: violated: X",
                          "gate 'drive' is closed: violated: X"]
    for number in range(65):
        acting.sense(5.0 if number % 2 == 0 else 0.5, 1.6 + number / 1000)
    assert '1 more change of what locks and gates depend on came too fast to be logged' \
        in acting.logged()
    assert acting.logged() == []


def test_a_gate_that_has_withheld_all_since_the_start_says_so(acting: Acting) -> None:
    acting.sense(0.5, 1.1)
    acting.judge(1.0, 1.2)
    assert acting.logged() == [
        "lock 'stop' is locked: no value yet of x", "gate 'drive' is open",
        "gate 'drive' is closed: violated since the first message: X",
        "lock 'stop' is locked: violated: X; no value yet of x"]
    assert acting.summaries()['X'] == (ERROR, 'violated since the first message')
    acting.now += 6.0
    assert acting.logged() == []  # nothing is missing


def test_an_input_that_is_silent_from_the_start_has_no_value_yet(acting: Acting) -> None:
    acting.engine.advance(60 * SECOND)
    assert acting.summaries()['lock stop'] == (WARN, 'locked: no value yet of x, y')
    assert acting.summaries()['topic /robot/y'][0] == WARN  # silent


def test_a_requirement_is_violated_while_messages_are_withheld_for_it(acting: Acting) -> None:
    acting.sense(5.0, 1.1)
    acting.judge(1.0, 1.2)
    assert acting.summaries()['X'] == (OK, 'satisfied')
    acting.judge(9.0, 1.3)
    assert acting.summaries()['X'] == (ERROR, 'violated')
    acting.judge(1.0, 1.4)
    assert acting.summaries()['X'] == (OK, 'satisfied')


def test_a_lock_says_that_its_requirement_was_not_evaluated_since_a_reset(acting: Acting) -> None:
    acting.sense(5.0, 1.1)
    acting.judge(1.0, 1.2)
    assert acting.summaries()['lock stop'] == (OK, 'free')
    acting.engine.reset()
    assert acting.summaries()['lock stop'] == (
        WARN, 'locked: not evaluated since the start, ~/reset or a pause of this node: X')


@pytest.mark.parametrize(('latch', 'end'), [
    ('true', '~/reset'), ('true, open_after: 2.5', '2.5 s without a violation')])
def test_a_gate_that_is_latched_says_until_when(tmp_path: Path, latch: str, end: str) -> None:
    acting = Acting(tmp_path, BUNDLE.replace('keep: [X]}', f'keep: [X], latch: {latch}}}'))
    acting.sense(5.0, 1.1)
    acting.judge(1.0, 1.2)
    acting.judge(9.0, 1.3)
    assert f"gate 'drive' is closed: latched by a violation, until {end}" in acting.logged()


def test_the_status_of_a_gate_counts_what_it_did_and_names_who_goes_around_it(
        acting: Acting) -> None:
    def status(others: str = '', unsent: int = 0) -> Any:
        found = acting.statuses(gate=GateFacts(others, '/robot/out', unsent))['gate drive']
        return found.level, found.message, dict(found.values)

    acting.sense(5.0, 1.1)
    for value in (1.0, 9.0, 2.0):
        acting.judge(value, 1.2)
    level, message, values = status(unsent=3)
    assert (level, message) == (OK, 'open')
    assert values == {
        'passed': '2', 'withheld': '1', 'withheld, violating': '1', 'withheld, closed': '0',
        'withheld, latched': '0', 'withheld, unreadable': '0', 'replaced': '0',
        'replaced, violating': '0', 'not published': '3'}
    acting.sense(0.5, 1.3)
    assert status()[:2] == (WARN, 'closed: violated: X')
    assert status('/one, /other')[:2] == (ERROR, '/one, /other publishes on /robot/out too')


def test_what_is_wrong_around_a_gate_is_logged_at_most_every_ten_seconds(acting: Acting) -> None:
    def lines(others: str, unsent: int, violating: int) -> list[str]:
        def change(seen: Any) -> None:
            seen.gate.violating = violating

        acting.now += 1.0
        found = acting.lines(change, gate=GateFacts(others, '/robot/out', unsent))
        return [line for line in found if line.startswith(('ERROR', 'WARN gate'))]

    acting.sense(5.0, 1.1)
    acting.judge(1.0, 1.2)
    others = ("ERROR gate 'drive': /one publishes on /robot/out too: what does not pass the gate "
              'is not judged')
    unsent = "ERROR gate 'drive': {} messages could not be published"
    violating = ("WARN gate 'drive': a requirement is violated after the substitute, too: the "
                 'substitute itself violates it, or nothing on this topic satisfies it now')
    assert lines('', 0, 0) == []
    assert lines('/one', 2, 1) == [others, unsent.format(2), violating]
    assert [lines('/one', 2 + k, 1 + k) for k in range(9)] == [[]] * 9
    assert lines('/one', 12, 12) == [others, unsent.format(12), violating]
    for _ in range(11):
        assert lines('', 12, 12) == []


def acted(*counts: int) -> Any:
    """Return the counts of one action: started, sent, failed, skipped."""
    return ffi.new('struct fm_action_facts[]', [counts])


def written(*counts: int) -> Any:
    """Return counts of a black box: written, failed, kept, left out, early."""
    return ffi.new('struct fm_blackbox_facts *', counts)


def test_the_status_of_an_action_counts_what_it_did(acting: Acting) -> None:
    def status(*counts: int) -> Any:
        found = acting.statuses(actions=acted(*counts))['action call']
        return found.level, found.message, found.values

    assert status(1, 1, 0, 0)[:2] == (OK, 'ready')
    assert status(6, 3, 2, 4) == (ERROR, '2 failed since the last report', (
        ('started', '6'), ('sent', '3'), ('failed', '2'), ('skipped', '4')))
    assert status(6, 3, 2, 4)[:2] == (OK, 'ready')


def test_the_status_of_a_black_box_has_what_went_wrong_since_the_last_report(
        acting: Acting) -> None:
    def status(*counts: int) -> Any:
        found = acting.statuses(blackbox=written(*counts))[name]
        return found.level, found.message, found.values

    name = f'black box of {acting.manifest.name}'
    assert name not in acting.statuses()
    assert status(1)[:2] == (OK, 'keeps the last messages')
    assert status(1, 2, 30, 4, 5) == (WARN, (
        'cannot write; messages are larger than `blackbox_bytes`; `blackbox_bytes` is too little '
        'for `blackbox_seconds`'), (
        ('written', '1'), ('not written', '2'), ('kept', '30'), ('left out', '4'),
        ('overwritten early', '5')))
    assert status(1, 2, 30, 4, 5)[:2] == (OK, 'keeps the last messages')


def test_what_failed_before_the_node_was_deactivated_is_not_reported_again(acting: Acting) -> None:
    def found(*counts: int) -> list[tuple[int, str]]:
        shown = acting.summaries(actions=acted(0, 0, counts[0]),
                                 blackbox=written(0, counts[1]))
        return [shown['action call'], shown[f'black box of {acting.manifest.name}']]

    acting.activate_again(actions=acted(0, 0, 3), blackbox=written(0, 2))
    assert found(3, 2) == [(OK, 'ready'), (OK, 'keeps the last messages')]
    acting.activate_again(actions=acted(0, 0, 3), blackbox=written(0, 2))
    assert found(4, 3) == [(ERROR, '1 failed since the last report'), (WARN, 'cannot write')]


def test_a_review_is_freed_without_its_reporter(acting: Acting) -> None:
    acting.reporter.pointer.table = ffi.NULL  # the garbage collector may free it before
    acting.activate_again()
    assert acting.summaries()


def test_threads_that_failed_have_a_status(acting: Acting) -> None:
    assert 'threads' not in acting.statuses()
    status = acting.statuses(failures={'feed': 'ValueError: x', 'log': 'OSError: y'})['threads']
    assert (status.level, status.message) == (ERROR, 'failed: feed, log')
    assert status.values == (('feed', 'ValueError: x'), ('log', 'OSError: y'))


SERVICE = ARMED + """
gates:
  drive: {service: enable, to: enable_raw, type: std_srvs/srv/SetBool, keep: [ARMED],
          otherwise: {respond: {success: false}}}
"""


def test_a_gate_of_a_service_names_another_server_and_counts_what_was_not_answered(
        tmp_path: Path) -> None:
    gate = Reviewed(tmp_path, SERVICE, gate='drive')
    status = gate.statuses(gate=GateFacts('', 'enable', 4))['gate drive']
    assert (status.level, status.message) == (WARN, 'closed: no value yet of safe')
    assert status.values[-1] == ('not answered', '4')
    facts = GateFacts('enable', 'enable', 4)
    assert gate.summaries(gate=facts)['gate drive'] == (ERROR, 'enable has another server')
    gate.now += 11.0
    assert [line for line in gate.lines(gate=facts) if line.startswith('ERROR')] == [
        "ERROR gate 'drive': enable has another server: what does not pass the gate is not "
        'judged']


PLAIN = """
format: 1
inputs:
  n: {topic: n, type: std_msgs/msg/Int32}
requirements:
  - {id: R, title: "n is small", ptltl: "n < 0", severity: warn}
  - {id: H, ptltl: "H (n < 0)", report: occurrence}
"""


def test_a_requirement_and_a_topic_have_their_counts(tmp_path: Path) -> None:
    reviewed = Reviewed(tmp_path, PLAIN)
    reviewed.topics = [TopicFacts()]
    assert reviewed.summaries() == {
        'R': (WARN, 'no value yet of n'), 'H': (WARN, 'no value yet of n'),
        'topic /robot/n': (WARN, 'no publisher')}
    for place, value in enumerate((-1, 5, 6)):
        reviewed.send(0, {'data': value}, 1.1 + place)
    reviewed.now += 2.0
    found = reviewed.statuses()
    assert (found['R'].level, found['R'].message) == (WARN, 'violated')
    assert found['R'].values == (('steps', '3'), ('violations', '2'), ('announced', '2'),
                                 ('text', 'n is small'))
    assert (found['H'].level, found['H'].message) == (ERROR, 'violated')
    assert found['H'].values == (('steps', '3'), ('violations', '2'), ('announced', '1'),
                                 ('verdict', 'false'), ('text', 'H (n < 0)'))
    assert found['topic /robot/n'].values == (
        ('received', '3'), ('rate', '1.5'), ('undecodable', '0'), ('lost', '0'),
        ('behind', '0.000'), ('publishers', '0'))
    reviewed.send(0, {'data': -1}, 5.0)
    reviewed.now += 2.0
    last = reviewed.statuses()
    assert [last[name].level for name in 'RH'] == [OK, OK]
    assert [last[name].message for name in 'RH'] == ['satisfied'] * 2
    assert last['topic /robot/n'].values[:2] == (('received', '4'), ('rate', '0.5'))


def test_messages_that_were_lost_are_a_warning_once(tmp_path: Path) -> None:
    def lost(seen: Any) -> None:
        seen.topics[0].lost = 3

    reviewed = Reviewed(tmp_path, PLAIN)
    assert reviewed.summaries(lost)['topic /robot/n'] == (WARN, '3 lost since the last report')
    assert reviewed.summaries(lost)['topic /robot/n'] == (OK, 'received')


def test_one_of_several_bundles_is_named_with_its_topics(tmp_path: Path) -> None:
    reviewed = Reviewed(tmp_path, PLAIN.replace('inputs:', 'evaluation: {policy: timed}\ninputs:'),
                        name='mobile_base')
    assert list(reviewed.statuses()) == [
        'R', 'H', 'topic /robot/n for mobile_base', 'time of mobile_base']


def test_the_status_of_a_topic_has_the_longest_time_from_reception_to_evaluation(
        tmp_path: Path) -> None:
    reviewed = Reviewed(tmp_path, PLAIN)
    reviewed.engine.follow_steady()

    def after(milliseconds: int) -> tuple[int, str, float]:
        for late in (milliseconds, 0):
            reviewed.engine.message(
                0, b'\0\1\0\0\1\0\0\0', received=time_ns() - late * 10 ** 6)
        status = reviewed.statuses()['topic /robot/n']
        return status.level, status.message, float(dict(status.values)['behind'])

    level, message, behind = after(200)
    assert (level, message) == (OK, 'received') and 0.2 <= behind < 1.0
    level, message, behind = after(1240)
    assert level == WARN and message.startswith('evaluated up to 1.') and 1.24 <= behind < 1.95
    level, message, behind = after(0)
    assert (level, message) == (OK, 'received') and behind < 1.0
