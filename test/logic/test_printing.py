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

"""Tests of formulas as text: how they look, and that they read back as themselves."""

from collections.abc import Callable
from fractions import Fraction
import struct
import time

import facts
from fret_monitor.elaboration.durations import TimeScale
from fret_monitor.language.cocospec import parse_cocospec
from fret_monitor.language.smv import parse_smv
from fret_monitor.logic.evaluate import Trace, verdicts
from fret_monitor.logic.formula import (
    ALWAYS, Binary, BinaryOperator, Constant, Feedback, Formula, FTP, Historically, Once,
    postorder, Since, TRUE, Unary, UnaryOperator, Variable, Window, Yesterday,
)
from fret_monitor.logic.printing import to_cocospec, to_smv
from fret_monitor.model.diagnostics import CompileError
from fret_monitor.model.policies import Policy
from fret_monitor.model.times import NANOSECONDS, time_text
from fret_monitor.model.values import ValueType
from hypothesis import assume, given
from hypothesis import strategies as st
import pytest
from stages import elaborate, scope_of
from strategies import formulas, INPUTS, some, traces
from trees import text

BOOLEANS = tuple(Variable(name, ValueType.BOOL) for name in 'pqr')
NUMBERS = (Variable('i', ValueType.INT32), Variable('u', ValueType.UINT64),
           Variable('f', ValueType.FLOAT32), Variable('d', ValueType.FLOAT64))
MODE = Variable('mode', ValueType.UINT8)
STATE = Variable('state', ValueType.INT32)
VALUES: dict[str, tuple[tuple[str, int | str], ...]] = {
    'mode': (('IDLE', 0), ('LANDING', 3), ('H', 4)),
    'state': (('ready', 'ready'), ('off', 'powered off'), ('down', 'powered off')),
}
SCOPE = scope_of((*BOOLEANS, *NUMBERS, MODE, STATE), values=VALUES)
p, q, r = BOOLEANS


def smv(formula: str) -> Formula:
    return elaborate(parse_smv(text(formula)), SCOPE)


def cocospec(formula: str) -> Formula:
    return elaborate(parse_cocospec(text(formula)), SCOPE)


