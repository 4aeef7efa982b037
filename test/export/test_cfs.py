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
Target `cfs`: four applications in one program, against stubs of cFE, on a scripted software bus.

The stubs in `stubs/cfs` are written by hand with the signatures of cFE 7, and behave as it
was seen to (docs/export_flight.md); a real cFS is not built here.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
import shutil
import struct
import subprocess

from differential.compiled import compile_c, gcc, WARNINGS
from export import flight_bundles
from export.flight_bundles import BUNDLES, Case, cases, END_NS, Message, S_NS
from fret_monitor.build import generate_monitor, read
from fret_monitor.export.cfs import cfs
from fret_monitor.export.content import Content, HandlerArguments, Options
from fret_monitor.export.flight import topics_of
from fret_monitor.export.folder import assemble, renamed
from fret_monitor.model.diagnostics import CompileError
from fret_monitor.model.policies import InputSource
import pytest

HERE = Path(__file__).resolve().parent
STUBS = HERE / 'stubs' / 'cfs'
# Those of cFS besides ours.
CFS_WARNINGS = ('-Wstrict-prototypes', '-Wwrite-strings', '-Wpointer-arith', '-Wcast-align')
CMD, SEND_HK, WAKEUP_ID, FIRST_TOPIC = 0x18c0, 0x18c1, 0x18c2, 0x8c4
FIRST_VIOLATION = 100
NOOP, RESET_COUNTERS, RESET_MONITORS = 0, 1, 2
NO_OPERATION, MONITORS_RESET, UNKNOWN_CODE, WRONG_LENGTH, SILENT, HEARD = 2, 4, 5, 7, 12, 13


@dataclass(frozen=True)
class Mission:
    """A program with the applications of all bundles, by their numbers in `names`."""

    program: Path
    cases: dict[str, Case]

    def run(self, name: str, script: list[str], *most_events: str) -> list[list[str]]:
        """Run an application, and return the words of each line that is printed."""
        done = subprocess.run([self.program, str(list(self.cases).index(name)), *most_events],
                              check=True, input='\n'.join(script), capture_output=True, text=True)
        return [line.split(maxsplit=4) for line in done.stdout.splitlines()]


@pytest.fixture(scope='module')
def mission(tmp_path_factory: pytest.TempPathFactory) -> Mission:
    """Compile the applications as a mission does, and link them into one program."""
    compiler = gcc()
    if compiler is None:
        pytest.skip('needs gcc')
    folder = tmp_path_factory.mktemp('cfs')
    found, objects = cases(folder), []
    for name, case in found.items():
        generated = case.generated
        app = folder / f'{name}_app'
        for file, text in assemble('cfs', generated, Options(),
                                   cfs(generated, Options())).items():
            (app / file).parent.mkdir(parents=True, exist_ok=True)
            (app / file).write_text(text)
        (app / 'inc').mkdir()
        first = f'-DCFE_MISSION_{name.upper()}_APP_FIRST_TOPICID=0xC0'
        for path in (app / 'config').iterdir():  # as generate_config_includefile does
            shutil.copy(path, app / 'inc' / path.name.removeprefix('default_'))
        paths = [f'-I{app}/{part}' for part in ('inc', 'fsw/inc', 'fsw/src', 'fsw/src/monitors')]
        for source in (f'{name}_app.c', f'{name}_app_map.c', f'monitors/{name}_runner.c'):
            objects.append(app / f'{Path(source).stem}.o')
            compile_c([*compiler, '-std=c99', '-ffp-contract=off', *WARNINGS, first,
                       *CFS_WARNINGS, f'-I{STUBS}', *paths, '-c', app / 'fsw' / 'src' / source,
                       '-o', objects[-1]])
    (folder / 'apps.inc').write_text('\n'.join([
        *(f'void {name.upper()}_APP_Main(void);' for name in found),
        'static void (* const applications[])(void) = {',
        *(f'  {name.upper()}_APP_Main,' for name in found), '};\n']))
    compile_c([*compiler, '-std=c99', *WARNINGS, f'-I{STUBS}', f'-I{folder}',
               HERE / 'cfs_main.c', *objects, '-lm', '-o', folder / 'program'])
    return Mission(folder / 'program', found)


