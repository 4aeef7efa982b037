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

"""Details of violations can be read for any name of an input or a constant."""

from pathlib import Path
import threading
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from fret_monitor import build
from fret_monitor.model.names import DETAILS_TOPIC
from fret_monitor.ros.intake import native_lifetimes
from fret_monitor.ros.reports.detail_publisher import DetailPublisher
from fret_monitor.ros.reports.details import Details, read_detail
from fret_monitor.runtime import Engine, Evaluator
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


def test_an_input_or_a_constant_may_have_the_name_of_a_key_of_every_detail(
    partner: Partner, tmp_path: Path,
) -> None:
    bundle = tmp_path / 'bundle.yaml'
    bundle.write_text(BUNDLE, encoding='utf-8')
    engine = Engine(Evaluator(build.build(bundle).monitor))
    node = Node('fret_monitor', context=partner.context)
    details = Details(node, engine.monitor.manifest)
    heard: list[Any] = []
    partner.node.create_subscription(DiagnosticArray, DETAILS_TOPIC, heard.append, 10)
    wait_until(lambda: details.listeners() == 1, 'who listens')
    engine.want_details(True)
    engine.message(0, b'\0\1\0\0\x2a\0\0\0', received=3)
    detail = engine.take_detail(1000)
    assert detail is not None
    details.publish(detail)
    wait_until(lambda: bool(heard), 'the details')
    keys = [item.key for item in heard[0].status[0].values]
    assert len({*keys}) == len(keys)
    found = read_detail(heard[0].status[0])
    assert found is not None
    assert (found.step, found.values) == (
        0, (('step', '42'), ('stamp', '7'), ('time', '2.50'), ('silent', '0')))
    node.destroy_node()


def test_the_thread_of_details_ends_at_exit_although_nobody_ends_it(
    partner: Partner, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    bundle = tmp_path / 'bundle.yaml'
    bundle.write_text(BUNDLE, encoding='utf-8')
    monkeypatch.setattr(native_lifetimes, '_KEPT', {})
    engine = Engine(Evaluator(build.build(bundle).monitor))
    node = Node('fret_monitor', context=partner.context)
    DetailPublisher(engine, Details(node, engine.monitor.manifest), None)
    thread, = (item for item in threading.enumerate() if item.name == 'details')
    native_lifetimes._end_all()
    assert not thread.is_alive()
    node.destroy_node()
