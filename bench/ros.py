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
Compare the monitor, as a process in a graph, with minimal subscribers in C (rcl) and in rclpy.

The C programs of `bench/ros` are compiled with the headers of a ROS 2 installation or the wheels.
`load.c` publishes, subscribes to the answers and measures times; `floor.c` is the reference. In
each round every subject runs in its own process, with its own load generator, and with no other
node in the domain. A ratio compares subjects of one round; the table has the median over rounds.

    make bench-ros        (or: .venv/bin/python -m bench.ros [--rounds N] [--only NAME] [--json])
"""

from argparse import ArgumentParser
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
import ctypes
from dataclasses import asdict, dataclass, replace
import json
from operator import attrgetter
import os
from pathlib import Path
import re
from select import select
import signal
from statistics import median
import subprocess
import sys
from tempfile import TemporaryDirectory, TemporaryFile
import time
from typing import Any

from fret_monitor.build import generate_monitor, read
from fret_monitor.export.content import Options
from fret_monitor.export.ros2 import NODE_PACKAGES, ros2
from fret_monitor.export.ros2_table import packages_of
from fret_monitor.native.compiler import find_compiler
from fret_monitor.native.ros_files import linked, NODE_LIBRARIES, prefixes, rmw_library, searched
from fret_monitor.ros.settings.parameters import MONITOR_PARAMETERS

HERE = Path(__file__).resolve().parent
ROUNDS = 7
LOCK_TIMEOUT_S = 0.5  # of a subscriber, as of twist_mux
DOMAIN = '101'  # unless ROS_DOMAIN_ID is set; the tests use domains up to 100
RATE = 1000.0  # messages a second
SECONDS = 4.0
CLOUDS = 50.0  # point clouds a second
FLOOD = 30_000
REQUIREMENTS = 100
IDLE = 1.0  # s before the load, to measure the processor time of an idle process
DRAIN = 0.5  # s after the load, for the subject to process the queued messages
PATIENCE = 60.0
OPTIMIZATION = '-O2'  # of what is compiled

TOPICS = ('motor/current', 'windspeed')  # of config/quadrotor.yaml
UNREAD = 'never taken'
IN_CALLBACK = "rcl in C, taking inside the middleware's callback"
TIMEOUT = 0.05  # s
SILENCES = 10.0  # a second
IDLE_TOPICS = (1, 100, 500)
ROBOTS, ROBOT_RATE = 100, 20.0  # messages a second of each
SETTLE = 30.0  # s of quiet, before an idle node is measured
JOINED = 2.0  # s that another node is there
HANDLER = 'copilot/handlerpropEACH'
PACKAGES = ('std_msgs', 'sensor_msgs', 'diagnostic_msgs')
EXPORTED = 'exported node'
NATIVE = 'monitor, native:=true'
NATIVE_GOAL = '0.25 s'
IDLE_GOALS = {(1, 'monitor'): '6 ms/s', (100, 'monitor'): '10 ms/s', (500, 'monitor'): '20 ms/s',
              (1, EXPORTED): '2 ms/s', (100, EXPORTED): '3 ms/s', (500, EXPORTED): '6 ms/s'}


# -- the programs in C ----------------------------------------------------------------------------

def build(name: str, folder: Path) -> Path:
    """Compile a program of `bench/ros` into a folder, and return it."""
    return compiled(folder / name, [
        '-std=c99', '-D_POSIX_C_SOURCE=200809L', OPTIMIZATION, *searched(),
        str(HERE / 'ros' / f'{name}.c'), str(HERE / 'ros' / 'no_python.c'),
        *linked(['rcl', 'rcutils', 'rmw', 'rosidl_runtime_c'], PACKAGES)])


def compiled(program: Path, arguments: Sequence[str]) -> Path:
    """Compile and link a program, and return it."""
    done = subprocess.run([*find_compiler().command, *arguments, '-o', str(program)],
                          capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f'{program.name} cannot be built here:\n{done.stderr}')
    return program


def exported(bundle: Path, folder: Path) -> Path:
    """Compile the node of `export --to ros2` into a folder, and return it."""
    generated = generate_monitor(read(bundle, takes_instances=True))
    folder.mkdir(exist_ok=True)
    for name, text in ros2(generated, Options()).generated.items():
        (folder / Path(name).name).write_text(text, encoding='utf-8')
    own = {*generated.module.files, 'node_table.c'}
    objects = []
    for source in (*sorted(folder.glob('*.c')), HERE / 'ros' / 'no_python.c'):
        # What is the same for every bundle is compiled once.
        made = (folder if source.name in own else folder.parent) / f'{source.stem}.o'
        if not made.exists():
            compiled(made, ['-std=c99', OPTIMIZATION, '-ffp-contract=off', *searched(), '-c',
                            str(source)])
        objects.append(str(made))
    return compiled(folder / 'monitor', [
        *objects, *linked([*NODE_LIBRARIES, rmw_library()],
                          sorted({*NODE_PACKAGES, *packages_of(generated.manifest)})),
        '-lm', '-pthread'])


# -- processes ------------------------------------------------------------------------------------

@dataclass(frozen=True)
class Subject:
    """A measured program. A monitor publishes counts in /diagnostics, others print theirs."""

    name: str
    command: tuple[str, ...]
    is_monitor: bool = False


@dataclass(frozen=True)
class Sent:
    """The load's measurements of its messages and their answers; times are in nanoseconds."""

    count: int
    seconds: float
    answers: int
    p50: int
    p99: int


