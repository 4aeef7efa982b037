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

"""The index of the reports of many recordings: a table of recordings and requirements."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain
import json
from pathlib import Path
from typing import Any
from urllib.parse import quote

from fret_monitor.bag.fleet import page_name
from fret_monitor.bag.page import badge, document, escaped
from fret_monitor.bag.results import verdict_text
from fret_monitor.model.diagnostics import counted

_MOST_WORDS = 8  # requirements whose verdicts are words; those of more are signs
_SIGNS = {'VIOLATED': '✗', 'satisfied': '✓', 'open': '…', 'not judged': '–'}
_SHORT_LEGEND = '<p class="legend">' + ''.join(
    f'<span>{badge(verdict, sign)} {verdict.lower()}</span>'
    for verdict, sign in _SIGNS.items()) + '<span>a number: occurrences of violations</span></p>'


def index_page(title: str, lines: Iterable[str], folder: Path,
               tables: Mapping[str, Sequence[Sequence[str]]]) -> str:
    """
    Return the index of recordings, each a line of JSON; it links to the pages in `folder`.

    `tables` are the rows of tables over all recordings by their titles, the heads first.
    """
    recordings = [json.loads(line) for line in lines]
    ids = list(dict.fromkeys(key for item in recordings for key in item['requirements']))
    head = ''.join(f'<th class="id" title="{escaped(key)}">{escaped(key)}</th>' for key in ids)
    is_short = len(ids) > _MOST_WORDS
    rows = ''.join(_row(item, ids, folder, is_short=is_short) for item in recordings)
    violated = sum(any(found['verdict'] is False for found in item['requirements'].values())
                   for item in recordings)
    failed = sum(bool(item['errors']) for item in recordings)
    return document(title, [
        f'<h1>{escaped(title)}</h1>',
        f'<p>{counted(len(recordings), "recording")}: {violated:,} with violations, '
        f'{failed:,} with errors.</p>',
        f'<div class="card wide"><table class="index{" many" if is_short else ""}"><tr>'
        f'<th>recording</th><th>messages</th>{head}<th>errors</th></tr>{rows}</table>',
        _SHORT_LEGEND if is_short else '', '</div>', *chain.from_iterable(
            _table(name, rows) for name, rows in tables.items())], is_broad=True)


def _table(title: str, rows: Sequence[Sequence[str]]) -> Iterator[str]:
    heads, *others = rows
    yield f'<h2>{escaped(title)}</h2><div class="card wide"><table><tr>'
    yield ''.join(f'<th>{escaped(cell)}</th>' for cell in heads)
    yield '</tr>'
    for row in others:
        yield '<tr>' + ''.join(f'<td>{escaped(cell)}</td>' for cell in row) + '</tr>'
    yield '</table></div>'


def _row(item: dict[str, Any], ids: Iterable[str], folder: Path, *, is_short: bool) -> str:
    name = page_name(Path(item['bag']))
    shown = escaped(item['bag'])
    if (folder / name).is_file():
        shown = f'<a href="{quote(name)}">{shown}</a>'
    cells = ''.join(f'<td>{_cell(item["requirements"].get(key), is_short=is_short)}</td>'
                    for key in ids)
    errors = '<br>'.join(map(escaped, item['errors']))
    return f'<tr><td>{shown}</td><td>{item["read"]:,}</td>{cells}<td>{errors}</td></tr>'


def _cell(found: dict[str, Any] | None, *, is_short: bool) -> str:
    if found is None:
        return ''
    verdict = verdict_text(found['verdict'], is_open='open' in found)
    count = found['occurrences']
    if is_short:
        return badge(verdict, f'{count:,}' if count else _SIGNS[verdict])
    return badge(verdict) + (f' {count:,}' if count else '')
