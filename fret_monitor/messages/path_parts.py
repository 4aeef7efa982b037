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
What stands between the brackets of a field path: index, slice, sector of angles, or look-up.

`read_part` knows nothing of the message; `field_path` checks the result against its array.
"""

from fractions import Fraction
import math
import re

from fret_monitor.model.diagnostics import did_you_mean, refuse, Text
from fret_monitor.model.names import shown
from fret_monitor.model.paths import ArrayPart, LookUp, name_as_written, Sector, Slice

_INDEX = re.compile(r'\s*([0-9]+)\s*')
_END = re.compile(r'\s*(-?[0-9]*)\s*')
_ANGLE = re.compile(
    r'\s*([+-]?(?:[0-9]{1,9}(?:\.[0-9]{0,18})?|\.[0-9]{1,18}))\s*([A-Za-z\xb0]*)\s*')
_KEY = r'[A-Za-z][A-Za-z0-9_]*(?:\.[A-Za-z][A-Za-z0-9_]*)*'
_LOOK_UP = re.compile(rf'\s*(?P<key>{_KEY})\s*(?P<equals>==?)\s*(?P<name>.*?)\s*')
_QUOTED = re.compile(r'"((?:[^"\\]|\\["\\])*)"')
_MOST_DIGITS = 18

_TURNS = {'deg': Fraction(1, 360), 'rad': 1 / Fraction(math.tau)}  # of a unit
_UNITS = {'\xb0': 'deg', 'degree': 'deg', 'degrees': 'deg', 'radian': 'rad', 'radians': 'rad'}


def read_part(text: Text) -> ArrayPart | None:
    """
    Read the text between two brackets; None if it is nothing of the kind.

    Raises
    ------
    CompileError
        if it is nearly right: a slice with a step, a sector without units, a name that needs
        quotes.
    """
    index = _INDEX.fullmatch(text.value)
    if index is not None:
        return _whole(index[1])
    found = _LOOK_UP.fullmatch(text.value)
    if found is not None:
        return _look_up(text, found)
    ends = text.value.split(':')
    if len(ends) < 2:
        return None
    angles = [_ANGLE.fullmatch(end) for end in ends]
    if any(angle and angle[2] for angle in angles):
        return _sector(text, angles)
    wholes = [_END.fullmatch(end) for end in ends]
    if not all(wholes):
        return None
    start, stop = (_end(end[1]) for end in wholes[:2] if end)
    if len(ends) > 2:
        refuse('a slice has no step', text.span, 'a start and a stop only',
               f'write [{Slice(start, stop)}]')
    return Slice(start, stop)


def _whole(digits: str) -> int:
    """Return a number; one of very many digits is larger than all arrays."""
    return int(digits[:1 + _MOST_DIGITS])


def _end(written: str) -> int | None:
    return None if written in ('', '-') else _whole(written)


def _look_up(text: Text, found: re.Match[str]) -> LookUp:
    key, name = found['key'], found['name']
    quoted = _QUOTED.fullmatch(name)
    if quoted is None and name_as_written(name) != name:
        refuse(f'{shown(name)} must be in quotes' if name else 'a name is missing after the =',
               text.at(found.start('name'), max(found.end('name'), found.start('name'))),
               'the name to look for', f'write [{key} = {name_as_written(name.strip(chr(34)))}]')
    if found['equals'] != '=':
        refuse("a look-up has one '='", text.at(*found.span('equals')), 'one too many',
               f'write [{key} = {name}]')
    value = name if quoted is None else re.sub(r'\\(.)', r'\1', quoted[1])
    return LookUp(tuple(key.split('.')), value)


def _sector(text: Text, angles: list[re.Match[str] | None]) -> Sector:
    written = text.value.strip()
    turns = []
    for angle in angles:
        if angle is None or angle[2] not in _TURNS or len(angles) != 2:
            unit = angle[2] if angle else ''
            meant = _UNITS.get(unit.lower())
            refuse('a sector is two angles, each with its unit, deg or rad', text.span,
                   'not a sector', f'write {meant} for {unit}' if meant else
                   (did_you_mean(unit, _TURNS) if unit and unit not in _TURNS else '')
                   or 'such as [-30 deg : 30 deg]')
        turns.append(Fraction(angle[1]) * _TURNS[angle[2]])
    width = turns[1] - turns[0]
    if width in (0, -1):
        refuse('the sector is empty: its ends are the same direction', text.span, '',
               'a whole turn is [-180 deg : 180 deg]')
    if abs(width) > 1:
        refuse('the sector is larger than a full turn', text.span, '',
               'a whole turn is [-180 deg : 180 deg]')
    first = turns[0] - round(turns[0])
    return Sector(float(first) * math.tau, float(width % 1 or 1) * math.tau, written)
