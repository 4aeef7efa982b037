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
A requirement compiled for the search for examples, in a step group with its triggers.

In a bundle's monitor, requirements that read the same inputs share a group and its state. Here
each requirement has its own copies of the inputs, so that it forms a separate group, whose states
can be explored separately. All requirements are compiled to one library.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from fret_monitor.build import build_specification
from fret_monitor.logic.formula import (
    ALWAYS, Binary, BinaryOperator, Feedback, Formula, Once, postorder, rebuilt, TRUE, Variable,
    variables,
)
from fret_monitor.logic.propositions import propositions, triggers
from fret_monitor.logic.specification import Property, Signal, Specification
from fret_monitor.model.policies import Policy
from fret_monitor.traces.trials import TrialLibrary, Trials

_MAX_TRIGGERS = 4


@dataclass(frozen=True)
class Subject:
    """
    A requirement, its propositions and triggers, and its compiled form.

    Bit 0 of a step's verdicts is the verdict of the requirement; bit i + 1 is whether
    `triggers[i]` has been true so far. `signals` are its inputs, in the order of a row.
    """

    item: Property
    signals: tuple[Signal, ...]
    propositions: tuple[Formula, ...]
    triggers: tuple[Formula, ...]
    trials: Trials


def subjects(specification: Specification, chosen: Sequence[Property],
             goals: Mapping[str, Sequence[Formula]] | None = None) -> list[Subject]:
    """
    Compile some requirements of a bundle, each in a step group of its own.

    `goals` are formulas, by id of the requirement, that should become true in an example; the
    default is the triggers of the formula.

    Raises
    ------
    NativeError
        if there is no C compiler, or it fails.
    """
    wanted = []
    for item in chosen:
        read = read_by(specification, item)
        found = _telling(item, goals or {}, read)
        wanted.append(Observation(item, read, tuple(Once(ALWAYS, node) for node in found)))
    return [
        Subject(each.item, each.signals, tuple(propositions(each.item)),
                tuple(node.argument for node in each.formulas if isinstance(node, Once)), trials)
        for each, trials in zip(wanted, observed(specification, wanted), strict=True)
    ]


def read_by(specification: Specification, item: Property) -> tuple[Signal, ...]:
    """Return the inputs that a requirement reads, in the bundle's order."""
    return tuple(signal for signal in specification.signals if signal.name in item.inputs)


@dataclass(frozen=True)
class Observation:
    """
    A requirement and further formulas over some of its inputs, for a step group of their own.

    `feedback` has the equations of further `Feedback` nodes in the formulas.
    """

    item: Property
    signals: tuple[Signal, ...]
    formulas: tuple[Formula, ...]
    feedback: tuple[tuple[Feedback, Formula], ...] = ()


def observed(specification: Specification, wanted: Sequence[Observation]) -> list[Trials]:
    """
    Compile observations to one library.

    Bit 0 of a step's verdicts is the verdict of the requirement; bit i + 1 is `formulas[i]`.

    Raises
    ------
    NativeError
        if there is no C compiler, or it fails.
    """
    signals: list[Signal] = []
    properties: list[Property] = []
    ranges = []
    for number, each in enumerate(wanted):
        mapping = {signal.name: f'{signal.name}.{number}' for signal in each.signals}
        ranges.append(range(len(properties), len(properties) + 1 + len(each.formulas)))
        signals += [_alone(signal, mapping) for signal in each.signals]
        properties += _properties(each, mapping, number)
    monitor = build_specification(replace(
        specification, signals=tuple(signals), properties=tuple(properties), definitions=(),
        policy=Policy.EVERY_MESSAGE, period=None)).monitor
    library = TrialLibrary()
    return [Trials(library, monitor, numbers) for numbers in ranges]


def _telling(item: Property, goals: Mapping[str, Sequence[Formula]],
             read: Sequence[Signal]) -> tuple[Formula, ...]:
    names = {signal.name for signal in read}
    wanted = goals.get(item.id) or triggers(item.formula, _MAX_TRIGGERS)
    return tuple(node for node in wanted[:_MAX_TRIGGERS]
                 if {each.name for each in variables(node)} <= names)


def _alone(signal: Signal, mapping: Mapping[str, str]) -> Signal:
    return replace(signal, name=mapping[signal.name], topic=None, message_type=None, path=(),
                   initial=None, qos=())


def _properties(observation: Observation, mapping: Mapping[str, str],
                number: int) -> list[Property]:
    """Return properties for the requirement and each formula, all with the same inputs."""
    item = observation.item
    equations = (*item.feedback, *observation.feedback)
    names = {**mapping, **{node.name: f'{node.name}.{number}' for node, _ in equations}}
    renamed = renamed_formulas(
        [item.formula, *observation.formulas, *(equation for _, equation in equations)], names)
    feedback = tuple((Feedback(names[node.name], node.type), renamed[equation])
                     for node, equation in equations)
    main = renamed[item.formula]
    formulas = [main, *(_reading_as(main, renamed[node]) for node in observation.formulas)]
    return [
        replace(item, id=f'{number}.{part}', handler=f'handlerprop{number}_{part}',
                formula=formula, feedback=feedback, text='', title='', place=None)
        for part, formula in enumerate(formulas)
    ]


def _reading_as(other: Formula, formula: Formula) -> Formula:
    """Return an equivalent formula that also reads the inputs of `other`, to share its group."""
    is_other = Binary(BinaryOperator.OR, TRUE, other)
    return Binary(BinaryOperator.AND, formula, is_other)


def renamed_formulas(formulas: Sequence[Formula],
                     names: Mapping[str, str]) -> dict[Formula, Formula]:
    """Return each node of some formulas with its inputs and feedback renamed."""
    new: dict[Formula, Formula] = {}
    for node in postorder(formulas):
        new[node] = type(node)(names.get(node.name, node.name), node.type) \
            if isinstance(node, Variable | Feedback) else rebuilt(node, new)
    return new
