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

"""The nodes in every executor of rclpy, with messages taken in callbacks and in a thread."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event, Thread
from time import sleep
from typing import Any

from bundles import write_bundle
from diagnostic_msgs.msg import DiagnosticArray
from fret_monitor.ros import LoggerNode, MonitorNode
import pytest
from rclpy.context import Context
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.experimental.events_executor import EventsExecutor
from rclpy.parameter import Parameter
from ros.harness import make_node, Partner, wait_until
from std_msgs.msg import Float32
from strategies import HOT_PATHS

BUNDLE = """
format: 1
inputs:
  x: {topic: x, type: std_msgs/msg/Float32}
evaluation: {policy: POLICY}
requirements:
  - {id: R, ptltl: "x < 1.0"}
"""
TIMEOUT = """
format: 1
inputs:
  x: {topic: x, type: std_msgs/msg/Float32, timeout: 2.0, startup: 4.0,
      stale: violate}
evaluation: {policy: periodic, period: 0.05}
requirements:
  - {id: R, ptltl: "x < 1.0"}
  - {id: ONSET, ptltl: "x < 5.0", report: onset}
"""
EXECUTORS: list[Callable[..., Any]] = [
    SingleThreadedExecutor, MultiThreadedExecutor, EventsExecutor]


@contextmanager
def spun(executor: Any, node: Any) -> Iterator[None]:
    """Spin a node in an executor, in a thread of its own."""
    executor.add_node(node)
    is_over = Event()

    def spin() -> None:  # `EventsExecutor.shutdown` blocks while another thread is in `spin`
        while not is_over.is_set():
            executor.spin_once(timeout_sec=0.1)

    thread = Thread(target=spin, daemon=True)
    thread.start()
    try:
        yield
    finally:
        is_over.set()
        thread.join()
        executor.shutdown()
        node.destroy_node()


def bundle(folder: Path, policy: str = 'every_message') -> Parameter:
    path = write_bundle(folder, BUNDLE.replace('POLICY', policy))
    return Parameter('spec', value=str(path))


@pytest.fixture(params=EXECUTORS, ids=lambda kind: kind.__name__)
def executor(request: pytest.FixtureRequest, stranger: Partner) -> Any:
    """Return an executor for a node in the context of `stranger`."""
    return request.param(context=stranger.context)


@pytest.mark.parametrize('hot_path', HOT_PATHS)
def test_every_message_is_a_step_in_every_executor(
    partner: Partner, stranger: Partner, executor: Any, tmp_path: Path, hot_path: str,
) -> None:
    context: Context = stranger.context
    with spun(executor, MonitorNode(context=context, parameter_overrides=[
            bundle(tmp_path), Parameter('hot_path', value=hot_path)])):
        statuses: list[Any] = []

        def keep(array: Any) -> None:
            statuses.extend(array.status)

        partner.node.create_subscription(DiagnosticArray, '/diagnostics', keep, 10)
        publisher = partner.publisher(Float32, 'x')
        partner.listen('R')
        partner.wait_for_listener(publisher)
        for _ in range(300):  # in 3 s; no queue holds more than 100
            publisher.publish(Float32(data=2.0))
            sleep(0.01)
        partner.expect({'R': 300})
        assert partner.reset() == 'restarted 1 step group; input values kept'
        wait_until(lambda: any(
            item.name.endswith('topic /x') and ('received', '300') in [
                (pair.key, pair.value) for pair in item.values] for item in statuses),
            'the count of messages in /diagnostics')


def test_every_period_is_a_step_in_every_executor(
    partner: Partner, stranger: Partner, executor: Any, tmp_path: Path,
) -> None:
    with spun(executor, MonitorNode(context=stranger.context, parameter_overrides=[
            bundle(tmp_path, 'periodic'), Parameter('period', value=0.05)])):
        publisher = partner.publisher(Float32, 'x')
        partner.listen('R')
        partner.wait_for_listener(publisher)
        publisher.publish(Float32(data=2.0))
        wait_until(lambda: partner.heard['R'] > 10, 'a violation each period')


@pytest.mark.parametrize('hot_path', HOT_PATHS)
def test_a_timeout_comes_beside_periods_in_every_executor(
    partner: Partner, stranger: Partner, executor: Any, tmp_path: Path, hot_path: str,
) -> None:
    path = write_bundle(tmp_path, TIMEOUT)
    partner.listen('R', 'ONSET', publishers=0)  # before the time begins
    with spun(executor, make_node(MonitorNode, stranger.context, spec=path, hot_path=hot_path)):
        publisher = partner.publisher(Float32, 'x')
        partner.wait_for_listener(publisher)
        wait_until(lambda: partner.heard['ONSET'] == 1, 'the silence before the first message')
        timer = partner.node.create_timer(0.05, lambda: publisher.publish(Float32(data=2.0)))
        before = partner.heard['R']
        wait_until(lambda: partner.heard['R'] > before + 20, 'a violation each period')
        sleep(2.5)
        assert partner.heard['ONSET'] == 1, 'messages come'
        partner.node.destroy_timer(timer)
        wait_until(lambda: partner.heard['ONSET'] == 2, 'the silence after the last message')


def test_the_logger_logs_in_every_executor(
    partner: Partner, stranger: Partner, executor: Any, tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monitor = MonitorNode(context=partner.context, parameter_overrides=[bundle(tmp_path)])
    with spun(SingleThreadedExecutor(context=partner.context), monitor), spun(executor, LoggerNode(
            context=stranger.context, parameter_overrides=[bundle(tmp_path)])):
        handler, = monitor._sessions[0]._handlers
        wait_until(lambda: handler.subscriptions > 0, 'the logger')
        publisher = partner.publisher(Float32, 'x')
        partner.wait_for_listener(publisher)
        logged = ''

        def has_some() -> bool:
            nonlocal logged
            publisher.publish(Float32(data=2.0))
            logged += capfd.readouterr().err
            return logged.count('R violated at') > 20

        wait_until(has_some, 'twenty lines')
