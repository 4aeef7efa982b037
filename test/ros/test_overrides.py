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
The parameters `qos_overrides`: named as rclpy names them, and refused where they are wrong.

The monitor and the gate, on rclpy and exported: what they say and show of overrides is equal.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
import re
from types import SimpleNamespace
from typing import Any

from fret_monitor.model.diagnostics import did_you_mean
from fret_monitor.model.parts import NodePart, UNGATED
from fret_monitor.native import evaluator_library, load_evaluator
from fret_monitor.ros.settings.overrides import overrides_of
from fret_monitor.runtime.overrides import Overrides
import pytest
from rcl_interfaces.srv import DescribeParameters, GetParameters, ListParameters, SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.qos import QoSPolicyKind, QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions
from ros.exported import exported_bundle, exported_bundles, ExportedNode
from ros.harness import (
    answer_of, BEST_EFFORT, NodeProcess, Partner, PATIENCE, RELIABLE, started, wait_until,
)
from std_msgs.msg import Empty, Float32


def test_overrides_have_the_effect_that_they_have_in_rclpy(partner: Partner) -> None:
    values: dict[str, str | int] = {
        'reliability': 'best_effort', 'durability': 'transient_local', 'history': 'keep_all',
        'depth': 7}
    given = {f'qos_overrides./robot/x.subscription.{name}': value
             for name, value in values.items()}
    node = Node('other', context=partner.context, namespace='/robot', parameter_overrides=[
        Parameter(name, value=value) for name, value in given.items()])
    subscription = node.create_subscription(
        Empty, 'x', print, QoSProfile(depth=1), qos_overriding_options=QoSOverridingOptions(
            [QoSPolicyKind[name.upper()] for name in values]))
    found = overrides_of(node, load_evaluator(evaluator_library())).apply(
        '/robot/x', {'depth': 3, 'reliability': 'reliable'})
    assert found == {name: value.name.lower() if hasattr(value, 'name') else value
                     for name in values
                     for value in [getattr(subscription.qos_profile, name)]}
    assert found == values
    node.destroy_node()


def test_an_override_beats_the_bundle_and_leaves_other_topics_alone() -> None:
    overrides = Overrides(load_evaluator(evaluator_library()), {
        'spec': 'x.yaml', 'qos_overrides./x.subscription.reliability': 'RELIABLE',
        'qos_overrides./y.subscription.reliability': 'best_available',
        'qos_overrides./xy.subscription.depth': 7})
    bundle: dict[str, str | int] = {'reliability': 'best_effort', 'depth': 5}
    others = {'durability': 'best_available', 'history': 'keep_last'}
    assert overrides.apply('/x', bundle) == {'reliability': 'reliable', 'depth': 5, **others}
    assert overrides.apply('/y', bundle) == {'reliability': 'best_available', 'depth': 5, **others}
    assert overrides.apply('/z', bundle) == bundle | others
    assert overrides.apply('/z', {}) == {'reliability': 'best_available', 'depth': 100, **others}


def test_a_refusal_without_memory_for_its_line_is_no_consent() -> None:
    library = load_evaluator(evaluator_library())
    overrides = Overrides(SimpleNamespace(
        fm_check_overrides=lambda *_: False, fm_lines_clear=library.fm_lines_clear,
        fm_lines_free=library.fm_lines_free), {})
    with pytest.raises(MemoryError):
        overrides.problems()


@pytest.mark.parametrize('topic', [
    '/wind/sped', '/wind/speedss', '/wind', '/wnid/speed', '/wind/direct', '/xy', '/yz'])
def test_topics_that_are_spelled_alike_are_suggested(topic: str) -> None:
    known = ['/wind/direction', '/wind/speed', '/wind/speeds', '/xx']
    line, = Overrides(load_evaluator(evaluator_library()), {
        f'qos_overrides.{topic}.subscription.depth': 1}).unused(known)
    assert line.text.partition('; ')[2] == did_you_mean(topic, known)