class Load:
    """The load generator: it answers each command with a line."""

    def __init__(self, program: Path, *arguments: str) -> None:
        """Start it, and wait until it has created its topics."""
        self._errors = TemporaryFile()  # noqa: SIM115  closed by `close`
        self.process = subprocess.Popen(
            [str(program), *arguments], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=self._errors, text=True,
            env={**os.environ, 'FASTRTPS_DEFAULT_PROFILES_FILE': str(HERE / 'ros' / 'load.xml')})
        # The load runs on one processor; the system places the subjects.
        os.sched_setaffinity(self.process.pid, {min(os.sched_getaffinity(0))})
        self.answer()

    def command(self, line: str) -> None:
        """Send a command, without waiting for its answer."""
        assert self.process.stdin is not None
        self.process.stdin.write(line + '\n')
        self.process.stdin.flush()

    def answer(self, of: 'Running | None' = None) -> str:
        """Return the answer to a command; fail if the subject `of` ends before."""
        assert self.process.stdout is not None
        while not select([self.process.stdout], [], [], 0.2)[0]:
            if of is not None and of.process.poll() is not None:
                raise SystemExit(f'it has ended, with status {of.process.returncode}\n')
        line = self.process.stdout.readline()
        if not line:
            self._errors.seek(0)
            raise SystemExit(self._errors.read().decode(errors='replace'))
        return line

    def ask(self, command: str, of: 'Running | None' = None) -> str:
        """Send a command and return the answer."""
        self.command(command)
        return self.answer(of)

    def send(self, count: int, rate: float) -> Sent:
        """Publish `count` messages, `rate` a second."""
        count_, seconds, answers, p50, p99 = self.ask(f'send {count} {rate}').split()
        return Sent(int(count_), float(seconds), int(answers), int(p50), int(p99))

    def counts(self, key: str) -> dict[str, int]:
        """Return the numbers that the subject publishes for a key in /diagnostics, by name."""
        pairs = (part.rpartition('=') for part in self.ask(f'tell {key}').strip().split('\t'))
        return {name.partition(': ')[2]: int(number) for name, _, number in pairs}

    def close(self) -> None:
        """End it."""
        assert self.process.stdin is not None and self.process.stdout is not None
        try:
            self.process.stdin.close()
            end(self.process)
        finally:
            self.process.stdout.close()
            self._errors.close()


class Running:
    """A subject's process."""

    def __init__(self, subject: Subject) -> None:
        """Start it."""
        self.subject = subject
        self._output = TemporaryFile()  # noqa: SIM115  closed by `close`
        self.began = time.monotonic_ns()
        self.process = subprocess.Popen(subject.command, stdin=subprocess.DEVNULL,
                                        stdout=self._output, stderr=subprocess.STDOUT)
        clock = ctypes.c_int()
        if ctypes.CDLL(None).clock_getcpuclockid(self.process.pid, ctypes.byref(clock)):
            raise SystemExit(f'{subject.name} ended at once')
        self._clock = clock.value

    def nanoseconds(self) -> int:
        """Return the processor time of all of its threads."""
        return time.clock_gettime_ns(self._clock)

    def kilobytes(self, key: str) -> int:
        """Return its memory: the resident size (VmRSS) or its peak (VmHWM)."""
        return kilobytes(self.process, key)

    def wait_for(self, words: str) -> None:
        """Wait until it has written these words; a monitor may have to compile first."""
        while words not in self._written():
            if self.process.poll() is not None:
                raise SystemExit(f'{self.subject.name} has ended:\n{self._written()}')
            time.sleep(0.1)

    def _written(self) -> str:
        size = os.fstat(self._output.fileno()).st_size
        return os.pread(self._output.fileno(), size, 0).decode(errors='replace')

    def close(self) -> str:
        """End it, and return its output."""
        self.process.send_signal(signal.SIGINT)
        end(self.process)
        return self._written()

    def kill(self) -> None:
        """Kill it if it still runs."""
        if self.process.poll() is None:
            self.process.kill()
            self.process.wait()
        self._output.close()


