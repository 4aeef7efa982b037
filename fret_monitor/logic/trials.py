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
The reference of trials and of the test of a probability (docs/probability.md), step by step.

Compiled monitors are tested against it, so it shares no code with `csrc`. The evidence is a
product with a bound of its own on rounding: a number from 1 to 2^64, times a power of 2^64, so
that it neither overflows nor underflows, and no logarithm is needed.
"""

from dataclasses import dataclass, field

from fret_monitor.logic.formula import NotRefuted, Trial

_UNIT = 2.0 ** 64


@dataclass
class OpenTrial:
    """
    The open trial of a `Trial` node, if there is one; `begun` is the step at which it began.

    A trigger at the step at which a trial is decided begins none.
    """

    node: Trial
    begun: int | None = None

    def outcome(self, step: int, begins: bool, good: bool, bad: bool, kept: bool, ends: bool,
                good_at_end: bool) -> int:
        """Return 1 if a trial succeeds at a step, -1 if it fails, 0 if none is decided."""
        is_new = self.begun is None
        if self.begun is None:
            if not begins:
                return 0
            self.begun = step
        if ends and not is_new:
            decided = 1 if good_at_end else -1
        elif self.node.due is not None and step - self.begun >= self.node.due:
            decided = 1 if kept else -1
        else:
            decided = -1 if bad else 1 if good else 0
        if decided:
            self.begun = None
        return decided


@dataclass
class Product:
    """A positive number: `part`, from 1 to 2^64, times 2^64 to the power of `units`."""

    part: float = 1.0
    units: int = 0

    def multiply(self, factor: float) -> None:
        """Multiply by a factor between 2^-64 and 2^64; rounds once."""
        self.part *= factor
        if self.part >= _UNIT:
            self.part, self.units = self.part / _UNIT, self.units + 1
        elif self.part < 1.0:
            self.part, self.units = self.part * _UNIT, self.units - 1

    def reaches(self, limit: float) -> bool:
        """Whether it is at least a limit between 1 and 2^64."""
        return self.units > 0 or (self.units == 0 and self.part >= limit)


@dataclass
class SequentialTest:
    """
    The test of whether events are no more probable than allowed, at any moment.

    `against` is the evidence that they are more probable, `in_favour` that they are less, and
    `likelihood` that of the outcomes, each predicted from those before it (for the interval). An
    event is an outcome of -1. `verdict` is 1 once shown, -1 once refuted, and then stays.
    """

    node: NotRefuted
    trials: int = 0
    events: int = 0
    verdict: int = 0
    against: Product = field(default_factory=Product)
    in_favour: Product = field(default_factory=Product)
    likelihood: Product = field(default_factory=Product)

    def take(self, outcome: int) -> bool:
        """Take an outcome; return whether the requirement is not refuted."""
        if outcome:
            self._count(outcome < 0)
        return self.verdict >= 0

    def _count(self, is_event: bool) -> None:
        weight = 1.0 / self.node.allowed
        odds = self.node.rest / self.node.allowed
        above = min(2.0, (1.0 + weight) / 2.0)
        self.against.multiply(max(1.0, self._factor(is_event, above)) if is_event else min(
            1.0, self._factor(is_event, max(weight - 2.0, odds / 2.0))))
        self.in_favour.multiply(min(1.0, self._factor(is_event, 0.5)) if is_event else max(
            1.0, self._factor(is_event, weight - 0.5)))
        of_this = self.events if is_event else self.trials - self.events
        self.likelihood.multiply((of_this + 0.5) / (self.trials + 1.0))
        self.trials += 1
        self.events += is_event
        if self.verdict == 0:
            limit = self.node.limit
            self.verdict = -1 if self.against.reaches(limit) else \
                1 if self.in_favour.reaches(limit) else 0

    def _factor(self, is_event: bool, prior: float) -> float:
        """Return how much more probable an outcome is than allowed, by those before it."""
        if is_event:
            return (self.events + prior) / (self.trials * self.node.allowed + 1.0)
        weight = 1.0 / self.node.allowed
        return (self.trials - self.events + prior) / ((self.trials + weight) * self.node.rest)
