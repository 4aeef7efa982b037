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

"""Functions of libraries that the process has loaded already, found by name."""

from typing import Any

from fret_monitor.native.binding import ffi

_LAZY, _ALREADY_LOADED = 1, 4  # RTLD_LAZY, RTLD_NOLOAD
_C_LIBRARY: Any = ffi.dlopen(None)


class Unavailable(Exception):
    """Something that the hot path needs is missing; the text names it."""


def loaded_library(*names: str) -> Any:
    """Return the handle of the first library that is loaded; raises `Unavailable` if none is."""
    for name in names:
        found = _C_LIBRARY.dlopen(name.encode(), _LAZY | _ALREADY_LOADED)
        if found != ffi.NULL:
            return found
    raise Unavailable(f'{names[0]} is not loaded')


def find_symbol(library: Any, name: str, kind: Any) -> Any:
    """Return a function of a loaded library, as a pointer of a type; raises `Unavailable`."""
    found = _C_LIBRARY.dlsym(library, name.encode())
    if found == ffi.NULL:
        raise Unavailable(f'the middleware has no {name}')
    return ffi.cast(kind, found)