BUNDLE = """
format: 1
inputs:
  x: {topic: /x, type: std_msgs/msg/Float32, qos: {reliability: reliable, depth: 5}}
  speed: {topic: /wind/speed, type: std_msgs/msg/Float32}
requirements:
  - {id: R, ptltl: "x < speed"}
"""
GATE = """gates:
  drive: {from: /cmd, to: /out, type: std_msgs/msg/Float32, keep: [R]}
"""
PARTS = {'monitor': UNGATED, 'gate': NodePart('drive')}
WRONG = {
    '/x.subscription.reliability:=sure':
        "is 'sure', and has to be one of reliable, best_effort, best_available",
    '/other.subscription.durability:=1':
        'is 1, and has to be one of transient_local, volatile, best_available',
    '/x.subscription.history:=best_available':
        "is 'best_available', and has to be one of keep_last, keep_all",
    '/a.subscription.reliability:=true':
        'is true, and has to be one of reliable, best_effort, best_available',
    '/b.subscription.reliability:=system_default':
        "is 'system_default', and has to be one of reliable, best_effort, best_available",
    '/c.subscription.history:=[a, b]': 'is a list, and has to be one of keep_last, keep_all',
    '/x.subscription.depth:=0': 'is 0, and has to be a number of messages, 1 to 2147483647',
    '/a.subscription.depth:=true': 'is true, and has to be a number of messages, 1 to 2147483647',
    '/b.subscription.depth:="7"': "is '7', and has to be a number of messages, 1 to 2147483647",
    '/c.subscription.depth:=2.5': 'is 2.5, and has to be a number of messages, 1 to 2147483647',
    '/d.subscription.depth:=2147483648':
        'is 2147483648, and has to be a number of messages, 1 to 2147483647',
    '/x.subscription.colour:=red':
        'is none: there are reliability, durability, history, depth',
    '/other.subscription.deadline:=1.0':
        'cannot be given: it would keep out publishers that do not offer it; use the `timeout` of '
        'the input in the bundle',
    '/x.subscription_left.depth:=1':
        "is none: subscriptions here have no id, write '.subscription.'",
    **dict.fromkeys(
        ('x.subscription.depth:=1', '/x.depth:=1', '/x.service.depth:=1', '/y.subscription:=1',
         '/z.subscription.depth.x:=1', '/z:=1'),
        "is none; write 'qos_overrides./TOPIC.subscription.POLICY', with the topic's full name"),
    **dict.fromkeys(
        ('/copilot/handlerpropR.publisher.depth:=1', '/copilot/handlerpropS.publisher_a.depth:=1',
         '/copilot/violations.publisher.depth:=1'),
        'cannot be given: violations are announced reliable and volatile; their depth is '
        '-p handler_depth:=NUMBER'),
}
RIGHT = (
    '/x.subscription.depth:=7', '/wind/speed.subscription.reliability:=BEST_EFFORT',
    '/wind/speed.subscription.history:=keep_all', '/cmd.subscription.reliability:=Reliable',
    '/clock.subscription.color:=1', '/parameter_events.publisher.depth:=100',
    '/wind/sped.subscription.depth:=1', '/nothing.subscription.history:=keep_last',
    '/motor.publisher.depth:=1', '/motor.publisher_a.deadline:=1', '/rosout.publisher.depth:=1')
IGNORED = [
    "/motor.publisher.depth': only subscriptions can be changed",
    "/motor.publisher_a.deadline': only subscriptions can be changed",
    "/nothing.subscription.history': the topic /nothing is not subscribed to",
    "/wind/sped.subscription.depth': the topic /wind/sped is not subscribed to; did you mean "
    "'/wind/speed'?"]
SHOWN = {
    '/x': ['reliable', 'best_available', 'keep_last', 7],
    '/wind/speed': ['best_effort', 'best_available', 'keep_all', 100],
    '/cmd': ['reliable', 'best_available', 'keep_last', 100],
}
POLICIES = {'reliability': '; best_available: as its publishers offer',
            'durability': '; best_available: as its publishers offer', 'history': '', 'depth': ''}
_LINE = re.compile(r"(?:^error: |\[WARN\] \[[0-9.]+\] \[\w+\]: )"
                   r"((?:ignored )?parameter 'qos_overrides\..*)", re.MULTILINE)


@pytest.fixture
def spec(tmp_path: Path) -> Path:
    path = tmp_path / 'bundle.yaml'
    path.write_text(BUNDLE, encoding='utf-8')
    return path


@contextmanager
def both(program: Path, kind: str, spec: str, *overrides: str) -> Iterator[list[NodeProcess]]:
    """Run the monitor or the gate of a bundle on rcl and on rclpy, with overrides."""
    arguments = [word for item in overrides for word in ('-p', f'qos_overrides.{item}')]
    nodes = [ExportedNode(program, *arguments, '-r', '__node:=exported'),
             NodeProcess(kind, '-p', f'spec:={spec}', *arguments, '-r', '__node:=python')]
    try:
        yield nodes
    finally:
        for node in nodes:
            node.kill()


