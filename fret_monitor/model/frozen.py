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
Frozen dataclasses that are compiled when the first instance is made.

`dataclass` compiles six methods of each class, and half of the classes that a node imports have
no instance at its start (docs/design.md has what this saves).
"""

from dataclasses import dataclass, field
from threading import Lock
from typing import Any, dataclass_transform

_LOCK = Lock()


@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def frozen[T](cls: type[T]) -> type[T]:
    """
    Return the class as `dataclass(frozen=True)` would, compiled with its first instance.

    Until then it has no fields, so that no dataclass can derive from it.
    """
    is_complete = False

    def new(made: type[T], *_: Any, **__: Any) -> T:
        nonlocal is_complete
        if not is_complete:
            with _LOCK:
                if not is_complete:
                    dataclass(frozen=True)(cls)
                    is_complete = True
        return object.__new__(made)

    cls.__new__ = new  # type: ignore[method-assign, assignment]
    return cls
