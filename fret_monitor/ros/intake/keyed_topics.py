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
Topics with an instance variable in their names, such as `/{robot}/odom`.

C finds them in the graph (`csrc/ros/keyed_topics.h`); each is then a topic as any other, with its
key bound.
"""

from collections.abc import Callable, Mapping
from time import monotonic_ns
from typing import Any

from fret_monitor.model.manifest import Manifest, ManifestTopic
from fret_monitor.native.binding import ffi
from fret_monitor.ros.intake.feed import Feed
from fret_monitor.ros.intake.hot_path import EngineTopic, Middleware
from fret_monitor.ros.intake.symbols import Unavailable
from fret_monitor.ros.log_lines import log_lines
from fret_monitor.ros.settings.names import full_name
from fret_monitor.ros.settings.parameters import Refusal
from fret_monitor.runtime.engine import Engine
from fret_monitor.runtime.reporting import Lines

from rclpy.node import Node


class KeyedTopics:
    """
    Watches the graph for the topics of an engine; for the thread of the feed, which keeps it.

    Memory of C is freed with this object.
    """

    def __init__(self, node: Node, engine: Engine, middleware: Middleware, feed: Feed,
                 subscribe: Callable[[ManifestTopic, EngineTopic, str], None]) -> None:
        """
        Prepare to look for the topics of the engine's manifest whose keys are found.

        `subscribe` subscribes to one in `feed`, by its full name. Raises `Unavailable` if the
        middleware lacks a function, or memory is short.
        """
        self._node = node
        self._engine = engine
        self._middleware = middleware
        self._feed = feed
        self._subscribe = subscribe
        self._library = engine.library
        self._topics: Mapping[int, ManifestTopic] = found_topics(engine.monitor.manifest)
        self._bound: dict[EngineTopic, str] = {}
        self._handovers: dict[int, set[EngineTopic]] = {index: set() for index in self._topics}
        self.knows_change = False  # of the graph, at which C looks when it is time
        self._lines = Lines(engine.library)
        self._functions = middleware.graph_functions()
        manifest = engine.monitor.manifest
        self._texts = [tuple(ffi.new('char[]', text.encode()) for text in (
            full_name(node, manifest, item), item.message_type)) for item in self._topics.values()]
        patterns = ffi.new('struct fm_keyed_pattern[]', [
            (index, *texts) for index, texts in zip(self._topics, self._texts, strict=True)])
        with node.handle:
            self._pointer: Any = ffi.gc(self._library.fm_keyed_topics_create(
                self._functions, middleware.handle(node), patterns, len(self._topics)),
                self._library.fm_keyed_topics_destroy)
        if self._pointer == ffi.NULL:
            raise Unavailable('memory is short')

    def review(self, has_changed: bool, _: Callable[[str], int]) -> float:
        self._give_up()
        now = monotonic_ns()
        with self._node.handle:
            self._library.fm_keyed_topics_review(
                self._pointer, now, has_changed, self._lines.pointer)
            self.knows_change = self._library.fm_keyed_topics_knows_change(self._pointer)
        log_lines(self._node.get_logger(), self._lines.take())
        found = ffi.new('struct fm_keyed_topic *')
        while self._library.fm_keyed_topics_take(self._pointer, now, found):
            self._take(found, now)
        return max(0.0, float(self._library.fm_keyed_topics_next(self._pointer) - now) / 1e9)

    def _take(self, found: Any, now: int) -> None:
        name: Any = ffi.string(found.name)
        topic = EngineTopic(
            self._engine, self._middleware, found.topic,
            bytes(ffi.buffer(found.key.bytes, found.key.size)), self._handovers[found.topic])
        try:
            self._subscribe(self._topics[found.topic], topic, name.decode())
        except Refusal as error:  # another attempt follows
            self._node.get_logger().error('\n'.join(error.problems))
            self._library.fm_keyed_topics_fail(self._pointer, found, now)
        else:
            self._bound[topic] = name.decode()

    def _give_up(self) -> None:
        for topic in self._feed.abandoned() if self._bound else ():
            if isinstance(topic, EngineTopic) and topic in self._bound:
                name = self._bound.pop(topic)
                self._feed.unsubscribe(topic)
                self._library.fm_keyed_topics_give_up(self._pointer, topic.index, name.encode())


def found_topics(manifest: Manifest) -> dict[int, ManifestTopic]:
    """Return the topics with a variable in their names of which the keys are found."""
    return {index: topic for index, topic in enumerate(manifest.topics)
            if (variable := manifest.key_of(topic)) is not None and not variable.keys}


def listed_topics(manifest: Manifest) -> dict[int, dict[str, str]]:
    """Return the names that topics have with listed keys, by the key."""
    return {index: {key: topic.name.replace(f'{{{variable.name}}}', key) for key in variable.keys}
            for index, topic in enumerate(manifest.topics)
            if (variable := manifest.key_of(topic)) is not None and variable.keys}
