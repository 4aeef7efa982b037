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

"""The ROS parameters of a node, as rclpy declares them."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from fret_monitor.model.diagnostics import did_you_mean, suggestion
from fret_monitor.model.manifest import Manifest
from fret_monitor.model.names import is_integer, number_fault
from fret_monitor.native import words
from fret_monitor.ros.settings.parameters import (
    check_settings, CONSTANT, CONSTANTS, Described, Given, KNOWN, MONITOR_PARAMETERS, OF_BOTH,
    Refusal,
)

from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.logging import LoggingSeverity
from rclpy.node import Node
from rclpy.parameter import Parameter

_LARGEST_INTEGER = 2 ** 63
_SETTERS = ('set_parameters', 'set_parameters_atomically')


class Parameters:
    """The declared parameters of a node."""

    def __init__(self, node: Node, table: Mapping[str, Described],
                 is_configured: Callable[[], bool] = bool) -> None:
        """
        Declare the parameters of `table`.

        While `is_configured` returns true, those that `configure` reads cannot change. Raises
        `Refusal` if the value of one that the node in C has, too, cannot be used.
        """
        self._node = node
        self._table = table
        self._is_configured = is_configured
        for service in node.services:
            if service.service_name.rpartition('/')[2] in _SETTERS:
                service.callback = _knowing_types(service.callback)
        for name, item in table.items():
            node.declare_parameter(name, item.default, ParameterDescriptor(
                description=item.description, read_only=item.read_only, dynamic_typing=True))
        self._constants = ConstantParameters(
            node, CONSTANT, read_only=table['spec'].read_only)
        self._ignored = self._find_ignored()
        self._names_of_constants: set[str] = set()
        self._refuse_values()
        self._set_level()
        # It is called with those that are about to be declared, too.
        node.add_on_set_parameters_callback(lambda parameters: self.check(
            item for item in parameters if node.has_parameter(item.name)))
        node.add_post_set_parameters_callback(lambda _: self._set_level())

    def _refuse_values(self) -> None:
        values = self.values()
        given = Given(values)
        check_settings(given)
        if not all(MONITOR_PARAMETERS[name].takes(values[name]) for name in ('native', *OF_BOTH)
                   if name in values):
            self._warn_of_ignored()
            raise Refusal(*given.problems)

    def values(self) -> dict[str, Any]:
        values = {name: self._node.get_parameter(name).value for name in self._table}
        return values | self._constants.overrides()

    def show_constants(self, manifests: Iterable[Manifest]) -> None:
        """
        Declare a parameter for each constant of the bundles, with the value in use.

        A constant that has several values is left out unless it was given.
        """
        pairs = [pair for item in manifests for pair in item.constants]
        self._constants.show(pairs)
        self._names_of_constants = {name for name, _ in pairs}

    @contextmanager
    def warning_of_ignored(self) -> Iterator[None]:
        """
        Warn, once, about the ignored parameters at the end of the block, also of one that fails.

        The block opens the bundles and calls `show_constants`: an ignored parameter may have the
        name of one of their constants.
        """
        try:
            yield
        finally:
            self._warn_of_ignored()

    def _warn_of_ignored(self) -> None:
        while self._ignored:
            name = self._ignored.pop(0)
            self._node.get_logger().warning(words.IGNORED % (name, self._hint(name)))

    def _find_ignored(self) -> list[str]:
        """
        Return the given parameters that this node does not have; `Overrides` reads its own.

        They are no error: a file with the wildcard `/**` also has parameters of other nodes.
        """
        return [name for name in self._node._parameter_overrides
                if not name.startswith(words.OVERRIDES) and not self._constants.has(name)
                and name not in KNOWN and not self._node.has_parameter(name)]

    def _hint(self, name: str) -> str:
        constant = name.rpartition('.')[2]
        if constant in self._names_of_constants:
            return suggestion([CONSTANTS + constant])
        return did_you_mean(name, self._table) or words.ALL_PARAMETERS % ', '.join(self._table)

    def check(self, parameters: Iterable[Parameter]) -> SetParametersResult:
        """Refuse changes that are not possible now, and values that cannot be used, in order."""
        new = [(item.name, item.value) for item in parameters]
        problems = [text for name, value in new for text in self._problems(name, value)]
        return _result(problems or _problems_of(self.values() | dict(new)))

    def _problems(self, name: str, value: Any) -> list[str]:
        if not self._node.has_parameter(name):
            return [words.NO_PARAMETER % name]
        # Overrides are undeclared again, and so not read-only.
        if self._node.describe_parameter(name).read_only or name.startswith(words.OVERRIDES):
            return [words.READ_AT_START % name]
        is_known = name in self._table or self._constants.has(name)
        if is_known and name != 'log_level' and self._is_configured():
            return [words.READ_ONCE % name]
        return _problems_of({name: value})

    def _set_level(self) -> None:
        self._node.get_logger().set_level(
            LoggingSeverity[(self.values()['log_level'] or 'unset').upper()])


def _knowing_types(set_parameters: Callable[[Any, Any], Any]) -> Callable[[Any, Any], Any]:
    """
    Return a service callback for which a value of an unknown type is an empty list.

    rclpy's own raises an error then, which would end the process.
    """
    def answer(request: Any, response: Any) -> Any:
        for item in request.parameters:
            if item.value.type > Parameter.Type.STRING_ARRAY.value:
                item.value.type = Parameter.Type.STRING_ARRAY.value
        return set_parameters(request, response)

    return answer


def _problems_of(values: Mapping[str, Any]) -> list[str]:
    given = Given(values)
    check_settings(given)
    if not isinstance(given.values.get('use_sim_time', False), bool):
        given.refuse('use_sim_time', 'true or false')
    return given.problems


def _result(problems: Iterable[str]) -> SetParametersResult:
    reason = '; '.join(problems)
    return SetParametersResult(successful=not reason, reason=reason)


class ConstantParameters:
    """
    The parameters `constants.NAME` of a node: other values for constants of the bundles.

    Those that are given are declared at the start; the others when the bundles are known, with the
    values of the bundles, so that `ros2 param` shows all.
    """

    def __init__(self, node: Node, description: str, read_only: bool) -> None:
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
            values.setdefault(CONSTANTS + name, []).append(_constant(text))
        for parameter, found in values.items():
            if parameter not in self._declared and all(value == found[0] for value in found):
                self._of_bundles[parameter] = found[0]
                self._node.declare_parameter(parameter, found[0], self._descriptor())
                self._declared.append(parameter)


def _constant(text: str) -> bool | int | float | str:
    """Return the value of a constant for a parameter; its text if it does not fit."""
    if text.lower() in ('true', 'false'):
        return text.lower() == 'true'
    if is_integer(text) and abs(int(text)) < _LARGEST_INTEGER:
        return int(text)
    return text if is_integer(text) or number_fault(text) else float(text)
