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

"""Requirements that only observe, beside those of a bundle."""

from dataclasses import replace

from fret_monitor.logic.formula import (
    Binary, BinaryOperator, Formula, Unary, UnaryOperator, Variable, variables,
)
from fret_monitor.logic.specification import Property, Signal, Specification
from fret_monitor.model.policies import InputSource
from fret_monitor.model.values import ValueType


def beside(formula: Formula, item: Property, specification: Specification) -> Property:
    """Return a requirement with a formula that starts and steps together with another one."""
    left_out = unknown_values(specification) | names_in(formula)
    for signal in specification.signals:
        if signal.name in item.inputs and signal.name not in left_out:
            formula = Binary(BinaryOperator.AND, formula, _tautology(signal))
    return replace(item, title='', text='', formula=formula, sentence=None, place=None)


def _tautology(signal: Signal) -> Formula:
    value = Variable(signal.name, signal.type)
    known = value if signal.type is ValueType.BOOL else Binary(BinaryOperator.EQ, value, value)
    return Binary(BinaryOperator.OR, known, Unary(UnaryOperator.NOT, known))


def unknown_values(specification: Specification) -> set[str]:
    """Return the values over instances, where there are no instances: nothing is known of them."""
    return set() if specification.aggregates else {
        item.name for item in specification.signals if item.source is InputSource.INSTANCES}


def names_in(formula: Formula) -> set[str]:
    """Return the names of the inputs of a formula."""
    return {item.name for item in variables(formula)}
