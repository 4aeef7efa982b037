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

"""Margins in compiled C against their definitions, which `logic/margins.py` follows literally."""

from array import array
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import accumulate
import math
from random import Random
from typing import Any

from differential.compiled import unoptimised
from fret_monitor.build import compile_monitor, generate_monitor, GeneratedMonitor, Reading
from fret_monitor.codegen.margins import comparisons
from fret_monitor.logic.evaluate import Trace
from fret_monitor.logic.formula import (
    Aggregate, Binary, BinaryOperator, Constant, Formula, Historically, Once, Over, Since,
    Triggered, TRUE, Unary, UnaryOperator, Variable, variables, Window,
)
from fret_monitor.logic.margins import margins, ReferenceMargin, Scales
from fret_monitor.logic.specification import Property, Specification
from fret_monitor.model.policies import Policy
from fret_monitor.model.values import ValueType
from fret_monitor.native.monitor import load
from fret_monitor.runtime.evaluator import Evaluator, Margin
from fret_monitor.traces.simulate import for_trace
import pytest
from strategies import (
    FormulaMaker, property_of, random_property, random_trace, some, specification_of,
)

X, Y = (Variable(f'{letter}_float64', ValueType.FLOAT64) for letter in 'xy')
N, F, P = (Variable('x_int32', ValueType.INT32), Variable('x_float32', ValueType.FLOAT32),
           Variable('p', ValueType.BOOL))
INPUTS = (X, Y, N, F, P)
STEPS = 60


@dataclass(frozen=True)
class Run:
    """Rows of verdicts and margins, with their times."""

    times: list[int]
    verdicts: list[bool]
    margins: list[Margin]


def build(properties: Sequence[Property], policy: Policy = Policy.EVERY_MESSAGE,
          scales: Scales | None = None, max_rate: Fraction | None = None) -> GeneratedMonitor:
    """Generate a monitor with margins."""
    found = specification_of(properties, INPUTS, policy)
    signals = tuple(replace(
        item, scale=(scales or {}).get(item.name) or 1.0, max_rate=max_rate,
        values=(('ONE', 1),) if (scales or {}).get(item.name, 1.0) is None else ())
        for item in found.signals)
    return generate_monitor(Reading(
        replace(found, signals=signals, has_margins=True), (), '0' * 64, ()))


def evaluator_of(generated: GeneratedMonitor) -> Evaluator:
    """Compile and load."""
    with unoptimised():
        compiled = compile_monitor(generated)
    return Evaluator(for_trace(load(compiled.library, compiled.manifest)))


def run(evaluator: Evaluator, trace: Trace, times: Sequence[int], until: int | None = None) -> Run:
    """Take the rows of a trace."""
    columns: list[array[Any] | None] = [
        array(item.value_type.typecode, trace[item.name])
        for item in evaluator.monitor.manifest.inputs]
    found = Run([], [], [])
    for instants, flags, rows in evaluator.margin_rows(columns, array('q', times), until):
        found.times.extend(instants)
        found.verdicts.extend(map(bool, flags))
        found.margins.extend(rows)
    return found


def check(found: Margin, expected: ReferenceMargin, verdict: bool, formulas: Sequence[Formula],
          scales: Scales, lasting: Trace | None = None) -> None:
    """
    Compare a margin: its value, its sign, and that what decides it is among those that do.

    In a `lasting` trace a comparison has its distance until a later step, which may decide.
    """
    assert found.value == expected.value and repr(found.value) != '-0.0'
    assert not (found.value > 0 and not verdict) and not (found.value < 0 and verdict)
    if math.isfinite(found.value):
        formula = formulas[found.comparison]
        distances = lasting and [item.value for item in margins(formula, lasting, scales)]
        assert any(item is formula and (found.instant == step or distances and len({
            *distances[found.instant:step + 1]}) == 1) for item, step in expected.deciding)
        scale = max((scales.get(item.name) or 1.0 for item in variables(formula)), default=1.0)
        assert found.distance / scale == found.value


@pytest.mark.parametrize(('seed', 'size', 'reach'), [(1, 6, 9), (2, 14, 9), (3, 25, 40)])
def test_margins_by_steps_are_those_of_the_definitions(seed: int, size: int, reach: int) -> None:
    rng = Random(seed)
    scales: Scales = {X.name: 0.7, Y.name: 0.125, N.name: None} if seed == 2 else {}
    properties = [random_property(rng, f'R-{number}', INPUTS, size=size, reach=reach,
                                  loops=2 if number % 4 == 0 else 0) for number in range(30)]
    generated = build(properties, scales=scales)
    trace = random_trace(rng, INPUTS, STEPS)
    found = run(evaluator_of(generated), trace, range(STEPS))
    formulas = [item.formula for item in comparisons(generated.program) if item.formula]
    n_finite = 0
    for number, item in enumerate(properties):
        expected = margins(item.formula, trace, scales, item.feedback)
        for t in range(STEPS):
            place = t * len(properties) + number
            check(found.margins[place], expected[t], found.verdicts[place], formulas, scales)
            n_finite += math.isfinite(expected[t].value)
    assert n_finite > 200


