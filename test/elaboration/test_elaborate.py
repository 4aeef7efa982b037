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
"""Expressions get types, and become formulas: the rules of docs/numbers.md, one by one."""

from collections.abc import Callable
from fractions import Fraction
import math
import random
import time
from typing import Any

from fret_monitor.elaboration.functions import FUNCTIONS
from fret_monitor.language.cocospec import parse_cocospec
from fret_monitor.language.expression import Boolean, Expression, Infix, Name, Prefix
from fret_monitor.language.smv import parse_smv
from fret_monitor.logic.evaluate import evaluate
from fret_monitor.logic.formula import (
    ALWAYS, Binary, BinaryOperator, Choice, Constant, Conversion, FALSE, Feedback, Formula, FTP,
    Historically, Once, postorder, Previous, Since, Triggered, TRUE, Unary, UnaryOperator,
    Variable, WeakYesterday, Window, Yesterday,
)
from fret_monitor.model.diagnostics import CompileError, Problems, Source, Span, Text
from fret_monitor.model.floats import to_float32
from fret_monitor.model.values import ValueType
import pytest
from stages import elaborate, scope_of

BOOL, INT64, UINT64 = ValueType.BOOL, ValueType.INT64, ValueType.UINT64
FLOAT32, FLOAT64 = ValueType.FLOAT32, ValueType.FLOAT64

P, Q, R = (Variable(name, BOOL) for name in 'pqr')
# One input of each type of number: i8 ... i64, u8 ... u64, f32, f64.
NUMBERS = {f"{kind.value[0]}{kind.value.lstrip('uintfloa')}": Variable(
    f"{kind.value[0]}{kind.value.lstrip('uintfloa')}", kind)
    for kind in ValueType if kind.is_number}
STATE = Variable('state', ValueType.UINT8)
OTHER = Variable('other', ValueType.UINT8)
MODE = Variable('mode', ValueType.INT32)
SCOPE = scope_of(
    [P, Q, R, *NUMBERS.values(), STATE, OTHER, MODE],
    {'three': 3, 'tenth': Fraction(1, 10), 'yes': True, 'LANDED': 9, 'big': 2 ** 40},
    {'state': (('IDLE', 0), ('LANDING', 2), ('LANDED', 3)), 'other': (('ON', 1), ('OFF', 0)),
     'mode': (('AUTO', 'auto'), ('HAND', 'by hand'), ('MANUAL', 'by hand'))})


def smv(text: str, problems: Problems | None = None) -> Formula:
    """Return the formula of a text in SMV."""
    return elaborate(parse_smv(Text.whole(Source('formula', text))), SCOPE, problems)


def lustre(text: str, feedback: dict[Feedback, Formula] | None = None) -> Formula:
    """Return the formula of a text in CoCoSpec."""
    return elaborate(parse_cocospec(Text.whole(Source('formula', text))), SCOPE, None, feedback)


def mistakes(text: str, read: Callable[[str], Formula] = smv) -> list[tuple[str, str, str]]:
    """Return what is told of a text: title, the marked part, and label of each mistake."""
    with pytest.raises(CompileError) as caught:
        read(text)
    return [(item.title, text[item.span.start:item.span.end] if item.span else '', item.label)
            for item in caught.value.diagnostics]


def warnings(text: str) -> list[str]:
    """Return the titles of the warnings about a text in SMV."""
    problems = Problems()
    smv(text, problems)
    return [item.title for item in problems.warnings]


def number(value: float, kind: ValueType) -> Constant:
    """Return a constant."""
    return Constant(value, kind)


def binary(operator: str, left: Formula, right: Formula) -> Binary:
    """Return a binary node by the operator's sign."""
    return Binary(BinaryOperator(operator), left, right)


def no(formula: Formula) -> Unary:
    """Return a negation."""
    return Unary(UnaryOperator.NOT, formula)


def wide(formula: Formula, kind: ValueType) -> Conversion:
    """Return a conversion."""
    return Conversion(formula, kind)


def i(name: str) -> Formula:
    """Return an input as arithmetic sees it."""
    variable = NUMBERS[name]
    small = variable.type.is_integer and variable.type not in (INT64, UINT64)
    return wide(variable, INT64) if small else variable


