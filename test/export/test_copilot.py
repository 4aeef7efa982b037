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

"""Target `copilot`: C of a hostile bundle, two exports in one program, names that are refused."""

from collections.abc import Sequence
from itertools import accumulate
from pathlib import Path
from random import Random
import re
import shutil
import subprocess

from differential.compiled import clang, compile_c, gcc, SANITIZERS, WARNINGS
from differential.test_clean_c import has_sanitizers
from fret_monitor.build import generate_monitor, GeneratedMonitor, read
from fret_monitor.export.content import Content, HandlerArguments, Options
from fret_monitor.export.copilot import copilot
from fret_monitor.export.external_names import fault, is_extension
from fret_monitor.export.folder import assemble, renamed
from fret_monitor.logic.evaluate import verdicts
from fret_monitor.logic.timed import evaluate_timed, TimedTrace
from fret_monitor.model.diagnostics import CompileError
import pytest

HERE = Path(__file__).resolve().parent
LEFT = """\
format: 1
inputs:
  p: {type: bool}
  x: {type: float32}
  a.b: {type: uint8}
  mode: {type: uint8, values: {IDLE: 0, LANDING: 7}}
  word: {type: string, topic: state, values: {stopped: halt, moving: "*/ int ??/"}}
requirements:
  - {id: R-1, title: "*/ #error ??/", ptltl: "p -> O[0,2] x > 0.5"}
  - {id: "*/ int main(void) //\\\\", report: onset, ptltl: "mode = LANDING | a.b < 3"}
  - {id: int, title: "a\\\\", ptltl: "H (word = moving -> x < 1.0)", report: occurrence}
"""
RIGHT = """\
format: 1
inputs:
  p: {type: bool}
  x: {type: float32}
evaluation: {policy: timed}
requirements:
  - {id: R-1, report: onset, ptltl: "p -> O[0, 2.5 s] (x > 0.5)"}
  - {id: R-2, report: onset, ptltl: "H[1 s, 3 s] p -> x > 0.25"}
"""
HOOKS = """\
extern int depth, sections;
#define FRET_MONITOR_ENTER() do {depth += 1; sections += depth == 1;} while (0)
#define FRET_MONITOR_LEAVE() do {depth -= 1;} while (0)
"""


def generated(folder: Path, text: str, name: str) -> GeneratedMonitor:
    (folder / 'bundle.yaml').write_text(text)
    return generate_monitor(renamed(read(folder / 'bundle.yaml'), name))


def export(folder: Path, monitor: GeneratedMonitor, options: Options) -> None:
    """Write the files of an export to a folder, beside others."""
    for name, text in assemble('copilot', monitor, options, copilot(monitor, options)).items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)


class Two:
    """The two exports in one folder, with a program that uses both."""

    def __init__(self, folder: Path) -> None:
        """Export both bundles."""
        self.folder = folder
        self.left = generated(folder, LEFT, 'left')
        self.right = generated(folder, RIGHT, 'right')
        export(folder, self.left, Options('left', HandlerArguments.VALUES))
        export(folder, self.right, Options('right'))
        shutil.copy(HERE / 'two_exports.c', folder)
        (folder / 'hooks.h').write_text(HOOKS)

    def compiled(self, *command: str) -> Path:
        compile_c([*command, '-DFRET_MONITOR_HOOKS="hooks.h"', f'-I{self.folder}',
                   *(self.folder / name for name in ('two_exports.c', 'left.c', 'right.c')),
                   '-lm', '-o', self.folder / 'program'])
        return self.folder / 'program'


@pytest.fixture(scope='module')
def two(tmp_path_factory: pytest.TempPathFactory) -> Two:
    """Return the two exports."""
    return Two(tmp_path_factory.mktemp('two'))


@pytest.mark.parametrize('language', ['c', 'c++'])
@pytest.mark.parametrize('name', ['gcc', 'clang'])
def test_every_file_compiles_without_a_warning(two: Two, name: str, language: str) -> None:
    compiler = gcc() if name == 'gcc' else clang()
    if compiler is None:
        pytest.skip(f'needs {name}')
    standard = '-std=c99' if language == 'c' else '-std=c++11'
    for source in ('left.c', 'right.c', 'two_exports.c'):
        compile_c([*compiler, '-x', language, standard, *WARNINGS, '-O2', f'-I{two.folder}', '-c',
                   two.folder / source, '-o', two.folder / 'out.o'])


