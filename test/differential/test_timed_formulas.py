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
Compiled C under `timed` gives the verdicts of the reference at every nanosecond.

A group is stepped at the rows of a trace and at the deadlines that it returns, and its verdicts
hold until the next evaluation. So a verdict that changes before the deadline, or at no evaluation,
differs from the reference.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from random import Random

from differential.compiled import Compiled
from differential.test_small_formulas import as_fret_writes, two_deep
from differential.timed_monitor import TimedMonitor, TimedRun
import facts
from fret.sentences import formalise, INPUTS as TEMPLATE_INPUTS, sentence_for
from fret.test_shared_data import meaning
from fret_monitor.bundle.bundle import Language
from fret_monitor.logic.formula import (
    ALWAYS, Binary, BinaryOperator, Choice, Constant, Feedback, Formula, FTP, Historically, Once,
    postorder, Previous, Since, Slope, Triggered, TRUE, Unary, UnaryOperator, Variable, Window,
    Yesterday,
)
from fret_monitor.logic.specification import Property, Specification
from fret_monitor.logic.timed import evaluate_timed, History, TimedTrace, value_at
from fret_monitor.model.policies import Policy, Report
from fret_monitor.model.values import ValueType
from hypothesis import given, settings
from hypothesis import strategies as st
import pytest
from strategies import (
    Draw, EXAMPLES, FormulaMaker, INPUTS, make_close_trace, make_timed_trace, on_both_scales,
    property_of, random_inputs, some, specification_of,
)

BOOL, INT64 = ValueType.BOOL, ValueType.INT64
P, Q = Variable('p', BOOL), Variable('q', BOOL)
FAST = ('-std=c99', '-O0', '-fPIC', '-ffp-contract=off')
SECOND = 10 ** 9
LAST_TICK = 2 ** 62 - 3  # FM_LAST_TICK


@dataclass(frozen=True)
class Scale:
    """
    The bounds of formulas.

    A window [a,a] needs room for each change within a: at most `longest_exact` ticks are looked
    back so, at inputs of `max_rate` messages a second.
    """

    bounds: tuple[int, ...]
    longest_exact: int
    max_rate: Fraction


SCALES = {
    'ticks': Scale((0, 1, 2, 3, 5, 9), 100, Fraction(10 ** 9)),
    'seconds': Scale((0, 1, SECOND, SECOND + 1, 2 * SECOND, 10 * SECOND - 1, 10 * SECOND),
                     20 * SECOND, Fraction(500)),
    'both': Scale((0, 1, 2, 100, SECOND - 1, SECOND), 1000, Fraction(10 ** 9)),
    'huge': Scale((0, 1, 2 ** 31 - 1, 2 ** 31, 2 ** 32, 2 ** 53 + 1, 2 ** 60, 2 ** 61), 16,
                  Fraction(1)),
}


def no(p: Formula) -> Formula:
    return Unary(UnaryOperator.NOT, p)


def is_narrow(window: Window) -> bool:
    """Tell whether a window needs room for thousands of intervals."""
    low, high = window.low, window.high
    return high is not None and low < high and high // (high - low) > 2000


