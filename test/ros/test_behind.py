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

"""How late messages are evaluated is in `/diagnostics`."""

from pathlib import Path
from time import time_ns

from diagnostic_msgs.msg import DiagnosticStatus
from fret_monitor import build
from fret_monitor.ros.intake.feed import PublisherStatus
from fret_monitor.ros.reports.health import Health
from fret_monitor.runtime import Engine, Evaluator
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


def test_the_status_of_a_topic_has_the_longest_time_from_reception_to_evaluation(
    partner: Partner, tmp_path: Path,
) -> None:
    bundle = tmp_path / 'bundle.yaml'
    bundle.write_text(BUNDLE, encoding='utf-8')
    engine = Engine(Evaluator(build.build(bundle).monitor))
    engine.follow_steady()
    operator = Operator(partner)
    node = Node('fret_monitor', context=partner.context)
    health = Health(node, engine)

    def found() -> list[DiagnosticStatus]:
        return [item for report in operator.heard for item in report.status
                if item.name == 'fret_monitor: topic /n']

    def told(milliseconds: int) -> tuple[bytes, str, float]:
        before = len(found())
        engine.message(0, A_MESSAGE, received=time_ns() - milliseconds * 10**6)
        engine.message(0, A_MESSAGE, received=time_ns())
        health.publish([PublisherStatus(1)])
        wait_until(lambda: len(found()) > before, 'a report')
        status = found()[-1]
        values = {item.key: item.value for item in status.values}
        return status.level, status.message, float(values['behind'])

    def is_heard() -> bool:
        health.publish([])
        return bool(operator.heard)

    wait_until(is_heard, 'a report')
    level, message, behind = told(200)
    assert (level, message) == (DiagnosticStatus.OK, 'received') and 0.2 <= behind < 1.0
    level, message, behind = told(2460)
    assert (level, message) == (
        DiagnosticStatus.WARN, 'evaluated up to 2.5 s after reception') and 2.46 <= behind < 3.0
    level, message, behind = told(0)
    assert (level, message) == (DiagnosticStatus.OK, 'received') and behind < 1.0
    node.destroy_node()
