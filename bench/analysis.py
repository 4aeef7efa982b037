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
Time of `analyze`, and what the traces of `tests` cover and notice.

    make bench-analysis
    make bench-analysis FRET=FOLDER

FOLDER has exports of FRET projects (`*_reqts_and_vars.json`) or bundles. The made bundles of 10,
50 and 200 requirements are FRETish sentences about Boolean inputs; requirements share outputs in
threes. A mutant of a requirement is noticed if one of its traces has other verdicts.
"""

from pathlib import Path
from random import Random
import sys
from tempfile import TemporaryDirectory
import time

from fret_monitor.analysis.answers import Question
from fret_monitor.analysis.checks import analyze
from fret_monitor.analysis.replay import CompiledReplay
from fret_monitor.build import read
from fret_monitor.explain.report import meanings
from fret_monitor.importing import import_bundles, write_bundles
from fret_monitor.model.policies import Policy
from fret_monitor.testgen.recorded import history
from fret_monitor.testgen.suite import CoverageAnswer, make_suite
from fret_monitor.traces.deadline import Deadline
from testgen.mutants import mutants

ROOT = Path(__file__).resolve().parent.parent

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
    print(f'{path.name}: {len(reading.specification.properties)} requirements')
    for question in Question:
        begin = time.perf_counter()
        found = analyze(reading.specification, CompiledReplay(reading), [question],
                        denials=denials, deadline=Deadline(LIMIT_S))
        answers = [item.holds for item in found.answers]
        print(f'  {question.value:<15} {time.perf_counter() - begin:8.2f} s   '
              f'{answers.count(True):3} yes {answers.count(False):3} no '
              f'{answers.count(None):3} unknown')


def tested(path: Path) -> None:
    """Print how many obligations the tests of a bundle cover, and how many mutants they notice."""
    found = make_suite(read(path), LIMIT_S)
    names = [item.name for item in found.specification.signals]
    answers = [item.answer for item in found.covered]
    covered = answers.count(CoverageAnswer.COVERED)
    possible = len(answers) - answers.count(CoverageAnswer.UNREACHABLE)
    results = []
    for item in found.specification.properties:
        traces = [case.trace for case in found.cases if case.requirement.id == item.id]
        delta = 1 if found.specification.policy is not Policy.TIMED else 1_000_000_000
        for mutant in mutants(item, delta):
            results.append(any(
                history(item.formula, item.feedback, names, trace) !=
                history(mutant.item.formula, item.feedback, names, trace) for trace in traces))
    print(f'{path.name:24} {covered:5} / {possible} obligations   '
          f'{sum(results):5} / {len(results)} mutants', flush=True)


def bundles(folder: Path, made_in: Path) -> list[Path]:
    """Return the bundles in a folder, and those imported from exports of FRET in it."""
    found = sorted(folder.rglob('*.yaml'))
    for export in sorted(folder.rglob('*_reqts_and_vars.json')):
        imported = import_bundles([export], made_in / f'{export.stem}.yaml')
        write_bundles(imported)
        found += [item.path for item in imported]
    return found


def main() -> None:
    """Print the times of all bundles, then the tests of those in config/."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        paths = [path for given in sys.argv[1:] for path in bundles(Path(given), folder)]
        for count in (10, 50, 200):
            paths.append(folder / f'made_{count}.yaml')
            paths[-1].write_text(made(count), encoding='utf-8')
        for path in paths:
            measured(path)
    for path in sorted((ROOT / 'config').glob('*.yaml')):
        tested(path)


if __name__ == '__main__':
    main()
