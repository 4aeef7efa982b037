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


"""Gates of a bundle with listed keys on both nodes: one for each key, which judges by itself."""

from collections.abc import Iterator
from contextlib import contextmanager, ExitStack
from functools import partial
from pathlib import Path
from random import Random
from typing import Any

from bundles import write_bundle
from diagnostic_msgs.msg import DiagnosticArray
from ros.exported import exported_gates, running
from ros.harness import LATCHED, Partner, RELIABLE, started, wait_until
from std_msgs.msg import Bool, Empty, Float32

FLEET = """
format: 1
for_each: {robot: [alpha, beta]}
inputs:
  speed: {topic: "/{robot}/raw", type: std_msgs/msg/Float32}
  near: {topic: "/{robot}/near", type: std_msgs/msg/Bool, timeout: 1000}
  limit: {topic: /limit, type: std_msgs/msg/Float32, timeout: 1000}
requirements:
  - {id: SLOW, ptltl: "H (near -> speed <= limit)", report: occurrence}
  - {id: FEW, ptltl: "count(robot: near) <= 1"}
gates:
  drive:
    from: "/{robot}/raw"
    to: "{robot}/cmd"
    type: std_msgs/msg/Float32
    keep: [SLOW]
    otherwise: {substitute: {data: 0.25}}
"""
ROBOTS = ('alpha', 'beta')
SUBSTITUTE = 0.25


class Face:
    """The gates of one node: what they send, announce and count."""

    def __init__(self, name: str, partner: Partner) -> None:
        self.name = name
        self.sent: dict[str, list[float]] = {robot: [] for robot in ROBOTS}
        self.announced = dict.fromkeys(ROBOTS, 0)
        self.violations: list[str] = []
        self._values: dict[str, dict[str, str]] = {}
        make = partner.node.create_subscription
        for robot in ROBOTS:
            make(Float32, f'/{name}/{robot}/cmd', partial(self._receive, robot), RELIABLE)
            make(Empty, f'/{name}/copilot/handlerpropSLOW_{robot}',
                 partial(self._announce, robot), RELIABLE)
        make(DiagnosticArray, f'/{name}/copilot/violations', self._take, RELIABLE)
        make(DiagnosticArray, '/diagnostics', self._report, 10)

    def _receive(self, robot: str, message: Any) -> None:
        self.sent[robot].append(message.data)

    def _announce(self, robot: str, _: Empty) -> None:
        self.announced[robot] += 1

    def _take(self, array: DiagnosticArray) -> None:
        self.violations += [item.name for item in array.status]

    def _report(self, array: DiagnosticArray) -> None:
        if array.status[0].name.startswith(f'{self.name}/'):
            self._values |= {item.name.partition(': ')[2]: {
                value.key: value.value for value in item.values} for item in array.status}

    def count(self, status: str, *keys: str) -> int:
        """Return the sum of values of a status."""
        return sum(int(self._values[status][key]) for key in keys)

    def has_received(self, topic: str, n: int) -> bool:
        """Whether each gate that reads a topic has received so many of its messages."""
        counts = [int(values['received']) for name, values in self._values.items()
                  if name.startswith(f'topic {topic} for')]
        return counts == [n] * (2 if topic == '/limit' else 1)

    def counts(self) -> tuple[dict[str, list[float]], dict[str, int]]:
        """Return what was sent and announced."""
        return self.sent, self.announced

    def has_judged(self, robot: str, n: int) -> bool:
        return self.count(f'gate drive_{robot}', 'passed', 'withheld') == n


@contextmanager
def both(bundle: Path, partner: Partner) -> Iterator[tuple[Face, Face]]:
    faces = (Face('python', partner), Face('native', partner))
    program = exported_gates(bundle, *(f'drive_{robot}' for robot in ROBOTS))
    with ExitStack() as held:
        held.enter_context(started('gate', '-p', f'spec:={bundle}', '-r', '__ns:=/python'))
        held.enter_context(running(program, '-r', '__ns:=/native'))
        yield faces


def test_a_gate_of_each_robot_passes_what_satisfies_its_own_requirement(
        partner: Partner, tmp_path: Path) -> None:
    rng = Random(11)
    topics = [f'/{robot}/{name}' for robot in ROBOTS for name in ('raw', 'near')]
    kinds = {'raw': Float32, 'near': Bool, 'limit': Float32}
    publishers = {topic: partner.publisher(kinds[topic.rpartition('/')[2]], topic, LATCHED)
                  for topic in (*topics, '/limit')}
    expected: dict[str, list[float]] = {robot: [] for robot in ROBOTS}
    withheld = dict.fromkeys(ROBOTS, 0)
    with both(write_bundle(tmp_path, FLEET), partner) as faces:
        for part in range(3):
            near = {'alpha': part != 1, 'beta': part == 1}
            limit = rng.choice((0.75, 1.5))
            publishers['/limit'].publish(Float32(data=limit))
            for robot in ROBOTS:
                publishers[f'/{robot}/near'].publish(Bool(data=near[robot]))
            for face in faces:
                for topic in ('/limit', '/alpha/near', '/beta/near'):
                    wait_until(partial(face.has_received, topic, part + 1),
                               f'{topic} at {face.name}')
            # The last one passes: no message of another topic violates.
            for value in (*rng.choices((0.5, 1.0, 2.0), k=6), 0.5):
                for robot in ROBOTS:
                    publishers[f'/{robot}/raw'].publish(Float32(data=value))
                    passes = not near[robot] or value <= limit
                    expected[robot].append(value if passes else SUBSTITUTE)
                    withheld[robot] += not passes
            for face in faces:
                for robot in ROBOTS:
                    wait_until(partial(face.has_judged, robot, 7 * (part + 1)),
                               f'{robot} is judged at {face.name}')
        for face in faces:
            wait_until(lambda: face.counts() == (expected, withheld),  # noqa: B023
                       f'what the gates of {face.name} send and announce: {expected, withheld}')
            wait_until(lambda: len(face.violations) >= sum(withheld.values()),  # noqa: B023
                       f'details of {face.name}')
            assert set(face.violations) == {'SLOW[robot=alpha]', 'SLOW[robot=beta]'}
    assert all(withheld.values())
