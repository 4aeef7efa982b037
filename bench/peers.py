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
Measure Copilot and reelay, if they are installed, side by side with this project's monitors.

Copilot (GHC and libghc-copilot-dev) compiles the works of `run.py` in two ways: as Ogma generates
them (`copilot/Ogma.hs`), and as an expert would write them by hand (`copilot/Counters.hs`). Its C
is compiled with the same flags and timed on the same rows by the same loop, in interleaved rounds;
the ratio is the median of the rounds' ratios. Verdicts are compared step by step, and differences
are reported. reelay (PyPI) is timed through its Python binding, since its wheel has nothing else.

    python -m bench.peers [--slow] [--folder DIR]
"""

from argparse import ArgumentParser
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from importlib.util import find_spec
from itertools import count
from pathlib import Path
import re
import shutil
from statistics import median
import struct
import subprocess
import sys
import tempfile
import time
from typing import Any

from bench.run import operator, ROUNDS, Work, WORKS
from fret_monitor.build import compile_monitor, generate_monitor, GeneratedMonitor, read
from fret_monitor.native.binding import ffi
from fret_monitor.native.cache import csrc_includes
from fret_monitor.native.compiler import COMPILE_FLAGS, find_compiler, LIBRARIES, LINK_FLAGS
from fret_monitor.native.monitor import Library, Monitor
from fret_monitor.traces.benchmark import Inputs, lasting_inputs, random_inputs, StepTimer
from fret_monitor.traces.boundary import both_sides

HASKELL = Path(__file__).resolve().parent / 'copilot'
COMPARED = 20_000  # steps
FORMATS = {'BOOL': '?', 'FLOAT32': 'f'}

ALL_WORKS = (*WORKS, Work('`p S q`', 'since_ever', operator('p S q')))


@dataclass(frozen=True)
class Way:
    """A way to write a monitor in Copilot; `slow` names works that take it many minutes."""

    title: str
    source: str
    slow: frozenset[str] = frozenset()


WAYS = (Way("Copilot, Ogma's way", 'Ogma', frozenset({'copies'})),
        Way('Copilot, by hand', 'Counters'))


@dataclass(frozen=True)
class Ours:
    """A work, compiled by this project."""

    work: Work
    generated: GeneratedMonitor
    monitor: Monitor

    @property
    def lines(self) -> int:
        """Lines of C."""
        return sum(text.count('\n') for _, text in self.generated.module.sources)

    def inputs(self) -> Iterator[tuple[str, Inputs]]:
        """Yield the inputs to step through, with their names."""
        values = both_sides(self.generated.program)
        yield 'random', random_inputs(self.monitor, values)
        yield 'long-lasting', lasting_inputs(self.monitor, values)


@dataclass(frozen=True)
class Peer:
    """A work, compiled by a peer. `state_bytes` is the size of all its variables."""

    title: str
    library: Path
    state_bytes: int
    lines: int
    generate_seconds: float
    compile_seconds: float


# -- Copilot --------------------------------------------------------------------------------------

def copilot_version() -> str | None:
    """Return the version of Copilot that GHC finds, None without one of them."""
    if shutil.which('ghc') is None or shutil.which('ghc-pkg') is None:
        return None
    listed = subprocess.run(['ghc-pkg', '--simple-output', 'list', 'copilot'],
                            capture_output=True, text=True, check=False).stdout.split()
    return listed[-1].rpartition('-')[2] if listed else None


def translator(way: Way, folder: Path) -> Path:
    """Compile the Haskell program that writes C, unless it is there."""
    program = folder / way.source.lower()
    if program.exists():
        return program
    # Not optimized, so that GHC does not share a subterm that a formula contains twice.
    subprocess.run(['ghc', '-v0', '-O0', '-outputdir', folder / f'{way.source}.o', '-o', program,
                    HASKELL / f'{way.source}.hs'], check=True)
    return program


def translate(way: Way, work: Work, folder: Path) -> tuple[Path, float]:
    """Let Copilot generate C, unless it exists; return it, and the seconds that it took."""
    name = f'{way.source}_{work.floor}'
    made, taken = folder / f'{name}.c', folder / f'{name}.seconds'
    if not taken.exists():
        program = translator(way, folder)
        before = time.perf_counter()
        subprocess.run([program, work.floor, name], cwd=folder, check=True)
        taken.write_text(f'{time.perf_counter() - before}\n', encoding='utf-8')
    return made, float(taken.read_text(encoding='utf-8'))


def copilot(way: Way, ours: Ours, folder: Path) -> Peer:
    """Make a library of a work that `StepTimer` can drive."""
    source, generate_seconds = translate(way, ours.work, folder)
    before = time.perf_counter()
    compiled = source.with_suffix('.o')
    run_compiler('-c', '-o', compiled, source)
    compile_seconds = time.perf_counter() - before
    adapter = folder / f'{source.stem}_adapter.c'
    header = source.with_suffix('.h').read_text(encoding='utf-8')
    adapter.write_text(adapter_text(source.stem, header, ours), encoding='utf-8')
    library = source.with_suffix('.so')
    run_compiler(*LINK_FLAGS, *csrc_includes(), '-o', library, adapter, compiled,
                 *LIBRARIES)
    return Peer(way.title, library, variables_bytes(compiled),
                source.read_text(encoding='utf-8').count('\n'), generate_seconds,
                compile_seconds)


def run_compiler(*words: str | Path) -> None:
    """Compile with the flags of generated C."""
    command = [*find_compiler().command, *COMPILE_FLAGS, '-w', *map(str, words)]
    subprocess.run(command, check=True)


def variables_bytes(compiled: Path) -> int:
    """Return the bytes of all variables of an object file."""
    printed = subprocess.run(['size', compiled], capture_output=True, text=True, check=True).stdout
    _, data, bss, *_ = printed.splitlines()[1].split()
    return int(data) + int(bss)


ADAPTER = """\
#include <string.h>
#include "fret_monitor.h"
#include "{name}.h"

