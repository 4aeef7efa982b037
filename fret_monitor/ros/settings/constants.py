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
The parameters `constants.NAME`: other values for constants of the bundles.

Those that are given are declared at the start; the others when the bundles are known, with the
values of the bundles, so that `ros2 param` shows all.
"""

from collections.abc import Iterable
from typing import Any

from fret_monitor.model.names import is_integer, number_fault
from fret_monitor.ros.settings.parameters import CONSTANTS

from rcl_interfaces.msg import ParameterDescriptor
from rclpy.node import Node

_LARGEST = 2 ** 63


class ConstantParameters:
    """The declared parameters `constants.NAME` of a node."""

    def __init__(self, node: Node, description: str, read_only: bool) -> None:
        """Declare those that were given."""
        self._node = node
        self._description = description
        self._read_only = read_only
        self._of_bundles: dict[str, Any] = {}
        self._declared = [name for name in node._parameter_overrides if name.startswith(CONSTANTS)]
        for name in self._declared:
            node.declare_parameter(name, 0, self._descriptor())

    def _descriptor(self) -> ParameterDescriptor:
        """Return a new one each time: rclpy writes name and type into it."""
        return ParameterDescriptor(
            description=self._description, read_only=self._read_only, dynamic_typing=True)

    def has(self, name: str) -> bool:
        """Return whether a parameter is one of these."""
        return name in self._declared

    def overrides(self) -> dict[str, Any]:
        """Return those whose values do not come from the bundles."""
        values = {name: self._node.get_parameter(name).value for name in self._declared}
        return {name: value for name, value in values.items()
                if name not in self._of_bundles or value != self._of_bundles[name]}

    def show(self, constants: Iterable[tuple[str, str]]) -> None:
        """
        Declare the constants of the bundles; those of earlier bundles are no more.

        One parameter cannot show several values: bundles that differ in a constant have none.
        """
        overrides = self.overrides()
        for name in [name for name in self._declared if name not in overrides]:
            self._node.undeclare_parameter(name)
            self._declared.remove(name)
        self._of_bundles = {}
        values: dict[str, list[Any]] = {}
        for name, text in constants:
            values.setdefault(CONSTANTS + name, []).append(_value(text))
        for parameter, found in values.items():
            if parameter not in self._declared and all(value == found[0] for value in found):
                self._of_bundles[parameter] = found[0]
                self._node.declare_parameter(parameter, found[0], self._descriptor())
                self._declared.append(parameter)


def _value(text: str) -> bool | int | float | str:
    """Return the value of a constant for a parameter; its text if it does not fit."""
    if text.lower() in ('true', 'false'):
        return text.lower() == 'true'
    if is_integer(text) and abs(int(text)) < _LARGEST:
        return int(text)
    return text if is_integer(text) or number_fault(text) else float(text)
