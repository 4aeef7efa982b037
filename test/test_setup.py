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

"""`make setup` on a machine that lacks something: one sentence, and what to install."""

import ast
from collections.abc import Callable
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys

import pytest

ROOT = Path(__file__).resolve().parent.parent
TOOLS = ('cat', 'cmp', 'cp', 'dirname', 'ln', 'ls', 'make', 'mkdir', 'rm', 'sed', 'sh', 'tr')

if not (ROOT / 'Makefile').is_file() or shutil.which('make') is None:
    pytest.skip('needs the source tree and make', allow_module_level=True)


@pytest.fixture
def machine(repository: Path, tmp_path: Path) -> Callable[..., 'subprocess.CompletedProcess[str]']:
    """Return a function that runs a target where only the given programs are installed."""
    def run(target: str, **programs: str) -> 'subprocess.CompletedProcess[str]':
        path = tmp_path / 'bin'
        path.mkdir(exist_ok=True)
        for tool in TOOLS:
            (path / tool).symlink_to(shutil.which(tool) or tool)
        for name, script in programs.items():
            program = path / name.replace('python3_12', 'python3.12')
            program.write_text(f'#!/bin/sh\n{script}\n', encoding='utf-8')
            program.chmod(0o755)
        return subprocess.run(
            ['make', '--no-print-directory', target], cwd=repository, text=True,
            capture_output=True, check=False, stdin=subprocess.DEVNULL,
            env={'PATH': str(path), 'HOME': str(tmp_path)})

    return run


def sentence(done: 'subprocess.CompletedProcess[str]') -> str:
    """Return the one line printed by a failed run, besides make's own."""
    assert done.returncode != 0
    lines = [line for line in f'{done.stdout}{done.stderr}'.splitlines()
             if not line.startswith(('make: ***', 'fret_monitor: making'))]
    assert len(lines) == 1, lines
    return lines[0]


@pytest.mark.parametrize('target', ['setup', 'demo', 'test'])
def test_without_a_compiler_it_says_what_to_install(
    target: str, machine: Callable[..., 'subprocess.CompletedProcess[str]'],
) -> None:
    said = sentence(machine(target, python3_12=f'exec {sys.executable} "$@"'))
    assert said.startswith('fret_monitor: no C compiler found: install one')


def test_without_python_it_says_what_to_install(
    machine: Callable[..., 'subprocess.CompletedProcess[str]'],
) -> None:
    said = sentence(machine('setup', cc='exit 0'))
    assert said.startswith('fret_monitor: no Python 3.12 found: install it')


def test_a_shim_that_finds_no_python_is_skipped(
    machine: Callable[..., 'subprocess.CompletedProcess[str]'],
) -> None:
    said = sentence(machine('setup', cc='exit 0', python3_12='exit 127', python3='exit 127'))
    assert said.startswith('fret_monitor: no Python 3.12 found: install it')


def test_a_python_without_ensurepip_gets_a_hint_of_its_own(
    machine: Callable[..., 'subprocess.CompletedProcess[str]'],
) -> None:
    # Debian's python3.12 without python3.12-venv has no ensurepip.
    said = sentence(machine('setup', cc='exit 0', python3_12=(
        f'case "$2" in *ensurepip*) exit 1;; esac; exec {sys.executable} "$@"')))
    assert 'sudo apt install python3.12-venv' in said


def test_a_failed_setup_leaves_nothing_behind(
    machine: Callable[..., 'subprocess.CompletedProcess[str]'], repository: Path,
) -> None:
    machine('setup', cc='exit 0', python3='exit 127')
    assert not os.path.lexists(repository / '.venv')


# In place of Python: makes an environment of itself alone, and installs nothing.
FAKE_PYTHON = 'case "$*" in "-m venv .venv") mkdir -p .venv/bin; cp "$0" .venv/bin/python;; esac'


def test_the_environment_is_a_prefix_in_which_ros2_run_and_ros2_launch_find_their_files(
    machine: Callable[..., 'subprocess.CompletedProcess[str]'], repository: Path,
) -> None:
    done = machine('setup', cc='exit 0', python3_12=FAKE_PYTHON)
    assert done.returncode == 0, f'{done.stdout}{done.stderr}'
    prefix = repository / '.venv'
    assert (prefix / 'share/ament_index/resource_index/packages/fret_monitor').is_file()
    scripts = re.findall(r"f'([a-z-]+) = {NAME}\.", (ROOT / 'setup.py').read_text('utf-8'))
    assert 'fret-monitor' in scripts
    assert {file.name: file.parent / file.readlink() for file in
            (prefix / 'lib/fret_monitor').iterdir()} == {
        name: prefix / 'lib/fret_monitor/../../bin' / name for name in scripts}
    # `ros2 launch` walks through the folder as here, without entering links.
    share = prefix / 'share/fret_monitor'
    found = {file: Path(folder) / file for folder, _, files in os.walk(share) for file in files}
    for file in (ROOT / 'launch').iterdir():
        if file.suffix == '.py':
            assert found[file.name].read_bytes() == file.read_bytes()
    for name in ('config/quadrotor.yaml', 'csrc/evaluator/evaluator.c', 'docs/ros.md',
                 'package.xml'):
        assert (share / name).read_bytes() == (ROOT / name).read_bytes()


def requirements(name: str) -> list[str]:
    """Return one list of requirements of setup.py."""
    script = ast.parse((ROOT / 'setup.py').read_text(encoding='utf-8'))
    [found] = [item.value for item in script.body
               if isinstance(item, ast.Assign) and ast.unparse(item.targets[0]) == name]
    return [str(item) for item in ast.literal_eval(found)]


def test_without_ros_all_common_messages_are_installed() -> None:
    names = {re.split('[<>=]', wheel)[0] for wheel in requirements('ROS_WHEELS')}
    assert names == {'ros-jazzy-common-interfaces', 'ros-jazzy-rclpy[fastrtps]'}


@pytest.mark.skipif('ROS_DISTRO' in os.environ, reason='the messages are those of a ROS')
@pytest.mark.parametrize('package', [
    'actionlib_msgs', 'diagnostic_msgs', 'geometry_msgs', 'nav_msgs', 'sensor_msgs', 'shape_msgs',
    'std_msgs', 'std_srvs', 'stereo_msgs', 'trajectory_msgs', 'visualization_msgs'])
def test_a_common_message_is_found_in_a_wheel_environment(package: str) -> None:
    folder = Path(sys.prefix) / 'share' / package
    if not (Path(sys.prefix) / 'share' / 'common_interfaces').is_dir():
        pytest.skip('an environment that was not made by `make setup`')
    assert any(folder.glob('*/*.msg')) or any(folder.glob('*/*.srv'))


def test_the_messages_of_the_examples_are_common_ones() -> None:
    examples = [*(ROOT / 'config').glob('*.yaml'), ROOT / 'docs' / 'bundle.md']
    used = {package for path in examples for package in re.findall(
        r'type: (\w+)/msg/', path.read_text(encoding='utf-8'))}
    assert {'nav_msgs', 'sensor_msgs', 'geometry_msgs'} <= used <= {
        'diagnostic_msgs', 'geometry_msgs', 'nav_msgs', 'sensor_msgs', 'std_msgs'}
