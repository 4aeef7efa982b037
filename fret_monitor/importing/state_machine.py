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
Turns a state diagram into requirements, as the modes of Ogma's command `diagram` do.

The edge out of the state at the step before whose condition holds at this step gives the state at
this step; the first of several in the file; without one, the state stays. `check` is a requirement
that an input follows this. `calculate` defines the state, and `safeguard` says which states may
follow: both have a requirement for each state, whose verdict is the answer.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from itertools import combinations
import re
from typing import assert_never, TypeAlias

from fret_monitor.bundle.bundle import Language
from fret_monitor.importing.component import (
    ComponentRequirement, ComponentVariable, Exclusion, ImportedComponent, VariableRole, Wording,
)
from fret_monitor.importing.diagram import Diagram, Edge
from fret_monitor.importing.parsed_wording import parse_wording
from fret_monitor.model.diagnostics import Diagnostic, Level, Problems, refuse
from fret_monitor.model.names import name_fault, shown

Keys: TypeAlias = tuple[tuple[str, str], ...]

_LANGUAGES = (Language.PTLTL, Language.COCOSPEC)
_MOST_STATES = 256
_TRUE = 'TRUE'
_FOR_EACH_STATE: Keys = (('report', 'onset'), ('severity', 'warn'))
_WITH_ALL_INPUTS: Keys = (('evaluation', '{policy: all_inputs}'),)
_WORD = re.compile(r'[A-Za-z_]\w*')


class Mode(Enum):
    """What becomes of a diagram."""

    CHECK = 'check'
    CALCULATE = 'calculate'
    SAFEGUARD = 'safeguard'


@dataclass(frozen=True)
class DiagramOptions:
    """The mode, the name of the state, and of the input whose values conditions may be."""

    mode: Mode = Mode.CHECK
    state: str = 'state'
    input: str = 'input'


@dataclass(frozen=True)
class StateMachine:
    """A diagram whose edges have the names of the definitions of their conditions."""

    diagram: Diagram
    names: Mapping[Edge, str]
    options: DiagramOptions

    def condition(self, edge: Edge) -> str:
        """Return the condition of an edge in a formula."""
        return self.names.get(edge, _TRUE)

    def out_of(self, state: str) -> list[Edge]:
        """Return the edges out of a state."""
        return [edge for edge in self.diagram.edges if edge.origin == state]


def component_of(diagram: Diagram, options: DiagramOptions, name: str, file: str,
                 problems: Problems) -> ImportedComponent:
    """
    Return a component with the requirements of a diagram; `name` is that of the first one.

    Raises
    ------
    CompileError
        if a state or a condition cannot be written in a bundle.
    """
    _check_names(diagram, options)
    machine = StateMachine(diagram, _edge_names(diagram, options), options)
    conditions = [ComponentVariable(found, VariableRole.INTERNAL, 'bool', (
        _condition(edge, options, file),)) for edge, found in machine.names.items()]
    problems.extend(_unreachable(diagram))
    keys: Keys
    match options.mode:
        case Mode.CHECK:
            requirements, keys = [_followed(machine, name, file)], _WITH_ALL_INPUTS
        case Mode.CALCULATE:
            requirements, keys = [*_each(machine, file, _is_in)], _FOR_EACH_STATE
        case Mode.SAFEGUARD:
            requirements, keys = [*_each(machine, file, _may_be)], _FOR_EACH_STATE
        case _:
            assert_never(options.mode)
    return ImportedComponent(name, '', (*conditions, *_state(machine, file)),
                             tuple(requirements), (file,), keys, tuple(_exclusions(machine)))


def _check_names(diagram: Diagram, options: DiagramOptions) -> None:
    for name in (options.state, options.input):
        if fault := name_fault(name):
            refuse(f'{shown(name)} cannot be the name of an input: {fault.reason}')
    for edge in diagram.edges:
        for state in (edge.origin, edge.target):
            if not state.isdigit() and (fault := name_fault(state)):
                refuse(f'{shown(state)} cannot be the name of a state', edge.place, fault.reason,
                       'use numbers, or names of letters, digits and _')
            if state in (options.state, options.input):
                refuse(f"'{state}' is a state, and the name of the {_role(state, options)}",
                       edge.place, '', f'write --{_role(state, options)}-var NAME')
            if state.isdigit() and int(state) >= _MOST_STATES:
                refuse(f'the state {state} is not below {_MOST_STATES}', edge.place)
    if len(diagram.states) > _MOST_STATES:
        refuse(f'the diagram has more than {_MOST_STATES} states')


def _role(name: str, options: DiagramOptions) -> str:
    return 'state' if name == options.state else 'input'


def _edge_names(diagram: Diagram, options: DiagramOptions) -> dict[Edge, str]:
    """Return a name that is not taken for the condition of each edge that has one."""
    taken = {options.state, options.input, *diagram.states}
    for edge in diagram.edges:
        taken.update(_WORD.findall(edge.condition))
    found: dict[Edge, str] = {}
    for edge in diagram.edges:
        if edge.condition not in ('', _TRUE, 'true'):
            base = f'from_{edge.origin}_to_{edge.target}'
            names = (base, *(f'{base}_{number}' for number in range(2, len(diagram.edges) + 2)))
            found[edge] = next((name for name in names if name not in taken), f'{base}_')
            taken.add(found[edge])
    return found


