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

"""C that the proof does not model is not read, and fields of wrong types are reported."""

from pathlib import Path

from fret_monitor.build import generate_monitor, GeneratedMonitor, read
from fret_monitor.proving import verification
from fret_monitor.proving.c_source import read_program, Unreadable
from fret_monitor.proving.verification import read_subject, verify
from fret_monitor.smt.solver import ProofAnswer
from proving.workbench import exchanged
import pytest
from strategies import thorough

BUNDLE = """
format: 1
inputs: {n: {type: int64}, d: {type: float32}, p: {type: bool}}
requirements:
  - {id: R1, ptltl: "preInt(3, n) < n"}
  - {id: R2, ptltl: "Y p | preReal(0.5, d) < d | O[0,5] p | O[70,70] p"}
"""
CODE, HEADER = 'ints_monitor.c', 'ints_monitor.h'
VERDICT = '  verdicts[ints_req_R1] = '
BODY = 'FM_INLINE void ints_group_0_body('


def monitor(folder: Path) -> GeneratedMonitor:
    path = folder / 'ints.yaml'
    path.write_text(BUNDLE, encoding='utf-8')
    return generate_monitor(read(path))


@pytest.mark.parametrize(('file', 'old', 'new', 'said'), [
    # Fields and variables that are not what their type says.
    (HEADER, 'int64_t number_1;', 'int64_t number_1 : 7;', 'number_1 : 7'),
    (HEADER, 'int64_t number_1;', 'volatile int64_t number_1;', 'volatile'),
    (HEADER, 'int64_t number_1;', '_Atomic int64_t number_1;', '_Atomic'),
    (HEADER, 'int64_t number_1;', '_Alignas(16) int64_t number_1;', '_Alignas'),
    (HEADER, 'int64_t number_1;', 'long double number_1;', 'long double'),
    (CODE, '  const int64_t previous_1', '  register const int64_t previous_1', 'register'),
    (CODE, VERDICT, '  char c = 200;\n' + VERDICT, 'not modelled: char c'),
    (CODE, BODY, 'inline bool other(void) {return true;}\n' + BODY, 'not modelled: inline'),
    (CODE, BODY, 'typedef uint8_t int64_t;\n' + BODY, 'int64_t is declared twice'),
])
def test_types_and_functions_that_the_proof_does_not_model_are_not_read(
    file: str, old: str, new: str, said: str, tmp_path: Path,
) -> None:
    with pytest.raises(Unreadable) as caught:
        read_subject(exchanged(monitor(tmp_path), file, old, new))
    assert said in str(caught.value)


@pytest.mark.parametrize(('old', 'new', 'said'), [
    ('float number_3;', 'int32_t number_3;', 'group 1: type of number_3: int32_t'),
    ('float number_3;', 'double number_3;', 'group 1: type of number_3: double'),
    ('int64_t number_1;', 'float number_1;', 'group 0: type of number_1: float'),
    ('int64_t number_1;', 'uint64_t number_1;', 'group 0: type of number_1: uint64_t'),
    ('bool flag_1;', 'signed char flag_1;', 'group 1: type of flag_1: int8_t'),
    ('bool flag_1;', 'struct ints_inputs flag_1;', 'group 1: type of flag_1: struct'),
    ('uint8_t counter_', 'float counter_', 'group 1: type of counter_'),
    ('uint8_t counter_', 'bool counter_', 'group 1: type of counter_'),
    ('uint8_t position_', 'float position_', 'group 1: type of position_'),
    ('[9];', '[9][2];', 'group 1: type of ring_'),
    ('  float d;', '  int32_t d;', 'group 1: type of inputs.d'),
])
def test_fields_of_other_kinds_are_reported(old: str, new: str, said: str, tmp_path: Path) -> None:
    found = verify(exchanged(monitor(tmp_path), HEADER, old, new))
    names = [proof.name for proof in found.proofs if proof.answer is not ProofAnswer.PROVED]
    assert any(name.startswith(said) for name in names), names


def test_a_static_function_of_two_files_is_the_same_in_both() -> None:
    one, other = (f'static _Bool one(void) {{return {value};}}\n' for value in (1, 0))
    assert read_program({'a.c': one, 'b.c': one}, {}).functions.keys() == {'one'}
    with pytest.raises(Unreadable, match='one is defined twice'):
        read_program({'a.c': one, 'b.c': other}, {})


@pytest.mark.parametrize(('old', 'new', 'said'), [
    ('  static const struct fm_group', '  const struct fm_group', 'description'),
    pytest.param('  const int64_t n = ', '  static const int64_t n = ', 'not modelled',
                 marks=thorough),
])
def test_a_variable_is_static_in_the_description_alone(
    old: str, new: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(verification, '_SEARCH_S', 0.5)  # no trace shows it
    found = verify(exchanged(monitor(tmp_path), CODE, old, new))
    failed = [proof.detail for proof in found.proofs if proof.answer is not ProofAnswer.PROVED]
    assert any(said in text for text in failed)


def test_what_the_preprocessor_refuses_is_not_read() -> None:
    with pytest.raises(Unreadable, match='the preprocessor failed'):
        read_program({'f.c': '#error "no"\n'}, {})
