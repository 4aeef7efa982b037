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
The hot path: messages that cost no Python (DESIGN 8).

rclpy makes the subscriptions and publishers; C in `csrc/hot_path.c` takes the messages on their
handles, in the middleware's own threads, and publishes the handlers in a thread of its own. What C
calls of the middleware is found here, by name, in the libraries that rclpy has loaded.
"""

from collections.abc import Collection, Sequence
from contextlib import ExitStack
import ctypes
from dataclasses import dataclass
from threading import Lock
from typing import Any

from fret_monitor.native.binding import ffi
from fret_monitor.ros import native_lifetimes
from fret_monitor.ros.rcl_subscription import RclSubscription
from fret_monitor.runtime.shared_evaluator import SharedEvaluator

from rclpy.publisher import Publisher
from rclpy.type_support import check_for_type_support
from rclpy.utilities import get_rmw_implementation_identifier

PROVEN = ('rmw_fastrtps_cpp',)
"""The middlewares whose new-message callback is known to bear taking from it."""

_LAZY, _ALREADY_LOADED = 1, 4  # RTLD_LAZY, RTLD_NOLOAD
_C_LIBRARY: Any = ffi.dlopen(None)


# FastBuffer(char *, size_t) and Cdr(FastBuffer &, Endianness, CdrVersion) of Fast CDR
_MAKE_BUFFER = '_ZN8eprosima7fastcdr10FastBufferC1EPcm'
_MAKE_CDR = '_ZN8eprosima7fastcdr3CdrC1ERNS0_10FastBufferENS1_10EndiannessENS0_10CdrVersionE'

_capsule_pointer = ctypes.pythonapi.PyCapsule_GetPointer
_capsule_pointer.restype = ctypes.c_void_p
_capsule_pointer.argtypes = (ctypes.py_object, ctypes.c_char_p)
_new_capsule = ctypes.pythonapi.PyCapsule_New
_new_capsule.restype = ctypes.py_object
_new_capsule.argtypes = (ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p)


class Unavailable(Exception):
    """What the hot path needs is not there; the text says what."""


@dataclass(frozen=True)
class _InPlaceClass:
    """A class of messages that are read in place, and the type support that it stands for."""

    message_class: Any
    support: Any


_IN_PLACE: dict[Any, _InPlaceClass] = {}


class Middleware:
    """The functions of the middleware, as C calls them."""

    def __init__(self) -> None:
        """
        Find them.

        Raises
        ------
        Unavailable
            if one of them is not there.
        """
        rmw = _loaded('librmw_implementation.so', f'lib{get_rmw_implementation_identifier()}.so')
        rcl, rcutils = _loaded('librcl.so'), _loaded('librcutils.so')
        self.functions: Any = ffi.new('struct fm_middleware *')
        for field, source, name in (
                ('take', rmw, 'rmw_take_serialized_message_with_info'),
                ('listen', rmw, 'rmw_subscription_set_on_new_message_callback'),
                ('publish', rmw, 'rmw_publish'),
                ('forget_error', rcutils, 'rcutils_reset_error'),
                ('has_error', rcutils, 'rcutils_error_is_set')):
            kind = ffi.typeof(getattr(self.functions, field))
            setattr(self.functions, field, ffi.cast(kind, _symbol(source, name)))
        self._of_subscription = ffi.cast('void * (*)(void *)', _symbol(
            rcl, 'rcl_subscription_get_rmw_handle'))
        self._of_publisher = ffi.cast('void * (*)(void *)', _symbol(
            rcl, 'rcl_publisher_get_rmw_handle'))
        self.clock_now = ffi.cast('int (*)(void *, int64_t *)', _symbol(
            rcl, 'rcl_clock_get_now'))

    def read_in_place(self, library: Any) -> None:
        """
        Let subscriptions be read where the middleware has their messages, not in a copy.

        `library` holds the functions of csrc.

        Raises
        ------
        Unavailable
            if the middleware is not Fast DDS, or not as expected.
        """
        name = get_rmw_implementation_identifier()
        if name != 'rmw_fastrtps_cpp':
            raise Unavailable(f'{name} is not rmw_fastrtps_cpp')
        cdr = _loaded('libfastcdr.so.2')
        make_buffer = ffi.cast('void (*)(void *, char *, size_t)', _symbol(cdr, _MAKE_BUFFER))
        make_cdr = ffi.cast('void (*)(void *, void *, int, int)', _symbol(cdr, _MAKE_CDR))
        if not library.fm_in_place_find(make_buffer, make_cdr, ffi.addressof(
                self.functions, 'in_place')):
            raise Unavailable('objects of Fast CDR are not as expected')
        self._make_type = library.fm_in_place_make
        kind = ffi.typeof(self.functions.take_message)
        self.functions.take_message = ffi.cast(kind, _symbol(
            _loaded('librmw_implementation.so', f'lib{name}.so'), 'rmw_take_with_info'))

    @property
    def in_place_classes(self) -> Collection[Any]:
        """What `class_in_place` returned so far, to anybody."""
        return [item.message_class for item in _IN_PLACE.values()]

    @property
    def reads_in_place(self) -> bool:
        """Whether `read_in_place` was called with success."""
        return bool(self.functions.take_message != ffi.NULL)

    def class_in_place(self, message_class: Any) -> Any:
        """
        Return a class for subscriptions that are read in place.

        It is one for `create_subscription` alone. What is made for it stays as long as the
        process: the middleware keeps pointers to it for as long as it likes.
        """
        if message_class not in _IN_PLACE:
            _IN_PLACE[message_class] = self._make_class(message_class)
        return _IN_PLACE[message_class].message_class

    def _make_class(self, message_class: Any) -> '_InPlaceClass':
        check_for_type_support(message_class)
        capsule = type(message_class)._TYPE_SUPPORT
        original = ffi.cast('struct fm_type_support *', _capsule_pointer(capsule, None))
        support = ffi.new('struct fm_in_place_type *')
        if not self._make_type(original, support):
            raise Unavailable(f'{message_class.__name__} has no type support for Fast DDS')
        made = _new_capsule(int(ffi.cast('uintptr_t', support)), None, None)
        metaclass = type('InPlace', (type(message_class),), {'_TYPE_SUPPORT': made})
        return _InPlaceClass(
            metaclass(message_class.__name__, (), {'__slots__': []}), support)

    def subscription(self, item: RclSubscription) -> Any:
        """Return the middleware's object of a subscription, whose handle is held."""
        return _found(self._of_subscription(ffi.cast('void *', item.handle.pointer)))

    def publisher(self, item: Publisher) -> Any:
        """Return the middleware's object of a publisher, whose handle is held."""
        return _found(self._of_publisher(ffi.cast('void *', item.handle.pointer)))


