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
Warnings about topics with which the node refuses a bundle that is right elsewhere.

Where the node runs is not known here: in a namespace, two names can be two topics that are one
topic in the root namespace; and a bundle need not run on ROS.
"""

from collections.abc import Iterator

from fret_monitor.bundle.bundle import Bundle
from fret_monitor.logic.specification import Specification
from fret_monitor.model.diagnostics import Diagnostic, Level


def doubtful_topics(bundle: Bundle, specification: Specification) -> Iterator[Diagnostic]:
    """Yield a warning for each topic of two names, and each input that lacks one."""
    yield from _topics_of_two_names(bundle)
    yield from _missing_topics(bundle, specification)


def _topics_of_two_names(bundle: Bundle) -> Iterator[Diagnostic]:
    first: dict[str, str] = {}
    warned = set()
    for entry in bundle.inputs:
        if entry.topic is None or entry.topic.value.startswith('~'):
            continue
        name = entry.topic.value
        absolute = f'/{name.removeprefix("/")}'
        other = first.setdefault(absolute, name)
        if other != name and absolute not in warned:
            warned.add(absolute)
            yield Diagnostic(
                f"'{other}' and '{name}' are one topic in the root namespace",
                entry.topic.span, 'a monitor there refuses two names of one topic',
                f'topic: {other}', Level.WARNING)


def _missing_topics(bundle: Bundle, specification: Specification) -> Iterator[Diagnostic]:
    if all(None in (signal.topic, signal.message_type) for signal in specification.signals):
        return  # a bundle that is not for ROS
    read = {name for item in specification.properties for name in item.inputs}
    names = {entry.name.value: entry.name for entry in bundle.inputs}
    for signal in specification.signals:
        if signal.topic is None and signal.name in read & names.keys():
            yield Diagnostic(
                f"the input '{signal.name}' has no topic", names[signal.name].span,
                'a monitor on ROS 2 refuses this bundle',
                f'topic: {signal.name}, and the type of its messages', Level.WARNING)
