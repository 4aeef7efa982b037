#!/usr/bin/env python3
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
Draw docs/pictures/policies.svg from real runs: one recording, judged under each of the policies.

    .venv/bin/python tools/draw_pictures.py

The bundle is the first one of docs/time.md. `fret-monitor bag` judges the recording under each
policy. It needs rosbags. The same version draws the same bytes.
"""

from collections.abc import Iterator
from contextlib import redirect_stderr, redirect_stdout
import csv
from io import StringIO
from pathlib import Path
import re
import tempfile
from xml.sax.saxutils import escape

from fret_monitor.cli.main import main as fret_monitor

ROOT = Path(__file__).resolve().parent.parent
PICTURE = ROOT / 'docs' / 'pictures' / 'policies.svg'
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
LEFT, SECOND, ROW, END_S = 150, 70, 26, 8.0
SHEET = """
text { font: 13px sans-serif; fill: #222 } .faint { fill: #777 } .line { stroke: #bbb }
.good { fill: #8cc6a0 } .bad { fill: #d9534f } .unknown { fill: #ddd } .message { fill: #35c }
@media (prefers-color-scheme: dark) {
text { fill: #ddd } .faint { fill: #999 } .line { stroke: #555 }
.good { fill: #2f6b45 } .bad { fill: #c9443f } .unknown { fill: #444 } .message { fill: #8ab4ff } }
"""


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
    page = (ROOT / 'docs' / 'time.md').read_text(encoding='utf-8')
    found = re.search(r'^```yaml\n# door\.yaml\n(.*?)^```', page, re.MULTILINE | re.DOTALL)
    assert found is not None
    text = found[1].replace('policy: timed', f'policy: {policy}')
    bundle, changes = folder / 'door.yaml', folder / 'changes.csv'
    bundle.write_text(text.replace('requirements:', 'report: occurrence\nrequirements:'),
                      encoding='utf-8')
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
    height = ROW * (len(TYPES) + len(POLICIES) + 2) + 10
    return '\n'.join((
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_x(END_S) + 120} {height}" '
        'role="img"><title>One requirement on the same messages under each policy</title>'
        f'<style>{SHEET}</style>', *_axis(height), *_messages(),
        *(line for number, (policy, changes) in enumerate(rows.items())
          for line in _lane(ROW * (len(TYPES) + 1 + number) + 10, policy, changes)),
        '</svg>', ''))


def _x(time: float) -> int:
    return LEFT + round(SECOND * time)


def _text(x: int, y: int, text: str, kind: str = '') -> str:
    return f'<text x="{x}" y="{y}" class="{kind}">{escape(text)}</text>'


def _axis(height: int) -> Iterator[str]:
    for second in range(int(END_S) + 1):
        yield (f'<line class="line" x1="{_x(second)}" x2="{_x(second)}" y1="6" '
               f'y2="{height - ROW}"/>')
        yield _text(_x(second) - 4, height - 10, f'{second} s' if second else '0', 'faint')


def _messages() -> Iterator[str]:
    for row, topic in enumerate(TYPES):
        y = ROW * row + 24
        yield _text(8, y, topic)
        for name, time, value in MESSAGES:
            if name == topic:
                yield f'<circle class="message" cx="{_x(time)}" cy="{y - 5}" r="4"/>'
                if topic != 'battery':
                    yield _text(_x(time) + 7, y, 'true' if value else 'false', 'faint')


def _lane(y: int, policy: str, changes: list[tuple[float, str]]) -> Iterator[str]:
    yield _text(8, y + 15, policy)
    ends = [time for time, _ in changes[1:]] + [END_S]
    for (time, verdict), end in zip(changes, ends, strict=True):
        kind = {'1': 'good', '0': 'bad', '': 'unknown'}[verdict]
        yield (f'<rect class="{kind}" x="{_x(time)}" y="{y}" '
               f'width="{max(_x(end) - _x(time), 2)}" height="{ROW - 8}"/>')
    first = next((time for time, verdict in changes if verdict == '0'), None)
    yield _text(_x(END_S) + 10, y + 15,
                'not violated' if first is None else f'violated at {first:g} s', 'faint')


if __name__ == '__main__':
    PICTURE.write_text(drawn(), encoding='utf-8')
