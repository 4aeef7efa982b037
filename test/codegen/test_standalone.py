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

"""A separate C program runs a compiled monitor, without Python and without ROS."""

from pathlib import Path
import re
import shutil
import subprocess

from differential.compiled import gcc, WARNINGS
from fret_monitor.build import build, generate_monitor, read, write
from fret_monitor.traces.simulate import simulate
import pytest

ROOT = Path(__file__).resolve().parents[2]
PROGRAM, BUNDLE = ROOT / 'examples' / 'standalone.c', ROOT / 'config' / 'quadrotor.yaml'
# At rest, then a gust that lasts for half a minute, then none; nothing between 9 and 26 s.
ROWS = [f'{time}.25,{row}' for row, times in (
    ('2.0,3.0', range(3)), ('17.5,9.25', (3, 4, 5, 9, 26, 27, 33)), ('12.0,3.0', (34, 35)))
    for time in times]
BEGIN = 0.25

if not PROGRAM.is_file():
    pytest.skip('needs the source tree', allow_module_level=True)


def commands() -> list[str]:
    """Return the commands in the program's comment."""
    lines = PROGRAM.read_text(encoding='utf-8').splitlines()
    return [line.removeprefix('//   ') for line in lines
            if re.match('//   [a-z]', line)]


@pytest.fixture
def compiled(tmp_path: Path) -> Path:
    """Return a folder with the compiled bundle, and the program where its comment expects it."""
    (tmp_path / 'examples').mkdir()
    shutil.copy(PROGRAM, tmp_path / 'examples')
    write(generate_monitor(read(BUNDLE)), tmp_path / 'compiled')
    return tmp_path


def test_it_prints_the_violations_of_simulate(compiled: Path) -> None:
    if shutil.which('cc') is None:
        pytest.skip('needs a compiler by the name of cc')
    compile_it, build_it, run_it = commands()
    assert compile_it == 'fret-monitor compile config/quadrotor.yaml --output compiled'
    subprocess.run(['sh', '-ec', f'{build_it}\n{run_it}'], cwd=compiled, check=True)
    rows = '\n'.join(ROWS) + '\n'
    from_zero = '\n'.join(
        ','.join([str(float(row.split(',')[0]) - BEGIN), *row.split(',')[1:]]) for row in ROWS)
    told = subprocess.run([compiled / 'standalone'], input=from_zero,
                          capture_output=True, text=True, check=True).stdout
    (compiled / 'trace.csv').write_text('time,current_consumption,wind_speed\n' + rows)
    simulate(build(BUNDLE).monitor, compiled / 'trace.csv', compiled / 'verdicts.csv')
    verdicts = (compiled / 'verdicts.csv').read_text().splitlines()
    assert verdicts[0] == 'time,ROS-001,ROS-002,ROS-003,ROS-004'
    violated = [row.split(',')[0] for row in verdicts[1:] if row.split(',')[1] == '0']
    # 20 s after the gust began; the formula stays false, the response is overdue until 34 s.
    assert violated[0] == '23.25'
    assert told.splitlines() == [f'{float(time) - BEGIN:.1f} s: ROS-001 is violated'
                                 for time in violated if float(time) < 34]


def test_it_compiles_without_a_warning(compiled: Path) -> None:
    compiler = gcc()
    if compiler is None:
        pytest.skip('needs gcc')
    for standard in ('c99', 'c11', 'c17'):
        subprocess.run([*compiler, f'-std={standard}', *WARNINGS, '-Icompiled/src',
                        'examples/standalone.c', 'compiled/src/quadrotor_monitor.c', '-lm', '-o',
                        'standalone'], cwd=compiled, check=True)


def test_it_stays_about_thirty_lines() -> None:
    text = PROGRAM.read_text(encoding='utf-8')
    lines = [line for line in text.splitlines() if line and not line.startswith('//')]
    assert len(lines) <= 30


def test_flags_that_would_change_verdicts_are_refused(compiled: Path) -> None:
    compiler = gcc()
    if compiler is None:
        pytest.skip('needs gcc')
    for flag in ('-ffast-math', '-Ofast'):
        done = subprocess.run([*compiler, '-std=c99', flag, '-c', 'quadrotor_monitor.c'],
                              cwd=compiled / 'compiled' / 'src', capture_output=True, text=True,
                              check=False)
        assert done.returncode != 0
        assert 'fret_monitor needs IEEE 754' in done.stderr
