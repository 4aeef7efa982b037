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

"""Write text of a bundle in C comments, with unsafe characters replaced."""

from collections.abc import Iterator
import re
import textwrap
import unicodedata

_WIDTH = 90
_NOT_PLAIN = re.compile(r'[^ -\[\]-~]')
_LONG_WORD = re.compile(r'\S{10000}(?=\S)')  # `textwrap` copies the rest of a word for each line


def comment(text: str, indent: str = '', first: str = '', rest: str = '') -> Iterator[str]:
    """Yield a text as `//` lines; `first` and `rest` come before its first and other lines."""
    shown = _LONG_WORD.sub(r'\g<0> ', safe(text))
    lines = textwrap.wrap(shown, _WIDTH - len(rest), break_on_hyphens=False) or ['']
    for number, line in enumerate(lines):
        yield f'{indent}// {rest if number else first}{line}'.rstrip()


def safe(text: str) -> str:
    """Replace text that could end or continue a comment, or change the writing direction."""
    shown = _NOT_PLAIN.sub(lambda found: _safe_character(found[0]), ' '.join(text.split()))
    apart = re.sub(r'\?(?=\?)', '? ', shown)  # no trigraphs, not even in `???/`
    return apart.replace('*/', '* /').replace('/*', '/ *')


def _safe_character(char: str) -> str:
    if char == '\\':
        return '<backslash>'
    if char.isascii():
        return char if char.isprintable() else ' '
    kind = unicodedata.category(char)
    is_plain = kind[0] in 'LNPS' and unicodedata.bidirectional(char) in ('L', 'ON', 'EN', 'ET')
    return char if is_plain else f'<U+{ord(char):04X}>'
