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
The node that `export --to ros2` writes, beside the monitor in Python, in one graph.

Both receive the same messages, with faults; their violations, details and diagnostics are equal.
The node is built once for each bundle of this module.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
import random
import re
import signal
from time import sleep
from typing import Any

from bundles import write_bundle
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
import pytest
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters
from ros.exported import cmake_build, exported_bundle, ExportedNode, has_ament_cmake, running
from ros.harness import (
    BEST_EFFORT, LATCHED, NodeProcess, Partner, PATIENCE, RELIABLE, started, wait_until,
)
from ros.received import read_detail
from ros.simulator import simulating
from ros.talker import talking
from std_msgs.msg import Bool, Float32, Header, Int32, String, UInt8
from std_srvs.srv import Trigger

sensor_msgs = pytest.importorskip('sensor_msgs.msg')

FAULTS = """
format: 1
inputs:
  n: {topic: n, type: std_msgs/msg/Int32, qos: {depth: 5000}}
  x: {topic: topic/x, type: std_msgs/msg/Float32, timeout: 1.0, startup: 60, stale: violate}
  elbow: {topic: joints, type: sensor_msgs/msg/JointState, field: "position[1]"}
  reach: {topic: joints, type: sensor_msgs/msg/JointState, field: max(position)}
  state: {topic: state, type: std_msgs/msg/String, values: {IDLE: "idle", MOVING: "moving"}}
  level: {topic: level, type: std_msgs/msg/UInt8, initial: 7, values: {LOW: 1, HIGH: 200}}
  fixed: {topic: fixed, type: std_msgs/msg/Bool, qos: {reliability: reliable}}
constants: {limit: 0.7, odd: 9007199254740993, most: 18446744073709551615}
evaluation: {policy: relevant_message}
requirements:
  - {id: GREETING, ptltl: "n != -1"}
  - {id: NEXT, cocospec: "true -> (n <= 0 or n = pre n + 1)"}
  - {id: X-1, title: "x is \\"small\\"", ptltl: "x < limit -> O[0,3] (x > 0.2)"}
  - {id: X-2, ptltl: "Y (x > 0.3) | x > 0.5", report: onset, severity: warn}
  - {id: ELBOW, ptltl: "elbow < 1.0 & reach < 4.0"}
  - {id: STILL, ptltl: "state = IDLE -> level = HIGH"}
  - {id: LEVEL, ptltl: "H (level != HIGH)", report: occurrence}
  - {id: FIXED, ptltl: "fixed"}
  - {id: KEPT, ptltl: "n < 9"}
gates:
  numbers: {from: n, to: passed, type: std_msgs/msg/Int32, keep: [KEPT]}
"""
HANDLERS = ('GREETING', 'NEXT', 'X_1', 'X_2', 'ELBOW', 'STILL', 'LEVEL', 'FIXED')

TIMED = """
format: 1
inputs:
  request: {topic: request, type: std_msgs/msg/Bool}
  done: {topic: done, type: std_msgs/msg/Bool, timeout: 30.0, stale: violate}
  delay: {topic: sent, type: std_msgs/msg/Header, field: age(stamp)}
  got_request: {topic: request, type: std_msgs/msg/Bool, field: received()}
  got_done: {topic: done, type: std_msgs/msg/Bool, field: received(), timeout: 30.0,
             stale: violate}
  got_sent: {topic: sent, type: std_msgs/msg/Header, field: received()}
evaluation: {policy: timed}
requirements:
  - {id: ANSWER, fretish: "when request the robot shall within 3 seconds satisfy done"}
  - {id: EDGE, ptltl: "request -> O[0, 2500 ms] (request & Y !request)"}
  - {id: FRESH, ptltl: "delay < 1.5"}
  - {id: GOT_request, ptltl: "!got_request", report: every_step}  # acknowledges each message
  - {id: GOT_done, ptltl: "!got_done", report: every_step}
  - {id: GOT_sent, ptltl: "!got_sent", report: every_step}
"""
OF_TIMED = ('ANSWER', 'EDGE', 'FRESH', 'GOT_request', 'GOT_done', 'GOT_sent')


