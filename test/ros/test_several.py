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

"""Several bundles in one node, and several nodes in one graph."""

from collections import Counter
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
import os
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from fret_monitor import build
from fret_monitor.model.names import distinct_names
from fret_monitor.ros import Refusal
from fret_monitor.ros.native_start import GATE, MONITOR
from fret_monitor.ros.nodes.gate_node import GateNode
import pytest
from rcl_interfaces.srv import ListParameters
from ros.exported import exported_bundles, ExportedNode, running
from ros.harness import answer_of, make_node, Partner, refusal, RELIABLE, started, wait_until
from ros.test_native_start import program_of
from ros.test_side_by_side import compare_files, equal, Face, MISSING
from std_msgs.msg import Empty, Float32

FIRST = """
format: 1
inputs:
  x: {topic: x, type: std_msgs/msg/Float32}
  y: {topic: y, type: std_msgs/msg/Float32}
requirements:
  - {id: R-1, ptltl: "x < 0.5 & y < 0.5"}
"""
# Steps on messages on x only
SECOND = """
format: 1
inputs:
  speed: {topic: x, type: std_msgs/msg/Float32}
  z: {topic: z, type: std_msgs/msg/Float32}
evaluation: {policy: relevant_message}
requirements:
  - {id: R-2, ptltl: "Z (speed < 0.5)"}
  - {id: R-3, ptltl: "z < 0.5"}
"""


@pytest.fixture
def bundles(tmp_path: Path) -> tuple[Path, Path]:
    return write(tmp_path, 'first', FIRST), write(tmp_path, 'second', SECOND)


def write(folder: Path, name: str, text: str) -> Path:
    path = folder / f'{name}.yaml'
    path.write_text(text, encoding='utf-8')
    return path


def listed(bundles: tuple[Path, ...]) -> str:
    return f'spec:=[{", ".join(map(str, bundles))}]'


def test_each_of_several_bundles_steps_by_its_own_rule(
    partner: Partner, bundles: tuple[Path, Path],
) -> None:
    with started('monitor', '-p', listed(bundles)) as node:
        partner.listen('R_1', 'R_2', 'R_3')
        x, y, z = (partner.publisher(Float32, name) for name in 'xyz')
        partner.wait_for_listener(x, y, z)
        assert node.output.index('bundle first: 1 requirement on 2 inputs of 2 topics, policy '
                                 'every_message, ') \
            < node.output.index('bundle second: 2 requirements on 2 inputs of 2 topics, policy '
                                'relevant_message, ') \
            < node.output.index('watching 3 requirements on 4 inputs of 3 topics in 2 bundles, ')
        y.publish(Float32(data=0.1))
        z.publish(Float32(data=0.9))
        partner.expect({'R_3': 1})
        x.publish(Float32(data=0.9))
        partner.expect({'R_3': 1, 'R_1': 1})
        # R-1 steps on messages on x and y, R-2 on x, R-3 on z.
        y.publish(Float32(data=0.2))
        x.publish(Float32(data=0.1))
        partner.expect({'R_3': 1, 'R_1': 2, 'R_2': 1})
        assert partner.reset() == 'restarted 3 step groups; input values kept'


def test_diagnostics_keep_two_bundles_on_one_topic_apart(
    partner: Partner, bundles: tuple[Path, Path], tmp_path: Path,
) -> None:
    (tmp_path / 'other').mkdir()
    third = write(tmp_path / 'other', 'first', FIRST.replace('R-1', 'R-4'))
    names: set[str] = set()

    def note(array: Any) -> None:
        names.update(item.name for item in array.status)

    partner.node.create_subscription(DiagnosticArray, '/diagnostics', note, 10)
    with started('monitor', '-p', listed((*bundles, third))):
        topics = {f'fret_monitor: topic /{name} for {bundle}' for name, bundle in (
            ('x', 'first'), ('y', 'first'), ('x', 'second'), ('z', 'second'),
            ('x', 'first 2'), ('y', 'first 2'))}
        wait_until(lambda: {name for name in names if ' topic ' in name} == topics, str(topics))


