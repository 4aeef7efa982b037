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

"""Transforms in recordings: the verdicts are those of the transforms that tf2 would return."""

from collections.abc import Iterator
from pathlib import Path
from random import Random
import re

from bag.recordings import START, TYPES
from fret_monitor.bag.check import check_recording, RecordingResult, Selection
from fret_monitor.cli.main import main
from fret_monitor.start import start
from fret_monitor.traces.simulate import simulate
import numpy
from numpy.typing import NDArray
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from strategies import some
from transforms import LinkOf, links

Array = NDArray[numpy.float64]
Record = tuple[int, bool, list[LinkOf]]  # time since START, whether on /tf_static, links
MS = 10**6
KIND = 'tf2_msgs/msg/TFMessage'
HERE = [0.0, 0.0, 0.0, 1.0]
BUNDLE = """
format: 1
inputs:
  x: {transform: {from: map, to: lidar}, field: translation.x}
  far: {transform: {from: map, to: lidar}, field: norm(translation)}
  heading: {transform: {from: map, to: lidar}, field: yaw(rotation)}
  old: {transform: {from: map, to: lidar}, field: age()}
evaluation: {policy: POLICY}
requirements:
  - {id: EAST, ptltl: x < 1}
  - {id: NEAR, ptltl: far < 3}
  - {id: HEADING, ptltl: heading < 0.5 | Y heading < 0.6}
  - {id: FRESH, ptltl: old < 0.03}
"""


def bundle(folder: Path, policy: str = 'every_message', text: str = BUNDLE) -> Path:
    file = folder / 'bundle.yaml'
    file.write_text(text.replace('POLICY', policy), encoding='utf-8')
    return file


def write(path: Path, records: list[Record], topics: tuple[str, ...] = ('/tf', '/tf_static'),
          ) -> Path:
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = {name: writer.add_connection(name, KIND, typestore=TYPES)
                       for name in topics}
        for time, is_static, items in records:
            if (name := '/tf_static' if is_static else '/tf') in connections:
                writer.write(connections[name], START + time, links(*items))
    return path


def checked(bundle: Path, recording: Path) -> RecordingResult:
    return check_recording(bundle, recording, Selection())


def turn(angle: float) -> list[float]:
    return [0.0, 0.0, float(numpy.sin(angle / 2)), float(numpy.cos(angle / 2))]


def random_records(seed: int) -> list[Record]:
    """Return map -> odom at 10 Hz, odom -> base at 50 Hz, and base -> lidar, once."""
    rng = Random(seed)
    found: list[Record] = [(0, True, [LinkOf(
        START - 5, 'base', 'lidar', [0.5, 0.0, 0.25], turn(0.3))])]
    for number in range(300):
        time = number * 20 * MS + 1
        for child, parent, every in (('odom', 'map', 5), ('base', 'odom', 1)):
            if number % every == 0:
                stamp = START + time - rng.randrange(30) * MS
                found.append((time + rng.randrange(15) * MS, False, [LinkOf(
                    stamp, parent, child, [rng.uniform(-3, 3), rng.uniform(-3, 3), 0.0],
                    turn(rng.uniform(-1, 1)))]))
    return sorted(found, key=lambda item: item[0])


def pose_at(samples: list[LinkOf], stamp: int) -> Array | None:
    """Return the matrix of a link between the samples around a time."""
    ordered = sorted({item.stamp: item for item in reversed(samples)}.values(),
                     key=lambda item: item.stamp)
    before = [item for item in ordered if item.stamp <= stamp]
    after = [item for item in ordered if item.stamp >= stamp]
    if not before or not after:
        return None
    one, other = before[-1], after[0]
    part = 0.0 if one is other else (stamp - one.stamp) / (other.stamp - one.stamp)
    angles = [2 * numpy.arctan2(item.rotation[2], item.rotation[3]) for item in (one, other)]
    angle = angles[0] + part * (angles[1] - angles[0])
    found = numpy.eye(4)
    found[:2, :2] = [[numpy.cos(angle), -numpy.sin(angle)], [numpy.sin(angle), numpy.cos(angle)]]
    found[:3, 3] = (1 - part) * numpy.array(one.translation) \
        + part * numpy.array(other.translation)
    return found


def rows(records: list[Record]) -> Iterator[tuple[int, float, float, float, float]]:
    """Yield the time and the inputs of each new transform, by the definition."""
    seen: dict[str, list[LinkOf]] = {'odom': [], 'base': [], 'lidar': []}
    last = None
    for time, _, items in records:
        for item in items:
            seen[item.child].append(item)
        if not all(seen.values()):
            continue
        stamp = min(max(item.stamp for item in seen[name]) for name in ('odom', 'base'))
        first, second = (pose_at(seen[name], stamp) for name in ('odom', 'base'))
        if first is None or second is None:
            continue
        lidar = pose_at(seen['lidar'], seen['lidar'][0].stamp)
        assert lidar is not None
        found = first @ second @ lidar
        if last is None or last[0] != stamp or not numpy.array_equal(last[1], found):
            last = stamp, found
            yield (time, found[0, 3], float(numpy.linalg.norm(found[:3, 3])),
                   float(numpy.arctan2(found[1, 0], found[0, 0])), (START + time - stamp) / 1e9)


