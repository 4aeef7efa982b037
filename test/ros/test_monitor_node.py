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

"""The monitor as a process over real DDS: it publishes every violation, and no other."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import cycle
from pathlib import Path
import random
import re
from time import monotonic, sleep
from typing import Any

from bundles import write_bundle
from fret_monitor import build
from fret_monitor.logic.pointwise import Value
from fret_monitor.model.policies import Policy
import pytest
from rclpy.publisher import Publisher
from ros.harness import (
    BEST_EFFORT, LATCHED, NodeProcess, Partner, RELIABLE, settle, started, wait_until,
)
from ros.reference import expected, Message
from std_msgs.msg import Bool, Empty, Float32, Int32, String

diagnostic_msgs = pytest.importorskip('diagnostic_msgs.msg')
sensor_msgs = pytest.importorskip('sensor_msgs.msg')

BUNDLE = """
format: 1
inputs:
  x: {topic: topic/x, type: std_msgs/msg/Float32}
  n: {topic: n, type: std_msgs/msg/Int32}
  p: {topic: p, type: std_msgs/msg/Bool, field: data}
requirements:
  - {id: R-1, ptltl: "x < 0.7 -> O[0,3] (n > 1)"}
  - {id: R-2, ptltl: "(p S[1,4] (n > 1)) | FTP"}
  - {id: R-3, ptltl: "H (x < 2.0)"}
  - {id: R-4, ptltl: "Y (x > 0.3) | n != 2", report: onset}
  - {id: R-5, ptltl: "p"}