class TestOperators:
    """Every operator becomes its node."""

    @pytest.mark.parametrize(('text', 'formula'), [
        ('!p', no(P)),
        ('p & q', binary('&', P, Q)),
        ('p | q', binary('|', P, Q)),
        ('p xor q', binary('xor', P, Q)),
        ('p -> q', binary('->', P, Q)),
        ('p <-> q', binary('<->', P, Q)),
        ('TRUE', TRUE),
        ('yes', TRUE),
        ('FALSE', FALSE),
        ('FTP', FTP),
        ('Z FALSE', FTP),
        ('Y p', Yesterday(P)),
        ('Z p', WeakYesterday(P)),
        ('O p', Once(ALWAYS, P)),
        ('H p', Historically(ALWAYS, P)),
        ('p S q', Since(ALWAYS, P, Q)),
        ('p T q', Triggered(ALWAYS, P, Q)),
        ('p SI q', Since(ALWAYS, P, binary('&', P, Q))),
        ('p SI[1,2] q', Since(Window(1, 2), P, binary('&', P, Q))),
        ('p T[1,2] q', Triggered(Window(1, 2), P, Q)),
        ('p = q', binary('=', P, Q)),
        ('p != q', binary('!=', P, Q)),
        ('(f32 > f32) = p', binary('=', binary('>', NUMBERS['f32'], NUMBERS['f32']), P)),
    ])
    def test_it_is_the_node_of_its_operator(self, text: str, formula: Formula) -> None:
        assert smv(text) is formula

    @pytest.mark.parametrize(('bound', 'window'), [
        ('[0,10]', Window(0, 10)), ('[3,3]', Window(3, 3)), ('[0,-1]', Window(0, -1)),
        ('[<=4]', Window(0, 4)), ('[<4]', Window(0, 3)), ('[<0]', Window(0, -1)),
        ('[=4]', Window(4, 4)), ('[>=4]', Window(4, None)), ('[>4]', Window(5, None)),
        ('[>=0]', ALWAYS), ('[0,2147483647]', Window(0, 2 ** 31 - 1)),
        ('[>2147483646]', Window(2 ** 31 - 1, None)),
    ])
    def test_a_bound_is_its_window(self, bound: str, window: Window) -> None:
        assert smv(f'O{bound} p') is Once(window, P)
        assert smv(f'H{bound} p') is Historically(window, P)
        assert smv(f'p S{bound} q') is Since(window, P, Q)

    @pytest.mark.parametrize(('bound', 'window'), [
        ('[0,three]', Window(0, 3)), ('[three,3]', Window(3, 3)), ('[<three]', Window(0, 2)),
        ('[>=three]', Window(3, None)), ('[three-1, 2*three+1]', Window(2, 7)),
        ('[=LANDED]', Window(9, 9)),
    ])
    def test_a_constant_in_a_bound_is_its_number(self, bound: str, window: Window) -> None:
        assert smv(f'O{bound} p') is Once(window, P)
        assert smv(f'p S{bound} q') is Since(window, P, Q)
        if ',' in bound:
            low, high = bound.strip('[]').split(',')
            assert lustre(f'OT({high}, {low}, p)') is Once(window, P)
            assert lustre(f'ST({high}, {low}, q, p)') is Since(window, P, Q)

    @pytest.mark.parametrize(('bound', 'title'), [
        ('[3,1]', 'this bound ends before it begins'),
        ('[1,-1]', 'a bound cannot be negative'),
        ('[-1,3]', 'a bound cannot be negative'),
        ('[0,-2]', 'a bound cannot be negative'),
        ('[<=-1]', 'a bound cannot be negative'),
        ('[<-1]', 'a bound cannot be negative'),
        ('[>-1]', 'a bound cannot be negative'),
        ('[0,2147483648]', 'a bound is at most 2147483647 steps'),
        ('[>2147483647]', 'a bound is at most 2147483647 steps'),
        ('[<2147483648]', 'a bound is at most 2147483647 steps'),
        ('[0,' + '9' * 1000 + ']', 'a bound is at most 2147483647 steps'),
    ])
    def test_a_senseless_bound_is_reported_at_its_place(
            self, bound: str, title: str) -> None:
        ((told, marked, _),) = mistakes(f'p & O{bound} q')
        assert told == title
        assert marked == bound

    @pytest.mark.parametrize('bound', ['[<0.5]', '[0,1.5]', '[0,1e3]', '[=2.0]'])
    def test_a_bound_is_a_whole_number(self, bound: str) -> None:
        assert len(mistakes(f'O{bound} q')) == 1


class TestTypes:
    """The common type of operands."""

    @pytest.mark.parametrize('name', [key for key, item in NUMBERS.items() if (
        item.type.is_integer and item.type not in (INT64, UINT64))])
    def test_small_integers_count_as_int64(self, name: str) -> None:
        assert smv(f'{name} > 5') is binary('>', i(name), number(5, INT64))
        assert smv(f'{name} + {name} = 5') is binary(
            '=', binary('+', i(name), i(name)), number(5, INT64))
        assert smv(f'-{name} = 5') is binary(
            '=', Unary(UnaryOperator.NEG, i(name)), number(5, INT64))

    @pytest.mark.parametrize(('left', 'right', 'kind'), [
        ('i8', 'u32', INT64), ('i64', 'u8', INT64), ('u64', 'u64', UINT64),
        ('u64', 'i64', INT64), ('u64', 'u8', INT64), ('f32', 'f32', FLOAT32),
        ('f32', 'f64', FLOAT64), ('f32', 'i8', FLOAT64), ('f32', 'u64', FLOAT64),
        ('f64', 'i64', FLOAT64), ('f64', 'f64', FLOAT64),
    ])
    @pytest.mark.parametrize('operator', ['+', '-', '*', '/', 'mod'])
    def test_operands_of_arithmetic_get_one_common_type(
            self, left: str, right: str, kind: ValueType, operator: str) -> None:
        for a, b in ((left, right), (right, left)):
            formula = smv(f'({a} {operator} {b}) != 0')
            assert isinstance(formula, Binary)
            sum_ = formula.left
            assert isinstance(sum_, Binary)
            assert (sum_.left.type, sum_.right.type, formula.right.type) == (kind,) * 3
            direct = [NUMBERS[a], NUMBERS[b]]
            assert [sum_.left, sum_.right] == [
                item if item.type is kind else wide(item, kind) for item in direct]

    def test_signed_and_unsigned_are_compared_as_they_are(self) -> None:
        assert smv('u64 > i8') is binary('>', NUMBERS['u64'], i('i8'))
        assert smv('i64 = u64') is binary('=', NUMBERS['i64'], NUMBERS['u64'])

    def test_an_integer_and_a_float_are_compared_as_float64(self) -> None:
        assert smv('f32 > i8') is binary(
            '>', wide(NUMBERS['f32'], FLOAT64), wide(NUMBERS['i8'], FLOAT64))
        assert smv('u64 <= f64') is binary('<=', wide(NUMBERS['u64'], FLOAT64), NUMBERS['f64'])

    def test_every_formula_is_well_typed_and_no_conversion_is_undefined(self) -> None:
        generator = random.Random(7)
        names = [*NUMBERS, '2', '-3', '0.5', 'three', 'tenth']
        for _ in range(300):
            term = generator.choice(names)
            for _ in range(generator.randrange(5)):
                term = generator.choice([
                    f'({term} {generator.choice(["+", "-", "*"])} {generator.choice(names)})',
                    f'-{term}', f'min({term}, {generator.choice(names)})', f'abs({term})',
                    f'ite(p, {term}, {generator.choice(names)})', f'({term} ^ 2)',
                    f'preReal({generator.choice(names)}, {term})'])
            check_types(smv(f'{term} {generator.choice(["<", "=", ">="])} i8 | TRUE'))


