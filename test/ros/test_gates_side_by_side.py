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

"""
The gate of the node on rclpy and that of the node on rcl, side by side: they pass the same.

Both gates judge the same messages, have a lock, an action and a black box, and publish in
namespaces of their own. A message of another topic is waited for in both nodes before the next
one to be judged. What is published, announced and counted is equal, and so is the log, but for
changes of a lock or gate, which share lines. Silences are those of `/clock`, which does not run
on while messages are judged; at a rate, the number of substitutes is not compared.

On `/clock`, a gate closes while its process has no processor for half a second, unless `stale` is
`open`: a node that stood still says so, and then the scenario is played again.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager, ExitStack
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from pathlib import Path
from random import Random
import re
from time import sleep
from typing import Any

from builtin_interfaces.msg import Time
from bundles import write_bundle
from diagnostic_msgs.msg import DiagnosticArray
from fret_monitor.model.parts import NodePart
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
import pytest
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.task import Future
from ros.exported import exported_bundle, ExportedNode
from ros.harness import (
    change_state, LATCHED, NodeProcess, Partner, PATIENCE, RELIABLE, settle, wait_until,
)
from ros.test_side_by_side import compare_files, equal, Face, MISSING
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Bool, Empty, Float32
from std_srvs.srv import SetBool
from strategies import thorough

BUNDLE = """
format: 1
evaluation: {POLICY}
inputs:
  speed: {topic: /cmd, type: std_msgs/msg/Float32}
  near: {topic: /near, type: std_msgs/msg/Bool, TIMEOUT}
requirements:
  - id: SLOW
    ptltl: "H (near -> speed <= 1.0)"
    report: occurrence
    on_violation: [stop, brake]
actions:
  stop: {lock: {topic: e_stop, rate: 10}}
  brake: {publish: {topic: braked, type: std_msgs/msg/Bool, message: {data: true}}}
gates:
  drive:
    from: /cmd
    to: out
    type: std_msgs/msg/Float32
    keep: [SLOW]
    otherwise: OTHERWISE
    RULES