"""
HANDLERS = ('R_1', 'R_2', 'R_3', 'R_4', 'R_5')
TYPES = {'x': Float32, 'n': Int32, 'p': Bool}
TOPICS = {'x': 'topic/x', 'n': 'n', 'p': 'p'}


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    return write_bundle(tmp_path, BUNDLE)


def random_messages(count: int, seed: int) -> list[Message]:
    chance = random.Random(seed)

    def value(name: str) -> Value:
        choices: dict[str, list[Value]] = {
            'x': [0.0, 0.25, 0.5, 0.75, 1.0], 'n': [0, 1, 2, 3], 'p': [False, True, True]}
        return chance.choice(choices[name])

    names = [chance.choice('xnp') for _ in range(count)]
    return [(TOPICS[name], {name: value(name)}) for name in names]


class Talker:
    """Publishes messages on the topics of `BUNDLE`."""

    def __init__(self, partner: Partner, prefix: str = '', **offers: Any) -> None:
        self.publishers: dict[str, Publisher] = {
            name: partner.publisher(TYPES[name], prefix + TOPICS[name],
                                    *filter(None, [offers.get(name)]))
            for name in TYPES}
        partner.wait_for_listener(*self.publishers.values())

    def say(self, messages: list[Message]) -> None:
        for number, (_, fed) in enumerate(messages):
            for name, value in fed.items():
                self.publishers[name].publish(TYPES[name](data=value))
            if number % 10 == 9:
                sleep(0.01)


def until_told(logger: NodeProcess, pattern: str, do: Callable[[], None]) -> None:
    """
    Repeat an action until the logger has written a line that matches.

    The test cannot observe when monitor and logger have discovered each other.
    """
    def is_told() -> bool:
        do()
        sleep(0.1)
        return re.search(pattern, logger.output) is not None

    wait_until(is_told, pattern)


@contextmanager
def monitoring(partner: Partner, *arguments: str, handlers: tuple[str, ...] = HANDLERS,
               environment: dict[str, str] | None = None) -> Iterator[NodeProcess]:
    with started('monitor', *arguments, environment=environment) as node:
        partner.listen(*handlers)
        yield node


@pytest.mark.parametrize('policy', [
    Policy.EVERY_MESSAGE, Policy.RELEVANT_MESSAGE, Policy.ALL_INPUTS])
def test_every_violation_is_published_and_no_other(
    policy: Policy, partner: Partner, bundle: Path,
) -> None:
    messages = random_messages(600, seed=3)
    wanted = expected(bundle, messages, policy)
    assert len({*wanted.values()}) > 3  # the requirements have different numbers of violations
    with monitoring(partner, '-p', f'spec:={bundle}', '-p', f'policy:={policy.value}') as node:
        Talker(partner).say(messages)
        partner.expect(wanted)
        assert f'watching 5 requirements on 3 inputs of 3 topics, policy {policy.value}' \
            in node.output


def test_publishers_of_every_qos_are_received_by_one_monitor(
    partner: Partner, bundle: Path,
) -> None:
    messages = random_messages(300, seed=4)
    with monitoring(partner, '-p', f'spec:={bundle}'):
        Talker(partner, x=BEST_EFFORT, n=LATCHED).say(messages)
        partner.expect(expected(bundle, messages))


def test_a_reset_starts_again_and_keeps_the_values(partner: Partner, bundle: Path) -> None:
    first, second = random_messages(100, seed=5), random_messages(100, seed=6)
    last = {name: value for _, fed in first for name, value in fed.items()}
    with monitoring(partner, '-p', f'spec:={bundle}'):
        talker = Talker(partner)
        talker.say([*first, (TOPICS['x'], {'x': 3.0})])
        counts = expected(bundle, [*first, (TOPICS['x'], {'x': 3.0})])
        partner.expect(counts)
        assert partner.reset().startswith('restarted 4 step groups')
        partner.heard.clear()
        # A second start, with values of all inputs from the first message on
        known = {**last, 'x': 3.0}
        messages = [(second[0][0], {**known, **second[0][1]}), *second[1:]]
        talker.say(second)
        partner.expect(expected(bundle, messages))


def test_topics_and_handlers_are_in_the_namespace_and_can_be_remapped(
    partner: Partner, bundle: Path,
) -> None:
    messages = random_messages(100, seed=7)
    with started('monitor', '-p', f'spec:={bundle}', '-r', '__ns:=/robot/one',
                 '-r', 'topic/x:=/elsewhere/x'):
        partner.listen(*HANDLERS, prefix='/robot/one/copilot/handlerprop')
        publishers = {
            'x': partner.publisher(Float32, '/elsewhere/x'),
            'n': partner.publisher(Int32, '/robot/one/n', BEST_EFFORT),
            'p': partner.publisher(Bool, '/robot/one/p')}
        partner.wait_for_listener(*publishers.values())
        for _, fed in messages:
            for name, value in fed.items():
                publishers[name].publish(TYPES[name](data=value))
                sleep(0.002)
        partner.expect(expected(bundle, messages))
        assert 'restarted' in partner.reset('/robot/one/fret_monitor/reset')


def test_bytes_that_are_no_message_cause_no_step_and_are_reported_once(
    partner: Partner, bundle: Path,
) -> None:
    messages = random_messages(40, seed=8)
    with monitoring(partner, '-p', f'spec:={bundle}') as node:
        talker = Talker(partner)
        # A header without a number; an unknown encoding; less than a header. After no bytes at all
        # a reliable reader of Fast DDS receives nothing more from that writer, in rclpy too.
        for message, garbage in zip(messages, cycle((b'\0\1\0\0', b'\xff' * 8, b'\0'))):
            talker.publishers['x'].publish(garbage)
            talker.say([message])
        partner.expect(expected(bundle, messages))
        node.wait_for('/topic/x cannot be decoded as std_msgs/msg/Float32')
        assert node.output.count('cannot be decoded') == 1


JOINTS = """
format: 1
inputs:
  elbow: {topic: joints, type: sensor_msgs/msg/JointState, field: "position[1]"}
  wrist: {topic: joints, type: sensor_msgs/msg/JointState, field: "position[2]"}
  age: {topic: joints, type: sensor_msgs/msg/JointState, field: header.stamp.sec}
  state: {topic: state, type: std_msgs/msg/String, values: {IDLE: "idle", MOVING: "moving"}}
requirements:
  - {id: ELBOW, ptltl: "elbow < 1.0"}
  - {id: BOTH, ptltl: "elbow < wrist"}
  - {id: AGE, ptltl: "age < 10"}
  - {id: STILL, ptltl: "state = IDLE -> elbow < 1.0"}