def check_types(root: Formula) -> None:
    """Check the promises of `logic/formula.py` about types."""
    for node in postorder([root]):
        match node:
            case Binary(operator, left, right) if operator.is_relation:
                mixed = {left.type, right.type} == {INT64, UINT64}
                assert left.type is right.type or mixed
                assert left.type in (BOOL, INT64, UINT64, FLOAT32, FLOAT64)
            case Binary(BinaryOperator.POW, left, right):
                assert right.type is INT64 or left.type is right.type is FLOAT64
            case Binary(_, left, right):
                assert left.type is right.type
            case Choice(_, yes, no_):
                assert yes.type is no_.type
            case Previous(initial, argument):
                assert initial.type is argument.type
            case Conversion(argument, kind):
                assert argument.type is not kind
                assert kind in (INT64, UINT64, FLOAT64)
                assert kind is FLOAT64 or argument.type.is_integer


class TestLiterals:
    """A literal takes the type of what it meets, rounded once."""

    def test_it_is_rounded_to_float32_against_float32(self) -> None:
        assert smv('f32 > 0.1') is binary(
            '>', NUMBERS['f32'], number(to_float32(Fraction(1, 10)), FLOAT32))
        assert smv('f32 > tenth') is smv('f32 > 0.1')
        assert smv('f32 + 1 > 16777217') is binary(
            '>', binary('+', NUMBERS['f32'], number(1.0, FLOAT32)), number(16777216.0, FLOAT32))

    def test_it_is_float64_against_float64(self) -> None:
        assert smv('f64 > 0.1') is binary('>', NUMBERS['f64'], number(0.1, FLOAT64))
        assert smv('3 < f64') is binary('<', number(3.0, FLOAT64), NUMBERS['f64'])

    def test_a_real_one_makes_an_integer_float64(self) -> None:
        assert smv('i8 > 2.0') is binary('>', wide(NUMBERS['i8'], FLOAT64), number(2.0, FLOAT64))
        assert smv('u64 + 1e3 > 2') is binary(
            '>', binary('+', wide(NUMBERS['u64'], FLOAT64), number(1000.0, FLOAT64)),
            number(2.0, FLOAT64))

    def test_a_whole_one_leaves_uint64_unless_it_is_negative(self) -> None:
        assert smv('u64 - 1 > 2') is binary(
            '>', binary('-', NUMBERS['u64'], number(1, UINT64)), number(2, UINT64))
        assert smv('u64 + -1 > 2') is binary(
            '>', binary('+', wide(NUMBERS['u64'], INT64), number(-1, INT64)), number(2, INT64))
        top = 2 ** 64 - 1
        assert smv(f'u64 = {top}') is binary('=', NUMBERS['u64'], number(top, UINT64))

    def test_literals_among_themselves_are_exact(self) -> None:
        assert smv('1 < 2.5') is TRUE
        assert smv('0.1 + 0.2 = 0.3') is TRUE
        assert smv('2 ^ 64 = 18446744073709551616') is TRUE
        assert smv('1 / 3.0 * 3 = 1') is TRUE
        assert smv('three * tenth >= 0.31') is FALSE
        assert smv('f32 > 0.05 + 0.05') is smv('f32 > 0.1')
        assert smv('-7 / 2 = -3 & -7 mod 2 = -1') is binary('&', TRUE, TRUE)

    def test_the_negative_zero_keeps_its_sign(self) -> None:
        formula = smv('f64 + -0.0 > 1')
        assert isinstance(formula, Binary)
        assert isinstance(formula.left, Binary)
        assert isinstance(formula.left.right, Constant)
        assert math.copysign(1, formula.left.right.value) == -1

    def test_a_whole_quotient_that_is_rounded_is_warned_of(self) -> None:
        assert warnings('f32 > 1 / 2') == ['1 / 2 in whole numbers is 0']
        assert warnings('f32 > 4 / 2') == []
        assert warnings('f32 > 1 / 2.0') == []

    @pytest.mark.parametrize(('text', 'marked'), [
        ('f32 > 1e39', '1e39'), ('f64 > 1e309', '1e309'), ('f32 + 4e38 > 1', '4e38'),
        ('i64 + 9223372036854775808 > 0', '9223372036854775808'),
        ('i8 * -9223372036854775809 > 0', '-9223372036854775809'),
        ('u64 + 18446744073709551616 > 0', '18446744073709551616'),
        ('f64 > 1e999999999', '1e999999999'),
        ('f64 > 2 ^ 99999999999', '2 ^ 99999999999'),
        ('f64 > 1.0 / 0', '1.0 / 0'),
    ])
    def test_one_that_does_not_fit_is_reported_at_its_place(self, text: str, marked: str) -> None:
        assert [item[1] for item in mistakes(text)] == [marked]


