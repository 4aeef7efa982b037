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

"""Margins that the nodes publish, and show with violations, are those of `simulate`."""

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from bundles import write_bundle
from diagnostic_msgs.msg import DiagnosticArray
from fret_monitor.cli.main import main
from fret_monitor.model.parts import NodePart
from fret_monitor.native import words
from fret_monitor.ros.nodes.gate_node import GateNode
import pytest
from ros.exported import exported_bundle, ExportedNode, start
from ros.harness import LATCHED, NodeProcess, Partner, refusal, RELIABLE, started, wait_until
from ros.test_native_start import program_of
from std_msgs.msg import Float64

BUNDLE = """
format: 1
inputs:
  current: {topic: /current, type: std_msgs/msg/Float64, scale: 5}
requirements:
  - {id: SOFAR, ptltl: "H (current < 20)", report: occurrence}
  - {id: LATELY, ptltl: "O[0,1] (current < 12)"}
  - {id: NOW, ptltl: "current < 20 & current > 1"}
"""
IDS = ('SOFAR', 'LATELY', 'NOW')
CURRENTS = (10.0, 18.5, 16.0, 24.0, 25.5, 20.5, 13.0, 11.0, 21.0, 22.5, 4.0)
ENDED = [
    # The second violation of SOFAR is the lesser one; its margin stays that of the first.
    ('SOFAR', 6, '-1.1', '-5.5', 'current < 20.0'), ('NOW', 6, '-1.1', '-5.5', 'current < 20.0'),
    ('LATELY', 7, '-2.4', '-12.0', 'current < 12.0'),
    ('SOFAR', 10, '-0.5', '-2.5', 'current < 20.0'),
    ('LATELY', 10, '-1.8', '-9.0', 'current < 12.0'),
    ('NOW', 10, '-0.5', '-2.5', 'current < 20.0')]


@dataclass
class Face:
    """What one node publishes and logs."""

    name: str
    process: NodeProcess
    ids: tuple[str, ...] = IDS
    margins: defaultdict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    ended: list[tuple[str, int, str, str, str]] = field(default_factory=list)
    begun: list[tuple[str, str]] = field(default_factory=list)  # stamp, and decided at
    health: dict[str, list[tuple[str, str]]] = field(default_factory=dict)

    def listen(self, partner: Partner) -> Callable[[], bool]:
        """Subscribe; return whether all is advertised."""
        make, prefix = partner.node.create_subscription, f'/{self.name}/copilot'
        made = [make(DiagnosticArray, f'{prefix}/violations', self._take_detail, RELIABLE), *(
            make(Float64, f'{prefix}/margin/{name}', partial(self._take, name), LATCHED)
            for name in self.ids)]
        make(DiagnosticArray, '/diagnostics', self._take_health, RELIABLE)
        return lambda: all(item.get_publisher_count() == 1 for item in made)

    def _take(self, name: str, message: Float64) -> None:
        self.margins[name].append(message.data)

    def _take_detail(self, array: DiagnosticArray) -> None:
        for status in array.status:
            values = {item.key: item.value for item in status.values}
            if status.level == status.OK:
                self.ended.append((
                    status.name, int(values['step']), values['least margin'],
                    values['deciding distance'], values['deciding comparison']))
            elif status.name != 'MOST':  # which is still violated at a later step
                self.begun.append((values['stamp'], values['decided at']))

    def _take_health(self, array: DiagnosticArray) -> None:
        self.health |= {status.name.removeprefix(f'{self.name}/fret_monitor: '): [
            (item.key, item.value) for item in status.values
            if item.key.startswith('margin') or item.key == 'verdict']
            for status in array.status if status.name.startswith(f'{self.name}/')}

    def shows(self, margins: Sequence[float]) -> bool:
        """Whether the last message of each requirement has its margin."""
        return all(self.margins[name][-1:] == [found] for name, found in zip(self.ids, margins))


def simulated(bundle: Path) -> list[list[float]]:
    """Return the margins of each step, of the requirements in order."""
    trace, found = bundle.with_name('trace.csv'), bundle.with_name('margins.csv')
    trace.write_text('\n'.join(['current', *map(str, CURRENTS)]) + '\n')
    assert main(['simulate', str(bundle), '--trace', str(trace), '--margins', str(found)]) == 0
    rows = [line.split(',') for line in found.read_text().splitlines()[1:]]
    values = [float(row[2]) for row in rows]
    assert [row[1] for row in rows[:3]] == list(IDS)
    return [values[k:k + 3] for k in range(0, len(values), 3)]