"""


def test_inputs_of_one_topic_share_a_step_and_unusable_fields_are_left_out(
    partner: Partner, tmp_path: Path,
) -> None:
    bundle = write_bundle(tmp_path, JOINTS)
    with monitoring(partner, '-p', f'spec:={bundle}',
                    handlers=('ELBOW', 'BOTH', 'AGE', 'STILL')):
        joints = partner.publisher(sensor_msgs.JointState, 'joints')
        state = partner.publisher(String, 'state')
        partner.wait_for_listener(joints, state)

        def move(second: int, *position: float) -> None:
            message = sensor_msgs.JointState(position=position)
            message.header.stamp.sec = second
            joints.publish(message)
            sleep(0.05)

        move(20, 0.0, 0.5)  # no wrist yet: two requirements step, AGE is violated
        partner.expect({'AGE': 1})
        move(0, 0.0, 2.0, 1.0)  # ELBOW and BOTH
        partner.expect({'AGE': 1, 'ELBOW': 1, 'BOTH': 1})
        move(0, 0.0)  # neither elbow nor wrist: both keep their values, so the violations repeat
        partner.expect({'AGE': 1, 'ELBOW': 2, 'BOTH': 2})
        state.publish(String(data='broken'))  # not among the values: still a step
        partner.expect({'AGE': 1, 'ELBOW': 3, 'BOTH': 3})
        state.publish(String(data='moving'))
        partner.expect({'AGE': 1, 'ELBOW': 4, 'BOTH': 4})
        state.publish(String(data='idle'))
        partner.expect({'AGE': 1, 'ELBOW': 5, 'BOTH': 5, 'STILL': 1})


def test_under_the_policy_periodic_time_triggers_the_steps(partner: Partner, bundle: Path) -> None:
    with monitoring(partner, '-p', f'spec:={bundle}', '-p', 'policy:=periodic',
                    '-p', 'rate:=20.0'):
        Talker(partner).publishers['p'].publish(Bool(data=False))
        wait_until(lambda: partner.heard['R_5'] > 0, 'the first violation')
        begin, before = monotonic(), partner.heard['R_5']
        sleep(2.0)
        # On a busy machine some come in a bunch, and the test sleeps longer.
        periods = (monotonic() - begin) * 20
        assert periods - 15 <= partner.heard['R_5'] - before <= periods + 15
        assert {*partner.heard} == {'R_5'}


def test_a_publisher_of_another_type_is_reported(partner: Partner, bundle: Path) -> None:
    with monitoring(partner, '-p', f'spec:={bundle}') as node:
        partner.publisher(Int32, 'topic/x')
        node.wait_for('/partner publishes std_msgs/msg/Int32 on /topic/x, where the bundle says '
                      'std_msgs/msg/Float32')


def test_a_compiled_bundle_runs_without_a_compiler(
    partner: Partner, bundle: Path, tmp_path: Path,
) -> None:
    build.write(build.generate_monitor(build.read(bundle)), tmp_path / 'library')
    environment = {'PATH': str(tmp_path / 'empty'), 'ROS_HOME': str(tmp_path / 'home'), 'CC': ''}
    messages = random_messages(100, seed=9)
    library = f"library:={tmp_path / 'library'}"
    with monitoring(partner, '-p', library, environment=environment), \
            started('logger', '-p', library, environment=environment) as logger:
        talker = Talker(partner)
        until_told(logger, 'R-5 violated',
                   lambda: talker.publishers['p'].publish(Bool(data=False)))
        sleep(1.0)
        told = logger.output
        partner.heard.clear()
        partner.reset()
        talker.say(messages)
        first = (messages[0][0], {'p': False, **messages[0][1]})
        wanted = expected(bundle, [first, *messages[1:]])
        partner.expect(wanted)
        wait_until(lambda: all(
            logger.output.removeprefix(told).count(f'{handler.replace("_", "-")} violated at')
            == count for handler, count in wanted.items()), 'a line for each violation')
    # The cache holds copies of the libraries, and nothing compiled here.
    kept = (tmp_path / 'home' / 'fret_monitor').rglob('*.*')
    assert {file.suffix for file in kept} == {'.so', '.json'}


def test_the_logger_writes_id_sentence_and_time_by_severity(
    partner: Partner, tmp_path: Path,
) -> None:
    bundle = write_bundle(tmp_path, BUNDLE + """
  - {id: R-6, title: "x shall be small", ptltl: "x < 2.0", severity: warn}
