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

"""The node that watches: what it is to do comes by parameters, the work is `BundleWatch`'s."""

from contextlib import ExitStack
from typing import Any

from fret_monitor.ros.bundle_watch import BundleWatch
from fret_monitor.ros.compiled import open_monitor, Opened
from fret_monitor.ros.parameters import MONITOR_PARAMETERS, read_settings

from rclpy.node import Node
from std_srvs.srv import Trigger


class MonitorNode(Node):
    """
    Monitors a bundle from its making until `destroy_node`.

    It can be spun by any executor: that serves `~/reset`, parameters and periods. Messages do
    not need one.
    """

    def __init__(self, node_name: str = 'fret_monitor', **options: Any) -> None:
        """
        Make the node and start watching; `options` are those of `rclpy.node.Node`.

        Raises
        ------
        Refusal
            if parameters, bundle or library are not such that it can start. Nothing is left.
        """
        super().__init__(
            node_name, automatically_declare_parameters_from_overrides=True, **options)
        self._watches: list[BundleWatch] = []
        with ExitStack() as undo:
            undo.callback(self.destroy_node)
            self._begin(open_monitor(read_settings(self, MONITOR_PARAMETERS)))
            undo.pop_all()

    def _begin(self, opened: Opened) -> None:
        self._watches.append(BundleWatch(self, opened))
        self.create_service(Trigger, '~/reset', self._reset)
        for warning in opened.warnings:
            self.get_logger().warning(warning)
        for watch in self._watches:
            watch.start()
        self.get_logger().info(_announcement(opened))

    def destroy_node(self) -> None:
        """End the watches, then the node."""
        for watch in self._watches:
            watch.close()
        super().destroy_node()

    def _reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        groups = sum(watch.reset() for watch in self._watches)
        response.success = True
        response.message = f'restarted {_count(groups, "step group")}; input values kept'
        self.get_logger().info(response.message)
        return response


def _announcement(opened: Opened) -> str:
    manifest = opened.monitor.manifest
    return (f'watching {_count(len(manifest.requirements), "requirement")} '
            f'on {_count(len(manifest.inputs), "input")} '
            f'of {_count(len(manifest.topics), "topic")}, policy {opened.policy.value}, '
            f'{"" if opened.period is None else f"{opened.period:g} s, "}'
            f'{_count(manifest.state_bytes, "byte")} of state ({opened.origin})')


def _count(number: int, noun: str) -> str:
    return f'{number} {noun}' if number == 1 else f'{number} {noun}s'
