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

"""The monitor as a process, under simulated and real time: periods and timeouts."""

from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
import signal
from time import sleep

from bundles import spec_of, write_bundle
from diagnostic_msgs.msg import DiagnosticArray
from fret_monitor.model.names import DETAILS_TOPIC
import pytest
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParameters
from ros.exported import monitoring, NODES
from ros.harness import answer_of, NodeProcess, Partner, started, wait_until
from ros.operators import Operator
from ros.received import Detail, read_detail
from ros.simulator import simulating, Simulator
from std_msgs.msg import Bool, Float32
from strategies import HOT_PATHS

PERIODIC = """
format: 1
inputs:
  p: {topic: p, type: std_msgs/msg/Bool}
evaluation: {policy: periodic, period: 0.1}
requirements:
  - {id: R, ptltl: "p"}
"""
SILENT = """
format: 1
inputs:
  x: {topic: x, type: std_msgs/msg/Float32, timeout: 1.0, startup: 1.5, stale: violate}
  y: {topic: y, type: std_msgs/msg/Float32, timeout: 1.0}
  z: {topic: z, type: std_msgs/msg/Float32}
evaluation: {policy: relevant_message}
requirements:
  - {id: X, ptltl: "x < 2.0"}
  - {id: ONSET, ptltl: "x < 3.0", report: onset}
  - {id: XZ, ptltl: "x < 2.0 | z < 2.0"}
  - {id: Y, ptltl: "y < 2.0"}
"""
# What a stopped reader has lost, Fast DDS sends again within 3 s, and later messages wait for it.
STOPPED = """
format: 1
inputs:
  x: {topic: x, type: std_msgs/msg/Float32, timeout: 5.0, stale: violate}
  p: {topic: p, type: std_msgs/msg/Bool}
evaluation: {policy: periodic, period: 0.125}
requirements:
  - {id: X, ptltl: "x < 2.0"}
  - {id: R, ptltl: "p"}
"""
SLOW = """
format: 1
for_each: {robot: [alpha, beta]}
inputs:
  v: {topic: v, type: std_msgs/msg/Float32, timeout: 0.5, startup: 3}
  w: {topic: "/{robot}/w", type: std_msgs/msg/Float32, timeout: 0.5, startup: 3}
requirements:
  - {id: V, ptltl: "v < 2.0"}
  - {id: W, ptltl: "w < 2.0"}
"""
SIMULATED = ('-p', 'use_sim_time:=true')


@pytest.fixture
def simulator(domain: int) -> Iterator[Simulator]:
    with simulating() as simulator:
        yield simulator


@pytest.fixture
def operator(partner: Partner) -> Operator:
    return Operator(partner)


def since(before: dict[str, int], now: dict[str, int]) -> dict[str, int]:
    return {key: now[key] - before[key] for key in now}


def counted(counts: dict[str, int]) -> tuple[int, int, int]:
    return counts['taken'], counts['missed'], counts['restarts']


def test_steps_follow_the_clock_through_pauses_speed_changes_and_jumps(
    partner: Partner, operator: Operator, simulator: Simulator, tmp_path: Path,
) -> None:
    with started('monitor', '-p', spec_of(tmp_path, PERIODIC), *SIMULATED) as node:
        partner.listen('R')
        p = partner.publisher(Bool, 'p')
        partner.wait_for_listener(p)
        p.publish(Bool(data=False))
        operator.wait_for('topic /p', b'\0', 'received')
        assert operator.periods()['taken'] == 0
        simulator.jump(1000.0)
        simulator.go(1.0)
        before = operator.periods()
        assert 0 < before['taken'] <= 10 and before['missed'] == 0, 'there was no time before'

        simulator.go(5.0)
        assert counted(since(before, operator.periods())) == (50, 0, 0)

        before = operator.periods()
        operator.wait(2)  # simulated time stands still
        assert operator.periods() == before

        simulator.go(60.0, speed=20.0)
        assert counted(since(before, operator.periods())) == (600, 0, 0)

        before = operator.periods()
        simulator.jump(3600.0)
        assert counted(since(before, operator.periods())) == (1000, 35000, 0)
        node.wait_for('missed (no step)')

        before = operator.periods()
        simulator.jump(-4000.0)
        node.wait_for('time went back, to ')  # of two unread readings only the last is kept
        simulator.go(2.0)
        assert counted(since(before, operator.periods())) == (20, 0, 1)
        # Each step violates R, and each violation is published.
        partner.expect({'R': operator.periods()['taken']})


def test_without_a_clock_the_waiting_bundle_is_reported(partner: Partner, tmp_path: Path) -> None:
    with started('monitor', '-p', spec_of(tmp_path, PERIODIC), *SIMULATED) as node:
        node.wait_for('use_sim_time is set and nothing was received on /clock: no period ')


