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
The parameters of both nodes, side by side: they take and refuse the same, in the same words.

What may differ: the parameters that only the node in Python has, in the list of all.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
import re
from typing import Any

from bundles import write_bundle
from fret_monitor.ros.settings.parameters import MONITOR_PARAMETERS, OF_BOTH
import pytest
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import (
    DescribeParameters, GetParameters, SetParameters, SetParametersAtomically,
)
from ros.exported import exported_bundle, ExportedNode
from ros.harness import answer_of, NodeProcess, Partner
from ros.test_lifecycle import CONFIGURE, Manager

BUNDLE = """
format: 1
constants: {limit: 0.7, a.b: 3}
inputs:
  x: {topic: x, type: std_msgs/msg/Float32}
requirements:
  - {id: R-1, ptltl: "x < limit & x < a.b"}
"""
NAMES = ('python', 'native')
OF_ROS = ('use_sim_time', 'start_type_description_service')
_TEXTS = ('hot_path', 'blackbox', 'processors', 'log_level')
_FLAGS = tuple(name for name, item in OF_BOTH.items() if item.kind == 'FLAG')
_NUMBERS = tuple(name for name in OF_BOTH if name not in (*_TEXTS, *_FLAGS))
_ONLY_PYTHON = ', '.join(name for name in MONITOR_PARAMETERS if name not in OF_BOTH)


@pytest.fixture(scope='module')
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_bundle(tmp_path_factory.mktemp('table'), BUNDLE)


@contextmanager
def both(bundle: Path, given: Mapping[str, str]) -> Iterator[list[NodeProcess]]:
    """Start both nodes with the same parameters, each in a namespace of its own."""
    arguments = [word for name, text in given.items() for word in ('-p', f'{name}:={text}')]
    nodes = [
        NodeProcess('monitor', '-p', f'spec:={bundle}', '-r', '__ns:=/python', *arguments),
        ExportedNode(exported_bundle(bundle), '-r', '__ns:=/native', *arguments)]
    try:
        yield nodes
    finally:
        for node in nodes:
            node.kill()


def refusals(bundle: Path, given: Mapping[str, str]) -> list[str]:
    """Return what both nodes log before they refuse to start; it is equal."""
    said = []
    with both(bundle, given) as nodes:
        for node in nodes:
            assert node.status() == 1, node.output
            said.append(re.sub(r'\[[0-9.]+\] \[[\w.]+\]', '', node.output).replace(
                f'{_ONLY_PYTHON}, ', '').splitlines())
    assert said[0] == said[1]
    return said[0]


def every(names: Sequence[str], text: str) -> dict[str, str]:
    return dict.fromkeys(names, text)


@pytest.mark.parametrize(('given', 'shown'), [
    ({**every(_FLAGS, '1'), **every(_NUMBERS, '-1'), 'hot_path': 'fast', 'log_level': 'INFO',
      'blackbox': '3', 'processors': '1.5'}, {'1', '-1', "'fast'", "'INFO'", '3', '1.5'}),
    ({**every(_FLAGS, 'sure'), **every(_NUMBERS, 'false'), 'log_level': 'off', 'hot_path': '1',
      'blackbox': 'false', 'processors': 'true'}, {"'sure'", 'false', '1', 'true'}),
    ({**every(_FLAGS, '1e-05'), **every(_NUMBERS, '"1"'), **every(_TEXTS, '[a, b]')},
     {'1e-05', "'1'", 'a list'}),
    ({**every(_FLAGS, '[true]'), **every(_NUMBERS, '""'), **every(_TEXTS, '0.5')},
     {'a list', "''", '0.5'}),
    ({'blackbox_seconds': '0', 'handler_depth': '2147483648', 'priority': '100',
      'blackbox_files': str(1 << 62), 'blackbox_bytes': '4095', 'blackbox_disk_bytes': '1e+20'},
     {'0', '2147483648', '100', str(1 << 62), '4095', '1e+20'}),
    ({'blackbox_seconds': '1000000001', 'handler_depth': '1.0'}, {'1000000001', '1.0'}),
    ({'blackbox_seconds': '.nan'}, {'nan'}),
])
def test_both_nodes_refuse_the_same_values_in_the_same_words(
    domain: int, bundle: Path, given: dict[str, str], shown: set[str],
) -> None:
    said = '\n'.join(refusals(bundle, given))
    found = re.findall("^error: parameter '(.*?)' is (.*?), and has to be ", said, re.MULTILINE)
    assert [name for name, _ in found] == [name for name in OF_BOTH if name in given]
    assert {text for _, text in found} == shown


