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

"""Target `c99`: it builds without this package, and its test program gives our verdicts."""

from dataclasses import dataclass
from pathlib import Path
import re
import shutil
import subprocess

from differential.compiled import clang, compile_c, gcc, SANITIZERS, WARNINGS
from differential.test_clean_c import has_sanitizers
from fret_monitor.build import build, generate_monitor, read
from fret_monitor.export.c99 import c99
from fret_monitor.export.content import Options
from fret_monitor.export.examples import example
from fret_monitor.export.folder import assemble, renamed, write_export
from fret_monitor.traces.simulate import simulate
import pytest

STEPS = """\
format: 1
inputs:
  p: {type: bool}
  "\\"x, y\\"": {type: float32}
  n: {type: uint64}
  d: {type: float64}
  word: {topic: state, type: std_msgs/msg/String, values: {stopped: halt, moving: "*/ ??/"}}
requirements:
  - {id: 'R"1', title: "*/ #error ??/", ptltl: 'p -> O[0,2] "x, y" > 0.1'}
  - {id: "R,2", ptltl: "H[3,5] (d >= 2.5) -> sqrt(d) < 1.6 & n > 9223372036854775808"}
  - {id: R-3, ptltl: "word = moving -> Y p"}
"""
TIMED = """\
format: 1
inputs:
  p: {type: bool}
  mode: {type: int8, values: {IDLE: 0, LANDING: -7}}
evaluation: {policy: timed}
requirements:
  - {id: R-1, ptltl: "p -> O[0, 2.5 s] mode = LANDING"}
  - {id: R-2, ptltl: "H[1 s, 3 s] p -> mode >= IDLE"}
"""
ROW = 'p,"x, y",n,d,word'
WRONG = {
    'steps': [
        ('', 'line 1: the trace is empty'),
        (f'{ROW.replace(",d", "")}\n', "'d': line 1: the heading has no such column"),
        (f'{ROW},p\n', "'p': line 1: the heading has two such columns"),
        (f'{ROW}\n1,1,1,1,moving\nabc,1,1,1,moving\n',
         'line 3, column 1: a bool is 0, 1, false or true'),
        (f'{ROW}\n1,1,99999999999999999999,1,moving\n',
         'line 2, column 3: a number does not fit the type of its input'),
        (f'{ROW}\n1,1,-1,1,moving\n',
         'line 2, column 3: a number does not fit the type of its input'),
        *((f'{ROW}\n1,1,1,{cell},moving\n', 'line 2, column 4: a cell is no decimal number')
          for cell in ('x', '', '0x1p-3', 'infinity', '1e', '.', '1 2')),
        *((f'{ROW}\n1,1,{cell},1,moving\n',
           'line 2, column 3: a cell is no whole decimal number') for cell in ('0x1', '1.0', '')),
    ],
    'timed': [
        ('p,mode\n', "'time': line 1: the heading has no such column"),
        ('p,mode,time\n1,IDLE,1\n1,200,2\n',
         'line 3, column 2: a number does not fit the type of its input'),
        ('p,mode,time\n1,IDLE,1\n1,IDLE,0.5\n',
         'line 3, column 3: a time is not after that of the row before'),
        ('p,mode,time\n1,IDLE,x\n',
         'line 2, column 3: a time is a number of seconds with at most nine digits behind the '
         'point'),
    ],
}
SAME = {  # rows that `simulate` takes too
    'steps': f'\ufeff{ROW}\nTrue, 1 ,-0,+1.5e+0,moving\nFALSE,-INF,18446744073709551615,.5,'
             'stopped\n1,NaN,+9,2.,moving\n',
    'timed': '\ufeffp,mode,time\n1,IDLE, +1.5 \n true\t,LANDING,4\nFalse,-128,5.250\n',
}
LIBRARY = {'memcmp', 'memcpy', 'memset', 'sqrt'}


@dataclass(frozen=True)
class Export:
    """The folder of an export, and the objects of its sources."""

    name: str
    bundle: Path
    folder: Path
    objects: list[Path]


