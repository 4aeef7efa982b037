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
Pages of HTML that need nothing else: no network, no further files.

Whatever comes from a bundle or a recording is escaped. The page's security policy allows no
script but its own, and nothing from elsewhere.
"""

from base64 import b64encode
from collections.abc import Iterable, Mapping, Sequence
from hashlib import sha256
from html import escape
from importlib.resources import files
import json
from typing import Any

_KINDS = {'VIOLATED': 'violated', 'satisfied': 'satisfied', 'open': 'open'}

GENERATOR = '<meta name="generator" content="fret_monitor">'
"""What each page has, so that no other is replaced."""

LEGEND = (
    '<p class="legend"><span><i class="good"></i>fulfilled</span>'
    '<span><i class="bad"></i>violated</span><span><i class="none"></i>not judged</span>'
    '<span><i class="open"></i>open at the end</span></p>')
"""What the colours of verdicts mean."""


def document(title: str, body: Iterable[str], data: Mapping[str, Any] | None = None, *,
             is_broad: bool = False) -> str:
    """Return a page, as broad as the window if wanted; with `data` it has the script for them."""
    style = _file('page.css')
    script = '' if data is None else _file('rows.js') + _file('page.js')
    policy = (f"default-src 'none'; img-src data:; style-src '{_hash(style)}'; "
              f"script-src {repr(_hash(script)) if script else repr('none')}")
    parts = [
        '<!DOCTYPE html>', '<html lang="en">', '<head>', '<meta charset="utf-8">',
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">',
        GENERATOR, '<meta name="viewport" content="width=device-width, initial-scale=1">',
        '<link rel="icon" href="data:,">', f'<title>{escaped(title)}</title>',
        f'<style>{style}</style>', '</head>',
        '<body class="broad">' if is_broad else '<body>', *body]
    if data is not None:
        parts += [f'<script type="application/json" id="data">{_embedded(data)}</script>',
                  f'<script>{script}</script>']
    return '\n'.join([*parts, '</body>', '</html>', ''])


def escaped(text: str) -> str:
    """Return a text that is shown as it is; what no page can contain is replaced."""
    return escape(''.join(item if _is_allowed(item) else '\ufffd' for item in text))


def _is_allowed(character: str) -> bool:
    code = ord(character)
    return character in '\t\n' or (code >= 0x20 and not 0x7f <= code < 0xa0
                                   and not 0xd800 <= code < 0xe000)


def badge(verdict: str, sign: str = '') -> str:
    """Return a verdict in its colour, or a sign that stands for it."""
    kind = _KINDS.get(verdict, 'unjudged')
    word = escaped(verdict.lower())
    if sign:
        return f'<span class="badge {kind}" title="{word}">{escaped(sign)}</span>'
    return f'<span class="badge {kind}">{word}</span>'


def table(heading: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table of texts."""
    head = ''.join(f'<th>{escaped(cell)}</th>' for cell in heading)
    lines = ''.join(f'<tr>{"".join(f"<td>{escaped(cell)}</td>" for cell in row)}</tr>'
                    for row in rows)
    return f'<div class="wide"><table><tr>{head}</tr>{lines}</table></div>'


def _file(name: str) -> str:
    return files('fret_monitor.bag').joinpath(name).read_text(encoding='utf-8')


def _hash(text: str) -> str:
    return 'sha256-' + b64encode(sha256(text.encode()).digest()).decode()


def _embedded(data: Mapping[str, Any]) -> str:
    """Return JSON in which nothing can end the script that contains it."""
    return json.dumps(data, separators=(',', ':'), allow_nan=False).replace('<', '\\u003c')