def kilobytes(process: subprocess.Popen[str] | subprocess.Popen[bytes], key: str) -> int:
    """Return a size from /proc/PID/status."""
    text = Path(f'/proc/{process.pid}/status').read_text(encoding='ascii')
    found = [line for line in text.splitlines() if line.startswith(f'{key}:')]
    if not found:
        raise SystemExit(f'it has ended, with status {process.wait()}\n')  # and has no memory
    return int(found[0].split()[1])


def end(process: subprocess.Popen[str] | subprocess.Popen[bytes]) -> None:
    """Wait for the end of a process, for a limited time."""
    try:
        process.wait(PATIENCE)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


@contextmanager
def both(load: Load, running: Running) -> Iterator[list[str]]:
    """End both after the block, and put the output of the subject into the yielded list."""
    written: list[str] = []
    try:
        yield written
    except SystemExit as failure:
        load.process.kill()
        written.append(running.close())
        raise SystemExit(f'{running.subject.name}: {failure}{written[0]}') from None
    else:
        written.append(running.close())
    finally:
        running.kill()
        load.close()


# -- one run --------------------------------------------------------------------------------------

@dataclass(frozen=True)
class Work:
    """The messages to publish. A rate of 0 means as fast as possible."""

    topics: tuple[str, ...]
    count: int
    rate: float
    content: str = 'float32'
    depth: int = 100
    echo: str | None = None
    reliability: str = 'reliable'
    is_relayed: bool = False  # what is published on `echo` has the type of the messages

    @property
    def arguments(self) -> tuple[str, ...]:
        """The arguments for `load.c` and `floor.c`."""
        return ('--topics', ','.join(self.topics), '--type', self.content,
                '--depth', str(self.depth), '--reliability', self.reliability)


@dataclass(frozen=True)
class Sample:
    """The measurements of one run of a subject: microseconds, messages, megabytes."""

    sent: int
    counted: int
    answers: int | None  # None if no answers are expected
    cpu: float
    p50: float
    p99: float
    resident: float
    highest: float
    way: str = ''  # how a monitor takes its messages, read from its log


def sample(load_program: Path, work: Work, subject: Subject) -> Sample:
    """Run a subject with its own load, and return the measurements."""
    load = Load(load_program, *work.arguments,
                *(('--relayed' if work.is_relayed else '--echo', work.echo)
                  if work.echo is not None else ()))
    running = Running(subject)
    counted = None
    with both(load, running) as written:
        load.ask('match', running)
        begin, cpu = time.monotonic_ns(), running.nanoseconds()
        time.sleep(IDLE)
        idle = (running.nanoseconds() - cpu) / (time.monotonic_ns() - begin)
        begin, cpu = time.monotonic_ns(), running.nanoseconds()
        sent = load.send(work.count, work.rate)
        time.sleep(DRAIN)
        taken = running.nanoseconds() - cpu - idle * (time.monotonic_ns() - begin)
        resident, highest = running.kilobytes('VmRSS'), running.kilobytes('VmHWM')
        if subject.is_monitor:
            counted = sum(load.counts('received').values())
    if counted is None:
        counted = last_number(written[0], subject)
    answers = None if work.echo is None else sent.answers
    return Sample(sent.count, counted, answers, taken / sent.count / 1e3,
                  sent.p50 / 1e3, sent.p99 / 1e3, resident / 1e3, highest / 1e3,
                  way_of(written[0]))


def way_of(text: str) -> str:
    """Return where messages were taken according to a monitor's log; '' for other nodes."""
    found = re.search(r'messages are taken in C, in(side| a thread)', text)
    return '' if found is None else {'side': 'in callbacks', ' a thread': 'in a thread'}[found[1]]


def last_number(text: str, subject: Subject) -> int:
    """Return the number in the last line."""
    lines = text.split()
    if not lines or not lines[-1].isdecimal():
        raise SystemExit(f'{subject.name} did not print its counts:\n{text}')
    return int(lines[-1])


# -- subjects -------------------------------------------------------------------------------------

