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
The cells and arithmetic that generated C uses, against their definitions.

The program is `cells.c` beside this file; it runs under two compilers, both standards, all levels
of optimization, and the sanitizers.
"""

from pathlib import Path
import re
import shutil

from csrc.test_evaluator import gcc, run, SANITIZERS
from differential import compiled
from differential.compiled import WARNINGS
from fret_monitor.model.values import ValueType
from fret_monitor.native import csrc_directory, csrc_includes
from fret_monitor.program.layout import FieldKind, lay_out
from fret_monitor.program.monitor_program import (
    AlwaysWithin, Equation, OnceWithin, Operand, Read, StepGroup,
)
import pytest
from strategies import some, thorough

HERE = Path(__file__).resolve().parent


def clang() -> tuple[str, ...]:
    """Return the command of clang, installed or inside ziglang, or skip the test."""
    return compiled.clang() or pytest.skip('no clang')


COMPILERS = {'gcc': gcc, 'clang': clang}
CHECKS = re.findall(r'NAMED\((\w+)\),', (HERE / 'cells.c').read_text(encoding='utf-8'))
BITS = {ValueType.UINT8: 8, ValueType.UINT16: 16, ValueType.UINT32: 32}
CELLS: dict[str, type[OnceWithin] | type[AlwaysWithin]] = {
    'once': OnceWithin, 'always': AlwaysWithin}


def build(folder: Path, *command: str, source: str = 'cells.c') -> Path:
    """Compile a program; a warning fails the test."""
    program = folder / source.removesuffix('.c')
    done = run(*command, *csrc_includes(), *WARNINGS, HERE / source, '-o', program, '-lm')
    assert (done.returncode, done.stdout) == (0, '')
    return program


def with_slip(folder: Path, name: str, level: str, right: str, wrong: str) -> Path:
    """Compile a program with a mistake in the header: `wrong` in place of `right`."""
    for file in csrc_directory().glob('generated/*.h'):
        shutil.copy(file, folder)
    header = folder / 'fret_cells.h'
    text = header.read_text(encoding='utf-8')
    assert right in text
    header.write_text(text.replace(right, wrong), encoding='utf-8')
    built = run(*gcc(), '-std=c99', level, f'-I{folder}', HERE / f'{name}.c', '-o',
                folder / name, '-lm')
    assert built.returncode == 0, built.stdout
    return folder / name


@pytest.fixture(scope='session')
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the program with the sanitizers, where the compiler has them."""
    folder = tmp_path_factory.mktemp('cells')
    (folder / 'empty.c').write_text('int main(void) {return 0;}\n', encoding='utf-8')
    probe = run(*gcc(), *SANITIZERS, folder / 'empty.c', '-o', folder / 'empty')
    return build(folder, *gcc(), '-std=c99', *(SANITIZERS if probe.returncode == 0 else ()))


@pytest.mark.parametrize('check', CHECKS)
def test_check(program: Path, check: str) -> None:
    done = run(program, check)
    assert (done.returncode, done.stdout) == (0, '')


def test_every_check_of_the_program_is_run(program: Path) -> None:
    assert run(program).stdout.split() == CHECKS
    assert len(CHECKS) > 20


@pytest.mark.parametrize(('name', 'standard', 'level'), [
    ('gcc', 'c99', '-O0'), pytest.param('gcc', 'c11', '-O3', marks=thorough),
    ('clang', 'c99', '-O2')])
def test_every_check_holds_without_a_warning(
    tmp_path: Path, name: str, standard: str, level: str,
) -> None:
    done = run(build(tmp_path, *COMPILERS[name](), f'-std={standard}', level), 'all')
    assert (done.returncode, done.stdout) == (0, '')


def started(name: str, bound: int, head: int) -> list[int | str]:
    """Return arguments of `cells start`: the layout's counter for a cell, and its first value."""
    reads = Equation(Read(0), ValueType.BOOL, None)
    cell = Equation(CELLS[name](bound, Operand(0), head), ValueType.BOOL, None)
    layout = lay_out(StepGroup((0,), (0,), (reads, cell), (0,), (Operand(1),), ()))
    field = layout.field_of[FieldKind.COUNTER, 1]
    return [name, BITS[field.type], bound, head, int(field.initial)]


