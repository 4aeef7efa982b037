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

"""`bag` with instance variables: its table, its JSON, JUnit, and what it refuses."""

import json
from pathlib import Path

from bag.recordings import write
from cli.command import Here
import pytest

FLEET = """\
format: 1
for_each:
  robot: {most: 3, forget: 0.25}
inputs:
  speed: {topic: "{robot}/speed", type: std_msgs/msg/Float64}
requirements:
  - {id: SPEED, ptltl: speed <= 1.0}
  - {id: FLEET, ptltl: "count(robot: speed > 0.5) <= 1"}
"""
RUN = [('/ns/alpha/speed', 0, 0.6), ('/ns/beta/speed', 10**8, 1.5),
       ('/ns/beta/speed', 2 * 10**8, 0.2), ('/ns/beta/speed', 3 * 10**8, 1.6),
       ('/ns/gamma/speed', 5 * 10**8, 1.2), ('/ns/delta/speed', 6 * 10**8, 0.1),
       ('/ns/eps/speed', 6 * 10**8, 0.1), ('/ns/zeta/speed', 6 * 10**8, 9.0),
       ('/elsewhere/speed', 6 * 10**8, 9.0), ('/ns/alpha/speed', 8 * 10**8, 1.1)]


@pytest.fixture
def fleet(tmp_path: Path) -> tuple[str, str]:
    file = tmp_path / 'fleet.yaml'
    file.write_text(FLEET)
    path = write(tmp_path / 'run', RUN)
    return str(file), str(path)


def test_the_table_and_the_line_of_json_name_the_violated_instances(
        here: Here, fleet: tuple[str, str]) -> None:
    done = here.run('bag', *fleet, '--namespace', '/ns')
    assert done.status == 1  # a key found no room
    assert '1 message with a key of robot for which `most: 3` leaves no room' in done.err
    lines = done.out.splitlines()
    assert lines[1] == 'robot: 6 instances, 3 ended, 0 of them open'
    assert [line.split()[:3] for line in lines[3:]] == [
        ['SPEED', 'VIOLATED', '4'], ['SPEED[robot=alpha]', 'VIOLATED', '1'],
        ['SPEED[robot=beta]', 'VIOLATED', '2'], ['SPEED[robot=gamma]', 'VIOLATED', '1'],
        ['FLEET', 'VIOLATED', '2']]
    found = json.loads(here.run('bag', *fleet, '--namespace', '/ns', '--json').out)
    assert [*found['requirements']['SPEED']['instances']] == ['alpha', 'beta', 'gamma']
    assert found['instances'] == {
        'robot': {'began': 6, 'ended': 3, 'ended_open': 0, 'beyond': 1}}


def test_junit_names_the_violated_instances(here: Here, fleet: tuple[str, str]) -> None:
    here.run('bag', *fleet, '--namespace', '/ns', '--junit',
             here.folder / 'out.xml')
    assert 'violated 4 times, first at 1700000000.100000000, by alpha, beta, gamma' in (
        here.folder / 'out.xml').read_text()


@pytest.mark.parametrize('option', ['--csv', '--mcap', '--report'])
def test_what_has_no_place_for_instances_yet_is_refused(
        here: Here, fleet: tuple[str, str], option: str) -> None:
    ending = {'--report': '.html'}.get(option, f'.{option[2:]}')
    done = here.run('bag', *fleet, option, f'out{ending}')
    assert done.status == 1
    assert '--csv, --mcap and --report are not supported yet' in done.err
