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
"""The declared names of a formula: inputs, constants, definitions, and names of values."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import Enum

from fret_monitor.elaboration.aggregates import Aggregates
from fret_monitor.elaboration.functions import FUNCTIONS
from fret_monitor.elaboration.implied_inputs import ImpliedInputs
from fret_monitor.elaboration.terms import TypedTerm, Vocabulary
from fret_monitor.logic.formula import FTP
from fret_monitor.model.diagnostics import did_you_mean, Source, Span
from fret_monitor.model.names import fret_name

_NOWHERE = Span(Source('<scope>', ''), 0, 0)


class Role(Enum):
    """The kind of a declaration; the value is its description in messages."""

    INPUT = 'an input'
    CONSTANT = 'a constant'
    DEFINITION = 'a definition'
    EQUATION = 'an equation of this node'
    PREDEFINED = 'predefined'


@dataclass(frozen=True, eq=False)
class Declaration:
    """A declared name: its role, and its term, whose span is the place of the declaration."""

    role: Role
    term: TypedTerm


_PREDEFINED = {'FTP': Declaration(Role.PREDEFINED, TypedTerm(FTP, _NOWHERE))}


class Scope:
    """
    The names that a formula may use; `FTP` is always declared.

    Declarations are added while a bundle is elaborated. A name is found in both spellings: FRET
    writes `a_DOT_b` in formulas for `a.b`. Names of an inner scope hide those of the outer one.
    """

    def __init__(self, outer: 'Scope | None' = None, is_cut: bool = False,
                 implied: ImpliedInputs | None = None,
                 aggregates: Aggregates | None = None) -> None:
        """
        Start without names, within another scope.

        `is_cut`: there may be declarations that could not be read, so that no name is reported
        as undeclared. `implied` are the inputs that formulas may add, `aggregates` those over
        instances; None without a bundle.
        """
        self._outer = outer
        self.implied: ImpliedInputs | None = outer.implied if outer else implied
        self.aggregates: Aggregates | None = outer.aggregates if outer else aggregates
        self.is_cut: bool = is_cut or outer is not None and outer.is_cut
        self._names: dict[str, Declaration] = {}
        self._spelled: dict[str, Declaration] = {}

    def declare(self, name: str, item: Declaration) -> None:
        """Declare a name; replaces an earlier declaration."""
        self._names[name] = self._spelled[fret_name(name)] = item

    def find(self, name: str) -> Declaration | None:
        """Return the declaration of a name in either spelling, or None."""
        found = self._names.get(name) or self._spelled.get(fret_name(name))
        if found is None and self._outer is not None:
            return self._outer.find(name)
        return found or _PREDEFINED.get(name)

    def vocabulary_of(self, name: str) -> Vocabulary | None:
        """Return the vocabulary of a declared name, or None."""
        found = self.find(name)
        return found.term.vocabulary if found else None

    @property
    def names(self) -> Mapping[str, Declaration]:
        """All declared names, in the spelling of their declaration."""
        return {**self._outer.names, **self._names} if self._outer else self._names

    @property
    def constants(self) -> list[str]:
        """The names of all constants."""
        return [name for name, item in self.names.items() if item.role is Role.CONSTANT]

    @property
    def owners(self) -> dict[str, list[str]]:
        """For each name of a value, the inputs with that value; those that print it come first."""
        inputs = {name: vocabulary for name, vocabulary in self.vocabularies.items()
                  if self.names[name].role is Role.INPUT}
        found: dict[str, list[str]] = {}
        for name, vocabulary in inputs.items():
            for value in dict(vocabulary.named):
                found.setdefault(value, []).append(name)
        for name, vocabulary in inputs.items():
            for value in vocabulary.numbers.keys() - dict(vocabulary.named):
                found.setdefault(value, []).append(name)
        return found

    @property
    def vocabularies(self) -> dict[str, Vocabulary]:
        """The vocabulary of each declared name that has one."""
        return {name: item.term.vocabulary for name, item in self.names.items()
                if item.term.vocabulary is not None}

    def help_for(self, name: str) -> str:
        """Return the help text for an undeclared name."""
        owners = self.owners.get(name)
        if owners:
            owner = owners[0]
            return f"it is a value of '{owner}': compare the two, as in {owner} = {name}"
        if name in FUNCTIONS:
            return f'it is a function: write {name}({FUNCTIONS[name].forms[0]})'
        return did_you_mean(name, dict.fromkeys(self.known())) or (
            'declare it under inputs, constants or definitions')

    def known(self) -> Iterator[str]:
        """Yield all names that can be suggested for a misspelled one."""
        yield from self.names
        yield from self.owners
        yield 'FTP'