@pytest.fixture(scope='module', params=['steps', 'timed'])
def export(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Export:
    """Export a bundle, and compile each source as C that stands alone."""
    compiler = gcc()
    if compiler is None:
        pytest.skip('needs gcc')
    folder = tmp_path_factory.mktemp('c99')
    bundle = folder / f'{request.param}.yaml'
    bundle.write_text(STEPS if request.param == 'steps' else TIMED)
    generated = generate_monitor(read(bundle))
    files = assemble('c99', generated, Options(), c99(generated, Options()))
    write_export(folder / 'out', files)
    objects = []
    for source in sorted((folder / 'out' / 'src').glob('*.c')):
        objects.append(folder / f'{source.stem}.o')
        compile_c([*compiler, '-std=c99', '-O2', '-ffreestanding', '-ffp-contract=off', *WARNINGS,
                   '-c', source, '-o', objects[-1]])
    return Export(request.param, bundle, folder / 'out', objects)


def test_the_objects_need_no_heap_and_no_more_than_they_say(export: Export) -> None:
    nm = shutil.which('nm')
    if nm is None:
        pytest.skip('needs nm')
    listed = subprocess.run([nm, *export.objects], check=True, capture_output=True, text=True)
    words = [line.split() for line in listed.stdout.splitlines() if line.startswith(' ')
             or line[:1].isalnum() and ' ' in line]
    needed = {word[-1] for word in words if word[-2:-1] == ['U']}
    defined = {word[-1] for word in words if word[-2] in 'TDBR'}
    assert 'fm_evaluator_init' in defined and f'{export.name}_monitor' in defined
    assert needed - defined - LIBRARY == set()
    assert all(word.startswith(('fm_', f'{export.name}_')) for word in defined)


def test_the_test_program_gives_the_verdicts_of_simulate(export: Export, tmp_path: Path) -> None:
    compiler = gcc()
    assert compiler is not None
    program, test = tmp_path / 'program', export.folder / 'test'
    sanitizers = SANITIZERS if has_sanitizers(tmp_path) else ()
    compile_c([*compiler, '-std=c99', *sanitizers, *WARNINGS, f'-I{export.folder}/src',
               test / 'test.c', export.folder / 'src' / f'{export.name}_monitor.c', '-lm', '-o',
               program])
    simulate(build(export.bundle).monitor, test / 'trace.csv', tmp_path / 'verdicts.csv')
    expected = (tmp_path / 'verdicts.csv').read_text()
    assert (test / 'verdicts.csv').read_text() == expected
    with (test / 'trace.csv').open() as trace:
        printed = subprocess.run([program], stdin=trace, check=True, capture_output=True,
                                 text=True).stdout
    assert printed == expected
    _, *columns = zip(*(line.split(',') for line in expected.splitlines()[1:]))
    assert all({*column} == {'0', '1'} for column in columns)
    compared = subprocess.run([program, test / 'trace.csv', test / 'verdicts.csv'], check=False)
    assert compared.returncode == 0
    for wrong in (expected.replace(',1', ',0', 1), expected + '9,1,1\n', expected[:-20]):
        (tmp_path / 'verdicts.csv').write_text(wrong)
        failed = subprocess.run([program, test / 'trace.csv', tmp_path / 'verdicts.csv'],
                                check=False, capture_output=True)
        assert failed.returncode == 1
    same = tmp_path / 'same.csv'
    same.write_text(SAME[export.name])
    simulate(build(export.bundle).monitor, same, tmp_path / 'verdicts.csv')
    subprocess.run([program, same, tmp_path / 'verdicts.csv'], check=True)
    for wrong, message in WRONG[export.name]:
        refused = subprocess.run([program], input=wrong, check=False, capture_output=True,
                                 text=True)
        assert (refused.returncode, refused.stderr) == (1, f'{message}\n')


def test_the_examples_of_the_readme_compile_and_run(export: Export, tmp_path: Path) -> None:
    compiler = gcc()
    assert compiler is not None
    step, messages = re.findall('```c\n(.*?)```', (export.folder / 'README.md').read_text(),
                                re.DOTALL)
    (tmp_path / 'main.c').write_text(
        f'{messages}void use(void);\nvoid use(void)\n{{\n{step}}}\n'
        'int main(void)\n{\n  begin(0);\n  receive(5, (union fm_value){.i = 1});\n'
        f'  const struct fm_evaluator_options options = {export.name}_options();\n'
        f'  if (fm_evaluator_bytes(&options) > {export.name.upper()}_EVALUATOR_BYTES) {{\n'
        '    return 2;\n  }\n'
        '  return fm_evaluator_topic_counts(evaluator, 0u).messages == 1u ? 0 : 1;\n}\n')
    compile_c([*compiler, '-std=c99', '-Wall', '-Wextra', '-Wpedantic', '-Werror',
               '-Wno-unused-but-set-variable', f'-I{export.folder}/src', tmp_path / 'main.c',
               *export.objects, '-lm', '-o', tmp_path / 'main'])
    assert subprocess.run([tmp_path / 'main'], check=False).returncode == 0


def test_two_exports_with_prefixes_share_no_external_name(tmp_path: Path) -> None:
    nm, compiler = shutil.which('nm'), gcc()
    if nm is None or compiler is None:
        pytest.skip('needs gcc and nm')
    defined = []
    for prefix, text in (('left', STEPS), ('right', TIMED)):
        (tmp_path / 'bundle.yaml').write_text(text)
        generated = generate_monitor(renamed(read(tmp_path / 'bundle.yaml'), prefix))
        options = Options(prefix)
        files = assemble('c99', generated, options, c99(generated, options))
        write_export(tmp_path / prefix, files)
        assert (f'evaluator.h src/instance.h src/tables.h src/{prefix}_options.h '
                f'src/{prefix}_size.h src/fret_names.h') in files['CMakeLists.txt']
        sources = sorted((tmp_path / prefix / 'src').glob('*.c'))
        (tmp_path / 'all.c').write_text(''.join(f'#include "{source}"\n' for source in sources))
        compile_c([*compiler, '-std=c99', *WARNINGS, f'-I{tmp_path}/{prefix}/src', '-c',
                   tmp_path / 'all.c', '-o', tmp_path / 'all.o'])
        listed = subprocess.run([nm, '-g', '--defined-only', tmp_path / 'all.o'], check=True,
                                capture_output=True, text=True).stdout
        defined.append({line.split()[-1] for line in listed.splitlines()})
        assert f'{prefix}_fm_evaluator_init' in defined[-1]
        assert all(name.startswith(f'{prefix}_') for name in defined[-1])
    assert 'fret_names' not in c99(generated, Options()).generated['src/fret_monitor.h']


@pytest.mark.parametrize('name', ['gcc', 'clang'])
def test_the_monitors_compile_as_cpp_too(export: Export, name: str, tmp_path: Path) -> None:
    compiler = gcc() if name == 'gcc' else clang()
    if compiler is None:
        pytest.skip(f'needs {name}')
    compile_c([*compiler, '-x', 'c++', '-std=c++11', *WARNINGS, '-c',
               export.folder / 'src' / f'{export.name}_monitor.c', '-o', tmp_path / 'out.o'])


def test_cmake_builds_tests_and_installs_a_package_of_any_name(tmp_path: Path) -> None:
    cmake = shutil.which('cmake')
    if cmake is None:
        pytest.skip('needs cmake')

    def run(*words: str | Path) -> None:
        done = subprocess.run([cmake, *words], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
        assert 'warning' not in done.stdout + done.stderr

    (tmp_path / 'steps.yaml').write_text(STEPS)
    for name in ('m', 'test'):  # a library that the export links, a target of CMake
        generated = generate_monitor(renamed(read(tmp_path / 'steps.yaml'), name))
        write_export(tmp_path / name,
                     assemble('c99', generated, Options(), c99(generated, Options())))
        run('-S', tmp_path / name, '-B', tmp_path / 'build' / name, '-Werror=dev',
            f'-DCMAKE_INSTALL_PREFIX={tmp_path / "prefix"}')
    run('--build', tmp_path / 'build' / 'test', '--target', 'all', 'test', 'install')
    (tmp_path / 'CMakeLists.txt').write_text(
        'cmake_minimum_required(VERSION 3.16)\nproject(robot LANGUAGES C)\n'
        'find_package(test REQUIRED)\nadd_executable(robot robot.c)\n'
        'target_link_libraries(robot PRIVATE test::test)\n')
    (tmp_path / 'robot.c').write_text(
        '#include "test_monitor.h"\n#include "test_size.h"\nint main(void)\n{\n'
        '  static struct test_state state;\n  static char block[TEST_EVALUATOR_BYTES];\n'
        '  test_reset(&state);\n  return block[0];\n}\n')
    run('-S', tmp_path, '-B', tmp_path / 'robot', f'-DCMAKE_PREFIX_PATH={tmp_path / "prefix"}')
    run('--build', tmp_path / 'robot')


def test_messages_come_at_instants_in_the_example_of_windows_of_numbers(tmp_path: Path) -> None:
    bundle, trace, verdicts = (tmp_path / name for name in ('b.yaml', 'trace.csv', 'verdicts.csv'))
    bundle.write_text(
        'format: 1\nevaluation: {policy: timed}\ninputs: {x: {type: float64, max_rate: 20}}\n'
        'requirements:\n- {id: MEAN, ptltl: "meanOver(4 s, x) <= 5"}\n'
        '- {id: SLOPE, ptltl: "abs(derivative(x)) <= 2"}\n'
        '- {id: COUNT, ptltl: "countOver(4 s, x > 3) <= 0"}\n')
    rows, expected = example(generate_monitor(read(bundle)))
    trace.write_text(rows)
    simulate(build(bundle).monitor, trace, verdicts)
    assert verdicts.read_text() == expected
    _, *columns = zip(*(line.split(',') for line in expected.splitlines()[1:]), strict=True)
    assert all({*column} == {'0', '1'} for column in columns)