@pytest.fixture(scope='module')
def faults(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_bundle(tmp_path_factory.mktemp('faults'), FAULTS)


def renamed(handlers: tuple[str, ...]) -> list[str]:
    """Return the arguments by which the exported node publishes beside the other."""
    names = [*(f'handlerprop{name}' for name in handlers), 'violations']
    return ['-r', '__node:=exported', *(argument for name in names for argument in (
        '-r', f'copilot/{name}:=exported/{name}'))]


class Both:
    """Counts and compares what the two nodes publish."""

    def __init__(
        self, partner: Partner, handlers: tuple[str, ...], monitor: NodeProcess,
    ) -> None:
        self.partner = partner
        self.monitor = monitor
        self.handlers = handlers
        self.reports: dict[str, DiagnosticArray] = {}
        self.details: dict[str, list[Any]] = {'copilot': [], 'exported': []}
        partner.node.create_subscription(DiagnosticArray, '/diagnostics', self._report, 100)
        for place, found in self.details.items():
            partner.node.create_subscription(
                DiagnosticArray, f'{place}/violations', partial(self._detail, found), RELIABLE)
            partner.listen(*handlers, prefix=f'{place}/handlerprop')

    def _report(self, array: DiagnosticArray) -> None:
        self.reports[array.status[0].name.partition(':')[0]] = array

    def _detail(self, found: list[Any], array: DiagnosticArray) -> None:
        found.append((array.header.stamp, array.status[0]))

    def shown(self, place: str) -> list[Any]:
        """Return the details without their stamps, but for those of a publisher that is killed."""
        return sorted((item.name, item.message, item.level, [
            (pair.key, pair.value) for pair in item.values if pair.key != 'stamp'])
            for _, item in self.details[place] if item.name not in ('GREETING', 'NEXT'))

    def statuses(self, node: str) -> dict[str, tuple[bytes, str, dict[str, str]]]:
        """Return the next report of a node by the names of its statuses; without times."""
        self.reports.pop(node, None)
        wait_until(lambda: node in self.reports, f'a report of {node}')
        return {item.name.partition(': ')[2]: (
            item.level, re.sub(r'for [0-9.]+ s', 'for long', item.message),
            {pair.key: pair.value for pair in item.values if pair.key not in self._left_out(item)})
            for item in self.reports[node].status}

    def acknowledged(self, topic: str) -> list[list[int]]:
        """Return the details by which each node acknowledges messages of a topic."""
        return [[item for _, item in found if item.name == f'GOT_{topic}' and _is_of_message(item)]
                for found in self.details.values()]

    @staticmethod
    def _left_out(status: Any) -> tuple[str, ...]:
        """Return what may differ: times, and counts of a publisher that is killed."""
        is_killed = status.name.partition(': ')[2] in ('topic /n', 'GREETING', 'NEXT')
        return ('rate', 'behind', *(
            ('received', 'lost', 'steps', 'violations', 'announced') if is_killed else ()))

    def expect_equal(self) -> dict[str, tuple[bytes, str, dict[str, str]]]:
        """Wait until both nodes report the same, twice, and return it."""
        found: list[Any] = []

        def are_equal() -> bool:
            found.append((self.statuses('fret_monitor'), self.statuses('exported')))
            same = [ours == theirs for ours, theirs in found[-2:]]
            return len(found) > 1 and all(same) and found[-1] == found[-2]

        try:
            wait_until(are_equal, 'equal reports')
        except AssertionError:
            ours, theirs = found[-1]
            differing = {name: (ours.get(name), theirs.get(name)) for name in {*ours, *theirs}
                         if ours.get(name) != theirs.get(name)}
            raise AssertionError(f'they differ: {differing}') from None
        return dict(found[-1][0])


def lines_of_publishers(output: str) -> list[str]:
    """Return the lines of the log on publishers that are not received."""
    return sorted(line.partition(']: ')[2] for line in output.splitlines()
                  if 'does not match the sub' in line or 'where the bundle says' in line)


def _is_of_message(status: DiagnosticStatus) -> bool:
    detail = read_detail(status)
    return not detail.is_recovery and not detail.silent


@contextmanager
def both(partner: Partner, bundle: Path, handlers: tuple[str, ...],
         *arguments: str) -> Iterator[tuple[Both, ExportedNode]]:
    """Start both nodes, and count what they publish."""
    with started('monitor', '-p', f'spec:={bundle}', *arguments) as monitor, \
            running(exported_bundle(bundle), *renamed(handlers), *arguments) as node:
        yield Both(partner, handlers, monitor), node


def call(partner: Partner, kind: Any, name: str, **fields: Any) -> Any:
    """Call a service of the exported node."""
    client = partner.node.create_client(kind, f'exported/{name}')
    assert client.wait_for_service(PATIENCE)
    answer = client.call_async(kind.Request(**fields))
    wait_until(answer.done, f'an answer of {name}')
    partner.node.destroy_client(client)
    return answer.result()


def wait_for_subscriptions(partner: Partner, topic: str, count: int = 2) -> None:
    wait_until(lambda: partner.node.count_subscribers(topic) == count, f'{count} on {topic}')
    sleep(0.3)


def test_both_nodes_report_the_same_violations_and_counters_on_all_faults(
    partner: Partner, stranger: Partner, faults: Path, tmp_path: Path,
) -> None:
    chance = random.Random(7)
    with both(partner, faults, HANDLERS) as (nodes, node):
        x = partner.publisher(Float32, 'topic/x', BEST_EFFORT)
        joints = partner.publisher(sensor_msgs.JointState, 'joints')
        state = partner.publisher(String, 'state', LATCHED)
        best = partner.publisher(Int32, 'level')  # of another type
        fixed = partner.publisher(Bool, 'fixed', BEST_EFFORT)  # does not match `qos`
        level = stranger.publisher(UInt8, 'level')
        node.wait_for('/fixed: it offers best effort, volatile')
        node.wait_for('/partner publishes std_msgs/msg/Int32 on /level, where the bundle says '
                      'std_msgs/msg/UInt8')
        for topic in ('topic/x', 'joints', 'state', 'level'):
            wait_for_subscriptions(partner, topic)
        late = None
        for number in range(120):
            x.publish(Float32(data=chance.choice([0.0, 0.25, 0.5, 0.75, 1.0, 0.1])))
            if number == 60:  # a reliable publisher comes late: nothing changes for the others
                late = stranger.publisher(Float32, 'topic/x')
            if number % 7 == 0:
                joints.publish(sensor_msgs.JointState(position=[0.0, chance.uniform(0, 2), 3.0]))
                state.publish(String(data=chance.choice(['idle', 'moving'])))
                level.publish(UInt8(data=chance.choice([1, 200, 5])))
            sleep(0.005)
        joints.publish(sensor_msgs.JointState(position=[0.5]))  # no elbow
        joints.publish(sensor_msgs.JointState(position=[]))
        state.publish(String(data='broken'))
        x.publish(b'\0\1\0\0')  # without a number
        fixed.publish(Bool(data=False))  # not received
        with talking(tmp_path) as first:
            wait_for_subscriptions(partner, 'n')
            first.greet(lambda: wait_until(lambda: all(
                nodes.statuses(name)['topic /n'][1] == 'received'
                for name in ('fret_monitor', 'exported')), 'greetings'))
            first.go(0.001)  # it is killed while it publishes
            sleep(0.2)
            first.kill()
        wait_until(lambda: nodes.statuses('exported')['topic /n'][1].startswith('no publisher'),
                   'the end of the publisher')
        with talking(tmp_path, message='Float64') as wrong:
            wrong.go(0.01)
            for each in (node, nodes.monitor):
                each.wait_for('publishes std_msgs/msg/Float64 on /n')
        before = nodes.statuses('exported')['topic /topic/x'][2]
        assert before['undecodable'] != '0'
        for service in ('fret_monitor', 'exported'):
            assert partner.reset(f'{service}/reset').startswith('restarted 6 step groups')
        assert late is not None
        late.publish(Float32(data=0.0))
        sleep(0.05)
        level.publish(UInt8(data=200))
        node.wait_for("for 'x': X-1, X-2 violated until one comes")
        report = nodes.expect_equal()
        assert report['X-1'][1] == 'violated: no message for x'
        assert report['topic /level'][1] == 'a publisher of std_msgs/msg/Int32, and not ' \
            'std_msgs/msg/UInt8'
        assert report['topic /fixed'][1] == 'not received: /partner'
        assert int(report['topic /joints'][2]['unusable elbow']) == 2
        wait_until(lambda: nodes.shown('copilot') == nodes.shown('exported'), 'the same details')
        assert len(nodes.shown('exported')) > 20
        assert best.get_subscription_count() == 0
        assert lines_of_publishers(nodes.monitor.output) == lines_of_publishers(node.output)
        assert len(lines_of_publishers(node.output)) == 3
        for line in (', limit = 0.7]', 'X-2 violated at', "; input 'elbow' keeps its value",
                     'joints: position[1] cannot be read (the array has 1 element)',
                     "which is not among its values in the bundle; input 'state' keeps",
                     'a message on /topic/x cannot be decoded as std_msgs/msg/Float32',
                     "not monitored here: the gate 'numbers' judges KEPT. Run it: ros2 run "
                     'fret_monitor gate --ros-args -p library:=FOLDER, of each gate'):
            assert line in node.output
        assert 'KEPT' not in report
    counts = {key: int(value[2]['announced']) for key, value in report.items()
              if 'announced' in value[2]}
    for name, count in counts.items():
        assert partner.heard[name.replace('-', '_')] == 2 * count
    assert all(counts[name] for name in ('X-1', 'X-2', 'ELBOW', 'STILL', 'LEVEL'))


def test_timed_requirements_are_violated_at_the_same_instants_of_a_simulated_clock(
    partner: Partner, tmp_path: Path,
) -> None:
    with simulating() as clock, both(
            partner, write_bundle(tmp_path, TIMED), OF_TIMED, '-p', 'use_sim_time:=true',
    ) as (nodes, node):
        publishers = {topic: partner.publisher(kind, topic) for topic, kind in (
            ('request', Bool), ('done', Bool), ('sent', Header))}
        partner.wait_for_listener(*publishers.values())
        for topic in (*publishers, '/clock'):
            wait_for_subscriptions(partner, topic)
        alive: dict[str, float] = {}

        def note(name: str, sign: Header) -> None:
            alive[name] = sign.stamp.sec + sign.stamp.nanosec / 1e9

        for name in ('fret_monitor', 'exported'):
            partner.node.create_subscription(
                Header, f'/{name}/alive', partial(note, name), RELIABLE)

        def at(seconds: float, topic: str = '', message: Any = None) -> None:
            now = clock.jump(seconds)
            # `/clock` is best effort: what is sent before it is matched is lost.
            wait_until(lambda: clock.jump(0.0) == now and [*alive.values()] == [now, now],
                       '/clock')
            if topic:
                count = len(nodes.acknowledged(topic)[0]) + 1
                publishers[topic].publish(message)
                wait_until(lambda: [*map(len, nodes.acknowledged(topic))] == [count, count], topic)

        at(10.0, 'request', Bool(data=False))
        at(1.0, 'done', Bool(data=False))
        at(1.0, 'request', Bool(data=True))
        at(10.0, 'request', Bool(data=True))  # both are violated meanwhile
        at(1.0, 'done', Bool(data=True))
        stamp = Header()
        stamp.stamp.sec = 20
        at(1.0, 'sent', stamp)
        at(40.0)  # `done` is silent
        at(-30.0, 'done', Bool(data=False))  # time goes back
        at(2.0)
        report = nodes.expect_equal()
        assert report['time of bundle'][2]['restarts'] == '1'
        node.wait_for('time went back, to 34.000 s')
    details = [[(stamp, item.name, item.level, [(pair.key, pair.value) for pair in item.values])
                for stamp, item in nodes.details[place]] for place in ('copilot', 'exported')]
    assert [*map(str, details[0])] == [*map(str, details[1])]
    times = {item.values[0].value for _, item in nodes.details['exported']
             if item.name == 'ANSWER'}
    assert '4' in times  # three seconds after the request at 1 s
    for name in OF_TIMED:
        assert int(report[name][2]['announced']) > 0


def test_parameters_and_the_life_cycle_are_served_and_signals_end_the_node(
    partner: Partner, faults: Path,
) -> None:
    with running(exported_bundle(faults), *renamed(HANDLERS), '-p', 'handler_depth:=10',
                 '-p', 'spec:=other.yaml', '-p', 'constants.limit:=0.7', '-p', 'odd:=1',
                 '-p', 'constant.most:=1', '-p', 'frame_id:=map',
                 '-p', 'qos_overrides./n.subscription.depth:=7',
                 '-p', 'qos_overrides./n.subscription.reliability:=RELIABLE',
                 '-p', 'qos_overrides./clock.subscription.depth:=1',
                 '-p', 'qos_overrides./none.subscription.depth:=1') as node:
        assert "depth': the topic /none is not subscribed to" in node.output
        assert '/clock.' not in node.output
        assert "ignored parameter 'spec': the bundle is compiled into this node" in node.output
        assert "ignored parameter 'odd': did you mean 'constants.odd'?" in node.output
        assert "ignored parameter 'constant.most': did you mean 'constants.most'?" in node.output
        assert re.search(
            "ignored parameter 'frame_id': this node has .*, constants.NAME", node.output)
        node.process.send_signal(signal.SIGPIPE)  # nobody reads its log any more
        listed = call(partner, ListParameters, 'list_parameters').result.names
        assert {'use_sim_time', 'log_level', 'handler_depth', 'log_violations', 'autostart',
                'constants.limit', 'qos_overrides./topic/x.subscription.reliability'} <= {*listed}
        values = call(partner, GetParameters, 'get_parameters', names=[
            'handler_depth', 'log_violations', 'constants.limit',
            'qos_overrides./n.subscription.depth', 'constants.odd', 'constants.most']).values
        assert (values[0].integer_value, values[1].bool_value, values[2].double_value,
                values[3].integer_value, values[4].integer_value, values[5].string_value) == (
                    10, True, 0.7, 7, 9007199254740993, '18446744073709551615')
        described = call(partner, DescribeParameters, 'describe_parameters',
                         names=['handler_depth']).descriptors[0]
        assert described.description.startswith('violations that a slow listener')
        assert call(partner, GetParameters, 'get_parameters', names=['nothing']).values == []

        def set_to(name: str, value: ParameterValue) -> str:
            answer = call(partner, SetParameters, 'set_parameters',
                          parameters=[Parameter(name=name, value=value)]).results[0]
            return str(answer.reason) if not answer.successful else ''

        assert 'deactivate and clean up first' in set_to(
            'handler_depth', ParameterValue(type=2, integer_value=5))
        assert 'compiled into this node' in set_to(
            'constants.limit', ParameterValue(type=3, double_value=0.1))
        assert 'has to be one of debug' in set_to(
            'log_level', ParameterValue(type=4, string_value='loud'))
        assert "no parameter 'nothing'" in set_to('nothing', ParameterValue(type=1))
        assert set_to('use_sim_time', ParameterValue(type=1, bool_value=True)) == ''
        wait_for_subscriptions(partner, '/clock', 1)
        assert set_to('use_sim_time', ParameterValue(type=1, bool_value=False)) == ''
        wait_for_subscriptions(partner, '/clock', 0)

        def change(transition: int) -> bool:
            return bool(call(partner, ChangeState, 'change_state',
                             transition=Transition(id=transition)).success)

        assert not change(Transition.TRANSITION_CONFIGURE)
        assert change(Transition.TRANSITION_DEACTIVATE)
        wait_for_subscriptions(partner, 'n', 0)
        assert call(partner, Trigger, 'reset').message == \
            'nothing to restart: the node is not active'
        assert change(Transition.TRANSITION_CLEANUP)
        assert set_to('handler_depth', ParameterValue(type=2, integer_value=5)) == ''
        assert change(Transition.TRANSITION_CONFIGURE)
        assert change(Transition.TRANSITION_ACTIVATE)
        wait_for_subscriptions(partner, 'n', 1)
        state = call(partner, GetState, 'get_state').current_state
        assert (state.id, state.label) == (3, 'active')
        assert node.end(signal.SIGTERM) == 0


@pytest.mark.parametrize(('arguments', 'reason'), [
    (['-p', 'handler_depth:=0'], "'handler_depth' is 0, and has to be a number of messages"),
    (['-p', 'fret_monitor:handler_depth:=-1'], "'handler_depth' is -1, and has to be a number"),
    (['-r', '__ns:=/a', '-p', 'b:handler_depth:=-2', '--params-file', 'FILE'],
     "'handler_depth' is -3, and has to be a number"),
    (['-p', 'constants.nope:=3.0'],
     "'constants.nope': the bundle has no such constant; its constants are limit, odd, most"),
    (['-p', 'log_violations:=7'], "'log_violations' is 7, and has to be true or false"),
    (['-p', 'constants.limit:=0.5'], 'compiled into this node, as 0.7'),
    (['-p', 'qos_overrides./n.subscription.reliability:=high'],
     "is 'high', and has to be one of reliable, best_effort, best_available"),
    (['-p', 'qos_overrides./other.subscription.relability:=reliable'],
     "relability' is none: there are reliability, durability, history, depth"),
    (['-p', 'qos_overrides./other.subscription.reliability:=high'],
     "is 'high', and has to be one of reliable, best_effort, best_available"),
    (['-p', 'qos_overrides./n.subscription.deadline:=1.0'],
     'it would keep out publishers that do not offer it; use the `timeout`'),
    (['-p', 'qos_overrides./n.subscription_a.depth:=7'], 'subscriptions here have no id, write'),
    (['-p', 'qos_overrides.n.subscription.depth:=7'],
     "is none; write 'qos_overrides./TOPIC.subscription.POLICY', with the topic's full name"),
    (['-p', 'qos_overrides./copilot/handlerpropNEXT.publisher.depth:=1'],
     'violations are announced reliable and volatile'),
    (['-p', 'constants.odd:=9007199254740992'], 'compiled into this node, as 9007199254740993'),
    (['-p', 'constants.most:=9223372036854775807'],
     'compiled into this node, as 18446744073709551615'),
    (['-r', 'copilot/handlerpropNEXT:=n'],
     "'n' and 'copilot/handlerpropNEXT' are both remapped to /n; what the node announces"),
    (['-r', 'copilot/handlerpropNEXT:=v', '-r', 'copilot/handlerpropX_1:=v'],
     "'copilot/handlerpropNEXT' and 'copilot/handlerpropX_1' are both remapped to /v"),
    (['-r', 'copilot/handlerpropNEXT:=/diagnostics'],
     "'copilot/handlerpropNEXT' and the node's own '/diagnostics' are both remapped to"),
    (['-r', 'copilot/handlerpropNEXT:=fret_monitor/alive'],
     "'copilot/handlerpropNEXT' and the node's own '~/alive' are both remapped to"),
    (['-r', '~/alive:=/n'], "'n' and the node's own '~/alive' are both remapped to /n; what the"),
    (['-r', 'n:=/one', '-r', 'state:=/one'], "'n' and 'state' are both remapped to /one"),
    (['spec:=x'], 'unknown ROS arguments'),
])
def test_what_cannot_be_used_ends_the_process_with_the_reason(
    arguments: list[str], reason: str, domain: int, faults: Path,
) -> None:
    file = faults.with_name('parameters.yaml')
    file.write_text('a:\n  fret_monitor:\n    ros__parameters: {handler_depth: -3}\n')
    node = ExportedNode(exported_bundle(faults), *(
        str(file) if item == 'FILE' else item for item in arguments))
    try:
        assert node.status() == 1
        assert reason in node.output
    finally:
        node.kill()


def test_the_package_builds_with_ament_cmake_and_its_node_runs(
    domain: int, faults: Path, tmp_path: Path,
) -> None:
    if not has_ament_cmake():
        pytest.skip('ament_cmake or cmake is not installed here')
    with running(cmake_build(faults, tmp_path), '-r', '__node:=exported') as node:
        node.wait_for('watching 8 requirements')