Row = tuple[int, bool, float, int, bool, bool]


def rows_of(seed: int, count: int, gaps: Sequence[int]) -> list[Row]:
    """Return rows of the program: a time, and a value for each input."""
    rng, rows, time = Random(seed), [], 7
    for _ in range(count):
        rows.append((time, rng.random() < 0.7, rng.choice((0.0, 0.25, 0.5, 0.75, 1.5)),
                     rng.choice((2, 3)), rng.random() < 0.5, rng.random() < 0.5))
        time += rng.choice(gaps)
    return rows


def run(program: Path, rows: Sequence[Row], *arguments: str) -> tuple[list[str], str]:
    """Return the lines that the program prints, and what it prints to standard error."""
    text = '\n'.join(' '.join(str(float(value) if place == 2 else int(value))
                              for place, value in enumerate(row)) for row in rows)
    done = subprocess.run([program, *arguments], input=text, capture_output=True, text=True,
                          check=True)
    return done.stdout.splitlines(), done.stderr


def left_calls(monitor: GeneratedMonitor, rows: Sequence[Row]) -> list[str]:
    """Return the calls of left's handlers by the reference."""
    names = ('p', 'x', 'a.b', 'mode', 'word')
    trace = {name: [row[place] for row in rows] for place, name in enumerate(names, 1)}
    trace['mode'] = [7 * mode for mode in trace['mode']]
    trace['word'] = [int(word) for word in trace['word']]
    first, onset, always = (verdicts(item.formula, trace)
                            for item in monitor.specification.properties)
    occurred = [not (word and x >= 1.0) for word, x in zip(trace['word'], trace['x'])]
    assert occurred.index(False) == always.index(False)
    calls = []
    for step, (_, p, x, a, _, word) in enumerate(rows):
        if not first[step]:
            calls.append(f'left R-1 {int(p)} {x:.9g}')
        if not onset[step] and (step == 0 or onset[step - 1]):
            calls.append(f'left int {a} {trace["mode"][step]}')
        if not occurred[step] and (step == 0 or occurred[step - 1]):
            calls.append(f'left word {x:.9g} {int(word)}')
    return calls


def right_calls(monitor: GeneratedMonitor, rows: Sequence[Row]) -> list[str]:
    """Return the calls of right's handlers by the reference, with their times."""
    start = rows[0][0]
    # Of two rows at one time, the later takes effect a nanosecond later.
    ticks = list(accumulate((row[0] - start for row in rows),
                            lambda before, tick: max(tick, before + 1)))
    trace = TimedTrace(ticks, {'p': [row[1] for row in rows], 'x': [row[2] for row in rows]},
                       ticks[-1])
    found = evaluate_timed([item.formula for item in monitor.specification.properties], trace)
    falls = sorted((tick, number) for number, history in enumerate(found)
                   for tick, value in history if not value)
    return [f'right R-{number + 1} {start + tick}' for tick, number in falls]


def test_two_exports_in_one_program_call_the_handlers_of_the_reference(two: Two) -> None:
    compiler = gcc()
    if compiler is None or not has_sanitizers(two.folder):
        pytest.skip('needs gcc with the address and undefined-behaviour sanitizers')
    program = two.compiled(*compiler, '-std=c99', *SANITIZERS)
    rows = rows_of(3, 400, (1, 500_000_000, 1_000_000_000))
    late, sections = run(program, rows)
    calls = [line for line in late if line.startswith('left')]
    assert calls == left_calls(two.left, rows)
    assert {line.split()[1] for line in calls} == {'R-1', 'int', 'word'}
    assert sections == f'{2 * len(rows)} sections\n'
    expected = right_calls(two.right, rows)
    assert {line.split()[1] for line in expected} == {'R-1', 'R-2'}
    in_time, _ = run(program, rows, 'punctual')
    assert [line for line in in_time if line.startswith('right')] == expected
    # Whoever calls late misses no violation, nor does a second call at one time.
    assert handlers_of_right(late) == handlers_of_right(expected)
    rows = rows_of(4, 200, (0, 0, 1_000_000_000))
    assert handlers_of_right(run(program, rows)[0]) == handlers_of_right(
        right_calls(two.right, rows))
    # A time that goes back, and one after the last tick, start afresh.
    later = [(row[0] + 2 ** 62, *row[1:]) for row in rows_of(5, 50, (1_000_000_000,))]
    expected = [*right_calls(two.right, rows), *right_calls(two.right, rows[:50]),
                *right_calls(two.right, later)]
    assert handlers_of_right(run(program, [*rows, *rows[:50], *later])[0]) == handlers_of_right(
        expected)
    # The last times that there are.
    last = [(2 ** 63 - 1 - gap, True, 0.0, 2, False, False) for gap in (10**9, 1, 0, 0)]
    expected = right_calls(two.right, last[:-1])
    assert handlers_of_right(run(program, last)[0]) == handlers_of_right(expected)


