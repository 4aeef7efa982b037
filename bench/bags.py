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

"""
Check recordings beside merely reading them, and beside a script that evaluates in Python.

Each row is a recording. `raw` is the time to read its messages with `rosbags`; `ours` is that of
`fret-monitor bag` after the start, in the same process, in interleaved rounds; a ratio is the
median of the rounds'. The script deserialises with `rosbags` and evaluates the same formula with
reelay, where it is installed. Memory is the growth of the largest resident size. `bag --margins`
is compared with `bag`, start included, in the same way.

    python -m bench.bags
"""

from collections.abc import Callable, Iterator
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
import resource
from statistics import median
import subprocess
import sys
import tempfile
import time
from typing import Any

from fret_monitor.bag.check import check_recording, Selection
from fret_monitor.bag.fleet import asked
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.typesys import get_typestore, Stores

ROUNDS = 5
REQUIREMENTS = 10
TYPES = get_typestore(Stores.ROS2_JAZZY)
START = 1_700_000_000_000_000_000
SPACING_NS = 1_000_000
SMALL, LARGE = 'std_msgs/msg/Float64', 'std_msgs/msg/Float64MultiArray'
LARGE_ITEMS = 131_072  # of 8 bytes: 1 MiB
BUNDLE = """format: 1
evaluation: {policy: timed}
inputs:
  value: {topic: value, type: TYPE, field: FIELD, max_rate: 2000}
requirements:
"""
KEYS = 1000
POINT = 'geometry_msgs/msg/PointStamped'
KEYED = """format: 1
evaluation: {policy: timed}
for_each: {robot: {most: 1000}}
inputs:
  value: {INPUT}
requirements:
"""
KEYED_INPUTS = {
    'a topic each': 'topic: "/{robot}/value", type: std_msgs/msg/Float64',
    'one topic': f'topic: points, type: {POINT}, field: point.x, '
                 'where: "header.frame_id = {robot}"',
}
REQUIREMENT = '  - {id: R-%d, ptltl: "H (value > 0.9%d -> O[0, 100 ms] value < 0.5)"}\n'
MARGINS = {
    'formulas': REQUIREMENT,
    'deadlines': '  - {id: R-%d, fretish: "upon value > 0.9%d the robot shall within 100 '
                 'milliseconds satisfy value < 0.5"}\n'}


