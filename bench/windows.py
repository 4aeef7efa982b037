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
Nanoseconds of a step of a window of numbers, of 10, 1,000 and 100,000 values.

`windows.c` times the cells of `csrc/generated/fret_windows.h` beside C that is written by hand.
With `--daba FOLDER`, a folder with IBM's DABALite.hpp, `daba_lite.cpp` times maxOver beside it.
If reelay, rtamt and mstlo (PyPI: mstlo-python) are installed, they answer the question
`maxOver(n, x) <= c` too, through their Python bindings; mstlo n steps later, as `G[0,n]`.

    python -m bench.windows [--daba FOLDER]
"""

from argparse import ArgumentParser
from collections.abc import Callable, Iterable, Iterator
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from random import Random
import subprocess
import tempfile
import time
from typing import Any

from fret_monitor.native.cache import csrc_includes
from fret_monitor.native.compiler import COMPILE_FLAGS, find_compiler, LIBRARIES

SOURCE = Path(__file__).resolve().with_name('windows.c')
DABA = SOURCE.with_name('daba_lite.cpp')
LENGTHS = (10, 1000, 100_000)
_FLAGS = [flag for flag in COMPILE_FLAGS if flag not in ('-fPIC', '-fvisibility=hidden')]
_HEAD = ('function', 'values', 'window', 'mean', 'median', '99.99 %', 'greatest')
_DABA_HEAD = ('values', 'window', 'fm_greatest', 'DABA Lite', 'ratio', 'DABA Lite, ring', 'ratio')
_LONGEST_S = 5.0


def main() -> None:
    """Compile the programs, run them, and print their rows as tables."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument('--daba', type=Path, metavar='FOLDER')
    daba = parser.parse_args().daba
    _print(_HEAD, _run([*find_compiler().command, *_FLAGS, *csrc_includes(), SOURCE, *LIBRARIES]))
    if daba is not None:
        print()
        _print(_DABA_HEAD, _run(
            ['g++', '-O2', '-ffp-contract=off', *csrc_includes(), f'-I{daba}', DABA]))
    if any(map(find_spec, PEERS)):
        print()
        _print(('by', 'window', 'ns a step'), peers())


def _run(command: list[Any]) -> list[list[str]]:
    """Compile a program, and return the columns of what it prints."""
    with tempfile.TemporaryDirectory() as folder:
        program = Path(folder) / 'windows'
        subprocess.run([*command, '-o', program], check=True)
        found = subprocess.run([program], check=True, capture_output=True, text=True).stdout
    return [line.split('\t') for line in found.splitlines()]


def _print(head: tuple[str, ...], rows: Iterable[list[str]]) -> None:
    print('| ' + ' | '.join(head) + ' |')
    print('| ' + ' | '.join(['---:'] * len(head)) + ' |')
    for row in rows:
        print('| ' + ' | '.join(row) + ' |', flush=True)


# -- peers ----------------------------------------------------------------------------------------

_Update = Callable[[int, float], Any]


def reelay(length: int) -> _Update:
    """Return the step of reelay's monitor of the least of 12 - x."""
    monitor = import_module('reelay').discrete_timed_monitor(
        pattern=f'historically[0:{length - 1}]{{x <= 12.0}}', semantics='robustness',
        condense=False)
    return lambda _, x: monitor.update({'x': x})


def rtamt(length: int) -> _Update:
    """Return the step of rtamt's monitor of the least of 12 - x."""
    specification = import_module('rtamt').StlDiscreteTimeSpecification()
    specification.declare_var('x', 'float')
    specification.spec = f'historically[0:{length - 1}](x <= 12.0)'
    specification.parse()
    return lambda step, x: specification.update(step, [('x', x)])


def mstlo(length: int) -> _Update:
    """Return the step of mstlo's monitor of the least of 12 - x, now and from now on."""
    tool = import_module('mstlo_python')
    monitor = tool.Monitor(tool.parse_formula(f'G[0, {length - 1}](x < 12.0)'),
                           semantics='DelayedQuantitative', algorithm='Incremental')
    return lambda step, x: monitor.update('x', x, float(step))


PEERS: dict[str, Callable[[int], _Update]] = {
    'reelay': reelay, 'rtamt': rtamt, 'mstlo_python': mstlo}


def peers() -> Iterator[list[str]]:
    """Yield a row for each tool that is installed, and each length."""
    for name, make in PEERS.items():
        if find_spec(name) is None:
            continue
        for length in LENGTHS:
            yield [name.removesuffix('_python'), f'{length}',
                   f'{_time(make(length), length):,.0f}']


def _time(update: _Update, length: int) -> float:
    """Return the processor time of a step, once the window is full or there is no more time."""
    values = [Random(1).uniform(-5.0, 15.0) for _ in range(1000)]
    start, step = time.monotonic(), 0
    while step < length and time.monotonic() < start + _LONGEST_S:
        update(step, values[step % 1000])
        step += 1
    steps, begin = 0, time.process_time_ns()
    while steps < 200_000 and time.process_time_ns() < begin + _LONGEST_S * 1e9:
        update(step + steps, values[steps % 1000])
        steps += 1
    return (time.process_time_ns() - begin) / steps


if __name__ == '__main__':
    main()
