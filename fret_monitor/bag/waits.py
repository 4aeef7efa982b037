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
How long responses with a deadline were waited for.

Requirements with ids of their own (`WaitLanes`) are violated meanwhile.
"""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from operator import attrgetter
from typing import NamedTuple

from fret_monitor.bag.findings import Findings, MOST_KEPT, Slack
from fret_monitor.model.manifest import Manifest
from fret_monitor.model.policies import Policy
from fret_monitor.runtime.evaluator import Violation
from fret_monitor.runtime.reporting import StatusRecord

_MARK = '#'  # between the parts of an id


@dataclass(frozen=True)
class WaitLanes:
    """
    The ids of two requirements beside one with a deadline, `bound` steps or ns after its trigger.

    `waits` is violated from a trigger until its response, or until the end of the scope;
    `at_once` from the first trigger on that came together with its response.
    """

    id: str
    bound: int

    @property
    def waits(self) -> str:
        """The id of the first one."""
        return _MARK.join(('waits', str(self.bound), self.id))

    @property
    def at_once(self) -> str:
        """The id of the other one."""
        return _MARK.join(('at_once', str(self.bound), self.id))


def lanes_of(ids: Iterable[str]) -> Iterator[WaitLanes]:
    """Yield those of which there are ids."""
    for item in ids:
        kind, _, rest = item.partition(_MARK)
        bound, _, name = rest.partition(_MARK)
        if kind == 'waits':
            yield WaitLanes(name, int(bound))


class _Wait(NamedTuple):
    """How long a response was waited for, in steps or nanoseconds, and when (ns)."""

    length: int
    trigger: int
    until: int | None


@dataclass(frozen=True)
class FoundSlack:
    """As in `Findings`: the least slack, a trigger that waits, and the slack of each trigger."""

    slack: Slack | None
    waiting: int | None
    slacks: tuple[Slack, ...] = ()


class _OfLane:
    """The waits of a lane, of one instance."""

    def __init__(self) -> None:
        self.since: tuple[int, int] | None = None  # the step and the time
        self.first: int | None = None  # the time of the first one
        self.over = 0  # how long all waits together were that are over
        self.longest: _Wait | None = None  # of those that are over
        self.ended: _Wait | None = None  # the longest that ended with an instance
        self.kept: list[_Wait] = []  # the first `MOST_KEPT` of both

    def begin(self, step: int, time: int) -> None:
        """Take that a wait begins."""
        self.since = step, time
        self.first = time if self.first is None else self.first

    def end(self, wait: _Wait) -> None:
        """Take that it is over, or that the instance has ended."""
        self.since = None
        self.over += wait.length
        if wait.until is None:
            self.ended = _longer(self.ended, wait)
        elif self.longest is None or wait.length > self.longest.length:
            self.longest = wait
        if len(self.kept) < MOST_KEPT:
            self.kept.append(wait)


def _longer(one: _Wait | None, other: _Wait | None) -> _Wait | None:
    """Return the longer wait, the first of equal ones."""
    if one is None or other is None:
        return other if one is None else one
    return other if other.length > one.length else one


class Waits:
    """Finds how long each response of each sentence was waited for."""

    wants_details = False

    def __init__(self, manifest: Manifest) -> None:
        self._is_timed, self._period = manifest.policy is Policy.TIMED, manifest.period
        self._lanes: defaultdict[str, dict[bytes | None, _OfLane]] = defaultdict(dict)

    def begin(self, begin: int, end: int, manifest: Manifest) -> None:
        """Begin a run."""
        self._names = [item.id for item in manifest.numbered]

    def judged(self, requirement: int, time: int) -> None:
        """Take that nothing is waited for at the first step."""

    def change(self, violation: Violation, detail: StatusRecord | None) -> None:
        """Take that a wait begins, or that it is over."""
        lane = self._lane(self._names[violation.requirement], violation.key)
        if not violation.is_recovery:
            lane.begin(violation.step, violation.stamp)
        elif lane.since is not None:
            lane.end(self._wait(lane.since, violation.step, violation.stamp,
                                None if violation.is_end else violation.stamp))

    def _lane(self, name: str, key: bytes | None) -> _OfLane:
        lanes = self._lanes[name]
        if key not in lanes:
            lanes[key] = _OfLane()
        return lanes[key]

    def _wait(self, since: tuple[int, int], step: int, time: int, until: int | None) -> _Wait:
        begin, trigger = since
        return _Wait(time - trigger if self._is_timed else step - begin, trigger, until)

    def end(self, time: int) -> None:
        """End the run."""

    def found(self, lanes: WaitLanes, end: int,
              steps: Callable[[str, bytes | None], int | None]) -> dict[bytes | None, FoundSlack]:
        """
        Return by key the slack of a sentence, and since when one is waited for with time left.

        `end` is that of the run (ns), and `steps` returns those that a lane has taken by then, of
        a lane without instances those at which it was violated.
        """
        waits, at_once = self._lanes[lanes.waits], self._lanes[lanes.at_once]
        return {key: self._of_key(lanes.bound, waits.get(key), at_once.get(key),
                                  self._last(lanes.waits, key, end, steps))
                for key in dict.fromkeys([*waits, *at_once])}

    def _of_key(self, bound: int, waits: _OfLane | None, at_once: _OfLane | None,
                last: _Wait | None) -> FoundSlack:
        lane = waits or _OfLane()
        late = [item for item in (last, lane.ended) if item and item.length > bound]
        wait = lane.longest
        for item in late:
            wait = _longer(wait, item)
        if wait is None and at_once is not None and at_once.first is not None:
            wait = _Wait(0, at_once.first, at_once.first)
        kept = [item for item in lane.kept if item.until is not None or item.length > bound]
        kept += [item for item in (last,) if item in late and item]
        return FoundSlack(None if wait is None else self._slack(bound, wait),
                          last.trigger if last and last not in late else None,
                          tuple(self._slack(bound, item) for item in kept))

    def _last(self, name: str, key: bytes | None, end: int,
              steps: Callable[[str, bytes | None], int | None]) -> _Wait | None:
        """Return the wait that is not over when a run ends: how long it is at least."""
        lane = self._lanes[name].get(key)
        if lane is None or lane.since is None:
            return None
        before = lane.over if key is None else lane.since[0]
        length = end + 1 - lane.since[1] if self._is_timed else \
            (steps(name, key) or 0) - before
        return _Wait(length, lane.since[1], None)

    def _slack(self, bound: int, wait: _Wait) -> Slack:
        left = bound - wait.length
        if self._is_timed:
            return Slack(left / 10**9, 's', wait.trigger, wait.until)
        if self._period is not None:
            period = Fraction(repr(self._period))
            return Slack(float(left * period), 's', wait.trigger, wait.until)
        return Slack(left, 'steps', wait.trigger, wait.until)


def sum_up(item: Findings, found: Mapping[bytes | None, FoundSlack]) -> None:
    """Note the slack of a requirement; of all instances the least, and that of each trigger."""
    if None in found:
        own = found[None]
        item.slack, item.waiting, item.slacks = own.slack, own.waiting, own.slacks
        return
    named = {key: replace(each, slack=each.slack and replace(each.slack, key=item.shown_key(key)),
                          slacks=tuple(replace(one, key=item.shown_key(key))
                                       for one in each.slacks))
             for key, each in found.items() if key is not None}
    item.slack_of = {key: each.slack for key, each in named.items() if each.slack is not None}
    item.slack = min(item.slack_of.values(), key=attrgetter('left'), default=None)
    item.waiting = min((each.waiting for each in named.values() if each.waiting is not None),
                       default=None)
    item.slacks = sorted((one for each in named.values() for one in each.slacks),
                         key=attrgetter('trigger'))[:MOST_KEPT]
