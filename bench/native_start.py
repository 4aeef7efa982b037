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
Measure where the time of a start with `native:=true` goes, from a warm cache.

Each part is the median difference of the processor time of two processes, children included: one
ends where the part begins, the other where it ends. Rounds are interleaved. The last one is that
of all threads until the node in C watches.

    python -m bench.native_start [--rounds 20] [--against FOLDER]

With `--against` another checkout, such as one before a change, is measured in the same rounds.
"""

import argparse
from collections.abc import Iterator, Mapping, Sequence
from glob import glob
import os
from pathlib import Path
from statistics import median, quantiles
import subprocess
import sys
import tempfile

BUNDLE = """
format: 1
inputs:
  speed: {topic: speed, type: std_msgs/msg/Float32}
requirements:
  - {id: R, ptltl: speed <= 1.0}
"""
BEGIN = """
import gc, os, sys
from fret_monitor.ros.signals import StopRequest
StopRequest()
gc.disable()
from fret_monitor.ros.native_start import become_native
"""
READ = BEGIN + """
from fret_monitor.model.diagnostics import CompileError
from fret_monitor.native.errors import NativeError
from fret_monitor.ros.settings.arguments import given_parameters
from fret_monitor.ros.settings.parameters import read_settings
read_settings(given_parameters(sys.argv[1:], 'fret_monitor'))
"""
LOAD = READ + """
from fret_monitor.native.ros_files import identity
import fret_monitor.start
"""
BECOME = BEGIN + """
def execv(*_):
    END
os.execv = execv
become_native(sys.argv)
"""
# Of this process and of its children (the compiler, which is asked for its version).
END = """
import os, time
used = time.process_time_ns()
import resource
of_children = resource.getrusage(resource.RUSAGE_CHILDREN)
print(used, 1e9 * (of_children.ru_utime + of_children.ru_stime))
sys.stdout.flush()
os._exit(0)
"""
PARTS = {
    'Python itself': 'import sys',
    'signals, and the arguments for `native`': BEGIN,
    'the parameters': READ,
    'the code that recalls a build is loaded': LOAD,
    'the build is recalled, until execv': BECOME.replace('END', END.replace('\n', '\n    ')),
}
WATCHES = 'the node in C, until it watches'
MONITOR = 'import sys; from fret_monitor.ros.monitor import main; sys.exit(main())'


def main() -> int:
    """Print a table for each checkout."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument('--rounds', type=int, default=20)
    options.add_argument('--against', type=Path, metavar='FOLDER')
    chosen = options.parse_args()
    here = Path(__file__).parents[1]
    folders = [here, *([chosen.against.resolve()] if chosen.against else [])]
    with tempfile.TemporaryDirectory() as name:
        starts = [Start(folder, Path(name)) for folder in folders]
        for start in starts:
            start.watching()  # builds the program
        found = [[start.round() for start in starts] for _ in range(chosen.rounds)]
    for number, folder in enumerate(folders):
        print('\n'.join(table(folder.name, [of_round[number] for of_round in found])))
    if chosen.against:
        print('\n'.join(compared(found)))
    return 0


class Start:
    """Starts of one checkout."""

    def __init__(self, checkout: Path, folder: Path) -> None:
        """Write the bundle to a folder."""
        self._folder = folder
        bundle = folder / 'bundle.yaml'
        bundle.write_text(BUNDLE, encoding='utf-8')
        self._arguments = ('--ros-args', '-p', f'spec:={bundle}', '-p', 'native:=true')
        self._environment = {
            **os.environ, 'PYTHONPATH': str(checkout), 'ROS_DOMAIN_ID': '77',
            'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}
        # Without bytecode, a start would compile the code of this package each time.
        self._environment.pop('PYTHONDONTWRITEBYTECODE', None)

    def round(self) -> Mapping[str, float]:
        """Return the processor time (ms) of a process until the end of each part."""
        found = {name: self._until(code) for name, code in PARTS.items()}
        _, of_children = list(found.values())[-1]
        return {**{name: sum(both) for name, both in found.items()},
                WATCHES: self.watching() + of_children}

    def _command(self, code: str) -> list[str]:
        return [sys.executable, '-P', '-c', code, *self._arguments]

    def _until(self, code: str) -> tuple[float, float]:
        done = subprocess.run(self._command(code + END), env=self._environment, cwd=self._folder,
                              stdout=subprocess.PIPE, text=True, check=True)
        own, of_children = map(float, done.stdout.split())
        return own / 1e6, of_children / 1e6

    def watching(self) -> float:
        """Return the processor time (ms) of the process until the node in C logs that."""
        process = subprocess.Popen(
            self._command(MONITOR), env=self._environment, cwd=self._folder,
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        with process:
            assert process.stderr is not None
            lines = iter(process.stderr.readline, '')
            assert any('watching' in line for line in lines), 'the node has ended'
            used = sum(float(Path(file).read_text().split()[0])
                       for file in glob(f'/proc/{process.pid}/task/*/schedstat'))
            assert 'python' not in os.readlink(f'/proc/{process.pid}/exe')
            process.terminate()
        return used / 1e6


def steps(found: Mapping[str, float]) -> Iterator[tuple[str, float]]:
    """Yield the parts of a round, each without those before it (ms)."""
    before = 0.0
    for name in PARTS:
        yield name, found[name] - before
        before = found[name]
    yield WATCHES, found[WATCHES] - before


def table(title: str, rounds: Sequence[Mapping[str, float]]) -> Iterator[str]:
    """Yield the lines of a table: the median of each part, and its quartiles."""
    yield f'{title}: {len(rounds)} rounds\n'
    yield '| part | ms of processor time | quartiles |\n|---|---|---|'
    parts = [dict(steps(item)) for item in rounds]
    for name in parts[0]:
        values = [item[name] for item in parts]
        low, _, high = quantiles(values, n=4)
        yield f'| {name} | {median(values):.1f} | {low:.1f} to {high:.1f} |'
    yield f'| all | {median(item[WATCHES] for item in rounds):.1f} | |\n'


def compared(rounds: Sequence[Sequence[Mapping[str, float]]]) -> Iterator[str]:
    """Yield the differences of the two checkouts, paired by their rounds."""
    for name in (*list(PARTS)[-1:], WATCHES):
        pairs = [of_round[0][name] - of_round[1][name] for of_round in rounds]
        low, _, high = quantiles(pairs, n=4)
        yield (f'until the end of "{name}": {median(pairs):+.1f} ms ({low:+.1f} to {high:+.1f}), '
               f'less in {sum(item < 0 for item in pairs)} of {len(pairs)} pairs')


if __name__ == '__main__':
    sys.exit(main())