def handlers_of_right(lines: Sequence[str]) -> list[str]:
    return [line.split()[1] for line in lines if line.startswith('right')]


def test_only_the_names_of_the_interface_are_visible(two: Two) -> None:
    nm, compiler = shutil.which('nm'), gcc()
    if nm is None or compiler is None:
        pytest.skip('needs gcc and nm')
    for name, expected in (('left', {'left_step'}),
                           ('right', {'right_step_at', 'right_deadline'})):
        compile_c([*compiler, '-O1', '-c', two.folder / f'{name}.c', '-o', two.folder / 'out.o'])
        lines = subprocess.run([nm, '-g', two.folder / 'out.o'], check=True, text=True,
                               capture_output=True).stdout.splitlines()
        defined = {line.split()[-1] for line in lines if ' U ' not in line}
        needed = {line.split()[-1] for line in lines if ' U ' in line}
        assert defined == expected
        assert {word for word in needed if 'alloc' in word or word == 'free'} == set()
        assert f'{name}_handlerpropR_1' in needed


def test_without_a_prefix_names_are_those_of_copilot(tmp_path: Path) -> None:
    monitor = generated(tmp_path, LEFT, 'fret')
    header = copilot(monitor, Options()).generated['fret.h']
    assert 'extern uint8_t a_DOT_b;\n' in header
    assert 'void handlerpropR_1(void);\n' in header
    assert 'void step(void);\n' in header
    assert '#define mode_LANDING 7\n' in copilot(monitor, Options()).generated['fret_types.h']


def content(folder: Path, inputs: str, name: str = 'pump') -> Content:
    return copilot(generated(folder, 'format: 1\ninputs:\n' + inputs + (
        'requirements:\n  - {id: R-1, ptltl: "q"}\n'), name), Options())


@pytest.mark.parametrize(('inputs', 'expected'), [
    ('  q: {type: bool}\n  int: {type: bool}\n',
     "bundle.yaml:4:3: error: the input 'int' cannot be a variable: it is a keyword of C\n"
     ' 4 |   int: {type: bool}\n   |   ^^^\n'
     '    = help: rename it, there and in formulas: int_value'),
    ('  q: {type: bool}\n  main: {type: bool}\n', 'it is where a program begins'),
    ('  q: {type: bool}\n  malloc: {type: bool}\n', 'it is a function of the C library'),
    ('  q: {type: bool}\n  cosf: {type: bool}\n', 'it is a function of the C library'),
    ('  q: {type: bool}\n  stderr: {type: bool}\n', 'it is defined by a header of C'),
    ('  q: {type: bool}\n  INT8_MAX: {type: bool}\n', 'it is defined by a header of C'),
    ('  q: {type: bool}\n  step: {type: bool}\n', 'it is the function that takes a step'),
    ('  q: {type: bool}\n  handlerpropR_1: {type: bool}\n', 'it is the handler of R-1'),
    ('  q: {type: bool}\n  fm_x: {type: bool}\n', 'names that are reserved\n'),
    ('  q: {type: bool}\n  pump_req_R_1: {type: bool}\n', 'it is a name of the generated C'),
    ('  q: {type: bool}\n  \'"h ö"\': {type: bool}\n', "the input 'h ö' (_DQT_h_SPC_ö_DQT_ in C)"),
    ('  q: {type: bool, topic: t}\n  v: {type: bool, topic: u, timeout: 1, stale: violate}\n',
     "'v' is 'stale: violate', which needs messages"),
    ('  q: {type: bool}\n  m: {type: int8, values: {A: 1}}\n  m_A: {type: bool}\n',
     "the value 'A' cannot be the constant m_A: it is the variable of 'm_A'"),
    ('  q: {type: bool}\n  int8: {type: int8, values: {t: 1}}\n',
     'constant int8_t: it is defined'),
    ('  q: {type: bool}\n  step: {type: int8, values: {at: 1}}\nevaluation: {policy: timed}\n',
     "the value 'at' cannot be the constant step_at: it is the function that takes a step"),
    ('  q: {type: bool}\n  PUMP_H_: {type: bool}\n', 'ends as the names of include guards do'),
])
def test_names_that_cannot_be_shared_with_a_program_are_refused(
    tmp_path: Path, inputs: str, expected: str,
) -> None:
    with pytest.raises(CompileError) as refused:
        content(tmp_path, inputs)
    assert expected in str(refused.value)


