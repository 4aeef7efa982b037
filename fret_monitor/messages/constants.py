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

"""The constants of a message, as names for the values of one of its fields."""

from collections import Counter
from dataclasses import dataclass

from fret_monitor.messages.layout import MessageConstant, MessageField, MessageLayout

NamedValues = tuple[tuple[str, int | str], ...]


@dataclass(frozen=True)
class FieldConstants:
    """
    The constants that a field may be compared with: those of its type in its message.

    Messages do not say to which field a constant belongs. `own` are those that are known to be the
    field's: by a prefix, as in STATUS_OK for `status`, or since no other field has the type.
    `strangers` are those with the prefix of another field, each with that field.
    """

    field: str = ''
    all: NamedValues = ()
    own: NamedValues = ()
    strangers: tuple[tuple[str, str], ...] = ()


NO_CONSTANTS = FieldConstants()


def constants_of(layout: MessageLayout, item: MessageField) -> FieldConstants:
    """Return the constants for a field of a message: whole numbers or strings."""
    kind = _kind(item.type.base)
    if kind != 'string' and 'int' not in kind or item.type.is_message:
        return NO_CONSTANTS
    found = tuple((constant.name, value) for constant in layout.constants
                  if _kind(constant.type.base) == kind
                  and (value := _value(constant)) is not None)
    owners = {name: _owner(layout, name) for name, _ in found}
    is_only = [_kind(other.type.base) for other in layout.fields].count(kind) == 1
    times = Counter(value for name, value in found if owners[name] in (None, item.name))
    own = tuple((name, value) for name, value in found if owners[name] == item.name
                or is_only and owners[name] is None and times[value] == 1)
    strangers = tuple((name, owner) for name, owner in owners.items()
                      if owner not in (None, item.name))
    return FieldConstants(item.name, found, own, strangers)


def _kind(base: str) -> str:
    return 'uint8' if base in ('byte', 'char') else base


def _value(constant: MessageConstant) -> int | str | None:
    """Return the value of a constant; None unless it is a string or a whole number."""
    text = constant.value
    if constant.type.base == 'string':
        quoted = len(text) > 1 and text[0] == text[-1] and text[0] in '"\''
        return text[1:-1] if quoted else text
    try:
        return int(text, 0)
    except ValueError:
        return None


def _owner(layout: MessageLayout, name: str) -> str | None:
    """Return the field whose name a constant has as its prefix: the longest."""
    fits = [item.name for item in layout.fields if name.startswith(f'{item.name.upper()}_')]
    return max(fits, key=len, default=None)
