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

"""Generated C has no warnings from gcc and clang, and no findings of the sanitizers."""

from dataclasses import replace
from fractions import Fraction
from itertools import product
from pathlib import Path
from random import Random
import shutil
import subprocess
from typing import Any

from differential.compiled import (
    c_module, clang, clang_check, compile_c, CSRC, gcc, HERE, SANITIZERS, WARNINGS, write_module,
)
from differential.test_over_time import comparisons, MESSAGE
from fret_monitor.build import build_specification
from fret_monitor.codegen.module import CModule
from fret_monitor.logic.formula import (
    Formula, Historically, Once, Since, Triggered, TRUE, Variable, Window,
)
from fret_monitor.model.policies import Policy
from fret_monitor.model.values import ValueType
import pytest
from strategies import (
    EXAMPLES, INPUTS, property_of, random_inputs, random_property, specification_of, thorough,
)

P, Q = Variable('p', ValueType.BOOL), Variable('q', ValueType.BOOL)
COMPILERS = {'gcc': gcc, 'clang': clang_check}
COUNT = 2 * EXAMPLES // 5  # of random requirements in one library


def every_window() -> list[Formula]:
    """Return each operator with windows that need each kind of cell and of delay line."""
    ends = [(0, None), (0, 0), (0, -1), (0, 200), (0, 300), (0, 70_000), (9, None), (300, None),
            (1, 1), (8, 8), (33, 33), (64, 64), (65, 65), (65, 300), (1000, 2000)]
    windows = [Window(low, high) for low, high in ends]
    return [formula for window in windows for formula in (
        Once(window, P), Historically(window, P), Since(window, P, Q), Triggered(window, P, Q))]


def far_windows() -> list[Formula]:
    """Return operators with windows of seconds to years, for ticks."""
    windows = [Window(low, high) for low, high in (
        (0, 2 ** 62), (2 ** 62, None), (2 ** 61, 2 ** 62), (10 ** 9, 10 ** 10), (1, 2 ** 62 - 1))]
    return [formula for window in windows for formula in (
        Once(window, P), Historically(window, P), Since(window, P, Q), Triggered(window, P, Q))]


def random_module(seed: int, count: int, size: int,
                  policy: Policy = Policy.EVERY_MESSAGE) -> CModule:
    """Return C for random formulas on all types of inputs; with seed 1 also for all windows."""
    rng = Random(seed)
    is_timed = policy is Policy.TIMED
    windows = [*every_window(), *(far_windows() if is_timed else ()),
               *comparisons(8, MESSAGE if is_timed else TRUE)] if seed == 1 else []
    properties = [property_of(f'W-{number}', item) for number, item in enumerate(windows)]
    properties += [random_property(rng, f'R-{number}', random_inputs(rng), size=size,
                                   loops=2 if number % 4 == 0 and not is_timed else 0)
                   for number in range(count)]
    made = specification_of(properties, INPUTS, policy)
    signals = tuple(replace(signal, max_rate=Fraction(10 ** 9)) for signal in made.signals)
    return c_module(replace(made, signals=signals) if is_timed else made)


@pytest.mark.parametrize(('standard', 'policy'), [
    ('c99', Policy.EVERY_MESSAGE), pytest.param('c11', Policy.EVERY_MESSAGE, marks=thorough),
    ('c99', Policy.TIMED)])
@pytest.mark.parametrize('name', COMPILERS)
def test_generated_c_compiles_without_a_warning(name: str, standard: str, policy: Policy,
                                                tmp_path: Path) -> None:
    compiler = COMPILERS[name]()
    if compiler is None:
        pytest.skip(f'needs {name}')
    sources = write_module(random_module(1, COUNT, 25, policy), tmp_path)
    # The warnings of gcc depend on its optimisations, those of clang do not. No expression nests
    # deeper than 32; clang checks this limit.
    extras = [('-O0', '-S', '-o', '/dev/null'), ('-O3', '-S', '-o', '/dev/null')] \
        if name == 'gcc' else [('-fbracket-depth=32',)]
    for source, extra in product(sources, extras):
        compile_c([*compiler, f'-std={standard}', *WARNINGS, *extra, f'-I{CSRC}',
                   f'-I{tmp_path}', source])


def drive(module: CModule, folder: Path, *command: str) -> str:
    """Compile the monitor with `drive.c` and run it; return what it printed."""
    program = folder / 'drive'
    sources = write_module(module, folder)
    compile_c([*command, '-std=c99', '-ffp-contract=off', f'-DMONITOR={module.symbol}',
               f'-I{CSRC}', f'-I{folder}', *sources, HERE / 'drive.c', '-lm', '-o', program])
    result = subprocess.run([program], capture_output=True, text=True, check=False, timeout=300)
    assert result.returncode == 0, result.stderr[-4000:]
    assert result.stderr == ''
    return result.stdout


