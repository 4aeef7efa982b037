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
Time of `analyze` on FRET's case studies, and on bundles of 10, 50 and 200 requirements.

    python -m bench.analysis [FOLDER]

FOLDER has bundles imported from FRET's case studies. The made bundles are FRETish sentences about
Boolean inputs; requirements share outputs in threes.
"""

from pathlib import Path
from random import Random
import sys
from tempfile import TemporaryDirectory
import time

from fret_monitor.analysis.answers import Question
from fret_monitor.analysis.checks import analyze
from fret_monitor.analysis.deadline import Deadline
from fret_monitor.analysis.replay import CompiledReplay
from fret_monitor.build import read
from fret_monitor.explain.report import meanings

LIMIT_S = 60.0
TIMINGS = ('immediately', 'within 5 ticks', 'within 1000 ticks', 'for 3 ticks',
           'at the next timepoint', 'always')


def made(count: int, seed: int = 0) -> str:
    """Return a bundle of some requirements."""
    rng = Random(seed)
    outputs = max(1, count // 3)
    lines = ['format: 1', 'component: c', 'inputs:']
    lines += [f'  i{number}: {{type: bool}}' for number in range(outputs)]
    lines += [f'  o{number}: {{type: bool, role: output}}' for number in range(outputs)]
    lines.append('requirements:')
    for number in range(count):
        place = number % outputs
        condition = f'i{place} & {"!" if number % 2 else ""}i{rng.randrange(outputs)}'
        response = f'{"!" if rng.random() < 0.03 else ""}o{place}'
        lines.append(f'  - {{id: R{number}, fretish: "when {condition} the c shall '
                     f'{rng.choice(TIMINGS)} satisfy {response}"}}')
    return '\n'.join(lines) + '\n'


def measured(path: Path) -> None:
    """Analyse a bundle, and print its times."""
    reading = read(path)
    denials = {name: item.denial for name, item in meanings(reading).items()
               if item.denial is not None}
    print(f'{path.parent.name}/{path.name}: {len(reading.specification.properties)} requirements')
    for question in Question:
        begin = time.perf_counter()
        found = analyze(reading.specification, CompiledReplay(reading), [question],
                        denials=denials, deadline=Deadline(LIMIT_S))
        answers = [item.holds for item in found.answers]
        print(f'  {question.value:<15} {time.perf_counter() - begin:8.2f} s   '
              f'{answers.count(True):3} yes {answers.count(False):3} no '
              f'{answers.count(None):3} unknown')


def main() -> None:
    """Print the times of all bundles."""
    for folder in sys.argv[1:]:
        for path in sorted(Path(folder).rglob('*.yaml')):
            measured(path)
    with TemporaryDirectory() as folder:
        for count in (10, 50, 200):
            path = Path(folder) / f'made_{count}.yaml'
            path.write_text(made(count), encoding='utf-8')
            measured(path)


if __name__ == '__main__':
    main()