def main() -> int:
    """Print the tables."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        print('| recording | messages | raw, a message | ours, a message | ours / raw |')
        print('|---|---|---|---|---|')
        for storage in StoragePlugin:
            for kind, count in ((SMALL, 300_000), (LARGE, 300)):
                print(row(folder, storage, kind, count), flush=True)
        print()
        print(f'| {KEYS:,} keys | messages | raw, a message | ours, a message | ours / raw |')
        print('|---|---|---|---|---|')
        for storage in StoragePlugin:
            for name in KEYED_INPUTS:
                print(keyed_row(folder, storage, name, 200_000), flush=True)
        print()
        print('| small messages | without | --margins | ratio | and --triggers | ratio |')
        print('|---|---|---|---|---|---|')
        for storage in StoragePlugin:
            for count in (10_000, 300_000):
                for kind in MARGINS:
                    print(margins_row(folder, storage, kind, count), flush=True)
        print()
        print(memory(folder))
        print(processes(folder))
        print(script(folder))
    return 0


def bundle(folder: Path, kind: str) -> Path:
    """Write a bundle of ten requirements on one topic."""
    file = folder / f'{kind.rpartition("/")[2]}.yaml'
    text = BUNDLE.replace('TYPE', kind).replace('FIELD', 'data' if kind == SMALL else '"data[7]"')
    text += ''.join(REQUIREMENT % (number, number) for number in range(REQUIREMENTS))
    file.write_text(text, encoding='utf-8')
    return file


def recording(folder: Path, storage: StoragePlugin, kind: str, count: int) -> Path:
    """Write a recording of one topic; its values are a sawtooth of 97 steps."""
    path = folder / f'{storage.name}-{kind.rpartition("/")[2]}-{count}'
    if path.exists():
        return path
    with Writer(path, version=9, storage_plugin=storage) as writer:
        topic = writer.add_connection('/value', kind, typestore=TYPES)
        messages = [message(kind, number / 97) for number in range(97)]
        for number in range(count):
            writer.write(topic, START + number * SPACING_NS, messages[number % 97])
    return path


def message(kind: str, value: float) -> bytes:
    """Return a serialized message."""
    if kind == SMALL:
        return bytes(TYPES.serialize_cdr(TYPES.types[kind](value), kind))
    import numpy
    layout = TYPES.types['std_msgs/msg/MultiArrayLayout'](dim=[], data_offset=0)
    data = numpy.full(LARGE_ITEMS, value)
    return bytes(TYPES.serialize_cdr(TYPES.types[kind](layout=layout, data=data), kind))


def read_raw(path: Path) -> int:
    """Read all messages; return their number."""
    with Reader(path) as reader:
        return sum(1 for _ in reader.messages())


def seconds(work: Callable[[], object]) -> float:
    """Return how long some work takes, by the processor."""
    begin = time.process_time()
    work()
    return time.process_time() - begin


def row(folder: Path, storage: StoragePlugin, kind: str, count: int) -> str:
    """Compare checking with reading."""
    path, spec = recording(folder, storage, kind, count), bundle(folder, kind)
    none = recording(folder, storage, kind, 1)
    name = f'{storage.name.lower()}, {"1 MiB" if kind == LARGE else "small"}'
    return compared(name, spec, path, none, count)


def keyed_row(folder: Path, storage: StoragePlugin, name: str, count: int) -> str:
    """Compare checking one requirement of each key with reading."""
    spec = folder / f'{name.replace(" ", "_")}.yaml'
    spec.write_text(KEYED.replace('INPUT', KEYED_INPUTS[name]) + REQUIREMENT % (0, 0))
    path, none = (keyed_recording(folder, storage, name, number) for number in (count, KEYS))
    return compared(f'{storage.name.lower()}, {name}', spec, path, none, count - KEYS)


def keyed_recording(folder: Path, storage: StoragePlugin, name: str, count: int) -> Path:
    """Write a recording of all keys, in turn."""
    path = folder / f'{storage.name}-{name.replace(" ", "_")}-{count}'
    values = [message(SMALL, number / 97) for number in range(97)]
    points = [point(f'r{key}', key % 97 / 97) for key in range(KEYS)]
    has_topics = name == 'a topic each'
    with Writer(path, version=9, storage_plugin=storage) as writer:
        topics = [writer.add_connection(f'/r{key}/value', SMALL, typestore=TYPES)
                  for key in range(KEYS)] if has_topics else [
            writer.add_connection('/points', POINT, typestore=TYPES)]
        for number in range(count):
            key = number * 7919 % KEYS
            writer.write(topics[key if has_topics else 0], START + number * SPACING_NS,
                         values[number % 97] if has_topics else points[key])
    return path


def point(key: str, value: float) -> bytes:
    """Return a serialized message with a key in its header."""
    types: Any = TYPES.types
    header = types['std_msgs/msg/Header'](types['builtin_interfaces/msg/Time'](0, 0), key)
    return bytes(TYPES.serialize_cdr(types[POINT](
        header, types['geometry_msgs/msg/Point'](value, 0.0, 0.0)), POINT))


def compared(name: str, spec: Path, path: Path, none: Path, count: int) -> str:
    """Compare checking a recording with reading it; `none` is one that is hardly longer than 0."""
    def ours() -> float:
        start = seconds(lambda: check_recording(spec, none, Selection()))
        return seconds(lambda: check_recording(spec, path, Selection())) - start

    pairs = [(seconds(lambda: read_raw(path)), ours()) for _ in range(ROUNDS)]
    raw, mine = (median(column) * 1e6 / count for column in zip(*pairs))
    ratio = median(one / other for other, one in pairs)
    return f'| {name} | {count:,} | {raw:.2f} us | {mine:.2f} us | {ratio:.2f} |'


def margins_row(folder: Path, storage: StoragePlugin, kind: str, count: int) -> str:
    """Compare checking with margins, and with margins and triggers, with checking."""
    path, spec = recording(folder, storage, SMALL, count), folder / f'{kind}.yaml'
    spec.write_text(BUNDLE.replace('TYPE', SMALL).replace('FIELD', 'data') + ''.join(
        MARGINS[kind] % (number, number) for number in range(REQUIREMENTS)), encoding='utf-8')
    selections = [Selection(), Selection(margins=True), Selection(margins=True, triggers=True)]

    def took(selection: Selection) -> float:
        return seconds(lambda: check_recording(spec, path, selection, asides=asked))

    for selection in selections:
        took(selection)  # compiles
    rounds = [[took(selection) for selection in selections] for _ in range(ROUNDS)]
    without, closest, both = (f'{median(column):.3f} s' for column in zip(*rounds))
    ratios = [f'{median(each[place] / each[0] for each in rounds):.2f}' for place in (1, 2)]
    return (f'| {storage.name.lower()}, {count:,}, {kind} | {without} | {closest} | {ratios[0]} | '
            f'{both} | {ratios[1]} |')


def resident() -> int:
    """Return the largest resident size so far, in kB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def memory(folder: Path) -> str:
    """Return how much more memory a long recording takes than a short one."""
    spec = bundle(folder, SMALL)
    check_recording(spec, recording(folder, StoragePlugin.MCAP, SMALL, 100_000), Selection())
    before = resident()
    check_recording(spec, recording(folder, StoragePlugin.MCAP, SMALL, 300_000), Selection())
    return f'memory: {(resident() - before) / 1024:+.1f} MB for a recording three times as long'


