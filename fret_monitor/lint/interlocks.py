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
Warnings about requirements that a gate keeps, and no message of its topic can satisfy.

Such a requirement is an interlock: while it is violated nothing passes, and no substitute helps.
"""

from collections.abc import Iterator

from fret_monitor.bundle.bundle import Bundle
from fret_monitor.logic.specification import Specification
from fret_monitor.model.diagnostics import Diagnostic, Level


def interlocks(bundle: Bundle, specification: Specification) -> Iterator[Diagnostic]:
    """Yield a warning for each kept requirement that reads nothing of the gate's topic."""
    places = {entry.name.value: {name.value: name for name in entry.keep}
              for entry in bundle.gates}
    read = {item.id: set(item.inputs) for item in specification.properties}
    for gate in specification.gates:
        judged = {signal.name for signal in specification.signals
                  if signal.topic == gate.settings.judged_topic}
        for id_ in gate.keep if not gate.settings.is_service else ():
            if judged.isdisjoint(read[id_]):
                yield Diagnostic(
                    f"{id_} reads nothing of '{gate.settings.source}'",
                    places[gate.name][id_].span,
                    'while it is violated nothing passes, and no substitute satisfies it',
                    'leave it to the monitor, unless it is to close the gate', Level.WARNING)