def at_most(left: Formula, limit: float) -> Formula:
    """Return `left <= limit`."""
    return Binary(BinaryOperator.LE, left, Constant(limit, ValueType.FLOAT64))


def test_every_window_has_the_margins_of_its_definition() -> None:
    windows = [Window(low, low + size) for low in (0, 1, 2, 5) for size in (-1, 0, 1, 3, 9)]
    windows += [Window(low, None) for low in (0, 1, 5)]
    p, q = at_most(X, 1.0), at_most(Y, 2.0)
    formulas = [formula for window in windows for formula in (
        Once(window, p), Historically(window, p), Since(window, p, q), Triggered(window, p, q))]
    rng = Random(4)
    numbers = {item.name: [rng.choice((0.0, 1.0, 2.5, 4.0, 7.0)) for _ in range(STEPS)]
               for item in (X, Y)}
    trace: Trace = {**random_trace(rng, INPUTS, STEPS), **numbers}
    generated = build([property_of(f'R-{number}', item) for number, item in enumerate(formulas)])
    found = run(evaluator_of(generated), trace, range(STEPS))
    compared = [item.formula for item in comparisons(generated.program) if item.formula]
    for number, formula in enumerate(formulas):
        for t, expected in enumerate(margins(formula, trace, {})):
            place = t * len(formulas) + number
            check(found.margins[place], expected, found.verdicts[place], compared, {})