def test_the_logger_serves_several_bundles(
    partner: Partner, bundles: tuple[Path, Path],
) -> None:
    with started('logger', '-p', listed(bundles)) as logger, \
            started('monitor', '-p', listed(bundles)):
        logger.wait_for('listening for violations of 3 requirements: R-1, R-2, R-3')
        y, z = partner.publisher(Float32, 'y'), partner.publisher(Float32, 'z')
        x = partner.publisher(Float32, 'x')
        partner.wait_for_listener(x, y, z)

        def is_told() -> bool:
            for publisher in (x, y, z):
                publisher.publish(Float32(data=0.9))
            return 'R-1 violated' in logger.output and 'R-3 violated' in logger.output

        wait_until(is_told, 'lines of both bundles')


def refused(partner: Partner, **parameters: object) -> str:
    told = refusal(partner.context, **parameters)
    assert partner.node.get_node_names() == ['partner']
    return told


def error_in_c(*bundles: Path, node: str = MONITOR) -> str:
    """Return the error with which the node in C of these bundles ends."""
    specs = ', '.join(map(str, bundles))
    return ExportedNode(Path(program_of(f'[{specs}]', node=node))).error()


def test_a_handler_that_two_bundles_share_is_refused_with_both_places(
    partner: Partner, tmp_path: Path,
) -> None:
    first = write(tmp_path, 'first', FIRST)
    second = write(tmp_path, 'second', SECOND.replace('R-3', 'R_1'))
    assert refused(partner, spec=[str(first), str(second)]) == (
        f"error: 'R-1' ({first}:7:10) and 'R_1' ({second}:9:10) would both be announced on "
        'copilot/handlerpropR_1: give one of them another id')


def test_the_problems_of_all_bundles_are_reported_together(
    partner: Partner, tmp_path: Path,
) -> None:
    first = write(tmp_path, 'first', FIRST.replace('& y', '& a'))
    second = write(tmp_path, 'second', SECOND.replace('Z (speed', 'Z (b'))
    told = refused(partner, spec=[str(first), str(second), 'third.yaml'])
    assert f"{first}:7:33: error: 'a' is not declared" in told
    assert f"{second}:8:26: error: 'b' is not declared" in told
    assert "error: there is no file 'third.yaml'" in told


def test_compiled_folders_may_be_given_as_a_list(
    partner: Partner, bundles: tuple[Path, Path], tmp_path: Path,
) -> None:
    folders = [tmp_path / 'one', tmp_path / 'two']
    for bundle, folder in zip(bundles, folders):
        build.write(build.generate_monitor(build.read(bundle)), folder)
    library = f'library:=[{folders[0]}, {folders[1]}]'
    with started('monitor', '-p', library, '-p', listed(bundles)) as node:
        node.wait_for('watching 3 requirements on 4 inputs of 3 topics in 2 bundles')
    names = [str(folder) for folder in folders]
    assert 'was not compiled from' in refused(
        partner, library=names, spec=[str(bundle) for bundle in reversed(bundles)])
    assert refused(partner, library=names, spec=str(bundles[0])).startswith(
        "error: parameters 'spec' and 'library' name 1 and 2: where both are given, each")


def test_monitors_of_different_names_share_a_namespace_and_a_duplicate_is_reported(
    partner: Partner, bundles: tuple[Path, Path],
) -> None:
    with started('monitor', '-p', f'spec:={bundles[0]}') as first, \
            started('monitor', '-p', f'spec:={bundles[1]}', '-r', '__node:=other') as other:
        with started('monitor', '-p', f'spec:={bundles[1]}') as namesake:
            namesake.wait_for('there is another node /fret_monitor: both watch and announce')
            partner.listen('R_1')
            partner.listen('R_3', publishers=2)
            x, y, z = (partner.publisher(Float32, name) for name in 'xyz')
            for count, publisher in zip((3, 1, 2), (x, y, z)):
                partner.wait_for_subscriptions(count, publisher)
            x.publish(Float32(data=0.9))
            y.publish(Float32(data=0.9))
            partner.expect({'R_1': 1})
            z.publish(Float32(data=0.9))
            partner.expect({'R_1': 1, 'R_3': 2})
        assert 'there is another node' not in other.output
        assert 'Traceback' not in first.output


