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
Target `fprime`: the components of four bundles in one program, against stubs of F Prime.

The base class of a component, which F Prime's autocoder writes, is written here from the model in
FPP. A real F Prime is not built here (docs/export_flight.md has a trial); `fpp-check` checks the
models where it is installed.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
import re
import shutil
import subprocess

from differential.compiled import compile_c, gcc, WARNINGS
from export import flight_bundles
from export.flight_bundles import BUNDLES, Case, Message
from fret_monitor.build import generate_monitor, read
from fret_monitor.export.content import Options
from fret_monitor.export.flight import topics_of
from fret_monitor.export.folder import assemble
from fret_monitor.export.fprime import fprime
from fret_monitor.model.diagnostics import CompileError
from fret_monitor.model.policies import InputSource, Policy
import pytest

HERE = Path(__file__).resolve().parent
STUBS = HERE / 'stubs' / 'fprime'
US_NS = 1000
LEVELS = {'high': 'HI', 'low': 'LO'}

PORT = re.compile(r'^  port (\w+)\((.*?)^  \)', re.MULTILINE | re.DOTALL)
ARGUMENT = re.compile(r'^    \$(\w+): (\w+)', re.MULTILINE)
EVENT = re.compile(r'^    event (\w+)(\(stamp: U64 @< nanoseconds\n    \))? '
                   r'severity (\w+) (\w+) id (\d+) \\\n      format "([^"\n]*)"$', re.MULTILINE)
CHANNEL = re.compile(r'^    telemetry (\w+): U32 id (\d+) update on change$', re.MULTILINE)


def base_class(component: str, model: str) -> Iterator[str]:
    """Yield the base class that F Prime writes from a model, with what it calls and prints."""
    types = {name: ARGUMENT.findall(body) for name, body in PORT.findall(model)}
    types['Svc.Sched'] = [('context', 'U32')]
    ports = [(name, types[kind]) for name, kind in re.findall(
        r'guarded input port (\w+): ([\w.]+)$', model, re.MULTILINE)]
    yield '#include "Fw.hpp"'
    yield 'namespace Fret {'
    yield f'class {component}ComponentBase : public Fw::PassiveComponentBase'
    yield '{'
    yield 'public:'
    yield f'  explicit {component}ComponentBase(const char * name)'
    yield '  : Fw::PassiveComponentBase(name) {}'
    yield '  void call(const std::string & port) override'
    yield '  {'
    yield '    if (port == "RESET") {RESET_cmdHandler(0, 1);}'
    for name, arguments in ports:
        yield f'    if (port == "{name}") {{'
        yield from (f'      const {kind} a{number} = read<{kind}>();'
                    for number, (_, kind) in enumerate(arguments))
        given = ''.join(f', a{number}' for number in range(len(arguments)))
        yield f'      {name}_handler(0{given});'
        yield '    }'
    yield '  }'
    yield 'protected:'
    yield '  virtual void RESET_cmdHandler(FwOpcodeType opCode, U32 cmdSeq) = 0;'
    for name, arguments in ports:
        given = ''.join(f', {kind} {word}' for word, kind in arguments)
        yield f'  virtual void {name}_handler(FwIndexType portNum{given}) = 0;'
    for name, has_stamp, kind, level, number, _ in EVENT.findall(model):
        word = f'{kind.upper()}_{LEVELS[level]}'
        shown = ' << stamp' if has_stamp else ''
        yield f'  void log_{word}_{name}({"U64 stamp" if has_stamp else ""})'
        yield f'  {{std::cout << "event {number} {word} "{shown} << std::endl;}}'
    for name, number in CHANNEL.findall(model):
        yield f'  void tlmWrite_{name}(U32 value)'
        yield f'  {{std::cout << "channel {number} " << value << std::endl;}}'
    yield from ('};', '}', '')


