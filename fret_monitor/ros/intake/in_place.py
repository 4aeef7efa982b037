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
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fret_monitor.native.binding import ffi
from fret_monitor.ros.intake.symbols import find_symbol, loaded_library, Unavailable

from rclpy.type_support import check_for_type_support
from rclpy.utilities import get_rmw_implementation_identifier

# FastBuffer(char *, size_t) and Cdr(FastBuffer &, Endianness, CdrVersion) of Fast CDR
_MAKE_BUFFER = '_ZN8eprosima7fastcdr10FastBufferC1EPcm'
_MAKE_CDR = '_ZN8eprosima7fastcdr3CdrC1ERNS0_10FastBufferENS1_10EndiannessENS0_10CdrVersionE'
_MAPS = Path('/proc/self/maps')

capsule_pointer = ctypes.pythonapi.PyCapsule_GetPointer
capsule_pointer.restype = ctypes.c_void_p
capsule_pointer.argtypes = (ctypes.py_object, ctypes.c_char_p)
_new_capsule = ctypes.pythonapi.PyCapsule_New
_new_capsule.restype = ctypes.py_object
_new_capsule.argtypes = (ctypes.c_void_p, ctypes.c_char_p, ctypes.c_void_p)


@dataclass(frozen=True)
class _InPlaceClass:
    """A class whose messages are read in place, and the type support made for it."""

    message_class: Any
    support: Any


# Never freed, since the middleware keeps pointers to a type support.
_MADE: dict[Any, _InPlaceClass] = {}


class InPlaceTypes:
    """Makes classes to subscribe with, whose messages C reads in place."""

    def __init__(self, library: Any, functions: Any) -> None:
        """
        Prepare `functions`, a `struct fm_middleware *`; `library` holds the functions of csrc.

        Raises
        ------
        Unavailable
            if the middleware is not Fast DDS of a known version, or has another layout.
        """
        name = get_rmw_implementation_identifier()
        if name != 'rmw_fastrtps_cpp':
            raise Unavailable(f'{name} is not rmw_fastrtps_cpp')
        why = ffi.new('char[]', 256)
        if not library.fm_in_place_is_known(_loaded(), why, len(why)):
            reason: Any = ffi.string(why)
            raise Unavailable(reason.decode(errors='replace'))
        cdr = loaded_library('libfastcdr.so.2')
        make_buffer = find_symbol(cdr, _MAKE_BUFFER, 'void (*)(void *, char *, size_t)')
        make_cdr = find_symbol(cdr, _MAKE_CDR, 'void (*)(void *, void *, int, int)')
        if not library.fm_in_place_find(
                make_buffer, make_cdr, ffi.addressof(functions, 'in_place')):
            raise Unavailable('objects of Fast CDR are not as expected')
        self._make_type = library.fm_in_place_make
        functions.take_message = find_symbol(
            loaded_library('librmw_implementation.so', f'lib{name}.so'), 'rmw_take_with_info',
            ffi.typeof(functions.take_message))

    def subscription_class(self, message_class: Any) -> Any:
        """
        Return a class to subscribe with instead of the message's own.

        Raises
        ------
        Unavailable
            if the message has no type support for Fast DDS.
        """
        if message_class not in _MADE:
            _MADE[message_class] = self._make_class(message_class)
        return _MADE[message_class].message_class

    def is_in_place(self, message_class: Any) -> bool:
        """Whether `subscription_class` has made this class."""
        return any(made.message_class is message_class for made in _MADE.values())

    def _make_class(self, message_class: Any) -> _InPlaceClass:
        check_for_type_support(message_class)
        capsule = type(message_class)._TYPE_SUPPORT
        original = ffi.cast('struct fm_type_support *', capsule_pointer(capsule, None))
        support = ffi.new('struct fm_in_place_type *')
        if not self._make_type(original, support):
            raise Unavailable(f'{message_class.__name__} has no type support for Fast DDS')
        made = _new_capsule(int(ffi.cast('uintptr_t', support)), None, None)
        metaclass = type('InPlace', (type(message_class),), {'_TYPE_SUPPORT': made})
        return _InPlaceClass(
            metaclass(message_class.__name__, (), {'__slots__': []}), support)


def _loaded() -> bytes:
    """Return what `/proc/self/maps` says is loaded."""
    try:
        return _MAPS.read_bytes()
    except OSError:
        return b''
