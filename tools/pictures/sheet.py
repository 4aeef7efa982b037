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
"""What all pictures share: a sheet of SVG in light and dark colours, texts, bars, arrows, axes."""

from collections.abc import Callable, Iterable, Iterator
from xml.sax.saxutils import escape

_STYLE = """
text { font: 13px sans-serif; fill: #222 } .small { font-size: 11px }
.middle { text-anchor: middle } .end { text-anchor: end }
.faint { fill: #777 } .strong { font-weight: bold }
.line { stroke: #bbb } .arrow { stroke: #777; stroke-width: 1.5; fill: none }
.head { fill: #777 } .box { fill: #f2f4f7; stroke: #999 }
.good { fill: #8cc6a0 } .bad { fill: #d9534f } .unknown { fill: #ddd } .message { fill: #35c }
.instead { fill: #d98a1c } .kept { fill: #cfdcf5 }
@media (prefers-color-scheme: dark) {
text { fill: #ddd } .faint { fill: #999 } .line { stroke: #555 } .arrow { stroke: #999 }
.head { fill: #999 } .box { fill: #1d232c; stroke: #777 }
.good { fill: #2f6b45 } .bad { fill: #c9443f } .unknown { fill: #444 } .message { fill: #8ab4ff }
.instead { fill: #e0aa3e } .kept { fill: #2a3a57 } }
"""


def document(width: int, height: int, title: str, body: Iterable[str],
             style: str = _STYLE) -> str:
    """Return an SVG; its title is what a screen reader says."""
    return '\n'.join((
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height}" role="img">'
        f'<title>{escape(title)}</title><style>{style}</style>', *body, '</svg>', ''))


def text(x: float, y: float, words: str, kind: str = '') -> str:
    """Return a text that begins at a place; `kind` has the names of styles."""
    return f'<text x="{x:g}" y="{y:g}" class="{kind}">{escape(words)}</text>'


def bar(kind: str, x: float, y: float, width: float, height: float) -> str:
    """Return a filled rectangle, at least two pixels wide."""
    return (f'<rect class="{kind}" x="{x:g}" y="{y:g}" width="{max(width, 2):g}" '
            f'height="{height:g}"/>')


def dot(kind: str, x: float, y: float) -> str:
    """Return a message."""
    return f'<circle class="{kind}" cx="{x:g}" cy="{y:g}" r="4"/>'


def box(x: float, y: float, width: float, height: float, words: str) -> Iterator[str]:
    """Yield a box with a text in its middle."""
    yield (f'<rect class="box" x="{x:g}" y="{y:g}" width="{width:g}" height="{height:g}" '
           'rx="5"/>')
    yield text(x + width / 2, y + height / 2 + 5, words, 'middle strong')


def arrow(x: float, y: float, to_x: float, to_y: float, *,
          at: float | None = None) -> Iterator[str]:
    """Yield an arrow; with `at` it goes down or up at `to_x` from there."""
    path = f'M{x:g} {y:g}' + ('' if at is None else f'H{to_x:g}') + f'L{to_x:g} {to_y:g}'
    yield f'<path class="arrow" d="{path}"/>'
    if to_x == x or at is not None:
        tip = 7 if to_y > (y if at is None else at) else -7
        yield f'<path class="head" d="M{to_x - 4:g} {to_y - tip:g}h8l-4 {tip}z"/>'
    else:
        tip = 7 if to_x > x else -7
        yield f'<path class="head" d="M{to_x - tip:g} {to_y - 4:g}v8l{tip} -4z"/>'


def seconds(place: Callable[[float], float], end: int, top: float, bottom: float,
            step: int = 1) -> Iterator[str]:
    """Yield a line for each second, or some of them, with its number below."""
    for second in range(0, end + 1, step):
        x = place(second)
        yield f'<line class="line" x1="{x:g}" x2="{x:g}" y1="{top:g}" y2="{bottom:g}"/>'
        yield text(x, bottom + 16, f'{second} s' if second else '0', 'faint middle')
