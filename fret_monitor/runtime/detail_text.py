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
The text of a violation's details, as `copilot/violations` has it (docs/ros.md, Topics).

A node publishes it, and a recording of violations contains it.
"""

from dataclasses import dataclass

from fret_monitor.model.floats import shortest_float32
from fret_monitor.model.manifest import Manifest, ManifestInput, ManifestRequirement
from fret_monitor.model.policies import Policy, Severity
from fret_monitor.model.values import ValueType
from fret_monitor.runtime.engine import ViolationDetail

OF_STEPS = ('step', 'stamp', 'suppressed', 'silent')
"""Keys of all details, in this order."""

OF_TIMES = ('time', *OF_STEPS[1:])
"""The same under the policy timed."""

WITHHELD_BY = 'withheld by'
"""The last key of a violation by a message that a gate withheld; no input has such a name."""

Value = bool | int | float | None

_OF_ALL = frozenset((*OF_STEPS, *OF_TIMES))


@dataclass(frozen=True)
class DetailText:
    """
    The fields of a diagnostic_msgs/msg/DiagnosticStatus that has the details of a violation.

    `severity` is None if the violation is over. `values` are keys and values.
    """

    severity: Severity | None
    name: str
    message: str
    hardware_id: str
    values: tuple[tuple[str, str], ...]


def detail_text(manifest: Manifest, detail: ViolationDetail) -> DetailText:
    """Return the text of a detail."""
    violation = detail.violation
    requirement = manifest.requirements[violation.requirement]
    inputs = manifest.inputs
    is_timed = manifest.policy is Policy.TIMED
    silent = [inputs[index].name for index in requirement.inputs if index in detail.stale]
    place = short_seconds(violation.step) if is_timed else str(violation.step)
    of_all = (place, seconds(violation.stamp), str(detail.suppressed), ', '.join(silent))
    return DetailText(
        None if detail.is_recovery else requirement.severity,
        requirement.id,
        ' '.join((requirement.title or requirement.text).split()),
        manifest.component,
        (*zip(OF_TIMES if is_timed else OF_STEPS, of_all),
         *((_key(inputs[index].name), show(inputs[index], detail.values[index]))
           for index in requirement.inputs),
         *((_key(name, 'constant'), value) for name, value in constants_of(manifest, requirement)),
         *([(WITHHELD_BY, manifest.gate.name)]
           if violation.is_withheld and manifest.gate is not None else [])))


def constants_of(manifest: Manifest,
                 requirement: ManifestRequirement) -> tuple[tuple[str, str], ...]:
    """Return the names and values of the constants that the text of a requirement names."""
    return tuple(manifest.constants[index] for index in requirement.constants)


def short_seconds(nanoseconds: int) -> str:
    """Return a time in seconds, exactly, without zeros at its end."""
    return seconds(nanoseconds).rstrip('0').rstrip('.')


def seconds(nanoseconds: int) -> str:
    """Return a time in seconds, exactly, with nine decimals."""
    whole, rest = divmod(abs(nanoseconds), 10**9)
    return f"{'-' if nanoseconds < 0 else ''}{whole}.{rest:09d}"


def _key(name: str, prefix: str = 'input') -> str:
    """Return the key of a value: its name, with a prefix if all details have such a key."""
    return f'{prefix} {name}' if name in _OF_ALL else name


def value_name(key: str) -> str:
    """Return the name of the input or constant with a key of a detail."""
    name = key.removeprefix('input ').removeprefix('constant ')
    return name if name in _OF_ALL else key


def show(item: ManifestInput, value: Value) -> str:
    """Return a value as written in a bundle; a named value by its name."""
    if value is None:
        return '(none yet)'
    for place, (name, number) in enumerate(item.values):
        if value == (place if item.is_string else number):
            return name
    if isinstance(value, bool):
        return str(value).lower()
    if item.value_type is ValueType.FLOAT32 and isinstance(value, float):
        return shortest_float32(value)
    return repr(value)
