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

"""The parameters `constants.NAME`: other values for constants of the bundles."""

from collections.abc import Mapping
from pathlib import Path

from fret_monitor import build
from fret_monitor.model.manifest import Manifest
from fret_monitor.ros import MonitorNode, Refusal
from fret_monitor.ros.settings.declared import ConstantParameters
from fret_monitor.ros.settings.opened import open_manifests, open_monitors
from fret_monitor.ros.settings.parameters import read_settings, Settings
import pytest
from rclpy.parameter import Parameter
from ros.harness import Partner

BASE = """
format: 1
constants: {v_max: 2.0, n: 3, is_outdoors: true}
inputs:
  v: {topic: v, type: std_msgs/msg/Float32}
requirements:
  - {id: R-1, ptltl: "v < v_max * n | is_outdoors"}
"""
ARM = """
format: 1
constants: {v_max: 1.0, reach: 0.8}
inputs:
  r: {topic: r, type: std_msgs/msg/Float32}
requirements:
  - {id: R-2, ptltl: "r < reach * v_max"}
"""


@pytest.fixture
def bundles(tmp_path: Path) -> list[str]:
    (tmp_path / 'base.yaml').write_text(BASE, encoding='utf-8')
    (tmp_path / 'arm.yaml').write_text(ARM, encoding='utf-8')
    return [str(tmp_path / 'base.yaml'), str(tmp_path / 'arm.yaml')]


def settings(constants: Mapping[str, object], **given: object) -> Settings:
    return read_settings(
        given | {f'constants.{name}': value for name, value in constants.items()})


def manifests(constants: Mapping[str, object], **given: object) -> list[Manifest]:
    return open_manifests(settings(constants, **given))


def refused(constants: Mapping[str, object], **given: object) -> str:
    with pytest.raises(Refusal) as found:
        manifests(constants, **given)
    return str(found.value)


def test_of_several_bundles_those_get_a_constant_that_have_it(bundles: list[str]) -> None:
    base, arm = manifests({'v_max': 1.5, 'reach': 1, 'is_outdoors': False}, spec=bundles)
    assert base.constants == (('v_max', '1.5'), ('n', '3'), ('is_outdoors', 'false'))
    assert arm.constants == (('v_max', '1.5'), ('reach', '1.0'))
    assert 'v < 4.5' in base.requirements[0].formula
    assert refused({'rech': 1.0}, spec=bundles) == (
        "error: parameter 'constants.rech': no bundle has this constant: did you mean 'reach'?")
    assert refused({'unlike': 1.0}, spec=bundles).endswith(
        'the constants are v_max, n, is_outdoors, reach')


def test_a_constant_with_several_values_is_not_shown(partner: Partner) -> None:
    constants = ConstantParameters(partner.node, '', read_only=False)
    constants.show([('k', '1'), ('m', '2'), ('k', '1.5'), ('m', '2.0')])
    assert list(partner.node.get_parameters_by_prefix('constants')) == ['m']
    assert constants.overrides() == {}


def test_a_value_that_cannot_be_used_is_refused_with_its_parameter(bundles: list[str]) -> None:
    message = refused({'v_mx': 1.0, 'n': float('nan')}, spec=bundles[0])
    assert "error: parameter 'constants.v_mx': no bundle has this constant: did you mean " \
        "'v_max'?\n" in message
    assert "must be a number, true or false, and is the text 'nan'" in message
    assert refused({'v_max': [1.0]}, spec=bundles[0]) == (
        "error: parameter 'constants.v_max' is a list, and has to be a number, true or false")
    assert 'with parameter constants.v_max = 1e+300 in place of 2.0' in refused(
        {'v_max': 1e300}, spec=bundles[0])


def test_a_compiled_folder_refuses_other_constants(bundles: list[str], tmp_path: Path) -> None:
    folder = tmp_path / 'compiled'
    build.write(build.generate_monitor(build.read(Path(bundles[0]))), folder)
    assert manifests({'v_max': 2, 'is_outdoors': True}, library=str(folder))
    for open_all in (open_manifests, open_monitors):
        with pytest.raises(Refusal) as found:
            open_all(settings({'v_max': 0.8}, library=str(folder)))
        assert str(found.value).startswith(
            'error: parameter constants.v_max: v_max is compiled into the folder, as 2.0: compile '
            'the folder with --constant v_max=0.8')
    assert "no bundle has this constant: did you mean 'v_max'?" in refused(
        {'v_mx': 2}, library=str(folder))


@pytest.mark.parametrize(('compiled', 'given'), [
    ('{policy: timed}', {}), ('{policy: timed}', {'policy': 'timed'}),
    ('{policy: every_message}', {'policy': 'relevant_message'})])
def test_a_compiled_folder_runs_with_a_policy_that_has_the_same_durations(
    compiled: str, given: dict[str, str], bundles: list[str], tmp_path: Path,
) -> None:
    bundle, folder = Path(bundles[0]), tmp_path / 'compiled'
    bundle.write_text(f'{BASE}evaluation: {compiled}\n', encoding='utf-8')
    build.write(build.generate_monitor(build.read(bundle)), folder)
    opened, = open_monitors(settings({}, library=str(folder), **given))
    assert opened.policy.value == given.get('policy', 'timed')


def test_the_node_shows_all_constants_and_reads_them_when_it_is_configured(
    partner: Partner, bundles: list[str],
) -> None:
    node = MonitorNode(context=partner.context, parameter_overrides=[
        Parameter('spec', value=bundles[0]), Parameter('constants.v_max', value=0.5)])
    try:
        def shown() -> dict[str, object]:
            return {name: node.get_parameter(f'constants.{name}').value
                    for name in node.get_parameters_by_prefix('constants')}

        assert shown() == {'v_max': 0.5, 'n': 3, 'is_outdoors': True}
        described = [node.describe_parameter(f'constants.{name}') for name in shown()]
        assert [item.name for item in described] == [f'constants.{name}' for name in shown()]
        result, = node.set_parameters([Parameter('constants.n', value=4)])
        assert not result.successful
        assert result.reason.startswith('constants.n: read when the node is configured')

        node.trigger_deactivate()
        node.trigger_cleanup()
        assert node.set_parameters([Parameter('constants.n', value=4)])[0].successful
        Path(bundles[0]).write_text(BASE.replace('is_outdoors: true', 'is_outdoors: false, m: 7'))
        node.trigger_configure()
        assert shown() == {'v_max': 0.5, 'n': 4, 'is_outdoors': False, 'm': 7}
    finally:
        node.destroy_node()