@dataclass(frozen=True)
class Deployment:
    """A program with the components of all bundles, their folders, and what is expected."""

    program: Path
    folders: dict[str, Path]
    cases: dict[str, Case]

    def run(self, name: str, script: list[str]) -> list[list[str]]:
        """Run a component, and return the words of each line that is printed."""
        done = subprocess.run([self.program, str(list(self.cases).index(name))], check=True,
                              input='\n'.join(script), capture_output=True, text=True)
        return [line.split() for line in done.stdout.splitlines()]


@pytest.fixture(scope='module')
def deployment(tmp_path_factory: pytest.TempPathFactory) -> Deployment:
    """Compile the components as a project does, and link them into one program."""
    compiler = gcc()
    if compiler is None or shutil.which('g++') is None:
        pytest.skip('needs gcc and g++')
    folder = tmp_path_factory.mktemp('fprime')
    found = flight_bundles.cases(folder, is_fprime=True)
    folders, objects = {}, []
    for name, case in found.items():
        component, folders[name] = f'{name.capitalize()}Monitor', folder / name
        content = fprime(case.generated, Options())
        for file, text in assemble('fprime', case.generated, Options(), content).items():
            (folders[name] / file).parent.mkdir(parents=True, exist_ok=True)
            (folders[name] / file).write_text(text)
        (folders[name] / f'{component}ComponentAc.hpp').write_text(
            '\n'.join(base_class(component, content.generated[f'{component}.fpp'])))
        paths = [f'-I{STUBS}', f'-I{folders[name]}', f'-I{folders[name]}/monitors']
        for source in (f'monitors/{name}_runner.c', f'{component}.cpp', f'{component}Ports.cpp'):
            objects.append(folders[name] / f'{Path(source).stem}.o')
            command = [*compiler, '-std=c99', '-ffp-contract=off'] if source.endswith('.c') \
                else ['g++', '-std=c++14']
            compile_c([*command, *WARNINGS, *paths, '-c', folders[name] / source,
                       '-o', objects[-1]])
    names = [f'{name.capitalize()}Monitor' for name in found]
    (folder / 'components.inc').write_text('\n'.join([
        *(f'#include "{name}.hpp"' for name in names),
        'static Fw::PassiveComponentBase ** components()', '{',
        *(f'  static Fret::{name} a{name}("{name}");' for name in names),
        '  static Fw::PassiveComponentBase * all[] = {'
        + ', '.join(f'&a{name}' for name in names) + '};', '  return all;', '}', '']))
    compile_c(['g++', '-std=c++14', *WARNINGS, f'-I{STUBS}', f'-I{folder}',
               *(f'-I{path}' for path in folders.values()),
               *(f'-I{path}/monitors' for path in folders.values()),
               HERE / 'fprime_main.cpp', *objects, '-lm', '-o', folder / 'program'])
    return Deployment(folder / 'program', folders, found)


def line(case: Case, item: Message) -> str:
    """Return the line of a script for a message."""
    time = item.time // US_NS
    if item.topic == flight_bundles.RESET:
        return f'{time} RESET'
    if item.topic == flight_bundles.WAKEUP:
        return f'{time} run 0'
    manifest = case.generated.manifest
    values = [value for index, value in item.values.items()
              if manifest.inputs[index].source is InputSource.FIELD]
    return ' '.join([str(time), f'topic_{topics_of(manifest)[item.topic].word}',
                     *(str(int(value) if isinstance(value, bool) else value)
                       for value in values)])


def violations(lines: list[list[str]]) -> list[tuple[int, int]]:
    return [(int(words[3]), int(words[1])) for words in lines
            if words[0] == 'event' and len(words) == 4]


