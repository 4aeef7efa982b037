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

"""A serialized message that contains the key of an instance (csrc/engine/schedule.h)."""

from dataclasses import dataclass
from enum import Enum


class PartKind(Enum):
    """What a part of a payload is."""

    BYTES = 'bytes'
    LENGTH = 'length'
    KEY = 'key'
    NUMBER = 'number'


@dataclass(frozen=True)
class PayloadPart:
    """
    A part of a payload: of bytes, the length of a text, a key, or a key as a whole number.

    `align`: of bytes and numbers, to so many after the header of four bytes. `at`: of bytes, where
    they are in the payload. `size`: of bytes and numbers; of a length, that of what is no key,
    with the zero at its end. `keys`: the instance variables (indices) of a key or a number: one;
    of a length, of the keys in the text.
    """

    kind: PartKind
    align: int = 1
    at: int = 0
    size: int = 0
    keys: tuple[int, ...] = ()