def test_inputs_and_constants_can_have_the_names_of_locals_and_members(tmp_path: Path) -> None:
    compiler = gcc()
    if compiler is None:
        pytest.skip('needs gcc')
    names = ('i', 'now', 'next', 'time_', 'table', 'holds', 'requirement')
    inputs = ''.join(f'  {name}: {{type: bool}}\n' for name in names)
    for policy in ('timed', 'every_message'):
        monitor = generated(tmp_path, f"""\
format: 1
inputs:
  is: {{type: uint8, values: {{first: 1, never: 2, again: 3, announced: 4, every_step: 5}}}}
  a.b: {{type: bool}}
  a: {{type: uint8, values: {{b: 1}}}}
{inputs}evaluation: {{policy: {policy}}}
requirements:
  - {{id: R-1, ptltl: "is = first & a = b -> a.b & {' & '.join(names)}"}}
""", 'pump')
        export(tmp_path, monitor, Options('', HandlerArguments.VALUES))
        compile_c([*compiler, '-std=c99', *WARNINGS, '-c', tmp_path / 'pump.c', '-o',
                   tmp_path / 'pump.o'])


def test_names_of_the_headers_of_c_are_not_given_away_unnoticed() -> None:
    compiler = gcc()
    if compiler is None:
        pytest.skip('needs gcc')
    assert all(map(is_extension, ('gamma', 'index', 'y0', 'jn', 'y1f', 'cosf32x', 'lgamma_r')))
    assert not any(map(is_extension, ('speed', 'half32', 'battery', 'indexl_')))
    headers = ('math', 'string', 'strings', 'stdio', 'stdlib', 'unistd')
    for flags in (('-x', 'c', '-std=gnu17'), ('-x', 'c++', '-std=c++11')):
        included = headers if flags[1] == 'c' else headers[:2]
        text = subprocess.run(
            [*compiler, *flags, '-E', '-P', '-'], check=True, capture_output=True, text=True,
            input=''.join(f'#include <{header}.h>\n' for header in included)).stdout
        found = {*re.findall(r'^extern [^();{}\n]*?\b([a-z]\w*) *\(', text, re.MULTILINE),
                 *re.findall(r'^extern [^();{}\n]*?\b([a-z]\w*);', text, re.MULTILINE)}
        assert {'gamma', 'index'} < found
        assert {word for word in found if not (fault(word, 'zz') or is_extension(word))} == set()


def test_two_ids_with_one_handler_are_refused(tmp_path: Path) -> None:
    text = ('format: 1\ninputs: {q: {type: bool}}\nrequirements:\n'
            '  - {id: speed-1, ptltl: "q"}\n  - {id: Speed-1, ptltl: "!q"}\n')
    with pytest.raises(CompileError) as refused:
        copilot(generated(tmp_path, text, 'pump'), Options())
    assert "bundle.yaml:5:10: error: 'Speed-1' and 'speed-1' have one handler" in str(
        refused.value)
    alone = copilot(generated(tmp_path, text.replace('Speed-1', 'other'), 'pump'), Options())
    assert 'void handlerpropSpeed_1(void);' in alone.generated['pump.h']  # as Ogma writes it


def test_a_name_of_a_header_of_c_is_refused(tmp_path: Path) -> None:
    with pytest.raises(CompileError, match=re.escape("'string.h' is a header of the C library")):
        content(tmp_path, '  q: {type: bool}\n', 'string')


