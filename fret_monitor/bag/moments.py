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

"""Moments of a recording, as the command line takes them: `12.5`, `end-3`, `1732270000.5`."""

from dataclasses import dataclass
from decimal import Decimal
from enum import Enum
import re

LAST_TIME = 92 * 10**17
"""The last time of a message (ns since 1970, in 2261); later ones could not be counted from."""

_FIRST_EPOCH_S = 1_000_000_000  # numbers from here on are seconds since 1970, smaller ones are not
_NANOSECONDS = 10**9
_TEXT = re.compile(r'(?:(start|end)(?:([+-])(\d+(?:\.\d{1,9})?))?|(\d+(?:\.\d{1,9})?))')


class Anchor(Enum):
    """What a moment is counted from."""

    EPOCH = ''
    START = 'start'
    END = 'end'


@dataclass(frozen=True)
class Moment:
    """A moment of a recording: nanoseconds from an anchor."""

    anchor: Anchor
    offset: int

    @classmethod
    def parse(cls, text: str) -> 'Moment':
        """
        Read a moment: `S`, `start+S`, `end`, `end-S`, `end+S`, in seconds.

        A plain number is counted from the start; from 1000000000 on, since 1970.

        Raises
        ------
        ValueError
            if it is none.
        """
        match = _TEXT.fullmatch(text.strip())
        if match is None:
            raise ValueError('write seconds since the start, such as 12.5, seconds since 1970, '
                             'or end-3')
        anchor, sign, span, plain = match.groups()
        offset = int(Decimal(span or plain or 0) * _NANOSECONDS)
        if offset >= 2**62:
            raise ValueError('that is too far away')
        if anchor is None:
            is_epoch = offset >= _FIRST_EPOCH_S * _NANOSECONDS
            return cls(Anchor.EPOCH if is_epoch else Anchor.START, offset)
        return cls(Anchor(anchor), -offset if sign == '-' else offset)

    def in_recording(self, start: int, end: int) -> int:
        """Return the moment as the time of a recording that begins and ends then (ns)."""
        return {Anchor.EPOCH: 0, Anchor.START: start, Anchor.END: end}[self.anchor] + self.offset
