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
The verdicts of requirements: `copilot/verdict/ID` (docs/ros_interface.md, Verdicts).

A thread of C (`csrc/ros/verdict_thread.h`) publishes them; this makes the publishers.
"""

from contextlib import ExitStack
from threading import Lock
from typing import Any

from fret_monitor.model.manifest import Manifest
from fret_monitor.model.names import verdict_topic
from fret_monitor.native.binding import ffi
from fret_monitor.ros.intake import native_lifetimes
from fret_monitor.ros.intake.hot_path import Middleware
from fret_monitor.ros.intake.rcl_endpoint import RclPublisher
from fret_monitor.ros.intake.symbols import Unavailable
from fret_monitor.ros.settings.endpoint_types import one_type
from fret_monitor.runtime import Engine

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Bool

_LAST = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE,
                   durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Verdicts:
    """The publishers of the verdicts of a bundle; their owner closes them."""

    def __init__(self, node: Node, manifest: Manifest) -> None:
        """
        Advertise the topics.

        Raises
        ------
        Refusal
            if the process uses one of them with another type.
        """
        self._owned = ExitStack()
        self._publishers: list[RclPublisher] = []
        with ExitStack() as undo:
            undo.callback(self.close)
            for item in manifest.numbered:
                topic = verdict_topic(item.handler)
                with one_type(node, 'publish on', topic, 'std_msgs/msg/Bool'):
                    publisher = RclPublisher(node, Bool, topic, _LAST)
                self._owned.callback(publisher.close)
                self._publishers.append(publisher)
            undo.pop_all()

    def start(self, engine: Engine, middleware: Middleware) -> 'VerdictThread':
        """Publish the verdicts of an engine, before messages are delivered to it."""
        return VerdictThread(engine, middleware, self._publishers)

    def close(self) -> None:
        """Withdraw the topics."""
        self._owned.close()


class VerdictThread:
    """The thread in C, and what it uses."""

    def __init__(self, engine: Engine, middleware: Middleware,
                 publishers: list[RclPublisher]) -> None:
        """Start it; raises `Unavailable` if it cannot be started."""
        self._library = engine.library
        self._engine = engine
        self._middleware = middleware
        self._place: Any = ffi.new('struct fm_verdict_thread **')
        self._lock = Lock()  # guards the pointer in `_place`
        self._held = ExitStack()
        with ExitStack() as undo:
            undo.callback(self.join)  # also if a signal interrupts what follows
            for item in publishers:
                self._held.enter_context(item.handle)
            found = [middleware.publisher(item) for item in publishers]
            native_lifetimes.keep(self)
            if not self._library.fm_verdict_thread_start(
                    self._place, engine.pointer, middleware.functions,
                    ffi.new('void *[]', [*found, ffi.NULL]), len(found)):
                raise Unavailable('no thread can be started')
            undo.pop_all()

    def end(self) -> None:
        """Close the engine, and wait for the thread; idempotent."""
        self._engine.close()
        with self._lock:
            self._library.fm_verdict_thread_join(self._place)
        native_lifetimes.release(self)

    def join(self) -> None:
        """Do as `end`; afterwards the publishers may be destroyed."""
        self.end()
        self._held.close()
