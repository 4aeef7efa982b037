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
A component of FRET or Ogma, whatever file it came from: variables and requirements.

The readers of files make a `Component` and check nothing in it: formulas and types are texts as
the other tool wrote them. A requirement can have several wordings: a sentence and formulas.
"""

from dataclasses import dataclass
from enum import Enum

from fret_monitor.bundle.bundle import Language


class VariableRole(Enum):
    """What a variable is in its component."""

    INPUT = 'input'  # inputs and outputs: a monitor reads both
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
    A property or definition as written, in one of `languages` (the first that reads it).

    `label` is its place, as messages show it: `fsm.json, FSM-001, ptLTL`.
    """

    languages: tuple[Language, ...]
    text: str
    label: str


@dataclass(frozen=True)
class ComponentVariable:
    """A variable; `type` is '' if the file has none; `assignments` are wordings of its value."""

    name: str
    role: VariableRole
    type: str = ''
    assignments: tuple[Wording, ...] = ()


@dataclass(frozen=True)
class ComponentRequirement:
    """A requirement; `modes` are the names that FRET found to be modes in it."""

    id: str
    wordings: tuple[Wording, ...]
    title: str = ''
    rationale: str = ''
    modes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Component:
    """
    A component; `project` is '' where the file does not say one.

    `files` are the names, without folders, of the files that describe it.
    """

    name: str
    project: str
    variables: tuple[ComponentVariable, ...]
    requirements: tuple[ComponentRequirement, ...]
    files: tuple[str, ...]

    @property
    def full_name(self) -> str:
        """The name with its project: two projects may have components of one name."""
        return f'{self.project}/{self.name}' if self.project else self.name
