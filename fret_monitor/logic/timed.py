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
The reference semantics under `timed`: the value of a formula at every nanosecond of a trace.

The policy `timed` means what a step at every nanosecond would give. A value is therefore a
function of ticks that changes at few of them, a `History`, and each operator is computed from its
definition in docs/language.md on whole intervals of ticks. Compiled monitors are tested against
it, so it shares no code with `program` and `codegen`. Nodes without past have their meaning from
`pointwise`, as those of `evaluate`, which takes each step.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
import math
from typing import assert_never, TypeAlias

from fret_monitor.logic.evaluate import Equations, Trace
from fret_monitor.logic.formula import (
    Ago, Binary, Choice, Constant, Conversion, Feedback, Formula, Held, Historically,
    MessageSlope, NotRefuted, Once, operands, Over, postorder, Previous, Since, Slope,
    TimeOver, Trial, Triggered, Unary, Variable, WeakYesterday, Window, Yesterday,
)
from fret_monitor.logic.pointwise import (
    aggregate, at_start, checked, Compute, operation, slope, TraceError, Value,
)
from fret_monitor.logic.trials import OpenTrial, SequentialTest

# The first tick of each interval in which a value stays the same, and that value. The first
# interval starts at tick 0; adjacent intervals differ.
History: TypeAlias = list[tuple[int, Value]]

# First and last tick of intervals.
_Spans: TypeAlias = list[tuple[int, int]]

_MAX_FEEDBACK_CHANGES = 4_000
_MAX_MESSAGES = 200_000


@dataclass(frozen=True)
class TimedTrace:
    """
    The values of inputs over time: each holds its value of a row until the next row.

    `ticks` has the time of each row in nanoseconds, `columns` the values of each input, one for
    each row. The trace goes on until `end`, the last tick.

    Raises
    ------
    TraceError
        if the first row is not at tick 0, ticks do not increase, or `end` is before the last row.
    """

    ticks: Sequence[int]
    columns: Trace
    end: int

    def __post_init__(self) -> None:
        """Check the ticks."""
        if not self.ticks or self.ticks[0] != 0:
            raise TraceError('the first row is not at tick 0')
        if any(later <= earlier for earlier, later in pairwise([*self.ticks, self.end + 1])):
            raise TraceError('the ticks of rows do not increase up to the end')


def evaluate_timed(formulas: Sequence[Formula], trace: TimedTrace,
                   feedback: Equations = ()) -> list[History]:
    """
    Return the value of each formula at every tick of a trace.

    `feedback` has the equation of each `Feedback` node in the formulas. Equations must settle:
    while the inputs stay the same, their values change at few ticks.

    Raises
    ------
    TraceError
        if an input has no column, columns differ in length from the ticks, a value is not of the
        input's type, or an equation does not settle.
    """
    nodes = postorder([*formulas, *(equation for _, equation in feedback)])
    guess: dict[Formula, History] = {node: [(0, at_start(node.type))] for node, _ in feedback}
    # Guess that the feedback never changes again. A value depends on feedback of earlier ticks
    # only, so the guess is right up to the first tick at which its equations contradict it, and
    # the equations are right about that tick too.
    for _ in range(_MAX_FEEDBACK_CHANGES):
        found = _evaluate_nodes(nodes, trace, guess)
        computed = {node: _shift(found[equation], at_start(node.type), trace.end)
                    for node, equation in feedback}
        wrong = [_first_difference(guess[node], computed[node]) for node in computed]
        first = min((tick for tick in wrong if tick is not None), default=None)
        if first is None:
            return [found[formula] for formula in formulas]
        guess = {node: [piece for piece in history if piece[0] <= first]
                 for node, history in computed.items()}
    raise TraceError(f'an equation changes its value at more than {_MAX_FEEDBACK_CHANGES} ticks')


def value_at(history: History, tick: int) -> Value:
    """Return the value of a history at a tick."""
    return next(value for start, value in reversed(history) if start <= tick)


def verdict_rows(histories: Sequence[History], trace: TimedTrace) -> list[tuple[int, list[Value]]]:
    """Return the values at each row of a trace, and at each tick at which one has changed."""
    changes = {start for history in histories for start, _ in history}
    ticks = sorted(changes.union(trace.ticks))
    columns = [_sampled(history, ticks) for history in histories]
    return [(tick, [column[row] for column in columns]) for row, tick in enumerate(ticks)]


def _evaluate_nodes(nodes: Sequence[Formula], trace: TimedTrace,
                    feedback: Mapping[Formula, History]) -> dict[Formula, History]:
    found: dict[Formula, History] = {}
    for node in nodes:
        arguments = [found[item] for item in operands(node)]
        found[node] = feedback[node] if node in feedback else _evaluate(node, arguments, trace)
    return found


