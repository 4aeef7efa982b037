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
A specification in which keys are written in place of instance variables.

Of each input, definition and requirement that mentions a variable there is one for each key, so
that nothing below needs to know of instances. Aggregates become formulas over the instances: they
are as those of `for_each` wherever all instances are ready and step together.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import reduce
from itertools import product
from typing import TypeAlias, TypeVar

from fret_monitor.logic.formula import (
    Binary, BinaryOperator, Choice, Constant, Feedback, Formula, postorder, rebuilt, Variable,
    variables,
)
from fret_monitor.logic.scopes import variables_of
from fret_monitor.logic.specification import InstanceAggregate, Property, Signal, Specification
from fret_monitor.model.diagnostics import Problems, Span
from fret_monitor.model.names import handler_name, name_with_keys, PLACEHOLDER
from fret_monitor.model.paths import LookUp
from fret_monitor.model.policies import OverInstances
from fret_monitor.model.values import ValueType

Written: TypeAlias = tuple[tuple[str, str], ...]
"""Variables, each with the key that is written in its place."""

NameOf: TypeAlias = Callable[[str, Written], str]
_Item = TypeVar('_Item')

_JOINED = {
    OverInstances.COUNT: BinaryOperator.ADD, OverInstances.SUM: BinaryOperator.ADD,
    OverInstances.ANY: BinaryOperator.OR, OverInstances.ALL: BinaryOperator.AND,
    OverInstances.LEAST: BinaryOperator.MIN, OverInstances.GREATEST: BinaryOperator.MAX,
}


def with_keys(name: str, written: Written) -> str:
    """Return a name with its keys, such as `speed[robot=alpha]`."""
    return f'{name}[{",".join(f"{variable}={key}" for variable, key in written)}]'


def expanded(specification: Specification, keys: Mapping[str, Sequence[str]],
             name_of: NameOf = with_keys) -> Specification:
    """
    Return a specification without variables, with the given keys of each.

    `name_of` names the copies of an input or a definition. There is at least one key of each
    variable of which there is an aggregate.
    """
    expansion = Expansion(specification, keys, name_of)
    aggregated = {item.signal.name for item in specification.aggregates}
    return replace(
        specification, instance_variables=(), aggregates=(),
        signals=tuple(found for item in specification.signals if item.name not in aggregated
                      for found in expansion.signals(item)),
        definitions=tuple(found for item in specification.definitions
                          for found in expansion.definitions(*item)),
        properties=tuple(found for item in specification.properties
                         for found in expansion.properties(item)))


def in_c(name: str, written: Written) -> str:
    """Return a name with its keys for C, such as `speed_alpha`."""
    return name_with_keys(name, (key for _, key in written))


def check_names(found: Specification, problems: Problems) -> None:
    """Report copies of inputs or requirements that have one name in C."""
    _check_distinct(((item.name, item.name, item.place) for item in found.signals),
                    'inputs', problems)
    _check_distinct(((item.handler, item.id, item.id_place) for item in found.properties),
                    'requirements', problems)


def _check_distinct(items: Iterable[tuple[str, str, Span | None]], what: str,
                    problems: Problems) -> None:
    taken: dict[str, str] = {}
    for word, shown, place in items:
        if word in taken:
            problems.error(f'with keys in their names, two {what} are {word}', place,
                           f'{taken[word]} and {shown}', 'rename one, or a key')
        taken[word] = shown


