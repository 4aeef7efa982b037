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
Check tables of a million rows in CSV, beside merely reading them with Python's `csv`.

`read` is the processor time to split the rows with `csv.reader` and make a number of each cell;
`simulate` writes all verdicts to a file, and `bag` takes the table as a recording, both after the
start, in the same process, in interleaved rounds. A ratio is the median of the rounds'.

    python -m bench.tables
"""

from collections.abc import Iterator
import csv
from pathlib import Path
from random import Random
from statistics import median
import sys
import tempfile

from bench.bags import seconds
from fret_monitor.bag.check import check_recording, Selection
from fret_monitor.start import start
from fret_monitor.traces.simulate import simulate

ROUNDS = 5
ROWS = 1_000_000
BUNDLE = """format: 1
evaluation: {policy: POLICY}
inputs:
  current: {topic: current, type: std_msgs/msg/Float32}
  wind: {topic: wind, type: std_msgs/msg/Float64}
requirements:
  - {id: R-1, ptltl: "H (H[0,10 UNIT] (current > 5 & wind > 3) -> O[0,10 UNIT] current <= 5)"}
  - {id: R-2, ptltl: "H (current <= 9.5)"}
"""


def main() -> int:
    """Print the table."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        print('| table | read | simulate | bag | simulate / read | bag / read |')
        print('|---|---|---|---|---|---|')
        for policy in ('every_message', 'timed'):
            for digits in (3, 17):
                print(row(folder, policy, digits), flush=True)
    return 0


def bundle(folder: Path, policy: str) -> Path:
    """Write a bundle of two requirements on two inputs."""
    file = folder / f'{policy}.yaml'
    text = BUNDLE.replace('POLICY', policy)
    file.write_text(text.replace(' UNIT', ' s' if policy == 'timed' else ''), encoding='utf-8')
    return file


def walk(rng: Random) -> Iterator[float]:
    """Yield values that stay within 10 of zero."""
    value = 0.0
    while True:
        value = max(-10.0, min(10.0, value + rng.gauss(0, 0.5)))
        yield value


def table(folder: Path, digits: int) -> Path:
    """Write a table of random walks, with a column of times."""
    file = folder / f'{digits}.csv'
    if not file.exists():
        rng = Random(1)
        with file.open('w', encoding='utf-8') as out:
            out.write('time,current,wind\n')
            for number, one, other in zip(range(ROWS), walk(rng), walk(rng)):
                out.write(f'{number // 100}.{number % 100:02d},{one:.{digits}g},'
                          f'{other:.{digits}g}\n')
    return file


def read(file: Path) -> int:
    """Read all cells as numbers; return how many rows there are."""
    with file.open(newline='', encoding='utf-8') as text:
        rows = csv.reader(text)
        next(rows)
        return sum(1 for cells in rows if [float(cell) for cell in cells])


def row(folder: Path, policy: str, digits: int) -> str:
    """Compare with reading."""
    spec, file = bundle(folder, policy), table(folder, digits)
    monitor = start(spec).monitor
    check_recording(spec, file, Selection())
    rounds = [(seconds(lambda: read(file)),
               seconds(lambda: simulate(monitor, file, folder / 'verdicts.csv')),
               seconds(lambda: check_recording(spec, file, Selection()))) for _ in range(ROUNDS)]
    times = ' | '.join(f'{median(column):.2f} s' for column in zip(*rounds))
    ratios = ' | '.join(f'{median(item[k] / item[0] for item in rounds):.2f}' for k in (1, 2))
    return f'| {policy}, {digits} digits | {times} | {ratios} |'


if __name__ == '__main__':
    sys.exit(main())
