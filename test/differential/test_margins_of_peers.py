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

"""Margins of compiled monitors beside the robustness of rtamt and reelay, where installed."""

from collections.abc import Callable, Iterator, Sequence
from random import Random

from differential.test_margins import build, evaluator_of, run, X, Y
from fret_monitor.logic.evaluate import Trace
from fret_monitor.logic.formula import (
    Binary, BinaryOperator, Constant, Formula, Historically, Once, Since, Unary, UnaryOperator,
    Window,
)
from fret_monitor.model.values import ValueType
import pytest
from strategies import property_of

KINDS = ('not', 'and', 'or', 'once', 'historically')
STEPS = 40
FORMULAS = 60
Texts = tuple[Formula, str, str]  # ours, and as rtamt and reelay have it


def comparison(rng: Random) -> Texts:
    signal, name = rng.choice(((X, 'x'), (Y, 'y')))
    limit = float(rng.randrange(-3, 4))
    return (Binary(BinaryOperator.GT, signal, Constant(limit, ValueType.FLOAT64)),
            f'({name} > {limit})', f'{{{name} > {limit}}}')


def formula(rng: Random, depth: int, kinds: Sequence[str]) -> Texts:
    """Return a random formula with windows."""
    kind = rng.choice(kinds) if depth else ''
    if not kind:
        return comparison(rng)
    low = rng.choice((0, 0, 1, 3))
    high = low + rng.randrange(0 if low or 'since' in kinds else 1, 7)
    window, shown = Window(low, high), f'[{low}:{high}]'
    (ours, one, other), (ours2, one2, other2) = (formula(rng, depth - 1, kinds) for _ in range(2))
    match kind:
        case 'not':
            return Unary(UnaryOperator.NOT, ours), f'(not {one})', f'(not {other})'
        case 'and' | 'or':
            operator = BinaryOperator.AND if kind == 'and' else BinaryOperator.OR
            return (Binary(operator, ours, ours2), f'({one} {kind} {one2})',
                    f'({other} {kind} {other2})')
        case 'since':
            return (Since(window, ours, ours2), f'({one} since{shown} {one2})',
                    f'({other} since{shown} {other2})')
        case _:
            make = Once if kind == 'once' else Historically
            return make(window, ours), f'{kind}{shown}({one})', f'({kind}{shown}({other}))'


def rtamt_margins(text: str, rows: list[tuple[float, float]]) -> Iterator[float]:
    """Yield the robustness at each step."""
    rtamt = pytest.importorskip('rtamt', reason='rtamt is not installed: pip install rtamt')
    monitor = rtamt.StlDiscreteTimeSpecification()
    for name in 'xy':
        monitor.declare_var(name, 'float')
    monitor.spec = text
    monitor.parse()
    for step, (x, y) in enumerate(rows):
        yield monitor.update(step, [('x', x), ('y', y)])


def reelay_margins(text: str, rows: list[tuple[float, float]]) -> Iterator[float]:
    """Yield the robustness at each step."""
    reelay = pytest.importorskip('reelay', reason='reelay is not installed: pip install reelay')
    monitor = reelay.discrete_timed_monitor(
        pattern=text, semantics='robustness', condense=False)
    for x, y in rows:
        yield monitor.update({'x': x, 'y': y})['value']


def differences(peer: Callable[[str, list[tuple[float, float]]], Iterator[float]],
                kinds: Sequence[str]) -> Iterator[str]:
    """Yield where a peer has another margin."""
    rng = Random(7)
    asked = [formula(rng, 2, kinds) for _ in range(FORMULAS)]
    rows = [(round(rng.gauss(0, 2), 3), round(rng.gauss(0, 2), 3)) for _ in range(STEPS)]
    texts = [one if peer is rtamt_margins else other for _, one, other in asked]
    theirs = [[*peer(text, rows)] for text in texts]
    evaluator = evaluator_of(build(
        [property_of(f'R-{number}', item[0]) for number, item in enumerate(asked)]))
    trace: Trace = {name: [0] * STEPS for name in ('x_int32', 'x_float32')} | {
        'p': [False] * STEPS, X.name: [x for x, _ in rows], Y.name: [y for _, y in rows]}
    ours = run(evaluator, trace, range(STEPS)).margins
    for number, (item, found) in enumerate(zip(texts, theirs, strict=True)):
        for step, value in enumerate(found):
            mine = ours[step * FORMULAS + number].value
            if value != pytest.approx(mine, abs=1e-9):
                yield f'{item} at {step}: {value}, not {mine}'


def test_rtamt_has_the_same_margins() -> None:
    assert [*differences(rtamt_margins, [*KINDS, 'since'])] == []


def test_reelay_has_the_same_margins() -> None:
    # Without `since[a:b]` and [0:0], where reelay 25.0 differs from rtamt, too.
    assert [*differences(reelay_margins, KINDS)] == []
