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

"""Refusals of what is in the wrong place: a time behind its condition, a rate in a formula."""

from typing import NoReturn

from fret_monitor.model.diagnostics import refuse, Span

_NUMBERS_LAST = frozenset({'changeOver', 'maxOver', 'meanOver', 'minOver', 'sumOver'})
TIMES_FIRST = frozenset({'countOver', 'occurred', 'persisted', 'timeOver', *_NUMBERS_LAST})
"""The functions whose first argument is a count or a time."""


def refuse_time_last(function: str, first: str, time: Span) -> NoReturn:
    """Refuse a time as the last argument of a function that takes it first."""
    kind, usual = ('number', 'x') if function in _NUMBERS_LAST else ('condition', 'p')
    last = usual if first[:1].isdecimal() else ' '.join(first.split())
    refuse('a time cannot be used here', time, f'the {kind} stands here',
           f'the time comes first: {function}({time.written}, {last})')


def refuse_measure(time: Span) -> NoReturn:
    """Refuse `rate(5 s)` in a formula; `time` is its argument."""
    refuse("'rate' is the field of an input, and no part of a formula", time, 'a rate',
           'declare an input, such as\n'
           f'hz: {{topic: scan, type: sensor_msgs/msg/LaserScan, field: rate({time.written}), '
           'max_rate: 100}')
