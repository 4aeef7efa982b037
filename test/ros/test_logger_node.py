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

"""The logger and its messages: from a monitor or not, in any order."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import sleep
from typing import Any

from fret_monitor.ros.nodes.logger_node import LoggerNode
from fret_monitor.ros.reports.discovery import Announced
from fret_monitor.ros.reports.pairing import Pairing
from fret_monitor.ros.settings.overrides import DeclaredOverrides
from fret_monitor.ros.settings.parameters import Refusal
from fret_monitor.runtime.reporting import ReceivedDetail
from fret_monitor.start import manifest_of
import pytest
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from ros.harness import BEST_EFFORT, make_node, NodeProcess, Partner, settle, started, wait_until
from std_msgs.msg import Empty

diagnostic_msgs = pytest.importorskip('diagnostic_msgs.msg')

BUNDLE = """
format: 1
constants: {x_max: 0.5}
inputs:
  x: {topic: x, type: std_msgs/msg/Float32}
requirements:
  - {id: A-1, ptltl: "x < 0.5"}
"""


@pytest.fixture
def arguments(tmp_path: Path) -> tuple[str, ...]:
    (tmp_path / 'bundle.yaml').write_text(BUNDLE)
    return '-p', f"spec:={tmp_path / 'bundle.yaml'}"


def _is_heard(publisher: Publisher) -> bool:
    return bool(publisher.get_subscription_count())


class Voice:
    """Publishes the messages of a monitor, and others."""

    def __init__(self, partner: Partner, handler: str = 'handlerpropA_1') -> None:
        self._partner = partner
        self._empty = partner.publisher(Empty, f'copilot/{handler}')
        self._details = partner.publisher(diagnostic_msgs.DiagnosticArray, 'copilot/violations')
        for publisher in (self._empty, self._details):
            wait_until(partial(_is_heard, publisher), 'a logger')
        settle(0.5)  # until the logger has matched, and perhaps replaced its subscription

    def cleanup(self) -> None:
        for publisher in (self._empty, self._details):
            self._partner.node.destroy_publisher(publisher)

    def violation(self) -> None:
        self._empty.publish(Empty())

    def detail(self, *pairs: tuple[str, str], name: str = 'A-1') -> None:
        self._details.publish(diagnostic_msgs.DiagnosticArray(status=[status(name, *pairs)]))

    def recovery(self, *pairs: tuple[str, str], name: str = 'A-1') -> None:
        self._details.publish(diagnostic_msgs.DiagnosticArray(
            status=[status(name, *pairs, level=diagnostic_msgs.DiagnosticStatus.OK)]))

    def raw_detail(self, data: bytes) -> None:
        self._details.publish(data)


def status(name: str, *pairs: tuple[str, str],
           level: bytes = diagnostic_msgs.DiagnosticStatus.ERROR) -> Any:
    return diagnostic_msgs.DiagnosticStatus(
        level=level, name=name, message='x < 0.5',
        values=[diagnostic_msgs.KeyValue(key=key, value=text) for key, text in pairs])


def right(step: int, value: str = '0.7') -> tuple[tuple[str, str], ...]:
    return ('step', str(step)), ('stamp', '12.345678901'), ('suppressed', '0'), \
        ('silent', ''), ('x', value)


def lines(node: NodeProcess, number: int) -> list[str]:
    """Wait for so many violations and return their lines in the log."""
    wait_until(lambda: node.output.count('A-1 violated at') >= number, f'{number} lines')
    return [line.partition('A-1 violated at ')[2] for line in node.output.splitlines()
            if 'A-1 violated at' in line]


WRONG: dict[str, Callable[[Voice], None]] = {
    'nothing': lambda voice: voice.detail(),
    'no message': lambda voice: voice.raw_detail(b'\0\1\0\0\1'),
    'no requirement': lambda voice: voice.detail(*right(1), name='B-1'),
}


@pytest.mark.parametrize('kind', WRONG)
def test_messages_that_no_monitor_publishes_are_ignored(
    kind: str, partner: Partner, arguments: tuple[str, ...],
) -> None:
    with started('logger', *arguments) as node:
        voice = Voice(partner)
        WRONG[kind](voice)
        sleep(0.1)
        voice.violation()
        assert '[step' not in lines(node, 1)[0]
        voice.detail(*right(2))
        voice.violation()
        assert lines(node, 2)[1] == '12.346: x < 0.5 [step 2: x = 0.7]'


def test_a_violation_of_an_instance_and_its_end_have_the_name_of_the_instance(
        partner: Partner, tmp_path: Path) -> None:
    (tmp_path / 'fleet.yaml').write_text(BUNDLE.replace('topic: x', 'topic: "/{robot}/x"').replace(
        'inputs:', 'for_each: {robot: {most: 3}}\ninputs:'))
    with started('logger', '-p', f"spec:={tmp_path / 'fleet.yaml'}") as node:
        voice = Voice(partner)
        name = 'A-1[robot=a[1]'
        voice.detail(*right(2), name=name)
        voice.violation()
        node.wait_for(f'{name} violated at 12.346: x < 0.5 [step 2: x = 0.7]')
        voice.recovery(*right(3), name=name)
        node.wait_for(f'{name} satisfied again')


MS = 10**6  # ns


@dataclass(frozen=True)
class Numbered(ReceivedDetail):
    step: int = 0


def numbered(step: int, seconds: float, suppressed: int = 0, *,
             is_recovery: bool = False) -> Numbered:
    return Numbered(round(seconds * 1e9), suppressed, is_recovery, step=step)


def paired(pairing: Pairing, now: float = 1e9) -> list[int | None]:
    """Return the steps of all violations that are due; None for one without a detail."""
    found: Any = iter(lambda: pairing.take(now), None)
    return [item.detail.step if item.detail is not None else None for item in found]


@pytest.mark.parametrize('detail_comes_first', [False, True])
def test_a_violation_is_reported_with_its_detail_in_any_order(detail_comes_first: bool) -> None:
    pairing = Pairing()
    for step in range(5):
        sent = 1000 * step * MS
        detail = numbered(step, sent / 1e9)
        if detail_comes_first:
            pairing.add_detail('R', detail, sent + MS)
        pairing.add_violation('R', 0, sent + 2 * MS, now=0.0)
        if not detail_comes_first:
            pairing.add_detail('R', detail, sent + 3 * MS)
    assert paired(pairing, now=0.0) == [0, 1, 2, 3, 4]


def test_a_violation_waits_for_its_detail_for_a_short_time_only() -> None:
    pairing = Pairing()
    pairing.add_violation('R', 0, 10, now=0.0)
    assert paired(pairing, now=0.2) == []
    assert pairing.next_due == 0.3
    assert paired(pairing, now=0.4) == [None]
    pairing.add_detail('R', numbered(0, 0.0), 10)  # too late
    pairing.add_violation('R', 0, 1000 * MS, now=1.0)
    assert paired(pairing, now=1.5) == [None]


def test_after_a_lost_detail_the_next_ones_are_paired_while_violations_go_on() -> None:
    pairing = Pairing()
    found = []
    for step in range(30):
        sent = 100 * step * MS  # earlier than violations without a detail are reported
        pairing.add_violation('R', 0, sent + 2 * MS, now=0.1 * step)
        if step > 0:
            pairing.add_detail('R', numbered(step, sent / 1e9), sent + 3 * MS)
        found += paired(pairing, now=0.1 * step)
    assert found + paired(pairing) == [None, *range(1, 30)]


@pytest.mark.parametrize('lag_ms', [0, 50])
def test_suppressed_details_do_not_pair_other_details_with_the_wrong_violation(
    lag_ms: int,
) -> None:
    pairing = Pairing()
    found = []
    for step in range(400):
        if step % 4 != 3 and not 100 <= step < 150:  # the others are suppressed
            before = step // 4 + sum(each % 4 != 3 for each in range(100, min(step, 150)))
            detail = numbered(step, step * 0.001, suppressed=before)
            pairing.add_detail('R', detail, step * MS)
        if step >= lag_ms:
            late = step - lag_ms
            pairing.add_violation('R', 0, step * MS + 10, now=late * 0.001)
        found += paired(pairing, now=step * 0.001 - 1)
    found += paired(pairing)
    assert len(found) == 400 - lag_ms
    claimed = [(place, step) for place, step in enumerate(found) if step is not None]
    assert len(claimed) > 150
    assert all(place == step for place, step in claimed)


def test_details_that_come_after_their_violations_were_reported_are_all_passed_over() -> None:
    pairing = Pairing()
    pairing.add_violation('R', 0, MS, now=0.0)
    pairing.add_detail('R', numbered(0, 0.001), MS)
    assert paired(pairing) == [0]
    for step in (1, 2, 3):
        pairing.add_violation('R', 0, step * 10 * MS, now=0.0)
    assert paired(pairing) == [None] * 3
    for step in (1, 2, 3):
        pairing.add_detail('R', numbered(step, step * 0.01), step * 10 * MS)
    pairing.add_violation('R', 0, 40 * MS, now=0.0)
    pairing.add_detail('R', numbered(4, 0.04), 40 * MS)
    assert paired(pairing) == [4]


def released(pairing: Pairing, now: float) -> list[str]:
    """Return what is due, in its order: steps, with a + if a violation is over."""
    found: Any = iter(lambda: pairing.take(now), None)
    return ['?' if item.detail is None else f"{item.detail.step}{'+' * item.detail.is_recovery}"
            for item in found]


def over(step: int) -> ReceivedDetail:
    return numbered(step, step / 1e3, is_recovery=True)


def test_the_end_of_a_violation_waits_for_the_violations_before_it() -> None:
    pairing = Pairing()
    pairing.add_recovery('R', over(0), now=0.0)
    assert released(pairing, now=0.0) == ['0+']
    pairing.add_violation('Q', 0, MS, now=0.0)  # its detail is late; R's go after it
    pairing.add_detail('R', numbered(1, 0.001), MS)
    pairing.add_recovery('R', over(2), now=0.0)
    assert released(pairing, now=0.0) == []  # the violation of step 1 is on its way
    pairing.add_violation('R', 0, 2 * MS, now=0.1)
    assert released(pairing, now=0.1) == []
    pairing.add_detail('Q', numbered(9, 0.001), MS)
    assert released(pairing, now=0.1) == ['9', '1', '2+']
    assert pairing.next_due is None


def test_the_end_of_a_violation_comes_before_the_next_violation() -> None:
    pairing = Pairing()
    pairing.add_detail('R', numbered(0, 0.0), 0)
    pairing.add_violation('R', 0, 10, now=0.0)
    assert released(pairing, now=0.0) == ['0']
    for step in (1, 3):
        pairing.add_violation('R', 0, step * MS + 10, now=0.0)
    pairing.add_detail('R', numbered(1, 0.001), MS + 20)
    pairing.add_recovery('R', over(2), now=0.0)
    assert released(pairing, now=0.0) == ['1']
    pairing.add_detail('R', numbered(3, 0.003), 3 * MS + 20)
    pairing.add_recovery('R', over(4), now=0.0)
    assert released(pairing, now=0.0) == ['2+', '3', '4+']


def test_the_end_of_a_violation_that_never_comes_is_reported() -> None:
    pairing = Pairing()
    pairing.add_detail('R', numbered(1, 0.001), MS)
    pairing.add_recovery('R', over(2), now=0.0)
    assert released(pairing, now=0.2) == []
    assert pairing.next_due == 0.3
    assert released(pairing, now=0.3) == ['2+']


def test_a_detail_that_may_be_of_several_violations_is_given_to_none() -> None:
    pairing = Pairing()
    for step in range(200):
        pairing.add_violation('R', 0, step * MS + 10, now=0.0)
    pairing.add_detail('R', numbered(150, 0.150, suppressed=150), 151 * MS)
    pairing.add_detail('Q', numbered(3, 0.0), 151 * MS)  # of another requirement
    assert paired(pairing) == [None] * 200


def test_a_detail_whose_violation_never_came_is_dropped(
    partner: Partner, arguments: tuple[str, ...],
) -> None:
    with started('logger', *arguments) as node:
        voice = Voice(partner)
        voice.detail(*right(1))
        sleep(1.2)
        voice.violation()
        assert '[step' not in lines(node, 1)[0]


def test_a_logger_without_a_compiler_names_what_is_missing(
    partner: Partner, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    bundle = tmp_path / 'bundle.yaml'
    bundle.write_text(BUNDLE)
    monkeypatch.setenv('PATH', str(tmp_path))
    monkeypatch.delenv('CC', raising=False)
    with pytest.raises(Refusal, match='no C compiler found: install gcc'):
        make_node(LoggerNode, partner.context, spec=bundle)


def test_overrides_decide_the_qos_of_the_subscriptions(
    partner: Partner, arguments: tuple[str, ...],
) -> None:
    override = 'qos_overrides./copilot/handlerpropA_1.subscription.reliability'
    with started('logger', *arguments, '-p', f'{override}:=best_effort'):
        handler = 'copilot/handlerpropA_1'
        wait_until(lambda: bool(partner.node.get_subscriptions_info_by_topic(handler)), 'a logger')
        offered, = partner.node.get_subscriptions_info_by_topic(handler)
        assert offered.qos_profile.reliability is BEST_EFFORT.reliability


def test_the_manifest_is_that_of_the_compiled_bundle(tmp_path: Path) -> None:
    from fret_monitor.start import start
    bundle = tmp_path / 'bundle.yaml'
    bundle.write_text(BUNDLE)
    generated = manifest_of(bundle)
    assert start(bundle).manifest == generated == manifest_of(bundle)


def test_the_end_of_a_violation_is_logged_with_the_time_since_the_requirement_began(
    partner: Partner, arguments: tuple[str, ...],
) -> None:
    with started('logger', *arguments) as node:
        voice = Voice(partner)
        timed = (('time', '2.5'), *right(0)[1:])
        voice.recovery(*timed)
        node.wait_for(
            'A-1 satisfied again at 12.346: x < 0.5 [2.5 s after its start: x = 0.7]')
        voice.detail(*timed)
        voice.recovery(*timed)
        voice.violation()
        assert lines(node, 1)[0] == '12.346: x < 0.5 [2.5 s after its start: x = 0.7]'
        wait_until(lambda: node.output.count('satisfied again') == 2, 'its end')
        assert node.output.rindex('satisfied again') > node.output.rindex('A-1 violated')


def test_the_logger_follows_a_monitor_that_is_configured_again(
    partner: Partner, arguments: tuple[str, ...], tmp_path: Path,
) -> None:
    bundle = tmp_path / 'bundle.yaml'
    with started('logger', *arguments) as node:
        other = Node('other', context=partner.context)  # it may have a logger of its own
        other.create_publisher(Empty, 'copilot/handlerpropZ_9', 10)
        other.create_publisher(diagnostic_msgs.DiagnosticArray, 'copilot/violations', 10)
        voice = Voice(partner)
        sleep(1.0)
        assert 'configured' not in node.output
        voice.cleanup()
        bundle.write_text(BUNDLE.replace('A-1', 'B-2'))
        voice = Voice(partner, 'handlerpropB_2')
        node.wait_for('/partner was configured: now listening for violations of 1 requirement: '
                      'B-2')
        voice.violation()
        node.wait_for('B-2 violated')
        voice.cleanup()
        bundle.write_text('format: 2')
        voice = Voice(partner, 'handlerpropC_3')  # of a bundle that this logger does not have
        node.wait_for('the bundle cannot be read again; what was read before is used')
        node.wait_for('requirements: B-2, handlerpropC_3')
        voice.detail(*right(7), name='C-3')
        voice.violation()
        node.wait_for('C-3 violated at 12.346: x < 0.5 [step 7: x = 0.7]')
        wait_until(lambda: not partner.node.count_subscribers('/copilot/handlerpropA_1'),
                   'the end of the first subscription')
        assert not partner.node.count_subscribers('/copilot/handlerpropZ_9')
        other.destroy_node()


def test_a_failure_of_a_timer_is_logged_once_and_does_not_end_the_logger(
    partner: Partner, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    calls: list[object] = []

    def fail(it: object) -> None:
        calls.append(it)
        raise ValueError('oh')

    bundle = tmp_path / 'bundle.yaml'
    bundle.write_text(BUNDLE)
    for kind, name in ((Announced, 'news'), (DeclaredOverrides, '_declare_next')):
        monkeypatch.setattr(kind, name, fail)
    logger = make_node(LoggerNode, partner.context, spec=bundle)
    executor = SingleThreadedExecutor(context=partner.context)
    executor.add_node(logger)

    def have_failed_twice() -> bool:
        executor.spin_once(timeout_sec=0.1)
        return all(len([item for item in calls if isinstance(item, kind)]) > 1
                   for kind in (Announced, DeclaredOverrides))

    try:
        wait_until(have_failed_twice, 'two failures of each')
    finally:
        executor.shutdown()
        logger.destroy_node()
    told = capfd.readouterr().err
    assert told.count('has failed: what has not failed goes on') == told.count('Traceback') == 2
    for name in ('parameters', 'monitors'):
        assert told.count(f'the part of the node that is called {name} has failed') == 1


def test_a_violation_before_the_logger_listens_to_its_handler_is_logged_from_its_detail(
    partner: Partner, tmp_path: Path, capfd: pytest.CaptureFixture[str],
) -> None:
    bundle = tmp_path / 'bundle.yaml'
    bundle.write_text(BUNDLE)
    logger = make_node(LoggerNode, partner.context, spec=bundle)
    executor = SingleThreadedExecutor(context=partner.context)
    try:
        voice = Voice(partner)
        bundle.write_text(BUNDLE.replace('A-1', 'B-2'))
        for step in (3, 4):
            voice.detail(*right(step), name='B-2')
        wait_until(lambda: len(logger._unknown) == 2, 'the details')
        executor.add_node(logger)
        logged = ''

        def is_logged() -> bool:
            nonlocal logged
            executor.spin_once(timeout_sec=0.1)
            captured = capfd.readouterr()
            logged += captured.out + captured.err
            return 'B-2 violated at 12.346: x < 0.5 [step 4: x = 0.7]' in logged

        wait_until(is_logged, 'both violations')
        assert logged.count('B-2 violated at 12.346: x < 0.5 [step 3: x = 0.7]') == 1
    finally:
        executor.shutdown()
        logger.destroy_node()
