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

"""The bytes of code and data in compiled C, read from the sections of object files."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, partial
from pathlib import Path
import shutil
import struct
import subprocess
import tempfile

from fret_monitor.export.content import ExportPart
from fret_monitor.native.compiler import find_compiler, TIMEOUT
from fret_monitor.native.errors import CompilerError

ARM = 'arm-none-eabi-gcc'
_FLAGS = ('-std=c99', '-Os', '-fno-pie', '-ffp-contract=off', '-fvisibility=hidden')
_CORTEX_M4 = ('-mcpu=cortex-m4', '-mthumb', '-mfloat-abi=soft')

_PROBE = 'fret_monitor_probe_'

_WRITABLE, _ALLOCATED = 1, 2  # SHF_WRITE, SHF_ALLOC
# Offsets in the header of a file: where its sections begin, then their size and number.
_HEADERS = {1: ('I', 32, 46), 2: ('Q', 40, 58)}
# A section: flags and size as a word of the machine, and their offsets.
_SECTIONS = {1: ('I', 8, 20), 2: ('Q', 8, 32)}


@dataclass(frozen=True)
class PartSizes:
    """
    The bytes that a part of an export takes in memory.

    `code` counts instructions and constants, `data` counts variables, and `held` is the memory
    that the program provides, as in `ExportPart`. `problem` is why they are not known, '' if they
    are.
    """

    compiler: str
    part: str = ''
    code: int = 0
    data: int = 0
    held: Mapping[str, int] = field(default_factory=dict)
    problem: str = ''


def measured_sizes(files: Mapping[str, str], parts: Sequence[ExportPart]) -> Iterator[PartSizes]:
    """
    Yield the sizes of parts for the compiler of this machine, and for a Cortex-M4 if there is one.

    `files` are texts by relative path. If a compiler fails, the reason is all that it yields.
    """
    try:
        command = find_compiler().command
    except CompilerError as error:
        yield PartSizes('this machine', problem=str(error))
    else:
        yield from _sizes(' '.join((Path(command[0]).name, *command[1:], '-Os')), command, files,
                          parts)
    arm = shutil.which(ARM)
    if arm is not None:
        yield from _sizes(f'{ARM} {_CORTEX_M4[0]} -Os', (arm, *_CORTEX_M4), files, parts)


def _sizes(name: str, command: Sequence[str], files: Mapping[str, str],
           parts: Sequence[ExportPart]) -> list[PartSizes]:
    with tempfile.TemporaryDirectory(prefix='fret_monitor-') as folder:
        for file, text in files.items():
            path = Path(folder, file)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding='utf-8')
        compiled = cache(partial(_compiled, tuple(command), Path(folder)))
        try:
            return [_size(name, part, compiled, Path(folder, f'{_PROBE}{number}'))
                    for number, part in enumerate(parts)]
        except CompilerError as error:
            return [PartSizes(name, problem=str(error))]


def _size(name: str, part: ExportPart, compiled: Callable[[str, str], tuple[int, int]],
          probe: Path) -> PartSizes:
    pairs = [compiled(source, part.include) for source in part.sources]
    held: dict[str, int] = {}
    for what, size in part.held.items():
        # A variable of that many bytes, so that the compiler need not be that of this machine.
        source = probe.with_name(f'{probe.name}_{len(held)}.c')
        source.write_text(f'#include "{part.header}"\nchar held[{size}] = {{0}};\n',
                          encoding='utf-8')
        held[what] = compiled(source.name, part.include)[1]
    return PartSizes(name, part.name, sum(code for code, _ in pairs),
                     sum(data for _, data in pairs), held)


def _compiled(command: tuple[str, ...], folder: Path, source: str,
              include: str) -> tuple[int, int]:
    """Return the bytes of code and of variables in the object of a C file."""
    made = (folder / source).with_suffix('.o')
    try:
        done = subprocess.run(
            [*command, *_FLAGS, f'-I{include}', '-c', source, '-o', made], cwd=folder,
            capture_output=True, stdin=subprocess.DEVNULL, timeout=TIMEOUT, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise CompilerError(str(error)) from error
    if done.returncode:
        lines = done.stderr.decode(errors='replace').splitlines()
        raise CompilerError(next((line for line in lines if 'error' in line),
                                 f'exit status {done.returncode}'))
    found = section_bytes(made.read_bytes())
    if found is None:
        raise CompilerError('its objects are not ELF files')
    return found


def section_bytes(content: bytes) -> tuple[int, int] | None:
    """Return the bytes of code with constants, and of variables, in an ELF file; else None."""
    if content[:4] != b'\x7fELF' or content[4] not in _HEADERS:
        return None
    order = '<' if content[5] == 1 else '>'
    word, start_at, count_at = _HEADERS[content[4]]
    start, = struct.unpack_from(order + word, content, start_at)
    width, count = struct.unpack_from(f'{order}HH', content, count_at)
    word, flags_at, size_at = _SECTIONS[content[4]]
    code = data = 0
    for section in range(start, start + width * count, width):
        flags, = struct.unpack_from(order + word, content, section + flags_at)
        size, = struct.unpack_from(order + word, content, section + size_at)
        if flags & _ALLOCATED and flags & _WRITABLE:
            data += size
        elif flags & _ALLOCATED:
            code += size
    return code, data