def processes(folder: Path) -> str:
    """Compare two processes with one, on eight recordings, with their starts."""
    spec = bundle(folder, SMALL)
    paths = [recording(folder, StoragePlugin.MCAP, SMALL, 300_000 + number) for number in range(8)]

    def took(jobs: int) -> float:
        begin = time.monotonic()
        subprocess.run([sys.executable, '-m', 'fret_monitor', 'bag', spec, *paths, '--jobs',
                        str(jobs)], check=True, stdout=subprocess.DEVNULL)
        return time.monotonic() - begin

    one, two = took(1), took(2)
    return f'processes: two take {two:.1f} s, one takes {one:.1f} s ({one / two:.2f})'


def script(folder: Path) -> str:
    """Compare with a script that deserialises and evaluates in Python."""
    if find_spec('reelay') is None:
        return 'script: not measured; pip install reelay'
    path = recording(folder, StoragePlugin.MCAP, SMALL, 100_000)
    spec = bundle(folder, SMALL)
    theirs = seconds(lambda: list(evaluated(path)))
    ours = seconds(lambda: check_recording(spec, path, Selection()))
    return (f'script with rosbags and reelay, {REQUIREMENTS} requirements: {theirs / ours:.0f} '
            'times as long')


def evaluated(path: Path) -> Iterator[Any]:
    """Evaluate the requirements with reelay, over deserialised messages."""
    monitors = [import_module('reelay').dense_timed_monitor(
        pattern=f'historically({{value > 0.9{number}}} -> once[0:100]{{value < 0.5}})',
        semantics='boolean') for number in range(REQUIREMENTS)]
    with Reader(path) as reader:
        for connection, stamp, data in reader.messages():
            found: Any = TYPES.deserialize_cdr(data, connection.msgtype)
            update = {'time': (stamp - START) // SPACING_NS, 'value': float(found.data)}
            for monitor in monitors:
                yield monitor.update(update)


if __name__ == '__main__':
    sys.exit(main())
