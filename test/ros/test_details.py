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

"""Details of violations on their topic, and the thread that publishes them."""

from pathlib import Path
import threading
from typing import Any

from bundles import engine_of, write_bundle
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from fret_monitor import build
from fret_monitor.model.names import DETAILS_TOPIC
from fret_monitor.ros.intake import native_lifetimes
from fret_monitor.ros.intake.hot_path import Middleware
from fret_monitor.ros.intake.rcl_endpoint import RclPublisher
from fret_monitor.ros.reports.details import DetailThread
from fret_monitor.ros.settings.qos import violation_profile
from fret_monitor.runtime import Engine, Evaluator
from fret_monitor.runtime.reporting import Reporter, ReportTable
import pytest
from rclpy.node import Node
from ros.harness import Partner, wait_until

BUNDLE = """
format: 1
inputs:
  step: {topic: gait, type: std_msgs/msg/Int32}
  stamp: {topic: imu, type: std_msgs/msg/Int32, initial: 7}
constants: {time: 2.50, silent: 0, other: 1}
definitions: {few: step + stamp < time}
requirements:
  - {id: R, ptltl: "few & step < silent"}
"""


def started(engine: Engine, node: Node) -> tuple[DetailThread, RclPublisher]:
    publisher = RclPublisher(node, DiagnosticArray, DETAILS_TOPIC, violation_profile(10))
    return DetailThread(
        Reporter(engine, ReportTable(engine.monitor.manifest)), Middleware(), publisher,
        node.get_logger(), logs_violations=False), publisher


def test_details_are_published_as_they_are_worded_with_the_time_of_the_violation(
    partner: Partner, tmp_path: Path,
) -> None:
    engine = engine_of(tmp_path, BUNDLE)
    node = Node('fret_monitor', context=partner.context)
    thread, publisher = started(engine, node)
    heard: list[Any] = []
    partner.node.create_subscription(DiagnosticArray, DETAILS_TOPIC, heard.append, 10)
    wait_until(lambda: publisher.subscriptions > 0, 'who listens')
    engine.message(0, b'\0\1\0\0\x2a\0\0\0', received=3_000_000_007)
    wait_until(lambda: bool(heard), 'the details')
    status, = heard[0].status
    assert (heard[0].header.stamp.sec, heard[0].header.stamp.nanosec) == (3, 7)
    assert (status.level, status.name) == (DiagnosticStatus.ERROR, 'R')
    assert {item.key: item.value for item in status.values}['input step'] == '42'
    thread.close()
    publisher.close()
    node.destroy_node()


def test_the_thread_of_details_ends_at_exit_although_nobody_ends_it(
    partner: Partner, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    bundle = write_bundle(tmp_path, BUNDLE)
    monkeypatch.setattr(native_lifetimes, '_KEPT', {})
    node = Node('fret_monitor', context=partner.context)
    started(Engine(Evaluator(build.build(bundle).monitor)), node)
    thread, = (item for item in threading.enumerate() if item.name == 'details')
    native_lifetimes._end_all()
    assert not thread.is_alive()
    node.destroy_node()
