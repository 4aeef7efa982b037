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

"""`compile`: a folder, and a line that says what is in it."""

import os

from cli.command import Here
from cli.command import PUMP
from fret_monitor.native.folder import open_folder
from fret_monitor.native.monitor import load


def test_it_writes_a_folder_and_says_what_is_in_it(here: Here) -> None:
    out = here.folder / 'robot' / 'pump'
    done = here.run('compile', here.file('pump.yaml', PUMP), '--output', out)
    assert (done.status, done.err) == (0, '')
    held = open_folder(out)
    monitor = load(held.library, held.manifest)
    operations = sum(group.operations for group in held.manifest.groups)
    assert done.out == (f'{out}: 3 requirements, {monitor.state_bytes} bytes of state, '
                        f'{operations} operations a step\n')


def test_what_is_refused_is_told_on_one_line_and_written_nowhere(here: Here) -> None:
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