def has_sanitizers(folder: Path) -> bool:
    """Return whether gcc can link and run a program with sanitizers here."""
    (folder / 'empty.c').write_text('int main(void) {return 0;}\n')
    found = gcc()
    if found is None:
        return False
    built = subprocess.run([*found, *SANITIZERS, folder / 'empty.c', '-o', folder / 'empty'],
                           capture_output=True, check=False)
    return built.returncode == 0 and subprocess.run(
        [folder / 'empty'], capture_output=True, check=False).returncode == 0


@pytest.mark.parametrize('policy', [Policy.EVERY_MESSAGE, Policy.TIMED])
@pytest.mark.parametrize(('seed', 'size'), [(1, 12), pytest.param(2, 40, marks=thorough)])
def test_no_value_causes_undefined_behaviour_in_generated_c(
        seed: int, size: int, policy: Policy, tmp_path: Path) -> None:
    if not has_sanitizers(tmp_path):
        pytest.skip('needs gcc with the address and undefined-behaviour sanitizers')
    module = random_module(seed, COUNT, size, policy)
    found: Any = gcc()
    digest = drive(module, tmp_path, *found, *SANITIZERS)
    assert digest == drive(module, tmp_path, *found, '-O3')
    if clang():
        assert digest == drive(module, tmp_path, *clang() or (), '-O2')


def test_the_sanitizers_detect_a_state_that_is_too_small(tmp_path: Path) -> None:
    if not has_sanitizers(tmp_path):
        pytest.skip('needs gcc with the address and undefined-behaviour sanitizers')
    module = random_module(1, 1, 4)
    found: Any = gcc()
    text = (HERE / 'drive.c').read_text().replace('monitor->state_bytes', '1')
    (tmp_path / 'small.c').write_text(text)
    compile_c([*found, *SANITIZERS, f'-DMONITOR={module.symbol}', f'-I{CSRC}', f'-I{tmp_path}',
               *write_module(module, tmp_path), tmp_path / 'small.c', '-lm', '-o',
               tmp_path / 'small'])
    result = subprocess.run([tmp_path / 'small'], capture_output=True, text=True, check=False)
    assert result.returncode != 0
    assert 'heap-buffer-overflow' in result.stderr


def test_the_library_exports_only_prefixed_names(tmp_path: Path) -> None:
    nm, found = shutil.which('nm'), gcc()
    if nm is None or found is None:
        pytest.skip('needs gcc and nm')
    module = random_module(1, 40, 10)
    compile_c([*found, '-std=c99', '-fPIC', '-shared', '-fvisibility=hidden', f'-I{CSRC}',
               f'-I{tmp_path}', *write_module(module, tmp_path), '-lm', '-o',
               tmp_path / 'monitor.so'])
    listed = subprocess.run([nm, '-D', '--defined-only', tmp_path / 'monitor.so'],
                            capture_output=True, text=True, check=True)
    names = [line.split()[-1] for line in listed.stdout.splitlines()]
    assert module.symbol in names
    assert all(name.startswith(f'{module.name}_') for name in names)


def test_no_text_of_a_bundle_reaches_c_unescaped(tmp_path: Path) -> None:
    texts = ['"', "a'b", 'back\\slash\\', 'end\\', '*/ int x; /*', '// \\', '??/', '??=??>', '%s',
             'tab\tnewline\nreturn\r', '\x01\x7f', 'Höhe', '高度', '\U0001f681', 'int', '__LINE__',
             '$(x)', '@SOURCE-HASH@', 'a' * 500]
    # A bundle refuses ids with the same handler: the number keeps these apart.
    properties = [replace(property_of(f'{text} {number}', formula), title=text)
                  for number, (text, formula) in enumerate(zip(texts, every_window()))]
    specification = replace(specification_of(properties, (P, Q)), component='"*/\\')
    # Loading compares the ids in C with those of the manifest.
    assert len(build_specification(specification).monitor.manifest.requirements) == len(texts)
    module = c_module(specification)
    sources = write_module(module, tmp_path)
    for name, compiler in COMPILERS.items():
        found = compiler()
        if found is None:
            pytest.skip(f'needs {name}')
        output = () if compiler is clang_check else ('-c', '-o', tmp_path / 'out.o')
        for source in sources:
            compile_c([*found, '-std=c99', *WARNINGS, f'-I{CSRC}', f'-I{tmp_path}', source,
                       *output])


def test_the_same_specification_gives_the_same_bytes() -> None:
    assert random_module(5, 30, 20) == random_module(5, 30, 20)
