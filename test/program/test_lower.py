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

"""Lowering of formulas: which terms are shared, which rewritten, and which remain."""

from pathlib import Path
from random import Random

from differential.compiled import Compiled
from fret_monitor.build import build, build_specification
from fret_monitor.logic.evaluate import evaluate_all
from fret_monitor.logic.formula import Variable
from fret_monitor.logic.specification import Specification
from fret_monitor.native.monitor import Monitor
from fret_monitor.program.lower import lower
from fret_monitor.traces.csv_trace import parse_seconds, seconds_text
from fret_monitor.traces.simulate import simulate
from program.written import operations, specified
import pytest
from strategies import random_trace, Trace
from traces.timed_traces import timed

# Terms of one group that must become one equation.
SAME = [
    ('p & q', 'q & p'),
    ('p & q', '!(!p | !q)'),
    ('p | q', '!(!q & !p)'),
    ('p -> q', '!p | q'),
    ('p -> q', '!(p & !q)'),
    ('p xor q', 'q xor p'),
    ('p xor q', '!p xor !q'),
    ('p xor q', '!(p <-> q)'),
    ('p <-> q', 'q <-> p'),
    ('p <-> q', '!p xor q'),
    ('p = q', 'p <-> q'),
    ('p != q', 'p xor q'),
    ('x = y', 'y = x'),
    ('x != y', '!(x = y)'),
    ('x < y', 'y > x'),
    ('x <= y', 'y >= x'),
    ('u = m', 'm = u'),
    ('u < m', 'm > u'),
    ('H p', '!(O !p)'),
    ('p S q', '!(!p T !q)'),
    ('Y p', '!(Z !p)'),
    ('H[0,5] p', '!(O[0,5] !p)'),
    ('H[2,5] p', '!(O[2,5] !p)'),
    ('H[3,2147483647] p', '!(O[3,2147483647] !p)'),
    ('O[5,5] p', '!(H[5,5] !p)'),
    ('p S[0,5] q', '!(!p T[0,5] !q)'),
    ('p SI q', 'p S (p & q)'),
    ('p S[=3] q', 'p S[3,3] q'),
    ('!!p & q', 'p & q'),
    ('TRUE S p', 'O p'),
    ('FALSE T p', 'H p'),
    ('TRUE S[2,5] p', 'O[2,5] p'),
    ('O[<5] p', 'O[0,4] p'),
    ('O[>=5] p', 'O[>4] p'),
    ('x + y > 0', 'x + y > 0.0'),
]
# Terms that must not: they differ for NaN, wrapping or time, or by the order of operands.
DIFFERENT = [
    ('x < y', '!(x >= y)'),
    ('x < y', 'y < x'),
    ('x + y > 0', 'y + x > 0'),
    ('p S q', 'q S p'),
    ('Y p', 'Z p'),
    ('O p', 'H p'),
    ('O[0,5] p', 'O[0,6] p'),
    ('O[0,5] p', 'H[0,5] p'),
    ('p -> q', 'q -> p'),
    ('Y Y p', 'Y p'),
]

