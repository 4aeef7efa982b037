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

"""What a running monitor announces is what `bag` finds in a recording of the same messages."""

from pathlib import Path
from random import Random
from time import sleep, time

from bag.recordings import Kept, TYPES
from bundles import write_bundle
from diagnostic_msgs.msg import DiagnosticArray
from fret_monitor.bag.check import check_recording, Selection
from fret_monitor.model.names import DETAILS_TOPIC
import pytest
from rclpy.serialization import serialize_message
from ros.harness import Partner, settle, started, wait_until
from ros.received import read_detail
from rosbags.rosbag2 import Writer
from sensor_msgs.msg import Temperature

KIND = 'sensor_msgs/msg/Temperature'
REORDER_S = 0.5
BUNDLE = f"""
format: 1
inputs:
  a: {{topic: a, type: {KIND}, field: temperature}}
  b: {{topic: b, type: {KIND}, field: temperature}}
evaluation: {{policy: timed, stamp: header, reorder: {REORDER_S}}}
requirements:
  - {{id: ORDER, ptltl: "a <= b"}}
  - {{id: SOON, ptltl: "H (a > 0.8 -> O[0, 150 ms] b > 0.5)"}}
  - {{id: HELD, ptltl: "H[0, 100 ms] a < 0.7 | O[30 ms, 60 ms] b > 0.4"}}
"""
MESSAGES = 300


def message(stamp: int, value: float) -> Temperature:
    found = Temperature(temperature=value)
    found.header.stamp.sec, found.header.stamp.nanosec = divmod(stamp, 10**9)
    return found


@pytest.mark.parametrize('hot_path', ['on', 'off'])
def test_live_and_recorded_messages_give_the_same_occurrences(
        partner: Partner, tmp_path: Path, hot_path: str) -> None:
    rng = Random(4)
    spec = write_bundle(tmp_path, BUNDLE)
    heard: list[tuple[str, bool, float]] = []

    def keep(array: DiagnosticArray) -> None:
        for status in array.status:
            detail = read_detail(status)
            heard.append((status.name.rpartition(' ')[2], detail.is_recovery, detail.stamp))

    arguments = ('-p', f'spec:={spec}', '-p', f'hot_path:={hot_path}')
    with started('monitor', *arguments), \
            Writer(tmp_path / 'bag', version=9) as writer:
        partner.node.create_subscription(DiagnosticArray, DETAILS_TOPIC, keep, 1000)
        wait_until(lambda: partner.node.count_publishers(DETAILS_TOPIC) > 0, 'details')
        publishers = {topic: partner.publisher(Temperature, topic) for topic in 'ab'}
        partner.wait_for_listener(*publishers.values())
        topics = {topic: writer.add_connection(f'/{topic}', KIND, typestore=TYPES)
                  for topic in 'ab'}
        settle(0.5)  # until the monitor has seen who wants details
        for _ in range(MESSAGES):
            topic, now = rng.choice('ab'), int(time() * 1e9)
            sent = message(now - rng.randrange(100_000_000), round(rng.random(), 3))
            publishers[topic].publish(sent)
            writer.write(topics[topic], now, serialize_message(sent))
            sleep(rng.choice([0.0, 0.005, 0.03]))
        sleep(2 * REORDER_S)  # until the last message has taken effect
        last = len(heard)
        sleep(0.2)
        assert len(heard) == last
    changes = Kept()
    result = check_recording(spec, tmp_path / 'bag', Selection(), changes=[changes])
    assert result.errors == ()
    ids = [item.id for item in result.findings]
    bag = [(ids[index], is_fulfilled, stamp / 1e9) for stamp, index, is_fulfilled in changes.found]
    assert [item[:2] for item in heard] == [item[:2] for item in bag[:len(heard)]]
    assert max(abs(one[2] - other[2]) for one, other in zip(heard, bag)) < 1e-6
    # Deadlines after the last message come in the recording only as far as its end.
    assert 0 <= len(heard) - len(bag[:len(heard)]) <= 1 and len(heard) > 50