def _evaluate(node: Formula, arguments: Sequence[History], trace: TimedTrace) -> History:
    """Return the history of a node from those of its operands."""
    end = trace.end
    match node:
        case Constant() | Conversion() | Unary() | Binary() | Choice():
            return _pointwise(operation(node), arguments)
        case Variable():
            return _stored(node, trace)
        case Previous():
            initial, argument = arguments
            return _shift(argument, initial[0][1], end)
        case Feedback():
            raise TraceError(f"no equation for '{node.name}'")
        case Yesterday():
            return _shift(arguments[0], False, end)
        case WeakYesterday():
            return _shift(arguments[0], True, end)
        case Once():
            return _history(_once(node.window, _true(arguments[0], end), end), end)
        case Historically():
            # p at every k of the window: not at some such k not p.
            return _not(_history(_once(node.window, _false(arguments[0], end), end), end))
        case Since():
            p, q = arguments
            return _history(_since(node.window, _true(p, end), _true(q, end), end), end)
        case Triggered():
            p, q = arguments
            return _not(_history(_since(node.window, _false(p, end), _false(q, end), end), end))
        case Over():
            return _over(node, arguments[0], _true(arguments[1], end), end)
        case Ago():
            (_, first), *later = arguments[0]
            moved = ((tick + node.past, value) for tick, value in later)
            return _canonical([(0, first), *(piece for piece in moved if piece[0] <= end)])
        case Held():
            return _held(*arguments)
        case Slope():
            ticks = _expanded(_true(arguments[1], end))
            pairs = pairwise(zip(ticks, _sampled(arguments[0], ticks), strict=True))
            assert node.step == 1
            return _canonical([(0, 0.0), *((now[0], slope(before, now)) for before, now in pairs)])
        case MessageSlope():
            ticks = _expanded(_true(arguments[1], end))
            times, values = (_sampled(arguments[place], ticks) for place in (2, 0))
            points = [*zip(times, values, strict=True)]
            return _canonical([(0, 0.0), *zip(ticks[1:], map(slope, points, points[1:]),
                                              strict=True)])
        case TimeOver():
            return _history(_lasting(node, _true(arguments[0], end), end), end)
        case Trial():
            return _outcomes(node, arguments, end)
        case NotRefuted():
            return _tested(node, arguments[0], end)
        case _:
            assert_never(node)


# Operators with a window, on the intervals in which their operands are true.

def _once(window: Window, p: _Spans, end: int) -> _Spans:
    """Return the ticks t for which p holds at some k with low <= t - k <= high."""
    if window.is_empty:
        return []
    high = end if window.high is None else window.high
    return [(first + window.low, last + high) for first, last in p]


def _since(window: Window, p: _Spans, q: _Spans, end: int) -> _Spans:
    """Return the t for which q holds at such a k, and p at every tick k+1..t."""
    if window.is_empty:
        return []
    # With k = t no p is asked for. Otherwise k+1 and t lie in one interval of p, and k in one of
    # q. Each such k reaches the ticks from k + low to k + high up to the end of the interval of
    # p. Those of all k together have no gap, because those of k and k+1 have none.
    high = end if window.high is None else window.high
    found = list(q) if window.low == 0 else []
    for first, last in p:
        for q_first, q_last in q:
            k_first, k_last = max(q_first, first - 1), min(q_last, last - 1)
            if k_first <= k_last:
                found.append((k_first + window.low, min(k_last + high, last)))
    return found


def _true(p: History, end: int) -> _Spans:
    """Return the intervals in which p is true."""
    starts = [start for start, _ in p]
    return [(start, following - 1) for (start, value), following
            in zip(p, [*starts[1:], end + 1], strict=True) if value]


def _false(p: History, end: int) -> _Spans:
    """Return the intervals in which p is false."""
    return _true(_not(p), end)


def _not(p: History) -> History:
    return [(start, not value) for start, value in p]


def _history(spans: _Spans, end: int) -> History:
    """Return the history that is true in the union of some intervals, cut off at the end."""
    pieces: History = [(0, False)]
    reached = -1
    for first, last in sorted(spans):
        if last <= reached or first > last:
            continue
        pieces += [(max(first, reached + 1), True), (last + 1, False)]
        reached = last
    return _canonical(piece for piece in pieces if piece[0] <= end)


# Numbers over time (docs/over_time.md).

def _over(node: Over, argument: History, at: _Spans, end: int) -> History:
    """Return the aggregate of the values that are in the window."""
    ends = [start - 1 for start, _ in argument[1:]] + [end]
    spans = [(start, last, value) for (start, value), last in zip(argument, ends, strict=True)]
    if not node.aggregate.is_extreme:
        # Each tick at which `at` is true is a value of its own.
        ticks = _expanded(at)
        values = _sampled(argument, ticks)
        spans = [(tick, tick, value) for tick, value in zip(ticks, values, strict=True)]
    compute = aggregate(node)
    starts, ends = [first for first, _, _ in spans], [last for _, last, _ in spans]
    edges = {0}.union(starts, (last + node.past + 1 for last in ends))
    return _canonical((tick, compute([value for _, _, value in spans[
        bisect_left(ends, tick - node.past):bisect_right(starts, tick)]]))
                      for tick in sorted(edges) if tick <= end)


def _expanded(spans: _Spans) -> list[int]:
    """Return each tick of some intervals, which are those of messages: short."""
    if sum(last - first + 1 for first, last in spans) > _MAX_MESSAGES:
        raise TraceError(f'messages come at more than {_MAX_MESSAGES} ticks')
    return [tick for first, last in spans for tick in range(first, last + 1)]


