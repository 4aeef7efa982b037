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

"""Parameters at run time: their descriptions, which may change, and why others may not."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from bundles import BELOW_HALF, write_bundle
from fret_monitor.ros import LoggerNode, MonitorNode, Refusal
from fret_monitor.ros.settings.opened import open_manifests
from fret_monitor.ros.settings.parameters import read_settings
import pytest
from rcl_interfaces.srv import DescribeParameters, SetParameters, SetParametersAtomically
from rclpy.parameter import Parameter
from ros.harness import answer_of, make_node, Partner, started
from ros.test_lifecycle import ACTIVATE, CONFIGURE, Manager, waiting

NAMES = ['spec', 'library', 'policy', 'period', 'rate', 'metrics', 'native', 'hot_path',
         'handler_depth', 'log_violations', 'verdicts', 'margins', 'blackbox', 'blackbox_seconds',
         'blackbox_bytes', 'blackbox_files', 'blackbox_disk_bytes', 'priority', 'processors',
         'lock_memory', 'autostart', 'log_level']


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    return write_bundle(tmp_path, BELOW_HALF)


def call(partner: Partner, kind: Any, name: str, request: Any) -> Any:
    return answer_of(partner.node.create_client(kind, name), request)


def set_to(partner: Partner, **values: object) -> list[tuple[bool, str]]:
    """Set parameters of the monitor as `ros2 param set` does; return result and reason of each."""
    messages = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
    answer = call(partner, SetParameters, '/fret_monitor/set_parameters',
                  SetParameters.Request(parameters=messages))
    return [(result.successful, result.reason) for result in answer.results]


def test_every_parameter_has_a_description(partner: Partner, bundle: Path) -> None:
    with started('monitor', '-p', f'spec:={bundle}'):
        answer = call(partner, DescribeParameters, '/fret_monitor/describe_parameters',
                      DescribeParameters.Request(names=NAMES))
    described = {item.name: item for item in answer.descriptors}
    assert list(described) == NAMES
    assert all(len(item.description) > 20 for item in answer.descriptors)
    assert [name for name in NAMES if described[name].read_only] == ['native', 'autostart']


def test_parameters_read_by_configure_change_only_before_it_and_then_take_effect(
    partner: Partner, bundle: Path,
) -> None:
    with waiting() as node:
        manager = Manager(partner)
        assert manager.ask(CONFIGURE) == [False]
        node.wait_for('nothing to monitor: name a bundle')
        node.wait_for('nothing is monitored until the node is active again')
        assert set_to(partner, policy='sometimes')[0] == (
            False, "parameter 'policy' is 'sometimes', and has to be one of every_message, "
                   'relevant_message, all_inputs, periodic, timed')
        assert set_to(partner, spec=None)[0] == (
            False, "parameter 'spec' is not set, and has to be a path or a list of paths")
        assert set_to(partner, spec=str(bundle), policy='periodic', rate=20) == [(True, '')] * 3
        assert set_to(partner, period=0.5)[0] == (
            False, "parameters 'period' and 'rate' are both given: give one of them")
        assert manager.ask(CONFIGURE) == [True]
        (successful, reason), = set_to(partner, spec='other.yaml')
        assert not successful
        assert reason.startswith('spec: read when the node is configured, so ')
        assert reason.endswith('deactivate and clean up first')
        assert manager.ask(ACTIVATE) == [True]
        node.wait_for('policy periodic, 0.05 s, ')
        for name, value in {'policy': 'all_inputs', 'rate': 5.0, 'period': 1, 'library': 'x',
                            'hot_path': 'off'}.items():
            (successful, reason), = set_to(partner, **{name: value})
            assert (successful, reason.partition(':')[0]) == (False, name)
        assert [successful for successful, _ in set_to(partner, autostart=True, report='onset')] \
            == [False, False]
        assert set_to(partner, use_sim_time=True) == [(True, '')]


def test_a_periodic_bundle_may_take_its_period_from_a_parameter(
    partner: Partner, bundle: Path,
) -> None:
    bundle.write_text(BELOW_HALF + 'evaluation: {policy: periodic}\n', encoding='utf-8')
    with pytest.raises(Refusal, match="the policy periodic needs a 'period' or a 'rate'"):
        make_node(MonitorNode, partner.context, spec=bundle)
    arguments = ('-p', f'spec:={bundle}', '-p', 'rate:=20.0')
    with started('monitor', *arguments) as node, started('logger', *arguments):
        node.wait_for('policy periodic, 0.05 s, ')


@pytest.mark.parametrize(('word', 'told'), [
    ('auto', 'messages are taken in C, inside '), ('on', 'messages are taken in C, inside '),
    ('off', 'messages are taken in C, in a thread of its own: hot_path is off')])
def test_a_parameter_decides_whether_callbacks_take_the_messages(
    word: str, told: str, partner: Partner, bundle: Path,
) -> None:
    # YAML reads `on` and `off` as booleans; here they are words.
    with started('monitor', '-p', f'spec:={bundle}', '-p', f'hot_path:={word}') as node:
        assert told in node.output


@pytest.mark.parametrize('name', ['monitor', 'logger'])
def test_a_value_of_a_type_that_there_is_not_does_not_end_the_process(
    partner: Partner, bundle: Path, name: str,
) -> None:
    with started(name, '-p', f'spec:={bundle}'):
        value = Parameter('log_level', value=1).to_parameter_msg()
        value.value.type = 77
        result = call(partner, SetParametersAtomically,
                      f'/fret_{name}/set_parameters_atomically',
                      SetParametersAtomically.Request(parameters=[value])).result
        answer = call(partner, SetParameters, f'/fret_{name}/set_parameters',
                      SetParameters.Request(parameters=[value]))
        assert answer.results == [result]


def test_the_log_level_changes_at_any_time(partner: Partner, bundle: Path) -> None:
    with started('monitor', '-p', f'spec:={bundle}') as node:
        assert set_to(partner, log_level='loud')[0] == (
            False, "parameter 'log_level' is 'loud', and has to be one of debug, info, warn, "
                   'error, fatal')
        assert set_to(partner, log_level='error') == [(True, '')]
        partner.reset()
        assert set_to(partner, log_level='info') == [(True, '')]
        assert 'restarted' not in node.output
        partner.reset()
        node.wait_for('restarted 1 step group')


@pytest.fixture
def made(partner: Partner) -> Iterator[list[MonitorNode | LoggerNode]]:
    nodes: list[MonitorNode | LoggerNode] = []
    yield nodes
    for node in nodes:
        node.destroy_node()


def test_a_log_level_given_at_the_start_applies_from_the_start(
    partner: Partner, bundle: Path, made: list[MonitorNode | LoggerNode],
    capfd: pytest.CaptureFixture[str],
) -> None:
    for kind in (MonitorNode, LoggerNode):
        made.append(kind(context=partner.context, cli_args=['--ros-args'], parameter_overrides=[
            Parameter('spec', value=str(bundle)), Parameter('log_level', value='warn')]))
    assert 'watching' not in capfd.readouterr().err


def test_an_unknown_parameter_is_reported_with_the_nearest_name(
    partner: Partner, bundle: Path, made: list[MonitorNode | LoggerNode],
    capfd: pytest.CaptureFixture[str],
) -> None:
    given = {'spec': str(bundle), 'polcy': 'periodic', 'frame_id': 'map'}
    for kind in (MonitorNode, LoggerNode):
        made.append(kind(
            context=partner.context, cli_args=['--ros-args'],
            parameter_overrides=[Parameter(name, value=item) for name, item in given.items()]))
    told = capfd.readouterr().err
    assert "ignored parameter 'polcy': did you mean 'policy'?" in told
    assert f"ignored parameter 'frame_id': this node has {', '.join(NAMES)}" in told
    assert "ignored parameter 'frame_id': this node has spec, library, policy, period, rate, " \
        'handler_depth, log_level' in told
    assert told.count("ignored parameter 'spec'") == 0


def test_an_ignored_parameter_named_as_a_constant_is_reported_with_the_prefix(
    partner: Partner, made: list[MonitorNode | LoggerNode], tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
) -> None:
    bundle = tmp_path / 'base.yaml'
    bundle.write_text(
        'format: 1\nconstants: {v_max: 0.8}\n'
        'inputs: {v: {topic: v, type: std_msgs/msg/Float32}}\n'
        'requirements: [{id: R, ptltl: v < v_max}]\n', encoding='utf-8')
    given = {'spec': str(bundle), 'v_max': 0.3, 'constant.v_max': 0.3}
    made.append(MonitorNode(
        context=partner.context, cli_args=['--ros-args'],
        parameter_overrides=[Parameter(name, value=item) for name, item in given.items()]))
    told = capfd.readouterr().err
    for name in ('v_max', 'constant.v_max'):
        assert told.count(f"ignored parameter '{name}': did you mean 'constants.v_max'?") == 1
    assert told.count('ignored parameter') == 2  # a line for each


@pytest.mark.parametrize('kind', [MonitorNode, LoggerNode])
def test_a_refusal_to_start_follows_the_parameters_that_were_ignored(
    kind: type[MonitorNode | LoggerNode], partner: Partner, bundle: Path,
    capfd: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(Refusal, match='nothing to monitor'):
        make_node(kind, partner.context, spek=bundle)
    assert capfd.readouterr().err.count("ignored parameter 'spek': did you mean 'spec'?") == 1


def test_the_logger_does_not_warn_of_parameters_of_the_monitor(
    partner: Partner, bundle: Path, made: list[MonitorNode | LoggerNode],
    capfd: pytest.CaptureFixture[str],
) -> None:
    made.append(make_node(LoggerNode, partner.context, spec=bundle, hot_path='off'))
    assert 'ignored' not in capfd.readouterr().err
    result = made[0].set_parameters([Parameter('spec', value='other.yaml')])[0]
    assert not result.successful


@pytest.mark.parametrize(('given', 'cause'), [
    ({'period': 0.5}, 'period:=0.5'), ({'policy': 'timed'}, 'policy:=timed'),
    ({'policy': 'periodic', 'rate': 4.0, 'constants.y': 1}, 'policy:=periodic, period:=0.25, '
                                                            'constants.y:=1')])
def test_parameters_that_change_a_bundle_are_named_with_its_errors(
    given: dict[str, object], cause: str, bundle: Path,
) -> None:
    bundle.write_text(BELOW_HALF.replace('x < 0.5', 'O[0,3] (x < 0.5)')
                      + 'constants: {y: true}\n', encoding='utf-8')
    with pytest.raises(Refusal) as caught:
        open_manifests(read_settings({'spec': str(bundle), **given}))
    assert str(caught.value).endswith(f'note: in place of what the bundle says: {cause}')
    bundle.write_text(BELOW_HALF.replace('x < 0.5', 'x <'), encoding='utf-8')
    with pytest.raises(Refusal) as caught:
        open_manifests(read_settings({'spec': str(bundle)}))
    assert 'note' not in str(caught.value)
