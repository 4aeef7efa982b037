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
Log silent inputs: no usable value within their `timeout` (docs/ros.md, Silent inputs).

The engine finds silences, at their instant, and violates what reads a silent input. This only logs
them.
"""

from collections.abc import Sequence

from fret_monitor.model.manifest import Manifest
from fret_monitor.model.policies import Stale
from fret_monitor.runtime import Engine, Silence

from rclpy.node import Node

_NAMED = 5  # names in one log line


class SilenceLog:
    """Logs the silences of a bundle's inputs, each when it has begun and when it has ended."""

    def __init__(self, node: Node, manifest: Manifest, engine: Engine) -> None:
        """Log for a node."""
        self._node = node
        self._manifest = manifest
        self._engine = engine
        self._seen = {index: Silence(0, 0, False) for index, item in enumerate(manifest.inputs)
                      if item.timeout is not None and item.topic is not None}

    def present(self) -> dict[int, Silence]:
        """Return the silences of all inputs with a timeout, by index."""
        return {index: self._engine.silence(index) for index in self._seen}

    def review(self) -> None:
        """Log what is new."""
        before, self._seen = self._seen, self.present()
        begun = [index for index, item in self._seen.items() if item.count > before[index].count]
        ended = [index for index, item in self._seen.items() if not item.is_silent and (
            before[index].is_silent or item.count > before[index].count)]
        for topic in self._manifest.topics:
            # An input had a value between two silences: no line has the end of the first.
            is_again = any(self._seen[index].count > before[index].count
                           + (not before[index].is_silent)
                           for index in topic.inputs if index in begun)
            self._log_begun(topic.name, [index for index in topic.inputs if index in begun],
                            is_again=is_again)
            self._log_ended(topic.name, [index for index in topic.inputs if index in ended])

    def _log_begun(self, topic: str, indices: Sequence[int], *, is_again: bool) -> None:
        if not indices:
            return
        first = self._manifest.inputs[indices[0]]
        limit, of = (first.timeout, 'timeout') if self._has_come(indices) else (
            first.startup or first.timeout, 'startup')
        readers = [item.id for item in self._manifest.requirements
                   if not set(indices).isdisjoint(item.inputs)]
        again = 'again ' if is_again else ''
        line = (f'{again}no usable value on '
                f'{self._node.resolve_topic_name(topic)} within the {of} of {limit:g} s '
                f'for {self._named(indices)}')
        if readers and first.stale is Stale.VIOLATE:
            self._node.get_logger().error(f'{line}: {some(readers)} violated until one comes')
        else:
            self._node.get_logger().warning(line)

    def _log_ended(self, topic: str, indices: Sequence[int]) -> None:
        if indices:
            lasted = max(self._seen[index].lasted for index in indices) / 1e9
            self._node.get_logger().info(
                f'values on {self._node.resolve_topic_name(topic)} again after {lasted:.1f} s, '
                f'for {self._named(indices)}')

    def _has_come(self, indices: Sequence[int]) -> bool:
        return any(self._engine.input_counts(index).received for index in indices)

    def _named(self, indices: Sequence[int]) -> str:
        return some([f"'{self._manifest.inputs[index].name}'" for index in indices])


def some(names: Sequence[str], separator: str = ', ') -> str:
    """Return the first five names in one line, and how many more there are."""
    more = len(names) - _NAMED
    return separator.join(names[:_NAMED]) + (f' and {more} more' if more > 0 else '')
