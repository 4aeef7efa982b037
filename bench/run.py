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
Measure the time of a step, state and start-up, beside hand-written C (docs/benchmarks.md).

Each row compiles a bundle and times it side by side with the function of the same name in
`floor.c`: the same rows of inputs, the same timing loop, nine interleaved rounds. The ratio is
the median of the rounds' ratios. The verdicts of both are compared first, row for row.

    make bench        (or: .venv/bin/python bench/run.py [--json])
"""

from argparse import ArgumentParser
from collections.abc import Iterator
from dataclasses import asdict, dataclass
import json
import os
from pathlib import Path
import shutil
from statistics import median
import subprocess
import sys
import tempfile
import time

from fret_monitor.build import compile_monitor, generate_monitor, read
from fret_monitor.native.binding import ffi
from fret_monitor.native.cache import build_library
from fret_monitor.native.monitor import Library, Monitor
from fret_monitor.traces.benchmark import Inputs, lasting_inputs, random_inputs, StepTimer
from fret_monitor.traces.boundary import both_sides

HERE = Path(__file__).resolve().parent
ROUNDS = 9
COPIES = 100
COMPARED = 20_000  # rows: enough for windows to run out

HEAD = 'format: 1\n'
RUNNING = ('H (O[10,10] ((({c} & Y !({c})) | ({c} & FTP)) & !{r}) -> O[0,9] (FTP | {r}))')


@dataclass(frozen=True)
class Work:
    """A bundle, and the hand-written function of `floor.c` that computes the same."""

    title: str
    floor: str
    bundle: str


@dataclass(frozen=True)
class Row:
    """Medians over the rounds; ratios are compiled to hand-written, of the same round."""

    work: str
    inputs: str
    nanoseconds: float
    floor_nanoseconds: float
    ratio: float
    state_bytes: int
    floor_state_bytes: int


def running_example(copies: int) -> str:
    """Return a bundle with copies of the running example, each with its own inputs."""
    inputs = ''.join(f'  current_{i}x: {{type: float32}}\n  wind_{i}x: {{type: float32}}\n'
                     for i in range(copies))
    return f'{HEAD}inputs:\n{inputs}requirements:\n' + ''.join(
        f'  - id: R{i}\n    ptltl: "{_running(i)}"\n' for i in range(copies))


def _running(number: int) -> str:
    over = f'(current_{number}x > 15.0 & wind_{number}x > 8.0)'
    return RUNNING.format(c=f'(H[0,10] {over} & H[0,9] !FTP)', r=f'(current_{number}x <= 15.0)')


def operator(formula: str) -> str:
    """Return a bundle of one formula over p and q."""
    return (f'{HEAD}inputs: {{p: {{type: bool}}, q: {{type: bool}}}}\n'
            f'requirements: [{{id: R, ptltl: "{formula}"}}]\n')


WORKS = (
    Work('running example', 'running_example', running_example(1)),
    Work(f'{COPIES} copies on different inputs', 'copies', running_example(COPIES)),
    Work('`H[0,1000] p`', 'historically', operator('H[0,1000] p')),
    Work('`O[0,1000] p`', 'once', operator('O[0,1000] p')),
    Work('`p S[0,1000] q`', 'since', operator('p S[0,1000] q')),
)


def main() -> int:
    """Measure all, and print a table or JSON."""
    parser = ArgumentParser()
    parser.add_argument('--json', action='store_true')
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        rows = [row for work in WORKS for row in measure(work, Path(folder))]
        starts = dict(start_up(Path(folder)))
    if options.json:
        print(json.dumps({'rows': [asdict(row) for row in rows], 'start_up': starts}))
    else:
        show(rows, starts)
    return 0


def measure(work: Work, folder: Path) -> Iterator[Row]:
    """Time one bundle and its floor on random and on long-lasting inputs."""
    path = folder / f'{work.floor}.yaml'
    path.write_text(work.bundle, encoding='utf-8')
    generated = generate_monitor(read(path))
    monitor = compile_monitor(generated).monitor
    floor = floor_monitor(work.floor, monitor)
    values = both_sides(generated.program)
    for name, fill in (('random', random_inputs), ('long-lasting', lasting_inputs)):
        inputs = fill(monitor, values)
        compare(work, monitor, floor, inputs)
        yield timed(work, name, StepTimer(monitor, inputs), StepTimer(floor, inputs),
                    monitor.state_bytes, floor.state_bytes)


def timed(work: Work, name: str, ours: StepTimer, floor: StepTimer, ours_bytes: int,
          floor_bytes: int) -> Row:
    """Time interleaved rounds."""
    rounds = [(ours.round(), floor.round()) for _ in range(ROUNDS)]
    return Row(work.title, name, median(a for a, _ in rounds), median(b for _, b in rounds),
               median(a / b for a, b in rounds), ours_bytes, floor_bytes)


def floor_monitor(name: str, monitor: Monitor) -> Monitor:
    """Compile `floor.c` with the flags of generated C, and return one of its monitors."""
    text = (HERE / 'floor.c').read_text(encoding='utf-8')
    library = Library(build_library({'floor.c': text}, name='floor'))
    describe = ffi.cast('const struct fm_monitor * (*)(void)', library.find(f'floor_{name}'))
    return Monitor(monitor.manifest, library, describe())


def compare(work: Work, ours: Monitor, floor: Monitor, inputs: Inputs) -> None:
    """Exit if the two do not give the same verdicts."""
    if verdicts(ours, inputs) != verdicts(floor, inputs):
        raise SystemExit(f'{work.title}: the hand-written C gives other verdicts')


def verdicts(monitor: Monitor, inputs: Inputs) -> list[bytes]:
    """Return the verdicts of the first rows."""
    state = ffi.new('uint64_t[]', monitor.state_bytes // 8 + 1)
    flags = ffi.new('bool[]', len(monitor.manifest.requirements))
    groups = monitor.pointer.groups[0:monitor.pointer.n_groups]
    for group in groups:
        group.reset(state)
    found = []
    for row in range(min(inputs.count, COMPARED)):
        for group in groups:
            group.step(state, inputs.memory + row * inputs.stride, flags)
        found.append(bytes(ffi.buffer(flags)))
    return found


START = """
import sys
from pathlib import Path
from fret_monitor.build import build
from fret_monitor.runtime.evaluator import Evaluator
evaluator = Evaluator(build(Path(sys.argv[1])).monitor)
for index, _ in enumerate(evaluator.monitor.manifest.inputs):
    evaluator.store(index, 1)
