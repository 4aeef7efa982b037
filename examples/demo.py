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
Fly a simulated quadrotor under a monitor: three processes over DDS.

    python3 demo.py

The vehicle of `quadrotor.py` flies with a fault, faster than real time: it publishes its time on
/clock. What the monitor received is in its black box, with the times at which it received it. That
is evaluated again by the reference semantics; the demo succeeds (exit status 0) if the monitor
received what was published, and the logger printed exactly the violations found, in the same order
and with the same times, to the millisecond.

A message can overtake the /clock that was published before it. The monitor then receives it a
tick of the clock (0.1 s) earlier than the vehicle sent it, so that times differ from run to run.
"""

from collections.abc import Iterator, Mapping, Set
from contextlib import contextmanager
from dataclasses import dataclass
import os
from pathlib import Path
from queue import Empty, SimpleQueue
import re
import signal
import struct
import subprocess
import sys
from tempfile import TemporaryDirectory
from textwrap import fill
from threading import Thread
from time import monotonic, sleep

from fret_monitor import build
from fret_monitor.logic.formula import Historically, variables
from fret_monitor.logic.specification import Specification
from fret_monitor.logic.timed import evaluate_timed, TimedTrace

HERE = Path(__file__).resolve().parent
BUNDLE = HERE.parent / 'config' / 'quadrotor.yaml'
NODE = 'import sys; from fret_monitor.ros.{0} import main; sys.argv[0] = "{0}"; sys.exit(main())'

START_PATIENCE = 60.0  # s; the first start compiles
FLIGHT_PATIENCE = 60.0  # s
SPEED = 8.0  # simulated seconds a second
BOX_SECONDS = 60.0  # real time that the black box goes back: to the start
TAKES_OFF_AT = 1000  # s on /clock, as in quadrotor.py
END_PATIENCE = 10.0  # s
END_TOPIC = '/blackbox_end'  # of the message that marks the end of a black box
CDR_HEAD = 4  # bytes before the value of a serialized Float32
MCAP_MAGIC_BYTES = 8  # at the begin and the end of a file
MCAP_CHANNEL, MCAP_CHUNK = 4, 6  # kinds of records
MCAP_CHUNK_HEAD, MCAP_MESSAGE_HEAD = 40, 22  # bytes before the records, the serialized message

VIOLATED = re.compile(r'(\S+) violated at ([0-9.]+): (.*?)(?: \[(.* after its start: .*)\])?')
RECOVERED = re.compile(r'(\S+) satisfied again at ([0-9.]+): .*')
FLYING = re.compile(r'\s*([0-9.]+) s   wind\s+([0-9.]+) m/s   current\s+([0-9.]+) A(?:   (.*))?')


class Failure(Exception):
    """The demo did not go as it had to."""


class Process:
    """A child whose lines are read as they come."""

    def __init__(self, name: str, command: list[str], environment: dict[str, str]) -> None:
        """Start it, in a session of its own: Ctrl-C is for the demo, which ends its children."""
        self.name = name
        self.lines: SimpleQueue[str] = SimpleQueue()
        self._child = subprocess.Popen(
            command, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, text=True, errors='replace', start_new_session=True)
        self._reader = Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self._child.stdout is not None
        for line in self._child.stdout:
            self.lines.put(line.rstrip('\n'))

    def is_running(self) -> bool:
        """Whether it has not ended yet."""
        return self._child.poll() is None

    def wait_for(self, words: str, patience: float) -> str:
        """Return the first line that holds `words`; raises `Failure` if none comes."""
        end = monotonic() + patience
        heard: list[str] = []
        while monotonic() < end and (self.is_running() or not self.lines.empty()):
            try:
                heard.append(self.lines.get(timeout=0.1))
            except Empty:
                continue
            if words in heard[-1]:
                return heard[-1]
        raise Failure('\n'.join([f'the {self.name} did not start:', *heard]))

    def new_lines(self) -> Iterator[str]:
        """Yield the lines printed since the last call."""
        while not self.lines.empty():
            yield self.lines.get()

    def end(self, number: int = signal.SIGINT) -> int:
        """Ask it to end, and see to it that it does; return its exit status."""
        try:
            if self.is_running():
                self._child.send_signal(number)
            status = self._child.wait(END_PATIENCE)
        except subprocess.TimeoutExpired:
            self._child.kill()
            status = self._child.wait()
        self._reader.join(END_PATIENCE)
        return status


class Story:
    """Tells on the terminal what happens."""

    def __init__(self) -> None:
        """Use colours if a person is watching."""
        self._colours = sys.stdout.isatty() and 'NO_COLOR' not in os.environ

    def say(self, text: str = '', colour: int | None = None) -> None:
        """Write a line."""
        is_plain = colour is None or not self._colours
        print(text if is_plain else f'\033[{colour}m{text}\033[0m', flush=True)

    def paragraph(self, head: str, text: str, colour: int | None = None) -> None:
        """Write a text below its head, wrapped."""
        self.say(fill(text, 96, initial_indent=head, subsequent_indent=' ' * len(head)), colour)

    def fly(self, seconds: float, wind: float, current: float, event: str) -> None:
        """Write a line of the flight."""
        self.say(f'  {seconds:5.1f} s  wind {_bar(wind, 16)} {wind:4.1f} m/s'
                 f'   current {_bar(current, 32)} {current:4.1f} A   {event}'.rstrip(),
                 36 if event else None)

    def violate(self, name: str, stamp: str, sentence: str, values: str | None) -> None:
        """Write that a requirement is violated."""
        self.say(f'  ***** {name} VIOLATED at {_flown(stamp)} s of the flight', 31)
        self.paragraph('        ', sentence, 31)
        if values:
            self.paragraph('        ', values, 31)

    def recover(self, name: str, stamp: str) -> None:
        """Write that a requirement is satisfied again."""
        self.say(f'  ***** {name} satisfied again at {_flown(stamp)} s of the flight', 32)


def _flown(stamp: str) -> str:
    return f'{float(stamp) - TAKES_OFF_AT:.3f}'


def _bar(value: float, most: float, width: int = 16) -> str:
    filled = round(width * min(1.0, max(0.0, value / most)))
    return '#' * filled + '.' * (width - filled)


def main() -> int:
    """Run the demo; return the exit status."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _interrupt)
    story = Story()
    try:
        with TemporaryDirectory(prefix='fret_monitor_demo_') as folder:
            log, box = Path(folder) / 'flight.csv', Path(folder) / 'blackbox'
            log.touch()
            announced = _perform(story, log, box)
            return _judge(story, announced, log, box)
    except Failure as failure:
        story.say(f'FAILED: {failure}', 31)
        return 1
    except KeyboardInterrupt:
        story.say('interrupted')
        return 130


