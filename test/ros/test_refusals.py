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

"""A node that refuses to start: all problems on one screen, status 1, nothing left behind."""

from collections.abc import Iterator
from pathlib import Path
import sys

from bundles import write_bundle
import fret_monitor
from fret_monitor import build
from fret_monitor.model.bundle_files import config_folders, find_bundle
from fret_monitor.ros.nodes.logger_node import LoggerNode
from fret_monitor.ros.nodes.monitor_node import MonitorNode
import pytest
from rclpy.context import Context
from rclpy.parameter import Parameter
from ros.harness import make_node, NodeProcess, Partner, refusal, started, without_interface_number

BUNDLE = """
format: 1
inputs:
  x: {topic: x, type: std_msgs/msg/Float32}
  y: {topic: y, type: std_msgs/msg/Int32}
requirements:
  - {id: R1, ptltl: x < 0.5 & y > 3}
"""
CONFIG = Path(fret_monitor.__file__).parents[1] / 'config'
WRONG = BUNDLE.replace('y > 3', 'z > 3')


@pytest.fixture
def context(partner: Partner) -> Iterator[Context]:
    """Return a context and check that no node of ours is left in it in the end."""
    yield partner.context
    assert partner.node.get_node_names() == ['partner']


def write(folder: Path, text: str = BUNDLE, name: str = 'bundle.yaml') -> Path:
    return write_bundle(folder, text, name)


def test_nothing_to_monitor_is_reported_with_the_parameters_to_write(context: Context) -> None:
    assert refusal(context) == (
        'error: nothing to monitor: name a bundle with -p spec:=FILE, '
        'or a compiled one with -p library:=FOLDER')


def test_all_problems_of_the_parameters_are_reported_together(context: Context) -> None:
    told = refusal(context, spec=12, policy='sometimes', period=-1, rate='often',
                   hot_path='perhaps')
    assert told.splitlines() == [
        "error: parameter 'spec' is 12, and has to be a path or a list of paths; quote it: "
        "-p 'spec:=\"12\"'",
        "error: parameter 'policy' is 'sometimes', and has to be one of every_message, "
        'relevant_message, all_inputs, periodic, timed',
        "error: parameter 'period' is -1, and has to be a number above 0 (seconds, say 0.1)",
        "error: parameter 'rate' is 'often', and has to be a number above 0 "
        '(steps a second, say 10.0)',
        "error: parameter 'hot_path' is 'perhaps', and has to be one of auto, on, off"]


def test_parameters_read_at_the_start_are_refused_at_the_start(context: Context) -> None:
    assert refusal(context, spec='x', autostart='perhaps', log_level='loud').splitlines() == [
        "error: parameter 'autostart' is 'perhaps', and has to be true or false",
        "error: parameter 'log_level' is 'loud', and has to be one of debug, info, warn, error, "
        'fatal']


def test_an_empty_list_of_bundles_is_nothing_to_monitor(context: Context) -> None:
    assert 'nothing to monitor' in refusal(context, spec=[])
    assert "parameter 'spec' is ['a.yaml', ''], and has to be a path or a list of paths" \
        in refusal(context, spec=['a.yaml', ''])


@pytest.mark.parametrize(('name', 'value'), [
    ('period', float('inf')), ('period', float('nan')), ('rate', -2), ('rate', True)])
def test_a_period_is_a_number_above_zero(context: Context, name: str, value: object) -> None:
    assert 'has to be a number above 0' in refusal(context, spec='x', **{name: value})


def test_period_and_rate_do_not_go_together(context: Context) -> None:
    assert 'give one of them' in refusal(context, spec='x', period=0.1, rate=10)


def test_a_period_needs_the_policy_periodic_and_the_policy_needs_a_period(
    context: Context, tmp_path: Path,
) -> None:
    bundle = str(write(tmp_path))
    for given in ({'period': 0.1}, {'rate': 10}):
        told = refusal(context, spec=bundle, **given)
        assert 'a period or a rate goes with the policy periodic, not with every_message' in told
        assert '-p policy:=periodic' in told
    assert 'the policy periodic needs a period' in refusal(
        context, spec=bundle, policy='periodic')


def test_a_missing_bundle_is_reported_by_its_name(context: Context, tmp_path: Path) -> None:
    assert refusal(context, spec='no.yaml') == (
        f"error: there is no file 'no.yaml' in "
        f'{" nor in ".join(map(str, [Path.cwd(), *config_folders()]))}')
    assert config_folders()[0] == CONFIG
    assert refusal(context, spec='amr.yaml').endswith("= help: did you mean 'arm.yaml'?")
    deep = '/'.join([str(tmp_path), *['folder'] * 30, 'no.yaml'])
    assert refusal(context, spec=deep) == f"error: there is no file '{deep}'"


