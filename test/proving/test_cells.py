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

"""The cells of `fret_cells.h`, proved for every bound and trace; wrong cells are not proved."""

from dataclasses import replace

from fret_monitor.native.cache import runtime_headers
from fret_monitor.proving.c_source import CProgram, read_program
from fret_monitor.proving.contracts import cell_attempts, CELLS
from fret_monitor.proving.queues import prove_queue
from fret_monitor.proving.verification import cells_proved
from fret_monitor.smt.cells import COUNTERS
from fret_monitor.smt.operators import check, claims
from fret_monitor.smt.solver import ProofAnswer
import pytest
from strategies import some
import z3

HEADERS = tuple((name, text) for name, text in runtime_headers().items()
                if name in ('fret_cells.h', 'fret_monitor.h'))


def program(old: str = '', new: str = '') -> CProgram:
    """Return the cells, with a part of their text exchanged."""
    headers = dict(HEADERS)
    assert old in headers['fret_cells.h']
    headers['fret_cells.h'] = headers['fret_cells.h'].replace(old, new) if old else \
        headers['fret_cells.h']
    return read_program({'cells.c': '#include "fret_cells.h"\n'}, headers)


def test_every_cell_computes_its_operator_for_every_bound_and_every_trace() -> None:
    proofs = cells_proved(HEADERS, 60.0)
    assert [proof for proof in proofs if proof.answer is not ProofAnswer.PROVED] == []
    assert {proof.name for proof in proofs} >= {
        *CELLS, *(f'fm_{name}_at' for name in COUNTERS), 'fm_lower', 'fm_next_position',
        'fm_signed'}
    assert {f'{name}: operator' for name in (
        'once_within', 'always_within', 'since_within', 'once_before', 'since_before', 'delay',
    )} <= {proof.name for proof in proofs}


@pytest.mark.parametrize('number', range(len(claims())))
def test_no_claim_of_an_operator_rests_on_a_contradiction(number: int) -> None:
    claim = claims()[number]
    opposite = replace(claim, goal=z3.Not(claim.goal))
    assert check(opposite, 2.0).answer is not ProofAnswer.PROVED


@pytest.mark.parametrize(('function', 'old', 'new'), some([
    ('fm_once_within_u8', 'return age <= bound', 'return age < bound'),
    ('fm_always_within_u16', 'return age > bound', 'return age >= bound'),
    ('fm_since_within_u32', 'kept & fm_ones_if_ ## suffix(!q)', 'kept & fm_ones_if_ ## suffix(q)'),
    # An age that wraps is young again: after 2^8 steps, or 2^32.
    ('fm_once_within_u8', '(type)(age + 1u - (age >> (8u * sizeof(type) - 1u)))',
     '(type)(age + 1u)'),
    ('fm_once_within_u32', '(type)(age + 1u - (age >> (8u * sizeof(type) - 1u)))',
     '(type)(age + 1u)'),
    ('fm_once_before_u8', '& (before <= bound)', '& (before < bound)'),
    ('fm_since_before_u32', '*counter & fm_ones_if_ ## suffix(p)', '*counter'),
    ('fm_delay_u64', 'fm_bit(*line, steps - 1u)', 'fm_bit(*line, steps)'),
    ('fm_delay_ring', 'position & 7u', 'position & 3u'),
    ('fm_next_position', 'position + 1u == length', 'position == length'),
    ('fm_div_i64', 'return b == -1 ? fm_neg_i64(a) : a / b', 'return a / b'),
    ('fm_less_iu', 'a < 0 || (uint64_t)a < b', '(uint64_t)a < b'),
    ('fm_signed', '-(int64_t)(~bits) - 1', '-(int64_t)(~bits)'),
    # The event, or the window, ends a tick too early or too late.
    ('fm_once_within_at', 'tick - 1 + bound, *last);\n  *last', 'tick + bound, *last);\n  *last'),
    ('fm_once_within_at', 'p | (kept >= tick)', 'p | (kept > tick)'),
    ('fm_always_within_at', 'bound, !p, tick', 'bound, p, tick'),
    ('fm_since_within_at', 'fm_choice(p, before, -1)', 'before'),
    ('fm_since_within_at', '*last = fm_choice(q, FM_NEVER, kept)', '*last = kept'),
    ('fm_since_before_at', 'FM_NEVER - 1, tick - 1 + bound', 'FM_NEVER - 1, tick + bound'),
    ('fm_since_before_at', 'p & (begun <= tick)', '(begun <= tick)'),
    ('fm_since_before_at', 'FM_NEVER - (int64_t)q', 'FM_NEVER'),
    ('fm_once_before_at', 'bound, true, p', 'bound, p, true'),
    # A deadline that is too late, too early, forgotten, or of the past.
    ('fm_once_within_at', 'out & !p, kept + 1', 'out & !p, kept + 2'),
    ('fm_once_within_at', 'out & !p, kept + 1', 'out & !p, kept'),
    ('fm_since_within_at', 'out & !q, kept + 1', 'false, kept + 1'),
    ('fm_since_before_at', 'p & (begun > tick), begun', 'p, begun'),
    ('fm_since_before_at', 'fm_lower(next, p & (begun > tick), begun);', '*next = begun;'),
    ('fm_lower', 'is_due & (tick < *next)', 'is_due'),
    ('fm_choice', '(uint64_t)no ^ (', '(uint64_t)yes ^ ('),
], 2))
def test_a_cell_that_is_wrong_is_not_proved(function: str, old: str, new: str) -> None:
    proof = cell_attempts()[function](program(old, new), 20.0)
    assert proof.answer is ProofAnswer.REFUTED
    assert proof.detail


@pytest.mark.parametrize(('old', 'new'), some([
    ('tick - 1 + low : newest[0]', 'tick + low : newest[0]'),
    ('!q ? tick - 1 + high', '!q ? tick + high'),
    ('if (oldest[1] < tick) {', 'if (oldest[1] <= tick) {'),
    ('queue[1] = p ? queue[1] : 0;', ';'),
    ('newest[1] >= tick + low - 1', 'newest[1] >= tick + low'),
    ('newest[1] >= tick + low - 1', 'newest[1] >= tick + low + 1'),
    ('p ? tick + low : FM_NEVER - 1', 'tick + low'),
    ('oldest[0] <= tick;', 'oldest[0] < tick;'),
    ('fm_lower(next, true, oldest[1] + 1);', 'fm_lower(next, true, oldest[1] + 2);'),
    ('fm_lower(next, !out && oldest[0] != FM_NEVER - 1, oldest[0]);', ''),
    ('  queue[1] += 1;', ''),
    ('place < capacity ? place', 'place <= capacity ? place'),
], 3))
def test_a_queue_that_is_wrong_is_not_proved(old: str, new: str) -> None:
    assert prove_queue(program(old, new), 20.0).answer is not ProofAnswer.PROVED


def test_another_way_to_write_a_cell_is_proved_too() -> None:
    changed = program('return (type)(age + 1u - (age >> (8u * sizeof(type) - 1u)));',
                      'return (type)(age < (1u << (8u * sizeof(type) - 1u)) ? age + 1u : age);')
    for function in ('fm_once_within_u8', 'fm_since_within_u16', 'fm_always_within_u32'):
        proof = cell_attempts()[function](changed, 20.0)
        assert proof.answer is ProofAnswer.PROVED
