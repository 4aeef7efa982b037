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
The files of a black box beside what was sent, from a real run that blackbox.csv holds.

    .venv/bin/python -m tools.pictures.blackbox     # half a minute: records it anew

A monitor runs the first bundle of the README. The robot is too fast three times: the second time
while the first file is being written, the third one later.
"""

from collections.abc import Iterator
import csv
import os
from pathlib import Path
import re
import subprocess
import sys
import tempfile
import time

from tools.pictures.pages import block
from tools.pictures.sheet import arrow, bar, document, dot, seconds, text

DATA = Path(__file__).with_suffix('.csv')
LEFT, SECOND, ROW, END_S = 130, 29, 30, 28
PERIODS_S = {'odom': 0.5, 'brake': 2.0}
FAST_S = (14.0, 15.5, 23.5)  # when the robot is too fast, for half a second each

Event = tuple[str, str, float, float]  # what, of what, when, until when or value


def events() -> list[Event]:
    """Return what happened in the run, with seconds since its begin."""
    with DATA.open(encoding='utf-8') as file:
        return [(row['what'], row['name'], float(row['time']), float(row['value']))
                for row in csv.DictReader(file)]


def drawn() -> str:
    """Return the picture."""
    found = events()
    files = [item for item in found if item[0] == 'file']
    bottom = ROW * (4 + len(files)) + 8
    return document(
        int(_x(END_S)) + 24, bottom + 24, 'What the files of a black box hold of a run',
        (*_files(found, files), *seconds(_x, END_S, 8, bottom, 2), *_messages(found),
         *_violations(found, bottom)))


def _x(time: float) -> float:
    return LEFT + SECOND * time


def _messages(found: list[Event]) -> Iterator[str]:
    for row, topic in enumerate(PERIODS_S):
        yield text(8, ROW * row + 27, topic)
        for what, name, when, value in found:
            if (what, name) == ('sent', topic):
                yield dot('bad' if value > 1.0 else 'message', _x(when), ROW * row + 22)


def _violations(found: list[Event], bottom: int) -> Iterator[str]:
    yield text(8, ROW * 2 + 27, 'SPEED')
    for what, _, begin, end in found:
        if what == 'violated':
            yield bar('bad', _x(begin), ROW * 2 + 14, SECOND * (end - begin), ROW - 14)


def _files(found: list[Event], files: list[Event]) -> Iterator[str]:
    begun = [when for what, _, when, _ in found if what == 'violated']
    for number, (_, _, begin, end) in enumerate(files):
        y = ROW * (3 + number) + 16
        yield text(8, y + 15, f'file {number + 1}')
        yield bar('kept', _x(begin), y, SECOND * (end - begin), ROW - 8)
        first = next(when for when in begun if when > begin + 5)
        last = max(when for when in begun if when < end)
        yield text(_x(begin) + 8, y + 15, f'{first - begin:.0f} s before', 'small')
        yield text(_x(end) - 8, y + 15, f'{end - last:.0f} s after', 'small end')
        yield from arrow(_x(first), ROW * 3, _x(first), y)


def _record() -> None:
    """Run the nodes, and write what happened."""
    os.environ |= {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST', 'ROS_DOMAIN_ID': '87'}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        bundle = folder / 'robot.yaml'
        bundle.write_text(block('README.md', 'robot.yaml'), encoding='utf-8')
        log = folder / 'log'
        with log.open('w') as file:
            monitor = subprocess.Popen(
                [Path(sys.executable).parent / 'monitor', '--ros-args', '-p', f'spec:={bundle}',
                 '-p', f'blackbox:={folder}'], stderr=file)
            begin, sent = _drive()
            monitor.terminate()
            monitor.wait()
        found = [*sent, *_logged(log.read_text(), begin),
                 *(_written(path, begin) for path in sorted(folder.glob('*.mcap')))]
    with DATA.open('w', encoding='utf-8') as file:
        writer = csv.writer(file, lineterminator='\n')
        writer.writerow(('what', 'name', 'time', 'value'))
        writer.writerows((what, name, f'{when:.2f}', f'{value:.2f}')
                         for what, name, when, value in found)


def _drive() -> tuple[float, list[Event]]:
    """Publish as a robot would; return when it began, and what was sent."""
    from nav_msgs.msg import Odometry
    import rclpy
    from std_msgs.msg import Bool
    rclpy.init()
    node = rclpy.create_node('robot')
    topics = {'odom': node.create_publisher(Odometry, 'odom', 10),
              'brake': node.create_publisher(Bool, 'brake', 10)}
    while not all(item.get_subscription_count() for item in topics.values()):
        time.sleep(0.1)
    begin, sent = time.time(), []
    plan = sorted((k * period, name) for name, period in PERIODS_S.items()
                  for k in range(round(END_S / period)))
    for due, name in plan:
        time.sleep(max(0.0, begin + due - time.time()))
        message = Bool() if name == 'brake' else Odometry()
        speed = 0.0
        if isinstance(message, Odometry):
            speed = 1.5 if due in FAST_S else 0.6
            message.twist.twist.linear.x = speed
        sent.append(('sent', name, time.time() - begin, speed))
        topics[name].publish(message)
    time.sleep(1)
    rclpy.shutdown()
    return begin, sent


def _logged(log: str, begin: float) -> Iterator[Event]:
    """Yield each violation with its end."""
    times = re.findall(r'SPEED (?:violated|satisfied again) at ([\d.]+)', log)
    for start, end in zip(times[::2], times[1::2], strict=True):
        yield 'violated', 'SPEED', float(start) - begin, float(end) - begin


def _written(path: Path, begin: float) -> Event:
    """Return the times of the first and the last message of a file."""
    from rosbags.highlevel import AnyReader
    with AnyReader([path]) as reader:
        return ('file', 'mcap', reader.start_time / 1e9 - begin,
                (reader.end_time - 1) / 1e9 - begin)


if __name__ == '__main__':
    _record()
