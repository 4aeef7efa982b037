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
Gates of a bundle with instance variables, and what cannot be one.

A gate that mentions a variable is one for each of its keys, which must be listed. The keys are
written in place of the variables (`restrict.gates_with_keys`), so what would not have the verdicts
of an instance then is refused.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from itertools import combinations
from math import prod

from fret_monitor.bundle.bundle import ActionEntry, Bundle, GateEntry
from fret_monitor.bundle.gates import names_with_keys
from fret_monitor.bundle.instances import (
    check_topic_mentions, is_unknown, mentioned, report_unknown,
)
from fret_monitor.logic.scopes import variables_of
from fret_monitor.logic.specification import Property, Signal
from fret_monitor.model.diagnostics import Problems, Span
from fret_monitor.model.manifest import events_of
from fret_monitor.model.names import shown
from fret_monitor.model.paths import LookUp
from fret_monitor.model.policies import ActionKind, InputSource, Policy


def check_gates(bundle: Bundle, properties: Iterable[Property], inputs: Mapping[str, Signal],
                problems: Problems) -> None:
    """Report gates of which the requirements, or the topics, have no listed keys."""
    items = {item.id: item for item in properties}
    for entry in bundle.gates:
        _Check(bundle, entry, [(items[name.value], name.span) for name in entry.keep
                               if name.value in items], inputs, problems).all()
    for one, other in combinations(bundle.gates, 2):
        for name in {*names_with_keys(one, bundle)} & {*names_with_keys(other, bundle)}:
            if one.name.value != other.name.value:
                problems.error(f'with keys in their names, two gates are {shown(name)}',
                               other.name.span, f'{shown(one.name.value)} and '
                               f'{shown(other.name.value)}', 'rename one')


@dataclass(frozen=True)
class _Check:
    """The checks of a gate; `kept` are its requirements, each with its place under `keep`."""

    bundle: Bundle
    entry: GateEntry
    kept: list[tuple[Property, Span]]
    inputs: Mapping[str, Signal]
    problems: Problems

    def all(self) -> None:
        """Report all that cannot be."""
        self._check_sides()
        if self._are_of_one_variable() and self._are_listed():
            self._check_inputs()
            self._check_locks()

    def _are_of_one_variable(self) -> bool:
        """Report requirements of pairs."""
        for item, place in self.kept:
            if len(variables_of(item.inputs, self.inputs)) > 1:
                self.problems.error(
                    f'the gate {shown(self.entry.name.value)} keeps no requirement of pairs yet',
                    place, 'it reads inputs of two instance variables',
                    'leave it to the monitor, and lock on it')
                return False
        return True

    @property
    def _keys(self) -> dict[str, int]:
        """The number of listed keys of each variable; 0: they are found."""
        return {item.name.value: len(item.keys) for item in self.bundle.instance_variables}

    @property
    def _own(self) -> list[str]:
        """The variables that its topic mentions."""
        return [name for name, _ in mentioned(self.entry.source) if name in self._keys]

    def _check_sides(self) -> None:
        """Check the variables in the names of its topics."""
        variables = {item.name.value: item for item in self.bundle.instance_variables}
        for text in (self.entry.source, self.entry.target):
            check_topic_mentions(text, variables, self.problems)
            for name, place in mentioned(text):
                if is_unknown(name, variables):
                    report_unknown(name, place, variables, self.problems)
        source, target = self.entry.source, self.entry.target
        aims = {name for name, _ in mentioned(target) if name in variables}
        if source and target and aims != {*self._own}:
            one = min({*self._own} ^ aims)
            word = 'service' if self.entry.is_service else 'from'
            self.problems.error(
                f'the gate {shown(self.entry.name.value)} is not one for each '
                f'{shown(one)} on both sides', target.span,
                f"'{{{one}}}' is in {word if one in self._own else 'to'} alone",
                f"write '{{{one}}}' in both names, or in none")

    def _are_listed(self) -> bool:
        """Report variables whose keys are found; a gate is there from the start."""
        for name, place in mentioned(self.entry.source):
            if self._keys.get(name) == 0:
                self._refuse_found(name, place)
                return False
        for item, place in self.kept:
            for name in item.inputs:
                for variable in self.inputs[name].variables:
                    if self._keys[variable] == 0:
                        self._refuse_found(variable, place)
                        return False
        return True

    def _refuse_found(self, variable: str, place: Span) -> None:
        self.problems.error(
            f'the gate {shown(self.entry.name.value)} needs the keys of {shown(variable)} in a '
            'list', place, 'a gate is there from the start, and closed until each of its inputs '
            'has a value', f'for_each: {{{variable}: [alpha, beta]}}')

    def _check_inputs(self) -> None:
        read = {name: place for item, place in self.kept for name in item.inputs}
        for name, place in read.items():
            if fault := self._fault(self.inputs[name], place):
                title, span, label, remedy = fault
                self.problems.error(f'the gate {shown(self.entry.name.value)} {title}', span,
                                    label, remedy)
                return

    def _fault(self, signal: Signal, place: Span) -> tuple[str, Span | None, str, str] | None:
        """Return why a gate cannot judge by an input; `place` is that of a requirement."""
        if signal.source is InputSource.INSTANCES:
            return ('keeps no requirement of values over instances', place,
                    f'it reads {signal.name}', 'leave it to the monitor, and lock on it')
        if signal.where is not None and signal.topic == self._judged:
            return (f'judges every message of {shown(self._judged)}', signal.place,
                    f"'where' leaves some of them out for {shown(signal.name)}",
                    "read the field without 'where', and compare it in the requirement")
        if any(isinstance(step, LookUp) and step.variable for step in signal.path):
            return ('takes no elements that are looked up by a key', signal.place,
                    'a message without the element would be one of its '
                    f'{shown(signal.variables[0])}', 'give each key a topic of its own')
        if self._is_stepped_by_others(signal):
            return ('keeps instances of several keys under another policy than every_message',
                    place, f'a message of one {shown(signal.variables[0])} would be a step of all',
                    'evaluation: {policy: relevant_message}')
        return None

    @property
    def _judged(self) -> str:
        """The topic of what it judges."""
        source = self.entry.source
        return '' if source is None else \
            events_of(source.value) if self.entry.is_service else source.value

    def _is_stepped_by_others(self, signal: Signal) -> bool:
        """Return whether, in the gate, messages of other keys are steps of its instances."""
        return self.bundle.policy is Policy.EVERY_MESSAGE and any(
            self._keys[name] > 1 for name in signal.variables if name not in self._own)

    def _check_locks(self) -> None:
        """Refuse a lock that the gates of several keys would publish."""
        if prod(self._keys[name] for name in self._own) < 2:
            return
        used = {name.value for item in self.bundle.requirements for name in item.on_violation
                if item.id.value in {kept.id for kept, _ in self.kept}}
        for action in self.bundle.actions:
            if action.kind is ActionKind.LOCK and action.name.value in used:
                self._refuse_lock(action)

    def _refuse_lock(self, action: ActionEntry) -> None:
        self.problems.error(
            f'the lock {shown(action.name.value)} has a publisher for each '
            f'{shown(self._own[0])}', action.name.span,
            f'{shown(self.entry.name.value)} is a gate for each of them, which judges by itself',
            'lock on a requirement that no gate keeps')
