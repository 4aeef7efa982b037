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
"""What the names of a formula stand for: inputs, constants, definitions, and names of values."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import Enum
from fractions import Fraction
from functools import cached_property

from fret_monitor.elaboration.functions import FUNCTIONS
from fret_monitor.elaboration.terms import Term, Vocabulary
from fret_monitor.logic.formula import Constant, FTP, Variable
from fret_monitor.logic.numbers import Literal
from fret_monitor.model.diagnostics import did_you_mean, Source, Span
from fret_monitor.model.names import fret_name
from fret_monitor.model.values import ValueType

_NOWHERE = Span(Source('<scope>', ''), 0, 0)


class Role(Enum):
    """What a name was declared as, in the user's words."""

    INPUT = 'an input'
    CONSTANT = 'a constant'
    DEFINITION = 'a definition'
    EQUATION = 'an equation of this node'
    PREDEFINED = 'predefined'


@dataclass(frozen=True, eq=False)
class Declaration:
    """A declared name: its role, and what it means (its span is where it is declared)."""

    role: Role
    term: Term


_PREDEFINED = {'FTP': Declaration(Role.PREDEFINED, Term(FTP, _NOWHERE))}


@dataclass(frozen=True, eq=False)
class Scope:
    """The names that a formula may use; `FTP` is always there."""

    names: Mapping[str, Declaration] = field(default_factory=dict)

    def find(self, name: str) -> Declaration | None:
        """Return what declares `name` (FRET writes `a_DOT_b` for `a.b`), None if nothing does."""
        found = self.names.get(name) or self._by_spelling.get(fret_name(name))
        return found or _PREDEFINED.get(name)

    @cached_property
    def _by_spelling(self) -> dict[str, Declaration]:
        return {fret_name(name): item for name, item in self.names.items()}

    @property
    def constants(self) -> list[str]:
        """The names of all constants."""
        return [name for name, item in self.names.items() if item.role is Role.CONSTANT]

    @cached_property
    def owners(self) -> dict[str, list[str]]:
        """For each name of a value, the inputs that have it."""
        found: dict[str, list[str]] = {}
        for name, item in self.names.items():
            if item.role is Role.INPUT and item.term.vocabulary is not None:
                for value, _ in item.term.vocabulary.values:
                    found.setdefault(value, []).append(name)
        return found

    @cached_property
    def vocabularies(self) -> dict[str, Vocabulary]:
        """The names of values, for each name that has some."""
        return {name: item.term.vocabulary for name, item in self.names.items()
                if item.term.vocabulary is not None}

    def help_for(self, name: str) -> str:
        """Return what to do about a name that nothing declares."""
        if name in self.owners:
            owner = self.owners[name][0]
            return f"it is a value of '{owner}': compare the two, as in {owner} = {name}"
        if name in FUNCTIONS:
            return f'it is a function: write {name}({FUNCTIONS[name].forms[0]})'
        return did_you_mean(name, dict.fromkeys(self.known())) or (
            'declare it under inputs, constants or definitions')

    def known(self) -> Iterator[str]:
        """Yield all names that could have been meant."""
        yield from self.names
        yield from self.owners
        yield 'FTP'


def scope_of(variables: Iterable[Variable] = (),
             constants: Mapping[str, bool | int | Fraction] | None = None,
             values: Mapping[str, tuple[tuple[str, int | str], ...]] | None = None) -> Scope:
    """
    Make a scope by hand, for tests and tools.

    A constant is a bool, an int (a whole number) or a Fraction (a real one); `values` are the
    names of values for each variable that has some.
    """
    names = {}
    for variable in variables:
        pairs = (values or {}).get(variable.name)
        vocabulary = Vocabulary(pairs) if pairs else None
        names[variable.name] = Declaration(Role.INPUT, Term(variable, _NOWHERE, vocabulary))
    for name, value in (constants or {}).items():
        names[name] = Declaration(Role.CONSTANT, Term(_meaning(value), _NOWHERE))
    return Scope(names)


def _meaning(value: bool | int | Fraction) -> Constant | Literal:
    if isinstance(value, bool):
        return Constant(value, ValueType.BOOL)
    return Literal(Fraction(value), isinstance(value, Fraction))
