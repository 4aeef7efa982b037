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

"""The nodes as commands: their help, exit status and first log line."""

import inspect
import os
from pathlib import Path
import re
import subprocess
import sys

import fret_monitor
from fret_monitor.ros.process import index_modules
from fret_monitor.ros.settings.parameters import LOGGER_PARAMETERS, MONITOR_PARAMETERS
import pytest
from rclpy.logging import get_logger
from ros import forked

SCRIPT = 'import sys; from fret_monitor.ros.{name} import main; sys.exit(main())'


@pytest.mark.parametrize(('name', 'parameters'), [
    ('monitor', MONITOR_PARAMETERS), ('logger', LOGGER_PARAMETERS)])
@pytest.mark.parametrize('folder', ['bin', 'lib/fret_monitor'])
def test_help_names_the_command_that_was_used_and_all_parameters(
        name: str, parameters: dict[str, object], folder: str, tmp_path: Path) -> None:
    script = tmp_path / folder / name
    script.parent.mkdir(parents=True)
    script.write_text(SCRIPT.format(name=name), encoding='utf-8')
    package = str(Path(fret_monitor.__file__).resolve().parent.parent)
    done = subprocess.run([sys.executable, script, '--help'], text=True, capture_output=True,
                          env={**os.environ, 'PYTHONPATH': os.pathsep.join(
                              [package, os.environ.get('PYTHONPATH', '')])}, check=False)
    command = script if folder == 'bin' else f'ros2 run fret_monitor {name}'
    assert (done.returncode, done.stderr) == (0, '')
    assert done.stdout.startswith(f'usage: {command} --ros-args -p spec:=BUNDLE.yaml\n')
    lines = [line for line in done.stdout.partition('parameters')[2].splitlines()
             if line.startswith('  ')]
    assert [line.split(':=')[0].strip() for line in lines if line[2] != ' '] == list(parameters)
    assert len({len(line) - len(re.sub(r' +(\w+:= +)?', '', line, count=1))
                for line in lines}) == 1  # one column


def test_help_ends_quietly_if_its_reader_has_read_enough() -> None:
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(
        [sys.executable, '-c', SCRIPT.format(name='monitor'), '--help'], stdout=writer,
        stderr=subprocess.PIPE, text=True, check=False)
    os.close(writer)
    assert (done.returncode, done.stderr) == (0, '')


FAILING = """
from fret_monitor.ros.process import run
from fret_monitor.ros.signals import StopRequest
from rclpy.node import Node
import sys


def fail():
    raise RuntimeError('no paper in the printer')


def make():
    node = Node('failing')
    node.create_timer(0.01, fail)
    return node


sys.exit(run('monitor', make, StopRequest()))
"""


@pytest.mark.usefixtures('domain')
def test_a_node_that_fails_after_its_start_has_another_exit_status_than_a_refusal() -> None:
    done = forked.run(FAILING, timeout=60)
    assert done.returncode == 2
    assert 'RuntimeError: no paper in the printer' in done.stderr


def test_the_first_log_line_resolves_the_paths_of_no_other_modules(
        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(inspect, 'modulesbyfile', {})
    monkeypatch.setattr(inspect, '_filesbymodname', {})
    resolved: list[str] = []
    resolve = os.path.realpath

    def counted(path: str) -> str:
        resolved.append(path)
        return resolve(path)

    index_modules()
    monkeypatch.setattr(os.path, 'realpath', counted)
    get_logger('test').info('a line')
    assert 0 < len(resolved) < 10


LEAN = """
import gc, os, sys
gc.disable()
from fret_monitor.ros.process import run
from fret_monitor.ros.signals import StopRequest
from rclpy.node import Node


def report():
    print('lark' in sys.modules, gc.isenabled(), gc.get_freeze_count() > 10_000, flush=True)
    os._exit(0)


def make():
    node = Node('lean')
    node.create_timer(0.01, report)
    return node


run('monitor', make, StopRequest())
"""


@pytest.mark.usefixtures('domain')
def test_a_node_loads_no_generator_and_its_start_is_visited_by_no_garbage_collection() -> None:
    done = subprocess.run([sys.executable, '-c', LEAN], text=True, capture_output=True,
                          timeout=60, check=False)
    assert done.stdout.split() == ['False', 'True', 'True'], done.stderr
