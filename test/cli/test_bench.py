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

"""`bench`: figures of a bundle, for people or as JSON."""

import json

from cli.command import Here, PUMP


def test_the_figures_have_their_names_and_are_plausible(here: Here) -> None:
    done = here.run('bench', here.file('pump.yaml', PUMP), '--json')
    assert (done.status, done.err) == (0, '')
    found = json.loads(done.out)
    assert set(found) >= {'requirements', 'ns_per_step', 'state_bytes', 'compile_seconds'}
    assert (found['requirements'], found['state_bytes']) == (3, 3)
    assert 0.1 < found['ns_per_step'] < 1e5
    assert 0.01 < found['compile_seconds'] < 600


def test_the_figures_are_shown_to_people(here: Here) -> None:
    lines = here.run('bench', here.file('pump.yaml', PUMP)).out.splitlines()
    assert [line.split('  ')[0] for line in lines] == [
        'requirements', 'time a step', 'state', 'compile']
