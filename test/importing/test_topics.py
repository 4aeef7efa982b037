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

"""Variable databases and lists: the topics and fields of inputs."""

from pathlib import Path

from fret_monitor.cli.main import main
from fret_monitor.importing.topics import Connection, is_list, read_database, read_list
from fret_monitor.model.diagnostics import Problems, Source
from importing.examples import DATABASE
import pytest


def test_a_database_gives_topic_type_and_field() -> None:
    problems = Problems()
    assert read_database(DATABASE, 'db.json', problems) == [
        Connection('speed', '/wheels/speed', 'std_msgs/msg/Float32', None, 'float'),
        Connection('armed', '/battery', 'sensor_msgs/msg/BatteryState', 'present', 'bool'),
        Connection('level', type='int32_t',
                   note="db.json connects it to 'cfs', not 'ros/message'")]
    assert problems.warnings == ()


def test_a_field_may_stand_with_the_types() -> None:
    database = {
        'inputs': [{'name': 'x', 'connections': [{'scope': 'ros/message', 'topic': '/pose'}]}],
        'topics': [{'scope': 'ros/message', 'topic': '/pose',
                    'type': 'geometry_msgs::msg::Point'}],
        'types': [{'fromScope': 'ros/message', 'fromType': 'geometry_msgs::msg::Point',
                   'fromField': 'x', 'toScope': 'C', 'toType': 'double'}]}
    assert read_database(database, 'db.json', Problems()) == [
        Connection('x', '/pose', 'geometry_msgs/msg/Point', 'x')]


def test_a_list_has_two_columns_or_more() -> None:
    text = 'speed /speed\n\n# none\nlevel, tank/level, std_msgs.msg.Int32, data  -- water\nodd\n'
    assert read_list(Source('l', text), 'l', Problems()) == [
        Connection('speed', '/speed'),
        Connection('level', 'tank/level', 'std_msgs/msg/Int32', 'data'),
        Connection('odd')]


@pytest.mark.parametrize('line, reported, rest', [
    ('speed /a//b', "a topic cannot contain '//'", Connection('speed')),
    ('speed 7up', 'cannot begin with a digit', Connection('speed')),
    ('speed /a std_msgs/srv/Empty', 'is not a message', Connection('speed', '/a'))])
def test_what_ros_would_refuse_is_reported_with_its_line(line: str, reported: str,
                                                         rest: Connection) -> None:
    problems = Problems()
    assert read_list(Source('l', f'# first\n{line}\n'), 'l', problems) == [rest]
    [warning] = problems.warnings
    assert reported in warning.title
    assert warning.span is not None
    assert warning.span.line == 2


@pytest.mark.parametrize('text, answer', [
    ('a b\nc d\n', True), ('a\n', True), ('# nothing\n', False), ('', False),
    ('this is no list of names\n', False), ('1 /a\n', False)])
def test_a_list_is_known_by_its_lines(text: str, answer: bool) -> None:
    assert is_list(text) is answer


def test_inputs_of_a_bundle_give_topics_and_types(tmp_path: Path,
                                                  capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / 'robot.yaml').write_text(
        'format: 1\nevaluation: {policy: timed}\ninputs:\n'
        '  force: {topic: /gripper/force, type: std_msgs/msg/Float32, field: data, timeout: 2}\n'
        '  unused: {topic: /x, type: std_msgs/msg/Bool}\n'
        '  some: {topic: /y, type: std_msgs/msg/Float32, field: data, where: "data > 1"}\n'
        '# requirements:\n', encoding='utf-8')
    (tmp_path / 'a.csv').write_text('id,text\nR-1,force <= 20 & some < 3\n', encoding='utf-8')
    target = tmp_path / 'a.yaml'
    assert main(['import', str(tmp_path / 'a.csv'), str(tmp_path / 'robot.yaml'), '-o',
                 str(target)]) == 0
    text = target.read_text(encoding='utf-8')
    for line in ('topic: /gripper/force', 'type: std_msgs/msg/Float32', 'field: data'):
        assert text.count(line) == 1
    said = capsys.readouterr().err
    assert "robot.yaml:6:3: warning: robot.yaml: the input 'some' is not taken over" in said
    assert 'unused' not in said and 'least one requirement' not in said
    assert ('robot.yaml: of this bundle only topics, types and fields are taken over\n'
            '   = help: copy evaluation and timeout into the new bundle, too\n') in said
    assert 'timeout' not in text and 'evaluation' not in text
    (tmp_path / 'none.yaml').write_text('no bundle: and no list of names\n', encoding='utf-8')
    assert main(['import', str(tmp_path / 'a.csv'), str(tmp_path / 'none.yaml'), '-o',
                 str(tmp_path / 'b.yaml')]) == 1
