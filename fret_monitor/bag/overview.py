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

from collections.abc import Sequence
from dataclasses import dataclass

from fret_monitor.bag.check import AnyBatch
from fret_monitor.bag.findings import Findings
from fret_monitor.bag.lanes import FALSE, Lane, TRUE
from fret_monitor.model.manifest import Manifest
from fret_monitor.native.monitor import Monitor
from fret_monitor.runtime.engine import Engine
from fret_monitor.runtime.evaluator import Violation
from fret_monitor.runtime.reporting import OF_ALL_DETAILS, StatusRecord
from fret_monitor.runtime.thinning import Thinning, TimeWindow

MOST_SHOWN = 5
"""Occurrences of a requirement that are drawn; of fewer if a report would become too large."""

_LANE_PARTS = 720
_PARTS = 5000  # of all inputs together
_FEWEST_PARTS, _MOST_PARTS = 60, 600  # of an input
_MOST_DETAILS = 5_000  # changes of which details are looked at


@dataclass(frozen=True)
class Start:
    """The begin of an occurrence: time (ns), step, values of inputs and constants, if known."""

    time: int
    step: int
    values: tuple[tuple[str, str], ...] = ()
    silent: str = ''


class Overview:
    """Collects verdicts, the first occurrences, and values of inputs during a run."""

    def __init__(self, monitor: Monitor, until: int = 0) -> None:
        """Collect those of a monitor, at least until a time (ns)."""
        self.until = until
        self._monitor = monitor
        self._manifest = monitor.manifest
        self._taken = 0
        self.starts: list[list[Start]] = [[] for _ in self._manifest.requirements]

    @property
    def wants_details(self) -> bool:
        """Whether values at further changes would be shown; looking at all takes long."""
        return self._taken < _MOST_DETAILS

    def begin(self, begin: int, end: int, manifest: Manifest) -> None:
        """Begin a run."""
        self.until = end = max(end, self.until)
        count = len(manifest.inputs)
        parts = max(_FEWEST_PARTS, min(_MOST_PARTS, _PARTS // max(1, count)))
        self.parts = parts
        self.thinning = Thinning(
            self._monitor, [TimeWindow(index, begin, end, parts) for index in range(count)])
        self.lanes = [Lane(begin, end, _LANE_PARTS) for _ in manifest.requirements]
        self._state: list[int | None] = [None] * len(self.lanes)  # None: no change yet
        self._since = [begin] * len(self.lanes)
        self._begins = [end + 1] * len(self.lanes)  # when the first change came

    def watch(self, engine: Engine, batch: AnyBatch) -> None:
        """Take the values of messages or rows."""
        batch.add_to(self.thinning, engine)

    def judged(self, requirement: int, time: int) -> None:
        """Take that a requirement is judged from a time on."""

    def change(self, violation: Violation, detail: StatusRecord | None) -> None:
        """Take a change of a verdict."""
        index = violation.requirement
        self._taken += 1
        self._paint(index, violation.stamp - 1)
        if self._state[index] is None:
            self._begins[index] = violation.stamp
        self._since[index] = violation.stamp
        self._state[index] = TRUE if violation.is_recovery else FALSE
        if not violation.is_recovery and len(self.starts[index]) < MOST_SHOWN:
            self.starts[index].append(self._start(violation, detail))

    def _start(self, violation: Violation, detail: StatusRecord | None) -> Start:
        if detail is None:
            return Start(violation.stamp, violation.step)
        requirement = self._manifest.requirements[violation.requirement]
        names = [*(self._manifest.inputs[k].name for k in requirement.inputs),
                 *(self._manifest.constants[k][0] for k in requirement.constants)]
        texts = [text for _, text in detail.values]
        silent, shown = texts[OF_ALL_DETAILS - 1], texts[OF_ALL_DETAILS:]
        return Start(violation.stamp, violation.step, tuple(zip(names, shown)), silent)

    def end(self, time: int) -> None:
        """End the run."""
        for index in range(len(self.lanes)):
            self._paint(index, time)

    def _paint(self, index: int, until: int) -> None:
        state, since = self._state[index], self._since[index]
        if state is not None:
            self.lanes[index].paint(since, max(since, until), state)

    def verdicts(self, findings: Sequence[Findings]) -> list[str]:
        """Return the lanes as text; nothing is judged before all inputs have values."""
        found = []
        for index, (item, lane) in enumerate(zip(findings, self.lanes)):
            ready = self._ready(index)
            is_judged = item.verdict is not None or item.is_open
            # Of several messages at one time, the group starts a nanosecond later with the last.
            has_changed = self._state[index] is not None
            if is_judged and ready is not None and not (
                    has_changed and self._begins[index] <= ready + 1):
                lane.paint(ready, self._begins[index] - 1, TRUE)
            if item.is_open:
                lane.leave_open()
            found.append(lane.text())
        return found

    def _ready(self, index: int) -> int | None:
        """Return when all inputs of a requirement had a value."""
        firsts = [self.thinning.first(k) for k in self._manifest.requirements[index].inputs]
        known = [time for time in firsts if time is not None]
        return max(known, default=self.lanes[index].begin) if len(known) == len(firsts) else None