@dataclass(frozen=True)
class Bench:
    """The C programs, the folder for bundles, and the sizes of the measurements."""

    load: Path
    floor: Path
    folder: Path
    rounds: int
    rate: float = RATE
    seconds: float = SECONDS
    flood: int = FLOOD
    idle_topics: tuple[int, ...] = IDLE_TOPICS
    settle: float = SETTLE

    def work(self, topics: tuple[str, ...], rate: float, content: str = 'float32',
             depth: int = 100, echo: str | None = None) -> Work:
        """Return the messages to publish at a rate for the length of a run."""
        return Work(topics, int(rate * self.seconds), rate, content, depth, echo)

    def unread(self, work: Work, *arguments: str) -> Subject:
        """Return a subscriber that takes no message: it measures the middleware alone."""
        return self.bare(work, '--take', 'no', *arguments, name=UNREAD)

    def bare(self, work: Work, *arguments: str, name: str = 'rcl in C') -> Subject:
        """Return the subscriber in C."""
        return Subject(name, (str(self.floor), *work.arguments, *arguments))

    def callback(self, work: Work, *arguments: str) -> Subject:
        """Return the subscriber in C that takes messages inside the middleware's callback."""
        return self.bare(work, '--take', 'callback', *arguments, name=IN_CALLBACK)

    def rclpy(self, work: Work, *arguments: str) -> Subject:
        """Return the subscriber in Python."""
        return Subject('rclpy', (
            sys.executable, str(HERE / 'listener.py'), '--topics', ','.join(work.topics),
            '--depth', str(work.depth), *arguments))

    def monitors(self, bundle: Path) -> list[Subject]:
        """Return the monitor, once for each way in which it can take messages."""
        command = (str(executable('monitor')), '--ros-args', '-p', f'spec:={bundle}')
        if 'hot_path' not in MONITOR_PARAMETERS:
            return [Subject('monitor', command, is_monitor=True)]
        return [Subject(name, (*command, '-p', f"hot_path:='{way}'"), is_monitor=True)
                for name, way in (('monitor', 'auto'), ('monitor, hot_path off', 'off'))]

    def all_monitors(self, bundle: Path) -> list[Subject]:
        """Return the monitors, and the node of `export --to ros2`."""
        return [*self.monitors(bundle), self.exported(bundle)]

    def native(self, bundle: Path) -> Subject:
        """Return the monitor that becomes a node in C."""
        return Subject(NATIVE, (str(executable('monitor')), '--ros-args', '-p', f'spec:={bundle}',
                                '-p', 'native:=true'), is_monitor=True)

    def exported(self, bundle: Path) -> Subject:
        """Return the node of `export --to ros2`."""
        program = exported(bundle, self.folder / f'{bundle.stem}_node')
        return Subject(EXPORTED, (str(program),), is_monitor=True)

    def gate(self, name: str, inputs: str, formula: str, otherwise: str) -> Subject:
        """Return a gate from `raw` to `relayed`."""
        kind = re.search(r'type: ([\w/]+)', inputs)
        assert kind is not None
        path = self.folder / f'{name}.yaml'
        path.write_text(
            f'format: 1\n{inputs}requirements:\n  - {{id: EACH, ptltl: "{formula}"}}\n'
            f'gates:\n  g: {{from: raw, to: relayed, type: {kind[1]}, keep: [EACH], '
            f'otherwise: {otherwise}}}\n', encoding='utf-8')
        return Subject('gate', (
            str(executable('gate')), '--ros-args', '-p', f'spec:={path}', '-p',
            'log_violations:=false'), is_monitor=True)

    def bundle(self, name: str, inputs: str, requirements: str) -> Path:
        """Write a bundle and return its path."""
        path = self.folder / f'{name}.yaml'
        path.write_text(f'format: 1\ninputs:\n{inputs}requirements:\n{requirements}',
                        encoding='utf-8')
        return path


def executable(name: str) -> Path:
    """Return the executable that `ros2 run` would run."""
    for prefix in prefixes():
        path = prefix / 'lib' / 'fret_monitor' / name
        if path.is_file():
            return path
    raise SystemExit(f'the executable `{name}` is not installed: make setup, or colcon build')


def float_input(name: str, topic: str, more: str = '') -> str:
    """Return the line of an input with an initial value, so that every message is a step."""
    return f'  {name}: {{topic: {topic}, type: std_msgs/msg/Float32, initial: 0.0{more}}}\n'


# -- the figures ----------------------------------------------------------------------------------

@dataclass(frozen=True)
class Row:
    """A row of a table: the median, the minimum and maximum of the rounds, and the ratio."""

    figure: str
    subject: str
    unit: str
    value: float
    lowest: float
    highest: float
    ratio: float | None = None
    bar: str = ''
    note: str = ''


Samples = dict[str, list[Sample]]


def rounds_of(bench: Bench, work: Work, subjects: Sequence[Subject]) -> Samples:
    """Run all subjects, one after the other, in each round."""
    found: Samples = {subject.name: [] for subject in subjects}
    for number in range(bench.rounds):
        for subject in subjects:
            say(f'round {number + 1} of {bench.rounds}: {subject.name}')
            found[subject.name].append(sample(bench.load, work, subject))
    return found


def say(text: str) -> None:
    """Show the progress on a terminal, since a run takes minutes."""
    if sys.stderr.isatty():
        print(f'\r\x1b[K{text}', end='', file=sys.stderr, flush=True)


def rows(figure: str, unit: str, found: Samples, value: Callable[[Sample], float],
         bar: str = '') -> Iterator[Row]:
    """Yield a row for each subject; ratios are to the first subject of the same round."""
    yard = [value(item) for item in next(iter(found.values()))]
    for name, samples in found.items():
        values = [value(item) for item in samples]
        ratio = median(a / b if b else float('inf') for a, b in zip(values, yard))
        yield Row(figure, name, unit, median(values), min(values), max(values), ratio,
                  bar if name.startswith(('monitor', 'gate')) else '', noted(name, samples))


