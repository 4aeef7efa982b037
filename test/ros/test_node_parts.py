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

"""Parts of the exported node in C, with a clock and failures that the test decides."""

import os
from pathlib import Path
import subprocess

import pytest
from ros.exported import exported_parts

TESTS = ('retries', 'callback', 'overlap', 'many', 'leak', 'place', 'order', 'depth', 'seconds',
         'clock', 'life', 'response', 'memory', 'silent', 'text')
BUNDLE = """
format: 1
constants: {whole: 3, real: 2.0}
inputs:
  fixed: {topic: fixed, type: sensor_msgs/msg/Temperature, field: temperature,
          qos: {reliability: reliable, depth: 7}}
  heat: {topic: heat, type: sensor_msgs/msg/Temperature, field: temperature,
         timeout: 1.0, startup: 60}
  elbow: {topic: joints, type: sensor_msgs/msg/JointState, field: "position[name = elbow]"}
  spread: {topic: heat, type: sensor_msgs/msg/Temperature, field: variance, timeout: 1.0,
           startup: 60}
  own: {topic: statuses, type: diagnostic_msgs/msg/DiagnosticArray, field: len(status)}
evaluation: {policy: relevant_message}
requirements:
  - {id: FIXED, ptltl: "fixed < 1.0"}
  - {id: HEAT, ptltl: "heat < 50.0", severity: warn}
  - {id: ELBOW, ptltl: "elbow < 1.0"}
  - {id: OWN, ptltl: "own >= 0"}
"""


@pytest.fixture(scope='module')
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    bundle = tmp_path_factory.mktemp('parts') / 'bundle.yaml'
    bundle.write_text(BUNDLE, encoding='utf-8')
    return exported_parts(bundle, 'node_parts')


@pytest.mark.parametrize('name', TESTS)
def test_parts_of_the_node(program: Path, domain: int, name: str) -> None:
    done = subprocess.run(
        # Inputs may be read from a topic of the node itself.
        [program, name, '--ros-args', '-r', 'statuses:=/diagnostics',
         '-p', 'log_violations:=false', '-p', 'constants.whole:=3.0', '-p', 'constants.real:=2'],
        text=True, timeout=120, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, check=False,
        # What a callback that stays uses is leaked on purpose.
        env={**os.environ, 'ASAN_OPTIONS': f'detect_leaks={int(name != "leak")}'})
    # The middleware complains of files in shared memory that killed processes have left.
    said = ''.join(line for line in done.stdout.splitlines(keepends=True)
                   if 'RTPS_TRANSPORT_SHM' not in line)
    assert (done.returncode, said) == (0, ''), said