{variables}
static bool * verdicts_of_step;
{handlers}
static void adapter_reset(void * state) {{(void)state;}}

static void adapter_step(void * state, const void * inputs, bool * verdicts)
{{
  const char * const from = inputs;
  (void)state;
  verdicts_of_step = verdicts;
  memset(verdicts, true, {count});
{copies}
  step();
}}

FM_EXPORT const struct fm_monitor * adapter(void);
const struct fm_monitor * adapter(void)
{{
  static const struct fm_group groups[] = {{{{
    NULL, 0u, NULL, 0u, adapter_reset, adapter_step, NULL}}}};
  static const struct fm_monitor monitor = {{
    FM_ABI, 0u, 1u, 0u, 8u, {inputs_bytes}u, NULL, groups, NULL, "{name}", "", adapter_step,
    NULL, 0u, NULL
  }};
  return &monitor;
}}
"""


def adapter_text(name: str, header: str, ours: Ours) -> str:
    """Return C that sets Copilot's variables from a row, and gets verdicts from its handlers."""
    pointer = ours.monitor.pointer
    offsets = {item.name: int(pointer.inputs[number].offset)
               for number, item in enumerate(ours.monitor.manifest.inputs)}
    variables = re.findall(r'extern (\w+) (\w+);', header)
    handlers = re.findall(r'void handlerpropR(\d+)\(void\);', header)
    return ADAPTER.format(
        name=name,
        variables='\n'.join(f'{kind} {variable};' for kind, variable in variables),
        handlers='\n'.join(f'void handlerpropR{number}(void) '
                           f'{{verdicts_of_step[{number}] = false;}}' for number in handlers),
        count=len(ours.monitor.manifest.requirements),
        copies='\n'.join(f'  memcpy(&{variable}, from + {offsets[variable]}, sizeof({variable}));'
                         for _, variable in variables),
        inputs_bytes=int(pointer.inputs_bytes),
    )


_copies = count()


def fresh(peer: Peer, ours: Ours) -> Monitor:
    """Load a copy of the library, with its variables at their start: Copilot has no reset."""
    path = peer.library.with_suffix(f'.{next(_copies)}.so')
    shutil.copy(peer.library, path)
    library = Library(path)
    path.unlink()
    describe = ffi.cast('const struct fm_monitor * (*)(void)', library.find('adapter'))
    return Monitor(ours.monitor.manifest, library, describe())


