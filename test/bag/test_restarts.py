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

"""Recordings whose time goes back are refused with the place; they are several runs in one."""

from contextlib import closing
from pathlib import Path
from random import Random

import apsw
from bag.recordings import FLOAT, Message, START, TYPES, write
from fret_monitor.bag.check import check_recording, RecordingResult, Selection
from fret_monitor.bag.restarts import times_of_chunk
from fret_monitor.model.diagnostics import CompileError
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import CompressionMode, StoragePlugin, Writer
from rosbags.rosbag2.storage_mcap import McapReader
from rosbags.typesys import get_typestore, Stores
import yaml

LOW = """format: 1
inputs: {level: {topic: level, type: std_msgs/msg/Float64}}
requirements: [{id: LOW, ptltl: "H (level < 0.5)"}]
"""
SECOND = 10**9
STORAGES = [
    (StoragePlugin.SQLITE3, CompressionMode.NONE), (StoragePlugin.MCAP, CompressionMode.NONE),
    (StoragePlugin.MCAP, CompressionMode.STORAGE)]


def checked(folder: Path, path: Path) -> RecordingResult:
    file = folder / 'low.yaml'
    file.write_text(LOW, encoding='utf-8')
    return check_recording(file, path, Selection())


def run_of(begin: int, count: int = 40) -> list[Message]:
    """Return a run in which the topics alternate, ten messages a second each."""
    return [(f'/{topic}', begin + k * SECOND // 10 + late, 0.25)
            for k in range(count) for topic, late in (('level', 0), ('other', 1000))]


@pytest.mark.parametrize(('storage', 'compression'), STORAGES)
def test_two_runs_in_one_file_are_refused_with_the_place(
        tmp_path: Path, storage: StoragePlugin, compression: CompressionMode) -> None:
    path = write(tmp_path / 'bag', [*run_of(0), *run_of(SECOND)], storage=storage,
                 compression=compression)
    with pytest.raises(CompileError) as error:
        checked(tmp_path, path)
    assert '1 restart: in bag.' in str(error.value)
    assert (f'a message of /level at {START // SECOND + 3}.900000000 s is followed by one at '
            f'{START // SECOND + 1}.000000000 s') in str(error.value)


@pytest.mark.parametrize('storage', [StoragePlugin.SQLITE3, StoragePlugin.MCAP])
def test_two_types_of_one_topic_are_no_restart(tmp_path: Path, storage: StoragePlugin) -> None:
    path, other = tmp_path / 'bag', 'std_msgs/msg/Bool'
    with Writer(path, version=9, storage_plugin=storage) as writer:
        connections = [(writer.add_connection('/level', kind, typestore=TYPES), kind)
                       for kind in (FLOAT, other)]
        for k in range(40):
            one, kind = connections[k % 2]
            data = TYPES.serialize_cdr(TYPES.types[kind](0), kind)
            writer.write(one, START + k * SECOND, data)
    result = checked(tmp_path, path)
    assert sum(result.read.values()) == 20 and other in result.errors[0]


@pytest.mark.parametrize(('storage', 'compression'), STORAGES)
def test_restarts_are_counted_once_for_all_topics(
        tmp_path: Path, storage: StoragePlugin, compression: CompressionMode) -> None:
    path = write(tmp_path / 'bag', [*run_of(0), *run_of(0), *run_of(SECOND)], storage=storage,
                 compression=compression)
    with pytest.raises(CompileError, match='2 restarts'):
        checked(tmp_path, path)


def test_a_restart_between_two_files_of_a_recording_is_one(tmp_path: Path) -> None:
    for number, storage in enumerate((StoragePlugin.SQLITE3, StoragePlugin.MCAP)):
        ending = 'db3' if storage is StoragePlugin.SQLITE3 else 'mcap'
        for begins, is_refused in (((0, 4 * SECOND), False), ((4 * SECOND, 0), True),
                                   ((0, 2 * SECOND), True)):
            parts = [write(tmp_path / f'{number}-{begins[1]}-{begin}', run_of(begin),
                           storage=storage) for begin in begins]
            path = parts[0]
            other = parts[1] / f'{parts[1].name}.{ending}'
            other.rename(path / other.name)
            metadata = yaml.safe_load((path / 'metadata.yaml').read_text(encoding='utf-8'))
            about = metadata['rosbag2_bagfile_information']
            about['relative_file_paths'].append(other.name)
            about['message_count'] *= 2
            for topic in about['topics_with_message_count']:
                topic['message_count'] *= 2
            (path / 'metadata.yaml').write_text(yaml.safe_dump(metadata), encoding='utf-8')
            if is_refused:
                with pytest.raises(CompileError, match=f'1 restart: in {other.name}'):
                    checked(tmp_path, path)
            else:
                assert checked(tmp_path, path).errors == ()


def test_a_bag_of_ros_1_with_two_runs_is_refused(tmp_path: Path) -> None:
    types = get_typestore(Stores.ROS1_NOETIC)
    kind = 'std_msgs/msg/Float64'
    with Writer1(tmp_path / 'old.bag') as writer:
        topic = writer.add_connection('/level', kind, typestore=types)
        for time in (0, SECOND, 2 * SECOND, SECOND, 2 * SECOND):
            writer.write(topic, START + time,
                         types.serialize_ros1(types.types[kind](0.25), kind))
    with pytest.raises(CompileError, match=r'1 restart: in old\.bag'):
        checked(tmp_path, tmp_path / 'old.bag')


@pytest.mark.parametrize(('storage', 'compression'), STORAGES)
def test_messages_that_are_written_late_are_none(
        tmp_path: Path, storage: StoragePlugin, compression: CompressionMode) -> None:
    rng = Random(1)
    messages = sorted(run_of(0, 200), key=lambda item: item[1] + rng.randrange(SECOND // 10))
    assert messages != run_of(0, 200)
    path = write(tmp_path / 'late', messages, storage=storage, compression=compression)
    assert checked(tmp_path, path).errors == ()
    by_topic = sorted(run_of(0, 200))  # all of a topic, then all of the next
    path = write(tmp_path / 'apart', by_topic, storage=storage, compression=compression)
    assert checked(tmp_path, path).errors == ()


def test_rows_that_were_deleted_hide_no_restart(tmp_path: Path) -> None:
    path = write(tmp_path / 'bag', [*run_of(0), *run_of(0)],
                 storage=StoragePlugin.SQLITE3) / 'bag.db3'
    with apsw.Connection(str(path)) as database:
        database.execute('DELETE FROM messages WHERE id BETWEEN 81 AND 82')
    with pytest.raises(CompileError, match='1 restart'):
        checked(tmp_path, path)


@pytest.mark.parametrize('compression', [CompressionMode.NONE, CompressionMode.STORAGE])
def test_a_chunk_without_an_index_of_its_messages_is_read(
        tmp_path: Path, compression: CompressionMode) -> None:
    path = write(tmp_path / 'bag', [*run_of(0), *run_of(0)], compression=compression)
    reader = McapReader(path / 'bag.mcap')
    reader.open()
    with closing(reader):
        for chunk in reader.chunks:
            indexed = dict(times_of_chunk(reader, chunk))
            assert len(indexed) == 2
            without = chunk._replace(message_index_offsets={})
            assert dict(times_of_chunk(reader, without)) == indexed
