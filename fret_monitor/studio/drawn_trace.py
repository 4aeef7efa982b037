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
A bundle on a trace that is being drawn: verdicts again and again, after small changes.

The requirements are compiled in parts, so that a change of one compiles its part alone, and are
computed again where an input that their part reads has changed. In a trace each row is a step of
all requirements, so that a verdict does not depend on what else is in its part.
"""

from array import array
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
import math
from typing import Any, NamedTuple, TypeAlias
from zlib import crc32

from fret_monitor.build import build_specification
from fret_monitor.logic.specification import Property, Signal, Specification
from fret_monitor.model.manifest import Manifest
from fret_monitor.model.policies import InputSource, Policy
from fret_monitor.runtime.evaluator import Evaluator, Margin
from fret_monitor.studio.values import Changes, packed
from fret_monitor.traces.simulate import for_trace

_IN_PART = 64  # requirements, about

Lane: TypeAlias = list[tuple[Any, ...]]
"""The changes of a value: (step, or seconds under `timed`, value, ...)."""


@dataclass(frozen=True)
class DrawnTrace:
    """A trace of a page; `period` (ns) is between two rows, under `timed` only."""

    values: Mapping[str, Changes]
    steps: int
    period: int

    def of(self, signals: Sequence[Signal]) -> 'DrawnTrace':
        """Return the part of a trace that some inputs have."""
        return replace(self, values={item.name: self.values.get(item.name, [])
                                     for item in signals})


class Lanes(NamedTuple):
    """What requirements have on a trace, by id; margins only if they are computed."""

    verdicts: dict[str, Lane]
    margins: dict[str, Lane]


def parts_of(specification: Specification) -> tuple[Specification, ...]:
    """Return a bundle as parts, each with some of its requirements and the inputs of these."""
    items = specification.properties
    # A requirement stays in its part when others come and go, or are written in another order.
    count = 1 << max(0, (len(items) - 1) // _IN_PART).bit_length()
    parts: list[list[Property]] = [[] for _ in range(count)]
    for item in items:
        parts[crc32(item.id.encode()) % count].append(item)
    return tuple(_part(specification, part) for part in parts if part)


def _part(specification: Specification, items: Sequence[Property]) -> Specification:
    """Return some requirements, without what does not change their verdicts."""
    read = {name for item in items for name in item.inputs}
    measured = {item.topic for item in specification.signals
                if item.name in read and item.source.is_measured}
    return replace(
        specification, definitions=(), actions=(), gates=(),
        signals=tuple(replace(item, layout=None) for item in specification.signals
                      if item.name in read or (
                          item.source is InputSource.RECEIVED and item.topic in measured)),
        properties=tuple(replace(item, text='', title='', place=None, on_violation=(), on_end=())
                         for item in items))


class CompiledPart:
    """A part of a bundle, compiled; for one thread."""

    def __init__(self, part: Specification) -> None:
        """Compile it; errors as `compile_monitor`."""
        self._part = part
        self._evaluator = Evaluator(for_trace(build_specification(part).monitor))
        self._start = self._evaluator.save()
        self._last: tuple[DrawnTrace, Lanes] | None = None

    def lanes(self, trace: DrawnTrace) -> Lanes:
        """Return what the requirements have on a trace."""
        own = trace.of(self._part.signals)
        if self._last is None or self._last[0] != own:
            self._evaluator.restore(self._start)
            self._last = own, self._computed(own)
        return self._last[1]

    def _computed(self, trace: DrawnTrace) -> Lanes:
        rows, until = self._rows(trace)
        columns = [packed(signal, trace.values[signal.name], trace.steps, rows)
                   for signal in self._part.signals]
        manifest = self._evaluator.monitor.manifest
        when = _seconds if trace.period else int
        times = array('q', [row * trace.period for row in rows] if trace.period else rows)
        found = Lanes({item.id: [] for item in manifest.requirements}, {})
        if not self._part.has_margins:
            for instants, verdicts in self._evaluator.rows(columns, times, until):
                _add_verdicts(found.verdicts, instants, verdicts, when)
            return found
        found.margins.update((name, []) for name in found.verdicts)
        for instants, verdicts, margins in self._evaluator.margin_rows(columns, times, until):
            _add_verdicts(found.verdicts, instants, verdicts, when)
            _add_margins(found.margins, instants, margins, when, manifest)
        return found

    def _rows(self, trace: DrawnTrace) -> tuple[Sequence[int], int | None]:
        """
        Return the rows to take, and the time up to which verdicts are wanted after them.

        Under `timed` verdicts depend on values and times alone, so that only rows with a change
        are taken; but not of what counts or times messages, of which each row is one.
        """
        is_message = any(item.source.is_measured or item.source is InputSource.RECEIVED
                         for item in self._part.signals)
        if self._part.policy is not Policy.TIMED or is_message:
            return range(trace.steps), None
        steps = {0, *(int(change[0]) for changes in trace.values.values() for change in changes)}
        return sorted(step for step in steps if step < trace.steps), \
            (trace.steps - 1) * trace.period


def _seconds(time: int) -> float:
    return time / 10**9


def _add_verdicts(lanes: Mapping[str, Lane], instants: Sequence[int], verdicts: bytes,
                  when: Callable[[int], float]) -> None:
    """Add the changes of some rows of verdicts to their lanes."""
    for number, lane in enumerate(lanes.values()):
        own = verdicts[number::len(lanes)]
        value = lane[-1][1] if lane else 1 - own[0]
        place = own.find(1 - value)
        while place >= 0:
            value = 1 - value
            lane.append((when(instants[place]), value))
            place = own.find(1 - value, place)


def _add_margins(lanes: Mapping[str, Lane], instants: Sequence[int], margins: Iterable[Margin],
                 when: Callable[[int], float], manifest: Manifest) -> None:
    """Add the changes of some rows of margins, each with the comparison that decides it."""
    found = iter(margins)
    for instant in instants:
        for lane in lanes.values():
            shown = _margin(next(found), manifest)
            if not lane or lane[-1][1:] != shown:
                lane.append((when(instant), *shown))


def _margin(margin: Margin, manifest: Manifest) -> tuple[float | str, str]:
    if not math.isfinite(margin.value):
        return str(margin.value), ''
    return margin.value, manifest.comparisons[margin.comparison].text