@dataclass
class Several(Face):
    """What a node with several bundles publishes and logs."""

    def connect(self, partner: Partner) -> None:
        """Subscribe to what it publishes."""
        make = partner.node.create_subscription
        for name in ('R_1', 'R_2', 'R_3', 'R_4'):
            make(Empty, f'/{self.name}/copilot/handlerprop{name}', partial(self._count, name),
                 RELIABLE)
        make(DiagnosticArray, f'/{self.name}/copilot/violations', self._take_detail, RELIABLE)
        report: Any = self.take_report  # rclpy gives two arguments to whoever takes two
        make(DiagnosticArray, '/diagnostics', report, 10)

    def constants(self, partner: Partner) -> list[str]:
        """Return the parameters of constants."""
        client = partner.node.create_client(
            ListParameters, f'/{self.name}/fret_monitor/list_parameters')
        answer = answer_of(client, ListParameters.Request())
        return sorted(name for name in answer.result.names if 'constants' in name)

    def steady_lines(self) -> Counter[tuple[str, str]]:
        """Return the log without what depends on when a node looks."""
        return Counter({line: n for line, n in self.plain_lines().items()
                        if line[1] != MISSING})

    def all_statuses(self) -> Counter[str]:
        """Return the last report of each bundle."""
        found = {array.status[0].name: array.status for _, array in self.reports}
        return Counter(self._shown(item) for of_bundle in found.values() for item in of_bundle)


def in_graph(partner: Partner, name: str) -> set[tuple[str, str, str]]:
    """Return what a node publishes, subscribes to, offers and calls, with the types."""
    node = partner.node
    found = {'publishes': node.get_publisher_names_and_types_by_node,
             'subscribes': node.get_subscriber_names_and_types_by_node,
             'offers': node.get_service_names_and_types_by_node,
             'calls': node.get_client_names_and_types_by_node}
    return {(verb, topic.replace(f'/{name}/', '/NODE/'), str(types))
            for verb, names in found.items()
            for topic, types in names('fret_monitor', f'/{name}')}


