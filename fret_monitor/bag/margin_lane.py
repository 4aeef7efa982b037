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

"""The lane of a margin in a report: its least value over time, and which comparison decides it."""

from collections.abc import Callable, Iterator, Sequence
from itertools import groupby
import math

from fret_monitor.bag.findings import Findings
from fret_monitor.bag.page import escaped, table
from fret_monitor.bag.results import by_text
from fret_monitor.model.manifest import ManifestComparison
from fret_monitor.model.times import short_seconds
from fret_monitor.runtime.evaluator import Margin

_WIDTH, _HEIGHT, _STRIP = 720, 40, 6
_SHADES = (0.85, 0.45, 0.2)


def margin_row(item: Findings, margins: Sequence[Margin | None]) -> Iterator[str]:
    """Yield the row under the verdict of a requirement; nothing without margins."""
    if any(_is_finite(margin) for margin in margins):
        closest = '' if item.closest is None else f'{item.closest.margin:.6g}'
        yield (f'<span class="faint">margin</span><span class="faint">{closest}</span>'
               f'{_drawn(margins)}')


def margin_section(item: Findings, margins: Sequence[Margin | None],
                   comparisons: Sequence[ManifestComparison], start: int) -> Iterator[str]:
    """Yield how close a requirement came, and the comparisons that decide its lane."""
    if item.closest is not None:
        found = item.closest
        yield (f'<p>Closest: margin {found.margin:.6g} at {short_seconds(found.at - start)} s, by '
               f'{escaped(by_text(found.comparison, found.distance, found.key))}.</p>')
    decided = _deciding(margins)
    if decided:
        yield table(('decides the margin', 'shade', 'of the time'), [
            (comparisons[number].text, f'{_shade(place):.0%}',
             f'{sum(_number(margin) == number for margin in margins) / len(margins):.1%}')
            for place, number in enumerate(decided)])


def _deciding(margins: Sequence[Margin | None]) -> list[int]:
    """Return the comparisons that decide, in the order in which they do first."""
    return [number for number in dict.fromkeys(map(_number, margins)) if number is not None]


def _number(margin: Margin | None) -> int | None:
    return margin.comparison if margin is not None and _is_finite(margin) else None


def _is_finite(margin: Margin | None) -> bool:
    return margin is not None and math.isfinite(margin.value)


def _shade(place: int) -> float:
    return _SHADES[place % len(_SHADES)]


def _drawn(margins: Sequence[Margin | None]) -> str:
    values = [margin.value for margin in margins if margin is not None and _is_finite(margin)]
    low, high = min(0.0, *values), max(0.0, *values)
    scale = _HEIGHT / ((high - low) or 1.0)
    width = _WIDTH / len(margins)

    def height(value: float) -> float:
        return (high - max(low, min(high, value))) * scale

    return (
        f'<svg class="margin" viewBox="0 0 {_WIDTH} {_HEIGHT + _STRIP + 2}" height="48" '
        'width="100%" preserveAspectRatio="none" role="img" aria-label="margin over time">'
        f'<line x1="0" x2="{_WIDTH}" y1="{height(0.0):.1f}" y2="{height(0.0):.1f}" '
        'stroke="currentColor" stroke-dasharray="4 3" opacity="0.5"/>'
        f'{"".join(_lines(margins, width, height))}{"".join(_strip(margins, width))}</svg>')


def _lines(margins: Sequence[Margin | None], width: float,
           height: Callable[[float], float]) -> Iterator[str]:
    """Yield a line for each stretch in which the margin is known."""
    place = 0
    for is_known, found in groupby(margins, lambda margin: margin is not None):
        items = [*found]
        if is_known:
            points = ' '.join(f'{width * end:.1f},{height(margin.value):.1f}'
                              for k, margin in enumerate(items, place) if margin is not None
                              for end in (k, k + 1))
            yield (f'<polyline class="margin" points="{points}" fill="none" '
                   'stroke="currentColor" vector-effect="non-scaling-stroke"/>')
        place += len(items)


def _strip(margins: Sequence[Margin | None], width: float) -> Iterator[str]:
    """Yield a bar for each stretch that one comparison decides."""
    shades = {number: _shade(place) for place, number in enumerate(_deciding(margins))}
    place = 0
    for number, found in groupby(map(_number, margins)):
        count = len([*found])
        if number is not None:
            yield (f'<rect data-comparison="{number}" x="{width * place:.1f}" '
                   f'y="{_HEIGHT + 2}" width="{width * count:.1f}" height="{_STRIP}" '
                   f'fill="currentColor" fill-opacity="{shades[number]}"/>')
        place += count
