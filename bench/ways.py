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
What ways in cost: an import of a table, and bounded future beside the same question of the past.

The import is compared with parsing each of its sentences once, `mltl` with a formula of the past
that has the same verdicts: the times are the least of interleaved rounds. The times of an import
are those of the processor.

    python -m bench.ways [--rows N]
"""

from argparse import ArgumentParser
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
import time

from bench.run import HEAD, verdicts
from fret_monitor.build import compile_monitor, generate_monitor, read
from fret_monitor.importing import import_bundles, write_bundles
from fret_monitor.language.fretish import parse_fretish
from fret_monitor.model.diagnostics import Source, Text
from fret_monitor.native.monitor import Monitor
from fret_monitor.traces.benchmark import lasting_inputs, random_inputs, StepTimer
from fret_monitor.traces.boundary import both_sides
from fret_monitor.traces.trace import Value

ROWS = 10_000
ROUNDS = 51
HORIZONS = (10, 1000, 100_000)
QUESTIONS = (  # `n` stands for a horizon
    ('p -> F[0,n] q', 'O[n,n] p -> O[0,n] q'),
    ('G[0,n] p', 'O[n,n] TRUE -> H[0,n] p'))


def main() -> None:
    """Measure, and print tables."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument('--rows', type=int, default=ROWS, metavar='N')
    rows = parser.parse_args().rows
    with TemporaryDirectory() as folder:
        _show(('rows', 'parsed once', 'import', 'ratio'), _imports(rows, Path(folder)))
        memory: list[tuple[str, ...]] = []
        _show(('`mltl`', 'inputs', 'a step', 'of the past', 'ratio'),
              _futures(Path(folder), memory))
        _show(('`mltl`', 'state', 'of the past'), iter(memory))


def _imports(rows: int, folder: Path) -> Iterator[tuple[str, ...]]:
    """Import tables of sentences."""
    for count in (rows // 10, rows):
        sentences = [f'when speed_{k % 100} > {k}.0 the rover shall within 10 ticks satisfy '
                     f'speed_{k % 100} <= {k}.0' for k in range(count)]
        table, target = folder / f'{count}.csv', folder / f'{count}.yaml'
        table.write_text('id,text\n' + ''.join(f'R-{k},{sentence}\n' for k, sentence
                                               in enumerate(sentences)), encoding='utf-8')
        begin = time.process_time()
        for sentence in sentences:
            parse_fretish(Text.whole(Source('', sentence)))
        parsed = time.process_time() - begin
        write_bundles(import_bundles([table], target))
        whole = time.process_time() - begin - parsed
        yield f'{count:,}', f'{parsed:.2f} s', f'{whole:.2f} s', f'{whole / parsed:.2f}'


def _futures(folder: Path, memory: list[tuple[str, ...]]) -> Iterator[tuple[str, ...]]:
    """Time steps of both forms of each question in turn; add their states to `memory`."""
    for future, past in QUESTIONS:
        for horizon in HORIZONS:
            title = future.replace('n', str(horizon))
            ours, values = _monitor(folder, f'mltl: "{title}"')
            theirs, _ = _monitor(folder, f'ptltl: "{past.replace("n", str(horizon))}"')
            for name, fill in (('random', random_inputs), ('long-lasting', lasting_inputs)):
                inputs = fill(ours, values)
                if verdicts(ours, inputs) != verdicts(theirs, inputs):
                    raise SystemExit(f'{title}: the formula of the past gives other verdicts')
                timers = StepTimer(ours, inputs), StepTimer(theirs, inputs)
                found = [(timers[0].round(), timers[1].round()) for _ in range(ROUNDS)]
                one, two = (min(times) for times in zip(*found, strict=True))
                yield (f'`{title}`', name, f'{one:.1f} ns', f'{two:.1f} ns', f'{one / two:.2f}')
            memory.append((f'`{title}`', f'{ours.state_bytes} B', f'{theirs.state_bytes} B'))


def _monitor(folder: Path, text: str) -> tuple[Monitor, list[list[Value]]]:
    path = folder / 'question.yaml'
    path.write_text(f'{HEAD}inputs: {{p: {{type: bool}}, q: {{type: bool}}}}\n'
                    f'requirements: [{{id: R, {text}}}]\n', encoding='utf-8')
    generated = generate_monitor(read(path))
    return compile_monitor(generated).monitor, both_sides(generated.program)


def _show(head: tuple[str, ...], rows: Iterator[tuple[str, ...]]) -> None:
    for row in (head, ('---',) * len(head), *rows):
        print('| ' + ' | '.join(row) + ' |' if row[0] != '---' else '|' + '|'.join(row) + '|',
              flush=True)
    print()


if __name__ == '__main__':
    main()