def noted(name: str, samples: Sequence[Sample]) -> str:
    """Return a note: how messages were taken, and how many messages or answers are missing."""
    messages = sum(item.sent - item.counted for item in samples if name != UNREAD)
    answers = sum(item.sent - item.answers for item in samples
                  if item.answers is not None and name != UNREAD)
    ways = sorted({item.way for item in samples if item.way})
    return ', '.join([*ways, *(text for text, number in (
        (f'{messages} messages missing', messages),
        (f'{answers} answers missing', answers)) if number)])


def processor_rows(case: str, found: Samples, bar: str) -> Iterator[Row]:
    """Yield rows of processor time: the total, and the excess over one that takes nothing."""
    yield from rows(f'CPU a message, {case}', 'us', found, lambda item: item.cpu, bar)
    above = {name: [replace(item, cpu=item.cpu - idle.cpu)
                    for item, idle in zip(samples, found[UNREAD])]
             for name, samples in found.items() if name != UNREAD}
    yield from rows(f'the same, above {UNREAD}', 'us', above, lambda item: item.cpu, bar)


def quiet(bench: Bench) -> Iterator[Row]:
    """Measure the running example without violations, and the memory afterwards."""
    work = bench.work(TOPICS, bench.rate)
    example = HERE.parent / 'config' / 'quadrotor.yaml'
    found = rounds_of(bench, work, [
        bench.bare(work), bench.unread(work), bench.callback(work), *bench.all_monitors(example),
        bench.rclpy(work)])
    yield from processor_rows('no violation', found, '1.0')
    for figure, name in (('resident memory (VmRSS)', 'resident'),
                         ('its highest (VmHWM)', 'highest')):
        yield from rows(figure, 'MB', found, attrgetter(name))


def violations(bench: Bench) -> Iterator[Row]:
    """Measure one published violation for each message: processor time and latency."""
    work = bench.work(TOPICS, bench.rate, echo=HANDLER)
    bundle = bench.bundle(
        'each', float_input('current', TOPICS[0]) + float_input('wind', TOPICS[1]),
        '  - {id: EACH, ptltl: "current < 0.0 & wind < 0.0"}\n')
    publish = ('--publish', HANDLER)
    found = rounds_of(bench, work, [
        bench.bare(work, *publish), bench.unread(work, *publish),
        bench.callback(work, *publish), *bench.all_monitors(bundle), bench.rclpy(work, *publish)])
    yield from processor_rows('a violation each', found, '1.1')
    del found[UNREAD]
    for name in ('p50', 'p99'):
        yield from rows(f'latency to the Empty, {name}', 'us', found, attrgetter(name), '1.1')


def deadlines(bench: Bench) -> Iterator[Row]:
    """Measure the time from the end of a timeout to its Empty, and an idle monitor's work."""
    work = Work(TOPICS[:1], int(bench.seconds * SILENCES), SILENCES, echo=HANDLER)
    more = f', timeout: {TIMEOUT}, startup: {TIMEOUT}, stale: violate'
    bundle = bench.bundle(
        'silent', float_input('current', TOPICS[0], more),
        '  - {id: EACH, report: onset, ptltl: "current > 0.0"}\n')
    found = rounds_of(bench, work, [
        bench.callback(work, '--publish', HANDLER, '--after', str(TIMEOUT)),
        *bench.all_monitors(bundle)])
    late = {name: [replace(item, p50=item.p50 - 1e6 * TIMEOUT, p99=item.p99 - 1e6 * TIMEOUT)
                   for item in samples] for name, samples in found.items()}
    for name in ('p50', 'p99'):
        yield from rows(
            f'from the end of a timeout to its Empty, {name}', 'us', late, attrgetter(name), '1.1')


def idle(bench: Bench) -> Iterator[Row]:
    """Measure the work of nodes to which nothing comes, with a timeout on each topic."""
    more = f', timeout: {TIMEOUT * 10}, startup: {TIMEOUT * 10}'
    for n in bench.idle_topics:
        topics = tuple(f'x{i}' for i in range(n))
        bundle = bench.bundle(
            f'idle{n}', ''.join(float_input(name, name, more) for name in topics),
            ''.join(f'  - {{id: R{i}, ptltl: "x{i} < 1.0"}}\n' for i in range(n)))
        work = Work(topics, 0, 0.0)
        subjects = [bench.rclpy(work), bench.bare(work), bench.monitors(bundle)[0],
                    bench.exported(bundle)]
        found: dict[str, list[tuple[float, float]]] = {item.name: [] for item in subjects}
        for number in range(bench.rounds):
            for subject in subjects:
                say(f'{n} topics, round {number + 1} of {bench.rounds}: {subject.name}')
                found[subject.name].append(at_rest(bench, subject))
        for place, case in enumerate(('idle', 'idle, other nodes join and leave')):
            for name, pairs in found.items():
                yardstick = 'rclpy' if name == 'monitor' else 'rcl in C'
                values = [pair[place] for pair in pairs]
                yield Row(
                    f'{case}, {n} topics with a timeout', name, 'ms/s', median(values),
                    min(values), max(values),
                    median(a / b[place] for a, b in zip(values, found[yardstick])),
                    '' if place else IDLE_GOALS.get((n, name), ''))


