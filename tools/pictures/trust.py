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
"""The chain of trust: the arrows of docs/assurance.md, and what shows each."""

from collections.abc import Iterator

from tools.pictures.pages import rows
from tools.pictures.sheet import arrow, bar, box, document, text

KINDS = {'people': 'instead', 'tests': 'message', 'proof': 'good', 'nothing': 'bad'}
ROW, WIDTH, BOX = 74, 640, 150


def drawn() -> str:
    """Return the picture."""
    arrows = rows('docs/assurance.md', '| arrow | shown by | main evidence |')
    return document(WIDTH, ROW * len(arrows) + 50, 'The chain of trust', (
        line for place, row in enumerate(arrows) for line in _arrow(ROW * place + 8, *row)))


def _arrow(y: int, name: str, shown_by: str, evidence: str) -> Iterator[str]:
    number, _, ends = name.partition(' ')
    begin, end = ends.split(' → ')
    if number == '1':
        yield from box(8, y, BOX, 34, begin)
    yield from arrow(8 + BOX / 2, y + 34, 8 + BOX / 2, y + ROW)
    yield from box(8, y + ROW, BOX, 34, end)
    yield text(8 + BOX / 2 + 10, y + 59, number, 'strong')
    yield bar(KINDS[shown_by], BOX + 30, y + 42, 8, 24)
    yield text(BOX + 50, y + 59, f'{shown_by}: {evidence}')
