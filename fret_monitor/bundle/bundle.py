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
The content of a bundle: frozen values, each text with its place.

`elaboration` checks names, formulas and types.
"""

from dataclasses import dataclass
from enum import Enum
from fractions import Fraction

from fret_monitor.bundle.yaml_tree import YamlMapping
from fret_monitor.model.diagnostics import Source, Span, Text
from fret_monitor.model.made import Made
from fret_monitor.model.names import handler_name
from fret_monitor.model.policies import (
    ActionKind, InputRole, Otherwise, Policy, Report, Severity, Stale, Stamp,
)
from fret_monitor.model.probability import USUAL_CONFIDENCE


DECLARING = ('signals', 'constants', 'inputs', 'topics', 'definitions', 'for_each')
"""The sections of a bundle whose entries are names for formulas."""


class Language(Enum):
    """The language of a requirement or definition; the value is its key in the bundle."""

    FRETISH = 'fretish'
    PTLTL = 'ptltl'
    COCOSPEC = 'cocospec'
    MLTL = 'mltl'


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
class InstanceVariable:
    """
    A name under `for_each`. Each of its keys has an instance of what mentions it.

    `keys` are those that are listed; without any, keys are found, and `most` is how many instances
    there are at once. `forget`: seconds after the last message of its key, an instance ends.
    """

    name: Text
    keys: tuple[Text, ...] = ()
    most: int = 0
    forget: Fraction | None = None


@dataclass(frozen=True, eq=False)
class InputEntry:
    """
    An input; `field` is the path as written, None if it was omitted.

    `damaged` are the keys with refused values, and 'name' if its name was refused; `places` are
    the places of the keys in which inputs on one topic must agree. `block` is the key under
    `topics` that it is written in, None for one under `inputs`. `made` is what the monitor makes
    messages of, as of a `transform`; `topic` and `type` are then those of these messages.
    `where` selects messages, and `variables` are the instance variables that topic, field and
    `where` mention, in the order of the bundle.
    """

    name: Text
    topic: Text | None = None
    type: Text | None = None
    field: Text | None = None
    initial: Text | None = None
    values: tuple[ValueEntry, ...] = ()
    qos: tuple[tuple[Text, Text], ...] = ()
    timeout: Fraction | None = None
    stale: Stale | None = None
    startup: Fraction | None = None
    max_rate: Fraction | None = None
    damaged: frozenset[str] = frozenset()
    places: tuple[tuple[str, Span], ...] = ()
    block: Text | None = None
    role: InputRole | None = None
    made: Made | None = None
    where: Text | None = None
    variables: tuple[str, ...] = ()
    scale: Fraction | None = None

    @property
    def owner(self) -> Text:
        """The name under which the keys of its topic are written: the topic's or its own."""
        return self.block or self.name


@dataclass(frozen=True, eq=False)
class Definition:
    """A named expression."""

    name: Text
    language: Language
    text: Text


@dataclass(frozen=True, eq=False)
class Requirement:
    """
    A requirement; `report` and `severity` include the defaults of the bundle.

    `report` is None for the default of the policy. `is_assumption`: it constrains the environment
    instead of the system, which only `analyze` distinguishes. `on_violation` and `on_end` are
    names of actions. `confidence` is that of a sentence with a probability; `has_confidence` where
    it is the requirement's own, not the bundle's. `source` is its id where it comes from, if that
    is another.
    """

    id: Text
    language: Language
    text: Text
    title: str
    rationale: str
    report: Report | None
    severity: Severity
    is_assumption: bool = False
    on_violation: tuple[Text, ...] = ()
    on_end: tuple[Text, ...] = ()
    confidence: Fraction = USUAL_CONFIDENCE
    has_confidence: bool = False
    source: str = ''

    @property
    def handler(self) -> str:
        """The name of its handler, see `handler_name`."""
        return handler_name(self.id.value)


@dataclass(frozen=True, eq=False)
class ActionEntry:
    """
    An action; None where its kind has no such key, or the value was refused. Times in seconds.

    `target` is the topic of a lock or of `publish`, the service of `call`, or the node of
    `transition`. `content` is the message or request as written. `duration` is written `for`, and
    `state` is written `to`.
    """

    name: Text
    kind: ActionKind
    target: Text | None
    type: Text | None = None
    content: YamlMapping | None = None
    rate: Fraction | None = None
    duration: Fraction | None = None
    timeout: Fraction | None = None
    retries: int = 0
    state: str = ''
    after: Fraction | None = None
    cooldown: Fraction | None = None


@dataclass(frozen=True, eq=False)
class GateEntry:
    """
    A gate; None where the value is missing, or was refused. Times in seconds.

    `source` is the topic under `from`, or the `service`; `target` is under `to`. `content` is the
    substitute or the response as written. `stale` and `otherwise_place` are places for messages.
    """

    name: Text
    is_service: bool
    source: Text | None
    target: Text | None
    type: Text | None
    keep: tuple[Text, ...]
    otherwise: Otherwise | None
    otherwise_place: Span
    content: YamlMapping | None = None
    hold: Fraction | None = None
    rate: Fraction | None = None
    is_open_when_stale: bool = False
    stale_place: Span | None = None
    latches: bool = False
    open_after: Fraction | None = None
    timeout: Fraction | None = None


@dataclass(frozen=True, eq=False)
class Bundle:
    """
    A whole bundle. `sources` are the files it was read from, the bundle itself first.

    `name` is the file's stem. `period` is in seconds, exact; None unless the policy is periodic.
    `unit` (seconds that a plain count stands for), `stamp` and `reorder` (nanoseconds) apply to
    the policy timed.
    `unreadable` are declared names that cannot be used (see `survey_bundle`); `inputs` contains
    such inputs, too, with the parts that could be read. `acting_names` are the names of all
    actions and gates, and `ids` those of all requirements, also of those that were refused.
    `cut` are the sections that may have entries that could not be read: which names these
    declare is not known.
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
    unreadable: frozenset[str] = frozenset()
    unit: Fraction | None = None
    stamp: Stamp = Stamp.RECEIVED
    reorder: int = 0
    actions: tuple[ActionEntry, ...] = ()
    gates: tuple[GateEntry, ...] = ()
    acting_names: frozenset[str] = frozenset()
    ids: tuple[str, ...] = ()
    cut: frozenset[str] = frozenset()
    policy_place: Span | None = None
    instance_variables: tuple[InstanceVariable, ...] = ()