def fleet(bench: Bench) -> Iterator[Row]:
    """Measure a requirement of each robot: beside that of one robot, and of a hundred."""
    def bundle(name: str, topic: str, formula: str, most: int) -> Path:
        path = bench.bundle(name, float_input('speed', topic),
                            f'  - {{id: EACH, ptltl: "{formula}"}}\n')
        if most:
            text = path.read_text(encoding='utf-8')
            path.write_text(f'{text}for_each: {{robot: {{most: {most}}}}}\n', encoding='utf-8')
        return path

    one = bench.work(('r0/speed',), bench.rate)
    for case, formula in (('no violation', 'speed > -1.0'), ('a violation each', 'speed < 0.0')):
        name = case.split()[-1]
        work = one if name == 'violation' else replace(one, echo=HANDLER)
        plain, keyed = (bench.monitors(bundle(f'{kind}_{name}', topic, formula, most))[0]
                        for kind, topic, most in (('plain', '/r0/speed', 0),
                                                  ('keyed', '"/{robot}/speed"', 100)))
        found = rounds_of(bench, work, [
            replace(plain, name='one requirement'), replace(keyed, name='monitor, for_each')])
        yield from rows(
            f'CPU a message of a robot, {case}', 'us', found, attrgetter('cpu'), '1.1')
    robots = tuple(f'r{number}/speed' for number in range(ROBOTS))
    keyed_path = bundle('robots', '"/{robot}/speed"', 'speed < 0.0', ROBOTS)
    found = rounds_of(bench, bench.work(robots, ROBOTS * ROBOT_RATE, echo=HANDLER), [
        bench.monitors(keyed_path)[0], bench.exported(keyed_path)])
    for name in ('p50', 'p99'):
        yield from rows(f'{ROBOTS} robots at {ROBOT_RATE:.0f} Hz, latency to the Empty, {name}',
                        'us', found, attrgetter(name))


def at_rest(bench: Bench, subject: Subject) -> tuple[float, float]:
    """Return milliseconds a second of a node at rest, and while others join and leave."""
    running = Running(subject)
    try:
        if subject.is_monitor:
            running.wait_for('watching')
        time.sleep(bench.settle)
        quiet = milliseconds_a_second(running, bench.seconds)
        joining = Subject('other', (str(bench.floor), '--topics', 'other'))
        joined = []
        for _ in range(max(1, int(bench.seconds / JOINED))):
            other = Running(joining)
            try:
                joined.append(milliseconds_a_second(running, JOINED))
                other.close()
            finally:
                other.kill()
        running.close()
        return quiet, sum(joined) / len(joined)
    finally:
        running.kill()


def milliseconds_a_second(running: Running, seconds: float) -> float:
    """Return the processor time of a process within the next seconds."""
    began, spent = time.monotonic_ns(), running.nanoseconds()
    time.sleep(seconds)
    return 1e3 * (running.nanoseconds() - spent) / (time.monotonic_ns() - began)


def cloud(bench: Bench) -> Iterator[Row]:
    """Measure reading a field of a large message, above the cost of the middleware alone."""
    work = bench.work(('points',), CLOUDS, content='cloud', depth=10)
    bundle = bench.bundle(
        'cloud', '  sec:\n    topic: points\n    type: sensor_msgs/msg/PointCloud2\n'
        '    field: header.stamp.sec\n    qos: {depth: 10}\n',
        '  - {id: R, ptltl: "sec >= 0"}\n')
    found = rounds_of(bench, work, [
        bench.bare(work), bench.unread(work), *bench.all_monitors(bundle)])
    yield from processor_rows('1 MB PointCloud2', found, '1.0')


def flood(bench: Bench) -> Iterator[Row]:
    """Measure how many messages of a flood are received with queues of ten."""
    work = Work(TOPICS[:1], bench.flood, 0.0, depth=10)
    bundle = bench.bundle(
        'flood', float_input('current', TOPICS[0], ', qos: {depth: 10}'),
        '  - {id: R, ptltl: "current >= 0.0"}\n')
    found = rounds_of(bench, work, [
        bench.bare(work), *bench.all_monitors(bundle), bench.rclpy(work)])
    for row in rows('kept of a flood, depth 10', '%', found,
                    lambda item: 100.0 * item.counted / item.sent, 'at least 90 %'):
        yield replace(row, note=row.note.partition(',')[0] if row.note.startswith('in ') else '')


