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

"""The C of target `copilot` beside the C that Copilot itself generates from the same formulas."""

from dataclasses import dataclass
from pathlib import Path
import shutil
import subprocess

from bench.peers import copilot_version
from differential.compiled import compile_c, gcc
from export.copilot_program import is_translatable, program
from fret.test_shared_data import templates
from fret_monitor.build import generate_monitor, GeneratedMonitor, read
from fret_monitor.export.content import HandlerArguments, Options
from fret_monitor.export.copilot import copilot
from fret_monitor.export.folder import assemble
import pytest

HERE = Path(__file__).resolve().parent
ROWS = '1000000'
OWN = {
    'FAST': 'x > 1.5 -> n < 5',
    'EDGE': 'H[0,2] (x >= 2.25) & Y (n = 3) -> O[0,4] r',
    'LONG': 'persisted(6, c) -> r',
}

if copilot_version() is None:
    pytest.skip('needs GHC and Copilot (apt install ghc libghc-copilot-dev)',
                allow_module_level=True)


def bundle(folder: Path) -> Path:
    """Write a bundle of all of FRET's templates; S among them."""
    lines = ['format: 1', 'inputs:', *(f'  {name}: {{type: bool}}' for name in 'mcrs'),
             '  x: {type: float32}', '  n: {type: int16}', 'requirements:']
    formulas = {**OWN, **{f'K-{number}': smv
                          for number, (smv, _) in enumerate(templates().values())}}
    lines += [f"  - {{id: {name}, ptltl: '{text}'}}" for name, text in formulas.items()]
    path = folder / 'keys.yaml'
    path.write_text('\n'.join(lines) + '\n')
    return path


def without_since(path: Path) -> GeneratedMonitor:
    """Return the monitors of the requirements without S."""
    items = read(path).specification.properties
    kept = {item.id for item in items if is_translatable([item.formula])}
    lines = path.read_text().splitlines()
    path.write_text('\n'.join(line for line in lines if not line.startswith('  - ')
                              or line.split()[2].rstrip(',') in kept) + '\n')
    return generate_monitor(read(path))


@dataclass(frozen=True)
class Both:
    """Two folders with `keys.c` and `keys.h`: ours, and that of Copilot."""

    generated: GeneratedMonitor
    ours: Path
    theirs: Path


@pytest.fixture(scope='module')
def both(tmp_path_factory: pytest.TempPathFactory) -> Both:
    """Generate the same requirements twice."""
    folder = tmp_path_factory.mktemp('copilot')
    generated = without_since(bundle(folder))
    ours, theirs = folder / 'ours', folder / 'theirs'
    options = Options(handler_arguments=HandlerArguments.VALUES)
    for name, text in assemble('copilot', generated, options,
                               copilot(generated, options)).items():
        (ours / name).parent.mkdir(parents=True, exist_ok=True)
        (ours / name).write_text(text)
    theirs.mkdir()
    formulas = [item.formula for item in generated.specification.properties]
    (theirs / 'Main.hs').write_text(program('keys', generated.manifest, formulas))
    subprocess.run(['ghc', '-v0', '-O0', '-o', 'main', 'Main.hs'], cwd=theirs, check=True)
    subprocess.run([theirs / 'main'], cwd=theirs, check=True)
    (folder / 'handlers.inc').write_text('\n'.join(handlers(generated)) + '\n')
    shutil.copy(HERE / 'copilot_main.c', folder)
    return Both(generated, ours, theirs)


def handlers(generated: GeneratedMonitor) -> list[str]:
    """Return the handlers in C, which report their arguments."""
    inputs = generated.manifest.inputs
    return [f'void {item.handler}('
            + ', '.join(f'{inputs[index].value_type.c_name} {inputs[index].name}_value'
                        for index in item.inputs)
            + f') {{called({number}u); '
            + ' '.join(f'mix({inputs[index].name}_value);' for index in item.inputs) + '}'
            for number, item in enumerate(generated.manifest.requirements)]


def calls(both: Both, folder: Path) -> str:
    """Return what the program prints with the C of a folder."""
    compiler = gcc()
    assert compiler is not None
    program = folder / 'program'
    compile_c([*compiler, '-std=c99', '-O1', '-w', f'-I{folder}', folder.parent / 'copilot_main.c',
               folder / 'keys.c', '-lm', '-o', program])
    return subprocess.run([program, ROWS], check=True, capture_output=True, text=True).stdout


def test_one_program_sees_the_same_calls_with_both(both: Both) -> None:
    assert len(both.generated.manifest.requirements) > 90
    ours = calls(both, both.ours)
    assert ours == calls(both, both.theirs)
    assert int(ours.split()[0]) > 1_000_000
