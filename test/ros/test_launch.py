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

"""The launch file, where ROS 2's launch is installed (there is no wheel of it)."""

import os
from pathlib import Path
import signal
import stat
import subprocess
import sys

import fret_monitor
import pytest
from ros.harness import Partner, settle, wait_until
from std_msgs.msg import Float32

pytest.importorskip('launch')
pytest.importorskip('launch_ros')

BUNDLE = """
format: 1
inputs:
  value: {topic: x, type: std_msgs/msg/Float32}
requirements:
  - {id: R1, ptltl: value < 0.5}
"""
SOURCE = Path(fret_monitor.__file__).parent.parent
LAUNCH = """
import sys
from launch import LaunchDescription, LaunchService
from launch.actions import EmitEvent, IncludeLaunchDescription, RegisterEventHandler
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch_ros.event_handlers import OnStateTransition
from launch_ros.events.lifecycle import ChangeState
from lifecycle_msgs.msg import Transition


def change(transition):
    return EmitEvent(event=ChangeState(
        lifecycle_node_matcher=lambda node: True, transition_id=transition))


managing = [
    RegisterEventHandler(OnStateTransition(goal_state='inactive', entities=[
        change(Transition.TRANSITION_ACTIVATE)])),
    change(Transition.TRANSITION_CONFIGURE)] if 'autostart:=false' in sys.argv else []
service = LaunchService()
service.include_launch_description(LaunchDescription([IncludeLaunchDescription(
    PythonLaunchDescriptionSource(sys.argv[1]),
    launch_arguments=[tuple(item.split(':=')) for item in sys.argv[2:]]), *managing]))
sys.exit(service.run())
"""


def launch_file() -> Path:
    for folder in (SOURCE, *(Path(prefix) / 'share' / 'fret_monitor' for prefix in
                             [sys.prefix, *os.environ.get('AMENT_PREFIX_PATH', '').split(':')])):
        if (folder / 'launch' / 'monitor.launch.py').is_file():
            return folder / 'launch' / 'monitor.launch.py'
    raise AssertionError('the launch file is nowhere')


def install(prefix: Path) -> None:
    """Make a prefix in which launch finds the executables of the package under test."""
    (prefix / 'share/ament_index/resource_index/packages').mkdir(parents=True)
    (prefix / 'share/ament_index/resource_index/packages/fret_monitor').touch()
    (prefix / 'lib/fret_monitor').mkdir(parents=True)
    for name in ('monitor', 'logger'):
        script = prefix / 'lib/fret_monitor' / name
        script.write_text(f'#!{sys.executable}\nimport sys\n'
                          f'from fret_monitor.ros.{name} import main\nsys.exit(main())\n')
        script.chmod(script.stat().st_mode | stat.S_IXUSR)


def environment(folder: Path) -> dict[str, str]:
    return {**os.environ, 'PYTHONPATH': os.pathsep.join([str(SOURCE), *sys.path]),
            'AMENT_PREFIX_PATH': str(folder / 'prefix')}


