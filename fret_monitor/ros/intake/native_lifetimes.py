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
Threads of C, and what keeps native objects alive until the threads that use them have stopped.

After an interrupt the garbage collector may get an object that is half created or half closed.
Memory that a thread of C or of the middleware still uses must not be freed then, so this module
refers to it. At exit it stops the remaining threads and callbacks, but destroys no rclpy objects.
"""

import atexit
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, ExitStack, suppress
import ctypes
from threading import Lock
from typing import Any, Protocol

from fret_monitor.native import words
from fret_monitor.native.binding import ffi
from fret_monitor.ros.intake.symbols import Unavailable
from fret_monitor.runtime import Engine


class NativeUser(Protocol):
    """Has a thread, or a callback that runs in a thread of the middleware."""

    def end(self) -> None:
        """Stop all use of the native memory; a second call does nothing."""


_KEPT: dict[int, NativeUser] = {}


def keep(user: NativeUser) -> None:
    """Keep an object alive; call this before its thread or callback starts."""
    _KEPT[id(user)] = user


def release(user: NativeUser) -> None:
    """Stop keeping an object whose threads and callbacks have ended."""
    _KEPT.pop(id(user), None)


def keep_forever(user: object) -> None:
    """Keep an object that could not be ended, even while Python clears its modules at exit."""
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(user))


@atexit.register
def _end_all() -> None:
    for user in reversed(list(_KEPT.values())):
        with suppress(Exception):
            user.end()


class NativeThread:
    """A thread of C that works for an engine: the functions `fm_KIND_...` of csrc."""

    def __init__(self, kind: str, engine: Engine) -> None:
        """Prepare; `_starting` and `_start` start the thread."""
        self._library = engine.library
        self._engine = engine
        self._kind = kind
        self._place: Any = ffi.new(f'struct fm_{kind} **')
        self._lock = Lock()  # guards the pointer in `_place`
        self._held = ExitStack()

    def _function(self, name: str) -> Any:
        return getattr(self._library, f'fm_{self._kind}_{name}')

    @contextmanager
    def _starting(self, endpoints: Iterable[Any]) -> Iterator[None]:
        """Hold the handles of endpoints of rclpy; `close` is called if the block fails."""
        with ExitStack() as undo:
            undo.callback(self.close)  # also if a signal interrupts the block
            for item in endpoints:
                self._held.enter_context(item.handle)
            keep(self)
            yield
            undo.pop_all()

    def _start(self, *arguments: Any) -> None:
        """Start the thread, inside `_starting`; raises `Unavailable`."""
        if not self._function('start')(self._place, *arguments):
            raise Unavailable(words.NO_THREAD)

    def _call(self, name: str, *arguments: Any) -> Any:
        """Call a function of the thread; return None if there is no thread any more."""
        with self._lock:
            return None if self._place[0] == ffi.NULL else self._function(name)(
                self._place[0], *arguments)

    @property
    def turns(self) -> int:
        """How often the thread has looked for work: at least twice a second unless it hangs."""
        return int(self._call('turns') or 0)

    def end(self) -> None:
        """Close the engine, and wait until the thread has emptied its queue; idempotent."""
        self._engine.close()
        self._join()
        release(self)

    def close(self) -> None:
        """Do as `end`, and free the memory; afterwards the endpoints may be destroyed."""
        self.end()
        self._join()
        self._held.close()

    def _join(self) -> None:
        with self._lock:
            self._function('join')(self._place)
