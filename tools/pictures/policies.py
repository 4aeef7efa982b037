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
"""One recording, judged under each of the policies: the first bundle of docs/time.md."""

from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
import csv
from io import StringIO
from pathlib import Path
import tempfile

from fret_monitor.cli.main import main as fret_monitor

from tools.pictures.pages import block
from tools.pictures.sheet import bar, document, dot, seconds, text

START_S = 1_700_000_000
MESSAGES = (
    ('request', 0.0, 0), ('battery', 0.2, 0.9), ('open', 0.4, 0), ('request', 2.0, 1),
    ('battery', 2.2, 0.9), ('battery', 2.5, 0.9), ('battery', 2.8, 0.9), ('open', 7.0, 1),
)
TYPES = {'request': 'std_msgs/msg/Bool', 'open': 'std_msgs/msg/Bool',
         'battery': 'std_msgs/msg/Float32'}
POLICIES = {
    'every_message': 'every_message', 'relevant_message': 'relevant_message',
    'all_inputs': 'all_inputs', 'periodic': 'periodic, period: 1.5', 'timed': 'timed',
}
LEFT, SECOND, ROW, END_S = 150, 70, 26, 8


def record(folder: Path) -> Path:
    """Write the messages to a recording."""
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import get_typestore, Stores
    types = get_typestore(Stores.ROS2_JAZZY)
    with Writer(folder / 'door', version=9) as writer:
        topics = {name: writer.add_connection(f'/{name}', kind, typestore=types)
                  for name, kind in TYPES.items()}
        for name, time, value in MESSAGES:
            kind = TYPES[name]
            message = types.types[kind](bool(value) if kind.endswith('Bool') else value)
            writer.write(topics[name], START_S * 10**9 + round(time * 10**9),
                         types.serialize_cdr(message, kind))
    return folder / 'door'


def judged(folder: Path, recording: Path, policy: str) -> list[tuple[float, str]]:
    """Return the times at which the verdict of OPENS changes under a policy, and the verdicts."""
    bundle, changes = folder / 'door.yaml', folder / 'changes.csv'
    bundle.write_text(block('docs/time.md', 'door.yaml').replace(
        'policy: timed', f'policy: {policy}').replace(
        'requirements:', 'report: occurrence\nrequirements:'), encoding='utf-8')
    with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
        fret_monitor(['bag', str(bundle), str(recording), '--csv', str(changes),
                      '--until', 'end+1'])
    with changes.open(encoding='utf-8') as file:
        return [(float(row['time']) - START_S, row['OPENS']) for row in csv.DictReader(file)]


def drawn() -> str:
    """Return the picture."""
    with tempfile.TemporaryDirectory() as name:
        recording = record(Path(name))
        rows = {policy: judged(Path(name), recording, keys) for policy, keys in POLICIES.items()}
    bottom = ROW * (len(TYPES) + len(POLICIES) + 1) + 10
    return document(
        int(_x(END_S)) + 120, bottom + ROW,
        'One requirement on the same messages under each policy',
        (*seconds(_x, END_S, 6, bottom), *_messages(),
         *(line for number, (policy, changes) in enumerate(rows.items())
           for line in _lane(ROW * (len(TYPES) + 1 + number) + 10, policy, changes))))


def _x(time: float) -> float:
    return LEFT + round(SECOND * time)


def _messages() -> Iterator[str]:
    for row, topic in enumerate(TYPES):
        y = ROW * row + 24
        yield text(8, y, topic)
        for name, time, value in MESSAGES:
            if name == topic:
                yield dot('message', _x(time), y - 5)
                if topic != 'battery':
                    yield text(_x(time) + 7, y, 'true' if value else 'false', 'faint')


def _lane(y: int, policy: str, changes: list[tuple[float, str]]) -> Iterator[str]:
    yield text(8, y + 15, policy)
    ends = [time for time, _ in changes[1:]] + [END_S]
    for (time, verdict), end in zip(changes, ends, strict=True):
        kind = {'1': 'good', '0': 'bad', '': 'unknown'}[verdict]
        yield bar(kind, _x(time), y, _x(end) - _x(time), ROW - 8)
    first = next((time for time, verdict in changes if verdict == '0'), None)
    yield text(_x(END_S) + 10, y + 15,
               'not violated' if first is None else f'violated at {first:g} s', 'faint')
