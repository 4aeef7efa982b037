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
Which topics of a bundle a recorded topic feeds, and with which key.

Several topics of a bundle may have one name, with other messages selected. One with an instance
variable in its name is fed by each recorded topic of its type whose name fits.
"""

from array import array
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
import re

from fret_monitor.bag.recording import Batch
from fret_monitor.model.manifest import ManifestTopic, ManifestVariable

Target = tuple[int, bytes]
"""A topic of the bundle (index), and the key in the name of the recorded one; b'' without."""


def matches(name: str, topic: ManifestTopic, variable: ManifestVariable,
            types: Mapping[str, set[str]], recorded_as: Callable[[str], str]) -> dict[str, bytes]:
    """
    Return the recorded topics that fit a topic with a variable in its name, each with its key.

    `name` is its full name, `types` are those of what was recorded. Listed keys all fit, recorded
    or not, under the names that `recorded_as` returns.
    """
    before, _, after = name.partition(f'{{{variable.name}}}')
    if variable.keys:
        return {recorded_as(f'{before}{key}{after}'): key.encode() for key in variable.keys}
    pattern = re.compile(f'{re.escape(before)}([^/]+){re.escape(after)}')
    return {item: found[1].encode() for item, kinds in sorted(types.items())
            if topic.message_type in kinds and (found := pattern.fullmatch(item))}


class Routes:
    """Delivers messages of numbered recorded topics to the topics of a bundle."""

    def __init__(self, targets: Sequence[Sequence[Target]]) -> None:
        """Deliver to `targets`, by the number of the recorded topic; one may have none."""
        self._targets = targets
        self._are_single = all(len(found) == 1 for found in targets)
        self._topics = [topic for found in targets for topic, _ in found]
        self._keys = [key for found in targets for _, key in found]
        self._sizes = [len(key) for key in self._keys]
        self._has_keys = any(key for found in targets for _, key in found)
        self._is_plain = self._are_single and not self._has_keys \
            and self._topics == list(range(len(targets)))

    def deliver(self, batch: Batch) -> Batch:
        """Return the messages with the topics of the bundle, one for each that they feed."""
        if self._is_plain:
            return batch
        if not self._are_single:
            return self._repeated(batch)
        # No loop of Python over the messages.
        topics = array('I', map(self._topics.__getitem__, batch.topics))
        if not self._has_keys:
            return replace(batch, topics=topics)
        return replace(batch, topics=topics,
                       keys=b''.join(map(self._keys.__getitem__, batch.topics)),
                       key_sizes=array('I', map(self._sizes.__getitem__, batch.topics)))

    def _repeated(self, batch: Batch) -> Batch:
        topics, times, sizes, key_sizes = array('I'), array('q'), array('Q'), array('I')
        messages, keys = bytearray(), bytearray()
        place = 0
        for number, time, size in zip(batch.topics, batch.times, batch.sizes):
            for topic, key in self._targets[number]:
                topics.append(topic)
                times.append(time)
                sizes.append(size)
                key_sizes.append(len(key))
                messages += batch.messages[place:place + size]
                keys += key
            place += size
        return Batch(topics, times, sizes, bytes(messages), bytes(keys),
                     key_sizes if self._has_keys else None)
