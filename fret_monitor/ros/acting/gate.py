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

"""The gate of a bundle, on a topic (`Relay`) or a service (`ServiceGate`)."""

from collections.abc import Mapping
from typing import Any

from fret_monitor.model.manifest import ManifestGate
from fret_monitor.native.errors import LibraryError
from fret_monitor.ros.acting.relay import Relay
from fret_monitor.ros.acting.service_gate import ServiceGate
from fret_monitor.ros.intake.hot_path import Middleware
from fret_monitor.ros.settings.names import one_type
from fret_monitor.ros.settings.parameters import Refusal
from fret_monitor.runtime import Engine, Evaluator, MessageGate
from fret_monitor.runtime.reporting import lines_of, ReportTable

from rclpy.node import Node

Gate = Relay | ServiceGate


def gate_of(evaluator: Evaluator, settings: ManifestGate, table: ReportTable) -> MessageGate:
    """Return the gate of an evaluator; raises `Refusal` if its policy has no step a message."""
    try:
        return MessageGate(evaluator, settings)
    except LibraryError:
        library = evaluator.library
        raise Refusal(*(line.text for line in lines_of(
            library, library.fm_add_gate_refusal, table.pointer.gate,
            evaluator.policy.value.encode()))) from None


def open_gate(node: Node, engine: Engine, settings: ManifestGate, middleware: Middleware,
              classes: Mapping[str, Any]) -> Gate:
    """Advertise the target and start to judge; raises `Unavailable` or `Refusal`."""
    if settings.is_service:
        return ServiceGate(node, engine, settings)
    with one_type(node, 'publish on', settings.target, settings.interface):
        return Relay(node, engine, settings, middleware, classes[settings.interface])
