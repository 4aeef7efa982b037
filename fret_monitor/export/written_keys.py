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
Exports of bundles with `for_each`: the listed keys are written in place of the variables.

Each instance is then a part of a plain bundle. What would not have the verdicts of an instance is
refused with its place.
"""

from dataclasses import replace
from enum import Flag

from fret_monitor.build import Reading
from fret_monitor.logic.expansion import check_names, expanded, in_c
from fret_monitor.logic.formula import variables
from fret_monitor.logic.specification import InstanceAggregate, Signal, Specification
from fret_monitor.model.diagnostics import Problems
from fret_monitor.model.manifest import ManifestVariable
from fret_monitor.model.paths import LookUp
from fret_monitor.model.policies import InputSource, OverInstances, Policy, Stale


class Limits(Flag):
    """What a target cannot have of a bundle with instances."""

    NONE = 0
    AGGREGATES = 1  # they are over instances that are ready; there are inputs without values
    EVERY_MESSAGE = 2  # a message of one key would be a step of all instances
    WHERE = 4  # messages are not selected by a field
    ELEMENTS = 8  # a message without an element of a key would be one of its instance


OF_MESSAGES = Limits.AGGREGATES | Limits.EVERY_MESSAGE | Limits.WHERE
"""Of targets that are given messages."""


def with_written_keys(reading: Reading, target: str, limits: Limits) -> Reading:
    """
    Return a bundle without instance variables, in which their listed keys are written.

    Raises
    ------
    CompileError
        if keys are not listed, names clash, or the target is too limited; with the places.
    """
    specification, problems = reading.specification, Problems()
    if Limits.WHERE in limits:
        for signal in specification.signals:
            if signal.where is not None:
                problems.error(f'{target} does not select messages by `where`', signal.place,
                               f"of '{signal.name}'", 'give the input a topic of its own')
    if specification.instance_variables:
        _check(specification, target, limits, problems)
    problems.raise_errors()
    if not specification.instance_variables:
        return reading
    keys = {item.name: item.keys for item in specification.instance_variables}
    found = expanded(specification, keys, in_c)
    check_names(found, problems)
    problems.raise_errors()
    return replace(reading, specification=found)


def _check(specification: Specification, target: str, limits: Limits,
           problems: Problems) -> None:
    keyed = [item for item in specification.signals if item.variables]
    for variable in specification.instance_variables:
        if not variable.keys:
            _refuse_found(variable, next(
                item for item in keyed if variable.name in item.variables), target, problems)
    if Limits.EVERY_MESSAGE in limits and specification.policy is Policy.EVERY_MESSAGE:
        problems.error(
            f'{target} takes instances under another policy than every_message', keyed[0].place,
            f"a message of one '{keyed[0].variables[0]}' would be a step of all",
            'evaluation: {policy: relevant_message}')
    for signal in keyed if Limits.ELEMENTS in limits else ():
        if any(isinstance(step, LookUp) and step.variable for step in signal.path):
            problems.error(
                f'{target} takes no elements that are looked up by a key', signal.place,
                f"a message without the element would be one of its '{signal.variables[0]}'",
                'give each key a topic of its own')
    for item in specification.aggregates:
        _check_aggregate(item, specification, target, limits, problems)


def _refuse_found(variable: ManifestVariable, signal: Signal, target: str,
                  problems: Problems) -> None:
    problems.error(
        f"{target} needs the keys of '{variable.name}' in a list", signal.place,
        f"'{signal.name}' is of each '{variable.name}' that is found",
        f'for_each: {{{variable.name}: [alpha, beta]}}')


def _check_aggregate(item: InstanceAggregate, specification: Specification, target: str,
                     limits: Limits, problems: Problems) -> None:
    why = _other_value(item, specification) if Limits.AGGREGATES in limits else None
    if why is not None:
        problems.error(f'{target} would have another value over all instances', item.place, *why)
    elif item.function is OverInstances.SUM and item.operand.type.is_float:
        problems.error(
            f'{target} has no sums of floats over instances', item.place,
            'it would be rounded at each addition, not once', 'sum integers')


def _other_value(item: InstanceAggregate,
                 specification: Specification) -> tuple[str, str] | None:
    """Return why a value over instances differs from that of one monitor, and what to write."""
    if specification.policy not in (Policy.PERIODIC, Policy.TIMED):
        return ('it is over the instances that took a step, at messages of their keys',
                'evaluation: {policy: timed}')
    names = {each.name for root in (item.operand, *(one for _, one in item.feedback))
             for each in variables(root)}
    for signal in specification.signals:
        if signal.name not in names or signal.source is InputSource.INSTANCES:
            continue
        if signal.initial is None:
            return (f"it is over the instances that have values, and '{signal.name}' has none "
                    'before its first message', f"give '{signal.name}' an `initial` value")
        if signal.stale is Stale.VIOLATE:
            return (f"it would be unknown while '{signal.name}' is silent in one instance",
                    f"leave `stale` of '{signal.name}' out")
    return None
