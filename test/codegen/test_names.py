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

"""Names that users choose, however odd, become C that compiles and gives right verdicts."""

from dataclasses import replace
import re

from codegen.workbench import assert_clean_and_right, specify
from differential.compiled import c_module, CSRC
from fret_monitor.codegen.names import distinct, identifier, Names
from fret_monitor.logic.formula import (
    Binary, BinaryOperator, Constant, Conversion, Formula, Historically, Once, Unary,
    UnaryOperator, Variable, Window, Yesterday,
)
from fret_monitor.model.values import ValueType
from hypothesis import given
from hypothesis import strategies as st
import pytest
from strategies import some

KEYWORDS = """
auto break case char const continue default do double else enum extern float for goto if inline
int long register restrict return short signed sizeof static struct switch typedef union
unsigned void volatile while _Bool _Complex bool asm typeof class new delete this template
private public and not xor nullptr constexpr thread_local namespace operator virtual
""".split()
LIBRARY = """
errno NULL NAN INFINITY EOF INT64_MIN UINT64_C HUGE_VAL M_PI FLT_MAX DBL_EPSILON true false
size_t int8_t uint64_t float_t ptrdiff_t max_align_t offsetof pow fmod fmodf memset memcpy sin
exp log log2 abs fabs round floor isnan signbit isinf gamma signgam y0 j1 y1 index main printf
stdin stdout malloc environ linux unix i386 math_errhandling fpclassify nan nanf div time clock
strlen bcmp FLT_EVAL_METHOD __FILE__ __func__ _Generic assert I
""".split()
OURS = """
s in state inputs verdicts monitor groups requirements none fm_bit fm_monitor fm_once_within_u8
FM_ABI FM_EXPORT value_3 once_1 once_2 x_f64 x_f64_2_ _x __x x_ bits_0 next_0 wire_1 line_2
flag_1 number_5 number_5_i64 group_0 v_int v_in v_s i random_step random_reset random_monitor
random_req_R_1 random_state struct_random inputs_0 requirements_0 fret fret_monitor counter_1
position_65 yesterday_1
""".split()
NAMES = list(dict.fromkeys([*KEYWORDS, *LIBRARY, *OURS]))
QUOTED = ['two words', 'Übergröße', '日本', 'a%s%n', '*/ int', '// x', '??/', '9lives', 'a_DOT_b',
          'a.b', '$cost', 'a' * 300, '100%', 'x y', 'x_y', 'x-y', "it's",
          '\N{RIGHT-TO-LEFT MARK}x']


# What calls a function makes the module include `math.h`, whose macros no name may be.
CALL = Binary(BinaryOperator.LT, Unary(UnaryOperator.SQRT, Variable('root', ValueType.FLOAT64)),
              Constant(0.5, ValueType.FLOAT64))


# C++23, 5.11 and C23, 6.4.1, but for those that are names with two underscores in C.
RESERVED = """
alignas alignof and and_eq asm auto bitand bitor bool break case catch char char8_t char16_t
char32_t class compl concept const const_cast consteval constexpr constinit continue co_await
co_return co_yield decltype default delete do double dynamic_cast else enum explicit export extern
false float for friend goto if inline int long mutable namespace new noexcept not not_eq nullptr
operator or or_eq private protected public register reinterpret_cast requires restrict return short
signed sizeof static static_assert static_cast struct switch template this thread_local throw true
try typedef typeid typename typeof union unsigned using virtual void volatile wchar_t while xor
xor_eq
""".split()


def small(name: str, kind: ValueType = ValueType.BOOL) -> Variable:
    return Variable(name, kind)


def each_in_use(names: list[str]) -> list[Formula]:
    """Return formulas that generate locals, cells and comments for each name."""
    formulas: list[Formula] = []
    for number, name in enumerate(names):
        other = small(names[number - 1])
        formulas.append(Binary(BinaryOperator.IMPLIES, Once(Window(0, 3), small(name)), other))
        formulas.append(Historically(Window(0, None), Binary(
            BinaryOperator.OR, small(name), Yesterday(small(name)))))
    return formulas


@pytest.mark.parametrize(
    'names', some([LIBRARY, KEYWORDS, OURS, QUOTED, NAMES + QUOTED], 2),
    ids=some(['library', 'keywords', 'ours', 'quoted', 'all in one group'], 2))
def test_inputs_may_have_any_name(names: list[str]) -> None:
    names = list(dict.fromkeys(names))
    formulas = each_in_use(names)
    is_all = len(names) > 200
    if is_all:
        whole: Formula = small(names[0])
        for item in formulas:
            whole = Binary(BinaryOperator.XOR, whole, item)
        formulas = [whole]
    assert_clean_and_right(specify([*formulas, CALL]), with_clang=is_all)


def test_no_name_in_c_is_a_keyword_of_c_or_cpp() -> None:
    # A header with the input `requires` could not be included by C++.
    assert [word for word in RESERVED if identifier(word) == word] == []


