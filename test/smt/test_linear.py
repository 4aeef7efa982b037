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

"""Words as integers: sums wrap around and comparisons are those of words, as in `FUNCTIONS`."""

from random import Random

from fret_monitor.smt import terms as t
from fret_monitor.smt.solver import ProofAnswer, prove_linear
import pytest

EDGES = (0, 1, 127, 128, 129, 255)


@pytest.mark.parametrize('op', ['add', 'sub', 'slt', 'ult', 'equal'])
def test_an_operation_is_that_of_words(op: str) -> None:
    rng = Random(1)
    pairs = [(a, b) for a in EDGES for b in EDGES]
    pairs += [(rng.randrange(256), rng.randrange(256)) for _ in range(20)]
    a, b = t.variable('a', t.word(8)), t.variable('b', t.word(8))
    is_relation = op in t.RELATIONS
    item = t.relation(op, a, b) if is_relation else t.operation(op, a, b)
    for one, other in pairs:
        given = [t.relation('equal', a, t.number(one, 8)),
                 t.relation('equal', b, t.number(other, 8))]
        value = t.apply(op, item.sort, [one, other], [a.sort, b.sort])
        goal = t.same(item, t.constant(value, item.sort))
        assert prove_linear(goal, given).answer is ProofAnswer.PROVED, (op, one, other)
        assert prove_linear(t.negation(goal), given).answer is ProofAnswer.REFUTED


def test_a_word_is_extended_with_its_sign_and_shown_without() -> None:
    a = t.variable('a', t.word(8))
    minus = t.relation('equal', a, t.number(-1, 8))
    wide = t.relation('equal', t.resized(a, 16, True), t.number(-1, 16))
    assert prove_linear(wide, [minus]).answer is ProofAnswer.PROVED
    found = prove_linear(t.negation(minus))
    assert (found.answer, dict(found.values)) == (ProofAnswer.REFUTED, {a: 255})


def test_other_operations_are_left_to_the_words() -> None:
    a = t.variable('a', t.word(8))
    both = t.operation('bitand', a, t.number(1, 8))
    assert prove_linear(t.relation('ult', both, t.number(2, 8))).answer is ProofAnswer.PROVED
