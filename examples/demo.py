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
/clock. Its messages are evaluated again by the reference semantics; the demo succeeds (exit status
0) if the logger printed exactly the violations found, in the same order and at their times.
"""

from collections.abc import Iterator, Mapping, Set
from contextlib import contextmanager
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
TAKES_OFF_AT = 1000.0  # s on /clock, as in quadrotor.py
TOLERANCE = 0.5  # s between a published message and its reception on /clock
END_PATIENCE = 10.0  # s

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
        flown = float(stamp) - TAKES_OFF_AT
        self.say(f'  ***** {name} VIOLATED at {flown:.1f} s of the flight', 31)
        self.paragraph('        ', sentence, 31)
        if values:
            self.paragraph('        ', values, 31)

    def recover(self, name: str, stamp: str) -> None:
        """Write that a requirement is satisfied again."""
        flown = float(stamp) - TAKES_OFF_AT
        self.say(f'  ***** {name} satisfied again at {flown:.1f} s of the flight', 32)


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
            log = Path(folder) / 'flight.csv'
            log.touch()
            announced = _perform(story, log)
            return _judge(story, announced, log)
    except Failure as failure:
        story.say(f'FAILED: {failure}', 31)
        return 1
    except KeyboardInterrupt:
        story.say('interrupted')
        return 130


def _interrupt(number: int, frame: object) -> None:
    raise KeyboardInterrupt


def _perform(story: Story, log: Path) -> list[tuple[str, float]]:
    """Run the three processes; return id and stamp of the violations logged, in order."""
    story.say('A quadrotor flies through wind. These are its requirements:')
    specification = build.read(BUNDLE).specification
    for item in specification.properties:
        story.paragraph(f'  {item.id}  ', item.title or item.text)
    story.say()
    with _process('monitor', f'spec:={BUNDLE}', 'use_sim_time:=true',
                  'log_violations:=false') as monitor, \
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
        'ROS_DOMAIN_ID': str(1 + os.getpid() % 100),
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        'RCUTILS_CONSOLE_OUTPUT_FORMAT': '[{severity}] {message}',
        'RCUTILS_COLORIZED_OUTPUT': '0',
        'PYTHONUNBUFFERED': '1',
    }


def _follow(story: Story, vehicle: Process, logger: Process) -> list[tuple[str, float]]:
    """Show the flight until it is over; return id and stamp of the violations logged."""
    announced: list[tuple[str, float]] = []
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


def _tell_violations(story: Story, logger: Process) -> list[tuple[str, float]]:
    announced = []
    for line in logger.new_lines():
        found = VIOLATED.fullmatch(_message(line))
        if found:
            story.violate(*found.groups())
            announced.append((found.group(1), float(found.group(2))))
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


def _judge(story: Story, announced: list[tuple[str, float]], log: Path) -> int:
    """Compare the announced violations with the reference semantics."""
    flight = [line.split(',') for line in log.read_text(encoding='utf-8').splitlines()]
    expected = list(_expected(build.read(BUNDLE).specification, flight))
    story.say()
    story.say(f'{len(flight)} messages were published. By the reference semantics they violate:')
    for seconds, name in expected:
        story.say(f'  {name}  at {seconds:.1f} s of the flight')
    if not expected or [name for name, _ in announced] != [name for _, name in expected]:
        raise Failure(f"announced was: {', '.join(name for name, _ in announced) or 'nothing'}")
    for (name, stamp), (seconds, _) in zip(announced, expected, strict=True):
        if abs(stamp - TAKES_OFF_AT - seconds) > TOLERANCE:
            raise Failure(f'{name} was announced for {stamp - TAKES_OFF_AT:.1f} s')
    story.say('Exactly these were announced.', 32)
    return 0


def _expected(specification: Specification,
              flight: list[list[str]]) -> Iterator[tuple[float, str]]:
    """Yield time and id of each occurrence due, in the order of time."""
    fed = {f'/{item.topic}': item.name for item in specification.signals}
    found = []
    for place, item in enumerate(specification.properties):
        read = {variable.name for variable in variables(item.formula)}
        ticks, trace = _rows(flight, fed, read)
        always = item.formula
        watched = always.argument if isinstance(always, Historically) else always
        history, = evaluate_timed([watched], TimedTrace(ticks, trace, ticks[-1]), item.feedback)
        began = max(next(float(seconds) for seconds, topic, _ in flight if fed[topic] == name)
                    for name in read)
        found += [(began + tick * 1e-9, place) for tick, value in history if not value]
    for seconds, place in sorted(found):
        yield seconds, specification.properties[place].id


def _rows(flight: list[list[str]], fed: Mapping[str, str],
          read: Set[str]) -> tuple[list[int], dict[str, list[float]]]:
    """Return the messages that a requirement reads as a timed trace, once all have a value."""
    values: dict[str, float] = {}
    times: list[float] = []
    trace: dict[str, list[float]] = {name: [] for name in read}
    for seconds, topic, value in flight:
        if fed[topic] not in read:
            continue
        values[fed[topic]] = _as_float32(float(value))
        if len(values) == len(read):
            times.append(float(seconds))
            for name in read:
                trace[name].append(values[name])
    return [round((time - times[0]) * 1e9) for time in times], trace


def _as_float32(value: float) -> float:
    rounded: float = struct.unpack('<f', struct.pack('<f', value))[0]
    return rounded


if __name__ == '__main__':
    sys.exit(main())
