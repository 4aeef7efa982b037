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
What a monitor pays for a page that watches it: processor time of the monitor for a message.

The running example takes messages at 1 kHz. In each round the same monitor is measured alone,
beside the process of a page that watches it, and beside one that watches nothing, but wakes up as
often and computes for as long: what a busy machine costs.

    .venv/bin/python -m bench.watched [--rounds N] [--seconds N] [--violations]
"""

from argparse import ArgumentParser
from collections.abc import Iterator
from contextlib import contextmanager
import json
import os
from pathlib import Path
from statistics import median
import subprocess
import sys
from tempfile import TemporaryDirectory

from bench.ros import Bench, both, build, DOMAIN, float_input, Load, RATE, Running, TOPICS
from fret_monitor import build as builder
from fret_monitor.studio.plan import plan

_BUSY = """
import sys, time
rate, busy = map(float, sys.argv[1:])
begin, used, count = time.monotonic(), time.process_time(), 0
while True:
    count += 1
    time.sleep(max(0.0, begin + count / rate - time.monotonic()))
    while time.process_time() < used + count * busy:
        pass
"""


def _processor_s(process: 'subprocess.Popen[bytes]') -> float:
    """Return the processor time of a process."""
    fields = Path(f'/proc/{process.pid}/stat').read_text().rpartition(')')[2].split()
    return sum(map(int, fields[11:13])) / os.sysconf('SC_CLK_TCK')


@contextmanager
def _page(bundle: Path) -> Iterator['subprocess.Popen[bytes]']:
    """Run the process of a page that watches a bundle's monitor."""
    wanted = plan(builder.read(bundle).specification) | {'namespace': '/'}
    process = subprocess.Popen([sys.executable, '-m', 'fret_monitor.studio.watching'],
                               stdin=subprocess.PIPE, stdout=subprocess.DEVNULL)
    assert process.stdin is not None
    try:
        process.stdin.write(json.dumps(wanted).encode() + b'\n')
        process.stdin.flush()
        yield process
    finally:
        process.stdin.close()
        process.wait(60)


@contextmanager
def _busy(seconds: float) -> Iterator['subprocess.Popen[bytes]']:
    """Run a process that wakes up at the rate of messages, and computes each time."""
    process = subprocess.Popen([sys.executable, '-c', _BUSY, str(RATE), str(seconds)])
    try:
        yield process
    finally:
        process.terminate()
        process.wait()


def _cost(load: Load, running: Running, count: int,
          beside: 'subprocess.Popen[bytes] | None' = None) -> tuple[float, float]:
    """Return microseconds a message: of the monitor, and of a process beside it."""
    load.send(int(3 * RATE), RATE)  # a page finds the topics within a second
    before = [running.nanoseconds() / 1e9, _processor_s(beside) if beside else 0.0]
    sent = load.send(count, RATE)
    after = [running.nanoseconds() / 1e9, _processor_s(beside) if beside else 0.0]
    own, other = (1e6 * (b - a) / sent.count for a, b in zip(before, after, strict=True))
    return own, other


def _violating(bench: Bench) -> Path:
    """Return a bundle that each message violates."""
    return bench.bundle(
        'each', float_input('current', TOPICS[0]) + float_input('wind', TOPICS[1]),
        '  - {id: EACH, ptltl: "current > wind"}\n')


def main() -> None:
    """Measure, and print the medians over the rounds."""
    parser = ArgumentParser(description='What a monitor pays for a page.')
    parser.add_argument('--rounds', type=int, default=7)
    parser.add_argument('--seconds', type=float, default=8.0)
    parser.add_argument('--violations', action='store_true')
    options = parser.parse_args()
    os.environ.setdefault('ROS_DOMAIN_ID', DOMAIN)
    with TemporaryDirectory() as name:
        folder = Path(name)
        bench = Bench(build('load', folder), folder, folder, options.rounds)
        bundle = _violating(bench) if options.violations else (
            Path(__file__).resolve().parent.parent / 'config' / 'quadrotor.yaml')
        load = Load(bench.load, '--topics', ','.join(TOPICS))
        running = Running(bench.monitors(bundle)[0])
        with both(load, running):
            load.ask('match', running)
            _compare(load, running, bundle, options.rounds, int(options.seconds * RATE))


def _compare(load: Load, running: Running, bundle: Path, rounds: int, count: int) -> None:
    found: dict[str, list[tuple[float, float]]] = {'alone': [], 'page': [], 'busy': []}
    for _ in range(rounds):
        found['alone'].append(_cost(load, running, count))
        with _page(bundle) as page:
            found['page'].append(_cost(load, running, count, page))
        with _busy(1e-6 * found['page'][-1][1]) as busy:
            found['busy'].append(_cost(load, running, count, busy))
        print({kind: [round(x, 1) for x in rows[-1]] for kind, rows in found.items()},
              file=sys.stderr)
    for kind, rows in found.items():
        own, other = ([row[column] for row in rows] for column in (0, 1))
        ratio = median(a / b[0] for a, b in zip(own, found['alone'], strict=True))
        print(f'| {kind} | {median(own):.1f} | {min(own):.1f} to {max(own):.1f} | {ratio:.2f} | '
              f'{median(other):.1f} |')


if __name__ == '__main__':
    main()
