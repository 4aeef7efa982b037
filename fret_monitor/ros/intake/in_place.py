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
Let C read messages in the middleware's buffers, without a copy (`csrc/ros/in_place.h`).

This relies on private layouts of Fast DDS and Fast CDR, so it is used with known versions only.
With others, messages are copied before they are read; verdicts are the same.
"""

import ctypes
from typing import Any

from fret_monitor.native import words
from fret_monitor.native.binding import ffi
from fret_monitor.ros.intake.symbols import find_symbol, loaded_library, Unavailable

from rclpy.type_support import check_for_type_support
from rclpy.utilities import get_rmw_implementation_identifier

capsule_pointer = ctypes.pythonapi.PyCapsule_GetPointer
capsule_pointer.restype = ctypes.c_void_p
capsule_pointer.argtypes = (ctypes.py_object, ctypes.c_char_p)
_new_capsule = ctypes.pythonapi.PyCapsule_New
_new_capsule.restype = ctypes.py_object
_new_capsule.argtypes = (ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p)


# By the class of the message: that whose messages are read in place, and the type support made for
# it. They are never freed, since the middleware keeps pointers to a type support.
_MADE: dict[Any, tuple[Any, Any]] = {}


class InPlaceTypes:
    """Makes classes to subscribe with, whose messages C reads in place."""

    def __init__(self, library: Any, functions: Any) -> None:
        """
        Prepare `functions`, a `struct fm_middleware *`; `library` holds the functions of csrc.

        Raises `Unavailable` if the middleware is not Fast DDS of a known version, or has another
        layout.
        """
        name = get_rmw_implementation_identifier()
        why = ffi.new('char[]', 256)
        if not library.fm_in_place_prepare(
                name.encode(), ffi.addressof(functions, 'in_place'), why, len(why)):
            reason: Any = ffi.string(why)
            raise Unavailable(reason.decode(errors='replace'))
        self._make_type = library.fm_in_place_make
        functions.take_message = find_symbol(
            loaded_library('librmw_implementation.so', f'lib{name}.so'), 'rmw_take_with_info',
            ffi.typeof(functions.take_message))

    def subscription_class(self, message_class: Any) -> Any:
        """
        Return a class to subscribe with instead of the message's own.

        Raises `Unavailable` if the message has no type support for Fast DDS.
        """
        if message_class not in _MADE:
            _MADE[message_class] = self._make_class(message_class)
        return _MADE[message_class][0]

    def is_in_place(self, message_class: Any) -> bool:
        return any(made is message_class for made, _ in _MADE.values())

    def _make_class(self, message_class: Any) -> tuple[Any, Any]:
        check_for_type_support(message_class)
        capsule = type(message_class)._TYPE_SUPPORT
        original = ffi.cast('struct fm_type_support *', capsule_pointer(capsule, None))
        support = ffi.new('struct fm_in_place_type *')
        if not self._make_type(original, support):
            raise Unavailable(words.NO_SUPPORT % _type_of(message_class))
        made = _new_capsule(int(ffi.cast('uintptr_t', support)), None, None)
        metaclass = type('InPlace', (type(message_class),), {'_TYPE_SUPPORT': made})
        return metaclass(message_class.__name__, (), {'__slots__': []}), support


def _type_of(message_class: Any) -> str:
    return '/'.join([*message_class.__module__.split('.')[:2], message_class.__name__])