def _interrupt(number: int, frame: object) -> None:
    raise KeyboardInterrupt


def _perform(story: Story, log: Path, box: Path) -> list[tuple[str, str]]:
    """Run the three processes; return id and stamp of the violations logged, in order."""
    story.say('A quadrotor flies through wind. These are its requirements:')
    specification = build.read(BUNDLE).specification
    for item in specification.properties:
        story.paragraph(f'  {item.id}  ', item.title or item.text)
    story.say()
    with _process('monitor', f'spec:={BUNDLE}', 'use_sim_time:=true',
                  'log_violations:=false', f'blackbox:={box}',
                  f'blackbox_seconds:={BOX_SECONDS}') as monitor, \
            _process('logger', f'spec:={BUNDLE}', 'use_sim_time:=true') as logger:
        story.say('  monitor: ' + _message(monitor.wait_for('watching', START_PATIENCE)))
        story.say('  logger:  ' + _message(logger.wait_for('listening', START_PATIENCE)))
        with _process('vehicle', 'fault:=true', f'speed:={SPEED}', f'log:={log}') as vehicle:
            story.say('  vehicle: ready, with a fault in its battery guard')
            story.say()
            announced = _follow(story, vehicle, logger)
            _expect_quiet_end(vehicle)
        _expect_quiet_end(logger)
        announced += _tell_violations(story, logger)
        _expect_quiet_end(monitor)
    return announced