def all_relations(name: str, value: int) -> list[tuple[str, bool]]:
    """Return texts that compare an input with a number, and whether 'name is less' in each."""
    return [(f'{name} {sign} {value}', False) for sign in ('<', '<=', '>', '>=', '=', '!=')] + [
        (f'{value} {sign} {name}', True) for sign in ('<', '<=', '>', '>=', '=', '!=')]


PYTHON: dict[str, Callable[[Any, Any], bool]] = {
    '<': lambda a, b: a < b, '<=': lambda a, b: a <= b, '>': lambda a, b: a > b,
    '>=': lambda a, b: a >= b, '=': lambda a, b: a == b, '!=': lambda a, b: a != b}


@pytest.mark.parametrize('name', [key for key, item in NUMBERS.items() if item.type.is_integer])
@pytest.mark.parametrize('beyond', [0, 1, 10, 2 ** 63, 2 ** 64, 10 ** 100])
def test_integers_are_compared_with_whole_literals_by_value(name: str, beyond: int) -> None:
    low, high = NUMBERS[name].type.limits
    values = [low, low + 1, (low + high) // 2, high - 1, high]
    for literal in (low - beyond, high + beyond):
        for text, is_mirrored in all_relations(name, literal):
            problems = Problems()
            formula = smv(text, problems)
            check_types(formula)
            _, sign, _ = text.split()
            truth = [PYTHON[sign](literal, value) if is_mirrored else PYTHON[sign](value, literal)
                     for value in values]
            assert evaluate(formula, {name: values}) == truth
            # The input is read all the same: its group waits for it.
            assert NUMBERS[name] in postorder([formula])
            expected = [f'this comparison is always {str(truth[0]).lower()}'] if beyond else []
            assert [item.title for item in problems.warnings] == expected


def test_a_literal_beyond_a_type_is_a_constant_of_the_other_one() -> None:
    i64, u64 = NUMBERS['i64'], NUMBERS['u64']
    assert smv('i64 < 9223372036854775808') is binary('<', i64, number(2 ** 63, UINT64))
    assert smv('i64 < 1e40 | -7 <= u64') is binary(
        '|', binary('<', wide(i64, FLOAT64), number(1e40, FLOAT64)),
        binary('<=', number(-7, INT64), u64))


class TestPowers:
    """`^` has rules of its own."""

    def test_a_whole_exponent_keeps_the_type_of_the_base(self) -> None:
        for name, kind in (('i8', INT64), ('u64', UINT64), ('f32', FLOAT32), ('f64', FLOAT64)):
            formula = smv(f'{name} ^ three > {name}')
            assert isinstance(formula, Binary)
            assert formula.left is binary('^', i(name), number(3, INT64))
            assert formula.left.type is kind

    def test_any_other_exponent_makes_both_float64(self) -> None:
        assert smv('f32 ^ -1 > 0') is binary('>', binary(
            '^', wide(NUMBERS['f32'], FLOAT64), number(-1.0, FLOAT64)), number(0.0, FLOAT64))
        assert smv('2 ^ f32 > 0') is binary('>', binary(
            '^', number(2.0, FLOAT64), wide(NUMBERS['f32'], FLOAT64)), number(0.0, FLOAT64))
        assert smv('f64 ^ i8 > f64 ^ 2.0') is binary(
            '>', binary('^', NUMBERS['f64'], wide(NUMBERS['i8'], FLOAT64)),
            binary('^', NUMBERS['f64'], number(2.0, FLOAT64)))
        assert smv('f64 > 2.0 ^ 0.5') is binary(
            '>', NUMBERS['f64'], binary('^', number(2.0, FLOAT64), number(0.5, FLOAT64)))
        assert smv('i8 ^ 0.5 > 0') is binary('>', binary(
            '^', wide(NUMBERS['i8'], FLOAT64), number(0.5, FLOAT64)), number(0.0, FLOAT64))

    @pytest.mark.parametrize(('text', 'marked'), [
        ('i8 ^ -1 > 0', '-1'), ('i8 ^ u8 > 0', 'u8'), ('2 ^ i8 > 0', 'i8'),
        ('2 ^ -1 > f64', '-1'), ('i8 ^ 2147483648 > 0', '2147483648')])
    def test_whole_numbers_take_a_whole_exponent(self, text: str, marked: str) -> None:
        assert [item[1] for item in mistakes(text)] == [marked]

    def test_the_largest_exponent_is_legal(self) -> None:
        assert smv('i8 ^ 2147483647 > 0').type is BOOL


class TestMistakes:
    """A mistake is reported once, at the operand that contains it."""

    @pytest.mark.parametrize(('text', 'told'), [
        ('f32 + yes > 1', [("'+' takes numbers", 'yes', 'this is TRUE')]),
        ('f32 + p > 1', [("'+' takes numbers", 'p', 'this is true or false')]),
        ('-p > 1', [("'-' takes numbers", 'p', 'this is true or false')]),
        ('!5', [("'!' takes only true or false", '5', 'this is the number 5')]),
        ('!f32', [("'!' takes only true or false", 'f32', 'this is a number (float32)')]),
        ('H 3', [("'H' takes only true or false", '3', 'this is the number 3')]),
        ('p & 1', [("'&' takes only true or false", '1', 'this is the number 1')]),
        ('p S (i8 + 1)', [("'S' takes only true or false", '(i8 + 1)',
                           'this is a number (int64)')]),
        ('i8 & u8', [("'&' takes only true or false", 'i8', 'this is a number (int8)'),
                     ("'&' takes only true or false", 'u8', 'this is a number (uint8)')]),
        ('p < q', [("'<' takes numbers", 'p', 'this is true or false')]),
        ('1 < q', [("'<' takes numbers", 'q', 'this is true or false')]),
        ('p = 1', [("'=' takes two numbers, or two truth values", '1',
                    'this is the number 1, the other is true or false')]),
        ('f32 != p', [("'!=' takes two numbers, or two truth values", 'f32',
                       'this is a number (float32), the other is true or false')]),
        ('p + 1 > 2 & !7', [("'+' takes numbers", 'p', 'this is true or false'),
                            ("'!' takes only true or false", '7', 'this is the number 7')]),
        ('ite(1, p, q)', [("'ite' takes only true or false", '1', 'this is the number 1')]),
        ('ite(p, 1, q)', [("'ite' takes two numbers, or two truth values", '1',
                           'this is the number 1, the other is true or false')]),
        ('persisted(-1, p)', [("'persisted' takes a number of steps, from 0 to 2147483647, "
                               'as digits or as a constant', '-1', 'this is the number -1')]),
        ('occurred(i8, p)', [("'occurred' takes a number of steps, from 0 to 2147483647, "
                              'as digits or as a constant', 'i8', 'this is a number (int8)')]),
        ('persisted(3, 5)', [("'persisted' takes only true or false", '5',
                              'this is the number 5')]),
        ('occurred(4, 2, p)', [("'occurred' takes the smaller number of steps first", '4',
                                '4 is more than 2')]),
        ('preInt(0, f32) > 1', [("'preInt' takes whole numbers", 'f32',
                                 'this is a number (float32)')]),
        ('preBool(0, p)', [("'preBool' takes only true or false", '0',
                            'this is the number 0')]),
        ('absReal(p) > 1', [("'absReal' takes numbers", 'p', 'this is true or false')]),
        ('abs(i8, u8) > 1', [("'abs' has the wrong number of arguments", 'abs(i8, u8)',
                              '2 given')]),
        ('f32(3) > 1', [('arrays are not supported', 'f32(3)', "'f32' is an input")]),
        ('f32(i8, 1) > 1', [("there is no function 'f32'", 'f32', "'f32' is an input")]),
        ('yout(3) > 1', [("there is no function 'yout', and arrays are not supported", 'yout(3)',
                          'not known')]),
        ('f32 => 3', [("'=>' takes only true or false", '3', 'this is the number 3')]),
        ('absolut(f32) > 3', [("there is no function 'absolut'", 'absolut', '')]),
        ('nobody & nobody & anybody',
         [("'nobody' is not declared", 'nobody', 'unknown name'),
          ("'anybody' is not declared", 'anybody', 'unknown name')]),
        ('nobody + 1 > !p', [("'nobody' is not declared", 'nobody', 'unknown name')]),
    ])
    def test_it_is_reported_in_place(self, text: str, told: list[tuple[str, str, str]]) -> None:
        assert mistakes(text) == told

    @pytest.mark.parametrize(('text', 'help_'), [
        ('f33 > 1', "did you mean 'f32'?"),
        ('abs > 1', 'it is a function: write abs(x)'),
        ('LANDING > 1', "it is a value of 'state': compare the two, as in state = LANDING"),
        ('absInd(f32) > 1', "did you mean 'absInt'?"),
        ('f32 => 3', "=> is an implication; for 'at least' write >="),
        ('f32 -> 3', 'compare it with something, as in x > 0'),
        ('gamma(f32) > 1', 'one of ' + ', '.join(sorted(FUNCTIONS))),
        ('yout(3) > 1',
         'for an element of an array declare an input of its own, such as yout_3'),
        ('p & 1', 'write TRUE'),
        ('p & f32', 'compare it with something, as in x > 0'),
        ('p & state', 'compare it with one of its values: IDLE, LANDING, LANDED'),
        ('O[3,1] p', 'write [1,3]'),
        ('preInt(0, f32) > 1', 'write preReal'),
        ('occurred(p)', 'write occurred(n, p) or occurred(m, n, p)'),
    ])
    def test_the_help_says_what_to_write(self, text: str, help_: str) -> None:
        with pytest.raises(CompileError) as caught:
            smv(text)
        assert caught.value.diagnostics[0].help == help_


class TestValues:
    """The names of an input's values."""

    def test_a_name_is_its_number_beside_its_input(self) -> None:
        state = wide(STATE, INT64)
        assert smv('state = LANDING') is binary('=', state, number(2, INT64))
        assert smv('IDLE != state') is binary('!=', number(0, INT64), state)
        assert smv('state >= LANDING') is binary('>=', state, number(2, INT64))
        assert smv('state = 2') is smv('state = LANDING')

    def test_a_name_of_a_string_is_the_place_of_the_string(self) -> None:
        mode = wide(MODE, INT64)
        assert smv('mode = AUTO') is binary('=', mode, number(0, INT64))
        assert smv('HAND = mode') is binary('=', number(1, INT64), mode)
        # Two names of one string: a stored input is only the string's number.
        assert smv('mode != MANUAL') is binary('!=', mode, number(1, INT64))

    def test_a_value_comes_before_a_constant_of_its_name(self) -> None:
        assert smv('state = LANDED') is binary('=', wide(STATE, INT64), number(3, INT64))
        assert smv('i8 = LANDED') is binary('=', i('i8'), number(9, INT64))
        assert warnings('state = LANDED') == ["'LANDED' is a constant and the name of a value"]
        assert warnings('i8 = LANDED') == []

    def test_names_reach_through_pre_and_choices(self) -> None:
        state = wide(STATE, INT64)
        assert smv('preInt(IDLE, state) = LANDING') is binary(
            '=', Previous(number(0, INT64), state), number(2, INT64))
        assert smv('ite(p, state, IDLE) = LANDING') is binary(
            '=', Choice(P, state, number(0, INT64)), number(2, INT64))
        assert lustre('(IDLE -> pre state) = LANDING') is binary(
            '=', Previous(number(0, INT64), state), number(2, INT64))
        assert smv('preInt(AUTO, mode) != mode') is binary(
            '!=', Previous(number(0, INT64), wide(MODE, INT64)), wide(MODE, INT64))

    @pytest.mark.parametrize(('text', 'told'), [
        ('state = LANDIG', [("'LANDIG' is neither declared nor a value of the other "
                             'operand', 'LANDIG', 'unknown name')]),
        ('state = ON', [("'ON' is neither declared nor a value of the other operand",
                         'ON', 'unknown name')]),
        ('LANDING = IDLE', [("'LANDING' is not declared", 'LANDING', 'unknown name'),
                            ("'IDLE' is not declared", 'IDLE', 'unknown name')]),
        ('mode = 1', [("'=' cannot take text together with something else", '1',
                       'this is the number 1')]),
        ('mode < HAND', [("'<' takes numbers", 'mode', 'this is text')]),
        ('mode + 1 > 1', [("'+' takes numbers", 'mode', 'this is text')]),
        ('mode = i32', [("'=' cannot take text together with something else", 'i32',
                         'this is a number (int32)')]),
        ('p = mode', [("'=' takes two numbers, or two truth values", 'mode',
                       'this is text, the other is true or false')]),
    ])
    def test_a_name_that_is_no_value_of_the_input_is_reported(
            self, text: str, told: list[tuple[str, str, str]]) -> None:
        assert mistakes(text) == told


class TestFunctions:
    """FRET's predefined functions."""

    @pytest.mark.parametrize(('text', 'formula'), [
        ('persisted(3, p)', binary('&', Historically(Window(0, 3), P),
                                   Historically(Window(0, 2), no(FTP)))),
        ('persisted(0, p)', binary('&', Historically(Window(0, 0), P),
                                   Historically(Window(0, -1), no(FTP)))),
        ('persisted(1, 3, p)', binary('&', Historically(Window(1, 3), P),
                                      Historically(Window(0, 2), no(FTP)))),
        ('occurred(3, p)', binary('&', Since(ALWAYS, no(FTP), P), Once(Window(0, 3), P))),
        ('occurred(1, 3, p)', Since(Window(1, 3), no(FTP), P)),
        ('prevOcc(p, q)', binary('|', FTP, Yesterday(binary(
            '->', Since(ALWAYS, binary('&', no(FTP), no(P)), P),
            Since(ALWAYS, binary('&', no(FTP), no(P)), binary('&', P, Q)))))),
        ('preBool(q, p)', Previous(Q, P)),
        ('ite(p, q, r)', Choice(P, Q, R)),
        ('preInt(0, i8) = 1', binary('=', Previous(number(0, INT64), i('i8')),
                                     number(1, INT64))),
        ('preReal(0, f32) = 1', binary('=', Previous(number(0.0, FLOAT32), NUMBERS['f32']),
                                       number(1.0, FLOAT32))),
        ('preReal(0, i8) = 1', binary(
            '=', Previous(number(0.0, FLOAT64), wide(NUMBERS['i8'], FLOAT64)),
            number(1.0, FLOAT64))),
        ('preInt(three, 5) = i8', binary('=', Previous(number(3, INT64), number(5, INT64)),
                                         i('i8'))),
        ('ite(p, 1, 2.5) > f32', binary(
            '>', Choice(P, number(1.0, FLOAT64), number(2.5, FLOAT64)),
            wide(NUMBERS['f32'], FLOAT64))),
        ('abs(i8) > absReal(i8)', binary(
            '>', wide(Unary(UnaryOperator.ABS, i('i8')), FLOAT64),
            Unary(UnaryOperator.ABS, wide(NUMBERS['i8'], FLOAT64)))),
        ('absInt(-3) = maxInt(1, 3)', TRUE),
        ('sqrt(f32) > floor(i8)', binary(
            '>', Unary(UnaryOperator.SQRT, wide(NUMBERS['f32'], FLOAT64)),
            Unary(UnaryOperator.FLOOR, wide(NUMBERS['i8'], FLOAT64)))),
        ('atan2(1, three) > f64', binary(
            '>', binary('atan2', number(1.0, FLOAT64), number(3.0, FLOAT64)), NUMBERS['f64'])),
        ('min(1, u64) > max(2, f32)', binary(
            '>', wide(binary('min', number(1, UINT64), NUMBERS['u64']), FLOAT64),
            wide(binary('max', number(2.0, FLOAT32), NUMBERS['f32']), FLOAT64))),
    ])
    def test_it_is_frets_formula(self, text: str, formula: Formula) -> None:
        assert smv(text) is formula


class TestLustre:
    """What Lustre adds: `pre`, `->`, `if`, and equations."""

    @pytest.mark.parametrize(('text', 'formula'), [
        ('(0 -> pre i8) > 1', binary('>', Previous(number(0, INT64), i('i8')),
                                     number(1, INT64))),
        ('(i8 -> u8) > 1', binary('>', Choice(FTP, i('i8'), i('u8')), number(1, INT64))),
        ('q -> pre p', Previous(Q, P)),
        ('pre p', Previous(FALSE, P)),
        ('pre f32 > 1', binary('>', Previous(number(0.0, FLOAT32), NUMBERS['f32']),
                               number(1.0, FLOAT32))),
        ('if p then q else r', Choice(P, Q, R)),
        ('ST(5, 1, p, q)', Since(Window(1, 5), Q, P)),
    ])
    def test_it_is_the_node_of_its_operator(self, text: str, formula: Formula) -> None:
        assert lustre(text) is formula

    def test_equations_are_put_in_where_they_are_used(self) -> None:
        assert lustre('a = b and p; b = not q; c = a or b;') is binary(
            '|', binary('&', no(Q), P), no(Q))
        assert lustre('c = 5; ok = i8 > c;') is binary('>', i('i8'), number(5, INT64))

    def test_an_equation_on_itself_becomes_feedback(self) -> None:
        feedback: dict[Feedback, Formula] = {}
        formula = lustre('n = 0 -> pre n + 1; ok = n < 3;', feedback)
        (cell,) = feedback
        step = Choice(FTP, number(0, INT64), binary('+', cell, number(1, INT64)))
        assert feedback[cell] is step
        assert formula is binary('<', step, number(3, INT64))
        assert evaluate(formula, {'p': [True] * 5}, tuple(feedback.items())) == [
            True, True, True, False, False]

    @pytest.mark.parametrize(('text', 'trace', 'expected'), [
        ('latch = p or YtoPre(latch);', {'p': [0, 0, 1, 0, 0]}, [0, 0, 1, 1, 1]),
        ('all = p and ZtoPre(all);', {'p': [1, 1, 0, 1, 1]}, [1, 1, 0, 0, 0]),
        ('t = p -> not pre t;', {'p': [1, 1, 1, 1]}, [1, 0, 1, 0]),
        ('a = true -> pre b; b = false -> pre a; ok = a;', {'p': [0] * 4}, [1, 0, 1, 0]),
        ('f = 1 -> pre g; g = 1 -> pre (f + g); ok = f = 5;', {'p': [0] * 7},
         [0, 0, 0, 0, 1, 0, 0]),
        ('n = preInt(0, n) + 1; ok = n > 2;', {'p': [0] * 4}, [0, 0, 1, 1]),
        ('d = p -> pre (false -> pre d); ok = d;', {'p': [1, 1, 1, 1, 1, 1]},
         [1, 0, 1, 0, 1, 0]),
        ('all = H(true -> pre all) and p;', {'p': [1, 1, 0, 1, 1]}, [1, 1, 0, 0, 0]),
    ])
    def test_feedback_means_the_step_before(
            self, text: str, trace: dict[str, list[int]], expected: list[int]) -> None:
        feedback: dict[Feedback, Formula] = {}
        formula = lustre(text, feedback)
        length = len(trace['p'])
        assert feedback
        columns = {'p': [bool(value) for value in trace['p']]}
        verdicts = evaluate(formula, columns, tuple(feedback.items()))
        assert verdicts == [bool(value) for value in expected], length

    @pytest.mark.parametrize(('text', 'kind'), [
        ('s = 0 -> pre s + i8; ok = s > 1;', INT64),
        ('s = u64 -> pre s + 1; ok = s > 1;', UINT64),
        ('s = 0.0 -> pre s + f32; ok = s > 1;', FLOAT32),
        ('s = 0 -> pre s + f32; ok = s > 1;', FLOAT32),
        ('s = 0.0 -> pre s + f64; ok = s > 1;', FLOAT64),
        ('s = 0 -> pre s + 0.5; ok = s > 1;', FLOAT64),
        ('s = i8 -> if p then pre s + f32 else pre s; ok = s > 1;', FLOAT64),
        ('s = 0.0 -> if p then pre s + f32 else pre s; ok = s > 1;', FLOAT32),
        ('node n(f32: real) returns (ok: bool); var s: real; '
         'let s = 0.0 -> pre s + f32; ok = s > 1.0; tel', FLOAT64),
        ('node n(f32: real) returns (ok: bool); var s: int; '
         'let s = 0 -> pre s + 1; ok = s > 1; tel', INT64),
        ('s = f32 -> if p then pre s + 1 else pre s; ok = s > 1;', FLOAT32),
        ('s = if preReal(0, s) > 1 then f32 else f32; ok = s > 1;', FLOAT64),
        ('s = p -> q and pre s;', BOOL),
    ])
    def test_feedback_has_the_type_that_its_equation_agrees_with(
            self, text: str, kind: ValueType) -> None:
        feedback: dict[Feedback, Formula] = {}
        check_types(lustre(text, feedback))
        assert [cell.type for cell in feedback] == [kind]
        assert [equation.type for equation in feedback.values()] == [kind]

    @pytest.mark.parametrize(('text', 'told'), [
        ('a = b and p; b = not a;',
         [("the equation of 'a' uses its own value at the same step", 'b',
           'a -> b -> a')]),
        ('a = O(a);',
         [("the equation of 'a' uses its own value at the same step", 'a', 'a -> a')]),
        ('node n(p: int) returns (ok: bool); let ok = true; tel',
         [("'p: int' takes numbers", 'p', 'this is true or false')]),
        ('node n(f32: int) returns (ok: bool); let ok = true; tel',
         [("'f32: int' takes whole numbers", 'f32', 'this is a number (float32)')]),
        ('node n(nobody: int) returns (ok: bool); let ok = nobody > 1; tel',
         [("the bundle has no 'nobody'", 'nobody', 'an input of this node')]),
        ('node n(p: bool) returns (ok: int); let ok = p; tel',
         [("'ok: int' takes numbers", 'p', 'this is true or false')]),
        ('node n(p: bool) returns (ok: boolean); let ok = p; tel',
         [("Lustre's type 'boolean' is not known", 'ok', '')]),
        ('x = nobody -> pre x;', [("'nobody' is not declared", 'nobody', 'unknown name')]),
        ('x = 0 -> pre x and p;',
         [("'&' takes only true or false", 'pre x', 'this is a number (int64)')]),
    ])
    def test_a_mistake_in_equations_is_reported(
            self, text: str, told: list[tuple[str, str, str]]) -> None:
        assert mistakes(text, lustre) == told


class TestSize:
    """Deep formulas, and long chains of names."""

    def test_a_formula_of_twenty_thousand_levels_costs_no_recursion(self) -> None:
        place = Span(Source('deep', 'p'), 0, 1)
        tree: Expression = Name('p', place)
        for level in range(20_000):
            tree = (Prefix('Y' if level % 2 else '!', None, tree, place, place) if level % 3
                    else Infix('&', None, tree, Boolean(True, place), place, place))
        begin = time.process_time()
        formula = elaborate(tree, SCOPE)
        assert len(postorder([formula])) > 18_000
        assert time.process_time() - begin < 60

    def test_a_shared_tree_is_walked_once(self) -> None:
        place = Span(Source('shared', 'p'), 0, 1)
        tree: Expression = Name('p', place)
        for _ in range(200):
            tree = Infix('&', None, tree, tree, place, place)
        assert len(postorder([elaborate(tree, SCOPE)])) == 201

    def test_a_long_chain_of_equations_costs_no_recursion(self) -> None:
        chain = ''.join(f'e{k} = not e{k + 1};' for k in range(3000)) + 'e3000 = p; ok = e0;'
        assert len(postorder([lustre(chain)])) == 3001


class TestRandomTexts:
    """Any text gives a well-typed formula, or mistakes with their places."""

    NAMES = ('p', 'q', 'state', 'mode', 'LANDING', 'ON', 'AUTO', 'nobody', 'three', 'tenth', 'yes',
             'big', 'LANDED', 'FTP', 'TRUE', '1', '0', '2.5', '-3', '1e40', '1e400',
             '9223372036854775808', '18446744073709551616', *NUMBERS)
    SIGNS = ('+', '-', '*', '/', 'mod', '^', '<', '<=', '=', '!=', '&', '|', '->', 'S', 'SI[1,2]')
    PREFIXES = ('!', '-', 'H', 'O[<3]', 'Y', 'Z')

    def text(self, generator: random.Random, depth: int) -> str:
        """Return a random text in SMV, of right syntax."""
        if depth == 0 or generator.random() < 0.2:
            return generator.choice(self.NAMES)
        parts = [self.text(generator, depth - 1) for _ in range(3)]
        match generator.randrange(4):
            case 0:
                return f'({generator.choice(self.PREFIXES)} {parts[0]})'
            case 1:
                name = generator.choice(sorted(FUNCTIONS))
                return f'{name}({", ".join(parts[:generator.choice([1, 2, 2, 3])])})'
            case _:
                return f'({parts[0]} {generator.choice(self.SIGNS)} {parts[1]})'

    def test_a_text_is_understood_or_refused_with_a_place(self) -> None:
        generator = random.Random(20)
        understood = 0
        for _ in range(2000):
            text = self.text(generator, generator.choice([1, 2, 3]))
            try:
                check_types(smv(text))
                understood += 1
            except CompileError as error:
                assert error.diagnostics, text
                assert all(item.span for item in error.diagnostics), text
        assert 200 < understood < 1800

    def number(self, generator: random.Random, depth: int) -> str:
        """Return a random term of whole numbers, in Lustre."""
        if depth == 0 or generator.random() < 0.25:
            return generator.choice(['i8', 'u8', 'i64', 'u64', '1', '2', 'three', 'f32', '0.5'])
        a, b = self.number(generator, depth - 1), self.number(generator, depth - 1)
        match generator.randrange(5):
            case 0:
                return f'({a} {generator.choice(["+", "-", "*"])} {b})'
            case 1:
                return f'({a} -> pre {b})'
            case 2:
                return f'(if p then {a} else {b})'
            case 3:
                return f'({a} -> pre {generator.choice(["x", "y"])} + {b})'
            case _:
                return f'({a} -> pre({b} - {generator.choice(["x", "y"])}))'

    def test_equations_through_pre_close_in_the_type_of_their_feedback(self) -> None:
        generator = random.Random(21)
        closed = 0
        for _ in range(500):
            text = (f'x = {self.number(generator, 3)}; y = {self.number(generator, 3)}; '
                    'ok = x < y or YtoPre(ok);')
            feedback: dict[Feedback, Formula] = {}
            formula = lustre(text, feedback)
            roots = [formula, *feedback.values()]
            for root in roots:
                check_types(root)
            for cell, equation in feedback.items():
                assert cell.type is equation.type, text
            reached = {node for node in postorder(roots) if isinstance(node, Feedback)}
            assert reached <= set(feedback), text
            closed += len(reached)
        assert closed > 500

    def test_whole_numbers_compute_as_in_mathematics(self) -> None:
        generator = random.Random(22)
        values = {'i8': -5, 'u8': 3, 'i16': 7, 'u32': 11, 'i64': -2}
        for _ in range(300):
            text = generator.choice([*values, '4', '-6'])
            for _ in range(generator.randrange(6)):
                text = f'({text} {generator.choice("+-*")} {generator.choice([*values, "9"])})'
            sign = generator.choice(['<', '<=', '>', '>=', '=', '!='])
            limit = generator.randrange(-40, 40)
            (verdict,) = evaluate(smv(f'{text} {sign} {limit}'),
                                  {name: [value] for name, value in values.items()})
            expected = PYTHON[sign](eval(text, {}, values), limit)
            assert verdict == expected, text
