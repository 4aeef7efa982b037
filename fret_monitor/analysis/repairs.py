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
Gates that nothing can open: whether some message always satisfies what a gate keeps.

The inputs on the gate's topic are choices of the system, all others of the environment. A
requirement is *unrepairable* in a state if it is false after the next message of the gate's topic
for some values of the other inputs, whatever the message. Only the states count that messages that
pass, and messages of other topics, lead to.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from fret_monitor.analysis.component import build_component, Component, Part
from fret_monitor.analysis.diagrams import Diagrams, Node
from fret_monitor.analysis.letters import ROUNDED
from fret_monitor.analysis.replay import row_of
from fret_monitor.elaboration.restrict import judged_formula
from fret_monitor.logic.specification import Gate, Property, Specification
from fret_monitor.model.policies import InputRole, InputSource, Policy
from fret_monitor.smt.boolean import TooLarge
from fret_monitor.smt.terms import Term
from fret_monitor.smt.transition import NotModelled
from fret_monitor.traces.deadline import Deadline, OutOfTime
from fret_monitor.traces.gated import Repair
from fret_monitor.traces.trace import Value

_MOST_ROWS = 50  # of an example


def repairs(specification: Specification, gate: Gate, seconds: float) -> dict[str, Repair]:
    """
    Return what the solver decides in time about the requirements of a gate, by id.

    Those that relate numbers of different steps, or have bounds of time, are left out.
    """
    deadline = Deadline(seconds)
    kept = [_judged(item) for item in specification.properties if item.id in gate.keep]
    judged = {item.name for item in specification.signals
              if item.topic == gate.settings.judged_topic}
    timed = {item.name for item in specification.signals
             if item.source is not InputSource.FIELD}
    kept = [item for item in kept if judged & set(item.inputs)]
    found: dict[str, Repair] = {}
    for item in kept:
        if not timed & set(item.inputs):
            answer = _decided(specification, judged, item, len(kept) == 1, deadline)
            found |= {item.id: answer} if answer else {}
    return found


def _judged(item: Property) -> Property:
    return replace(item, formula=judged_formula(item), is_assumption=False, sentence=None)


def _decided(specification: Specification, judged: set[str], item: Property, is_alone: bool,
             deadline: Deadline) -> Repair | None:
    """Return an answer about a requirement; None if there is none."""
    signals = tuple(
        replace(signal, role=InputRole.OUTPUT if signal.name in judged else InputRole.INPUT)
        for signal in specification.signals)
    try:
        component = build_component(replace(specification, signals=signals), Part((item,)), None,
                                    deadline)
        if set(component.doubts) - {ROUNDED}:
            return None
        question = _Question(component)
        has_past = bool(component.games.diagrams.bits)
        if has_past and specification.policy is Policy.TIMED:
            return None  # its steps are nanoseconds
        found = question.at_first()
        if found.example is None and has_past:
            if not is_alone or not question.is_plain:
                return None
            found = question.later()
        if not component.doubts:
            return found
        # With rounding, the solver may not see all values of the other inputs.
        return None if found.example is None else replace(found, is_first=False)
    except (TooLarge, NotModelled, OutOfTime):
        return None


@dataclass
class _Question:
    """One requirement and its system."""

    component: Component

    def __post_init__(self) -> None:
        """Find where the requirement is unrepairable."""
        self._d: Diagrams = self.component.games.diagrams
        d = self._d
        self._good = d.possible & d.outputs[0]
        self._bad = d.enabled & ~d.bdd.exist(d.own, self._good)

    @property
    def is_plain(self) -> bool:
        """Whether no comparison relates the message to the other inputs."""
        return all(item.classes is None for item in
                   (choice.block for choice in self._d.choices))

    def at_first(self) -> Repair:
        """Return what holds of the first step."""
        d = self._d
        start = {item.now.value: item.start for item in d.system.bits}
        bad, enabled = d.at(self._bad, start), d.at(d.enabled, start)
        if bad == d.bdd.false:
            return Repair()
        chosen = d.picked(bad, d.environment, {})
        return Repair(tuple(self._shown([chosen])), is_first=bad == enabled)

    def later(self) -> Repair:
        """Return what holds of the steps after messages that passed, and of other topics."""
        d = self._d
        names = [*d.environment, *d.own]
        was = {name: f'was.{name}' for name in names}
        d.bdd.declare(*was.values())
        after = {**d.after, **{old: d.bdd.var(name) for name, old in was.items()}}
        same = {group: d.all_of(d.bdd.apply('<=>', d.bdd.var(name), d.bdd.var(was[name]))
                                for name in group_names)
                for group, group_names in (('others', d.environment), ('own', d.own))}
        steps = d.possible & (same['others'] & self._good | same['own'])
        goal = d.bdd.exist(d.environment, self._bad & same['others'])
        layers = [goal]
        while True:
            d.deadline.check()
            before = d.at(layers[-1], after)
            first = d.at(self._good & before, {item.now.value: item.start
                                               for item in d.system.bits})
            if first != d.bdd.false:
                return Repair(tuple(self._shown(self._run(first, layers, steps, after, was))))
            more = layers[-1] | d.bdd.exist(names, steps & before)
            if more == layers[-1]:
                return Repair()
            layers.append(more)

    def _run(self, first: Node, layers: Sequence[Node], steps: Node, after: Mapping[str, Node],
             was: Mapping[str, str]) -> list[dict[str, bool]]:
        """Return the choices of a run to the first of some sets."""
        d = self._d
        names = [*d.environment, *d.own]
        state = {item.now.value: item.start for item in d.system.bits}
        choices = [d.picked(first, names, {})]
        while len(choices) < _MOST_ROWS:
            chosen = choices[-1]
            state = {**{name: d.at(after[name], {**state, **chosen}) == d.bdd.true
                        for name in d.bits}, **{was[name]: chosen[name] for name in names}}
            place = next(number for number, layer in enumerate(layers)
                         if d.at(layer, state) == d.bdd.true)
            if place == 0:
                break
            node = d.at(steps & d.at(layers[place - 1], after), state)
            choices.append(d.picked(node, names, chosen))
        return choices

    def _shown(self, choices: Sequence[Mapping[str, bool]]) -> Iterator[tuple[str, Value]]:
        """Yield the inputs of a run, again where they change."""
        before: dict[str, Value] = {}
        for choice in choices:
            values = self._values(choice)
            row = row_of(values, self.component.signals, self.component.inputs)
            for signal, term, value in zip(self.component.signals, self.component.inputs, row):
                if term in values and before.get(signal.name) != value:
                    before[signal.name] = value
                    yield signal.name, value

    def _values(self, choice: Mapping[str, bool]) -> dict[Term, Any]:
        """Return values of the inputs that a choice is about."""
        found: dict[Term, Any] = {}
        for item in self._d.choices:
            block = item.block
            truths = tuple(choice[name] for name in (*item.environment, *item.others)
                           if name in choice)
            if block.is_free:
                found |= zip((*block.environment, *block.others), truths)
            elif block.classes is not None:
                number = sum(choice[name] << place for place, name in enumerate(item.classes))
                found |= block.classes[number].witness
            elif truths:
                found |= next(letter.witness for letter in block.letters
                              if letter.truths[:len(truths)] == truths)
        return found
