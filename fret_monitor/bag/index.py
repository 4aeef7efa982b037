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

from collections.abc import Iterable
import json
from pathlib import Path
from typing import Any
from urllib.parse import quote

from fret_monitor.bag.fleet import page_name
from fret_monitor.bag.page import badge, document, escaped
from fret_monitor.bag.results import verdict_text
from fret_monitor.model.diagnostics import counted


def index_page(title: str, lines: Iterable[str], folder: Path) -> str:
    """Return the index of recordings, each a line of JSON; it links to the pages in `folder`."""
    recordings = [json.loads(line) for line in lines]
    ids = list(dict.fromkeys(key for item in recordings for key in item['requirements']))
    head = ''.join(f'<th>{escaped(key)}</th>' for key in ids)
    rows = ''.join(_row(item, ids, folder) for item in recordings)
    violated = sum(any(found['verdict'] is False for found in item['requirements'].values())
                   for item in recordings)
    failed = sum(bool(item['errors']) for item in recordings)
    return document(title, [
        f'<h1>{escaped(title)}</h1>',
        f'<p>{counted(len(recordings), "recording")}: {violated:,} with violations, '
        f'{failed:,} with errors.</p>',
        f'<div class="card wide"><table class="index"><tr><th>recording</th><th>messages</th>'
        f'{head}<th>errors</th></tr>{rows}</table></div>'])


def _row(item: dict[str, Any], ids: Iterable[str], folder: Path) -> str:
    name = page_name(Path(item['bag']))
    shown = escaped(item['bag'])
    if (folder / name).is_file():
        shown = f'<a href="{quote(name)}">{shown}</a>'
    cells = ''.join(f'<td>{_cell(item["requirements"].get(key))}</td>' for key in ids)
    errors = '<br>'.join(map(escaped, item['errors']))
    return f'<tr><td>{shown}</td><td>{item["read"]:,}</td>{cells}<td>{errors}</td></tr>'


def _cell(found: dict[str, Any] | None) -> str:
    if found is None:
        return ''
    times = f' {found["occurrences"]:,}' if found['occurrences'] else ''
    return badge(verdict_text(found['verdict'], is_open='open' in found)) + times
