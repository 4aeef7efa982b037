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
Run the node and `simulate` for a long time, and compare verdicts with the reference evaluator.

The values repeat every turn. Each formula looks back less than a turn, or stays false once it is
false, so that the reference verdicts of two turns determine those of all later turns. For the
node, the load (`bench/ros/load.c`) counts the violations of one requirement and compares their
number after each batch; at the end the counts in /diagnostics are compared. For `simulate`, every
verdict is compared, under the policy timed also the instants at which one changes: rows come at
random times, from a nanosecond to seconds apart. Memory is measured throughout and must not grow
in the second half.

    make soak        (or: .venv/bin/python -m bench.soak [--messages N] [--only PART])
"""

from argparse import ArgumentParser
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import accumulate, chain, islice
from pathlib import Path
from random import Random
import subprocess
import sys
from threading import Thread
import time
from typing import IO, TypeAlias

from bench.ros import Bench, both, kilobytes, Load, prepared, Running, say, Subject
from fret_monitor.build import read
from fret_monitor.logic.evaluate import verdicts
from fret_monitor.logic.timed import evaluate_timed, TimedTrace, verdict_rows
from fret_monitor.traces.csv_trace import seconds_text

MESSAGES = 10_000_000
TURN = 1000  # rows until the values repeat
BATCH = 200  # messages between comparisons; the node's queue holds five times as many
TIMED_SHARE = 10  # of the rows, since each is written with its time and the changes after it
PARTS = 20  # measurements of the memory
GROWTH = 2.0  # MB by which the second half may exceed the first; a byte a message would be 5
HANDLER = 'copilot/handlerpropR0'
REQUIREMENTS = """\
  - {id: R0, ptltl: "(x > 0.6) -> O[1,9] (x < 0.1)"}
  - {id: R1, ptltl: "H[0,5] x < 0.9"}
  - {id: R2, ptltl: "(x > 0.2) S[3,12] (x > 0.7)"}
  - {id: R3, ptltl: "x > 0.3 | Y Z (x < 0.5 T[0,7] x > 0.1)"}
  - {id: R4, fretish: "upon x > 0.9 node shall within 4 ticks satisfy x <= 0.2"}
"""
TIMED = """\
format: 1
evaluation: {policy: timed, unit: 1}
inputs:
  x: {topic: x, type: std_msgs/msg/Float32, max_rate: 1e9}
requirements:
  - {id: R0, ptltl: "(x > 0.6) -> O[100 ms, 900 ms] (x < 0.1)"}
  - {id: R1, ptltl: "H[0, 0.5 s] x < 0.9"}
  - {id: R2, ptltl: "(x > 0.2) S[50 ms, 12 s] (x > 0.7)"}
  - {id: R3, ptltl: "x > 0.3 | Y Z (x < 0.5 T[0, 7 s] x > 0.1)"}
  - {id: R4, fretish: "upon x > 0.9 node shall within 4 seconds satisfy x <= 0.2"}
  - {id: R5, ptltl: "(x < 0.3) T[>= 150 ms] (x > 0.05)"}
  - {id: R6, ptltl: "O[100 ns, 100 ns] (x > 0.5)"}
