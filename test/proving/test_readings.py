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

"""C that a compiler could see otherwise than the proof does is not read, and no type is taken."""

from pathlib import Path

from fret_monitor.build import generate_monitor, GeneratedMonitor, read
from fret_monitor.cli.main import main
from fret_monitor.native.cache import runtime_headers
from fret_monitor.proving.c_source import read_program, Unreadable
from fret_monitor.proving.verification import read_subject, verify
from fret_monitor.smt.solver import Answer
import pytest

BUNDLE = """
format: 1
inputs: {n: {type: int64}, d: {type: float32}, p: {type: bool}}
requirements:
  - {id: R1, ptltl: "preInt(3, n) < n"}
  - {id: R2, ptltl: "Y p | preReal(0.5, d) < d | O[0,5] p | O[70,70] p"}
"""
CODE, HEADER, CELLS, RUNTIME = 'ints_monitor.c', 'ints_monitor.h', 'fret_cells.h', 'fret_monitor.h'
VERDICT = '  verdicts[ints_req_R1] = '
TRUE = '  verdicts[ints_req_R1] = true;\n'
BODY = 'FM_INLINE void ints_group_0_body('
POSITION = '  return position + 1u == length'


def monitor(folder: Path) -> GeneratedMonitor:
    path = folder / 'ints.yaml'
    path.write_text(BUNDLE, encoding='utf-8')
    return generate_monitor(read(path))


def files(generated: GeneratedMonitor) -> dict[str, str]:
    """Return what `prove --sources` reads."""
    return {**{name: text for name, text in runtime_headers().items()
               if name in (CELLS, RUNTIME)},
            **dict([generated.module.header, *generated.module.sources])}


def exchanged(found: dict[str, str], file: str, old: str, new: str) -> dict[str, str]:
    assert old in found[file]
    return {**found, file: found[file].replace(old, new, 1)}


def parted(found: dict[str, str]) -> tuple[dict[str, str], dict[str, str]]:
    """Return C files and headers."""
    return ({name: text for name, text in found.items() if name.endswith('.c')},
            {name: text for name, text in found.items() if name.endswith('.h')})


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
    # Lines for the preprocessor.
    (CODE, BODY, '#ifdef __GNUC__\n#define true false\n#endif\n' + BODY, 'ints_monitor.c:'),
    (CODE, VERDICT, f'#ifdef __GNUC__\n{TRUE}#endif\n{VERDICT}', '#ifdef __GNUC__'),
    (CODE, VERDICT, f'#ifdef __OPTIMIZE__\n{TRUE}#endif\n{VERDICT}', '#ifdef __OPTIMIZE__'),
    (CODE, VERDICT, f'%:ifdef __GNUC__\n{TRUE}%:endif\n{VERDICT}', 'not written as'),
    (CODE, VERDICT, f'#pragma GCC optimize("fast-math")\n{VERDICT}', '#pragma'),
    (CODE, '#include <string.h>\n', '#include <strings.h>\n', '#include <strings.h>'),
    (CODE, '#include <string.h>\n', '', 'ints_monitor.c:'),
    (CODE, '#error', TRUE + '#error', 'under a condition'),
    (CODE, '#include <string.h>\n', 'int x(void);\n#include <string.h>\n', 'int x(void);'),
    (HEADER, 'extern "C" {\n', 'extern "C" {\nint x(void);\n', 'int x(void);'),
    (CELLS, POSITION, '#ifdef __OPTIMIZE__\n  return 0u;\n#endif\n' + POSITION, '__OPTIMIZE__'),
    (CELLS, '#pragma STDC FP_CONTRACT OFF', '#pragma STDC FP_CONTRACT ON', 'FP_CONTRACT ON'),
    (CELLS, '#if defined(__FAST_MATH__)', '#if defined(__FAST_MATHS__)', '__FAST_MATHS__'),
    (RUNTIME, '#define FM_ABI 1u', '#define FM_ABI 01u', '#define FM_ABI 01u'),
    (RUNTIME, '__attribute__((always_inline))', '__attribute__((always_inline, weak))', 'weak'),
    # Words of a compiler, and text that compilers read in more than one way.
    (CODE, VERDICT, '  verdicts[ints_req_R1] = __STDC_VERSION__ < 201112L &&', '__STDC_VERSION__'),
    (CODE, BODY, '__attribute__((weak)) ' + BODY, '__attribute__'),
    (CODE, VERDICT, '  _Pragma("GCC ivdep")\n' + VERDICT, '_Pragma'),
    (CODE, VERDICT, '  asm("nop");\n' + VERDICT, '`asm`'),
    (CELLS, '    const type before = *counter;', '    const type before = __COUNTER__;',
     '__COUNTER__'),
    (CODE, VERDICT, '  // why ??/\n' + VERDICT, 'a trigraph'),
    (CODE, VERDICT, '  // why \\\n' + VERDICT, 'a backslash continues'),
    (CODE, VERDICT, '  // why \\ \n' + VERDICT, 'a backslash continues'),
    (CELLS, '    const type before = *counter; \\', '    const type before = *counter;\\',
     'a backslash continues'),
    (CODE, VERDICT, '  // why\r' + VERDICT, 'a control character'),
    (CODE, VERDICT, '  /* why */\n' + VERDICT, 'comments'),
    (CODE, VERDICT, '  u"";\n' + VERDICT, 'not written as'),
])
def test_c_that_a_compiler_could_see_otherwise_is_not_read(
    file: str, old: str, new: str, said: str, tmp_path: Path,
) -> None:
    generated = monitor(tmp_path)
    found = exchanged(files(generated), file, old, new)
    with pytest.raises(Unreadable) as caught:
        read_subject(generated, *parted(found))
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
def test_a_field_of_another_kind_is_told(old: str, new: str, said: str, tmp_path: Path) -> None:
    generated = monitor(tmp_path)
    found = verify(generated, *parted(exchanged(files(generated), HEADER, old, new)))
    names = [proof.name for proof in found.proofs if proof.answer is not Answer.PROVED]
    assert any(name.startswith(said) for name in names), names


