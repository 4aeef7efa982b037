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
Waits of a thread for the graph of ROS to change, or for messages.

rcl has a guard condition for the graph, which rclpy does not show. The middleware has one for all
nodes of a context, and the first wait that sees it takes it from the others: so it passes it on.
"""

from collections.abc import Sequence
from contextlib import ExitStack
from threading import Lock
from typing import Any

from fret_monitor.native.binding import ffi
from fret_monitor.ros.intake.symbols import find_symbol, loaded_library

from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node

_ALL: set['GraphWait'] = set()
_LOCK = Lock()  # guards `_ALL`, and the guard conditions of its members


class GraphWait:
    """Lets one thread wait, from its creation until `close`."""

    def __init__(self, node: Node) -> None:
        """Look up the functions of rcl; raises `Unavailable` if one is missing."""
        rcl = loaded_library('librcl.so')
        self._graph_of = find_symbol(
            rcl, 'rcl_node_get_graph_guard_condition', 'void * (*)(void *)')
        self._add = find_symbol(
            rcl, 'rcl_wait_set_add_guard_condition', 'int (*)(void *, void *, size_t *)')
        self._node = node
        self._guard = _rclpy.GuardCondition(node.context.handle)
        self._has_changed = False
        self._wait_set: Any = None
        self._places = -1  # for subscriptions, in the wait set
        with _LOCK:
            _ALL.add(self)

    def wait(self, seconds: float, subscriptions: Sequence[Any] = (), *,
             for_change: bool = True) -> bool:
        """
        Wait for a change, a message of the subscriptions (their handles), or `wake`.

        Return whether the graph has changed since the last wait; without `for_change` a change may
        be left to the next one, which saves a wake-up where changes are many.
        """
        with ExitStack() as held:
            held.enter_context(self._node.handle)
            try:
                held.enter_context(self._guard)  # a wait set does not keep it
            except _rclpy.InvalidHandle:
                return False  # closed, although the thread has not ended: that was interrupted
            graph = self._graph_of(ffi.cast('void *', self._node.handle.pointer))
            wait_set = self._filled(subscriptions)
            if for_change:
                self._add(ffi.cast('void *', wait_set.pointer), graph, ffi.NULL)
            wait_set.wait(int(seconds * 1e9))
            if int(ffi.cast('uintptr_t', graph)) in wait_set.get_ready_entities('guard_condition'):
                self._pass_on()
        has_changed, self._has_changed = self._has_changed, False
        return has_changed

    def _filled(self, subscriptions: Sequence[Any]) -> Any:
        """Return a wait set; rcl has removed from it what was not ready."""
        if self._places != len(subscriptions):
            self._places = len(subscriptions)
            self._wait_set = _rclpy.WaitSet(
                self._places, 2, 0, 0, 0, 0, self._node.context.handle)
        self._wait_set.clear_entities()
        for handle in subscriptions:
            self._wait_set.add_subscription(handle)
        self._wait_set.add_guard_condition(self._guard)
        return self._wait_set

    def _pass_on(self) -> None:
        with _LOCK:
            for other in _ALL:
                other._has_changed = True
                if other is not self:
                    other._guard.trigger_guard_condition()

    def wake(self) -> None:
        """End the present wait, or the next one."""
        with _LOCK:
            if self in _ALL:
                self._guard.trigger_guard_condition()

    def close(self) -> None:
        """Release what waits need: the thread has ended."""
        with _LOCK:
            if self in _ALL:
                _ALL.remove(self)
                self._guard.destroy_when_not_in_use()
