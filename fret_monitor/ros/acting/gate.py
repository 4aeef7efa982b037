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

from diagnostic_msgs.msg import DiagnosticStatus
from fret_monitor.model.manifest import Manifest, ManifestGate
from fret_monitor.model.policies import Otherwise
from fret_monitor.native.errors import LibraryError
from fret_monitor.ros.acting.reasons import latch_end, why_closed
from fret_monitor.ros.acting.relay import Relay
from fret_monitor.ros.acting.service_gate import ServiceGate
from fret_monitor.ros.intake.feed import Topic
from fret_monitor.ros.intake.hot_path import Middleware
from fret_monitor.ros.intake.throttle import Throttle
from fret_monitor.ros.settings.endpoint_types import one_type
from fret_monitor.ros.settings.parameters import Refusal
from fret_monitor.ros.settings.shared_names import ends_of
from fret_monitor.runtime import Conditions, Engine, Evaluator, MessageGate

from rclpy.node import Node

_LOGGED_S = 10.0  # between two log lines about one condition


def gate_of(evaluator: Evaluator, settings: ManifestGate) -> MessageGate:
    """Return the gate of an evaluator; raises `Refusal` if its policy has no step a message."""
    try:
        return MessageGate(evaluator, settings)
    except LibraryError:
        raise Refusal(
            f"the gate '{settings.name}' needs a step for each message: "
            f'it cannot run with the policy {evaluator.policy.value}') from None


def describe_gate(node: Node, manifest: Manifest) -> str:
    """Return the log line of a gate at the start."""
    gate = manifest.gate
    assert gate is not None
    source, target = ends_of(node, gate)
    ids = ', '.join(item.id for item in manifest.requirements)
    stale = '; OPEN WHILE AN INPUT IS STALE (stale: open)' if gate.is_open_when_stale else ''
    return (f"gate '{gate.name}': {source} -> {target}, keeps {ids}; "
            f'otherwise {_otherwise(gate)}{_latch(gate)}{stale}')


def _otherwise(gate: ManifestGate) -> str:
    match gate.otherwise:
        case Otherwise.DROP:
            return 'nothing is sent'
        case Otherwise.HOLD:
            return f'the last message that passed is sent again, for {gate.hold / 1e9:g} s'
        case Otherwise.SUBSTITUTE if gate.period:
            return f'the substitute is sent, at {1e9 / gate.period:g} Hz'
        case Otherwise.SUBSTITUTE:
            return 'the substitute is sent, once for each message'
        case Otherwise.RESPOND:
            return 'the request is refused'


def _latch(gate: ManifestGate) -> str:
    return f'; after a violation closed until {latch_end(gate)}' if gate.latches else ''


def gate_text(manifest: Manifest, conditions: Conditions) -> str:
    """Return the state of a gate: `open`, or `closed` with the reason."""
    why = why_closed(manifest, conditions)
    return f'closed: {why}' if why else 'open'


class RunningGate:
    """A gate between `BundleSession.start` and `stop`."""

    def __init__(self, node: Node, engine: Engine, settings: ManifestGate,
                 middleware: Middleware, classes: Mapping[str, Any]) -> None:
        """Advertise the target and start to judge; raises `Unavailable` or `Refusal`."""
        self._node = node
        self._engine = engine
        self._settings = settings
        self._relay: Relay | None = None
        self._service: ServiceGate | None = None
        if settings.is_service:
            self._service = ServiceGate(node, engine, settings)
        else:
            with one_type(node, 'publish on', settings.target, settings.interface):
                self._relay = Relay(
                    node, engine, settings, middleware, classes[settings.interface])
        self._throttles = {what: Throttle(_LOGGED_S) for what in (
            'others', 'unpublished', 'violating')}
        self._before = engine.gate_counts()
        self._unpublished = 0

    @property
    def topic(self) -> Topic | None:
        """What the feed does with the messages of the source; None: no topic is read."""
        return None if self._relay is None else self._relay.topic

    def takes(self, topic: int) -> bool:
        """Return whether the gate itself takes the messages of a topic of the manifest."""
        return topic == self._settings.topic

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
        """Log what is wrong; called once a second."""
        logger, name = self._node.get_logger(), self._settings.name
        counts = self._engine.gate_counts()
        if (others := self._others()) and self._throttles['others'].passes():
            logger.error(f"gate '{name}': {others}: what does not pass the gate is not judged")
        if self._service is not None:
            self._service.review()
        if self._failed() > self._unpublished and self._throttles['unpublished'].passes():
            self._unpublished = self._failed()
            logger.error(f"gate '{name}': {self._unpublished} messages could not be published")
        if counts.violating > self._before.violating and self._throttles['violating'].passes():
            logger.warning(f"gate '{name}': a requirement is violated after the substitute, too: "
                           'the substitute itself violates it, or nothing on this topic '
                           'satisfies it now')
        self._before = counts

    def _others(self) -> str:
        """Return who is where only the gate should be; an empty text for nobody."""
        if self._relay is not None and self._relay.others:
            return f'{", ".join(self._relay.others)} publishes on {self._relay.target} too'
        if self._service is not None and self._service.others:
            return f'{self._settings.source} has another server'
        return ''

    def _failed(self) -> int:
        return 0 if self._relay is None else self._relay.unpublished

    def status(self) -> tuple[bytes, str, dict[str, object]]:
        """Return level, message and values for diagnostics."""
        counts = self._engine.gate_counts()
        message = gate_text(self._engine.monitor.manifest, self._engine.conditions())
        level = DiagnosticStatus.OK if message == 'open' else DiagnosticStatus.WARN
        if others := self._others():
            level, message = DiagnosticStatus.ERROR, others
        found: dict[str, object] = {
            'passed': counts.passed, 'withheld': counts.withheld,
            'withheld, violating': counts.violates, 'withheld, closed': counts.closed,
            'withheld, latched': counts.latched, 'withheld, unreadable': counts.unreadable,
            'replaced': counts.replaced, 'replaced, violating': counts.violating}
        if self._service is None:
            return level, message, {**found, 'not published': self._failed()}
        return level, message, {**found, 'not answered': self._service.unanswered}