@pytest.mark.parametrize('policy', ['every_message', 'relevant_message', 'all_inputs'])
@pytest.mark.parametrize('seed', some(range(3)))
def test_the_verdicts_are_those_of_simulate_on_the_transforms(
        tmp_path: Path, seed: int, policy: str) -> None:
    records = random_records(seed)
    file = bundle(tmp_path, policy)
    trace, out = tmp_path / 'trace.csv', tmp_path / 'out.csv'
    expected = list(rows(records))
    trace.write_text('x,far,heading,old\n' + ''.join(
        ','.join(repr(float(value)) for value in row[1:]) + '\n' for row in expected),
        encoding='utf-8')
    simulate(start(file).monitor, trace, out)
    verdicts = [line.split(',')[1:] for line in out.read_text(encoding='utf-8').splitlines()[1:]]
    result = checked(file, write(tmp_path / 'bag', records))
    assert result.errors == ()
    assert [item.violations for item in result.findings] == [
        column.count('0') for column in zip(*verdicts)]
    counts = [item.violations or 0 for item in result.findings]
    assert all(5 < count < len(expected) for count in counts), (counts, len(expected))


def test_a_timeout_counts_the_transforms_and_not_the_messages(tmp_path: Path) -> None:
    file = bundle(tmp_path, text="""
format: 1
inputs:
  x: {transform: {from: map, to: base}, field: translation.x, timeout: 0.5, stale: violate}
evaluation: {policy: timed}
requirements:
  - {id: EAST, ptltl: H x < 9}
""")
    records: list[Record] = [
        (number * 100 * MS, False, [LinkOf(START + number * 100 * MS, parent, child, HERE[:3],
                                           HERE)])
        for number in range(40) for parent, child in (('map', 'odom'), ('odom', 'base'))
        if child == 'base' or number < 10]
    result = checked(file, write(tmp_path / 'bag', records))
    assert result.errors == ()
    assert [item.spans for item in result.findings] == [[(START + 1400 * MS, None)]]


def test_a_chain_that_is_never_whole_is_an_error_with_its_missing_link(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    records = [item for item in random_records(1) if item[2][0].child != 'odom']
    file, path = bundle(tmp_path), write(tmp_path / 'bag', records)
    result = checked(file, path)
    assert result.errors == (
        'there is no transform map -> lidar at the end: no link between map and odom',)
    assert [item.verdict for item in result.findings] == [None] * 4
    assert main(['bag', str(file), str(path)]) != 0
    assert 'no link between map and odom' in capsys.readouterr().err


def test_static_links_alone_need_no_tf(tmp_path: Path) -> None:
    file = bundle(tmp_path, text=BUNDLE.replace('from: map', 'from: base'))
    result = checked(file, write(tmp_path / 'bag', random_records(1), ('/tf_static',)))
    assert result.errors == ()
    assert [item.verdict for item in result.findings] == [True] * 4


def test_without_both_topics_nothing_is_judged(tmp_path: Path) -> None:
    path = tmp_path / 'bag'
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        kind = 'std_msgs/msg/Float64'
        connection = writer.add_connection('/x', kind, typestore=TYPES)
        for time in (START, START + 5000 * MS):
            writer.write(connection, time, TYPES.serialize_cdr(TYPES.types[kind](1.0), kind))
    silent = ', timeout: 0.5, startup: 0.5, stale: violate}'
    result = checked(bundle(tmp_path, text=re.sub(r'(?<=field: )(.*)}', rf'\1{silent}', BUNDLE)),
                     path)
    assert any('/tf was not recorded' in text for text in result.errors)
    assert [item.verdict for item in result.findings] == [None] * 4


def test_links_that_are_left_out_are_a_warning(tmp_path: Path) -> None:
    records = [*random_records(1), (9000 * MS, False, [
        LinkOf(START, 'lidar', 'map', HERE[:3], HERE), LinkOf(START, '', 'a', HERE[:3], HERE)])]
    result = checked(bundle(tmp_path), write(tmp_path / 'bag', records))
    assert result.errors == ()
    assert result.warnings == ('links of /tf left out: 1 would close a loop',
                               'links of /tf left out: 1 cannot be used as transforms')


def test_an_input_on_tf_itself_is_read_too(tmp_path: Path) -> None:
    file = bundle(tmp_path, text=BUNDLE.replace('inputs:', f"""inputs:
  parts: {{topic: /tf, type: {KIND}, field: len(transforms)}}""")
        + '  - {id: PARTS, ptltl: parts < 1}\n')
    records = random_records(1)
    result = checked(file, write(tmp_path / 'bag', records))
    assert result.errors == ()
    assert result.findings[-1].violations is not None
    assert result.findings[-1].violations >= len(records) - 1


def test_a_message_that_cannot_be_decoded_is_an_error(tmp_path: Path) -> None:
    path = tmp_path / 'bag'
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        connection = writer.add_connection('/tf', KIND, typestore=TYPES)
        for time, is_static, items in random_records(1):
            writer.write(connection, START + time, links(*items)[:-8 if is_static else None])
    result = checked(bundle(tmp_path), path)
    assert any('1 message of /tf cannot be decoded' in text for text in result.errors)
