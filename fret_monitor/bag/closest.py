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
Which of several recordings came closest to violating each requirement.

It takes the lines of JSON of the recordings, so that those that were checked before count alike.
"""

from collections.abc import Iterable, Mapping
import json
from typing import Any

from fret_monitor.bag.results import aligned, by_text, shown_text
from fret_monitor.model.diagnostics import counted

_MOST_SHOWN = 5  # recordings of a requirement
_HEADS = ('requirement', 'recording', 'closest', 'at', 'by')


def closest_table(lines: Iterable[str]) -> str:
    """Return the worst recordings of each requirement for a terminal; '' without margins."""
    found: dict[str, list[tuple[str, Mapping[str, Any]]]] = {}
    count = 0
    for content in map(json.loads, lines):
        count += 1
        for name, item in content['requirements'].items():
            if 'closest' in item:
                found.setdefault(name, []).append((content['bag'], item['closest']))
    rows = [_row(name, *item) for name, items in found.items() for item in sorted(
        items, key=lambda item: float(item[1]['margin']))[:_MOST_SHOWN]]
    if not rows:
        return ''
    widths = [max(len(row[column]) for row in (_HEADS, *rows)) for column in range(len(_HEADS))]
    return '\n'.join([f'closest, over {counted(count, "recording")}:',
                      *(aligned(row, widths) for row in (_HEADS, *rows))])


def _row(name: str, bag: str, closest: Mapping[str, Any]) -> tuple[str, ...]:
    return (shown_text(name), shown_text(bag), f'{closest["margin"]:.6g}', str(closest['at']),
            by_text(closest['comparison'], closest['distance']))