def _condition(edge: Edge, options: DiagramOptions, file: str) -> Wording:
    """Return the wording of a condition; a number is a value of the input."""
    text = edge.condition
    if re.fullmatch(r'-?\d+(?:\.\d+)?', text):
        text = f'{options.input} = {text}'
    wording = Wording(_LANGUAGES, text, f'{file}, the edge from {edge.origin} to {edge.target}')
    found = parse_wording(wording)
    if found.tree is None:
        first = found.diagnostics[0]
        refuse(f'the condition of the edge from {edge.origin} to {edge.target} cannot be read',
               edge.place, first.title, first.help)
    if options.mode is Mode.CALCULATE and options.state in _WORD.findall(text):
        refuse(f"the condition of an edge reads '{options.state}', which is calculated",
               edge.place, '', 'write --state-var NAME for another name of what is calculated')
    return wording


def _state(machine: StateMachine, file: str) -> Iterator[ComponentVariable]:
    """Yield the state: an input with the names of its values, or a definition."""
    name, states = machine.options.state, machine.diagram.states
    numbers = () if states[0].isdigit() else tuple((one, str(number)) for number, one
                                                   in enumerate(states))
    if machine.options.mode is not Mode.CALCULATE:
        yield ComponentVariable(name, VariableRole.OUTPUT, 'uint8', values=numbers)
        return
    for one, number in numbers:
        yield ComponentVariable(one, VariableRole.INTERNAL, 'uint8',
                                (Wording(_LANGUAGES, number, f'{file}, {one}'),))
    before = f'({machine.diagram.initial or states[0]} -> pre {name})'
    text = before
    for state in reversed(states):
        inner = _next(machine, state, lambda target: target, 'if {} then {} else {}')
        text = f'if {before} = {state} then ({inner}) else {text}'
    yield ComponentVariable(name, VariableRole.INTERNAL, 'uint8', (
        Wording((Language.COCOSPEC,), f'{name} = {text};', f'{file}, the state'),))


def _next(machine: StateMachine, state: str, value: Callable[[str], str], choice: str) -> str:
    """Return the value that belongs to the state after a state, as nested choices."""
    text = value(state)
    for edge in reversed(machine.out_of(state)):
        condition = machine.condition(edge)
        text = value(edge.target) if condition == _TRUE else choice.format(
            condition, value(edge.target), text)
    return text


def _followed(machine: StateMachine, id_: str, file: str) -> ComponentRequirement:
    """Return the requirement that the state follows the diagram."""
    name, states = machine.options.state, machine.diagram.states
    parts = [f'(FTP -> {name} = {machine.diagram.initial})'] if machine.diagram.initial else []
    parts.append('(' + ' | '.join(f'{name} = {state}' for state in states) + ')')
    for state in states:
        following = _next(machine, state, lambda target: f'{name} = {target}', 'ite({}, {}, {})')
        parts.append(f'(Y ({name} = {state}) -> {following})')
    return _requirement(id_, ' & '.join(parts), f'{name} follows the diagram', file)


def _each(machine: StateMachine, file: str,
          part: Callable[[StateMachine, str], tuple[str, str, str]]
          ) -> Iterator[ComponentRequirement]:
    for state in machine.diagram.states:
        yield _requirement(*part(machine, state), file)


def _is_in(machine: StateMachine, state: str) -> tuple[str, str, str]:
    name = machine.options.state
    return f'{name}_{state}', f'{name} = {state}', f'the state is {state}'


def _may_be(machine: StateMachine, state: str) -> tuple[str, str, str]:
    """Return for which states and inputs a state may follow."""
    name = machine.options.state
    into = [edge for edge in machine.diagram.edges if edge.target == state]
    parts = [f'{name} = {edge.origin} & {machine.condition(edge)}' for edge in into]
    leaving = [machine.condition(edge) for edge in machine.out_of(state)]
    if _TRUE not in leaving:
        parts.append(' & '.join([f'{name} = {state}', *(f'!{one}' for one in leaving)]))
    return f'to_{state}', ' | '.join(parts), f'the next state may be {state}'


def _requirement(id_: str, formula: str, title: str, file: str) -> ComponentRequirement:
    return ComponentRequirement(
        id_, (Wording((Language.PTLTL,), formula, f'{file}, {id_}'),), title)


def _exclusions(machine: StateMachine) -> Iterator[Exclusion]:
    """Yield the pairs of edges out of a state to different states."""
    for state in machine.diagram.states:
        for one, two in combinations(machine.out_of(state), 2):
            if one.target != two.target:
                yield Exclusion(
                    machine.condition(one), machine.condition(two),
                    f'two edges out of {state} hold at once, to {one.target} and to {two.target}',
                    'the first one is taken', two.place)


def _unreachable(diagram: Diagram) -> Iterator[Diagnostic]:
    """Report the states to which no edges lead from the first one."""
    first = diagram.initial or diagram.states[0]
    reached, new = {first}, [first]
    while new:
        new = [edge.target for edge in diagram.edges
               if edge.origin in new and edge.target not in reached]
        reached.update(new)
    for state in diagram.states:
        if state not in reached:
            place = next(edge.place for edge in diagram.edges
                         if state in (edge.origin, edge.target))
            yield Diagnostic(f'no edges lead from the state {first} to {state}', place,
                             level=Level.WARNING)
