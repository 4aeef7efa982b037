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

"""What cffi is told agrees with the headers, and `binding.py` with what cffi is told."""

from collections.abc import Iterator
from pathlib import Path
import re
import subprocess

from fret_monitor.native import csrc_directory, declarations
from fret_monitor.native.binding import ffi
from fret_monitor.native.compiler import find_compiler
import pytest

# What Python does not call takes a union by value, which cffi cannot pass.
NOT_DECLARED = {'fm_evaluator_store', 'fm_evaluator_initial'}
STRUCTS = [
    'struct fm_input', 'struct fm_group', 'struct fm_requirement', 'struct fm_monitor',
    'struct fm_field', 'struct fm_reader', 'struct fm_readers',
    'struct fm_topic', 'struct fm_evaluator_options', 'struct fm_violation',
    'struct fm_requirement_counts', 'struct fm_input_counts', 'struct fm_topic_counts',
    'struct fm_engine_options', 'struct fm_origin', 'struct fm_detail', 'struct fm_type_callbacks',
    'struct fm_type_support', 'struct fm_in_place_type', 'struct fm_in_place',
    'struct fm_middleware',
]


def headers() -> str:
    names = ('fret_monitor.h', 'fret_fields.h', 'evaluator.h', 'engine.h', 'hot_path.h')
    return ''.join((csrc_directory() / name).read_text(encoding='utf-8') for name in names)


def enumerators() -> list[str]:
    found = []
    for body in re.findall(r'enum \w+\s*\{(.*?)\}', headers(), re.DOTALL):
        found += re.findall(r'(FM_\w+) =', body)
    return ['FM_ABI', *found]


def signatures(text: str) -> dict[str, str]:
    """Return name to declaration of each function of the evaluator, blanks made one."""
    text = re.sub(r'//[^\n]*', '', text).replace('FM_EXPORT', '')
    names = r'fm_(?:evaluator|watch|source|announcer)_\w+'
    found = re.findall(rf'([\w ]+[ *]+({names})\([^)]*\);)', text)
    return {name: ' '.join(declaration.split()) for declaration, name in found}


def expressions() -> Iterator[tuple[str, int]]:
    """Yield an expression in C and what cffi takes it for."""
    for struct in STRUCTS:
        yield f'sizeof({struct})', ffi.sizeof(struct)
        for field, described in ffi.typeof(struct).fields:
            place = f'(({struct} *)0)->{field}'
            yield f'offsetof({struct}, {field})', described.offset
            yield f'sizeof({place})', ffi.sizeof(described.type)
    for name in enumerators():
        yield name, ffi.integer_const(name)


def test_sizes_offsets_and_values_are_those_of_the_headers(tmp_path: Path) -> None:
    pairs = list(expressions())
    checks = '\n'.join(
        f'  if ((long long)({text}) != {value}) {{puts("{text}"); wrong = 1;}}'
        for text, value in pairs)
    program = tmp_path / 'check.c'
    program.write_text(
        '#include "hot_path.h"\n#include <stdio.h>\n'
        f'int main(void)\n{{\n  int wrong = 0;\n{checks}\n  return wrong;\n}}\n',
        encoding='utf-8')
    subprocess.run(
        [*find_compiler().command, '-std=c99', f'-I{csrc_directory()}', str(program),
         '-o', str(tmp_path / 'check')], check=True)
    done = subprocess.run([tmp_path / 'check'], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, '')
    assert len(pairs) > 70


def test_functions_are_declared_as_in_the_header() -> None:
    expected = {name: text for name, text in signatures(headers()).items()
                if name not in NOT_DECLARED}
    assert signatures(declarations.DECLARATIONS) == expected
    assert len(expected) > 15


def test_every_struct_of_the_declarations_is_compared() -> None:
    declared = re.findall(r'^(struct \w+)\n\{', declarations.DECLARATIONS, re.MULTILINE)
    assert sorted(declared) == sorted(STRUCTS)


def test_the_binding_is_what_cffi_makes_of_the_declarations() -> None:
    pytest.importorskip('cffi')
    kept = Path(declarations.__file__).with_name('binding.py').read_text(encoding='utf-8')
    assert kept.endswith(declarations.binding_text()), declarations.__doc__
