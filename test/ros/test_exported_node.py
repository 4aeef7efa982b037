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
The node that `export --to ros2` writes: its parameters, life cycle, refusals and package.

`test_side_by_side` compares what it publishes and logs with the monitor in Python.
"""

from functools import partial
from pathlib import Path
import re
import signal
from time import sleep
from typing import Any

from bundles import write_bundle
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
import pytest
from rcl_interfaces.msg import Log, Parameter, ParameterValue
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters
from rclpy.qos import QoSProfile
from ros.exported import cmake_build, exported_bundle, ExportedNode, has_ament_cmake, running
from ros.harness import answer_of, change_state, LATCHED, NodeProcess, Partner, wait_until
from std_msgs.msg import Bool, Int32
from std_srvs.srv import Trigger
from type_description_interfaces.srv import GetTypeDescription

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


@pytest.fixture(scope='module')
def faults(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_bundle(tmp_path_factory.mktemp('faults'), FAULTS)


def call(partner: Partner, kind: Any, name: str, **fields: Any) -> Any:
    """Call a service of the exported node, with a request that may come twice."""
    client = partner.node.create_client(kind, f'exported/{name}')
    answer = answer_of(client, kind.Request(**fields))
    partner.node.destroy_client(client)
    return answer


def wait_for_subscriptions(partner: Partner, topic: str, count: int = 2) -> None:
    wait_until(lambda: partner.node.count_subscribers(topic) == count, f'{count} on {topic}')
    sleep(0.3)


@pytest.mark.parametrize('is_offered', [True, False])
def test_types_are_described_unless_a_parameter_forbids_it(
    partner: Partner, faults: Path, is_offered: bool,
) -> None:
    with running(exported_bundle(faults), '-r', '__node:=exported', '-p',
                 f'start_type_description_service:={str(is_offered).lower()}'):
        def has(service: str) -> bool:
            return any(name == f'/exported/{service}'
                       for name, _ in partner.node.get_service_names_and_types())

        wait_until(lambda: has('reset'), 'the service that is offered last')
        assert has('get_type_description') is is_offered
        if not is_offered:
            return
        wait_until(lambda: partner.node.count_publishers('/exported/alive') == 1, '~/alive')
        info, = partner.node.get_publishers_info_by_topic('/exported/alive')
        answer = call(partner, GetTypeDescription, 'get_type_description',
                      type_name='std_msgs/msg/Header', type_hash=str(info.topic_type_hash))
        assert answer.successful, answer.failure_reason
        fields = [field.name for field in answer.type_description.type_description.fields]
        assert fields == ['stamp', 'frame_id']


def test_parameters_and_the_life_cycle_are_served_and_signals_end_the_node(
    partner: Partner, faults: Path,
) -> None:
    with running(exported_bundle(faults), '-r', '__node:=exported', '-p', 'handler_depth:=10',
                 '-p', 'spec:=other.yaml', '-p', 'constants.limit:="0.7"', '-p', 'odd:=1',
                 '-p', 'constants.most:=18446744073709551615', '-p', 'constant.most:=1',
                 '-p', 'frame_id:=map') as node:
        assert ("not monitored here: the gate 'numbers' judges KEPT. Run it: ros2 run fret_monitor"
                ' gate --ros-args -p library:=FOLDER, of each gate') in node.output
        assert "ignored parameter 'spec': the bundle is compiled into this node" in node.output
        assert "ignored parameter 'odd': did you mean 'constants.odd'?" in node.output
        assert "ignored parameter 'constant.most': did you mean 'constants.most'?" in node.output
        assert re.search(
            "ignored parameter 'frame_id': this node has .*, constants.NAME", node.output)
        logged: set[str] = set()

        def hear(line: Any) -> None:
            logged.add(f'{line.name}: {line.msg}')

        partner.node.create_subscription(Log, '/rosout', hear, LATCHED)
        wait_until(lambda: any(line.startswith('exported: watching') for line in logged),
                   'the log on /rosout')
        copied = 'inside rmw_fastrtps_cpp, and copied before they are read'
        assert 'messages are taken in C' in node.output and copied not in node.output
        node.process.send_signal(signal.SIGPIPE)  # nobody reads its log any more
        node.process.send_signal(signal.SIGXFSZ)  # a file is too large, as rclpy ignores it
        listed = call(partner, ListParameters, 'list_parameters').result.names
        assert {'use_sim_time', 'log_level', 'handler_depth', 'log_violations', 'autostart',
                'constants.limit'} <= {*listed}
        values = call(partner, GetParameters, 'get_parameters', names=[
            'handler_depth', 'log_violations', 'constants.limit', 'constants.odd',
            'constants.most']).values
        assert (values[0].integer_value, values[1].bool_value, values[2].string_value,
                values[3].integer_value, values[4].string_value) == (
                    10, True, '0.7', 9007199254740993, '18446744073709551615')
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

        client = partner.node.create_client(ChangeState, 'exported/change_state')
        change = partial(change_state, client)

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
     "'constants.nope': no bundle has this constant: the constants are limit, odd, most"),
    (['-p', 'metrics:=127.0.0.1:9400'], 'this node is in C, and serves no figures for Prom'),
    (['-p', 'constants.limit:=0.5'], 'compiled into this node, as 0.7'),
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
    told = ExportedNode(exported_bundle(faults), *(
        str(file) if item == 'FILE' else item for item in arguments)).error()
    assert [line for line in told.splitlines() if line.startswith('error: ') and reason in line]


@pytest.mark.parametrize(('word', 'told'), [
    ('on', 'messages are taken in C, inside '),
    ('off', 'messages are taken in C, in a thread of its own: hot_path is off')])
def test_a_parameter_decides_whether_callbacks_take_the_messages(
    partner: Partner, faults: Path, word: str, told: str,
) -> None:
    with running(exported_bundle(faults), '-p', f'hot_path:={word}') as node:
        assert told in node.output and 'ignored' not in node.output
        partner.listen('FIXED')
        fixed = partner.publisher(Bool, 'fixed', QoSProfile(depth=10))
        partner.wait_for_listener(fixed)
        fixed.publish(Bool(data=False))
        partner.expect({'FIXED': 1})


def test_a_node_stopped_in_a_flood_judges_each_message_of_another_topic(
    partner: Partner, faults: Path,
) -> None:
    with running(exported_bundle(faults)) as node:
        partner.listen('FIXED')
        n = partner.publisher(Int32, 'n', QoSProfile(depth=10))
        fixed = partner.publisher(Bool, 'fixed', QoSProfile(depth=10))
        partner.wait_for_listener(n, fixed)
        node.process.send_signal(signal.SIGSTOP)
        for _ in range(10):
            fixed.publish(Bool(data=False))
            for number in range(500):
                n.publish(Int32(data=number))
        node.process.send_signal(signal.SIGCONT)
        partner.expect({'FIXED': 10})


def test_the_package_builds_with_ament_cmake_and_its_node_runs(
    domain: int, faults: Path, tmp_path: Path,
) -> None:
    if not has_ament_cmake():
        pytest.skip('ament_cmake or cmake is not installed here')
    with running(cmake_build(faults, tmp_path), '-r', '__node:=exported') as node:
        node.wait_for('watching 8 requirements')


@pytest.mark.parametrize('is_native', [False, True])
def test_a_name_that_the_namespace_makes_too_long_is_an_error(
        tmp_path: Path, domain: int, is_native: bool) -> None:
    path = write_bundle(tmp_path, f"""
format: 1
inputs: {{x: {{topic: x, type: std_msgs/msg/Float32}}}}
requirements: [{{id: {'R' * 120}, ptltl: "x < 1"}}]
""")
    space = ('-r', f'__ns:=/{"a" * 130}')
    node = ExportedNode(exported_bundle(path), *space) if is_native \
        else NodeProcess('monitor', '-p', f'spec:={path}', *space)
    assert node.status() == 1
    assert 'cannot subscribe or advertise: topic length should not exceed' in node.output
    assert 'Traceback' not in node.output
    node.kill()