@dataclass(frozen=True)
class Start:
    """Seconds from the start of the process; `cpu`: of processor time until `every`."""

    first: float
    every: float
    step: float
    cpu: float


def gate(bench: Bench) -> Iterator[Row]:
    """Measure a relay, and the time to a substitute; one of rclcpp (topic_tools) is not here."""
    number = 'inputs:\n  x: {topic: raw, type: std_msgs/msg/Float32, timeout: 5}\n'
    stamp = ('inputs:\n  x: {topic: raw, type: sensor_msgs/msg/PointCloud2, '
             'field: header.stamp.sec, qos: {depth: 10}}\n')
    for case, content, rate, inputs, depth in (
            ('4 bytes', 'float32', bench.rate, number, 100),
            ('1 MB', 'cloud', CLOUDS, stamp, 10)):
        work = replace(bench.work(('raw',), rate, content, depth, 'relayed'), is_relayed=True)
        found = rounds_of(bench, work, [
            bench.bare(work, '--relay', 'relayed', name='bare relay, rcl in C'),
            bench.gate(f'gate_{content}', inputs, 'x >= 0', 'drop')])
        yield from rows(f'relayed, {case}: latency, median', 'us', found, attrgetter('p50'), '1.1')
        yield from rows(f'relayed, {case}: latency, 99 %', 'us', found, attrgetter('p99'), '1.1')
        yield from rows(f'relayed, {case}: CPU a message', 'us', found, attrgetter('cpu'), '1.15')
    work = replace(bench.work(('raw',), bench.rate, echo='relayed'), is_relayed=True)
    found = rounds_of(bench, work, [
        bench.gate('gate_withholds', number, 'x > 1e30', '{substitute: {data: 1.0}}')])
    yield from rows('from a violating message to the substitute, median', 'us', found,
                    attrgetter('p50'))
    yield from rows('the same, 99 %', 'us', found, attrgetter('p99'))
    found_s = [killed(bench) for _ in range(bench.rounds)]
    yield Row(f'kill -9 after a message of the lock until it has expired, timeout '
              f'{LOCK_TIMEOUT_S:g} s', 'gate', 's',
              median(found_s), min(found_s), max(found_s))


def killed(bench: Bench) -> float:
    """Return the seconds from kill -9 of a gate until its lock has expired at a subscriber."""
    import rclpy
    from std_msgs.msg import Bool, Float32
    path = bench.folder / 'gate_killed.yaml'
    path.write_text(
        'format: 1\ninputs:\n  x: {topic: raw, type: std_msgs/msg/Float32}\n'
        'actions:\n  stop: {lock: {topic: e_stop, rate: 10}}\n'
        'requirements:\n  - {id: EACH, ptltl: "x >= 0", on_violation: [stop]}\n'
        'gates:\n  g: {from: raw, to: relayed, type: std_msgs/msg/Float32, keep: [EACH]}\n',
        encoding='utf-8')
    received: list[tuple[float, bool]] = []
    rclpy.init()
    node: Any = rclpy.create_node('base')
    node.create_subscription(
        Bool, 'e_stop', lambda message: received.append((time.monotonic(), message.data)), 10)
    raw = node.create_publisher(Float32, 'raw', 10)
    running = Running(Subject('gate', (
        str(executable('gate')), '--ros-args', '-p', f'spec:={path}'), is_monitor=True))
    try:
        end_of_wait = time.monotonic() + 60.0
        while sum(not is_locked for _, is_locked in received) < 10:
            raw.publish(Float32(data=1.0))
            rclpy.spin_once(node, timeout_sec=0.02)
            if time.monotonic() > end_of_wait:
                raise SystemExit('the lock of the gate has not opened')
        running.process.kill()
        began = time.monotonic()
        while time.monotonic() < received[-1][0] + LOCK_TIMEOUT_S:
            rclpy.spin_once(node, timeout_sec=0.001)
        return time.monotonic() - began
    finally:
        running.kill()
        node.destroy_node()
        rclpy.shutdown()


