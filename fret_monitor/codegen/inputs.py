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

"""Inputs as the manifest has them, and what each is in the bundle's terms."""

from math import isfinite
from struct import pack

from fret_monitor.logic.specification import Signal
from fret_monitor.model.manifest import ManifestInput, SECONDS
from fret_monitor.model.paths import path_text
from fret_monitor.model.policies import InputSource
from fret_monitor.model.times import time_text
from fret_monitor.model.values import ValueType


def described_input(signal: Signal) -> ManifestInput:
    """Return an input as the manifest has it."""
    return ManifestInput(signal.name, signal.type, signal.topic, signal.message_type,
                         signal.path, signal.values, signal.initial,
                         timeout=signal.timeout, stale=signal.stale,
                         startup=signal.startup,
                         reduction=signal.reduction, source=signal.source,
                         window=signal.window, room=signal.room)


def origin(item: ManifestInput) -> str:
    """Return name and meaning of an input, as text for a comment."""
    return ': '.join(filter(None, (item.name, meaning(item))))


def meaning(item: ManifestInput) -> str:
    """Return what an input is in the bundle's terms, on one line; '' if it only has a type."""
    parts = [_field(item)]
    is_string = item.is_string  # looks at all values
    if item.values:
        parts.append('values ' + ', '.join(
            f'{word} = {place if is_string else value}'
            + (f' ("{value}")' if is_string else '')
            for place, (word, value) in enumerate(item.values)))
    if item.initial is not None:
        parts.append(f'initial {number_text(item)}')
    elif is_string:
        parts.append(f'0 ({item.values[0][0]}) also before any value came')
    return '; '.join(filter(None, parts))


def _field(item: ManifestInput) -> str:
    """Return what an input is taken from, such as `min(ranges) of TYPE on /scan`."""
    of = f' of {item.message_type}' if item.message_type else ''
    on = f'{of} on {item.topic}' if item.topic else of
    match item.source:
        case InputSource.INSTANCES:
            return 'over all instances'
        case InputSource.RECEIVED:
            return f'received(){on}, true at the step of such a message alone'
        case InputSource.AGE:
            return f'age({path_text(item.path)}){on}, in seconds'
        case InputSource.RATE:
            return f'rate({time_text(item.window)}){on}, in messages a second'
        case InputSource.PERIOD:
            return f'period(){on}, in seconds'
        case InputSource.TIME:
            return f'when the last message{on} was received, in nanoseconds'
        case InputSource.FIELD:
            seconds = ', in seconds' if item.reduction == SECONDS else ''
            return f'{item.field}{on}{seconds}'.strip()


def number_text(item: ManifestInput) -> str:
    """Return the initial value of an input as C has it."""
    assert item.initial is not None
    if item.value_type is ValueType.BOOL:
        return str(bool(item.initial)).lower()
    if not item.value_type.is_float:
        return str(int(item.initial))
    if item.value_type is not ValueType.FLOAT32 or not isfinite(item.initial):
        return repr(float(item.initial)).removesuffix('.0')
    stored = pack('f', item.initial)
    texts = (f'{item.initial:.{digits}g}' for digits in range(6, 10))
    return next(text for text in texts if pack('f', float(text)) == stored)
