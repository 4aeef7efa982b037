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

"""The state of a running monitor, read from `/diagnostics` by another program."""

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


@dataclass(frozen=True)
class TopicReport:
    """A topic, as `/diagnostics` has it, with its messages that were not evaluated."""

    name: str
    undecodable: int
    lost: int


@dataclass(frozen=True)
class NodeReport:
    """The requirements and topics of all bundles of a node."""

    requirements: tuple[RequirementReport, ...]
    topics: tuple[TopicReport, ...]


def next_report(node_name: str, requirements: int, seconds: float,
                is_running: Callable[[], bool]) -> NodeReport | None:
    """
    Wait until a node has reported so many requirements; return None if it does not.

    Each bundle of a node is in a report of its own.
    """
    context = Context()
    rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
    node = Node(f'{node_name}_reader', context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)
    found: dict[str, RequirementReport | TopicReport] = {}
    node.create_subscription(
        DiagnosticArray, '/diagnostics',
        lambda array: found.update(reports(array, node_name)), 10)
    try:
        end = monotonic() + seconds
        while (report := complete(found, requirements)) is None \
                and monotonic() < end and is_running():
            executor.spin_once(timeout_sec=0.1)
    finally:
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()
    return report


def complete(found: dict[str, RequirementReport | TopicReport],
             requirements: int) -> NodeReport | None:
    """Return a report of what was found; None if it has fewer requirements than wanted."""
    items = tuple(item for item in found.values() if isinstance(item, RequirementReport))
    topics = tuple(item for item in found.values() if isinstance(item, TopicReport))
    return NodeReport(items, topics) if items and len(items) >= requirements else None


def reports(array: DiagnosticArray,
            node_name: str) -> dict[str, RequirementReport | TopicReport]:
    """Return what a message says of a node, by the names of its statuses."""
    found: dict[str, RequirementReport | TopicReport] = {}
    for status in array.status:
        node, _, name = status.name.partition(': ')
        values = {item.key: item.value for item in status.values}
        if node.rpartition('/')[2] != node_name:
            continue
        if 'announced' in values:
            found[name] = RequirementReport(
                name, status.message, int(values.get('steps', values.get('evaluations', '0'))),
                int(values['announced']))
        elif 'undecodable' in values:
            found[name] = TopicReport(name, int(values['undecodable']), int(values['lost']))
    return found
