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

"""Groups that step at ticks, and verdicts for occurrences: proved; wrong C is not proved."""

from collections.abc import Sequence
import ctypes
from dataclasses import replace
from fractions import Fraction
from itertools import product
import math
from pathlib import Path
from random import Random
from typing import Any

from bench.mutants import generated_functions, mutants
from codegen.workbench import specify
from differential.compiled import compile_c, CSRC, gcc
from fret_monitor.build import generate_monitor, GeneratedMonitor, Reading
from fret_monitor.logic.formula import (
    Aggregate, Ago, Binary, BinaryOperator, Constant, Formula, Historically, Once, Over, Since,
    Slope, TimeOver, Variable, Window, Yesterday,
)
from fret_monitor.model.policies import Policy, Report
from fret_monitor.model.values import ValueType
from fret_monitor.program.monitor_program import SinceBetween
from fret_monitor.proving.monitor import prove_group, prove_whole, wrong_types
from fret_monitor.proving.obligations import Proof
from fret_monitor.proving.verification import read_subject
from proving.workbench import exchanged
import pytest
from strategies import FormulaMaker, INPUTS, some, thorough

P, Q = Variable('p', ValueType.BOOL), Variable('q', ValueType.BOOL)
EVER = Window(0, None)


def generated(formulas: Sequence[Formula], policy: Policy = Policy.TIMED,
              report: Report = Report.OCCURRENCE) -> GeneratedMonitor:
    """Return the C of some formulas; every input has a rate, as windows `[a,a]` need."""
    found = specify(list(formulas))
    return generate_monitor(Reading(replace(
        found, policy=policy,
        signals=tuple(replace(item, max_rate=Fraction(10 ** 8)) for item in found.signals),
        properties=tuple(replace(item, report=report) for item in found.properties),
    ), (), '', ()))


def proofs(monitor: GeneratedMonitor, old: str = '', new: str = '') -> list[Proof]:
    """Return all proofs of a monitor, with a part of its C exchanged."""
    if old:
        monitor = exchanged(monitor, monitor.module.sources[0][0], old, new)
    subject = read_subject(monitor)
    groups = range(len(subject.layouts))
    wrong = [proof for group in groups for proof in wrong_types(subject, group)]
    found = [prove_group(subject, group, 60.0) for group in groups]
    return [*wrong, *(proof for item in [*found, prove_whole(subject, 60.0)]
                      for proof in item.proofs)]


def failures(found: list[Proof]) -> list[str]:
    return [f'{proof.name}: {proof.detail}' for proof in found if not proof.is_proved]


@pytest.mark.parametrize('seed', some(range(3), 3))
def test_random_formulas_are_proved(seed: int) -> None:
    maker = FormulaMaker(Random(seed).randrange)
    found = proofs(generated([maker.formula(50) for _ in range(20)]))
    assert failures(found) == []
    names = {proof.name.partition(': ')[2] for proof in found}
    assert {'next tick', 'no value changes before the next tick'} <= names


@thorough  # test_monitors has the same of steps
def test_a_group_of_many_parts_is_proved() -> None:
    maker = FormulaMaker(Random(5).randrange, INPUTS[:3])
    monitor = generated([maker.formula(60) for _ in range(60)])
    assert max(len(item.parts) for item in monitor.layouts) > 1
    assert failures(proofs(monitor)) == []


@pytest.mark.parametrize('policy', [Policy.EVERY_MESSAGE, Policy.TIMED])
def test_the_verdict_of_an_occurrence_is_proved(policy: Policy) -> None:
    monitor = generated(
        [Historically(EVER, P), Once(EVER, Q), Historically(EVER, Yesterday(Q))], policy)
    found = proofs(monitor)
    assert failures(found) == []
    assert {proof.name for proof in found if 'occurrences' in proof.name} \
        == {'group 0: occurrences of R-0', 'group 1: occurrences of R-2'}
    wrong = proofs(monitor, 'verdicts[random_occ_R_0] = ', 'verdicts[random_occ_R_2] = ')
    assert any('occurrences of R-0' in text for text in failures(wrong))
    assert any('nothing else is written' in text for text in failures(wrong))


WITHIN = Once(Window(0, 5), P)
BETWEEN = Since(Window(2, 5), P, Q)
D, TRUE = Variable('d', ValueType.FLOAT64), Constant(True, ValueType.BOOL)


def below_one(number: Formula) -> Formula:
    return Binary(BinaryOperator.LT, number, Constant(1.0, ValueType.FLOAT64))


GREATEST = below_one(Over(Aggregate.GREATEST, 5, D, TRUE))
MEAN = below_one(Over(Aggregate.MEAN, 5, D, P))