@pytest.mark.parametrize('kind', [ValueType.FLOAT32, ValueType.FLOAT64])
def test_numeric_inputs_may_have_any_name(kind: ValueType) -> None:
    limit = Constant(0.5, ValueType.FLOAT64)
    formulas: list[Formula] = []
    for name in [*OURS, *LIBRARY, 'x', 'y']:
        item: Formula = small(name, kind)
        number = item if kind is ValueType.FLOAT64 else Conversion(item, ValueType.FLOAT64)
        twice = Binary(BinaryOperator.ADD, number, Unary(UnaryOperator.ABS, number))
        formulas.append(Binary(BinaryOperator.LT, twice, limit))
    whole = formulas[0]
    for item in formulas[1:]:
        whole = Binary(BinaryOperator.XOR, whole, item)
    assert_clean_and_right(specify([*formulas, whole, CALL]), with_clang=kind is ValueType.FLOAT32)


def test_definitions_may_have_any_name_also_the_c_name_of_an_input() -> None:
    names = ['a b', 'a_b', 'a-b', *NAMES, *QUOTED]
    terms: list[Formula] = [Once(Window(0, number + 1), small('p' if number % 2 else 'a_b'))
                            for number, _ in enumerate(names)]
    whole = terms[0]
    for item in terms[1:]:
        whole = Binary(BinaryOperator.IFF, whole, item)
    specification = replace(
        specify([whole, Historically(Window(0, 9), terms[3]), CALL]),
        definitions=tuple((f"{name}'", item) for name, item in zip(names, terms, strict=True)))
    assert_clean_and_right(specification)
    specification = replace(
        specification,
        definitions=tuple((name, item) for name, item in zip(names, terms, strict=True)
                          if name != 'a_b'))
    assert_clean_and_right(specification)


@pytest.mark.parametrize('stem', some([
    'fret', 'FRET', 'fm', 'fm_', 'math', 'string', 'int', 'main', 'errno', '9lives',
    'fret_monitor', 'fret_cells', 'evaluator', 'Ünï', '日本', 'a b', 'a.b', '-', '_', '__x',
    '.yaml', 'FM', 'FM_EXPORT', 'NULL', 'bool', '??/', '%s', '"', 'x\\', '*/',
    'x\n#error', 'linux', 'std',
    '\N{RIGHT-TO-LEFT OVERRIDE}lmay', '\udcff', 'clock', 'memset', 'n' * 100], 3))
def test_a_bundle_may_have_any_file_name(stem: str) -> None:
    p, q = small('p'), small('q')
    module = assert_clean_and_right(specify([Once(Window(0, 3), p), Yesterday(q)], stem), steps=20,
                                    with_clang=stem in ('std', 'fm', 'linux'))
    assert re.fullmatch('[A-Za-z][A-Za-z0-9_]*_monitor', module.symbol)
    names = [module.header[0], *(name for name, _ in module.sources)]
    assert all(re.fullmatch(r'[A-Za-z][A-Za-z0-9_]*_monitor\.[ch]', name) for name in names)
    assert not {path.name for path in CSRC.iterdir()} & set(names)


def test_plain_names_are_unchanged() -> None:
    assert distinct(['wind_speed', 'Alt2', 'x']) == {
        'wind_speed': 'wind_speed', 'Alt2': 'Alt2', 'x': 'x'}
    names = Names('quadrotor', ['wind_speed'], ['ROS-001'], ['overload'])
    assert names.symbol == 'quadrotor_monitor'
    assert names.requirements == ['quadrotor_req_ROS_001']
    assert names.definitions == {'wind_speed': 'wind_speed', 'overload': 'overload'}


def test_a_later_name_does_not_change_those_before_it() -> None:
    names = ['int', 'v_int', 'x y', 'x_y']
    for count in range(1, len(names) + 1):
        assert list(distinct(names[:count]).items()) == list(distinct(names).items())[:count]


@given(st.lists(st.text(min_size=1), unique=True))
def test_different_names_become_different_identifiers(names: list[str]) -> None:
    chosen = distinct(names)
    assert len(set(chosen.values())) == len(names)
    assert all(re.fullmatch('[A-Za-z][A-Za-z0-9_]*', word) for word in chosen.values())


@given(st.from_regex(r'[A-Za-z_][A-Za-z0-9_]{0,8}', fullmatch=True))
def test_an_unchanged_name_cannot_be_a_name_of_the_generator(name: str) -> None:
    # The generator's names end in a number, have one of our prefixes, or are listed.
    if identifier(name) == name:
        assert not re.fullmatch(r'(fm|FM)_.*|[a-z]+_[0-9]+|_.*|.*_t|[A-Z0-9_]+', name)


def test_the_same_names_give_the_same_c_whatever_was_generated_before() -> None:
    first = c_module(specify(each_in_use(QUOTED)))
    c_module(specify(each_in_use(OURS), 'other'))
    assert c_module(specify(each_in_use(QUOTED))) == first
