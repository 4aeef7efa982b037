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

from dataclasses import replace

from fret_monitor.logic.formula import Formula, Historically
from fret_monitor.logic.specification import Gate, Property, Specification
from fret_monitor.messages.installed import listed
from fret_monitor.model.diagnostics import did_you_mean, refuse
from fret_monitor.model.names import shown
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
    return _kept_by(specification, _find(specification, part.gate)) if part.gate is not None \
        else _ungated(specification)


def _find(specification: Specification, name: str) -> Gate:
    names = [gate.name for gate in specification.gates]
    if name not in names:
        refuse(f"'{specification.name}' has no gate {shown(name)}",
               help=did_you_mean(name, names) or (listed(names) if names else
                                                  "the bundle has no 'gates'"))
    return specification.gates[names.index(name)]


def _kept_by(specification: Specification, gate: Gate) -> Specification:
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
