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

"""What was found about a requirement in a recording: its occurrences, and those by key."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from operator import attrgetter, itemgetter

from fret_monitor.model.names import named_key
from fret_monitor.model.probability import Probability
from fret_monitor.runtime.probability import Figures, PooledTest, runs_of

MOST_KEPT = 10_000
"""Occurrences of a requirement whose times are kept; the others are counted."""


@dataclass(frozen=True)
class Closest:
    """
    The least margin of a requirement (docs/margins.md), and the time of its step (ns).

    `distance` is that of the `comparison` that decides, which reads `inputs`; `at` is the time
    (ns) at which it had it. `key` is the instance that had it, such as `robot=alpha`, or ''.
    """

    margin: float
    distance: float
    comparison: str
    inputs: tuple[str, ...]
    at: int
    step: int
    key: str = ''


@dataclass(frozen=True)
class Slack:
    """
    The least time that was left until a deadline (docs/margins.md); negative: how late it was.

    `left` is in `unit`, `s` or `steps`. `trigger` and `until` are when the trigger and the
    response came (ns); without one until the end of the recording, or of the instance, `until` is
    None, and `left` is what it is at most. `key` is the instance, such as `robot=alpha`, or ''.
    """

    left: float
    unit: str
    trigger: int
    until: int | None
    key: str = ''


@dataclass
class Findings:
    """
    What was found about one requirement; `since` it is violated (ns).

    `verdict` is None if it was never evaluated, or if it is open: it would become false with no
    further message, at the time `due`. `occurrences` are counted; of the first `MOST_KEPT` the
    times are in `spans`: begin and end (ns), None while it lasts. `violations` counts violating
    steps, None under the policy timed. `longest` is in nanoseconds.

    Of a requirement that is one for each key of one of its `variables`, or for each pair, these
    are of all its instances together, and `instances` has those that were violated, by key.

    Of one with a `probability`, `trials` are the times (ns) of the trials, and whether each
    failed; `figures` is what the test of this recording alone has found.

    `closest` is None without margins, and where no comparison of numbers decides. Of instances it
    is the least of all; `closest_of` has that of each, by key.

    `slack` is that of a sentence with a deadline, None if no response came or was late. `waiting`
    is the time (ns) of a trigger whose response has time beyond the end of the recording. `slacks`
    are those of the first `MOST_KEPT` triggers whose responses did not come at once. Of instances
    these are of all; `slack_of` has the least of each, by key.

    `triggered`: whether its trigger came; None if that was not asked.
    """

    id: str
    verdict: bool | None = None
    is_open: bool = False
    due: int | None = None
    violations: int | None = 0
    occurrences: int = 0
    longest: int = 0
    since: int | None = None
    spans: list[tuple[int, int | None]] = field(default_factory=list)
    variables: tuple[str, ...] = ()
    instances: dict[bytes, 'Findings'] = field(default_factory=dict)
    probability: Probability | None = None
    trials: list[tuple[int, bool]] = field(default_factory=list)
    figures: Figures | None = None
    closest: Closest | None = None
    closest_of: dict[bytes, Closest] = field(default_factory=dict)
    slack: Slack | None = None
    slacks: Sequence[Slack] = ()
    slack_of: dict[bytes, Slack] = field(default_factory=dict)
    waiting: int | None = None
    triggered: bool | None = None

    @property
    def first(self) -> int | None:
        """The time of the first occurrence, in nanoseconds."""
        return self.spans[0][0] if self.spans else None

    def of(self, key: bytes | None) -> 'Findings':
        """Return what was found about the instance of a key; None: the requirement itself."""
        if key is None:
            return self
        found = self.instances.get(key)
        if found is None:
            found = self.instances[key] = Findings(f'{self.id}[{self.shown_key(key)}]', False)
        return found

    def shown_key(self, key: bytes) -> str:
        """Return the key of an instance with its variable, or both of a pair."""
        return named_key(key, self.variables)

    def note_closest(self, found: Closest, key: bytes | None = None) -> None:
        """Note a least margin, of the instance of a key."""
        if key is not None:
            found = replace(found, key=self.shown_key(key))
            before = self.closest_of.get(key)
            self.closest_of[key] = found if before is None else \
                min(before, found, key=attrgetter('margin'))
        if self.closest is None or found.margin < self.closest.margin:
            self.closest = found

    def begin(self, stamp: int) -> None:
        """Note that a violation begins."""
        self.occurrences += 1
        self.since = stamp
        if len(self.spans) < MOST_KEPT:
            self.spans.append((stamp, None))

    def end(self, stamp: int) -> None:
        """Note that it ends."""
        since, self.since = self.since, None
        if since is not None:
            self.longest = max(self.longest, stamp - since)
            if self.spans[-1] == (since, None):
                self.spans[-1] = (since, stamp)

    def test(self) -> None:
        """Set the figures and the verdict of a requirement with a probability, if it is judged."""
        if self.probability is None:
            return
        test = PooledTest(self.probability)
        test.add_runs(runs_of(has_failed for _, has_failed in self.trials))
        self.figures = test.figures()
        if self.verdict is not False and (self.verdict or self.is_open):
            self.verdict = True if self.figures.verdict == 'assured' else None
            self.is_open = self.verdict is None

    def close(self, end: int) -> None:
        """Let what is violated last until the end of the recording; sum up the instances."""
        for item in (self, *self.instances.values()):
            if item.since is not None:
                item.longest = max(item.longest, end - item.since)
        for item in self.instances.values():
            self.occurrences += item.occurrences
            self.longest = max(self.longest, item.longest)
        self.spans += sorted((span for item in self.instances.values() for span in item.spans[:1]),
                             key=itemgetter(0))
