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

"""Locks that are read or stay free, and actions that never end, get a warning."""

from pathlib import Path

from lint.warned import warned

ENDLESS = """
format: 1
inputs:
  speed: {topic: speed, type: std_msgs/msg/Float32}
actions:
  brake: {publish: {topic: brake, type: std_msgs/msg/Bool, rate: 10}}
on_violation: [brake]
requirements:
  - {id: SLOW, ptltl: H (speed < 1)}
"""


def test_what_is_published_until_a_reset_is_warned_of(tmp_path: Path) -> None:
    [(title, _)] = warned(tmp_path, ENDLESS)
    assert title == "'brake' is published until ~/reset"
    for old, new in (('H (speed < 1)}', 'H (speed < 1), report: occurrence}'),
                     ('rate: 10', 'rate: 10, for: 2'), ('H (speed', '(speed')):
        assert warned(tmp_path, ENDLESS.replace(old, new)) == []


LOCKED = """
format: 1
inputs:
  speed: {topic: odom, type: std_msgs/msg/Float32OPTIONS}
  other: {topic: other, type: std_msgs/msg/Float32}
actions:
  stop: {lock: {topic: e_stop}}
  tell: {publish: {topic: told, type: std_msgs/msg/Bool}}
requirements:
  - {id: SLOW, ptltl: speed < 1, on_violation: [tell, stop]}
  - {id: OTHER, ptltl: other < 1, on_violation: [tell]}
"""


def test_a_lock_whose_input_is_never_silent_is_warned_of(tmp_path: Path) -> None:
    assert warned(tmp_path, LOCKED.replace('OPTIONS', '')) == [
        ("the lock 'stop' stays free if 'speed' falls silent", 'timeout: 0.5')]
    assert warned(tmp_path, LOCKED.replace('OPTIONS', ', timeout: 0.5')) == []


def test_a_lock_that_its_requirement_reads_is_warned_of(tmp_path: Path) -> None:
    text = LOCKED.replace('OPTIONS', ', timeout: 0.5').replace('other < 1, on_violation: [tell]', (
        'other, on_violation: [stop]')).replace(
        'topic: other, type: std_msgs/msg/Float32', (
            'topic: /e_stop, type: std_msgs/msg/Bool, timeout: 0.5'))
    assert warned(tmp_path, text) == [
        ("OTHER reads the topic of its lock 'stop'", 'choose another topic')]
