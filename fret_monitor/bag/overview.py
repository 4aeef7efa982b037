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

"""What a report shows of a whole recording: the verdicts as lanes, and the inputs, thinned."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from fret_monitor.bag.check import AnyBatch, scope_of
from fret_monitor.bag.findings import Findings
from fret_monitor.bag.lanes import FALSE, Lane, TRUE
from fret_monitor.model.manifest import Manifest, ManifestComparison
from fret_monitor.model.policies import InputSource
from fret_monitor.native.monitor import Monitor
from fret_monitor.runtime.engine import Engine
from fret_monitor.runtime.evaluator import Margin, MarginLanes, Violation
from fret_monitor.runtime.reporting import OF_ALL_DETAILS, StatusRecord
from fret_monitor.runtime.thinning import Thinning, TimeWindow

MOST_SHOWN = 5
"""Occurrences of a requirement that are drawn; of fewer if a report would become too large."""

_LANE_PARTS = 720
_PARTS = 5000  # of all inputs together
_FEWEST_PARTS, _MOST_PARTS = 60, 600  # of an input
_MOST_DETAILS = 5_000  # changes of which details are looked at
_MOST_KEYS = 100  # violated instances of a requirement that have a lane


@dataclass(frozen=True)
class Stretch:
    """A part of the judged time that is shown: nanoseconds since its begin, inclusive."""

    first: int
    last: int

    def within(self, begin: int, end: int) -> tuple[int, int]:
        """Return its times in what is judged from a time to another."""
        first = min(begin + max(0, self.first), end)
        return first, max(first, min(begin + self.last, end))


@dataclass(frozen=True)
class Start:
    """
    The begin of an occurrence: time (ns), step, values of inputs and constants, if known.

    `key` is that of its instance, None of the bundle.
    """

    time: int
    step: int
    values: tuple[tuple[str, str], ...] = ()
    silent: str = ''
    key: bytes | None = None


@dataclass
class _Painted:
    """A lane of verdicts that is painted up to `since`, with the state from then on."""

    lane: Lane
    since: int
    begin: int  # when the first change came
    state: int | None = None  # None: no change yet
    violated: set[bytes | None] = field(default_factory=set)  # of which instances

    def change(self, violation: Violation) -> None:
        """Take a change of a verdict: of one instance, or of the bundle."""
        self.paint(violation.stamp - 1)
        if self.state is None:
            self.begin = violation.stamp
        self.since = violation.stamp
        (self.violated.discard if violation.is_recovery else self.violated.add)(violation.key)
        self.state = FALSE if self.violated else TRUE

    def paint(self, until: int) -> None:
        """Paint the present state up to a time."""
        if self.state is not None:
            self.lane.paint(self.since, max(self.since, until), self.state)


class Overview:
    """Collects verdicts, the first occurrences, and values of inputs during a run."""

    def __init__(self, monitor: Monitor, until: int = 0,
                 stretch: Stretch | None = None) -> None:
        """Collect those of a monitor, at least until a time (ns); only what a stretch has."""
        self.until = until
        self._stretch = stretch
        self._monitor = monitor
        self._manifest = monitor.manifest
        self._taken = 0
        numbered = [item.id for item in self._manifest.numbered]
        order = self._manifest.ids or numbered
        self._place = [order.index(name) for name in numbered]
        self._numbers = [numbered.index(name) for name in order]
        self.starts: list[list[Start]] = [[] for _ in order]

    @property
    def wants_details(self) -> bool:
        """Whether values at further changes would be shown; looking at all takes long."""
        return self._taken < _MOST_DETAILS

    def begin(self, begin: int, end: int, manifest: Manifest) -> None:
        """Begin a run."""
        self.until = end = max(end, self.until)
        if self._stretch is not None:
            begin, end = self._stretch.within(begin, end)
        self.window = (begin, end)
        count = len(manifest.inputs)
        parts = max(_FEWEST_PARTS, min(_MOST_PARTS, _PARTS // max(1, count)))
        self.parts = parts
        self.thinning = Thinning(
            self._monitor, [TimeWindow(index, begin, end, parts) for index in range(count)])
        self._begin, self._end = begin, end
        self._margins: list[MarginLanes] = []  # of the bundle, then of each kind
        self._lanes = [self._lane() for _ in self._place]
        self._keyed: list[dict[bytes, _Painted]] = [{} for _ in self._place]

    def _lane(self) -> _Painted:
        return _Painted(Lane(self._begin, self._end, _LANE_PARTS), self._begin, self._end + 1)

    def watch(self, engine: Engine, batch: AnyBatch) -> None:
        """Take the values of messages or rows."""
        if self._manifest.has_margins and not self._margins:
            stretch = self._begin, self._end, _LANE_PARTS
            self._margins = [engine.evaluator.draw_margins(*stretch), *(
                engine.scopes.draw_margins(*stretch) if engine.scopes else ())]
        batch.add_to(self.thinning, engine)

    def judged(self, requirement: int, time: int) -> None:
        """Take that a requirement is judged from a time on."""

    def change(self, violation: Violation, detail: StatusRecord | None) -> None:
        """Take a change of a verdict."""
        index = self._place[violation.requirement]
        self._taken += 1
        self._lanes[index].change(violation)
        self._change_of_key(self._keyed[index], violation)
        self._note_start(self.starts[index], violation, detail)

    def _note_start(self, starts: list[Start], violation: Violation,
                    detail: StatusRecord | None) -> None:
        """Keep the first occurrences in the window, and what lasts from before into it."""
        if violation.is_recovery:
            if violation.stamp <= self._begin:
                starts[:] = [item for item in starts if item.key != violation.key]
        elif violation.stamp <= self._end and len(starts) < MOST_SHOWN:
            starts.append(_start(violation, detail))

    def _change_of_key(self, lanes: dict[bytes, _Painted], violation: Violation) -> None:
        key = violation.key
        if key is not None and (key in lanes or len(lanes) < _MOST_KEYS):
            found = lanes.setdefault(key, self._lane())
            found.change(violation)
            if violation.is_end:
                found.state = None  # until a violation of the next instance of the key

    def end(self, time: int) -> None:
        """End the run."""
        for each in (*self._lanes, *(each for lanes in self._keyed for each in lanes.values())):
            each.paint(time)

    def verdicts(self, findings: Sequence[Findings]) -> list[str]:
        """Return the lanes as text; nothing is judged before all inputs have values."""
        found = []
        for index, (item, painted) in enumerate(zip(findings, self._lanes)):
            ready, lane = self._ready(index), painted.lane
            is_judged = item.verdict is not None or item.is_open
            # Of several messages at one time, the group starts a nanosecond later with the last.
            has_changed = painted.state is not None
            if is_judged and ready is not None and not (
                    has_changed and painted.begin <= ready + 1):
                lane.paint(ready, painted.begin - 1, TRUE)
            if item.is_open:
                lane.leave_open()
            found.append(lane.text())
        return found

    def margins(self, index: int) -> list[Margin | None]:
        """Return the least margin of a requirement in each part, of all keys; [] without."""
        kind, place = scope_of(self._manifest, self._numbers[index])
        return self._margins[0 if kind is None else kind + 1].lane(place) if self._margins else []

    def comparisons(self, index: int) -> tuple[ManifestComparison, ...]:
        """Return the comparisons that decide these margins, as they are numbered."""
        kind, _ = scope_of(self._manifest, self._numbers[index])
        return (self._manifest if kind is None else
                self._manifest.kinds[kind].manifest).comparisons

    def of_instances(self, index: int) -> Mapping[bytes, str]:
        """Return the lanes of the instances that violated a requirement, by key."""
        return {key: found.lane.text() for key, found in sorted(self._keyed[index].items())}

    def _ready(self, index: int) -> int | None:
        """Return when all inputs of a requirement had a value; of instances, the begin."""
        number = self._numbers[index]
        read = () if self._manifest.variables_of[number] else [
            k for k in self._manifest.requirements[number].inputs
            if self._manifest.inputs[k].source is not InputSource.INSTANCES]
        firsts = [self.thinning.first(k) for k in read]
        known = [time for time in firsts if time is not None]
        return max(known, default=self._begin) if len(known) == len(firsts) else None


def _start(violation: Violation, detail: StatusRecord | None) -> Start:
    """Return the begin of an occurrence, with the values that its details have."""
    if detail is None:
        return Start(violation.stamp, violation.step, key=violation.key)
    silent = detail.values[OF_ALL_DETAILS - 1][1]
    return Start(violation.stamp, violation.step, tuple(detail.values[OF_ALL_DETAILS:]), silent,
                 violation.key)
