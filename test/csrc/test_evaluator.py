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
The evaluator in C: scenarios, a model, sanitizers, and two compilers without warnings.

The programs are `evaluator_scenarios.c` and `evaluator_model.c` beside this file.
"""

from functools import cache
from pathlib import Path
import re
import shutil
import subprocess
import sys

from fret_monitor.native import csrc_directory
import pytest

HERE = Path(__file__).resolve().parent
SCENARIOS = re.findall(
    r'SCENARIO\((\w+)\),', (HERE / 'evaluator_scenarios.c').read_text(encoding='utf-8'))
WARNINGS = ('-Wall', '-Wextra', '-Wpedantic', '-Wconversion', '-Wshadow', '-Wswitch-enum',
            '-Werror')
SANITIZERS = ('-g', '-fsanitize=address,undefined', '-fno-sanitize-recover=all')
PROGRAMS = ('evaluator_scenarios', 'evaluator_model')


@cache
def gcc() -> tuple[str, ...]:
    """Return the command of gcc, or skip the test."""
    found = shutil.which('gcc')
    if found is None:
        pytest.skip('no gcc')
    return (found,)


@cache
def clang() -> tuple[str, ...]:
    """Return the command of clang, installed or inside ziglang, or skip the test."""
    found = shutil.which('clang')
    if found:
        return (found,)
    pytest.importorskip('ziglang')
    return (sys.executable, '-m', 'ziglang', 'cc')


def run(*command: object) -> 'subprocess.CompletedProcess[str]':
    return subprocess.run(
        [str(word) for word in command], text=True, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, check=False)


@pytest.fixture(scope='session')
def programs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build both programs with the sanitizers, where the compiler has them."""
    folder = tmp_path_factory.mktemp('programs')
    for program in PROGRAMS:
        command = (*gcc(), '-std=c99', '-O1', f'-I{csrc_directory()}', *WARNINGS,
                   csrc_directory() / 'evaluator.c', HERE / f'{program}.c',
                   '-o', folder / program)
        if run(*command, *SANITIZERS).returncode != 0:
            built = run(*command)
            assert built.returncode == 0, built.stdout
    return folder


@pytest.mark.parametrize('scenario', SCENARIOS)
def test_scenario(programs: Path, scenario: str) -> None:
    done = run(programs / 'evaluator_scenarios', scenario)
    assert done.returncode == 0, done.stdout


def test_every_scenario_of_the_program_is_run(programs: Path) -> None:
    assert run(programs / 'evaluator_scenarios').stdout.split() == SCENARIOS
    assert len(SCENARIOS) > 30


@pytest.mark.parametrize('seed', range(4))
def test_random_calls_have_the_effects_of_the_model(programs: Path, seed: int) -> None:
    done = run(programs / 'evaluator_model', seed, 2000)
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize('standard', ['c99', 'c11'])
@pytest.mark.parametrize('level', ['-O0', '-O1', '-O2', '-O3'])
def test_it_compiles_with_gcc_without_warnings(tmp_path: Path, standard: str, level: str) -> None:
    done = run(*gcc(), f'-std={standard}', level, *WARNINGS, '-c',
               csrc_directory() / 'evaluator.c', '-o', tmp_path / 'evaluator.o')
    assert (done.returncode, done.stdout) == (0, '')


@pytest.mark.parametrize('standard', ['c99', 'c11'])
def test_it_compiles_with_clang_without_warnings(tmp_path: Path, standard: str) -> None:
    for file in (csrc_directory() / 'evaluator.c', *(HERE / f'{name}.c' for name in PROGRAMS)):
        done = run(*clang(), f'-std={standard}', '-O2', f'-I{csrc_directory()}', *WARNINGS, '-c',
                   file, '-o', tmp_path / 'object.o')
        assert (done.returncode, done.stdout) == (0, '')


@pytest.mark.parametrize('header', ['fret_monitor.h', 'evaluator.h'])
@pytest.mark.parametrize('language', ['c', 'c++'])
def test_a_header_compiles_alone_in_c_and_cpp(header: str, language: str) -> None:
    command = gcc() if language == 'c' else (shutil.which('g++') or 'g++',)
    if shutil.which(command[0]) is None:
        pytest.skip(f'no {command[0]}')
    done = run(*command, '-Wall', '-Wextra', '-fsyntax-only', '-x', language,
               csrc_directory() / header)
    assert (done.returncode, done.stdout) == (0, '')


def test_only_declared_symbols_are_defined(tmp_path: Path) -> None:
    nm = shutil.which('nm')
    if nm is None:
        pytest.skip('no nm')
    run(*gcc(), '-std=c99', '-c', csrc_directory() / 'evaluator.c', '-o', tmp_path / 'e.o')
    lines = run(nm, '--defined-only', '--extern-only', tmp_path / 'e.o').stdout.splitlines()
    declared = re.findall(
        r'(fm_evaluator_\w+)\(', (csrc_directory() / 'evaluator.h').read_text(encoding='utf-8'))
    assert {line.split()[-1] for line in lines} == set(declared)
