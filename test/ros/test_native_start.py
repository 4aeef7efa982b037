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

"""`monitor`, `gate` with `native:=true`: the process becomes the node in C, or says why not."""

from collections.abc import Callable, Iterator, Mapping, Sequence
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
from typing import Any

from bundles import ARM_GATE, ARM_INPUT, write_bundle
from fret_monitor.build import generate_monitor, read, write
from fret_monitor.model.parts import UNGATED
from fret_monitor.native import cache, ros_files
from fret_monitor.ros import Refusal
from fret_monitor.ros.native_start import become_native, GATE, MONITOR
from fret_monitor.ros.nodes.gate_node import GateNode
from fret_monitor.ros.settings.arguments import given_parameters, NotUnderstood
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
import pytest
import rclpy
from rclpy.context import Context
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.node import Node
from rclpy.parameter import Parameter
from ros.harness import (
    change_state, NodeProcess, Partner, PATIENCE, RELIABLE, START, started, wait_until,
)
from std_msgs.msg import Empty, Float32

BUNDLE = """
format: 1
evaluation: {policy: relevant_message}
constants: {limit: 0.5}
inputs:
  value: {topic: x, type: std_msgs/msg/Float32}
requirements:
  - {id: R1, ptltl: value < limit}
  - {id: KEPT, ptltl: value < 9.0}
gates:
  kept: {from: x, to: z, type: std_msgs/msg/Float32, keep: [KEPT]}
"""
NATIVE = ('-p', 'native:=true')


def program_of(spec: Path | str, *more: str, node: str = MONITOR) -> str:
    """Return what the process would become; build it first, however long that takes."""
    found: list[str] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, 'execv', lambda program, arguments: found.append(str(program)))
        assert not become_native(
            ['monitor', '--ros-args', '-p', f'spec:={spec}', *NATIVE, *more], node)
    program, = found
    return program


@pytest.fixture(scope='module')
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = write_bundle(tmp_path_factory.mktemp('native'), BUNDLE)
    program_of(path)
    return path


def of_launch(folder: Path, spec: Path) -> Sequence[str]:
    """Return arguments as launch gives them: the parameters are in a file."""
    file = folder / 'parameters.yaml'
    file.write_text(f'/**:\n  ros__parameters:\n    spec: {spec}\n    native: true\n'
                    '    autostart: true\n', encoding='utf-8')
    return ('-r', '__ns:=/robot', '-r', 'x:=/speed', '--params-file', str(file))


def of_line(folder: Path, spec: Path) -> Sequence[str]:
    return ('-p', f'spec:={spec}', *NATIVE, '-r', '__ns:=/robot', '-r', 'x:=/speed')


def is_native(node: NodeProcess, spec: Path) -> bool:
    return os.readlink(f'/proc/{node.process.pid}/exe') == program_of(spec)


@pytest.mark.parametrize(('arguments', 'number'), [
    (of_line, signal.SIGINT), (of_launch, signal.SIGTERM)])
def test_the_process_becomes_the_node_in_c_with_its_names_and_ends_well(
    bundle: Path, tmp_path: Path, partner: Partner,
    arguments: Callable[[Path, Path], Sequence[str]], number: signal.Signals,
) -> None:
    announced: list[Empty] = []
    partner.node.create_subscription(
        Empty, '/robot/copilot/handlerpropR1', announced.append, RELIABLE)
    speed = partner.publisher(Float32, '/speed')
    with started('monitor', *arguments(tmp_path, bundle)) as node:
        assert is_native(node, bundle)
        assert f'({bundle}, native)' in node.output and 'ignored' not in node.output
        assert ("not monitored here: the gate 'kept' judges KEPT. Run it: ros2 run fret_monitor "
                f'gate --ros-args -p spec:={bundle}\n') in node.output
        partner.wait_for_listener(speed)
        wait_until(lambda: partner.node.count_publishers('/robot/copilot/handlerpropR1') == 1,
                   'the handler')
        speed.publish(Float32(data=1.0))
        wait_until(lambda: bool(announced), 'the violation')
        node.wait_for('R1 violated')
        assert node.end(number) == 0
        assert 'Traceback' not in node.output


