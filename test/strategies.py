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
Random well-typed formulas, traces and specifications, for tests.

One generator serves two drivers: `random.Random` for bulk (`random_formula`, `random_trace`,
`random_property`), and Hypothesis (`formulas`, `traces`), which also shrinks. Both see it as a
function `draw(n)` that gives a whole number from 0 to n-1; alternatives stand in the order of
their simplicity, so that Hypothesis shrinks to simple ones.
"""

from collections.abc import Callable, Sequence
import math
from random import Random
from typing import Any, TypeVar

from fret_monitor.logic.formula import (
    Aggregate, Ago, ALWAYS, Binary, BinaryOperator, Choice, Constant, Conversion, FALSE, Feedback,
    Formula, FTP, Held, Historically, Once, Over, postorder, Previous, Since, TimeOver, Triggered,
    TRUE, Unary, UnaryOperator, Variable, WeakYesterday, Window, Yesterday,
)
from fret_monitor.logic.specification import Property, Signal, Specification
from fret_monitor.logic.timed import TimedTrace
from fret_monitor.model.floats import to_float32
from fret_monitor.model.policies import Policy, Report, Severity
from fret_monitor.model.values import ValueType
from hypothesis import settings
from hypothesis import strategies as st
import pytest

Draw = Callable[[int], int]
Trace = dict[str, list[Any]]
T = TypeVar('T')
EXAMPLES = settings().max_examples  # of a test; `make thorough` has 500
IS_THOROUGH = EXAMPLES > 50
thorough = pytest.mark.skipif(not IS_THOROUGH, reason='make thorough')
HOT_PATHS = ('on', pytest.param('off', marks=thorough))  # ways in which a node takes messages

BOOL, INT64, UINT64 = ValueType.BOOL, ValueType.INT64, ValueType.UINT64
FLOAT32, FLOAT64 = ValueType.FLOAT32, ValueType.FLOAT64
TERM_TYPES = (INT64, FLOAT64, FLOAT32, UINT64)

INPUTS = (
    *(Variable(name, BOOL) for name in 'pqrs'),
    *(Variable(f'{letter}_{kind.value}', kind) for letter in 'xy' for kind in ValueType
      if kind.is_number),
)

# Around the sizes of words, of a shift register, and of one-byte counters.
SHORT_BOUNDS = (0, 1, 2, 3, 4, 7, 8, 9)
LONG_BOUNDS = (15, 16, 17, 31, 32, 33, 63, 64, 65, 127, 128, 129, 254, 255, 256, 257, 300)
HUGE_BOUNDS = (65534, 65535, 65536, 2 ** 31 - 2, 2 ** 31 - 1)

CONNECTIVES = tuple(item for item in BinaryOperator if item.is_boolean)
RELATIONS = tuple(item for item in BinaryOperator if item.is_relation)
ARITHMETIC = tuple(item for item in BinaryOperator
                   if not item.is_boolean and not item.is_relation
                   and item is not BinaryOperator.ATAN2)

_NASTY_FLOAT64 = (0.0, 1.0, -1.0, -0.0, 0.5, 2.0, 3.0, 0.1, 1 / 3, -2.5, 1e16, 2.0 ** 53,
                  2.0 ** 63, -2.0 ** 63, 2.0 ** 64, 5e-324, -5e-324, 2.2250738585072014e-308,
                  1.7976931348623157e308, 1e200, -1e200, 1e-200, 16777217.0, 9007199254740993.0)
_NASTY_FLOAT32 = (0.0, 1.0, -1.0, -0.0, 0.5, 2.0, 3.0, 0.1, 1 / 3, -2.5, 16777216.0, 16777215.0,
                  1.401298464324817e-45, -1.401298464324817e-45, 1.1754943508222875e-38,
                  3.4028234663852886e38, -3.4028234663852886e38, 1e20, 1e-20, 8388609.0)
_NOT_FINITE = (math.inf, -math.inf, math.nan)


def some[E](items: Sequence[E], share: int = 5) -> Sequence[E]:
    """Return one of `share` items; in `make thorough` all. FRET has 8 x 4 x 9 templates."""
    return items if IS_THOROUGH else items[::share]


def finite_values(kind: ValueType) -> tuple[Any, ...]:
    """Return values of a type on which mistakes show, all finite, simple ones first."""
    if kind is BOOL:
        return (False, True)
    if kind is FLOAT64:
        return _NASTY_FLOAT64
    if kind is FLOAT32:
        return tuple(to_float32(value) for value in _NASTY_FLOAT32)
    low, high = kind.limits
    usual = (0, 1, -1, 2, 3, -3, 7, 10, 100, high, low, high - 1, low + 1, high // 2, 2 ** 32,
             2 ** 53 + 1, -2 ** 53 - 1, 2 ** 62 + 1, 3037000500)
    return tuple(dict.fromkeys(value for value in usual if low <= value <= high))


def all_values(kind: ValueType) -> tuple[Any, ...]:
    """Return values of a type on which mistakes show, including infinities and NaN."""
    return finite_values(kind) + (_NOT_FINITE if kind.is_float else ())


class FormulaMaker:
    """
    Makes random formulas over given inputs.

    `reach` is the largest bound of a window in the formulas: 300 takes `LONG_BOUNDS` in, more the
    `HUGE_BOUNDS` up to it, those only where no delay line that long is needed. Where `bounds` is
    given, the bounds are those, and sums of two.
    `feedback` are Feedback nodes to use as if they were inputs. Without `has_windows` there are no
    numbers over time.
    """

    def __init__(self, draw: Draw, inputs: Sequence[Variable] = INPUTS, *, reach: int = 300,
                 feedback: Sequence[Feedback] = (), bounds: Sequence[int] = (),
                 has_windows: bool = True) -> None:
        """Start with no terms to share."""
        self._draw = draw
        self._has_windows = has_windows
        self._leaves: list[Formula] = [*inputs, *feedback]
        usual = (*SHORT_BOUNDS, *LONG_BOUNDS)
        self._bounds = bounds or tuple(bound for bound in usual if bound <= reach)
        self._far_bounds = bounds or tuple(bound for bound in (*usual, *HUGE_BOUNDS)
                                           if bound <= reach)
        self._made: dict[ValueType, list[Formula]] = {}

    def formula(self, size: int) -> Formula:
        """Return a BOOL formula of at most about `size` nodes."""
        if size <= 1:
            return self._boolean_leaf()
        return self._shared(BOOL, lambda: self._boolean(size - 1))

    def term(self, kind: ValueType, size: int) -> Formula:
        """Return a number of one of the four types of terms, of at most about `size` nodes."""
        if size <= 1:
            return self._number_leaf(kind)
        return self._shared(kind, lambda: self._number(kind, size - 1))

    def window(self) -> Window:
        """Return a window of any form."""
        match self._draw(10):
            case 0 | 1:
                return ALWAYS
            case 2 | 3:
                return Window(0, self._pick(self._far_bounds))
            case 4:
                return Window(self._pick(self._far_bounds), None)
            case 5:
                return self._pick((Window(0, -1), Window(3, 2), Window(300, 0)))
            case 6:
                low = self._pick(self._bounds)
                return Window(low, low)
            case _:
                low = self._pick(self._bounds)
                return Window(low, low + self._pick(self._far_bounds))

    def _pick(self, items: Sequence[T]) -> T:
        return items[self._draw(len(items))]

    def _shared(self, kind: ValueType, make: Callable[[], Formula]) -> Formula:
        made = self._made.setdefault(kind, [])
        if made and self._draw(8) == 7:
            return self._pick(made)
        formula = make()
        made.append(formula)
        return formula

    def _boolean_leaf(self) -> Formula:
        inputs = [leaf for leaf in self._leaves if leaf.type is BOOL]
        numbers = [leaf for leaf in self._leaves if leaf.type is not BOOL]
        alternatives = 3 if inputs else 0
        match self._draw(alternatives + 2 + bool(numbers)) - alternatives:
            case 0:
                return self._pick((TRUE, FALSE))
            case 1:
                return FTP
            case 2:
                return self._relation(2)
            case _:
                return self._pick(inputs)

    def _boolean(self, size: int) -> Formula:
        match self._draw(18):
            case 0:
                return Unary(UnaryOperator.NOT, self.formula(size))
            case 1 | 2 | 3:
                return self._pair(self._pick(CONNECTIVES), size)
            case 4:
                return Yesterday(self.formula(size))
            case 5:
                return WeakYesterday(self.formula(size))
            case 6 | 7:
                return Once(self.window(), self.formula(size))
            case 8 | 9:
                return Historically(self.window(), self.formula(size))
            case 10 | 11:
                return Since(self.window(), self.formula(size // 2), self.formula(size // 2))
            case 12 | 13:
                return Triggered(self.window(), self.formula(size // 2), self.formula(size // 2))
            case 14 | 15:
                return self._relation(size)
            case 16:
                third = size // 3
                return Choice(self.formula(third), self.formula(third), self.formula(third))
            case _:
                return self._rare_boolean(size)

    def _rare_boolean(self, size: int) -> Formula:
        if self._has_windows and self._draw(4) == 3:
            past = self.past()
            return TimeOver(past, self._draw(past + 2) if past < 2 ** 31 else past // 2,
                            self.formula(size))
        if self._draw(2):
            return Previous(self.formula(size // 3), self.formula(size // 2))
        return self._pair(self._pick((BinaryOperator.EQ, BinaryOperator.NE)), size)

    def _pair(self, operator: BinaryOperator, size: int) -> Formula:
        return Binary(operator, self.formula(size // 2), self.formula(size // 2))

    def _relation(self, size: int) -> Formula:
        kind = self._pick(TERM_TYPES)
        other = kind
        if kind in (INT64, UINT64) and self._draw(4) == 3:
            other = UINT64 if kind is INT64 else INT64
        left = self.term(kind, size // 2)
        return Binary(self._pick(RELATIONS), left, self.term(other, size // 2))

    def _number_leaf(self, kind: ValueType) -> Formula:
        leaves = [as_term(leaf, kind) for leaf in self._leaves if becomes(leaf.type, kind)]
        if leaves and self._draw(3) < 2:
            return self._pick(leaves)
        return Constant(self._pick(finite_values(kind)), kind)

    def _number(self, kind: ValueType, size: int) -> Formula:
        match self._draw(15 if self._has_windows else 12):
            case 12 | 13 | 14:
                return self._over_time(kind, size)
            case 0:
                return Unary(UnaryOperator.NEG, self.term(kind, size))
            case 1 if kind is FLOAT64 and self._draw(2) and self._has_number():
                return self._mathematics()
            case 1:
                return Unary(UnaryOperator.ABS, self.term(kind, size))
            case 2 | 3 | 4 | 5 | 6 | 7:
                return self._arithmetic(self._pick(ARITHMETIC), kind, size)
            case 8:
                yes, no = self.term(kind, size // 3), self.term(kind, size // 3)
                return Choice(self.formula(size // 3), yes, no)
            case 9 | 10:
                return self._previous(kind, size)
            case _:
                return self._converted(kind, size)

    def past(self) -> int:
        """Return the length of a window of numbers, each of which takes room."""
        return self._pick(self._bounds)

    def messages(self) -> Formula:
        """Return when there is a value for a sum, a mean or a count."""
        return TRUE

    def _over_time(self, kind: ValueType, size: int) -> Formula:
        match self._draw(6):
            case 0:
                x = self.term(kind, size)
                return Binary(BinaryOperator.SUB, x, Ago(self.past(), x))
            case 1:
                return Held(self.formula(size // 2), self.term(kind, size // 2))
            case 2 | 3 if kind is not FLOAT32:
                aggregate = Aggregate.SUM
                if kind is not UINT64 and self._draw(2):
                    aggregate = Aggregate.COUNT if kind is INT64 else Aggregate.MEAN
                of = self.formula(size) if aggregate is Aggregate.COUNT else self.term(kind, size)
                return Over(aggregate, self.past(), of, self.messages())
            case _:
                aggregate = self._pick((Aggregate.GREATEST, Aggregate.LEAST))
                return Over(aggregate, self.past(), self.term(kind, size), TRUE)

    def _mathematics(self) -> Formula:
        # Of an input, for the same reason as in `_power`.
        operators = [item for item in UnaryOperator if item.is_library]
        numbers = [as_term(leaf, FLOAT64) for leaf in self._leaves if becomes(leaf.type, FLOAT64)]
        if self._draw(8) == 0:
            return Binary(BinaryOperator.ATAN2, self._pick(numbers), self._pick(numbers))
        return Unary(self._pick(operators), self._pick(numbers))

    def _arithmetic(self, operator: BinaryOperator, kind: ValueType, size: int) -> Formula:
        if operator is BinaryOperator.POW:
            return self._power(kind, size)
        return Binary(operator, self.term(kind, size // 2), self.term(kind, size // 2))

    def _power(self, kind: ValueType, size: int) -> Formula:
        # The exponent of a C pow has an input in it: a compiler that folds pow of two constants
        # rounds better than libm does.
        if kind is FLOAT64 and self._draw(2) and self._has_number():
            exponent = self._pick([as_term(leaf, FLOAT64) for leaf in self._leaves
                                   if becomes(leaf.type, FLOAT64)])
            return Binary(BinaryOperator.POW, self.term(kind, size - 1), exponent)
        times = self._pick((2, 3, 0, 1, 4, 5, 7, 10, 63, 64, 1000, 2 ** 63 - 1))
        return Binary(BinaryOperator.POW, self.term(kind, size - 1), Constant(times, INT64))

    def _has_number(self) -> bool:
        return any(becomes(leaf.type, FLOAT64) for leaf in self._leaves)

    def _previous(self, kind: ValueType, size: int) -> Formula:
        initial: Formula = Constant(self._pick(finite_values(kind)), kind)
        if self._draw(3) == 2:
            initial = self.term(kind, size // 3)
        return Previous(initial, self.term(kind, size // 2))

    def _converted(self, kind: ValueType, size: int) -> Formula:
        sources = [source for source in TERM_TYPES if source is not kind
                   and becomes(source, kind)]
        if not sources:
            return self._arithmetic(BinaryOperator.ADD, kind, size)
        return Conversion(self.term(self._pick(sources), size), kind)


def becomes(source: ValueType, kind: ValueType) -> bool:
    """Tell whether a value of one type is one of the other, or can be converted to it."""
    if source is kind:
        return True
    if kind is FLOAT64:
        return source is not BOOL
    if kind is INT64:
        return source.is_integer
    return kind is UINT64 and source is INT64


def as_term(leaf: Formula, kind: ValueType) -> Formula:
    """Return a leaf as a term of a type that it `becomes`."""
    return leaf if leaf.type is kind else Conversion(leaf, kind)


def random_formula(rng: Random, inputs: Sequence[Variable] = INPUTS, *, size: int = 12,
                   reach: int = 300) -> Formula:
    """Return a random BOOL formula of at most about `size` nodes."""
    return FormulaMaker(rng.randrange, inputs, reach=reach).formula(1 + rng.randrange(size))


def on_both_scales(draw: Draw, depth: int, grid: int) -> tuple[Formula, Formula]:
    """
    Return one formula about p and q, with bounds in steps and in ticks, `grid` ticks a step.

    It has no Y, Z, pre and FTP, which look back one tick instead of one step. In its p S[a,b] q,
    q implies p. Otherwise a step at which q holds, and p does not, counts as a whole for steps:
    it satisfies p S[1,1] q one step later. On ticks p would have to hold within that step, after
    its first tick. In p T[a,b] q, p implies q, for the same reason.
    """
    if depth == 0:
        leaf = INPUTS[draw(2)]
        return leaf, leaf
    (p, p_wide), (q, q_wide) = (on_both_scales(draw, depth - 1, grid) for _ in range(2))
    low, more = (0, 0, 1, 2, 5)[draw(5)], (None, 0, 1, 2, 7)[draw(5)]
    window = Window(low, None if more is None else low + more)
    wide = Window(low * grid, None if more is None else (low + more) * grid)
    both, either = BinaryOperator.AND, BinaryOperator.OR
    match draw(5):
        case 0:
            return Once(window, p), Once(wide, p_wide)
        case 1:
            return Historically(window, p), Historically(wide, p_wide)
        case 2:
            return (Since(window, Binary(either, p, q), q),
                    Since(wide, Binary(either, p_wide, q_wide), q_wide))
        case 3:
            return (Triggered(window, Binary(both, p, q), q),
                    Triggered(wide, Binary(both, p_wide, q_wide), q_wide))
        case _:
            operator = CONNECTIVES[draw(len(CONNECTIVES))]
            return Binary(operator, p, q), Binary(operator, p_wide, q_wide)


def random_inputs(rng: Random, inputs: Sequence[Variable] = INPUTS,
                  most: int = 5) -> tuple[Variable, ...]:
    """Return one to `most` of the inputs, so that formulas fall into different step groups."""
    return tuple(rng.sample(list(inputs), rng.randint(1, min(most, len(inputs)))))


def make_trace(draw: Draw, inputs: Sequence[Variable], steps: int) -> Trace:
    """Return a column of `steps` values for each input."""
    return {item.name: _column(draw, item.type, steps) for item in inputs}


def random_trace(rng: Random, inputs: Sequence[Variable], steps: int) -> Trace:
    """Return a column of `steps` values for each input."""
    return make_trace(rng.randrange, inputs, steps)


def make_timed_trace(draw: Draw, inputs: Sequence[Variable], rows: int,
                     gaps: Sequence[int]) -> TimedTrace:
    """Return rows of values some `gaps` apart; the trace ends none or one of them later."""
    ticks = [0]
    while len(ticks) < rows:
        ticks.append(ticks[-1] + gaps[draw(len(gaps))])
    end = ticks[-1] + (0, *gaps)[draw(len(gaps) + 1)]
    return TimedTrace(ticks, make_trace(draw, inputs, rows), end)


def make_close_trace(draw: Draw, inputs: Sequence[Variable], rows: int,
                     bounds: Sequence[int]) -> TimedTrace:
    """
    Return rows that often come at a deadline of earlier ones, a nanosecond before or after it.

    The trace ends after the deadlines of the last row.
    """
    gaps = sorted({max(1, bound + change) for bound in bounds for change in (-1, 0, 1)})
    ticks = [0]
    while len(ticks) < rows:
        tick = ticks[-1 - draw(min(3, len(ticks)))] + gaps[draw(len(gaps))]
        ticks.append(tick if tick > ticks[-1] else ticks[-1] + gaps[draw(len(gaps))])
    return TimedTrace(ticks, make_trace(draw, inputs, rows), ticks[-1] + 2 * gaps[-1] + 2)


def _column(draw: Draw, kind: ValueType, steps: int) -> list[Any]:
    """
    Return values that change now at every step, now after a long while.

    A column uses few values, so that equal ones meet and bounded operators see long runs.
    """
    pool = _pool(draw, kind)
    longest = (1, 2, 5, 20, 100, 400)[draw(6)]
    column: list[Any] = []
    while len(column) < steps:
        value = pool[draw(len(pool))]
        column.extend([value] * (1 + draw(longest)))
    return column[:steps]


def _pool(draw: Draw, kind: ValueType) -> list[Any]:
    values = all_values(kind)
    if kind is BOOL:
        # Mostly true, mostly false, or fair.
        return [False, True] + [bool(draw(2))] * (0, 3, 15)[draw(3)]
    return [values[draw(len(values))] for _ in range(1 + draw(6))]


def random_property(rng: Random, name: str, inputs: Sequence[Variable] = INPUTS, *,
                    size: int = 12, reach: int = 300, loops: int = 0) -> Property:
    """Return a requirement of a random formula; `loops` is the most equations with feedback."""
    kinds = (BOOL, *TERM_TYPES)
    nodes = [Feedback(f'{name}_{index}', rng.choice(kinds)) for index in range(loops)]
    maker = FormulaMaker(rng.randrange, inputs, reach=reach, feedback=nodes)
    formula = maker.formula(1 + rng.randrange(size))
    equations = {node: maker.formula(size) if node.type is BOOL else maker.term(node.type, size)
                 for node in nodes}
    return property_of(name, formula, _reached(formula, equations))


def _reached(formula: Formula,
             equations: dict[Feedback, Formula]) -> tuple[tuple[Feedback, Formula], ...]:
    found: dict[Feedback, Formula] = {}
    roots = [formula]
    while roots:
        for node in postorder([roots.pop()]):
            if isinstance(node, Feedback) and node not in found:
                found[node] = equations[node]
                roots.append(equations[node])
    return tuple(found.items())


def property_of(name: str, formula: Formula,
                feedback: tuple[tuple[Feedback, Formula], ...] = ()) -> Property:
    """Return a requirement with nothing but an id and a formula."""
    return Property(name, 'handlerprop' + name.replace('-', '_'), name, '', formula,
                    Report.EVERY_STEP, Severity.ERROR, feedback)


def specification_of(properties: Sequence[Property], inputs: Sequence[Variable] = INPUTS,
                     policy: Policy = Policy.EVERY_MESSAGE) -> Specification:
    """Return a specification in which each input has a topic of its own."""
    signals = tuple(_signal(item) for item in inputs)
    return Specification('random', '', signals, tuple(properties), policy, None)


def _signal(item: Variable) -> Signal:
    name = item.type.value.capitalize().replace('Uint', 'UInt')
    return Signal(item.name, item.type, f'topic/{item.name}', f'std_msgs/msg/{name}', ('data',),
                  (), None, ())


def _below(draw: st.DrawFn) -> Draw:
    return lambda n: draw(st.integers(0, n - 1))


@st.composite
def formulas(draw: st.DrawFn, inputs: Sequence[Variable] = INPUTS, *, size: int = 12,
             reach: int = 300, has_windows: bool = True) -> Formula:
    """Draw a BOOL formula of at most about `size` nodes; shrinks to small and simple ones."""
    maker = FormulaMaker(_below(draw), inputs, reach=reach, has_windows=has_windows)
    return maker.formula(draw(st.integers(1, size)))


@st.composite
def traces(draw: st.DrawFn, inputs: Sequence[Variable] = INPUTS, *, longest: int = 60) -> Trace:
    """Draw a trace of at most `longest` steps; shrinks to short ones of simple values."""
    return make_trace(_below(draw), inputs, draw(st.integers(1, longest)))


@st.composite
def timed_traces(draw: st.DrawFn, inputs: Sequence[Variable] = INPUTS, *, longest: int = 12,
                 gaps: Sequence[int] = (1, 2, 3, 5, 9)) -> TimedTrace:
    """Draw a timed trace of at most `longest` rows; shrinks to short ones of simple values."""
    return make_timed_trace(_below(draw), inputs, draw(st.integers(1, longest)), gaps)