evaluator.step(0)
"""


def start_up(folder: Path) -> Iterator[tuple[str, float]]:
    """Yield seconds from the start of a process to its first step, medians of five runs."""
    home = folder / 'ros_home'
    for work in WORKS[:2]:
        path = folder / f'{work.floor}.yaml'
        cold, cached = [], []
        for _ in range(5):
            shutil.rmtree(home, ignore_errors=True)
            cold.append(_started(path, home))
            cached.append(_started(path, home))
        yield f'{work.title}, cold', median(cold)
        yield f'{work.title}, cached', median(cached)


def _started(path: Path, home: Path) -> float:
    before = time.perf_counter()
    subprocess.run([sys.executable, '-c', START, str(path)], check=True,
                   env={**os.environ, 'ROS_HOME': str(home)})
    return time.perf_counter() - before


def show(rows: list[Row], starts: dict[str, float]) -> None:
    """Print Markdown tables."""
    print('| work | inputs | a step | hand-written | ratio | state | hand-written |')
    print('|---|---|---|---|---|---|---|')
    for row in rows:
        print(f'| {row.work} | {row.inputs} | {row.nanoseconds:.1f} ns | '
              f'{row.floor_nanoseconds:.1f} ns | {row.ratio:.2f} | {row.state_bytes} B | '
              f'{row.floor_state_bytes} B |')
    print()
    print('| process start to first step | seconds |')
    print('|---|---|')
    for name, seconds in starts.items():
        print(f'| {name} | {seconds:.2f} |')


if __name__ == '__main__':
    sys.exit(main())
