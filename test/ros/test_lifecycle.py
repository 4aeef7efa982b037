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

"""The monitor as a managed node: each state and transition, over real DDS, in a real process."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import gc
from pathlib import Path
import shutil
from time import monotonic
import weakref

from bundles import write_bundle
from fret_monitor import build
from fret_monitor.ros import MonitorNode
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
import pytest
from rclpy.executors import Executor, MultiThreadedExecutor, SingleThreadedExecutor
from ros.harness import (
    answer_of, change_state, make_node, NodeProcess, Partner, PATIENCE, RELIABLE, settle, started,
    wait_until, without_interface_number,
)
from std_msgs.msg import Empty, Float32
from std_srvs.srv import Trigger

BUNDLE = """
format: 1
inputs:
  x: {topic: x, type: std_msgs/msg/Float32}
requirements:
  - {id: R-1, ptltl: "x < 0.5"}
  - {id: R-2, ptltl: "H (x < 0.5) | FTP"}
"""
WRONG = BUNDLE.replace('H (x', 'H (y')
CONFIGURE = Transition.TRANSITION_CONFIGURE
ACTIVATE = Transition.TRANSITION_ACTIVATE
DEACTIVATE = Transition.TRANSITION_DEACTIVATE
CLEANUP = Transition.TRANSITION_CLEANUP


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    return write_bundle(tmp_path, BUNDLE)


class Manager:
    """Manages the node: requests transitions, and its state."""

    def __init__(self, partner: Partner, node: str = '/fret_monitor') -> None:
        self._change = partner.node.create_client(ChangeState, f'{node}/change_state')
        self._get = partner.node.create_client(GetState, f'{node}/get_state')
        self._reset = partner.node.create_client(Trigger, f'{node}/reset')

    def ask(self, *transitions: int) -> list[bool]:
        """Request transitions in order; return which of them succeeded."""
        return [change_state(self._change, number) for number in transitions]

    @property
    def state(self) -> int:
        return int(answer_of(self._get, GetState.Request()).current_state.id)

    def reset(self) -> tuple[bool, str]:
        answer = answer_of(self._reset, Trigger.Request())
        return answer.success, answer.message


@contextmanager
def waiting(*arguments: str) -> Iterator[NodeProcess]:
    """Start a node that stays unconfigured; it must end well if the test succeeds."""
    node = NodeProcess('monitor', '-p', 'autostart:=false', *arguments)
    try:
        node.wait_for('waiting to be configured and activated')
        yield node
        assert node.end() == 0, node.output
    finally:
        node.kill()


def count_listener(partner: Partner, *names: str) -> None:
    """Count violations of handlers, whose publishers may come and go meanwhile."""
    def counted(name: str) -> Callable[[Empty], None]:
        def count(_: Empty) -> None:
            partner.heard[name] += 1
        return count

    for name in names:
        partner.node.create_subscription(
            Empty, f'copilot/handlerprop{name}', counted(name), RELIABLE)


def wait_for_handlers(partner: Partner, count: int, *names: str) -> None:
    wait_until(lambda: all(partner.node.count_publishers(f'copilot/handlerprop{name}') == count
                           for name in names), f'{count} publishers of {names}')
    settle(0.3)  # discovery is not symmetric: one side matches a moment later


def test_in_each_state_the_node_does_what_the_state_means(
    partner: Partner, bundle: Path,
) -> None:
    x = partner.publisher(Float32, 'x')
    count_listener(partner, 'R_1', 'R_2')
    with waiting('-p', f'spec:={bundle}') as node:
        manager = Manager(partner)
        assert manager.state == State.PRIMARY_STATE_UNCONFIGURED
        assert manager.reset() == (False, 'nothing to restart: the node is not active')
        assert partner.node.count_publishers('copilot/handlerpropR_1') == 0

        assert manager.ask(CONFIGURE) == [True]
        assert manager.state == State.PRIMARY_STATE_INACTIVE
        wait_for_handlers(partner, 1, 'R_1', 'R_2')
        assert x.get_subscription_count() == 0
        assert 'watching' not in node.output

        assert manager.ask(ACTIVATE) == [True]
        assert manager.state == State.PRIMARY_STATE_ACTIVE
        node.wait_for('watching 2 requirements')
        partner.wait_for_listener(x)
        x.publish(Float32(data=0.9))
        x.publish(Float32(data=0.9))
        partner.expect({'R_1': 2, 'R_2': 1})

        assert manager.ask(DEACTIVATE) == [True]
        assert manager.state == State.PRIMARY_STATE_INACTIVE
        wait_until(lambda: x.get_subscription_count() == 0, 'the end of the subscription')
        for _ in range(20):
            x.publish(Float32(data=0.9))
        partner.expect({'R_1': 2, 'R_2': 1})

        # Nothing of the time before remains: no violation, no first step, no value.
        assert manager.ask(ACTIVATE) == [True]
        partner.wait_for_listener(x)
        x.publish(Float32(data=0.9))
        partner.expect({'R_1': 3, 'R_2': 1})
        x.publish(Float32(data=0.1))
        partner.expect({'R_1': 3, 'R_2': 2})

        assert manager.ask(DEACTIVATE, CLEANUP) == [True, True]
        assert manager.state == State.PRIMARY_STATE_UNCONFIGURED
        wait_for_handlers(partner, 0, 'R_1', 'R_2')
        assert manager.ask(Transition.TRANSITION_UNCONFIGURED_SHUTDOWN) == [True]
        assert manager.state == State.PRIMARY_STATE_FINALIZED


def test_shutdown_of_an_active_node_releases_everything(partner: Partner, bundle: Path) -> None:
    x = partner.publisher(Float32, 'x')
    with started('monitor', '-p', f'spec:={bundle}'):
        partner.wait_for_listener(x)
        assert Manager(partner).ask(Transition.TRANSITION_ACTIVE_SHUTDOWN) == [True]
        wait_for_handlers(partner, 0, 'R_1', 'R_2')
        wait_until(lambda: x.get_subscription_count() == 0, 'the end of the subscription')


def test_a_bundle_that_is_refused_fails_the_transition_and_the_process_goes_on(
    partner: Partner, bundle: Path,
) -> None:
    bundle.write_text(WRONG, encoding='utf-8')
    with waiting('-p', f'spec:={bundle}') as node:
        manager = Manager(partner)
        assert manager.ask(CONFIGURE) == [False]
        assert manager.state == State.PRIMARY_STATE_UNCONFIGURED
        node.wait_for(f'{bundle}:7:26: error: ')
        assert '[ERROR]' in node.output
        bundle.write_text(BUNDLE, encoding='utf-8')
        assert manager.ask(CONFIGURE, ACTIVATE) == [True, True]
        node.wait_for('watching 2 requirements')


def test_a_folder_of_an_earlier_version_fails_the_transition(
    partner: Partner, bundle: Path, tmp_path: Path,
) -> None:
    folder = tmp_path / 'compiled'
    build.write(build.generate_monitor(build.read(bundle)), folder)
    engine = folder / 'libfm_evaluator.so'
    without_interface_number(engine)
    with waiting('-p', f'library:={folder}') as node:
        manager = Manager(partner)
        assert manager.ask(CONFIGURE) == [False]
        assert manager.state == State.PRIMARY_STATE_UNCONFIGURED
        node.wait_for(f'{engine} was compiled by an earlier version of fret_monitor')
        assert 'Traceback' not in node.output


def test_a_changed_bundle_is_read_by_the_next_configure(partner: Partner, bundle: Path) -> None:
    x = partner.publisher(Float32, 'x')
    count_listener(partner, 'R_1', 'R_3')
    with started('monitor', '-p', f'spec:={bundle}') as node:
        partner.wait_for_listener(x)
        wait_for_handlers(partner, 1, 'R_1')
        x.publish(Float32(data=0.6))
        partner.expect({'R_1': 1})
        bundle.write_text(BUNDLE + '  - {id: R-3, ptltl: "x < 0.7"}\n', encoding='utf-8')
        assert Manager(partner).ask(DEACTIVATE, CLEANUP, CONFIGURE, ACTIVATE) == [True] * 4
        node.wait_for('watching 3 requirements')
        partner.wait_for_listener(x)
        wait_for_handlers(partner, 1, 'R_1', 'R_3')
        x.publish(Float32(data=0.8))
        partner.expect({'R_1': 2, 'R_3': 1})


def test_a_transition_that_the_state_does_not_have_is_refused_without_effect(
    partner: Partner, bundle: Path,
) -> None:
    x = partner.publisher(Float32, 'x')
    with started('monitor', '-p', f'spec:={bundle}'):
        manager = Manager(partner)
        partner.listen('R_1')
        partner.wait_for_listener(x)
        assert manager.ask(CONFIGURE, ACTIVATE, CLEANUP, 77) == [False] * 4
        assert manager.state == State.PRIMARY_STATE_ACTIVE
        x.publish(Float32(data=0.9))
        partner.expect({'R_1': 1})


def test_an_internal_error_is_logged_and_the_node_can_be_configured_again(
    partner: Partner, bundle: Path, monkeypatch: pytest.MonkeyPatch,
    capfd: pytest.CaptureFixture[str],
) -> None:
    def fail(self: object) -> None:
        raise RuntimeError('no paper in the printer')

    node = make_node(MonitorNode, partner.context, spec=bundle, autostart=False)
    try:
        with monkeypatch.context() as patch:
            patch.setattr('fret_monitor.ros.nodes.bundle_session.BundleSession.start', fail)
            assert node.trigger_configure().name == 'SUCCESS'
            assert node.trigger_activate().name == 'ERROR'
        assert 'RuntimeError: no paper in the printer' in capfd.readouterr().err
        assert partner.node.count_publishers('copilot/handlerpropR_1') == 0
        assert node.trigger_configure().name == 'SUCCESS'
        assert node.trigger_activate().name == 'SUCCESS'
        assert 'watching 2 requirements' in capfd.readouterr().err
    finally:
        node.destroy_node()
    node.destroy_node()  # a second call has no effect


@pytest.mark.parametrize('is_in_place', [False, True])
def test_a_compiled_folder_that_changed_is_loaded_again(
    partner: Partner, bundle: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str],
    is_in_place: bool,
) -> None:
    def write(folder: str) -> Path:
        build.write(build.generate_monitor(build.read(bundle)), tmp_path / folder)
        return tmp_path / folder

    library = write('library')
    node = make_node(MonitorNode, partner.context, library=library)
    try:
        assert 'watching 2 requirements' in capfd.readouterr().err
        bundle.write_text(BUNDLE + '  - {id: R-3, ptltl: "x < 0.7"}\n', encoding='utf-8')
        if is_in_place:
            shutil.copytree(write('new'), library, dirs_exist_ok=True)
        else:
            write('library')
        assert node.trigger_deactivate().name == 'SUCCESS'
        assert node.trigger_cleanup().name == 'SUCCESS'
        assert node.trigger_configure().name == 'SUCCESS'
        assert node.trigger_activate().name == 'SUCCESS'
        assert 'watching 3 requirements' in capfd.readouterr().err
    finally:
        node.destroy_node()


@contextmanager
def composed(partner: Partner, bundle: Path, executor: Executor) -> Iterator[MonitorNode]:
    """Create a monitor as a component of another program; the caller spins it."""
    node = make_node(MonitorNode, partner.context, spec=bundle)
    executor.add_node(node)
    try:
        yield node
    finally:
        executor.shutdown()
        node.destroy_node()


@pytest.mark.parametrize('kind', [SingleThreadedExecutor, MultiThreadedExecutor])
def test_a_monitor_works_inside_another_program_with_any_executor(
    kind: type[Executor], partner: Partner, stranger: Partner, bundle: Path,
) -> None:
    executor = kind(context=partner.context)
    with composed(partner, bundle, executor) as node:
        partner.listen('R_1')
        x = stranger.publisher(Float32, 'x')
        stranger.wait_for_listener(x)
        x.publish(Float32(data=0.9))
        partner.expect({'R_1': 1})
        manager = stranger.node.create_client(ChangeState, 'fret_monitor/change_state')
        wait_until(manager.service_is_ready, 'the service')
        done = manager.call_async(
            ChangeState.Request(transition=Transition(id=DEACTIVATE)))
        end = monotonic() + PATIENCE
        while not done.done() and monotonic() < end:
            executor.spin_once(timeout_sec=0.05)
        assert done.result().success
        wait_until(lambda: x.get_subscription_count() == 0, 'the end of the subscription')
        assert node.trigger_activate().name == 'SUCCESS'
    assert 'fret_monitor' not in partner.node.get_node_names()


def test_an_error_in_the_feed_does_not_end_the_program_that_spins_the_node(
    partner: Partner, bundle: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fail(topic: str) -> None:
        raise RuntimeError('no paper in the printer')

    executor = SingleThreadedExecutor(context=partner.context)
    with composed(partner, bundle, executor) as node:
        monkeypatch.setattr(node, 'get_publishers_info_by_topic', fail)
        end = monotonic() + PATIENCE
        while not node._watch.failures:
            assert monotonic() < end
            executor.spin_once(timeout_sec=0.05)
        assert node._watch.failures == {'feed': 'RuntimeError: no paper in the printer'}


@pytest.mark.parametrize('hot_path', ['on', 'off'])
def test_cleanup_leaves_no_reference_to_the_library_of_the_monitor(
    partner: Partner, bundle: Path, hot_path: str,
) -> None:
    node = make_node(MonitorNode, partner.context, spec=bundle, hot_path=hot_path)
    gc.collect()
    gc.disable()  # otherwise a collection could hide a reference cycle
    try:
        opened = weakref.ref(node._sessions[0].opened)
        monitor = weakref.ref(node._sessions[0].opened.monitor)
        assert node.trigger_deactivate().name == 'SUCCESS'
        assert node.trigger_cleanup().name == 'SUCCESS'
        assert opened() is None, gc.get_referrers(opened())
        assert monitor() is None, gc.get_referrers(monitor())
    finally:
        gc.enable()
        node.destroy_node()
