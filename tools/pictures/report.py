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
"""The lanes of a report on the recording of docs/recordings.md, as its page draws them."""

from collections.abc import Iterator
from contextlib import redirect_stdout
from hashlib import sha256
from io import StringIO
import os
from pathlib import Path
import re
import shutil
import subprocess
import tempfile

from fret_monitor.cli.main import main as fret_monitor

from tools.pictures.pages import block
from tools.pictures.sheet import document, text

BROWSERS = 'chromium', 'chromium-browser', 'google-chrome'
MARGIN, ROW = 16, 24
LABELS = """svg .card { fill: var(--card) }
svg .id { font-weight: 600; font-size: 13px; fill: var(--ink) }
svg .word { fill: #fff; stroke: none; text-anchor: middle }"""


def made() -> str:
    """Return the page of the report."""
    with tempfile.TemporaryDirectory() as name:
        folder, before = Path(name), Path.cwd()
        os.chdir(folder)
        try:
            exec(block('docs/recordings.md', 'make_flight.py'), {})
        finally:
            os.chdir(before)
        page = folder / 'flight.html'
        with redirect_stdout(StringIO()):
            fret_monitor(['bag', 'quadrotor.yaml', str(folder / 'flight'), '--report', str(page)])
        return page.read_text(encoding='utf-8')


def source(page: str) -> str:
    """Return the hash of what the page draws, and of how."""
    parts = re.findall(r'<style>.*?</style>|<script.*?</script>', page, re.DOTALL)
    return sha256('\n'.join(parts).encode()).hexdigest()


def drawn() -> str:
    """Return the picture, for which Chromium runs the page's script."""
    page = made()
    shown = _run(page)
    lanes, occurrence = _lanes(shown), _occurrence(shown)
    width, height = _size(occurrence[-1])
    return document(width + 2 * MARGIN, ROW * (len(lanes) + 3) + height + MARGIN,
                    'The verdicts of a recording, and a violation', (
        f'<!-- of {source(page)} -->', '<rect class="card" width="100%" height="100%"/>',
        *(line for row, lane in enumerate(lanes) for line in _row(row, width, *lane)),
        *(text(MARGIN, ROW * (len(lanes) + 1 + row) + 8, words, 'name')
          for row, words in enumerate(occurrence[:-1])),
        _placed(occurrence[-1], MARGIN, ROW * (len(lanes) + 3))), _style(page))


def _run(page: str) -> str:
    """Return the page after its script has drawn."""
    browser = next(filter(None, map(shutil.which, BROWSERS)), None)
    if browser is None:
        raise SystemExit('the picture of a report needs Chromium')
    with tempfile.TemporaryDirectory() as name:
        file = Path(name) / 'flight.html'
        file.write_text(page, encoding='utf-8')
        return subprocess.run(
            [browser, '--headless', '--no-sandbox', '--disable-gpu', '--dump-dom',
             f'--user-data-dir={name}/profile', '--virtual-time-budget=3000',
             '--window-size=900,2000', file.as_uri()],
            capture_output=True, text=True, check=True).stdout


def _lanes(shown: str) -> list[tuple[str, str, str, str]]:
    """Return the rows of verdicts: id, kind of the badge, its word, SVG; last that of the axis."""
    found = re.findall(r'<a href="#r\d+">(.*?)</a><span class="badge (\w+)">(.*?)</span>'
                       r'(<svg data-lane.*?</svg>)', shown, re.DOTALL)
    axis = re.search(r'<svg data-times.*?</svg>', shown, re.DOTALL)
    assert axis is not None
    return [*found, ('', '', '', axis[0])]


def _occurrence(shown: str) -> list[str]:
    """Return the lines above the first occurrence, and its SVG."""
    found = re.search(r'<strong>(Occurrence 1.*?)<br>.*?<br>(The deadline.*?)<br>.*?'
                      r'(<svg data-occurrence.*?</svg>)', shown, re.DOTALL)
    assert found is not None
    first = re.search(r'<article.*?<h3>(.*?) <', shown)
    assert first is not None
    return [f'{first[1]}: {re.sub("<[^>]*>", "", found[1])}', found[2], found[3]]


def _row(row: int, width: int, name: str, kind: str, word: str, lane: str) -> Iterator[str]:
    y = MARGIN + ROW * row
    if name:
        yield text(MARGIN, y + 13, name, 'id')
        yield f'<rect class="badge {kind}" x="85" y="{y - 1}" width="72" height="18" rx="9"/>'
        yield text(121, y + 12, word, 'word')
    yield _placed(lane, MARGIN + width - _size(lane)[0], y)


def _size(lane: str) -> tuple[int, int]:
    found = re.search(r'viewBox="0 0 (\d+) (\d+)"', lane)
    assert found is not None
    return int(found[1]), int(found[2])


def _placed(lane: str, x: int, y: int) -> str:
    width, height = _size(lane)
    return lane.replace('<svg', f'<svg x="{x}" y="{y}" width="{width}" height="{height}"', 1)


def _style(page: str) -> str:
    """Return what of the page's style is for drawings."""
    sheet = page.split('<style>', 1)[1].split('</style>', 1)[0]
    colours = re.findall(r'^:root \{.*?^\}|^@media screen and .*?^\}', sheet,
                         re.MULTILINE | re.DOTALL)
    badges = re.findall(r'^(\.badge\.\w+) \{ background: (#\w+)', sheet, re.MULTILINE)
    return '\n'.join((*colours, *re.findall(r'^svg (?:\.|text|line).*$', sheet, re.MULTILINE),
                      *(f'{name} {{ fill: {colour} }}' for name, colour in badges), LABELS))