def test_wrong_overrides_are_refused_all_together_by_both_nodes(domain: int, spec: Path) -> None:
    expected = [f"parameter 'qos_overrides.{item.partition(':=')[0]}' {text}"
                for item, text in WRONG.items()]
    other = spec.with_name('other.yaml')
    other.write_text(BUNDLE.replace('id: R', 'id: S'), encoding='utf-8')
    with both(exported_bundles(spec, other), 'monitor', f'["{spec}", "{other}"]',
              *WRONG) as nodes:
        for node in nodes:
            assert node.status(4 * PATIENCE) == 1  # the first one has to compile
            assert _LINE.findall(node.output) == expected


def shown_by(partner: Partner, node: str, names: list[str]) -> tuple[list[object], list[str]]:
    """Return values and descriptions of parameters, which are all overrides that a node shows."""
    def ask(kind: Any, name: str, **fields: Any) -> Any:
        return answer_of(partner.node.create_client(kind, f'{node}/{name}_parameters'),
                         kind.Request(**fields))

    wait_until(lambda: sorted(
        name for name in ask(ListParameters, 'list').result.names
        if name.startswith('qos_overrides.')) == sorted(names), 'the overrides')
    result, = ask(SetParameters, 'set', parameters=[
        Parameter(names[0], value='reliable').to_parameter_msg()]).results
    assert (result.successful, result.reason) == (
        False, f'{names[0]}: read at the start of the process only')
    return ([parameter_value_to_python(item) for item in ask(
                GetParameters, 'get', names=names).values],
            [item.description for item in ask(
                DescribeParameters, 'describe', names=names).descriptors])


@pytest.mark.parametrize('kind', PARTS)
def test_both_nodes_show_overrides_apply_them_and_name_those_that_nothing_reads(
    partner: Partner, spec: Path, kind: str,
) -> None:
    topics = [topic for topic in SHOWN if topic != '/cmd' or kind == 'gate']
    if kind == 'gate':
        spec.write_text(BUNDLE + GATE, encoding='utf-8')
    program = exported_bundle(spec, part=PARTS[kind])
    with both(program, kind, str(spec), *RIGHT) as nodes:
        for node in nodes:
            node.wait_for('watching', 4 * PATIENCE)
        unread = [] if kind == 'gate' else [
            "/cmd.subscription.reliability': the topic /cmd is not subscribed to"]
        for node in nodes:
            assert sorted(_LINE.findall(node.output)) == [
                f"ignored parameter 'qos_overrides.{text}" for text in sorted(IGNORED + unread)]
        for name in ('exported', 'python'):
            assert shown_by(partner, name, [
                f'qos_overrides.{topic}.subscription.{policy}'
                for topic in topics for policy in POLICIES]) == (
                [value for topic in topics for value in SHOWN[topic]],
                [f'{policy} of the subscription to {topic}; read at the start of the process'
                 f'{note}' for topic in topics for policy, note in POLICIES.items()])
        for topic in topics:
            assert {(item.node_name, item.qos_profile.reliability.name.lower())
                    for item in partner.node.get_subscriptions_info_by_topic(topic)} == {
                (name, SHOWN[topic][0]) for name in ('exported', 'python')}


def test_the_logger_shows_what_it_requests_of_handlers(partner: Partner, spec: Path) -> None:
    with started('logger', '-p', f'spec:={spec}',
                 '-p', 'qos_overrides./copilot/handlerpropR.subscription.depth:=7'):
        values, _ = shown_by(partner, 'fret_logger', [
            f'qos_overrides./copilot/{topic}.subscription.{policy}'
            for topic in ('handlerpropR', 'violations') for policy in POLICIES])
    assert values == ['reliable', 'volatile', 'keep_last', 7,
                      'reliable', 'volatile', 'keep_last', 1000]


def test_an_override_decides_the_qos_of_a_subscription(partner: Partner, spec: Path) -> None:
    x = partner.publisher(Float32, '/far/x', BEST_EFFORT)
    y = partner.publisher(Float32, '/wind/speed', RELIABLE)
    with started('monitor', '-p', f'spec:={spec}', '-r', '/x:=/far/x',
                 '-p', 'qos_overrides./far/x.subscription.reliability:=best_effort',
                 '-p', 'qos_overrides./wind/speed.subscription.durability:=transient_local',
                 '-p', 'qos_overrides./x.subscription.depth:=3') as node:
        wait_until(lambda: x.get_subscription_count() > 0, 'the override beside the bundle')
        node.wait_for('/partner does not match the subscription to /wind/speed: it offers '
                      'reliable, volatile')
        node.wait_for(': leave `durability` out there')
        assert y.get_subscription_count() == 0
        assert "ignored parameter 'qos_overrides./x.subscription.depth': the topic /x is not " \
            'subscribed to' in node.output
