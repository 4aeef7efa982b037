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

"""Names of topics and services that only one part of a node may use, after remapping."""

from collections.abc import Iterator, Sequence
from itertools import islice
from typing import Any

from fret_monitor.model.manifest import Manifest, ManifestAction, ManifestGate
from fret_monitor.model.names import DETAILS_TOPIC, DIAGNOSTICS_TOPIC, OWN_SERVICES
from fret_monitor.model.policies import ActionKind
from fret_monitor.model.report_table import used_topics
from fret_monitor.ros.settings.parameters import Refusal
from fret_monitor.ros.settings.topic_names import full_name
from fret_monitor.runtime.reporting import ReportTable
from fret_monitor.runtime.shared_names import find_merged, find_shared, Use

from rclpy.node import Node


def refuse_merged_topics(
    node: Node, manifest: Manifest, table: ReportTable, library: Any,
) -> None:
    """
    Refuse two topics of a bundle that are one after remapping, or one that the node itself uses.

    `library` has the functions of csrc.

    Raises
    ------
    Refusal
        with the first problem.
    """
    names = [full_name(node, manifest, topic) for topic in manifest.topics]
    names += [node.resolve_topic_name(name)
              for name, _, _ in islice(used_topics(manifest), len(names), None)]
    if lines := find_merged(library, table, names):
        raise Refusal(lines[0].text)


def refuse_shared_names(node: Node, manifests: Sequence[Manifest], library: Any) -> None:
    """
    Refuse gates in a circle, and what else publishes on a topic of a gate, a lock or the node.

    Compares names after remapping, of everything that the node runs; a gate on a service must be
    its only server, too, and no action may call `OWN_SERVICES` of this node. What the node
    itself publishes is compared by `refuse_merged_topics`. `library` has the functions of csrc.

    Raises
    ------
    Refusal
        with the first problem.
    """
    used = [*_own_names(node, manifests),
            *(item for manifest in manifests for item in _used_names(node, manifest))]
    if lines := find_shared(library, used):
        raise Refusal(lines[0].text)


def _own_names(node: Node, manifests: Sequence[Manifest]) -> Iterator[Use]:
    """
    Yield the topics of the node itself, and the services that no action may call.

    An action may publish on `/diagnostics` too.
    """
    handlers = [topic for manifest in manifests for topic in (
        *(item.topic for item in manifest.numbered), *manifest.margin_topics)]
    for topic in (DIAGNOSTICS_TOPIC, DETAILS_TOPIC, '~/alive', *dict.fromkeys(handlers)):
        yield Use('', '', '', 'publish on', node.resolve_topic_name(topic),
                  topic != DIAGNOSTICS_TOPIC)
    for name in OWN_SERVICES:
        yield Use('', '', '', 'call', node.resolve_service_name(name), False)


def _used_names(node: Node, manifest: Manifest) -> Iterator[Use]:
    if (gate := manifest.gate) is not None:
        source, target = ends_of(node, gate)
        yield Use('gate', gate.name, manifest.name,
                  *(('offer', source) if gate.is_service else ('publish on', target)), True,
                  (source, target))
    for action in manifest.actions:
        kind = 'lock' if action.kind is ActionKind.LOCK else 'action'
        yield Use(kind, action.name, manifest.name, *_done(node, action), kind == 'lock')


def _done(node: Node, action: ManifestAction) -> tuple[str, str]:
    """Return what an action does with which topic or service."""
    match action.kind:
        case ActionKind.LOCK | ActionKind.PUBLISH:
            return 'publish on', node.resolve_topic_name(action.target)
        case ActionKind.CALL:
            return 'call', node.resolve_service_name(action.target)
        case ActionKind.TRANSITION:
            return 'call', node.resolve_service_name(f'{action.target}/change_state')


def ends_of(node: Node, gate: ManifestGate) -> tuple[str, str]:
    """Return the full names of what a gate reads and of what it publishes, or calls."""
    resolve = node.resolve_service_name if gate.is_service else node.resolve_topic_name
    return resolve(gate.source), resolve(gate.target)