@pytest.mark.parametrize('number', ['SIGINT', 'SIGTERM'])
def test_a_signal_before_the_node_in_c_handles_signals_ends_it_well(
    bundle: Path, domain: int, number: str,
) -> None:
    program_of(bundle)
    start = START.format('monitor').replace('import sys; ', f"""
import os, signal, sys
become = os.execv
def execv(*arguments):
    os.kill(os.getpid(), signal.{number})
    become(*arguments)
os.execv = execv
""")
    done = subprocess.run(
        [sys.executable, '-c', start, '--ros-args', '-p', f'spec:={bundle}', *NATIVE],
        capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert done.returncode == 0 and f'({bundle}, native)' in done.stderr


def test_it_is_a_lifecycle_node_that_ends_at_once_when_it_is_killed(
    bundle: Path, partner: Partner,
) -> None:
    node = NodeProcess('monitor', '-p', f'spec:={bundle}', *NATIVE, '-p', 'autostart:=false', '-p',
                       'use_sim_time:=true')
    try:
        node.wait_for('waiting to be configured and activated')
        assert is_native(node, bundle)
        client = partner.node.create_client(ChangeState, '/fret_monitor/change_state')
        for transition in (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE):
            assert change_state(client, transition)
        node.wait_for('watching')
        wait_until(lambda: partner.node.count_subscribers('/clock') == 1, 'the time of /clock')
        assert node.end(signal.SIGKILL) == -signal.SIGKILL
    finally:
        node.kill()


def test_another_value_of_a_constant_is_another_program_and_a_change_of_the_bundle_too(
    bundle: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    first = program_of(bundle)
    assert not capsys.readouterr().err
    modified = Path(first).stat().st_mtime_ns
    assert program_of(bundle, '-p', 'constants.limit:=0.25') != first
    assert (f'[fret_monitor]: compiling the node in C for {bundle}; later starts reuse it'
            in capsys.readouterr().err)
    assert program_of(bundle) == first and Path(first).stat().st_mtime_ns == modified
    assert program_of(write_bundle(tmp_path, BUNDLE.replace('R1', 'R2'))) != first


def test_a_node_that_cannot_be_native_runs_in_python_and_says_why(
    bundle: Path, tmp_path: Path, domain: int,
) -> None:
    folder = tmp_path / 'compiled'
    write(generate_monitor(read(bundle, part=UNGATED)), folder)
    with started('monitor', '-p', f'library:={folder}', *NATIVE) as node:
        node.wait_for('native is not possible, the node runs in Python: the node in C is '
                      'built from the bundle, not from a folder of `compile`: give spec alone')
        assert not is_native(node, bundle)


GATES = """
format: 1
evaluation: {policy: relevant_message}
inputs:
  speed: {topic: raw, type: std_msgs/msg/Float32}
""" + ARM_INPUT + """\
requirements:
  - {id: SLOW, ptltl: "speed <= 1.0"}
  - {id: ARM, ptltl: "!data"}
gates:
  drive: {from: raw, to: out, type: std_msgs/msg/Float32, keep: [SLOW]}
""" + ARM_GATE


def test_a_gate_on_a_topic_becomes_native(
    partner: Partner, tmp_path: Path, no_exec: pytest.MonkeyPatch,
) -> None:
    spec = write_bundle(tmp_path, GATES)

    def reason(*more: str) -> str:
        return become_native(['gate', '--ros-args', '-p', f'spec:={spec}', *NATIVE, *more], GATE)

    assert reason('-p', 'gates:=none') == ''  # the node in Python reports it
    drive = ('-p', 'gates:=drive')
    program = program_of(spec, *drive, node=GATE)  # built before the node is waited for
    with started('gate', '-p', f'spec:={spec}', *NATIVE, *drive) as node:
        node.wait_for("gate 'drive': /raw -> /out, keeps SLOW; otherwise nothing is sent")
        assert os.readlink(f'/proc/{node.process.pid}/exe') == program
        received: list[float] = []

        def receive(message: Any) -> None:
            received.append(message.data)

        partner.node.create_subscription(Float32, '/out', receive, RELIABLE)
        raw = partner.publisher(Float32, '/raw', RELIABLE)

        def passes(value: float) -> bool:
            raw.publish(Float32(data=value))
            return value in received

        wait_until(lambda: passes(0.5), 'a message')  # until all have matched
        raw.publish(Float32(data=1.5))
        wait_until(lambda: passes(0.75), 'the last message')
        assert 1.5 not in received


def test_a_bundle_without_gates_is_refused_by_the_node_gate_native_or_not(
    bundle: Path, tmp_path: Path, no_exec: pytest.MonkeyPatch, partner: Partner,
) -> None:
    other = write_bundle(tmp_path, BUNDLE.partition('gates:')[0], 'other.yaml')
    for more, missing in (('', 'no gates'), ('kept', 'none of the gates kept')):
        given = [Parameter('spec', value=[str(bundle), str(other)]),
                 *([Parameter('gates', value=[more])] if more else [])]
        with pytest.raises(Refusal, match=f"'{other}' has {missing}: leave it out"):
            GateNode(context=partner.context, parameter_overrides=given)
        arguments = ['gate', '--ros-args', *NATIVE, '-p', f'spec:=["{bundle}", "{other}"]']
        assert become_native(
            [*arguments, *(['-p', f'gates:={more}'] if more else [])], GATE) == ''


@pytest.fixture
def no_exec(monkeypatch: pytest.MonkeyPatch) -> Iterator[pytest.MonkeyPatch]:
    def fail(*_: Any) -> None:
        raise AssertionError('it becomes native')

    monkeypatch.setattr(os, 'execv', fail)
    yield monkeypatch


def reason_of(*arguments: str) -> str:
    return become_native(['monitor', '--ros-args', *NATIVE, *arguments])


def test_reasons_not_to_be_native(bundle: Path, no_exec: pytest.MonkeyPatch) -> None:
    spec = f'spec:={bundle}'
    assert reason_of('-p', f'spec:=["{bundle}", "{bundle}"]') == ''  # of one handler: refused
    assert 'not from a folder' in reason_of('-p', 'library:=/nowhere')
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv('CC', '/nowhere/cc')
        assert '/nowhere/cc' in reason_of('-p', spec)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv('ROS_HOME', '/dev/null/home')  # root may write to any folder
        assert '/dev/null/home/fret_monitor cannot be written' in reason_of('-p', spec)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ros_files, 'prefixes', lambda: [Path('/nowhere')])
        patch.setattr(cache, 'is_kept', lambda library: False)
        assert reason_of('-p', spec) == 'the headers of rcl are not installed here'


def test_what_is_recalled_needs_neither_cffi_nor_rclpy(bundle: Path) -> None:
    program_of(bundle)
    code = """
import os, sys
slow = {'_cffi_backend', 'rclpy', 'logging', 'tempfile', 'yaml'}
os.execv = lambda *_: print(*slow & {*sys.modules})
from fret_monitor.ros.native_start import become_native
assert become_native(sys.argv) is None
"""
    done = subprocess.run(
        [sys.executable, '-c', code, '--ros-args', '-p', f'spec:={bundle}', *NATIVE],
        capture_output=True, text=True, timeout=PATIENCE, check=True)
    assert done.stdout == '\n'


def test_mistakes_of_the_user_are_left_to_the_node_in_python(
    bundle: Path, tmp_path: Path, no_exec: pytest.MonkeyPatch,
) -> None:
    broken = write_bundle(tmp_path, BUNDLE.replace('value < limit', 'value <'))
    for arguments in ((), ('-p', 'spec:=/nowhere.yaml'), ('-p', f'spec:={broken}'),
                      ('-p', f'spec:={bundle}', '-p', 'policy:=none'), ('-p', 'spec'),
                      ('-p', 'spec:={')):
        assert reason_of(*arguments) == ''
    assert become_native(['monitor', '--ros-args', '-p', f'spec:={bundle}']) == ''
    assert become_native(['monitor', '--help', '--ros-args', *NATIVE]) == ''


@pytest.mark.parametrize('value', ['maybe', '1', '2.5'])
def test_a_value_that_is_neither_true_nor_false_is_refused(
    bundle: Path, domain: int, no_exec: pytest.MonkeyPatch, value: str,
) -> None:
    arguments = ('-p', f'spec:={bundle}', '-p', 'autostart:=false', '-p', f'native:={value}')
    assert become_native(['monitor', '--ros-args', *arguments]) == ''
    shown = f"'{value}'" if value == 'maybe' else value
    assert NodeProcess('monitor', *arguments).error() == \
        f"error: parameter 'native' is {shown}, and has to be true or false\n"


@pytest.mark.parametrize(('name', 'node'), [('monitor', MONITOR), ('gate', GATE)])
def test_the_names_that_are_offered_for_an_unknown_parameter_are_the_same_native_or_not(
    bundle: Path, domain: int, name: str, node: str,
) -> None:
    program = program_of(bundle, node=node)
    arguments = ['-p', f'spec:={bundle}', *(
        word for wrong in ('polcy', 'frame_id', 'spek', 'gats', 'rte', 'natve', 'handler_dept')
        for word in ('-p', f'{wrong}:=1'))]
    with started(name, *arguments) as one, started(name, *arguments, *NATIVE) as other:
        assert os.readlink(f'/proc/{other.process.pid}/exe') == program
        python, native = (
            re.findall('ignored parameter .*', process.output) for process in (one, other))
    assert python == native and len(python) == 7
    assert "'polcy': did you mean 'policy'" in python[0]


NUMBERS = ('handler_depth', 'blackbox_seconds', 'blackbox_bytes', 'blackbox_files',
           'blackbox_disk_bytes')
REFUSED = {'': 'refused'}
OWN = 'fret_monitor'


def of_rclpy(arguments: Sequence[str]) -> Mapping[str, object]:
    """Return the values that are given to a node of rclpy."""
    context = Context()
    try:
        rclpy.init(args=['monitor', *arguments], context=context)
        node = Node(OWN, context=context, enable_rosout=False, start_parameter_services=False)
    except (_rclpy.RCLError, _rclpy.UnknownROSArgsError):
        return REFUSED
    found = {name: item.value for name, item in node._parameter_overrides.items()}
    node.destroy_node()
    context.shutdown()
    return found


def as_arguments(arguments: Sequence[str]) -> Mapping[str, object]:
    """Return the same, as it is read to decide whether a process becomes the node in C."""
    try:
        return given_parameters(arguments, OWN)
    except NotUnderstood:
        return REFUSED


def in_c(program: str, arguments: Sequence[str]) -> Mapping[str, str]:
    """Return the same from what the node in C prints, which refuses all values given here."""
    done = subprocess.run([program, *arguments, '-p', 'priority:=-1'], capture_output=True,
                          text=True, timeout=PATIENCE, check=False)
    assert done.returncode == 1
    found = dict(re.findall("parameter '(.*)' is (.*), and has to be", done.stderr))
    return found if found.pop('priority', None) == '-1' else REFUSED


def shown(values: Mapping[str, object]) -> Mapping[str, str]:
    """Return values as the node in C prints them."""
    def text(value: object) -> str:
        return str(value).lower() if isinstance(value, bool) else \
            repr(value) if isinstance(value, int | float | str) else 'a list'

    return {name: text(value) for name, value in values.items()} if values != REFUSED else REFUSED


def to(name: str, *values: object) -> str:
    """Return a line of a file that gives a node, by a name with wildcards, values of `NUMBERS`."""
    pairs = ', '.join(f'{number}: {value}' for number, value in zip(NUMBERS, values))
    return f'{name}: {{ros__parameters: {{{pairs}}}}}\n'


def to_each(*names: str) -> str:
    """Return lines of a file that give each name another parameter."""
    return ''.join(f'{name}: {{ros__parameters: {{{number}: -1}}}}\n'
                   for name, number in zip(names, NUMBERS, strict=True))


IN_A_B = '-r __ns:=/a/b'
# Arguments, and files of parameters.
ENTRIES: Sequence[Sequence[str]] = [
    # The values of a name in several files and arguments have the place where it is first.
    [to('/**', -1, -1) + to(OWN, -2)], [to(OWN, -2) + to('/**', -1)],
    [to('/**', -1), to(OWN, -2)], [to(OWN, -2), to('/**', -1)],
    [to('/**', -1), to(OWN, -2), to('/**', -3, -3)], [to(OWN, -2), '-p handler_depth:=-1'],
    ['-p handler_depth:=-1', to(OWN, -2)], [to('/**', -1) + to(OWN, -2), '-p handler_depth:=-3'],
    ['-p fret_monitor:handler_depth:=-1', to('/**', -2, -2), '--param other:blackbox_bytes:=-1'],
    # Names after remapping: the first rule counts, and a rule may be for another node.
    ['-r __node:=n -p n:handler_depth:=-1 -p fret_monitor:handler_depth:=-2'],
    ['-r __node:=n --remap __name:=m', to('n', -1) + to('m', -2)],
    ['-r other:__node:=n', to('n', -1) + to(OWN, -2)],
    ['-r fret_monitor:__ns:=/a', to('/a/*', -1)],
    ['-r __node:=n -r fret_monitor:__ns:=/a', to('/a/n', -1) + to('/n', -2)],
    ['-r __ns:=/a -p fret_monitor:handler_depth:=-1'],
    ['-r __ns:=/a -r __ns:=/b', to('/a/*', -1) + to('/b/*', -2)],
    # Wildcards are whole parts of names.
    [IN_A_B, to_each('/a/b/fret_monitor', 'a/b/fret_monitor', OWN, '/fret_monitor', '*')],
    [IN_A_B, to_each('/*', '**', '/**', '/*/*/*', '/*/fret_monitor')],
    [IN_A_B, to_each('/**/fret_monitor', '/a/**', '/a/b/fret_monitor/**', '/**/b/**', '/**/c/**')],
    [IN_A_B, to_each('/a/b/fret_monitor/**/**', '/a/*/fret_monitor', '/a/b/fret_monitor/*',
                     '/a/**/**/*', '/a/b')],
    [IN_A_B, f'a: {{b: {{{to(OWN, -1)}}}}}'], [IN_A_B, f'/a: {{/b: {{/{to(OWN, -1)}}}}}'],
    [IN_A_B, f'/a/*: {{{to("*", -1)}}}'],
    *([IN_A_B, to(name, -1)] for name in (
        '/a/b/fret_*', '/a/b*/fret_monitor', '/a//fret_monitor', '/a/b/')),
    # What a value means.
    [to(OWN, '-0x10', '-010', '-1_0', '-1e3', '-.5')], [to(OWN, '-.inf', '-inf', 'y', 'No', 'on')],
    [to(OWN, 'null', '"~"', '~', '2024-01-01', '"-1"')],
    [to(OWN, "'on'", '!!str -1', '!!int "1"', '0b11', '-1:30')],
    [to(OWN, '[a, b]', '[1, 2]', '[true]', '[[1]]', '""')],
    ['-p handler_depth:=[0.5] -p blackbox_bytes:=1e400 -p blackbox_files:=a:=b'],
    *([f'-p handler_depth:={value}'] for value in ('{', '')),
    *([to(OWN, value)] for value in ('[1, a]', '')),
    # What is refused, and what is not for nodes.
    ['-p handler_depth'], ['-p'], ['-r x'], ['--params-file /nowhere'], ['--unknown'],
    ['--log-level info --disable-rosout-logs -e /e -p handler_depth:=-1'], ['handler_depth: 1']]


@pytest.mark.parametrize('given', ENTRIES, ids=str)
def test_both_nodes_and_what_chooses_one_take_the_values_that_rclpy_gives_a_node(
    bundle: Path, tmp_path: Path, domain: int, given: Sequence[str],
) -> None:
    arguments = ['--ros-args']
    for k, item in enumerate(given):
        file = tmp_path / f'{k}.yaml'
        file.write_text(item, encoding='utf-8')
        arguments += item.split(' ') if item.startswith('-') else ['--params-file', str(file)]
    wanted = shown(of_rclpy(arguments))
    assert shown(as_arguments(arguments)) == wanted
    assert in_c(program_of(bundle), arguments) == wanted


def test_lists_are_given_and_other_arguments_are_left_to_the_node_in_python() -> None:
    assert given_parameters(['--ros-args', '-p', 'a:=[u, v]', '-p', 'b:=[1]', '--'], MONITOR) == {
        'a': ['u', 'v'], 'b': [None]}
    for wrong in (['-p', 'a:=1'], ['--ros-args', '--', 'x']):
        with pytest.raises(NotUnderstood):
            given_parameters(wrong, MONITOR)


@pytest.mark.parametrize(('name', 'given'), [
    ('monitor', ['-p', 'native:=true', '-p', 'handler_depth:=3']), ('gate', []), ('logger', [])])
def test_values_of_several_types_are_refused_since_the_last_need_not_count(
    tmp_path: Path, domain: int, name: str, given: Sequence[str],
) -> None:
    file = tmp_path / 'depth.yaml'
    file.write_text('/**: {ros__parameters: {handler_depth: 5}}\n', encoding='utf-8')
    said = NodeProcess(name, *given, '--params-file', str(file), '-p', 'handler_depth:=x').error()
    assert said.startswith("error: parameter 'handler_depth' is given values of several types")
