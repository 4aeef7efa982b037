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
Inputs that formulas imply: that a message came on a topic, and when.

Under the policy timed a sum counts each message once, and a formula alone does not show when a
message comes. An input with the field `received()` does. If the bundle has none for a topic, one
is added. Under the policies that count messages a step has no time: an input that has the time
of reception is added.
"""

from collections.abc import Iterable
from dataclasses import replace
from functools import reduce

from fret_monitor.logic.formula import (
    Binary, BinaryOperator, Choice, Formula, Variable, variables,
)
from fret_monitor.logic.specification import Signal
from fret_monitor.model.policies import InputRole, InputSource, Stale
from fret_monitor.model.values import ValueType


class ImpliedInputs:
    """The inputs of a bundle, and those that its formulas add."""

    def __init__(self, names: Iterable[str]) -> None:
        """Start without inputs; `names` are all that the bundle declares."""
        self._names = set(names)
        self._signals: dict[str, Signal] = {}
        self.added: list[Signal] = []

    def declare(self, signal: Signal) -> None:
        """Add an input of the bundle."""
        self._signals[signal.name] = signal

    def signal(self, name: str) -> Signal:
        """Return an input by its name."""
        return self._signals[name]

    def messages(self, formula: Formula) -> Formula | None:
        """Return when a message comes on a topic that a formula reads; None if it reads none."""
        found = self._facts(formula, InputSource.RECEIVED, ValueType.BOOL)
        return reduce(lambda left, right: Binary(BinaryOperator.OR, left, right), found) \
            if found else None

    def time(self, formula: Formula) -> Formula | None:
        """Return when the last message came on a topic that a formula reads (INT64, ns)."""
        found = self._facts(formula, InputSource.TIME, ValueType.INT64)
        return reduce(_later, found) if found else None

    def _facts(self, formula: Formula, source: InputSource, kind: ValueType) -> list[Formula]:
        """Return what there is to know about the messages on the topics that a formula reads."""
        read = [signal for item in variables(formula)
                if (signal := self._signals[item.name]) not in self.added]
        return [*dict.fromkeys(self._fact(signal, source, kind) for signal in read)]

    def _fact(self, signal: Signal, source: InputSource, kind: ValueType) -> Formula:
        """Return the input that says something about the messages of another input."""
        for known in self._signals.values():
            if known.source is source and _feeds(known, signal):
                return Variable(known.name, kind)
        added = replace(
            signal, name=self._free_name(f'{signal.name}_{source.value}'), type=kind, path=(),
            values=(), initial=False if kind is ValueType.BOOL else 0, timeout=None,
            stale=Stale.WARN, startup=None, reduction='', source=source, window=0,
            role=InputRole.INPUT)
        self.declare(added)
        self.added.append(added)
        return Variable(added.name, kind)

    def _free_name(self, name: str) -> str:
        while name in self._names:
            name += '_'
        self._names.add(name)
        return name


def _feeds(fact: Signal, signal: Signal) -> bool:
    """Whether an input that says that a message came, or when, says so for another one."""
    if signal.topic is None:
        return fact.name == f'{signal.name}_{fact.source.value}'
    return (fact.topic, fact.variables, fact.where) == (
        signal.topic, signal.variables, signal.where)


def _later(left: Formula, right: Formula) -> Formula:
    return Choice(Binary(BinaryOperator.LT, left, right), right, left)
