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

"""The parameters `qos_overrides`: named as rclpy names them, and refused where they are wrong."""

from pathlib import Path

from fret_monitor.ros.settings.overrides import Overrides
from fret_monitor.ros.settings.parameters import Refusal
import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSPolicyKind, QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions
from ros.harness import BEST_EFFORT, NodeProcess, Partner, RELIABLE, started, wait_until
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
    found = Overrides.of(node).apply('/robot/x', {'depth': 3, 'reliability': 'reliable'})
    assert found == {name: value.name.lower() if hasattr(value, 'name') else value
                     for name in values
                     for value in [getattr(subscription.qos_profile, name)]}
    assert found == values
    node.destroy_node()


def test_an_override_beats_the_bundle_and_leaves_other_topics_alone() -> None:
    overrides = Overrides({
        'spec': 'x.yaml', 'qos_overrides./x.subscription.reliability': 'RELIABLE',
        'qos_overrides./y.subscription.reliability': 'best_available',
        'qos_overrides./parameter_events.publisher.depth': 100})
    bundle: dict[str, str | int] = {'reliability': 'best_effort', 'depth': 5}
    assert overrides.apply('/x', bundle) == {'reliability': 'reliable', 'depth': 5}
    assert overrides.apply('/y', bundle) == {'depth': 5}, 'its publishers decide'
    assert overrides.apply('/z', bundle) == bundle


@pytest.mark.parametrize(('name', 'value', 'told'), [
    ('/x.subscription.reliability', 'sure', "is 'sure', and has to be one of reliable, best_effor"
                                            't, best_available'),
    ('/x.subscription.durability', 1, 'is 1, and has to be one of transient_local, volatile, bes'),
    ('/x.subscription.history', 'best_available', 'has to be one of keep_last, keep_all'),
    ('/x.subscription.reliability', 'system_default', 'has to be one of reliable'),
    ('/x.subscription.depth', 0, 'is 0, and has to be a number of messages, at least 1'),
    ('/x.subscription.depth', True, 'is True, and has to be a number of messages'),
    ('/x.subscription.depth', '7', "is '7', and has to be a number of messages"),
    ('/x.subscription.depth', 2**40, 'has to be a number of messages'),
    ('/x.subscription.colour', 'red', 'is none: there are reliability, durability, history, de'),
    ('/x.subscription.deadline', 10**9, 'use the `timeout` of the input'),
    ('/x.subscription_left.depth', 1, "subscriptions here have no id, write '.subscription.'"),
    ('x.subscription.depth', 1, "is none; write 'qos_overrides./TOPIC.subscription.POLICY'"),
    ('/x.depth', 1, "is none; write 'qos_overrides./TOPIC.subscription.POLICY'"),
    ('/x.service.depth', 1, "is none; write 'qos_overrides./TOPIC.subscription.POLICY'"),
])
def test_a_wrong_value_is_refused_with_the_possible_ones(
    name: str, value: str | int, told: str,
) -> None:
    with pytest.raises(Refusal) as caught:
        Overrides({f'qos_overrides.{name}': value, 'qos_overrides./y.subscription.depth': -1})
    first, second = str(caught.value).splitlines()
    assert first.startswith(f"error: parameter 'qos_overrides.{name}' ") and told in first
    assert '/y.subscription.depth' in second


def test_the_qos_of_violations_cannot_be_overridden() -> None:
    overrides = Overrides({'qos_overrides./copilot/handlerpropR.publisher.depth': 1})
    overrides.refuse_publishers(['/copilot/handlerpropQ'])
    with pytest.raises(Refusal, match='their depth is -p handler_depth:=NUMBER'):
        overrides.refuse_publishers(['/copilot/handlerpropR'])


def test_overrides_that_nothing_reads_are_named() -> None:
    overrides = Overrides({
        'qos_overrides./windspeed.subscription.depth': 1,
        'qos_overrides./windsped.subscription.depth': 1,
        'qos_overrides./motor.publisher.depth': 1})
    assert list(overrides.unused(['/windspeed', '/current'])) == [
        "ignored parameter 'qos_overrides./windsped.subscription.depth': the topic /windsped is "
        "not subscribed to; did you mean '/windspeed'?",
        "ignored parameter 'qos_overrides./motor.publisher.depth': only subscriptions can be "
        'changed']


BUNDLE = """
format: 1
inputs:
  x: {topic: x, type: std_msgs/msg/Float32, qos: {reliability: reliable, depth: 5}}
  y: {topic: y, type: std_msgs/msg/Float32}
requirements:
  - {id: R, ptltl: "x < y"}
"""


@pytest.fixture
def spec(tmp_path: Path) -> tuple[str, str]:
    path = tmp_path / 'bundle.yaml'
    path.write_text(BUNDLE, encoding='utf-8')
    return '-p', f'spec:={path}'


def test_an_override_decides_the_qos_of_a_subscription(
    partner: Partner, spec: tuple[str, str],
) -> None:
    x = partner.publisher(Float32, '/far/x', BEST_EFFORT)
    y = partner.publisher(Float32, 'y', RELIABLE)
    with started('monitor', *spec, '-r', 'x:=/far/x',
                 '-p', 'qos_overrides./far/x.subscription.reliability:=best_effort',
                 '-p', 'qos_overrides./y.subscription.durability:=transient_local',
                 '-p', 'qos_overrides./x.subscription.depth:=3') as node:
        wait_until(lambda: x.get_subscription_count() > 0, 'the override beside the bundle')
        node.wait_for('/partner does not match the subscription to /y: it offers reliable, '
                      'volatile')
        node.wait_for(': leave `durability` out there')
        assert y.get_subscription_count() == 0
        assert "ignored parameter 'qos_overrides./x.subscription.depth': the topic /x is not " \
            'subscribed to' in node.output


@pytest.mark.parametrize(('override', 'told'), [
    ('/x.subscription.reliability:=sure', "is 'sure', and has to be one of reliable, best_effort"),
    ('/copilot/handlerpropR.publisher.depth:=1', 'cannot be given: violations are announced'),
])
def test_a_monitor_does_not_start_with_a_wrong_override(
    domain: int, spec: tuple[str, str], override: str, told: str,
) -> None:
    node = NodeProcess('monitor', *spec, '-p', f'qos_overrides.{override}')
    assert node.status() == 1
    assert f"error: parameter 'qos_overrides.{override.partition(':=')[0]}' {told}" in node.output
    node.kill()
