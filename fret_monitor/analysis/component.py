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
The parts of a bundle that are analysed by themselves, each with its system.

Requirements that share no input, directly or through others, do not affect one another.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import gcd

from fret_monitor.analysis.diagrams import Diagrams
from fret_monitor.analysis.games import Games
from fret_monitor.analysis.letters import BEFORE, blocks
from fret_monitor.elaboration.fretish import is_not_yet
from fret_monitor.logic.formula import (
    Aggregate, Ago, Binary, BinaryOperator, Feedback, Formula, Over, postorder, Slope, TimeOver,
    TRUE, Unary, UnaryOperator, variables,
)
from fret_monitor.logic.propositions import untriggered
from fret_monitor.logic.specification import Property, Signal, Specification
from fret_monitor.model.graph import sharing
from fret_monitor.model.policies import InputRole, Policy
from fret_monitor.program.lower import lower_together
from fret_monitor.program.monitor_program import StepGroup
from fret_monitor.smt import numbers
from fret_monitor.smt import terms as t
from fret_monitor.smt.boolean import bit_system, BitSystem, boolean_system
from fret_monitor.smt.terms import Term
from fret_monitor.traces.deadline import Deadline
from fret_monitor.traces.sampled import grid_of, sampled


@dataclass(frozen=True)
class Part:
    """Some requirements and the assumptions that concern them, in the bundle's order."""

    properties: tuple[Property, ...]

    @property
    def ids(self) -> tuple[str, ...]:
        """The ids of all."""
        return tuple(item.id for item in self.properties)

    @property
    def required(self) -> tuple[str, ...]:
        """The ids of the requirements that are no assumptions."""
        return tuple(item.id for item in self.properties if not item.is_assumption)


def has_unknown_values(item: Property) -> bool:
    """Whether a requirement has values that no solver knows: of the C library, or of windows."""
    for node in postorder(item.roots):
        match node:
            case Unary(UnaryOperator() as operator) if operator.value in t.LIBRARY:
                return True
            case Binary(BinaryOperator.POW | BinaryOperator.ATAN2):
                return True
            case Binary(BinaryOperator.MOD) if node.type.is_float:
                return True
            case Over(aggregate, _, _, at) if aggregate is not Aggregate.COUNT or at is not TRUE:
                return True
            case Ago() | Slope() | TimeOver():
                return True
            case _:
                pass
    return False


def parts(properties: Sequence[Property], names: Callable[[Property], Iterable[str]]
          ) -> list[Part]:
    """Return the requirements in groups that share names, in the order of the first of each."""
    return [Part(tuple(found)) for found in sharing(properties, names)]


def by_inputs(specification: Specification) -> list[Part]:
    """Return the parts of a bundle that share no inputs."""
    return parts(specification.properties, lambda item: item.inputs)


def by_outputs(specification: Specification, within: Part | None = None) -> list[Part]:
    """
    Return the components: requirements that share outputs, with the assumptions about them.

    `within` is the part of the bundle that they belong to; None: all.

    An assumption belongs to each component with which it shares an input, directly or through
    other assumptions. One that reads outputs joins these components: all set its outputs.
    """
    outputs = output_names(specification)
    properties = specification.properties if within is None else within.properties
    required = [item for item in properties if not item.is_assumption]
    assumed = parts([item for item in properties if item.is_assumption],
                    lambda item: item.inputs)
    joined = _joined_by_assumptions(assumed, outputs)
    found = []
    for part in parts(required, lambda item: {
            joined.get(name, name) for name in item.inputs if name in outputs or name in joined}):
        used = {name for item in part.properties for name in item.inputs}
        concerned = {item.id for group in assumed for item in group.properties
                     if used & {name for each in group.properties for name in each.inputs}}
        kept = {*part.ids, *concerned}
        found.append(Part(tuple(item for item in properties if item.id in kept)))
    return found


def unrelated_assumptions(specification: Specification) -> list[Part]:
    """Return the groups of assumptions that concern no component."""
    used = {name for part in by_outputs(specification) for name in part.ids}
    return parts([item for item in specification.properties
                  if item.is_assumption and item.id not in used], lambda item: item.inputs)


def _joined_by_assumptions(assumed: Sequence[Part], outputs: set[str]) -> dict[str, str]:
    """Return, by input, a name of the group of assumptions that reads it, and an output."""
    found = {}
    for number, group in enumerate(assumed):
        names = {name for item in group.properties for name in item.inputs}
        if names & outputs:
            found.update(dict.fromkeys(names, f'assumptions {number}'))
    return found


def united(within: Part, some: Iterable[Part]) -> Part:
    """Return some parts as one."""
    kept = {name for part in some for name in part.ids}
    return Part(tuple(item for item in within.properties if item.id in kept))