def test_a_bundle_of_this_package_is_found_by_its_name(
    context: Context, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert find_bundle('quadrotor.yaml') == CONFIG / 'quadrotor.yaml'
    assert find_bundle('package://fret_monitor/config/arm.yaml') == CONFIG / 'arm.yaml'
    write(tmp_path, name='quadrotor.yaml')
    assert find_bundle('quadrotor.yaml') == Path('quadrotor.yaml'), 'the nearer one'
    assert find_bundle('config/arm.yaml') == Path('config/arm.yaml'), 'only a name is looked up'


def test_a_bundle_of_another_package_is_found_in_its_share_folder(
    context: Context, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    share = tmp_path / 'share' / 'my_robot'
    (share / 'config').mkdir(parents=True)
    bundle = write(share / 'config')
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'{tmp_path / "empty"}:{tmp_path}')
    assert find_bundle(f'package://my_robot/config/{bundle.name}') == bundle
    assert refusal(context, spec='package://my_robot/no.yaml') == (
        f"error: 'package://my_robot/no.yaml': there is no file 'no.yaml' in {share}")
    assert refusal(context, spec=f'package://my_robot/config/{bundle.stem}s.yaml').endswith(
        f"= help: did you mean '{bundle.name}'?")
    assert refusal(context, spec='package://your_robot/no.yaml') == (
        "error: 'package://your_robot/no.yaml': the package 'your_robot' is not installed, or its "
        'workspace is not sourced')
    (share / 'package.xml').write_text('<package/>', encoding='utf-8')
    assert refusal(context, spec='package://my_robt/no.yaml').endswith(
        "= help: did you mean 'my_robot'?")
    assert 'help' not in refusal(context, spec='package://robot_monitor/no.yaml')


@pytest.mark.parametrize('inside', ['my_robot/../../secret', 'my_robot//{outside}',
                                    'my_robot/config/../../../secret', '../secret', './../secret'])
def test_a_path_that_leaves_the_share_folder_of_its_package_is_not_read(
    inside: str, context: Context, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    (tmp_path / 'share' / 'my_robot' / 'config').mkdir(parents=True)
    (tmp_path / 'secret').write_text('password: 12345\n', encoding='utf-8')
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(tmp_path))
    said = refusal(context, spec='package://' + inside.format(outside=tmp_path / 'secret'))
    assert 'password' not in said
    assert "is not in the share folder of 'my_robot'" in said or 'is not installed' in said


def test_a_link_in_a_share_folder_is_followed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    # `colcon build --symlink-install` fills share folders with links to the sources.
    share = tmp_path / 'share' / 'my_robot'
    share.mkdir(parents=True)
    (share / 'robot.yaml').symlink_to(write(tmp_path))
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(tmp_path))
    assert find_bundle('package://my_robot/robot.yaml') == share / 'robot.yaml'


def test_several_bundles_in_one_string_are_refused_with_a_list(context: Context) -> None:
    assert refusal(context, spec='a.yaml,b.yaml') == (
        "error: there is no file 'a.yaml,b.yaml'; for several bundles: "
        '-p spec:="[a.yaml, b.yaml]"')


def test_a_wrong_bundle_is_reported_as_by_check(context: Context, tmp_path: Path) -> None:
    bundle = write(tmp_path, WRONG)
    told = refusal(context, spec=bundle)
    assert told.startswith(f'{bundle}:7:31: error: ')
    assert '^' in told


def test_inputs_without_a_topic_are_refused_with_the_lines_to_write(
    context: Context, tmp_path: Path,
) -> None:
    bundle = write(tmp_path, """
format: 1
inputs:
  x: {type: uint8}
  y: {type: std_msgs/msg/Int32}
  z: {topic: z, type: std_msgs/msg/Bool}
  w: {topic: w, type: float64}
requirements:
  - {id: R1, ptltl: x < 5 & y > 3 & z & w < 0.5}
""")
    assert refusal(context, spec=bundle).splitlines()[1:] == [
        '', '  inputs:',
        '    x:', '      topic: x', '      type: std_msgs/msg/UInt8',
        '    y:', '      topic: y', '      type: std_msgs/msg/Int32',
        '    w:', '      topic: w', '      type: std_msgs/msg/Float64']


def test_transforms_need_the_package_of_their_messages(
        context: Context, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, 'tf2_msgs.msg', None)
    bundle = write(tmp_path, """
format: 1
inputs:
  x: {transform: {from: map, to: base}, field: translation.x}
  old: {transform: {from: map, to: base}, field: age()}
requirements:
  - {id: R1, ptltl: x < 5.0 & old < 1.0}
""")
    assert refusal(context, spec=bundle) == (
        "error: message type tf2_msgs/msg/TFMessage of the package 'tf2_msgs' is not installed "
        'here: source the workspace that has it')


