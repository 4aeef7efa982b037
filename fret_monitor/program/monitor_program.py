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
The program of a monitor: for each step group a list of equations over state cells.

Every equation computes one value from earlier values, in O(1) time for all bounds. An operand of a
Boolean operation is a value or its negation, so that negations need no equations, and `p` and `!p`
share one.
"""

from dataclasses import dataclass
from typing import TypeAlias

from fret_monitor.logic.formula import BinaryOperator, Formula, UnaryOperator
from fret_monitor.logic.specification import Property, Signal
from fret_monitor.model.policies import Policy, Stamp
from fret_monitor.model.values import ValueType


@dataclass(frozen=True, order=True)
class Operand:
    """The value of an equation (its index in the group), negated or not; -1 is TRUE."""

    value: int
    negated: bool = False

    def __invert__(self) -> 'Operand':
        """Return the negation."""
        return Operand(self.value, not self.negated)

    @property
    def is_constant(self) -> bool:
        """Whether it is TRUE or FALSE."""
        return self.value < 0


TRUE = Operand(-1)
FALSE = Operand(-1, True)


@dataclass(frozen=True)
class Read:
    """The current value of an input (index of the signal)."""

    signal: int


@dataclass(frozen=True)
class Literal:
    """A number."""

    value: int | float


@dataclass(frozen=True)
class Convert:
    """A number converted from type `source` to the type of the equation."""

    source: ValueType
    argument: Operand


@dataclass(frozen=True)
class ApplyUnary:
    """NEG or ABS of a number."""

    operator: UnaryOperator
    argument: Operand


@dataclass(frozen=True)
class ApplyBinary:
    """A connective, relation or arithmetic operation; `types` are those of the operands."""

    operator: BinaryOperator
    left: Operand
    right: Operand
    types: tuple[ValueType, ValueType]


@dataclass(frozen=True)
class Power:
    """A number raised to a constant exponent, by repeated multiplication."""

    base: Operand
    exponent: int


@dataclass(frozen=True)
class Choose:
    """`yes` if `condition` holds, else `no`."""

    condition: Operand
    yes: Operand
    no: Operand


@dataclass(frozen=True)
class FirstStep:
    """FTP. One bit."""


@dataclass(frozen=True)
class Delay:
    """
    The Boolean argument `steps` steps ago; `initial` in the first `steps` steps.

    State for 1 step: one bit; for up to 64: a shift register; for more: a ring of bits, and one
    position for all rings of that length in the group.
    """

    steps: int
    initial: bool
    argument: Operand


@dataclass(frozen=True)
class OnceEver:
    """`O p`. One bit."""

    argument: Operand


@dataclass(frozen=True)
class AlwaysSoFar:
    """`H p`. One bit."""

    argument: Operand


@dataclass(frozen=True)
class SinceEver:
    """`p S q`. One bit."""

    left: Operand
    right: Operand


@dataclass(frozen=True)
class TriggeredEver:
    """`p T q`. One bit."""

    left: Operand
    right: Operand


@dataclass(frozen=True)
class OnceWithin:
    """
    `O[0,bound] p`, and true at the first `head` steps in any case; 0 < bound, head <= bound + 1.

    One counter: steps since the last p.
    """

    bound: int
    argument: Operand
    head: int = 0


@dataclass(frozen=True)
class AlwaysWithin:
    """
    `H[0,bound] p`, but false at the first `head` steps; 0 < bound, head <= bound + 1.

    One counter: steps since the last !p.
    """

    bound: int
    argument: Operand
    head: int = 0


@dataclass(frozen=True)
class OnceBefore:
    """`O[bound,inf) p`, bound > 0. One counter: steps since the first p, at most the bound."""

    bound: int
    argument: Operand


@dataclass(frozen=True)
class SinceWithin:
    """`p S[0,bound] q`, bound > 0. One counter: steps since the last q after which p holds."""

    bound: int
    left: Operand
    right: Operand


@dataclass(frozen=True)
class SinceBefore:
    """`p S[bound,inf) q`, bound > 0. One counter: steps since the oldest q after which p holds."""

    bound: int
    left: Operand
    right: Operand


@dataclass(frozen=True)
class Room:
    """
    How many entries a cell has room for, which are not a number of steps.

    `capacity` is None where it is unknown: some input of `signals` has no `max_rate`. With
    `may_overflow` more entries than that can come.
    """

    signals: tuple[int, ...]
    capacity: int | None
    may_overflow: bool


@dataclass(frozen=True)
class SinceBetween:
    """
    `left S[low,high] right`, 0 < low <= high; only in groups that step at ticks.

    A queue of intervals of ticks at which it is true. Their number is unknown only where low
    equals high.
    """

    low: int
    high: int
    left: Operand
    right: Operand
    room: Room


@dataclass(frozen=True)
class ValueAgo:
    """
    The number `past` steps ago, that of step 0 if that is later; past > 0.

    A ring of numbers; in a group that steps at ticks a queue of changes, for which `room` is set.
    """

    past: int
    argument: Operand
    room: Room | None


@dataclass(frozen=True)
class Greatest:
    """
    The greatest number of this step and the `past` before, or the least; past > 0.

    A queue with partial results (DABA Lite). `room` as in ValueAgo.
    """

    past: int
    argument: Operand
    is_least: bool
    room: Room | None


@dataclass(frozen=True)
class Total:
    """
    The sum of the numbers at the steps of the window at which `at` holds; past >= 0.

    By steps past > 0. The sum of integers is modulo 2^64. That of float64 is exact, and only read
    by `Rounded`. A ring of numbers, and a sum; `at` holds always, but in a group that steps at
    ticks. `room` as in ValueAgo.
    """

    past: int
    argument: Operand
    at: Operand
    room: Room | None


@dataclass(frozen=True)
class Rounded:
    """The sum or the mean of the numbers in the window of a Total of float64, rounded once."""

    total: Operand
    is_mean: bool


@dataclass(frozen=True)
class Tally:
    """How often `entering` held since `leaving` is the same some steps ago. One number."""

    entering: Operand
    leaving: Operand


@dataclass(frozen=True)
class TimeAtLeast:
    """
    Whether the argument held at `least` or more of the last `past` ticks; 0 < least <= past.

    Only in groups that step at ticks. A queue of intervals.
    """

    past: int
    least: int
    argument: Operand
    room: Room


@dataclass(frozen=True)
class SlopeBetween:
    """
    The change of a float64 between the last two steps at which `at` held, per second.

    A step has `step` nanoseconds, one in groups that step at ticks. The slope, the last such tick
    (else the steps since), and the number there.
    """

    argument: Operand
    at: Operand
    step: int


@dataclass(frozen=True)
class Hold:
    """The argument at the last step at which the condition held. One number."""

    condition: Operand
    argument: Operand


@dataclass(frozen=True)
class TrialOutcome:
    """
    The outcome of the trial that is decided at this step; the parts are as in `Trial`.

    One number: the steps since the open trial began; in groups that step at ticks, its tick.
    """

    due: int | None
    begins: Operand
    good: Operand
    bad: Operand
    kept: Operand
    ends: Operand
    good_at_end: Operand


@dataclass(frozen=True)
class OutcomesTest:
    """Whether the test of `outcome` has not refuted; as `NotRefuted`. Two arrays of numbers."""

    outcome: Operand
    allowed: float
    rest: float
    limit: float


@dataclass(frozen=True)
class Overflowed:
    """Whether the queue of a cell, the argument, has lost what it would need now."""

    argument: Operand


@dataclass(frozen=True)
class PreviousNumber:
    """The value of a number at the step before; `initial` at the first step. One number."""

    initial: int | float
    argument: Operand


@dataclass(frozen=True)
class FeedbackRead:
    """The value of equation `index` of the group's `feedback` at the step before. One value."""

    index: int


