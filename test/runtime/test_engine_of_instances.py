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

"""The engine of a bundle with instances, when the time goes back."""

from pathlib import Path
import struct

from fret_monitor.runtime.engine import Engine
from fret_monitor.runtime.scopes import Scopes
from fret_monitor.start import start

BUNDLE = """format: 1
evaluation: {policy: timed}
for_each:
  robot: [a, b]
inputs:
  x: {topic: t, type: sensor_msgs/msg/Temperature, where: "header.frame_id = {robot}",
      field: temperature, initial: 0}
  y: {topic: y, type: std_msgs/msg/Int32, initial: 0}
requirements:
  - {id: ROBOT, ptltl: "O[0,1 s] x > 0"}
  - {id: FLEET, ptltl: "count(robot: x > 0) >= 0 & y < 5"}
"""
SECOND = 10**9


def of_robot(robot: str, value: float) -> bytes:
    text = struct.pack('<iII', 0, 0, len(robot) + 1) + robot.encode() + b'\0'
    return b'\0\1\0\0' + text + bytes(-len(text) % 8) + struct.pack('<dd', value, 0.0)


def of_all(value: int) -> bytes:
    return struct.pack('<4si', b'\0\1\0\0', value)


def test_a_violation_of_a_time_that_is_over_holds_no_lock(tmp_path: Path) -> None:
    """The message comes as something of `a` is due, and waits for what is due to be over."""
    bundle = tmp_path / 'bundle.yaml'
    bundle.write_text(BUNDLE, encoding='utf-8')
    monitor = start(bundle, takes_instances=True).monitor
    topics = {topic.name: number for number, topic in enumerate(monitor.manifest.topics)}
    scopes = Scopes(monitor, is_of_engine=True)
    engine = Engine(scopes.evaluator(), scopes=scopes)
    engine.follow_states()
    engine.advance(SECOND)
    for message, at in ((of_robot('a', 1.0), 2 * SECOND), (of_robot('b', 1.0), 2 * SECOND + 7),
                        (of_robot('a', -1.0), 3 * SECOND)):
        engine.message(topics['t'], message, at)
    engine.take(0)
    engine.message(topics['y'], of_all(10), 4 * SECOND)
    engine.message(topics['y'], of_all(0), 5 * SECOND // 2)
    assert [item.stamp for item in engine.take(0)] == [4 * SECOND]
    assert [item.state.name for item in engine.states(0, 0)[1]] == ['UNKNOWN'] * 2
    for number, robot in enumerate('ab'):
        engine.message(topics['t'], of_robot(robot, 1.0), 13 * SECOND // 5 + number)
    engine.advance(3 * SECOND)
    assert [item.state.name for item in engine.states(0, 0)[1]] == ['HOLDS'] * 2
    engine.close()