@pytest.mark.parametrize('name', BUNDLES)
def test_events_are_the_violations_of_the_reference(deployment: Deployment, name: str) -> None:
    case = deployment.cases[name]
    script = [line(case, item) for item in case.messages]
    if case.generated.manifest.policy is not Policy.PERIODIC:
        script.append(f'{flight_bundles.END_NS // US_NS} run 0')
    lines = deployment.run(name, script)
    last = flight_bundles.END_NS if case.counts else case.messages[-1].time
    assert sorted(item for item in violations(lines) if item[0] <= last) == sorted(case.expected)
    shown = {int(words[1]): int(words[2]) for words in lines if words[0] == 'channel'}
    if case.counts:
        assert shown == {index: item.violations for index, item in enumerate(case.counts)}
    assert len([words for words in lines if words[0] == 'response']) == sum(
        item.topic == flight_bundles.RESET for item in case.messages)


def test_ids_are_distinct_and_texts_are_safe(deployment: Deployment) -> None:
    model = (deployment.folders['steps'] / 'StepsMonitor.fpp').read_text()
    assert [(name, kind, level, int(number), text)
            for name, _, kind, level, number, text in EVENT.findall(model)] == [
        ('violated_r_1_s', 'warning', 'high', 0, 'R_1___s is violated at {} ns'),
        ('violated_r_2', 'warning', 'high', 1, 'R,2 is violated at {} ns'),
        ('violated_int_main_void', 'warning', 'low', 2,
         '*/ int main(void) //_ is violated at {} ns')]
    model = (deployment.folders['topics'] / 'TopicsMonitor.fpp').read_text()
    assert [(name, int(number)) for name, *_, number, _ in EVENT.findall(model)] == [
        ('violated_r_1', 0), ('violated_r_2', 1), ('violated_r_3', 2), ('silent_p', 3),
        ('heard_p', 4)]
    assert re.findall('^  port (.*)', model, re.MULTILINE) == [
        'TopicsMonitor_pump_point(', 'TopicsMonitor_pump_point_2(', 'TopicsMonitor_scan(']


# The ports that every component has, by name only.
PRELUDE = """\
type FwIndexType = I32
module Svc { port Sched(context: U32) }
module Fw {
  port Cmd
  port CmdReg
  port CmdResponse
  port Log
  port LogText
  port Time
  port Tlm
}
"""


def test_the_model_is_correct_fpp(deployment: Deployment, tmp_path: Path) -> None:
    check = shutil.which('fpp-check')
    if check is None:
        pytest.skip('needs fpp-check (pip install fprime-fpp)')
    (tmp_path / 'prelude.fpp').write_text(PRELUDE)
    models = [path for folder in deployment.folders.values() for path in folder.glob('*.fpp')]
    done = subprocess.run([check, tmp_path / 'prelude.fpp', *models], check=False, text=True,
                          capture_output=True)
    assert len(models) == len(BUNDLES)
    assert (done.returncode, done.stderr) == (0, '')


# As F Prime 3: a module is a library, and a topology links it and includes its header by its path.
PROJECT = """\
cmake_minimum_required(VERSION 3.16)
project(project C CXX)
set(CMAKE_CXX_STANDARD 14)
include_directories(STUBS)
function(register_fprime_module)
  list(FILTER SOURCE_FILES EXCLUDE REGEX fpp$)
  add_library(${FPRIME_CURRENT_MODULE} ${SOURCE_FILES})
endfunction()
set(FPRIME_CURRENT_MODULE component)
add_subdirectory(component)
add_library(topology topology.cpp)
target_include_directories(topology PRIVATE ${CMAKE_CURRENT_LIST_DIR})
target_link_libraries(topology component)
"""


