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
Warnings about gates that may stay closed, stay open, or replace nothing, and endless actions.

A requirement that reads nothing of the gate's topic is an interlock: while it is violated nothing
passes, and no substitute helps.
"""

from collections.abc import Iterator

from fret_monitor.bundle.bundle import Bundle, GateEntry
from fret_monitor.elaboration.restrict import counted_formula
from fret_monitor.lint.not_a_number import acting, weaker_with_nan
from fret_monitor.logic.specification import Gate, Specification
from fret_monitor.model.diagnostics import Diagnostic, did_you_mean, Level
from fret_monitor.model.names import absolute
from fret_monitor.model.policies import ActionKind, Report


def doubtful_acting(bundle: Bundle, specification: Specification) -> Iterator[Diagnostic]:
    """Yield the warnings about gates, and about locks."""
    entries = {entry.name.value: entry for entry in bundle.gates}
    for gate in specification.gates:
        yield from _source_nobody_reads(entries[gate.name], gate, specification)
        yield from _of_inputs(gate, specification)
        content = entries[gate.name].content
        if not gate.settings.is_service and content is not None and not content.entries:
            yield Diagnostic(
                f"the substitute of the gate '{gate.name}' names no field", gate.otherwise_place,
                'each field has the default of its definition', 'write the fields that matter',
                Level.WARNING)
    yield from interlocks(bundle, specification)
    yield from _locks_that_are_read(bundle, specification)
    yield from _locks_that_stay_free(specification)
    yield from weaker_with_nan(specification)
    yield from _endless(bundle, specification)


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
    kept = set(gate.keep)
    read = {name for item in specification.properties if item.id in kept for name in item.inputs}
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


def _locks_that_are_read(bundle: Bundle, specification: Specification) -> Iterator[Diagnostic]:
    locks = {entry.name.value: entry.target for entry in bundle.actions
             if entry.kind is ActionKind.LOCK and entry.target is not None}
    topics = {signal.name: absolute(signal.topic) for signal in specification.signals
              if signal.topic}
    read = {item.id: {topics.get(name) for name in item.inputs}
            for item in specification.properties}
    for item in bundle.requirements:
        for name in item.on_violation:
            target = locks.get(name.value)
            if target is not None and absolute(target.value) in read.get(item.id.value, ()):
                yield Diagnostic(
                    f"{item.id.value} reads the lock '{name.value}' that it closes", target.span,
                    'a lock that is closed once may stay closed', 'choose another topic',
                    Level.WARNING)
                del locks[name.value]


def _locks_that_stay_free(specification: Specification) -> Iterator[Diagnostic]:
    """Yield a warning for each input without a timeout that a lock of the monitor depends on."""
    kept = {id_ for gate in specification.gates for id_ in gate.keep}
    locks = {action.name for action in specification.actions if action.kind is ActionKind.LOCK}
    readers: dict[str, str] = {}
    for item in acting(specification):
        if item.id not in kept:
            lock = next(name for name in item.on_violation if name in locks)
            for name in item.inputs:
                readers.setdefault(name, lock)
    for signal in specification.signals:
        if signal.name in readers and signal.topic is not None and signal.timeout is None:
            yield Diagnostic(
                f"the lock '{readers[signal.name]}' stays free if '{signal.name}' falls silent",
                signal.place, 'an input without a timeout is never silent', 'timeout: 0.5',
                Level.WARNING)


def _endless(bundle: Bundle, specification: Specification) -> Iterator[Diagnostic]:
    """Yield a warning for each message that is published until `~/reset`."""
    endless = {entry.name.value for entry in bundle.actions if entry.kind is ActionKind.PUBLISH
               and entry.rate is not None and entry.duration is None}
    kept = {id_ for gate in specification.gates for id_ in gate.keep}
    always = {item.id for item in specification.properties
              if item.id not in kept and item.report is not Report.OCCURRENCE
              and counted_formula(item) is not item.formula}
    for item in bundle.requirements:
        for name in item.on_violation:
            if name.value in endless and item.id.value in always:
                yield Diagnostic(
                    f"'{name.value}' is published until ~/reset", name.span,
                    f'{item.id.value} stays false once it was violated',
                    'report: occurrence   # of the requirement: it ends with the violation\n'
                    'for: 2               # of the action: it ends after 2 s', Level.WARNING)
                endless.discard(name.value)


def interlocks(bundle: Bundle, specification: Specification) -> Iterator[Diagnostic]:
    """Yield a warning for each kept requirement that reads nothing of the gate's topic."""
    places = {entry.name.value: {name.value: name for name in entry.keep}
              for entry in bundle.gates}
    read = {item.id: set(item.inputs) for item in specification.properties}
    for gate in specification.gates:
        judged = {signal.name for signal in specification.signals
                  if signal.topic == gate.settings.judged_topic}
        if gate.settings.is_service:
            if judged and all(judged.isdisjoint(read[id_]) for id_ in gate.keep):
                yield Diagnostic(
                    f"the gate '{gate.name}' keeps nothing that reads the request",
                    places[gate.name][gate.keep[0]].span,
                    'at any time all requests pass, or none does',
                    f"read {' or '.join(sorted(judged))} in one of its requirements",
                    Level.WARNING)
            continue
        for id_ in gate.keep:
            if judged.isdisjoint(read[id_]):
                yield Diagnostic(
                    f"{id_} reads nothing of '{gate.settings.source}'",
                    places[gate.name][id_].span,
                    'while it is violated nothing passes, and no substitute satisfies it',
                    'leave it to the monitor, unless it is to close the gate', Level.WARNING)