@contextmanager
def _process(name: str, *parameters: str) -> Iterator[Process]:
    """Start a node with these parameters, and end it, whatever happens."""
    command = [sys.executable, str(HERE / 'quadrotor.py')] if name == 'vehicle' \
        else [sys.executable, '-c', NODE.format(name)]
    arguments = [word for item in parameters for word in ('-p', item)]
    process = Process(name, [*command, '--ros-args', *arguments], _environment())
    try:
        yield process
    finally:
        process.end(signal.SIGTERM)


def _environment() -> dict[str, str]:
    """Return an environment in which no other node can disturb the demo."""
    return {
        **os.environ,
        # These have ports above the ephemeral ones, and nobody else's nodes.
        'ROS_DOMAIN_ID': str(215 + os.getpid() % 17),
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        'RCUTILS_CONSOLE_OUTPUT_FORMAT': '[{severity}] {message}',
        'RCUTILS_COLORIZED_OUTPUT': '0',
        'PYTHONUNBUFFERED': '1',
    }


def _follow(story: Story, vehicle: Process, logger: Process) -> list[tuple[str, str]]:
    """Show the flight until it is over; return id and stamp of the violations logged."""
    announced: list[tuple[str, str]] = []
    end = monotonic() + FLIGHT_PATIENCE
    quiet_since = monotonic()
    count = 0
    while vehicle.is_running() or monotonic() < quiet_since + 1.0:
        if monotonic() > end:
            raise Failure('the vehicle did not land')
        if vehicle.is_running():
            quiet_since = monotonic()
        for line in vehicle.new_lines():
            count += _tell_flight(story, line, count)
        announced += _tell_violations(story, logger)
        sleep(0.05)
    return announced


def _tell_flight(story: Story, line: str, count: int) -> int:
    """Tell what happens, and each 25th line where nothing does; return 1 for a line of flight."""
    found = FLYING.fullmatch(line)
    if found is None:
        story.say(f'  vehicle: {_message(line)}')
        return 0
    seconds, wind, current, event = found.groups()
    if event or count % 25 == 0:
        story.fly(float(seconds), float(wind), float(current), event or '')
    return 1


def _tell_violations(story: Story, logger: Process) -> list[tuple[str, str]]:
    announced = []
    for line in logger.new_lines():
        found = VIOLATED.fullmatch(_message(line))
        if found:
            story.violate(*found.groups())
            announced.append((found.group(1), _flown(found.group(2))))
        elif recovered := RECOVERED.fullmatch(_message(line)):
            story.recover(*recovered.groups())
        else:
            story.say(f'  logger: {_message(line)}')
    return announced


def _message(line: str) -> str:
    return re.sub(r'^\[[A-Z]+\] ', '', line)


def _expect_quiet_end(process: Process) -> None:
    status = process.end()
    if status != 0:
        raise Failure('\n'.join(
            [f'the {process.name} ended with status {status}:', *process.new_lines()]))


def _judge(story: Story, announced: list[tuple[str, str]], log: Path, box: Path) -> int:
    """Compare the announced violations with the reference semantics."""
    published = [line.split(',') for line in log.read_text(encoding='utf-8').splitlines()]
    received, end = _received(box)
    _compare(published, received)
    expected = list(_expected(build.read(BUNDLE).specification, received, end))
    story.say()
    story.say(f'{len(published)} messages were published, and {len(received)} of them are in the '
              'black box of the monitor.')
    story.say('By the reference semantics they violate, at the times at which it received them:')
    for name, flown in expected:
        story.say(f'  {name}  at {flown} s of the flight')
    if not expected or announced != expected:
        shown = (f'{name} at {flown} s' for name, flown in announced)
        raise Failure(f"announced was: {', '.join(shown) or 'nothing'}")
    story.say('Exactly these were announced, at exactly these times.', 32)
    return 0


