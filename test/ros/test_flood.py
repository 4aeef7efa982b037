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

"""In a flood: the announced times are those of `bag` on the node's recording, in nanoseconds."""

import csv
from pathlib import Path
from random import Random
from time import monotonic, sleep

from bundles import write_bundle
from diagnostic_msgs.msg import DiagnosticArray
from fret_monitor.cli.main import main
from fret_monitor.model.names import DETAILS_TOPIC
import pytest
from ros.exported import monitoring
from ros.harness import Partner, RELIABLE, wait_until
from ros.received import read_detail
from std_msgs.msg import Bool, Float32
from strategies import thorough

BUNDLE = """
format: 1
evaluation: {policy: timed, unit: 1}
inputs:
  x: {topic: /x, type: std_msgs/msg/Bool}
  y: {topic: /y, type: std_msgs/msg/Bool}
  z: {topic: /z, type: std_msgs/msg/Float32}
requirements:
  - {id: ANSWER, ptltl: "H (O[0, 9 ms] (y | z > 2))", report: occurrence}
  - {id: EDGE, ptltl: "H (!(x & Y !x) | y)", report: occurrence}
  - {id: AFTER, ptltl: "H (!(Y (x & Y !x)) | y)", report: occurrence}
"""
TOPICS = {'/x': Bool, '/y': Bool, '/z': Float32}
FLOOD_S = 3.0


def flood(partner: Partner, rng: Random) -> None:
    """Publish as many messages as this process can, with pauses; all details are published."""
    publishers = [partner.publisher(kind, topic) for topic, kind in TOPICS.items()]
    for publisher in publishers:
        wait_until(lambda: publisher.get_subscription_count() == 1,  # noqa: B023
                   publisher.topic_name)
    x, y, z = publishers
    edge = monotonic()
    end = edge + FLOOD_S
    while monotonic() < end:
        for _ in range(rng.randrange(1, 20)):
            is_edge = monotonic() > edge
            edge += rng.uniform(0.02, 0.06) if is_edge else 0.0
            x.publish(Bool(data=is_edge))
            y.publish(Bool(data=rng.random() < 0.003))
            z.publish(Float32(data=rng.random() * 2.003))
        sleep(rng.choice([0.0, 0.0, 0.001, 0.01]))


def recorded(bundle: Path, box: Path) -> set[tuple[str, int]]:
    """Return when `bag` finds each requirement violated anew."""
    table = box.parent / 'changes.csv'
    file, = box.iterdir()
    assert main(['bag', str(bundle), str(file), '--csv', str(table)]) == 0
    with table.open(encoding='utf-8') as lines:
        rows = list(csv.DictReader(lines))
    times = [int(row.pop('time').replace('.', '')) for row in rows]
    return {(name, time) for time, before, row in zip(times[1:], rows, rows[1:])
            for name in row if before[name] != row[name] == '0'}


@thorough
@pytest.mark.parametrize('name', ['rcl', 'on', 'off'])
def test_announced_times_are_those_of_the_recording(
    partner: Partner, tmp_path: Path, name: str,
) -> None:
    path, box = write_bundle(tmp_path, BUNDLE), tmp_path / 'box'
    found: set[tuple[str, int]] = set()

    def hear(array: DiagnosticArray) -> None:
        for status in array.status:
            detail = read_detail(status)
            assert detail.suppressed == 0
            if not detail.is_recovery:
                found.add((status.name, int(status.values[1].value.replace('.', ''))))

    options = ('-p', f'blackbox:={box}', '-p', 'blackbox_seconds:=30.0')
    with monitoring(name, path, *options) as node:
        details = partner.node.create_subscription(
            DiagnosticArray, f'/{DETAILS_TOPIC}', hear, RELIABLE)
        wait_until(lambda: details.get_publisher_count() == 1, 'details')
        flood(partner, Random(name))
        node.wait_for('the last messages are in')
        sleep(0.5)
    assert len(found) > 60
    assert found == recorded(path, box)