def test_topics_remapped_to_one_name_are_refused(context: Context, tmp_path: Path) -> None:
    told = refusal(context, '-r', 'y:=x', spec=write(tmp_path))
    assert told.startswith("error: 'x' and 'y' are both remapped to /x; ")
    handler = 'copilot/handlerpropR1'
    assert refusal(context, '-r', f'{handler}:=x', spec=write(tmp_path)).startswith(
        f"error: 'x' and '{handler}' are both remapped to /x; what the node announces")


@pytest.mark.parametrize(('rule', 'first', 'own'), [
    ('copilot/handlerpropR1:=/diagnostics', 'copilot/handlerpropR1', '/diagnostics'),
    ('copilot/violations:=/diagnostics', 'copilot/violations', '/diagnostics'),
    ('copilot/handlerpropR1:=fret_monitor/alive', 'copilot/handlerpropR1', '~/alive'),
    ('copilot/handlerpropR1:=/rosout', 'copilot/handlerpropR1', '/rosout'),
    ('x:=/diagnostics', 'x', '/diagnostics'),
    ('~/alive:=/x', 'x', '~/alive'),
    ('~/alive:=/diagnostics', '/diagnostics', '~/alive')])
def test_a_topic_of_the_node_itself_is_not_used_for_anything_else(
    rule: str, first: str, own: str, context: Context, tmp_path: Path,
) -> None:
    told = refusal(context, '-r', rule, spec=write(tmp_path))
    assert told.startswith(f"error: '{first}' and the node's own '{own}' are both remapped to /")


def test_inputs_are_read_from_topics_of_the_node_itself(context: Context, tmp_path: Path) -> None:
    bundle = write(tmp_path, """
format: 1
inputs:
  sign: {topic: sign, type: std_msgs/msg/Header, field: stamp.sec}
  level: {topic: status, type: diagnostic_msgs/msg/DiagnosticArray, field: "status[0].level"}
requirements:
  - {id: R, ptltl: sign > 0 & level < 2}
""")
    MonitorNode(
        context=context, parameter_overrides=[Parameter('spec', value=str(bundle))],
        cli_args=['--ros-args', '-r', 'sign:=fret_monitor/alive', '-r', 'status:=/diagnostics'],
    ).destroy_node()