def output_names(specification: Specification) -> set[str]:
    """Return the names of the inputs that the system sets."""
    return {item.name for item in specification.signals if item.role is InputRole.OUTPUT}


@dataclass(frozen=True)
class Component:
    """
    The system of a part.

    Outputs of the system are the verdicts, by place in the part, then those of the `triggers`: by
    place, what is violated once the requirement's trigger has come. `inputs` are the terms of the
    signals, `group` are the equations, `whole` is the system with its numbers, `domains` are the
    numbers of values of string inputs, and None for floats that are never negative. `doubts` say
    why a yes may not be final, `gaps` why a no may not be. `grid` is the time of a step in
    nanoseconds, None unless the policy is timed.
    """

    part: Part
    signals: tuple[Signal, ...]
    inputs: tuple[Term, ...]
    group: StepGroup
    whole: BitSystem
    domains: Mapping[Term, int | None]
    games: Games
    triggers: Mapping[int, int]
    doubts: tuple[str, ...]
    gaps: tuple[str, ...]
    grid: int | None

    @property
    def required(self) -> list[int]:
        """The places of the requirements that are no assumptions."""
        return [place for place, item in enumerate(self.part.properties)
                if not item.is_assumption]


def build_component(specification: Specification, part: Part,
                    denials: Mapping[str, Formula] | None, deadline: Deadline,
                    is_on_grid: bool = False) -> Component:
    """
    Build the system of a part.

    `denials` are formulas by id that are violated once the requirement's trigger comes; with None
    there are no triggers. Under the policy timed a step is a nanosecond; with `is_on_grid` it is a
    point of a grid of time.

    Raises
    ------
    TooLarge, NotModelled, OutOfTime
        if there is none.
    """
    extra = [] if denials is None else list(trigger_properties(part, denials))
    wanted = [*part.properties, *(item for _, item in extra)]
    grid = None
    if specification.policy is Policy.TIMED:
        grid = gcd(*map(grid_of, part.properties)) if is_on_grid else 1
        if is_on_grid:
            wanted = [sampled(item, grid) for item in wanted]
    used = {name for item in wanted for name in item.inputs}
    signals = tuple(item for item in specification.signals if item.name in used)
    group = lower_together(replace(
        specification, signals=signals, properties=tuple(wanted), policy=Policy.EVERY_MESSAGE,
        period=None, definitions=()))
    inputs = tuple(t.variable(item.name, numbers.sort_of(item.type)) for item in signals)
    whole = bit_system(group, dict(enumerate(inputs)))
    system = boolean_system(whole, inputs, range(len(wanted)))
    chosen = [item for item, signal in zip(inputs, signals) if signal.role is InputRole.OUTPUT]
    domains = {item: len(signal.values) if signal.is_string else None
               for item, signal in zip(inputs, signals)
               if signal.is_string or signal.is_never_negative}
    found = blocks(system, chosen, domains, deadline)
    diagrams = Diagrams(system, found, deadline)
    gaps = dict.fromkeys(gap for block in found for gap in block.gaps)
    doubts = dict.fromkeys([*gaps, *(doubt for block in found for doubt in block.doubts)])
    if system.related:
        doubts[BEFORE] = None
    count = len(part.properties)
    return Component(
        part, signals, inputs, group, whole, domains,
        _games(diagrams, part, output_names(specification)),
        {place: count + number for number, (place, _) in enumerate(extra)}, tuple(doubts),
        tuple(gaps), grid)


def _games(diagrams: Diagrams, part: Part, outputs: set[str]) -> Games:
    items = part.properties
    assumed = [item for item in items if item.is_assumption]
    linked = {name for group in parts(assumed, lambda item: item.inputs)
              if any(outputs.intersection(item.inputs) for item in group.properties)
              for name in group.ids}

    def places(is_one: Callable[[Property], object]) -> list[int]:
        return [place for place, item in enumerate(items) if is_one(item)]

    return Games(
        diagrams,
        assumptions=places(lambda item: item.is_assumption),
        pending=places(lambda item: item.sentence is not None and is_not_yet(item.sentence)),
        shared=places(lambda item: item.is_assumption and outputs.intersection(item.inputs)),
        linked=places(lambda item: item.id in linked))


def trigger_properties(part: Part, denials: Mapping[str, Formula]
                       ) -> Iterator[tuple[int, Property]]:
    """Yield, by place, properties that are violated once a trigger has come."""
    for place, item in enumerate(part.properties):
        denial = denials.get(item.id)
        if denial is None:
            denial = untriggered(item)
        if denial is None:
            continue
        known = {node for node, _ in item.feedback}
        if set(variables(denial)) and all(
                node in known for node in postorder([denial]) if isinstance(node, Feedback)):
            yield place, replace(item, id=f'{item.id} trigger', formula=denial)
