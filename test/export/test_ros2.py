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

"""The package that `export --to ros2` writes; `test/ros/test_exported_node.py` runs its node."""

from pathlib import Path
import re
from xml.etree import ElementTree

from fret_monitor.build import generate_monitor, GeneratedMonitor, read
from fret_monitor.export.content import HandlerArguments, Options
from fret_monitor.export.folder import assemble
from fret_monitor.export.ros2 import package_name, ros2
from fret_monitor.model.diagnostics import CompileError
import pytest

BUNDLE = """
format: 1
component: '"?\\\\%s'
inputs:
  "a.b": {topic: a, type: std_msgs/msg/Float32, timeout: 0.25, stale: violate}
  n: {topic: /far/n, type: geometry_msgs/msg/Vector3, field: x, qos: {depth: 3,
      reliability: best_effort}}
  stamp: {topic: s, type: std_msgs/msg/UInt64, values: {MOST: 18446744073709551615}}
  goal: {topic: g, type: test_msgs/action/Fibonacci_FeedbackMessage, field: len(feedback.sequence)}
requirements:
  - {id: '010 "x"', title: "*/ %n @PACKAGE@ ü", ptltl: "a.b < 0.5"}
  - {id: TWO, ptltl: "n < 1.0 & stamp = 1 & goal < 3", severity: warn, report: onset}
"""


def generated(folder: Path, text: str = BUNDLE, name: str = 'node.yaml') -> GeneratedMonitor:
    path = folder / name
    path.write_text(text, encoding='utf-8')
    return generate_monitor(read(path))


def files_of(monitor: GeneratedMonitor) -> dict[str, str]:
    return assemble('ros2', monitor, Options(), ros2(monitor, Options()))


def test_the_package_names_what_it_needs_and_builds_every_source(tmp_path: Path) -> None:
    pytest.importorskip('test_msgs.action')
    files = files_of(generated(tmp_path))
    package = ElementTree.fromstring(files['package.xml'])
    assert package.findtext('name') == 'node_monitor'
    depends = {item.text for item in package.iter('depend')}
    assert {'rcl', 'rmw_implementation', 'std_msgs', 'geometry_msgs', 'test_msgs'} <= depends
    email = package.find('maintainer')
    assert email is not None and re.fullmatch(r'[\w.-]+@([\w-]+\.)+[a-z]+', email.attrib['email'])
    cmake = files['CMakeLists.txt']
    assert 'project(node_monitor LANGUAGES C)' in cmake
    built = set(re.findall(r'src/\w+\.c', cmake))
    assert built == {name for name in files if name.endswith('.c')}
    for name in built:  # each header is there
        included = re.findall(r'^#include "(\w+\.h)"', files[name], re.MULTILINE)
        assert all(f'src/{header}' in files for header in included), name
    assert {name for name in files if not name.startswith('src/')} == {
        'CMakeLists.txt', 'README.md', 'launch/monitor.launch.py', 'manifest.json', 'package.xml'}
    compile(files['launch/monitor.launch.py'], 'monitor.launch.py', 'exec')


def test_the_same_bundle_gives_the_same_bytes_and_texts_of_it_are_literals(
    tmp_path: Path,
) -> None:
    pytest.importorskip('test_msgs.action')
    (tmp_path / 'elsewhere').mkdir()
    files = files_of(generated(tmp_path))
    assert files == files_of(generated(tmp_path / 'elsewhere'))
    table = files['src/node_table.c']
    assert table.isascii() and '*/' not in re.sub(r'"[^"]*"', '""', table)
    assert 'FM_DECLARE_TYPE_SUPPORT(test_msgs, action, Fibonacci_FeedbackMessage);' in table
    assert '{.name = "MOST", .value = {.u = UINT64_C(18446744073709551615)}}' in table
    assert '{FM_WEAKER, FM_FOLLOW, FM_FOLLOW, 3u}' in table
    assert 'copilot/handlerprop010__x_' in table
    assert 'INT64_C(250000000)' in table


def test_what_the_node_cannot_do_is_refused_with_its_place(tmp_path: Path) -> None:
    monitor = generated(tmp_path, """
format: 1
inputs:
  x: {type: float64}
requirements:
  - {id: R, ptltl: "x < 1.0"}
""")
    with pytest.raises(CompileError) as refused:
        ros2(monitor, Options())
    assert "node.yaml:4:3: error: 'x' has no ROS 2 topic to read" in str(refused.value)
    with pytest.raises(CompileError, match='without arguments'):
        ros2(monitor, Options(handler_arguments=HandlerArguments.VALUES))


@pytest.mark.parametrize(('name', 'package'), [
    ('quadrotor', 'quadrotor_monitor'), ('My__Robot_', 'my_robot_monitor'),
    ('m_2nd', 'm_2nd_monitor'), ('_', 'm_monitor')])
def test_names_of_packages_follow_the_rules_of_ros(name: str, package: str) -> None:
    assert package_name(name) == package
