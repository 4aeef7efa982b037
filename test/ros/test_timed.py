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

"""The monitor as a process under the policy timed: silence, deadlines, clocks, stamps."""

from collections.abc import Iterator
from pathlib import Path
from time import sleep, time

from bundles import spec_of
from diagnostic_msgs.msg import DiagnosticArray
from fret_monitor.model.names import DETAILS_TOPIC
import pytest
from ros.harness import Partner, settle, started, wait_until
from ros.operators import Operator
from ros.received import Detail, read_detail
from ros.simulator import simulating, Simulator
from sensor_msgs.msg import Temperature
from std_msgs.msg import Bool

OK, ERROR = b'\0', b'\2'
ALIVE = """
format: 1
inputs:
  got: {topic: p, type: std_msgs/msg/Bool, field: received()}
evaluation: {policy: timed}
requirements:
  - {id: ALIVE, ptltl: "O[0, 1 s] got", report: occurrence}
"""
ANSWER = """
format: 1
inputs:
  ask: {topic: ask, type: std_msgs/msg/Bool}
  answer: {topic: answer, type: std_msgs/msg/Bool}
evaluation: {policy: timed}
requirements:
  - {id: ANSWER, ptltl: "H (ask -> O[0, 10 s] (answer | !ask))", report: occurrence}
"""
STAMPED = """
format: 1
inputs:
  a: {topic: a, type: sensor_msgs/msg/Temperature, field: temperature}
  b: {topic: b, type: sensor_msgs/msg/Temperature, field: temperature}
evaluation: {policy: timed, stamp: header, reorder: 0.5}
requirements:
  - {id: ORDER, ptltl: "a <= b", report: every_step}
"""


class Listener:
    """Collects details, each with the time at which it was received."""

    def __init__(self, partner: Partner) -> None:
        """Subscribe."""
        self.heard: list[tuple[Detail, float]] = []
        partner.node.create_subscription(DiagnosticArray, DETAILS_TOPIC, self._keep, 1000)
        wait_until(lambda: partner.node.count_publishers(DETAILS_TOPIC) > 0, 'details')

    def _keep(self, array: DiagnosticArray) -> None:
        for status in array.status:
            detail = read_detail(status)
            self.heard.append((detail, time()))

    def wait_for(self, number: int) -> list[Detail]:
        """Wait for details and return them."""
        wait_until(lambda: len(self.heard) >= number, f'{number} details')
        return [detail for detail, _ in self.heard]


@pytest.fixture
def simulator(domain: int) -> Iterator[Simulator]:
    with simulating() as simulator:
        yield simulator


@pytest.mark.parametrize('hot_path', ['on', 'off'])
def test_when_a_publisher_stops_the_violation_comes_on_time(
    partner: Partner, tmp_path: Path, hot_path: str,
) -> None:
    with started('monitor', '-p', spec_of(tmp_path, ALIVE), '-p', f'hot_path:={hot_path}'):
        partner.listen('ALIVE')
        listener = Listener(partner)
        p = partner.publisher(Bool, 'p')
        partner.wait_for_listener(p)
        settle(0.5)  # until the monitor has seen who wants details
        for _ in range(10):
            stopped = time()
            p.publish(Bool(data=True))
            sleep(0.05)
        violated = listener.wait_for(1)[0]
        received = listener.heard[0][1]
        assert not violated.is_recovery and violated.step is None
        # On a busy machine a message may be on its way for long. The deadline itself is exact.
        assert 1.0 <= violated.stamp - stopped < 2.0
        assert 0.0 <= received - violated.stamp < 3.0
        assert violated.time is not None and float(violated.time) > 1.45
        p.publish(Bool(data=True))
        again = listener.wait_for(2)[1]
        assert again.is_recovery and again.stamp > violated.stamp
        listener.wait_for(3)
        partner.expect({'ALIVE': 2})


def test_a_simulation_that_starts_again_starts_the_requirements_afresh(
    partner: Partner, simulator: Simulator, tmp_path: Path,
) -> None:
    with started('monitor', '-p', spec_of(tmp_path, ANSWER), '-p', 'use_sim_time:=true') as node:
        partner.listen('ANSWER')
        listener = Listener(partner)
        operator = Operator(partner)
        ask, answer = partner.publisher(Bool, 'ask'), partner.publisher(Bool, 'answer')
        partner.wait_for_listener(ask, answer)
        simulator.jump(1000.0)
        settle(0.5)
        answer.publish(Bool(data=False))
        ask.publish(Bool(data=False))
        operator.wait(2)
        ask.publish(Bool(data=True))
        operator.wait(2)
        simulator.go(9.5, speed=20.0)
        operator.wait(1)
        assert not listener.heard
        simulator.go(2.0)
        violated, = listener.wait_for(1)
        operator.wait_for('ANSWER', ERROR, 'violated')
        assert abs(violated.stamp - 1010.0) < 1e-6 and violated.time is not None
        assert abs(float(violated.time) - 10.0) < 1e-6
        simulator.jump(-1000.0)
        node.wait_for('the requirements start afresh')
        assert operator.status('time of bundle')[2]['restarts'] == '1'
        # Asked at the begin, for it keeps its values: false at once, for there was no answer.
        simulator.go(0.1)  # what is due at the time at which the clock stands waits until it moves
        partner.expect({'ANSWER': 2})
        answer.publish(Bool(data=True))
        assert listener.wait_for(3)[2].is_recovery
        values = operator.wait_for('ANSWER', OK, 'satisfied')
        assert values['verdict'] == 'false'  # of H p; p holds again
        assert 'violations' not in values and int(values['violating evaluations']) > 1


def at(stamp: float, value: float) -> Temperature:
    message = Temperature(temperature=value)
    message.header.stamp.sec = int(stamp)
    message.header.stamp.nanosec = round(stamp % 1 * 1e9)
    return message


def test_messages_count_by_the_stamps_of_their_headers(partner: Partner, tmp_path: Path) -> None:
    with started('monitor', '-p', spec_of(tmp_path, STAMPED)) as node:
        partner.listen('ORDER')
        listener = Listener(partner)
        operator = Operator(partner)
        a, b = partner.publisher(Temperature, 'a'), partner.publisher(Temperature, 'b')
        partner.wait_for_listener(a, b)
        operator.wait(2)
        now = time()
        # By stamps: b = 1, a = 1, b = 2, a = 2. By reception a would be greater once.
        a.publish(at(now + 0.1, 1.0))
        b.publish(at(now, 1.0))
        a.publish(at(now + 0.3, 2.0))
        b.publish(at(now + 0.2, 2.0))
        a.publish(at(now + 0.4, 3.0))
        violated, = listener.wait_for(1)
        assert abs(violated.stamp - (now + 0.4)) < 1e-3
        assert listener.heard[0][1] >= now + 0.9, 'it waits for `reorder`'
        partner.expect({'ORDER': 1})
        sent = time()
        b.publish(at(0.0, 3.0))
        again = listener.wait_for(2)[1]
        assert again.is_recovery and sent - 0.5 <= again.stamp < time() - 0.5, 'at once'
        node.wait_for('messages on /b come later than 0.5 s (`reorder`) after their stamps: '
                      'they take effect when they come; raise `reorder`')
        assert operator.wait_for('topic /b', OK, 'received')['late'] == '1'