def simulate(partner: Partner, is_simulated: bool) -> None:
    """Set `use_sim_time` of the monitor."""
    client = partner.node.create_client(SetParameters, '/fret_monitor/set_parameters')
    answer = answer_of(client, SetParameters.Request(parameters=[Parameter(
        name='use_sim_time', value=ParameterValue(type=1, bool_value=is_simulated))]))
    assert answer.results[0].successful


def test_use_sim_time_may_change_while_the_monitor_runs(
    partner: Partner, operator: Operator, simulator: Simulator, tmp_path: Path,
) -> None:
    with started('monitor', '-p', spec_of(tmp_path, PERIODIC)):
        assert int(operator.wait_for('periods of bundle', b'\0', 'in time')['taken']) > 0
        simulate(partner, True)
        simulator.jump(1000.0)
        operator.periods()  # until no more steps come
        before = operator.periods()
        simulator.go(2.0)
        assert counted(since(before, operator.periods())) == (20, 0, 0)
        simulate(partner, False)
        taken = int(operator.status('periods of bundle')[2]['taken'])
        wait_until(lambda: int(operator.status('periods of bundle')[2]['taken']) > taken + 20,
                   'steps in real time')
        found = operator.status('periods of bundle')[2]
        assert (found['missed'], found['restarts']) == ('0', '0'), 'a change is no jump'


@pytest.mark.parametrize('hot_path', HOT_PATHS)
def test_a_stopped_process_loses_no_period_and_finds_no_silence(
    partner: Partner, operator: Operator, tmp_path: Path, hot_path: str,
) -> None:
    details: list[tuple[str, Detail]] = []

    def keep(array: DiagnosticArray) -> None:
        for status in array.status:
            detail = read_detail(status)
            details.append((status.name, detail))

    spec = spec_of(tmp_path, STOPPED)
    with started('monitor', '-p', spec, '-p', f'hot_path:={hot_path}') as node:
        partner.node.create_subscription(DiagnosticArray, DETAILS_TOPIC, keep, 1000)
        partner.listen('R', 'X')
        x, p = partner.publisher(Float32, 'x'), partner.publisher(Bool, 'p')
        partner.wait_for_listener(x, p)
        x.publish(Float32(data=1.0))
        timer = partner.node.create_timer(0.1, lambda: x.publish(Float32(data=1.0)))
        p.publish(Bool(data=False))
        operator.wait_for('X', b'\0', 'satisfied')
        wait_until(lambda: len(details) > 3, 'details')
        before = operator.status('periods of bundle')[2]
        silences = silence(node)
        node.process.send_signal(signal.SIGSTOP)
        sleep(10.0)  # messages are queued, and no thread runs
        node.process.send_signal(signal.SIGCONT)
        operator.wait(3)
        after = operator.status('periods of bundle')[2]
        assert (after['missed'], after['restarts']) == ('0', '0')
        assert int(after['taken']) - int(before['taken']) >= 80
        assert int(after['late']) - int(before['late']) >= 70
        assert silence(node) == silences <= 1, 'perhaps once, at the start'
        node.wait_for('0 missed (no step)')
        stamps = [round(detail.stamp * 1e6) for name, detail in details if name.endswith('R')]
        assert len(stamps) > 90
        # 125000 us; microseconds, since a detail's time is read as a float
        assert all(abs(later - stamp - 125000) <= 2 for stamp, later in pairwise(stamps))
        partner.node.destroy_timer(timer)
        operator.wait_for('X', b'\2', 'violated: no message for x')
        assert partner.heard['X'] > 0


def test_switching_use_sim_time_on_and_off_is_no_silence_and_no_jump(
    partner: Partner, operator: Operator, simulator: Simulator, tmp_path: Path,
) -> None:
    with started('monitor', '-p', spec_of(tmp_path, STOPPED)) as node:
        x = partner.publisher(Float32, 'x')
        partner.node.create_timer(0.1, lambda: x.publish(Float32(data=1.0)))
        operator.wait_for('X', b'\0', 'satisfied')
        before = silence(node)
        simulator.jump(5000.0)
        for number in range(3):
            simulate(partner, True)
            simulator.go(2.0, stride=0.01, speed=1.0)
            simulate(partner, False)
            operator.wait(2)
            assert silence(node) == before, f'after {number} switches'
        found = operator.status('periods of bundle')[2]
        assert (found['missed'], found['restarts']) == ('0', '0')


def silence(node: NodeProcess) -> int:
    return node.output.count('no usable value on /x within the timeout of')


