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
A component of FRET or Ogma, independent of the file format: variables and requirements.

The parsers of files create an `ImportedComponent` and do not check its contents: formulas and
types are texts in the syntax of the other tool. A requirement can have several wordings: a
sentence and formulas.
"""

from dataclasses import dataclass
from enum import Enum

from fret_monitor.bundle.bundle import Language
from fret_monitor.model.diagnostics import Diagnostic, Span, Text


class VariableRole(Enum):
    """The role of a variable in its component."""

    INPUT = 'input'
    OUTPUT = 'output'
    INTERNAL = 'internal variable'
    MODE = 'mode'
    FUNCTION = 'function'


def bare(name: str) -> str:
    """Return a name without the quotes that FRET writes around a name with blanks."""
    is_quoted = len(name) > 2 and name[0] == name[-1] == '"'
    return name[1:-1] if is_quoted else name


@dataclass(frozen=True)
class Wording:
    """
    The text of a property or definition, in the first of `languages` that parses it.

    `label` is its place for messages, such as `fsm.json, FSM-001, ptLTL`; `place` has that of each
    character in a file, if it is written there as it is. `fault` is why it must not be read,
    though it could be: it would say something else.
    """

    languages: tuple[Language, ...]
    text: str
    label: str
    place: Text | None = None
    fault: Diagnostic | None = None


@dataclass(frozen=True)
class ComponentVariable:
    """
    A variable; `type` is '' if unknown; `assignments` are wordings of its definition.

    `values` are the names of its values, each with its number.
    """

    name: str
    role: VariableRole
    type: str = ''
    assignments: tuple[Wording, ...] = ()
    values: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class ComponentRequirement:
    """
    A requirement; `modes` are the names in it that FRET identified as modes.

    `is_assumption`: it constrains the environment. `source` is its id in the file, if the bundle
    has another.
    """

    id: str
    wordings: tuple[Wording, ...]
    title: str = ''
    rationale: str = ''
    modes: tuple[str, ...] = ()
    is_assumption: bool = False
    source: str = ''


@dataclass(frozen=True)
class Exclusion:
    """Two conditions that should not hold at once: formulas, and the warning where they do."""

    first: str
    second: str
    title: str
    effect: str
    place: Span


@dataclass(frozen=True)
class ImportedComponent:
    """
    A component; `project` is '' if the file does not name one.

    `files` are the names, without directories, of the files that describe it. `keys` are further
    keys of its bundle, with their values as YAML.
    """

    name: str
    project: str
    variables: tuple[ComponentVariable, ...]
    requirements: tuple[ComponentRequirement, ...]
    files: tuple[str, ...]
    keys: tuple[tuple[str, str], ...] = ()
    exclusions: tuple[Exclusion, ...] = ()

    @property
    def full_name(self) -> str:
        """The name with the project, because names are unique only within a project."""
        return f'{self.project}/{self.name}' if self.project else self.name
