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

"""The sign of life ends when the monitor ends, is stopped, or one of its threads hangs."""

from collections.abc import Callable
from pathlib import Path
import signal
from threading import Event, Thread
from time import monotonic, sleep
from types import SimpleNamespace
from typing import Any

from bundles import BELOW_HALF, write_bundle
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from fret_monitor.native import evaluator_library, load_evaluator
from fret_monitor.ros.intake.feed import Feed
from fret_monitor.ros.nodes.duplicate_nodes import DuplicateNodes
from fret_monitor.ros.nodes.monitor_node import MonitorNode
from fret_monitor.ros.nodes.sign_of_life import SignOfLife
from fret_monitor.ros.settings.overrides import DeclaredOverrides
from fret_monitor.ros.watch import Watch
from fret_monitor.runtime.reporting import LogLine, Review
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
import pytest
from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import LivelinessPolicy, QoSProfile
from ros.harness import change_state, make_node, Partner, RELIABLE, started, wait_until
from std_msgs.msg import Float32, Header

WATCHING = QoSProfile(depth=10, liveliness=LivelinessPolicy.MANUAL_BY_TOPIC,
                      liveliness_lease_duration=Duration(seconds=3))
LIBRARY = load_evaluator(evaluator_library())


def test_a_monitor_that_is_stopped_is_not_alive(partner: Partner, tmp_path: Path) -> None:
    bundle = write_bundle(tmp_path, BELOW_HALF)
    heard: list[Header] = []
    alive: list[int] = []

    def note(event: Any) -> None:
        alive.append(event.alive_count)

    partner.node.create_subscription(
        Header, '/robot/guard/alive', heard.append, WATCHING,
        event_callbacks=SubscriptionEventCallbacks(liveliness=note))
    with started('monitor', '-p', f'spec:={bundle}', '-r', '__ns:=/robot',
                 '-r', '__node:=guard') as node:
        before = partner.node.get_clock().now().nanoseconds / 1e9
        wait_until(lambda: len(heard) > 2, 'signs of life')
        assert heard[-1].frame_id == 'guard'
        assert -1.0 < heard[-1].stamp.sec - before < 20.0
        assert alive[-1] == 1
        node.process.send_signal(signal.SIGSTOP)
        wait_until(lambda: alive[-1] == 0, 'the end of the lease')
        node.process.send_signal(signal.SIGCONT)
        wait_until(lambda: alive[-1] == 1, 'a sign of life')
        assert 'hangs' not in node.output


def test_there_is_no_sign_of_life_while_a_thread_hangs(partner: Partner) -> None:
    node: Any = Node('guard', context=partner.context)
    turns = {'announcer': 0, 'feed': 0, 'details': 0}
    heard: list[Header] = []
    partner.node.create_subscription(Header, '/guard/alive', heard.append, RELIABLE)
    life = SignOfLife(node, LIBRARY, [lambda: tuple(turns.values())], Watch(node))
    errors: list[str] = []
    node.get_logger = lambda: SimpleNamespace(error=errors.append)
    now = monotonic()

    def is_heard_after(number: int) -> bool:
        turns.update({name: turn + 1 for name, turn in turns.items()})
        life.beat(int(now * 1e9))
        partner.expect({})
        return len(heard) > number

    wait_until(lambda: is_heard_after(0), 'a sign of life')
    for name in turns:
        known = len(heard)
        for later in (0.1, 1.0, 1.9, 2.1):
            turns.update({other: turn + (other != name) for other, turn in turns.items()})
            assert not errors
            life.beat(int((now + later) * 1e9))
        partner.expect({})
        assert len(heard) == known
        assert errors.pop() == 'a thread of the monitor hangs: no sign of life on ~/alive'
        life._state.next_line = 0
        now += 2.1
        assert is_heard_after(known)
    life.close()
    node.destroy_node()


def test_a_stall_is_no_thread_that_hangs(partner: Partner) -> None:
    node: Any = Node('guard', context=partner.context)
    signs: list[float] = []
    errors: list[str] = []
    node.get_logger = lambda: SimpleNamespace(error=errors.append)
    now = start = monotonic()
    turned = [0]
    life = SignOfLife(node, LIBRARY, [lambda: tuple(turned)], Watch(node))
    life._publish = lambda: signs.append(round(now - start, 2))  # type: ignore[method-assign]
    for now, has_turned in ((start + 1.0, True), (start + 3.75, True),  # the executor was busy
                            (start + 4.0, False), (start + 5.0, True),
                            (start + 7.95, False), (start + 8.0, True),  # the process was stopped
                            (start + 9.0, True), (start + 11.9, False), (start + 12.0, False),
                            (start + 13.0, True)):
        turned[0] += has_turned
        life.beat(int(now * 1e9))
    assert signs == [1.0, 3.75, 5.0, 8.0, 9.0, 13.0]
    assert errors == []
    life.close()
    node.destroy_node()