def wait_for_log(operator: Operator) -> None:
    operator.wait(2)  # the log is written with each report


@pytest.mark.parametrize('hot_path', HOT_PATHS)
def test_an_input_that_falls_silent_violates_its_requirements_in_the_time_of_the_node(
    partner: Partner, operator: Operator, simulator: Simulator, tmp_path: Path, hot_path: str,
) -> None:
    with started('monitor', '-p', spec_of(tmp_path, SILENT), *SIMULATED,
                 '-p', f'hot_path:={hot_path}') as node:
        partner.listen('X', 'ONSET', 'XZ', 'Y')
        x, y = (partner.publisher(Float32, name) for name in 'xy')
        partner.wait_for_listener(x, y)
        simulator.go(0.5)
        simulator.jump(1000.0)
        for publisher in (x, y):
            publisher.publish(Float32(data=1.0))
        operator.wait_for('Y', b'\0', 'satisfied')
        operator.wait_for('X', b'\0', 'satisfied')
        simulator.go(0.8)
        operator.wait(3)  # a simulation that stands still is no silence
        assert silence(node) == 0
        simulator.go(2.0)  # longer, since a timeout may be put off after the clock has jumped
        # X has a value and XZ waits for z: each is reported at once, and once only.
        partner.expect({'X': 1, 'ONSET': 1, 'XZ': 1})
        wait_for_log(operator)
        assert silence(node) == 1
        assert "for 'x': X, ONSET, XZ violated until one comes" in node.output
        assert "value on /y within the timeout of 1 s for 'y'" in node.output
        operator.wait_for('X', b'\2', 'violated: no message for x')
        operator.wait_for('Y', b'\1', 'satisfied, on old values of y')
        values = operator.wait_for('topic /x', b'\2', 's of x')
        assert (values['silences x'], values['received']) == ('1', '1')
        operator.wait_for('topic /y', b'\1', 's of y')

        partner.reset()
        simulator.go(0.3)
        partner.expect({'X': 2, 'ONSET': 2, 'XZ': 2})
        wait_for_log(operator)
        assert silence(node) == 1
        simulator.go(5.0, speed=10.0)
        partner.expect({'X': 2, 'ONSET': 2, 'XZ': 2})

        x.publish(Float32(data=1.0))
        operator.wait_for('X', b'\0', 'satisfied')
        node.wait_for('values on /x again after')
        operator.wait_for('XZ', b'\1', 'no value yet of z')
        simulator.jump(3600.0)
        simulator.go(0.5)
        operator.wait(2)  # a jump is no silence
        assert silence(node) == 1
        x.publish(Float32(data=2.5))  # X is violated by its value, ONSET is not
        partner.expect({'X': 3, 'ONSET': 2, 'XZ': 2})
        simulator.go(3.0)
        partner.expect({'X': 4, 'ONSET': 3, 'XZ': 3})


def test_in_real_time_an_input_without_messages_is_reported_and_one_with_messages_is_not(
    partner: Partner, operator: Operator, tmp_path: Path,
) -> None:
    with started('monitor', '-p', spec_of(tmp_path, SILENT)) as node:
        partner.listen('X', 'ONSET', 'XZ', 'Y')
        y = partner.publisher(Float32, 'y')
        partner.node.create_timer(0.1, lambda: y.publish(Float32(data=1.0)))
        operator.wait_for('X', b'\2', 'violated: no message for x')
        operator.wait_for('Y', b'\0', 'satisfied')
        node.wait_for("for 'x': X, ONSET, XZ violated until one comes")
        assert 'no usable value on /x within the startup of 1.5 s' in node.output
        operator.wait(4)
        assert "s for 'y'" not in node.output, 'it may take ten seconds to start'


@pytest.mark.parametrize('kind', NODES)
def test_the_end_of_the_startup_is_logged_as_such_although_a_value_has_come_meanwhile(
    partner: Partner, operator: Operator, simulator: Simulator, tmp_path: Path, kind: str,
) -> None:
    with monitoring(kind, write_bundle(tmp_path, SLOW), *SIMULATED) as node:
        v = partner.publisher(Float32, 'v')
        partner.wait_for_listener(v)
        simulator.go(2.9)
        operator.wait(1)  # the log is written now, and again after all that follows
        simulator.go(0.6, speed=6.0)
        v.publish(Float32(data=1.0))
        node.wait_for('values on /v again after 3.')
        node.wait_for("s for 'w', of")
        found = [line.partition('no usable value ')[2] for line in node.output.splitlines()
                 if 'no usable value ' in line]
        assert found == ["on /v within the startup of 3 s for 'v'",
                         "on /{robot}/w within the startup of 3 s for 'w', of 2 instances"]
