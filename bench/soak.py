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
verdict is compared. Memory is measured throughout and must not grow in the second half.

    make soak        (or: .venv/bin/python -m bench.soak [--messages N] [--only node|simulate])
"""

from argparse import ArgumentParser
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from random import Random
import subprocess
import sys
from threading import Thread
import time
from typing import IO

from bench.ros import Bench, both, kilobytes, Load, prepared, Running, say, Subject
from fret_monitor.build import read
from fret_monitor.logic.evaluate import verdicts

MESSAGES = 10_000_000
TURN = 1000  # rows until the values repeat
BATCH = 200  # messages between comparisons; the node's queue holds five times as many
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


@dataclass(frozen=True)
class Turn:
    """The values of a turn, and the verdicts of each row: the first time, and later."""

    names: tuple[str, ...]
    values: tuple[float, ...]
    first: tuple[tuple[bool, ...], ...]
    later: tuple[tuple[bool, ...], ...]

    def violations(self, messages: int) -> dict[str, int]:
        """Return the number of steps at which each requirement is violated."""
        turns, rest = divmod(messages, TURN)
        rows = [*self.first[:messages],
                *(self.later[:rest] if turns else ())]
        return {name: sum(not row[place] for row in rows)
                + max(turns - 1, 0) * sum(not row[place] for row in self.later)
                for place, name in enumerate(self.names)}


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

def soak_simulate(bundle: Path, turn: Turn, rows: int) -> Result:
    """Feed a trace to `simulate`, and compare its output row by row."""
    begin = time.monotonic()
    with simulating(bundle, lambda file: feed(file, turn, rows)) as process:
        assert process.stdout is not None
        expect('heading', next(process.stdout), ','.join(('step', *turn.names)) + '\n')
        megabytes = [resident(process, 0.0)]
        count = 0
        for part in parts_of(rows):
            count += compare(process.stdout, turn, count, part)
            megabytes.append(resident(process, megabytes[-1]))
            say(f'simulate: {count} rows')
        expect('rows after the last', process.stdout.read(), '')
    return Result('simulate', count, time.monotonic() - begin, *halves(megabytes),
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


def feed(file: IO[str], turn: Turn, rows: int) -> None:
    """Write the trace, one turn at a time."""
    lines = [f'{value!r}\n' for value in turn.values]
    whole = ''.join(lines)
    try:
        with file:
            file.write('x\n')
            for _ in range(rows // TURN):
                file.write(whole)
            file.write(''.join(lines[:rows % TURN]))
    except BrokenPipeError:
        pass  # it has ended; the reader reports why


def compare(file: IO[str], turn: Turn, begin: int, count: int) -> int:
    """Compare the next rows with the reference, and return how many there were."""
    first, later = ([f',{",".join(str(int(flag)) for flag in row)}\n' for row in rows]
                    for rows in (turn.first, turn.later))
    for step in range(begin, begin + count):
        due = f'{step}{(first if step < TURN else later)[step % TURN]}'
        line = file.readline()
        if line != due:
            raise SystemExit(f'simulate: {line!r}, and not {due!r}')
    return count


# -- what is printed ------------------------------------------------------------------------------

def soak(bench: Bench, messages: int, only: str | None = None) -> Iterator[Result]:
    """Yield the result of each part; the node is run once for each way to take messages."""
    bundle = bench.bundle(
        'soak', '  x: {topic: x, type: std_msgs/msg/Float32, qos: {depth: 1000}}\n', REQUIREMENTS)
    turn = turn_of(bundle)
    if only in (None, 'simulate'):
        yield soak_simulate(bundle, turn, messages)
    if only in (None, 'node'):
        for subject in bench.monitors(bundle):
            yield soak_node(bench, subject, turn, messages)


def main() -> int:
    """Run, and print a line for each part; 1 if memory grew."""
    parser = ArgumentParser(description='Run for long, and compare with the reference.')
    parser.add_argument('--messages', type=int, default=MESSAGES)
    parser.add_argument('--only', choices=['node', 'simulate'])
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
