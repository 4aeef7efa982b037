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
changes of a lock or gate, which share lines, and what is not evaluated yet when a node looks.
"""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, ExitStack
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from random import Random
import re
from time import sleep
from typing import Any

from bundles import write_bundle
from diagnostic_msgs.msg import DiagnosticArray
from fret_monitor.model.parts import NodePart
import pytest
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.task import Future
from ros.exported import exported_bundle, ExportedNode
from ros.harness import LATCHED, NodeProcess, Partner, RELIABLE, wait_until
from ros.test_side_by_side import compare_files, equal, Face
from std_msgs.msg import Bool, Empty, Float32
from std_srvs.srv import SetBool

BUNDLE = """
format: 1
evaluation: {POLICY}
inputs:
  speed: {topic: /cmd, type: std_msgs/msg/Float32}
  near: {topic: /near, type: std_msgs/msg/Bool, timeout: 20}
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
LATCH"""
SCENARIOS = {
    'drop': ('policy: relevant_message', 'drop', ''),
    'hold': ('policy: timed, unit: 1', '{hold: 30}', ''),
    'substitute': ('policy: relevant_message', '{substitute: {data: 0.25}}', '    latch: true\n'),
}
NODES = ('python', 'native')
_OF_STATE = re.compile(r"^(lock|gate) '\w+' is |more changes? of|not evaluated yet")


@dataclass
class Gate(Face):
    """What one gate publishes."""

    sent: list[float] = field(default_factory=list)
    braked: int = 0

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

    def _receive(self, message: Any) -> None:
        self.sent.append(message.data)

    def _brake(self, _: Bool) -> None:
        self.braked += 1

    def counts(self, name: str) -> dict[str, str]:
        """Return the values of a status of the last report."""
        return {pair.key: pair.value for status in self.reports[-1][1].status
                if status.name.endswith(name) for pair in status.values}

    def gate_lines(self) -> Counter[tuple[str, str]]:
        """Return the log without violations, and without states, which share lines."""
        return Counter(item for item in self.plain_lines().elements()
                       if not _OF_STATE.search(item[1]))


@contextmanager
def both_gates(path: Path, name: str = 'drive') -> Iterator[list[Gate]]:
    """Run the gate of a bundle in both nodes; they must end well if the test succeeds."""
    with ExitStack() as stack:
        boxes = {name: path.parent / f'blackbox_{name}' for name in NODES}
        options = {name: ('-r', f'__ns:=/{name}', '-p', f'blackbox:={boxes[name]}')
                   for name in NODES}
        program = exported_bundle(path, part=NodePart(name))
        gates = [Gate('python', NodeProcess('gate', '-p', f'spec:={path}', *options['python']),
                      is_simulated=False, is_late=False, blackbox=boxes['python']),
                 Gate('native', ExportedNode(program, *options['native']),
                      is_simulated=False, is_late=False, blackbox=boxes['native'])]
        for gate in gates:
            stack.callback(gate.process.kill)
        try:
            yield gates
        except BaseException:  # noqa: B902  whatever ends the test: the logs are shown
            for gate in gates:
                print(f'---- {gate.name}\n{gate.process.output}')
            raise
        for gate in gates:
            assert gate.process.end() == 0, gate.process.output


class Feeder:
    """Publishes to both gates, and waits for what they do."""

    def __init__(self, partner: Partner, gates: list[Gate]) -> None:
        self._partner = partner
        self._gates = gates
        self._near = partner.publisher(Bool, '/near', RELIABLE)
        self._cmd = partner.publisher(Float32, '/cmd', RELIABLE)
        self._n_near = self.judged = 0
        for gate in gates:
            gate.connect(partner)
        for publisher in (self._near, self._cmd):
            wait_until(lambda: publisher.get_subscription_count() == len(gates),  # noqa: B023
                       f'subscriptions to {publisher.topic_name}')
        wait_until(lambda: all(gate.reports for gate in gates), 'reports')

    def near(self, value: bool) -> None:
        """Publish where the robot is, and wait until both nodes have received it."""
        self._n_near += 1
        self._near.publish(Bool(data=value))
        self._wait_for('topic /near', 'received', self._n_near)

    def command(self, value: float) -> None:
        """Publish a message to be judged."""
        self.judged += 1
        self._cmd.publish(Float32(data=value))

    def settle(self) -> None:
        """Wait until both gates have judged all messages, and have reported it."""
        for gate in self._gates:
            wait_until(lambda: self._judged_by(gate) == self.judged,  # noqa: B023
                       f'{gate.name} has judged')

    @staticmethod
    def _judged_by(gate: Gate) -> int:
        counts = gate.counts('gate drive')
        return int(counts['passed']) + int(counts['withheld'])

    def _wait_for(self, status: str, key: str, wanted: int) -> None:
        for gate in self._gates:
            wait_until(lambda: int(gate.counts(status)[key]) == wanted,  # noqa: B023
                       f'{status} of {gate.name}')


@pytest.mark.parametrize('name', SCENARIOS)
def test_both_gates_pass_and_withhold_the_same(
    partner: Partner, tmp_path: Path, name: str,
) -> None:
    policy, otherwise, latch = SCENARIOS[name]
    text = BUNDLE.replace('POLICY', policy).replace('OTHERWISE', otherwise)
    path, rng = write_bundle(tmp_path, text.replace('LATCH', latch)), Random(3)
    with both_gates(path) as gates:
        feeder = Feeder(partner, gates)
        feeder.command(0.5)  # it is closed: `near` has no value
        feeder.settle()
        for value in (False, True):
            feeder.near(value)
            for _ in range(8):
                feeder.command(rng.choice([0.5, 0.75, 1.5, 2.5]))
            feeder.settle()
        if latch:
            for gate in gates:
                partner.reset(f'/{gate.name}/fret_gate/reset')
        feeder.near(True)  # it is not silent before the commands are judged, however slow it is
        feeder.command(1.0)
        feeder.command(1.75)
        feeder.settle()
        for gate in gates:  # `near` is silent
            wait_until(lambda: 'no message for near' in gate.process.output,  # noqa: B023
                       f'{gate.name} is closed', 60.0)
        feeder.command(0.5)
        feeder.settle()
        equal(lambda gate: Counter(enumerate(gate.sent)), gates, 'messages that were sent')
        equal(lambda gate: gate.violations, gates, 'violations')
        equal(lambda gate: Counter({'braked': gate.braked}), gates, 'actions')
        equal(lambda gate: Counter(gate.counts('gate drive').items()), gates, 'counts')
        equal(Gate.gate_lines, gates, 'lines')
        equal(lambda gate: gate.verdicts()[1], gates, 'violations in lines')
        counts = gates[1].counts('gate drive')
        assert int(counts['passed']) > 5 and int(counts['withheld, violating']) > 1
        assert int(counts['withheld, closed']) >= 2 and counts['not published'] == '0'
        assert gates[0].braked > 0 and gates[0].violations['SLOW'] > 1
        sent = [value for value in gates[1].sent if value == 0.25]
        assert (len(sent) > 3) == (name == 'substitute')
    compare_files(gates, least=8)


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

        for gate in gates:
            gate.connect(partner)
            gate.call(partner)
        wait_until(lambda: all(gate.reports for gate in gates), 'reports')
        ask(False)  # no server
        servers = [gate.serve(stranger) for gate in gates]
        ask(False)  # closed: nothing is known of `safe`
        safe = partner.publisher(Bool, '/safe', RELIABLE)
        wait_until(lambda: safe.get_subscription_count() == 2, 'subscriptions')
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
        for gate in gates:
            other = stranger.node.create_service(SetBool, f'/{gate.name}/arm', gate._serve)
            gate.process.wait_for(f"gate 'arm': /{gate.name}/arm has another server")
            stranger.node.destroy_service(other)
        wait_until(lambda: [gate.counts('gate arm')['not answered'] for gate in gates] == [
            '3', '3'], 'counts')
        assert gates[0].answers == ['withheld', 'withheld', 'withheld', 'done', 'done',
                                    'withheld', 'withheld']
        assert gates[0].answers == gates[1].answers
        assert gates[0].asked == gates[1].asked == [False, True, True, False]
        equal(lambda gate: gate.violations, gates, 'violations')
        equal(lambda gate: Counter(gate.counts('gate arm').items()), gates, 'counts')
        # How often one line is repeated depends on time.
        equal(lambda gate: Counter(set(gate.gate_lines())), gates, 'lines')
        equal(lambda gate: gate.verdicts()[1], gates, 'violations in lines')
        assert gates[1].counts('gate arm')['passed'] == '4'
    kept = [len(gate.kept()) for gate in gates]  # the stamps of the events differ
    assert kept[0] == kept[1] > 5


def test_a_gate_in_c_follows_the_durability_of_the_source_and_names_others(
    partner: Partner, stranger: Partner, tmp_path: Path,
) -> None:
    path = write_bundle(tmp_path, BUNDLE.replace('POLICY', 'policy: relevant_message').replace(
        'OTHERWISE', 'drop').replace('LATCH', ''))
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
    path = write_bundle(tmp_path, BUNDLE.replace('POLICY', 'policy: relevant_message').replace(
        'OTHERWISE', 'drop').replace('LATCH', ''))
    node = ExportedNode(exported_bundle(path, part=NodePart('drive')), '-r', 'out:=/cmd')
    assert node.status() == 1
    assert 'these gates are a circle: /cmd -> /cmd' in node.output
    node.kill()
