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

"""Generated C, read back and proved to compute its program; and C that is not proved."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

from bench.equivalence import verify_edited
from codegen.workbench import specify
import facts
from fret_monitor.build import generate_monitor, GeneratedMonitor, read_one_instance, Reading
from fret_monitor.bundle.bundle import Language
from fret_monitor.elaboration.languages import read_formula
from fret_monitor.logic.formula import Formula, Variable
from fret_monitor.model.diagnostics import Source, Text
from fret_monitor.model.values import ValueType
from fret_monitor.program import layout
from fret_monitor.proving.monitor import ALL, ProofSubject
from fret_monitor.proving.verification import GroupResult, read_subject, verify_group
from fret_monitor.smt.solver import ProofAnswer
from proving.workbench import exchanged
import pytest
from stages import elaborate, scope_of
from strategies import EXAMPLES, FormulaMaker, INPUTS, some

ROOT = Path(__file__).resolve().parent.parent.parent
BUNDLES = [*sorted((ROOT / 'config').glob('*.yaml')),
           ROOT / 'test' / 'golden' / 'c' / 'cells.yaml']


def generated(formulas: list[Formula]) -> GeneratedMonitor:
    """Return the C of some formulas."""
    return generate_monitor(Reading(specify(formulas), (), '', ()))


def settled(
    monitor: GeneratedMonitor, old: str = '', new: str = '', seconds: float = 10.0,
    verify: Callable[[ProofSubject, int, float], GroupResult] = verify_group,
) -> list[GroupResult]:
    """Prove a monitor, with a part of its C exchanged; the cells are proved elsewhere."""
    if old:
        monitor = exchanged(monitor, monitor.module.sources[0][0], old, new)
    subject = read_subject(monitor)
    return [verify(subject, group, seconds) for group in [*range(len(subject.layouts)), ALL]]


def failures(found: list[GroupResult]) -> list[str]:
    return [f'{proof.name}: {proof.answer.value} {proof.detail}' for item in found
            for proof in item.proofs if proof.answer is not ProofAnswer.PROVED]


@pytest.mark.parametrize('path', BUNDLES, ids=lambda path: path.stem)
def test_the_bundles_of_this_repository_are_proved(path: Path) -> None:
    found = settled(generate_monitor(read_one_instance(path)))
    assert failures(found) == []


@pytest.mark.parametrize('seed', range(max(1, EXAMPLES // 16)))
def test_random_formulas_are_proved(seed: int) -> None:
    maker = FormulaMaker(Random(seed).randrange)
    monitor = generated([maker.formula(50) for _ in range(20)])
    assert failures(settled(monitor)) == []


def test_a_group_of_many_parts_is_proved() -> None:
    maker = FormulaMaker(Random(5).randrange, INPUTS[:3])
    monitor = generated([maker.formula(60) for _ in range(100)])
    assert max(len(item.parts) for item in monitor.layouts) > 2
    assert failures(settled(monitor)) == []


def test_every_formula_of_a_template_of_fret_is_proved() -> None:
    inputs = scope_of([Variable(name, ValueType.BOOL) for name in 'mcrs'])
    formulas = [_formula(item['ptltl'], inputs) for item in some(facts.templates())]
    assert failures(settled(generated(formulas))) == []


def _formula(text: str, inputs: Any) -> Formula:
    tree: Any = read_formula(Language.PTLTL, Text.whole(Source('<fret>', text)))
    return elaborate(tree, inputs)


def bundle(tmp_path: Path, *requirements: str) -> GeneratedMonitor:
    path = tmp_path / 'small.yaml'
    lines = ['format: 1', 'inputs: {p: {type: bool}, q: {type: bool}, x: {type: float32}}',
             'requirements:', *(f'  - {{id: R-{number}, ptltl: "{text}"}}'
                                for number, text in enumerate(requirements))]
    path.write_text('\n'.join(lines), encoding='utf-8')
    return generate_monitor(read_one_instance(path))


@pytest.mark.parametrize(('formula', 'old', 'new'), [
    ('O[0,5] p', '5u, in->p', '6u, in->p'),
    ('sin(x) < 0.5', '= sin(', '= cos('),
    ('H[0,5] p', 'fm_always_within_u8', 'fm_once_within_u8'),
    ('p S q', 'in->q | (in->p &', 'in->p | (in->q &'),
    ('Y p', 's->flag_1 = in->p', 's->flag_1 = !in->p'),
    ('x > 5.0', '> 5.0f', '>= 5.0f'),
    ('x > 5.0', '5.0f', '5.0000005f'),
    ('!(x > 5.0)', '!(in->x > 5.0f)', 'in->x <= 5.0f'),
    ('O[70,70] p', 's->position_70, 70u', 's->position_70, 69u'),
    ('Y Y Y Y Y Y Y Y Y Y p', '<< 3', '<< 2'),
    ('O[0,5] p', '= 6u;', '= 5u;'),
    ('O[0,5] p', 'verdicts[small_req_R_0]', 'verdicts[small_req_R_0 + 1]'),
])
def test_c_that_computes_something_else_is_refuted_by_a_trace(
    formula: str, old: str, new: str, tmp_path: Path,
) -> None:
    monitor = bundle(tmp_path, formula)
    found = settled(monitor, old, new)
    assert failures(found) != []
    examples = [item.counterexample for item in found if item.counterexample]
    assert examples
    assert examples[0].meant != examples[0].found or examples[0].undefined


@pytest.mark.parametrize(('formula', 'old', 'new'), [
    ('O[0,5] p', '= 6u;', '= 77u;'),  # above the bound, all ages are never
    ('p -> q', '(!in->p) | in->q', '!(in->p & (!in->q))'),
    ('O[0,5] p & x < 1.0', '  memset(s, 0, sizeof(*s));\n', ''),
])
def test_c_that_is_other_c_and_means_the_same_is_proved(
    formula: str, old: str, new: str, tmp_path: Path,
) -> None:
    found = settled(bundle(tmp_path, formula), old, new, verify=verify_edited)
    assert failures(found) == []


def test_a_counter_that_is_too_narrow_is_not_proved(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    holding = layout._holding
    monkeypatch.setattr(layout, '_holding', lambda largest: holding(largest // 2))
    found = settled(bundle(tmp_path, 'O[0,200] p'), seconds=2.0)
    assert any('wide enough' in text for text in failures(found))


@pytest.mark.parametrize(('old', 'new', 'said'), [
    ('{"p", ', '{"q", ', 'description: inputs'),
    ('offsetof(struct small_inputs, p)', 'offsetof(struct small_inputs, q)',
     'description: inputs'),
    ('FM_BOOL', 'FM_INT8', 'description: inputs'),
    ('"R-0"', '"R-1"', 'description: requirements'),
    ('small_group_0_reset, small', 'small_group_1_reset, small', 'description: groups'),
    ('small_step_any, NULL', 'small_group_0_step, NULL', 'description: monitor'),
])
def test_a_wrong_description_is_reported(old: str, new: str, said: str, tmp_path: Path) -> None:
    found = settled(bundle(tmp_path, 'O[0,5] p', 'q'), old, new)
    assert any(said in text for text in failures(found))


def test_a_step_of_all_that_leaves_a_group_out_is_refuted(tmp_path: Path) -> None:
    monitor = bundle(tmp_path, 'O[0,5] p', 'q')
    found = settled(monitor, '  small_group_1_body(&state->group_1, inputs, verdicts);\n', '')
    assert failures(found[:2]) == []
    assert found[2].counterexample is not None


def test_a_proof_that_fails_for_another_reason_is_no_proof(tmp_path: Path) -> None:
    monitor = bundle(tmp_path, 'O[0,5] p')
    found = settled(monitor, '  s->counter_1 = 6u;', '  while (1) {}\n  s->counter_1 = 6u;')
    assert not found[0].is_proved
    assert found[0].counterexample is None


def test_the_program_itself_is_not_trusted_to_be_what_c_was_made_of(tmp_path: Path) -> None:
    monitor = bundle(tmp_path, 'O[0,5] p')
    other: Any = bundle(tmp_path, 'O[0,4] p')
    mixed = replace(monitor, program=other.program, layouts=other.layouts)
    assert settled(mixed)[0].counterexample is not None
