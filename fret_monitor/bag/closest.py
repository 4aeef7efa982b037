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
Which of several recordings came closest to violating each requirement, by margin and slack.

It takes the lines of JSON of the recordings, so that those that were checked before count alike.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
import json
from typing import Any

from fret_monitor.bag.results import aligned, by_text
from fret_monitor.model.diagnostics import counted, printable

_MOST_SHOWN = 5  # recordings of a requirement


def closest_table(lines: Iterable[str]) -> str:
    """Return the worst recordings of each requirement for a terminal; '' without margins."""
    contents = [json.loads(line) for line in lines]
    tables = (_ranking(contents, 'closest', 'margin', ('at', 'by'), _closest_cells),
              _ranking(contents, 'slack', 'left', ('trigger', 'until'), _slack_cells))
    return '\n'.join(table for table in tables if table)


def _ranking(contents: Sequence[Mapping[str, Any]], key: str, least: str, heads: tuple[str, ...],
             cells: Callable[[Mapping[str, Any]], tuple[str, ...]]) -> str:
    """Return what is under a key of requirements, the least first; '' if it is nowhere."""
    found: dict[str, list[tuple[str, Mapping[str, Any]]]] = {}
    for content in contents:
        for name, item in content['requirements'].items():
            if key in item:
                found.setdefault(name, []).append((content['bag'], item[key]))
    rows = [('requirement', 'recording', key, *heads)]
    rows += [(printable(name), printable(bag), *cells(item))
             for name, items in found.items() for bag, item in sorted(
                 items, key=lambda item: float(item[1][least]))[:_MOST_SHOWN]]
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return '\n'.join([f'{key}, over {counted(len(contents), "recording")}:',
                      *(aligned(row, widths) for row in rows)]) if found else ''


def _closest_cells(found: Mapping[str, Any]) -> tuple[str, ...]:
    return (f'{found["margin"]:.6g}', str(found['at']),
            by_text(found['comparison'], found['distance'], found.get('key', '')))


def _slack_cells(found: Mapping[str, Any]) -> tuple[str, ...]:
    of = f' of {printable(found["key"])}' if 'key' in found else ''
    return (f'{found["left"]:.6g} {found["unit"]}{of}', str(found['trigger']),
            str(found['until'] or '-'))
