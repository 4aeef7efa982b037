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
Whether recorded messages fit the definitions by which they are read.

Messages without a definition in the recording are read by what is installed, which may be another
version of the type. A message of which bytes are left over was serialized by another definition.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from operator import itemgetter

from fret_monitor.bag.recording import Batch
from fret_monitor.messages.installed import find_message, fingerprint
from fret_monitor.messages.layout import MessageLayout
from fret_monitor.messages.measure import measure
from fret_monitor.model.diagnostics import CompileError, counted
from fret_monitor.model.manifest import ManifestTopic

_MOST_LENGTHS = 64  # of a topic, of which one message each is measured
_PADDING = 3  # bytes that may follow: a multiple of four is sent


class MessageFit:
    """Measures the first message of each length that a topic has."""

    def __init__(self, topics: Sequence[ManifestTopic],
                 find: Callable[[str], MessageLayout]) -> None:
        """Measure messages of topics; their types are found by `find`."""
        self._types = [item.message_type for item in topics]
        self._layouts = [find(name) for name in self._types]
        self._lengths: list[set[int]] = [set() for _ in topics]
        self._misfits: dict[int, str] = {}  # by topic

    def look_at(self, batch: Batch) -> Sequence[int]:
        """
        Measure messages of lengths that did not occur before.

        Returns the topics whose first message was among them and does not fit.
        """
        topics = {*batch.topics}
        lengths = {*batch.sizes}
        if all(lengths <= self._lengths[topic] for topic in topics):
            return []
        new = {(topic, size) for topic, size in {*zip(batch.topics, batch.sizes)}
               if size not in self._lengths[topic] and len(self._lengths[topic]) < _MOST_LENGTHS}
        unknown = {topic for topic, _ in new if not self._lengths[topic]}
        place = 0
        unfit = []
        for topic, size in zip(batch.topics, batch.sizes) if new else ():
            if (topic, size) in new:
                new.remove((topic, size))
                self._lengths[topic].add(size)
                fits = self._measure(topic, batch.messages[place:place + size])
                if topic in unknown:
                    unknown.remove(topic)
                    unfit += [] if fits else [topic]
            place += size
        return unfit

    def _measure(self, topic: int, message: bytes) -> bool:
        try:
            size = measure(self._layouts[topic], message)
        except CompileError:
            return True  # a message within it is defined nowhere, and no input reads it
        if size is not None and len(message) - size <= _PADDING:
            return True
        self._misfits.setdefault(
            topic, 'end before its last field' if size is None else
            f'have {counted(len(message) - size, "byte")} after its last field')
        return False

    def errors(self, names: Sequence[str]) -> Iterator[str]:
        """Yield what does not fit; `names` are those of the topics in the recording."""
        for topic, problem in sorted(self._misfits.items()):
            yield (f'messages of {names[topic]} do not fit {self._types[topic]}: they {problem}; '
                   'they are damaged, or were written with another version of it')

    def warnings(self) -> Iterator[str]:
        """Yield which types are defined in another way than those that are installed."""
        for name, layout in sorted({*zip(self._types, self._layouts)}, key=itemgetter(0)):
            with suppress(CompileError):  # it is not installed
                if fingerprint(find_message(name)) != fingerprint(layout):
                    yield (f'{name}: the definition in the recording differs from the installed '
                           'one; that of the recording was used')
