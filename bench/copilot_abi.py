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
Measure a program with the C of `export --to copilot`, and the same program with Copilot's own C.

For each work of `peers.py`, one program sets the inputs from a table of random rows and calls
`step()`. It is linked with each of the three, in interleaved rounds; times are the least of the
rounds, since other work makes them longer. The number of handler calls is compared.

    make bench-copilot        (or: .venv/bin/python -m bench.copilot_abi)
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
import re
import subprocess
import sys
import tempfile

from bench.peers import ALL_WORKS, copilot_version, show_row, translate, WAYS
from bench.run import ROUNDS, Work
from fret_monitor.build import generate_monitor, GeneratedMonitor, read
from fret_monitor.export.content import Options
from fret_monitor.export.copilot import copilot
from fret_monitor.export.folder import assemble, write_export
from fret_monitor.export.sizes import section_bytes
from fret_monitor.native.compiler import COMPILE_FLAGS, find_compiler
from fret_monitor.traces.boundary import both_sides

PROGRAM = """\
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "@NAME@.h"

enum {ROWS = 4096, COMPARED = @COMPARED@};  // the first tables' calls are compared

@INPUTS@
static long calls;
@HANDLERS@

static struct {@FIELDS@} rows[ROWS];

int main(void)
{
  for (int row = 0; row < ROWS; ++row) {
@FILL@
  }
  struct timespec begin, end;
  double ns = 0.0;
  long compared = 0, tables = 0;
  clock_gettime(CLOCK_MONOTONIC, &begin);
  while (tables < COMPARED || ns < 1e8) {
    for (int row = 0; row < ROWS; ++row) {
@COPY@
      step();
    }
    if (++tables == COMPARED) {
      compared = calls;
    }
    clock_gettime(CLOCK_MONOTONIC, &end);
    ns = (double)(end.tv_sec - begin.tv_sec) * 1e9 + (double)(end.tv_nsec - begin.tv_nsec);
  }
  printf("%.2f %ld\\n", ns / ((double)ROWS * (double)tables), compared);
  return 0;
}
"""


@dataclass(frozen=True)
class Built:
    """A program with the C of one generator; bytes are those of the generated C alone."""

    title: str
    program: Path
    code: int
    data: int

    def run(self) -> tuple[float, int]:
        """Return the nanoseconds of a step, and the number of handler calls."""
        done = subprocess.run([self.program], check=True, capture_output=True, text=True).stdout
        nanoseconds, calls = done.split()
        return float(nanoseconds), int(calls)


def program_text(generated: GeneratedMonitor, name: str) -> str:
    """Return the program, in C."""
    inputs = generated.manifest.inputs
    fields = [(item.name, item.value_type.c_name) for item in inputs]
    pools = dict(zip((name for name, _ in fields), both_sides(generated.program), strict=True))
    values = {
        'NAME': name,
        'COMPARED': '10',
        'INPUTS': '\n'.join(
            f'{kind} {name};\nstatic const {kind} {name}_values[] = {{'
            + ', '.join(str(float(value)) if kind == 'float' else str(int(value))
                        for value in pools[name]) + '};' for name, kind in fields),
        'HANDLERS': '\n'.join(f'void {item.handler}(void) {{++calls;}}'
                              for item in generated.manifest.requirements),
        'FIELDS': ' '.join(f'{kind} {name};' for name, kind in fields),
        'FILL': '\n'.join(f'    rows[row].{name} = {name}_values[rand() % {len(pools[name])}];'
                          for name, _ in fields),
        'COPY': '\n'.join(f'      {name} = rows[row].{name};' for name, _ in fields),
    }
    return re.sub('@([A-Z]+)@', lambda found: values[found[1]], PROGRAM)


def built(title: str, generated: GeneratedMonitor, source: Path) -> Built:
    """Compile a program with `source`, whose header lies beside it."""
    folder, name = source.parent, source.stem
    main, made = folder / f'{name}_main.c', folder / f'{name}_generated.o'
    main.write_text(program_text(generated, name), encoding='utf-8')
    command = [*find_compiler().command, *COMPILE_FLAGS, '-D_POSIX_C_SOURCE=199309L', '-w',
               '-fno-pie', f'-I{folder}']
    subprocess.run([*command, '-c', source, '-o', made], check=True)
    subprocess.run([*command, '-no-pie', main, made, '-lm', '-o', folder / name], check=True)
    sizes = section_bytes(made.read_bytes())
    assert sizes is not None
    return Built(title, folder / name, *sizes)


def programs(work: Work, folder: Path) -> Iterator[Built]:
    """Yield our program, then those with Copilot's C, except what takes it too long."""
    path = folder / f'{work.floor}.yaml'
    path.write_text(work.bundle.replace('{id: R,', '{id: R0,'), encoding='utf-8')
    generated = generate_monitor(read(path))
    files = assemble('copilot', generated, Options(), copilot(generated, Options()))
    write_export(folder / work.floor, files)
    yield built('ours', generated, folder / work.floor / f'{work.floor}.c')
    for way in WAYS:
        if work.floor not in way.slow:
            source, _ = translate(way, work, folder)
            yield built(way.title, generated, source)


def compare(work: Work, folder: Path) -> None:
    """Print the rows of a work."""
    found = list(programs(work, folder))
    rounds = [[item.run() for item in found] for _ in range(ROUNDS)]
    least = [min(row[place][0] for row in rounds) for place, _ in enumerate(found)]
    for place, item in enumerate(found):
        calls = rounds[0][place][1]
        show_row(work.title, item.title,
                 f'{least[place]:,.1f} ns', f'{least[place] / least[0]:,.1f}',
                 f'{item.code:,} B', f'{item.data:,} B',
                 'equal' if calls == rounds[0][0][1] else f'{calls:,} for {rounds[0][0][1]:,}')


def main() -> int:
    """Print a Markdown table, if Copilot is installed."""
    version = copilot_version()
    print('Copilot:', version or 'not found; apt install ghc libghc-copilot-dev')
    if version is None:
        return 0
    print()
    show_row('work', 'C', 'a step', 'to ours', 'code', 'variables', 'calls of handlers')
    print('|---|---|---|---|---|---|---|')
    with tempfile.TemporaryDirectory() as folder:
        for work in ALL_WORKS:
            compare(work, Path(folder))
    return 0


if __name__ == '__main__':
    sys.exit(main())
