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
Log names of elements that no message has had for ten seconds (docs/bundle.md, Elements by name).

A single message without the name says little: several nodes send `/diagnostics` and `/tf`, each
with its own names.
"""

from collections.abc import Callable, Collection
from time import monotonic

from fret_monitor.model.manifest import Manifest
from fret_monitor.model.paths import path_text
from fret_monitor.runtime import Engine

from rclpy.node import Node

LIMIT_S = 10.0


class LookUpLog:
    """Logs each name once when it has been missing for long, and again after it was found."""

    def __init__(self, node: Node, manifest: Manifest, engine: Engine,
                 clock: Callable[[], float] = monotonic) -> None:
        """Log for a node; `clock` is in seconds."""
        self._node = node
        self._manifest = manifest
        self._engine = engine
        self._clock = clock
        self._since: dict[int, tuple[float, int]] = {}
        self._logged: set[int] = set()

    @property
    def missing(self) -> Collection[int]:
        """The inputs whose names have been missing for long."""
        return self._logged

    def note_absent(self, index: int) -> None:
        """Note that a message did not have the name of an input."""
        self._since.setdefault(index, (self._clock(), self._received(index)))

    def review(self) -> None:
        """Log what has been missing for long; forget what was found."""
        for index, (since, received) in list(self._since.items()):
            if self._received(index) > received:
                del self._since[index]
                self._logged.discard(index)
            elif self._clock() - since >= LIMIT_S and index not in self._logged:
                self._logged.add(index)
                self._log(index)

    def _received(self, index: int) -> int:
        return self._engine.input_counts(index).received

    def _log(self, index: int) -> None:
        item = self._manifest.inputs[index]
        outcome = 'has no value yet' if self._engine.value(index) is None else 'keeps its value'
        self._node.get_logger().warning(
            f'{self._node.resolve_topic_name(item.topic or "")}: no message has had '
            f"{path_text(item.path)} for {LIMIT_S:g} s; input '{item.name}' {outcome}")