def test_several_bundles_in_c_do_as_those_in_python(partner: Partner, tmp_path: Path) -> None:
    (tmp_path / 'other').mkdir()
    texts = [('first', 'constants: {a: 0.5}' + FIRST),
             ('second', 'constants: {a: 0.25, b: 1.5}' + SECOND.replace(
                 'z < 0.5', 'z < b')),
             ('other/first', FIRST.replace('R-1', 'R-4'))]
    spec = listed(tuple(write(tmp_path, name, text.replace('topic: ', 'topic: /'))
                        for name, text in texts))
    program = program_of(spec.removeprefix('spec:='), '-p', 'constants.b:=2.5')
    with ExitStack() as stack:
        faces = []
        for name, more in (('python', ()), ('native', ('-p', 'native:=true'))):
            box = tmp_path / f'blackbox_{name}'
            node = stack.enter_context(started(
                'monitor', '-p', spec, *more, '-r', f'__ns:=/{name}', '-p', 'constants.b:=2.5',
                '-p', f'blackbox:={box}'))
            faces.append(Several(name, node, is_simulated=False, is_late=False, blackbox=box))
            faces[-1].connect(partner)
        assert os.readlink(f'/proc/{faces[1].process.process.pid}/exe') == program
        publishers = [partner.publisher(Float32, f'/{name}') for name in 'xyz']
        for count, publisher in zip((6, 4, 2), publishers):
            partner.wait_for_subscriptions(count, publisher)
        wait_until(lambda: in_graph(partner, 'python') == in_graph(partner, 'native'),
                   'the same names in the graph')
        assert ('publishes', '/rosout', "['rcl_interfaces/msg/Log']") in in_graph(
            partner, 'native')
        sent: Counter[str] = Counter()
        for values in ((0.1, 0.2, 9.0), (0.9, 0.2, 1.0), (0.1, 0.9, 9.0)):
            for publisher, value in zip(publishers, values):
                sent[publisher.topic_name] += 1
                publisher.publish(Float32(data=value))
                wait_until(lambda: all(
                    f'topic {publisher.topic_name} for' not in line  # noqa: B023
                    or f"('received', '{sent[publisher.topic_name]}')" in line  # noqa: B023
                    for face in faces for line in face.all_statuses()), 'the message')
        equal(lambda face: face.violations, faces, 'violations')
        assert faces[0].violations == {'R_1': 3, 'R_2': 1, 'R_3': 2, 'R_4': 3}
        equal(Face.shown_details, faces, 'details')
        equal(Several.all_statuses, faces, 'statuses')
        assert len(faces[0].all_statuses()) > 12
        assert [face.constants(partner) for face in faces] == [['constants.b']] * 2
        assert [partner.reset(f'/{face.name}/fret_monitor/reset') for face in faces] == [
            'restarted 4 step groups; input values kept'] * 2
        equal(Several.steady_lines, faces, 'lines')
        assert sum('bundle first 2:' in text for _, text in faces[1].plain_lines()) == 1
    compare_files(faces, least=8)


def test_an_exported_node_runs_several_bundles(
    partner: Partner, bundles: tuple[Path, Path],
) -> None:
    with running(exported_bundles(*bundles)) as node:
        assert node.output.index('bundle first: 1 requirement on 2 inputs of 2 topics') \
            < node.output.index('bundle second: 2 requirements on 2 inputs of 2 topics') \
            < node.output.index('watching 3 requirements on 4 inputs of 3 topics in 2 bundles')
        partner.listen('R_1', 'R_2', 'R_3')
        x, y, z = (partner.publisher(Float32, name) for name in 'xyz')
        partner.wait_for_listener(x, y, z)
        y.publish(Float32(data=0.1))
        z.publish(Float32(data=0.9))
        partner.expect({'R_3': 1})
        x.publish(Float32(data=0.9))
        partner.expect({'R_3': 1, 'R_1': 1})


def test_bundles_of_one_name_have_different_names_in_diagnostics() -> None:
    assert distinct_names(['a b', 'a b', 'a c', 'a b', 'a b 2']) == [
        'a b', 'a b 2', 'a c', 'a b 3', 'a b 2 2']


def test_one_topic_with_two_types_is_refused_with_both_bundles(
    partner: Partner, tmp_path: Path,
) -> None:
    first = write(tmp_path, 'first', FIRST)
    second = write(tmp_path, 'second', SECOND.replace('Float32', 'Float64'))
    reason = (
        "the topic /x has the type std_msgs/msg/Float32 in the bundle 'first' and "
        "std_msgs/msg/Float64 in 'second': a process can use a topic with one type only; correct "
        'the type, or start a monitor for each bundle')
    assert refused(partner, spec=[str(first), str(second)]) == f'error: {reason}'
    assert reason in error_in_c(first, second)


ACTING = """
format: 1
inputs:
  w: {topic: w, type: std_msgs/msg/Float32}
actions:
  one: {ONE}
  two: {TWO}
requirements:
  - {id: R-4, ptltl: "w < 0.5", on_violation: [one, two]}
"""
SHOW = 'publish: {topic: TOPIC, type: std_msgs/msg/Bool}'
CALL = 'call: {service: NAME, type: std_srvs/srv/KIND}'