def _held(condition: History, argument: History) -> History:
    ticks = sorted({start for start, _ in [*condition, *argument]})
    rows = zip(ticks, _sampled(condition, ticks), _sampled(argument, ticks), strict=True)
    return _canonical((tick, value) for tick, holds, value in rows if holds or tick == 0)


def _lasting(node: TimeOver, p: _Spans, end: int) -> _Spans:
    """Return the ticks t at which p holds at `least` of the ticks t - past + 1 .. t."""
    edges = sorted({0, end + 1}.union(*(
        {first, last + 1, first + node.past, last + 1 + node.past} for first, last in p)))
    found: _Spans = []
    for start, following in pairwise(edge for edge in edges if edge <= end + 1):
        # Between two edges the number of ticks changes by the same each tick.
        counts = [sum(max(0, min(last, tick) - max(first, tick - node.past + 1) + 1)
                      for first, last in p) for tick in (start, following - 1)]
        change = (counts[1] > counts[0]) - (counts[1] < counts[0])
        first = start + max(0, node.least - counts[0]) if change > 0 else start
        final = start + counts[0] - node.least if change < 0 else following - 1
        if max(counts) >= node.least:
            found.append((first, min(final, following - 1)))
    return found


# OpenTrial (docs/probability.md).

def _outcomes(node: Trial, arguments: Sequence[History], end: int) -> History:
    """Return the outcomes of trials, each at one tick; it takes a step where one can change."""
    trials = OpenTrial(node)
    starts = sorted({0}.union(start for history in arguments for start, _ in history))
    pieces: History = []
    tick: float = 0
    while tick <= end:
        now = int(tick)
        parts = [value_at(history, now) is True for history in arguments]
        outcome = trials.outcome(now, *parts)
        pieces.append((now, outcome))
        nexts = [math.inf, *starts[bisect_right(starts, now):][:1]]
        if trials.begun is not None and node.due is not None:
            nexts.append(trials.begun + node.due)
        tick = min([*nexts, now + 1] if outcome else nexts)
    return _canonical(pieces)


def _tested(node: NotRefuted, outcomes: History, end: int) -> History:
    test = SequentialTest(node)
    starts = [start for start, _ in outcomes]
    pieces: History = [(0, True)]
    for (start, outcome), following in zip(outcomes, [*starts[1:], end + 1], strict=True):
        for tick in range(start, following) if outcome else ():
            pieces.append((tick, test.take(int(outcome))))
    return _canonical(pieces)


# Other nodes.

def _shift(argument: History, at_zero: Value, end: int) -> History:
    """Return the value of one tick before; at tick 0 `at_zero`."""
    later = [(start + 1, value) for start, value in argument if start < end]
    return _canonical([(0, at_zero), *later])


def _stored(node: Variable, trace: TimedTrace) -> History:
    if node.name not in trace.columns:
        raise TraceError(f"no column for the input '{node.name}'")
    column = trace.columns[node.name]
    if len(column) != len(trace.ticks):
        raise TraceError(f'{node.name}: {len(column)} values for {len(trace.ticks)} ticks')
    values = [checked(value, node.type, node.name) for value in column]
    return _canonical(zip(trace.ticks, values, strict=True))


def _pointwise(compute: Compute, arguments: Sequence[History]) -> History:
    ticks = sorted({0}.union(start for history in arguments for start, _ in history))
    columns = [_sampled(history, ticks) for history in arguments]
    return _canonical((tick, compute(*(column[row] for column in columns)))
                      for row, tick in enumerate(ticks))


def _sampled(history: History, ticks: Iterable[int]) -> list[Value]:
    """Return the values at ticks that increase from 0."""
    values: list[Value] = []
    rest = iter([*history[1:], (math.inf, False)])
    (_, value), (until, following) = history[0], next(rest)
    for tick in ticks:
        while until <= tick:
            value, (until, following) = following, next(rest)
        values.append(value)
    return values


def _canonical(pieces: Iterable[tuple[int, Value]]) -> History:
    """Join adjacent intervals of one value; of several with one start, take the last."""
    found: History = []
    for start, value in pieces:
        if found and found[-1][0] == start:
            found.pop()
        if not found or not _is_same(found[-1][1], value):
            found.append((start, value))
    return found


def _is_same(a: Value, b: Value) -> bool:
    """Return whether values are equal in every operation: 0.0 is not -0.0, a NaN is a NaN."""
    if isinstance(a, float) and isinstance(b, float):
        both_nan = math.isnan(a) and math.isnan(b)
        return both_nan or (a == b and math.copysign(1, a) == math.copysign(1, b))
    return a == b


def _first_difference(left: History, right: History) -> int | None:
    """Return the first tick at which two histories differ."""
    ticks = sorted({start for start, _ in [*left, *right]})
    pairs = zip(ticks, _sampled(left, ticks), _sampled(right, ticks), strict=True)
    return next((tick for tick, a, b in pairs if not _is_same(a, b)), None)
