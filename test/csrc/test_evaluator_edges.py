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

"""The evaluator's counters do not overflow at the powers of two where narrower ones would."""

from pathlib import Path
import shutil
import subprocess

from fret_monitor.native import csrc_directory
import pytest

HERE = Path(__file__).resolve().parent
WARNINGS = ('-Wall', '-Wextra', '-Wpedantic', '-Wconversion', '-Wshadow', '-Wswitch-enum',
            '-Werror')
SANITIZERS = ('-g', '-fsanitize=address,undefined', '-fno-sanitize-recover=all')


def test_an_evaluator_counts_past_two_to_the_power_of_32(tmp_path: Path) -> None:
    # At a thousand messages a second, a node reaches this after fifty days.
    gcc = shutil.which('gcc')
    if gcc is None:
        pytest.skip('no gcc')
    program = tmp_path / 'edges'
    command = [gcc, '-std=c99', '-O1', f'-I{csrc_directory()}', *WARNINGS,
               str(HERE / 'evaluator_edges.c'), '-o', str(program)]
    if subprocess.run([*command, *SANITIZERS], capture_output=True, check=False).returncode:
        subprocess.run(command, check=True)
    done = subprocess.run([str(program)], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout + done.stderr) == (0, '')
