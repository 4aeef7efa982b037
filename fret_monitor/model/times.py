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

"""Times in texts, exact and with the unit that makes them short."""

from datetime import datetime, timedelta
from fractions import Fraction

from fret_monitor.model.diagnostics import counted

NANOSECONDS = {
    's': 1_000_000_000, 'ms': 1_000_000, 'us': 1000, 'ns': 1, 'min': 60_000_000_000,
    'h': 3_600_000_000_000,
}
"""How long the units are; where two make a text of one length, the first is used."""

LONGEST_NS = 2 ** 62
"""The longest time in a bound; sums of two fit into 64 bits."""

_PLACES = 18  # more than the decimals of any whole number of nanoseconds in hours that ends


def time_text(nanoseconds: int) -> str:
    """Return the shortest exact text of a time, such as `2.5 s`, `500 us`, `-20 ms`; `0` for 0."""
    if nanoseconds == 0:
        return '0'
    texts = (_in_unit(nanoseconds, unit) for unit in NANOSECONDS)
    return min((text for text in texts if text), key=len)


def iso_time(nanoseconds: int) -> str:
    """Return a time since 1970 as ISO 8601 in UTC, exactly; in seconds if it has no such date."""
    whole, rest = divmod(nanoseconds, NANOSECONDS['s'])
    try:
        date = datetime(1970, 1, 1) + timedelta(seconds=whole)
    except OverflowError:
        return f'{whole}.{rest:09d}'
    return f'{date.isoformat()}.{rest:09d}Z'


def seconds(nanoseconds: int) -> str:
    """Return a time in seconds, exactly, with nine decimals."""
    whole, rest = divmod(abs(nanoseconds), 10**9)
    return f"{'-' if nanoseconds < 0 else ''}{whole}.{rest:09d}"


def short_seconds(nanoseconds: int) -> str:
    """Return a time in seconds, exactly, without zeros at its end."""
    return seconds(nanoseconds).rstrip('0').rstrip('.')


def known_text(horizon: int, *, is_timed: bool) -> str:
    """Return when the verdict of a requirement that looks ahead is known."""
    late = time_text(horizon) if is_timed else f'{horizon:,} step{"" if horizon == 1 else "s"}'
    return (f'{late} later: a verdict is about what was {late} before, and true until there is '
            f'such a {"time" if is_timed else "step"}')


def overflow_text(changes: int) -> str:
    """Return a line about changes that found no room in a window."""
    return (f'{counted(changes, "change")} came faster than max_rate says: what reads the window '
            'is violated until they have left it')


def _in_unit(nanoseconds: int, unit: str) -> str:
    """Return a time in a unit; '' if it has no exact decimal there."""
    scaled = Fraction(abs(nanoseconds) * 10 ** _PLACES, NANOSECONDS[unit])
    if scaled.denominator != 1:
        return ''
    digits = f'{scaled.numerator:0{_PLACES + 1}d}'
    number = f'{digits[:-_PLACES]}.{digits[-_PLACES:]}'.rstrip('0').rstrip('.')
    return f'{"-" if nanoseconds < 0 else ""}{number} {unit}'