def test_a_macro_of_several_lines_may_be_other_code_and_is_proved_with_it(tmp_path: Path) -> None:
    generated = monitor(tmp_path)
    other = exchanged(files(generated), CELLS, 'return age <= bound', 'return age < bound')
    found = verify(generated, *parted(other))
    assert not found.unreadable
    assert [proof.name for proof in found.cells if proof.answer is Answer.REFUTED]


def test_a_function_of_two_files_is_the_same_in_both(tmp_path: Path) -> None:
    generated = monitor(tmp_path)
    found = files(generated)
    found[CODE] += 'static bool one(void) {return true;}\n'
    sources, headers = parted(found)
    sources['more.c'] = 'static _Bool one(void) {return 0;}\n'
    with pytest.raises(Unreadable, match='one is defined twice'):
        read_subject(generated, sources, headers)


@pytest.mark.parametrize(('old', 'new', 'said'), [
    ('  static const struct fm_group', '  const struct fm_group', 'description'),
    ('  const int64_t n = ', '  static const int64_t n = ', 'not modelled'),
])
def test_a_variable_is_static_in_the_description_alone(
    old: str, new: str, said: str, tmp_path: Path,
) -> None:
    generated = monitor(tmp_path)
    found = verify(generated, *parted(exchanged(files(generated), CODE, old, new)))
    failed = [proof.detail for proof in found.proofs if proof.answer is not Answer.PROVED]
    assert any(said in text for text in failed)


def test_what_the_preprocessor_refuses_is_not_read() -> None:
    with pytest.raises(Unreadable, match='the preprocessor refuses it'):
        read_program({'f.c': '#error "no"\n'}, {})


def test_lines_may_end_as_on_windows_but_not_in_a_carriage_return_alone(
    tmp_path: Path, capsys: pytest.CaptureFixture[str],
) -> None:
    for name, text in files(monitor(tmp_path)).items():
        (tmp_path / name).write_bytes(text.replace('\n', '\r\n').encode())
    command = ['prove', str(tmp_path / 'ints.yaml'), '--sources', str(tmp_path)]
    assert main(command) == 0
    code = tmp_path / CODE
    code.write_bytes(code.read_bytes().replace(VERDICT.encode(), b'  // why\r' + VERDICT.encode()))
    assert main(command) == 1
    assert 'a control character' in capsys.readouterr().out
