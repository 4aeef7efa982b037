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

"""What the monitor reports about inputs without messages, or with unusable ones."""

from pathlib import Path
from time import sleep
from types import SimpleNamespace
from typing import Any

from fret_monitor.model.manifest import Manifest, ManifestInput, ManifestRequirement, ManifestTopic
from fret_monitor.model.policies import Policy, Report, Severity
from fret_monitor.model.values import ValueType
from fret_monitor.ros.intake.feed import PublisherStatus
import pytest
from ros.harness import Partner, started, wait_until
from std_msgs.msg import Bool, String

diagnostic_msgs = pytest.importorskip('diagnostic_msgs.msg')
sensor_msgs = pytest.importorskip('sensor_msgs.msg')
health = pytest.importorskip('fret_monitor.ros.reports.health')

SCAN = """
format: 1
inputs:
  front: {topic: scan, type: sensor_msgs/msg/LaserScan, field: "ranges[180]"}
  state: {topic: state, type: std_msgs/msg/String, values: {IDLE: "idle", GO: "go"}}
  wind: {topic: windspeed, type: std_msgs/msg/Float32}
requirements:
  - {id: ROS-001, ptltl: "wind < 8.0"}
  - {id: ROS-002, ptltl: "front > 1.0 | state = GO"}
"""


def test_unusable_and_missing_values_are_reported_once(
    partner: Partner, tmp_path: Path,
) -> None:
    bundle = tmp_path / 'bundle.yaml'
    bundle.write_text(SCAN, encoding='utf-8')
    heard: list[Any] = []
    partner.node.create_subscription(
        diagnostic_msgs.DiagnosticArray, '/diagnostics', heard.append, 10)

    def told() -> dict[str, tuple[bytes, str]]:
        return {item.name.partition(': ')[2]: (item.level, item.message)
                for item in (heard[-1].status if heard else ())}

    def is_told(name: str, level: bytes, message: str) -> None:
        wait_until(lambda: told().get(name) == (level, message), f'{name}: {message}')

    with started('monitor', '-p', f'spec:={bundle}') as node:
        scan = partner.publisher(sensor_msgs.LaserScan, 'scan')
        state = partner.publisher(String, 'state')
        partner.wait_for_listener(scan, state)
        state.publish(String(data='go'))
        sleep(0.2)
        for _ in range(3):
            scan.publish(sensor_msgs.LaserScan(ranges=[2.0] * 100))
            state.publish(String(data='broken'))
        is_told('topic /scan', b'\1', 'fields cannot be used: front')
        is_told('topic /state', b'\1', 'fields cannot be used: state')
        is_told('topic /scan', b'\0', 'received')
        node.wait_for('/scan: ranges[180] cannot be read (the array has 100 elements); '
                      "input 'front' has no value yet")
        node.wait_for("/state: data is 'broken', which is not among its values in the bundle; "
                      "input 'state' keeps its value")
        node.wait_for(
            'ROS-001, ROS-002 are not evaluated yet: nothing usable received on /scan '
            "(1 publisher) for 'front'; nothing received on /windspeed (0 publishers) for 'wind'")
        scan.publish(sensor_msgs.LaserScan(ranges=[2.0] * 100))
        is_told('topic /scan', b'\1', 'fields cannot be used: front')
        sleep(6.0)
        assert node.output.count('cannot be read') == 1
        assert node.output.count('which is not among') == 1
        assert node.output.count('not evaluated yet') == 1


STOP = """
format: 1
inputs:
  estop: {topic: e_stpo, type: std_msgs/msg/Bool, initial: false}
  held: {topic: held, type: std_msgs/msg/Bool, initial: true}
requirements:
  - {id: CMD, ptltl: "!estop"}
  - {id: HELD, ptltl: held}
"""


