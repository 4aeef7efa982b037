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
Aggregates over instances, such as `count(robot: speed > 0.5)`, or over pairs of two variables.

Each becomes an input of the bundle's scope, which stands for its value; formulas read it as any
other input. The operand is a formula over the inputs of one instance.
"""

from collections.abc import Iterable, Sequence
from typing import NoReturn, TypeAlias

from fret_monitor.bundle.instances import MOST_VARIABLES
from fret_monitor.elaboration.implied_inputs import ImpliedInputs
from fret_monitor.elaboration.terms import (
    convert, describe, expect_bool, expect_number, promoted, TypedTerm,
)
from fret_monitor.language.expression import Call, Name
from fret_monitor.logic.formula import Formula, Variable, variables
from fret_monitor.logic.numbers import ExactNumber
from fret_monitor.logic.specification import InstanceAggregate, Signal
from fret_monitor.model.diagnostics import did_you_mean, refuse, Span
from fret_monitor.model.policies import InputSource, OverInstances
from fret_monitor.model.values import ValueType

_FUNCTIONS = {item.value: item for item in OverInstances}
_TYPES = {OverInstances.COUNT: ValueType.INT64, OverInstances.ANY: ValueType.BOOL,
          OverInstances.ALL: ValueType.BOOL}
_LONGEST_NAME = 80
_Key: TypeAlias = tuple[OverInstances, tuple[str, ...], Formula]


class Aggregates:
    """The aggregates that the formulas of a bundle contain."""

    def __init__(self, names: Iterable[str], inputs: ImpliedInputs) -> None:
        """Start without any; `names` are the instance variables, `inputs` those of the bundle."""
        self._names = list(names)
        self._inputs = inputs
        self._found: dict[_Key, InstanceAggregate] = {}

    @property
    def all(self) -> tuple[InstanceAggregate, ...]:
        """All aggregates, in the order of their first use."""
        return tuple(self._found.values())

    def value(self, call: Call, term: TypedTerm) -> Formula:
        """Return the value of an aggregate; raises `CompileError` if it cannot have one."""
        function = _FUNCTIONS.get(call.function)
        if function is None:
            refuse(f"'{call.function}' is not a function over instances", call.function_span, '',
                   did_you_mean(call.function, _FUNCTIONS) or 'one of ' + ', '.join(_FUNCTIONS))
        for variable in call.variables:
            self._check_variable(variable, call.variables)
        operand = _operand(function, term)
        self._check(call, operand, term)
        written = {variable.text for variable in call.variables}
        key = function, tuple(name for name in self._names if name in written), operand
        if key not in self._found:
            self._found[key] = self._aggregate(call, key)
        signal = self._found[key].signal
        return Variable(signal.name, signal.type)

    def _check_variable(self, variable: Name, written: Sequence[Name]) -> None:
        if variable.text not in self._names:
            refuse(f"there is no instance variable '{variable.text}'", variable.span,
                   'not declared', did_you_mean(variable.text, self._names)
                   or f'declare it, as in\nfor_each: {{{variable.text}: {{most: 100}}}}')
        if [item.text for item in written].count(variable.text) > 1:
            refuse(f"'{variable.text}' twice", variable.span, '', 'write it once')
        if len(written) > MOST_VARIABLES:
            refuse(f'a value over the instances of {len(written)} variables', variable.span, '',
                   'over those of one, or over the pairs of two')

    def _check(self, call: Call, operand: Formula, term: TypedTerm) -> None:
        """Refuse an operand that is not one for each key of the variables alone."""
        names = [item.text for item in call.variables]
        written = f"'{call.function}({', '.join(names)}: ...)'"
        read = [item.name for item in variables(operand)]
        mentioned = {name: place for place in read
                     for name in self._inputs.signal(place).variables}
        for name in names:
            if name not in mentioned:
                refuse(f"{written} reads no input of '{name}'", term.span,
                       'it would be the same for each', f"an input of it mentions '{{{name}}}'")
        for name, place in mentioned.items():
            if name not in names:
                pair = ', '.join((*names, name))
                refuse(f"{written} reads an input of '{name}' too", term.span,
                       f"'{place}' has a value for each '{name}'",
                       f"aggregate inputs that mention '{{{names[0]}}}' alone" + (
                           f', or pairs: {call.function}({pair}: ...)'
                           if len(names) < MOST_VARIABLES else ''))

    def _aggregate(self, call: Call, key: '_Key') -> InstanceAggregate:
        function, names, operand = key
        name = self._name(call.span)
        signal = Signal(
            name, _TYPES.get(function, operand.type), None, None, (), (), None, (),
            source=InputSource.INSTANCES, place=call.span)
        self._inputs.declare(signal)
        return InstanceAggregate(signal, function, names, operand, place=call.span)

    def _name(self, span: Span) -> str:
        """Return an aggregate as it is written, on one line."""
        text = span.written
        name = text if len(text) <= _LONGEST_NAME else f'{text[:_LONGEST_NAME]}...'
        taken = {item.signal.name for item in self.all}
        return name if name not in taken else f'{name} [{len(taken)}]'


def _operand(function: OverInstances, term: TypedTerm) -> Formula:
    quoted = f"'{function.value}'"
    if function.takes_truth:
        return expect_bool(term, quoted)
    value = expect_number(term, quoted)
    if isinstance(value, ExactNumber):
        refuse(f'{quoted} takes a number that an input gives', term.span,
               f'this is {describe(term)}')
    number = promoted(value)
    is_sum = function is OverInstances.SUM and number.type.is_float
    return convert(number, ValueType.FLOAT64) if is_sum else number


def refuse_without_instances(call: Call) -> NoReturn:
    """Refuse an aggregate where there are no instances: outside a bundle."""
    refuse('there are no instances here', call.span, 'this needs a bundle',
           'for_each: {robot: {most: 100}}')