def test_a_monitor_without_the_thread_that_logs_is_not_alive(
    partner: Partner, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    bundle = write_bundle(tmp_path, BELOW_HALF)
    hangs, goes_on = Event(), Event()

    def log(_logger: Any, lines: list[LogLine]) -> None:
        if lines:
            hangs.set()
            goes_on.wait()
            raise ValueError('oh')

    monkeypatch.setattr('fret_monitor.ros.reports.details.log_lines', log)
    monitor = make_node(MonitorNode, partner.context, spec=bundle)
    session, = monitor._sessions
    before = session.turns()
    wait_until(lambda: all(old < new for old, new in zip(before, session.turns())), 'turns')
    values = partner.publisher(Float32, 'x')
    partner.wait_for_listener(values)
    values.publish(Float32(data=1.0))
    wait_until(hangs.is_set, 'a violation')
    before = session.turns()
    wait_until(lambda: sum(old < new for old, new in zip(before, session.turns())) == 2, 'turns')
    sleep(0.3)
    assert [old < new for old, new in zip(before, session.turns())].count(False) == 1
    session.report()
    goes_on.set()
    details: Any = session._detail_thread
    wait_until(lambda: details.failure is not None, 'the error')
    assert monitor._watch.failures == {}
    session.report()
    assert monitor._watch.failures == {'details': 'ValueError: oh'}
    monitor.destroy_node()


def test_a_transition_in_another_thread_during_a_report_is_no_failure(
    partner: Partner, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    bundle = write_bundle(tmp_path, BELOW_HALF)
    monitor = make_node(MonitorNode, partner.context, spec=bundle)
    session, = monitor._sessions
    partner.node.create_subscription(DiagnosticArray, '/diagnostics', lambda _: None, RELIABLE)
    health: Any = session._health
    wait_until(lambda: health._publisher.subscriptions == 1, 'a subscriber')
    publish = Review.publish

    def transit(trigger: Callable[[], Any]) -> None:
        thread = Thread(target=trigger)
        thread.start()
        thread.join()

    def turns() -> tuple[int, ...]:
        transit(monitor.trigger_deactivate)
        return 2**63, 2**63

    def interrupted(review: Review, *arguments: Any) -> None:
        transit(monitor.trigger_deactivate)
        publish(review, *arguments)

    monkeypatch.setattr(Review, 'publish', interrupted)
    session.report()
    assert monitor._watch.failures == {}
    monitor.trigger_activate()
    life: Any = monitor._sign_of_life
    life._turns = (turns,)
    monitor._report()
    assert not monitor._is_active
    assert monitor._watch.failures == {}
    monitor.destroy_node()


def test_one_of_several_bundles_reports_what_has_failed(partner: Partner, tmp_path: Path) -> None:
    paths = [tmp_path / name for name in ('one.yaml', 'two.yaml')]
    for number, path in enumerate(paths):
        path.write_text(BELOW_HALF.replace('R,', f'R{number},'), encoding='utf-8')
    monitor = make_node(MonitorNode, partner.context, spec=[str(path) for path in paths])
    reports: list[DiagnosticArray] = []
    partner.node.create_subscription(DiagnosticArray, '/diagnostics', reports.append, RELIABLE)
    for session in monitor._sessions:
        health: Any = session._health
        wait_until(lambda: health._publisher.subscriptions == 1,  # noqa: B023
                   'a subscriber')
    monitor._watch.note('details', ValueError('oh'))
    for session in monitor._sessions:
        session.report()
    wait_until(lambda: len(reports) == 2, 'reports')
    names = [status.name for report in reports for status in report.status]
    assert names.count('fret_monitor: threads') == 1
    monitor.destroy_node()


ALL_PARTS = """
format: 1
inputs:
  x: {topic: x, type: std_msgs/msg/Float32}
requirements:
  - {id: R, ptltl: "x < 0.5", on_violation: [warn]}
actions:
  warn: {publish: {topic: warned, type: std_msgs/msg/Float32, message: {}}}
"""


def test_parts_that_fail_are_shown_in_diagnostics_and_the_monitor_is_not_alive(
    partner: Partner, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    def fail(*_: Any) -> None:
        raise ValueError('oh')

    bundle = write_bundle(tmp_path, ALL_PARTS)
    signs: list[Header] = []
    reports: list[DiagnosticArray] = []
    partner.node.create_subscription(Header, '/fret_monitor/alive', signs.append, RELIABLE)
    partner.node.create_subscription(DiagnosticArray, '/diagnostics', reports.append, RELIABLE)
    with monkeypatch.context() as patch:
        patch.setattr(DeclaredOverrides, '_declare_next', fail)
        monitor = make_node(MonitorNode, partner.context, spec=bundle, blackbox=tmp_path)
        partner._executor.add_node(monitor)
        wait_until(lambda: [*monitor._watch.failures] == ['parameters'], 'the first failure')

    def failed() -> dict[str, str]:
        """Return what the next report says has failed."""
        reports.clear()
        wait_until(lambda: bool(reports), 'a report')
        found = [item for item in reports[0].status if item.name == 'fret_monitor: threads']
        assert all(item.level == DiagnosticStatus.ERROR for item in found)
        return {value.key: value.value for item in found for value in item.values}

    assert failed() == {'parameters': 'ValueError: oh'}
    monitor._watch.forget()
    wait_until(lambda: bool(signs), 'a sign of life')
    assert failed() == {}
    with monkeypatch.context() as patch:
        patch.setattr('fret_monitor.ros.reports.details.log_lines', fail)
        for kind, name in ((Feed, '_review'), (Review, 'lines'),
                           (DuplicateNodes, '_check'), (SignOfLife, 'beat')):
            patch.setattr(kind, name, fail)
        names = ('details', 'feed', 'log', 'node names', 'sign of life')
        wait_until(lambda: sorted(failed()) == [*names], 'what has failed')
        before = len(signs)
    assert {*failed().values()} == {'ValueError: oh'}
    assert {*failed().values()} == {'ValueError: oh'}  # a second later
    assert len(signs) == before
    log = capfd.readouterr().err
    assert log.count('has failed: no sign of life on ~/alive') == log.count('Traceback') == 6
    client = partner.node.create_client(ChangeState, '/fret_monitor/change_state')
    for transition in (Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_ACTIVATE):
        assert change_state(client, transition)
    assert failed() == {}
    wait_until(lambda: len(signs) > before + 1, 'signs of life')
    partner._executor.remove_node(monitor)
    monitor.destroy_node()
