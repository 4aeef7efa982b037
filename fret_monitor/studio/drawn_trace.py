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
from functools import partial
from itertools import islice
import math
from typing import Any, NamedTuple, TypeAlias
from zlib import crc32

from fret_monitor.build import build_specification
from fret_monitor.logic.formula import (
    Binary, BinaryOperator, Constant, Conversion, Formula, Held, MessageSlope, Over, postorder,
    Slope,
)
from fret_monitor.logic.printing import is_change, to_smv
from fret_monitor.logic.specification import Property, Signal, Specification
from fret_monitor.model.manifest import Manifest
from fret_monitor.model.policies import InputSource, Policy
from fret_monitor.model.values import ValueType
from fret_monitor.runtime.evaluator import Evaluator, Margin
from fret_monitor.studio.values import Changes, packed
from fret_monitor.traces.simulate import for_trace

_IN_PART = 64  # requirements, about
_MOST_WINDOWS = 40  # of which the values are shown
_LABEL = 60

_WIDE = (ValueType.INT64, ValueType.UINT64, ValueType.FLOAT32)

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

    def is_same(self, other: 'DrawnTrace') -> bool:
        """Whether all values are the same; -0.0 and 0.0 are equal, and divide differently."""
        return self == other and self._signs() == other._signs()

    def _signs(self) -> list[float]:
        return [math.copysign(1.0, value) for changes in self.values.values()
                for _, value in changes if isinstance(value, float) and value == 0]


class Lanes(NamedTuple):
    """What a part has on a trace, by id; margins only if they are computed."""

    verdicts: dict[str, Lane]
    margins: dict[str, Lane]
    windows: dict[str, Lane]


class TracePart(NamedTuple):
    """
    A part of a bundle, to be compiled.

    With `has_windows` its requirements stand for the values of windows: their distances from 0.
    """

    specification: Specification
    has_windows: bool = False


def parts_of(specification: Specification) -> tuple[TracePart, ...]:
    """Return a bundle as parts, each with some of its requirements, or with its windows."""
    items = specification.properties
    # A requirement stays in its part when others come and go, or are written in another order.
    count = 1 << max(0, (len(items) - 1) // _IN_PART).bit_length()
    parts: list[list[Property]] = [[] for _ in range(count)]
    for item in items:
        parts[crc32(item.id.encode()) % count].append(item)
    windows = [_as_requirement(*item) for item in windows_of(specification).items()]
    return (*(TracePart(_part(specification, part)) for part in parts if part),
            *([TracePart(replace(_part(specification, windows), has_margins=True), True)]
              if windows else []))


def windows_of(specification: Specification) -> dict[str, tuple[Formula, Property]]:
    """Return numbers over time by their texts, each with a requirement that reads it."""
    names = {formula: name for name, formula in specification.definitions}
    values = {item.name: item.values for item in specification.signals}
    found: dict[str, tuple[Formula, Property]] = {}
    for item in specification.properties:
        for node in postorder(item.roots):
            if isinstance(node, Over | Held | Slope | MessageSlope) \
                    or isinstance(node, Binary) and is_change(node):
                text = to_smv(node, _LABEL, values, names, specification.policy is Policy.TIMED)
                found.setdefault(text, (node, item))
    return dict(islice(found.items(), _MOST_WINDOWS))


def _as_requirement(text: str, found: tuple[Formula, Property]) -> Property:
    """Return a requirement whose distance from the other verdict is the value of a window."""
    node, item = found
    value = node if node.type is ValueType.FLOAT64 else Conversion(
        node if node.type in _WIDE else Conversion(node, ValueType.INT64), ValueType.FLOAT64)
    return replace(
        item, id=text, handler=f'window{crc32(text.encode())}', sentence=None, output=None,
        formula=Binary(BinaryOperator.GE, value, Constant(0.0, ValueType.FLOAT64)), horizon=0,
        probability=None)


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

    def __init__(self, part: TracePart) -> None:
        """Compile it; errors as `compile_monitor`."""
        self._part = part.specification
        self._has_windows = part.has_windows
        self._evaluator = Evaluator(for_trace(
            build_specification(part.specification).monitor))
        self._start = self._evaluator.save()
        self._last: tuple[DrawnTrace, Lanes] | None = None

    def lanes(self, trace: DrawnTrace) -> Lanes:
        """Return what the requirements have on a trace."""
        own = trace.of(self._part.signals)
        if self._last is None or not self._last[0].is_same(own):
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
        lanes: list[dict[str, Lane]] = [
            {item.id: [] for item in manifest.requirements} for _ in Lanes._fields]
        found = Lanes(*lanes)
        if not self._part.has_margins:
            for instants, verdicts in self._evaluator.rows(columns, times, until):
                _add_verdicts(found.verdicts, instants, verdicts, when)
            return found._replace(margins={}, windows={})
        for instants, verdicts, margins in self._evaluator.margin_rows(columns, times, until):
            _add_verdicts(found.verdicts, instants, verdicts, when)
            if self._has_windows:
                _add_margins(found.windows, instants, margins, when, _value)
            else:
                _add_margins(found.margins, instants, margins, when, partial(_margin, manifest))
        return Lanes({}, {}, found.windows) if self._has_windows else found._replace(windows={})

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
                 when: Callable[[int], float],
                 shown_as: Callable[[Margin], tuple[float | str, ...]]) -> None:
    """Add the changes of some rows of margins, as they are shown."""
    found = iter(margins)
    for instant in instants:
        for lane in lanes.values():
            shown = shown_as(next(found))
            if not lane or lane[-1][1:] != shown:
                lane.append((when(instant), *shown))


def _value(margin: Margin) -> tuple[float | str]:
    """Return the value whose distance from 0 this is; one of no number is not told apart."""
    return (margin.distance + 0.0 if math.isfinite(margin.value) else 'nan',)


def _margin(manifest: Manifest, margin: Margin) -> tuple[float | str, str]:
    if not math.isfinite(margin.value):
        return str(margin.value), ''
    return margin.value, manifest.comparisons[margin.comparison].text
