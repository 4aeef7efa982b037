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

"""The gate node: all gates of one bundle or several, each as a `BundleSession` with a relay."""

from collections.abc import Mapping, Sequence
from typing import Any

from fret_monitor.model.names import distinct_names
from fret_monitor.ros.nodes.monitor_node import MonitorNode
from fret_monitor.ros.settings.opened import open_gates, Opened
from fret_monitor.ros.settings.parameters import Described, GATE_PARAMETERS, Settings


class GateNode(MonitorNode):
    """
    A managed node that runs gates while it is active; otherwise nothing passes them.

    It judges the requirements that its gates keep, and announces them as the monitor does.
    """

    PARAMETERS: Mapping[str, Described] = GATE_PARAMETERS

    def __init__(self, node_name: str = 'fret_gate', **options: Any) -> None:
        """Create the node, as a `MonitorNode`."""
        super().__init__(node_name, **options)

    def _open(self, settings: Settings) -> list[Opened]:
        return open_gates(settings, settings.gates)

    def _names(self, opened: Sequence[Opened]) -> list[str]:
        return distinct_names([item.monitor.manifest.gate.name for item in opened
                               if item.monitor.manifest.gate is not None])