@pytest.mark.parametrize(('formula', 'old', 'new', 'said'), some([
    (WITHIN, 'INT64_C(5), in->p', 'INT64_C(6), in->p', 'verdict of R-0'),
    (WITHIN, 's->counter_1 = -1;', 's->counter_1 = 0;', 'reset: counter_1'),
    (WITHIN, 'tick, &next);', 'tick + 1, &next);', 'verdict of R-0'),
    (WITHIN, '  return next;', '  return FM_NEVER;', 'next tick'),
    (WITHIN, '  return next;', '  return next - 1;', 'next tick'),
    (WITHIN, '&next);', '&next) | fm_once_within_at(&s->counter_1, INT64_C(5), in->p, tick, '
     '&next);', 'defined'),
    (WITHIN, 'NULL, random_group_0_step_at', 'random_group_0_step_at, NULL', 'description'),
    (Yesterday(P), 'unsettled |= s->flag_1 != in->p;', '', 'next tick'),
    (Yesterday(P), '!= in->p;\n  s->flag_1 = in->p;',
     '= in->p;\n  unsettled |= s->flag_1 != in->p;', 'next tick'),
    (Yesterday(P), '  fm_lower(&next, unsettled, tick + 1);\n', '', 'next tick'),
    (Yesterday(P), 'unsettled, tick + 1', 'true, tick + 1', 'next tick'),
    (Yesterday(P), 'unsettled, tick + 1', 'unsettled, tick + 2', 'next tick'),
    (Yesterday(P), 'bool unsettled = false', 'bool unsettled = true', 'next tick'),
    (Yesterday(P), 'unsettled |= ', 'unsettled &= ', 'next tick'),
    (BETWEEN, 'INT64_C(2), INT64_C(2)', 'INT64_C(2), INT64_C(3)', 'verdict'),
    (BETWEEN, 'INT64_C(2), INT64_C(2)', 'INT64_C(3), INT64_C(2)', 'defined'),
    (GREATEST, 'INT64_C(5)', 'INT64_C(6)', 'verdict of R-0'),
    (GREATEST, 'INT64_C(8)', 'INT64_C(9)', 'defined'),
    (GREATEST, 'in->d, false', 'in->d, true', 'verdict of R-0'),
    (GREATEST, 'tick, &next), false)', 'tick, &next), true)', 'verdict of R-0'),
    (MEAN, 'in->p, fm_word', 'true, fm_word', 'verdict of R-0'),
    (MEAN, 'fm_exact_mean(s->sum_2)', 'fm_exact_quotient(s->sum_2, 1u)', 'verdict of R-0'),
    (below_one(Ago(5, D)), 'tick, &next)', 'tick - 1, &next)', 'verdict of R-0'),
    (below_one(Slope(D, P, 1)), 'in->p, tick', 'true, tick', 'verdict of R-0'),
    (TimeOver(5, 2, P), 'INT64_C(2)', 'INT64_C(3)', 'verdict of R-0'),
    (TimeOver(5, 2, P), '  return next;', '  return FM_NEVER;', 'next tick'),
], 2))
def test_wrong_c_is_not_proved(formula: Formula, old: str, new: str, said: str) -> None:
    monitor = generated([formula])
    assert failures(proofs(monitor)) == []
    assert any(said in text for text in failures(proofs(monitor, old, new)))


@pytest.mark.parametrize(('bits', 'kind'), [(32, ctypes.c_float), (64, ctypes.c_double)])
def test_numbers_are_the_same_if_their_bits_are(bits: int, kind: Any, tmp_path: Path) -> None:
    compiler = gcc()
    if compiler is None:
        pytest.skip('needs gcc')
    c_name = {32: 'float', 64: 'double'}[bits]
    (tmp_path / 'same.c').write_text(
        f'#include "fret_cells.h"\nbool same({c_name} a, {c_name} b) '
        f'{{return fm_same_f{bits}(a, b);}}\n', encoding='utf-8')
    compile_c([*compiler, '-std=c99', '-O2', '-fPIC', '-shared', f'-I{CSRC}', tmp_path / 'same.c',
               '-lm', '-o', tmp_path / f'same_{bits}.so'])
    same = ctypes.CDLL(str(tmp_path / f'same_{bits}.so')).same
    same.argtypes, same.restype = [kind, kind], ctypes.c_bool
    least = {32: 2.0 ** -149, 64: 2.0 ** -1074}[bits]
    numbers = [0.0, -0.0, 1.0, 1.0 + {32: 2.0 ** -23, 64: 2.0 ** -52}[bits], least, -least,
               math.inf, -math.inf, math.nan]
    for one, other in product(enumerate(numbers), repeat=2):
        assert same(one[1], other[1]) is (one[0] == other[0])


def test_a_step_of_all_groups_that_leaves_one_out_is_not_proved() -> None:
    monitor = generated([WITHIN, Yesterday(Q)])
    step = '  fm_lower(&next, true, random_group_1_step_at(state, inputs, verdicts, tick));\n'
    found = failures(proofs(monitor, step, ''))
    assert any('random_step_at: all groups: the same values' in text for text in found)
    kept = '  (void)random_group_1_step_at(state, inputs, verdicts, tick);\n'
    assert any('random_step_at: next tick' in text
               for text in failures(proofs(monitor, step, kept)))


@thorough
def test_every_mutant_of_a_timed_monitor_is_killed() -> None:
    monitor = generated([Yesterday(P), WITHIN, Historically(EVER, P), Yesterday(Q)])
    subject = read_subject(monitor)
    functions = generated_functions(subject.code, subject.prefix)
    alive, count = [], 0
    for mutant in mutants(subject.code, functions):
        changed = replace(subject, code=mutant.code)
        groups = range(len(subject.layouts))
        found = [*(prove_group(changed, group, 5.0) for group in groups),
                 prove_whole(changed, 5.0)]
        alive += [mutant.what] * all(item.is_proved for item in found)
        count += 1
    assert count > 40
    # `true` is 1, and so is 2 as a truth value.
    assert [what for what in alive if not what.endswith(': 1, 1 to 2')] == []


def test_a_queue_that_is_too_short_is_not_proved(monkeypatch: pytest.MonkeyPatch) -> None:
    monitor = generated([Once(Window(4, 6), P)])
    [layout] = monitor.layouts
    equations = [replace(item, operation=replace(item.operation, room=replace(
                     item.operation.room, capacity=1)))
                 if isinstance(item.operation, SinceBetween) else item
                 for item in layout.group.equations]
    group = replace(layout.group, equations=tuple(equations))
    short = replace(monitor, layouts=(replace(layout, group=group),))
    assert any('wide enough' in text for text in failures(proofs(short)))
