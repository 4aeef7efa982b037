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

"""Random traces distinguish wordings that differ, and no others."""

from fractions import Fraction

from fret_monitor.importing.compare import differences
from fret_monitor.importing.draft import Comparison
from fret_monitor.language.smv import parse_smv
from fret_monitor.logic.evaluate import verdicts
from fret_monitor.logic.formula import Variable
from fret_monitor.logic.specification import Property
from fret_monitor.model.diagnostics import Source, Text
from fret_monitor.model.policies import Report, Severity
from fret_monitor.model.values import ValueType
import pytest
from stages import elaborate, scope_of

SCOPE = scope_of([
    Variable('p', ValueType.BOOL), Variable('q', ValueType.BOOL),
    Variable('x', ValueType.FLOAT64), Variable('y', ValueType.FLOAT32),
    Variable('n', ValueType.INT8), Variable('u', ValueType.UINT64)], {'c': Fraction(15, 2)})


def wording(formula: str) -> Property:
    tree = parse_smv(Text.whole(Source('f', formula)))
    return Property('A', 'h', formula, '', elaborate(tree, SCOPE), Report.EVERY_STEP,
                    Severity.ERROR)


def compare(first: str, other: str) -> Comparison:
    return Comparison('A', (('first', wording(first)), ('other', wording(other))))


@pytest.mark.parametrize('first, other', [
    ('H p', 'O p'),
    ('H (x <= c)', 'H (x < c)'),
    ('H (y < 0.25)', 'H (y <= 0.25)'),
    ('H (n > -128)', 'TRUE'),
    ('H (u >= 1)', 'TRUE'),
    ('H (p -> O[0,9] q)', 'H (p -> O[0,10] q)'),
    ('H ((H[0,60] p) -> q)', 'H ((H[0,61] p) -> q)'),
    ('Z FALSE', 'FALSE'),
    ('TRUE', 'FALSE')])
def test_a_difference_is_found_and_its_trace_shows_it_at_its_last_step(
        first: str, other: str) -> None:
    pair = compare(first, other)
    [found] = differences(pair)
    trace = dict(found.trace) or {'p': [False]}
    mine, others = (verdicts(item.formula, trace) for _, item in pair.properties)
    assert mine[:-1] == others[:-1]
    assert mine[-1] is found.verdict
    assert others[-1] is not found.verdict
    assert found.step == len(mine) - 1
    assert (found.first, found.other) == ('first', 'other')


@pytest.mark.parametrize('first, other', [
    ('H (p & q)', '(H q) & (H p)'),
    ('H (x < c)', 'H (! (x >= c))'),
    ('H (p -> O[0,9] q)', '! (O (p & H[0,9] (! q)))'),
    ('p S q', '! ((! p) T (! q))')])
def test_no_difference_is_reported_where_there_is_none(first: str, other: str) -> None:
    assert differences(compare(first, other)) == []


def test_the_same_pair_gives_the_same_trace() -> None:
    one, two = (differences(compare('H p', 'O p')) for _ in range(2))
    assert one == two
