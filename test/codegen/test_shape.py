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

"""Properties of generated C: its text, nesting, symbols, and support by compilers."""

from collections.abc import Callable
import ctypes
import math
from pathlib import Path
from random import Random
import re
import shutil
import subprocess
import sys

from codegen.workbench import assert_clean_and_right, check_with_clang, inputs_of, specify
from differential.compiled import (
    c_module, clang, compile_c, Compiled, CSRC, FLAGS, gcc, WARNINGS, write_module, ZIG,
)
from differential.timed_monitor import TimedMonitor
from fret_monitor.build import generate_monitor, read
from fret_monitor.codegen import c
from fret_monitor.codegen.module import CModule
from fret_monitor.logic.evaluate import verdicts
from fret_monitor.logic.formula import (
    Binary, BinaryOperator, Choice, Constant, Formula, Once, Unary, UnaryOperator, Variable,
    Window,
)
from fret_monitor.logic.specification import Specification
from fret_monitor.logic.timed import evaluate_timed, TimedTrace
from fret_monitor.model.policies import Policy
from fret_monitor.model.values import ValueType
from fret_monitor.smt.terms import LIBRARY
import golden
from hypothesis import given
from hypothesis import strategies as st
import pytest
from strategies import (
    all_values, as_term, INPUTS, random_inputs, random_property, random_trace,
    specification_of, Trace,
)

ROOT = Path(__file__).resolve().parents[2]
P, Q = Variable('p', ValueType.BOOL), Variable('q', ValueType.BOOL)
FLOAT64, INT64 = ValueType.FLOAT64, ValueType.INT64
D, M = Variable('d', FLOAT64), Variable('m', INT64)
TARGETS = {
    'x86-linux-musl': ('-msse2', '-mfpmath=sse'), 'arm-linux-gnueabihf': (),
    'aarch64-linux-gnu': (), 'riscv64-linux-gnu': (), 's390x-linux-gnu': (),
}


@pytest.fixture(scope='module')
def module() -> CModule:
    """Return generated C with every construct, from random requirements on all inputs."""
    rng = Random(6)
    return c_module(specification_of(
        [random_property(rng, f'R-{number}', random_inputs(rng), size=60, loops=number % 3)
         for number in range(24)]))


# -- golden files -----------------------------------------------------------------------------


def text_of(bundle: Path) -> str:
    """Return header and sources of a bundle, one after the other."""
    made = generate_monitor(read(bundle)).module
    return '\n'.join(text for _, text in (made.header, *made.sources)) \
        .replace(made.source_hash, 'HASH')


def test_the_c_of_the_demo_is_its_golden_file() -> None:
    bundle = ROOT / 'config' / 'quadrotor.yaml'
    if not bundle.is_file():
        pytest.skip('needs the source tree')
    golden.check(golden.FOLDER / 'c' / 'quadrotor.yaml', text_of(bundle))


@pytest.mark.parametrize('case', golden.cases('c'), ids=lambda path: path.stem)
def test_the_c_of_a_bundle_is_its_golden_file(case: Path) -> None:
    golden.check(case, text_of(case))


@pytest.mark.parametrize('case', golden.cases('c'), ids=lambda path: path.stem)
def test_the_c_of_the_golden_files_gives_right_verdicts(case: Path) -> None:
    specification = read(case).specification
    check_with_clang(c_module(specification))
    if specification.policy is Policy.TIMED:
        check_timed(specification)
        return
    trace = random_trace(Random(1), inputs_of(specification), 1500)
    found = Compiled(specification, flags=(*FLAGS, *WARNINGS)).run(trace)
    for number, item in enumerate(specification.properties):
        assert found[number] == verdicts(item.formula, trace, item.feedback), item.id


