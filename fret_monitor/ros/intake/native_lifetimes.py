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
Keeps native objects alive until the threads that use them have stopped.

After an interrupt the garbage collector may get an object that is half created or half closed.
Memory that a thread of C or of the middleware still uses must not be freed then, so this module
refers to it. At exit it stops the remaining threads and callbacks, but destroys no rclpy objects.
"""

import atexit
from contextlib import suppress
import ctypes
from typing import Protocol


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


def keep_forever(user: NativeUser) -> None:
    """Keep an object that could not be ended, even while Python clears its modules at exit."""
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(user))


@atexit.register
def _end_all() -> None:
    for user in reversed(list(_KEPT.values())):
        with suppress(Exception):
            user.end()
