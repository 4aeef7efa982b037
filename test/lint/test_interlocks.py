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

"""Gates that may stay closed, stay open or replace nothing; locks that are read or stay free."""

from pathlib import Path

from fret_monitor.build import read

BUNDLE = """
format: 1
evaluation: {policy: relevant_message}
inputs:
  speed: {topic: raw, type: std_msgs/msg/Float32}
  front: {topic: front, type: std_msgs/msg/Float32OPTIONS}
actions:
  stop: {lock: {topic: e_stop}}
requirements:
  - {id: SLOW, ptltl: speed <= 0 | front >= 1, on_violation: [stop]}
gates:
  drive: {from: raw, to: out, type: std_msgs/msg/Float32, keep: [SLOW],
          otherwise: {substitute: {data: 0}}}
"""


def warnings(folder: Path, *changes: tuple[str, str]) -> list[tuple[str, str]]:
    """Return the titles and the advice of the warnings about a changed bundle."""
    text = BUNDLE
    for old, new in changes:
        text = text.replace(old, new)
    path = folder / 'bundle.yaml'
    path.write_text(text.replace('OPTIONS', ', timeout: 0.5'), encoding='utf-8')
    return [(item.title, item.help) for item in read(path).warnings]


def test_gates_and_locks_are_warned_of(tmp_path: Path) -> None:
    assert warnings(tmp_path) == []
    assert warnings(tmp_path, ('OPTIONS', '')) == [
        ("the gate 'drive' stays open if 'front' falls silent", 'timeout: 0.5')]
    assert ("no input has the topic 'rw'", "did you mean 'raw'?") in warnings(
        tmp_path, ('from: raw', 'from: rw'))
    assert warnings(tmp_path, ('topic: front', 'topic: /out'))[0] == (
        "the gate 'drive' reads its own output with 'front'", 'topic: raw')
    assert warnings(tmp_path, ('{data: 0}', '{}'))[0][0] == (
        "the substitute of the gate 'drive' names no field")
    assert warnings(tmp_path, ('{data: 0}', '{data: .nan}')) == [
        ("'.nan' is no finite number", 'data: 0.0')]
    assert warnings(tmp_path, ('Float32OPTIONS', 'BoolOPTIONS'), ('front >= 1', '!front'),
                    ('topic: front', 'topic: /e_stop')) == [
        ("SLOW reads the lock 'stop' that it closes", 'choose another topic')]


SERVICE = """
format: 1
evaluation: {policy: relevant_message}
inputs:
  data: {topic: arm/_service_event, type: std_srvs/srv/SetBool_Event, field: "request[0].data"}
  is_safe: {topic: is_safe, type: std_msgs/msg/Bool, timeout: 1}
requirements:
  - {id: ARMED, ptltl: FORMULA}
gates:
  enable: {service: arm, to: arm_raw, type: std_srvs/srv/SetBool, keep: [ARMED],
           otherwise: {respond: {success: false}}}
"""


def test_a_gate_on_a_service_that_reads_nothing_of_the_request_is_warned_of(
        tmp_path: Path) -> None:
    path = tmp_path / 'bundle.yaml'
    found = []
    for formula, topic in (('data -> is_safe', 'arm'), ('is_safe', 'arm'),
                           ('data -> is_safe', 'amr')):
        path.write_text(SERVICE.replace('FORMULA', formula).replace(
            'arm/_service', f'{topic}/_service'), encoding='utf-8')
        found.append([(item.title, item.help) for item in read(path).warnings])
    assert found[0] == []
    assert found[1] == [("the gate 'enable' keeps nothing that reads the request",
                         'read data in one of its requirements')]
    assert found[2][-1] == ("no input has the topic 'arm/_service_event'",
                            "did you mean 'amr/_service_event'?")


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
    path = tmp_path / 'bundle.yaml'
    found = []
    for old, new in (('', ''), ('H (speed < 1)}', 'H (speed < 1), report: occurrence}'),
                     ('rate: 10', 'rate: 10, for: 2'), ('H (speed', '(speed')):
        path.write_text(ENDLESS.replace(old, new) if old else ENDLESS, encoding='utf-8')
        found.append([item.title for item in read(path).warnings])
    assert found == [["'brake' is published until ~/reset"], [], [], []]


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
    path = tmp_path / 'bundle.yaml'
    found = []
    for options in ('', ', timeout: 0.5'):
        path.write_text(LOCKED.replace('OPTIONS', options), encoding='utf-8')
        found.append([(item.title, item.help) for item in read(path).warnings])
    assert found == [[("the lock 'stop' stays free if 'speed' falls silent", 'timeout: 0.5')], []]
