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

from fret_monitor.model.manifest import Manifest
from fret_monitor.model.names import OWN_TOPICS
from fret_monitor.model.policies import ActionKind
from fret_monitor.ros.settings.parameters import Refusal

from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node

_NODE = -1  # in place of the number of a bundle


def refuse_two_types(node: Node, manifests: Sequence[Manifest], names: Sequence[str]) -> None:
    """
    Refuse two types for one topic or service, after remapping.

    `names` are those of the bundles or gates, for the text. Of two inputs of one bundle, and of an
    input and the node itself, nothing is said: see `shared_names.refuse_merged_topics`.

    Raises
    ------
    Refusal
        with all problems.
    """
    first = {('topic', node.resolve_topic_name(name)): (interface, _NODE)
             for name, interface in OWN_TOPICS.items()}
    problems = []
    for number, manifest in enumerate(manifests):
        kind = 'bundle' if manifest.gate is None else 'gate'
        for what, name, interface, is_input in _uses(node, manifest):
            other, owner = first.setdefault((what, name), (interface, number))
            if other == interface or (is_input and owner in (number, _NODE)):
                continue
            is_one = owner in (number, _NODE)
            types = f'has the types {other} and {interface}' if is_one else (
                f"has the type {other} in the {kind} '{names[owner]}' and {interface} in "
                f"'{names[number]}'")
            remedy = 'write different names' if is_one else (
                f'start a {"monitor" if kind == "bundle" else "node"} for each {kind}')
            problems.append(f'the {what} {name} {types}: a process can use a {what} with one type '
                            f'only; correct the type, or {remedy}')
    if problems:
        raise Refusal(*problems)


def _uses(node: Node, manifest: Manifest) -> Iterator[tuple[str, str, str, bool]]:
    """Yield topics and services with their types, and whether inputs read them; inputs first."""
    def used(name: str, interface: str, *, is_service: bool) -> tuple[str, str, str, bool]:
        return (('service', node.resolve_service_name(name)) if is_service else
                ('topic', node.resolve_topic_name(name))) + (interface, False)

    for topic in manifest.received:
        yield 'topic', node.resolve_topic_name(topic.name), topic.message_type, True
    if (gate := manifest.gate) is not None:
        for name in (gate.source, gate.target):
            yield used(name, gate.interface, is_service=gate.is_service)
    for action in manifest.actions:
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
