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
The package in a workspace: `colcon build`, then its executables as `ros2 run` starts them.

The underlay is the ROS 2 that runs the tests: a sourced installation, or the wheels.
"""

from collections.abc import Callable, Iterator, Mapping
import os
from pathlib import Path
import shlex
import shutil
import signal
import subprocess
import sys
import time

from bundles import write_bundle
import pytest
from strategies import some, thorough

rclpy = pytest.importorskip('rclpy')
pytest.importorskip('colcon_ros', reason='needs colcon')

if ' ' in sys.executable:
    pytest.skip('colcon cannot call a Python in a folder with a space in its name',
                allow_module_level=True)

NAME = 'fret_monitor'
BUNDLE = """\
format: 1
inputs:
  current_consumption:
    topic: motor/current
    type: std_msgs/msg/Float32
requirements:
  - id: ROS-001
    ptltl: H (current_consumption <= 15.0)
"""

pytestmark = pytest.mark.timeout(300)


def colcon() -> list[str]:
    """Return the command of the colcon that belongs to this Python."""
    beside = Path(sys.executable).parent / 'colcon'
    return [sys.executable, str(beside)] if beside.is_file() else [shutil.which('colcon') or '']


@pytest.fixture(scope='module', params=[
    pytest.param((), id='copy'),
    pytest.param(('--symlink-install',), id='symlink', marks=thorough)])
def workspace(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory,
    copy_repository: Callable[[Path], Path],
) -> Path:
    """Return a workspace in which a copy of the repository is built."""
    # With a space in its path, as some users have.
    folder = tmp_path_factory.mktemp('my workspace')
    copy_repository(folder / 'src' / NAME)
    done = subprocess.run(
        [*colcon(), '--log-base', 'log', 'build', '--base-paths', 'src', *request.param],
        cwd=folder, capture_output=True, text=True, check=False, stdin=subprocess.DEVNULL)
    assert done.returncode == 0, f'{done.stdout}{done.stderr}'
    assert 'Finished <<< fret_monitor' in done.stdout
    return folder


@pytest.fixture
def environment(workspace: Path, domain: int) -> dict[str, str]:
    """Return the environment of a shell that has sourced the workspace."""
    script = f'. {shlex.quote(str(workspace / "install" / "setup.sh"))} && env -0'
    # A sourced file cannot find its own path in a plain sh; `setup.bash` can.
    shell = {**os.environ, 'COLCON_CURRENT_PREFIX': str(workspace / 'install')}
    listed = subprocess.run(['sh', '-c', script], env=shell, capture_output=True, check=True)
    pairs = (entry.partition('=') for entry in listed.stdout.decode().split('\0') if entry)
    return {name: value for name, _, value in pairs}


def ros2_run(environment: Mapping[str, str], executable: str) -> str:
    """Return what `ros2 run fret_monitor EXECUTABLE` starts."""
    for prefix in map(Path, environment['AMENT_PREFIX_PATH'].split(os.pathsep)):
        if (prefix / 'share/ament_index/resource_index/packages' / NAME).is_file():
            path = prefix / 'lib' / NAME / executable
            assert os.access(path, os.X_OK), f'{path} is no executable'
            return str(path)
    raise AssertionError(f'{NAME} is in no prefix of AMENT_PREFIX_PATH')


@pytest.fixture
def graph(domain: int) -> Iterator[Callable[[], list[str]]]:
    """Return a function that returns the names of the nodes in the domain."""
    context = rclpy.Context()
    rclpy.init(context=context, domain_id=domain)
    node = rclpy.create_node('onlooker', context=context)
    yield node.get_node_names
    node.destroy_node()
    rclpy.shutdown(context=context)


def wait_until(true: Callable[[], bool], process: 'subprocess.Popen[str]') -> None:
    """Wait until a condition holds; on a timeout fail with the output of a process."""
    deadline = time.monotonic() + 60
    while not true():
        if process.poll() is not None or time.monotonic() > deadline:
            process.kill()
            pytest.fail(''.join(process.communicate()))
        time.sleep(0.05)


@pytest.mark.parametrize('executable', some(['monitor', 'logger']))
def test_a_node_starts_and_ends_under_ros2_run(
    executable: str, environment: dict[str, str], graph: Callable[[], list[str]], tmp_path: Path,
) -> None:
    bundle = write_bundle(tmp_path, BUNDLE)
    before = set(graph())
    with subprocess.Popen(
        [ros2_run(environment, executable), '--ros-args', '-p', f'spec:={bundle}'],
        env=environment, cwd=tmp_path, text=True, stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    ) as process:
        try:
            wait_until(lambda: bool(set(graph()) - before), process)
            process.send_signal(signal.SIGINT)
            out, err = process.communicate(timeout=30)
        finally:
            process.kill()
    assert (process.returncode, 'Traceback' in err) == (0, False), f'{out}{err}'


def test_the_command_line_runs_from_the_workspace(
    environment: dict[str, str], workspace: Path, tmp_path: Path,
) -> None:
    bundle = write_bundle(tmp_path, BUNDLE)
    done = subprocess.run(
        [ros2_run(environment, 'fret-monitor'), 'check', str(bundle)],
        env=environment, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, 'ROS-001' in done.stdout) == (0, True), f'{done.stdout}{done.stderr}'


def test_every_file_of_the_package_is_installed(
    environment: dict[str, str], workspace: Path,
) -> None:
    share = workspace / 'install' / NAME / 'share' / NAME
    source = workspace / 'src' / NAME
    for folder in ('config', 'csrc', 'docs', 'examples', 'launch'):
        files = [path.relative_to(source) for path in (source / folder).rglob('*.*')
                 if path.is_file()]
        assert files
        for file in files:
            assert (share / file).read_bytes() == (source / file).read_bytes()
    assert str(share.parent.parent) in environment['AMENT_PREFIX_PATH'].split(os.pathsep)


def test_the_bundles_of_the_package_run_where_they_are_installed(
    environment: dict[str, str], graph: Callable[[], list[str]], workspace: Path, tmp_path: Path,
) -> None:
    for package in ('geometry_msgs', 'nav_msgs', 'sensor_msgs'):
        pytest.importorskip(package)
    folder = workspace / 'install' / NAME / 'share' / NAME / 'config'
    specs = [folder / name for name in ('arm.yaml', 'mobile_base.yaml', 'quadrotor.yaml')]
    with subprocess.Popen(
        [ros2_run(environment, 'monitor'), '--ros-args', '-p',
         f'spec:=[{", ".join(f"{str(spec)!r}" for spec in specs)}]'],
        env=environment, cwd=tmp_path, text=True, stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
    ) as process:
        assert process.stdout is not None
        said = ''
        try:
            for line in process.stdout:
                said += line
                if 'watching' in line:
                    break
        finally:
            process.send_signal(signal.SIGINT)
            rest, _ = process.communicate(timeout=30)
    assert 'in 3 bundles' in said, rest
    assert all(f'({spec}, ' in said for spec in specs), said
    assert process.returncode == 0, rest


def test_the_installed_package_is_the_one_that_runs(
    environment: dict[str, str], workspace: Path, tmp_path: Path,
) -> None:
    done = subprocess.run(
        [sys.executable, '-c', f'import {NAME}; print({NAME}.__file__)'],
        env=environment, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert Path(done.stdout.strip()).is_relative_to(workspace)