@pytest.mark.parametrize(('formula', 'in_smv', 'in_cocospec'), [
    ('p & q & r', 'p & q & r', 'p and q and r'),
    ('p & (q & r)', 'p & (q & r)', 'p and (q and r)'),
    ('p & q | r', '(p & q) | r', '(p and q) or r'),
    ('p -> q -> r', 'p -> (q -> r)', 'p => (q => r)'),
    ('(p -> q) -> r', '(p -> q) -> r', '(p => q) => r'),
    ('p xor q xor r', '(p xor q) xor r', '(p xor q) xor r'),
    ('p <-> q', 'p <-> q', 'p = q'),
    ('p = q & r', '(p = q) & r', '(p = q) and r'),
    ('!p & !(i > 3)', '!p & !(i > 3)', 'not p and not (i > 3)'),
    ('!!p', '!(!p)', 'not (not p)'),
    ('(!p) = q', '(!p) = q', '(not p) = q'),
    ('H p & q', '(H p) & q', 'H(p) and q'),
    ('H (p & q)', 'H (p & q)', 'H(p and q)'),
    ('H O !p', 'H (O !p)', 'H(O(not p))'),
    ('O[0,10] i <= 3', 'O[0,10] (i <= 3)', 'OT(10, 0, i <= 3)'),
    ('H[>=5] p', 'H[>=5] p', 'HT(5, GreaterThanOrEqual, p)'),
    ('O[0,-1] p', 'O[0,-1] p', 'OT(-1, 0, p)'),
    ('Y p | Z q', '(Y p) | (Z q)', 'YtoPre(p) or ZtoPre(q)'),
    ('p S q', 'p S q', 'S(q, p)'),
    ('p S[2,5] q', 'p S[2,5] q', 'ST(5, 2, q, p)'),
    ('p SI q', 'p S (p & q)', 'SI(q, p)'),
    ('p SI[<4] q', 'p S[0,3] (p & q)', 'SIT(3, 0, q, p)'),
    ('p T[=2] q', 'p T[2,2] q', 'TT(2, 2, q, p)'),
    ('p S q S r', '(p S q) S r', 'S(r, S(q, p))'),
    ('Z FALSE | Y TRUE', 'FTP | (Y TRUE)', 'FTP or YtoPre(true)'),
    ('i + 1 - 2 * i > -3', 'i + 1 - 2 * i > -3', 'i + 1 - 2 * i > -3'),
    ('i - (i - 1) != 2', 'i - (i - 1) != 2', 'i - (i - 1) <> 2'),
    ('-i ^ 2 < -(-i)', '-(i ^ 2) < -(-i)', '-(i ^ 2) < -(-i)'),
    ('(-i) ^ 2 * i = 4', '(-i) ^ 2 * i = 4', '(-i) ^ 2 * i = 4'),
    ('f ^ 0.5 < d ^ -1', 'f ^ 0.5 < d ^ (-1.0)', 'f ^ 0.5 < d ^ (-1.0)'),
    ('i / 2 * i mod 3 = i / (2 * i)', 'i / 2 * i mod 3 = i / (2 * i)',
     'i / 2 * i mod 3 = i / (2 * i)'),
    ('abs(i) + min(i, 2) < max(f, 0.5)', 'abs(i) + min(i, 2) < max(f, 0.5)',
     'absInt(i) + minInt(i, 2) < maxReal(f, 0.5)'),
    ('absReal(i) < minReal(i, u) + maxReal(i, d)', 'absReal(i) < minReal(i, u) + max(i, d)',
     'absReal(i) < minReal(i, u) + maxReal(i, d)'),
    ('preInt(0, i) < preReal(0.0, f)', 'preInt(0, i) < preReal(0.0, f)',
     'preInt(0, i) < preReal(0.0, f)'),
    ('preBool(r, q)', 'preBool(r, q)', 'preBool(r, q)'),
    ('ite(p, i, 3) > 2', 'ite(p, i, 3) > 2', '(if p then i else 3) > 2'),
    ('i > 1.0', 'i > 1.0', 'i > 1.0'),
    ('f > 0.1', 'f > 0.1', 'f > 0.1'),
    ('d > 1e20 & d < 1e-7', 'd > 1e20 & d < 1e-7', 'd > 1e20 and d < 1e-7'),
    ('mode = LANDING', 'mode = 3', 'mode = 3'),
])
def test_a_formula_looks_as_a_person_would_write_it(
        formula: str, in_smv: str, in_cocospec: str) -> None:
    node = smv(formula)
    assert (to_smv(node), to_cocospec(node)) == (in_smv, in_cocospec)
    assert smv(to_smv(node)) is node
    assert cocospec(to_cocospec(node)) is read_in_lustre(node)


def read_in_lustre(node: Formula) -> Formula:
    """Lustre has one sign for `<->` and `=`."""
    if isinstance(node, Binary) and node.operator is BinaryOperator.IFF:
        return Binary(BinaryOperator.EQ, node.left, node.right)
    return node


@pytest.mark.parametrize(('formula', 'in_smv', 'in_cocospec'), [
    ('mode = LANDING', 'mode = LANDING', 'mode = LANDING'),
    ('IDLE != mode', 'IDLE != mode', 'IDLE <> mode'),
    ('mode > 2', 'mode > 2', 'mode > 2'),
    ('mode = H', 'mode = "H"', 'mode = "H"'),
    ('state = off', 'state = off', 'state = off'),
    ('state = down', 'state = off', 'state = off'),
    ('preInt(IDLE, mode) = LANDING', 'preInt(IDLE, mode) = LANDING',
     'preInt(IDLE, mode) = LANDING'),
    ('ite(p, mode, IDLE) = LANDING', 'ite(p, mode, IDLE) = LANDING',
     '(if p then mode else IDLE) = LANDING'),
    ('mode + 3 = 3', 'mode + 3 = 3', 'mode + 3 = 3'),
    ('i = 3', 'i = 3', 'i = 3'),
])
def test_names_of_values_are_printed_where_they_are_given(
        formula: str, in_smv: str, in_cocospec: str) -> None:
    node = smv(formula.replace('= H', '= "H"'))
    assert (to_smv(node, values=VALUES), to_cocospec(node, values=VALUES)) == (
        in_smv, in_cocospec)
    assert smv(in_smv) is cocospec(in_cocospec) is node