def changes(values: Sequence[float]) -> list[float]:
    """Return the values without repetitions."""
    return [value for k, value in enumerate(values) if k == 0 or value != values[k - 1]]


def test_both_nodes_publish_the_margins_of_simulate_and_say_how_far_violations_went(
    partner: Partner, tmp_path: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    bundle = write_bundle(tmp_path, BUNDLE)
    expected = simulated(bundle)
    capsys.readouterr()
    native = ExportedNode(Path(program_of(bundle, '-p', 'margins:=true')),
                          '-r', '__ns:=/native', '-p', 'margins:=true')
    try:
        with started('monitor', '-p', f'spec:={bundle}', '-p', 'margins:=true',
                     '-r', '__ns:=/python') as node:
            faces = [Face('python', node), Face('native', native)]
            are_advertised = [face.listen(partner) for face in faces]
            wait_until(lambda: all(is_ready() for is_ready in are_advertised), 'publishers')
            publisher = partner.publisher(Float64, '/current')
            partner.wait_for_subscriptions(2, publisher)
            for current, margins in zip(CURRENTS, expected):
                publisher.publish(Float64(data=current))
                for face in faces:
                    wait_until(lambda: face.shows(margins),  # noqa: B023
                               f'{face.name}: {margins}')
            for face in faces:
                assert dict(face.margins) == {name: changes([row[place] for row in expected])
                                              for place, name in enumerate(IDS)}
                wait_until(lambda: len(face.ended) == len(ENDED), 'ends')  # noqa: B023
                assert face.ended == ENDED
                line = '[step 10, margin -0.5 by current < 20.0 (-2.5): current = 4.0]'
                wait_until(lambda: line in face.process.output, line)  # noqa: B023
    finally:
        native.kill()


def test_peaks_between_two_messages_are_not_lost(partner: Partner, tmp_path: Path) -> None:
    bundle = write_bundle(tmp_path, BUNDLE)
    with started('monitor', '-p', f'spec:={bundle}', '-p', 'margins:=true',
                 '-r', '__ns:=/python') as node:
        face = Face('python', node)
        is_advertised = face.listen(partner)
        wait_until(is_advertised, 'publishers')
        publisher = partner.publisher(Float64, '/current')
        partner.wait_for_subscriptions(1, publisher)
        for number in range(1, 6):
            for current in (15.0, 19.5, 15.0):
                publisher.publish(Float64(data=current))
            wait_until(lambda: face.margins['NOW'].count(0.1) == number  # noqa: B023
                       and face.margins['NOW'][-1] == 1.0, 'the peak, and the present margin')
        partner.reset('/python/fret_monitor/reset')
        wait_until(lambda: str(face.margins['NOW'][-1]) == 'nan', 'not known')


FOR_EACH = """
format: 1
for_each: {robot: {most: 3}}
inputs:
  current: {topic: "/{robot}/current", type: std_msgs/msg/Float64}
requirements:
  - {id: SOFAR, ptltl: "H (current < 20)", report: occurrence}
  - {id: MOST, ptltl: "max(robot: current) < 22"}
  - {id: NOW, ptltl: "current < 20"}
"""
SENT = [('alpha', 10.0), ('beta', 18.0), ('alpha', 24.0), ('beta', 21.0), ('alpha', 12.0),
        ('beta', 15.0)]
ENDED_OF_KEYS = [
    (f'{name}[robot={key}]', step, margin, margin, 'current < 20.0')
    for key, step, margin in (('alpha', 2, '-4.0'), ('beta', 2, '-1.0'))
    for name in ('SOFAR', 'NOW')]


def least_of_all(bundle: Path) -> list[list[float]]:
    """Return the margins after each message, of all robots the least."""
    trace, table = bundle.with_name('trace.csv'), bundle.with_name('margins.csv')
    trace.write_text('\n'.join(['robot,current', *(f'{key},{x}' for key, x in SENT)]) + '\n')
    assert main(['simulate', str(bundle), '--trace', str(trace), '--margins', str(table)]) == 0
    present: dict[tuple[str, str], float] = {}
    found: list[list[float]] = []
    rows = [line.split(',') for line in table.read_text().splitlines()[1:]]
    for number, _ in enumerate(SENT):
        present |= {(row[2], '' if row[2] == 'MOST' else row[1]): float(row[3])
                    for row in rows if row[0] == str(number)}
        found.append([min(value for (item, _), value in present.items() if item == name)
                      for name in ('SOFAR', 'MOST', 'NOW')])
    return found


def test_of_instances_compiled_and_exported_nodes_publish_the_least_margin_and_name_the_key(
    partner: Partner, tmp_path: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    bundle = write_bundle(tmp_path, FOR_EACH)
    expected = least_of_all(bundle)
    assert [row[2] for row in expected] == [10.0, 2.0, -4.0, -4.0, -1.0, 5.0]
    capsys.readouterr()
    ids, folder = ('SOFAR', 'MOST', 'NOW'), tmp_path / 'compiled'
    assert main(['compile', str(bundle), '--output', str(folder), '--margins']) == 0
    native = ExportedNode(exported_bundle(bundle, margins=True),
                          '-r', '__ns:=/native', '-p', 'margins:=true')
    try:
        with started('monitor', '-p', f'library:={folder}', '-p', 'margins:=true',
                     '-r', '__ns:=/python') as node:
            faces = [Face('python', node, ids), Face('native', native, ids)]
            are_advertised = [face.listen(partner) for face in faces]
            wait_until(lambda: all(is_ready() for is_ready in are_advertised), 'publishers')
            publishers = {key: partner.publisher(Float64, f'/{key}/current')
                          for key in ('alpha', 'beta')}
            partner.wait_for_subscriptions(2, *publishers.values())
            for (key, current), margins in zip(SENT, expected):
                publishers[key].publish(Float64(data=current))
                for face in faces:
                    wait_until(lambda: face.shows(margins),  # noqa: B023
                               f'{face.name}: {margins}')
            for face in faces:
                assert dict(face.margins) == {name: changes([row[place] for row in expected])
                                              for place, name in enumerate(ids)}
                wait_until(lambda: len(face.ended) == 5, 'ends')  # noqa: B023
                assert [item for item in face.ended if item[0] != 'MOST'] == ENDED_OF_KEYS
                assert len(face.begun) == 4 and all(at == stamp for stamp, at in face.begun)
                wait_until(lambda: face.health.get('NOW') == [  # noqa: B023
                    ('margin', '5.0'), ('margin by', 'current < 20.0 (5.0)'),
                    ('margin of', 'robot=beta')], 'the margin of NOW in /diagnostics')
                assert face.health['SOFAR'] == [
                    ('verdict', 'false'), ('margin', '-4.0'),
                    ('margin by', 'current < 20.0 (-4.0)'), ('margin of', 'robot=alpha')]
                assert face.health['MOST'] == [
                    ('margin', '7.0'), ('margin by', 'max(robot: current) < 22.0 (7.0)')]
                line = '[step 2, margin -1.0 by current < 20.0 (-1.0): current = 15.0]'
                wait_until(lambda: line in face.process.output, line)  # noqa: B023
    finally:
        native.kill()


GATED = """
format: 1
inputs:
  current: {topic: current, type: std_msgs/msg/Float64}
gates: {safe: {from: current, to: safe, type: std_msgs/msg/Float64, keep: [NOW]}}
requirements: [{id: NOW, ptltl: "current < 20"}]
"""


def test_margins_are_refused_where_there_are_none(
    partner: Partner, tmp_path: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    bundle = write_bundle(tmp_path, BUNDLE)
    assert main(['compile', str(bundle), '--output', str(tmp_path / 'out')]) == 0
    assert words.NO_MARGINS in refusal(
        partner.context, margins=True, library=tmp_path / 'out')
    wanted = '-p', 'margins:=true'
    assert words.NO_MARGINS in start('rcl', bundle, *wanted).error()
    keyed = write_bundle(tmp_path, FOR_EACH, 'keyed.yaml')
    assert words.NO_MARGINS in start('rcl', keyed, *wanted).error()
    gated = write_bundle(tmp_path, GATED, 'gated.yaml')
    assert words.NO_MARGINS_OF_GATES in refusal(
        partner.context, kind=GateNode, margins=True, spec=gated)
    assert words.NO_MARGINS_OF_GATES in ExportedNode(
        exported_bundle(gated, NodePart('safe')), *wanted).error()
    assert "'margins' is 3, and has to be true or false" in refusal(
        partner.context, spec=bundle, margins=3)