class Expansion:
    """Writes keys into the parts of a specification; the arguments are as of `expanded`."""

    def __init__(self, specification: Specification, keys: Mapping[str, Sequence[str]],
                 name_of: NameOf = with_keys) -> None:
        """Expand what mentions variables."""
        self._specification = specification
        self._signals = {item.name: item for item in specification.signals}
        self._keys = keys
        self._name_of = name_of
        self._values: dict[str, Formula] = {}
        for item in specification.aggregates:
            self._values[item.signal.name] = self._value(item)

    def _all(self, mentioned: Iterable[str]) -> Iterator[Written]:
        """Yield all keys of variables, in the bundle's order."""
        found = {*mentioned}
        names = [item.name for item in self._specification.instance_variables
                 if item.name in found]
        for keys in product(*(self._keys[name] for name in names)):
            yield tuple(zip(names, keys))

    def signals(self, item: Signal) -> Iterator[Signal]:
        """Yield an input for each key, or itself."""
        for written in self._all(item.variables):
            yield _with_keys(item, written, self._name_of) if written else item

    def definitions(self, name: str, formula: Formula) -> Iterator[tuple[str, Formula]]:
        """Yield a definition for each key, or itself."""
        for written in self._all(self._mentioned(item.name for item in variables(formula))):
            yield (self._name_of(name, written) if written else name,
                   self.formula(formula, written))

    def properties(self, item: Property) -> Iterator[Property]:
        """Yield a requirement for each key, or itself."""
        for written in self._all(self._mentioned(item.inputs)):
            yield self.property(item, written)

    def property(self, item: Property, written: Written) -> Property:
        """Return a requirement of some keys, which may be none."""
        new = self._formulas([item.formula, *(equation for _, equation in item.feedback)], written)
        found = replace(item, formula=new[item.formula], feedback=tuple(
            (self._feedback(node, written), new[equation]) for node, equation in item.feedback))
        return found if not written else replace(
            found, id=with_keys(item.id, written),
            handler=handler_name('_'.join([item.id, *(key for _, key in written)])))

    def formula(self, root: Formula, written: Written) -> Formula:
        """Return a formula of some keys."""
        return self._formulas([root], written)[root]

    def _mentioned(self, names: Iterable[str]) -> frozenset[str]:
        return variables_of(names, self._signals)

    def _feedback(self, node: Feedback, written: Written) -> Feedback:
        return Feedback(with_keys(node.name, written), node.type) if written else node

    def _formulas(self, roots: Iterable[Formula], written: Written) -> dict[Formula, Formula]:
        """Return each node of some formulas with the keys written into its inputs."""
        new: dict[Formula, Formula] = {}
        for node in postorder(roots):
            match node:
                case Variable():
                    new[node] = self._input(node, dict(written))
                case Feedback():
                    new[node] = self._feedback(node, written)
                case _:
                    new[node] = rebuilt(node, new)
        return new

    def _input(self, node: Variable, keys: Mapping[str, str]) -> Formula:
        if node.name in self._values:
            return self._values[node.name]
        own = tuple((name, keys[name]) for name in self._signals[node.name].variables)
        return Variable(self._name_of(node.name, own), node.type) if own else node

    def _value(self, item: InstanceAggregate) -> Formula:
        """Return an aggregate as a formula over the instances."""
        found = [self.formula(item.operand, written)
                 for written in self._all(item.variables)]
        if item.function is OverInstances.COUNT:
            one, none = (Constant(number, ValueType.INT64) for number in (1, 0))
            found = [Choice(operand, one, none) for operand in found]
        return reduce(lambda left, right: _joined(item.function, left, right), found)


def _joined(function: OverInstances, left: Formula, right: Formula) -> Formula:
    found: Formula = Binary(_JOINED[function], left, right)
    is_extreme = function in (OverInstances.LEAST, OverInstances.GREATEST)
    # Those of two numbers ignore a NaN; of all instances it is NaN if one is.
    for number in (right, left) if is_extreme and found.type.is_float else ():
        found = Choice(Binary(BinaryOperator.NE, number, number), number, found)
    return found


def _with_keys(item: Signal, written: Written, name_of: NameOf) -> Signal:
    """Return an input of some keys: in its topic, its field and in `where`."""
    keys = dict(written)

    def key_of(step: _Item) -> _Item | LookUp:
        return replace(step, name=keys[step.variable], variable='') \
            if isinstance(step, LookUp) and step.variable else step

    where = None if item.where is None else key_of(item.where)
    return replace(
        item, name=name_of(item.name, written), variables=(), where=where,
        path=tuple(map(key_of, item.path)),
        topic=None if item.topic is None else PLACEHOLDER.sub(
            lambda found: keys.get(found[1], found[0]), item.topic))
