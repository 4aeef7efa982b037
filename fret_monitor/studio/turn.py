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
What a page shows of a running monitor, collected until it is sent: always bounded.

A value of an input is sampled: the last one of each turn. Of a verdict that changes often, some
changes of a turn are left out, but never both a change and its contrary. Times are in
milliseconds since the epoch, as in JavaScript.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
import math
from threading import Lock
from typing import Any, TypeAlias

Shown: TypeAlias = bool | int | float | str | None

MOST_CHANGES = 4  # of one verdict, in a turn
MOST_OCCURRENCES = 50  # in a turn; more are counted


@dataclass
class Turn:
    """What is new since the last message to the page; may be filled by several threads."""

    verdicts: dict[str, list[tuple[int, bool | None]]] = field(default_factory=dict)
    values: dict[str, tuple[int, Shown]] = field(default_factory=dict)
    occurrences: list[Mapping[str, Any]] = field(default_factory=list)
    left_out: int = 0
    more: dict[str, Any] = field(default_factory=dict)
    _lock: Lock = field(default_factory=Lock)

    def add_verdict(self, requirement: str, time: int, verdict: bool | None) -> None:
        """Add a change of a verdict; None: it is not known any more."""
        with self._lock:
            changes = self.verdicts.setdefault(requirement, [])
            if len(changes) == MOST_CHANGES:
                del changes[-2:]
            changes.append((time, verdict))

    def add_occurrence(self, occurrence: Mapping[str, Any]) -> None:
        """Add a violation, or its end, with its values."""
        with self._lock:
            if len(self.occurrences) < MOST_OCCURRENCES:
                self.occurrences.append(occurrence)
            else:
                self.left_out += 1

    def note(self, **more: Any) -> None:
        """Set what replaces what was there before, such as the health of topics."""
        with self._lock:
            self.more |= more

    def take(self, values: Mapping[str, tuple[int, Shown]]) -> dict[str, Any]:
        """Return what is new with the last values of inputs, and forget it."""
        with self._lock:
            found = {'verdicts': self.verdicts, 'values': dict(values),
                     'occurrences': self.occurrences, 'leftOut': self.left_out, **self.more}
            self.verdicts, self.occurrences, self.left_out, self.more = {}, [], 0, {}
        return {name: item for name, item in found.items() if item or name == 'monitors'}


def shown(value: object) -> Shown:
    """Return a value of a message as JSON has it; a number that is not finite is a text."""
    if isinstance(value, bool | int | str):
        return value
    number = float(value)  # type: ignore[arg-type]  # of numpy, perhaps
    return number if math.isfinite(number) else str(number)


def read_path(message: Any, path: Sequence[str | int]) -> Shown:
    """Return the value at a path; None if the message has no such element."""
    for step in path:
        if isinstance(step, str):
            message = getattr(message, step)
        elif step < len(message):
            message = message[step]
        else:
            return None
    return shown(message)