Pure: TypeAlias = Read | Literal | Convert | ApplyUnary | ApplyBinary | Power | Choose
BitCell: TypeAlias = FirstStep | OnceEver | AlwaysSoFar | SinceEver | TriggeredEver
CounterCell: TypeAlias = OnceWithin | AlwaysWithin | OnceBefore | SinceWithin | SinceBefore
WindowState: TypeAlias = ValueAgo | Greatest | Total | TimeAtLeast | SlopeBetween
WindowCell: TypeAlias = WindowState | Rounded | Tally | Hold
TrialCell: TypeAlias = TrialOutcome | OutcomesTest
Cell: TypeAlias = (BitCell | CounterCell | WindowCell | TrialCell | Delay | SinceBetween
                   | Overflowed | PreviousNumber | FeedbackRead)
Operation: TypeAlias = Pure | Cell


@dataclass(frozen=True)
class Equation:
    """A value: its operation, its type, and the formula that it is the value of, if any."""

    operation: Operation
    type: ValueType
    formula: Formula | None


def is_exact_sum(equation: Equation) -> bool:
    """Whether an equation is a Total of float64, which has no value but its state."""
    return isinstance(equation.operation, Total) and equation.type.is_float


@dataclass(frozen=True)
class FeedbackEquation:
    """A value that is stored for the next step, and its name."""

    name: str
    type: ValueType
    next: Operand