def test_both_nodes_report_unknown_parameters_and_constants_in_the_same_words(
    domain: int, bundle: Path,
) -> None:
    said = refusals(bundle, {
        'handler_dept': '3', 'frame_id': 'map', 'blackbox_byte': '3',
        'metrics': '""', 'constants.limt': '1.0', 'constants.other': '1'})
    assert said == [
        "[WARN] : ignored parameter 'handler_dept': did you mean 'handler_depth'?",
        f"[WARN] : ignored parameter 'frame_id': this node has {', '.join(OF_BOTH)}, "
        'constants.NAME',
        "[WARN] : ignored parameter 'blackbox_byte': did you mean 'blackbox_bytes' or "
        "'blackbox_disk_bytes' or 'blackbox'?",
        "error: parameter 'constants.limt': no bundle has this constant: did you mean 'limit'?",
        "error: parameter 'constants.other': no bundle has this constant: the constants are "
        'limit, a.b']


GOOD = {
    'autostart': 'false', 'hot_path': 'off', 'handler_depth': '2147483647', 'log_level': '""',
    'log_violations': 'false', 'verdicts': 'true', 'blackbox': '""', 'blackbox_seconds': '1e9',
    'blackbox_bytes': str((1 << 62) - 1), 'blackbox_files': '1', 'blackbox_disk_bytes': '1048576',
    'priority': '0', 'processors': '0', 'lock_memory': 'false', 'constants.a_DOT_b': '3.0',
    'constants.limit': '0.7', 'metrics': '""'}


def value(given: object) -> ParameterValue:
    match given:
        case None:
            return ParameterValue()
        case bool():
            return ParameterValue(type=ParameterType.PARAMETER_BOOL, bool_value=given)
        case int():
            return ParameterValue(type=ParameterType.PARAMETER_INTEGER, integer_value=given)
        case float():
            return ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=given)
        case str():
            return ParameterValue(type=ParameterType.PARAMETER_STRING, string_value=given)
    return ParameterValue(type=ParameterType.PARAMETER_INTEGER_ARRAY, integer_array_value=given)


class Asked:
    """The services of both nodes."""

    def __init__(self, partner: Partner) -> None:
        self._make = partner.node.create_client

    def of_both(self, kind: Any, name: str, request: Any) -> Any:
        """Return the answers of both nodes; they are equal."""
        ours, theirs = (answer_of(self._make(kind, f'/{node}/fret_monitor/{name}'), request)
                        for node in NAMES)
        assert ours == theirs
        return ours

    def set_to(self, *pairs: tuple[str, object]) -> list[tuple[bool, str]]:
        messages = [Parameter(name=name, value=value(given)) for name, given in pairs]
        found = self.of_both(SetParameters, 'set_parameters',
                             SetParameters.Request(parameters=messages)).results
        return [(item.successful, item.reason) for item in found]

    def refusals(self, *pairs: tuple[str, object]) -> list[str]:
        """Return the reasons for which nothing of a request of all at once is set."""
        messages = [Parameter(name=name, value=value(given)) for name, given in pairs]
        found = self.of_both(SetParametersAtomically, 'set_parameters_atomically',
                             SetParametersAtomically.Request(parameters=messages)).result
        assert not found.successful
        return str(found.reason).split('; ')


def test_both_nodes_have_the_same_parameters_and_refuse_changes_in_the_same_words(
    partner: Partner, bundle: Path,
) -> None:
    with both(bundle, GOOD) as nodes:
        for node in nodes:
            node.wait_for('waiting to be configured')
            assert 'ignored' not in node.output
        asked = Asked(partner)
        answer = asked.of_both(GetParameters, 'get_parameters',
                               GetParameters.Request(names=list(OF_BOTH)))
        assert answer.values[0].type == ParameterType.PARAMETER_BOOL
        asked.of_both(DescribeParameters, 'describe_parameters',
                      DescribeParameters.Request(names=[*OF_BOTH, *OF_ROS]))
        wrong = (('nothing', 1), ('autostart', True), ('use_sim_time', 3), ('log_level', 'loud'),
                 ('log_level', None), ('hot_path', None), ('blackbox', False),
                 ('handler_depth', [1]), ('verdicts', 'yes'))
        said = asked.set_to(*wrong)
        assert [reason for is_done, reason in said if is_done] == []
        assert said[:3] == [
            (False, "there is no parameter 'nothing'"),
            (False, 'autostart: read at the start of the process only'),
            (False, "parameter 'use_sim_time' is 3, and has to be true or false")]
        assert "parameter 'log_level' is not set, and has to be one of debug" in said[4][1]
        # In the order of the request, which is not that of the table, nor by kinds of reasons.
        assert asked.refusals(*wrong, ('nothing', 1)) == [
            *(reason for _, reason in said), said[0][1]]
        assert asked.set_to(('handler_depth', 5), ('blackbox_seconds', 3), ('hot_path', 'auto')
                            ) == [(True, '')] * 3
        for name in NAMES:
            assert Manager(partner, f'/{name}/fret_monitor').ask(CONFIGURE) == [True]
        once = ': read when the node is configured, so deactivate and clean up first'
        assert asked.refusals(
            ('log_level', 'loud'), ('handler_depth', 5), ('nothing', 1), ('blackbox_files', 5)
        ) == [said[3][1], f'handler_depth{once}', said[0][1], f'blackbox_files{once}']
        assert asked.set_to(('log_level', 'warn')) == [(True, '')]