def test_counters_start_where_the_layout_says(program: Path) -> None:
    bounds = (1, 2, 9, 10, 253, 254, 255, 256, 65533, 65534, 65535, 65536, 2 ** 31 - 1)
    words = [word for name in CELLS for bound in bounds
             for head in sorted({0, 1, 2, bound // 2, bound - 1, bound, bound + 1})
             for word in started(name, bound, head)]
    done = run(program, 'start', *words)
    assert (done.returncode, done.stdout) == (0, '')
    assert {words[k] for k in range(1, len(words), 5)} == {8, 16, 32}


def test_a_wrong_first_value_of_a_counter_is_detected(program: Path) -> None:
    right = started('once', 10, 4)
    assert run(program, 'start', *right).returncode == 0
    done = run(program, 'start', *right[:-1], int(right[-1]) - 1)
    assert done.returncode == 1
    assert 'once_within_u8, bound 10, head 4' in done.stdout


@pytest.mark.parametrize(('name', 'flags'), [
    ('gcc', SANITIZERS), pytest.param('gcc', ('-O3',), marks=thorough), ('clang', ('-O2',))])
def test_cells_at_ticks_equal_the_operators_at_every_tick(
    tmp_path: Path, name: str, flags: tuple[str, ...],
) -> None:
    done = run(build(tmp_path, *COMPILERS[name](), '-std=c99', *flags, source='cells_at.c'))
    assert (done.returncode, done.stdout) == (0, '')


SLIPS_AT_TICKS = {
    'a window one tick longer': ('tick - 1 + bound, *last);\n  *last = fm_choice(p',
                                 'tick + bound, *last);\n  *last = fm_choice(p'),
    'a since that p cannot end': ('fm_choice(p, before, -1)', 'before'),
    'an event that lasts, forgotten': ('*last = fm_choice(q, FM_NEVER, kept)',
                                       '*last = fm_choice(q, tick, kept)'),
    'a deadline one tick late': ('fm_lower(next, out & !p, kept + 1)',
                                 'fm_lower(next, out & !p, kept + 2)'),
    'no deadline': ('fm_lower(next, p & (begun > tick), begun);', ''),
    'an oldest q that stands still': ('FM_NEVER - (int64_t)q', 'fm_choice(q, begun, FM_NEVER)'),
    'a queue that p cannot empty': ('queue[1] = p ? queue[1] : 0;', ''),
    'results merged over a gap': ('newest[1] >= tick + low - 1', 'newest[1] >= tick + low - 2'),
    'results that touch kept apart': ('newest[1] >= tick + low - 1', 'newest[1] >= tick + low'),
    'an interval that is never dropped': ('oldest[1] < tick', 'oldest[1] < 0'),
    'no note of what was dropped': ('queue[2] = fm_interval(queue, capacity, 0)[1];', ''),
    'zeros of two signs': ('x = {a}, y = {b};\n  return x.bits == y.bits',
                           'x = {a}, y = {b};\n  return x.number == y.number'),
}


@pytest.mark.parametrize('slip', some([*SLIPS_AT_TICKS], 4))
def test_a_mistake_in_a_cell_at_ticks_is_detected(tmp_path: Path, slip: str) -> None:
    assert run(with_slip(tmp_path, 'cells_at', '-O1', *SLIPS_AT_TICKS[slip])).returncode == 1


BORDERS = 'counters_are_right_at_the_borders_of_their_types'
# Some mistakes: a check that detects it, the text of the header, and its replacement.
SLIPS = {
    'a bound one less': (BORDERS, 'return age <= bound', 'return age < bound'),
    'a since that p cannot end': (BORDERS, '*next | fm_ones_if_ ## suffix(!p)', '*next'),
    'a counter that overflows': (BORDERS, '((before != 0u) | p) & (before <= bound)',
                                 '(before != 0u) | p'),
    'a counter too narrow': (BORDERS, 'FM_COUNTER_CELLS(u32, uint32_t)',
                             'FM_COUNTER_CELLS(u32, uint16_t)'),
    'a ring that cannot forget': ('rings_give_what_was_put_in_so_many_steps_ago',
                                  '*byte & ~(1u << k)', '*byte'),
    'a quotient that is not wrapped': ('signed_division_truncates_and_is_0_by_0',
                                       'b == -1 ? fm_neg_i64(a) : a / b', 'b == -1 ? a : a / b'),
    'a comparison of bits': ('numbers_compare_by_value_whatever_their_signs',
                             'return a < 0 || (uint64_t)a < b', 'return (uint64_t)a < b'),
    'a minimum that prefers the second': ('functions_of_floats_have_the_words_of_the_manual',
                                          'return a <= b ? a : b', 'return a < b ? a : b'),
}


@pytest.mark.parametrize('slip', some([*SLIPS], 3))
def test_a_mistake_in_the_header_is_detected(tmp_path: Path, slip: str) -> None:
    check, right, wrong = SLIPS[slip]
    done = run(with_slip(tmp_path, 'cells', '-O0', right, wrong), check)
    assert done.returncode == 1
    assert 'not so' in done.stdout


def test_windows_of_numbers_are_right_for_all_values_and_traces_up_to_a_size(
        tmp_path: Path) -> None:
    done = run(build(tmp_path, *gcc(), '-std=c99', '-O2', source='windows.c'))
    assert (done.returncode, done.stdout) == (0, '')