class TimedFormulaMaker(FormulaMaker):
    """Makes formulas with the bounds of a scale."""

    def __init__(self, draw: Draw, scale: Scale, inputs: Sequence[Variable] = INPUTS) -> None:
        """Start with no terms to share."""
        super().__init__(draw, inputs, bounds=scale.bounds)
        self._scale = scale

    def past(self) -> int:
        """Return the length of a window that has room for all changes within it."""
        return self._pick([bound for bound in self._scale.bounds
                           if bound <= self._scale.longest_exact])

    def messages(self) -> Formula:
        """Return when a message comes: at one tick each time."""
        event = self.formula(1)
        return Binary(BinaryOperator.AND, event, no(Yesterday(event)))

    def _mathematics(self) -> Formula:
        if self._draw(2):
            return Slope(self.term(ValueType.FLOAT64, 3), self.messages(), 1)
        return super()._mathematics()

    def window(self) -> Window:
        """Return a window of any form."""
        found = super().window()
        is_exact = found.low == found.high
        if (found.low > self._scale.longest_exact) if is_exact else is_narrow(found):
            return Window(found.low // 2, found.high)
        return found


def under_timed(properties: Sequence[Property], inputs: Sequence[Variable] = INPUTS,
                max_rate: Fraction = Fraction(10 ** 9)) -> Specification:
    """Return a specification of the policy, in which each input has a rate."""
    made = specification_of(properties, inputs, Policy.TIMED)
    signals = tuple(replace(signal, max_rate=max_rate) for signal in made.signals)
    return replace(made, signals=signals, unit=Fraction(1))


def assert_equal(properties: Sequence[Property], traces: Sequence[TimedTrace],
                 inputs: Sequence[Variable] = INPUTS,
                 max_rate: Fraction = Fraction(10 ** 9)) -> None:
    """Compare all verdicts over each trace, and count the evaluations."""
    monitor = TimedMonitor(under_timed(properties, inputs, max_rate), FAST)
    for trace in traces:
        expected = [evaluate_timed([item.formula], trace, item.feedback)[0]
                    for item in properties]
        for only_changes in (False, True):
            found = monitor.run(trace, only_changes=only_changes)
            for item, one, other in zip(properties, found.verdicts, expected, strict=True):
                assert one == other, f'{item.id} with only_changes={only_changes}'
        assert_few_evaluations(properties, found, trace)


def assert_few_evaluations(properties: Sequence[Property], found: TimedRun,
                           trace: TimedTrace) -> None:
    """Compare the evaluations with the rows, and with the changes of any subformula."""
    groups: dict[tuple[str, ...], set[int]] = {}
    for item in properties:
        changes = groups.setdefault(tuple(sorted(item.inputs)), set(trace.ticks))
        nodes = postorder(item.roots)
        for history in evaluate_timed(nodes, trace, item.feedback):
            changes.update(tick for tick, _ in history)
    for item, count in zip(properties, found.evaluations, strict=True):
        assert count <= 3 * len(groups[tuple(sorted(item.inputs))]) + 10


def properties_of(formulas: Sequence[Formula]) -> list[Property]:
    """Return a requirement for each formula."""
    return [property_of(f'R-{number}', formula) for number, formula in enumerate(formulas)]


def traces_at(draw: Draw, scale: Scale, inputs: Sequence[Variable] = INPUTS,
              rows: int = 40) -> list[TimedTrace]:
    """Return a trace with rows at deadlines, and one with rows anywhere."""
    largest = max(scale.bounds)
    gaps = (1, 2, 3, largest // 7 + 1, largest // 3 + 1)
    traces = [make_close_trace(draw, inputs, rows, scale.bounds),
              make_timed_trace(draw, inputs, rows, gaps)]
    return [cut_off(trace) for trace in traces]


def cut_off(trace: TimedTrace) -> TimedTrace:
    """Return the part of a trace up to the last tick that a group can step at."""
    rows = sum(tick <= LAST_TICK for tick in trace.ticks)
    columns = {name: column[:rows] for name, column in trace.columns.items()}
    return TimedTrace(trace.ticks[:rows], columns, min(trace.end, LAST_TICK))


@pytest.mark.parametrize('scale', SCALES)
@pytest.mark.parametrize(('seed', 'size'), [(1, 4), (2, 8), (3, 15), (4, 40)])
def test_random_formulas_give_the_verdicts_of_the_reference(seed: int, size: int,
                                                            scale: str) -> None:
    rng = Random(seed)
    formulas = [TimedFormulaMaker(rng.randrange, SCALES[scale], random_inputs(rng))
                .formula(1 + rng.randrange(size)) for _ in range(40)]
    traces = traces_at(rng.randrange, SCALES[scale])
    assert_equal(properties_of(formulas), traces, max_rate=SCALES[scale].max_rate)


@settings(max_examples=EXAMPLES // 2, deadline=None)
@given(st.sampled_from(sorted(SCALES)), st.data())
def test_any_formula_gives_the_verdicts_of_the_reference(scale: str, data: st.DataObject) -> None:
    def draw(n: int) -> int:
        return data.draw(st.integers(0, n - 1))
    formula = TimedFormulaMaker(draw, SCALES[scale]).formula(1 + draw(15))
    inputs = [node for node in postorder([formula]) if isinstance(node, Variable)] or [P]
    traces = traces_at(draw, SCALES[scale], inputs, rows=1 + draw(15))
    assert_equal(properties_of([formula]), traces, inputs, SCALES[scale].max_rate)


@pytest.mark.parametrize('scale', SCALES)
def test_each_operator_has_each_window(scale: str) -> None:
    bounds, limit = SCALES[scale].bounds, SCALES[scale].longest_exact
    windows = [Window(low, None) for low in bounds] + [
        Window(low, high) for low in bounds for high in (*bounds, low + 1, low + 2) if low < high]
    windows = [window for window in windows if not is_narrow(window)]
    windows += [Window(low, low) for low in bounds if low <= limit]
    formulas = [formula for window in windows for formula in (
        Once(window, P), Historically(window, P), Since(window, P, Q), Triggered(window, P, Q))]
    traces = [trace for seed in range(5)
              for trace in traces_at(Random(seed).randrange, SCALES[scale], (P, Q))]
    assert_equal(properties_of(formulas), traces, (P, Q), SCALES[scale].max_rate)


def boolean_traces(seed: int) -> list[TimedTrace]:
    """Return short traces of p and q, with runs of one tick and of several."""
    rng = Random(seed)
    return [make_timed_trace(rng.randrange, (P, Q), 40, gaps)
            for gaps in ((1,), (1, 2, 3), (1, 4, 9))]


def test_every_operator_on_inputs_and_constants_is_that_of_the_reference() -> None:
    assert_equal(properties_of(two_deep()), boolean_traces(1), (P, Q))


def test_the_shapes_that_fret_makes_are_those_of_the_reference() -> None:
    mode = Binary(BinaryOperator.AND, Q, Binary(BinaryOperator.OR, FTP, Yesterday(no(Q))))
    formulas = [formula for p in (P, no(P), TRUE) for q in (Q, Yesterday(P)) for n in (1, 2, 5)
                for left in (FTP, mode, P) for formula in as_fret_writes(p, q, left, n)]
    assert_equal(properties_of(list(dict.fromkeys(formulas))), boolean_traces(2), (P, Q))


def with_bounds(formula: Formula, change: Mapping[int, int]) -> Formula:
    """Put other bounds for some of those in a formula."""
    found: dict[Formula, Formula] = {}
    for node in postorder([formula]):
        match node:
            case Once(window, p):
                found[node] = Once(changed(window, change), found[p])
            case Historically(window, p):
                found[node] = Historically(changed(window, change), found[p])
            case Since(window, p, q):
                found[node] = Since(changed(window, change), found[p], found[q])
            case Unary(operator, p):
                found[node] = Unary(operator, found[p])
            case Binary(operator, p, q):
                found[node] = Binary(operator, found[p], found[q])
            case Yesterday(p):
                found[node] = Yesterday(found[p])
            case _:
                found[node] = node
    return found[formula]


def changed(window: Window, change: Mapping[int, int]) -> Window:
    high = window.high
    return Window(change.get(window.low, window.low),
                  None if high is None else change.get(high, high))


def in_ticks(formula: Formula, steps: int, ticks: int) -> Formula:
    """Put a duration in ticks for one in steps; bounds are it, or it plus or minus one."""
    return with_bounds(formula, {steps + more: ticks + more for more in (-1, 0, 1)})


@cache
def template_formulas() -> dict[str, Formula]:
    """Return the formulas of FRET's templates: ours with a duration of 100, and its own with 3."""
    found = {}
    for item in some(facts.templates()):
        key = (item['scope'], item['condition'], item['timing'])
        name = ','.join(key)
        found[f'ours {name}'] = in_ticks(formalise(sentence_for(key, 100)), 100, 2 * SECOND)
        theirs = meaning(Language.PTLTL, item['ptltl'], TEMPLATE_INPUTS)
        found[f'theirs {name}'] = in_ticks(theirs, 3, 2 * SECOND)
    return found


def test_the_templates_of_fret_with_a_duration_of_seconds_are_those_of_the_reference() -> None:
    formulas = template_formulas()
    assert len(formulas) > 100
    rng = Random(1)
    bounds = (1, 100, SECOND, 2 * SECOND, 3 * SECOND)
    traces = [make_close_trace(rng.randrange, TEMPLATE_INPUTS, 40, bounds)
              for _ in range(max(1, EXAMPLES // 16))]
    traces += [make_timed_trace(rng.randrange, TEMPLATE_INPUTS, 40, (SECOND, 700_000_000, 3))]
    properties = [property_of(name, formula) for name, formula in formulas.items()]
    assert_equal(properties, traces, TEMPLATE_INPUTS, Fraction(100))


def within_10_seconds() -> Formula:
    """Return the formula of FRET's sentence, about the trigger c and the response r."""
    sentence = 'upon c the sw shall within 100 ticks satisfy r'
    return in_ticks(formalise(sentence), 100, 10 * SECOND)


@pytest.mark.parametrize(('answer', 'expected'), [
    (10 * SECOND, [(0, True)]),
    (10 * SECOND + 1, [(0, True), (10 * SECOND, False)]),
    (15 * SECOND, [(0, True), (10 * SECOND, False)]),
    (None, [(0, True), (10 * SECOND, False)]),
])
def test_an_answer_counts_up_to_the_nanosecond_of_its_deadline(
        answer: int | None, expected: History) -> None:
    rows = [(0, True, False), (SECOND, False, False)]
    rows += [] if answer is None else [(answer, False, True)]
    ticks, trigger, response = zip(*rows, strict=True)
    trace = TimedTrace(ticks, {'c': trigger, 'r': response}, 40 * SECOND)
    item = property_of('R-1', within_10_seconds())
    monitor = TimedMonitor(under_timed([item], TEMPLATE_INPUTS, Fraction(100)))
    found = monitor.run(replace(trace, columns={**trace.columns, 'm': trigger, 's': trigger}))
    assert found.verdicts == [expected]
    assert found.evaluations[0] <= len(rows) + 4


def test_windows_reach_as_far_as_ticks_do() -> None:
    far = [LAST_TICK - 1, LAST_TICK, LAST_TICK + 1]
    windows = [Window(0, bound) for bound in far] + [Window(bound, None) for bound in far]
    windows += [Window(1, bound) for bound in far] + [Window(2 ** 61, bound) for bound in far]
    formulas = [formula for window in windows for formula in (
        Once(window, P), Historically(window, P), Since(window, P, Q), Triggered(window, P, Q))]
    rows = [0, 1, 2, 3, 2 ** 61 - 1, 2 ** 61, LAST_TICK - 2, LAST_TICK - 1, LAST_TICK]
    traces = []
    for seed in range(20):
        rng = Random(seed)
        columns = {name: [rng.random() < 0.5 for _ in rows] for name in 'pq'}
        traces += [TimedTrace(rows, columns, LAST_TICK),
                   TimedTrace(rows[:3], {name: column[:3] for name, column in columns.items()},
                              LAST_TICK)]
    assert_equal(properties_of(formulas), traces, (P, Q), Fraction(1))


@pytest.mark.parametrize('grid', [1, 7, SECOND])
def test_on_a_grid_it_is_periodic_with_that_period(grid: int) -> None:
    rng = Random(grid)
    pairs = [on_both_scales(rng.randrange, 4, grid) for _ in range(60)]
    steps = specification_of(properties_of([one for one, _ in pairs]), (P, Q), Policy.PERIODIC)
    ticks = under_timed(properties_of([other for _, other in pairs]), (P, Q))
    periodic = Compiled(replace(steps, period=Fraction(grid, SECOND)), flags=FAST)
    monitor = TimedMonitor(replace(ticks, signals=tuple(
        replace(signal, max_rate=Fraction(SECOND, grid) * 4) for signal in ticks.signals)), FAST)
    for seed in range(5):
        trace = make_timed_trace(Random(seed).randrange, (P, Q), 30, (1, 2, 3, 9))
        lengths = [later - tick for tick, later
                   in zip(trace.ticks, [*trace.ticks[1:], trace.end + 1], strict=True)]
        held = {name: [value for value, length in zip(column, lengths, strict=True)
                       for _ in range(length)] for name, column in trace.columns.items()}
        wide = TimedTrace([tick * grid for tick in trace.ticks], trace.columns, trace.end * grid)
        expected = [[(tick * grid, value) for tick, value in enumerate(column)
                     if tick == 0 or column[tick - 1] is not value]
                    for column in periodic.run(held)]
        assert monitor.run(wide).verdicts == expected


def test_equations_that_settle_are_those_of_the_reference() -> None:
    latched, ring, first, second = (Feedback(name, BOOL) for name in 'abcd')
    last, x = Feedback('last', INT64), Variable('x', INT64)
    greatest = Binary(BinaryOperator.MAX, last, x)
    formulas: list[tuple[Formula, tuple[tuple[Feedback, Formula], ...]]] = [
        (latched, ((latched, Binary(BinaryOperator.OR, latched, P)),)),
        (Binary(BinaryOperator.LT, x, last), ((last, greatest),)),
        (Since(Window(3, 9), ring, P), ((ring, Choice(P, Q, ring)),)),
        (Binary(BinaryOperator.XOR, first, second), ((first, second), (second, P))),
        (Binary(BinaryOperator.NE, Previous(Constant(7, INT64), Previous(x, x)), x), ()),
    ]
    properties = [property_of(f'R-{number}', formula, feedback)
                  for number, (formula, feedback) in enumerate(formulas)]
    inputs = (P, Q, x)
    traces = [trace for seed in range(5)
              for trace in traces_at(Random(seed).randrange, SCALES['ticks'], inputs)]
    assert_equal(properties, traces, inputs)


def test_occurrences_are_falls_of_the_formula_under_h() -> None:
    rng = Random(1)
    bodies = [TimedFormulaMaker(rng.randrange, SCALES['ticks'], random_inputs(rng)).formula(10)
              for _ in range(40)]
    properties = [replace(property_of(f'R-{number}', Historically(ALWAYS, body)),
                          report=Report.OCCURRENCE) for number, body in enumerate(bodies)]
    others = [replace(property_of('R-40', Once(Window(0, 5), P)), report=Report.OCCURRENCE)]
    monitor = TimedMonitor(under_timed([*properties, *others]), FAST)
    for trace in traces_at(rng.randrange, SCALES['ticks']):
        found = monitor.run(trace)
        expected = evaluate_timed([*bodies, others[0].formula], trace)
        assert found.occurrences == expected
        assert found.verdicts == evaluate_timed(
            [item.formula for item in [*properties, *others]], trace)


def test_more_changes_than_the_rate_allows_violate_until_they_have_left_the_window() -> None:
    formula = Binary(BinaryOperator.OR, Once(Window(SECOND, SECOND), P), no(P))
    ticks = [*range(0, 402, 2), SECOND + 351, 5 * SECOND, 5 * SECOND + 7, 9 * SECOND]
    values = [tick % 4 == 2 for tick in range(0, 402, 2)] + [False, True, False, True]
    trace = TimedTrace(ticks, {'p': values}, 20 * SECOND)
    monitor = TimedMonitor(under_timed([property_of('R-1', formula)], (P,), Fraction(10)))
    found = monitor.run(trace).verdicts[0]
    expected = evaluate_timed([formula], trace)[0]
    # Room for 12 intervals in which p holds: the 88 before them are lost, of which the last is
    # 350..351. They could make a difference until a second later.
    assert [value_at(found, tick) for tick in (SECOND + 351, SECOND + 352)] == [False, True]
    assert [piece for piece in found if piece[0] < 50] == [
        piece for piece in expected if piece[0] < 50]
    assert not any(value for tick, value in found if 50 <= tick < SECOND + 352)
    assert [piece for piece in found if piece[0] > SECOND + 352] == [
        piece for piece in expected if piece[0] > SECOND + 352]
