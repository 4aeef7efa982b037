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

"""A gate while it runs, on a topic or a service."""

from collections.abc import Mapping
from typing import Any

from fret_monitor.model.manifest import Manifest, ManifestGate
from fret_monitor.native.errors import LibraryError
from fret_monitor.ros.acting.relay import Relay
from fret_monitor.ros.acting.service_gate import ServiceGate
from fret_monitor.ros.intake.feed import Topic
from fret_monitor.ros.intake.hot_path import Middleware
from fret_monitor.ros.settings.endpoint_types import one_type
from fret_monitor.ros.settings.parameters import Refusal
from fret_monitor.ros.settings.shared_names import ends_of
from fret_monitor.runtime import Engine, Evaluator, MessageGate
from fret_monitor.runtime.reporting import GateFacts, Lines, LogLine, ReportTable

from rclpy.node import Node


def gate_of(evaluator: Evaluator, settings: ManifestGate, table: ReportTable) -> MessageGate:
    """Return the gate of an evaluator; raises `Refusal` if its policy has no step a message."""
    try:
        return MessageGate(evaluator, settings)
    except LibraryError:
        lines = Lines(evaluator.library)
        evaluator.library.fm_add_gate_refusal(
            lines.pointer, table.pointer.gate, evaluator.policy.value.encode())
        raise Refusal(*(line.text for line in lines.take())) from None


def describe_gate(node: Node, manifest: Manifest, table: ReportTable,
                  library: Any) -> list[LogLine]:
    """Return the log line of a gate at the start."""
    assert manifest.gate is not None
    lines = Lines(library)
    library.fm_describe_gate(
        lines.pointer, table.pointer, *(name.encode() for name in ends_of(node, manifest.gate)))
    return lines.take()


class RunningGate:
    """A gate between `BundleSession.start` and `stop`."""

    def __init__(self, node: Node, engine: Engine, settings: ManifestGate,
                 middleware: Middleware, classes: Mapping[str, Any]) -> None:
        """Advertise the target and start to judge; raises `Unavailable` or `Refusal`."""
        self._node = node
        self._engine = engine
        source = settings.topic  # none: it comes after those of the manifest
        self._taken = len(engine.monitor.manifest.topics) if source is None else source
        self._relay: Relay | None = None
        self._service: ServiceGate | None = None
        if settings.is_service:
            self._service = ServiceGate(node, engine, settings)
        else:
            with one_type(node, 'publish on', settings.target, settings.interface):
                self._relay = Relay(
                    node, engine, settings, middleware, classes[settings.interface])

    @property
    def topic(self) -> Topic | None:
        """What the feed does with the messages of the source; None: no topic is read."""
        return None if self._relay is None else self._relay.topic

    def takes(self, topic: int) -> bool:
        """Return whether the gate itself takes the messages of a topic of the manifest."""
        return topic == self._taken

    @property
    def turns(self) -> int:
        """How often the relay's thread has looked for work."""
        return 0 if self._relay is None else self._relay.turns

    def close(self) -> None:
        """Stop judging, and withdraw the target."""
        for part in (self._relay, self._service):
            if part is not None:
                part.close()

    def review(self) -> None:
        """Refuse requests that have waited too long; called once a second."""
        if self._service is not None:
            self._service.review()

    def facts(self) -> GateFacts:
        """Return what is around the gate, for the log and diagnostics."""
        if self._service is not None:
            return GateFacts(
                self._service.others, self._service.source, self._service.unanswered)
        assert self._relay is not None
        return GateFacts(
            self._relay.others, self._relay.target, self._relay.unpublished)