@pytest.mark.parametrize('name', ['a.b', 'a_DOT_b', 'c%d', 'hello world', 'H', 'SI', 'FTP', 'and',
                                  'pre', 'TRUE', 'OT', 'node', 'say "a\\b"', '9x'])
def test_any_name_reads_back_in_quotes_where_it_needs_them(name: str) -> None:
    variable = Variable(name, ValueType.BOOL)
    scope = scope_of([variable])
    assert elaborate(parse_smv(text(to_smv(variable))), scope) is variable
    assert elaborate(parse_cocospec(text(to_cocospec(variable))), scope) is variable
    assert ('"' in to_smv(variable)) == (name not in ('a.b', 'a_DOT_b', 'c%d', 'node'))


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_a_float64_reads_back_as_itself(value: float) -> None:
    node = Binary(BinaryOperator.GT, NUMBERS[3], Constant(value, ValueType.FLOAT64))
    assert smv(to_smv(node)) is node
    assert cocospec(to_cocospec(node)) is node


@given(st.floats(width=32, allow_nan=False, allow_infinity=False))
def test_a_float32_is_printed_short_and_reads_back_as_itself(value: float) -> None:
    node = Binary(BinaryOperator.GT, NUMBERS[2], Constant(value, ValueType.FLOAT32))
    assert smv(to_smv(node)) is node
    digits = to_smv(node).split('e')[0].strip('f >-').replace('.', '').strip('0')
    assert len(digits) <= 9


def test_a_float32_is_not_printed_with_the_digits_of_a_float64() -> None:
    value = struct.unpack('<f', struct.pack('<f', 0.1))[0]
    assert to_smv(Constant(value, ValueType.FLOAT32)) == '0.1'
    assert to_smv(Constant(3.4028234663852886e38, ValueType.FLOAT32)) == '3.4028235e38'
    assert to_smv(Constant(15.0, ValueType.FLOAT32)) == '15.0'
    assert to_smv(Constant(-0.0, ValueType.FLOAT32)) == '-0.0'
    assert to_smv(Constant(1e-5, ValueType.FLOAT64)) == '1e-5'
    assert to_smv(Constant(15.0, ValueType.FLOAT64)) == '15.0'


@given(st.integers(-2 ** 63, 2 ** 64 - 1))
def test_an_integer_reads_back_as_itself(value: int) -> None:
    for number in (NUMBERS[0], NUMBERS[1]):
        node = smv(f'{to_smv(number)} > {value}')
        assert smv(to_smv(node)) is node
        assert cocospec(to_cocospec(node)) is node


RANDOM = scope_of(INPUTS)


def reread(formula: Formula, write: Callable[[Formula], str]) -> Formula:
    parse = parse_smv if write is to_smv else parse_cocospec
    return elaborate(parse(text(write(formula))), RANDOM)


def meant(formula: Formula, write: Callable[[Formula], str]) -> Formula:
    """Return what a random formula is once a user has written it, if a user can."""
    try:
        return reread(formula, write)
    except CompileError:
        # Random formulas compute with constants, which overflow where they are folded.
        assume(False)
        raise


@pytest.mark.parametrize('write', [to_smv, to_cocospec])
@given(formula=formulas(size=25))
def test_a_formula_reads_back_as_itself(formula: Formula, write: Callable[[Formula], str]) -> None:
    node = meant(formula, write)
    assert reread(node, write) is node