def payload(case: Case, message: Message) -> str:
    """Return what follows the first header of a message, in hexadecimal."""
    inputs = case.generated.manifest.inputs
    codes = [(inputs[index].value_type.typecode, value)
             for index, value in message.values.items()
             if inputs[index].source is InputSource.FIELD]
    if not codes:
        return bytes(10).hex()
    body = struct.pack('@' + ''.join(code for code, _ in codes), *(value for _, value in codes))
    widest = max(struct.calcsize(code) for code, _ in codes)
    return (bytes(10) + body + bytes(-len(body) % widest)).hex()


def script(case: Case) -> Iterator[str]:
    """Yield the lines of a script for the software bus."""
    for item in case.messages:
        match item.topic:
            case flight_bundles.RESET:
                yield f'{item.time} {CMD:x} {RESET_MONITORS} 0 0000'
            case flight_bundles.WAKEUP:
                yield f'{item.time} {WAKEUP_ID:x} 0 0 0000'
            case topic:
                yield (f'{item.time} {FIRST_TOPIC + topic:x} 0 {item.age} '
                       f'{payload(case, item)}')


def mission_time(now: int) -> int:
    """Return the mission elapsed time at a time of the PSP's clock, as cfs_main.c has it."""
    return now + 2 * S_NS + (947_321_000 if now < S_NS else now // S_NS % 2 * -40_000)


def violations(lines: list[list[str]]) -> list[tuple[int, int]]:
    """Return the times (ns) and requirements of the events that report a violation."""
    found = []
    for words in lines:
        if words[1] == 'event' and int(words[2]) >= FIRST_VIOLATION:
            seconds, nanoseconds = words[-1].split()[-2].split('.')
            now, stamp = int(words[0]), int(seconds) * S_NS + int(nanoseconds)
            found.append((stamp - mission_time(now) + now, int(words[2]) - FIRST_VIOLATION))
    return found


@pytest.mark.parametrize('name', BUNDLES)
def test_events_are_the_violations_of_the_reference(mission: Mission, name: str) -> None:
    case = mission.cases[name]
    end = END_NS if case.counts else case.messages[-1].time
    lines = mission.run(name, [*script(case), f'{end} {SEND_HK:x} 0 0 0000', f'{end} 0 0 0 -'])
    assert sorted(violations(lines)) == sorted(case.expected)
    assert {index for _, index in case.expected} == set(
        range(len(case.generated.manifest.requirements)))
    assert not [words for words in lines if words[1:3] == ['event', str(WRONG_LENGTH)]]
    check_housekeeping(case, next(words[2] for words in lines if words[1] == 'telemetry'))


def check_housekeeping(case: Case, text: str) -> None:
    manifest = case.generated.manifest
    topics = len(topics_of(manifest))
    data = bytes.fromhex(text)
    resets = sum(item.topic == flight_bundles.RESET for item in case.messages)
    assert struct.unpack_from('@BBH', data) == (resets, 0, 0)
    assert list(struct.unpack_from(f'@{topics + 1}I', data, 4)) == [0] + [
        sum(item.topic == topic for item in case.messages) for topic in range(topics)]
    counters = list(struct.iter_unpack('@IIIB3x', data[8 + 4 * topics:]))
    announced = [sum(index == number for _, index in case.expected)
                 for number in range(len(manifest.requirements))]
    assert [item[2] for item in counters] == announced
    if case.counts:
        assert counters == [(item.steps, item.violations, item.announced, not item.verdict)
                            for item in case.counts]


def test_events_that_are_dropped_are_counted(mission: Mission) -> None:
    case = mission.cases['steps']
    end = case.messages[-1].time
    lines = mission.run('steps', [*script(case), f'{end} {SEND_HK:x} 0 0 0000', f'{end} 0 0 0 -'],
                        '1')
    data = bytes.fromhex(next(words[2] for words in lines if words[1] == 'telemetry'))
    lost = struct.unpack_from('@I', data, 4)[0]
    assert 0 < lost == len(case.expected) - len(violations(lines))


def test_a_deadline_is_reported_when_it_is_due_though_no_message_comes(mission: Mission) -> None:
    case = mission.cases['timed']
    rows = [Message(S_NS, 0, {0: False, 1: 1.0}), Message(2 * S_NS, 0, {0: True, 1: 0.0})]
    lines = mission.run('timed', [
        *(f'{row.time} {FIRST_TOPIC:x} 0 0 {payload(case, row)}' for row in rows),
        f'{9 * S_NS} 0 0 0 -'])
    assert violations(lines) == [(2 * S_NS, 2), (4 * S_NS + S_NS // 2, 0), (5 * S_NS, 1)]
    reported = [int(words[0]) for words in lines if words[1:2] == ['event']][1:]
    for time, (stamp, _) in zip(reported, violations(lines), strict=True):
        assert 0 <= time - stamp < 2 * 10**6  # a wait is whole milliseconds
    assert lines[-1] == ['exit', '1']
    assert lines[-2][0] == 'reads' and int(lines[-2][1]) < 20  # the pipe is not polled


def test_commands_and_wrong_messages_are_counted(mission: Mission) -> None:
    lines = mission.run('topics', [
        f'1 {CMD:x} {NOOP} 0 0000', f'2 {CMD:x} 9 0 0000', f'3 {CMD:x} {NOOP} 0 00',
        f'4 {FIRST_TOPIC:x} 0 0 00', f'5 {SEND_HK:x} 0 0 0000',
        f'6 {CMD:x} {RESET_COUNTERS} 0 0000', f'7 {SEND_HK:x} 0 0 0000', '8 0 0 0 -'])
    events = [int(words[2]) for words in lines if words[1] == 'event']
    assert events == [1, NO_OPERATION, UNKNOWN_CODE, WRONG_LENGTH, WRONG_LENGTH, 3]
    first, second = (bytes.fromhex(words[2]) for words in lines if words[1] == 'telemetry')
    assert struct.unpack_from('@BBH', first) == (1, 2, 1)
    assert struct.unpack_from('@BBH', second) == (0, 0, 0)


def test_a_silent_input_is_reported_and_violates(mission: Mission) -> None:
    case = mission.cases['topics']
    index = next(number for number, item in enumerate(case.generated.manifest.inputs)
                 if item.name == 'p')
    message = Message(12 * S_NS, 1, {index: True})
    lines = mission.run('topics', [
        f'{12 * S_NS} {FIRST_TOPIC + 1:x} 0 0 {payload(case, message)}', f'{13 * S_NS} 0 0 0 -'])
    events = [int(words[2]) for words in lines if words[1] == 'event']
    assert events == [1, FIRST_VIOLATION + 1, FIRST_VIOLATION + 2, SILENT, HEARD]
    assert violations(lines) == [(10 * S_NS, 1), (10 * S_NS, 2)]


def test_texts_of_a_bundle_are_safe_in_events(mission: Mission) -> None:
    case = mission.cases['steps']
    end = case.messages[-1].time
    lines = mission.run('steps', [*script(case), f'{end} 0 0 0 -'])
    found = {(words[2], words[3], words[4].split(' violated')[0]) for words in lines[1:-2]}
    assert found == {('100', '3', 'R_1___s'), ('101', '3', 'R,2'),
                     ('102', '2', '*/ int main(void) //_')}


# As in cFE's arch_build.cmake: a module that is loaded at run time, without libraries of C.
ADD_CFE_APP = """\
cmake_minimum_required(VERSION 3.16)
project(mission C)
add_library(core_api INTERFACE)
function(add_cfe_app APP_NAME APP_SRC_FILES)
  add_library(${APP_NAME} MODULE ${APP_SRC_FILES} ${ARGN})
  target_link_libraries(${APP_NAME} core_api)
endfunction()
add_compile_definitions(CFE_MISSION_STEPS_APP_FIRST_TOPICID=0xC0)
"""


def test_cmake_links_what_formulas_call(mission: Mission, tmp_path: Path) -> None:
    cmake = shutil.which('cmake')
    if cmake is None:
        pytest.skip('needs cmake')
    app = mission.program.parent / 'steps_app'
    (tmp_path / 'CMakeLists.txt').write_text(
        f'{ADD_CFE_APP}include_directories({STUBS} {app}/inc)\nadd_subdirectory({app} app)\n')
    for words in (f'-S {tmp_path} -B {tmp_path}/build', f'--build {tmp_path}/build'):
        done = subprocess.run([cmake, *words.split()], capture_output=True, text=True,
                              check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    [module] = (tmp_path / 'build').rglob('libsteps_app.so')
    assert b'sqrt\0' in module.read_bytes() and b'libm.so' in module.read_bytes()


def content(folder: Path, text: str, name: str = 'pump') -> Content:
    (folder / 'bundle.yaml').write_text('format: 1\n' + text)
    return cfs(generate_monitor(renamed(read(folder / 'bundle.yaml'), name)), Options())


@pytest.mark.parametrize(('text', 'expected'), [
    ('inputs:\n  x: {transform: {from: map, to: base}, field: translation.x}\n'
     'requirements:\n  - {id: R-1, ptltl: "x < 1.0"}\n',
     "bundle.yaml:3:3: error: 'x' is a transform\n"),
    ('inputs:\n  word: {type: string, values: {go: "1"}}\nrequirements:\n'
     '  - {id: R-1, ptltl: "word = go"}\n',
     "bundle.yaml:3:3: error: 'word' is a string, which messages of cFS do not have\n"),
    ('inputs:\n  x: {topic: imu, type: sensor_msgs/msg/Imu, field: angular_velocity.x}\n'
     'evaluation: {policy: timed, stamp: header}\nrequirements:\n'
     '  - {id: R-1, ptltl: "x > 0.0"}\n',
     "bundle.yaml:3:3: error: 'x' has no header in messages of cFS\n"),
    ('inputs: {}\nrequirements:\n  - {id: R-1, ptltl: "O[0,2] FTP"}\n', 'no inputs'),
])
def test_what_cfs_cannot_do_is_refused(tmp_path: Path, text: str, expected: str) -> None:
    with pytest.raises(CompileError) as refused:
        content(tmp_path, text)
    assert expected in str(refused.value)


def test_arguments_of_handlers_are_refused(mission: Mission) -> None:
    with pytest.raises(CompileError, match='this target calls no handlers'):
        cfs(mission.cases['timed'].generated,
            Options(handler_arguments=HandlerArguments.VALUES))


def test_too_many_topics_and_requirements_are_refused(tmp_path: Path) -> None:
    inputs = ''.join(f'  q{number}: {{type: bool, topic: t{number}}}\n' for number in range(1800))
    requirements = ''.join(f'  - {{id: R-{number}, ptltl: q{number % 1800}}}\n'
                           for number in range(2100))
    with pytest.raises(CompileError) as refused:
        content(tmp_path, f'inputs:\n{inputs}requirements:\n{requirements}')
    assert 'the bundle has 1800 topics, and cFS has topic ids for 1788\n' in str(refused.value)
    assert ('housekeeping of 2100 requirements and 1800 topics has 40824 bytes, and a message of '
            'cFS has at most 32768\n') in str(refused.value)


def test_names_have_numbers_of_their_own(tmp_path: Path) -> None:
    text = 'inputs:\n  q: {type: bool}\nrequirements:\n  - {id: R-1, ptltl: q}\n'
    pump, arm = (content(tmp_path, text, name) for name in ('pump', 'arm'))
    assert pump.values['PERF_ID'] != arm.values['PERF_ID']
    ids = [line.split()[-1] for name, item in (('pump', pump), ('arm', arm))
           for line in item.generated[f'config/default_{name}_app_topicids.h'].splitlines()
           if 'FIRST_TOPICID 0x' in line]
    assert len({*ids}) == 2 and all(0x100 <= int(number, 16) < 0x7fc for number in ids)


def test_a_long_name_is_a_warning(tmp_path: Path) -> None:
    text = 'inputs:\n  q: {type: bool}\nrequirements:\n  - {id: R-1, ptltl: q}\n'
    assert content(tmp_path, text).warnings == ()
    found = content(tmp_path, text, 'quadrotor_left').warnings
    assert [item.title for item in found] == [
        "'QUADROTOR_LEFT_APP_Main' is longer than 19 characters, the limit of cFS for names"]
