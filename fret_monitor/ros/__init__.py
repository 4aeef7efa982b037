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
The nodes, for use in an rclpy program: `from fret_monitor.ros import MonitorNode`.

A node is imported on first use. So the rest of the package works without ROS 2, and an executable
can set its signal handlers before it imports rclpy.
"""

from importlib import import_module
from typing import Any, TYPE_CHECKING

if TYPE_CHECKING:
    from fret_monitor.ros.nodes.gate_node import GateNode
    from fret_monitor.ros.nodes.logger_node import LoggerNode
    from fret_monitor.ros.nodes.monitor_node import MonitorNode
    from fret_monitor.ros.settings.parameters import Refusal

__all__ = ['GateNode', 'LoggerNode', 'MonitorNode', 'Refusal']

_PLACES = {'GateNode': 'nodes.gate_node', 'LoggerNode': 'nodes.logger_node',
           'MonitorNode': 'nodes.monitor_node', 'Refusal': 'settings.parameters'}


def __getattr__(name: str) -> Any:
    if name not in _PLACES:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module(f'{__name__}.{_PLACES[name]}'), name)