# -- verdicts and times ---------------------------------------------------------------------------

def verdicts(monitor: Monitor, inputs: Inputs) -> Iterator[bytes]:
    """Yield the verdicts of each step from the start."""
    state = ffi.new('uint64_t[]', monitor.state_bytes // 8 + 1)
    flags = ffi.new('bool[]', len(monitor.manifest.requirements))
    groups = monitor.pointer.groups[0:monitor.pointer.n_groups]
    for group in groups:
        group.reset(state)
    for row in range(min(inputs.count, COMPARED)):
        for group in groups:
            group.step(state, inputs.memory + row * inputs.stride, flags)
        yield bytes(ffi.buffer(flags))


def difference(ours: list[bytes], theirs: list[bytes]) -> str:
    """Return a note on the number of steps at which verdicts differ."""
    differing = [step for step, (a, b) in enumerate(zip(ours, theirs)) if a != b]
    if not differing:
        return 'equal'
    return f'differ at {len(differing):,} of {len(theirs):,} steps, first at step {differing[0]}'


def timed(ours: StepTimer, peer: Callable[[], float]) -> tuple[float, float, float]:
    """Return medians over interleaved rounds: this project's, the peer's, and their ratio."""
    rounds = [(ours.round(), peer()) for _ in range(ROUNDS)]
    return (median(a for a, _ in rounds), median(b for _, b in rounds),
            median(b / a for a, b in rounds))


def show_row(*cells: str) -> None:
    """Print a row of a Markdown table, flushed at once, since the next may take minutes."""
    print(f"| {' | '.join(cells)} |", flush=True)


def time_copilot(ours: Ours, peer: Peer) -> None:
    """Print the rows of a work and a way."""
    for name, inputs in ours.inputs():
        same = difference(list(verdicts(ours.monitor, inputs)),
                          list(verdicts(fresh(peer, ours), inputs)))
        mine, theirs, ratio = timed(StepTimer(ours.monitor, inputs),
                                    StepTimer(fresh(peer, ours), inputs).round)
        show_row(ours.work.title, name, peer.title, f'{mine:.1f} ns', f'{theirs:,.1f} ns',
                 f'{ratio:,.1f}', same)


# -- reelay ---------------------------------------------------------------------------------------

_OVER = '({current_0x > 15.0} and {wind_0x > 8.0})'
_FIRST = 'not(pre({wind_0x > 8.0} or not({wind_0x > 8.0})))'
_CONDITION = f'(historically[0:10]({_OVER}) and historically[0:9](not({_FIRST})))'
_TRIGGER = f'(({_CONDITION} and pre(not({_CONDITION}))) or ({_CONDITION} and {_FIRST}))'
PATTERNS = {
    'running_example':
        f'historically(once[10:10]({_TRIGGER} and not({{current_0x <= 15.0}})) -> '
        f'once[0:9]({_FIRST} or {{current_0x <= 15.0}}))',
    'historically': 'historically[0:1000]{p}',
    'once': 'once[0:1000]{p}',
    'since': '{p} since[0:1000] {q}',
    'since_ever': '{p} since {q}',
}


def reelay_monitor(pattern: str) -> Callable[[dict[str, Any]], Any]:
    """Make a monitor, and return the function that takes one step of it."""
    reelay: Any = import_module('reelay')
    update: Callable[[dict[str, Any]], Any] = reelay.discrete_timed_monitor(
        pattern=pattern, condense=False).update
    return update


def as_rows(monitor: Monitor, inputs: Inputs) -> list[dict[str, Any]]:
    """Return the first rows in reelay's format."""
    manifest, memory = monitor.manifest, bytes(ffi.buffer(inputs.memory))
    places = [(item.name, '=' + FORMATS[item.value_type.name],
               int(monitor.pointer.inputs[number].offset))
              for number, item in enumerate(manifest.inputs)]
    return [{name: struct.unpack_from(form, memory, row * inputs.stride + offset)[0]
             for name, form, offset in places}
            for row in range(min(inputs.count, COMPARED))]


def time_reelay(ours: Ours) -> None:
    """Print the rows of a work."""
    pattern = PATTERNS[ours.work.floor]
    for name, inputs in ours.inputs():
        rows = as_rows(ours.monitor, inputs)
        update = reelay_monitor(pattern)
        theirs = [bytes([update(row)['value']]) for row in rows]
        same = difference(list(verdicts(ours.monitor, inputs)), theirs)
        mine, taken, ratio = timed(StepTimer(ours.monitor, inputs),
                                   partial(_steps, update, rows))
        show_row(ours.work.title, name, 'reelay, from Python', f'{mine:.1f} ns',
                 f'{taken:,.0f} ns', f'{ratio:,.0f}', same)


def _steps(update: Callable[[dict[str, Any]], Any], rows: list[dict[str, Any]]) -> float:
    """Return the time of a step in nanoseconds."""
    before = time.perf_counter_ns()
    for row in rows:
        update(row)
    return (time.perf_counter_ns() - before) / len(rows)


# -- what is printed ------------------------------------------------------------------------------

def compile_ours(work: Work, folder: Path) -> Ours:
    """Compile a work as a node does."""
    path = folder / f'{work.floor}.yaml'
    path.write_text(work.bundle, encoding='utf-8')
    generated = generate_monitor(read(path))
    return Ours(work, generated, compile_monitor(generated).monitor)


def compare_with_copilot(works: list[Ours], folder: Path, slow: bool) -> list[tuple[Ours, Peer]]:
    """Print the rows of all works that compile within minutes; with `slow`, of all."""
    made = []
    for ours in works:
        for way in WAYS:
            if ours.work.floor in way.slow and not slow:
                show_row(ours.work.title, '', way.title, '', '', '', 'left out: see --slow')
                continue
            made.append((ours, copilot(way, ours, folder)))
            time_copilot(*made[-1])
    return made


def show_sizes(made: list[tuple[Ours, Peer]]) -> None:
    """Print the size and state of Copilot's C and of this project's."""
    print()
    show_row('work', 'way', 'state', 'ours', 'lines of C', 'ours', 'generate', 'compile')
    print('|---|---|---|---|---|---|---|---|')
    for ours, peer in made:
        show_row(ours.work.title, peer.title, f'{peer.state_bytes:,} B',
                 f'{ours.monitor.state_bytes:,} B', f'{peer.lines:,}', f'{ours.lines:,}',
                 f'{peer.generate_seconds:.1f} s', f'{peer.compile_seconds:.1f} s')


def main() -> int:
    """Print Markdown tables of the installed peers, and name those not installed."""
    parser = ArgumentParser(description='Time other monitors beside ours, where installed.')
    parser.add_argument('--slow', action='store_true',
                        help='also what takes Copilot more than minutes')
    parser.add_argument('--folder', type=Path,
                        help="keep Copilot's C there, or take it from there")
    options = parser.parse_args()
    version, has_reelay = copilot_version(), find_spec('reelay') is not None
    print('Copilot:', version or 'not found; apt install ghc libghc-copilot-dev')
    print('reelay:', 'found' if has_reelay else 'not found; pip install reelay')
    if version or has_reelay:
        with tempfile.TemporaryDirectory() as name:
            folder = (options.folder or Path(name)).resolve()
            folder.mkdir(parents=True, exist_ok=True)
            compare_all(folder, version is not None, has_reelay, options.slow)
    return 0


def compare_all(folder: Path, has_copilot: bool, has_reelay: bool, slow: bool) -> None:
    """Print the tables."""
    works = [compile_ours(work, folder) for work in ALL_WORKS]
    print()
    show_row('work', 'inputs', 'peer', 'ours, a step', 'peer, a step', 'peer / ours', 'verdicts')
    print('|---|---|---|---|---|---|---|')
    made = compare_with_copilot(works, folder, slow) if has_copilot else []
    for ours in works if has_reelay else ():
        if ours.work.floor in PATTERNS:
            time_reelay(ours)
    if made:
        show_sizes(made)


if __name__ == '__main__':
    sys.exit(main())
