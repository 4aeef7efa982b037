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
What C does with the middleware: it takes messages, and publishes violations.

rclpy creates the subscriptions and publishers; the C in `csrc/ros` uses their handles. On the hot
path it takes and evaluates messages inside the middleware's callbacks. Otherwise the callbacks
only wake the announcer's thread, which does. This module looks up the functions of the middleware
that C calls, in the libraries that rclpy has loaded.
"""

from collections.abc import Sequence
from contextlib import ExitStack
import threading
from typing import Any

from fret_monitor.native import words
from fret_monitor.native.binding import ffi
from fret_monitor.ros.intake import native_lifetimes
from fret_monitor.ros.intake.feed import Receiver, Topic
from fret_monitor.ros.intake.in_place import InPlaceTypes
from fret_monitor.ros.intake.rcl_endpoint import (
    RclClient, RclEndpoint, RclPublisher, RclSubscription,
)
from fret_monitor.ros.intake.symbols import find_symbol, loaded_library, Unavailable
from fret_monitor.runtime.engine import Engine
from fret_monitor.runtime.reporting import ReportTable

from rclpy.node import Node
from rclpy.utilities import get_rmw_implementation_identifier


class Middleware:
    """The functions of the middleware, as C calls them."""

    def __init__(self, *, may_take: bool = True) -> None:
        """
        Look up the functions; with `may_take`, its callbacks take the messages.

        Raises `Unavailable` if a function is missing.
        """
        self._may_take = may_take
        rmw = loaded_library(
            'librmw_implementation.so', f'lib{get_rmw_implementation_identifier()}.so')
        rcl, rcutils = loaded_library('librcl.so'), loaded_library('librcutils.so')
        self._rmw, self._rcl, self._rcutils = rmw, rcl, rcutils
        self._in_place: InPlaceTypes | None = None
        self.functions = _functions(
            'struct fm_middleware *', take=(rmw, 'rmw_take_serialized_message_with_info'),
            listen=(rmw, 'rmw_subscription_set_on_new_message_callback'),
            publish=(rmw, 'rmw_publish'), forget_error=(rcutils, 'rcutils_reset_error'),
            has_error=(rcutils, 'rcutils_error_is_set'),
            count_matched=(rmw, 'rmw_publisher_count_matched_subscriptions'))
        self._gid_of = find_symbol(rmw, 'rmw_get_gid_for_publisher', 'int (*)(void *, void *)')
        self.clock_now = find_symbol(rcl, 'rcl_clock_get_now', 'int (*)(void *, int64_t *)')

    def publish_serialized(self) -> Any:
        """Return the function that publishes a serialized message; raises `Unavailable`."""
        options: Any = ffi.new('struct fm_relay_options *')
        return find_symbol(
            self._rmw, 'rmw_publish_serialized_message', ffi.typeof(options.publish))

    def service_functions(self) -> Any:
        """Return a `struct fm_service_functions *`, to call services; raises `Unavailable`."""
        return _functions(
            'struct fm_service_functions *',
            is_available=(self._rmw, 'rmw_service_server_is_available'),
            send=(self._rmw, 'rmw_send_request'), take=(self._rmw, 'rmw_take_response'),
            deserialize=(self._rmw, 'rmw_deserialize'),
            forget_error=(self._rcutils, 'rcutils_reset_error'))

    def graph_functions(self) -> Any:
        """Return a `struct fm_graph_functions *`, to look at the graph; raises `Unavailable`."""
        return _functions(
            'struct fm_graph_functions *', node_names=(self._rmw, 'rmw_get_node_names'),
            count_publishers=(self._rmw, 'rmw_count_publishers'),
            count_subscribers=(self._rmw, 'rmw_count_subscribers'),
            free_strings=(self._rcutils, 'rcutils_string_array_fini'),
            forget_error=(self._rcutils, 'rcutils_reset_error'),
            topic_names=(self._rmw, 'rmw_get_topic_names_and_types'),
            free_topics=(loaded_library('librmw.so'), 'rmw_names_and_types_fini'))

    def handle(self, item: Node | RclEndpoint | RclClient) -> Any:
        """Return the rmw handle of a node or what it has; the caller holds its rclpy handle."""
        kind = 'node' if isinstance(item, Node) else item.KIND
        found: Any = find_symbol(self._rcl, f'rcl_{kind}_get_rmw_handle', 'void * (*)(void *)')(
            ffi.cast('void *', item.handle.pointer))
        if found == ffi.NULL:
            raise Unavailable('rcl gives no handle of the middleware')
        return found

    def service_client(self, node: Node, client: RclClient) -> dict[str, Any]:
        """Return the members of a `struct fm_service_client`; as `handle`."""
        return {'node': self.handle(node), 'client': self.handle(client),
                'support': client.support, 'name': client.name}

    def read_in_place(self, library: Any) -> None:
        """
        Read messages in the middleware's buffers, instead of copying them first.

        `library` holds the functions of csrc. Raises `Unavailable` if this was not tested with the
        loaded version of the middleware.
        """
        self._in_place = InPlaceTypes(library, self.functions)

    def class_in_place(self, message_class: Any) -> Any:
        """Return a class to subscribe with; raises `Unavailable` if it must be copied."""
        return message_class if self._in_place is None else \
            self._in_place.subscription_class(message_class)

    def taking(self, subscription: RclSubscription) -> int:
        """Return how the messages of a subscription are taken (`enum fm_taking`)."""
        is_in_place = self._in_place is not None and \
            self._in_place.is_in_place(subscription.msg_type)
        names = ('FM_WAKE', 'FM_LISTEN', 'FM_LISTEN_IN_PLACE')
        return int(ffi.integer_const(names[self._may_take * (1 + is_in_place)]))

    def handles(self, items: Sequence[RclPublisher]) -> Any:
        """Return an array of rmw handles, and NULL; as `handle`."""
        return ffi.new('void *[]', [*map(self.handle, items), ffi.NULL])

    def gid(self, item: RclPublisher) -> bytes:
        """Return the identity of a publisher; the caller holds its rclpy handle."""
        found: Any = ffi.new('struct fm_gid *')
        if self._gid_of(self.handle(item), found):
            self.functions.forget_error()
        return bytes(ffi.buffer(found.data))


def _functions(kind: str, **wanted: tuple[Any, str]) -> Any:
    """Return a struct of functions, each by its library and its name; raises `Unavailable`."""
    found: Any = ffi.new(kind)
    for field, (library, name) in wanted.items():
        setattr(found, field, find_symbol(library, name, ffi.typeof(getattr(found, field))))
    return found


def why_callbacks_wake(hot_path: str, library: Any) -> str | None:
    """
    Return why the middleware's callbacks do not take the messages; None if they do.

    `library` holds the functions of csrc.
    """
    if hot_path == 'off':
        return words.HOT_PATH_IS_OFF
    name = get_rmw_implementation_identifier()
    if hot_path != 'on' and \
            library.fm_receiver_taking(name.encode()) == ffi.integer_const('FM_WAKE'):
        return words.UNKNOWN_CALLBACKS % name
    return None


class EngineReceiver:
    """Takes the messages of one subscription for an engine, in C."""

    def __init__(self, engine: Engine, middleware: Middleware,
                 subscription: RclSubscription, topic: int, key: bytes | None = None) -> None:
        """
        Start taking; messages in the queue are delivered before this returns.

        `key` is that of the instance in the topic's name; None: none is in it. Raises
        `Unavailable` if the middleware has no callback for new messages.
        """
        self._library = engine.library
        self._engine = engine
        self._middleware = middleware
        self._lock = threading.Lock()  # the feed's thread retires, another thread may stop
        self._place: Any = ffi.new('struct fm_receiver **')
        self._is_leaked = False
        self._held = ExitStack()
        with ExitStack() as undo:
            undo.callback(self.stop)  # also if a signal interrupts what follows
            self._held.enter_context(subscription.handle)
            native_lifetimes.keep(self)
            text = ffi.new('uint8_t[]', key or b'')
            if not self._library.fm_receiver_start(
                    self._place, engine.pointer, middleware.functions,
                    middleware.handle(subscription), topic, middleware.taking(subscription),
                    ffi.NULL if key is None else ffi.new('struct fm_key *', (text, len(key)))):
                raise Unavailable('the middleware has no callback for new messages')
            undo.pop_all()

    def retire(self) -> None:
        with self._lock:
            if not self._is_leaked and self._place[0] != ffi.NULL:
                self._library.fm_receiver_retire(self._place[0])

    def end(self) -> None:
        with self._lock:
            if not self._is_leaked and not self._library.fm_receiver_stop(self._place):
                # The middleware may still call back.
                self._is_leaked = True
                native_lifetimes.keep_forever(self)
            if self._is_leaked:
                return
        native_lifetimes.release(self)

    def stop(self) -> None:
        self._engine.drain()
        self.end()
        if not self._is_leaked:
            self._held.close()


class EngineTopic(Topic):
    """A topic of an engine: delivers its messages, across handovers, and counts losses."""

    def __init__(self, engine: Engine, middleware: Middleware, topic: int,
                 key: bytes | None = None, handovers: 'set[EngineTopic] | None' = None) -> None:
        """
        Deliver to an engine; `topic` is the index in its manifest.

        If that is many topics of ROS, this is the one with a `key` in its name, and `handovers`
        are those of them whose subscriptions are being replaced.
        """
        self._engine = engine
        self._middleware = middleware
        self.index = topic
        self.key = key
        self._handovers = set() if handovers is None else handovers

    def open(self, subscription: RclSubscription) -> Receiver:
        return EngineReceiver(
            self._engine, self._middleware, subscription, self.index, self.key)

    def begin_handover(self, *, has_history: bool) -> None:
        self._handovers.add(self)
        self._engine.begin_handover(self.index, has_history=has_history)

    def end_handover(self) -> None:
        self._handovers.discard(self)
        if not self._handovers:
            self._engine.end_handover(self.index)

    @property
    def lost(self) -> int:
        return self._engine.lost(self.index)


class Announcer(native_lifetimes.NativeThread):
    """
    Publishes the violations, the locks and the margins of an engine, in a thread of C.

    The thread also waits for the engine's deadlines.
    """

    def __init__(self, engine: Engine, middleware: Middleware,
                 publishers: Sequence[RclPublisher], table: ReportTable,
                 locks: Sequence[RclPublisher] = (), margins: Sequence[RclPublisher] = ()) -> None:
        """
        Start the thread, before messages are delivered; raises `Unavailable`.

        There is one of `publishers`, of std_msgs/msg/Empty, for each requirement. `locks`, of
        std_msgs/msg/Bool, are those of the table. `margins` are as many as `publishers`, of
        std_msgs/msg/Float64, or none.
        """
        super().__init__('announcer', engine)
        self._kept = middleware, table
        with self._starting((*publishers, *margins, *locks)):
            settings = ffi.new('struct fm_lock[]', [
                (middleware.handle(publisher), lock.requirements, lock.n_requirements,
                 lock.period)
                for publisher, lock in zip(locks, table.pointer.locks[0:len(locks)])])
            self._start(
                engine.pointer, middleware.functions,
                middleware.handles(publishers), len(publishers), settings, len(locks),
                middleware.handles(margins) if margins else ffi.NULL)


class VerdictThread(native_lifetimes.NativeThread):
    """Publishes the verdicts of an engine (`copilot/verdict/ID`), in a thread of C."""

    def __init__(self, engine: Engine, middleware: Middleware,
                 publishers: Sequence[RclPublisher]) -> None:
        """Start the thread, before messages are delivered; raises `Unavailable`."""
        super().__init__('verdict_thread', engine)
        self._middleware = middleware
        with self._starting(publishers):
            self._start(engine.pointer, middleware.functions,
                        middleware.handles(publishers), len(publishers))