"""
# Between two rows of a turn, in ns: bounds of the requirements, next to them, and others.
GAPS_NS = (1, 2, 99, 100, 101, 10 ** 6, 10 ** 7, 99_999_999, 10 ** 8, 10 ** 8 + 1, 3 * 10 ** 8)
PAUSE_NS = 20 * 10 ** 9  # after a turn; longer than all bounds

Verdicts: TypeAlias = tuple[bool, ...]


@dataclass(frozen=True)
class Turn:
    """The values of a turn, and the verdicts of each row: the first time, and later."""

    names: tuple[str, ...]
    values: tuple[float, ...]
    first: tuple[Verdicts, ...]
    later: tuple[Verdicts, ...]

    headings = 'x\n', 'step'  # of traces, and of the first column of verdicts

    def violations(self, messages: int) -> dict[str, int]:
        """Return the number of steps at which each requirement is violated."""
        turns, rest = divmod(messages, TURN)
        rows = [*self.first[:messages],
                *(self.later[:rest] if turns else ())]
        return {name: sum(not row[place] for row in rows)
                + max(turns - 1, 0) * sum(not row[place] for row in self.later)
                for place, name in enumerate(self.names)}

    def lines(self, rows: int) -> Iterator[str]:
        """Yield the rows of a trace."""
        lines = [f'{value!r}\n' for value in self.values]
        return (lines[row % TURN] for row in range(rows))

    def verdict_lines(self, rows: int) -> Iterator[str]:
        """Yield the verdicts of a trace, as `simulate` writes them."""
        first, later = ([flags(row) for row in part] for part in (self.first, self.later))
        return (f'{row},{(first if row < TURN else later)[row % TURN]}' for row in range(rows))


@dataclass(frozen=True)
class TimedTurn:
    """
    The rows of a turn (ns since its begin, value), and how long it lasts, in ns.

    `first` and `later` have the verdicts at each row and each change, with their instants.
    """

    names: tuple[str, ...]
    rows: tuple[tuple[int, float], ...]
    length: int
    first: tuple[tuple[int, Verdicts], ...]
    later: tuple[tuple[int, Verdicts], ...]

    headings = 'time,x\n', 'time'

    def violations(self, rows: int) -> dict[str, int]:
        """Return the number of lines at which each requirement is violated."""
        counts = Counter(row for _, row in self._verdicts(rows))
        return {name: sum(count for row, count in counts.items() if not row[place])
                for place, name in enumerate(self.names)}

    def lines(self, rows: int) -> Iterator[str]:
        """Yield the rows of a trace."""
        for row in range(rows):
            tick, value = self.rows[row % TURN]
            yield f'{seconds_text(row // TURN * self.length + tick)},{value!r}\n'

    def verdict_lines(self, rows: int) -> Iterator[str]:
        """Yield the verdicts of a trace, as `simulate` writes them."""
        return (f'{seconds_text(instant)},{flags(row)}' for instant, row in self._verdicts(rows))

    def _verdicts(self, rows: int) -> Iterator[tuple[int, Verdicts]]:
        turns, rest = divmod(rows - 1, TURN)
        last = turns * self.length + self.rows[rest][0]
        for begin in range(0, last + 1, self.length):
            for tick, row in self.later if begin else self.first:
                if begin + tick <= last:
                    yield begin + tick, row


def flags(row: Verdicts) -> str:
    """Return verdicts as the end of a line of `simulate`."""
    return ','.join(str(int(flag)) for flag in row) + '\n'


@dataclass(frozen=True)
class Result:
    """The result of a part of the run; memory in MB, in its first and second half."""

    title: str
    messages: int
    seconds: float
    before: float
    after: float
    violations: int

    @property
    def is_flat(self) -> bool:
        """Whether memory did not grow."""
        return self.after <= self.before + GROWTH


def turn_of(bundle: Path) -> Turn:
    """Make a turn of values, and compute its verdicts with the reference evaluator."""
    draw = Random(20261121)
    values = tuple(draw.randrange(1024) / 1024 for _ in range(TURN))  # exact in float32
    properties = read(bundle).specification.properties
    columns = [verdicts(item.formula, {'x': values * 3}) for item in properties]
    turns = [tuple(zip(*(column[k * TURN:(k + 1) * TURN] for column in columns)))
             for k in range(3)]
    assert turns[1] == turns[2]
    return Turn(tuple(item.id for item in properties), values, turns[0], turns[1])


def timed_turn_of(bundle: Path) -> TimedTurn:
    """Make a turn of values at random times, and compute its verdicts with the reference."""
    draw = Random(20261122)
    ticks = [0, *accumulate(draw.choice(GAPS_NS) for _ in range(TURN - 1))]
    length = ticks[-1] + PAUSE_NS
    values = [draw.randrange(1024) / 1024 for _ in ticks]
    properties = read(bundle).specification.properties
    trace = TimedTrace([k * length + tick for k in range(3) for tick in ticks],
                       {'x': values * 3}, 3 * length - 1)
    found = verdict_rows(evaluate_timed([item.formula for item in properties], trace), trace)
    turns = [tuple((tick - k * length, tuple(flag is True for flag in row)) for tick, row in found
                   if k * length <= tick < (k + 1) * length) for k in range(3)]
    assert turns[1] == turns[2]
    return TimedTurn(tuple(item.id for item in properties),
                     tuple(zip(ticks, values, strict=True)), length, turns[0], turns[1])


def parts_of(number: int) -> list[int]:
    """Divide a number into one share for each part of the run."""
    size, more = divmod(number, PARTS)
    return [size + (part < more) for part in range(PARTS)]


def halves(megabytes: list[float]) -> tuple[float, float]:
    """Return the maxima of the first half, without its first value, and of the second half."""
    middle = len(megabytes) // 2
    return max(megabytes[1:middle]), max(megabytes[middle:])


def expect(what: str, found: object, due: object) -> None:
    """Exit with an error if a result is not the expected one."""
    if found != due:
        raise SystemExit(f'{what}: {found}, and not {due}')


# -- the node -------------------------------------------------------------------------------------

def soak_node(bench: Bench, subject: Subject, turn: Turn, messages: int) -> Result:
    """Publish as fast as the node takes messages, and compare its violations."""
    values = bench.folder / 'values.txt'
    values.write_text(''.join(
        f'{value!r} {int(not first[0])} {int(not later[0])}\n'
        for value, first, later in zip(turn.values, turn.first, turn.later)), encoding='ascii')
    load = Load(bench.load, '--topics', 'x', '--depth', '1000', '--echo', HANDLER,
                '--values', str(values))
    running = Running(subject)
    megabytes: list[float] = []
    sent = 0
    with both(load, running):
        load.ask('match', running)
        begin = time.monotonic()
        for part in parts_of(messages):
            sent = int(load.ask(f'stream {part} {BATCH}', running))
            megabytes.append(running.kilobytes('VmRSS') / 1e3)
            say(f'{subject.name}: {sent} messages')
        seconds = time.monotonic() - begin
        due = turn.violations(messages)
        expect('messages received', load.counts('received'), {'topic /x': messages})
        expect('steps', load.counts('steps'), dict.fromkeys(due, messages))
        expect('violations', load.counts('violations'), due)
    return Result(subject.name, sent, seconds, *halves(megabytes), sum(due.values()))


# -- simulate -------------------------------------------------------------------------------------

def soak_simulate(title: str, bundle: Path, turn: Turn | TimedTurn, rows: int) -> Result:
    """Feed a trace to `simulate`, and compare its output line by line."""
    begin = time.monotonic()
    trace_heading, column = turn.headings
    trace = chain([trace_heading], turn.lines(rows))
    with simulating(bundle, lambda file: feed(file, trace)) as process:
        assert process.stdout is not None
        expect('heading', next(process.stdout), ','.join((column, *turn.names)) + '\n')
        megabytes = [resident(process, 0.0)]
        due = turn.verdict_lines(rows)
        for part in parts_of(sum(1 for _ in turn.verdict_lines(rows))):
            compare(process.stdout, islice(due, part))
            megabytes.append(resident(process, megabytes[-1]))
            say(f'{title}: {len(megabytes) - 1} of {PARTS} parts')
        expect('rows after the last', process.stdout.read(), '')
    return Result(title, rows, time.monotonic() - begin, *halves(megabytes),
                  sum(turn.violations(rows).values()))


def resident(process: 'subprocess.Popen[str]', before: float) -> float:
    """Return the memory in MB; the last value if the process has already ended."""
    if process.poll() is not None:
        return before
    try:
        return kilobytes(process, 'VmRSS') / 1e3
    except SystemExit:
        return before


@contextmanager
def simulating(bundle: Path, write: Callable[[IO[str]], None]
               ) -> Iterator[subprocess.Popen[str]]:
    """Start `simulate` and a thread that writes its trace; check its exit status."""
    program = 'import sys; from fret_monitor.cli.main import main; sys.exit(main())'
    with subprocess.Popen(
            [sys.executable, '-c', program, 'simulate', str(bundle), '--trace', '/dev/stdin'],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None
        writer = Thread(target=write, args=(process.stdin,))
        writer.start()
        try:
            yield process
        finally:
            if sys.exc_info()[0] is not None:
                process.kill()
            writer.join()
    expect('exit status of simulate', process.returncode, 0)


def feed(file: IO[str], lines: Iterable[str]) -> None:
    """Write a trace."""
    try:
        with file:
            file.writelines(lines)
    except BrokenPipeError:
        pass  # it has ended; the reader reports why


def compare(file: IO[str], due: Iterable[str]) -> None:
    """Compare the next lines with those of the reference."""
    for line in due:
        found = file.readline()
        if found != line:
            raise SystemExit(f'simulate: {found!r}, and not {line!r}')


# -- what is printed ------------------------------------------------------------------------------

def soak(bench: Bench, messages: int, only: str | None = None) -> Iterator[Result]:
    """Yield the result of each part; the node is run once for each way to take messages."""
    bundle = bench.bundle(
        'soak', '  x: {topic: x, type: std_msgs/msg/Float32, qos: {depth: 1000}}\n', REQUIREMENTS)
    turn = turn_of(bundle)
    if only in (None, 'simulate'):
        yield soak_simulate('simulate', bundle, turn, messages)
    if only in (None, 'timed'):
        timed = bench.folder / 'soak_timed.yaml'
        timed.write_text(TIMED, encoding='utf-8')
        yield soak_simulate('simulate, timed', timed, timed_turn_of(timed),
                            messages // TIMED_SHARE)
    if only in (None, 'node'):
        for subject in bench.monitors(bundle):
            yield soak_node(bench, subject, turn, messages)


def main() -> int:
    """Run, and print a line for each part; 1 if memory grew."""
    parser = ArgumentParser(description='Run for long, and compare with the reference.')
    parser.add_argument('--messages', type=int, default=MESSAGES)
    parser.add_argument('--only', choices=['node', 'simulate', 'timed'])
    options = parser.parse_args()
    are_flat = True
    with prepared(1) as bench:
        for result in soak(bench, options.messages, options.only):
            say('')
            print(f'{result.title}: {result.messages:,} in {result.seconds:.0f} s, '
                  f'{result.violations:,} violations as the reference has them, memory '
                  f'{result.before:.1f} MB, then {result.after:.1f} MB'
                  f'{"" if result.is_flat else ": it grew"}', flush=True)
            are_flat = are_flat and result.is_flat
    return 0 if are_flat else 1


if __name__ == '__main__':
    sys.exit(main())