def check_timed(specification: Specification) -> None:
    """Check the verdicts at all ticks of a trace with at most four rows a second."""
    rng = Random(1)
    ticks = [0]
    for _ in range(300):
        ticks.append(ticks[-1] + rng.choice([250_000_000, 300_000_000, 300_000_001, 2 * 10 ** 9]))
    trace = TimedTrace(ticks, random_trace(rng, inputs_of(specification), len(ticks)),
                       ticks[-1] + 5 * 10 ** 9)
    found = TimedMonitor(specification, (*FLAGS, *WARNINGS)).run(trace).verdicts
    for number, item in enumerate(specification.properties):
        assert found[number] == evaluate_timed([item.formula], trace, item.feedback)[0], item.id


# -- nesting ----------------------------------------------------------------------------------


def nesting(text: str) -> int:
    """Return the depth of parentheses in C, comments and string literals left out."""
    deepest = level = 0
    for sign in re.findall(r'//[^\n]*|"(?:[^"\\]|\\.)*"|[()]', text):
        level += {'(': 1, ')': -1}.get(sign, 0)
        deepest = max(deepest, level)
    assert level == 0
    return deepest


PROVOKING: dict[str, Callable[[Formula, int], Formula]] = {
    'not': lambda item, n: Unary(UnaryOperator.NOT, item),
    'and or': lambda item, n: Binary(
        BinaryOperator.AND if n % 2 else BinaryOperator.OR, item, [P, Q][n // 2 % 2]),
    'xor': lambda item, n: Binary(BinaryOperator.XOR, [P, Q][n % 2], item),
    'implies': lambda item, n: Binary(BinaryOperator.IMPLIES, item, [P, Q][n % 2]),
    'choice': lambda item, n: Choice([P, Q][n % 2], item, Unary(UnaryOperator.NOT, item)),
    'sum': lambda item, n: Binary(BinaryOperator.ADD, item, Constant(float(n), FLOAT64)),
    'negation': lambda item, n: Unary(UnaryOperator.NEG, item),
    'minimum': lambda item, n: Binary(BinaryOperator.MIN, Constant(float(n), FLOAT64), item),
    'integers': lambda item, n: Binary(BinaryOperator.SUB, Constant(n, INT64), item),
    'remainders': lambda item, n: Binary(BinaryOperator.MOD, item, M),
    'choices': lambda item, n: Choice(P, item, D),
    'condition': lambda item, n: Binary(BinaryOperator.LT, Choice(item, D, Unary(
        UnaryOperator.NEG, D)), Constant(float(n), FLOAT64)),
}


@pytest.mark.parametrize('name', PROVOKING)
def test_no_expression_nests_deeper_than_32(name: str) -> None:
    leaf: Formula = D if name in ('sum', 'negation', 'minimum', 'choices') \
        else M if name in ('integers', 'remainders') else P
    for number in range(300):
        leaf = PROVOKING[name](leaf, number)
    if leaf.type is not ValueType.BOOL:
        zero = Constant(0 if leaf.type is INT64 else 0.0, leaf.type)
        leaf = Binary(BinaryOperator.LE, leaf, zero)
    made = assert_clean_and_right(specify([leaf, P]), steps=50, with_clang=False)
    assert max(nesting(text) for _, text in made.sources) <= 16


def test_long_chains_are_cut_and_do_not_nest() -> None:
    chain: Formula = P
    for number in range(500):
        chain = Binary(BinaryOperator.AND, chain, Once(Window(0, number + 1), Q))
    made = assert_clean_and_right(specify([chain]), steps=50)
    assert max(len(line) for _, text in made.sources for line in text.splitlines()) <= 200


def test_no_expression_of_random_c_nests_deeply(module: CModule) -> None:
    assert max(nesting(text) for _, text in (module.header, *module.sources)) <= 16


# -- symbols, loops and includes --------------------------------------------------------------


@pytest.fixture(scope='module')
def symbols(module: CModule, tmp_path_factory: pytest.TempPathFactory) -> list[tuple[str, str]]:
    """Compile to objects and return the kind (nm's letter) and name of each symbol."""
    folder = tmp_path_factory.mktemp('symbols')
    nm, compiler = shutil.which('nm'), gcc()
    if nm is None or compiler is None:
        pytest.skip('needs gcc and nm')
    found = []
    for source in write_module(module, folder):
        compile_c([*compiler, '-std=c99', '-O2', '-fno-pic', '-fno-stack-protector', f'-I{CSRC}',
                   f'-I{folder}', '-c', source, '-o', folder / 'out.o'])
        listed = subprocess.run([nm, folder / 'out.o'], capture_output=True, text=True, check=True)
        found += [(line.split()[-2], line.split()[-1]) for line in listed.stdout.splitlines()]
    return found


def test_there_are_no_mutable_globals(symbols: list[tuple[str, str]]) -> None:
    assert {kind for kind, _ in symbols} <= set('TtrRU')


def test_all_linker_symbols_have_the_prefix(
        module: CModule, symbols: list[tuple[str, str]]) -> None:
    for name in (name for kind, name in symbols if kind == 'T'):
        assert name.startswith(f'{module.name}_'), name


def test_it_calls_only_a_few_functions_of_the_c_library(symbols: list[tuple[str, str]]) -> None:
    ours = {name for kind, name in symbols if kind == 'T'}
    needed = {name for kind, name in symbols if kind == 'U'} - ours
    assert needed <= {'memset', 'fmodf', *LIBRARY, '_GLOBAL_OFFSET_TABLE_'}
    assert needed & {*LIBRARY, 'fmodf'}, 'the module has such calls'


def test_the_only_loops_are_over_rings_at_reset(module: CModule) -> None:
    for _, text in module.sources:
        code = re.sub(r'//[^\n]*', '', text)
        assert re.search(r'\b(while|goto|do|malloc|calloc|free|setjmp|alloca|switch)\b',
                         code) is None
        for step in re.findall(r'(?:_step|_body|_part_\d+)\([^;]*?\)\n\{.*?\n\}', code, re.DOTALL):
            assert 'for (' not in step


def test_no_function_calls_itself(module: CModule) -> None:
    for _, text in module.sources:
        for name, body in re.findall(r'void (\w+)\([^;{]*?\)\n\{(.*?)\n\}', text, re.DOTALL):
            assert f'{name}(' not in body


def test_only_our_headers_and_string_h_are_included_and_math_h_if_needed(module: CModule) -> None:
    for made, math_h, cells in ((module, ['<math.h>'], 'fret_windows.h'),
                                (c_module(specify([P])), [], 'fret_cells.h')):
        for _, text in made.sources:
            assert re.findall(r'#include (.*)', text) == [
                f'"{made.header[0]}"', *math_h, '<string.h>', f'"{cells}"']
        assert re.findall(r'#include (.*)', made.header[1]) == ['"fret_monitor.h"']


def test_lines_have_no_trailing_spaces(module: CModule) -> None:
    for _, text in (module.header, *module.sources):
        assert text.endswith(('}\n', '_H_\n'))
        assert not re.search(r'[ \t]\n|\t|\r', text)


# -- compilers and targets --------------------------------------------------------------------


@pytest.fixture(scope='module')
def levels() -> tuple[Specification, Trace, list[list[bool]]]:
    """Return random requirements, a trace, and the verdicts of C that is not optimised."""
    rng = Random(3)
    specification = specification_of(
        [random_property(rng, f'R-{number}', random_inputs(rng), size=25) for number in range(30)])
    trace = random_trace(rng, INPUTS, 400)
    return specification, trace, Compiled(specification, flags=(*FLAGS, '-O0')).run(trace)


@pytest.mark.parametrize('level', ['-O0', '-O1', '-O2', '-O3', '-Os'])
def test_every_level_of_optimisation_gives_the_same_verdicts(
        levels: tuple[Specification, Trace, list[list[bool]]], level: str) -> None:
    specification, trace, expected = levels
    if level != '-O0':
        assert Compiled(specification, flags=(*FLAGS, level)).run(trace) == expected
    if level in ('-O0', '-O3') and clang():
        assert Compiled(specification, compiler=clang(), flags=(*FLAGS, level)).run(trace) \
            == expected


@pytest.mark.parametrize('target', TARGETS)
def test_it_compiles_for_other_targets(module: CModule, target: str, tmp_path: Path) -> None:
    pytest.importorskip('ziglang')
    for source in write_module(module, tmp_path)[:1]:
        compile_c([ZIG, 'cc', '-target', target, *TARGETS[target], '-std=c99', '-O0',
                   '-fno-sanitize=all', *WARNINGS, f'-I{CSRC}', f'-I{tmp_path}', '-c', source,
                   '-o', tmp_path / 'out.o'])


def test_a_target_with_excess_precision_is_refused(module: CModule, tmp_path: Path) -> None:
    pytest.importorskip('ziglang')
    source = write_module(module, tmp_path)[0]
    done = subprocess.run(
        [ZIG, 'cc', '-target', 'x86-linux-musl', '-mcpu=i586', '-std=c99', f'-I{CSRC}',
         f'-I{tmp_path}', '-c', source, '-o', tmp_path / 'out.o'],
        capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert 'without excess precision' in done.stderr


CPP = """\
#include "random_monitor.h"

int main()
{
  random_inputs inputs = {};
  random_state state;
  bool verdicts[random_requirements];
  random_reset(&state);
  random_step(&state, &inputs, verdicts);
  return random_monitor()->n_requirements == sizeof(verdicts) ? 0 : 1;
}
"""


@pytest.mark.parametrize('standard', ['c++11', 'c++20'])
def test_cpp_includes_the_header_and_links(module: CModule, standard: str, tmp_path: Path) -> None:
    compiler, cpp = gcc(), shutil.which('g++')
    if compiler is None or cpp is None:
        pytest.skip('needs gcc and g++')
    objects = []
    for number, source in enumerate(write_module(module, tmp_path)):
        objects.append(tmp_path / f'{number}.o')
        compile_c([*compiler, '-std=c99', f'-I{CSRC}', f'-I{tmp_path}', '-c', source, '-o',
                   objects[-1]])
    (tmp_path / 'main.cpp').write_text(CPP)
    compile_c([cpp, f'-std={standard}', '-Wall', '-Wextra', '-Wpedantic', '-Werror', f'-I{CSRC}',
               f'-I{tmp_path}', tmp_path / 'main.cpp', *objects, '-lm', '-o', tmp_path / 'main'])
    subprocess.run([tmp_path / 'main'], check=True)


def test_many_monitors_run_in_one_process() -> None:
    # Two of one library and one of another library with the same names, stepped alternately.
    first = specify([Once(Window(0, 2), P), Once(Window(1, 9), P)])
    other = specify([Unary(UnaryOperator.NOT, Once(Window(0, 2), P)), Q])
    trace = {'p': [True, False, False, False] * 5, 'q': [False] * 20}
    alone = [Compiled(item).run(trace) for item in (first, other)]
    loaded = [Compiled(first), Compiled(other), Compiled(first)]
    assert [item.run(trace) for item in loaded] == [alone[0], alone[1], alone[0]]
    assert [item.run(trace) for item in reversed(loaded)] == [alone[0], alone[1], alone[0]]


def test_states_are_independent(module: CModule, tmp_path: Path) -> None:
    compiler = gcc()
    if compiler is None:
        pytest.skip('needs gcc')
    library = tmp_path / 'all.so'
    compile_c([*compiler, *FLAGS, '-shared', f'-I{CSRC}', f'-I{tmp_path}',
               *write_module(module, tmp_path), '-lm', '-o', library])
    loaded = ctypes.CDLL(str(library))
    states = [ctypes.create_string_buffer(1 << 16) for _ in range(3)]
    inputs, verdicts = ctypes.create_string_buffer(1 << 12), ctypes.create_string_buffer(64)
    for state in states:
        loaded.random_reset(state)
    before = states[1].raw
    for _ in range(5):
        loaded.random_step(states[0], inputs, verdicts)
    assert states[0].raw != before
    assert states[1].raw == before
    loaded.random_reset(states[0])
    assert states[0].raw == before


# -- numbers ----------------------------------------------------------------------------------


def value_in_c(shown: list[str], kind: str, folder: Path) -> list[str]:
    """Return the values of C literals: the bits of a float or a double, in hexadecimal."""
    compiler = gcc()
    if compiler is None:
        pytest.skip('needs gcc')
    lines = ['#include <math.h>', '#include <stdint.h>', '#include <stdio.h>',
             '#include <string.h>', f'static const {kind} values[] = {{',
             *(f'{item},' for item in shown), '};', 'int main(void) {',
             'for (unsigned i = 0; i < sizeof(values) / sizeof(*values);'
             ' ++i) {', 'unsigned long long bits = 0; memcpy(&bits, &values[i], sizeof(*values));',
             'printf("%llx\\n", bits);}', 'return 0;}']
    (folder / 'values.c').write_text('\n'.join(lines) + '\n')
    compile_c([*compiler, '-std=c99', *WARNINGS, folder / 'values.c', '-o', folder / 'values'])
    return subprocess.run([folder / 'values'], capture_output=True, text=True,
                          check=True).stdout.split()


@pytest.mark.parametrize(('kind', 'name', 'as_bits'), [
    (ValueType.FLOAT32, 'float', ctypes.c_float), (FLOAT64, 'double', ctypes.c_double),
    (INT64, 'int64_t', ctypes.c_int64), (ValueType.UINT64, 'uint64_t', ctypes.c_uint64)])
def test_a_literal_has_exactly_its_value(kind: ValueType, name: str, as_bits: type,
                                         tmp_path: Path) -> None:
    rng = Random(1)
    values = [value for value in all_values(kind) if value == value]
    if kind.is_float:
        values += [as_bits(rng.uniform(-1, 1) * 10.0 ** rng.randint(-50, 38)).value
                   for _ in range(3000)]
    expected = [f'{int.from_bytes(bytes(as_bits(value)), sys.byteorder):x}' for value in values]
    shown = [c.literal(value, kind).text for value in values]
    assert value_in_c(shown, name, tmp_path) == expected


@given(st.floats(width=32, allow_nan=False, allow_infinity=False))
def test_a_float32_is_printed_with_nine_digits_at_most(value: float) -> None:
    shown = c.literal(value, ValueType.FLOAT32).text
    digits = shown.removesuffix('f').split('e')[0].lstrip('-').replace('.', '')
    assert len(digits.strip('0')) <= 9
    assert ctypes.c_float(float(shown.removesuffix('f'))).value == value


@pytest.mark.parametrize(('kind', 'values'), [
    (ValueType.FLOAT32, (-0.0,)), (FLOAT64, (math.inf, -math.inf, math.nan, -0.0))])
def test_negative_zero_nan_and_infinities_may_be_constants(kind: ValueType,
                                                           values: tuple[float, ...]) -> None:
    number = Variable('x', kind)
    formulas: list[Formula] = [
        Binary(operator, number, Constant(value, kind))
        for value in values
        for operator in (BinaryOperator.LT, BinaryOperator.GE, BinaryOperator.EQ)]
    formulas += [Binary(BinaryOperator.LE, Binary(operator, Constant(value, kind), number), number)
                 for value in values
                 for operator in (BinaryOperator.SUB, BinaryOperator.MIN, BinaryOperator.DIV)]
    assert_clean_and_right(specify(formulas))


@pytest.mark.parametrize('kind', [item for item in ValueType if item.is_integer])
def test_limits_of_integers_are_compared_without_a_warning(kind: ValueType) -> None:
    number = as_term(Variable('x', kind), ValueType.UINT64 if kind is ValueType.UINT64 else INT64)
    low, high = kind.limits
    ends = {low - 1, low, low + 1, 0, high - 1, high, high + 1, *number.type.limits}
    least, greatest = number.type.limits
    formulas: list[Formula] = [
        Binary(operator, *pair)
        for end in sorted(ends) if least <= end <= greatest
        for operator in BinaryOperator if operator.is_relation
        for pair in ((number, Constant(end, number.type)), (Constant(end, number.type), number))]
    assert_clean_and_right(specify(formulas))