@dataclass(frozen=True)
class Message:
    """A message as the monitor received it: the time on its clock (ns), topic and value."""

    time: int
    topic: str
    value: float


def _received(box: Path) -> tuple[list[Message], int]:
    """Return the messages in the last file of a black box, and the time (ns) at its end."""
    files = sorted(box.glob('blackbox_*.mcap'))
    if not files:
        raise Failure('the monitor has written no black box')
    messages: list[Message] = []
    time = 0
    for stamp, topic, data in _recorded(files[-1].read_bytes()):
        # Of two messages at one time of /clock, the second counts a nanosecond later.
        time = max(stamp, time + 1)
        if not topic.endswith(END_TOPIC):
            value, = struct.unpack_from('<f', data, CDR_HEAD)
            messages.append(Message(time, topic, value))
    return messages, time


def _recorded(file: bytes) -> list[tuple[int, str, bytes]]:
    """
    Return time, topic and bytes of each message of a black box, in the order of time.

    It is an MCAP file without compression (https://mcap.dev/spec). `rosbags` reads such files too,
    but is not among what `make demo` installs.
    """
    topics: dict[int, str] = {}
    found = []
    for kind, content in _records(file[MCAP_MAGIC_BYTES:-MCAP_MAGIC_BYTES]):
        if kind == MCAP_CHANNEL:
            channel, _, length = struct.unpack_from('<HHI', content)
            topics[channel] = content[8:8 + length].decode()
        elif kind == MCAP_CHUNK:
            for _, message in _records(content[MCAP_CHUNK_HEAD:]):
                channel, _, time = struct.unpack_from('<HIQ', message)
                found.append((time, topics[channel], message[MCAP_MESSAGE_HEAD:]))
    return sorted(found, key=lambda item: item[0])


def _records(content: bytes) -> Iterator[tuple[int, bytes]]:
    place = 0
    while place < len(content):
        kind, length = struct.unpack_from('<BQ', content, place)
        place += 9
        yield kind, content[place:place + length]
        place += length


def _compare(published: list[list[str]], received: list[Message]) -> None:
    """Raise `Failure` unless what was received is what was published, up to the file's end."""
    for topic in {topic for _, topic, _ in published}:
        sent = [_as_float32(float(value)) for _, name, value in published if name == topic]
        found = [item.value for item in received if item.topic == topic]
        if not found or found != sent[:len(found)]:
            raise Failure(f'the monitor has not received each message on {topic}')


def _expected(specification: Specification, received: list[Message],
              end: int) -> Iterator[tuple[str, str]]:
    """Yield id and time of each occurrence due, in the order of time."""
    fed = {f'/{item.topic}': item.name for item in specification.signals}
    found = []
    for place, item in enumerate(specification.properties):
        read = {variable.name for variable in variables(item.formula)}
        times, trace = _rows(received, fed, read)
        always = item.formula
        watched = always.argument if isinstance(always, Historically) else always
        ticks = [time - times[0] for time in times]
        history, = evaluate_timed(
            [watched], TimedTrace(ticks, trace, end - times[0]), item.feedback)
        found += [(times[0] + tick, place) for tick, value in history if not value]
    for time, place in sorted(found):
        yield specification.properties[place].id, _flown(f'{time / 1e9:.3f}')


def _rows(received: list[Message], fed: Mapping[str, str],
          read: Set[str]) -> tuple[list[int], dict[str, list[float]]]:
    """Return times and values of the messages that a requirement reads, once all have a value."""
    values: dict[str, float] = {}
    times: list[int] = []
    trace: dict[str, list[float]] = {name: [] for name in read}
    for item in received:
        if fed[item.topic] not in read:
            continue
        values[fed[item.topic]] = item.value
        if len(values) == len(read):
            times.append(item.time)
            for name in read:
                trace[name].append(values[name])
    return times, trace


def _as_float32(value: float) -> float:
    rounded: float = struct.unpack('<f', struct.pack('<f', value))[0]
    return rounded


if __name__ == '__main__':
    sys.exit(main())
