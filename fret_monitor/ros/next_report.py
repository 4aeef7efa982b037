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

"""What a running monitor says of its requirements, read from `/diagnostics` by another program."""

from collections.abc import Callable
from dataclasses import dataclass
from time import monotonic

from diagnostic_msgs.msg import DiagnosticArray
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions


@dataclass(frozen=True)
class RequirementReport:
    """A requirement, as `/diagnostics` has it; `message` is its state in words."""

    id: str
    message: str
    steps: int
    announced: int


def next_report(node_name: str, seconds: float,
                is_running: Callable[[], bool]) -> tuple[RequirementReport, ...]:
    """Wait for the next report of a node; return its requirements, none if no report comes."""
    context = Context()
    rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
    node = Node(f'{node_name}_reader', context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    found: list[RequirementReport] = []
    node.create_subscription(
        DiagnosticArray, '/diagnostics',
        lambda array: found.extend(_requirements(array, node_name)), 10)
    try:
        end = monotonic() + seconds
        while not found and monotonic() < end and is_running():
            executor.spin_once(timeout_sec=0.1)
    finally:
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()
    return tuple(found)


def _requirements(array: DiagnosticArray, node_name: str) -> list[RequirementReport]:
    found = []
    for status in array.status:
        node, _, name = status.name.partition(': ')
        values = {item.key: item.value for item in status.values}
        if node.rpartition('/')[2] == node_name and 'announced' in values:
            found.append(RequirementReport(
                name, status.message, int(values.get('steps', values.get('evaluations', '0'))),
                int(values['announced'])))
    return found
