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

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
import shutil
import struct
import subprocess
import tempfile

from fret_monitor.native.compiler import find_compiler, TIMEOUT
from fret_monitor.native.errors import CompilerError

ARM = 'arm-none-eabi-gcc'
_FLAGS = ('-std=c99', '-Os', '-fno-pie', '-ffp-contract=off', '-fvisibility=hidden')
_CORTEX_M4 = ('-mcpu=cortex-m4', '-mthumb', '-mfloat-abi=soft')

_WRITABLE, _ALLOCATED = 1, 2  # SHF_WRITE, SHF_ALLOC
# Offsets in the header of a file: where its sections begin, then their size and number.
_HEADERS = {1: ('I', 32, 46), 2: ('Q', 40, 58)}
# A section: flags and size as a word of the machine, and their offsets.
_SECTIONS = {1: ('I', 8, 20), 2: ('Q', 8, 32)}


@dataclass(frozen=True)
class Sizes:
    """
    The bytes that objects take in memory.

    `code` counts instructions and constants, `data` counts variables. `problem` is why they are
    not known, '' if they are.
    """

    compiler: str
    code: int = 0
    data: int = 0
    problem: str = ''


def measured_sizes(files: Mapping[str, str], sources: Sequence[str],
                   include: str) -> Iterator[Sizes]:
    """
    Yield sizes for the compiler of this machine, and for a Cortex-M4 if there is one for it.

    `files` are texts by relative path; each of `sources` is compiled alone.
    """
    try:
        command = find_compiler().command
    except CompilerError as error:
        yield Sizes('this machine', problem=str(error))
    else:
        yield _sizes(' '.join((Path(command[0]).name, *command[1:], '-Os')), command, files,
                     sources, include)
    arm = shutil.which(ARM)
    if arm is not None:
        yield _sizes(f'{ARM} {_CORTEX_M4[0]} -Os', (arm, *_CORTEX_M4), files, sources, include)


def _sizes(name: str, command: Sequence[str], files: Mapping[str, str], sources: Sequence[str],
           include: str) -> Sizes:
    with tempfile.TemporaryDirectory(prefix='fret_monitor-') as folder:
        for file, text in files.items():
            path = Path(folder, file)
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding='utf-8')
        made = []
        for number, source in enumerate(sources):
            made.append(Path(folder, f'{number}.o'))
            try:
                done = subprocess.run(
                    [*command, *_FLAGS, f'-I{include}', '-c', source, '-o', made[-1]], cwd=folder,
                    capture_output=True, stdin=subprocess.DEVNULL, timeout=TIMEOUT, check=False)
            except (OSError, subprocess.TimeoutExpired) as error:
                return Sizes(name, problem=str(error))
            if done.returncode:
                lines = done.stderr.decode(errors='replace').splitlines()
                return Sizes(name, problem=next((line for line in lines if 'error' in line),
                                                f'exit status {done.returncode}'))
        found = [section_bytes(path.read_bytes()) for path in made]
    known = [pair for pair in found if pair is not None]
    if len(known) < len(found):
        return Sizes(name, problem='its objects are not ELF files')
    return Sizes(name, sum(code for code, _ in known), sum(data for _, data in known))


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