def start(bench: Bench) -> Iterator[Row]:
    """Measure the start with 100 requirements that were compiled before."""
    for title, topics in (
            ('on one topic', ('x0',)),
            ('on 100 topics', tuple(f'x{i}' for i in range(REQUIREMENTS)))):
        handler = 'copilot/handlerpropR0'
        work = Work(topics, 1, 0.0, echo=handler)
        bundle = bench.bundle(
            f'start{len(topics)}',
            ''.join(float_input(f'x{i}', topic) for i, topic in enumerate(topics)),
            ''.join(f'  - {{id: R{i}, ptltl: "x{i % len(topics)} < -{i}.0"}}\n'
                    for i in range(REQUIREMENTS)))
        subjects = [bench.bare(work, '--publish', handler), *bench.all_monitors(bundle),
                    bench.native(bundle), bench.rclpy(work, '--publish', handler)]
        for subject in subjects:
            started(bench.load, work, subject)  # compiles, and fills the file system's cache
        found: dict[str, list[Start]] = {subject.name: [] for subject in subjects}
        for number in range(bench.rounds):
            for subject in subjects:
                say(f'round {number + 1} of {bench.rounds}: {subject.name}')
                found[subject.name].append(started(bench.load, work, subject))
        for figure, key, bar in (('first subscription', 'first', '1.25'),
                                 ('all subscriptions', 'every', ''), ('first step', 'step', ''),
                                 ('all subscriptions, processor time', 'cpu', '1.25')):
            for name, starts in found.items():
                values = [float(getattr(item, key)) for item in starts]
                yield Row(f'start to {figure}, {REQUIREMENTS} requirements {title}', name, 's',
                          median(values), min(values), max(values),
                          median(value / float(getattr(bare, key))
                                 for value, bare in zip(values, found['rclpy'])),
                          NATIVE_GOAL if name == NATIVE and key == 'first'
                          else bar if name.startswith('monitor') and name != NATIVE else '')


def started(load_program: Path, work: Work, subject: Subject) -> Start:
    """Start a subject and return when it was ready."""
    assert work.echo is not None
    load = Load(load_program, *work.arguments, '--echo', work.echo)
    load.command('appear')
    running = Running(subject)
    with both(load, running):
        first, every = map(int, load.answer(running).split())
        cpu = running.nanoseconds()
        step = int(load.ask('step', running))
    moments = [(moment - running.began) / 1e9 for moment in (first, every, step)]
    return Start(moments[0], moments[1], moments[2], cpu / 1e9)


FIGURES: dict[str, Callable[[Bench], Iterator[Row]]] = {
    'quiet': quiet, 'violations': violations, 'deadlines': deadlines, 'idle': idle,
    'cloud': cloud, 'fleet': fleet, 'flood': flood, 'gate': gate, 'start': start,
}


# -- what is printed ------------------------------------------------------------------------------

def show(found: Sequence[Row]) -> None:
    """Print a Markdown table."""
    show_cells('figure', 'subject', 'median', 'rounds', 'ratio', 'to reach', '')
    print('|---|---|---|---|---|---|---|')
    for row in found:
        show_cells(row.figure, row.subject, f'{number(row.value)} {row.unit}',
                   f'{number(row.lowest)} to {number(row.highest)}',
                   '' if row.ratio is None else f'{row.ratio:.2f}', row.bar, row.note)


def show_cells(*cells: str) -> None:
    """Print a row."""
    print(f"| {' | '.join(cells)} |")


def number(value: float) -> str:
    """Return a number with three significant digits."""
    return f'{value:.0f}' if abs(value) >= 100 else f'{value:.1f}' if abs(value) >= 10 \
        else f'{value:.2f}'


@contextmanager
def prepared(rounds: int, rate: float = RATE, seconds: float = SECONDS,
             flood: int = FLOOD) -> Iterator[Bench]:
    """Build the programs in a temporary folder, which is also the home of the monitors."""
    before = dict(os.environ)
    with TemporaryDirectory() as name:
        folder = Path(name)
        os.environ.setdefault('ROS_DOMAIN_ID', DOMAIN)
        os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
        os.environ['ROS_HOME'] = str(folder / 'home')
        os.environ['ROS_LOG_DIR'] = str(folder / 'log')
        os.environ.pop('PYTHONDONTWRITEBYTECODE', None)  # an installation has the bytecode
        try:
            yield Bench(build('load', folder), build('floor', folder), folder, rounds, rate,
                        seconds, flood)
        finally:
            os.environ.clear()
            os.environ.update(before)


def main() -> int:
    """Measure all, or one, and print a table or JSON."""
    parser = ArgumentParser(description='Time the monitor beside bare rcl in C, and rclpy.')
    parser.add_argument('--rounds', type=int, default=ROUNDS)
    parser.add_argument('--rate', type=float, default=RATE,
                        help='messages a second; those of large messages stay')
    parser.add_argument('--only', choices=FIGURES, metavar='NAME', help=', '.join(FIGURES))
    parser.add_argument('--json', action='store_true')
    options = parser.parse_args()
    with prepared(options.rounds, options.rate) as bench:
        found = [row for name, figure in FIGURES.items() if options.only in (None, name)
                 for row in figure(bench)]
    say('')
    if options.json:
        print(json.dumps([asdict(row) for row in found]))
    else:
        show(found)
    return 0


if __name__ == '__main__':
    sys.exit(main())
