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

"""
The standard parameters for the quality of service: `qos_overrides` (docs/ros_interface.md).

Their names are those of rclcpp and rclpy, with the topic's name after remapping:
`qos_overrides./windspeed.subscription.reliability`. They override the bundle.
"""

from collections.abc import Iterable, Mapping
from typing import Any

from fret_monitor.model.manifest import Manifest
from fret_monitor.model.report_table import used_topics
from fret_monitor.ros.settings.parameters import Refusal
from fret_monitor.ros.watch import steady_timer, Watch
from fret_monitor.runtime.overrides import Overrides

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node

_DECLARE_S = 0.01  # between two topics


def overrides_of(node: Node, library: Any, manifests: Iterable[Manifest] = ()) -> Overrides:
    """
    Return the overrides given to a node that runs these bundles; `library` has the functions of C.

    Raises `Refusal` with all problems.
    """
    given: dict[str, Any] = node._parameter_overrides
    found = Overrides(library, {name: item.value for name, item in given.items()})
    if lines := found.problems([
            node.resolve_topic_name(name) for manifest in manifests
            for name, _, kind in used_topics(manifest) if kind == 'FM_ANNOUNCED']):
        raise Refusal(*(line.text for line in lines))
    return found


class DeclaredOverrides:
    """
    Declares the overrides as parameters, so that `ros2 param` lists and describes them.

    rclpy needs 0.1 ms for a parameter, so a timer declares them one topic at a time: neither the
    start nor a period waits for all of them.
    """

    def __init__(self, node: Node, watch: Watch, overrides: Overrides,
                 topics: Mapping[str, Mapping[str, str | int]]) -> None:
        """Start declaring; `topics` has full names, each with the policies the bundle fixes."""
        self._node = node
        self._overrides = overrides
        self._left = sorted(topics.items(), reverse=True)
        self._names: list[str] = []
        self._timer = steady_timer(
            node, _DECLARE_S, lambda: watch.run('parameters', self._declare_next))

    def _declare_next(self) -> None:
        if not self._left:
            self._timer.cancel()
            return
        for item in self._overrides.shown(*self._left.pop()):
            if not self._node.has_parameter(item.parameter):
                self._node.declare_parameter(item.parameter, item.value, ParameterDescriptor(
                    description=item.description, dynamic_typing=True), ignore_override=True)
                self._names.append(item.parameter)

    def close(self) -> None:
        """Undeclare the parameters."""
        self._node.destroy_timer(self._timer)
        while self._names:
            self._node.undeclare_parameter(self._names.pop())
