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

"""Numbers in the details and the log of the exported node, spelled as Python spells them."""

from pathlib import Path
import random
import struct
import subprocess
import unicodedata

from csrc.test_evaluator import gcc, run, SANITIZERS
from differential.compiled import WARNINGS
from fret_monitor.model.diagnostics import did_you_mean
from fret_monitor.model.floats import shortest_float32
from fret_monitor.model.names import fret_name
from fret_monitor.model.times import short_seconds
from fret_monitor.native import csrc_file, csrc_includes

HERE = Path(__file__).resolve().parent


def spelled(folder: Path, lines: list[str], program: str = 'node_text') -> list[str]:
    """Return what the C prints for these lines."""
    done = run(*gcc(), *csrc_includes(), *WARNINGS, '-std=c99', *SANITIZERS,
               HERE / f'{program}.c', csrc_file('text.c'), csrc_file('spelling.c'),
               '-o', folder / 'text', '-lm')
    assert done.returncode == 0, done.stdout
    printed = subprocess.run([folder / 'text'], input='\n'.join(lines), text=True,
                             capture_output=True, check=True)
    return printed.stdout.splitlines()


def test_floats_and_times_are_spelled_as_in_python(tmp_path: Path) -> None:
    chance = random.Random(5)
    doubles = [chance.getrandbits(64) for _ in range(2000)]
    doubles += [exponent << 52 for exponent in range(2048)]  # powers of two, 0 and infinity
    doubles += [struct.unpack('<Q', struct.pack('<d', value))[0] for value in (
        0.1, 1e16, 9999999999999998.0, 1e-4, 0.00012, 1e-5, 123456.789, -0.0, 1e22, 5e-324)]
    singles = [chance.getrandbits(32) for _ in range(2000)]
    singles += [exponent << 23 for exponent in range(256)]
    times = [0, 1, 10**9, 2_500_000_000, -1, -1_500_000_000, 2**62]
    printed = spelled(tmp_path, [*(f'd {bits}' for bits in doubles),
                                 *(f'f {bits}' for bits in singles),
                                 *(f't {time % 2**64}' for time in times)])
    wanted = [
        *(repr(struct.unpack('<d', struct.pack('<Q', bits))[0]) for bits in doubles),
        *(shortest_float32(struct.unpack('<f', struct.pack('<I', bits))[0]) for bits in singles),
        *map(short_seconds, times)]
    assert [pair for pair in zip(printed, wanted) if pair[0] != pair[1]] == []
    assert len(printed) == len(wanted)


def test_bytes_are_shown_as_characters_where_they_are_some(tmp_path: Path) -> None:
    chance = random.Random(6)
    edges = [0, 0x1f, 0x20, 0x7e, 0x7f, 0x80, 0x9f, 0xa0, 0x7ff, 0x800, 0xd7ff, 0xe000, 0xffff,
             0x10000, 0x10ffff]
    words = [chance.randbytes(8) for _ in range(2000)]
    for edge in edges:
        words += [(chr(edge) * 8).encode()[:8], (b'x' + (chr(edge) * 8).encode())[:8]]
    words += [raw.ljust(8, b'-') for raw in (
        b'\xc0\xaf', b'\xc1\xbf', b'\xe0\x80\xaf', b'\xe0\x9f\xbf', b'\xed\xa0\x80',
        b'\xed\xbf\xbf', b'\xf0\x8f\xbf\xbf', b'\xf4\x90\x80\x80', b'\xf5\x80\x80\x80', b'\xff')]

    def shown(word: bytes) -> str:  # a byte that is no character becomes a surrogate
        return ''.join(item if unicodedata.category(item) not in ('Cc', 'Cs') else
                       '?' * (2 if '\x80' <= item <= '\x9f' else 1)
                       for item in word.decode(errors='surrogateescape'))

    printed = spelled(tmp_path, [f'b {int.from_bytes(word, "little")}' for word in words])
    assert printed == [*map(shown, words)]
    assert sum('?' not in item for item in printed) > 5


def test_names_are_spelled_and_suggested_as_in_python(tmp_path: Path) -> None:
    chance = random.Random(7)
    special = '.%#$&@!?-*=^ +;:,/\\|~<>(){}[]\'"`'
    rows = [[*special], ['"a.b"', 'a.b'], ['$a', 'b%'], ['ab', 'ba', 'abb', 'aab', 'ab']]
    for letters in ('ab', 'abcdef_', f'abc{special}'):
        rows += [[''.join(chance.choices(letters, k=chance.randint(1, 12)))
                  for _ in range(chance.randint(1, 8))] for _ in range(1000)]
    printed = spelled(tmp_path, ['\t'.join(row) for row in rows], 'spelling')
    wanted = [(fret_name(name), did_you_mean(name, dict.fromkeys(others)))
              for name, *others in rows]
    assert printed == [f'{name}\t{hint}\t{int(bool(hint))}' for name, hint in wanted]
    assert sum(hint.count(' or ') == 2 for _, hint in wanted) > 100
