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

"""The engine follows the time of its node."""

from pathlib import Path
from time import monotonic
from typing import Any

from builtin_interfaces.msg import Time
from bundles import BELOW_HALF, write_bundle
from fret_monitor import build
from fret_monitor.ros import GateNode, LoggerNode, MonitorNode
from fret_monitor.ros.intake.hot_path import EngineTopic, Middleware
from fret_monitor.ros.intake.node_time import ClockNode, NodeTime
from fret_monitor.ros.intake.rcl_endpoint import RclSubscription
from fret_monitor.ros.log_lines import Throttle
from fret_monitor.runtime import Engine, Evaluator
import pytest
import rclpy
from rclpy.clock import ClockType
from rclpy.context import Context
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from ros.harness import Partner, RELIABLE, wait_until
from rosgraph_msgs.msg import Clock
from runtime.message_ring import MessageRing
from std_msgs.msg import Float32

SECOND = 10**9


def test_a_throttle_lets_one_message_pass_per_interval() -> None:
    throttle = Throttle(3600)
    assert [throttle.passes() for _ in range(3)] == [True, False, False]
    throttle = Throttle(0)
    assert [throttle.passes() for _ in range(3)] == [True, True, True]


class Served:
    """An engine that counts the signs of life of its clock."""

    signs = 0
    wakes = 0
    drains = 0
    is_outdated: bool

    def serve_clock(self) -> None:
        self.signs += 1

    def follow_steady(self) -> None:
        pass

    def follow_clock(self, now: Any, clock: Any, *, is_outdated: bool) -> None:
        self.is_outdated = is_outdated

    def drain(self) -> None:
        self.drains += 1

    def wake(self) -> None:
        self.is_outdated = False
        self.wakes += 1


def spun(executor: SingleThreadedExecutor) -> bool:
    executor.spin_once(timeout_sec=0.05)
    return True


def test_the_engine_learns_that_the_executor_is_alive_while_it_moves_the_clock(
    domain: int,
) -> None:
    context = Context()
    context.init(domain_id=domain)
    node = Node('clocked', context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    engine: Any = Served()
    time = NodeTime(node, engine, None)
    simulator = node.create_publisher(Clock, '/clock', 1)

    def signs(seconds: float) -> int:
        before, end = engine.signs, monotonic() + seconds
        while monotonic() < end:
            executor.spin_once(timeout_sec=0.05)
        return int(engine.signs - before)

    try:
        assert signs(0.3) == 0
        for time_s, is_simulated in enumerate((True, False, True)):
            node.set_parameters([Parameter('use_sim_time', value=is_simulated)])
            assert (signs(0.6) > 1) is is_simulated
            if is_simulated:  # also without deadlines: else messages have the time of before
                assert engine.is_outdated
                wait_until(lambda: simulator.get_subscription_count() > 0, 'a subscription')
                for second in (7, 14, 21):
                    engine.wakes = 0
                    simulator.publish(Clock(clock=Time(sec=second + time_s)))
                    wait_until(lambda: spun(executor) and engine.wakes > 0, 'a new time')
                assert not engine.is_outdated
        time.close()
        assert signs(0.3) == 0
    finally:
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()


def test_a_negative_time_on_the_clock_ends_no_node(
    partner: Partner, capfd: pytest.CaptureFixture[str],
) -> None:
    assert all(issubclass(kind, ClockNode) for kind in (MonitorNode, GateNode, LoggerNode))
    node = ClockNode('clocked', context=partner.context, parameter_overrides=[
        Parameter('use_sim_time', value=True)])
    executor = SingleThreadedExecutor(context=partner.context)
    executor.add_node(node)
    simulator = partner.publisher(Clock, '/clock')

    def has_time() -> bool:
        for seconds in (-5, 7):
            simulator.publish(Clock(clock=Time(sec=seconds)))
            executor.spin_once(timeout_sec=0.05)  # raises what a callback raises
        return 'negative' in logged() and node.get_clock().now().nanoseconds == 7 * SECOND

    told = ''

    def logged() -> str:
        nonlocal told
        told += capfd.readouterr().err
        return told

    try:
        wait_until(has_time, 'the time')
        assert logged().count(
            'a message on /clock is ignored: its time is negative, -5.000 s') == 1
    finally:
        executor.shutdown()
        node.destroy_node()


def test_a_message_that_waits_while_the_clock_goes_back_counts_by_its_time_of_before(
    partner: Partner, tmp_path: Path,
) -> None:
    bundle = write_bundle(tmp_path, BELOW_HALF)
    engine = Engine(Evaluator(build.build(bundle).monitor, reports_recoveries=True))
    ring = MessageRing(engine.library, 1 << 16, 10)
    ring.keep_messages_of(engine)
    node = Node('clocked', context=partner.context, parameter_overrides=[
        Parameter('use_sim_time', value=True)])
    middleware = Middleware(may_take=False)
    time = NodeTime(node, engine, middleware.clock_now)
    engine.begin()
    subscription = RclSubscription(node, Float32, 'x', RELIABLE)
    receiver = EngineTopic(engine, middleware, 0).open(subscription)
    try:
        x = partner.publisher(Float32, 'x')
        wait_until(lambda: x.get_subscription_count() > 0, 'a match')
        clock: Any = node.get_clock()
        for seconds in (100, 101, 2):
            clock.set_ros_time_override(rclpy.time.Time(
                seconds=seconds, clock_type=ClockType.ROS_TIME))
            if seconds == 101:
                x.publish(Float32(data=1.0))  # no thread takes it
                wait_until(lambda: x.wait_for_all_acked(Duration(seconds=0.1)), 'its reception')
        assert [item.time for _, item in ring.read(0)] == [101 * SECOND]
    finally:
        receiver.stop()
        subscription.close()
        time.close()
        engine.close()
        engine.follow_steady()  # before the clock is gone
        node.destroy_node()
