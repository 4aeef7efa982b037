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

"""Draw timelines as SVG 1.1, with shapes and text only: no scripts or external files."""

from collections.abc import Iterator, Sequence
import re
from xml.sax.saxutils import escape

from fret_monitor.explain.diagram import size, svg_lines
from fret_monitor.explain.timeline import Band, scales, Timeline

_CELL = 14
_ROW = 22
_BAR = 14
_LETTER = 7.2
_MARGIN = 16
_COLOURS = {'true': '#3465a4', 'false': '#e4e7ea', 'satisfied': '#4e9a06', 'violated': '#cc0000',
            'left out': '#ffffff', 'text': '#222222', 'faint': '#666666'}
# Characters that XML 1.0 forbids, even escaped.
_FORBIDDEN = re.compile('[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]')


def to_svg(title: str, lines: Sequence[Timeline]) -> str:
    """Return an SVG document of some timelines, one below the other."""
    labels = [band.label for line in lines for band in (*line.bands, line.verdict)]
    left = _MARGIN + round(_LETTER * max([len(label) for label in labels] or [0])) + 12
    body: list[str] = []
    y = _MARGIN + 8
    width = 320
    for line in lines:
        body += _timeline(line, left, y)
        y += _height(line)
        if line.diagram is not None:
            body += svg_lines(line.diagram, _MARGIN, y - _ROW)
            width = max(width, size(line.diagram)[0] + 2 * _MARGIN)
            y += size(line.diagram)[1]
        texts = max(len(text) for text in (line.title, *line.values))
        width = max(width, left + _CELL * len(line.steps) + 2 * _MARGIN,
                    round(_LETTER * texts) + 2 * _MARGIN)
    return '\n'.join([
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" version="1.1" width="{width}" height="{y}" '
        f'viewBox="0 0 {width} {y}" font-family="monospace" font-size="12">',
        f'<title>{_safe(title)}</title>',
        f'<rect width="{width}" height="{y}" fill="#ffffff"/>',
        *body, '</svg>', ''])


def _height(line: Timeline) -> int:
    rows = len(line.bands) + 1 + len(scales(line)) + len(line.values)
    return _ROW * (rows + 2)


def _timeline(line: Timeline, left: int, y: int) -> Iterator[str]:
    yield _text(_MARGIN, y + 4, line.title, weight='bold')
    y += _ROW
    for band in line.bands:
        yield from _band(line, band, left, y, ('true', 'false'))
        y += _ROW
    yield from _band(line, line.verdict, left, y, ('satisfied', 'violated'))
    y += _ROW
    yield from _scale(line, left, y)
    y += _ROW * len(scales(line))
    for text in line.values:
        yield _text(_MARGIN, y + 8, text, colour='faint')
        y += _ROW


def _band(line: Timeline, band: Band, left: int, y: int, kinds: tuple[str, str]) -> Iterator[str]:
    yield _text(_MARGIN, y + _BAR - 3, band.label)
    for column, step in enumerate(line.steps):
        kind = 'left out' if step is None else kinds[not band.truth[column]]
        yield (f'<rect x="{left + _CELL * column}" y="{y}" width="{_CELL - 1}" height="{_BAR}" '
               f'fill="{_COLOURS[kind]}"/>')
        if step is None:
            yield _text(left + _CELL * column + 3, y + _BAR - 3, '~', colour='faint')


def _scale(line: Timeline, left: int, y: int) -> Iterator[str]:
    for row, (name, _) in enumerate(scales(line)):
        yield _text(_MARGIN, y + 8 + row * _ROW, name, colour='faint')
    free = 0.0
    for marks in zip(*(marks for _, marks in scales(line)), strict=True):
        x = left + _CELL * marks[0][0]
        if x < free:
            continue
        for row, (_, mark) in enumerate(marks):
            yield _text(x, y + 8 + row * _ROW, mark, colour='faint')
        free = x + _LETTER * (max(len(mark) for _, mark in marks) + 1)


def _text(x: int, y: int, text: str, colour: str = 'text', weight: str = 'normal') -> str:
    return (f'<text x="{x}" y="{y}" fill="{_COLOURS[colour]}" font-weight="{weight}" '
            f'xml:space="preserve">{_safe(text)}</text>')


def _safe(text: str) -> str:
    return escape(_FORBIDDEN.sub('\ufffd', text))