def test_a_requirement_that_rests_on_initial_values_is_reported(
    partner: Partner, tmp_path: Path,
) -> None:
    bundle = tmp_path / 'bundle.yaml'
    bundle.write_text(STOP, encoding='utf-8')
    heard: list[Any] = []
    partner.node.create_subscription(
        diagnostic_msgs.DiagnosticArray, '/diagnostics', heard.append, 10)

    def is_told(name: str, level: bytes, message: str) -> bool:
        return any(item.name == f'fret_monitor: {name}' and (item.level, item.message)
                   == (level, message) for item in (heard[-1].status if heard else ()))

    with started('monitor', '-p', f'spec:={bundle}', '-p', 'policy:=relevant_message') as node:
        held = partner.publisher(Bool, 'held')
        partner.wait_for_listener(held)
        held.publish(Bool(data=True))
        wait_until(lambda: is_told('CMD', b'\1', 'not evaluated yet')
                   and is_told('HELD', b'\0', 'satisfied'), 'who is evaluated')
        node.wait_for('CMD is not evaluated yet: nothing received on /e_stpo (0 publishers) '
                      "for 'estop' (it has its initial value)")


def test_the_first_line_of_the_log_has_the_period(partner: Partner, tmp_path: Path) -> None:
    bundle = tmp_path / 'bundle.yaml'
    bundle.write_text(SCAN, encoding='utf-8')
    with started('monitor', '-p', f'spec:={bundle}', '-p', 'policy:=periodic',
                 '-p', 'rate:=20.0') as node:
        node.wait_for('policy periodic, 0.05 s, ')


class Values:
    """The part of an evaluator that `describe_missing` reads."""

    def __init__(self, manifest: Manifest, values: dict[int, float],
                 messages: dict[int, int] | None = None) -> None:
        self.monitor = SimpleNamespace(manifest=manifest)
        self.value = values.get
        self._messages = messages or {}

    def topic_counts(self, index: int) -> Any:
        return SimpleNamespace(messages=self._messages.get(index, 0))

    def requirement_counts(self, index: int) -> Any:
        inputs = self.monitor.manifest.requirements[index].inputs
        return SimpleNamespace(steps=int(all(self.value(place) is not None for place in inputs)))


def a_manifest(count: int) -> Manifest:
    """Return a manifest of so many requirements, each with an input and topic of its own."""
    names = [f'x{index}' for index in range(count)]
    return Manifest(
        'm', 'm', '', Policy.EVERY_MESSAGE, None,
        tuple(ManifestInput(name, ValueType.FLOAT32, name, 'any', ('data',), (), None)
              for name in names),
        tuple(ManifestTopic(name, 'std_msgs/msg/Float32', (index,), ())
              for index, name in enumerate(names)),
        (), tuple(ManifestRequirement(f'R-{index}', f'R_{index}', '', '', '', Report.EVERY_STEP,
                                      Severity.ERROR, 0, (index,)) for index in range(count)),
        0, '', '', ())


def missing(evaluator: Values, statuses: list[Any]) -> Any:
    return health.describe_missing(evaluator, statuses, lambda name: f'/{name}')


def test_nothing_is_missing_when_every_input_has_a_value() -> None:
    assert missing(Values(a_manifest(2), {0: 0.0, 1: 0.0}), [PublisherStatus()] * 2) is None


def test_only_waiting_requirements_are_reported_with_their_missing_inputs() -> None:
    assert missing(Values(a_manifest(2), {0: 0.0}), [PublisherStatus(), PublisherStatus(2)]) == (
        "R-1 is not evaluated yet: nothing received on /x1 (2 publishers) for 'x1'")


def test_an_input_that_nothing_reads_is_not_reported() -> None:
    manifest = a_manifest(3)
    read = Manifest(**{**vars(manifest), 'requirements': manifest.requirements[:2]})
    assert missing(Values(read, {0: 0.0, 1: 0.0}), [PublisherStatus()] * 3) is None
    assert '/x2' not in missing(Values(read, {0: 0.0}), [PublisherStatus()] * 3)


def test_publishers_of_another_type_do_not_count_as_publishers() -> None:
    told = missing(Values(a_manifest(1), {}), [PublisherStatus(0, (), ('std_msgs/msg/Int32',))])
    assert '(0 publishers of std_msgs/msg/Float32)' in told


def test_only_the_first_five_of_many_are_named() -> None:
    told = missing(Values(a_manifest(300), {}), [PublisherStatus()] * 300)
    assert told.startswith('R-0, R-1, R-2, R-3, R-4 and 295 more are not evaluated yet: ')
    assert told.endswith("on /x4 (0 publishers) for 'x4' and 295 more")
    assert 'x5' not in told
