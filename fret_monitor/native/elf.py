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

"""Files of machine code in the format ELF."""

import os
from pathlib import Path
import struct


def is_machine_code(path: str) -> bool:
    """Return whether a file is one of this format; False if it cannot be read."""
    try:
        with open(path, 'rb') as file:
            return file.read(4) == b'\x7fELF'
    except OSError:
        return False


def is_cut_short(path: Path) -> bool:
    """
    Return whether an ELF file ends before its section headers, which come last.

    dlopen maps such a file without an error, and the process is killed by SIGBUS later.
    """
    try:
        with path.open('rb') as file:
            head = file.read(64)
            size = os.fstat(file.fileno()).st_size
    except OSError:
        return False  # dlopen will give the reason
    if len(head) < 64 or head[:4] != b'\x7fELF':
        return False
    order = '<' if head[5] == 1 else '>'
    # e_shoff, e_shentsize and e_shnum of the System V ABI, with 32 or 64 bits.
    fields = 'I10xHH' if head[4] == 1 else 'Q10xHH'
    begin, width, count = struct.unpack_from(order + fields, head, 0x20 if head[4] == 1 else 0x28)
    return int(begin + width * count) > size
