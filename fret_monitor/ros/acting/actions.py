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
The actions of a bundle on a node: what follows violations and their ends.

Locks are published by the announcer in C (`hot_path.Announcer`). All other actions start in a
thread of C (`csrc/ros/actions.h`), which publishes and calls services: no verdict waits for an
action. This module makes the publishers and clients.
"""

from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from importlib import import_module
from typing import Any

from fret_monitor.model.manifest import Manifest, ManifestAction
from fret_monitor.model.policies import ActionKind
from fret_monitor.native.binding import ffi
from fret_monitor.ros.intake import native_lifetimes
from fret_monitor.ros.intake.fields import message_class
from fret_monitor.ros.intake.hot_path import Middleware
from fret_monitor.ros.intake.rcl_endpoint import RclClient, RclPublisher
from fret_monitor.ros.settings.names import one_type, reached_by
from fret_monitor.runtime import Engine
from fret_monitor.runtime.reporting import Lines, LogLine, ReportTable

from lifecycle_msgs.srv import ChangeState, GetState
from rclpy.node import Node
from rclpy.qos import QoSProfile

_DEPTH = 10

_Ends = RclPublisher | tuple[RclClient, ...]


class Actions:
    """
    The actions of one monitor.

    Between `start` and `stop` they follow an engine. `locks` are for its announcer.
    """

    def __init__(self, node: Node, manifest: Manifest, table: ReportTable, library: Any) -> None:
        """
        Create the publishers and clients; `library` has the functions of csrc.

        Raises `Refusal` if a type is not installed, or the process uses a topic or service with
        another type.
        """
        self._node = node
        self._manifest = manifest
        self._table = table
        self._library = library
        self._owned = ExitStack()
        self._thread: _ActionThread | None = None
        self._ends: list[_Ends] = []
        self.locks: list[RclPublisher] = []
        self.counts: Any = ffi.new('struct fm_action_facts[]', table.pointer.n_actions)
        """Of all actions but locks, in the manifest's order, at the last look."""
        with ExitStack() as undo:
            undo.callback(self.close)
            for action in manifest.actions:
                if action.kind is ActionKind.LOCK:
                    self.locks.append(self._publisher(action))
                else:
                    self._ends.append(self._make_ends(action))
            undo.pop_all()

    def _publisher(self, action: ManifestAction) -> RclPublisher:
        kind = message_class(action.interface)
        with one_type(self._node, 'publish on', action.target, action.interface):
            publisher = RclPublisher(self._node, kind, action.target, QoSProfile(depth=_DEPTH))
        self._owned.callback(publisher.close)
        return publisher

    def _make_ends(self, action: ManifestAction) -> _Ends:
        if action.kind is ActionKind.PUBLISH:
            return self._publisher(action)
        clients = tuple(RclClient(self._node, kind, name) for kind, name in _services(action))
        for client in clients:
            self._owned.callback(client.close)
        return clients

    def prepare(self, engine: Engine) -> None:
        """Let an engine keep what actions follow, before messages are delivered."""
        if self._manifest.actions and not self._library.fm_actions_prepare(
                engine.pointer, self._table.pointer):
            raise MemoryError

    def start(self, engine: Engine, middleware: Middleware) -> None:
        """Follow an engine, in a thread; after `prepare`. Raises `Unavailable`."""
        if self._ends:
            self._thread = _ActionThread(
                self._node, engine, middleware, self._table, self._ends, self.counts)

    def stop(self) -> list[LogLine]:
        """Close the engine, wait until no action runs, and return the last lines; idempotent."""
        thread, self._thread = self._thread, None
        if thread is None:
            return []
        thread.end()
        lines = thread.look(self.counts)
        thread.close()
        return lines

    def close(self) -> None:
        """Stop, and remove publishers and clients from the node."""
        self.stop()
        self._owned.close()

    @property
    def turns(self) -> int | None:
        """How often the thread has looked for work; None without a thread."""
        return None if self._thread is None else self._thread.turns

    def lines(self) -> list[LogLine]:
        """Return the lines about failures since the last call, and update the counts."""
        return [] if self._thread is None else self._thread.look(self.counts)

    def names(self) -> Iterator[list[str]]:
        """Yield the full names of the topics of locks, then of what the other actions reach."""
        for is_lock in (True, False):
            yield [item.target if item.kind is ActionKind.TRANSITION
                   else reached_by(self._node, item) for item in self._manifest.actions
                   if (item.kind is ActionKind.LOCK) is is_lock]


def _services(action: ManifestAction) -> Iterator[tuple[Any, str]]:
    """Yield the types and names of the services that an action calls."""
    if action.kind is ActionKind.TRANSITION:
        yield GetState, f'{action.target}/get_state'
        yield ChangeState, f'{action.target}/change_state'
    else:
        request = message_class(action.payload_type)
        yield getattr(import_module(request.__module__.rpartition('.')[0]),
                      action.interface.rpartition('/')[2]), action.target


class _ActionThread(native_lifetimes.NativeThread):
    """The thread in C, and what it uses."""

    def __init__(self, node: Node, engine: Engine, middleware: Middleware, table: ReportTable,
                 ends: Sequence[_Ends], before: Any) -> None:
        super().__init__('actions', engine)
        with self._starting((node, *(part for end in ends for part in (
                end if isinstance(end, tuple) else (end,))))):
            self._kept = (middleware, table, ends, ffi.new('struct fm_action_ends[]', [
                self._end(node, middleware, end) for end in ends]))
            self._start(ffi.new('struct fm_actions_options *', {
                'engine': engine.pointer, 'table': table.pointer, 'ends': self._kept[-1],
                'services': middleware.service_functions()[0],
                'publish': middleware.publish_serialized(), 'before': before}))

    def _end(self, node: Node, middleware: Middleware, end: _Ends) -> dict[str, Any]:
        if not isinstance(end, tuple):
            return {'publisher': middleware.handle(end)}
        return {'services': [middleware.service_client(node, item) for item in end]}

    def look(self, counts: Any) -> list[LogLine]:
        """Update the counts, and return the lines since the last look; before `close`."""
        lines = Lines(self._library)
        self._library.fm_actions_look(self._place[0], counts, lines.pointer)
        return lines.take()

    def end(self) -> None:
        """Close the engine, and wait for the thread; idempotent."""
        self._engine.close()
        self._call('end')
        native_lifetimes.release(self)
