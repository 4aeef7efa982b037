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

"""One type for each topic and service of a process: the middleware refuses a second one."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from fret_monitor.model.manifest import Manifest
from fret_monitor.model.names import OWN_SERVICE_TYPES, OWN_TOPICS
from fret_monitor.model.policies import ActionKind
from fret_monitor.ros.settings.parameters import Refusal
from fret_monitor.runtime.shared_names import find_two_types, TypedUse

from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node


def refuse_two_types(node: Node, manifests: Sequence[Manifest], names: Sequence[str],
                     library: Any) -> None:
    """
    Refuse two types for one topic or service, after remapping.

    `names` are those of the bundles or gates, for the text; `library` has the functions of csrc.

    Raises
    ------
    Refusal
        with all problems.
    """
    uses = [TypedUse(node.resolve_topic_name(name), interface, 0, False, False)
            for name, interface in OWN_TOPICS.items()]
    uses += [TypedUse(node.resolve_service_name(name), interface, 0, True, False)
             for name, interface in OWN_SERVICE_TYPES.items()]
    for number, manifest in enumerate(manifests):
        uses.extend(_uses(node, manifest, number + 1))
    kind = 'gate' if manifests[0].gate else 'bundle'
    if lines := find_two_types(library, uses, names, kind):
        raise Refusal(*(line.text for line in lines))


def _uses(node: Node, manifest: Manifest, owner: int) -> Iterator[TypedUse]:
    """Yield topics and services with their types: those of inputs, the gate, locks, actions."""
    def used(name: str, interface: str, *, is_service: bool) -> TypedUse:
        resolve = node.resolve_service_name if is_service else node.resolve_topic_name
        return TypedUse(resolve(name), interface, owner, is_service, False)

    for topic in manifest.received:
        if manifest.key_of(topic) is None:  # the others are found by their type
            yield used(topic.name, topic.message_type, is_service=False)._replace(is_input=True)
    if (gate := manifest.gate) is not None:
        for name in (gate.source, gate.target):
            yield used(name, gate.interface, is_service=gate.is_service)
    for action in sorted(manifest.actions, key=lambda item: item.kind is not ActionKind.LOCK):
        if action.interface:
            yield used(action.target, action.interface, is_service=action.kind is ActionKind.CALL)


@contextmanager
def one_type(node: Node, verb: str, name: str, interface: str, *,
             is_service: bool = False) -> Iterator[None]:
    """Turn an error of the middleware into a `Refusal` with the types of the topic or service."""
    try:
        yield
    except _rclpy.RCLError as error:
        what, full_name, known = (
            ('service', node.resolve_service_name(name), node.get_service_names_and_types())
            if is_service else
            ('topic', node.resolve_topic_name(name), node.get_topic_names_and_types()))
        types = [item for item in dict(known).get(full_name, ()) if item != interface]
        reason = (f'this process uses the {what} with the type {", ".join(types)}, and can use it '
                  'with one type only' if types else str(error))
        raise Refusal(f'cannot {verb} {full_name} as {interface}: {reason}') from None