# Formulas and the operations that they lower to.
KINDS = [
    # constants
    ('p & TRUE', ''), ('p & FALSE', ''), ('p | TRUE', ''), ('p & p', ''), ('p & !p', ''),
    ('p | !p', ''), ('p xor p', ''), ('p <-> !p', ''), ('p xor TRUE', ''), ('p -> p', ''),
    ('O FALSE', ''), ('H TRUE', ''), ('O TRUE', ''), ('H FALSE', ''), ('Y FALSE', ''),
    ('Z TRUE', ''), ('p S FALSE', ''), ('p S TRUE', ''), ('FALSE S p', ''), ('FALSE S[1,4] p', ''),
    ('p T TRUE', ''), ('p T FALSE', ''), ('O[0,-1] p', ''), ('H[0,-1] p', ''), ('p S[0,-1] q', ''),
    ('p T[0,-1] q', ''), ('O[0,0] p', ''), ('H[0,0] p', ''), ('p S[0,0] q', ''),
    ('O[0,9] TRUE', ''), ('p & FALSE & O q', ''), ('x < x', ''), ('n = n', ''), ('n <= n', ''),
    ('m > 9223372036854775807', ''), ('u >= 0', ''), ('u < 0', ''),
    ('m >= -9223372036854775808', ''), ('9223372036854775807 >= m', ''), ('0 > u', ''),
    ('x = x', 'ApplyBinary'), ('x >= x', 'ApplyBinary'), ('x != x', 'ApplyBinary'),
    # the first time point
    ('FTP', 'FirstStep'), ('Y TRUE', 'FirstStep'), ('Z FALSE', 'FirstStep'),
    ('Y p | FTP', 'Delay'), ('FTP | Y p', 'Delay'), ('Z p & !FTP', 'Delay'),
    ('!FTP & Y p', 'Delay'),
    ('O[3,7] TRUE', 'OnceBefore'), ('Y Y TRUE', 'Delay FirstStep'),
    ('O[0,5] FTP', 'OnceBefore'), ('H[0,5] !FTP', 'OnceBefore'),
    ('O[0,5] (FTP | p)', 'OnceWithin'), ('O[0,5] (p | FTP)', 'OnceWithin'),
    ('H[0,5] (p & !FTP)', 'AlwaysWithin'), ('H[0,5] p & H[0,3] !FTP', 'AlwaysWithin'),
    ('H[0,3] !FTP & H[0,5] p', 'AlwaysWithin'), ('H[0,5] p & H[0,5] !FTP', 'AlwaysWithin'),
    ('H[0,5] p & H[0,6] !FTP', 'AlwaysWithin ApplyBinary OnceBefore'),
    ('H[0,5] p & H[0,3] !FTP & H[0,4] !FTP', 'AlwaysWithin'),
    ('H[0,5] p & H[0,4] !FTP & H[0,3] !FTP', 'AlwaysWithin'),
    ('O[0,5] p | O[0,3] FTP', 'OnceWithin'),
    # factors
    ('(p & q) | (p & r)', 'ApplyBinary ApplyBinary'),
    ('(p & q) | (r & p)', 'ApplyBinary ApplyBinary'),
    ('(p | q) & (p | r)', 'ApplyBinary ApplyBinary'),
    ('(p & q) | (p & !q)', ''),
    # choices
    ('ite(p, q, q)', ''), ('ite(p, TRUE, q)', 'ApplyBinary'), ('ite(p, q, FALSE)', 'ApplyBinary'),
    ('ite(p, p, q)', 'ApplyBinary'), ('ite(p, !p, q)', 'ApplyBinary'),
    ('ite(p, q, p)', 'ApplyBinary'), ('ite(p, q, !p)', 'ApplyBinary'),
    ('ite(p, q, r)', 'Choose'), ('ite(TRUE, q, r)', ''),
    ('ite(!p, q, r) | ite(p, r, q)', 'Choose'),
    # windows
    ('O p', 'OnceEver'), ('H p', 'AlwaysSoFar'), ('p S q', 'SinceEver'),
    ('p T q', 'TriggeredEver'), ('O[0,9] p', 'OnceWithin'), ('H[0,9] p', 'AlwaysWithin'),
    ('p S[0,9] q', 'SinceWithin'),
    ('p T[0,9] q', 'SinceWithin'), ('O[9,9] p', 'Delay'), ('H[9,9] p', 'Delay'),
    ('O[3,9] p', 'Delay OnceWithin'), ('H[3,9] p', 'AlwaysWithin Delay'),
    ('O[>=3] p', 'OnceBefore'), ('H[>=3] p', 'OnceBefore'), ('p S[>=3] q', 'SinceBefore'),
    ('p S[3,9] q', 'AlwaysWithin ApplyBinary Delay SinceWithin'),
    ('p S[1,1] q', 'ApplyBinary Delay'),
    ('O[2,5] p & O[2,7] p', 'ApplyBinary Delay OnceWithin OnceWithin'),
    ('O[2,5] p & H[2,5] p', 'AlwaysWithin ApplyBinary Delay Delay OnceWithin'),
    # FRET's deadlines
    ('H (O[5,5] p -> O[0,4] q)', 'AlwaysSoFar SinceBefore'),
    ('H (O[5,5] (p & Z !p & !q) -> O[0,4] (FTP | q))',
     'AlwaysSoFar ApplyBinary ApplyBinary Delay SinceBefore'),
    ('H (O[1,1] p -> O[0,0] q)', 'AlwaysSoFar SinceBefore'),
    ('H (O[5,5] p -> O[0,5] q)', 'AlwaysSoFar ApplyBinary Delay OnceWithin'),
    ('H (O[5,5] p -> O[0,3] q)', 'AlwaysSoFar ApplyBinary Delay OnceWithin'),
    ('H (O[5,6] p -> O[0,4] q)', 'AlwaysSoFar ApplyBinary Delay OnceWithin OnceWithin'),
    ('H (O[5,5] p -> O[1,4] q)', 'AlwaysSoFar ApplyBinary Delay Delay OnceWithin'),
    ('H[0,9] (O[5,5] p -> O[0,4] q)', 'AlwaysWithin ApplyBinary Delay OnceWithin'),
    ('n + 1 > 2', 'ApplyBinary ApplyBinary'), ('n ^ 3 > 2', 'ApplyBinary Power'),
]