@pytest.mark.parametrize('seed', some([2, 1]))
def test_margins_at_ticks_are_those_of_a_step_every_nanosecond(seed: int) -> None:
    rng = Random(seed)
    maker = FormulaMaker(rng.randrange, INPUTS, reach=9, has_windows=False)
    properties = [property_of(f'R-{number}', maker.formula(4 + number % 14))
                  for number in range(40)]
    greatest = Over(Aggregate.GREATEST, 4, X, TRUE)
    properties.append(property_of('OVER', Historically(Window(0, 6), at_most(greatest, 2.0))))
    generated = build(properties, Policy.TIMED, max_rate=Fraction(100))
    ticks = [0]
    while len(ticks) < 25:
        ticks.append(ticks[-1] + rng.choice((1, 1, 2, 3, 5, 8)))
    end = ticks[-1] + 12
    trace = random_trace(rng, INPUTS, len(ticks))
    row_at = [max(row for row, tick in enumerate(ticks) if tick <= t) for t in range(end + 1)]
    each: Trace = {name: [column[row] for row in row_at] for name, column in trace.items()}
    evaluator = evaluator_of(generated)
    found = run(evaluator, trace, ticks, end)
    assert evaluator.time_counts().overflows == 0
    formulas = [item.formula for item in comparisons(generated.program) if item.formula]
    for number, item in enumerate(properties):
        place = -len(properties) + number
        for t, expected in enumerate(margins(item.formula, each, {})):
            while place // len(properties) + 1 < len(found.times) \
                    and found.times[place // len(properties) + 1] <= t:
                place += len(properties)
            check(found.margins[place], expected, found.verdicts[place], formulas, {}, each)


@pytest.mark.parametrize('policy', [Policy.EVERY_MESSAGE, Policy.TIMED])
def test_what_decides_is_named_as_its_own_requirement_has_it(policy: Policy) -> None:
    pairs = ((BinaryOperator.LT, X, Y), (BinaryOperator.LE, X, Y),
             (BinaryOperator.GT, Y, X), (BinaryOperator.GE, Y, X))  # of one distance
    compared = [Binary(operator, left, right) for operator, left, right in pairs]
    generated = build([property_of(f'R-{number}', Historically(Window(0, None), item))
                       for number, item in enumerate(compared)], policy)
    rest = random_trace(Random(8), INPUTS, 2)
    found = run(evaluator_of(generated), {**rest, X.name: [1.0, 3.0], Y.name: [2.0, 2.0]}, (0, 1))
    formulas = [item.formula for item in comparisons(generated.program)]
    assert [(formulas[item.comparison], item.value, item.instant) for item in found.margins] == [
        (formula, value, step) for step, value in enumerate((1.0, -1.0)) for formula in compared]


@pytest.mark.parametrize('policy', [Policy.EVERY_MESSAGE, Policy.TIMED])
def test_an_infinite_distance_is_of_its_comparison_from_the_first_step_on(policy: Policy) -> None:
    generated = build([property_of('R-0', at_most(Y, 3.0)), property_of('R-1', at_most(X, 3.0))],
                      policy)
    rest = random_trace(Random(9), INPUTS, 1)
    found = run(evaluator_of(generated), {**rest, X.name: [math.nan], Y.name: [math.inf]}, (5,))
    assert [(item.value, item.comparison, item.instant) for item in found.margins] == [
        (-math.inf, number, 5) for number in (0, 1)]


def random_chain(rng: Random) -> Formula:
    """Return a formula with five windows over comparisons of inputs with constants."""
    limits: list[Formula] = [at_most(item, limit) for item in (X, Y) for limit in (0.0, 1.0, 3.0)]
    limits += [Unary(UnaryOperator.NOT, item) for item in limits]
    formula = rng.choice(limits)
    for _ in range(4):
        window = Window(low := rng.choice((0, 0, 1, 3)), rng.choice((None, low + 2, low + 6)))
        other = rng.choice(limits)
        formula = rng.choice((
            Once(window, formula), Historically(window, formula),
            Since(window, formula, other), Triggered(window, other, formula),
            Binary(BinaryOperator.AND, formula, other),
            Binary(BinaryOperator.IMPLIES, other, formula)))
    return formula


def verdicts_at(found: Run, times: Sequence[int]) -> list[list[bool]]:
    """Return the verdicts of a run at some times."""
    width = len(found.verdicts) // len(found.times)
    last = [bisect_right(found.times, time) - 1 for time in times]
    return [found.verdicts[place * width:(place + 1) * width] for place in last]


@pytest.mark.parametrize('policy', [Policy.EVERY_MESSAGE, Policy.TIMED])
def test_a_change_of_the_inputs_by_less_than_the_margin_keeps_the_verdict(policy: Policy) -> None:
    rng = Random(5)
    generated = build([property_of(f'R-{number}', random_chain(rng)) for number in range(40)],
                      policy, max_rate=Fraction(100))
    evaluator = evaluator_of(generated)
    times = [*accumulate(rng.choice((1, 2, 5)) for _ in range(25))]
    numbers = {item.name: [rng.uniform(-2, 5) for _ in times] for item in (X, Y)}
    rest = random_trace(rng, INPUTS, len(times))
    found = run(evaluator, {**rest, **numbers}, times)
    before = verdicts_at(found, found.times)
    distances = sorted(abs(item.value) for item in found.margins if math.isfinite(item.value))
    checked = 0
    for least in distances[::len(distances) // 12]:
        change = least * (1 - 1e-12)
        moved = {name: [value + rng.choice((-change, change)) for value in column]
                 for name, column in numbers.items()}
        after = verdicts_at(run(Evaluator(evaluator.monitor), {**rest, **moved}, times),
                            found.times)
        for place, item in enumerate(found.margins):
            row, column = divmod(place, len(before[0]))
            if abs(item.value) >= least:
                assert after[row][column] == before[row][column]
                checked += math.isfinite(item.value)
    assert checked > 2000


@pytest.mark.parametrize('policy', [Policy.EVERY_MESSAGE, Policy.TIMED])
def test_a_change_by_more_than_the_margin_where_it_decides_turns_the_verdict(
        policy: Policy) -> None:
    formulas: list[Formula] = [
        Historically(Window(0, 9), at_most(X, 3.0)), Once(Window(0, 9), at_most(X, -1.0))]
    evaluator = evaluator_of(build(
        [property_of(f'R-{number}', item) for number, item in enumerate(formulas)], policy,
        max_rate=Fraction(100)))
    times = [*range(0, 10, 2)]
    numbers = [0.0, 2.0, 2.75, 1.0, 0.5]
    rest = random_trace(Random(1), INPUTS, len(times))
    found = run(evaluator, {**rest, X.name: numbers}, times)
    for number, margin, row in ((0, 0.25, 2), (1, -1.0, 0)):
        last = found.margins[number - 2]
        assert (last.value, last.instant) == (margin, times[row])
        for change, turns in ((margin, number == 1), (margin * 1.000001, True)):
            moved = [value + change * (place == row) for place, value in enumerate(numbers)]
            after = run(Evaluator(evaluator.monitor), {**rest, X.name: moved}, times)
            assert (after.verdicts[number - 2] != found.verdicts[number - 2]) == turns


def test_margins_are_not_known_once_more_changes_came_than_max_rate_says() -> None:
    formula = Once(Window(50, 100), at_most(X, 0.0))
    generated = build([property_of('R', formula)], Policy.TIMED, max_rate=Fraction(2))
    rng = Random(6)
    trace = {**random_trace(rng, INPUTS, 40), X.name: [float(n) for n in range(40)]}
    evaluator = evaluator_of(generated)
    found = run(evaluator, trace, range(40))
    assert evaluator.time_counts().overflows > 0
    known = [not math.isnan(item.value) for item in found.margins]
    assert known[0] and not known[-1] and known == sorted(known, reverse=True)


def without_margins(specification: Specification) -> dict[str, str]:
    """Return the C of a specification, without margins."""
    return generate_monitor(Reading(specification, (), '0' * 64, ())).c_sources


def test_without_margins_the_c_knows_nothing_of_them_whatever_the_scales() -> None:
    rng = Random(7)
    plain = specification_of([random_property(rng, f'R-{number}', INPUTS) for number in range(10)],
                             INPUTS)
    scaled = replace(plain, signals=tuple(replace(item, scale=3.0) for item in plain.signals))
    texts = without_margins(plain)
    assert texts == without_margins(scaled)
    assert not any('margin' in text for text in texts.values())
