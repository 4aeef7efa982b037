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

"""Messages of MCAP chunks are those of `rosbags`, in the same order; damage is an error."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from random import Random
import struct

from bag.recordings import FLOAT, START, TYPES, write
from fret_monitor.bag import chunks
from fret_monitor.bag.check import check_recording, Selection
from fret_monitor.bag.moments import Anchor, Moment
from fret_monitor.runtime.mcap import McapWriter
import pytest
from rosbags.rosbag2 import CompressionMode
from rosbags.rosbag2.storage_mcap import McapReader

MESSAGE = struct.pack('<BQHIQQ', 5, 24, 1, 0, 7, 7) + b'ab'
SCHEMA = struct.pack('<BQ', 3, 4) + bytes(4)
SECOND = 10**9


@contextmanager
def opened(path: Path) -> Iterator[McapReader]:
    reader = McapReader(path)
    reader.open()
    try:
        yield reader
    finally:
        reader.close()


def overlapping(folder: Path, rng: Random) -> Path:
    """Write messages of three topics in many chunks, with equal times, and out of order."""
    path = folder / 'random.mcap'
    definition, _ = TYPES.generate_msgdef(FLOAT, ros_version=2)
    spread, step, base = rng.choice([0, 0, 3, 40]), rng.randrange(2), 0
    with path.open('wb') as file:
        writer = McapWriter(file)
        topics = [writer.add_channel(f'/t{number}', FLOAT, definition) for number in range(3)]
        for number in range(400):
            time = START + base + step * number // 2 + rng.randrange(spread + 1)
            writer.add_message(rng.choice(topics), time, rng.randbytes(rng.randrange(20)))
            if rng.randrange(20) == 0:
                writer.add_metadata('end of a chunk', {})
                base = 0 if step else 3 * rng.randrange(10)
        writer.end()
    return path


@pytest.mark.parametrize('seed', range(12))
def test_messages_are_those_of_rosbags_in_the_same_order(tmp_path: Path, seed: int) -> None:
    rng = Random(seed)
    with opened(overlapping(tmp_path, rng)) as reader:
        rng.shuffle(reader.chunks)
        chosen = rng.sample(reader.connections, rng.randrange(1, 4))
        for stop in (None, START - 1, START + 100, START + 10**6):
            found = list(chunks.messages(reader, chosen, stop))
            assert found == list(reader.messages(chosen, None, stop))
        assert len(found) > 50


def test_messages_of_compressed_chunks_are_read(tmp_path: Path) -> None:
    path = write(tmp_path / 'bag', [('/x', k, k / 7) for k in range(9)],
                 compression=CompressionMode.STORAGE)
    with opened(path / 'bag.mcap') as reader:
        found = list(chunks.messages(reader, reader.connections, None))
        assert found == list(reader.messages(reader.connections)) and len(found) == 9


@pytest.mark.parametrize('overlap', [0, 50])
def test_chunks_are_read_one_by_one(tmp_path: Path, overlap: int) -> None:
    rng = Random(1)
    path = write(tmp_path / 'bag', [('/x', k + rng.randrange(overlap + 1), k / 7)
                                    for k in range(60_000)]) / 'bag.mcap'
    with opened(path) as reader:
        assert len(reader.chunks) == 3
        places: list[int] = []
        file = reader.bio
        assert file is not None
        for count, _ in enumerate(chunks.messages(reader, reader.connections, None)):
            if file.tell() not in places:
                places.append(file.tell())
                assert count <= 25_000 * (len(places) - 1)
        assert len(places) == 3


@pytest.mark.parametrize('records', [b'', SCHEMA, MESSAGE, SCHEMA + MESSAGE + SCHEMA,
                                     MESSAGE + MESSAGE[:7] + MESSAGE[7:]])
def test_records_of_other_kinds_are_passed_over(records: bytes) -> None:
    found = [(channel, time, records[begin:end])
             for channel, time, begin, end in chunks.messages_of(records)]
    assert found == [(1, 7, b'ab')] * records.count(MESSAGE)


@pytest.mark.parametrize('records', [
    MESSAGE[:-1], MESSAGE + SCHEMA[:-1], MESSAGE + b'\3', MESSAGE[:30], MESSAGE + MESSAGE[:9],
    struct.pack('<BQ', 5, 21) + bytes(21), struct.pack('<BQ', 5, 21) + bytes(21) + SCHEMA,
    struct.pack('<BQ', 3, 2**64 - 1) + bytes(40), SCHEMA[:1] + struct.pack('<Q', 5) + bytes(4)])
def test_a_record_that_does_not_fit_into_its_chunk_is_damage(records: bytes) -> None:
    with pytest.raises(ValueError, match='a record in a chunk has a wrong length'):
        list(chunks.messages_of(records))


@pytest.mark.parametrize('to_end', [True, False])
def test_a_message_outside_the_times_of_its_chunk_is_an_error(
        tmp_path: Path, *, to_end: bool) -> None:
    bundle = tmp_path / 'bundle.yaml'
    bundle.write_text('format: 1\ninputs: {x: {topic: x, type: std_msgs/msg/Float64}}\n'
                      'requirements: [{id: R, ptltl: x < 5}]\n', encoding='utf-8')
    path = write(tmp_path / 'bag', [('/x', k * SECOND, k) for k in range(9)]) / 'bag.mcap'
    content = path.read_bytes()
    message = struct.pack('<QQ', START + 7 * SECOND, START + 7 * SECOND)
    assert content.count(message) == 1
    path.write_bytes(content.replace(message, struct.pack('<QQ', START + 70 * SECOND, START)))
    selection = Selection() if to_end else Selection(end=Moment(Anchor.START, 8 * SECOND - 1))
    result = check_recording(bundle, path, selection)
    assert 'the recording cannot be read to its end: a chunk has messages outside its times' \
        in result.errors
    assert result.findings[0].first == START + 5 * SECOND  # of what comes before
