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
The bundle as written: every scalar with its place, checked for shape, with no meaning yet.

`read_bundle` takes a file and returns a frozen `Bundle`, with its `signals` files merged in; all
problems of shape are told in one `CompileError`. What names and formulas mean, and whether types
fit, is for `logic`.
"""

from dataclasses import dataclass
from enum import Enum
from fractions import Fraction

from fret_monitor.diagnostics import Source, Text
from fret_monitor.manifest import Policy, Report, Severity


class Language(Enum):
    """The language of a requirement or definition; the value is its key in the bundle."""

    FRETISH = 'fretish'
    PTLTL = 'ptltl'
    COCOSPEC = 'cocospec'


@dataclass(frozen=True, eq=False)
class ConstantEntry:
    """`name: value` under `constants`; `value` is a number or true/false as written."""

    name: Text
    value: Text


@dataclass(frozen=True, eq=False)
class ValueEntry:
    """One `NAME: value` under an input's `values`; a quoted value is a string."""

    name: Text
    value: Text
    is_string: bool


@dataclass(frozen=True, eq=False)
class InputEntry:
    """An input; `field` is the path as written, None where it was left out."""

    name: Text
    topic: Text | None
    type: Text | None
    field: Text | None
    initial: Text | None
    values: tuple[ValueEntry, ...]
    qos: tuple[tuple[Text, Text], ...]
    timeout: Fraction | None
    stale: str | None


@dataclass(frozen=True, eq=False)
class Definition:
    """A named expression."""

    name: Text
    language: Language
    text: Text


@dataclass(frozen=True, eq=False)
class Requirement:
    """An id and a property in one of the languages; `report` and `severity` with defaults in."""

    id: Text
    language: Language
    text: Text
    title: str
    rationale: str
    report: Report
    severity: Severity

    @property
    def handler(self) -> str:
        """The handler's name: `handlerprop` and the id, with `_` for what C and ROS refuse."""
        letters = (c if c.isascii() and (c.isalnum() or c == '_') else '_' for c in self.id.value)
        return 'handlerprop' + ''.join(letters)


@dataclass(frozen=True, eq=False)
class Bundle:
    """
    A whole bundle. `sources` are the files it was read from, the bundle itself first.

    `name` is the file's stem. `period` is in seconds, exact, None but with the policy periodic.
    """

    name: str
    sources: tuple[Source, ...]
    component: Text | None
    title: str
    description: str
    constants: tuple[ConstantEntry, ...]
    inputs: tuple[InputEntry, ...]
    definitions: tuple[Definition, ...]
    policy: Policy
    period: Fraction | None
    requirements: tuple[Requirement, ...]
