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
from dataclasses import dataclass
import json
from typing import Any

from fret_monitor.bag.results import aligned, by_text
from fret_monitor.model.diagnostics import counted, printable

_MOST_SHOWN = 5  # recordings of a requirement


@dataclass(frozen=True)
class Ranking:
    """
    The worst recordings of each requirement, the worst first, by what lines have under a key.

    `worst` are pairs of a recording and what is under the key, by the id of the requirement.
    """

    key: str
    worst: Mapping[str, Sequence[tuple[str, Mapping[str, Any]]]]
    heads: tuple[str, ...]
    cells: Callable[[Mapping[str, Any]], tuple[str, ...]]

    @property
    def rows(self) -> list[tuple[str, ...]]:
        """The heads of a table, and its rows."""
        return [('requirement', 'recording', self.key, *self.heads), *(
            (printable(name), printable(bag), *self.cells(item))
            for name, items in self.worst.items() for bag, item in items)]


def rankings(lines: Iterable[str]) -> list[Ranking]:
    """Return those by margin and by slack that there are."""
    contents = [json.loads(line) for line in lines]
    found = (Ranking('closest', _worst(contents, 'closest', 'margin'), ('at', 'by'),
                     _closest_cells),
             Ranking('slack', _worst(contents, 'slack', 'left'), ('trigger', 'until'),
                     _slack_cells))
    return [item for item in found if item.worst]


def closest_table(found: Iterable[Ranking], count: int) -> str:
    """Return rankings of so many recordings for a terminal."""
    lines: list[str] = []
    for item in found:
        rows = item.rows
        widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
        lines += [f'{item.key}, over {counted(count, "recording")}:',
                  *(aligned(row, widths) for row in rows)]
    return '\n'.join(lines)


def closest_json(found: Iterable[Ranking], count: int) -> str:
    """Return rankings of so many recordings as a line of JSON."""
    return json.dumps({'bags': count, **{item.key: {
        name: [{'bag': bag, **worst} for bag, worst in items]
        for name, items in item.worst.items()} for item in found}}, ensure_ascii=False)


def _worst(contents: Iterable[Mapping[str, Any]], key: str,
           least: str) -> Mapping[str, Sequence[tuple[str, Mapping[str, Any]]]]:
    found: dict[str, list[tuple[str, Mapping[str, Any]]]] = {}
    for content in contents:
        for name, item in content['requirements'].items():
            if key in item:
                found.setdefault(name, []).append((content['bag'], item[key]))
    return {name: sorted(items, key=lambda item: float(item[1][least]))[:_MOST_SHOWN]
            for name, items in found.items()}


def _closest_cells(found: Mapping[str, Any]) -> tuple[str, ...]:
    return (f'{found["margin"]:.6g}', str(found['at']),
            by_text(found['comparison'], found['distance'], found.get('key', '')))


def _slack_cells(found: Mapping[str, Any]) -> tuple[str, ...]:
    of = f' of {printable(found["key"])}' if 'key' in found else ''
    return (f'{found["left"]:.6g} {found["unit"]}{of}', str(found['trigger']),
            str(found['until'] or '-'))
