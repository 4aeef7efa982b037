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

"""What a bundle names in the graph of ROS; `csrc/ros/graph.h` looks at it and decides."""

from collections.abc import Callable
from time import monotonic_ns
from typing import Any

from fret_monitor.model.made import MadeKind
from fret_monitor.native.binding import ffi
from fret_monitor.ros.intake.hot_path import Middleware
from fret_monitor.ros.intake.rcl_endpoint import RclClient
from fret_monitor.ros.intake.symbols import Unavailable
from fret_monitor.runtime.engine import Engine

from lifecycle_msgs.srv import GetState
from rcl_interfaces.srv import GetParameters
from rclpy.node import Node


class GraphSources:
    """Delivers to an engine what is seen in the graph; for the thread of the feed."""

    def __init__(self, node: Node, engine: Engine, middleware: Middleware) -> None:
        """
        Prepare to look for the sources of the engine's manifest.

        Raises `Unavailable` if the middleware lacks a function, or memory is short.
        """
        watched = engine.monitor.manifest.watched
        self._node = node
        self._library = engine.library
        self._engine = engine  # outlives the watch
        self._functions = middleware.graph_functions()
        self._services = middleware.service_functions()
        self._names = [
            node.resolve_topic_name(made.names[0])
            if made.kind in (MadeKind.PUBLISHERS, MadeKind.SUBSCRIBERS)
            else node_name(node, made.names[0]) for made in watched.values()]
        self._counted = [made.kind is MadeKind.SUBSCRIBERS for made in watched.values()]
        self._texts = [(ffi.new('char[]', name.encode()), ffi.new('char[]', (
            made.names[1] if made.kind is MadeKind.PARAMETER else '').encode()))
            for name, made in zip(self._names, watched.values())]
        sources = ffi.new('struct fm_graph_source[]', [
            (topic, ffi.integer_const(f'FM_GRAPH_{made.kind.name}'), name,
             round(made.patience * 1e9), parameter)
            for (topic, made), (name, parameter) in zip(watched.items(), self._texts)])
        self._clients = [_client(node, made.kind, name)
                         for made, name in zip(watched.values(), self._names)]
        self._next = 0  # when to look, by the steady clock
        self.knows_change = False
        """Whether C knows of a change, and looks when it is time."""
        with node.handle:
            self._ends = ffi.new('struct fm_service_client[]', [
                self._end(middleware, item) for item in self._clients])
            self._pointer: Any = ffi.gc(self._library.fm_graph_create(
                engine.pointer, self._functions, self._services, middleware.handle(node), sources,
                self._ends, len(watched), monotonic_ns()), self._library.fm_graph_destroy)
        if self._pointer == ffi.NULL:
            raise Unavailable('memory is short')

    def _end(self, middleware: Middleware, client: RclClient | None) -> dict[str, Any]:
        if client is None:
            return {}
        with client.handle:
            return middleware.service_client(self._node, client)

    def close(self) -> None:
        """End the watch, which nobody uses any more."""
        ffi.release(self._pointer)
        for client in self._clients:
            if client is not None:
                client.close()

    def review(self, has_changed: bool, subscriptions: Callable[[str], int]) -> float:
        """
        Look at the graph if it is time; return after how many seconds to call this again.

        `subscriptions` returns how many this node has on a topic: they are not counted.
        """
        now = monotonic_ns()
        if now < self._next and (self.knows_change or not has_changed):
            return (self._next - now) / 1e9
        own = [subscriptions(name) if is_counted else 0
               for name, is_counted in zip(self._names, self._counted)]
        with self._node.handle:
            self._next = self._library.fm_graph_review(
                self._pointer, now, has_changed, ffi.new('uint32_t[]', [*own, 0]))
        self.knows_change = self._library.fm_graph_knows_change(self._pointer)
        return max(0.0, (self._next - now) / 1e9)


def node_name(node: Node, name: str) -> str:
    """Return the full name of another node: in the namespace of this one, without a slash."""
    return name if name.startswith('/') else f'{node.get_namespace().rstrip("/")}/{name}'


def _client(node: Node, kind: MadeKind, name: str) -> RclClient | None:
    if kind is MadeKind.LIFECYCLE:
        return RclClient(node, GetState, f'{name}/get_state')
    if kind is MadeKind.PARAMETER:
        return RclClient(node, GetParameters, f'{name}/get_parameters')
    return None