def find_middleware(*, even_unproven: bool = False) -> Middleware:
    """
    Return what the hot path calls.

    Raises
    ------
    Unavailable
        if the middleware is none of `PROVEN` (unless `even_unproven`), or misses a function.
    """
    name = get_rmw_implementation_identifier()
    if name not in PROVEN and not even_unproven:
        raise Unavailable(f'it is known to work with {", ".join(PROVEN)}, not with {name}')
    return Middleware()


class HotReceiver:
    """One subscription whose messages C delivers to a watch."""

    def __init__(self, watch: SharedEvaluator, middleware: Middleware,
                 subscription: RclSubscription, topic: int) -> None:
        """
        Start delivering; what the subscription holds already comes first.

        Raises
        ------
        Unavailable
            if the middleware has no such callback.
        """
        self._library = watch.library
        self._watch = watch
        self._middleware = middleware
        self._lock = Lock()  # the feed's thread drains, others stop
        self._pointer: Any = ffi.NULL
        with ExitStack() as undo:
            undo.enter_context(subscription.handle)
            native_lifetimes.keep(self)
            self._pointer = self._library.fm_receiver_start(
                watch.pointer, middleware.functions, middleware.subscription(subscription), topic,
                subscription.msg_type in middleware.in_place_classes)
            if self._pointer == ffi.NULL:
                native_lifetimes.release(self)
                raise Unavailable('the middleware tells nobody of new messages')
            self._held = undo.pop_all()

    def drain(self) -> None:
        """Take what is there."""
        with self._lock:
            if self._pointer != ffi.NULL:
                self._library.fm_receiver_drain(self._pointer)

    def poll(self) -> None:
        """See to what is there and was not told of."""
        with self._lock:
            if self._pointer != ffi.NULL:
                self._library.fm_receiver_poll(self._pointer)

    def retire(self) -> None:
        """Another subscription is about to take its place."""
        with self._lock:
            if self._pointer != ffi.NULL:
                self._library.fm_receiver_retire(self._pointer)

    def end(self) -> None:
        """End delivering; twice is once."""
        with self._lock:
            pointer, self._pointer = self._pointer, ffi.NULL
            if pointer != ffi.NULL:
                self._library.fm_receiver_stop(pointer)
        native_lifetimes.release(self)

    def stop(self) -> None:
        """End delivering; the subscription may be destroyed then."""
        self.end()
        self._held.close()


