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

"""A bundle with every source that is no field of a topic, in every verb of the command line."""

from cli.command import Here
from fret_monitor.model.made import MadeKind
import pytest

SOURCES = """\
format: 1
inputs:
  near: {transform: {from: dock, to: base}, field: norm(translation), timeout: 1}
  old: {transform: {from: dock, to: base}, field: age(), timeout: 1}
  alive: {node: /controller}
  scans: {publishers: scan, startup: 5}
  heard: {subscribers: scan, field: received()}
  state: {lifecycle: /controller, initial: UNCONFIGURED}
  speed: {parameter: {node: /controller, name: max.speed}, type: float64, timeout: 9}
  count: {parameter: {node: /controller, name: count}, type: int64}
  on: {parameter: {node: /controller, name: "on"}, type: bool, initial: true}
MODE  often: {topic: scan, type: std_msgs/msg/Float64, field: rate(1 s), max_rate: 50}
  pause: {topic: scan, type: std_msgs/msg/Float64, field: period(), max_rate: 50}
evaluation: {policy: relevant_message}
requirements:
  - {id: NEAR, ptltl: "near < 2 & old < 1"}
  - {id: ALIVE, ptltl: "alive & scans = 1"}
  - {id: HEARD, ptltl: "!heard"}
  - {id: STATE, fretish: whenever on the base shall immediately satisfy state = ACTIVE}
  - {id: SPEED, cocospec: "speed < 1.5 or count > 2"}
  - {id: OFTEN, ptltl: "often > 8 & pause < 0.2"}
"""
MODE = '  mode: {parameter: {node: /controller, name: mode}, type: string, values: {SLOW: slow}}\n'
TEXTUAL = SOURCES.replace('MODE', MODE) + '  - {id: MODE, ptltl: mode = SLOW}\n'
NUMERIC = SOURCES.replace('MODE', '')


def test_the_bundle_has_every_source() -> None:
    assert all(f'{{{kind.value}:' in TEXTUAL for kind in MadeKind)


@pytest.mark.parametrize(('arguments', 'says'), [
    (['check'], 'NEAR'), (['check', '--json'], '"NEAR"'), (['explain'], 'near < 2'),
    (['compile', '--output'], '7 requirements'), (['analyze', '--timeout', '1'], 'consistent'),
    (['tests', '--timeout', '2', '--output'], ''), (['prove', '--timeout', '1'], '7 requirements'),
    (['export', '--to', 'ros2', '--output'], ''), (['export', '--to', 'c99', '--output'], ''),
    (['export', '--to', 'copilot', '--output'], '')],
    ids=lambda item: ' '.join(item) if isinstance(item, list) else None)
def test_a_verb_takes_all_sources(here: Here, arguments: list[str], says: str) -> None:
    verb, *others = arguments
    folder = [here.folder / 'out'] if others[-1:] == ['--output'] else []
    done = here.run(verb, here.file('sources.yaml', TEXTUAL), *others, *folder)
    assert says in done.out
    assert ' error: ' not in done.err  # analyze and prove may be left without an answer in time
    assert not folder or any(folder[0].iterdir())


def test_simulate_has_a_column_for_each_source(here: Here) -> None:
    trace = here.file('trace.csv', 'near,old,alive,scans,heard,state,speed,count,on,often,pause\n'
                      '1,0.5,1,1,0,ACTIVE,1.0,3,1,10,0.1\n3,0.5,0,2,1,INACTIVE,2.0,1,1,7,0.1\n')
    done = here.run('simulate', here.file('sources.yaml', NUMERIC), '--trace', trace)
    assert done.out.splitlines() == [
        'step,NEAR,ALIVE,HEARD,STATE,SPEED,OFTEN', '0,1,1,1,1,1,1', '1,0,0,0,0,0,0']


@pytest.mark.parametrize('target', ['cfs', 'fprime'])
def test_flight_software_refuses_each_source_with_its_place(here: Here, target: str) -> None:
    done = here.run('export', here.file('sources.yaml', NUMERIC), '--to', target,
                    '--output', here.folder / 'out')
    assert done.status == 1
    for line, words in ((3, "'near' is a transform"), (5, "'alive' is in the graph of ROS"),
                        (6, "'scans' is in the graph of ROS"),
                        (8, "'state' is the state of a lifecycle node"),
                        (9, "'speed' is a parameter of a node")):
        assert f'sources.yaml:{line}:3: error: {words}' in done.err
    assert 'have none: name a topic' in done.err