""")
    with started('logger', '-p', f'spec:={bundle}', environment={
            'RCUTILS_CONSOLE_OUTPUT_FORMAT': '{severity} {message}'}) as node:
        wide = partner.publisher(Empty, 'copilot/handlerpropR_6')
        plain = partner.publisher(Empty, 'copilot/handlerpropR_5')
        wait_until(lambda: wide.get_subscription_count() > 0
                   and plain.get_subscription_count() > 0, 'a logger that listens')
        settle(0.3)
        now = int(partner.node.get_clock().now().nanoseconds / 1e9)
        wide.publish(Empty())
        plain.publish(Empty())
        node.wait_for('R-6 violated')
        node.wait_for('R-5 violated')
        lines = {line.split()[1]: line for line in node.output.splitlines()}
        assert lines['R-6'].startswith('WARN R-6 violated at ')
        assert lines['R-6'].endswith(': x shall be small (x < 2.0)')
        assert lines['R-5'].startswith('ERROR R-5 violated at ')
        assert lines['R-5'].endswith(': p')
        assert abs(float(lines['R-6'].split()[4].rstrip(':')) - now) < 20


def test_details_have_step_time_and_values_while_there_is_a_subscriber(
    partner: Partner, tmp_path: Path,
) -> None:
    bundle = write_bundle(tmp_path, """
format: 1
component: robot
inputs:
  x: {topic: x, type: std_msgs/msg/Float32}
  step: {topic: state, type: std_msgs/msg/String, values: {IDLE: "idle", GO: "go"}}
requirements:
  - {id: R-1, title: "stand still", ptltl: "step = GO | x < 0.25", severity: warn}
  - {id: R-2, ptltl: "x < 0.25"}
""")
    with monitoring(partner, '-p', f'spec:={bundle}', handlers=('R_1', 'R_2')) as node, \
            started('logger', '-p', f'spec:={bundle}') as logger:
        heard: list[Any] = []
        partner.node.create_subscription(
            diagnostic_msgs.DiagnosticArray, 'copilot/violations', heard.append, 1000)
        x, state = partner.publisher(Float32, 'x'), partner.publisher(String, 'state')
        partner.wait_for_listener(x, state)
        until_told(logger, 'R-2 violated.* \\[step', lambda: x.publish(Float32(data=0.3)))
        x.publish(Float32(data=0.2))
        settle(0.5)
        partner.reset()
        heard.clear()
        state.publish(String(data='idle'))
        before = partner.node.get_clock().now().nanoseconds
        x.publish(Float32(data=0.3))
        wait_until(lambda: sum(len(array.status) for array in heard) == 2, 'details of both')
        first, second = (status for array in heard for status in array.status)
        assert (first.name, first.level, first.message, first.hardware_id) == (
            'R-1', b'\1', 'stand still', 'robot')
        assert (second.name, second.level, second.message) == ('R-2', b'\2', 'x < 0.25')
        values = [(item.key, item.value) for item in first.values]
        assert values[0] == ('step', '1')
        assert 0 <= float(values[1][1]) - before / 1e9 < 20
        assert values[2:] == [
            ('suppressed', '0'), ('silent', ''), ('x', '0.3'), ('input step', 'IDLE')]
        for logging in (logger, node):
            logging.wait_for(
                ': stand still (step = GO | x < 0.25) [step 1: x = 0.3, step = IDLE]')
            logging.wait_for(
                f'R-2 violated at {float(values[1][1]):.3f}: x < 0.25 [step 1: x = 0.3]')
        assert re.search('WARN.*R-1 violated', node.output)
        x.publish(Float32(data=0.2))
        until_told(node, 'INFO.*R-2 satisfied again at .*step 2: x = 0.2', lambda: None)


def test_details_are_limited_and_counted_while_handlers_publish_every_violation(
    partner: Partner, tmp_path: Path,
) -> None:
    bundle = write_bundle(tmp_path, """
