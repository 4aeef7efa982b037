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

"""Warnings about locks that stay locked, or free, and about actions that never end."""

from collections.abc import Iterator

from fret_monitor.bundle.bundle import Bundle
from fret_monitor.elaboration.restrict import judged_formula
from fret_monitor.logic.specification import Specification
from fret_monitor.model.diagnostics import Diagnostic, Level
from fret_monitor.model.names import absolute
from fret_monitor.model.policies import ActionKind, Report


def action_warnings(bundle: Bundle, specification: Specification) -> Iterator[Diagnostic]:
    """Yield the warnings about actions."""
    yield from _locks_that_are_read(bundle, specification)
    yield from _locks_that_stay_free(specification)
    yield from _endless(bundle, specification)


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
                    f"{item.id.value} reads the topic of its lock '{name.value}'", target.span,
                    'once it is locked, it may stay locked', 'choose another topic',
                    Level.WARNING)
                del locks[name.value]


def _locks_that_stay_free(specification: Specification) -> Iterator[Diagnostic]:
    """Yield a warning for each input without a timeout that a lock of the monitor depends on."""
    lock_of: dict[str, str] = {}
    for item in specification.properties:
        locks = [name for name in item.on_violation if name in specification.locks]
        if locks and item.id not in specification.gated:
            for name in item.inputs:
                lock_of.setdefault(name, locks[0])
    for signal in specification.signals:
        if signal.name in lock_of and signal.topic is not None and signal.timeout is None:
            yield Diagnostic(
                f"the lock '{lock_of[signal.name]}' stays free if '{signal.name}' falls silent",
                signal.place, 'an input without a timeout is never silent', 'timeout: 0.5',
                Level.WARNING)


def _endless(bundle: Bundle, specification: Specification) -> Iterator[Diagnostic]:
    """Yield a warning for each message that is published until `~/reset`."""
    endless = {entry.name.value for entry in bundle.actions if entry.kind is ActionKind.PUBLISH
               and entry.rate is not None and entry.duration is None}
    always = {item.id for item in specification.properties
              if item.id not in specification.gated and item.report is not Report.OCCURRENCE
              and judged_formula(item) is not item.formula}
    for item in bundle.requirements:
        for name in item.on_violation:
            if name.value in endless and item.id.value in always:
                yield Diagnostic(
                    f"'{name.value}' is published until ~/reset", name.span,
                    f'{item.id.value} stays false once it was violated',
                    'report: occurrence   # of the requirement: it ends with the violation\n'
                    'for: 2               # of the action: it ends after 2 s', Level.WARNING)
                endless.discard(name.value)