@pytest.mark.parametrize(('arguments', 'nodes'), [
    (['spec:=bundle.yaml'], {'/fret_monitor', '/fret_logger'}),
    (['spec:=bundle.yaml', 'namespace:=robot', 'policy:=periodic', 'rate:=5', 'logger:=false',
      'blackbox:=box', 'blackbox_seconds:=5', 'blackbox_bytes:=100000'],
     {'/robot/fret_monitor'}),
    (['spec:=[bundle.yaml, other.yaml]', 'name:=guard', 'hot_path:=off', 'period:=',
      'log_level:=warn'], {'/guard', '/fret_logger'}),
    (['spec:=bundle.yaml', 'autostart:=false', 'logger:=false'], {'/fret_monitor'}),
])
def test_launch_starts_the_nodes_and_ends_them(
    arguments: list[str], nodes: set[str], partner: Partner, tmp_path: Path,
) -> None:
    (tmp_path / 'bundle.yaml').write_text(BUNDLE, encoding='utf-8')
    (tmp_path / 'other.yaml').write_text(BUNDLE.replace('R1', 'R2').replace(': x', ': y'),
                                         encoding='utf-8')
    install(tmp_path / 'prefix')
    process = subprocess.Popen(
        [sys.executable, '-c', LAUNCH, str(launch_file()), *arguments], cwd=tmp_path,
        env=environment(tmp_path), text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)

    def found() -> set[str]:
        listed = partner.node.get_node_names_and_namespaces()
        return {f'{namespace.rstrip("/")}/{name}' for name, namespace in listed
                if name != 'partner' and not name.startswith('launch_ros_')}

    try:
        wait_until(lambda: found() == nodes, f'the nodes {nodes}')
        wait_until(lambda: partner.node.count_subscribers('/x')
                   + partner.node.count_subscribers('/robot/x') == 1, 'the subscription')
        if arguments == ['spec:=bundle.yaml']:
            x = partner.publisher(Float32, '/x')
            partner.wait_for_listener(x)
            wait_until(lambda: partner.node.count_subscribers('/copilot/handlerpropR1') == 1,
                       'the logger')
            settle(1.0)  # until the monitor has matched it too
            x.publish(Float32(data=0.7))
            settle(1.0)
        process.send_signal(signal.SIGINT)
        output, _ = process.communicate(timeout=30)
        # Once, although there are two nodes that could log it.
        assert output.count('R1 violated') == (arguments == ['spec:=bundle.yaml']), output
        assert output.count('process has finished cleanly') == len(nodes), output
        assert ('waiting to be configured' in output) is ('autostart:=false' in arguments)
    finally:
        process.kill()
        process.wait()


@pytest.mark.parametrize(('arguments', 'reason'), [
    ([], 'nothing to monitor: name a bundle, spec:=FILE.yaml'),
    (['spec:=wrong.yaml'], 'the monitor cannot start, for the reason above: correct '
                           'spec:=wrong.yaml'),
    (['spec:=bundle.yaml', 'hot_path:=perhaps'], "'auto', 'on', 'off'"),
])
@pytest.mark.usefixtures('domain')
def test_launch_ends_with_an_error_if_the_monitor_cannot_start(
    arguments: list[str], reason: str, tmp_path: Path,
) -> None:
    (tmp_path / 'bundle.yaml').write_text(BUNDLE, encoding='utf-8')
    (tmp_path / 'wrong.yaml').write_text(BUNDLE.replace('value <', 'values <'), encoding='utf-8')
    install(tmp_path / 'prefix')
    done = subprocess.run(
        [sys.executable, '-c', LAUNCH, str(launch_file()), *arguments, 'logger:=false'],
        cwd=tmp_path, env=environment(tmp_path), text=True, capture_output=True, timeout=60,
        check=False)
    assert done.returncode == 1
    assert reason in done.stdout + done.stderr


def test_on_exit_shutdown_ends_the_launch_with_the_monitor(
    partner: Partner, tmp_path: Path,
) -> None:
    (tmp_path / 'bundle.yaml').write_text(BUNDLE, encoding='utf-8')
    install(tmp_path / 'prefix')
    process = subprocess.Popen(
        [sys.executable, '-c', LAUNCH, str(launch_file()), 'spec:=bundle.yaml',
         'on_exit:=shutdown'], cwd=tmp_path, env=environment(tmp_path), text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
    try:
        wait_until(lambda: partner.node.count_publishers('/fret_monitor/alive') == 1,
                   'the monitor')
        children = subprocess.run(
            ['ps', '-ww', '-o', 'pid=,args=', '--ppid', str(process.pid)], text=True,
            check=True, capture_output=True).stdout.splitlines()
        monitor, = (line.split()[0] for line in children if 'lib/fret_monitor/monitor' in line)
        os.kill(int(monitor), signal.SIGKILL)
        output, _ = process.communicate(timeout=30)
        assert 'exit code -9' in output
        assert output.count('process has finished cleanly') == 1  # the logger
    finally:
        process.kill()
