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

"""Gates that may stay closed, stay open or replace nothing get a warning."""

from pathlib import Path

from lint.warned import warned

BUNDLE = """
format: 1
evaluation: {policy: relevant_message}
inputs:
  speed: {topic: raw, type: std_msgs/msg/Float32}
  front: {topic: front, type: std_msgs/msg/Float32OPTIONS}
requirements:
  - {id: SLOW, ptltl: speed <= 0 | front >= 1}
gates:
  drive: {from: raw, to: out, type: std_msgs/msg/Float32, keep: [SLOW],
          otherwise: {substitute: {data: 0}}}
"""


def warnings(folder: Path, *changes: tuple[str, str]) -> list[tuple[str, str]]:
    """Return the titles and the advice of the warnings about a changed bundle."""
    text = BUNDLE
    for old, new in changes:
        text = text.replace(old, new)
    return warned(folder, text.replace('OPTIONS', ', timeout: 0.5'))


def test_gates_are_warned_of(tmp_path: Path) -> None:
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
    def of(formula: str, service: str = 'arm') -> list[tuple[str, str]]:
        return warned(tmp_path, SERVICE.replace('FORMULA', formula).replace(
            'arm/_service', f'{service}/_service'))

    assert of('data -> is_safe') == []
    assert of('is_safe') == [("the gate 'enable' keeps nothing that reads the request",
                              'read data in one of its requirements')]
    assert of('data -> is_safe', 'amr')[-1] == (
        "no input has the topic 'arm/_service_event'", "did you mean 'amr/_service_event'?")
