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

"""`compile`: writes a folder, and prints a line about its content."""

import os
import re
import shlex
import shutil

from cli.command import Here, PUMP
from differential.compiled import clang
from fret_monitor.native.compiler import find_compiler
from fret_monitor.native.folder import open_folder
from fret_monitor.native.monitor import load
import pytest


def test_it_writes_a_folder_and_prints_its_content(here: Here) -> None:
    out = here.folder / 'robot' / 'pump'
    done = here.run('compile', here.file('pump.yaml', PUMP), '--output', out)
    assert (done.status, done.err) == (0, '')
    held = open_folder(out)
    monitor = load(held.library, held.manifest)
    operations = sum(group.operations for group in held.manifest.groups)
    found = re.fullmatch(
        rf'{re.escape(str(out))}: 3 requirements, {monitor.state_bytes} bytes of state, '
        rf'{operations} operations and at most (\d+) instructions a step\n', done.out)
    assert found and 3 * operations < int(found[1]) < 20 * operations


def asked(monkeypatch: pytest.MonkeyPatch, compiler: str) -> None:
    """Let a compiler answer what the stack is; another one would build the engine anew."""
    found = find_compiler({**os.environ, 'CC': compiler})
    monkeypatch.setattr('fret_monitor.native.stack.find_compiler', lambda: found)


def test_the_worst_case_is_printed_as_instructions_and_stack(
    here: Here, monkeypatch: pytest.MonkeyPatch,
) -> None:
    gcc = shutil.which('gcc')
    if gcc is None:
        pytest.skip('needs gcc')
    asked(monkeypatch, gcc)
    bundle = here.file('pump.yaml', PUMP)
    done = here.run('compile', bundle, '--output', here.folder / 'out', '--worst-case')
    assert (done.status, done.err) == (0, '')
    assert re.fullmatch(
        r'worst case of a step of all requirements:\n'
        r'  at most \d+ instructions \(x86-64, gcc -O2\)\n'
        r'  at most \d+ bytes of stack: \d+ of the evaluator, \d+ of the monitors, and what the '
        r'C library needs in memcmp, memcpy, memset\n', done.out.partition('\n')[2])


def test_a_compiler_without_stack_usage_is_reported(
    here: Here, monkeypatch: pytest.MonkeyPatch,
) -> None:
    other = clang()
    if other is None:
        pytest.skip('needs clang')
    asked(monkeypatch, shlex.join(other))
    bundle = here.file('pump.yaml', PUMP)
    done = here.run('compile', bundle, '--output', here.folder / 'out', '--worst-case')
    assert (done.status, done.err) == (0, '')
    assert done.out.endswith('  stack: needs gcc 10 or later; name one in CC\n')


def test_an_error_is_one_line_and_nothing_is_written(here: Here) -> None:
    bundle = here.file('pump.yaml', PUMP)
    for folder, expected in [
        (here.folder, 'holds other files'), (bundle, 'is a file'), (bundle / 'out', 'is a file'),
        ('/dev/full/out', 'is a file'), (here.folder / ('x' * 300), 'File name too long'),
        ('/proc/out', "cannot write '/proc/out'"),
    ]:
        done = here.run('compile', bundle, '--output', folder)
        assert (done.status, done.out) == (1, '')
        assert done.err.startswith('error: ')
        assert expected in done.err.splitlines()[0]
        assert os.listdir(here.folder) == ['pump.yaml']


def test_a_second_run_replaces_the_first(here: Here) -> None:
    bundle, out = here.file('pump.yaml', PUMP), here.folder / 'out'
    first = here.run('compile', bundle, '--output', out)
    assert here.run('compile', bundle, '--output', out) == first
    assert sorted(os.listdir(here.folder)) == ['out', 'pump.yaml']
