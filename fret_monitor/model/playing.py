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

"""How a trace is played as messages: stamps, and inputs that must not fall silent."""

from collections.abc import Iterable
import math

from fret_monitor.model.times import NANOSECONDS

_INT32 = 2**31


def repeat_interval(timeouts: Iterable[float | None]) -> int | None:
    """Return after how many nanoseconds inputs with timeouts are published again; None: never."""
    seconds = min((item for item in timeouts if item is not None), default=None)
    # A third: one message may come late. The node takes more than half at once for a jump.
    return None if seconds is None else max(1, int(seconds * NANOSECONDS['s']) // 3)


def stamp_of(seconds: float) -> tuple[int, int] | None:
    """Return `sec` and `nanosec` of a stamp that is read as this time; None if there is none."""
    if not -_INT32 <= seconds < _INT32:
        return None
    whole = math.floor(seconds)
    rest = round((seconds - whole) * NANOSECONDS['s'])
    return (whole, rest) if rest < NANOSECONDS['s'] and whole + rest * 1e-9 == seconds else None
