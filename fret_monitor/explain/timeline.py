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
Draw a trace as rows of characters above a scale of steps.

Long intervals without a change are shortened and marked with `~`.
"""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import accumulate, groupby

from fret_monitor.explain.diagram import DrawnDiagram
from fret_monitor.logic.specification import Signal
from fret_monitor.model.policies import InputSource
from fret_monitor.model.times import time_text
from fret_monitor.model.values import ValueType
from fret_monitor.traces.trace import Trace, Value

_KEPT = 3
_SHORTEST_GAP = 4
_MAX_COLUMNS = 200
_EVERY = 5
_LABEL = 40
_MAX_RUNS = 12


@dataclass(frozen=True)
class Band:
    """A row: a label, and its truth value at each column."""

    label: str
    truth: tuple[bool, ...]


@dataclass(frozen=True)
class Timeline:
    """
    The propositions and the verdict, and the step of each column.

    A column with step None represents omitted steps. With a `period` (seconds), there is also a
    scale of time; on a grid (`timed`) only that. `values` are lines about the inputs. `diagram` is
    the state diagram that is required, in the state of the last step.
    """

    title: str
    bands: tuple[Band, ...]
    verdict: Band
    steps: tuple[int | None, ...]
    period: Fraction | None
    values: tuple[str, ...]
    is_grid: bool = False
    diagram: DrawnDiagram | None = None


def timeline(title: str, labels: Sequence[str], truths: Sequence[Sequence[bool]],
             verdicts: Sequence[bool], period: Fraction | None,
             values: Sequence[str] = (), is_grid: bool = False) -> Timeline:
    """Return the timeline of a trace; `truths` and `verdicts` hold a value for each step."""
    columns = list(zip(*truths, verdicts, strict=True))
    places = _columns(columns)
    shown = [columns[place if place >= 0 else ~place] for place in places]
    *rows, verdict = zip(*shown, strict=True)
    return Timeline(
        title,
        tuple(Band(_cut(label), tuple(row)) for label, row in zip(labels, rows, strict=True)),
        Band('verdict', tuple(verdict)),
        tuple(place if place >= 0 else None for place in places),
        period, tuple(values), is_grid)


def _cut(label: str) -> str:
    return label if len(label) <= _LABEL else label[:_LABEL - 4].rstrip() + ' ...'


def _columns(columns: Sequence[tuple[bool, ...]]) -> list[int]:
    """Return the step of each column; `~step` represents a gap that contains the step."""
    places: list[int] = []
    for _, group in groupby(range(len(columns)), key=columns.__getitem__):
        stretch = list(group)
        if len(stretch) < 2 * _KEPT + _SHORTEST_GAP or len(columns) <= 2 * _MAX_COLUMNS // 5:
            places += stretch
        else:
            places += [*stretch[:_KEPT], ~stretch[_KEPT], *stretch[-_KEPT:]]
    if len(places) > _MAX_COLUMNS:
        half = _MAX_COLUMNS // 2
        places = [*places[:half], ~places[half], *places[-half:]]
    return places


def drawn(line: Timeline) -> Iterator[str]:
    """Yield the lines of a timeline: `#` true, `.` false, `~` omitted."""
    below = scales(line)
    labels = [band.label for band in (*line.bands, line.verdict)]
    width = max(len(label) for label in (*labels, *(name for name, _ in below)))
    for band in line.bands:
        yield f'{band.label:<{width}}  {_signs(line, band, "#.")}'
    yield f'{line.verdict.label:<{width}}  {_signs(line, line.verdict, "#x")}'
    for name, marks in below:
        yield f'{name:<{width}}  {_ruled(marks)}'
    yield from line.values


def _signs(line: Timeline, band: Band, signs: str) -> str:
    return ''.join('~' if step is None else signs[not truth]
                   for step, truth in zip(line.steps, band.truth, strict=True))


def marked_steps(line: Timeline) -> list[tuple[int, int]]:
    """Return column and step of each mark of the scale: every fifth, after gaps, the last."""
    last = len(line.steps) - 1
    marks = []
    for column, step in enumerate(line.steps):
        after_gap = column > 0 and line.steps[column - 1] is None
        if step is not None and (step % _EVERY == 0 or after_gap or column == last):
            marks.append((column, step))
    return marks


def shown_time(step: int, period: Fraction) -> str:
    """Return the time of a step in seconds since the first step, as text."""
    return f'{float(step * period):g}'


def scales(line: Timeline) -> list[tuple[str, list[tuple[int, str]]]]:
    """Return the scales below the verdict: the name of each, and its marks with their columns."""
    marks = marked_steps(line)
    steps = ('step', [(column, str(step)) for column, step in marks])
    if line.period is None:
        return [steps]
    seconds = ('seconds', [(column, shown_time(step, line.period)) for column, step in marks])
    return [seconds] if line.is_grid else [steps, seconds]


def _ruled(marks: Sequence[tuple[int, str]]) -> str:
    """Return a line with marks at their columns; omits marks that would overlap."""
    text = ''
    for column, mark in marks:
        if not text or len(text) < column:
            text = text.ljust(column) + mark
    return text


def value_lines(signals: Sequence[Signal], trace: Trace, grid: int | None,
                bands: Collection[str] = ()) -> Iterator[str]:
    """
    Yield the values of each non-Boolean input, each with what it applies from.

    Yield also when messages came, where that matters, unless `bands` have the name. `grid` is the
    time of a step in nanoseconds; None if steps have no time.
    """
    for number, signal in enumerate(signals):
        if signal.source is InputSource.RECEIVED and grid and signal.name not in bands:
            yield f'{signal.name}: {_receptions(trace, number, grid)}'
        if signal.type is ValueType.BOOL:
            continue
        changes: list[tuple[int, Value]] = []
        step = 0
        for run in trace:
            value = run.row[number]
            if not changes or repr(changes[-1][1]) != repr(value):
                changes.append((step, value))
            step += run.steps
        places = [time_text(start * grid) if grid else f'step {start}' for start, _ in changes]
        parts = [_value(signal, value) + (f' from {place}' if start else '')
                 for (start, value), place in zip(changes[:_MAX_RUNS], places, strict=False)]
        more = ', ...' if len(changes) > _MAX_RUNS else ''
        yield f'{signal.name}: {", ".join(parts)}{more}'


def _receptions(trace: Trace, number: int, grid: int) -> str:
    """Return at which points of a grid an input is true."""
    starts = accumulate((run.steps for run in trace), initial=0)
    found = [step for start, run in zip(starts, trace) if run.row[number]
             for step in range(start, start + min(run.steps, _MAX_RUNS + 1))]
    more = ', ...' if len(found) > _MAX_RUNS else ''
    return ', '.join(f'at {time_text(step * grid)}' for step in found[:_MAX_RUNS]) + more \
        if found else 'never'


def _value(signal: Signal, value: Value) -> str:
    for index, (name, number) in enumerate(signal.values):
        if value == (index if isinstance(number, str) else number):
            return name
    return f'{value:g}' if isinstance(value, float) else str(value)
