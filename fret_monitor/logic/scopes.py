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
The scopes of a specification: what is one for the bundle, and what is one for each key.

A requirement belongs to the scope of the variables that its inputs mention. Each scope is a
specification by itself, so that an instance is evaluated exactly as a bundle in which its key is
written in place of the variable. Values of aggregates are inputs of the bundle's scope; their
operands are evaluated in the scopes of instances, as properties that are not reported. What reads
aggregates is evaluated after their operands: its level is greater, and it has a scope of its own.
"""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from typing import TypeAlias

from fret_monitor.logic.formula import (
    Conversion, Formula, postorder, TRUE, Variable, variables,
)
from fret_monitor.logic.specification import (
    InstanceAggregate, Property, Signal, Specification,
)
from fret_monitor.model.names import HANDLER_PREFIX
from fret_monitor.model.policies import InputSource, Report, Severity
from fret_monitor.model.values import ValueType


@dataclass(frozen=True)
class InstanceScope:
    """
    What there is one of for each key of some variables, at one level.

    The first `n_reported` properties are requirements. Each of the others is the operand of an
    aggregate, given in `aggregates` by the index of its property.
    """

    variables: tuple[str, ...]
    specification: Specification
    n_reported: int
    aggregates: tuple[tuple[int, InstanceAggregate], ...]


_Place: TypeAlias = tuple[int, tuple[str, ...]]


class _Levels:
    """How many aggregates of aggregates a formula reads."""

    def __init__(self, aggregates: Iterable[InstanceAggregate]) -> None:
        self._aggregates = {item.signal.name: item for item in aggregates}

    def of(self, names: Iterable[str]) -> int:
        """Return the level of what reads some inputs; 0 if none of them is an aggregate."""
        return max((1 + self.of_operand(self._aggregates[name]) for name in names
                    if name in self._aggregates), default=0)

    def of_operand(self, item: InstanceAggregate) -> int:
        """Return the level of an aggregate's operand."""
        roots = item.operand, *(equation for _, equation in item.feedback)
        return self.of({node.name for node in postorder(roots) if isinstance(node, Variable)})


def variables_of(names: Iterable[str], signals: Mapping[str, Signal]) -> frozenset[str]:
    """Return the instance variables that some inputs mention."""
    return frozenset(item for name in names for item in signals[name].variables)


def bundle_scope(specification: Specification) -> Specification:
    """Return what mentions no instance variable; the specification itself if there are none."""
    if not specification.instance_variables:
        return specification
    signals = {item.name: item for item in specification.signals}
    return _part(specification, specification.name,
                 [item for item in specification.signals if not item.variables],
                 [item for item in specification.properties
                  if not variables_of(item.inputs, signals)])


def one_instance(specification: Specification) -> Specification:
    """
    Return a specification of one instance of each variable, without variables.

    Values over all instances are then inputs of which nothing is known.
    """
    return replace(
        specification, instance_variables=(), aggregates=(),
        signals=tuple(replace(item, variables=(), where=None, layout=None, source=(
            InputSource.FIELD if item.source is InputSource.INSTANCES else item.source))
            for item in specification.signals)) if specification.instance_variables \
        else specification


def instance_scopes(specification: Specification) -> tuple[InstanceScope, ...]:
    """
    Return the scopes of instances.

    They are in the order of their levels; then those of pairs come first, in the bundle's order.
    For an input that mentions one variable of a pair there is a scope of that variable, perhaps
    without requirements.
    """
    signals = {item.name: item for item in specification.signals}
    order = [item.name for item in specification.instance_variables]
    levels = _Levels(specification.aggregates)
    properties: dict[_Place, list[Property]] = {}
    for item in specification.properties:
        if names := _in_order(variables_of(item.inputs, signals), order):
            properties.setdefault((levels.of(item.inputs), names), []).append(item)
    aggregates: dict[_Place, list[InstanceAggregate]] = {}
    for one in specification.aggregates:
        aggregates.setdefault((levels.of_operand(one), one.variables), []).append(one)
    halves = {(0, item.variables) for item in specification.signals
              for _, names in {*properties, *aggregates}
              if {*item.variables} < {*names} and item.variables}
    places = sorted({*properties, *aggregates, *halves}, key=lambda place: (
        place[0], -len(place[1]), [order.index(name) for name in place[1]]))
    found: list[InstanceScope] = []
    for place in places:
        name = _free('_'.join((specification.name, *place[1])),
                     [item.specification.name for item in found])
        found.append(_scope(specification, place[1], name, properties.get(place, []),
                            aggregates.get(place, [])))
    return tuple(found)


def _in_order(names: Collection[str], order: Iterable[str]) -> tuple[str, ...]:
    return tuple(name for name in order if name in names)


def _scope(specification: Specification, names: tuple[str, ...], name: str,
           properties: list[Property], aggregates: list[InstanceAggregate]) -> InstanceScope:
    taken_names = {item.handler.removeprefix(HANDLER_PREFIX) for item in properties}
    operands = [_operand(item, _free(f'operand_{place}', taken_names))
                for place, item in enumerate(aggregates)]
    taken = [*properties, *operands]
    read = {name for item in taken for name in item.inputs}
    signals = [item for item in specification.signals
               if item.variables and set(item.variables) <= set(names)
               or not item.variables and item.name in read]
    return InstanceScope(
        names, _part(specification, name, signals, taken),
        len(properties), tuple(enumerate(aggregates, len(properties))))


def _free(name: str, taken: Collection[str]) -> str:
    return name if name not in taken else _free(f'{name}_', taken)


def _operand(item: InstanceAggregate, name: str) -> Property:
    """Return the operand of an aggregate as a property of an instance."""
    is_truth = item.function.takes_truth
    return Property(
        name, '', item.signal.name, '', item.operand if is_truth else TRUE,
        Report.ONSET, Severity.WARN, item.feedback, item.place,
        output=None if is_truth else _wide(item.operand))


def _wide(operand: Formula) -> Formula:
    """Return a number as it is kept in the state: float32 as float64, which is exact."""
    is_narrow = operand.type is ValueType.FLOAT32
    return Conversion(operand, ValueType.FLOAT64) if is_narrow else operand


def _part(specification: Specification, name: str, signals: list[Signal],
          properties: list[Property]) -> Specification:
    names = {item.name for item in signals}
    definitions = tuple((word, formula) for word, formula in specification.definitions
                        if all(item.name in names for item in variables(formula)))
    return replace(specification, name=name, properties=tuple(properties), signals=tuple(signals),
                   definitions=definitions, instance_variables=(), aggregates=())