@given(formula=formulas(size=15), trace=traces(longest=20))
def test_both_languages_say_the_same(formula: Formula, trace: Trace) -> None:
    node = meant(formula, to_smv)
    other = meant(node, to_cocospec)
    assert verdicts(other, trace) == verdicts(node, trace)


# Formulas without numbers are written by no rule of types: random ones themselves come back.
@given(formula=formulas(tuple(item for item in INPUTS if item.type is ValueType.BOOL), size=25,
                        has_windows=False))
def test_a_formula_of_truths_reads_back_as_itself_without_being_written_before(
        formula: Formula) -> None:
    assume(all(item.type is ValueType.BOOL for item in postorder([formula])))
    windows = [item.window for item in postorder([formula]) if hasattr(item, 'window')]
    assume(all(not item.is_empty or item == Window(0, -1) for item in windows))
    assert reread(formula, to_smv) is formula
    has_iff = any(isinstance(item, Binary) and item.operator is BinaryOperator.IFF
                  for item in postorder([formula]))
    assert has_iff or reread(formula, to_cocospec) is formula


# -- times --------------------------------------------------------------------------------------

TIMED = TimeScale(Policy.TIMED)


@pytest.mark.parametrize(('formula', 'in_smv', 'in_cocospec'), [
    ('O[0,2500000000 ns] p', 'O[0, 2.5 s] p', 'OT(2.5 s, 0, p)'),
    ('H[<= 500 ms] p', 'H[0, 0.5 s] p', 'HT(0.5 s, 0, p)'),
    ('p S[>=1 min] q', 'p S[>=60 s] q', 'ST(60 s, GreaterThanOrEqual, q, p)'),
    ('O[<10 s] p', 'O[<10 s] p', 'OT(10 s, LessThan, p)'),
    ('O[0,9999999999 ns] p', 'O[<10 s] p', 'OT(10 s, LessThan, p)'),
    ('O[> 1 h] p', 'O[>1 h] p', 'OT(1 h, GreaterThan, p)'),
    ('O[=50 ms] p', 'O[=50 ms] p', 'OT(50 ms, Equal, p)'),
    ('O[0,0] p', 'O[=0] p', 'OT(0, Equal, p)'),
    ('O[0,1 ns] p', 'O[0, 1 ns] p', 'OT(1 ns, 0, p)'),
    ('O[1.5us, 2 h] p', 'O[1.5 us, 2 h] p', 'OT(2 h, 1.5 us, p)'),
    ('O[0,-1] p', 'O[0,-1] p', 'OT(-1, 0, p)'),
    ('O p & H[>= 0] q', '(O p) & (H q)', 'O(p) and H(q)'),
    ('O[0, 4611686018427387904 ns] p', 'O[0, 4611686018.427387904 s] p',
     'OT(4611686018.427387904 s, 0, p)'),
])
def test_bounds_are_times_under_the_policy_timed(
        formula: str, in_smv: str, in_cocospec: str) -> None:
    node = timed(formula)
    shown = to_smv(node, is_timed=True), to_cocospec(node, is_timed=True)
    assert shown == (in_smv, in_cocospec)
    assert timed(in_smv) is node
    assert elaborate(parse_cocospec(text(in_cocospec)), SCOPE, scale=TIMED) is node


def timed(formula: str) -> Formula:
    """Read a formula under the policy timed."""
    return elaborate(parse_smv(text(formula)), SCOPE, scale=TIMED)


TICKS = st.integers(0, 2 ** 62) | st.builds(
    lambda number, unit, less: max(0, min(number * unit - less, 2 ** 62)),
    st.integers(0, 100_000), st.sampled_from(list(NANOSECONDS.values())), st.sampled_from((0, 1)))


