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
From a keystroke to its diagnostics: `PYTHONPATH=.:test python -m bench.editor`.

A bundle of 100 requirements is open in the language server, over its pipes. One character after
another is typed in one of its sentences, with and without a mistake, and after each the time until
the diagnostics of that version come; in other rounds, until a completion comes. The processor time
is that of the server, in the rounds of diagnostics.
"""

from argparse import ArgumentParser
from collections.abc import Sequence
import os
from pathlib import Path
from statistics import median
import time

from lsp.client import at, Client, editor

URI = Path('bench.yaml').absolute().as_uri()
_TYPED = ' & speed_7 > 0.5'


def bundle(count: int) -> str:
    """Return a bundle with so many requirements, half of them sentences, on ten topics."""
    inputs = '\n'.join(
        f'  speed_{number}: {{topic: robot{number % 10}/odom, type: nav_msgs/msg/Odometry, '
        'field: twist.twist.linear.x}' for number in range(count // 2))
    requirements = '\n'.join(
        f'  - id: R{number}\n    ' + (
            f'fretish: "when speed_{number // 2} > limit the base shall within 3 seconds satisfy '
            f'speed_{number // 2} <= limit & !fast"' if number % 2 else
            f'ptltl: "H ((O[0, 5 s] (speed_{number // 2} > 0.5)) -> speed_{number // 2} < 2.5)"')
        for number in range(count))
    return (f'format: 1\nconstants: {{limit: 1.5}}\ninputs:\n{inputs}\ndefinitions:\n'
            '  fast: speed_0 > 2 * limit\nevaluation: {policy: timed, unit: 1}\n'
            f'requirements:\n{requirements}\n')


def _typed(client: Client, text: str, rounds: int, *, completes: bool) -> list[float]:
    """Return the seconds until diagnostics, or until a completion, of each keystroke."""
    line = text[:text.index('!fast')].count('\n')
    start = text.splitlines()[line].index('!fast') + len('!fast')
    times, version = [], 1
    for _ in range(rounds):
        client.replace(URI, version := version + 1, (None, text))
        client.diagnostics(URI, version)
        for number, char in enumerate(_TYPED):
            place = at(line, start + number)
            begin = time.perf_counter()
            client.replace(URI, version := version + 1, ({'start': place, 'end': place}, char))
            if completes:
                client.ask('textDocument/completion', textDocument={'uri': URI},
                           position=at(line, start + number + 1))
            else:
                client.diagnostics(URI, version)
            times.append(time.perf_counter() - begin)
    return times


def _processor_s(client: Client) -> float:
    """Return the processor time that the server has taken."""
    fields = Path(f'/proc/{client.process.pid}/stat').read_text(encoding='ascii').split()
    return (int(fields[13]) + int(fields[14])) / os.sysconf('SC_CLK_TCK')


def shown(name: str, times: Sequence[float], what: str = 'keystrokes') -> str:
    """Return the median and the 99th percentile of times (s) as a line."""
    ordered = sorted(times)
    last = ordered[min(len(ordered) - 1, len(ordered) * 99 // 100)]
    return (f'{name:<28} median {1000 * median(ordered):6.0f} ms   '
            f'99 % {1000 * last:6.0f} ms   {len(ordered)} {what}')


def main() -> None:
    """Type, and print the times."""
    parser = ArgumentParser(description='From a keystroke to its diagnostics.')
    parser.add_argument('--requirements', type=int, default=100)
    parser.add_argument('--rounds', type=int, default=10)
    options = parser.parse_args()
    text = bundle(options.requirements)
    with editor() as client:
        client.open(URI, text)
        client.diagnostics(URI, 1)
        before = _processor_s(client)
        checks = _typed(client, text, options.rounds, completes=False)
        taken = (_processor_s(client) - before) / len(checks)
        completions = _typed(client, text, options.rounds, completes=True)
    print(f'{options.requirements} requirements, {len(text) // 1024} KiB')
    print(shown('keystroke to diagnostics', checks))
    print(f'{"  processor time":<28} mean   {1000 * taken:6.0f} ms')
    print(shown('keystroke to completions', completions))


if __name__ == '__main__':
    main()
