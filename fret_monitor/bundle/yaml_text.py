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
YAML scalars as `Text`: the place in the file of each character of a value.

PyYAML gives the start and the value of a scalar, but not the places of its characters.
`scalar_text` reads the scalar again by the rules of YAML 1.1 for its style (folding, escapes,
chomping) to find them. If the result is not the value that PyYAML read, all characters get the
place of the scalar's start.
"""

from array import array
from collections.abc import Iterator, Sequence
import re

from fret_monitor.model.diagnostics import Source, Text

_BREAK = r'(?:\r\n|[\n\r\x85\u2028\u2029])'
_LINE_BREAK = re.compile(_BREAK)
_INDENTATION_TRIES = 64

# One piece of a plain or quoted scalar: a line's end with the blanks around it, or text.
_FOLD = re.compile(rf'[ \t]*{_BREAK}(?:[ \t]|{_BREAK})*')
_CONTINUED = re.compile(rf'\\{_BREAK}(?:[ \t]|{_BREAK})*')
_ESCAPE = re.compile(r'\\x[0-9A-Fa-f]{2}|\\u[0-9A-Fa-f]{4}|\\U[0-9A-Fa-f]{8}|\\.')
_RUN = re.compile(r"[^ \t\r\n\x85\u2028\u2029'\\]+")
_QUOTES = ('"', "'")
_CHANGED = re.compile(rf"['\\\\]|{_BREAK}")  # may stand for other characters within quotes
_BLOCK_HEADER = re.compile(rf'[|>][-+0-9]*[ \t]*(?:#[^\r\n\x85\u2028\u2029]*)?(?:{_BREAK}|$)')


class _Pairs:
    """The characters of a value so far, each with its place; those of escapes are unknown."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._chunks: list[str] = []
        self.offsets = array('q')

    def copy(self, start: int, end: int) -> None:
        """Add the characters of the file from `start` to `end`."""
        self._chunks.append(self._text[start:end])
        self.offsets.extend(range(start, end))

    def put(self, char: str, offset: int) -> None:
        """Add one character with the place `offset`."""
        self._chunks.append(char)
        self.offsets.append(offset)

    def stands_for(self, value: str) -> bool:
        """Return whether the characters are, or follow, those of `value`."""
        mine = ''.join(self._chunks)[:len(value)]
        return len(mine) == len(value) and all(
            a in (b, '\0') for a, b in zip(mine, value, strict=True))


def scalar_text(source: Source, start: int, value: str, style: str) -> Text:
    """
    Return a scalar as `Text`.

    `start` is where it begins in the source (at its quote or block indicator), `value` what YAML
    makes of it, `style` one of '' (plain), "'", '"', '|' and '>'.
    """
    first = start + len(style)
    if (not style or style in _QUOTES and _CHANGED.search(value) is None) \
            and source.text.startswith(value, first):
        return Text(value, source, range(first, first + len(value) + 1))
    for pairs in _attempts(source.text, start, len(value), style):
        if pairs.stands_for(value):
            return Text(value, source, _closed(pairs.offsets, len(value), start))
    return Text(value, source, [start] * (len(value) + 1))


def _closed(offsets: array[int], length: int, start: int) -> Sequence[int]:
    """Remove the line ends that chomping drops, and add the place after the last character."""
    kept = offsets[:length]
    if not kept or kept[-1] - kept[0] == length - 1:  # usual; needs less memory than a list
        first = kept[0] if kept else start
        return range(first, first + length + 1)
    kept.append(kept[-1] + 1)
    return kept


def _attempts(text: str, start: int, length: int, style: str) -> Iterator[_Pairs]:
    if style in ('|', '>'):
        yield from _block_attempts(text, start, length, style)
    else:
        yield _flow(text, start, length, style)


def _flow(text: str, start: int, length: int, style: str) -> _Pairs:
    """Read a plain or quoted scalar until `length` characters are found."""
    pairs = _Pairs(text)
    place = start + len(style)
    while len(pairs.offsets) < length and place < len(text):
        place = _flow_piece(text, place, style, pairs)
    return pairs


