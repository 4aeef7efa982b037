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

"""cffi's declarations agree with the C compiler, and `binding.py` is up to date."""

from collections.abc import Iterator
from pathlib import Path
import re
import subprocess

from fret_monitor.native import csrc_file, csrc_includes, declarations
from fret_monitor.native.binding import ffi
from fret_monitor.native.compiler import find_compiler
import pytest


def expressions() -> Iterator[tuple[str, int]]:
    """Yield C expressions, each with the value that cffi gives it."""
    text = declarations.declarations()
    for struct in re.findall(r'^(struct \w+)\n\{', text, re.MULTILINE):
        yield f'sizeof({struct})', ffi.sizeof(struct)
        for field, described in ffi.typeof(struct).fields:
            place = f'(({struct} *)0)->{field}'
            yield f'offsetof({struct}, {field})', described.offset
            yield f'sizeof({place})', ffi.sizeof(described.type)
    for name in re.findall(r'#define (FM_\w+)|(FM_\w+) =', text):
        yield ''.join(name), ffi.integer_const(''.join(name))


def test_sizes_offsets_and_values_are_those_of_the_headers(tmp_path: Path) -> None:
    pairs = list(expressions())
    checks = '\n'.join(
        f'  if ((long long)({text}) != {value}) {{puts("{text}"); wrong = 1;}}'
        for text, value in pairs)
    includes = ''.join(f'#include "{name}"\n' for name in declarations.HEADERS)
    program = tmp_path / 'check.c'
    program.write_text(
        f'{includes}#include <stdio.h>\n'
        f'int main(void)\n{{\n  int wrong = 0;\n{checks}\n  return wrong;\n}}\n',
        encoding='utf-8')
    subprocess.run(
        [*find_compiler().command, '-std=c99', *csrc_includes(), str(program), '-o',
         str(tmp_path / 'check')], check=True)
    done = subprocess.run([tmp_path / 'check'], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, '')
    assert len(pairs) > 150


def test_every_exported_function_is_declared() -> None:
    text = ''.join(csrc_file(name).read_text(encoding='utf-8')
                   for name in declarations.HEADERS)
    exported = re.findall(r'^FM_EXPORT .*?(fm_\w+)\(', text, re.MULTILINE | re.DOTALL)
    assert len(exported) > 50
    declared = declarations.declarations()
    for name in exported:
        assert re.search(rf'[ *]{name}\(', declared), name


def test_the_words_are_those_of_the_header_and_both_nodes_use_each() -> None:
    kept = Path(declarations.__file__).with_name('words.py').read_text(encoding='utf-8')
    assert kept.endswith(declarations.words_text()), declarations.__doc__
    root = Path(declarations.__file__).parents[2]
    of_c, of_python, of_both = (
        ''.join(path.read_text(encoding='utf-8') for pattern in patterns
                for path in root.glob(pattern))
        for patterns in (('csrc/node/*.c', 'csrc/reporting/*.c'),
                         ('fret_monitor/ros/**/*.py', 'fret_monitor/bag/*.py',
                          'fret_monitor/runtime/*.py'),
                         ('csrc/ros/*.c', 'csrc/reporting/parameter_table.h')))
    names = re.findall(r'FM_WORDS_\w+', csrc_file('words.h').read_text(encoding='utf-8'))
    names = [name for name in names if name not in of_both]
    assert len(names) > 20
    assert [name for name in names if name not in of_c] == []
    assert [name for name in names
            if f'words.{name.removeprefix("FM_WORDS_")}' not in of_python] == []


def test_the_binding_is_what_cffi_generates_from_the_declarations() -> None:
    pytest.importorskip('cffi')
    kept = Path(declarations.__file__).with_name('binding.py').read_text(encoding='utf-8')
    assert kept.endswith(declarations.binding_text()), declarations.__doc__
