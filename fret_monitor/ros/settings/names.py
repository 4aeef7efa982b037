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

"""Names of topics and services after remapping: full names, and what may not share one."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import islice
from typing import Any

from fret_monitor.model.manifest import Manifest, ManifestAction, ManifestGate, ManifestTopic
from fret_monitor.model.report_table import used_topics
from fret_monitor.model.used_names import (
    types_of, types_of_node, Use, uses_of, uses_of_node, what_is_done,
)
from fret_monitor.native import words
from fret_monitor.ros.settings.parameters import Refusal
from fret_monitor.runtime.reporting import ReportTable
from fret_monitor.runtime.shared_names import find_merged, find_shared, find_two_types

from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node

_STAND_IN = 'fm_key'  # in place of a variable while a name is resolved


def full_name(node: Node, manifest: Manifest, topic: ManifestTopic) -> str:
    """
    Return the name of a topic as a node resolves it; of one that is made, as it is.

    An instance variable stays in it, in braces. Raises `InvalidTopicNameException` if the name is
    not valid: from the namespace or a remapping.
    """
    if topic.made:
        return topic.name
    variable = manifest.key_of(topic)
    if variable is None:
        return str(node.resolve_topic_name(topic.name))
    shown = f'{{{variable.name}}}'
    parts = str(node.resolve_topic_name(topic.name.replace(shown, _STAND_IN))).split('/')
    return '/'.join(shown if part == _STAND_IN else part for part in parts)


def _full(node: Node, name: str, *, is_service: bool) -> str:
    resolve = node.resolve_service_name if is_service else node.resolve_topic_name
    return str(resolve(name))


def ends_of(node: Node, gate: ManifestGate) -> tuple[str, str]:
    """Return the full names of what a gate reads and of what it publishes, or calls."""
    return (_full(node, gate.source, is_service=gate.is_service),
            _full(node, gate.target, is_service=gate.is_service))


def refuse_merged_topics(
    node: Node, manifest: Manifest, table: ReportTable, library: Any,
) -> None:
    """
    Refuse two topics of a bundle that are one after remapping, or one that the node itself uses.

    `library` has the functions of csrc. Raises `Refusal` with the first problem.
    """
    names = [full_name(node, manifest, topic) for topic in manifest.topics]
    names += [node.resolve_topic_name(name)
              for name, _, _ in islice(used_topics(manifest), len(names), None)]
    if lines := find_merged(library, table, names):
        raise Refusal(lines[0].text)


def refuse_shared_names(node: Node, manifests: Sequence[Manifest], owners: Sequence[str],
                        library: Any) -> None:
    """
    Refuse gates in a circle, what else uses a name of a gate, a lock or the node, and two types.

    Compares names after remapping, of everything that the node runs; a gate on a service must be
    its only server, too, and no action may call `OWN_SERVICES` of this node. What the node
    itself publishes is compared by `refuse_merged_topics`. `owners` are the names of the bundles
    or gates, for the text; `library` has the functions of csrc. Raises `Refusal`.
    """
    used = [*uses_of_node(), *(item for manifest in manifests for item in uses_of(manifest))]
    typed = [*types_of_node(), *(item for number, manifest in enumerate(manifests)
                                 for item in types_of(manifest, number + 1))]
    lines = find_shared(library, [_resolved(node, item) for item in used]) or find_two_types(
        library, [item._replace(name=_full(node, item.name, is_service=item.is_service))
                  for item in typed], owners, 'gate' if manifests[0].gate else 'bundle')
    if lines:
        raise Refusal(*(line.text for line in lines))


def _resolved(node: Node, use: Use) -> Use:
    name, *ends = (_full(node, item, is_service=use.is_service)
                   for item in (use.name, *(use.ends or ())))
    return use._replace(name=name, ends=(ends[0], ends[1]) if ends else None)


def reached_by(node: Node, action: ManifestAction) -> str:
    """Return the full name of the topic or service of an action."""
    verb, name = what_is_done(action)
    return _full(node, name, is_service=verb == 'call')


@contextmanager
def valid_names() -> Iterator[None]:
    """Turn the error of a name that a namespace or a remapping makes too long into a `Refusal`."""
    try:
        yield
    except _rclpy.RCLError as error:
        reason = str(error).removeprefix('failed to resolve name: ')
        raise Refusal(f'{words.NO_ENDPOINT}: {reason}') from None


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
