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
What a user asks of a node by ROS parameters, checked.

All problems are told together, and each with what to write instead.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from math import isfinite
from pathlib import Path
from typing import Any

from fret_monitor.diagnostics import did_you_mean
from fret_monitor.manifest import Policy

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter

MONITOR_PARAMETERS = ('spec', 'library', 'policy', 'period', 'rate')
LOGGER_PARAMETERS = ('spec', 'library')
# rclpy's own
_FOREIGN = ('use_sim_time', 'start_type_description_service')


class Refusal(Exception):
    """Reasons not to start, in words for the user."""

    def __init__(self, *problems: str, heading: str = 'error: ') -> None:
        """Take one problem or more; each is told under the heading."""
        super().__init__('\n'.join(heading + problem for problem in problems))


@dataclass(frozen=True)
class Settings:
    """What to monitor, and what overrides the bundle; `period` is in seconds, exact."""

    spec: Path | None
    library: Path | None
    policy: Policy | None = None
    period: Fraction | None = None


def read_settings(node: Node, names: tuple[str, ...]) -> Settings:
    """
    Read the parameters `names` of a node that declares its overrides by itself.

    Raises
    ------
    Refusal
        if one has a value that cannot be used, or a name that is nearly one of `names`.
    """
    found: Any = node.get_parameters_by_prefix('')  # annotated wrongly in Jazzy
    given = {name: item.value for name, item in found.items()}
    problems: list[str] = []
    _look_for_slips(node, given, names, problems)
    settings = Settings(
        _path(given, 'spec', problems), _path(given, 'library', problems),
        _policy(given, problems), _period(given, problems))
    if settings.spec is None and settings.library is None and not problems:
        problems.append('nothing to monitor: name a bundle with -p spec:=FILE, '
                        'or a compiled one with -p library:=FOLDER')
    if problems:
        raise Refusal(*problems)
    _keep(node, names)
    return settings


def _look_for_slips(node: Node, given: Mapping[str, Any], names: tuple[str, ...],
                    problems: list[str]) -> None:
    # A file of parameters with the wildcard `/**` names those of other nodes too: what looks like
    # none of ours is let pass.
    for name in given:
        if name in names + _FOREIGN:
            continue
        if name.startswith('qos_overrides.'):
            node.get_logger().warning(
                f"ignored parameter '{name}': overrides of the quality of service are not read "
                'yet; say `qos` of the input in the bundle')
            continue
        hint = did_you_mean(name, names)
        if hint:
            problems.append(f"there is no parameter '{name}': {hint}")
        else:
            node.get_logger().warning(
                f"ignored parameter '{name}': this node has {', '.join(names)}")


def _path(given: Mapping[str, Any], name: str, problems: list[str]) -> Path | None:
    value = given.get(name, '')
    if not isinstance(value, str):
        problems.append(f"parameter '{name}' is {value!r}, and has to be a path; "
                        f"quote it: -p '{name}:=\"{value}\"'")
        return None
    return Path(value).expanduser() if value else None


def _policy(given: Mapping[str, Any], problems: list[str]) -> Policy | None:
    value = given.get('policy', '')
    if value == '':
        return None
    words = [policy.value for policy in Policy]
    if value not in words:
        problems.append(f"parameter 'policy' is '{value}', and has to be one of "
                        f"{', '.join(words)}")
        return None
    return Policy(value)


def _period(given: Mapping[str, Any], problems: list[str]) -> Fraction | None:
    period = _positive(given, 'period', 'seconds, say 0.1', problems)
    rate = _positive(given, 'rate', 'steps a second, say 10.0', problems)
    if period is not None and rate is not None:
        problems.append("parameters 'period' and 'rate' say the same thing: give one of them")
    return period if rate is None else 1 / rate


def _positive(given: Mapping[str, Any], name: str, unit: str,
              problems: list[str]) -> Fraction | None:
    value = given.get(name)
    if value is None:
        return None
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not is_number or not isfinite(value) or value <= 0:
        problems.append(
            f"parameter '{name}' is {value!r}, and has to be a number above 0 ({unit})")
        return None
    return Fraction(str(value))  # the decimal number that was written


def _keep(node: Node, names: tuple[str, ...]) -> None:
    """Refuse to change at run time what is read only once."""

    def check(parameters: list[Parameter]) -> SetParametersResult:
        fixed = [item.name for item in parameters if item.name in names]
        reason = f"{', '.join(fixed)}: read at start only; start the node anew" if fixed else ''
        return SetParametersResult(successful=not fixed, reason=reason)

    node.add_on_set_parameters_callback(check)