def test_a_topology_finds_the_header_of_the_component(deployment: Deployment,
                                                      tmp_path: Path) -> None:
    cmake = shutil.which('cmake')
    if cmake is None:
        pytest.skip('needs cmake')
    shutil.copytree(deployment.folders['cycles'], tmp_path / 'component')
    (tmp_path / 'build' / 'component').mkdir(parents=True)
    made = 'CyclesMonitorComponentAc.hpp'  # the autocoder writes it into the folder of the build
    (tmp_path / 'component' / made).rename(tmp_path / 'build' / 'component' / made)
    (tmp_path / 'topology.cpp').write_text('#include "component/CyclesMonitor.hpp"\n')
    (tmp_path / 'CMakeLists.txt').write_text(PROJECT.replace('STUBS', str(STUBS)))
    for words in (f'-S {tmp_path} -B {tmp_path}/build', f'--build {tmp_path}/build'):
        done = subprocess.run([cmake, *words.split()], capture_output=True, text=True,
                              check=False)
        assert done.returncode == 0, done.stdout + done.stderr


def test_texts_of_a_bundle_are_no_markup_in_annotations_and_formats(tmp_path: Path) -> None:
    """F Prime 3 copies both into the XML from which it makes the dictionary, as they are."""
    (tmp_path / 'bundle.yaml').write_text("""\
format: 1
inputs:
  "\\"x&y\\"": {type: float64, timeout: 1}
  q: {type: bool}
requirements:
  - {id: A<1 & B, ptltl: '"x&y"<=2.0 & q -> "x&y" < 1.5'}
  - {id: R-2, title: 'a <b> \\ c', ptltl: 'q <-> "x&y" > 1.0'}
""")
    model = fprime(generate_monitor(read(tmp_path / 'bundle.yaml')), Options()).generated[
        'BundleMonitor.fpp']
    assert not re.search('[<&]', model.replace('@<', ''))
    assert '@ "x and y" at most 2.0 and q -> "x and y" less than 1.5\n' in model
    assert '@ a less than b> (backslash) c\n' in model
    assert 'format "A_1 _ B is violated at {} ns"' in model
    assert 'format "input x_y is silent"' in model


@pytest.mark.parametrize(('text', 'expected'), [
    ('inputs:\n  x: {transform: {from: map, to: base}, field: translation.x}\n'
     'requirements:\n  - {id: R-1, ptltl: "x < 1.0"}\n',
     "bundle.yaml:3:3: error: 'x' is a transform\n"),
    ('inputs:\n  word: {type: string, values: {go: "1"}}\nrequirements:\n'
     '  - {id: R-1, ptltl: "word = go"}\n',
     "bundle.yaml:3:3: error: 'word' is a string, which ports of F Prime do not have\n"),
    ('inputs:\n  old: {topic: imu, type: sensor_msgs/msg/Imu, field: age(header.stamp)}\n'
     'requirements:\n  - {id: R-1, ptltl: "old < 0.5"}\n',
     "bundle.yaml:3:3: error: 'old' is the age of a message, and ports have no stamps\n"),
])
def test_what_fprime_cannot_do_is_refused(tmp_path: Path, text: str, expected: str) -> None:
    (tmp_path / 'bundle.yaml').write_text('format: 1\n' + text)
    with pytest.raises(CompileError) as refused:
        fprime(generate_monitor(read(tmp_path / 'bundle.yaml')), Options())
    assert expected in str(refused.value)


def test_inputs_whose_names_differ_in_a_last_character_are_arguments_of_their_own(
    tmp_path: Path,
) -> None:
    names = ('portNum', 'portNum_', 'm_runner_', 'm_runner', 'bundle_runner_x', 'bundle_runner_x_')
    inputs = ''.join(f'  {name}: {{type: bool, topic: t}}\n' for name in names)
    (tmp_path / 'bundle.yaml').write_text(
        f'format: 1\ninputs:\n{inputs}requirements:\n'
        f'  - {{id: R-1, ptltl: "{" & ".join(names)}"}}\n')
    found = fprime(generate_monitor(read(tmp_path / 'bundle.yaml')), Options())
    arguments = found.values['HANDLERS'].partition('portNum, ')[2].rstrip(');').split(', ')
    assert arguments == ['bool portNum_2', 'bool portNum_', 'bool m_runner_', 'bool m_runner_2',
                         'bool bundle_runner_x_2', 'bool bundle_runner_x__']
