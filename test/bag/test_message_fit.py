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

"""Messages are read by a definition that fits them, and topics by the names that ROS has."""

import json
from pathlib import Path

import apsw
from bag.recordings import START, TYPES, write
from fret_monitor.bag.check import check_recording, RecordingResult, Selection
from fret_monitor.bag.findings import Findings
from fret_monitor.bag.results import json_line
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import get_types_from_msg, get_typestore, Stores

KIND = 'std_msgs/msg/Int32'
LOW = f"""format: 1
inputs: {{level: {{topic: level, type: {KIND}, field: data}}}}
requirements: [{{id: LOW, ptltl: "H (level <= 20)"}}]
"""


def checked(folder: Path, path: Path) -> RecordingResult:
    file = folder / 'low.yaml'
    file.write_text(LOW, encoding='utf-8')
    return check_recording(file, path, Selection())


def write_as(folder: Path, definition: str, levels: list[int], *, tail: bytes = b'',
             storage: StoragePlugin = StoragePlugin.SQLITE3) -> Path:
    """Write messages of another definition, the last of them with more bytes."""
    types = get_typestore(Stores.EMPTY)
    types.register(get_types_from_msg(definition, KIND))
    names = [name for name, _ in types.fielddefs[KIND][1]]
    with Writer(folder / 'bag', version=9, storage_plugin=storage) as writer:
        topic = writer.add_connection('/level', KIND, typestore=types)
        for number, level in enumerate(levels):
            values = {name: level if name == 'data' else 7 for name in names}
            message = bytes(types.serialize_cdr(types.types[KIND](**values), KIND))
            writer.write(topic, START + number,
                         message + tail * (number == len(levels) - 1))
    return folder / 'bag'


def forget_definitions(path: Path) -> None:
    with apsw.Connection(str(path / 'bag.db3')) as database:
        database.execute('DELETE FROM message_definitions')


def test_a_type_that_is_defined_in_another_way_than_installed_is_a_warning(
        tmp_path: Path) -> None:
    path = write_as(tmp_path, 'int32 before\nint32 data', [20, 20])
    result = checked(tmp_path, path)
    assert (result.findings[0].verdict, result.errors) == (True, ())
    assert result.warnings == (
        f'{KIND}: the definition in the recording differs from the installed one; that of the '
        'recording was used',)


@pytest.mark.parametrize(('definition', 'problem'), [
    ('int32 before\nint32 data', 'they have 4 bytes after its last field'),
    ('int16 data', 'they end before its last field')])
def test_what_reads_messages_that_do_not_fit_what_is_installed_is_not_judged(
        tmp_path: Path, definition: str, problem: str) -> None:
    path = write_as(tmp_path, definition, [21, 21])
    forget_definitions(path)
    result = checked(tmp_path, path)
    assert result.findings[0].verdict is None
    assert result.findings[0].spans == []
    assert f'messages of /level do not fit {KIND}: {problem}' in result.errors[0]


@pytest.mark.parametrize('tail', [b'', b'\0', b'\0\0\0', b'\0\0\0\0', b'\0' * 8])
def test_a_message_with_more_than_padding_at_its_end_is_an_error(
        tmp_path: Path, tail: bytes) -> None:
    result = checked(tmp_path, write_as(tmp_path, 'int32 data', [20, 20, 21], tail=tail))
    assert result.findings[0].verdict is False
    assert [error for error in result.errors if 'after its last field' in error] \
        == list(result.errors)
    assert len(result.errors) == (len(tail) > 3)


@pytest.mark.parametrize('storage', [StoragePlugin.SQLITE3, StoragePlugin.MCAP])
def test_a_name_without_a_slash_is_one_of_the_root(
        tmp_path: Path, storage: StoragePlugin) -> None:
    path = write(tmp_path / 'bag', [('level', 0, 20), ('/level', 1, 21), ('other', 2, 0)],
                 kind=KIND, storage=storage)
    for item in (path, path / f'bag.{"mcap" if storage is StoragePlugin.MCAP else "db3"}'):
        result = checked(tmp_path, item)
        assert (result.errors, result.read, result.findings[0].violations) == (
            (), {'/level': 2}, 1)


def test_the_types_of_the_first_recorders_are_known(tmp_path: Path) -> None:
    path = write(tmp_path / 'bag', [('/level', 0, 20), ('/level', 1, 21)], kind=KIND,
                 storage=StoragePlugin.SQLITE3)
    with apsw.Connection(str(path / 'bag.db3')) as database:
        database.execute("UPDATE topics SET type = 'std_msgs/Int32'")
    forget_definitions(path)
    metadata = path / 'metadata.yaml'
    metadata.write_text(metadata.read_text(encoding='utf-8').replace(KIND, 'std_msgs/Int32'),
                        encoding='utf-8')
    result = checked(tmp_path, path)
    assert (result.errors, result.findings[0].violations) == ((), 1)


def test_no_instance_of_what_is_not_judged_is_listed_and_keys_are_told_apart(
        tmp_path: Path) -> None:
    def keys(definition: str) -> list[str]:
        folder = tmp_path / str(len(definition))
        folder.mkdir()
        path = write_as(folder, definition, [30, 31])
        forget_definitions(path)
        file = tmp_path / 'keyed.yaml'
        file.write_text(LOW.replace('inputs:', 'for_each: {robot: {most: 3}}\ninputs:').replace(
            'topic: level', 'topic: "/{robot}"'), encoding='utf-8')
        result = check_recording(file, path, Selection())
        return list(json.loads(json_line(result))['requirements']['LOW']['instances'])

    assert keys('int32 data') == ['level']
    assert keys('int32 before\nint32 data') == []


@pytest.mark.parametrize('tail', [b'', b'\0' * 8])
def test_no_instance_is_listed_that_was_judged_before_another_topic_does_not_fit(
        tmp_path: Path, tail: bytes) -> None:
    bundle = tmp_path / 'keyed.yaml'
    bundle.write_text(f"""format: 1
for_each: {{robot: {{most: 3}}}}
inputs:
  level: {{topic: "/{{robot}}/level", type: {KIND}, field: data}}
  limit: {{topic: /limit, type: {KIND}, field: data, initial: 20}}
requirements: [{{id: LOW, ptltl: "H (level <= limit)"}}]
""", encoding='utf-8')
    with Writer(tmp_path / 'bag', version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        level, limit = (writer.add_connection(name, KIND, typestore=TYPES)
                        for name in ('/a/level', '/limit'))
        message = bytes(TYPES.serialize_cdr(TYPES.types[KIND](21), KIND))
        for number in range(600):  # more than are read at once
            writer.write(level, START + number, message)
        writer.write(limit, START + 600, message + tail)
    result = check_recording(bundle, tmp_path / 'bag', Selection())
    listed = json.loads(json_line(result))['requirements']['LOW']['instances']
    assert (result.findings[0].verdict, list(listed)) == ((None, []) if tail else (False, ['a']))


def test_a_name_that_ros_puts_in_for_braces_is_no_instance(tmp_path: Path) -> None:
    file = tmp_path / 'low.yaml'
    file.write_text(LOW.replace('topic: level', 'topic: "/{ns}/level"'), encoding='utf-8')
    result = check_recording(file, write_as(tmp_path, 'int32 data', [20]), Selection())
    assert result.errors[0].startswith('/{ns}/level was not recorded')


def test_keys_that_are_no_text_are_told_apart() -> None:
    found = Findings('R', variables=('robot',))
    assert [found.of(key).id for key in (b'\xff', b'\xfe', 'é'.encode())] == [
        'R[robot=\\xff]', 'R[robot=\\xfe]', 'R[robot=é]']
