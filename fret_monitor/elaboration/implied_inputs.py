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
Inputs that formulas imply: that a message came on a topic.

Under the policy timed a sum counts each message once, and a formula alone does not show when a
message comes. An input with the field `received()` does. If the bundle has none for a topic, one
is added.
"""

from collections.abc import Iterable
from dataclasses import replace
from functools import reduce

from fret_monitor.logic.formula import Binary, BinaryOperator, Formula, Variable, variables
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
        read = [self._signals[item.name] for item in variables(formula)]
        found = dict.fromkeys(self._received(signal) for signal in read)
        return reduce(lambda left, right: Binary(BinaryOperator.OR, left, right), found) \
            if found else None

    def _received(self, signal: Signal) -> Formula:
        """Return the input that is true when a message comes for another input."""
        for known in self._signals.values():
            if known.source is InputSource.RECEIVED and _feeds(known, signal):
                return Variable(known.name, ValueType.BOOL)
        added = replace(
            signal, name=self._free_name(f'{signal.name}_received'), type=ValueType.BOOL, path=(),
            values=(), initial=False, timeout=None, stale=Stale.WARN, startup=None, reduction='',
            source=InputSource.RECEIVED, role=InputRole.INPUT)
        self.declare(added)
        self.added.append(added)
        return Variable(added.name, ValueType.BOOL)

    def _free_name(self, name: str) -> str:
        while name in self._names:
            name += '_'
        self._names.add(name)
        return name


def _feeds(received: Signal, signal: Signal) -> bool:
    """Whether an input that says that a message came says so for another one."""
    if signal.topic is None:
        return received.name == f'{signal.name}_received'
    return (received.topic, received.variables, received.where) == (
        signal.topic, signal.variables, signal.where)
