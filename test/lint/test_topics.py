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

"""Bundles that `check` accepts, and the node refuses."""

from pathlib import Path

from fret_monitor.build import read


def warnings(folder: Path, inputs: str, formula: str = 'x > y') -> list[str]:
    path = folder / 'bundle.yaml'
    path.write_text(f'format: 1\ninputs:\n{inputs}requirements:\n'
                    f'  - {{id: R, ptltl: {formula}}}\n', encoding='utf-8')
    return [item.render().partition('bundle.yaml:')[2] for item in read(path).warnings]


def test_two_names_of_one_topic_in_the_root_namespace(tmp_path: Path) -> None:
    found, = warnings(tmp_path, """\
  x: {topic: odom, type: std_msgs/msg/Float32}
  y: {topic: /odom, type: std_msgs/msg/Float32}
  z: {topic: /odom, type: std_msgs/msg/Float32}
""")
    assert found.startswith("4:14: warning: 'odom' and '/odom' are one topic in the root namespac")
    assert found.endswith('= help: topic: odom')


def test_an_input_without_a_topic_beside_others(tmp_path: Path) -> None:
    inputs = """\
  x: {topic: odom, type: std_msgs/msg/Float32}
  y: {type: float32}
"""
    found, = warnings(tmp_path, inputs)
    assert found.startswith("4:3: warning: the input 'y' has no topic")
    assert 'a monitor on ROS 2 refuses this bundle' in found
    assert warnings(tmp_path, inputs, 'x > 0') == []  # nothing reads y
    assert warnings(tmp_path, '  x: {type: float32}\n  y: {type: float32}\n') == []
