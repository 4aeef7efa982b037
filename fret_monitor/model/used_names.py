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
The names of topics and services that a node uses, as written, and their types.

Both nodes resolve them and compare the full names (`csrc/reporting/shared_names.h`); the table of
the node in C has them as they are.
"""

from collections.abc import Iterator
from typing import NamedTuple

from fret_monitor.model.manifest import Manifest, ManifestAction
from fret_monitor.model.names import (
    DETAILS_TOPIC, DIAGNOSTICS_TOPIC, OWN_SERVICE_TYPES, OWN_SERVICES, OWN_TOPICS,
)
from fret_monitor.model.policies import ActionKind


class Use(NamedTuple):
    """
    What publishes on a topic, offers a service, or calls one, as `struct fm_use`.

    `kind` is `gate`, `lock` or `action`, and `owner` its name; both are empty for the node itself.
    `is_alone`: it must be the only one; `ends` are the names of a gate.
    """

    kind: str
    owner: str
    bundle: str
    verb: str
    name: str
    is_alone: bool
    ends: tuple[str, str] | None = None

    @property
    def is_service(self) -> bool:
        """Whether it is a service."""
        return self.verb != 'publish on'


class TypedUse(NamedTuple):
    """A topic or service with its type; `owner` is the bundle's or gate's number from 1, or 0."""

    name: str
    interface: str
    owner: int
    is_service: bool
    is_input: bool


def uses_of_node() -> list[Use]:
    """
    Return the topics of every node itself, and the services that no action may call.

    An action may publish on `/diagnostics` too.
    """
    return [
        *(Use('', '', '', 'publish on', name, name != DIAGNOSTICS_TOPIC)
          for name in (DIAGNOSTICS_TOPIC, DETAILS_TOPIC, '~/alive')),
        *(Use('', '', '', 'call', name, False) for name in OWN_SERVICES)]


def uses_of(manifest: Manifest) -> Iterator[Use]:
    """Yield what the requirements, the gate, locks and actions of a bundle use."""
    for name in (*(item.topic for item in manifest.numbered), *manifest.margin_topics):
        yield Use('', '', '', 'publish on', name, True)
    if (gate := manifest.gate) is not None:
        yield Use('gate', gate.name, manifest.name,
                  *(('offer', gate.source) if gate.is_service else ('publish on', gate.target)),
                  True, (gate.source, gate.target))
    for action in manifest.actions:
        kind = 'lock' if action.kind is ActionKind.LOCK else 'action'
        yield Use(kind, action.name, manifest.name, *what_is_done(action), kind == 'lock')


def what_is_done(action: ManifestAction) -> tuple[str, str]:
    """Return what an action does with which topic or service."""
    match action.kind:
        case ActionKind.LOCK | ActionKind.PUBLISH:
            return 'publish on', action.target
        case ActionKind.CALL:
            return 'call', action.target
        case ActionKind.TRANSITION:
            return 'call', f'{action.target}/change_state'


def types_of_node() -> list[TypedUse]:
    """Return the topics and services of every node itself, with their types."""
    return [TypedUse(name, interface, 0, names is OWN_SERVICE_TYPES, False)
            for names in (OWN_TOPICS, OWN_SERVICE_TYPES) for name, interface in names.items()]


def types_of(manifest: Manifest, owner: int) -> Iterator[TypedUse]:
    """Yield topics and services with their types: those of inputs, the gate, locks, actions."""
    for topic in manifest.received:
        if manifest.key_of(topic) is None:  # the others are found by their type
            yield TypedUse(topic.name, topic.message_type, owner, False, True)
    if (gate := manifest.gate) is not None:
        for name in (gate.source, gate.target):
            yield TypedUse(name, gate.interface, owner, gate.is_service, False)
    for action in sorted(manifest.actions, key=lambda item: item.kind is not ActionKind.LOCK):
        if action.interface:
            is_service = action.kind is ActionKind.CALL
            yield TypedUse(action.target, action.interface, owner, is_service, False)