"""
SECOND_NS = 10**9
TIMEOUT_NS = 4 * SECOND_NS


@dataclass(frozen=True)
class Scenario:
    """The rules of a gate, and whether it runs on `/clock`."""

    policy: str
    otherwise: str
    rules: str = 'latch: false'
    is_simulated: bool = True

    @property
    def text(self) -> str:
        """Return the bundle."""
        timeout = 'timeout: 4, startup: 1000' if self.is_simulated else 'timeout: 59'
        return BUNDLE.replace('POLICY', self.policy).replace('OTHERWISE', self.otherwise).replace(
            'RULES', self.rules).replace('TIMEOUT', timeout)

    @property
    def has_rate(self) -> bool:
        """Return whether substitutes are sent at a rate."""
        return 'rate' in self.otherwise


SCENARIOS = {
    'drop': Scenario('policy: every_message', 'drop', is_simulated=False),
    'hold': Scenario('policy: timed, unit: 1', '{hold: 300}', 'stale: open'),
    'substitute': Scenario(
        'policy: relevant_message', '{substitute: {data: 0.25}}', 'latch: true'),
    'rate': Scenario(
        'policy: timed, unit: 1', '{substitute: {data: 0.25}, rate: 20}', 'stale: open'),
}
PLAIN = Scenario('policy: relevant_message', 'drop', is_simulated=False)
NODES = ('python', 'native')
SUBSTITUTE = 0.25
STOOD_STILL = 'this node stood still'
_OF_STATE = re.compile(r"^(lock|gate) '\w+' is |more changes? of")


@dataclass
class Gate(Face):
    """What one gate publishes."""

    sent: list[float] = field(default_factory=list)
    braked: int = 0
    is_locked: bool | None = None

    def connect(self, partner: Partner) -> None:
        """Subscribe to what it publishes."""
        make = partner.node.create_subscription
        make(Float32, f'/{self.name}/out', self._receive, RELIABLE)
        for name in ('SLOW', 'ARMED'):
            make(Empty, f'/{self.name}/copilot/handlerprop{name}', partial(self._count, name),
                 RELIABLE)
        report: Any = self.take_report  # rclpy gives two arguments to whoever takes two
        make(DiagnosticArray, '/diagnostics', report, 10)
        make(Bool, f'/{self.name}/braked', self._brake, RELIABLE)
        make(Bool, f'/{self.name}/e_stop', self._lock, RELIABLE)

    def _receive(self, message: Any) -> None:
        self.sent.append(message.data)

    def _brake(self, _: Bool) -> None:
        self.braked += 1

    def _lock(self, message: Any) -> None:
        self.is_locked = message.data

    def commands(self, *, has_rate: bool) -> list[float]:
        """Return what was sent; with a rate, substitutes in a row as one."""
        return [value for before, value in pairwise([-1.0, *self.sent])
                if not has_rate or (before, value) != (SUBSTITUTE, SUBSTITUTE)]

    def stamp(self) -> int:
        """Return the time of the last report, in ns."""
        stamp = self.reports[-1][1].header.stamp if self.reports else Time()
        return int(stamp.sec * SECOND_NS + stamp.nanosec)

    def counts(self, name: str) -> dict[str, str]:
        """Return the values of a status of the last report."""
        return {pair.key: pair.value for status in self.reports[-1][1].status
                if status.name.endswith(name) for pair in status.values}

    def gate_lines(self) -> Counter[tuple[str, str]]:
        """Return the log without violations, and without states, which share lines."""
        return Counter(item for item in self.plain_lines().elements()
                       if not _OF_STATE.search(item[1]))


@contextmanager
def both_gates(
    path: Path, name: str = 'drive', *, is_simulated: bool = False, more: Sequence[str] = (),
) -> Iterator[list[Gate]]:
    """Run the gate of a bundle in both nodes; they must end well if the test succeeds."""
    with ExitStack() as stack:
        boxes = {name: path.parent / f'blackbox_{name}' for name in NODES}
        options = {name: ('-r', f'__ns:=/{name}', '-p', f'blackbox:={boxes[name]}',
                          '-p', 'blackbox_seconds:=300.0',
                          '-p', f'use_sim_time:={is_simulated}'.lower(), *more)
                   for name in NODES}
        program = exported_bundle(path, part=NodePart(name))
        gates = [Gate('python', NodeProcess('gate', '-p', f'spec:={path}', *options['python']),
                      is_simulated, is_late=False, blackbox=boxes['python']),
                 Gate('native', ExportedNode(program, *options['native']),
                      is_simulated, is_late=False, blackbox=boxes['native'])]
        for gate in gates:
            stack.callback(gate.process.kill)
        try:
            for gate in gates:
                gate.process.wait_for('watching', 4 * PATIENCE)  # the first one has to compile
            yield gates
        except BaseException:  # noqa: B902  whatever ends the test: the logs are shown
            for gate in gates:
                print(f'---- {gate.name}\n{gate.process.output}')
            raise
        for gate in gates:
            assert gate.process.end() == 0, gate.process.output


class Feeder:
    """Publishes to both gates, and waits for what they do."""

    def __init__(self, partner: Partner, gates: list[Gate], *, is_simulated: bool) -> None:
        self._gates = gates
        self._near = partner.publisher(Bool, '/near', RELIABLE)
        self._cmd = partner.publisher(Float32, '/cmd', RELIABLE)
        self._clock = partner.publisher(Clock, '/clock', RELIABLE) if is_simulated else None
        self._n_near = self.judged = 0
        self.now = 0
        for gate in gates:
            gate.connect(partner)
        partner.wait_for_subscriptions(len(gates), self._near, self._cmd)
        if self._clock is not None:
            clock = self._clock
            wait_until(lambda: clock.get_subscription_count() == len(gates), '/clock')
        wait_until(lambda: all(gate.reports for gate in gates), 'reports')

    def move(self, by: int) -> None:
        """Move `/clock`, and wait until both nodes report its time; without it, nothing."""
        publisher = self._clock
        if publisher is None:
            return
        self.now += by
        clock = Clock()
        clock.clock.sec, clock.clock.nanosec = divmod(self.now, SECOND_NS)

        def is_reported() -> bool:
            publisher.publish(clock)  # best effort
            return all(gate.stamp() == self.now for gate in self._gates)

        wait_until(is_reported, '/clock')

    def near(self, value: bool) -> None:
        """Publish where the robot is, and wait until both nodes have received it."""
        self.publish_near(value)
        for gate in self._gates:
            wait_until(lambda: int(gate.counts('topic /near')['received']) ==  # noqa: B023
                       self._n_near, f'topic /near of {gate.name}')

    def publish_near(self, value: bool) -> None:
        """Publish where the robot is."""
        self._n_near += 1
        self._near.publish(Bool(data=value))

    def publish(self, *values: float) -> None:
        """Publish messages to be judged."""
        for value in values:
            self.judged += 1
            self._cmd.publish(Float32(data=value))

    def judge(self, *values: float) -> None:
        """Publish messages, and wait until both gates have judged and reported all of them."""
        self.publish(*values)
        for gate in self._gates:
            wait_until(lambda: self._judged_by(gate) == self.judged,  # noqa: B023
                       f'{gate.name} has judged')

    def expect_locks(self, are_locked: bool) -> None:
        """Wait until both nodes publish this state of the lock."""
        wait_until(lambda: all(gate.is_locked is are_locked for gate in self._gates), 'locks')

    @staticmethod
    def _judged_by(gate: Gate) -> int:
        counts = gate.counts('gate drive')
        return int(counts['passed']) + int(counts['withheld'])


def play_on_clock(feeder: Feeder) -> None:
    """Let an input become silent, and `/clock` stand and go back, between messages."""
    feeder.near(True)
    feeder.move(TIMEOUT_NS)  # what comes now still comes in time
    feeder.judge(0.5, 2.0)
    feeder.move(SECOND_NS)
    feeder.judge(0.75, 2.25)  # silent
    feeder.near(False)
    feeder.judge(1.75, 0.5)
    feeder.move(SECOND_NS)
    feeder.near(True)
    feeder.judge(2.75)
    feeder.move(-60 * SECOND_NS)
    feeder.judge(0.5, 1.5)
    feeder.near(False)
    feeder.judge(1.25, 0.75)
    feeder.move(TIMEOUT_NS + 1)
    feeder.judge(2.25)
    feeder.near(True)
    # The last message violates: a file has what comes within two seconds after a violation.
    feeder.judge(2.75)


def compare(gates: list[Gate], scenario: Scenario) -> None:
    """Compare all that the gates have published, counted and logged."""
    equal(lambda gate: Counter(enumerate(gate.commands(has_rate=scenario.has_rate))), gates,
          'messages that were sent')
    equal(lambda gate: gate.violations, gates, 'violations')
    equal(lambda gate: Counter({'braked': gate.braked}), gates, 'actions')
    equal(lambda gate: Counter(
        (key, value) for key, value in gate.counts('gate drive').items()
        if not scenario.has_rate or key != 'replaced'), gates, 'counts')
    equal(Gate.gate_lines, gates, 'lines')
    equal(lambda gate: gate.verdicts()[1], gates, 'violations in lines')


def play(feeder: Feeder, gates: list[Gate], partner: Partner, *, latches: bool) -> None:
    """Give messages to both gates, one after the other."""
    rng = Random(3)
    for gate in gates:  # five seconds after its start
        gate.process.wait_for('SLOW is not evaluated yet')
    feeder.move(1000 * SECOND_NS)
    feeder.judge(0.5)  # it is closed: `near` has no value
    for value in (False, True):
        feeder.near(value)
        values = [rng.choice([0.5, 0.75, 1.5, 2.5]) for _ in range(7)]
        # Of violations within milliseconds an action may follow only one.
        feeder.judge(*(sorted(values) if value else values), 2.5)
    feeder.expect_locks(True)
    if latches:
        feeder.judge(0.5)
        for gate in gates:
            partner.reset(f'/{gate.name}/fret_gate/reset')
    feeder.judge(1.0)
    feeder.expect_locks(False)
    feeder.judge(1.75)
    feeder.expect_locks(True)


def play_scenario(partner: Partner, folder: Path, scenario: Scenario) -> bool:
    """Play a scenario, and compare; return False if a node stood still, and so they differ."""
    with both_gates(write_bundle(folder, scenario.text),
                    is_simulated=scenario.is_simulated) as gates:
        feeder = Feeder(partner, gates, is_simulated=scenario.is_simulated)
        try:
            play(feeder, gates, partner, latches='latch: true' in scenario.rules)
            if scenario.is_simulated:
                play_on_clock(feeder)
            compare(gates, scenario)
        except AssertionError:
            if any(STOOD_STILL in gate.process.output for gate in gates):
                return False
            raise
        counts = gates[1].counts('gate drive')
        assert int(counts['passed']) > 5 and int(counts['withheld, violating']) > 1
        assert int(counts['withheld, closed']) >= 1 and counts['not published'] == '0'
        assert gates[0].braked > 1 and gates[0].violations['SLOW'] > 1
        assert (gates[1].sent.count(SUBSTITUTE) > 3) == ('substitute' in scenario.otherwise)
    compare_files(gates, least=8)
    return True


@pytest.mark.parametrize('name', [
    pytest.param(name, marks=() if name == 'hold' else thorough) for name in SCENARIOS])
def test_both_gates_pass_and_withhold_the_same(
    domain: int, tmp_path: Path, name: str,
) -> None:
    for attempt in range(3):
        folder = tmp_path / str(attempt)
        folder.mkdir()
        with closing(Partner(domain)) as partner:
            if play_scenario(partner, folder, SCENARIOS[name]):
                return
    raise AssertionError('a node stood still, three times')


ON_SERVICE = """
format: 1
evaluation: {policy: relevant_message}
inputs:
  data: {topic: arm/_service_event, type: std_srvs/srv/SetBool_Event, field: "request[0].data"}
  safe: {topic: /safe, type: std_msgs/msg/Bool, timeout: 60}
