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
import pytest
from ros.reference import expected, Message

ROOT = Path(fret_monitor.__file__).parent.parent
DEMO = ROOT / 'examples' / 'demo.py'
BUNDLE = ROOT / 'config' / 'quadrotor.yaml'

pytestmark = pytest.mark.skipif(not DEMO.exists(), reason='the examples are elsewhere')

# A program that prints the flight, so that this process need not import the example
FLIGHT = """
import sys
sys.path.insert(0, sys.argv[1])
from quadrotor import fly
for sample in fly(sys.argv[2] == 'fault'):
    print(sample.wind, sample.current)
"""


def flight(kind: str) -> list[Message]:
    done = subprocess.run(
        [sys.executable, '-c', FLIGHT, str(DEMO.parent), kind], capture_output=True, text=True,
        check=True)
    samples = [line.split() for line in done.stdout.splitlines()]
    return [message for wind, current in samples for message in (
        ('windspeed', {'wind_speed': rounded(wind)}),
        ('motor/current', {'current_consumption': rounded(current)}))]


def rounded(text: str) -> float:
    import numpy
    return float(numpy.float32(float(text)))


def test_a_flight_with_a_working_guard_violates_nothing() -> None:
    assert sum(expected(BUNDLE, flight('no fault')).values()) == 0


def test_a_flight_with_a_fault_violates_two_requirements_once() -> None:
    violated = {name: count for name, count in expected(BUNDLE, flight('fault')).items() if count}
    assert violated == {'ROS_001': 1, 'ROS_002': 1}


def test_the_running_example_is_fret_s_formula() -> None:
    # FRET's formula for `if` ... `within` and `persisted` (shared/data/README.md), written out
    sentence = build.read(BUNDLE).specification.properties[0]
    overload = '(current_consumption > 15.0 & wind_speed > 8.0)'
    persisted = f'(H[0,10] {overload} & H[0,9] !FTP)'
    trigger = f'({persisted} & Z !{persisted})'
    relieved = '(current_consumption <= 15.0)'
    text = BUNDLE.read_text(encoding='utf-8')
    spelled = re.sub(r'(?m)^    fretish: >-\n.*\n.*$',
                     f'    ptltl: "H (O[10,10] ({trigger} & !{relieved}) '
                     f'-> O[0,9] (FTP | {relieved}))"', text, count=1)
    assert spelled != text
    other = Path(os.environ['ROS_HOME']) / 'quadrotor.yaml'
    other.write_text(spelled, encoding='utf-8')
    assert build.read(other).specification.properties[0].formula is sentence.formula


@pytest.mark.usefixtures('domain')
def test_the_demo_logs_both_violations_and_succeeds() -> None:
    done = subprocess.run(
        [sys.executable, str(DEMO)], capture_output=True, text=True, check=False, timeout=120,
        env={**os.environ, 'PYTHONPATH': os.pathsep.join([str(ROOT), *sys.path])})
    assert (done.returncode, done.stderr) == (0, ''), f'{done.stdout}{done.stderr}'
    told = Counter(re.findall(r'\*{5} (\S+) VIOLATED at', done.stdout))
    assert told == {'ROS-001': 1, 'ROS-002': 1}
    assert done.stdout.endswith('Exactly these were announced.\n')
