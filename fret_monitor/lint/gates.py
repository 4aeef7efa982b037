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
Warnings about gates that may stay closed, stay open, or replace nothing.

A requirement that reads nothing of the gate's topic is an interlock: while it is violated nothing
passes, and no substitute helps.
"""

from collections.abc import Iterator

from fret_monitor.bundle.bundle import Bundle, GateEntry
from fret_monitor.logic.specification import Gate, Specification
from fret_monitor.model.diagnostics import Diagnostic, did_you_mean, Level
from fret_monitor.model.names import absolute


def gate_warnings(bundle: Bundle, specification: Specification) -> Iterator[Diagnostic]:
    """Yield the warnings about each gate."""
    entries = {entry.name.value: entry for entry in bundle.gates}
    for gate in specification.gates:
        yield from _source_nobody_reads(entries[gate.name], gate, specification)
        yield from _of_inputs(gate, specification)
        yield from _empty_substitute(entries[gate.name], gate)
        yield from _interlocks(gate, specification)


def _source_nobody_reads(entry: GateEntry, gate: Gate,
                         specification: Specification) -> Iterator[Diagnostic]:
    topics = sorted({signal.topic for signal in specification.signals if signal.topic})
    judged = gate.settings.judged_topic
    similar = did_you_mean(judged, topics)
    # A request may have no fields, such as that of a Trigger.
    if judged not in topics and entry.source is not None and (
            similar or not gate.settings.is_service):
        yield Diagnostic(
            f"no input has the topic '{judged}'", entry.source.span,
            'no field of what passes is judged', similar, Level.WARNING)


def _of_inputs(gate: Gate, specification: Specification) -> Iterator[Diagnostic]:
    read = {name for item in specification.properties if item.id in gate.keep
            for name in item.inputs}
    for signal in specification.signals:
        if signal.name not in read or signal.topic in (None, gate.settings.judged_topic):
            continue
        assert signal.topic is not None
        if absolute(signal.topic) == absolute(gate.settings.target) \
                and not gate.settings.is_service:
            yield Diagnostic(
                f"the gate '{gate.name}' reads its own output with '{signal.name}'",
                signal.place, 'it has no value before a first message passed',
                f'topic: {gate.settings.source}', Level.WARNING)
        elif signal.timeout is None:
            yield Diagnostic(
                f"the gate '{gate.name}' stays open if '{signal.name}' falls silent",
                signal.place, 'an input without a timeout is never silent', 'timeout: 0.5',
                Level.WARNING)


def _empty_substitute(entry: GateEntry, gate: Gate) -> Iterator[Diagnostic]:
    if not entry.is_service and entry.content is not None and not entry.content.entries:
        yield Diagnostic(
            f"the substitute of the gate '{gate.name}' names no field", gate.otherwise_place,
            'each field has the default of its definition', 'write the fields that matter',
            Level.WARNING)


def _interlocks(gate: Gate, specification: Specification) -> Iterator[Diagnostic]:
    judged = {signal.name for signal in specification.signals
              if signal.topic == gate.settings.judged_topic}
    readers = {item.id for item in specification.properties
               if not judged.isdisjoint(item.inputs)}
    if not gate.settings.is_service:
        for id_, place in zip(gate.keep, gate.keep_places, strict=True):
            if id_ not in readers:
                yield Diagnostic(
                    f"{id_} reads nothing of '{gate.settings.source}'", place,
                    'while it is violated nothing passes, and no substitute satisfies it',
                    'leave it to the monitor, unless it is to close the gate', Level.WARNING)
    elif judged and readers.isdisjoint(gate.keep):
        yield Diagnostic(
            f"the gate '{gate.name}' keeps nothing that reads the request", gate.keep_places[0],
            'at any time all requests pass, or none does',
            f"read {' or '.join(sorted(judged))} in one of its requirements", Level.WARNING)
