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

"""What counts and times in formulas mean under each policy."""

from fractions import Fraction

from fret_monitor.elaboration.durations import STEPS, TimeScale
from fret_monitor.language.cocospec import parse_cocospec
from fret_monitor.language.fretish import parse_fretish_expression
from fret_monitor.language.smv import parse_smv
from fret_monitor.logic.formula import Formula, Once, Variable, Window
from fret_monitor.model.diagnostics import CompileError
from fret_monitor.model.policies import Policy
from fret_monitor.model.values import ValueType
from hypothesis import given
from hypothesis import strategies as st
import pytest
from stages import elaborate, scope_of, text_of

S, MS = 10 ** 9, 10 ** 6
p, q = (Variable(name, ValueType.BOOL) for name in 'pq')
SCOPE = scope_of([p, q], {'n': 3})
TIMED = TimeScale(Policy.TIMED)
COUNTED = TimeScale(Policy.TIMED, unit=Fraction(1, 10))
PERIODIC = TimeScale(Policy.PERIODIC, Fraction(1, 2))


def read(formula: str, scale: TimeScale) -> Formula:
    """Read a formula in SMV."""
    return elaborate(parse_smv(text_of(formula)), SCOPE, scale=scale)


@pytest.mark.parametrize(('bound', 'scale', 'low', 'high'), [
    ('[0, 2.5 s]', TIMED, 0, 2_500 * MS), ('[0,2.5s]', TIMED, 0, 2_500 * MS),
    ('[<= 500 ms]', TIMED, 0, 500 * MS), ('[>=1 min]', TIMED, 60 * S, None),
    ('[< 10 s]', TIMED, 0, 10 * S - 1), ('[> 10 s]', TIMED, 10 * S + 1, None),
    ('[= 2 us]', TIMED, 2000, 2000), ('[1 ns, 1 h]', TIMED, 1, 3600 * S),
    ('[0.5 seconds, 2 Minutes]', TIMED, 500 * MS, 120 * S), ('[1e-3 s, 1 s]', TIMED, MS, S),
    ('[0,0]', TIMED, 0, 0), ('[0,-1]', TIMED, 0, -1), ('[>=0]', TIMED, 0, None),
    ('[0,2]', COUNTED, 0, 200 * MS), ('[n, 2*n+1]', COUNTED, 300 * MS, 700 * MS),
    ('[<n]', COUNTED, 0, 300 * MS - 1), ('[>n]', COUNTED, 300 * MS + 1, None),
    ('[n, 2 s]', COUNTED, 300 * MS, 2 * S), ('[0,-1]', COUNTED, 0, -1),
    ('[0, 4611686018427387904 ns]', TIMED, 0, 2 ** 62),
    ('[0, 2 s]', PERIODIC, 0, 4), ('[n, 1 min]', PERIODIC, 3, 120), ('[<1 s]', PERIODIC, 0, 1),
    ('[0,2]', STEPS, 0, 2), ('[<n]', STEPS, 0, 2),
])
def test_a_bound_is_what_its_policy_says(
        bound: str, scale: TimeScale, low: int, high: int | None) -> None:
    assert read(f'O{bound} p', scale) is Once(Window(low, high), p)


@pytest.mark.parametrize(('formula', 'scale', 'title'), [
    ('O[0,2] p', TIMED, 'a count needs a unit of time'),
    ('O[0,n] p', TIMED, 'a count needs a unit of time'),
    ('persisted(2, p)', TIMED, 'a count needs a unit of time'),
    ('O[0, 2 s] p', STEPS, 'a bound must be a number of steps'),
    ('persisted(2 s, p)', STEPS, 'a bound must be a number of steps'),
    ('O[0, 2 ticks] p', STEPS, 'a bound must be a number of steps'),
    ('O[0, 2 ticks] p', TIMED, "a time is needed instead of 'ticks'"),
    ('O[0, 0.7 s] p', PERIODIC, 'this duration is not a whole number of steps'),
    ('O[0, 0.1 ns] p', TIMED, 'a time must be a whole number of nanoseconds'),
    ('O[0, 4611686018427387905 ns] p', TIMED, 'a bound is at most 2^62 ns (146 years)'),
    ('O[0, 46116860185] p', COUNTED, 'a bound is at most 2^62 ns (146 years)'),
    ('O[2 s, 1 s] p', TIMED, 'this bound ends before it begins'),
    ('O[0, 3] p', TimeScale(Policy.TIMED, unit=Fraction(1, 10 ** 10)),
     'a time must be a whole number of nanoseconds'),
])
def test_what_its_policy_cannot_read_is_refused(
        formula: str, scale: TimeScale, title: str) -> None:
    with pytest.raises(CompileError) as caught:
        read(formula, scale)
    (found,) = caught.value.diagnostics
    assert found.title == title
    assert found.span is not None


@pytest.mark.parametrize('scale', [TIMED, PERIODIC])
def test_times_are_read_in_all_languages(scale: TimeScale) -> None:
    for smv, others in (
            ('persisted(2 s, p)', ['persisted(2 seconds, p)', 'persisted(2s, p)']),
            ('occurred(500 ms, 2 s, p)', ['occurred(0.5 sec, 2000 ms, p)'])):
        for other in others:
            fretish = parse_fretish_expression(text_of(other))
            lustre = parse_cocospec(text_of(other))
            assert elaborate(fretish, SCOPE, scale=scale) is read(smv, scale)
            assert elaborate(lustre, SCOPE, scale=scale) is read(smv, scale)
    for smv, cocospec in (('O[0.5 s, 2 s] p', 'OT(2 s, 500 ms, p)'),
                          ('O[<2 s] p', 'OT(2s, LessThan, p)'),
                          ('q S[<= 2 s] p', 'ST(2 s, 0, p, q)')):
        tree = parse_cocospec(text_of(cocospec))
        assert elaborate(tree, SCOPE, scale=scale) is read(smv, scale)


@given(number=st.integers(1, 10 ** 6), places=st.integers(0, 3),
       unit=st.sampled_from(('us', 'ms', 's', 'min', 'h')))
def test_a_decimal_time_is_exact(number: int, places: int, unit: str) -> None:
    written = f'{number // 10 ** places}.{number % 10 ** places:0{places}d}' if places else number
    length = {'us': 1000, 'ms': MS, 's': S, 'min': 60 * S, 'h': 3600 * S}[unit]
    exact = Fraction(number, 10 ** places) * length
    node = read(f'O[0, {written} {unit}] p', TIMED)
    assert isinstance(node, Once)
    assert node.window.high == exact


def test_a_name_of_a_unit_stays_a_name_elsewhere() -> None:
    scope = scope_of([Variable(name, ValueType.FLOAT64) for name in ('s', 'ms', 'h')])
    for formula in ('max(s, ms) > h', 's * 2 > ms', 'min(2, s) > 1'):
        elaborate(parse_smv(text_of(formula)), scope)
        elaborate(parse_cocospec(text_of(formula)), scope)
        elaborate(parse_fretish_expression(text_of(formula)), scope)