def test_an_input_says_what_it_is_and_what_it_begins_with(tmp_path: Path) -> None:
    monitor = generated(tmp_path, """\
format: 1
topics:
  /scan:
    type: sensor_msgs/msg/LaserScan
    fields: {q: {field: received(), initial: false}, near: min(ranges), old: age(header.stamp)}
  /state: {type: std_msgs/msg/String, fields: {word: {field: data, values: {off: halt, on: go}}}}
inputs:
  battery: {type: float32, initial: 100}
  volt: {type: float32, initial: 0.1}
  low: {type: int64, initial: -9223372036854775808}
  gamma: {type: bool}
requirements:
  - {id: R-1, ptltl: "q & near > old & word = off & battery > volt & low > 0 & gamma"}
""", 'pump')
    found = copilot(monitor, Options())
    header = found.generated['pump.h']
    assert """\
// q: received() of sensor_msgs/msg/LaserScan on /scan, true at the step of such a message
// alone; initial false
extern bool q;
// near: min(ranges) of sensor_msgs/msg/LaserScan on /scan
extern float near;
// old: age(header.stamp) of sensor_msgs/msg/LaserScan on /scan, in seconds
extern double old;
// word: data of std_msgs/msg/String on /state; values off = 0 ("halt"), on = 1 ("go"); 0
// (off) also before any value came
extern int32_t word;
""" in header
    assert '// battery: initial 100\nextern float battery;\n// volt: initial 0.1\n' in header
    files = assemble('copilot', monitor, Options(), found)
    readme = files['README.md']
    assert 'float battery = 100;\nfloat volt = 0.1f;\nint64_t low = INT64_MIN;\n' in readme
    assert '| near | float32 | min(ranges) of sensor\\_msgs/msg/LaserScan on /scan |' in readme
    assert [(item.title, item.help) for item in found.warnings] == [
        ("'gamma' is declared by glibc's headers, except in strict C99",
         'rename it, there and in formulas: gamma_value'),
        *((f"'{name}' has its `initial` value only if the program defines it so",
           f'in the program: {line}') for name, line in (
            ('battery', 'float battery = 100;'), ('volt', 'float volt = 0.1f;'),
            ('low', 'int64_t low = INT64_MIN;')))]
    program = '#include "pump.h"\n#include "hooks.h"\n'
    define, hooks = re.findall('```c\n(.*?)```', readme, re.DOTALL)
    assert 'void lock_inputs(void);' in hooks
    for name, text in (*files.items(), ('main.c', program + define), ('hooks.h', hooks)):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    compiler = gcc()
    if compiler is None:
        pytest.skip('needs gcc')
    compile_c([*compiler, '-std=c99', *WARNINGS, '-c', tmp_path / 'main.c', '-o',
               tmp_path / 'main.o'])
    compile_c([*compiler, '-std=c99', *WARNINGS, '-DFRET_MONITOR_HOOKS="hooks.h"',
               f'-I{tmp_path}', '-c', tmp_path / 'pump.c', '-o', tmp_path / 'pump.o'])


def test_stamps_of_messages_have_no_effect(tmp_path: Path) -> None:
    monitor = generated(tmp_path, """\
format: 1
topics: {/odom: {type: nav_msgs/msg/Odometry, fields: {x: twist.twist.linear.x}}}
evaluation: {policy: timed, stamp: header, reorder: 0.1}
requirements: [{id: R-1, ptltl: "x < 1"}]
""", 'pump')
    found = copilot(monitor, Options())
    assert [(item.title, item.help) for item in found.warnings] == [
        ('`stamp: header` has no effect in this export',
         'pass the stamp of the message to step_at, in the order of the stamps'),
        ('`reorder` has no effect in this export',
         'call step_at in the order of the stamps')]
    readme = assemble('copilot', monitor, Options(), found)['README.md']
    assert 'Handlers of one time are called in the order of the bundle.' in readme


def test_what_has_no_effect_is_a_warning(tmp_path: Path) -> None:
    found = content(tmp_path, '  q: {type: bool}\n  new: {type: bool, timeout: 1, topic: n}\n')
    assert [item.title for item in found.warnings] == [
        "the timeout of 'new' has no effect in this export", "'new' is a keyword of C++"]
    assert all(item.span and item.span.line == 4 for item in found.warnings)
