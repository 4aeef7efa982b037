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

"""The demo and the simulated vehicle in it."""

from collections import Counter
import os
from pathlib import Path
import re
import subprocess
import sys

import fret_monitor
from fret_monitor import build
from fret_monitor.logic.formula import Historically
from fret_monitor.logic.timed import evaluate_timed, TimedTrace
import pytest

ROOT = Path(fret_monitor.__file__).parent.parent
DEMO = ROOT / 'examples' / 'demo.py'
BUNDLE = ROOT / 'config' / 'quadrotor.yaml'

pytestmark = pytest.mark.skipif(not DEMO.exists(), reason='the examples are elsewhere')

# A program that prints the flight, so that this process need not import the example
FLIGHT = """
import sys
sys.path.insert(0, sys.argv[1])
from quadrotor import fly, STEP
for sample in fly(sys.argv[2] == 'fault'):
    if not sample.is_silent:
        print('windspeed', sample.time, sample.wind)
        print('motor/current', sample.time + STEP / 2, sample.current)
"""


def flight(kind: str) -> list[tuple[str, int, float]]:
    """Return topic, nanoseconds and value of each message."""
    done = subprocess.run(
        [sys.executable, '-c', FLIGHT, str(DEMO.parent), kind], capture_output=True, text=True,
        check=True)
    lines = (line.split() for line in done.stdout.splitlines())
    return [(topic, round(10 * float(time)) * 10 ** 8, rounded(value))
            for topic, time, value in lines]


def rounded(text: str) -> float:
    import numpy
    return float(numpy.float32(float(text)))


def occurrences(kind: str) -> list[tuple[str, float]]:
    """Return the violations that a flight must announce, by id and seconds."""
    specification = build.read(BUNDLE).specification
    messages = flight(kind)
    topics = {item.topic: item.name for item in specification.signals}
    begin = messages[1][1]  # both inputs have a value
    found = []
    for item in specification.properties:
        values: dict[str, float] = {}
        rows: dict[int, dict[str, float]] = {}
        for topic, time, value in messages:
            values[topics[topic]] = value
            if time >= begin:
                rows[time - begin] = dict(values)
        columns = {name: [row[name] for row in rows.values()] for name in values}
        watched = item.formula.argument if isinstance(item.formula, Historically) else item.formula
        history, = evaluate_timed([watched], TimedTrace(list(rows), columns, max(rows)))
        found += [(begin + tick, item.id) for tick, truth in history if not truth]
    return [(name, time * 1e-9) for time, name in sorted(found)]


def test_a_flight_with_a_working_guard_violates_nothing() -> None:
    assert occurrences('no fault') == []


def test_a_flight_with_a_fault_violates_two_requirements_once_in_silence() -> None:
    found = occurrences('fault')
    assert [name for name, _ in found] == ['ROS-001', 'ROS-002', 'ROS-001']
    assert 83 < found[-1][1] < 93, 'while the sensors are silent'


def test_the_running_example_is_fret_s_formula() -> None:
    # FRET's formula for `if` ... `within` and `persisted` (shared/data/README.md), written out
    sentence = build.read(BUNDLE).specification.properties[0]
    overload = '(current_consumption > 15.0 & wind_speed > 8.0)'
    persisted = f'(H[0, 10 s] {overload} & H[<10 s] !FTP)'
    trigger = f'({persisted} & Z !{persisted})'
    relieved = '(current_consumption <= 15.0)'
    text = BUNDLE.read_text(encoding='utf-8')
    spelled = re.sub(r'(?m)^    fretish: >-\n.*\n.*$',
                     f'    ptltl: "H (O[=10 s] ({trigger} & !{relieved}) '
                     f'-> O[<10 s] (FTP | {relieved}))"', text, count=1)
    assert spelled != text
    other = Path(os.environ['ROS_HOME']) / 'quadrotor.yaml'
    other.write_text(spelled, encoding='utf-8')
    assert build.read(other).specification.properties[0].formula is sentence.formula


@pytest.mark.usefixtures('domain')
def test_the_demo_logs_the_violations_and_succeeds() -> None:
    done = subprocess.run(
        [sys.executable, str(DEMO)], capture_output=True, text=True, check=False, timeout=120,
        env={**os.environ, 'PYTHONPATH': os.pathsep.join([str(ROOT), *sys.path])})
    assert (done.returncode, done.stderr) == (0, ''), f'{done.stdout}{done.stderr}'
    told = Counter(re.findall(r'\*{5} (\S+) VIOLATED at', done.stdout))
    assert told == {'ROS-001': 2, 'ROS-002': 1}
    assert done.stdout.endswith('Exactly these were announced, at exactly these times.\n')