@pytest.mark.parametrize(('one', 'other'), SAME)
def test_equal_terms_are_computed_once(one: str, other: str) -> None:
    group = lower(specified(one, other)).groups[0]
    first, second = group.verdicts
    assert first == second


@pytest.mark.parametrize(('one', 'other'), DIFFERENT)
def test_different_terms_are_computed_separately(one: str, other: str) -> None:
    first, second = lower(specified(one, other)).groups[0].verdicts
    assert first.value != second.value


@pytest.mark.parametrize(('formula', 'expected'), KINDS)
def test_a_formula_lowers_to_few_operations(formula: str, expected: str) -> None:
    assert ' '.join(operations(formula)) == expected


def trace_of(specification: Specification, seed: int) -> Trace:
    """Return values for all inputs, with runs of every length."""
    inputs = [Variable(item.name, item.type) for item in specification.signals]
    return random_trace(Random(seed), inputs, 250)


def test_sharing_and_rewriting_preserve_the_meaning() -> None:
    pairs = [item for pair in (*SAME, *DIFFERENT) for item in pair]
    formulas = list(dict.fromkeys([*pairs, *(item for item, _ in KINDS)]))
    specification = specified(*formulas)
    assert len(lower(specification).groups) < len(formulas)
    for seed in range(6):
        trace = trace_of(specification, seed)
        compiled = Compiled(specification).run(trace, resets=(7, 100))
        for start, stop in ((0, 7), (7, 100), (100, 250)):
            cut = {name: column[start:stop] for name, column in trace.items()}
            expected = evaluate_all([item.formula for item in specification.properties], cut)
            for number, formula in enumerate(formulas):
                assert compiled[number][start:stop] == expected[number], formula


BURSTS = """format: 1
evaluation: {policy: timed}
inputs:
  r: {topic: t, type: std_msgs/msg/Bool, field: received(), max_rate: 4}
requirements:
  - {id: R, ptltl: "O[=1 s] r"}
"""


def true_ticks(monitor: Monitor, folder: Path, text: str, until: int) -> list[int]:
    """Return the times (ns) in a trace at which a requirement becomes true."""
    (folder / 'trace.csv').write_text(text, encoding='utf-8')
    simulate(monitor, folder / 'trace.csv', folder / 'out.csv', until=until)
    _, *rows = (folder / 'out.csv').read_text(encoding='utf-8').splitlines()
    cells = [row.split(',') for row in rows]
    return [parse_seconds(time) for time, flag in cells if flag == '1']


def test_a_window_keeps_all_messages_that_max_rate_allows(tmp_path: Path) -> None:
    (tmp_path / 'bursts.yaml').write_text(BURSTS, encoding='utf-8')
    # The last of one second and the first of the next, two nanoseconds apart.
    times = range(10 ** 9 - 8, 10 ** 9 + 8, 2)
    text = 'time,r\n' + ''.join(f'{seconds_text(time)},1\n' for time in times)
    monitor = build(tmp_path / 'bursts.yaml').monitor
    assert true_ticks(monitor, tmp_path, text, 3 * 10 ** 9) == [
        time + 10 ** 9 for time in times]


def test_a_window_keeps_what_windows_within_it_add(tmp_path: Path) -> None:
    pulses = ' | '.join(f'{"Y " * steps}FTP' for steps in (1, 3, 5, 7))
    monitor = build_specification(timed(specified(f'O[=400] ({pulses}) | p & !p'))).monitor
    names = [item.name for item in monitor.manifest.inputs]
    text = ','.join(['time', *names]) + '\n' + ','.join(['0'] * (len(names) + 1)) + '\n'
    assert true_ticks(monitor, tmp_path, text, 1000) == [401, 403, 405, 407]
