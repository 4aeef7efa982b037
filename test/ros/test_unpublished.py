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

"""Violations that could not be published are counted and reported."""

from pathlib import Path

from diagnostic_msgs.msg import DiagnosticStatus
from fret_monitor import build
from fret_monitor.ros.handlers import Handlers
from fret_monitor.ros.health import Health
from fret_monitor.ros.publisher_threads import HandlerPublisher
from fret_monitor.runtime import Evaluator, Engine
import pytest
from rclpy.context import Context
from rclpy.node import Node
from ros.harness import Partner, wait_until
from ros.operators import Operator

BUNDLE = """
format: 1
inputs:
  n: {topic: n, type: std_msgs/msg/Int32}
requirements:
  - {id: R, ptltl: "n < 0"}
"""
A_MESSAGE = b'\0\1\0\0\1\0\0\0'


@pytest.fixture
def watch(tmp_path: Path) -> Engine:
    bundle = tmp_path / 'bundle.yaml'
    bundle.write_text(BUNDLE, encoding='utf-8')
    return Engine(Evaluator(build.build(bundle).monitor))


def test_violations_not_published_because_the_context_ended_are_counted(
    watch: Engine, domain: int,
) -> None:
    context = Context()
    context.init(args=[], domain_id=domain)
    node = Node('fret_monitor', context=context)
    publisher = HandlerPublisher(watch, Handlers(node, watch.monitor.manifest))
    context.shutdown()
    for _ in range(3):
        watch.message(0, A_MESSAGE, received=0)
    publisher.close()
    assert watch.unpublished == 3


def test_diagnostics_count_such_violations(watch: Engine, partner: Partner) -> None:
    operator = Operator(partner)
    node = Node('fret_monitor', context=partner.context)
    health = Health(node, watch)
    name = 'fret_monitor: violations of bundle'

    def told() -> list[tuple[bytes, str, str]]:
        health.publish([])
        return [(item.level, item.message, item.values[0].value)
                for report in operator.heard[-1:] for item in report.status if item.name == name]

    wait_until(lambda: not told() and bool(operator.heard), 'a report')
    watch.count_unpublished(3)
    wait_until(lambda: told() == [
        (DiagnosticStatus.ERROR, '3 not published since the last report', '3')], 'an error')
    wait_until(lambda: told() == [
        (DiagnosticStatus.WARN, 'some were not published', '3')], 'a warning')
    node.destroy_node()
