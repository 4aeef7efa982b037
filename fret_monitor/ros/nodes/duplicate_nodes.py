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

"""A warning about another node of the same name: calls and remappings then affect both."""

from fret_monitor.native import words
from fret_monitor.ros.watch import steady_timer, Watch

from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node

_CHECKS = 10  # one per second; long enough to discover a node that was started earlier


class DuplicateNodes:
    """Looks for another node of the same full name, and warns once."""

    def __init__(self, node: Node, watch: Watch) -> None:
        """Start; the node's executor runs the checks, and `watch` is told if they fail."""
        self._node = node
        self._left = _CHECKS
        self._timer = steady_timer(node, 1.0, lambda: watch.run('node names', self._check))

    def _check(self) -> None:
        own = self._node.get_name(), self._node.get_namespace()
        self._left -= 1
        try:
            has_other = self._node.get_node_names_and_namespaces().count(own) > 1
        except _rclpy.RCLError:  # the next check follows
            has_other = False
        if has_other:
            self._node.get_logger().warning(
                words.NAMESAKE % self._node.get_fully_qualified_name())
        if has_other or self._left <= 0:
            self._timer.cancel()
