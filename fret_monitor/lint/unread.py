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
Warnings about topics whose messages cause steps although no requirement reads them.

With the policy `every_message`, a message on any mapped topic is a step of every requirement. So
a topic whose inputs are not used still affects the meaning of bounds, which count steps.
"""

from collections.abc import Iterator

from fret_monitor.bundle.bundle import Bundle
from fret_monitor.logic.specification import Specification
from fret_monitor.model.diagnostics import Diagnostic, Level
from fret_monitor.model.policies import Policy


def unread_topics(bundle: Bundle, specification: Specification) -> Iterator[Diagnostic]:
    """Yield a warning for each topic that causes steps and feeds no requirement."""
    if specification.policy is not Policy.EVERY_MESSAGE:
        return
    read = specification.read
    topics: dict[str, list[str]] = {}
    for signal in specification.signals:
        if signal.topic is not None:
            topics.setdefault(signal.topic, []).append(signal.name)
    places = {entry.name.value: entry.name.span for entry in bundle.inputs}
    for topic, names in topics.items():
        if read.isdisjoint(names):
            inputs = ', '.join(f"'{name}'" for name in names)
            yield Diagnostic(
                f"messages on '{topic}' are steps, and no requirement reads {inputs}",
                places[names[0]], 'the policy is every_message',
                'leave it out, or write policy: relevant_message under evaluation', Level.WARNING)
