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

"""Sizes of objects: sections of ELF files of any machine, compilers that are missing or fail."""

from pathlib import Path
import struct

from fret_monitor.export.content import ExportPart
from fret_monitor.export.sizes import ARM, measured_sizes, section_bytes
import pytest

CODE, WRITABLE, NOTES = 2 | 4, 2 | 1, 0  # flags of sections
SECTIONS = ((CODE, 100), (2, 20), (WRITABLE, 8), (WRITABLE, 1), (NOTES, 5000))


def elf32(order: str) -> bytes:
    """Return the header and the sections of an object for a machine of 32 bits."""
    start = 52
    header = b'\x7fELF' + bytes([1, 1 if order == '<' else 2]) + bytes(10) + struct.pack(
        f'{order}HHIIIIIHHHHHH', 1, 40, 1, 0, 0, start, 0, 52, 0, 0, 40, len(SECTIONS), 0)
    return header + b''.join(
        struct.pack(f'{order}10I', 0, 1, flags, 0, 0, size, 0, 0, 1, 0)
        for flags, size in SECTIONS)


@pytest.mark.parametrize('order', '<>')
def test_code_counts_constants_and_variables_what_is_writable(order: str) -> None:
    assert section_bytes(elf32(order)) == (120, 9)


def test_another_format_has_no_known_size() -> None:
    assert section_bytes(b'\xcf\xfa\xed\xfe' + bytes(200)) is None
    assert section_bytes(b'') is None


def test_a_compiler_that_fails_and_one_that_is_missing_are_reported(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
) -> None:
    arm = tmp_path / ARM
    arm.write_text('#!/bin/sh\necho "a.c:1:1: fatal error: math.h: none" >&2\nexit 1\n')
    arm.chmod(0o755)
    monkeypatch.setenv('PATH', f'{tmp_path}:/bin')
    monkeypatch.setenv('CC', 'no-such-compiler')
    host, cross = measured_sizes({'src/a.c': 'int a;\n'}, [ExportPart('all', ('src/a.c',), 'src')])
    assert 'no-such-compiler' in host.problem
    assert (cross.compiler, cross.problem) == (
        'arm-none-eabi-gcc -mcpu=cortex-m4 -Os', 'a.c:1:1: fatal error: math.h: none')


def test_a_part_has_its_own_sizes_and_those_of_the_memory_that_a_program_provides() -> None:
    files = {'src/a.h': 'struct a {int first[10];};\nenum {N = 7};\n',
             'src/a.c': 'int a[3] = {1};\n', 'src/b.c': '#include "a.h"\nstruct a b;\n'}
    parts = [ExportPart('a alone', ('src/a.c',), 'src', 'a.h', {'3': '3'}),
             ExportPart('a with b', ('src/a.c', 'src/b.c'), 'src', 'a.h',
                        {'struct a': 'sizeof(struct a)', 'N': 'N'})]
    first, second, *_ = measured_sizes(files, parts)
    assert (first.part, first.data, first.held) == ('a alone', 12, {'3': 3})
    assert (second.part, second.data, second.held) == ('a with b', 52, {'struct a': 40, 'N': 7})