@given(low=TICKS, high=st.none() | TICKS)
def test_any_window_of_times_reads_back_as_itself(low: int, high: int | None) -> None:
    window = Window(*sorted((low, high))) if high is not None else Window(low, None)
    for node in (Once(window, p), Since(window, p, q)):
        assert timed(to_smv(node, is_timed=True)) is node
        written = to_cocospec(node, is_timed=True)
        assert elaborate(parse_cocospec(text(written)), SCOPE, scale=TIMED) is node


@pytest.mark.parametrize('write', [to_smv, to_cocospec])
@given(formula=formulas(size=15, has_windows=False))
def test_a_formula_with_times_reads_back_as_itself(
        formula: Formula, write: Callable[..., str]) -> None:
    node = meant(formula, write)
    parse = parse_smv if write is to_smv else parse_cocospec
    assert elaborate(parse(text(write(node, is_timed=True))), RANDOM, scale=TIMED) is node


@given(st.integers(1, 2 ** 63))
def test_the_text_of_a_time_is_exact_and_the_shortest(nanoseconds: int) -> None:
    number, unit = time_text(nanoseconds).split()
    assert Fraction(number) * NANOSECONDS[unit] == nanoseconds
    assert '.' not in number or number[-1] not in '.0'
    for length in NANOSECONDS.values():
        if nanoseconds % length == 0:
            assert len(time_text(nanoseconds)) <= len(f'{nanoseconds // length} min')
    assert time_text(-nanoseconds) == f'-{number} {unit}'


DEEP = 8_000


def chain(length: int) -> Formula:
    node: Formula = p
    for index in range(length):
        node = (Unary(UnaryOperator.NOT, node) if index % 3 == 0
                else Once(ALWAYS, node) if index % 3 == 1
                else Binary(BinaryOperator.AND, node, q))
    return node


def doubled(times: int) -> Formula:
    node: Formula = p
    for _ in range(times):
        node = Binary(BinaryOperator.AND, Yesterday(node), Historically(ALWAYS, node))
    return node


@pytest.mark.parametrize('write', [to_smv, to_cocospec])
def test_a_deep_formula_is_printed_and_read_back(write: Callable[[Formula], str]) -> None:
    node = chain(DEEP)
    assert reread(node, write) is node


@pytest.mark.parametrize('write', [to_smv, to_cocospec])
@pytest.mark.parametrize('limit', [0, 3, 4, 5, 20, 100, 10_000])
def test_a_limit_holds_even_where_a_shared_formula_would_be_endless(
        write: Callable[..., str], limit: int) -> None:
    started = time.process_time()
    shown = write(doubled(200), limit=limit)
    assert len(shown) <= max(limit, 4)
    assert shown.endswith(' ...')
    assert write(chain(DEEP), limit=limit).endswith(' ...')
    assert time.process_time() - started < 10


def test_a_text_that_fits_the_limit_is_whole() -> None:
    node = smv('H (p & q)')
    assert to_smv(node, limit=9) == 'H (p & q)'
    assert to_smv(node, limit=8) == 'H (p ...'


def test_what_no_language_has_is_printed_all_the_same() -> None:
    assert to_smv(Feedback('R1.count', ValueType.INT64)) == 'pre(R1.count)'
    assert to_smv(Once(Window(5, 2), p)) == 'O[0,-1] p'
    assert to_smv(FTP) == to_cocospec(FTP) == 'FTP'
    assert (to_smv(TRUE), to_cocospec(TRUE)) == ('TRUE', 'true')


def test_every_template_of_fret_reads_back_as_itself() -> None:
    scope = scope_of([Variable(name, ValueType.BOOL) for name in 'mcsr'])
    for entry in some(facts.templates()):
        node = elaborate(parse_smv(text(entry['ptltl'])), scope)
        assert elaborate(parse_smv(text(to_smv(node))), scope) is node
        again = elaborate(parse_cocospec(text(entry['cocospec'])), scope)
        assert again is node
        assert elaborate(parse_cocospec(text(to_cocospec(node))), scope) is node
