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

"""The part of a specification that a gate judges, and the part that the monitor judges."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from itertools import product

from fret_monitor.logic.expansion import check_names, expanded, in_c, Written
from fret_monitor.logic.formula import Formula, Historically
from fret_monitor.logic.specification import Gate, Property, Specification
from fret_monitor.messages.installed import listed
from fret_monitor.model.diagnostics import did_you_mean, Problems, refuse
from fret_monitor.model.manifest import ManifestVariable
from fret_monitor.model.names import PLACEHOLDER, shown
from fret_monitor.model.parts import NodePart
from fret_monitor.model.policies import Report


def restrict(specification: Specification, part: NodePart) -> Specification:
    """
    Return a part of a specification.

    That of a gate has the requirements that it keeps, and the inputs that they read. That of the
    monitor has the requirements that no gate keeps, and all inputs, so that a gate changes nothing
    for them.

    Raises
    ------
    CompileError
        if there is no such gate, or no requirement is left.
    """
    return kept_by(*_find(specification, part.gate)) if part.gate is not None \
        else _ungated(specification)


def gates_with_keys(specification: Specification) -> Iterator[tuple[Specification, Gate]]:
    """
    Yield each gate, one for each key of the variables that it mentions, with what it is a part of.

    That has no instance variables: their keys, which are listed, are written in their place.
    """
    variables = specification.instance_variables
    for gate in specification.gates:
        for written in _keys_of(gate, variables):
            yield _with_keys(specification, gate, written) if variables else (specification, gate)


def names_with_keys(gate: Gate, variables: Iterable[ManifestVariable]) -> list[str]:
    """Return the names of a gate, one for each key of the variables that it mentions."""
    return [in_c(gate.name, written) for written in _keys_of(gate, variables)]


def _keys_of(gate: Gate, variables: Iterable[ManifestVariable]) -> Iterator[Written]:
    own = [item for item in variables if item.name in PLACEHOLDER.findall(gate.settings.source)]
    for keys in product(*(item.keys for item in own)):
        yield tuple(zip((item.name for item in own), keys, strict=True))


def _with_keys(specification: Specification, gate: Gate,
               written: Written) -> tuple[Specification, Gate]:
    """Return a gate of some keys; the other variables of what it keeps have all their keys."""
    own = dict(written)
    properties = [item for item in specification.properties if item.id in gate.keep]
    read = {name for item in properties for name in item.inputs}
    part = replace(
        specification, properties=tuple(properties), definitions=(), aggregates=(),
        signals=tuple(item for item in specification.signals if item.name in read))
    whole = expanded(
        part, {item.name: (own[item.name],) if item.name in own else item.keys
               for item in specification.instance_variables},
        lambda name, keys: in_c(name, tuple(item for item in keys if item[0] not in own)))
    _check_clashes(whole)
    places = {property_.id_place: place for property_ in properties
              for id_, place in zip(gate.keep, gate.keep_places) if id_ == property_.id}

    def with_own(topic: str) -> str:
        return PLACEHOLDER.sub(lambda found: own.get(found[1], found[0]), topic)

    return whole, replace(
        gate, keep=tuple(item.id for item in whole.properties),
        keep_places=tuple(places[item.id_place] for item in whole.properties),
        settings=replace(
            gate.settings, name=in_c(gate.name, written),
            source=with_own(gate.settings.source), target=with_own(gate.settings.target)))


def _check_clashes(whole: Specification) -> None:
    """Refuse copies that have one name in C."""
    problems = Problems()
    check_names(whole, problems)
    problems.raise_errors()


def _find(specification: Specification, name: str) -> tuple[Specification, Gate]:
    found = {gate.name: (whole, gate) for whole, gate in gates_with_keys(specification)}
    names = [*found]
    if name not in found:
        refuse(f"'{specification.name}' has no gate {shown(name)}",
               help=did_you_mean(name, names) or (listed(names) if names else
                                                  "the bundle has no 'gates'"))
    return found[name]


def kept_by(specification: Specification, gate: Gate) -> Specification:
    """Return the part of a specification that one of its gates judges."""
    properties = tuple(_judged(item) for item in specification.properties if item.id in gate.keep)
    read = {name for item in properties for name in item.inputs}
    return _with(replace(
        specification, name=f'{specification.name}_{gate.name}', gate=gate,
        signals=tuple(item for item in specification.signals if item.name in read)), properties)


def judged_formula(item: Property) -> Formula:
    """Return what a gate judges by: of `H p`, p; `H p` would withhold all for ever."""
    match item.formula:
        case Historically(window, argument) if window.is_unbounded:
            return argument
    return item.formula


def _judged(item: Property) -> Property:
    is_always = judged_formula(item) is not item.formula
    return replace(item, report=Report.OCCURRENCE) if is_always else item


def _ungated(specification: Specification) -> Specification:
    if not specification.gates:
        return specification
    kept = tuple((gate.name, gate.keep) for gate in specification.gates)
    properties = tuple(item for item in specification.properties
                       if item.id not in specification.gated)
    if not properties:
        names = ', '.join(gate.name for gate in specification.gates)
        refuse(f"gates keep all requirements of '{specification.name}' ({names})",
               help='the node gate judges them: ros2 run fret_monitor gate; '
                    'to compile one: fret-monitor compile --gate NAME')
    return _with(replace(specification, kept=kept), properties)


def _with(specification: Specification, properties: tuple[Property, ...]) -> Specification:
    used = {name for item in properties for name in (*item.on_violation, *item.on_end)}
    return replace(specification, properties=properties, gates=(), actions=tuple(
        action for action in specification.actions if action.name in used))
