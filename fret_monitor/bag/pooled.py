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
The probabilities of several recordings together: their trials, in the order of the recordings.

It takes the lines of JSON of the recordings, so that those that were checked before count alike.
"""

from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
import json
from typing import Any

from fret_monitor.bag.results import aligned, figures_json
from fret_monitor.model.diagnostics import counted, printable, refuse
from fret_monitor.model.probability import Probability
from fret_monitor.runtime.probability import Figures, PooledTest

_HEADS = ('requirement', 'probability', 'verdict', 'trials', 'failures', 'estimate', 'interval',
          'more')


def pooled(lines: Iterable[str]) -> dict[str, Figures]:
    """
    Return what the tests of all requirements with a probability find, by id.

    Raises
    ------
    CompileError
        if recordings were checked with other probabilities or confidences.
    """
    tests: dict[str, tuple[Probability, PooledTest]] = {}
    for content in map(json.loads, lines):
        for name, found in content['requirements'].items():
            if 'probability' in found:
                _test_of(tests, name, found['probability'], content['bag']).add_runs(
                    found['probability']['runs'])
    return {name: test.figures() for name, (_, test) in tests.items()}


def _test_of(tests: dict[str, tuple[Probability, PooledTest]], name: str,
             found: Mapping[str, Any], bag: str) -> PooledTest:
    relation, bound = found['required'].split()
    asked = Probability(relation, Fraction(bound), Fraction(found['confidence']))
    if name not in tests:
        tests[name] = asked, PooledTest(asked)
    if tests[name][0] != asked:
        refuse(f"'{name}' has another probability in the results of '{bag}'",
               help='check all recordings with one bundle')
    return tests[name][1]


def pooled_json(found: Mapping[str, Figures], count: int) -> str:
    """Return the figures as a line of JSON, for so many recordings."""
    return json.dumps({'bags': count, 'pooled': {
        name: figures_json(item) for name, item in found.items()}}, ensure_ascii=False)


def pooled_rows(found: Mapping[str, Figures],
                required: Mapping[str, str]) -> list[Sequence[str]]:
    """Return the heads and a row a requirement; `required` as `required_of`."""
    return [_HEADS, *(_row(name, required[name], item) for name, item in found.items())]


def pooled_table(found: Mapping[str, Figures], required: Mapping[str, str], count: int) -> str:
    """Return the figures for a terminal; `required` are the relations and bounds, by id."""
    rows = pooled_rows(found, required)
    widths = [max(len(row[column]) for row in rows) for column in range(len(_HEADS))]
    return '\n'.join([f'probabilities, over {counted(count, "recording")}:',
                      *(aligned(row, widths, words=3) for row in rows)])


def required_of(lines: Iterable[str]) -> dict[str, str]:
    """Return the relation and the bound of each requirement with a probability, by id."""
    return {name: found['probability']['required'] for content in map(json.loads, lines)
            for name, found in content['requirements'].items() if 'probability' in found}


def _row(name: str, required: str, item: Figures) -> Sequence[str]:
    shown = item.verdict.upper() if item.verdict == 'refuted' else item.verdict
    more = '-' if item.verdict != 'open' else '?' if item.more is None else f'{item.more:,}'
    return (printable(name), required, shown, f'{item.trials:,}', f'{item.failures:,}',
            f'{item.estimate:.6g}' if item.trials else '-', f'{item.low:.6g} .. {item.high:.6g}',
            more)