@dataclass(frozen=True)
class Certain:
    """The margin of a Boolean leaf (its number): plus or minus infinity."""

    leaf: int


@dataclass(frozen=True)
class Distance:
    """How far two numbers (numbers of leaves) are from comparing otherwise, over a scale."""

    operator: BinaryOperator
    left: int
    right: int
    scale: float


@dataclass(frozen=True)
class Lesser:
    """The lesser of two margins."""

    left: Operand
    right: Operand


@dataclass(frozen=True)
class Greater:
    """The greater of two margins."""

    left: Operand
    right: Operand


@dataclass(frozen=True)
class MarginSince:
    """Of `p S q`: the greater of q, and of the lesser of p and this at the step before."""

    left: Operand
    right: Operand


@dataclass(frozen=True)
class MarginWithin:
    """The greatest margin of this step and the `bound` before; bound > 0. `room` as ValueAgo."""

    bound: int
    argument: Operand
    room: Room | None


@dataclass(frozen=True)
class MarginAgo:
    """The margin `steps` > 0 steps ago; that of FALSE if there is none. `room` as ValueAgo."""

    steps: int
    argument: Operand
    room: Room | None


@dataclass(frozen=True)
class MarginFeedback:
    """The margin at the step before of an equation, by its place in `Margins.feedback`."""

    index: int


MarginOperation: TypeAlias = (Certain | Distance | Lesser | Greater | MarginSince | MarginWithin
                              | MarginAgo | MarginFeedback)


@dataclass(frozen=True)
class MarginEquation:
    """A margin, the requirement it was added for, and the comparison that it is of, if any."""

    operation: MarginOperation
    owner: int
    formula: Formula | None


@dataclass(frozen=True)
class Margins:
    """
    What a group computes beside its verdicts: how far each is from being otherwise.

    Operands are indices of `equations`, those of `leaves` of the group's equations: the values
    that are compared. `roots` are in the order of the group's properties, `occurrences` as the
    group's. `feedback` are the margins that are kept for the next step.
    """

    leaves: tuple[Operand, ...]
    equations: tuple[MarginEquation, ...]
    roots: tuple[Operand, ...]
    occurrences: tuple[tuple[int, Operand], ...]
    feedback: tuple[Operand, ...]


@dataclass(frozen=True)
class StepGroup:
    """
    The requirements that read the same inputs.

    `signals` and `properties` are indices, ascending. `verdicts` are in the order of
    `properties`; `first_equations[i]` is the index of the first equation added for property i.
    `occurrences` are p for each property `H p` that reports occurrences, by property. `outputs`
    are numbers that are kept in the state after each step, by property; `tests` are the tests of
    probabilities, by property.

    With `is_timed` the group steps at ticks, of which most are left out (policy `timed`). A bound
    is a number of ticks, and a counter holds a tick. `margins` are there where they are asked for.
    """

    signals: tuple[int, ...]
    properties: tuple[int, ...]
    equations: tuple[Equation, ...]
    first_equations: tuple[int, ...]
    verdicts: tuple[Operand, ...]
    feedback: tuple[FeedbackEquation, ...]
    occurrences: tuple[tuple[int, Operand], ...] = ()
    is_timed: bool = False
    outputs: tuple[tuple[int, Operand], ...] = ()
    margins: Margins | None = None
    tests: tuple[tuple[int, Operand], ...] = ()


@dataclass(frozen=True)
class MonitorProgram:
    """The program of a bundle, from which C is generated."""

    name: str
    component: str
    policy: Policy
    period: float | None
    signals: tuple[Signal, ...]
    properties: tuple[Property, ...]
    groups: tuple[StepGroup, ...]
    definitions: tuple[tuple[str, Formula], ...]
    stamp: Stamp = Stamp.RECEIVED
    reorder: int = 0


def operands(operation: Operation) -> tuple[Operand, ...]:
    """Return the operands that an operation reads in the current step, left to right."""
    return tuple(item for item in vars(operation).values() if isinstance(item, Operand))


def room_of(operation: Operation | MarginOperation) -> Room | None:
    """Return the room of a cell with entries that are not a number of steps, else None."""
    room = getattr(operation, 'room', None)
    return room if isinstance(room, Room) else None


def lasts_a_tick(operation: Operation) -> bool:
    """Whether the value of a cell at the next step is what it stores at this one."""
    return isinstance(operation, FirstStep | PreviousNumber) \
        or (isinstance(operation, Delay) and operation.steps == 1)