def _flow_piece(text: str, place: int, style: str, pairs: _Pairs) -> int:
    """Read one piece at `place`; return the start of the next one."""
    if match := _RUN.match(text, place) or _FOLD.match(text, place):
        if text[match.start()] in ' \t\r\n\x85\u2028\u2029':
            _fold(text, match.start(), match.end(), pairs)
        else:
            pairs.copy(match.start(), match.end())
        return match.end()
    if style == '"' and (match := _CONTINUED.match(text, place)):
        _breaks(text, [*_LINE_BREAK.finditer(text, place, match.end())][1:], pairs)
        return match.end()
    if style == '"' and (match := _ESCAPE.match(text, place)):
        pairs.put('\0', place)
        return match.end()
    pairs.copy(place, place + 1)
    return place + (2 if style == "'" and text.startswith("''", place) else 1)


def _fold(text: str, start: int, end: int, pairs: _Pairs) -> None:
    """Fold line ends: a single one becomes a blank; of several, the first is dropped."""
    breaks = list(_LINE_BREAK.finditer(text, start, end))
    if _normal(breaks[0][0]) != '\n':
        _breaks(text, breaks, pairs)
    elif len(breaks) == 1:
        pairs.put(' ', breaks[0].start())
    else:
        _breaks(text, breaks[1:], pairs)


def _breaks(text: str, breaks: list[re.Match[str]], pairs: _Pairs) -> None:
    for item in breaks:
        pairs.put(_normal(item[0]), item.start())


def _normal(line_break: str) -> str:
    return line_break if line_break in '\u2028\u2029' else '\n'


def _block_attempts(text: str, start: int, length: int, style: str) -> Iterator[_Pairs]:
    """Read a block scalar with its apparent indentation, then with smaller ones."""
    header = _BLOCK_HEADER.match(text, start)
    if header is None:
        return
    found, blank = _indentations(text, header.end())
    # An indentation indicator (`>2`) makes further blanks part of the value; it counts from an
    # indentation that is not known here.
    for tried in [*range(found, max(-1, found - _INDENTATION_TRIES), -1), blank]:
        yield _block(text, header.end(), length, style, tried)


def _indentations(text: str, place: int) -> tuple[int, int]:
    """Return the indentation of the first line with text, and of the longest blank one before."""
    blank = 0
    for start, end, _ in _lines(text, place):
        line = text[start:end]
        if line.strip(' '):
            return len(line) - len(line.lstrip(' ')), blank
        blank = max(blank, len(line))
    return blank, blank


def _lines(text: str, place: int) -> Iterator[tuple[int, int, str]]:
    """Yield start, end and line break of each line from `place` on."""
    while place < len(text):
        match = _LINE_BREAK.search(text, place)
        if match is None:
            yield place, len(text), ''
            return
        yield place, match.start(), _normal(match[0])
        place = match.end()


def _block(text: str, place: int, length: int, style: str, indentation: int) -> _Pairs:
    """Read the lines of a block scalar; fold between two lines of plain text."""
    pairs = _Pairs(text)
    open_break: tuple[int, str] | None = None  # the end of the last line of text, not yet decided
    was_text = False
    breaks: list[tuple[int, str]] = []
    for start, end, line_break in _lines(text, place):
        content = _content_start(text, start, end, indentation)
        if content is None or len(pairs.offsets) > length:
            break
        if content == end:
            breaks.append((end, line_break))
            continue
        is_text = text[content] not in ' \t'
        folds = style == '>' and was_text and is_text
        _join(pairs, open_break, breaks, folds)
        pairs.copy(content, end)
        open_break, was_text, breaks = (end, line_break), is_text, []
    _join(pairs, open_break, breaks, folds=False)
    return pairs


def _content_start(text: str, start: int, end: int, indentation: int) -> int | None:
    """Return the start of a line's text, None if the line is not part of the scalar."""
    place = start
    while place < end and place - start < indentation and text[place] == ' ':
        place += 1
    return place if place == end or place - start == indentation else None


def _join(pairs: _Pairs, open_break: tuple[int, str] | None, breaks: list[tuple[int, str]],
          folds: bool) -> None:
    if open_break is not None:
        place, line_break = open_break
        if not (folds and line_break == '\n'):
            pairs.put(line_break or '\n', place)
        elif not breaks:
            pairs.put(' ', place)
    for place, line_break in breaks:
        pairs.put(line_break or '\n', place)