@pytest.mark.parametrize(('one', 'two', 'reason'), [
    (SHOW.replace('TOPIC', 'x'), 'lock: {topic: stop}',
     "the topic /x has the type std_msgs/msg/Float32 in the bundle 'first' and std_msgs/msg/Bool "
     "in 'acting': a process can use a topic with one type only; correct the type, or start a "
     'monitor for each bundle'),
    (CALL.replace('NAME', 'stop').replace('KIND', 'Trigger'),
     CALL.replace('NAME', '/stop').replace('KIND', 'Empty'),
     'the service /stop has the types std_srvs/srv/Trigger and std_srvs/srv/Empty: a process can '
     'use a service with one type only; correct the type, or write different names'),
    (SHOW.replace('TOPIC', '/rosout'), 'lock: {topic: stop}',
     'the topic /rosout has the types rcl_interfaces/msg/Log and std_msgs/msg/Bool: a process can '
     'use a topic with one type only; correct the type, or write different names'),
    (CALL.replace('NAME', '/fret_monitor/get_state').replace('KIND', 'Empty'),
     'lock: {topic: stop}',
     'the service /fret_monitor/get_state has the types lifecycle_msgs/srv/GetState and '
     'std_srvs/srv/Empty: a process can use a service with one type only; correct the type, or '
     'write different names')])
def test_an_action_with_a_second_type_is_refused_with_both_types(
    partner: Partner, tmp_path: Path, one: str, two: str, reason: str,
) -> None:
    first = write(tmp_path, 'first', FIRST)
    acting = write(tmp_path, 'acting', ACTING.replace('ONE', one).replace('TWO', two))
    assert refused(partner, spec=[str(first), str(acting)]) == f'error: {reason}'
    if 'service' in reason:
        assert reason in error_in_c(first, acting)


def test_a_type_that_another_node_of_the_process_uses_is_named(
    partner: Partner, tmp_path: Path,
) -> None:
    partner.publisher(Float32, '/shown')
    acting = write(tmp_path, 'acting', ACTING.replace('ONE', SHOW.replace(
        'TOPIC', '/shown')).replace('TWO', 'lock: {topic: stop}'))
    assert refused(partner, spec=str(acting)) == (
        'error: cannot publish on /shown as std_msgs/msg/Bool: this process uses the topic with '
        'the type std_msgs/msg/Float32, and can use it with one type only')


def test_gates_with_two_types_of_one_topic_are_refused_with_both(
    partner: Partner, tmp_path: Path,
) -> None:
    gate = 'format: 1\ninputs: {{a: {{topic: {0}, type: std_msgs/msg/{3}}}}}\n' \
        'requirements: [{{id: {2}, ptltl: a < 1.0}}]\n' \
        'gates: {{{2}: {{from: {0}, to: {1}, type: std_msgs/msg/{3}, keep: [{2}], ' \
        'otherwise: drop}}}}\n'
    paths = [str(write(tmp_path, name, gate.format(*ends, name, kind))) for *ends, name, kind in (
        ('x', 'u', 'g', 'Float32'), ('u', 'w', 'h', 'Float64'))]
    reason = ("/u has the type std_msgs/msg/Float32 in the gate 'g' and std_msgs/msg/Float64 in "
              "'h': a process can use a topic with one type only; correct the type, or start a "
              'node for each gate')
    with pytest.raises(Refusal, match=reason):
        make_node(GateNode, partner.context, spec=paths)
    assert reason in error_in_c(*map(Path, paths), node=GATE)


@pytest.mark.parametrize('hot_path', ['on', 'off'])
def test_a_topic_that_the_process_uses_with_another_type_is_refused_with_both_types(
    partner: Partner, tmp_path: Path, hot_path: str,
) -> None:
    bundle = write(tmp_path, 'bundle', FIRST.replace('topic: x', 'topic: /rosout'))
    assert refused(partner, spec=str(bundle), hot_path=hot_path) == (
        "error: '/rosout' and the node's own '/rosout' are both remapped to /rosout; what the "
        'node announces needs a topic of its own')
