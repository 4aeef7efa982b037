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
The evaluator in C: scenarios, a model, limits, sanitizers, and two compilers without warnings.

The programs are `evaluator_scenarios.c`, `evaluator_model.c` and `evaluator_edges.c` beside this
file.
"""

from collections.abc import Sequence
from pathlib import Path
import re
import shutil
import subprocess

from bench import instances
from differential import compiled
from differential.compiled import WARNINGS
from fret_monitor.native import csrc_file, csrc_includes
import objects
import pytest
from strategies import EXAMPLES, some, thorough

HERE = Path(__file__).resolve().parent
SCENARIOS = [(program, name) for program in ('evaluator_scenarios', 'timed_scenarios')
             for name in re.findall(r'(?m)^SCENARIO\((\w+)\)$',
                                    (HERE / f'{program}.c').read_text(encoding='utf-8'))]
SANITIZERS = (*compiled.SANITIZERS, '-O1')  # these programs are small and run long
SCOPES = ('keys', 'pairs', 'heap', 'aggregates', 'pool', 'scopes_steps', 'scopes_due',
          'scopes_making', 'scopes')
SOURCES = ('evaluator', 'deadlines', 'gate', 'measures', 'steps', 'due', 'tables', 'instance',
           *SCOPES)
PROGRAMS = ('evaluator_scenarios', 'timed_scenarios', 'evaluator_model', 'scopes_model',
            'scopes_lives')
EDGES = 'evaluator_edges'  # includes tables.h


def gcc() -> tuple[str, ...]:
    """Return the command of gcc, or skip the test."""
    return compiled.gcc() or pytest.skip('no gcc')


def run(*command: object, folder: Path | None = None) -> 'subprocess.CompletedProcess[str]':
    return subprocess.run(
        [str(word) for word in command], text=True, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, check=False, cwd=folder)


def compile_all(folder: Path, compiler: tuple[str, ...], files: Sequence[Path],
                *flags: str) -> 'subprocess.CompletedProcess[str]':
    """Compile files to objects in a folder, with one command."""
    return run(*compiler, *csrc_includes(), *WARNINGS, *flags, '-c', *files, folder=folder)


def sources() -> list[Path]:
    return [csrc_file(f'{name}.c') for name in SOURCES]


def programs_in_c() -> list[Path]:
    return [HERE / f'{name}.c' for name in (*PROGRAMS, EDGES)]


def build(folder: Path, *flags: str) -> 'subprocess.CompletedProcess[str]':
    """Build all programs in a folder; return the first command that fails, or the last one."""
    done = compile_all(folder, gcc(), sources() + programs_in_c(), '-std=c99', *flags)
    for program in (*PROGRAMS, EDGES):
        if done.returncode == 0:
            made = [folder / f'{name}.o' for name in (*SOURCES, program)]
            done = run(*gcc(), *flags, *made, '-o', folder / program)
    return done


@pytest.fixture(scope='session')
def programs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the programs with the sanitizers, where the compiler has them."""
    folder = tmp_path_factory.mktemp('programs')
    if build(folder, *SANITIZERS).returncode != 0:
        built = build(folder)
        assert built.returncode == 0, built.stdout
    return folder


@pytest.mark.parametrize(('program', 'scenario'), SCENARIOS)
def test_scenario(programs: Path, program: str, scenario: str) -> None:
    done = run(programs / program, scenario)
    assert done.returncode == 0, done.stdout


def test_every_scenario_of_the_program_is_run(programs: Path) -> None:
    assert [(program, name) for program in ('evaluator_scenarios', 'timed_scenarios')
            for name in run(programs / program, 'list').stdout.split()] == SCENARIOS
    assert len(SCENARIOS) > 30


@pytest.mark.parametrize('seed', some(range(4), 2))
def test_random_calls_have_the_effects_of_the_model(programs: Path, seed: int) -> None:
    done = run(programs / 'evaluator_model', seed, 20 * EXAMPLES)
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize('seed', some(range(4), 2))
def test_instances_are_plain_evaluators_of_what_concerns_their_keys(
        programs: Path, seed: int) -> None:
    done = run(programs / 'scopes_model', seed, 8 * EXAMPLES)
    assert done.returncode == 0, done.stdout


def test_a_million_lives_need_no_more_memory_keys_may_collide_and_pairs_are_found(
        programs: Path) -> None:
    done = run(programs / 'scopes_lives')
    assert (done.returncode, done.stdout) == (0, '')


def test_counters_and_times_hold_at_their_limits(programs: Path) -> None:
    # At a thousand messages a second, a node counts past 2^32 after fifty days.
    done = run(programs / EDGES)
    assert (done.returncode, done.stdout) == (0, '')


@thorough
def test_the_benchmark_of_instances_compiles(tmp_path: Path) -> None:
    gcc()
    assert instances.compiled(tmp_path).is_file()


# That the sources compile without a warning is tested in test_engine.
def test_the_programs_compile_with_clang_without_warnings() -> None:
    clang = compiled.clang_check() or pytest.skip('no clang')
    done = run(*clang, '-std=c99', *csrc_includes(), *WARNINGS, *programs_in_c())
    assert (done.returncode, done.stdout) == (0, '')


@pytest.mark.parametrize('header', [
    'fret_monitor.h', 'fret_cells.h', 'fret_cdr.h', 'evaluator.h', 'gate.h', 'instance.h',
    'tables.h', 'steps.h', 'due.h', 'keys.h', 'pairs.h', 'heap.h', 'kinds.h', 'aggregates.h',
    'pool.h', 'scopes.h'])
@pytest.mark.parametrize('language', ['c', 'c++'])
def test_a_header_compiles_before_others_in_c_and_cpp(
        header: str, language: str, tmp_path: Path) -> None:
    command = gcc() if language == 'c' else (shutil.which('g++') or 'g++',)
    if shutil.which(command[0]) is None:
        pytest.skip(f'no {command[0]}')
    source = tmp_path / 'main'
    source.write_text(f'#include "{header}"\n#include <math.h>\n', encoding='utf-8')
    done = run(*command, '-Wall', '-Wextra', '-fsyntax-only', *csrc_includes(), '-x', language,
               source)
    assert (done.returncode, done.stdout) == (0, '')


def test_only_declared_symbols_are_defined() -> None:
    nm = shutil.which('nm')
    if nm is None:
        pytest.skip('no nm')
    made = objects.engine(compiled.SANITIZERS)  # which other tests use, too
    lines = run(nm, '--defined-only', '--extern-only', *(
        made[source] for source in sources())).stdout.splitlines()
    headers = [csrc_file(f'{name}.h').read_text(encoding='utf-8')
               for name in (*SOURCES, 'scopes_parts')
               if name not in ('deadlines', 'scopes_steps', 'scopes_due', 'scopes_making')]
    text = re.sub(r'\bFM_INLINE \w+ \w+\(', '', '\n'.join(headers))
    declared = re.findall(r'\b(fm_\w+)\(', text)
    assert {line.split()[-1] for line in lines if ' T ' in line} == set(declared)
