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

"""The results of `mutation`: kept from run to run, and their summary, `judged_mutants.md`."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cache
import json
import os
from pathlib import Path
import platform
import subprocess
import time

from bench.source_mutants import SourceMutant

RESULTS = Path(__file__).resolve().parent.parent / '.mutation' / 'results.jsonl'
EQUIVALENT = Path(__file__).with_name('equivalent_mutants.txt')
SUMMARY = Path(__file__).with_name('judged_mutants.md')
_ANSWERS = ('noticed', 'missed', 'equivalent', 'invalid', 'open')
_HEAD = """\
# Mutants that were judged

Written by `make mutants` ([assurance](../docs/assurance.md#3-from-the-formula-to-the-equations)).
[Those that mean the same](equivalent_mutants.txt) are not counted in the last column. The mutants
of a room are judged in the order of a hash, so that the first ones are a random sample of all.

"""


@cache
def _commit() -> str:
    return subprocess.run(['git', 'describe', '--always', '--dirty'], check=False,
                          cwd=RESULTS.parent.parent, capture_output=True, text=True).stdout.strip()


@dataclass(frozen=True)
class Result:
    """What the tests said of a mutant: `noticed`, `missed`, or `invalid` (it does not compile)."""

    key: str
    answer: str
    by: str
    """The test that failed, or how the tests ended."""
    seconds: float
    version: str
    """The hash of the mutant's file and of its tests."""
    commit: str = field(default_factory=_commit)
    date: str = field(default_factory=lambda: time.strftime('%Y-%m-%d'))


def kept_results() -> dict[str, Result]:
    """Return the last result of each mutant."""
    if not RESULTS.is_file():
        return {}
    lines = RESULTS.read_text(encoding='utf-8').splitlines()
    results = [Result(**json.loads(line)) for line in lines]
    return {result.key: result for result in results}


def keep(result: Result) -> None:
    """Add a result to those that are kept."""
    RESULTS.parent.mkdir(exist_ok=True)
    with RESULTS.open('a', encoding='utf-8') as file:
        file.write(json.dumps(asdict(result)) + '\n')


def equivalent() -> dict[str, str]:
    """Return the mutants that mean the same, with the reason why."""
    found: dict[str, str] = {}
    key = ''
    for line in EQUIVALENT.read_text(encoding='utf-8').splitlines():
        if line.startswith('    '):
            found[key] = f'{found.get(key, "")} {line.strip()}'.strip()
        elif line and not line.startswith('#'):
            key = line
    return found


def summary(rooms: Mapping[str, Sequence[SourceMutant]]) -> str:
    """Return the summary, in Markdown, of the kept results for the samples of the rooms."""
    known, same = kept_results(), equivalent()
    answers = {mutant.key: 'equivalent' if mutant.key in same else
               known[mutant.key].answer if mutant.key in known else 'open'
               for mutants in rooms.values() for mutant in mutants}
    lines = ['| room | mutants | noticed | missed | mean the same | do not compile | not judged |'
             ' noticed of those judged |', '|---|---|---|---|---|---|---|---|']
    lines += [_row(name, [answers[mutant.key] for mutant in mutants])
              for name, mutants in rooms.items()]
    lines.append(_row('all', list(answers.values())))
    missed = [f'* `{key}`' for key, answer in answers.items() if answer == 'missed']
    judged = [known[key] for key, answer in answers.items() if answer in ('noticed', 'missed')]
    return '\n'.join([_HEAD + _circumstances(judged), '', *lines,
                      *(['', 'Missed:', '', *missed] if missed else []), ''])


def _row(name: str, answers: Sequence[str]) -> str:
    counts = Counter(answers)
    both = counts['noticed'] + counts['missed']
    share = f'{100 * counts["noticed"] / both:.0f} %' if both else ''
    cells = [name, len(answers), *(counts[answer] for answer in _ANSWERS), share]
    return f'| {" | ".join(map(str, cells))} |'


def _circumstances(judged: Sequence[Result]) -> str:
    """Return when, at which commits and on which machine mutants were judged."""
    dates = sorted({result.date for result in judged})
    commits = Counter(result.commit for result in judged).most_common()
    listed = ', '.join(f'{count} at commit {commit}' for commit, count in commits)
    return (f'{" to ".join(dict.fromkeys([*dates[:1], *dates[-1:]]))}: {listed}; '
            f'{platform.machine()}, {os.cpu_count()} processors, '
            f'Python {platform.python_version()}.')