requirements:
  - {id: ARMED, ptltl: "data -> safe", on_violation: [stop]}
actions:
  stop: {lock: {topic: e_stop, rate: 10}}
gates:
  arm:
    service: arm
    to: arm_raw
    type: std_srvs/srv/SetBool
    keep: [ARMED]
    timeout: 2
    otherwise: {respond: {success: false, message: withheld}}
"""


@dataclass
class ServiceGate(Gate):
    """A gate on a service, with its callers and the real server."""

    asked: list[bool] = field(default_factory=list)
    answers: list[str] = field(default_factory=list)

    def call(self, partner: Partner) -> None:
        """Make the client of the gate, once it offers its service."""
        self.client = partner.node.create_client(SetBool, f'/{self.name}/arm')
        wait_until(self.client.service_is_ready, f'the service of {self.name}')

    def serve(self, partner: Partner) -> Any:
        """Offer the real service, and wait until the gate has found it."""
        place = f'/{self.name}/arm_raw'
        service = partner.node.create_service(
            SetBool, place, self._serve, callback_group=ReentrantCallbackGroup())
        wait_until(lambda: partner.node.count_clients(place) == 1, 'the client of the gate')
        return service

    async def _serve(self, request: Any, response: Any) -> Any:
        self.asked.append(request.data)
        if len(self.asked) > 2:
            await Future()  # it hangs
        response.success, response.message = True, 'done'
        return response

    def ask(self, data: bool) -> Future:
        """Send a request."""
        answer = self.client.call_async(SetBool.Request(data=data))
        answer.add_done_callback(lambda done: self.answers.append(done.result().message))
        return answer


def refuse_when_deactivated(gate: ServiceGate, partner: Partner, stranger: Partner) -> None:
    """Deactivate a gate while a request waits for the server; it answers, and can go on."""
    server = gate.serve(stranger)

    def passed() -> int:
        return int(gate.counts('gate arm')['passed'])

    before = passed()
    while passed() == before:  # one that finds no server yet is refused
        answer = gate.ask(False)
        wait_until(lambda: answer.done() or passed() > before, 'a request')  # noqa: B023
    change = partner.node.create_client(ChangeState, f'/{gate.name}/fret_gate/change_state')
    assert change_state(change, Transition.TRANSITION_DEACTIVATE)
    wait_until(answer.done, 'the answer')
    assert answer.result().message == 'withheld'
    assert change_state(change, Transition.TRANSITION_ACTIVATE)
    stranger.node.destroy_service(server)


def test_both_gates_on_a_service_answer_the_same(
    partner: Partner, stranger: Partner, tmp_path: Path,
) -> None:
    path = write_bundle(tmp_path, ON_SERVICE)
    with both_gates(path, 'arm') as faces:
        gates = [ServiceGate(gate.name, gate.process, is_simulated=False, is_late=False,
                             blackbox=gate.blackbox) for gate in faces]

        def ask(*requests: bool) -> None:
            for data in requests:
                answers = [gate.ask(data) for gate in gates]
                wait_until(lambda: all(answer.done() for answer in answers),  # noqa: B023
                           'answers')

        servers = [gate.serve(stranger) for gate in gates]
        safe = partner.publisher(Bool, '/safe', RELIABLE)
        for gate in gates:
            gate.connect(partner)
            gate.call(partner)
            gate.process.wait_for('subscribed anew to /safe')
        wait_until(lambda: all(gate.reports for gate in gates), 'reports')
        settle(1.0)  # both sides have to find each other
        ask(False)  # closed: nothing is known of `safe`
        safe.publish(Bool(data=False))
        for gate in gates:
            wait_until(lambda: gate.counts('topic /safe')['received'] == '1',  # noqa: B023
                       'the message')
        ask(True, False)
        safe.publish(Bool(data=True))
        for gate in gates:
            wait_until(lambda: gate.counts('topic /safe')['received'] == '2',  # noqa: B023
                       'the message')
        ask(True, True)  # the second of these hangs, for 2 s
        waiting = [gate.ask(False) for gate in gates]
        wait_until(lambda: all(len(gate.asked) == 4 for gate in gates), 'requests')
        for server in servers:  # they go while a request waits
            stranger.node.destroy_service(server)
        wait_until(lambda: all(answer.done() for answer in waiting), 'answers')
        ask(False)  # no server
        for gate in gates:
            other = stranger.node.create_service(SetBool, f'/{gate.name}/arm', gate._serve)
            gate.process.wait_for(f"gate 'arm': /{gate.name}/arm has another server")
            stranger.node.destroy_service(other)
        wait_until(lambda: [gate.counts('gate arm')['not answered'] for gate in gates] == [
            '3', '3'], 'counts')
        assert gates[0].answers == ['withheld', 'withheld', 'done', 'done', 'withheld',
                                    'withheld', 'withheld']
        assert gates[0].answers == gates[1].answers
        assert gates[0].asked == gates[1].asked == [False, True, True, False]
        equal(lambda gate: gate.violations, gates, 'violations')
        equal(lambda gate: Counter(gate.counts('gate arm').items()), gates, 'counts')
        # How often a line is repeated, and what is evaluated after five seconds, depends on time.
        equal(lambda gate: Counter(line for line in gate.gate_lines() if MISSING not in line),
              gates, 'lines')
        equal(lambda gate: gate.verdicts()[1], gates, 'violations in lines')
        assert gates[1].counts('gate arm')['passed'] == '4'
        for gate in gates:
            refuse_when_deactivated(gate, partner, stranger)
    # The stamps of the events differ, and so does what still came after a violation.
    kept = [{str(item[0]).replace(f'/{gate.name}/', '/NODE/') for item in gate.kept()}
            for gate in gates]
    assert kept[0] == kept[1] and len(kept[0]) > 1


def test_a_gate_in_c_follows_the_durability_of_the_source_and_names_others(
    partner: Partner, stranger: Partner, tmp_path: Path,
) -> None:
    path = write_bundle(tmp_path, PLAIN.text)
    node = ExportedNode(exported_bundle(path, part=NodePart('drive')))
    try:
        node.wait_for("gate 'drive': /cmd -> /out, keeps SLOW; otherwise nothing is sent")
        near = partner.publisher(Bool, '/near', LATCHED)
        near.publish(Bool(data=False))
        node.wait_for("gate 'drive' is open")
        command = partner.publisher(Float32, '/cmd', LATCHED)
        wait_until(lambda: command.get_subscription_count() == 1, 'the subscription')
        command.publish(Float32(data=0.5))

        def is_durable() -> bool:
            return [item.qos_profile.durability for item in
                    partner.node.get_publishers_info_by_topic('/out')] == [LATCHED.durability]

        wait_until(is_durable, 'a publisher that is transient local')
        received: list[float] = []

        def receive(message: Any) -> None:
            received.append(message.data)

        partner.node.create_subscription(Float32, '/out', receive, LATCHED)
        command.publish(Float32(data=0.75))
        wait_until(lambda: 0.75 in received, 'the message')
        other = stranger.publisher(Float32, '/out', RELIABLE)
        node.wait_for('/partner publishes on /out too: what does not pass the gate is not judged')
        stranger.node.destroy_publisher(other)
        node.process.kill()
        node.process.wait()
        received.clear()
        for _ in range(20):
            command.publish(Float32(data=0.5))
            sleep(0.02)
        assert received == []  # nothing passes a gate that is dead
    finally:
        node.kill()


def test_a_gate_in_c_whose_ends_are_one_topic_is_refused(tmp_path: Path, domain: int) -> None:
    path = write_bundle(tmp_path, PLAIN.text)
    node = ExportedNode(exported_bundle(path, part=NodePart('drive')), '-r', 'out:=/cmd')
    assert 'these gates are a circle: /cmd -> /cmd' in node.error()