def test_a_working_directory_that_was_deleted_is_needed_for_relative_paths_alone(
    context: Context, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    bundle = str(write(tmp_path))
    for _ in range(2):  # built, and found as it was built
        (tmp_path / 'gone').mkdir()
        monkeypatch.chdir(tmp_path / 'gone')
        (tmp_path / 'gone').rmdir()
        make_node(MonitorNode, context, spec=bundle).destroy_node()
    assert refusal(context, spec='none.yaml').startswith(
        "error: there is no file 'none.yaml' in the current folder (it was deleted) nor in /")
    assert refusal(context, spec=bundle, blackbox='box') == (
        "error: parameter 'blackbox' is 'box', in a working directory that was deleted: give the "
        'whole path')
    monkeypatch.chdir(tmp_path)


def compiled(folder: Path, text: str = BUNDLE) -> str:
    bundle = write(folder, text)
    build.write(build.generate_monitor(build.read(bundle)), folder / 'library')
    return str(folder / 'library')


def test_a_folder_without_a_compiled_bundle_is_refused(context: Context, tmp_path: Path) -> None:
    assert 'holds no compiled bundle' in refusal(context, library=tmp_path)


def test_bundles_and_compiled_folders_are_not_mixed_up(context: Context, tmp_path: Path) -> None:
    library = compiled(tmp_path)
    bundle = tmp_path / 'bundle.yaml'
    assert refusal(context, spec=library) == (
        f"error: '{library}' is a directory: for a compiled bundle, -p library:={library}")
    assert refusal(context, library=bundle) == (
        f"error: '{bundle}' is a file, and not the folder of a compiled bundle; "
        f'for a bundle: -p spec:={bundle}')
    assert refusal(context, library=bundle, spec=bundle) == (
        f"error: '{bundle}' is a file, and not the folder of a compiled bundle")
    assert refusal(context, spec=tmp_path) == (
        f"error: '{tmp_path}' is a directory, not a file")


def test_a_library_of_another_bundle_is_refused(context: Context, tmp_path: Path) -> None:
    library = compiled(tmp_path)
    bundle = write(tmp_path, BUNDLE.replace('0.5', '0.6'))
    told = refusal(context, library=library, spec=bundle)
    assert 'was not compiled from' in told
    assert f'fret-monitor compile {bundle} --output {library}' in told


def test_a_library_that_does_not_fit_its_manifest_is_refused(
    context: Context, tmp_path: Path,
) -> None:
    library = Path(compiled(tmp_path))
    manifest = library / 'manifest.json'
    manifest.write_text(manifest.read_text().replace('"id": "R1"', '"id": "R2"'))
    assert "requirement 0 is 'R1' instead of 'R2'" in refusal(context, library=library)


def test_folders_compiled_by_an_earlier_version_are_refused_together(
    context: Context, tmp_path: Path,
) -> None:
    folders = []
    for name in ('first', 'second'):
        (tmp_path / name).mkdir()
        folder = compiled(tmp_path / name, BUNDLE.replace('R1', name))
        without_interface_number(Path(folder) / 'libfm_evaluator.so')
        folders.append(folder)
    assert refusal(context, library=folders).splitlines() == [
        f'error: {folder}/libfm_evaluator.so was compiled by an earlier version of '
        'fret_monitor: compile the bundle again' for folder in folders]


def test_changes_that_need_a_new_compilation_are_refused(context: Context, tmp_path: Path) -> None:
    library = compiled(tmp_path)
    assert 'with that policy in the bundle' in refusal(
        context, library=library, policy='periodic', period=1.0)
    assert 'the period is compiled into the bundle' in refusal(
        context, library=library, period=1.0)


def test_a_message_type_that_is_not_installed_is_refused(context: Context, tmp_path: Path) -> None:
    library = Path(compiled(tmp_path))
    manifest = library / 'manifest.json'
    manifest.write_text(manifest.read_text().replace('std_msgs/msg/Int32', 'my_msgs/msg/Int32'))
    assert refusal(context, library=library).startswith(
        "error: message type my_msgs/msg/Int32 of the package 'my_msgs' is not installed here: ")


def test_the_logger_refuses_what_the_monitor_does(context: Context, tmp_path: Path) -> None:
    assert 'error: ' in refusal(context, kind=LoggerNode, spec=write(tmp_path, WRONG))


@pytest.mark.parametrize('name', ['monitor', 'logger'])
@pytest.mark.parametrize(('arguments', 'told'), [
    (['-p', 'spec:=no.yaml'], 'error: '),
    (['-p', 'spec'], "error: Failed to parse ROS arguments: Couldn't parse parameter"),
    (['-p', 'spec=no.yaml'], '; write -p spec:=no.yaml\nusage: '),
    (['--', 'bundle.yaml'], "error: unexpected argument 'bundle.yaml'\nusage: "),
    (['-p', 'use_sim_time:=1'], "error: parameter 'use_sim_time' is 1, and has to be true or "
                                'false\n'),
    (['-p', 'use_sim_time:=a b'], "error: parameter 'use_sim_time' is 'a b', and has to be true "
                                  'or false\n'),
    (['--sepc'], "error: unknown ROS arguments ['--sepc']\n"),
    (['spec:=x y'], "error: unknown ROS arguments ['spec:=x y']: a parameter has -p before it: "
                    "-p 'spec:=x y'\n"),
    (['-r', '~/get_parameters:=~/set_parameters'],
     'error: two services of this node have the name /fret_'),
])
def test_a_process_that_refuses_ends_with_status_one_and_a_clear_message(
    name: str, arguments: list[str], told: str, domain: int, tmp_path: Path,
) -> None:
    output = NodeProcess(name, *arguments, folder=tmp_path).error()
    assert told in output and 'Traceback' not in output


@pytest.mark.parametrize('name', ['monitor', 'logger'])
def test_without_a_log_folder_it_names_the_variable_to_set(
    name: str, domain: int, tmp_path: Path,
) -> None:
    (tmp_path / 'file').write_text('', encoding='utf-8')
    node = NodeProcess(name, '-p', f'spec:={write(tmp_path)}', folder=tmp_path, environment={
        'HOME': str(tmp_path / 'file'), 'ROS_HOME': '', 'ROS_LOG_DIR': ''})
    output = node.error()
    assert output.startswith(
        'error: ROS cannot make its folder of logs: set HOME, or ROS_LOG_DIR to a folder '
        'that can be written (failed to initialize logging: ')
    assert 'Traceback' not in output


def test_an_unwritable_cache_is_reported_once_with_the_remedy(domain: int, tmp_path: Path) -> None:
    (tmp_path / 'file').write_text('', encoding='utf-8')
    home = tmp_path / 'file' / 'ros'
    compiler = tmp_path / 'cc'  # what is built for this run only takes long to optimise
    compiler.write_text('#!/bin/sh\nexec gcc "$@" -O0\n', encoding='utf-8')
    compiler.chmod(0o755)
    with started('monitor', '-p', f'spec:={write(tmp_path)}', folder=tmp_path,
                 environment={'ROS_HOME': str(home), 'CC': str(compiler)}) as node:
        told = [line for line in node.output.splitlines() if 'cannot be written' in line]
        assert told == [
            f'warning: {home}/fret_monitor cannot be written (Not a directory): the library is '
            'built for this run only, and every start will compile again: make it writable, '
            'make room, or set ROS_HOME to another folder']
