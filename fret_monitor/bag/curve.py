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

"""The curve of a probability: the estimate and its interval after each trial of a recording."""

from collections.abc import Iterator, Sequence

from fret_monitor.bag.findings import Findings
from fret_monitor.bag.page import escaped
from fret_monitor.runtime.probability import Figures, PooledTest

_MOST_POINTS = 240
_WIDTH, _HEIGHT, _LEFT, _TOP = 720, 120, 44, 8


def probability_section(item: Findings) -> Iterator[str]:
    """Yield the figures of a requirement with a probability, and its curve; nothing of others."""
    if item.probability is None or item.figures is None:
        return
    found = item.figures
    estimate = f'{found.estimate:.6g}' if found.trials else 'not known'
    yield (f'<p>{found.verdict}: {found.failures:,} of {found.trials:,} trials failed; the '
           f'probability of success is {estimate}, between {found.low:.6g} and {found.high:.6g} '
           f'(confidence {item.probability.confidence_text}, whenever one looks); '
           f'{escaped(item.probability.required)} is required.</p>')
    if found.trials:
        yield _curve(_points(item), float(item.probability.bound), found.trials)


def _points(item: Findings) -> list[Figures]:
    """Return what was found after some of the trials, the last one among them."""
    assert item.probability is not None
    test, points = PooledTest(item.probability), []
    count = len(item.trials)
    wanted = {max(1, count * place // _MOST_POINTS) for place in range(1, _MOST_POINTS + 1)}
    for number, (_, has_failed) in enumerate(item.trials, 1):
        test.add(has_failed)
        if number in wanted:
            points.append(test.figures(has_more=False))
    return points


def _curve(points: Sequence[Figures], bound: float, most: int) -> str:
    def place(trials: int, value: float) -> str:
        x = _LEFT + (_WIDTH - _LEFT) * trials / most
        return f'{x:.1f},{_TOP + _HEIGHT * (1 - value):.1f}'

    upper = [place(item.trials, item.high) for item in points]
    lower = [place(item.trials, item.low) for item in reversed(points)]
    middle = ' '.join(place(item.trials, item.estimate) for item in points)
    height = _TOP + _HEIGHT * (1 - bound)
    labels = ''.join(
        f'<text x="{_LEFT - 6}" y="{_TOP + _HEIGHT * (1 - value) + 4:.1f}" class="end">'
        f'{value:g}</text>' for value in (0.0, 0.5, 1.0))
    return (
        f'<figure><svg viewBox="0 0 {_WIDTH} {_HEIGHT + 2 * _TOP + 14}" width="{_WIDTH}" '
        'role="img" aria-label="probability of success after each trial">'
        f'<polygon points="{" ".join([*upper, *lower])}" fill="currentColor" opacity="0.15"/>'
        f'<polyline class="curve" points="{middle}"/>'
        f'<line x1="{_LEFT}" x2="{_WIDTH}" y1="{height:.1f}" y2="{height:.1f}" '
        'stroke="currentColor" stroke-dasharray="4 3"/>'
        f'{labels}<text x="{_WIDTH}" y="{_HEIGHT + 2 * _TOP + 10}" class="end">'
        f'{most:,} trials</text></svg>'
        '<figcaption>The estimate and its interval after each trial; dashed: the bound.'
        '</figcaption></figure>')
