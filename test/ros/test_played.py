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

"""Traces played to a monitor and to a node: `play_trace`, `check_node`, and `tests`."""

import json
from pathlib import Path
import re
import sys

from fret_monitor.build import compile_monitor, generate_monitor, read
from fret_monitor.testgen.folder import write_suite
from fret_monitor.testgen.suite import make_suite
from fret_monitor.testing import check_node, play_trace
import pytest
from ros.test_ci import folder

__all__ = ['folder']  # a fixture
pytestmark = pytest.mark.usefixtures('forking')
NODE = [sys.executable, 'valve_node.py']
START_S = 120.0  # of the monitor and a node, on a busy machine
TIMED = """\
format: 1
component: robot
evaluation: {policy: timed}
inputs:
  stop: {topic: stop, type: std_msgs/msg/Bool}
  speed: {topic: speed, type: std_msgs/msg/Float64}
requirements:
  - {id: STOP, fretish: "upon stop robot shall within 500 milliseconds satisfy speed < 0.1"}
"""
WATCHED = """\
format: 1
component: robot
evaluation: {evaluation}
inputs:
  stop: {{topic: stop, type: std_msgs/msg/Bool, timeout: 0.2, startup: 0.3, stale: violate}}
  speed: {{topic: cmd_vel, type: geometry_msgs/msg/Twist, field: norm(linear), timeout: 0.2,
          stale: violate}}
requirements:
  - {{id: STOP, fretish: "upon stop robot shall within {bound} satisfy speed < 0.1"}}
"""


def test_a_node_is_fed_and_its_violation_found(folder: Path, domain: int) -> None:
    Path('trace.csv').write_text('pressure,open\n2.0,0\n4.0,0\n')
    with pytest.raises(AssertionError, match='violated: OPENS\nexpected: nothing\nOPENS violated'):
        play_trace('valve.yaml', 'trace.csv', node=NODE, seconds=START_S)
    node = Path('valve_node.py')
    node.write_text(node.read_text().replace('4.0', '3.0'))
    check_node('valve.yaml', NODE, tries=1, seconds=START_S)


SLOW = """\
from time import sleep

import rclpy
from std_msgs.msg import Bool

rclpy.init()
node = rclpy.create_node('slow')
publisher = node.create_publisher(Bool, 'seen', 10)


def answer(message):
    sleep(0.05)
    publisher.publish(message)


node.create_subscription(Bool, 'level', answer, 1)
rclpy.spin(node)
"""
ANSWERED = """\
format: 1
evaluation: {policy: timed}
inputs:
  level: {topic: level, type: std_msgs/msg/Bool, timeout: 0.6}
  seen: {topic: seen, type: std_msgs/msg/Bool, role: output, timeout: 0.6, stale: violate}
requirements: [{id: SEEN, ptltl: seen}]
"""


def test_a_node_has_time_to_answer_while_the_clock_goes_on(tmp_path: Path, domain: int) -> None:
    bundle, node, trace = (tmp_path / name for name in ('slow.yaml', 'slow.py', 'trace.csv'))
    bundle.write_text(ANSWERED)
    node.write_text(SLOW)
    trace.write_text('time,level,seen\n0,1,1\n2,1,1\n')
    play_trace(
        bundle, trace, node=[sys.executable, str(node)], pause=0.2, seconds=START_S)


def test_the_monitor_announces_what_the_tests_expect(tmp_path: Path, domain: int) -> None:
    bundle = tmp_path / 'stop.yaml'
    bundle.write_text(TIMED)
    reading = read(bundle)
    monitor = compile_monitor(generate_monitor(reading)).monitor
    write_suite(make_suite(reading, 300.0), monitor, reading, tmp_path / 'tests')
    index = json.loads((tmp_path / 'tests' / 'tests.json').read_text())
    known = {item['name']: item['announced'] for item in index['traces']}
    assert [[], None, ['STOP']] == [value for value in ([], None, ['STOP'])
                                    if value in known.values()]
    text = (tmp_path / 'tests' / 'test_stop_traces.py').read_text()
    assert re.search(r"BUNDLE = \(HERE / '\.\./stop\.yaml'\)", text)
    trace = next(item for item in index['traces'] if item['announced'])
    play_trace(bundle, tmp_path / 'tests' / trace['trace'], trace['announced'],
               seconds=START_S)
    with pytest.raises(AssertionError, match='violated: STOP\nexpected: nothing'):
        play_trace(bundle, tmp_path / 'tests' / trace['trace'], seconds=START_S)


@pytest.mark.parametrize(('evaluation', 'trace'), [
    ('{policy: timed}', 'time,stop,speed\n0,0,2.5\n1,1,2.5\n1.5,1,2.5\n'),
    ('{policy: periodic, rate: 2}', 'stop,speed\n1,2.5\n0,2.5\n'),
])
def test_a_violation_at_the_last_instant_of_a_trace_is_announced(
    evaluation: str, trace: str, tmp_path: Path, domain: int,
) -> None:
    bundle, path = tmp_path / 'stop.yaml', tmp_path / 'trace.csv'
    bundle.write_text(TIMED.replace('{policy: timed}', evaluation))
    path.write_text(trace)
    play_trace(bundle, path, ['STOP'], seconds=START_S)


@pytest.mark.parametrize(('evaluation', 'bound', 'times'), [
    ('{policy: relevant_message}', '9 ticks', ('', '', '', '')),
    ('{policy: periodic, rate: 2}', '2 seconds', ('', '', '', '')),
    ('{policy: timed}', '2 seconds', ('0,', '0.1,', '0.25,', '1.5,')),
])
def test_inputs_with_a_timeout_are_silent_in_no_trace(
    evaluation: str, bound: str, times: tuple[str, ...], tmp_path: Path, domain: int,
) -> None:
    bundle = tmp_path / 'stop.yaml'
    bundle.write_text(WATCHED.format(evaluation=evaluation, bound=bound))
    head = 'time,stop,speed' if times[0] else 'stop,speed'
    rows = ['0,2.5', '1,2.5', '1,0.0625', '1,3.0']
    trace = tmp_path / 'trace.csv'
    trace.write_text('\n'.join([head, *(time + row for time, row in zip(times, rows))]) + '\n')
    play_trace(bundle, trace, seconds=START_S)