class HotTopic:
    """A topic whose messages C delivers to a watch, by whichever subscription they come."""

    def __init__(self, watch: SharedEvaluator, middleware: Middleware, topic: int) -> None:
        """Deliver as messages of a topic, by its index in the manifest."""
        self._watch = watch
        self._middleware = middleware
        self._topic = topic

    def open(self, subscription: RclSubscription) -> HotReceiver:
        """Begin to take from a subscription; raises `Unavailable`."""
        return HotReceiver(self._watch, self._middleware, subscription, self._topic)

    def begin_handover(self, *, has_history: bool) -> None:
        """From now on a message may come by two subscriptions, and with a history."""
        self._watch.begin_handover(self._topic, has_history=has_history)

    @property
    def lost(self) -> int:
        """Messages that were sent and never came."""
        return self._watch.lost(self._topic)

    def end_handover(self) -> None:
        """There is one subscription again."""
        self._watch.end_handover(self._topic)


class Announcer:
    """The thread in C that publishes the violations of a watch."""

    def __init__(self, watch: SharedEvaluator, middleware: Middleware,
                 publishers: Sequence[Publisher]) -> None:
        """
        Start it; `publishers` of std_msgs/msg/Empty, by requirement.

        Raises
        ------
        Unavailable
            if there can be no thread.
        """
        self._library = watch.library
        self._watch = watch
        self._middleware = middleware
        self._pointer: Any = ffi.NULL
        with ExitStack() as undo:
            for item in publishers:
                undo.enter_context(item.handle)
            found = [middleware.publisher(item) for item in publishers]
            native_lifetimes.keep(self)
            self._pointer = self._library.fm_announcer_start(
                watch.pointer, middleware.functions, ffi.new('void *[]', [*found, ffi.NULL]),
                len(found))
            if self._pointer == ffi.NULL:
                native_lifetimes.release(self)
                raise Unavailable('no thread can be started')
            self._held = undo.pop_all()

    def end(self) -> None:
        """Close the watch, and wait until all is published; twice is once."""
        self._watch.close()
        pointer, self._pointer = self._pointer, ffi.NULL
        if pointer != ffi.NULL:
            self._library.fm_announcer_join(pointer)
        native_lifetimes.release(self)

    def join(self) -> None:
        """Close the watch, and wait until all is published; the publishers may go then."""
        self.end()
        self._held.close()


def _loaded(*names: str) -> Any:
    """Return the first of some libraries, by name, that is loaded."""
    for name in names:
        found = _C_LIBRARY.dlopen(name.encode(), _LAZY | _ALREADY_LOADED)
        if found != ffi.NULL:
            return found
    raise Unavailable(f'{names[0]} is not loaded')


def _symbol(source: Any, name: str) -> Any:
    found = _C_LIBRARY.dlsym(source, name.encode())
    if found == ffi.NULL:
        raise Unavailable(f'the middleware has no {name}')
    return found


def _found(pointer: Any) -> Any:
    if pointer == ffi.NULL:
        raise Unavailable('a handle leads nowhere')
    return pointer
