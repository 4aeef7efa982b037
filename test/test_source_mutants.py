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

"""The mutants of `make mutants`: what is changed, and which are chosen."""

import ast
from pathlib import Path

from bench.mutation import mutants_of, ROOMS
from bench.mutation_results import equivalent, keep, Result, summary
from bench.source_mutants import changes, sample
import pytest

ROOT = Path(__file__).resolve().parent.parent
C = """\
// a < b
static int f(int a, char * s)
{
  if (a <= 2 && !g(a)) {
    note("x == y");
    a = a + 1;
  }
  return true;
}
"""
PYTHON = """\
def f(a: int = 3) -> str:
    if a is not None and (a < 2):  # a == b
        note('x == y')
        self.a = a - 1
"""


def changed(path: str, text: str) -> set[tuple[str, str]]:
    return {(item.before, item.after) for item in changes(path, text)}


def test_operators_numbers_conditions_and_statements_of_c_are_changed() -> None:
    line = 'if (a <= 2 && !g(a)) {'
    assert changed('f.c', C) == {
        (line, 'if (a < 2 && !g(a)) {'), (line, 'if (a <= 2 || !g(a)) {'),
        (line, 'if (a <= 2 && g(a)) {'), (line, 'if (a <= 3 && !g(a)) {'),
        (line, 'if (a <= 1 && !g(a)) {'), (line, 'if (!(a <= 2 && !g(a))) {'),
        ('note("x == y");', ';'), ('a = a + 1;', ';'), ('a = a + 1;', 'a = a - 1;'),
        ('a = a + 1;', 'a = a;'), ('a = a + 1;', 'a = a + 2;'), ('a = a + 1;', 'a = a + 0;'),
        ('return true;', 'return false;')}


def test_operators_numbers_conditions_and_statements_of_python_are_changed() -> None:
    line = 'if a is not None and (a < 2): # a == b'
    assert changed('f.py', PYTHON) == {
        (line, 'if a is None and (a < 2): # a == b'), (line, line.replace(' and ', ' or ')),
        (line, line.replace('<', '<=')), (line, line.replace('2', '3')),
        (line, line.replace('2', '1')), (line, 'if (not (a is not None and (a < 2))): # a == b'),
        ("note('x == y')", 'pass'), ('self.a = a - 1', 'pass'), ('self.a = a - 1', 'self.a = a'),
        ('self.a = a - 1', 'self.a = a + 1'), ('self.a = a - 1', 'self.a = a - 2'),
        ('self.a = a - 1', 'self.a = a - 0')}


def test_the_sample_of_unchanged_lines_is_the_same_after_an_edit_elsewhere() -> None:
    before = sample(changes('f.c', C), 5)
    after = sample(changes('f.c', C.replace('static int f', '\nstatic int of_another_name')), 5)
    assert [item.key for item in before] == [item.key for item in after]


def test_every_mutant_of_the_sample_is_python_and_has_tests() -> None:
    chosen = [(room, item) for room in ROOMS.values() for item in mutants_of(room, room.mutants)]
    assert len(chosen) > 300
    for room, mutant in chosen:
        text = (ROOT / mutant.path).read_text(encoding='utf-8')
        if mutant.path.endswith('.py'):
            ast.parse(mutant.applied(text))
        for test in room.tests_of(mutant.path):
            assert (ROOT / test.partition('::')[0]).exists(), test


def test_mutants_that_mean_the_same_are_given_with_a_reason() -> None:
    assert all(' => ' in key and reason for key, reason in equivalent().items())


def test_the_summary_counts_what_was_judged_and_lists_what_was_missed(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('bench.mutation_results.RESULTS', tmp_path / 'results.jsonl')
    found = changes('f.c', C)[:5]
    for mutant, answer in zip(found, ('missed', 'noticed', 'invalid', 'missed')):
        keep(Result(mutant.key, answer, '', 1.0, '', 'abc', '2026-11-23'))
    keep(Result(found[0].key, 'noticed', '', 1.0, '', 'def', '2026-11-24'))  # by a new test
    text = summary({'room': found, 'other': []})
    assert '| room | 5 | 2 | 1 | 0 | 1 | 1 | 67 % |\n| other | 0 | 0 |' in text
    assert '\n2026-11-23 to 2026-11-24: 2 at commit abc, 1 at commit def; ' in text
    assert text.endswith(f'\n* `{found[3].key}`\n')
