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

from collections.abc import Callable
from fractions import Fraction
import math
import re

from fret_monitor.model.diagnostics import Diagnostic, did_you_mean, Level, refuse, Text
from fret_monitor.model.names import PLACEHOLDER, shown
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


def read_part(text: Text, line: Callable[[str], str]) -> ArrayPart | None:
    """
    Read the text between two brackets; None if it is nothing of the kind.

    `line` returns the line to paste with another text between the brackets.

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
        return _look_up(text, found, line)
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


def _look_up(text: Text, found: re.Match[str], line: Callable[[str], str]) -> LookUp:
    key, name = found['key'], found['name']
    place = text.at(*found.span('name'))
    if not name:
        refuse('a name is missing after the =', place, 'the name to look for',
               f'{line(f"{key} = NAME")}, with the name for NAME')
    if variable := PLACEHOLDER.fullmatch(name):
        return LookUp(tuple(key.split('.')), '', variable=variable[1])
    quoted = _QUOTED.fullmatch(name)
    bare = name.strip('"\'')
    if quoted is None and name_as_written(name) != name:
        has_apostrophes = name.strip('"').startswith("'")
        refuse('a name to look up has no apostrophes' if has_apostrophes
               else f'{shown(name)} must be in quotes', place,
               'they would be part of the name' if has_apostrophes else 'the name to look for',
               line(f'{key} = {name_as_written(bare)}'))
    if found['equals'] != '=':
        refuse("a look-up has one '='", text.at(*found.span('equals')), 'one too many',
               line(f'{key} = {name}'))
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


def doubt_sector(text: Text) -> Diagnostic | None:
    """
    Return a warning if a sector, given as written, may be one with its angles exchanged.

    Such a sector is wider than half a turn, and its first angle is the greater one. With a whole
    turn added to the second angle it is the same sector, without a warning.
    """
    angles = [match for end in text.value.split(':') if (match := _ANGLE.fullmatch(end))]
    first, second = (Fraction(angle[1]) * _TURNS[angle[2]] for angle in angles)
    width = (second - first) % 1
    if first < second or width <= Fraction(1, 2):
        return None
    start, stop = (f'{angle[1]} {angle[2]}' for angle in angles)
    turn, unit = second + 1, angles[1][2]
    same = f'{float(turn / _TURNS[unit]):.5g} {unit}'
    return Diagnostic(
        f'this sector is {_degrees(width)} wide: counter-clockwise from {start} to {stop}',
        text.span, 'the first angle is the greater one',
        f'[{stop} : {start}] is the {_degrees(1 - width)} between them; '
        f'write [{start} : {same}] if the {_degrees(width)} are meant', Level.WARNING)


def _degrees(turns: Fraction) -> str:
    return f'{float(turns) * 360:.4g} degrees'