format: 1
inputs:
  x: {topic: x, type: std_msgs/msg/Float32}
requirements:
  - {id: R-1, ptltl: "x < 0.25"}
""")
    with monitoring(partner, '-p', f'spec:={bundle}', handlers=('R_1',)):
        heard: list[Any] = []
        partner.node.create_subscription(
            diagnostic_msgs.DiagnosticArray, 'copilot/violations', heard.append, 1000)
        x = partner.publisher(Float32, 'x')
        partner.wait_for_listener(x)
        for number in range(1000):
            x.publish(Float32(data=1.0))
            if number % 10 == 0:
                sleep(0.01)
        partner.expect({'R_1': 1000})
        sleep(1.0)
        x.publish(Float32(data=1.0))
        partner.expect({'R_1': 1001})
        last = {item.key: item.value for item in heard[-1].status[0].values}
        assert last['step'] == '1000'
        assert len(heard) + int(last['suppressed']) == 1001
        assert int(last['suppressed']) > 0


def test_diagnostics_report_requirements_and_topics(
    partner: Partner, stranger: Partner, bundle: Path,
) -> None:
    heard: list[Any] = []
    partner.node.create_subscription(
        diagnostic_msgs.DiagnosticArray, '/diagnostics', heard.append, 10)

    def told(name: str) -> tuple[bytes, str, dict[str, str]] | None:
        for status in heard[-1].status if heard else ():
            if status.name == f'robot/fret_monitor: {name}':
                return status.level, status.message, {
                    item.key: item.value for item in status.values}
        return None

    def is_told(name: str, level: bytes, message: str, **values: str) -> None:
        wait_until(lambda: (found := told(name)) is not None and found[:2] == (level, message)
                   and found[2] | values == found[2], f'{name}: {message}')

    with started('monitor', '-p', f'spec:={bundle}', '-r', '__ns:=/robot'):
        is_told('R-5', b'\1', 'no value yet of p')
        is_told('topic /robot/p', b'\1', 'no publisher')
        p = partner.publisher(Bool, '/robot/p')
        partner.wait_for_listener(p)
        p.publish(Bool(data=True))
        is_told('R-5', b'\0', 'satisfied', steps='1', violations='0')
        is_told('topic /robot/p', b'\0', 'received', received='1', publishers='1')
        p.publish(Bool(data=False))
        is_told('R-5', b'\2', 'violated', steps='2', violations='1', announced='1', text='p')
        stranger.publisher(Int32, '/robot/topic/x')
        is_told('topic /robot/topic/x', b'\2',
                'a publisher of std_msgs/msg/Int32, and not std_msgs/msg/Float32')


def test_the_subscription_has_the_qos_of_the_bundle(
    partner: Partner, tmp_path: Path,
) -> None:
    bundle = write_bundle(tmp_path, """
format: 1
inputs:
  x:
    topic: x
    type: std_msgs/msg/Float32
    qos: {reliability: best_effort, durability: volatile, depth: 7}
requirements:
  - {id: R-1, ptltl: "x < 0.25"}
""")
    x = partner.publisher(Float32, 'x', LATCHED)
    with monitoring(partner, '-p', f'spec:={bundle}', handlers=('R_1',)):
        wait_until(lambda: x.get_subscription_count() > 0, 'a match')
        sleep(1.0)  # long enough to adapt to the publisher, if it did
        x.publish(Float32(data=1.0))
        partner.expect({'R_1': 1})
        offered, = (item.qos_profile for item in partner.node.get_subscriptions_info_by_topic('x'))
        assert offered.reliability is BEST_EFFORT.reliability
        assert offered.durability is RELIABLE.durability
